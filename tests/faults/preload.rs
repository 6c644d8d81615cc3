//! What a process meets in its C library: a wall clock that jumps, its own death.

use super::host::has;
use crate::support::{Lab, PATIENCE, Running};
use std::fs;
use std::path::PathBuf;
use std::process::Command;

/// Compiles what is loaded before the C library; `None` without a C compiler.
fn library(lab: &Lab, name: &str, source: &str) -> Option<PathBuf> {
    if !has("cc") {
        return None;
    }
    let (source, library) = (lab.file(&format!("{name}.c"), source), lab.dir().join(format!("{name}.so")));
    let mut compile = lab.command_of("cc");
    compile.args(["-shared", "-fPIC", "-O1", "-o"]).arg(&library).arg(&source);
    Running::start(compile).wait(PATIENCE).expect_code(0);
    Some(library)
}

/// The wall clock as seen through the C library: seven hours ahead, seven hours behind, turn by turn. Its
/// file in `HILARE_TEST_CLOCK_DIR` shows which processes have seen it.
const CLOCK_SHIM: &str = r#"
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static long shift(void) {
    struct timespec now;
    syscall(SYS_clock_gettime, CLOCK_MONOTONIC, &now);
    long turn = now.tv_sec * 4 + now.tv_nsec / 250000000;
    return (turn % 2 ? 7 : -7) * 3600;
}

__attribute__((constructor)) static void seen(void) {
    const char *dir = getenv("HILARE_TEST_CLOCK_DIR");
    char path[512];
    if (dir && snprintf(path, sizeof path, "%s/%d", dir, (int)getpid()) < (int)sizeof path)
        close(open(path, O_CREAT | O_WRONLY, 0600));
}

int clock_gettime(clockid_t clock, struct timespec *time) {
    long result = syscall(SYS_clock_gettime, clock, time);
    if (result == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) time->tv_sec += shift();
    return (int)result;
}

int gettimeofday(struct timeval *restrict time, void *restrict zone) {
    long result = syscall(SYS_gettimeofday, time, zone);
    if (result == 0 && time) time->tv_sec += shift();
    return (int)result;
}

time_t time(time_t *out) {
    struct timespec now;
    syscall(SYS_clock_gettime, CLOCK_REALTIME, &now);
    if (out) *out = now.tv_sec + shift();
    return now.tv_sec + shift();
}
"#;

/// A wall clock that jumps for every process started with it.
pub struct JumpingClock {
    library: PathBuf,
    dir: PathBuf,
}

impl JumpingClock {
    /// Compiles it; `None` without a C compiler.
    pub fn new(lab: &Lab) -> Option<Self> {
        let dir = lab.dir().join("clock");
        fs::create_dir(&dir).expect("a directory for the clock");
        Some(Self { library: library(lab, "clock", CLOCK_SHIM)?, dir })
    }

    /// Lets a command and all it starts see it.
    pub fn show(&self, command: &mut Command) {
        command.env("LD_PRELOAD", &self.library).env("HILARE_TEST_CLOCK_DIR", &self.dir);
    }

    /// Processes that have seen it.
    pub fn seen_by(&self) -> usize {
        fs::read_dir(&self.dir).map_or(0, |entries| entries.flatten().count())
    }
}

/// A box dies just before it gives shared memory its size, or makes it readable: `HILARE_TEST_DEATH` is the box, which
/// incarnation of it, the call and which of its calls; the file `HILARE_TEST_DEATH_MARK` says that it did.
const DEATH_SHIM: &str = r#"
#define _GNU_SOURCE
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

static int is_on_shared_memory(int fd) {
    char link[64], path[512] = {0};
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    return readlink(link, path, sizeof path - 1) > 0 && !strncmp(path, "/dev/shm/", 9);
}

static int is_incarnation(const char *box, const char *number) {
    static char line[8192];
    int file = open("/proc/self/cmdline", O_RDONLY | O_CLOEXEC);
    long length = read(file, line, sizeof line - 1);
    close(file);
    int is_box = 0, is_number = 0;
    const char *before = "";
    for (char *word = line; word < line + length; before = word, word += strlen(word) + 1) {
        is_box |= !strcmp(before, "service") && !strcmp(word, box);
        is_number |= !strcmp(before, "--incarnation") && !strcmp(word, number);
    }
    return is_box && is_number;
}

static void call(const char *name, int fd) {
    static int calls;
    char box[32], incarnation[16], fatal[16];
    int nth;
    const char *death = getenv("HILARE_TEST_DEATH"), *mark = getenv("HILARE_TEST_DEATH_MARK");
    if (!death || !mark || sscanf(death, "%31s %15s %15s %d", box, incarnation, fatal, &nth) != 4) return;
    if (strcmp(name, fatal) || !is_on_shared_memory(fd) || ++calls != nth) return;
    if (!is_incarnation(box, incarnation)) return;
    close(open(mark, O_CREAT | O_WRONLY, 0600));
    kill(getpid(), SIGKILL);
}

int ftruncate(int fd, off_t length) {
    call("ftruncate", fd);
    return (int)syscall(SYS_ftruncate, fd, length);
}

int ftruncate64(int fd, off64_t length) {
    call("ftruncate", fd);
    return (int)syscall(SYS_ftruncate, fd, length);
}

int fchmod(int fd, mode_t mode) {
    call("fchmod", fd);
    return (int)syscall(SYS_fchmod, fd, mode);
}
"#;

/// The death of a box in the middle of making shared memory.
pub struct Death {
    library: PathBuf,
    mark: PathBuf,
}

impl Death {
    /// Compiles it; `None` without a C compiler.
    pub fn new(lab: &Lab) -> Option<Self> {
        Some(Self { library: library(lab, "death", DEATH_SHIM)?, mark: lab.dir().join("died") })
    }

    /// Awaits an incarnation of a box at a call, `ftruncate` or `fchmod`, the `nth` for shared memory.
    pub fn await_for(&self, command: &mut Command, incarnation: (&str, u32), call: &str, nth: u64) {
        let _ = fs::remove_file(&self.mark);
        command.env("LD_PRELOAD", &self.library).env("HILARE_TEST_DEATH_MARK", &self.mark);
        command.env("HILARE_TEST_DEATH", format!("{} {} {call} {nth}", incarnation.0, incarnation.1));
    }

    /// True if it has come.
    pub fn has_come(&self) -> bool {
        self.mark.exists()
    }
}
