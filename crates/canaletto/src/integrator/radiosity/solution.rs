//! Solutions: the light of all patches, found again by a point of a surface.

use super::Balanced;
use super::emitters::{Emitter, Emitters};
use super::hierarchical::Given;
use super::interpolation::{BlendedLight, Interpolation};
use super::local_pass::{LocalPass, LocalRadiance};
use super::mesh::{NONE, PatchMesh};
use super::outline::Outline;
use super::root::planes_without_patches;
use crate::Named;
use crate::job::{Job, JobError};
use crate::scene::RadiositySettings;
use crate::world::World;
use glam::DVec3;

/// One side of a flat piece of surface with the same light everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Patch {
    /// The instance that the patch belongs to, as in [`Hit::instance`](crate::world::Hit::instance).
    pub instance: u32,
    /// The primitive, as in [`Hit::primitive`](crate::world::Hit::primitive). A patch of two triangles has the first.
    pub primitive: u32,
    /// The part of a shape.
    pub part: u32,
    /// Whether the patch is the outer side of the surface.
    pub is_outer: bool,
    /// The unit normal of the patch's side.
    pub normal: DVec3,
    /// The centre, in the coordinates of the world.
    pub center: DVec3,
    /// The area that is not covered by other bodies.
    pub area: f64,
    /// The mean diffuse reflectance.
    pub reflectance: DVec3,
    /// The radiance that the patch emits itself.
    pub emission: DVec3,
    /// The light that arrives from the scene's lights without a reflection, as the radiance of a white surface.
    pub direct: DVec3,
    /// The light that arrives straight from emitting surfaces.
    pub from_emitters: DVec3,
    /// All other light that arrives: by reflections and from the environment.
    pub indirect: DVec3,
}

impl Patch {
    /// The light that arrives.
    pub fn arriving(&self) -> ArrivingLight {
        ArrivingLight { direct: self.direct, from_emitters: self.from_emitters, indirect: self.indirect }
    }

    /// The radiance that leaves the patch.
    pub fn radiance(&self) -> DVec3 {
        self.emission + self.reflectance * self.arriving().sum()
    }

    /// The irradiance: π times the arriving light.
    pub fn irradiance(&self) -> DVec3 {
        self.arriving().sum() * std::f64::consts::PI
    }
}

/// Light that arrives at a surface, as the radiance of a white surface in it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ArrivingLight {
    /// The light of the scene's lights without a reflection.
    pub direct: DVec3,
    /// The light that arrives straight from emitting surfaces.
    pub from_emitters: DVec3,
    /// All other light.
    pub indirect: DVec3,
}

impl ArrivingLight {
    /// All light.
    pub fn sum(&self) -> DVec3 {
        self.direct + self.from_emitters + self.indirect
    }

    /// What a function does to each part.
    pub(super) fn map(&self, of: impl Fn(DVec3) -> DVec3) -> ArrivingLight {
        let ArrivingLight { direct, from_emitters, indirect } = *self;
        ArrivingLight { direct: of(direct), from_emitters: of(from_emitters), indirect: of(indirect) }
    }

    /// The sum of each part with another light's.
    pub(super) fn plus(&self, other: &ArrivingLight) -> ArrivingLight {
        ArrivingLight {
            direct: self.direct + other.direct,
            from_emitters: self.from_emitters + other.from_emitters,
            indirect: self.indirect + other.indirect,
        }
    }
}

/// The squared distance from the centre, relative to the squared radius, within which a point of a curved surface may
/// belong to a facet.
const IN_BALL: f64 = 1.21;

/// A root or a part of one.
#[derive(Clone, Debug)]
pub(super) struct SolvedElement {
    pub(super) outline: Outline,
    /// The ball around it.
    pub(super) center: DVec3,
    pub(super) radius: f64,
    /// The first part, and the number of parts.
    pub(super) first: u32,
    pub(super) parts: u32,
    /// The number of the patch, if there are no parts.
    pub(super) patch: u32,
}

/// Instance, primitive, side and part of a root, with its element.
pub(super) type RootPlace = (u32, u32, bool, u32, u32);

/// The balance of diffuse light in a world.
///
/// ```
/// use canaletto::glam::Vec3;
/// use canaletto::integrator::radiosity::RadiositySolution;
/// use canaletto::material::{Material, Phong};
/// use canaletto::math::Rgb;
/// use canaletto::scene::{Node, RadiositySettings, Scene};
/// use canaletto::shape::{Cuboid, Shape};
/// use canaletto::world::World;
///
/// // A closed room whose walls shine, and reflect half of the light. All light in it is twice what they emit.
/// let walls = Phong { kd: Rgb::gray(0.5), emission: Rgb::gray(1.0), ..Phong::default() };
/// let room = Shape::Box(Cuboid { min: Vec3::ZERO, max: Vec3::ONE });
/// let nodes = vec![Node::from(room).with_material(0)];
/// let world = World::build(Scene { materials: vec![Material::new("walls", walls)], nodes, ..Scene::default() })?;
/// let solution = RadiositySolution::solve(&world, &RadiositySettings::DEFAULT, &())?;
/// let inner = solution.patches().iter().filter(|patch| !patch.is_outer);
/// assert!(inner.clone().all(|patch| (patch.radiance().x - 2.0).abs() < 0.01));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct RadiositySolution {
    pub(super) patches: Vec<Patch>,
    pub(super) outlines: Vec<Outline>,
    pub(super) elements: Vec<SolvedElement>,
    pub(super) interpolation: Interpolation,
    pub(super) emitters: Emitters,
    /// The places of roots, in order.
    pub(super) roots: Vec<RootPlace>,
    /// The origin of the world's coordinates, and the number of its primitives.
    pub(super) origin: DVec3,
    pub(super) primitives: u64,
    /// The largest change by one more bounce, relative to all light.
    pub residual: f64,
    /// The number of links between nodes, or of pairs of patches.
    pub links: usize,
    /// Whether the limit of patches kept the error from being reached.
    pub limit_reached: bool,
}

impl RadiositySolution {
    /// The solution of a balance, with the radiance that the local pass has found, if it has links.
    pub(super) fn new(mesh: &PatchMesh, balanced: &Balanced) -> (RadiositySolution, Option<LocalRadiance>) {
        let Balanced { given: Given { lit, sky, closed }, light, residual, exchanges, gathering } = balanced;
        let [mut lit, mut sky] = [lit, sky].map(Vec::clone);
        let (mut patches, mut outlines, mut elements, mut roots) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut arriving = Vec::new();
        for (number, element) in mesh.elements.iter().enumerate() {
            let node = mesh.clusters.len() + number;
            let root = &mesh.roots[element.root as usize];
            if let Some(parent) = mesh.element_of(element.parent).map(|parent| mesh.node(parent) as usize) {
                let [above, sky_above] = [lit[parent], sky[parent]];
                lit[node] += above;
                sky[node] += sky_above;
            } else {
                let [first, second] = root.primitives;
                roots.push((root.instance, first, root.is_outer, root.part, number as u32));
                if second != first {
                    roots.push((root.instance, second, root.is_outer, root.part, number as u32));
                }
            }
            let patch = if element.is_leaf() { patches.len() as u32 } else { NONE };
            elements.push(SolvedElement {
                outline: element.outline,
                center: element.center,
                radius: element.radius,
                first: element.first_part,
                parts: element.parts,
                patch,
            });
            if element.is_leaf() {
                outlines.push(element.outline);
                let patch = Patch {
                    instance: root.instance,
                    primitive: root.primitive_at(element.center),
                    part: root.part,
                    is_outer: root.is_outer,
                    normal: root.normal,
                    center: element.center,
                    area: element.area,
                    reflectance: element.reflectance,
                    emission: element.emission,
                    direct: lit[node],
                    from_emitters: light.from_emitters[node],
                    indirect: (light.received[node] - light.from_emitters[node]).max(DVec3::ZERO) + sky[node],
                };
                arriving.push((patch.arriving(), sky[node]));
                patches.push(patch);
            }
        }
        roots.sort_unstable();
        let given: Vec<DVec3> = arriving.iter().map(|(light, sky): &(ArrivingLight, _)| light.direct + *sky).collect();
        let local = gathering.as_ref().map(|gathering| LocalPass::new(mesh, gathering, closed, light, &given));
        let interpolation = Interpolation::new(mesh, &arriving, local.as_ref());
        let solution = RadiositySolution {
            interpolation,
            emitters: Emitters::new(mesh),
            patches,
            outlines,
            elements,
            roots,
            origin: mesh.world.origin(),
            primitives: mesh.world.primitives(),
            residual: *residual,
            links: *exchanges,
            limit_reached: mesh.limit_reached,
        };
        (solution, local.map(LocalPass::into_radiance))
    }

    /// Whether the solution has the coordinates and the primitives of a world. If the fingerprints of both
    /// scenes are equal too, it is the world's solution.
    pub fn fits(&self, world: &World) -> bool {
        let has_surface = |emitter: &Emitter| {
            emitter.root.primitives.iter().all(|&primitive| world.has_primitive(emitter.root.instance, primitive))
        };
        self.origin == world.origin()
            && self.primitives == world.primitives()
            && self.emitters.polygons.iter().all(has_surface)
    }

    /// Checks that the solution can be that of a job in a world.
    pub(crate) fn check(&self, world: &World, job: &Job) -> Result<(), JobError> {
        match job.description().radiosity() {
            Some(_) if self.fits(world) => Ok(()),
            Some(_) => Err(JobError::Radiosity("the solution is one of another scene".into())),
            None => Err(JobError::Radiosity(format!("the integrator {} takes no solution", job.integrator.name()))),
        }
    }

    /// What the solution of a world falls short of, in words, with what helps. `settings` are those that it was solved
    /// with.
    pub fn warnings(&self, world: &World, settings: &RadiositySettings) -> Vec<String> {
        let RadiositySettings { max_patches, error, .. } = settings;
        let limit = self.limit_reached.then(|| {
            format!(
                "radiosity reached the limit of {max_patches} patches, so that light is less exact than the error of \
                 {error}; a larger max-patches or a larger error helps"
            )
        });
        let far = planes_without_patches(world).into_iter().map(|plane| {
            format!(
                "the plane \"{plane}\" gets no light by radiosity, since all other surfaces are far from it; \
                 a rectangle in its place helps"
            )
        });
        limit.into_iter().chain(far).collect()
    }

    /// All patches.
    pub fn patches(&self) -> &[Patch] {
        &self.patches
    }

    /// The corners of a patch, three or four, counter-clockwise when seen from its side.
    pub fn corners(&self, patch: usize) -> &[DVec3] {
        self.outlines[patch].corners()
    }

    /// The number of the patch at a point of a surface, on one of its sides. None where the surface has no patch, as
    /// inside solids.
    pub fn patch_at(&self, instance: u32, primitive: u32, part: u32, is_outer: bool, point: DVec3) -> Option<usize> {
        let element = self.leaf_at(instance, primitive, part, is_outer, point)?;
        Some(self.elements[element as usize].patch as usize)
    }

    /// The light at a point of a surface, interpolated between patches.
    pub fn light_at(
        &self,
        instance: u32,
        primitive: u32,
        part: u32,
        is_outer: bool,
        point: DVec3,
    ) -> Option<ArrivingLight> {
        let number = self.patch_at(instance, primitive, part, is_outer, point)?;
        Some(self.interpolated(number, point))
    }

    /// The light at a point of a patch.
    pub(super) fn interpolated(&self, number: usize, point: DVec3) -> ArrivingLight {
        self.interpolation.at(number, self.patches[number].center, point)
    }

    /// The light of a whole patch, at its centre.
    pub(crate) fn center_of(&self, number: usize) -> BlendedLight {
        let patch = &self.patches[number];
        BlendedLight { vertex: None, place: patch.center, weight: 1.0, light: patch.arriving() }
    }

    /// The light at the centre of a patch that interpolation takes.
    pub(crate) fn at_center(&self, number: usize) -> BlendedLight {
        let light = self.interpolation.centers[number];
        BlendedLight { vertex: None, place: self.patches[number].center, weight: 1.0, light }
    }

    /// The light at a vertex of the interpolation.
    pub(crate) fn at_vertex(&self, vertex: u32) -> BlendedLight {
        let Interpolation { points, light, .. } = &self.interpolation;
        let number = vertex as usize;
        BlendedLight { vertex: Some(vertex), place: points[number], weight: 1.0, light: light[number] }
    }

    /// The light whose mean [`RadiositySolution::light_at`] is at a point of a patch.
    pub(crate) fn corners_at(&self, number: usize, point: DVec3) -> Vec<BlendedLight> {
        let place = self.patches[number].center;
        self.interpolation.corners_at(number, place, point).map_or_else(|| vec![self.at_center(number)], Vec::from)
    }

    fn leaf_at(&self, instance: u32, primitive: u32, part: u32, is_outer: bool, point: DVec3) -> Option<u32> {
        let key = (instance, primitive, is_outer, part);
        let of = |root: &RootPlace| (root.0, root.1, root.2, root.3);
        let from = self.roots.partition_point(|root| of(root) < key);
        let count = self.roots[from..].partition_point(|root| of(root) == key);
        let roots = &self.roots[from..from + count];
        let outline = |root: &RootPlace| &self.elements[root.4 as usize].outline;
        // How far a point is outside an outline.
        let outside = |outline: &Outline| {
            let normal = outline.normal().unwrap_or(DVec3::Z);
            let height = (point - outline.center()).dot(normal);
            (height * height, -outline.depth(point - normal * height))
        };
        let element = match roots {
            [] => return None,
            [only] => only.4,
            several => {
                let distance = |root: &&RootPlace| {
                    let (square, out) = outside(outline(root));
                    square + out.max(0.0) * out.max(0.0)
                };
                // Few facets of a curved surface have the point in the ball around them.
                let is_near = |root: &&RootPlace| {
                    let SolvedElement { center, radius, .. } = &self.elements[root.4 as usize];
                    center.distance_squared(point) <= radius * radius * IN_BALL
                };
                let nearest = |a: &&_, b: &&_| distance(a).total_cmp(&distance(b));
                let near = several.iter().filter(is_near).min_by(nearest);
                near.or_else(|| several.iter().min_by(nearest))?.4
            }
        };
        Some(self.leaf_of(element, point))
    }

    /// The part of an element that is nearest to a point and has no parts itself.
    pub(super) fn leaf_of(&self, mut element: u32, point: DVec3) -> u32 {
        loop {
            let SolvedElement { outline, first, parts, .. } = &self.elements[element as usize];
            if *parts == 0 {
                return element;
            }
            element = first + outline.part_at(point) as u32;
        }
    }
}
