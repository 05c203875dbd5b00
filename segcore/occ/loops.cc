/* SPDX-License-Identifier: Apache-2.0 */
/* Loops, coedges and edges of a face. */
#include "segcore/occ/part.h"

#include <BRepLib.hxx>
#include <BRepTools.hxx>
#include <BRepTools_WireExplorer.hxx>
#include <BRep_Tool.hxx>
#include <Geom2d_BSplineCurve.hxx>
#include <Geom2d_TrimmedCurve.hxx>
#include <ShapeAnalysis.hxx>
#include <ShapeExtend_WireData.hxx>
#include <ShapeFix_Edge.hxx>
#include <ShapeFix_Face.hxx>
#include <ShapeFix_Wire.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Iterator.hxx>
#include <TopoDS_Wire.hxx>
#include <algorithm>
#include <cmath>

namespace cad
{

static const double kPcurveTolerance_mm = 1e-7;

static std::vector<TopoDS_Wire> wires_outer_first(const TopoDS_Face &face);
static std::vector<TopoDS_Edge> ordered_edges(const TopoDS_Wire &wire, const TopoDS_Face &face);
static int32_t edge_index(const TopoDS_Edge &edge, const FaceSurface &surface, int32_t face,
                          TopTools_IndexedMapOfShape &edges, std::vector<EdgeCurve> &curves,
                          PartTables &tables);
static Spline pcurve(const TopoDS_Edge &edge, const EdgeCurve &curve, const FaceSurface &surface);

void append_loops(const FaceSurface &surface, int32_t face, TopTools_IndexedMapOfShape &edges,
                  std::vector<EdgeCurve> &curves, PartTables &tables)
{
    bool outer = true;
    for (const TopoDS_Wire &wire : wires_outer_first(surface.face)) {
        SegLoop loop = {};
        loop.first_coedge = static_cast<int32_t>(tables.coedges.size());
        loop.outer = outer;
        outer = false;
        for (const TopoDS_Edge &edge : ordered_edges(wire, surface.face)) {
            SegCoedge coedge = {};
            coedge.edge = edge_index(edge, surface, face, edges, curves, tables);
            const EdgeCurve &curve = curves[static_cast<size_t>(coedge.edge)];
            coedge.pcurve = append_curve(pcurve(edge, curve, surface), 2, tables.reals);
            coedge.t_first = to_spline(curve.curve, curve.first);
            coedge.t_last = to_spline(curve.curve, curve.last);
            coedge.reversed = edge.Orientation() == TopAbs_REVERSED;
            tables.coedges.push_back(coedge);
        }
        loop.n_coedges = static_cast<int32_t>(tables.coedges.size()) - loop.first_coedge;
        if (loop.n_coedges > 0)
            tables.loops.push_back(loop);
    }
}

/* ------------------------------------------------------------------ healing */

TopoDS_Face heal(const TopoDS_Face &face)
{
    TopoDS_Face healed = face;
    if (!TopExp_Explorer(face, TopAbs_WIRE).More()) {
        ShapeFix_Face fix(face);
        if (fix.FixAddNaturalBound())
            healed = fix.Face();
    }
    for (TopExp_Explorer it(healed, TopAbs_EDGE); it.More(); it.Next()) {
        const TopoDS_Edge &edge = TopoDS::Edge(it.Current());
        double first, last;
        if (BRep_Tool::CurveOnSurface(edge, healed, first, last).IsNull())
            ShapeFix_Edge().FixAddPCurve(edge, healed, BRep_Tool::IsClosed(edge, healed));
        if (!BRep_Tool::Degenerated(edge) && BRep_Tool::Curve(edge, first, last).IsNull())
            BRepLib::BuildCurve3d(edge);
    }
    return healed;
}

/* -------------------------------------------------------------------- wires */

static std::vector<TopoDS_Wire> wires_outer_first(const TopoDS_Face &face)
{
    std::vector<TopoDS_Wire> wires;
    for (TopoDS_Iterator it(face); it.More(); it.Next())
        if (it.Value().ShapeType() == TopAbs_WIRE)
            wires.push_back(TopoDS::Wire(it.Value()));
    if (wires.size() > 1) {
        TopoDS_Wire outer = BRepTools::OuterWire(face);
        std::stable_partition(wires.begin(), wires.end(),
                              [&](const TopoDS_Wire &wire) { return wire.IsSame(outer); });
    }
    return wires;
}

static bool bounds(const TopoDS_Edge &edge)
{
    return edge.Orientation() == TopAbs_FORWARD || edge.Orientation() == TopAbs_REVERSED;
}

/* The wire's edges, each where the one before it ends. The explorer stops at a gap; then the
 * reordering of the healer is taken. */
static std::vector<TopoDS_Edge> ordered_edges(const TopoDS_Wire &wire, const TopoDS_Face &face)
{
    size_t all = 0;
    for (TopoDS_Iterator it(wire); it.More(); it.Next())
        all += it.Value().ShapeType() == TopAbs_EDGE && bounds(TopoDS::Edge(it.Value()));
    std::vector<TopoDS_Edge> edges;
    for (BRepTools_WireExplorer it(wire, face); it.More(); it.Next())
        if (bounds(it.Current()))
            edges.push_back(it.Current());
    if (edges.size() == all)
        return edges;
    edges.clear();
    ShapeFix_Wire fix(wire, face, Precision::Confusion());
    fix.FixReorder();
    for (int i = 1; i <= fix.WireData()->NbEdges(); i++)
        if (bounds(fix.WireData()->Edge(i)))
            edges.push_back(fix.WireData()->Edge(i));
    return edges;
}

/* -------------------------------------------------------------------- edges */

/* The curve in space; where the file has none and it cannot be built, the (u,v) curve's image. */
static EdgeCurve edge_curve(const TopoDS_Edge &edge, const FaceSurface &surface, gp_Pnt ends[2])
{
    EdgeCurve result;
    double a, b;
    Handle(Geom_Curve) curve = BRep_Tool::Curve(edge, a, b);
    Handle(Geom2d_Curve) uv =
        BRep_Tool::CurveOnSurface(edge, surface.face, result.first, result.last);
    if (!curve.IsNull() && !BRep_Tool::Degenerated(edge)) {
        result.first = a;
        result.last = b;
        if (!(b > a))
            throw InputError("has an edge with an empty parameter range");
        result.curve = convert(curve, a, b);
        ends[0] = curve->Value(a);
        ends[1] = curve->Value(b);
        return result;
    }
    if (uv.IsNull())
        throw InputError("has an edge without a curve");
    auto at = [&](double t) {
        gp_Pnt2d p = uv->Value(t);
        return surface.native->Value(p.X(), p.Y());
    };
    ends[0] = at(result.first);
    ends[1] = at(result.last);
    if (!BRep_Tool::Degenerated(edge))
        result.curve = fit([&](double t) { return at(t).XYZ(); },
                           [&](double t, const gp_XYZ &p) { return (at(t).XYZ() - p).Modulus(); },
                           {result.first, result.last}, kPcurveTolerance_mm);
    return result;
}

static int32_t edge_index(const TopoDS_Edge &edge, const FaceSurface &surface, int32_t face,
                          TopTools_IndexedMapOfShape &edges, std::vector<EdgeCurve> &curves,
                          PartTables &tables)
{
    int32_t index = edges.FindIndex(edge) - 1;
    if (index < 0) {
        gp_Pnt ends[2];
        EdgeCurve curve = edge_curve(TopoDS::Edge(edge.Oriented(TopAbs_FORWARD)), surface, ends);
        SegEdge record = {};
        record.curve = append_curve(curve.curve, 3, tables.reals);
        record.t_first = to_spline(curve.curve, curve.first);
        record.t_last = to_spline(curve.curve, curve.last);
        record.face[0] = record.face[1] = -1;
        record.ends[0] = vec(ends[0].XYZ());
        record.ends[1] = vec(ends[1].XYZ());
        index = edges.Add(edge) - 1;
        tables.edges.push_back(record);
        curves.push_back(curve);
    }
    SegEdge &record = tables.edges[static_cast<size_t>(index)];
    if (record.face[0] < 0)
        record.face[0] = face;
    else if (record.face[1] < 0)
        record.face[1] = face;
    return index;
}

/* ------------------------------------------------------------------ pcurves */

/* How an edge's parameter leads to the (u,v) of the B-spline surface. */
struct Trace {
    const FaceSurface &surface;
    const EdgeCurve &edge;
    Handle(Geom2d_Curve) uv;
    double first, last; /* of uv */

    double uv_parameter(double t) const
    {
        double s = (from_spline(edge.curve, t) - edge.first) / (edge.last - edge.first);
        return first + s * (last - first);
    }
    gp_XYZ native(double t) const
    {
        gp_Pnt2d p = uv->Value(uv_parameter(t));
        return {p.X(), p.Y(), 0};
    }
    gp_XYZ operator()(double t) const
    {
        gp_XYZ p = native(t);
        return {to_spline(surface.spline.u, p.X()), to_spline(surface.spline.v, p.Y()), 0};
    }
    double deviation(double t, const gp_XYZ &p) const
    {
        gp_XYZ q = native(t);
        gp_Pnt is = surface.native->Value(from_spline(surface.spline.u, p.X()),
                                          from_spline(surface.spline.v, p.Y()));
        return surface.native->Value(q.X(), q.Y()).Distance(is);
    }
};

/* Adds where the trace crosses a bound of a quarter in the given angular direction between two
 * breaks: its third derivative jumps there. */
static void add_quarter_crossings(const Trace &trace, int axis, std::vector<double> &breaks)
{
    const int samples = 16;
    auto quarter = [&](double t) { return std::floor(trace.native(t).Coord(axis) / (M_PI / 2)); };
    std::vector<double> crossings;
    for (size_t i = 0; i + 1 < breaks.size(); i++)
        for (int k = 0; k < samples; k++) {
            double a = breaks[i] + (breaks[i + 1] - breaks[i]) * k / samples;
            double b = breaks[i] + (breaks[i + 1] - breaks[i]) * (k + 1) / samples;
            double from = quarter(a);
            if (from == quarter(b))
                continue;
            for (int step = 0; step < 60; step++) {
                double middle = (a + b) / 2;
                (quarter(middle) == from ? a : b) = middle;
            }
            crossings.push_back(b);
        }
    breaks.insert(breaks.end(), crossings.begin(), crossings.end());
}

/* The parameters of the edge between which its trace is smooth. */
static std::vector<double> smooth_breaks(const Trace &trace)
{
    double a = to_spline(trace.edge.curve, trace.edge.first);
    double b = to_spline(trace.edge.curve, trace.edge.last);
    std::vector<double> breaks = {a, b};
    for (double knot : trace.edge.curve.knots)
        breaks.push_back(knot);
    Handle(Geom2d_Curve) uv = trace.uv;
    if (auto trimmed = Handle(Geom2d_TrimmedCurve)::DownCast(uv))
        uv = trimmed->BasisCurve();
    if (auto spline = Handle(Geom2d_BSplineCurve)::DownCast(uv))
        for (int i = 1; i <= spline->NbKnots(); i++) {
            double s = (spline->Knot(i) - trace.first) / (trace.last - trace.first);
            double t = trace.edge.first + s * (trace.edge.last - trace.edge.first);
            breaks.push_back(to_spline(trace.edge.curve, t));
        }
    auto tidy = [&] {
        std::sort(breaks.begin(), breaks.end());
        double least = (b - a) * 1e-7;
        std::vector<double> kept = {a};
        for (double t : breaks)
            if (t > kept.back() + least && t < b - least)
                kept.push_back(t);
        kept.push_back(b);
        breaks = kept;
    };
    tidy();
    if (trace.surface.spline.u.angular)
        add_quarter_crossings(trace, 1, breaks);
    if (trace.surface.spline.v.angular)
        add_quarter_crossings(trace, 2, breaks);
    tidy();
    return breaks;
}

/* The edge's curve in the (u,v) of the face's B-spline surface, over the edge's own parameter:
 * the file's own curve where no parameter changes, else a fit to it. */
static Spline pcurve(const TopoDS_Edge &edge, const EdgeCurve &curve, const FaceSurface &surface)
{
    Trace trace = {surface, curve, nullptr, 0, 0};
    trace.uv = BRep_Tool::CurveOnSurface(edge, surface.face, trace.first, trace.last);
    if (trace.uv.IsNull() || !(trace.last > trace.first))
        throw InputError("has an edge without a curve in its surface's parameters");
    bool same_range = std::abs(trace.first - curve.first) <= 1e-12 * (1 + std::abs(curve.first)) &&
                      std::abs(trace.last - curve.last) <= 1e-12 * (1 + std::abs(curve.last));
    if (same_range && !surface.spline.u.angular && !surface.spline.v.angular) {
        Spline own = convert(trace.uv, trace.first, trace.last);
        if (own.angular == curve.curve.angular)
            return own;
    }
    return fit(
        trace, [&](double t, const gp_XYZ &p) { return trace.deviation(t, p); },
        smooth_breaks(trace), kPcurveTolerance_mm);
}

} // namespace cad
