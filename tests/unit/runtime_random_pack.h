/// Packs full of noise for tests and benches of the runtime, put together after docs/pack-format.md without our writer.
#ifndef RUNTIME_RANDOM_PACK_H
#define RUNTIME_RANDOM_PACK_H

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef struct random_pack {
    uint32_t page_size, page_count, layer_count, level_count;
    float density;                      ///< Share of blocks that are present.
    uint32_t exponent_min, exponent_max; ///< Of texels, 0 … 31.
    int scale_spread;                   ///< Scales of layers are 2^0 … 2^±spread.
    uint32_t seed;
} random_pack;

static inline uint32_t random_next(uint32_t *state)
{
    *state ^= *state << 13; // xorshift32
    *state ^= *state >> 17;
    return *state ^= *state << 5;
}

static inline void random_put_u32(unsigned char *at, uint32_t value)
{
    for (int i = 0; i < 4; ++i) at[i] = (unsigned char)(value >> (8 * i));
}

static inline void random_put_f32(unsigned char *at, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, 4);
    random_put_u32(at, bits);
}

/// A pack of layers "0", "1", … (eight digits). Free with free(); blocks lie at a multiple of 4096 of the allocation.
static inline unsigned char *random_pack_make(const random_pack *desc, size_t *out_size)
{
    uint32_t state = desc->seed * 2654435761u + 1, entries = 0;
    for (uint32_t level = 0; level < desc->level_count; ++level) {
        const uint32_t across = ((desc->page_size >> level) + 31) / 32;
        entries += across * across;
    }
    const size_t index_count = (size_t)desc->page_count * desc->layer_count * entries;
    const size_t pages_at = 64 + 5 * 32 + 32, layers_at = pages_at + 64 * ((16 * (size_t)desc->page_count + 63) / 64);
    const size_t strings_at = layers_at + 64 * ((48 * (size_t)desc->layer_count + 63) / 64);
    const size_t strings_bytes = 9 * (size_t)desc->layer_count + 1;
    const size_t index_at = strings_at + 64 * ((strings_bytes + 63) / 64);
    const size_t blocks_at = 4096 * ((index_at + 4 * index_count + 4095) / 4096);

    uint32_t *index = malloc(4 * index_count + 4), block_count = 0;
    for (size_t i = 0; i < index_count; ++i)
        index[i] = (float)(random_next(&state) >> 8) * 0x1p-24f < desc->density ? ++block_count : 0;
    const size_t size = blocks_at + 4096 * (size_t)block_count;
    unsigned char *pack = aligned_alloc(4096, size);
    memset(pack, 0, blocks_at);
    memcpy(pack, "luxelpak", 8);
    random_put_u32(pack + 8, 1);
    random_put_u32(pack + 12, 64);
    random_put_u32(pack + 16, (uint32_t)size);
    random_put_u32(pack + 20, (uint32_t)((uint64_t)size >> 32));
    random_put_u32(pack + 24, desc->page_size);
    random_put_u32(pack + 28, desc->page_count);
    random_put_u32(pack + 32, desc->layer_count);
    random_put_u32(pack + 36, desc->level_count);
    random_put_u32(pack + 40, 32);
    random_put_u32(pack + 44, 5);
    random_put_u32(pack + 48, 64);
    const struct {
        const char *type;
        size_t offset, bytes;
        uint32_t count, stride;
    } sections[5] = {
        {"PAGE", pages_at, 16 * (size_t)desc->page_count, desc->page_count, 16},
        {"LAYR", layers_at, 48 * (size_t)desc->layer_count, desc->layer_count, 48},
        {"STRS", strings_at, strings_bytes, (uint32_t)strings_bytes, 1},
        {"BIDX", index_at, 4 * index_count, (uint32_t)index_count, 4},
        {"BLKS", blocks_at, 4096 * (size_t)block_count, block_count, 4096},
    };
    for (size_t i = 0; i < 5; ++i) {
        unsigned char *entry = pack + 64 + 32 * i;
        memcpy(entry, sections[i].type, 4);
        random_put_u32(entry + 4, 1);
        random_put_u32(entry + 8, (uint32_t)sections[i].offset);
        random_put_u32(entry + 16, (uint32_t)sections[i].bytes);
        random_put_u32(entry + 20, (uint32_t)((uint64_t)sections[i].bytes >> 32));
        random_put_u32(entry + 24, sections[i].count);
        random_put_u32(entry + 28, sections[i].stride);
    }
    for (uint32_t i = 0; i < desc->page_count; ++i) {
        random_put_u32(pack + pages_at + 16 * i, desc->page_size);
        random_put_u32(pack + pages_at + 16 * i + 4, desc->page_size);
        random_put_f32(pack + pages_at + 16 * i + 8, 1);
    }
    for (uint32_t i = 0; i < desc->layer_count; ++i) {
        unsigned char *layer = pack + layers_at + 48 * i, *name = pack + strings_at + 9 * i;
        for (uint32_t k = 0, n = i; k < 8; ++k, n /= 10) name[7 - k] = (unsigned char)('0' + n % 10);
        random_put_u32(layer, 9 * i);
        random_put_u32(layer + 4, 8);
        for (int k = 0; k < 3; ++k) random_put_f32(layer + 8 + 4 * k, 0.1f + (float)(random_next(&state) >> 8) * 0x1p-24f);
        random_put_f32(layer + 20, 1);
        const int exponent = desc->scale_spread ? (int)(random_next(&state) % (2u * (uint32_t)desc->scale_spread + 1)) - desc->scale_spread : 0;
        random_put_u32(layer + 24, (uint32_t)(127 + exponent) << 23);
    }
    for (size_t i = 0; i < index_count; ++i) random_put_u32(pack + index_at + 4 * i, index[i]);
    const uint32_t exponents = desc->exponent_max - desc->exponent_min + 1;
    for (size_t i = 0; i < 1024 * (size_t)block_count; ++i) {
        const uint32_t word = random_next(&state);
        random_put_u32(pack + blocks_at + 4 * i, (word & 0x7ffffff) | (desc->exponent_min + (word >> 27) % exponents) << 27);
    }
    free(index);
    *out_size = size;
    return pack;
}

#endif
