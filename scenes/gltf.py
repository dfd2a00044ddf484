"""A small GLB writer and a box of mesh primitives, standard library only.

    g = Gltf()
    red = g.add_material("red", base_color=(0.8, 0.1, 0.1))
    cube = g.add_mesh("cube", (box(1, 1, 1), red))
    g.add_node("cube", mesh=cube, translation=(0, 0.5, 0))
    g.add_node("lamp", light=g.add_light("point", intensity=40), translation=(0, 2.5, 0))
    g.save("scene.glb")

Conventions: metres, +Y up, counter-clockwise faces seen from outside.  TEXCOORD_0 of the primitives
is metric (one unit = one metre, v grows downwards), so textures keep their size on everything;
`Mesh.scale_uv` changes it and `quad(..., fit=True)` spans 0..1 instead.  The same calls give the
same bytes (with one version of zlib).
"""

import json
import math
import struct
import zlib

# --- vectors and rotations ---------------------------------------------------------------------


def v_add(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def v_sub(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def v_mul(a, s):
    return (a[0] * s, a[1] * s, a[2] * s)


def v_dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def v_cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def v_len(a):
    return math.sqrt(v_dot(a, a))


def v_norm(a):
    n = v_len(a)
    return (a[0] / n, a[1] / n, a[2] / n) if n > 0 else (0.0, 0.0, 0.0)


def quat(axis, degrees):
    """Rotation about an axis, as a glTF quaternion (x, y, z, w)."""
    x, y, z = v_norm(axis)
    s = math.sin(math.radians(degrees) / 2)
    return (x * s, y * s, z * s, math.cos(math.radians(degrees) / 2))


def quat_mul(a, b):
    """First b, then a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def quat_rotate(q, v):
    u = q[:3]
    t = v_mul(v_cross(u, v), 2)
    return v_add(v_add(v, v_mul(t, q[3])), v_cross(u, t))


def quat_axes(x, y, z):
    """The rotation that takes the coordinate axes to the orthonormal frame x, y, z."""
    m00, m10, m20 = x
    m01, m11, m21 = y
    m02, m12, m22 = z
    t = m00 + m11 + m22
    if t > 0:
        s = math.sqrt(t + 1) * 2
        return ((m21 - m12) / s, (m02 - m20) / s, (m10 - m01) / s, s / 4)
    if m00 > m11 and m00 > m22:
        s = math.sqrt(1 + m00 - m11 - m22) * 2
        return (s / 4, (m01 + m10) / s, (m02 + m20) / s, (m21 - m12) / s)
    if m11 > m22:
        s = math.sqrt(1 + m11 - m00 - m22) * 2
        return ((m01 + m10) / s, s / 4, (m12 + m21) / s, (m02 - m20) / s)
    s = math.sqrt(1 + m22 - m00 - m11) * 2
    return ((m02 + m20) / s, (m12 + m21) / s, s / 4, (m10 - m01) / s)


def look(eye, target, up=(0, 1, 0)):
    """Rotation that turns -Z (cameras, spots, area lights) from eye towards target."""
    z = v_norm(v_sub(eye, target))
    if abs(v_dot(z, v_norm(up))) > 0.9999:
        up = (0, 0, -1) if abs(z[2]) < 0.9 else (1, 0, 0)
    x = v_norm(v_cross(up, z))
    return quat_axes(x, v_cross(z, x), z)


# --- meshes ------------------------------------------------------------------------------------


class Mesh:
    """Triangles in flat lists.  Methods that change it return self, so that calls chain."""

    def __init__(self, positions=(), normals=(), uvs=(), indices=(), uv1=None, colors=None):
        self.positions = list(positions)
        self.normals = list(normals)
        self.uvs = list(uvs)
        self.indices = list(indices)
        self.uv1 = None if uv1 is None else list(uv1)
        self.colors = None if colors is None else list(colors)

    def copy(self):
        return Mesh(self.positions, self.normals, self.uvs, self.indices, self.uv1, self.colors)

    def translate(self, x, y, z):
        self.positions = [(p[0] + x, p[1] + y, p[2] + z) for p in self.positions]
        return self

    def rotate(self, axis, degrees):
        return self.rotate_quat(quat(axis, degrees))

    def rotate_quat(self, q):
        self.positions = [quat_rotate(q, p) for p in self.positions]
        self.normals = [quat_rotate(q, n) for n in self.normals]
        return self

    def scale(self, x, y, z):
        """Scales positions; UVs stay.  A mirroring scale keeps the outside outside."""
        self.positions = [(p[0] * x, p[1] * y, p[2] * z) for p in self.positions]
        self.normals = [v_norm((n[0] / x, n[1] / y, n[2] / z)) for n in self.normals]
        if x * y * z < 0:
            self._reverse()
        return self

    def flip(self):
        """Turns the surface inside out."""
        self.normals = [v_mul(n, -1) for n in self.normals]
        return self._reverse()

    def _reverse(self):
        i = self.indices
        self.indices = [i[k + d] for k in range(0, len(i), 3) for d in (0, 2, 1)]
        return self

    def scale_uv(self, u, v=None):
        v = u if v is None else v
        self.uvs = [(t[0] * u, t[1] * v) for t in self.uvs]
        return self

    def shift_uv(self, u, v):
        self.uvs = [(t[0] + u, t[1] + v) for t in self.uvs]
        return self

    def swap_uv(self):
        """A quarter turn of the texture: for boards whose grain runs the other way."""
        self.uvs = [(t[1], t[0]) for t in self.uvs]
        return self

    def paint(self, color):
        """One vertex colour (COLOR_0, linear) everywhere."""
        self.colors = [tuple(color)] * len(self.positions)
        return self

    def append(self, other):
        base = len(self.positions)
        for name in ("uv1", "colors"):
            mine, theirs = getattr(self, name), getattr(other, name)
            if base and (mine is None) != (theirs is None):
                raise ValueError("append: only one of the two meshes has %s" % name)
            if theirs is not None:
                setattr(self, name, (mine or []) + theirs)
        self.positions += other.positions
        self.normals += other.normals
        self.uvs += other.uvs
        self.indices += [i + base for i in other.indices]
        return self

    def triangles(self):
        return len(self.indices) // 3


def merge(*meshes):
    out = Mesh()
    for m in meshes:
        out.append(m)
    return out


def quad(width, height, fit=False):
    """A rectangle in the XY plane around the origin, facing +Z, four vertices."""
    x, y = width / 2, height / 2
    u, v = (1, 1) if fit else (width, height)
    return Mesh(
        [(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)],
        [(0, 0, 1)] * 4,
        [(0, v), (u, v), (u, 0), (0, 0)],
        [0, 1, 2, 0, 2, 3],
    )


def grid(width, height, nx, ny, fit=False):
    """As quad, in nx by ny cells."""
    u, v = (1, 1) if fit else (width, height)
    m = Mesh()
    for j in range(ny + 1):
        for i in range(nx + 1):
            s, t = i / nx, j / ny
            m.positions.append(((s - 0.5) * width, (t - 0.5) * height, 0))
            m.normals.append((0, 0, 1))
            m.uvs.append((s * u, (1 - t) * v))
    for j in range(ny):
        for i in range(nx):
            a = j * (nx + 1) + i
            b = a + nx + 1
            m.indices += [a, a + 1, b + 1, a, b + 1, b]
    return m


_BOX_FACES = {  # name: normal, u direction, up direction
    "+x": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "-x": ((-1, 0, 0), (0, 0, 1), (0, 1, 0)),
    "+y": ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
    "-y": ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    "+z": ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    "-z": ((0, 0, -1), (-1, 0, 0), (0, 1, 0)),
}


def box(sx, sy, sz, center=(0, 0, 0), skip=""):
    """A box with four vertices a face.  `skip` leaves faces out, e.g. "-y +y".

    UVs come from positions (center included), so that textures run through from box to box.
    """
    half = (sx / 2, sy / 2, sz / 2)
    m = Mesh()
    for name, (n, u, up) in _BOX_FACES.items():
        if name in skip.split():
            continue
        base = len(m.positions)
        for su, sv in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            d = v_add(n, v_add(v_mul(u, su), v_mul(up, sv)))
            p = v_add(center, (d[0] * half[0], d[1] * half[1], d[2] * half[2]))
            m.positions.append(p)
            m.normals.append(n)
            m.uvs.append((v_dot(p, u), -v_dot(p, up)))
        m.indices += [base, base + 1, base + 2, base, base + 2, base + 3]
    return m


def box_between(lo, hi, skip=""):
    """The box with these two corners."""
    return box(
        hi[0] - lo[0],
        hi[1] - lo[1],
        hi[2] - lo[2],
        ((lo[0] + hi[0]) / 2, (lo[1] + hi[1]) / 2, (lo[2] + hi[2]) / 2),
        skip,
    )


def lathe(profile, segments=24, crease=35.0):
    """Turns a profile [(radius, y), ...] about the Y axis.

    Outside is on the right of the way the profile goes (so: outer wall upwards, inner wall
    downwards).  Corners sharper than `crease` degrees are split into hard edges.  A profile that
    begins and ends on the axis gives a closed solid.
    """
    prof = [profile[0]]
    for p in profile[1:]:
        if math.hypot(p[0] - prof[-1][0], p[1] - prof[-1][1]) > 1e-9:
            prof.append(p)
    seg_n, lengths = [], []
    for (r0, y0), (r1, y1) in zip(prof, prof[1:]):
        d = math.hypot(r1 - r0, y1 - y0)
        seg_n.append(((y1 - y0) / d, -(r1 - r0) / d))
        lengths.append(d)
    closed = prof[0] == prof[-1]
    cos_crease = math.cos(math.radians(crease))
    rows = []  # (radius, y, normal in the profile plane, arc length); two rows make a band
    arc = 0.0

    def corner(k, other):
        if 0 <= other < len(seg_n):
            a, b = seg_n[k], seg_n[other]
            if a[0] * b[0] + a[1] * b[1] > cos_crease:
                n = math.hypot(a[0] + b[0], a[1] + b[1])
                return ((a[0] + b[0]) / n, (a[1] + b[1]) / n)
        return seg_n[k]

    for k in range(len(seg_n)):
        before = k - 1 if k or not closed else len(seg_n) - 1
        after = k + 1 if k + 1 < len(seg_n) or not closed else 0
        n0, n1 = corner(k, before), corner(k, after)
        if not (rows and n0 == rows[-1][2]):
            rows.append((prof[k][0], prof[k][1], n0, arc, False))
        arc += lengths[k]
        rows.append((prof[k + 1][0], prof[k + 1][1], n1, arc, True))
    around = 2 * math.pi * max(p[0] for p in prof)
    m = Mesh()
    for r, y, n, s, _ in rows:
        for i in range(segments + 1):
            a = 2 * math.pi * (i % segments) / segments
            c, d = math.cos(a), math.sin(a)
            m.positions.append((r * c, y, -r * d))
            m.normals.append((n[0] * c, n[1], -n[0] * d))
            m.uvs.append((around * i / segments, arc - s))
    w = segments + 1
    for k in range(len(rows) - 1):
        if not rows[k + 1][4]:
            continue
        for i in range(segments):
            a, b = k * w + i, (k + 1) * w + i
            if rows[k][0] > 0:
                m.indices += [a, a + 1, b + 1]
            if rows[k + 1][0] > 0:
                m.indices += [a, b + 1, b]
    return m


def cylinder(radius, height, segments=24, top=None, caps=True):
    """Stands on y = 0 around the Y axis; `top` is the upper radius of a cone."""
    top = radius if top is None else top
    wall = [(radius, 0), (top, height)]
    return lathe([(0, 0)] + wall + [(0, height)] if caps else wall, segments)


def sphere(radius, segments=24, rings=12):
    prof = [
        (radius * math.sin(math.pi * k / rings), -radius * math.cos(math.pi * k / rings))
        for k in range(rings + 1)
    ]
    prof[0], prof[-1] = (0, -radius), (0, radius)
    return lathe(prof, segments, 180.0 if rings > 2 else 35.0)


def disk(radius, segments=24):
    """Faces +Y."""
    m = Mesh([(0, 0, 0)], [(0, 1, 0)], [(0, 0)])
    for i in range(segments):
        a = 2 * math.pi * i / segments
        p = (radius * math.cos(a), 0, -radius * math.sin(a))
        m.positions.append(p)
        m.normals.append((0, 1, 0))
        m.uvs.append((p[0], p[2]))
        m.indices += [0, 1 + i, 1 + (i + 1) % segments]
    return m


def tube(path, radius, segments=8, closed=False, caps=True):
    """A round tube along points, with parallel-transported rings; `radius` may be a list."""
    pts = [p for k, p in enumerate(path) if k == 0 or v_len(v_sub(p, path[k - 1])) > 1e-9]
    if closed and v_len(v_sub(pts[0], pts[-1])) < 1e-9:
        pts.pop()
    n = len(pts)
    radii = [radius] * n if isinstance(radius, (int, float)) else list(radius)
    tangents = []
    for k in range(n):
        a = pts[k - 1] if k or closed else pts[k]
        b = pts[(k + 1) % n] if k + 1 < n or closed else pts[k]
        # equal weight for both sides gives the mitre of a bend
        d = v_add(v_norm(v_sub(pts[k], a)), v_norm(v_sub(b, pts[k])))
        tangents.append(v_norm(d if v_len(d) > 1e-6 else v_sub(b, pts[k])))
    axis = min(((1, 0, 0), (0, 1, 0), (0, 0, 1)), key=lambda e: abs(v_dot(e, tangents[0])))
    side = v_norm(v_cross(tangents[0], axis))
    sides = []
    for k in range(n):
        side = v_norm(v_sub(side, v_mul(tangents[k], v_dot(side, tangents[k]))))
        sides.append(side)
    twist = 0.0
    if closed:  # close the angle that transport leaves between the last ring and the first
        last = v_norm(v_sub(sides[-1], v_mul(tangents[0], v_dot(sides[-1], tangents[0]))))
        twist = math.atan2(v_dot(v_cross(last, sides[0]), tangents[0]), v_dot(last, sides[0]))
    m = Mesh()
    arc = 0.0
    rings = n + 1 if closed else n
    for k in range(rings):
        if k:
            arc += v_len(v_sub(pts[k % n], pts[k - 1]))
        t, s, r = tangents[k % n], sides[k % n], radii[k % n]
        b = v_cross(t, s)
        spin = 0.0 if k == n else twist * k / n
        for i in range(segments + 1):
            a = 2 * math.pi * (i % segments) / segments + spin
            d = v_add(v_mul(s, math.cos(a)), v_mul(b, math.sin(a)))
            m.positions.append(v_add(pts[k % n], v_mul(d, r)))
            m.normals.append(d)
            m.uvs.append((2 * math.pi * max(radii) * i / segments, arc))
    w = segments + 1
    for k in range(rings - 1):
        for i in range(segments):
            a, b = k * w + i, (k + 1) * w + i
            m.indices += [a, a + 1, b + 1, a, b + 1, b]
    if caps and not closed:
        for k, sign in ((0, -1), (n - 1, 1)):
            base = len(m.positions)
            m.positions.append(pts[k])
            m.normals.append(v_mul(tangents[k], sign))
            m.uvs.append((0, 0))
            for i in range(segments):
                p = m.positions[k * w + i]
                d = v_sub(p, pts[k])
                m.positions.append(p)
                m.normals.append(v_mul(tangents[k], sign))
                m.uvs.append((v_dot(d, sides[k]), v_dot(d, v_cross(tangents[k], sides[k]))))
            for i in range(segments):
                a, b = base + 1 + i, base + 1 + (i + 1) % segments
                m.indices += [base, a, b] if sign > 0 else [base, b, a]
    return m


def _ears(poly):
    """Triangles of a simple counter-clockwise polygon, by clipping ears."""
    left = list(range(len(poly)))
    out = []

    def area(a, b, c):
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

    while len(left) > 3:
        for k in range(len(left)):
            i, j, l = left[k - 1], left[k], left[(k + 1) % len(left)]
            a, b, c = poly[i], poly[j], poly[l]
            if area(a, b, c) <= 1e-14:
                continue
            if any(
                area(a, b, poly[q]) >= 0 and area(b, c, poly[q]) >= 0 and area(c, a, poly[q]) >= 0
                for q in left
                if q not in (i, j, l) and poly[q] not in (a, b, c)
            ):
                continue
            out += [i, j, l]
            left.pop(k)
            break
        else:
            raise ValueError("extrude: the outline crosses itself or runs clockwise")
    return out + left


def extrude(outline, depth, crease=35.0, back=True):
    """A counter-clockwise outline in XY given thickness from z = 0 to z = depth."""
    n = len(outline)
    m = Mesh()
    tris = _ears(outline)
    for z, s in ((depth, 1), (0, -1)) if back else ((depth, 1),):
        base = len(m.positions)
        for x, y in outline:
            m.positions.append((x, y, z))
            m.normals.append((0, 0, s))
            m.uvs.append((s * x, -y))
        for k in range(0, len(tris), 3):
            a, b, c = (base + t for t in tris[k : k + 3])
            m.indices += [a, b, c] if s > 0 else [a, c, b]
    edge = []
    for k in range(n):
        a, b = outline[k], outline[(k + 1) % n]
        d = math.hypot(b[0] - a[0], b[1] - a[1])
        edge.append(((b[1] - a[1]) / d, -(b[0] - a[0]) / d))
    arc = 0.0
    cos_crease = math.cos(math.radians(crease))

    def corner(k, j):
        a, b = edge[k], edge[j]
        if a[0] * b[0] + a[1] * b[1] <= cos_crease:
            return (a[0], a[1], 0)
        return v_norm((a[0] + b[0], a[1] + b[1], 0))

    for k in range(n):
        a, b = outline[k], outline[(k + 1) % n]
        n0, n1 = corner(k, k - 1), corner(k, (k + 1) % n)
        d = math.hypot(b[0] - a[0], b[1] - a[1])
        base = len(m.positions)
        m.positions += [(a[0], a[1], depth), (a[0], a[1], 0), (b[0], b[1], 0), (b[0], b[1], depth)]
        m.normals += [n0, n0, n1, n1]
        m.uvs += [(0, arc), (depth, arc), (depth, arc + d), (0, arc + d)]
        m.indices += [base, base + 1, base + 2, base, base + 2, base + 3]
        arc += d
    return m


# --- images ------------------------------------------------------------------------------------


def png(width, height, pixels, channels=3):
    """Encodes 8-bit pixels (bytes, row 0 on top; 1, 3 or 4 channels) as PNG."""
    stride = width * channels
    if len(pixels) != stride * height:
        raise ValueError("png: %d bytes given, %d expected" % (len(pixels), stride * height))
    before = bytes(stride)
    raw = bytearray()
    for y in range(height):
        row = pixels[y * stride : (y + 1) * stride]
        shifted = bytes(channels) + bytes(row[:-channels])
        tries = [
            bytes(row),
            bytes((a - b) & 255 for a, b in zip(row, shifted)),
            bytes((a - b) & 255 for a, b in zip(row, before)),
        ]
        cost = [sum(c if c < 128 else 256 - c for c in t) for t in tries]
        best = cost.index(min(cost))
        raw.append(best)
        raw += tries[best]
        before = row

    def chunk(tag, data):
        return struct.pack(">I", len(data)) + tag + data + struct.pack(">I", zlib.crc32(tag + data))

    kind = {1: 0, 3: 2, 4: 6}[channels]
    head = struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", head)
        + chunk(b"IDAT", zlib.compress(bytes(raw), 9))
        + chunk(b"IEND", b"")
    )


# --- the file ----------------------------------------------------------------------------------


class Gltf:
    """Collects a scene; every add_ returns the index that other calls take.

    `json` is the document itself: edit it freely before `save` for what has no call here.
    """

    FLOAT, USHORT, UINT = 5126, 5123, 5125

    def __init__(self, generator="luxel scenes/gltf.py"):
        self.json = {
            "asset": {"version": "2.0", "generator": generator},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
        }
        self.data = bytearray()

    # buffers

    def _extension(self, name):
        used = self.json.setdefault("extensionsUsed", [])
        if name not in used:
            used.append(name)
            used.sort()

    def _push(self, table, item):
        rows = self.json.setdefault(table, [])
        rows.append(item)
        return len(rows) - 1

    def add_view(self, data, target=None):
        self.data += b"\0" * (-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)}
        if target:
            view["target"] = target
        self.data += data
        return self._push("bufferViews", view)

    def add_accessor(self, values, component=FLOAT, bounds=False, target=34962):
        """values: numbers, or tuples of equal length.  Floats are stored in single precision."""
        scalar = not isinstance(values[0], (tuple, list))
        flat = list(values) if scalar else [c for v in values for c in v]
        width = 1 if scalar else len(values[0])
        if len(flat) != width * len(values):
            raise ValueError("accessor: elements of different lengths")
        code = {self.FLOAT: "f", self.USHORT: "H", self.UINT: "I"}[component]
        if component == self.FLOAT:
            flat = [c + 0.0 if abs(c) > 1e-9 else 0.0 for c in flat]  # no -0, no 1e-17 noise
        data = struct.pack("<%d%s" % (len(flat), code), *flat)
        acc = {
            "bufferView": self.add_view(data, target),
            "componentType": component,
            "count": len(values),
            "type": ("", "SCALAR", "VEC2", "VEC3", "VEC4")[width],
        }
        if bounds:
            stored = struct.unpack("<%d%s" % (len(flat), code), data)
            acc["min"] = [min(stored[k::width]) for k in range(width)]
            acc["max"] = [max(stored[k::width]) for k in range(width)]
        return self._push("accessors", acc)

    # images, textures, materials

    def add_image(self, name, width, height, pixels, channels=3, wrap=True, nearest=False):
        """8-bit pixels -> embedded PNG; returns a texture index."""
        return self.add_png(name, png(width, height, bytes(pixels), channels), wrap, nearest)

    def add_png(self, name, data, wrap=True, nearest=False):
        image = self._push(
            "images", {"name": name, "mimeType": "image/png", "bufferView": self.add_view(data)}
        )
        mode = 10497 if wrap else 33071
        sampler = {
            "magFilter": 9728 if nearest else 9729,
            "minFilter": 9728 if nearest else 9987,
            "wrapS": mode,
            "wrapT": mode,
        }
        known = self.json.setdefault("samplers", [])
        if sampler not in known:
            known.append(sampler)
        return self._push("textures", {"name": name, "sampler": known.index(sampler), "source": image})

    def add_material(
        self,
        name,
        base_color=(1, 1, 1),
        texture=None,
        roughness=0.9,
        metallic=0.0,
        emissive=None,
        emissive_texture=None,
        strength=1.0,
        alpha=None,
        cutoff=None,
        double_sided=False,
        transmission=0.0,
        transmission_texture=None,
        ior=None,
        unlit=False,
        texcoord=0,
        emissive_texcoord=0,
        extras=None,
    ):
        """alpha: None (OPAQUE), "MASK" or "BLEND"; strength: nit, multiplies emissive x texture."""
        color = list(base_color) + ([1.0] if len(base_color) == 3 else [])
        pbr = {"baseColorFactor": color, "metallicFactor": metallic, "roughnessFactor": roughness}
        if texture is not None:
            pbr["baseColorTexture"] = self._info(texture, texcoord)
        mat = {"name": name, "pbrMetallicRoughness": pbr}
        ext = {}
        if emissive is not None or emissive_texture is not None:
            mat["emissiveFactor"] = list(emissive or (1, 1, 1))
            if emissive_texture is not None:
                mat["emissiveTexture"] = self._info(emissive_texture, emissive_texcoord)
            if strength != 1.0:
                ext["KHR_materials_emissive_strength"] = {"emissiveStrength": strength}
        if alpha:
            mat["alphaMode"] = alpha
        if cutoff is not None:
            mat["alphaCutoff"] = cutoff
        if double_sided:
            mat["doubleSided"] = True
        if transmission or transmission_texture is not None:
            ext["KHR_materials_transmission"] = {"transmissionFactor": transmission}
            if transmission_texture is not None:
                ext["KHR_materials_transmission"]["transmissionTexture"] = self._info(
                    transmission_texture, 0
                )
        if ior is not None:
            ext["KHR_materials_ior"] = {"ior": ior}
        if unlit:
            ext["KHR_materials_unlit"] = {}
        for key in ext:
            self._extension(key)
        if ext:
            mat["extensions"] = ext
        if extras:
            mat["extras"] = extras
        return self._push("materials", mat)

    @staticmethod
    def _info(texture, texcoord):
        info = {"index": texture}
        if texcoord:
            info["texCoord"] = texcoord
        return info

    # meshes

    def add_mesh(self, name, *parts, extras=None):
        """parts: (Mesh, material index or None) for each primitive."""
        prims = []
        for m, material in parts:
            attributes = {"POSITION": self.add_accessor(m.positions, bounds=True)}
            for key, values in (
                ("NORMAL", m.normals),
                ("TEXCOORD_0", m.uvs),
                ("TEXCOORD_1", m.uv1),
                ("COLOR_0", m.colors),
            ):
                if values:
                    if len(values) != len(m.positions):
                        raise ValueError(
                            "%s: %d %s for %d positions" % (name, len(values), key, len(m.positions))
                        )
                    attributes[key] = self.add_accessor(values)
            prim = {"attributes": attributes}
            if m.indices:
                wide = self.UINT if len(m.positions) > 65535 else self.USHORT
                prim["indices"] = self.add_accessor(m.indices, wide, target=34963)
            if material is not None:
                prim["material"] = material
            prims.append(prim)
        mesh = {"name": name, "primitives": prims}
        if extras:
            mesh["extras"] = extras
        return self._push("meshes", mesh)

    # lights, cameras, nodes

    def add_light(
        self, kind, intensity, color=(1, 1, 1), name=None, range=None, inner=0.0, outer=45.0, extras=None
    ):
        """kind: "point", "spot" (candela; half angles in degrees) or "directional" (lux)."""
        self._extension("KHR_lights_punctual")
        light = {"type": kind, "intensity": intensity, "color": list(color)}
        if name:
            light["name"] = name
        if range is not None:
            light["range"] = range
        if kind == "spot":
            light["spot"] = {
                "innerConeAngle": math.radians(inner),
                "outerConeAngle": math.radians(outer),
            }
        if extras:
            light["extras"] = extras
        ext = self.json.setdefault("extensions", {})
        lights = ext.setdefault("KHR_lights_punctual", {"lights": []})["lights"]
        lights.append(light)
        return len(lights) - 1

    def add_camera(self, name, yfov, near=0.05, far=200.0, aspect=None):
        """yfov in degrees."""
        lens = {"yfov": math.radians(yfov), "znear": near, "zfar": far}
        if aspect:
            lens["aspectRatio"] = aspect
        return self._push("cameras", {"name": name, "type": "perspective", "perspective": lens})

    def add_node(
        self,
        name,
        mesh=None,
        light=None,
        camera=None,
        translation=None,
        rotation=None,
        scale=None,
        extras=None,
        parent=None,
        instances=None,
    ):
        """instances: [(translation, rotation, scale), ...] for EXT_mesh_gpu_instancing."""
        node = {"name": name}
        for key, value in (("mesh", mesh), ("camera", camera)):
            if value is not None:
                node[key] = value
        if translation is not None:
            node["translation"] = [round(c, 6) for c in translation]
        if rotation is not None:
            n = math.sqrt(sum(c * c for c in rotation))
            node["rotation"] = [round(c / n, 9) for c in rotation]
        if scale is not None:
            node["scale"] = [scale] * 3 if isinstance(scale, (int, float)) else list(scale)
        ext = {}
        if light is not None:
            ext["KHR_lights_punctual"] = {"light": light}
        if instances:
            self._extension("EXT_mesh_gpu_instancing")
            rows = list(zip(*instances))
            ext["EXT_mesh_gpu_instancing"] = {
                "attributes": {
                    key: self.add_accessor([tuple(v) for v in rows[k]], target=None)
                    for k, key in enumerate(("TRANSLATION", "ROTATION", "SCALE"))
                }
            }
        if ext:
            node["extensions"] = ext
        if extras:
            node["extras"] = extras
        index = self._push("nodes", node)
        if parent is None:
            self.json["scenes"][0]["nodes"].append(index)
        else:
            self.json["nodes"][parent].setdefault("children", []).append(index)
        return index

    # animations

    def add_animation(self, name, *channels):
        """channels: (JSON pointer, times, values, "STEP", "LINEAR" or "CUBICSPLINE"); of the latter's values three belong to
        a key: in-tangent, value, out-tangent.  KHR_animation_pointer."""
        self._extension("KHR_animation_pointer")
        animation = {"name": name, "samplers": [], "channels": []}
        for pointer, times, values, interpolation in channels:
            sampler = {
                "input": self.add_accessor(times, bounds=True, target=None),
                "output": self.add_accessor(values, target=None),
                "interpolation": interpolation,
            }
            target = {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}}
            animation["channels"].append({"sampler": len(animation["samplers"]), "target": target})
            animation["samplers"].append(sampler)
        return self._push("animations", animation)

    # output

    def triangles(self):
        """Triangles of the scene with every instance counted."""
        j = self.json
        total = 0
        for node in j["nodes"]:
            if "mesh" not in node:
                continue
            count = 0
            for prim in j["meshes"][node["mesh"]]["primitives"]:
                acc = prim.get("indices", prim["attributes"]["POSITION"])
                count += j["accessors"][acc]["count"] // 3
            inst = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
            if inst:
                count *= j["accessors"][inst["attributes"]["TRANSLATION"]]["count"]
            total += count
        return total

    def to_bytes(self):
        doc = dict(self.json)
        data = bytes(self.data) + b"\0" * (-len(self.data) % 4)
        if data:
            doc["buffers"] = [{"byteLength": len(data)}]
        text = json.dumps(doc, separators=(",", ":"), ensure_ascii=False).encode()
        text += b" " * (-len(text) % 4)
        out = struct.pack("<II", len(text), 0x4E4F534A) + text
        if data:
            out += struct.pack("<II", len(data), 0x004E4942) + data
        return struct.pack("<4sII", b"glTF", 2, 12 + len(out)) + out

    def save(self, path):
        with open(path, "wb") as f:
            f.write(self.to_bytes())
