#!/usr/bin/env python3
"""Writes the room that the tests of the viewer bake: viewer_room.py OUT.glb

Closed and white. Below, two open boxes with a lamp in each, so that each lamp has pixels that are its own; above, a screen of 4 × 2 cells
between a left and a right wall. In front a tinted pane and one that blends, to be looked through.
"""

import os
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scenes"))
from gltf import Gltf, box_between, look, merge, quad  # noqa: E402


def open_box(width, height, depth, thick):
    """Walls, floor, ceiling and back around the origin, open towards +Z, standing on y = 0."""
    x, t = width / 2, thick
    return merge(
        box_between((-x - t, 0, -depth - t), (x + t, t, 0)),
        box_between((-x - t, height + t, -depth - t), (x + t, height + 2 * t, 0)),
        box_between((-x - t, t, -depth - t), (-x, height + t, 0)),
        box_between((x, t, -depth - t), (x + t, height + t, 0)),
        box_between((-x, t, -depth - t), (x, height + t, -depth)),
    )


def room():
    g = Gltf("luxel web/tests")
    checks = bytes(255 if (x + y) % 2 else 120 for y in range(8) for x in range(8) for _ in range(3))
    card = bytes(v for y in range(9) for x in range(16) for v in (x * 17, 128, y * 31))
    tiles = g.add_material("tiles", texture=g.add_image("tiles", 8, 8, checks))
    white = g.add_material("white", (0.8, 0.8, 0.8))
    wood = g.add_material("wood", (0.5, 0.4, 0.3))
    screen = g.add_material("screen", (0.02, 0.02, 0.02), emissive_texture=g.add_image("card", 16, 9, card, wrap=False), strength=10)
    tint = g.add_material("tint", (0.6, 0.9, 0.7), transmission=1, roughness=0.05, double_sided=True)
    haze = g.add_material("haze", (0.9, 0.6, 0.5, 0.4), alpha="BLEND", double_sided=True)

    walls = merge(
        quad(4, 2.6).translate(0, 1.3, -2.5),
        quad(4, 2.6).rotate((0, 1, 0), 180).translate(0, 1.3, 2.5),
        quad(5, 2.6).rotate((0, 1, 0), 90).translate(-2, 1.3, 0),
        quad(5, 2.6).rotate((0, 1, 0), -90).translate(2, 1.3, 0),
        quad(4, 5).rotate((1, 0, 0), 90).translate(0, 2.6, 0),
    )
    g.add_node("walls", mesh=g.add_mesh("walls", (walls, white)))
    g.add_node("floor", mesh=g.add_mesh("floor", (quad(4, 5).rotate((1, 0, 0), -90), tiles)))
    niche = g.add_mesh("niche", (open_box(0.9, 0.7, 0.8, 0.06), wood))
    for name, x in (("left", -1), ("right", 1)):
        g.add_node("%s niche" % name, mesh=niche, translation=(x, 0.01, -1.2))
        g.add_node("%s lamp" % name, light=g.add_light("point", 4), translation=(x, 0.6, -1.5), extras={"luxel_layer": name})
    g.add_node("tv", mesh=g.add_mesh("tv", (quad(2.4, 1.0, fit=True), screen)), translation=(0, 1.75, -2.48),
               extras={"luxel_monitor": "4x2"})
    g.add_node("ceiling lamp", light=g.add_light("point", 12, (1, 0.9, 0.8)), translation=(0, 2.3, 1), extras={"luxel_layer": "ceiling"})
    g.add_node("tinted pane", mesh=g.add_mesh("tinted pane", (quad(0.5, 0.9), tint)), translation=(-0.25, 0.5, -0.6))
    g.add_node("hazy pane", mesh=g.add_mesh("hazy pane", (quad(0.5, 0.9), haze)), translation=(0.35, 0.5, -0.8))
    eye = (0, 1.4, 2.3)
    g.add_node("view", camera=g.add_camera("view", 62), translation=eye, rotation=look(eye, (0, 1.15, -2.5)))
    above = (1.2, 2.2, 1.8)
    g.add_node("corner", camera=g.add_camera("corner", 70), translation=above, rotation=look(above, (-0.5, 0.3, -1)))
    return g


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: viewer_room.py OUT.glb")
    room().save(sys.argv[1])


main()
