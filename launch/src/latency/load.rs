//! Load on every core: processor, memory and disk. stress-ng where it is installed, our own elsewhere.

use crate::manager::children::this_program;
use std::hint::black_box;
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread;

/// Memory that a thread goes through, bytes: more than caches hold.
const MEMORY: usize = 32 << 20;
/// Written to the disk at once, bytes.
const WRITTEN: usize = 4 << 20;

/// A load under way; over when this is gone.
pub struct Load {
    child: Child,
    by: &'static str,
}

impl Load {
    /// Starts it, in processes of its own and without real time.
    pub fn start(seconds: f64) -> io::Result<Self> {
        let cores = thread::available_parallelism().map_or(1, usize::from).to_string();
        // It ends by itself if nobody ends it.
        let seconds = format!("{}s", seconds as u64 + 60);
        let mut stress = Command::new("stress-ng");
        stress.args(["--quiet", "--cpu", &cores, "--vm", &cores, "--vm-bytes", "64M", "--hdd", "1"]);
        stress.args(["--hdd-bytes", "64M", "--timeout", &seconds]).arg("--temp-path").arg(directory());
        if let Ok(child) = silent(&mut stress).spawn() {
            return Ok(Self { child, by: "stress-ng" });
        }
        let mut own = this_program();
        let child = silent(own.args(["bare", "load"])).stdin(Stdio::piped()).spawn()?;
        Ok(Self { child, by: "own" })
    }

    /// What it consists of: `stress-ng` or `own`.
    pub const fn by(&self) -> &'static str {
        self.by
    }
}

fn silent(command: &mut Command) -> &mut Command {
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null())
}

impl Drop for Load {
    fn drop(&mut self) {
        // Both end in good order when asked: stress-ng by a signal, ours when its input ends.
        drop(self.child.stdin.take());
        if let Some(pid) = rustix::process::Pid::from_raw(self.child.id().cast_signed()) {
            let _ = rustix::process::kill_process(pid, rustix::process::Signal::TERM);
        }
        let _ = self.child.wait();
    }
}

/// Where the disk is written to.
fn directory() -> PathBuf {
    std::env::temp_dir()
}

/// Our own load, in a process of its own, until its standard input ends.
pub fn run() {
    for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
        thread::spawn(|| work(16));
        thread::spawn(|| work(MEMORY / 8));
    }
    thread::spawn(write);
    let _ = io::copy(&mut io::stdin().lock(), &mut io::sink());
}

fn work(words: usize) {
    let mut words = vec![1u64; words];
    let mut carry = 1u64;
    loop {
        for word in &mut words {
            carry = carry.rotate_left(7) ^ *word;
            *word = carry;
        }
        black_box(&mut words);
    }
}

/// A disk that is full or slow is a load, too.
fn write() {
    let bytes = vec![0xa5; WRITTEN];
    loop {
        let Ok(mut file) = unnamed() else { return };
        for _ in 0..16 {
            let _ = file.write_all(&bytes).and_then(|()| file.sync_data());
        }
    }
}

/// A file that nobody has to remove.
fn unnamed() -> io::Result<std::fs::File> {
    use rustix::fs::{Mode, OFlags};
    let flags = OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC;
    Ok(rustix::fs::open(directory(), flags, Mode::RUSR | Mode::WUSR)?.into())
}
