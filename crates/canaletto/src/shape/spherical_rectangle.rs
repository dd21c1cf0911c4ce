//! A rectangle as seen from a point, and directions that are uniform over its solid angle (Ureña, Fajardo & King, *An
//! Area-Preserving Parametrization for Spherical Rectangles*, 2013).
//!
//! T(x, y) is the solid angle of the rectangle between the foot of the perpendicular and the point (x, y) of the plane
//! at distance z: tan T = x y / (z √(x² + y² + z²)). It is negative where one of the two is. All solid angles here are
//! sums of it. The paper's angles are π/2 ± T. Arc tangents stay exact where the paper's arc cosines lose digits.

use std::f64::consts::TAU;

/// The smallest solid angle for which the formulas hold to about seven digits, and how far from a half space they do.
const SMALLEST: f64 = 1e-8;

/// A rectangle in coordinates of its own frame, with the point that sees it at the origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct SphericalRectangle {
    x: [f64; 2],
    y: [f64; 2],
    /// The distance of the rectangle's plane.
    z: f64,
    solid_angle: f64,
}

/// A complex number, as a length and a direction whose angle isn't needed yet.
type Complex = [f64; 2];

fn product([a, b]: Complex, [c, d]: Complex) -> Complex {
    [a * c - b * d, a * d + b * c]
}

fn conjugate([a, b]: Complex) -> Complex {
    [a, -b]
}

impl SphericalRectangle {
    /// The rectangle between two `x` and two `y` in a plane at distance `z`. None if its solid angle is so small, or so
    /// near that of a half space, that rounding would show.
    pub(super) fn new(x: [f64; 2], y: [f64; 2], z: f64) -> Option<SphericalRectangle> {
        // Products of four coordinates may leave the range of numbers.
        let size = x.iter().chain(&y).fold(z.abs(), |size, v| size.max(v.abs()));
        if size.is_nan() || size <= 0.0 {
            return None;
        }
        let (x, y, z) = (x.map(|x| x / size), y.map(|y| y / size), z.abs() / size);
        let mut rectangle = SphericalRectangle { x, y, z, solid_angle: 0.0 };
        // The angle of a product is the sum of the factors' angles.
        let [re, im] = product(rectangle.strip(x[1]), conjugate(rectangle.strip(x[0])));
        let angle = libm::atan2(im, re);
        rectangle.solid_angle = if angle < 0.0 { angle + TAU } else { angle };
        (SMALLEST..TAU - SMALLEST).contains(&rectangle.solid_angle).then_some(rectangle)
    }

    /// The number with the angle T(x, y).
    fn corner(&self, x: f64, y: f64) -> Complex {
        [self.z * (x * x + y * y + self.z * self.z).sqrt(), x * y]
    }

    /// The number whose angle is the solid angle from 0 to `x`, of (−π, π).
    fn strip(&self, x: f64) -> Complex {
        product(self.corner(x, self.y[1]), conjugate(self.corner(x, self.y[0])))
    }

    /// The solid angle.
    pub(super) fn solid_angle(&self) -> f64 {
        self.solid_angle
    }

    /// The place in the rectangle at `u` of the unit square, as shares of its extents along x and y. Equal parts of the
    /// square map to equal solid angles.
    pub(super) fn sample(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let ([x0, x1], [y0, y1], z) = (self.x, self.y, self.z);
        // φ, the solid angle from 0 to the wanted x.
        let [re, im] = self.strip(x0);
        let (half_sin, half_cos) = libm::sincos(0.5 * (libm::atan2(im, re) + u * self.solid_angle));
        let sin = 2.0 * half_sin * half_cos;
        // The paper's x_u with its c_u inserted: x = z sin φ / √((b₁ + b₀ cos φ)² − (1 − b₀²) sin² φ).
        let [l0, l1] = [y0, y1].map(|y| (y * y + z * z).sqrt());
        let (b0, b1) = (-y0 / l0, y1 / l1);
        let sum = if y0 * y1 > 0.0 { z * z * (y1 - y0) * (y1 + y0) / (l0 * l1 * (y1 * l0 + y0 * l1)) } else { b0 + b1 };
        let [a, b] = [sum - b0 * 2.0 * half_sin * half_sin, z / l0 * sin];
        let x = (z * sin / ((a - b) * (a + b)).max(f64::MIN_POSITIVE).sqrt()).clamp(x0, x1);
        // Equal parts of the sine of the elevation are equal solid angles on the strip at x. Near the zenith and the
        // nadir the sine's distance from 1 and −1 has more digits.
        let d2 = x * x + z * z;
        let [r0, r1] = [y0, y1].map(|y| (d2 + y * y).sqrt());
        let mix = |from: f64, to: f64| from * (1.0 - v) + to * v;
        let sine = mix(y0 / r0, y1 / r1);
        let below = |y: f64, r: f64| if y > 0.0 { d2 / (r * (r + y)) } else { 1.0 - y / r };
        let rest = if sine > 0.0 { mix(below(y0, r0), below(y1, r1)) } else { mix(below(-y0, r0), below(-y1, r1)) };
        let y = (sine * (d2 / (rest * (2.0 - rest)).max(f64::MIN_POSITIVE)).sqrt()).clamp(y0, y1);
        [(x - x0) / (x1 - x0), (y - y0) / (y1 - y0)]
    }
}
