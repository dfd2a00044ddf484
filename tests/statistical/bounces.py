"""Light that bounces: furnaces, the integrating sphere, a cube against radiosity; what must not leak; other scales."""

import math
import random

import oracle
from gltf import Gltf, Mesh, box, grid, quad, quat, quat_mul, quat_rotate, sphere, v_add, v_cross, v_dot, v_len, v_mul, v_norm, v_sub
from lamps import COLOR, DOWN, lamp, node
from measure import EXACT, below, case, compare, compare_mean, grey, irradiance, times


def inward_box(material_of, scene, size=2.0):
    """A box seen from inside, each wall a mesh of its own; material_of(axis name) gives the wall's material."""
    for name in ("+x", "-x", "+y", "-y", "+z", "-z"):
        others = " ".join(n for n in ("+x", "-x", "+y", "-y", "+z", "-z") if n != name)
        wall = box(size, size, size, skip=others).flip()
        scene.add_node(name, mesh=scene.add_mesh(name, (wall, material_of(name))))


def points_on_walls(size=2.0):
    h = size / 2
    return [((0, -h, 0), (0, 1, 0)), ((0.3 * h, -h, 0.9 * h), (0, 1, 0)), ((-h, 0.5 * h, 0.2 * h), (1, 0, 0)),
            ((0.99 * h, h, -0.99 * h), (0, -1, 0)), ((0.1 * h, -0.4 * h, h), (0, 0, -1))]


def furnace(albedo, nit=5.0, **material):
    scene = Gltf()
    wall = scene.add_material("wall", base_color=albedo, emissive=(1, 1, 1), strength=nit, **material)
    inward_box(lambda _: wall, scene)
    return scene


@case
def white_furnace_reaches_its_geometric_sum():
    for albedo in (0.2, 0.5, 0.8):
        expected = 5 * math.pi / (1 - albedo)
        got = irradiance(furnace((albedo,) * 3), points_on_walls(), 16384, "inf")
        # Paths of random length spread by up to 0.8 of their mean: 0.6 % after 16384 of them; and three times that.
        compare("pi L / (1 - %g), each point" % albedo, grey([expected] * 5), got, 0.02, 16384)
        compare_mean("pi L / (1 - %g), mean" % albedo, expected, [g[0] for g in got], 0.01, 16384)


@case
def coloured_furnace_keeps_its_channels_apart():
    albedo = (0.7, 0.4, 0.1)
    expected = tuple(5 * math.pi / (1 - a) for a in albedo)
    compare("pi L / (1 - albedo)", [expected] * 5, irradiance(furnace(albedo), points_on_walls(), 16384, "inf"), 0.01, 16384)


@case
def furnace_with_n_bounces_is_the_series_cut_after_n():
    for bounces in (0, 1, 2, 3, 5, 8):
        expected = 5 * math.pi * sum(0.8 ** k for k in range(bounces + 1))
        got = irradiance(furnace((0.8,) * 3), points_on_walls(), 8192, bounces)
        compare("%d bounces" % bounces, grey([expected] * 5), got, 0.01, 8192)


@case
def furnace_of_rough_metal_has_the_albedo_we_say_it_has():
    # baseColor × metallic × roughness² × 0.5 + baseColor × (1 - metallic)
    for metallic, roughness in ((1.0, 0.8), (0.5, 0.3)):
        albedo = 0.9 * ((1 - metallic) + metallic * roughness ** 2 * 0.5)
        got = irradiance(furnace((0.9,) * 3, metallic=metallic, roughness=roughness), points_on_walls(), 8192, "inf")
        compare("metallic %g, roughness %g" % (metallic, roughness), grey([5 * math.pi / (1 - albedo)] * 5), got, 0.01, 8192)


@case
def furnace_of_pure_white_stops_at_albedo_0_99():
    # A path has 100 vertices on average, and as many more or less: one part in 90 is the error of the mean of 8192 lengths.
    got = irradiance(furnace((1, 1, 1)), points_on_walls()[:1], 8192, "inf")
    compare("100 pi L", grey([5 * math.pi / 0.01]), got, 0.03, 8192)


@case
def furnace_seen_from_free_points_inside_is_the_same():
    rng = random.Random(2)
    points = []
    for _ in range(20):
        d = v_norm(tuple(rng.gauss(0, 1) for _ in range(3)))
        points.append((tuple(rng.uniform(-0.9, 0.9) for _ in range(3)), d))
    got = irradiance(furnace((0.5,) * 3), points, 16384, "inf")
    compare("anywhere inside", grey([10 * math.pi] * 20), got, 0.01, 16384)


@case
def furnace_of_panes_scatters_and_passes_without_loss():
    # Double-sided blended panes of the walls' radiosity hang in the furnace: they pass 1 - a, and what they scatter was radiance
    # of the furnace too. With emission a (1 - albedo) L' per pane nothing changes: radiance is the same everywhere.
    albedo, alpha, nit = 0.6, 0.4, 5.0
    scene = furnace((albedo,) * 3, nit)
    pane = scene.add_material("pane", base_color=(albedo,) * 3 + (alpha,), alpha="BLEND", double_sided=True, emissive=(1, 1, 1),
                              strength=nit)
    for k in range(3):
        scene.add_node("pane %d" % k, mesh=scene.add_mesh("pane %d" % k, (quad(1.2, 1.0), pane)), translation=(0, 0.4 * k - 0.4, 0.1),
                       rotation=quat((1, 0.2, 0.1), 60 * k))
    got = irradiance(scene, points_on_walls(), 16384, "inf")
    compare("pi L / (1 - albedo)", grey([math.pi * nit / (1 - albedo)] * 5), got, 0.01, 16384)


def flat(mesh):
    """Each triangle with its own corners and normal."""
    out = Mesh()
    for k in range(0, len(mesh.indices), 3):
        a, b, c = (mesh.positions[i] for i in mesh.indices[k:k + 3])
        n = v_cross(v_sub(b, a), v_sub(c, a))
        if v_len(n) == 0:
            continue
        out.indices += range(len(out.positions), len(out.positions) + 3)
        out.positions += [a, b, c]
        out.normals += [v_norm(n)] * 3
        out.uvs += [(0, 0)] * 3
    return out


def points_over(mesh, count, seed):
    """Evenly over the mesh's area: (area, [(point, normal)])."""
    triangles, running, area = [], [], 0.0
    for k in range(0, len(mesh.indices), 3):
        corners = [mesh.positions[i] for i in mesh.indices[k:k + 3]]
        area += v_len(v_cross(v_sub(corners[1], corners[0]), v_sub(corners[2], corners[0]))) / 2
        triangles.append((corners, mesh.normals[mesh.indices[k]]))
        running.append(area)
    rng, out, at = random.Random(seed), [], 0
    for k in range(count):
        wanted = (k + rng.random()) / count * area
        while running[at] < wanted:
            at += 1
        (a, b, c), n = triangles[at]
        r, s = math.sqrt(rng.random()), rng.random()
        out.append((v_add(v_mul(a, 1 - r), v_add(v_mul(b, r * (1 - s)), v_mul(c, r * s))), n))
    return area, out


@case
def integrating_sphere_spreads_a_lamps_flux_evenly():
    albedo, candela = 0.7, 20.0
    shape = flat(sphere(1, 96, 64).flip())
    area, points = points_over(shape, 400, 1)
    scene = lamp("point", candela, (0, 0, 0), color=(1, 1, 1))
    scene.add_node("shell", mesh=scene.add_mesh("shell", (shape, scene.add_material("wall", base_color=(albedo,) * 3))))
    got = irradiance(scene, points, 1024, "inf")
    direct = irradiance(scene, points, 1, 0)
    flux = 4 * math.pi * candela
    indirect = [g[0] - d[0] for g, d in zip(got, direct)]
    expected = flux * albedo / (area * (1 - albedo))
    compare_mean("mean of what bounced: flux × albedo / (area (1 - albedo))", expected, indirect, 0.005, 1024)
    compare("each point", grey([expected] * 400), [(v,) * 3 for v in indirect], 0.12, 1024)


@case
def integrating_sphere_is_even_wherever_the_lamp_is():
    # In a sphere the bounced light is the same everywhere for any lamp inside: form factors between its points are all equal.
    albedo, candela, place = 0.7, 20.0, (0.5, 0.2, -0.3)
    shape = flat(sphere(1, 96, 64).flip())
    area, points = points_over(shape, 40, 2)
    scene = lamp("point", candela, place, color=(1, 1, 1))
    scene.add_node("shell", mesh=scene.add_mesh("shell", (shape, scene.add_material("wall", base_color=(albedo,) * 3))))
    got = irradiance(scene, points, 16384, "inf")
    direct = irradiance(scene, points, 1, 0)
    expected = 4 * math.pi * candela * albedo / (area * (1 - albedo))
    compare("each point", grey([expected] * 40), [(g[0] - d[0],) * 3 for g, d in zip(got, direct)], 0.03, 16384)


@case
def cube_with_one_shining_wall_meets_radiosity():
    albedo = [0.5, 0.5, 0.7, 0.0, 0.3, 0.8]  # -x +x -y +y -z +z
    scene = Gltf()
    material = {}
    for k, name in enumerate(("-x", "+x", "-y", "+y", "-z", "+z")):
        shine = {"emissive": (1, 1, 1), "strength": 10} if name == "+y" else {}
        material[name] = scene.add_material(name, base_color=(albedo[k],) * 3, **shine)
    inward_box(material.get, scene, 1.0)
    truth = oracle.CubeRadiosity(10, albedo, [0, 0, 0, 10, 0, 0])
    points = [((0.5, 0, 0.5), (0, 1, 0)), ((0.1, 0, 0.2), (0, 1, 0)), ((0, 0.5, 0.5), (1, 0, 0)), ((1, 0.85, 0.3), (-1, 0, 0)),
              ((0.5, 1, 0.5), (0, -1, 0)), ((0.7, 0.3, 0), (0, 0, 1)), ((0.4, 0.6, 1), (0, 0, -1))]
    expected = [truth.irradiance(p, n) for p, n in points]
    moved = [(v_sub(p, (0.5, 0.5, 0.5)), n) for p, n in points]
    compare("six grey walls, one shining", grey(expected), irradiance(scene, moved, 65536, "inf"), 0.01, 65536)


@case
def two_plates_exchange_light_by_their_form_factor():
    # A small bright panel lights a floor, the floor lights a small receiver facing down: one bounce, by double quadrature.
    scene = Gltf()
    floor = scene.add_material("floor", base_color=(0.5, 0.5, 0.5))
    scene.add_node("floor", mesh=scene.add_mesh("floor", (quad(2, 2), floor)), rotation=DOWN)
    light = scene.add_light("point", 30, color=(1, 1, 1))
    node(scene, "lamp", light=light, translation=(0.3, 1.0, 0.2))
    point, normal, steps, expected = (-0.4, 0.8, 0.1), (0, -1, 0), 200, 0.0
    for i in range(steps):
        for j in range(steps):
            q = ((i + 0.5) / steps * 2 - 1, 0.0, (j + 0.5) / steps * 2 - 1)
            a, b = v_sub((0.3, 1.0, 0.2), q), v_sub(point, q)
            direct = 30 * a[1] / v_len(a) ** 3
            form = b[1] * b[1] / v_len(b) ** 4 / math.pi * (2 / steps) ** 2
            expected += 0.5 * direct * form
    got = irradiance(scene, [(point, normal)], 2 ** 16, 1)
    compare("albedo ∫ E dF", grey([expected]), got, 0.01, 2 ** 16)


@case
def floor_with_a_picture_reflects_by_its_srgb_values_and_vertex_colours():
    # The floor of two_plates, in stripes of unequal grey along x and with a vertex colour.
    columns, tint = [255, 128, 0, 60, 200], (0.5, 0.8, 1.0)
    scene = Gltf()
    pixels = bytes(b for c in columns for b in (c, c, c))
    picture = scene.add_image("stripes", len(columns), 1, pixels, wrap=False, nearest=True)
    floor = scene.add_material("floor", base_color=(0.9, 0.9, 0.9), texture=picture)
    mesh = quad(2, 2, fit=True).paint(tint)
    scene.add_node("floor", mesh=scene.add_mesh("floor", (mesh, floor)), rotation=DOWN)
    place, point, normal, steps, expected = (0.3, 1.0, 0.2), (-0.4, 0.8, 0.1), (0, -1, 0), 200, 0.0
    node(scene, "lamp", light=scene.add_light("point", 30, color=(1, 1, 1)), translation=place)
    for i in range(steps):
        albedo = 0.9 * oracle.srgb(columns[i * len(columns) // steps])
        for j in range(steps):
            q = ((i + 0.5) / steps * 2 - 1, 0.0, (j + 0.5) / steps * 2 - 1)
            a, b = v_sub(place, q), v_sub(point, q)
            expected += albedo * 30 * a[1] / v_len(a) ** 3 * b[1] * b[1] / v_len(b) ** 4 / math.pi * (2 / steps) ** 2
    got = irradiance(scene, [(point, normal)], 2 ** 16, 1)
    compare("∫ albedo E dF", [tuple(expected * c for c in tint)], got, 0.01, 2 ** 16)


# --- Robustness -------------------------------------------------------------------------------------------------------


def room_at(scale, place):
    """A furnace-like room with a lamp and a shining ceiling panel; lengths × scale, intensities × scale²."""
    scene = Gltf()
    s = scale
    white = scene.add_material("white", base_color=(0.6, 0.6, 0.6))
    shine = scene.add_material("shine", base_color=(0, 0, 0), emissive=(1, 1, 1), strength=50)
    node(scene, "room", mesh=scene.add_mesh("room", (box(4 * s, 3 * s, 4 * s).flip(), white)), translation=place)
    node(scene, "table", mesh=scene.add_mesh("table", (box(s, 0.1 * s, s, (0, -0.7 * s, 0)), white)), translation=place)
    panel = quad(s, s).rotate((1, 0, 0), 90).translate(0.5 * s, 1.499 * s, 0)
    node(scene, "panel", mesh=scene.add_mesh("panel", (panel, shine)), translation=place)
    light = scene.add_light("point", 10 * s * s, color=(1, 1, 1))
    node(scene, "lamp", light=light, translation=v_add(place, (-s, 0.5 * s, 0.3 * s)))
    spots = [((-1.5, -1.5, 1.2), (0, 1, 0)), ((0.1, -1.5, 0.1), (0, 1, 0)), ((0.1, -0.65, 0.1), (0, 1, 0)), ((-2, 0.3, 0.4), (1, 0, 0)),
             ((-1, 1.5, 1), (0, -1, 0)), ((0.2, -0.75, -0.2), (0, -1, 0))]
    return scene, [(v_add(place, v_mul(p, s)), n) for p, n in spots]


@case
def rooms_of_a_millimetre_and_of_100_km_are_lit_alike():
    base = irradiance(*room_at(1.0, (0, 0, 0)), 4096, 4)
    for scale in (1e-3, 1e5, 3e-3):
        got = irradiance(*room_at(scale, (0, 0, 0)), 4096, 4)
        # The same random numbers and nearly the same paths: where rounding tips a path past an edge they part.
        compare("scale %g against scale 1" % scale, base, got, 0.01, 4096)


@case
def room_far_from_the_origin_is_lit_alike():
    base = irradiance(*room_at(1.0, (0, 0, 0)), 4096, 4)
    # At 1 km floats are 0.06 mm apart.
    got = irradiance(*room_at(1.0, (1000, -500, 2000)), 4096, 4)
    compare("2 km away", base, got, 0.01, 4096)


def lamps_around(scene, centre):
    """Some 100 to 250 lux on the walls from outside."""
    for k, place in enumerate(((3, 2.5, 1), (-2, 0.3, 4), (0, -5, 0))):
        node(scene, "lamp %d" % k, light=scene.add_light("point", 1000), translation=v_add(centre, place))


def points_near_edges(near):
    points = []
    for e in near:
        for x in (-1, 1):
            for z in (-1, 1):
                points += [((x * (1 - e), -1, z * (1 - e)), (0, 1, 0)), ((x, z * (1 - e), x * (1 - e)), (-x, 0, 0)),
                           ((x * (1 - e), z * (1 - e), -1), (0, 0, 1))]
    return points


def stays_dark(scene, points, what):
    got = [max(g) for g in irradiance(scene, points, 4096, 4, "--sky", "10,10,10")]
    # Floats round some vertices of paths onto an edge itself, or past it: of a million, one or two.
    below(what + ", any point, of 100 lux", 1e-3, [g / 100 for g in got], 4096)
    below(what + ", mean, of 100 lux", 1e-5, [math.fsum(got) / len(got) / 100], 4096)


@case
def closed_dark_box_lets_no_light_in():
    scene = Gltf()
    white = scene.add_material("white", base_color=(0.8, 0.8, 0.8))
    inward_box(lambda _: white, scene)
    lamps_around(scene, (0, 0, 0))
    stays_dark(scene, points_near_edges((1e-4, 1e-3, 0.01, 0.5, 1.0)), "walls without thickness")


@case
def closed_box_turned_askew_lets_no_light_in():
    scene, place, turn = Gltf(), (10.3, -4.1, 7.7), quat((1, 2, -1.5), 37)
    white = scene.add_material("white", base_color=(0.8, 0.8, 0.8))
    shape = box(2, 2, 2).flip().rotate_quat(turn).translate(*place)
    scene.add_node("box", mesh=scene.add_mesh("box", (shape, white)))
    lamps_around(scene, place)
    points = [(v_add(place, quat_rotate(turn, p)), quat_rotate(turn, n)) for p, n in points_near_edges((1e-3, 0.01, 0.5))]
    stays_dark(scene, points, "slanted walls")


@case
def receiver_mirrored_and_stretched_reflects_like_the_plain_mesh():
    # The floor is one instance of a unit square with a strange transform; what bounces off it onto a point above is the same.
    results = []
    for rotation, scale in ((quat((1, 0, 0), -90), (3, 2, 1)), (quat((1, 0, 0), -90), (-3, 2, 1)), (quat((1, 0, 0), -90), (-3, -2, 7)),
                            (quat((1, 0, 0), 90), (3, 2, -1)), (quat_mul(quat((1, 0, 0), -90), quat((0, 0, 1), 90)), (2, 3, 1))):
        scene = Gltf()
        grey_ = scene.add_material("floor", base_color=(0.5, 0.6, 0.7))
        node(scene, "floor", mesh=scene.add_mesh("floor", (grid(1, 1, 4, 4), grey_)), rotation=rotation, scale=scale)
        node(scene, "lamp", light=scene.add_light("point", 30), translation=(0.3, 1, 0.2))
        results.append(irradiance(scene, [((-0.4, 0.8, 0.1), (0, -1, 0))], 16384, 2)[0])
    compare("five ways to make the same floor", [results[0]] * 4, results[1:], 1e-3, 16384)
