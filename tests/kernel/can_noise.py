#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Whole ISO-TP messages of random bytes and every length, on all channels of a machine, from one who
has no key; and what docs/protocol-can.md, section 9.2, says that the machine counts them as. Only to
know that it has taken them does it say HELLO, with the key, and wait for WELCOME.

    can_noise.py BUS KEY MESSAGES [fd]    prints them as vcnc does
    can_noise.py hello KEY ID             prints a HELLO for that identifier, as isotpsend takes it"""
import hashlib
import hmac
import random
import socket
import struct
import sys

CHANNELS = (0x120, 0x121, 0x122, 0x123, 0x140, 0x141, 0x142, 0x143)
HELLO, WELCOME, HELLO_BYTES, LEAST, MOST = 5, 21, 41, 21, 4095
SOL_CAN_ISOTP, OPTIONS, LINK_LAYER = 106, 1, 5
NO_PAUSE = 0xffffffff  # between frames


def hello(key, identifier):
    body = struct.pack(">BHHI", HELLO, 0x101, 0, 1) + random.randbytes(16)
    mac = hmac.new(key, body + struct.pack(">H", identifier), hashlib.sha256).digest()
    return body + mac[:16]


def channel(bus, identifier, fd):
    s = socket.socket(socket.AF_CAN, socket.SOCK_DGRAM, socket.CAN_ISOTP)
    s.setsockopt(SOL_CAN_ISOTP, OPTIONS, struct.pack("=IIBBBB", 0, NO_PAUSE, 0, 0, 0, 0))
    if fd:
        s.setsockopt(SOL_CAN_ISOTP, LINK_LAYER, struct.pack("=BBB", 72, 64, 1))
    s.settimeout(10)
    s.bind((bus, identifier + 0x10, identifier))
    return s


def is_malformed(message, fd):
    """Else it is forged: nobody guesses a mac."""
    if message[0] == HELLO:
        return fd or len(message) != HELLO_BYTES
    return len(message) < LEAST


def lengths(fd):
    """Every length where a frame takes 64 bytes; of classic frames, which take 8, fewer long ones."""
    yield from range(1, MOST + 1) if fd else (*range(1, 500), *range(500, MOST + 1, 71), MOST)
    while True:
        yield random.randint(1, 64)


def main():
    if sys.argv[1] == "hello":
        with open(sys.argv[2], encoding="ascii") as file:
            print(hello(bytes.fromhex(file.read()), int(sys.argv[3], 16)).hex(" "))
        return
    bus, fd = sys.argv[1], sys.argv[4:] == ["fd"]
    with open(sys.argv[2], encoding="ascii") as file:
        key = bytes.fromhex(file.read())
    known = [channel(bus, identifier, False) for identifier in CHANNELS]
    strange = [channel(bus, identifier, True) for identifier in CHANNELS] if fd else known
    counts = {True: 0, False: 0}
    # Then the machine has taken them all: it reads a message of each socket in turn, and those in FD
    # frames wait at other sockets than HELLO.
    burst = len(CHANNELS) if fd else 4 * len(CHANNELS)

    def wait_for(which):
        known[which].send(hello(key, CHANNELS[which]))
        answer = known[which].recv(4096)
        if len(answer) != 45 or answer[0] != WELCOME:
            sys.exit(f"can_noise: {answer.hex()} is no WELCOME")

    for i, n in zip(range(int(sys.argv[3])), lengths(fd)):
        message = random.randbytes(n)
        if random.random() < 0.5:  # a kind that there is
            message = bytes([random.choice((1, 2, 3, 4, 5, 16))]) + message[1:]
        strange[i % len(CHANNELS)].send(message)
        counts[is_malformed(message, fd)] += 1
        if i % burst == burst - 1:
            wait_for(i // burst % len(CHANNELS))
    for which in range(len(CHANNELS)):
        wait_for(which)
    print(f"forged {counts[False]}, replayed 0, malformed {counts[True]}, torn 0, unsent 0")


if __name__ == "__main__":
    main()
