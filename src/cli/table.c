#include "table.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

enum { cell_size = 160, column_max = 24, list_shown_max = 8 };

// Columns that a text takes on a terminal: its code points. Names in other scripts line up well enough.
static int text_columns(const char *text)
{
    int count = 0;
    for (; *text; ++text) count += ((unsigned char)*text & 0xc0) != 0x80;
    return count;
}

static void append(char out[cell_size], const char *text)
{
    const size_t used = strlen(out);
    snprintf(out + used, cell_size - used, "%s", text);
}

static void format_value(char out[cell_size], const json_t *value)
{
    out[0] = '\0';
    switch (json_typeof(value)) {
    case JSON_STRING: {
        snprintf(out, cell_size, "%s", json_string_value(value));
        for (char *c = out; *c; ++c) // a name in a file must not steer the terminal
            if ((unsigned char)*c < 0x20 || *c == 0x7f) *c = '?';
        break;
    }
    case JSON_INTEGER: snprintf(out, cell_size, "%lld", (long long)json_integer_value(value)); break;
    case JSON_REAL: snprintf(out, cell_size, "%.5g", json_real_value(value) + 0.0); break; // + 0.0: no "-0"
    case JSON_TRUE: append(out, "yes"); break;
    case JSON_FALSE: append(out, "no"); break;
    case JSON_NULL: append(out, "-"); break;
    case JSON_ARRAY: {
        size_t i;
        json_t *item;
        json_array_foreach(value, i, item)
        {
            if (i == list_shown_max) {
                append(out, " ...");
                break;
            }
            char cell[cell_size];
            format_value(cell, item);
            if (i) append(out, json_is_string(item) ? ", " : " ");
            append(out, cell);
        }
        break;
    }
    case JSON_OBJECT: {
        const char *key;
        json_t *item;
        json_object_foreach((json_t *)value, key, item)
        {
            char cell[cell_size];
            format_value(cell, item);
            if (out[0]) append(out, ", ");
            append(out, key);
            append(out, " ");
            append(out, cell);
        }
        break;
    }
    }
}

static void print_cell(const char *text, int width, bool right, bool last)
{
    const int blanks = width - text_columns(text);
    if (right)
        printf("  %*s%s", blanks > 0 ? blanks : 0, "", text);
    else
        printf("  %s%*s", text, last || blanks < 0 ? 0 : blanks, "");
}

// A column for every key, in the order in which the rows bring them.
static void print_table(const json_t *rows)
{
    const char *keys[column_max];
    int widths[column_max];
    bool numbers[column_max];
    size_t key_count = 0, i;
    json_t *row;
    json_array_foreach(rows, i, row)
    {
        const char *key;
        json_t *value;
        json_object_foreach(row, key, value)
        {
            size_t k = 0;
            while (k < key_count && strcmp(keys[k], key) != 0) ++k;
            if (k == key_count) {
                if (key_count == column_max) continue;
                keys[k] = key;
                widths[k] = text_columns(key);
                numbers[k] = true;
                ++key_count;
            }
            char cell[cell_size];
            format_value(cell, value);
            if (text_columns(cell) > widths[k]) widths[k] = text_columns(cell);
            numbers[k] &= json_is_number(value) || json_is_null(value);
        }
    }
    for (size_t k = 0; k < key_count; ++k) print_cell(keys[k], widths[k], numbers[k], k + 1 == key_count);
    putchar('\n');
    json_array_foreach(rows, i, row)
    {
        for (size_t k = 0; k < key_count; ++k) {
            char cell[cell_size] = "";
            const json_t *const value = json_object_get(row, keys[k]);
            if (value) format_value(cell, value);
            print_cell(cell, widths[k], numbers[k], k + 1 == key_count);
        }
        putchar('\n');
    }
}

static bool is_section(const json_t *value)
{
    if (json_is_object(value)) return true;
    if (!json_is_array(value)) return false;
    return json_array_size(value) > 0 && !json_is_number(json_array_get(value, 0));
}

static void print_lines(const json_t *object, const char *indent)
{
    int width = 0;
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)object, key, value)
        if (!is_section(value) && text_columns(key) > width) width = text_columns(key);
    json_object_foreach((json_t *)object, key, value)
    {
        if (is_section(value)) continue;
        char cell[cell_size];
        format_value(cell, value);
        if (json_is_array(value) && json_array_size(value) == 0) append(cell, "none");
        printf("%s%s%*s  %s\n", indent, key, width - text_columns(key), "", cell);
    }
}

static void print_section(const char *name, const json_t *value)
{
    if (json_is_object(value)) {
        printf("\n%s\n", name);
        print_lines(value, "  ");
        const char *key;
        json_t *item;
        json_object_foreach((json_t *)value, key, item)
        {
            char title[cell_size];
            snprintf(title, sizeof title, "%.60s %.60s", name, key);
            if (is_section(item)) print_section(title, item);
        }
        return;
    }
    printf("\n%s (%zu)\n", name, json_array_size(value));
    if (json_is_object(json_array_get(value, 0))) {
        print_table(value);
        return;
    }
    size_t i;
    json_t *item;
    json_array_foreach(value, i, item)
    {
        char cell[cell_size];
        format_value(cell, item);
        printf("  %s\n", json_is_string(item) ? json_string_value(item) : cell);
    }
}

void cli_print_document(const json_t *object)
{
    print_lines(object, "");
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)object, key, value)
        if (is_section(value)) print_section(key, value);
}
