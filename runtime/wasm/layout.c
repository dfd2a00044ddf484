// Where JavaScript finds the fields of the public structs: sizes and offsets on wasm32. Compiled into luxel_rt.wasm alone, where
// it is a check and nothing else; scripts that read or fill these structs can take the numbers from here, line by line.
#include "luxel_rt.h"

#define SIZE(type, bytes) _Static_assert(sizeof(type) == (bytes), #type)
#define FIELD(type, field, at) _Static_assert(offsetof(type, field) == (at), #type "." #field)

SIZE(lxrt_info, 36);
FIELD(lxrt_info, page_size, 0);
FIELD(lxrt_info, page_count, 4);
FIELD(lxrt_info, layer_count, 8);
FIELD(lxrt_info, level_count, 12);
FIELD(lxrt_info, rect_count, 16);
FIELD(lxrt_info, source_count, 20);
FIELD(lxrt_info, animation_count, 24);
FIELD(lxrt_info, monitor_count, 28);
FIELD(lxrt_info, block_count, 32);

SIZE(lxrt_layer, 32);
FIELD(lxrt_layer, name, 0);
FIELD(lxrt_layer, kind, 4);
FIELD(lxrt_layer, mixed, 8);
FIELD(lxrt_layer, color, 12);
FIELD(lxrt_layer, intensity, 24);
FIELD(lxrt_layer, scale, 28);

SIZE(lxrt_region, 24);
FIELD(lxrt_region, page, 0);
FIELD(lxrt_region, level, 4);
FIELD(lxrt_region, x, 8);
FIELD(lxrt_region, y, 12);
FIELD(lxrt_region, width, 16);
FIELD(lxrt_region, height, 20);

SIZE(lxrt_target, 16);
FIELD(lxrt_target, texels, 0);
FIELD(lxrt_target, row_bytes, 4);
FIELD(lxrt_target, format, 8);
FIELD(lxrt_target, scale, 12);

SIZE(lxrt_budget, 48);
FIELD(lxrt_budget, pack_bytes, 0);
FIELD(lxrt_budget, handle_bytes, 8);
FIELD(lxrt_budget, accumulator_bytes, 16);
FIELD(lxrt_budget, gpu_composed_bytes, 24);
FIELD(lxrt_budget, gpu_layers_bytes, 32);
FIELD(lxrt_budget, dense_bytes, 40);

SIZE(lxrt_program, 64);
FIELD(lxrt_program, kind, 0);
FIELD(lxrt_program, color, 4);
FIELD(lxrt_program, intensity, 16);
FIELD(lxrt_program, period_s, 20);
FIELD(lxrt_program, phase_s, 24);
FIELD(lxrt_program, duty, 28);
FIELD(lxrt_program, low, 32);
FIELD(lxrt_program, high, 36);
FIELD(lxrt_program, fade_s, 40);
FIELD(lxrt_program, seed, 44);
FIELD(lxrt_program, keys, 48);
FIELD(lxrt_program, key_count, 52);
FIELD(lxrt_program, interpolation, 56);
FIELD(lxrt_program, loop, 60);

SIZE(lxrt_animation, 20);
FIELD(lxrt_animation, name, 0);
FIELD(lxrt_animation, layer, 4);
FIELD(lxrt_animation, kind, 8);
FIELD(lxrt_animation, duration_s, 12);
FIELD(lxrt_animation, playing, 16);

SIZE(lxrt_monitor, 36);
FIELD(lxrt_monitor, name, 0);
FIELD(lxrt_monitor, node, 4);
FIELD(lxrt_monitor, material, 8);
FIELD(lxrt_monitor, columns, 12);
FIELD(lxrt_monitor, rows, 16);
FIELD(lxrt_monitor, first_layer, 20);
FIELD(lxrt_monitor, strength, 24);

SIZE(lxrt_rect, 48);
FIELD(lxrt_rect, node, 0);
FIELD(lxrt_rect, gpu_instance, 4);
FIELD(lxrt_rect, page, 8);
FIELD(lxrt_rect, texcoord, 12);
FIELD(lxrt_rect, x, 16);
FIELD(lxrt_rect, y, 20);
FIELD(lxrt_rect, width, 24);
FIELD(lxrt_rect, height, 28);
FIELD(lxrt_rect, scale, 32);
FIELD(lxrt_rect, offset, 40);

SIZE(lxrt_source, 32);
FIELD(lxrt_source, name, 0);
FIELD(lxrt_source, layer, 4);
FIELD(lxrt_source, kind, 8);
FIELD(lxrt_source, weight, 12);
FIELD(lxrt_source, node, 24);
FIELD(lxrt_source, material, 28);
