#!/usr/bin/env python3
"""How fast irradiance comes to its closed form.

    convergence.py LUXEL [--draw FILE.svg]    prints a CSV: what, samples, error; draws it

The error is the root mean square of the relative errors of 16 points. Takes some minutes; analytic.py runs a smaller form of it.
"""

import math
import os
import shutil
import sys
import tempfile

import measure
import emitters
import oracle
from bounces import furnace, points_on_walls
from gltf import Gltf, quad, v_norm
from lamps import DOWN, area_lamp, lamp
from measure import Row, expect, irradiance
from skies import hdr, sun_picture

COUNTS = [2 ** k for k in range(4, 21, 2)]


def half_hidden_rectangle():
    scene = area_lamp("rect 2 1", 100, (0, 2, 0), DOWN)
    black = scene.add_material("black", base_color=(0, 0, 0), double_sided=True)
    scene.add_node("half", mesh=scene.add_mesh("half", (quad(10, 10).translate(5, 0, 0), black)), translation=(0, 1, 0), rotation=DOWN)
    corners = oracle.rectangle((0, 2, 0), (1, 0, 0), (0, 0, 0.5))
    points = [((0.1 * k - 0.75, 0, 0.03 * k), (0, 1, 0)) for k in range(16)]
    expected = [100 * math.pi * oracle.polygon(oracle.cut(corners, (-p[0], 2, 0), (-1, 0, 0)), p, n) for p, n in points]
    return scene, points, expected, 0, ()


def setting_sphere():
    points, expected = [], []
    for k in range(16):
        d = 0.6 + 0.1 * k
        half = math.asin(0.5 / d)
        angle = math.pi / 2 + half * (k % 4 / 4 - 0.5)
        points.append(((0, 0, -d), (math.sin(angle), 0, math.cos(angle))))
        expected.append(40 / 0.25 * oracle.sphere(angle, half))
    return lamp("point", 40, extras={"luxel_radius": 0.5}), points, expected, 0, ()


def striped_picture():
    columns = [255, 0, 40, 255, 0, 0, 200, 90]
    points = [((0.3 * k - 2, -0.1 * (k % 5) - 0.2, 0.1 * k - 0.8), v_norm((0.1 * (k % 3), 1, 0.2))) for k in range(16)]
    expected = [100 * math.pi * e for e in emitters.strips(columns, True, points, 1)]
    return emitters.striped(columns, True), points, expected, 0, ()


def bright_sky():
    stored = hdr("sky.hdr", sun_picture())
    points = [((0, 0, 0), v_norm((math.cos(k), 1 + math.sin(3 * k), math.sin(k) - 1))) for k in range(16)]
    values = oracle.SkyPicture(stored).irradiance([n for _, n in points], 40)
    kept = [k for k, e in enumerate(values) if e > max(values) / 20]
    return Gltf(), [points[k] for k in kept], [values[k] for k in kept], 0, ("--sky", "sky.hdr")


def white_furnace():
    points = []
    for k in range(16):
        (x, y, z), n = points_on_walls()[k % 5]
        points.append(((x * (1 - 0.02 * k) if not n[0] else x, y * (1 - 0.02 * k) if not n[1] else y, z * (1 - 0.02 * k) if not n[2] else z), n))
    return furnace((0.5,) * 3), points, [10 * math.pi] * 16, "inf", ()


CURVES = {
    "rectangle light, half hidden": half_hidden_rectangle,
    "sphere light, cut by the horizon": setting_sphere,
    "emissive picture of stripes": striped_picture,
    "sky picture with a small sun": bright_sky,
    "white furnace, bounces inf": white_furnace,
}


def error_of(curve, count, points=16):
    scene, where, expected, bounces, options = curve()
    got = irradiance(scene, where[:points], count, bounces, *options)
    # The first channel against its light: all scenes are grey, or have 1 there.
    return math.sqrt(math.fsum((g[0] / e - 1) ** 2 for g, e in zip(got, expected)) / len(got))


def convergence_case(name, curve):
    top = 18 if curve is white_furnace else 20  # long paths take long

    def run():
        few, many = (error_of(curve, 2 ** count, 4) for count in (top - 10, top))
        measure.ROWS.append(Row("rms error of 4 points after 2^%d samples, of that after 2^%d" % (top, top - 10), few, many, many / few,
                                0.1, 4, 2 ** top))
        expect(many <= few / 10 or many < 1e-4, "error %.3g after 2^%d samples, %.3g after 2^%d" % (few, top - 10, many, top))
    measure.CASES["error_keeps_falling_" + "_".join(name.replace(",", "").split())] = run


for title, source in CURVES.items():
    convergence_case(title, source)


# --- The picture ------------------------------------------------------------------------------------------------------

COLORS = ("#0b6fb3", "#d1495b", "#2e8b57", "#c77700", "#6a4c93")
WIDTH, HEIGHT, LEFT, TOP, RIGHT, BOTTOM = 760, 500, 78, 30, 24, 64


def draw(rows, path):
    """rows: (what, samples, error)."""
    low = math.floor(math.log10(min(e for _, _, e in rows)))
    high = math.ceil(math.log10(max(e for _, _, e in rows)))
    first, last = math.log2(COUNTS[0]), math.log2(COUNTS[-1])

    def x_of(count):
        return LEFT + (math.log2(count) - first) / (last - first) * (WIDTH - LEFT - RIGHT)

    def y_of(error):
        return TOP + (high - math.log10(error)) / (high - low) * (HEIGHT - TOP - BOTTOM)
    svg = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 %d %d" font-family="sans-serif" font-size="14" fill="#222">' %
           (WIDTH, HEIGHT), '<rect width="100%" height="100%" fill="#fff"/>']

    def line(x0, y0, x1, y1, style):
        svg.append('<line x1="%.1f" y1="%.1f" x2="%.1f" y2="%.1f" %s/>' % (x0, y0, x1, y1, style))

    def text(x, y, words, style=""):
        svg.append('<text x="%.1f" y="%.1f" %s>%s</text>' % (x, y, style, words))

    def power_of(base, exponent, x, y):
        """The base ends at x, its exponent begins there."""
        text(x, y, base, 'text-anchor="end"')
        text(x + 1, y - 6, str(exponent).replace("-", "\u2212"), 'font-size="10"')
    for count in COUNTS:
        line(x_of(count), TOP, x_of(count), HEIGHT - BOTTOM, 'stroke="#e4e4e4"')
        power_of(2, int(math.log2(count)), x_of(count) + 2, HEIGHT - BOTTOM + 22)
    for power in range(low, high + 1):
        line(LEFT, y_of(10.0 ** power), WIDTH - RIGHT, y_of(10.0 ** power), 'stroke="#e4e4e4"')
        power_of(10, power, LEFT - 22, y_of(10.0 ** power) + 6)
    svg.append('<rect x="%d" y="%d" width="%d" height="%d" fill="none" stroke="#888"/>' %
               (LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM))
    text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 18, "samples per point", 'text-anchor="middle"')
    text(0, 0, "relative error (root mean square of 16 points)",
         'text-anchor="middle" transform="translate(22 %.1f) rotate(-90)"' % ((TOP + HEIGHT - BOTTOM) / 2))
    start = 0.3
    line(x_of(COUNTS[0]), y_of(start), x_of(COUNTS[-1]), y_of(start * (COUNTS[0] / COUNTS[-1]) ** 0.5),
         'stroke="#999" stroke-dasharray="6 5"')
    text(x_of(2 ** 17), y_of(start * (COUNTS[0] / 2 ** 17) ** 0.5) - 8, "1/√N", 'fill="#777"')
    names = list(dict.fromkeys(name for name, _, _ in rows))
    for k, name in enumerate(names):
        style = 'stroke="%s" stroke-width="2"' % COLORS[k]
        spots = [(x_of(n), y_of(e)) for what, n, e in rows if what == name]
        for (x0, y0), (x1, y1) in zip(spots, spots[1:]):
            line(x0, y0, x1, y1, style)
        for x, y in spots:
            svg.append('<circle cx="%.1f" cy="%.1f" r="3.5" fill="%s"/>' % (x, y, COLORS[k]))
        y = HEIGHT - BOTTOM - 16 - 20 * (len(names) - 1 - k)
        line(LEFT + 14, y - 5, LEFT + 40, y - 5, style)
        text(LEFT + 48, y, name)
    svg.append("</svg>")
    with open(path, "w") as file:
        file.write("\n".join(svg) + "\n")


def main():
    arguments = sys.argv[1:]
    if not arguments:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    measure.harness.PROGRAM = os.path.abspath(arguments[0])
    picture = os.path.abspath(arguments[2]) if arguments[1:2] == ["--draw"] else None
    folder = tempfile.mkdtemp(prefix="luxel-convergence-")
    os.chdir(folder)
    rows = []
    print("what,samples,error")
    try:
        for name, curve in CURVES.items():
            for count in COUNTS:
                rows.append((name, count, error_of(curve, count)))
                print('"%s",%d,%.3e' % rows[-1], flush=True)
    finally:
        os.chdir(measure.ROOT)
        shutil.rmtree(folder, ignore_errors=True)
    if picture:
        draw(rows, picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
