/// A text that grows at its end. After a failed allocation every call does nothing, so one check at the end is enough.
#ifndef LX_BASE_BUILDER_H
#define LX_BASE_BUILDER_H

#include "luxel/base.h"

/// All zero: empty.
typedef struct lx_builder {
    char *text; ///< Owned; ends with a zero. NULL when nothing was added.
    size_t length, capacity;
    bool failed;
} lx_builder;

void lx_builder_release(lx_builder *builder);
void lx_builder_add(lx_builder *builder, const char *text);
void lx_builder_add_bytes(lx_builder *builder, const char *text, size_t length);
void lx_builder_format(lx_builder *builder, const char *format, ...) LX_PRINTF(2, 3);
/// `value` with `decimals` digits after a point, whatever the locale says.
void lx_builder_number(lx_builder *builder, double value, int decimals);
/// As base64 with padding (RFC 4648), in one line.
void lx_builder_base64(lx_builder *builder, const void *data, size_t size);

#endif
