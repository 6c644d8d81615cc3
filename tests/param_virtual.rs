//! Parameters changed in mid-drive, in virtual time: the bits are those of boxes that were never anything else.

mod support;

use hilare::config::{Scenario, System, Task};
use hilare::shell::in_process::InProcess;
use hilare::shell::{ClockKind, build};
use hilare_controller::{ControllerInputs, Identity};
use hilare_interfaces::block::{Block, Tick};
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Authority, Mode, PathHeader, Reference, ReferenceState, Waypoint};
use hilare_pose_estimator::EstimatorInputs;
use hilare_recorder::TickRecord;
use hilare_recorder::statistics::{RunFigures, RunStatistics};
use hilare_step_generator::StepInputs;
use hilare_waypoint_selector::{NewPath, SelectorInputs};
use rustix::process::Signal;
use serde_json::Value;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use support::{Lab, Running, number, text};

const MAX_TICKS: Tick = 2_000_000;

fn scenario(name: &str, set: &[&str]) -> (System, Vec<Waypoint>) {
    let mut scenario = Scenario::load(name).expect("built in");
    scenario.system.set_all(set).expect("keys");
    let Task::Follow(waypoints) = scenario.task else { panic!("it has no path of its own") };
    (scenario.system, waypoints)
}

fn drive(system: &System, path: &[Waypoint], changes: &[(Tick, System)]) -> RunFigures {
    let mut robot = InProcess::new(system, path).expect("a robot");
    robot.run_changing(MAX_TICKS, changes).expect("a change").statistics.figures()
}

/// A box that takes over from one that is alike goes on as if nothing had happened: it takes all there is.
#[test]
fn a_change_to_the_same_values_leaves_no_bit_behind() {
    let noisy = ["plant.slip_sd=0.05", "estimator.kind=ekf", "camera.lost=0.1"];
    let of = |name: &str, law: &str, more: &[&str]| {
        let law = format!("controller.law={law}");
        scenario(name, &[&[&*law][..], more].concat())
    };
    let robots = [
        of("rectangle", "kanayama", &noisy),
        of("so", "qp", &["plant.slip_sd=0.05"]),
        of("rectangle", "navigation-circle", &noisy),
        of(
            "trapezoid",
            "pure-pursuit",
            &["estimator.kind=camera", "camera.sd_m=0.0001", "controller.drive_lag_s=0.02"],
        ),
        of("rectangle", "stanley", &[]),
        of("arc-102cm", "navigation-circle", &noisy),
        of("agv-course", "finite-step", &["plant.roller_slip_sd=0.05", "estimator.kind=ekf"]),
        of("agv-course", "qp", &["plant.roller_slip_sd=0.05", "estimator.kind=ekf"]),
    ];
    for (system, path) in robots {
        let undisturbed = drive(&system, &path, &[]);
        assert!(undisturbed.reached, "{} {}", system.robot, system.controller.law.name);
        // At the beginning, at the boundaries of periods, and at ticks that are none.
        let ticks = [0, 5, 1000, 1235, 2501, 2502, 4004, 7777];
        let same: Vec<(Tick, System)> = ticks.into_iter().map(|tick| (tick, system.clone())).collect();
        let changed = drive(&system, &path, &same);
        let name = format!("{} {}", system.robot, system.controller.law.name);
        assert_eq!(
            (changed.state_hash, changed.ticks),
            (undisturbed.state_hash, undisturbed.ticks),
            "{name}"
        );
    }
}

/// Every kind of live key, to another value and back, does not break the drive, and is not without effect.
#[test]
fn every_live_section_changes_and_the_robot_arrives() {
    let cases = [
        ("so", "kanayama", "tracking.speed_mps=0.02"),
        ("so", "kanayama", "tracking.acceptance_radius_m=0.02"),
        ("rectangle", "navigation-circle", "tracking.acceptance=rim"),
        ("so", "kanayama", "limits.v_max_mps=0.03"),
        ("so", "qp", "limits.omega_max_radps=0.4"),
        ("so", "kanayama", "controller.kanayama.k2_per_m2=100000"),
        ("so", "qp", "controller.qp.horizon=3"),
        ("rectangle", "navigation-circle", "controller.navigation-circle.integral_max_rad=0"),
        ("so", "pure-pursuit", "controller.drive_lag_s=0.3"),
        ("so", "kanayama", "plant.slip_mean=0.1"),
        ("so", "kanayama", "plant.track_error=0.05"),
        ("so", "kanayama", "camera.delay_ticks=400"),
        ("so", "kanayama", "camera.period_ticks=5"),
        ("so", "kanayama", "estimator.history_ticks=100"),
        ("so", "kanayama", "estimator.slip_noise=0.01"),
        ("so", "kanayama", "estimator.restart_after=2"),
        ("arc-102cm", "navigation-circle", "plant.traction=0.2"),
        ("arc-102cm", "navigation-circle", "plant.slip_mean=0.1"),
        ("agv-course", "finite-step", "controller.finite-step.sample_period_s=0.05"),
        ("agv-course", "finite-step", "plant.roller_slip_mean=0.1"),
    ];
    // What is the same before the change is driven once.
    let mut driven: HashMap<(&str, &str), RunFigures> = HashMap::new();
    for (name, law, assignment) in cases {
        let driver = (name, law);
        let law = format!("controller.law={law}");
        let noisy = ["estimator.kind=ekf", "camera.delay_ticks=60", "plant.wheel_error_right=0.002"];
        let noisy = if name == "agv-course" { &noisy[..2] } else { &noisy[..] };
        let (before, path) = scenario(name, &[&[&*law][..], noisy].concat());
        let mut other = before.clone();
        other.set(assignment).expect("a key");
        let undisturbed = driven.entry(driver).or_insert_with(|| drive(&before, &path, &[])).state_hash;
        let changed = drive(&before, &path, &[(3000, other.clone()), (20_005, before.clone())]);
        assert!(changed.reached, "{name} {assignment}");
        // A bound that nothing comes near to may make no difference.
        let bound = ["restart_after", "history_ticks"].iter().any(|key| assignment.contains(key));
        assert!(changed.state_hash != undisturbed || bound, "{name} {assignment}: no effect");
    }
}

/// The e-puck by the boxes alone, composed here: from tick `at` on the reference speed is another one, and that is
/// all. No box is rebuilt.
fn slower_from(system: &System, path: &[Waypoint], at: Tick, speed_mps: f64) -> RunFigures {
    let identity = Identity { source: 1, epoch: 1 };
    let (law, period) = (system.controller.law, system.timing.period_ticks);
    let mut generator = build::step_generator(system, ClockKind::InProcess);
    let mut estimator = build::pose_estimator(system);
    let mut selector = build::waypoint_selector(system);
    let mut controller = build::controller(system, law, identity).expect("a controller");
    let mut plant = build::plant(system).expect("a plant");
    let armed =
        Authority { seq: 1, mode: Mode::Armed.code(), term: 1, source: 1, epoch: 1, ..Authority::ZERO };
    generator.take_in(0, StepInputs { authority: Some(&armed), ..StepInputs::default() });
    let header = PathHeader { path_id: 1, goal_id: 0 };
    let mut statistics = RunStatistics::default();
    let mut pose = estimator.step(0, EstimatorInputs { counts: &[0; 4], fixes: &[] });
    let (mut reference, mut command) = (Reference::ZERO, None);
    for tick in 0..MAX_TICKS {
        if tick.is_multiple_of(period) {
            let path = (tick == 0).then_some(NewPath { header: &header, waypoints: path });
            reference = selector.step(tick, SelectorInputs { pose: &pose, path });
            if reference.state == ReferenceState::Arrived.code() {
                statistics.note_arrival();
                break;
            }
            if tick >= at {
                reference.speed_mps = speed_mps;
            }
            command = Some(controller.step(tick, ControllerInputs { reference: &reference, pose: &pose }));
        }
        let commands = command.take();
        let inputs = StepInputs { commands: commands.as_slice(), ..StepInputs::default() };
        let steps = generator.step(tick, inputs);
        let truth = plant.step(tick + 1, &steps).truth;
        pose = estimator.step(tick + 1, EstimatorInputs { counts: &steps.counts, fixes: &[] });
        statistics.push(TickRecord { steps: &steps, pose: &pose, truth: &truth, reference: &reference });
    }
    statistics.figures()
}

#[test]
fn another_speed_is_what_a_loop_of_ones_own_makes_of_it() {
    for law in ["kanayama", "qp"] {
        let (system, path) = scenario("so", &[&*format!("controller.law={law}")]);
        let mut other = system.clone();
        other.set("tracking.speed_mps=0.025").expect("a key");
        for at in if law == "qp" { &[9990][..] } else { &[0, 1005, 9990] } {
            let at = *at;
            let changed = drive(&system, &path, &[(at, other.clone())]);
            let expected = slower_from(&system, &path, at, 0.025);
            assert!(expected.reached && changed.ticks > 40_000);
            assert_eq!(
                (changed.state_hash, changed.ticks),
                (expected.state_hash, expected.ticks),
                "{law} at {at}"
            );
        }
    }
}

/// Laps round the rectangle, so that the drive outlasts what is done to it.
fn laps(lab: &Lab, laps: usize) -> PathBuf {
    let mut csv = "x,y\n0.2,0.2\n".to_owned();
    for _ in 0..laps {
        csv.push_str("0.57,0.2\n0.57,0.48\n0.2,0.48\n0.2,0.2\n");
    }
    lab.file("laps.csv", csv)
}

/// A robot in lockstep and what is set on it: (tick, system) in turn.
struct Lockstep<'l> {
    lab: &'l Lab,
    robot: String,
    run: Running,
    system: System,
    path: Vec<Waypoint>,
    changes: Vec<(Tick, System)>,
}

impl<'l> Lockstep<'l> {
    fn start(lab: &'l Lab, path: &Path, set: &[&str]) -> Self {
        let robot = lab.robot();
        let mut command =
            lab.command(&["run", "rectangle", "--clock", "lockstep", "--json", "--robot", &robot]);
        command.args(["--path", &path.to_string_lossy(), "--start", "0.2,0.2,0", "--out", "report"]);
        let set = [&["supervision.restart_budget=10000"][..], set].concat();
        set.iter().for_each(|key| {
            command.args(["--set", key]);
        });
        let run = Running::start(command);
        lab.await_status(&robot, "it drives", |status| number(status, "tick") > 300.0);
        let (mut system, _) = scenario("rectangle", &set);
        system.set_all(&["start.x_m=0.2", "start.y_m=0.2", "start.theta_rad=0"]).expect("a start");
        let text = std::fs::read(path).expect("the path");
        let path = hilare_planner::waypoint_file::parse(&text[..]).expect("waypoints");
        Self { lab, robot, run, system, path, changes: Vec::new() }
    }

    fn set(&mut self, set: &[&str]) -> Value {
        let args = [&["param", "set"], set, &["--robot", &self.robot, "--json"]].concat();
        // Somebody may just be starting again.
        let ended = (0..200).map(|_| self.lab.hilare(&args)).find(|ended| ended.code == Some(0));
        let ended = ended.expect("a change");
        let answer: Value = serde_json::from_str(&ended.stdout).expect("JSON");
        let mut system = self.changes.last().map_or(&self.system, |(_, system)| system).clone();
        system.set_all(set).expect("keys");
        self.changes.push((number(&answer, "tick") as Tick, system));
        answer
    }

    fn kill_in_charge(&self) {
        let status = self.lab.status(&self.robot).expect("it is up");
        let all = status["processes"].as_array().expect("processes");
        let in_charge = all.iter().find(|one| one["authority"] == true).expect("one in charge");
        let pid = in_charge["pid"].as_i64().and_then(|pid| i32::try_from(pid).ok()).expect("a pid");
        support::process::signal(pid, Signal::KILL);
        support::wait_until("another one is in charge", || {
            let status = self.lab.status(&self.robot).unwrap_or_default();
            status["processes"].as_array().is_some_and(|all| {
                all.iter()
                    .any(|one| one["authority"] == true && one["pid"] != pid && one["state"] == "running")
            })
        });
    }

    /// To its end, and the same in one thread.
    fn end(self) -> (Value, RunFigures) {
        let ended = self.run.wait(support::PATIENCE).expect_code(0);
        let summary = serde_json::from_str(&ended.stdout).expect("summary.json");
        (summary, drive(&self.system, &self.path, &self.changes))
    }
}

#[test]
fn processes_in_lockstep_change_at_one_tick_and_end_in_the_bits_of_one_thread() {
    let lab = Lab::new();
    let path = laps(&lab, 40);
    let mut robot = Lockstep::start(&lab, &path, &["controller.standby=kanayama"]);
    for set in [
        &["tracking.speed_mps=0.03"][..],
        &["limits.v_max_mps=0.035", "limits.accel_mps2=0.2"],
        &["controller.kanayama.k2_per_m2=1000000", "tracking.acceptance_radius_m=0.02"],
        &["plant.slip_mean=0.02", "plant.wheel_error_left=0.01", "controller.drive_lag_s=0.01"],
    ] {
        let answer = robot.set(set);
        let tick = number(&answer, "tick");
        assert!(tick > 0.0 && tick % 5.0 == 0.0, "{answer}");
        for taken in answer["boxes"].as_array().expect("boxes") {
            assert!(text(taken, "name") == "planner" || number(taken, "tick") == tick, "{answer}");
        }
    }
    // Who takes over knows what has changed, and so does who comes after it.
    robot.kill_in_charge();
    robot.set(&["tracking.speed_mps=0.04", "controller.kanayama.k1_per_s=0.5"]);
    robot.kill_in_charge();
    let (summary, expected) = robot.end();
    println!("{summary:#}");
    assert_eq!(number(&summary, "ticks"), expected.ticks as f64);
    assert_eq!(text(&summary, "state_hash"), format!("{:016x}", expected.state_hash));
    assert_eq!((number(&summary, "restarts"), number(&summary, "cycles_without_command")), (2.0, 0.0));
    lab.assert_nothing_left("a drive with changes");
}

/// Without a standby the successor of a killed controller goes on by the file that is in force.
#[test]
fn a_lone_successor_drives_by_what_was_set() {
    let lab = Lab::new();
    let path = laps(&lab, 12);
    let law = "controller.law=navigation-circle";
    let mut robot = Lockstep::start(&lab, &path, &[law, "estimator.kind=ekf", "camera.delay_ticks=30"]);
    robot.set(&["controller.navigation-circle.proportional_per_rad=1.2", "tracking.speed_mps=0.035"]);
    robot.kill_in_charge();
    robot.set(&["estimator.slip_noise=0.001", "camera.delay_ticks=50", "estimator.history_ticks=300"]);
    robot.kill_in_charge();
    let (summary, expected) = robot.end();
    assert_eq!(number(&summary, "ticks"), expected.ticks as f64, "{summary}");
    assert_eq!(text(&summary, "state_hash"), format!("{:016x}", expected.state_hash));
    lab.assert_nothing_left("a drive with changes and no standby");
}
