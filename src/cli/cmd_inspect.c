/// luxel inspect: what is in a scene or a baked folder.
#include "commands.h"
#include "session.h"
#include "table.h"

#include "luxel/baked.h"

#include <stdio.h>

// Sizes as people read them.
static void write_out_bytes(json_t *object)
{
    const char *key;
    json_t *value;
    json_object_foreach(object, key, value)
        if (json_is_integer(value)) {
            char text[32];
            cli_format_bytes(text, (uint64_t)json_integer_value(value));
            json_object_set_new(object, key, json_string(text)); // an existing key: legal while iterating
        }
}

// The library's description with the warnings and notes of loading added.
static int print(const cli_session *session, const char *text, bool as_json)
{
    json_t *const root = json_loads(text, 0, NULL);
    json_t *const warnings = json_array(), *const notes = json_array();
    int status = CLI_MACHINE_FAILED;
    if (json_is_object(root) && warnings && notes) {
        for (size_t i = 0; i < session->line_count; ++i) {
            const cli_log_line *const line = &session->lines[i];
            json_array_append_new(line->level == LX_LOG_WARNING ? warnings : notes, json_string(line->text));
        }
        json_object_set(root, "warnings", warnings);
        json_object_set(root, "notes", notes);
        if (as_json) {
            json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
            putchar('\n');
        } else {
            write_out_bytes(json_object_get(root, "memory"));
            write_out_bytes(json_object_get(root, "sizes"));
            cli_print_document(root);
        }
        status = CLI_DONE;
    } else {
        fprintf(stderr, "luxel: cannot format the description (out of memory?)\n");
    }
    json_decref(notes);
    json_decref(warnings);
    json_decref(root);
    return status;
}

static int run(const cli_command *command, int argc, char **argv)
{
    cli_session session = cli_session_default();
    const char *input = NULL;
    int light_units = 0;
    bool json = false;
    const cli_option options[] = {
        {.name = "json", .kind = CLI_FLAG, .target = &json, .help = "as JSON"},
        {.name = "light-units", .argument = "gltf|blender", .kind = CLI_CHOICE, .target = &light_units,
         .help = "for a scene: blender multiplies emission by 683 (default gltf)"},
    };
    int status = cli_parse(command, options, CLI_COUNT(options), argc, argv, &input, 1, 1);
    if (status != CLI_GO_ON) return status;

    session.collect = true;
    session.desc.thread_count = 1;
    lx_error error = {0};
    lx_scene *scene = NULL;
    lx_baked *baked = NULL;
    char *text = NULL;
    lx_result result = cli_session_open(&session, &error);
    if (result != LX_OK) goto cleanup;
    if (lx_baked_is_folder(input)) {
        result = lx_baked_open(session.context, input, false, &baked, &error);
        if (result == LX_OK) result = lx_baked_describe(baked, &text, &error);
    } else {
        lx_scene_load_desc load = lx_scene_load_desc_default();
        load.light_units = light_units == 1 ? LX_LIGHT_UNITS_BLENDER : LX_LIGHT_UNITS_GLTF;
        result = lx_scene_load(session.context, input, &load, &scene, &error);
        if (result == LX_OK) result = lx_scene_describe(scene, &text, &error);
    }
cleanup:
    status = cli_finish(&session, result, &error, input);
    if (result == LX_OK) status = print(&session, text, json);
    lx_text_free(text);
    lx_baked_destroy(baked);
    lx_scene_destroy(scene);
    cli_session_close(&session);
    return status;
}

const cli_command cli_inspect = {
    .name = "inspect",
    .usage = "SCENE|OUT [options]",
    .summary = "show what is in a scene or a baked folder",
    .about = "Shows what is in a scene or a baked folder: lights, layers, cameras, materials, coverage, warnings.",
    .examples = "  luxel inspect room.glb\n"
                "  luxel inspect room.baked --json\n",
    .run = run,
};
