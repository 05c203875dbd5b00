/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/program.h"

#include "agent/agent.h"

static void add_move(AgentProgram *program, GArray *regions, GArray *lines, const NcMove *move,
                     double start_s, double duration_s);
static void find_needs(AgentProgram *program, const NcMove *moves, size_t n);

GBytes *agent_program_load(const char *path, GError **error)
{
    char *text = NULL;
    size_t length = 0;
    g_autoptr(GError) cause = NULL;
    if (g_file_get_contents(path, &text, &length, &cause))
        return g_bytes_new_take(text, length);
    g_set_error_literal(error, AGENT_ERROR, AGENT_ERROR_INPUT, cause->message);
    return NULL;
}

AgentMachine *agent_machine_load(const char *machine_file, const char *tools_file, GError **error)
{
    g_autoptr(AgentMachine) loaded = g_new0(AgentMachine, 1);
    loaded->machine = cfg_machine_load(machine_file, error);
    if (!loaded->machine)
        return NULL;
    loaded->machine_file = g_strdup(machine_file);
    loaded->tools_file = g_strdup(tools_file ? tools_file : loaded->machine->tools_file);
    loaded->tools = cfg_tools_load(loaded->tools_file, error);
    return loaded->tools ? g_steal_pointer(&loaded) : NULL;
}

void agent_machine_free(AgentMachine *machine)
{
    if (!machine)
        return;
    g_clear_pointer(&machine->tools, cfg_tools_free);
    g_clear_pointer(&machine->machine, cfg_machine_free);
    g_free(machine->machine_file);
    g_free(machine->tools_file);
    g_free(machine);
}

AgentProgram *agent_program_read(GBytes *bytes, const char *name, const CfgMachine *machine,
                                 const CfgToolTable *tools, GError **error)
{
    size_t length;
    const char *text = g_bytes_get_data(bytes, &length);
    g_autoptr(GArray) moves = nc_read_program(text, length, machine, tools, error);
    if (!moves) {
        g_prefix_error(error, "%s: ", name);
        return NULL;
    }
    const NcMove *move = (const NcMove *)(void *)moves->data;
    g_autoptr(NcMotion) motion = nc_motion_new(machine, NC_NO_OVERRIDE, 0, move, moves->len);
    AgentProgram *program = g_new0(AgentProgram, 1);
    GArray *regions = g_array_new(false, false, sizeof(AgentProgramRegion));
    GArray *lines = g_array_new(false, false, sizeof(AgentProgramLine));
    for (guint i = 0; i < moves->len; i++)
        add_move(program, regions, lines, &move[i], nc_motion_start_s(motion, i),
                 nc_motion_duration_s(motion, i));
    find_needs(program, move, moves->len);
    program->regions = g_array_steal(regions, &program->n_regions);
    program->lines = g_array_steal(lines, &program->n_lines);
    g_array_unref(regions);
    g_array_unref(lines);
    return program;
}

void agent_program_free(AgentProgram *program)
{
    if (!program)
        return;
    g_free(program->regions);
    g_free(program->lines);
    g_free(program->tools);
    g_free(program);
}

/* Index of the region, added where it is new. */
static size_t region_index(GArray *regions, int32_t id)
{
    for (guint i = regions->len; i > 0; i--)
        if (g_array_index(regions, AgentProgramRegion, i - 1).id == id)
            return i - 1;
    AgentProgramRegion region = {.id = id};
    g_array_append_val(regions, region);
    return regions->len - 1;
}

static void add_move(AgentProgram *program, GArray *regions, GArray *lines, const NcMove *move,
                     double start_s, double duration_s)
{
    size_t region = region_index(regions, move->region);
    g_array_index(regions, AgentProgramRegion, region).planned_s += duration_s;
    program->total_s = start_s + duration_s;
    if (move->kind == NC_MOVE_FEED || move->kind == NC_MOVE_ARC)
        program->length_mm += nc_move_length_mm(move);
    if (move->kind == NC_MOVE_RAPID)
        program->air_mm += nc_move_length_mm(move);
    program->tool_changes += move->kind == NC_MOVE_TOOL_CHANGE;
    if (lines->len > 0 && g_array_index(lines, AgentProgramLine, lines->len - 1).line == move->line)
        return;
    AgentProgramLine line = {move->line, start_s, region};
    g_array_append_val(lines, line);
}

const char *agent_work_offset_name(unsigned number)
{
    static const char *const names[] = {"G54", "G55",   "G56",   "G57",  "G58",
                                        "G59", "G59.1", "G59.2", "G59.3"};
    return number - 54 < G_N_ELEMENTS(names) ? names[number - 54] : "G5x";
}

static int by_number(const void *a, const void *b)
{
    int x = *(const int *)a, y = *(const int *)b;
    return (x > y) - (x < y);
}

static void find_needs(AgentProgram *program, const NcMove *moves, size_t n)
{
    GArray *tools = g_array_new(false, false, sizeof(int));
    for (size_t i = 0; i < n; i++) {
        const NcMove *move = &moves[i];
        bool travels = move->kind <= NC_MOVE_ARC || move->kind == NC_MOVE_PROBE;
        if (travels && !move->machine_coordinates) {
            program->work_offsets |= 1u << (move->work_offset - 54);
            for (int axis = 0; axis < 3; axis++)
                program->rotary = program->rotary || move->from_deg[axis] != move->to_deg[axis];
        }
        bool known = move->tool == 0 || (i > 0 && move->tool == moves[i - 1].tool);
        for (guint t = 0; !known && t < tools->len; t++)
            known = g_array_index(tools, int, t) == move->tool;
        if (!known)
            g_array_append_val(tools, move->tool);
    }
    g_array_sort(tools, by_number);
    program->tools = g_array_steal(tools, &program->n_tools);
    g_array_unref(tools);
}

size_t agent_program_line(const AgentProgram *program, uint32_t line)
{
    size_t low = 0, high = program->n_lines;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (program->lines[middle].line <= line)
            low = middle + 1;
        else
            high = middle;
    }
    return low > 0 ? low - 1 : program->n_lines;
}
