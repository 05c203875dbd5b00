/* SPDX-License-Identifier: Apache-2.0 */
/* Anything in any order: the machine never jumps, never loses count, and always comes to an end. */
#include "tests/unit/sim_rig.h"

#define PASSES 12

typedef struct {
    Rig rig;
    GRand *rand;
    SimReader *reader; /* of the program that drips; else NULL */
    int fed;
    unsigned kinds[SIM_ACKNOWLEDGE + 1];
} Soak;

/* The i-th pass of a program: out of the part and in again, sometimes with a change or a stop. */
static void append_pass(Soak *s, GString *text, int i)
{
    static const char *const extras[] = {"T1 M6\n", "T2 M6\n", "S2000 M3\n", "M5\n",  "G4 P0.2\n",
                                         "M0\n",    "M1\n",    "M8\n",       "G55\n", "(none)\n"};
    if (i == 0)
        g_string_append(text, "G21 G90 G94 G64 P0.02 F3000\n");
    g_string_append(text, extras[g_rand_int_range(s->rand, 0, G_N_ELEMENTS(extras))]);
    for (int k = g_rand_int_range(s->rand, 0, 8); k-- > 0;)
        g_string_append_printf(
            text, "G53 G%d X%.2f Y%.2f Z%.2f\n", k > 0, g_rand_double_range(s->rand, -20, 20),
            g_rand_double_range(s->rand, -20, 20), g_rand_double_range(s->rand, -20, 0));
    if (g_rand_boolean(s->rand))
        g_string_append(text, "G91 G2 I4 J3\nG90\n");
    if (i == PASSES - 1)
        g_string_append(text, "M30\n");
}

static void load_stored(Soak *s)
{
    g_autoptr(GString) text = g_string_new(NULL);
    uint64_t gates[PASSES];
    for (int i = 0; i < PASSES; i++) {
        append_pass(s, text, i);
        gates[i] = text->len;
    }
    SimProgram *program = rig_program(&s->rig, text->str, gates, PASSES, NULL);
    g_assert_nonnull(program);
    SimEvent event = {.kind = SIM_LOAD, .program = program};
    if (program)
        sim_controller_step(s->rig.controller, &event, s->rig.now_us, s->rig.actions);
}

static void load_dripping(Soak *s)
{
    s->reader = sim_reader_new(&s->rig.machine, &s->rig.table);
    s->fed = 0;
    rig_do(&s->rig, SIM_LOAD);
}

static void feed(Soak *s)
{
    SimEvent event = {.kind = SIM_PASS};
    if (!s->reader || s->fed >= PASSES)
        return;
    if (g_rand_int_range(s->rand, 0, 60) > 0) {
        g_autoptr(GString) text = g_string_new(NULL);
        append_pass(s, text, s->fed++);
        g_autoptr(GBytes) bytes = g_bytes_new(text->str, text->len);
        const uint64_t end = text->len;
        event.program =
            sim_reader_read(s->reader, bytes, &end, 1, s->fed == PASSES, NC_NO_OVERRIDE, NULL);
        g_assert_nonnull(event.program);
    }
    sim_controller_step(s->rig.controller, &event, s->rig.now_us, s->rig.actions);
}

static void bring_plan(Soak *s)
{
    NcOverride override;
    SimProgram *program = sim_controller_unplanned(s->rig.controller, &override);
    if (!program)
        return;
    SimEvent event = {.kind = SIM_PLAN,
                      .program = program,
                      .plan = sim_plan_new(program, &s->rig.machine, override)};
    sim_controller_step(s->rig.controller, &event, s->rig.now_us, s->rig.actions);
}

/* The receiver lets a program in only where none is run. */
static void load(Soak *s)
{
    const FbState state = rig_state(&s->rig);
    if (state != FB_STATE_IDLE && state != FB_STATE_READY && state != FB_STATE_COMPLETE)
        return;
    g_clear_pointer(&s->reader, sim_reader_unref);
    if (g_rand_boolean(s->rand))
        load_stored(s);
    else
        load_dripping(s);
}

static void something(Soak *s)
{
    static const SimEventKind often[] = {SIM_PASS, SIM_PLAN, SIM_RESUME, SIM_TICK, SIM_START};
    SimEventKind kind = (SimEventKind)g_rand_int_range(s->rand, 0, SIM_ACKNOWLEDGE + 1);
    if (g_rand_int_range(s->rand, 0, 3) > 0)
        kind = often[g_rand_int_range(s->rand, 0, G_N_ELEMENTS(often))];
    if ((kind == SIM_ABORT || kind == SIM_ESTOP) && g_rand_int_range(s->rand, 0, 20) > 0)
        kind = SIM_TICK;
    SimEvent event = {.kind = kind};
    s->kinds[kind]++;
    switch (kind) {
    case SIM_LOAD:
        load(s);
        return;
    case SIM_PASS:
        feed(s);
        return;
    case SIM_PLAN:
        bring_plan(s);
        return;
    case SIM_FORGET:
        if (g_rand_int_range(s->rand, 0, 20) > 0)
            return;
        break;
    case SIM_RESTART:
        event.gate = (size_t)g_rand_int_range(s->rand, 0, PASSES + 2);
        break;
    case SIM_OVERRIDE:
        event.override =
            (NcOverride){10 * g_rand_int_range(s->rand, 0, 21),
                         10 * g_rand_int_range(s->rand, 0, 11), g_rand_int_range(s->rand, 50, 201)};
        break;
    case SIM_OPTIONAL_STOP:
        event.on = g_rand_boolean(s->rand);
        break;
    case SIM_TICK:
        s->rig.now_us += g_rand_int_range(s->rand, 0, 50000);
        break;
    default:
        break;
    }
    sim_controller_step(s->rig.controller, &event, s->rig.now_us, s->rig.actions);
}

/* Between two looks the machine has gone no further than it can in the program's time of that. */
static bool jumped(const Soak *s, const FbProgress *before)
{
    const FbProgress see = rig_see(&s->rig);
    const double ms = fmax(0, (double)see.program_time_ms - before->program_time_ms) + 2;
    for (int axis = 0; axis < 3; axis++)
        if (fabs(see.position_mm[axis] - before->position_mm[axis]) > 200 * ms * 1e-3)
            return true;
    return see.executed_blocks < before->executed_blocks;
}

/* Blocks of one run have ascending lines. */
static uint32_t check_lines(const Rig *rig, guint from, uint32_t last)
{
    for (guint i = from; i < rig->actions->len; i++) {
        const SimAction *action = &g_array_index(rig->actions, SimAction, i);
        if (action->kind == SIM_TELL && action->event == FB_MACHINE_RUNNING && action->time_s == 0)
            last = 0;
        if (action->kind != SIM_BLOCK)
            continue;
        if (action->block.line <= last || action->block.end_s < action->block.start_s)
            g_test_fail();
        last = action->block.line;
    }
    return last;
}

static void anything_in_any_order(void)
{
    unsigned completed = 0, aborted = 0, stopped = 0;
    for (guint32 seed = 0; seed < 12; seed++) {
        Soak s = {.rand = g_rand_new_with_seed(seed)};
        rig_init(&s.rig, seed % 4 == 3 ? INFINITY : 1, 7);
        rig_do(&s.rig, SIM_ACKNOWLEDGE);
        uint32_t line = 0;
        int wrong = 0;
        for (int i = 0; i < 20000; i++) {
            const FbProgress before = rig_see(&s.rig);
            const guint n = s.rig.actions->len;
            something(&s);
            line = check_lines(&s.rig, n, line);
            wrong += jumped(&s, &before);
        }
        g_assert_cmpint(wrong, ==, 0);
        for (int kind = 0; kind <= SIM_ACKNOWLEDGE; kind++)
            g_assert_cmpuint(s.kinds[kind], >, 0);
        const SimTotals totals = sim_controller_totals(s.rig.controller);
        completed += totals.completed;
        aborted += totals.aborted;
        stopped += totals.stopped;
        /* Left alone, with all that it can want, it ends. */
        rig_override(&s.rig, 100, 100, 100);
        for (int i = 0; i < 2000 && rig_state(&s.rig) != FB_STATE_IDLE; i++) {
            rig_tick(&s.rig, 100000);
            if (rig_state(&s.rig) == FB_STATE_HELD || rig_state(&s.rig) == FB_STATE_PROGRAM_STOP)
                rig_do(&s.rig, SIM_RESUME);
            if (rig_see(&s.rig).starving)
                feed(&s);
            if (!sim_controller_moving(s.rig.controller) && rig_state(&s.rig) != FB_STATE_RUNNING) {
                rig_do(&s.rig, SIM_ACKNOWLEDGE);
                rig_do(&s.rig, SIM_FORGET);
            }
        }
        g_assert_cmpint(rig_state(&s.rig), ==, FB_STATE_IDLE);
        sim_reader_unref(s.reader);
        g_rand_free(s.rand);
        rig_clear(&s.rig);
    }
    g_test_message("runs: %u completed, %u aborted, %u by e-stop or alarm", completed, aborted,
                   stopped);
    g_assert_cmpuint(completed, >, 20);
    g_assert_cmpuint(aborted, >, 20);
    g_assert_cmpuint(stopped, >, 20);
}

static void add(void)
{
    g_test_add_func("/sim/random/anything-in-any-order", anything_in_any_order);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
