# SPDX-License-Identifier: Apache-2.0
"""A cell for tests: vcnc as the machine, segmill as the agent, a person who looks after both."""
import asyncio
import json
import os
import signal
import subprocess
import time
from pathlib import Path

import protocol

ROOT = Path(__file__).parents[2]
BUILD = Path(os.environ.get("BUILD", "build")).resolve()
MOVING = ("RUNNING", "HOLDING", "TOOL_CHANGE", "ABORTING")
# What the agent does not wait for here, so that a fault costs a fraction of a second.
AGENT = """[link]
reply_timeout_s = {reply_timeout_s}
reconnect_s = 0.02
give_up_s = 10
heartbeat_s = 0.05
window = {window}
drip = {drip}
"""
MACHINE = """[machine]
agent_timeout_s = {agent_timeout_s}
on_agent_loss = next_gate
program_memory_bytes = {memory_bytes}
[tools]
file = {tools}
change_s = 0
[spindle]
rpm_per_s = 10000000
"""


def program(cuts=3, feed=6000, step_mm=5):
    """A short program with a gate behind every cut."""
    lines = ["G17 G21 G40 G49 G80 G90 G91.1 G94 G64 P0.01", "T2 M6", "S6000 M3",
             "G53 G0 Z0"]
    for cut in range(cuts):
        x = -100 - 10 * (cut % 60)
        lines += [f"(REGION {cut + 1} convex tool=2 feed={feed})", f"G53 G0 X{x} Y-100",
                  "G53 G0 Z-100", f"G53 G1 Z-110 F{feed}", f"G53 G1 X{x - step_mm}",
                  f"G53 G1 Y{-100 - step_mm}", "G53 G0 Z0"]
    return ("\n".join(lines + ["M5", "M30"]) + "\n").encode()


class Machine:
    """vcnc, switched on. Each start of it has a log of its own."""

    def __init__(self, folder, speed="max", agent_timeout_s=0.5, memory_bytes=1 << 20):
        self.folder, self.speed = Path(folder), speed
        self.port, self.starts, self.summary = 0, 0, ""
        self.description = self.folder / "machine.ini"
        self.description.write_text(MACHINE.format(
            agent_timeout_s=agent_timeout_s, memory_bytes=memory_bytes,
            tools=ROOT / "config/etc/tools.ini"))
        self.start()

    def start(self):
        self.starts += 1
        with open(self.folder / "vcnc.err", "ab") as errors:
            self.process = subprocess.Popen(
                [BUILD / "vcnc", "--machine", self.description, "--modbus",
                 f"127.0.0.1:{self.port}", "--speed", str(self.speed), "--log",
                 self.log_path(self.starts)],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors)
        line = self.process.stdout.readline().decode()
        if not line.startswith("modbus "):
            raise RuntimeError("vcnc does not start: " +
                               (self.folder / "vcnc.err").read_text()[-500:])
        self.port = int(line.rsplit(":", 1)[1])
        self.press("ack")

    def log_path(self, start):
        return self.folder / f"vcnc.{start}.log"

    def press(self, button):
        self.process.stdin.write(button.encode() + b"\n")
        self.process.stdin.flush()

    def reboot(self):
        """The power fails, comes back, and a person switches the machine on."""
        self.process.kill()
        self.process.communicate()
        self.start()

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        self.summary = self.process.communicate(timeout=20)[0].decode()
        return self.process.returncode

    def status(self):
        return protocol.read_status(self.port)

    async def settled(self, seconds=10):
        """The status as soon as nothing moves or is examined."""
        until = time.monotonic() + seconds
        while (status := self.status())["state"] in MOVING + ("VERIFYING",):
            if time.monotonic() > until:
                raise RuntimeError(f"still {status['state']} after {seconds} s")
            await asyncio.sleep(0.01)
        return status

    def entries(self, start):
        """The log since one start. One that was cut off ends with the last whole line."""
        text = self.log_path(start).read_text()
        return [json.loads(line) for line in text[:text.rfind("\n") + 1].splitlines()]

    def lines(self, start):
        """The lines of the blocks executed since one start, in their order."""
        return [e["line"] for e in self.entries(start) if "line" in e]

    def resources(self):
        """(open descriptors, resident kB)"""
        proc = Path(f"/proc/{self.process.pid}")
        resident = [line for line in (proc / "status").read_text().splitlines()
                    if line.startswith("VmRSS")]
        return len(os.listdir(proc / "fd")), int(resident[0].split()[1])


class Agent:
    """segmill with a user, and so a token, of its own."""

    def __init__(self, folder, port, window=8, drip="never", reply_timeout_s=0.1, description=None):
        self.folder, self.process = Path(folder), None
        self.address = f"modbus://127.0.0.1:{port}"
        self.description = description
        (self.folder / "agent.ini").write_text(
            AGENT.format(window=window, drip=drip, reply_timeout_s=reply_timeout_s))

    async def call(self, *arguments, seconds=20):
        """(exit status, the object it prints); None: it was killed, or stopped after `seconds`."""
        environment = dict(os.environ, XDG_STATE_HOME=str(self.folder / "state"))
        self.process = await asyncio.create_subprocess_exec(
            str(BUILD / "segmill"), *map(str, arguments), "--to", self.address, "--config",
            str(self.folder / "agent.ini"), "--json", env=environment,
            stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE)
        try:
            out, err = await asyncio.wait_for(self.process.communicate(), seconds)
        except asyncio.CancelledError:
            self.kill()
            raise
        except asyncio.TimeoutError:
            self.process.kill()
            await self.process.wait()
            return None, {"error": f"no end within {seconds} s"}
        if self.process.returncode < 0:
            return None, {"error": f"ended by signal {-self.process.returncode}"}
        return self.process.returncode, json.loads(out) if out else {"error": err.decode()[-300:]}

    async def send(self, path, start=True, seconds=20):
        extra = ["--start"] if start else []
        extra += ["--machine", self.description] if self.description else []
        return await self.call("send", path, *extra, seconds=seconds)

    def kill(self):
        """SIGKILL; its connections end as the kernel ends them."""
        try:
            self.process.kill()
        except ProcessLookupError:
            pass
