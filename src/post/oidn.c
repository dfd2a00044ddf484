// Adapter of Open Image Denoise: see oidn.h.
//
// Types and entry points as in its C API [OIDN], those that 1.x and 2.x have in common. No header of it is needed: the few declarations stand here.
#include "post/oidn.h"

#include "base/error.h"
#include "base/library.h"
#include "base/memory.h"
#include "base/thread.h"

#include <stdlib.h>
#include <string.h>

// OIDNDevice and OIDNFilter are opaque pointers.
typedef void *oidn_device;
typedef void *oidn_filter;
enum {
    oidn_device_cpu = 1,    // OIDN_DEVICE_TYPE_CPU: images are in this process' memory
    oidn_error_none = 0,    // OIDN_ERROR_NONE
    oidn_format_float3 = 3, // OIDN_FORMAT_FLOAT3
};

typedef struct oidn_api {
    oidn_device (*new_device)(int type);
    void (*commit_device)(oidn_device device);
    void (*release_device)(oidn_device device);
    int (*get_device_error)(oidn_device device, const char **out_message);
    void (*set_device_int)(oidn_device device, const char *name, int value); // NULL: neither name of it exists
    oidn_filter (*new_filter)(oidn_device device, const char *type);
    void (*release_filter)(oidn_filter filter);
    void (*set_shared_filter_image)(oidn_filter filter, const char *name, void *pixels, int format, size_t width, size_t height, size_t byte_offset,
                                    size_t pixel_stride, size_t row_stride);
    void (*commit_filter)(oidn_filter filter);
    void (*execute_filter)(oidn_filter filter);
} oidn_api;

struct lx_oidn {
    lx_library *library;
    oidn_api api;
    oidn_device device;
    oidn_filter filter;
    lx_mutex *mutex;
    uint32_t page_size;      // the filter's; 0: none yet
    float *color, *output;   // [page_size²] RGB
};

static lx_result load(const char *name, lx_library **out, lx_error *error)
{
    static const char *const usual[] = {"libOpenImageDenoise.so.2", "libOpenImageDenoise.so.1", "libOpenImageDenoise.so.0", "libOpenImageDenoise.so"};
    lx_error reason = {0};
    if (!name) name = getenv("LUXEL_OIDN_LIBRARY");
    if (name && name[0]) {
        if (lx_library_open(name, out, &reason) == LX_OK) return LX_OK;
        return lx_fail(error, LX_ERROR_BACKEND, "Open Image Denoise cannot be loaded: %s", reason.message);
    }
    for (size_t i = 0; i < sizeof usual / sizeof *usual; ++i)
        if (lx_library_open(usual[i], out, &reason) == LX_OK) return LX_OK;
    return lx_fail(error, LX_ERROR_BACKEND,
                   "Open Image Denoise is not installed (%s not found); install it from openimagedenoise.org and name its library in LUXEL_OIDN_LIBRARY "
                   "or the library path, or use the builtin denoiser", usual[0]);
}

static lx_result find_functions(lx_oidn *oidn, lx_error *error)
{
    oidn_api *api = &oidn->api;
    const struct {
        const char *name;
        void *into; // a pointer to a function pointer
    } needed[] = {
        {"oidnNewDevice", &api->new_device},         {"oidnCommitDevice", &api->commit_device},
        {"oidnReleaseDevice", &api->release_device}, {"oidnGetDeviceError", &api->get_device_error},
        {"oidnNewFilter", &api->new_filter},         {"oidnReleaseFilter", &api->release_filter},
        {"oidnSetSharedFilterImage", &api->set_shared_filter_image},
        {"oidnCommitFilter", &api->commit_filter},   {"oidnExecuteFilter", &api->execute_filter},
    };
    for (size_t i = 0; i < sizeof needed / sizeof *needed; ++i) {
        const lx_library_function function = lx_library_find(oidn->library, needed[i].name);
        if (!function) return lx_fail(error, LX_ERROR_BACKEND, "Open Image Denoise: the library has no function %s", needed[i].name);
        memcpy(needed[i].into, &function, sizeof function);
    }
    lx_library_function set_int = lx_library_find(oidn->library, "oidnSetDeviceInt"); // 2.x
    if (!set_int) set_int = lx_library_find(oidn->library, "oidnSetDevice1i");        // 1.x
    memcpy(&api->set_device_int, &set_int, sizeof set_int);
    return LX_OK;
}

// What the device has to say, as our error; LX_OK if it is content. `device` NULL: why it could not be created.
static lx_result check(const lx_oidn *oidn, lx_error *error)
{
    const char *message = NULL;
    const int code = oidn->api.get_device_error(oidn->device, &message);
    if (code == oidn_error_none) return LX_OK;
    return lx_fail(error, LX_ERROR_BACKEND, "Open Image Denoise: %s (error %d)", message ? message : "failed", code);
}

lx_result lx_oidn_open(const char *library, uint32_t thread_count, lx_oidn **out_oidn, lx_error *error)
{
    lx_result result = LX_OK;
    lx_oidn *oidn = lx_calloc_array(1, sizeof *oidn);
    if (!oidn) return lx_fail_memory(error, "Open Image Denoise");
    LX_TRY(load(library, &oidn->library, error));
    LX_TRY(find_functions(oidn, error));
    oidn->mutex = lx_mutex_create();
    if (!oidn->mutex) {
        result = lx_fail_memory(error, "Open Image Denoise");
        goto cleanup;
    }
    oidn->device = oidn->api.new_device(oidn_device_cpu);
    LX_TRY(check(oidn, error));
    if (!oidn->device) {
        result = lx_fail(error, LX_ERROR_BACKEND, "Open Image Denoise does not run on this machine");
        goto cleanup;
    }
    if (thread_count > 0 && oidn->api.set_device_int) oidn->api.set_device_int(oidn->device, "numThreads", (int)thread_count);
    oidn->api.commit_device(oidn->device);
    LX_TRY(check(oidn, error));
    *out_oidn = oidn;
    oidn = NULL;
cleanup:
    lx_oidn_close(oidn);
    return result;
}

static void release_filter(lx_oidn *oidn)
{
    if (oidn->filter) oidn->api.release_filter(oidn->filter);
    lx_free(oidn->color);
    lx_free(oidn->output);
    oidn->filter = NULL;
    oidn->color = oidn->output = NULL;
    oidn->page_size = 0;
}

void lx_oidn_close(lx_oidn *oidn)
{
    if (!oidn) return;
    release_filter(oidn);
    if (oidn->device) oidn->api.release_device(oidn->device);
    lx_mutex_destroy(oidn->mutex);
    lx_library_close(oidn->library);
    lx_free(oidn);
}

// The filter keeps its images and its size from page to page: setting it up costs as much as a small page.
static lx_result prepare_filter(lx_oidn *oidn, uint32_t page_size, lx_error *error)
{
    if (oidn->page_size == page_size) return LX_OK;
    lx_result result = LX_OK;
    const oidn_api *api = &oidn->api;
    const size_t texels = (size_t)page_size * page_size;
    release_filter(oidn);
    oidn->color = lx_malloc_array(texels, 3 * sizeof(float));
    oidn->output = lx_malloc_array(texels, 3 * sizeof(float));
    if (!oidn->color || !oidn->output) {
        result = lx_fail_memory(error, "Open Image Denoise");
        goto cleanup;
    }
    oidn->filter = api->new_filter(oidn->device, "RTLightmap"); // values of any range: "directional" is off by default
    LX_TRY(check(oidn, error));
    if (!oidn->filter) {
        result = lx_fail(error, LX_ERROR_BACKEND, "Open Image Denoise has no filter for lightmaps; version 1.1 or later has");
        goto cleanup;
    }
    api->set_shared_filter_image(oidn->filter, "color", oidn->color, oidn_format_float3, page_size, page_size, 0, 0, 0);
    api->set_shared_filter_image(oidn->filter, "output", oidn->output, oidn_format_float3, page_size, page_size, 0, 0, 0);
    api->commit_filter(oidn->filter);
    LX_TRY(check(oidn, error));
    oidn->page_size = page_size;
    return LX_OK;
cleanup:
    release_filter(oidn);
    return result;
}

static lx_result denoise_page(lx_oidn *oidn, const lx_luxel_map *map, uint32_t page, const uint32_t *shown, lx_rgb *luxels, lx_error *error)
{
    const size_t texels = (size_t)map->page_size * map->page_size;
    const uint32_t *of_page = shown + page * texels, *index = map->index + page * texels;
    for (size_t i = 0; i < texels; ++i) {
        const lx_rgb color = of_page[i] < map->count ? luxels[of_page[i]] : (lx_rgb){0, 0, 0};
        memcpy(oidn->color + 3 * i, &color, sizeof color);
    }
    oidn->api.execute_filter(oidn->filter);
    const lx_result result = check(oidn, error);
    if (result != LX_OK) return result;
    for (size_t i = 0; i < texels; ++i) {
        if (index[i] == LX_NO_LUXEL || of_page[i] != index[i]) continue; // padding, or not valid
        const float *c = oidn->output + 3 * i;
        // The network may overshoot below black.
        luxels[index[i]] = lx_rgb_of(lx_max(0, c[0]), lx_max(0, c[1]), lx_max(0, c[2]));
    }
    return LX_OK;
}

lx_result lx_oidn_denoise(lx_oidn *oidn, const lx_luxel_map *map, const uint32_t *shown, lx_rgb *luxels, lx_error *error)
{
    lx_mutex_lock(oidn->mutex);
    lx_result result = prepare_filter(oidn, map->page_size, error);
    for (uint32_t page = 0; page < map->page_count && result == LX_OK; ++page) result = denoise_page(oidn, map, page, shown, luxels, error);
    lx_mutex_unlock(oidn->mutex);
    return result;
}
