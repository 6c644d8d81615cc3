//! `cargo bench --bench fast`: a whole tuning's 20 000 runs of the paper's trapezoid on the fast path, all cores.
//!
//! In rounds, each beside the in-process run of some of the same candidates (bare, and recorded as it has to be for
//! the figures), and beside two yardsticks in vectors of the same width: additions and multiplications as fast as a
//! core makes them, and a bare loop: two accumulators, their comparisons and the steps' sums, what is left of a tick
//! when heading, law, truth and figures are free. Times a tick are processor time of one core: a busy host spoils
//! them less.
#![allow(missing_docs)]
#![allow(unsafe_code, reason = "the yardsticks, too, are compiled for some processors only")]

use hilare::config::{Scenario, System, Task};
use hilare::shell::fast::{Candidate, FastFigures, FastPath};
use hilare::shell::in_process::InProcess;
use hilare_controller::kanayama::KanayamaGains;
use hilare_interfaces::messages::Waypoint;
use rustix::time::{ClockId, clock_gettime};
use std::hint::black_box;
use std::time::{Duration, Instant};

const EVALUATIONS: usize = 20_000;
const ROUNDS: usize = 20;
/// Candidates a round that are driven in-process, too.
const SAMPLE: usize = 12;
/// A run that has not arrived after a minute is of no use to a tuner; point A takes 37 s.
const TICKS_MAX: u64 = 60_000;
const LANES: usize = 16;
/// Additions, multiplications, comparisons and divisions the sources of the fast path ask for in a tick of a lane: of
/// pulses and heading 16, its sine and cosine 58, the estimate 6, the truth and its distance from the line 17, and
/// of law, constraints and figures 116 every five ticks (6 of them divisions, which take longer).
const OPERATIONS: f64 = 16.0 + 58.0 + 6.0 + 17.0 + 116.0 / 5.0;

fn main() {
    let scenario = Scenario::load("trapezoid").expect("built in");
    let Task::Follow(waypoints) = &scenario.task else { panic!("it is a path") };
    let path = FastPath::of(&scenario.system, waypoints).expect("it applies");
    let candidates = candidates();
    let mut figures = Vec::with_capacity(EVALUATIONS);
    let [mut fast, mut bare, mut recorded, mut floor, mut operation] = [const { Vec::new() }; 5];
    let mut wall = Duration::ZERO;
    for round in candidates.chunks(EVALUATIONS / ROUNDS) {
        let start = Instant::now();
        fast.push(time_a_tick(|| {
            let came_to = path.evaluate(round, TICKS_MAX);
            let ticks = came_to.iter().map(|figures| figures.ticks).sum();
            figures.extend(came_to);
            ticks
        }));
        wall += start.elapsed();
        let sample = &round[..SAMPLE];
        bare.push(time_a_tick(|| in_process(&scenario.system, waypoints, sample, drive_bare)));
        recorded.push(time_a_tick(|| in_process(&scenario.system, waypoints, sample, drive_recorded)));
        floor.push(time_a_tick(in_vectors::<BareLoop>));
        operation.push(time_a_tick(in_vectors::<Operations>));
    }
    report(&figures, wall, [&mut fast, &mut bare, &mut recorded, &mut floor, &mut operation]);
}

/// Evenly in table 2's ranges.
fn candidates() -> Vec<Candidate> {
    let mut state = 1u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut candidate = || Candidate {
        gains: KanayamaGains {
            k1_per_s: 5.0 * uniform(),
            k2_per_m2: 5e6 * uniform(),
            k3_per_m: 5000.0 * uniform(),
        },
        v_max_mps: 0.04 + 0.06 * uniform(),
        omega_max_radps: 0.75 * uniform(),
    };
    (0..EVALUATIONS).map(|_| candidate()).collect()
}

/// Processor time of a tick, ns; `work` says how many there were.
fn time_a_tick(work: impl FnOnce() -> u64) -> f64 {
    let start = processor_ns();
    let ticks = work();
    (processor_ns() - start) / ticks as f64
}

fn processor_ns() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 * 1e9 + time.tv_nsec as f64
}

fn in_process(
    system: &System,
    waypoints: &[Waypoint],
    candidates: &[Candidate],
    drive: fn(InProcess) -> u64,
) -> u64 {
    let run = |candidate: &Candidate| {
        let mut system = system.clone();
        system.set_all(&candidate.keys()).expect("within their bounds");
        drive(InProcess::new(&system, waypoints).expect("a robot"))
    };
    candidates.iter().map(run).sum()
}

fn drive_bare(mut robot: InProcess) -> u64 {
    (0..TICKS_MAX).take_while(|_| robot.tick()).count() as u64
}

fn drive_recorded(mut robot: InProcess) -> u64 {
    robot.run(TICKS_MAX).statistics.ticks()
}

/// What a core can do at most.
trait Yardstick {
    /// Does a part of it for as many periods; how many ticks or operations that was.
    fn run(periods: u64) -> u64;
}

/// Compiled for the vectors that the fast path uses here.
fn in_vectors<Y: Yardstick>() -> u64 {
    const PERIODS: u64 = 200_000;
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::is_x86_feature_detected as has;
        if has!("avx512f") && has!("avx512dq") && has!("avx512vl") {
            // SAFETY: the processor has what the function needs.
            return unsafe { with_avx512::<Y>(PERIODS) };
        }
        if has!("avx2") {
            // SAFETY: as above.
            return unsafe { with_avx2::<Y>(PERIODS) };
        }
    }
    Y::run(PERIODS)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl")]
fn with_avx512<Y: Yardstick>(periods: u64) -> u64 {
    Y::run(periods)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<Y: Yardstick>(periods: u64) -> u64 {
    Y::run(periods)
}

/// Additions and multiplications that wait for nothing, one of each in turn.
struct Operations;

impl Yardstick for Operations {
    #[inline(always)]
    fn run(periods: u64) -> u64 {
        const WIDE: usize = 3 * LANES;
        const DEEP: usize = 16;
        let (mut sums, mut products) = (black_box([0.5; WIDE]), black_box([0.5; WIDE]));
        let (term, factor) = (black_box(1e-9), black_box(0.999_999_999));
        for _ in 0..periods {
            for (sum, product) in sums.iter_mut().zip(&mut products) {
                let (mut now_sum, mut now_product) = (*sum, *product);
                for _ in 0..DEEP {
                    now_sum += term;
                    now_product *= factor;
                }
                (*sum, *product) = (now_sum, now_product);
            }
        }
        black_box((sums, products));
        periods * (2 * WIDE * DEEP) as u64
    }
}

/// Ticks of lanes in which next to nothing is done.
struct BareLoop;

impl Yardstick for BareLoop {
    #[inline(always)]
    fn run(periods: u64) -> u64 {
        bare_lanes(periods);
        periods * 5 * LANES as u64
    }
}

#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "a lane is one place in many rows")]
fn bare_lanes(periods: u64) {
    const STEP: f64 = 0.0065;
    let per_tick: [[f64; LANES]; 2] =
        black_box([0.0019, 0.0021].map(|rad| std::array::from_fn(|lane| rad + 1e-5 * lane as f64)));
    let (ahead_x, ahead_y) = (black_box([1.2e-4; LANES]), black_box([0.5e-4; LANES]));
    let (mut owed, mut counts) = ([[0.0; LANES]; 2], [[0.0; LANES]; 2]);
    let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
    for _ in 0..periods {
        for lane in 0..LANES {
            let mut now = [owed[0][lane], owed[1][lane]];
            let mut counted = [counts[0][lane], counts[1][lane]];
            let (mut at_x, mut at_y) = (x[lane], y[lane]);
            for _ in 0..5 {
                let mut steps = 0.0;
                for wheel in 0..2 {
                    let angle = now[wheel] + per_tick[wheel][lane];
                    let forward = if angle >= STEP { 1.0 } else { 0.0 };
                    let step = if angle <= -STEP { -1.0 } else { forward };
                    now[wheel] = angle - STEP * step;
                    counted[wheel] += step;
                    steps += step;
                }
                at_x += steps * ahead_x[lane];
                at_y += steps * ahead_y[lane];
            }
            [owed[0][lane], owed[1][lane]] = now;
            [counts[0][lane], counts[1][lane]] = counted;
            (x[lane], y[lane]) = (at_x, at_y);
        }
        // As the fast path, which looks at its lanes once a period.
        black_box((&mut x, &mut y));
    }
    black_box((owed, counts));
}

fn report(figures: &[FastFigures], wall: Duration, times: [&mut Vec<f64>; 5]) {
    let [fast, bare, recorded, floor, operation] = times.map(|times| {
        times.sort_by(f64::total_cmp);
        [times[0], times[times.len() / 2], times[times.len() - 1]]
    });
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let ticks: u64 = figures.iter().map(|figures| figures.ticks).sum();
    let reached = figures.iter().filter(|figures| figures.reached).count();
    println!(
        "{} runs of the trapezoid, {:.0} ticks each in the mean ({reached} arrive within {TICKS_MAX}): {:.1} s on {cores} cores",
        figures.len(),
        ticks as f64 / figures.len() as f64,
        wall.as_secs_f64()
    );
    println!("processor time of a tick, ns       least     p50    most   of {ROUNDS} rounds");
    let rows = [
        ("fast path", fast),
        ("in-process, bare", bare),
        ("in-process, recorded", recorded),
        ("bare loop", floor),
        ("its operations, at most", operation.map(|time| time * OPERATIONS)),
    ];
    for (name, [least, median, most]) in rows {
        println!("  {name:<30} {least:>7.2} {median:>7.2} {most:>7.2}");
    }
    println!("million ticks a second and core    {:>7.1}", 1e3 / fast[1]);
    println!(
        "faster than the in-process run by  {:>7.1} (bare), {:.1} (recorded)",
        bare[1] / fast[1],
        recorded[1] / fast[1]
    );
    println!(
        "share of what is possible          {:>7.2} (its operations, and nothing waits), {:.2} (bare loop)",
        operation[1] * OPERATIONS / fast[1],
        floor[1] / fast[1]
    );
}
