// What a browser may ask for: paths, hosts, types, tags and ranges.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "serve/request.h"

#include <stdio.h>
#include <string.h>

typedef struct path_case {
    const char *target;
    int status;
    lx_site_folder folder;
    const char *path;
} path_case;

static void expect_paths(const path_case *cases, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        char path[lx_request_path_bytes] = "untouched";
        lx_site_folder folder = LX_SITE_BAKED;
        const int status = lx_request_resolve(cases[i].target, &folder, path);
        if (status != cases[i].status) fail_msg("%s: %d instead of %d", cases[i].target, status, cases[i].status);
        if (strcmp(path, status == 200 ? cases[i].path : "untouched") != 0) fail_msg("%s: '%s'", cases[i].target, path);
        if (status == 200 && folder != cases[i].folder) fail_msg("%s: wrong folder", cases[i].target);
    }
}

static void resolve_good_targets_gives_folder_and_path(void **state)
{
    (void)state;
    static const path_case cases[] = {
        {"/", 200, LX_SITE_VIEWER, "index.html"},
        {"/?baked=x", 200, LX_SITE_VIEWER, "index.html"},
        {"/index.html#top", 200, LX_SITE_VIEWER, "index.html"},
        {"/assets/app-3f.js?v=../..", 200, LX_SITE_VIEWER, "assets/app-3f.js"},
        {"/baked/luxel.json", 200, LX_SITE_BAKED, "luxel.json"},
        {"/baked/a/b", 200, LX_SITE_BAKED, "a/b"},
        {"/baked/a%20%62.exr", 200, LX_SITE_BAKED, "a b.exr"},
        {"/baked/%C3%A9", 200, LX_SITE_BAKED, "\xc3\xa9"},
        {"/baked/a..b", 200, LX_SITE_BAKED, "a..b"},
        {"/baked/%252e", 200, LX_SITE_BAKED, "%2e"}, // unescaped once: a file that is called so
        {"/bakedx", 200, LX_SITE_VIEWER, "bakedx"},
        {"/x/baked/y", 200, LX_SITE_VIEWER, "x/baked/y"},
    };
    expect_paths(cases, sizeof cases / sizeof *cases);
}

static void resolve_paths_that_lead_elsewhere_are_refused(void **state)
{
    (void)state;
    static const path_case cases[] = {
        {"/..", 403, 0, ""},          {"/../x", 403, 0, ""},          {"/a/../x", 403, 0, ""},
        {"/%2e%2e/x", 403, 0, ""},    {"/.%2E/x", 403, 0, ""},        {"/baked/..", 403, 0, ""},
        {"/baked/../x", 403, 0, ""},  {"/baked/%2e%2e/x", 403, 0, ""}, {"/baked/%2e%2e%2fx", 403, 0, ""},
        {"/baked/a%2fb", 403, 0, ""}, {"/baked%2fa", 403, 0, ""},     {"/baked/a\\b", 403, 0, ""},
        {"/baked/a%5Cb", 403, 0, ""}, {"/baked/a%00", 403, 0, ""},    {"/%00", 403, 0, ""},
        {"/baked/a%0d%0ab", 403, 0, ""}, {"/baked/%7f", 403, 0, ""},  {"/baked/\x01", 403, 0, ""},
        {"/.work/x", 403, 0, ""},     {"/baked/.work/x", 403, 0, ""}, {"/baked/a/.b", 403, 0, ""},
        {"/./x", 403, 0, ""},         {"/baked/.", 403, 0, ""},       {"/baked//..", 403, 0, ""},
        {"/baked", 404, 0, ""},       {"/baked/", 404, 0, ""},        {"/baked?x", 404, 0, ""},
        {"/a/", 404, 0, ""},          {"//", 404, 0, ""},             {"//etc/passwd", 404, 0, ""},
        {"/baked//x", 404, 0, ""},    {"", 400, 0, ""},               {"x", 400, 0, ""},
        {"*", 400, 0, ""},            {"http://localhost/x", 400, 0, ""}, {"/%", 400, 0, ""},
        {"/%2", 400, 0, ""},          {"/%2g", 400, 0, ""},           {"/%g2", 400, 0, ""},
    };
    expect_paths(cases, sizeof cases / sizeof *cases);
}

static void resolve_longest_path_fits_and_one_more_byte_does_not(void **state)
{
    (void)state;
    char target[lx_request_path_bytes + 2], path[lx_request_path_bytes];
    lx_site_folder folder;
    memset(target, 'a', sizeof target);
    target[0] = '/';
    target[lx_request_path_bytes] = '\0'; // as many letters as fit beside the zero
    assert_int_equal(lx_request_resolve(target, &folder, path), 200);
    assert_int_equal(strlen(path), lx_request_path_bytes - 1);
    target[lx_request_path_bytes] = 'a';
    target[lx_request_path_bytes + 1] = '\0';
    assert_int_equal(lx_request_resolve(target, &folder, path), 404);
}

static void host_names_of_this_machine_pass_and_others_do_not(void **state)
{
    (void)state;
    static const char *const good[] = {"localhost", "LocalHost:8080", "127.0.0.1", "127.0.0.1:1", "[::1]", "[::1]:65535"};
    static const char *const bad[] = {"", "evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "localhost:", "localhost:80x",
                                      "localhost:123456", "localhost:80:80", "localhost ", " localhost", "127.0.0.2", "127.1", "0.0.0.0",
                                      "[::1", "::1", "[::1]x", "localhost@evil.example", "localhost,evil.example"};
    for (size_t i = 0; i < sizeof good / sizeof *good; ++i)
        if (!lx_request_host_is_loopback(good[i])) fail_msg("'%s' is refused", good[i]);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i)
        if (lx_request_host_is_loopback(bad[i])) fail_msg("'%s' passes", bad[i]);
}

static void content_type_follows_the_last_ending(void **state)
{
    (void)state;
    assert_string_equal(lx_request_content_type("scene.glb"), "model/gltf-binary");
    assert_string_equal(lx_request_content_type("a/b.HTML"), "text/html; charset=utf-8");
    assert_string_equal(lx_request_content_type("x.wasm"), "application/wasm");
    assert_string_equal(lx_request_content_type("x.ktx2"), "image/ktx2");
    assert_string_equal(lx_request_content_type("x.jpg.svg"), "image/svg+xml");
    static const char *const unknown[] = {"luxel.pack", "html", "x.", "x.htmlx", "x.ht", "a.html/b", ""};
    for (size_t i = 0; i < sizeof unknown / sizeof *unknown; ++i)
        assert_string_equal(lx_request_content_type(unknown[i]), "application/octet-stream");
}

static void etag_lists_match_whole_tags_only(void **state)
{
    (void)state;
    static const char tag[] = "\"1-2\"";
    static const char *const good[] = {"\"1-2\"", "W/\"1-2\"", "*", " \"x\" , \"1-2\"", "\"x\",W/\"1-2\"", "\"x\"\"1-2\""};
    static const char *const bad[] = {"", "1-2", "\"1-2", "\"1-\"", "\"1-22\"", "\"x\"", "x, \"1-2\"", ",,", "W/", "\""};
    for (size_t i = 0; i < sizeof good / sizeof *good; ++i)
        if (!lx_request_etag_matches(good[i], tag)) fail_msg("'%s' does not match", good[i]);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i)
        if (lx_request_etag_matches(bad[i], tag)) fail_msg("'%s' matches", bad[i]);
}

static void ranges_are_clipped_refused_or_ignored(void **state)
{
    (void)state;
    static const struct {
        const char *header;
        uint64_t size;
        int status;
        uint64_t first, last;
    } cases[] = {
        {"bytes=0-0", 10, 206, 0, 0},     {"bytes=2-5", 10, 206, 2, 5},      {"bytes=2-", 10, 206, 2, 9},
        {"bytes=2-99", 10, 206, 2, 9},    {"bytes=-3", 10, 206, 7, 9},       {"bytes=-99", 10, 206, 0, 9},
        {"BYTES=9-9", 10, 206, 9, 9},     {"bytes=10-", 10, 416, 0, 0},      {"bytes=10-12", 10, 416, 0, 0},
        {"bytes=-0", 10, 416, 0, 0},      {"bytes=0-", 0, 416, 0, 0},        {"bytes=-1", 0, 416, 0, 0},
        {"bytes=5-4", 10, 200, 0, 0},     {"bytes=0-1,3-4", 10, 200, 0, 0},  {"bytes=x-1", 10, 200, 0, 0},
        {"bytes=1-x", 10, 200, 0, 0},     {"bytes=--1", 10, 200, 0, 0},      {"bytes=1", 10, 200, 0, 0},
        {"bytes=", 10, 200, 0, 0},        {"", 10, 200, 0, 0},               {"items=0-1", 10, 200, 0, 0},
        {"bytes= 0-1", 10, 200, 0, 0},    {"bytes=18446744073709551616-", 10, 416, 0, 0},
        {"bytes=0-18446744073709551616", 10, 206, 0, 9}, {"bytes=0-", UINT64_MAX, 206, 0, UINT64_MAX - 1},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        uint64_t first = 0, last = 0;
        const int status = lx_request_range(cases[i].header, cases[i].size, &first, &last);
        if (status != cases[i].status || first != cases[i].first || last != cases[i].last)
            fail_msg("'%s' of %llu: %d, %llu to %llu", cases[i].header, (unsigned long long)cases[i].size, status,
                     (unsigned long long)first, (unsigned long long)last);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(resolve_good_targets_gives_folder_and_path),
        cmocka_unit_test(resolve_paths_that_lead_elsewhere_are_refused),
        cmocka_unit_test(resolve_longest_path_fits_and_one_more_byte_does_not),
        cmocka_unit_test(host_names_of_this_machine_pass_and_others_do_not),
        cmocka_unit_test(content_type_follows_the_last_ending),
        cmocka_unit_test(etag_lists_match_whole_tags_only),
        cmocka_unit_test(ranges_are_clipped_refused_or_ignored),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
