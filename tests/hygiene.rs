//! What the boxes on the tick do and do not do while the robot drives: no allocation, no lock, no page fault, no
//! system call but the sleep and the wake-up, no thread in real time but their own; nor while parameters change.
//! What is counted is what the thread of the loop does.

mod support;

use rustix::process::Signal;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use support::{Lab, PATIENCE, Running, number, pid_of, skip, text, wait_until, whole_machine};

/// The boxes between a tick and its command, and the simulated robot.
const ON_THE_TICK: [&str; 5] =
    ["step_generator", "pose_estimator", "waypoint_selector", "controller", "plant"];
/// How long each is looked at while it drives.
const LOOK: Duration = Duration::from_secs(2);

/// A robot with a straight line of 2 m before it; down when dropped.
struct Robot<'l> {
    lab: &'l Lab,
    name: String,
}

impl<'l> Robot<'l> {
    fn up(lab: &'l Lab, prepare: impl FnOnce(&mut Command), set: &[&str]) -> Self {
        let name = lab.robot();
        let mut up = lab.command(&["up", "--detach", "--robot", &name]);
        // To be looked at so closely takes time.
        up.args(["--set", "timing.pause_stop_ticks=0", "--set", "timing.lease_ticks=0"]);
        set.iter().for_each(|key| {
            up.args(["--set", key]);
        });
        prepare(&mut up);
        Running::start(up).wait(PATIENCE).expect_code(0);
        let this = Self { lab, name };
        let path = lab.straight(2.0).to_string_lossy().into_owned();
        this.tell(&["follow", &path]);
        this
    }

    /// Armed, and on its way.
    fn drive(&self) {
        self.tell(&["arm"]);
        self.lab.await_status(&self.name, "it drives", |status| number(status, "speed_mps") > 0.02);
    }

    fn tell(&self, args: &[&str]) {
        self.lab.hilare(&[args, &["--robot", &self.name]].concat()).expect_code(0);
    }

    fn status(&self) -> Value {
        self.lab.status(&self.name).expect("it is up")
    }

    fn pids(&self) -> Vec<(&'static str, i32)> {
        let status = self.status();
        ON_THE_TICK.iter().map(|name| (*name, pid_of(&status, name))).collect()
    }

    /// Other parameters for every box on the tick.
    fn change(&self) {
        let limits = ["limits.v_max_mps=0.035", "limits.accel_mps2=0.5"];
        let others = ["tracking.speed_mps=0.03", "plant.slip_mean=0.01", "plant.track_error=0.001"];
        let laws = ["controller.kanayama.k1_per_s=0.5", "controller.drive_lag_s=0.01"];
        let filter = ["estimator.history_ticks=500", "camera.delay_ticks=100"];
        self.tell(&[&["param", "set"], &limits[..], &others, &laws, &filter].concat());
    }

    fn tick(&self) -> f64 {
        number(&self.status(), "tick")
    }
}

impl Drop for Robot<'_> {
    fn drop(&mut self) {
        let _ = self.lab.hilare(&["down", "--robot", &self.name]);
    }
}

fn has(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok()
}

/// Counts what a process asks of its heap and how often it takes a lock, in the file of its number in
/// `HILARE_TEST_COUNT_DIR`: three words. Blocks of 48 bytes are counted by themselves: iceoryx2 0.10 takes one with every
/// message it lends and gives it back with sending it.
const COUNTING_SHIM: &str = r#"
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <malloc.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t), __libc_free(void *);
static unsigned long before[3], *counts = before;
static int (*lock)(pthread_mutex_t *);
/* The loop is the first thread; what sleeps beside it may build and free. */
static __thread int whose;
static int of_the_loop(void) { return (whose ? whose : (whose = gettid() == getpid() ? 1 : 2)) == 1; }

__attribute__((constructor)) static void begin(void) {
    const char *dir = getenv("HILARE_TEST_COUNT_DIR");
    char path[512];
    lock = (int (*)(pthread_mutex_t *))dlsym(RTLD_NEXT, "pthread_mutex_lock");
    if (!dir || snprintf(path, sizeof path, "%s/%d", dir, (int)getpid()) >= (int)sizeof path) return;
    int file = open(path, O_CREAT | O_RDWR | O_CLOEXEC, 0600);
    if (file < 0 || ftruncate(file, 4096)) return;
    void *page = mmap(0, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (page != MAP_FAILED) counts = page;
    close(file);
}

static void count(int what) { if (of_the_loop()) __atomic_fetch_add(&counts[what], 1, __ATOMIC_RELAXED); }
void *malloc(size_t n) { count(n == 48 ? 2 : 0); return __libc_malloc(n); }
void *calloc(size_t n, size_t m) { count(0); return __libc_calloc(n, m); }
void *realloc(void *p, size_t n) { count(0); return __libc_realloc(p, n); }
void *aligned_alloc(size_t a, size_t n) { count(0); return __libc_memalign(a, n); }
int posix_memalign(void **p, size_t a, size_t n) { count(0); return (*p = __libc_memalign(a, n)) ? 0 : 12; }
void free(void *p) { if (p) count(malloc_usable_size(p) == 56 ? 2 : 0); __libc_free(p); }
int pthread_mutex_lock(pthread_mutex_t *m) {
    count(1);
    if (!lock) lock = (int (*)(pthread_mutex_t *))dlsym(RTLD_NEXT, "pthread_mutex_lock");
    return lock(m);
}
"#;

fn counting_library(lab: &Lab) -> Option<PathBuf> {
    if !has("cc") {
        return None;
    }
    let (source, library) = (lab.file("count.c", COUNTING_SHIM), lab.dir().join("count.so"));
    let mut compile = lab.command_of("cc");
    compile.args(["-shared", "-fPIC", "-O1", "-o"]).arg(&library).arg(&source).arg("-ldl");
    Running::start(compile).wait(PATIENCE).expect_code(0);
    Some(library)
}

/// Allocations and locks of a process so far, and blocks of messages lent.
fn counted(dir: &Path, pid: i32) -> [u64; 3] {
    let bytes = fs::read(dir.join(pid.to_string())).expect("the process counts");
    [0, 8, 16].map(|at| u64::from_ne_bytes(bytes[at..at + 8].try_into().expect("a word")))
}

#[test]
fn while_it_drives_nothing_is_allocated_and_nothing_locked() {
    // A message a tick and box, or five of them in a look.
    nothing_is_allocated("while_it_drives_nothing_is_allocated_and_nothing_locked", &[], 1.0);
}

/// Encoders, camera and filter: the plant and the filter say more.
#[test]
fn while_a_filter_reckons_nothing_is_allocated_and_nothing_locked() {
    let test = "while_a_filter_reckons_nothing_is_allocated_and_nothing_locked";
    nothing_is_allocated(test, &["estimator.kind=ekf"], 2.2);
}

fn nothing_is_allocated(test: &str, set: &[&str], messages_a_tick: f64) {
    let _machine = whole_machine();
    let lab = Lab::new();
    let Some(library) = counting_library(&lab) else {
        return skip(test, "no C compiler (cc)");
    };
    let dir = lab.dir().join("counts");
    fs::create_dir(&dir).expect("a directory");
    let count = |up: &mut Command| {
        up.env("LD_PRELOAD", &library).env("HILARE_TEST_COUNT_DIR", &dir);
    };
    let robot = Robot::up(&lab, count, set);
    robot.drive();
    let pids = robot.pids();
    let planner = pid_of(&robot.status(), "planner");
    let before: Vec<[u64; 3]> = pids.iter().map(|(_, pid)| counted(&dir, *pid)).collect();
    let (planner_before, from) = (counted(&dir, planner), robot.tick());
    std::thread::sleep(LOOK / 2);
    robot.change();
    std::thread::sleep(LOOK / 2);
    let to = robot.tick();
    for ((name, pid), before) in pids.iter().zip(before) {
        assert!(before[0] > 100, "{name} has counted nothing: {before:?}");
        let now = counted(&dir, *pid);
        println!("{name}: {} blocks of messages lent and sent", now[2] - before[2]);
        assert_eq!(now[..2], before[..2], "{name}: allocations and locks in {} ticks", to - from);
        // Heartbeats; what came while it was looked at.
        let messages = (to - from) * 1.1 * messages_a_tick + 60.0;
        assert!((now[2] - before[2]) as f64 <= 2.0 * messages, "{name}: {before:?}, {now:?}");
    }
    assert!(to - from > 500.0, "it drove {} ticks", to - from);
    // What allocates is seen to.
    let path = lab.straight(1.0).to_string_lossy().into_owned();
    robot.tell(&["follow", &path]);
    assert!(counted(&dir, planner)[0] > planner_before[0], "the planner took a path without allocating");
    drop(robot);
    lab.assert_nothing_left("a robot that was counted");
}

/// Page faults of the first thread of a process so far, minor and major.
fn page_faults(pid: i32) -> [u64; 2] {
    let stat = fs::read_to_string(format!("/proc/{pid}/task/{pid}/stat")).expect("it runs");
    let after = stat.rsplit_once(')').expect("its name").1;
    let fields: Vec<&str> = after.split_whitespace().collect();
    [7, 9].map(|at| fields[at].parse().expect("a number"))
}

#[test]
fn while_it_drives_no_page_is_missing() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let robot = Robot::up(&lab, |_| {}, &[]);
    let status = robot.status();
    if !text(&status["processes"][0], "granted").contains("mlock") {
        return skip("while_it_drives_no_page_is_missing", "memory cannot be locked here");
    }
    let pids = robot.pids();
    let before: Vec<_> = pids.iter().map(|(_, pid)| page_faults(*pid)).collect();
    // The first ticks, too: none waits for a page that was never there.
    robot.drive();
    std::thread::sleep(LOOK / 2);
    robot.change();
    std::thread::sleep(LOOK / 2);
    for ((name, pid), before) in pids.iter().zip(before) {
        assert_eq!(page_faults(*pid), before, "{name}: minor and major page faults");
    }
    drop(robot);
    lab.assert_nothing_left("a robot whose pages were counted");
}

/// System calls of a process for a while, by name.
fn system_calls(lab: &Lab, name: &str, pid: i32) -> BTreeMap<String, u64> {
    let log = lab.dir().join(format!("{name}.strace"));
    let mut strace = lab.command_of("strace");
    strace.args(["-qq", "-f", "-p", &pid.to_string(), "-o"]).arg(&log);
    let tracer = Running::start(strace);
    wait_until("it is traced", || fs::metadata(&log).is_ok_and(|log| log.len() > 0));
    std::thread::sleep(LOOK);
    tracer.signal(Signal::INT);
    let _ = tracer.wait(PATIENCE);
    let mut calls = BTreeMap::new();
    for line in fs::read_to_string(&log).expect("a log").lines() {
        // `1234 futex(0x…` or `1234 <... futex resumed>…`: the second ends one that is counted already.
        // What sleeps beside the loop is another thread.
        let (thread, call) =
            line.split_once(' ').map_or(("", ""), |(thread, call)| (thread, call.trim_start()));
        if thread != pid.to_string() {
            continue;
        }
        if let Some((name, _)) = call.split_once('(').filter(|_| !call.starts_with('<')) {
            *calls.entry(name.to_owned()).or_default() += 1;
        }
    }
    calls
}

#[test]
fn while_it_drives_there_is_no_system_call_but_the_sleep_and_the_wake_up() {
    let test = "while_it_drives_there_is_no_system_call_but_the_sleep_and_the_wake_up";
    let _machine = whole_machine();
    if !has("strace") {
        return skip(test, "no strace");
    }
    let lab = Lab::new();
    let robot = Robot::up(&lab, |_| {}, &[]);
    robot.drive();
    for (name, pid) in robot.pids() {
        let from = robot.tick();
        let calls = system_calls(&lab, name, pid);
        let ticks = (robot.tick() - from) as u64;
        println!("{name}: {calls:?} in about {ticks} ticks");
        let allowed: &[&str] = match name {
            // It sleeps until its tick, and wakes the pose estimator.
            "step_generator" => &["clock_nanosleep", "futex"],
            // Nobody waits for it: it sleeps and looks.
            "plant" => &["clock_nanosleep"],
            _ => &["futex"],
        };
        for call in calls.keys() {
            // The one it was in when it was looked at.
            assert!(allowed.contains(&&**call) || call == "restart_syscall", "{name}: {call}: {calls:?}");
        }
        if name == "step_generator" {
            let [sleeps, wakes] =
                ["clock_nanosleep", "futex"].map(|call| calls.get(call).copied().unwrap_or(0));
            assert!(sleeps > 100 && wakes <= sleeps + 1, "one wake-up a tick at most: {calls:?}");
        }
    }
    drop(robot);
    lab.assert_nothing_left("a robot that was traced");
}

/// Scheduling policy of each thread of a process: 0 other, 1 FIFO, 5 idle.
fn policies(pid: i32) -> Vec<(i32, u64)> {
    let tasks = fs::read_dir(format!("/proc/{pid}/task")).expect("it runs");
    let mut policies: Vec<(i32, u64)> = tasks
        .flatten()
        .map(|task| {
            let stat = fs::read_to_string(task.path().join("stat")).expect("a thread");
            let after = stat.rsplit_once(')').expect("its name").1;
            let policy = after.split_whitespace().nth(38).and_then(|field| field.parse().ok());
            let id = task.file_name().to_string_lossy().parse().expect("a number");
            (id, policy.expect("a policy"))
        })
        .collect();
    policies.sort_unstable();
    policies
}

#[test]
fn a_box_has_one_thread_in_real_time_and_says_what_it_was_granted() {
    let _machine = whole_machine();
    let lab = Lab::new();
    let robot = Robot::up(&lab, |_| {}, &["wake_up.keep_awake=true"]);
    robot.drive();
    let status = robot.status();
    for (name, pid) in robot.pids() {
        let processes = status["processes"].as_array().expect("processes");
        let granted = text(processes.iter().find(|one| one["name"] == name).expect("it is there"), "granted");
        let policies = policies(pid);
        let fifo: Vec<i32> = policies.iter().filter(|one| one.1 == 1).map(|one| one.0).collect();
        if granted.contains("fifo") {
            assert_eq!(fifo, [pid], "{name}: {policies:?}");
        } else {
            assert!(fifo.is_empty(), "{name}: {policies:?}, and says {granted:?}");
        }
        let idle = policies.iter().filter(|one| one.1 == 5).count();
        assert_eq!(
            idle,
            usize::from(name == "step_generator"),
            "{name}: threads that keep awake: {policies:?}"
        );
    }
    drop(robot);
    lab.assert_nothing_left("a robot kept awake");
}

/// A control group of the processor controller (cgroup v1) of the test's own, without time for real-time work.
struct Group(PathBuf);

impl Group {
    fn new(lab: &Lab) -> Option<Self> {
        let group = Path::new("/sys/fs/cgroup/cpu").join(format!("hilare-{}", lab.robot()));
        fs::create_dir(&group).ok()?;
        let this = Self(group);
        let budget = fs::read_to_string(this.0.join("cpu.rt_runtime_us")).ok()?;
        (budget.trim() == "0").then_some(this)
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        let _ = fs::remove_dir(&self.0);
    }
}

#[test]
fn a_control_group_without_a_budget_is_named_with_the_cure() {
    let test = "a_control_group_without_a_budget_is_named_with_the_cure";
    let _machine = whole_machine();
    let lab = Lab::new();
    let Some(group) = Group::new(&lab) else {
        return skip(test, "no control group of one's own with RT_GROUP_SCHED (cgroup v1, as root)");
    };
    let within = |args: &[&str]| {
        let mut command = lab.command_of("sh");
        command.args(["-c", "echo $$ > \"$0\" && exec \"$@\""]).arg(group.0.join("cgroup.procs"));
        command.arg(env!("CARGO_BIN_EXE_hilare")).args(args);
        Running::start(command).wait(PATIENCE)
    };
    let path = lab.straight(0.05).to_string_lossy().into_owned();
    let ended = within(&["run", "--path", &path, "--robot", &lab.robot(), "--out", "report"]).expect_code(0);
    let budget = group.0.join("cpu.rt_runtime_us").to_string_lossy().into_owned();
    assert_eq!(ended.complaints().len(), 1, "{ended:#?}");
    for what in ["SCHED_FIFO was refused", "RT_GROUP_SCHED", &budget, "best effort"] {
        assert!(ended.stderr.contains(what), "{what}: {ended:#?}");
    }
    let ended = within(&["doctor"]);
    assert!(ended.stdout.contains("RT_GROUP_SCHED") && ended.stdout.contains(&budget), "{ended:#?}");
    // The cure cures.
    fs::write(&budget, "100000").expect("a budget");
    let ended = within(&["run", "--path", &path, "--robot", &lab.robot(), "--out", "report"]).expect_code(0);
    assert_eq!(ended.stderr, "", "{ended:#?}");
    lab.assert_nothing_left("runs in a control group");
}
