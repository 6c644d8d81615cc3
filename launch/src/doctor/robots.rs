//! The robots of this machine: those that are up, and what others have left.

use super::Finding;
use crate::manager::control::{Request, ask};
use crate::manager::robot_dir::living_robots;
use crate::private::{foreign, shm_names};
use crate::shell::transport::shm_prefix;
use std::collections::BTreeMap;

/// Files of this user in /dev/shm whose robot is not alive.
pub(super) fn leftovers() -> Finding {
    const CHECK: &str = "leftovers";
    let living = living_robots();
    let all = shm_prefix("");
    let ours = all.trim_end_matches('.');
    let mut dead: BTreeMap<String, usize> = BTreeMap::new();
    for path in shm_names(ours) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let Some((robot, _)) =
            name.strip_prefix(ours).and_then(|rest| rest.strip_prefix('.')?.split_once('.'))
        else {
            continue;
        };
        // No launch removes what is another user's.
        if let Some(why) = foreign(&path) {
            let found = format!("{}: {why}", path.display());
            let cure = format!("have it removed; robot {robot} cannot come up before that");
            return Finding::warning(CHECK, found, cure);
        }
        if !living.iter().any(|living| living.robot == robot) {
            *dead.entry(robot.to_owned()).or_default() += 1;
        }
    }
    if dead.is_empty() {
        return Finding::good(CHECK, "none");
    }
    let found: Vec<String> = dead.iter().map(|(robot, files)| format!("{files} files of {robot}")).collect();
    let cure: Vec<String> = dead.keys().map(|robot| format!("rm /dev/shm/{}*", shm_prefix(robot))).collect();
    let cure = format!("the next launch of that robot removes them; or {}", cure.join("; "));
    Finding::warning(CHECK, format!("{}, which is not up", found.join(", ")), cure)
}

/// A robot that is up.
struct Up {
    robot: String,
    pid: i32,
    /// Version of its launch; none if it does not answer.
    version: Option<String>,
}

pub(super) fn running() -> Finding {
    let up = living_robots().into_iter().map(|living| {
        let status = ask(&living.socket, &Request::Status).ok().and_then(|answer| answer.status);
        Up { robot: living.robot, pid: living.pid, version: status.map(|status| status.version) }
    });
    judge_running(&up.collect::<Vec<_>>(), env!("CARGO_PKG_VERSION"))
}

fn judge_running(up: &[Up], ours: &str) -> Finding {
    const CHECK: &str = "robots";
    let all: Vec<String> = up.iter().map(|up| format!("{} (pid {})", up.robot, up.pid)).collect();
    if let Some(mute) = up.iter().find(|up| up.version.is_none()) {
        let found = format!("{} (pid {}) does not answer", mute.robot, mute.pid);
        let cure = format!("hilare down --robot {0}, or kill {1}; its log may say why", mute.robot, mute.pid);
        return Finding::warning(CHECK, found, cure);
    }
    if let Some(other) = up.iter().find(|up| up.version.as_deref() != Some(ours)) {
        let version =
            other.version.as_deref().filter(|version| !version.is_empty()).unwrap_or("an older version");
        let found = format!("{} (pid {}) is of hilare {version}, this is {ours}", other.robot, other.pid);
        let cure = format!("hilare down --robot {0}, then up: wires and orders may differ", other.robot);
        return Finding::warning(CHECK, found, cure);
    }
    Finding::good(CHECK, if all.is_empty() { "none up".to_owned() } else { all.join(", ") })
}

#[cfg(test)]
mod tests {
    use super::super::Verdict::{Good, Warning};
    use super::*;

    #[test]
    fn robots_of_another_version_and_mute_ones_are_told() {
        let up = |version: Option<&str>| Up {
            robot: "mule".to_owned(),
            pid: 7,
            version: version.map(str::to_owned),
        };
        assert_eq!(judge_running(&[], "1.0").found, "none up");
        let same = judge_running(&[up(Some("1.0")), up(Some("1.0"))], "1.0");
        assert_eq!((same.verdict, &*same.found), (Good, "mule (pid 7), mule (pid 7)"));
        for (version, said) in
            [(Some("0.9"), "hilare 0.9, this is 1.0"), (Some(""), "an older"), (None, "not answer")]
        {
            let finding = judge_running(&[up(Some("1.0")), up(version)], "1.0");
            assert!(finding.verdict == Warning && finding.found.contains(said), "{finding:?}");
        }
    }
}
