/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Every frame on CAN of a delivery and its run × every fault, one fault a case, with processes of
 * their own for the machine and the agent and a bridge between their interfaces.
 *
 * After a fault of the bus alone the agent ends well, by itself. Where it cannot (the machine was
 * rebooted, the agent was killed) a person looks at the machine and goes on where that is right:
 * tries again where nothing was started, lets the machine go on where it holds. In every case the
 * bytes on the machine are the program, and the lines executed are the program's, each once; or,
 * over a reboot, the first of them, each once, and the agent says that it does not know more.
 *
 * usage: CELL NAME AGENT_INTERFACE MACHINE_INTERFACE FOLDER INSIDE ALL [hold]
 * Of the consecutive frames inside a message every INSIDE-th one is taken, of all those that are
 * left every ALL-th, others for each fault; 1: each. `hold`: the run is held and resumed, and the
 * frames are those from the STOP on.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/kernel/can_bridge.h"
#include "tests/kernel/can_cell.h"

enum {
    PATIENCE_S = 120,
    QUIET_MS = 1800,
    LOOK_MS = 400,
    LOOK_TURNS = 100,
    ROUNDS = 8,
    STOP_ID = 0x100,
    BEAT_ID = 0x110,
    CONSECUTIVE = 2, /* ISO-TP's kinds of frame */
    FLOW_CONTROL = 3,
    FLOW_CONTROL_BITS = 24,
    SPREAD = 7,
};

typedef enum { ONCE, HELPED, STOPPED, ABSENT, WRONG, N_ENDS } End;

static const char *const end_names[N_ENDS] = {"once, without help", "once, a person went on",
                                              "stopped, the rest UNKNOWN", "the frame did not come",
                                              "WRONG"};

typedef struct {
    Cell cell;
    Bridge *bridge;
    CellTask task;
    GBytes *whole; /* what a run without a fault executes; NULL: not known yet */
    BridgeFault fault;
    bool quiet; /* nobody moved in time */
    /* How the first agent ended. */
    bool first_ended;
    int first_code;
    char first_why[CELL_WHY_BYTES];
} Case;

/* ------------------------------------------------------------------------------- case */

static void kill_agent(void *data)
{
    cell_kill_agent(&((Case *)data)->cell);
}

static void cut_power(void *data)
{
    cell_cut(&((Case *)data)->cell);
}

static void boot(void *data)
{
    cell_boot(&((Case *)data)->cell);
}

static void start_agent(Case *c, CellTask task)
{
    bridge_revive(c->bridge);
    cell_agent(&c->cell, task);
}

static bool moves(FbState state)
{
    return state == FB_STATE_RUNNING || state == FB_STATE_HOLDING || state == FB_STATE_ABORTING ||
           state == FB_STATE_VERIFYING;
}

/* Until the agent has ended and the machine stands, and whatever is late has come. */
static bool settle(Case *c)
{
    const int64_t end_us = bridge_now_us() + (int64_t)PATIENCE_S * 1000000;
    int64_t now_us = 0, still_us = 0;
    for (unsigned turn = 1; now_us < end_us; turn++) {
        if (!bridge_turn(c->bridge, c->cell.news, LOOK_MS) && turn % LOOK_TURNS != 0)
            continue;
        cell_look(&c->cell);
        now_us = bridge_now_us();
        if (c->cell.seen->at_work || moves(c->cell.seen->state))
            still_us = 0;
        else if (still_us == 0)
            still_us = now_us;
        else if (now_us - still_us >= QUIET_MS * 1000)
            return true;
    }
    return false;
}

static bool is_whole(const Case *c)
{
    const CellSeen *s = c->cell.seen;
    return s->completed == 1 && s->n_executed > 0 &&
           (!c->whole || s->n_executed == g_bytes_get_size(c->whole));
}

/* What is right to do now; false: nothing. */
static bool go_on(Case *c)
{
    const CellSeen *s = c->cell.seen;
    const bool told = s->ended && s->code == -1;
    if (is_whole(c) || (s->starts > 0 && s->run == 0))
        return false;
    if (s->state != FB_STATE_HELD && (told || s->run > 0))
        return false;
    cell_button(&c->cell);
    start_agent(c, s->state == FB_STATE_HELD ? CELL_RESUME : CELL_SEND);
    return true;
}

static void run_case(Case *c, BridgeFault fault, unsigned at, unsigned bit)
{
    CellSeen *s = c->cell.seen;
    c->fault = fault;
    bridge_reset(c->bridge, BRIDGE_NO_FAULT, 0, 0); /* ends what the last case left */
    cell_begin(&c->cell);
    bridge_reset(c->bridge, fault, at, bit);
    cell_button(&c->cell);
    start_agent(c, c->task);
    c->quiet = settle(c);
    c->first_ended = s->ended;
    c->first_code = s->code;
    g_strlcpy(c->first_why, s->why, sizeof c->first_why);
    for (int i = 0; i < ROUNDS && c->quiet && go_on(c); i++)
        c->quiet = settle(c);
}

/* Why not; NULL: it ended as it may. */
static const char *why_wrong(const Case *c, End *end)
{
    const CellSeen *s = c->cell.seen;
    gsize n = s->n_executed;
    const char *text = c->whole ? g_bytes_get_data(c->whole, &n) : s->executed;
    const bool person = c->fault == BRIDGE_KILLED || c->fault == BRIDGE_REBOOTED;
    const bool first_well = c->first_ended && c->first_code == -1;
    if (!c->quiet)
        return "no end";
    if (s->starts > 1)
        return "started twice";
    if (s->n_executed > n || memcmp(s->executed, text, s->n_executed) != 0 ||
        (s->n_executed > 0 && s->executed[s->n_executed - 1] != '\n'))
        return "other lines than the program's";
    *end = first_well ? ONCE : HELPED;
    if (!first_well && !person)
        return "a fault of the bus ends it";
    if (c->fault == BRIDGE_REBOOTED && s->run == 0 && s->starts == 1) {
        *end = first_well ? ONCE : STOPPED;
        if (s->lives != 2 || s->state != FB_STATE_OFF)
            return "not as after a reboot";
        if (first_well)
            return is_whole(c) ? NULL : "done is said of what was not";
        if (c->first_code != FB_ERROR_LINK_LOST || !strstr(c->first_why, "restarted"))
            return "another reason than the reboot";
        return NULL;
    }
    if (!is_whole(c))
        return "not executed whole";
    if (!s->stored || s->state != FB_STATE_COMPLETE)
        return "not COMPLETE, with the program on the machine";
    if (!person && s->held != (c->task == CELL_SEND_HOLDING))
        return "holds that nobody asked for, or none";
    if (s->ended && s->code != -1)
        return "the agent's last word";
    return NULL;
}

/* ------------------------------------------------------------------------------ sweep */

typedef struct {
    BridgeSeen *frames;
    unsigned n_frames, n_agent; /* all, and the agent's */
    unsigned first;             /* that may be chosen */
    bool *chosen;
    unsigned inside, all;  /* of these every so many */
    unsigned flow_control; /* the most depends on it: each of its bits is damaged */
    unsigned total;
    bool failed;
} Sweep;

static bool is_consecutive(const Sweep *w, unsigned i)
{
    return i < w->n_frames && w->frames[i].first >> 4 == CONSECUTIVE;
}

/* The flow control before the longest row of consecutive frames. */
static unsigned find_flow_control(const Sweep *w)
{
    unsigned found = 0, longest = 0;
    for (unsigned i = w->first; i < w->n_frames; i++) {
        unsigned row = 0;
        while (is_consecutive(w, i + 1 + row))
            row++;
        if (w->frames[i].first >> 4 == FLOW_CONTROL && row > longest) {
            longest = row;
            found = i;
        }
    }
    return found;
}

/* From the first STOP on, where there is one. */
static unsigned find_first(const Sweep *w)
{
    for (unsigned i = 0; i < w->n_frames; i++)
        if (w->frames[i].id == STOP_ID)
            return i;
    return 0;
}

/* Of the consecutive frames inside a message every so many; of what is left then every so many,
 * others for each fault. */
static void choose(Sweep *w, BridgeFault fault)
{
    unsigned n_inside = 0, n_all = fault * SPREAD;
    for (unsigned i = w->first; i < w->n_frames; i++) {
        const bool is_inside = i > w->first && is_consecutive(w, i - 1) && is_consecutive(w, i) &&
                               is_consecutive(w, i + 1);
        w->chosen[i] =
            ((!is_inside || (n_inside++ + fault) % w->inside == 0) && n_all++ % w->all == 0) ||
            (i == w->flow_control && fault == BRIDGE_DAMAGED);
    }
}

static unsigned bit_of(unsigned at)
{
    return at * 2654435761u >> 8;
}

static void complain(const Case *c, const Sweep *w, unsigned at, const char *why)
{
    const CellSeen *s = c->cell.seen;
    printf("%s, frame %u (%s, %x, %02x): %s: first agent %s %d \"%s\", last %s %d \"%s\"; %s, "
           "run %u, %u lives, %u starts, %u holds, %u bytes executed\n",
           bridge_fault_name(c->fault), at,
           w->frames[at].from == BRIDGE_AGENT ? "agent" : "machine", w->frames[at].id,
           w->frames[at].first, why, c->first_ended ? "ended" : "did not end", c->first_code,
           c->first_why, s->ended ? "ended" : "did not end", s->code, s->why,
           fb_state_name(s->state), s->run, s->lives, s->starts, s->held, s->n_executed);
}

static End try_case(Case *c, const Sweep *w, BridgeFault fault, unsigned at, unsigned bit)
{
    End end = WRONG;
    run_case(c, fault, at, bit);
    const char *why = why_wrong(c, &end);
    if (why)
        complain(c, w, at, why);
    return why ? WRONG : bridge_struck(c->bridge) ? end : ABSENT;
}

static void sweep_fault(Case *c, Sweep *w, BridgeFault fault)
{
    unsigned ends[N_ENDS] = {0}, n = 0;
    choose(w, fault);
    for (unsigned at = w->first; at < w->n_frames; at++) {
        const bool bits = fault == BRIDGE_DAMAGED && at == w->flow_control;
        const unsigned times = !w->chosen[at] ? 0 : bits ? FLOW_CONTROL_BITS : 1;
        for (unsigned i = 0; i < times; i++)
            ends[try_case(c, w, fault, at, bits ? i : bit_of(at))]++;
        n += times;
    }
    printf("%s: %u cases", bridge_fault_name(fault), n);
    for (End end = 0; end < N_ENDS; end++)
        if (ends[end] > 0)
            printf(", %u %s", ends[end], end_names[end]);
    printf("\n");
    fflush(stdout);
    w->total += n;
    w->failed |= ends[WRONG] > 0 || ends[ABSENT] > n / 20;
}

static bool sweep(Case *c, const char *name, unsigned inside, unsigned all)
{
    Sweep w = {.inside = inside, .all = all};
    End end = WRONG;
    run_case(c, BRIDGE_NO_FAULT, 0, 0);
    const BridgeSeen *seen = bridge_seen(c->bridge, &w.n_frames);
    while (w.n_frames > 0 && seen[w.n_frames - 1].id == BEAT_ID)
        w.n_frames--; /* the machine, when all is over */
    w.frames = g_memdup2(seen, w.n_frames * sizeof *seen);
    w.chosen = g_new0(bool, w.n_frames);
    const char *why = why_wrong(c, &end);
    if (why || end != ONCE || w.n_frames == 0) {
        printf("without a fault: %s, %u frames, %d %s\n", why ? why : "a person had to help",
               w.n_frames, c->first_code, c->first_why);
        return false;
    }
    c->whole = g_bytes_new(c->cell.seen->executed, c->cell.seen->n_executed);
    w.first = find_first(&w);
    w.flow_control = find_flow_control(&w);
    for (unsigned i = w.first; i < w.n_frames; i++)
        w.n_agent += w.frames[i].from == BRIDGE_AGENT;
    for (BridgeFault fault = 1; fault < BRIDGE_N_FAULTS; fault++)
        sweep_fault(c, &w, fault);
    printf("%s: %u frames (%u from the agent) × %d faults; inside messages every %u., of these "
           "every %u.: %u cases; a program of %zu bytes\n",
           name, w.n_frames - w.first, w.n_agent, BRIDGE_N_FAULTS - 1, inside, all, w.total,
           c->cell.program_bytes);
    g_free(w.frames);
    g_free(w.chosen);
    return !w.failed;
}

static bool prepare(Case *c, char **words)
{
    const BridgeHands hands = {kill_agent, cut_power, boot, c};
    c->cell = (Cell){.agent_bus = words[0], .machine_bus = words[1], .folder = words[2]};
    c->bridge = bridge_new(words[0], words[1], &hands);
    return c->bridge && cell_open(&c->cell);
}

static unsigned number(const char *word)
{
    return (unsigned)MAX(atoi(word), 1);
}

int main(int argc, char **argv)
{
    static Case c;
    if (argc < 7 || argc > 8) {
        fprintf(stderr,
                "usage: %s NAME AGENT_INTERFACE MACHINE_INTERFACE FOLDER INSIDE ALL [hold]\n",
                argv[0]);
        return 2;
    }
    c.task = argc == 8 ? CELL_SEND_HOLDING : CELL_SEND;
    if (!prepare(&c, argv + 2)) {
        fprintf(stderr, "%s: no bridge from %s to %s: %s\n", argv[0], argv[2], argv[3],
                strerror(errno));
        return 1;
    }
    return sweep(&c, argv[1], number(argv[5]), number(argv[6])) ? 0 : 1;
}
