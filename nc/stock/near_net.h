/* SPDX-License-Identifier: Apache-2.0 */
#ifndef NC_STOCK_NEAR_NET_H
#define NC_STOCK_NEAR_NET_H

#include "nc/nc.h"

/*
 * The body of a triangle mesh with `allowance_mm` > 0 on all sides: all points within that distance
 * of a triangle, and those that a closed mesh encloses. Triangles run anticlockwise seen from
 * outside. Errors: NC_ERROR_PLAN.
 */
NcStock *nc_stock_new_near_net(const SegVec3 *vertices, size_t n_vertices,
                               const int32_t (*triangles)[3], size_t n_triangles,
                               double allowance_mm, const NcStockOptions *options, GError **error);

#endif
