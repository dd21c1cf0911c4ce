//! Computed functions of space (5.5): noise, marble, wood, checkers and their like. Each returns a number, which a ramp
//! turns into a colour.
//!
//! Against aliasing, noise fades octave by octave as the footprint grows. The ramp's mean is taken over the range of
//! the number in the footprint. Checkers are integrated exactly over an axis-aligned box around the footprint.

use super::noise::{Filtered, Noise, Octaves, seen};
use super::ramp::RampTable;
use super::worley;
use super::{Lookup, Ramp, Wrap};
use crate::{OutOfRange, named};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// A computed texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Procedural {
    /// The function that returns the number.
    pub function: Function,
    /// The ramp from the number to a colour.
    pub ramp: Ramp,
    /// The seed of the texture; 0 is Perlin's own lattice.
    pub seed: u32,
}

/// Functions of space. Their features have a size of about 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Function {
    /// Cubes of side 1 with alternating values 0 and 1.
    Checker,
    /// A distance or angle.
    Gradient {
        /// The measure.
        shape: Gradient,
        /// The continuation of the ramp outside of 0 to 1.
        wrap: Wrap,
        /// The direction that a linear gradient grows in, or the axis of a cylindrical or angular one. Of any length
        /// but 0; `None` is x for a linear gradient and y for the others.
        #[serde(default)]
        axis: Option<Vec3>,
    },
    /// Perlin's noise, mapped from −1 to 1 to 0 to 1.
    Noise,
    /// Noise of several frequencies, mapped to 0 to 1 (fractional Brownian motion).
    Fbm(Spectrum),
    /// Absolute values of noise of several frequencies, 0 to 1.
    Turbulence(Spectrum),
    /// Waves along x, one in each unit, shifted by turbulence.
    Marble {
        /// The turbulence.
        spectrum: Spectrum,
        /// The largest shift of the waves in units.
        strength: f32,
    },
    /// Rings around the y axis, one in each unit, shifted by noise. Each ring runs through the ramp once.
    Wood {
        /// The noise.
        spectrum: Spectrum,
        /// The largest shift of the rings in units.
        strength: f32,
    },
    /// Cells around random points, one in each unit cube.
    Worley {
        /// The measured distance.
        feature: Feature,
        /// The randomness of the points: 0 is a regular grid, 1 anywhere in their cubes.
        jitter: f32,
    },
}

/// The measure of a gradient.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Gradient {
    /// The coordinate along the axis, by default x, which is u for a texture of a line.
    #[default]
    Linear,
    /// The distance from the axis, by default y.
    Cylindrical,
    /// The distance from the origin.
    Spherical,
    /// The angle around the axis as a share of the full turn, 0 to 1: around y, from z towards x. Another axis is what
    /// y becomes by the shortest turn, which turns z and x with it.
    Angular,
}

named!(Gradient {
    Linear => "linear",
    Cylindrical => "cylindrical",
    Spherical => "spherical",
    Angular => "angular",
});

/// The measure of Worley's texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Feature {
    /// The distance to the nearest point, mostly 0 to 1.
    #[default]
    Nearest,
    /// The distance to the second nearest point.
    Second,
    /// The difference of both distances: 0 on the boundary of cells.
    Edge,
}

named!(Feature {
    Nearest => "nearest",
    Second => "second",
    Edge => "edge",
});

/// The parameters of a sum of noises of several frequencies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spectrum {
    /// The number of octaves, 1 to 32.
    pub octaves: u32,
    /// The ratio of frequencies of consecutive octaves, 1 to 16.
    pub lacunarity: f32,
    /// The ratio of their amplitudes, 0 to 1.
    pub gain: f32,
}

impl Default for Spectrum {
    fn default() -> Spectrum {
        Spectrum { octaves: 6, lacunarity: 2.0, gain: 0.5 }
    }
}

impl Spectrum {
    fn lowered(&self) -> Octaves {
        Octaves { count: self.octaves, lacunarity: self.lacunarity.into(), gain: self.gain.into() }
    }
}

impl Procedural {
    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        self.ramp.check()?;
        let spectrum = match self.function {
            Function::Fbm(spectrum) | Function::Turbulence(spectrum) => Some((spectrum, 0.0)),
            Function::Marble { spectrum, strength } | Function::Wood { spectrum, strength } => {
                Some((spectrum, strength))
            }
            Function::Gradient { axis: Some(axis), .. } if axis.as_dvec3().try_normalize().is_none() => {
                return Err(OutOfRange::new(
                    "axis",
                    format!("is {} {} {}; it needs a direction", axis.x, axis.y, axis.z),
                ));
            }
            Function::Worley { jitter, .. } if !(0.0..=1.0).contains(&jitter) => {
                return Err(OutOfRange::new("jitter", format!("is {jitter}; it must be between 0 and 1")));
            }
            _ => None,
        };
        let Some((Spectrum { octaves, lacunarity, gain }, strength)) = spectrum else { return Ok(()) };
        if !(1..=32).contains(&octaves) {
            return Err(OutOfRange::new("octaves", format!("is {octaves}; it must be between 1 and 32")));
        }
        if !(1.0..=16.0).contains(&lacunarity) {
            return Err(OutOfRange::new("lacunarity", format!("is {lacunarity}; it must be between 1 and 16")));
        }
        if !(0.0..=1.0).contains(&gain) {
            return Err(OutOfRange::new("gain", format!("is {gain}; it must be between 0 and 1")));
        }
        if !strength.is_finite() || strength.abs() > 1e6 {
            return Err(OutOfRange::new("strength", format!("is {strength}; it must be between -1e6 and 1e6")));
        }
        Ok(())
    }
}

/// The runtime form of a computed texture.
#[derive(Debug)]
pub(super) struct Computed {
    function: Function,
    noise: Noise,
    ramp: RampTable,
    seed: u32,
}

/// The limits of Worley's distances in footprints of many cells: their means with a jitter of 1, and the variances of
/// the nearest, the second and their difference.
const WORLEY_MEANS: [f64; 2] = [0.521, 0.717];
const WORLEY_VARIANCES: [f64; 3] = [0.030, 0.021, 0.025];

impl Computed {
    pub(super) fn new(texture: &Procedural) -> Computed {
        let wrap = match texture.function {
            Function::Gradient { wrap, .. } => wrap,
            Function::Wood { .. } => Wrap::Repeat,
            _ => Wrap::Clamp,
        };
        let ramp = RampTable::new(&texture.ramp, wrap);
        Computed { function: texture.function, noise: Noise::new(texture.seed), ramp, seed: texture.seed }
    }

    pub(super) fn eval(&self, lookup: &Lookup) -> [f32; 4] {
        let finite = |d: DVec3| if d.is_finite() { d } else { DVec3::splat(1e12) };
        let (at, dx, dy) =
            (if lookup.at.is_finite() { lookup.at } else { DVec3::ZERO }, finite(lookup.dx), finite(lookup.dy));
        let width = dx.length().max(dy.length());
        match self.function {
            Function::Checker => self.checker(at, dx, dy),
            Function::Marble { .. } => {
                let phase = self.value(at, width);
                let radius = if width > 0.0 { self.filter_radius(at, dx, dy, phase, width) } else { 0.0 };
                let phase = phase.value;
                let angle = std::f64::consts::TAU * radius;
                // The mean of a wave over an interval is the wave at its middle, attenuated.
                let rest = if angle > 1e-6 { libm::sin(angle) / angle } else { 1.0 };
                let wave = libm::sin(std::f64::consts::TAU * (phase - phase.floor())) * rest;
                self.ramp.mean(0.5 + 0.5 * wave, 0.5 * (1.0 - rest * rest).max(0.0).sqrt())
            }
            Function::Noise | Function::Fbm(_) | Function::Turbulence(_) if self.ramp.is_linear() => {
                self.ramp.mean(self.value(at, width).value, 0.0)
            }
            _ => {
                let value = self.value(at, width);
                let radius = if width > 0.0 { self.filter_radius(at, dx, dy, value, width) } else { 0.0 };
                self.ramp.mean(value.value, radius)
            }
        }
    }

    /// The half width of the function's range in the footprint.
    fn filter_radius(&self, at: DVec3, dx: DVec3, dy: DVec3, center: Filtered, width: f64) -> f64 {
        let change = |d: DVec3| {
            let change = self.value(at + d, width).value - center.value;
            match self.function {
                // Across the seam the shorter change counts.
                Function::Gradient { shape: Gradient::Angular, .. } => change - change.round(),
                _ => change,
            }
        };
        let (x, y) = (change(dx), change(dy));
        // For a linear function, the pixel's values are the sum of two uniform numbers in −x/2 to x/2 and −y/2 to y/2.
        // They fill an interval if x or y is 0. Else they are replaced by the interval of equal variance, a third of
        // the squared half width.
        (0.25 * (x * x + y * y) + 3.0 * center.lost).sqrt()
    }

    /// The function's number: the phase for marble, the ring for wood.
    fn value(&self, p: DVec3, width: f64) -> Filtered {
        let exact = |value| Filtered { value, lost: 0.0 };
        let placed = |n: Filtered, start: f64, factor: f64| Filtered {
            value: start + factor * n.value,
            lost: factor * factor * n.lost,
        };
        match self.function {
            Function::Checker => exact(0.0),
            Function::Gradient { shape, axis, .. } => exact(gradient(shape, axis, p)),
            Function::Noise => {
                let one = Octaves { count: 1, lacunarity: 1.0, gain: 1.0 };
                placed(self.noise.fbm(p, one, width), 0.5, 0.5)
            }
            Function::Fbm(spectrum) => placed(self.noise.fbm(p, spectrum.lowered(), width), 0.5, 0.5),
            Function::Turbulence(spectrum) => self.noise.turbulence(p, spectrum.lowered(), width),
            Function::Marble { spectrum, strength } => {
                placed(self.noise.turbulence(p, spectrum.lowered(), width), p.x, strength.into())
            }
            Function::Wood { spectrum, strength } => {
                let ring = (p.x * p.x + p.z * p.z).sqrt();
                placed(self.noise.fbm(p, spectrum.lowered(), width), ring, strength.into())
            }
            Function::Worley { feature, jitter } => {
                let share = seen(width);
                let [first, second] = if share > 0.0 {
                    let exact = worley::distances(p, jitter.into(), self.seed);
                    [0, 1].map(|i: usize| WORLEY_MEANS[i] + (exact[i] - WORLEY_MEANS[i]) * share)
                } else {
                    WORLEY_MEANS
                };
                let (value, variance) = match feature {
                    Feature::Nearest => (first, WORLEY_VARIANCES[0]),
                    Feature::Second => (second, WORLEY_VARIANCES[1]),
                    Feature::Edge => (second - first, WORLEY_VARIANCES[2]),
                };
                Filtered { value, lost: variance * (1.0 - share * share) }
            }
        }
    }

    /// The mean of the checkers over the box around the footprint's parallelogram.
    fn checker(&self, at: DVec3, dx: DVec3, dy: DVec3) -> [f32; 4] {
        let mut product = 1.0;
        for i in 0..3 {
            let width = dx[i].abs() + dy[i].abs();
            product *= square_wave(at[i], width);
        }
        let ends = [self.ramp.mean(0.0, 0.0), self.ramp.mean(1.0, 0.0)];
        let share = (0.5 - 0.5 * product) as f32;
        if share <= 0.0 || share >= 1.0 {
            return ends[usize::from(share >= 0.5)];
        }
        let alpha = ends[0][3] + (ends[1][3] - ends[0][3]) * share;
        let color = |c: usize| {
            let [a, b] = [0, 1].map(|i: usize| ends[i][c] * ends[i][3]);
            let mixed = a + (b - a) * share;
            if alpha > 0.0 { mixed / alpha } else { 0.0 }
        };
        [color(0), color(1), color(2), alpha]
    }
}

/// A point turned by the shortest turn of a unit axis to y (Rodrigues' formula).
fn turned_to_y(axis: DVec3, p: DVec3) -> DVec3 {
    let (v, cos) = (axis.cross(DVec3::Y), axis.y);
    // The axis −y has no shortest turn; it is turned around x.
    if 1.0 + cos < 1e-12 {
        return DVec3::new(p.x, -p.y, -p.z);
    }
    p + v.cross(p) + v.cross(v.cross(p)) / (1.0 + cos)
}

/// The value of a gradient.
fn gradient(shape: Gradient, axis: Option<Vec3>, p: DVec3) -> f64 {
    let p = match (shape, axis.map(|axis| axis.as_dvec3().normalize())) {
        (Gradient::Linear, Some(axis)) => return p.dot(axis),
        (Gradient::Spherical, _) | (_, None) => p,
        (_, Some(axis)) => turned_to_y(axis, p),
    };
    match shape {
        Gradient::Linear => p.x,
        Gradient::Cylindrical => (p.x * p.x + p.z * p.z).sqrt(),
        Gradient::Spherical => p.length(),
        Gradient::Angular => {
            let turn = libm::atan2(p.x, p.z) * (0.5 / std::f64::consts::PI);
            if turn < 0.0 { turn + 1.0 } else { turn }
        }
    }
}

/// The mean over an interval of this width of the function that is 1 from 0 to 1, −1 from 1 to 2, and so on.
fn square_wave(x: f64, width: f64) -> f64 {
    // The antiderivative rises and falls in each period of 2.
    let integral = |x: f64| 1.0 - (x - 2.0 * (x * 0.5).floor() - 1.0).abs();
    // A width far below the rounding of the antiderivative's differences counts as none.
    if width > 1e-11 * x.abs().max(1.0) {
        ((integral(x + 0.5 * width) - integral(x - 0.5 * width)) / width).clamp(-1.0, 1.0)
    } else {
        let cell = x.floor();
        if cell - 2.0 * (cell * 0.5).floor() == 0.0 { 1.0 } else { -1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::noise::scatter;
    use crate::texture::{Interpolation, Stop};

    fn computed(function: Function, ramp: Ramp) -> Computed {
        let texture = Procedural { function, ramp, seed: 0 };
        texture.check().unwrap();
        Computed::new(&texture)
    }

    fn all() -> Vec<Function> {
        let spectrum = Spectrum::default();
        vec![
            Function::Checker,
            Function::Gradient { shape: Gradient::Linear, wrap: Wrap::Mirror, axis: None },
            Function::Gradient { shape: Gradient::Cylindrical, wrap: Wrap::Repeat, axis: None },
            Function::Gradient { shape: Gradient::Spherical, wrap: Wrap::Repeat, axis: None },
            Function::Gradient { shape: Gradient::Angular, wrap: Wrap::Repeat, axis: None },
            Function::Noise,
            Function::Fbm(spectrum),
            Function::Turbulence(spectrum),
            Function::Marble { spectrum, strength: 2.0 },
            Function::Wood { spectrum, strength: 0.5 },
            Function::Worley { feature: Feature::Nearest, jitter: 1.0 },
            Function::Worley { feature: Feature::Second, jitter: 1.0 },
            Function::Worley { feature: Feature::Edge, jitter: 1.0 },
        ]
    }

    fn random(i: u64) -> f64 {
        (scatter(i) >> 11) as f64 / (1u64 << 53) as f64
    }

    #[test]
    fn checkers_are_exact_over_boxes_along_the_axes() {
        let table = computed(Function::Checker, Ramp::default());
        for i in 0..60u64 {
            let r = |k: u64| random(100 * i + k);
            let at = DVec3::new(r(0) * 9.0 - 4.0, r(1) * 9.0 - 4.0, 0.5);
            let (dx, dy) = (DVec3::X * r(2) * 2.5, DVec3::Y * r(3) * 2.5);
            let mut sum = 0.0;
            for j in 0..200 {
                for k in 0..200 {
                    let [p, q] = [j, k].map(|v: i32| (f64::from(v) + 0.5) / 200.0 - 0.5);
                    let cell = (at + dx * p + dy * q).floor();
                    sum += (cell.x + cell.y + cell.z).rem_euclid(2.0) / 40_000.0;
                }
            }
            let got = f64::from(table.eval(&Lookup { at, dx, dy })[0]);
            assert!((got - sum).abs() < 0.01, "{at} {dx} {dy}: {got} for {sum}");
        }
        assert_eq!(table.eval(&Lookup::point(DVec3::new(0.5, 0.5, 0.5)))[0], 0.0);
        assert_eq!(table.eval(&Lookup::point(DVec3::new(-0.5, 0.5, 0.5)))[0], 1.0);
    }

    #[test]
    fn ramps_along_a_side_of_the_pixel_are_exact() {
        let stop = |at: f32, v: f32| Stop { at, color: [v, v, v, 1.0] };
        let ramp = Ramp { stops: vec![stop(0.0, 0.2), stop(0.3, 1.0)], interpolation: Interpolation::Step };
        // The interval from 0.25 to 0.375, of which 0.05 lie below the step.
        let exact = (0.05 * 0.2 + 0.075 * 1.0) / 0.125;
        let linear = Function::Gradient { shape: Gradient::Linear, wrap: Wrap::Clamp, axis: None };
        for (dx, dy) in [(DVec3::X * 0.125, DVec3::Y), (DVec3::Z, DVec3::X * -0.125)] {
            let value = computed(linear, ramp.clone()).eval(&Lookup { at: DVec3::X * 0.3125, dx, dy });
            assert!((f64::from(value[0]) - exact).abs() < 1e-6, "{value:?} for {exact}");
        }
    }

    #[test]
    fn gradients_have_an_axis() {
        let stop = |at: f32, v: f32| Stop { at, color: [v, v, v, 1.0] };
        let ramp = Ramp { stops: vec![stop(0.0, 0.0), stop(1.0, 1.0)], interpolation: Interpolation::Linear };
        let at = |shape, axis: Vec3, p: DVec3| {
            let function = Function::Gradient { shape, wrap: Wrap::Clamp, axis: Some(axis) };
            computed(function, ramp.clone()).eval(&Lookup::point(p))[0]
        };
        let near = |a: f32, b: f64| assert!((f64::from(a) - b).abs() < 1e-6, "{a} for {b}");
        near(at(Gradient::Linear, Vec3::Y * 7.0, DVec3::new(9.0, 0.3, 9.0)), 0.3);
        near(at(Gradient::Linear, Vec3::ONE, DVec3::splat(0.2)), 0.2 * 3f64.sqrt());
        near(at(Gradient::Linear, -Vec3::X, DVec3::new(-0.25, 5.0, 0.0)), 0.25);
        // The distance from a line (Weisstein, Point-Line Distance): |p × a|.
        let (axis, p) = (Vec3::new(1.0, 2.0, -2.0), DVec3::new(0.1, 0.2, 0.3));
        near(at(Gradient::Cylindrical, axis, p), p.cross(axis.as_dvec3() / 3.0).length());
        near(at(Gradient::Spherical, axis, p), p.length());
        // y turns to z, and with it z to −y; x stays.
        near(at(Gradient::Angular, Vec3::Z, DVec3::new(0.0, -2.0, 5.0)), 0.0);
        near(at(Gradient::Angular, Vec3::Z, DVec3::new(3.0, 0.0, 5.0)), 0.25);
        near(at(Gradient::Angular, Vec3::Z, DVec3::new(0.0, 1.0, 0.0)), 0.5);
        for shape in [Gradient::Cylindrical, Gradient::Angular, Gradient::Spherical] {
            let none = Function::Gradient { shape, wrap: Wrap::Clamp, axis: None };
            near(at(shape, Vec3::Y, p), f64::from(computed(none, ramp.clone()).eval(&Lookup::point(p))[0]));
        }
        let flat = Function::Gradient { shape: Gradient::Linear, wrap: Wrap::Clamp, axis: Some(Vec3::ZERO) };
        assert_eq!(Procedural { function: flat, ramp, seed: 0 }.check().unwrap_err().field, Some("axis"));
    }

    #[test]
    fn footprints_bring_values_nearer_to_their_means() {
        // A ramp with jumps, under footprints from a tenth to three units.
        let stop = |at: f32, v: f32| Stop { at, color: [v, v, v, 1.0] };
        let stops = vec![stop(0.0, 0.1), stop(0.45, 0.9), stop(0.6, 0.2)];
        for function in all() {
            let ramp = Ramp { stops: stops.clone(), interpolation: Interpolation::Step };
            let table = computed(function, if function == Function::Checker { Ramp::default() } else { ramp });
            let (mut filtered, mut plain) = (0.0, 0.0);
            for i in 0..60u64 {
                let r = |k: u64| random(1000 * i + k);
                let at = DVec3::new(r(0), r(1), r(2)) * 8.0 - 4.0;
                let size = 0.1 * 30f64.powf(r(3));
                let (dx, dy) = (DVec3::new(size, 0.2 * size, 0.0), DVec3::new(-0.1 * size, 0.1 * size, 0.7 * size));
                let mut sum = 0.0;
                for j in 0..32 {
                    for k in 0..32 {
                        let [p, q] = [j, k].map(|v: i32| (f64::from(v) + 0.5) / 32.0 - 0.5);
                        sum += f64::from(table.eval(&Lookup::point(at + dx * p + dy * q))[0]);
                    }
                }
                let mean = sum / 1024.0;
                filtered += (f64::from(table.eval(&Lookup { at, dx, dy })[0]) - mean).powi(2);
                plain += (f64::from(table.eval(&Lookup::point(at))[0]) - mean).powi(2);
            }
            println!("{function:?}: {:.4} for {:.4}", (filtered / 60.0).sqrt(), (plain / 60.0).sqrt());
            assert!(filtered < 0.5 * plain, "{function:?}: {filtered} for {plain}");
        }
    }

    #[test]
    fn the_cells_means_are_those_of_many_points() {
        let (mut sums, count) = ([[0.0; 2]; 3], 20_000u64);
        for i in 0..count {
            let p = DVec3::new(random(3 * i), random(3 * i + 1), random(3 * i + 2)) * 90.0;
            let [first, second] = worley::distances(p, 1.0, 3);
            for (sum, v) in sums.iter_mut().zip([first, second, second - first]) {
                sum[0] += v / count as f64;
                sum[1] += v * v / count as f64;
            }
        }
        let means = sums.map(|[mean, _]| mean);
        let variances = sums.map(|[mean, square]| square - mean * mean);
        println!("{means:?} {variances:?}");
        assert!((0..2).all(|i| (means[i] - WORLEY_MEANS[i]).abs() < 0.01));
        assert!((0..3).all(|i| (variances[i] - WORLEY_VARIANCES[i]).abs() < 0.003));
    }

    #[test]
    fn no_lookup_is_hostile() {
        let values = [0.0, 1.0, -1.0, 1e9, -1e300, f64::NAN, f64::INFINITY];
        for function in all() {
            let table = computed(function, Ramp::default());
            for a in values {
                for b in values {
                    let lookup =
                        Lookup { at: DVec3::new(a, b, 0.1), dx: DVec3::new(b, 0.0, a), dy: DVec3::new(0.0, a, b) };
                    let color = table.eval(&lookup);
                    assert!(color.iter().all(|v| v.is_finite()), "{function:?} {lookup:?}: {color:?}");
                }
            }
        }
    }

    #[test]
    fn wrong_numbers_are_told() {
        let wrong = |function| Procedural { function, ramp: Ramp::default(), seed: 0 }.check().unwrap_err().to_string();
        let spectrum = Spectrum { octaves: 0, ..Spectrum::default() };
        assert!(wrong(Function::Fbm(spectrum)).starts_with("octaves is 0"));
        let spectrum = Spectrum { lacunarity: f32::NAN, ..Spectrum::default() };
        assert!(wrong(Function::Turbulence(spectrum)).starts_with("lacunarity is NaN"));
        let marble = Function::Marble { spectrum: Spectrum::default(), strength: f32::INFINITY };
        assert!(wrong(marble).starts_with("strength is inf"));
        assert!(wrong(Function::Worley { feature: Feature::Edge, jitter: 1.5 }).starts_with("jitter is 1.5"));
    }
}
