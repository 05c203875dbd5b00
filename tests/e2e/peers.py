#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A Modbus master that we did not write, pymodbus, against vcnc, with docs/protocol.md as the only
description of the registers.

usage: peers.py PORT map MACHINE.ini STATUS.json   every readable block: CRCs, and what is in them
       peers.py PORT mbpoll OUTPUT                 STATUS as mbpoll printed it
       peers.py PORT exceptions                    prints how many the machine has answered
       peers.py PORT crowd                         one connection more than it serves
"""
import configparser
import json
import struct
import sys
import time
from pathlib import Path

from pymodbus.client import ModbusTcpClient
from pymodbus.pdu import ModbusRequest

import protocol

UNIT = 1
AT_COMMAND, AT_CHUNK, AT_BEAT = (protocol.MAP[name][0] for name in ("COMMAND", "CHUNK", "BEAT"))
bad = []


def same(what, got, expected):
    if got != expected:
        bad.append(f"{what}: {got}, expected {expected}")


def connect(port):
    client = ModbusTcpClient("127.0.0.1", port=port, timeout=5)
    if not client.connect():
        sys.exit(f"no connection to port {port}")
    return client


def words(response):
    """The registers of an answer as bytes."""
    if response.isError():
        raise ValueError(str(response))
    return struct.pack(f">{len(response.registers)}H", *response.registers)


def read_blocks(client):
    """Block -> bytes; FC3 and FC4 have to agree on all that stands still."""
    blocks = {}
    for name, (at, n) in protocol.READABLE.items():
        blocks[name] = words(client.read_holding_registers(at, n, slave=UNIT))
        if name != "STATUS":
            same(f"{name} by FC4", words(client.read_input_registers(at, n, slave=UNIT)),
                 blocks[name])
    return blocks


def machine_tools(description):
    """number -> (type, diameter, corner radius, length) of a tool table, in 0.1 µm."""
    ini = configparser.ConfigParser()
    ini.read(description)
    table = configparser.ConfigParser()
    table.read(Path(description).parent / ini.get("tools", "file", fallback="tools.ini"))
    tools = {}
    for section in table.sections():
        get = table[section].get
        kind = get("kind")
        diameter = float(get("diameter_mm"))
        corner = diameter / 2 if kind == "ball" else float(get("corner_radius_mm", "0"))
        tools[int(section.split(".")[1])] = (("flat", "ball", "bull").index(kind),) + tuple(
            round(1e4 * mm) for mm in (diameter, corner, float(get("length_mm"))))
    return tools


def check_setup(blocks, status, description):
    offsets = protocol.offsets(blocks["OFFSETS"])
    same("serial of OFFSETS", offsets["setup_serial"], status["setup_serial"])
    same("work offset in force", offsets["work_offset"], status["work_offset"])
    ini = configparser.ConfigParser()
    ini.read(description)
    wanted = []
    for number in range(54, 60):
        text = ini.get("work_offsets", f"g{number}", fallback="-381, -203, -420")
        wanted += [round(1e4 * float(mm)) for mm in text.split(",")]
    same("work offsets", offsets["offsets"], wanted)
    tools = []
    for page in range(5):
        head, entries = protocol.tools_page(blocks[f"TOOLS, page {page}"])
        same(f"serial of page {page}", head["setup_serial"], status["setup_serial"])
        same(f"tools, page {page}", head["n_tools"], status["n_tools"])
        tools += entries
    if any(any(t.values()) for t in tools[status["n_tools"]:]):
        bad.append("there is something behind the last tool")
    same("tools", {t["number"]: (t["type"], t["diameter"], t["corner_radius"], t["length"])
                   for t in tools[:status["n_tools"]]}, machine_tools(description))


def check_map(port, description, reported):
    client = connect(port)
    blocks = read_blocks(client)
    status, alarm = protocol.status(blocks["STATUS"]), protocol.alarm(blocks["ALARM"])
    shown = json.loads(Path(reported).read_text())
    for field in ("state", "epoch", "length", "received", "line", "executed_blocks", "tool"):
        same(field, status[field], shown[field])
    same("sha256", status["sha256"].hex(), shown["program_sha256"] or "0" * 64)
    same("position", [status[f"position_{axis}"] for axis in "xyz"],
         [round(1000 * mm) for mm in shown["position_mm"]])
    same("alarm code", (status["alarm_code"], status["alarm_serial"]),
         (alarm["alarm_code"], alarm["alarm_serial"]))
    same("alarm", (alarm["alarm_text"], alarm["alarm_advice"]),
         (shown["alarm"]["text"], shown["alarm"]["advice"]) if shown["alarm"] else ("", ""))
    same("version", status["protocol_version"], 256 * 1 + 1)
    same("the write blocks", words(client.read_holding_registers(AT_COMMAND, 121, slave=UNIT)),
         bytes(242))
    check_setup(blocks, status, description)


def check_mbpoll(port, output):
    """mbpoll prints `[register]: value`, signed where it is above 32767 (then in parentheses)."""
    block = b""
    for line in Path(output).read_text().splitlines():
        if line.startswith("["):
            block += struct.pack(">H", int(line.split(":")[1].split()[0]) & 0xFFFF)
    status = protocol.status(block)
    own = protocol.read_status(port)
    for field in own:
        if field not in ("heartbeat", "lease_ms"):
            same(field, status[field], own[field])


# ------------------------------------------------------------------------- exceptions

class Raw(ModbusRequest):
    """A PDU of any function and bytes, sent by pymodbus."""

    def __init__(self, pdu, unit):
        super().__init__(unit)
        self.function_code, self.body = pdu[0], pdu[1:]

    def encode(self):
        return self.body


def exceptions():
    """(what, PDU, unit, exception that the document says)"""
    def fc23(read_at, n_read, write_at, n_write, n_bytes=None):
        n_bytes = 2 * n_write if n_bytes is None else n_bytes
        return struct.pack(">BHHHHB", 23, read_at, n_read, write_at, n_write,
                           n_bytes & 0xFF) + bytes(2 * n_write)

    def fc16(at, n, n_bytes=None):
        return struct.pack(">BHHB", 16, at, n, (2 * n if n_bytes is None else n_bytes) & 0xFF) + \
            bytes(2 * n)

    def read(function, at, n):
        return struct.pack(">BHH", function, at, n)

    yield from ((f"unit {unit}", read(3, 0, 124), unit, 11) for unit in (2, 17, 247, 254))
    yield from ((f"function {f}", bytes([f]) + b"\0\0\0\1", UNIT, 1)
                for f in (1, 2, 5, 6, 7, 8, 11, 15, 17, 20, 21, 22, 24, 43, 65, 100))
    for function in (3, 4):
        yield f"FC{function} of 0", read(function, 0, 0), UNIT, 3
        yield f"FC{function} of 126", read(function, 0, 126), UNIT, 3
        yield f"FC{function} of 65535", read(function, 0, 65535), UNIT, 3
        yield f"FC{function} beyond the map", read(function, 2047, 2), UNIT, 2
        yield f"FC{function} far beyond it", read(function, 65535, 1), UNIT, 2
    yield "FC16 of 0", fc16(AT_BEAT, 0), UNIT, 3
    yield "FC16 with another byte count", fc16(AT_BEAT, 10, 18), UNIT, 3
    yield "FC16 to STATUS", fc16(0, 10), UNIT, 2
    yield "FC16 into the middle of COMMAND", fc16(AT_COMMAND + 1, 16), UNIT, 2
    yield "FC16 between the blocks", fc16(2000, 10), UNIT, 2
    yield "FC16 beyond the map", fc16(2048, 10), UNIT, 2
    yield "FC16 of a longer beat", fc16(AT_BEAT, 11), UNIT, 2
    yield "FC16 of a shorter beat", fc16(AT_BEAT, 9), UNIT, 2
    yield "FC16 of a shorter command", fc16(AT_COMMAND, 15), UNIT, 2
    yield "FC23 reads 0", fc23(0, 0, AT_BEAT, 10), UNIT, 3
    yield "FC23 reads 126", fc23(0, 126, AT_BEAT, 10), UNIT, 3
    yield "FC23 writes 0", fc23(0, 124, AT_BEAT, 0), UNIT, 3
    yield "FC23 with another byte count", fc23(0, 124, AT_BEAT, 10, 22), UNIT, 3
    yield "FC23 reads beyond the map", fc23(2000, 60, AT_BEAT, 10), UNIT, 2
    yield "FC23 writes to OFFSETS", fc23(0, 124, protocol.MAP["OFFSETS"][0], 10), UNIT, 2
    yield "FC23 writes behind CHUNK's beginning", fc23(0, 124, AT_CHUNK + 2, 20), UNIT, 2


def check_exceptions(port):
    client = connect(port)
    before = protocol.read_status(port)
    answered = 0
    for what, pdu, unit, code in exceptions():
        response = client.execute(Raw(pdu, unit))
        got = getattr(response, "exception_code", response)
        same(what, got, code)
        answered += 1
        if got != code:
            client.close()
            client.connect()
    after = protocol.read_status(port)
    for field in before:
        if field not in ("heartbeat", "lease_ms"):
            same(f"{field} afterwards", after[field], before[field])
    for unit in (0, 255, UNIT):
        words(client.read_holding_registers(0, 124, slave=unit))
    print(answered)


def check_crowd(port):
    """Sixteen are served; one more, and the one that was silent longest is closed."""
    crowd = [connect(port) for _ in range(16)]
    for client in crowd:
        words(client.read_holding_registers(0, 124, slave=UNIT))
        time.sleep(0.002)  # another age for each
    words(crowd[0].read_holding_registers(0, 124, slave=UNIT))  # now crowd[1] is the eldest
    words(connect(port).read_holding_registers(0, 124, slave=UNIT))
    crowd[1].socket.settimeout(5)
    same("the eldest is closed", crowd[1].socket.recv(1), b"")
    for i in (0, *range(2, 16)):
        try:
            words(crowd[i].read_holding_registers(0, 124, slave=UNIT))
        except Exception as error:  # pymodbus has many
            bad.append(f"connection {i}: {error}")


def main():
    port, what, *rest = sys.argv[1:]
    {"map": check_map, "mbpoll": check_mbpoll, "exceptions": check_exceptions,
     "crowd": check_crowd}[what](int(port), *rest)
    print("\n".join(bad), file=sys.stderr)
    sys.exit(bool(bad))


main()
