/* SPDX-License-Identifier: Apache-2.0 */
/* A judge that knows nothing of the planner: long random programs, positions every millisecond,
 * differences of them against the axes' limits, distances to the programmed path against P. */
#include "nc/nc.h"
#include "tests/lib/test.h"

#include <math.h>
#include <string.h>

#define STEP_S 1e-3
#define EXCESS 1.001

typedef struct {
    GRand *rand;
    GArray *moves;
    NcMove last; /* the modal state */
} Program;

static CfgMachine machine_with(double jerk)
{
    CfgMachine machine = {.spindle_max_rpm = 10000, .spindle_rpm_per_s = 5000};
    static const double v[3] = {12000, 9000, 6000}, a[3] = {2000, 1500, 800};
    for (int i = 0; i < 3; i++) {
        machine.axis[i] = (CfgAxis){-1000, 1000, v[i], a[i], jerk * (1.0 - 0.2 * i)};
        machine.rotary[i] = (CfgRotary){.present = true,
                                        .min_deg = -3600,
                                        .max_deg = 3600,
                                        .max_deg_min = 6000,
                                        .max_deg_s2 = 1000,
                                        .max_deg_s3 = jerk};
    }
    return machine;
}

static double between(Program *p, double low, double high)
{
    return g_rand_double_range(p->rand, low, high);
}

static void add_move(Program *p, NcMove move)
{
    move.line = p->moves->len + 1;
    g_array_append_val(p->moves, move);
    p->last.from = p->last.to = move.to;
    memcpy(p->last.from_deg, move.to_deg, sizeof move.to_deg);
    memcpy(p->last.to_deg, move.to_deg, sizeof move.to_deg);
}

static SegVec3 random_step(Program *p, double size)
{
    SegVec3 at = p->last.from;
    SegVec3 step = {between(p, -size, size), between(p, -size, size), between(p, -size, size) / 2};
    return fabs(at.x) + fabs(at.y) + fabs(at.z) > 300 ? seg_scale(at, -0.5) : step;
}

static void add_line(Program *p, NcMoveKind kind, double size, bool rotary)
{
    NcMove move = p->last;
    move.kind = kind;
    move.to = seg_add(move.from, random_step(p, size));
    if (rotary) {
        int axis = g_rand_int_range(p->rand, 0, 3);
        move.to_deg[axis] = between(p, -90, 90);
        if (g_rand_int_range(p->rand, 0, 3) == 0)
            move.to = move.from;
    }
    add_move(p, move);
}

/* Any start and turn; sometimes on the tangent of the last straight move. */
static void add_arc(Program *p)
{
    static const int first[3] = {0, 2, 1}, second[3] = {1, 0, 2}, normal[3] = {2, 1, 0};
    int plane = g_rand_int_range(p->rand, 0, 3);
    NcMove move = p->last;
    double from[3] = {move.from.x, move.from.y, move.from.z};
    double r = pow(10.0, between(p, -0.7, 1.5)), start = between(p, -G_PI, G_PI);
    move.turn = g_rand_boolean(p->rand) ? 1 : -1;
    if (p->moves->len > 0 && g_rand_boolean(p->rand)) {
        NcMove *before = &g_array_index(p->moves, NcMove, p->moves->len - 1);
        double d[3] = {before->to.x - before->from.x, before->to.y - before->from.y,
                       before->to.z - before->from.z};
        if (hypot(d[first[plane]], d[second[plane]]) > 1e-6)
            start = atan2(d[second[plane]], d[first[plane]]) - move.turn * G_PI / 2;
    }
    double sweep = between(p, 0.05, 6.2), centre[3], to[3];
    centre[normal[plane]] = from[normal[plane]];
    centre[first[plane]] = from[first[plane]] - r * cos(start);
    centre[second[plane]] = from[second[plane]] - r * sin(start);
    to[first[plane]] = centre[first[plane]] + r * cos(start + move.turn * sweep);
    to[second[plane]] = centre[second[plane]] + r * sin(start + move.turn * sweep);
    to[normal[plane]] = from[normal[plane]];
    if (g_rand_int_range(p->rand, 0, 3) == 0)
        to[normal[plane]] += between(p, -3, 3);
    move.kind = NC_MOVE_ARC;
    move.plane = 17 + plane;
    move.centre = seg_vec3(centre[0], centre[1], centre[2]);
    move.to = seg_vec3(to[0], to[1], to[2]);
    add_move(p, move);
}

/* A smooth curve in short moves, with coordinates of few places now and then. */
static void add_chain(Program *p)
{
    double r = pow(10.0, between(p, 0.0, 1.5)), step = pow(10.0, between(p, -2.0, 0.0));
    double a = between(p, 0, 6), rise = between(p, -0.3, 0.3), places = 0.0;
    SegVec3 c = seg_sub(p->last.from, seg_vec3(r * cos(a), r * sin(a), 0));
    if (g_rand_boolean(p->rand))
        places = g_rand_boolean(p->rand) ? 1e4 : 1e3;
    for (int i = 1; i < 60; i++) {
        NcMove move = p->last;
        double angle = a + i * step / r;
        move.kind = NC_MOVE_FEED;
        move.to = seg_vec3(c.x + r * cos(angle), c.y + r * sin(angle), c.z + rise * i * step);
        if (places > 0)
            move.to =
                seg_vec3(round(move.to.x * places) / places, round(move.to.y * places) / places,
                         round(move.to.z * places) / places);
        add_move(p, move);
    }
}

static void add_mode(Program *p)
{
    static const double tolerances[] = {0, INFINITY, 0.001, 0.01, 0.05, 0.5};
    p->last.tolerance_mm = tolerances[g_rand_int_range(p->rand, 0, 6)];
    p->last.exact_stop = p->last.tolerance_mm == 0 && g_rand_int_range(p->rand, 0, 4) == 0;
    p->last.feed_mm_min = pow(10.0, between(p, 2.7, 4.2));
}

static GArray *random_moves(guint32 seed, int n, bool rotary)
{
    Program p = {.rand = g_rand_new_with_seed(seed),
                 .moves = g_array_new(FALSE, TRUE, sizeof(NcMove)),
                 .last = {.feed_mm_min = 3000, .tolerance_mm = 0.01}};
    for (int i = 0; i < n; i++) {
        int kind = g_rand_int_range(p.rand, 0, 16);
        double size = pow(10.0, between(&p, -2.5, 1.5));
        if (kind == 0)
            add_mode(&p);
        else if (kind < 3)
            add_line(&p, NC_MOVE_RAPID, size, rotary && kind == 1);
        else if (kind < 6)
            add_arc(&p);
        else if (kind == 6)
            add_chain(&p);
        else if (kind == 7 && g_rand_int_range(p.rand, 0, 6) == 0)
            add_move(
                &p,
                (NcMove){.kind = NC_MOVE_DWELL,
                         .from = p.last.from,
                         .to = p.last.to,
                         .dwell_s = 0.01,
                         .from_deg = {p.last.from_deg[0], p.last.from_deg[1], p.last.from_deg[2]},
                         .to_deg = {p.last.from_deg[0], p.last.from_deg[1], p.last.from_deg[2]}});
        else
            add_line(&p, NC_MOVE_FEED, size, rotary && kind > 12);
    }
    g_rand_free(p.rand);
    return p.moves;
}

/* ------------------------------------------------------------------------ judging */

typedef struct {
    double v, a, j, off; /* greatest share of the limit, of any axis; of the tolerance */
    size_t v_move, a_move, j_move, off_move;
    size_t samples;
} Judged;

static double component(SegVec3 v, int axis)
{
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

/* From the point of an arc of less than a turn at the same angle. */
static double from_arc_mm(const NcMove *move, SegVec3 p)
{
    int first = move->plane == 17 ? 0 : move->plane == 18 ? 2 : 1;
    int second = move->plane == 17 ? 1 : move->plane == 18 ? 0 : 2;
    SegVec3 spoke[3] = {seg_sub(move->from, move->centre), seg_sub(p, move->centre),
                        seg_sub(move->to, move->centre)};
    double angle[3];
    for (int i = 0; i < 3; i++)
        angle[i] = move->turn * atan2(component(spoke[i], second), component(spoke[i], first));
    double sweep = fmod(angle[2] - angle[0] + 4 * G_PI, 2 * G_PI);
    double at = fmod(angle[1] - angle[0] + 4 * G_PI, 2 * G_PI);
    if (at > sweep)
        at = at - sweep < 2 * G_PI - at ? sweep : 0;
    double best = INFINITY, f = at / sweep;
    for (double step = 0.1; step > 1e-9; step /= 2)
        for (int side = -1; side <= 1; side++) {
            double near = fmax(0, fmin(1, f + side * step));
            double distance = seg_distance(p, nc_move_point(move, near));
            if (distance < best)
                best = distance, f = near;
        }
    return best;
}

static double from_move_mm(const NcMove *move, SegVec3 p)
{
    if (move->kind == NC_MOVE_ARC)
        return from_arc_mm(move, p);
    SegVec3 along = seg_sub(move->to, move->from);
    double all = seg_dot(along, along);
    double f = all > 0 ? seg_dot(seg_sub(p, move->from), along) / all : 0;
    return seg_distance(p, seg_lerp(move->from, move->to, fmax(0, fmin(1, f))));
}

/* Distance to the path around a move, over the largest tolerance there. */
static double off_path(const NcMove *moves, size_t n, size_t at, SegVec3 p, size_t around)
{
    double best = INFINITY;
    for (size_t k = at > around ? at - around : 0; k < n && k <= at + around; k++) {
        double tolerance = fmax(moves[k].tolerance_mm, 1e-4);
        if (nc_move_travels(&moves[k]))
            best = fmin(best, from_move_mm(&moves[k], p) / (isfinite(tolerance) ? tolerance : 1e9));
    }
    return best;
}

static void keep(double *most, size_t *where, double value, size_t move)
{
    if (value > *most || isnan(value)) {
        *most = isnan(value) ? INFINITY : value;
        *where = move;
    }
}

static double share(double value, double limit)
{
    return limit > 0 ? fabs(value) / limit : 0;
}

static void judge(const CfgMachine *machine, const NcMotion *motion, const GArray *all, Judged *r)
{
    const NcMove *moves = (const NcMove *)(const void *)all->data;
    size_t n = all->len, move = 0;
    double p[4][6];
    double total = nc_motion_total_s(motion);
    *r = (Judged){0};
    for (size_t k = 0; (double)k * STEP_S <= total + 4 * STEP_S; k++) {
        double t = (double)k * STEP_S;
        NcPoint now = nc_motion_at(motion, t);
        while (move + 1 < n && nc_motion_start_s(motion, move + 1) <= t)
            move++;
        memmove(p[1], p[0], sizeof p[0] * 3);
        memcpy(p[0], now.position, sizeof p[0]);
        r->samples++;
        for (int i = 0; i < 6; i++) {
            const CfgRotary *rotary = &machine->rotary[i % 3];
            double v_max = i < 3 ? machine->axis[i].max_mm_min / 60 : rotary->max_deg_min / 60;
            double a_max = i < 3 ? machine->axis[i].max_mm_s2 : rotary->max_deg_s2;
            double j_max = i < 3 ? machine->axis[i].max_mm_s3 : rotary->max_deg_s3;
            if (k >= 1)
                keep(&r->v, &r->v_move, share((p[0][i] - p[1][i]) / STEP_S, v_max), move);
            if (k >= 2)
                keep(&r->a, &r->a_move,
                     share((p[0][i] - 2 * p[1][i] + p[2][i]) / (STEP_S * STEP_S), a_max), move);
            if (k >= 3)
                keep(&r->j, &r->j_move,
                     share((p[0][i] - 3 * p[1][i] + 3 * p[2][i] - p[3][i]) / pow(STEP_S, 3), j_max),
                     move);
        }
        SegVec3 at = {now.position[0], now.position[1], now.position[2]};
        double off = off_path(moves, n, move, at, 1);
        if (off > 1)
            off = fmin(off, off_path(moves, n, move, at, 100));
        keep(&r->off, &r->off_move, off, move);
    }
}

static void judge_random(double jerk, bool rotary, NcOverride override)
{
    CfgMachine machine = machine_with(jerk);
    for (guint32 seed = 1; seed <= (guint32)test_trials(4); seed++) {
        g_autoptr(GArray) moves = random_moves(seed, 400, rotary);
        g_autoptr(NcMotion) motion = nc_motion_new(
            &machine, override, 0, (const NcMove *)(const void *)moves->data, moves->len);
        Judged r;
        judge(&machine, motion, moves, &r);
        g_test_message(
            "seed %u: %zu samples, v %.5f (%zu) a %.5f (%zu) j %.5f (%zu) off %.5f (%zu)", seed,
            r.samples, r.v, r.v_move, r.a, r.a_move, r.j, r.j_move, r.off, r.off_move);
        g_assert_cmpfloat(r.v, <, EXCESS);
        g_assert_cmpfloat(r.a, <, EXCESS);
        g_assert_cmpfloat(r.j, <, EXCESS);
        g_assert_cmpfloat(r.off, <, EXCESS);
        g_assert_cmpfloat(r.a, >, 0.5);
    }
}

static void trapezoidal(void)
{
    judge_random(0, false, NC_NO_OVERRIDE);
    judge_random(0, true, NC_NO_OVERRIDE);
}

static void jerk_limited(void)
{
    judge_random(50000, false, NC_NO_OVERRIDE);
    judge_random(5000, true, NC_NO_OVERRIDE);
}

static void overridden(void)
{
    judge_random(0, true, (NcOverride){200, 50, 100});
    judge_random(50000, true, (NcOverride){180, 30, 100});
}

static void add(void)
{
    g_test_add_func("/nc/motion/limits/trapezoidal", trapezoidal);
    g_test_add_func("/nc/motion/limits/jerk", jerk_limited);
    g_test_add_func("/nc/motion/limits/override", overridden);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
