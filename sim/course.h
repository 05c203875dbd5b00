/* SPDX-License-Identifier: Apache-2.0 */
/* What a machine has moved through: for who asks what became of the material. */
#ifndef SIM_COURSE_H
#define SIM_COURSE_H

#include "sim/program.h"

/* The moves [first, end) of a program, executed in this order. */
typedef struct {
    SimProgram *program;
    size_t first, end;
    double part; /* of the last of them, from its start: below 1 it was broken off there */
} SimStretch;

/* GArray of SimStretch that owns a reference on each program; g_array_unref. */
GArray *sim_stretches_new(void);

typedef struct SimCourse SimCourse;

SimCourse *sim_course_new(void);
void sim_course_free(SimCourse *course);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SimCourse, sim_course_free)

/* A move of `program` (which is referenced) has been executed, or `part` of it and no more. With
 * `course` NULL nothing is done. */
void sim_course_add(SimCourse *course, SimProgram *program, size_t move, double part);

/* Takes out all there is, as the array of sim_stretches_new. */
GArray *sim_course_take(SimCourse *course);

#endif
