// glTF import: geometry, hierarchy, instances, materials, textures, cameras.
#include "unit/scene_fixture.h"

#include "image/image.h"

// --- Primitives and accessors ---

static void triangle_without_indices_is_read_in_vertex_order(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(ONE_NODE);
    assert_int_equal(scene->primitive_count, 1);
    const lx_primitive *p = &scene->primitives[0];
    assert_int_equal(p->vertex_count, 3);
    assert_int_equal(p->triangle_count, 1);
    assert_vec3(p->positions[1], 1, 0, 0);
    assert_int_equal(p->indices[2], 2);
    assert_null(p->normals);
    assert_null(p->colors);
    assert_int_equal(scene->materials[p->material].file_index, -1);
    assert_near(scene->materials[p->material].metallic, 1, 0);
    assert_string_equal(scene->instances[0].name, "tri");
    assert_int_equal(scene->triangle_count, 1);
    assert_vec3(scene->bounds.high, 1, 1, 0);
    assert_logged("note: scene: no lights");
    lx_scene_destroy(scene);
}

static lx_scene *import_mode(int mode, int index_count)
{
    bin_clear();
    BIN_FLOATS(0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 2, 2, 0);
    BIN_U8(0, 1, 2, 3, 4);
    char members[1024];
    snprintf(members, sizeof members,
             "'bufferViews':[{'buffer':0,'byteLength':60},{'buffer':0,'byteOffset':60,'byteLength':5}],"
             "'accessors':[{'bufferView':0,'componentType':5126,'count':5,'type':'VEC3'},"
             "{'bufferView':1,'componentType':5121,'count':%d,'type':'SCALAR'}],"
             "'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':1,'mode':%d}]}]" ONE_NODE,
             index_count, mode);
    return import_members(members);
}

static void strip_turns_every_second_triangle(void **state)
{
    (void)state;
    static const uint32_t expected[] = {0, 1, 2, 1, 3, 2, 2, 3, 4};
    lx_scene *scene = import_mode(5, 5);
    assert_int_equal(scene->primitives[0].triangle_count, 3);
    assert_memory_equal(scene->primitives[0].indices, expected, sizeof expected);
    lx_scene_destroy(scene);
}

static void fan_shares_its_first_vertex(void **state)
{
    (void)state;
    static const uint32_t expected[] = {1, 2, 0, 2, 3, 0, 3, 4, 0};
    lx_scene *scene = import_mode(6, 5);
    assert_memory_equal(scene->primitives[0].indices, expected, sizeof expected);
    lx_scene_destroy(scene);
}

static void incomplete_triangle_is_dropped_with_a_warning(void **state)
{
    (void)state;
    lx_scene *scene = import_mode(4, 5);
    assert_int_equal(scene->primitives[0].triangle_count, 1);
    assert_logged("warning: mesh 0: 1 primitives end in an incomplete triangle");
    lx_scene_destroy(scene);
}

static void points_and_lines_are_skipped_with_one_warning(void **state)
{
    (void)state;
    triangle_bin();
    lx_scene *scene =
        import_members(TRIANGLE_DATA ",'meshes':[{'name':'mix','primitives':["
                                     "{'attributes':{'POSITION':0},'mode':0},{'attributes':{'POSITION':0},'mode':1},"
                                     "{'attributes':{'POSITION':0},'mode':2},{'attributes':{'POSITION':0},'mode':3},"
                                     "{'attributes':{}},{'attributes':{'POSITION':0}}]}]" ONE_NODE);
    assert_int_equal(scene->primitive_count, 1);
    assert_int_equal(scene->primitives[0].file_primitive, 5);
    assert_logged("warning: mesh 0 'mix': 4 primitives of points or lines are skipped");
    assert_logged("warning: mesh 0 'mix': 1 primitives without POSITION are skipped");
    lx_scene_destroy(scene);
}

// One vertex attribute of a triangle, read through TEXCOORD_0.
static lx_vec2 second_texcoord(const void *data, size_t size, int component_type, bool normalized, int stride)
{
    triangle_bin();
    bin_bytes(data, size);
    char members[1024], stride_text[32] = "";
    if (stride) snprintf(stride_text, sizeof stride_text, ",'byteStride':%d", stride);
    snprintf(members, sizeof members,
             "'bufferViews':[{'buffer':0,'byteLength':36},{'buffer':0,'byteOffset':36,'byteLength':%zu%s}],"
             "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},"
             "{'bufferView':1,'componentType':%d,'normalized':%s,'count':3,'type':'VEC2'}],"
             "'meshes':[{'primitives':[{'attributes':{'POSITION':0,'TEXCOORD_0':1}}]}]" ONE_NODE,
             size, stride_text, component_type, normalized ? "true" : "false");
    lx_scene *scene = import_members(members);
    const lx_vec2 uv = scene->primitives[0].texcoords[0][1];
    assert_null(scene->primitives[0].texcoords[1]);
    lx_scene_destroy(scene);
    return uv;
}

static void every_component_type_is_converted(void **state)
{
    (void)state;
    const int8_t i8[] = {0, 0, -128, 127, 0, 0};
    const uint8_t u8[] = {0, 0, 255, 51, 0, 0};
    const int16_t i16[] = {0, 0, -32768, 32767, 0, 0};
    const uint16_t u16[] = {0, 0, 65535, 13107, 0, 0};
    const uint32_t u32[] = {0, 0, 7, 70000, 0, 0};
    const float f32[] = {0, 0, -0.5f, 3, 0, 0};
    lx_vec2 v = second_texcoord(i8, sizeof i8, 5120, true, 0);
    assert_near(v.x, -1, 0);
    assert_near(v.y, 1, 0);
    v = second_texcoord(i8, sizeof i8, 5120, false, 0);
    assert_near(v.x, -128, 0);
    v = second_texcoord(u8, sizeof u8, 5121, true, 0);
    assert_near(v.x, 1, 0);
    assert_near(v.y, 0.2, 1e-7);
    v = second_texcoord(u8, sizeof u8, 5121, false, 0);
    assert_near(v.y, 51, 0);
    v = second_texcoord(i16, sizeof i16, 5122, true, 0);
    assert_near(v.x, -1, 0);
    assert_near(v.y, 1, 0);
    v = second_texcoord(u16, sizeof u16, 5123, true, 0);
    assert_near(v.y, 0.2, 1e-7);
    v = second_texcoord(u32, sizeof u32, 5125, false, 0);
    assert_near(v.y, 70000, 0);
    v = second_texcoord(f32, sizeof f32, 5126, false, 0);
    assert_near(v.x, -0.5, 0);
}

static void byte_stride_is_obeyed(void **state)
{
    (void)state;
    const float padded[] = {0, 0, 99, 1, 2, 99, 0, 0, 99};
    const lx_vec2 v = second_texcoord(padded, sizeof padded, 5126, false, 12);
    assert_near(v.x, 1, 0);
    assert_near(v.y, 2, 0);
}

static void sparse_accessor_replaces_elements(void **state)
{
    (void)state;
    triangle_bin();
    BIN_U16(2, 0);
    BIN_FLOATS(0, 5, 0);
    lx_scene *scene =
        import_members("'bufferViews':[{'buffer':0,'byteLength':36},{'buffer':0,'byteOffset':36,'byteLength':4},{'"
                       "buffer':0,'byteOffset':40,'byteLength':12}],"
                       "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3','sparse':{'count':1,"
                       "'indices':{'bufferView':1,'componentType':5123},'values':{'bufferView':2}}}],"
                       "'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]" ONE_NODE);
    assert_vec3(scene->primitives[0].positions[1], 1, 0, 0);
    assert_vec3(scene->primitives[0].positions[2], 0, 5, 0);
    lx_scene_destroy(scene);
}

static void sparse_accessor_without_view_starts_from_zeros(void **state)
{
    (void)state;
    bin_clear();
    BIN_U8(1, 2, 0, 0);
    BIN_FLOATS(3, 0, 0, 0, 4, 0);
    lx_scene *scene =
        import_members("'bufferViews':[{'buffer':0,'byteLength':4},{'buffer':0,'byteOffset':4,'byteLength':24}],"
                       "'accessors':[{'componentType':5126,'count':3,'type':'VEC3','sparse':{'count':2,"
                       "'indices':{'bufferView':0,'componentType':5121},'values':{'bufferView':1}}}],"
                       "'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]" ONE_NODE);
    assert_vec3(scene->primitives[0].positions[0], 0, 0, 0);
    assert_vec3(scene->primitives[0].positions[1], 3, 0, 0);
    assert_vec3(scene->primitives[0].positions[2], 0, 4, 0);
    lx_scene_destroy(scene);
}

static void quantized_positions_keep_their_integers_unless_normalized(void **state)
{
    (void)state;
    bin_clear();
    BIN_U16(0, 0, 0, 0, 1000, 0, 0, 0, 0, 65535, 0, 0);
    lx_scene *scene =
        import_members("'extensionsUsed':['KHR_mesh_quantization'],'extensionsRequired':['KHR_mesh_quantization'],"
                       "'bufferViews':[{'buffer':0,'byteLength':24,'byteStride':8}],"
                       "'accessors':[{'bufferView':0,'componentType':5123,'count':3,'type':'VEC3'}],"
                       "'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}],"
                       "'nodes':[{'mesh':0,'scale':[0.001,0.001,0.001]}]");
    assert_vec3(scene->primitives[0].positions[1], 1000, 0, 0);
    assert_near(scene->bounds.high.y, 65.535, 1e-4);
    lx_scene_destroy(scene);
}

static void normals_are_made_unit_and_missing_ones_geometric(void **state)
{
    (void)state;
    triangle_bin();
    BIN_FLOATS(0, 0, 2, 0, 0, 0, 0, 3, 4);
    lx_scene *scene = import_members("'bufferViews':[{'buffer':0,'byteLength':72}],"
                                     "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},"
                                     "{'bufferView':0,'byteOffset':36,'componentType':5126,'count':3,'type':'VEC3'}],"
                                     "'meshes':[{'primitives':[{'attributes':{'POSITION':0,'NORMAL':1}}]}]" ONE_NODE);
    assert_vec3(scene->primitives[0].normals[0], 0, 0, 1);
    assert_vec3(scene->primitives[0].normals[1], 0, 0, 1);
    assert_vec3(scene->primitives[0].normals[2], 0, 0.6f, 0.8f);
    assert_logged("note: mesh 0: 1 normals without length");
    lx_scene_destroy(scene);
}

static void degenerate_triangles_are_counted_in_one_warning(void **state)
{
    (void)state;
    bin_clear();
    BIN_FLOATS(0, 0, 0, 1, 1, 1, 3, 3, 3, 0, 1e-6f, 0);
    BIN_U16(0, 1, 2, 0, 0, 1, 0, 1, 3, 0);
    lx_scene *scene =
        import_members("'bufferViews':[{'buffer':0,'byteLength':48},{'buffer':0,'byteOffset':48,'byteLength':18}],"
                       "'accessors':[{'bufferView':0,'componentType':5126,'count':4,'type':'VEC3'},"
                       "{'bufferView':1,'componentType':5123,'count':9,'type':'SCALAR'}],"
                       "'meshes':[{'name':'m','primitives':[{'attributes':{'POSITION':0},'indices':1}]}]" ONE_NODE);
    assert_int_equal(scene->primitives[0].triangle_count, 3);
    assert_logged("warning: mesh 0 'm': 2 degenerate triangles");
    lx_scene_destroy(scene);
}

static void check_colors(const char *type, int component_type, size_t size, float r, float a)
{
    char members[1024];
    snprintf(members, sizeof members,
             "'bufferViews':[{'buffer':0,'byteLength':36},{'buffer':0,'byteOffset':36,'byteLength':%zu}],"
             "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},"
             "{'bufferView':1,'componentType':%d,'normalized':%s,'count':3,'type':'%s'}],"
             "'meshes':[{'primitives':[{'attributes':{'POSITION':0,'COLOR_0':1}}]}]" ONE_NODE,
             size, component_type, component_type == 5126 ? "false" : "true", type);
    lx_scene *scene = import_members(members);
    assert_near(scene->primitives[0].colors[1].x, r, 1e-6);
    assert_near(scene->primitives[0].colors[1].w, a, 1e-6);
    lx_scene_destroy(scene);
}

static void vertex_colors_come_in_all_types(void **state)
{
    (void)state;
    triangle_bin();
    BIN_U8(0, 0, 0, 0, 51, 0, 0, 102, 0, 0, 0, 0);
    check_colors("VEC4", 5121, 12, 0.2f, 0.4f);
    triangle_bin();
    BIN_U8(0, 0, 0, 51, 0, 0, 0, 0, 0);
    check_colors("VEC3", 5121, 9, 0.2f, 1);
    triangle_bin();
    BIN_U16(0, 0, 0, 0, 13107, 0, 0, 26214, 0, 0, 0, 0);
    check_colors("VEC4", 5123, 24, 0.2f, 0.4f);
    triangle_bin();
    BIN_FLOATS(0, 0, 0, 0, 2, 0, 0, 0.5f, 0, 0, 0, 0);
    check_colors("VEC4", 5126, 48, 2, 0.5f);
    triangle_bin();
    BIN_FLOATS(0, 0, 0, -1, 0, 0, 0, 0, 0);
    check_colors("VEC3", 5126, 36, 0, 1); // below zero makes no sense
}

// --- Morph targets ---

#define MORPH_DATA                                                                                                     \
    "'bufferViews':[{'buffer':0,'byteLength':36},{'buffer':0,'byteOffset':36,'byteLength':36},"                        \
    "{'buffer':0,'byteOffset':72,'byteLength':4},{'buffer':0,'byteOffset':76,'byteLength':12}],"                       \
    "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},"                                      \
    "{'bufferView':1,'componentType':5126,'count':3,'type':'VEC3'},"                                                   \
    "{'componentType':5126,'count':3,'type':'VEC3','sparse':{'count':1,'indices':{'bufferView':2,'componentType':"     \
    "5121},'values':{'bufferView':3}}}],"                                                                              \
    "'meshes':[{'name':'face','weights':[0.5,0],'primitives':[{'attributes':{'POSITION':0},'targets':[{'POSITION':1}," \
    "{'POSITION':2}]}]}]"

static void morph_bin(void)
{
    triangle_bin();
    BIN_FLOATS(0, 0, 2, 0, 0, 2, 0, 0, 2);
    BIN_U8(1, 0, 0, 0);
    BIN_FLOATS(10, 0, 0);
}

static void morph_targets_are_added_at_default_weights(void **state)
{
    (void)state;
    morph_bin();
    lx_scene *scene = import_members(MORPH_DATA ONE_NODE);
    assert_vec3(scene->primitives[0].positions[1], 1, 0, 1);
    assert_true(scene->instances[0].is_static);
    lx_scene_destroy(scene);
}

static void node_weights_override_mesh_weights(void **state)
{
    (void)state;
    morph_bin();
    lx_scene *scene =
        import_members(MORPH_DATA ",'nodes':[{'mesh':0},{'mesh':0,'weights':[0,1]},{'mesh':0,'weights':[0.5,0]}]");
    assert_int_equal(scene->mesh_count, 2); // the third node's weights are the mesh's
    assert_int_equal(scene->instances[0].mesh, scene->instances[2].mesh);
    const lx_mesh *other = &scene->meshes[scene->instances[1].mesh];
    assert_int_equal(other->file_index, 0);
    assert_vec3(scene->primitives[other->first_primitive].positions[1], 11, 0, 0);
    assert_vec3(scene->primitives[other->first_primitive].positions[0], 0, 0, 0);
    lx_scene_destroy(scene);
}

static void wrong_number_of_weights_is_refused(void **state)
{
    (void)state;
    morph_bin();
    assert_refused(MORPH_DATA ",'nodes':[{'mesh':0,'weights':[0,1,2]}]", LX_ERROR_FORMAT,
                   "mesh 0 'face' primitive 0: 3 weights for 2 morph targets");
}

static void color_targets_may_have_three_or_four_channels(void **state)
{
    (void)state;
    for (int channels = 3; channels <= 4; ++channels) {
        char members[1024];
        triangle_bin();
        BIN_FLOATS(0.1f, 0.2f, 0.3f, 0.5f, 0.1f, 0.2f, 0.3f, 0.5f, 0.1f, 0.2f, 0.3f, 0.5f);
        snprintf(
            members, sizeof members,
            "'bufferViews':[{'buffer':0,'byteLength':36},{'buffer':0,'byteOffset':36,'byteLength':48,'byteStride':16}],"
            "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},"
            "{'bufferView':1,'componentType':5126,'count':3,'type':'VEC4'},"
            "{'bufferView':1,'componentType':5126,'count':3,'type':'VEC%d'}],"
            "'meshes':[{'weights':[2],'primitives':[{'attributes':{'POSITION':0,'COLOR_0':1},'targets':[{'COLOR_0':2}]}"
            "]}]" ONE_NODE,
            channels);
        lx_scene *scene = import_members(members);
        assert_near(scene->primitives[0].colors[1].z, 0.9, 1e-6);
        assert_near(scene->primitives[0].colors[1].w, channels == 4 ? 1.5 : 0.5, 1e-6);
        lx_scene_destroy(scene);
    }
}

static void morph_targets_that_overflow_are_refused(void **state)
{
    (void)state;
    triangle_bin();
    BIN_FLOATS(3e38f, 0, 0, 0, 0, 0, 0, 0, 0);
    assert_refused(
        "'bufferViews':[{'buffer':0,'byteLength':36},{'buffer':0,'byteOffset':36,'byteLength':36}],"
        "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},{'bufferView':1,'componentType':"
        "5126,'count':3,'type':'VEC3'}],"
        "'meshes':[{'weights':[2],'primitives':[{'attributes':{'POSITION':0},'targets':[{'POSITION':1}]}]}]" ONE_NODE,
        LX_ERROR_FORMAT, "mesh 0 primitive 0: morph targets make its vertices infinite");
}

// --- Hierarchy ---

static void transforms_multiply_down_the_hierarchy(void **state)
{
    (void)state;
    lx_scene *scene =
        import_triangle(",'nodes':[{'translation':[10,0,0],'children':[1]},{'scale':[1,-2,1],'children':[2]},"
                        "{'mesh':0,'matrix':[0,1,0,0, -1,0,0,0, 0,0,1,0, 0,0,5,1]}]");
    const lx_mat4 m = scene->instances[0].transform;
    assert_vec3(lx_mat4_point(m, lx_v3(1, 0, 0)), 10, -2, 5);
    assert_true(lx_mat4_determinant3(m) < 0);
    lx_scene_destroy(scene);
}

static void rotation_that_is_not_unit_is_normalized(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(",'nodes':[{'mesh':0,'rotation':[0,0,3,3]},{'mesh':0,'rotation':[0,0,0,0]}]");
    assert_vec3(lx_mat4_point(scene->instances[0].transform, lx_v3(1, 0, 0)), 0, 1, 0);
    assert_vec3(lx_mat4_point(scene->instances[1].transform, lx_v3(1, 0, 0)), 1, 0, 0);
    assert_logged("warning: node 1: a rotation of length zero");
    lx_scene_destroy(scene);
}

static void only_the_default_scene_is_read(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(
        ",'scene':1,'scenes':[{'nodes':[0]},{'nodes':[1]}],'nodes':[{'mesh':0,'name':'a'},{'mesh':0,'name':'b'}]");
    assert_int_equal(scene->instance_count, 1);
    assert_string_equal(scene->instances[0].name, "b");
    lx_scene_destroy(scene);
    scene = import_triangle(
        ",'scenes':[{'nodes':[0]},{'nodes':[1]}],'nodes':[{'mesh':0,'name':'a'},{'mesh':0,'name':'b'}]");
    assert_int_equal(scene->instance_count, 1);
    assert_string_equal(scene->instances[0].name, "a");
    lx_scene_destroy(scene);
    scene = import_triangle(",'nodes':[{'mesh':0,'name':'a'},{'mesh':0,'name':'b'}]");
    assert_int_equal(scene->instance_count, 2);
    lx_scene_destroy(scene);
}

static void deep_chain_of_nodes_needs_no_stack(void **state)
{
    (void)state;
    enum { depth = 4000 };
    char *nodes = malloc(64 * depth);
    size_t length = (size_t)sprintf(nodes, ",'nodes':[");
    for (int i = 0; i < depth - 1; ++i) length += (size_t)sprintf(nodes + length, "{'children':[%d]},", i + 1);
    sprintf(nodes + length, "{'mesh':0}]");
    lx_scene_destroy(import_triangle(nodes));
    free(nodes);
}

static void gpu_instances_become_instances(void **state)
{
    (void)state;
    triangle_bin();
    BIN_FLOATS(1, 0, 0, 2, 0, 0);
    const int16_t rotations[] = {0, 0, 0, 32767, 0, 0, 23170, 23170};
    bin_bytes(rotations, sizeof rotations);
    lx_scene *scene = import_members("'extensionsUsed':['EXT_mesh_gpu_instancing'],"
                                     "'bufferViews':[{'buffer':0,'byteLength':36},{'buffer':0,'byteOffset':36,'"
                                     "byteLength':24},{'buffer':0,'byteOffset':60,'byteLength':16}],"
                                     "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},{'"
                                     "bufferView':1,'componentType':5126,'count':2,'type':'VEC3'},"
                                     "{'bufferView':2,'componentType':5122,'normalized':true,'count':2,'type':'VEC4'}],"
                                     "'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}],"
                                     "'nodes':[{'name':'crowd','mesh':0,'translation':[0,0,7],'extensions':{'EXT_mesh_"
                                     "gpu_instancing':{'attributes':{'TRANSLATION':1,'ROTATION':2}}}}]");
    assert_int_equal(scene->instance_count, 2);
    assert_int_equal(scene->surface_count, 2);
    assert_int_equal(scene->instances[1].gpu_instance, 1);
    assert_vec3(lx_mat4_point(scene->instances[0].transform, lx_v3(1, 0, 0)), 2, 0, 7);
    assert_vec3(lx_mat4_point(scene->instances[1].transform, lx_v3(1, 0, 0)), 2, 1, 7);
    lx_scene_destroy(scene);
}

static void what_moves_is_not_static_and_listed_once(void **state)
{
    (void)state;
    triangle_bin();
    BIN_FLOATS(0, 1);
    lx_scene *scene = import_members(
        "'extensionsUsed':['KHR_lights_punctual'],'extensions':{'KHR_lights_punctual':{'lights':[{'type':'point'}]}},"
        "'bufferViews':[{'buffer':0,'byteLength':36},{'buffer':0,'byteOffset':36,'byteLength':8}],"
        "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},{'bufferView':1,'componentType':"
        "5126,'count':2,'type':'SCALAR'}],"
        "'materials':[{'emissiveFactor':[1,1,1]}],"
        "'meshes':[{'primitives':[{'attributes':{'POSITION':0},'material':0}]}],'skins':[{'joints':[0]}],"
        "'animations':[{'samplers':[{'input':1,'output':1}],'channels':[{'sampler':0,'target':{'node':0,'path':'"
        "rotation'}},"
        "{'sampler':0,'target':{'node':4,'path':'weights'}}]}],"
        "'nodes':[{'name':'door','children':[1,2]},{'name':'leaf','mesh':0},"
        "{'name':'lamp','extensions':{'KHR_lights_punctual':{'light':0}}},"
        "{'name':'hero','mesh':0,'skin':0},{'name':'face','mesh':0},{'name':'wall','mesh':0}]");
    assert_int_equal(scene->instance_count, 4);
    for (uint32_t i = 0; i < 4; ++i)
        assert_int_equal(scene->instances[i].is_static, strcmp(scene->instances[i].name, "wall") == 0);
    assert_int_equal(scene->source_count, 1); // the wall; the others are realtime
    assert_string_equal(scene->sources[0].name, "wall");
    assert_int_equal(scene->surfaces[0].source, -1);
    assert_int_equal(scene->light_count, 1);
    assert_logged(
        "note: not static, so not baked: node 1 'leaf' (animated), node 2 'lamp' (animated), node 3 'hero' (skinned), "
        "node 4 'face' (animated shape)\n");
    lx_scene_destroy(scene);
}

static void long_lists_of_what_moves_are_cut(void **state)
{
    (void)state;
    char nodes[2048] = ",'animations':[{'samplers':[{'input':0,'output':0}],'channels':[{'sampler':0,'target':{'node':"
                       "0,'path':'scale'}}]}],"
                       "'nodes':[{'children':[1,2,3,4,5,6,7,8,9,10]}";
    for (int i = 0; i < 10; ++i) strcat(nodes, ",{'mesh':0}");
    strcat(nodes, "]");
    lx_scene_destroy(import_triangle(nodes));
    assert_logged("node 8 (animated) and 2 more\n");
    assert_not_logged("node 9");
}

static void bounds_of_very_many_triangles_come_from_boxes(void **state)
{
    (void)state;
    // 600 instances of a mesh of 20000 triangles, all but one of them without area.
    bin_clear();
    BIN_FLOATS(0, 0, 0, 1, 0, 0, 0, 1, 0);
    BIN_U32(0, 1, 2);
    BIN_U32(599);
    BIN_FLOATS(5, 6, 7);
    lx_scene *scene = import_members(
        "'extensionsUsed':['EXT_mesh_gpu_instancing'],'bufferViews':[{'buffer':0,'byteLength':36},{'buffer':0,'"
        "byteOffset':36,'byteLength':12},"
        "{'buffer':0,'byteOffset':48,'byteLength':4},{'buffer':0,'byteOffset':52,'byteLength':12}],"
        "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},"
        "{'componentType':5125,'count':60000,'type':'SCALAR','sparse':{'count':3,'indices':{'bufferView':1,'"
        "componentType':5125},'values':{'bufferView':1}}},"
        "{'componentType':5126,'count':600,'type':'VEC3','sparse':{'count':1,'indices':{'bufferView':2,'componentType':"
        "5125},'values':{'bufferView':3}}}],"
        "'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':1}]}],"
        "'nodes':[{'mesh':0,'extensions':{'EXT_mesh_gpu_instancing':{'attributes':{'TRANSLATION':2}}}}]");
    assert_int_equal(scene->triangle_count, 12000000);
    assert_vec3(scene->bounds.low, 0, 0, 0);
    assert_vec3(scene->bounds.high, 6, 7, 7);
    lx_scene_destroy(scene);
}

static void gpu_instances_with_unequal_counts_are_refused(void **state)
{
    (void)state;
    triangle_bin();
    assert_refused(
        "'bufferViews':[{'buffer':0,'byteLength':36}],'accessors':[{'bufferView':0,'componentType':5126,'count':3,'"
        "type':'VEC3'},"
        "{'bufferView':0,'componentType':5126,'count':2,'type':'VEC3'}],'meshes':[{'primitives':[{'attributes':{'"
        "POSITION':0}}]}],"
        "'nodes':[{'mesh':0,'extensions':{'EXT_mesh_gpu_instancing':{'attributes':{'TRANSLATION':0,'SCALE':1}}}}]",
        LX_ERROR_FORMAT, "node 0 EXT_mesh_gpu_instancing attributes: SCALE (accessor 1) has 2 elements, others 3");
    assert_triangle_refused(
        ",'nodes':[{'mesh':0,'extensions':{'EXT_mesh_gpu_instancing':{'attributes':{'ROTATION':0}}}}]", LX_ERROR_FORMAT,
        "node 0 EXT_mesh_gpu_instancing attributes: ROTATION (accessor 0) is not of type VEC4");
    assert_triangle_refused(",'nodes':[{'mesh':0,'extensions':{'EXT_mesh_gpu_instancing':{}}}]", LX_ERROR_FORMAT,
                            "node 0 EXT_mesh_gpu_instancing: no attributes");
}

static void animation_pointers_move_nodes_but_colours_do_not(void **state)
{
    (void)state;
    lx_scene *scene =
        import_triangle(",'extensionsUsed':['KHR_animation_pointer'],'extensionsRequired':['KHR_animation_pointer'],"
                        "'materials':[{}],'animations':[{'samplers':[{'input':0,'output':0}],'channels':["
                        "{'sampler':0,'target':{'path':'pointer','extensions':{'KHR_animation_pointer':{'pointer':'/"
                        "nodes/1/translation'}}}},"
                        "{'sampler':0,'target':{'path':'pointer','extensions':{'KHR_animation_pointer':{'pointer':'/"
                        "materials/0/pbrMetallicRoughness/baseColorFactor'}}}}]}],"
                        "'nodes':[{'mesh':0},{'mesh':0}]");
    assert_true(scene->instances[0].is_static);
    assert_false(scene->instances[1].is_static);
    lx_scene_destroy(scene);
}

// --- Materials and textures ---

static lx_scene *import_material(const char *material, const char *more)
{
    char members[2048];
    triangle_bin();
    snprintf(members, sizeof members, TRIANGLE_MATERIAL ",'materials':[%s]" ONE_NODE "%s", material, more);
    return import_members(members);
}

static void material_factors_are_read(void **state)
{
    (void)state;
    lx_scene *scene = import_material(
        "{'name':'wood','pbrMetallicRoughness':{'baseColorFactor':[0.1,0.2,0.3,0.4],'metallicFactor':0.5,"
        "'roughnessFactor':0.25},'emissiveFactor':[0.5,0,1],'alphaMode':'MASK','alphaCutoff':0.75,'doubleSided':true,"
        "'extensions':{'KHR_materials_emissive_strength':{'emissiveStrength':20},'KHR_materials_unlit':{},"
        "'KHR_materials_transmission':{'transmissionFactor':0.9}}}",
        "");
    const lx_material *m = &scene->materials[0];
    assert_string_equal(m->name, "wood");
    assert_near(m->base_color.g, 0.2, 1e-7);
    assert_near(m->base_alpha, 0.4, 1e-7);
    assert_near(m->metallic, 0.5, 0);
    assert_near(m->roughness, 0.25, 0);
    assert_near(m->emissive_factor.r, 0.5, 0);
    assert_near(m->emissive_strength, 20, 0);
    assert_near(m->transmission, 0.9, 1e-7);
    assert_int_equal(m->alpha_mode, LX_ALPHA_MASK);
    assert_near(m->alpha_cutoff, 0.75, 0);
    assert_true(m->double_sided && m->unlit);
    assert_false(lx_material_emits(m)); // unlit materials ignore emission
    assert_int_equal(m->sampled_texcoords, 0);
    lx_scene_destroy(scene);
}

static void specular_glossiness_gives_its_diffuse(void **state)
{
    (void)state;
    lx_scene *scene = import_material(
        "{'pbrMetallicRoughness':{'baseColorFactor':[1,0,0,1]},'extensions':{'KHR_materials_pbrSpecularGlossiness':"
        "{'diffuseFactor':[0,0.5,0,0.25],'glossinessFactor':0.75}}}",
        "");
    const lx_material *m = &scene->materials[0];
    assert_near(m->base_color.r, 0, 0);
    assert_near(m->base_color.g, 0.5, 0);
    assert_near(m->base_alpha, 0.25, 0);
    assert_near(m->metallic, 0, 0);
    assert_near(m->roughness, 0.25, 0);
    lx_scene_destroy(scene);
}

static void emissive_factor_above_one_moves_to_the_strength(void **state)
{
    (void)state;
    lx_scene *scene = import_material("{'emissiveFactor':[4,2,0]}", "");
    assert_near(scene->materials[0].emissive_factor.r, 1, 0);
    assert_near(scene->materials[0].emissive_factor.g, 0.5, 0);
    assert_near(scene->materials[0].emissive_strength, 4, 0);
    lx_scene_destroy(scene);
}

// A material with a 2×2 PNG, and its JSON in `members`: red, green / blue, half transparent white.
static lx_scene *import_textured(const char *info, const char *sampler, const char *texture)
{
    lx_image image;
    lx_bytes png;
    static const uint8_t pixels[] = {255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 128};
    assert_int_equal(lx_image_create(2, 2, 4, LX_PIXEL_U8, &image, NULL), LX_OK);
    memcpy(image.u8, pixels, sizeof pixels);
    assert_int_equal(lx_png_encode(&image, &png, NULL), LX_OK);
    lx_image_release(&image);
    triangle_bin();
    bin_bytes(png.data, png.size);
    char members[2048];
    snprintf(members, sizeof members,
             "'bufferViews':[{'buffer':0,'byteLength':36},{'buffer':0,'byteOffset':36,'byteLength':%zu}],"
             "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'}],"
             "'meshes':[{'primitives':[{'attributes':{'POSITION':0},'material':0}]}],"
             "'images':[{'bufferView':1,'mimeType':'image/png'},{'bufferView':0,'mimeType':'image/"
             "png'}],'samplers':[%s],'textures':[%s],"
             "'materials':[{'pbrMetallicRoughness':{'baseColorTexture':%s}}]" ONE_NODE,
             png.size, sampler, texture, info);
    lx_bytes_release(&png);
    return import_members(members);
}

static void textures_are_sampled_as_the_sampler_says(void **state)
{
    (void)state;
    lx_scene *scene =
        import_textured("{'index':0,'texCoord':1}", "{'wrapS':33071,'wrapT':33648}", "{'source':0,'sampler':0}");
    const lx_texture_slot *slot = &scene->materials[0].base_color_texture;
    assert_int_equal(scene->images[0].width, 2);
    assert_int_equal(scene->images[1].width, 0); // not used, so not decoded (it is no image at all)
    assert_int_equal(slot->texcoord, 1);
    lx_vec4 c = lx_texture_sample(scene, slot, lx_v2(0.25f, 0.25f), false);
    assert_near(c.x, 1, 0);
    assert_near(c.y, 0, 0);
    c = lx_texture_sample(scene, slot, lx_v2(0.5f, 0.25f), true); // half way between the centres, in linear light
    assert_near(c.x, 0.5, 1e-6);
    assert_near(c.y, 0.5, 1e-6);
    c = lx_texture_sample(scene, slot, lx_v2(-7, 0.25f), false); // clamped in u
    assert_near(c.x, 1, 0);
    c = lx_texture_sample(scene, slot, lx_v2(0.25f, -0.25f), false); // mirrored in v
    assert_near(c.x, 1, 0);
    c = lx_texture_sample(scene, slot, lx_v2(0.75f, 0.75f), true);
    assert_near(c.w, 128 / 255.0, 1e-6);
    assert_true(lx_texture_has_alpha(scene, slot));
    lx_scene_destroy(scene);
}

static void nearest_and_repeat_are_obeyed(void **state)
{
    (void)state;
    lx_scene *scene = import_textured("{'index':0}", "{'magFilter':9728}", "{'source':0,'sampler':0}");
    const lx_texture_slot *slot = &scene->materials[0].base_color_texture;
    lx_vec4 c = lx_texture_sample(scene, slot, lx_v2(0.49f, 0.01f), false);
    assert_near(c.x, 1, 0);
    c = lx_texture_sample(scene, slot, lx_v2(-0.3f, 5.1f), false); // repeats to (0.7, 0.1)
    assert_near(c.x, 0, 0);
    assert_near(c.y, 1, 0);
    lx_scene_destroy(scene);
}

static void texture_lookup_survives_any_coordinate(void **state)
{
    (void)state;
    static const float wild[] = {0,     -0.0f,    1,        1e-40f,    1e9f, -1e9f,
                                 1e30f, -3.4e38f, INFINITY, -INFINITY, NAN,  16777217.0f};
    const size_t count = sizeof wild / sizeof *wild;
    static const char *const samplers[] = {"{}", "{'wrapS':33071,'wrapT':33071}", "{'wrapS':33648,'wrapT':33648}",
                                           "{'magFilter':9728}"};
    for (int s = 0; s < 4; ++s) {
        lx_scene *scene = import_textured("{'index':0}", samplers[s], "{'source':0,'sampler':0}");
        for (size_t i = 0; i < count * count; ++i) {
            const lx_vec4 c = lx_texture_sample(scene, &scene->materials[0].base_color_texture,
                                                lx_v2(wild[i % count], wild[i / count]), true);
            const float most = 1.000001f; // weights of bilinear filtering may round up
            assert_true(c.x >= 0 && c.x <= most && c.y >= 0 && c.y <= most && c.z >= 0 && c.z <= most && c.w > 0 &&
                        c.w <= most);
        }
        lx_scene_destroy(scene);
    }
}

static void texture_transform_matches_the_specification(void **state)
{
    (void)state;
    // The example of the specification: the lower left quadrant, turned by 90 degrees.
    lx_scene *scene = import_textured("{'index':0,'texCoord':3,'extensions':{'KHR_texture_transform':{'offset':[0,1],"
                                      "'rotation':1.57079632679,'scale':[0.5,0.5],'texCoord':2}}}",
                                      "{}", "{'source':0}");
    const lx_texture_slot *slot = &scene->materials[0].base_color_texture;
    assert_int_equal(slot->texcoord, 2);
    const float *m = slot->m;
    assert_near(m[0] * 1 + m[1] * 1 + m[2], 0.5, 1e-6); // u' = v / 2
    assert_near(m[3] * 1 + m[4] * 1 + m[5], 0.5, 1e-6); // v' = 1 - u / 2
    assert_near(m[0] * 1 + m[1] * 0 + m[2], 0, 1e-6);
    assert_near(m[3] * 0 + m[4] * 1 + m[5], 1, 1e-6);
    lx_scene_destroy(scene);
}

static void texture_set_beyond_those_read_is_replaced_with_a_warning(void **state)
{
    (void)state;
    lx_scene *scene = import_textured("{'index':0,'texCoord':4}", "{}", "{'source':0}");
    assert_int_equal(scene->materials[0].base_color_texture.texcoord, 0);
    assert_logged("warning: material 0 pbrMetallicRoughness baseColorTexture: TEXCOORD_4 is not read");
    lx_scene_destroy(scene);
}

static void webp_source_is_preferred(void **state)
{
    (void)state;
    lx_scene *scene =
        import_textured("{'index':0}", "{}", "{'source':1,'extensions':{'EXT_texture_webp':{'source':0}}}");
    assert_int_equal(scene->textures[0].image, 0);
    lx_scene_destroy(scene);
}

static void texture_without_readable_source_is_white(void **state)
{
    (void)state;
    lx_scene *scene = import_textured("{'index':0}", "{}", "{'extensions':{'KHR_texture_basisu':{'source':0}}}");
    assert_logged("warning: texture 0: no image that can be read; taken as white");
    const lx_vec4 c = lx_texture_sample(scene, &scene->materials[0].base_color_texture, lx_v2(0, 0), true);
    assert_near(c.x, 1, 0);
    lx_scene_destroy(scene);
}

// --- Cameras ---

static void cameras_lose_their_scale(void **state)
{
    (void)state;
    lx_scene *scene =
        import_triangle(",'cameras':[{'type':'perspective','perspective':{'yfov':0.8,'aspectRatio':1.5,'znear':0.1}},"
                        "{'name':'map','type':'orthographic','orthographic':{'xmag':4,'ymag':2,'znear':0,'zfar':1}},"
                        "{'type':'perspective','perspective':{'yfov':-1,'znear':0.1}}],"
                        "'nodes':[{'mesh':0},{'name':'eye','camera':0,'translation':[1,2,3],'scale':[5,6,7]},{'camera':"
                        "1},{'camera':2}]");
    assert_int_equal(scene->camera_count, 2);
    assert_string_equal(scene->cameras[0].name, "eye");
    assert_string_equal(scene->cameras[1].name, "map");
    assert_near(scene->cameras[0].yfov, 0.8, 1e-6);
    assert_near(scene->cameras[0].aspect, 1.5, 1e-6);
    assert_vec3(lx_mat4_point(scene->cameras[0].transform, lx_v3(0, 0, -1)), 1, 2, 2);
    assert_false(scene->cameras[1].perspective);
    assert_logged("warning: camera 2: its angles or extents make no picture");
    lx_scene_destroy(scene);
}

static void byte_order_mark_and_zero_padding_are_forgiven(void **state)
{
    (void)state;
    triangle_bin();
    char *plain = make_gltf(TRIANGLE ONE_NODE);
    char text[2048];
    const int length = snprintf(text, sizeof text - 2, "\xef\xbb\xbf%s", plain);
    text[length] = text[length + 1] = '\0';
    lx_scene *scene;
    lx_error error;
    assert_int_equal(import_text(text, (size_t)length + 2, &scene, &error), LX_OK);
    lx_scene_destroy(scene);
    free(plain);
}

static void description_lists_lights_and_cameras(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(",'extensionsUsed':['KHR_lights_punctual'],'extensions':{'KHR_lights_punctual':{'"
                                      "lights':[{'type':'spot','range':3},{'type':'directional'}]}},"
                                      "'cameras':[{'type':'perspective','perspective':{'yfov':0.5,'znear':1}},{'type':'"
                                      "orthographic','orthographic':{'xmag':2,'ymag':2,'zfar':1,'znear':0}}],"
                                      "'nodes':[{'mesh':0,'camera':0},{'camera':1},{'name':'stage','extensions':{'KHR_"
                                      "lights_punctual':{'light':0}},'extras':{'luxel_layer':'show'}},"
                                      "{'name':'sun','extensions':{'KHR_lights_punctual':{'light':1}},'extras':{'luxel_"
                                      "radius':0.5}},{'name':'panel','extras':{'luxel_area':'rect 1 1'}}]");
    char *text = NULL;
    assert_int_equal(lx_scene_describe(scene, &text, NULL), LX_OK);
    static const char *const parts[] = {
        "\"name\": \"stage\"", "\"layer\": \"show\"",       "\"layer\": \"sun\"", "\"unit\": \"lx\"",
        "\"range\": 3.0",      "\"outer_angle\": 0.785398", "\"axis_x\"",         "\"yfov\": 0.5",
        "\"ymag\": 2.0",       "\"radius\": 0.008726"};
    for (size_t i = 0; i < sizeof parts / sizeof *parts; ++i)
        if (!strstr(text, parts[i])) fail_msg("no %s in %s", parts[i], text);
    lx_text_free(text);
    lx_scene_destroy(scene);
}

static void description_is_json_with_short_numbers(void **state)
{
    (void)state;
    lx_scene *scene = import_material("{'name':'a','pbrMetallicRoughness':{'roughnessFactor':0.1}}", "");
    char *text = NULL;
    assert_int_equal(lx_scene_describe(scene, &text, NULL), LX_OK);
    assert_non_null(strstr(text, "\"roughness\": 0.1,"));
    assert_non_null(strstr(text, "\"triangles\": 1"));
    assert_non_null(strstr(text, "\"warnings\""));
    lx_text_free(text);
    lx_scene_destroy(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(triangle_without_indices_is_read_in_vertex_order),
        cmocka_unit_test(strip_turns_every_second_triangle),
        cmocka_unit_test(fan_shares_its_first_vertex),
        cmocka_unit_test(incomplete_triangle_is_dropped_with_a_warning),
        cmocka_unit_test(points_and_lines_are_skipped_with_one_warning),
        cmocka_unit_test(every_component_type_is_converted),
        cmocka_unit_test(byte_stride_is_obeyed),
        cmocka_unit_test(sparse_accessor_replaces_elements),
        cmocka_unit_test(sparse_accessor_without_view_starts_from_zeros),
        cmocka_unit_test(quantized_positions_keep_their_integers_unless_normalized),
        cmocka_unit_test(normals_are_made_unit_and_missing_ones_geometric),
        cmocka_unit_test(degenerate_triangles_are_counted_in_one_warning),
        cmocka_unit_test(vertex_colors_come_in_all_types),
        cmocka_unit_test(morph_targets_are_added_at_default_weights),
        cmocka_unit_test(node_weights_override_mesh_weights),
        cmocka_unit_test(wrong_number_of_weights_is_refused),
        cmocka_unit_test(transforms_multiply_down_the_hierarchy),
        cmocka_unit_test(rotation_that_is_not_unit_is_normalized),
        cmocka_unit_test(only_the_default_scene_is_read),
        cmocka_unit_test(deep_chain_of_nodes_needs_no_stack),
        cmocka_unit_test(gpu_instances_become_instances),
        cmocka_unit_test(what_moves_is_not_static_and_listed_once),
        cmocka_unit_test(animation_pointers_move_nodes_but_colours_do_not),
        cmocka_unit_test(material_factors_are_read),
        cmocka_unit_test(specular_glossiness_gives_its_diffuse),
        cmocka_unit_test(emissive_factor_above_one_moves_to_the_strength),
        cmocka_unit_test(textures_are_sampled_as_the_sampler_says),
        cmocka_unit_test(nearest_and_repeat_are_obeyed),
        cmocka_unit_test(texture_lookup_survives_any_coordinate),
        cmocka_unit_test(texture_transform_matches_the_specification),
        cmocka_unit_test(texture_set_beyond_those_read_is_replaced_with_a_warning),
        cmocka_unit_test(webp_source_is_preferred),
        cmocka_unit_test(texture_without_readable_source_is_white),
        cmocka_unit_test(cameras_lose_their_scale),
        cmocka_unit_test(color_targets_may_have_three_or_four_channels),
        cmocka_unit_test(morph_targets_that_overflow_are_refused),
        cmocka_unit_test(long_lists_of_what_moves_are_cut),
        cmocka_unit_test(bounds_of_very_many_triangles_come_from_boxes),
        cmocka_unit_test(gpu_instances_with_unequal_counts_are_refused),
        cmocka_unit_test(byte_order_mark_and_zero_padding_are_forgiven),
        cmocka_unit_test(description_lists_lights_and_cameras),
        cmocka_unit_test(description_is_json_with_short_numbers),
    };
    return cmocka_run_group_tests_name("scene import", tests, fixture_setup, fixture_teardown);
}
