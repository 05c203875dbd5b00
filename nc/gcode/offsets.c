/* SPDX-License-Identifier: Apache-2.0 */
/* G10, G52 and G92: which coordinates a place has, and how long tools are [LinuxCNC 2.9, "G
 * Codes"]. Offsets are kept in parameters in mm and degrees; G91 does not count here. */
#include "nc/gcode/interpreter.h"

static bool set_data(NcExecution *x, GError **error);
static bool set_work(NcExecution *x, GError **error);
static bool set_tool(NcExecution *x, GError **error);
static void set_local(NcExecution *x, int code);

bool nc_set_offsets(NcExecution *x, GError **error)
{
    int code = x->block->by.g[NC_G_NON_MODAL];
    if (code == 100)
        return set_data(x, error);
    if (code == 520 || (code >= 920 && code <= 923))
        set_local(x, code);
    return true;
}

void nc_select_work(NcExecution *x, int wcs)
{
    NcPlace work = nc_parameters_place(x, nc_parameter_of_work(wcs));
    x->modal.wcs = wcs;
    x->modal.work_mm = work.mm;
    x->modal.work_deg = work.deg;
}

static bool set_data(NcExecution *x, GError **error)
{
    const NcWord *l = nc_word(x->block, 'L');
    if (l->value == 2.0 || l->value == 20.0)
        return set_work(x, error);
    if (l->value == 1.0 || l->value == 10.0 || l->value == 11.0)
        return set_tool(x, error);
    return nc_word_error(error, x->modal.line, l,
                         "is not supported: G10 has L1, L2, L10, L11 and L20");
}

/* Replaces the axes of `place` that the block names; where `of` is given, by what makes it have the
 * coordinates named. */
static NcPlace with_words(const NcExecution *x, NcPlace place, NcPlace *of)
{
    for (int axis = 0; axis < 6; axis++) {
        const NcWord *word = nc_word(x->block, nc_axis_letter(axis));
        if (!word)
            continue;
        const double value = word->value * (axis < 3 ? x->modal.unit_mm : 1.0);
        *nc_place_axis(&place, axis) = of ? *nc_place_axis(of, axis) - value : value;
    }
    return place;
}

/* The machine's place less the tool's length and some offsets. */
static NcPlace place_without(const NcExecution *x, SegVec3 mm, SegVec3 deg)
{
    SegVec3 tool = seg_vec3(0.0, 0.0, x->modal.tool_length_mm);
    return (NcPlace){seg_sub(seg_sub(nc_gauge_point(x), tool), mm),
                     seg_sub(x->modal.position_deg, deg)};
}

static bool set_work(NcExecution *x, GError **error)
{
    NcModal *modal = &x->modal;
    const NcWord *l = nc_word(x->block, 'L'), *p = nc_word(x->block, 'P');
    const NcWord *r = nc_word(x->block, 'R');
    if (p->value != floor(p->value) || p->value > CFG_N_WORK_OFFSETS)
        return nc_word_error(error, modal->line, p, "must be 1 to 9 for G54 to G59.3, or 0");
    if (r && (r->value != 0.0 || l->value == 20.0)) {
        return nc_word_error(error, modal->line, r,
                             "is not supported: coordinate systems are not turned");
    }
    int wcs = p->value > 0.0 ? (int)p->value - 1 : modal->wcs;
    int index = nc_parameter_of_work(wcs);
    NcPlace place = place_without(x, modal->local_mm, modal->local_deg);
    NcPlace offset = with_words(x, nc_parameters_place(x, index), l->value == 20.0 ? &place : NULL);
    nc_set_parameters_place(x, index, offset);
    if (wcs == modal->wcs) {
        modal->work_mm = offset.mm;
        modal->work_deg = offset.deg;
    }
    return true;
}

/* Z of a G10 L10 or L11: the length with which the tool would be there, in the coordinates in force
 * or in those of G59.3 without G92. */
static double length_to(const NcExecution *x, double l, double z)
{
    const NcModal *modal = &x->modal;
    if (l == 1.0)
        return z;
    if (l == 10.0)
        return nc_gauge_point(x).z - modal->work_mm.z - modal->local_mm.z - z;
    NcPlace fixture = nc_parameters_place(x, nc_parameter_of_work(CFG_N_WORK_OFFSETS - 1));
    return nc_gauge_point(x).z - fixture.mm.z - z;
}

/* Counts from the next G43 on, to the program's end; the machine's table stays as it is. */
static bool set_tool(NcExecution *x, GError **error)
{
    const NcBlock *block = x->block;
    const NcWord *p = nc_word(block, 'P'), *z = nc_word(block, 'Z'), *r = nc_word(block, 'R');
    NcToolOffset tool;
    if (p->value != floor(p->value) || !nc_find_tool(x, (int)MIN(p->value, INT32_MAX), &tool))
        return nc_no_tool(x, p, error);
    for (const char *letter = "XYABC"; *letter; letter++) {
        const NcWord *word = nc_word(block, *letter);
        if (word)
            return nc_word_error(error, x->modal.line, word,
                                 "is not supported here: a tool has a length along Z only");
    }
    if (!z && !r)
        return nc_word_error(error, x->modal.line, nc_g_word(block, NC_G_NON_MODAL),
                             "needs Z, the tool's length, or R, its radius");
    if (r && !(r->value >= 0.0))
        return nc_word_error(error, x->modal.line, r, "must not be negative");
    if (z)
        tool.length_mm = length_to(x, nc_word(block, 'L')->value, z->value * x->modal.unit_mm);
    if (r)
        tool.diameter_mm = 2.0 * r->value * x->modal.unit_mm;
    nc_parameters_set_tool(x->parameters, tool);
    return true;
}

/* G92.2 forgets the offset but not its parameters, from which G92.3 has it again. */
static void set_local(NcExecution *x, int code)
{
    NcModal *modal = &x->modal;
    NcPlace place = place_without(x, modal->work_mm, modal->work_deg);
    NcPlace local = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    if (code == 520 || code == 920)
        local = with_words(x, (NcPlace){modal->local_mm, modal->local_deg},
                           code == 920 ? &place : NULL);
    else if (code == 923)
        local = nc_parameters_place(x, NC_PARAMETER_LOCAL);
    modal->local_mm = local.mm;
    modal->local_deg = local.deg;
    nc_set_parameter(x, NC_PARAMETER_LOCAL - 1, code == 921 || code == 922 ? 0.0 : 1.0);
    if (code != 922)
        nc_set_parameters_place(x, NC_PARAMETER_LOCAL, local);
}
