/// Allocation. Sizes are checked before they are multiplied; every function may return NULL.
#ifndef LX_BASE_MEMORY_H
#define LX_BASE_MEMORY_H

#include <stdbool.h>
#include <stddef.h>

/// Asks for memory that is read soon, without waiting for it.
#if defined(__GNUC__)
#define LX_PREFETCH(address) __builtin_prefetch(address)
#else
#define LX_PREFETCH(address) ((void)(address))
#endif

/// count × size bytes, uninitialised (those aligned to cache lines, if they fill one) or zeroed. Zero elements give a valid, freeable pointer. NULL on overflow or lack of memory.
void *lx_malloc_array(size_t count, size_t size);
void *lx_calloc_array(size_t count, size_t size);
void lx_free(void *memory);
/// Gives what is free, but kept for later allocations, back to the system. Slow enough to do it between stages only.
void lx_trim_memory(void);

/// Copy of a string, of at most `length` bytes of it.
char *lx_strdup(const char *text);
char *lx_strndup(const char *text, size_t length);

/// Printf into a fresh string.
#if defined(__GNUC__)
__attribute__((format(printf, 1, 2)))
#endif
char *lx_format(const char *format, ...);

/// Makes room for at least `count` elements of `size` bytes in *array (grows by half at least). False: no memory, array unchanged.
bool lx_array_reserve(void *array_pointer, size_t *capacity, size_t count, size_t size);

/// a × b or a + b into *out; false on overflow.
bool lx_mul_size(size_t a, size_t b, size_t *out);
bool lx_add_size(size_t a, size_t b, size_t *out);

/// A bump allocator: everything in it dies at once. Allocations are 16-byte aligned and zeroed.
typedef struct lx_arena_block lx_arena_block;
typedef struct lx_arena {
    lx_arena_block *blocks;
    size_t used, size; ///< Of the newest block.
} lx_arena;

void *lx_arena_alloc(lx_arena *arena, size_t count, size_t size);
char *lx_arena_strdup(lx_arena *arena, const char *text);
void lx_arena_release(lx_arena *arena);

#endif
