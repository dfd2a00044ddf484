"""Where ratios are kept: bench/results/MACHINE.csv."""

import csv
import datetime
import os
import platform
import re

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "results")


def write_rows(rows):
    """rows: (what, ratio, parts)."""
    cpu = re.sub(r"\W+", "_", next((line.split(":")[1] for line in open("/proc/cpuinfo") if line.startswith("model name")),
                                   platform.machine())).strip("_").lower()
    path = os.path.join(FOLDER, "%s_%d_cores.csv" % (cpu, os.cpu_count()))
    os.makedirs(FOLDER, exist_ok=True)
    fresh = not os.path.exists(path)
    with open(path, "a", newline="") as file:
        writer = csv.writer(file)
        if fresh:
            writer.writerow(("date", "what", "ratio", "parts"))
        for what, ratio, parts in rows:
            writer.writerow((datetime.date.today().isoformat(), what, "%.4f" % ratio, parts))
    print("written to", os.path.relpath(path))
