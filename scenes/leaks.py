"""Scenes in which light would leak if it could.

    leaks.py FOLDER        writes all of them as FOLDER/NAME.glb

Texels are wider than walls are thick, solids overlap and touch, and it is bright outside.  None of this is lined up with a texel.
"""

import os
import sys

from gltf import Gltf, box, box_between, lathe, look, quad

SUN = 100  # lux on a surface that faces it


def _scene(sun=(0.35, -1, 0.25)):
    scene = Gltf()
    light = scene.add_light("directional", SUN, name="sun")
    scene.add_node("sun", light=light, rotation=look((0, 0, 0), sun))
    return scene, scene.add_material("white", base_color=(0.8, 0.8, 0.8))


def _camera(scene, name, eye, target, yfov=70):
    scene.add_node(name, camera=scene.add_camera(name, yfov), translation=eye, rotation=look(eye, target))


def _ground(scene, material, size=12.0, below=-0.07):
    ground = quad(size, size).rotate((1, 0, 0), -90).translate(0, below, 0)
    scene.add_node("ground", mesh=scene.add_mesh("ground", (ground, material)), extras={"luxel_density": 0.3})


def _inside_cameras(scene, lo, hi, inset=0.15):
    """Two eyes in opposite corners of a room, which see all of its edges between them."""
    middle = tuple((a + b) / 2 for a, b in zip(lo, hi))
    _camera(scene, "low", tuple(a + inset for a in lo), middle, 95)
    _camera(scene, "high", tuple(b - inset for b in hi), middle, 95)


def dark_room_of_boxes():
    """A closed room of six boxes of 10 cm that overlap at the edges.  Outside are sun and ground; bake it with a sky."""
    scene, white = _scene()
    _ground(scene, white)
    (x0, y0, z0), (x1, y1, z1), w = (-1.93, 0.0, -1.41), (2.03, 2.57, 1.52), 0.1
    walls = {
        "floor": ((x0 - w, y0 - w, z0 - w), (x1 + w, y0, z1 + w)),
        "ceiling": ((x0 - w, y1, z0 - w), (x1 + w, y1 + w, z1 + w)),
        "west": ((x0 - w, y0 - w, z0 - w), (x0, y1 + w, z1 + w)),
        "east": ((x1, y0 - w, z0 - w), (x1 + w, y1 + w, z1 + w)),
        "north": ((x0 - w, y0 - w, z0 - w), (x1 + w, y1 + w, z0)),
        "south": ((x0 - w, y0 - w, z1), (x1 + w, y1 + w, z1 + w)),
    }
    for name, (lo, hi) in walls.items():
        scene.add_node(name, mesh=scene.add_mesh(name, (box_between(lo, hi), white)))
    _inside_cameras(scene, (x0, y0, z0), (x1, y1, z1))
    _camera(scene, "outside", (5.5, 3.2, 5.0), (0, 1, 0), 50)
    return scene


def dark_room_of_sheets():
    """A closed room of six one-sided quads that face inwards, in a closed shell of six that face outwards, 10 cm apart."""
    scene, white = _scene()
    _ground(scene, white)
    lo, hi, w = (-1.93, 0.0, -1.41), (2.03, 2.57, 1.52), 0.1
    scene.add_node("room", mesh=scene.add_mesh("room", (box_between(lo, hi).flip(), white)))
    shell = box_between(tuple(a - w for a in lo), tuple(b + w for b in hi))
    scene.add_node("shell", mesh=scene.add_mesh("shell", (shell, white)))
    _inside_cameras(scene, lo, hi)
    _camera(scene, "outside", (5.5, 3.2, 5.0), (0, 1, 0), 50)
    return scene


def _two_rooms(split, ceiling=True):
    scene = Gltf()
    white = scene.add_material("white", base_color=(0.8, 0.8, 0.8))
    (x0, y0, z0), (x1, y1, z1), w, t, middle = (-2.03, 0.0, -1.41), (1.93, 2.5, 1.52), 0.3, 0.02, 0.013
    across = {
        "floor": ((x0 - w, y0 - w, z0 - w), (x1 + w, y0, z1 + w)),
        "ceiling": ((x0 - w, y1, z0 - w), (x1 + w, y1 + w, z1 + w)),
        "north": ((x0 - w, y0 - w, z0 - w), (x1 + w, y1 + w, z0)),
        "south": ((x0 - w, y0 - w, z1), (x1 + w, y1 + w, z1 + w)),
    }
    solids = {
        "west": ((x0 - w, y0 - w, z0 - w), (x0, y1 + w, z1 + w)),
        "east": ((x1, y0 - w, z0 - w), (x1 + w, y1 + w, z1 + w)),
        "wall": ((middle - t / 2, y0 - 0.1, z0 - 0.1), (middle + t / 2, y1 + 0.1, z1 + 0.1)),
    }
    if not ceiling:
        del across["ceiling"]
    for name, (lo, hi) in across.items():
        if split:
            solids[name + " 1"] = (lo, (middle, hi[1], hi[2]))
            solids[name + " 2"] = ((middle, lo[1], lo[2]), hi)
        else:
            solids[name] = (lo, hi)
    for name, (lo, hi) in solids.items():
        scene.add_node(name, mesh=scene.add_mesh(name, (box_between(lo, hi), white)))
    lamp = scene.add_light("point", 100, name="lamp")
    scene.add_node("lamp", light=lamp, translation=(-1.0, 1.9, 0.1))
    _camera(scene, "dark", (x1 - 0.2, 1.7, z1 - 0.2), (0.1, 0.7, -0.3), 80)
    _camera(scene, "lit", (x0 + 0.2, 1.7, z1 - 0.2), (0, 0.7, -0.3), 80)
    return scene


def thin_wall():
    """Two closed rooms with 2 cm of wall between them, a lamp in the one.  Each has a floor, a ceiling and outer walls of its own, which meet under the wall."""
    return _two_rooms(True)


def thin_wall_on_one_floor():
    """The same, but floor, ceiling and outer walls run through: their charts belong to both rooms."""
    return _two_rooms(False)


def thin_wall_from_above():
    """The same without a ceiling and with a blue lamp in the other room; nothing that could throw light back is higher than the wall."""
    scene = _two_rooms(False, ceiling=False)
    blue = scene.add_light("point", 100, name="blue lamp", color=(0.05, 0.2, 1))
    scene.add_node("blue lamp", light=blue, translation=(1.1, 1.5, 0.3))
    scene.json["extensions"]["KHR_lights_punctual"]["lights"][0]["color"] = [1, 0.25, 0.05]
    _camera(scene, "above", (0.3, 7.6, 1.5), (-0.05, 1.3, 0.1), 42)
    return scene


def close_charts(page=64, gap=2.02):
    """A file's own lightmap set whose charts are `gap` texels of a page of `page` apart, at all phases against its texels.  Every second one faces the sun,
    the others face down and are dark."""
    scene, white = _scene((0, -1, 0))
    strips, u, width, k = [], 2.3, 3.37, 0
    while u + width < page - 2:
        strip = quad(0.2, 2.0).rotate((1, 0, 0), -90 if k % 2 else 90).translate(0.3 * k, 0, 0)
        strip.uv1 = [(x / page, y) for x, y in ((u, 0.9), (u + width, 0.9), (u + width, 0.1), (u, 0.1))]
        strips.append(strip)
        u, k = u + width + gap, k + 1
    for k, strip in enumerate(strips):
        scene.add_node("strip %d" % k, mesh=scene.add_mesh("strip %d" % k, (strip, white)))
    _camera(scene, "below", (0.15 * len(strips), -2, 0.0), (0.15 * len(strips), 0, -0.001), 80)
    _camera(scene, "above", (0.15 * len(strips), 2, 0.0), (0.15 * len(strips), 0, -0.001), 80)
    return scene


def intersecting_boxes(sun=True):
    """Three boxes on a floor, two that overlap and one that touches both."""
    scene, white = _scene()
    if not sun:
        scene = Gltf()
        white = scene.add_material("white", base_color=(0.8, 0.8, 0.8))
    _ground(scene, white, 4.0, 0.0)
    boxes = {
        "tall": box(0.9, 1.7, 0.8, (0.03, 0.75, 0.02)),
        "askew": box(1.1, 0.9, 0.7).rotate((0.1, 1, 0.05), 31).translate(0.61, 0.38, 0.33),
        "slab": box_between((-1.17, -0.05, -0.27), (-0.42, 0.41, 0.61)),
    }
    for name, mesh in boxes.items():
        scene.add_node(name, mesh=scene.add_mesh(name, (mesh, white)))
    _camera(scene, "front", (1.5, 2.1, 2.9), (0.05, 0.4, 0.1), 45)
    _camera(scene, "back", (-2.6, 1.6, -1.9), (0, 0.5, 0), 45)
    return scene


def column():
    """A column with mouldings finer than a texel, half sunk into a wall, on a floor: every stone a solid of its own that reaches into the next."""
    scene, white = _scene((0.55, -1, -0.6))
    _ground(scene, white, 4.0, 0.0)
    wall = box_between((-1.5, -0.05, -0.9), (1.5, 2.6, -0.25))
    plinth = box_between((-0.4, -0.03, -0.4), (0.4, 0.17, 0.4))
    base = [(0, 0.15), (0.36, 0.15), (0.37, 0.18), (0.36, 0.21), (0.31, 0.215), (0.30, 0.24), (0.31, 0.265), (0.33, 0.28), (0.32, 0.31), (0.27, 0.32), (0, 0.32)]
    shaft = [(0, 0.3), (0.25, 0.3), (0.25, 0.33), (0.24, 0.35), (0.22, 1.9), (0.24, 1.93), (0.24, 1.96), (0, 1.96)]
    capital = [(0, 1.94), (0.23, 1.94), (0.26, 1.96), (0.26, 1.98), (0.24, 1.99), (0.27, 2.05), (0.35, 2.15), (0.37, 2.16), (0.37, 2.19), (0, 2.19)]
    abacus = box_between((-0.4, 2.17, -0.4), (0.4, 2.27, 0.4))
    parts = {"wall": wall, "plinth": plinth, "base": lathe(base, 32), "shaft": lathe(shaft, 32), "capital": lathe(capital, 32), "abacus": abacus}
    for name, mesh in parts.items():
        scene.add_node(name, mesh=scene.add_mesh(name, (mesh, white)))
    _camera(scene, "whole", (1.3, 1.5, 3.0), (0, 1.1, 0), 50)
    _camera(scene, "base", (0.7, 0.8, 1.3), (0, 0.2, 0), 40)
    _camera(scene, "capital", (0.7, 1.7, 1.3), (0, 2.05, 0), 40)
    return scene


SCENES = {f.__name__: f for f in (dark_room_of_boxes, dark_room_of_sheets, thin_wall, thin_wall_on_one_floor, thin_wall_from_above,
                                close_charts, intersecting_boxes, column)}


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__.strip())
    os.makedirs(sys.argv[1], exist_ok=True)
    for name, make in SCENES.items():
        make().save(os.path.join(sys.argv[1], name + ".glb"))
