/* SPDX-License-Identifier: Apache-2.0 */
/* States, commands, roles and answers as docs/protocol.md has them: their names, and which is what.
 */
#include "fieldbus/fieldbus.h"

G_DEFINE_QUARK(fb_error, fb_error)

const char *fb_state_name(FbState state)
{
    static const char *const names[FB_N_STATES] = {
        [FB_STATE_OFF] = "OFF",
        [FB_STATE_IDLE] = "IDLE",
        [FB_STATE_LOADING] = "LOADING",
        [FB_STATE_VERIFYING] = "VERIFYING",
        [FB_STATE_READY] = "READY",
        [FB_STATE_RUNNING] = "RUNNING",
        [FB_STATE_HOLDING] = "HOLDING",
        [FB_STATE_HELD] = "HELD",
        [FB_STATE_PROGRAM_STOP] = "PROGRAM_STOP",
        [FB_STATE_TOOL_CHANGE] = "TOOL_CHANGE",
        [FB_STATE_ABORTING] = "ABORTING",
        [FB_STATE_COMPLETE] = "COMPLETE",
        [FB_STATE_ALARM] = "ALARM",
        [FB_STATE_ESTOP] = "ESTOP",
        [FB_STATE_UNKNOWN] = "UNKNOWN",
    };
    return (unsigned)state < FB_N_STATES ? names[state] : "reserved";
}

bool fb_state_runs(FbState state)
{
    return state >= FB_STATE_RUNNING && state <= FB_STATE_ABORTING;
}

bool fb_command_stops(FbCommand command)
{
    return command == FB_COMMAND_HOLD || command == FB_COMMAND_ABORT;
}

const char *fb_command_name(FbCommand command)
{
    static const char *const names[FB_N_COMMANDS] = {
        [FB_COMMAND_NONE] = "NONE",         [FB_COMMAND_LEASE] = "LEASE",
        [FB_COMMAND_RELEASE] = "RELEASE",   [FB_COMMAND_OPEN] = "OPEN",
        [FB_COMMAND_VERIFY] = "VERIFY",     [FB_COMMAND_START] = "START",
        [FB_COMMAND_HOLD] = "HOLD",         [FB_COMMAND_RESUME] = "RESUME",
        [FB_COMMAND_ABORT] = "ABORT",       [FB_COMMAND_ACKNOWLEDGE] = "ACKNOWLEDGE",
        [FB_COMMAND_CLOSE] = "CLOSE",       [FB_COMMAND_RESTART] = "RESTART",
        [FB_COMMAND_OVERRIDE] = "OVERRIDE", [FB_COMMAND_OPTIONAL_STOP] = "OPTIONAL_STOP",
    };
    return (unsigned)command < FB_N_COMMANDS ? names[command] : "reserved";
}

const char *fb_role_name(FbRole role)
{
    static const char *const names[] = {"none", "observer", "operator", "programmer"};
    return (unsigned)role < G_N_ELEMENTS(names) ? names[role] : "reserved";
}

bool fb_role_may(FbRole role, FbCommand command)
{
    switch (command) {
    case FB_COMMAND_OPEN:
    case FB_COMMAND_VERIFY:
    case FB_COMMAND_CLOSE:
        return role >= FB_ROLE_PROGRAMMER;
    default:
        return role >= FB_ROLE_OPERATOR;
    }
}

static const struct {
    const char *name, *advice;
} answers[FB_N_ANSWERS] = {
    [FB_ANSWER_NONE] = {"NONE", "Nothing was asked yet."},
    [FB_ANSWER_DONE] = {"DONE", "Nothing is to be done."},
    [FB_ANSWER_WRONG_STATE] = {"WRONG_STATE",
                               "The machine does not take this command in its present state."},
    [FB_ANSWER_NO_LEASE] = {"NO_LEASE", "Another agent owns the machine: wait until it releases "
                                        "the lease or the lease lapses."},
    [FB_ANSWER_WRONG_EPOCH] = {"WRONG_EPOCH", "The machine was restarted: deliver again."},
    [FB_ANSWER_WRONG_TRANSFER] = {"WRONG_TRANSFER",
                                  "The machine holds another program: deliver again."},
    [FB_ANSWER_GAP] = {"GAP", "Go on from the offset that the machine has received."},
    [FB_ANSWER_CRC] = {"CRC", "The message was damaged on its way: send it again."},
    [FB_ANSWER_CONFLICT] = {"CONFLICT", "The machine has other bytes there: deliver again."},
    [FB_ANSWER_TOO_LARGE] = {"TOO_LARGE", "The program does not fit into the machine's memory: "
                                          "split it or coarsen its tolerance."},
    [FB_ANSWER_INCOMPLETE] = {"INCOMPLETE", "Send the rest of the program first."},
    [FB_ANSWER_HASH] = {"HASH",
                        "The machine holds other bytes than were announced: deliver again."},
    [FB_ANSWER_PROGRAM] = {"PROGRAM", "The machine cannot run this program; its alarm says why."},
    [FB_ANSWER_MALFORMED] = {"MALFORMED",
                             "The machine did not understand: compare the protocol versions."},
    [FB_ANSWER_NEEDS_ACKNOWLEDGE] = {"NEEDS_ACKNOWLEDGE",
                                     "Acknowledge at the machine first, then start again."},
    [FB_ANSWER_OUT_OF_SEQUENCE] = {"OUT_OF_SEQUENCE", "An old command came late and was not done."},
    [FB_ANSWER_ROLE] = {"ROLE", "The role of this agent's certificate does not include this."},
    [FB_ANSWER_GATE] = {"GATE", "This is no gate of the program on the machine: deliver again."},
};

const char *fb_answer_name(FbAnswer answer)
{
    return (unsigned)answer < FB_N_ANSWERS ? answers[answer].name : "reserved";
}

const char *fb_answer_advice(FbAnswer answer)
{
    return (unsigned)answer < FB_N_ANSWERS
               ? answers[answer].advice
               : "The machine speaks a newer version of the protocol: update segmill.";
}
