//! A robot is its owner's alone: what another user can open, reach, signal or take first, and what a hostile
//! caller of the control socket can do. docs/security.md says what is promised.

mod support;

use rustix::process::{Gid, Pid, Uid, geteuid, test_kill_process};
use rustix::thread::{set_thread_groups, set_thread_res_gid, set_thread_res_uid};
use std::fs::{self, OpenOptions, Permissions};
use std::io::ErrorKind;
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt, chown, symlink};
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use support::{Lab, Running, number, pid_of};

/// The user nobody, who owns nothing.
const NOBODY: u32 = 65534;

/// True if this test may become another user; says so if not.
fn may_be_another_user(test: &str) -> bool {
    let root = geteuid().is_root();
    if !root {
        support::skip(test, "only root can act as another user");
    }
    root
}

/// Does something as the user nobody, in a thread of its own: the kernel keeps users by thread.
fn as_nobody<R: Send>(act: impl FnOnce() -> R + Send) -> R {
    let become_and_act = || {
        let (uid, gid) = (Uid::from_raw(NOBODY), Gid::from_raw(NOBODY));
        set_thread_groups(&[]).expect("root may drop its groups");
        set_thread_res_gid(gid, gid, gid).expect("root may become nobody");
        set_thread_res_uid(uid, uid, uid).expect("root may become nobody");
        act()
    };
    std::thread::scope(|scope| scope.spawn(become_and_act).join().expect("nobody's thread"))
}

/// Everything below a directory, the directory itself first.
fn tree(dir: &Path) -> Vec<PathBuf> {
    let mut found = vec![dir.to_owned()];
    let mut next = 0;
    while let Some(path) = found.get(next).cloned() {
        next += 1;
        if fs::symlink_metadata(&path).is_ok_and(|path| path.is_dir()) {
            found.extend(fs::read_dir(&path).into_iter().flatten().flatten().map(|entry| entry.path()));
        }
    }
    found
}

/// Brings up a robot from a shell that keeps nothing from anybody, lets it drive, and has its controller
/// replaced, so that every kind of file was made, by launch and by workers, early and late.
fn a_robot_with_a_history(lab: &Lab) -> String {
    let robot = lab.robot();
    let mut careless = lab.command_of("sh");
    careless.args(["-c", "umask 000; exec \"$@\"", "sh", env!("CARGO_BIN_EXE_hilare")]);
    careless.args(["up", "--detach", "--robot", &robot]);
    Running::start(careless).wait(support::PATIENCE).expect_code(0);
    let path = lab.straight(3.0);
    lab.hilare(&["follow", &path.to_string_lossy(), "--robot", &robot]).expect_code(0);
    lab.hilare(&["arm", "--robot", &robot]).expect_code(0);
    let status = lab.await_status(&robot, "it drives", |status| number(status, "speed_mps") > 0.01);
    let controller = pid_of(&status, "controller");
    support::process::signal(controller, rustix::process::Signal::KILL);
    lab.await_status(&robot, "it drives again", |status| {
        pid_of_any(status, "controller").is_some_and(|pid| pid != controller)
            && number(status, "speed_mps") > 0.01
    });
    robot
}

fn pid_of_any(status: &serde_json::Value, process: &str) -> Option<i32> {
    let found = status["processes"].as_array()?.iter().find(|entry| entry["name"] == process)?;
    i32::try_from(found["pid"].as_i64()?).ok().filter(|pid| *pid > 1)
}

#[test]
fn nothing_of_a_robot_is_open_to_anybody_else() {
    let lab = Lab::new();
    let robot = a_robot_with_a_history(&lab);
    let shm = lab.shm_files();
    assert!(shm.len() > 20 && shm.iter().any(|path| path.to_string_lossy().ends_with("-lock")), "{shm:?}");
    let home = lab.runtime_dir().join(&robot);
    let tree = tree(&lab.runtime_dir());
    for kind in ["control.sock", "system-1.toml", "iceoryx2.toml", ".log", ".service", ".node_monitor"] {
        assert!(tree.iter().any(|path| path.to_string_lossy().ends_with(kind)), "no {kind} in {tree:?}");
    }
    let mut open = Vec::new();
    for path in shm.iter().chain(&tree) {
        // A worker's heartbeat may have replaced a file in the meantime.
        let Ok(found) = fs::symlink_metadata(path) else { continue };
        assert_eq!(found.uid(), geteuid().as_raw(), "{}", path.display());
        // Directories iceoryx2 makes for itself lie behind one that nobody else can enter.
        let behind = found.is_dir() && path.starts_with(&home) && *path != home;
        if found.mode() & 0o077 != 0 && !behind {
            open.push(format!("{:o} {}", found.mode() & 0o7777, path.display()));
        }
    }
    assert!(open.is_empty(), "open to others:\n{}", open.join("\n"));
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    lab.assert_nothing_left("down");
}

#[test]
fn a_report_is_its_readers() {
    let lab = Lab::new();
    let path = lab.straight(0.05);
    let mut run = lab.command_of("sh");
    run.args(["-c", "umask 022; exec \"$@\"", "sh", env!("CARGO_BIN_EXE_hilare"), "run"]);
    run.args(["--path", &path.to_string_lossy(), "--clock", "lockstep", "--out", "report"]);
    run.args(["--robot", &lab.robot()]);
    Running::start(run).wait(support::PATIENCE).expect_code(0);
    let report = tree(&lab.dir().join("report"));
    assert!(report.len() > 4, "{report:?}");
    for file in report.iter().filter(|path| path.is_file()) {
        let mode = fs::metadata(file).expect("a report's file").mode() & 0o777;
        assert_eq!(mode, 0o644, "as the umask says: {}", file.display());
    }
}

/// What nobody managed to do with a robot's files and processes.
fn intrusions(files: &[PathBuf], pids: &[i32]) -> Vec<String> {
    let mut done = Vec::new();
    for file in files {
        let within = file.join("intruder");
        for (how, result) in [
            ("read", OpenOptions::new().read(true).open(file)),
            ("write", OpenOptions::new().write(true).open(file)),
            ("put a file into", OpenOptions::new().write(true).create(true).truncate(false).open(&within)),
        ] {
            let refusal = result.as_ref().map_err(std::io::Error::kind).err();
            // It may be gone by now.
            let harmless = [ErrorKind::PermissionDenied, ErrorKind::NotFound];
            // No way to do this to a file, or that to a directory, for anybody.
            let senseless = [ErrorKind::NotADirectory, ErrorKind::IsADirectory];
            if !refusal.is_some_and(|kind| harmless.contains(&kind) || senseless.contains(&kind)) {
                done.push(format!("{how} {}: {result:?}", file.display()));
            }
        }
        if file.to_string_lossy().ends_with(".sock") && UnixStream::connect(file).is_ok() {
            done.push(format!("connect {}", file.display()));
        }
    }
    for pid in pids {
        let signalled = Pid::from_raw(*pid).map(test_kill_process);
        if signalled != Some(Err(rustix::io::Errno::PERM)) {
            done.push(format!("signal {pid}: {signalled:?}"));
        }
        for private in ["environ", "mem", "maps", "fd"] {
            let path = PathBuf::from(format!("/proc/{pid}/{private}"));
            let opened = if private == "fd" {
                fs::read_dir(&path).map(|_| ())
            } else {
                fs::File::open(&path).map(|_| ())
            };
            if opened.is_ok() {
                done.push(format!("open {}", path.display()));
            }
        }
    }
    done
}

#[test]
fn another_user_gets_nothing() {
    if !may_be_another_user("another_user_gets_nothing") {
        return;
    }
    let lab = Lab::new();
    let robot = a_robot_with_a_history(&lab);
    let files: Vec<PathBuf> = lab.shm_files().into_iter().chain(tree(&lab.runtime_dir())).collect();
    let pids: Vec<i32> = lab.processes().into_iter().map(|(pid, _)| pid).collect();
    assert!(files.len() > 40 && pids.len() == 8, "{} files, {pids:?}", files.len());
    let done = as_nobody(|| intrusions(&files, &pids));
    assert!(done.is_empty(), "another user can\n{}", done.join("\n"));

    // The program itself is no way around: for nobody, no robot is up.
    let program = lab.dir().join("hilare");
    fs::copy(env!("CARGO_BIN_EXE_hilare"), &program).expect("a copy that nobody can run");
    fs::set_permissions(&program, Permissions::from_mode(0o755)).expect("a copy that nobody can run");
    for args in [
        &["status"][..],
        &["status", "--robot", &robot],
        &["estop", "--robot", &robot],
        &["down", "--robot", &robot],
    ] {
        let mut command = lab.command_of(&program);
        command.args(args).uid(NOBODY).gid(NOBODY).env_remove("HILARE_RUNTIME_DIR");
        let ended = Running::start(command).wait(support::PATIENCE).expect_code(2);
        assert!(ended.stderr.contains("up") && ended.complaints().len() == 1, "{args:?}: {ended:#?}");
        assert!(ended.stdout.is_empty() && !ended.stderr.contains("up are"), "{args:?}: {ended:#?}");
    }
    lab.await_status(&robot, "it still drives", |status| number(status, "speed_mps") > 0.01);
    lab.hilare(&["down", "--robot", &robot]).expect_code(0);
    lab.assert_nothing_left("down");
}

/// A name that was taken before the robot came, removed when the test is done with it.
struct Squat(PathBuf);

impl Squat {
    /// Of a file, a link to `victim` or a directory; of another user if `owner` says so.
    fn new(path: PathBuf, kind: &str, victim: &Path, owner: Option<u32>) -> Self {
        match kind {
            "file" => fs::write(&path, "1\n/nowhere\n").expect("a squatter's file"),
            "link" => symlink(victim, &path).expect("a squatter's link"),
            _ => fs::create_dir(&path).expect("a squatter's directory"),
        }
        if kind != "link" {
            fs::set_permissions(&path, Permissions::from_mode(0o777)).expect("a squatter's mode");
        }
        if let Some(owner) = owner {
            std::os::unix::fs::lchown(&path, Some(owner), Some(owner)).expect("root may give it away");
        }
        Self(path)
    }
}

impl Drop for Squat {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0).or_else(|_| fs::remove_dir_all(&self.0));
    }
}

/// `up` is refused in one line that names `path`; squat and victim are as they were.
#[track_caller]
fn refused_and_untouched(lab: &Lab, path: &Path, victim: &Path, what: &str) {
    let robot = lab.robot();
    for more in [&[][..], &["--detach"]] {
        let ended = lab.hilare(&[&["up", "--robot", &robot], more].concat()).expect_code(2);
        assert_eq!(ended.complaints().len(), 1, "{what}: {ended:#?}");
        assert!(ended.stderr.contains(&*path.to_string_lossy()), "{what}: {ended:#?}");
        let cure = ["--robot NAME", "HILARE_RUNTIME_DIR"].iter().any(|cure| ended.stderr.contains(cure));
        assert!(cure, "{what}, no cure: {ended:#?}");
    }
    assert!(fs::symlink_metadata(path).is_ok(), "{what}: it was removed");
    let victims: Vec<String> = tree(victim).iter().map(|path| path.display().to_string()).collect();
    assert_eq!(victims.len(), 2, "{what}: something was put there, or taken: {victims:?}");
    assert_eq!(fs::read_to_string(victim.join("diary")).expect("the diary"), "dear diary", "{what}");
    let status = lab.hilare(&["status"]);
    assert!(!status.stderr.contains(&robot), "{what}: it counts as a robot: {status:#?}");
    assert_eq!(lab.processes(), [], "{what}");
}

/// A directory and a file that nobody shall write to or empty.
fn a_victim(lab: &Lab) -> PathBuf {
    let victim = lab.dir().join("victim");
    fs::create_dir(&victim).expect("a victim");
    fs::write(victim.join("diary"), "dear diary").expect("a diary");
    victim
}

#[test]
fn names_in_shared_memory_that_somebody_took_first_are_refused_and_not_followed() {
    let lab = Lab::new();
    let victim = a_victim(&lab);
    let root = geteuid().is_root();
    if !root {
        support::skip("names taken by another user", "only root can give files away");
    }
    for name in ["-lock", "-estop", ".squat"] {
        for (kind, owner) in [("file", Some(NOBODY)), ("link", Some(NOBODY)), ("dir", Some(NOBODY))]
            .into_iter()
            .filter(|_| root)
            .chain([("link", None), ("dir", None)])
        {
            let path = PathBuf::from(format!("/dev/shm/hilare.{}.{}{name}", geteuid().as_raw(), lab.robot()));
            let squat = Squat::new(path, kind, &victim.join("diary"), owner);
            refused_and_untouched(&lab, &squat.0, &victim, &format!("{kind} {name} of {owner:?}"));
        }
        assert_eq!(lab.shm_files(), [] as [PathBuf; 0], "after {name}");
    }
    lab.hilare(&["up", "--detach", "--robot", &lab.robot()]).expect_code(0);
    lab.hilare(&["down", "--robot", &lab.robot()]).expect_code(0);
    lab.assert_nothing_left("down");
}

/// A lock that says a robot is up, with a socket of the squatter: it is not spoken to.
#[test]
fn a_robot_that_another_user_pretends_to_be_is_not_spoken_to() {
    if !may_be_another_user("a_robot_that_another_user_pretends_to_be_is_not_spoken_to") {
        return;
    }
    let lab = Lab::new();
    let trap = lab.dir().join("trap");
    fs::create_dir(&trap).expect("a trap");
    let listener = std::os::unix::net::UnixListener::bind(trap.join("control.sock")).expect("a trap");
    listener.set_nonblocking(true).expect("a trap");
    let path = PathBuf::from(format!("/dev/shm/hilare.{}.{}-lock", geteuid().as_raw(), lab.robot()));
    let squat = Squat::new(path, "file", &trap, None);
    fs::write(&squat.0, format!("{}\n{}\n", std::process::id(), trap.display())).expect("a false lock");
    let held = fs::File::open(&squat.0).expect("a false lock");
    rustix::fs::flock(&held, rustix::fs::FlockOperation::LockExclusive).expect("a false lock");
    // Of our own user it would be believed: the test's trap works.
    let mut status = lab.start(&["status", "--robot", &lab.robot()]);
    support::wait_until("the trap catches us", || listener.accept().is_ok() || !status.lives());
    assert!(status.wait(support::PATIENCE).code == Some(1), "the trap caught nothing");
    for target in [&squat.0, &trap.join("control.sock"), &trap] {
        chown(target, Some(NOBODY), Some(NOBODY)).expect("root may give it away");
    }
    let ended = lab.hilare(&["status", "--robot", &lab.robot()]).expect_code(2);
    assert!(ended.stderr.contains("is not up"), "{ended:#?}");
    // Nor is a socket of another user, wherever its name comes from.
    chown(&squat.0, Some(0), Some(0)).expect("root may take it back");
    let ended = lab.hilare(&["status", "--robot", &lab.robot()]).expect_code(1);
    assert!(ended.stderr.contains("not one of this user"), "{ended:#?}");
    assert!(listener.accept().is_err(), "the trap was spoken to");
}

#[test]
fn a_runtime_directory_that_somebody_took_first_is_refused_and_not_followed() {
    let lab = Lab::new();
    let victim = a_victim(&lab);
    let root = geteuid().is_root();
    for (kind, owner) in [("dir", Some(NOBODY)), ("link", Some(NOBODY)), ("file", Some(NOBODY))]
        .into_iter()
        .filter(|_| root)
        // Of our own user too: a link, and a directory everybody may write into.
        .chain([("link", None), ("dir", None)])
    {
        let squat = Squat::new(lab.runtime_dir(), kind, &victim, owner);
        refused_and_untouched(&lab, &squat.0, &victim, &format!("{kind} of {owner:?}"));
        assert_eq!(lab.shm_files(), [] as [PathBuf; 0], "{kind} of {owner:?}");
    }
    // A directory that everybody can rename is as good as theirs.
    fs::set_permissions(lab.dir(), Permissions::from_mode(0o777)).expect("our own directory");
    fs::create_dir(lab.runtime_dir()).expect("a directory of ours");
    refused_and_untouched(&lab, &lab.runtime_dir(), &victim, "a directory above that is open to all");
    fs::set_permissions(lab.dir(), Permissions::from_mode(0o755)).expect("our own directory");
    lab.hilare(&["up", "--detach", "--robot", &lab.robot()]).expect_code(0);
    let socket = lab.runtime_dir().join(lab.robot()).join("control.sock");
    assert!(fs::symlink_metadata(&socket).is_ok_and(|socket| socket.file_type().is_socket()));
    lab.hilare(&["down", "--robot", &lab.robot()]).expect_code(0);
}

/// Files below a directory that hold a text.
fn files_with(dir: &Path, text: &str) -> Vec<PathBuf> {
    let holds = |path: &PathBuf| {
        let bytes = fs::read(path).unwrap_or_default();
        bytes.windows(text.len()).any(|window| window == text.as_bytes())
    };
    tree(dir).into_iter().filter(|path| path.is_file()).filter(holds).collect()
}

#[test]
fn nothing_of_the_environment_is_written_down() {
    let lab = Lab::new();
    // A password in a variable, as people have them; every worker inherits it.
    let secret = format!("correct-horse-{}", std::process::id());
    let told = |args: &[&str]| {
        let mut command = lab.command(args);
        command.env("DATABASE_PASSWORD", &secret).env("HILARE_LOG", "trace").env("RUST_BACKTRACE", "full");
        Running::start(command).wait(support::PATIENCE)
    };
    let robot = lab.robot();
    told(&["up", "--detach", "--robot", &robot]).expect_code(0);
    let status = lab.status(&robot).expect("it is up");
    let worker = pid_of(&status, "controller");
    let environment = fs::read(format!("/proc/{worker}/environ")).expect("our own process");
    assert!(String::from_utf8_lossy(&environment).contains(&secret), "the workers do have it");
    // Whatever there is to complain about is complained about.
    support::process::signal(worker, rustix::process::Signal::ABORT);
    lab.await_status(&robot, "the controller is back", |status| {
        pid_of_any(status, "controller").is_some_and(|pid| pid != worker)
    });
    let (path, other) = (lab.straight(0.05).to_string_lossy().into_owned(), lab.robot_named("b"));
    let mut said = vec![
        told(&["status", "--robot", &robot, "--json"]),
        told(&["goal", "1e9", "0", "--robot", &robot]),
        told(&["up", "--robot", &robot]),
        told(&["doctor"]),
        told(&["run", "--path", &path, "--clock", "lockstep", "--out", "report", "--robot", &other]),
    ];
    let log = fs::read_to_string(lab.runtime_dir().join(format!("{robot}.log"))).expect("the log");
    assert!(log.contains("was killed by signal 6"), "{log}");
    assert_eq!(files_with(lab.dir(), &secret), [] as [PathBuf; 0]);
    said.push(told(&["down", "--robot", &robot]));
    for ended in said {
        assert!(!ended.stdout.contains(&secret) && !ended.stderr.contains(&secret), "{ended:#?}");
    }
}
