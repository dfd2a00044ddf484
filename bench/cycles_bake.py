"""Runs inside Blender: bakes irradiance of a scene.glb that Luxel wrote with Cycles, on the same texels.

    blender -b --factory-startup -P bench/cycles_bake.py -- SETTINGS.json

SETTINGS: scene, page, bounces, threads, sky (3 numbers or null), bakes: [{out, samples, seed, only}]; `only`: number of the one light that shines (null: all), in
the order in which `lights` are printed. Prints one line `CYCLES {...}` with the seconds of each bake (the operator alone, import not counted).
What is Lambert's in Luxel is Lambert's here: every material becomes a diffuse one with its base colour, emission leaves the front side alone; luxel_area and luxel_radius are
followed. Blender's soft edge of spots is another function than glTF's. Values are E / pi, as Cycles' diffuse pass without colour has them."""

import json
import math
import struct
import sys
import time

import bpy
import numpy
from mathutils import Matrix

if not hasattr(numpy, "bool"):
    numpy.bool = bool  # Blender 3.4's importer asks for a name that numpy 1.24 gave up
SETTINGS = json.load(open(sys.argv[sys.argv.index("--") + 1]))


def document(path):
    with open(path, "rb") as file:
        length, = struct.unpack("<12xI4x", file.read(20))
        return json.loads(file.read(length))


def plain(material, strength):
    """Diffuse, with emission from the front; returns the emission's strength socket or None."""
    tree = material.node_tree
    principled = next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED")
    output = next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL")
    new, link = tree.nodes.new, tree.links.new

    def carry(source, target):
        if source.is_linked:
            link(source.links[0].from_socket, target)
        else:
            target.default_value = source.default_value
    diffuse = new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Roughness"].default_value = 0
    carry(principled.inputs["Base Color"], diffuse.inputs["Color"])
    shader, socket = diffuse.outputs[0], None
    if strength > 0:
        emission, front, add = new("ShaderNodeEmission"), new("ShaderNodeMath"), new("ShaderNodeAddShader")
        carry(principled.inputs["Emission"], emission.inputs["Color"])
        front.operation = "MULTIPLY_ADD"  # strength - backfacing * strength
        link(new("ShaderNodeNewGeometry").outputs["Backfacing"], front.inputs[0])
        front.inputs[1].default_value, front.inputs[2].default_value = -strength, strength
        link(front.outputs[0], emission.inputs["Strength"])
        link(diffuse.outputs[0], add.inputs[0])
        link(emission.outputs[0], add.inputs[1])
        shader, socket = add.outputs[0], front
    link(shader, output.inputs["Surface"])
    return socket


def main():
    gltf = document(SETTINGS["scene"])
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    bpy.ops.import_scene.gltf(filepath=SETTINGS["scene"])
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode, scene.render.threads = "FIXED", SETTINGS["threads"]
    cycles = scene.cycles
    cycles.device, cycles.use_adaptive_sampling, cycles.use_denoising = "CPU", False, False
    cycles.max_bounces = cycles.diffuse_bounces = SETTINGS["bounces"]
    cycles.glossy_bounces = cycles.transmission_bounces = cycles.volume_bounces = 0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    scene.view_settings.view_transform = "Raw"
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    scene.world = world
    background = world.node_tree.nodes["Background"]
    background.inputs[0].default_value = (*(SETTINGS["sky"] or (0, 0, 0)), 1)

    # Lights, each as (name, function that switches it).
    lights = []
    definitions = gltf.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    nodes = {n["name"]: n for n in gltf["nodes"] if "name" in n}

    def switch(target, name, strength):
        lights.append((name, lambda on: setattr(target, "energy", strength if on else 0)))
    for name, node in nodes.items():
        thing, extras = bpy.data.objects.get(name), node.get("extras", {})
        reference = node.get("extensions", {}).get("KHR_lights_punctual")
        if reference is not None and "luxel_area" not in extras:
            light = definitions[reference["light"]]
            if thing.type != "LIGHT":  # the importer puts a light with a turn of its own below its node
                thing = next(c for c in thing.children if c.type == "LIGHT")
            data = thing.data = thing.data.copy()
            data.color = light.get("color", (1, 1, 1))
            if light["type"] == "directional":
                data.angle = math.radians(extras.get("luxel_radius", 0))
                switch(data, name, light.get("intensity", 1))
            else:
                data.shadow_soft_size = extras.get("luxel_radius", 0)
                switch(data, name, light.get("intensity", 1) * 4 * math.pi)
        elif "luxel_area" in extras:
            kind, *size = extras["luxel_area"].split()
            width, height = float(size[0]), float(size[-1])
            data = bpy.data.lights.new(name, "AREA")
            data.shape = "RECTANGLE" if kind == "rect" else "DISK"
            data.size, data.size_y = (width, height) if kind == "rect" else (2 * width, 2 * width)
            area = width * height if kind == "rect" else math.pi * width ** 2
            data.color = extras.get("luxel_color", (1, 1, 1))
            lamp = bpy.data.objects.new(name + " area", data)
            scene.collection.objects.link(lamp)
            bpy.context.view_layer.update()
            lamp.matrix_world = thing.matrix_world @ Matrix.Rotation(math.radians(90), 4, "X")  # glTF's -Z is Blender's +Y
            switch(data, name, extras.get("luxel_intensity", 1) * area * math.pi)

    # Materials, one per object where they shine; lightmap coordinates from each mesh's square into its rectangle of the page.
    strengths = {}
    for m in gltf.get("materials", []):
        strength = m.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1)
        strengths[m["name"]] = strength if max(m.get("emissiveFactor", [0])) > 0 else 0
    image = bpy.data.images.new("bake", SETTINGS["page"], SETTINGS["page"], alpha=True, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    meshes = []
    converted = {}
    for name, node in nodes.items():
        thing = bpy.data.objects.get(name)
        rectangle = node.get("extras", {}).get("luxel_lightmap")
        if thing is None or thing.type != "MESH" or rectangle is None:
            continue
        meshes.append(thing)
        thing.data = thing.data.copy()
        layer = thing.data.uv_layers[rectangle["texCoord"]]
        layer.name = "lightmap"
        uv = numpy.empty(2 * len(layer.data), numpy.float32)
        layer.data.foreach_get("uv", uv)
        uv = uv.reshape(-1, 2)
        uv[:, 0] = uv[:, 0] * rectangle["scale"][0] + rectangle["offset"][0]
        uv[:, 1] = 1 - ((1 - uv[:, 1]) * rectangle["scale"][1] + rectangle["offset"][1])
        layer.data.foreach_set("uv", uv.ravel())
        for slot in thing.material_slots:
            strength = strengths.get(slot.material.name.split(".")[0], 0)
            if strength > 0 or slot.material.name not in converted:
                material = slot.material.copy()
                if strength == 0:
                    converted[slot.material.name] = material
                socket = plain(material, strength)
                target = material.node_tree.nodes.new("ShaderNodeTexImage")
                target.image = image
                material.node_tree.nodes.active = target
                if socket:
                    def set_strength(on, socket=socket, strength=strength):
                        socket.inputs[1].default_value, socket.inputs[2].default_value = (-strength, strength) if on else (0, 0)
                    lights.append((name, set_strength))
            else:
                material = converted[slot.material.name]
            slot.material = material
    bpy.ops.object.select_all(action="DESELECT")
    for thing in meshes:
        thing.select_set(True)
    bpy.context.view_layer.objects.active = meshes[0]
    bpy.ops.object.join()  # object by object every bake would begin anew
    joined = bpy.context.view_layer.objects.active
    joined.data.uv_layers.active = joined.data.uv_layers["lightmap"]

    told = []
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth, settings.exr_codec = "OPEN_EXR", "RGBA", "32", "ZIP"
    for bake in SETTINGS["bakes"]:
        for k, (_, turn) in enumerate(lights):
            turn(bake["only"] is None or bake["only"] == k)
        background.inputs[1].default_value = 1 if SETTINGS["sky"] and bake["only"] is None else 0
        cycles.samples, cycles.seed = bake["samples"], bake["seed"]
        start = time.time()
        bpy.ops.object.bake(type="DIFFUSE", pass_filter={"DIRECT", "INDIRECT"}, margin=0, use_clear=True, uv_layer="lightmap")
        told.append(time.time() - start)
        image.save_render(bake["out"], scene=scene)
    print("CYCLES " + json.dumps({"seconds": told, "lights": [name for name, _ in lights], "version": bpy.app.version_string}))


main()
