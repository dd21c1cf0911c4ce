//! Objects of a world that a light map has no triangles of.

use crate::integrator::radiosity::SolvedRoot;
use crate::world::{Hit, World};
use std::collections::{BTreeMap, BTreeSet};

/// The most objects of a world that are looked at.
const MOST_OBJECTS: u64 = 1 << 20;

/// Why objects have no triangles in a light map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum LeftOutReason {
    /// An infinite plane far from all other surfaces, which has no patches.
    FarPlane,
    /// No light arrives at any of its sides.
    Dark,
    /// Other bodies cover it, or it has no area.
    Covered,
}

/// Objects without triangles in a light map.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct LeftOut {
    /// The reason.
    pub reason: LeftOutReason,
    /// The names of the objects, in the order of the scene.
    pub names: Vec<String>,
}

/// The objects of a world of which no root is baked.
pub(super) fn left_out(world: &World, roots: &[SolvedRoot], baked: impl Iterator<Item = u32>) -> Vec<LeftOut> {
    let objects = world.largest_id().min(MOST_OBJECTS) as u32;
    let id = |root: &SolvedRoot| {
        let primitive = root.primitive_at(root.center());
        world.object_id(&Hit { instance: root.instance(), primitive, ..Hit::none(0.0, 0.0) })
    };
    let with_roots: BTreeSet<u32> = roots.iter().map(id).collect();
    let baked: BTreeSet<u32> = baked.map(|number| id(&roots[number as usize])).collect();
    let plane = |primitive: u32| world.object_id(&Hit { instance: Hit::UNBOUNDED, primitive, ..Hit::none(0.0, 0.0) });
    let planes: BTreeSet<u32> = (0..).zip(world.unbounded_shapes()).map(|(primitive, _)| plane(primitive)).collect();
    let mut left_out: BTreeMap<LeftOutReason, Vec<String>> = BTreeMap::new();
    for number in (1..=objects).filter(|number| !baked.contains(number)) {
        let Some(object) = world.object_with_id(number) else { continue };
        let reason = match (with_roots.contains(&number), planes.contains(&number)) {
            (true, _) => LeftOutReason::Dark,
            (false, true) => LeftOutReason::FarPlane,
            (false, false) => LeftOutReason::Covered,
        };
        let names = left_out.entry(reason).or_default();
        // Copies have the name of their object.
        if names.last() != Some(&object.name) {
            names.push(object.name.clone());
        }
    }
    left_out.into_iter().map(|(reason, names)| LeftOut { reason, names }).collect()
}
