#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Reads a log of `candump -L` as docs/protocol-can.md says and nothing else: puts the ISO-TP
messages together, follows every opening, checks every seal, counter, CRC, beat and STOP, and
compares the program that went over the bus.

    can_judge.py LOG KEY PROGRAM [fd]    prints what it saw; fails on the first thing that is wrong"""
import hashlib
import hmac
import struct
import sys
import zlib

BASE = 0x100
COMMAND, CHUNK, BEAT, READ, HELLO, STATUS, ALARM, ACK, OFFSETS, TOOLS, WELCOME = (
    1, 2, 3, 4, 5, 16, 17, 18, 19, 20, 21)
ANSWERS = {COMMAND: {STATUS}, CHUNK: {ACK}, BEAT: {STATUS}, HELLO: {WELCOME},
           READ: {STATUS, ALARM, OFFSETS, TOOLS}}
BODY = {STATUS: 248, ALARM: 200, ACK: 32, OFFSETS: 80, TOOLS: 248, BEAT: 20, READ: 2}


def mac(key, *parts):
    return hmac.new(key, b"".join(parts), hashlib.sha256).digest()


def check(truth, what):
    if not truth:
        sys.exit(f"can_judge: {what}")


class Frames:
    """The log, frame by frame: (time, identifier, fd flags or None, data)."""

    def __init__(self, path):
        self.path = path

    def __iter__(self):
        with open(self.path, encoding="ascii") as log:
            for line in log:
                time, _, text = line.split()[:3]
                name, _, data = text.partition("#")
                flags = None
                if data.startswith("#"):
                    flags, data = int(data[1], 16), data[2:]
                yield float(time.strip("()")), int(name, 16), flags, bytes.fromhex(data)


class Transport:
    """ISO 15765-2, one direction of one channel and kind of frame."""

    def __init__(self):
        self.message, self.length, self.next = b"", 0, 0

    def take(self, data):
        """The whole message that this frame ends, or None."""
        kind = data[0] >> 4
        if kind == 0:
            if data[0] & 15:
                return data[1:1 + (data[0] & 15)]
            return data[2:2 + data[1]]
        if kind == 1:
            self.length, self.message, self.next = (data[0] & 15) << 8 | data[1], data[2:], 1
        elif kind == 2:
            check(data[0] & 15 == self.next, "a consecutive frame is missing")
            self.next = (self.next + 1) & 15
            self.message += data[1:]
            if len(self.message) >= self.length:
                return self.message[:self.length]
        return None


class Channel:
    def __init__(self, judge, request):
        self.judge, self.id = judge, struct.pack(">H", request)
        self.hello = self.welcome = self.agent = self.machine = None
        self.fd, self.counter, self.asked, self.seqs = False, 0, None, set()

    def request(self, message, fd):
        if message[0] == HELLO:
            check(not fd and len(message) == 41, "a HELLO of another form")
            check(mac(self.judge.key, message[:25], self.id)[:16] == message[25:], "HELLO's mac")
            self.hello = message
            return
        check(fd == self.fd, "a request in frames that were not agreed on")
        body = self.unseal(message, self.agent)
        counter = struct.unpack(">I", message[-20:-16])[0]
        check(counter > self.counter, "a counter that does not grow")
        self.counter, self.asked = counter, message[0]
        check(message[0] in ANSWERS, f"a request of kind {message[0]}")
        check(len(body) == BODY.get(message[0], len(body)), "a body of another size")
        if message[0] == CHUNK:
            self.judge.chunk(body)

    def answer(self, message, fd):
        if message[0] == WELCOME:
            check(not fd and len(message) == 45, "a WELCOME of another form")
            check(mac(self.judge.key, message[:29], self.hello[9:25], self.id)[:16] ==
                  message[29:], "WELCOME's mac")
            nonces = self.hello[9:25] + message[13:29]
            self.agent = mac(self.judge.key, b"agent", self.id, nonces)
            self.machine = mac(self.judge.key, b"machine", self.id, nonces)
            flags, self.judge.epoch = struct.unpack(">HI", message[3:9])
            self.fd, self.counter = bool(flags & 1), 0
            check(self.fd == self.judge.fd, "FD is not what was expected")
            self.judge.openings += 1
            return
        check(fd == self.fd, "an answer in frames that were not agreed on")
        body = self.unseal(message, self.machine)
        counter = struct.unpack(">I", message[-20:-16])[0]
        if counter & 1 << 31:
            check(counter & 0xffffff in self.seqs and message[0] == STATUS, "no answer to a STOP")
        else:
            check(counter == self.counter, "an answer to another request")
            check(message[0] in ANSWERS[self.asked], "an answer of another kind")
        check(len(body) == BODY[message[0]], "a body of another size")
        check(zlib.crc32(body[:-4]) == struct.unpack(">I", body[-4:])[0], "an answer's CRC")

    def unseal(self, message, key):
        check(key and mac(key, message[:-16])[:16] == message[-16:], "a seal is wrong")
        return message[1:-20]

    def stop(self, frame):
        command, seq = frame[0], int.from_bytes(frame[1:4], "big")
        check(command in (6, 8), "a STOP that is neither HOLD nor ABORT")
        check(mac(self.agent, bytes([6, command]), struct.pack(">I", seq))[:4] == frame[4:],
              "STOP's mac")
        self.seqs.add(seq)


class Judge:
    def __init__(self, key, fd):
        self.key, self.fd, self.epoch = key, fd, None
        self.channels, self.transports = {}, {}
        self.stream = bytearray()
        self.openings = self.chunks = self.beats = self.stops = 0
        self.count = self.time = None

    def chunk(self, body):
        epoch, _, offset, length, _, crc = struct.unpack(">IIQHHI", body[:24])
        check(epoch == self.epoch and length == len(body) - 24 <= 4050, "a chunk's header")
        check(zlib.crc32(body[:20] + body[24:]) == crc, "a chunk's CRC")
        check(offset <= len(self.stream), "a hole in the stream")
        self.stream[offset:offset + length] = body[24:]
        self.chunks += 1

    def beat(self, time, frame):
        check(len(frame) == 8, "a beat of another size")
        low = int.from_bytes(frame[2:4], "big")
        if self.epoch:
            key = mac(self.key, b"beat", struct.pack(">I", self.epoch))
            check(mac(key, frame[:2], struct.pack(">I", low))[:4] == frame[4:], "a beat's mac")
        check(self.count in (None, low - 1), "a beat is missing")
        check(self.time is None or time - self.time < 0.6, "beats that are too rare")
        self.count, self.time = low, time
        self.beats += 1

    def channel(self, request):
        return self.channels.setdefault(request, Channel(self, request))

    def take(self, time, identifier, flags, data):
        block = identifier - BASE >> 4
        if block == 0:
            check(flags is None and len(data) == 8, "a STOP of another form")
            self.channel(identifier + 0x20).stop(data)
            self.stops += 1
        elif identifier == BASE + 0x10:
            check(flags is None, "a beat in an FD frame")
            self.beat(time, data)
        else:
            check(block in (2, 3, 4, 5), f"identifier {identifier:x} is not ours")
            check(flags is None or flags & 1, "an FD frame without the faster rate")
            transport = self.transports.setdefault((identifier, flags is None), Transport())
            message = transport.take(data)
            if message is not None and block in (2, 4):
                self.channel(identifier).request(message, flags is not None)
            elif message is not None:
                self.channel(identifier - 0x10).answer(message, flags is not None)


def main():
    with open(sys.argv[2], encoding="ascii") as file:
        judge = Judge(bytes.fromhex(file.read()), sys.argv[4:] == ["fd"])
    with open(sys.argv[3], "rb") as file:
        program = file.read()
    for frame in Frames(sys.argv[1]):
        judge.take(*frame)
    check(judge.stream.endswith(program), "the program is not what went over the bus")
    check((len(judge.stream) - len(program)) % 8 == 0, "the table of gates")
    print(f"openings {judge.openings}, chunks {judge.chunks}, beats {judge.beats}, "
          f"stops {judge.stops}")


if __name__ == "__main__":
    main()
