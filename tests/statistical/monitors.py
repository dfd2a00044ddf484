"""Monitors: each cell's light where it belongs, cells that add up to the whole screen, and what a coarse grid costs."""

import math

import measure
import oracle
import textures
from bakes import UP, bake
from gltf import Gltf, box, grid, quad, quat, quat_rotate, v_add, v_dot, v_sub
from harness import expect
from lamps import node
from measure import Row, both, case, compare, compare_mean, grey

WIDTH, HEIGHT = 1.6, 0.9
PLACE, TURN = (0.2, 0.9, -0.6), quat((1, 0, 0), 35)  # leans over the floor, its picture towards +z and down
FLOOR = (3.0, 2.0)
PAGE = 48
LEFT, RIGHT, TOP, BOTTOM = 0.1, 0.7, 0.1, 0.9  # of the floor in the lightmap; screens lie at its right, far enough for padding


def screen(columns, rows, mesh=None, picture=None, color=(1, 1, 1), strength=10, scene=None, name="tv", place=PLACE, turn=TURN, layer=None,
           **extras):
    """A floor below a screen; columns 0: an ordinary emitter."""
    fresh = scene is None
    scene = scene or Gltf()
    emission = scene.add_material("shine", base_color=(0, 0, 0), emissive=color, emissive_texture=picture and picture(scene), strength=strength)
    if columns:
        extras["luxel_monitor"] = "%dx%d" % (columns, rows)
    if layer:
        extras["luxel_layer"] = layer
    mesh = mesh or quad(WIDTH, HEIGHT, fit=True)
    low, high = (TOP, 0.4) if fresh else (0.6, BOTTOM)
    mesh.uv1 = [(0.85 + 0.1 * (x / WIDTH + 0.5), high - (high - low) * (y / HEIGHT + 0.5)) for x, y, _ in mesh.positions]
    node(scene, name, mesh=scene.add_mesh(name, (mesh, emission)), translation=place, rotation=turn, extras=extras or None)
    if fresh:
        floor = quad(*FLOOR)
        floor.uv1 = [(LEFT, BOTTOM), (RIGHT, BOTTOM), (RIGHT, TOP), (LEFT, TOP)]
        grey_paint = scene.add_material("floor", base_color=(0.5, 0.5, 0.5))
        node(scene, "floor", mesh=scene.add_mesh("floor", (floor, grey_paint)), rotation=UP)
    return scene


def floor_texels(baked, channels, irradiance_at):
    """(expected, got) of all texels that the floor covers whole. It faces up; the top of the page is at -z."""
    expected, got = [], []
    for j in range(PAGE):
        for i in range(PAGE):
            if i / PAGE < LEFT or (i + 1) / PAGE > RIGHT or j / PAGE < TOP or (j + 1) / PAGE > BOTTOM:
                continue
            total = 0.0
            for a, b in ((0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)):
                u, v = ((i + a) / PAGE - LEFT) / (RIGHT - LEFT), ((j + b) / PAGE - TOP) / (BOTTOM - TOP)
                total += irradiance_at(((u - 0.5) * FLOOR[0], 0.0, (v - 0.5) * FLOOR[1]), (0, 1, 0)) / 4
            expected.append(total)
            got.append(tuple(c[j * PAGE + i] for c in channels))
    return expected, got


def cell_corners(columns, rows, cell, place=PLACE, turn=TURN, mirrored=False):
    """The part of the screen whose TEXCOORD_0 lies in a cell; v runs down, u to the right as seen from the front."""
    column, row = cell % columns, cell // columns
    if mirrored:
        column = columns - 1 - column
    centre = ((column + 0.5) / columns - 0.5) * WIDTH, (0.5 - (row + 0.5) / rows) * HEIGHT
    at = v_add(place, quat_rotate(turn, (*centre, 0)))
    return oracle.rectangle(at, quat_rotate(turn, (WIDTH / columns / 2, 0, 0)), quat_rotate(turn, (0, HEIGHT / rows / 2, 0)))


def light_of(corners):
    def light(p, n):
        return math.pi * oracle.polygon(corners, p, n) if oracle.faces(corners, p) else 0.0
    return light


def compare_cells(what, baked, columns, rows, samples, tolerance, corners_of):
    """Every cell against Lambert's formula: the mean of the floor, and each texel within its noise."""
    for cell in range(columns * rows):
        expected, got = floor_texels(baked, baked.layers["tv/%d" % cell], light_of(corners_of(cell)))
        strong = max(expected) / 5
        kept = [k for k, e in enumerate(expected) if e > strong]
        compare("%s, cell %d, each texel" % (what, cell), grey([expected[k] for k in kept]), [got[k] for k in kept], tolerance, samples)
        compare_mean("%s, cell %d, mean of the floor" % (what, cell), math.fsum(expected) / len(expected), [g[0] for g in got], 0.004, samples)


@both
def cells_of_a_monitor_light_the_floor_from_their_places():
    baked = bake(screen(3, 2), "out", PAGE, 1024, 0)
    expect(sorted(baked.layers) == ["tv/%d" % k for k in range(6)], "layers %s" % sorted(baked.layers))
    compare_cells("3 by 2", baked, 3, 2, 1024, 0.06, lambda cell: cell_corners(3, 2, cell))


@both
def cells_follow_texture_coordinates_not_corners():
    # u runs from right to left, in a mesh of many triangles whose edges are not the cells'.
    mesh = grid(WIDTH, HEIGHT, 5, 4, fit=True).scale_uv(-1, 1).shift_uv(1, 0)
    baked = bake(screen(2, 3, mesh), "out", PAGE, 1024, 0)
    compare_cells("mirrored", baked, 2, 3, 1024, 0.06, lambda cell: cell_corners(2, 3, cell, mirrored=True))


def room(columns, rows):
    scene = screen(columns, rows, color=(1, 0.5, 0.25))
    wall = scene.add_material("wall", base_color=(0.6, 0.5, 0.4))
    node(scene, "room", mesh=scene.add_mesh("room", (box(3.2, 2.2, 2.2, (0, 1.0, 0)).flip(), wall)))
    return scene


@both
def cells_at_one_colour_add_up_to_the_whole_screen():
    whole = bake(room(0, 0), "whole", 64, 1024, 4)
    expected = whole.sum()
    texels = whole.texels()
    for columns, rows, rounding, noise in ((1, 1, 1e-6, 1e-6), (4, 3, 3e-4, 5e-3)):  # one cell: the same paths; more: noise of 0.2 % a texel
        got = bake(room(columns, rows), "cells %d" % columns, 64, 1024, 4).sum()
        rounding = measure.limit(rounding, 1e-3)  # gather: other samples at near hits, half floats in the cache
        for c, channel in enumerate("red green blue".split()):
            mean = math.fsum(expected[c][t] for t in texels) / len(texels)
            compare_mean("%d by %d, %s" % (columns, rows, channel), mean, [got[c][t] for t in texels], rounding, 1024)
        error = math.sqrt(math.fsum((got[c][t] - expected[c][t]) ** 2 for c in range(3) for t in texels) /
                          math.fsum(expected[c][t] ** 2 for c in range(3) for t in texels))
        measure.below("%d by %d, RMSE of texels, relative" % (columns, rows), measure.limit(noise, 5e-3), [error], 1024)


@both
def monitors_that_share_their_cells_add_up_in_each():
    places = [(PLACE, TURN), ((0.9, 1.1, 0.5), quat((1, 0, 0), 90))]
    scene = screen(2, 2, layer="tv")
    screen(2, 2, scene=scene, name="second", place=places[1][0], turn=places[1][1], strength=5, layer="tv")
    baked = bake(scene, "out", PAGE, 1024, 0)
    expect(sorted(baked.layers) == ["tv/%d" % k for k in range(4)], "layers %s" % sorted(baked.layers))
    for cell in range(4):
        lights = [light_of(cell_corners(2, 2, cell, *place)) for place in places]
        expected, got = floor_texels(baked, baked.layers["tv/%d" % cell], lambda p, n: lights[0](p, n) + 0.5 * lights[1](p, n))
        compare_mean("cell %d of both" % cell, math.fsum(expected) / len(expected), [g[0] for g in got], 0.004, 1024)


LETTER = ["####.", "#...#", "####.", "#..#.", "#...#"]  # an R: no mirror image and no turn of it is an R


@both
def letter_on_a_monitor_lights_the_floor_as_it_reads():
    def picture(scene):
        pixels = bytes(255 if c == "#" else 0 for row in LETTER for c in row for _ in range(3))
        return scene.add_image("letter", 5, 5, pixels, wrap=False, nearest=True)
    baked = bake(screen(5, 5, picture=picture), "out", PAGE, 1024, 0)
    lit = [k for k in range(25) if LETTER[k // 5][k % 5] == "#"]
    for k in range(25):
        expect(baked.factor("tv/%d" % k) == [10.0 * (k in lit)] * 3, "cell %d is authored as %s" % (k, baked.factor("tv/%d" % k)))
    lights = [light_of(cell_corners(5, 5, k)) for k in lit]
    expected, got = floor_texels(baked, baked.sum(), lambda p, n: 10 * math.fsum(l(p, n) for l in lights))
    strong = max(expected) / 5
    kept = [k for k, e in enumerate(expected) if e > strong]
    compare("each texel", grey([expected[k] for k in kept]), [got[k] for k in kept], 0.03, 1024)


# What the RMSE of direct light may be, relative to its mean, for two pictures: what a cell blurs, and some noise. As measured, and a quarter more.
GRIDS = ((1, 1, 0.077, 0.16), (2, 2, 0.077, 0.073), (4, 4, 0.012, 0.028), (8, 8, 0.011, 0.0075), (16, 9, 0.007, 0.005))


@case
def picture_on_a_coarse_grid_is_off_by_what_its_cells_blur():
    for number, (name, painted) in enumerate((("test card", textures.test_card()), ("painting", textures.artwork(0)))):
        width, height, pixels, channels = painted

        def lit_room(columns, rows):
            scene = screen(columns, rows, picture=lambda s: s.add_image(name, width, height, pixels, channels, wrap=False),
                           place=(0, 0.9, -0.9), turn=(0, 0, 0, 1))
            wall = scene.add_material("wall", base_color=(0.6, 0.6, 0.6))
            node(scene, "room", mesh=scene.add_mesh("room", (box(3, 2, 2, (0, 1.0, 0)).flip(), wall)))
            return scene
        truth = bake(lit_room(0, 0), "truth " + name, 48, 16384, 0)
        expected, texels = truth.sum(), truth.texels()
        mean = math.fsum(expected[c][t] for c in range(3) for t in texels) / (3 * len(texels))
        for columns, rows, *tolerances in GRIDS:
            got = bake(lit_room(columns, rows), "%s %d" % (name, columns), 48, 1024, 0).sum()
            square = math.fsum((got[c][t] - expected[c][t]) ** 2 for c in range(3) for t in texels) / (3 * len(texels))
            total = math.fsum(got[c][t] for c in range(3) for t in texels) / (3 * len(texels))
            measure.note(Row("%s, %d by %d: RMSE of texels over their mean" % (name, columns, rows), mean, total, math.sqrt(square) / mean,
                             tolerances[number], len(texels), 1024))
