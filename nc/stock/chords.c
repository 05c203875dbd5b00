/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/chords.h"

#include "nc/motion/path.h"

enum { BATCH = 16384 };

struct NcChordReader {
    const NcMove *moves;
    size_t n, next;
    size_t done; /* chords of moves[next] that are out already */
    SegVec3 zero;
    const CfgToolTable *tools;
    NcCutterParts **cutters; /* of tools[i], made when first used */
    NcChord *chords;
    NcGroup *groups;
};

bool nc_chords_wanted(const NcMove *move)
{
    return move->tool != 0 &&
           (move->kind == NC_MOVE_RAPID || move->kind == NC_MOVE_FEED || move->kind == NC_MOVE_ARC);
}

bool nc_chords_check(const NcMove *moves, size_t n, const CfgToolTable *tools, GError **error)
{
    for (size_t i = 0; i < n; i++) {
        const NcMove *move = &moves[i];
        if (!nc_chords_wanted(move))
            continue;
        if (!cfg_tools_find(tools, move->tool)) {
            g_set_error(error, NC_ERROR, NC_ERROR_PROGRAM,
                        "line %u: tool %d is not in the tool table, so its shape is not known",
                        nc_move_block_line(move), move->tool);
            return false;
        }
        for (int k = 0; k < 3; k++) {
            double deg = move->to_deg[k] != 0 ? move->to_deg[k] : move->from_deg[k];
            if (deg == 0)
                continue;
            g_set_error(error, NC_ERROR, NC_ERROR_PROGRAM,
                        "line %u: a move with rotary axis %c at %.6g degrees; material is removed "
                        "in three axes only, with A, B and C at 0",
                        nc_move_block_line(move), "ABC"[k], deg);
            return false;
        }
    }
    return true;
}

NcChordReader *nc_chord_reader_new(const NcMove *moves, size_t n, SegVec3 zero,
                                   const CfgToolTable *tools)
{
    NcChordReader *reader = g_new0(NcChordReader, 1);
    *reader = (NcChordReader){.moves = moves, .n = n, .zero = zero, .tools = tools};
    reader->cutters = g_new0(NcCutterParts *, tools->n_tools);
    size_t most = MIN(BATCH, MAX(n, 1) * NC_GROUP);
    reader->chords = g_new(NcChord, most);
    reader->groups = g_new(NcGroup, most);
    return reader;
}

void nc_chord_reader_free(NcChordReader *reader)
{
    if (!reader)
        return;
    for (size_t i = 0; i < reader->tools->n_tools; i++)
        g_free(reader->cutters[i]);
    g_free(reader->cutters);
    g_free(reader->chords);
    g_free(reader->groups);
    g_free(reader);
}

static const NcCutterParts *cutter_of(NcChordReader *reader, int number)
{
    const CfgTool *tool = cfg_tools_find(reader->tools, number);
    NcCutterParts **cutter = &reader->cutters[tool - reader->tools->tools];
    if (!*cutter) {
        NcToolBody cutting = nc_body_cutting(tool), shank = nc_body_shank(tool);
        NcToolBody holder = nc_body_holder(tool);
        NcToolBody around =
            nc_body_cylinder(shank.bottom, shank.top, 2 * (shank.radius + NC_RUB_MM));
        *cutter = g_new(NcCutterParts, 1);
        **cutter = (NcCutterParts){tool, {cutting, shank, holder}, {cutting, around, holder}};
    }
    return *cutter;
}

/* What the cutting part must not do in material on this move; -1: nothing. */
static int forbidden(const NcMove *move, const CfgTool *tool)
{
    if (move->kind == NC_MOVE_RAPID)
        return NC_COLLISION_RAPID;
    bool turns = tool->counterclockwise ? move->spindle_rpm < 0 : move->spindle_rpm > 0;
    return turns ? -1 : NC_COLLISION_SPINDLE;
}

size_t nc_chords_of(const NcMove *move)
{
    if (move->kind != NC_MOVE_ARC)
        return 1;
    NcArc arc = nc_arc(move);
    double r = fmax(arc.radius_from_mm, arc.radius_to_mm);
    /* A chord over an angle deviates by r·(1 - cos(angle / 2)) <= r·angle² / 8. */
    return (size_t)fmax(ceil(fabs(arc.sweep_rad) * sqrt(r / (8 * NC_STOCK_CHORD_MM))), 1);
}

static uint32_t new_cut(NcStock *stock, const NcMove *move)
{
    if (stock->n_cuts == stock->cuts_capacity) {
        stock->cuts_capacity *= 2;
        stock->cuts = g_renew(NcCut, stock->cuts, stock->cuts_capacity);
    }
    stock->cuts[stock->n_cuts] = (NcCut){move->line, move->tool};
    return stock->n_cuts++;
}

static void widen(NcGroup *group, const NcChord *chord)
{
    for (int k = 0; k < NC_N_PARTS; k++) {
        const NcToolBody *body = &group->cutter->reach[k];
        if (nc_body_is_empty(body))
            continue;
        double r = body->radius;
        SegVec3 *min = &group->min[k], *max = &group->max[k];
        min->x = fmin(min->x, fmin(chord->a.x, chord->b.x) - r);
        min->y = fmin(min->y, fmin(chord->a.y, chord->b.y) - r);
        min->z = fmin(min->z, fmin(chord->a.z, chord->b.z) + body->bottom);
        max->x = fmax(max->x, fmax(chord->a.x, chord->b.x) + r);
        max->y = fmax(max->y, fmax(chord->a.y, chord->b.y) + r);
        max->z = fmax(max->z, fmax(chord->a.z, chord->b.z) + body->top);
    }
}

static NcGroup new_group(const NcCutterParts *cutter, const NcChord *chords, int rule)
{
    NcGroup group = {.cutter = cutter, .chords = chords, .forbidden = rule};
    for (int k = 0; k < NC_N_PARTS; k++) {
        group.min[k] = seg_vec3(INFINITY, INFINITY, INFINITY);
        group.max[k] = seg_vec3(-INFINITY, -INFINITY, -INFINITY);
    }
    return group;
}

size_t nc_chord_reader_next(NcChordReader *reader, NcStock *stock, const NcGroup **groups)
{
    size_t n_chords = 0, n_groups = 0, most = MIN(BATCH, reader->n * NC_GROUP);
    for (; reader->next < reader->n; reader->next++, reader->done = 0) {
        const NcMove *move = &reader->moves[reader->next];
        if (!nc_chords_wanted(move))
            continue;
        if (n_chords == most)
            break;
        const NcCutterParts *cutter = cutter_of(reader, move->tool);
        int rule = forbidden(move, cutter->tool);
        uint32_t cut = reader->done == 0 ? new_cut(stock, move) : stock->n_cuts - 1;
        SegVec3 zero = seg_add(reader->zero, seg_vec3(0, 0, cutter->tool->length_mm));
        size_t n = nc_chords_of(move), i = reader->done;
        SegVec3 a = seg_sub(nc_move_point(move, (double)i / (double)n), zero);
        for (; i < n && n_chords < most; i++) {
            NcGroup *group = n_groups > 0 ? &reader->groups[n_groups - 1] : NULL;
            NcChord *chord = &reader->chords[n_chords++];
            SegVec3 b = seg_sub(nc_move_point(move, (double)(i + 1) / (double)n), zero);
            *chord = (NcChord){a, b, cut};
            if (!group || group->cutter != cutter || group->forbidden != rule ||
                group->n == NC_GROUP) {
                group = &reader->groups[n_groups++];
                *group = new_group(cutter, chord, rule);
            }
            group->n++;
            widen(group, chord);
            a = b;
        }
        reader->done = i;
        if (i < n)
            break;
    }
    *groups = reader->groups;
    return n_groups;
}
