/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Bicubic T-spline surfaces (Sederberg and others 2003, 2004; P1 §2.1, eq. 1-3). Part of segcore's
 * public interface: include segcore/segcore.h.
 *
 * The T-mesh lies on a grid of index lines: line i of u has the value knots_u[i], and lines of
 * equal value lie at no distance. Its faces are rectangles between lines, some of them holes, and
 * tile the whole grid; their sides are its edges. Its vertices are the corners of the faces, and
 * points between them on an edge. A vertex has a control point, whose two knot vectors are found by
 * rays: from it along its line, two to either side, the lines where the ray meets an edge across or
 * a vertex; where it leaves the grid the last line repeats. The surface is S(u,v) = Σ w P N_U(u)
 * N_V(v) / Σ w N_U(u) N_V(v) over the faces that are no holes: any union of rectangles. An end
 * where it is clamped has its line twice, so a B-spline surface of n × m poles is a T-spline of n ×
 * m lines.
 */
#ifndef SEGCORE_TSPLINE_H
#define SEGCORE_TSPLINE_H

#include <glib.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "segcore/surface.h"

typedef struct SegPart SegPart;

/* From line i0 to i1 of u, j0 to j1 of v. */
typedef struct {
    int32_t i0, i1, j0, j1;
    int32_t hole; /* 1: no part of the surface */
} SegTface;

/* The control point of the vertex where lines i and j cross. mm. */
typedef struct {
    int32_t i, j;
    double x, y, z;
    double w; /* weight, > 0 */
} SegTpoint;

/* Most lines of one direction, and most crossings of lines. */
enum { SEG_TSPLINE_MAX_LINES = 1 << 14, SEG_TSPLINE_MAX_CROSSINGS = 1 << 23 };

/* Immutable; what is below `points` is found from what is above. */
typedef struct {
    int32_t n_u, n_v;
    double *knots_u, *knots_v; /* ascending */
    int32_t n_faces, n_points;
    SegTface *faces;
    SegTpoint *points;
    int32_t (*lines_u)[5], (*lines_v)[5]; /* of each point, the lines of its knot vectors */
    /* The points that are not zero all over face f: influence[first_influence[f]] … up to the
     * first of f + 1. Empty for holes and for faces of no area. */
    int32_t *influence, *first_influence;
    int32_t *cells; /* the face between lines i, i + 1 and j, j + 1: cells[i·(n_v - 1) + j] */
    struct SegTpatches *patches;
} SegTspline;

/*
 * Checks and copies. SEG_ERROR_INPUT: a number that is not finite or too large, knots that descend,
 * a weight that is not positive, faces that overlap or leave a gap, a point inside a face or twice
 * in one place, a vertex without a point whose function would reach the surface, a face that the
 * functions do not cover up to its border, a function that jumps inside a face (four equal knots),
 * no face with an area.
 */
SegTspline *seg_tspline_new(const double *knots_u, int32_t n_u, const double *knots_v, int32_t n_v,
                            const SegTface *faces, int32_t n_faces, const SegTpoint *points,
                            int32_t n_points, GError **error);
void seg_tspline_free(SegTspline *tspline);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SegTspline, seg_tspline_free)

/* The smallest rectangle of (u,v) that holds the surface. */
void seg_tspline_domain(const SegTspline *tspline, double *u0, double *u1, double *v0, double *v1);

/*
 * As seg_face_grid; u and v ascend. Each face is evaluated from its own influence points, as the
 * B-spline surface they make of it, and points where there is no surface are SEG_POINT_OUTSIDE and
 * otherwise zero. On an edge the face of larger parameters counts, where there is one. The normal
 * is Su × Sv.
 */
void seg_tspline_grid(const SegTspline *tspline, const double *u, size_t n_u, const double *v,
                      size_t n_v, SegSurfaceBatch *out);

/* The same at scattered points (u[i], v[i]). */
void seg_tspline_points(const SegTspline *tspline, const double *u, const double *v, size_t n,
                        SegSurfaceBatch *out);

/*
 * The surface of a face, all of it, without its loops: degrees 1 and 2 are raised to 3 (each knot
 * once or twice more), knots are kept, and both are the same surface. SEG_ERROR_ARGUMENT: a degree
 * above 3, a face without a surface.
 */
SegTspline *seg_tspline_from_face(const SegPart *part, int32_t face, GError **error);

/*
 * Face `face` as a bicubic B-spline surface, for output: its tables lie in *reals, and belong to
 * the T-spline. n_u is 0 for holes and for faces of no area. Together the patches are the surface.
 */
const struct SegSurface *seg_tspline_patch(const SegTspline *tspline, int32_t face,
                                           const double **reals);

/* The line u = at for v in [from, to]; or v = at for u in [from, to]. */
typedef struct {
    bool of_u;
    double at, from, to;
} SegTline;

/*
 * Local refinement (Sederberg and others 2004; P1 §3.2): the same surface over a T-mesh in which
 * the lines are edges wherever they run on the surface. A line splits every face it runs through,
 * from edge to edge, and goes no further; within 1e-9 of the width of the grid a line of the T-mesh
 * takes its place. Then the blending functions are split (P1 eq. 17-20) where they lack a knot that
 * the T-mesh dictates, and the T-mesh grows where they have one that it does not, until both agree.
 * The control points are the sums P'_j = Σ c_ij P_i (P1 eq. 16), so weights and the surface are
 * kept to rounding. SEG_ERROR_ARGUMENT: a number that is not finite; SEG_ERROR_INPUT: the result
 * has more lines than a T-spline can have.
 */
SegTspline *seg_tspline_refine(const SegTspline *tspline, const SegTline *lines, size_t n,
                               GError **error);

/*
 * Reads a T-spline, told by content: .tspl, ours (docs/tspl.md); point lists with knot vectors and
 * neighbours (.cfg); OpenTspline's binary form (.tsp); T-Splines for Rhino (.tsm). Of the others
 * what is bicubic and one patch is read, and the message names what is not. SEG_ERROR_INPUT with
 * file and line; SEG_ERROR_IO.
 */
SegTspline *seg_tspline_load(const char *path, GError **error);

/* The same from memory; `name` is for messages. */
SegTspline *seg_tspline_from_bytes(const void *bytes, size_t length, const char *name,
                                   GError **error);

/* Writes .tspl, beside and renamed: what is read back is the same to the last digit. */
bool seg_tspline_save(const SegTspline *tspline, const char *path, GError **error);

#endif
