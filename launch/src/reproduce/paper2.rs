//! Paper 2: a cart on DC servos, lines and arcs, the navigation circle.

use super::published::PAPER_2;
use super::rows::{Ours, Rows};
use super::runs::{Driven, Job, Trial, drive_all};
use super::{Picture, Section, fault};
use crate::manager::Failure;
use crate::report::Correction;
use crate::report::canvas::{BLUE, DARK, FAINT_BLUE, GREEN, VERMILION};
use crate::report::chart::{Chart, Mark, Scale, Shape};
use crate::report::plots::course;
use hilare_interfaces::geometry::{WorldPoint, wrap_angle_rad};
use hilare_interfaces::segment::Segment;
use std::io;

/// Trails drawn at most.
const TRAILS: usize = 20;
/// The greatest distance the paper leaves, cm.
const STEADY_CM: f64 = 1.0;

type Points = Vec<(f64, f64)>;

/// All of it.
pub fn reproduce(seeds: u64) -> Result<Section, Failure> {
    let mut rows = Rows::new(&PAPER_2);
    let (line, arc) = (Job::load("line-21deg")?, Job::load("arc-102cm")?);
    let trials = |job| (1..=seeds).map(move |seed| Trial { job, set: Vec::new(), seed, rows: seed == 1 });
    let on_line = drive_all(&trials(&line).collect::<Vec<_>>())?;
    let on_arc = drive_all(&trials(&arc).collect::<Vec<_>>())?;
    figure_4(&mut rows, &line, &on_line)?;
    let bend = figure_5(&mut rows, &arc, &on_arc)?;
    let pictures = vec![
        draw_line(&line, &on_line).map_err(fault)?,
        draw_arc(&arc, bend, &on_arc).map_err(fault)?,
        draw_deviation(bend, &on_arc).map_err(fault)?,
    ];
    let rows = rows.finish().map_err(Failure::Fault)?;
    let runs = on_line.into_iter().chain(on_arc).map(|run| run.note).collect();
    Ok(Section { paper: 2, source: PAPER_2.source, set_up: set_up(&line)?, rows, pictures, runs })
}

fn set_up(job: &Job) -> Result<Vec<String>, Failure> {
    let number = |key| job.number(key);
    Ok(vec![
        "Not here: figures 1 to 3, which are drawings.".to_owned(),
        "Not printed: every dimension and mass of the cart, its motors, the radius R_0 of the navigation circle, the gains \
         of the PID, the sampling time, the speed on the line, what the positioning system does; both curves are pictures \
         the text has lost."
            .to_owned(),
        format!(
            "Assumed instead (`launch/systems/cart.toml`): motors with PWM and velocity loops, tyres that can spin, two \
             casters; a position every {} ms, {} ms late, off by {:.0} mm and {:.1}° (standard deviations, a seed a run).",
            number("camera.period_ticks")?,
            number("camera.delay_ticks")?,
            number("camera.sd_m")? * 1e3,
            number("camera.sd_rad")?.to_degrees()
        ),
        "Corrected: within 1 cm for good. Afterwards: the last quarter of the run. Both are of the true robot. The \
         paper's (4) and (7) use arcsin and arctan for the same angle, and (4) has no value outside the circle; what ours \
         does instead stands in `services/controller/src/navigation_circle.rs`."
            .to_owned(),
    ])
}

/// How the first deviation of each run was corrected.
fn corrections(job: &Job, driven: &[Driven]) -> Result<Vec<Correction>, Failure> {
    let none = || fault(format!("{}: it has no [correction]", job.scenario.name));
    driven.iter().map(|run| run.correction.ok_or_else(none)).collect()
}

/// Way until corrected, m; of a run that never was the way it had.
fn travel_m(job: &Job, corrections: &[Correction]) -> Vec<f64> {
    let length_m = job.waypoints.windows(2).map(|pair| pair[1].segment_from(pair[0]).length_m()).sum();
    corrections.iter().map(|correction| correction.travel_m.unwrap_or(length_m)).collect()
}

fn steady_cm(corrections: &[Correction]) -> Ours {
    Ours::Many(corrections.iter().map(|correction| correction.steady_cross_track_m * 100.0).collect())
}

fn figure_4(rows: &mut Rows, job: &Job, driven: &[Driven]) -> Result<(), Failure> {
    let item = "figure 4";
    let turn = job.number("start.theta_rad")?.to_degrees();
    rows.give(item, "turn", Ours::One(turn), "it starts so; the paper's is turned by hand once it drives");
    rows.give(item, "speed", Ours::One(job.number("tracking.speed_mps")?), "chosen");
    let robot = format!(
        "track {:.0} mm, R_0 {} tracks, K_P {} 1/rad, T_I {} s, T_D {} s, {} ms",
        job.number("chassis.track_m")? * 1e3,
        job.number("controller.navigation-circle.circle_tracks")?,
        job.number("controller.navigation-circle.proportional_per_rad")?,
        job.number("controller.navigation-circle.integral_s")?,
        job.number("controller.navigation-circle.derivative_s")?,
        job.number("timing.period_ticks")?
    );
    rows.give(item, "robot", Ours::Text(robot), "chosen");
    let corrections = corrections(job, driven)?;
    let travel = travel_m(job, &corrections).iter().map(|way| way * 100.0).collect();
    let why = "robot, gains and speed are ours; 200 cm is where the paper calls it done";
    rows.give(item, "travel", Ours::Many(travel), why);
    rows.give(item, "steady", steady_cm(&corrections), "the positioning system's noise is in it");
    let greatest = driven.iter().flat_map(|run| &run.rows).map(|row| row.cross_track_m.abs());
    let curve = format!("{:.1} cm beside the line at most, seed 1", greatest.fold(0.0, f64::max) * 100.0);
    rows.give(item, "curve", Ours::Text(curve), "drawn below");
    Ok(())
}

/// Centre and radius of the arc.
#[derive(Clone, Copy)]
struct Bend {
    centre: WorldPoint,
    radius_m: f64,
}

impl Bend {
    fn of(job: &Job) -> Option<Self> {
        let first: Segment = job.waypoints.get(1)?.segment_from(*job.waypoints.first()?);
        Some(Self { centre: first.centre()?, radius_m: first.centre()?.distance_m(first.to) })
    }

    /// Where a point of the circle lies, from the side of the start clockwise, degrees in (−180, 180].
    fn angle_deg(self, (x, y): (f64, f64)) -> f64 {
        let angle = (y - self.centre.y_m).atan2(x - self.centre.x_m);
        wrap_angle_rad(std::f64::consts::PI - angle).to_degrees()
    }
}

fn figure_5(rows: &mut Rows, job: &Job, driven: &[Driven]) -> Result<Bend, Failure> {
    let item = "figure 5";
    let bend = Bend::of(job).ok_or_else(|| fault("arc-102cm: it begins without an arc"))?;
    let centre = format!("({:.0}, {:.0}) cm", bend.centre.x_m * 100.0, bend.centre.y_m * 100.0);
    rows.give(item, "centre", Ours::Text(centre), "as printed");
    rows.give(item, "radius", Ours::One(bend.radius_m * 100.0), "as printed");
    let start = job.scenario.system.start.position().distance_m(bend.centre) - bend.radius_m;
    rows.give(item, "start", Ours::One(start * 100.0), "follows from centre, radius and start");
    rows.give(item, "speed", Ours::One(job.number("tracking.speed_mps")?), "as printed; from rest");
    let corrections = corrections(job, driven)?;
    let overshoots = corrections.iter().map(|correction| correction.overshoots as f64).collect();
    rows.give(
        item,
        "overshoots",
        Ours::Many(overshoots),
        "counted where it leaves the 1 cm on the other side",
    );
    let angle = travel_m(job, &corrections).iter().map(|way| (way / bend.radius_m).to_degrees()).collect();
    rows.give(item, "angle", Ours::Many(angle), "robot and gains are ours; way divided by the radius");
    rows.give(item, "steady", steady_cm(&corrections), "the positioning system's noise is in it");
    let greatest = driven.iter().flat_map(|run| &run.rows).map(|row| row.cross_track_m.abs());
    let curve = format!("{:.1} cm beside the arc at most, seed 1", greatest.fold(0.0, f64::max) * 100.0);
    rows.give(item, "curve", Ours::Text(curve), "drawn below");
    Ok(bend)
}

fn centimetres((x, y): (f64, f64)) -> (f64, f64) {
    (x * 100.0, y * 100.0)
}

/// Trails of all seeds, the first one's on top.
fn trails<'a>(driven: &[Driven], point: impl Fn((f64, f64)) -> (f64, f64) + Copy) -> Vec<Mark<'a>> {
    let others = driven.iter().skip(1).take(TRAILS).map(|run| run.trail.iter().copied().map(point).collect());
    let mut marks = vec![Mark::new("further seeds", FAINT_BLUE, 1, Shape::Curves(others.collect()))];
    if let Some(run) = driven.first() {
        let trail: Points = run.rows.iter().map(|row| point((row.truth.x_m, row.truth.y_m))).collect();
        marks.push(Mark::new("robot, seed 1", BLUE, 2, Shape::Curves(vec![trail])));
    }
    marks
}

fn draw_line(job: &Job, driven: &[Driven]) -> io::Result<Picture> {
    let mut marks = vec![Mark::new("published: ± 1 cm", GREEN, 1, Shape::Band(-STEADY_CM..STEADY_CM))];
    marks.push(Mark::new("published: corrected at 200 cm", VERMILION, 2, Shape::Post(200.0)));
    let course: Points = course(&job.waypoints).map(|p| centimetres((p.x_m, p.y_m))).collect();
    marks.push(Mark::new("target line", DARK, 1, Shape::Curves(vec![course])));
    marks.extend(trails(driven, centimetres));
    let chart = Chart {
        title: "Paper 2, figure 4: onto the x axis from a start turned by 21°",
        x_name: "x (cm)",
        y_name: "y (cm)",
        scale: Scale::Own,
        marks,
    };
    Ok(Picture {
        item: "figure 4",
        file: "paper2-figure-4.svg".to_owned(),
        caption: format!(
            "Trajectories of the true robot, {} seeds; y is stretched",
            driven.len().min(TRAILS + 1)
        ),
        svg: chart.svg()?,
    })
}

fn draw_arc(job: &Job, bend: Bend, driven: &[Driven]) -> io::Result<Picture> {
    let course: Points = course(&job.waypoints).map(|p| centimetres((p.x_m, p.y_m))).collect();
    let mut marks = vec![Mark::new("target arc", DARK, 1, Shape::Curves(vec![course]))];
    let (sin, cos) = (std::f64::consts::PI - 60f64.to_radians()).sin_cos();
    let ray = [0.9, 1.1].map(|part| {
        let reach = bend.radius_m * part;
        centimetres((bend.centre.x_m + reach * cos, bend.centre.y_m + reach * sin))
    });
    marks.extend(trails(driven, centimetres));
    marks.push(Mark::new("published: corrected at 60°", VERMILION, 2, Shape::Curves(vec![ray.to_vec()])));
    if let Some(run) = driven.first() {
        let at = |row: Option<&hilare_recorder::trace::TraceRow>| {
            row.map_or((0.0, 0.0), |row| centimetres((row.truth.x_m, row.truth.y_m)))
        };
        let (start, end) = (at(run.rows.first()), at(run.rows.last()));
        marks.push(Mark::new("ends", BLUE, 1, Shape::Ends(start, end)));
    }
    let chart = Chart {
        title: "Paper 2, figure 5: onto an arc of 102 cm from 1 cm beside it, 1.5 m/s",
        x_name: "x (cm)",
        y_name: "y (cm)",
        scale: Scale::Plane,
        marks,
    };
    Ok(Picture {
        item: "figure 5",
        file: "paper2-figure-5.svg".to_owned(),
        caption: format!("Trajectories of the true robot, {} seeds", driven.len().min(TRAILS + 1)),
        svg: chart.svg()?,
    })
}

/// Distance to the arc against the angle turned: what cannot be seen at the arc's size.
fn draw_deviation(bend: Bend, driven: &[Driven]) -> io::Result<Picture> {
    let polar = |points: &mut dyn Iterator<Item = (f64, f64)>| -> Points {
        let mut turned_deg = 0.0;
        let mut last = None;
        let point = |(x, y): (f64, f64)| {
            let angle = bend.angle_deg((x, y));
            turned_deg += wrap_angle_rad((angle - last.unwrap_or(angle)).to_radians()).to_degrees();
            last = Some(angle);
            let off = WorldPoint::new(x, y).distance_m(bend.centre) - bend.radius_m;
            (turned_deg, off * 100.0)
        };
        points.map(point).collect()
    };
    let others =
        driven.iter().skip(1).take(TRAILS).map(|run| polar(&mut run.trail.iter().copied())).collect();
    let mut marks = vec![
        Mark::new("published: ± 1 cm", GREEN, 1, Shape::Band(-STEADY_CM..STEADY_CM)),
        Mark::new("published: corrected at 60°", VERMILION, 2, Shape::Post(60.0)),
        Mark::new("further seeds", FAINT_BLUE, 1, Shape::Curves(others)),
    ];
    if let Some(run) = driven.first() {
        let trail = polar(&mut run.rows.iter().map(|row| (row.truth.x_m, row.truth.y_m)));
        marks.push(Mark::new("robot, seed 1", BLUE, 2, Shape::Curves(vec![trail])));
    }
    let chart = Chart {
        title: "Paper 2, figure 5: distance to the arc along it",
        x_name: "angle turned about the centre (°)",
        y_name: "outside (+), inside (−) of the arc (cm)",
        scale: Scale::Own,
        marks,
    };
    Ok(Picture {
        item: "figure 5",
        file: "paper2-figure-5-deviation.svg".to_owned(),
        caption: "Distance of the true robot to the arc".to_owned(),
        svg: chart.svg()?,
    })
}
