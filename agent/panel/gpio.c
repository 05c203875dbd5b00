/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/panel/gpio.h"

#include <errno.h>
#include <gpiod.h>
#include <poll.h>
#include <stdlib.h>

#include "agent/agent.h"

#define HOUR_US G_GINT64_CONSTANT(3600000000)

struct AgentGpio {
    char *name; /* of the chip, as configured */
    struct gpiod_chip *chip;
    struct gpiod_line *keys[AGENT_N_KEYS], *lamp;
    bool pressed[AGENT_N_KEYS]; /* as told last */
    bool gone;
};

typedef struct {
    const char *use; /* "start" */
    const char *line;
    const char *consumer; /* what gpioinfo shows */
} Wanted;

static struct gpiod_line *find_line(AgentGpio *gpio, const Wanted *wanted, GError **error);
static bool refuse_line(AgentGpio *gpio, const Wanted *wanted, struct gpiod_line *line,
                        GError **error);

static bool lost(AgentGpio *gpio, const char *what, GError **error)
{
    gpio->gone = true;
    g_set_error(error, AGENT_ERROR, AGENT_ERROR_INPUT, "chip %s: %s: %s; is it still plugged in?",
                gpio->name, what, g_strerror(errno));
    return false;
}

/* ------------------------------------------------------------------------ open */

static bool take_key(AgentGpio *gpio, AgentKey key, const Wanted *wanted, const CfgPanel *panel,
                     GError **error)
{
    static const int biases[] = {
        [CFG_BIAS_AS_IS] = 0,
        [CFG_BIAS_DISABLED] = GPIOD_LINE_REQUEST_FLAG_BIAS_DISABLE,
        [CFG_BIAS_PULL_UP] = GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP,
        [CFG_BIAS_PULL_DOWN] = GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN,
    };
    const int low = panel->active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
    struct gpiod_line *line = find_line(gpio, wanted, error);
    if (!line)
        return false;
    if (gpiod_line_request_both_edges_events_flags(line, wanted->consumer,
                                                   low | biases[panel->bias]) != 0)
        return refuse_line(gpio, wanted, line, error);
    gpio->keys[key] = line;
    return true;
}

static bool take_lamp(AgentGpio *gpio, const Wanted *wanted, const CfgPanel *panel, GError **error)
{
    const int low = panel->lamp_active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
    struct gpiod_line *line = find_line(gpio, wanted, error);
    if (!line)
        return false;
    if (gpiod_line_request_output_flags(line, wanted->consumer, low, 0) != 0)
        return refuse_line(gpio, wanted, line, error);
    gpio->lamp = line;
    return true;
}

AgentGpio *agent_gpio_open(const CfgPanel *panel, GError **error)
{
    const Wanted start = {"start", panel->start, "segmill start"};
    const Wanted hold = {"hold", panel->hold, "segmill hold"};
    const Wanted lamp = {"lamp", panel->lamp, "segmill lamp"};
    g_autoptr(AgentGpio) gpio = g_new0(AgentGpio, 1);
    gpio->name = g_strdup(panel->chip);
    gpio->chip = gpiod_chip_open_lookup(panel->chip);
    if (!gpio->chip) {
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_INPUT,
                    "[panel] chip = %s: %s; `gpiodetect` lists the chips, and their devices must "
                    "be readable and writable for this user",
                    panel->chip, g_strerror(errno));
        return NULL;
    }
    if (!take_key(gpio, AGENT_KEY_START, &start, panel, error) ||
        !take_key(gpio, AGENT_KEY_HOLD, &hold, panel, error) ||
        !take_lamp(gpio, &lamp, panel, error))
        return NULL;
    return g_steal_pointer(&gpio);
}

void agent_gpio_close(AgentGpio *gpio)
{
    if (!gpio)
        return;
    if (gpio->lamp && !gpio->gone)
        gpiod_line_set_value(gpio->lamp, 0);
    if (gpio->chip)
        gpiod_chip_close(gpio->chip);
    g_free(gpio->name);
    g_free(gpio);
}

static struct gpiod_line *find_line(AgentGpio *gpio, const Wanted *wanted, GError **error)
{
    guint64 offset;
    const unsigned n = gpiod_chip_num_lines(gpio->chip);
    struct gpiod_line *line = NULL;
    if (!g_ascii_string_to_unsigned(wanted->line, 10, 0, UINT32_MAX, &offset, NULL))
        line = gpiod_chip_find_line(gpio->chip, wanted->line);
    else if (offset < n)
        line = gpiod_chip_get_line(gpio->chip, (unsigned)offset);
    if (!line)
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_INPUT,
                    "[panel] %s = %s: chip %s has no such line among its %u; `gpioinfo %s` lists "
                    "names and offsets",
                    wanted->use, wanted->line, gpio->name, n, gpiod_chip_name(gpio->chip));
    return line;
}

static bool refuse_line(AgentGpio *gpio, const Wanted *wanted, struct gpiod_line *line,
                        GError **error)
{
    const int cause = errno;
    const char *owner = gpiod_line_update(line) == 0 ? gpiod_line_consumer(line) : NULL;
    if (cause == EBUSY)
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_INPUT,
                    "[panel] %s = %s: chip %s: the line is taken by '%s': free it, or name another",
                    wanted->use, wanted->line, gpio->name, owner ? owner : "the kernel");
    else
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_INPUT,
                    "[panel] %s = %s: chip %s: %s; can the line be used that way? `gpioinfo %s` "
                    "shows it",
                    wanted->use, wanted->line, gpio->name, g_strerror(cause),
                    gpiod_chip_name(gpio->chip));
    return false;
}

/* ----------------------------------------------------------------------- edges */

int agent_gpio_fd(const AgentGpio *gpio, AgentKey key)
{
    return gpiod_line_event_get_fd(gpio->keys[key]);
}

bool agent_gpio_levels(AgentGpio *gpio, bool pressed[AGENT_N_KEYS], GError **error)
{
    for (size_t i = 0; i < AGENT_N_KEYS; i++) {
        const int level = gpiod_line_get_value(gpio->keys[i]);
        if (level < 0)
            return lost(gpio, "reading a button", error);
        pressed[i] = gpio->pressed[i] = level > 0;
    }
    return true;
}

/* Kernels before 5.7 take another clock: then it happened now. */
static int64_t time_us(const struct gpiod_line_event *event, int64_t now_us)
{
    const int64_t at_us = (int64_t)event->ts.tv_sec * G_USEC_PER_SEC + event->ts.tv_nsec / 1000;
    return at_us > now_us || at_us < now_us - HOUR_US ? now_us : at_us;
}

/* Behind those that happened before it. */
static void insert(GArray *edges, const AgentGpioEdge *edge)
{
    guint at = edges->len;
    while (at > 0 && g_array_index(edges, AgentGpioEdge, at - 1).at_us > edge->at_us)
        at--;
    g_array_insert_vals(edges, at, edge, 1);
}

/* 1: an edge was there; 0: none; -1: error. */
static int read_edge(struct gpiod_line *line, struct gpiod_line_event *event)
{
    struct pollfd there = {.fd = gpiod_line_event_get_fd(line), .events = POLLIN};
    const int n = poll(&there, 1, 0);
    if (n <= 0)
        return n < 0 && errno == EINTR ? 0 : n;
    return gpiod_line_event_read(line, event) == 0 ? 1 : -1;
}

static bool read_key(AgentGpio *gpio, AgentKey key, GArray *edges, GError **error)
{
    struct gpiod_line_event event;
    int there;
    while ((there = read_edge(gpio->keys[key], &event)) > 0) {
        gpio->pressed[key] = event.event_type == GPIOD_LINE_EVENT_RISING_EDGE;
        insert(edges,
               &(AgentGpioEdge){key, gpio->pressed[key], time_us(&event, g_get_monotonic_time())});
    }
    const int level = there < 0 ? -1 : gpiod_line_get_value(gpio->keys[key]);
    if (level < 0)
        return lost(gpio, "reading a button", error);
    if ((level > 0) != gpio->pressed[key]) {
        gpio->pressed[key] = level > 0;
        insert(edges, &(AgentGpioEdge){key, level > 0, g_get_monotonic_time()});
    }
    return true;
}

bool agent_gpio_read(AgentGpio *gpio, GArray *edges, GError **error)
{
    return read_key(gpio, AGENT_KEY_START, edges, error) &&
           read_key(gpio, AGENT_KEY_HOLD, edges, error);
}

bool agent_gpio_light(AgentGpio *gpio, bool lit, GError **error)
{
    return gpiod_line_set_value(gpio->lamp, lit) == 0 || lost(gpio, "setting the lamp", error);
}
