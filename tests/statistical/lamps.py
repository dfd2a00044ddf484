"""Lights of the file: point, spot, directional, with and without size; rectangles and disks by luxel_area."""

import math
import random

import oracle
from gltf import Gltf, box, grid, look, quad, quat, quat_rotate, v_add, v_dot, v_len, v_mul, v_norm, v_sub
from measure import EXACT, case, compare, compare_mean, grey, irradiance, times

COLOR = (1.0, 0.5, 0.25)


def node(scene, name, **keywords):
    """As add_node, but the place keeps all its digits."""
    place = keywords.pop("translation", None)
    index = scene.add_node(name, **keywords)
    if place:
        scene.json["nodes"][index]["translation"] = list(place)
    return index


def lamp(kind, intensity, place=(0, 0, 0), rotation=None, color=COLOR, extras=None, **keywords):
    scene = Gltf()
    light = scene.add_light(kind, intensity, color=color, **keywords)
    node(scene, "lamp", light=light, translation=place, rotation=rotation, extras=extras)
    return scene


def direction(rng):
    while True:
        d = tuple(rng.uniform(-1, 1) for _ in range(3))
        if 0.01 < v_len(d) < 1:
            return v_norm(d)


def receivers(count, near, far, centre, seed=7):
    """Points in a shell around the centre with normals all over; not edge on, where rounding is all there is."""
    rng = random.Random(seed)
    out = []
    while len(out) < count:
        point, normal = v_add(centre, v_mul(direction(rng), rng.uniform(near, far))), direction(rng)
        if abs(v_dot(normal, v_norm(v_sub(centre, point)))) > 0.05:
            out.append((point, normal))
    return out


def cosine_law(points, place):
    """cos / d² towards a place, 0 from below."""
    out = []
    for point, normal in points:
        to = v_sub(place, point)
        out.append(max(0.0, v_dot(to, normal)) / v_len(to) ** 3)
    return out


# --- Points -----------------------------------------------------------------------------------------------------------


@case
def point_light_follows_cosine_and_square_of_distance():
    place = (0.3, 2.0, -0.4)
    points = receivers(300, 0.1, 30, place)
    got = irradiance(lamp("point", 40, place), points, 1, 0)
    compare("I cos / d²", times(cosine_law(points, place), [40 * c for c in COLOR]), got, EXACT, 1)


@case
def point_light_below_turned_and_scaled_nodes_keeps_its_intensity():
    scene, place, turn = Gltf(), (1.0, -2.0, 0.5), quat((1, 2, 3), 77)
    outer = node(scene, "outer", translation=place, rotation=turn, scale=(2, 3, -0.5))
    light = scene.add_light("point", 40, color=COLOR)
    node(scene, "inner", light=light, translation=(1, 1, 1), parent=outer)
    place = v_add(place, quat_rotate(turn, (2, 3, -0.5)))
    points = receivers(50, 0.5, 5, place)
    got = irradiance(scene, points, 1, 0)
    compare("I cos / d²", times(cosine_law(points, place), [40 * c for c in COLOR]), got, EXACT, 1)


@case
def range_dims_a_point_light_and_ends_it():
    reach = 4.0
    points = [((0, -reach * k / 20, 0), (0.6, 0.8, 0)) for k in range(1, 30)]
    expected = [e * oracle.window(v_len(p), reach) for e, (p, _) in zip(cosine_law(points, (0, 0, 0)), points)]
    # Close to the end 1 - (d / range)⁴ is a small difference, with an error of float rounding times 20 / 4.
    got = irradiance(lamp("point", 10, color=(1, 1, 1), range=reach), points, 1, 0)
    compare("I cos / d² (1 - (d / range)⁴)", grey([10 * e for e in expected]), got, EXACT, 1)


@case
def spot_light_falls_off_between_its_cones_as_khr_says():
    inner, outer = math.radians(20), math.radians(35)
    turn = look((0, 0, 0), (1, -2, 0.5))
    axis = quat_rotate(turn, (0, 0, -1))
    aside, _ = oracle.tangents(axis)
    points, expected = [], []
    for degrees in (0, 5, 15, 19.9, 20.5, 22, 25, 27.5, 30, 32, 34, 36, 50, 90, 120, 180):
        a = math.radians(degrees)
        d = v_add(v_mul(axis, math.cos(a)), v_mul(aside, math.sin(a)))
        points.append((v_mul(d, 3), v_mul(d, -1)))
        expected.append(40 / 9 * oracle.spot(math.cos(a), inner, outer))
    got = irradiance(lamp("spot", 40, rotation=turn, inner=20, outer=35), points, 1, 0)
    # Towards the outer cone the squared difference of two cosines leaves fewer digits.
    compare("I / d² × KHR attenuation²", times(expected, COLOR), got, 2e-4, 1)


@case
def spot_light_with_almost_equal_cones_is_as_soft_as_khr_says():
    inner, outer = math.radians(60), math.radians(60.02)
    points = [((2 * math.tan(math.radians(59.905 + 0.01 * k)), -2, 0), (0, 1, 0)) for k in range(14)]
    expected = [40 * e * oracle.spot(2 / v_len(p), inner, outer) for e, (p, _) in zip(cosine_law(points, (0, 0, 0)), points)]
    scene = lamp("spot", 40, rotation=quat((1, 0, 0), -90), inner=60, outer=60.02, color=(1, 1, 1))
    # A difference of cosines of 1e-3 has four digits left in floats.
    compare("KHR attenuation with its least width", grey(expected), irradiance(scene, points, 1, 0), 5e-3, 1, dark=1e-3)


@case
def spot_light_with_range_takes_both_factors():
    points = [((x, -2, 0.1), (0, 1, 0)) for x in (0, 0.2, 0.5, 0.8, 1.1)]
    expected = []
    for e, (p, _) in zip(cosine_law(points, (0, 0, 0)), points):
        cosine = 2 / v_len(p)
        expected.append(10 * e * oracle.window(v_len(p), 2.6) * oracle.spot(cosine, 0.0, math.radians(40)))
    scene = lamp("spot", 10, rotation=quat((1, 0, 0), -90), inner=0, outer=40, range=2.6, color=(1, 1, 1))
    compare("both factors", grey(expected), irradiance(scene, points, 1, 0), 1e-4, 1)


@case
def directional_light_gives_lux_times_cosine_from_every_side():
    for axis, degrees in (((1, 0, 0), 0), ((1, 0, 0), -90), ((1, 2, 3), 130), ((0, 1, 0), 45), ((-2, 0.3, 1), 250)):
        turn = quat(axis, degrees)
        towards = v_mul(quat_rotate(turn, (0, 0, -1)), -1)
        rng = random.Random(3)
        points = [p for p in (((rng.uniform(-9, 9), 0, rng.uniform(-9, 9)), direction(rng)) for _ in range(60))
                  if abs(v_dot(p[1], towards)) > 0.05]
        expected = [7 * max(0.0, v_dot(n, towards)) for _, n in points]
        got = irradiance(lamp("directional", 7, (5, 5, 5), turn), points, 1, 0)
        compare("lux × cos", times(expected, COLOR), got, EXACT, 1)


# --- Spheres and suns -------------------------------------------------------------------------------------------------


@case
def sphere_light_facing_equals_a_point_light():
    points = [((0, -d, 0), (0, 1, 0)) for d in (0.51, 0.6, 1, 2, 5, 50)]
    got = irradiance(lamp("point", 40, extras={"luxel_radius": 0.5}), points, 4096, 0)
    compare("I / d² of a sphere of radius 0.5", times([40 / p[1] ** 2 for p, _ in points], COLOR), got, 2e-3, 4096)


@case
def sphere_light_cut_by_the_horizon_meets_snyders_formula():
    radius, points, expected = 0.5, [], []
    for d in (0.55, 0.8, 1.5, 4):
        half = math.asin(radius / d)
        for k in range(1, 12):
            angle = (math.pi / 2 + half) * k / 12
            points.append(((0, 0, -d), (math.sin(angle), 0, math.cos(angle))))
            expected.append(40 / radius ** 2 * oracle.sphere(angle, half))
    got = irradiance(lamp("point", 40, extras={"luxel_radius": radius}), points, 65536, 0)
    compare("sphere of radius 0.5 over and below the horizon", times(expected, COLOR), got, 0.01, 65536)


@case
def sphere_light_on_edge_meets_snyders_formula():
    radius, points, expected = 0.25, [], []
    for d in (0.3, 0.5, 1, 3):
        points.append(((d, 0, 0), (0, 1, 0)))
        expected.append(40 / radius ** 2 * oracle.sphere(math.pi / 2, math.asin(radius / d)))
    got = irradiance(lamp("point", 40, extras={"luxel_radius": radius}), points, 16384, 0)
    compare("centre of the sphere on the horizon", times(expected, COLOR), got, 0.01, 16384)


@case
def sphere_light_gives_nothing_inside_itself():
    points = [((0, -d, 0), (0, 1, 0)) for d in (0.0, 0.3, 0.49, 1.0)]
    got = irradiance(lamp("point", 40, color=(1, 1, 1), extras={"luxel_radius": 0.5}), points, 1024, 0)
    compare("inside 0, outside I / d²", grey([0, 0, 0, 40]), got, 2e-3, 1024)


@case
def sphere_light_halved_by_a_wall_gives_half():
    scene = lamp("point", 40, (0, 2, 0), extras={"luxel_radius": 0.4})
    black = scene.add_material("black", base_color=(0, 0, 0), double_sided=True)
    scene.add_node("half", mesh=scene.add_mesh("half", (quad(10, 10).translate(5, 0, 0), black)), translation=(0, 1, 0),
                   rotation=quat((1, 0, 0), -90))
    got = irradiance(scene, [((0, 0, 0), (0, 1, 0))], 65536, 0)
    compare("half of I / d²", times([5], COLOR), got, 2e-3, 65536)


@case
def soft_spot_takes_its_cone_from_its_centre():
    points = [((x, -3, 0), (0, 1, 0)) for x in (0, 0.5, 1, 1.3, 1.6, 2.2)]
    expected = []
    for p, n in points:
        angle = math.acos(3 / v_len(p))
        form = oracle.sphere(angle, math.asin(0.2 / v_len(p)))
        expected.append(40 / 0.2 ** 2 * form * oracle.spot(3 / v_len(p), math.radians(15), math.radians(30)))
    scene = lamp("spot", 40, rotation=quat((1, 0, 0), -90), inner=15, outer=30, color=(1, 1, 1), extras={"luxel_radius": 0.2})
    compare("sphere × KHR attenuation² at the centre", grey(expected), irradiance(scene, points, 4096, 0), 2e-3, 4096)


@case
def sun_with_a_disc_meets_quadrature_up_to_its_set():
    lux, width = 1000.0, 12.0
    half = math.radians(width / 2)
    points, expected = [], []
    for degrees in (0, 30, 60, 80, 84, 86, 88, 90, 92, 94):
        angle = math.radians(degrees)
        points.append(((0, 0, 0), (math.sin(angle), math.cos(angle), 0)))
        expected.append(lux / math.sin(half) ** 2 * oracle.cap_by_quadrature(angle, half))
    points.append(((0, 0, 0), (0, -1, 0)))
    expected.append(0.0)
    scene = lamp("directional", lux, rotation=quat((1, 0, 0), -90), color=(1, 1, 1), extras={"luxel_radius": width})
    compare("disc of 12 degrees, down to the last sliver", grey(expected), irradiance(scene, points, 65536, 0), 0.01, 65536)


@case
def half_a_degree_of_sun_keeps_its_lux():
    points = [((0, 0, 0), (math.sin(a), math.cos(a), 0)) for a in (0, 0.5, 1.2, 1.5)]
    scene = lamp("directional", 1000, rotation=quat((1, 0, 0), -90), color=(1, 1, 1), extras={"luxel_radius": 0.53})
    got = irradiance(scene, points, 1024, 0)
    # What is lost against a mathematical point is sin² / (2 - 2 cos) of the disc: nothing. So: lux × cos.
    compare("lux × cos", grey([1000 * n[1] for _, n in points]), got, 1e-3, 1024)


# --- Rectangles and disks ---------------------------------------------------------------------------------------------


def area_lamp(shape, nit, place=(0, 0, 0), rotation=None, scale=None):
    scene = Gltf()
    node(scene, "lamp", translation=place, rotation=rotation, scale=scale,
         extras={"luxel_area": shape, "luxel_intensity": nit, "luxel_color": list(COLOR)})
    return scene


DOWN = quat((1, 0, 0), -90)  # -Z of the lamp becomes -Y; its x stays, its y becomes -Z


@case
def rectangle_light_parallel_meets_the_closed_form():
    a, b, points, expected = 1.2, 0.5, [], []
    for h in (0.02, 0.1, 0.4, 1, 3, 40):
        points.append(((0, -h, 0), (0, 1, 0)))
        expected.append(4 * oracle.parallel_rectangle(a / 2, b / 2, h))
        points.append(((a / 2, -h, b / 2), (0, 1, 0)))
        expected.append(oracle.parallel_rectangle(a, b, h))
    got = irradiance(area_lamp("rect 1.2 0.5", 100, rotation=DOWN), points, 4096, 0)
    compare("centre and corner, near and far", times(expected, [100 * math.pi * c for c in COLOR]), got, 2e-3, 4096)


@case
def rectangle_light_at_right_angles_meets_the_closed_form():
    points, expected = [], []
    for d in (0.05, 0.3, 1, 4):
        points.append(((0, 0, d), (0, 1, 0)))
        expected.append(2 * oracle.perpendicular_rectangle(0.6, 0.5, d))
    scene = area_lamp("rect 1.2 0.5", 100, (0, 0.25, 0), rotation=quat((0, 1, 0), 180))
    compare("edge of the lamp on the receiver's plane", times(expected, [100 * math.pi * c for c in COLOR]),
            irradiance(scene, points, 16384, 0), 0.01, 16384)


@case
def rectangle_light_turned_and_cut_by_the_horizon_meets_lamberts_formula():
    place, turn = (0.4, 0.3, -0.2), quat((3, 1, 2), 50)
    corners = oracle.rectangle(place, quat_rotate(turn, (1, 0, 0)), quat_rotate(turn, (0, 0.5, 0)))
    front = quat_rotate(turn, (0, 0, -1))
    points, expected = [], []
    for p, n in receivers(400, 0.3, 3, place):
        seen = v_dot(v_sub(p, place), front) > 0
        e = oracle.polygon(corners, p, n) if seen else 0.0
        if not seen or e == 0 or e > 0.002:  # of the rest hardly a corner looks over the horizon
            points.append((p, n))
            expected.append(e)
    got = irradiance(area_lamp("rect 2 1", 100, place, turn), points, 16384, 0)
    compare("anywhere, dark behind", times(expected, [100 * math.pi * c for c in COLOR]), got, 0.01, 16384)


@case
def rectangle_light_scaled_by_its_node_and_lit_by_candela():
    scene, place, turn, scale = Gltf(), (0, 2, 0), DOWN, (2.0, 0.5, 3.0)
    light = scene.add_light("point", 30, color=COLOR, range=9.0)
    node(scene, "lamp", light=light, translation=place, rotation=turn, scale=scale, extras={"luxel_area": "rect 0.5 0.8"})
    corners = oracle.rectangle(place, (0.5, 0, 0), (0, 0, 0.2))
    points = [(p, (0, 1, 0)) for p in ((0, 0, 0), (1, 0, 0.5), (-3, 0, 2), (0.2, 1.5, 0))]
    expected = [30 / (1.0 * 0.4) * math.pi * oracle.polygon(corners, p, n) * oracle.window(v_len(v_sub(place, p)), 9) for p, n in points]
    got = irradiance(scene, points, 4096, 0)
    compare("L = I / area of the scaled lamp, range by its centre", times(expected, COLOR), got, 2e-3, 4096)


@case
def rectangle_light_half_hidden_by_a_wall_meets_lamberts_formula():
    scene = area_lamp("rect 2 1", 100, (0, 2, 0), DOWN)
    black = scene.add_material("black", base_color=(0, 0, 0), double_sided=True)
    scene.add_node("half", mesh=scene.add_mesh("half", (quad(10, 10).translate(5, 0, 0), black)), translation=(0, 1, 0),
                   rotation=DOWN)
    corners = oracle.rectangle((0, 2, 0), (1, 0, 0), (0, 0, 0.5))
    points, expected = [], []
    for x in (-0.4, -0.2, 0.0, 0.2, 0.4):
        points.append(((x, 0, 0.1), (0, 1, 0)))
        seen = oracle.cut(corners, (-x, 2, 0), (-1, 0, 0))  # the wall's edge, seen on the lamp
        expected.append(oracle.polygon(seen, *points[-1]))
    compare("the part seen past the edge", times(expected, [100 * math.pi * c for c in COLOR]),
            irradiance(scene, points, 16384, 0), 0.01, 16384)


@case
def disk_light_on_its_axis_meets_the_closed_form():
    radius = 0.7
    points = [((0, -d, 0), (0, 1, 0)) for d in (0.01, 0.1, 0.5, 1, 3, 60)]
    expected = [oracle.parallel_disk(radius, -p[1]) for p, _ in points]
    got = irradiance(area_lamp("disk 0.7", 100, rotation=DOWN), points, 16384, 0)
    compare("R² / (R² + d²)", times(expected, [100 * math.pi * c for c in COLOR]), got, 0.01, 16384)


@case
def disk_light_off_its_axis_meets_the_closed_form():
    radius, points, expected = 0.7, [], []
    for h in (0.1, 0.5, 2, 13):  # the last is sampled by area
        for offset in (0.3, 0.7, 1.5, 4):
            points.append(((offset * 0.6, -h, offset * 0.8), (0, 1, 0)))
            expected.append(oracle.parallel_disk(radius, h, offset))
    got = irradiance(area_lamp("disk 0.7", 100, rotation=DOWN), points, 16384, 0)
    compare("parallel planes", times(expected, [100 * math.pi * c for c in COLOR]), got, 0.01, 16384)


@case
def disk_light_scaled_to_an_ellipse_and_turned_meets_lamberts_formula():
    place, turn = (0.1, 0.2, 0.3), quat((1, -1, 2), 70)
    rim = oracle.ellipse(place, quat_rotate(turn, (1.4, 0, 0)), quat_rotate(turn, (0, 0.35, 0)))
    front = quat_rotate(turn, (0, 0, -1))
    points, expected = [], []
    for p, n in receivers(120, 0.5, 3, place):
        seen = v_dot(v_sub(p, place), front) > 0
        e = oracle.polygon(rim, p, n) if seen else 0.0
        if not seen or e == 0 or e > 0.005:
            points.append((p, n))
            expected.append(e)
    got = irradiance(area_lamp("disk 0.7", 100, place, turn, (2, 0.5, 1)), points, 32768, 0)
    compare("anywhere, dark behind", times(expected, [100 * math.pi * c for c in COLOR]), got, 0.01, 32768)


@case
def lamps_flush_with_a_ceiling_are_not_shadowed_by_it():
    place, turn = (0.37, 2.71, -0.53), quat((2, 1, 3), 41)  # a plane whose points are not exact in floats
    front, along, across = (quat_rotate(turn, d) for d in ((0, 0, -1), (1, 0, 0), (0, 1, 0)))
    points = []
    for x, y, h in ((0, 0, 0.3), (0.5, -0.2, 1), (-3, 2, 4), (30, 10, 50)):
        points.append((v_add(place, v_add(v_mul(front, h), v_add(v_mul(along, x), v_mul(across, y)))), v_mul(front, -1)))
    corners = oracle.rectangle(place, v_mul(along, 0.5), v_mul(across, 0.25))
    for extras in (None, {"luxel_area": "rect 1 0.5"}):
        scene = lamp("point", 40, place, turn, extras=extras)
        white = scene.add_material("white", base_color=(0, 0, 0))
        ceiling = grid(200, 200, 9, 9).rotate((0, 1, 0), 180)
        node(scene, "ceiling", mesh=scene.add_mesh("ceiling", (ceiling, white)), translation=place, rotation=turn)
        expected = cosine_law(points, place)
        if extras:
            expected = [2 * math.pi * oracle.polygon(corners, p, n) for p, n in points]
        got = irradiance(scene, points, 4096, 0)
        compare("rectangle" if extras else "point", times(expected, [40 * c for c in COLOR]), got, 2e-3, 4096)
