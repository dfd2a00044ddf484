#!/usr/bin/env python3
"""Writes the small room that these tests bake: scene.py OUT.glb

It holds one of each thing that readers trip over: a texture, instances, an emissive material, a lamp of every kind, an object
that moves, a mesh whose chart boundaries split vertices, one that is used twice, a screen, and lights that change over time.
"""

import os
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scenes"))
from gltf import Gltf, box, look, quad, sphere  # noqa: E402


def room():
    g = Gltf("luxel tests/web")
    checks = bytes(255 if (x + y) % 2 else 90 for y in range(8) for x in range(8) for _ in range(3))
    tiles = g.add_material("tiles", texture=g.add_image("tiles", 8, 8, checks))
    white = g.add_material("white", (0.8, 0.8, 0.8))
    red = g.add_material("red", (0.7, 0.1, 0.1))
    glow = g.add_material("glow", (0, 0, 0), emissive=(0.2, 0.6, 1), strength=20, extras={"luxel_animate": "blink 2 low=0.2"})
    bars = bytes(c for _ in range(2) for color in ((255, 0, 0), (0, 255, 0), (0, 0, 255)) for c in color)
    card = g.add_image("bars", 3, 2, bars, wrap=False, nearest=True)
    screen = g.add_material("screen", (0, 0, 0), emissive=(1, 1, 1), emissive_texture=card, strength=15)

    g.add_node("floor", mesh=g.add_mesh("floor", (quad(4, 4).rotate((1, 0, 0), -90), tiles)))
    g.add_node("wall", mesh=g.add_mesh("wall", (quad(4, 2).translate(0, 1, -2), white)))
    block = g.add_mesh("block", (box(0.6, 0.6, 0.6), red))
    g.add_node("left block", mesh=block, translation=(-1, 0.3, 0))
    g.add_node("right block", mesh=block, translation=(1, 0.3, 0.2), scale=(1, 1.5, 1))
    ball = g.add_mesh("ball", (sphere(0.3, 12, 6), white))
    g.add_node("ball", mesh=ball, translation=(0, 0.3, 0.6))
    g.add_node("drone", mesh=ball, translation=(0, 1.4, 0), extras={"luxel_static": False})
    still = (0, 0, 0, 1)
    g.add_node("pebbles", mesh=g.add_mesh("pebble", (box(0.2, 0.1, 0.2), white)),
               instances=[((x, 0.05, 1.2), still, (1, 1, 1)) for x in (-1.0, -0.5, 0.5, 1.0)])
    g.add_node("strip", mesh=g.add_mesh("strip", (box(0.8, 0.1, 0.1), glow)), translation=(0, 1.8, -1.8))

    g.add_node("tv", mesh=g.add_mesh("tv", (quad(0.9, 0.5, fit=True), screen)), translation=(0.9, 1.2, -1.9),
               extras={"luxel_monitor": "3x2"})

    g.add_node("lamp", light=g.add_light("point", 20, (1, 0.8, 0.6)), translation=(-1, 1.8, 0.5))
    g.add_node("spot", light=g.add_light("spot", 40, outer=40), translation=(1.5, 2, 1.5),
               rotation=look((1.5, 2, 1.5), (0, 0, 0)))
    g.add_node("sun", light=g.add_light("directional", 3), rotation=look((0.3, 1, 0.5), (0, 0, 0)))
    g.add_node("panel", translation=(0, 2, 0), rotation=look((0, 2, 0), (0, 0, 0)),
               extras={"luxel_area": "rect 0.5 0.5", "luxel_color": [1, 1, 1], "luxel_intensity": 30})
    eye = (2.5, 1.8, 3.5)
    g.add_animation("dusk", ("/extensions/KHR_lights_punctual/lights/0/intensity", (0.0, 2.0, 4.0), (20.0, 2.0, 20.0), "LINEAR"),
                    ("/extensions/KHR_lights_punctual/lights/0/color", (0.0, 4.0), ((1, 0.8, 0.6), (1, 0.4, 0.2)), "STEP"))
    g.add_node("view", camera=g.add_camera("view", 45), translation=eye, rotation=look(eye, (0, 0.5, 0)))
    return g


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    room().save(sys.argv[1])
