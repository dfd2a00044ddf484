/// Small glTF files made in memory, and what the importer logs about them.
///
/// JSON is written with ' instead of ", for the sake of readable C.
#ifndef LX_TEST_SCENE_FIXTURE_H
#define LX_TEST_SCENE_FIXTURE_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "base/context.h"
#include "scene/gltf.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static lx_context *fixture_context;
static char fixture_log[65536];    ///< "note: …\n" and "warning: …\n" since the last import.
static uint8_t fixture_bin[65536]; ///< Buffer 0 of the next import.
static size_t fixture_bin_size;

static void fixture_on_log(void *user, lx_log_level level, const char *message)
{
    (void)user;
    const size_t length = strlen(fixture_log);
    snprintf(fixture_log + length, sizeof fixture_log - length, "%s: %s\n",
             level == LX_LOG_WARNING ? "warning" : "note", message);
}

static int fixture_setup(void **state)
{
    (void)state;
    lx_context_desc desc = lx_context_desc_default();
    desc.thread_count = 2;
    desc.logger = (lx_logger){.func = fixture_on_log};
    return lx_context_create(&desc, &fixture_context, NULL) == LX_OK ? 0 : -1;
}

static int fixture_teardown(void **state)
{
    (void)state;
    lx_context_destroy(fixture_context);
    return 0;
}

static inline void bin_clear(void) { fixture_bin_size = 0; }

static inline size_t bin_bytes(const void *data, size_t size)
{
    const size_t offset = fixture_bin_size;
    memcpy(fixture_bin + offset, data, size);
    fixture_bin_size += size;
    while (fixture_bin_size % 4) fixture_bin[fixture_bin_size++] = 0;
    return offset;
}

#define BIN_FLOATS(...) bin_bytes((const float[]){__VA_ARGS__}, sizeof((const float[]){__VA_ARGS__}))
#define BIN_U8(...) bin_bytes((const uint8_t[]){__VA_ARGS__}, sizeof((const uint8_t[]){__VA_ARGS__}))
#define BIN_U16(...) bin_bytes((const uint16_t[]){__VA_ARGS__}, sizeof((const uint16_t[]){__VA_ARGS__}))
#define BIN_U32(...) bin_bytes((const uint32_t[]){__VA_ARGS__}, sizeof((const uint32_t[]){__VA_ARGS__}))

static inline void append_base64(char *out, const uint8_t *data, size_t size)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    out += strlen(out);
    for (size_t i = 0; i < size; i += 3) {
        const uint32_t bits = (uint32_t)data[i] << 16 | (i + 1 < size ? (uint32_t)data[i + 1] << 8 : 0) |
                              (i + 2 < size ? data[i + 2] : 0u);
        *out++ = digits[bits >> 18];
        *out++ = digits[bits >> 12 & 63];
        *out++ = i + 1 < size ? digits[bits >> 6 & 63] : '=';
        *out++ = i + 2 < size ? digits[bits & 63] : '=';
    }
    *out = '\0';
}

/// The file with `members` (with ' for ") beside asset and buffers; free it.
static inline char *make_gltf(const char *members)
{
    char *text = malloc(strlen(members) + 2 * fixture_bin_size + 512);
    sprintf(text, "{\"asset\":{\"version\":\"2.0\"}");
    if (fixture_bin_size) {
        sprintf(text + strlen(text),
                ",\"buffers\":[{\"byteLength\":%zu,\"uri\":\"data:application/octet-stream;base64,", fixture_bin_size);
        append_base64(text, fixture_bin, fixture_bin_size);
        strcat(text, "\"}]");
    }
    char *at = text + strlen(text);
    if (members[0]) sprintf(at, ",%s", members);
    for (; *at; ++at)
        if (*at == '\'') *at = '"';
    strcat(text, "}");
    return text;
}

static inline lx_result import_text(const char *text, size_t size, lx_scene **scene, lx_error *error)
{
    fixture_log[0] = '\0';
    *scene = NULL;
    memset(error, 0, sizeof *error);
    return lx_gltf_import(fixture_context, "t.gltf", NULL, text, size, NULL, scene, error);
}

/// Imports and fails the test if that fails.
static inline lx_scene *import_members(const char *members)
{
    lx_scene *scene;
    lx_error error;
    char *text = make_gltf(members);
    const lx_result result = import_text(text, strlen(text), &scene, &error);
    free(text);
    if (result != LX_OK) fail_msg("refused: %s", error.message);
    return scene;
}

/// Fails the test unless the import fails with that code and a message that starts with "t.gltf: " + `start`.
static inline void assert_refused(const char *members, lx_result code, const char *start)
{
    lx_scene *scene;
    lx_error error;
    char *text = make_gltf(members);
    const lx_result result = import_text(text, strlen(text), &scene, &error);
    free(text);
    if (result == LX_OK) {
        lx_scene_destroy(scene);
        fail_msg("not refused; expected: %s", start);
    }
    if (result != code || strncmp(error.message, "t.gltf: ", 8) != 0 ||
        strncmp(error.message + 8, start, strlen(start)) != 0)
        fail_msg("expected %d 't.gltf: %s', got %d '%s'", code, start, result, error.message);
}

static inline void assert_logged(const char *part)
{
    if (!strstr(fixture_log, part)) fail_msg("not logged: '%s'; but:\n%s", part, fixture_log);
}

static inline void assert_not_logged(const char *part)
{
    if (strstr(fixture_log, part)) fail_msg("logged: '%s' in:\n%s", part, fixture_log);
}

static inline void assert_near(double actual, double expected, double tolerance)
{
    if (!(fabs(actual - expected) <= tolerance)) fail_msg("%.9g is not %.9g within %g", actual, expected, tolerance);
}

static inline void assert_vec3(lx_vec3 actual, float x, float y, float z)
{
    if (!(fabsf(actual.x - x) <= 1e-5f && fabsf(actual.y - y) <= 1e-5f && fabsf(actual.z - z) <= 1e-5f))
        fail_msg("(%g %g %g) is not (%g %g %g)", (double)actual.x, (double)actual.y, (double)actual.z, (double)x,
                 (double)y, (double)z);
}

/// A triangle (0,0,0) (1,0,0) (0,1,0) as mesh 0, 'tri'; what follows adds to it.
#define TRIANGLE_DATA                                                                                                  \
    "'bufferViews':[{'buffer':0,'byteLength':36}],'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':" \
    "'VEC3'}]"
#define TRIANGLE TRIANGLE_DATA ",'meshes':[{'name':'tri','primitives':[{'attributes':{'POSITION':0}}]}]"
/// The same with material 0.
#define TRIANGLE_MATERIAL                                                                                              \
    TRIANGLE_DATA ",'meshes':[{'name':'tri','primitives':[{'attributes':{'POSITION':0},'material':0}]}]"
#define ONE_NODE ",'nodes':[{'mesh':0}]"

static inline void triangle_bin(void)
{
    bin_clear();
    BIN_FLOATS(0, 0, 0, 1, 0, 0, 0, 1, 0);
}

/// Imports TRIANGLE with `more` behind it.
static inline lx_scene *import_triangle(const char *more)
{
    triangle_bin();
    char *members = malloc(strlen(more) + sizeof TRIANGLE);
    sprintf(members, "%s%s", TRIANGLE, more);
    lx_scene *scene = import_members(members);
    free(members);
    return scene;
}

static inline void assert_triangle_refused(const char *more, lx_result code, const char *start)
{
    triangle_bin();
    char *members = malloc(strlen(more) + sizeof TRIANGLE);
    sprintf(members, "%s%s", TRIANGLE, more);
    assert_refused(members, code, start);
    free(members);
}

static inline const lx_source *source_named(const lx_scene *scene, const char *name)
{
    for (uint32_t i = 0; i < scene->source_count; ++i)
        if (strcmp(scene->sources[i].name, name) == 0) return &scene->sources[i];
    fail_msg("no source '%s'", name);
    return NULL;
}

#endif
