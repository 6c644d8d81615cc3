//! Mutation test: every key of every built-in file, mistyped, misplaced, of a wrong type, out of bounds, in a wrong unit. Each
//! is refused, or warned of, with file and line, the key, and what to do.

use super::mutate::{File, Site, other_units, sites, slips, wrong_units, wrong_values};
use hilare::config::{Form, System};
use hilare_interfaces::params::ParamKind;
use std::collections::BTreeMap;

/// How often a kind of mistake was refused, warned of, passed.
#[derive(Clone, Copy, Default)]
struct Count {
    refused: usize,
    warned: usize,
    silent: usize,
}

/// What became of every mistake.
#[derive(Default)]
struct Tally {
    counts: BTreeMap<&'static str, Count>,
    wrong: Vec<String>,
}

impl Tally {
    /// What was said of a mistake at `at`: it has to name the line, the key (one of `names`), and a way out.
    fn judge(
        &mut self,
        kind: &'static str,
        file: &File,
        at: usize,
        text: &str,
        what: &str,
        names: &[&str],
    ) -> String {
        let count = self.counts.entry(kind).or_default();
        let place = format!("{}:{}: ", file.name, file.line(at));
        let (verb, said) = match file.read(text) {
            Err(error) => {
                count.refused += 1;
                ("refused", error)
            }
            Ok(warnings) => {
                match warnings.into_iter().find(|line| names.iter().any(|name| line.contains(name))) {
                    Some(line) => {
                        count.warned += 1;
                        ("warned", line)
                    }
                    None => {
                        count.silent += 1;
                        self.wrong.push(format!("{place}{what}: silent"));
                        return String::new();
                    }
                }
            }
        };
        let named = names.iter().any(|name| said.contains(name));
        // Keys that contradict each other are told at the later one's line; what TOML cannot read, where it stops.
        let placed = said.starts_with(&place)
            || (said.starts_with(&format!("{}:", file.name))
                && (said.contains("not TOML") || (verb == "refused" && kind == "another unit" && named)));
        let advises = [
            "did you mean",
            "the key is",
            "known",
            "write ",
            "outside",
            "must be",
            "lower ",
            "raise ",
            "is not",
        ]
        .iter()
        .chain(&[
            "unusual",
            "metres?",
            "at most",
            "belongs to",
            "not TOML",
            "only sections",
            "use 1 to 32",
            "no such",
            "choose",
        ])
        .any(|word| said.contains(word));
        if !(placed && (named || said.contains("not TOML")) && advises && !said.contains('\n')) {
            self.wrong.push(format!("{place}{what}: {verb} badly: {said}"));
        }
        said
    }

    fn report(self, least: usize) {
        println!("{:<22} {:>8} {:>8} {:>8}", "mistake", "refused", "warned", "silent");
        for (kind, count) in &self.counts {
            println!("{kind:<22} {:>8} {:>8} {:>8}", count.refused, count.warned, count.silent);
        }
        let shown = self.wrong.iter().take(60).cloned().collect::<Vec<_>>().join("\n");
        assert!(self.wrong.is_empty(), "{} mistakes:\n{shown}", self.wrong.len());
        let all: usize = self.counts.values().map(|count| count.refused + count.warned).sum();
        assert!(all >= least, "only {all} mistakes were made");
    }
}

#[test]
fn files_without_a_mistake_are_read_without_a_word() {
    for file in File::all() {
        assert_eq!(file.read(&file.text), Ok(Vec::new()), "{}", file.name);
    }
}

#[test]
fn a_slip_in_a_key_or_a_section_is_refused_with_what_was_meant() {
    let (mut tally, mut named, mut all) = (Tally::default(), 0, 0);
    for file in File::all() {
        let (sites, headers) = sites(&file);
        for site in &sites {
            let name = &file.text[site.name.clone()];
            for slip in slips(name).into_iter().step_by(file.stride()) {
                let text = file.with(&site.name, &slip);
                let said = tally.judge("slip in a key", &file, site.name.start, &text, &slip, &[name, &slip]);
                all += usize::from(site.form.is_some());
                named += usize::from(
                    site.form.is_some()
                        && (said.contains(&format!("{name}\"")) || said.contains(&format!("is {name}"))),
                );
            }
        }
        for header in headers {
            let name = &file.text[header.clone()];
            for slip in slips(name).into_iter().step_by(file.stride()) {
                let text = file.with(&header, &slip);
                // A slip in one of several words is told of that word.
                let words: Vec<&str> = slip.split('.').filter(|word| !word.is_empty()).collect();
                tally.judge("slip in a section", &file, header.start, &text, &slip, &words);
            }
        }
    }
    tally.report(15_000);
    // Where two keys are alike, it may be the other one.
    println!("what was meant is named {named} times of {all}");
    assert!(named * 100 >= all * 98, "what was meant is named {named} times of {all}");
}

#[test]
fn a_key_with_another_unit_in_its_name_is_refused() {
    let mut tally = Tally::default();
    for file in File::all() {
        let system = file.system();
        for site in &sites(&file).0 {
            let (name, Some(Form::Number(spec))) = (&file.text[site.name.clone()], site.form) else {
                continue;
            };
            for other in other_units(name, spec).into_iter().step_by(file.stride()) {
                let text = file.with(&site.name, &other);
                // In a section that has both a length and an angle of that stem, the other unit is another key.
                let taken = system.number_key(&format!("{}{other}", site.path(&file).trim_end_matches(name)));
                if taken.is_none() {
                    tally.judge(
                        "another unit's name",
                        &file,
                        site.name.start,
                        &text,
                        &other,
                        &[name, &other],
                    );
                }
            }
        }
    }
    tally.report(2000);
}

#[test]
fn a_value_of_another_type_or_out_of_bounds_is_refused_and_changes_nothing() {
    let mut tally = Tally::default();
    for file in File::all() {
        for site in &sites(&file).0 {
            let (name, Some(form)) = (&file.text[site.name.clone()], site.form) else { continue };
            let value = &file.text[site.value.clone()];
            let (types, beyond) = wrong_values(&form, value);
            for (kind, wrong) in [("another type", &types), ("out of bounds", &beyond)] {
                for wrong in wrong.iter().step_by(file.stride().min(3)) {
                    let text = file.with(&site.value, wrong);
                    tally.judge(kind, &file, site.value.start, &text, &format!("{name} = {wrong}"), &[name]);
                }
            }
            let mut system = file.system();
            let before = system.clone();
            for wrong in beyond {
                system.set(&format!("{}={wrong}", site.path(&file))).expect_err("out of bounds");
            }
            assert_eq!(system, before, "half applied: {name}");
        }
    }
    assert!(tally.counts.values().all(|count| count.warned == 0), "such a value is refused");
    tally.report(3000);
}

/// Values for keys that are zero in the files, which no unit changes.
const TYPICAL: [(&str, f64); 31] = [
    ("limits.v_min_mps", 0.01),
    ("limits.omega_min_radps", 0.05),
    ("limits.accel_mps2", 0.5),
    ("limits.accel_radps2", 40.0),
    ("motors.pulse_length_s", 2e-6),
    ("motors.pulse_space_s", 2e-6),
    ("motors.direction_setup_s", 5e-6),
    ("motors.direction_hold_s", 5e-6),
    ("motors.tick_jitter_s", 2e-4),
    ("controller.drive_lag_s", 0.04),
    ("controller.kanayama.k1_per_s", 0.5),
    ("planner.margin_m", 0.01),
    ("planner.deadline_ms", 200.0),
    ("planner.fit.tolerance_m", 0.002),
    ("plant.slip_mean", 0.03),
    ("plant.slip_sd", 0.1),
    ("plant.wheel_error_right", 0.01),
    ("plant.wheel_error_left", 0.01),
    ("plant.track_error", 0.01),
    ("plant.start_error_x_m", 0.01),
    ("plant.start_error_y_m", 0.01),
    ("plant.start_error_theta_rad", 0.1),
    ("plant.start_sd_m", 0.005),
    ("plant.start_sd_rad", 0.05),
    ("camera.lost", 0.05),
    ("wake_up.spin_us", 50.0),
    ("wake_up.pose_estimator_us", 100.0),
    ("wake_up.waypoint_selector_us", 150.0),
    ("wake_up.controller_us", 200.0),
    ("start.x_m", 0.2),
    ("start.y_m", 0.2),
];

/// Where nothing can be said: a robot may stand anywhere, and a system file knows no path.
const ANYWHERE: [&str; 2] = ["start.x_m", "start.y_m"];

/// What is left: half a radian a second is a least yaw rate as good as a tenth of it.
const PLAUSIBLE: [&str; 1] = ["limits.omega_min_radps = 0.47746482925000006"];

#[test]
fn a_value_in_another_unit_is_refused_or_warned_of() {
    let mut tally = Tally::default();
    for file in File::all().iter().filter(|file| file.by_hand()) {
        for site in &sites(file).0 {
            for (wrong, text) in in_wrong_units(file, site) {
                let name = &file.text[site.name.clone()];
                let plausible = PLAUSIBLE.iter().any(|known| wrong.starts_with(known));
                if plausible || (!file.scenario && ANYWHERE.contains(&&*site.path(file))) {
                    continue;
                }
                tally.judge("another unit", file, site.value.start, &text, &wrong, &[name]);
            }
        }
    }
    tally.report(200);
}

/// The file with the value of a key as it is in units that the key's is taken for.
fn in_wrong_units(file: &File, site: &Site) -> Vec<(String, String)> {
    let Some(Form::Number(spec)) = site.form else { return Vec::new() };
    let path = site.path(file);
    let Ok(mut value) = file.text[site.value.clone()].parse::<f64>() else { return Vec::new() };
    if value == 0.0 {
        let typical = TYPICAL.iter().find(|(key, _)| *key == path && !file.scenario);
        value = typical.map_or(0.0, |(_, value)| *value);
    }
    let mutate = |(unit, factor): &(&str, f64)| {
        let wrong = value * factor;
        let wrong = if spec.kind == ParamKind::Integer { format!("{wrong}") } else { format!("{wrong:?}") };
        let text = file.with(&site.value, &wrong);
        (format!("{path} = {wrong} ({value} {} in {unit})", spec.unit), text)
    };
    if value == 0.0 { Vec::new() } else { wrong_units(spec).iter().map(mutate).collect() }
}

/// A path in millimetres or centimetres, in the file or beside it.
#[test]
fn a_path_in_another_unit_is_refused_or_warned_of() {
    let mut tally = Tally::default();
    for file in File::all().iter().filter(|file| file.scenario) {
        for site in sites(file).0 {
            let name = &file.text[site.name.clone()];
            if !["waypoints_m", "goal_m"].contains(&name) {
                continue;
            }
            let end = if name == "goal_m" { site.value.end } else { array_end(&file.text, site.value.start) };
            for (unit, factor) in [("mm", 1e3), ("cm", 1e2)] {
                let scaled = scaled(&file.text[site.value.start..end], factor);
                let text = file.with(&(site.value.start..end), &scaled);
                let what = format!("{name} in {unit}");
                // The start then lies elsewhere, which is said, too.
                tally.judge("path in another unit", file, site.value.start, &text, &what, &["metres?"]);
            }
        }
    }
    tally.report(16);
}

fn array_end(text: &str, start: usize) -> usize {
    let mut depth = 0;
    for (at, letter) in text[start..].char_indices() {
        match letter {
            '[' => depth += 1,
            ']' if depth == 1 => return start + at + 1,
            ']' => depth -= 1,
            _ => {}
        }
    }
    text.len()
}

/// The array with x and y of every innermost array times `factor`.
fn scaled(array: &str, factor: f64) -> String {
    let inner: Vec<String> = array
        .split('[')
        .filter(|part| part.contains(']'))
        .map(|part| {
            let numbers = part.split(']').next().unwrap_or_default().split(',');
            let scaled = numbers.enumerate().map(|(i, number)| {
                let number: f64 = number.trim().parse().expect("a number");
                format!("{:?}", if i < 2 { number * factor } else { number })
            });
            format!("[{}]", scaled.collect::<Vec<_>>().join(", "))
        })
        .collect();
    if array.trim_start().starts_with("[[") || array.contains("\n") {
        format!("[{}]", inner.join(", "))
    } else {
        inner.join("")
    }
}

/// Robots unlike the built-in ones, whose owners mean what they write.
#[test]
fn robots_of_other_sizes_are_not_warned_of() {
    let robots = [
        // A tugger for a warehouse.
        "[chassis]\ntrack_m = 0.9\nwheel_diameter_m = 0.3\nwheel_speed_max_right_radps = 16.0\nwheel_speed_max_left_radps = 16.0\n\
         [motors]\nkind = \"servo\"\ncounts_per_turn = 20000\n[limits]\nv_max_mps = 2.0\nomega_max_radps = 1.5\naccel_mps2 = 0.8\n\
         accel_radps2 = 2.0\nstop_decel_mps2 = 2.5\nstop_decel_radps2 = 6.0\n[tracking]\nspeed_mps = 1.2\nacceptance_radius_m = 0.4\n\
         [controller]\nlaw = \"pure-pursuit\"\n[planner]\nrobot_radius_m = 0.8\nmargin_m = 0.2\nspacing_m = 1.0\n",
        // A robot of a palm's size on steppers with microsteps.
        "[chassis]\ntrack_m = 0.03\nwheel_diameter_m = 0.012\nwheel_speed_max_right_radps = 4.0\nwheel_speed_max_left_radps = 4.0\n\
         [motors]\nstep_length_m = 0.0001\nmicrosteps = 2\npulse_length_s = 0.000003\n[limits]\nv_max_mps = 0.02\nomega_max_radps = 1.0\n\
         [tracking]\nspeed_mps = 0.015\nacceptance_radius_m = 0.01\n[camera]\nsd_m = 0.0005\n",
        // The one of the guide.
        "[chassis]\ntrack_m = 0.20\nwheel_diameter_m = 0.065\nwheel_speed_max_right_radps = 6.0\nwheel_speed_max_left_radps = 6.0\n\
         [motors]\nstep_length_m = 0.0004\n[limits]\nv_max_mps = 0.15\nomega_max_radps = 1.2\n[tracking]\nspeed_mps = 0.12\n\
         acceptance_radius_m = 0.08\n[controller.kanayama]\nk1_per_s = 0.5\n",
    ];
    for robot in robots {
        let system = System::parse("robot.toml", robot).expect("a robot");
        assert_eq!(system.warnings(), [] as [String; 0], "{robot}");
    }
}

/// The one default that is no robot's but the e-puck's.
#[test]
fn a_map_and_the_size_of_another_robot_are_warned_of() {
    for (name, wheels_m) in [("epuck", 0.027), ("cart", 0.2), ("agv", 0.3905)] {
        let mut system = System::load(name).expect("built in");
        system.set("planner.map=platform").expect("built in");
        assert_eq!(system.warnings(), [] as [String; 0], "{name}");
        system.set("planner.robot_radius_m=0.02").expect("within its bounds");
        let warnings = system.warnings();
        let wanted =
            format!("planner.robot_radius_m = 0.02 m is less than the robot's wheels take, {wheels_m} m");
        assert!(warnings.iter().any(|warning| warning.contains(&wanted)), "{name}: {warnings:?}");
    }
    let own = "[chassis]\ntrack_m = 0.2\nwheel_diameter_m = 0.065\n[planner]\nmap = \"platform\"\n";
    let warnings = System::parse("own.toml", own).expect("a robot").warnings();
    let wanted = "own.toml:5: planner.robot_radius_m = 0.037 m is less than the robot's wheels take, 0.1 m from its middle";
    assert!(warnings.iter().any(|warning| warning.starts_with(wanted)), "{warnings:?}");
}

/// A warning stands where the value was written, the last time.
#[test]
fn warnings_name_the_place_and_the_unit() {
    let mut system = System::parse("robot.toml", "\n[limits]\nv_max_mps = 4.1\n").expect("within its bounds");
    let wanted = "robot.toml:3: limits.v_max_mps = 4.1 m/s is unusual for wheels that reach 0.065 m/s: at most 0.06825 m/s; \
                  did you mean 0.041 (SI, not cm/s)?";
    assert_eq!(system.warnings(), [wanted]);
    system.set("limits.v_max_mps=0.04").expect("within its bounds");
    assert_eq!(system.warnings(), [] as [String; 0]);
    system.set("limits.omega_max_radps=42.8").expect("within its bounds");
    let [warning] = &system.warnings()[..] else { panic!("one warning") };
    assert!(
        warning.starts_with("--set limits.omega_max_radps=42.8: ")
            && warning.contains("not degrees a second"),
        "{warning}"
    );
}
