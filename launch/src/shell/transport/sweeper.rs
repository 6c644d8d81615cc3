//! Shared memory whose maker died before it was usable.
//!
//! A file of shared memory is made, given its size, filled, and then made readable. Whoever opens it meanwhile
//! waits: iceoryx2 0.10 for ever while it has no size (`dynamic_storage/posix_shared_memory.rs`, `open_impl`), a
//! second while it is not readable. So a maker that is killed in between would stop launch and every box that it was
//! connecting to.

use crate::private::shm_names;
use crate::shell::realtime::set_fifo;
use crossbeam_channel::{RecvTimeoutError, Sender, TrySendError, bounded};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::thread::{Builder, sleep};
use std::time::Duration;

/// How often it looks by itself: not everybody who makes files is watched, and one made just when its maker died is seen
/// at the next look only. Whoever waits for it at the end of a launch has a second to leave.
const PERIOD: Duration = Duration::from_millis(250);
/// Looks at files that somebody is making, until they are left alone to grow up.
const LOOKS: u32 = 50;
/// Between two of these looks; no multiple of the millisecond at which those who wait open the file.
const BETWEEN_LOOKS: Duration = Duration::from_micros(1300);

/// A thread that removes such files, so that who waits for them goes on; it ends when the last of its handles goes.
#[derive(Clone, Debug)]
pub struct Sweeper {
    call: Sender<()>,
}

impl Sweeper {
    /// Begins to sweep names in /dev/shm that begin with `prefix`; with a priority of SCHED_FIFO if it must
    /// be in time for a robot in real time.
    pub(super) fn start(prefix: String, priority: Option<u64>) -> std::io::Result<Self> {
        let (call, called) = bounded(1);
        Builder::new().name("sweeper".into()).spawn(move || {
            if let Some(priority) = priority {
                let _ = set_fifo(priority, false);
            }
            while called.recv_timeout(PERIOD) != Err(RecvTimeoutError::Disconnected) {
                sweep(&prefix);
            }
        })?;
        Ok(Self { call })
    }

    /// Somebody has died.
    pub fn call(&self) {
        match self.call.try_send(()) {
            // If it is called already, it will find this one too.
            Ok(()) | Err(TrySendError::Full(()) | TrySendError::Disconnected(())) => {}
        }
    }
}

fn sweep(prefix: &str) {
    for look in 1..=LOOKS {
        let mut unfinished = shm_names(prefix).into_iter().filter(|path| is_unfinished(path)).peekable();
        if unfinished.peek().is_none() {
            return;
        }
        let nobodys = |maker: Maker| maker == Maker::Gone || (maker == Maker::Unknown && look == LOOKS);
        for path in unfinished.filter(|path| nobodys(maker_of(path))) {
            let _ = fs::remove_file(path);
        }
        sleep(BETWEEN_LOOKS);
    }
}

/// Its maker has not come to the end.
fn is_unfinished(path: &Path) -> bool {
    const OWNER_READS: u32 = 0o400;
    fs::symlink_metadata(path).is_ok_and(|found| found.len() == 0 || found.mode() & OWNER_READS == 0)
}

/// Who is making a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Maker {
    /// Nobody has it open or mapped.
    Gone,
    /// Nobody that is open to us; of a process with capabilities of its own, say, nothing is known.
    Unknown,
    Alive,
}

fn maker_of(path: &Path) -> Maker {
    let (Ok(file), Ok(processes)) = (fs::symlink_metadata(path), fs::read_dir("/proc")) else {
        return Maker::Unknown;
    };
    let is_number = |name: &str| name.bytes().all(|digit| digit.is_ascii_digit());
    let numbered = |entry: &fs::DirEntry| entry.file_name().to_str().is_some_and(is_number);
    // Of another user it cannot be: they could not.
    let ours = |entry: &fs::DirEntry| {
        fs::metadata(entry.path().join("stat")).is_ok_and(|process| process.uid() == file.uid())
    };
    let processes = processes.flatten().filter(numbered).filter(ours);
    processes.map(|process| is_making(&process.path(), path, file.len())).max().unwrap_or(Maker::Gone)
}

fn is_making(process: &Path, path: &Path, bytes: u64) -> Maker {
    let opened = fs::read_dir(process.join("fd"))
        .map(|files| files.flatten().any(|file| fs::read_link(file.path()).is_ok_and(|to| to == path)));
    // What has no size is not mapped.
    let mapped = if bytes == 0 {
        Ok(false)
    } else {
        fs::read_to_string(process.join("maps"))
            .map(|maps| path.to_str().is_some_and(|path| maps.contains(path)))
    };
    match (opened, mapped) {
        (Ok(true), _) | (_, Ok(true)) => Maker::Alive,
        (Ok(false), Ok(false)) => Maker::Gone,
        // It may be gone meanwhile.
        _ if process.exists() => Maker::Unknown,
        _ => Maker::Gone,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::private::SHM;
    use std::fs::{File, OpenOptions, Permissions};
    use std::io::Write;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn only_what_nobody_is_making_any_more_goes() {
        let prefix = format!("hilare-test-sweep.{}.", std::process::id());
        let at = |name: &str| Path::new(SHM).join(format!("{prefix}{name}"));
        let make = |name: &str, bytes: &[u8], mode: u32| {
            let mut file: File = OpenOptions::new().write(true).create_new(true).open(at(name)).unwrap();
            file.write_all(bytes).unwrap();
            file.set_permissions(Permissions::from_mode(mode)).unwrap();
            file
        };
        drop(make("finished", b"data", 0o600));
        drop(make("no-size", b"", 0o200));
        drop(make("not-readable", b"data", 0o200));
        let being_made = make("being-made", b"", 0o200);
        sweep(&prefix);
        let left = |name: &str| at(name).exists();
        let after = ["finished", "no-size", "not-readable", "being-made"].map(left);
        drop(being_made);
        sweep(&prefix);
        let later = left("being-made");
        let _ = fs::remove_file(at("finished"));
        assert_eq!((after, later), ([true, false, false, true], false));
    }
}
