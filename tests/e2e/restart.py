#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""restart.py LOG FULL LINE: the last run of LOG began at a gate: did it come down last, with the
spindle at its speed, and are its blocks those of FULL, an unbroken run, from LINE on?"""
import json
import sys


def last_run(path):
    run = []
    with open(path, encoding="utf-8") as f:
        for entry in map(json.loads, f):
            if entry.get("state") == "RUNNING" and entry["time_s"] == 0:
                run = []
            run.append(entry)
    return run


def blocks(run):
    return [(e["line"], e["kind"], e["position_mm"]) for e in run if "line" in e and "kind" in e]


log, full, line = sys.argv[1], sys.argv[2], int(sys.argv[3])
run = last_run(log)
bad = []
expected = [b for b in blocks(last_run(full)) if b[0] >= line]
gate = [b for b in blocks(last_run(full)) if b[0] < line][-1][2]
if blocks(run) != expected or not expected:
    bad.append(f"blocks {blocks(run)}, expected {expected}")
way = [e for e in run if "way" in e]
first = next(i for i, e in enumerate(run) if "line" in e)
if any("way" in e for e in run[first:]):
    bad.append("a way between the blocks")
kinds = [e["way"] for e in way]
print(*way, sep="\n")
if not way or kinds[0] != "rapid" or way[0]["position_mm"][2] != max(
        e["position_mm"][2] for e in way):
    bad.append("it does not go up first")
if way and (kinds[-1] != "rapid" or way[-1]["position_mm"] != gate):
    bad.append(f"it does not come down to the gate {gate} last")
if len(way) > 1:
    top = way[-2]
    if top["position_mm"][:2] != gate[:2] or top["position_mm"][2] <= gate[2]:
        bad.append("it does not come from above")
    if top["spindle_rpm"] == 0 or "spindle" not in kinds[:-1] or "tool-change" not in kinds[:-1]:
        bad.append(f"it comes down before tool and spindle are ready: {kinds}")
print("\n".join(bad))
sys.exit(1 if bad else 0)
