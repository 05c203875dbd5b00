/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Parameters: numbered ones from #1 to #5601 and named ones [LinuxCNC 2.9, "Parameters"].
 *
 * #1 to #30 and names without a leading "_" belong to the subroutine that runs; the rest is the
 * program's. Offsets in parameters are in millimetres and degrees, as the machine file's.
 *
 * What a structure of O words changes can be taken back: numbered parameters are noted when they
 * change first, the others, which are few, are copied when it begins.
 */
#ifndef NC_GCODE_PARAMETERS_H
#define NC_GCODE_PARAMETERS_H

#include <glib.h>
#include <stdbool.h>

enum { NC_LAST_PARAMETER = 5601, NC_N_LOCAL_PARAMETERS = 30 };

/* Where the machine's own numbers are kept. */
enum {
    NC_PARAMETER_PROBED = 5061, /* where the probe touched; 5070: whether */
    NC_PARAMETER_TOUCHED = 5070,
    NC_PARAMETER_HOME = 5161,      /* G28 */
    NC_PARAMETER_HOME_2 = 5181,    /* G30 */
    NC_PARAMETER_LOCAL = 5211,     /* G52, G92; 5210: 1 where it counts */
    NC_PARAMETER_WORK = 5220,      /* 1: G54 … 9: G59.3; 5221, 5241, …: the offsets */
    NC_PARAMETER_WORK_STEP = 20,   /* from one coordinate system to the next */
    NC_PARAMETER_READ_ONLY = 5400, /* tool, and from 5420 the position, up to 5428 */
    NC_PARAMETER_POSITION = 5420,
    NC_PARAMETER_LAST_READ_ONLY = 5428,
};

/* A numbered parameter, or a name's id. */
typedef struct {
    bool named, global;
    int index;
} NcParameter;

typedef struct {
    double saved[NC_N_LOCAL_PARAMETERS]; /* the caller's */
    GArray *locals;                      /* double by id; NAN: not set */
} NcFrame;

/* What G10 L1 and the like say of a tool, instead of the tool table. */
typedef struct {
    int number;
    double length_mm, diameter_mm;
} NcToolOffset;

typedef struct {
    double numbered[NC_LAST_PARAMETER + 1];
    GHashTable *ids; /* of names, upper case and without spaces */
    GPtrArray *names;
    GArray *globals;   /* double by id; NAN: not set */
    GPtrArray *frames; /* NcFrame; the program's own is the first */
    GArray *tools;     /* NcToolOffset */
    struct NcUndo *undo;
} NcParameters;

NcParameters *nc_parameters_new(void);
void nc_parameters_free(NcParameters *parameters);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(NcParameters, nc_parameters_free)

/* From the first on, changes can be taken back by the second; both outside of subroutines. */
void nc_parameters_begin(NcParameters *parameters);
void nc_parameters_take_back(NcParameters *parameters);

/* NULL where nothing was said of the tool. */
const NcToolOffset *nc_parameters_tool(const NcParameters *parameters, int number);
void nc_parameters_set_tool(NcParameters *parameters, NcToolOffset tool);

/* The first of the coordinate system's: 0 is G54. */
static inline int nc_parameter_of_work(int wcs)
{
    return NC_PARAMETER_WORK + 1 + NC_PARAMETER_WORK_STEP * wcs;
}

/* The id is kept for good, set or not. */
NcParameter nc_parameter_named(NcParameters *parameters, const char *name);
const char *nc_parameter_name(const NcParameters *parameters, NcParameter parameter);

/* NAN where a named one was never set. */
double nc_parameter_get(const NcParameters *parameters, NcParameter parameter);
void nc_parameter_set(NcParameters *parameters, NcParameter parameter, double value);

/* A subroutine begins, with #1 to #30, and ends. */
void nc_parameters_enter(NcParameters *parameters, const double *arguments);
void nc_parameters_leave(NcParameters *parameters);

#endif
