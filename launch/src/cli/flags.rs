//! Flags that set keys of the system file.

use super::refused;
use crate::config::{Driver, System};
use crate::manager::Failure;

/// Sets `--set`, `--controller` and `--standby` at once, because only together they may make sense.
pub(crate) fn set_with_drivers(
    system: &mut System,
    set: &[String],
    controller: Option<&str>,
    standby: Option<&str>,
) -> Result<(), Failure> {
    let mut flags: Vec<(String, String)> = Vec::new();
    for key in controller.into_iter().flat_map(Driver::keys) {
        flags.push((format!("--controller {}", controller.unwrap_or_default()), key));
    }
    if let Some(name) = standby {
        flags.push((format!("--standby {name}"), format!("controller.standby={name}")));
    }
    let keys: Vec<&String> = set.iter().chain(flags.iter().map(|(_, key)| key)).collect();
    system.set_all(&keys).map_err(|error| {
        let error = error.to_string();
        // The assignments we made of the flags are nothing the user has written.
        let own = flags.iter().find_map(|(flag, key)| {
            error.strip_prefix(&format!("--set {key}: ")).map(|what| format!("{flag}: {what}"))
        });
        refused(own.unwrap_or(error))
    })
}

/// The seeds of everything that is random.
pub(crate) fn seed_keys(seed: u64) -> [String; 2] {
    [format!("plant.seed={seed}"), format!("camera.seed={seed}")]
}

/// Sets keys on behalf of a flag, whose name an error then bears.
pub(crate) fn set_flag(system: &mut System, flag: &str, value: &str, keys: &[String]) -> Result<(), Failure> {
    system.set_all(keys).map_err(|error| {
        let error = error.to_string();
        // The assignment we made of it is nothing the user has written.
        let what =
            keys.iter().find_map(|key| error.strip_prefix(&format!("--set {key}: "))).unwrap_or(&error);
        refused(format!("{flag} {value}: {what}"))
    })
}

/// Where the page listens, if the command line says so.
pub(crate) fn set_listen(system: &mut System, listen: Option<&str>) -> Result<(), Failure> {
    listen
        .map_or(Ok(()), |listen| set_flag(system, "--listen", listen, &[format!("operator.listen={listen}")]))
}

/// Where the live view listens, if the command line says so.
pub(crate) fn set_foxglove(system: &mut System, address: Option<&str>) -> Result<(), Failure> {
    let set = |address| set_flag(system, "--foxglove", address, &[format!("operator.foxglove={address}")]);
    address.map_or(Ok(()), set)
}

/// `X,Y,THETA` as assignments to the system's start pose, whose bounds then apply.
pub(crate) fn start_keys(text: &str) -> Result<[String; 3], Failure> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    match parts[..] {
        [x, y, theta] => {
            Ok([format!("start.x_m={x}"), format!("start.y_m={y}"), format!("start.theta_rad={theta}")])
        }
        _ => {
            Err(refused(format!("--start {text}: three numbers are wanted, X,Y,THETA in metres and radians")))
        }
    }
}
