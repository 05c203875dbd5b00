/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Part of nc/nc.h, which others include: the stock, what tools remove from it, and what is left.
 * Workpiece coordinates: the work zero is the origin, +Z points to the spindle. Lengths in mm.
 */
#ifndef NC_STOCK_H
#define NC_STOCK_H

#include "nc/gcode.h"

/*
 * Material as rays parallel to X, Y and Z on one grid (a tri-dexel model: Van Hook, "Real-time
 * shaded NC milling display", 1986; Benouamer, Michelucci, "Bridging the gap between CSG and Brep
 * via a triple ray representation", 1997). Each ray keeps the segments that are material; each end
 * of one its surface normal, and the tool and block that made it.
 */
typedef struct NcStock NcStock;

/*
 * Memory: for each of the grid's three faces, in tiles of 8 x 8 rays, 280 bytes a tile and 24 bytes
 * a segment; a stock begins with one segment a ray, and pockets and walls across a ray add to them.
 * What a stock begins with is checked before it is allocated, the rest after every 16384 moves.
 */
typedef struct {
    double pitch_mm;       /* of the grid */
    uint64_t memory_bytes; /* a stock that would need more is refused */
} NcStockOptions;

/* 0.1 mm, 2 GiB. */
#define NC_STOCK_DEFAULTS ((NcStockOptions){0.1, 2ull << 30})

/* Errors: NC_ERROR_PLAN for a body without volume or a pitch that the memory does not allow, with
 * what is needed and what is allowed. */
NcStock *nc_stock_new_box(SegVec3 min, SegVec3 max, const NcStockOptions *options, GError **error);
/* Upright: its axis is parallel to Z, `base` the centre of its lower face. */
NcStock *nc_stock_new_cylinder(SegVec3 base, double diameter_mm, double height_mm,
                               const NcStockOptions *options, GError **error);
/* A closed mesh; triangles index vertices, anticlockwise seen from outside. */
NcStock *nc_stock_new_mesh(const SegVec3 *vertices, size_t n_vertices,
                           const int32_t (*triangles)[3], size_t n_triangles,
                           const NcStockOptions *options, GError **error);
/* A closed body from STL, OFF, IGES or STEP (seg_part_load), in workpiece coordinates. Errors:
 * NC_ERROR_PLAN; SEG_ERROR of the file. */
NcStock *nc_stock_load(const char *path, const NcStockOptions *options, GError **error);
NcStock *nc_stock_copy(const NcStock *stock);
void nc_stock_free(NcStock *stock);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(NcStock, nc_stock_free)

/* The mean of what the rays of X, Y and Z count; each is off by at most the surface's area times
 * the pitch. */
double nc_stock_volume_mm3(const NcStock *stock);
uint64_t nc_stock_memory_bytes(const NcStock *stock);

typedef enum {
    NC_COLLISION_RAPID,   /* G0 through material */
    NC_COLLISION_HOLDER,  /* the holder in material */
    NC_COLLISION_SHANK,   /* the shank, above the flutes, in material or along it */
    NC_COLLISION_SPINDLE, /* cutting with the spindle off, or turning the wrong way */
} NcCollisionKind;

const char *nc_collision_name(NcCollisionKind kind); /* "rapid", "holder", "shank", "spindle" */

typedef struct {
    NcCollisionKind kind;
    uint32_t line;    /* of the block */
    SegVec3 position; /* where it is deepest, workpiece coordinates */
    /* How far it goes into the material, along X, Y or Z: the least of the three. Of a shank that
     * only rubs: how far it is below the top of what it touches, up to a pitch less. */
    double depth_mm;
} NcCollision;

/*
 * Removes what the moves sweep, in their order, and appends the NcCollisions met on the way (may be
 * NULL) one a kind and line, by line. G0 to G3 with a tool in the spindle sweep; a tool is its
 * cutting part, its shank and its holder (shapes: docs/stock.md), and each removes what it meets,
 * so that an accident is reported where it happens and not again by what follows. A touch no deeper
 * than 0.001 mm is none. But a tool is deeper than its flutes also in a hole or slot that it has
 * made itself: a shank as thick as the cutting part or thinner is an NC_COLLISION_SHANK where it
 * comes within 0.009 mm of material at its side, and takes nothing there; not on a move straight
 * up.
 *
 * Where a surface crosses a ray it is found to 1e-9 mm square to it, and kept as a whole number of
 * 2^-29 of the stock's longest side or less (of 100 mm: 1e-7 mm). Arcs and helices are cut as
 * chords that lie within 1e-4 mm of them. What no ray meets is not seen: walls and pins thinner
 * than the pitch.
 *
 * `zero` is the work zero in machine coordinates of the gauge point, `tools` give shapes and
 * lengths. May be called again with the moves that follow. The result does not depend on the number
 * of threads. Errors: NC_ERROR_PROGRAM, with the line, for a tool that the table does not have and
 * for moves with a rotary axis away from zero: nothing is cut then. NC_ERROR_PLAN where the rest
 * needs more memory than the stock may have: it is cut up to some block.
 */
bool nc_stock_cut(NcStock *stock, const NcMove *moves, size_t n, SegVec3 zero,
                  const CfgToolTable *tools, GArray *collisions, GError **error);

/*
 * Where on a straight move the flutes of its tool (a probe is a tool of the table) first touch
 * material, or with `away` first leave it; at its start where they do or do not already. False:
 * nowhere, or a tool that the table does not have. `where` and `zero` are as NcProbe's and
 * nc_stock_cut's. Where the tool meets rays the place is within NC_STOCK_PROBE_MM; between them it
 * comes up to pitch²/(4·R) deeper with a tip of radius R, and up to a pitch at an edge.
 */
#define NC_STOCK_PROBE_MM 1e-5
bool nc_stock_probe(const NcStock *stock, const NcMove *move, SegVec3 zero,
                    const CfgToolTable *tools, bool away, SegVec3 *where);

/* ----------------------------------------------------------- in-process model */

typedef struct {
    int32_t vertex[3];              /* anticlockwise seen from outside */
    int32_t tool;                   /* that made it; 0: raw stock */
    uint32_t first_line, last_line; /* of the blocks that made it */
} NcMeshTriangle;

/* Closed, manifold, outward. Coordinates are of single precision, which is what files hold. */
typedef struct {
    SegVec3 *vertices;
    size_t n_vertices;
    NcMeshTriangle *triangles;
    size_t n_triangles;
} NcMesh;

/* The surface of what is left; empty where nothing is. */
NcMesh *nc_stock_mesh(const NcStock *stock);
void nc_mesh_free(NcMesh *mesh);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(NcMesh, nc_mesh_free)

/*
 * Writes the mesh beside `path` and renames it: OFF where the name ends in .off, each face with its
 * tool and lines behind it; else binary STL, the tool in the attribute of each facet, and
 * `path`.json with the lines (docs/stock.md). Errors: G_FILE_ERROR.
 */
bool nc_mesh_write(const NcMesh *mesh, const char *path, GError **error);

#endif
