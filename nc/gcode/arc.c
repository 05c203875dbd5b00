/* SPDX-License-Identifier: Apache-2.0 */
/* The centre of G2 and G3, from I J K or from R [NIST 3.5.3], with LinuxCNC's tolerances. */
#include "nc/gcode/interpreter.h"

/* LinuxCNC: how far the radius at the end may differ from the radius at the start. */
#define RADIUS_TOLERANCE_MM (2.0 * 0.01 * G_SQRT2)
#define RADIUS_TOLERANCE_INCH (2.0 * 0.001 * G_SQRT2)
#define RADIUS_TOLERANCE_RELATIVE 0.001
#define RADIUS_TOLERANCE_LARGEST 100.0 /* times the absolute one, however large the arc */
#define SMALLEST_RADIUS_MM 1e-6
/* LinuxCNC: how much R may be too small to reach the end point. */
#define REACH_TOLERANCE_MM 0.00127

typedef struct {
    double a, b;
} Vec2;

/* A positive R is the arc of at most half a turn, a negative one the larger. */
static bool centre_from_radius(const NcBlock *block, const NcModal *modal, Vec2 from, Vec2 to,
                               Vec2 *centre, GError **error)
{
    const NcWord *r = nc_word(block, 'R');
    double radius = fabs(r->value) * modal->unit_mm;
    double chord_a = to.a - from.a, chord_b = to.b - from.b;
    double half = 0.5 * hypot(chord_a, chord_b);
    if (half < SMALLEST_RADIUS_MM) {
        return nc_word_error(error, modal->line, r,
                             "cannot give an arc that ends where it begins: use I, J, K");
    }
    if (half - radius > REACH_TOLERANCE_MM) {
        return nc_word_error(error, modal->line, r,
                             "is too small to reach the end point: at least %.5g mm are needed",
                             half);
    }
    double height = radius > half ? sqrt((radius - half) * (radius + half)) : 0.0;
    /* Anticlockwise, the smaller arc's centre lies to the left of the chord. */
    bool left = (block->motion == 30) == (r->value > 0.0);
    double scale = (left ? height : -height) / (2.0 * half);
    centre->a = 0.5 * (from.a + to.a) - scale * chord_b;
    centre->b = 0.5 * (from.b + to.b) + scale * chord_a;
    return true;
}

static bool centre_from_offsets(const NcBlock *block, const NcModal *modal, Vec2 from, Vec2 to,
                                Vec2 shift, const NcWord *a, const NcWord *b, Vec2 *centre,
                                GError **error)
{
    if (modal->arc_absolute && (!a || !b)) {
        return nc_word_error(error, modal->line, nc_motion_word(block),
                             "needs both centre coordinates with G90.1");
    }
    Vec2 base = modal->arc_absolute ? shift : from;
    centre->a = base.a + (a ? a->value * modal->unit_mm : 0.0);
    centre->b = base.b + (b ? b->value * modal->unit_mm : 0.0);
    double r_from = hypot(from.a - centre->a, from.b - centre->b);
    double r_to = hypot(to.a - centre->a, to.b - centre->b);
    double difference = fabs(r_from - r_to), largest = MAX(r_from, r_to);
    double tolerance =
        modal->unit_mm > 1.0 ? RADIUS_TOLERANCE_INCH * NC_MM_PER_INCH : RADIUS_TOLERANCE_MM;
    if (MIN(r_from, r_to) < SMALLEST_RADIUS_MM)
        return nc_word_error(error, modal->line, nc_motion_word(block),
                             "has an arc of radius zero");
    if (difference > RADIUS_TOLERANCE_LARGEST * tolerance ||
        (difference > tolerance && difference > RADIUS_TOLERANCE_RELATIVE * largest)) {
        return nc_word_error(error, modal->line, nc_motion_word(block),
                             "has an arc whose radius is %.5f mm at its start and %.5f mm at its "
                             "end: correct the centre or the end point",
                             r_from, r_to);
    }
    return true;
}

bool nc_arc_centre(const NcBlock *block, const NcModal *modal, SegVec3 from, SegVec3 to,
                   SegVec3 shift, SegVec3 *centre, GError **error)
{
    NcPlaneAxes axes = nc_plane_axes(modal->plane);
    const NcWord *offset[3] = {nc_word(block, 'I'), nc_word(block, 'J'), nc_word(block, 'K')};
    const NcWord *a = offset[axes.first], *b = offset[axes.second], *c = offset[axes.normal];
    const NcWord *r = nc_word(block, 'R');
    const NcWord *end_a = nc_word(block, (char)('X' + axes.first));
    const NcWord *end_b = nc_word(block, (char)('X' + axes.second));
    if (c) {
        return nc_word_error(error, modal->line, c, "has no use for an arc in plane G%d",
                             modal->plane);
    }
    if (r ? (a || b) : !(a || b)) {
        return nc_word_error(error, modal->line, r ? r : nc_motion_word(block),
                             r ? "cannot stand with I, J or K in plane G%d: an arc has one of them"
                               : "needs a centre (I, J, K) or a radius (R) in plane G%d",
                             modal->plane);
    }
    if (r && !end_a && !end_b) {
        return nc_word_error(error, modal->line, nc_motion_word(block),
                             "needs an end point in plane G%d", modal->plane);
    }
    Vec2 from2 = {*nc_axis(&from, axes.first), *nc_axis(&from, axes.second)};
    Vec2 to2 = {*nc_axis(&to, axes.first), *nc_axis(&to, axes.second)};
    Vec2 shift2 = {*nc_axis(&shift, axes.first), *nc_axis(&shift, axes.second)};
    Vec2 found = from2;
    if (!(r ? centre_from_radius(block, modal, from2, to2, &found, error)
            : centre_from_offsets(block, modal, from2, to2, shift2, a, b, &found, error)))
        return false;
    *centre = from;
    *nc_axis(centre, axes.first) = found.a;
    *nc_axis(centre, axes.second) = found.b;
    return true;
}
