/// Picture files from plain arrays (include/luxel/picture.h).
#include "luxel/picture.h"

#include "base/error.h"
#include "image/image.h"

#include <string.h>

static lx_result save(const char *path, const lx_image *image, lx_error *error)
{
    if (image->width == 0 || image->height == 0)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%s: a picture of %u x %u pixels", path, image->width, image->height);
    const lx_result result = lx_image_save(image, path, error);
    if (result != LX_OK) lx_error_prefix(error, "%s", path);
    return result;
}

lx_result lx_picture_save(const char *path, uint32_t width, uint32_t height, const float *rgb, lx_error *error)
{
    char extension[8];
    lx_path_extension(path, extension);
    if (strcmp(extension, "exr") != 0 && strcmp(extension, "hdr") != 0 && strcmp(extension, "png") != 0)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%s: the name does not end with .exr, .hdr or .png", path);
    // The image borrows the pixels; saving only reads them.
    const lx_image image = {.width = width, .height = height, .channels = 3, .type = LX_PIXEL_F32, .f32 = (float *)rgb};
    return save(path, &image, error);
}

lx_result lx_picture_save_bytes(const char *path, uint32_t width, uint32_t height, const uint8_t *rgb, lx_error *error)
{
    char extension[8];
    lx_path_extension(path, extension);
    if (strcmp(extension, "png") != 0)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%s: the name does not end with .png", path);
    const lx_image image = {.width = width, .height = height, .channels = 3, .type = LX_PIXEL_U8, .u8 = (uint8_t *)rgb};
    return save(path, &image, error);
}
