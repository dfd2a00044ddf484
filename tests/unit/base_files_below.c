// Files that are opened, walked and copied below a folder which others may have filled.
#define _POSIX_C_SOURCE 200809L // mkdtemp, symlink
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/builder.h"
#include "base/error.h"
#include "base/file.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static char root[256], folder[300];

static char *below(const char *name)
{
    static char path[2][400];
    static int turn;
    turn ^= 1;
    snprintf(path[turn], sizeof path[turn], "%s/%s", root, name);
    return path[turn];
}

static void put(const char *name, const char *text)
{
    assert_int_equal(lx_file_write(below(name), text, strlen(text), NULL), LX_OK);
}

// secret, folder/{a, empty, sub/{b, .hidden}, link → ../secret, up → .., pipe}
static int setup(void **state)
{
    (void)state;
    const char *base = getenv("TMPDIR");
    snprintf(root, sizeof root, "%.200s/luxel-below-XXXXXX", base ? base : "/tmp");
    if (!mkdtemp(root)) return -1;
    snprintf(folder, sizeof folder, "%s/folder", root);
    if (mkdir(folder, 0777) != 0 || mkdir(below("folder/sub"), 0777) != 0) return -1;
    put("secret", "secret");
    put("folder/a", "content of a");
    put("folder/empty", "");
    put("folder/sub/b", "b");
    put("folder/sub/.hidden", "h");
    return symlink("../secret", below("folder/link")) || symlink("..", below("folder/up")) || symlink("sub", below("folder/within")) ||
           mkfifo(below("folder/pipe"), 0666);
}

static int teardown(void **state)
{
    (void)state;
    return lx_folder_remove(root, NULL) == LX_OK ? 0 : -1;
}

static void open_below_regular_files_gives_size_and_identity(void **state)
{
    (void)state;
    lx_open_file a = {.handle = -1}, b = {.handle = -1}, again = {.handle = -1};
    lx_error error = {0};
    assert_int_equal(lx_file_open_below(folder, "a", &a, &error), LX_OK);
    assert_int_equal(lx_file_open_below(folder, "sub/b", &b, &error), LX_OK);
    assert_int_equal(lx_file_open_below(folder, "a", &again, &error), LX_OK);
    assert_int_equal(a.size, 12);
    assert_int_equal(b.size, 1);
    assert_true(a.number != b.number && a.number == again.number && a.modified_ns == again.modified_ns && a.modified_ns > 0);
    lx_open_file_close(&a);
    lx_open_file_close(&b);
    lx_open_file_close(&again);
    assert_int_equal(a.handle, -1);
    lx_open_file_close(&a);
    assert_int_equal(lx_file_open_below(below("folder/within"), "b", &b, &error), LX_OK); // the folder itself may be a link
    lx_open_file_close(&b);
}

static void open_below_whatever_leads_elsewhere_is_refused(void **state)
{
    (void)state;
    static const char *const names[] = {"", ".", "..", "../secret", "sub/../../secret", "sub/..", "./a", "/a", "a/", "sub//b", "sub", "sub/",
                                        "link", "up/secret", "up/folder/a", "within/b", "pipe", "missing", "a/b", "...", "sub/./b"};
    for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
        lx_open_file file = {.handle = -77};
        lx_error error = {0};
        const lx_result result = lx_file_open_below(folder, names[i], &file, &error);
        if (result == LX_OK || file.handle != -77) fail_msg("'%s' was opened", names[i]);
        if (!error.message[0]) fail_msg("'%s': no message", names[i]);
    }
    char longest[300];
    memset(longest, 'a', sizeof longest - 1);
    longest[sizeof longest - 1] = '\0';
    lx_open_file file;
    assert_int_not_equal(lx_file_open_below(folder, longest, &file, NULL), LX_OK);
    assert_int_not_equal(lx_file_open_below(below("nowhere"), "a", &file, NULL), LX_OK);
}

static void copy_open_file_never_overwrites(void **state)
{
    (void)state;
    lx_open_file file;
    lx_bytes bytes = {0};
    lx_error error = {0};
    assert_int_equal(lx_file_open_below(folder, "a", &file, &error), LX_OK);
    assert_int_equal(lx_open_file_copy(&file, below("copy"), &error), LX_OK);
    lx_open_file_close(&file);
    assert_int_equal(lx_file_read(below("copy"), 100, &bytes, &error), LX_OK);
    assert_int_equal(bytes.size, 12);
    assert_memory_equal(bytes.data, "content of a", 12);
    lx_bytes_release(&bytes);
    assert_int_equal(lx_file_open_below(folder, "empty", &file, &error), LX_OK);
    assert_int_equal(lx_open_file_copy(&file, below("copy"), &error), LX_ERROR_IO);
    assert_int_equal(lx_open_file_copy(&file, below("empty copy"), &error), LX_OK);
    lx_open_file_close(&file);
    assert_int_equal(lx_file_bytes(below("copy")), 12);
    assert_int_equal(lx_file_bytes(below("empty copy")), 0);
    assert_int_equal(lx_file_bytes(folder), 0);
    assert_int_equal(lx_file_bytes(below("missing")), 0);
}

static lx_result note(void *user, const char *path, bool is_folder, lx_error *error)
{
    (void)error;
    lx_builder_format(user, "%s%s ", path, is_folder ? "/" : "");
    return LX_OK;
}

static lx_result stop_at_link(void *user, const char *path, bool is_folder, lx_error *error)
{
    (void)is_folder;
    lx_builder_add(user, path);
    return strcmp(path, "link") == 0 ? lx_fail(error, LX_ERROR_LIMIT, "enough") : LX_OK;
}

static void walk_lists_everything_sorted_and_follows_no_link(void **state)
{
    (void)state;
    lx_builder seen = {0};
    lx_error error = {0};
    assert_int_equal(lx_folder_walk(folder, note, &seen, &error), LX_OK);
    assert_string_equal(seen.text, "a empty link pipe sub/ sub/.hidden sub/b up within ");
    lx_builder_release(&seen);
    assert_int_equal(lx_folder_walk(folder, stop_at_link, &seen, &error), LX_ERROR_LIMIT);
    assert_string_equal(seen.text, "aemptylink");
    assert_string_equal(error.message, "enough");
    lx_builder_release(&seen);
    assert_int_not_equal(lx_folder_walk(below("nowhere"), note, &seen, &error), LX_OK);
    lx_builder_release(&seen);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(open_below_regular_files_gives_size_and_identity),
        cmocka_unit_test(open_below_whatever_leads_elsewhere_is_refused),
        cmocka_unit_test(copy_open_file_never_overwrites),
        cmocka_unit_test(walk_lists_everything_sorted_and_follows_no_link),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
