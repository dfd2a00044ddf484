"""Surfaces that shine: emissive rectangles, spheres and pictures."""

import math
import random

import oracle
from gltf import Gltf, box, grid, quad, quat, quat_rotate, sphere, v_add, v_dot, v_len, v_mul, v_norm, v_sub
from lamps import COLOR, DOWN, direction, node, receivers
from measure import case, compare, compare_mean, grey, irradiance, times

NIT = [100 * c for c in COLOR]


def panel(mesh, place=(0, 0, 0), rotation=None, scale=None, double_sided=False, **material):
    scene = Gltf()
    shine = scene.add_material("shine", base_color=(0, 0, 0), emissive=material.pop("emissive", COLOR), strength=100,
                               double_sided=double_sided, **material)
    node(scene, "panel", mesh=scene.add_mesh("panel", (mesh, shine)), translation=place, rotation=rotation, scale=scale)
    return scene


def world_triangles(mesh, place=(0, 0, 0), rotation=(0, 0, 0, 1), scale=(1, 1, 1)):
    """Corners, counter-clockwise from the front; a mirrored instance keeps its front side."""
    mirrored = scale[0] * scale[1] * scale[2] < 0
    at = [v_add(place, quat_rotate(rotation, tuple(c * s for c, s in zip(p, scale)))) for p in mesh.positions]
    out = []
    for k in range(0, len(mesh.indices), 3):
        a, b, c = (at[i] for i in mesh.indices[k:k + 3])
        out.append([a, c, b] if mirrored else [a, b, c])
    return out


def lambert(triangles, points, double_sided=False):
    """For triangles that do not hide each other from the points."""
    out = []
    for p, n in points:
        out.append(math.fsum(oracle.polygon(t, p, n) for t in triangles if double_sided or oracle.faces(t, p)))
    return out


def worth_comparing(points, expected, least):
    """Drops what is grazed: lit a little, by what just looks over the horizon."""
    kept = [(p, e) for p, e in zip(points, expected) if e == 0 or e > least]
    return [p for p, _ in kept], [e for _, e in kept]


def times_pi(expected):
    return times(expected, [math.pi * c for c in NIT])


@case
def emissive_rectangle_meets_lamberts_formula_and_is_dark_behind():
    place, turn = (0.4, 0.3, -0.2), quat((3, 1, 2), 50)
    shape = quad(2, 1)
    points = receivers(300, 0.3, 3, place)
    points, expected = worth_comparing(points, lambert(world_triangles(shape, place, turn), points), 0.005)
    got = irradiance(panel(shape, place, turn), points, 16384, 0)
    compare("anywhere, dark behind", times_pi(expected), got, 0.01, 16384)


@case
def emissive_rectangle_with_two_sides_shines_on_both():
    place, turn = (0.4, 0.3, -0.2), quat((3, 1, 2), 50)
    shape = quad(2, 1)
    points = receivers(150, 0.3, 3, place)
    points, expected = worth_comparing(points, lambert(world_triangles(shape, place, turn), points, True), 0.005)
    got = irradiance(panel(shape, place, turn, double_sided=True), points, 65536, 0)
    compare("anywhere", times_pi(expected), got, 0.01, 65536)


@case
def emissive_rectangle_close_by_fills_the_view():
    points = [((0, -h, 0), (0, 1, 0)) for h in (1e-4, 1e-3, 0.01, 0.1)]
    expected = [4 * oracle.parallel_rectangle(1, 1, -p[1]) for p, _ in points]
    got = irradiance(panel(quad(2, 2), rotation=quat((1, 0, 0), 90)), points, 16384, 0)
    compare("down to a ten-thousandth of its size", times_pi(expected), got, 2e-3, 16384)


@case
def emissive_rectangle_far_away_follows_the_square_of_distance():
    points = [((0, -h, 0), (0, 1, 0)) for h in (10, 100, 1000)]
    expected = [4 * oracle.parallel_rectangle(0.5, 0.5, -p[1]) for p, _ in points]
    got = irradiance(panel(quad(1, 1), rotation=quat((1, 0, 0), 90)), points, 4096, 0)
    compare("up to a thousand times its size", times_pi(expected), got, 2e-3, 4096)


@case
def emissive_mesh_of_many_triangles_equals_one_rectangle():
    place, turn = (0, 1, 0), quat((1, 0, 0), 90)
    points = receivers(60, 0.5, 3, place)
    points, expected = worth_comparing(points, lambert(world_triangles(quad(2, 1), place, turn), points), 0.005)
    got = irradiance(panel(grid(2, 1, 37, 5), place, turn), points, 16384, 0)
    compare("370 triangles", times_pi(expected), got, 0.01, 16384)


@case
def emissive_bar_close_by_meets_the_sum_over_its_triangles():
    # Long and thin: what is near and faces the point gives most of the light, wherever along the bar the point lies.
    shape = box(6, 0.1, 0.1)
    points = [((x, y, z), v_norm((0.2, -y, -z))) for x in (-2.8, -1, 0.3, 2.5, 3.4) for y, z in ((0.15, 0), (0.1, -0.3), (-0.5, 0.6))]
    got = irradiance(panel(shape), points, 16384, 0)
    compare("12 triangles", times_pi(lambert(world_triangles(shape), points)), got, 0.01, 16384)


@case
def emissive_sphere_meets_the_sum_over_its_triangles():
    shape = sphere(0.5, 48, 24)
    points = receivers(40, 0.8, 4, (0, 0, 0))
    points, expected = worth_comparing(points, lambert(world_triangles(shape), points), 0.005)
    got = irradiance(panel(shape), points, 65536, 0)
    compare("2208 triangles", times_pi(expected), got, 0.01, 65536)


@case
def emissive_sphere_approaches_the_closed_form_of_a_sphere():
    points = [((0, 0, -d), (math.sin(a), 0, math.cos(a))) for d in (0.7, 2) for a in (0, 0.8, 1.4, 1.8)]
    expected = []
    for p, n in points:
        expected.append(oracle.sphere(math.acos(n[2]), math.asin(0.5 / -p[2])))
    points, expected = worth_comparing(points, expected, 0.005)
    # A polyhedron with corners on the sphere lies inside it: seen from afar it is smaller by about a thousandth.
    got = irradiance(panel(sphere(0.5, 96, 64)), points, 65536, 0)
    compare("mesh of 96 × 64 against a round sphere", times_pi(expected), got, 0.01, 65536)


# --- Instances --------------------------------------------------------------------------------------------------------


@case
def emitter_mirrored_and_stretched_equals_the_plain_mesh():
    shape = quad(1, 1)
    for scale in ((-1, 1, 1), (1, -2, 1), (3, 0.5, 2), (-0.5, -2, 1), (1.5, 1, -1), (-1, -1, -3)):
        place, turn = (0.2, 0.4, -0.1), quat((1, 3, -2), 110)
        points = receivers(60, 0.5, 3, place)
        triangles = world_triangles(shape, place, turn, scale)
        points, expected = worth_comparing(points, lambert(triangles, points), 0.005)
        got = irradiance(panel(shape, place, turn, scale), points, 16384, 0)
        compare("scale %g %g %g" % scale, times_pi(expected), got, 0.01, 16384)


@case
def emitter_sheared_by_two_nodes_meets_lamberts_formula():
    scene = panel(quad(1, 1), rotation=quat((0, 0, 1), 40))
    outer = node(scene, "outer", rotation=quat((1, 0, 0), 90), scale=(2, 0.6, 1))
    scene.json["scenes"][0]["nodes"].remove(0)
    scene.json["nodes"][outer]["children"] = [0]
    corners = []
    for p in quad(1, 1).positions:
        x, y, z = quat_rotate(quat((0, 0, 1), 40), p)
        corners.append(quat_rotate(quat((1, 0, 0), 90), (2 * x, 0.6 * y, z)))
    points = receivers(60, 0.5, 3, (0, 0, 0))
    expected = [oracle.polygon(corners, p, n) if oracle.faces(corners, p) else 0.0 for p, n in points]
    points, expected = worth_comparing(points, expected, 0.005)
    compare("turned, then stretched", times_pi(expected), irradiance(scene, points, 8192, 0), 0.01, 8192)


@case
def two_instances_of_one_emitter_add_up():
    scene = Gltf()
    shine = scene.add_material("shine", base_color=(0, 0, 0), emissive=COLOR, strength=100)
    shape = quad(1, 1)
    mesh = scene.add_mesh("panel", (shape, shine))
    places = [((-1, 2, 0), DOWN, (1, 1, 1)), ((3, 2.5, 0.5), quat((1, 0, 0.4), -70), (2, 0.5, 1))]
    triangles = []
    for k, (place, turn, scale) in enumerate(places):
        node(scene, "panel %d" % k, mesh=mesh, translation=place, rotation=quat_back(turn), scale=scale)
        triangles += world_triangles(shape, place, quat_back(turn), scale)
    points = [((0.4 * k - 1, 0, 0.1 * k), (0, 1, 0)) for k in range(6)]
    got = irradiance(scene, points, 4096, 0)
    compare("two panels, one mesh", times_pi(lambert(triangles, points)), got, 5e-3, 4096)


def quat_back(q):
    """The opposite turn: DOWN points -Z down, this points +Z down, where meshes have their front."""
    return (-q[0], -q[1], -q[2], q[3])


# --- Pictures ---------------------------------------------------------------------------------------------------------


def striped(columns, nearest, mesh=None):
    """A panel of 2 by 1, front down, with a picture of one row (sRGB bytes); its left is at -x."""
    scene = Gltf()
    pixels = bytes(b for c in columns for b in (c, c, c))
    picture = scene.add_image("stripes", len(columns), 1, pixels, wrap=False, nearest=nearest)
    shine = scene.add_material("shine", base_color=(0, 0, 0), emissive=(1, 1, 1), emissive_texture=picture, strength=100)
    scene.add_node("panel", mesh=scene.add_mesh("panel", (mesh or quad(2, 1, fit=True), shine)), rotation=quat((1, 0, 0), 90))
    return scene


def strips(columns, nearest, points, steps):
    """Lambert over strips, `steps` a column: their centres' brightness, linear between the columns' centres."""
    light = [oracle.srgb(c) for c in columns]
    count = len(columns) * steps
    out = [0.0] * len(points)
    for k in range(count):
        x = (k + 0.5) / steps
        if nearest:
            value = light[int(x)]
        else:
            left = math.floor(x - 0.5)
            a, b = light[max(0, left)], light[min(len(light) - 1, left + 1)]
            value = a + (b - a) * (x - 0.5 - left)
        if value == 0:
            continue
        strip = oracle.rectangle((-1 + 2 * (k + 0.5) / count, 0, 0), (1 / count, 0, 0), (0, 0, 0.5))
        for i, (p, n) in enumerate(points):
            out[i] += value * oracle.polygon(strip, p, n)
    return out


BELOW = [((x, -h, z), v_norm((a, 1, 0.1))) for x, h, z, a in
         ((0, 1, 0, 0), (-0.6, 0.3, 0.2, 0), (0.7, 0.2, -0.3, 0.5), (1.5, 0.5, 0, -1), (0, 0.05, 0, 0), (-3, 2, 1, 0.8))]


@case
def emissive_picture_half_black_shines_with_its_white_half():
    columns = [255] * 4 + [0] * 4
    expected = strips(columns, True, BELOW, 1)
    got = irradiance(striped(columns, True), BELOW, 16384, 0)
    compare("nearest pixels", grey([100 * math.pi * e for e in expected]), got, 0.01, 16384)


@case
def emissive_picture_blends_between_its_pixels():
    columns = [255, 0]
    expected = strips(columns, False, BELOW, 64)
    got = irradiance(striped(columns, False), BELOW, 16384, 0)
    compare("two pixels, linear between them", grey([100 * math.pi * e for e in expected]), got, 0.01, 16384)


@case
def emissive_picture_with_a_gradient_is_decoded_from_srgb():
    columns = [int(255 * k / 31) for k in range(32)]
    expected = strips(columns, False, BELOW, 4)
    got = irradiance(striped(columns, False), BELOW, 16384, 0)
    compare("32 shades", grey([100 * math.pi * e for e in expected]), got, 0.01, 16384)


@case
def emissive_picture_with_one_bright_pixel_in_a_thousand():
    columns = [0] * 1000
    columns[617] = 255
    expected = strips(columns, True, BELOW, 1)
    got = irradiance(striped(columns, True), BELOW, 65536, 0)
    compare("nearest pixels", grey([100 * math.pi * e for e in expected]), got, 0.02, 65536)


@case
def emissive_picture_repeated_on_a_grid_of_triangles():
    # Texture coordinates run 0..3 over the panel, in a mesh of many triangles; the sampler repeats.
    columns = [255, 255, 0, 80]
    scene = striped(columns, True, grid(2, 1, 7, 3, fit=True).scale_uv(3, 1))
    scene.json["samplers"][0]["wrapS"] = 10497
    expected = strips(columns * 3, True, BELOW, 1)
    got = irradiance(scene, BELOW, 16384, 0)
    compare("three times four stripes", grey([100 * math.pi * e for e in expected]), got, 0.01, 16384)


@case
def emitter_hidden_in_part_meets_lamberts_formula():
    scene = panel(quad(2, 1), (0, 2, 0), quat((1, 0, 0), 90))
    black = scene.add_material("black", base_color=(0, 0, 0), double_sided=True)
    scene.add_node("half", mesh=scene.add_mesh("half", (quad(10, 10).translate(5, 0, 0), black)), translation=(0, 1, 0),
                   rotation=DOWN)
    corners = oracle.rectangle((0, 2, 0), (1, 0, 0), (0, 0, 0.5))
    points, expected = [], []
    for x in (-0.4, -0.2, 0.0, 0.2, 0.4):
        points.append(((x, 0, 0.1), (0, 1, 0)))
        expected.append(oracle.polygon(oracle.cut(corners, (-x, 2, 0), (-1, 0, 0)), *points[-1]))
    compare("the part seen past an edge", times_pi(expected), irradiance(scene, points, 65536, 0), 0.01, 65536)
