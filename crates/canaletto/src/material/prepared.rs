//! Materials of a world.

use super::{Material, MaterialModel, MaterialPoint};
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
    /// Derives what hits need of a material.
    pub fn new(described: Material) -> PreparedMaterial {
        let plain = MaterialPoint {
            classic: described.classic(),
            standard: described.standard().map(|surface| surface.point()),
            coverage: described.coverage,
            two_sided: described.two_sided,
            ..MaterialPoint::default()
        };
        PreparedMaterial { plain, is_opaque: described.is_opaque(), may_emit: described.may_emit(), described }
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
        if let Some(color) = color {
            match &mut point.standard {
                None => point.classic.kd = color,
                Some(standard) => {
                    standard.base_color = color;
                    self.finish(&mut point);
                }
            }
        }
        point
    }

    /// Finishes a point whose textures have been applied.
    #[inline]
    pub(crate) fn finish(&self, point: &mut MaterialPoint) {
        if let (MaterialModel::Standard(surface), Some(standard)) = (&self.described.model, &point.standard) {
            surface.approximate(standard, &mut point.classic);
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
