// Lights, area lights, sources and their names, authoring keys and who inherits them, and advice.
#include "unit/scene_fixture.h"

#define LIGHTS(list)                                                                                                   \
    ",'extensionsUsed':['KHR_lights_punctual'],'extensions':{'KHR_lights_punctual':{'lights':[" list "]}}"
#define LAMP(index) "'extensions':{'KHR_lights_punctual':{'light':" #index "}}"

// --- KHR_lights_punctual ---

static void lights_are_placed_by_their_nodes(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(LIGHTS(
        "{'type':'point','intensity':40,'color':[1,0.5,0.25],'range':8},"
        "{'type':'spot','intensity':5,'spot':{'innerConeAngle':0.2,'outerConeAngle':0.6}},{'type':'directional','"
        "intensity':3}") ",'nodes':[{'mesh':0},{'name':'bulb'," LAMP(0) ",'translation':[1,2,3],'scale':[9,9,9]},"
                                                                        "{'name':'sun'," LAMP(
                                                                            2) ",'rotation':[-0.70710678,0,0,0."
                                                                               "70710678],'scale':[2,3,-4]},{'name':'"
                                                                               "stage'," LAMP(1) "}]");
    assert_int_equal(scene->light_count, 3);
    const lx_light *bulb = &scene->lights[0], *sun = &scene->lights[1], *stage = &scene->lights[2];
    assert_int_equal(bulb->kind, LX_LIGHT_POINT);
    assert_vec3(bulb->position, 1, 2, 3);
    assert_near(bulb->intensity, 40, 0);
    assert_near(bulb->range, 8, 0);
    assert_near(bulb->color.g, 0.5, 0);
    assert_int_equal(sun->kind, LX_LIGHT_DIRECTIONAL);
    assert_vec3(sun->direction, 0, 1, 0); // down, but for the mirrored axis
    assert_int_equal(stage->kind, LX_LIGHT_SPOT);
    assert_vec3(stage->direction, 0, 0, -1);
    assert_near(stage->inner_angle, 0.2, 1e-7);
    assert_near(stage->outer_angle, 0.6, 1e-7);
    assert_int_equal(scene->source_count, 3);
    assert_string_equal(scene->sources[0].name, "bulb");
    assert_int_equal(scene->sources[1].kind, LX_SOURCE_DIRECTIONAL);
    assert_int_equal(scene->sources[2].light, 2);
    lx_scene_destroy(scene);
}

static void light_with_defaults_is_white_and_one(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(LIGHTS("{'type':'spot'}") ",'nodes':[{'mesh':0},{" LAMP(0) "}]");
    const lx_light *light = &scene->lights[0];
    assert_near(light->intensity, 1, 0);
    assert_near(light->color.b, 1, 0);
    assert_near(light->range, 0, 0);
    assert_near(light->inner_angle, 0, 0);
    assert_near(light->outer_angle, LX_PI / 4, 0);
    assert_string_equal(light->name, "light_0");
    lx_scene_destroy(scene);
}

static void negative_intensity_is_zero_with_a_warning(void **state)
{
    (void)state;
    lx_scene *scene =
        import_triangle(LIGHTS("{'name':'L','type':'point','intensity':-3}") ",'nodes':[{'mesh':0},{" LAMP(0) "}]");
    assert_near(scene->lights[0].intensity, 0, 0);
    assert_int_equal(scene->source_count, 1); // zero intensity is baked too
    assert_string_equal(scene->sources[0].name, "L");
    assert_logged("warning: light 0 'L': negative intensity or colour is taken as 0");
    lx_scene_destroy(scene);
}

static void wrong_lights_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *light, *start;
    } cases[] = {
        {"{'name':'s','type':'spot','spot':{'innerConeAngle':0.6,'outerConeAngle':0.6}}",
         "light 0 's': innerConeAngle 0.6 is not from 0 to below outerConeAngle 0.6"},
        {"{'type':'spot','spot':{'innerConeAngle':-0.1}}", "light 0: innerConeAngle -0.1"},
        {"{'type':'spot','spot':{'outerConeAngle':1.7}}", "light 0: outerConeAngle 1.7 is more than pi/2"},
        {"{'type':'point','range':-1}", "light 0: range -1 is negative"},
        {"{'type':'laser'}", "light 0: unknown type 'laser'"},
        {"{'type':'point','intensity':1e300}", "light 0: 'intensity' is not a finite number"},
        {"{'type':'point','color':[1,1]}", "light 0: 'color' is not an array of 3 numbers"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        char more[512];
        snprintf(more, sizeof more, LIGHTS("%s") ",'nodes':[{'mesh':0},{" LAMP(0) "}]", cases[i].light);
        assert_triangle_refused(more, LX_ERROR_FORMAT, cases[i].start);
    }
    assert_triangle_refused(LIGHTS("{'type':'point'}") ",'nodes':[{'mesh':0},{'name':'n'," LAMP(4) "}]",
                            LX_ERROR_FORMAT, "node 1 'n' KHR_lights_punctual: light 4 out of range (count 1)");
}

static void right_angle_with_rounding_is_accepted(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(
        LIGHTS("{'type':'spot','spot':{'outerConeAngle':1.57082}}") ",'nodes':[{'mesh':0},{" LAMP(0) "}]");
    assert_near(scene->lights[0].outer_angle, LX_PI / 2, 0);
    lx_scene_destroy(scene);
}

static void lights_in_vpl_and_blocker_groups_are_no_lamps(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(
        LIGHTS("{'type':'point'}") ",'nodes':[{'mesh':0},{'name':'VPLS.hall','children':[2]},{'children':[3]},{" LAMP(
            0) "},{'name':'BLOCKERS','children':[5]},{" LAMP(0) "},"
                                                                "{'name':'lamp of VPLS'," LAMP(0) "}]");
    assert_int_equal(scene->light_count, 1);
    assert_string_equal(scene->lights[0].name, "lamp of VPLS");
    lx_scene_destroy(scene);
}

// --- Radius and area ---

static void radius_is_metres_or_degrees(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(
        LIGHTS("{'type':'point','extras':{'luxel_radius':0.3}},{'type':'directional'}") ",'nodes':[{'mesh':0},{" LAMP(
            0) ",'scale':[4,4,4]},{" LAMP(1) ",'extras':{'luxel_radius':0.53}},{" LAMP(0) ",'extras':{'luxel_radius':'"
                                                                                          "0.1'}}]");
    assert_near(scene->lights[0].radius, 0.3, 1e-7);
    assert_near(scene->lights[1].radius, 0.53 * 3.14159265 / 180, 1e-8);
    assert_near(scene->lights[2].radius, 0.1, 1e-7); // the node's goes before the light's
    lx_scene_destroy(scene);
}

static void rect_light_takes_radiance_from_on_axis_intensity(void **state)
{
    (void)state;
    lx_scene *scene =
        import_triangle(LIGHTS("{'type':'spot','intensity':60,'range':5}") ",'nodes':[{'mesh':0},{'name':'panel'," LAMP(
            0) ",'extras':{'luxel_area':'rect 2 0.5'},'scale':[3,2,1]}]");
    const lx_light *light = &scene->lights[0];
    assert_int_equal(light->kind, LX_LIGHT_RECT);
    assert_vec3(light->axis_x, 3, 0, 0); // half of 2 m, three times as wide
    assert_vec3(light->axis_y, 0, 0.5f, 0);
    assert_vec3(light->direction, 0, 0, -1);
    assert_near(light->intensity, 10, 1e-5); // 60 cd over 6 m²
    assert_near(light->range, 5, 0);
    assert_int_equal(scene->sources[0].kind, LX_SOURCE_RECT);
    assert_logged("note: node 1 'panel': with luxel_area the spot's cone angles are ignored");
    lx_scene_destroy(scene);
}

static void area_light_without_lamp_has_its_own_colour(void **state)
{
    (void)state;
    lx_scene *scene =
        import_triangle(",'nodes':[{'mesh':0},"
                        "{'name':'a','extras':{'luxel_area':'disk 0.5','luxel_color':'#ff8000','luxel_intensity':200}},"
                        "{'name':'b','extras':{'luxel_area':'rect 1 1','luxel_color':[0.5,2,0]}}]");
    assert_int_equal(scene->source_count, 2);
    const lx_light *disk = &scene->lights[0];
    assert_int_equal(disk->kind, LX_LIGHT_DISK);
    assert_near(lx_length(disk->axis_x), 0.5, 1e-6);
    assert_near(disk->color.r, 1, 1e-6);
    assert_near(disk->color.g, 0.2158605, 1e-5);
    assert_near(disk->intensity, 200, 0);
    assert_near(scene->lights[1].color.g, 2, 0);
    assert_near(scene->lights[1].intensity, 1, 0);
    lx_scene_destroy(scene);
}

static void sheared_disk_keeps_its_area_and_perpendicular_axes(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(
        ",'nodes':[{'mesh':0},{'matrix':[2,0,0,0, 1,1,0,0, 0,0,1,0, 0,0,0,1],'extras':{'luxel_area':'disk 1'}}]");
    const lx_light *light = &scene->lights[0];
    assert_near(lx_dot(light->axis_x, light->axis_y), 0, 1e-5);
    assert_near(lx_length(lx_cross(light->axis_x, light->axis_y)), 2, 1e-5);
    lx_scene_destroy(scene);
}

static void mirrored_area_light_still_faces_minus_z(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(",'nodes':[{'mesh':0},{'scale':[-1,1,1],'extras':{'luxel_area':'rect 1 1'}}]");
    assert_vec3(scene->lights[0].direction, 0, 0, -1);
    lx_scene_destroy(scene);
}

static void area_on_a_parent_shapes_the_lamp_below(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(
        LIGHTS("{'type':'point','intensity':8}") ",'nodes':[{'mesh':0},{'name':'Area','extras':{'luxel_area':'rect 2 "
                                                 "2'},'children':[2]},{'name':'Area_Orientation'," LAMP(0) "}]");
    assert_int_equal(scene->light_count, 1);
    assert_int_equal(scene->lights[0].kind, LX_LIGHT_RECT);
    assert_near(scene->lights[0].intensity, 2, 1e-6);
    lx_scene_destroy(scene);
}

static void area_that_makes_no_sense_is_ignored_with_a_warning(void **state)
{
    (void)state;
    lx_scene *scene =
        import_triangle(LIGHTS("{'type':'directional'},{'type':'point','intensity':7}") ",'nodes':[{'mesh':0},{" LAMP(
            0) ",'extras':{'luxel_area':'rect 1 1'}},{'name':'flat'," LAMP(1) ",'scale':[0,1,1],'extras':{'luxel_area':"
                                                                              "'rect 1 1'}},"
                                                                              "{" LAMP(
                                                                                  1) ",'extras':{'luxel_area':'rect "
                                                                                     "1'}},{'name':'nothing','scale':["
                                                                                     "0,1,1],'extras':{'luxel_area':'"
                                                                                     "disk 1'}}]");
    assert_int_equal(scene->light_count, 3);
    assert_int_equal(scene->lights[0].kind, LX_LIGHT_DIRECTIONAL);
    assert_int_equal(scene->lights[1].kind, LX_LIGHT_POINT);
    assert_near(scene->lights[1].intensity, 7, 0);
    assert_int_equal(scene->lights[2].kind, LX_LIGHT_POINT);
    assert_logged("warning: node 1: luxel_area makes no sense for a directional light");
    assert_logged("warning: node 2 'flat': luxel_area has no area in the world");
    assert_logged("warning: node 3: luxel_area is not 'rect WIDTH HEIGHT' or 'disk RADIUS'");
    assert_logged("warning: node 4 'nothing': luxel_area has no area in the world");
    lx_scene_destroy(scene);
}

// --- Sources and names ---

// Three triangles: materials 0, 1 and none; 0 and 1 emit.
#define EMITTERS                                                                                                       \
    TRIANGLE_DATA                                                                                                      \
    ",'materials':[{'name':'neon','emissiveFactor':[1,0,0]},{'emissiveFactor':[0,0.5,0],"                              \
    "'extensions':{'KHR_materials_emissive_strength':{'emissiveStrength':12}}},{'name':'dark','emissiveFactor':["      \
    "0,0,0]},"                                                                                                         \
    "{'name':'off','emissiveFactor':[1,1,1],'extensions':{'KHR_materials_emissive_strength':{'emissiveStrength':"      \
    "0}}}],"                                                                                                           \
    "'meshes':[{'name':'sign','primitives':[{'attributes':{'POSITION':0},'material':0},{'attributes':{'POSITION':"     \
    "0},'material':1},"                                                                                                \
    "{'attributes':{'POSITION':0}},{'attributes':{'POSITION':0},'material':0}]},"                                      \
    "{'primitives':[{'attributes':{'POSITION':0},'material':0}]},"                                                     \
    "{'primitives':[{'attributes':{'POSITION':0},'material':2},{'attributes':{'POSITION':0},'material':3}]}]"

static void emitters_are_named_by_node_and_material(void **state)
{
    (void)state;
    triangle_bin();
    lx_scene *scene = import_members(
        EMITTERS ",'nodes':[{'name':'board','mesh':0},{'name':'tube','mesh':1},{'mesh':1},{'name':'dead','mesh':2}]");
    assert_int_equal(scene->source_count, 4);
    assert_string_equal(scene->sources[0].name, "board/neon");
    assert_string_equal(scene->sources[1].name, "board/material_1");
    assert_string_equal(scene->sources[2].name, "tube");
    assert_string_equal(scene->sources[3].name, "light_3");
    assert_int_equal(scene->sources[1].kind, LX_SOURCE_EMISSIVE);
    assert_int_equal(scene->sources[1].material, 1);
    assert_int_equal(scene->sources[1].light, -1);
    assert_near(scene->sources[1].color.g, 0.5, 0);
    assert_near(scene->sources[1].intensity, 12, 0);
    // surfaces of the first node
    assert_int_equal(scene->surfaces[0].source, 0);
    assert_int_equal(scene->surfaces[1].source, 1);
    assert_int_equal(scene->surfaces[2].source, -1);
    assert_int_equal(scene->surfaces[3].source, 0);
    lx_scene_destroy(scene);
}

static void repeated_names_get_numbers(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(LIGHTS("{'type':'point'}") ",'nodes':[{'mesh':0},{'name':'lamp'," LAMP(
        0) "},{'name':'lamp#2'," LAMP(0) "},{'name':'lamp'," LAMP(0) "},{'name':'lamp'," LAMP(0) "},{" LAMP(0) "}]");
    static const char *const expected[] = {"lamp", "lamp#2", "lamp#3", "lamp#4", "light_4"};
    assert_int_equal(scene->source_count, 5);
    for (int i = 0; i < 5; ++i) assert_string_equal(scene->sources[i].name, expected[i]);
    assert_string_equal(scene->lights[2].name, "lamp");
    assert_logged("warning: node 3: shares its name with another light and is called 'lamp#3' (2 such lights in all)");
    lx_scene_destroy(scene);
}

static void many_names_stay_unique(void **state)
{
    (void)state;
    enum { count = 300 };
    char *nodes = malloc(128 * count);
    size_t length = (size_t)sprintf(nodes, LIGHTS("{'type':'point'}") ",'nodes':[{'mesh':0}");
    for (int i = 0; i < count; ++i)
        length += (size_t)sprintf(nodes + length, ",{'name':'lamp%d'," LAMP(0) "}", i % 100);
    strcpy(nodes + length, "]");
    lx_scene *scene = import_triangle(nodes);
    free(nodes);
    assert_int_equal(scene->source_count, count);
    assert_string_equal(scene->sources[299].name, "lamp99#3");
    for (uint32_t i = 0; i < scene->source_count; ++i)
        assert_ptr_equal(source_named(scene, scene->sources[i].name), &scene->sources[i]);
    lx_scene_destroy(scene);
}

static void gpu_instances_of_an_emitter_are_one_source(void **state)
{
    (void)state;
    triangle_bin();
    lx_scene *scene =
        import_members(EMITTERS ",'extensionsUsed':['EXT_mesh_gpu_instancing'],'nodes':[{'name':'tubes','mesh':1,"
                                "'extensions':{'EXT_mesh_gpu_instancing':{'attributes':{'TRANSLATION':0}}}}]");
    assert_int_equal(scene->instance_count, 3);
    assert_int_equal(scene->source_count, 1);
    for (int i = 0; i < 3; ++i) assert_int_equal(scene->surfaces[i].source, 0);
    lx_scene_destroy(scene);
}

// --- Authoring keys ---

static void keys_are_inherited_and_the_nearest_wins(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(LIGHTS(
        "{'type':'point','extras':{'luxel_layer':'light','luxel_mode':'mixed'}}") ",'nodes':[{'name':'hall','extras':{'"
                                                                                  "luxel_layer':'hall','luxel_density':"
                                                                                  "2},'children':[1,2,3]},"
                                                                                  "{'name':'a'," LAMP(
                                                                                      0) "},{'name':'b'"
                                                                                         "," LAMP(
                                                                                             0) ",'"
                                                                                                "extras"
                                                                                                "':{'"
                                                                                                "luxel_"
                                                                                                "layer'"
                                                                                                ":'b','"
                                                                                                "luxel_"
                                                                                                "mode':"
                                                                                                "'baked"
                                                                                                "'}},"
                                                                                                "{'"
                                                                                                "childr"
                                                                                                "en':["
                                                                                                "4]},{'"
                                                                                                "name':"
                                                                                                "'m','"
                                                                                                "mesh':"
                                                                                                "0,'"
                                                                                                "extras"
                                                                                                "':{'"
                                                                                                "luxel_"
                                                                                                "scale_"
                                                                                                "in_"
                                                                                                "lightm"
                                                                                                "ap':0."
                                                                                                "5}},{'"
                                                                                                "name':"
                                                                                                "'c'"
                                                                                                "," LAMP(
                                                                                                    0) "},{'mesh':0}]");
    assert_string_equal(source_named(scene, "a")->layer, "hall"); // node goes before light
    assert_int_equal(source_named(scene, "a")->mode, LX_MODE_MIXED);
    assert_int_equal(source_named(scene, "a")->parent_node, 0);
    assert_string_equal(source_named(scene, "b")->layer, "b");
    assert_int_equal(source_named(scene, "b")->mode, LX_MODE_BAKED);
    assert_string_equal(source_named(scene, "c")->layer, "light");
    assert_int_equal(source_named(scene, "c")->parent_node, -1);
    assert_near(scene->instances[0].density, 0.5, 0);
    assert_near(scene->instances[1].density, 1, 0);
    lx_scene_destroy(scene);
}

static void material_keys_apply_where_nodes_say_nothing(void **state)
{
    (void)state;
    triangle_bin();
    lx_scene *scene =
        import_members(TRIANGLE_MATERIAL ",'materials':[{'emissiveFactor':[1,1,1],'extras':{'luxel_layer':'neons','"
                                         "luxel_transparent':1,'luxel_density':3,'luxel_mode':'mixed'}}],"
                                         "'nodes':[{'name':'a','mesh':0},{'name':'b','mesh':0,'extras':{'luxel_layer':'"
                                         "mine','luxel_transparent':'false','luxel_mode':'realtime'}}]");
    assert_int_equal(scene->source_count, 1);
    assert_string_equal(scene->sources[0].layer, "neons");
    assert_int_equal(scene->sources[0].mode, LX_MODE_MIXED);
    assert_true(scene->surfaces[0].transparent);
    assert_false(scene->surfaces[1].transparent);
    assert_int_equal(scene->surfaces[1].source, -1);
    assert_near(scene->materials[0].density, 3, 0);
    assert_near(scene->instances[0].density, 1, 0);
    lx_scene_destroy(scene);
}

static void booleans_come_as_numbers_and_texts(void **state)
{
    (void)state;
    lx_scene *scene =
        import_triangle(",'nodes':[{'mesh':0,'extras':{'luxel_static':0}},{'mesh':0,'extras':{'luxel_static':'false'}},"
                        "{'mesh':0,'extras':{'luxel_static':false}},{'mesh':0,'extras':{'luxel_static':1.0}},{'mesh':0,"
                        "'extras':{'luxel_static':'true'}},"
                        "{'mesh':0,'extras':{'luxel_static':'perhaps'}}]");
    for (uint32_t i = 0; i < 6; ++i) assert_int_equal(scene->instances[i].is_static, i >= 3);
    assert_logged("warning: node 5: luxel_static is not true or false; ignored");
    assert_int_equal(scene->triangle_count, 3);
    lx_scene_destroy(scene);
}

static void lamps_of_what_is_not_static_are_realtime(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(LIGHTS(
        "{'type':'point'}") ",'nodes':[{'mesh':0},{'extras':{'luxel_static':false},'children':[2,3]},{'name':'torch'"
                            "," LAMP(0) "},"
                                        "{'name':'fixed'," LAMP(0) ",'extras':{'luxel_mode':'baked'}},{" LAMP(
                                            0) ",'extras':{'luxel_mode':'realtime'}}]");
    assert_int_equal(scene->light_count, 3);
    assert_int_equal(scene->source_count, 1);
    assert_string_equal(scene->sources[0].name, "fixed");
    lx_scene_destroy(scene);
}

static void unknown_key_is_told_with_the_nearest_one(void **state)
{
    (void)state;
    lx_scene_destroy(import_triangle(",'nodes':[{'name':'wall','mesh':0,'extras':{'luxel_densty':2,'other':1,'luxel_"
                                     "monitor':'4x3','luxel_probes':'points'}}]"));
    assert_logged("warning: node 0 'wall': unknown key luxel_densty; did you mean luxel_density?");
    assert_not_logged("other");
    assert_not_logged("unknown key luxel_monitor");
    assert_not_logged("probes");
}

static void key_in_the_wrong_place_gets_a_warning(void **state)
{
    (void)state;
    triangle_bin();
    lx_scene_destroy(import_members(TRIANGLE_DATA ",'meshes':[{'name':'m','primitives':[{'attributes':{'POSITION':0},'"
                                                  "material':0}],'extras':{'luxel_layer':'x'}}],"
                                                  "'materials':[{'extras':{'luxel_static':false}}]" ONE_NODE));
    assert_logged("warning: mesh 0 'm': luxel_layer has no effect here; it belongs to a node or material");
    assert_logged("warning: material 0: luxel_static has no effect here; it belongs to a node");
}

static void values_of_the_wrong_kind_are_ignored_with_a_warning(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(
        LIGHTS("{'type':'point'}") ",'nodes':[{'mesh':0,'extras':{'luxel_density':-1}},"
                                   "{" LAMP(0) ",'extras':{'luxel_radius':'wide','luxel_mode':'live','luxel_layer':7,'"
                                               "luxel_color':'#12345','luxel_intensity':[1]}}]");
    assert_near(scene->instances[0].density, 1, 0);
    assert_null(scene->sources[0].layer);
    static const char *const expected[] = {"node 0: luxel_density is not a number above 0",
                                           "luxel_radius is not a number of at least 0",
                                           "luxel_mode is not 'baked', 'mixed' or 'realtime'",
                                           "luxel_layer is not a name",
                                           "luxel_color is not '#rrggbb'",
                                           "luxel_intensity is not a number"};
    for (int i = 0; i < 6; ++i) assert_logged(expected[i]);
    lx_scene_destroy(scene);
}

// --- Advice ---

static lx_scene *import_lamp_and_emitter(const char *strength, lx_light_units units)
{
    char members[2048];
    triangle_bin();
    snprintf(members, sizeof members,
             TRIANGLE_MATERIAL LIGHTS(
                 "{'type':'point','intensity':100}") ",'materials':[{'emissiveFactor':[1,1,1],'extensions':"
                                                     "{'KHR_materials_emissive_strength':{'emissiveStrength':%s}}}],'"
                                                     "nodes':[{'mesh':0},{" LAMP(0) "}]",
             strength);
    char *text = make_gltf(members);
    lx_scene_load_desc desc = lx_scene_load_desc_default();
    desc.light_units = units;
    lx_scene *scene = NULL;
    fixture_log[0] = '\0';
    assert_int_equal(lx_gltf_import(fixture_context, "t.gltf", NULL, text, strlen(text), &desc, &scene, NULL), LX_OK);
    free(text);
    return scene;
}

static void faint_emitters_beside_lamps_get_a_warning(void **state)
{
    (void)state;
    // The triangle's area is 0.5: its power is 0.5 pi L beside 400 pi.
    lx_scene_destroy(import_lamp_and_emitter("7", LX_LIGHT_UNITS_GLTF));
    assert_logged("warning: scene: emissive materials give 0.88 % as much light as the lamps; Blender's exporter");
    lx_scene_destroy(import_lamp_and_emitter("9", LX_LIGHT_UNITS_GLTF));
    assert_not_logged("emissive materials give");
}

static void blender_units_scale_emission_only(void **state)
{
    (void)state;
    lx_scene *scene = import_lamp_and_emitter("7", LX_LIGHT_UNITS_BLENDER);
    assert_near(scene->materials[0].emissive_strength, 7 * 683, 1e-2);
    assert_near(scene->lights[0].intensity, 100, 0);
    assert_not_logged("emissive materials give");
    lx_scene_destroy(scene);
}

static void import_from_blender(const char *more)
{
    char text[4096];
    triangle_bin();
    char *plain = make_gltf(TRIANGLE);
    plain[strlen(plain) - 1] = '\0';
    snprintf(text, sizeof text, "%s%s}", plain, more);
    free(plain);
    for (char *c = text; *c; ++c)
        if (*c == '\'') *c = '"';
    char *asset = strstr(text, "\"2.0\"");
    assert_non_null(asset);
    char whole[8192];
    snprintf(whole, sizeof whole, "%.*s\"2.0\",\"generator\":\"Khronos glTF Blender I/O v4.3.47\"%s",
             (int)(asset - text), text, asset + 5);
    lx_scene *scene;
    lx_error error;
    if (import_text(whole, strlen(whole), &scene, &error) != LX_OK) fail_msg("%s", error.message);
    assert_true(scene->from_blender);
    lx_scene_destroy(scene);
}

static void blender_users_are_told_about_export_boxes(void **state)
{
    (void)state;
    import_from_blender(ONE_NODE);
    assert_logged("Punctual Lights");
    assert_logged("Custom Properties");
    import_from_blender(LIGHTS("{'type':'point'}") ",'nodes':[{'mesh':0,'extras':{'luxel_density':2}},{" LAMP(0) "}]");
    assert_not_logged("Punctual Lights");
    assert_not_logged("Custom Properties");
    import_from_blender(",'nodes':[{'mesh':0,'extras':{'mine':2}}]"); // the box was ticked
    assert_logged("Punctual Lights");
    assert_not_logged("Custom Properties");
}

static void strange_sizes_get_a_warning(void **state)
{
    (void)state;
    lx_scene_destroy(import_triangle(",'nodes':[{'mesh':0,'scale':[1e-6,1e-6,1e-6]}]"));
    assert_logged("warning: scene: only 1.41e-06 m wide");
    lx_scene_destroy(import_triangle(",'nodes':[{'mesh':0,'scale':[1e6,1e6,1e6]}]"));
    assert_logged("warning: scene: 1.41e+06 m wide");
    lx_scene_destroy(import_triangle(",'nodes':[{'mesh':0,'extras':{'luxel_static':false}}]"));
    assert_logged("warning: scene: nothing in it is static");
}

static void ignored_extensions_are_noted_once(void **state)
{
    (void)state;
    lx_scene_destroy(import_triangle(",'extensionsUsed':['KHR_materials_ior','KHR_texture_transform','ACME_secret'],'"
                                     "extensionsRequired':['KHR_materials_ior']" ONE_NODE));
    assert_logged("note: extensions that are ignored: KHR_materials_ior, ACME_secret\n");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lights_are_placed_by_their_nodes),
        cmocka_unit_test(light_with_defaults_is_white_and_one),
        cmocka_unit_test(negative_intensity_is_zero_with_a_warning),
        cmocka_unit_test(wrong_lights_are_refused),
        cmocka_unit_test(right_angle_with_rounding_is_accepted),
        cmocka_unit_test(lights_in_vpl_and_blocker_groups_are_no_lamps),
        cmocka_unit_test(radius_is_metres_or_degrees),
        cmocka_unit_test(rect_light_takes_radiance_from_on_axis_intensity),
        cmocka_unit_test(area_light_without_lamp_has_its_own_colour),
        cmocka_unit_test(sheared_disk_keeps_its_area_and_perpendicular_axes),
        cmocka_unit_test(mirrored_area_light_still_faces_minus_z),
        cmocka_unit_test(area_on_a_parent_shapes_the_lamp_below),
        cmocka_unit_test(area_that_makes_no_sense_is_ignored_with_a_warning),
        cmocka_unit_test(emitters_are_named_by_node_and_material),
        cmocka_unit_test(repeated_names_get_numbers),
        cmocka_unit_test(many_names_stay_unique),
        cmocka_unit_test(gpu_instances_of_an_emitter_are_one_source),
        cmocka_unit_test(keys_are_inherited_and_the_nearest_wins),
        cmocka_unit_test(material_keys_apply_where_nodes_say_nothing),
        cmocka_unit_test(booleans_come_as_numbers_and_texts),
        cmocka_unit_test(lamps_of_what_is_not_static_are_realtime),
        cmocka_unit_test(unknown_key_is_told_with_the_nearest_one),
        cmocka_unit_test(key_in_the_wrong_place_gets_a_warning),
        cmocka_unit_test(values_of_the_wrong_kind_are_ignored_with_a_warning),
        cmocka_unit_test(faint_emitters_beside_lamps_get_a_warning),
        cmocka_unit_test(blender_units_scale_emission_only),
        cmocka_unit_test(blender_users_are_told_about_export_boxes),
        cmocka_unit_test(strange_sizes_get_a_warning),
        cmocka_unit_test(ignored_extensions_are_noted_once),
    };
    return cmocka_run_group_tests_name("scene lights", tests, fixture_setup, fixture_teardown);
}
