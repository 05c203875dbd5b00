/* SPDX-License-Identifier: Apache-2.0 */
/* A program and its gates: byte offsets where the tool has come clear of the part. */
#include "nc/gcode/read.h"

#include <string.h>

/* What one block did, as far as gates are concerned. */
typedef struct {
    uint64_t end;  /* offset behind the block */
    double tip_mm; /* machine Z of the tip where the block ends */
    bool raised;   /* by G53 or G28, to a place that is clear whatever its height */
    bool moved;    /* in Z */
} BlockEnd;

typedef struct {
    GArray *ends; /* BlockEnd */
    const GArray *moves;
    double highest_mm;       /* of the tip, where Z is programmed without G53 or G28 */
    double highest_rapid_mm; /* the same by G0 */
    double tool_length_mm;   /* in force behind the last block */
} Survey;

static void survey_block(const NcInterpreter *interpreter, const NcBlock *block, size_t end,
                         guint first_move, void *data);
static void survey_structure(Survey *survey, const NcInterpreter *interpreter, uint64_t end,
                             guint first_move);
static void find_gates(const Survey *survey, uint64_t length, GArray *gates);

NcProgram *nc_program_new(GBytes *bytes, const uint64_t *gates, size_t n_gates)
{
    gsize length;
    const guchar *data = g_bytes_get_data(bytes, &length);
    NcProgram *program = g_new0(NcProgram, 1);
    g_autofree char *hash = g_compute_checksum_for_data(G_CHECKSUM_SHA256, data, length);
    memcpy(program->sha256, hash, sizeof program->sha256);
    program->bytes = g_bytes_ref(bytes);
    program->gates = g_memdup2(gates, n_gates * sizeof *gates);
    program->n_gates = n_gates;
    return program;
}

void nc_program_free(NcProgram *program)
{
    if (program) {
        g_bytes_unref(program->bytes);
        g_free(program->gates);
        g_free(program);
    }
}

NcProgram *nc_program_from_bytes(GBytes *bytes, const CfgMachine *machine,
                                 const CfgToolTable *tools, GError **error)
{
    gsize length;
    const char *text = g_bytes_get_data(bytes, &length);
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(machine, tools);
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    g_autoptr(GArray) ends = g_array_new(FALSE, FALSE, sizeof(BlockEnd));
    Survey survey = {ends, moves, -INFINITY, -INFINITY, 0.0};
    if (!nc_read_blocks(interpreter, text, length, moves, survey_block, &survey, error))
        return NULL;
    g_autoptr(GArray) gates = g_array_new(FALSE, FALSE, sizeof(uint64_t));
    find_gates(&survey, length, gates);
    return nc_program_new(bytes, (const uint64_t *)(void *)gates->data, gates->len);
}

/* While moves of a compensated contour wait for the next one, the tool is not where the program has
 * come to. */
static void end_block(Survey *survey, const NcInterpreter *interpreter, BlockEnd done)
{
    if (interpreter->x.compensation->n_waiting > 0)
        done = (BlockEnd){.end = done.end, .tip_mm = -INFINITY, .moved = true};
    g_array_append_val(survey->ends, done);
}

/* A move that has waited. */
static void survey_late(Survey *survey, const NcModal *modal, const NcMove *move)
{
    double tip_mm = move->to.z - modal->tool_length_mm;
    survey->highest_mm = fmax(survey->highest_mm, tip_mm);
    if (move->kind == NC_MOVE_RAPID)
        survey->highest_rapid_mm = fmax(survey->highest_rapid_mm, tip_mm);
}

static void survey_block(const NcInterpreter *interpreter, const NcBlock *block, size_t end,
                         guint first_move, void *data)
{
    Survey *survey = data;
    const NcModal *modal = &interpreter->x.modal;
    if (!block) {
        survey_structure(survey, interpreter, end, first_move);
        return;
    }
    bool homing = block->by.g[NC_G_NON_MODAL] == 280 || block->by.g[NC_G_NON_MODAL] == 300;
    bool machine_z = homing || block->by.g[NC_G_NON_MODAL] == 530;
    BlockEnd done = {.end = end, .tip_mm = modal->position.z - modal->tool_length_mm};
    survey->tool_length_mm = modal->tool_length_mm;
    for (guint i = first_move; i < survey->moves->len; i++) {
        const NcMove *move = &g_array_index(survey->moves, NcMove, i);
        if (!nc_move_travels(move))
            continue;
        if (move->line != modal->line) {
            survey_late(survey, modal, move);
            done.moved = true;
            continue;
        }
        bool whole = homing && !(block->by.letters & NC_AXES);
        bool names_z = nc_word(block, 'Z') || whole;
        done.moved = done.moved || names_z || move->to.z != move->from.z;
        done.raised = machine_z && names_z && move->to.z >= move->from.z;
        if (names_z && !machine_z) {
            survey->highest_mm = fmax(survey->highest_mm, done.tip_mm);
            if (move->kind == NC_MOVE_RAPID)
                survey->highest_rapid_mm = fmax(survey->highest_rapid_mm, done.tip_mm);
        }
    }
    end_block(survey, interpreter, done);
}

/* Blocks of loops and subroutines: a tool that changes in them leaves heights that cannot be
 * compared, so then there is no highest one. */
static void survey_structure(Survey *survey, const NcInterpreter *interpreter, uint64_t end,
                             guint first_move)
{
    const NcModal *modal = &interpreter->x.modal;
    BlockEnd done = {.end = end, .tip_mm = modal->position.z - modal->tool_length_mm};
    bool same_tool = modal->tool_length_mm == survey->tool_length_mm;
    for (guint i = first_move; i < survey->moves->len; i++) {
        const NcMove *move = &g_array_index(survey->moves, NcMove, i);
        double tip_mm = move->to.z - modal->tool_length_mm;
        same_tool = same_tool && move->kind != NC_MOVE_TOOL_CHANGE;
        done.moved = done.moved || nc_move_travels(move);
        if (!nc_move_travels(move) || move->machine_coordinates)
            continue;
        survey->highest_mm = fmax(survey->highest_mm, same_tool ? tip_mm : INFINITY);
        if (move->kind == NC_MOVE_RAPID)
            survey->highest_rapid_mm = fmax(survey->highest_rapid_mm, tip_mm);
    }
    survey->tool_length_mm = modal->tool_length_mm;
    end_block(survey, interpreter, done);
}

/* A gate opens where a stretch of clear blocks begins; the last one is the program's length. A
 * height that is only reached by feed may be the work's. */
static void find_gates(const Survey *survey, uint64_t length, GArray *gates)
{
    bool clear = false;
    bool by_rapid = isfinite(survey->highest_mm) && survey->highest_rapid_mm >= survey->highest_mm;
    double height = by_rapid ? survey->highest_mm : INFINITY;
    for (guint i = 0; i < survey->ends->len; i++) {
        const BlockEnd *block = &g_array_index(survey->ends, BlockEnd, i);
        bool was_clear = clear;
        if (block->moved)
            clear = block->raised || block->tip_mm >= height - 1e-6;
        if (clear && !was_clear && block->end < length)
            g_array_append_val(gates, block->end);
    }
    g_array_append_val(gates, length);
}
