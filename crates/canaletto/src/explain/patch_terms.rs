//! The terms of a patch's light, grouped by what they come from.

use super::patch::{
    CornerNode, LightSum, LinkNode, OthersNode, PatchNode, PlaceNode, RadiosityNode, SourceKind, SourceNode,
};
use super::record::{in_the_scene, name_of_light};
use super::tree::{Side, has_primitives};
use crate::integrator::radiosity::RadiositySolution;
use crate::integrator::{LightSource, PatchLight, Transport};
use crate::world::{Hit, World};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// The most sources of a patch that are listed.
const MOST_SOURCES: usize = 8;

/// The most links of a source that are listed.
const MOST_LINKS: usize = 3;

/// The most objects of a cluster that are named.
const MOST_NAMES: usize = 3;

/// What lights are grouped by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Group {
    Light(u32),
    Environment,
    /// The number of an object, and of a material of it.
    Object(u32, u32),
    Cluster(u32),
    Itself,
}

/// A patch with what lights it.
pub(super) fn patch_node(
    world: &World,
    solution: &RadiositySolution,
    transport: &Transport,
    number: usize,
) -> PatchNode {
    let patch = &solution.patches()[number];
    let hit =
        Hit { t: 0.0, instance: patch.instance, primitive: patch.primitive, part: patch.part, uv: [0.0; 2], time: 0.0 };
    let object = world.object(&hit);
    let terms = transport.of_patch(number);
    let sum = |terms: &[PatchLight], light: DVec3| light_sum(world, transport, terms, light);
    PatchNode {
        number: number as u32,
        object: object.name.clone(),
        object_id: world.object_id(&hit),
        kind: object.kind,
        primitive: if has_primitives(object.kind) { hit.primitive } else { 0 },
        material: world.material(&hit).name.clone(),
        side: if patch.is_outer { Side::Outside } else { Side::Inside },
        corners: solution.corners(number).iter().map(|&corner| in_the_scene(world, corner.as_vec3())).collect(),
        center: in_the_scene(world, patch.center.as_vec3()),
        area: patch.area,
        reflectance: patch.reflectance.to_array(),
        emission: patch.emission.to_array(),
        direct: sum(&terms.direct, patch.direct),
        from_emitters: sum(&terms.from_emitters, patch.from_emitters),
        indirect: sum(&terms.indirect, patch.indirect),
        radiance: patch.radiance().to_array(),
    }
}

/// A place whose light is interpolated, with what lights it: a vertex, or the centre of a patch.
pub(super) fn place_node(
    world: &World,
    solution: &RadiositySolution,
    transport: &Transport,
    place: BlendedPlace,
) -> PlaceNode {
    let (terms, found, number) = match place {
        BlendedPlace::Center(patch) => (transport.at_center(patch as usize), solution.at_center(patch as usize), patch),
        BlendedPlace::Vertex(vertex) => (transport.at_vertex(solution, vertex), solution.at_vertex(vertex), vertex),
    };
    let is_vertex = matches!(place, BlendedPlace::Vertex(_));
    let sum = |terms: &[PatchLight], light: DVec3| light_sum(world, transport, terms, light);
    PlaceNode {
        patch: (!is_vertex).then_some(number),
        vertex: is_vertex.then_some(number),
        point: in_the_scene(world, found.place.as_vec3()),
        direct: sum(&terms.direct, found.light.direct),
        from_emitters: sum(&terms.from_emitters, found.light.from_emitters),
        indirect: sum(&terms.indirect, found.light.indirect),
    }
}

/// A place whose light is blended with that of others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum BlendedPlace {
    /// The centre of a patch.
    Center(u32),
    /// A vertex of a solution's interpolation.
    Vertex(u32),
}

impl BlendedPlace {
    /// The place of a corner in the light of a patch; none if that light is the same on all of the patch.
    pub(super) fn of(light: &RadiosityNode, corner: &CornerNode) -> Option<BlendedPlace> {
        match corner.vertex {
            Some(vertex) => Some(BlendedPlace::Vertex(vertex)),
            None => light.is_interpolated.then_some(BlendedPlace::Center(light.patch)),
        }
    }
}

/// The sum of light that the solver found, as a sum over groups of terms.
fn light_sum(world: &World, transport: &Transport, terms: &[PatchLight], found: DVec3) -> LightSum {
    let mut groups: BTreeMap<Group, Vec<&PatchLight>> = BTreeMap::new();
    for term in terms {
        groups.entry(group(world, transport, term)).or_default().push(term);
    }
    let mut sources: Vec<SourceNode> =
        groups.into_iter().map(|(group, terms)| source(world, transport, group, terms)).collect();
    sources.sort_by(|a, b| size(b.light).total_cmp(&size(a.light)));
    let others = split_off(&mut sources, MOST_SOURCES, |source| source.light);
    let mut sum = LightSum { sources, others, rounding: [0.0; 3], light: found.to_array() };
    sum.rounding = (found - sum.sum_without_rounding()).to_array();
    sum
}

fn group(world: &World, transport: &Transport, term: &PatchLight) -> Group {
    match term.source {
        LightSource::Light(light) => Group::Light(light),
        LightSource::Environment => Group::Environment,
        LightSource::Itself(_) => Group::Itself,
        LightSource::Node(node) => match transport.surface_of(node) {
            Some((hit, material)) => Group::Object(world.object_id(&hit), material),
            None => Group::Cluster(node),
        },
    }
}

fn source(world: &World, transport: &Transport, group: Group, mut terms: Vec<&PatchLight>) -> SourceNode {
    let named = |object: u32| world.object_with_id(object).map_or_else(String::new, |object| object.name.clone());
    let (kind, name) = match group {
        Group::Light(light) => (SourceKind::Light, name_of_light(world, light)),
        Group::Environment => (SourceKind::Environment, "environment".to_owned()),
        Group::Object(object, _) => (SourceKind::Object, named(object)),
        Group::Cluster(node) => (SourceKind::Cluster, cluster_name(world, transport, node)),
        Group::Itself => (SourceKind::Itself, "itself".to_owned()),
    };
    let (object_id, material) = match group {
        Group::Object(object, material) => (Some(object), Some(world.materials()[material as usize].name.clone())),
        _ => (None, None),
    };
    let mut node =
        SourceNode { kind, name, object_id, material, link_count: 0, links: Vec::new(), others: None, light: [0.0; 3] };
    if matches!(group, Group::Light(_) | Group::Environment) {
        node.light = terms.iter().fold(DVec3::ZERO, |sum, term| sum + term.light).to_array();
        return node;
    }
    terms.sort_by(|a, b| size(b.light.to_array()).total_cmp(&size(a.light.to_array())));
    node.link_count = terms.len();
    node.others = split_off(&mut terms, MOST_LINKS, |term| term.light.to_array());
    let link = |term: &PatchLight| match term.source {
        LightSource::Node(node) | LightSource::Itself(node) => Some(link(world, transport, node, term)),
        LightSource::Light(_) | LightSource::Environment => None,
    };
    node.links = terms.into_iter().filter_map(link).collect();
    node.light = node.sum().to_array();
    node
}

fn link(world: &World, transport: &Transport, node: u32, term: &PatchLight) -> LinkNode {
    let (center, area) = transport.place_of(node);
    LinkNode {
        center: in_the_scene(world, center.as_vec3()),
        area,
        receiver_area: term.receiver_area,
        form_factor: term.form_factor,
        radiance: term.radiance.to_array(),
        light: term.light.to_array(),
    }
}

/// Such as "cluster of 12 surfaces: box, lamp".
fn cluster_name(world: &World, transport: &Transport, node: u32) -> String {
    let mut names: Vec<&str> = Vec::new();
    let (mut surfaces, mut objects) = (0, BTreeSet::new());
    for hit in transport.members_of(node) {
        surfaces += 1;
        if objects.insert(world.object_id(&hit)) {
            names.push(&world.object(&hit).name);
        }
    }
    let more = names.len().saturating_sub(MOST_NAMES);
    names.truncate(MOST_NAMES);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("cluster of {surfaces} surfaces: {}{more}", names.join(", "))
}

/// What light is sorted by.
fn size(light: [f64; 3]) -> f64 {
    DVec3::from(light).abs().element_sum()
}

/// Splits off all items but the first ones, and adds up their light.
fn split_off<T>(items: &mut Vec<T>, most: usize, light: impl Fn(&T) -> [f64; 3]) -> Option<OthersNode> {
    // One item takes no more room than the sum of one.
    let others = items.split_off(if items.len() > most + 1 { most } else { items.len() });
    let sum = others.iter().fold(DVec3::ZERO, |sum, item| sum + DVec3::from(light(item)));
    (!others.is_empty()).then(|| OthersNode { count: others.len(), light: sum.to_array() })
}
