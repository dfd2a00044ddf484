#!/usr/bin/env python3
"""Builds bar.glb: a small bar at night, lit by every kind of light that Luxel knows.

    python3 scenes/bar.py [OUT.glb]

The room is 8 m wide (x), 6 m deep (z) and 3.15 m high; the counter runs along the back wall (-z),
the window and the street are at +z.  Everything that shines is listed in scenes/README.md.
"""

import math
import os
import random
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import textures
from gltf import (
    Gltf,
    Mesh,
    box,
    box_between,
    cylinder,
    extrude,
    grid,
    lathe,
    look,
    merge,
    quad,
    quat,
    quat_mul,
    sphere,
    tube,
    v_add,
    v_mul,
    v_norm,
    v_sub,
)

X, Z, H = 4.0, 3.0, 3.15  # half width, half depth, height of the room
WALL = 0.25
WINDOW = (-0.7, 2.3, 0.92, 2.42)  # x0, x1, y0, y1 in the front wall
SINK = 0.001  # how deep things stand in what carries them

FACE_RIGHT, FACE_FRONT, FACE_LEFT, FACE_BACK = 90, 0, -90, 180  # turns +z to +x, +z, -x, -z


class Bar:
    """The file being written, with materials by name and meshes that know their texture scale."""

    def __init__(self):
        self.g = Gltf("luxel scenes/bar.py")
        self.materials = {}
        self.textures = {}

    def texture(self, name, painter, *args, wrap=True):
        w, h, pixels, channels = painter(*args)
        self.textures[name] = self.g.add_image(name, w, h, pixels, channels, wrap)

    def material(self, name, color, texture=None, span=1.0, **kw):
        """span: metres that the texture covers; 1.0 also serves for UVs that span 0..1."""
        if texture is not None:
            texture = self.textures[texture]
        if "emissive_texture" in kw:
            kw["emissive_texture"] = self.textures[kw["emissive_texture"]]
        index = self.g.add_material(name, color, texture, **kw)
        self.materials[name] = (index, span)

    def mesh(self, name, *parts):
        """parts: (Mesh, material name)."""
        done = []
        for m, material in parts:
            index, span = self.materials[material]
            done.append((m.copy().scale_uv(1 / span) if span != 1.0 else m, index))
        return self.g.add_mesh(name, *done)

    def node(
        self,
        name,
        *parts,
        mesh=None,
        at=None,
        turn=0,
        rotation=None,
        scale=None,
        light=None,
        camera=None,
        parent=None,
        **extras,
    ):
        if parts:
            mesh = self.mesh(name, *parts)
        if turn:
            rotation = quat((0, 1, 0), turn)
        extras = {"luxel_" + key: value for key, value in extras.items()}
        return self.g.add_node(name, mesh, light, camera, at, rotation, scale, extras or None, parent)


# --- materials ---------------------------------------------------------------------------------


def make_materials(b):
    t = textures
    for name, painter in (
        ("brick", t.brick),
        ("wood", t.wood),
        ("floorboards", t.floorboards),
        ("plaster", t.plaster),
        ("tile", t.tile),
        ("leather", t.leather),
        ("asphalt", t.asphalt),
        ("jukebox", t.jukebox),
        ("lava", t.lava),
        ("facade", t.facade),
    ):
        b.texture(name, painter)
    for name, painter in (
        ("leaf", t.leaf),
        ("slat", t.slat),
        ("exit", t.exit_sign),
        ("test card", t.test_card),
        ("chalkboard", t.chalkboard),
    ):
        b.texture(name, painter, wrap=False)
    for k in range(3):
        b.texture("artwork %d" % k, t.artwork, k, wrap=False)
        b.texture("label %d" % k, t.label, k)

    m = b.material
    m("brick", (0.95, 0.9, 0.88), "brick", 1.92)
    m("floor", (0.95, 0.88, 0.8), "floorboards", 1.5)
    m("plaster", (0.46, 0.6, 0.6), "plaster", 1.6)
    m("ceiling", (0.78, 0.72, 0.66), "plaster", 1.6)
    m("walnut", (0.42, 0.27, 0.19), "wood", 0.8, roughness=0.6)
    m("oak", (0.78, 0.62, 0.44), "wood", 0.8, roughness=0.6)
    m("panelling", (0.16, 0.27, 0.25), "wood", 0.8, roughness=0.7)
    m("beam", (0.26, 0.18, 0.14), "wood", 0.8)
    m("tile", (0.24, 0.46, 0.44), "tile", 0.9, roughness=0.3)
    m("oxblood leather", (0.5, 0.08, 0.06), "leather", 0.4, roughness=0.5)
    m("asphalt", (1.0, 1.0, 1.0), "asphalt", 1.0)
    m("render", (0.3, 0.28, 0.27), "plaster", 1.6)
    m("brass", (0.88, 0.62, 0.28), roughness=0.45, metallic=0.4)
    m("steel", (0.62, 0.63, 0.66), roughness=0.5, metallic=0.3)
    m("black metal", (0.035, 0.035, 0.04), roughness=0.6)
    m("enamel", (0.05, 0.2, 0.2), roughness=0.4)
    m("cream", (0.85, 0.78, 0.64))
    m("terracotta", (0.56, 0.24, 0.13))
    m("soil", (0.07, 0.045, 0.03))
    m("stem", (0.16, 0.3, 0.1))
    m("wax", (0.88, 0.82, 0.7))
    m("lime", (0.3, 0.55, 0.06))
    m("paper", (0.85, 0.82, 0.74))
    m("chalkboard", (1, 1, 1), "chalkboard")
    for k in range(3):
        m("artwork %d" % k, (0.95, 0.95, 0.95), "artwork %d" % k)
        m("label %d" % k, (0.95, 0.95, 0.95), "label %d" % k)
    m("leaf", (0.9, 1.0, 0.8), "leaf", alpha="MASK", cutoff=0.5, double_sided=True)
    m("slat", (0.9, 0.88, 0.82), "slat", alpha="MASK", cutoff=0.5, double_sided=True)
    m("pane", (0.95, 0.98, 1.0), roughness=0.0, transmission=0.96)
    m("clear glass", (0.93, 0.97, 0.96), roughness=0.05, transmission=0.93)
    for name, color in (
        ("green", (0.16, 0.62, 0.24)),
        ("amber", (0.92, 0.42, 0.06)),
        ("blue", (0.16, 0.42, 0.9)),
        ("red", (0.85, 0.08, 0.1)),
    ):
        m(name + " glass", color, roughness=0.05, transmission=0.82)
    m("beer", (0.95, 0.6, 0.12), roughness=0.1, transmission=0.7)
    m("campari", (0.95, 0.16, 0.1), roughness=0.1, transmission=0.7)

    def glow(name, color, nit, **kw):
        m(name, (0.02, 0.02, 0.02), emissive=color, strength=nit, **kw)

    glow("pendant_bulb", (1.0, 0.8, 0.55), 250.0)
    glow("neon_pink", (1.0, 0.05, 0.3), 50.0)
    glow("neon_blue", (0.04, 0.3, 1.0), 50.0)
    glow("neon_amber", (1.0, 0.36, 0.02), 32.0, extras={"luxel_animate": "flicker 80ms low=0.25"})  # a tired tube
    glow("counter_glow", (0.03, 0.75, 0.6), 20.0)
    glow("fairy_bulb", (1.0, 0.74, 0.42), 600.0)
    glow("candle_flame", (1.0, 0.56, 0.18), 4000.0)
    glow("jukebox", (1, 1, 1), 14.0, emissive_texture="jukebox")
    glow("tv", (0.9, 0.95, 1.0), 18.0, emissive_texture="test card")
    glow("lava", (1, 1, 1), 14.0, emissive_texture="lava")
    glow("exit", (1, 1, 1), 8.0, emissive_texture="exit")
    glow("street_lens", (0.7, 0.9, 1.0), 300.0)
    m("facade", (0.11, 0.09, 0.085), emissive=(1, 1, 1), emissive_texture="facade", strength=5.0)


# --- the room ----------------------------------------------------------------------------------


def wall_face(x0, x1, y0, y1, openings):
    """A wall facing +z at z = 0, cut along the edges of its openings (x0, x1, y0, y1)."""
    xs = sorted({x0, x1} | {v for o in openings for v in o[:2]})
    ys = sorted({y0, y1} | {v for o in openings for v in o[2:]})
    m = Mesh()
    for y in ys:
        for x in xs:
            m.positions.append((x, y, 0))
            m.normals.append((0, 0, 1))
            m.uvs.append((x, -y))
    n = len(xs)
    for j in range(len(ys) - 1):
        for i in range(n - 1):
            cx, cy = (xs[i] + xs[i + 1]) / 2, (ys[j] + ys[j + 1]) / 2
            if any(o[0] < cx < o[1] and o[2] < cy < o[3] for o in openings):
                continue
            a = j * n + i
            m.indices += [a, a + 1, a + n + 1, a, a + n + 1, a + n]
    return m


def make_room(b):
    """An inner and an outer shell, both closed and joined by the reveal of the window."""
    x0, x1, y0, y1 = WINDOW
    mirrored = (-x1, -x0, y0, y1)
    b.node("floor", (quad(2 * X, 2 * Z).rotate((1, 0, 0), -90), "floor"))
    b.node("ceiling", (quad(2 * X, 2 * Z).rotate((1, 0, 0), 90), "ceiling"), at=(0, H, 0))
    b.node("wall_back", (wall_face(-X, X, 0, H, []), "brick"), at=(0, 0, -Z))
    b.node("wall_left", (wall_face(-Z, Z, 0, H, []), "plaster"), at=(-X, 0, 0), turn=FACE_RIGHT)
    b.node("wall_right", (wall_face(-Z, Z, 0, H, []), "plaster"), at=(X, 0, 0), turn=FACE_LEFT)
    b.node("wall_front", (wall_face(-X, X, 0, H, [mirrored]), "plaster"), at=(0, 0, Z), turn=FACE_BACK)
    w, h, cx, cy = x1 - x0, y1 - y0, (x0 + x1) / 2, (y0 + y1) / 2
    reveal = box(w, h, WALL, skip="-z +z").flip()
    b.node("window_reveal", (reveal, "plaster"), at=(cx, cy, Z + WALL / 2))
    ox, oz, low, high = X + WALL, Z + WALL, -0.3, H + 0.25
    outside = merge(
        wall_face(-ox, ox, low, high, [WINDOW]).translate(0, 0, oz),
        wall_face(-ox, ox, low, high, []).rotate((0, 1, 0), 180).translate(0, 0, -oz),
        wall_face(-oz, oz, low, high, []).rotate((0, 1, 0), 90).translate(ox, 0, 0),
        wall_face(-oz, oz, low, high, []).rotate((0, 1, 0), -90).translate(-ox, 0, 0),
        quad(2 * ox, 2 * oz).rotate((1, 0, 0), -90).translate(0, high, 0),
        quad(2 * ox, 2 * oz).rotate((1, 0, 0), 90).translate(0, low, 0),
    )
    b.node("outside", (outside, "render"), density=0.1)

    beam = b.mesh("beam", (box(0.16, 0.22, 2 * Z + 0.02), "beam"))
    for k, x in enumerate((-3.0, -1.0, 1.0, 3.0)):
        b.node("beam_%d" % (k + 1), mesh=beam, at=(x, H - 0.1, 0), density=0.6)


def make_trim(b):
    """Panelling to chair height, skirting, cornice."""

    def run(name, length, at, turn):
        n = max(1, round(length / 0.5))
        # slightly different lengths and depths, so that no two faces share a plane
        parts = box(length - 0.006, 0.9, 0.03, (0, 0.448, 0.005), skip="-z")
        cap = box(length, 0.045, 0.06, (0, 0.915, 0.02), skip="-z")
        foot = box(length - 0.003, 0.12, 0.045, (0, 0.0575, 0.0115), skip="-z")
        for k in range(n):
            w = length / n
            x = -length / 2 + w * (k + 0.5)
            for y in (0.2, 0.8):
                parts.append(box(w - 0.1, 0.035, 0.016, (x, y, 0.026), skip="-z"))
            for side in (-1, 1):
                parts.append(
                    box(0.035, 0.58, 0.014, (x + side * (w / 2 - 0.069), 0.5, 0.026), skip="-z")
                )
        b.node(name, (merge(parts, cap, foot).swap_uv(), "panelling"), at=at, turn=turn)

    run("panelling_left_1", 1.35, (-X, 0, -0.375), FACE_RIGHT)
    run("panelling_left_2", 1.59, (-X, 0, 2.195), FACE_RIGHT)
    run("panelling_right_1", 2.36, (X, 0, -1.83), FACE_LEFT)
    run("panelling_right_2", 2.69, (X, 0, 1.645), FACE_LEFT)
    run("panelling_front", 7.97, (0, -0.0013, Z), FACE_BACK)


def make_window(b):
    x0, x1, y0, y1 = WINDOW
    cx, cy, w, h = (x0 + x1) / 2, (y0 + y1) / 2, x1 - x0, y1 - y0
    z = Z + 0.14
    bar = 0.06
    frame = merge(
        box(w + 0.024, bar, 0.07, (cx, y0 + bar / 2 - 0.01, z)),
        box(w + 0.024, bar, 0.07, (cx, y1 - bar / 2 + 0.01, z)),
        box(bar, h - 0.08, 0.066, (x0 + bar / 2 - 0.01, cy, z)).swap_uv(),
        box(bar, h - 0.08, 0.066, (x1 - bar / 2 + 0.01, cy, z)).swap_uv(),
        box(bar, h - 0.08, 0.062, (cx, cy, z)).swap_uv(),
    )
    b.node("window_frame", (frame, "walnut"))
    for k, x in enumerate((cx - w / 4, cx + w / 4)):
        b.node(
            "pane_%d" % (k + 1), (box(w / 2 - 0.04, h - 0.07, 0.006, (x, cy, z)), "pane"), density=0.2
        )
    b.node(
        "window_sill",
        (box_between((x0 - 0.06, y0 - 0.02, Z - 0.1), (x1 + 0.06, y0 + 0.02, Z + 0.01)), "walnut"),
    )
    # blinds: the left one is half up, the right one hangs low; the slats stand at an angle
    curve = grid(1.42, 0.05, 1, 4, fit=True)
    curve.positions = [(p[0], p[1], 0.006 - 9.6 * p[1] * p[1]) for p in curve.positions]
    curve.normals = [v_norm((0, 19.2 * p[1], 1)) for p in curve.positions]
    slat = b.mesh("slat", (curve, "slat"))
    rail = b.mesh("blind_rail", (box(1.43, 0.035, 0.045), "cream"))
    for side, x, count in (("left", cx - w / 4, 11), ("right", cx + w / 4, 24)):
        top = y1 - 0.03
        b.node("blind_%s_head" % side, mesh=rail, at=(x, top - 0.01, Z + 0.05))
        for k in range(count):
            b.node(
                "blind_%s_%d" % (side, k + 1),
                mesh=slat,
                at=(x, top - 0.06 - 0.043 * k, Z + 0.05),
                rotation=quat((1, 0, 0), 67 + 1.5 * math.sin(k * 2.1)),
                density=0.7,
            )
        low = top - 0.06 - 0.043 * count
        b.node("blind_%s_foot" % side, mesh=rail, at=(x, low - 0.01, Z + 0.05), scale=(1, 0.6, 0.8))
        cords = merge(
            *[
                tube([(x + dx, top - 0.02, Z + 0.05), (x + dx, low, Z + 0.05)], 0.002, 4)
                for dx in (-0.54, 0.0, 0.54)
            ]
        )
        b.node("blind_%s_cords" % side, (cords, "cream"), density=0.3)


def make_door(b):
    z, w, h = 0.85, 0.95, 2.1
    frame = merge(
        box(0.1, h + 0.1, 0.09, (-w / 2 - 0.05, h / 2 + 0.045, 0.03), skip="-z").swap_uv(),
        box(0.1, h + 0.1, 0.09, (w / 2 + 0.05, h / 2 + 0.045, 0.03), skip="-z").swap_uv(),
        box(w + 0.24, 0.12, 0.1, (0, h + 0.13, 0.032), skip="-z"),
    )
    slab = box(w - 0.01, h - 0.01, 0.05, (0, h / 2 + 0.004, 0.005), skip="-z").swap_uv()
    for y, tall in ((0.48, 0.62), (1.05, 0.3), (1.62, 0.64)):
        for x in (-0.21, 0.21):
            slab.append(box(0.3, tall, 0.02, (x, y, 0.036), skip="-z").swap_uv())
    knob = lathe(
        [
            (0, 0),
            (0.03, 0),
            (0.03, 0.006),
            (0.012, 0.012),
            (0.012, 0.035),
            (0.026, 0.045),
            (0.03, 0.06),
            (0.022, 0.074),
            (0, 0.078),
        ],
        20,
    )
    knob.rotate((1, 0, 0), 90).translate(0.38, 1.0, 0.029)
    b.node("door", (frame, "walnut"), (slab, "oak"), (knob, "brass"), at=(-X, 0, z), turn=FACE_RIGHT)
    case = box(0.42, 0.22, 0.07, (0, 0, 0.034), skip="-z")
    b.node("exit_case", (case, "black metal"), at=(-X, h + 0.36, z), turn=FACE_RIGHT)
    b.node(
        "exit_sign", (quad(0.38, 0.19, fit=True), "exit"), at=(-X + 0.071, h + 0.36, z), turn=FACE_RIGHT
    )


# --- counter and back-bar ----------------------------------------------------------------------


def make_counter(b):
    left, right = -X - 0.02, 1.5
    n = 7
    body = box_between((left, -0.01, -1.75), (right - 0.08, 1.05, -1.25))
    for k in range(n):  # panels on the guests' side
        w = (right - 0.1 + X) / n
        x = -X + w * (k + 0.5)
        body.append(
            merge(
                box(w - 0.12, 0.04, 0.03, (x, 0.92, -1.245)),
                box(w - 0.12, 0.04, 0.03, (x, 0.24, -1.245)),
                box(0.04, 0.66, 0.027, (x - w / 2 + 0.081, 0.58, -1.245)).swap_uv(),
                box(0.04, 0.66, 0.027, (x + w / 2 - 0.081, 0.58, -1.245)).swap_uv(),
            )
        )
    body.append(box_between((left, -0.01, -1.27), (right - 0.06, 0.1, -1.22)))
    b.node("counter", (body, "walnut"))
    b.node("counter_top", (counter_slab(left, right, 1.042, -1.86, -1.0, 0.062), "oak"))
    b.node(
        "counter_glow",
        (
            box_between((-X + 0.06, 1.022, -1.135), (right - 0.16, 1.046, -1.115), skip="+y"),
            "counter_glow",
        ),
    )
    rail = tube([(left, 0.19, -1.06), (right - 0.2, 0.19, -1.06)], 0.025, 16)
    for k in range(5):
        x = -3.5 + 1.15 * k
        rail.append(tube([(x, 0.19, -1.06), (x, 0.19, -1.26)], 0.014, 10))
        rail.append(tube([(x, 0.19, -1.06), (x, -0.005, -1.06)], 0.016, 10))
    rail.append(sphere(0.034, 16, 10).translate(right - 0.2, 0.19, -1.06))
    b.node("foot_rail", (rail, "brass"))

    tower = merge(
        cylinder(0.06, 0.03, 24),
        cylinder(0.035, 0.34, 20).translate(0, 0.02, 0),
        tube([(-0.21, 0.36, 0), (0.21, 0.36, 0)], 0.04, 18),
        sphere(0.042, 16, 10).translate(-0.21, 0.36, 0),
        sphere(0.042, 16, 10).translate(0.21, 0.36, 0),
    )
    handles = Mesh()
    for x in (-0.15, 0.0, 0.15):
        tower.append(
            tube([(x, 0.36, 0), (x, 0.36, -0.09), (x, 0.34, -0.115), (x, 0.28, -0.12)], 0.012, 10)
        )
        tower.append(tube([(x, 0.38, 0), (x, 0.42, 0.005)], 0.009, 10))
        handles.append(
            lathe([(0, 0), (0.012, 0.002), (0.022, 0.1), (0.018, 0.15), (0, 0.158)], 16)
            .rotate((1, 0, 0), 8)
            .translate(x, 0.41, 0.004)
        )
    b.node("beer_tower", (tower, "brass"), (handles, "oxblood leather"), at=(-0.55, 1.104 - SINK, -1.5))


def counter_slab(left, right, y0, z0, z1, thick):
    """The top of the counter, front and back edge half round."""
    outline = []
    for cz, a0 in ((z1 - thick / 2, -90), (z0 + thick / 2, 90)):
        for k in range(9):
            a = math.radians(a0 + 22.5 * k)
            outline.append((-(cz + thick / 2 * math.cos(a)), y0 + thick / 2 + thick / 2 * math.sin(a)))
    outline.reverse()
    # drawn in (-z, y) with depth along +z; a quarter turn makes the depth run along +x
    slab = extrude(outline, right - left)
    slab.rotate((0, 1, 0), 90).translate(left, 0, 0)
    return slab.swap_uv()


BOTTLES = {
    "wine": [
        (0, 0),
        (0.034, 0),
        (0.0385, 0.004),
        (0.0385, 0.19),
        (0.034, 0.214),
        (0.019, 0.244),
        (0.0145, 0.262),
        (0.0145, 0.3),
        (0.017, 0.302),
        (0.017, 0.312),
        (0, 0.312),
    ],
    "whisky": [
        (0, 0),
        (0.042, 0),
        (0.047, 0.005),
        (0.047, 0.15),
        (0.041, 0.172),
        (0.02, 0.19),
        (0.0155, 0.2),
        (0.0155, 0.235),
        (0.018, 0.237),
        (0.018, 0.245),
        (0, 0.245),
    ],
    "gin": [
        (0, 0),
        (0.034, 0),
        (0.038, 0.005),
        (0.046, 0.17),
        (0.043, 0.19),
        (0.022, 0.208),
        (0.016, 0.222),
        (0.016, 0.262),
        (0.019, 0.264),
        (0.019, 0.272),
        (0, 0.272),
    ],
    "flask": [
        (0, 0),
        (0.036, 0),
        (0.05, 0.012),
        (0.056, 0.045),
        (0.052, 0.08),
        (0.034, 0.125),
        (0.019, 0.165),
        (0.014, 0.19),
        (0.014, 0.235),
        (0.017, 0.237),
        (0.017, 0.245),
        (0, 0.245),
    ],
}
LABELS = {
    "wine": (0.0385, 0.06, 0.14),
    "whisky": (0.047, 0.045, 0.12),
    "gin": None,
    "flask": (0.0562, 0.038, 0.055),
}


def make_bottle_meshes(b):
    kinds = (
        ("wine", "green", 0, "oxblood leather"),
        ("wine", "amber", 2, "black metal"),
        ("whisky", "amber", 0, "walnut"),
        ("whisky", "clear", 1, "brass"),
        ("gin", "blue", None, "steel"),
        ("gin", "clear", None, "oak"),
        ("flask", "red", 0, "brass"),
        ("flask", "green", 2, "walnut"),
        ("gin", "green", None, "brass"),
        ("wine", "clear", 1, "steel"),
    )
    out = []
    for shape, glass, label, cap in kinds:
        profile = BOTTLES[shape]
        neck, top = profile[-2]
        parts = [(lathe(profile, 18), glass + " glass")]
        stopper = lathe(
            [(0, top - SINK), (neck * 0.95, top - SINK), (neck * 1.05, top + 0.02), (0, top + 0.024)], 14
        )
        parts.append((stopper, cap))
        if label is not None:
            r, y0, y1 = LABELS[shape]
            band = lathe(
                [
                    (r - 0.0015, y0),
                    (r + 0.0008, y0),
                    (r + 0.0008, y1),
                    (r - 0.0015, y1),
                    (r - 0.0015, y0),
                ],
                18,
            )
            around = 2 * math.pi * (r + 0.0008)
            band.uvs = [
                (u / around, (y1 - p[1]) / (y1 - y0)) for (u, v), p in zip(band.uvs, band.positions)
            ]
            parts.append((band, "label %d" % label))
        out.append((b.mesh("bottle_%s_%s" % (shape, glass), *parts), max(p[0] for p in profile)))
    return out


def make_glass_meshes(b):
    tumbler = [
        (0, 0),
        (0.034, 0),
        (0.036, 0.003),
        (0.04, 0.1),
        (0.0375, 0.1),
        (0.0345, 0.012),
        (0, 0.012),
    ]
    pint = [(0, 0), (0.03, 0), (0.032, 0.003), (0.044, 0.15), (0.0415, 0.15), (0.031, 0.014), (0, 0.014)]
    stem = [(0, 0), (0.036, 0), (0.036, 0.003), (0.008, 0.007), (0.0045, 0.02), (0.0045, 0.085)]
    wine = stem + [
        (0.012, 0.094),
        (0.034, 0.118),
        (0.041, 0.15),
        (0.036, 0.2),
        (0.0345, 0.2),
        (0.0395, 0.15),
        (0.0325, 0.12),
        (0.011, 0.0965),
        (0, 0.0955),
    ]
    martini = stem + [(0.008, 0.092), (0.058, 0.145), (0.0562, 0.145), (0.006, 0.094), (0, 0.093)]
    drink = {
        "tumbler": ([(0, 0.0125), (0.0339, 0.0125), (0.036, 0.062), (0, 0.062)], "campari"),
        "pint": ([(0, 0.0145), (0.0303, 0.0145), (0.0395, 0.125), (0, 0.125)], "beer"),
        "martini": ([(0, 0.0945), (0.0055, 0.0945), (0.046, 0.136), (0, 0.136)], "lime"),
    }
    shapes = {"tumbler": tumbler, "pint": pint, "wine": wine, "martini": martini}
    out = {}
    for name, profile in shapes.items():
        out[name] = b.mesh("glass_" + name, (lathe(profile, 20), "clear glass"))
    foam = [(0, 0.1255), (0.0392, 0.1255), (0.0412, 0.147), (0.036, 0.152), (0, 0.154)]
    out["pint full"] = b.mesh(
        "pint_full",
        (lathe(pint, 20), "clear glass"),
        (lathe(drink["pint"][0], 20), "beer"),
        (lathe(foam, 20), "cream"),
    )
    out["tumbler full"] = b.mesh(
        "tumbler_full", (lathe(tumbler, 20), "clear glass"), (lathe(drink["tumbler"][0], 20), "campari")
    )
    out["martini full"] = b.mesh(
        "martini_full",
        (lathe(martini, 20), "clear glass"),
        (lathe(drink["martini"][0], 20), "blue glass"),
        (
            merge(
                sphere(0.009, 10, 6).translate(0.012, 0.14, 0),
                tube([(-0.03, 0.128, 0), (0.05, 0.157, 0)], 0.0012, 6),
            ),
            "lime",
        ),
    )
    return out


def make_backbar(b, bottles, glasses):
    x0, x1, wall = -3.55, 0.95, -Z
    cabinet = box_between((x0, -0.01, wall - 0.02), (x1, 0.9, wall + 0.46))
    for k in range(6):
        w = (x1 - x0) / 6
        x = x0 + w * (k + 0.5)
        cabinet.append(box(w - 0.06, 0.72, 0.03, (x, 0.48, wall + 0.465)).swap_uv())
    knobs = merge(
        *[
            sphere(0.016, 12, 8).translate(
                x0 + 0.75 * (k + 0.5) + (0.3 if k % 2 == 0 else -0.3), 0.7, wall + 0.492
            )
            for k in range(6)
        ]
    )
    b.node("backbar_cabinet", (cabinet, "walnut"), (knobs, "brass"))
    b.node(
        "backbar_top",
        (box_between((x0 - 0.03, 0.89, wall - 0.02), (x1 + 0.03, 0.935, wall + 0.5)), "oak"),
    )
    b.node(
        "backbar_tiles",
        (box_between((x0 + 0.02, 0.93, wall - 0.02), (x1 - 0.02, 2.13, wall + 0.015)), "tile"),
    )
    posts = Mesh()
    bays = [x0 + 0.025 + k * (x1 - x0 - 0.05) / 3 for k in range(4)]
    for x in bays:
        posts.append(
            box_between((x - 0.025, 0.93, wall - 0.01), (x + 0.025, 2.1, wall + 0.27)).swap_uv()
        )
    b.node("backbar_posts", (posts, "walnut"))
    shelves = Mesh()
    for k in range(3):
        for y in (1.34, 1.72):
            shelves.append(
                box_between(
                    (bays[k] + 0.02, y, wall + 0.005), (bays[k + 1] - 0.02, y + 0.025, wall + 0.255)
                )
            )
    b.node("backbar_shelves", (shelves, "oak"))
    b.node(
        "backbar_head",
        (
            merge(
                box_between((x0 - 0.03, 2.095, wall - 0.02), (x1 + 0.03, 2.145, wall + 0.3)),
                box_between((x0 - 0.05, 2.14, wall - 0.02), (x1 + 0.05, 2.175, wall + 0.33)),
            ),
            "walnut",
        ),
    )

    # light strips under the boards, near the tiles: one group of three area lights
    group = b.node("backbar_lights", layer="backbar")
    down = look((0, 0, 0), (0, -1, 0))
    for k, y in enumerate((1.338, 1.718, 2.093)):
        b.node(
            "backbar_strip_%d" % (k + 1),
            at=((x0 + x1) / 2, y, wall + 0.09),
            rotation=down,
            parent=group,
            area="rect %.2f 0.03" % (x1 - x0 - 0.2),
            color=[1.0, 0.86, 0.66],
            intensity=130.0,
        )

    rnd = random.Random(7)
    count = 0
    for level, y in enumerate((0.935, 1.365, 1.745)):
        for k in range(3):
            start, end = bays[k] + 0.09, bays[k + 1] - 0.09
            row = [(0.12, start)] if level else [(0.13, start), (0.3, start + 0.03)]
            if (level, k) == (1, 1):  # one bay for glasses
                for i in range(9):
                    for j in range(2):
                        b.node(
                            "shelf_glass_%d" % (i * 2 + j + 1),
                            mesh=glasses["wine" if i < 5 else "tumbler"],
                            at=(start + 0.06 + i * 0.135, y - SINK, wall + 0.1 + j * 0.095),
                        )
                continue
            for z, x in row:
                while x < end - 0.03:
                    mesh, r = bottles[rnd.randrange(len(bottles))]
                    x += r
                    if rnd.random() > (0.08 if z < 0.2 else 0.35) and x + r < end:
                        count += 1
                        b.node(
                            "bottle_%d" % count,
                            mesh=mesh,
                            turn=rnd.randrange(360),
                            at=(x, y - SINK, wall + z + 0.02 * (rnd.random() - 0.5)),
                            scale=round(0.94 + 0.16 * rnd.random(), 3),
                            density=0.7,
                        )
                    x += r + 0.012 + 0.03 * rnd.random()


# --- furniture ---------------------------------------------------------------------------------


def rounded_rect(w, h, r, steps=5):
    out = []
    for cx, cy, a0 in (
        (w / 2 - r, h / 2 - r, 0),
        (-w / 2 + r, h / 2 - r, 90),
        (-w / 2 + r, -h / 2 + r, 180),
        (w / 2 - r, -h / 2 + r, 270),
    ):
        for k in range(steps + 1):
            a = math.radians(a0 + 90 * k / steps)
            out.append((cx + r * math.cos(a), cy + r * math.sin(a)))
    return out


def make_furniture(b):
    metal = merge(
        lathe(
            [
                (0, 0),
                (0.21, 0),
                (0.215, 0.01),
                (0.2, 0.018),
                (0.05, 0.04),
                (0.03, 0.06),
                (0.026, 0.7),
                (0.12, 0.715),
                (0.12, 0.73),
                (0, 0.73),
            ],
            28,
        ),
        tube(
            [
                (0.15 * math.cos(a * math.pi / 14), 0.28, 0.15 * math.sin(a * math.pi / 14))
                for a in range(28)
            ],
            0.011,
            8,
            closed=True,
        ),
        tube([(-0.15, 0.28, 0), (0.15, 0.28, 0)], 0.009, 8),
        tube([(0, 0.28, -0.15), (0, 0.28, 0.15)], 0.009, 8),
    )
    seat = lathe(
        [
            (0, 0.725),
            (0.17, 0.725),
            (0.188, 0.735),
            (0.194, 0.76),
            (0.186, 0.785),
            (0.16, 0.8),
            (0.08, 0.806),
            (0, 0.807),
        ],
        28,
    )
    ring = lathe([(0.185, 0.722), (0.197, 0.722), (0.197, 0.738), (0.185, 0.738), (0.185, 0.722)], 28)
    stool = b.mesh("stool", (metal, "black metal"), (seat, "oxblood leather"), (ring, "brass"))
    for k in range(6):
        x = -3.35 + 0.84 * k
        b.node(
            "stool_%d" % (k + 1),
            mesh=stool,
            at=(x + 0.03 * math.sin(k * 2.3), -SINK, -0.7 + 0.05 * math.cos(k * 1.9)),
            turn=17 * k,
        )

    top = lathe(
        [(0, 0), (0.37, 0), (0.385, 0.006), (0.39, 0.018), (0.385, 0.03), (0.37, 0.036), (0, 0.036)], 40
    )
    top.uvs = [(p[0], p[2]) for p in top.positions]
    foot = lathe(
        [
            (0, 0),
            (0.23, 0),
            (0.235, 0.012),
            (0.21, 0.02),
            (0.06, 0.05),
            (0.036, 0.09),
            (0.032, 0.66),
            (0.1, 0.7),
            (0.1, 0.708),
            (0, 0.708),
        ],
        28,
    )
    table = b.mesh("table", (top.translate(0, 0.705, 0), "oak"), (foot, "black metal"))

    wood = Mesh()
    for sx in (-1, 1):  # legs, the back ones leaning
        wood.append(tube([(sx * 0.17, 0, 0.17), (sx * 0.165, 0.43, 0.16)], [0.013, 0.019], 10))
        wood.append(
            tube(
                [
                    (sx * 0.17, 0, -0.2),
                    (sx * 0.165, 0.44, -0.17),
                    (sx * 0.17, 0.66, -0.18),
                    (sx * 0.178, 0.86, -0.225),
                ],
                [0.013, 0.019, 0.017, 0.014],
                10,
            )
        )
        wood.append(tube([(sx * 0.168, 0.2, 0.165), (sx * 0.168, 0.2, -0.185)], 0.009, 8))
    wood.append(tube([(-0.168, 0.26, 0.164), (0.168, 0.26, 0.164)], 0.009, 8))
    arc = [(-0.178 + 0.0356 * k, -0.225 - 0.03 * math.sin(math.pi * k / 10)) for k in range(11)]
    for y, tall, lean in ((0.82, 0.09, 0.012), (0.64, 0.05, -0.028)):
        pts = [(x, z - lean if lean > 0 else z + 0.042) for x, z in arc]
        outline = [(x, -(z - 0.008)) for x, z in reversed(pts)] + [(x, -(z + 0.008)) for x, z in pts]
        wood.append(
            extrude(outline[::-1] if signed_area(outline) < 0 else outline, tall)
            .rotate((1, 0, 0), -90)
            .translate(0, y - tall / 2, 0)
        )
    apron = extrude(rounded_rect(0.4, 0.4, 0.05), 0.035).rotate((1, 0, 0), -90).translate(0, 0.415, 0)
    cushion = merge(
        extrude(rounded_rect(0.37, 0.37, 0.06), 0.03).rotate((1, 0, 0), -90).translate(0, 0.449, 0),
        extrude(rounded_rect(0.34, 0.34, 0.06), 0.012).rotate((1, 0, 0), -90).translate(0, 0.4785, 0),
    )
    chair = b.mesh("chair", (wood.swap_uv(), "walnut"), (apron, "walnut"), (cushion, "oxblood leather"))

    layout = (((0.55, 1.25), (20, 200)), ((-1.95, 1.75), (75, 250)), ((3.0, 1.1), (150, 262)))
    seats = 0
    for k, ((x, z), angles) in enumerate(layout):
        b.node("table_%d" % (k + 1), mesh=table, at=(x, -SINK, z), turn=35 * k)
        for a in angles:
            seats += 1
            r = 0.56 + 0.05 * math.sin(seats * 1.7)
            dx, dz = math.sin(math.radians(a)), math.cos(math.radians(a))
            b.node(
                "chair_%d" % seats,
                mesh=chair,
                at=(x + r * dx, -SINK, z + r * dz),
                turn=a + 180 + 12 * math.sin(seats * 2.7),
            )
    return [(x, 0.74, z) for (x, z), _ in layout]


def signed_area(poly):
    return sum(a[0] * c[1] - a[1] * c[0] for a, c in zip(poly, poly[1:] + poly[:1])) / 2


# --- things that shine -------------------------------------------------------------------------


def make_pendants(b):
    """Enamel shades over the counter; a spot below each bulb, so that the bulb is not in its way."""
    outer = [
        (0.16, 0.0),
        (0.155, 0.03),
        (0.12, 0.095),
        (0.07, 0.14),
        (0.04, 0.16),
        (0.035, 0.2),
        (0, 0.2),
    ]
    inner = [(0, 0.15), (0.03, 0.148), (0.062, 0.13), (0.112, 0.088), (0.147, 0.027), (0.156, 0.0)]
    shade = lathe(outer, 32)
    lining = lathe(inner + [(0.16, 0.0)], 32)
    cable = tube([(0, 0.195, 0), (0, 1.31, 0)], 0.004, 6)
    holder = cylinder(0.018, 0.05, 14).translate(0, 0.105, 0)
    rose = cylinder(0.05, 0.025, 20).translate(0, 1.3, 0)
    mesh = b.mesh(
        "pendant", (shade, "enamel"), (lining, "cream"), (merge(cable, holder, rose), "black metal")
    )
    bulb = b.mesh(
        "pendant_bulb",
        (
            lathe(
                [
                    (0, 0.03),
                    (0.016, 0.034),
                    (0.029, 0.05),
                    (0.03, 0.066),
                    (0.022, 0.088),
                    (0.015, 0.105),
                    (0, 0.11),
                ],
                18,
            ),
            "pendant_bulb",
        ),
    )
    down = look((0, 0, 0), (0, -1, 0))
    for k in range(4):
        x, y, z = -3.62 + 1.32 * k, 1.83, -1.42
        b.node("pendant_shade_%d" % (k + 1), mesh=mesh, at=(x, y, z))
        b.node("pendant_bulb_%d" % (k + 1), mesh=bulb, at=(x, y, z), layer="pendant_bulbs")
        lamp = b.g.add_light("spot", 110.0, (1.0, 0.82, 0.6), "pendant_%d" % (k + 1), inner=30, outer=64)
        b.node("pendant_%d" % (k + 1), light=lamp, at=(x, y - 0.005, z), rotation=down, radius=0.025)


def smooth(points, r, steps=6):
    """Rounds the corners of a polyline, as a glass bender would; points are (x, y) or (x, y, z)."""
    pts = [p if len(p) == 3 else (p[0], p[1], 0.0) for p in points]
    out = [pts[0]]
    for a, p, c in zip(pts, pts[1:], pts[2:]):
        u, v = v_sub(a, p), v_sub(c, p)
        d = min(r, 0.49 * math.dist(a, p), 0.49 * math.dist(c, p))
        a, c = v_add(p, v_mul(v_norm(u), d)), v_add(p, v_mul(v_norm(v), d))
        for k in range(steps + 1):
            t = k / steps
            out.append(
                tuple(a[i] * (1 - t) ** 2 + 2 * p[i] * t * (1 - t) + c[i] * t * t for i in range(3))
            )
    return out + [pts[-1]]


def arc_points(cx, cy, rx, ry, a0, a1, steps):
    return [
        (
            cx + rx * math.cos(math.radians(a0 + (a1 - a0) * k / steps)),
            cy + ry * math.sin(math.radians(a0 + (a1 - a0) * k / steps)),
            0.0,
        )
        for k in range(steps + 1)
    ]


def neon(b, name, strokes, at, turn, radius=0.011, standoff=0.05):
    """Tubes in front of a wall.  strokes: (points, closed).  Black ends lead into the wall."""
    glass, ends = Mesh(), Mesh()
    for points, closed in strokes:
        path = [(p[0], p[1], p[2] + standoff) for p in points]
        glass.append(tube(path, radius, 10, closed=closed))
        for p in () if closed else (path[0], path[-1]):
            ends.append(
                tube([(p[0], p[1], -0.01), (p[0], p[1], p[2] + radius + 0.006)], radius + 0.005, 12)
            )
    b.node(name, (glass, name), at=at, turn=turn)
    b.node(name + "_ends", (ends, "black metal"), at=at, turn=turn, density=0.4)


def make_neon(b):
    h, r = 0.44, 0.05
    letters = {
        "L": [smooth([(0, h), (0, 0), (0.27, 0)], r)],
        "U": [smooth([(0, h), (0, 0), (0.3, 0), (0.3, h)], 0.15, 10)],
        "X": [
            [(0, 0, 0), (0.3, h, 0)],
            smooth(
                [(0, h, 0), (0.09, h * 0.7, 0), (0.15, h * 0.5, 0.035), (0.21, h * 0.3, 0), (0.3, 0, 0)],
                0.05,
                4,
            ),
        ],
        "E": [
            smooth([(0.27, h), (0, h), (0, 0), (0.27, 0)], r),
            [(0.035, h * 0.52, 0), (0.23, h * 0.52, 0)],
        ],
    }
    strokes, x = [], 0.0
    for c, width in zip("LUXEL", (0.41, 0.45, 0.43, 0.41, 0.27)):
        strokes += [
            ([(p[0] + x, p[1], p[2] if len(p) > 2 else 0.0) for p in s], False) for s in letters[c]
        ]
        x += width
    wave = [
        (0.02 + (x - 0.04) * k / 40, -0.13 + 0.035 * math.sin(k / 40 * 2 * math.pi), 0.0)
        for k in range(41)
    ]
    strokes.append((wave, False))
    neon(b, "neon_pink", strokes, (-1.3 - x / 2, 2.38, -Z), FACE_FRONT, 0.0125)

    glass = smooth([(0, 0.36), (-0.3, 0.36), (0, 0), (0.3, 0.36), (0, 0.36)], 0.05, 5)
    foot = [(0, -0.03, 0.0), (0, -0.355, 0.0)]
    base = arc_points(0, -0.41, 0.19, 0.055, 0, 360, 36)[:-1]
    olive = arc_points(-0.06, 0.23, 0.05, 0.05, 40, 400, 20)[:-1]
    stick = [(0.0, 0.27, 0.0), (0.26, 0.54, 0.0)]
    drink = [(-0.19, 0.255, 0.0), (-0.14, 0.255, 0.0)], [(0.02, 0.255, 0.0), (0.19, 0.255, 0.0)]
    neon(
        b,
        "neon_blue",
        [(glass, True), (foot, False), (base, True), (olive, True), (stick, False), (drink[1], False)],
        (-X, 1.98, -2.12),
        FACE_RIGHT,
        0.011,
    )

    heads = [arc_points(sx, 0, 0.085, 0.065, 0, 360, 24)[:-1] for sx in (-0.2, 0.16)]
    heads = [
        [(cx + (x - cx) * 0.94 - y * 0.34, (x - cx) * 0.34 + y * 0.94, 0.0) for x, y, _ in hd]
        for hd, cx in zip(heads, (-0.2, 0.16))
    ]
    beam = smooth([(-0.105, 0.06), (-0.105, 0.46), (0.255, 0.54), (0.255, 0.13)], 0.03, 4)
    second = [(-0.075, 0.36, 0.0), (0.225, 0.43, 0.0)]
    neon(
        b,
        "neon_amber",
        [(heads[0], True), (heads[1], True), (beam, False), (second, False)],
        (X, 1.95, -0.15),
        FACE_LEFT,
        0.012,
    )


def make_candles(b, tables):
    flame = b.mesh(
        "flame",
        (
            lathe(
                [(0, 0), (0.0045, 0.003), (0.0068, 0.011), (0.0055, 0.022), (0.002, 0.034), (0, 0.038)],
                12,
            ),
            "candle_flame",
        ),
    )
    jar = lathe(
        [(0, 0), (0.036, 0), (0.038, 0.004), (0.041, 0.1), (0.0385, 0.1), (0.0355, 0.008), (0, 0.008)],
        22,
    )
    wax = lathe([(0, 0.0085), (0.0345, 0.0085), (0.036, 0.034), (0, 0.036)], 22)
    wick = tube([(0, 0.035, 0), (0.001, 0.047, 0.001)], 0.0012, 6)
    colors = ("amber", "red", "clear", "amber", "clear")
    holders = {
        c: b.mesh("candle_jar_" + c, (jar, c + " glass"), (wax, "wax"), (wick, "black metal"))
        for c in sorted(set(colors))
    }
    places = [v_add(t, (-0.06, 0, 0.05)) for t in tables] + [
        (1.12, 1.104, -1.3),
        (2.05, WINDOW[2] + 0.02, Z - 0.04),
    ]
    for k, p in enumerate(places):
        p = v_add(p, (0, -SINK, 0))
        b.node("candle_holder_%d" % (k + 1), mesh=holders[colors[k]], at=p)
        flicker = "flicker %gs low=0.6" % (0.14 + 0.02 * k)
        b.node("candle_%d" % (k + 1), mesh=flame, at=v_add(p, (0, 0.046, 0)), animate=flicker)


def arch(radius, foot, steps=20):
    """An arched path (x, y): up the left side, over, and down the right one."""
    out = (
        [(-radius, foot, 0.0)]
        + arc_points(0, 0.95, radius, radius, 180, 0, steps)
        + [(radius, foot, 0.0)]
    )
    return out


def make_jukebox(b):
    def shape(r, foot):
        pts = [(p[0], p[1]) for p in arch(r, foot)]
        return pts[::-1]

    at, turn = (X - 0.05, 0, -0.15), FACE_LEFT
    body = extrude(shape(0.44, 0.05), 0.5)
    body.append(
        extrude([(-0.46, -SINK), (0.46, -SINK), (0.46, 0.1), (-0.46, 0.1)], 0.524).translate(0, 0, 0.006)
    )
    chrome = tube([(p[0], p[1], 0.505) for p in arch(0.425, 0.095)], 0.014, 10)
    chrome.append(tube([(p[0], p[1], 0.505) for p in arch(0.325, 0.095)], 0.01, 10))
    chrome.append(tube([(p[0], p[1], 0.505) for p in arch(0.225, 0.52)], 0.01, 10))
    for k in range(7):
        x = -0.2 + 0.4 * k / 6
        chrome.append(box(0.012, 0.36, 0.024, (x, 0.3, 0.508)))
    chrome.append(box(0.47, 0.03, 0.03, (0, 0.502, 0.51)))
    grille = box(0.46, 0.37, 0.02, (0, 0.3, 0.495))
    b.node(
        "jukebox_body",
        (body, "walnut"),
        (chrome, "steel"),
        (grille, "oxblood leather"),
        at=at,
        turn=turn,
    )

    glow = Mesh()
    for r, foot, thick in ((0.376, 0.14, 0.034), (0.275, 0.14, 0.034)):
        path = []
        pts = arch(r, foot, 28)
        for a, c in zip(pts, pts[1:]):  # even steps, so that the colours run smoothly
            n = max(1, round(math.dist(a, c) / 0.05))
            path += [tuple(a[i] + (c[i] - a[i]) * k / n for i in range(3)) for k in range(n)]
        path.append(pts[-1])
        t = tube([(p[0], p[1], 0.5) for p in path], thick, 12)
        length = max(uv[1] for uv in t.uvs)
        t.uvs = [(0.125, uv[1] / length) for uv in t.uvs]
        glow.append(t)
    panel = extrude(shape(0.215, 0.525), 0.015)
    panel.uvs = [
        (0.25 + 0.75 * (0.02 + 0.96 * (p[0] + 0.215) / 0.43), 0.99 - 0.98 * (p[1] - 0.525) / 0.64)
        for p in panel.positions
    ]
    glow.append(panel.translate(0, 0, 0.495))
    b.node("jukebox", (glow, "jukebox"), at=at, turn=turn, animate="wheel 24s color=#ff8a70")


def make_tv(b):
    at = (2.0, 2.1, -Z)
    w, h = 1.12, 0.63
    case = merge(
        box(w + 0.03, h + 0.03, 0.05, (0, 0, 0.075)), box(0.24, 0.24, 0.07, (0, 0, 0.025), skip="-z")
    )
    b.node("tv_case", (case, "black metal"), at=at)
    b.node("tv_screen", (quad(w, h, fit=True), "tv"), at=v_add(at, (0, 0, 0.1015)), layer="tv", monitor="4x3")


def make_lava_lamp(b, at):
    glass = lathe([(0, 0.13), (0.055, 0.13), (0.062, 0.15), (0.052, 0.26), (0.034, 0.36), (0, 0.36)], 28)
    height = 0.23
    around = 2 * math.pi * 0.062
    glass.uvs = [
        (u / around, 1 - (p[1] - 0.13) / height) for (u, v), p in zip(glass.uvs, glass.positions)
    ]
    stand = lathe(
        [
            (0, 0),
            (0.062, 0),
            (0.064, 0.006),
            (0.04, 0.085),
            (0.064, 0.15),
            (0.061, 0.15),
            (0.04, 0.12),
            (0, 0.12),
        ],
        28,
    )
    cap = lathe([(0, 0.34), (0.0385, 0.34), (0.026, 0.41), (0, 0.415)], 24)
    b.node("lava_lamp_stand", (merge(stand, cap), "brass"), at=at)
    b.node("lava_lamp", (glass, "lava"), at=at)


def make_fairy_lights(b):
    """Two strings under the beams, each one node of many instances; one layer because their parent says so."""
    group = b.node("fairy_lights", layer="fairy", animate="pulse 7s low=0.5")
    bulb = b.mesh(
        "fairy_bulb",
        (
            lathe(
                [(0, 0), (0.008, 0.003), (0.013, 0.013), (0.011, 0.024), (0.006, 0.034), (0, 0.036)], 10
            ),
            "fairy_bulb",
        ),
    )
    cap = b.mesh("fairy_cap", (cylinder(0.0075, 0.016, 8), "black metal"))
    wire = Mesh()
    hooks = [
        [
            (-X + 0.01, 2.86, 0.3),
            (-3.0, 2.925, 0.1),
            (-1.0, 2.925, -0.35),
            (1.0, 2.925, 0.15),
            (3.0, 2.925, -0.2),
            (X - 0.01, 2.86, 0.2),
        ],
        [
            (-X + 0.01, 2.86, 1.5),
            (-3.0, 2.925, 1.3),
            (-1.0, 2.925, 1.75),
            (1.0, 2.925, 1.35),
            (3.0, 2.925, 1.8),
            (X - 0.01, 2.86, 1.6),
        ],
    ]
    for k, string in enumerate(hooks, 1):
        path = []
        for a, c in zip(string, string[1:]):
            span = math.dist(a, c)
            n = max(3, round(span / 0.11))
            sag = 0.11 * span / 2
            for i in range(n):
                t = i / n
                path.append(
                    (
                        a[0] + (c[0] - a[0]) * t,
                        a[1] + (c[1] - a[1]) * t - sag * 4 * t * (1 - t),
                        a[2] + (c[2] - a[2]) * t,
                    )
                )
        path.append(string[-1])
        wire.append(tube(path, 0.003, 5))
        places = path[2:-1:3]
        for name, mesh, below, density in (("cap", cap, 0.016, 0.3), ("bulb", bulb, 0.05, 1)):
            b.g.add_node(
                "fairy_%s_%d" % (name, k),
                mesh,
                extras={"luxel_density": density},
                parent=group,
                instances=[((x, y - below, z), (0, 0, 0, 1), (1, 1, 1)) for x, y, z in places],
            )
    b.node("fairy_wire", (wire, "black metal"), density=0.2)


def make_sconces(b):
    """Bowls that throw light up the wall: a KHR light with luxel_area is a disk, in candela."""
    bowl = [
        (0, 0),
        (0.05, 0.004),
        (0.1, 0.035),
        (0.125, 0.09),
        (0.119, 0.09),
        (0.094, 0.039),
        (0.048, 0.012),
        (0, 0.009),
    ]
    mesh = b.mesh(
        "sconce",
        (lathe(bowl, 28), "cream"),
        (
            merge(box(0.05, 0.1, 0.06, (0, 0.02, -0.125)), box(0.03, 0.02, 0.1, (0, 0.012, -0.08))),
            "brass",
        ),
    )
    lamp = b.g.add_light("point", 70.0, (1.0, 0.8, 0.56), "sconce")
    up = look((0, 0, 0), (0, 1, 0))
    for k, (at, turn) in enumerate(
        (
            ((X - 0.15, 1.8, 1.75), FACE_LEFT),
            ((-X + 0.15, 1.8, 2.05), FACE_RIGHT),
            ((-2.2, 1.8, Z - 0.15), FACE_BACK),
        )
    ):
        b.node("sconce_bowl_%d" % (k + 1), mesh=mesh, at=at, turn=turn)
        b.node(
            "sconce_%d" % (k + 1),
            light=lamp,
            at=v_add(at, (0, 0.06, 0)),
            rotation=up,
            area="disk 0.08",
            layer="sconces",
        )


def make_pictures(b):
    def frame(name, art, w, h, at, turn):
        bar = 0.045
        wood = merge(
            box(w + 2 * bar, bar, 0.03, (0, h / 2 + bar / 2, 0.013), skip="-z"),
            box(w + 2 * bar, bar, 0.03, (0, -h / 2 - bar / 2, 0.013), skip="-z"),
            box(bar, h + 0.002, 0.028, (-w / 2 - bar / 2 + 0.001, 0, 0.013), skip="-z").swap_uv(),
            box(bar, h + 0.002, 0.028, (w / 2 + bar / 2 - 0.001, 0, 0.013), skip="-z").swap_uv(),
        )
        b.node(
            name,
            (wood, "walnut"),
            (quad(w + 0.01, h + 0.01, fit=True).translate(0, 0, 0.008), art),
            at=at,
            turn=turn,
        )

    frame("picture_1", "artwork 2", 0.56, 0.7, (-X, 1.62, -0.42), FACE_RIGHT)
    frame("picture_2", "artwork 0", 0.48, 0.6, (X, 1.62, 1.0), FACE_LEFT)
    frame("picture_3", "artwork 1", 0.48, 0.6, (X, 1.62, 2.45), FACE_LEFT)
    frame("picture_4", "artwork 1", 0.5, 0.62, (-3.1, 1.6, Z), FACE_BACK)
    frame("picture_5", "artwork 0", 0.5, 0.62, (-1.4, 1.6, Z), FACE_BACK)
    frame("picture_6", "artwork 1", 0.44, 0.55, (-X, 1.6, 2.55), FACE_RIGHT)
    frame("menu", "chalkboard", 0.6, 0.8, (2.0, 1.25, -Z), FACE_FRONT)
    # a picture light: a brass bar on an arm, and a spot that looks back at the picture
    arm = merge(
        tube(smooth([(0, 2.12, -0.01), (0, 2.12, 0.03), (0, 2.2, 0.1), (0, 2.2, 0.2)], 0.03), 0.006, 8),
        tube([(-0.16, 2.2, 0.2), (0.16, 2.2, 0.2)], 0.02, 12),
    )
    b.node("picture_lamp", (arm, "brass"), at=(-X, 0, -0.42), turn=FACE_RIGHT)
    lamp = b.g.add_light("spot", 12.0, (1.0, 0.84, 0.62), "picture_light", inner=20, outer=55)
    eye = (-X + 0.2, 2.162, -0.42)
    b.node("picture_light", light=lamp, at=eye, rotation=look(eye, (-X, 1.62, -0.42)), radius=0.015)


# --- dressing ----------------------------------------------------------------------------------


def make_plant(b, at):
    pot = lathe(
        [
            (0, 0),
            (0.15, 0),
            (0.155, 0.01),
            (0.2, 0.34),
            (0.215, 0.345),
            (0.215, 0.39),
            (0.19, 0.39),
            (0.178, 0.33),
            (0, 0.32),
        ],
        32,
    )
    soil = lathe([(0, 0.3), (0.17, 0.3), (0.178, 0.345), (0.09, 0.36), (0, 0.362)], 24)
    b.node("plant_pot", (pot, "terracotta"), (soil, "soil"), at=at)
    blade = grid(0.26, 0.44, 4, 6, fit=True)  # grows along +y from the origin, bends down and folds
    pts = []
    for x, y, _ in blade.positions:
        t = (y + 0.22) / 0.44
        pts.append((x, 0.44 * t - 0.05 * t * t, -0.17 * t * t + 0.9 * x * x - 0.018))
    blade.positions = pts
    nor = [[0, 0, 0] for _ in pts]
    for k in range(0, len(blade.indices), 3):
        i, j, l = blade.indices[k : k + 3]
        u, v = v_sub(pts[j], pts[i]), v_sub(pts[l], pts[i])
        n = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
        for q in (i, j, l):
            nor[q] = v_add(nor[q], n)
    blade.normals = [v_norm(n) for n in nor]
    leaf = b.mesh("leaf", (blade, "leaf"))
    rnd = random.Random(3)
    stems = Mesh()
    count = 34
    for k in range(count):
        ring = k / count
        a = k * 2.39996
        reach = 0.1 + 0.3 * (1 - ring) + 0.06 * rnd.random()
        high = 0.5 + 0.85 * ring + 0.1 * rnd.random()
        ox, oz = 0.07 * math.cos(a), 0.07 * math.sin(a)
        tip = (ox + reach * math.cos(a), high, oz + reach * math.sin(a))
        stems.append(
            tube(
                [
                    (ox, 0.34, oz),
                    (
                        ox * 1.5 + 0.25 * reach * math.cos(a),
                        0.34 + (high - 0.34) * 0.6,
                        oz * 1.5 + 0.25 * reach * math.sin(a),
                    ),
                    tip,
                ],
                [0.007, 0.006, 0.004],
                6,
            )
        )
        # the blade's own +y leaves the stem outwards, its +z looks up
        tilt = 62 - 44 * ring + 10 * rnd.random()
        q = quat_mul(
            quat((0, 1, 0), 90 - math.degrees(a) + 20 * (rnd.random() - 0.5)), quat((1, 0, 0), tilt)
        )
        b.node(
            "leaf_%d" % (k + 1),
            mesh=leaf,
            at=v_add(at, tip),
            rotation=q,
            scale=round(0.8 + 0.45 * rnd.random() * (1.2 - ring), 3),
        )
    b.node("plant_stems", (stems, "stem"), at=at)


def make_barrel(b, at):
    n = 14
    bulge = [(0.27 + 0.06 * math.sin(math.pi * k / n), 0.88 * k / n) for k in range(n + 1)]
    wood = lathe([(0, 0.0)] + bulge + [(0.245, 0.88), (0.24, 0.862), (0, 0.862)], 30)
    hoops = Mesh()
    for y in (0.04, 0.2, 0.66, 0.82):
        r0 = 0.27 + 0.06 * math.sin(math.pi * y / 0.88)
        r1 = 0.27 + 0.06 * math.sin(math.pi * (y + 0.035) / 0.88)
        hoops.append(
            lathe(
                [
                    (r0 - 0.006, y),
                    (r0 + 0.003, y),
                    (r1 + 0.003, y + 0.035),
                    (r1 - 0.006, y + 0.035),
                    (r0 - 0.006, y),
                ],
                30,
            )
        )
    b.node("barrel", (wood.swap_uv(), "oak"), (hoops, "black metal"), at=v_add(at, (0, -SINK, 0)))


def make_clutter(b, glasses, bottles, tables):
    top = 1.104 - SINK
    drinks = (
        ("pint full", -3.2, -1.22),
        ("pint full", -2.55, -1.16),
        ("tumbler full", -1.72, -1.2),
        ("martini full", -1.5, -1.28),
        ("pint full", 0.02, -1.2),
        ("tumbler full", 0.3, -1.27),
        ("martini full", 0.8, -1.17),
        ("tumbler", -2.1, -1.62),
        ("tumbler", -2.0, -1.66),
        ("pint", -0.95, -1.62),
        ("pint", -1.06, -1.58),
    )
    for k, (kind, x, z) in enumerate(drinks):
        b.node("drink_%d" % (k + 1), mesh=glasses[kind], at=(x, top, z))
    k = len(drinks)
    for (x, y, z), kinds in zip(
        tables,
        (("pint full", "tumbler full"), ("martini full", "pint full"), ("pint full", "martini full")),
    ):
        for i, kind in enumerate(kinds):
            k += 1
            b.node(
                "drink_%d" % k,
                mesh=glasses[kind],
                at=(x + 0.19 * math.cos(k * 2.2), y - SINK, z + 0.19 * math.sin(k * 2.2)),
            )
    shaker = lathe(
        [
            (0, 0),
            (0.036, 0),
            (0.045, 0.13),
            (0.045, 0.145),
            (0.032, 0.19),
            (0.02, 0.205),
            (0.02, 0.235),
            (0, 0.24),
        ],
        24,
    )
    b.node("shaker", (shaker, "steel"), at=(-2.75, top, -1.6))
    bowl = lathe(
        [(0, 0), (0.05, 0), (0.055, 0.01), (0.1, 0.06), (0.095, 0.062), (0.05, 0.016), (0, 0.014)], 24
    )
    fruit = merge(
        *[
            sphere(0.029, 14, 9).translate(*p)
            for p in (
                (0.035, 0.046, 0.01),
                (-0.03, 0.046, 0.025),
                (0.0, 0.046, -0.04),
                (0.003, 0.086, 0.0),
            )
        ]
    )
    b.node("lime_bowl", (bowl, "cream"), (fruit, "lime"), at=(0.5, top, -1.52))
    card = extrude([(-0.05, 0), (0.05, 0), (0.004, 0.15), (-0.004, 0.15)], 0.12).translate(0, 0, -0.06)
    mesh = b.mesh("menu_card", (card, "paper"))
    for i, (x, y, z) in enumerate(
        [(-2.3, top, -1.25)] + [(t[0] + 0.05, t[1] - SINK, t[2] - 0.2) for t in tables]
    ):
        b.node("menu_card_%d" % (i + 1), mesh=mesh, at=(x, y, z), turn=60 + 70 * i, scale=0.8)


def make_street(b):
    b.node(
        "pavement", (box_between((-12, -0.5, Z + 0.1), (14, -0.15, Z + 4.2)), "asphalt"), density=0.12
    )
    b.node("road", (box_between((-12, -0.6, Z + 4.1), (16, -0.28, Z + 14.2)), "asphalt"), density=0.08)
    b.node("house_across", (box_between((-12, -0.5, Z + 14), (16, 5.3, Z + 15)), "render"), density=0.06)
    b.node(
        "house_windows",
        (quad(26, 4.8, fit=True), "facade"),
        at=(2, 2.5, Z + 13.98),
        turn=FACE_BACK,
        density=0.1,
    )
    x, y, z = 3.3, 3.0, Z + 3.4
    pole = merge(
        cylinder(0.09, 0.25, 16).translate(0, -0.16, 0),
        tube(
            smooth([(0, 0, 0), (0, y + 0.1, 0), (0, y + 0.3, -0.1), (0, y + 0.26, -0.3)], 0.12, 6),
            0.035,
            12,
        ),
    )
    hood = lathe([(0.19, 0.0), (0.17, 0.04), (0.06, 0.12), (0.05, 0.2), (0, 0.2)], 24)
    under = lathe([(0, 0.07), (0.06, 0.07), (0.185, 0.0), (0.19, 0.0)], 24)
    b.node(
        "street_pole",
        (pole, "black metal"),
        (hood.translate(0, y + 0.1, -0.3), "black metal"),
        (under.translate(0, y + 0.1, -0.3), "cream"),
        at=(x, 0, z),
        density=0.4,
    )
    lens = lathe([(0, -0.05), (0.06, -0.035), (0.09, 0.0), (0.09, 0.02), (0, 0.03)], 20)
    b.node("street_lens", (lens, "street_lens"), at=(x, y + 0.12, z - 0.3))
    eye = (x, y + 0.04, z - 0.3)
    lamp = b.g.add_light("spot", 1800.0, (0.62, 0.86, 1.0), "street_lamp", inner=35, outer=80)
    b.node("street_lamp", light=lamp, at=eye, rotation=look(eye, (1.0, 0.2, 1.8)), radius=0.02)
    moon = b.g.add_light("directional", 0.25, (0.75, 0.85, 1.0), "moon")
    b.node("moon", light=moon, at=(-2, 8, 12), rotation=look((-0.6, 0.85, 1.0), (0, 0, 0)), radius=0.53)


def make_animations(b):
    """Light that glTF itself animates: the lava lamp breathes, the exit sign has a bad contact."""
    lava, exit_sign = b.materials["lava"][0], b.materials["exit"][0]
    still = (0.0, 0.0, 0.0)
    breath = []
    for color in ((1.0, 1.0, 1.0), (1.0, 0.45, 0.35), (0.75, 0.9, 1.0), (1.0, 1.0, 1.0)):
        breath += [still, color, still]
    b.g.add_animation("lava", ("/materials/%d/emissiveFactor" % lava, (0.0, 4.0, 8.0, 12.0), breath, "CUBICSPLINE"))
    strength = "/materials/%d/extensions/KHR_materials_emissive_strength/emissiveStrength" % exit_sign
    times, values = (0.0, 5.0, 5.1, 5.25, 5.4, 9.0), (8.0, 1.0, 8.0, 2.0, 8.0, 8.0)
    b.g.add_animation("exit sign", (strength, times, values, "STEP"))


def make_cameras(b):
    for name, eye, target, fov in (
        ("main", (2.7, 1.5, 2.2), (-1.05, 1.36, -1.9), 48),
        ("window", (-3.0, 1.6, -0.75), (2.3, 1.15, 2.0), 47),
    ):
        b.node(name, camera=b.g.add_camera(name, fov, aspect=16 / 9), at=eye, rotation=look(eye, target))


def build():
    b = Bar()
    make_materials(b)
    make_cameras(b)
    make_room(b)
    make_trim(b)
    make_window(b)
    make_door(b)
    make_counter(b)
    bottles = make_bottle_meshes(b)
    glasses = make_glass_meshes(b)
    make_backbar(b, bottles, glasses)
    tables = make_furniture(b)
    make_pendants(b)
    make_neon(b)
    make_candles(b, tables)
    make_jukebox(b)
    make_tv(b)
    make_barrel(b, (2.75, 0, -2.5))
    make_lava_lamp(b, (2.75, 0.862 - 2 * SINK, -2.5))
    make_fairy_lights(b)
    make_sconces(b)
    make_pictures(b)
    make_plant(b, (3.42, -SINK, 2.42))
    make_clutter(b, glasses, bottles, tables)
    make_street(b)
    make_animations(b)
    return b.g


def main():
    out = (
        sys.argv[1]
        if len(sys.argv) > 1
        else os.path.join(os.path.dirname(os.path.abspath(__file__)), "bar.glb")
    )
    g = build()
    g.save(out)
    print(
        "%s: %d triangles, %d nodes, %d bytes"
        % (out, g.triangles(), len(g.json["nodes"]), os.path.getsize(out))
    )


if __name__ == "__main__":
    main()
