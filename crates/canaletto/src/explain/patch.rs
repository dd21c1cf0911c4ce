//! The light of radiosity at a hit, and the patches that it comes from: what lights them, the largest share first.

use super::record::in_the_scene;
use super::tree::{Side, is_zero};
use crate::integrator::radiosity::{ArrivingLight, RadiositySolution};
use crate::integrator::{BlendedLight, ShownLight, blended};
use crate::math::Rgb;
use crate::world::{Hit, World};
use glam::DVec3;
use serde::Serialize;

/// The light of a radiosity solution at a hit, which takes the place of ambient light.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RadiosityNode {
    /// The number of the patch, [`PatchNode::number`].
    pub patch: u32,
    /// The part of the solution's light that the picture takes.
    pub shown: ShownLight,
    /// Whether the light is interpolated between patches. If not, all of the patch has its mean light.
    pub is_interpolated: bool,
    /// The places whose light is blended: the patch, and for interpolated light its centre and two vertices of its
    /// outline. [`PlaceNode`] has the terms of each.
    pub corners: Vec<CornerNode>,
    /// The shown part of the weighted mean over the corners, divided by the sum of the weights. All light is the
    /// radiance of a white surface in it.
    pub light: [f64; 3],
}

/// A place whose light is blended, with its weight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CornerNode {
    /// The vertex's number in the solution; none for the patch or its centre.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vertex: Option<u32>,
    /// The place in the scene's coordinates.
    pub point: [f64; 3],
    /// The weight.
    pub weight: f64,
    /// The light of the scene's lights without a reflection.
    pub direct: [f64; 3],
    /// The light straight from emitting surfaces.
    pub from_emitters: [f64; 3],
    /// All other light.
    pub indirect: [f64; 3],
}

/// A patch: one side of a flat piece of surface with the same light everywhere.
///
/// Its radiance is emission + reflectance · (direct + from_emitters + indirect), the balance that radiosity solves.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PatchNode {
    /// The patch's number in the solution.
    pub number: u32,
    /// The object's name.
    pub object: String,
    /// The object's number, [`crate::world::World::object_id`].
    pub object_id: u32,
    /// The kind of the object.
    pub kind: &'static str,
    /// The index of the triangle or sphere in the object; 0 for single shapes.
    pub primitive: u32,
    /// The material's name.
    pub material: String,
    /// The side of the surface.
    pub side: Side,
    /// The corners in the scene's coordinates, counter-clockwise when seen from this side.
    pub corners: Vec<[f64; 3]>,
    /// The centre.
    pub center: [f64; 3],
    /// The area that is not covered by other bodies.
    pub area: f64,
    /// The mean diffuse reflectance.
    pub reflectance: [f64; 3],
    /// The radiance that the patch emits itself.
    pub emission: [f64; 3],
    /// The light that arrives from the scene's lights without a reflection.
    pub direct: LightSum,
    /// The light that arrives straight from emitting surfaces.
    pub from_emitters: LightSum,
    /// All other light that arrives: by reflections and from the environment.
    pub indirect: LightSum,
    /// The radiance that leaves the patch.
    pub radiance: [f64; 3],
}

/// What lights the patches and the places under a pixel's rays; empty unless radiosity makes the picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RadiosityTerms {
    /// The patches, by number.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub patches: Vec<PatchNode>,
    /// The number of further patches, which aren't explained.
    #[serde(skip_serializing_if = "is_zero")]
    pub more_patches: usize,
    /// The places whose light is interpolated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub places: Vec<PlaceNode>,
    /// The number of further places, which aren't explained.
    #[serde(skip_serializing_if = "is_zero")]
    pub more_places: usize,
}

/// A place whose light is blended into a pixel's, with what lights it: the centre of a patch, or a vertex.
///
/// The form factors are those of the place. A vertex where several patches meet has a mean over planes; its form
/// factors are multiplied by the shares.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PlaceNode {
    /// The patch's number, for its centre.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub patch: Option<u32>,
    /// The vertex's number in the solution.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vertex: Option<u32>,
    /// The place in the scene's coordinates.
    pub point: [f64; 3],
    /// The light that arrives from the scene's lights without a reflection.
    pub direct: LightSum,
    /// The light that arrives straight from emitting surfaces.
    pub from_emitters: LightSum,
    /// All other light that arrives: by reflections and from the environment.
    pub indirect: LightSum,
}

/// Light that arrives at a patch or a place, as a sum over its sources.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LightSum {
    /// The sources, the largest first.
    pub sources: Vec<SourceNode>,
    /// The sum of further sources.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub others: Option<OthersNode>,
    /// What rounding makes of the sum in this order, relative to the order in which the solver adds.
    pub rounding: [f64; 3],
    /// The sum of the sources, the others and the rounding, in this order.
    pub light: [f64; 3],
}

/// The kind of a source of a patch's light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum SourceKind {
    /// A light of the scene.
    Light,
    /// The environment.
    Environment,
    /// The surface of an object.
    Object,
    /// Surfaces that are near each other and give light as one.
    Cluster,
    /// The patch itself. The form factors of a patch in a closed room sum to 1; it sees itself where they lack.
    Itself,
}

/// A source of a patch's light.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SourceNode {
    /// The kind of the source.
    pub kind: SourceKind,
    /// The name of the light, of the object, or of the objects of a cluster.
    pub name: String,
    /// The object's number, for the surface of an object.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub object_id: Option<u32>,
    /// The material's name, for the surface of an object.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// The number of links by which the light arrives; 0 for lights and the environment.
    pub link_count: usize,
    /// The links with most light.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub links: Vec<LinkNode>,
    /// The sum of further links.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub others: Option<OthersNode>,
    /// The light: the sum of the links and the others in this order, if there are links.
    pub light: [f64; 3],
}

/// A link by which a patch gets light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LinkNode {
    /// The centre of the source in the scene's coordinates.
    pub center: [f64; 3],
    /// The area of the source.
    pub area: f64,
    /// The area of the linked receiver: of the patch, or of the part of the surface around it that has the link.
    pub receiver_area: f64,
    /// The share of the receiver's view that the source fills.
    pub form_factor: f64,
    /// The radiance of the source: what it emits in [`PatchNode::from_emitters`], what it reflects in
    /// [`PatchNode::indirect`].
    pub radiance: [f64; 3],
    /// The light: form factor · radiance.
    pub light: [f64; 3],
}

/// The sum of sources or links that aren't listed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct OthersNode {
    /// Their number.
    pub count: usize,
    /// Their light.
    pub light: [f64; 3],
}

impl RadiosityNode {
    /// The light of a solution at a hit, whose place is given in the world. None where the surface has no patch.
    pub(super) fn new(
        world: &World,
        (solution, shown, is_interpolated): (&RadiositySolution, ShownLight, bool),
        (hit, point, outside): (&Hit, DVec3, bool),
    ) -> Option<RadiosityNode> {
        let patch = solution.patch_at(hit.instance, hit.primitive, hit.part, outside, point)?;
        let corners = if is_interpolated { solution.corners_at(patch, point) } else { vec![solution.center_of(patch)] };
        let corner = |corner: &BlendedLight| CornerNode {
            vertex: corner.vertex,
            point: in_the_scene(world, corner.place.as_vec3()),
            weight: corner.weight,
            direct: corner.light.direct.to_array(),
            from_emitters: corner.light.from_emitters.to_array(),
            indirect: corner.light.indirect.to_array(),
        };
        let corners = corners.iter().map(corner).collect();
        let mut node = RadiosityNode { patch: patch as u32, shown, is_interpolated, corners, light: [0.0; 3] };
        node.light = node.sum().to_array();
        Some(node)
    }

    /// The light, computed from the corners.
    pub fn sum(&self) -> DVec3 {
        let corner = |corner: &CornerNode| BlendedLight {
            vertex: corner.vertex,
            place: corner.point.into(),
            weight: corner.weight,
            light: ArrivingLight {
                direct: corner.direct.into(),
                from_emitters: corner.from_emitters.into(),
                indirect: corner.indirect.into(),
            },
        };
        self.shown.of(&blended(&self.corners.iter().map(corner).collect::<Vec<_>>()))
    }

    /// The radiance of a surface in the light, as the picture has it.
    pub fn reflected(&self, kd: Rgb) -> Rgb {
        (Rgb::from(self.sum().to_array().map(|v| v as f32)).saturated() * kd).saturated()
    }
}

impl PatchNode {
    /// The radiance that leaves the patch, computed from its terms.
    pub fn sum(&self) -> DVec3 {
        let light = self.direct.sum() + self.from_emitters.sum() + self.indirect.sum();
        DVec3::from(self.emission) + DVec3::from(self.reflectance) * light
    }
}

impl LightSum {
    /// The light, computed from its terms in their order. Equal to `light` bit for bit.
    pub fn sum(&self) -> DVec3 {
        self.sum_without_rounding() + DVec3::from(self.rounding)
    }

    pub(super) fn sum_without_rounding(&self) -> DVec3 {
        let sources = self.sources.iter().fold(DVec3::ZERO, |sum, source| sum + source.sum());
        sources + self.others.map_or(DVec3::ZERO, |others| others.light.into())
    }
}

impl SourceNode {
    /// The light, computed from the links in their order. Equal to `light` bit for bit.
    pub fn sum(&self) -> DVec3 {
        if self.links.is_empty() {
            return self.light.into();
        }
        let links = self.links.iter().fold(DVec3::ZERO, |sum, link| sum + link.sum());
        links + self.others.map_or(DVec3::ZERO, |others| others.light.into())
    }
}

impl LinkNode {
    /// The light: form factor · radiance. Equal to `light` bit for bit.
    pub fn sum(&self) -> DVec3 {
        DVec3::from(self.radiance) * self.form_factor
    }
}
