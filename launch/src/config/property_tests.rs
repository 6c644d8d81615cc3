//! Mutations, random systems and random text.

use super::*;
use hilare_interfaces::params::ParamKind;
use proptest::prelude::*;

/// The error that `robot.toml` with this text gives.
fn error(text: &str) -> String {
    System::parse("robot.toml", text).map(|_| text.to_owned()).expect_err("refused").to_string()
}

#[test]
fn no_mutation_of_a_file_passes_silently() {
    let text = System::default().to_toml();
    let lines: Vec<&str> = text.lines().collect();
    let mut mutated = 0;
    let mut section = String::new();
    for (index, line) in lines.iter().enumerate() {
        if let Some(path) = line.strip_prefix('[') {
            section = path.trim_end_matches(']').to_owned();
        }
        let Some((name, value)) = line.split_once(" = ").filter(|_| !line.starts_with('#')) else { continue };
        let here = |key: &Key| {
            key.section.fits(&System::default()) && (&*key.section(), key.name) == (&*section, name)
        };
        let key = keys().find(here).expect(line);
        let mut wrong = vec![format!("{}q = {value}", &name[..name.len() - 1]), format!("{name} = nan")];
        match key.form {
            Form::Text(_) => wrong.push(format!("{name} = 1")),
            Form::Number(spec) => {
                wrong.push(format!("{name} = \"{value}\""));
                wrong.extend(
                    [spec.min - 1.0, spec.max * 2.0 + 1.0].map(|outside| format!("{name} = {outside}")),
                );
                let thousandfold = value.parse::<f64>().unwrap_or(1.0) * 1e3;
                if spec.kind == ParamKind::Switch || !(spec.min..=spec.max).contains(&thousandfold) {
                    wrong.push(format!("{name} = {thousandfold}"));
                }
            }
        }
        for wrong in wrong {
            let mut lines = lines.clone();
            lines[index] = &wrong;

            let error = error(&lines.join("\n"));
            assert!(error.starts_with(&format!("robot.toml:{}: ", index + 1)), "{wrong}: {error}");
            assert!(error.contains(&name[..name.len() - 1]) && !error.contains('\n'), "{wrong}: {error}");
            mutated += 1;
        }
    }
    assert!(mutated > 200, "{mutated}");
}

/// Any system that can be written: every key at a random place within its bounds.
fn systems() -> impl Strategy<Value = System> {
    let numbers: Vec<_> = keys()
        .filter(|key| key.section.fits(&System::default()))
        .filter_map(|key| if let Form::Number(spec) = key.form { Some((key, spec)) } else { None })
        .collect();
    proptest::collection::vec(0.0..=1.0f64, numbers.len()).prop_map(move |places| {
        let mut system = System::default();
        for ((key, spec), place) in numbers.iter().zip(places) {
            let value = spec.min + place * (spec.max - spec.min);
            let value = if spec.kind == ParamKind::Real { value } else { value.round() };
            key.section.put(&mut system, key.name, value.clamp(spec.min, spec.max));
        }
        // What must fit together is made to.
        let limits = &mut system.limits;
        limits.v_min_mps = limits.v_min_mps.min(limits.v_max_mps);
        limits.omega_min_radps = limits.omega_min_radps.min(limits.omega_max_radps);
        system.fit.radius_min_m = system.fit.radius_min_m.min(system.fit.radius_max_m);
        if let Motors::Stepper(stepper) = &mut system.motors {
            stepper.step_length_m = stepper.step_length_m.max(0.05);
            stepper.microsteps = stepper.microsteps.min(16);
            stepper.pulse_rate_max_hz = stepper.pulse_rate_max_hz.max(10.0);
        }
        let top_radps = system.motors.pulse_speed_max_radps(&system.chassis).unwrap_or(f64::INFINITY);
        if let Chassis::Differential(params) = &mut system.chassis {
            params.wheel_speed_max_right_radps = params.wheel_speed_max_right_radps.min(top_radps);
            params.wheel_speed_max_left_radps = params.wheel_speed_max_left_radps.min(top_radps);
        }
        system
    })
}

proptest! {
    #[test]
    fn what_is_written_reads_back_to_the_same_bits(system in systems()) {
        let text = system.to_toml();
        let read = System::parse("robot.toml", &text).map_err(|error| TestCaseError::fail(error.to_string()))?;
        prop_assert_eq!(read.to_toml(), text);
        for key in keys() {
            let bits = |system: &System| key.section.get(system, key.name).map(f64::to_bits);
            prop_assert_eq!(bits(&read), bits(&system), "{}", key.path());
        }
        prop_assert_eq!(read, system);
    }

    #[test]
    fn any_bytes_are_answered_in_one_line(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let text = String::from_utf8_lossy(&bytes);
        for error in [System::parse(&text, &text).err(), System::default().set(&text).err()].into_iter().flatten() {
            prop_assert!(!error.to_string().chars().any(char::is_control));
        }
    }

    #[test]
    fn any_toml_is_answered(
        section in "(\\[?\\[?(limits|chassis|controller\\.kanayama|realtime|set|x)(\\.[a-z]{0,3})?\\]?\\]?)?",
        name in "(v_max_mps|kind|law|track_m|k1_per_s|\"[^\"]{0,4}\"|[a-z.]{0,12})",
        value in "(-?[0-9]{1,40}|nan|-?inf|true|\"[a-z]{0,9}\"|\\[[0-9, ]{0,9}\\]|\\{ ?[a-z=1]{0,6} ?\\}|0x[0-9a-f]{1,40})",
    ) {
        if let Err(error) = System::parse("robot.toml", &format!("{section}\n{name} = {value}\n")) {
            let error = error.to_string();
            prop_assert!(error.starts_with("robot.toml:") && !error.chars().any(char::is_control), "{}", error);
        }
    }
}
