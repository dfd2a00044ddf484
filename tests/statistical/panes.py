"""What light passes through: panes, holes, glass."""

import math
import random

import oracle
from gltf import Gltf, grid, look, quad, quat, v_norm
from lamps import COLOR, DOWN, lamp, node
from measure import EXACT, case, compare, compare_mean, grey, irradiance, times

ALPHA = 0.15


UP = quat((1, 0, 0), -90)  # turns a quad's +Z into +Y


def stack(scene, count, material, mesh=None):
    """Panes at heights 1 .. count."""
    pane = scene.add_mesh("pane", (mesh or quad(100, 100), material))
    for k in range(1, count + 1):
        scene.add_node("pane %d" % k, mesh=pane, translation=(0, k, 0), rotation=UP)


def blend(scene, alpha=ALPHA, color=(0, 0, 0)):
    return scene.add_material("pane", base_color=(*color, alpha), alpha="BLEND", double_sided=True)


def sun(tilt=(0.1, -1, 0.23), lux=10.0):
    scene = lamp("directional", lux, rotation=look((0, 0, 0), tilt), color=(1, 1, 1))
    return scene, -v_norm(tilt)[1] * lux


@case
def sun_through_one_to_twenty_panes_loses_a_share_in_each():
    scene, facing = sun()
    stack(scene, 20, blend(scene))
    points = [((0.3, 20.5 - k, 0.4), (0, 1, 0)) for k in range(21)]
    expected = [facing * (1 - ALPHA) ** k for k in range(21)]
    compare("(1 - a)^k, k = 0 .. 20", grey(expected), irradiance(scene, points, 1, 0), EXACT, 1)


@case
def sun_through_a_pane_of_a_thousand_triangles_loses_its_share_once():
    scene, facing = sun()
    stack(scene, 3, blend(scene), grid(100, 100, 23, 23))
    rng = random.Random(4)
    points = [((rng.uniform(-40, 40), 0, rng.uniform(-40, 40)), (0, 1, 0)) for _ in range(2000)]
    compare("(1 - a)^3", grey([facing * (1 - ALPHA) ** 3] * 2000), irradiance(scene, points, 1, 0), EXACT, 1)


@case
def sun_through_the_shared_edge_of_two_triangles_loses_its_share_once():
    scene, facing = sun((0, -1, 0))
    stack(scene, 1, blend(scene))
    points = [((0.25 * x, 0, 0.25 * z), (0, 1, 0)) for x in range(-20, 21) for z in range(-20, 21)]
    expected = [facing * (1 - ALPHA)] * len(points)
    compare("1 - a, on the diagonal too", grey(expected), irradiance(scene, points, 1, 0), EXACT, 1)


@case
def every_kind_of_light_passes_panes():
    k = 3
    expected = {
        "point": ({}, 30 / 25.0, 1),
        "sphere": ({"luxel_radius": 0.3}, 30 / 25.0, 4096),
        "rectangle": ({"luxel_area": "rect 1 1"}, 30 * math.pi * 4 * oracle.parallel_rectangle(0.5, 0.5, 5), 4096),
    }
    for name, (extras, value, samples) in expected.items():
        scene = lamp("point", 30, (0.3, 5, 0.1), DOWN, color=(1, 1, 1), extras=extras)
        stack(scene, k, blend(scene))
        got = irradiance(scene, [((0.3, 0, 0.1), (0, 1, 0))], samples, 0)
        compare(name, grey([value * (1 - ALPHA) ** k]), got, 2e-3, samples)
    scene = Gltf()
    shine = scene.add_material("shine", base_color=(0, 0, 0), emissive=(1, 1, 1), strength=30)
    scene.add_node("panel", mesh=scene.add_mesh("panel", (quad(3, 3), shine)), translation=(0.3, 5, 0.1),
                   rotation=quat((1, 0, 0), 90))
    stack(scene, k, blend(scene))
    got = irradiance(scene, [((0.3, 0, 0.1), (0, 1, 0))], 65536, 0)
    value = 30 * math.pi * 4 * oracle.parallel_rectangle(1.5, 1.5, 5)
    compare("emissive", grey([value * (1 - ALPHA) ** k]), got, 0.01, 65536)


@case
def sky_through_panes_loses_a_share_in_each():
    scene = Gltf()
    stack(scene, 20, blend(scene), quad(1e5, 1e5))
    for k in (1, 5, 12, 20):
        # A ray passes all or dies: of N rays a share p = (1 - a)^k arrives, give or take 1 / sqrt(N p); three times that is allowed.
        passed = (1 - ALPHA) ** k
        got = irradiance(scene, [((0.3, 20.5 - k, 0.4), (0, 1, 0))], 65536, 0, "--sky", "1,1,1")
        compare("pi L (1 - a)^%d" % k, grey([math.pi * passed]), got, 3 / math.sqrt(65536 * passed), 65536)


@case
def blended_pane_scatters_what_it_does_not_pass():
    # One white pane with alpha a above and sky all around: what passes and what the pane's lower side reflects of a white
    # ground's light is left out by a black receiver plane; so only the pane's scattering of the sky from below would add. It sees
    # nothing but the black ground, so E = pi L (1 - a) on the ground however white the pane is.
    scene = Gltf()
    black = scene.add_material("ground", base_color=(0, 0, 0))
    scene.add_node("ground", mesh=scene.add_mesh("ground", (quad(1e5, 1e5), black)), rotation=UP)
    stack(scene, 1, blend(scene, 0.4, (1, 1, 1)), quad(1e5, 1e5))
    got = irradiance(scene, [((0.3, 0, 0.4), (0, 1, 0))], 65536, "inf", "--sky", "1,1,1")
    compare("pi L (1 - a)", grey([math.pi * 0.6]), got, 0.01, 65536)


@case
def coloured_shadows_tint_what_passes_a_pane():
    scene, facing = sun()
    stack(scene, 2, blend(scene, 0.3, (0.9, 0.5, 0.2)))
    points = [((0, 0, 0), (0, 1, 0))]
    compare("plain: (1 - a)²", grey([facing * 0.49]), irradiance(scene, points, 1, 0), EXACT, 1)
    got = irradiance(scene, points, 1, 0, "--coloured-shadows")
    compare("tinted: (c (1 - a))²", [tuple(facing * (c * 0.7) ** 2 for c in (0.9, 0.5, 0.2))], got, EXACT, 1)


@case
def glass_passes_its_transmission_in_its_colour():
    scene, facing = sun()
    color = (0.9, 0.5, 0.2)
    glass = scene.add_material("glass", base_color=color, transmission=0.8, double_sided=True)
    stack(scene, 3, glass)
    points = [((0, 3.5 - k, 0), (0, 1, 0)) for k in range(4)]
    expected = [tuple(facing * (0.8 * c) ** k for c in color) for k in range(4)]
    compare("(t c)^k", expected, irradiance(scene, points, 1, 0), EXACT, 1)


@case
def glass_tints_the_sky_and_emitters_as_it_tints_lamps():
    color = (0.9, 0.5, 0.2)
    scene = Gltf()
    stack(scene, 1, scene.add_material("glass", base_color=color, transmission=1.0, double_sided=True), quad(1e5, 1e5))
    got = irradiance(scene, [((0.3, 0, 0.4), (0, 1, 0))], 4096, 0, "--sky", "1,1,1")
    compare("pi L c", times([math.pi], color), got, 5e-3, 4096)


def checkered(scene):
    """Alpha 1 and 0 in turns, two pixels, on a sheet whose texture repeats every 2 m."""
    pixels = bytes((255, 255, 255, 255, 255, 255, 255, 0, 255, 255, 255, 0, 255, 255, 255, 255))
    picture = scene.add_image("checks", 2, 2, pixels, 4, wrap=True)
    return scene.add_material("checks", base_color=(0, 0, 0), texture=picture, alpha="MASK", cutoff=0.5, double_sided=True)


@case
def sun_through_a_cutout_draws_its_squares_exactly():
    scene, facing = sun((0, -1, 0))
    sheet = quad(20, 20)
    sheet.uvs = [(p[0] / 2, -p[1] / 2) for p in sheet.positions]  # pixel (0, 0): x and y of the sheet from 0 to 1, -1 to 0
    stack(scene, 1, checkered(scene), sheet)
    points, expected = [], []
    rng = random.Random(9)
    for _ in range(3000):
        x, z = rng.uniform(-9, 9), rng.uniform(-9, 9)
        if min(x % 1, -x % 1, z % 1, -z % 1) < 1e-3:
            continue
        # The sheet's y is world -z; rows of the picture run down the sheet's y, so along world z. Bilinear filtering of 1 and 0
        # crosses one half in the middle between centres, which is the squares' edge.
        solid = (math.floor(x) + math.floor(z)) % 2 == 0
        points.append(((x, 0, z), (0, 1, 0)))
        expected.append(0.0 if solid else facing)
    got = irradiance(scene, points, 1, 0)
    compare("light in holes, dark in squares", grey(expected), got, EXACT, 1)
    lit = sum(1 for g in got if g[0] > 0)
    share = sum(1 for e in expected if e > 0)
    compare_mean("points with light", share, [lit], 1e-9, 1)


@case
def sky_through_a_cutout_is_half_of_it():
    scene = Gltf()
    sheet = quad(2000, 2000)
    sheet.uvs = [(p[0] * 50, -p[1] * 50) for p in sheet.positions]  # squares of 1 cm, a metre and more away
    stack(scene, 1, checkered(scene), sheet)
    got = irradiance(scene, [((0.3, 0, 0.4), (0, 1, 0))], 65536, 0, "--sky", "1,1,1")
    compare("pi L / 2", grey([math.pi / 2]), got, 0.01, 65536)


@case
def lamp_through_holes_and_panes_together():
    scene, facing = sun((0, -1, 0))
    sheet = quad(20, 20)
    sheet.uvs = [(p[0] / 2, -p[1] / 2) for p in sheet.positions]
    mask = checkered(scene)
    for k in range(16):
        scene.add_node("sheet %d" % k, mesh=scene.add_mesh("sheet %d" % k, (sheet, mask)), translation=(0, 0.5 + k, 0), rotation=UP)
    stack(scene, 16, blend(scene))
    points = [((x + 0.5, 0, 0.5), (0, 1, 0)) for x in range(-8, 8)]
    expected = [0.0 if x % 2 == 0 else facing * (1 - ALPHA) ** 16 for x in range(-8, 8)]
    compare("16 holes and 16 panes in turns", grey(expected), irradiance(scene, points, 1, 0), EXACT, 1)


@case
def single_sided_sheet_hides_from_either_side_unless_luxel_transparent():
    for transparent, share in ((False, 0.0), (True, 0.7)):
        scene, facing = sun((0, -1, 0))
        sheet = scene.add_material("sheet", base_color=(0, 0, 0, 0.3))
        for k, turn in enumerate((90, -90)):
            scene.add_node("sheet %d" % k, mesh=scene.add_mesh("sheet %d" % k, (quad(2, 2), sheet)), translation=(5 * k, 1, 0),
                           rotation=quat((1, 0, 0), turn), extras={"luxel_transparent": True} if transparent else None)
        got = irradiance(scene, [((0.1, 0, 0.3), (0, 1, 0)), ((5.1, 0, 0.3), (0, 1, 0)), ((9, 0, 0), (0, 1, 0))], 1, 0)
        compare("luxel_transparent" if transparent else "opaque", grey([facing * share, facing * share, facing]), got, EXACT, 1)
