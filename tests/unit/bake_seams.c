// Which edges count as seams: those over which light is continuous.
#include "bake/seams.h"
#include "base/memory.h"
#include "unit/scene_fixture.h"

// A square of 2 m in the xz-plane, facing +Y.
#define SQUARE                                                                                                                        \
    "'bufferViews':[{'buffer':0,'byteLength':48},{'buffer':0,'byteOffset':48,'byteLength':12}],'accessors':[{'bufferView':0,"          \
    "'componentType':5126,'count':4,'type':'VEC3'},{'bufferView':1,'componentType':5123,'count':6,'type':'SCALAR'}],'meshes':["         \
    "{'primitives':[{'attributes':{'POSITION':0},'indices':1,'material':0}]}],'materials':[{'doubleSided':false}]"

static size_t seam_count(const char *nodes, float *out_length_m)
{
    lx_error error;
    lx_atlas *atlas;
    lx_bake *bake;
    lx_seam *seams;
    size_t count;
    char members[2048];
    bin_clear();
    BIN_FLOATS(-1, 0, -1, -1, 0, 1, 1, 0, 1, 1, 0, -1);
    BIN_U16(0, 1, 2, 0, 2, 3);
    snprintf(members, sizeof members, "%s,'scene':0,%s", SQUARE, nodes);
    lx_scene *scene = import_members(members);
    lx_atlas_desc desc = lx_atlas_desc_default();
    desc.page_size = 128;
    if (lx_atlas_build(scene, &desc, NULL, &atlas, &error) != LX_OK) fail_msg("%s", error.message);
    const lx_bake_desc bake_desc = lx_bake_desc_default();
    if (lx_bake_create(scene, atlas, &bake_desc, &bake, &error) != LX_OK) fail_msg("%s", error.message);
    if (lx_seams_find(bake, &seams, &count, &error) != LX_OK) fail_msg("%s", error.message);
    *out_length_m = 0;
    for (size_t i = 0; i < count; ++i) {
        const lx_vec2 d = lx_sub2(seams[i].sides[0].to, seams[i].sides[0].from);
        *out_length_m += sqrtf(lx_dot2(d, d)) / atlas->texels_per_m;
        assert_int_not_equal(seams[i].sides[0].chart, seams[i].sides[1].chart);
    }
    lx_free(seams);
    lx_bake_destroy(bake);
    lx_atlas_destroy(atlas);
    lx_scene_destroy(scene);
    return count;
}

static void seams_between_two_floors_that_touch_is_their_common_edge(void **state)
{
    (void)state;
    float length;
    assert_int_equal(seam_count("'scenes':[{'nodes':[0,1]}],'nodes':[{'mesh':0},{'mesh':0,'translation':[2,0,0]}]", &length), 1);
    assert_near((double)length, 2, 0.02); // instances' rectangles are whole texels, so lengths in texels are off by less than one in a hundred
}

static void seams_between_floors_that_overlap_in_part_are_what_they_share(void **state)
{
    (void)state;
    float length;
    seam_count("'scenes':[{'nodes':[0,1]}],'nodes':[{'mesh':0},{'mesh':0,'translation':[2,0,0.5]}]", &length);
    assert_near((double)length, 1.5, 0.02);
}

static void seams_over_a_right_angle_do_not_exist(void **state)
{
    (void)state;
    float length;
    // A wall at the floor's far edge, facing the viewer.
    assert_int_equal(seam_count("'scenes':[{'nodes':[0,1]}],'nodes':[{'mesh':0},{'mesh':0,'translation':[0,1,-1],'rotation':[0.70710678,0,0,0.70710678]}]",
                                &length), 0);
}

static void seams_between_floors_with_a_gap_do_not_exist(void **state)
{
    (void)state;
    float length;
    assert_int_equal(seam_count("'scenes':[{'nodes':[0,1]}],'nodes':[{'mesh':0},{'mesh':0,'translation':[2.02,0,0]}]", &length), 0);
}

static void seams_of_two_sheets_that_lie_on_each_other_do_not_exist(void **state)
{
    (void)state;
    float length;
    assert_int_equal(seam_count("'scenes':[{'nodes':[0,1]}],'nodes':[{'mesh':0},{'mesh':0}]", &length), 0);
}

static void seams_under_a_wall_are_left_open(void **state)
{
    (void)state;
    float length;
    // Two floors; a wall stands on half of their common edge: x = 1, z = 0 … 2.
    seam_count("'scenes':[{'nodes':[0,1,2]}],'nodes':[{'mesh':0},{'mesh':0,'translation':[2,0,0]},"
               "{'mesh':0,'translation':[1,1,1],'rotation':[0,0,0.70710678,0.70710678]}]", &length);
    assert_near((double)length, 1, 0.05); // in pieces of about a texel, 2 cm
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(seams_between_two_floors_that_touch_is_their_common_edge),
        cmocka_unit_test(seams_between_floors_that_overlap_in_part_are_what_they_share),
        cmocka_unit_test(seams_over_a_right_angle_do_not_exist),
        cmocka_unit_test(seams_between_floors_with_a_gap_do_not_exist),
        cmocka_unit_test(seams_of_two_sheets_that_lie_on_each_other_do_not_exist),
        cmocka_unit_test(seams_under_a_wall_are_left_open),
    };
    return cmocka_run_group_tests(tests, fixture_setup, fixture_teardown);
}
