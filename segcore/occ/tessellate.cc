/* SPDX-License-Identifier: Apache-2.0 */
/* Triangles of the faces, with the surface's own normals. */
#include "segcore/occ/part.h"

#include <BRepBndLib.hxx>
#include <BRepMesh_IncrementalMesh.hxx>
#include <BRepTools.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <Bnd_Box.hxx>
#include <GeomLib.hxx>
#include <IMeshTools_Parameters.hxx>
#include <Poly_Triangulation.hxx>
#include <ShapeFix_Face.hxx>
#include <TopoDS_Compound.hxx>
#include <cmath>
#include <iostream>

namespace cad
{

static const double kPole_mm = 1e-6; /* an iso-parametric line shorter than this is a point */

static void mesh(const TopoDS_Shape &shape, double chord_mm, double angle_rad)
{
    IMeshTools_Parameters parameters;
    parameters.Deflection = chord_mm;
    parameters.Angle = angle_rad;
    BRepMesh_IncrementalMesh(shape, parameters);
}

static bool is_meshed(const TopoDS_Face &face)
{
    TopLoc_Location location;
    Handle(Poly_Triangulation) mesh = BRep_Tool::Triangulation(face, location);
    return !mesh.IsNull() && mesh->NbTriangles() > 0 && mesh->HasUVNodes();
}

/* A chord far below the part's size asks for more triangles than can be made in time. */
static const double kLeastChord = 1e-5; /* of the diagonal of the part's box */

static double feasible_chord(const TopoDS_Shape &shape, double chord_mm)
{
    Bnd_Box box;
    BRepBndLib::Add(shape, box, false);
    if (box.IsVoid())
        return chord_mm;
    double size = std::sqrt(box.SquareExtent());
    if (!(size <= SEG_FORM_MAX_REAL))
        throw InputError("the part is " + std::to_string(size) + " mm large");
    double least = kLeastChord * size;
    if (chord_mm >= least)
        return chord_mm;
    std::cerr << "the part is " << size << " mm large: tessellated with a chord of " << least
              << " mm, not " << chord_mm << " mm\n";
    return least;
}

double tessellate(std::vector<TopoDS_Face> &faces, double chord_mm, double angle_rad)
{
    TopoDS_Compound all;
    BRep_Builder builder;
    builder.MakeCompound(all);
    for (const TopoDS_Face &face : faces)
        builder.Add(all, face);
    BRepTools::Clean(all);
    chord_mm = feasible_chord(all, chord_mm);
    mesh(all, chord_mm, angle_rad);
    for (TopoDS_Face &face : faces) {
        if (is_meshed(face))
            continue;
        mesh(face, chord_mm / 4, angle_rad / 2);
        if (is_meshed(face))
            continue;
        ShapeFix_Face fix(face);
        fix.Perform();
        TopoDS_Face fixed = fix.Face();
        mesh(fixed, chord_mm, angle_rad);
        if (is_meshed(fixed))
            face = fixed;
    }
    return chord_mm;
}

static double extent(const Spline &direction)
{
    return direction.knots.back() - direction.knots.front();
}

/* The unit vector along Su × Sv; at a pole of the surface its limit, or the zero vector. */
static gp_XYZ surface_normal(const FaceSurface &surface, const gp_Pnt2d &uv)
{
    gp_Pnt p;
    gp_Vec du, dv;
    surface.native->D1(uv.X(), uv.Y(), p, du, dv);
    gp_XYZ n = du.XYZ().Crossed(dv.XYZ());
    double length = n.Modulus();
    bool pole = du.Magnitude() * extent(surface.spline.u) < kPole_mm ||
                dv.Magnitude() * extent(surface.spline.v) < kPole_mm ||
                length < 1e-9 * du.Magnitude() * dv.Magnitude();
    if (!pole)
        return n / length;
    gp_Dir limit;
    if (GeomLib::NormEstim(surface.native, uv, 1e-7, limit) <= 1)
        return limit.XYZ();
    return {0, 0, 0};
}

/* A vertex whose surface has no normal takes that of a triangle at it. */
static void complete_normals(const SegTriangle *triangles, size_t n, std::vector<SegVertex> &all)
{
    for (size_t i = 0; i < n; i++)
        for (int32_t corner : triangles[i].vertex) {
            SegVertex &vertex = all[static_cast<size_t>(corner)];
            if (seg_norm(vertex.normal) > 0)
                continue;
            const SegVec3 &a = all[static_cast<size_t>(triangles[i].vertex[0])].position;
            const SegVec3 &b = all[static_cast<size_t>(triangles[i].vertex[1])].position;
            const SegVec3 &c = all[static_cast<size_t>(triangles[i].vertex[2])].position;
            vertex.normal = seg_unit(seg_cross(seg_sub(b, a), seg_sub(c, a)));
        }
}

bool append_triangles(const FaceSurface &surface, int32_t face, bool reversed, PartTables &tables)
{
    if (!is_meshed(surface.face))
        return false;
    TopLoc_Location location;
    Handle(Poly_Triangulation) mesh = BRep_Tool::Triangulation(surface.face, location);
    auto first = static_cast<int32_t>(tables.vertices.size());
    for (int i = 1; i <= mesh->NbNodes(); i++) {
        gp_Pnt2d uv = mesh->UVNode(i);
        gp_XYZ normal = surface_normal(surface, uv);
        SegVertex vertex;
        vertex.position = vec(mesh->Node(i).Transformed(location.Transformation()).XYZ());
        vertex.normal = vec(reversed ? normal * -1 : normal);
        vertex.u = to_spline(surface.spline.u, uv.X());
        vertex.v = to_spline(surface.spline.v, uv.Y());
        tables.vertices.push_back(vertex);
    }
    size_t first_triangle = tables.triangles.size();
    for (int i = 1; i <= mesh->NbTriangles(); i++) {
        int a, b, c;
        mesh->Triangle(i).Get(a, b, c);
        if (reversed)
            std::swap(b, c);
        tables.triangles.push_back({{first + a - 1, first + b - 1, first + c - 1}, face});
    }
    complete_normals(&tables.triangles[first_triangle], tables.triangles.size() - first_triangle,
                     tables.vertices);
    return true;
}

} // namespace cad
