/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The panel's lines on a GPIO chip, by libgpiod 1.6, which nobody else includes. Levels are
 * logical: "pressed" and "lit", whatever the wiring. Edges carry the kernel's time, the clock of
 * g_get_monotonic_time.
 */
#ifndef AGENT_PANEL_GPIO_H
#define AGENT_PANEL_GPIO_H

#include "agent/panel/panel.h"

typedef struct AgentGpio AgentGpio;

typedef struct {
    AgentKey key;
    bool pressed;
    int64_t at_us;
} AgentGpioEdge;

/* Takes the three lines; the lamp is dark. Errors: AGENT_ERROR_INPUT, with chip, line and what to
 * do. */
AgentGpio *agent_gpio_open(const CfgPanel *panel, GError **error);

/* Puts the lamp out and gives the lines back. */
void agent_gpio_close(AgentGpio *gpio);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(AgentGpio, agent_gpio_close)

/* Readable when there are edges; closed with `gpio`. */
int agent_gpio_fd(const AgentGpio *gpio, AgentKey key);

/* The levels of now, which later edges are against. Error: the chip is gone. */
bool agent_gpio_levels(AgentGpio *gpio, bool pressed[AGENT_N_KEYS], GError **error);

/* Appends what has happened since, in the order of time, to `edges` (of AgentGpioEdge); does not
 * wait. The kernel's queue is short: where edges were lost, one of now leads to the level of now.
 * Call it now and then even if nothing is readable: a chip that is gone may show itself only here.
 */
bool agent_gpio_read(AgentGpio *gpio, GArray *edges, GError **error);

bool agent_gpio_light(AgentGpio *gpio, bool lit, GError **error);

#endif
