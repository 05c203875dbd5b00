/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/parts/parts.h"

#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeSolid.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepBuilderAPI_Sewing.hxx>
#include <BRepBuilderAPI_Transform.hxx>
#include <BRepFill.hxx>
#include <BRepLib.hxx>
#include <BRepPrimAPI_MakeRevol.hxx>
#include <GeomAPI_PointsToBSplineSurface.hxx>
#include <Geom_BSplineSurface.hxx>
#include <Geom_BezierCurve.hxx>
#include <ShapeUpgrade_UnifySameDomain.hxx>
#include <TColgp_Array1OfPnt.hxx>
#include <TColgp_Array2OfPnt.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopoDS.hxx>
#include <cmath>

static const int kBlades = 7;
static const double kSplitterStart = 0.5;
static const int kAlong = 13, kAcross = 5;

/* The hub's meridian, in the plane y = 0: from the eye (s = 0) to the rim (s = 1). */
static Handle(Geom_BezierCurve) hub_meridian()
{
    TColgp_Array1OfPnt poles(1, 4);
    poles(1) = gp_Pnt(7, 0, 26);
    poles(2) = gp_Pnt(8, 0, 13);
    poles(3) = gp_Pnt(14, 0, 5);
    poles(4) = gp_Pnt(30, 0, 4);
    return new Geom_BezierCurve(poles);
}

/* Point at s along the meridian, h = 0 on the hub … 1 at the tip, off the camber by `side` half
 * thicknesses. */
static gp_Pnt blade_point(const Handle(Geom_BezierCurve) & hub, double s, double h, double side)
{
    gp_Pnt on;
    gp_Vec along;
    hub->D1(s, on, along);
    double height = 11 - 6.5 * s;
    gp_Vec out = gp_Vec(-along.Z(), 0, along.X()).Normalized();
    if (out.X() + out.Z() < 0)
        out.Reverse();
    gp_Pnt p = on.Translated(out * (height * h));
    double thickness = (1.6 - 0.7 * h) * (0.7 + 0.6 * s * (1 - s));
    double wrap = (-55 * s + 20 * s * s + 6 * h * (1 - s)) * M_PI / 180;
    double angle = wrap + side * thickness / 2 / p.X();
    return gp_Pnt(p.X() * std::cos(angle), p.X() * std::sin(angle), p.Z());
}

/* A side, from inside the hub to the tip. */
static Handle(Geom_BSplineSurface) blade_side(double start, double side)
{
    Handle(Geom_BezierCurve) hub = hub_meridian();
    TColgp_Array2OfPnt points(1, kAlong, 1, kAcross);
    for (int i = 0; i < kAlong; i++)
        for (int j = 0; j < kAcross; j++) {
            double s = start + (0.97 - start) * i / (kAlong - 1);
            double h = -0.12 + 1.12 * j / (kAcross - 1);
            points(i + 1, j + 1) = blade_point(hub, s, h, side);
        }
    GeomAPI_PointsToBSplineSurface maker;
    maker.Interpolate(points);
    return maker.Surface();
}

static TopoDS_Shape ruled(const Handle(Geom_Curve) & a, const Handle(Geom_Curve) & b)
{
    return BRepFill::Face(BRepBuilderAPI_MakeEdge(a).Edge(), BRepBuilderAPI_MakeEdge(b).Edge());
}

/* Pressure side, suction side, leading and trailing edge, tip and foot, sewn into a solid. */
static TopoDS_Shape blade(double start)
{
    Handle(Geom_BSplineSurface) a = blade_side(start, 1), b = blade_side(start, -1);
    double u0, u1, v0, v1;
    a->Bounds(u0, u1, v0, v1);
    double w0, w1, x0, x1;
    b->Bounds(w0, w1, x0, x1);
    BRepBuilderAPI_Sewing sewing(1e-5);
    sewing.Add(BRepBuilderAPI_MakeFace(a, 1e-7).Face());
    sewing.Add(BRepBuilderAPI_MakeFace(b, 1e-7).Face());
    sewing.Add(ruled(a->UIso(u0), b->UIso(w0)));
    sewing.Add(ruled(a->UIso(u1), b->UIso(w1)));
    sewing.Add(ruled(a->VIso(v0), b->VIso(x0)));
    sewing.Add(ruled(a->VIso(v1), b->VIso(x1)));
    sewing.Perform();
    TopoDS_Solid solid = BRepBuilderAPI_MakeSolid(TopoDS::Shell(sewing.SewedShape()));
    BRepLib::OrientClosedSolid(solid);
    return solid;
}

static TopoDS_Shape hub()
{
    Handle(Geom_BezierCurve) meridian = hub_meridian();
    gp_Pnt eye = meridian->StartPoint(), rim = meridian->EndPoint();
    gp_Pnt corners[] = {rim, gp_Pnt(rim.X(), 0, 0), gp_Pnt(3, 0, 0), gp_Pnt(3, 0, eye.Z()), eye};
    BRepBuilderAPI_MakeWire wire(BRepBuilderAPI_MakeEdge(meridian).Edge());
    for (int i = 0; i < 4; i++)
        wire.Add(BRepBuilderAPI_MakeEdge(corners[i], corners[i + 1]));
    return BRepPrimAPI_MakeRevol(BRepBuilderAPI_MakeFace(wire.Wire()).Face(),
                                 gp_Ax1(gp::Origin(), gp::DZ()))
        .Shape();
}

TopoDS_Shape make_impeller()
{
    TopTools_ListOfShape arguments, tools;
    arguments.Append(hub());
    TopoDS_Shape kinds[] = {blade(0.04), blade(kSplitterStart)};
    for (int i = 0; i < 2 * kBlades; i++) {
        gp_Trsf turn;
        turn.SetRotation(gp_Ax1(gp::Origin(), gp::DZ()), M_PI * i / kBlades);
        tools.Append(BRepBuilderAPI_Transform(kinds[i % 2], turn, true).Shape());
    }
    BRepAlgoAPI_Fuse fuse;
    fuse.SetArguments(arguments);
    fuse.SetTools(tools);
    fuse.Build();
    return fuse.Shape();
}
