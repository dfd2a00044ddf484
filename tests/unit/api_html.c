// Names of others in HTML.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "api/html.h"

#include <string.h>

#define R "\xef\xbf\xbd"

static void html_text_markup_is_escaped_and_broken_utf8_replaced(void **state)
{
    (void)state;
    static const char *const cases[][2] = {
        {"lamp 1", "lamp 1"},
        {"</script><img src=x onerror='a'>", "&lt;/script&gt;&lt;img src=x onerror=&#39;a&#39;&gt;"},
        {"a & b &amp; \"c\"", "a &amp; b &amp;amp; &quot;c&quot;"},
        {"Stra\xc3\x9f" "e \xe2\x82\xac \xf0\x9f\x92\xa1", "Stra\xc3\x9f" "e \xe2\x82\xac \xf0\x9f\x92\xa1"},
        {"a\nb\tc\x7f", "a" R "b" R "c" R},
        {"\x80\xff", R R},
        {"\xc3", R},                        // cut off
        {"\xc3<", R "&lt;"},                // what follows is no part of it
        {"\xe2\x82", R R},
        {"\xf0\x9f\x92", R R R},
        {"\xc0\xbc", R R},                  // '<' in two bytes
        {"\xe0\x80\xbc", R R R},            // and in three
        {"\xed\xa0\x80", R R R},            // a surrogate
        {"\xf4\x90\x80\x80", R R R R},      // beyond Unicode
        {"\xc2\x85", R},                    // a control character
        {"a\xe2\x80\xae" "b", "a" R "b"},   // right-to-left override
        {"\xef\xbb\xbf", R},
        {"\xef\xbf\xbf", R},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        lx_builder html = {0};
        lx_html_text(&html, cases[i][0]);
        if (strcmp(html.text, cases[i][1]) != 0) fail_msg("case %zu: '%s' gives '%s'", i, cases[i][0], html.text);
        lx_builder_release(&html);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(html_text_markup_is_escaped_and_broken_utf8_replaced)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
