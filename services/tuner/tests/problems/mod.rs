//! Problems with known fronts: ZDT1–3 (Zitzler, Deb & Thiele 2000) and DTLZ2 (Deb et al. 2002).

use hilare_tuner::{Kind, Parameter, Space};

/// A problem of `variables` in 0 … 1.
pub struct Problem {
    pub name: &'static str,
    pub variables: usize,
    pub objectives: usize,
    /// Hypervolume below (1.1, …) that the worst of ten seeds must reach.
    pub hypervolume: f64,
    pub evaluate: fn(&[f64], &mut [f64]),
}

pub const PROBLEMS: [Problem; 4] = [
    Problem { name: "ZDT1", variables: 30, objectives: 2, hypervolume: 0.872, evaluate: zdt1 },
    // 0.539 is beyond what 100 points can do, by a digit (`fronts.rs`).
    Problem { name: "ZDT2", variables: 30, objectives: 2, hypervolume: 0.5388, evaluate: zdt2 },
    Problem { name: "ZDT3", variables: 30, objectives: 2, hypervolume: 1.327, evaluate: zdt3 },
    Problem { name: "DTLZ2", variables: 12, objectives: 3, hypervolume: 0.71, evaluate: dtlz2 },
];

impl Problem {
    pub fn space(&self) -> Space {
        let parameter = |n| Parameter { name: format!("x{n}"), low: 0.0, high: 1.0, kind: Kind::Real };
        Space::new((1..=self.variables).map(parameter).collect()).expect("a space")
    }
}

fn g(x: &[f64]) -> f64 {
    1.0 + 9.0 * x[1..].iter().sum::<f64>() / (x.len() - 1) as f64
}

fn zdt1(x: &[f64], f: &mut [f64]) {
    let g = g(x);
    f[0] = x[0];
    f[1] = g * (1.0 - (x[0] / g).sqrt());
}

fn zdt2(x: &[f64], f: &mut [f64]) {
    let g = g(x);
    f[0] = x[0];
    f[1] = g * (1.0 - (x[0] / g) * (x[0] / g));
}

fn zdt3(x: &[f64], f: &mut [f64]) {
    let g = g(x);
    let share = x[0] / g;
    f[0] = x[0];
    f[1] = g * (1.0 - share.sqrt() - share * libm::sin(10.0 * std::f64::consts::PI * x[0]));
}

fn dtlz2(x: &[f64], f: &mut [f64]) {
    let g: f64 = x[2..].iter().map(|x| (x - 0.5) * (x - 0.5)).sum();
    let (sin_a, cos_a) = libm::sincos(x[0] * std::f64::consts::FRAC_PI_2);
    let (sin_b, cos_b) = libm::sincos(x[1] * std::f64::consts::FRAC_PI_2);
    f[0] = (1.0 + g) * cos_a * cos_b;
    f[1] = (1.0 + g) * cos_a * sin_b;
    f[2] = (1.0 + g) * sin_a;
}
