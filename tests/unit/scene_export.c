// Exported geometry: what becomes of vertices, attributes and accessors when lightmap coordinates are added.
#include "scene_export_files.h"

#include <meshoptimizer.h>

static const float quad_positions[] = {0, 0, 0, 1, 0, 0, 1, 0, 1, 0, 0, 1};
static const uint16_t quad_indices[] = {0, 2, 1, 0, 3, 2};
static const char one_node[] = "[{\"mesh\":0}]";

static json_t *quad_primitive(file *f)
{
    const int position = ADD_ACCESSOR(f, type_f32, "VEC3", 4, quad_positions);
    const int indices = ADD_ACCESSOR(f, type_u16, "SCALAR", 6, quad_indices);
    return json_pack("{s{si}si}", "attributes", "POSITION", position, "indices", indices);
}

static void set_attribute(json_t *primitive, const char *name, int accessor)
{
    json_object_set_new(json_object_get(primitive, "attributes"), name, json_integer(accessor));
}

// ---- without splitting

static void export_unsplit_primitive_keeps_its_accessors_and_gains_one(void **state)
{
    (void)state;
    file *f = new_file(one_node);
    json_t *primitive = quad_primitive(f);
    static const float uv[8] = {0, 0, 1, 0, 1, 1, 0, 1};
    set_attribute(primitive, "TEXCOORD_0", ADD_ACCESSOR(f, type_f32, "VEC2", 4, uv));
    add_mesh(f, primitive);
    trip t = round_trip(f, 1, by_vertex);
    json_t *out = primitive_of(t.document, 0, 0);
    assert_int_equal(json_array_size(json_object_get(t.document, "accessors")), 4);
    assert_int_equal(attribute_of(out, "POSITION"), 0);
    assert_int_equal(number_in(out, "indices"), 1);
    assert_int_equal(attribute_of(out, "TEXCOORD_0"), 2);
    assert_int_equal(attribute_of(out, "TEXCOORD_1"), 3);
    assert_null(json_object_get(out, "mode"));
    assert_same_corners(&t);
    end_trip(&t);
}

static void export_unsplit_strip_stays_a_strip(void **state)
{
    (void)state;
    file *f = new_file(one_node);
    json_t *primitive = json_pack("{s{si}si}", "attributes", "POSITION", ADD_ACCESSOR(f, type_f32, "VEC3", 4, quad_positions),
                                  "mode", 5);
    add_mesh(f, primitive);
    trip t = round_trip(f, 0, by_vertex);
    assert_int_equal(number_in(primitive_of(t.document, 0, 0), "mode"), 5);
    assert_null(json_object_get(primitive_of(t.document, 0, 0), "indices"));
    assert_same_corners(&t);
    end_trip(&t);
}

static void export_primitives_over_one_set_of_vertices_share_coordinates_where_they_agree(void **state)
{
    (void)state;
    file *f = new_file(one_node);
    static const uint16_t first[] = {0, 2, 1}, second[] = {0, 3, 2};
    const int position = ADD_ACCESSOR(f, type_f32, "VEC3", 4, quad_positions);
    const int a = ADD_ACCESSOR(f, type_u16, "SCALAR", 3, first), b = ADD_ACCESSOR(f, type_u16, "SCALAR", 3, second);
    push(f, "meshes", json_pack("{s[{s{si}si}{s{si}si}]}", "primitives", "attributes", "POSITION", position, "indices", a,
                                "attributes", "POSITION", position, "indices", b));
    trip t = round_trip(f, 0, by_vertex);
    const json_int_t shared = attribute_of(primitive_of(t.document, 0, 0), "TEXCOORD_0");
    assert_int_equal(shared, attribute_of(primitive_of(t.document, 0, 1), "TEXCOORD_0"));
    assert_same_corners(&t);
    end_trip(&t);
    // Vertex 0 is used by both; when they disagree about it, each has coordinates of its own over the same positions.
    f = new_file(one_node);
    const int p = ADD_ACCESSOR(f, type_f32, "VEC3", 4, quad_positions);
    const int c = ADD_ACCESSOR(f, type_u16, "SCALAR", 3, first), d = ADD_ACCESSOR(f, type_u16, "SCALAR", 3, second);
    push(f, "meshes", json_pack("{s[{s{si}si}{s{si}si}]}", "primitives", "attributes", "POSITION", p, "indices", c,
                                "attributes", "POSITION", p, "indices", d));
    t = begin_trip(f, 0, by_vertex);
    t.atlas->primitives[1].corner_uv[0].x = 0.75f;
    export_trip(&t);
    assert_int_not_equal(attribute_of(primitive_of(t.document, 0, 0), "TEXCOORD_0"),
                         attribute_of(primitive_of(t.document, 0, 1), "TEXCOORD_0"));
    assert_int_equal(attribute_of(primitive_of(t.document, 0, 0), "POSITION"),
                     attribute_of(primitive_of(t.document, 0, 1), "POSITION"));
    assert_same_corners(&t);
    end_trip(&t);
}

static void export_leaves_existing_coordinates_and_unlit_primitives_alone(void **state)
{
    (void)state;
    file *f = new_file(one_node);
    add_mesh(f, quad_primitive(f));
    trip t = begin_trip(f, 0, by_triangle);
    t.atlas->meshes[0].existing = true;
    export_trip(&t);
    assert_int_equal(attribute_of(primitive_of(t.document, 0, 0), "TEXCOORD_0"), -1);
    json_decref(t.document);
    lx_bytes_release(&t.bytes);
    lx_scene_destroy(t.after);
    t.atlas->meshes[0].existing = false;
    unlight(t.atlas, 0);
    export_trip(&t);
    assert_int_equal(attribute_of(primitive_of(t.document, 0, 0), "TEXCOORD_0"), -1);
    assert_int_equal(json_array_size(json_object_get(t.document, "accessors")), 2);
    end_trip(&t);
}

static void export_leaves_points_and_lines_untouched(void **state)
{
    (void)state;
    file *f = new_file(one_node);
    json_t *triangles = quad_primitive(f);
    const int position = (int)attribute_of(triangles, "POSITION");
    push(f, "meshes", json_pack("{s[{s{si}si}o{s{si}si}]}", "primitives", "attributes", "POSITION", position, "mode", 0, triangles,
                                "attributes", "POSITION", position, "mode", 1));
    trip t = round_trip(f, 0, by_triangle);
    for (size_t i = 0; i < 3; i += 2) {
        json_t *primitive = primitive_of(t.document, 0, i);
        assert_int_equal(number_in(primitive, "mode"), i / 2);
        assert_int_equal(attribute_of(primitive, "TEXCOORD_0"), -1);
        assert_memory_equal(data_of(&t, attribute_of(primitive, "POSITION")), quad_positions, sizeof quad_positions);
    }
    assert_int_equal(number_in(accessor_of(t.document, attribute_of(primitive_of(t.document, 0, 1), "POSITION")), "count"), 6);
    end_trip(&t);
}

// ---- with splitting

static void export_split_vertices_keep_their_attributes_and_get_the_coordinates_given(void **state)
{
    (void)state;
    static const float normals[12] = {0, 1, 0, 0.6f, 0.8f, 0, 0, 0.8f, 0.6f, 0, 1, 0};
    static const uint8_t colors[16] = {255, 0, 0, 255, 0, 255, 0, 128, 0, 0, 255, 64, 9, 8, 7, 6};
    static const uint16_t uv[8] = {0, 0, 65535, 0, 65535, 65535, 0, 65535};
    file *f = new_file(one_node);
    json_t *primitive = quad_primitive(f);
    set_attribute(primitive, "NORMAL", ADD_ACCESSOR(f, type_f32, "VEC3", 4, normals));
    const int color = ADD_ACCESSOR(f, type_u8, "VEC4", 4, colors), texcoord = ADD_ACCESSOR(f, type_u16, "VEC2", 4, uv);
    normalize(f, color);
    normalize(f, texcoord);
    set_attribute(primitive, "COLOR_0", color);
    set_attribute(primitive, "TEXCOORD_0", texcoord);
    add_mesh(f, primitive);
    trip t = round_trip(f, 1, by_triangle);
    json_t *out = primitive_of(t.document, 0, 0);
    json_t *color_out = accessor_of(t.document, attribute_of(out, "COLOR_0"));
    assert_int_equal(number_in(color_out, "componentType"), type_u8);
    assert_true(json_is_true(json_object_get(color_out, "normalized")));
    assert_int_equal(number_in(color_out, "count"), 6);
    assert_int_equal(number_in(accessor_of(t.document, attribute_of(out, "TEXCOORD_0")), "componentType"), type_u16);
    assert_same_corners(&t);
    end_trip(&t);
}

static void export_split_positions_get_exact_bounds(void **state)
{
    (void)state;
    static const float positions[] = {0.1f, 0, -7, 1.3f, 0.2f, 0, 1, 0, 1, 0, 0, 1e-20f, 99, 99, 99}; // the last one is unused
    file *f = new_file(one_node);
    const int position = ADD_ACCESSOR(f, type_f32, "VEC3", 5, positions), indices = ADD_ACCESSOR(f, type_u16, "SCALAR", 6, quad_indices);
    add_mesh(f, json_pack("{s{si}si}", "attributes", "POSITION", position, "indices", indices));
    trip t = round_trip(f, 0, by_triangle);
    const json_t *accessor = accessor_of(t.document, attribute_of(primitive_of(t.document, 0, 0), "POSITION"));
    const float low[3] = {0, 0, -7}, high[3] = {1.3f, 0.2f, 1};
    assert_int_equal(number_in(accessor, "count"), 6);
    for (size_t c = 0; c < 3; ++c) {
        assert_true(json_real_value(json_array_get(json_object_get(accessor, "min"), c)) == (double)low[c]);
        assert_true(json_real_value(json_array_get(json_object_get(accessor, "max"), c)) == (double)high[c]);
    }
    assert_same_corners(&t);
    end_trip(&t);
}

static void check_split_mode(int mode, bool indexed)
{
    static const float positions[] = {0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 2, 0, 1, 3, 1, 2, 4};
    static const uint8_t indices[] = {5, 4, 3, 2, 1, 0};
    file *f = new_file(one_node);
    json_t *primitive = json_pack("{s{si}si}", "attributes", "POSITION", ADD_ACCESSOR(f, type_f32, "VEC3", 6, positions), "mode", mode);
    if (indexed) json_object_set_new(primitive, "indices", json_integer(ADD_ACCESSOR(f, type_u8, "SCALAR", 6, indices)));
    add_mesh(f, primitive);
    trip t = round_trip(f, 0, by_triangle);
    json_t *out = primitive_of(t.document, 0, 0);
    assert_int_equal(t.before->primitives[0].triangle_count, mode == 4 ? 2 : 4);
    assert_int_equal(number_in(out, "mode"), 4);
    const int type = (int)number_in(accessor_of(t.document, number_in(out, "indices")), "componentType");
    assert_int_equal(type, indexed ? type_u8 : type_u16);
    assert_same_corners(&t);
    end_trip(&t);
}

static void export_split_strips_and_fans_become_indexed_triangles_in_the_same_order(void **state)
{
    (void)state;
    for (int mode = 5; mode <= 6; ++mode) {
        check_split_mode(mode, false);
        check_split_mode(mode, true);
    }
}

static void export_unindexed_triangles_need_no_indices(void **state)
{
    (void)state;
    static const float positions[] = {0, 0, 0, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 1};
    file *f = new_file(one_node);
    add_mesh(f, json_pack("{s{si}}", "attributes", "POSITION", ADD_ACCESSOR(f, type_f32, "VEC3", 6, positions)));
    trip t = round_trip(f, 0, by_triangle); // every vertex is used once
    assert_null(json_object_get(primitive_of(t.document, 0, 0), "indices"));
    assert_same_corners(&t);
    end_trip(&t);
}

// 21845 triangles of their own have 65535 vertices, the most that 16 bits can name without the value that restarts strips.
static void check_index_type(uint32_t triangle_count, int expected)
{
    file *f = new_file(one_node);
    uint16_t *indices = calloc(3 * (size_t)triangle_count, sizeof *indices);
    for (uint32_t i = 0; i < triangle_count; ++i)
        for (uint32_t k = 0; k < 3; ++k) indices[3 * i + k] = quad_indices[3 * (i % 2) + k];
    const int position = ADD_ACCESSOR(f, type_f32, "VEC3", 4, quad_positions);
    const int index = add_accessor(f, type_u16, "SCALAR", 3 * triangle_count, indices, 6 * (size_t)triangle_count, 0);
    add_mesh(f, json_pack("{s{si}si}", "attributes", "POSITION", position, "indices", index));
    free(indices);
    trip t = round_trip(f, 0, by_triangle);
    json_t *out = primitive_of(t.document, 0, 0);
    assert_int_equal(number_in(accessor_of(t.document, attribute_of(out, "POSITION")), "count"), 3 * triangle_count);
    assert_int_equal(number_in(accessor_of(t.document, number_in(out, "indices")), "componentType"), expected);
    assert_same_corners(&t);
    end_trip(&t);
}

static void export_split_indices_grow_to_32_bits_only_when_they_must(void **state)
{
    (void)state;
    check_index_type(21845, type_u16);
    check_index_type(21846, type_u32);
}

static void export_split_bytes_of_three_components_are_padded_to_four(void **state)
{
    (void)state;
    static const int8_t normals[16] = {0, 127, 0, 99, 127, 0, 0, 99, 0, 0, 127, 99, 0, -127, 0, 99}; // 99: padding
    file *f = new_file(one_node);
    use_extension(f, "KHR_mesh_quantization");
    json_t *primitive = quad_primitive(f);
    const int normal = add_accessor(f, type_i8, "VEC3", 4, normals, sizeof normals, 4);
    normalize(f, normal);
    set_attribute(primitive, "NORMAL", normal);
    add_mesh(f, primitive);
    trip t = round_trip(f, 0, by_triangle);
    json_t *accessor = accessor_of(t.document, attribute_of(primitive_of(t.document, 0, 0), "NORMAL"));
    json_t *view = item(t.document, "bufferViews", (size_t)number_in(accessor, "bufferView"));
    assert_int_equal(number_in(accessor, "componentType"), type_i8);
    assert_int_equal(number_in(view, "byteStride"), 4);
    assert_same_corners(&t);
    end_trip(&t);
}

static void export_split_reads_interleaved_and_sparse_attributes(void **state)
{
    (void)state;
    static const float vertices[24] = {0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 1, 0, 1, 0, 1, 0, 1, 0, 0, 0, 1, 0, 1, 0};
    static const uint8_t sparse_indices[] = {1, 3};
    static const float sparse_values[] = {5, 0, 0, 0, 0, 6};
    file *f = new_file(one_node);
    const int position = add_accessor(f, type_f32, "VEC3", 4, vertices, sizeof vertices, 24);
    const int normal = push(f, "accessors", json_deep_copy(accessor_of(f->document, position)));
    json_object_set_new(accessor_of(f->document, normal), "byteOffset", json_integer(12));
    const int indices = ADD_ACCESSOR(f, type_u16, "SCALAR", 6, quad_indices);
    const int where = add_view(f, sparse_indices, sizeof sparse_indices), what = add_view(f, sparse_values, sizeof sparse_values);
    json_object_set_new(accessor_of(f->document, position), "sparse",
                        json_pack("{sis{sisi}s{si}}", "count", 2, "indices", "bufferView", where, "componentType", type_u8,
                                  "values", "bufferView", what));
    add_mesh(f, json_pack("{s{sisi}si}", "attributes", "POSITION", position, "NORMAL", normal, "indices", indices));
    trip t = round_trip(f, 0, by_triangle);
    assert_true(t.before->primitives[0].positions[3].z == 6);
    json_t *accessor = accessor_of(t.document, attribute_of(primitive_of(t.document, 0, 0), "POSITION"));
    assert_null(json_object_get(accessor, "sparse"));
    assert_same_corners(&t);
    end_trip(&t);
}

static void export_split_reindexes_morph_targets(void **state)
{
    (void)state;
    static const float moved[12] = {0, 1, 0, 0, 2, 0, 0, 3, 0, 0, 4, 0};
    static const int16_t turned[16] = {0, 0, 0, 0, 32767, 0, 0, 0, 0, 0, 32767, 0, 0, -32767, 0, 0};
    file *f = new_file(one_node);
    use_extension(f, "KHR_mesh_quantization");
    json_t *primitive = quad_primitive(f);
    static const float normals[12] = {0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0};
    set_attribute(primitive, "NORMAL", ADD_ACCESSOR(f, type_f32, "VEC3", 4, normals));
    const int position = ADD_ACCESSOR(f, type_f32, "VEC3", 4, moved);
    const int normal = add_accessor(f, type_i16, "VEC3", 4, turned, sizeof turned, 8);
    normalize(f, normal);
    const int zeros = push(f, "accessors", json_pack("{sisiss}", "componentType", type_f32, "count", 4, "type", "VEC3"));
    static const uint8_t where[] = {2};
    static const float what[] = {0, 8, 0};
    const int where_view = add_view(f, where, sizeof where), what_view = add_view(f, what, sizeof what);
    const int sparse = push(f, "accessors", json_deep_copy(accessor_of(f->document, zeros)));
    json_object_set_new(accessor_of(f->document, sparse), "sparse",
                        json_pack("{sis{sisi}s{si}}", "count", 1, "indices", "bufferView", where_view, "componentType", type_u8,
                                  "values", "bufferView", what_view));
    json_object_set_new(primitive, "targets", json_pack("[{sisi}{si}{si}]", "POSITION", position, "NORMAL", normal, "POSITION", zeros,
                                                        "POSITION", sparse));
    const int mesh = add_mesh(f, primitive);
    json_object_set_new(item(f->document, "meshes", (size_t)mesh), "weights", parse("[0.5, 0.25, 0.125]"));
    trip t = round_trip(f, 0, by_triangle); // the importer adds the targets: positions of both scenes tell whether they fit
    json_t *targets = json_object_get(primitive_of(t.document, 0, 0), "targets");
    json_t *first = accessor_of(t.document, number_in(json_array_get(targets, 0), "NORMAL"));
    json_t *second = accessor_of(t.document, number_in(json_array_get(targets, 1), "POSITION"));
    assert_int_equal(number_in(first, "componentType"), type_i16);
    assert_int_equal(number_in(second, "count"), 6);
    assert_null(json_object_get(second, "bufferView"));
    assert_true(t.before->primitives[0].positions[2].y == 2.5f);
    assert_same_corners(&t);
    end_trip(&t);
}

static void export_split_keeps_skins(void **state)
{
    (void)state;
    static const uint8_t joints[16] = {0, 1, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0};
    static const uint8_t weights[16] = {200, 55, 0, 0, 255, 0, 0, 0, 100, 155, 0, 0, 255, 0, 0, 0};
    static const float matrices[32] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    file *f = new_file("[{\"mesh\":0,\"skin\":0},{},{}]");
    json_t *primitive = quad_primitive(f);
    const int weight = ADD_ACCESSOR(f, type_u8, "VEC4", 4, weights);
    normalize(f, weight);
    set_attribute(primitive, "JOINTS_0", ADD_ACCESSOR(f, type_u8, "VEC4", 4, joints));
    set_attribute(primitive, "WEIGHTS_0", weight);
    add_mesh(f, primitive);
    const int inverse = ADD_ACCESSOR(f, type_f32, "MAT4", 2, matrices);
    push(f, "skins", json_pack("{s[ii]si}", "joints", 1, 2, "inverseBindMatrices", inverse));
    trip t = round_trip(f, 0, by_triangle);
    json_t *out = primitive_of(t.document, 0, 0);
    const uint32_t *corners = t.before->primitives[0].indices;
    const uint8_t *new_joints = data_of(&t, attribute_of(out, "JOINTS_0")), *new_weights = data_of(&t, attribute_of(out, "WEIGHTS_0"));
    for (uint32_t k = 0; k < 6; ++k) {
        const uint32_t vertex = t.after->primitives[0].indices[k];
        assert_memory_equal(new_joints + 4 * vertex, joints + 4 * corners[k], 4);
        assert_memory_equal(new_weights + 4 * vertex, weights + 4 * corners[k], 4);
    }
    assert_memory_equal(data_of(&t, number_in(item(t.document, "skins", 0), "inverseBindMatrices")), matrices, sizeof matrices);
    end_trip(&t);
}

static void export_split_keeps_degenerate_triangles(void **state)
{
    (void)state;
    static const uint16_t indices[] = {0, 2, 1, 0, 0, 1, 3, 3, 3, 0, 3, 2};
    file *f = new_file(one_node);
    const int position = ADD_ACCESSOR(f, type_f32, "VEC3", 4, quad_positions), index = ADD_ACCESSOR(f, type_u16, "SCALAR", 12, indices);
    add_mesh(f, json_pack("{s{si}si}", "attributes", "POSITION", position, "indices", index));
    trip t = round_trip(f, 0, by_triangle);
    assert_int_equal(t.after->primitives[0].triangle_count, 4);
    assert_same_corners(&t);
    end_trip(&t);
}

static void export_split_accessors_stay_shared_where_they_change_alike(void **state)
{
    (void)state;
    file *f = new_file("[{\"mesh\":0},{\"mesh\":1},{\"mesh\":2}]");
    json_t *primitive = quad_primitive(f);
    for (int i = 0; i < 3; ++i) add_mesh(f, json_deep_copy(primitive));
    json_decref(primitive);
    trip t = begin_trip(f, 0, by_triangle);
    t.atlas->primitives[2].corner_uv[3] = t.atlas->primitives[2].corner_uv[0]; // mesh 2 splits in another way
    export_trip(&t);
    json_t *a = primitive_of(t.document, 0, 0), *b = primitive_of(t.document, 1, 0), *c = primitive_of(t.document, 2, 0);
    assert_true(json_equal(a, b));
    assert_int_not_equal(attribute_of(a, "POSITION"), attribute_of(c, "POSITION"));
    assert_int_equal(json_array_size(json_object_get(t.document, "accessors")), 6);
    assert_same_corners(&t);
    end_trip(&t);
}

static void export_fills_missing_lower_sets_with_zeros(void **state)
{
    (void)state;
    for (int split = 0; split < 2; ++split) {
        file *f = new_file(one_node);
        add_mesh(f, quad_primitive(f));
        trip t = round_trip(f, 2, split ? by_triangle : by_vertex);
        const lx_primitive *out = &t.after->primitives[0];
        for (uint32_t i = 0; i < out->vertex_count; ++i)
            for (uint32_t set = 0; set < 2; ++set) assert_true(out->texcoords[set][i].x == 0 && out->texcoords[set][i].y == 0);
        assert_int_equal(attribute_of(primitive_of(t.document, 0, 0), "TEXCOORD_0"),
                         attribute_of(primitive_of(t.document, 0, 0), "TEXCOORD_1"));
        assert_same_corners(&t);
        end_trip(&t);
    }
}

static void export_replaces_a_set_that_could_not_serve(void **state)
{
    (void)state;
    static const float bad[8] = {0};
    for (int split = 0; split < 2; ++split) {
        file *f = new_file(one_node);
        json_t *primitive = quad_primitive(f);
        static const float uv[8] = {0, 0, 1, 0, 1, 1, 0, 1};
        set_attribute(primitive, "TEXCOORD_0", ADD_ACCESSOR(f, type_f32, "VEC2", 4, uv));
        set_attribute(primitive, "TEXCOORD_1", ADD_ACCESSOR(f, type_f32, "VEC2", 4, bad));
        add_mesh(f, primitive);
        trip t = round_trip(f, 1, split ? by_triangle : by_vertex);
        assert_int_equal(json_array_size(json_object_get(t.document, "accessors")), 4);
        assert_same_corners(&t);
        end_trip(&t);
    }
}

static void export_gives_one_mesh_at_two_morph_weights_two_sets_of_coordinates(void **state)
{
    (void)state;
    static const float moved[12] = {0, 1, 0, 0, 2, 0, 0, 3, 0, 0, 4, 0};
    file *f = new_file("[{\"mesh\":0},{\"mesh\":0,\"weights\":[1]},{\"mesh\":0}]");
    json_t *primitive = quad_primitive(f);
    json_object_set_new(primitive, "targets", json_pack("[{si}]", "POSITION", ADD_ACCESSOR(f, type_f32, "VEC3", 4, moved)));
    const int mesh = add_mesh(f, primitive);
    json_object_set_new(item(f->document, "meshes", (size_t)mesh), "weights", parse("[0]"));
    trip t = begin_trip(f, 0, by_vertex);
    assert_int_equal(t.before->mesh_count, 2);
    t.atlas->primitives[1].corner_uv[0].x += 0.5f; // corner 3 is the same vertex, so it is split
    export_trip(&t);
    assert_int_equal(json_array_size(json_object_get(t.document, "meshes")), 2);
    assert_int_equal(number_in(item(t.document, "nodes", 0), "mesh"), 0);
    assert_int_equal(number_in(item(t.document, "nodes", 1), "mesh"), 1);
    assert_int_equal(number_in(item(t.document, "nodes", 2), "mesh"), 0);
    assert_same_corners(&t);
    end_trip(&t);
}

// ---- compressed input

static int add_compressed(file *f, const void *packed, size_t packed_size, size_t count, size_t stride, const char *mode)
{
    const int view = add_view(f, packed, packed_size);
    json_t *object = item(f->document, "bufferViews", (size_t)view);
    json_t *extension = json_pack("{sisIsIsisIss}", "buffer", 0, "byteOffset", number_in(object, "byteOffset"), "byteLength",
                                  (json_int_t)packed_size, "byteStride", (int)stride, "count", (json_int_t)count, "mode", mode);
    json_object_set_new(object, "extensions", json_pack("{so}", "EXT_meshopt_compression", extension));
    json_object_set_new(object, "buffer", json_integer(1)); // the fallback, which has no bytes
    json_object_set_new(object, "byteOffset", json_integer(0));
    json_object_set_new(object, "byteLength", json_integer((json_int_t)(count * stride)));
    return view;
}

static void export_writes_compressed_input_decoded(void **state)
{
    (void)state;
    for (int split = 0; split < 2; ++split) {
        file *f = new_file(one_node);
        uint8_t packed[256];
        use_extension(f, "EXT_meshopt_compression");
        push(f, "extensionsRequired", json_string("EXT_meshopt_compression"));
        size_t size = meshopt_encodeVertexBuffer(packed, sizeof packed, quad_positions, 4, 12);
        const int positions = add_compressed(f, packed, size, 4, 12, "ATTRIBUTES");
        const unsigned indices[] = {0, 2, 1, 0, 3, 2};
        size = meshopt_encodeIndexBuffer(packed, sizeof packed, indices, 6);
        const int index = add_compressed(f, packed, size, 6, 2, "TRIANGLES");
        push(f, "buffers", json_pack("{sI}", "byteLength", (json_int_t)f->size));
        push(f, "buffers", parse("{\"byteLength\":64,\"extensions\":{\"EXT_meshopt_compression\":{\"fallback\":true}}}"));
        const int p = push(f, "accessors", json_pack("{sisisiss}", "bufferView", positions, "componentType", type_f32, "count", 4, "type", "VEC3"));
        const int i = push(f, "accessors", json_pack("{sisisiss}", "bufferView", index, "componentType", type_u16, "count", 6, "type", "SCALAR"));
        add_mesh(f, json_pack("{s{si}si}", "attributes", "POSITION", p, "indices", i));
        trip t = round_trip(f, 0, split ? by_triangle : by_vertex);
        assert_null(json_object_get(t.document, "extensionsUsed"));
        assert_null(json_object_get(t.document, "extensionsRequired"));
        assert_int_equal(json_array_size(json_object_get(t.document, "buffers")), 1);
        assert_null(json_object_get(item(t.document, "bufferViews", 0), "extensions"));
        assert_same_corners(&t);
        end_trip(&t);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(export_unsplit_primitive_keeps_its_accessors_and_gains_one),
        cmocka_unit_test(export_unsplit_strip_stays_a_strip),
        cmocka_unit_test(export_primitives_over_one_set_of_vertices_share_coordinates_where_they_agree),
        cmocka_unit_test(export_leaves_existing_coordinates_and_unlit_primitives_alone),
        cmocka_unit_test(export_leaves_points_and_lines_untouched),
        cmocka_unit_test(export_split_vertices_keep_their_attributes_and_get_the_coordinates_given),
        cmocka_unit_test(export_split_positions_get_exact_bounds),
        cmocka_unit_test(export_split_strips_and_fans_become_indexed_triangles_in_the_same_order),
        cmocka_unit_test(export_unindexed_triangles_need_no_indices),
        cmocka_unit_test(export_split_indices_grow_to_32_bits_only_when_they_must),
        cmocka_unit_test(export_split_bytes_of_three_components_are_padded_to_four),
        cmocka_unit_test(export_split_reads_interleaved_and_sparse_attributes),
        cmocka_unit_test(export_split_reindexes_morph_targets),
        cmocka_unit_test(export_split_keeps_skins),
        cmocka_unit_test(export_split_keeps_degenerate_triangles),
        cmocka_unit_test(export_split_accessors_stay_shared_where_they_change_alike),
        cmocka_unit_test(export_fills_missing_lower_sets_with_zeros),
        cmocka_unit_test(export_replaces_a_set_that_could_not_serve),
        cmocka_unit_test(export_gives_one_mesh_at_two_morph_weights_two_sets_of_coordinates),
        cmocka_unit_test(export_writes_compressed_input_decoded),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
