//! A robot's runtime directory: who it belongs to, where its socket is, nothing left behind.
//!
//! One robot name, one launch: a lock file in /dev/shm, where the robot's shared memory is, holds the pid
//! of the launch in charge and its directory. The directory and the robot's files in /dev/shm are wiped
//! when a launch takes the lock (nothing of this robot is alive then) and when it lets go. Names that
//! another user has taken are refused, and left alone.

use crate::private::{
    PrivateUmask, SHM, check_shm_names, euid, foreign, open_own_file, private_dir, shm_names,
};
use crate::shell::transport::shm_prefix;
use rustix::fs::{FlockOperation, flock, statvfs};
use std::fmt;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// Free bytes in /dev/shm below which a start is refused: a full tmpfs kills whoever touches it.
pub const SHM_NEEDED: u64 = 32 << 20;

/// End of the name of an emergency stop's mark.
const LATCH: &str = "-estop";
/// End of a lock's name.
const LOCK: &str = "-lock";
/// Most that is read of a lock: a pid and a path.
const LOCK_BYTES: u64 = 4096 + 32;
/// Name of the control socket in a robot's directory.
pub const SOCKET: &str = "control.sock";

/// Bytes a socket address has for a path, its final zero apart.
pub const SOCKET_PATH_MAX: usize = 107;

/// Why a robot could not be claimed: one line with the cure.
#[derive(Debug)]
pub struct ClaimError(String);

impl fmt::Display for ClaimError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ClaimError {}

/// Where all robots of this user have their directories: never on a disk by default, because the work of a disk
/// delays the tick, and who joins or leaves makes files.
pub fn base_dir() -> PathBuf {
    if let Some(dir) = std::env::var_os("HILARE_RUNTIME_DIR") {
        return dir.into();
    }
    // Who became another user may have kept the first one's variable.
    let ours = |dir: &Path| fs::metadata(dir).is_ok_and(|found| found.is_dir() && found.uid() == euid());
    match std::env::var_os("XDG_RUNTIME_DIR").filter(|dir| ours(Path::new(dir))) {
        Some(dir) => Path::new(&dir).join("hilare"),
        None => PathBuf::from(format!("/dev/shm/hilare-{}", euid())),
    }
}

/// A robot whose launch is alive.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Living {
    /// Its name.
    pub robot: String,
    /// Process id of its launch.
    pub pid: i32,
    /// Its control socket.
    pub socket: PathBuf,
}

/// A robot's control socket within the directories of this process's environment.
pub fn socket_path(robot: &str) -> PathBuf {
    base_dir().join(robot).join(SOCKET)
}

/// Log of a robot that was brought up in the background.
pub fn log_path(robot: &str) -> PathBuf {
    base_dir().join(format!("{robot}.log"))
}

/// Marks a robot whose emergency stop is on: until it is reset, through every restart, wherever the runtime
/// directory of the next launch may be.
pub fn estop_latch(robot: &str) -> PathBuf {
    Path::new(SHM).join(format!("{}{LATCH}", shm_prefix(robot).trim_end_matches('.')))
}

/// Latches a robot's emergency stop.
pub fn latch_estop(robot: &str) -> Result<(), String> {
    let latch = estop_latch(robot);
    let opened = open_own_file(&latch, OpenOptions::new().write(true).create(true).mode(0o600));
    opened.map(drop).map_err(|error| format!("{}: {error}", latch.display()))
}

/// Releases it.
pub fn unlatch_estop(robot: &str) -> Result<(), String> {
    let latch = estop_latch(robot);
    match fs::remove_file(&latch) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(format!("{}: {error}; remove it, else the emergency stop comes back", latch.display()))
        }
        _ => Ok(()),
    }
}

/// Robots whose emergency stop is on though they may not be up.
pub fn latched_robots() -> Vec<String> {
    let Ok(entries) = fs::read_dir(SHM) else { return Vec::new() };
    let head = shm_prefix("");
    let head = head.trim_end_matches('.');
    let robot =
        |name: &str| Some(name.strip_prefix(head)?.strip_prefix('.')?.strip_suffix(LATCH)?.to_owned());
    let mut robots: Vec<String> =
        entries.flatten().filter_map(|entry| robot(entry.file_name().to_str()?)).collect();
    robots.sort();
    robots
}

/// Robots of this user that a living launch holds, whatever its environment was. Locks that somebody
/// else has made in our name are no robots of ours.
pub fn living_robots() -> Vec<Living> {
    let head = shm_prefix("");
    let head = format!("{}.", head.trim_end_matches('.'));
    let mut robots: Vec<Living> = shm_names(&head)
        .into_iter()
        .filter_map(|path| {
            let name = path.file_name()?.to_str()?;
            let robot = name.strip_prefix(&head)?.strip_suffix(LOCK)?.to_owned();
            if robot.contains('.') {
                return None;
            }
            let mut file = open_own_file(&path, OpenOptions::new().read(true)).ok()?;
            let held = flock(&file, FlockOperation::NonBlockingLockShared).is_err();
            let (pid, dir) = read_lock(&mut file)?;
            held.then(|| Living { robot, pid, socket: Path::new(&dir).join(SOCKET) })
        })
        .collect();
    robots.sort();
    robots
}

/// Pid and directory of a lock.
fn read_lock(file: &mut File) -> Option<(i32, String)> {
    let mut text = String::new();
    file.take(LOCK_BYTES).read_to_string(&mut text).ok()?;
    let (pid, dir) = text.trim_end().split_once('\n')?;
    Some((pid.parse().ok()?, dir.to_owned()))
}

/// A robot claimed by this process. As long as it is, what the process creates is for its user only.
pub struct RobotDir {
    robot: String,
    path: PathBuf,
    lock_path: PathBuf,
    /// Held as long as the claim.
    _lock: File,
    _umask: PrivateUmask,
}

impl RobotDir {
    /// Claims a robot, wiping what an earlier launch may have left.
    pub fn claim(robot: &str) -> Result<Self, ClaimError> {
        check_shm()?;
        let base = base_dir();
        if socket_path(robot).as_os_str().len() > SOCKET_PATH_MAX {
            return Err(ClaimError(format!(
                "{}: too long for a control socket; set HILARE_RUNTIME_DIR to a shorter path",
                base.display()
            )));
        }
        make_private(&base)?;
        let path = base.join(robot);
        let lock_path = Path::new(SHM).join(format!("{}{LOCK}", shm_prefix(robot).trim_end_matches('.')));
        let lock = take_lock(&lock_path, robot, &path)?;
        // Before anything is wiped: what is another user's is not ours to remove.
        let latch = estop_latch(robot);
        let latch_is_ours = foreign(&latch).map_or(Ok(()), |why| Err(format!("{}: {why}", latch.display())));
        if let Err(why) = latch_is_ours.and_then(|()| check_shm_names(&shm_prefix(robot))) {
            let _ = fs::remove_file(&lock_path);
            return Err(taken(robot, &why));
        }
        let umask = PrivateUmask::set();
        let claim = Self { robot: robot.to_owned(), path, lock_path, _lock: lock, _umask: umask };
        claim.wipe();
        let _ = fs::remove_file(log_path(robot));
        make_private(&claim.path)?;
        Ok(claim)
    }

    /// The directory.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn wipe(&self) {
        let _ = fs::remove_dir_all(&self.path);
        for file in shm_names(&shm_prefix(&self.robot)) {
            let _ = fs::remove_file(file);
        }
    }
}

impl Drop for RobotDir {
    fn drop(&mut self) {
        self.wipe();
        // The last robot takes the directory of all with it; it stays while there is anything in it.
        let _ = self.path.parent().map(fs::remove_dir);
        // While still locked: whoever waits for the lock sees that the file is gone and starts over.
        let _ = fs::remove_file(&self.lock_path);
    }
}

fn check_shm() -> Result<(), ClaimError> {
    let free = statvfs("/dev/shm").map(|stat| stat.f_bavail * stat.f_frsize);
    match free {
        Ok(free) if free >= SHM_NEEDED => Ok(()),
        Ok(free) => Err(ClaimError(format!(
            "/dev/shm: {} MB free, {} MB needed; free some, or: mount -o remount,size=64M /dev/shm \
             (docker: --shm-size=64m)",
            free >> 20,
            SHM_NEEDED >> 20
        ))),
        Err(error) => Err(ClaimError(format!("/dev/shm: {error}; mount a tmpfs there"))),
    }
}

/// Makes a directory, or refuses one that others can put something into.
fn make_private(dir: &Path) -> Result<(), ClaimError> {
    private_dir(dir).map_err(|error| {
        ClaimError(format!("{}: {error}; set HILARE_RUNTIME_DIR to a directory of your own", dir.display()))
    })
}

/// A name of this robot that somebody else has taken.
fn taken(robot: &str, why: &str) -> ClaimError {
    ClaimError(format!(
        "{why}: the names of robot {robot:?} are taken; have it removed, or choose another name (--robot NAME)"
    ))
}

fn take_lock(path: &Path, robot: &str, dir: &Path) -> Result<File, ClaimError> {
    let failed = |error: io::Error| ClaimError(format!("{}: {error}", path.display()));
    loop {
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false).mode(0o600);
        let mut file = open_own_file(path, &mut options).map_err(|error| match foreign(path) {
            Some(why) => taken(robot, &format!("{}: {why}", path.display())),
            None => failed(error),
        })?;
        if flock(&file, FlockOperation::NonBlockingLockExclusive).is_err() {
            let pid = read_lock(&mut file).map_or_else(|| "?".to_owned(), |(pid, _)| pid.to_string());
            return Err(ClaimError(format!(
                "robot {robot:?} is already up, launch has pid {pid}; stop it (hilare down --robot {robot}) or choose \
                 another name (--robot NAME)"
            )));
        }
        // The file may have been removed between open and lock by the launch that held it.
        let same =
            fs::metadata(path).is_ok_and(|now| file.metadata().is_ok_and(|ours| ours.ino() == now.ino()));
        if !same {
            continue;
        }
        let write = file
            .set_len(0)
            .and_then(|()| file.rewind())
            .and_then(|()| writeln!(file, "{}\n{}", std::process::id(), dir.display()));
        write.map_err(failed)?;
        return Ok(file);
    }
}
