/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/probing.h"

struct SimProbing {
    SimMaterial *material;
    NcStock *stock;      /* cut by all moves before `n_cut`; NULL before the first G38 */
    GArray *read;        /* SimStretch: passes of the program, not yet cut into `stock` */
    const GArray *moves; /* being read */
    guint n_cut;         /* of them */
};

SimProbing *sim_probing_new(SimMaterial *material)
{
    SimProbing *probing = g_new0(SimProbing, 1);
    probing->material = material;
    probing->read = sim_stretches_new();
    return probing;
}

void sim_probing_free(SimProbing *probing)
{
    if (!probing)
        return;
    nc_stock_free(probing->stock);
    g_array_unref(probing->read);
    g_free(probing);
}

void sim_probing_begin(SimProbing *probing, const GArray *moves)
{
    probing->moves = moves;
    probing->n_cut = 0;
}

void sim_probing_read(SimProbing *probing, SimProgram *program)
{
    const SimStretch pass = {sim_program_ref(program), probing->n_cut, program->n, 1};
    probing->moves = NULL;
    g_array_append_val(probing->read, pass);
}

/* What cannot be cut, with a rotary axis turned, is not: executing it says so. */
static void cut(SimProbing *probing, const NcMove *moves, size_t n)
{
    sim_material_cut(probing->material, probing->stock, moves, n, NULL, NULL);
}

bool sim_probing_answer(const NcMove *move, bool away, SegVec3 *where, void *data)
{
    SimProbing *probing = data;
    if (!probing->stock)
        probing->stock = sim_material_copy(probing->material);
    for (guint i = 0; i < probing->read->len; i++) {
        const SimStretch *pass = &g_array_index(probing->read, SimStretch, i);
        cut(probing, pass->program->moves + pass->first, pass->end - pass->first);
    }
    g_array_set_size(probing->read, 0);
    cut(probing, &g_array_index(probing->moves, NcMove, probing->n_cut),
        probing->moves->len - probing->n_cut);
    probing->n_cut = probing->moves->len;
    return sim_material_probe(probing->material, probing->stock, move, away, where);
}
