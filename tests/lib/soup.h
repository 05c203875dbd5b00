/* SPDX-License-Identifier: Apache-2.0 */
/* Triangles for the drop-cutter's tests and bench, each with its own three vertices. */
#ifndef TESTS_LIB_SOUP_H
#define TESTS_LIB_SOUP_H

#include "nc/nc.h"

typedef struct {
    SegVec3 (*triangles)[3];
    size_t n;
} Soup;

void soup_add(Soup *soup, SegVec3 a, SegVec3 b, SegVec3 c);
void soup_clear(Soup *soup);

NcTerrain *soup_terrain(const Soup *soup);

/* One triangle alone. */
NcTerrain *soup_terrain_of(const Soup *soup, size_t triangle);

/* n triangles in all directions within a box of ±10 mm: large and small ones, needles, upright
 * walls, level ones, and some with no area. */
void soup_add_random(Soup *soup, GRand *rand, size_t n);

/* The wavy surface of 100 × 100 mm over a grid of side × side cells whose inner points are moved at
 * random: 2·side² triangles. */
void soup_add_waves(Soup *soup, GRand *rand, int side);

/* A sphere about the origin, its points on it: the chord error is below 1.3·(radius/n²)·π². */
void soup_add_sphere(Soup *soup, double radius_mm, int n);

#endif
