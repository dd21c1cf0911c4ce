//! A disk as seen from a point, and directions that are uniform over its solid angle. The disk covers a spherical
//! ellipse (Guillén et al., *Area-Preserving Parameterizations for Spherical Ellipses*, 2017).
//!
//! Lengths are in units of the radius. The plane is at distance h, and the centre at distance y from the foot of the
//! perpendicular. L and G are the arithmetic and the geometric mean of the distances ℓ₁ and ℓ₂ to the nearest and the
//! farthest point of the rim. The axis of the elliptic cone halves the angle between those points. With g = L² − 1, its
//! half angles are α across, with sin α = 1 / L, and β along the offset, with tan β = h / g.
//!
//! A plane across the axis at distance 1 cuts the cone in an ellipse. Per eccentric angle t, it covers
//! dΩ = tan α tan β dt / (w (w + 1)) with w = √(1 + tan² α cos² t + tan² β sin² t) = √((L² cos² t + G² sin² t) / g).
//! Over the whole ellipse that is a complete elliptic integral, and up to t an incomplete one. The paper inverts the
//! latter by Newton's method or by a table. Here z with dz = dt / w replaces t: z runs from 0 to Z over a quarter. In z
//! the density tan α tan β / (1 + w) is doubly periodic and has two simple poles with the residues ±i in a period. So
//! its Fourier series has closed coefficients. From the minor axis on, the part x of a quarter in z covers the part
//! x + (8 / Ω) Σ sin(nπx) sinh(nδ) / (n sinh(nτ)) in solid angle, which Newton's method inverts. With k = (ℓ₂ − ℓ₁) /
//! (ℓ₂ + ℓ₁), k' = G / L and tan φ = h L² / (y g), τ is 2π K(k') / K(k) and δ is π F(φ, k') / K(k).

use std::f64::consts::{FRAC_PI_2, PI};

/// The smallest solid angle, about. For disks seen edge-on at such an angle, h has nine digits. Disks that are far away
/// look the same by area.
const SMALLEST: f64 = 1e-6;

/// The smallest distance of the plane, in radii.
const NEAREST: f64 = 1e-8;

/// The relative difference of two means at which the next step of the arithmetic-geometric mean has twelve digits.
const NEARLY_EQUAL: f64 = 1e-6;

/// The same for nine digits, which are enough for directions.
const ALMOST_EQUAL: f64 = 1e-4;

/// The most steps of the arithmetic-geometric mean from L and G. Above the smallest solid angle, G / L is above 8e-4.
const STEPS: usize = 6;

/// The most terms of the series. Above the smallest solid angle they fall at least as fast as exp(−0.69 n).
const TERMS: usize = 40;

/// The series ends with the first term below.
const SMALLEST_TERM: f64 = 1e-9;

/// The largest third coefficient of the density that doesn't count.
const SMALLEST_THIRD: f64 = 5e-7;

/// The step of Newton's method, as a part of the root, after which it has seven digits. The next one would be about the
/// square of it.
const LAST_STEP: f64 = 3e-5;

/// A disk with the radius 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct SphericalEllipse {
    height: f64,
    offset: f64,
    /// ℓ₁ and ℓ₂.
    distances: [f64; 2],
    /// L and G.
    means: [f64; 2],
    /// L² − 1.
    g: f64,
    solid_angle: f64,
}

impl SphericalEllipse {
    /// The disk whose plane is at distance `height`, and whose centre is at distance `offset` from the foot of the
    /// perpendicular. None if its solid angle is tiny, as far away or edge-on, or if the point is about on the disk.
    pub(super) fn new(height: f64, offset: f64, radius: f64) -> Option<SphericalEllipse> {
        let (h, y) = (height.abs() / radius, offset.abs() / radius);
        let distance2 = h * h + y * y;
        if !(h >= NEAREST && PI * h >= SMALLEST * distance2 * distance2.sqrt()) {
            return None;
        }
        let distances = [y - 1.0, y + 1.0].map(|y| (h * h + y * y).sqrt());
        let product = distances[0] * distances[1];
        let [l, geometric] = [0.5 * (distances[0] + distances[1]), product.sqrt()];
        let outside = h * h + (y - 1.0) * (y + 1.0);
        let g = if outside > 0.0 { 0.5 * (product + outside) } else { 2.0 * h * h / (product - outside) };
        let solid_angle = 4.0 * h / (l * l * l) * complete(geometric / l, g / (l * l));
        let ellipse = SphericalEllipse { height: h, offset: y, distances, means: [l, geometric], g, solid_angle };
        (solid_angle > 0.0 && solid_angle.is_finite()).then_some(ellipse)
    }

    /// The solid angle.
    pub(super) fn solid_angle(&self) -> f64 {
        self.solid_angle
    }

    /// The modulus k. The cone's axis meets the disk at the distance k from the centre towards the foot.
    fn modulus(&self) -> f64 {
        let [near, far] = self.distances;
        (far - near) / (far + near)
    }

    /// The place on the disk at `u` of the unit square, in radii from the centre: across, and away from the foot of the
    /// perpendicular. Equal parts of the square map to equal solid angles. Squares around the square's centre become
    /// closed curves around the cone's axis, as in [`crate::math::warp::disk`].
    pub(super) fn sample(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
        let (wide, high) = (a.abs(), b.abs());
        // The part of a quarter from the minor axis on, and the part of the versine from the cone's axis on.
        let (quarter, side) = match wide > high {
            true => (1.0 - 0.5 * high / wide, wide),
            false => (if high > 0.0 { 0.5 * wide / high } else { 0.0 }, high),
        };
        let (mut all, mut last) = ([self.means; STEPS], 0);
        while last + 1 < STEPS {
            let [a, b] = all[last];
            if a - b <= ALMOST_EQUAL * a {
                break;
            }
            last += 1;
            all[last] = [0.5 * (a + b), (a * b).sqrt()];
        }
        let (means, mean) = (&all[..=last], 0.5 * (all[last][0] + all[last][1]));
        let (sin, cos, w) = self.at(self.invert(quarter, mean), means, mean);
        let part = side * side;
        let rest = part + w * (1.0 - part);
        let out = (part * (w + rest) / (1.0 + w)).sqrt() / rest;
        let (x, y) = ((out * cos).copysign(a), (out * sin).copysign(b));
        // The projection from the ellipse to the disk keeps the rim and moves the axis.
        let ([l, geometric], k) = (self.means, self.modulus());
        let scale = 1.0 / (1.0 - k * y);
        [x * (geometric / l) * scale, (y - k) * scale]
    }

    /// The part of a quarter in z, from the minor axis on, that covers this part of its solid angle. `mean` is M, the
    /// arithmetic-geometric mean of L and G.
    fn invert(&self, wanted: f64, mean: f64) -> f64 {
        let ([l, geometric], root) = (self.means, self.g.sqrt());
        if l - geometric <= SMALLEST_TERM * (root + geometric) {
            return wanted;
        }
        // The density is 2πh / (Ω M √g (√g + W)), where W = w √g is G at the minor axis, L at the major one, and √(LG)
        // half way in z. If the coefficients of its series fall quickly, the first two follow from there. The third is
        // below the square of the second over the first.
        let scale = 2.0 * PI * self.height / (self.solid_angle * mean * root);
        let [start, middle, end] = [geometric, (l * geometric).sqrt(), l].map(|w| scale / (root + w));
        let (first, second) = (0.5 * (start - end), 1.0 - middle);
        if second * second < SMALLEST_THIRD * first {
            return root_of_series(wanted, &[first / PI, second / (2.0 * PI)]);
        }
        let k = self.modulus();
        let (of_complement, part) = part_of_period(self.offset * self.g / (self.height * l * l), k);
        let tau = 2.0 * PI * mean / (l * of_complement);
        let delta = 0.5 * tau * part;
        // sinh(nδ) / sinh(nτ) is exp(n(δ − τ)) (1 − exp(−2nδ)) / (1 − exp(−2nτ)).
        let (decay, both) = (libm::exp(delta - tau), libm::exp(-2.0 * tau));
        let first = -libm::expm1(-2.0 * delta);
        let (mut terms, mut count) = ([0.0; TERMS], 0);
        let (mut power, mut above, mut both_power) = (8.0 / self.solid_angle, 0.0, 1.0);
        while count < TERMS {
            power *= decay;
            both_power *= both;
            above = above * (1.0 - first) + first;
            terms[count] = power * above / ((1.0 - both_power) * (count + 1) as f64);
            count += 1;
            if terms[count - 1] < SMALLEST_TERM {
                break;
            }
        }
        root_of_series(wanted, &terms[..count])
    }

    /// The sine and the cosine of the eccentric angle t, and w, where z is this part of a quarter from the minor axis
    /// on. Gauss's transformation makes w ever more even. Where it is even, t is in proportion to z.
    fn at(&self, part: f64, means: &[[f64; 2]], mean: f64) -> (f64, f64, f64) {
        let (mut cos, mut sin) = libm::sincos(FRAC_PI_2 * part);
        let mut w = mean;
        for &[a, b] in means.iter().rev() {
            let (sin2, cos2) = (sin * sin, cos * cos);
            let scale = 1.0 / (a + b + (a - b) * sin2);
            (sin, cos, w) =
                (2.0 * a * sin * scale, 2.0 * w * cos * scale, a * ((a + b) * cos2 + 2.0 * b * sin2) * scale);
        }
        (sin, cos, w / self.g.sqrt())
    }
}

/// The x at which x + Σ cₙ sin(nπx) is the wanted value. The sum isn't negative, and its slope falls.
fn root_of_series(wanted: f64, terms: &[f64]) -> f64 {
    // Newton's method, kept between bounds of the root. The root is at most `wanted`.
    let (mut low, mut high, mut x) = (0.0, wanted, wanted);
    for _ in 0..64 {
        let (sin, cos) = libm::sincos(PI * x);
        let (mut sum, mut slope) = (0.0, 0.0);
        let (mut s, mut c) = (sin, cos);
        for (n, term) in (1..).zip(terms) {
            sum += term * s;
            slope += term * f64::from(n) * c;
            (s, c) = (s * cos + c * sin, c * cos - s * sin);
        }
        let excess = x + sum - wanted;
        if excess > 0.0 {
            high = x
        } else {
            low = x
        }
        let newton = x - excess / (1.0 + PI * slope);
        let next = if low <= newton && newton <= high { newton } else { 0.5 * (low + high) };
        let step = (next - x).abs();
        x = next;
        if step <= LAST_STEP * x {
            break;
        }
    }
    x
}

/// The complete elliptic integral ∫ sin² t / ((cos² t + p sin² t) √(cos² t + k'² sin² t)) dt from 0 to π/2. k' and p
/// are positive, so no terms cancel. It is cel(k', p, 0, 1) of Bulirsch, *Numerical Calculation of Elliptic Integrals
/// and Elliptic Functions III*, 1969.
fn complete(complement: f64, p: f64) -> f64 {
    let (mut qc, mut p) = (complement, p.sqrt());
    let (mut a, mut b, mut e, mut m) = (0.0, 1.0 / p, complement, 1.0);
    for _ in 0..16 {
        let (f, g) = (a, e / p);
        a += b / p;
        b = 2.0 * (b + f * g);
        p += g;
        let last = m;
        m += qc;
        if (last - qc).abs() <= NEARLY_EQUAL * last {
            break;
        }
        qc = 2.0 * e.sqrt();
        e = qc * m;
    }
    FRAC_PI_2 * (b + a * m) / (m * (m + p))
}

/// The arithmetic-geometric mean of 1 and k, and the incomplete elliptic integral F(φ, k') over the complete one. φ
/// lies in the first quadrant and is given by its cotangent. k is the complementary modulus of k'. It is el1 of
/// Bulirsch, *Numerical Calculation of Elliptic Integrals and Elliptic Functions*, 1965.
fn part_of_period(cot: f64, k: f64) -> (f64, f64) {
    let (mut y, mut kc, mut m, mut half_turns, mut doublings) = (cot, k, 1.0, 0.0, 1.0);
    for _ in 0..16 {
        let e = m * kc;
        let last = m;
        m += kc;
        // The cotangent of about twice the angle.
        y -= e / y;
        doublings *= 2.0;
        let passed = if y < 0.0 { 1.0 } else { 0.0 };
        if (last - kc).abs() <= NEARLY_EQUAL * last {
            half_turns += passed;
            break;
        }
        kc = 2.0 * e.sqrt();
        half_turns = 2.0 * half_turns + passed;
    }
    (m / doublings, (libm::atan(m / y) + PI * half_turns) / (FRAC_PI_2 * doublings))
}
