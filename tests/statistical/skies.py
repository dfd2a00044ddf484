"""Light from outside: a sky of one colour, seen whole, past a wall, through a window; sky pictures."""

import math
import random

import oracle
from gltf import Gltf, box, quad, quat, v_dot, v_norm
from lamps import DOWN, direction, node
from measure import case, compare, grey, irradiance, times

SKY = ("--sky", "2,1,0.5")
SKY_RGB = (2, 1, 0.5)


def black_scene():
    scene = Gltf()
    return scene, scene.add_material("black", base_color=(0, 0, 0), double_sided=True)


def directions(count, seed=5):
    rng = random.Random(seed)
    return [direction(rng) for _ in range(count)]


@case
def open_sky_of_one_colour_gives_pi_times_its_radiance():
    points = [((0, 0, 0), n) for n in directions(20)]
    got = irradiance(Gltf(), points, 64, 0, *SKY)
    compare("any normal", times([math.pi] * 20, SKY_RGB), got, 1e-5, 64)


@case
def sky_intensity_multiplies_the_sky():
    got = irradiance(Gltf(), [((0, 0, 0), (0, 1, 0))], 64, 0, "--sky", "#ffffff", "--sky-intensity", "3.5")
    compare("3.5 pi", grey([3.5 * math.pi]), got, 1e-5, 64)


@case
def sky_half_hidden_by_an_endless_wall_gives_half():
    scene, black = black_scene()
    scene.add_node("wall", mesh=scene.add_mesh("wall", (quad(1e6, 1e6), black)))
    points = [((0, 0, z), (0, 1, 0)) for z in (0.01, 0.1, 1, 10)]
    got = irradiance(scene, points, 4096, 0, *SKY)
    compare("half of pi L", times([math.pi / 2] * 4, SKY_RGB), got, 2e-3, 4096)


@case
def sky_past_a_finite_wall_is_the_rest_of_the_hemisphere():
    scene, black = black_scene()
    scene.add_node("wall", mesh=scene.add_mesh("wall", (quad(4, 3), black)), translation=(0, 1.5, 0))
    wall = oracle.rectangle((0, 1.5, 0), (2, 0, 0), (0, 1.5, 0))
    points = [((x, y, z), v_norm((0, 1, t))) for x, y, z, t in
              ((0, 0, 0.5, 0), (1.9, 0, 0.2, 0), (0, 0.5, 1, -1), (3, 1, 2, -0.5), (0, 2, -0.7, 3), (0, 1.5, 1, -50))]
    expected = [math.pi * (1 - oracle.polygon(wall, p, n)) for p, n in points]
    compare("pi L (1 - F of the wall)", times(expected, SKY_RGB), irradiance(scene, points, 16384, 0, *SKY), 5e-3, 16384)


def room_with_window():
    """A closed black box of 4 × 3 × 4 metres around (0, 1.5, 0); at x = 2 a window of z -1..0.5 and y 1..2.2."""
    scene, black = black_scene()
    parts = [box(4, 3, 4, (0, 1.5, 0), skip="+x")]
    for z0, z1, y0, y1 in ((-2, -1, 0, 3), (0.5, 2, 0, 3), (-1, 0.5, 0, 1), (-1, 0.5, 2.2, 3)):
        parts.append(quad(z1 - z0, y1 - y0).rotate((0, 1, 0), -90).translate(2, (y0 + y1) / 2, (z0 + z1) / 2))
    whole = parts[0]
    for part in parts[1:]:
        whole.append(part)
    scene.add_node("room", mesh=scene.add_mesh("room", (whole, black)))
    return scene, oracle.rectangle((2, 1.6, -0.25), (0, 0, 0.75), (0, 0.6, 0))


@case
def sky_through_a_window_is_the_form_factor_of_the_window():
    scene, window = room_with_window()
    points = [((x, 0.001, z), (0, 1, 0)) for x, z in ((1.5, 0), (1, -1), (0, 0), (0.5, 1.5))]
    points += [((-1.999, 1.5, 0), (1, 0, 0)), ((0, 1, -1.999), (0, 0, 1)), ((1.9, 1.5, -0.3), (1, 0, 0))]
    expected = [math.pi * oracle.polygon(window, p, n) for p, n in points]
    compare("pi L F", times(expected, SKY_RGB), irradiance(scene, points, 65536, 0, *SKY), 0.01, 65536)


# --- Pictures ---------------------------------------------------------------------------------------------------------


def hdr(path, rows):
    """Writes a Radiance picture, flat RGBE, grey; returns the pixels as they are after rounding."""
    data = bytearray(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (len(rows), len(rows[0])))
    stored = []
    for row in rows:
        line = []
        for value in row:
            if value <= 0:
                data += bytes(4)
                line.append(0.0)
                continue
            mantissa, exponent = math.frexp(value)
            byte = min(255, round(mantissa * 256))
            data += bytes((byte, byte, byte, exponent + 128))
            line.append(math.ldexp(byte, exponent - 8))
        stored.append(line)
    with open(path, "wb") as file:
        file.write(data)
    return stored


def sky_case(rows, rotation, normals, samples, tolerance, what, steps=4, least=0.0):
    stored = hdr("sky.hdr", rows)
    expected = oracle.SkyPicture(stored, rotation).irradiance(normals, steps)
    kept = [k for k, e in enumerate(expected) if e == 0 or e > least * max(expected)]
    options = ["--sky", "sky.hdr"] + (["--sky-rotation", str(rotation)] if rotation else [])
    got = irradiance(Gltf(), [((0, 0, 0), normals[k]) for k in kept], samples, 0, *options)
    compare(what, grey([expected[k] for k in kept]), got, tolerance, samples)


AXES = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]


def sun_picture():
    """A bright block at u about 0.7, v about 0.3: above the horizon between -x and +z... as oracle.SkyPicture says."""
    rows = [[0.0] * 64 for _ in range(32)]
    for y in range(8, 12):
        for x in range(44, 48):
            rows[y][x] = 1000.0
    return rows


def gradient_picture():
    """Changes in u and v; nowhere black, and different in each of the six directions."""
    return [[1 + 0.8 * math.sin(2 * math.pi * (x + 0.5) / 64 + 0.4) * math.sin(math.pi * (y + 0.5) / 32) + (31 - y) / 16
             for x in range(64)] for y in range(32)]


@case
def sky_picture_of_one_grey_gives_pi_times_its_radiance():
    normals = AXES + directions(6)
    stored = hdr("sky.hdr", [[1.5] * 16] * 8)
    got = irradiance(Gltf(), [((0, 0, 0), n) for n in normals], 4096, 0, "--sky", "sky.hdr")
    compare("any normal", grey([math.pi * stored[0][0]] * 12), got, 2e-3, 4096)


@case
def sky_picture_with_a_bright_block_stands_where_three_js_has_it():
    sky_case(sun_picture(), 0, AXES + directions(12), 16384, 0.01, "block of 4 × 4 pixels in 64 × 32", steps=8, least=0.01)


@case
def sky_picture_with_a_smooth_gradient_stands_where_three_js_has_it():
    sky_case(gradient_picture(), 0, AXES + directions(6), 16384, 5e-3, "64 × 32 pixels")


@case
def sky_rotation_turns_the_picture_about_the_vertical():
    for degrees in (90, -37, 200):
        sky_case(sun_picture(), degrees, AXES + directions(6), 16384, 0.01, "block turned by %d°" % degrees, 8, 0.01)
        sky_case(gradient_picture(), degrees, AXES, 16384, 5e-3, "gradient turned by %d°" % degrees)


@case
def sky_picture_with_poles_and_seam_lit():
    rows = [[0.0] * 32 for _ in range(16)]
    rows[0] = [5.0] * 32
    rows[15] = [3.0] * 32
    for y in range(4, 12):
        rows[y][0] = rows[y][31] = 7.0
    sky_case(rows, 0, AXES + directions(6), 16384, 0.01, "first and last row, first and last column", 8, 0.01)


@case
def sky_picture_through_a_window():
    scene, window = room_with_window()
    stored = hdr("sky.hdr", [[2.0] * 64] * 32)
    points = [((x, 0.001, z), (0, 1, 0)) for x, z in ((1.5, 0), (1, -1), (0, 0), (0.5, 1.5))]
    expected = [stored[0][0] * math.pi * oracle.polygon(window, p, n) for p, n in points]
    compare("pi L F", grey(expected), irradiance(scene, points, 65536, 0, "--sky", "sky.hdr"), 0.01, 65536)
