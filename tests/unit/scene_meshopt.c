// EXT_meshopt_compression: every mode and filter against what went in, and damaged views.
#include "unit/scene_fixture.h"

#include <meshoptimizer.h>

// One compressed view, and what its accessor says.
typedef struct view {
    const char *mode, *filter;
    size_t stride, count;
    uint8_t packed[512];
    size_t packed_size;
} view;

static const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};

static view pack_attributes(const char *filter, const void *data, size_t count, size_t stride)
{
    view v = {.mode = "ATTRIBUTES", .filter = filter, .stride = stride, .count = count};
    v.packed_size = meshopt_encodeVertexBuffer(v.packed, sizeof v.packed, data, count, stride);
    return v;
}

static void append_view(char *views, const view *v, size_t offset, const char *extension)
{
    sprintf(views + strlen(views),
            "%s{'buffer':1,'byteLength':%zu%s,'extensions':{'%s':{'buffer':0,'byteOffset':%zu,'byteLength':%zu,"
            "'byteStride':%zu,'count':%zu,'mode':'%s','filter':'%s'}}}",
            views[0] ? "," : "", v->stride * v->count,
            strcmp(v->mode, "ATTRIBUTES") == 0 && v->stride == 8 ? ",'byteStride':8" : "", extension, offset,
            v->packed_size, v->stride, v->count, v->mode, v->filter);
}

// The file's members: view 0 and whatever else becomes bufferViews; buffer 1 has no content, as when the extension is
// required.
static char *compressed_members(const view *views, int view_count, const char *extension, const char *rest)
{
    char list[4096] = "";
    bin_clear();
    for (int i = 0; i < view_count; ++i)
        append_view(list, &views[i], bin_bytes(views[i].packed, views[i].packed_size), extension);
    char *members = malloc(16384);
    sprintf(members,
            "'extensionsUsed':['%s'],'extensionsRequired':['%s'],'bufferViews':[%s],%s,'buffers':[{'byteLength':%zu,'"
            "uri':'data:;base64,",
            extension, extension, list, rest, fixture_bin_size);
    append_base64(members, fixture_bin, fixture_bin_size);
    strcat(members, "'},{'byteLength':1024}]");
    bin_clear(); // so that the fixture adds no buffers of its own
    return members;
}

#define POSITIONS "{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'}"

static lx_scene *import_views(const view *views, int view_count, const char *extension, const char *rest)
{
    char *members = compressed_members(views, view_count, extension, rest);
    lx_scene *scene = import_members(members);
    free(members);
    return scene;
}

static void triangles_and_index_sequences_are_decoded(void **state)
{
    (void)state;
    static const unsigned list[] = {2, 0, 1, 0, 1, 2};
    for (int sequence = 0; sequence < 2; ++sequence)
        for (size_t size = 2; size <= 4; size += 2) {
            view views[2] = {pack_attributes("NONE", positions, 3, 12)};
            views[1] = (view){.mode = sequence ? "INDICES" : "TRIANGLES", .filter = "NONE", .stride = size, .count = 6};
            views[1].packed_size = sequence
                                       ? meshopt_encodeIndexSequence(views[1].packed, sizeof views[1].packed, list, 6)
                                       : meshopt_encodeIndexBuffer(views[1].packed, sizeof views[1].packed, list, 6);
            lx_scene *scene = import_views(
                views, 2, size == 2 ? "EXT_meshopt_compression" : "KHR_meshopt_compression",
                size == 2
                    ? "'accessors':[" POSITIONS ",{'bufferView':1,'componentType':5123,'count':6,'type':'SCALAR'}],"
                      "'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':1}]}]" ONE_NODE
                    : "'accessors':[" POSITIONS ",{'bufferView':1,'componentType':5125,'count':6,'type':'SCALAR'}],"
                      "'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':1}]}]" ONE_NODE);
            const lx_primitive *p = &scene->primitives[0];
            assert_int_equal(p->triangle_count, 2);
            assert_memory_equal(p->positions, positions, sizeof positions);
            // The triangle codec may start a triangle at another corner.
            for (int t = 0; t < 2; ++t)
                assert_int_equal(p->indices[3 * t] + p->indices[3 * t + 1] + p->indices[3 * t + 2], 3);
            if (sequence) assert_memory_equal(p->indices, list, sizeof list);
            assert_null(scene->buffers[1].data);
            lx_scene_destroy(scene);
        }
}

static void octahedral_normals_are_decoded(void **state)
{
    (void)state;
    static const float normals[] = {0, 0, 1, 0, 0, 0.6f, 0.8f, 0, -1, 0, 0, 0};
    int16_t encoded[12];
    meshopt_encodeFilterOct(encoded, 3, 8, 12, normals);
    const view views[2] = {pack_attributes("NONE", positions, 3, 12), pack_attributes("OCTAHEDRAL", encoded, 3, 8)};
    lx_scene *scene = import_views(views, 2, "EXT_meshopt_compression",
                                   "'accessors':[" POSITIONS
                                   ",{'bufferView':1,'componentType':5122,'normalized':true,'count':3,'type':'VEC3'}],"
                                   "'meshes':[{'primitives':[{'attributes':{'POSITION':0,'NORMAL':1}}]}]" ONE_NODE);
    for (int i = 0; i < 3; ++i) {
        const lx_vec3 n = scene->primitives[0].normals[i];
        assert_near(lx_dot(n, lx_v3(normals[4 * i], normals[4 * i + 1], normals[4 * i + 2])), 1, 1e-5);
        assert_near(lx_length(n), 1, 1e-6);
    }
    lx_scene_destroy(scene);
}

static void exponential_and_quaternion_filters_are_decoded(void **state)
{
    (void)state;
    static const float translations[] = {1, 2, 3, -4, 0.5f, 100},
                       rotations[] = {0, 0, 0, 1, 0, 0, 0.70710678f, 0.70710678f};
    uint32_t exponential[6];
    int16_t quaternions[8];
    meshopt_encodeFilterExp(exponential, 2, 12, 23, translations);
    meshopt_encodeFilterQuat(quaternions, 2, 8, 16, rotations);
    const view views[3] = {pack_attributes("NONE", positions, 3, 12),
                           pack_attributes("EXPONENTIAL", exponential, 2, 12),
                           pack_attributes("QUATERNION", quaternions, 2, 8)};
    lx_scene *scene = import_views(
        views, 3, "EXT_meshopt_compression",
        "'accessors':[" POSITIONS ",{'bufferView':1,'componentType':5126,'count':2,'type':'VEC3'},"
        "{'bufferView':2,'componentType':5122,'normalized':true,'count':2,'type':'VEC4'}],"
        "'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}],"
        "'nodes':[{'mesh':0,'extensions':{'EXT_mesh_gpu_instancing':{'attributes':{'TRANSLATION':1,'ROTATION':2}}}}]");
    const lx_vec3 moved = lx_mat4_point(scene->instances[1].transform, lx_v3(1, 0, 0));
    assert_near(moved.x, -4, 1e-3);
    assert_near(moved.y, 1.5, 1e-3);
    assert_near(moved.z, 100, 1e-3);
    lx_scene_destroy(scene);
}

static void damaged_views_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *mode, *filter;
        size_t stride, count;
        int damage; ///< Flips bits of the first byte.
        lx_result code;
        const char *start;
    } cases[] = {
        {"ATTRIBUTES", "NONE", 12, 3, 0xff, LX_ERROR_FORMAT, "bufferView 0 EXT_meshopt_compression: damaged"},
        {"ATTRIBUTES", "COLOR", 12, 3, 0, LX_ERROR_UNSUPPORTED,
         "bufferView 0 EXT_meshopt_compression: filter 'COLOR' with byteStride 12"},
        {"ATTRIBUTES", "OCTAHEDRAL", 12, 3, 0, LX_ERROR_UNSUPPORTED,
         "bufferView 0 EXT_meshopt_compression: filter 'OCTAHEDRAL'"},
        {"ATTRIBUTES", "NONE", 6, 6, 0, LX_ERROR_FORMAT,
         "bufferView 0 EXT_meshopt_compression: mode 'ATTRIBUTES' with byteStride 6"},
        {"TRIANGLES", "NONE", 12, 3, 0, LX_ERROR_FORMAT,
         "bufferView 0 EXT_meshopt_compression: mode 'TRIANGLES' with byteStride 12"},
        {"INDICES", "NONE", 4, 9, 0, LX_ERROR_FORMAT, "bufferView 0 EXT_meshopt_compression: damaged"},
        {"OTHER", "NONE", 12, 3, 0, LX_ERROR_FORMAT, "bufferView 0 EXT_meshopt_compression: mode 'OTHER'"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        view v = pack_attributes(cases[i].filter, positions, 3, 12);
        v.mode = cases[i].mode;
        v.stride = cases[i].stride;
        v.count = cases[i].count;
        v.packed[0] ^= (uint8_t)cases[i].damage;
        char *members = compressed_members(&v, 1, "EXT_meshopt_compression",
                                           "'accessors':[" POSITIONS
                                           "],'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]" ONE_NODE);
        assert_refused(members, cases[i].code, cases[i].start);
        free(members);
    }
}

static void sizes_that_cannot_be_are_refused_before_decoding(void **state)
{
    (void)state;
    static const struct {
        const char *view, *start;
    } cases[] = {
        {"'byteLength':36,'extensions':{'EXT_meshopt_compression':{'buffer':0,'byteLength':12,'byteStride':12,'count':"
         "4,'mode':'ATTRIBUTES'}}",
         "bufferView 0 EXT_meshopt_compression: 4 elements of 12 bytes do not fill the bufferView's 36 bytes"},
        {"'byteLength':36,'extensions':{'EXT_meshopt_compression':{'buffer':0,'byteLength':12,'count':4,'mode':'"
         "ATTRIBUTES'}}",
         "bufferView 0 EXT_meshopt_compression: 4 elements of 0 bytes"},
        {"'byteLength':1200000000,'extensions':{'EXT_meshopt_compression':{'buffer':0,'byteLength':12,'byteStride':12,'"
         "count':100000000,'mode':'ATTRIBUTES'}}",
         "bufferView 0 EXT_meshopt_compression: 12 bytes cannot hold 1200000000"},
        {"'byteLength':36,'extensions':{'EXT_meshopt_compression':{'buffer':0,'byteLength':13,'byteStride':12,'count':"
         "3,'mode':'ATTRIBUTES'}}",
         "bufferView 0 EXT_meshopt_compression: bytes 0 to 13 are outside of buffer 0 (12 bytes)"},
        {"'byteLength':36,'extensions':{'EXT_meshopt_compression':{'buffer':1,'byteLength':12,'byteStride':12,'count':"
         "3,'mode':'ATTRIBUTES'}}",
         "bufferView 0 EXT_meshopt_compression: buffer 1 has no data"},
        {"'byteLength':36,'extensions':{'EXT_meshopt_compression':{'buffer':0,'byteLength':12,'byteStride':12,'count':"
         "3}}",
         "bufferView 0 EXT_meshopt_compression: no mode"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        char members[2048];
        bin_clear();
        snprintf(members, sizeof members,
                 "'buffers':[{'byteLength':12,'uri':'data:;base64,AAAAAAAAAAAAAAAA'},{'byteLength':2000000000}],'"
                 "bufferViews':[{'buffer':1,%s}],"
                 "'accessors':[" POSITIONS "],'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]" ONE_NODE,
                 cases[i].view);
        assert_refused(members, LX_ERROR_FORMAT, cases[i].start);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(triangles_and_index_sequences_are_decoded),
        cmocka_unit_test(octahedral_normals_are_decoded),
        cmocka_unit_test(exponential_and_quaternion_filters_are_decoded),
        cmocka_unit_test(damaged_views_are_refused),
        cmocka_unit_test(sizes_that_cannot_be_are_refused_before_decoding),
    };
    return cmocka_run_group_tests_name("scene meshopt", tests, fixture_setup, fixture_teardown);
}
