"""Runs Luxel on a scene made on the spot, compares with what should be, and keeps the score. See analytic.py."""

import math
import os
import sys

sys.dont_write_bytecode = True
HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
sys.path[:0] = [os.path.join(ROOT, "scenes"), os.path.join(ROOT, "tests", "cli"), HERE]

import harness
from gltf import quad
from harness import Failed, expect, luxel

CASES = {}
ROWS = []  # of the table: Row, in the order of the checks
EXACT = 2e-5  # nothing is sampled; what remains is the rounding of 24-bit floats


def case(function):
    """Registers a function as a test case; it runs in an empty folder of its own."""
    CASES[function.__name__] = function
    return function


PATH = ("--integrator", "path")
GATHER = ("--integrator", "gather", "--noise", "0", "--denoise", "none")
integrator = PATH  # of the bakes of the case at work


def both(function):
    """Registers a function that bakes twice: with the path integrator, and with the gather integrator as NAME_by_gathering."""
    def with_integrator(options):
        def run():
            global integrator
            integrator = options
            try:
                function()
            finally:
                integrator = PATH
        run.__module__ = function.__module__
        return run
    CASES[function.__name__] = function
    CASES[function.__name__ + "_by_gathering"] = with_integrator(GATHER)
    return function


def limit(path, gather):
    """A tolerance that depends on the integrator."""
    return path if integrator == PATH else gather


class Row:
    def __init__(self, what, expected, got, error, tolerance, points, samples):
        self.what, self.expected, self.got, self.error = what, expected, got, error
        self.tolerance, self.points, self.samples = tolerance, points, samples


def irradiance(scene, points, samples, bounces, *options):
    """[(r, g, b)] at [(position, normal)]."""
    if "meshes" not in scene.json:  # a scene needs something to bake: a speck out of the way
        speck = quad(1e-3, 1e-3).translate(0, 1e4, 0)
        scene.add_node("speck", mesh=scene.add_mesh("speck", (speck, scene.add_material("black", base_color=(0, 0, 0)))))
    scene.save("scene.glb")
    with open("points.csv", "w") as file:
        for position, normal in points:
            file.write(",".join("%.9g" % c for c in (*position, *normal)) + "\n")
    luxel("irradiance", "scene.glb", "--points", "points.csv", "-o", "lux.csv", "--quiet", "--samples", str(samples),
          "--bounces", str(bounces), *options, timeout=600)
    with open("lux.csv") as file:
        rows = [[float(c) for c in line.split(",")[6:]] for line in file.readlines()[1:]]
    expect(len(rows) == len(points), "%d results for %d points" % (len(rows), len(points)))
    return rows


def grey(values):
    return [(v, v, v) for v in values]


def times(values, color):
    return [tuple(v * c for c in color) for v in values]


def note(row, detail=""):
    ROWS.append(row)
    expect(row.error <= row.tolerance, "%s: expected %.7g, got %.7g: off by %.3g, allowed are %.3g%s" %
           (row.what, row.expected, row.got, row.error, row.tolerance, detail))


def compare(what, expected, got, tolerance, samples, dark=1e-6):
    """Every channel of every point within the relative tolerance; where 0 is expected, below `dark` times the largest."""
    largest = max(max(e) for e in expected)
    worst = (-1.0, 0.0, 0.0, 0)
    for k, (e, g) in enumerate(zip(expected, got)):
        for a, b in zip(e, g):
            error = abs(b - a) / a if a else (0.0 if abs(b) <= dark * (largest or 1) else math.inf)
            if not error >= 0:
                error = math.inf  # not a number
            if error > worst[0]:
                worst = (error, a, b, k)
    note(Row(what, worst[1], worst[2], worst[0], tolerance, len(expected), samples), " (point %d)" % worst[3])


def compare_mean(what, expected, values, tolerance, samples):
    """The mean of many points: one number."""
    got = math.fsum(values) / len(values)
    note(Row(what, expected, got, abs(got - expected) / expected, tolerance, len(values), samples))


def below(what, limit, values, samples):
    got = max(values)
    note(Row(what, 0.0, got, got, limit, len(values), samples))
