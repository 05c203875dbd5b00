#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Bits on the wire of the frames in a log of `candump -L`: from start of frame to the intermission
behind it, with the bits that stuffing puts in (ISO 11898-1: classic frames over everything up to
their CRC, which is computed here; FD frames up to their data, with fixed stuff bits in the CRC).

    can_bits.py LOG          prints frames, bytes of data, bits"""
import sys

END = 3 + 7 + 3  # CRC delimiter, acknowledgement and its delimiter; end of frame; intermission
LENGTHS = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64]


def bits_of(value, n):
    return format(value, f"0{n}b")


def crc15(bits):
    crc = 0
    for bit in bits:
        turn = (crc >> 14) ^ int(bit)
        crc = crc << 1 & 0x7FFF
        if turn & 1:
            crc ^= 0x4599
    return bits_of(crc, 15)


def stuffing(bits):
    """Stuff bits behind every five equal ones, themselves counted in."""
    stuffed, last, run = 0, "", 0
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            stuffed += 1
            last = "1" if bit == "0" else "0"
            run = 1
    return stuffed


def classic(identifier, data):
    head = "0" + bits_of(identifier, 11) + "000" + bits_of(len(data), 4)
    bits = head + "".join(bits_of(b, 8) for b in data)
    bits += crc15(bits)
    return len(bits) + stuffing(bits) + END


def flexible(identifier, flags, data):
    head = "0" + bits_of(identifier, 11) + "0010" + bits_of(flags & 1, 1) + bits_of(flags >> 1 & 1, 1)
    head += bits_of(LENGTHS.index(len(data)), 4)
    bits = head + "".join(bits_of(b, 8) for b in data)
    # No stuff bit behind the last bit: a fixed one stands there, and behind every fourth.
    crc = 4 + (17 if len(data) <= 16 else 21)
    return len(bits) + stuffing(bits[:-1]) + crc + (crc + 3) // 4 + END


def frame_bits(text):
    """Of a frame as candump writes it: 123#1122, or 123##1112233 in FD frames."""
    identifier, _, rest = text.partition("#")
    if rest.startswith("#"):
        return flexible(int(identifier, 16), int(rest[1], 16), bytes.fromhex(rest[2:]))
    return classic(int(identifier, 16), bytes.fromhex(rest))


def main():
    frames = data = bits = 0
    with open(sys.argv[1], encoding="ascii") as log:
        for line in log:
            text = line.split()[2]
            frames += 1
            data += len(text.split("#")[-1]) // 2
            bits += frame_bits(text)
    print(frames, data, bits)


if __name__ == "__main__":
    main()
