//! Controllers that die, stop, or lie beside the one in charge.

use crate::faults::cast::{Beside, GREED, Role, Witness};
use crate::faults::drive::{Drive, Told, simulated, sleep_ms, unless_spoilt};
use crate::faults::host::{Bystanders, HostWatch};
use crate::faults::seeds::{self, Draw, Figures};
use crate::faults::watch::drive;
use crate::support::{Lab, number, process, skip, text, whole_machine};
use hilare_interfaces::messages::{Drive as Why, Steps};
use rustix::process::Signal;

/// A way with two corners, about seven seconds.
pub const CORNERS: &str = "x,y\n0,0\n0.15,0\n0.15,0.1\n0.22,0.1\n";

/// The end of a process: killed, aborted as by a panic, crashed, or standing still. (A segmentation fault that
/// is only sent is taken by the standard library for nothing.)
fn blow(draw: &mut Draw) -> Signal {
    draw.random.pick(&[Signal::KILL, Signal::ABORT, Signal::ILL, Signal::STOP])
}

/// Strikes the controller in charge again and again, as soon as it has a warm standby, until the way is
/// nearly over. How often.
fn strike_on(robot: &mut Drive<'_>, draw: &mut Draw, until: u64) -> u32 {
    let mut blows = 0;
    robot.await_tick(300);
    while robot.witness.newest().tick + 1000 < until {
        robot.await_standby();
        sleep_ms(draw.random.whole(30, 300));
        let signal = blow(draw);
        let before = robot.strike("controller", signal);
        draw.note(&format!("{signal:?} at about tick {}", before.tick));
        blows += 1;
        sleep_ms(20);
    }
    blows
}

#[test]
fn a_standby_of_the_same_law_leaves_no_trace() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.file("corners.csv", CORNERS);
    let job = ["--path", &*path.to_string_lossy()];
    let expected = simulated(&lab, &job);
    let row = "active controller killed, stopped, late, silent, not a number; standby of the same law";
    seeds::each_real(row, 1..=10, |draw, figures| {
        let (told, blows) = unless_spoilt(figures, |attempt| {
            let suffix = format!("a{}x{attempt}", draw.seed());
            let with_standby = [&job[..], &["--standby", "kanayama"]].concat();
            let mut robot = Drive::start(&lab, &suffix, &with_standby, &[]);
            let blows = strike_on(&mut robot, draw, expected["ticks"].as_u64().expect("ticks"));
            Ok((robot.end(0).no_cycle_lost()?.same_bits(&expected)?, blows))
        });
        figures.sum("{} controllers killed or stopped", f64::from(blows));
        figures.sum("{} cycles lost", number(&told.summary, "cycles_without_command"));
    });
    lab.assert_nothing_left("drives with a standby");
}

#[test]
fn a_standby_of_another_law_takes_over_within_the_accelerations() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.file("corners.csv", CORNERS);
    let job = ["--path", &*path.to_string_lossy(), "--standby", "qp"];
    let (accel, turn) = (0.8, 12.0);
    seeds::each_real(
        "active controller killed or stopped; standby is the predictive law",
        1..=10,
        |draw, figures| {
            let told = unless_spoilt(figures, |attempt| {
                let set = [format!("limits.accel_mps2={accel}"), format!("limits.accel_radps2={turn}")];
                let suffix = format!("o{}x{attempt}", draw.seed());
                let mut robot = Drive::start(&lab, &suffix, &job, &[&set[0], &set[1]]);
                strike_on(&mut robot, draw, 5000);
                robot.end(0).no_cycle_lost()
            });
            let pairs = told.seen.windows(2).map(|pair| (pair[0].steps, pair[1].steps));
            let mut changes = 0;
            for (was, is) in pairs.filter(|(was, is)| is.tick == was.tick + 1 && drive(is) == Why::Command) {
                let change = [(is.twist[0] - was.twist[0]).abs(), (is.twist[2] - was.twist[2]).abs()];
                assert!(
                    change[0] <= accel * 1e-3 + 1e-9 && change[1] <= turn * 1e-3 + 1e-9,
                    "{was:?} {is:?}"
                );
                changes += u32::from(was.source != is.source && was.source != 0);
            }
            assert!(changes > 0, "no controller took over: {}", told.log);
            figures.sum("{} cycles lost", number(&told.summary, "cycles_without_command"));
            figures.sum("{} changes of controller, each within the accelerations", f64::from(changes));
        },
    );
    lab.assert_nothing_left("drives with a standby of another law");
}

/// After each of these ticks the controller was gone: it held, it ramped in time.
fn held_and_ramped(told: &Told, struck: &[u64], figures: &mut Figures) {
    for tick in struck {
        let first =
            |wanted: Why| told.after(*tick).find(|steps| drive(steps) == wanted).map(|steps| steps.tick - 1);
        let hold = first(Why::Hold).unwrap_or_else(|| panic!("it did not hold after {tick}: {}", told.log));
        // The command before acts for its period: the pose at which that began was the first left unanswered.
        let unanswered = hold - 5;
        let Some(ramp) = first(Why::Ramp).filter(|ramp| *ramp < hold + 100) else { continue };
        let between = told.after(hold).take_while(|steps| steps.tick <= ramp);
        assert!(between.into_iter().all(|steps| drive(steps) == Why::Hold), "it held until it ramped");
        assert!(ramp - unanswered <= 15, "the ramp starts {} ticks after the pose", ramp - unanswered);
        figures
            .most("ramp starts ≤ {} ticks after the first pose left unanswered", (ramp - unanswered) as f64);
    }
}

/// Kills the only controller while launch stands still, so that none succeeds it; for less than the 75 ticks of
/// launch's lease, which may be 20 old. The last tick seen before, and whether the host has kept bystanders waiting meanwhile.
fn strike_without_successor(robot: &mut Drive<'_>) -> (u64, bool) {
    let controller = robot.pid("controller");
    let host = Bystanders::start();
    robot.run.signal(Signal::STOP);
    let before = robot.witness.newest().tick;
    process::signal(controller, Signal::KILL);
    sleep_ms(50);
    robot.run.signal(Signal::CONT);
    (before, host.end().boxes_ever())
}

/// The robot ramped in time after the tick before the controller was killed.
fn ramped(told: &Told, struck: u64) -> u64 {
    let ramp = told.after(struck).find(|steps| drive(steps) == Why::Ramp);
    let ramp = ramp.unwrap_or_else(|| panic!("no ramp after {struck}: {}", told.log)).tick - 1;
    let mut until = told.after(struck).take_while(|steps| steps.tick <= ramp);
    assert!(until.all(|steps| matches!(drive(steps), Why::Command | Why::Hold)), "it drove, held and ramped");
    ramp - struck
}

/// Ticks from a kill to the ramp: 15 from the first pose left unanswered, which comes within a period; and the
/// tick of the kill is known from the witness, who is a tick or two behind.
const RAMP_TICKS: u64 = 15 + 5 + 2;

/// A drive on which the only controller is killed again and again, the last time without a successor.
struct Alone {
    told: Told,
    /// The last tick seen before each kill.
    struck: Vec<u64>,
    /// How late the machine itself was meanwhile, ms; of all kills but the last.
    worst_ms: Vec<f64>,
    ramp_ticks: u64,
}

fn drive_alone(mut robot: Drive<'_>, draw: &mut Draw) -> Result<Alone, String> {
    robot.await_tick(300);
    let (host, mut struck, mut worst_ms) = (HostWatch::start(), Vec::new(), Vec::new());
    for restarts in 1..=6 {
        sleep_ms(draw.random.whole(100, 400));
        host.worst_ms();
        struck.push(robot.strike("controller", Signal::KILL).tick);
        robot.await_successor("controller", restarts);
        worst_ms.push(host.worst_ms());
    }
    sleep_ms(draw.random.whole(100, 400));
    let (last, stalled) = strike_without_successor(&mut robot);
    struck.push(last);
    let told = robot.end(0);
    assert_eq!(told.summary["reached"], true);
    let ramp_ticks = ramped(&told, last);
    // A witness that is kept waiting by the host knows of an older tick only.
    if ramp_ticks > RAMP_TICKS && stalled {
        return Err(format!("the ramp starts {ramp_ticks} ticks after the last tick seen"));
    }
    Ok(Alone { told, struck, worst_ms, ramp_ticks })
}

#[test]
fn alone_it_holds_and_ramps_and_is_soon_back() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.file("corners.csv", CORNERS);
    let job = ["--path", &*path.to_string_lossy()];
    let (mut quiet_ms, mut all_ms) = (Vec::new(), Vec::<f64>::new());
    let row = "active controller killed or stopped; no standby";
    seeds::each_real(row, 2..=10, |draw, figures| {
        let Alone { told, struck, worst_ms, ramp_ticks } = unless_spoilt(figures, |attempt| {
            drive_alone(Drive::start(&lab, &format!("l{}x{attempt}", draw.seed()), &job, &[]), draw)
        });
        assert!(ramp_ticks <= RAMP_TICKS, "the ramp starts {ramp_ticks} ticks after the kill");
        held_and_ramped(&told, &struck, figures);
        let mut outages = told.outages_ms();
        assert_eq!(outages.len(), struck.len(), "{}", told.log);
        figures.most("ramp starts ≤ {} ticks after the kill where no successor comes", ramp_ticks as f64);
        figures.sum("{} kills", outages.len() as f64);
        // For the last one launch stood still.
        outages.pop();
        all_ms.extend(&outages);
        // Where a bare sleep was late by this much, the successor was, too.
        quiet_ms.extend(outages.iter().zip(&worst_ms).filter(|(_, late)| **late < 5.0).map(|(ms, _)| *ms));
        figures.most("ready again after ≤ {} ms", outages.iter().copied().fold(0.0, f64::max));
    });
    println!("outages {all_ms:?}, while the machine itself was in time {quiet_ms:?}");
    quiet_ms.sort_by(f64::total_cmp);
    let test = "ready again ≤ 50 ms";
    match quiet_ms.get(quiet_ms.len() * 99 / 100) {
        Some(p99) if cfg!(debug_assertions) => skip(test, &format!("a debug build; it took {p99} ms")),
        Some(p99) => assert!(*p99 <= 50.0, "{p99} ms until a successor is ready: {quiet_ms:?}"),
        None => skip(test, "the machine itself was late by 5 ms and more every time"),
    }
    lab.assert_nothing_left("drives without a standby");
}

#[test]
fn a_woken_zombie_is_not_heard() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.file("corners.csv", CORNERS);
    let job = ["--path", &*path.to_string_lossy()];
    let expected = simulated(&lab, &job);
    seeds::each_real("stopped controller, woken when another is in charge", 1..=10, |draw, figures| {
        let (told, before, heard) = unless_spoilt(figures, |attempt| {
            let suffix = format!("z{}x{attempt}", draw.seed());
            let mut robot =
                Drive::start(&lab, &suffix, &[&job[..], &["--standby", "kanayama"]].concat(), &[]);
            robot.await_tick(draw.random.whole(300, 4000));
            robot.await_standby();
            let zombie = robot.pid("controller");
            let before = robot.witness.newest();
            // Launch must not see it, or it would replace it.
            robot.run.signal(Signal::STOP);
            process::signal(zombie, Signal::STOP);
            while robot.witness.newest().promotions == before.promotions && robot.run.lives() {
                sleep_ms(1);
            }
            process::signal(zombie, Signal::CONT);
            sleep_ms(12);
            let heard = robot.witness.newest();
            robot.run.signal(Signal::CONT);
            Ok((robot.end(0).same_bits(&expected)?, before, heard))
        });
        let ignored = heard.commands_rejected - before.commands_rejected;
        assert!(ignored > 0, "the zombie said nothing");
        assert_ne!((heard.in_charge, heard.epoch), (before.in_charge, before.epoch));
        let since = told.after(before.tick).skip_while(|steps| steps.promotions == before.promotions);
        let mut while_it_spoke = since.take_while(|steps| steps.tick <= heard.tick);
        assert!(while_it_spoke.all(|steps| steps.source == heard.in_charge), "the zombie drives");
        figures.sum("{} commands of woken zombies refused, same bits", ignored as f64);
    });
    lab.assert_nothing_left("drives with zombies");
}

#[test]
fn liars_on_the_wire_are_not_heard() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.file("corners.csv", CORNERS);
    let job = ["--path", &*path.to_string_lossy()];
    let expected = simulated(&lab, &job);
    let rows = ["lower epoch, wrong source, old or repeated seq", "command NaN, infinite"];
    seeds::all_real(&rows, 1..=10, |draw, figures| {
        let (told, lies) = unless_spoilt(figures, |attempt| {
            let mut robot = Drive::start(&lab, &format!("n{}x{attempt}", draw.seed()), &job, &[]);
            robot.await_tick(100);
            let liar = Beside::start(&lab, &robot.robot, Role::Liar);
            robot.await_tick(5000);
            let lies: f64 = liar.end().parse().expect("how many lies");
            Ok((robot.end(0).same_bits(&expected)?, lies))
        });
        assert!(lies > 1000.0, "{lies} lies only");
        assert_eq!(number(&told.summary, "commands_rejected"), lies, "each is counted");
        figures.sum("{} commands of six kinds of liars refused and counted, same bits", lies);
    });
    lab.assert_nothing_left("drives beside liars");
}

#[test]
fn a_flood_of_commands_keeps_nobody_from_being_heard() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.file("corners.csv", CORNERS);
    let job = ["--path", &*path.to_string_lossy(), "--standby", "kanayama"];
    let expected = simulated(&lab, &job[..2]);
    seeds::each_real("flood of commands of a stranger", 1..=10, |draw, figures| {
        let (told, sent) = unless_spoilt(figures, |attempt| {
            let suffix = format!("f{}x{attempt}", draw.seed());
            // Its wire is there before those of the robot: who reads in order reads it first.
            let flooder = Beside::start(&lab, &lab.robot_named(&suffix), Role::Flooder);
            let mut robot = Drive::start(&lab, &suffix, &job, &[]);
            for kills in 1..=4 {
                robot.await_tick(1000 * kills);
                robot.await_standby();
                robot.strike("controller", Signal::KILL);
            }
            robot.await_tick(5000);
            // No place on the wire has become free for this one: it comes last.
            lab.hilare(&["swap", "controller", "kanayama", "--robot", &robot.robot]).expect_code(0);
            let sent: f64 = flooder.end().parse().expect("how many commands");
            Ok((robot.end(0).no_cycle_lost()?.same_bits(&expected)?, sent))
        });
        let refused = number(&told.summary, "commands_rejected");
        // More than a reader takes who stops at 16 a tick, and so does not come to the others.
        assert!(refused > 16.0 * 5000.0, "{sent} commands, {refused} read, are no flood");
        figures.sum("{} commands sent beside the drive, 4 kills and a swap, same bits", sent);
    });
    lab.assert_nothing_left("drives beside a flood");
}

/// The diagonal of wheel speeds, [MH18] (18)–(24), from the wheels: what a command is cut down to.
fn cut_down([v, omega]: [f64; 2]) -> [f64; 2] {
    let [v, omega] = [v.clamp(0.0, V_MAX_MPS), omega.clamp(-OMEGA_MAX_RADPS, OMEGA_MAX_RADPS)];
    let fastest = v.abs() + omega.abs() * TRACK_M / 2.0;
    let shrink = (WHEEL_MAX_MPS / fastest).min(1.0);
    [v * shrink, omega * shrink]
}

/// The e-puck, whose limits are set wider than its wheels allow.
const V_MAX_MPS: f64 = 0.06;
const OMEGA_MAX_RADPS: f64 = 2.0;
const TRACK_M: f64 = 0.054;
const WHEEL_MAX_MPS: f64 = 3.25 * 0.02;

#[test]
fn what_asks_for_too_much_gets_what_the_wheels_can_do_on_the_same_curve() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.straight(1.0).to_string_lossy().into_owned();
    seeds::each_real("command over the limits", 1..=10, |draw, figures| {
        let robot = lab.robot_named(&format!("x{}", draw.seed()));
        let tell = |args: &[&str]| lab.hilare(&[args, &["--robot", &robot]].concat()).expect_code(0);
        let set =
            [format!("limits.v_max_mps={V_MAX_MPS}"), format!("limits.omega_max_radps={OMEGA_MAX_RADPS}")];
        let keep = "timing.pause_stop_ticks=0";
        tell(&["up", "--detach", "--set", &set[0], "--set", &set[1], "--set", keep]);
        tell(&["follow", &path]);
        let mut witness = Witness::start(&lab, &robot);
        tell(&["arm"]);
        witness.await_tick(draw.random.whole(200, 800));
        let greedy = Beside::start(&lab, &robot, Role::Greedy);
        let from = witness.newest().tick;
        witness.await_tick(from + 2000);
        let to = witness.newest().tick;
        let sent: f64 = greedy.end().parse().expect("how many commands");
        tell(&["down"]);
        let seen = witness.end();
        let wanted = GREED.map(cut_down);
        let is = |steps: &Steps, [v, omega]: [f64; 2]| {
            (steps.twist[0] - v).abs() < 1e-12 && (steps.twist[2] - omega).abs() < 1e-12
        };
        let mut times = [0u32; GREED.len()];
        for steps in seen.iter().map(|seen| &seen.steps) {
            let rim = [1.0, -1.0].map(|side| steps.twist[0] + side * steps.twist[2] * TRACK_M / 2.0);
            assert!(rim.iter().all(|speed| speed.abs() <= WHEEL_MAX_MPS + 1e-12), "{rim:?} m/s: {steps:?}");
        }
        let driven = seen.iter().map(|seen| seen.steps).filter(|steps| (from..to).contains(&steps.tick));
        for steps in driven.filter(|steps| drive(steps) == Why::Command) {
            if let Some(kind) = wanted.iter().position(|wanted| is(&steps, *wanted)) {
                times[kind] += 1;
            } else {
                // The controller itself, until it is outdone.
                assert_eq!(times, [0; GREED.len()], "neither of {wanted:?}: {steps:?}");
            }
        }
        assert!(times.iter().all(|ticks| *ticks > 200), "{times:?} ticks of {sent} commands of each kind");
        figures.sum(
            "{} ticks of commands over the limits, each at the bound, on its curve",
            times.iter().sum::<u32>().into(),
        );
    });
    lab.assert_nothing_left("a robot that is asked for too much");
}

#[test]
fn a_solver_at_its_cap_says_so_and_drives_on() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let path = lab.file("corners.csv", CORNERS);
    let job = ["--path", &*path.to_string_lossy(), "--controller", "qp"];
    seeds::each_real("QP at its iteration cap, hostile path", 1..=10, |draw, figures| {
        let told = unless_spoilt(figures, |attempt| {
            let suffix = format!("q{}x{attempt}", draw.seed());
            let mut robot = Drive::start(&lab, &suffix, &job, &["controller.qp.max_iterations=1"]);
            robot.await_tick(300);
            let status = lab.await_status(&robot.robot, "a degraded controller", |status| {
                let processes = status["processes"].as_array();
                processes.is_some_and(|all| all.iter().any(|one| one["state"] == "degraded"))
            });
            let processes = status["processes"].as_array().expect("processes");
            let degraded = processes.iter().find(|one| one["state"] == "degraded").expect("it");
            assert!(text(degraded, "reason").contains("iteration cap"), "{status}");
            robot.end(0).no_cycle_lost()
        });
        assert_eq!(told.summary["reached"], true);
        let lost = number(&told.summary, "cycles_without_command");
        figures.sum("{} cycles lost, health degraded with the reason, arrived", lost);
    });
    lab.assert_nothing_left("drives with a capped solver");
}
