//! Samples beside the corners of obstacles.

use crate::check::Checker;
use crate::map::GridPoint;

/// Free points a little more than the radius out of convex corners, thinned so that a jagged wall does not
/// fill the roadmap.
///
/// Shortest paths bend at convex corners only, so roadmaps gain most from samples there; taking samples from
/// obstacle surfaces is the idea of Amato & Wu, *A randomized roadmap method for path and manipulation
/// planning*, 1996 (OBPRM); here the map itself tells where to look.
#[derive(Debug, Default)]
pub struct CornerSamples {
    points: Vec<GridPoint>,
    /// next in the seed's order, and the order's stride
    next: usize,
    stride: usize,
    left: usize,
}

/// Bits of the thinning grid a side.
const THIN: usize = 64;

impl CornerSamples {
    /// Collects the samples for a checker's map and radius.
    pub fn new(checker: &Checker<'_>) -> Self {
        const HAIR: f64 = 1.02;
        let (width, height) = checker.field.size();
        let side = (width.max(height) as f64 / THIN as f64).max(0.5);
        // what a thinning cell already has, by quadrant of the corner's direction
        let mut taken = vec![0u8; THIN * THIN];
        let mut points = Vec::new();
        checker.field.corners(|corner| {
            let (du, dv) = corner.out;
            let column = ((corner.at.u / side).max(0.0) as usize).min(THIN - 1);
            let row = ((corner.at.v / side).max(0.0) as usize).min(THIN - 1);
            let quadrant = 1u8 << (u8::from(du > 0.0) * 2 + u8::from(dv > 0.0));
            let cell = &mut taken[row * THIN + column];
            if *cell & quadrant != 0 {
                return;
            }
            // where the ways along both sides meet; nearer if there is no room
            for radii in [corner.mitre, 1.0] {
                let out = HAIR * radii * checker.radius + 0.05;
                let p = GridPoint::new(corner.at.u + du * out, corner.at.v + dv * out);
                if checker.point(p) {
                    *cell |= quadrant;
                    points.push(p);
                    break;
                }
            }
        });
        Self { points, next: 0, stride: 1, left: 0 }
    }

    /// Starts over in the order of a seed: strides that visit every sample once.
    pub fn restart(&mut self, seed: u64) {
        let n = self.points.len().max(1);
        self.left = self.points.len();
        self.next = (seed % n as u64) as usize;
        // the golden section's stride spreads the early samples over the whole list
        self.stride = (n as f64 * 0.618) as usize | 1;
        while gcd(self.stride, n) != 1 {
            self.stride += 2;
        }
    }

    /// The next sample, until all have been given.
    pub fn take(&mut self) -> Option<GridPoint> {
        self.left = self.left.checked_sub(1)?;
        let point = self.points.get(self.next).copied();
        self.next = (self.next + self.stride) % self.points.len();
        point
    }
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}
