//! The planner's roadmap, to be drawn.

use crate::config::System;
use crate::shell::build;
use hilare_planner::Budget;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Edges that are drawn.
const EDGES_MAX: usize = 20_000;
/// Longest time it may take.
const PATIENCE: Duration = Duration::from_secs(5);

struct Patience<'c> {
    until: Instant,
    cancelled: &'c AtomicBool,
}

impl Budget for Patience<'_> {
    fn exhausted(&mut self) -> bool {
        Instant::now() >= self.until || self.cancelled.load(Ordering::Relaxed)
    }
}

/// Both ends of every edge that is free, m: x0, y0, x1, y1; or why there is none.
pub fn roadmap(system: &System, cancelled: &AtomicBool) -> Result<Vec<Vec<f64>>, String> {
    let mut navigator = build::navigator(system)?;
    let planner =
        navigator.planner_mut().ok_or("the robot has no map; planner.map in its system file names one")?;
    planner.complete_roadmap(&mut Patience { until: Instant::now() + PATIENCE, cancelled });
    let free = planner.roadmap_edges().filter(|(.., free)| *free).take(EDGES_MAX);
    Ok(free.map(|(a, b, _)| [a.x_m, a.y_m, b.x_m, b.y_m].map(tenths_of_mm).to_vec()).collect())
}

/// As exact as a picture needs it.
fn tenths_of_mm(metres: f64) -> f64 {
    (metres * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_a_roadmap_where_there_is_a_map() {
        let mut system = System::default();
        let none = AtomicBool::new(false);
        assert!(roadmap(&system, &none).expect_err("no map").contains("planner.map"));
        system.set("planner.map=platform").expect("built in");
        let edges = roadmap(&system, &none).expect("a roadmap");
        assert!((100..EDGES_MAX).contains(&edges.len()), "{}", edges.len());
        assert!(edges.iter().all(|edge| edge.len() == 4 && edge[..2] != edge[2..]));
    }
}
