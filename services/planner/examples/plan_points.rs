//! Plans a map file's own job and writes the waypoints, a point "x y" a line, metres: `plan_points FILE`.
#![allow(clippy::disallowed_macros, reason = "an example has output")]

use hilare_planner::{ClearanceField, LoadOptions, Map, Planner, PlannerParams, Unlimited};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args().nth(1).ok_or("usage: plan_points FILE")?;
    let map = Map::load(&file, &LoadOptions::default())?;
    let job = map.job().ok_or("the file names no job")?.clone();
    let (start, goal) = (job.start.ok_or("no start")?, job.goal.ok_or("no goal")?);
    let mut planner = Planner::new(ClearanceField::new(&map), PlannerParams::default());
    let plan = planner.plan(start, goal, &mut Unlimited).map_err(|refusal| refusal.to_string())?;
    for point in plan.waypoints {
        println!("{} {}", point.x_m, point.y_m);
    }
    Ok(())
}
