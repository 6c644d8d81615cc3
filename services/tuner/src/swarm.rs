//! The swarm: particles that fly about the unit cube after what was found best.
//!
//! Coello's MOPSO (Coello Coello, Toscano Pulido & Salazar Lechuga, IEEE Trans. Evol. Comput. 8(3), 2004): every
//! particle remembers its own best and follows a leader out of an external archive. It flies as in SMPSO
//! (Nebro et al., MCDM 2009), whose constriction keeps it from flying off at high speeds:
//!
//! ```text
//! fly      v ← χ (w v + c1 r1 (own best − x) + c2 r2 (leader − x)),  |v| ≤ ½      χ of Clerc & Kennedy
//!          x ← x + v; at a border it stays there and v turns round
//! scout    x ← a + F (b − c) in some coordinates, a in the others                 a, b, c of the archive
//! ```
//!
//! Flying alone stalls: on ZDT1 the worst of ten seeds ends at a hypervolume of 0.857 of 0.872, on ZDT3 at 0.96
//! of 1.33. So three in four particles scout instead, from the archive, along differences between its members, as
//! differential evolution does (Storn & Price 1997): what members differ in is the direction of the front. They set
//! out where it is thin: a is the least crowded of four.
//!
//! Every fifth particle is mutated (polynomial mutation, Deb & Goyal 1996). Infeasible candidates lose against
//! feasible ones, and among themselves the smaller violation wins (Deb et al. 2002).

use crate::archive::{Archive, Found, OBJECTIVES_MAX};
use crate::random::Random;
use crate::space::Space;
use std::fmt;

/// Inertia w.
const INERTIA: f64 = 0.1;
/// c1 and c2 are drawn between these.
const PULL: (f64, f64) = (1.5, 2.5);
/// Greatest speed along an axis, in widths of the space.
const SPEED_MAX: f64 = 0.5;
/// One in so many particles flies, the others scout.
const FLYING: usize = 4;
/// Members the archive must have for that; with fewer there are hardly any differences, and all fly.
const SCOUTED_MIN: usize = 4;
/// F is drawn between these.
const STRIDE: (f64, f64) = (1.25, 1.75);
/// Share of the coordinates in which a scout leaves a; one at least.
const CROSSED: f64 = 0.15;
/// Members of whom the least crowded leads a particle that flies, and one that scouts.
const LED_BY_BEST_OF: usize = 2;
const SCOUTS_FROM_BEST_OF: usize = 4;
/// One in so many particles is mutated.
const MUTATED: usize = 5;
/// Distribution index η of the mutation: large is near.
const MUTATION_INDEX: f64 = 20.0;

/// How a space is searched.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Objectives, all minimised: two or three.
    pub objectives: usize,
    /// Particles: candidates a generation.
    pub swarm: usize,
    /// Members the archive holds at most.
    pub archive: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Values to begin with instead of random ones, such as those in use; at most `swarm`.
    pub starts: Vec<Vec<f64>>,
    /// Objectives beyond which a solution is of no use: such ones leave a full archive first.
    pub reference: Option<Vec<f64>>,
}

impl Settings {
    /// A swarm of 50 and an archive of 100.
    pub fn new(objectives: usize, seed: u64) -> Self {
        Self { objectives, swarm: 50, archive: 100, seed, starts: Vec::new(), reference: None }
    }
}

/// Why a search cannot begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SettingsError {
    /// Neither two nor three objectives.
    Objectives,
    /// A swarm of 0 or more than 100 000 particles.
    Swarm,
    /// An archive of fewer than 4 or more than 10 000 members.
    Archive,
    /// There are more starts than particles, or one is not in the space.
    Starts,
    /// The reference has another number of objectives, or one is not a number.
    Reference,
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Objectives => "two or three objectives are wanted",
            Self::Swarm => "the swarm must have 1 to 100000 particles",
            Self::Archive => "the archive must have room for 4 to 10000 members",
            Self::Starts => "the starts must be in the space, and no more than particles",
            Self::Reference => "the reference must have a number for each objective",
        })
    }
}

impl std::error::Error for SettingsError {}

/// A search in progress. The same space, settings and outcomes give the same candidates, to the bit.
#[derive(Clone, Debug)]
pub struct Mopso {
    space: Space,
    settings: Settings,
    random: Random,
    archive: Archive,
    /// By particle: coordinates, velocities, values shown; own best with what it came to.
    coordinates: Vec<f64>,
    velocities: Vec<f64>,
    values: Vec<f64>,
    best: Vec<f64>,
    best_objectives: Vec<f64>,
    best_violations: Vec<f64>,
    /// Outcomes of the generation under way, to be filled in.
    objectives: Vec<f64>,
    violations: Vec<f64>,
    evaluations: u64,
}

/// The generation to be evaluated: values of each particle, and room for objectives and violations.
pub(crate) struct Generation<'a> {
    pub values: &'a [f64],
    pub objectives: &'a mut [f64],
    pub violations: &'a mut [f64],
}

impl Mopso {
    /// A search that has not begun.
    pub fn new(space: Space, settings: Settings) -> Result<Self, SettingsError> {
        let Settings { objectives, swarm, archive, seed, starts, reference } = &settings;
        let (objectives, swarm) = (*objectives, *swarm);
        if !(2..=OBJECTIVES_MAX).contains(&objectives) {
            return Err(SettingsError::Objectives);
        }
        if !(1..=100_000).contains(&swarm) {
            return Err(SettingsError::Swarm);
        }
        if !(4..=10_000).contains(archive) {
            return Err(SettingsError::Archive);
        }
        let sound = |reference: &Vec<f64>| {
            reference.len() == objectives && reference.iter().all(|limit| !limit.is_nan())
        };
        if !reference.as_ref().is_none_or(sound) {
            return Err(SettingsError::Reference);
        }
        let starts: Option<Vec<Vec<f64>>> = starts.iter().map(|values| space.encode(values)).collect();
        let starts = starts.filter(|starts| starts.len() <= swarm).ok_or(SettingsError::Starts)?;
        let dimensions = space.dimensions();
        let mut random = Random::new(*seed);
        let mut coordinates: Vec<f64> = (0..swarm * dimensions).map(|_| random.unit()).collect();
        for (particle, start) in coordinates.chunks_mut(dimensions).zip(&starts) {
            particle.copy_from_slice(start);
        }
        Ok(Self {
            archive: Archive::new(objectives, dimensions, *archive, reference.as_deref()),
            velocities: vec![0.0; swarm * dimensions],
            values: vec![0.0; swarm * dimensions],
            best: coordinates.clone(),
            best_objectives: vec![0.0; swarm * objectives],
            best_violations: vec![f64::INFINITY; swarm],
            objectives: vec![0.0; swarm * objectives],
            violations: vec![0.0; swarm],
            evaluations: 0,
            coordinates,
            random,
            space,
            settings,
        })
    }

    /// What is searched.
    pub fn space(&self) -> &Space {
        &self.space
    }

    /// How.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The best so far.
    pub fn archive(&self) -> &Archive {
        &self.archive
    }

    /// Evaluations that were taken in.
    pub fn evaluations(&self) -> u64 {
        self.evaluations
    }

    /// Moves the swarm, except before its first generation.
    pub(crate) fn ask(&mut self) -> Generation<'_> {
        let dimensions = self.space.dimensions();
        if self.evaluations > 0 {
            let scouting = self.archive.len() >= SCOUTED_MIN;
            for particle in 0..self.settings.swarm {
                if scouting && particle % FLYING != 0 {
                    self.scout(particle);
                } else {
                    self.fly(particle);
                }
                if particle % MUTATED == 0 {
                    let range = particle * dimensions..(particle + 1) * dimensions;
                    mutate(&mut self.coordinates[range], &mut self.random);
                }
            }
        }
        for (values, coordinates) in
            self.values.chunks_mut(dimensions).zip(self.coordinates.chunks(dimensions))
        {
            self.space.decode(coordinates, values);
        }
        Generation {
            values: &self.values,
            objectives: &mut self.objectives,
            violations: &mut self.violations,
        }
    }

    #[inline]
    fn fly(&mut self, particle: usize) {
        let random = &mut self.random;
        let Some(leader) = self.archive.leader(LED_BY_BEST_OF, random) else { return };
        let (r1, r2) = (random.unit(), random.unit());
        let (c1, c2) = (random.between(PULL.0, PULL.1), random.between(PULL.0, PULL.1));
        let chi = constriction(c1 + c2);
        let (inertia, own, led) = (chi * INERTIA, chi * c1 * r1, chi * c2 * r2);
        let dimensions = self.space.dimensions();
        let range = particle * dimensions..(particle + 1) * dimensions;
        let places = self.coordinates[range.clone()].iter_mut().zip(&mut self.velocities[range.clone()]);
        for (((x, v), best), led_to) in places.zip(&self.best[range]).zip(leader) {
            let speed = inertia * *v + own * (best - *x) + led * (led_to - *x);
            *v = speed.clamp(-SPEED_MAX, SPEED_MAX);
            *x += *v;
            if *x < 0.0 || *x > 1.0 {
                *x = x.clamp(0.0, 1.0);
                *v = -*v;
            }
        }
    }

    #[inline]
    fn scout(&mut self, particle: usize) {
        let (random, archive) = (&mut self.random, &self.archive);
        let mut member = |best_of| archive.leader(best_of, random);
        let (Some(a), Some(b), Some(c)) = (member(SCOUTS_FROM_BEST_OF), member(1), member(1)) else { return };
        let stride = random.between(STRIDE.0, STRIDE.1);
        let dimensions = self.space.dimensions();
        let certain = random.below(dimensions);
        let coordinates = &mut self.coordinates[particle * dimensions..][..dimensions];
        for (axis, x) in coordinates.iter_mut().enumerate() {
            let crossed = axis == certain || random.unit() < CROSSED;
            *x = if crossed { (a[axis] + stride * (b[axis] - c[axis])).clamp(0.0, 1.0) } else { a[axis] };
        }
    }

    /// Takes in the outcomes of the first `count` particles.
    pub(crate) fn tell(&mut self, count: usize) {
        let (dimensions, objectives) = (self.space.dimensions(), self.settings.objectives);
        for particle in 0..count {
            let found = &self.objectives[particle * objectives..][..objectives];
            let coordinates = &self.coordinates[particle * dimensions..][..dimensions];
            let violation = sound(found, self.violations[particle]);
            let own = &mut self.best_objectives[particle * objectives..][..objectives];
            if !dominates(own, self.best_violations[particle], found, violation) {
                own.copy_from_slice(found);
                self.best_violations[particle] = violation;
                self.best[particle * dimensions..][..dimensions].copy_from_slice(coordinates);
            }
            let evaluation = self.evaluations + particle as u64;
            self.archive.offer(Found { objectives: found, violation, coordinates, evaluation });
        }
        self.evaluations += count as u64;
    }
}

/// A violation as it counts: beyond measure if it, or an objective, is no number.
fn sound(objectives: &[f64], violation: f64) -> f64 {
    if violation.is_nan() || objectives.iter().any(|value| !value.is_finite()) {
        f64::INFINITY
    } else {
        violation.max(0.0)
    }
}

/// Constrained dominance (Deb et al. 2002) of a over b.
#[inline]
fn dominates(a: &[f64], a_violation: f64, b: &[f64], b_violation: f64) -> bool {
    if a_violation > 0.0 || b_violation > 0.0 {
        return a_violation < b_violation;
    }
    let pairs = || a.iter().zip(b);
    pairs().all(|(a, b)| a <= b) && pairs().any(|(a, b)| a < b)
}

/// χ of Clerc & Kennedy (2002), with which a swarm comes to rest; 1 where it does so by itself.
fn constriction(phi: f64) -> f64 {
    if phi <= 4.0 { 1.0 } else { 2.0 / (phi - 2.0 + (phi * phi - 4.0 * phi).sqrt()) }
}

/// Polynomial mutation of one coordinate in the mean, bounds kept.
fn mutate(coordinates: &mut [f64], random: &mut Random) {
    let share = 1.0 / coordinates.len() as f64;
    let power = MUTATION_INDEX + 1.0;
    for x in coordinates {
        if random.unit() >= share {
            continue;
        }
        let u = random.unit();
        let (room, twice) = if u <= 0.5 { (*x, 2.0 * u) } else { (1.0 - *x, 2.0 * (1.0 - u)) };
        // Deb & Goyal 1996; with `twice` = 1 nothing moves, with 0 it reaches the border.
        let inner = twice + (1.0 - twice) * libm::pow(1.0 - room, power);
        let step = 1.0 - libm::pow(inner, 1.0 / power);
        *x = (if u <= 0.5 { *x - step } else { *x + step }).clamp(0.0, 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn feasible_beats_infeasible() {
        assert!(dominates(&[9.0, 9.0], 0.0, &[1.0, 1.0], 0.1));
        assert!(dominates(&[9.0, 9.0], 0.1, &[1.0, 1.0], 0.2));
        assert!(!dominates(&[1.0, 1.0], 0.1, &[9.0, 9.0], 0.1));
        assert!(dominates(&[1.0, 2.0], 0.0, &[1.0, 3.0], 0.0));
        assert!(!dominates(&[1.0, 2.0], 0.0, &[1.0, 2.0], 0.0));
        assert!(!dominates(&[0.0, 3.0], 0.0, &[1.0, 2.0], 0.0));
        assert_eq!(sound(&[1.0, f64::NAN], 0.0), f64::INFINITY);
        assert_eq!(sound(&[1.0, 2.0], f64::NAN), f64::INFINITY);
        assert_eq!(sound(&[1.0, 2.0], -1.0), 0.0);
    }

    #[test]
    fn constriction_by_hand() {
        // Clerc & Kennedy: φ = 4.1 gives 0.7298.
        assert!((constriction(4.1) - 0.729_84).abs() < 1e-5);
        assert_eq!(constriction(4.0), 1.0);
    }

    #[test]
    fn mutation_stays_near_and_inside() {
        let mut random = Random::new(3);
        let mut moved = 0.0f64;
        for n in 0..10_000 {
            let start = f64::from(n % 11) / 10.0;
            let mut x = [start];
            mutate(&mut x, &mut random);
            assert!((0.0..=1.0).contains(&x[0]));
            moved += (x[0] - start).abs();
        }
        let mean = moved / 10_000.0;
        assert!((0.01..0.08).contains(&mean), "η = 20 moves by some hundredths, not {mean}");
    }
}
