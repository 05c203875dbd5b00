/* SPDX-License-Identifier: Apache-2.0 */
/* What a restart stands on: the kept copy, the state at a gate, the record from there. */
#include <glib/gstdio.h>
#include <math.h>
#include <string.h>
#include <sys/stat.h>

#include "agent/agent.h"
#include "agent/follow.h"
#include "agent/gate.h"
#include "agent/kept.h"
#include "tests/lib/test.h"

static NcProgram *program_of(const char *text, const uint64_t *gates, size_t n)
{
    NcProgram *program = g_new0(NcProgram, 1);
    program->bytes = g_bytes_new(text, strlen(text));
    program->gates = g_memdup2(gates, n * sizeof *gates);
    program->n_gates = n;
    g_autofree char *sha256 = g_compute_checksum_for_bytes(G_CHECKSUM_SHA256, program->bytes);
    g_strlcpy(program->sha256, sha256, sizeof program->sha256);
    return program;
}

static void id_of(const NcProgram *program, uint8_t id[32])
{
    for (int i = 0; i < 32; i++)
        id[i] = (uint8_t)(g_ascii_xdigit_value(program->sha256[2 * i]) * 16 +
                          g_ascii_xdigit_value(program->sha256[2 * i + 1]));
}

static char *kept_path(const NcProgram *program, const char *suffix)
{
    g_autofree char *name = g_strconcat(program->sha256, suffix, NULL);
    return g_build_filename(g_get_user_state_dir(), "segmill", "programs", name, NULL);
}

/* ------------------------------------------------------------------------ kept */

static void kept_round_trip(void)
{
    static const uint64_t gates[] = {6, 10}, fewer[] = {10};
    g_autoptr(NcProgram) program = program_of("G0 X1\nM30\n", gates, 2);
    g_autoptr(NcProgram) bare = program_of("G0 X1\nM30\n", fewer, 1);
    uint8_t id[32];
    id_of(program, id);
    g_autoptr(GError) error = NULL;
    g_assert_null(agent_kept_load(id, &error));
    g_assert_error(error, AGENT_ERROR, AGENT_ERROR_INPUT);
    g_clear_error(&error);
    g_assert_true(agent_kept_store(program, "machine.ini", "/t/tools.ini", &error));
    g_assert_no_error(error);
    g_autoptr(AgentKept) kept = agent_kept_load(id, &error);
    g_assert_no_error(error);
    if (kept) {
        g_assert_true(g_bytes_equal(kept->program->bytes, program->bytes));
        g_assert_cmpstr(kept->program->sha256, ==, program->sha256);
        g_assert_true(kept->program->n_gates == 2 && kept->program->gates[0] == 6);
        g_assert_true(g_path_is_absolute(kept->machine_file));
        g_assert_cmpstr(kept->tools_file, ==, "/t/tools.ini");
    }
    g_autofree char *path = kept_path(program, ".ngc");
    struct stat found = {0};
    g_assert_cmpint(stat(path, &found), ==, 0);
    g_assert_cmpint((int)(found.st_mode & 0777), ==, 0444);
    /* Sent again, otherwise: the gates are those of the last time. */
    g_assert_true(agent_kept_store(bare, NULL, NULL, &error));
    g_autoptr(AgentKept) again = agent_kept_load(id, &error);
    g_assert_true(again && again->program->n_gates == 1 && !again->machine_file);
}

/* Whatever is not what was sent is refused, and says so. */
static void kept_damaged(void)
{
    static const char *const descriptions[] = {
        "",
        "[program]\ngates=\n",
        "[program]\ngates=6 10 11\n",
        "[program]\ngates=10 6\n",
        "[program]\ngates=6 6 10\n",
        "[program]\ngates=6\n",
        "[program]\ngates=-6 10\n",
        "[program]\ngates=6 x\n",
        "[program\n",
    };
    static const uint64_t gates[] = {6, 10};
    g_autoptr(NcProgram) program = program_of("G0 X2\nM30\n", gates, 2);
    uint8_t id[32];
    id_of(program, id);
    g_assert_true(agent_kept_store(program, NULL, NULL, NULL));
    g_autofree char *ini = kept_path(program, ".ini");
    g_autofree char *ngc = kept_path(program, ".ngc");
    for (size_t i = 0; i < G_N_ELEMENTS(descriptions); i++) {
        g_autoptr(GError) error = NULL;
        g_file_set_contents(ini, descriptions[i], -1, NULL);
        g_assert_null(agent_kept_load(id, &error));
        g_assert_error(error, AGENT_ERROR, AGENT_ERROR_INPUT);
    }
    g_assert_true(agent_kept_store(program, NULL, NULL, NULL));
    g_file_set_contents(ngc, "G0 X3\nM30\n", -1, NULL);
    g_autoptr(GError) error = NULL;
    g_assert_null(agent_kept_load(id, &error));
    g_assert_true(error && strstr(error->message, "damaged"));
}

/* The one sent longest ago goes, and one that is sent again is young again. */
static void kept_bounded(void)
{
    NcProgram *programs[AGENT_KEPT_MOST + 2];
    uint8_t id[32];
    for (size_t i = 0; i < G_N_ELEMENTS(programs); i++) {
        g_autofree char *text = g_strdup_printf("G0 X%zu\nM30\n", 100 + i);
        const uint64_t end = strlen(text);
        programs[i] = program_of(text, &end, 1);
        g_assert_true(agent_kept_store(programs[i], NULL, NULL, NULL));
        g_usleep(2000); /* the clock of a file system may be coarse */
        if (i == AGENT_KEPT_MOST - 1)
            g_assert_true(agent_kept_store(programs[0], NULL, NULL, NULL));
        g_usleep(2000);
    }
    for (size_t i = 0; i < G_N_ELEMENTS(programs); i++) {
        g_autofree char *ngc = kept_path(programs[i], ".ngc");
        g_autofree char *ini = kept_path(programs[i], ".ini");
        bool gone = i == 1 || i == 2;
        g_assert_cmpint(g_file_test(ngc, G_FILE_TEST_EXISTS), ==, !gone);
        g_assert_cmpint(g_file_test(ini, G_FILE_TEST_EXISTS), ==, !gone);
        id_of(programs[i], id);
        g_autoptr(AgentKept) kept = agent_kept_load(id, NULL);
        g_assert_cmpint(kept != NULL, ==, !gone);
        nc_program_free(programs[i]);
    }
}

/* ------------------------------------------------------------------------ gate */

static const char text[] = "G17 G21 G40 G49 G80 G90 G91.1 G94 G64 P0.01\n" /* 1 */
                           "T2 M6\n"
                           "S6000 M3 M8\n"
                           "(REGION 1 convex tool=2 feed=600)\n"
                           "G55 G53 G0 Z-5\n" /* 5 */
                           "G53 G1 X-40 F600\n"
                           "G53 G0 Z0\n" /* gate 1 behind it */
                           "(REGION 2 convex tool=1 feed=900)\n"
                           "\n"
                           "S7000 M4 M9\n" /* 10 */
                           "G53 G1 X-50 F900\n"
                           "M30\n";

static void gate_state(void)
{
    const uint64_t gates[] = {(uint64_t)(strstr(text, "(REGION 2") - text), sizeof text - 1};
    g_autoptr(NcProgram) program = program_of(text, gates, 2);
    g_autoptr(GError) error = NULL;
    g_autoptr(AgentMachine) machine = agent_machine_load("config/etc/machine.ini", NULL, &error);
    g_assert_no_error(error);
    g_auto(AgentGate) gate = {0};
    if (!machine)
        return;
    g_autofree uint32_t *lines = agent_gate_lines(program);
    g_assert_cmpuint(lines[0], ==, 8);
    g_assert_cmpuint(lines[1], ==, 13);
    g_assert_true(agent_gate_read(program, 1, machine, &gate, &error));
    g_assert_no_error(error);
    g_assert_cmpuint(gate.line, ==, 10);
    g_assert_cmpstr(gate.text, ==, "S7000 M4 M9");
    g_assert_cmpint(gate.region, ==, 2);
    g_assert_cmpint(gate.tool, ==, 2);
    test_near(gate.spindle_rpm, 6000, 0, 0);
    g_assert_true(gate.flood && !gate.mist);
    g_assert_cmpint(gate.work_offset, ==, 55);
    test_near(gate.feed_mm_min, 600, 0, 0);
    test_near(gate.position_mm.x, -40, 0, 0);
    test_near(gate.position_mm.z, 0, 0, 0);
    g_assert_cmpuint(gate.left_blocks, ==, 3);
    /* 10 mm at 900 mm/min, and the spindle turns round: 13 000 rev/min. */
    double spindle_s = 13000 / machine->machine->spindle_rpm_per_s;
    g_assert_cmpfloat(gate.left_s, >, 10.0 / 900 * 60);
    g_assert_cmpfloat(gate.left_s, <, 10.0 / 900 * 60 + 2 * spindle_s + 1);
}

/* Before anything has moved, and where nothing ever does: the machine stands where it begins. */
static void gate_before_moves(void)
{
    static const struct {
        const char *text, *block;
        uint64_t gate;
        size_t left;
    } programs[] = {
        {"(nothing)\nG53 G1 X-40 F600\nM30\n", "G53 G1 X-40 F600", 10, 2},
        {"(nothing)\nM30\n", "M30", 10, 1},
    };
    g_autoptr(AgentMachine) machine = agent_machine_load("config/etc/machine.ini", NULL, NULL);
    g_assert_nonnull(machine);
    for (size_t i = 0; machine && i < G_N_ELEMENTS(programs); i++) {
        const uint64_t gates[] = {programs[i].gate, strlen(programs[i].text)};
        g_autoptr(NcProgram) program = program_of(programs[i].text, gates, 2);
        g_auto(AgentGate) gate = {0};
        g_autoptr(GError) error = NULL;
        if (!agent_gate_read(program, 1, machine, &gate, &error)) {
            g_test_message("%s: %s", programs[i].text, error->message);
            g_test_fail();
            continue;
        }
        g_assert_cmpstr(gate.text, ==, programs[i].block);
        g_assert_cmpuint(gate.left_blocks, ==, programs[i].left);
        test_near(gate.position_mm.x, machine->machine->tool_change_mm[0], 0, 0);
        test_near(gate.position_mm.y, machine->machine->tool_change_mm[1], 0, 0);
        test_near(gate.position_mm.z, machine->machine->tool_change_mm[2], 0, 0);
    }
}

/* ---------------------------------------------------------------------- record */

/* Region 7 on lines 1 to 50 (2 s each), region 4 on 51 to 100 (1 s each). */
static AgentProgram *planned(void)
{
    AgentProgram *p = g_new0(AgentProgram, 1);
    static const AgentProgramRegion regions[] = {{7, 100}, {4, 50}};
    p->regions = g_memdup2(regions, sizeof regions);
    p->n_regions = 2;
    p->n_lines = 100;
    p->lines = g_new0(AgentProgramLine, 100);
    for (size_t i = 0; i < 100; i++) {
        p->lines[i] = (AgentProgramLine){(uint32_t)i + 1, p->total_s, i < 50 ? 0 : 1};
        p->total_s += i < 50 ? 2 : 1;
    }
    return p;
}

static FbStatus at(uint32_t run, uint32_t line, double time_s)
{
    return (FbStatus){.state = FB_STATE_RUNNING,
                      .epoch = 9,
                      .run = run,
                      .line = line,
                      .executed_blocks = 1000 + line,
                      .program_time_ms = (uint32_t)(time_s * 1000)};
}

/* From line 41: 20 s of region 7 and 50 s of region 4 are planned. */
static void record_from_gate(void)
{
    g_autoptr(AgentProgram) p = planned();
    AgentFollow follow;
    agent_follow_init(&follow, p);
    agent_follow_begin(&follow, 41);
    FbStatus ready = at(3, 40, 500);
    agent_follow_arm(&follow, &ready);
    test_near(agent_follow_planned_s(&follow), 70, 1e-12, 0);
    test_near(follow.planned_region_s[0], 20, 1e-12, 0);
    test_near(follow.planned_region_s[1], 50, 1e-12, 0);
    FbStatus approach = at(4, 0, 3), cutting = at(4, 51, 23);
    agent_follow_step(&follow, &approach, 1);
    test_near(agent_follow_share(&follow), 0, 0, 0);
    agent_follow_step(&follow, &cutting, 2);
    test_near(agent_follow_share(&follow), 20.0 / 70, 1e-12, 0);
    test_near(follow.region_s[0], 23, 1e-9, 0);
    FbStatus complete = at(4, 0, 73);
    complete.run_end = FB_RUN_COMPLETE;
    complete.drip = true;
    complete.starved = 2;
    complete.starved_ms = 1500;
    agent_follow_step(&follow, &complete, 3);
    test_near(follow.region_s[1], 50, 1e-9, 0);
    test_near(agent_follow_share(&follow), 1, 0, 0);
    g_assert_true(follow.drip && follow.starved == 2);
    test_near(follow.starved_s, 1.5, 1e-12, 0);
    agent_follow_clear(&follow);
}

/* A run that is on already: what it did before is not this record's. */
static void record_joined(void)
{
    g_autoptr(AgentProgram) p = planned();
    AgentFollow follow;
    agent_follow_init(&follow, p);
    FbStatus held = at(4, 51, 200), later = at(4, 76, 225);
    agent_follow_join(&follow, &held);
    test_near(agent_follow_planned_s(&follow), 50, 1e-12, 0);
    agent_follow_step(&follow, &held, 0);
    agent_follow_step(&follow, &later, 1);
    test_near(follow.actual_s, 25, 1e-9, 0);
    test_near(agent_follow_share(&follow), 0.5, 1e-9, 0);
    g_assert_cmpuint(follow.blocks, ==, 25);
    agent_follow_clear(&follow);
}

static void ended(void)
{
    const struct {
        FbStatus status;
        bool ended;
        int code; /* -1: none */
    } ends[] = {
        {at(4, 5, 1), false, -1},
        {{.state = FB_STATE_UNKNOWN, .epoch = 1, .run = 9, .run_end = FB_RUN_ALARM}, false, -1},
        {{.state = FB_STATE_COMPLETE, .epoch = 9, .run = 4, .run_end = FB_RUN_COMPLETE}, true, -1},
        {{.state = FB_STATE_READY, .epoch = 9, .run = 4, .run_end = FB_RUN_ABORTED},
         true,
         FB_ERROR_ABORTED},
        {{.state = FB_STATE_ESTOP, .epoch = 9, .run = 4, .run_end = FB_RUN_ALARM},
         true,
         FB_ERROR_ALARM},
        {{.state = FB_STATE_RUNNING, .epoch = 9, .run = 5}, true, FB_ERROR_PROTOCOL},
        {{.state = FB_STATE_OFF, .epoch = 10, .run = 4}, true, FB_ERROR_LINK_LOST},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(ends); i++) {
        g_autoptr(GError) why = NULL;
        g_assert_cmpint(fb_run_ended(&ends[i].status, 9, 4, &why), ==, ends[i].ended);
        g_assert_cmpint(why ? why->code : -1, ==, ends[i].code);
    }
}

static void add(void)
{
    g_test_add_func("/agent/restart/kept-round-trip", kept_round_trip);
    g_test_add_func("/agent/restart/kept-damaged", kept_damaged);
    g_test_add_func("/agent/restart/kept-bounded", kept_bounded);
    g_test_add_func("/agent/restart/gate-state", gate_state);
    g_test_add_func("/agent/restart/gate-before-moves", gate_before_moves);
    g_test_add_func("/agent/restart/record-from-gate", record_from_gate);
    g_test_add_func("/agent/restart/record-joined", record_joined);
    g_test_add_func("/agent/restart/ended", ended);
}

int main(int argc, char **argv)
{
    return test_main_as_new_user(argc, argv, add);
}
