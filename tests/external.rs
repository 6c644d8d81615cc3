//! Controllers outside of hilare: the wires as they are given to other languages, and the example in Python
//! that drives a robot over them.

mod support;

use hilare_controller::{ControlLaw, LawInputs, LawSetup, TwistLimits, law};
use hilare_interfaces::chassis::{Chassis, DifferentialParams};
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Pose, Reference, ReferenceState, Waypoint};
use rustix::process::Signal;
use serde_json::Value;
use std::ffi::OsString;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use support::random::Random;
use support::{Ended, Lab, Running, number, python_with_iceoryx2, skip};

fn controllers() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/controllers")
}

fn example() -> PathBuf {
    controllers().join("kanayama.py")
}

/// Of an empty configuration iceoryx2 makes its defaults: who read one too early was in another domain, heard nothing
/// and was told nothing.
#[test]
fn who_joins_while_launch_starts_never_sees_half_a_configuration() {
    let lab = Lab::new();
    let path = lab.straight(0.02);
    let robot = lab.robot();
    let file = lab.runtime_dir().join(&robot).join("iceoryx2.toml");
    let mut whole = 0;
    for _ in 0..5 {
        let mut run =
            lab.start(&["run", "--clock", "lockstep", "--robot", &robot, "--path", &path.to_string_lossy()]);
        while run.lives() {
            let Ok(text) = fs::read_to_string(&file) else { continue };
            assert!(text.contains(&format!(".{robot}.")), "half a configuration: {text:?}");
            whole += 1;
        }
        assert_eq!(run.wait(support::PATIENCE).code, Some(0));
    }
    assert!(whole > 0, "it was never there");
}

#[test]
fn the_copies_for_other_languages_are_what_the_command_prints() {
    let lab = Lab::new();
    for (language, file) in [("c", "hilare_wires.h"), ("python", "hilare_wires.py")] {
        let printed = lab.hilare(&["diagram", "--header", language]).expect_code(0).stdout;
        let copy = fs::read_to_string(controllers().join(file)).expect("a copy");
        let update = format!("hilare diagram --header {language} > examples/controllers/{file}");
        assert!(copy == printed, "{file} is out of date: {update}");
    }
    lab.hilare(&["diagram", "--header", "cobol"]).expect_code(2);
    lab.hilare(&["diagram", "--header", "c", "--json"]).expect_code(2);
}

/// What a compiler makes of a program that includes the header; its own checks of sizes and offsets are in it.
fn compile(lab: &Lab, compiler: &str, standard: &str, file: &Path) -> Option<Ended> {
    Command::new(compiler).arg("--version").stdout(Stdio::null()).status().ok()?;
    let mut command = lab.command_of(compiler);
    command.args([standard, "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", "-I"]);
    command.arg(controllers()).arg(file);
    Some(Running::start(command).wait(support::PATIENCE))
}

#[test]
fn the_header_compiles_as_c_and_as_cpp() {
    let lab = Lab::new();
    let body = "#include \"hilare_wires.h\"\n\
        double answer(const hilare_reference* r);\n\
        double answer(const hilare_reference* r) {\n\
            return r->state == HILARE_REFERENCE_STATE_TRACKING ? r->preview[0].x_m * HILARE_TICK_S : 0.0;\n\
        }\n\
        static_assert(sizeof(HILARE_POSE_SERVICE) == sizeof(\"hilare/pose\"), \"a string\");\n";
    let type_name = "static_assert(hilare_pose::IOX2_TYPE_NAME[0] == 'h', \"the binding finds it\");\n";
    let c = lab.file("use.c", body);
    let cpp = lab.file("use.cpp", format!("{body}{type_name}"));
    for (compiler, standard, file) in
        [("cc", "-std=c11", &c), ("c++", "-std=c++17", &cpp), ("c++", "-std=c++20", &cpp)]
    {
        match compile(&lab, compiler, standard, file) {
            Some(ended) => drop(ended.expect_code(0)),
            None => skip("the_header_compiles_as_c_and_as_cpp", &format!("there is no {compiler}")),
        }
    }
    // The checks in it are checks: a message that has grown is refused.
    let header = fs::read_to_string(controllers().join("hilare_wires.h")).expect("the header");
    let grown = header.replacen("    uint64_t measured_tick;", "    uint64_t measured_tick, more;", 1);
    assert_ne!(grown, header);
    if let Some(ended) = compile(&lab, "cc", "-std=c11", &lab.file("grown.c", grown)) {
        assert!(ended.code != Some(0) && ended.stderr.contains("laid out otherwise here"), "{ended:#?}");
    }
}

fn waypoint(random: &mut Random) -> Waypoint {
    // Not of a nearly straight arc: its centre is far away, and so is the last bit of it.
    let bulge = [0.0, 1.0, -1.0][random.whole(0, 2) as usize] * random.real(0.05, 1.5);
    Waypoint { bulge, ..Waypoint::straight(random.real(-0.5, 0.5), random.real(-0.5, 0.5)) }
}

/// The messages as they lie in memory, in hexadecimal: what a program in another language sees.
fn hexadecimal(reference: &Reference, pose: &Pose) -> String {
    let waypoint = |w: &Waypoint| [w.x_m, w.y_m, w.bulge, w.crab_rad].map(f64::to_bits);
    let mut words =
        vec![reference.tick, reference.state, reference.path_id, reference.index, reference.total];
    words.push(reference.speed_mps.to_bits());
    words.extend(waypoint(&reference.last));
    words.extend(waypoint(&reference.current));
    words.push(reference.preview_len);
    words.extend(reference.preview.iter().flat_map(waypoint));
    let reference = bytes(&words);
    let [x, y, theta] = [pose.x_m, pose.y_m, pose.theta_rad].map(f64::to_bits);
    format!("{reference} {}\n", bytes(&[pose.tick, pose.measured_tick, x, y, theta]))
}

fn bytes(words: &[u64]) -> String {
    words.iter().flat_map(|word| word.to_ne_bytes()).map(|byte| format!("{byte:02x}")).collect()
}

fn kanayama() -> (Box<dyn ControlLaw>, Vec<f64>) {
    let spec = law("kanayama").expect("it is in the registry");
    let setup = LawSetup {
        chassis: &Chassis::Differential(DifferentialParams::default()),
        limits: TwistLimits { v_min_mps: 0.0, v_max_mps: 0.041, omega_max_radps: 0.747 },
        acceptance_radius_m: 0.027,
        acceptance: spec.acceptance,
        period_ticks: 5,
        values: &[],
    };
    let gains = ["k1_per_s", "k2_per_m2", "k3_per_m"]
        .map(|name| spec.params.iter().find(|param| param.name == name).expect("a gain of the law").default);
    ((spec.build)(&setup).expect("its own defaults"), gains.to_vec())
}

/// Both evaluate the same formulas; the libraries their sines come from may differ in the last bit.
#[test]
fn the_law_in_python_answers_what_the_law_in_rust_answers() {
    const NAME: &str = "the_law_in_python_answers_what_the_law_in_rust_answers";
    const CASES: usize = 4000;
    let there = Command::new("python3").args(["-c", "import tomllib"]).stderr(Stdio::null()).status();
    if !there.is_ok_and(|status| status.success()) {
        return skip(NAME, "there is no python3 of 3.11 or later");
    }
    let (lab, mut random, (mut law, gains)) = (Lab::new(), Random::new(NAME, 9), kanayama());
    let mut input = String::new();
    let mut expected = Vec::new();
    for tick in 0..CASES as u64 {
        let (last, current) = (waypoint(&mut random), waypoint(&mut random));
        let state = ReferenceState::Tracking.code();
        let reference =
            Reference { tick, state, speed_mps: random.real(0.0, 0.3), last, current, ..Reference::ZERO };
        let (x_m, y_m) = (random.real(-0.5, 0.5), random.real(-0.5, 0.5));
        let pose = Pose { tick, measured_tick: tick, x_m, y_m, theta_rad: random.real(-20.0, 20.0) };
        input.push_str(&hexadecimal(&reference, &pose));
        let inputs = LawInputs { pose: pose.pose(), reference: &reference, acting: BodyTwist::ZERO };
        expected.push(law.step(inputs).twist);
    }
    let mut command = lab.command_of("python3");
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/external_law.py"));
    command.arg(controllers()).args(gains.iter().map(f64::to_string)).env("PYTHONDONTWRITEBYTECODE", "1");
    command.stdin(fs::File::open(lab.file("cases", input)).expect("the cases"));
    let ended = Running::start(command).wait(support::PATIENCE).expect_code(0);
    let answers: Vec<Vec<f64>> =
        ended.stdout.lines().map(|line| line.split(' ').map(real).collect()).collect();
    assert_eq!(answers.len(), CASES);
    let mut same = 0;
    for (i, (answer, expected)) in answers.iter().zip(&expected).enumerate() {
        let off = [answer[0] - expected.vx_mps, answer[1] - expected.omega_radps];
        // omega is k2 times v_r times an error in metres, 1e6 times as large as the speed.
        assert!(off[0].abs() < 1e-14 && off[1].abs() < 1e-8, "case {i}: {answer:?}, {expected:?}");
        same += usize::from(off == [0.0, 0.0]);
    }
    println!("{same} of {CASES} answers have the same bits");
    assert!(same > CASES / 2, "the formulas are the same: {same} of {CASES} have the same bits");
}

fn real(bits: &str) -> f64 {
    f64::from_bits(u64::from_str_radix(bits, 16).expect("the bits of a number"))
}

/// Robots in real time have the cores for themselves, as far as these tests go.
static CORES: Mutex<()> = Mutex::new(());

/// `command` with the Python that has iceoryx2 as `python3`.
fn with_python(mut command: Command, python: &Path) -> Command {
    let mut path = OsString::from(python.parent().expect("a directory"));
    path.push(":");
    path.push(std::env::var_os("PATH").unwrap_or_default());
    command.env("PATH", path).env("PYTHONDONTWRITEBYTECODE", "1");
    command
}

/// The example with one piece of text replaced, in a directory of its own.
fn altered(lab: &Lab, name: &str, file: &str, from: &str, to: &str) -> PathBuf {
    let dir = lab.dir().join(name);
    fs::create_dir(&dir).expect("a directory");
    for each in ["kanayama.py", "hilare_wires.py"] {
        let whole = fs::read_to_string(controllers().join(each)).expect("the example");
        let changed = if each == file { whole.replacen(from, to, 1) } else { whole.clone() };
        assert!(each != file || changed != whole, "{file} has no {from:?}");
        fs::write(dir.join(each), changed).expect("a copy");
    }
    executable(&dir.join("kanayama.py"))
}

fn executable(file: &Path) -> PathBuf {
    fs::set_permissions(file, fs::Permissions::from_mode(0o755)).expect("executable");
    file.to_owned()
}

/// A robot that is up, armed, and on its way for the next four minutes.
struct Driving<'l> {
    lab: &'l Lab,
    name: String,
}

impl<'l> Driving<'l> {
    fn start(lab: &'l Lab, python: &Path) -> Self {
        let name = lab.robot();
        // A shared machine may take the core away for longer than the policy allows.
        let args = ["up", "--detach", "--robot", &name, "--set", "timing.pause_stop_ticks=0"];
        let up = with_python(lab.command(&args), python);
        Running::start(up).wait(support::PATIENCE).expect_code(0);
        let driving = Self { lab, name };
        driving.tell(&["follow", &lab.straight(10.0).to_string_lossy()]).expect_code(0);
        driving.tell(&["arm"]).expect_code(0);
        driving.await_status("it drives", |status| number(status, "speed_mps") > 0.02);
        driving
    }

    fn tell(&self, args: &[&str]) -> Ended {
        self.lab.hilare(&[args, &["--robot", &self.name]].concat())
    }

    fn swap(&self, controller: &Path) -> Ended {
        self.tell(&["swap", "controller", &controller.to_string_lossy()])
    }

    fn await_status(&self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        self.lab.await_status(&self.name, what, wanted)
    }

    /// Pid and command line of the controller in authority.
    fn in_charge(&self) -> (u64, String) {
        let status = self.lab.status(&self.name).expect("it is up");
        let processes = status["processes"].as_array().expect("processes");
        let found: Vec<_> = processes.iter().filter(|process| process["authority"] == true).collect();
        let [one] = found[..] else { panic!("one controller has authority: {status}") };
        let pid = one["pid"].as_u64().expect("a pid");
        let line = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        (pid, String::from_utf8_lossy(&line).replace('\0', " "))
    }

    /// It goes on along its path.
    fn assert_drives_on(&self) {
        let from = number(&self.lab.status(&self.name).expect("it is up"), "tick");
        self.await_status("it drives on", |status| {
            let moving = number(status, "speed_mps") > 0.02 && status["path_state"] == "tracking";
            moving && number(status, "tick") > from + 300.0
        });
    }

    fn down(self, after: &str) {
        self.tell(&["down"]).expect_code(0);
        self.lab.assert_nothing_left(after);
    }
}

#[test]
fn commands_of_another_epoch_are_refused_and_counted() {
    let Some(python) = python_with_iceoryx2("commands_of_another_epoch_are_refused_and_counted") else {
        return;
    };
    let _cores = CORES.lock().unwrap_or_else(PoisonError::into_inner);
    let lab = Lab::new();
    let robot = Driving::start(&lab, &python);
    let dir = lab.runtime_dir().join(&robot.name);
    let mut command = with_python(lab.command_of(example()), &python);
    command.env("HILARE_ROBOT", &robot.name).env("HILARE_ICEORYX2_CONFIG", dir.join("iceoryx2.toml"));
    command.env("HILARE_SYSTEM", dir.join("system-1.toml")).env("HILARE_PERIOD_TICKS", "5");
    command.env("HILARE_SOURCE", "1").env("HILARE_EPOCH", "4242");
    let mut stranger = Running::start(command);
    robot.await_status("its commands are refused", |status| number(status, "commands_rejected") > 200.0);
    robot.assert_drives_on();
    assert!(stranger.lives());
    stranger.signal(Signal::TERM);
    let ended = stranger.wait(support::PATIENCE).expect_code(0);
    assert_eq!((ended.stdout, ended.stderr), (String::new(), String::new()));
    robot.assert_drives_on();
    robot.down("a stranger on the wires");
}

/// Along a corner and an arc; ends where the law of the same name ends in one thread.
#[test]
fn a_run_driven_from_python_is_a_run_of_the_law() {
    let Some(python) = python_with_iceoryx2("a_run_driven_from_python_is_a_run_of_the_law") else { return };
    let _cores = CORES.lock().unwrap_or_else(PoisonError::into_inner);
    let lab = Lab::new();
    let path = lab.file("path.csv", "x,y,bulge\n0,0,0\n0.2,0,0\n0.3,0.1,0.4142135623730951\n0.3,0.2,0\n");
    let run = |controller: &Path, clock: &str| -> Value {
        let [path, controller] = [&path, controller].map(|path| path.to_string_lossy().into_owned());
        let mut args =
            vec!["run", "rectangle", "--path", &path, "--controller", &controller, "--clock", clock];
        let robot = lab.robot_named(clock);
        args.extend(["--json", "--robot", &robot, "--set", "timing.pause_stop_ticks=0"]);
        let ended = Running::start(with_python(lab.command(&args), &python)).wait(Duration::from_secs(120));
        serde_json::from_str(&ended.expect_code(0).stdout).expect("JSON")
    };
    let wanted = run(Path::new("kanayama"), "in-process");
    let driven = run(&example(), "real");
    assert!(wanted["reached"] == true && driven["reached"] == true, "{driven}");
    assert_eq!(driven["restarts"], 0);
    let [wanted_mean, driven_mean] = [&wanted, &driven].map(|run| number(run, "cross_track_mean_m"));
    assert!((driven_mean - wanted_mean).abs() < 0.1 * wanted_mean, "{driven}\n{wanted}");
    let bits = if wanted["state_hash"] == driven["state_hash"] { "the same bits" } else { "other bits" };
    println!("{bits}, {} commands late", driven["commands_late"]);
    lab.assert_nothing_left("runs driven from Python");
}

#[test]
fn a_controller_in_python_takes_over_while_driving_and_hands_back() {
    let name = "a_controller_in_python_takes_over_while_driving_and_hands_back";
    let Some(python) = python_with_iceoryx2(name) else { return };
    let _cores = CORES.lock().unwrap_or_else(PoisonError::into_inner);
    let lab = Lab::new();
    let robot = Driving::start(&lab, &python);
    robot.swap(&example()).expect_code(0);
    let (pid, line) = robot.in_charge();
    assert!(line.contains("kanayama.py"), "{pid}: {line}");
    robot.assert_drives_on();
    // What the kernel has granted it is seen from outside, and is the processor at least.
    robot.await_status("its grants are shown", |status| {
        let all = status["processes"].as_array().expect("processes");
        let granted = |one: &&Value| one["granted"].as_str().is_some_and(|text| text.contains("cpu:"));
        all.iter().filter(|one| one["authority"] == true).all(|one| granted(&one))
    });
    robot.swap(Path::new("kanayama")).expect_code(0);
    assert!(!robot.in_charge().1.contains("kanayama.py"), "{:?}", robot.in_charge());
    robot.assert_drives_on();
    let left = |lab: &Lab| lab.processes().iter().any(|(_, line)| line.contains("kanayama.py"));
    support::wait_until("the controller in Python ends", || !left(&lab));
    robot.down("a swap to Python and back");
}

#[test]
fn a_swap_to_a_controller_that_is_no_good_leaves_the_old_one_in_charge() {
    let name = "a_swap_to_a_controller_that_is_no_good_leaves_the_old_one_in_charge";
    let Some(python) = python_with_iceoryx2(name) else { return };
    let _cores = CORES.lock().unwrap_or_else(PoisonError::into_inner);
    let lab = Lab::new();
    let robot = Driving::start(&lab, &python);
    let old = robot.in_charge();
    let script = |file: &str, text: &str| executable(&lab.file(file, format!("#!/bin/sh\n{text}\n")));
    // A layout no build has.
    let other = altered(&lab, "other", "hilare_wires.py", "Reference, None, \"", "Reference, None, \"x");
    for cannot_start in [lab.dir().join("absent"), lab.file("not-executable", "#!/bin/sh\n")] {
        let ended = robot.swap(&cannot_start);
        let name = cannot_start.file_name().unwrap_or_default().to_string_lossy();
        assert!(matches!(ended.code, Some(1 | 2)) && ended.stderr.contains(&*name), "{name}: {ended:#?}");
    }
    let no_good = [
        (script("crashes", "exit 3"), "ended with code 3"),
        (script("hangs", "exec sleep 600"), "did not answer"),
        (other, "ended with code"),
        (altered(&lab, "late", "kanayama.py", "LOOK_S = 0.0005", "LOOK_S = 0.02"), ""),
        (altered(&lab, "nan", "kanayama.py", "vx_mps=v,", "vx_mps=math.nan,"), "not a finite number"),
        (
            altered(&lab, "misdated", "kanayama.py", "pose.tick + period)", "pose.tick + period + 1)"),
            "effective_tick is not a multiple of the control period",
        ),
    ];
    for (newcomer, why) in no_good {
        let ended = robot.swap(&newcomer);
        assert!(ended.stderr.contains(why), "{why}: {ended:#?}");
        assert!(ended.stderr.starts_with("hilare: refused: "), "{}: {ended:#?}", newcomer.display());
        assert_eq!((ended.code, ended.complaints().len()), (Some(1), 1), "{}", newcomer.display());
        assert_eq!(robot.in_charge(), old, "after {}: {}", newcomer.display(), ended.stderr);
        robot.assert_drives_on();
    }
    let newcomers: Vec<_> =
        lab.processes().into_iter().filter(|(_, line)| !line.contains("hilare ")).collect();
    assert_eq!(newcomers, [], "what was refused is gone");
    robot.down("swaps that were refused");
}

/// The process dies with launch, whoever it is.
#[test]
fn a_controller_in_python_ends_with_launch() {
    let Some(python) = python_with_iceoryx2("a_controller_in_python_ends_with_launch") else { return };
    let _cores = CORES.lock().unwrap_or_else(PoisonError::into_inner);
    let lab = Lab::new();
    let robot = Driving::start(&lab, &python);
    robot.swap(&example()).expect_code(0);
    let status = lab.status(&robot.name).expect("it is up");
    let launch = status["launch_pid"].as_u64().and_then(|pid| i32::try_from(pid).ok()).expect("a pid");
    support::process::signal(launch, Signal::KILL);
    support::wait_until("every process ends", || lab.processes().is_empty());
}
