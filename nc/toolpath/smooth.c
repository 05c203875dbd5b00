/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/toolpath/smooth.h"

#include <string.h>

/* Of the chord share: what thinning may use (laying used the rest), and the shortest move that is
 * halved. */
#define THIN 0.5
#define SHORTEST 0.25
#define ROUNDS 40

static void thin(NcPiece *piece, double tolerance);
static void prove(const NcTrace *trace, NcPiece *piece);

void nc_smooth(const NcTrace *trace, GArray *pieces)
{
#pragma omp parallel for schedule(dynamic, 1)
    for (guint i = 0; i < pieces->len; i++) {
        NcPiece *piece = &g_array_index(pieces, NcPiece, i);
        thin(piece, THIN * trace->chord_mm);
        prove(trace, piece);
    }
}

/* Ramer 1972, Douglas and Peucker 1973, with a stack of its own: pieces can be long. */
static void thin(NcPiece *piece, double tolerance)
{
    if (piece->n < 3)
        return;
    g_autofree uint8_t *keep = g_new0(uint8_t, piece->n);
    g_autofree size_t *stack = g_new(size_t, 2 * piece->n);
    size_t depth = 0;
    keep[0] = keep[piece->n - 1] = 1;
    stack[depth++] = 0;
    stack[depth++] = piece->n - 1;
    while (depth > 0) {
        size_t b = stack[--depth], a = stack[--depth], far = a;
        double most = tolerance;
        SegVec3 ab = seg_sub(piece->tips[b], piece->tips[a]);
        double length2 = seg_dot(ab, ab);
        for (size_t i = a + 1; i < b; i++) {
            SegVec3 ap = seg_sub(piece->tips[i], piece->tips[a]);
            double s = length2 > 0 ? fmin(fmax(seg_dot(ap, ab) / length2, 0), 1) : 0;
            double off = seg_norm(seg_along(ap, ab, -s));
            if (off > most) {
                most = off;
                far = i;
            }
        }
        if (far == a)
            continue;
        keep[far] = 1;
        stack[depth++] = a;
        stack[depth++] = far;
        stack[depth++] = far;
        stack[depth++] = b;
    }
    size_t n = 0;
    for (size_t i = 0; i < piece->n; i++)
        if (keep[i])
            piece->tips[n++] = piece->tips[i];
    piece->n = n;
}

/* What stands between a and b so that neither move gouges; false where nothing more is needed. */
static bool repair(const NcTrace *trace, SegVec3 a, SegVec3 b, SegVec3 *between)
{
    if (nc_sweep_clear(trace->terrain, trace->body.cutter, a, b, trace->chord_mm))
        return false;
    double level = hypot(b.x - a.x, b.y - a.y);
    SegVec3 middle = seg_lerp(a, b, 0.5);
    if (level > SHORTEST * trace->chord_mm) {
        double z = nc_drop(trace->terrain, trace->body.cutter, middle.x, middle.y, NULL, NULL);
        *between = seg_vec3(middle.x, middle.y, fmax(z, fmin(a.z, b.z)));
        return true;
    }
    /* A wall: straight up on the lower side of it, then level over its edge. */
    *between = a.z < b.z ? seg_vec3(a.x, a.y, b.z) : seg_vec3(b.x, b.y, a.z);
    return level > 0 && fabs(a.z - b.z) > 0;
}

static void prove(const NcTrace *trace, NcPiece *piece)
{
    GArray *done = g_array_sized_new(FALSE, FALSE, sizeof(SegVec3), (guint)piece->n + 8);
    g_autoptr(GArray) ahead = g_array_new(FALSE, FALSE, sizeof(SegVec3));
    g_array_append_val(done, piece->tips[0]);
    for (size_t i = 1; i < piece->n; i++) {
        g_array_append_val(ahead, piece->tips[i]);
        while (ahead->len > 0) {
            SegVec3 a = g_array_index(done, SegVec3, done->len - 1);
            SegVec3 b = g_array_index(ahead, SegVec3, ahead->len - 1), between;
            if (ahead->len < ROUNDS && repair(trace, a, b, &between)) {
                g_array_append_val(ahead, between);
                continue;
            }
            g_array_append_val(done, b);
            g_array_set_size(ahead, ahead->len - 1);
        }
    }
    g_free(piece->tips);
    piece->n = done->len;
    piece->tips = (SegVec3 *)g_array_free(done, FALSE);
}
