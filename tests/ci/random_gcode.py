# SPDX-License-Identifier: Apache-2.0
"""Random programs for rs274.sh: random_gcode.py FOLDER COUNT SEED writes words-N.ngc. They keep away
from what only LinuxCNC's stand-alone interpreter gets wrong, not its machine: after a tool change, or
another unit, with a tool length in force, and with a tolerance of G64 in another unit than a canned
cycle's, it has lost something."""
import random
import sys

WORK = ["54", "55", "56", "57", "58", "59", "59.1", "59.2", "59.3"]
OVERRIDES = ["M48", "M49", "M50 P0", "M50", "M51 P0", "M51 P1", "M52", "M52 P0", "M53"]


class Program:
    def __init__(self, seed):
        self.random = random.Random(seed)
        self.mode, self.turning, self.inch = "94", False, False
        self.blocks = [f"G21 G90 G94 F{self.random.randint(50, 500)} G64 P0.01"]

    def some(self, low, high):
        return self.random.randint(low, high)

    def number(self):
        return f"{self.random.uniform(-50, 50):.{self.some(0, 3)}f}"

    def axes(self):
        words = [a + self.number() for a in "XYZ" if self.random.random() < 0.6]
        words += [a + self.number() for a in "ABC" if self.random.random() < 0.25]
        return " ".join(words) or "X1"

    def feed(self):
        if self.mode == "93":
            return f" F{self.random.uniform(0.5, 9):.3f}"
        return f" F{self.some(20, 400)}" if self.mode == "94" and self.random.random() < 0.2 else ""

    def straight(self):
        return [self.random.choice(["G1 ", "G0 "]) + self.axes() + self.feed()]

    def incremental(self):
        return ["G91 " + self.straight()[0], "G90"]

    def arc(self):
        i, j = self.some(1, 9), self.some(-9, 9)
        helix = self.random.choice(["", "", " Z1.5 A7"])
        return [f"G17 G91 G3 X{i + j} Y{j - i} I{i} J{j}{helix}{self.feed()}", "G90"]

    def dwell(self):
        return [f"G4 P{self.random.random():.2f}"]

    def work(self):
        return [f"G{self.random.choice(WORK)}"]

    def data(self):
        return [f"G10 L{self.random.choice([2, 20])} P{self.some(0, 9)} {self.axes()}"]

    def local(self):
        named = ["G92 " + self.axes(), "G52 " + self.axes()]
        return [self.random.choice(["G92.1", "G92.2", "G92.3"] + named)]

    def feed_mode(self):
        self.mode = self.random.choice(["93", "94", "95"] if self.turning else ["93", "94"])
        return [{"93": "G93", "94": "G94 F120", "95": "G95 F0.2"}[self.mode]]

    def speed_mode(self):
        surface = f"G96 S{self.some(5, 200)} D{self.some(100, 3000)}"
        return [self.random.choice([surface, f"G97 S{self.some(10, 3000)}"])]

    def spindle(self):
        if self.mode == "95":
            return []
        self.turning = self.random.random() < 0.7
        return [self.random.choice([f"M3 S{self.some(1, 999)}", "M4 S900"]) if self.turning else "M5"]

    def switches(self):
        control = ["G61", "G61.1", "G64", "G64 P0.05 Q0.01"]
        return [self.random.choice(OVERRIDES + control + ["M7", "M8", "M9"])]

    def tool(self):
        number = self.some(1, 4)
        return [self.random.choice([f"T{number}", f"G43 H{number}", "G49", "G43.1 Z" + self.number()])]

    def home(self):
        named = ["G28 " + self.axes(), "G30 A1", "G53 G0 " + self.axes()]
        return [self.random.choice(["G28", "G30", "G28.1", "G30.1"] + named)]

    def cycle(self):
        if self.mode != "94" or self.inch:
            return []
        words = f"X{self.number()} Y{self.number()} Z-5 R2 P.5 L{self.some(1, 2)}"
        return [f"G{self.random.choice([82, 89])} {words}", "G80 G0 Z9"]

    def value(self):
        return ["#1=[#1+1.5] (DEBUG,#1 #5423 #5220 #<_feed_override>)"]

    def unit(self):
        self.inch = not self.inch
        return ["G49 G64", "G20" if self.inch else "G21"]

    def write(self, path, count):
        kinds = [self.straight] * 5 + [self.arc] * 2 + [
            self.incremental, self.dwell, self.work, self.data, self.local, self.feed_mode,
            self.speed_mode, self.spindle, self.switches, self.switches, self.tool, self.home,
            self.cycle, self.value, self.unit]
        for _ in range(count):
            self.blocks += self.random.choice(kinds)()
        with open(path, "w") as file:
            file.write("\n".join(self.blocks + ["M2", ""]))


folder, count, seed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
for n in range(count):
    Program(seed + n).write(f"{folder}/words-{seed + n}.ngc", 40)
