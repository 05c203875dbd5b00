/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>

#include "agent/kept.h"
#include "agent/link.h"
#include "agent/program.h"

static bool run(const AgentOptions *options, AgentJson *result, GError **error);

const AgentCommand agent_status = {
    .name = "status",
    .synopsis = "--to NAME",
    .summary = "show what a machine reports",
    .help = "Reads the machine's status once. It needs no lease and moves nothing.",
    .takes = AGENT_TAKES_TO | AGENT_TAKES_CONFIG,
    .needs = AGENT_TAKES_TO,
    .run = run,
};

static void write_program(const FbStatus *status, AgentJson *result)
{
    static const uint8_t none[32];
    char sha256[65];
    agent_kept_name(status->sha256, sha256);
    bool verified = memcmp(status->sha256, none, sizeof none) != 0;
    agent_json_string(result, "program_sha256", verified ? sha256 : NULL);
    agent_json_integer(result, "length", (int64_t)status->length);
    agent_json_integer(result, "received", (int64_t)status->received);
    agent_json_integer(result, "line", status->line);
    agent_json_integer(result, "executed_blocks", (int64_t)status->executed_blocks);
    agent_json_number(result, "program_time_s", status->program_time_ms * 1e-3);
    agent_json_integer(result, "gates", status->gates);
    agent_json_integer(result, "gate", status->gate);
    agent_json_integer(result, "stop_line", status->stop_line);
    agent_json_bool(result, "drip", status->drip);
    agent_json_bool(result, "starving", status->starving);
    agent_json_integer(result, "starved", status->starved);
    agent_json_number(result, "starved_s", status->starved_ms * 1e-3);
    agent_json_integer(result, "window", status->window);
}

static void write_switches(const FbStatus *status, AgentJson *result)
{
    agent_json_integer(result, "work_offset", status->work_offset);
    agent_json_integer(result, "feed_override_percent", status->feed_override_percent);
    agent_json_integer(result, "rapid_override_percent", status->rapid_override_percent);
    agent_json_integer(result, "spindle_override_percent", status->spindle_override_percent);
    agent_json_bool(result, "optional_stop", status->optional_stop);
}

static void write_status(const FbStatus *status, AgentJson *result)
{
    agent_json_string(result, "state", fb_state_name(status->state));
    agent_json_integer(result, "epoch", status->epoch);
    agent_json_bool(result, "leased", status->lease_owner != 0);
    agent_json_bool(result, "agent_lost", status->agent_lost);
    agent_json_bool(result, "needs_acknowledge", status->needs_acknowledge);
    write_program(status, result);
    write_switches(status, result);
    agent_json_integer(result, "tool", status->tool);
    agent_json_numbers(result, "position_mm", status->position_mm, 3);
    agent_json_number(result, "feed_mm_min", status->feed_mm_min);
    agent_json_number(result, "spindle_rpm", status->spindle_rpm);
    if (status->alarm_code == 0) {
        agent_json_string(result, "alarm", NULL);
        return;
    }
    agent_json_object(result, "alarm");
    agent_json_integer(result, "code", status->alarm_code);
    agent_json_string(result, "text", status->alarm_text);
    agent_json_string(result, "advice", status->alarm_advice);
    agent_json_end(result);
}

static void print_program(const FbStatus *status)
{
    if (status->length == 0)
        return;
    printf("program   %" G_GUINT64_FORMAT " of %" G_GUINT64_FORMAT " bytes, line %u, %.1f s\n",
           status->received, status->length, status->line, status->program_time_ms * 1e-3);
    printf("gates     %u of %u passed", status->gate, status->gates);
    if (status->stop_line > 0)
        printf(", stopped in line %u", status->stop_line);
    printf("\n");
    if (status->drip)
        printf("drip      window %u, waited %u times, %.1f s%s\n", status->window, status->starved,
               status->starved_ms * 1e-3, status->starving ? ", waits now" : "");
}

static void print_status(const FbStatus *status)
{
    printf("state     %s%s%s\n", fb_state_name(status->state),
           status->agent_lost ? ", its agent is lost" : "",
           status->needs_acknowledge ? " (wants an acknowledgement at the machine)" : "");
    print_program(status);
    printf("position  X%.3f Y%.3f Z%.3f mm, tool %d, %s\n", status->position_mm[0],
           status->position_mm[1], status->position_mm[2], status->tool,
           agent_work_offset_name(status->work_offset));
    printf("feed      %.0f mm/min, spindle %.0f rev/min\n", status->feed_mm_min,
           status->spindle_rpm);
    printf("override  feed %u %%, rapids %u %%, spindle %u %%; optional stop %s\n",
           status->feed_override_percent, status->rapid_override_percent,
           status->spindle_override_percent, status->optional_stop ? "on" : "off");
    if (status->alarm_code)
        printf("alarm     %u: %s; %s\n", status->alarm_code, status->alarm_text,
               status->alarm_advice);
}

static bool run(const AgentOptions *options, AgentJson *result, GError **error)
{
    g_autoptr(AgentLink) link = agent_link_open(options, error);
    if (!link || !agent_link_wait_status(link, error))
        return false;
    const FbStatus *status = fb_session_status(link->session);
    write_status(status, result);
    if (!options->json)
        print_status(status);
    return true;
}
