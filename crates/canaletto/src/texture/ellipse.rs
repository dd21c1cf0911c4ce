//! Footprints: ellipses in texels (Heckbert, *Fundamentals of Texture Mapping and Image Warping*, 1989, section 3.5.8).

/// An ellipse around the origin: all d with dᵀ M⁻¹ d ≤ 1 for the symmetric matrix M.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ellipse {
    pub(super) xx: f64,
    pub(super) xy: f64,
    pub(super) yy: f64,
}

impl Ellipse {
    /// The image of the unit circle under the map that takes its axes to these vectors.
    pub(super) fn of(a: [f64; 2], b: [f64; 2]) -> Ellipse {
        Ellipse { xx: a[0] * a[0] + b[0] * b[0], xy: a[0] * a[1] + b[0] * b[1], yy: a[1] * a[1] + b[1] * b[1] }
    }

    /// The longer and the shorter radius.
    pub(super) fn radii(&self) -> [f64; 2] {
        let mean = 0.5 * (self.xx + self.yy);
        let half = 0.5 * (self.xx - self.yy);
        let half_gap = (half * half + self.xy * self.xy).sqrt();
        let large = mean + half_gap;
        // The product of both radii gives the shorter one, since their difference cancels.
        let small = if large > 0.0 { (self.xx * self.yy - self.xy * self.xy) / large } else { 0.0 };
        [large.sqrt(), small.max(0.0).sqrt()]
    }

    /// The ellipse with a shorter radius of at least this.
    pub(super) fn at_least(self, radius: f64) -> Ellipse {
        let [major, minor] = self.radii();
        if minor >= radius {
            return self;
        }
        let (large, small) = (major * major, minor * minor);
        let wanted = radius * radius;
        if large <= wanted || large <= small {
            return Ellipse { xx: wanted.max(large), xy: 0.0, yy: wanted.max(large) };
        }
        // (λ₁ I − M) / (λ₁ − λ₂) projects onto the shorter axis.
        let more = (wanted - small) / (large - small);
        Ellipse {
            xx: self.xx + more * (large - self.xx),
            xy: self.xy - more * self.xy,
            yy: self.yy + more * (large - self.yy),
        }
    }

    /// The ellipse in other units along both axes.
    pub(super) fn scaled(&self, x: f64, y: f64) -> Ellipse {
        Ellipse { xx: self.xx * x * x, xy: self.xy * x * y, yy: self.yy * y * y }
    }

    /// The ellipse with its squared radius larger by `more` in every direction.
    pub(super) fn widened(&self, more: f64) -> Ellipse {
        Ellipse { xx: self.xx + more, xy: self.xy, yy: self.yy + more }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radii_are_those_of_the_axes() {
        let (sin, cos) = (0.6, 0.8);
        let e = Ellipse::of([5.0 * cos, 5.0 * sin], [-2.0 * sin, 2.0 * cos]);
        let [major, minor] = e.radii();
        assert!((major - 5.0).abs() < 1e-12 && (minor - 2.0).abs() < 1e-12);
        // One ellipse from conjugate radii.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let a = [half * (5.0 * cos - 2.0 * sin), half * (5.0 * sin + 2.0 * cos)];
        let b = [half * (5.0 * cos + 2.0 * sin), half * (5.0 * sin - 2.0 * cos)];
        let [major, minor] = Ellipse::of(a, b).radii();
        assert!((major - 5.0).abs() < 1e-12 && (minor - 2.0).abs() < 1e-12);
        assert_eq!(Ellipse::of([0.0; 2], [0.0; 2]).radii(), [0.0; 2]);
    }

    #[test]
    fn the_shorter_axis_can_be_lengthened() {
        let e = Ellipse::of([3.0, 4.0], [-0.008, 0.006]).at_least(0.5);
        let [major, minor] = e.radii();
        assert!((major - 5.0).abs() < 1e-9 && (minor - 0.5).abs() < 1e-9);
        let line = Ellipse::of([3.0, 4.0], [0.0, 0.0]).at_least(1.0);
        assert!((line.radii()[1] - 1.0).abs() < 1e-9);
        assert_eq!(Ellipse::of([0.0; 2], [0.0; 2]).at_least(2.0), Ellipse { xx: 4.0, xy: 0.0, yy: 4.0 });
        assert_eq!(Ellipse::of([1.0, 0.0], [0.0, 1.0]).at_least(2.0).radii(), [2.0, 2.0]);
    }
}
