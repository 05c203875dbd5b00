/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/parts/parts.h"

#include <BRepAlgoAPI_Splitter.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_Sewing.hxx>
#include <GeomAPI_PointsToBSplineSurface.hxx>
#include <Geom_BSplineSurface.hxx>
#include <TColgp_Array2OfPnt.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopoDS_Face.hxx>
#include <cmath>
#include <gp_Pln.hxx>

static const double kSpan = 48;
static const int kChordPoints = 21, kSections = 9;

/* Section at height h = 0…1, at c = 0…1 from the leading to the trailing edge; side +1 suction, -1
 * pressure. A four-digit thickness law (closed trailing edge) on a parabolic camber, twisted. */
static gp_Pnt blade_point(double h, double c, double side)
{
    double chord = 22 - 7 * h;
    double stagger = (15 + 32 * h) * M_PI / 180;
    double thick = 0.5 * (0.2 - 0.07 * h) / 0.2 *
                   (0.2969 * std::sqrt(c) - 0.1260 * c - 0.3516 * c * c + 0.2843 * c * c * c -
                    0.1036 * c * c * c * c) *
                   2;
    double camber = 4 * (0.14 - 0.06 * h) * c * (1 - c);
    double x = chord * (c - 0.4), y = chord * (camber + side * thick);
    return gp_Pnt(x * std::cos(stagger) - y * std::sin(stagger),
                  x * std::sin(stagger) + y * std::cos(stagger), kSpan * h);
}

static TopoDS_Face blade_side(double side)
{
    TColgp_Array2OfPnt points(1, kChordPoints, 1, kSections);
    for (int i = 0; i < kChordPoints; i++)
        for (int j = 0; j < kSections; j++) {
            double c = (1 - std::cos(M_PI * i / (kChordPoints - 1))) / 2;
            points(i + 1, j + 1) = blade_point(static_cast<double>(j) / (kSections - 1), c, side);
        }
    GeomAPI_PointsToBSplineSurface maker;
    maker.Interpolate(points);
    return BRepBuilderAPI_MakeFace(maker.Surface(), 1e-7).Face();
}

/* A plane through (0, 0, z), a little off the horizontal: its cut is no iso-parametric line. */
static TopoDS_Shape cutting_plane(double z, double tilt)
{
    gp_Pln plane(gp_Pnt(0, 0, z), gp_Dir(std::sin(tilt), 0.3 * std::sin(tilt), std::cos(tilt)));
    return BRepBuilderAPI_MakeFace(plane, -60, 60, -60, 60).Face();
}

TopoDS_Shape make_blade()
{
    BRepBuilderAPI_Sewing sewing(1e-4);
    sewing.Add(blade_side(1));
    sewing.Add(blade_side(-1));
    sewing.Perform();
    TopTools_ListOfShape arguments, tools;
    arguments.Append(sewing.SewedShape());
    tools.Append(cutting_plane(kSpan * 0.26, 0.06));
    tools.Append(cutting_plane(kSpan * 0.74, -0.05));
    BRepAlgoAPI_Splitter splitter;
    splitter.SetArguments(arguments);
    splitter.SetTools(tools);
    splitter.Build();
    return splitter.Shape().Reversed(); // the sides' u × v points into the blade
}
