/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/preflight.h"

#include <math.h>

#include "agent/progress.h"

static void check_tools(const AgentPreflight *flight, GArray *findings);
static void check_offsets(const AgentPreflight *flight, GArray *findings);
static void check_memory(const AgentPreflight *flight, GArray *findings);
static void check_overrides(const AgentPreflight *flight, GArray *findings);

static void clear_finding(void *data)
{
    g_free(((AgentFinding *)data)->message);
}

GArray *agent_preflight_compare(const AgentPreflight *flight)
{
    GArray *findings = g_array_new(false, false, sizeof(AgentFinding));
    g_array_set_clear_func(findings, clear_finding);
    check_tools(flight, findings);
    check_offsets(flight, findings);
    check_memory(flight, findings);
    check_overrides(flight, findings);
    return findings;
}

GArray *agent_preflight(AgentLink *link, AgentPreflight *flight, GError **error)
{
    if (!agent_link_wait_status(link, error))
        return NULL;
    fb_session_read_setup(link->session);
    if (!agent_link_wait(link, FB_TASK_SETUP, error))
        return NULL;
    flight->drip = link->agent->drip;
    flight->status = fb_session_status(link->session);
    flight->setup = fb_session_setup(link->session);
    GArray *findings = agent_preflight_compare(flight);
    for (guint i = 0; i < findings->len; i++) {
        const AgentFinding *finding = &g_array_index(findings, AgentFinding, i);
        agent_progress_note("%s: %s", agent_level_name(finding->level), finding->message);
    }
    return findings;
}

bool agent_preflight_again(AgentLink *link, AgentPreflight *flight, bool accepted,
                           GArray **findings, GError **error)
{
    if (!agent_link_wait_status(link, error))
        return false;
    if (fb_session_status(link->session)->setup_serial == flight->setup->serial)
        return true;
    agent_progress_note("the machine's tools or offsets have changed: they are compared again");
    GArray *again = agent_preflight(link, flight, error);
    if (!again)
        return false;
    g_array_unref(*findings);
    *findings = again;
    return agent_preflight_allows(again, accepted, error);
}

bool agent_preflight_allows(const GArray *findings, bool accepted, GError **error)
{
    const AgentFinding *first = NULL;
    guint cautions = 0;
    for (guint i = 0; i < findings->len; i++) {
        const AgentFinding *finding = &g_array_index(findings, AgentFinding, i);
        if (finding->level == AGENT_CAUTION && cautions++ == 0)
            first = finding;
    }
    if (accepted || cautions == 0)
        return true;
    g_set_error(error, AGENT_ERROR, AGENT_ERROR_CAUTION,
                "blocked, the pre-flight has %u caution%s: %s%s; --accept-cautions goes on all the "
                "same",
                cautions, cautions == 1 ? "" : "s", first->message,
                cautions == 1 ? "" : "; and so on");
    return false;
}

void agent_preflight_write(const GArray *findings, AgentJson *json)
{
    agent_json_array(json, "preflight");
    for (guint i = 0; findings && i < findings->len; i++) {
        const AgentFinding *finding = &g_array_index(findings, AgentFinding, i);
        agent_json_object(json, NULL);
        agent_json_string(json, "level", agent_level_name(finding->level));
        agent_json_string(json, "code", finding->code);
        agent_json_string(json, "message", finding->message);
        agent_json_end(json);
    }
    agent_json_end(json);
}

const char *agent_level_name(AgentLevel level)
{
    static const char *const names[] = {"note", "tip", "warning", "caution"};
    return names[level];
}

static void add(GArray *findings, AgentLevel level, const char *code, const char *format, ...)
    G_GNUC_PRINTF(4, 5);
static void add(GArray *findings, AgentLevel level, const char *code, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    AgentFinding finding = {level, code, g_strdup_vprintf(format, args)};
    va_end(args);
    g_array_append_val(findings, finding);
}

static bool same(double a, double b)
{
    /* The wire rounds to 0.1 µm. */
    return fabs(a - b) <= AGENT_PREFLIGHT_TOLERANCE_MM + 1e-4;
}

/* Its serial counts from the first time that the machine published anything. */
static bool is_published(const AgentPreflight *flight)
{
    return flight->setup->serial != 0;
}

/* ----------------------------------------------------------------------- tools */

static const FbTool *find_tool(const FbSetup *setup, int number)
{
    for (size_t i = 0; i < setup->n_tools; i++)
        if (setup->tools[i].number == number)
            return &setup->tools[i];
    return NULL;
}

static bool same_form(const FbTool *tool, const CfgTool *planned)
{
    return tool->kind == planned->kind && same(tool->diameter_mm, planned->diameter_mm) &&
           same(tool->corner_radius_mm, planned->corner_radius_mm);
}

/* The same form under another number is worth knowing. */
static void add_missing(GArray *findings, const FbSetup *setup, const CfgTool *planned)
{
    g_autoptr(GString) others = g_string_new(NULL);
    for (size_t i = 0; i < setup->n_tools; i++)
        if (same_form(&setup->tools[i], planned))
            g_string_append_printf(others, "%s T%d", others->len ? "," : "",
                                   setup->tools[i].number);
    add(findings, AGENT_CAUTION, "tool-missing",
        "T%d (%s Ø%g mm) is not in the machine's tool table%s%s; put it there, or plan with "
        "[tools] use = … of those it has",
        planned->number, cfg_tool_kind_name(planned->kind), planned->diameter_mm,
        others->len ? ", which has that form as" : "", others->str);
}

static void compare_tool(GArray *findings, const FbTool *tool, const CfgTool *planned)
{
    const struct {
        const char *code, *what;
        double machine_mm, planned_mm;
    } lengths[] = {
        {"tool-diameter", "diameter", tool->diameter_mm, planned->diameter_mm},
        {"tool-corner-radius", "corner radius", tool->corner_radius_mm, planned->corner_radius_mm},
        {"tool-length", "length", tool->length_mm, planned->length_mm},
    };
    if (tool->kind != planned->kind)
        add(findings, AGENT_CAUTION, "tool-type",
            "T%d: type is %s on the machine, %s in the tools planned with; put the right tool in, "
            "or correct one of the tables and plan again",
            planned->number, cfg_tool_kind_name(tool->kind), cfg_tool_kind_name(planned->kind));
    for (size_t i = 0; i < G_N_ELEMENTS(lengths); i++)
        if (!same(lengths[i].machine_mm, lengths[i].planned_mm))
            add(findings, AGENT_CAUTION, lengths[i].code,
                "T%d: %s is %.4f mm on the machine, %.4f mm in the tools planned with (more than "
                "%g mm apart); measure it, correct the wrong table, and plan again",
                planned->number, lengths[i].what, lengths[i].machine_mm, lengths[i].planned_mm,
                AGENT_PREFLIGHT_TOLERANCE_MM);
}

static void check_tools(const AgentPreflight *flight, GArray *findings)
{
    const AgentProgram *needs = flight->needs;
    if (!needs) {
        add(findings, AGENT_NOTE, "not-compared",
            "tools and work offsets were not compared with the machine's: it takes a description "
            "of the machine to know which ones the program uses");
        add(findings, AGENT_TIP, "no-description",
            "name the machine's description with --machine, or as `file` in the agent's "
            "configuration: it also gives the program its gates");
        return;
    }
    if (!is_published(flight)) {
        add(findings, AGENT_WARNING, "not-published",
            "the machine publishes neither tool table nor work offsets: compare them yourself");
        return;
    }
    for (size_t i = 0; i < needs->n_tools; i++) {
        const CfgTool *planned = cfg_tools_find(flight->machine->tools, needs->tools[i]);
        const FbTool *tool = find_tool(flight->setup, needs->tools[i]);
        /* The reader has refused a tool that the description does not have. */
        g_assert(planned);
        if (tool)
            compare_tool(findings, tool, planned);
        else
            add_missing(findings, flight->setup, planned);
    }
}

/* --------------------------------------------------------------------- offsets */

static void compare_offset(const AgentPreflight *flight, GArray *findings, unsigned i)
{
    const double *machine = flight->setup->work_offset_mm[i];
    const double *planned = flight->machine->machine->work_offset_mm[i];
    if (same(machine[0], planned[0]) && same(machine[1], planned[1]) &&
        same(machine[2], planned[2]))
        return;
    add(findings, AGENT_CAUTION, "work-offset",
        "%s is X%.4f Y%.4f Z%.4f on the machine, X%.4f Y%.4f Z%.4f in %s (more than %g mm apart); "
        "correct the wrong one, and plan again",
        agent_work_offset_name(54 + i), machine[0], machine[1], machine[2], planned[0], planned[1],
        planned[2], flight->machine->machine_file, AGENT_PREFLIGHT_TOLERANCE_MM);
}

/* Machines publish X, Y and Z of G54 to G59. */
static void check_offsets(const AgentPreflight *flight, GArray *findings)
{
    if (!flight->needs || !is_published(flight))
        return;
    for (unsigned i = 0; i < CFG_N_WORK_OFFSETS; i++) {
        if (!(flight->needs->work_offsets & 1u << i))
            continue;
        if (i < G_N_ELEMENTS(flight->setup->work_offset_mm))
            compare_offset(flight, findings, i);
        else
            add(findings, AGENT_CAUTION, "work-offset-unknown",
                "moves are counted from %s, which machines do not publish: compare it with %s at "
                "the machine, or use G54 to G59",
                agent_work_offset_name(54 + i), flight->machine->machine_file);
    }
    if (flight->needs->rotary)
        add(findings, AGENT_CAUTION, "work-offset-unknown",
            "A, B or C move, and machines do not publish their work offsets: compare them with %s "
            "at the machine",
            flight->machine->machine_file);
}

/* ---------------------------------------------------------------------- memory */

static void check_memory(const AgentPreflight *flight, GArray *findings)
{
    const NcProgram *program = flight->program;
    uint64_t memory = flight->status->memory_bytes;
    uint64_t whole = fb_stored_bytes(g_bytes_get_size(program->bytes), program->n_gates);
    uint64_t pass = fb_dripped_bytes(program->gates, program->n_gates);
    bool too_large = whole > memory;
    if (memory == 0)
        return; /* the machine does not say */
    if (flight->drip == CFG_DRIP_NEVER && too_large) {
        add(findings, AGENT_CAUTION, "memory",
            "the program takes %" G_GUINT64_FORMAT " bytes with its gates and the machine has "
            "%" G_GUINT64_FORMAT "; allow [link] drip = auto in the agent's configuration, or "
            "divide the program",
            whole, memory);
        return;
    }
    if (!too_large && flight->drip != CFG_DRIP_ALWAYS)
        return;
    if (pass > memory)
        add(findings, AGENT_CAUTION, "pass-memory",
            "the program has to be fed while it runs, but its longest way between two gates takes "
            "%" G_GUINT64_FORMAT " bytes with the table of gates and the machine has "
            "%" G_GUINT64_FORMAT "; give it more gates (tool up by G0), or divide it",
            pass, memory);
    else
        add(findings, AGENT_NOTE, "drip",
            "the program is fed while it runs (%s): it waits at a gate whenever the link is too "
            "slow, and there is no restart",
            too_large ? "it is larger than the machine's memory" : "[link] drip = always");
}

/* ------------------------------------------------------------------- overrides */

static void check_overrides(const AgentPreflight *flight, GArray *findings)
{
    const FbStatus *status = flight->status;
    const struct {
        const char *name;
        uint16_t percent;
    } overrides[] = {{"feed", status->feed_override_percent},
                     {"rapid", status->rapid_override_percent},
                     {"spindle", status->spindle_override_percent}};
    for (size_t i = 0; i < G_N_ELEMENTS(overrides); i++)
        if (overrides[i].percent != 100)
            add(findings, AGENT_WARNING, "override",
                "the machine's %s override is at %u %%: `segmill override --%s 100` puts it back",
                overrides[i].name, overrides[i].percent, overrides[i].name);
}
