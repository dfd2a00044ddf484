"""A room of some ten thousand triangles with 16 lamps of four kinds, or more, written to the path given: python3 bench/room16.py OUT.glb [LAMPS]"""

import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scenes"))
from gltf import Gltf, box, look, quad, sphere  # noqa: E402


def build(lamps=16):
    columns = 4 if lamps == 16 else math.ceil(math.sqrt(lamps))
    step_x, step_z = 7.8 / (columns - 1), 6 / (columns - 1)
    g = Gltf(generator="luxel bench/room16.py")
    grey = g.add_material("walls", base_color=(0.7, 0.68, 0.65))
    red = g.add_material("things", base_color=(0.6, 0.2, 0.15))
    g.add_node("room", mesh=g.add_mesh("room", (box(10, 3, 8).flip(), grey)), translation=(0, 1.5, 0))
    ball = g.add_mesh("ball", (sphere(0.35, 40, 24), red))
    post = g.add_mesh("post", (box(0.4, 1.6, 0.4), grey))
    for i in range(6):
        x = -4 + 1.6 * i
        g.add_node("ball_%d" % i, mesh=ball, translation=(x, 0.36, math.sin(2.1 * i) * 2.5))
        g.add_node("post_%d" % i, mesh=post, translation=(x + 0.8, 0.81, math.cos(1.7 * i) * 2.5))
    lamp = g.add_mesh("lamp", (quad(0.5, 0.5), g.add_material("glow", base_color=(0.1, 0.1, 0.1), emissive=(1, 1, 1), strength=60)))
    for i in range(lamps):
        at = (-4 + step_x * (i % columns), 2.8, -3 + step_z * (i // columns))
        color = (1, 0.6 + 0.1 * (i % 4), 0.4 + 0.15 * (i // columns % 4))
        down = look(at, (at[0], 0, at[2]))
        kind = i % 4
        if kind == 0:
            g.add_node("point_%d" % i, light=g.add_light("point", 20, color), translation=at, extras={"luxel_radius": 0.05})
        elif kind == 1:
            g.add_node("spot_%d" % i, light=g.add_light("spot", 60, color, inner=23, outer=52), translation=at, rotation=down)
        elif kind == 2:
            g.add_node("area_%d" % i, translation=at, rotation=down,
                       extras={"luxel_area": "rect 0.6 0.3", "luxel_color": list(color), "luxel_intensity": 80})
        else:
            g.add_node("panel_%d" % i, mesh=lamp, translation=at, rotation=down)
    return g


if __name__ == "__main__":
    build(int(sys.argv[2]) if len(sys.argv) > 2 else 16).save(sys.argv[1])
