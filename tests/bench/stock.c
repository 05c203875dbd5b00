/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Material removal: a million blocks of 0.1 mm with a ball of 6 mm on a wavy surface, step-over
 * 0.5 mm, in five layers of 2 mm, out of 100 x 100 x 50 mm at a pitch of 0.1 mm.
 */
#include <omp.h>
#include <stdio.h>
#include <time.h>

#include "nc/nc.h"

enum { LAYERS = 5, PASSES = 200, BLOCKS = 1000 };

#define GOAL_S 30.0
#define MESH_GOAL_S 5.0
#define SIDE_MM 100.0

static const CfgTool ball = {.number = 1,
                             .kind = CFG_TOOL_BALL,
                             .diameter_mm = 6,
                             .corner_radius_mm = 3,
                             .shank_diameter_mm = 6,
                             .flute_length_mm = 25,
                             .stickout_mm = 40,
                             .holder_diameter_mm = 40,
                             .length_mm = 100};

/* The gauge point over (x, y) in a layer. */
static SegVec3 gauge_at(double x, double y, int layer)
{
    double z = -5 - 2.0 * (layer + 1) + 3 * sin(x / 8) * cos(y / 11);
    return seg_vec3(x, y, z + ball.length_mm);
}

static GArray *make_moves(void)
{
    GArray *moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    NcMove move = {.kind = NC_MOVE_FEED, .tool = 1, .spindle_rpm = 8000, .feed_mm_min = 1000};
    move.to = seg_vec3(-10, 0, 150);
    for (int layer = 0; layer < LAYERS; layer++)
        for (int pass = 0; pass < PASSES; pass++)
            for (int i = 0; i < BLOCKS; i++) {
                double x = SIDE_MM * (pass % 2 ? BLOCKS - 1 - i : i) / (BLOCKS - 1);
                move.line++;
                move.from = move.to;
                move.to = gauge_at(x, SIDE_MM * (pass + 0.5) / PASSES, layer);
                move.kind = pass == 0 && i == 0 ? NC_MOVE_RAPID : NC_MOVE_FEED;
                if (move.kind == NC_MOVE_RAPID) { /* over the stock to the layer's first corner */
                    NcMove up = move;
                    up.to.z = move.from.z = 150;
                    g_array_append_val(moves, up);
                    up.from = up.to;
                    up.to = move.from = seg_vec3(-10, move.to.y, 150);
                    g_array_append_val(moves, up);
                    up.from = up.to;
                    up.to = move.from = seg_vec3(-10, move.to.y, move.to.z);
                    g_array_append_val(moves, up);
                    move.kind = NC_MOVE_FEED;
                }
                g_array_append_val(moves, move);
            }
    return moves;
}

int main(void)
{
    g_autoptr(GArray) moves = make_moves();
    g_autoptr(GArray) collisions = g_array_new(FALSE, FALSE, sizeof(NcCollision));
    g_autoptr(GError) error = NULL;
    CfgToolTable tools = {.tools = (CfgTool *)&ball, .n_tools = 1};
    g_autoptr(NcStock) stock = nc_stock_new_box(seg_vec3(0, 0, -50), seg_vec3(SIDE_MM, SIDE_MM, 0),
                                                &NC_STOCK_DEFAULTS, &error);
    int64_t began_us = g_get_monotonic_time();
    clock_t began = clock();
    double before = stock ? nc_stock_volume_mm3(stock) : 0;
    if (!stock || !nc_stock_cut(stock, (const NcMove *)(const void *)moves->data, moves->len,
                                seg_vec3(0, 0, 0), &tools, collisions, &error)) {
        fprintf(stderr, "stock: %s\n", error->message);
        return 1;
    }
    double time_s = (double)(g_get_monotonic_time() - began_us) * 1e-6;
    double processor_s = (double)(clock() - began) / CLOCKS_PER_SEC;
    printf("stock: %u blocks in %.1f s on %d threads (goal %.0f s), %.1f s of processors: %.0f "
           "blocks/s, %.0f mm3 removed, %u collisions, %.0f MB\n",
           moves->len, time_s, omp_get_max_threads(), GOAL_S, processor_s, moves->len / time_s,
           before - nc_stock_volume_mm3(stock), collisions->len,
           (double)nc_stock_memory_bytes(stock) / 1e6);
    began_us = g_get_monotonic_time();
    began = clock();
    g_autoptr(NcMesh) mesh = nc_stock_mesh(stock);
    printf(
        "stock: in-process model of %zu triangles in %.1f s (goal %.0f s), %.1f s of processors\n",
        mesh->n_triangles, (double)(g_get_monotonic_time() - began_us) * 1e-6, MESH_GOAL_S,
        (double)(clock() - began) / CLOCKS_PER_SEC);
    return 0;
}
