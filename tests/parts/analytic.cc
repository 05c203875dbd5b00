/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/parts/parts.h"

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepBuilderAPI_Transform.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCone.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <BRep_Builder.hxx>
#include <TopoDS_Compound.hxx>

/* A plate of 40 × 30 × 5 with a through hole of radius 4 and one of radius 2.5. */
static TopoDS_Shape plate()
{
    TopoDS_Shape plate = BRepPrimAPI_MakeBox(40, 30, 5).Shape();
    gp_Ax2 first(gp_Pnt(12, 15, -1), gp::DZ()), second(gp_Pnt(30, 10, -1), gp::DZ());
    plate = BRepAlgoAPI_Cut(plate, BRepPrimAPI_MakeCylinder(first, 4, 7).Shape());
    return BRepAlgoAPI_Cut(plate, BRepPrimAPI_MakeCylinder(second, 2.5, 7).Shape());
}

TopoDS_Shape make_analytic()
{
    TopoDS_Shape solids[] = {
        BRepPrimAPI_MakeBox(10, 20, 30).Shape(), BRepPrimAPI_MakeCylinder(5, 20).Shape(),
        BRepPrimAPI_MakeCone(8, 3, 12).Shape(),  BRepPrimAPI_MakeSphere(7).Shape(),
        BRepPrimAPI_MakeTorus(10, 3).Shape(),    plate()};
    TopoDS_Compound all;
    BRep_Builder().MakeCompound(all);
    double x = 0;
    for (const TopoDS_Shape &solid : solids) {
        gp_Trsf turn, move;
        turn.SetRotation(gp_Ax1(gp::Origin(), gp_Dir(1, 2, 3)), 0.1 * (1 + x / 60));
        move.SetTranslation(gp_Vec(x, 0, 0));
        BRep_Builder().Add(all, BRepBuilderAPI_Transform(solid, move * turn, true).Shape());
        x += 60;
    }
    return all;
}
