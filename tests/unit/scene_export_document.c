// Exported documents: what is kept, added, embedded and dropped around the geometry.
#define _XOPEN_SOURCE 700 // mkdtemp
#include "scene_export_files.h"

static const float quad_positions[] = {0, 0, 0, 1, 0, 0, 1, 0, 1, 0, 0, 1};
static const uint16_t quad_indices[] = {0, 2, 1, 0, 3, 2};

static json_t *quad_primitive(file *f)
{
    const int position = ADD_ACCESSOR(f, type_f32, "VEC3", 4, quad_positions);
    const int indices = ADD_ACCESSOR(f, type_u16, "SCALAR", 6, quad_indices);
    return json_pack("{s{si}si}", "attributes", "POSITION", position, "indices", indices);
}

static file *quad_file(const char *nodes)
{
    file *f = new_file(nodes);
    add_mesh(f, quad_primitive(f));
    return f;
}

static void assert_json(const json_t *value, const char *expected)
{
    json_t *wanted = parse(expected);
    if (!json_equal(value, wanted)) {
        char *text = json_dumps(value, JSON_ENCODE_ANY);
        fail_msg("%s, not %s", text, expected);
    }
    json_decref(wanted);
}

static const json_t *extras_of(json_t *document, const char *array, size_t index)
{
    return json_object_get(item(document, array, index), "extras");
}

// ---- marks

static void export_nodes_get_rectangles_and_keep_other_extras(void **state)
{
    (void)state;
    trip t = round_trip(quad_file("[{\"mesh\":0,\"extras\":{\"mine\":[1,2]}},{\"mesh\":0,\"extras\":\"text\"},{}]"), 1, by_triangle);
    assert_json(extras_of(t.document, "nodes", 0), "{\"mine\":[1,2],\"luxel_lightmap\":{\"page\":0,\"texCoord\":1,"
                                                   "\"scale\":[0.25,0.125],\"offset\":[0.25,0.0]}}");
    assert_json(extras_of(t.document, "nodes", 1), "{\"value\":\"text\",\"luxel_lightmap\":{\"page\":1,\"texCoord\":1,"
                                                   "\"scale\":[0.25,0.125],\"offset\":[0.25,0.0625]}}");
    assert_null(extras_of(t.document, "nodes", 2));
    end_trip(&t);
}

static void export_removes_the_marks_of_an_earlier_bake(void **state)
{
    (void)state;
    file *f = quad_file("[{\"mesh\":0,\"extras\":{\"luxel_lightmap\":{\"page\":9},\"mine\":1}},"
                        "{\"extras\":{\"luxel_baked\":true}}]");
    push(f, "materials", parse("{\"name\":\"old\",\"extras\":{\"luxel_baked\":true}}"));
    trip t = begin_trip(f, 0, by_triangle);
    t.atlas->rects[0].used = false;
    export_trip(&t);
    assert_json(extras_of(t.document, "nodes", 0), "{\"mine\":1}");
    assert_null(extras_of(t.document, "nodes", 1));
    assert_null(extras_of(t.document, "materials", 0));
    end_trip(&t);
}

static void export_marks_baked_lights_but_not_mixed_or_real_time_ones(void **state)
{
    (void)state;
    file *f = quad_file("[{\"mesh\":0},{\"extensions\":{\"KHR_lights_punctual\":{\"light\":0}}},"
                        "{\"extensions\":{\"KHR_lights_punctual\":{\"light\":0}},\"extras\":{\"luxel_mode\":\"mixed\"}},"
                        "{\"extensions\":{\"KHR_lights_punctual\":{\"light\":0}},\"extras\":{\"luxel_mode\":\"realtime\"}},"
                        "{\"extras\":{\"luxel_area\":\"rect 1 1\",\"luxel_color\":[1,1,1],\"luxel_intensity\":5}}]");
    use_extension(f, "KHR_lights_punctual");
    json_object_set_new(f->document, "extensions", parse("{\"KHR_lights_punctual\":{\"lights\":[{\"type\":\"point\"}]}}"));
    trip t = round_trip(f, 0, by_triangle);
    assert_json(json_object_get(extras_of(t.document, "nodes", 1), "luxel_baked"), "true");
    assert_json(extras_of(t.document, "nodes", 2), "{\"luxel_mode\":\"mixed\"}");
    assert_json(extras_of(t.document, "nodes", 3), "{\"luxel_mode\":\"realtime\"}");
    assert_json(json_object_get(extras_of(t.document, "nodes", 4), "luxel_baked"), "true");
    assert_null(json_object_get(extras_of(t.document, "nodes", 0), "luxel_baked"));
    end_trip(&t);
}

static void export_marks_emissive_materials_that_are_baked(void **state)
{
    (void)state;
    file *f = new_file("[{\"mesh\":0},{\"mesh\":1},{\"mesh\":2}]");
    for (int i = 0; i < 3; ++i) {
        json_t *primitive = quad_primitive(f);
        json_object_set_new(primitive, "material", json_integer(i));
        add_mesh(f, primitive);
    }
    push(f, "materials", parse("{\"emissiveFactor\":[1,1,1]}"));
    push(f, "materials", parse("{\"emissiveFactor\":[1,1,1],\"extras\":{\"luxel_mode\":\"realtime\"}}"));
    push(f, "materials", parse("{\"emissiveFactor\":[0,0,0]}"));
    trip t = round_trip(f, 0, by_triangle);
    assert_json(extras_of(t.document, "materials", 0), "{\"luxel_baked\":true}");
    assert_json(extras_of(t.document, "materials", 1), "{\"luxel_mode\":\"realtime\"}");
    assert_null(extras_of(t.document, "materials", 2));
    end_trip(&t);
}

static void export_instances_get_rectangles_and_pages(void **state)
{
    (void)state;
    static const float places[9] = {0, 0, 0, 2, 0, 0, 4, 0, 0};
    file *f = quad_file("[{\"mesh\":0,\"extensions\":{\"EXT_mesh_gpu_instancing\":{\"attributes\":{}}}}]");
    use_extension(f, "EXT_mesh_gpu_instancing");
    const int translation = ADD_ACCESSOR(f, type_f32, "VEC3", 3, places);
    json_t *node = item(f->document, "nodes", 0);
    json_t *attributes = json_object_get(json_object_get(json_object_get(node, "extensions"), "EXT_mesh_gpu_instancing"), "attributes");
    json_object_set_new(attributes, "TRANSLATION", json_integer(translation));
    trip t = begin_trip(f, 1, by_triangle);
    assert_int_equal(t.before->instance_count, 3);
    t.atlas->rects[1].used = false;
    export_trip(&t);
    node = item(t.document, "nodes", 0);
    attributes = json_object_get(json_object_get(json_object_get(node, "extensions"), "EXT_mesh_gpu_instancing"), "attributes");
    static const float rects[12] = {0.25f, 0.125f, 0.25f, 0, 0, 0, 0, 0, 0.25f, 0.125f, 0.25f, 0.125f}, pages[3] = {0, -1, 0};
    const json_int_t rect = number_in(attributes, "_LUXEL_RECT"), page = number_in(attributes, "_LUXEL_PAGE");
    assert_memory_equal(data_of(&t, rect), rects, sizeof rects);
    assert_memory_equal(data_of(&t, page), pages, sizeof pages);
    assert_memory_equal(data_of(&t, number_in(attributes, "TRANSLATION")), places, sizeof places);
    assert_string_equal(json_string_value(json_object_get(accessor_of(t.document, rect), "type")), "VEC4");
    assert_string_equal(json_string_value(json_object_get(accessor_of(t.document, page), "type")), "SCALAR");
    assert_json(extras_of(t.document, "nodes", 0), "{\"luxel_lightmap\":{\"texCoord\":1}}");
    assert_int_equal(t.after->instance_count, 3);
    end_trip(&t);
}

// ---- what is kept

static void export_keeps_everything_it_does_not_know(void **state)
{
    (void)state;
    file *f = quad_file("[{\"mesh\":0,\"name\":\"n\\u00e4me\",\"extensions\":{\"VENDOR_tag\":{\"label\":\"x\",\"weight\":0.1}}}]");
    use_extension(f, "VENDOR_tag");
    push(f, "cameras", parse("{\"type\":\"perspective\",\"perspective\":{\"yfov\":0.7,\"znear\":0.1},\"future\":{\"a\":[null,false]}}"));
    json_object_set_new(f->document, "extras", parse("{\"big\":9007199254740993,\"tiny\":1e-300}"));
    json_t *before = json_deep_copy(f->document);
    trip t = round_trip(f, 0, by_vertex);
    assert_true(json_equal(json_object_get(before, "cameras"), json_object_get(t.document, "cameras")));
    assert_true(json_equal(json_object_get(before, "extras"), json_object_get(t.document, "extras")));
    assert_true(json_equal(json_object_get(before, "scenes"), json_object_get(t.document, "scenes")));
    assert_true(json_equal(json_object_get(before, "extensionsUsed"), json_object_get(t.document, "extensionsUsed")));
    json_object_del(item(t.document, "nodes", 0), "extras");
    assert_true(json_equal(json_object_get(before, "nodes"), json_object_get(t.document, "nodes")));
    assert_json(json_object_get(t.document, "asset"),
                "{\"version\":\"2.0\",\"generator\":\"unit test\",\"extras\":{\"luxel\":\"" LX_VERSION "\"}}");
    json_decref(before);
    end_trip(&t);
}

static void export_keeps_animations(void **state)
{
    (void)state;
    static const float times[2] = {0, 1}, turns[8] = {0, 0, 0, 1, 0, 1, 0, 0};
    file *f = quad_file("[{\"mesh\":0},{}]");
    const int input = ADD_ACCESSOR(f, type_f32, "SCALAR", 2, times), output = ADD_ACCESSOR(f, type_f32, "VEC4", 2, turns);
    json_object_set_new(accessor_of(f->document, input), "min", parse("[0]"));
    json_object_set_new(accessor_of(f->document, input), "max", parse("[1]"));
    push(f, "animations", json_pack("{s[{sisi}]s[{sis{siss}}]}", "samplers", "input", input, "output", output, "channels", "sampler", 0,
                                    "target", "node", 1, "path", "rotation"));
    trip t = round_trip(f, 0, by_triangle); // drops the quad's two accessors, so these move
    const json_t *sampler = json_array_get(json_object_get(item(t.document, "animations", 0), "samplers"), 0);
    assert_int_not_equal(number_in(sampler, "input"), input);
    assert_memory_equal(data_of(&t, number_in(sampler, "input")), times, sizeof times);
    assert_memory_equal(data_of(&t, number_in(sampler, "output")), turns, sizeof turns);
    end_trip(&t);
}

static void export_with_an_unknown_extension_that_has_numbers_renumbers_nothing(void **state)
{
    (void)state;
    file *f = quad_file("[{\"mesh\":0}]");
    static const float secret[4] = {1, 2, 3, 4};
    use_extension(f, "VENDOR_table");
    const int column = ADD_ACCESSOR(f, type_f32, "SCALAR", 4, secret);
    json_object_set_new(f->document, "extensions", json_pack("{s{si}}", "VENDOR_table", "column", column));
    trip t = round_trip(f, 0, by_triangle);
    assert_memory_equal(data_of(&t, column), secret, sizeof secret);
    assert_memory_equal(data_of(&t, 0), quad_positions, sizeof quad_positions); // replaced, but kept
    end_trip(&t);
}

static void export_keeps_accessors_that_the_input_did_not_use(void **state)
{
    (void)state;
    file *f = quad_file("[{\"mesh\":0}]");
    static const float spare[4] = {1, 2, 3, 4};
    const int index = ADD_ACCESSOR(f, type_f32, "SCALAR", 4, spare);
    json_object_set_new(accessor_of(f->document, index), "name", json_string("spare"));
    trip t = round_trip(f, 0, by_triangle);
    assert_string_equal(json_string_value(json_object_get(accessor_of(t.document, 0), "name")), "spare");
    assert_memory_equal(data_of(&t, 0), spare, sizeof spare);
    end_trip(&t);
}

// ---- size

static void export_drops_bytes_that_nothing_refers_to(void **state)
{
    (void)state;
    file *f = quad_file("[{\"mesh\":0}]");
    f->size += 50000; // after the last bufferView
    trip t = round_trip(f, 0, by_triangle);
    assert_true(t.bytes.size < 2000);
    assert_same_corners(&t);
    end_trip(&t);
}

static void export_keeps_overlapping_views_overlapping(void **state)
{
    (void)state;
    file *f = quad_file("[{\"mesh\":0}]");
    const json_t *whole = item(f->document, "bufferViews", 0);
    for (int i = 0; i < 100; ++i) {
        json_t *view = json_deep_copy(whole);
        json_object_set_new(view, "byteLength", json_integer(48 - 4 * (i % 4)));
        push(f, "bufferViews", view);
    }
    trip t = round_trip(f, 0, by_vertex);
    const json_t *buffer = item(t.document, "buffers", 0);
    assert_int_equal(number_in(buffer, "byteLength"), 48 + 12 + 32);
    assert_same_corners(&t);
    end_trip(&t);
}

static void export_keeps_the_alignment_of_views_that_touch(void **state)
{
    (void)state;
    file *f = quad_file("[{\"mesh\":0}]");
    memmove(f->bin + 4, f->bin, f->size); // two spare bytes, two that have a view, then what was there
    f->size += 4;
    for (size_t i = 0; i < 2; ++i) {
        json_t *view = item(f->document, "bufferViews", i);
        json_object_set_new(view, "byteOffset", json_integer(4 + number_in(view, "byteOffset")));
    }
    push(f, "bufferViews", parse("{\"buffer\":0,\"byteOffset\":2,\"byteLength\":2}"));
    trip t = round_trip(f, 0, by_vertex);
    assert_int_equal(number_in(item(t.document, "bufferViews", 0), "byteOffset"), 4);
    assert_int_equal(number_in(item(t.document, "bufferViews", 2), "byteOffset"), 2);
    assert_same_corners(&t);
    end_trip(&t);
}

// ---- other files

static const char png_base64[] =
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==";

static void export_embeds_buffers_and_images_from_other_files(void **state)
{
    (void)state;
    static const uint8_t png[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n', 0, 0, 0, 13, 'I', 'H', 'D', 'R', 1};
    char folder[] = "/tmp/luxel-export-XXXXXX";
    assert_non_null(mkdtemp(folder));
    char *bin_path = lx_path_join(folder, "my data.bin"), *png_path = lx_path_join(folder, "tile.dat");
    assert_int_equal(lx_file_write(bin_path, quad_positions, sizeof quad_positions, NULL), LX_OK);
    assert_int_equal(lx_file_write(png_path, png, sizeof png, NULL), LX_OK);
    char *text = lx_format(
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"mode\":6}]}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"type\":\"VEC3\",\"count\":4}],"
        "\"bufferViews\":[{\"buffer\":1,\"byteLength\":48}],"
        "\"buffers\":[{\"byteLength\":4,\"name\":\"first\",\"uri\":\"data:application/octet-stream;base64,AAAAAA==\"},"
        "{\"byteLength\":48,\"uri\":\"my%%20data.bin\"}],"
        "\"images\":[{\"uri\":\"tile.dat\",\"mimeType\":\"image/jpeg\"},{\"name\":\"dot\",\"uri\":\"data:image/png;base64,%s\"},"
        "{\"uri\":\"tile.dat\"}]}",
        png_base64);
    trip t = {.context = quiet_context()};
    const lx_bytes bytes = {(uint8_t *)text, strlen(text)};
    t.before = import_bytes(t.context, &bytes, folder);
    t.atlas = fake_atlas(t.before, 0, by_triangle);
    export_trip(&t);
    assert_same_corners(&t);
    for (size_t i = 0; i < 3; ++i) {
        const json_t *image = item(t.document, "images", i);
        assert_null(json_object_get(image, "uri"));
        assert_string_equal(json_string_value(json_object_get(image, "mimeType")), "image/png");
        assert_string_equal(json_string_value(json_object_get(image, "name")), i == 1 ? "dot" : "tile.dat");
    }
    const json_t *view = item(t.document, "bufferViews", (size_t)number_in(item(t.document, "images", 0), "bufferView"));
    assert_int_equal(number_in(view, "byteLength"), sizeof png);
    assert_memory_equal(t.bytes.data + 28 + get_u32(t.bytes.data + 12) + number_in(view, "byteOffset"), png, sizeof png);
    assert_int_equal(number_in(item(t.document, "images", 0), "bufferView"), number_in(item(t.document, "images", 2), "bufferView"));
    assert_string_equal(json_string_value(json_object_get(item(t.document, "buffers", 0), "name")), "first");
    assert_int_equal(lx_folder_remove(folder, NULL), LX_OK);
    lx_free(text);
    lx_free(bin_path);
    lx_free(png_path);
    end_trip(&t);
}

static void export_of_an_export_is_the_same_file(void **state)
{
    (void)state;
    trip t = round_trip(quad_file("[{\"mesh\":0}]"), 0, by_vertex);
    lx_atlas *atlas = fake_atlas(t.after, 0, by_vertex);
    lx_bytes again = {0};
    assert_int_equal(lx_gltf_export(t.after, atlas, &again, NULL), LX_OK);
    assert_int_equal(again.size, t.bytes.size);
    assert_memory_equal(again.data, t.bytes.data, again.size);
    lx_bytes_release(&again);
    free_atlas(atlas);
    end_trip(&t);
}

// ---- lack of memory

static int allocations_left;

static void *failing_malloc(size_t size)
{
    return allocations_left-- > 0 ? malloc(size) : NULL;
}

static void export_without_memory_for_the_document_fails_cleanly(void **state)
{
    (void)state;
    file *f = quad_file("[{\"mesh\":0,\"extras\":7},{\"mesh\":1}]");
    json_t *primitive = quad_primitive(f);
    json_object_set_new(primitive, "material", json_integer(0));
    add_mesh(f, primitive);
    push(f, "materials", parse("{\"emissiveFactor\":[1,1,1]}"));
    push(f, "images", json_pack("{so}", "uri", json_sprintf("data:image/png;base64,%s", png_base64)));
    trip t = begin_trip(f, 1, by_triangle);
    lx_result result = LX_ERROR_OUT_OF_MEMORY;
    int count = 0;
    for (; result != LX_OK && count < 100000; ++count) {
        lx_error error = {0};
        allocations_left = count;
        json_set_alloc_funcs(failing_malloc, free);
        result = lx_gltf_export(t.before, t.atlas, &t.bytes, &error);
        json_set_alloc_funcs(malloc, free);
        if (result == LX_OK) break;
        assert_int_equal(result, LX_ERROR_OUT_OF_MEMORY);
        assert_null(t.bytes.data);
    }
    assert_true(count > 100);
    assert_int_equal(result, LX_OK);
    t.document = open_glb(&t.bytes);
    end_trip(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(export_nodes_get_rectangles_and_keep_other_extras),
        cmocka_unit_test(export_removes_the_marks_of_an_earlier_bake),
        cmocka_unit_test(export_marks_baked_lights_but_not_mixed_or_real_time_ones),
        cmocka_unit_test(export_marks_emissive_materials_that_are_baked),
        cmocka_unit_test(export_instances_get_rectangles_and_pages),
        cmocka_unit_test(export_keeps_everything_it_does_not_know),
        cmocka_unit_test(export_keeps_animations),
        cmocka_unit_test(export_with_an_unknown_extension_that_has_numbers_renumbers_nothing),
        cmocka_unit_test(export_keeps_accessors_that_the_input_did_not_use),
        cmocka_unit_test(export_drops_bytes_that_nothing_refers_to),
        cmocka_unit_test(export_keeps_overlapping_views_overlapping),
        cmocka_unit_test(export_keeps_the_alignment_of_views_that_touch),
        cmocka_unit_test(export_embeds_buffers_and_images_from_other_files),
        cmocka_unit_test(export_of_an_export_is_the_same_file),
        cmocka_unit_test(export_without_memory_for_the_document_fails_cleanly),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
