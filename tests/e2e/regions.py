#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""regions.py FOLDER [AREA]: do regions.json and regions.obj agree with each other and themselves?

The tessellation's area is never above the surface's by more than rounding on a part whose curved
faces bulge, and within 1 % of it at the chord tolerance of the tests.
"""
import json
import math
import sys


def triangle_area(a, b, c):
    u = [q - p for p, q in zip(a, b)]
    v = [q - p for p, q in zip(a, c)]
    cross = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
    return math.sqrt(sum(x * x for x in cross)) / 2


def read_obj(path):
    vertices, areas, group = [], {}, None
    with open(path, encoding="utf-8") as f:
        for line in f:
            words = line.split()
            if words[0] == "v":
                vertices.append([float(w) for w in words[1:]])
            elif words[0] == "g":
                group = words[1]
            elif words[0] == "f":
                corners = [vertices[int(w) - 1] for w in words[1:]]
                areas[group] = areas.get(group, 0) + triangle_area(*corners)
    return areas


folder = sys.argv[1]
with open(f"{folder}/regions.json", encoding="utf-8") as f:
    regions = json.load(f)
areas = read_obj(f"{folder}/regions.obj")
bad = []
faces = [p["face"] for r in regions["regions"] for p in r["pieces"]]
faces += [d["face"] for d in regions["dropped"]]
if sorted(faces) != list(range(len(faces))):
    bad.append(f"faces {sorted(faces)} are not 0 to {len(faces) - 1}, each once")
by_id = {r["id"]: r for r in regions["regions"]}
for region in regions["regions"]:
    area, drawn = region["area_mm2"], areas.get(region["name"], 0)
    if abs(drawn - area) > 0.01 * area:
        bad.append(f"{region['name']}: area {area}, its triangles' {drawn}")
    d, l, w, h = region["feature_size_mm"]
    if abs(math.sqrt(l * l + w * w + h * h) - d) > 1e-9 * d:
        bad.append(f"{region['name']}: the diagonal {d} is not that of {l}, {w}, {h}")
    for neighbour in region["neighbours"]:
        if region["id"] not in by_id[neighbour]["neighbours"]:
            bad.append(f"{neighbour} does not know its neighbour {region['id']}")
total = sum(r["area_mm2"] for r in regions["regions"])
if len(sys.argv) > 2 and abs(total - float(sys.argv[2])) > 1e-12:
    bad.append(f"area {total}, expected {sys.argv[2]}")
print("\n".join(bad))
sys.exit(1 if bad else 0)
