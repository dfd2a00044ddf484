#define _DEFAULT_SOURCE // madvise
#include "base/memory.h"

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#if defined(__GLIBC__)
#include <malloc.h>
#endif
#if defined(__linux__)
#include <sys/mman.h>
#endif

bool lx_mul_size(size_t a, size_t b, size_t *out)
{
    if (b != 0 && a > SIZE_MAX / b) return false;
    *out = a * b;
    return true;
}

bool lx_add_size(size_t a, size_t b, size_t *out)
{
    if (a > SIZE_MAX - b) return false;
    *out = a + b;
    return true;
}

// Large arrays are read all over: pages of 2 MiB spare most misses of address translation, and most of the faults of the first touch.
static void *with_large_pages(void *memory, size_t bytes)
{
#if defined(__linux__) && defined(MADV_HUGEPAGE)
    enum { page = 2 << 20, least = 4 << 20 };
    if (memory && bytes >= least) {
        const uintptr_t begin = ((uintptr_t)memory + page - 1) & ~(uintptr_t)(page - 1), end = ((uintptr_t)memory + bytes) & ~(uintptr_t)(page - 1);
        if (end > begin) (void)madvise((void *)begin, end - begin, MADV_HUGEPAGE); // a wish: all is well without
    }
#else
    (void)bytes;
#endif
    return memory;
}

void *lx_malloc_array(size_t count, size_t size)
{
    size_t bytes;
    if (!lx_mul_size(count, size, &bytes)) return NULL;
    // Cache lines hold whole elements where their size divides a line.
    const size_t line = 64;
    if (bytes >= line && bytes <= SIZE_MAX - line) return with_large_pages(aligned_alloc(line, (bytes + line - 1) / line * line), bytes);
    return malloc(bytes ? bytes : 1);
}

void *lx_calloc_array(size_t count, size_t size)
{
    size_t bytes;
    if (!lx_mul_size(count, size, &bytes)) return NULL;
    return with_large_pages(calloc(1, bytes ? bytes : 1), bytes);
}

void lx_free(void *memory)
{
    free(memory);
}

void lx_trim_memory(void)
{
#if defined(__GLIBC__)
    malloc_trim(0);
#endif
}

char *lx_strndup(const char *text, size_t length)
{
    size_t actual = 0;
    while (actual < length && text[actual]) ++actual;
    char *copy = malloc(actual + 1);
    if (!copy) return NULL;
    memcpy(copy, text, actual);
    copy[actual] = '\0';
    return copy;
}

char *lx_strdup(const char *text)
{
    return lx_strndup(text, SIZE_MAX);
}

char *lx_format(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(NULL, 0, format, arguments);
    va_end(arguments);
    if (length < 0) return NULL;
    char *text = malloc((size_t)length + 1);
    if (!text) return NULL;
    va_start(arguments, format);
    vsnprintf(text, (size_t)length + 1, format, arguments);
    va_end(arguments);
    return text;
}

bool lx_array_reserve(void *array_pointer, size_t *capacity, size_t count, size_t size)
{
    if (count <= *capacity) return true;
    size_t wanted = *capacity + *capacity / 2;
    if (wanted < count) wanted = count;
    if (wanted < 16) wanted = 16;
    size_t bytes;
    if (!lx_mul_size(wanted, size, &bytes)) return false;
    void *old;
    memcpy(&old, array_pointer, sizeof old);
    void *grown = realloc(old, bytes);
    if (!grown) return false;
    memcpy(array_pointer, &grown, sizeof grown);
    *capacity = wanted;
    return true;
}

struct lx_arena_block {
    lx_arena_block *next;
    size_t padding; // keeps the payload 16-byte aligned
};

enum { arena_block_bytes = 64 * 1024, arena_alignment = 16 };

void *lx_arena_alloc(lx_arena *arena, size_t count, size_t size)
{
    size_t bytes;
    if (!lx_mul_size(count, size, &bytes) || bytes > SIZE_MAX / 2) return NULL;
    bytes = (bytes + arena_alignment - 1) / arena_alignment * arena_alignment;
    if (!arena->blocks || arena->size - arena->used < bytes) {
        const size_t block_bytes = bytes > arena_block_bytes ? bytes : arena_block_bytes;
        lx_arena_block *block = calloc(1, sizeof *block + block_bytes);
        if (!block) return NULL;
        block->next = arena->blocks;
        arena->blocks = block;
        arena->used = 0;
        arena->size = block_bytes;
    }
    void *memory = (char *)(arena->blocks + 1) + arena->used;
    arena->used += bytes;
    return memory;
}

char *lx_arena_strdup(lx_arena *arena, const char *text)
{
    const size_t bytes = strlen(text) + 1;
    char *copy = lx_arena_alloc(arena, bytes, 1);
    if (copy) memcpy(copy, text, bytes);
    return copy;
}

void lx_arena_release(lx_arena *arena)
{
    for (lx_arena_block *block = arena->blocks; block;) {
        lx_arena_block *next = block->next;
        free(block);
        block = next;
    }
    *arena = (lx_arena){0};
}
