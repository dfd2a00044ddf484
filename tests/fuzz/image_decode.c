// Every decoder of src/image on arbitrary bytes; the format is chosen by the first ones. Small limit, so that runs are quick.
#include "image/image.h"
#include "image/ktx2.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    lx_image image = {0};
    lx_image_decode_limited(data, size, 1 << 18, &image, NULL);
    lx_image_release(&image);
    lx_ktx2 texture = {0};
    lx_ktx2_decode(data, size, &texture, NULL);
    lx_ktx2_release(&texture);
    return 0;
}
