//! The tuner: a multi-objective particle swarm that knows nothing of robots.
//!
//! ```text
//!   swarm ──candidates──▶ objective, on any number of threads ──outcomes──▶ archive
//!     ▲                        │                                               │
//!     └──── leaders ───────────┼───────────────────────────────────────────────┘
//!                              ▼ log: append-only; a search resumes from it with the same bits
//! ```
//!
//! * [`Space`]: parameters with bounds; real, logarithmic or integer.
//! * [`Mopso`]: the search (Coello 2004, with the flight of SMPSO); random numbers are drawn in one thread.
//! * [`Objective`]: a closure over `&[f64]`, or one over several candidates at once ([`InLanes`]).
//! * [`Log`]: what was evaluated.
//! * [`hypervolume()`]: how good a front is; exact for two and three objectives.
//!
//! ```
//! use hilare_tuner::{Budget, Kind, Mopso, Parameter, Settings, Space, hypervolume};
//! use std::sync::atomic::AtomicBool;
//!
//! let parameter = Parameter { name: "x".to_owned(), low: -10.0, high: 10.0, kind: Kind::Real };
//! let mut search = Mopso::new(Space::new(vec![parameter])?, Settings::new(2, 1))?;
//! // Schaffer's problem: x² against (x − 2)²; every x from 0 to 2 is a compromise.
//! let schaffer = |values: &[f64], objectives: &mut [f64]| {
//!     objectives[0] = values[0] * values[0];
//!     objectives[1] = (values[0] - 2.0) * (values[0] - 2.0);
//!     0.0
//! };
//! let budget = Budget { evaluations: 2_000, threads: 2 };
//! search.run(&schaffer, budget, None, &AtomicBool::new(false), |_, _| {})?;
//! let front = search.front();
//! assert!(front.iter().all(|solution| (-0.05..=2.05).contains(&solution.values[0])));
//! // At most 16 - 8/3, by integration.
//! let volume = hypervolume(front.iter().map(|solution| solution.objectives.as_slice()), &[4.0, 4.0]);
//! assert!((13.2..13.34).contains(&volume));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod archive;
mod batch;
mod hypervolume;
mod log;
mod random;
mod run;
mod space;
mod swarm;

pub use archive::{Archive, Member, OBJECTIVES_MAX};
pub use batch::{Batch, InLanes, Objective};
pub use hypervolume::hypervolume;
pub use log::{Log, LogError};
pub use random::Random;
pub use run::{Budget, Ending, Solution};
pub use space::{Kind, Parameter, Space, SpaceError};
pub use swarm::{Mopso, Settings, SettingsError};
