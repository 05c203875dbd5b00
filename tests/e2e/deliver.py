#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Delivers a program, starts it and waits for its end, as docs/protocol.md says and nothing else:
a second reading of that document, sharing no code with fieldbus/.

usage: deliver.py PORT PROGRAM [START]     prints the last state; START 0: no start
"""
import hashlib
import socket
import struct
import sys
import time
import zlib

STATUS, COMMAND, CHUNK, BEAT = 0, 1024, 1152, 1280
LEASE, OPEN, VERIFY, START = 1, 3, 4, 5
STATES = ("OFF IDLE LOADING VERIFYING READY RUNNING HOLDING HELD PROGRAM_STOP TOOL_CHANGE "
          "ABORTING COMPLETE ALARM ESTOP").split()
SESSION, TOKEN = 0x5E55, 0x0000ABCD_12345678


class Machine:
    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), 5)
        self.transaction = 0
        self.seq = 0
        self.beats = 0
        self.beaten = time.monotonic()

    def receive(self, n):
        data = b""
        while len(data) < n:
            more = self.socket.recv(n - len(data))
            if not more:
                sys.exit("the machine closed the connection")
            data += more
        return data

    def exchange(self, pdu):
        self.transaction += 1
        self.socket.sendall(struct.pack(">HHHB", self.transaction, 0, len(pdu) + 1, 1) + pdu)
        transaction, protocol, length, unit = struct.unpack(">HHHB", self.receive(7))
        answer = self.receive(length - 1)
        if (transaction, protocol, unit) != (self.transaction, 0, 1) or answer[0] != pdu[0]:
            sys.exit("unexpected answer " + answer.hex())
        return answer[1:]

    def keep(self, answer):
        block = answer[1:]
        if answer[0] != 248 or zlib.crc32(block[:244]) != struct.unpack(">I", block[244:])[0]:
            sys.exit("bad status block")
        at = lambda register, form: struct.unpack_from(">" + form, block, 2 * register)[0]
        self.state = STATES[at(1, "H")]
        self.epoch, self.transfer = at(2, "I"), at(4, "I")
        self.length, self.received = at(6, "Q"), at(10, "Q")
        self.sha256, self.answer = block[76:108], at(59, "H")
        self.chunk_answer, self.run_end, self.blocks = at(60, "H"), at(70, "H"), at(80, "Q")

    def read(self):
        self.keep(self.exchange(struct.pack(">BHH", 3, STATUS, 124)))

    def write(self, register, block):
        block += b"\0" * (len(block) % 2)
        self.keep(self.exchange(
            struct.pack(">BHHHHB", 23, STATUS, 124, register, len(block) // 2, len(block)) + block))

    def command(self, number, arguments=b"", transfer=0):
        self.seq += 1
        head = struct.pack(">IIIIQHH", SESSION, self.seq, self.epoch, transfer, TOKEN, number,
                           len(arguments))
        crc = zlib.crc32(arguments, zlib.crc32(head))
        self.write(COMMAND, head + struct.pack(">I", crc) + arguments)
        if self.answer not in (0, 1):
            sys.exit(f"command {number} answered {self.answer} in state {self.state}")

    def chunk(self, stream):
        offset = self.received
        data = stream[offset:offset + 218]
        head = struct.pack(">IIQHH", self.epoch, self.transfer, offset, len(data), 0)
        crc = zlib.crc32(data, zlib.crc32(head))
        self.write(CHUNK, head + struct.pack(">I", crc) + data)
        if self.chunk_answer != 1:
            sys.exit(f"chunk at {offset} answered {self.chunk_answer}")

    def beat(self):
        """Twice a second; chunks are no signs of life."""
        if time.monotonic() < self.beaten + 0.5:
            return self.read()
        self.beats += 1
        self.beaten = time.monotonic()
        head = struct.pack(">IQI", SESSION, TOKEN, self.beats)
        self.write(BEAT, head + struct.pack(">I", zlib.crc32(head)))


def main():
    machine = Machine(int(sys.argv[1]))
    with open(sys.argv[2], "rb") as file:
        program = file.read()
    gates = struct.pack(">Q", len(program))
    digest = hashlib.sha256(program).digest()
    machine.read()
    machine.command(LEASE)
    machine.command(OPEN, digest + struct.pack(">QIIHH", len(program), 1, zlib.crc32(gates), 0, 1))
    stream = gates + program
    while machine.received < machine.length:
        machine.chunk(stream)
        machine.beat()
    machine.command(VERIFY, transfer=machine.transfer)
    while machine.state == "VERIFYING":
        machine.beat()
    if machine.state == "READY" and machine.sha256 != digest:
        sys.exit("the machine has another hash")
    if machine.state == "READY" and sys.argv[3:] != ["0"]:
        machine.command(START, transfer=machine.transfer)
        while machine.run_end == 0:
            time.sleep(0.05)
            machine.beat()
    print(machine.state, machine.blocks)


main()
