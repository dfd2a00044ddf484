#!/usr/bin/env python3
"""The command line, case by case.

    cases.py --list              names of the cases
    cases.py LUXEL [CASE...]     runs them with this program

A case is a function below. It runs in an empty folder; luxel() runs the program and checks its exit code, refused()
also that it failed with one good line.
"""

import json
import os
import pty
import select
import signal
import struct
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from harness import case, CASES, Failed, expect, luxel, main, read, refused, sanitized, start, tree, write
import scenes
import web_cases  # registers its own
from gltf import png

FAST = ("--page-size", "64", "--samples", "4", "--quiet")
COMMANDS = ("bake", "render", "view", "inspect", "compose", "irradiance", "compare", "export-web")


def bake(out="room.baked", *options, scene="room.glb"):
    if not os.path.exists(scene):
        write(scene, scenes.GOOD)
    luxel("bake", scene, "-o", out, *FAST, *(options or ("--no-preview",)))
    return out


# --- Help and version ---------------------------------------------------------------------------------------------------


@case
def version_is_one_line():
    luxel("--version", out="luxel [0-9]*.[0-9]*.[0-9]*\n", err="")


@case
def help_lists_all_commands():
    text = luxel("--help", err="").out
    for command in COMMANDS:
        expect("\n  %s " % command in text, "no %s in: %s" % (command, text))


@case
def help_of_every_command_fits_80_columns():
    for command in COMMANDS:
        text = luxel(command, "--help", out="Usage: luxel %s *Examples:\n  luxel %s *" % (command, command), err="").out
        expect(luxel("help", command).out == text, "luxel help %s differs from --help" % command)
        for line in text.splitlines():
            expect(len(line) <= 80, "%s --help: %d columns: %s" % (command, len(line), line))


@case
def no_command_prints_help_and_fails():
    luxel(code=2, out="*Usage: luxel COMMAND*")


@case
def full_disk_behind_stdout_is_noticed():
    with open("/dev/full", "w") as full:
        process = start("--help", stdout=full)
        expect(process.wait() == 3, "exit code %d" % process.returncode)


# --- Mistakes on the command line ---------------------------------------------------------------------------------------

MISTAKES = {
    "command_unknown_names_nearest": ("bkae", ["did you mean 'bake'"]),
    "option_unknown_names_nearest": ("bake room.glb -o out --page-sise 64", ["--page-sise", "did you mean '--page-size'"]),
    "option_unknown_far": ("bake room.glb -o out --zzzzzz", ["--zzzzzz", "--help"]),
    "option_without_value": ("bake room.glb -o out --samples", ["--samples", "N"]),
    "flag_with_value": ("bake room.glb -o out --json=yes", ["--json", "no value"]),
    "number_not_a_number": ("bake room.glb -o out --samples many", ["--samples", "many"]),
    "number_negative": ("bake room.glb -o out --samples -4", ["--samples", "-4"]),
    "number_too_small": ("bake room.glb -o out --page-size 8", ["--page-size", "8*below 16"]),
    "number_too_large": ("bake room.glb -o out --page-size=99999", ["--page-size", "4096"]),
    "page_size_no_multiple_of_4": ("bake room.glb -o out --page-size 66", ["multiple of 4"]),
    "choice_unknown": ("bake room.glb -o out --quality best", ["best", "draft|medium|high"]),
    "format_unknown": ("bake room.glb -o out --format ktx2,gif", ["gif", "ktx2,exr,hdr"]),
    "output_missing": ("bake room.glb", ["-o"]),
    "scene_missing": ("bake -o out", ["usage"]),
    "scene_twice": ("bake room.glb other.glb -o out", ["other.glb"]),
    "direct_and_indirect": ("bake room.glb -o out --direct-only --indirect-only", ["--direct-only", "--indirect-only"]),
    "indirect_without_bounces": ("bake room.glb -o out --indirect-only --bounces 0", ["no light"]),
    "integrator_unknown": ("bake room.glb -o out --integrator magic", ["magic", "gather|path"]),
    "denoiser_unknown": ("bake room.glb -o out --denoise magic", ["magic", "none|builtin|oidn"]),
    "noise_for_paths": ("bake room.glb -o out --integrator path --noise 0", ["--noise", "--integrator gather"]),
    "interpolation_for_paths": ("bake room.glb -o out --integrator path --interpolation 0.1", ["--interpolation", "--integrator gather"]),
    "interpolation_negative": ("bake room.glb -o out --interpolation -1", ["--interpolation", "below 0"]),
    "time_for_paths": ("bake room.glb -o out --integrator path --time 5m", ["--time", "--integrator gather"]),
    "memory_for_paths": ("bake room.glb -o out --integrator path --memory 2G", ["--memory", "--integrator gather"]),
    "denoise_for_paths": ("bake room.glb -o out --integrator path --denoise none", ["--denoise", "--integrator gather"]),
    "noise_too_large": ("bake room.glb -o out --noise 2", ["--noise", "2 is above 1"]),
    "noise_negative": ("bake room.glb -o out --noise -0.1", ["--noise", "below 0"]),
    "time_in_days": ("bake room.glb -o out --time 2d", ["--time", "'2d' is no duration"]),
    "time_in_wrong_order": ("bake room.glb -o out --time 5m1h", ["--time", "'5m1h' is no duration"]),
    "time_without_last_unit": ("bake room.glb -o out --time 1h30", ["--time", "'1h30' is no duration"]),
    "time_none": ("bake room.glb -o out --time 0s", ["--time", "'0s' is no duration"]),
    "time_infinite": ("bake room.glb -o out --time inf", ["--time", "'inf' is no duration"]),
    "memory_in_words": ("bake room.glb -o out --memory much", ["--memory", "'much' is no size"]),
    "memory_unit_unknown": ("bake room.glb -o out --memory 2Gb", ["--memory", "'2Gb' is no size"]),
    "memory_none": ("bake room.glb -o out --memory 0", ["--memory", "'0' is no size"]),
    "memory_beyond_all_machines": ("bake room.glb -o out --memory 99999999T", ["--memory", "too large"]),
    "bounces_too_many": ("bake room.glb -o out --bounces 4294967294", ["--bounces", "above 1000000"]),
    "isa_unknown": ("bake room.glb -o out --isa mmx", ["mmx", "avx2"]),
    "sky_neither_colour_nor_file": ("bake room.glb -o out --sky blue", ["blue", "#rrggbb"]),
    "sky_negative": ("bake room.glb -o out --sky 1,-1,0", ["1,-1,0"]),
    "picture_ending_unknown": ("render room.glb -o a.gif", ["a.gif", ".png"]),
    "picture_size_wrong": ("render room.glb -o a.png --size 12", ["12", "WIDTHxHEIGHT"]),
    "exposure_wrong": ("render room.glb -o a.png --exposure bright", ["bright", "auto"]),
    "set_without_baked_folder": ("render room.glb -o a.png --set lamp=off", ["--set", "room.glb"]),
    "irradiance_without_points": ("irradiance room.glb", ["--points"]),
    "compare_one_picture": ("compare a.png", ["usage"]),
    "help_unknown_command": ("help bkae", ["bake"]),
}


def mistake(line, says):
    def run():
        write("room.glb", scenes.GOOD)
        refused(*line.split(), code=2, says=says)
        expect(os.listdir(".") == ["room.glb"], "left behind: %s" % os.listdir("."))
    return run


for name, (line, says) in MISTAKES.items():
    CASES["usage_" + name] = mistake(line, says)


@case
def options_take_equals_and_double_dash():
    write("room.glb", scenes.GOOD)
    luxel("bake", "--output=out.baked", "--page-size=64", "--samples=1", "--no-preview", "--quiet", "--", "room.glb")
    expect(os.path.isfile("out.baked/luxel.json"), "no out.baked/luxel.json")


# --- Inputs that are wrong ----------------------------------------------------------------------------------------------


def broken(data, says):
    def run():
        os.mkdir("in")
        write("secret.bin", bytes(16))
        write("in/bad.glb", data)
        os.mkdir("out.baked")
        write("out.baked/luxel.json", "{}")
        write("out.baked/mine.txt", "keep me")
        before = tree(".")
        for out in ("fresh.baked", "out.baked"):
            refused("bake", "in/bad.glb", "-o", out, *FAST, code=1, says=["luxel: in/bad.glb: ", *says])
        refused("inspect", "in/bad.glb", code=1, says=["luxel: in/bad.glb: ", *says])
        expect(tree(".") == before, "files changed: %s" % sorted(tree(".")))
        expect(sorted(os.listdir(".")) == ["in", "out.baked", "secret.bin"], "left behind: %s" % os.listdir("."))
    return run


for name, (data, says) in scenes.BROKEN.items():
    CASES["input_" + name] = broken(data, says)


@case
def input_missing_file():
    refused("bake", "nowhere.glb", "-o", "out", code=1, says=["nowhere.glb: *No such file"])
    expect(os.listdir(".") == [], "left behind: %s" % os.listdir("."))


@case
def input_folder_instead_of_file():
    os.mkdir("folder.glb")
    refused("inspect", "folder.glb", code=1, says=["folder.glb: "])


@case
def input_truncated_anywhere():
    good = scenes.GOOD
    for part in range(1, 24):
        write("cut.glb", good[:len(good) * part // 24])
        refused("bake", "cut.glb", "-o", "out", "--quiet", code=1, says=["luxel: cut.glb: "])
    expect(os.listdir(".") == ["cut.glb"], "left behind: %s" % os.listdir("."))


@case
def input_negative_light_is_a_warning():
    def darken(j):
        scenes.light(j, 0).update(intensity=-3)
    write("room.glb", scenes.edited(darken))
    luxel("bake", "room.glb", "-o", "out", *FAST, "--no-preview", err="luxel: warning: *'lamp'*negative*")


@case
def input_sky_missing():
    write("room.glb", scenes.GOOD)
    refused("bake", "room.glb", "-o", "out", "--sky", "night.hdr", code=1, says=["night.hdr: *No such file"])


@case
def input_sky_broken():
    write("room.glb", scenes.GOOD)
    write("sky.exr", b"not a picture")
    refused("bake", "room.glb", "-o", "out", *FAST, "--sky", "sky.exr", code=1, says=["sky.exr"])
    expect(sorted(os.listdir(".")) == ["room.glb", "sky.exr"], "left behind: %s" % os.listdir("."))


@case
def input_points_wrong_names_the_line():
    write("room.glb", scenes.GOOD)
    write("p.csv", "x,y,z,nx,ny,nz\n0,0,0,0,1,0\n1,2,three,0,1,0\n")
    refused("irradiance", "room.glb", "--points", "p.csv", code=1, says=["p.csv: line 3: "])
    write("p.csv", "0,0,0,0,0,0\n")
    refused("irradiance", "room.glb", "--points", "p.csv", code=1, says=["p.csv: line 1: *normal"])
    write("p.csv", "x,y,z,nx,ny,nz\n")
    refused("irradiance", "room.glb", "--points", "p.csv", code=1, says=["p.csv: *no points"])


# --- The output folder --------------------------------------------------------------------------------------------------


@case
def output_folder_of_others_is_never_replaced():
    os.mkdir("photos")
    write("photos/holiday.jpg", "irreplaceable")
    before = tree(".")
    # Refused before anything is read: the scene does not even exist.
    message = luxel("bake", "nowhere.glb", "-o", "photos", code=2, out="").err
    expect("photos" in message and "nowhere.glb" not in message, message)
    expect(tree(".") == before, "files changed")


@case
def output_below_missing_folder_is_refused_early():
    result = luxel("bake", "nowhere.glb", "-o", "a/b/c", code=2, out="")
    expect("a/b" in result.err and "nowhere.glb" not in result.err, result.err)
    expect(os.listdir(".") == [], "left behind: %s" % os.listdir("."))


@case
def output_picture_below_missing_folder_is_refused_early():
    write("room.glb", scenes.GOOD)
    refused("render", "room.glb", "-o", "a/b.png", code=2, says=["a/b.png", "folder a"])


@case
def output_is_replaced_by_a_second_bake():
    bake("room.baked", "--no-preview", "--format", "exr")
    write("room.baked/old.txt", "from before")
    bake("room.baked", "--no-preview")
    names = os.listdir("room.baked")
    expect("old.txt" not in names and not any(n.endswith(".exr") for n in names), "still there: %s" % names)
    expect(sorted(os.listdir(".")) == ["room.baked", "room.glb"], "left behind: %s" % os.listdir("."))


# --- The happy path -----------------------------------------------------------------------------------------------------


def image_size(path):
    return struct.unpack_from(">II", read(path), 16)


def mean(path):
    """Mean of a picture, by the comparison with itself."""
    return json.loads(luxel("compare", path, path, "--json").out)["mean_a"]


@case
def bake_prints_a_summary():
    write("room.glb", scenes.GOOD)
    luxel("bake", "room.glb", "-o", "room.baked", "--page-size", "64", "--samples", "4", "--bounces", "8",
          out="room.baked\n*1 page of 64 x 64, *%*covered*texels/m\n*3 layers from 3 sources, 4 samples, 8 bounces\n"
              "*quality*\n*rays/s\n*MiB of memory at most*\n*luxel.pack*\n*preview.png*")
    for name in ("scene.glb", "luxel.json", "luxel.pack", "preview.png"):
        expect(os.path.getsize("room.baked/" + name) > 0, "no " + name)
    expect(read("room.baked/preview.png")[:4] == b"\x89PNG", "preview.png is no PNG")


@case
def bake_json_summary():
    write("room.glb", scenes.GOOD)
    result = luxel("bake", "room.glb", "-o", "room.baked", *FAST, "--no-preview", "--bounces", "inf", "--json")
    summary = json.loads(result.out)
    expect(summary["pages"] == 1 and summary["page_size"] == 64, result.out)
    expect(summary["layers"] == 3 and summary["samples"] == 4 and summary["bounces"] == "inf", result.out)
    expect(0 < summary["coverage"] <= 1 and summary["rays"] > 0 and summary["preview"] is None, result.out)
    expect(summary["pack_bytes"] == os.path.getsize("room.baked/luxel.pack"), result.out)


@case
def bake_says_how_it_was_baked():
    write("room.glb", scenes.GOOD)
    for options, integrator, denoise in (((), "gather", "builtin"), (("--denoise", "none"), "gather", "none"), (None, "path", "none")):
        limits = ("--time", "1h30m", "--memory", "1.5GiB", "--noise", "0.5") if options is not None else ()
        result = luxel("bake", "room.glb", "-o", "room.baked", *FAST, "--no-preview", "--json", "--integrator", integrator, *(options or ()), *limits)
        summary, manifest = json.loads(result.out), json.loads(read("room.baked/luxel.json"))["bake"]
        expect(summary["integrator"] == manifest["integrator"] == integrator, result.out)
        expect(summary["denoise"] == manifest["denoise"] == denoise, result.out)
        expect(summary["bounces"] == (8 if integrator == "path" else "inf"), result.out)
        expect(summary["groups"] == 1, result.out)
        expect((summary["noise"] is None) == (integrator == "path") == ("noise" not in manifest), result.out)
        page = read("room.baked/report.html").decode()
        expect(("noise, estimated" in page) == (integrator == "gather") and "<td>%s</td>" % integrator in page, "the report does not say it")


@case
def bake_stays_below_the_memory_it_is_given():
    write("shop.glb", scenes.lamp_shop().to_bytes())
    options = ("--page-size", "224", "--samples", "1", "--quiet", "--json", "--integrator", "gather")
    free = json.loads(luxel("bake", "shop.glb", "-o", "free.baked", *options).out)
    expect(free["groups"] == 1 and free["layers"] == 40, "%s groups, %s layers" % (free["groups"], free["layers"]))
    # What a bake needs besides its layers is about the same with and without a limit: three quarters of the layers must go.
    spare = free["texels"] * 30 * (32 + 18)
    limit = free["predicted_memory_bytes"] - spare
    kept = json.loads(luxel("bake", "shop.glb", "-o", "kept.baked", *options, "--memory", str(limit)).out)
    expect(3 <= kept["groups"] <= 8, "%d groups" % kept["groups"])
    for name in ("luxel.pack", "scene.glb", "preview.png"):
        expect(read("free.baked/" + name) == read("kept.baked/" + name), name + " differs")
    expect(abs(kept["noise"] - free["noise"]) < 0.01 * free["noise"], "noise is %g, %g without groups" % (kept["noise"], free["noise"]))
    left = [name for name in os.listdir(".") if name not in ("shop.glb", "free.baked", "kept.baked")]
    expect(not left, "left behind: %s" % left)
    if not sanitized():  # they have memory of their own
        expect(kept["peak_memory_bytes"] <= limit, "%d bytes at most, not %d" % (limit, kept["peak_memory_bytes"]))
        for summary in (free, kept):
            ratio = summary["predicted_memory_bytes"] / summary["peak_memory_bytes"]
            expect(0.95 < ratio < 1.25, "predicted %.2f of the peak" % ratio)


@case
def bake_tells_the_memory_it_needs_at_least():
    write("room.glb", scenes.GOOD)
    refused("bake", "room.glb", "-o", "room.baked", *FAST, "--integrator", "gather", "--memory", "1M", code=1, says=["1 MiB of memory are not enough", "need* MiB"])
    expect(os.listdir(".") == ["room.glb"], "left behind: %s" % os.listdir("."))


@case
def bake_all_formats():
    bake("room.baked", "--no-preview", "--format", "ktx2,exr,hdr")
    manifest = json.loads(read("room.baked/luxel.json"))
    formats = {entry["format"] for entry in manifest["files"]}
    expect(formats == {"ktx2", "exr", "hdr"}, "formats are %s" % formats)
    for entry in manifest["files"]:
        expect(os.path.getsize("room.baked/" + entry["file"]) > 0, "no " + entry["file"])


@case
def bake_combined_has_one_layer():
    bake("room.baked", "--no-preview", "--layers", "combined")
    expect(len(json.loads(read("room.baked/luxel.json"))["layers"]) == 1, "more than one layer")


@case
def bake_monitor_has_a_layer_per_cell():
    write("room.glb", scenes.living_room().to_bytes())
    luxel("bake", "room.glb", "-o", "room.baked", *FAST, "--no-preview", err="")
    manifest = json.loads(read("room.baked/luxel.json"))
    names = [layer["name"] for layer in manifest["layers"]]
    expect(names == ["lamp", "neon left", "neon right"] + ["tv/%d" % k for k in range(8)], "layers are %s" % names)
    monitor, = manifest["monitors"]
    expect((monitor["name"], monitor["columns"], monitor["rows"], monitor["firstLayer"]) == ("tv", 4, 2, 3), str(monitor))
    expect(monitor["strength"] == [10, 10, 10] and monitor["node"] == 6 and monitor["material"] == 2, str(monitor))
    expect(manifest["layers"][5]["color"] == [0, 0, 1] and manifest["layers"][8]["color"] == [1, 1, 0], str(manifest["layers"]))
    text = luxel("inspect", "room.baked").out
    for word in ("monitors (1)", "animations (2)", "flicker", "dusk"):
        expect(word in text, "no '%s' in: %s" % (word, text))
    document = json.loads(luxel("inspect", "room.glb", "--json").out)
    expect([s["monitor"] for s in document["sources"]] == [None, None, None, "4x2"], str(document["sources"]))
    expect([s["animate"] for s in document["sources"]] == [None, "flicker", None, None], str(document["sources"]))
    expect(document["animations"][0]["property"] == "intensity", str(document["animations"]))


@case
def bake_animations_are_listed_with_their_layers():
    write("room.glb", scenes.living_room().to_bytes())
    luxel("bake", "room.glb", "-o", "room.baked", *FAST, "--no-preview")
    animations = json.loads(read("room.baked/luxel.json"))["animations"]
    expect(animations == [{"name": "", "layer": 1, "program": "flicker", "channel": "light", "duration": animations[0]["duration"]},
                          {"name": "dusk", "layer": 0, "program": "keys", "channel": "intensity", "duration": 4}], str(animations))
    told = luxel("bake", "room.glb", "-o", "combined", "--page-size", "64", "--samples", "4", "--no-preview", "--layers", "combined").err
    expect(told.count("what animates 'lamp' and 1 more is not baked") == 1, "nothing told of what is left out: %s" % told)
    manifest = json.loads(read("combined/luxel.json"))
    expect(manifest["animations"] == [] and manifest["monitors"] == [], "a combined bake has drivers")


@case
def bake_monitors_of_other_grids_cannot_share_a_layer():
    g = scenes.living_room("2x2")
    mesh = [node for node in g.json["nodes"] if node["name"] == "tv"][0]["mesh"]
    g.add_node("a", mesh=mesh, translation=(0, 0.5, 0.8), extras={"luxel_layer": "both"})
    g.add_node("b", mesh=mesh, translation=(0, 1.5, 0.8), extras={"luxel_layer": "both", "luxel_monitor": "3x2"})
    write("room.glb", g.to_bytes())
    refused("bake", "room.glb", "-o", "out", *FAST, code=1, says=["'a' (2x2)", "'b' (3x2)", "luxel_layer"])
    expect(not os.path.exists("out"), "something was written")


@case
def bake_sky_is_a_layer():
    bake("room.baked", "--no-preview", "--sky", "#ff8040", "--sky-intensity", "50")
    layers = json.loads(read("room.baked/luxel.json"))["layers"]
    expect([layer["name"] for layer in layers].count("sky") == 1, "layers are %s" % layers)


@case
def bake_same_bytes_whatever_memory_held_before():
    write("room.glb", scenes.GOOD)
    for bounces in ("1", "3", "inf"):
        packs = []
        for fill in ("0", "85", "170"):  # glibc fills fresh blocks with it
            os.environ["MALLOC_PERTURB_"] = fill
            luxel("bake", "room.glb", "-o", "room.baked", "--page-size", "64", "--samples", "16", "--quiet", "--no-preview", "--bounces", bounces)
            packs.append(read("room.baked/luxel.pack"))
        expect(packs[0] == packs[1] == packs[2], "%s bounces: other bytes with other memory" % bounces)
    del os.environ["MALLOC_PERTURB_"]


@case
def bake_same_bytes_for_any_number_of_threads():
    for threads in ("1", "2", "3"):
        bake("t" + threads, "--no-preview", "--format", "ktx2,exr", "--threads", threads)

    def content(folder):
        files = tree(folder)
        manifest = json.loads(read(folder + "/luxel.json"))
        del files["luxel.json"], files["report.html"]  # which hold times
        del manifest["bake"]["seconds"], manifest["bake"]["stages"], manifest["bake"]["threads"]
        return files, manifest

    for threads in ("2", "3"):
        expect(content("t" + threads) == content("t1"), "%s threads give other bytes than one" % threads)


@case
def bake_other_seed_gives_other_bytes():
    write("room.glb", scenes.GOOD)
    bake("a", "--no-preview", "--seed", "1")
    bake("b", "--no-preview", "--seed", "2")
    expect(read("a/luxel.pack") != read("b/luxel.pack"), "the seed has no effect")


@case
def bake_existing_file_still_bakes_after_moving():
    bake()
    os.rename("room.baked", "elsewhere")
    luxel("compose", "elsewhere", "-o", "page.hdr")


@case
def inspect_scene_and_folder():
    bake()
    text = luxel("inspect", "room.glb").out
    for word in ("lamp", "neon left", "view"):
        expect(word in text, "no '%s' in: %s" % (word, text))
    text = luxel("inspect", "room.baked").out
    for word in ("lamp", "neon left", "coverage"):
        expect(word in text, "no '%s' in: %s" % (word, text))
    for what in ("room.glb", "room.baked"):
        document = json.loads(luxel("inspect", what, "--json").out)
        named = document["sources" if what == "room.glb" else "layers"]
        expect([item["name"] for item in named] == ["lamp", "neon left", "neon right"], "%s: %s" % (what, named))
        expect(document["warnings"] == [], "%s: %s" % (what, document["warnings"]))


@case
def inspect_shows_warnings():
    g = scenes.room()
    g.json["nodes"][0]["extras"] = {"luxel_densty": 2}
    write("room.glb", g.to_bytes())
    document = json.loads(luxel("inspect", "room.glb", "--json", err="").out)
    warnings = [w for w in document["warnings"] if "luxel_densty" in w and "luxel_density" in w and "floor" in w]
    expect(len(warnings) == 1, "warnings are %s" % document["warnings"])


@case
def warnings_are_printed_and_counted():
    g = scenes.room()
    g.json["nodes"][0]["extras"] = {"luxel_densty": 2}
    write("room.glb", g.to_bytes())
    luxel("bake", "room.glb", "-o", "out", *FAST, "--no-preview", out="*warnings  1,*",
          err="luxel: warning: *luxel_densty*")


@case
def compose_sums_layers():
    bake()
    luxel("compose", "room.baked", "-o", "all.exr", out="all.exr*64 x 64*")
    sums = 0
    for layer in ("lamp", "neon left", "neon right"):
        # "LAYER=white" would lose the authored colour: switch the others off instead.
        others = [name for name in ("lamp", "neon left", "neon right") if name != layer]
        luxel("compose", "room.baked", "-o", "one.exr", "--set", others[0] + "=off", "--set", others[1] + "=off")
        sums += mean("one.exr")
    expect(abs(sums / mean("all.exr") - 1) < 1e-5, "%g is not %g" % (sums, mean("all.exr")))
    luxel("compose", "room.baked", "-o", "none.exr", "--set", "*=off")
    expect(mean("none.exr") == 0, "light with all layers off")


@case
def compose_intensity_scales():
    bake()
    luxel("compose", "room.baked", "-o", "1.exr", "--set", "neon*=off", "--set", "lamp=1,1,1*10")
    luxel("compose", "room.baked", "-o", "3.exr", "--set", "neon*=off", "--set", "lamp=#ffffff*30")
    expect(abs(mean("3.exr") / mean("1.exr") - 3) < 1e-5, "three times the intensity is not three times the light")


@case
def compose_page_out_of_range():
    bake()
    refused("compose", "room.baked", "-o", "a.exr", "--page", "1", code=2, says=["--page", "1"])


@case
def set_wrong_name_lists_the_nearest():
    bake()
    for command, picture in (("compose", "a.exr"), ("render", "a.png")):
        refused(command, "room.baked", "-o", picture, "--set", "lmap=off", code=2, says=["lmap", "lamp"])
    refused("compose", "room.baked", "-o", "a.exr", "--set", "nothing*=off", code=2, says=["nothing"])
    refused("compose", "room.baked", "-o", "a.exr", "--set", "lamp", code=2, says=["lamp"])
    refused("compose", "room.baked", "-o", "a.exr", "--set", "lamp=blue", code=2, says=["blue"])
    expect(not os.path.exists("a.exr") and not os.path.exists("a.png"), "a picture was written")


@case
def render_baked_folder():
    bake()
    size = ("--size", "96x54", "--samples", "4", "--exposure", "0")
    luxel("render", "room.baked", "-o", "lit.png", *size, out="lit.png*96 x 54*")
    expect(image_size("lit.png") == (96, 54), "size is %s" % (image_size("lit.png"),))
    luxel("render", "room.baked", "-o", "dark.png", *size, "--set", "*=off")
    luxel("render", "room.baked", "-o", "red.exr", *size, "--set", "*=off", "--set", "lamp=1,0,0*10")
    luxel("render", "room.baked", "-o", "albedo.png", *size, "--view", "albedo")
    luxel("render", "room.baked", "-o", "map.png", *size, "--view", "lightmap")
    expect(mean("lit.png") > 0.01, "the picture is black")
    expect(mean("dark.png") == 0, "light with all layers off")
    expect(mean("red.exr") > 0 and mean("albedo.png") > 0 and mean("map.png") > 0, "a picture is black")


@case
def render_monitor_shows_its_picture_until_a_cell_changes():
    look = ("--eye", "0,0.5,-0.46", "--target", "0,0.5,-0.8", "--size", "64x36", "--samples", "8", "--exposure", "0")  # nothing but the screen
    for name, monitor in (("plain", None), ("cells", "4x2"), ("half", "2x1")):
        write(name + ".glb", scenes.living_room(monitor).to_bytes())
        luxel("bake", name + ".glb", "-o", name + ".baked", *FAST, "--no-preview", "--quiet")
    for name in ("plain", "cells", "half"):
        luxel("render", name + ".baked", "-o", name + ".exr", *look)

    def apart(a, b):
        return json.loads(luxel("compare", a, b, "--json").out)["relative_rmse"]
    expect(apart("plain.exr", "cells.exr") < 0.02 and apart("plain.exr", "half.exr") < 0.02, "the authored picture is not shown")
    luxel("render", "half.baked", "-o", "changed.exr", *look, "--set", "tv/1=#808080*10")
    expect(apart("plain.exr", "changed.exr") > 0.2, "the cells are not shown")
    luxel("render", "cells.baked", "-o", "off.exr", *look, "--set", "tv/*=off", "--set", "lamp=off", "--set", "neon*=off")
    expect(mean("off.exr") == 0, "the screen still shines")
    luxel("render", "cells.baked", "-o", "red.exr", *look, "--set", "*=off", "--set", "tv/0=#ff0000*10")
    luxel("render", "cells.baked", "-o", "right.exr", *look, "--set", "*=off", "--set", "tv/3=#ff0000*10")
    # Cell 0 is at the top left, cell 3 at the top right; both give as much light.
    expect(abs(mean("red.exr") / mean("right.exr") - 1) < 0.1 and apart("red.exr", "right.exr") > 1, "cells 0 and 3 look alike")


@case
def render_camera_by_name_and_index():
    write("room.glb", scenes.GOOD)
    size = ("--size", "32x18", "--samples", "1", "--exposure", "0")
    luxel("render", "room.glb", "-o", "name.png", *size, "--camera", "view")
    luxel("render", "room.glb", "-o", "index.png", *size, "--camera", "0")
    expect(read("name.png") == read("index.png"), "camera by name and by index differ")
    refused("render", "room.glb", "-o", "a.png", *size, "--camera", "veiw", code=2, says=["veiw"])


@case
def render_reference_agrees_with_bake():
    write("room.glb", scenes.GOOD)
    luxel("bake", "room.glb", "-o", "room.baked", "--page-size", "256", "--samples", "64", "--no-preview", "--quiet")
    size = ("--size", "64x36", "--samples", "256")
    luxel("render", "room.baked", "-o", "baked.exr", *size)
    luxel("render", "room.baked", "-o", "truth.exr", *size, "--reference")
    result = json.loads(luxel("compare", "truth.exr", "baked.exr", "--json").out)
    expect(abs(result["mean_b"] / result["mean_a"] - 1) < 0.05, "means differ: %s" % result)
    expect(result["relative_rmse"] < 0.25, "pictures differ: %s" % result)


@case
def irradiance_below_a_lamp_is_i_over_d_squared():
    g = scenes.Gltf("luxel tests/cli")
    grey = g.add_material("grey", (0.5, 0.5, 0.5))
    g.add_node("floor", mesh=g.add_mesh("floor", (scenes.quad(4, 4).rotate((1, 0, 0), -90), grey)))
    g.add_node("lamp", light=g.add_light("point", 40, (1, 0.5, 0.25)), translation=(0, 2, 0))
    g.save("lamp.glb")
    write("p.csv", "x,y,z,nx,ny,nz\n0,1e-4,0,0,3,0\n2,1e-4,0,0,1,0\n0,1e-4,0,0,-1,0\n")
    result = luxel("irradiance", "lamp.glb", "--points", "p.csv", "--bounces", "0", "--samples", "16")
    rows = result.out.splitlines()
    expect(rows[0] == "x,y,z,nx,ny,nz,r,g,b" and len(rows) == 4, result.out)
    values = [[float(v) for v in row.split(",")] for row in rows[1:]]
    expect(all(abs(values[0][6 + k] / e - 1) < 1e-3 for k, e in enumerate((10, 5, 2.5))), result.out)
    # At 45 degrees: I cos / d^2 = 40 * sqrt(1/2) / 8.
    expect(abs(values[1][6] / (40 * 0.5 ** 0.5 / 8) - 1) < 1e-3, result.out)
    expect(values[2][6:] == [0, 0, 0], "light from behind: " + result.out)
    luxel("irradiance", "lamp.glb", "--points", "p.csv", "--bounces", "0", "--samples", "16", "-o", "e.csv", out="")
    expect(read("e.csv").decode() == result.out, "-o writes something else than stdout")
    expect(not os.path.exists("e.csv.partial"), "e.csv.partial is left")


# --- Pictures side by side ----------------------------------------------------------------------------------------------


def picture(path, width, height, pixel, channels=3):
    """A PNG with pixel(x, y) as a tuple of bytes."""
    data = bytes(v for y in range(height) for x in range(width) for v in pixel(x, y))
    return write(path, png(width, height, data, channels))


@case
def compare_numbers_are_right():
    picture("a.png", 4, 4, lambda x, y: (255, 255, 255))
    picture("b.png", 4, 4, lambda x, y: (0, 0, 0) if (x, y) == (2, 1) else (255, 255, 255))
    result = json.loads(luxel("compare", "a.png", "b.png", "--json", "--difference", "d.png").out)
    for key, value in (("width", 4), ("height", 4), ("valid", 16), ("mean_a", 1), ("mean_b", 15 / 16), ("rmse", 0.25),
                       ("relative_rmse", 0.25), ("rel_mse", 1 / 16 / 1.01), ("worst", 1)):
        expect(abs(result[key] - value) < 1e-6, "%s is %s, not %s" % (key, result[key], value))
    expect(result["worst_pixel"] == [2, 1], str(result))
    expect(abs(mean("d.png") - 1 / 16) < 1e-6, "the difference picture has mean %g" % mean("d.png"))
    luxel("compare", "a.png", "b.png", out="*relative RMSE  0.25\n*worst*(2, 1)\n")


@case
def compare_leaves_out_transparent_pixels():
    # One hole at (3, 3) of 8 x 8; the only difference lies next to it.
    picture("a.png", 8, 8, lambda x, y: (255, 255, 255, 0 if (x, y) == (3, 3) else 255), 4)
    picture("b.png", 8, 8, lambda x, y: (0, 0, 0, 255) if (x, y) == (4, 4) else (255, 255, 255, 255), 4)
    for erode, valid, worst in (("0", 63, 1), ("1", 55, 0), ("2", 39, 0), ("9", None, None)):
        if valid is None:
            refused("compare", "a.png", "b.png", "--erode", erode, code=1, says=["no pixel is valid"])
            continue
        result = json.loads(luxel("compare", "a.png", "b.png", "--erode", erode, "--json").out)
        expect(result["valid"] == valid and result["worst"] == worst, "--erode %s: %s" % (erode, result))


@case
def compare_limit_decides_the_exit_code():
    picture("a.png", 4, 4, lambda x, y: (255, 255, 255))
    picture("b.png", 4, 4, lambda x, y: (0, 0, 0) if x == y == 0 else (255, 255, 255))
    luxel("compare", "a.png", "b.png", "--max-relative-rmse", "0.26", err="")
    luxel("compare", "a.png", "b.png", "--max-relative-rmse", "0.24", code=1, err="luxel: b.png: *0.25*0.24*")
    luxel("compare", "a.png", "a.png", "--max-relative-rmse", "0", err="")


@case
def compare_refuses_other_sizes_and_other_files():
    picture("a.png", 4, 4, lambda x, y: (255, 255, 255))
    picture("b.png", 4, 5, lambda x, y: (255, 255, 255))
    write("c.png", "text")
    refused("compare", "a.png", "b.png", code=1, says=["b.png", "4 x 5", "4 x 4"])
    refused("compare", "a.png", "c.png", code=1, says=["c.png"])
    refused("compare", "a.png", "d.png", code=1, says=["d.png"])


# --- Ctrl-C -------------------------------------------------------------------------------------------------------------


def interrupt(arguments, stage, number):
    """Starts luxel with stderr on a terminal, sends the signal when the bar of `stage` shows. Exit code and screen."""
    terminal, far_end = pty.openpty()
    process = start(*arguments, stdout=far_end, stderr=far_end)
    os.close(far_end)
    screen, sent, begin = b"", False, time.monotonic()
    while True:
        if time.monotonic() - begin > 100:
            process.kill()
            process.wait()
            raise Failed("not stopped: %s" % screen[-2000:])
        if not select.select([terminal], [], [], 1.0)[0]:
            continue
        try:
            data = os.read(terminal, 4096)
        except OSError:  # the far end was closed: the process is over
            data = b""
        if not data:
            break
        screen += data
        if not sent and stage in screen:
            process.send_signal(number)
            sent = True
    os.close(terminal)
    return process.wait(), screen.decode("utf-8", "replace")


@case
def interrupt_stops_cleanly():
    bake()
    before = tree(".")
    # Finished layers of the first lie in a file beside the result.
    for number, stage, options in ((signal.SIGINT, b"direct ", ("--memory", "64G")), (signal.SIGTERM, b"bake ", ("--integrator", "path"))):
        # Enough texels to take minutes, few enough samples that a tile, which is finished first, takes a moment.
        code, screen = interrupt(["bake", "room.glb", "-o", "room.baked", "--samples", "1000", "--page-size", "2048", *options],
                                 stage, number)
        expect(code == 130, "exit code %d: %s" % (code, screen))
        expect("stopped" in screen, screen)
        expect(tree(".") == before, "files changed: %s" % sorted(tree(".")))
        expect(sorted(os.listdir(".")) == ["room.baked", "room.glb"], "left behind: %s" % os.listdir("."))


@case
def interrupt_stops_a_render():
    write("room.glb", scenes.GOOD)
    code, screen = interrupt(["render", "room.glb", "-o", "a.png", "--samples", "1000", "--size", "4000x4000"], b"%", signal.SIGINT)
    expect(code == 130, "exit code %d: %s" % (code, screen))
    expect(os.listdir(".") == ["room.glb"], "left behind: %s" % os.listdir("."))


if __name__ == "__main__":
    sys.exit(main())
