#!/usr/bin/env python3
"""The gather integrator against the path integrator in a few small rooms: gather_rooms.py BENCH_BAKES [ROOM...]

A quick form of bench/accuracy: the same texels from the same places, the noise of both taken out. Gather may be off by 1 % (relative RMSE), and by
twice what the noise that is left could hide."""

import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "..", "bench"))
import bakes

ALLOWED = 0.01
SAMPLES = {"cornell": 512, "windows": 512, "sheets": 512, "clutter": 512}
PAGE = {"clutter": 128, "sheets": 128}


def main():
    bakes.PROGRAM = os.path.abspath(sys.argv[1])
    failures = 0
    for name in sys.argv[2:] or SAMPLES:
        path = "integrator=path,samples=%d,salt=" % SAMPLES[name]
        b = bakes.bakes_of_room(name, ["samples=512,salt=3", "samples=512,salt=4", path + "1", path + "2"], page_size=PAGE.get(name, 64))
        error, hides = b.bias((0, 1), (2, 3))
        good = error <= ALLOWED + 2 * hides and b.texels > 300
        failures += not good
        print("%s: %s, off by %.2f %%, noise may hide %.2f %%, means %+.2f %%, %d texels" %
              (name, "passed" if good else "FAILED", 100 * error, 100 * hides, 100 * ((b.mean(0) + b.mean(1)) / (b.mean(2) + b.mean(3)) - 1), b.texels))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
