//! Linear RGB, whose `*` is the chapter's ⊗.

use super::Vector;
use bytemuck::Zeroable;
use canaletto_bvh::lanes::Real32;
use serde::{Deserialize, Serialize};
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Sub};

/// A linear RGB triple: an intensity, a reflectance or a factor. It is unbounded, and not clamped before the film is
/// developed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Zeroable)]
#[serde(from = "[f32; 3]", into = "[f32; 3]")]
pub struct Rgb {
    /// The red component.
    pub r: f32,
    /// The green component.
    pub g: f32,
    /// The blue component.
    pub b: f32,
}

impl Rgb {
    /// The colour (0, 0, 0).
    pub const BLACK: Rgb = Rgb::gray(0.0);
    /// The colour (1, 1, 1).
    pub const WHITE: Rgb = Rgb::gray(1.0);

    /// The colour (r, g, b).
    #[inline]
    pub const fn new(r: f32, g: f32, b: f32) -> Rgb {
        Rgb { r, g, b }
    }

    /// The colour with this value in each component.
    #[inline]
    pub const fn gray(value: f32) -> Rgb {
        Rgb::new(value, value, value)
    }

    /// The largest component.
    #[inline]
    pub fn max_component(self) -> f32 {
        self.r.max(self.g).max(self.b)
    }

    /// The luminance of sRGB's primaries (ITU-R BT.709).
    #[inline]
    pub fn luminance(self) -> f32 {
        0.2126 * self.r + 0.7152 * self.g + 0.0722 * self.b
    }

    /// Whether every component is zero, so that all its products vanish.
    #[inline]
    pub fn is_black(self) -> bool {
        self == Rgb::BLACK
    }

    /// Whether no component is infinite or NaN.
    #[inline]
    pub fn is_finite(self) -> bool {
        self.r.is_finite() && self.g.is_finite() && self.b.is_finite()
    }

    /// The colour with overflowed components replaced by the largest number. Light may become too bright to distinguish
    /// from brighter light, but never infinite.
    #[inline]
    pub fn saturated(self) -> Rgb {
        self.map(saturate)
    }

    /// The components as (r, g, b).
    #[inline]
    pub fn to_array(self) -> [f32; 3] {
        [self.r, self.g, self.b]
    }

    /// Applies `f` to each component.
    #[inline]
    pub fn map(self, mut f: impl FnMut(f32) -> f32) -> Rgb {
        Rgb::new(f(self.r), f(self.g), f(self.b))
    }
}

/// [`Rgb::saturated`] for one component.
#[inline(always)]
pub(crate) fn saturate(v: f32) -> f32 {
    v.clamp(-f32::MAX, f32::MAX)
}

/// The nearest finite number in each lane. NaN stays.
#[inline(always)]
pub(crate) fn saturated<F: Real32>(v: F) -> F {
    let (least, most) = (F::splat(-f32::MAX), F::splat(f32::MAX));
    let v = F::select(v.less(least), least, v);
    F::select(most.less(v), most, v)
}

impl Rgb {
    /// The colour that a function gives for each lane.
    #[inline(always)]
    pub(crate) fn gather<F: Real32>(of_lane: impl Fn(usize) -> Rgb) -> Vector<F> {
        Vector {
            x: F::gather(|lane| of_lane(lane).r),
            y: F::gather(|lane| of_lane(lane).g),
            z: F::gather(|lane| of_lane(lane).b),
        }
    }
}

impl From<Rgb> for Vector<f32> {
    #[inline(always)]
    fn from(c: Rgb) -> Vector<f32> {
        Vector { x: c.r, y: c.g, z: c.b }
    }
}

impl From<Vector<f32>> for Rgb {
    #[inline(always)]
    fn from(v: Vector<f32>) -> Rgb {
        Rgb { r: v.x, g: v.y, b: v.z }
    }
}

impl From<[f32; 3]> for Rgb {
    #[inline]
    fn from([r, g, b]: [f32; 3]) -> Rgb {
        Rgb { r, g, b }
    }
}

impl From<Rgb> for [f32; 3] {
    #[inline]
    fn from(c: Rgb) -> [f32; 3] {
        c.to_array()
    }
}

impl Add for Rgb {
    type Output = Rgb;
    #[inline]
    fn add(self, o: Rgb) -> Rgb {
        Rgb::new(self.r + o.r, self.g + o.g, self.b + o.b)
    }
}

impl AddAssign for Rgb {
    #[inline]
    fn add_assign(&mut self, o: Rgb) {
        *self = *self + o;
    }
}

impl Sub for Rgb {
    type Output = Rgb;
    #[inline]
    fn sub(self, o: Rgb) -> Rgb {
        Rgb::new(self.r - o.r, self.g - o.g, self.b - o.b)
    }
}

/// The chapter's ⊗, component by component (5.32b).
impl Mul for Rgb {
    type Output = Rgb;
    #[inline]
    fn mul(self, o: Rgb) -> Rgb {
        Rgb::new(self.r * o.r, self.g * o.g, self.b * o.b)
    }
}

impl Mul<f32> for Rgb {
    type Output = Rgb;
    #[inline]
    fn mul(self, s: f32) -> Rgb {
        Rgb::new(self.r * s, self.g * s, self.b * s)
    }
}

impl MulAssign<f32> for Rgb {
    #[inline]
    fn mul_assign(&mut self, s: f32) {
        *self = *self * s;
    }
}

impl Div<f32> for Rgb {
    type Output = Rgb;
    #[inline]
    fn div(self, s: f32) -> Rgb {
        Rgb::new(self.r / s, self.g / s, self.b / s)
    }
}

impl Sum for Rgb {
    #[inline]
    fn sum<I: Iterator<Item = Rgb>>(iter: I) -> Rgb {
        iter.fold(Rgb::BLACK, Add::add)
    }
}
