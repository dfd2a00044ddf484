"""Reads the EXR files that Luxel writes: one part, scanlines, half or float channels; uncompressed, ZIPS or ZIP."""

import struct
import zlib

LINES = {0: 1, 2: 1, 3: 16}  # scanlines a chunk, by compression


def _text(data, at):
    end = data.index(b"\0", at)
    return data[at:end].decode(), end + 1


def _unzip(data, size):
    if len(data) == size:  # did not shrink, so was left as it is
        return data
    packed = bytearray(zlib.decompress(data))
    for i in range(1, len(packed)):  # bytes are stored as differences ...
        packed[i] = (packed[i - 1] + packed[i] - 128) & 255
    half = (len(packed) + 1) // 2
    out = bytearray(len(packed))
    out[0::2], out[1::2] = packed[:half], packed[half:]  # ... even ones first, then odd ones
    return bytes(out)


def read(path):
    """(width, height, {channel name: list of values, row by row})."""
    with open(path, "rb") as file:
        data = file.read()
    magic, version = struct.unpack_from("<II", data)
    if magic != 20000630 or version != 2:
        raise ValueError("%s: no single-part scanline EXR" % path)
    at, attributes = 8, {}
    while data[at]:
        name, at = _text(data, at)
        kind, at = _text(data, at)
        size, = struct.unpack_from("<I", data, at)
        attributes[name] = data[at + 4:at + 4 + size]
        at += 4 + size
    at += 1
    channels, spot, table = [], 0, attributes["channels"]
    while table[spot]:
        name, spot = _text(table, spot)
        kind, = struct.unpack_from("<I", table, spot)
        channels.append((name, {1: ("e", 2), 2: ("f", 4)}[kind]))
        spot += 16
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    lines = LINES[attributes["compression"][0]]
    row_bytes = width * sum(size for _, (_, size) in channels)
    count = (height + lines - 1) // lines
    out = {name: [0.0] * (width * height) for name, _ in channels}
    for offset in struct.unpack_from("<%dQ" % count, data, at):
        first, size = struct.unpack_from("<iI", data, offset)
        first -= y0
        here = min(lines, height - first)
        raw = data[offset + 8:offset + 8 + size]
        if lines > 1 or attributes["compression"][0] == 2:
            raw = _unzip(raw, here * row_bytes)
        spot = 0
        for y in range(first, first + here):
            for name, (code, bytes_each) in channels:
                out[name][y * width:(y + 1) * width] = struct.unpack_from("<%d%s" % (width, code), raw, spot)
                spot += width * bytes_each
    return width, height, out
