/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/parts/parts.h"

#include <BRepAlgoAPI_Common.hxx>
#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepBuilderAPI_Transform.hxx>
#include <BRepFilletAPI_MakeFillet.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakePrism.hxx>
#include <BRepPrimAPI_MakeRevol.hxx>
#include <BRep_Tool.hxx>
#include <GC_MakeArcOfCircle.hxx>
#include <Geom_BSplineSurface.hxx>
#include <Geom_ConicalSurface.hxx>
#include <Geom_RectangularTrimmedSurface.hxx>
#include <ShapeUpgrade_UnifySameDomain.hxx>
#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColgp_Array2OfPnt.hxx>
#include <TopExp.hxx>
#include <TopTools_IndexedDataMapOfShapeListOfShape.hxx>
#include <TopoDS.hxx>
#include <cmath>

static const double kWidth = 30, kLength = 60, kHeight = 20;
static const double kBossX = 15, kBossY = 14;
static const double kFootRadius = 7.5, kTopRadius = 5.5, kTopEdge = 18, kFoot = 8;
static const double kFootFillet = 2, kTopFillet = 1;

/* The big face: x and y run evenly, z is a bicubic spline. Its edge at y = 30 is symmetric in x, so
 * that the piece meets its own image by half a turn there. */
static TopoDS_Shape big_face()
{
    static const double z[6][6] = {
        {11.0, 11.6, 12.4, 12.4, 12.0, 11.6}, {11.4, 12.3, 13.3, 13.2, 12.6, 12.0},
        {11.6, 12.8, 14.0, 13.8, 13.0, 12.4}, {11.2, 12.6, 13.9, 13.8, 13.0, 12.4},
        {10.4, 11.8, 13.1, 13.1, 12.6, 12.0}, {9.6, 10.8, 12.0, 12.2, 12.0, 11.6}};
    static const double greville[6] = {0, 1 / 9., 1 / 3., 2 / 3., 8 / 9., 1};
    TColgp_Array2OfPnt poles(1, 6, 1, 6);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            poles(i + 1, j + 1) = gp_Pnt(kWidth * greville[i], kLength / 2 * greville[j], z[i][j]);
    TColStd_Array1OfReal knots(1, 4);
    TColStd_Array1OfInteger multiplicities(1, 4);
    for (int i = 0; i < 4; i++) {
        knots(i + 1) = i / 3.;
        multiplicities(i + 1) = i % 3 ? 1 : 4;
    }
    Handle(Geom_BSplineSurface) surface =
        new Geom_BSplineSurface(poles, knots, knots, multiplicities, multiplicities, 3, 3);
    return BRepBuilderAPI_MakeFace(surface, 1e-7).Face();
}

/* A drafted wall under a spherical cap, as a solid of revolution. */
static TopoDS_Shape boss()
{
    gp_Pnt axis_foot(kBossX, kBossY, kFoot), axis_top(kBossX, kBossY, kHeight);
    gp_Pnt foot(kBossX + kFootRadius, kBossY, kFoot), edge(kBossX + kTopRadius, kBossY, kTopEdge);
    double rise = kHeight - kTopEdge;
    double radius = (kTopRadius * kTopRadius + rise * rise) / (2 * rise);
    double half = std::asin(kTopRadius / radius) / 2;
    gp_Pnt middle(kBossX + radius * std::sin(half), kBossY,
                  kHeight - radius * (1 - std::cos(half)));
    BRepBuilderAPI_MakeWire wire;
    wire.Add(BRepBuilderAPI_MakeEdge(axis_foot, foot));
    wire.Add(BRepBuilderAPI_MakeEdge(foot, edge));
    wire.Add(BRepBuilderAPI_MakeEdge(GC_MakeArcOfCircle(edge, middle, axis_top).Value()));
    wire.Add(BRepBuilderAPI_MakeEdge(axis_top, axis_foot));
    return BRepPrimAPI_MakeRevol(BRepBuilderAPI_MakeFace(wire.Wire()).Face(),
                                 gp_Ax1(axis_foot, gp::DZ()))
        .Shape();
}

static bool is_wall(const TopoDS_Shape &face)
{
    return BRep_Tool::Surface(TopoDS::Face(face))->IsKind(STANDARD_TYPE(Geom_ConicalSurface));
}

static bool is_free_form(const TopoDS_Shape &face)
{
    return BRep_Tool::Surface(TopoDS::Face(face))->IsKind(STANDARD_TYPE(Geom_BSplineSurface));
}

/* Foot and upper edge of the boss's wall, rounded. */
static TopoDS_Shape fillet(const TopoDS_Shape &piece)
{
    BRepFilletAPI_MakeFillet maker(piece);
    TopTools_IndexedDataMapOfShapeListOfShape owners;
    TopExp::MapShapesAndAncestors(piece, TopAbs_EDGE, TopAbs_FACE, owners);
    for (int i = 1; i <= owners.Extent(); i++) {
        const TopTools_ListOfShape &faces = owners(i);
        if (faces.Extent() != 2 || faces.First().IsSame(faces.Last()))
            continue;
        if (!is_wall(faces.First()) && !is_wall(faces.Last()))
            continue;
        bool foot = is_free_form(faces.First()) || is_free_form(faces.Last());
        maker.Add(foot ? kFootFillet : kTopFillet, TopoDS::Edge(owners.FindKey(i)));
    }
    return maker.Shape();
}

TopoDS_Shape make_p0_piece()
{
    TopoDS_Shape half = BRepPrimAPI_MakePrism(big_face(), gp_Vec(0, 0, -kHeight)).Shape();
    half = BRepAlgoAPI_Common(half, BRepPrimAPI_MakeBox(kWidth, kLength / 2, kHeight).Shape());
    half = fillet(BRepAlgoAPI_Fuse(half, boss()).Shape());
    gp_Trsf turn;
    turn.SetRotation(gp_Ax1(gp_Pnt(kWidth / 2, kLength / 2, 0), gp::DZ()), M_PI);
    TopoDS_Shape other = BRepBuilderAPI_Transform(half, turn, true).Shape();
    ShapeUpgrade_UnifySameDomain unify(BRepAlgoAPI_Fuse(half, other).Shape());
    unify.Build();
    return unify.Shape();
}
