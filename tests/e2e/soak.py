#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Programs in a row, each its own, delivered and run by segmill on one vcnc over a proxy with
random faults. None is lost, none runs twice, and vcnc's descriptors and memory stay what they are.
Where segmill fails, a person looks at the machine, as in faults.py.

usage: soak.py [--programs N] [--probability P] [--seed N] [--window N]
"""
import argparse
import asyncio
import collections
import hashlib
import shutil
import sys
import tempfile
import time
from pathlib import Path

import cell
from proxy import Proxy, RandomFaults

CUTS = 20
GROWTH_KB = 256  # of the resident memory, between the second and the last quarter


class Soak:
    def __init__(self, options):
        self.options = options
        self.folder = Path(tempfile.mkdtemp(prefix="soak."))
        self.machine = cell.Machine(self.folder)
        self.faults = RandomFaults(options.probability, options.seed)
        self.ends, self.resources, self.done = collections.Counter(), [], []
        self.failures, self.wrong = [], []

    async def run(self):
        async with Proxy(self.machine.port, self.faults, late_s=0.25) as proxy:
            agent = cell.Agent(self.folder, proxy.port, self.options.window)
            for i in range(self.options.programs):
                await self.one(agent, cell.program(CUTS, 1000 + i))
                self.resources.append(self.machine.resources())
        if code := self.machine.stop():
            self.wrong.append(f"vcnc ended with {code}")

    async def one(self, agent, program):
        file = self.folder / "program.ngc"
        file.write_bytes(program)
        before = self.machine.status()["run"]
        for _ in range(5):
            end, report = await agent.send(file)
            self.ends[end] += 1
            status = await self.machine.settled()
            if end != 0:
                self.failures.append((len(self.done) + 1, end, report.get("error")))
                if status["run"] > before or not report.get("error"):
                    self.wrong.append(f"segmill failed, but not before the start: {report}")
            if status["run"] > before:
                break
            self.machine.press("ack")
        self.done.append(hashlib.sha256(program).hexdigest())

    def runs(self):
        """(hash, lines) of each run, from the machine's log."""
        runs, held, lines = [], None, []
        for entry in self.machine.entries(1):
            if "program" in entry:
                held = entry["program"]
            elif "line" in entry:
                lines.append(entry["line"])
            elif entry.get("state") in ("COMPLETE", "ABORTED", "ESTOP"):
                runs.append((held, lines))
                lines = []
        return runs

    def judge(self):
        """What is wrong, a line each."""
        wrong, runs = self.wrong, self.runs()
        ran = collections.Counter(sha for sha, _ in runs)
        if lost := set(self.done) - set(ran):
            wrong.append(f"lost: {len(lost)} programs")
        if any(n > 1 for n in ran.values()):
            wrong.append(f"run twice: {[sha for sha, n in ran.items() if n > 1]}")
        if [sha for sha, _ in runs] != self.done:
            wrong.append("the runs are not the programs in their order")
        if len({tuple(lines) for _, lines in runs}) != 1 or len(runs[0][1]) < 7 * CUTS - CUTS:
            wrong.append("not every run is the same blocks")
        n = self.options.programs
        if f"{n} started, {n} completed, 0 aborted" not in self.machine.summary:
            wrong.append(self.machine.summary)
        quarter = n // 4
        early, late = self.resources[quarter:2 * quarter], self.resources[-quarter:]
        # Connections may be open while it is counted: the least of a quarter is what stays.
        descriptors = [min(pair[0] for pair in part) for part in (early, late)]
        memory = [max(pair[1] for pair in part) for part in (early, late)]
        if descriptors[1] > descriptors[0] + 2:
            wrong.append(f"descriptors: {descriptors} in the second and the last quarter")
        if memory[1] > memory[0] + GROWTH_KB:
            wrong.append(f"memory: {memory} kB in the second and the last quarter")
        return wrong


async def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--programs", type=int, default=200)
    parser.add_argument("--probability", type=float, default=0.01)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--window", type=int, default=8)
    soak = Soak(parser.parse_args())
    began = time.monotonic()
    try:
        await soak.run()
        wrong = soak.judge()
    finally:
        soak.machine.process.kill()
        shutil.rmtree(soak.folder)
    faults, options = soak.faults, soak.options
    print(f"{options.programs} programs in {time.monotonic() - began:.0f} s, window "
          f"{options.window}, seed {options.seed}: {faults.frames} frames, "
          f"{faults.done.total()} faults {dict(faults.done)}, exit statuses {dict(soak.ends)}; "
          f"descriptors {soak.resources[0][0]} … {soak.resources[-1][0]}, "
          f"{soak.resources[0][1]} … {soak.resources[-1][1]} kB")
    for number, end, error in soak.failures:
        print(f"program {number}: exit status {end}, tried again: {error['message']}")
    for what in wrong:
        print(f"WRONG {what}")
    sys.exit(bool(wrong) or faults.done.total() == 0)


asyncio.run(main())
