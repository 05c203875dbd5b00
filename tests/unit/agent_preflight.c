/* SPDX-License-Identifier: Apache-2.0 */
/* The pre-flight's comparison, a difference at a time. */
#include <json-glib/json-glib.h>
#include <string.h>

#include "agent/preflight.h"
#include "tests/lib/test.h"

/* Two tools and G54, all as planned. */
typedef struct {
    CfgTool planned_tools[2];
    CfgToolTable table;
    CfgMachine machine;
    AgentMachine described;
    int used[2];
    AgentProgram needs;
    uint64_t gates[3];
    NcProgram program;
    FbStatus status;
    FbSetup setup;
    AgentPreflight flight;
} Case;

static void case_init(Case *c)
{
    *c = (Case){
        .planned_tools = {{.number = 3,
                           .kind = CFG_TOOL_BALL,
                           .diameter_mm = 6,
                           .corner_radius_mm = 3,
                           .length_mm = 120},
                          {.number = 7,
                           .kind = CFG_TOOL_BULL,
                           .diameter_mm = 10,
                           .corner_radius_mm = 1,
                           .length_mm = 150.5}},
        .machine = {.work_offset_mm = {{-100, -200, -300}, {1, 2, 3}}},
        .used = {3, 7},
        .gates = {100, 900, 1000},
        .program = {.n_gates = 3},
        .status = {.memory_bytes = 5000,
                   .feed_override_percent = 100,
                   .rapid_override_percent = 100,
                   .spindle_override_percent = 100},
        .setup = {.serial = 1,
                  .n_tools = 3,
                  .tools = {{3, CFG_TOOL_BALL, 6, 3, 120},
                            {5, CFG_TOOL_FLAT, 10, 0, 100},
                            {7, CFG_TOOL_BULL, 10, 1, 150.5}},
                  .work_offset_mm = {{-100, -200, -300}, {9, 9, 9}}},
    };
    static const char bytes[1000];
    c->table = (CfgToolTable){c->planned_tools, 2};
    c->described = (AgentMachine){"machine.ini", "tools.ini", &c->machine, &c->table};
    c->needs = (AgentProgram){.tools = c->used, .n_tools = 2, .work_offsets = 1};
    c->program.bytes = g_bytes_new_static(bytes, sizeof bytes);
    c->program.gates = c->gates;
    c->flight = (AgentPreflight){.program = &c->program,
                                 .needs = &c->needs,
                                 .machine = &c->described,
                                 .status = &c->status,
                                 .setup = &c->setup};
}

static void nothing(Case *c)
{
    (void)c;
}
static void missing(Case *c)
{
    c->setup.tools[2].number = 8;
}
static void other_type(Case *c)
{
    c->setup.tools[2].kind = CFG_TOOL_FLAT;
}
static void diameter(Case *c)
{
    c->setup.tools[0].diameter_mm = 6.011;
}
static void within_tolerance(Case *c)
{
    c->setup.tools[0].diameter_mm = 6.01;
    c->setup.tools[2].length_mm = 150.49;
    c->setup.work_offset_mm[0][2] = -300.01;
}
static void corner_radius(Case *c)
{
    c->setup.tools[2].corner_radius_mm = 0.9;
}
static void length(Case *c)
{
    c->setup.tools[0].length_mm = 119;
}
static void unused_tool(Case *c)
{
    c->setup.tools[1].length_mm = 1;
}
static void offset(Case *c)
{
    c->setup.work_offset_mm[0][1] = -199;
}
static void other_offset(Case *c)
{
    c->needs.work_offsets = 2;
}
static void far_offset(Case *c)
{
    c->needs.work_offsets = 1u << 7;
}
static void rotary(Case *c)
{
    c->needs.rotary = true;
}
static void no_offset(Case *c)
{
    c->needs.work_offsets = 0;
    c->setup.work_offset_mm[0][1] = 77;
}
static void unpublished(Case *c)
{
    c->setup = (FbSetup){0};
}
static void empty_table(Case *c)
{
    c->setup.n_tools = 0;
    c->needs.n_tools = 1;
}
static void undescribed(Case *c)
{
    c->flight.needs = NULL;
    c->flight.machine = NULL;
}
static void fits_exactly(Case *c)
{
    c->status.memory_bytes = 1000 + 3 * 8;
    c->flight.drip = CFG_DRIP_NEVER;
}
static void too_large(Case *c)
{
    c->status.memory_bytes = 1000 + 3 * 8 - 1;
    c->flight.drip = CFG_DRIP_NEVER;
}
static void drips(Case *c)
{
    c->status.memory_bytes = 800 + 3 * 40;
}
static void unknown_memory(Case *c)
{
    c->status.memory_bytes = 0;
}
static void pass_too_large(Case *c)
{
    c->status.memory_bytes = 800 + 3 * 40 - 1;
}
static void drips_always(Case *c)
{
    c->flight.drip = CFG_DRIP_ALWAYS;
}
static void overridden(Case *c)
{
    c->status.rapid_override_percent = 25;
}

static const struct {
    const char *name;
    void (*change)(Case *c);
    AgentLevel level;
    const char *code;     /* NULL: nothing is found */
    const char *words[3]; /* in the message */
} cases[] = {
    {"nothing", nothing, 0, NULL, {0}},
    {"missing", missing, AGENT_CAUTION, "tool-missing", {"T7 (bull Ø10 mm)", "that form as T8"}},
    {"type", other_type, AGENT_CAUTION, "tool-type", {"T7", "flat on the machine", "bull in"}},
    {"diameter", diameter, AGENT_CAUTION, "tool-diameter", {"T3", "6.0110", "6.0000"}},
    {"tolerance", within_tolerance, 0, NULL, {0}},
    {"corner radius", corner_radius, AGENT_CAUTION, "tool-corner-radius", {"T7", "0.9", "1.0"}},
    {"length", length, AGENT_CAUTION, "tool-length", {"T3", "119.0000", "120.0000"}},
    {"unused tool", unused_tool, 0, NULL, {0}},
    {"offset", offset, AGENT_CAUTION, "work-offset", {"G54", "Y-199.0000", "Y-200.0000"}},
    {"other offset", other_offset, AGENT_CAUTION, "work-offset", {"G55", "X9.0", "machine.ini"}},
    {"far offset", far_offset, AGENT_CAUTION, "work-offset-unknown", {"G59.2", "machine.ini"}},
    {"rotary axes", rotary, AGENT_CAUTION, "work-offset-unknown", {"A, B or C", "machine.ini"}},
    {"no offset", no_offset, 0, NULL, {0}},
    {"unpublished", unpublished, AGENT_WARNING, "not-published", {"neither tool table"}},
    {"empty table", empty_table, AGENT_CAUTION, "tool-missing", {"T3", "not in the machine's"}},
    {"undescribed", undescribed, AGENT_NOTE, "not-compared", {"not compared"}},
    {"fits", fits_exactly, 0, NULL, {0}},
    {"unknown memory", unknown_memory, 0, NULL, {0}},
    {"too large", too_large, AGENT_CAUTION, "memory", {"1024 bytes", "1023", "drip = auto"}},
    {"drips", drips, AGENT_NOTE, "drip", {"larger than the machine's memory"}},
    {"long pass", pass_too_large, AGENT_CAUTION, "pass-memory", {"920 bytes", "919"}},
    {"always drips", drips_always, AGENT_NOTE, "drip", {"drip = always"}},
    {"override", overridden, AGENT_WARNING, "override", {"rapid override", "25 %"}},
};

static void compared(void)
{
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        Case c;
        case_init(&c);
        cases[i].change(&c);
        g_autoptr(GArray) findings = agent_preflight_compare(&c.flight);
        guint expected = cases[i].code ? cases[i].change == undescribed ? 2 : 1 : 0;
        if (findings->len != expected)
            g_test_message("%s: %u findings", cases[i].name, findings->len);
        g_assert_cmpuint(findings->len, ==, expected);
        if (expected > 0 && findings->len > 0) {
            const AgentFinding *finding = &g_array_index(findings, AgentFinding, 0);
            g_assert_cmpint((int)finding->level, ==, (int)cases[i].level);
            g_assert_cmpstr(finding->code, ==, cases[i].code);
            for (int w = 0; w < 3 && cases[i].words[w]; w++)
                if (!strstr(finding->message, cases[i].words[w]))
                    g_assert_cmpstr(finding->message, ==, cases[i].words[w]);
        }
        g_bytes_unref(c.program.bytes);
    }
}

/* Cautions block until they are accepted; nothing else does. */
static void blocks(void)
{
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        Case c;
        case_init(&c);
        cases[i].change(&c);
        g_autoptr(GArray) findings = agent_preflight_compare(&c.flight);
        g_autoptr(GError) error = NULL;
        bool is_caution = cases[i].code && cases[i].level == AGENT_CAUTION;
        g_assert_cmpint(agent_preflight_allows(findings, false, &error), ==, !is_caution);
        g_assert_cmpint(error != NULL, ==, is_caution);
        if (error) {
            g_assert_error(error, AGENT_ERROR, AGENT_ERROR_CAUTION);
            g_assert_cmpint((int)agent_exit_of(error), ==, AGENT_EXIT_CAUTION);
        }
        g_assert_true(agent_preflight_allows(findings, true, NULL));
        g_bytes_unref(c.program.bytes);
    }
}

static void json(void)
{
    Case c;
    case_init(&c);
    length(&c);
    offset(&c);
    g_autoptr(GArray) findings = agent_preflight_compare(&c.flight);
    g_autoptr(AgentJson) object = agent_json_new();
    agent_preflight_write(findings, object);
    g_autofree char *text = agent_json_finish(object);
    g_autoptr(JsonParser) parser = json_parser_new();
    g_assert_true(json_parser_load_from_data(parser, text, -1, NULL));
    JsonArray *array = json_object_get_array_member(
        json_node_get_object(json_parser_get_root(parser)), "preflight");
    g_assert_cmpuint(json_array_get_length(array), ==, 2);
    if (json_array_get_length(array) == 2) {
        JsonObject *second = json_array_get_object_element(array, 1);
        g_assert_cmpstr(json_object_get_string_member(second, "level"), ==, "caution");
        g_assert_cmpstr(json_object_get_string_member(second, "code"), ==, "work-offset");
    }
    g_autoptr(GError) error = NULL;
    g_assert_false(agent_preflight_allows(findings, false, &error));
    g_assert_true(error && strstr(error->message, "2 cautions"));
    g_bytes_unref(c.program.bytes);
}

static void add(void)
{
    g_test_add_func("/agent/preflight/compared", compared);
    g_test_add_func("/agent/preflight/blocks", blocks);
    g_test_add_func("/agent/preflight/json", json);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
