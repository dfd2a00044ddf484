// Loading scenes from disk and letting go of them.
#include "scene/scene.h"

#include "base/clock.h"
#include "base/error.h"
#include "scene/geometry.h"
#include "scene/gltf.h"

lx_scene_load_desc lx_scene_load_desc_default(void)
{
    return (lx_scene_load_desc){.light_units = LX_LIGHT_UNITS_GLTF, .max_file_bytes = (size_t)4 << 30};
}

lx_result lx_scene_load(lx_context *context, const char *path, const lx_scene_load_desc *desc, lx_scene **out_scene,
                        lx_error *error)
{
    const lx_scene_load_desc defaults = lx_scene_load_desc_default();
    if (!desc) desc = &defaults;
    lx_bytes file = {0};
    char *folder = NULL;
    const double start = lx_seconds();
    lx_result result = lx_file_read(path, desc->max_file_bytes, &file, error);
    if (result != LX_OK) {
        lx_error_prefix(error, "%s", path);
        return result;
    }
    folder = lx_path_folder(path);
    result = folder ? lx_gltf_import(context, path, folder, file.data, file.size, desc, out_scene, error)
                    : lx_fail_memory(error, "path");
    if (result == LX_OK) (*out_scene)->import_seconds = lx_seconds() - start;
    lx_free(folder);
    lx_bytes_release(&file);
    return result;
}

void lx_scene_destroy(lx_scene *scene)
{
    if (!scene) return;
    for (uint32_t i = 0; i < scene->primitive_count; ++i) lx_primitive_release(&scene->primitives[i]);
    for (uint32_t i = 0; i < scene->image_count; ++i) lx_image_release(&scene->images[i]);
    for (uint32_t i = 0; i < scene->buffer_count; ++i) lx_bytes_release(&scene->buffers[i]);
    for (uint32_t i = 0; i < scene->file_image_count; ++i) lx_bytes_release(&scene->image_files[i]);
    lx_free(scene->primitives);
    lx_free(scene->images);
    lx_free(scene->textures);
    lx_free(scene->materials);
    lx_free(scene->meshes);
    lx_free(scene->instances);
    lx_free(scene->surfaces);
    lx_free(scene->lights);
    lx_free(scene->sources);
    lx_free(scene->cameras);
    lx_free(scene->tracks);
    lx_free(scene->buffers);
    lx_free(scene->image_files);
    lx_gltf_document_release(scene->document);
    lx_arena_release(&scene->strings);
    lx_free(scene->path);
    lx_free(scene);
}

bool lx_material_emits(const lx_material *material)
{
    if (material->unlit) return false;
    return material->emission_animated || (material->emissive_strength > 0 && lx_rgb_max(material->emissive_factor) > 0);
}

void lx_text_free(char *text) { lx_free(text); }
