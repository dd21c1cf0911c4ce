//! The layers of geometry at the first hit of a pixel.

use crate::camera::Camera;
use crate::job::Aov;
use crate::shape::Surface;
use crate::world::{Hit, World};

/// The values of a pixel's layers of geometry.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FirstHit {
    /// [`Camera::distance`] of the exact point.
    depth: f32,
    /// The unit shading normal on the viewer's side.
    normal: [f32; 3],
    /// The point in the scene's coordinates.
    position: [f32; 3],
    uv: [f32; 2],
    /// The numbers of the object, the material and the element; 0 for a miss.
    ids: [u32; 3],
}

impl FirstHit {
    /// A ray that hits nothing.
    pub(crate) const MISS: FirstHit =
        FirstHit { depth: f32::INFINITY, normal: [0.0; 3], position: [0.0; 3], uv: [0.0; 2], ids: [0; 3] };

    /// A hit that a camera at rest sees, from outside or from inside.
    pub(crate) fn new(world: &World, camera: &Camera, hit: &Hit, surface: &Surface, outside: bool) -> FirstHit {
        let normal = if outside { surface.shading_normal } else { -surface.shading_normal };
        FirstHit {
            depth: camera.distance(surface.exact) as f32,
            normal: normal.as_vec3().to_array(),
            position: world.to_scene(surface.point).to_array(),
            uv: surface.uv.to_array(),
            ids: [world.object_id(hit), world.material_index(hit) + 1, world.element_id(hit)],
        }
    }

    /// Writes the values of a layer, if it is one of geometry. Returns whether it is.
    pub(crate) fn write(&self, aov: Aov, out: &mut [f64]) -> bool {
        match aov {
            Aov::Depth => out[0] = self.depth.into(),
            Aov::Normal => out.copy_from_slice(&self.normal.map(f64::from)),
            Aov::Position => out.copy_from_slice(&self.position.map(f64::from)),
            Aov::Uv => out.copy_from_slice(&self.uv.map(f64::from)),
            Aov::ObjectId => out[0] = self.ids[0].into(),
            Aov::MaterialId => out[0] = self.ids[1].into(),
            Aov::ElementId => out[0] = self.ids[2].into(),
            _ => return false,
        }
        true
    }
}
