"""Small scenes that are hard in different ways, in which one integrator is compared with another: no closed form is known for them."""

import math
import random

from gltf import Gltf, box, box_between, cylinder, grid, look, quad, quat, sphere

DOWN = quat((1, 0, 0), 90)   # turns a quad's +Z to -Y
UP = quat((1, 0, 0), -90)    # and to +Y
SKY = ("--sky", "1,1.2,1.6")

ROOMS = {}


def room(function):
    """Registers a scene: the function returns it, or it and options for the bake."""
    ROOMS[function.__name__] = function
    return function


def make(name):
    """(Gltf, options)"""
    made = ROOMS[name]()
    return made if isinstance(made, tuple) else (made, ())


def shell(scene, size, color=(0.7, 0.7, 0.7), name="walls"):
    """A closed room that stands on y = 0."""
    material = scene.add_material(name, base_color=color)
    scene.add_node(name, mesh=scene.add_mesh(name, (box(*size, (0, size[1] / 2, 0)).flip(), material)))
    return material


def put(scene, name, mesh, material, translation=(0, 0, 0), rotation=None, extras=None):
    scene.add_node(name, mesh=scene.add_mesh(name, (mesh, material)), translation=translation, rotation=rotation, extras=extras)


def panel(scene, name, width, height, place, turn=DOWN, nit=20, color=(1, 1, 1), **material):
    shine = scene.add_material(name, base_color=(0.1, 0.1, 0.1), emissive=color, strength=nit, **material)
    put(scene, name, quad(width, height, fit=True), shine, place, turn)


@room
def cornell():
    """A white box with a red and a green wall, two blocks, a bright square in the ceiling."""
    scene = Gltf()
    white, red, green = (scene.add_material(n, base_color=c) for n, c in
                         (("white", (0.73, 0.73, 0.73)), ("red", (0.63, 0.06, 0.05)), ("green", (0.14, 0.45, 0.09))))
    inside = box(2, 2, 2, (0, 1, 0), skip="-x +x +z").flip()
    put(scene, "box", inside, white)
    put(scene, "left", quad(2, 2), red, (-1, 1, 0), quat((0, 1, 0), 90))
    put(scene, "right", quad(2, 2), green, (1, 1, 0), quat((0, 1, 0), -90))
    put(scene, "tall", box(0.6, 1.2, 0.6, (0, 0.6, 0)), white, (-0.35, 0, -0.3), quat((0, 1, 0), 20))
    put(scene, "short", box(0.6, 0.6, 0.6, (0, 0.3, 0)), white, (0.35, 0, 0.35), quat((0, 1, 0), -18))
    panel(scene, "light", 0.5, 0.4, (0, 1.995, 0))
    return scene


@room
def white_room():
    """Albedo 0.85, a lamp that shines at the ceiling alone: nearly all light has bounced, many times."""
    scene = Gltf()
    shell(scene, (4, 2.5, 3), (0.85, 0.85, 0.85))
    put(scene, "table", box(1.2, 0.05, 0.8, (0, 0.75, 0)), scene.add_material("wood", base_color=(0.6, 0.4, 0.25)), (0.8, 0, 0.2))
    light = scene.add_light("spot", 200, inner=10, outer=50)
    scene.add_node("lamp", light=light, translation=(-1.2, 0.6, -0.6), rotation=look((0, 0, 0), (0, 1, 0)), extras={"luxel_radius": 0.05})
    return scene


@room
def emissive_panels():
    """Panels with pictures, a shining ball of many triangles, a strip along an edge."""
    scene = Gltf()
    grey = shell(scene, (4, 3, 4), (0.6, 0.6, 0.6))
    rng = random.Random(3)
    picture = scene.add_image("spots", 16, 16, bytes(255 if rng.random() < 0.15 else 5 for _ in range(16 * 16 * 3)), wrap=False)
    panel(scene, "picture", 1.6, 1.2, (0, 1.6, -1.995), (0, 0, 0, 1), emissive_texture=picture)
    ball = scene.add_material("ball", base_color=(0.1, 0.1, 0.1), emissive=(0.2, 0.5, 1), strength=30)
    put(scene, "ball", sphere(0.2, 20, 12), ball, (1.1, 0.9, 0.7))
    panel(scene, "strip", 3.9, 0.03, (0, 2.9, 1.98), quat((1, 0, 0), 180), nit=150, color=(1, 0.4, 0.2))
    put(scene, "block", box(0.9, 0.9, 0.9, (0, 0.45, 0)), grey, (-0.9, 0, 0.5), quat((0, 1, 0), 30))
    return scene


@room
def courtyard():
    """Open to the sky and the sun, a colonnade in its shade."""
    scene = Gltf()
    stone = scene.add_material("stone", base_color=(0.6, 0.55, 0.45))
    put(scene, "yard", box(6, 3, 6, (0, 1.5, 0), skip="+y").flip(), stone)
    put(scene, "roof", box(2, 0.2, 6, (-2, 2.4, 0)), stone)
    for k in range(4):
        put(scene, "column %d" % k, cylinder(0.2, 2.3, 16), stone, (-1.2, 0, 1.6 * k - 2.4))
    sun = scene.add_light("directional", 20, color=(1, 0.9, 0.7))
    scene.add_node("sun", light=sun, rotation=look((0, 0, 0), (-0.5, -1, 0.3)), extras={"luxel_radius": 0.5})
    return scene, SKY


@room
def windows():
    """A room behind panes: blended, tinted glass, a grille cut out of a sheet."""
    scene = Gltf()
    wall = scene.add_material("wall", base_color=(0.7, 0.68, 0.6))
    put(scene, "room", box(4, 2.6, 4, (0, 1.3, 0), skip="+z").flip(), wall)
    pane = scene.add_material("pane", base_color=(0.8, 0.9, 0.9, 0.3), alpha="BLEND", double_sided=True)
    glass = scene.add_material("glass", base_color=(1, 0.5, 0.2), transmission=0.9, double_sided=True)
    pixels = bytes(b for y in range(8) for x in range(8) for b in (90, 60, 40, 0 if (x % 4 and y % 4) else 255))
    grille = scene.add_material("grille", base_color=(1, 1, 1), texture=scene.add_image("grille", 8, 8, pixels, 4, nearest=True), alpha="MASK",
                                double_sided=True)
    for k, material in enumerate((pane, glass, grille)):
        put(scene, "window %d" % k, quad(1.3, 2.6), material, (1.333 * (k - 1), 1.3, 2))
    put(scene, "screen", quad(1.5, 1.5), grille, (0.4, 0.75, 0.4), quat((0, 1, 0), 35))
    sun = scene.add_light("directional", 30)
    scene.add_node("sun", light=sun, rotation=look((0, 0, 0), (-0.2, -0.7, -1)), extras={"luxel_radius": 2})
    return scene, SKY


@room
def sheets():
    """Double-sided sheets without thickness between two halves of a room, leaves above the floor, a lamp on one side."""
    scene = Gltf()
    shell(scene, (4, 2.6, 3), (0.7, 0.7, 0.7))
    paper = scene.add_material("paper", base_color=(0.8, 0.75, 0.6), double_sided=True)
    put(scene, "partition", quad(2.2, 2.6), paper, (0, 1.3, 0.4), quat((0, 1, 0), 90))
    for k in range(5):
        put(scene, "leaf %d" % k, quad(0.5, 0.4), paper, (0.6 + 0.25 * k, 0.25 + 0.2 * k, -0.8 + 0.3 * k), quat((1, 0.3 * k, 0.2), -70 + 12 * k))
    panel(scene, "lamp", 0.6, 0.6, (-1.2, 2.595, 0))
    return scene


@room
def screens():
    """Two monitors whose cells are layers of their own."""
    import textures
    scene = Gltf()
    shell(scene, (4, 2.6, 3), (0.55, 0.55, 0.6))
    width, height, pixels, channels = textures.test_card()
    card = scene.add_image("card", width, height, pixels, channels, wrap=False)
    for name, place, turn, grid_text in (("tv", (0, 1.4, -1.49), (0, 0, 0, 1), "4x3"), ("sign", (-1.99, 1.5, 0.4), quat((0, 1, 0), 90), "2x2")):
        shine = scene.add_material(name, base_color=(0.02, 0.02, 0.02), emissive=(1, 1, 1), emissive_texture=card, strength=40)
        put(scene, name, quad(1.6, 0.9, fit=True), shine, place, turn, {"luxel_monitor": grid_text})
    put(scene, "block", box(0.7, 0.7, 0.7, (0, 0.35, 0)), scene.add_material("red", base_color=(0.6, 0.2, 0.1)), (0.5, 0, 0.2))
    return scene


@room
def thin_walls():
    """Three cells side by side behind walls of one centimetre; light in the middle one, a slit into the next."""
    scene = Gltf()
    wall = scene.add_material("wall", base_color=(0.75, 0.75, 0.75))
    for k, x in enumerate((-2.01, 0.0, 2.01)):
        put(scene, "cell %d" % k, box(2, 2, 2, (0, 1, 0), skip="+x" if k == 1 else "-x" if k == 2 else "").flip(), wall, (x, 0, 0))
    put(scene, "half wall", box_between((1.0, 0, -1), (1.01, 2, 0.85)), wall)
    bulb = scene.add_light("point", 30, color=(1, 0.9, 0.8))
    scene.add_node("bulb", light=bulb, translation=(-0.3, 1.5, -0.2), extras={"luxel_radius": 0.08})
    return scene


@room
def clutter():
    """Many things of about a texel, on each other and close to walls: little of the cache is good there."""
    scene = Gltf()
    shell(scene, (3, 2.5, 3), (0.7, 0.7, 0.7))
    paint = [scene.add_material("paint %d" % k, base_color=c) for k, c in enumerate(((0.8, 0.3, 0.2), (0.3, 0.5, 0.8), (0.8, 0.8, 0.75)))]
    rng = random.Random(11)
    for k in range(36):
        size = [rng.uniform(0.04, 0.25) for _ in range(3)]
        place = (rng.uniform(-1.2, 1.2), size[1] / 2 + rng.choice((0.003, 0.02, 0.3)), rng.uniform(-1.2, 1.2))
        put(scene, "thing %d" % k, box(*size), paint[k % 3], place, quat((0, 1, 0), rng.uniform(0, 90)))
    put(scene, "shelf", box(2.9, 0.03, 0.3), paint[2], (0, 1.2, -1.33))
    scene.add_node("tube", translation=(0.2, 2.4, 0.1), rotation=look((0, 0, 0), (0, -1, 0)),
                   extras={"luxel_area": "rect 1.2 0.1", "luxel_color": [1, 0.9, 0.8], "luxel_intensity": 60})
    return scene


@room
def round_things():
    """Smooth normals on coarse meshes: a ball, a vase, a wavy floor."""
    scene = Gltf()
    wall = scene.add_material("wall", base_color=(0.6, 0.62, 0.65))
    put(scene, "room", box(4, 3, 4, (0, 1.5, 0), skip="-y").flip(), wall)
    floor = grid(4, 4, 24, 24)
    floor.positions = [(x, y, 0.12 * math.sin(3 * x) * math.cos(2.5 * y)) for x, y, _ in floor.positions]
    slopes = [(-0.36 * math.cos(3 * x) * math.cos(2.5 * y), 0.3 * math.sin(3 * x) * math.sin(2.5 * y), 1.0) for x, y, _ in floor.positions]
    floor.normals = [tuple(c / math.sqrt(sum(d * d for d in n)) for c in n) for n in slopes]
    put(scene, "floor", floor, wall, rotation=UP)
    orange = scene.add_material("orange", base_color=(0.8, 0.4, 0.1))
    put(scene, "ball", sphere(0.5, 16, 10), orange, (-0.7, 0.75, -0.4))
    put(scene, "vase", cylinder(0.3, 0.9, 12, top=0.15), orange, (0.8, 0.1, 0.5))
    bulb = scene.add_light("point", 25)
    scene.add_node("bulb", light=bulb, translation=(0.4, 2.4, 0.3), extras={"luxel_radius": 0.15})
    panel(scene, "panel", 1, 0.7, (1.995, 1.6, -0.6), quat((0, 1, 0), -90), nit=8, color=(0.4, 0.6, 1))
    return scene


@room
def sky_picture():
    """Blocks on open ground below a sky with a small bright spot. (The picture, sky.hdr, is written beside the scene.)"""
    from skies import hdr, sun_picture
    hdr("sky.hdr", sun_picture())
    scene = Gltf()
    ground = scene.add_material("ground", base_color=(0.5, 0.5, 0.45))
    put(scene, "ground", quad(8, 8), ground, rotation=UP)
    put(scene, "house", box(2, 1.5, 1.5, (0, 0.75, 0)), scene.add_material("brick", base_color=(0.6, 0.3, 0.2)), (-0.8, 0, 0.3))
    put(scene, "arch", box_between((1, 0, -1), (1.3, 1.4, -0.7)), ground)
    put(scene, "arch 2", box_between((2.2, 0, -1), (2.5, 1.4, -0.7)), ground)
    put(scene, "lintel", box_between((1, 1.4, -1), (2.5, 1.7, -0.7)), ground)
    return scene, ("--sky", "sky.hdr")
