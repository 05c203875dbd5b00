/* SPDX-License-Identifier: Apache-2.0 */
/* The spindle's speed over the program's clock: a ramp from one speed to another. */
#ifndef SIM_SPINDLE_H
#define SIM_SPINDLE_H

#include <math.h>

typedef struct {
    double from_rpm, to_rpm;
    double since_s;
    double rpm_per_s; /* the machine's */
} SimSpindle;

/* Nearer to the end of the ramp than this it is over: the clock is a sum, and rounds. */
#define SIM_SPINDLE_ROUNDING_S 1e-9

static inline double sim_spindle_settled_s(const SimSpindle *s)
{
    return s->since_s + fabs(s->to_rpm - s->from_rpm) / s->rpm_per_s;
}

static inline double sim_spindle_rpm(const SimSpindle *s, double time_s)
{
    if (time_s >= sim_spindle_settled_s(s) - SIM_SPINDLE_ROUNDING_S)
        return s->to_rpm;
    const double gained = s->rpm_per_s * fmax(0, time_s - s->since_s);
    return s->to_rpm > s->from_rpm ? s->from_rpm + gained : s->from_rpm - gained;
}

static inline void sim_spindle_turn(SimSpindle *s, double rpm, double time_s)
{
    if (rpm == s->to_rpm)
        return;
    s->from_rpm = sim_spindle_rpm(s, time_s);
    s->to_rpm = rpm;
    s->since_s = time_s;
}

/* Off, at rest, and the clock begins again. */
static inline void sim_spindle_stop(SimSpindle *s)
{
    s->from_rpm = s->to_rpm = s->since_s = 0;
}

#endif
