#include "api/html.h"

// Length of the UTF-8 sequence at `text` and its code point; 0: there is none (RFC 3629: no surrogates, nothing longer than needed).
static size_t read_utf8(const unsigned char *text, uint32_t *out)
{
    static const uint32_t smallest[] = {0, 0, 0x80, 0x800, 0x10000};
    const size_t length = text[0] < 0x80 ? 1 : text[0] >= 0xc2 && text[0] < 0xe0 ? 2 : text[0] >= 0xe0 && text[0] < 0xf0 ? 3
                          : text[0] >= 0xf0 && text[0] < 0xf5 ? 4 : 0;
    if (length == 0) return 0;
    uint32_t code = length == 1 ? text[0] : text[0] & (0xffu >> (length + 1));
    for (size_t i = 1; i < length; ++i) {
        if ((text[i] & 0xc0) != 0x80) return 0;
        code = code << 6 | (text[i] & 0x3f);
    }
    if (code < smallest[length] || code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) return 0;
    *out = code;
    return length;
}

static bool is_invisible(uint32_t code)
{
    return code < 0x20 || (code >= 0x7f && code < 0xa0) || code == 0x200e || code == 0x200f || code == 0x2028 || code == 0x2029 ||
           (code >= 0x202a && code <= 0x202e) || (code >= 0x2066 && code <= 0x2069) || code == 0xfeff || (code & 0xfffe) == 0xfffe;
}

void lx_html_text(lx_builder *html, const char *text)
{
    for (const unsigned char *c = (const unsigned char *)text; *c;) {
        uint32_t code = 0;
        const size_t length = read_utf8(c, &code);
        if (length == 0 || is_invisible(code))
            lx_builder_add(html, "\xef\xbf\xbd");
        else if (code == '&')
            lx_builder_add(html, "&amp;");
        else if (code == '<')
            lx_builder_add(html, "&lt;");
        else if (code == '>')
            lx_builder_add(html, "&gt;");
        else if (code == '"')
            lx_builder_add(html, "&quot;");
        else if (code == '\'')
            lx_builder_add(html, "&#39;");
        else
            lx_builder_add_bytes(html, (const char *)c, length);
        c += length ? length : 1;
    }
}
