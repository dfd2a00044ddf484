#define _POSIX_C_SOURCE 200809L // mkdtemp

// Layers of monitors and what drives layers: names, groups, colours, and what is refused or told.
#include "bake/animations.h"
#include "bake/baked.h"
#include "bake/save.h"
#include "unit/scene_fixture.h"

#include "luxel/bake.h"

#include <unistd.h>

// A quad with TEXCOORD_0 = (0,0) at its top left; scalar keys 0 1 2 (accessor 3), values 10 20 40 (4).
static void quad_bin(void)
{
    bin_clear();
    BIN_FLOATS(-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0);
    BIN_FLOATS(0, 1, 1, 1, 1, 0, 0, 0);
    BIN_U16(0, 1, 2, 0, 2, 3);
    BIN_FLOATS(0, 1, 2);
    BIN_FLOATS(10, 20, 40);
}

#define QUAD                                                                                                                             \
    "'extensionsUsed':['KHR_lights_punctual','KHR_animation_pointer','KHR_materials_emissive_strength'],'bufferViews':[{'buffer':0,"      \
    "'byteLength':48},{'buffer':0,'byteOffset':48,'byteLength':32},{'buffer':0,'byteOffset':80,'byteLength':12},{'buffer':0,"             \
    "'byteOffset':92,'byteLength':12},{'buffer':0,'byteOffset':104,'byteLength':12}],'accessors':[{'bufferView':0,'componentType':5126,"  \
    "'count':4,'type':'VEC3'},{'bufferView':1,'componentType':5126,'count':4,'type':'VEC2'},{'bufferView':2,'componentType':5123,"        \
    "'count':6,'type':'SCALAR'},{'bufferView':3,'componentType':5126,'count':3,'type':'SCALAR'},{'bufferView':4,'componentType':5126,"    \
    "'count':3,'type':'SCALAR'}],'meshes':[{'primitives':[{'attributes':{'POSITION':0,'TEXCOORD_0':1},'indices':2,'material':0}]},"       \
    "{'primitives':[{'attributes':{'POSITION':0,'TEXCOORD_0':1},'indices':2,'material':1}]}]"
#define STRENGTH(nit) "'extensions':{'KHR_materials_emissive_strength':{'emissiveStrength':" #nit "}}"
#define LAMP(index) "'extensions':{'KHR_lights_punctual':{'light':" #index "}}"
#define LIGHTS(list) ",'extensions':{'KHR_lights_punctual':{'lights':[" list "]}}"
#define KEYS(pointer)                                                                                                                    \
    ",'animations':[{'name':'dance','samplers':[{'input':3,'output':4}],'channels':[{'sampler':0,'target':{'path':'pointer',"             \
    "'extensions':{'KHR_animation_pointer':{'pointer':'" pointer "'}}}}]}]"

typedef struct layered {
    lx_scene *scene;
    lx_atlas *atlas;
    lx_bake *bake;
    lx_error error;
} layered;

static layered build(const char *members, bool combined, lx_result expected)
{
    layered l = {0};
    lx_bake_desc desc = lx_bake_desc_default();
    lx_atlas_desc atlas_desc = lx_atlas_desc_default();
    desc.combined = combined;
    desc.max_layers = 3;
    atlas_desc.page_size = 64;
    quad_bin();
    l.scene = import_members(members);
    assert_int_equal(lx_atlas_build(l.scene, &atlas_desc, NULL, &l.atlas, NULL), LX_OK);
    const lx_result result = lx_bake_create(l.scene, l.atlas, &desc, &l.bake, &l.error);
    if (result != expected) fail_msg("%d, not %d: %s", result, expected, l.error.message);
    return l;
}

static void release(layered *l)
{
    lx_bake_destroy(l->bake);
    lx_atlas_destroy(l->atlas);
    lx_scene_destroy(l->scene);
}

static const lx_pack_animation *animation(const layered *l, size_t index)
{
    if (index >= l->bake->animations->count) fail_msg("only %zu animations; log:\n%s", l->bake->animations->count, fixture_log);
    return &l->bake->animations->items[index];
}

static void monitor_has_a_layer_for_each_cell(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'emissiveFactor':[1,0.5,0.25]," STRENGTH(8) ",'extras':{'luxel_monitor':'3x2'}},{}],'nodes':["
                           "{'name':'lamp','mesh':0,'extras':{'luxel_monitor':'1x1'}},{'name':'tv','mesh':0},{'mesh':1}]", false, LX_OK);
    assert_int_equal(l.bake->layer_count, 7);
    assert_string_equal(l.bake->layers[0].name, "lamp/0");
    assert_string_equal(l.bake->layers[1].name, "tv/0");
    assert_string_equal(l.bake->layers[6].name, "tv/5");
    assert_int_equal(l.bake->uses[1].layer, 1);
    assert_int_equal(l.bake->layers[5].cell, 4);
    assert_near(l.bake->layers[4].color[1], 0.5, 0);
    assert_near(l.bake->layers[4].intensity, 8, 0);
    assert_string_equal(l.bake->layers[4].unit, "nt");
    release(&l);
}

static void monitors_of_one_layer_share_its_cells(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'emissiveFactor':[1,1,1]," STRENGTH(8) "},{'emissiveFactor':[1,1,1]," STRENGTH(2) "}],'nodes':[{'name':'wall',"
                           "'extras':{'luxel_monitor':'2x2','luxel_layer':'screens'},'children':[1,2]},{'name':'a','mesh':0},{'name':'b','mesh':1}]",
                      false, LX_OK);
    assert_int_equal(l.bake->layer_count, 4);
    assert_string_equal(l.bake->layers[3].name, "screens/3");
    assert_int_equal(l.bake->uses[0].layer, 0);
    assert_int_equal(l.bake->uses[1].layer, 0);
    assert_near(l.bake->uses[0].weight.g, 1, 0);
    assert_near(l.bake->uses[1].weight.g, 0.25, 0);
    assert_near(l.bake->layers[2].intensity, 8, 0);
    release(&l);
}

static void monitors_that_cannot_share_cells_are_refused(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'emissiveFactor':[1,1,1]},{'emissiveFactor':[1,1,1]}],'nodes':[{'name':'a','mesh':0,'extras':{"
                           "'luxel_monitor':'2x2','luxel_layer':'s'}},{'name':'b','mesh':1,'extras':{'luxel_monitor':'4x1','luxel_layer':'s'}}]",
                      false, LX_ERROR_FORMAT);
    assert_string_equal(l.error.message, "layer 's': monitors 'a' (2x2) and 'b' (4x1) have different grids; give them two luxel_layer names");
    release(&l);
    l = build(QUAD ",'materials':[{'emissiveFactor':[1,1,1]},{'emissiveFactor':[1,1,1]}],'nodes':[{'name':'a','mesh':0,'extras':{"
                   "'luxel_layer':'s'}},{'name':'b','mesh':1,'extras':{'luxel_monitor':'4x1','luxel_layer':'s'}}]",
              false, LX_ERROR_FORMAT);
    assert_string_equal(l.error.message, "layer 's': 'b' is a monitor and 'a' is not; give them two luxel_layer names");
    release(&l);
}

static void monitor_that_is_off_shares_cells_with_a_warning(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'emissiveFactor':[1,1,1]},{}],'nodes':[{'name':'a','mesh':0,'extras':{'luxel_monitor':'2x2','luxel_layer':'s'"
                           "}},{'name':'b','mesh':1,'extras':{'luxel_monitor':'2x2','luxel_layer':'s'}}]", false, LX_OK);
    assert_logged("warning: layer 's': monitors 'a' and 'b' share their cells but show different pictures; that of 'a' is baked for both");
    assert_near(l.bake->uses[1].weight.r, 1, 0);
    release(&l);
}

static void monitors_count_once_and_are_never_grouped(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'name':'screen','emissiveFactor':[1,1,1]},{'name':'neon','emissiveFactor':[1,0,0]}],'nodes':[{'name':'a',"
                           "'mesh':0,'extras':{'luxel_monitor':'4x4'}},{'name':'b','mesh':1},{'name':'c','mesh':1},{'name':'d','mesh':1}]",
                      false, LX_OK);
    assert_logged("note: 4 sources are more than --max-layers 3: grouped by material into 2 layers");
    assert_int_equal(l.bake->layer_count, 17);
    assert_string_equal(l.bake->layers[16].name, "neon");
    release(&l);
}

static void too_many_sources_leave_animated_ones_out_of_their_groups(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{},{}]" LIGHTS("{'type':'point','intensity':100}") ",'nodes':[{'mesh':0},{'name':'a'," LAMP(0) "},"
                           "{'name':'b'," LAMP(0) "},{'name':'candle'," LAMP(0) ",'extras':{'luxel_animate':'blink 2'}},{'name':'c'," LAMP(0) "}]",
                      false, LX_OK);
    assert_logged("note: 4 sources are more than --max-layers 3: grouped by material and parent node into 2 layers");
    assert_int_equal(l.bake->layer_count, 2);
    assert_string_equal(l.bake->layers[0].name, "top level (cd)");
    assert_int_equal(l.bake->layers[0].source_count, 3);
    assert_string_equal(l.bake->layers[1].name, "candle");
    assert_int_equal(l.bake->animations->count, 1);
    assert_int_equal(animation(&l, 0)->layer, 1);
    release(&l);
}

static void emissive_source_with_a_program_is_not_grouped_by_its_material(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'name':'neon','emissiveFactor':[1,0,0]},{}],'nodes':[{'name':'a','mesh':0},{'name':'b','mesh':0},"
                           "{'name':'tired','mesh':0,'extras':{'luxel_animate':'flicker'}},{'name':'c','mesh':0}]", false, LX_OK);
    assert_int_equal(l.bake->layer_count, 2);
    assert_int_equal(l.bake->layers[0].source_count, 3);
    assert_string_equal(l.bake->layers[1].name, "tired");
    assert_int_equal(animation(&l, 0)->layer, 1);
    release(&l);
}

static void emitters_of_an_animated_material_are_grouped_with_its_program(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'name':'bulb','emissiveFactor':[1,0,0],'extras':{'luxel_animate':'pulse 2'}},{}],'nodes':["
                           "{'name':'a','mesh':0},{'name':'b','mesh':0},{'name':'c','mesh':0},{'name':'d','mesh':0}]", false, LX_OK);
    assert_int_equal(l.bake->layer_count, 1);
    assert_string_equal(l.bake->layers[0].name, "bulb");
    assert_int_equal(l.bake->animations->count, 1);
    release(&l);
}

static void too_many_animated_sources_are_refused(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'emissiveFactor':[1,0,0]},{}],'nodes':[{'extras':{'luxel_animate':'pulse 2'},'children':[1,2,3,4]},"
                           "{'name':'a','mesh':0},{'name':'b','mesh':0},{'name':'c','mesh':0},{'name':'d','mesh':0}]", false, LX_ERROR_LIMIT);
    assert_string_equal(l.error.message, "4 layers (4 for a luxel_animate each) are more than --max-layers 3, even grouped by material and parent "
                                         "node: raise it or name groups with luxel_layer");
    release(&l);
}

static void too_many_lamps_are_grouped_apart_from_those_that_the_file_animates(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{},{}]" LIGHTS("{'type':'point'},{'type':'point'}") ",'nodes':[{'mesh':0},{'name':'a'," LAMP(0)
                      "},{'name':'b'," LAMP(1) "},{'name':'c'," LAMP(0) "},{'name':'d'," LAMP(1) "}]"
                      KEYS("/extensions/KHR_lights_punctual/lights/0/intensity"), false, LX_OK);
    assert_int_equal(l.bake->layer_count, 2);
    assert_string_equal(l.bake->layers[0].name, "lamps of light 0 (cd)");
    assert_int_equal(l.bake->layers[0].source_count, 2);
    assert_string_equal(l.bake->layers[1].name, "top level (cd)");
    assert_int_equal(l.bake->animations->count, 1);
    assert_int_equal(animation(&l, 0)->layer, 0);
    release(&l);
}

static void monitor_in_a_combined_bake_is_an_emitter_like_others(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'emissiveFactor':[1,1,1],'extras':{'luxel_monitor':'3x2','luxel_animate':'blink 2'}},{}],'nodes':[{'mesh':0}]",
                      true, LX_OK);
    assert_int_equal(l.bake->layer_count, 1);
    assert_false(lx_tracer_is_told_by_cell(l.bake->tracer, 0));
    assert_null(l.bake->uses[0].cells);
    assert_int_equal(l.bake->animations->count, 0);
    assert_logged("note: what animates 'light_0' is not baked: a combined layer stays as authored");
    release(&l);
}

static void combined_bake_tells_once_of_programs_and_animations_that_it_leaves_out(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{},{'emissiveFactor':[1,1,1]}]" LIGHTS("{'type':'point'},{'type':'point'}") ",'nodes':[{'mesh':0},{'name':'still',"
                      LAMP(1) "},{'name':'a'," LAMP(0) "},{'name':'b'," LAMP(1) ",'extras':{'luxel_animate':'blink 2'}},{'name':'c','mesh':1}]"
                      KEYS("/extensions/KHR_lights_punctual/lights/0/intensity"), true, LX_OK);
    assert_logged("note: what animates 'a' and 1 more is not baked: a combined layer stays as authored");
    release(&l);
    l = build(QUAD ",'materials':[{'emissiveFactor':[1,1,1]},{}],'nodes':[{'mesh':0}]", true, LX_OK);
    assert_null(strstr(fixture_log, "what animates"));
    release(&l);
}

static void program_drives_its_layer_at_the_authored_colour(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'emissiveFactor':[1,0.5,0]," STRENGTH(6) "},{}],'nodes':[{'name':'neon','mesh':0,'extras':{"
                           "'luxel_animate':'blink 2 duty=0.25 low=0.125'}}]", false, LX_OK);
    const lx_pack_animation *a = animation(&l, 0);
    assert_string_equal(a->name, "");
    assert_int_equal(a->layer, 0);
    assert_int_equal(a->program.kind, LXRT_PROGRAM_BLINK);
    float c[3];
    assert_int_equal(lxrt_program_evaluate(&a->program, 0.25, c), LXRT_OK);
    assert_near(c[0], 6, 0);
    assert_near(c[1], 3, 0);
    assert_int_equal(lxrt_program_evaluate(&a->program, 1, c), LXRT_OK);
    assert_near(c[0], 0.75, 0);
    release(&l);
}

static void schedule_counts_in_the_unit_of_the_file(void **state)
{
    (void)state;
    // 8 cd through 4 m²: 2 nit. The schedule's 16 are candela too.
    layered l = build(QUAD ",'materials':[{},{}]" LIGHTS("{'type':'point','intensity':8}") ",'nodes':[{'mesh':0},{'name':'panel'," LAMP(0)
                      ",'extras':{'luxel_area':'rect 2 2','luxel_animate':'schedule 10 0=#ffffff 5=1,0,0*16'}}]", false, LX_OK);
    const lx_pack_animation *a = animation(&l, 0);
    float c[3];
    assert_near(l.bake->layers[0].intensity, 2, 1e-6);
    assert_int_equal(lxrt_program_evaluate(&a->program, 1, c), LXRT_OK);
    assert_near(c[1], 2, 1e-6);
    assert_int_equal(lxrt_program_evaluate(&a->program, 6, c), LXRT_OK);
    assert_near(c[0], 4, 1e-6);
    assert_near(c[1], 0, 0);
    release(&l);
}

static void intensity_in_a_group_of_unlike_colours_counts_in_the_unit_of_the_file(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{},{}]" LIGHTS("{'type':'point','intensity':100,'color':[0.5,0.25,0]},{'type':'point','intensity':100,"
                      "'color':[0,0,0.25]}") ",'nodes':[{'mesh':0},{'name':'a'," LAMP(0) ",'extras':{'luxel_layer':'s','luxel_animate':"
                      "'constant intensity=100'}},{'name':'b'," LAMP(1) ",'extras':{'luxel_layer':'s'}},{'name':'c'," LAMP(0) ",'extras':{"
                      "'luxel_layer':'t'}},{'name':'d'," LAMP(1) ",'extras':{'luxel_layer':'t','luxel_animate':"
                      "'schedule 10 0=#ffffff*100 5=1,0,0*200'}}]", false, LX_OK);
    float c[3];
    assert_near(l.bake->layers[0].intensity, 50, 0);
    assert_int_equal(lxrt_program_evaluate(&animation(&l, 0)->program, 0, c), LXRT_OK);
    for (int i = 0; i < 3; ++i) assert_near(c[i], l.bake->layers[0].color[i] * l.bake->layers[0].intensity, 1e-5);
    assert_int_equal(lxrt_program_evaluate(&animation(&l, 1)->program, 1, c), LXRT_OK);
    for (int i = 0; i < 3; ++i) assert_near(c[i], 50, 1e-5);
    assert_int_equal(lxrt_program_evaluate(&animation(&l, 1)->program, 6, c), LXRT_OK);
    assert_near(c[0], 100, 1e-5);
    release(&l);
}

static void intensity_of_a_weaker_lamp_counts_for_that_lamp(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{},{}]" LIGHTS("{'type':'point','intensity':100,'color':[0.5,0.25,0]},{'type':'point','intensity':25,"
                      "'color':[0.5,0.25,0]}") ",'nodes':[{'mesh':0},{'name':'a'," LAMP(0) ",'extras':{'luxel_layer':'s'}},{'name':'b'," LAMP(1)
                      ",'extras':{'luxel_layer':'s','luxel_animate':'constant intensity=25'}}]", false, LX_OK);
    float c[3];
    assert_int_equal(lxrt_program_evaluate(&animation(&l, 0)->program, 0, c), LXRT_OK);
    assert_near(c[0], 50, 1e-5);
    assert_near(c[1], 25, 1e-5);
    release(&l);
}

static void program_of_one_source_drives_the_whole_layer_with_a_warning(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'emissiveFactor':[1,1,1]},{'emissiveFactor':[1,1,1]}],'nodes':[{'name':'a','mesh':0,'extras':{'luxel_layer':'s',"
                           "'luxel_animate':'pulse 2'}},{'name':'b','mesh':1,'extras':{'luxel_layer':'s'}}]", false, LX_OK);
    assert_int_equal(l.bake->animations->count, 1);
    assert_logged("warning: layer 's': luxel_animate of 'a' also drives 'b', which has none");
    release(&l);
}

static void equal_programs_of_one_layer_are_one_program(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'emissiveFactor':[1,1,1]},{'emissiveFactor':[1,1,1]}],'nodes':[{'name':'a','mesh':0,'extras':{'luxel_layer':'s',"
                           "'luxel_animate':'blink 2'}},{'name':'b','mesh':1,'extras':{'luxel_layer':'s','luxel_animate':'blink 2'}},{'name':'c','mesh':0,"
                           "'extras':{'luxel_layer':'t','luxel_animate':'schedule 10 0=off 5=1,1,1'}},{'name':'d','mesh':1,'extras':{'luxel_layer':'t',"
                           "'luxel_animate':'schedule 10s 0=off 5=1,1,1'}}]", false, LX_OK);
    assert_int_equal(l.bake->animations->count, 2);
    assert_null(strstr(fixture_log, "also drives"));
    release(&l);
}

static void unlike_programs_of_one_layer_are_told(void **state)
{
    (void)state;
    static const char *const others[] = {"blink 3", "blink 2 low=0.5", "blink 2 color=#ff0000", "pulse 2", "blink 2 intensity=3"};
    for (size_t i = 0; i < sizeof others / sizeof *others; ++i) {
        char members[4096];
        snprintf(members, sizeof members,
                 QUAD ",'materials':[{'emissiveFactor':[1,1,1]},{'emissiveFactor':[1,1,1]}],'nodes':[{'name':'a','mesh':0,'extras':{'luxel_layer':'s',"
                      "'luxel_animate':'blink 2'}},{'name':'b','mesh':1,'extras':{'luxel_layer':'s','luxel_animate':'%s'}}]", others[i]);
        layered l = build(members, false, LX_OK);
        assert_logged("warning: layer 's': luxel_animate of 'a' also drives 'b', which has another");
        release(&l);
    }
    layered l = build(QUAD ",'materials':[{'emissiveFactor':[1,1,1]},{'emissiveFactor':[1,1,1]}],'nodes':[{'name':'a','mesh':0,'extras':{'luxel_layer':'s',"
                           "'luxel_animate':'schedule 10 0=off 5=1,1,1'}},{'name':'b','mesh':1,'extras':{'luxel_layer':'s',"
                           "'luxel_animate':'schedule 10 0=off 5=1,1,1*2'}}]", false, LX_OK);
    assert_logged("which has another");
    release(&l);
}

static void programs_that_do_nothing_are_told(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'emissiveFactor':[1,1,1],'extras':{'luxel_animate':'wheel 3'}},{}],'nodes':[{'name':'grey','mesh':0},"
                           "{'name':'tv','mesh':0,'extras':{'luxel_monitor':'2x1'}}]", false, LX_OK);
    assert_logged("warning: layer 'grey': its luxel_animate turns the hue of a colour that has none; add color=#rrggbb");
    assert_logged("warning: monitor 'tv': luxel_animate has no effect: its picture drives it");
    assert_int_equal(l.bake->animations->count, 1);
    release(&l);
}

static void two_flickers_differ_unless_they_share_a_seed(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'emissiveFactor':[1,1,1],'extras':{'luxel_animate':'flicker'}},{'emissiveFactor':[1,1,1],'extras':{"
                           "'luxel_animate':'flicker seed=5'}}],'nodes':[{'name':'a','mesh':0},{'name':'b','mesh':0},{'name':'c','mesh':1}]",
                      false, LX_OK);
    assert_int_not_equal(animation(&l, 0)->program.seed, animation(&l, 1)->program.seed);
    assert_int_equal(animation(&l, 2)->program.seed, 5);
    release(&l);
}

static void animated_intensity_is_scaled_to_the_layer(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{},{}]" LIGHTS("{'type':'point','intensity':8,'color':[1,0.5,0]}") ",'nodes':[{'mesh':0},{'name':'panel'," LAMP(0)
                      ",'extras':{'luxel_area':'rect 2 2'}},{'name':'small'," LAMP(0) ",'extras':{'luxel_area':'rect 1 1'}}]"
                      KEYS("/extensions/KHR_lights_punctual/lights/0/intensity"), false, LX_OK);
    assert_int_equal(l.bake->animations->count, 2);
    const lx_pack_animation *a = animation(&l, 0);
    assert_string_equal(a->name, "dance");
    assert_int_equal(a->channel, LX_PACK_CHANNEL_INTENSITY);
    assert_near(a->program.keys[1], 2.5, 1e-6); // 10 cd through 4 m²
    assert_near(a->program.keys[5], 10, 1e-6);
    assert_near(animation(&l, 1)->program.keys[5], 40, 1e-5); // 40 cd through 1 m²
    release(&l);
}

static void animated_strength_is_scaled_as_the_importer_scaled_it(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'emissiveFactor':[2,1,0]," STRENGTH(3) "},{}],'nodes':[{'mesh':0}]"
                      KEYS("/materials/0/extensions/KHR_materials_emissive_strength/emissiveStrength"), false, LX_OK);
    assert_near(l.bake->layers[0].color[1], 0.5, 0);
    assert_near(animation(&l, 0)->program.keys[1], 20, 0); // × the 2 that the factor was brought to 1 by
    release(&l);
}

static void layer_of_two_lamps_is_not_driven_by_one(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{},{}]" LIGHTS("{'type':'point'},{'type':'point'}") ",'nodes':[{'mesh':0},{'name':'a'," LAMP(0)
                      ",'extras':{'luxel_layer':'s'}},{'name':'b'," LAMP(1) ",'extras':{'luxel_layer':'s'}}]"
                      KEYS("/extensions/KHR_lights_punctual/lights/0/intensity"), false, LX_OK);
    assert_int_equal(l.bake->animations->count, 0);
    assert_logged("warning: animation 'dance' drives 'a' but not 'b', which are both in layer 's'; not baked: give them two layers");
    release(&l);
}

static void group_of_one_animated_lamp_that_is_off_keeps_its_proportions(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{},{}]" LIGHTS("{'type':'point','intensity':0}") ",'nodes':[{'mesh':0},{'name':'a'," LAMP(0)
                      ",'extras':{'luxel_layer':'s','luxel_area':'rect 1 1'}},{'name':'b'," LAMP(0) ",'extras':{'luxel_layer':'s','luxel_area':'rect 2 2'}}]"
                      KEYS("/extensions/KHR_lights_punctual/lights/0/intensity"), false, LX_OK);
    assert_near(l.bake->uses[0].weight.r, 1, 0);
    assert_near(l.bake->uses[1].weight.r, 0.25, 1e-6);
    assert_near(animation(&l, 0)->program.keys[1], 10, 1e-5);
    release(&l);
}

static void animation_of_a_monitor_is_told(void **state)
{
    (void)state;
    layered l = build(QUAD ",'materials':[{'emissiveFactor':[1,1,1],'extras':{'luxel_monitor':'2x1'}},{}],'nodes':[{'name':'tv','mesh':0}]"
                      KEYS("/materials/0/extensions/KHR_materials_emissive_strength/emissiveStrength"), false, LX_OK);
    assert_int_equal(l.bake->animations->count, 0);
    assert_logged("warning: animation 'dance' has no effect on monitor 'tv': its picture drives it");
    release(&l);
}

// A PNG of 4 × 2 texels: red, green, blue, white over black, a dark grey, yellow, magenta.
#define PICTURE                                                                                                                          \
    ",'textures':[{'source':0,'sampler':0}],'samplers':[{'wrapS':33071,'wrapT':33071}],'images':[{'uri':'data:image/png;base64,"          \
    "iVBORw0KGgoAAAANSUhEUgAAAAQAAAACCAIAAADwyuo0AAAAGUlEQVR42mP4z8DAAMZAAKQYbGxsgAwgBACAPwqrK7Y/GgAAAABJRU5ErkJggg=='}]"

static lx_baked *save_and_open(layered *l, const char *out)
{
    const lx_save_desc desc = {0};
    lx_new_folder folder = {0};
    lx_manifest manifest = {0};
    lx_baked *baked = NULL;
    lx_error error = {0};
    lx_result result = lx_new_folder_begin(out, &folder, &error);
    if (result == LX_OK) result = lx_bake_write(l->bake, &desc, &folder, NULL, &manifest, &error);
    if (result == LX_OK) result = lx_bake_write_manifest(&manifest, &folder, &error);
    if (result == LX_OK) result = lx_new_folder_commit(&folder, &error);
    lx_manifest_release(&manifest);
    lx_new_folder_abort(&folder);
    if (result == LX_OK) result = lx_baked_open(fixture_context, out, true, &baked, &error);
    if (result != LX_OK) fail_msg("%s", error.message);
    return baked;
}

// What the importer makes of the file's own picture is what the runtime makes of the same pixels, so that a video that begins with it does not jump.
static void runtime_given_the_authored_picture_gives_the_authored_cells(void **state)
{
    (void)state;
    static const uint8_t pixels[24] = {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255, 0, 0, 0, 60, 60, 60, 255, 255, 0, 255, 0, 255};
    static const char *const grids[] = {"4x2", "3x1", "1x1", "5x3"};
    char root[] = "/tmp/luxel-layers-XXXXXX";
    assert_non_null(mkdtemp(root));
    for (size_t g = 0; g < sizeof grids / sizeof *grids; ++g) {
        char members[4096], out[64], command[128];
        snprintf(members, sizeof members,
                 QUAD ",'materials':[{'emissiveFactor':[1,0.5,1],'emissiveTexture':{'index':0}," STRENGTH(20) ",'extras':{'luxel_monitor':'%s'}},{}]"
                 PICTURE ",'nodes':[{'name':'tv','mesh':0}]", grids[g]);
        snprintf(out, sizeof out, "%s/%zu.baked", root, g);
        layered l = build(members, false, LX_OK);
        lx_baked *baked = save_and_open(&l, out);
        assert_non_null(lx_baked_monitor(baked, 0));
        assert_false(lx_baked_monitor_shows_cells(baked, lx_baked_monitor(baked, 0)));
        lxrt_monitor monitor;
        assert_int_equal(lxrt_get_monitor(baked->pack, 0, &monitor), LXRT_OK);
        assert_string_equal(monitor.name, "tv");
        assert_near(monitor.strength[1], 10, 0);
        assert_int_equal(lxrt_monitor_update(baked->pack, 0, pixels, 4, 2, 0, LXRT_PIXELS_RGB8_SRGB), LXRT_OK);
        for (uint32_t layer = 0; layer < l.bake->layer_count; ++layer) {
            float c[3];
            lxrt_get_layer(baked->pack, layer, c);
            for (int i = 0; i < 3; ++i) assert_near(c[i], l.bake->layers[layer].color[i] * l.bake->layers[layer].intensity, 1e-3);
        }
        // A frame of one colour: every cell is exactly that, and the monitor shows cells from now on.
        uint8_t white[24];
        memset(white, 255, sizeof white);
        assert_int_equal(lxrt_monitor_update(baked->pack, 0, white, 4, 2, 0, LXRT_PIXELS_RGB8_SRGB), LXRT_OK);
        assert_true(lx_baked_monitor_shows_cells(baked, lx_baked_monitor(baked, 0)));
        lx_baked_destroy(baked);
        release(&l);
        snprintf(command, sizeof command, "rm -r %s", out);
        assert_int_equal(system(command), 0);
    }
    rmdir(root);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(monitor_has_a_layer_for_each_cell),
        cmocka_unit_test(monitors_of_one_layer_share_its_cells),
        cmocka_unit_test(monitors_that_cannot_share_cells_are_refused),
        cmocka_unit_test(monitor_that_is_off_shares_cells_with_a_warning),
        cmocka_unit_test(monitors_count_once_and_are_never_grouped),
        cmocka_unit_test(too_many_sources_leave_animated_ones_out_of_their_groups),
        cmocka_unit_test(emissive_source_with_a_program_is_not_grouped_by_its_material),
        cmocka_unit_test(emitters_of_an_animated_material_are_grouped_with_its_program),
        cmocka_unit_test(too_many_animated_sources_are_refused),
        cmocka_unit_test(too_many_lamps_are_grouped_apart_from_those_that_the_file_animates),
        cmocka_unit_test(monitor_in_a_combined_bake_is_an_emitter_like_others),
        cmocka_unit_test(combined_bake_tells_once_of_programs_and_animations_that_it_leaves_out),
        cmocka_unit_test(program_drives_its_layer_at_the_authored_colour),
        cmocka_unit_test(schedule_counts_in_the_unit_of_the_file),
        cmocka_unit_test(intensity_in_a_group_of_unlike_colours_counts_in_the_unit_of_the_file),
        cmocka_unit_test(intensity_of_a_weaker_lamp_counts_for_that_lamp),
        cmocka_unit_test(program_of_one_source_drives_the_whole_layer_with_a_warning),
        cmocka_unit_test(equal_programs_of_one_layer_are_one_program),
        cmocka_unit_test(unlike_programs_of_one_layer_are_told),
        cmocka_unit_test(programs_that_do_nothing_are_told),
        cmocka_unit_test(two_flickers_differ_unless_they_share_a_seed),
        cmocka_unit_test(animated_intensity_is_scaled_to_the_layer),
        cmocka_unit_test(animated_strength_is_scaled_as_the_importer_scaled_it),
        cmocka_unit_test(layer_of_two_lamps_is_not_driven_by_one),
        cmocka_unit_test(group_of_one_animated_lamp_that_is_off_keeps_its_proportions),
        cmocka_unit_test(animation_of_a_monitor_is_told),
        cmocka_unit_test(runtime_given_the_authored_picture_gives_the_authored_cells),
    };
    return cmocka_run_group_tests_name("bake layers", tests, fixture_setup, fixture_teardown);
}
