// Texts that grow, numbers and base64 in them.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/builder.h"

#include <math.h>
#include <string.h>

static void builder_pieces_are_joined_in_order(void **state)
{
    (void)state;
    lx_builder b = {0};
    lx_builder_add(&b, "");
    assert_string_equal(b.text, "");
    for (int i = 0; i < 1000; ++i) lx_builder_format(&b, "%d,", i % 10);
    lx_builder_add_bytes(&b, "endless", 3);
    assert_false(b.failed);
    assert_int_equal(b.length, 2003);
    assert_int_equal(strlen(b.text), 2003);
    assert_string_equal(b.text + 1996, "8,9,end");
    lx_builder_release(&b);
    assert_null(b.text);
}

static void builder_impossible_size_fails_and_stays_failed(void **state)
{
    (void)state;
    lx_builder b = {0};
    lx_builder_add(&b, "x");
    lx_builder_base64(&b, "", SIZE_MAX / 2);
    assert_true(b.failed);
    lx_builder_add(&b, "y");
    assert_string_equal(b.text, "x");
    lx_builder_release(&b);
}

static void builder_base64_agrees_with_rfc_4648(void **state)
{
    (void)state;
    static const char *const cases[][2] = {{"", ""},           {"f", "Zg=="},         {"fo", "Zm8="},        {"foo", "Zm9v"},
                                           {"foob", "Zm9vYg=="}, {"fooba", "Zm9vYmE="}, {"foobar", "Zm9vYmFy"}, {"\xff\xfe\xfd", "//79"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        lx_builder b = {0};
        lx_builder_base64(&b, cases[i][0], strlen(cases[i][0]));
        assert_string_equal(b.text ? b.text : "", cases[i][1]);
        lx_builder_release(&b);
    }
}

static void builder_numbers_have_a_point_and_their_decimals(void **state)
{
    (void)state;
    lx_builder b = {0};
    lx_builder_number(&b, 1234.567, 1);
    lx_builder_add(&b, " ");
    lx_builder_number(&b, -0.5, 3);
    lx_builder_add(&b, " ");
    lx_builder_number(&b, 7, 0);
    assert_string_equal(b.text, "1234.6 -0.500 7");
    lx_builder_number(&b, 1.7e308, 2); // long, and whole
    assert_int_equal(b.length, 15 + 309 + 3);
    lx_builder_release(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(builder_pieces_are_joined_in_order),
        cmocka_unit_test(builder_impossible_size_fails_and_stays_failed),
        cmocka_unit_test(builder_base64_agrees_with_rfc_4648),
        cmocka_unit_test(builder_numbers_have_a_point_and_their_decimals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
