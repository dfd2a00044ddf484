// Animated light: which pointers become tracks, how keys are laid out, and what is refused.
#include "unit/scene_fixture.h"

// Two lamps (one per light), an emissive triangle, and times 0 1 2 3 (accessor 1), scalars 1 … 12 (2: four of them, 3: twelve), vectors (4: four of
// them, 5: twelve, 6: negative).
static void track_bin(void)
{
    triangle_bin();
    BIN_FLOATS(0, 1, 2, 3);
    BIN_FLOATS(1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12);
    BIN_FLOATS(0, 0.5f, 1, 1, 0, 0.5f, 0.25f, 0, 0, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
    BIN_FLOATS(3, 1, 2, -1);
}

#define VIEW(offset, size) "{'buffer':0,'byteOffset':" #offset ",'byteLength':" #size "}"
#define NUMBERS(view, count, type) "{'bufferView':" #view ",'componentType':5126,'count':" #count ",'type':'" type "'}"
#define DATA                                                                                                                          \
    "'bufferViews':[" VIEW(0, 36) "," VIEW(36, 16) "," VIEW(52, 48) "," VIEW(100, 144) "," VIEW(244, 16) "],'accessors':["                \
    NUMBERS(0, 3, "VEC3") "," NUMBERS(1, 4, "SCALAR") "," NUMBERS(2, 4, "SCALAR") "," NUMBERS(2, 12, "SCALAR") ","                     \
    NUMBERS(3, 4, "VEC3") "," NUMBERS(3, 12, "VEC3") "," NUMBERS(4, 4, "SCALAR") ","                                          \
    "{'bufferView':1,'componentType':5126,'count':2,'type':'SCALAR','max':[1]},{'bufferView':2,'componentType':5126,'count':2,'type':'SCALAR'}," \
    "{'bufferView':2,'componentType':5126,'count':6,'type':'SCALAR'},{'bufferView':1,'componentType':5126,'count':4,'type':'SCALAR','max':[3]}],'meshes':[{'name':'tri','primitives':[{'attributes':" \
    "{'POSITION':0},'material':0}]}]"
#define LAMPS                                                                                                                         \
    ",'extensionsUsed':['KHR_lights_punctual','KHR_animation_pointer'],'extensions':{'KHR_lights_punctual':{'lights':["               \
    "{'type':'point'},{'type':'spot'}]}}"
#define NODES                                                                                                                         \
    ",'nodes':[{'name':'glow','mesh':0},{'name':'a','extensions':{'KHR_lights_punctual':{'light':0}}},"                               \
    "{'name':'b','extensions':{'KHR_lights_punctual':{'light':1}}}]"

#define CHANNEL(sampler, pointer)                                                                                                     \
    "{'sampler':" #sampler ",'target':{'path':'pointer','extensions':{'KHR_animation_pointer':{'pointer':'" pointer "'}}}}"
#define SAMPLER(input, output, interpolation) "{'input':" #input ",'output':" #output ",'interpolation':'" interpolation "'}"
#define ANIMATION(samplers, channels) ",'animations':[{'name':'dance','samplers':[" samplers "],'channels':[" channels "]}]"

static const char dark[] = ",'materials':[{}]";

static lx_scene *import_tracks(const char *material, const char *animations)
{
    char members[8192];
    track_bin();
    snprintf(members, sizeof members, "%s%s%s%s%s", DATA, LAMPS, NODES, material, animations);
    return import_members(members);
}

static void refuse(const char *animations, const char *start)
{
    char members[8192];
    track_bin();
    snprintf(members, sizeof members, "%s%s%s%s%s", DATA, LAMPS, NODES, dark, animations);
    assert_refused(members, LX_ERROR_FORMAT, start);
}

static void light_intensity_becomes_a_track(void **state)
{
    (void)state;
    lx_scene *scene =
        import_tracks(dark, ANIMATION(SAMPLER(1, 2, "LINEAR"), CHANNEL(0, "/extensions/KHR_lights_punctual/lights/1/intensity")));
    assert_int_equal(scene->track_count, 1);
    const lx_track *track = &scene->tracks[0];
    assert_string_equal(track->name, "dance");
    assert_int_equal(track->object, LX_TRACK_LIGHT);
    assert_int_equal(track->index, 1);
    assert_int_equal(track->channel, LX_TRACK_INTENSITY);
    assert_int_equal(track->interpolation, LX_LINEAR);
    assert_int_equal(track->key_count, 4);
    static const float keys[8] = {0, 1, 1, 2, 2, 3, 3, 4};
    assert_memory_equal(track->keys, keys, sizeof keys);
    // The lamp stays baked.
    assert_int_equal(source_named(scene, "b")->mode, LX_MODE_BAKED);
    assert_int_equal(source_named(scene, "b")->file_light, 1);
    assert_true(scene->instances[0].is_static);
    lx_scene_destroy(scene);
}

static void light_colour_in_a_cubic_spline_keeps_its_tangents(void **state)
{
    (void)state;
    lx_scene *scene =
        import_tracks(dark, ANIMATION(SAMPLER(1, 5, "CUBICSPLINE"), CHANNEL(0, "/extensions/KHR_lights_punctual/lights/0/color")));
    const lx_track *track = &scene->tracks[0];
    assert_int_equal(track->channel, LX_TRACK_COLOR);
    assert_int_equal(track->interpolation, LX_CUBIC);
    static const float first[10] = {0, 0, 0.5f, 1, 1, 0, 0.5f, 0.25f, 0, 0};
    assert_memory_equal(track->keys, first, sizeof first);
    assert_near(track->keys[10], 1, 0); // the time of the second key
    lx_scene_destroy(scene);
}

static void black_material_with_an_animated_factor_is_a_source(void **state)
{
    (void)state;
    lx_scene *scene = import_tracks(dark, ANIMATION(SAMPLER(1, 4, "STEP"), CHANNEL(0, "/materials/0/emissiveFactor")));
    assert_int_equal(scene->tracks[0].object, LX_TRACK_MATERIAL);
    assert_int_equal(scene->tracks[0].interpolation, LX_STEP);
    const lx_source *glow = source_named(scene, "glow");
    assert_near(glow->color.r, 0, 0);
    assert_near(glow->intensity, 1, 0);
    lx_scene_destroy(scene);
}

static void emissive_strength_becomes_a_track_and_factors_above_one_scale_it(void **state)
{
    (void)state;
    lx_scene *scene = import_tracks(",'materials':[{'emissiveFactor':[4,2,0]}]",
                                    ANIMATION(SAMPLER(1, 2, "LINEAR"),
                                              CHANNEL(0, "/materials/0/extensions/KHR_materials_emissive_strength/emissiveStrength")));
    assert_int_equal(scene->tracks[0].channel, LX_TRACK_INTENSITY);
    const lx_source *glow = source_named(scene, "glow");
    assert_near(glow->color_scale, 0.25, 0);
    assert_near(glow->intensity_scale, 4, 0);
    lx_scene_destroy(scene);
}

static void lamp_with_an_area_has_the_scale_of_its_intensity(void **state)
{
    (void)state;
    triangle_bin();
    lx_scene *scene = import_triangle(LAMPS ",'nodes':[{'mesh':0},{'name':'panel','extensions':{'KHR_lights_punctual':{'light':0}},"
                                            "'extras':{'luxel_area':'rect 2 4'}}]");
    const lx_source *panel = source_named(scene, "panel");
    assert_near(panel->intensity_scale, 0.125, 1e-6);
    assert_near(panel->intensity, 0.125, 1e-6); // one candela by default
    lx_scene_destroy(scene);
}

static void other_animated_properties_of_lights_get_a_note(void **state)
{
    (void)state;
    lx_scene *scene = import_tracks(dark, ANIMATION(SAMPLER(1, 2, "LINEAR"),
                                                    CHANNEL(0, "/extensions/KHR_lights_punctual/lights/1/range") ","
                                                    CHANNEL(0, "/extensions/KHR_lights_punctual/lights/1/spot/outerConeAngle") ","
                                                    CHANNEL(0, "/materials/0/pbrMetallicRoughness/roughnessFactor") ","
                                                    CHANNEL(0, "/extensions/KHR_lights_punctual/lights/9/intensity") ","
                                                    CHANNEL(0, "/materials/0") "," CHANNEL(0, "nonsense")));
    assert_int_equal(scene->track_count, 0);
    assert_logged("note: animation 0 'dance': '/extensions/KHR_lights_punctual/lights/1/range' is animated, which cannot be baked");
    assert_logged("outerConeAngle");
    assert_not_logged("roughnessFactor");
    lx_scene_destroy(scene);
}

static void negative_light_is_zero_with_a_warning(void **state)
{
    (void)state;
    lx_scene *scene = import_tracks(dark, ",'animations':[{'samplers':[{'input':1,'output':6}],'channels':["
                                          CHANNEL(0, "/extensions/KHR_lights_punctual/lights/0/intensity") "]}]");
    assert_string_equal(scene->tracks[0].name, "animation_0");
    assert_near(scene->tracks[0].keys[1], 3, 0);
    assert_near(scene->tracks[0].keys[7], 0, 0);
    assert_logged("warning: animation 0 sampler 0: negative light is taken as 0");
    lx_scene_destroy(scene);
}

static void tracks_that_do_not_fit_are_refused(void **state)
{
    (void)state;
#define LIGHT CHANNEL(0, "/extensions/KHR_lights_punctual/lights/0/intensity")
#define COLOR CHANNEL(0, "/extensions/KHR_lights_punctual/lights/0/color")
    refuse(ANIMATION(SAMPLER(1, 3, "LINEAR"), LIGHT), "animation 0 'dance' sampler 0: 12 values for 4 keys");
    refuse(ANIMATION(SAMPLER(1, 2, "CUBICSPLINE"), LIGHT), "animation 0 'dance' sampler 0: 4 values for 4 keys");
    refuse(ANIMATION(SAMPLER(1, 4, "LINEAR"), LIGHT), "animation 0 'dance' sampler 0: output (accessor 4) has not 1 numbers an element");
    refuse(ANIMATION(SAMPLER(1, 2, "LINEAR"), COLOR), "animation 0 'dance' sampler 0: output (accessor 2) has not 3 numbers an element");
    refuse(ANIMATION(SAMPLER(4, 2, "LINEAR"), LIGHT), "animation 0 'dance' sampler 0: input (accessor 4) has not 1 numbers an element");
    refuse(ANIMATION(SAMPLER(6, 2, "LINEAR"), LIGHT), "animation 0 'dance' sampler 0: key 1: times must ascend from 0, but here is 1 s");
    refuse(ANIMATION(SAMPLER(1, 2, "SPLINE"), LIGHT), "animation 0 'dance' sampler 0: interpolation 'SPLINE'");
    refuse(ANIMATION("{'output':2}", LIGHT), "animation 0 'dance' sampler 0: no input");
    refuse(ANIMATION("{'input':1}", LIGHT), "animation 0 'dance' sampler 0: no output");
    refuse(ANIMATION("", "{'target':{'path':'pointer','extensions':{'KHR_animation_pointer':{'pointer':'/materials/0/emissiveFactor'}}}}"),
           "animation 0 'dance' channel: no sampler");
}

static void track_that_ends_early_is_held_until_its_animation_ends(void **state)
{
    (void)state;
    lx_scene *scene = import_tracks(dark, ANIMATION(SAMPLER(7, 8, "LINEAR") "," SAMPLER(10, 2, "LINEAR") "," SAMPLER(7, 9, "CUBICSPLINE"),
                                                    CHANNEL(0, "/extensions/KHR_lights_punctual/lights/0/intensity") ","
                                                    CHANNEL(1, "/extensions/KHR_lights_punctual/lights/1/intensity") ","
                                                    CHANNEL(2, "/materials/0/extensions/KHR_materials_emissive_strength/emissiveStrength")));
    assert_int_equal(scene->track_count, 3);
    static const float held[6] = {0, 1, 1, 2, 3, 2}, level[12] = {0, 1, 2, 3, 1, 4, 5, 0, 3, 0, 5, 0};
    assert_int_equal(scene->tracks[0].key_count, 3);
    assert_memory_equal(scene->tracks[0].keys, held, sizeof held);
    assert_int_equal(scene->tracks[1].key_count, 4); // the longest
    assert_int_equal(scene->tracks[2].key_count, 3);
    assert_memory_equal(scene->tracks[2].keys, level, sizeof level);
    lx_scene_destroy(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(light_intensity_becomes_a_track),
        cmocka_unit_test(track_that_ends_early_is_held_until_its_animation_ends),
        cmocka_unit_test(light_colour_in_a_cubic_spline_keeps_its_tangents),
        cmocka_unit_test(black_material_with_an_animated_factor_is_a_source),
        cmocka_unit_test(emissive_strength_becomes_a_track_and_factors_above_one_scale_it),
        cmocka_unit_test(lamp_with_an_area_has_the_scale_of_its_intensity),
        cmocka_unit_test(other_animated_properties_of_lights_get_a_note),
        cmocka_unit_test(negative_light_is_zero_with_a_warning),
        cmocka_unit_test(tracks_that_do_not_fit_are_refused),
    };
    return cmocka_run_group_tests_name("scene tracks", tests, fixture_setup, fixture_teardown);
}
