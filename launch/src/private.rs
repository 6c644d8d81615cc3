//! What belongs to one user alone, in places that belong to everybody.
//!
//! /dev/shm and /tmp are open to all: another user may have taken a name first, as a file, a link or a
//! directory of theirs. So nothing there is used before it is known to be ours, links are never followed,
//! and what is not ours is refused, never removed.

use rustix::fs::Mode;
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// Where shared memory lies.
pub const SHM: &str = "/dev/shm";
/// Permission bits of everybody but the owner.
const OTHERS: u32 = 0o077;

/// User id of this process.
pub fn euid() -> u32 {
    rustix::process::geteuid().as_raw()
}

/// As long as it lives, what this process and its children create is for their owner only.
#[derive(Debug)]
pub struct PrivateUmask(Mode);

impl PrivateUmask {
    /// From now on; of the whole process.
    pub fn set() -> Self {
        Self(rustix::process::umask(Mode::RWXG | Mode::RWXO))
    }
}

impl Drop for PrivateUmask {
    fn drop(&mut self) {
        rustix::process::umask(self.0);
    }
}

/// Opens a regular file of this user. A link is not followed, a pipe does not block, and a file that is
/// another user's, or has a second name elsewhere, is refused: the error says what it is.
pub fn open_own_file(path: &Path, options: &mut OpenOptions) -> io::Result<File> {
    let opened = options.custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK).open(path);
    let file = opened.map_err(|error| foreign(path).map_or(error, io::Error::other))?;
    match why_foreign(&file.metadata()?) {
        Some(why) => Err(io::Error::other(why)),
        None => Ok(file),
    }
}

/// Why a name is not a plain file of this user, if it is there and is none.
pub fn foreign(path: &Path) -> Option<String> {
    fs::symlink_metadata(path).ok().and_then(|found| why_foreign(&found))
}

fn why_foreign(found: &Metadata) -> Option<String> {
    let kind = found.file_type();
    if found.uid() != euid() {
        Some(format!("belongs to another user (uid {})", found.uid()))
    } else if kind.is_symlink() {
        Some("is a link, which is not followed".to_owned())
    } else if !kind.is_file() {
        Some("is no file".to_owned())
    } else if found.nlink() > 1 {
        Some("has a second name elsewhere".to_owned())
    } else {
        None
    }
}

/// Names in /dev/shm that begin with `prefix`.
pub fn shm_names(prefix: &str) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(SHM) else { return Vec::new() };
    let named = |entry: &fs::DirEntry| entry.file_name().to_string_lossy().starts_with(prefix);
    entries.flatten().filter(named).map(|entry| entry.path()).collect()
}

/// Refuses what others have put under `prefix` in /dev/shm: the first such name and why it is not ours.
pub fn check_shm_names(prefix: &str) -> Result<(), String> {
    let wrong = shm_names(prefix).into_iter().find_map(|path| foreign(&path).map(|why| (path, why)));
    match wrong {
        Some((path, why)) => Err(format!("{}: {why}", path.display())),
        None => Ok(()),
    }
}

/// Closes to others what lies open to them under `prefix` in /dev/shm, before anybody else uses it.
///
/// A file that is open to all may be held open by anybody already, so it is replaced by a private copy:
/// whoever holds the old one holds nothing any more. Not for files that are mapped.
pub fn close_shm_to_others(prefix: &str) -> Result<(), String> {
    check_shm_names(prefix)?;
    for path in shm_names(prefix) {
        let at = |error: io::Error| format!("{}: {error}", path.display());
        let open = fs::symlink_metadata(&path).is_ok_and(|found| found.mode() & OTHERS != 0);
        if open {
            replace_by_private_copy(&path, prefix).map_err(at)?;
        }
    }
    Ok(())
}

fn replace_by_private_copy(path: &Path, prefix: &str) -> io::Result<()> {
    let mut bytes = Vec::new();
    open_own_file(path, OpenOptions::new().read(true))?.read_to_end(&mut bytes)?;
    let copy = Path::new(SHM).join(format!("{prefix}private-copy"));
    let mut file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&copy)?;
    let replaced = file.write_all(&bytes).and_then(|()| fs::rename(&copy, path));
    if replaced.is_err() {
        let _ = fs::remove_file(&copy);
    }
    replaced
}

/// Makes a directory that only this user may enter, or takes one that is there if it is this user's and
/// nobody else can put anything into it. The error says what is wrong with it.
pub fn private_dir(dir: &Path) -> io::Result<()> {
    match fs::DirBuilder::new().mode(0o700).create(dir) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            fs::DirBuilder::new().recursive(true).mode(0o700).create(dir)?;
        }
        created => created?,
    }
    let found = fs::symlink_metadata(dir)?;
    if !found.is_dir() || found.uid() != euid() {
        return Err(io::Error::other("not a directory of this user"));
    }
    if found.mode() & 0o022 != 0 {
        return Err(io::Error::other("other users can write into it (chmod go-w)"));
    }
    // Whoever can rename it away can put another one into its place.
    let parent = dir.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let above = fs::metadata(parent)?.mode();
    let sticky = above & 0o1000 != 0;
    if above & 0o022 != 0 && !sticky {
        return Err(io::Error::other(
            "other users can replace it, as they can write into the directory above",
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::Permissions;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn whoever_held_an_open_file_holds_nothing_after_it_was_closed_to_others() {
        let prefix = format!("hilare-private-{}.", std::process::id());
        let path = Path::new(SHM).join(format!("{prefix}counter"));
        fs::write(&path, [7; 16]).unwrap();
        fs::set_permissions(&path, Permissions::from_mode(0o666)).unwrap();
        let mut held = OpenOptions::new().write(true).open(&path).unwrap();
        close_shm_to_others(&prefix).unwrap();
        held.write_all(&[9; 16]).unwrap();
        held.set_len(0).unwrap();
        let found = fs::metadata(&path).unwrap();
        let (mode, bytes, names) = (found.mode() & 0o777, fs::read(&path).unwrap(), shm_names(&prefix));
        fs::remove_file(&path).unwrap();
        assert_eq!((mode, bytes, names), (0o600, vec![7; 16], vec![path]));
    }

    #[test]
    fn a_pipe_in_place_of_a_file_neither_blocks_nor_passes() {
        let name = format!("hilare-private-pipe-{}", std::process::id());
        let path = Path::new(SHM).join(name);
        let mode = Mode::RUSR | Mode::WUSR;
        rustix::fs::mknodat(rustix::fs::CWD, &path, rustix::fs::FileType::Fifo, mode, 0).unwrap();
        let refused = open_own_file(&path, OpenOptions::new().read(true)).unwrap_err();
        fs::remove_file(&path).unwrap();
        assert_eq!(refused.to_string(), "is no file");
    }
}
