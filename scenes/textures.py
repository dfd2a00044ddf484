"""Procedural pictures for the bar: tileable value noise and what is painted with it.

Every painter returns (width, height, pixels, channels); colours are sRGB, 0..255.
"""

import math
import random


def noise(w, h, cells_x, cells_y, seed):
    """One octave of tileable value noise, 0..1, row by row in a flat list."""
    rnd = random.Random(seed)
    lattice = [[rnd.random() for _ in range(cells_x)] for _ in range(cells_y)]

    def steps(n, cells):
        out = []
        for i in range(n):
            f = i * cells / n
            k = int(f)
            t = f - k
            out.append((k, (k + 1) % cells, t * t * (3 - 2 * t)))
        return out

    across = steps(w, cells_x)
    out = []
    for j, j1, t in steps(h, cells_y):
        row = [a + (b - a) * t for a, b in zip(lattice[j], lattice[j1])]
        out += [row[i] + (row[i1] - row[i]) * s for i, i1, s in across]
    return out


def fbm(w, h, cells_x, cells_y, octaves, seed):
    total = [0.0] * (w * h)
    gain, norm = 1.0, 0.0
    for k in range(octaves):
        n = noise(w, h, min(w, cells_x << k), min(h, cells_y << k), seed * 31 + k)
        total = [a + gain * b for a, b in zip(total, n)]
        norm += gain
        gain *= 0.5
    return [a / norm for a in total]


def byte(x):
    # even values only: nobody sees it, and PNG gets a third smaller
    return 0 if x < 0 else 254 if x > 254 else int(x + 0.5) & 254


def paint(w, h, shade, channels=3):
    """shade(x, y, i) -> colour of texel i = y * w + x."""
    out = bytearray()
    i = 0
    for y in range(h):
        for x in range(w):
            out += bytes(map(byte, shade(x, y, i)))
            i += 1
    return w, h, bytes(out), channels


def mix(a, b, t):
    return (a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t)


def mul(a, s):
    return (a[0] * s, a[1] * s, a[2] * s)


def clamp01(x):
    return 0.0 if x < 0 else 1.0 if x > 1 else x


# --- materials ---------------------------------------------------------------------------------


def brick(n=512):
    """Running bond, 8 bricks by 24 courses: 1.92 m a side."""
    rough = fbm(n, n, 64, 64, 3, 11)
    wave = fbm(n, n, 16, 16, 2, 12)
    stain = fbm(n, n, 3, 3, 3, 13)
    rnd = random.Random(14)
    tones = [[(rnd.random(), rnd.random()) for _ in range(8)] for _ in range(24)]
    course, long = n / 24, n / 8

    def shade(x, y, i):
        wy = y + (wave[i] - 0.5) * 5
        row = int(wy // course)
        wx = x + (0.5 * long if row & 1 else 0) + (wave[i] - 0.5) * 4
        col = int(wx // long)
        dx, dy = wx - col * long, wy - row * course
        edge = min(dx, long - dx, dy, course - dy) - 1.1 + (rough[i] - 0.5) * 2.2
        tone, burnt = tones[row % 24][col % 8]
        c = mix((150, 80, 58), (190, 112, 80), tone)
        if burnt < 0.16:
            c = mix(c, (98, 62, 56), 0.75)
        elif burnt > 0.88:
            c = mix(c, (200, 150, 116), 0.6)
        c = mul(c, 0.78 + 0.44 * rough[i])
        mortar = mul((158, 146, 130), 0.85 + 0.3 * rough[i])
        return mul(mix(mortar, c, clamp01(edge)), 0.82 + 0.36 * stain[i])

    return paint(n, n, shade)


def wood(n=512):
    """Straight grain along u, 0.8 m a side; tinted by the material."""
    warp = fbm(n, n, 2, 5, 3, 21)
    streak = fbm(n, n, 4, 96, 2, 22)
    pores = noise(n, n, 24, 256, 23)

    def shade(x, y, i):
        ring = 0.5 + 0.5 * math.sin(2 * math.pi * (5 * y / n + 3.2 * warp[i]))
        c = mix((150, 104, 66), (206, 160, 112), 0.25 + 0.5 * ring * ring + 0.25 * streak[i])
        return mul(c, (0.84 + 0.3 * streak[i]) * (0.8 if pores[i] > 0.86 else 1.0))

    return paint(n, n, shade)


def floorboards(n=512):
    """Twelve boards of 12.5 cm, 1.5 m a side, ends staggered."""
    warp = fbm(n, n, 2, 24, 2, 31)
    streak = fbm(n, n, 5, 128, 2, 32)
    worn = fbm(n, n, 3, 3, 3, 33)
    rnd = random.Random(34)
    boards = [(rnd.random(), rnd.random() * n, rnd.random()) for _ in range(12)]
    wide = n / 12

    def shade(x, y, i):
        k = min(11, int(y / wide))
        tone, end, phase = boards[k]
        v = y - k * wide
        ring = 0.5 + 0.5 * math.sin(2 * math.pi * (v / wide * 1.7 + 4 * warp[i] + phase))
        c = mix((112, 74, 46), (164, 118, 78), 0.2 + 0.4 * ring + 0.4 * streak[i])
        c = mul(c, 0.76 + 0.42 * tone + 0.16 * (worn[i] - 0.5))
        gap = min(v, wide - v, abs((x - end + n / 2) % n - n / 2))
        return mul(c, 0.4 if gap < 0.8 else 0.8 if gap < 1.8 else 1.0)

    return paint(n, n, shade)


def plaster(n=256):
    """Trowelled, 1.6 m a side; tinted by the material."""
    coarse = fbm(n, n, 4, 4, 4, 41)
    fine = noise(n, n, 128, 128, 42)

    def shade(x, y, i):
        return mul((226, 216, 200), 0.8 + 0.24 * coarse[i] + 0.06 * fine[i])

    return paint(n, n, shade)


def tile(n=256):
    """Glazed tiles, six by twelve: 0.9 m a side, 15 x 7.5 cm each, in running bond."""
    rnd = random.Random(51)
    tones = [[rnd.random() for _ in range(6)] for _ in range(12)]
    cloud = fbm(n, n, 12, 24, 2, 52)

    def shade(x, y, i):
        row = int(y * 12 / n)
        u = x * 6 / n + (0.5 if row & 1 else 0)
        col = int(u)
        dx, dy = (u - col) * n / 6, (y * 12 / n - row) * n / 12
        edge = min(dx, n / 6 - dx, dy, n / 12 - dy)
        c = mix((190, 214, 204), (222, 234, 222), tones[row][col % 6])
        c = mul(c, 0.94 + 0.12 * cloud[i])
        if edge < 0.9:
            return (140, 138, 130)
        return mul(c, 0.92 if edge < 2.2 else 1.0)

    return paint(n, n, shade)


def leather(n=256):
    """Creased hide, 0.4 m a side; tinted by the material."""
    a = fbm(n, n, 24, 24, 2, 61)
    b = fbm(n, n, 7, 7, 3, 62)

    def shade(x, y, i):
        crease = abs(a[i] - 0.5) * 2
        return mul((214, 206, 200), 0.72 + 0.3 * min(1, crease * 2.4) + 0.16 * (b[i] - 0.5))

    return paint(n, n, shade)


def asphalt(n=128):
    a = fbm(n, n, 32, 32, 3, 71)

    def shade(x, y, i):
        return mul((96, 98, 104), 0.7 + 0.6 * a[i])

    return paint(n, n, shade)


# --- cutouts -----------------------------------------------------------------------------------


def leaf(w=128, h=256):
    """A slit leaf as of a philodendron, tip at the top; alpha cuts it out."""
    mottle = fbm(w, h, 8, 16, 3, 81)

    def shade(x, y, i):
        s, t = (x + 0.5) / w * 2 - 1, 1 - (y + 0.5) / h
        half = 0.96 * math.sin(math.pi * min(1, t * 1.02) ** 0.72) ** 0.8 if 0 < t < 0.98 else 0.0
        a = abs(s)
        inside = half - a
        # slits run from the edge inwards and up
        slit = (t * 6.2 - a * 1.5 + (0.4 if s > 0 else 0)) % 1.0
        if a > 0.34 * half + 0.06 and abs(slit - 0.5) < 0.13 * (a / max(half, 0.01)) and t < 0.86:
            inside = min(inside, 0.0) - 0.02
        if a < 0.035 and t < 0.12:
            inside = 0.1  # the stalk
        vein = a < 0.03 or abs((t * 12.4 - a * 3.0) % 1.0 - 0.5) < 0.06
        c = mix((44, 104, 44), (92, 150, 62), mottle[i] * 0.9 + 0.2 * t)
        if vein:
            c = mix(c, (150, 186, 104), 0.5)
        return c + ((254,) if inside > 0 else (0,))

    return paint(w, h, shade, 4)


def slat(w=512, h=32):
    """One blind slat: rounded ends and the holes for the cords, as alpha."""

    def shade(x, y, i):
        u, v = (x + 0.5) / w, (y + 0.5) / h - 0.5
        gone = False
        if min(u, 1 - u) < 0.012:
            d = (0.012 - min(u, 1 - u)) / 0.012
            gone = d * d + (v / 0.5) ** 2 > 1
        for hole in (0.12, 0.5, 0.88):
            if (abs(u - hole) / 0.006) ** 2 + (v / 0.2) ** 2 < 1:
                gone = True
        t = 0.93 + 0.07 * math.cos(v * 5)
        return mul((228, 222, 206), t) + ((0,) if gone else (254,))

    return paint(w, h, shade, 4)


# --- lettering and pictures --------------------------------------------------------------------

GLYPHS = {  # strokes in a cell 0.6 wide and 1 high
    "A": [[(0, 0), (0.3, 1), (0.6, 0)], [(0.12, 0.36), (0.48, 0.36)]],
    "B": [
        [(0, 0), (0, 1), (0.42, 1), (0.5, 0.76), (0.42, 0.54), (0, 0.54)],
        [(0.42, 0.54), (0.58, 0.28), (0.44, 0), (0, 0)],
    ],
    "D": [[(0, 0), (0, 1), (0.36, 1), (0.58, 0.7), (0.58, 0.3), (0.36, 0), (0, 0)]],
    "E": [[(0.55, 1), (0, 1), (0, 0), (0.55, 0)], [(0, 0.52), (0.45, 0.52)]],
    "G": [
        [
            (0.56, 0.82),
            (0.4, 1),
            (0.16, 1),
            (0, 0.75),
            (0, 0.25),
            (0.16, 0),
            (0.44, 0),
            (0.58, 0.2),
            (0.58, 0.45),
            (0.34, 0.45),
        ]
    ],
    "I": [[(0.3, 0), (0.3, 1)]],
    "L": [[(0, 1), (0, 0), (0.52, 0)]],
    "M": [[(0, 0), (0, 1), (0.3, 0.45), (0.6, 1), (0.6, 0)]],
    "N": [[(0, 0), (0, 1), (0.58, 0), (0.58, 1)]],
    "O": [[(0.3, 1), (0.06, 0.78), (0.06, 0.22), (0.3, 0), (0.54, 0.22), (0.54, 0.78), (0.3, 1)]],
    "T": [[(0, 1), (0.6, 1)], [(0.3, 1), (0.3, 0)]],
    "U": [[(0, 1), (0, 0.24), (0.16, 0), (0.42, 0), (0.58, 0.24), (0.58, 1)]],
    "X": [[(0, 0), (0.58, 1)], [(0, 1), (0.58, 0)]],
    "Y": [[(0, 1), (0.3, 0.5), (0.6, 1)], [(0.3, 0.5), (0.3, 0)]],
    " ": [],
}


def text_segments(text, x, y, size, pitch=0.82):
    """Line segments of a text; (x, y) is its lower left corner, y grows upwards."""
    out = []
    for k, letter in enumerate(text):
        for stroke in GLYPHS[letter]:
            pts = [(x + (k * pitch + p[0]) * size, y + p[1] * size) for p in stroke]
            out += list(zip(pts, pts[1:]))
    return out


def near(segments, x, y):
    """Distance to the nearest segment."""
    best = 1e9
    for (ax, ay), (bx, by) in segments:
        dx, dy = bx - ax, by - ay
        t = clamp01(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy))
        best = min(best, math.hypot(x - ax - t * dx, y - ay - t * dy))
    return best


def exit_sign(w=128, h=64):
    word = text_segments("EXIT", 0.21, 0.25, 0.5)

    def shade(x, y, i):
        d = near(word, (x + 0.5) / h, 1 - (y + 0.5) / h)
        return mix((236, 254, 240), (24, 190, 90), clamp01((d - 0.045) * 40))

    return paint(w, h, shade)


def test_card(w=256, h=144):
    """Colour bars, a grey staircase, a grid of fine lines, a circle and the name."""
    bars = [
        (200, 200, 200),
        (200, 196, 30),
        (30, 190, 200),
        (40, 180, 50),
        (190, 50, 190),
        (200, 44, 40),
        (44, 60, 200),
    ]
    word = text_segments("LUXEL", -0.345, -0.08, 0.165, 0.9)

    def shade(x, y, i):
        u, v = (x + 0.5) / w, (y + 0.5) / h
        px, py = (u - 0.5) * w / h, 0.5 - v
        r = math.hypot(px, py)
        if r < 0.42:
            if abs(py) < 0.15:
                return mix((240, 240, 240), (16, 20, 40), clamp01((near(word, px, py) - 0.016) * 120))
            c = (
                bars[min(6, int((px + 0.42) / 0.12))]
                if py > 0
                else mul((236, 236, 236), int((px + 0.42) / 0.12) / 6)
            )
            return c
        if r < 0.435:
            return (240, 240, 240)
        if min(px * 8 % 1, py * 8 % 1) < 0.07:
            return (190, 200, 210)
        return (40, 60, 92)

    return paint(w, h, shade)


def jukebox(n=256):
    """Left quarter: the colours of the arches from end to end.  Right: the dial, arched."""
    ramp = [
        (254, 70, 40),
        (254, 150, 30),
        (250, 214, 60),
        (90, 220, 120),
        (60, 150, 254),
        (170, 80, 250),
        (254, 60, 150),
    ]

    def along(t):
        t = clamp01(t) * (len(ramp) - 1)
        k = min(len(ramp) - 2, int(t))
        return mix(ramp[k], ramp[k + 1], t - k)

    def shade(x, y, i):
        u, v = (x + 0.5) / n, (y + 0.5) / n
        if u < 0.25:
            return along(1 - abs(2 * v - 1))
        u = (u - 0.25) / 0.75
        if v < 0.44:  # sun rays over the record
            d, e = u - 0.5, 0.44 - v
            r = math.hypot(d, e * 0.85)
            if r < 0.12:
                return (254, 236, 170)
            if r < 0.15:
                return (150, 40, 30)
            a = math.atan2(e, d) / math.pi * 15
            return mix((250, 150, 40), (240, 70, 60), 0.0 if a % 1 < 0.5 else 1.0)
        if v < 0.72:  # title cards
            cu, cv = (u * 4) % 1, ((v - 0.44) / 0.28 * 5) % 1
            if min(cu, 1 - cu) < 0.07 or min(cv, 1 - cv) < 0.14:
                return (120, 24, 30)
            line = 0.36 < cv < 0.46 or 0.6 < cv < 0.7
            return (90, 60, 50) if line and 0.16 < cu < 0.84 else (250, 236, 200)
        k = int((v - 0.72) / 0.28 * 4)  # buttons
        cu, cv = (u * 10) % 1 - 0.5, ((v - 0.72) / 0.28 * 4) % 1 - 0.5
        if cu * cu + cv * cv < 0.1:
            return ramp[(int(u * 10) + 2 * k) % 7]
        return (60, 20, 22)

    return paint(n, n, shade)


def lava(w=128, h=128):
    """Blobs in a glass, tileable in u."""
    blobs = [
        (0.2, 0.14, 0.16),
        (0.62, 0.2, 0.13),
        (0.42, 0.42, 0.12),
        (0.85, 0.5, 0.1),
        (0.14, 0.66, 0.11),
        (0.55, 0.72, 0.13),
        (0.9, 0.84, 0.09),
        (0.36, 0.92, 0.1),
    ]

    def shade(x, y, i):
        u, v = (x + 0.5) / w, 1 - (y + 0.5) / h
        f = 0.0
        for bx, by, br in blobs:
            d = (u - bx + 0.5) % 1 - 0.5
            f += (br * br) / (d * d + (v - by) ** 2 + 1e-6)
        f = clamp01((f - 1.0) * 2.2)
        return mul(mix((190, 30, 90), (254, 150, 30), f), 1 - 0.3 * v)

    return paint(w, h, shade)


def facade(w=256, h=128):
    """The house across the street: some windows are lit."""
    rnd = random.Random(91)
    lit = [[rnd.random() for _ in range(12)] for _ in range(3)]

    def shade(x, y, i):
        u, v = x * 12 / w, y * 3 / h
        k, j = int(u), int(v)
        du, dv = u - k - 0.5, v - j - 0.55
        if abs(du) > 0.25 or abs(dv) > 0.3:
            return (0, 0, 0)
        if abs(du) < 0.02 or abs(dv + 0.06) < 0.02:
            return (0, 0, 0)
        s = lit[j][k]
        if s < 0.55:
            return (3, 4, 8)
        c = (254, 190, 104) if s < 0.84 else (150, 190, 250) if s < 0.9 else (254, 130, 60)
        return mul(c, 0.9 - 0.5 * (dv + 0.3))

    return paint(w, h, shade)


def chalkboard(w=192, h=256):
    words = text_segments("MENU", 0.13, 1.05, 0.16, 0.88)
    rnd = random.Random(101)
    for k in range(6):
        y, x = 0.88 - k * 0.14, 0.1
        end = 0.42 + rnd.random() * 0.1
        last = (x, y)
        while x < end:  # handwriting that nobody has to read
            x += 0.014 + 0.012 * rnd.random()
            p = (x, y + (rnd.random() - 0.4) * 0.05)
            if rnd.random() > 0.12:
                words.append((last, p))
            last = p
        words += text_segments("IX" if k % 2 else "XI", 0.58, y - 0.02, 0.06, 0.7)
    dust = fbm(w, h, 3, 4, 3, 102)

    def shade(x, y, i):
        d = near(words, x / w * 0.75, 1.27 - y / h * 1.3) if 8 < x < w - 8 else 1.0
        base = mul((44, 54, 52), 0.8 + 0.5 * dust[i])
        return mix((224, 220, 206), base, clamp01((d - 0.006) * 200))

    return paint(w, h, shade)


def artwork(kind, w=128, h=160):
    grain = fbm(w, h, 20, 24, 2, 111 + kind)

    def shade(x, y, i):
        u, v = (x + 0.5) / w, (y + 0.5) / h
        g = 0.9 + 0.2 * grain[i]
        if min(u, 1 - u) < 0.09 or min(v, 1 - v) < 0.075:
            return mul((226, 218, 200), g)
        if kind == 0:  # sun over hills
            c = mix((238, 150, 92), (246, 214, 150), v)
            if math.hypot(u - 0.6, (v - 0.36) * 1.25) < 0.16:
                c = (214, 62, 44)
            if v > 0.56 + 0.07 * math.sin(u * 7):
                c = (66, 100, 112)
            if v > 0.7 + 0.06 * math.sin(u * 5 + 2):
                c = (34, 62, 78)
        elif kind == 1:  # rings and bars
            r = math.hypot(u - 0.46, (v - 0.42) * 1.25)
            c = (222, 206, 172)
            if r < 0.3:
                c = ((28, 72, 110), (222, 206, 172), (206, 70, 44), (236, 182, 70))[int(r / 0.3 * 4)]
            if abs(u - v * 0.6 - 0.1) < 0.03:
                c = (30, 30, 34)
            if v > 0.8 and u > 0.5:
                c = (236, 182, 70)
        else:  # a jazz poster: stripes and a disc
            c = ((18, 52, 76), (30, 92, 104), (222, 120, 52), (236, 190, 92))[int(u * 9 + v * 2) % 4]
            r = math.hypot(u - 0.5, (v - 0.5) * 1.25)
            if r < 0.27:
                c = (24, 22, 26) if int(r * 70) % 3 else (54, 50, 56)
            if r < 0.09:
                c = (206, 60, 48)
        return mul(c, g)

    return paint(w, h, shade)


def label(kind, w=128, h=64):
    inks = [(120, 30, 26), (24, 60, 48), (30, 40, 84)]
    name = text_segments(("AIM", "GIN", "ALE")[kind], 0.14, 0.31, 0.36, 0.74)

    def shade(x, y, i):
        v = 1 - (y + 0.5) / h
        u = (x % (w // 2) + 0.5) / h
        if v < 0.1 or v > 0.9:
            return inks[kind]
        return mix(inks[kind], (234, 222, 192), clamp01((near(name, u, v) - 0.04) * 30))

    return paint(w, h, shade)
