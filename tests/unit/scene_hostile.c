#define _GNU_SOURCE // mkdtemp, symlink
// What the importer refuses, with which words, and that nothing crashes it.
#include "unit/scene_fixture.h"

#include <sys/stat.h>
#include <unistd.h>

typedef struct refusal {
    const char *members; ///< Behind the triangle.
    const char *start;   ///< Of the message.
} refusal;

static void assert_all_refused(const refusal *cases, size_t count, lx_result code)
{
    for (size_t i = 0; i < count; ++i) assert_triangle_refused(cases[i].members, code, cases[i].start);
}

#define ALL(cases) cases, sizeof cases / sizeof *cases

// --- Hierarchy ---

static void broken_hierarchies_are_refused(void **state)
{
    (void)state;
    static const refusal cases[] = {
        {",'nodes':[{'mesh':0},{'name':'a','children':[2]},{'children':[1]}]", "node 1 'a': is below itself"},
        {",'nodes':[{'mesh':0,'children':[0]}]", "node 0: is below itself"},
        {",'nodes':[{'mesh':0,'children':[2]},{'name':'b','children':[2]},{'name':'c'}]",
         "node 2 'c': is a child of node 0 and of node 1 'b'"},
        {",'nodes':[{'children':[1,1]},{'mesh':0}]", "node 1: is a child of node 0 and of node 0"},
        {",'nodes':[{'mesh':0,'children':[7]}]", "node 0: child 7 out of range (count 1)"},
        {",'nodes':[{'mesh':3}]", "node 0: mesh 3 out of range (count 1)"},
        {",'nodes':[{'mesh':-1}]", "node 0: 'mesh' is not an index"},
        {",'nodes':[{'mesh':'0'}]", "node 0: 'mesh' is not an index"},
        {",'nodes':[{'mesh':0,'skin':0}]", "node 0: skin 0 out of range (count 0)"},
        {",'nodes':[{'mesh':0,'camera':2}]", "node 0: camera 2 out of range (count 0)"},
        {",'nodes':[5]", "node 0: not an object"},
        {",'nodes':{}", "glTF: 'nodes' is not an array"},
        {",'scene':2,'scenes':[{'nodes':[0]}]" ONE_NODE, "glTF: scene 2 out of range (count 1)"},
        {",'scenes':[{'nodes':[4]}]" ONE_NODE, "scene 0: node 4 out of range (count 1)"},
        {",'scenes':[{'nodes':[0,0]}]" ONE_NODE, "scene 0: node 0 is named twice"},
        {",'scenes':[{'nodes':[1]}],'nodes':[{'children':[1]},{'mesh':0}]",
         "scene 0: node 1 is not a root but a child of node 0"},
        {",'scenes':[{'nodes':[]}]" ONE_NODE, "scene: no mesh with triangles"},
        {"", "scene: no mesh with triangles"},
        {",'nodes':[{'mesh':0,'matrix':[1,0,0,0,0,1,0,0,0,0,1,0]}]", "node 0: 'matrix' is not an array of 16 numbers"},
        {",'nodes':[{'mesh':0,'matrix':[1,0,0,0.5,0,1,0,0,0,0,1,0,0,0,0,1]}]",
         "node 0: the matrix's last row is not 0 0 0 1"},
        {",'nodes':[{'mesh':0,'translation':[1e300,0,0]}]", "node 0: 'translation' [0] is not a finite number"},
        {",'nodes':[{'scale':[1e30,1,1],'children':[1]},{'name':'x','mesh':0,'scale':[1e30,1,1]}]",
         "node 1 'x': its place in the world is not finite"},
        {",'skins':[{'joints':[9]}]" ONE_NODE, "skin 0: joint 9 out of range (count 1)"},
        {",'animations':[{'channels':[{'sampler':0,'target':{}}]}]" ONE_NODE,
         "animation 0 channel: sampler 0 out of range (count 0)"},
    };
    assert_all_refused(ALL(cases), LX_ERROR_FORMAT);
}

static void too_deep_hierarchy_is_refused(void **state)
{
    (void)state;
    enum { depth = 5000 };
    char *nodes = malloc(64 * depth);
    size_t length = (size_t)sprintf(nodes, ",'nodes':[");
    for (int i = 0; i < depth - 1; ++i) length += (size_t)sprintf(nodes + length, "{'children':[%d]},", i + 1);
    sprintf(nodes + length, "{'mesh':0}]");
    assert_triangle_refused(nodes, LX_ERROR_LIMIT, "node 4097: more than 4096 nodes deep");
    free(nodes);
}

static void vertices_that_overflow_in_the_world_are_refused(void **state)
{
    (void)state;
    bin_clear();
    BIN_FLOATS(0, 0, 0, 1e38f, 0, 0, 0, 1, 0);
    assert_refused(TRIANGLE ",'nodes':[{'name':'huge','mesh':0,'scale':[10,1,1]}]", LX_ERROR_FORMAT,
                   "node 0 'huge': its vertices are not finite in the world");
    assert_triangle_refused(",'nodes':[{'name':'far','mesh':0,'translation':[0,0,2e15]}]", LX_ERROR_FORMAT,
                            "node 0 'far': its vertices are not finite in the world, or 1e15 m away");
    lx_scene_destroy(import_triangle(",'nodes':[{'mesh':0,'translation':[0,0,1e14]}]"));
}

// --- Accessors, buffers ---

static void numbers_that_are_not_finite_are_refused(void **state)
{
    (void)state;
    static const float bad[] = {NAN, INFINITY, -INFINITY};
    for (int i = 0; i < 3; ++i) {
        triangle_bin();
        memcpy(fixture_bin + 16, &bad[i], sizeof *bad);
        assert_refused(TRIANGLE ONE_NODE, LX_ERROR_FORMAT, "accessor 0: element 1 is not a finite number");
        triangle_bin();
        BIN_FLOATS(0, 0, 1, 0, 0, 1, 0, 0, 1);
        memcpy(fixture_bin + 36 + 32, &bad[i], sizeof *bad);
        assert_refused("'bufferViews':[{'buffer':0,'byteLength':72}],'accessors':[{'bufferView':0,'componentType':5126,"
                       "'count':3,'type':'VEC3'},"
                       "{'name':'nor','bufferView':0,'byteOffset':36,'componentType':5126,'count':3,'type':'VEC3'}],"
                       "'meshes':[{'primitives':[{'attributes':{'POSITION':0,'NORMAL':1}}]}]" ONE_NODE,
                       LX_ERROR_FORMAT, "accessor 1 'nor': element 2 is not a finite number");
    }
}

// A triangle with its accessor's members replaced.
static void assert_accessor_refused(const char *accessor, lx_result code, const char *start)
{
    char members[2048];
    triangle_bin();
    BIN_U16(0, 1, 640, 0);
    snprintf(members, sizeof members,
             "'bufferViews':[{'buffer':0,'byteLength':36},{'buffer':0,'byteOffset':36,'byteLength':8},{'buffer':0,'"
             "byteLength':36,'byteStride':8}],"
             "'accessors':[%s,{'bufferView':1,'componentType':5123,'count':3,'type':'SCALAR'}],"
             "'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':1}]}]" ONE_NODE,
             accessor);
    assert_refused(members, code, start);
}

static void broken_accessors_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *accessor;
        lx_result code;
        const char *start;
    } cases[] = {
        {"{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'}", LX_ERROR_FORMAT,
         "accessor 1: index 640 out of range (count 3)"},
        {"{'bufferView':0,'componentType':5126,'count':4,'type':'VEC3'}", LX_ERROR_FORMAT,
         "accessor 0: 4 elements do not fit into bufferView 0 (36 bytes)"},
        {"{'bufferView':0,'byteOffset':1,'componentType':5126,'count':3,'type':'VEC3'}", LX_ERROR_FORMAT,
         "accessor 0: 3 elements do not fit"},
        {"{'bufferView':0,'byteOffset':9007199254740991,'componentType':5126,'count':1,'type':'VEC3'}", LX_ERROR_FORMAT,
         "accessor 0: 1 elements do not fit"},
        {"{'bufferView':0,'componentType':5126,'count':2147483647,'type':'VEC3'}", LX_ERROR_FORMAT,
         "accessor 0: 2147483647 elements do not fit"},
        {"{'bufferView':0,'componentType':5126,'count':4294967297,'type':'VEC3'}", LX_ERROR_LIMIT,
         "accessor 0: count 4294967297 is too large"},
        {"{'componentType':5126,'count':2000000000,'type':'VEC3'}", LX_ERROR_LIMIT,
         "accessor 0: the scene would take more memory"},
        {"{'bufferView':0,'componentType':5126,'count':3.5,'type':'VEC3'}", LX_ERROR_FORMAT,
         "accessor 0: 'count' is not a whole number"},
        {"{'bufferView':0,'componentType':5124,'count':3,'type':'VEC3'}", LX_ERROR_FORMAT,
         "accessor 0: unknown componentType 5124"},
        {"{'bufferView':0,'componentType':5126,'count':3,'type':'VEC5'}", LX_ERROR_FORMAT,
         "accessor 0: unknown type 'VEC5'"},
        {"{'bufferView':0,'componentType':5126,'count':1,'type':'MAT2'}", LX_ERROR_FORMAT,
         "mesh 0 primitive 0 attributes: POSITION (accessor 0) is not of type VEC3"},
        {"{'bufferView':0,'componentType':5126,'count':3,'type':'VEC2'}", LX_ERROR_FORMAT,
         "mesh 0 primitive 0 attributes: POSITION (accessor 0) is not of type VEC3"},
        {"{'bufferView':2,'componentType':5126,'count':3,'type':'VEC3'}", LX_ERROR_FORMAT,
         "accessor 0: byteStride 8 is less than its elements' 12 bytes"},
        {"{'bufferView':7,'componentType':5126,'count':3,'type':'VEC3'}", LX_ERROR_FORMAT,
         "accessor 0: bufferView 7 out of range (count 3)"},
        {"{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3','sparse':{'count':4,'indices':{'bufferView':1,'"
         "componentType':5123},'values':{'bufferView':0}}}",
         LX_ERROR_FORMAT, "accessor 0 sparse: count 4 is more than the accessor's 3"},
        {"{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3','sparse':{'count':3,'indices':{'bufferView':1,'"
         "componentType':5123},'values':{'bufferView':0}}}",
         LX_ERROR_FORMAT, "accessor 0 sparse: index 640 out of range (count 3)"},
        {"{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3','sparse':{'count':1,'indices':{'componentType':"
         "5123},'values':{'bufferView':0}}}",
         LX_ERROR_FORMAT, "accessor 0 sparse indices: no bufferView"},
        {"{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3','sparse':{'count':2,'indices':{'bufferView':1,'"
         "byteOffset':6,'componentType':5123},'values':{'bufferView':0}}}",
         LX_ERROR_FORMAT, "accessor 0 sparse indices: 2 elements do not fit into bufferView 1"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i)
        assert_accessor_refused(cases[i].accessor, cases[i].code, cases[i].start);
}

static void broken_buffers_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *members, *start;
    } cases[] = {
        {"'buffers':[{'byteLength':4}],'bufferViews':[{'buffer':0,'byteOffset':2,'byteLength':3}]",
         "bufferView 0: bytes 2 to 5 are outside of buffer 0 (4 bytes)"},
        {"'buffers':[{'byteLength':4}],'bufferViews':[{'buffer':1,'byteLength':3}]",
         "bufferView 0: buffer 1 out of range (count 1)"},
        {"'buffers':[{'byteLength':4}],'bufferViews':[{'byteLength':3}]", "bufferView 0: no buffer"},
        {"'buffers':[{'byteLength':4}],'bufferViews':[{'buffer':0}]", "bufferView 0: no byteLength"},
        {"'buffers':[{'byteLength':4}],'bufferViews':[{'buffer':0,'byteOffset':9007199254740992,'byteLength':"
         "9007199254740992}]",
         "bufferView 0: bytes"},
        {"'buffers':[{'byteLength':4}],'bufferViews':[{'buffer':0,'byteLength':4,'byteStride':256}]",
         "bufferView 0: byteStride 256 is more than 252"},
        {"'buffers':[{}]", "buffer 0: no byteLength"},
        {"'buffers':[{'byteLength':5,'uri':'data:;base64,AAAA'}]",
         "buffer 0: byteLength 5 is more than the 3 bytes there are"},
        {"'buffers':[{'byteLength':3,'uri':'data:;base64,A*AA'}]", "buffer 0: data: URI is not valid base64"},
        {"'cameras':[{'type':'box'}],'nodes':[{'camera':0}]", "scene: no mesh with triangles"},
        {"'buffers':[{'byteLength':3,'uri':'data:;base64'}]", "buffer 0: data: URI without a comma"},
        {"'buffers':[{'byteLength':4}],'bufferViews':[{'buffer':0,'byteLength':4}],'accessors':[{'bufferView':0,'"
         "componentType':5121,'count':1,'type':'VEC3'}],"
         "'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]" ONE_NODE,
         "bufferView 0: buffer 0 has no data"},
    };
    bin_clear();
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i)
        assert_refused(cases[i].members, LX_ERROR_FORMAT, cases[i].start);
}

static void broken_meshes_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *mesh, *start;
    } cases[] = {
        {"{'name':'room','primitives':[{'attributes':{'POSITION':5}}]}",
         "mesh 0 'room' primitive 0 attributes: POSITION 5 out of range (count 1)"},
        {"{'primitives':[{'attributes':{'POSITION':0},'material':0}]}",
         "mesh 0 primitive 0: material 0 out of range (count 0)"},
        {"{'primitives':[{'attributes':{'POSITION':0},'indices':1}]}",
         "mesh 0 primitive 0: indices 1 out of range (count 1)"},
        {"{'primitives':[{'attributes':{'POSITION':0},'indices':0}]}", "accessor 0: indices are not unsigned scalars"},
        {"{'primitives':[{'attributes':{'POSITION':0},'mode':7}]}", "mesh 0 primitive 0: unknown mode 7"},
        {"{'primitives':[{}]}", "mesh 0 primitive 0: no attributes"},
        {"{'primitives':['x']}", "mesh 0 primitive 0: not an object"},
        {"{'primitives':[{'attributes':{'POSITION':0},'targets':[{'POSITION':3}]}]}",
         "mesh 0 primitive 0 target: POSITION 3 out of range"},
        {"{'weights':['a'],'primitives':[{'attributes':{'POSITION':0},'targets':[{}]}]}",
         "mesh 0: 'weights' [0] is not a finite number"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        char members[1024];
        triangle_bin();
        snprintf(members, sizeof members, TRIANGLE_DATA ",'meshes':[%s]" ONE_NODE, cases[i].mesh);
        assert_refused(members, LX_ERROR_FORMAT, cases[i].start);
    }
}

static void few_lines_cannot_ask_for_all_memory(void **state)
{
    (void)state;
    // 3000 primitives of a mesh of 32 MB of zeros each.
    size_t capacity = 1 << 20, length = 0;
    char *members = malloc(capacity);
    length += (size_t)sprintf(
        members, "'accessors':[{'componentType':5126,'count':3000000,'type':'VEC3'}],'meshes':[{'primitives':[");
    for (int i = 0; i < 3000; ++i)
        length += (size_t)sprintf(members + length, "%s{'attributes':{'POSITION':0}}", i ? "," : "");
    sprintf(members + length, "]}]" ONE_NODE);
    lx_scene_load_desc desc = lx_scene_load_desc_default();
    desc.max_file_bytes = 8 << 20;
    bin_clear();
    char *text = make_gltf(members);
    lx_scene *scene = NULL;
    lx_error error = {0};
    assert_int_equal(lx_gltf_import(fixture_context, "t", NULL, text, strlen(text), &desc, &scene, &error),
                     LX_ERROR_LIMIT);
    assert_non_null(strstr(error.message, "would take more memory than is allowed"));
    free(text);
    free(members);
}

// --- Materials, images ---

static void broken_materials_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *material, *start;
    } cases[] = {
        {"{'name':'m','pbrMetallicRoughness':{'baseColorTexture':{'index':0}}}",
         "material 0 'm' pbrMetallicRoughness baseColorTexture: index 0 out of range (count 0)"},
        {"{'normalTexture':{'index':0}}", "material 0 normalTexture: index 0 out of range (count 0)"},
        {"{'emissiveTexture':{}}", "material 0 emissiveTexture: no index"},
        {"{'alphaMode':'GLASS'}", "material 0: alphaMode 'GLASS' is not OPAQUE, MASK or BLEND"},
        {"{'doubleSided':1}", "material 0: 'doubleSided' is not true or false"},
        {"{'pbrMetallicRoughness':{'metallicFactor':'x'}}",
         "material 0 pbrMetallicRoughness: 'metallicFactor' is not a finite number"},
        {"{'emissiveFactor':[3e38,0,0],'extensions':{'KHR_materials_emissive_strength':{'emissiveStrength':3e38}}}",
         "material 0: emission is infinite"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        char more[1024];
        snprintf(more, sizeof more, ",'materials':[%s]" ONE_NODE, cases[i].material);
        assert_triangle_refused(more, LX_ERROR_FORMAT, cases[i].start);
    }
}

#define WITH_IMAGE(image)                                                                                              \
    TRIANGLE_MATERIAL                                                                                                  \
    ",'images':[" image                                                                                                \
    "],'textures':[{'source':0}],'materials':[{'pbrMetallicRoughness':{'baseColorTexture':{'index':0}}}]" ONE_NODE

static void broken_images_are_refused_when_used(void **state)
{
    (void)state;
    static const struct {
        const char *members;
        lx_result code;
        const char *start;
    } cases[] = {
        {WITH_IMAGE("{'name':'wood'}"), LX_ERROR_FORMAT, "image 0 'wood': neither uri nor bufferView"},
        {WITH_IMAGE("{'bufferView':4}"), LX_ERROR_FORMAT, "image 0: bufferView 4 out of range (count 1)"},
        {WITH_IMAGE("{'bufferView':0}"), LX_ERROR_UNSUPPORTED, "image 0: not a PNG, JPEG or WebP image"},
        {WITH_IMAGE("{'name':'cut','uri':'data:image/png;base64,iVBORw0KGgoAAAANSUhEUg=='}"), LX_ERROR_FORMAT,
         "image 0 'cut': "},
        {WITH_IMAGE("{'name':'w','uri':'wood.png'}"), LX_ERROR_FORMAT,
         "image 0 'w': external file 'wood.png' is not available"},
        {TRIANGLE ",'textures':[{'source':0}]" ONE_NODE, LX_ERROR_FORMAT, "texture 0: source 0 out of range (count 0)"},
        {TRIANGLE ",'textures':[{'sampler':0}]" ONE_NODE, LX_ERROR_FORMAT,
         "texture 0: sampler 0 out of range (count 0)"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        triangle_bin();
        assert_refused(cases[i].members, cases[i].code, cases[i].start);
    }
    lx_scene_destroy(import_triangle(",'images':[{'uri':'unused.png'}]" ONE_NODE));
    assert_logged("warning: image 0: external file 'unused.png' is not available here (the baker does not need it)");
}

// --- Extensions, versions, JSON ---

static void required_extensions_that_are_unknown_are_refused(void **state)
{
    (void)state;
    static const refusal cases[] = {
        {",'extensionsRequired':['KHR_draco_mesh_compression']" ONE_NODE,
         "extensionsRequired: KHR_draco_mesh_compression is not supported; decode it first: npx @gltf-transform/cli "
         "copy in.glb out.glb"},
        {",'extensionsRequired':['KHR_texture_basisu']" ONE_NODE,
         "extensionsRequired: KHR_texture_basisu is not supported; convert its textures first: npx @gltf-transform/cli "
         "ktxdecompress"},
        {",'extensionsRequired':['ACME_magic']" ONE_NODE,
         "extensionsRequired: ACME_magic is not supported; export without it"},
    };
    assert_all_refused(ALL(cases), LX_ERROR_UNSUPPORTED);
    assert_triangle_refused(",'extensionsRequired':[7]" ONE_NODE, LX_ERROR_FORMAT,
                            "extensionsRequired: [0] is not a string");
}

static void geometry_that_only_draco_holds_is_refused(void **state)
{
    (void)state;
    bin_clear();
    assert_refused(
        "'extensionsUsed':['KHR_draco_mesh_compression'],'accessors':[{'componentType':5126,'count':3,'type':'VEC3'}],"
        "'meshes':[{'primitives':[{'attributes':{'POSITION':0},'extensions':{'KHR_draco_mesh_compression':{'bufferView'"
        ":0}}}]}]" ONE_NODE,
        LX_ERROR_UNSUPPORTED, "mesh 0 primitive 0: KHR_draco_mesh_compression is not supported");
}

static void assert_text_refused(const char *text, lx_result code, const char *start)
{
    lx_scene *scene;
    lx_error error;
    const lx_result result = import_text(text, strlen(text), &scene, &error);
    if (result != code || strncmp(error.message, start, strlen(start)) != 0)
        fail_msg("expected %d '%s', got %d '%s'", code, start, result, error.message);
}

static void wrong_versions_and_texts_are_refused(void **state)
{
    (void)state;
    assert_text_refused("{\"asset\":{\"version\":\"1.0\"}}", LX_ERROR_UNSUPPORTED,
                        "t.gltf: asset: glTF version 1.0 (only 2.0 is read)");
    assert_text_refused("{\"asset\":{\"version\":\"2.1\",\"minVersion\":\"2.1\"}}", LX_ERROR_UNSUPPORTED,
                        "t.gltf: asset: needs glTF version 2.1");
    assert_text_refused("{\"asset\":{}}", LX_ERROR_FORMAT, "t.gltf: asset: no version");
    assert_text_refused("{}", LX_ERROR_FORMAT, "t.gltf: asset: missing");
    assert_text_refused("[]", LX_ERROR_FORMAT, "t.gltf: JSON: not an object");
    assert_text_refused("", LX_ERROR_FORMAT, "t.gltf: JSON: line 1");
    assert_text_refused("{\"asset\":\n{]", LX_ERROR_FORMAT, "t.gltf: JSON: line 2");
    assert_text_refused("{\"asset\":{\"version\":\"2.0\"},\"nodes\":[{\"translation\":[NaN,0,0]}]}", LX_ERROR_FORMAT,
                        "t.gltf: JSON: line 1");
}

static void deeply_nested_json_is_refused(void **state)
{
    (void)state;
    enum { depth = 100000 };
    char *text = malloc(2 * depth + 64);
    size_t length = (size_t)sprintf(text, "{\"asset\":{\"version\":\"2.0\",\"copyright\":\"[[[[\\\"[[\"},\"extras\":");
    memset(text + length, '[', depth);
    text[length + depth] = '\0';
    assert_text_refused(text, LX_ERROR_LIMIT, "t.gltf: JSON: nested deeper than 512 levels");
    free(text);
}

static void control_characters_in_names_stay_out_of_messages(void **state)
{
    (void)state;
    assert_triangle_refused(",'nodes':[{'name':'a\\nb','mesh':9}]", LX_ERROR_FORMAT, "node 0 'a?b': mesh 9");
}

// --- GLB ---

static void put_u32(uint8_t *out, uint32_t value)
{
    for (int i = 0; i < 4; ++i) out[i] = (uint8_t)(value >> (8 * i));
}

// A triangle as GLB in `out`; returns its size.
static size_t make_glb(uint8_t *out)
{
    static const char json[] =
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":36}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],\"accessors\":[{\"bufferView\":0,\"componentType\":5126,"
        "\"count\":3,\"type\":\"VEC3\"}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],\"nodes\":[{"
        "\"mesh\":0}]}";
    static const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const size_t json_size = (sizeof json - 1 + 3) / 4 * 4, total = 12 + 8 + json_size + 8 + sizeof positions;
    memcpy(out, "glTF", 4);
    put_u32(out + 4, 2);
    put_u32(out + 8, (uint32_t)total);
    put_u32(out + 12, (uint32_t)json_size);
    memcpy(out + 16, "JSON", 4);
    memset(out + 20, ' ', json_size);
    memcpy(out + 20, json, sizeof json - 1);
    put_u32(out + 20 + json_size, sizeof positions);
    memcpy(out + 24 + json_size, "BIN", 4);
    memcpy(out + 28 + json_size, positions, sizeof positions);
    return total;
}

static lx_result import_bytes(const uint8_t *data, size_t size, char message[512])
{
    lx_scene *scene;
    lx_error error;
    // A copy of the exact size, so that the sanitizer sees any byte read behind it.
    char *copy = malloc(size ? size : 1);
    memcpy(copy, data, size);
    const lx_result result = import_text(copy, size, &scene, &error);
    free(copy);
    lx_scene_destroy(scene);
    if (message) strcpy(message, error.message);
    return result;
}

static void glb_is_read(void **state)
{
    (void)state;
    uint8_t glb[1024];
    const size_t size = make_glb(glb);
    assert_int_equal(import_bytes(glb, size, NULL), LX_OK);
    memset(glb + size, 7, 5);
    assert_int_equal(import_bytes(glb, size + 5, NULL), LX_OK);
    assert_logged("warning: GLB: 5 bytes behind its end are ignored");
}

static void truncated_glb_is_refused_at_every_length(void **state)
{
    (void)state;
    uint8_t glb[1024];
    const size_t size = make_glb(glb);
    for (size_t length = 0; length < size; ++length) {
        assert_int_not_equal(import_bytes(glb, length, NULL), LX_OK);
        if (length < 12) continue;
        put_u32(glb + 8, (uint32_t)length); // and when the header agrees with the cut
        assert_int_not_equal(import_bytes(glb, length, NULL), LX_OK);
        put_u32(glb + 8, (uint32_t)size);
    }
}

static void glb_with_any_byte_changed_does_no_harm(void **state)
{
    (void)state;
    uint8_t glb[1024];
    const size_t size = make_glb(glb);
    static const uint8_t values[] = {0, 0xff, 0x7f, '0', '9', '"', '-'};
    for (size_t i = 0; i < size; ++i)
        for (size_t v = 0; v < sizeof values; ++v) {
            const uint8_t old = glb[i];
            glb[i] = values[v];
            import_bytes(glb, size, NULL);
            glb[i] = old;
        }
}

static void wrong_glb_chunks_are_refused(void **state)
{
    (void)state;
    uint8_t glb[1024];
    char message[512];
    size_t size = make_glb(glb);
    put_u32(glb + 12, 0x7fffffff);
    assert_int_equal(import_bytes(glb, size, message), LX_ERROR_FORMAT);
    assert_non_null(strstr(message, "t.gltf: GLB: chunk 0: length 2147483647 is more than the"));
    size = make_glb(glb);
    put_u32(glb + 4, 1);
    assert_int_equal(import_bytes(glb, size, message), LX_ERROR_UNSUPPORTED);
    assert_string_equal(message, "t.gltf: GLB: version 1 (only 2 is read)");
    size = make_glb(glb);
    memcpy(glb + 16, "BIN", 4);
    assert_int_equal(import_bytes(glb, size, message), LX_ERROR_FORMAT);
    assert_string_equal(message, "t.gltf: GLB: chunk 0 is not JSON");
    size = make_glb(glb);
    put_u32(glb + size - 44, 32);
    put_u32(glb + 8, (uint32_t)size - 4);
    assert_int_equal(import_bytes(glb, size - 4, message), LX_ERROR_FORMAT);
    assert_string_equal(message, "t.gltf: buffer 0: byteLength 36 is more than the 32 bytes of the BIN chunk");
}

// --- Files beside the scene ---

static char folder[256];

static void write_text(const char *name, const char *text)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    assert_int_equal(lx_file_write(path, text, strlen(text), NULL), LX_OK);
}

static void make_link(const char *target, const char *name)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    assert_int_equal(symlink(target, path), 0);
}

static lx_result load_with_uri(const char *uri, char message[512])
{
    char text[1024], path[512];
    lx_scene *scene = NULL;
    lx_error error = {0};
    snprintf(text, sizeof text,
             "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":36,\"uri\":\"%s\"}],\"bufferViews\":[{"
             "\"buffer\":0,\"byteLength\":36}],"
             "\"accessors\":[{\"bufferView\":0,\"componentType\":5121,\"count\":3,\"type\":\"VEC3\"}],"
             "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],\"nodes\":[{\"mesh\":0}]}",
             uri);
    write_text("scene.gltf", text);
    snprintf(path, sizeof path, "%s/scene.gltf", folder);
    const lx_result result = lx_scene_load(fixture_context, path, NULL, &scene, &error);
    lx_scene_destroy(scene);
    strcpy(message, error.message);
    return result;
}

static void files_are_found_beside_the_scene_and_nowhere_else(void **state)
{
    (void)state;
    static const char data[] = "0123456789abcdefghijklmnopqrstuvwxyz";
    char message[512], sub[512];
    strcpy(folder, "/tmp/luxel-test-XXXXXX");
    assert_non_null(mkdtemp(folder));
    snprintf(sub, sizeof sub, "%s/sub", folder);
    assert_int_equal(mkdir(sub, 0700), 0);
    write_text("sub/a b.bin", data);
    write_text("100%.bin", data);
    write_text("short.bin", "0123");
    make_link("sub/a b.bin", "inside.bin");
    make_link("/etc/passwd", "outside.bin");
    make_link("/", "root");
    static const char *const good[] = {"sub/a%20b.bin", "sub/a b.bin", "./sub/../sub/a%20b.bin",
                                       "inside.bin",    "100%.bin",    "s%75b/a%20b.bin"};
    for (size_t i = 0; i < sizeof good / sizeof *good; ++i)
        if (load_with_uri(good[i], message) != LX_OK) fail_msg("%s: %s", good[i], message);
    static const struct {
        const char *uri, *part;
    } bad[] = {
        {"../a.bin", "buffer 0: URI '../a.bin' leads out of the scene's folder"},
        {"sub/../../x", "leads out of the scene's folder"},
        {"%2e%2e/x", "leads out of the scene's folder"},
        {"sub\\\\..\\\\..\\\\x", "leads out of the scene's folder"},
        {"/etc/passwd", "is an absolute path"},
        {"%2fetc/passwd", "is an absolute path"},
        {"http://example.com/a.bin", "is not a relative path"},
        {"file:///etc/passwd", "is not a relative path"},
        {"C:/a.bin", "is not a relative path"},
        {"a%00b", "contains a zero byte"},
        {"", "is empty"},
        {"outside.bin", "file 'outside.bin' is a link that leads out of the scene's folder"},
        {"root/etc/passwd", "is a link that leads out of the scene's folder"},
        {"missing.bin", "buffer 0: file 'missing.bin': cannot read: No such file or directory"},
        {"sub", "buffer 0: file 'sub': cannot read: is a folder"},
        {"short.bin", "buffer 0: byteLength 36 is more than the 4 bytes there are"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
        const lx_result result = load_with_uri(bad[i].uri, message);
        if (result == LX_OK || !strstr(message, bad[i].part)) fail_msg("%s: %d %s", bad[i].uri, result, message);
        if (strncmp(message, folder, strlen(folder)) != 0) fail_msg("no path in front: %s", message);
    }
    assert_int_equal(lx_folder_remove(folder, NULL), LX_OK);
}

static void missing_scene_is_told_by_its_path(void **state)
{
    (void)state;
    lx_scene *scene = NULL;
    lx_error error = {0};
    assert_int_equal(lx_scene_load(fixture_context, "/nowhere/room.glb", NULL, &scene, &error), LX_ERROR_FORMAT);
    assert_string_equal(error.message, "/nowhere/room.glb: cannot read: No such file or directory");
    assert_null(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(broken_hierarchies_are_refused),
        cmocka_unit_test(too_deep_hierarchy_is_refused),
        cmocka_unit_test(vertices_that_overflow_in_the_world_are_refused),
        cmocka_unit_test(numbers_that_are_not_finite_are_refused),
        cmocka_unit_test(broken_accessors_are_refused),
        cmocka_unit_test(broken_buffers_are_refused),
        cmocka_unit_test(broken_meshes_are_refused),
        cmocka_unit_test(few_lines_cannot_ask_for_all_memory),
        cmocka_unit_test(broken_materials_are_refused),
        cmocka_unit_test(broken_images_are_refused_when_used),
        cmocka_unit_test(required_extensions_that_are_unknown_are_refused),
        cmocka_unit_test(geometry_that_only_draco_holds_is_refused),
        cmocka_unit_test(wrong_versions_and_texts_are_refused),
        cmocka_unit_test(deeply_nested_json_is_refused),
        cmocka_unit_test(control_characters_in_names_stay_out_of_messages),
        cmocka_unit_test(glb_is_read),
        cmocka_unit_test(truncated_glb_is_refused_at_every_length),
        cmocka_unit_test(glb_with_any_byte_changed_does_no_harm),
        cmocka_unit_test(wrong_glb_chunks_are_refused),
        cmocka_unit_test(files_are_found_beside_the_scene_and_nowhere_else),
        cmocka_unit_test(missing_scene_is_told_by_its_path),
    };
    return cmocka_run_group_tests_name("scene hostile", tests, fixture_setup, fixture_teardown);
}
