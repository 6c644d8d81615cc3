//! The machine as its files tell of it.

use crate::shell::realtime::{CpuChoice, chosen_cpu};
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Where the files of the machine lie, and which processor the control path gets on it.
pub struct Machine {
    root: PathBuf,
    /// The processor of the control path, unless a system file says otherwise.
    pub control_cpu: usize,
}

impl Machine {
    /// This one.
    pub fn this() -> Self {
        Self::at(Path::new("/"), chosen_cpu(CpuChoice::Last).unwrap_or(0))
    }

    /// One whose /proc and /sys lie below `root`.
    pub fn at(root: &Path, control_cpu: usize) -> Self {
        Self { root: root.to_owned(), control_cpu }
    }

    fn path(&self, path: &str) -> PathBuf {
        self.root.join(path.trim_start_matches('/'))
    }

    /// The text of a file, without spaces around it; `None` if it cannot be read.
    pub fn text(&self, path: &str) -> Option<String> {
        let bytes = fs::read(self.path(path)).ok()?;
        Some(String::from_utf8_lossy(&bytes).trim().to_owned())
    }

    /// The number that a file holds.
    pub fn number<T: FromStr>(&self, path: &str) -> Option<T> {
        self.text(path)?.parse().ok()
    }

    /// The number after `key` in a file with a key and a number a line.
    pub fn number_after(&self, path: &str, key: &str) -> Option<u64> {
        let text = self.text(path)?;
        let rest = text.lines().find_map(|line| line.strip_prefix(key))?;
        rest.split_whitespace().next()?.parse().ok()
    }

    /// Names in a directory, sorted; none if it is not there.
    pub fn names(&self, path: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(path)).into_iter().flatten().flatten();
        let mut names: Vec<String> =
            entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

#[cfg(test)]
pub(super) mod fake {
    use super::*;

    /// A machine of files; control path on processor 1.
    pub struct Fake {
        dir: tempfile::TempDir,
        /// What is to be judged.
        pub machine: Machine,
    }

    impl Fake {
        pub fn new(files: &[(&str, &str)]) -> Self {
            let dir = tempfile::tempdir().expect("a directory");
            let fake = Self { machine: Machine::at(dir.path(), 1), dir };
            files.iter().for_each(|(path, text)| fake.put(path, text));
            fake
        }

        pub fn put(&self, path: &str, text: &str) {
            let path = self.dir.path().join(path.trim_start_matches('/'));
            fs::create_dir_all(path.parent().expect("a parent")).expect("its directory");
            fs::write(path, text).expect("a file");
        }
    }

    #[test]
    fn files_that_are_absent_or_garbled_are_nothing() {
        let fake = Fake::new(&[("/proc/x", " 12 \n"), ("/proc/y", "a b\nMem: 7 kB\n")]);
        let machine = &fake.machine;
        assert_eq!(machine.number("/proc/x"), Some(12));
        assert_eq!(machine.number::<u64>("/proc/y"), None);
        assert_eq!(machine.number_after("/proc/y", "Mem:"), Some(7));
        assert_eq!(machine.number_after("/proc/y", "Swap:"), None);
        assert_eq!(machine.text("/proc/z"), None);
        assert_eq!((machine.names("/proc"), machine.names("/sys")), (vec!["x".into(), "y".into()], vec![]));
    }
}
