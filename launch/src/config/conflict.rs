//! Values that are fine alone and do not fit each other.

use super::{Driver, System};
use crate::shell::build;
use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::motors::{Motors, StepperParams};
use hilare_pose_estimator::EstimatorKind;
use std::fs::File;
use std::io::Read;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

/// Two or more keys that contradict each other.
pub(super) struct Conflict {
    keys: Vec<(String, &'static str)>,
    /// Which, why, and what to do.
    pub what: String,
}

impl Conflict {
    fn new(keys: &[(&str, &'static str)], what: String) -> Self {
        Self { keys: keys.iter().map(|(section, name)| ((*section).to_owned(), *name)).collect(), what }
    }

    /// True if a key takes part.
    pub(super) fn involves(&self, section: &str, name: &str) -> bool {
        self.keys.iter().any(|key| (key.0.as_str(), key.1) == (section, name))
    }
}

/// The first conflict in a system.
pub(super) fn find(system: &System) -> Option<Conflict> {
    reversed_limits(system)
        .or_else(|| law_on_chassis(system))
        .or_else(|| plant_of_robot(system))
        .or_else(|| steps_a_tick(system))
        .or_else(|| no_radius_left(system))
        .or_else(|| fixes_too_old(system))
        .or_else(|| law_of_parameters(system))
        .or_else(|| standby_of_robot(system))
        .or_else(|| one_port_for_two(system))
}

fn reversed_limits(system: &System) -> Option<Conflict> {
    let limits = &system.limits;
    if limits.v_min_mps > limits.v_max_mps {
        let what = format!(
            "limits.v_min_mps {} is above limits.v_max_mps {}, so no speed is allowed; lower v_min_mps or raise v_max_mps",
            limits.v_min_mps, limits.v_max_mps
        );
        return Some(Conflict::new(&[("limits", "v_min_mps"), ("limits", "v_max_mps")], what));
    }
    if limits.omega_min_radps > limits.omega_max_radps {
        let what = format!(
            "limits.omega_min_radps {} is above limits.omega_max_radps {}, so no turn is allowed; \
             lower omega_min_radps or raise omega_max_radps",
            limits.omega_min_radps, limits.omega_max_radps
        );
        return Some(Conflict::new(&[("limits", "omega_min_radps"), ("limits", "omega_max_radps")], what));
    }
    None
}

fn law_on_chassis(system: &System) -> Option<Conflict> {
    let (law, kind) = (system.controller.law, system.chassis.name());
    if law.chassis.contains(&kind) {
        return None;
    }
    let what = format!(
        "controller.law {:?} drives {} chassis, not {kind:?}; choose another law or chassis.kind",
        law.name,
        law.chassis.join(" and ")
    );
    Some(Conflict::new(&[("controller", "law"), ("chassis", "kind")], what))
}

/// A chassis without a simulated robot.
pub(super) fn plant_of_robot(system: &System) -> Option<Conflict> {
    if !matches!((&system.chassis, &system.motors), (Chassis::Mecanum(_), Motors::Stepper(_))) {
        return None;
    }
    let what = "there is no simulated robot with Mecanum wheels on steppers; write motors.kind = \"servo\"";
    Some(Conflict::new(&[("chassis", "kind"), ("motors", "kind")], what.to_owned()))
}

fn one_port_for_two(system: &System) -> Option<Conflict> {
    let port = |text: &str| hilare_operator::address::parse(text).ok().map(|address| address.port());
    let taken = port(&system.listen)?;
    if port(&system.foxglove) != Some(taken) {
        return None;
    }
    let what = format!(
        "operator.listen and operator.foxglove are both port {taken}; give the live view another one"
    );
    Some(Conflict::new(&[("operator", "listen"), ("operator", "foxglove")], what))
}

fn no_radius_left(system: &System) -> Option<Conflict> {
    let (least, greatest) = (system.fit.radius_min_m, system.fit.radius_max_m);
    if least <= greatest {
        return None;
    }
    let what = format!(
        "planner.fit.radius_min_m {least} is above planner.fit.radius_max_m {greatest}, so no arc is allowed; lower \
         radius_min_m or raise radius_max_m"
    );
    Some(Conflict::new(&[("planner.fit", "radius_min_m"), ("planner.fit", "radius_max_m")], what))
}

/// The filter would have forgotten the odometry since every picture, and reckon dead in silence.
fn fixes_too_old(system: &System) -> Option<Conflict> {
    let (delay, history) = (system.camera.delay_ticks, system.ekf.history_ticks);
    if system.estimator != EstimatorKind::Ekf || delay < history {
        return None;
    }
    let what = format!(
        "camera.delay_ticks {delay} is not below estimator.history_ticks {history}, so every fix would be too old to \
         be used; raise history_ticks or lower delay_ticks"
    );
    let keys = [("camera", "delay_ticks"), ("estimator", "history_ticks"), ("estimator", "kind")];
    Some(Conflict::new(&keys, what))
}

/// Parameters that are fine alone and of which the law can make nothing together, or with this robot.
fn law_of_parameters(system: &System) -> Option<Conflict> {
    let (key, error) = build::law(system).err()?;
    let law = system.controller.law.name;
    let section = format!("controller.{law}");
    let what = format!("{section}.{key}: {error}");
    let keys =
        [(section.as_str(), key), ("controller", "law"), ("timing", "period_ticks"), ("chassis", "kind")];
    Some(Conflict::new(&keys, what))
}

/// A standby that could not drive this robot is none.
fn standby_of_robot(system: &System) -> Option<Conflict> {
    let Some(Driver::Law(name)) = system.controller.standby() else { return None };
    let law = hilare_controller::law(name)?;
    let kind = system.chassis.name();
    let keys = [("controller", "standby"), ("chassis", "kind")];
    if !law.chassis.contains(&kind) {
        let what = format!(
            "controller.standby {:?} drives {} chassis, not {kind:?}; choose another law",
            law.name,
            law.chassis.join(" and ")
        );
        return Some(Conflict::new(&keys, what));
    }
    let (key, error) = build::law_of(system, law).err()?;
    Some(Conflict::new(&keys, format!("controller.standby {:?}: {key}: {error}", law.name)))
}

/// Executables must be there before anything starts. Their paths are known only when it is known where the
/// file that names them lies.
pub(super) fn programs(system: &System) -> Option<Conflict> {
    let drivers = [("exec", Some(system.controller.driver())), ("standby", system.controller.standby())];
    drivers.into_iter().find_map(|(key, driver)| {
        let Some(Driver::Exec(program)) = driver else { return None };
        let wrong = match std::fs::metadata(&program) {
            Err(error) => error.to_string(),
            Ok(file) if !file.is_file() => "not a file".to_owned(),
            Ok(file) if file.permissions().mode() & 0o111 == 0 => "not executable; chmod +x".to_owned(),
            // Without either, a shell would try to make sense of it.
            Ok(_) if !begins_like_a_program(&program) => {
                "neither a program nor a script with a #! line".to_owned()
            }
            Ok(_) => return None,
        };
        let what = format!("controller.{key}: {}: {wrong}", program.display());
        Some(Conflict::new(&[("controller", key)], what))
    })
}

fn begins_like_a_program(file: &Path) -> bool {
    let mut head = [0; 4];
    let read = File::open(file).and_then(|mut file| file.read(&mut head)).unwrap_or(0);
    head[..read].starts_with(b"#!") || head[..read] == *b"\x7fELF"
}

/// The pulse train makes at most one step a tick, or fewer where the driver needs time: a faster wheel would
/// silently fall behind.
fn steps_a_tick(system: &System) -> Option<Conflict> {
    let Motors::Stepper(stepper) = &system.motors else { return None };
    let fastest_radps = system.chassis.wheel_speed_max_radps().into_iter().fold(0.0, f64::max);
    let pulse_radps = system.motors.pulse_speed_max_radps(&system.chassis)?;
    // Exactly one step a tick is fine, whatever the last bit of the division says.
    if fastest_radps <= pulse_radps * (1.0 + 1e-9) {
        return None;
    }
    let step_rad = system.count_rad();
    // Rounded down, so that the advice holds.
    let top_radps = (pulse_radps * 1e3).floor() / 1e3;
    let (pace, or) = what_limits_pulses(stepper);
    let what = format!(
        "a wheel at {fastest_radps} rad/s needs more than one step of {step_rad:.3e} rad {pace}; lower \
         chassis.{} to {top_radps} rad/s or {or}",
        wheel_speed_key(system, fastest_radps)
    );
    let keys = &[
        ("chassis", "wheel_speed_max_right_radps"),
        ("chassis", "wheel_speed_max_left_radps"),
        ("chassis", "wheel_speed_max_radps"),
        ("chassis", "wheel_diameter_m"),
        ("chassis", "wheel_radius_m"),
        ("motors", "step_length_m"),
        ("motors", "microsteps"),
        ("motors", "pulse_length_s"),
        ("motors", "pulse_space_s"),
        ("motors", "tick_jitter_s"),
        ("motors", "pulse_rate_max_hz"),
        ("motors", "kind"),
    ];
    Some(Conflict::new(keys, what))
}

/// How often there is a step, and what else could be done about it.
fn what_limits_pulses(stepper: &StepperParams) -> (String, String) {
    let interval = stepper.pulse_ticks().interval;
    if interval == 1 {
        let or =
            if stepper.microsteps > 1 { "lower motors.microsteps" } else { "raise motors.step_length_m" };
        return ("a tick (1 ms)".to_owned(), or.to_owned());
    }
    let plain = StepperParams::default();
    let by_rate = StepperParams { pulse_rate_max_hz: stepper.pulse_rate_max_hz, ..plain };
    let by_times = StepperParams { pulse_rate_max_hz: plain.pulse_rate_max_hz, ..*stepper };
    let limits = [
        (by_rate, "raise motors.pulse_rate_max_hz"),
        (by_times, "shorten motors.pulse_length_s, pulse_space_s or tick_jitter_s"),
    ];
    let mut or: Vec<&str> = Vec::new();
    or.extend(limits.iter().filter(|(by, _)| by.pulse_ticks().interval == interval).map(|(_, or)| or));
    (format!("in {interval} ticks (ms)"), or.join(" and "))
}

fn wheel_speed_key(system: &System, fastest_radps: f64) -> &'static str {
    match &system.chassis {
        Chassis::Differential(p) if p.wheel_speed_max_right_radps == fastest_radps => {
            "wheel_speed_max_right_radps"
        }
        Chassis::Differential(_) => "wheel_speed_max_left_radps",
        Chassis::Mecanum(_) => "wheel_speed_max_radps",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::chassis::MecanumParams;

    #[test]
    fn a_chassis_without_a_simulated_robot_is_refused() {
        let chassis = Chassis::Mecanum(MecanumParams::default());
        let conflict = plant_of_robot(&System { chassis, ..System::default() }).unwrap();
        assert!(conflict.what.ends_with("write motors.kind = \"servo\""), "{}", conflict.what);
        assert!(conflict.involves("chassis", "kind") && !conflict.involves("limits", "v_max_mps"));
    }
}
