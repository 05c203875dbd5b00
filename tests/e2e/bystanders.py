#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A hold gets through while others misuse the machine: one client that drips a byte a second, one
that asks without reading the answers, with pauses and without, one that asks as fast as it can,
thirty idle connections. Each with a run on; prints how long holds took to be acknowledged, asks
segmill for one, and looks that the run's own agent was not disturbed.

usage: bystanders.py
"""
import asyncio
import socket
import struct
import sys
import tempfile
import time
import zlib
from pathlib import Path

import cell
import protocol

HOLDS = 50
MOST_S = 0.1  # from connecting to the answer of HOLD; seen: 3 ms
MOST_BYTES = 200 << 20  # of vcnc's memory; seen: 7 MiB
SEGMILL_S = 1  # a whole `segmill hold`, from the start of the process to its end
AT_COMMAND, AT_STATUS, STATUS_WORDS = protocol.MAP["COMMAND"][0], *protocol.READABLE["STATUS"]
HOLD = next(n for n, name in protocol.COMMANDS.items() if name == "HOLD")
DONE = next(n for n, name in protocol.ANSWERS.items() if name == "DONE")
READ = struct.pack(">HHHBBHH", 1, 0, 6, 1, 3, AT_STATUS, STATUS_WORDS)


def hold(port, session):
    """Seconds to the acknowledgement of a HOLD, the connection included."""
    head = struct.pack(">IIIIQHH", session, 1, 0, 0, 0, HOLD, 0)
    block = head + struct.pack(">I", zlib.crc32(head))
    pdu = struct.pack(">BHHHHB", 23, AT_STATUS, STATUS_WORDS, AT_COMMAND, len(block) // 2,
                      len(block)) + block
    began = time.monotonic()
    with socket.create_connection(("127.0.0.1", port), 10) as s:
        s.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        s.sendall(struct.pack(">HHHB", 1, 0, len(pdu) + 1, 1) + pdu)
        answer = b""
        while len(answer) < 9 + 2 * STATUS_WORDS:
            answer += s.recv(4096) or sys.exit("the machine closed the connection of a hold")
    took = time.monotonic() - began
    status = protocol.status(answer[9:])
    if status["answer"] != DONE or status["state"] not in ("HOLDING", "HELD"):
        sys.exit(f"HOLD was answered {status['answer']} in {status['state']}")
    return took


def peak_bytes(pid):
    """The most memory that a process has ever had."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) << 10
    sys.exit("the machine is gone")


async def drip(port):
    """One read, a byte a second, over and over."""
    while True:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        for byte in READ:
            writer.write(bytes([byte]))
            await asyncio.sleep(1)
        await reader.read(1)
        writer.close()


async def deaf(port):
    """Asks, and never reads; begins anew when the machine has had enough."""
    loop = asyncio.get_running_loop()
    while True:
        with socket.socket() as s:
            s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
            s.setblocking(False)
            await loop.sock_connect(s, ("127.0.0.1", port))
            try:
                while True:
                    await asyncio.wait_for(loop.sock_sendall(s, READ * 100), 1)
                    await asyncio.sleep(0.001)
            except (ConnectionError, asyncio.TimeoutError):
                pass


async def deaf_flood(port):
    """The same without a pause."""
    while True:
        with socket.create_connection(("127.0.0.1", port)) as s:
            s.setblocking(False)
            try:
                while True:
                    await asyncio.get_running_loop().sock_sendall(s, READ * 1000)
                    await asyncio.sleep(0)
            except ConnectionError:
                await asyncio.sleep(0)


async def flood(port):
    """Asks and reads as fast as it can."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    while True:
        writer.write(READ * 16)
        await writer.drain()
        await reader.readexactly(16 * (9 + 2 * STATUS_WORDS))


async def idle(port):
    """Thirty connections that say nothing, and that come back when they are closed."""
    async def one():
        while True:
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            await reader.read(1)
            writer.close()
            await asyncio.sleep(0.05)
    await asyncio.gather(*(one() for _ in range(30)))


async def measure(folder, what):
    """One machine with a run on it, and one kind of bystander. Returns what is wrong."""
    machine = cell.Machine(folder, speed=1)
    file = Path(folder) / "program.ngc"
    file.write_bytes(cell.program(cuts=40, feed=100))  # takes many minutes
    agent = cell.Agent(folder, machine.port, reply_timeout_s=1)
    other = cell.Agent(folder, machine.port, reply_timeout_s=1)
    run = asyncio.create_task(agent.send(file, seconds=60))
    while machine.status()["state"] != "RUNNING":
        await asyncio.sleep(0.02)
    bystander = asyncio.create_task(what(machine.port))
    await asyncio.sleep(1)
    took = [await asyncio.to_thread(hold, machine.port, 1000 + i) for i in range(HOLDS)]
    began = time.monotonic()
    end, report = await other.call("hold")
    segmill_s = time.monotonic() - began
    status = machine.status()
    peak = peak_bytes(machine.process.pid)
    ended_alone = bystander.done()
    bystander.cancel()
    await asyncio.gather(bystander, return_exceptions=True)
    end_abort, _ = await other.call("abort")
    end_run, _ = await run
    machine.stop()
    print(f"{what.__name__}: hold to acknowledgement at most {1000 * max(took):.1f} ms, median "
          f"{1000 * sorted(took)[HOLDS // 2]:.1f} ms; segmill hold {segmill_s:.2f} s; vcnc at most "
          f"{peak >> 20} MiB")
    return [why for true, why in (
        (max(took) < MOST_S, f"a hold took {max(took):.3f} s"),
        (end == 0 and segmill_s < SEGMILL_S, f"segmill hold: {end} {report} {segmill_s:.2f} s"),
        (peak < MOST_BYTES, f"vcnc took {peak} bytes"),
        (not ended_alone, "the bystander gave up: nothing was tested"),
        (not status["flags"] & 2, "the agent was lost"),
        (end_abort == 0 and end_run == 6, f"abort {end_abort}, the run ended with {end_run}"),
    ) if not true]


async def main():
    wrong = []
    for what in (drip, deaf, deaf_flood, flood, idle):
        with tempfile.TemporaryDirectory() as folder:
            wrong += [f"{what.__name__}: {why}" for why in await measure(folder, what)]
    print("\n".join(f"WRONG {why}" for why in wrong))
    sys.exit(bool(wrong))


asyncio.run(main())
