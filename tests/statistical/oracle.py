"""Closed forms of irradiance, written down from the literature and from nothing in src/.

Unless said otherwise a result is a form factor in disguise: the irradiance, divided by pi, at a small surface from an emitter of
radiance 1 (so: multiply by pi L). Vectors are tuples.

[Lambert1760] the polygon formula; Baum, Rushmeier and Winget 1989, eq. 5, is a modern place to read it
[Howell] J. R. Howell, A Catalog of Radiation Heat Transfer Configuration Factors: B-3, B-4 (rectangles), B-13 (disk)
[Snyder1996] J. M. Snyder, Area light sources for real-time graphics, Microsoft TR-96-11 (sphere cut by the horizon)
"""

import math

from gltf import v_add, v_cross, v_dot, v_len, v_mul, v_norm, v_sub


def tangents(n):
    n = v_norm(n)
    side = (1, 0, 0) if abs(n[0]) < 0.6 else (0, 1, 0)
    t = v_norm(v_cross(side, n))
    return t, v_cross(n, t)


def cut(polygon, point, normal):
    """The part of a convex polygon in front of the plane through the point."""
    out = []
    for a, b in zip(polygon, polygon[1:] + polygon[:1]):
        da, db = v_dot(v_sub(a, point), normal), v_dot(v_sub(b, point), normal)
        if da >= 0:
            out.append(a)
        if (da > 0 > db) or (da < 0 < db):
            out.append(v_add(a, v_mul(v_sub(b, a), da / (da - db))))
    return out


def polygon(corners, point, normal):
    """[Lambert1760], after cutting off what lies below the receiver's horizon. Either side of the polygon counts."""
    normal = v_norm(normal)
    above = [v_sub(c, point) for c in cut(list(corners), point, normal)]
    if len(above) < 3:
        return 0.0
    total = 0.0
    for a, b in zip(above, above[1:] + above[:1]):
        axis = v_cross(a, b)
        sine = v_len(axis)
        if sine > 0:
            total += math.atan2(sine, v_dot(a, b)) * v_dot(axis, normal) / sine
    return abs(total) / (2 * math.pi)


def faces(corners, point):
    """Does a flat polygon, counter-clockwise from its front, show its front to the point?"""
    return v_dot(v_cross(v_sub(corners[1], corners[0]), v_sub(corners[2], corners[0])), v_sub(point, corners[0])) > 0


def rectangle(centre, half_x, half_y):
    """Corners, counter-clockwise seen from half_x × half_y."""
    return [v_add(centre, v_add(v_mul(half_x, s), v_mul(half_y, t))) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def ellipse(centre, half_x, half_y, count=720):
    """As a polygon of the same area; its corners lie just outside."""
    swell = math.sqrt(math.pi / (count * math.sin(math.pi / count) * math.cos(math.pi / count)))
    points = []
    for k in range(count):
        a = 2 * math.pi * k / count
        points.append(v_add(centre, v_add(v_mul(half_x, swell * math.cos(a)), v_mul(half_y, swell * math.sin(a)))))
    return points


def parallel_rectangle(a, b, h):
    """[Howell] B-3: the rectangle's corner is straight above the receiver, edges a and b, height h."""
    x, y = a / h, b / h
    p, q = math.sqrt(1 + x * x), math.sqrt(1 + y * y)
    return (x / p * math.atan(y / p) + y / q * math.atan(x / q)) / (2 * math.pi)


def perpendicular_rectangle(width, height, distance):
    """[Howell] B-4: the rectangle stands at right angles to the receiver's plane, a lower corner at this distance in front of it."""
    x, y = distance / width, height / width
    r = math.sqrt(x * x + y * y)
    return (math.atan(1 / x) - x / r * math.atan(1 / r)) / (2 * math.pi)


def parallel_disk(radius, height, offset=0.0):
    """[Howell] B-13: planes parallel, the receiver this far off the axis."""
    if offset == 0:
        return radius * radius / (radius * radius + height * height)
    h, r = height / offset, radius / offset
    z = 1 + h * h + r * r
    return 0.5 * (1 - (1 + h * h - r * r) / math.sqrt(z * z - 4 * r * r))


def sphere(angle, half_angle):
    """[Snyder1996]: a sphere (or any cap of directions) of this half angle, its centre at this angle from the normal."""
    s2 = math.sin(half_angle) ** 2
    if angle <= math.pi / 2 - half_angle:
        return s2 * math.cos(angle)
    if angle >= math.pi / 2 + half_angle:
        return 0.0
    c, s = math.cos(angle), math.sin(angle)
    y = -c / s / math.tan(half_angle)
    root = math.sqrt(max(0.0, 1 - y * y))
    return (s2 * (c * math.acos(y) - s * root / math.tan(half_angle)) + math.atan(s * root * math.tan(half_angle))) / math.pi


def cap_by_quadrature(angle, half_angle, steps=4000):
    """The same number from rings around the normal: a ring at t holds an arc of the cap of length 2 acos(...)."""
    low, high = max(0.0, angle - half_angle), min(math.pi / 2, angle + half_angle)
    total = 0.0
    for k in range(steps):
        # Half a cosine in place of equal steps: the arc's length has infinite slope at both ends.
        w = math.pi * (k + 0.5) / steps
        t = low + (high - low) * (1 - math.cos(w)) / 2
        weight = (high - low) * math.sin(w) / 2 * math.pi / steps
        d = math.sin(t) * math.sin(angle)
        x = (math.cos(half_angle) - math.cos(t) * math.cos(angle)) / d if d > 0 else (-1.0 if t <= half_angle else 1.0)
        total += math.cos(t) * math.sin(t) * 2 * math.acos(min(1.0, max(-1.0, x))) * weight
    return total / math.pi


def spot(cosine, inner, outer):
    """KHR_lights_punctual, 'Inner and Outer Cone Angles'."""
    scale = 1 / max(0.001, math.cos(inner) - math.cos(outer))
    return min(1.0, max(0.0, (cosine - math.cos(outer)) * scale)) ** 2


def window(distance, reach):
    """KHR_lights_punctual, 'Range Property', without the square law."""
    return min(1.0, max(0.0, 1 - (distance / reach) ** 4))


def srgb(byte):
    x = byte / 255
    return x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4


# --- Sky pictures -----------------------------------------------------------------------------------------------------


class SkyPicture:
    """Rows of grey pixels; u = 1/2 + atan2(z, x) / 2 pi, row 0 at +Y, bilinear between pixel centres, turned about +Y."""

    def __init__(self, rows, rotation=0.0):
        self.rows, self.rotation = rows, math.radians(rotation)
        self.height, self.width = len(rows), len(rows[0])

    def value(self, u, v):
        x, y = u * self.width - 0.5, v * self.height - 0.5
        i, j = math.floor(x), math.floor(y)
        s, t = x - i, y - j

        def row(k):
            line = self.rows[min(self.height - 1, max(0, k))]
            return line[i % self.width] * (1 - s) + line[(i + 1) % self.width] * s
        return row(j) * (1 - t) + row(j + 1) * t

    def irradiance(self, normals, steps=4):
        """By the midpoint rule over cells of equal u and v, `steps`² to the pixel; cells that are black all over are skipped."""
        totals = [0.0] * len(normals)
        n, m = self.width * steps, self.height * steps
        c, s = math.cos(self.rotation), math.sin(self.rotation)
        shines = [[any(self.rows[min(self.height - 1, max(0, j + b))][(i + a) % self.width] for b in (-1, 0, 1) for a in (-1, 0, 1))
                   for i in range(self.width)] for j in range(self.height)]
        for j in range(m):
            if not any(shines[j // steps]):
                continue
            v = (j + 0.5) / m
            y, ring = math.cos(v * math.pi), math.sin(v * math.pi)
            area = 2 * math.pi / n * (math.cos(j / m * math.pi) - math.cos((j + 1) / m * math.pi))
            for i in range(n):
                if not shines[j // steps][i // steps]:
                    continue
                u = (i + 0.5) / n
                light = self.value(u, v)
                around = (u - 0.5) * 2 * math.pi
                x, z = ring * math.cos(around), ring * math.sin(around)
                d = (c * x + s * z, y, c * z - s * x)  # a turn about +Y takes +Z towards +X
                for k, normal in enumerate(normals):
                    cosine = v_dot(d, normal)
                    if cosine > 0:
                        totals[k] += light * cosine * area
        return totals


# --- Radiosity --------------------------------------------------------------------------------------------------------


class CubeRadiosity:
    """The unit cube 0..1, walls of `n` by `n` patches, constant per patch; exact form factors from patch centres to patches."""

    WALLS = tuple((axis, side) for axis in range(3) for side in (0, 1))

    def __init__(self, n, albedo, emission):
        """albedo and emission (radiance): one number a wall, in the order of WALLS."""
        self.n = n
        self.patches = [(w, i, j) for w in range(6) for j in range(n) for i in range(n)]
        known = {}  # by relative place: regular grids repeat themselves
        count = len(self.patches)
        rows = []
        for w, i, j in self.patches:
            row = []
            for v, k, l in self.patches:
                key = self._relative(w, i, j, v, k, l)
                if key not in known:
                    known[key] = 0.0 if w == v else polygon(self._corners(v, k, l), *self._centre(w, i, j))
                row.append(known[key])
            rows.append(row)
        per_wall = n * n
        self.radiosity = [math.pi * emission[p // per_wall] for p in range(count)]
        while True:  # Gauss and Seidel
            change = 0.0
            for p in range(count):
                w = p // per_wall
                new = math.pi * emission[w] + albedo[w] * sum(map(float.__mul__, rows[p], self.radiosity))
                change = max(change, abs(new - self.radiosity[p]))
                self.radiosity[p] = new
            if change < 1e-6:
                break

    def _relative(self, w, i, j, v, k, l):
        a, b = self.WALLS[w], self.WALLS[v]
        if a[0] == b[0]:
            return (w == v, abs(i - k), abs(j - l))
        # The axis that both walls contain counts by difference, the others by distance from the common edge.
        p, q = self._cell(w, i, j), self._cell(v, k, l)
        common = 3 - a[0] - b[0]
        m = self.n - 1
        from_edge = p[b[0]] if b[1] == 0 else m - p[b[0]]
        up = q[a[0]] if a[1] == 0 else m - q[a[0]]
        return (abs(p[common] - q[common]), from_edge, up, "edge")

    def _cell(self, w, i, j):
        out = [i, j]
        out.insert(self.WALLS[w][0], 0)
        return out

    def _place(self, w, s, t):
        axis, side = self.WALLS[w]
        out = [s, t]
        out.insert(axis, float(side))
        return tuple(out)

    def _normal(self, w):
        axis, side = self.WALLS[w]
        return tuple((1.0 - 2 * side) if k == axis else 0.0 for k in range(3))

    def _centre(self, w, i, j):
        return self._place(w, (i + 0.5) / self.n, (j + 0.5) / self.n), self._normal(w)

    def _corners(self, w, i, j):
        n = self.n
        return [self._place(w, s / n, t / n) for s, t in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))]

    def irradiance(self, point, normal):
        """At a point of a wall, which does not see its own wall."""
        return sum(self.radiosity[p] * polygon(self._corners(*patch), point, normal) for p, patch in enumerate(self.patches)
                   if self._normal(patch[0]) != tuple(normal))
