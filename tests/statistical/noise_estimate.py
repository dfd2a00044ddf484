#!/usr/bin/env python3
"""The estimated noise against the real one in small rooms: noise_estimate.py BENCH_BAKES [ROOM...]

The truth is a bake of many more and other samples at the same sites. The estimate may be off by a fifth: few texels count in a small room, and tails are long."""

import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "..", "bench"))
import bakes

LEAST, MOST = 0.8, 1.25  # of the real noise over the estimate
ROOMS = ("cornell", "white_room", "courtyard", "round_things")
SAMPLES = (64, 256)


def main():
    bakes.PROGRAM = os.path.abspath(sys.argv[1])
    failures = 0
    for name in sys.argv[2:] or ROOMS:
        b = bakes.bakes_of_room(name, ["samples=%d" % n for n in SAMPLES] + ["samples=2048,salt=1,interpolation=0"], page_size=128, borders=1)
        for samples, bake in zip(SAMPLES, b.bakes):
            ratio = bake["off_by"] / bake["noise"]
            good = LEAST <= ratio <= MOST
            failures += not good
            print("%s, %d samples: %s, noise %.2f %%, estimated %.2f %%, ratio %.2f" %
                  (name, samples, "passed" if good else "FAILED", 100 * bake["off_by"], 100 * bake["noise"], ratio))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
