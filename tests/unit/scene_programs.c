// luxel_animate: what can be typed, what it means, and what is told when it cannot be read.
#include "scene/program.h"
#include "unit/scene_fixture.h"

static lx_program parse(const char *text)
{
    static lx_arena arena; // what one test keeps is small
    lx_program program;
    lx_error error = {0};
    if (lx_program_parse(text, &arena, &program, &error) != LX_OK) fail_msg("'%s' refused: %s", text, error.message);
    return program;
}

static void program_alone_has_defaults(void **state)
{
    (void)state;
    const lx_program p = parse("blink");
    assert_int_equal(p.kind, LX_PROGRAM_BLINK);
    assert_near(p.period_s, 1, 0);
    assert_near(p.phase_s, 0, 0);
    assert_near(p.duty, 0.5, 0);
    assert_near(p.low, 0, 0);
    assert_near(p.high, 1, 0);
    assert_false(p.has_color);
    assert_false(p.has_seed);
    assert_true(p.intensity < 0);
}

static void parameters_may_come_in_any_order_and_space(void **state)
{
    (void)state;
    const lx_program p = parse("  blink  low=0.25\tduty=0.1 2.5 phase=0.5s high=2 color=#ff0000 intensity=7 ");
    assert_near(p.period_s, 2.5, 0);
    assert_near(p.phase_s, 0.5, 0);
    assert_near(p.duty, 0.1, 1e-7);
    assert_near(p.low, 0.25, 0);
    assert_near(p.high, 2, 0);
    assert_true(p.has_color);
    assert_near(p.color.r, 1, 0);
    assert_near(p.color.g, 0, 0);
    assert_near(p.intensity, 7, 0);
}

static void times_have_units(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        double seconds;
    } cases[] = {{"pulse 90", 90},     {"pulse 90s", 90},    {"pulse 250ms", 0.25},
                 {"pulse 1.5min", 90}, {"pulse 24h", 86400}, {"pulse period=1:30", 5400}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i)
        assert_near(parse(cases[i].text).period_s, cases[i].seconds, 1e-6);
}

static void seed_of_a_flicker_is_kept(void **state)
{
    (void)state;
    const lx_program p = parse("flicker 0.2 seed=12");
    assert_true(p.has_seed);
    assert_int_equal(p.seed, 12);
}

static void schedule_has_times_with_colours(void **state)
{
    (void)state;
    const lx_program p = parse("schedule 24h fade=30min 0=off 7h=#ffffff*0.5 19:30=1,0.5,0");
    assert_int_equal(p.kind, LX_PROGRAM_SCHEDULE);
    assert_near(p.period_s, 86400, 0);
    assert_near(p.fade_s, 1800, 0);
    assert_int_equal(p.key_count, 3);
    assert_near(p.keys[0].color.r, 0, 0);
    assert_near(p.keys[1].time_s, 25200, 0);
    assert_near(p.keys[1].color.b, 1, 0);
    assert_near(p.keys[1].intensity, 0.5, 0);
    assert_near(p.keys[2].time_s, 70200, 0);
    assert_near(p.keys[2].color.g, 0.5, 0);
    assert_true(p.keys[2].intensity < 0);
}

static void wrong_programs_are_told(void **state)
{
    (void)state;
    static const struct {
        const char *text, *message;
    } cases[] = {
        {"", "no program (blink, flicker, pulse, wheel, schedule, constant)"},
        {"strobe 2", "'strobe' is no program (blink, flicker, pulse, wheel, schedule, constant)"},
        {"keys 2", "'keys' is no program (blink, flicker, pulse, wheel, schedule, constant)"},
        {"blink 0", "a period must be above 0"},
        {"blink -2", "'-2' is not NAME=VALUE"},
        {"blink 2x", "'2x' is no period"},
        {"blink 1e30", "'1e30' is no period"},
        {"blink period=nan", "'nan' is no period"},
        {"constant 3", "'3' is no period"},
        {"blink duty=1.5", "'1.5' is no duty"},
        {"pulse duty=0.5", "pulse has no duty"},
        {"wheel low=0.5", "wheel has no low"},
        {"blink speed=3",
         "'speed' is unknown (there are period, phase, duty, low, high, seed, fade, color, intensity)"},
        {"blink color=red", "'red' is no color"},
        {"blink color=#12345", "'#12345' is no color"},
        {"blink color=#1234567", "'#1234567' is no color"},
        {"blink color=1,2", "'1,2' is no color"},
        {"blink 2 low", "'low' is not NAME=VALUE"},
        {"flicker seed=-1", "'-1' is no seed"},
        {"schedule 10", "a schedule needs TIME=COLOUR*INTENSITY"},
        {"schedule 10 5=off 3=off", "times must ascend, but 3 s follows 5 s"},
        {"schedule 10 11=off", "11 s lies behind the period of 10 s"},
        {"schedule 10 5=off*", "'5=off*' is not TIME=COLOUR*INTENSITY (#rrggbb, r,g,b or off)"},
        {"schedule 10 5h30=off", "'5h30=off' is not TIME=COLOUR*INTENSITY (#rrggbb, r,g,b or off)"},
        {"schedule 24h 7:60=off", "'7:60=off' is not TIME=COLOUR*INTENSITY (#rrggbb, r,g,b or off)"},
    };
    lx_arena arena = {0};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        lx_program program;
        lx_error error = {0};
        assert_int_equal(lx_program_parse(cases[i].text, &arena, &program, &error), LX_ERROR_FORMAT);
        assert_string_equal(error.message, cases[i].message);
    }
    lx_arena_release(&arena);
}

static void every_beginning_of_a_program_is_read_or_refused(void **state)
{
    (void)state;
    static const char whole[] = "schedule 24h fade=30min phase=3 0=off 7h=#ffd9a0*0.5 19:30=1,1,1*2";
    lx_arena arena = {0};
    for (size_t length = 0; length <= strlen(whole); ++length) {
        lx_program program;
        char *text = lx_strndup(whole, length);
        lx_program_parse(text, &arena, &program, NULL);
        lx_free(text);
    }
    lx_arena_release(&arena);
}

static void program_is_taken_from_node_before_material(void **state)
{
    (void)state;
    triangle_bin();
    lx_scene *scene = import_members(
        TRIANGLE_MATERIAL ",'materials':[{'emissiveFactor':[1,1,1],'extras':{'luxel_animate':'blink 2'}}],'nodes':["
                          "{'name':'own','mesh':0,'extras':{'luxel_animate':'pulse 3'}},{'name':'other','mesh':0}]");
    assert_int_equal(source_named(scene, "own")->animate->kind, LX_PROGRAM_PULSE);
    assert_int_equal(source_named(scene, "other")->animate->kind, LX_PROGRAM_BLINK);
    assert_not_logged("warning");
    lx_scene_destroy(scene);
}

static void program_that_cannot_be_read_is_ignored_with_a_warning(void **state)
{
    (void)state;
    lx_scene *scene = import_triangle(",'nodes':[{'name':'n','mesh':0,'extras':{'luxel_animate':'strobe'}},{'name':'m',"
                                      "'mesh':0,'extras':{'luxel_animate':3}}]");
    assert_logged("warning: node 0 'n': luxel_animate: 'strobe' is no program (blink, flicker, pulse, wheel, schedule, "
                  "constant); ignored");
    assert_logged("warning: node 1 'm': luxel_animate is not a program");
    lx_scene_destroy(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(program_alone_has_defaults),
        cmocka_unit_test(parameters_may_come_in_any_order_and_space),
        cmocka_unit_test(times_have_units),
        cmocka_unit_test(seed_of_a_flicker_is_kept),
        cmocka_unit_test(schedule_has_times_with_colours),
        cmocka_unit_test(wrong_programs_are_told),
        cmocka_unit_test(every_beginning_of_a_program_is_read_or_refused),
        cmocka_unit_test(program_is_taken_from_node_before_material),
        cmocka_unit_test(program_that_cannot_be_read_is_ignored_with_a_warning),
    };
    return cmocka_run_group_tests_name("scene programs", tests, fixture_setup, fixture_teardown);
}
