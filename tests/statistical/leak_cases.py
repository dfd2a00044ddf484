"""Light where none may be: scenes of scenes/leaks.py, as a person sees them, from their lightmaps with bilinear filtering."""

import exr
import leaks as scenes
from harness import expect, luxel
from measure import Row, below, case, note

# Every way to bake must pass.
INTEGRATORS = (("--integrator", "path"), ("--integrator", "gather", "--denoise", "none"), ("--integrator", "gather", "--denoise", "builtin"))
SIZE = 160, 120


def name_of(options):
    return " ".join(o for o in options if not o.startswith("--"))


def radiance(name, camera, out, *options):
    """Of a grey surface in nit, per pixel, ascending."""
    luxel("render", out, "--camera", camera, "--size", "%dx%d" % SIZE, "--samples", "4", "--quiet", "-o", "%s.exr" % camera, *options, timeout=600)
    _, _, channels = exr.read("%s.exr" % camera)
    return channels["G"]


def bake_and_look(scene, page, cameras, integrator, *options, samples=32):
    scene.save("scene.glb")
    luxel("bake", "scene.glb", "-o", "out", "--page-size", str(page), "--samples", str(samples), "--no-preview", "--no-report", "--quiet",
          *integrator, *options, timeout=600)
    return [radiance("out", camera, "out", "--view", "lightmap") for camera in cameras]


def stays_dark(scene, page, dark, lit, limit, *options):
    for integrator in INTEGRATORS:
        *pictures, bright = bake_and_look(scene, page, (*dark, lit), integrator, *options)
        light = max(bright)
        expect(light > 1, "the lit side is dark")
        below("%s: brightest pixel, of the lit side's" % name_of(integrator), limit, [v / light for p in pictures for v in p], 32)


@case
def closed_room_of_boxes_stays_dark():
    stays_dark(scenes.dark_room_of_boxes(), 160, ("low", "high"), "outside", 1e-4, "--sky", "10,10,10", "--bounces", "4")


@case
def closed_room_of_sheets_stays_dark():
    stays_dark(scenes.dark_room_of_sheets(), 160, ("low", "high"), "outside", 1e-4, "--sky", "10,10,10", "--bounces", "4")


@case
def thin_wall_between_two_rooms_does_not_leak():
    # Texels are 16 cm wide, the wall is 2 cm thick.
    stays_dark(scenes.thin_wall(), 128, ("dark",), "lit", 1e-4, "--bounces", "4")


@case
def thin_wall_on_one_floor_leaks_no_farther_than_bilinear_filtering():
    # Texels belong to one room or the other; where the wall stands beside their middle, filtering blends the two over less than half a texel. The wall's foot and its
    # other edges are about a hundredth of the picture; what they throw back is a thousandth of the lit room's light.
    for integrator in INTEGRATORS:
        dark, lit = bake_and_look(scenes.thin_wall_on_one_floor(), 128, ("dark", "lit"), integrator, "--bounces", "4")
        light = sorted(lit)[len(lit) // 2]
        share = sum(v > 0.01 * light for v in dark) / len(dark)
        note(Row("%s: share of pixels above 1 %% of the lit room's" % name_of(integrator), 0.0, share, share, 0.015, len(dark), 32))
        below("%s: median, of the lit room's" % name_of(integrator), 1e-3, [sorted(dark)[len(dark) // 2] / light], 32)


@case
def charts_two_texels_apart_keep_their_light_to_themselves():
    dark, bright = bake_and_look(scenes.close_charts(), 64, ("below", "above"), INTEGRATORS[0], "--bounces", "0", samples=4)
    expect(max(bright) > 1, "the sunny strips are dark")
    below("brightest pixel of the dark ones, of the sunny ones'", 1e-6, [max(dark) / max(bright)], 4)


@case
def boxes_that_overlap_and_touch_look_as_when_they_are_path_traced():
    # Under a white sky, so that no shadow has an edge that texels of 6 cm could not hold.
    scene = scenes.intersecting_boxes(sun=False)
    scene.save("scene.glb")
    pictures = {}
    sky = ("--sky", "10,10,10", "--bounces", "4")
    for camera in ("front",):
        pictures[camera] = radiance("scene", camera, "scene.glb", *sky, "--samples", "256")
    for integrator in INTEGRATORS:
        bake_and_look(scene, 192, (), integrator, *sky, samples=256)
        for camera, truth in pictures.items():
            got = radiance("out", camera, "out", "--sky", "10,10,10")
            mean = sum(truth) / len(truth)
            wrong = sum(abs(g - t) > 0.05 * mean for g, t in zip(got, truth)) / len(truth)
            # One or two pixels in a thousand lie where two boxes meet and a texel is too coarse for what happens there.
            note(Row("%s, %s: share of pixels off by a twentieth of the mean" % (name_of(integrator), camera), 0.0, wrong, wrong, 0.006, len(truth), 256))


@case
def mouldings_of_a_column_take_no_sun_from_where_it_shines():
    # Stones that reach into each other, with edges finer than a texel. Along the edges of shadows texels are brighter than the truth on one side.
    scenes.column().save("scene.glb")
    for camera in ("base", "capital"):
        truth = radiance("scene", camera, "scene.glb", "--bounces", "0")
        lit = sorted(truth)[len(truth) * 9 // 10]
        for integrator in INTEGRATORS[:2]:
            bake_and_look(scenes.column(), 192, (), integrator, "--bounces", "0")
            got = radiance("out", camera, "out")
            wrong = sum(g - t > 0.3 * lit for g, t in zip(got, truth)) / len(truth)
            note(Row("%s, %s: share of pixels too bright by a third of what is in the sun" % (name_of(integrator), camera), 0.0, wrong, wrong, 0.02,
                     len(truth), 32))
