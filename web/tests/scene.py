#!/usr/bin/env python3
"""Writes the small stage that the browser tests bake: scene.py OUT.glb

A box that is open towards +Z: white floor, ceiling and walls, a lamp on either side, a screen on the back wall. Beside them one of each
thing that a viewer trips over: instances of one mesh on two nodes, a texture on two materials, clearcoat, an unlit sign, a
lamp whose direct light is real-time, a program, an animation of light and one that moves a thing.
"""

import os
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scenes"))
from gltf import Gltf, box, look, quad, sphere  # noqa: E402

STILL = (0, 0, 0, 1)


def room():
    g = Gltf("luxel web/tests")
    white = g.add_material("white", (0.7, 0.7, 0.7))
    checks = bytes(255 if (x // 2 + y // 2) % 2 else 120 for y in range(8) for x in range(8) for _ in range(3))
    pattern = g.add_image("pattern", 8, 8, checks)
    tiles = g.add_material("tiles", texture=pattern)
    paper = g.add_material("paper", (0.9, 0.8, 0.7), texture=pattern)
    glossy = g.add_material("glossy", (0.3, 0.3, 0.35), roughness=0.4)
    g.json["materials"][glossy]["extensions"] = {"KHR_materials_clearcoat": {"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.1}}
    g.json.setdefault("extensionsUsed", []).append("KHR_materials_clearcoat")
    sign = g.add_material("sign", (0.1, 0.6, 0.2), unlit=True)
    bars = bytes(c for y in range(4) for x in range(4) for c in ((255, 255, 255) if x % 2 else (40, 40, 40)))
    neon = g.add_material("neon", (0, 0, 0), emissive=(0.1, 1, 0.3), strength=30, emissive_texture=g.add_image("bars", 4, 4, bars))
    screen = g.add_material("screen", (0, 0, 0), emissive=(1, 1, 1), strength=20, extras={"luxel_monitor": "4x2"})
    ember = g.add_material("ember", (0, 0, 0), emissive=(1, 0.4, 0.1), strength=10, extras={"luxel_animate": "blink 2 duty=0.5"})

    def surface(name, width, height, translation, rotation=None, material=white):
        g.add_node(name, mesh=g.add_mesh(name, (quad(width, height), material)), translation=translation, rotation=rotation)

    surface("floor", 4, 4, (0, 0, 0), look((0, 0, 0), (0, -1, 0)), tiles)
    surface("ceiling", 4, 4, (0, 2.5, 0), look((0, 0, 0), (0, 1, 0)))
    surface("back", 4, 2.5, (0, 1.25, -2))
    surface("left", 4, 2.5, (-2, 1.25, 0), look((0, 0, 0), (-1, 0, 0)))
    surface("right", 4, 2.5, (2, 1.25, 0), look((0, 0, 0), (1, 0, 0)))
    g.add_node("screen", mesh=g.add_mesh("screen", (quad(1.6, 0.9, fit=True), screen)), translation=(0, 1.3, -1.9))

    pebble = g.add_mesh("pebble", (box(0.2, 0.1, 0.2), white))
    for name, side in (("pebbles left", -1), ("pebbles right", 1)):
        g.add_node(name, mesh=pebble, instances=[((side * x, 0.05, 1.5), STILL, (1, 1, 1)) for x in (1.3, 1.7)])
    block = g.add_mesh("block", (box(0.5, 0.5, 0.5), paper))
    g.add_node("left block", mesh=block, translation=(-1.2, 0.25, -0.3))
    g.add_node("right block", mesh=block, translation=(1.2, 0.25, -0.3))
    g.add_node("ball", mesh=g.add_mesh("ball", (sphere(0.25, 16, 8), glossy)), translation=(0, 0.25, 0.6))
    g.add_node("sign", mesh=g.add_mesh("sign", (quad(0.4, 0.2), sign)), translation=(-1.2, 2.2, -1.95))
    g.add_node("neon", mesh=g.add_mesh("neon", (quad(0.8, 0.2, fit=True), neon)), translation=(1.2, 0.9, -1.95))
    g.add_node("ember", mesh=g.add_mesh("ember", (box(0.15, 0.15, 0.15), ember)), translation=(-1.2, 0.9, -1.9))
    drone = g.add_node("drone", mesh=g.add_mesh("drone", (box(0.2, 0.2, 0.2), white)), translation=(0, 2.1, 0), extras={"luxel_static": False})

    g.add_node("left lamp", light=g.add_light("point", 6), translation=(-1.5, 1.6, 0.8))
    g.add_node("right lamp", light=g.add_light("point", 6), translation=(1.5, 1.6, 0.8))
    spot = g.add_light("spot", 30, (1, 1, 0.8), outer=25)
    g.add_node("mixed spot", light=spot, translation=(0, 2.3, 1.5), rotation=look((0, 2.3, 1.5), (0, 0, 0.6)), extras={"luxel_mode": "mixed"})
    sweep = g.add_light("point", 3, (0.4, 0.5, 1))
    g.add_node("sweep", light=sweep, translation=(0, 0.6, -1))

    times = g.add_accessor([0, 1, 2], bounds=True, target=None)
    places = g.add_accessor([(0, 2.1, 0), (0.8, 2.1, 0), (0, 2.1, 0)], target=None)
    levels = g.add_accessor([0, 8, 0], target=None)
    g._extension("KHR_animation_pointer")
    g.json["animations"] = [
        {"name": "fly", "samplers": [{"input": times, "output": places}],
         "channels": [{"sampler": 0, "target": {"node": drone, "path": "translation"}}]},
        {"name": "sweep", "samplers": [{"input": times, "output": levels}],
         "channels": [{"sampler": 0, "target": {"path": "pointer", "extensions": {
             "KHR_animation_pointer": {"pointer": "/extensions/KHR_lights_punctual/lights/%d/intensity" % sweep}}}}]},
    ]
    eye = (0, 1.25, 5)
    g.add_node("view", camera=g.add_camera("view", 42), translation=eye, rotation=look(eye, (0, 1.15, 0)))
    return g


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    room().save(sys.argv[1])
