"""The oracles agree with each other where they overlap."""

import math

import oracle
from gltf import v_norm
from measure import case, compare, grey


def agree(what, first, second, tolerance):
    compare(what, grey(first), grey(second), tolerance, 0)


@case
def oracles_for_rectangles_agree():
    up = (0, 0, 1)
    flat = [(x, y, 2) for x, y in ((0, 0), (3, 0), (3, 1.5), (0, 1.5))]
    agree("B-3 and Lambert", [oracle.parallel_rectangle(3, 1.5, 2)], [oracle.polygon(flat, (0, 0, 0), up)], 1e-12)
    wall = [(0, 0.7, 0), (2, 0.7, 0), (2, 0.7, 3), (0, 0.7, 3)]
    agree("B-4 and Lambert", [oracle.perpendicular_rectangle(2, 3, 0.7)], [oracle.polygon(wall, (0, 0, 0), up)], 1e-12)
    lower = [(x, y, z - 1) for x, y, z in wall]
    agree("B-4 and Lambert cut by the horizon", [oracle.perpendicular_rectangle(2, 2, 0.7)], [oracle.polygon(lower, (0, 0, 0), up)], 1e-12)


@case
def oracles_for_disks_and_spheres_agree():
    up = (0, 0, 1)
    first = [oracle.parallel_disk(0.7, h, o) for h in (0.2, 1, 3) for o in (0, 0.4, 2)]
    rim = [oracle.polygon(oracle.ellipse((o, 0, h), (0.7, 0, 0), (0, 0.7, 0)), (0, 0, 0), up) for h in (0.2, 1, 3) for o in (0, 0.4, 2)]
    agree("B-13 and Lambert of 720 corners", first, rim, 1e-4)
    angles = [(a, h) for h in (0.05, 0.5, 1.2) for a in (0, 0.3, 1.0, 1.5, 1.57, 1.6) if a < math.pi / 2 + 0.9 * h]
    agree("Snyder and quadrature", [oracle.sphere(a, h) for a, h in angles], [oracle.cap_by_quadrature(a, h) for a, h in angles], 1e-4)
    # A disk of the same outline gives what the sphere gives, wherever the horizon is.
    half, distance = 0.5, 2.0
    axis = v_norm((math.sin(1.4), 0, math.cos(1.4)))
    t, b = oracle.tangents(axis)
    radius = distance * math.tan(half)
    outline = oracle.ellipse(tuple(distance * c for c in axis), tuple(radius * c for c in t), tuple(radius * c for c in b))
    agree("Snyder and Lambert", [oracle.sphere(1.4, half)], [oracle.polygon(outline, (0, 0, 0), up)], 1e-4)


@case
def oracle_for_skies_integrates_one_colour_to_pi():
    sky = oracle.SkyPicture([[1.0] * 32 for _ in range(16)], 30)
    agree("pi", [math.pi] * 3, sky.irradiance([(0, 1, 0), v_norm((1, 2, -3)), (0, 0, -1)]), 1e-3)


@case
def oracle_for_cubes_conserves_light_and_has_converged():
    even = oracle.CubeRadiosity(4, [0.5] * 6, [1] * 6)
    points = [((0.3, 0.6, 0), (0, 0, 1)), ((1, 0.3, 0.7), (-1, 0, 0))]
    agree("furnace", [2 * math.pi] * 2, [even.irradiance(p, n) for p, n in points], 1e-5)
    albedo, emission = [0.5, 0.5, 0.7, 0.0, 0.3, 0.8], [0, 0, 0, 10, 0, 0]
    coarse, fine = (oracle.CubeRadiosity(n, albedo, emission) for n in (6, 10))
    agree("6 and 10 patches an edge", [fine.irradiance(p, n) for p, n in points], [coarse.irradiance(p, n) for p, n in points], 3e-3)
