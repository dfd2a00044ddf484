#include "base/builder.h"

#include "base/memory.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void lx_builder_release(lx_builder *builder)
{
    lx_free(builder->text);
    *builder = (lx_builder){0};
}

// Room for `length` more bytes and a zero.
static char *extend(lx_builder *builder, size_t length)
{
    size_t needed;
    if (builder->failed || !lx_add_size(builder->length, length, &needed) || !lx_add_size(needed, 1, &needed) ||
        !lx_array_reserve(&builder->text, &builder->capacity, needed, 1)) {
        builder->failed = true;
        return NULL;
    }
    char *end = builder->text + builder->length;
    builder->length += length;
    builder->text[builder->length] = '\0';
    return end;
}

void lx_builder_add_bytes(lx_builder *builder, const char *text, size_t length)
{
    char *end = extend(builder, length);
    if (end) memcpy(end, text, length);
}

void lx_builder_add(lx_builder *builder, const char *text)
{
    lx_builder_add_bytes(builder, text, strlen(text));
}

void lx_builder_format(lx_builder *builder, const char *format, ...)
{
    va_list arguments, again;
    va_start(arguments, format);
    va_copy(again, arguments);
    const int length = vsnprintf(NULL, 0, format, arguments);
    char *end = length < 0 ? NULL : extend(builder, (size_t)length);
    if (end)
        vsnprintf(end, (size_t)length + 1, format, again);
    else
        builder->failed = true;
    va_end(again);
    va_end(arguments);
}

void lx_builder_number(lx_builder *builder, double value, int decimals)
{
    char digits[400]; // the largest double has 309 before the point
    snprintf(digits, sizeof digits, "%.*f", decimals < 30 ? decimals : 30, value);
    for (char *c = digits; *c; ++c)
        if (*c == ',') *c = '.';
    lx_builder_add(builder, digits);
}

void lx_builder_base64(lx_builder *builder, const void *data, size_t size)
{
    static const char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const uint8_t *bytes = data;
    if (size > SIZE_MAX / 4) {
        builder->failed = true;
        return;
    }
    char *end = extend(builder, (size + 2) / 3 * 4);
    if (!end) return;
    for (size_t i = 0; i < size; i += 3, end += 4) {
        const uint32_t triple = (uint32_t)bytes[i] << 16 | (i + 1 < size ? (uint32_t)bytes[i + 1] << 8 : 0) | (i + 2 < size ? bytes[i + 2] : 0);
        end[0] = letters[triple >> 18];
        end[1] = letters[triple >> 12 & 63];
        end[2] = i + 1 < size ? letters[triple >> 6 & 63] : '=';
        end[3] = i + 2 < size ? letters[triple & 63] : '=';
    }
}
