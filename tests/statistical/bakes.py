"""Baked texels: their places, their values, and how layers add up."""

import json
import math
import os

import exr
import oracle
from gltf import Gltf, box, box_between, look, quad, quat, quat_rotate, v_add, v_dot, v_len, v_mul, v_norm, v_sub
from harness import expect, luxel, read
from lamps import COLOR, DOWN, lamp, node
import measure
from measure import below, both, compare, compare_mean, grey, limit
from skies import hdr

HALF = 2e-3   # what rounding of the irradiance cache to half floats may do to sums of layers
LOW, HIGH = 0.1, 0.9  # lightmap coordinates of our quads: the rest is padding


class Baked:
    def __init__(self, folder):
        self.folder = folder
        with open(os.path.join(folder, "luxel.json")) as file:
            self.manifest = json.load(file)
        self.layers = {}
        for entry in self.manifest["files"]:
            if entry["format"] == "exr" and entry["page"] == 0:
                self.width, self.height, channels = exr.read(os.path.join(folder, entry["file"]))
                layer = self.manifest["layers"][entry["layer"]]
                self.layers[layer["name"]] = [channels[c] for c in "RGB"]
                self.covered = [a > 0 for a in channels["A"]]

    def factor(self, name):
        layer, = (l for l in self.manifest["layers"] if l["name"] == name)
        return [c * layer["intensity"] for c in layer["color"]]

    def texels(self):
        return [t for t, c in enumerate(self.covered) if c]

    def sum(self):
        """Per channel, per texel: the sum of all layers at their authored colours."""
        total = [[0.0] * (self.width * self.height) for _ in range(3)]
        for name, channels in self.layers.items():
            for c, factor in enumerate(self.factor(name)):
                total[c] = [a + factor * b for a, b in zip(total[c], channels[c])]
        return total


def bake(scene, out, page, samples, bounces, *options):
    scene.save("scene.glb")
    luxel("bake", "scene.glb", "-o", out, "--page-size", str(page), "--samples", str(samples), "--bounces", str(bounces), "--format",
          "exr", "--no-preview", "--quiet", *measure.integrator, *options, timeout=600)
    return Baked(out)


def mapped_quad(width, height):
    """A quad with lightmap coordinates: left to right and top to bottom, seen from its front."""
    mesh = quad(width, height)
    mesh.uv1 = [(LOW, HIGH), (HIGH, HIGH), (HIGH, LOW), (LOW, LOW)]
    return mesh


def texel_points(page, i, j, width, height, steps=3):
    """Points on the quad, spread over the square of texel (i, j); None if the quad does not cover all of it."""
    out = []
    for b in range(steps):
        for a in range(steps):
            u, v = (i + (a + 0.5) / steps) / page, (j + (b + 0.5) / steps) / page
            out.append((((u - LOW) / (HIGH - LOW) - 0.5) * width, (0.5 - (v - LOW) / (HIGH - LOW)) * height, 0.0))
    whole = i / page >= LOW and (i + 1) / page <= HIGH and j / page >= LOW and (j + 1) / page <= HIGH
    return out if whole else None


def floor_texels(baked, name, size, place, irradiance_at, turn=DOWN, scale=(1, 1, 1)):
    """(expected, got) of all texels that a quad of this size covers."""
    normal = quat_rotate(turn, (0, 0, 1 if scale[0] * scale[1] * scale[2] > 0 and scale[2] > 0 else math.copysign(1, scale[2])))
    expected, got = [], []
    for j in range(baked.height):
        for i in range(baked.width):
            spots = texel_points(baked.width, i, j, *size)
            if spots is None:
                continue
            world = [v_add(place, quat_rotate(turn, tuple(c * s for c, s in zip(p, scale)))) for p in spots]
            expected.append(math.fsum(irradiance_at(p, normal) for p in world) / len(world))
            got.append(tuple(c[j * baked.width + i] for c in baked.layers[name]))
    return expected, got


UP = quat((1, 0, 0), -90)  # turns a quad's +Z into +Y


def floor_scene(scene, size, turn=UP, scale=None, place=(0, 0, 0)):
    white = scene.add_material("floor", base_color=(0.5, 0.5, 0.5))
    node(scene, "floor", mesh=scene.add_mesh("floor", (mapped_quad(*size), white)), rotation=turn, scale=scale, translation=place)


@both
def texels_of_a_floor_hold_the_mean_of_a_point_light():
    place, size = (0.3, 0.5, -0.7), (3.0, 2.0)
    scene = lamp("point", 20, place)
    floor_scene(scene, size)

    def light(p, n):
        to = v_sub(place, p)
        return v_dot(to, n) / v_len(to) ** 3
    baked = bake(scene, "out", 64, 64, 0)
    expected, got = floor_texels(baked, "lamp", size, (0, 0, 0), light, UP)
    compare("each texel", grey(expected), got, 0.01, 64)
    compare_mean("mean of the floor", math.fsum(expected) / len(expected), [g[0] for g in got], 5e-4, 64)
    expect([round(c, 4) for c in baked.factor("lamp")] == [20 * c for c in COLOR], "factor %s" % baked.factor("lamp"))


@both
def texels_under_a_rectangle_light_meet_lamberts_formula():
    scene, size = Gltf(), (3.0, 2.0)
    turn = look((0, 0, 0), (0.4, -1, 0.3))
    place = (0.5, 0.8, 0.2)
    node(scene, "lamp", translation=place, rotation=turn, extras={"luxel_area": "rect 1 0.5"})
    floor_scene(scene, size)
    corners = oracle.rectangle(place, quat_rotate(turn, (0.5, 0, 0)), quat_rotate(turn, (0, 0.25, 0)))
    front = quat_rotate(turn, (0, 0, -1))

    def light(p, n):
        return math.pi * oracle.polygon(corners, p, n) if v_dot(v_sub(p, place), front) > 0 else 0.0
    expected, got = floor_texels(bake(scene, "out", 32, 1024, 0), "lamp", size, (0, 0, 0), light, UP)
    strong = max(expected) / 20
    kept = [k for k, e in enumerate(expected) if e > strong]
    compare("each texel", grey([expected[k] for k in kept]), [got[k] for k in kept], 0.02, 1024)
    compare_mean("mean of the floor", math.fsum(expected) / len(expected), [g[0] for g in got], 2e-3, 1024)


@both
def texels_of_mirrored_and_stretched_floors_lie_where_they_should():
    place, size = (0.3, 0.9, -0.7), (1.0, 1.0)

    def light(p, n):
        to = v_sub(place, p)
        return max(0.0, v_dot(to, n)) / v_len(to) ** 3
    for scale in ((3, 2, 1), (-3, 2, 1), (2, -3, 1), (-3, -2, 5)):
        scene = lamp("point", 20, place)
        floor_scene(scene, size, UP, scale)
        baked = bake(scene, "out %g %g" % scale[:2], 64, 64, 0)
        expected, got = floor_texels(baked, "lamp", size, (0, 0, 0), light, UP, scale)
        compare("scale %g %g %g" % scale, grey(expected), got, 0.015, 64)


@both
def texels_at_the_foot_of_a_wall_see_half_the_sky():
    scene, size = Gltf(), (4.0, 2.0)
    floor_scene(scene, size)
    dark = scene.add_material("dark", base_color=(0, 0, 0), double_sided=True, unlit=True)
    scene.add_node("wall", mesh=scene.add_mesh("wall", (quad(2000, 1000).translate(0, 500, 0), dark)), translation=(0, 0, -1.001))
    baked = bake(scene, "out", 32, 1024, 0, "--sky", "2,2,2")
    expected, got = floor_texels(baked, "sky", size, (0, 0, 0), lambda p, n: math.pi / 2, UP)
    compare("each texel", grey(expected), got, 0.06, 1024)
    compare_mean("mean of the floor", math.pi / 2, [g[0] for g in got], 3e-3, 1024)


@both
def texels_in_the_open_hold_all_the_sky():
    scene, size = Gltf(), (3.0, 2.0)
    floor_scene(scene, size)
    baked = bake(scene, "out", 32, 64, 0, "--sky", "2,2,2")
    expected, got = floor_texels(baked, "sky", size, (0, 0, 0), lambda p, n: math.pi, UP)
    compare("each texel", grey(expected), got, 1e-5, 64)


@both
def texels_below_a_ceiling_see_the_sky_through_its_hole():
    scene, size, height = Gltf(), (4.0, 2.0), 0.8
    floor_scene(scene, size)
    dark = scene.add_material("dark", base_color=(0, 0, 0), double_sided=True, unlit=True)
    far, x0, x1, z0, z1 = 1000.0, -1.3, -0.4, -0.5, 0.6
    for k, (a, b, c, d) in enumerate(((-far, x0, -far, far), (x1, far, -far, far), (x0, x1, -far, z0), (x0, x1, z1, far))):
        part = quad(b - a, d - c).rotate((1, 0, 0), -90).translate((a + b) / 2, height, (c + d) / 2)
        scene.add_node("ceiling %d" % k, mesh=scene.add_mesh("ceiling %d" % k, (part, dark)))
    hole = oracle.rectangle(((x0 + x1) / 2, height, (z0 + z1) / 2), ((x1 - x0) / 2, 0, 0), (0, 0, (z1 - z0) / 2))

    def light(p, n):
        return math.pi * oracle.polygon(hole, p, n)
    # All the way from a fifth of the sky below the hole to less than a hundredth of it at the other end.
    baked = bake(scene, "out", 48, 1024, 0, "--sky", "2,2,2")
    expected, got = floor_texels(baked, "sky", size, (0, 0, 0), light, UP)
    compare_mean("mean of the floor", math.fsum(expected) / len(expected), [g[0] for g in got], 3e-3, 1024)
    dim = [k for k, e in enumerate(expected) if e < 0.05 * max(expected)]
    compare_mean("mean of where it is dim", math.fsum(expected[k] for k in dim) / len(dim), [got[k][0] for k in dim], 0.02, 1024)
    expect(len(dim) > 100, "%d texels are dim" % len(dim))


@both
def texels_of_a_furnace_all_reach_its_geometric_sum():
    scene = Gltf()
    wall = scene.add_material("wall", base_color=(0.5, 0.5, 0.5), emissive=(1, 1, 1), strength=5)
    scene.add_node("room", mesh=scene.add_mesh("room", (box(2, 2, 2).flip(), wall)))
    baked = bake(scene, "out", 64, 256, "inf")
    name, = baked.layers
    values = [baked.factor(name)[0] * baked.layers[name][0][t] for t in baked.texels()]
    compare("each texel, seams and corners too", grey([10 * math.pi] * len(values)), [(v,) * 3 for v in values], 0.3, 256)
    compare_mean("mean of the room", 10 * math.pi, values, 3e-3, 256)


@both
def texels_of_a_closed_dark_box_stay_dark():
    scene = Gltf()
    white = scene.add_material("white", base_color=(0.8, 0.8, 0.8))
    turn = quat((1, 2, -1.5), 37)
    node(scene, "room", mesh=scene.add_mesh("room", (box(2, 2, 2).flip(), white)), translation=(1.3, -4.1, 2.7), rotation=turn)
    node(scene, "lamp", light=scene.add_light("point", 1000), translation=(4, -2, 3))
    sun = scene.add_light("directional", 100, name="sun")
    node(scene, "sun", light=sun, rotation=look((0, 0, 0), (0.3, -1, 0.2)))
    baked = bake(scene, "out", 64, 256, 3, "--sky", "10,10,10")
    total = baked.sum()
    values = [max(total[c][t] for c in range(3)) for t in baked.texels()]
    # A path may start or land where floats round it onto an edge; one such path of 256 may bring much to its texel.
    below("each texel, of 100 lux", 1e-2, [v / 100 for v in values], 256)
    below("mean, of 100 lux", 1e-5, [math.fsum(values) / len(values) / 100], 256)


@both
def texels_take_the_interpolated_vertex_normal_and_nothing_from_below_the_surface():
    slant = v_norm((0.5, 0, 0.8660254))  # of the quad, which faces +z before it is turned up
    for towards, name in (((0, 1, 0), "from above"), (v_norm((0.6, 0.8, 0)), "along the vertex normal"), (v_norm((1, -0.1, 0)), "from below")):
        scene = lamp("directional", 10, rotation=look((0, 0, 0), v_mul(towards, -1)), color=(1, 1, 1))
        mesh = mapped_quad(3, 2)
        mesh.normals = [slant] * 4
        node(scene, "floor", mesh=scene.add_mesh("floor", (mesh, scene.add_material("floor", base_color=(0.5, 0.5, 0.5)))), rotation=UP)
        normal = quat_rotate(UP, slant)
        baked = bake(scene, "out " + name, 32, 16, 0)
        expected, got = floor_texels(baked, "lamp", (3, 2), (0, 0, 0), lambda p, n: max(0, v_dot(normal, towards)) * (towards[1] > 0), UP)
        got = [tuple(10 * c for c in g) for g in got]
        compare_mean(name, 1 + 10 * expected[0], [1 + g[0] for g in got], 1e-5, 16)


def sides_of_a_house(solids):
    # A house of solid walls, 0.5 m thick, stands on a floor of texels of 0.25 m that do not line up with it; the sun is overhead.
    # Texels that reach indoors are dark, those that reach out of doors are lit; there are none that do both.
    size, scene = (8.0, 8.0), lamp("directional", 10, rotation=look((0, 0, 0), (0, -1, 0)), color=(1, 1, 1))
    floor_scene(scene, size)
    dark = scene.add_material("dark", base_color=(0, 0, 0), unlit=True)
    x0, x1, z0, z1, wall, high = -2.13, 1.77, -1.58, 2.21, 0.5, 2.0
    # Its walls go 0.2 m into the ground, as walls do.
    if solids == 1:  # with a hollow
        parts = [box_between((x0 - wall, -0.2, z0 - wall), (x1 + wall, high + wall, z1 + wall))]
        parts[0].append(box_between((x0, -0.2, z0), (x1, high, z1)).flip())
    else:  # west and east overlap north and south in the corners, the roof lies on all
        parts = [box_between((x0 - wall, -0.2, z0 - wall), (x0, high, z1 + wall)), box_between((x1, -0.2, z0 - wall), (x1 + wall, high, z1 + wall)),
                 box_between((x0 - wall, -0.2, z0 - wall), (x1 + wall, high, z0)), box_between((x0 - wall, -0.2, z1), (x1 + wall, high, z1 + wall)),
                 box_between((x0 - wall, high, z0 - wall), (x1 + wall, high + wall, z1 + wall))]
    for k, part in enumerate(parts):
        scene.add_node("part %d" % k, mesh=scene.add_mesh("part %d" % k, (part, dark)))
    baked = bake(scene, "out %d" % solids, 40, 64, 0)
    expected, got, names = [], [], []
    for j in range(40):
        for i in range(40):
            spots = texel_points(40, i, j, *size, 2)
            if spots is None:
                continue
            middle = quat_rotate(UP, v_mul(v_add(spots[0], spots[3]), 0.5))
            edge = 0.5 * size[0] / (HIGH - LOW) / 40
            inside = (x0 - edge < middle[0] < x1 + edge) and (z0 - edge < middle[2] < z1 + edge)
            under = (x0 - wall + edge < middle[0] < x1 + wall - edge) and (z0 - wall + edge < middle[2] < z1 + wall - edge)
            if under and not inside:
                continue  # all of it inside the wall
            expected.append(0.0 if inside else 10.0)
            got.append(tuple(10 * c[j * 40 + i] for c in baked.layers["lamp"]))
    compare("each texel, house of %d solids" % solids, grey(expected), got, 1e-4, 64)


@both
def texels_under_a_wall_belong_to_the_side_they_come_out_at():
    sides_of_a_house(1)
    sides_of_a_house(5)


# --- Layers -----------------------------------------------------------------------------------------------------------


def mixed_scene(extras=None):
    """Every kind of source in a small open room."""
    extras = extras or {}
    scene = Gltf()
    white = scene.add_material("white", base_color=(0.7, 0.6, 0.5))
    room = box(4, 3, 4, (0, 1.5, 0), skip="+y").flip()
    scene.add_node("room", mesh=scene.add_mesh("room", (room, white)))
    scene.add_node("block", mesh=scene.add_mesh("block", (box(1, 1, 1, (0.5, 0.5, 0.3)), white)))
    shine = scene.add_material("shine", base_color=(0.1, 0.1, 0.1), emissive=(0.3, 1, 0.2), strength=25)
    scene.add_node("panel", mesh=scene.add_mesh("panel", (quad(0.8, 0.4), shine)), translation=(0, 2, -1.99), extras=extras.get("panel"))
    node(scene, "bulb", light=scene.add_light("point", 20, color=(1, 0.8, 0.6)), translation=(-1, 2, 1), extras=extras.get("bulb"))
    node(scene, "ball", light=scene.add_light("point", 8, color=(0.2, 0.4, 1)), translation=(1, 1.6, -1),
         extras={"luxel_radius": 0.1, **(extras.get("ball") or {})})
    node(scene, "spot", light=scene.add_light("spot", 60, inner=10, outer=40), translation=(1.2, 2.8, 1), rotation=DOWN,
         extras=extras.get("spot"))
    node(scene, "sun", light=scene.add_light("directional", 12, color=(1, 0.9, 0.7)), rotation=look((0, 0, 0), (0.4, -1, 0.3)),
         extras={"luxel_radius": 0.5, **(extras.get("sun") or {})})
    node(scene, "tube", translation=(-1.2, 2.5, -1), rotation=DOWN,
         extras={"luxel_area": "rect 1.2 0.1", "luxel_color": [1, 0.2, 0.1], "luxel_intensity": 40, **(extras.get("tube") or {})})
    return scene


def sky_options():
    hdr("sky.hdr", [[2.0 + math.sin(x / 2) + (8 - y) / 8 for x in range(16)] for y in range(8)])
    return "--sky", "sky.hdr", "--sky-intensity", "0.5"


def close(what, baked, first, second, tolerance, samples=16):
    """Two sets of channels agree on every texel, relative to the texel or a hundredth of the mean, whatever is larger."""
    worst = (0.0, 0.0, 0.0)
    texels = baked.texels()
    for a, b in zip(first, second):
        mean = math.fsum(a[t] for t in texels) / len(texels)
        for t in texels:
            error = abs(a[t] - b[t]) / max(abs(a[t]), mean / 100, 1e-30)
            if error > worst[0]:
                worst = (error, a[t], b[t])
    below(what, tolerance, [worst[0]], samples)


@both
def layers_at_their_authored_colours_sum_to_the_combined_bake():
    options = sky_options()
    layers = bake(mixed_scene(), "layers", 64, 16, 3, *options)
    combined = bake(mixed_scene(), "combined", 64, 16, 3, *options, "--layers", "combined")
    expect(sorted(layers.layers) == ["ball", "bulb", "panel", "sky", "spot", "sun", "tube"], "layers %s" % sorted(layers.layers))
    expect(list(combined.layers) == ["combined"], "layers %s" % list(combined.layers))
    close("sum of 7 layers against combined, relative", combined, combined.layers["combined"], layers.sum(), limit(1e-5, HALF))


@both
def direct_and_indirect_bakes_add_up_to_the_whole():
    options = sky_options()
    whole = bake(mixed_scene(), "whole", 64, 16, 3, *options)
    direct = bake(mixed_scene(), "direct", 64, 16, 3, *options, "--direct-only")
    indirect = bake(mixed_scene(), "indirect", 64, 16, 3, *options, "--indirect-only")
    for name in whole.layers:
        both_parts = [[a + b for a, b in zip(d, i)] for d, i in zip(direct.layers[name], indirect.layers[name])]
        close("%s: direct + indirect" % name, whole, whole.layers[name], both_parts, 1e-5)


@both
def mixed_light_bakes_only_what_bounces():
    options = sky_options()
    mode = {"luxel_mode": "mixed"}
    plain = bake(mixed_scene(), "plain", 64, 16, 3, *options)
    mixed = bake(mixed_scene({"bulb": mode, "panel": mode, "sun": mode}), "mixed", 64, 16, 3, *options)
    indirect = bake(mixed_scene(), "indirect", 64, 16, 3, *options, "--indirect-only")
    for name in plain.layers:
        same_as = indirect if name in ("bulb", "panel", "sun") else plain
        close("%s: mixed" % name, plain, same_as.layers[name], mixed.layers[name], 1e-6)


@both
def realtime_light_is_left_out():
    options = sky_options()
    plain = bake(mixed_scene(), "plain", 64, 16, 3, *options)
    less = bake(mixed_scene({"bulb": {"luxel_mode": "realtime"}, "panel": {"luxel_mode": "realtime"}}), "less", 64, 16, 3, *options)
    expect(sorted(less.layers) == ["ball", "sky", "spot", "sun", "tube"], "layers %s" % sorted(less.layers))
    for name in less.layers:
        # The panel no longer shines, so gather rays that hit it are looked up at once: other random numbers, and 16 samples of noise.
        close("%s: others unchanged" % name, plain, plain.layers[name], less.layers[name], limit(1e-6, 0.05))


@both
def group_of_different_colours_keeps_their_proportions():
    options = sky_options()
    single = bake(mixed_scene(), "single", 64, 16, 3, *options)
    group = {"luxel_layer": "warm and cold"}
    grouped = bake(mixed_scene({"bulb": group, "ball": group, "spot": group}), "grouped", 64, 16, 3, *options)
    expect(sorted(grouped.layers) == ["panel", "sky", "sun", "tube", "warm and cold"], "layers %s" % sorted(grouped.layers))
    largest = max(20 * 1, 8 * 1, 60 * 1)
    expect(grouped.factor("warm and cold") == [largest] * 3, "factor %s" % grouped.factor("warm and cold"))
    expected = [[sum(single.factor(n)[c] / largest * single.layers[n][c][t] for n in ("bulb", "ball", "spot"))
                 for t in range(64 * 64)] for c in range(3)]
    close("T = sum of (colour × intensity / K) T_s", grouped, expected, grouped.layers["warm and cold"], limit(1e-5, HALF))
    close("all layers", single, single.sum(), grouped.sum(), limit(1e-5, HALF))


@both
def group_of_one_colour_keeps_it_free():
    def scene(extras):
        out = Gltf()
        floor_scene(out, (3, 2))
        for name, candela, place in (("a", 20, (0, 1, 0)), ("b", 5, (1, 0.5, 0.3))):
            node(out, name, light=out.add_light("point", candela, color=COLOR), translation=place, extras=extras)
        return out
    single = bake(scene(None), "single", 32, 16, 0)
    grouped = bake(scene({"luxel_layer": "both"}), "grouped", 32, 16, 0)
    expect([round(f, 5) for f in grouped.factor("both")] == [20 * c for c in COLOR], "factor %s" % grouped.factor("both"))
    expected = [[a + 5 / 20 * b for a, b in zip(single.layers["a"][c], single.layers["b"][c])] for c in range(3)]
    close("T = sum of (intensity / strongest) T_s", grouped, expected, grouped.layers["both"], 1e-5)


@both
def one_thread_and_two_threads_write_the_same_bytes():
    options = sky_options()
    first = bake(mixed_scene(), "one", 64, 16, 3, *options, "--threads", "1")
    bake(mixed_scene(), "two", 64, 16, 3, *options, "--threads", "2")
    names = [entry["file"] for entry in first.manifest["files"]] + ["luxel.pack", "scene.glb"]
    different = [name for name in names if read("one/" + name) != read("two/" + name)]
    expect(not different, "files differ: %s" % " ".join(different))
    below("files that differ", 0.5, [len(different)], 16)


@both
def layer_does_not_change_when_other_lights_come_and_go():
    options = sky_options()
    plain = bake(mixed_scene(), "plain", 64, 16, 3, *options)
    alone = bake(mixed_scene(), "alone", 64, 16, 3)  # no sky
    for name in alone.layers:
        close("%s: without the sky" % name, plain, plain.layers[name], alone.layers[name], 1e-6)


def lantern_scene(names):
    """Lamps a few centimetres from the inner sides of a small open box, which hangs over a floor."""
    scene = Gltf()
    brass = scene.add_material("brass", base_color=(0.8, 0.7, 0.5))
    node(scene, "floor", mesh=scene.add_mesh("floor", (box(2, 0.1, 2), brass)))
    node(scene, "lantern", mesh=scene.add_mesh("lantern", (box(0.16, 0.2, 0.16, skip="-y").flip(), brass)), translation=(0, 1, 0))
    for name, x in (("a", -0.05), ("b", 0.05)):
        if name in names:
            node(scene, name, light=scene.add_light("point", 20), translation=(x, 1.0, 0.02))
    return scene


@both
def lamp_in_a_lantern_keeps_its_layer_whatever_shines_beside_it():
    together = bake(lantern_scene("ab"), "together", 64, 64, 3)
    alone = bake(lantern_scene("a"), "alone", 64, 64, 3)
    close("a: without b", together, together.layers["a"], alone.layers["a"], 1e-6)
