// The baked folder appears whole or not at all, and nothing foreign is ever removed.
#define _POSIX_C_SOURCE 200809L // mkdtemp, symlink
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/memory.h"
#include "store/folder.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static char root[256], out_path[280], partial_path[300];

static int make_root(void **state)
{
    (void)state;
    const char *base = getenv("TMPDIR");
    snprintf(root, sizeof root, "%.200s/luxel-folder-XXXXXX", base ? base : "/tmp");
    if (!mkdtemp(root)) return -1;
    snprintf(out_path, sizeof out_path, "%s/out.baked", root);
    snprintf(partial_path, sizeof partial_path, "%s.partial", out_path);
    return 0;
}

static int remove_root(void **state)
{
    (void)state;
    return lx_folder_remove(root, NULL) == LX_OK ? 0 : -1;
}

static void put_file(const char *folder, const char *name, const char *text)
{
    char path[600];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    assert_int_equal(lx_file_write(path, text, strlen(text), NULL), LX_OK);
}

static bool has_file(const char *folder, const char *name, const char *text)
{
    char path[600];
    lx_bytes bytes = {0};
    snprintf(path, sizeof path, "%s/%s", folder, name);
    const bool same = lx_file_read(path, 1000, &bytes, NULL) == LX_OK && bytes.size == strlen(text) &&
                      (bytes.size == 0 || memcmp(bytes.data, text, bytes.size) == 0);
    lx_bytes_release(&bytes);
    return same;
}

static bool has(const char *folder, const char *name)
{
    char path[600];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return lx_path_exists(path);
}

static void bake_into(const char *folder, const char *content)
{
    lx_new_folder fresh = {0};
    assert_int_equal(lx_new_folder_begin(folder, &fresh, NULL), LX_OK);
    assert_int_equal(lx_new_folder_write(&fresh, "content", content, strlen(content), NULL), LX_OK);
    assert_int_equal(lx_new_folder_write(&fresh, LX_MANIFEST_NAME, "{}", 2, NULL), LX_OK);
    assert_int_equal(lx_new_folder_commit(&fresh, NULL), LX_OK);
    lx_new_folder_abort(&fresh);
}

static void commit_creates_and_replaces(void **state)
{
    (void)state;
    assert_false(lx_folder_is_baked(out_path));
    bake_into(out_path, "one");
    assert_true(lx_folder_is_baked(out_path));
    assert_true(has_file(out_path, "content", "one"));
    put_file(out_path, "extra", "x");
    char slashes[300];
    snprintf(slashes, sizeof slashes, "%s//", out_path);
    bake_into(slashes, "two");
    assert_true(has_file(out_path, "content", "two"));
    assert_false(has(out_path, "extra"));
    assert_false(has(out_path, ".luxel-partial"));
    assert_false(lx_path_exists(partial_path));
}

static void empty_folder_is_replaced(void **state)
{
    (void)state;
    assert_int_equal(lx_folder_create(out_path, NULL), LX_OK);
    assert_int_equal(lx_folder_check(out_path, NULL), LX_OK);
    bake_into(out_path, "one");
    assert_true(has_file(out_path, "content", "one"));
}

static void assert_refused(const char *folder, const char *told)
{
    lx_error error = {0};
    lx_new_folder fresh = {0};
    assert_int_equal(lx_new_folder_begin(folder, &fresh, &error), LX_ERROR_INVALID_ARGUMENT);
    if (!strstr(error.message, told)) fail_msg("'%s' does not say '%s'", error.message, told);
    assert_null(fresh.partial);
}

static void foreign_folder_is_refused_and_untouched(void **state)
{
    (void)state;
    assert_int_equal(lx_folder_create(out_path, NULL), LX_OK);
    put_file(out_path, "thesis.txt", "years of work");
    assert_refused(out_path, "holds no luxel.json");
    assert_int_equal(lx_folder_check(out_path, NULL), LX_ERROR_INVALID_ARGUMENT);
    assert_true(has_file(out_path, "thesis.txt", "years of work"));
    assert_false(lx_path_exists(partial_path));
}

static void folder_that_turns_foreign_during_the_bake_is_refused(void **state)
{
    (void)state;
    lx_new_folder fresh = {0};
    assert_int_equal(lx_new_folder_begin(out_path, &fresh, NULL), LX_OK);
    assert_int_equal(lx_new_folder_write(&fresh, LX_MANIFEST_NAME, "{}", 2, NULL), LX_OK);
    assert_int_equal(lx_folder_create(out_path, NULL), LX_OK);
    put_file(out_path, "thesis.txt", "years of work");
    assert_int_equal(lx_new_folder_commit(&fresh, NULL), LX_ERROR_INVALID_ARGUMENT);
    lx_new_folder_abort(&fresh);
    assert_true(has_file(out_path, "thesis.txt", "years of work"));
    assert_false(lx_path_exists(partial_path));
}

static void files_links_and_missing_parents_are_refused(void **state)
{
    (void)state;
    char path[400], target[400];
    put_file(root, "file", "text");
    snprintf(path, sizeof path, "%s/file", root);
    assert_refused(path, "is no folder");
    snprintf(path, sizeof path, "%s/missing/out", root);
    assert_refused(path, "does not exist");
    snprintf(target, sizeof target, "%s/target", root);
    bake_into(target, "kept");
    assert_int_equal(symlink(target, out_path), 0);
    assert_refused(out_path, "symbolic link");
    assert_true(has_file(target, "content", "kept"));
    snprintf(path, sizeof path, "%s/.", root);
    assert_refused(path, "name of its own");
    assert_refused("", "name of its own");
    assert_refused("/", "name of its own");
}

static void abort_keeps_the_old_result(void **state)
{
    (void)state;
    bake_into(out_path, "old");
    lx_new_folder fresh = {0};
    assert_int_equal(lx_new_folder_begin(out_path, &fresh, NULL), LX_OK);
    assert_int_equal(lx_new_folder_write(&fresh, "content", "new", 3, NULL), LX_OK);
    assert_true(has_file(out_path, "content", "old"));
    assert_int_equal(lx_new_folder_commit(&fresh, NULL), LX_ERROR_INVALID_ARGUMENT); // the manifest was never written
    assert_true(has_file(out_path, "content", "old"));
    lx_new_folder_abort(&fresh);
    assert_true(has_file(out_path, "content", "old"));
    assert_false(lx_path_exists(partial_path));
}

// Every file that can fail to be written: the old result stays, nothing half-written does.
static void failing_writes_keep_the_old_result(void **state)
{
    (void)state;
    bake_into(out_path, "old");
    lx_new_folder fresh = {0};
    lx_error error = {0};
    assert_int_equal(lx_new_folder_begin(out_path, &fresh, NULL), LX_OK);
    assert_int_equal(lx_new_folder_write(&fresh, "missing/content", "new", 3, &error), LX_ERROR_IO);
    assert_non_null(strstr(error.message, "out.baked.partial/missing/content: cannot write"));
    lx_new_folder_abort(&fresh);
    assert_true(has_file(out_path, "content", "old"));
    assert_false(lx_path_exists(partial_path));
}

static void partial_folder_of_a_killed_run_is_replaced(void **state)
{
    (void)state;
    bake_into(out_path, "old");
    lx_new_folder killed = {0};
    assert_int_equal(lx_new_folder_begin(out_path, &killed, NULL), LX_OK);
    assert_int_equal(lx_new_folder_write(&killed, "half", "ha", 2, NULL), LX_OK);
    lx_free(killed.path); // the process is gone, its folder is not
    lx_free(killed.partial);
    assert_true(has(partial_path, "half"));
    bake_into(out_path, "new");
    assert_true(has_file(out_path, "content", "new"));
    assert_false(has(out_path, "half"));
    assert_false(lx_path_exists(partial_path));

    assert_int_equal(lx_folder_create(partial_path, NULL), LX_OK); // killed right after it was created
    bake_into(out_path, "newer");
    assert_true(has_file(out_path, "content", "newer"));
}

static void foreign_partial_folder_is_refused(void **state)
{
    (void)state;
    assert_int_equal(lx_folder_create(partial_path, NULL), LX_OK);
    put_file(partial_path, "thesis.txt", "years of work");
    assert_refused(out_path, "in the way");
    assert_true(has_file(partial_path, "thesis.txt", "years of work"));
    assert_int_equal(lx_folder_remove(partial_path, NULL), LX_OK);
    assert_int_equal(symlink(root, partial_path), 0);
    assert_refused(out_path, "in the way");
}

static void folders_of_another_kind_are_known_by_their_own_mark(void **state)
{
    (void)state;
    lx_new_folder fresh = {0};
    lx_error error = {0};
    assert_int_equal(lx_new_folder_begin_marked(out_path, "mark", &fresh, &error), LX_OK);
    assert_int_equal(lx_new_folder_write(&fresh, LX_MANIFEST_NAME, "{}", 2, &error), LX_OK);
    assert_int_equal(lx_new_folder_commit(&fresh, &error), LX_ERROR_INVALID_ARGUMENT); // it lacks the mark
    assert_int_equal(lx_new_folder_write(&fresh, "mark", "1", 1, &error), LX_OK);
    assert_int_equal(lx_new_folder_commit(&fresh, &error), LX_OK);
    assert_int_equal(lx_folder_check_marked(out_path, "mark", &error), LX_OK);
    assert_int_equal(lx_folder_check_marked(out_path, "other", &error), LX_ERROR_INVALID_ARGUMENT);
    assert_non_null(strstr(error.message, "other"));
    assert_int_equal(lx_new_folder_begin_marked(out_path, "other", &fresh, &error), LX_ERROR_INVALID_ARGUMENT);
    assert_true(has_file(out_path, "mark", "1"));
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, make_root, remove_root)
    const struct CMUnitTest tests[] = {
        TEST(commit_creates_and_replaces),
        TEST(empty_folder_is_replaced),
        TEST(foreign_folder_is_refused_and_untouched),
        TEST(folder_that_turns_foreign_during_the_bake_is_refused),
        TEST(files_links_and_missing_parents_are_refused),
        TEST(abort_keeps_the_old_result),
        TEST(failing_writes_keep_the_old_result),
        TEST(partial_folder_of_a_killed_run_is_replaced),
        TEST(foreign_partial_folder_is_refused),
        TEST(folders_of_another_kind_are_known_by_their_own_mark),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
