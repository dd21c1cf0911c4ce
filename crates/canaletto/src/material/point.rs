//! A material at a point of a surface.

use super::{Phong, StandardSurface};
use crate::math::Rgb;
use glam::Vec3;

/// A material evaluated at a point: the whole material as an integrator sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaterialPoint {
    /// The coefficients of (5.39b), or those that come nearest to another model. η, the opacity, the roughness and the
    /// emission are those of every model.
    pub classic: Phong,
    /// The standard surface with the numbers that textures set. Roughness and emission are those of `classic`. Other
    /// models have none.
    pub standard: Option<StandardSurface>,
    /// A colour over the shaded one and its share, 0 to 1. With a share of 1 nothing is left to shade.
    pub overlay: (Rgb, f32),
    /// The share of the surface that exists, 0 (a hole) to 1.
    pub coverage: f32,
    /// Whether a texture bent the shading normal.
    pub normal_bent: bool,
    /// The coat's unit normal on the outer side, if it isn't the shading normal: one that textures of the base don't
    /// bend. Else zero.
    pub coat_normal: Vec3,
    /// Whether the inner side emits, too.
    pub two_sided: bool,
}

impl Default for MaterialPoint {
    fn default() -> MaterialPoint {
        MaterialPoint {
            classic: Phong::default(),
            standard: None,
            overlay: (Rgb::BLACK, 0.0),
            coverage: 1.0,
            normal_bent: false,
            coat_normal: Vec3::ZERO,
            two_sided: false,
        }
    }
}

impl MaterialPoint {
    /// Lₑ, the radiance that the outer or the inner side emits by itself.
    #[inline]
    pub fn emitted(&self, outside: bool) -> Rgb {
        if outside || self.two_sided { self.classic.emission } else { Rgb::BLACK }
    }

    /// Whether the overlay leaves any of the shaded colour visible.
    #[inline]
    pub fn is_seen(&self) -> bool {
        self.overlay.1 < 1.0
    }

    /// The colour of the point under its overlay, if there is one.
    #[inline(always)]
    pub(crate) fn under_overlay(&self, color: Rgb) -> Rgb {
        let (overlay, share) = self.overlay;
        if share > 0.0 { (overlay * share + color * (1.0 - share)).saturated() } else { color }
    }

    /// Whether light passes: o < 1.
    #[inline]
    pub fn is_clear(&self) -> bool {
        self.classic.opacity < 1.0
    }

    /// Whether a reflected ray counts: k ≠ 0.
    #[inline]
    pub fn is_mirror(&self) -> bool {
        !self.classic.k.is_black()
    }

    /// The share of crossing light that the surface blocks: coverage times opacity o.
    pub fn opacity_with_coverage(&self) -> f32 {
        if self.coverage < 1.0 { self.coverage * self.classic.opacity } else { self.classic.opacity }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every hit of every integrator copies a point.
    #[test]
    fn points_are_small() {
        assert!(size_of::<MaterialPoint>() <= 300, "{}", size_of::<MaterialPoint>());
    }
}
