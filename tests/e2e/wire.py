#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""wire.py PORT FILE: a delivery and run on a machine that is there, captured into FILE; prints how
many frames passed and how many of them are requests that write."""
import asyncio
import collections
import sys
import tempfile
from pathlib import Path

import cell
from proxy import Capture, Fate, Proxy


async def main():
    counts = collections.Counter()

    def judge(frame):
        counts["frames"] += 1
        counts["writes"] += frame.direction == "request" and frame.adu[7] == 23
        return Fate()

    capture = Capture(sys.argv[2])
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "program.ngc"
        file.write_bytes(cell.program(cuts=40))
        async with Proxy(int(sys.argv[1]), judge, capture=capture) as proxy:
            end, report = await cell.Agent(folder, proxy.port, window=16).send(file)
    capture.close()
    print(f"frames {counts['frames']}\nwrites {counts['writes']}\nsegmill {end} {report}")
    sys.exit(end)


asyncio.run(main())
