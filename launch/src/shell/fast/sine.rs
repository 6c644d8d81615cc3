//! Sine and cosine of many angles at once, to the bit those of `libm::sincos` (a zero may have the other sign).
//!
//! Steps are compared with thresholds, so a last bit can move one: an own approximation, however good, would not do.
//! These are the operations libm goes through (fdlibm's: Cody and Waite's reduction by quarter turns, then a
//! polynomial of degree 13 and one of degree 14) in the same order, for the angles for which there is nothing to
//! decide. Any other goes to libm itself: one near an odd eighth of a turn, where libm decides by a table of its
//! own which quarter it is reduced by; one near a quarter, of which too few digits are left; and a large one.

use std::f64::consts::FRAC_2_PI;

/// Quarter turns in a radian, and a quarter turn in two parts.
const QUARTERS_PER_RAD: f64 = FRAC_2_PI;
const QUARTER_RAD: f64 = 1.570_796_326_734_125_6;
const QUARTER_REST_RAD: f64 = 6.077_100_506_506_192e-11;
/// Added and taken away again, it rounds to whole numbers, and leaves them in the last bits of the sum.
const TO_WHOLE: f64 = 1.5 / f64::EPSILON;
/// From a reduced angle of this size on, which is an eighth of a turn but for 2e-5 of it, libm may choose the next
/// quarter.
const UNDECIDED_RAD: f64 = 0.785_38;
/// A reduced angle that is smaller than the angle by this factor has lost too many digits.
const CANCELLED: f64 = 65_536.0;

/// Coefficients of the sine's polynomial, of z, z², …
const SIN: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
/// Of the cosine's, of z², z³, …
const COS: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// Sine and cosine of an angle, and whether they can be trusted: otherwise ask libm.
#[inline(always)]
fn plain(angle: f64) -> (f64, f64, bool) {
    let shifted = angle * QUARTERS_PER_RAD + TO_WHOLE;
    let quarters = shifted - TO_WHOLE;
    let coarse = angle - quarters * QUARTER_RAD;
    let rest = quarters * QUARTER_REST_RAD;
    let x = coarse - rest;
    let y = (coarse - x) - rest;
    // The second says no to large angles, too, and to what is no number.
    let trusted = (x.abs() < UNDECIDED_RAD) & (x.abs() * CANCELLED >= angle.abs());
    // The sine of −0 is −0; sums below make it 0.
    let trusted = trusted & ((angle != 0.0) | angle.is_sign_positive());

    let z = x * x;
    let w = z * z;
    let [s1, s2, s3, s4, s5, s6] = SIN;
    let r = s2 + z * (s3 + z * s4) + z * w * (s5 + z * s6);
    let v = z * x;
    let sin = if quarters == 0.0 { x + v * (s1 + z * r) } else { x - ((z * (0.5 * y - v * r) - y) - v * s1) };

    let [c1, c2, c3, c4, c5, c6] = COS;
    let r = z * (c1 + z * (c2 + z * c3)) + w * w * (c4 + z * (c5 + z * c6));
    let half = 0.5 * z;
    let most = 1.0 - half;
    let cos = most + (((1.0 - most) - half) + (z * r - x * y));

    // Of a quarter turn q counted from 0: 0 (s, c), 1 (c, −s), 2 (−s, −c), 3 (−c, s).
    let q = shifted.to_bits();
    let (first, second) = if q & 1 == 0 { (sin, cos) } else { (cos, sin) };
    let negated = |value: f64, bit: u64| f64::from_bits(value.to_bits() ^ ((bit & 2) << 62));
    (negated(first, q), negated(second, q.wrapping_add(1)), trusted)
}

/// Sines and cosines.
#[inline(always)]
pub fn of<const N: usize>(angles: &[f64; N]) -> [[f64; N]; 2] {
    let (mut sin, mut cos) = ([0.0; N], [0.0; N]);
    let mut all_trusted = true;
    for lane in 0..N {
        let (s, c, trusted) = plain(angles[lane]);
        sin[lane] = s;
        cos[lane] = c;
        all_trusted &= trusted;
    }
    if !all_trusted {
        ask_libm(angles, &mut sin, &mut cos);
    }
    [sin, cos]
}

/// Those of libm, for a few angles that `plain` cannot be trusted with.
#[cold]
#[inline(never)]
fn ask_libm(angles: &[f64], sin: &mut [f64], cos: &mut [f64]) {
    for ((angle, sin), cos) in angles.iter().zip(sin).zip(cos) {
        (*sin, *cos) = libm::sincos(*angle);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    /// True if the angle was left to libm.
    fn check(angle: f64) -> bool {
        let (sin, cos, trusted) = plain(angle);
        let libm = libm::sincos(angle);
        assert!((sin, cos) == libm || !trusted, "{angle:e}: {sin} {cos}, libm {libm:?}");
        !trusted
    }

    #[test]
    fn it_has_the_bits_of_libm_or_says_so() {
        let mut left = 0;
        // Headings in whole steps of the e-puck, both wheels counted, as the estimator adds them up.
        let gain = 0.13 / 54.0;
        for right in 0..1500i32 {
            for left_wheel in (0..20_000).step_by(601) {
                let turned = f64::from(right * 13) * gain + f64::from(left_wheel) * -gain;
                left += u64::from(check(turned)) + u64::from(check(-2.15879893034246 - turned));
            }
        }
        assert!(left < 500, "{left} of 100 000 angles were left to libm");
        // Angles of every size and sign, and next to where libm decides.
        let mut angle = 1e-300;
        while angle < 1e300 {
            angle *= 1.003_7;
            check(angle);
            check(-angle);
        }
        for eighth in 1..200 {
            let at = f64::from(eighth) * FRAC_PI_4;
            for off in -400..=400 {
                check(at + f64::from(off) * 1e-7);
                check(-at * (1.0 + f64::from(off) * f64::EPSILON));
                check(at + f64::from(off).powi(3) * 1e-12);
            }
        }
    }

    #[test]
    fn what_it_cannot_do_is_left_to_libm() {
        for angle in
            [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e7, -1e300, FRAC_PI_4, 5.0 * FRAC_PI_2, -0.0]
        {
            assert!(check(angle), "{angle}");
        }
        for angle in [0.0, 1.0, -3.0, 700.0, f64::MIN_POSITIVE / 8.0] {
            assert!(!check(angle), "{angle}");
        }
        let angles = [1e7, 0.5];
        let [sin, cos] = of(&angles);
        assert_eq!([(sin[0], cos[0]), (sin[1], cos[1])], angles.map(libm::sincos));
    }
}
