#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""plan.py FOLDER: do plan.json, program.ngc and regions.json agree with each other?"""
import hashlib
import json
import re
import sys

folder = sys.argv[1]
with open(f"{folder}/plan.json", encoding="utf-8") as f:
    plan = json.load(f)
with open(f"{folder}/regions.json", encoding="utf-8") as f:
    regions = {r["id"]: r for r in json.load(f)["regions"]}
with open(f"{folder}/program.ngc", "rb") as f:
    program = f.read()
bad = []


def near(what, a, b, relative=1e-9):
    if abs(a - b) > relative * max(abs(a), abs(b)):
        bad.append(f"{what}: {a} against {b}")


if hashlib.sha256(program).hexdigest() != plan["program_sha256"]:
    bad.append("the hash is not the program's")
written = re.findall(rb"^\(REGION (\d+) (\S+) tool=(\d+) feed=", program, re.M)
if [(int(i), int(t)) for i, _, t in written] != [(r["id"], r["tool"]) for r in plan["regions"]]:
    bad.append(f"the program's regions {written} are not the plan's")
for region in plan["regions"]:
    near("requested area", region["requested_area_mm2"], regions[region["id"]]["area_mm2"], 1e-2)
    if region["unreachable_area_mm2"] > region["requested_area_mm2"] * (1 + 1e-9):
        bad.append(f"region {region['id']}: more cannot be reached than was asked for")
near("length", plan["length_mm"], sum(r["length_mm"] for r in plan["regions"]))
if sum(r["estimated_s"] for r in plan["regions"]) > plan["estimated_s"] * (1 + 1e-9):
    bad.append("the regions take longer than the whole")
baseline = plan["baseline"]
if baseline:
    t, whole = plan["estimated_s"], baseline["estimated_s"]
    near("saving", plan["saving_percent"], 100 * (1 - t / whole), 1e-6)
    near("speed-up", plan["speedup_percent"], 100 * (whole / t - 1), 1e-6)
elif plan["saving_percent"] is not None or plan["speedup_percent"] is not None:
    bad.append("a saving without a baseline")
print("\n".join(bad))
sys.exit(1 if bad else 0)
