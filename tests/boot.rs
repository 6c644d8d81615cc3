//! The units on a machine that has booted with systemd: started, watched, restarted, stopped.

mod support;

use std::path::Path;
use support::machine::{ACCOUNT, Machine, PROGRAM};
use support::{Lab, wait_until};

const UNIT: &str = "hilare-epuck.service";

/// Writes a robot's units into the machine.
fn install(lab: &Lab, dir: &Path, more: &[&str]) {
    let dir = dir.to_string_lossy();
    let args = ["systemd", "epuck", "--program", PROGRAM, "--run-as", ACCOUNT, "--out", &dir];
    lab.hilare(&[&args[..], more].concat()).expect_code(0);
}

#[track_caller]
fn await_property(machine: &Machine<'_>, unit: &str, name: &str, wanted: &str) {
    let mut last = String::new();
    let what = format!("{name} of {unit} is {wanted}");
    wait_until(&what, || {
        last = machine.property(unit, name);
        last.starts_with(wanted)
    });
}

/// Process id of a service; between two starts it has none.
fn main_pid(machine: &Machine<'_>, unit: &str) -> String {
    let mut pid = String::new();
    wait_until(unit, || {
        pid = machine.property(unit, "MainPID");
        pid != "0"
    });
    pid
}

/// Nothing of a robot is left on the machine.
fn assert_nothing_left(machine: &Machine<'_>) {
    let left =
        machine.run(&["sh", "-c", "ls -d /dev/shm/hilare* /run/hilare-*/* 2>/dev/null; pgrep -a hilare"]);
    assert_eq!(left.stdout, "");
}

#[test]
fn a_robot_is_a_service() {
    let lab = Lab::new();
    let Some(machine) = Machine::boot(&lab, "a_robot_is_a_service", |dir| install(&lab, dir, &[])) else {
        return;
    };
    machine.run(&["systemctl", "start", UNIT]).expect_code(0);
    assert_eq!(machine.property(UNIT, "StatusText"), "disarmed; path idle");
    // From outside its sandbox, under its account, and nobody else.
    machine.hilare(&["arm"]).expect_code(0);
    await_property(&machine, UNIT, "StatusText", "armed");
    machine.run(&[PROGRAM, "status"]).expect_code(2);
    limits_reach_the_workers(&machine);

    machine.run(&["kill", "-KILL", &main_pid(&machine, UNIT)]).expect_code(0);
    await_property(&machine, UNIT, "NRestarts", "1");
    await_property(&machine, UNIT, "ActiveState", "active");
    assert_eq!(machine.property(UNIT, "StatusText"), "disarmed; path idle", "a restart does not arm");
    machine.run(&["kill", "-STOP", &main_pid(&machine, UNIT)]).expect_code(0);
    await_property(&machine, UNIT, "NRestarts", "2");
    await_property(&machine, UNIT, "ActiveState", "active");
    let journal = machine.run(&["journalctl", "--unit", UNIT, "--no-pager", "--output=cat"]).stdout;
    assert!(journal.contains("Watchdog timeout"), "{journal}");

    machine.hilare(&["estop"]).expect_code(0);
    machine.run(&["systemctl", "restart", UNIT]).expect_code(0);
    assert!(machine.property(UNIT, "StatusText").starts_with("e-stop"), "latched through a restart");
    machine.hilare(&["reset"]).expect_code(0);

    machine.hilare(&["down"]).expect_code(0);
    await_property(&machine, UNIT, "ActiveState", "inactive");
    assert_eq!(machine.property(UNIT, "Result"), "success", "an operator's down is no failure");
    assert_nothing_left(&machine);

    machine.run(&["systemctl", "start", UNIT]).expect_code(0);
    machine.run(&["systemctl", "stop", UNIT]).expect_code(0);
    assert_eq!(machine.property(UNIT, "Result"), "success");
    let journal = machine.run(&["journalctl", "--unit", UNIT, "--no-pager", "--output=cat"]).stdout;
    assert!(!journal.contains("timed out. Killing"), "every end was in time: {journal}");
    assert_nothing_left(&machine);
}

/// What the unit promises the kernel gives, as far as this machine's service manager may promise it.
fn limits_reach_the_workers(machine: &Machine<'_>) {
    let limits = machine.run(&["cat", &format!("/proc/{}/limits", main_pid(machine, UNIT))]).stdout;
    let limit = |name: &str| {
        limits.lines().find(|line| line.starts_with(name)).map(str::to_owned).unwrap_or_default()
    };
    let status = machine.hilare(&["status"]).expect_code(0).stdout;
    if limit("Max realtime priority").split_whitespace().nth(3) != Some("80") {
        support::skip("limits_reach_the_workers", "no capability to raise limits here (CAP_SYS_RESOURCE)");
        return;
    }
    assert!(limit("Max locked memory").contains("unlimited"), "{limits}");
    let step_generator = status.lines().find(|line| line.contains("step_generator")).expect("it is there");
    assert!(step_generator.contains("fifo:80") && step_generator.contains("mlock"), "{status}");
}

#[test]
fn every_process_is_a_service() {
    let lab = Lab::new();
    let test = "every_process_is_a_service";
    let Some(machine) = Machine::boot(&lab, test, |dir| install(&lab, dir, &["--split"])) else { return };
    let (target, launch, controller) =
        ("hilare-epuck.target", "hilare-epuck-launch.service", "hilare-epuck-controller.service");
    machine.run(&["systemctl", "start", target]).expect_code(0);
    assert_eq!(
        machine.property(launch, "StatusText"),
        "disarmed; path idle",
        "the target is up when the robot is"
    );
    machine.hilare(&["arm"]).expect_code(0);
    let status = machine.hilare(&["status"]).expect_code(0).stdout;
    // Raised by systemd itself: no limit has to allow it.
    for (process, fifo) in [("step_generator", "fifo:80"), ("controller", "fifo:60")] {
        let line = status.lines().find(|line| line.contains(process)).expect("it is there");
        assert!(line.contains(fifo), "{status}");
    }

    // A worker comes back by systemd, launch stays.
    let (before, old) = (main_pid(&machine, launch), main_pid(&machine, controller));
    machine.run(&["kill", "-KILL", &old]).expect_code(0);
    await_property(&machine, controller, "NRestarts", "1");
    let new = main_pid(&machine, controller);
    wait_until("launch has taken it on", || {
        machine
            .hilare(&["status"])
            .stdout
            .lines()
            .any(|line| line.contains("controller") && line.contains(&new))
    });
    assert_eq!(main_pid(&machine, launch), before);

    // Launch is lost: everybody comes back.
    machine.run(&["kill", "-KILL", &before]).expect_code(0);
    await_property(&machine, launch, "NRestarts", "1");
    await_property(&machine, launch, "StatusText", "disarmed");
    await_property(&machine, launch, "ActiveState", "active");

    // Launch goes first and stops the robot; nobody fails, nobody comes back.
    machine.hilare(&["arm"]).expect_code(0);
    machine.run(&["systemctl", "stop", target]).expect_code(0);
    for unit in [launch, controller, "hilare-epuck-step_generator.service", "hilare-epuck-plant.service"] {
        await_property(&machine, unit, "ActiveState", "inactive");
        assert_eq!(machine.property(unit, "Result"), "success", "{unit}");
    }
    assert_nothing_left(&machine);

    machine.run(&["systemctl", "start", target]).expect_code(0);
    machine.hilare(&["down"]).expect_code(0);
    for unit in [launch, controller] {
        await_property(&machine, unit, "ActiveState", "inactive");
    }
    assert_nothing_left(&machine);
}
