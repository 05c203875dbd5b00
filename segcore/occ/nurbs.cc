/* SPDX-License-Identifier: Apache-2.0 */
#include "segcore/occ/nurbs.h"

#include <Adaptor3d_Curve.hxx>
#include <GeomAPI.hxx>
#include <GeomConvert.hxx>
#include <GeomConvert_ApproxSurface.hxx>
#include <Geom_BSplineCurve.hxx>
#include <Geom_BSplineSurface.hxx>
#include <Geom_BezierCurve.hxx>
#include <Geom_BezierSurface.hxx>
#include <Geom_Circle.hxx>
#include <Geom_ElementarySurface.hxx>
#include <Geom_Ellipse.hxx>
#include <Geom_Line.hxx>
#include <Geom_Plane.hxx>
#include <Geom_RectangularTrimmedSurface.hxx>
#include <Geom_SurfaceOfLinearExtrusion.hxx>
#include <Geom_SurfaceOfRevolution.hxx>
#include <Geom_TrimmedCurve.hxx>
#include <Precision.hxx>
#include <Standard_Failure.hxx>
#include <algorithm>
#include <cmath>
#include <gp_Ax1.hxx>
#include <gp_Pln.hxx>
#include <iostream>

namespace cad
{

static const double kQuarter = M_PI / 2;
static const double kSameAngle = 1e-6;     /* rad: no piece is shorter; an error of its square */
static const double kSameParameter = 1e-9; /* of a range: beyond its end by rounding only */
static const double kApproximation_mm = 1e-7;
static const double kTellError_mm = 1e-5;

static Spline convert_arc(const gp_XYZ &centre, const gp_XYZ &x, const gp_XYZ &y, double first,
                          double last);
static Spline convert_bspline(Handle(Geom_BSplineCurve) curve, double first, double last);
static std::vector<double> knots_within(const Handle(Geom_BSplineCurve) & curve, double first,
                                        double last);
static Spline approximate(const Handle(Geom_Curve) & curve, const std::vector<double> &breaks);
static SplineSurface revolve(const Spline &profile, const gp_Ax1 &axis, double u0, double u1);
static SplineSurface extrude(const Spline &profile, const gp_XYZ &direction, double v0, double v1);
static SplineSurface convert_bspline(Handle(Geom_BSplineSurface) surface, double u0, double u1,
                                     double v0, double v1);
static SplineSurface approximate(const Handle(Geom_Surface) & surface, double u0, double u1,
                                 double v0, double v1);

static Pole pole(const gp_XYZ &p, double w)
{
    return {p.X() * w, p.Y() * w, p.Z() * w, w};
}

/* The straight line from a at t0 to b at t1. */
static Spline line(const gp_XYZ &a, const gp_XYZ &b, double t0, double t1)
{
    Spline s;
    s.degree = 1;
    s.knots = {t0, t0, t1, t1};
    s.poles = {pole(a, 1), pole(b, 1)};
    return s;
}

Spline convert(const Handle(Geom_Curve) & curve, double first, double last)
{
    if (auto trimmed = Handle(Geom_TrimmedCurve)::DownCast(curve))
        return convert(trimmed->BasisCurve(), first, last);
    if (curve->IsKind(STANDARD_TYPE(Geom_Line)))
        return line(curve->Value(first).XYZ(), curve->Value(last).XYZ(), first, last);
    if (auto circle = Handle(Geom_Circle)::DownCast(curve)) {
        const gp_Ax2 &at = circle->Position();
        double r = circle->Radius();
        return convert_arc(at.Location().XYZ(), at.XDirection().XYZ() * r,
                           at.YDirection().XYZ() * r, first, last);
    }
    if (auto ellipse = Handle(Geom_Ellipse)::DownCast(curve)) {
        const gp_Ax2 &at = ellipse->Position();
        return convert_arc(at.Location().XYZ(), at.XDirection().XYZ() * ellipse->MajorRadius(),
                           at.YDirection().XYZ() * ellipse->MinorRadius(), first, last);
    }
    if (auto spline = Handle(Geom_BSplineCurve)::DownCast(curve))
        return convert_bspline(Handle(Geom_BSplineCurve)::DownCast(spline->Copy()), first, last);
    if (auto bezier = Handle(Geom_BezierCurve)::DownCast(curve))
        return convert_bspline(GeomConvert::CurveToBSplineCurve(bezier), first, last);
    return approximate(curve, {first, last});
}

Spline convert(const Handle(Geom2d_Curve) & curve, double first, double last)
{
    return convert(GeomAPI::To3d(curve, gp_Pln()), first, last);
}

SplineSurface convert(const Handle(Geom_Surface) & surface, double u0, double u1, double v0,
                      double v1)
{
    if (auto trimmed = Handle(Geom_RectangularTrimmedSurface)::DownCast(surface))
        return convert(trimmed->BasisSurface(), u0, u1, v0, v1);
    if (auto plane = Handle(Geom_Plane)::DownCast(surface))
        return extrude(convert(plane->VIso(0), u0, u1), plane->Position().YDirection().XYZ(), v0,
                       v1);
    if (auto round = Handle(Geom_ElementarySurface)::DownCast(surface)) {
        const gp_Ax3 &at = round->Position();
        gp_Ax1 axis(at.Location(), at.Direct() ? at.Direction() : at.Direction().Reversed());
        return revolve(convert(round->UIso(0), v0, v1), axis, u0, u1);
    }
    if (auto revolution = Handle(Geom_SurfaceOfRevolution)::DownCast(surface))
        return revolve(convert(revolution->BasisCurve(), v0, v1), revolution->Axis(), u0, u1);
    if (auto extrusion = Handle(Geom_SurfaceOfLinearExtrusion)::DownCast(surface))
        return extrude(convert(extrusion->BasisCurve(), u0, u1), extrusion->Direction().XYZ(), v0,
                       v1);
    if (auto spline = Handle(Geom_BSplineSurface)::DownCast(surface))
        return convert_bspline(Handle(Geom_BSplineSurface)::DownCast(spline->Copy()), u0, u1, v0,
                               v1);
    return approximate(surface, u0, u1, v0, v1);
}

/* ------------------------------------------------------------------ arcs */

double arc_parameter(double angle)
{
    double start = std::floor(angle / kQuarter) * kQuarter;
    double half = std::tan((angle - start) / 2 - M_PI / 8) / std::tan(M_PI / 8);
    return start + kQuarter / 2 * (1 + half);
}

double arc_angle(double parameter)
{
    double start = std::floor(parameter / kQuarter) * kQuarter;
    double half = (parameter - start) / (kQuarter / 2) - 1;
    return start + M_PI / 4 + 2 * std::atan(half * std::tan(M_PI / 8));
}

double to_spline(const Spline &spline, double parameter)
{
    return spline.angular ? arc_parameter(parameter) : parameter;
}

double from_spline(const Spline &spline, double parameter)
{
    return spline.angular ? arc_angle(parameter) : parameter;
}

/* Polar form of the quarter arc from angle `start`: (w·cos, w·sin, 0, w) at (s, s). */
static Pole arc_blossom(double start, double s, double t)
{
    double c = std::cos(start), d = std::sin(start), h = std::sqrt(0.5);
    double a = (1 - s) * (1 - t), b = h * (s + t - 2 * s * t), e = s * t;
    double x = a + b, y = b + e;
    return {c * x - d * y, d * x + c * y, 0, a + b + e};
}

/* The unit arc over [first, last] rad: knots, and (w·cos, w·sin, 0, w) as poles. */
static Spline unit_arc(double first, double last)
{
    Spline s;
    s.degree = 2;
    s.rational = s.angular = true;
    std::vector<double> ends = {first};
    for (double q = std::floor(first / kQuarter) + 1; q * kQuarter < last - kSameAngle; q++)
        if (q * kQuarter > first + kSameAngle)
            ends.push_back(q * kQuarter);
    ends.push_back(last);
    s.knots.push_back(arc_parameter(first));
    for (size_t i = 0; i + 1 < ends.size(); i++) {
        double start = std::floor((ends[i] + ends[i + 1]) / 2 / kQuarter) * kQuarter;
        double p0 = (arc_parameter(ends[i]) - start) / kQuarter;
        double p1 = (arc_parameter(ends[i + 1]) - start) / kQuarter;
        s.knots.insert(s.knots.end(), 2, arc_parameter(ends[i]));
        if (i == 0)
            s.poles.push_back(arc_blossom(start, p0, p0));
        s.poles.push_back(arc_blossom(start, p0, p1));
        s.poles.push_back(arc_blossom(start, p1, p1));
    }
    s.knots.insert(s.knots.end(), 3, arc_parameter(last));
    return s;
}

static Spline convert_arc(const gp_XYZ &centre, const gp_XYZ &x, const gp_XYZ &y, double first,
                          double last)
{
    Spline s = unit_arc(first, last);
    for (Pole &p : s.poles) {
        gp_XYZ at = centre * p[3] + x * p[0] + y * p[1];
        p = {at.X(), at.Y(), at.Z(), p[3]};
    }
    return s;
}

static SplineSurface revolve(const Spline &profile, const gp_Ax1 &axis, double u0, double u1)
{
    SplineSurface s;
    s.u = unit_arc(u0, u1);
    s.v = profile;
    s.n_u = static_cast<int>(s.u.poles.size());
    s.n_v = static_cast<int>(s.v.poles.size());
    s.rational = true;
    const gp_XYZ &origin = axis.Location().XYZ(), &z = axis.Direction().XYZ();
    for (const Pole &arc : s.u.poles)
        for (const Pole &p : profile.poles) {
            gp_XYZ out = gp_XYZ(p[0], p[1], p[2]) - origin * p[3];
            gp_XYZ along = z * out.Dot(z);
            gp_XYZ r = out - along;
            gp_XYZ at = (origin * p[3] + along) * arc[3] + r * arc[0] + z.Crossed(r) * arc[1];
            s.poles.push_back({at.X(), at.Y(), at.Z(), p[3] * arc[3]});
        }
    return s;
}

static SplineSurface extrude(const Spline &profile, const gp_XYZ &direction, double v0, double v1)
{
    SplineSurface s;
    s.u = profile;
    s.v.degree = 1;
    s.v.knots = {v0, v0, v1, v1};
    s.n_u = static_cast<int>(profile.poles.size());
    s.n_v = 2;
    s.rational = profile.rational;
    for (const Pole &p : profile.poles)
        for (double v : {v0, v1}) {
            gp_XYZ at = gp_XYZ(p[0], p[1], p[2]) + direction * (v * p[3]);
            s.poles.push_back({at.X(), at.Y(), at.Z(), p[3]});
        }
    return s;
}

/* -------------------------------------------------------------- B-splines */

static Spline convert_bspline(Handle(Geom_BSplineCurve) curve, double first, double last)
{
    double start = curve->FirstParameter(), end = curve->LastParameter();
    double slack = kSameParameter * (end - start);
    bool beyond = first < start - slack || last > end + slack;
    if (curve->IsPeriodic() && beyond)
        curve->Segment(first, last);
    else if (curve->IsPeriodic())
        curve->SetNotPeriodic();
    else if (beyond)
        return approximate(curve, knots_within(curve, first, last));
    if (curve->Multiplicity(1) <= curve->Degree() ||
        curve->Multiplicity(curve->NbKnots()) <= curve->Degree())
        curve->Segment(curve->FirstParameter(), curve->LastParameter());
    Spline s;
    s.degree = curve->Degree();
    s.rational = curve->IsRational();
    start = curve->FirstParameter();
    end = curve->LastParameter();
    for (double knot : curve->KnotSequence()) /* the ends take up rounding of the range */
        s.knots.push_back(knot <= start ? std::min(knot, first)
                          : knot >= end ? std::max(knot, last)
                                        : knot);
    for (int i = 1; i <= curve->NbPoles(); i++)
        s.poles.push_back(pole(curve->Pole(i).XYZ(), curve->Weight(i)));
    return s;
}

/* first, the curve's knots between, last. */
static std::vector<double> knots_within(const Handle(Geom_BSplineCurve) & curve, double first,
                                        double last)
{
    std::vector<double> breaks = {first};
    for (double knot : curve->Knots())
        if (knot > breaks.back() && knot < last)
            breaks.push_back(knot);
    breaks.push_back(last);
    return breaks;
}

/* Any curve over the breaks, its ends extrapolated where they lie beyond it. */
static Spline approximate(const Handle(Geom_Curve) & curve, const std::vector<double> &breaks)
{
    auto value = [&](double t) { return curve->Value(t).XYZ(); };
    auto deviation = [&](double t, const gp_XYZ &p) {
        return (curve->Value(t).XYZ() - p).Modulus();
    };
    return fit(value, deviation, breaks, kApproximation_mm);
}

/* Makes a periodic direction plain, from u0 where [u0, u1] leaves the first period. */
static void unroll(const Handle(Geom_BSplineSurface) & s, double u0, double u1, double v0,
                   double v1)
{
    double a, b, c, d, small = Precision::PConfusion();
    s->Bounds(a, b, c, d);
    bool beyond_u = s->IsUPeriodic() && (u0 < a - small || u1 > b + small);
    bool beyond_v = s->IsVPeriodic() && (v0 < c - small || v1 > d + small);
    if (beyond_u || beyond_v)
        s->Segment(beyond_u ? u0 : a, beyond_u ? u1 : b, beyond_v ? v0 : c, beyond_v ? v1 : d);
    if (s->IsUPeriodic())
        s->SetUNotPeriodic();
    if (s->IsVPeriodic())
        s->SetVNotPeriodic();
    int p = s->UDegree(), q = s->VDegree();
    if (s->UMultiplicity(1) <= p || s->UMultiplicity(s->NbUKnots()) <= p ||
        s->VMultiplicity(1) <= q || s->VMultiplicity(s->NbVKnots()) <= q) {
        s->Bounds(a, b, c, d);
        s->Segment(a, b, c, d);
    }
}

static SplineSurface convert_bspline(Handle(Geom_BSplineSurface) surface, double u0, double u1,
                                     double v0, double v1)
{
    unroll(surface, u0, u1, v0, v1);
    SplineSurface s;
    s.u.degree = surface->UDegree();
    s.v.degree = surface->VDegree();
    for (double knot : surface->UKnotSequence())
        s.u.knots.push_back(knot);
    for (double knot : surface->VKnotSequence())
        s.v.knots.push_back(knot);
    s.n_u = surface->NbUPoles();
    s.n_v = surface->NbVPoles();
    s.rational = surface->IsURational() || surface->IsVRational();
    for (int i = 1; i <= s.n_u; i++)
        for (int j = 1; j <= s.n_v; j++)
            s.poles.push_back(pole(surface->Pole(i, j).XYZ(), surface->Weight(i, j)));
    return s;
}

static SplineSurface approximate(const Handle(Geom_Surface) & surface, double u0, double u1,
                                 double v0, double v1)
{
    Handle(Geom_BSplineSurface) result;
    if (auto bezier = Handle(Geom_BezierSurface)::DownCast(surface)) {
        result = GeomConvert::SurfaceToBSplineSurface(bezier);
    } else {
        Handle(Geom_Surface) part = new Geom_RectangularTrimmedSurface(surface, u0, u1, v0, v1);
        GeomConvert_ApproxSurface maker(part, kApproximation_mm, GeomAbs_C1, GeomAbs_C1, 11, 11,
                                        200, 0);
        if (!maker.HasResult())
            throw Standard_Failure("the surface cannot be approximated by a B-spline");
        if (maker.MaxError() > kTellError_mm)
            std::cerr << surface->DynamicType()->Name() << ": approximated within "
                      << maker.MaxError() << " mm\n";
        result = maker.Surface();
    }
    return convert_bspline(result, u0, u1, v0, v1);
}

} // namespace cad
