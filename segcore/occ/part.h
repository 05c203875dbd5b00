/* SPDX-License-Identifier: Apache-2.0 */
/* The part form (segcore/geom/part_form.h) while it is being put together. */
#ifndef SEGCORE_OCC_PART_H
#define SEGCORE_OCC_PART_H

#include "segcore/geom/part_form.h"
#include "segcore/occ/cad_file.h"
#include "segcore/occ/nurbs.h"

#include <Geom_Surface.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <string>
#include <vector>

namespace cad
{

struct PartTables {
    std::vector<SegFace> faces;
    std::vector<SegLoop> loops;
    std::vector<SegCoedge> coedges;
    std::vector<SegEdge> edges;
    std::vector<SegIgesEntity> iges_curves;
    std::vector<SegVertex> vertices;
    std::vector<SegTriangle> triangles;
    std::vector<double> reals;
};

/* A face with what its loops and triangles need: its surface in the file's place, as Open CASCADE
 * has it and as a B-spline. */
struct FaceSurface {
    TopoDS_Face face; /* orientation FORWARD */
    Handle(Geom_Surface) native;
    SplineSurface spline;
};

/* An edge's curve in space; `curve` has no poles where the edge is degenerate. */
struct EdgeCurve {
    Spline curve;
    double first = 0, last = 1; /* in the original's parameter */
};

inline SegVec3 vec(const gp_XYZ &v)
{
    return {v.X(), v.Y(), v.Z()};
}

/* The part form of a file. Throws InputError. */
std::string part_form(const CadFile &file, double chord_mm, double angle_rad);

/* Faces that are safe to read: natural bounds, curves in (u,v) and in space, made where missing. */
TopoDS_Face heal(const TopoDS_Face &face);

/* Appends the loops of `surface.face` and their coedges; edges are numbered by `edges` (IsSame, in
 * order of first use) and appended when new. */
void append_loops(const FaceSurface &surface, int32_t face, TopTools_IndexedMapOfShape &edges,
                  std::vector<EdgeCurve> &curves, PartTables &tables);

/* Tessellates all faces together, so that neighbours share points. Returns the chord used: the one
 * asked for, or more where the part is too large for it. */
double tessellate(std::vector<TopoDS_Face> &faces, double chord_mm, double angle_rad);

/* Appends the face's triangles; false where it has none. */
bool append_triangles(const FaceSurface &surface, int32_t face, bool reversed, PartTables &tables);

/* Appends a curve's numbers to `reals`. */
SegCurve append_curve(const Spline &spline, int dim, std::vector<double> &reals);

} // namespace cad

#endif
