//! Every mistake has its line, every value survives the way through a file.

use super::*;
use hilare_controller::LAWS;

/// The error that `robot.toml` with this text gives.
fn error(text: &str) -> String {
    System::parse("robot.toml", text).map(|_| text.to_owned()).expect_err("refused").to_string()
}

fn set_error(assignment: &str) -> String {
    System::default().set(assignment).expect_err(assignment).to_string()
}

#[test]
fn unknown_keys_name_the_one_that_was_meant() {
    let wheels = format!("{}[chassis]\nwheel_raduis_m = 0.02\n", "\n".repeat(12));
    let cases = [
        (&*wheels, r#"14: unknown key "wheel_raduis_m" in [chassis]; did you mean "wheel_diameter_m" (m)?"#),
        ("[plant]\nslip_men = 0.1", r#"2: unknown key "slip_men" in [plant]; did you mean "slip_mean"?"#),
        (
            "[chassis]\ntrack_mm = 54",
            r#"2: unknown key "track_mm" in [chassis]; the key is track_m, in metres"#,
        ),
        ("[chassis]\ntrack = 54", r#"2: unknown key "track" in [chassis]; the key is track_m, in metres"#),
        (
            "[timing]\nperiod_ms = 5",
            r#"2: unknown key "period_ms" in [timing]; the key is period_ticks, in ticks of 1 ms"#,
        ),
        (
            "[controller.kanayama]\nk2_per_mm2 = 2.9",
            r#"2: unknown key "k2_per_mm2" in [controller.kanayama]; the key is k2_per_m2, in 1/m^2"#,
        ),
        (
            "[plant]\nstart_sd_deg = 1",
            r#"2: unknown key "start_sd_deg" in [plant]; the key is start_sd_rad, in radians"#,
        ),
        (
            "[plant]\nstart_sd_mm = 1",
            r#"2: unknown key "start_sd_mm" in [plant]; the key is start_sd_m, in metres"#,
        ),
        ("track_m = 0.05", r#"1: unknown key "track_m"; did you mean "chassis.track_m" (m)?"#),
        (
            "[plant]\nv_max_mps = 1",
            r#"2: unknown key "v_max_mps" in [plant]; did you mean "limits.v_max_mps" (m/s)?"#,
        ),
        (
            "[chassis]\nhalf_track_m = 1",
            r#"2: unknown key "half_track_m" in [chassis]; "chassis.half_track_m" belongs to chassis.kind = "mecanum""#,
        ),
        (
            "[motors]\ncolour = 1",
            "2: unknown key \"colour\" in [motors]; known there: kind, step_length_m, microsteps, pulse_length_s, \
             pulse_space_s, direction_setup_s, direction_hold_s, tick_jitter_s, pulse_rate_max_hz, invert_right, \
             invert_left",
        ),
        (
            "[motors]\nkind = \"servo\"\n\"a\\nb\" = 1",
            r#"3: unknown key "a\nb" in [motors]; known there: kind, counts_per_turn"#,
        ),
        (
            "[motors]\nkind = \"servo\"\nmicrosteps = 16",
            r#"3: unknown key "microsteps" in [motors]; "motors.microsteps" belongs to motors.kind = "stepper""#,
        ),
        (
            "[motors]\npulse_length_us = 2",
            r#"2: unknown key "pulse_length_us" in [motors]; the key is pulse_length_s, in seconds"#,
        ),
        (
            "colour = 1",
            "1: unknown key \"colour\"; known there: robot; and the sections chassis, motors, limits, timing, \
             tracking, controller, estimator, planner, plant, camera, start, supervision, operator, wake_up, realtime",
        ),
        (
            "[realtime]\ncpu = 1",
            "2: unknown key \"cpu\" in [realtime]; only sections stand there: planner, waypoint_selector, \
             controller, step_generator, pose_estimator, plant, relay, recorder, operator",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(error(text), format!("robot.toml:{expected}"));
    }
}

#[test]
fn unknown_sections_name_the_one_that_was_meant() {
    let cases = [
        ("\n[chasis]\ntrack_m = 1", "2: unknown section [chasis]; did you mean [chassis]?"),
        (
            "[realtime.controler]",
            "1: unknown section [realtime.controler]; did you mean [realtime.controller]?",
        ),
        (
            "[colour]",
            "1: unknown section [colour]; known: chassis, motors, limits, timing, tracking, controller, estimator, \
             planner, plant, camera, start, supervision, operator, wake_up, realtime",
        ),
        (
            "[limits.v_max_mps]\nx = 1",
            "1: limits.v_max_mps is a key, not a section; write v_max_mps = VALUE in [limits]",
        ),
        ("limits = 3", "1: limits is a section; write [limits] once and its keys below"),
        ("[[limits]]\nv_max_mps = 1", "1: limits is a section; write [limits] once and its keys below"),
        (
            "\"controller.kanayama\" = { k1_per_s = 1 }",
            "1: unknown section \"controller.kanayama\" in quotes; dots separate only outside of quotes",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(error(text), format!("robot.toml:{expected}"));
    }
}

#[test]
fn wrong_values_say_what_is_wanted() {
    let millimetres = "\n\n\n\n\n[chassis]\ntrack_m = 54";
    let cases = [
        (
            millimetres,
            "7: chassis.track_m: 54 m is outside 0.005 to 5 m; did you mean 0.054 (SI, not millimetres)?",
        ),
        (
            "[limits]\nv_max_mps = '1'",
            "2: limits.v_max_mps: \"1\" is text; write a number without quotes, 0 to 10 m/s",
        ),
        ("[limits]\nv_max_mps = true", "2: limits.v_max_mps: true is not a number (0 to 10 m/s)"),
        ("[limits]\nv_max_mps = [1]", "2: limits.v_max_mps: an array is not a number (0 to 10 m/s)"),
        ("[limits]\nv_max_mps = 1979-05-27", "2: limits.v_max_mps: a date is not a number (0 to 10 m/s)"),
        ("[limits]\nv_max_mps = nan", "2: limits.v_max_mps: must be a finite number, 0 to 10 m/s"),
        ("[limits]\nv_max_mps = -inf", "2: limits.v_max_mps: must be a finite number, 0 to 10 m/s"),
        ("[limits]\nv_max_mps = 1e999", "2: limits.v_max_mps: must be a finite number, 0 to 10 m/s"),
        ("[motors]\npulse_length_s = 1.9", "2: motors.pulse_length_s: 1.9 s is outside 0 to 0.1 s"),
        (
            "[motors]\npulse_rate_max_hz = 2000",
            "2: motors.pulse_rate_max_hz: 2000 Hz is outside 1 to 1000 Hz",
        ),
        ("[motors]\nmicrosteps = 0", "2: motors.microsteps: 0 is outside 1 to 256"),
        ("[motors]\ninvert_left = 1", "2: motors.invert_left: the number 1 is not true or false"),
        ("[limits]\nv_max_mps = -1", "2: limits.v_max_mps: -1 m/s is outside 0 to 10 m/s"),
        ("[timing]\nperiod_ticks = 1.5", "2: timing.period_ticks: must be a whole number, 1 to 1000 ticks"),
        (
            "[plant]\nseed = 9007199254740992",
            "2: plant.seed: 9007199254740992 is outside 0 to 9007199254740991",
        ),
        ("[realtime.plant]\ncpu = -4", "2: realtime.plant.cpu: -4 is outside -3 to 1023"),
        ("[supervision]\narm_on_start = 1", "2: supervision.arm_on_start: the number 1 is not true or false"),
        (
            "[start]\ntheta_rad = 90",
            "2: start.theta_rad: 90 rad is outside -6.3 to 6.3 rad; did you mean 1.5708 (radians, not degrees)?",
        ),
        ("robot = 3", "1: robot: the number 3 is not text; write it in quotes"),
        (
            "robot = \"Big Bot\"",
            "1: robot: \"Big Bot\" is no robot name; use 1 to 32 of a-z, 0-9, - and _, the first a letter or digit",
        ),
        (
            "[chassis]\nkind = \"diferential\"",
            "2: chassis.kind: unknown kind \"diferential\"; did you mean \"differential\"? known: differential, mecanum",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(error(text), format!("robot.toml:{expected}"));
    }
    assert!(error("[controller]\nlaw = \"kanayma\"").starts_with(
        "robot.toml:2: controller.law: unknown law \"kanayma\"; did you mean \"kanayama\"? known: kanayama"
    ));
}

#[test]
fn what_is_no_toml_is_said_with_its_line() {
    let cases = [
        (
            "[limits]\nv_max_mps = 1\nv_max_mps = 2",
            "3: \"v_max_mps\" stands here a second time; delete one of them",
        ),
        ("[limits]\n\n[limits]", "3: \"limits\" stands here a second time; delete one of them"),
        ("\n[limits\n", "2: not TOML: unclosed table, expected `]`"),
        ("robot = \"abc", "1: not TOML: invalid basic string, expected `\"`"),
    ];
    for (text, expected) in cases {
        assert_eq!(error(text), format!("robot.toml:{expected}"));
    }
}

#[test]
fn values_that_contradict_each_other_are_refused_with_the_reason() {
    let cases = [
        (
            "[limits]\nv_min_mps = 0.05",
            "2: limits.v_min_mps 0.05 is above limits.v_max_mps 0.041, so no speed is allowed; lower v_min_mps or \
             raise v_max_mps",
        ),
        (
            "[limits]\nv_max_mps = 0.04\nv_min_mps = 0.05\nomega_max_radps = 1",
            "3: limits.v_min_mps 0.05 is above limits.v_max_mps 0.04, so no speed is allowed; lower v_min_mps or \
             raise v_max_mps",
        ),
        (
            "[limits]\nomega_min_radps = 1",
            "2: limits.omega_min_radps 1 is above limits.omega_max_radps 0.747, so no turn is allowed; lower \
             omega_min_radps or raise omega_max_radps",
        ),
        (
            "[chassis]\nwheel_speed_max_left_radps = 10",
            "2: a wheel at 10 rad/s needs more than one step of 6.500e-3 rad a tick (1 ms); lower \
             chassis.wheel_speed_max_left_radps to 6.5 rad/s or raise motors.step_length_m",
        ),
        (
            "[planner.fit]\nradius_min_m = 900\nradius_max_m = 1",
            "3: planner.fit.radius_min_m 900 is above planner.fit.radius_max_m 1, so no arc is allowed; lower \
             radius_min_m or raise radius_max_m",
        ),
        (
            "[estimator]\nkind = \"ekf\"\n[camera]\ndelay_ticks = 3000",
            "4: camera.delay_ticks 3000 is not below estimator.history_ticks 2048, so every fix would be too old to \
             be used; raise history_ticks or lower delay_ticks",
        ),
        (
            "[chassis]\nkind = \"mecanum\"",
            "2: controller.law \"kanayama\" drives differential chassis, not \"mecanum\"; choose another law or \
             chassis.kind",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(error(text), format!("robot.toml:{expected}"));
    }
    // The advice holds.
    System::parse("robot.toml", "[chassis]\nwheel_speed_max_left_radps = 6.5").unwrap();
}

#[test]
fn wheels_faster_than_their_pulses_are_refused_with_what_makes_them_slow() {
    let cases = [
        (
            "microsteps = 16",
            "3.25 rad/s needs more than one step of 4.062e-4 rad a tick (1 ms); lower \
             chassis.wheel_speed_max_right_radps to 0.406 rad/s or lower motors.microsteps",
        ),
        (
            "pulse_rate_max_hz = 400",
            "3.25 rad/s needs more than one step of 6.500e-3 rad in 3 ticks (ms); lower \
             chassis.wheel_speed_max_right_radps to 2.166 rad/s or raise motors.pulse_rate_max_hz",
        ),
        (
            "pulse_space_s = 0.0021",
            "3.25 rad/s needs more than one step of 6.500e-3 rad in 3 ticks (ms); lower \
             chassis.wheel_speed_max_right_radps to 2.166 rad/s or shorten motors.pulse_length_s, pulse_space_s or \
             tick_jitter_s",
        ),
        (
            "pulse_rate_max_hz = 400\npulse_length_s = 0.0022",
            "3.25 rad/s needs more than one step of 6.500e-3 rad in 3 ticks (ms); lower \
             chassis.wheel_speed_max_right_radps to 2.166 rad/s or raise motors.pulse_rate_max_hz and shorten \
             motors.pulse_length_s, pulse_space_s or tick_jitter_s",
        ),
    ];
    for (line, expected) in cases {
        assert_eq!(
            error(&format!("[motors]\n{line}")),
            format!("robot.toml:{}: a wheel at {expected}", 2 + line.matches('\n').count())
        );
        let slower = "[chassis]\nwheel_speed_max_right_radps = 0.406\nwheel_speed_max_left_radps = 0.406";
        System::parse("robot.toml", &format!("[motors]\n{line}\n{slower}")).unwrap();
    }
    // Two ticks each: as fast as the e-puck is.
    let fits = "[motors]\npulse_length_s = 0.001\npulse_space_s = 0.001\ndirection_setup_s = 0.01";
    System::parse("robot.toml", fits).unwrap();
}

#[test]
fn assignments_are_refused_like_lines_and_change_nothing() {
    let cases = [
        ("plant.slip_men=0.1", r#"unknown key "slip_men" in [plant]; did you mean "slip_mean"?"#),
        ("slip_mean=0.1", r#"unknown key "slip_mean"; did you mean "plant.slip_mean"?"#),
        ("plant.slip_mean=abc", r#"plant.slip_mean: "abc" is not a number (-0.5 to 0.9)"#),
        ("plant.slip_mean=nan", "plant.slip_mean: must be a finite number, -0.5 to 0.9"),
        ("plant.slip_mean=2", "plant.slip_mean: 2 is outside -0.5 to 0.9"),
        ("plant.slip_mean", "write KEY=VALUE, for example plant.slip_mean=0.05"),
        ("limits=3", "limits is a section; write [limits] once and its keys below"),
        ("supervision.arm_on_start=1", r#"supervision.arm_on_start: "1" is not true or false"#),
    ];
    for (assignment, expected) in cases {
        assert_eq!(set_error(assignment), format!("--set {assignment}: {expected}"));
    }
    for odd in
        ["", "=", "=1", ".=1", "plant.=1", "a.b.c=1", "limits.v_min_mps=1", "controller.law=none", "robot= "]
    {
        let mut system = System::default();
        let error = system.set(odd).expect_err(odd).to_string();
        assert!(error.starts_with("--set ") && !error.contains('\n'), "{error}");
        assert_eq!(system, System::default());
    }
}

#[test]
fn assignments_reach_every_kind_of_key() {
    let mut system = System::default();
    system.set("plant.slip_mean=0.05").unwrap();
    system.set("controller.law = kanayama").unwrap();
    system.set("controller.kanayama.k1_per_s=0.03").unwrap();
    system.set("robot=7").unwrap();
    system.set("supervision.arm_on_start=true").unwrap();
    system.set("realtime.planner.cpu=0").unwrap();
    assert_eq!((system.plant.stepper_drive.slip_mean, &*system.robot), (0.05, "7"));
    assert_eq!(system.controller.values()[0], ("k1_per_s", 0.03));
    assert_eq!(system.controller.values_of("kanayama"), system.controller.values());
    assert!(system.controller.values_of("none").is_empty() && system.supervision.arm_on_start);
    assert_eq!(system.realtime(Role::Planner), Realtime { cpu: 0, priority: 0 });
    assert_eq!(system.get("controller.kanayama.k1_per_s"), Some(0.03));
    assert_eq!((system.get("robot"), system.get("plant.none")), (None, None));
    // Together they fit, in either order.
    system.set_all(&["limits.v_min_mps=0.05", "limits.v_max_mps=0.06"]).unwrap();
    assert!(system.set_all(&["limits.v_max_mps=0.01", "limits.v_min_mps=0.05"]).is_err());
    assert_eq!(system.limits.v_max_mps, 0.06);
}

#[test]
fn fields_changed_directly_are_checked_on_demand() {
    let mut system = System::default();
    assert_eq!(system.check(), Ok(()));
    system.start.theta_rad = f64::NAN;
    let error = system.check().unwrap_err().to_string();
    assert_eq!(error, "epuck: start.theta_rad: must be a finite number, -6.3 to 6.3 rad");
}

#[test]
fn the_built_in_system_is_table_1_and_names_every_key() {
    let epuck = System::load("epuck").unwrap();
    assert_eq!(epuck, System::default());
    assert!((epuck.count_rad() - 0.13 / 20.0).abs() < 1e-17);
    assert_eq!(
        epuck.controller.values(),
        [("k1_per_s", 0.0247), ("k2_per_m2", 2.9671e6), ("k3_per_m", 552.0)]
    );
    let document = Document::parse("epuck.toml", BUILT_IN[0].1).unwrap();
    let written = document.entries();
    // Laws for other chassis have no place there.
    let drives = |section| match section {
        keys::Section::Law(law) => LAWS[law].chassis.contains(&epuck.chassis.name()),
        _ => true,
    };
    for key in keys().filter(|key| key.section.fits(&epuck) && drives(key.section)) {
        let here = |entry: &document::Entry<'_>| (&*entry.section, entry.name) == (&*key.section(), key.name);
        assert!(written.iter().any(here), "{} is not in epuck.toml", key.path());
        assert!(!key.doc().is_empty());
    }
}

#[test]
fn processes_on_the_tick_are_real_time_on_the_last_cpu() {
    let epuck = System::load("epuck").unwrap();
    let order =
        [Role::StepGenerator, Role::PoseEstimator, Role::WaypointSelector, Role::Controller, Role::Plant];
    for (role, priority) in order.into_iter().zip([80, 70, 65, 60, 55]) {
        assert_eq!(epuck.realtime(role), Realtime { cpu: -1, priority });
    }
    for role in [Role::Planner, Role::Launch] {
        assert_eq!(epuck.realtime(role), Realtime::UNBOUND);
    }
    for role in [Role::Relay, Role::Recorder] {
        assert_eq!(epuck.realtime(role), Realtime { cpu: -3, priority: 0 });
    }
}

#[test]
fn files_that_cannot_be_read_are_one_line() {
    assert_eq!(
        System::load("epuk").unwrap_err().to_string(),
        "unknown system \"epuk\"; did you mean \"epuck\"? built-in: epuck, cart, agv; or a path ending in .toml"
    );
    assert_eq!(
        System::load("nowhere/robot.toml").unwrap_err().to_string(),
        "nowhere/robot.toml: cannot be read: No such file or directory (os error 2)"
    );
    let scratch = tempfile::tempdir().unwrap();
    let folder = scratch.path();
    let load = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        std::fs::write(&path, bytes).unwrap();
        let error = System::load(path.to_str().unwrap()).unwrap_err().to_string();
        error.strip_prefix(folder.to_str().unwrap()).unwrap().to_owned()
    };
    assert_eq!(
        load("big.toml", &[b'\n'; 1_000_001]),
        "/big.toml: larger than 1 MB; name a system or scenario file"
    );
    assert_eq!(load("latin.toml", b"# x\n# \xe9\n"), "/latin.toml:2: not UTF-8 text; save the file as UTF-8");
}
