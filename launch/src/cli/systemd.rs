//! `hilare systemd`: units for the service manager.

use super::{VerbResult, print, refused, warn};
use crate::config::System;
use crate::manager::Failure;
use crate::systemd::{Scope, Units, Wanted, units};
use clap::Args;
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Options of `hilare systemd`.
#[derive(Args)]
pub struct SystemdArgs {
    /// Built-in system or a .toml file [built-in: epuck, cart, agv]
    #[arg(value_name = "SYSTEM", default_value = "epuck")]
    system: String,
    /// Name the robot runs under [default: the system's]
    #[arg(long, value_name = "NAME")]
    robot: Option<String>,
    /// Set a key of the system file, e.g. limits.v_max_mps=0.05 (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE", allow_hyphen_values = true)]
    set: Vec<String>,
    /// Account the processes run as
    #[arg(long, value_name = "ACCOUNT", default_value = "hilare", conflicts_with = "user")]
    run_as: String,
    /// Units for a user's own service manager (systemctl --user)
    #[arg(long)]
    user: bool,
    /// One unit a process, below a target; systemd starts and restarts the workers
    #[arg(long)]
    split: bool,
    /// Where hilare will be, as an absolute path [default: this program]
    #[arg(long, value_name = "PATH")]
    program: Option<PathBuf>,
    /// Write the units into this directory instead of printing them
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Answer in JSON
    #[arg(long)]
    json: bool,
}

/// Prints the units, or writes them and says what comes next.
pub fn systemd(args: &SystemdArgs) -> VerbResult {
    let wanted = wanted(args)?;
    let written = units(&wanted).map_err(refused)?;
    if let Some(dir) = &args.out {
        write(dir, &written)?;
    }
    let next = next_steps(args, &written);
    if args.json {
        let units: Vec<_> = written
            .units
            .iter()
            .map(|unit| {
                let path = args.out.as_ref().map(|dir| dir.join(&unit.name));
                json!({ "name": unit.name, "path": path, "text": unit.text })
            })
            .collect();
        let answer = json!({ "main": written.main, "units": units, "next": next });
        print(&format!("{}\n", serde_json::to_string_pretty(&answer).unwrap_or_default()));
    } else if args.out.is_some() {
        let names: Vec<&str> = written.units.iter().map(|unit| unit.name.as_str()).collect();
        print(&format!("wrote {}\nnext:\n    {}\n", names.join(", "), next.join("\n    ")));
    } else {
        let texts: Vec<String> =
            written.units.iter().map(|unit| format!("# {}\n{}", unit.name, unit.text)).collect();
        print(&texts.join("\n"));
    }
    Ok(ExitCode::SUCCESS)
}

fn wanted(args: &SystemdArgs) -> Result<Wanted, Failure> {
    let mut system = System::load(&args.system).map_err(refused)?;
    system.set_all(&args.set).map_err(refused)?;
    warn(&system.warnings());
    if let Some(robot) = &args.robot {
        super::flags::set_flag(&mut system, "--robot", robot, &[format!("robot={robot}")])?;
    }
    // A unit starts in the root directory.
    let is_relative = |file: &Path| file.is_relative() && file.is_file();
    let mut assigned = args.set.iter().filter_map(|assignment| assignment.split_once('='));
    if let Some((key, file)) = assigned.find(|(_, value)| is_relative(Path::new(value.trim()))) {
        return Err(refused(format!(
            "--set {key}: {file} is relative, and a unit starts in /; give an absolute path"
        )));
    }
    let source = match args.system.ends_with(".toml") {
        true => {
            let path =
                fs::canonicalize(&args.system).map_err(|e| refused(format!("{}: {e}", args.system)))?;
            path.into_os_string().into_string().map_err(|path| {
                refused(format!("{}: a unit file needs a path in UTF-8; rename it", path.display()))
            })?
        }
        false => args.system.clone(),
    };
    let program = match &args.program {
        Some(program) if program.is_absolute() => program.clone(),
        Some(program) => {
            return Err(refused(format!("--program {}: give an absolute path", program.display())));
        }
        None => std::env::current_exe()
            .map_err(|error| Failure::Fault(format!("cannot tell where this program is: {error}")))?,
    };
    let scope =
        if args.user { Scope::User } else { Scope::System { account: account(&args.run_as)?.to_owned() } };
    Ok(Wanted { system, source, set: args.set.clone(), program, scope, split: args.split })
}

/// A name that a unit and the shell lines below can hold.
fn account(name: &str) -> Result<&str, Failure> {
    let fits = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    if name.is_empty() || name.starts_with('-') || !name.chars().all(fits) {
        return Err(refused(format!(
            "--run-as {name:?}: an account is named by letters, digits, -, _ and dots"
        )));
    }
    Ok(name)
}

fn write(dir: &Path, written: &Units) -> Result<(), Failure> {
    let failed = |path: &Path, error: std::io::Error| refused(format!("--out {}: {error}", path.display()));
    fs::create_dir_all(dir).map_err(|error| failed(dir, error))?;
    for unit in &written.units {
        let path = dir.join(&unit.name);
        fs::write(&path, &unit.text).map_err(|error| failed(&path, error))?;
    }
    Ok(())
}

/// What to do with the files, as lines for a shell.
fn next_steps(args: &SystemdArgs, written: &Units) -> Vec<String> {
    let dir = args.out.clone().unwrap_or_else(|| PathBuf::from("DIR"));
    let files: Vec<String> =
        written.units.iter().map(|unit| dir.join(&unit.name).display().to_string()).collect();
    let (files, main) = (files.join(" "), &written.main);
    if args.user {
        return vec![
            format!("install -D -m 0644 -t ~/.config/systemd/user {files}"),
            "systemctl --user daemon-reload".to_owned(),
            format!("systemctl --user enable --now {main}"),
            "loginctl enable-linger    # else the robot and its shared memory end with the last session"
                .to_owned(),
            "hilare status".to_owned(),
        ];
    }
    let account = &args.run_as;
    vec![
        format!("id {account} || sudo useradd --system --shell /usr/sbin/nologin {account}"),
        format!("sudo install -m 0644 -t /etc/systemd/system {files}"),
        "sudo systemctl daemon-reload".to_owned(),
        format!("sudo systemctl enable --now {main}"),
        format!("sudo -u {account} hilare status"),
    ]
}
