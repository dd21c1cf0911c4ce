//! Materials of a world.

use super::{Material, MaterialPoint};
use crate::math::Rgb;
use crate::shape::Surface;
use std::ops::Deref;

/// A material of a world: its description, and what hits need of it, derived once.
#[derive(Clone, Debug)]
pub struct PreparedMaterial {
    /// The values before any texture, on surfaces without a colour of their own.
    plain: MaterialPoint,
    is_opaque: bool,
    may_emit: bool,
    /// Whether a texture reads the colours of vertices, so that these don't replace the material's.
    colors_are_read: bool,
    described: Material,
}

impl Deref for PreparedMaterial {
    type Target = Material;

    #[inline]
    fn deref(&self) -> &Material {
        &self.described
    }
}

impl PreparedMaterial {
    /// Derives what hits need of a material. `reads_vertex_colors` tells which textures are vertex colours.
    pub fn new(mut described: Material, reads_vertex_colors: impl Fn(u32) -> bool) -> PreparedMaterial {
        // The coverage is constant without textures that change it.
        if let Some(cutoff) = described.alpha_cutoff.filter(|_| !described.has_cutouts()) {
            described.coverage = if described.coverage >= cutoff { 1.0 } else { 0.0 };
        }
        let plain = MaterialPoint {
            classic: described.classic(),
            standard: described.standard().copied(),
            coverage: described.coverage,
            two_sided: described.two_sided,
            ..MaterialPoint::default()
        };
        let colors_are_read = described.textures.iter().any(|used| reads_vertex_colors(used.texture));
        PreparedMaterial {
            plain,
            is_opaque: described.is_opaque(),
            may_emit: described.may_emit(),
            colors_are_read,
            described,
        }
    }

    /// The values before any texture, on surfaces without a colour of their own.
    #[inline]
    pub fn plain(&self) -> &MaterialPoint {
        &self.plain
    }

    /// The material's values at one point of a surface, before any texture.
    #[inline]
    pub fn at(&self, surface: &Surface) -> MaterialPoint {
        self.colored(surface.color)
    }

    /// The material's values on a surface with this colour of its own, or without one, before any texture.
    #[inline]
    pub(crate) fn colored(&self, color: Option<Rgb>) -> MaterialPoint {
        let mut point = self.plain;
        if let Some(color) = color.filter(|_| !self.colors_are_read) {
            match &mut point.standard {
                None => point.classic.kd = color,
                Some(standard) => {
                    standard.base.color = color;
                    self.finish(&mut point);
                }
            }
        }
        point
    }

    /// Finishes a point whose textures have been applied.
    #[inline]
    pub(crate) fn finish(&self, point: &mut MaterialPoint) {
        if let Some(standard) = &point.standard {
            standard.approximate(&mut point.classic);
        }
        if let Some(cutoff) = self.described.alpha_cutoff {
            point.coverage = if point.coverage >= cutoff { 1.0 } else { 0.0 };
        }
    }

    /// Whether the material lets no light through anywhere.
    #[inline]
    pub fn is_opaque(&self) -> bool {
        self.is_opaque
    }

    /// Whether the material may emit light anywhere.
    #[inline]
    pub fn may_emit(&self) -> bool {
        self.may_emit
    }
}
