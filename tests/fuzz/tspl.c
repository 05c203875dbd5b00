/* SPDX-License-Identifier: Apache-2.0 */
/* T-spline files, ours and those of others; what is read is evaluated, refined and read again. */
#include "segcore/segcore.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void evaluate(const SegTspline *t)
{
    double u0, u1, v0, v1, u[7], v[7];
    seg_tspline_domain(t, &u0, &u1, &v0, &v1);
    for (int i = 0; i < 7; i++) {
        u[i] = u0 + (u1 - u0) * i / 6;
        v[i] = v0 + (v1 - v0) * i / 6;
    }
    g_autoptr(SegSurfaceBatch) batch = seg_surface_batch_new(49, SEG_ALL_FIELDS);
    seg_tspline_grid(t, u, 7, v, 7, batch);
    seg_tspline_points(t, u, v, 7, batch);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    g_autoptr(SegTspline) t = seg_tspline_from_bytes(data, size, "fuzz", NULL);
    if (!t)
        return 0;
    evaluate(t);
    double u0, u1, v0, v1;
    seg_tspline_domain(t, &u0, &u1, &v0, &v1);
    double at_u = u0 + 0.37 * (u1 - u0), at_v = v0 + 0.61 * (v1 - v0);
    const SegTline lines[] = {{true, at_u, v0, at_v}, {false, at_v, at_u, u1}};
    g_autoptr(SegTspline) refined = seg_tspline_refine(t, lines, 2, NULL);
    if (refined)
        evaluate(refined);
    return 0;
}
