/* SPDX-License-Identifier: Apache-2.0 */
/* Normals and principal curvatures of a face's surface. */
#include "segcore/segcore.h"

/* Below this sine of the angle between Su and Sv the surface has no normal worth the name. */
static const double LEAST_SINE = 1e-9;

bool seg_surface_normal(const SegFace *face, const SegSurfacePoint *s, SegVec3 *normal)
{
    SegVec3 n = seg_cross(s->pu, s->pv);
    double length = seg_norm(n);
    if (!(length > LEAST_SINE * seg_norm(s->pu) * seg_norm(s->pv)) || !isfinite(length)) {
        *normal = seg_vec3(0, 0, 0);
        return false;
    }
    *normal = seg_scale(n, (face->reversed ? -1 : 1) / length);
    return true;
}

/* With n outward, L = n·Suu > 0 bends towards the normal: concave. H and K after P2. */
bool seg_surface_curvature(const SegFace *face, const SegSurfacePoint *s, double *k_min,
                           double *k_max)
{
    SegVec3 normal;
    *k_min = *k_max = 0;
    if (!seg_surface_normal(face, s, &normal))
        return false;
    double e = seg_dot(s->pu, s->pu), f = seg_dot(s->pu, s->pv), g = seg_dot(s->pv, s->pv);
    double l = seg_dot(normal, s->puu), m = seg_dot(normal, s->puv), n = seg_dot(normal, s->pvv);
    SegVec3 cross = seg_cross(s->pu, s->pv);
    double area2 = seg_dot(cross, cross); /* EG - F² without its cancellation */
    double mean = (e * n - 2 * f * m + g * l) / (2 * area2);
    double gauss = (l * n - m * m) / area2;
    double root = sqrt(fmax(mean * mean - gauss, 0));
    *k_min = mean - root;
    *k_max = mean + root;
    return isfinite(*k_min) && isfinite(*k_max);
}
