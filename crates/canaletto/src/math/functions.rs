//! Elementary functions for any number of lanes, by fixed polynomials.
//!
//! Only + − × ÷ and √ are used, without fused operations, so that all machines give equal bits. The polynomials are
//! those of *fdlibm* (Sun Microsystems 1993). What its last correction steps save is left out, so that errors are up to
//! two units in the last place instead of one.

use canaletto_bvh::lanes::{Bits64, Real64};
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, FRAC_PI_4, LOG2_E, PI, SQRT_2};

/// A number whose last bit is worth 1. Adding and subtracting it rounds numbers below 2⁵¹ to integers.
const INTEGERS: f64 = 6_755_399_441_055_744.0; // 1.5 · 2⁵²

/// The first bits of ln 2, and the rest.
#[allow(clippy::excessive_precision)] // as in the source
const LN_2: [f64; 2] = [6.93147180369123816490e-01, 1.90821492927058770002e-10];

/// The polynomial with these coefficients, the one of the highest power first.
#[inline(always)]
fn polynomial<F: Real64, const N: usize>(x: F, coefficients: [f64; N]) -> F {
    let mut sum = F::splat(coefficients[0]);
    for coefficient in &coefficients[1..] {
        sum = sum * x + *coefficient;
    }
    sum
}

/// The sine and the cosine of an angle within π / 4 of zero.
#[allow(clippy::excessive_precision)] // as in the source
#[inline(always)]
pub(crate) fn sin_cos_near_zero<F: Real64>(x: F) -> [F; 2] {
    const SIN: [f64; 6] = [
        1.58969099521155010221e-10,
        -2.50507602534068634195e-08,
        2.75573137070700676789e-06,
        -1.98412698298579493134e-04,
        8.33333333332248946124e-03,
        -1.66666666666666324348e-01,
    ];
    const COS: [f64; 6] = [
        -1.13596475577881948265e-11,
        2.08757232129817482790e-09,
        -2.75573143513906633035e-07,
        2.48015872894767294178e-05,
        -1.38888888888741095749e-03,
        4.16666666666666019037e-02,
    ];
    let square = x * x;
    let half = square * 0.5;
    let one = F::splat(1.0);
    let near = one - half;
    let cos = near + (((one - near) - half) + square * square * polynomial(square, COS));
    [x + x * square * polynomial(square, SIN), cos]
}

/// The sine and the cosine of an angle in radians, up to 2²⁰ quarter turns. The errors are below two units in the last
/// place.
#[allow(clippy::excessive_precision)] // as in the source
#[inline(always)]
pub(crate) fn sin_cos<F: Real64>(angle: F) -> [F; 2] {
    /// The first 33 bits of π / 2, the next 33 bits, and the rest.
    const QUARTER: [f64; 3] = [1.57079632673412561417e+00, 6.07710050630396597660e-11, 2.02226624879595063154e-21];
    let shifted = angle * FRAC_2_PI + INTEGERS;
    let quarters = shifted - INTEGERS;
    let rest = ((angle - quarters * QUARTER[0]) - quarters * QUARTER[1]) - quarters * QUARTER[2];
    let [sin, cos] = sin_cos_near_zero(rest);
    // The last two bits of the integer are the quadrant.
    let bits = shifted.to_bits();
    let is_even = F::from_bits((bits & F::Bits::splat(1)) | F::splat(1.0).to_bits()).equal(F::splat(1.0));
    let (own_sin, own_cos) = (F::select(is_even, sin, cos), F::select(is_even, cos, sin));
    let sign = |bits: F::Bits| (bits & F::Bits::splat(2)).up::<62>();
    let negative = |value: F, sign: F::Bits| F::from_bits(value.to_bits() ^ sign);
    [negative(own_sin, sign(bits)), negative(own_cos, sign(bits) ^ (bits & F::Bits::splat(1)).up::<63>())]
}

/// The arc tangent of y / x in the quadrant of (x, y). The errors are below three units in the last place. That of
/// (0, 0) is 0.
#[allow(clippy::excessive_precision)] // as in the source
#[inline(always)]
pub(crate) fn atan2<F: Real64>(y: F, x: F) -> F {
    const ATAN: [f64; 11] = [
        1.62858201153657823623e-02,
        -3.65315727442169155270e-02,
        4.97687799461593236017e-02,
        -5.83357013379057348645e-02,
        6.66107313738753120669e-02,
        -7.69187620504482999495e-02,
        9.09088713343650656196e-02,
        -1.11111104054623557880e-01,
        1.42857142725034663711e-01,
        -1.99999999998764832476e-01,
        3.33333333333329318027e-01,
    ];
    /// tan(π / 8)
    const EIGHTH: f64 = 0.414_213_562_373_095_03;
    /// What π / 2 and π have beyond their digits in `f64`.
    const BEYOND: [f64; 2] = [6.123_233_995_736_766e-17, 1.224_646_799_147_353_2e-16];
    let (up, across) = (y.abs(), x.abs());
    let is_steep = across.less(up);
    let (less, more) = (F::select(is_steep, across, up), F::select(is_steep, up, across));
    // Beyond π / 8, the angle to the diagonal: tan(α − π / 4) = (tan α − 1) / (tan α + 1).
    let is_far = (more * EIGHTH).less(less);
    let (numerator, denominator) = (F::select(is_far, less - more, less), F::select(is_far, less + more, more));
    let nothing = more.equal(F::splat(0.0));
    let t = numerator / F::select(nothing, F::splat(1.0), denominator);
    let square = t * t;
    let angle = t - t * square * polynomial(square, ATAN);
    let angle = F::select(is_far, angle + FRAC_PI_4, angle);
    let angle = F::select(is_steep, F::splat(FRAC_PI_2) - (angle - BEYOND[0]), angle);
    // The sign of −0 counts.
    let is_left = F::from_bits((x.to_bits() & F::splat(-0.0).to_bits()) | F::splat(1.0).to_bits()).less(F::splat(0.0));
    let angle = F::select(is_left, F::splat(PI) - (angle - BEYOND[1]), angle);
    F::from_bits(angle.to_bits() | (y.to_bits() & F::splat(-0.0).to_bits()))
}

/// The natural logarithm of a positive normal number. The errors are below two units in the last place.
#[allow(clippy::excessive_precision)] // as in the source
#[inline(always)]
pub(crate) fn log<F: Real64>(x: F) -> F {
    const LOG: [f64; 7] = [
        1.479819860511658591e-01,
        1.531383769920937332e-01,
        1.818357216161805012e-01,
        2.222219843214978396e-01,
        2.857142874366239149e-01,
        3.999999999940941908e-01,
        6.666666666666735130e-01,
    ];
    /// The bits of the fraction, and those of 2⁵².
    const FRACTION: u64 = (1 << 52) - 1;
    const TWO_52: f64 = 4_503_599_627_370_496.0;
    let (bits, one) = (x.to_bits(), F::splat(1.0));
    // x = 2^k m, with m from √½ to √2
    let exponent = F::from_bits(bits.down::<52>() | F::splat(TWO_52).to_bits()) - TWO_52 - 1023.0;
    let m = F::from_bits((bits & F::Bits::splat(FRACTION)) | one.to_bits());
    let is_large = F::splat(SQRT_2).less(m);
    let (m, k) = (F::select(is_large, m * 0.5, m), F::select(is_large, exponent + 1.0, exponent));
    let f = m - 1.0;
    let s = f / (f + 2.0);
    let (square, half) = (s * s, f * f * 0.5);
    let rest = square * polynomial(square, LOG);
    k * LN_2[0] - ((half - (s * (half + rest) + k * LN_2[1])) - f)
}

/// e to the power of x. The errors are below two units in the last place. Below −708 it is 0, above 709 infinite.
#[allow(clippy::excessive_precision)] // as in the source
#[inline(always)]
pub(crate) fn exp<F: Real64>(x: F) -> F {
    const EXP: [f64; 5] = [
        4.13813679705723846039e-08,
        -1.65339022054652515390e-06,
        6.61375632143793436117e-05,
        -2.77777777770155933842e-03,
        1.66666666666666019037e-01,
    ];
    let one = F::splat(1.0);
    // x = k ln 2 + r
    let bounded = x.max(F::splat(-708.0)).min(F::splat(709.0));
    let k = bounded * LOG2_E + INTEGERS - INTEGERS;
    let (high, low) = (bounded - k * LN_2[0], k * LN_2[1]);
    let r = high - low;
    let square = r * r;
    let c = r - square * polynomial(square, EXP);
    let power = one - ((low - r * c / (F::splat(2.0) - c)) - high);
    // The last bits of k + 1023 + 1.5 · 2⁵² are the exponent of 2^k.
    let exponent = (k + 1023.0 + INTEGERS).to_bits() & F::Bits::splat(0x7ff);
    let power = power * F::from_bits(exponent.up::<52>());
    let power = F::select(x.less(F::splat(-708.0)), F::splat(0.0), power);
    F::select(F::splat(709.0).less(x), F::splat(f64::INFINITY), power)
}

/// x to the power of y, for a positive normal x. The relative error is below 2⁻⁵¹ (1 + |y ln x|).
#[inline(always)]
pub(crate) fn pow<F: Real64>(x: F, y: F) -> F {
    exp(y * log(x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use canaletto_bvh::InstructionSet;
    use canaletto_bvh::lanes::{LANES, LaneKernel, run_lanes};

    /// Numbers of [0, 1) that fill it evenly.
    fn fractions() -> impl Iterator<Item = f64> {
        (0..200_000u64).map(|i| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 11) as f64 / (1u64 << 53) as f64)
    }

    /// The distance of two numbers in units of the last place of the second one.
    fn units(a: f64, b: f64) -> f64 {
        if a == b {
            return 0.0;
        }
        (a - b).abs() / (b.abs() * f64::EPSILON).max(f64::from_bits(1))
    }

    #[test]
    fn sines_and_cosines_are_those_of_libm() {
        let mut largest = 0.0f64;
        let quarters = (-9..=9).map(|n| f64::from(n) * FRAC_PI_4);
        let near = quarters
            .clone()
            .flat_map(|a| (0..60).flat_map(move |k| [1.0, -1.0].map(|s| a + s * libm::exp2(-f64::from(k)))));
        let around = fractions().map(|u| u * 4.0 * PI - 2.0 * PI);
        let far = fractions().map(|u| (u - 0.5) * 2.0 * 1_048_576.0 * FRAC_PI_2);
        for angle in quarters.clone().chain(near).chain(around).chain(far) {
            let ([sin, cos], expected) = (sin_cos(angle), libm::sincos(angle));
            largest = largest.max(units(sin, expected.0)).max(units(cos, expected.1));
        }
        assert!(largest < 2.0, "{largest}");
        assert_eq!(sin_cos(0.0), [0.0, 1.0]);
    }

    #[test]
    fn arc_tangents_are_those_of_libm() {
        let mut largest = 0.0f64;
        let sizes = fractions().map(|u| libm::exp2(80.0 * u - 40.0));
        let around = fractions().map(|u| libm::sincos(u * 2.0 * PI));
        for ((sin, cos), size) in around.zip(sizes) {
            for (y, x) in [(sin, cos), (sin, size), (size, cos), (-size, cos), (size, -1.0)] {
                largest = largest.max(units(atan2(y, x), libm::atan2(y, x)));
            }
        }
        assert!(largest < 3.0, "{largest}");
        let edges = [0.0, -0.0, 1.0, -1.0, 2.0, f64::MIN_POSITIVE, -f64::MIN_POSITIVE];
        for y in edges {
            for x in edges {
                let (ours, expected) = (atan2(y, x), libm::atan2(y, x));
                assert!(units(ours, expected) < 3.0, "{y} {x}: {ours} {expected}");
                assert_eq!(ours.is_sign_negative(), expected.is_sign_negative(), "{y} {x}");
            }
        }
    }

    #[test]
    fn logarithms_and_powers_of_e_are_those_of_libm() {
        let (mut of_log, mut of_exp) = (0.0f64, 0.0f64);
        let sizes = fractions().map(|u| libm::exp2(2040.0 * u - 1020.0));
        let near_one = fractions().map(|u| 0.5 + u);
        let nearest = (1..53).flat_map(|k| [1.0, -0.5].map(|s| 1.0 + s * libm::exp2(-f64::from(k))));
        for x in sizes.chain(near_one).chain(nearest).chain([f64::MIN_POSITIVE, f64::MAX, 1.0]) {
            of_log = of_log.max(units(log(x), libm::log(x)));
        }
        let all = fractions().map(|u| 1417.0 * u - 708.0);
        let small = fractions().map(|u| 2.0 * u - 1.0);
        for x in all.chain(small).chain([0.0, -708.0, 709.0, 1e-300]) {
            of_exp = of_exp.max(units(exp(x), libm::exp(x)));
        }
        assert!(of_log < 2.0 && of_exp < 2.0, "{of_log}, {of_exp}");
        assert_eq!([exp(-709.0), exp(710.0), exp(f64::NEG_INFINITY), log(1.0)], [0.0, f64::INFINITY, 0.0, 0.0]);
    }

    #[test]
    fn powers_have_the_stated_error() {
        let bases = fractions().map(|u| u.max(1e-12));
        let exponents = fractions().skip(70_000).map(|u| libm::exp2(20.0 * u - 8.0));
        for (x, y) in bases.zip(exponents) {
            let (ours, expected) = (pow(x, y), libm::pow(x, y));
            if expected > 1e-300 {
                let bound = f64::EPSILON * 2.0 * (1.0 + (y * libm::log(x)).abs());
                assert!((ours / expected - 1.0).abs() < bound, "{x}, {y}: {ours} {expected}");
            }
        }
        assert_eq!([pow(0.3, 0.0), pow(1.0, 1e6), pow(0.5, 1e5)], [1.0, 1.0, 0.0]);
    }

    struct All([f64; LANES]);

    impl LaneKernel for All {
        type Answer = [[f64; LANES]; 5];

        #[inline(always)]
        fn run<F: Real64>(self) -> Self::Answer {
            let x = F::load(&self.0);
            let [sin, cos] = sin_cos(x);
            [sin, cos, atan2(sin * 3.0, x), log(x.abs()), exp(x)].map(|v| v.to_array())
        }
    }

    #[test]
    fn lanes_have_the_bits_of_single_numbers() {
        let all: Vec<f64> = fractions().take(4000).map(|u| (u - 0.5) * 40.0).collect();
        for set in InstructionSet::available() {
            set.limit();
            for eight in all.chunks_exact(LANES) {
                let together = run_lanes(All(std::array::from_fn(|lane| eight[lane])));
                for lane in 0..LANES {
                    let alone = All([eight[lane]; LANES]).run::<f64>();
                    assert_eq!(together.map(|v| v[lane].to_bits()), alone.map(|v| v[0].to_bits()));
                }
            }
        }
        InstructionSet::Avx512.limit();
    }
}
