//! clarabel for a problem that is set up once and then updated in place, one solve a control period.

use clarabel::solver::{DefaultResiduals, DefaultSettings, DefaultSolver, IPSolver, SolverStatus};

/// Settings under which updates keep their pattern and a solve's time is bounded by `max_iter` alone:
/// presolve and the dropping of zeros would change the pattern; `time_limit` is wall clock and fires when
/// the host steals time; iterative refinement buys digits nobody needs. Equilibration is off: the laws'
/// problems come in numbers near 1.
pub fn settings(max_iter: u32, tolerance: f64) -> DefaultSettings<f64> {
    DefaultSettings {
        verbose: false,
        max_iter,
        time_limit: f64::INFINITY,
        max_threads: 1,
        presolve_enable: false,
        input_sparse_dropzeros: false,
        equilibrate_enable: false,
        tol_gap_abs: tolerance,
        tol_gap_rel: tolerance,
        tol_feas: tolerance,
        iterative_refinement_enable: false,
        ..DefaultSettings::default()
    }
}

/// Solves the problem written last. What was solved before makes no difference, to the bit; nonsense spoils
/// no answer but its own. Left to itself clarabel (0.11.1) clears an old product P x by multiplying it with
/// 0, which a NaN survives for ever.
pub fn solve(solver: &mut DefaultSolver<f64>) {
    solver.solve();
    let got_through = matches!(
        solver.solution.status,
        SolverStatus::Solved | SolverStatus::AlmostSolved | SolverStatus::MaxIterations
    );
    if !(got_through && solver.solution.x.iter().all(|value| value.is_finite())) {
        // Allocates, as nothing else does here: the fields are the solver's own.
        solver.residuals = DefaultResiduals::new(solver.variables.x.len(), solver.variables.z.len());
    }
}
