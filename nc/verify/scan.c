/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/verify/scan.h"

#include "nc/toolpath/stepover.h"

/* Half the length of a profile, in step-overs. */
#define HALF 0.75

/* Passes that lie closer than this share of the expected step-over are one pass. */
#define SAME_PASS 0.03

#define RETAKEN_MOST 4
#define POINTS_MOST 1024
#define HALVINGS 6
#define STEPS_MOST 200

/* One point of a profile. */
typedef struct {
    NcPlace place;
    double deviation;
    double pass; /* where the pass that cut it lies, along the profile */
    bool on_face, cut;
} Point;

static double expected_step(const NcVerifier *verifier, const NcMove *move);
static SegVec3 across_of(const NcVerifier *verifier, size_t move, SegVec3 normal);
static double pass_of(const NcVerifier *verifier, size_t move, SegVec3 point, SegVec3 across);
static size_t take(const NcVerifier *verifier, const NcPlace *middle, SegVec3 across, double pitch,
                   double half, Point *points);
static double narrowest(const Point *points, size_t n, double expected);

NcProfile nc_profile(const NcVerifier *verifier, size_t region, const NcPlace *middle)
{
    NcProfile profile = {.top_mm = -INFINITY, .bottom_mm = INFINITY};
    size_t move;
    nc_verifier_measure(verifier, middle, &move);
    if (move == NC_PROBING_UNCUT)
        return profile;
    g_autofree Point *points = g_new(Point, POINTS_MOST);
    SegVec3 across = across_of(verifier, move, middle->normal);
    double expected = expected_step(verifier, &verifier->moves[move]);
    double step = expected, shown = 0;
    size_t n = 0;
    for (int i = 0; i < RETAKEN_MOST; i++) {
        profile.pitch_mm = NC_PROFILE_SHARE * step;
        n = take(verifier, middle, across, profile.pitch_mm, HALF * expected, points);
        shown = narrowest(points, n, expected);
        if (shown == 0 || profile.pitch_mm <= NC_PROFILE_SHARE * shown)
            break;
        step = 0.9 * shown;
    }
    profile.stepover_mm = shown;
    for (size_t i = 0; i < n; i++) {
        if (!points[i].on_face)
            continue;
        if (points[i].deviation > profile.top_mm &&
            nc_verifier_reaches(verifier, region, &points[i].place)) {
            profile.top_mm = points[i].deviation;
            profile.top = points[i].place;
        }
        if (points[i].deviation < profile.bottom_mm) {
            profile.bottom_mm = points[i].deviation;
            profile.bottom = points[i].place;
        }
    }
    return profile;
}

/* What the scallop allows on a plane; of a flat what the planner takes there. */
static double expected_step(const NcVerifier *verifier, const NcMove *move)
{
    const CfgTool *tool = cfg_tools_find(verifier->input->tools, move->tool);
    double corner = tool->kind == CFG_TOOL_BALL ? tool->diameter_mm / 2 : tool->corner_radius_mm;
    if (corner > 0)
        return nc_ball_contact_step_mm(corner, verifier->input->recipe->scallop_mm, 0);
    return NC_FLAT_STEP * tool->diameter_mm;
}

/* Any unit tangent. */
static SegVec3 tangent_of(SegVec3 normal)
{
    SegVec3 other = fabs(normal.x) < 0.9 ? seg_vec3(1, 0, 0) : seg_vec3(0, 1, 0);
    return seg_unit(seg_cross(normal, other));
}

/* Along the surface, square to the move; any tangent where there is no such. */
static SegVec3 across_of(const NcVerifier *verifier, size_t move, SegVec3 normal)
{
    if (move == NC_PROBING_UNCUT)
        return tangent_of(normal);
    const NcMove *m = &verifier->moves[move];
    SegVec3 along = m->kind == NC_MOVE_ARC ? seg_sub(nc_move_point(m, 0.51), nc_move_point(m, 0.49))
                                           : seg_sub(m->to, m->from);
    SegVec3 across = seg_cross(normal, seg_unit(along));
    return seg_norm(across) > 1e-6 ? seg_unit(across) : tangent_of(normal);
}

/* Where the pass of a move lies along the profile: its tip's place nearest to the point. */
static double pass_of(const NcVerifier *verifier, size_t move, SegVec3 point, SegVec3 across)
{
    const NcMove *m = &verifier->moves[move];
    SegVec3 off = nc_verifier_offset(verifier, m);
    SegVec3 a = seg_sub(nc_move_point(m, 0), off),
            d = seg_sub(seg_sub(nc_move_point(m, 1), off), a);
    SegVec3 tangent = seg_along(d, across, -seg_dot(d, across));
    double length2 = seg_dot(tangent, tangent);
    double t = length2 > 0 ? seg_dot(seg_sub(point, a), tangent) / length2 : 0;
    return seg_dot(seg_along(a, d, fmin(fmax(t, 0), 1)), across);
}

static size_t take(const NcVerifier *verifier, const NcPlace *middle, SegVec3 across, double pitch,
                   double half, Point *points)
{
    size_t side = (size_t)fmin(ceil(half / pitch), (POINTS_MOST - 1) / 2), n = 2 * side + 1;
    for (size_t i = 0; i < n; i++) {
        Point *p = &points[i];
        double at = ((double)i - (double)side) * pitch;
        size_t move;
        p->on_face = nc_surface_step(verifier->surface, middle, seg_scale(across, at), &p->place);
        if (!p->on_face)
            continue;
        p->deviation = nc_verifier_measure(verifier, &p->place, &move);
        p->cut = move != NC_PROBING_UNCUT;
        if (p->cut)
            p->pass = pass_of(verifier, move, p->place.point, across);
    }
    return n;
}

/* The least distance of passes that follow each other along the profile; 0 where there are none. */
static double narrowest(const Point *points, size_t n, double expected)
{
    double least = INFINITY, last = NAN;
    for (size_t i = 0; i < n; i++) {
        if (!points[i].on_face || !points[i].cut) {
            last = NAN;
            continue;
        }
        double apart = fabs(points[i].pass - last);
        if (apart > SAME_PASS * expected)
            least = fmin(least, apart);
        last = points[i].pass;
    }
    return isfinite(least) ? least : 0;
}

/* ------------------------------------------------------------------------- climbs */

/* How bad it is there; -INFINITY where it does not count. */
static double badness(const NcVerifier *verifier, size_t region, NcPlace *place, NcClimb towards,
                      double least, size_t *move)
{
    double deviation = nc_verifier_measure(verifier, place, move);
    if (towards == NC_CLIMB_GOUGE)
        return -deviation;
    return deviation > least && nc_verifier_reaches(verifier, region, place) ? deviation
                                                                             : -INFINITY;
}

NcWorst nc_climb(const NcVerifier *verifier, size_t region, const NcPlace *from, NcClimb towards,
                 double step_mm)
{
    NcPlace at = *from;
    size_t move;
    double worst = badness(verifier, region, &at, towards, -INFINITY, &move), step = step_mm;
    SegVec3 x = across_of(verifier, move, at.normal);
    SegVec3 y = seg_cross(at.normal, x);
    for (int i = 0; i < STEPS_MOST && step > step_mm / (1 << HALVINGS); i++) {
        SegVec3 steps[] = {seg_scale(x, step), seg_scale(x, -step), seg_scale(y, step),
                           seg_scale(y, -step)};
        bool better = false;
        for (size_t k = 0; k < G_N_ELEMENTS(steps) && !better; k++) {
            NcPlace next;
            size_t by;
            if (!nc_surface_step(verifier->surface, &at, steps[k], &next))
                continue;
            double there = badness(verifier, region, &next, towards, worst, &by);
            better = there > worst;
            if (better) {
                worst = there;
                at = next;
                move = by;
            }
        }
        if (!better)
            step /= 2;
    }
    return (NcWorst){fmax(worst, 0), at.point, nc_verifier_line(verifier, move)};
}
