// Fuzz target: any bytes as a .glb or .gltf. External files are refused and sizes are small, so what is left is the
// importer. Seeds are in tests/fuzz/gltf_import/, words in gltf_import.dict.
#include "base/context.h"
#include "scene/gltf.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void drop_line(void *user, lx_log_level level, const char *message)
{
    (void)user;
    (void)level;
    (void)message;
}

// The context is made anew now and then, since it keeps all warnings, and a description repeats them.
static lx_context *borrow_context(void)
{
    static lx_context *context;
    static unsigned uses;
    if (context && ++uses % 16 == 0) {
        lx_context_destroy(context);
        context = NULL;
    }
    if (!context) {
        lx_context_desc desc = lx_context_desc_default();
        desc.thread_count = 1;
        desc.logger.func = drop_line;
        if (lx_context_create(&desc, &context, NULL) != LX_OK) return NULL;
    }
    return context;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    lx_context *context = borrow_context();
    lx_scene_load_desc desc = lx_scene_load_desc_default();
    desc.max_file_bytes = 1 << 20;
    lx_scene *scene = NULL;
    lx_error error;
    if (context && lx_gltf_import(context, "fuzz", NULL, data, size, &desc, &scene, &error) == LX_OK) {
        char *text = NULL;
        if (lx_scene_describe(scene, &text, NULL) == LX_OK) lx_text_free(text);
        for (uint32_t i = 0; i < scene->material_count; ++i)
            lx_texture_sample(scene, &scene->materials[i].base_color_texture, (lx_vec2){0.3f, -7.5f}, true);
        lx_scene_destroy(scene);
    }
    return 0;
}
