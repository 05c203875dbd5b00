/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/log.h"

#include <errno.h>
#include <glib/gstdio.h>
#include <stdio.h>

struct SimLog {
    char *path;
    FILE *file;
    int error; /* errno of the first failure */
    GString *line;
    GQueue held; /* GString, a hold each: what waits for its release */
};

static const char *kind_name(NcMoveKind kind);
static void append_course(GString *line, const SimBlock *block);
static void append_string(GString *line, const char *text);
static void write_line(SimLog *log, bool flush);
static void write_now(SimLog *log, const GString *text, bool flush);

SimLog *sim_log_open(const char *path, GError **error)
{
    FILE *file = g_fopen(path, "we");
    if (!file) {
        int cause = errno;
        g_set_error(error, G_FILE_ERROR, (int)g_file_error_from_errno(cause),
                    "%s: cannot begin the log: %s", path, g_strerror(cause));
        return NULL;
    }
    SimLog *log = g_new0(SimLog, 1);
    log->path = g_strdup(path);
    log->file = file;
    log->line = g_string_new(NULL);
    g_queue_init(&log->held);
    return log;
}

static void free_held(void *held)
{
    g_string_free(held, TRUE);
}

bool sim_log_close(SimLog *log, GError **error)
{
    if (fclose(log->file) != 0 && log->error == 0)
        log->error = errno;
    bool good = log->error == 0;
    if (!good)
        g_set_error(error, G_FILE_ERROR, (int)g_file_error_from_errno(log->error),
                    "%s: the log is not complete: %s", log->path, g_strerror(log->error));
    g_queue_clear_full(&log->held, free_held);
    g_string_free(log->line, TRUE);
    g_free(log->path);
    g_free(log);
    return good;
}

static void begin_program(SimLog *log, const uint8_t id[32])
{
    g_string_assign(log->line, "{\"program\":\"");
    for (int i = 0; i < 32; i++)
        g_string_append_printf(log->line, "%02x", id[i]);
}

void sim_log_program(SimLog *log, const uint8_t id[32], double planned_s)
{
    begin_program(log, id);
    g_string_append(log->line, "\",\"planned_s\":");
    cfg_number_append(log->line, planned_s);
    g_string_append_c(log->line, '}');
    write_line(log, true);
}

void sim_log_refused(SimLog *log, uint16_t code, const char *text)
{
    g_string_printf(log->line, "{\"refused\":%u,\"text\":", code);
    append_string(log->line, text);
    g_string_append_c(log->line, '}');
    write_line(log, true);
}

void sim_log_state(SimLog *log, FbState state, double time_s)
{
    g_string_printf(log->line, "{\"state\":\"%s\",\"time_s\":", fb_state_name(state));
    cfg_number_append(log->line, time_s);
    g_string_append_c(log->line, '}');
    write_line(log, true);
}

void sim_log_block(SimLog *log, const SimBlock *block)
{
    g_string_printf(log->line, "{\"line\":%u,", block->line);
    if (block->block_line != block->line)
        g_string_append_printf(log->line, "\"block_line\":%u,", block->block_line);
    g_string_append_printf(log->line, "\"kind\":\"%s\",", kind_name(block->kind));
    append_course(log->line, block);
    g_string_append(log->line, ",\"feed_mm_min\":");
    cfg_number_append(log->line, block->feed_mm_min);
    g_string_append_c(log->line, '}');
    write_line(log, false);
}

void sim_log_way(SimLog *log, const SimBlock *move)
{
    g_string_printf(log->line, "{\"way\":\"%s\",", kind_name(move->kind));
    append_course(log->line, move);
    g_string_append_printf(log->line, ",\"tool\":%d,\"spindle_rpm\":", move->tool);
    cfg_number_append(log->line, move->spindle_rpm);
    g_string_append_c(log->line, '}');
    write_line(log, false);
}

void sim_log_override(SimLog *log, NcOverride override, double time_s)
{
    g_string_printf(log->line,
                    "{\"override\":{\"feed\":%d,\"rapid\":%d,\"spindle\":%d},\"time_s\":",
                    override.feed, override.rapid, override.spindle);
    cfg_number_append(log->line, time_s);
    g_string_append_c(log->line, '}');
    write_line(log, true);
}

void sim_log_message(SimLog *log, uint32_t line, const char *text, double time_s)
{
    g_string_assign(log->line, "{\"message\":");
    append_string(log->line, text);
    g_string_append_printf(log->line, ",\"line\":%u,\"time_s\":", line);
    cfg_number_append(log->line, time_s);
    g_string_append_c(log->line, '}');
    write_line(log, true);
}

void sim_log_fault(SimLog *log, const char *spec, double time_s)
{
    g_string_assign(log->line, "{\"fault\":");
    append_string(log->line, spec);
    g_string_append(log->line, ",\"time_s\":");
    cfg_number_append(log->line, time_s);
    g_string_append_c(log->line, '}');
    write_line(log, true);
}

void sim_log_passes(SimLog *log, const uint8_t id[32], uint32_t n_passes)
{
    begin_program(log, id);
    g_string_append_printf(log->line, "\",\"passes\":%u}", n_passes);
    write_line(log, true);
}

void sim_log_hold(SimLog *log)
{
    g_queue_push_tail(&log->held, g_string_new(NULL));
}

void sim_log_release(SimLog *log)
{
    GString *held = g_queue_pop_head(&log->held);
    write_now(log, held, true);
    g_string_free(held, TRUE);
}

void sim_log_collision(SimLog *log, const NcCollision *collision)
{
    const double numbers[] = {collision->depth_mm, collision->position.x, collision->position.y,
                              collision->position.z};
    static const char *const before[] = {",\"depth_mm\":", ",\"position_mm\":[", ",", ","};
    g_string_printf(log->line, "{\"collision\":\"%s\",\"line\":%u",
                    nc_collision_name(collision->kind), collision->line);
    for (size_t i = 0; i < G_N_ELEMENTS(numbers); i++) {
        g_string_append(log->line, before[i]);
        cfg_number_append(log->line, numbers[i]);
    }
    g_string_append(log->line, "]}\n");
    write_now(log, log->line, false);
}

void sim_log_material(SimLog *log, const char *text)
{
    g_string_assign(log->line, "{\"material\":");
    append_string(log->line, text);
    g_string_append(log->line, "}\n");
    write_now(log, log->line, true);
}

/* A position, of three axes. */
static void append_axes(GString *line, const char *name, const double axes[3])
{
    for (int i = 0; i < 3; i++) {
        g_string_append(line, i == 0 ? name : ",");
        cfg_number_append(line, axes[i]);
    }
    g_string_append_c(line, ']');
}

/* From when to when, and where it ended. */
static void append_course(GString *line, const SimBlock *block)
{
    const double linear_mm[3] = {block->position_mm.x, block->position_mm.y, block->position_mm.z};
    g_string_append(line, "\"start_s\":");
    cfg_number_append(line, block->start_s);
    g_string_append(line, ",\"end_s\":");
    cfg_number_append(line, block->end_s);
    append_axes(line, ",\"position_mm\":[", linear_mm);
    if (block->turns)
        append_axes(line, ",\"position_deg\":[", block->position_deg);
}

static const char *kind_name(NcMoveKind kind)
{
    switch (kind) {
    case NC_MOVE_RAPID:
        return "rapid";
    case NC_MOVE_FEED:
        return "feed";
    case NC_MOVE_ARC:
        return "arc";
    case NC_MOVE_DWELL:
        return "dwell";
    case NC_MOVE_TOOL_CHANGE:
        return "tool-change";
    case NC_MOVE_SPINDLE:
        return "spindle";
    case NC_MOVE_COOLANT:
        return "coolant";
    case NC_MOVE_STOP:
        return "stop";
    case NC_MOVE_OPTIONAL_STOP:
        return "optional-stop";
    case NC_MOVE_END:
        return "end";
    case NC_MOVE_PROBE:
        return "probe";
    case NC_MOVE_ORIENT:
        return "orient";
    case NC_MOVE_TOOL_NUMBER:
        return "tool-number";
    case NC_MOVE_MESSAGE:
        return "message";
    }
    return "";
}

static void append_string(GString *line, const char *text)
{
    g_autofree char *valid = g_utf8_make_valid(text, -1);
    g_string_append_c(line, '"');
    for (const char *c = valid; *c; c++) {
        if (*c == '"' || *c == '\\')
            g_string_append_printf(line, "\\%c", *c);
        else if ((guchar)*c < 0x20)
            g_string_append_printf(line, "\\u%04x", (guint)*c);
        else
            g_string_append_c(line, *c);
    }
    g_string_append_c(line, '"');
}

/* State changes are flushed: whoever follows the file sees them when they happen. */
static void write_line(SimLog *log, bool flush)
{
    g_string_append_c(log->line, '\n');
    GString *held = g_queue_peek_tail(&log->held);
    if (held)
        g_string_append_len(held, log->line->str, (gssize)log->line->len);
    else
        write_now(log, log->line, flush);
}

static void write_now(SimLog *log, const GString *text, bool flush)
{
    if ((fwrite(text->str, 1, text->len, log->file) != text->len ||
         (flush && fflush(log->file) != 0)) &&
        log->error == 0)
        log->error = errno;
}
