/* SPDX-License-Identifier: Apache-2.0 */
/* The point of a box that fits planes best, by least squares: dual contouring's vertex (Ju,
 * Losasso, Schaefer, Warren, "Dual Contouring of Hermite Data", 2002, equation 1). */
#ifndef NC_STOCK_MESH_FIT_H
#define NC_STOCK_MESH_FIT_H

typedef struct {
    double a[3][3]; /* sum of n·nᵀ */
    double b[3];    /* sum of n·(n·p) */
    double sum[3];  /* of the points */
    int n;
} NcPlaneFit;

/* A plane through `point` with the unit `normal`. Begin with an NcPlaneFit of zeros. */
void nc_plane_fit_add(NcPlaneFit *fit, const double point[3], const double normal[3]);

/* The mean of the points; at least one plane. */
void nc_plane_fit_mean(const NcPlaneFit *fit, double point[3]);

/* The best point within [low, high]; where the planes leave a direction open, the one nearest to
 * the mean of their points. Exact within the box, but for NC_PLANE_FIT_PULL. */
void nc_plane_fit_best(const NcPlaneFit *fit, const double low[3], const double high[3],
                       double point[3]);

/* Weight of the distance to the mean against that to a plane: decides which directions are open. At
 * an edge where planes meet at 2 rad·√PULL or less the vertex comes half-way to it. */
#define NC_PLANE_FIT_PULL 1e-5

#endif
