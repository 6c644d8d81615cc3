//! A started process, ended when its handle goes.

use rustix::process::{Pid, Signal, kill_process};
use std::io::Read;
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// A process that was started; killed when dropped.
pub struct Running {
    child: Child,
    stdout: Option<Receiver<String>>,
    stderr: Option<Receiver<String>>,
    what: String,
}

/// How a process ended.
#[derive(Debug)]
pub struct Ended {
    /// Exit code, if it was not a signal.
    pub code: Option<i32>,
    /// The signal that ended it.
    pub signal: Option<i32>,
    /// What it wrote; empty where the caller redirected it.
    pub stdout: String,
    /// What it complained about.
    pub stderr: String,
}

impl Ended {
    /// Lines on standard error.
    pub fn complaints(&self) -> Vec<&str> {
        self.stderr.lines().collect()
    }

    /// The exit code was as expected.
    #[track_caller]
    pub fn expect_code(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{self:#?}");
        self
    }
}

/// Children are to know Ctrl-C, also where the tests were started in the background: there shells have it ignored, and
/// children inherit that.
#[expect(unsafe_code, reason = "the library has no safe call for it")]
fn heed_interrupts() {
    // SAFETY: no handler is installed.
    unsafe { libc::signal(libc::SIGINT, libc::SIG_DFL) };
}

impl Running {
    /// Starts a command, its output collected.
    pub fn start(mut command: Command) -> Self {
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        Self::start_as_is(command)
    }

    /// Starts a command whose output was redirected by the caller.
    pub fn start_as_is(mut command: Command) -> Self {
        let what = format!("{command:?}");
        heed_interrupts();
        let mut child = command.spawn().unwrap_or_else(|error| panic!("{what}: {error}"));
        let stdout = child.stdout.take().map(collect);
        let stderr = child.stderr.take().map(collect);
        Self { child, stdout, stderr, what }
    }

    /// Its process id.
    pub fn pid(&self) -> i32 {
        i32::try_from(self.child.id()).expect("a pid")
    }

    /// Sends it a signal.
    pub fn signal(&self, which: Signal) {
        signal(self.pid(), which);
    }

    /// True until it ends.
    pub fn lives(&mut self) -> bool {
        self.child.try_wait().expect("a child of ours").is_none()
    }

    /// Waits for its end; a process that does not end within `limit` fails the test.
    #[track_caller]
    pub fn wait(mut self, limit: Duration) -> Ended {
        let deadline = Instant::now() + limit;
        let status = loop {
            if let Some(status) = self.child.try_wait().expect("a child of ours") {
                break status;
            }
            if Instant::now() > deadline {
                let _ = self.child.kill();
                let _ = self.child.wait();
                let said = [self.stdout.take(), self.stderr.take()].map(said);
                panic!("did not end within {limit:?}: {}\n{said:#?}", self.what);
            }
            std::thread::sleep(Duration::from_millis(2));
        };
        Ended {
            code: status.code(),
            signal: status.signal(),
            stdout: said(self.stdout.take()),
            stderr: said(self.stderr.take()),
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Sends a signal to a process, if it is still there.
pub fn signal(pid: i32, which: Signal) {
    // 0 and less would mean whole groups.
    assert!(pid > 1, "{pid} is no process of ours");
    if let Some(pid) = Pid::from_raw(pid) {
        let _ = kill_process(pid, which);
    }
}

fn collect(mut from: impl Read + Send + 'static) -> Receiver<String> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        let _ = from.read_to_end(&mut bytes);
        let _ = sender.send(String::from_utf8_lossy(&bytes).into_owned());
    });
    receiver
}

fn said(what: Option<Receiver<String>>) -> String {
    // A pipe stays open as long as anybody holds it: a worker that outlives its launch must not hang the test.
    what.map_or(String::new(), |text| text.recv_timeout(Duration::from_secs(5)).unwrap_or_default())
}
