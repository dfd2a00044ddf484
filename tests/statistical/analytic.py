#!/usr/bin/env python3
"""Luxel against closed forms, case by case.

    analytic.py --list                  names of the cases
    analytic.py LUXEL [CASE...]         runs them with this program
    analytic.py LUXEL --table [CASE...] the same, as the tables of docs/accuracy.md

A case is a function of selftest.py, lamps.py, emitters.py, skies.py, panes.py, bounces.py, bakes.py,
leak_cases.py or monitors.py. It makes a scene, lets Luxel compute irradiance in it, and compares with what oracle.py says, which shares nothing with Luxel's sources. Seeds are fixed: a case passes
always or never.
"""

import os
import shutil
import sys
import tempfile
import time

import measure
import selftest, lamps, emitters, skies, panes, bounces, bakes, leak_cases, monitors, convergence


GROUPS = {"lamps": "Lamps", "emitters": "Emissive surfaces", "skies": "Skies", "panes": "Panes, holes, glass",
          "bounces": "Bounced light, scales, leaks", "bakes": "Baked texels and layers", "leak_cases": "Light where none may be", "monitors": "Monitors", "convergence": "Convergence",
          "selftest": "The oracles themselves"}


def print_table():
    for module, title in GROUPS.items():
        rows = [(name, row) for name, row in measure.ROWS if measure.CASES[name].__module__ == module]
        if not rows:
            continue
        print("### %s\n" % title)
        print("| case | what is compared | points | samples | expected | got | error | allowed |")
        print("|---|---|--:|--:|--:|--:|--:|--:|")
        for name, row in rows:
            print("| %s | %s | %d | %s | %.6g | %.6g | %.1e | %g |" % (name.replace("_", " "), row.what, row.points, row.samples or "–",
                                                                     row.expected, row.got, row.error, row.tolerance))
        print()


def run(name):
    """True: passed. What was measured goes to measure.ROWS in either case."""
    folder = tempfile.mkdtemp(prefix="luxel-analytic-")
    os.chdir(folder)
    measure.ROWS, before = [], measure.ROWS
    begin, failure = time.monotonic(), None
    try:
        measure.CASES[name]()
    except measure.Failed as failed:
        failure = failed
    finally:
        os.chdir(measure.ROOT)
        shutil.rmtree(folder, ignore_errors=True)
    worst = max((row.error / row.tolerance for row in measure.ROWS), default=0)
    measure.ROWS = before + [(name, row) for row in measure.ROWS]
    said = "FAILED: %s" % failure if failure else "passed, at worst %.0f %% of what is allowed" % (100 * worst)
    print("%s: %s (%.1f s)" % (name, said, time.monotonic() - begin), file=sys.stderr)
    return failure is None


def main():
    arguments = sys.argv[1:]
    if arguments == ["--list"]:
        print("\n".join(measure.CASES))
        return 0
    table = "--table" in arguments
    arguments = [a for a in arguments if a != "--table"]
    if not arguments:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    measure.harness.PROGRAM = os.path.abspath(arguments[0])
    failures = [name for name in arguments[1:] or measure.CASES if not run(name)]
    if table:
        print_table()
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
