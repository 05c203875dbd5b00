/* SPDX-License-Identifier: Apache-2.0 */
/* G40, G41, G42, G41.1 and G42.1: what blocks say about the cutter's radius [LinuxCNC 2.9, "G
 * Codes"], and which codes have no place while it is compensated. */
#include "nc/gcode/interpreter.h"

/* LinuxCNC's, which depends on the units: radians, in inches and in millimetres. */
#define LONGER_ARC_INCH_RAD 0.001
#define LONGER_ARC_MM_RAD 0.0254

static bool turn_on(NcExecution *x, GError **error);
static bool find_radius(const NcExecution *x, double *radius_mm, GError **error);

/* The word that the block moves by. */
static bool corner_error(const NcExecution *x, const char *why, GError **error)
{
    return nc_word_error(error, x->modal.line, nc_motion_word(x->block),
                         "%s: the tool's radius is %.6g mm", why, x->compensation->radius_mm);
}

bool nc_set_compensation(NcExecution *x, GError **error)
{
    NcCompensation *c = x->compensation;
    const int code = x->block->by.g[NC_G_CUTTER];
    const bool first = x->moves->len == x->first_move;
    const char *why = NULL;
    if (code < 0)
        return true;
    if (!nc_compensate(x, error))
        return false;
    if (code == 400 && c->side != 0 && !nc_compensation_end(c, x->moves, &why))
        return corner_error(x, why, error);
    if (code > 400 && !turn_on(x, error))
        return false;
    x->uncompensated = x->moves->len;
    if (first)
        x->first_move = x->moves->len;
    return true;
}

bool nc_compensate(NcExecution *x, GError **error)
{
    NcCompensation *c = x->compensation;
    const guint first = x->uncompensated, n = x->moves->len - first;
    if (n > 0 && nc_compensation_busy(c)) {
        g_autofree NcMove *programmed =
            g_memdup2(&g_array_index(x->moves, NcMove, first), n * sizeof *programmed);
        const char *why = NULL;
        g_array_set_size(x->moves, first);
        for (guint i = 0; i < n; i++)
            if (!nc_compensation_move(c, &programmed[i], x->moves, &why))
                return corner_error(x, why, error);
    }
    if (x->modal.ended)
        nc_compensation_reset(c);
    x->uncompensated = x->moves->len;
    return true;
}

static bool turn_on(NcExecution *x, GError **error)
{
    const int code = x->block->by.g[NC_G_CUTTER];
    const int side = code / 10 == 41 ? 1 : -1;
    const double unit = x->modal.unit_mm;
    double radius_mm = 0.0;
    if (x->modal.plane == 19) {
        return nc_word_error(error, x->modal.line, nc_g_word(x->block, NC_G_CUTTER),
                             "needs the plane G17 or G18, not G19");
    }
    if (!find_radius(x, &radius_mm, error))
        return false;
    nc_compensation_begin(x->compensation, radius_mm < 0.0 ? -side : side, fabs(radius_mm),
                          unit > 1.0 ? LONGER_ARC_INCH_RAD : LONGER_ARC_MM_RAD, x->modal.plane,
                          x->modal.position);
    return true;
}

/* Of the tool in the spindle, the tool of the D word, or, with G41.1 and G42.1, half the D word. */
static bool find_radius(const NcExecution *x, double *radius_mm, GError **error)
{
    const NcWord *d = nc_word(x->block, 'D');
    if (x->block->by.g[NC_G_CUTTER] % 10 == 1) {
        *radius_mm = d ? 0.5 * d->value * x->modal.unit_mm : 0.0;
        return d || nc_word_error(error, x->modal.line, nc_g_word(x->block, NC_G_CUTTER),
                                  "needs a D word: the cutter's diameter");
    }
    if (d && (d->value < 0.0 || d->value != floor(d->value) || d->value > 99999.0)) {
        return nc_word_error(error, x->modal.line, d,
                             "must be a tool's number with G41 and G42; a diameter needs G41.1 or "
                             "G42.1");
    }
    const int number = d && d->value > 0.0 ? (int)d->value : x->modal.tool;
    NcToolOffset tool = {0, 0.0, 0.0};
    if (!nc_find_tool(x, number, &tool) && d && number > 0)
        return nc_no_tool(x, d, error);
    *radius_mm = 0.5 * tool.diameter_mm;
    return true;
}

/* ------------------------------------------------------------------ other codes */

/* Group 0: of G10, the tool table and the coordinate systems that are not in force go on. */
static const NcWord *non_modal_word(const NcExecution *x)
{
    const NcBlock *block = x->block;
    const int code = block->by.g[NC_G_NON_MODAL];
    const NcWord *l = nc_word(block, 'L'), *p = nc_word(block, 'P');
    const bool other = p && p->value > 0.0 && (int)p->value - 1 != x->modal.wcs;
    const bool table = l && l->value != 2.0 && l->value != 20.0;
    const bool goes_on = code == 40 || (code == 100 && (other || table)) ||
                         (code == 530 && x->compensation->radius_mm == 0.0);
    return goes_on ? NULL : nc_g_word(block, NC_G_NON_MODAL);
}

/* What is carried out before G40 would be. */
static const NcWord *early_word(const NcExecution *x)
{
    const NcBlock *block = x->block;
    const NcWord *tool = nc_m_word(block, NC_M_TOOL), *override = nc_m_word(block, NC_M_OVERRIDE);
    const bool same = block->by.g[NC_G_PLANE] == 10 * x->compensation->plane;
    return tool ? tool : override ? override : same ? NULL : nc_g_word(block, NC_G_PLANE);
}

static const NcWord *late_word(const NcExecution *x)
{
    static const NcGGroup groups[] = {NC_G_TOOL, NC_G_WORK, NC_G_CONTROL, NC_G_RETRACT};
    const NcBlock *block = x->block;
    for (size_t i = 0; i < G_N_ELEMENTS(groups); i++)
        if (nc_g_word(block, groups[i]))
            return nc_g_word(block, groups[i]);
    if (nc_is_cycle(block->motion) || nc_is_probe(block->motion))
        return nc_motion_word(block);
    return non_modal_word(x);
}

/* LinuxCNC refuses the same, and of G92.1, G92.2 and M61 it loses its place. */
bool nc_check_compensated(const NcExecution *x, GError **error)
{
    const bool on = x->compensation->side != 0;
    const int code = x->block->by.g[NC_G_CUTTER];
    if (!on && code <= 400)
        return true;
    if (on && code > 400) {
        return nc_word_error(error, x->modal.line, nc_g_word(x->block, NC_G_CUTTER),
                             "finds the cutter's radius compensated already: G40 first");
    }
    const NcWord *early = on ? early_word(x) : NULL;
    const NcWord *word = early ? early : code == 400 ? NULL : late_word(x);
    return !word || nc_word_error(error, x->modal.line, word,
                                  "cannot be used while the cutter's radius is compensated: G40 "
                                  "first");
}
