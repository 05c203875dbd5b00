#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Every frame of a delivery and run between segmill and vcnc over Modbus TCP × every fault, one
machine, one program and one fault a case.

After a fault of the link alone segmill ends well, by itself. Where it cannot (the machine was
rebooted, segmill was killed) a person looks at the machine and goes on where that is right: tries
again where nothing was started, lets the machine go on where it holds. In every case the bytes on
the machine are the program, and the blocks executed are the program's, each once; or, over a
reboot, the first of them, each once, and segmill says that it does not know more.

usage: faults.py [--window N] [--speed N|max] [--drip HOW] [--every N] [--pairs N --seed N]
       --every N: only every Nth case; --pairs N: N random pairs of faults of the link besides
"""
import argparse
import asyncio
import collections
import hashlib
import random
import shutil
import sys
import tempfile
from pathlib import Path

import cell
from proxy import FAULTS, Fate, Proxy

LATE_S = 0.25      # a delayed frame; segmill waits 0.1 s for an answer
AGENT_TIMEOUT_S = 1
AT_ONCE = 8        # cases side by side: they mostly wait
REFUSED, LINK_LOST = 4, 7
Target = collections.namedtuple("Target", "direction name fault bit", defaults=(0,))
WIDEST = 600       # of what is said of a wrong case
ABSENT = "the frame did not come"
LATE = "once, a person went on: the host was too busy for beats"


class Wrong(Exception):
    """What must not happen did."""


def need(true, why):
    if not true:
        raise Wrong(why)


class Case:
    """A cell with a proxy in it; each of `targets` has its fault once, in their order."""

    def __init__(self, options, targets=()):
        self.options, self.targets = options, list(targets)
        self.folder = Path(tempfile.mkdtemp(prefix="faults."))
        self.file = self.folder / "program.ngc"
        self.drips = options.drip != "never"
        self.program = cell.program(cuts=20 if self.drips else 3)
        self.file.write_bytes(self.program)
        self.machine = cell.Machine(self.folder, options.speed, AGENT_TIMEOUT_S,
                                    2048 if self.drips else 1 << 20)
        self.frames, self.resumed, self.attending = [], False, False
        self.ends = []  # of each segmill: (exit status, the object it printed)

    def judge(self, frame):
        self.frames.append((frame.direction, frame.name))
        if not self.targets or (frame.direction, frame.name) != self.targets[0][:2]:
            return Fate()
        target = self.targets.pop(0)
        if target.fault == "rebooted":
            return Fate(hook=self.reboot)
        if target.fault == "killed":
            return Fate(hook=self.kill)
        return Fate(target.fault, target.bit)

    async def reboot(self):
        self.machine.reboot()

    async def kill(self):
        self.agent.kill()

    async def run(self):
        """The machine's status at the end."""
        try:
            async with Proxy(self.machine.port, self.judge, late_s=LATE_S) as proxy:
                self.agent = cell.Agent(self.folder, proxy.port, self.options.window,
                                        self.options.drip, description=self.machine.description)
                self.ends.append(await self.attended(self.agent.send(self.file), proxy.port))
                status = await self.machine.settled()
                for _ in range(3):
                    if not (again := self.person(self.ends[-1][0], status)):
                        break
                    self.machine.press("ack")
                    self.ends.append(await again(proxy.port))
                    status = await self.machine.settled()
        finally:
            if self.machine.process.poll() is None:
                self.machine.stop()
        return status

    async def attended(self, call, port):
        """What the call of segmill says, a person looking after the machine meanwhile."""
        self.attending = True
        watch = asyncio.create_task(self.watch(port))
        try:
            return await call
        finally:
            self.attending = False  # wait_for may swallow a cancellation that comes with its result
            watch.cancel()
            await asyncio.gather(watch, return_exceptions=True)

    async def watch(self, port):
        """A busy host may keep segmill from its beats for so long that the machine holds: a person
        lets it go on."""
        other = cell.Agent(self.folder, port, self.options.window, self.options.drip)
        while self.attending:
            await asyncio.sleep(AGENT_TIMEOUT_S / 2)
            if self.machine.process.poll() is None and self.machine.status()["state"] == "HELD":
                self.resumed = True
                self.machine.press("ack")
                await other.call("resume", "--no-follow")

    def person(self, last, status):
        """What is right to do now; None: nothing."""
        if status["state"] == "HELD" and status["received"] < status["length"]:
            return lambda port: self.agent.call("abort")  # nobody has the rest of it any more
        if status["state"] == "HELD":
            return lambda port: self.attended(self.agent.call("resume"), port)
        if last != 0 and status["run"] == 0 and last != LINK_LOST:
            return lambda port: self.attended(self.agent.send(self.file), port)
        return None

    def lines(self):
        """Executed blocks, a list for each start of the machine."""
        return [self.machine.lines(start + 1) for start in range(self.machine.starts)]

    def clear(self):
        shutil.rmtree(self.folder)


async def reference(options):
    """What an undisturbed run executes, and its frames."""
    case = Case(options)
    status = await case.run()
    need(case.ends[0][0] == 0 and status["state"] == "COMPLETE", f"without a fault: {case.ends}")
    lines = case.lines()[0]
    case.clear()
    return lines, list(dict.fromkeys(case.frames))


def counted(lines, whole):
    """What was executed, in a few words."""
    return " + ".join(f"{len(part)} blocks" if part == whole[:len(part)] else f"{part}"
                      for part in lines) + f" of {len(whole)}"


def judge(case, faults, status, whole):
    """A word for how it ended; raises Wrong."""
    (first, first_report), (last, report) = case.ends[0], case.ends[-1]
    lines = case.lines()
    executed = f"executed {counted(lines, whole)}"
    need(case.machine.process.returncode == 0,
         f"vcnc ended with {case.machine.process.returncode}")
    need(all(part == whole[:len(part)] for part in lines), executed)
    if "rebooted" in faults and last == LINK_LOST:
        need("restarted" in str(report.get("error")), "the reason given")
        need(len(lines) == 2 and not lines[1] and status["run"] == 0, f"after a reboot: {executed}")
        return "stopped, the machine's state is UNKNOWN"
    if case.drips and "killed" in faults and sum(map(len, lines)) < len(whole):
        need(status["state"] == "IDLE" and status["run_end"] == 2, f"{status['state']}")
        need(status["executed_blocks"] == len(lines[0]), f"counts {status['executed_blocks']}")
        need(lines[0][-1:] < [status["stop_line"]] <= whole[len(lines[0]):][:1],
             f"executed to {lines[0][-1:]}, stopped before line {status['stop_line']}")
        return "stopped by a person, for want of the rest"
    need(sum(map(len, lines)) == len(whole), executed)
    need(last == 0 or "killed" in faults, "the end")
    need(status["state"] in ("COMPLETE", "READY", "IDLE"), f"the machine is {status['state']}")
    if status["state"] in ("COMPLETE", "READY") and any(lines[-1:]):
        sha256 = hashlib.sha256(case.program).digest()
        need(status["id"] == sha256, "another program is on the machine")
        need(status["executed_blocks"] == len(whole), f"counts {status['executed_blocks']}")
        need(status["sha256"] == sha256 or case.drips, "another hash")
    if not faults & {"rebooted", "killed"}:
        late = case.resumed or "NEEDS_ACKNOWLEDGE" in str(first_report)
        need(first == 0 or late, "a fault of the link ends it")
        if late:
            return LATE
    return "once, without help" if first == 0 else "once, a person went on"


def targets(frames, seed):
    """Every fault of every frame. Both directions, since they are different losses."""
    dice = random.Random(seed)
    return [Target(direction, name, fault, dice.randrange(1 << 16)) for direction, name in frames
            for fault in FAULTS + ("rebooted", "killed")]


async def try_case(options, faults, whole):
    """One case; again where the frame did not come (how often is read is a matter of time), or
    where the host was too busy."""
    for _ in range(4):
        case = Case(options, faults)
        try:
            status = await case.run()
            word = judge(case, {t.fault for t in faults}, status, whole)
        except (Wrong, RuntimeError, OSError) as wrong:
            word = Wrong(f"{wrong}; resumed {case.resumed}; segmill ended so: {case.ends}")
        case.clear()
        word = ABSENT if case.targets and not isinstance(word, Exception) else word
        if word not in (ABSENT, LATE):
            break
    return word


async def sweep(options, cases, whole):
    room, words, bad = asyncio.Semaphore(AT_ONCE), collections.Counter(), []

    async def one(faults):
        async with room:
            word = await try_case(options, faults, whole)
        if isinstance(word, Exception):
            what = (f"{t.direction} {t.name} {t.fault} {t.bit}" for t in faults)
            bad.append(f"{' and '.join(what)}: {word}")
        else:
            words[word] += 1

    await asyncio.gather(*(one(faults) for faults in cases))
    return words, bad


async def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--window", type=int, default=8)
    parser.add_argument("--speed", default="max")
    parser.add_argument("--drip", default="never")
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--pairs", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    whole, frames = await reference(options)
    every = targets(frames, options.seed)
    cases = [[t] for t in every[::options.every]]
    dice = random.Random(options.seed)
    links = [t for t in every if t.fault in FAULTS]
    pairs = [sorted(dice.sample(range(len(links)), 2)) for _ in range(options.pairs)]
    cases += [[links[i], links[k]] for i, k in pairs]
    words, bad = await sweep(options, cases, whole)
    print(f"{len(frames)} frames × {len(FAULTS) + 2} faults, every {options.every}., and "
          f"{options.pairs} pairs (seed {options.seed}): {len(cases)} cases; window "
          f"{options.window}, speed {options.speed}, {len(whole)} blocks")
    for word, n in sorted(words.items()):
        print(f"  {n} {word}")
    if words[ABSENT] > len(cases) // 20 + options.pairs:
        bad.append("too many frames did not come")
    if words[LATE] > len(cases) // 20:
        bad.append("the host was too busy too often")
    for what in bad:
        print(f"  WRONG {what}"[:WIDEST])
    sys.exit(bool(bad))


asyncio.run(main())
