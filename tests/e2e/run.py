#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""run.py FOLDER: does the run.json of a complete run agree with plan.json and the program?"""
import json
import sys

folder = sys.argv[1]
with open(f"{folder}/run.json", encoding="utf-8") as f:
    run = json.load(f)
with open(f"{folder}/plan.json", encoding="utf-8") as f:
    plan = json.load(f)
with open(f"{folder}/program.ngc", encoding="ascii") as f:
    lines = f.read().splitlines()
bad = []


def near(what, a, b, absolute):
    if abs(a - b) > absolute:
        bad.append(f"{what}: {a} against {b}")


if run["program_sha256"] != plan["program_sha256"]:
    bad.append("another program")
if run["outcome"] != "complete" or run["message"] is not None or run["alarms"]:
    bad.append("it is not complete")
if [r["id"] for r in run["regions"]] != [r["id"] for r in plan["regions"]]:
    bad.append("the regions are not the plan's")
# The machine executes what was planned with the same motion rules.
near("time", run["actual_s"], run["planned_s"], 0.02 * run["planned_s"])
near("sum of the regions", sum(r["actual_s"] for r in run["regions"]), run["actual_s"],
     0.02 * run["actual_s"])
for region in run["regions"]:
    near(f"region {region['id']}", region["actual_s"], region["planned_s"],
         0.05 * run["planned_s"])
times = [s["at_s"] for s in run["states"]]
if times != sorted(times) or run["states"][-1]["state"] not in ("COMPLETE", "READY"):
    bad.append(f"states {run['states']}")
if not 0 < run["blocks"] <= len(lines):
    bad.append(f"{run['blocks']} blocks of {len(lines)} lines")
print("\n".join(bad))
sys.exit(1 if bad else 0)
