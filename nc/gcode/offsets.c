/* SPDX-License-Identifier: Apache-2.0 */
/* G10 L2 and L20, G52 and G92: which coordinates a place has [LinuxCNC 2.9, "G Codes"]. Offsets are
 * kept in parameters in mm; G91 does not count here. */
#include "nc/gcode/interpreter.h"

static bool set_work(NcExecution *x, GError **error);
static void set_local(NcExecution *x, int code);

bool nc_set_offsets(NcExecution *x, GError **error)
{
    int code = x->block->g[NC_G_NON_MODAL];
    if (code == 100)
        return set_work(x, error);
    if (code == 520 || (code >= 920 && code <= 923))
        set_local(x, code);
    return true;
}

/* Replaces the axes of `point` that the block names; where `place` is given, by what makes it have
 * the coordinates named. */
static SegVec3 with_words(const NcExecution *x, SegVec3 point, const SegVec3 *place)
{
    for (int axis = 0; axis < 3; axis++) {
        const NcWord *word = nc_word(x->block, (char)('X' + axis));
        double value = word ? word->value * x->modal.unit_mm : 0.0;
        if (word)
            *nc_axis(&point, axis) = place ? nc_axis_value(*place, axis) - value : value;
    }
    return point;
}

static SegVec3 tool_offset(const NcExecution *x)
{
    return seg_vec3(0.0, 0.0, x->modal.tool_length_mm);
}

static bool set_work(NcExecution *x, GError **error)
{
    NcModal *modal = &x->modal;
    const NcWord *l = nc_word(x->block, 'L'), *p = nc_word(x->block, 'P');
    const NcWord *r = nc_word(x->block, 'R');
    if (l->value != 2.0 && l->value != 20.0) {
        return nc_word_error(error, modal->line, l,
                             "is not supported: G10 sets coordinate systems, L2 or L20");
    }
    if (p->value != floor(p->value) || p->value > (double)G_N_ELEMENTS(x->machine->work_offset_mm))
        return nc_word_error(error, modal->line, p, "must be 1 to 6 for G54 to G59, or 0");
    if (r && r->value != 0.0) {
        return nc_word_error(error, modal->line, r,
                             "is not supported: coordinate systems are not turned");
    }
    int wcs = p->value > 0.0 ? (int)p->value - 1 : modal->wcs;
    int index = nc_parameter_of_work(wcs);
    SegVec3 place = seg_sub(seg_sub(modal->position, tool_offset(x)), modal->local_mm);
    SegVec3 offset = with_words(x, nc_parameters_point(x, index), l->value == 20.0 ? &place : NULL);
    nc_set_parameters_point(x, index, offset);
    if (wcs == modal->wcs)
        modal->work_mm = offset;
    return true;
}

/* G92.2 forgets the offset but not its parameters, from which G92.3 has it again. */
static void set_local(NcExecution *x, int code)
{
    NcModal *modal = &x->modal;
    SegVec3 none = seg_vec3(0.0, 0.0, 0.0);
    SegVec3 place = seg_sub(seg_sub(modal->position, tool_offset(x)), modal->work_mm);
    if (code == 520 || code == 920)
        modal->local_mm = with_words(x, modal->local_mm, code == 920 ? &place : NULL);
    else if (code == 923)
        modal->local_mm = nc_parameters_point(x, NC_PARAMETER_LOCAL);
    else
        modal->local_mm = none;
    nc_set_parameter(x, NC_PARAMETER_LOCAL - 1, code == 921 || code == 922 ? 0.0 : 1.0);
    if (code != 922)
        nc_set_parameters_point(x, NC_PARAMETER_LOCAL, modal->local_mm);
}
