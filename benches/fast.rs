#![allow(missing_docs)]
use hilare::config::{Scenario, Task};
use hilare::shell::fast::{Candidate, FastPath};
use hilare::shell::in_process::InProcess;
use hilare_controller::kanayama::KanayamaGains;
use std::time::Instant;
struct R(u64);
impl R {
    fn u(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}
fn main() {
    let n: usize = std::env::args().nth(1).and_then(|a| a.parse().ok()).unwrap_or(200);
    let scenario = Scenario::load("trapezoid").unwrap();
    let Task::Follow(w) = &scenario.task else { panic!() };
    let mut r = R(7);
    let c: Vec<Candidate> = (0..n)
        .map(|_| Candidate {
            gains: KanayamaGains { k1_per_s: 5.0 * r.u(), k2_per_m2: 5e6 * r.u(), k3_per_m: 5e3 * r.u() },
            v_max_mps: 0.04 + 0.06 * r.u(),
            omega_max_radps: 0.75 * r.u(),
        })
        .collect();
    let path = FastPath::of(&scenario.system, w).unwrap();
    let cap = 60_000;
    let mut f = vec![Default::default(); n];
    for _ in 0..3 {
        let t = Instant::now();
        path.evaluate_with(1, &c, cap, &mut f);
        let e = t.elapsed();
        let ticks: u64 = f.iter().map(|f| f.ticks).sum();
        println!(
            "{n} candidates {} reached, {ticks} ticks, {:.2} ns/tick",
            f.iter().filter(|f| f.reached).count(),
            e.as_nanos() as f64 / ticks as f64
        );
    }
    let mut worst = [0.0f64; 6];
    let mut bad = 0;
    let m = 60.min(n);
    let t = Instant::now();
    let mut tk = 0;
    for (c, f) in c.iter().zip(&f).take(m) {
        let mut s = scenario.system.clone();
        s.set_all(&c.keys()).unwrap();
        let mut robot = InProcess::new(&s, w).unwrap();
        let g = robot.run(cap).statistics.figures();
        tk += g.ticks;
        if g.ticks != f.ticks
            || g.reached != f.reached
            || g.steps[..2] != f.steps
            || g.final_pose != [f.final_pose.x_m, f.final_pose.y_m, f.final_pose.theta_rad]
        {
            bad += 1;
            println!("{g:?}\n{f:?}\n{c:?}");
        }
        let d = [
            g.cross_track_mean_m - f.cross_track_mean_m,
            g.cross_track_max_m - f.cross_track_max_m,
            g.speed_error_mean_mps - f.speed_error_mean_mps,
            g.final_truth[0] - f.final_truth.x_m,
            g.final_truth[1] - f.final_truth.y_m,
            g.final_truth[2] - f.final_truth.theta_rad,
        ];
        for i in 0..6 {
            worst[i] = worst[i].max(d[i].abs());
        }
    }
    println!(
        "in-process {:.1} ns/tick; bad {bad}; worst {worst:?}",
        t.elapsed().as_nanos() as f64 / tk as f64
    );
}
