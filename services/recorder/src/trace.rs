//! The curves of a run: one row a control period, bounded.

use crate::TickRecord;
use hilare_interfaces::geometry::{WorldPose, wrap_angle_rad};
use hilare_interfaces::messages::{Reference, ReferenceState};

/// Rows kept at most; beyond, every second one is dropped and the stride doubles.
pub const MAX_ROWS: usize = 120_000;

/// First line of the trace as CSV.
const HEADER: &str = "tick,pose_x_m,pose_y_m,pose_theta_rad,truth_x_m,truth_y_m,truth_theta_rad,\
                      speed_mps,omega_radps,cross_track_m,heading_error_rad,waypoint";

/// One row of the trace, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceRow {
    /// Ticks executed.
    pub tick: u64,
    /// Estimated pose.
    pub pose: WorldPose,
    /// True pose.
    pub truth: WorldPose,
    /// Commanded speed after the constraints, m/s.
    pub speed_mps: f64,
    /// Commanded yaw rate after the constraints, rad/s.
    pub omega_radps: f64,
    /// Signed cross-track distance of the truth, m, positive to the left.
    pub cross_track_m: f64,
    /// Direction of travel of the truth (heading plus crab angle) less that of the path, rad.
    pub heading_error_rad: f64,
    /// Index of the current waypoint.
    pub waypoint: u64,
}

/// Rows of a run.
#[derive(Clone, Debug)]
pub struct Trace {
    stride: u64,
    rows: Vec<TraceRow>,
    /// Path and waypoint of the line driven last, and its heading, rad.
    line: Option<((u64, u64), f64)>,
}

impl Trace {
    /// Empty, one row every `stride` ticks.
    pub fn new(stride: u64) -> Self {
        Self { stride: stride.max(1), rows: Vec::with_capacity(16_384), line: None }
    }

    /// The rows, oldest first.
    pub fn rows(&self) -> &[TraceRow] {
        &self.rows
    }

    /// Keeps the tick if its turn has come.
    pub fn push(&mut self, record: TickRecord<'_>) {
        if !record.steps.tick.is_multiple_of(self.stride) {
            return;
        }
        if self.rows.len() >= MAX_ROWS {
            self.stride *= 2;
            let stride = self.stride;
            self.rows.retain(|row| row.tick.is_multiple_of(stride));
        }
        let twist = record.steps.commanded_twist();
        let (cross_track_m, heading_error_rad) = self.deviation(record.reference, record.truth.pose());
        self.rows.push(TraceRow {
            tick: record.steps.tick,
            pose: record.pose.pose(),
            truth: record.truth.pose(),
            speed_mps: twist.speed_mps(),
            omega_radps: twist.omega_radps,
            cross_track_m,
            heading_error_rad,
            waypoint: record.reference.index,
        });
    }

    /// Signed cross-track distance (m) and heading error (rad) of the truth; zero without a path.
    fn deviation(&mut self, reference: &Reference, truth: WorldPose) -> (f64, f64) {
        if reference.state == ReferenceState::Idle.code() {
            return (0.0, 0.0);
        }
        let segment = reference.segment();
        let (cross_track_m, heading_rad) = if segment.is_line() {
            // The heading of a line is worked out once, not at every row.
            let key = (reference.path_id, reference.index);
            let known = self.line.filter(|(line, _)| *line == key);
            let (_, heading_rad) = known.unwrap_or_else(|| (key, segment.heading_rad()));
            self.line = Some((key, heading_rad));
            (segment.cross_track_m(truth.position()), heading_rad)
        } else {
            let station = segment.nearest(truth.position());
            (station.cross_track_m, station.heading_rad)
        };
        let course_rad = truth.theta_rad + reference.current.crab_rad;
        (cross_track_m, wrap_angle_rad(course_rad - heading_rad))
    }

    /// The trace as CSV, units in the header, numbers that read back to the same bits.
    pub fn to_csv(&self) -> String {
        let mut csv = String::with_capacity(self.rows.len() * 150);
        csv.push_str(HEADER);
        csv.push('\n');
        for row in &self.rows {
            let (p, t) = (row.pose, row.truth);
            csv.push_str(&format!(
                "{},{},{},{},{},{},{},{},{},{},{},{}\n",
                row.tick,
                p.x_m,
                p.y_m,
                p.theta_rad,
                t.x_m,
                t.y_m,
                t.theta_rad,
                row.speed_mps,
                row.omega_radps,
                row.cross_track_m,
                row.heading_error_rad,
                row.waypoint
            ));
        }
        csv
    }
}

/// Reads the rows of [`Trace::to_csv`] back; an error begins with the line it is about.
pub fn parse_csv(csv: &str) -> Result<Vec<TraceRow>, String> {
    let mut lines = csv.lines();
    if lines.next() != Some(HEADER) {
        return Err("trace.csv:1: not the header of a trace (tick,pose_x_m,…,waypoint)".to_owned());
    }
    let mut rows: Vec<TraceRow> = Vec::new();
    for (number, line) in (2..).zip(lines) {
        let row = parse_row(line).ok_or_else(|| {
            format!("trace.csv:{number}: not a row of {} numbers", HEADER.split(',').count())
        })?;
        if let Some(last) = rows.last().filter(|last| last.tick >= row.tick) {
            return Err(format!("trace.csv:{number}: tick {} does not come after {}", row.tick, last.tick));
        }
        rows.push(row);
    }
    Ok(rows)
}

fn parse_row(line: &str) -> Option<TraceRow> {
    let mut values = line.split(',');
    let tick = values.next()?.parse().ok()?;
    let mut number = || values.next()?.parse::<f64>().ok();
    let mut row = TraceRow {
        tick,
        pose: WorldPose::new(number()?, number()?, number()?),
        truth: WorldPose::new(number()?, number()?, number()?),
        speed_mps: number()?,
        omega_radps: number()?,
        cross_track_m: number()?,
        heading_error_rad: number()?,
        waypoint: 0,
    };
    row.waypoint = values.next()?.parse().ok()?;
    values.next().is_none().then_some(row)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::layout::WireField;
    use hilare_interfaces::messages::{Pose, Steps, Truth};

    #[test]
    fn the_trace_stays_bounded_and_evenly_spaced() {
        let mut trace = Trace::new(1);
        for tick in 0..(MAX_ROWS as u64 * 3) {
            trace.push(TickRecord {
                steps: &Steps { tick, ..Steps::ZERO },
                pose: &Pose::ZERO,
                truth: &Truth::ZERO,
                reference: &Reference::ZERO,
            });
        }
        assert!(trace.rows().len() <= MAX_ROWS);
        let gaps: Vec<u64> = trace.rows().windows(2).map(|pair| pair[1].tick - pair[0].tick).collect();
        assert!(gaps.iter().all(|gap| *gap == gaps[0]));
        assert_eq!(parse_csv(&trace.to_csv()).unwrap(), trace.rows());
        assert!(parse_csv("tick\n1,2").unwrap_err().starts_with("trace.csv:1: "));
        let row = "5,0,0,0,0,0,0,0,0,0,0,1";
        assert_eq!(parse_csv(&format!("{HEADER}\n{row}\n")).unwrap().len(), 1);
        for (second, wrong) in [("1,2", "not a row of 12 numbers"), (row, "tick 5 does not come after 5")] {
            let error = parse_csv(&format!("{HEADER}\n{row}\n{second}\n")).unwrap_err();
            assert_eq!(error, format!("trace.csv:3: {wrong}"));
        }
    }
}
