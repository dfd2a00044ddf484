// Monitors: which emitters become one, what their cells show, and what is told when a key has no effect.
#include "scene/monitor.h"
#include "unit/scene_fixture.h"

// A quad of two triangles with TEXCOORD_0 = (0,0) at its top left, as meshes[0] with material 0; accessor 1 holds the
// coordinates.
static const float quad_uv[8] = {0, 1, 1, 1, 1, 0, 0, 0};

#define QUAD_DATA                                                                                                      \
    "'bufferViews':[{'buffer':0,'byteLength':48},{'buffer':0,'byteOffset':48,'byteLength':32},{'buffer':0,'"           \
    "byteOffset':80,"                                                                                                  \
    "'byteLength':12}],'accessors':[{'bufferView':0,'componentType':5126,'count':4,'type':'VEC3'},{'bufferView':1,"    \
    "'componentType':5126,'count':4,'type':'VEC2'},{'bufferView':2,'componentType':5123,'count':6,'type':'SCALAR'}]"
#define QUAD(attributes)                                                                                               \
    QUAD_DATA ",'meshes':[{'primitives':[{'attributes':{'POSITION':0" attributes "},'indices':2,'material':0}]}]"
#define WITH_UV ",'TEXCOORD_0':1"

static void quad_bin(const float uv[8])
{
    bin_clear();
    BIN_FLOATS(-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0);
    for (int i = 0; i < 8; ++i) BIN_FLOATS(uv[i]);
    BIN_U16(0, 1, 2, 0, 2, 3);
}

static lx_scene *import_quad(const char *members)
{
    quad_bin(quad_uv);
    return import_members(members);
}

// A PNG of 4 × 2 texels: white, black, black, black over black, black, black, white.
#define PICTURE                                                                                                        \
    ",'textures':[{'source':0,'sampler':0}],'samplers':[{'wrapS':33071,'wrapT':33071}],'images':[{'uri':'data:image/"  \
    "png;base64," PICTURE_PNG "'}]"
#define PICTURE_PNG                                                                                                    \
    "iVBORw0KGgoAAAANSUhEUgAAAAQAAAACCAIAAADwyuo0AAAAEUlEQVR42mP4//8/AyYAigIATcwF+/fFixgAAAAASUVORK5CYII="

static void monitor_key_on_a_material_gives_the_source_its_grid(void **state)
{
    (void)state;
    lx_scene *scene =
        import_quad(QUAD(WITH_UV) ",'materials':[{'emissiveFactor':[1,0.5,0],'extras':{'luxel_monitor':'16x9'}}]"
                                  ",'nodes':[{'name':'tv','mesh':0}]");
    const lx_source *tv = source_named(scene, "tv");
    assert_int_equal(tv->columns, 16);
    assert_int_equal(tv->rows, 9);
    assert_near(tv->white.g, 0.5, 0);
    for (uint32_t cell = 0; cell < 144; ++cell) assert_near(tv->picture[cell].r, 1, 0); // no texture: white
    assert_not_logged("warning");
    lx_scene_destroy(scene);
}

static void monitor_key_on_a_node_wins_over_the_material(void **state)
{
    (void)state;
    lx_scene *scene = import_quad(
        QUAD(WITH_UV) ",'materials':[{'emissiveFactor':[1,1,1],'extras':{'luxel_monitor':'2x2'}}],'nodes':["
                      "{'name':'frame','children':[1],'extras':{'luxel_monitor':'3x1'}},{'name':'tv','mesh':0}]");
    assert_int_equal(source_named(scene, "tv")->columns, 3);
    assert_int_equal(source_named(scene, "tv")->rows, 1);
    lx_scene_destroy(scene);
}

static void monitor_with_a_black_factor_is_off_and_can_shine(void **state)
{
    (void)state;
    lx_scene *scene = import_quad(
        QUAD(WITH_UV) ",'materials':[{}],'nodes':[{'name':'tv','mesh':0,'extras':{'luxel_monitor':'2x1'}}]");
    const lx_source *tv = source_named(scene, "tv");
    assert_int_equal(tv->columns, 2);
    assert_near(tv->color.r, 0, 0);
    assert_near(tv->white.r, 1, 0);
    assert_near(tv->intensity, 1, 0);
    assert_logged("note: monitor 'tv': its emissive factor or strength is 0, so it is off; a white pixel will be 1 nit");
    lx_scene_destroy(scene);
}

static void monitor_of_strength_zero_is_off_and_keeps_its_tint(void **state)
{
    (void)state;
    lx_scene *scene = import_quad(
        QUAD(WITH_UV) ",'extensionsUsed':['KHR_materials_emissive_strength'],'materials':[{'emissiveFactor':[1,0.5,0.25],'extensions':"
                      "{'KHR_materials_emissive_strength':{'emissiveStrength':0}}}],'nodes':[{'name':'tv','mesh':0,'extras':"
                      "{'luxel_monitor':'2x1'}}]");
    const lx_source *tv = source_named(scene, "tv");
    assert_int_equal(tv->columns, 2);
    assert_near(tv->color.r, 0, 0);
    assert_near(tv->white.g, 0.5, 0);
    assert_near(tv->intensity, 1, 0);
    lx_scene_destroy(scene);
}

static void monitor_grids_that_make_no_sense_are_ignored_with_a_warning(void **state)
{
    (void)state;
    static const char *const wrong[] = {"'4'",     "'x'",      "'4x'",    "'0x4'",     "'4x0'", "'-1x4'",
                                        "'4x4x4'", "'4097x1'", "'65x64'", "'99999x1'", "16",    "''"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; ++i) {
        char members[1400];
        snprintf(members, sizeof members, "%s,'materials':[{'emissiveFactor':[1,1,1],'extras':{'luxel_monitor':%s}}]%s",
                 QUAD(WITH_UV), wrong[i], ONE_NODE);
        lx_scene *scene = import_quad(members);
        assert_int_equal(scene->source_count, 1);
        assert_int_equal(scene->sources[0].columns, 0);
        assert_logged(
            "warning: material 0: luxel_monitor is not 'COLUMNSxROWS' (16x9, say) with 4096 cells at most; ignored");
        lx_scene_destroy(scene);
    }
    lx_scene *scene = import_quad(
        QUAD(WITH_UV) ",'materials':[{'emissiveFactor':[1,1,1],'extras':{'luxel_monitor':'64X64'}}]" ONE_NODE);
    assert_int_equal(scene->sources[0].rows, 64);
    lx_scene_destroy(scene);
}

static void monitor_without_texture_coordinates_is_told_and_no_monitor(void **state)
{
    (void)state;
    lx_scene *scene = import_quad(QUAD("") ",'materials':[{'emissiveFactor':[1,1,1],'extras':{'luxel_monitor':'2x2'}}],"
                                           "'nodes':[{'name':'tv','mesh':0}]");
    assert_int_equal(source_named(scene, "tv")->columns, 0);
    assert_logged("warning: monitor 'tv': its mesh has no TEXCOORD_0");
    lx_scene_destroy(scene);
}

static void monitor_with_coordinates_beyond_its_picture_is_told(void **state)
{
    (void)state;
    const float uv[8] = {0, 2, 1, 2, 1, 0, 0, 0};
    quad_bin(uv);
    lx_scene *scene = import_members(QUAD(WITH_UV) ",'materials':[{'emissiveFactor':[1,1,1],'extras':{'luxel_monitor':'"
                                                   "2x2'}}],'nodes':[{'name':'tv','mesh':0}]");
    assert_int_equal(source_named(scene, "tv")->columns, 2);
    assert_logged("warning: monitor 'tv': its TEXCOORD_0 leaves 0 to 1");
    lx_scene_destroy(scene);
}

static void monitor_key_on_what_moves_or_does_not_emit_is_told(void **state)
{
    (void)state;
    lx_scene *scene = import_quad(
        QUAD(WITH_UV) ",'materials':[{'name':'glow','emissiveFactor':[1,1,1],'extras':{'luxel_monitor':'2x2'}}]"
                      ",'nodes':[{'name':'tv','mesh':0,'extras':{'luxel_static':false}},{'name':'empty','extras':{'"
                      "luxel_monitor':'2x2'}}]");
    assert_int_equal(scene->source_count, 0);
    assert_logged("warning: material 0 'glow': luxel_monitor has no effect: what has this material moves");
    assert_logged("warning: node 1 'empty': luxel_monitor has no effect: nothing static here emits light");
    lx_scene_destroy(scene);
}

static void cell_of_a_point_follows_texture_coordinates(void **state)
{
    (void)state;
    const lx_source monitor = {.columns = 4, .rows = 3};
    assert_int_equal(lx_monitor_cell(&monitor, lx_v2(0, 0)), 0);
    assert_int_equal(lx_monitor_cell(&monitor, lx_v2(0.249f, 0.33f)), 0);
    assert_int_equal(lx_monitor_cell(&monitor, lx_v2(0.251f, 0.33f)), 1);
    assert_int_equal(lx_monitor_cell(&monitor, lx_v2(0.9f, 0.1f)), 3);
    assert_int_equal(lx_monitor_cell(&monitor, lx_v2(0.1f, 0.34f)), 4);
    assert_int_equal(lx_monitor_cell(&monitor, lx_v2(1, 1)), 11);
    assert_int_equal(lx_monitor_cell(&monitor, lx_v2(-5, 7)), 8);
    assert_int_equal(lx_monitor_cell(&monitor, lx_v2(NAN, INFINITY)), 8);
    assert_int_equal(lx_monitor_cell(&monitor, lx_v2(1e30f, -1e30f)), 3);
}

// The picture has one white texel at its top left and one at its bottom right.
static void cells_show_the_mean_of_their_part_of_the_picture(void **state)
{
    (void)state;
    static const struct {
        const char *grid, *info;
        float expected[8];
    } cases[] = {
        {"4x2", "", {1, 0, 0, 0, 0, 0, 0, 1}},
        {"2x1", "", {0.25f, 0.25f}},
        {"1x1", "", {0.25f}},
        {"3x1", "", {0.375f, 0, 0.375f}}, // a third holds 1⅓ columns of 4
        {"2x1", ",'extensions':{'KHR_texture_transform':{'scale':[-1,1],'offset':[1,0]}}", {0.25f, 0.25f}},
        {"2x2", ",'extensions':{'KHR_texture_transform':{'scale':[-1,1],'offset':[1,0]}}", {0, 0.5f, 0.5f, 0}},
        {"1x2", ",'extensions':{'KHR_texture_transform':{'scale':[0.25,1]}}", {1, 0}}, // the first column alone
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        char members[4096];
        snprintf(members, sizeof members,
                 "%s,'materials':[{'emissiveFactor':[1,1,1],'emissiveTexture':{'index':0%s},'extras':{'luxel_monitor':'"
                 "%s'}}]%s%s",
                 QUAD(WITH_UV), cases[i].info, cases[i].grid, PICTURE, ONE_NODE);
        lx_scene *scene = import_quad(members);
        const lx_source *tv = &scene->sources[0];
        for (uint32_t cell = 0; cell < lx_source_cell_count(tv); ++cell)
            assert_near(tv->picture[cell].g, cases[i].expected[cell], 1e-5);
        lx_scene_destroy(scene);
    }
}

// A quarter turn of the picture takes its white corners to the bottom left and the top right. Here the averages come
// from lookups, bilinear ones, so cells of single texels are not exact; halves of the picture are, by symmetry.
static void cells_of_a_turned_picture_follow_the_turn(void **state)
{
    (void)state;
    lx_scene *scene = import_quad(
        QUAD(WITH_UV) ",'materials':[{'emissiveFactor':[1,1,1],'emissiveTexture':{'index':0,'extensions':{'KHR_texture_"
                      "transform':"
                      "{'rotation':1.5707963,'offset':[0,1]}}},'extras':{'luxel_monitor':'2x2'}}]" PICTURE ONE_NODE);
    const lx_source *tv = &scene->sources[0];
    const double sum =
        (double)tv->picture[0].r + (double)tv->picture[1].r + (double)tv->picture[2].r + (double)tv->picture[3].r;
    assert_near(sum, 1, 0.01);
    assert_true(tv->picture[1].r > 0.4f && tv->picture[2].r > 0.4f);
    lx_scene_destroy(scene);
}

// The picture is mapped by TEXCOORD_1, here the same as TEXCOORD_0.
static void cells_of_a_picture_mapped_by_another_set_are_found_on_the_screen(void **state)
{
    (void)state;
    lx_scene *scene = import_quad(
        QUAD(",'TEXCOORD_0':1,'TEXCOORD_1':1") ",'materials':[{'emissiveFactor':[1,1,1],'emissiveTexture':{'index':0,"
                                               "'texCoord':1},'extras':{'luxel_monitor':'2x2'}}]" PICTURE ONE_NODE);
    const lx_source *tv = &scene->sources[0];
    assert_near(tv->picture[0].r, tv->picture[3].r, 0.01);
    assert_true(tv->picture[0].r > 0.4f && tv->picture[1].r < 0.1f);
    lx_scene_destroy(scene);
}

static void monitor_picture_of_one_colour_is_exact(void **state)
{
    (void)state;
    // The same picture scaled to a single texel: white everywhere.
    lx_scene *scene =
        import_quad(QUAD(WITH_UV) ",'materials':[{'emissiveFactor':[1,1,1],'emissiveTexture':{'index':0,'extensions':{'"
                                  "KHR_texture_transform':"
                                  "{'scale':[0.125,0.25]}}},'extras':{'luxel_monitor':'7x5'}}]" PICTURE ONE_NODE);
    for (uint32_t cell = 0; cell < 35; ++cell) assert_near(scene->sources[0].picture[cell].b, 1, 0);
    lx_scene_destroy(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(monitor_key_on_a_material_gives_the_source_its_grid),
        cmocka_unit_test(monitor_key_on_a_node_wins_over_the_material),
        cmocka_unit_test(monitor_with_a_black_factor_is_off_and_can_shine),
        cmocka_unit_test(monitor_of_strength_zero_is_off_and_keeps_its_tint),
        cmocka_unit_test(monitor_grids_that_make_no_sense_are_ignored_with_a_warning),
        cmocka_unit_test(monitor_without_texture_coordinates_is_told_and_no_monitor),
        cmocka_unit_test(monitor_with_coordinates_beyond_its_picture_is_told),
        cmocka_unit_test(monitor_key_on_what_moves_or_does_not_emit_is_told),
        cmocka_unit_test(cell_of_a_point_follows_texture_coordinates),
        cmocka_unit_test(cells_show_the_mean_of_their_part_of_the_picture),
        cmocka_unit_test(cells_of_a_turned_picture_follow_the_turn),
        cmocka_unit_test(cells_of_a_picture_mapped_by_another_set_are_found_on_the_screen),
        cmocka_unit_test(monitor_picture_of_one_colour_is_exact),
    };
    return cmocka_run_group_tests_name("scene monitors", tests, fixture_setup, fixture_teardown);
}
