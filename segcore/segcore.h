/* SPDX-License-Identifier: Apache-2.0 */
/*
 * segcore: from a CAD file to machining regions. Knows nothing of tools or G-code.
 *
 * Lengths are in mm, angles in rad, areas in mm². Faces and triangles are counted from 0 in
 * Open CASCADE's order of the whole file; regions are numbered from 1.
 */
#ifndef SEGCORE_SEGCORE_H
#define SEGCORE_SEGCORE_H

#include <glib.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "segcore/geom/vec.h"
#include "segcore/surface.h"
#include "segcore/tspline.h"

typedef enum {
    SEG_ERROR_INPUT,    /* the file, or an entity in it, is not usable: exit status 3 */
    SEG_ERROR_ARGUMENT, /* a method or parameter that does not exist or is out of range */
    SEG_ERROR_IO,       /* reading or writing failed */
} SegError;

#define SEG_ERROR seg_error_quark()
GQuark seg_error_quark(void);

/* ------------------------------------------------------------------ the part */

typedef enum {
    SEG_SURFACE_OTHER,
    SEG_SURFACE_PLANE,
    SEG_SURFACE_CYLINDER,
    SEG_SURFACE_CONE,
    SEG_SURFACE_SPHERE,
    SEG_SURFACE_TORUS,
    SEG_SURFACE_BSPLINE, /* Bézier patches too */
    SEG_SURFACE_REVOLUTION,
    SEG_SURFACE_EXTRUSION,
    SEG_SURFACE_OFFSET,
    SEG_SURFACE_MESH, /* the single face of a part read from STL or OFF: triangles only */
    SEG_N_SURFACE_TYPES
} SegSurfaceType;

/*
 * The records below are the part form (docs/part-form.md): what segmill-cad streams is what lies in
 * memory, table after table, little-endian, 8-byte aligned. An index of -1 means "none". `reals`
 * offsets count doubles into SegPart.reals.
 */

/* A B-spline curve. In `reals` at `data`: n + degree + 1 knots; n poles of `dim` coordinates; n
 * weights if rational. */
typedef struct {
    int64_t data;
    int32_t degree, n_poles;
    int32_t dim; /* 3: mm; 2: (u,v) of the face's B-spline surface */
    int32_t rational;
} SegCurve;

/* A B-spline surface. In `reals` at `data`: n_u + degree_u + 1 knots in u; n_v + degree_v + 1 in v;
 * n_u · n_v poles of 3 coordinates, v running fastest; as many weights if rational. */
typedef struct SegSurface {
    int64_t data;
    int32_t degree_u, degree_v;
    int32_t n_u, n_v; /* 0: the face has no surface (SEG_SURFACE_MESH) */
    int32_t rational;
    int32_t reserved;
} SegSurface;

typedef struct {
    SegSurface surface; /* the face's surface as a B-spline; loops lie in ITS (u,v) */
    SegVec3 origin;     /* parameters of the original surface, where `type` is elementary: */
    SegVec3 axis;       /*   plane: normal; cylinder, cone, sphere, torus: main axis */
    SegVec3 x_axis;
    double radius_mm;            /* cylinder, sphere; cone: at origin; torus: major */
    double minor_radius_mm;      /* torus */
    double half_angle_rad;       /* cone */
    int32_t type;                /* SegSurfaceType of the original surface */
    int32_t reversed;            /* 1: the outward normal is -(Su × Sv) */
    int32_t first_loop, n_loops; /* the outer loop first, where there is one */
    int32_t first_triangle, n_triangles;
    int32_t iges_type, iges_de; /* the face's own entity (144, 143, 510, 114, …), 0: none */
    int32_t iges_surface_type, iges_surface_de; /* its surface (128, 120, …), 0: none */
    int32_t first_iges_curve, n_iges_curves;    /* its 142, 102, 126, … in file order */
} SegFace;

typedef struct {
    int32_t first_coedge,
        n_coedges; /* in order, material on the left in (u,v) of an unreversed face */
    int32_t outer; /* 1 for the face's outer loop */
    int32_t reserved;
} SegLoop;

/* The use of an edge by a loop, run in the loop's direction when `reversed` is 0. */
typedef struct {
    SegCurve
        pcurve; /* dim 2, over [t_first, t_last] of the edge; already on the B-spline surface */
    double t_first, t_last; /* parameter range of the pcurve */
    int32_t edge;
    int32_t reversed;
} SegCoedge;

typedef struct {
    SegCurve curve; /* dim 3; n_poles 0 for a degenerate edge (a pole of a sphere) */
    double t_first, t_last;
    int32_t face[2]; /* the faces on either side; -1 where the edge is free; seams name one face
                        twice */
    SegVec3 ends[2];
} SegEdge;

typedef struct {
    int32_t type, de;
} SegIgesEntity;

typedef struct {
    int32_t vertex[3]; /* anticlockwise seen from outside */
    int32_t face;
} SegTriangle;

/* A point of the tessellation. Vertices are not shared between faces, and ascend with them. */
typedef struct {
    SegVec3 position;
    SegVec3 normal; /* outward unit normal of the face's surface; zero where it has none */
    double u, v;
} SegVertex;

/*
 * A part: immutable, one block of memory, tables as above. `chord_mm` is the tolerance the
 * tessellation was asked for; 0 for a mesh.
 */
typedef struct SegPart {
    const SegFace *faces;
    const SegLoop *loops;
    const SegCoedge *coedges;
    const SegEdge *edges;
    const SegIgesEntity *iges_curves;
    const SegVertex *vertices;
    const SegTriangle *triangles;
    const double *reals;
    int32_t n_faces, n_loops, n_coedges, n_edges, n_iges_curves, n_vertices, n_triangles;
    int64_t n_reals;
    double chord_mm;
    double unit_mm;  /* one unit of the file in mm; 1 where the file says nothing */
    char sha256[65]; /* of the file the part was read from, lower-case hex */
    char *path;      /* as given to seg_part_load; NULL when read from memory */
    /* Measured once by seg_part_load; NULL in a part from memory: */
    double *areas_mm2; /* of the faces */
    GArray *adjacency; /* seg_part_adjacency within seg_part_touch_mm */
    int ref_count;
    GBytes *memory;
} SegPart;

/* What Open CASCADE may use before it is stopped. */
typedef struct {
    const char *helper; /* path of segmill-cad; NULL: in the folder of the running program, the one
                           above, ../libexec/segmill, PATH */
    double chord_mm;    /* chord tolerance of the tessellation */
    double angle_rad;   /* angular tolerance of the tessellation */
    unsigned timeout_s;
    uint64_t memory_bytes;
} SegLoadOptions;

/* Defaults: chord 0.01 mm, 0.2 rad, 60 s, 4 GiB. */
#define SEG_LOAD_DEFAULTS ((SegLoadOptions){NULL, 0.01, 0.2, 60, 4ull << 30})

/*
 * Reads a part. `path` may be IGES (.igs, .iges), STEP (.stp, .step), STL (ascii or binary) or OFF,
 * told by content, not by name. CAD files go through segmill-cad as a child process; whatever
 * happens to it ends as an error that names the file. Caller owns the result.
 * Errors: SEG_ERROR_INPUT; SEG_ERROR_IO where the file or segmill-cad cannot be read or run.
 */
SegPart *seg_part_load(const char *path, const SegLoadOptions *options, GError **error);

/* Checks and adopts a part form; trusts nothing in it. Takes its own reference on `memory`. */
SegPart *seg_part_from_form(GBytes *memory, GError **error);

/* Reads STL (ascii or binary) or OFF from memory; `name` is for messages. Polygons become fans;
 * triangles without an area are left out. */
SegPart *seg_part_from_mesh(const void *bytes, size_t length, const char *name, GError **error);

SegPart *seg_part_ref(SegPart *part);
void seg_part_unref(SegPart *part);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SegPart, seg_part_unref)

/* Writes the given faces of the CAD file behind `part` as IGES, through segmill-cad, beside and
 * renamed. A part without a CAD file is SEG_ERROR_ARGUMENT. */
bool seg_part_write_iges(const SegPart *part, const int32_t *faces, size_t n_faces,
                         const char *out_path, const SegLoadOptions *options, GError **error);

/* The name of a surface type as written in files: "plane", "cylinder", "bspline", … */
const char *seg_surface_type_name(SegSurfaceType type);

/* ------------------------------------------------- surfaces, curves, areas, sizes */

/* Position, first and second derivatives of a face's B-spline surface at (u,v). */
typedef struct {
    SegVec3 p, pu, pv, puu, puv, pvv;
} SegSurfacePoint;

/* Evaluates where (u,v) lies; outside the knot range the nearest inside is taken.
 * The NURBS Book, A4.4 (rational derivatives). */
SegSurfacePoint seg_face_evaluate(const SegPart *part, int32_t face, double u, double v);

/* Outward unit normal; false where Su × Sv vanishes (normal then is the zero vector). */
bool seg_surface_normal(const SegFace *face, const SegSurfacePoint *s, SegVec3 *normal);

/* Principal curvatures in 1/mm with the outward normal as reference, k_min <= k_max; positive is
 * CONCAVE (the surface bends towards the normal, as a valley does). 1/k_max is the radius that
 * limits a tool. P1, §2 (H and K after P2, table 1). False at a degenerate point. */
bool seg_surface_curvature(const SegFace *face, const SegSurfacePoint *s, double *k_min,
                           double *k_max);

/* Parameter domain of the face's B-spline surface. */
void seg_face_domain(const SegPart *part, int32_t face, double *u0, double *u1, double *v0,
                     double *v1);

/* Position, first derivative of an edge's curve, or of a coedge's pcurve (z = 0). */
SegVec3 seg_curve_evaluate(const SegPart *part, const SegCurve *curve, double t,
                           SegVec3 *derivative);

/* Length of the curve over [a, b], relative error 1e-10 where it is smooth (adaptive Gauss). */
double seg_curve_length_mm(const SegPart *part, const SegCurve *curve, double a, double b);

/* Area of a trimmed face by Green's theorem over its loops in (u,v), relative error 1e-7. Measured
 * when a file is loaded, else here. */
double seg_face_area_mm2(const SegPart *part, int32_t face);

/* A closed polygon in (u,v). */
typedef struct {
    double (*uv)[2];
    size_t n;
} SegLoopPolygon;

/* The loop as a polygon whose chords stay within `chord_mm` of the edges in space; caller frees
 * result.uv with g_free. */
SegLoopPolygon seg_loop_polygon(const SegPart *part, int32_t loop, double chord_mm);

/* Is (u,v) inside the face's loops? Even-odd over the polygons of the face's loops. */
bool seg_polygons_contain(const SegLoopPolygon *polygons, size_t n, double u, double v);

/* The same over a grid: flags[i·n_v + j] of what is outside at (u[i], v[j]) gets SEG_POINT_OUTSIDE;
 * nothing else is changed. */
void seg_polygons_grid(const SegLoopPolygon *polygons, size_t n, const double *u, size_t n_u,
                       const double *v, size_t n_v, uint8_t *flags);

/* Face adjacency: pairs of faces that share an edge by topology, or whose free edges lie on each
 * other within `tolerance_mm` (IGES files of single 144s share no topology). Sorted pairs
 * a < b of int32_t, element type SegFacePair. */
typedef struct {
    int32_t a, b;
} SegFacePair;
GArray *seg_part_adjacency(const SegPart *part, double tolerance_mm);

/* The usual tolerance for that: 1e-4 of the part's size, at least 1e-3 mm. */
double seg_part_touch_mm(const SegPart *part);

/* ------------------------------------------------------------------ segmentation */

typedef enum {
    SEG_REGION_CONVEX,
    SEG_REGION_CONCAVE,
    SEG_REGION_SADDLE,
    SEG_REGION_FLAT,
    SEG_REGION_LOCAL,
    SEG_REGION_REST,
    SEG_REGION_FEATURE,
    SEG_N_REGION_KINDS
} SegRegionKind;

const char *seg_region_kind_name(SegRegionKind kind);

/* A face, or the part of it inside `loops`; n_loops 0: all of the face, inside its own loops. */
typedef struct {
    int32_t face;
    int32_t tag; /* class the method put it in, from 1; 0: none */
    SegLoopPolygon *loops;
    size_t n_loops;
} SegPiece;

typedef struct {
    int32_t id; /* from 1 */
    char *name; /* [A-Za-z0-9_-]+, unique: a recipe's [region.NAME] */
    SegRegionKind kind;
    SegPiece *pieces;
    size_t n_pieces;
    int32_t *triangles; /* into the part's tessellation, ascending */
    size_t n_triangles;
    double area_mm2;
    double feature_size_mm[4];    /* diagonal, length, width, height (P0) */
    double min_concave_radius_mm; /* of the surfaces, not of sharp edges between them, which no ball
                                     reaches into; INFINITY where nothing is concave, and for
                                     triangles of a mesh, whose curvature is not measured */
    int32_t *neighbours;          /* ids, ascending */
    size_t n_neighbours;
} SegRegion;

/* A face that the method left out, and why. */
typedef struct {
    int32_t face;
    char *reason;
} SegDropped;

/* The one result of every method. */
typedef struct {
    char *method;
    char **parameters; /* "key=value", sorted by key; NULL-terminated: what was in force */
    SegRegion *regions;
    size_t n_regions;
    SegDropped *dropped;
    size_t n_dropped;
} SegSegmentation;

void seg_segmentation_free(SegSegmentation *segmentation);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SegSegmentation, seg_segmentation_free)

/* Characteristic cuboid of one face (P0 §2.2), aligned with the axes of the part: its diagonal, and
 * its extents with length >= width >= height, whichever axes they lie along. */
typedef struct {
    double diagonal_mm, length_mm, width_mm, height_mm;
} SegFeatureSize;

/* How the boundary of a face is enriched before its cuboid is taken (P0 §2.2). */
typedef enum {
    SEG_REPAIR_EXACT,  /* every extremum of every edge in x, y and z, to 1e-10 of the edge: the
                          cuboid that ever more points by the rule approach. The default */
    SEG_REPAIR_RULE,   /* the paper's 8/6/4/2 rule against the datum length, nothing else */
    SEG_REPAIR_POINTS, /* a fixed number of points an edge, at equal arc lengths (figure 8) */
} SegRepair;

typedef struct {
    SegRepair repair;
    int points;                /* for SEG_REPAIR_POINTS: 0…10000 */
    double datum_mm;           /* L of the rule; 0: the first feature size of the part */
    double tolerance;          /* similarity, relative to the class's largest member: 0.05 */
    double subset_tolerance;   /* 0: no subdivision; else relative, on length, width, height */
    double min_size_mm;        /* smaller faces are dropped; 0: none */
    double local_ratio;        /* local: first size <= ratio · largest class's; 0: off. Not looked
                                  at where tags or faces are named */
    const int32_t *local_tags; /* local by class */
    size_t n_local_tags;
    const int32_t *local_faces; /* local by face */
    size_t n_local_faces;
    const int32_t (*reassign)[2]; /* {face, tag}: moved by hand after classification; the tag above
                                     the largest opens a class */
    size_t n_reassign;
    bool split_rest; /* a region for each class of the rest, not one for all */
} SegFeatureSizeParams;

#define SEG_FEATURE_SIZE_DEFAULTS ((SegFeatureSizeParams){.tolerance = 0.05, .local_ratio = 0.5})

/* Feature size of one face. `n_points` may be NULL; else the number of points added between the
 * ends of its edges. With SEG_REPAIR_RULE give datum_mm when asking for many faces: 0 measures the
 * whole part each time. */
SegFeatureSize seg_feature_size(const SegPart *part, int32_t face,
                                const SegFeatureSizeParams *params, size_t *n_points);

/*
 * P0 in full: sizes, classes, local features and the rest. Tags number the classes from 1, largest
 * first. Regions: "rest" (with split_rest "rest-TAG"), the remaining area; then "local-1",
 * "local-2", …, largest first: local faces that touch are one feature, whatever their classes (the
 * top, fillet and wall of a boss), and features whose faces agree in area one by one within
 * `tolerance` share a region (the blades of a wheel, which turned by an angle differ in their
 * cuboids). Deterministic. Errors: SEG_ERROR_ARGUMENT (a parameter out of range, a tag or face that
 * does not exist, a mesh, every face dropped).
 */
SegSegmentation *seg_segment_feature_size(const SegPart *part, const SegFeatureSizeParams *params,
                                          GError **error);

/* One region, the whole part: the baseline, and the only method for meshes. */
SegSegmentation *seg_segment_none(const SegPart *part, GError **error);

#endif
