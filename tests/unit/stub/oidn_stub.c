// A library with the entry points of Open Image Denoise that Luxel uses. Its "network" is the mean of a texel and its four neighbours; whatever Luxel does that
// the real library would refuse becomes an error with a message, as there.
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef struct stub_image {
    float *pixels;
    size_t width, height;
} stub_image;

typedef struct stub_filter {
    stub_image color, output;
    int is_committed;
} stub_filter;

typedef struct stub_device {
    int is_committed, threads, filters;
} stub_device;

#define EXPORT __attribute__((visibility("default")))

static int error_code;
static const char *error_message;
static stub_device only_device;

static void fail(int code, const char *message)
{
    if (error_code) return;
    error_code = code;
    error_message = message;
}

EXPORT void *oidnNewDevice(int type);
EXPORT void oidnCommitDevice(void *device);
EXPORT void oidnReleaseDevice(void *device);
EXPORT int oidnGetDeviceError(void *device, const char **out_message);
EXPORT void oidnSetDeviceInt(void *device, const char *name, int value);
EXPORT void *oidnNewFilter(void *device, const char *type);
EXPORT void oidnReleaseFilter(void *filter);
EXPORT void oidnSetSharedFilterImage(void *filter, const char *name, void *pixels, int format, size_t width, size_t height, size_t offset,
                                     size_t pixel_stride, size_t row_stride);
EXPORT void oidnCommitFilter(void *filter);
EXPORT void oidnExecuteFilter(void *filter);

void *oidnNewDevice(int type)
{
    only_device = (stub_device){0};
    if (getenv("OIDN_STUB_NO_DEVICE")) {
        fail(5, "unsupported CPU");
        return NULL;
    }
    if (type != 1) fail(2, "not the CPU device");
    return &only_device;
}

void oidnSetDeviceInt(void *device, const char *name, int value)
{
    if (device != &only_device || strcmp(name, "numThreads") != 0 || value < 1) fail(2, "unknown device parameter");
    only_device.threads = value;
}

void oidnCommitDevice(void *device)
{
    if (device != &only_device) fail(2, "no device");
    only_device.is_committed = 1;
}

void oidnReleaseDevice(void *device)
{
    if (device != &only_device || only_device.filters != 0) abort(); // the test sees it
}

int oidnGetDeviceError(void *device, const char **out_message)
{
    (void)device;
    const int code = error_code;
    if (out_message) *out_message = error_message;
    error_code = 0;
    error_message = NULL;
    return code;
}

void *oidnNewFilter(void *device, const char *type)
{
    if (device != &only_device || !only_device.is_committed) fail(3, "the device is not committed");
    if (strcmp(type, "RTLightmap") != 0) {
        fail(2, "unknown filter type");
        return NULL;
    }
    ++only_device.filters;
    return calloc(1, sizeof(stub_filter));
}

void oidnReleaseFilter(void *filter)
{
    --only_device.filters;
    free(filter);
}

void oidnSetSharedFilterImage(void *filter, const char *name, void *pixels, int format, size_t width, size_t height, size_t offset, size_t pixel_stride,
                              size_t row_stride)
{
    stub_filter *f = filter;
    const stub_image image = {pixels, width, height};
    if (format != 3 || offset != 0 || pixel_stride != 0 || row_stride != 0) fail(2, "not a packed image of three floats");
    if (strcmp(name, "color") == 0)
        f->color = image;
    else if (strcmp(name, "output") == 0)
        f->output = image;
    else
        fail(2, "unknown image parameter");
    f->is_committed = 0;
}

void oidnCommitFilter(void *filter)
{
    stub_filter *f = filter;
    if (!f->color.pixels || !f->output.pixels) fail(3, "image not specified");
    if (f->color.width != f->output.width || f->color.height != f->output.height) fail(3, "image size mismatch");
    f->is_committed = 1;
}

void oidnExecuteFilter(void *filter)
{
    const stub_filter *f = filter;
    if (!f->is_committed) {
        fail(3, "changes to the filter are not committed");
        return;
    }
    if (getenv("OIDN_STUB_FAIL")) {
        fail(4, "out of memory");
        return;
    }
    const size_t w = f->color.width, h = f->color.height;
    for (size_t y = 0; y < h; ++y)
        for (size_t x = 0; x < w; ++x)
            for (size_t c = 0; c < 3; ++c) {
                const float *in = f->color.pixels + c;
                const size_t left = x ? x - 1 : x, right = x + 1 < w ? x + 1 : x, up = y ? y - 1 : y, down = y + 1 < h ? y + 1 : y;
                f->output.pixels[3 * (y * w + x) + c] = (in[3 * (y * w + x)] + in[3 * (y * w + left)] + in[3 * (y * w + right)] +
                                                         in[3 * (up * w + x)] + in[3 * (down * w + x)]) / 5;
            }
}
