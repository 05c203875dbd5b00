#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A Modbus TCP proxy that does faults on purpose, frame by frame, and captures what passes.

It takes MBAP ADUs apart in both directions, gives each a name ("OPEN 1", "chunk 218", "read 3") and
asks its owner what is to happen to it. As a program it stands between an agent and a machine:

usage: proxy.py --to PORT [--delay-ms N] [--random P --seed N] [--pcap FILE]
       prints "modbus 127.0.0.1:PORT" when it listens
"""
import argparse
import asyncio
import collections
import random
import struct
import time

COMMANDS = ("NONE LEASE RELEASE OPEN VERIFY START HOLD RESUME ABORT ACKNOWLEDGE CLOSE RESTART "
            "OVERRIDE OPTIONAL_STOP").split()
AT_COMMAND, AT_CHUNK, AT_BEAT = 1024, 1152, 1280
FAULTS = ("lost", "duplicated", "delayed", "corrupted", "closed")

# What happens to one frame. `fault` is one of FAULTS, or None: it passes. A corrupted frame has bit
# `bit` (counted from its first byte, modulo its length) turned over. `hook` is awaited before the
# frame goes on: that is where a machine is rebooted or an agent killed.
Fate = collections.namedtuple("Fate", "fault bit hook", defaults=(None, 0, None))
# One ADU. direction: "request" or "reply"; a reply has the name of its request.
Frame = collections.namedtuple("Frame", "direction connection name adu")


def kind_of(adu):
    """What a request is, from its bytes alone."""
    pdu = adu[7:]
    if len(pdu) >= 10 and pdu[0] == 23:
        at, block = struct.unpack_from(">H", pdu, 5)[0], pdu[10:]
        if at == AT_COMMAND and len(block) >= 26:
            number = struct.unpack_from(">H", block, 24)[0]
            return COMMANDS[number] if number < len(COMMANDS) else "command"
        if at == AT_CHUNK and len(block) >= 16:
            return f"chunk {struct.unpack_from('>Q', block, 8)[0]}"
        if at == AT_BEAT:
            return "beat"
    return "read"


class Capture:
    """A classic pcap file of raw IPv4 packets: the frames as a TCP connection each to port 502."""
    CLIENT, SERVER, PORT = b"\x0a\0\0\1", b"\x0a\0\0\2", 502
    FIN, SYN, PSH, ACK = 1, 2, 8, 16

    def __init__(self, path):
        self.file = open(path, "wb")
        self.file.write(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 101))
        self.sequence = {}

    @staticmethod
    def checksum(data):
        data += b"\0" * (len(data) % 2)
        total = sum(struct.unpack(f">{len(data) // 2}H", data))
        while total >> 16:
            total = (total & 0xFFFF) + (total >> 16)
        return ~total & 0xFFFF

    def packet(self, port, to_server, flags, data=b""):
        numbers = self.sequence[port]
        ends = (port, self.PORT) if to_server else (self.PORT, port)
        addresses = self.CLIENT + self.SERVER if to_server else self.SERVER + self.CLIENT
        acknowledged = numbers[not to_server] if flags & self.ACK else 0
        tcp = struct.pack(">HHIIBBHHH", *ends, numbers[to_server], acknowledged, 5 << 4, flags,
                          65535, 0, 0)
        pseudo = addresses + struct.pack(">BBH", 0, 6, len(tcp) + len(data))
        tcp = tcp[:16] + struct.pack(">H", self.checksum(pseudo + tcp + data)) + tcp[18:] + data
        head = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(tcp), 0, 0x4000, 64, 6, 0) + addresses
        ip = head[:10] + struct.pack(">H", self.checksum(head)) + head[12:] + tcp
        now = time.time_ns() // 1000
        self.file.write(struct.pack("<IIII", now // 1000000, now % 1000000, len(ip), len(ip)) + ip)
        step = len(data) + bool(flags & (self.SYN | self.FIN))
        numbers[to_server] = (numbers[to_server] + step) & 0xFFFFFFFF

    def opened(self, port):
        self.sequence[port] = {True: 1000, False: 2000}
        self.packet(port, True, self.SYN)
        self.packet(port, False, self.SYN | self.ACK)
        self.packet(port, True, self.ACK)

    def passed(self, port, to_server, adu):
        self.packet(port, to_server, self.PSH | self.ACK, adu)

    def closed(self, port):
        self.packet(port, True, self.FIN | self.ACK)
        self.packet(port, False, self.FIN | self.ACK)
        self.packet(port, True, self.ACK)

    def close(self):
        self.file.close()


async def read_adu(reader):
    """One ADU, or b"" where the connection ends."""
    try:
        head = await reader.readexactly(6)
        return head + await reader.readexactly(struct.unpack_from(">H", head, 4)[0])
    except (asyncio.IncompleteReadError, ConnectionError):
        return b""


class Proxy:
    """Listens on a free port of loopback for connections to 127.0.0.1:machine.

    judge(frame) -> Fate is asked for every frame. delay_s holds up every frame, in both directions;
    late_s is how much longer a delayed one takes. Order within a direction is kept, as TCP does.
    """

    def __init__(self, machine, judge=lambda frame: Fate(), delay_s=0.0, late_s=1.0, capture=None):
        self.machine, self.judge = machine, judge
        self.delay_s, self.late_s, self.capture = delay_s, late_s, capture
        self.counts = collections.Counter()
        self.connections = 0
        self.tasks = set()
        self.server = None

    async def __aenter__(self):
        self.server = await asyncio.start_server(self.serve, "127.0.0.1", 0)
        self.port = self.server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_):
        self.server.close()
        for task in list(self.tasks):
            task.cancel()
        await asyncio.gather(*self.tasks, return_exceptions=True)

    def name(self, adu):
        kind = kind_of(adu)
        if kind.startswith("chunk"):
            return kind
        self.counts[kind] += 1
        return f"{kind} {self.counts[kind]}"

    async def serve(self, reader, writer):
        self.tasks.add(asyncio.current_task())
        self.connections += 1
        link = Link(self, self.connections, (reader, writer))
        try:
            await link.run()
        except (ConnectionError, asyncio.CancelledError):
            pass
        finally:
            self.tasks.discard(asyncio.current_task())


class Link:
    """One connection of an agent, and the proxy's own to the machine."""

    def __init__(self, proxy, number, agent):
        self.proxy, self.number, self.agent = proxy, number, agent
        self.peer = agent[1].get_extra_info("peername")[1]
        self.names = {}  # of requests, by transaction
        self.ended = asyncio.Event()

    async def run(self):
        try:
            machine = await asyncio.open_connection("127.0.0.1", self.proxy.machine)
        except ConnectionError:
            self.agent[1].close()
            return
        if self.proxy.capture:
            self.proxy.capture.opened(self.peer)
        queues = asyncio.Queue(), asyncio.Queue()
        work = [asyncio.create_task(c) for c in (
            self.take("request", self.agent[0], queues[0]), self.give(queues[0], machine[1], True),
            self.take("reply", machine[0], queues[1]), self.give(queues[1], self.agent[1], False))]
        try:
            await self.ended.wait()
        finally:
            for task in work:
                task.cancel()
            await asyncio.gather(*work, return_exceptions=True)
            if self.proxy.capture:
                self.proxy.capture.closed(self.peer)
            self.agent[1].close()
            machine[1].close()

    async def take(self, direction, reader, queue):
        while adu := await read_adu(reader):
            transaction = adu[:2]
            if direction == "request":
                name = self.names[transaction] = self.proxy.name(adu)
            else:
                name = self.names.get(transaction, "?")
            fate = self.proxy.judge(Frame(direction, self.number, name, adu))
            if fate.hook:
                await fate.hook()
            if fate.fault == "closed":
                self.ended.set()
                return
            if fate.fault == "corrupted":
                adu = bytearray(adu)
                adu[fate.bit // 8 % len(adu)] ^= 1 << fate.bit % 8
            late = self.proxy.late_s if fate.fault == "delayed" else 0
            due = time.monotonic() + self.proxy.delay_s + late
            for _ in range({"lost": 0, "duplicated": 2}.get(fate.fault, 1)):
                queue.put_nowait((due, bytes(adu)))
        queue.put_nowait((0, b""))  # what is on its way still comes, then the end

    async def give(self, queue, writer, to_machine):
        while True:
            due, adu = await queue.get()
            if not adu:
                self.ended.set()
                return
            if (wait := due - time.monotonic()) > 0:
                await asyncio.sleep(wait)
            if writer.is_closing():  # an agent that has gone away does not take back what it sent
                if to_machine:
                    self.ended.set()
                    return
                continue
            if self.proxy.capture:
                self.proxy.capture.passed(self.peer, to_machine, adu)
            try:
                writer.write(adu)
                await writer.drain()
            except ConnectionError:
                pass


class RandomFaults:
    """A judge: each frame has one of FAULTS with the given probability; counts them."""

    def __init__(self, probability, seed):
        self.probability, self.dice = probability, random.Random(seed)
        self.frames, self.done = 0, collections.Counter()

    def __call__(self, frame):
        self.frames += 1
        if self.dice.random() >= self.probability:
            return Fate()
        fate = Fate(self.dice.choice(FAULTS), self.dice.randrange(8 * len(frame.adu)))
        self.done[fate.fault] += 1
        return fate


async def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--to", type=int, required=True, metavar="PORT")
    parser.add_argument("--delay-ms", type=float, default=0)
    parser.add_argument("--random", type=float, default=0, metavar="P")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--pcap")
    options = parser.parse_args()
    capture = Capture(options.pcap) if options.pcap else None
    judge = RandomFaults(options.random, options.seed)
    async with Proxy(options.to, judge, options.delay_ms / 1000, capture=capture) as proxy:
        print(f"modbus 127.0.0.1:{proxy.port}", flush=True)
        await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(main())
