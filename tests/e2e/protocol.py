# SPDX-License-Identifier: Apache-2.0
"""docs/protocol.md as a program reads it: its tables, and blocks decoded by them."""
import re
import socket
import struct
import zlib
from pathlib import Path

TEXT = (Path(__file__).parents[2] / "docs/protocol.md").read_text(encoding="utf-8")


def tables(heading):
    """The tables of the section under a heading, each a list of rows, each a list of cells."""
    body = re.split(rf"^#+ {re.escape(heading)}.*$", TEXT, flags=re.M)[1]
    body = re.split(r"^#+ ", body, maxsplit=1, flags=re.M)[0]
    found = re.findall(r"(?:^\|.*\n)+", body, re.M)
    return [[[cell.strip() for cell in line.strip()[1:-1].split("|")]
             for line in table.splitlines()[2:]] for table in found]


def names(heading):
    """Number -> name, from the first table of a section."""
    return {int(row[0]): row[1] for row in tables(heading)[0] if row[0].isdigit()}


STATES, COMMANDS, ANSWERS = names("3. States"), names("4. Commands"), names("5. Answers")
# Block -> (first register, number of registers); what can be written has a range.
MAP = {row[0]: (int(row[1]), row[2]) for row in tables("2.1 The register map")[0]}
READABLE = {name: (at, int(n)) for name, (at, n) in MAP.items() if n.isdigit() and name not in
            ("reserved", "BEAT")}
NUMBERS = {"u16": ">H", "u32": ">I", "u64": ">Q", "i32": ">i"}


def value(kind, block, at):
    if kind in NUMBERS:
        return struct.unpack_from(NUMBERS[kind], block, at)[0]
    if many := re.fullmatch(r"(\w+) × (\d+)", kind):
        return list(struct.unpack_from(f">{many[2]}{NUMBERS[many[1]][1]}", block, at))
    return block[at:at + int(re.fullmatch(r"bytes (\d+)", kind)[1])]


def decode(rows, block, first=0):
    """Field -> value of a block of which `first` is the first register; its CRC is compared."""
    fields = {}
    for register, kind, field, meaning in rows:
        at = 2 * (int(register) - first)
        if covered := re.match(r"CRC of .*registers (\d+) to (\d+)", meaning):
            low, high = (2 * (int(r) - first) for r in covered.groups())
            crc = zlib.crc32(block[low:high + 2])
            if value("u32", block, at) != crc:
                raise ValueError(f"CRC {value('u32', block, at):08x}, of the bytes {crc:08x}")
        elif kind in NUMBERS or "bytes" in kind or "×" in kind:
            fields[field] = value(kind, block, at)
    return fields


def status(block):
    fields = decode(tables("2.2 STATUS")[0], block)
    fields["state"] = STATES[fields["state"]]
    return fields


def alarm(block):
    fields = decode(tables("2.3 ALARM")[0], block, MAP["ALARM"][0])
    for field in ("alarm_text", "alarm_advice"):
        fields[field] = fields[field].rstrip(b"\0").decode()
    return fields


def offsets(block):
    return decode(tables("2.4 OFFSETS")[0], block, MAP["OFFSETS"][0])


def tools_page(block):
    """(header of the page, its entries): the second and third table of the section."""
    page, entry = tables("2.4 OFFSETS")[1:3]
    head = decode(page, block)
    count, size = (int(re.search(r"(\d+)", text)[1]) for text in ("12", "10"))
    first = 2 * int(page[2][0])
    return head, [decode(entry, block[first + 2 * size * i:first + 2 * size * (i + 1)])
                  for i in range(count)]


def read_status(port, timeout=5):
    """The machine's status, on a connection of its own; raises OSError without a machine."""
    at, n = READABLE["STATUS"]
    with socket.create_connection(("127.0.0.1", port), timeout) as s:
        s.sendall(struct.pack(">HHHBBHH", 1, 0, 6, 1, 3, at, n))
        answer = b""
        while len(answer) < 9 + 2 * n:
            more = s.recv(4096)
            if not more:
                raise ConnectionError("closed")
            answer += more
    return status(answer[9:])
