//! Displacement at build time: the materials that displace surfaces, and the heights.

use crate::material::{Material, Place, Space, Target, TextureUse};
use crate::shape::SurfaceDifferential;
use crate::shape::displace::{BaseMesh, DisplaceError, Vertex};
use crate::shape::{Mesh, Shape};
use crate::texture::{Lookup, PreparedTexture};
use crate::world::World;
use canaletto_bvh::Aabb;
use glam::{DMat3, DVec3};

/// The displacements of a scene's materials.
#[derive(Default)]
pub(in crate::world) struct Displacements {
    /// All textures, until the world takes them.
    pub(in crate::world) patterns: Vec<PreparedTexture>,
    /// The displacing uses of each material.
    uses: Vec<Vec<TextureUse>>,
    /// The number of triangles made so far.
    made: usize,
}

impl Displacements {
    pub(in crate::world) fn new(patterns: Vec<PreparedTexture>, materials: &[Material]) -> Displacements {
        let displaces = |used: &&TextureUse| matches!(used.target, Target::Displace { .. });
        let uses = materials.iter().map(|m| m.textures.iter().filter(displaces).copied().collect()).collect();
        Displacements { patterns, uses, made: 0 }
    }

    /// Whether this material displaces surfaces.
    pub(in crate::world) fn displaces(&self, material: u32) -> bool {
        self.uses.get(material as usize).is_some_and(|uses| !uses.is_empty())
    }

    /// Whether any material displaces surfaces.
    pub(in crate::world) fn any(&self) -> bool {
        self.uses.iter().any(|uses| !uses.is_empty())
    }

    /// A displaced shape as a mesh.
    pub(in crate::world) fn shape(&mut self, shape: &Shape, origin: DVec3, material: u32) -> Result<Mesh, String> {
        let Some(base) = BaseMesh::of_shape(shape) else {
            let kinds = "spheres, boxes, triangles, cylinders, cones and meshes can be";
            return Err(format!("a {} can't be displaced; {kinds}", shape.kind()));
        };
        let raised = self.displace(base, shape.bounds(), origin, &|_| material, &[material])?;
        Ok(Mesh { origin, ..raised })
    }

    /// A displaced mesh. `material` returns the material of each slot.
    pub(in crate::world) fn mesh(
        &mut self,
        mesh: Mesh,
        material: &(dyn Fn(u32) -> u32 + Sync),
    ) -> Result<Mesh, String> {
        let bounds = Aabb::from_points(mesh.positions.iter().copied());
        let slots = mesh.materials.len().max(1) as u32;
        let materials: Vec<u32> = (0..slots).map(material).collect();
        let origin = mesh.origin;
        let raised = self.displace(BaseMesh::of_mesh(mesh), Some(bounds), origin, material, &materials)?;
        Ok(Mesh { origin, ..raised })
    }

    fn displace(
        &mut self,
        base: BaseMesh,
        bounds: Option<Aabb>,
        origin: DVec3,
        material: &(dyn Fn(u32) -> u32 + Sync),
        materials: &[u32],
    ) -> Result<Mesh, String> {
        let all = materials.iter().flat_map(|m| self.uses.get(*m as usize)).flatten();
        let mut detail = 0.0f64;
        for used in all {
            if let Target::Displace { detail: wanted } = used.target {
                detail = detail.max(wanted.into());
            }
            if used.mapping.space == Space::World && used.mapping.projection != crate::material::Projection::Uv {
                return Err(
                    "a displacement happens in the object's own space; space \"world\" can't be used for it".into()
                );
            }
        }
        let limit = World::MAX_DISPLACED.saturating_sub(self.made);
        let height = |vertex: &Vertex| {
            let uses = self.uses.get(material(vertex.slot) as usize);
            uses.into_iter().flatten().map(|used| self.height(used, vertex, bounds, origin)).sum()
        };
        let mesh = base.raised(detail, limit, &height).map_err(|problem| match problem {
            DisplaceError::TooMany => format!(
                "its displacement needs more than {limit} triangles (the scene may have {} displaced ones); a smaller \
                 detail than {detail} makes fewer",
                World::MAX_DISPLACED
            ),
            DisplaceError::TooFar => {
                format!("its displacement reaches beyond ±{:e}, the largest coordinate possible", f32::MAX)
            }
        })?;
        self.made += mesh.len();
        Ok(mesh)
    }

    fn height(&self, used: &TextureUse, vertex: &Vertex, bounds: Option<Aabb>, origin: DVec3) -> f64 {
        let surface_differential =
            SurfaceDifferential { gradients: [DVec3::ZERO; 2], shape_operator: DMat3::ZERO, round: false };
        let Vertex { point, normal, uv, .. } = *vertex;
        let origins = [origin, DVec3::ZERO];
        let place =
            Place { point, normal, uv, surface_differential: &surface_differential, to_world: None, bounds, origins };
        let pattern = &self.patterns[used.texture as usize];
        let coords = used.mapping.coords(&place);
        let at = |at: DVec3| f64::from(used.number(pattern.eval(&Lookup::point(at))));
        coords.iter().map(|spot| at(spot.at) * spot.weight).sum()
    }
}
