//! Figures 5 and 6: the plan in closed form, carried out on the paper's model.

use super::super::rows::{Ours, Rows};
use super::super::runs::Job;
use crate::manager::Failure;
use hilare_controller::finite_step::plan::{Deviation, FiniteStep, Model};

/// Step counts drawn: the paper's times, 0.8 to 1.2 s, as steps of 0.1 s, and one far longer.
pub const STEPS: [usize; 4] = [8, 10, 12, 20];
/// The step count whose speeds are compared.
const COMPARED: usize = 10;

/// The plans at one speed.
pub struct Simulated {
    /// v_τ, m/s.
    pub along_mps: f64,
    /// T_s, s.
    pub sample_s: f64,
    /// Of each of [`STEPS`], the states 0 to N.
    pub states: Vec<Vec<Deviation>>,
    plans: Vec<FiniteStep>,
    start: Deviation,
}

impl Simulated {
    /// From the deviations and the speed of a scenario.
    pub fn of(job: &Job) -> Result<Self, Failure> {
        let along_mps = job.number("tracking.speed_mps")?;
        let sample_s = job.number("controller.finite-step.sample_period_s")?;
        let validity_rad = job.number("controller.finite-step.validity_rad")?;
        let start =
            Deviation { heading_rad: job.number("start.theta_rad")?, distance_m: job.number("start.y_m")? };
        let model = Model { sample_s, along_mps, validity_rad };
        let plans: Vec<_> = STEPS.iter().map(|steps| FiniteStep::new(&model, start, *steps)).collect();
        let states = plans.iter().map(|plan| carry_out(&model, start, plan)).collect();
        Ok(Self { along_mps, sample_s, states, plans, start })
    }

    /// Greatest |e_d| of a plan, mm.
    fn peak_mm(&self, index: usize) -> f64 {
        self.states[index].iter().map(|state| state.distance_m.abs() * 1e3).fold(0.0, f64::max)
    }

    fn greatest(&self, value: impl Fn(&FiniteStep) -> f64) -> f64 {
        self.plans.iter().map(value).fold(0.0, f64::max)
    }

    /// Its lines of a figure, but for what compares speeds.
    pub fn give(&self, rows: &mut Rows, item: &str) {
        let ends = || self.states.iter().filter_map(|states| states.last());
        let distance = ends().map(|end| end.distance_m.abs() * 1e3).fold(0.0, f64::max);
        let angle = ends().map(|end| end.heading_rad.abs().to_degrees()).fold(0.0, f64::max);
        let steps = STEPS.map(|steps| steps.to_string()).join(", ");
        let landing = format!("the greatest of N = {steps}: both reach zero at step N");
        rows.give(item, "landing_distance", Ours::One(distance), landing.as_str());
        rows.give(item, "landing_angle", Ours::One(angle), landing);
        let v_x = self.greatest(|plan| plan.v_x(0).abs());
        rows.give(item, "v_x", Ours::One(v_x), format!("of N = {steps}, at the first step"));
        let inside = self.greatest(|plan| (plan.v_x(0) - plan.v_x(1)).abs() / self.sample_s);
        rows.give(item, "accel", Ours::One(inside), "greatest at the first step, as the paper finds");
        let entry = self.greatest(|plan| plan.v_x(0).abs() / self.sample_s);
        let why = "(22) leaves the jump from the speed in action to v_x(0) out, and so allows N = 1 even; where a_max \
                   counts for it too, no N does. Our law counts it and falls back to a plan with hard bounds";
        rows.give(item, "entry", Ours::One(entry), why);
        if item == "figure 5" {
            let drawn = format!("N = {steps}");
            rows.give(
                item,
                "steps",
                Ours::Text(drawn),
                "the printed 0.8 to 1.2 s in steps of 0.1 s, and one longer",
            );
            let peaks = (0..STEPS.len()).map(|index| format!("{:.1}", self.peak_mm(index)));
            let peaks = format!("{} mm for N = {steps}", peaks.collect::<Vec<_>>().join(", "));
            rows.give(item, "overshoot", Ours::Text(peaks), "10 mm is the deviation at the start");
            let why = "misprint: e_θ(0)/(N T_s), the same at every step, is what gives (16); printed is (N − k) times it";
            rows.give(item, "printed", Ours::One(self.as_printed_rad().to_degrees()), why);
        }
    }

    /// e_θ after [`COMPARED`] steps with ω_z(k) = (N − k)/(N T_s) e_θ(0), as (21) is printed.
    fn as_printed_rad(&self) -> f64 {
        let steps = COMPARED as f64;
        (0..COMPARED).fold(self.start.heading_rad, |angle, k| {
            let rate_radps = (steps - k as f64) / (steps * self.sample_s) * self.start.heading_rad;
            angle - rate_radps * self.sample_s
        })
    }
}

fn carry_out(model: &Model, start: Deviation, plan: &FiniteStep) -> Vec<Deviation> {
    let mut states = vec![start];
    for k in 0..plan.steps {
        let next = model.next(states[k], plan.turn().rate_radps(k, model.sample_s), plan.v_x(k));
        states.push(next);
    }
    states
}

/// What figure 6 is drawn for: the same plans at the two speeds.
pub fn compare(rows: &mut Rows, simulated: &[Simulated]) {
    let index = STEPS.iter().position(|steps| *steps == COMPARED).unwrap_or_default();
    let peaks = simulated.iter().map(|at| format!("{:.1} mm at {} m/s", at.peak_mm(index), at.along_mps));
    let text = format!("N = {COMPARED}: {}", peaks.collect::<Vec<_>>().join(", "));
    rows.give("figure 6", "overshoot", Ours::Text(text), "10 mm is the deviation at the start");
}
