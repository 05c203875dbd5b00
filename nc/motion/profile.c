/* SPDX-License-Identifier: Apache-2.0 */
/* Where a timed move is, and how fast, at a moment of it. */
#include "nc/motion/path.h"

typedef struct {
    double up_s, level_s, down_s;
} Phases;

static Phases phases(const NcTimedMove *timed)
{
    double a = timed->a_mm_s2;
    Phases p = {(timed->v_max_mm_s - timed->v_in_mm_s) / a, 0.0,
                (timed->v_max_mm_s - timed->v_out_mm_s) / a};
    p.level_s = fmax(timed->duration_s - p.up_s - p.down_s, 0.0);
    return p;
}

SegVec3 nc_motion_position(const NcMove *move, const NcTimedMove *timed, double t_s)
{
    if (!(timed->length_mm > 0.0) || t_s <= 0.0)
        return t_s <= 0.0 ? move->from : move->to;
    if (t_s >= timed->duration_s)
        return move->to;
    Phases p = phases(timed);
    double a = timed->a_mm_s2, s;
    if (t_s < p.up_s) {
        s = (timed->v_in_mm_s + 0.5 * a * t_s) * t_s;
    } else if (t_s < p.up_s + p.level_s) {
        s = 0.5 * (timed->v_in_mm_s + timed->v_max_mm_s) * p.up_s +
            timed->v_max_mm_s * (t_s - p.up_s);
    } else {
        double left = timed->duration_s - t_s;
        s = timed->length_mm - (timed->v_out_mm_s + 0.5 * a * left) * left;
    }
    return nc_move_point(move, s / timed->length_mm);
}

double nc_motion_speed_mm_s(const NcTimedMove *timed, double t_s)
{
    if (!(timed->length_mm > 0.0) || t_s < 0.0 || t_s > timed->duration_s)
        return 0.0;
    Phases p = phases(timed);
    if (t_s < p.up_s)
        return timed->v_in_mm_s + timed->a_mm_s2 * t_s;
    if (t_s <= p.up_s + p.level_s)
        return timed->v_max_mm_s;
    return timed->v_out_mm_s + timed->a_mm_s2 * (timed->duration_s - t_s);
}
