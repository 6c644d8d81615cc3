use super::super::{Spread, WireRate};
use super::*;
use proptest::prelude::*;

const PLAIN: Style = Style { colour: false, blocks: false };

fn process(name: &str, law: Option<&str>, authority: bool) -> Process {
    Process {
        slot: Some(3),
        name: name.to_owned(),
        law: law.map(str::to_owned),
        pid: 4_194_304,
        state: "running".to_owned(),
        authority,
        granted: "fifo:80 cpu:1 mlock".to_owned(),
        cpu_percent: Some(12.34),
        resident_bytes: Some(5 << 20),
        hz: Some(1000.2),
        lateness_us: Spread { p50: Some(26.6), p99: Some(61.4), max: Some(1911.9) },
        step_us: Spread { p50: Some(3.0), p99: Some(9.0), max: Some(40.0) },
        ..Process::default()
    }
}

fn driving() -> Shown {
    let wire = |name| WireRate { name, hz: 1000.0 };
    Shown {
        robot: "mule".to_owned(),
        version: "0.1.0".to_owned(),
        launch_pid: 4711,
        clock: "real".to_owned(),
        mode: "armed".to_owned(),
        drive: "command".to_owned(),
        uptime_s: 3754.9,
        tick: 12_345,
        path_state: "tracking".to_owned(),
        waypoint: 3,
        waypoint_last: 42,
        in_charge: Some("kanayama".to_owned()),
        standby: Some("qp".to_owned()),
        pose: Some([0.1234, -0.5, 1.5]),
        speed_mps: 0.04,
        cross_track_m: Some(0.003_12),
        cross_track_truth_m: Some(-0.0034),
        lateness_bars: [0, 0, 3, 100, 1000, 20, 0, 0, 0, 0, 0, 1],
        processes: vec![
            process("step_generator", None, false),
            process("controller", Some("kanayama"), true),
            process("controller", Some("navigation-circle"), false),
        ],
        wires: "path reference command authority steps wheels fix pose truth".split(' ').map(wire).collect(),
        ..Shown::default()
    }
}

fn all(shown: &Shown, width: usize, height: usize) -> String {
    lines(shown, width, height, PLAIN).join("\n")
}

#[test]
fn a_frame_says_how_the_robot_fares() {
    let text = all(&driving(), 80, 24);
    for said in [
        "mule  armed, command   up 01:02:34   real clock   launch 4711 (0.1.0)",
        "path   tracking, waypoint 3 of 42   in charge kanayama   standby qp",
        "pose   x 0.1234 m  y -0.5000 m  heading 1.500 rad   0.0400 m/s  0.000 rad/s",
        "track  estimate 3.12 mm left   truth 3.40 mm right   swaps 0  restarts 0",
        "controller* kanayama",
        "4194304 running ",
        "12.3  5.0M  1000     61   1912   0",
        "wires/s  path 1000  reference 1000",
        "late us",
        "1124 ticks to 12345",
    ] {
        assert!(text.contains(said), "{said:?} is not in\n{text}");
    }
}

#[test]
fn a_wide_terminal_shows_more_and_a_narrow_one_the_same_cut() {
    let (wide, normal) = (all(&driving(), 132, 40), all(&driving(), 80, 24));
    for more in ["SCHED", "f80 c1 m", "P50us", "STEP99us", "navigation-circle"] {
        assert!(wide.contains(more), "{more} is not in\n{wide}");
    }
    assert!(!normal.contains("STEP99us") && normal.contains("controller navigation-cir~"), "{normal}");
    let narrow = lines(&driving(), 30, 10, PLAIN);
    assert_eq!(narrow.len(), 10);
    assert!(narrow[9].starts_with('(') && narrow[9].contains("more lines"), "{narrow:?}");
    assert_eq!(lines(&driving(), 0, 0, PLAIN), [""; 0]);
}

#[test]
fn what_is_wrong_is_said_and_what_is_not_known_is_a_dash() {
    let mut shown = driving();
    shown.fault = Some("plant was killed (signal 9)".to_owned());
    shown.in_charge = None;
    shown.pose = None;
    (shown.cross_track_m, shown.cross_track_truth_m) = (None, None);
    shown.lateness_bars = [0; crate::top::BARS];
    shown.processes = vec![Process {
        slot: Some(1),
        name: "relay".to_owned(),
        state: "dead".to_owned(),
        reason: "ended\u{1b}[2J with code 1".to_owned(),
        ..Process::default()
    }];
    let text = all(&shown, 132, 24);
    for said in [
        "fault  plant was killed (signal 9)",
        "no controller in charge",
        "not known before the robot is armed",
        "track  no path",
        "no tick since the last look",
    ] {
        assert!(text.contains(said), "{said:?} is not in\n{text}");
    }
    let relay = text.lines().find(|line| line.starts_with("relay")).expect("its line");
    assert!(relay.contains(" - ") && relay.contains("dead") && relay.contains("with code 1"), "{relay}");
    assert!(!text.contains('\u{1b}'), "the words of a process move no cursor: {text:?}");
}

#[test]
fn colours_are_there_only_if_they_are_wanted() {
    let coloured = lines(&driving(), 80, 24, Style { colour: true, blocks: true }).join("\n");
    assert!(coloured.contains("\u{1b}[32marmed\u{1b}[0m") && coloured.contains('█'), "{coloured}");
    let text = all(&driving(), 80, 24);
    assert!(text.is_ascii() && !text.contains('\u{1b}'), "{text}");
}

/// Without what moves no cursor.
fn columns(line: &str) -> usize {
    let mut rest = line;
    let mut columns = 0;
    while let Some(at) = rest.find('\u{1b}') {
        columns += rest[..at].chars().count();
        rest = rest[at..].split_once('m').map_or("", |(_, rest)| rest);
    }
    columns + rest.chars().count()
}

proptest! {
    #[test]
    fn no_size_and_no_word_breaks_the_frame(
        width in 0usize..200, height in 0usize..60, colour: bool, words in ".{0,40}", wide: f64, count: u64,
    ) {
        let mut shown = driving();
        shown.robot = words.clone();
        shown.fault = Some(words.clone());
        shown.processes[1].reason = words.clone();
        shown.processes[2].law = Some(words);
        shown.processes[0].cpu_percent = Some(wide);
        shown.uptime_s = wide;
        shown.pose = Some([wide; 3]);
        shown.lateness_bars[4] = count / 20;
        shown.processes[0].resident_bytes = Some(count);
        let lines = lines(&shown, width, height, Style { colour, blocks: colour });
        prop_assert!(lines.len() <= height);
        for line in &lines {
            prop_assert!(columns(line) <= width, "{line:?}");
            prop_assert!(!line.contains('\n') && !line.contains('\r'));
        }
    }
}

#[test]
fn the_lateness_of_a_plant_has_its_footnote() {
    let mut shown = driving();
    assert!(!all(&shown, 80, 40).contains("2 ms late is meant"));
    shown.processes.push(process("plant", None, false));
    assert!(all(&shown, 80, 40).contains("nobody waits for it: 2 ms late is meant"));
}
