#define _POSIX_C_SOURCE 200809L // mkdtemp
#include "base/file.h"
#include "base/scratch.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static void count_name(void *user, const char *name)
{
    (void)name;
    ++*(int *)user;
}

static void parts_come_back_from_where_they_were_put_and_no_name_is_left(void **state)
{
    (void)state;
    const char *base = getenv("TMPDIR");
    char folder[300], back[6];
    snprintf(folder, sizeof folder, "%.200s/luxel-scratch-XXXXXX", base ? base : "/tmp");
    assert_non_null(mkdtemp(folder));
    lx_scratch *scratch = NULL;
    assert_int_equal(lx_scratch_create(folder, &scratch, NULL), LX_OK);
    const uint64_t far = (uint64_t)5 << 30; // beyond 32 bits; what lies between takes no room
    assert_int_equal(lx_scratch_write(scratch, far, "second", 6, NULL), LX_OK);
    assert_int_equal(lx_scratch_write(scratch, 3, "first", 5, NULL), LX_OK);
    assert_int_equal(lx_scratch_read(scratch, far, back, 6, NULL), LX_OK);
    assert_memory_equal(back, "second", 6);
    assert_int_equal(lx_scratch_read(scratch, 3, back, 5, NULL), LX_OK);
    assert_memory_equal(back, "first", 5);

    lx_error error = {0};
    assert_int_equal(lx_scratch_read(scratch, far, back, 7, &error), LX_ERROR_IO);
    assert_non_null(strstr(error.message, "it ends too early"));
    int names = 0; // while it is open: whatever ends the process now, nothing stays
    assert_int_equal(lx_folder_list(folder, count_name, &names, NULL), LX_OK);
    assert_int_equal(names, 0);
    lx_scratch_destroy(scratch);
    assert_int_equal(lx_folder_remove(folder, NULL), LX_OK);
}

static void a_folder_that_is_not_there_is_named(void **state)
{
    (void)state;
    lx_scratch *scratch = NULL;
    lx_error error = {0};
    assert_int_equal(lx_scratch_create("/nowhere/at/all", &scratch, &error), LX_ERROR_IO);
    assert_non_null(strstr(error.message, "cannot create a temporary file in /nowhere/at/all: No such file"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(parts_come_back_from_where_they_were_put_and_no_name_is_left),
        cmocka_unit_test(a_folder_that_is_not_there_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
