"""Small scenes for the command-line tests: a good one and many broken ones."""

import json
import struct
import zlib

import harness  # noqa: F401 (puts scenes/ on the path)
from gltf import Gltf, box, look, quad


def room():
    """A floor, a block, two lamps on separate layers, a neon pair, and a camera."""
    g = Gltf("luxel tests/cli")
    grey = g.add_material("grey", (0.6, 0.6, 0.6))
    red = g.add_material("red", (0.7, 0.1, 0.1))
    floor = quad(2, 2).rotate((1, 0, 0), -90)
    g.add_node("floor", mesh=g.add_mesh("floor", (floor, grey)))
    g.add_node("block", mesh=g.add_mesh("block", (box(0.5, 0.5, 0.5), red)), translation=(0.4, 0.3, 0.2))
    g.add_node("lamp", light=g.add_light("point", 10, (1, 0.8, 0.6), "lamp"), translation=(-0.5, 1.5, 0.3))
    g.add_node("neon left", light=g.add_light("point", 4, (0.1, 0.3, 1), "neon left"), translation=(0.5, 1, -0.5))
    g.add_node("neon right", light=g.add_light("point", 4, (1, 0.1, 0.3), "neon right"), translation=(0.8, 1, 0.8))
    eye = (1.5, 1.8, 2.4)
    g.add_node("view", camera=g.add_camera("view", 45), translation=eye, rotation=look(eye, (0, 0.2, 0)))
    return g


def living_room(monitor="4x2"):
    """The room with a screen that shows a picture of 4 x 2 pixels, a lamp that flickers, and one that glTF animates."""
    g = room()
    colors = [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255), (0, 0, 0), (255, 255, 0), (0, 255, 255), (255, 0, 255)]
    card = g.add_image("card", 4, 2, bytes(c for color in colors for c in color), wrap=False, nearest=True)
    screen = g.add_material("screen", (0, 0, 0), emissive=(1, 1, 1), emissive_texture=card, strength=10,
                            extras={"luxel_monitor": monitor} if monitor else None)
    g.add_node("tv", mesh=g.add_mesh("tv", (quad(0.8, 0.4, fit=True), screen)), translation=(0, 0.5, -0.8))
    named = {node["name"]: node for node in g.json["nodes"]}
    named["neon left"]["extras"] = {"luxel_animate": "flicker 0.1 low=0.5"}
    pointer = "/extensions/KHR_lights_punctual/lights/0/intensity"  # the lamp's
    g.add_animation("dusk", (pointer, (0.0, 2.0, 4.0), (10.0, 0.0, 10.0), "LINEAR"))
    return g


def lamp_shop():
    """The living room with so many lamps that layers are what a bake needs memory for: 40 of them, 8 those of a monitor."""
    g = living_room()
    for i in range(29):
        g.add_node("shop %d" % i, light=g.add_light("point", 1 + i % 3, (1, 0.5, 0.2), "shop %d" % i), translation=(0.06 * i - 0.9, 0.9, 0.9 - 0.06 * i))
    return g


def edited(change):
    """The room with its JSON changed by `change(json)`."""
    g = room()
    change(g.json)
    return g.to_bytes()


def split(glb):
    """JSON text and binary chunk of a GLB."""
    length = struct.unpack_from("<I", glb, 12)[0]
    return glb[20:20 + length], glb[20 + length + 8:]


def join(text, binary):
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def with_data(change):
    """The room with its buffer changed by `change(json, bytearray)`."""
    text, binary = split(room().to_bytes())
    binary = bytearray(binary)
    change(json.loads(text), binary)
    return join(text, bytes(binary))


def accessor_offset(document, index):
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    return view.get("byteOffset", 0) + accessor.get("byteOffset", 0)


def nan_position(document, binary):
    position = document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    struct.pack_into("<f", binary, accessor_offset(document, position) + 4, float("nan"))


def wild_index(document, binary):
    indices = document["meshes"][0]["primitives"][0]["indices"]
    kind = document["accessors"][indices]["componentType"]
    struct.pack_into({5121: "<B", 5123: "<H", 5125: "<I"}[kind], binary, accessor_offset(document, indices),
                     {5121: 200, 5123: 60000, 5125: 4000000000}[kind])


def png_bomb():
    """A PNG of a few hundred bytes that says it has 50 000 x 50 000 pixels."""
    def chunk(tag, data):
        return struct.pack(">I", len(data)) + tag + data + struct.pack(">I", zlib.crc32(tag + data))
    header = struct.pack(">IIBBBBB", 50000, 50000, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")


def with_texture(data):
    g = room()
    texture = g.add_png("picture", data)
    g.json["materials"][0].setdefault("pbrMetallicRoughness", {})["baseColorTexture"] = {"index": texture}
    return g.to_bytes()


def cyclic(j):
    nodes = j["nodes"]
    nodes[0]["children"] = [1]
    nodes[1]["children"] = [0]


def light(j, index):
    return j["extensions"]["KHR_lights_punctual"]["lights"][index]


def bad_spot(j):
    light(j, 0).update(type="spot", spot={"innerConeAngle": 0.9, "outerConeAngle": 0.5})


def require(name):
    def change(j):
        j.setdefault("extensionsUsed", []).append(name)
        j.setdefault("extensionsRequired", []).append(name)
    return change


def outside_buffer(uri):
    def change(j):
        j["buffers"].append({"byteLength": 16, "uri": uri})
        j["bufferViews"].append({"buffer": 1, "byteLength": 16})
    g = room()
    text, binary = split(g.to_bytes())
    document = json.loads(text)
    change(document)
    return join(json.dumps(document).encode(), binary)


def without_meshes(j):
    del j["meshes"]
    for node in j["nodes"]:
        node.pop("mesh", None)


def far_view(document):
    document["bufferViews"][0]["byteOffset"] = 1 << 30


def edited_text(change):
    text, binary = split(room().to_bytes())
    document = json.loads(text)
    change(document)
    return join(json.dumps(document).encode(), binary)


GOOD = room().to_bytes()

# Name of the case: (bytes of the file, what the message must hold besides the file's name).
BROKEN = {
    "empty_file": (b"", []),
    "text_file": (b"this is not a scene\n", []),
    "chunk_longer_than_file": (GOOD[:12] + struct.pack("<I", 0xFFFFFFF0) + GOOD[16:], []),
    "json_broken": (join(b'{"asset":{"version":"2.0"},,}', b"\0" * 4), []),
    "json_too_deep": (join(b'{"asset":{"version":"2.0"},"x":' + b"[" * 100000 + b"]" * 100000 + b"}", b"\0" * 4), []),
    "version_1": (edited(lambda j: j["asset"].update(version="1.0")), ["1.0"]),
    "spot_inner_above_outer": (edited(bad_spot), ["lamp"]),
    "position_nan": (with_data(nan_position), ["accessor"]),
    "index_out_of_range": (with_data(wild_index), ["accessor*index"]),
    "mesh_out_of_range": (edited(lambda j: j["nodes"][0].update(mesh=99)), ["99"]),
    "material_out_of_range": (edited(lambda j: j["meshes"][0]["primitives"][0].update(material=42)), ["42"]),
    "accessor_beyond_view": (edited(lambda j: j["accessors"][0].update(count=1000000)), ["accessor 0"]),
    "view_beyond_buffer": (edited_text(far_view), ["bufferView*0"]),
    "nodes_cyclic": (edited(cyclic), ["node"]),
    "buffer_uri_climbs_out": (outside_buffer("../secret.bin"), ["buffer 1"]),
    "buffer_uri_absolute": (outside_buffer("/etc/hostname"), ["buffer 1"]),
    "buffer_uri_escaped": (outside_buffer("%2e%2e/secret.bin"), ["buffer 1"]),
    "draco_required": (edited(require("KHR_draco_mesh_compression")), ["KHR_draco_mesh_compression"]),
    "unknown_required": (edited(require("ACME_teapot")), ["ACME_teapot"]),
    "no_mesh": (edited(without_meshes), []),
    "image_bomb": (with_texture(png_bomb()), ["image"]),
}
