//! Low-discrepancy samples.

use crate::map::GridPoint;

/// The R2 sequence: multiples of (1/ρ, 1/ρ²) modulo 1, ρ the plastic number, root of ρ³ = ρ + 1
/// (Roberts, *The unreasonable effectiveness of quasirandom sequences*, 2018), started at a point that the
/// seed picks (a Cranley–Patterson rotation).
///
/// Kept in 64-bit fixed point: addition wraps by itself and is the same on every machine.
#[derive(Clone, Debug)]
pub struct Sequence {
    u: u64,
    v: u64,
}

/// 2^64 / ρ and 2^64 / ρ².
const STEP_U: u64 = 13_925_035_116_211_876_495;
const STEP_V: u64 = 10_511_698_010_929_265_437;

impl Sequence {
    /// The sequence of a seed.
    pub fn new(seed: u64) -> Self {
        Self { u: mix(seed), v: mix(seed ^ 0x9e37_79b9_7f4a_7c15) }
    }

    /// The next point of \[0, width) × \[0, height).
    pub fn next_in(&mut self, width: f64, height: f64) -> GridPoint {
        const UNIT: f64 = 1.0 / (1u64 << 53) as f64;
        self.u = self.u.wrapping_add(STEP_U);
        self.v = self.v.wrapping_add(STEP_V);
        GridPoint::new((self.u >> 11) as f64 * UNIT * width, (self.v >> 11) as f64 * UNIT * height)
    }
}

/// SplitMix64's finaliser (Steele, Lea, Flood, *Fast splittable pseudorandom number generators*, 2014).
fn mix(seed: u64) -> u64 {
    let mut z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_powers_of_the_plastic_number() {
        let rho = 1.324_717_957_244_746;
        let two64 = 18_446_744_073_709_551_616.0;
        assert!((STEP_U as f64 / two64 - 1.0 / rho).abs() < 1e-14);
        assert!((STEP_V as f64 / two64 - 1.0 / (rho * rho)).abs() < 1e-14);
    }

    #[test]
    fn samples_fill_every_cell_of_a_coarse_grid() {
        let mut seen = [0u32; 64];
        let mut sequence = Sequence::new(7);
        for _ in 0..640 {
            let p = sequence.next_in(8.0, 8.0);
            seen[p.v as usize * 8 + p.u as usize] += 1;
        }
        assert!(seen.iter().all(|&n| (7..=13).contains(&n)), "{seen:?}");
    }
}
