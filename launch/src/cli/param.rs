//! `hilare param`: what the parameters are, and other ones while the robot drives.

use super::operate::{RobotArgs, choose, send, show, system_in_force, warn_of, with_map_found};
use super::{VerbResult, print, refused};
use crate::config::{Key, Liveness, System};
use crate::manager::Failure;
use crate::manager::control::Request;
use clap::{Args, Subcommand};
use serde_json::json;
use std::fmt::Write;
use std::process::ExitCode;

/// Options of `hilare param`.
#[derive(Args)]
pub struct ParamArgs {
    #[command(subcommand)]
    verb: ParamVerb,
}

#[derive(Subcommand)]
enum ParamVerb {
    /// List parameters: value, unit, bounds, default, and which boxes take a change on while the robot drives
    #[command(
        after_help = "Examples:\n  hilare param list tracking\n  hilare param list v_max\n  hilare param list --system my_robot.toml --json\n\
        Exit codes: 0 listed, 2 wrong use or no such robot."
    )]
    List {
        /// A section, or a word in the names [default: all]
        #[arg(value_name = "SECTION|WORD")]
        word: Option<String>,
        #[command(flatten)]
        of: OfArgs,
    },
    /// Print the value of parameters
    #[command(
        after_help = "Example: hilare param get tracking.speed_mps limits.v_max_mps\nExit codes: 0 printed, 2 wrong use or no such robot."
    )]
    Get {
        /// Full names
        #[arg(value_name = "KEY", required = true)]
        keys: Vec<String>,
        #[command(flatten)]
        of: OfArgs,
    },
    /// Change parameters while the robot drives: all at the same tick, in every box that reads them, or none
    #[command(after_help = "Examples:\n  hilare param set tracking.speed_mps=0.03\n  \
        hilare param set limits.v_max_mps=0.05 limits.accel_mps2=0.5 --json\n\
        Exit codes: 0 changed (or so already), 1 refused by the robot (nothing was changed), 2 wrong use: no such key, out of bounds, not while it is up.")]
    Set {
        /// Assignments
        #[arg(value_name = "KEY=VALUE", required = true)]
        set: Vec<String>,
        #[command(flatten)]
        robot: RobotArgs,
    },
}

/// Whose parameters.
#[derive(Args)]
struct OfArgs {
    /// Those of a system instead of a robot's that is up: a built-in name or a .toml file
    #[arg(long, value_name = "SYSTEM", conflicts_with = "robot")]
    system: Option<String>,
    #[command(flatten)]
    robot: RobotArgs,
}

impl OfArgs {
    /// The system, as it is in force.
    fn load(&self) -> Result<System, Failure> {
        if let Some(name) = &self.system {
            return System::load(name).map_err(refused);
        }
        let robot = choose(self.robot.robot.as_ref()).map_err(|failure| match failure {
            Failure::Refused(why) => refused(format!("{why}; or --system NAME: a system's, without a robot")),
            other => other,
        })?;
        system_in_force(&robot)
    }
}

/// Lists, prints, changes.
pub fn param(args: &ParamArgs) -> VerbResult {
    match &args.verb {
        ParamVerb::List { word, of } => {
            let system = of.load()?;
            let keys = match word {
                Some(word) => system.keys_like(word).map_err(refused)?,
                None => system.own_keys().collect(),
            };
            tell(&system, &keys, of.robot.json, table)
        }
        ParamVerb::Get { keys, of } => {
            let system = of.load()?;
            let keys: Result<Vec<Key>, String> = keys.iter().map(|path| system.key(path)).collect();
            tell(&system, &keys.map_err(refused)?, of.robot.json, values)
        }
        ParamVerb::Set { set, robot } => change(set, robot),
    }
}

fn tell(system: &System, keys: &[Key], as_json: bool, text: fn(&System, &[Key]) -> String) -> VerbResult {
    if as_json {
        let params: Vec<_> = keys.iter().map(|key| key.to_json(system)).collect();
        let all = json!({ "robot": system.robot, "params": params });
        print(&format!("{}\n", serde_json::to_string_pretty(&all).unwrap_or_default()));
    } else {
        print(&text(system, keys));
    }
    Ok(ExitCode::SUCCESS)
}

fn value(system: &System, key: &Key) -> String {
    let value = key.value_text(system);
    let value = if value.is_empty() { "\"\"" } else { &value };
    format!("{value} {}", key.unit()).trim_end().to_owned()
}

fn values(system: &System, keys: &[Key]) -> String {
    keys.iter().fold(String::new(), |mut text, key| {
        let _ = writeln!(text, "{} {}", key.path(), value(system, key));
        text
    })
}

fn table(system: &System, keys: &[Key]) -> String {
    let rows: Vec<[String; 5]> = keys
        .iter()
        .map(|key| {
            let live = match key.liveness() {
                Liveness::Fixed(_) => "-".to_owned(),
                Liveness::Live(_) if key.readers(system).is_empty() => "nobody now".to_owned(),
                Liveness::Live(_) => {
                    key.readers(system).iter().map(|role| role.name()).collect::<Vec<_>>().join(", ")
                }
            };
            [key.path(), value(system, key), key.allowed(), key.default_text(), live]
        })
        .collect();
    let heads = ["key", "value", "allowed", "default", "while it drives"].map(str::to_owned);
    let widths = [(0, 60), (1, 28), (2, 32), (3, 28)].map(|(n, most): (usize, usize)| {
        let longest = rows.iter().chain([&heads]).map(|row| row[n].chars().count()).max().unwrap_or(0);
        // A long list of choices shifts its own line only.
        longest.min(most)
    });
    let mut text = String::new();
    for row in [&heads].into_iter().chain(&rows) {
        let line = (0..4).map(|n| format!("{:<width$}", row[n], width = widths[n])).collect::<Vec<_>>();
        let _ = writeln!(text, "{}", format!("{}  {}", line.join("  "), row[4]).trim_end());
    }
    text
}

fn change(set: &[String], robot: &RobotArgs) -> VerbResult {
    let living = choose(robot.robot.as_ref())?;
    let found = set.iter().map(|assignment| with_map_found(assignment)).collect::<Result<_, _>>()?;
    let response = send(&living, &Request::Set(found))?;
    if response.ok {
        warn_of(&living, set);
    }
    let Some(outcome) = response.param.as_ref().filter(|_| robot.json) else {
        return show(&response, robot.json);
    };
    let mut all = serde_json::to_value(outcome).unwrap_or_default();
    all["ok"] = response.ok.into();
    all["message"] = response.message.as_str().into();
    print(&format!("{all}\n"));
    Ok(ExitCode::SUCCESS)
}
