//! Groups: instances under one hierarchy. The world is one group. A prototype that many instances repeat is another,
//! kept once for all of them; it may hold groups itself.
//!
//! A ray traverses a group in the group's own space. It is then tested with each geometry as if the group had been
//! dissolved: it is transformed by the product of all transforms around the geometry, if it enters the geometry's box
//! in the world. Both forms therefore give equal bits, as long as traversal culls nothing that would be hit.
//!
//! For this the ray in the group's space is inflated ([`InflatedRay`]). A hit in a geometry's space lies near the
//! geometry's box, up to the rounding of the ray and of the hit in that space. [`CullMargin`] bounds these errors in
//! the group's space.

use crate::math::{DRay, Transform};
use crate::world::build_error::hierarchy_error;
use crate::world::data::geometry::Geometry;
use crate::world::data::instance::{Instance, NONE};
use crate::world::data::motion::TransformChain;
use crate::world::{BuildError, World};
use canaletto_bvh::{Aabb, Bvh, InflatedRay, PreparedRay, Ray};
use glam::{DAffine3, DMat3, DVec3};

/// Instances in one space, under one hierarchy.
#[derive(Debug)]
pub(in crate::world) struct Group {
    pub(in crate::world) instances: Vec<Instance>,
    /// For each instance, the number of geometries before it, those of groups counted. Empty if no instance is a group.
    firsts: Vec<u32>,
    /// The number of geometries, those of groups counted.
    pub(in crate::world) leaves: u32,
    /// The number of primitives, those of groups counted.
    pub(in crate::world) primitives: u64,
    /// The hierarchy over the bounds of `instances`.
    pub(in crate::world) tree: Bvh,
    /// These bounds in the order of the tree's slots. A leaf may hold several instances, and a ray into an instance's
    /// space costs more than a box test.
    pub(in crate::world) slot_bounds: Vec<Aabb>,
    cull_margin: CullMargin,
}

/// The uncertainty of a ray in a group's space, from the rounding in the spaces of all members. It is a [share](SHARE)
/// of the sum of `reach` and of `stretch` times the length of the ray's origin.
#[derive(Clone, Copy, Debug)]
struct CullMargin {
    /// The factor by which an error may grow on the path to the space where it arises and back; at least 1.
    stretch: f64,
    reach: f64,
}

/// The share. Rays in a geometry's space are rounded to half a unit in the last place, 2⁻²⁴, in origin and direction.
/// Hits are confined to boxes up to [`canaletto_bvh`]'s slack in t of 2⁻²⁰. Box tests in the group's space round a few
/// more times. The sum is less than 1.7 × 2⁻²⁰.
const SHARE: f64 = 1.0 / (1 << 19) as f64;

/// The share for the transforms' roundings in `f64`, relative to their terms, with room for sums that cancel.
const FINE_SHARE: f64 = 1.0 / (1u64 << 40) as f64;

/// The extents that groups' spaces may have. They are so far from the limits of `f32` that no product in a box test
/// loses bits.
const EXTENTS: std::ops::RangeInclusive<f64> = 1e-30..=1e30;

/// The tables that groups refer to.
#[derive(Clone, Copy)]
pub(in crate::world) struct BuildTables<'a> {
    pub(in crate::world) geometries: &'a [Geometry],
    pub(in crate::world) groups: &'a [Group],
    pub(in crate::world) chains: &'a [TransformChain],
}

impl BuildTables<'_> {
    /// The bounds of an instance in the space that it is placed in.
    pub(in crate::world) fn bounds(&self, instance: &Instance) -> Aabb {
        let local = match instance.group {
            NONE => self.geometries[instance.geometry as usize].bounds(),
            group => self.groups[group as usize].tree.bounds(),
        };
        instance.bounds(self.chains, local)
    }
}

impl Group {
    /// The group of these instances, which have these bounds.
    ///
    /// # Errors
    /// If there are more than [`World::MAX_COPIES`] geometries; the error contains the group's `name`. If the hierarchy
    /// can't be built.
    pub(in crate::world) fn new(
        instances: Vec<Instance>,
        bounds: &[Aabb],
        name: &str,
        tables: BuildTables,
    ) -> Result<Group, BuildError> {
        let mut firsts = Vec::new();
        let (mut leaves, mut primitives) = (0u64, 0u64);
        let nested = instances.iter().any(|instance| instance.group != NONE);
        for instance in &instances {
            if nested {
                firsts.push(leaves as u32);
            }
            if let Some(group) = tables.groups.get(instance.group as usize) {
                leaves += u64::from(group.leaves);
                primitives = primitives.saturating_add(group.primitives);
            } else {
                leaves += 1;
                primitives = primitives.saturating_add(tables.geometries[instance.geometry as usize].len() as u64);
            }
            if leaves > u64::from(World::MAX_COPIES) {
                return Err(BuildError::TooManyCopies(name.into()));
            }
        }
        let tree = Bvh::build(bounds).map_err(|e| hierarchy_error(name, &e))?;
        let slot_bounds = tree.order().iter().map(|&index| bounds[index as usize]).collect();
        let cull_margin = CullMargin { stretch: 1.0, reach: 0.0 };
        Ok(Group { instances, firsts, leaves: leaves as u32, primitives, tree, slot_bounds, cull_margin })
    }

    /// The group of a prototype, whose space isn't the world's. The inner `Err` returns the instances if their
    /// transforms are too extreme for rays in that space.
    pub(in crate::world) fn of_prototype(
        instances: Vec<Instance>,
        name: &str,
        tables: BuildTables,
    ) -> Result<Result<Group, Vec<Instance>>, BuildError> {
        let bounds: Vec<Aabb> = instances.iter().map(|instance| tables.bounds(instance)).collect();
        if instances.is_empty() || bounds.iter().any(|b| b.is_empty() || !b.is_finite()) {
            return Ok(Err(instances));
        }
        let cull_margin = instances
            .iter()
            .map(|instance| CullMargin::outside_of(instance, tables))
            .fold(CullMargin { stretch: 1.0, reach: bounds.iter().map(extent).fold(0.0, f64::max) }, |all, one| {
                CullMargin { stretch: all.stretch.max(one.stretch), reach: all.reach.max(one.reach) }
            });
        if !(EXTENTS.contains(&cull_margin.reach) && EXTENTS.contains(&cull_margin.stretch)) {
            return Ok(Err(instances));
        }
        Group::new(instances, &bounds, name, tables).map(|group| Ok(Group { cull_margin, ..group }))
    }

    /// The number of an instance; for a group, that of its first geometry.
    #[inline]
    pub(in crate::world) fn first(&self, index: u32) -> u32 {
        self.firsts.get(index as usize).copied().unwrap_or(index)
    }

    /// Whether each instance is one geometry.
    #[inline]
    pub(in crate::world) fn is_flat(&self) -> bool {
        self.firsts.is_empty()
    }

    /// The index of the instance that contains the geometry with this number.
    fn index_of(&self, number: u32) -> u32 {
        if self.is_flat() { number } else { self.firsts.partition_point(|&first| first <= number) as u32 - 1 }
    }

    /// The geometry with this number, placed in the group's space.
    pub(in crate::world) fn resolve(&self, number: u32, groups: &[Group]) -> Instance {
        let index = self.index_of(number);
        let instance = &self.instances[index as usize];
        match groups.get(instance.group as usize) {
            None => *instance,
            Some(group) => {
                let mut placed = group.resolve(number - self.first(index), groups);
                placed.enclose(instance);
                placed
            }
        }
    }

    pub(in crate::world) fn bytes(&self) -> usize {
        self.instances.len() * (size_of::<Instance>() + size_of::<Aabb>())
            + self.firsts.len() * 4
            + self.tree.statistics().bytes
    }
}

/// The largest distance of a point in a box from the origin.
fn extent(bounds: &Aabb) -> f64 {
    bounds.min.abs().max(bounds.max.abs()).as_dvec3().length()
}

impl CullMargin {
    /// The margin for an instance's content, in the space that the instance is placed in.
    fn outside_of(instance: &Instance, tables: BuildTables) -> CullMargin {
        let inner = match tables.groups.get(instance.group as usize) {
            Some(group) => group.cull_margin,
            None => CullMargin { stretch: 1.0, reach: extent(&tables.geometries[instance.geometry as usize].bounds()) },
        };
        let Some(t) = &instance.to_world else { return inner };
        let [there, back] = growths(t);
        let stretch = there * inner.stretch * back;
        CullMargin { stretch, reach: stretch * t.matrix().translation.length() + there * inner.reach }
    }
}

/// Bounds of the growth of lengths, out of a space and into it.
fn growths(t: &Transform) -> [f64; 2] {
    if let Some(scale) = t.uniform_scale() {
        return [scale, 1.0 / scale].map(|s| s * (1.0 + 1e-9));
    }
    [t.matrix().matrix3, t.inverse().matrix().matrix3].map(spectral_bound)
}

/// An upper bound of the largest singular value.
fn spectral_bound(m: DMat3) -> f64 {
    let columns = [m.x_axis, m.y_axis, m.z_axis];
    let frobenius = columns.iter().map(|c| c.length_squared()).sum::<f64>();
    let one = columns.iter().map(|c| c.abs().element_sum()).fold(0.0, f64::max);
    let infinity = columns.iter().map(|c| c.abs()).sum::<DVec3>().max_element();
    frobenius.min(one * infinity).sqrt()
}

/// Whether a transform or its inverse may be the identity, up to rounding.
#[inline]
fn is_near_identity(t: &DAffine3) -> bool {
    let near = |a: DVec3, b: DVec3| (a - b).abs().max_element() < 0.01;
    near(t.matrix3.x_axis, DVec3::X) && near(t.matrix3.y_axis, DVec3::Y) && near(t.matrix3.z_axis, DVec3::Z)
}

/// The path to a group: the instances that lead to it.
#[derive(Clone, Copy)]
pub(in crate::world) struct InstancePath<'a> {
    outer: Option<&'a InstancePath<'a>>,
    instance: &'a Instance,
    pub(in crate::world) group: &'a Group,
    /// The number of the group's first geometry.
    first: u32,
    /// The transform from the world's space to the group's.
    inwards: DAffine3,
}

impl<'a> InstancePath<'a> {
    /// The path to the group of an instance whose first geometry has this number. `outer` is the path to the group that
    /// contains the instance, if that isn't the world.
    pub(in crate::world) fn to(
        instance: &'a Instance,
        first: u32,
        outer: Option<&'a InstancePath<'a>>,
        groups: &'a [Group],
    ) -> InstancePath<'a> {
        let last = instance.to_world.as_ref().map_or(&DAffine3::IDENTITY, Transform::back);
        let inwards = outer.map_or(*last, |outer| *last * outer.inwards);
        InstancePath { outer, instance, group: &groups[instance.group as usize], first, inwards }
    }

    /// The number of an instance in the group; for a group, that of its first geometry.
    #[inline]
    pub(in crate::world) fn number(&self, index: u32) -> u32 {
        self.first + self.group.first(index)
    }

    /// An instance of a geometry in the group, placed in the world.
    #[inline]
    pub(in crate::world) fn placed(&self, member: &Instance) -> Instance {
        let mut placed = *member;
        let mut next = Some(self);
        while let Some(way) = next {
            placed.enclose(way.instance);
            next = way.outer;
        }
        placed
    }

    /// A ray of the world in the space of a geometry's instance in the group. It has the bits of a ray through
    /// [`InstancePath::placed`], but the outward transform isn't computed. `None` if the product of the transforms may
    /// be the identity, which `placed` leaves out.
    pub(in crate::world) fn local_ray(&self, member: &Instance, ray: &Ray) -> Option<PreparedRay> {
        let mut inwards = member.to_world.as_ref().map(|t| *t.back());
        let mut next = Some(self);
        while let Some(way) = next {
            let outer = way.instance.to_world.as_ref()?.back();
            let all = inwards.map_or(*outer, |inwards| inwards * *outer);
            if is_near_identity(&all) {
                return None;
            }
            inwards = Some(all);
            next = way.outer;
        }
        let (inwards, DRay { origin, direction }) = (inwards?, DRay::from(ray));
        let line = DRay { origin: inwards.transform_point3(origin), direction: inwards.transform_vector3(direction) };
        Some(line.rounded().prepare())
    }

    /// A ray of the world in the group's space.
    pub(in crate::world) fn group_ray(&self, ray: &Ray) -> GroupRay {
        let inflated = self
            .inflated(ray)
            .map(|WideRay { ray, margin, t_scale }| GroupRay { ray: InflatedRay::new(&ray, margin), t_scale });
        inflated.unwrap_or_else(GroupRay::everywhere)
    }

    /// A ray of the world in the group's space. `None` if `f32` can't represent it well enough.
    pub(in crate::world) fn inflated(&self, ray: &Ray) -> Option<WideRay> {
        WideRay::new(ray, &self.inwards, self.group.cull_margin)
    }
}

/// A ray of the world in a group's space, with the margin by which it misses no box that it should enter.
pub(in crate::world) struct WideRay {
    pub(in crate::world) ray: Ray,
    pub(in crate::world) margin: f32,
    /// As in [`GroupRay`].
    pub(in crate::world) t_scale: f64,
}

/// A ray of the world in a group's space, for culling.
#[derive(Clone, Copy)]
pub(in crate::world) struct GroupRay {
    ray: InflatedRay,
    /// The factor from the world ray's t to this ray's t. It is a power of two, such that the direction's longest
    /// component lies in 1..2.
    t_scale: f64,
}

impl WideRay {
    fn new(ray: &Ray, inwards: &DAffine3, cull_margin: CullMargin) -> Option<WideRay> {
        let far = ray.origin.as_dvec3();
        let (origin, direction) = (inwards.transform_point3(far), inwards.matrix3 * ray.direction.as_dvec3());
        // The next lower power of two.
        let t_scale = f64::from_bits(direction.abs().max_element().to_bits() & f64::INFINITY.to_bits());
        let m = inwards.matrix3;
        let terms = m.x_axis.abs() * far.x.abs() + m.y_axis.abs() * far.y.abs() + m.z_axis.abs() * far.z.abs();
        let margin = SHARE * (cull_margin.stretch * origin.length() + cull_margin.reach)
            + FINE_SHARE * cull_margin.stretch * (terms + inwards.translation.abs()).length();
        let known = origin.is_finite() && (1e-200..=1e200).contains(&t_scale) && margin <= 1e30;
        known.then(|| WideRay {
            ray: Ray::new(origin.as_vec3(), (direction * (1.0 / t_scale)).as_vec3()),
            margin: margin as f32,
            t_scale,
        })
    }
}

/// The t of a ray in a group's space for a t of the world's ray. It is greater than 0 if that is; −∞ stays −∞.
#[inline]
pub(in crate::world) fn t_in_group(t: f32, t_scale: f64) -> f32 {
    if t > 0.0 { ((f64::from(t) * t_scale) as f32).max(f32::MIN_POSITIVE) } else { f32::NEG_INFINITY }
}

impl GroupRay {
    /// A ray that enters all boxes of a group.
    fn everywhere() -> GroupRay {
        let ray = Ray::new(glam::Vec3::ZERO, glam::Vec3::ONE);
        GroupRay { ray: InflatedRay::new(&ray, 1e34), t_scale: f64::INFINITY }
    }

    /// This ray's t for a t of the world's ray; greater than 0.
    #[inline]
    fn at(&self, t: f32) -> f32 {
        t_in_group(t, self.t_scale)
    }
}

/// The most instances that are tested one by one, without the tree. A chain of nested groups then takes little of the
/// stack.
const MAX_LISTED: usize = 4;

impl Group {
    /// Calls `visit` for the instances that the ray may hit within (0, t_max], roughly from near to far. `visit`
    /// returns the new t_max.
    pub(in crate::world) fn intersect(&self, group_ray: &GroupRay, t_max: f32, mut visit: impl FnMut(u32) -> f32) {
        let Group { tree, slot_bounds, .. } = self;
        let mut limit = group_ray.at(t_max);
        if slot_bounds.len() <= MAX_LISTED {
            for (bounds, &index) in slot_bounds.iter().zip(tree.order()) {
                if group_ray.ray.enters(bounds, limit) {
                    limit = group_ray.at(visit(index));
                }
            }
            return;
        }
        tree.intersect_inflated(&group_ray.ray, limit, |leaf, limit| {
            for slot in leaf.slots() {
                if leaf.count() == 1 || group_ray.ray.enters(&slot_bounds[slot as usize], *limit) {
                    *limit = group_ray.at(visit(tree.order()[slot as usize]));
                }
            }
        });
    }

    /// Calls `visit` for the instances that the ray may hit within (0, t_max], in no order, until `visit` returns true.
    /// Returns whether it did.
    pub(in crate::world) fn occluded(
        &self,
        group_ray: &GroupRay,
        t_max: f32,
        mut visit: impl FnMut(u32) -> bool,
    ) -> bool {
        let Group { tree, slot_bounds, .. } = self;
        let limit = group_ray.at(t_max);
        if slot_bounds.len() <= MAX_LISTED {
            let mut all = slot_bounds.iter().zip(tree.order());
            return all.any(|(bounds, &index)| group_ray.ray.enters(bounds, limit) && visit(index));
        }
        tree.occluded_inflated(&group_ray.ray, limit, |leaf| {
            leaf.slots().any(|slot| {
                (leaf.count() == 1 || group_ray.ray.enters(&slot_bounds[slot as usize], limit))
                    && visit(tree.order()[slot as usize])
            })
        })
    }
}
