/* SPDX-License-Identifier: Apache-2.0 */
/* The readers behind seg_tspline_load. Each says what it refuses and where; `name` is for that. */
#ifndef SEGCORE_GEOM_TSPLINE_FILE_H
#define SEGCORE_GEOM_TSPLINE_FILE_H

#include "segcore/geom/reader.h"

/* Points with their own knot vectors, and the edges between them: what the lists of others hold. */
typedef struct {
    double knots_u[5], knots_v[5];
    double x, y, z, w;
    int line; /* of the file, or the place in it */
} SegListedPoint;

typedef struct {
    GArray *points; /* SegListedPoint */
    GArray *edges;  /* int32_t[2]: points at its ends */
} SegPointList;

SegPointList *seg_point_list_new(void);
void seg_point_list_free(SegPointList *list);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SegPointList, seg_point_list_free)

/* The T-spline with these edges, whose rays must find the knot vectors that the list has. */
SegTspline *seg_tspline_from_list(const SegPointList *list, GError **error);

/* aijm/TSpline's .cfg, OpenTspline's .tsp, T-Splines' .tsm. */
SegTspline *seg_read_tspline_cfg(const char *bytes, size_t length, const char *name,
                                 GError **error);
SegTspline *seg_read_tspline_tsp(const char *bytes, size_t length, const char *name,
                                 GError **error);
SegTspline *seg_read_tspline_tsm(const char *bytes, size_t length, const char *name,
                                 GError **error);

#endif
