//! `cargo bench -p hilare-controller --bench qp`: what a step of the predictive law costs.
//!
//! Closed loops on an ideal robot; time of every step of the law, untrimmed, on one core, and what its
//! solver did. With `-- --dump DIR` it also writes a tenth of the problems to a file a course, for another
//! solver to be run on the very same problems; `benches/osqp` does both and compares.
#![allow(missing_docs, unsafe_code, clippy::disallowed_methods, clippy::disallowed_macros)]

#[path = "../tests/ideal/mod.rs"]
mod ideal;

use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, ZeroConeT};
use hilare_controller::qp::omni::Omni;
use hilare_controller::qp::solver::Numbers;
use hilare_controller::qp::{Qp, QpParams};
use hilare_controller::{ControlLaw, LawInputs, LawOutput};
use hilare_interfaces::chassis::Chassis;
use hilare_interfaces::messages::{Fallback, Waypoint};
use ideal::{Course, Disturbance, PERIOD_S, RECTANGLE, points_of};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// Runs of each course.
const ROUNDS: usize = 3;
/// So many problems in a row are solved again by others, as a warm start needs its forerunner, …
const BURST: usize = 50;
/// … and one such burst in so many.
const EVERY: usize = 10;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let dump = arguments.iter().position(|argument| argument == "--dump");
    let dump = dump.map(|at| PathBuf::from(arguments.get(at + 1).expect("--dump DIR")));
    println!("a control period is {:.0} us, a tenth of it {:.0} us", PERIOD_S * 1e6, PERIOD_S * 1e5);
    println!(
        "{:<22} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>7} {:>5} {:>4} {:>6} {:>9}",
        "",
        "steps",
        "p50us",
        "p99us",
        "p99.9",
        "max us",
        "p99/T",
        "iter",
        "max",
        "all.",
        "fallb.",
        "u0 error"
    );
    for (name, course) in courses() {
        let record = Arc::new(Mutex::new(Record::default()));
        for _ in 0..ROUNDS {
            let law = Watched { law: Law::new(&course), record: Arc::clone(&record) };
            let run = course.run(Box::new(law), Disturbance::NONE);
            assert!(run.arrived, "{name}: {run:?}");
        }
        let record = record.lock().expect("one thread");
        record.print(name);
        if let Some(folder) = &dump {
            record.write(File::create(folder.join(format!("{name}.qp"))).expect("a file"));
        }
    }
}

fn courses() -> Vec<(&'static str, Course)> {
    let so = points_of(include_str!("../../../launch/scenarios/so.csv"));
    let rectangle = RECTANGLE.map(|(x, y)| Waypoint::straight(2.5 * x, 2.5 * y));
    let mut mixed = rectangle.to_vec();
    mixed[2].bulge = 1.0;
    mixed[3].crab_rad = std::f64::consts::FRAC_PI_2;
    let mut hurried = Course::mecanum(&mixed);
    (hurried.speed_mps, hurried.limits.v_max_mps, hurried.limits.omega_max_radps) = (0.7, 0.9, 2.5);
    vec![
        ("differential-rectangle", Course::epuck(&RECTANGLE)),
        ("differential-so", Course::epuck(&so)),
        ("mecanum-rectangle", Course::mecanum(&rectangle)),
        ("mecanum-mixed", Course::mecanum(&mixed)),
        ("mecanum-at-its-limits", hurried),
    ]
}

enum Law {
    Differential(Box<Qp>),
    Mecanum(Box<Omni>),
}

impl Law {
    fn new(course: &Course) -> Self {
        let (setup, params) = (course.setup(&[]), QpParams::default());
        match course.chassis {
            Chassis::Differential(_) => Self::Differential(Box::new(Qp::new(&setup, params))),
            Chassis::Mecanum(robot) => Self::Mecanum(Box::new(Omni::new(&setup, robot, params))),
        }
    }

    fn numbers(&self) -> Numbers<'_> {
        match self {
            Self::Differential(law) => law.numbers(),
            Self::Mecanum(law) => law.numbers(),
        }
        .expect("a solver")
    }

    fn iterations(&self) -> u32 {
        match self {
            Self::Differential(law) => law.iterations(),
            Self::Mecanum(law) => law.iterations(),
        }
    }

    /// The first input as a share of the range: of speeds and yaw rates.
    fn first_input(&self, x: &[f64]) -> [f64; 3] {
        match self {
            Self::Differential(_) => {
                let (k, z) = (x[0], x[x.len() / 2]);
                [1.0 / z, 0.0, 0.5 * k / z]
            }
            Self::Mecanum(_) => [0.5 * x[0], 0.5 * x[1], 0.5 * x[2]],
        }
    }
}

/// A law whose steps are timed and counted.
struct Watched {
    law: Law,
    record: Arc<Mutex<Record>>,
}

impl ControlLaw for Watched {
    fn step(&mut self, inputs: LawInputs<'_>) -> LawOutput {
        let (allocated, start) = (COUNT.get(), Instant::now());
        let output = match &mut self.law {
            Law::Differential(law) => law.step(inputs),
            Law::Mecanum(law) => law.step(inputs),
        };
        let (time, allocated) = (start.elapsed(), COUNT.get() - allocated);
        let mut record = self.record.lock().expect("one thread");
        record.times_us.push(time.as_secs_f64() * 1e6);
        record.allocations = record.allocations.max(allocated);
        record.iterations.push(self.law.iterations());
        record.fallbacks += usize::from(output.fallback != Fallback::None);
        if ((record.times_us.len() - 1) / BURST).is_multiple_of(EVERY) {
            record.solve_again(&self.law);
        }
        output
    }

    fn reset(&mut self) {
        match &mut self.law {
            Law::Differential(law) => law.reset(),
            Law::Mecanum(law) => law.reset(),
        }
    }
}

/// What was seen of the steps.
#[derive(Default)]
struct Record {
    times_us: Vec<f64>,
    iterations: Vec<u32>,
    allocations: u64,
    fallbacks: usize,
    /// Greatest distance of the first input from that of a solution to 1e-10, as a share of the range.
    error: f64,
    problems: Vec<Dumped>,
}

/// A problem, with our solution and one to 1e-10.
struct Dumped {
    /// Number of equations, then P, q, A, b, ours, exact.
    lines: Vec<String>,
}

impl Record {
    fn solve_again(&mut self, law: &Law) {
        let numbers = law.numbers();
        let exact = exact(&numbers);
        let (a, b) = (law.first_input(numbers.solution), law.first_input(&exact));
        for (a, b) in a.iter().zip(b) {
            self.error = self.error.max((a - b).abs());
        }
        self.problems.push(Dumped::new(&numbers, &exact));
    }

    fn print(&self, name: &str) {
        let mut times = self.times_us.clone();
        times.sort_by(f64::total_cmp);
        let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
        let mean = self.iterations.iter().sum::<u32>() as f64 / self.iterations.len() as f64;
        println!(
            "{name:<22} {:>6} {:>6.0} {:>6.0} {:>6.0} {:>6.0} {:>5.1}% {mean:>7.2} {:>5} {:>4} {:>6} {:>9.1e}",
            times.len(),
            at(0.5),
            at(0.99),
            at(0.999),
            at(1.0),
            at(0.99) / PERIOD_S / 1e4,
            self.iterations.iter().max().expect("steps"),
            self.allocations,
            self.fallbacks,
            self.error,
        );
    }

    fn write(&self, file: File) {
        let mut file = BufWriter::new(file);
        for line in self.problems.iter().flat_map(|problem| &problem.lines) {
            writeln!(file, "{line}").expect("written");
        }
    }
}

impl Dumped {
    fn new(numbers: &Numbers<'_>, exact: &[f64]) -> Self {
        let floats = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
        let places = |values: &[usize]| values.iter().map(usize::to_string).collect::<Vec<_>>().join(" ");
        let (p, a) = (numbers.hessian, numbers.matrix);
        let lines = vec![
            numbers.equations.to_string(),
            places(&p.colptr),
            places(&p.rowval),
            floats(&p.nzval),
            floats(numbers.gradient),
            places(&a.colptr),
            places(&a.rowval),
            floats(&a.nzval),
            floats(numbers.bound),
            floats(numbers.solution),
            floats(exact),
        ];
        Self { lines }
    }
}

fn exact(numbers: &Numbers<'_>) -> Vec<f64> {
    let settings = DefaultSettings {
        verbose: false,
        max_iter: 500,
        tol_gap_abs: 1e-12,
        tol_gap_rel: 1e-14,
        tol_feas: 1e-10,
        equilibrate_enable: false,
        static_regularization_proportional: 0.0,
        ..DefaultSettings::default()
    };
    let cones = [ZeroConeT(numbers.equations), NonnegativeConeT(numbers.bound.len() - numbers.equations)];
    let (p, a) = (numbers.hessian, numbers.matrix);
    let mut solver =
        DefaultSolver::new(p, numbers.gradient, a, numbers.bound, &cones, settings).expect("valid");
    solver.solve();
    solver.solution.x.clone()
}

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call goes to the system allocator unchanged; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;
