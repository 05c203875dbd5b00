/* SPDX-License-Identifier: Apache-2.0 */
/* Where the part stands on the machine: its `up` turned to +Z, its zero on the bounding box of the
 * tessellation. */
#include <float.h>

#include "nc/nc.h"

static void rotation_of(CfgUp up, double rotation[3][3]);
static void bounds_of(const SegPart *part, const NcSetup *setup, SegVec3 *min, SegVec3 *max);

NcSetup nc_setup_new(const SegPart *part, CfgUp up, CfgZero zero)
{
    NcSetup setup = {.translation = {0, 0, 0}};
    rotation_of(up, setup.rotation);
    if (zero == CFG_ZERO_PART || part->n_triangles == 0)
        return setup;

    SegVec3 min, max;
    bounds_of(part, &setup, &min, &max);
    bool centre = zero == CFG_ZERO_TOP_CENTRE || zero == CFG_ZERO_BOTTOM_CENTRE;
    bool top = zero == CFG_ZERO_TOP_CENTRE || zero == CFG_ZERO_TOP_CORNER;
    setup.translation = seg_vec3(centre ? -(min.x + max.x) / 2 : -min.x,
                                 centre ? -(min.y + max.y) / 2 : -min.y, top ? -max.z : -min.z);
    return setup;
}

SegVec3 nc_setup_direction(const NcSetup *setup, SegVec3 d)
{
    const double(*r)[3] = setup->rotation;
    return seg_vec3(r[0][0] * d.x + r[0][1] * d.y + r[0][2] * d.z,
                    r[1][0] * d.x + r[1][1] * d.y + r[1][2] * d.z,
                    r[2][0] * d.x + r[2][1] * d.y + r[2][2] * d.z);
}

SegVec3 nc_setup_point(const NcSetup *setup, SegVec3 p)
{
    return seg_add(nc_setup_direction(setup, p), setup->translation);
}

/* Quarter and half turns about X or Y, so that the third axis keeps its place where it can. */
static void rotation_of(CfgUp up, double rotation[3][3])
{
    static const double turns[6][3][3] = {
        [CFG_UP_PLUS_X] = {{0, 0, -1}, {0, 1, 0}, {1, 0, 0}},
        [CFG_UP_MINUS_X] = {{0, 0, 1}, {0, 1, 0}, {-1, 0, 0}},
        [CFG_UP_PLUS_Y] = {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}},
        [CFG_UP_MINUS_Y] = {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}},
        [CFG_UP_PLUS_Z] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
        [CFG_UP_MINUS_Z] = {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}},
    };
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            rotation[i][j] = turns[up][i][j];
}

static void bounds_of(const SegPart *part, const NcSetup *setup, SegVec3 *min, SegVec3 *max)
{
    *min = seg_vec3(DBL_MAX, DBL_MAX, DBL_MAX);
    *max = seg_vec3(-DBL_MAX, -DBL_MAX, -DBL_MAX);
    for (int32_t t = 0; t < part->n_triangles; t++)
        for (int k = 0; k < 3; k++) {
            int32_t vertex = part->triangles[t].vertex[k];
            SegVec3 p = nc_setup_point(setup, part->vertices[vertex].position);
            *min = seg_vec3(fmin(min->x, p.x), fmin(min->y, p.y), fmin(min->z, p.z));
            *max = seg_vec3(fmax(max->x, p.x), fmax(max->y, p.y), fmax(max->z, p.z));
        }
}
