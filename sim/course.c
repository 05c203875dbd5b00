/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/course.h"

struct SimCourse {
    GArray *stretches;
};

static void stretch_clear(void *stretch)
{
    sim_program_unref(((SimStretch *)stretch)->program);
}

GArray *sim_stretches_new(void)
{
    GArray *stretches = g_array_new(FALSE, FALSE, sizeof(SimStretch));
    g_array_set_clear_func(stretches, stretch_clear);
    return stretches;
}

SimCourse *sim_course_new(void)
{
    SimCourse *course = g_new(SimCourse, 1);
    course->stretches = sim_stretches_new();
    return course;
}

void sim_course_free(SimCourse *course)
{
    if (!course)
        return;
    g_array_unref(course->stretches);
    g_free(course);
}

void sim_course_add(SimCourse *course, SimProgram *program, size_t move, double part)
{
    if (!course)
        return;
    GArray *all = course->stretches;
    SimStretch *last = all->len > 0 ? &g_array_index(all, SimStretch, all->len - 1) : NULL;
    if (last && last->program == program && last->end == move && last->part == 1) {
        last->end++;
        last->part = part;
        return;
    }
    const SimStretch stretch = {sim_program_ref(program), move, move + 1, part};
    g_array_append_val(all, stretch);
}

GArray *sim_course_take(SimCourse *course)
{
    GArray *taken = course->stretches;
    course->stretches = sim_stretches_new();
    return taken;
}
