/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/ramp.h"

#include <math.h>

/* Distances closer than this are one place (mm), speeds equal when their squares are this near,
 * relative to the move's top speed: far above rounding, far below what any machine resolves. */
#define SAME_MM 1e-9
#define SAME_SPEED 1e-12

static void accelerate(const SimProgram *program, const SimPlan *plan, SimPlace at, bool forward,
                       GArray *pieces);
static void brake_to(const SimProgram *program, const SimPlan *law, const SimPlan *plan,
                     SimPlace at, GArray *pieces);
static double meets_mm(const NcTimedMove *timed, double a_mm_s2, double at_mm, double w2);
static void add_piece(GArray *pieces, const NcTimedMove *timed, size_t move, double from_mm,
                      double to_mm, double from_mm_s, double to_mm_s);
static GArray *reversed(GArray *pieces, const SimPlan *plan);
static bool rests_after(const SimProgram *program, const SimPlan *plan, size_t move);
static double planned_squared(const NcTimedMove *timed, double at_mm);
static double squared(double x);

GArray *sim_ramp_stop(const SimProgram *program, const SimPlan *law, SimPlace from)
{
    GArray *pieces = g_array_new(FALSE, FALSE, sizeof(SimPiece));
    double w = from.speed_mm_s, at = from.at_mm;
    for (size_t i = from.move; w > 0 && sim_travels(program, i); i++) {
        const NcTimedMove *timed = &law->timed[i];
        double left = timed->length_mm - at, out = 0, to = timed->length_mm;
        if (left > 0) {
            double stop = squared(w) / (2 * timed->a_mm_s2);
            if (stop > left + SAME_MM && !rests_after(program, law, i))
                out = sqrt(squared(w) - 2 * timed->a_mm_s2 * left);
            else if (stop < left - SAME_MM)
                to = at + stop;
        } else {
            out = w;
        }
        add_piece(pieces, timed, i, at, to, w, out);
        w = out;
        at = 0;
    }
    return pieces;
}

GArray *sim_ramp_meet(const SimProgram *program, const SimPlan *law, const SimPlan *plan,
                      SimPlace from)
{
    GArray *pieces = g_array_new(FALSE, FALSE, sizeof(SimPiece));
    if (sim_ramp_above(program, plan, from))
        brake_to(program, law, plan, from, pieces);
    else
        accelerate(program, plan, from, true, pieces);
    return pieces;
}

/* Braking to a place is accelerating away from it with the time turned round. */
GArray *sim_ramp_stop_at(const SimProgram *program, const SimPlan *plan, size_t move)
{
    g_autoptr(GArray) pieces = g_array_new(FALSE, FALSE, sizeof(SimPiece));
    SimPlace end = {.move = move, .at_mm = plan->timed[move].length_mm};
    accelerate(program, plan, end, false, pieces);
    return reversed(pieces, plan);
}

bool sim_ramp_above(const SimProgram *program, const SimPlan *plan, SimPlace place)
{
    while (sim_travels(program, place.move) && !sim_plan_moves(&plan->timed[place.move]))
        place = (SimPlace){place.move + 1, 0, place.speed_mm_s};
    if (!sim_travels(program, place.move))
        return false;
    const NcTimedMove *timed = &plan->timed[place.move];
    double w2 = squared(place.speed_mm_s), plan2 = planned_squared(timed, place.at_mm);
    return w2 > plan2 + SAME_SPEED * fmax(w2, squared(timed->v_max_mm_s));
}

double sim_plan_distance_mm(const NcTimedMove *timed, double t_s)
{
    if (!sim_plan_moves(timed) || t_s <= 0)
        return 0;
    double a = timed->a_mm_s2, t1 = (timed->v_max_mm_s - timed->v_in_mm_s) / a;
    double t3 = (timed->v_max_mm_s - timed->v_out_mm_s) / a, left = timed->duration_s - t_s;
    if (left <= 0)
        return timed->length_mm;
    if (t_s < t1)
        return timed->v_in_mm_s * t_s + a * squared(t_s) / 2;
    if (left < t3)
        return timed->length_mm - timed->v_out_mm_s * left - a * squared(left) / 2;
    return (timed->v_in_mm_s + timed->v_max_mm_s) / 2 * t1 + timed->v_max_mm_s * (t_s - t1);
}

double sim_plan_time_s(const NcTimedMove *timed, double distance_mm)
{
    if (!sim_plan_moves(timed) || distance_mm <= 0)
        return 0;
    double a = timed->a_mm_s2, left = timed->length_mm - distance_mm;
    if (left <= 0)
        return timed->duration_s;
    double vmax2 = squared(timed->v_max_mm_s), in2 = squared(timed->v_in_mm_s),
           out2 = squared(timed->v_out_mm_s);
    double up = (vmax2 - in2) / (2 * a), down = (vmax2 - out2) / (2 * a);
    /* 2x/(v0 + v1) is the time of a stretch x at constant acceleration, without cancellation. */
    if (distance_mm < up)
        return 2 * distance_mm / (timed->v_in_mm_s + sqrt(in2 + 2 * a * distance_mm));
    if (left < down)
        return timed->duration_s - 2 * left / (timed->v_out_mm_s + sqrt(out2 + 2 * a * left));
    return (timed->v_max_mm_s - timed->v_in_mm_s) / a + (distance_mm - up) / timed->v_max_mm_s;
}

bool sim_plan_moves(const NcTimedMove *timed)
{
    return timed->length_mm > 0 && timed->a_mm_s2 > 0;
}

bool sim_plan_forbids(const NcTimedMove *timed)
{
    return sim_plan_moves(timed) && timed->v_max_mm_s <= 0;
}

/* Walks from `at` along the path, or against it, gaining speed until the plan's is met. */
static void accelerate(const SimProgram *program, const SimPlan *plan, SimPlace at, bool forward,
                       GArray *pieces)
{
    double w2 = squared(at.speed_mm_s), from = at.at_mm;
    for (size_t i = at.move; sim_travels(program, i); i += forward ? 1 : (size_t)-1) {
        const NcTimedMove *timed = &plan->timed[i];
        double a2 = 2 * timed->a_mm_s2, end = forward ? timed->length_mm : 0;
        if (i != at.move)
            from = timed->length_mm - end;
        double left = fabs(end - from), vmax2 = squared(timed->v_max_mm_s), meet = INFINITY;
        if (timed->length_mm > 0) {
            double far2 = squared(forward ? timed->v_out_mm_s : timed->v_in_mm_s);
            if (w2 >= planned_squared(timed, from) - SAME_SPEED * vmax2)
                return;
            /* Against the rising side of the trapezoid the gap stays; the flat and the falling
             * side are met at these distances. */
            meet = fmin((vmax2 - w2) / a2, (far2 + a2 * left - w2) / (2 * a2));
        }
        bool met = meet < left;
        double out2 = w2 + a2 * fmin(meet, left);
        double to = !met ? end : forward ? from + meet : from - meet;
        add_piece(pieces, timed, i, from, to, sqrt(w2), sqrt(out2));
        if (met)
            return;
        w2 = out2;
    }
}

/* Walks along the path, losing speed until it is down at the plan's. */
static void brake_to(const SimProgram *program, const SimPlan *law, const SimPlan *plan,
                     SimPlace at, GArray *pieces)
{
    double w2 = squared(at.speed_mm_s), from = at.at_mm;
    for (size_t i = at.move; sim_travels(program, i); i++, from = 0) {
        const NcTimedMove *timed = &plan->timed[i];
        double length = timed->length_mm, a = law->timed[i].a_mm_s2;
        double meet = sim_plan_moves(timed) ? meets_mm(timed, a, from, w2) : INFINITY;
        bool met = from + meet < length - SAME_MM;
        double to = met ? from + meet : length;
        double out2 = fmax(0, w2 - 2 * a * (to - from));
        if (!met && length > 0 && rests_after(program, plan, i))
            out2 = 0;
        add_piece(pieces, timed, i, from, to, sqrt(w2), sqrt(out2));
        w2 = out2;
        if (met || (length > 0 && !sim_ramp_above(program, plan, (SimPlace){i, to, sqrt(w2)})))
            return;
    }
}

/*
 * How far from `at_mm`, where the squared speed is w2 and falls with `a`, the plan is met: the
 * least d with w2 - 2ad <= each of its three sides. The falling side may fall faster than w: then
 * it can only be met before a certain d. INFINITY: not on this move.
 */
static double meets_mm(const NcTimedMove *timed, double a_mm_s2, double at_mm, double w2)
{
    double a = a_mm_s2, b = timed->a_mm_s2, left = timed->length_mm - at_mm;
    double up2 = squared(timed->v_in_mm_s) + 2 * b * at_mm;
    double down2 = squared(timed->v_out_mm_s) + 2 * b * left;
    double d = fmax((w2 - up2) / (2 * (a + b)), (w2 - squared(timed->v_max_mm_s)) / (2 * a));
    d = fmax(d, 0);
    double over = w2 - down2 + 2 * (b - a) * d; /* above the falling side there */
    if (over <= SAME_SPEED * w2)
        return d;
    return a > b ? d + over / (2 * (a - b)) : INFINITY;
}

/* The same stretches the other way round. */
static GArray *reversed(GArray *pieces, const SimPlan *plan)
{
    GArray *turned = g_array_new(FALSE, FALSE, sizeof(SimPiece));
    for (guint i = pieces->len; i-- > 0;) {
        const SimPiece *piece = &g_array_index(pieces, SimPiece, i);
        add_piece(turned, &plan->timed[piece->move], piece->move, piece->to_mm, piece->from_mm,
                  piece->to_mm_s, piece->from_mm_s);
    }
    return turned;
}

static void add_piece(GArray *pieces, const NcTimedMove *timed, size_t move, double from_mm,
                      double to_mm, double from_mm_s, double to_mm_s)
{
    double length = fabs(to_mm - from_mm);
    SimPiece piece = {.move = move,
                      .from_mm = from_mm,
                      .to_mm = to_mm,
                      .from_mm_s = from_mm_s,
                      .to_mm_s = to_mm_s,
                      .duration_s = length > 0 ? 2 * length / (from_mm_s + to_mm_s) : 0,
                      .ends_move = to_mm >= timed->length_mm};
    g_array_append_val(pieces, piece);
}

bool sim_travels(const SimProgram *program, size_t move)
{
    if (move >= program->n)
        return false;
    NcMoveKind kind = program->moves[move].kind;
    return kind == NC_MOVE_RAPID || kind == NC_MOVE_FEED || kind == NC_MOVE_ARC;
}

/* Whether the path ends, or stops for something else, at the end of this move. */
static bool rests_after(const SimProgram *program, const SimPlan *plan, size_t move)
{
    do
        move++;
    while (sim_travels(program, move) && !sim_plan_moves(&plan->timed[move]));
    return !sim_travels(program, move);
}

static double planned_squared(const NcTimedMove *timed, double at_mm)
{
    double a2 = 2 * timed->a_mm_s2;
    double up2 = squared(timed->v_in_mm_s) + a2 * at_mm;
    double down2 = squared(timed->v_out_mm_s) + a2 * (timed->length_mm - at_mm);
    return fmin(fmin(up2, down2), squared(timed->v_max_mm_s));
}

static double squared(double x)
{
    return x * x;
}
