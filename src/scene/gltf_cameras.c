// Cameras of the default scene.
#include "scene/gltf_reader.h"

#include "base/error.h"

#include <string.h>

static lx_result read_perspective(const lx_gltf_object *object, lx_camera *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object lens;
    LX_TRY(lx_gltf_get_object(object, "perspective", &lens, error));
    LX_TRY(lx_gltf_get_float(&lens, "yfov", &out->yfov, error));
    LX_TRY(lx_gltf_get_float(&lens, "aspectRatio", &out->aspect, error));
    out->perspective = true;
cleanup:
    return result;
}

static lx_result read_orthographic(const lx_gltf_object *object, lx_camera *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object lens;
    LX_TRY(lx_gltf_get_object(object, "orthographic", &lens, error));
    LX_TRY(lx_gltf_get_float(&lens, "xmag", &out->xmag, error));
    LX_TRY(lx_gltf_get_float(&lens, "ymag", &out->ymag, error));
    if (out->xmag > 0 && out->ymag > 0) out->aspect = out->xmag / out->ymag;
cleanup:
    return result;
}

// A camera looks along -Z whatever the scale of its node; mirrored or sheared axes are made right-handed and square
// again.
static lx_mat4 without_scale(const lx_mat4 *m)
{
    const lx_vec3 back = lx_normalize_or(lx_v3(m->m[8], m->m[9], m->m[10]), lx_v3(0, 0, 1));
    const lx_vec3 up = lx_v3(m->m[4], m->m[5], m->m[6]);
    lx_vec3 t, b;
    lx_tangent_frame(back, &t, &b);
    const lx_vec3 right = lx_normalize_or(lx_cross(up, back), t);
    const lx_vec3 true_up = lx_cross(back, right);
    return (lx_mat4){{right.x, right.y, right.z, 0, true_up.x, true_up.y, true_up.z, 0, back.x, back.y, back.z, 0,
                      m->m[12], m->m[13], m->m[14], 1}};
}

static bool is_usable(const lx_camera *camera)
{
    if (!(camera->aspect >= 0)) return false;
    return camera->perspective ? camera->yfov > 0 && camera->yfov < LX_PI : camera->xmag > 0 && camera->ymag > 0;
}

static lx_result read_camera(lx_gltf_reader *reader, uint32_t node_index, const lx_gltf_object *node,
                             uint32_t camera_index, lx_error *error)
{
    lx_result result = LX_OK;
    lx_scene *scene = reader->scene;
    lx_gltf_object object;
    const char *type = "";
    lx_camera camera = {.transform = without_scale(&reader->nodes[node_index].world)};
    LX_TRY(lx_gltf_element(reader, LX_GLTF_CAMERA, camera_index, &object, error));
    LX_TRY(lx_gltf_get_string(&object, "type", &type, error));
    if (strcmp(type, "perspective") == 0)
        LX_TRY(read_perspective(&object, &camera, error));
    else if (strcmp(type, "orthographic") == 0)
        LX_TRY(read_orthographic(&object, &camera, error));
    else
        return lx_fail(error, LX_ERROR_FORMAT, "%s: unknown type '%.20s'", object.label, type);
    if (!is_usable(&camera)) {
        lx_log_warning(reader->log, "%s: its angles or extents make no picture; ignored", object.label);
        return LX_OK;
    }
    LX_TRY(lx_gltf_name(reader, node, &object, "camera", scene->camera_count, &camera.name, error));
    scene->cameras[scene->camera_count++] = camera;
cleanup:
    return result;
}

lx_result lx_gltf_load_cameras(lx_gltf_reader *reader, lx_error *error)
{
    lx_result result = LX_OK;
    lx_scene *scene = reader->scene;
    scene->cameras = lx_calloc_array(reader->order_count, sizeof *scene->cameras); // a node has at most one
    if (!scene->cameras) return lx_fail_memory(error, "cameras");
    for (uint32_t i = 0; i < reader->counts[LX_GLTF_NODE]; ++i) {
        lx_gltf_object node;
        int32_t camera;
        if (!reader->nodes[i].in_scene) continue;
        LX_TRY(lx_gltf_element(reader, LX_GLTF_NODE, i, &node, error));
        LX_TRY(lx_gltf_get_index(&node, "camera", reader->counts[LX_GLTF_CAMERA], &camera, error));
        if (camera >= 0) LX_TRY(read_camera(reader, i, &node, (uint32_t)camera, error));
    }
cleanup:
    return result;
}
