//! The numbers of accessors (glTF 2.0, 3.6.2.5, 3.7.2.1, 3.7.3 and 3.11), up to a number of them.

use super::accessors::Format;
use super::animations::is_cubic;
use super::broken::Broken;
use super::json::{Value, list, numbers, whole};
use super::place::Place;
use crate::import::gltf::accessor::Accessors;
use crate::import::gltf::fault::Fault;
use crate::import::gltf::schema::Index;
use std::collections::{BTreeMap, HashMap, HashSet};

/// The most numbers that are checked. What follows in larger files isn't: the check would take a part of the time of
/// reading them.
const MOST_NUMBERS: usize = 1 << 21;
/// How far the length of a normal or a tangent may be from 1, as in Khronos' validator.
const UNIT_TOLERANCE: f64 = 0.00674;
/// How far the length of a rotation may be from 1.
const ROTATION_TOLERANCE: f64 = 0.00769;
/// How far the sum of a vertex's weights may be from 1, for each of them.
const WEIGHT_TOLERANCE: f64 = 2e-7;
/// How far a bound may be from the number that it bounds, as a share of it.
const BOUND_TOLERANCE: f64 = 1e-6;

/// What an accessor is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Role {
    /// The indices of this many vertices.
    Indices(usize),
    Normals,
    Tangents,
    Colors,
    /// The joints of a skin with this many.
    Joints(usize),
    Matrices,
    Times,
    Rotations {
        is_cubic: bool,
    },
}

/// The roles of each accessor with their places.
type Roles = BTreeMap<usize, Vec<(Role, String)>>;

pub(super) fn check(json: &Value, accessors: &Accessors, broken: &mut Broken) {
    let roles = roles(json);
    let mut reader = Reader { accessors, left: MOST_NUMBERS };
    let place = Place::Root.key("accessors");
    for (i, accessor) in list(json, "accessors").iter().enumerate() {
        let Some(values) = reader.read(json, i, broken) else { continue };
        let format = Format::of(accessor);
        bounds(accessor, &format, &values, &place.item(i), broken);
        for (role, place) in roles.get(&i).into_iter().flatten() {
            if let Some(wrong) = role.wrong(&values, &format) {
                broken.fault(Fault::new(wrong).at(place));
            }
        }
    }
    weights(json, &mut reader, broken);
}

struct Reader<'r, 'a> {
    accessors: &'r Accessors<'a>,
    /// The numbers that may still be read.
    left: usize,
}

impl Reader<'_, '_> {
    /// The numbers of an accessor as they stand in the file. None if there are none, or too many.
    fn read(&mut self, json: &Value, index: usize, broken: &mut Broken) -> Option<Vec<f64>> {
        let accessor = list(json, "accessors").get(index)?;
        let buffers = self.accessors.buffers;
        let view = whole(accessor.get("bufferView"));
        let has_bytes = |view: usize| buffers.has_bytes(view as Index);
        let is_sparse = accessor.get("sparse").is_some();
        if !view.map_or(is_sparse, has_bytes) {
            return None;
        }
        let count = whole(accessor.get("count"))?.saturating_mul(Format::of(accessor).width());
        if count > self.left {
            return None;
        }
        self.left -= count;
        match self.accessors.stored(index as Index) {
            Ok(values) => Some(values),
            Err(fault) => {
                broken.fault_if_first(fault);
                None
            }
        }
    }
}

/// Checks that all numbers are finite, and that they are within the bounds that the accessor says.
fn bounds(accessor: &Value, format: &Format, values: &[f64], place: &Place, broken: &mut Broken) {
    let width = format.width().max(1);
    if let Some(i) = values.iter().position(|v| !v.is_finite()) {
        let message = format!("element {} holds {}; each number must be finite", i / width, values[i]);
        return broken.tell(place, message);
    }
    let said = ["min", "max"].map(|name| numbers(accessor.get(name)).filter(|said| said.len() == width));
    if said.iter().all(Option::is_none) {
        return;
    }
    let found = match width {
        1 => ends::<1>(values),
        2 => ends::<2>(values),
        3 => ends::<3>(values),
        4 => ends::<4>(values),
        9 => ends::<9>(values),
        _ => ends::<16>(values),
    };
    for ((said, found), [name, what]) in said.iter().zip(&found).zip([["min", "least"], ["max", "greatest"]]) {
        let Some(said) = said else { continue };
        let differs =
            |(said, found): (&f64, &f64)| (said - found).abs() > BOUND_TOLERANCE * said.abs().max(found.abs());
        if said.iter().zip(found).any(differs) {
            let message = format!("is {}, but the {what} of its elements is {}", words(said), words(found));
            broken.tell(&place.key(name), message);
        }
    }
}

/// The least and the greatest numbers of elements.
fn ends<const N: usize>(values: &[f64]) -> [Vec<f64>; 2] {
    let (mut low, mut high) = ([f64::INFINITY; N], [f64::NEG_INFINITY; N]);
    for element in values.as_chunks::<N>().0 {
        for (i, v) in element.iter().enumerate() {
            low[i] = if *v < low[i] { *v } else { low[i] };
            high[i] = if *v > high[i] { *v } else { high[i] };
        }
    }
    [low.to_vec(), high.to_vec()]
}

fn words(numbers: &[f64]) -> String {
    numbers.iter().map(|v| (*v as f32).to_string()).collect::<Vec<_>>().join(" ")
}

/// What the accessors of a document are for.
fn roles(json: &Value) -> Roles {
    let mut roles = Roles::new();
    let mut known = HashSet::new();
    let mut add = |accessor: Option<&Value>, role: Role, place: &Place| {
        if let Some(accessor) = whole(accessor).filter(|accessor| known.insert((*accessor, role))) {
            roles.entry(accessor).or_default().push((role, place.to_string()));
        }
    };
    let joints = joints_of_meshes(json);
    let meshes = Place::Root.key("meshes");
    for (i, mesh) in list(json, "meshes").iter().enumerate() {
        let place = meshes.item(i);
        let lists = place.key("primitives");
        for (k, primitive) in list(mesh, "primitives").iter().enumerate() {
            let place = lists.item(k);
            let Some(attributes) = primitive.get("attributes").and_then(Value::as_object) else { continue };
            let positions = whole(attributes.get("POSITION")).and_then(|index| list(json, "accessors").get(index));
            if let Some(count) = positions.and_then(|positions| whole(positions.get("count"))) {
                add(primitive.get("indices"), Role::Indices(count), &place.key("indices"));
            }
            let own = place.key("attributes");
            for (name, index) in attributes.iter() {
                let role = match name {
                    "NORMAL" => Some(Role::Normals),
                    "TANGENT" => Some(Role::Tangents),
                    _ if name.starts_with("COLOR_") => Some(Role::Colors),
                    _ if name.starts_with("JOINTS_") => joints.get(&i).map(|count| Role::Joints(*count)),
                    _ => None,
                };
                if let Some(role) = role {
                    add(Some(index), role, &own.key(name));
                }
            }
        }
    }
    let skins = Place::Root.key("skins");
    for (i, skin) in list(json, "skins").iter().enumerate() {
        add(skin.get("inverseBindMatrices"), Role::Matrices, &skins.item(i).key("inverseBindMatrices"));
    }
    let animations = Place::Root.key("animations");
    for (i, animation) in list(json, "animations").iter().enumerate() {
        let place = animations.item(i);
        let samplers = list(animation, "samplers");
        let lists = place.key("samplers");
        for (k, sampler) in samplers.iter().enumerate() {
            add(sampler.get("input"), Role::Times, &lists.item(k).key("input"));
        }
        let lists = place.key("channels");
        for (k, channel) in list(animation, "channels").iter().enumerate() {
            let is_turn = channel
                .get("target")
                .is_some_and(|target| target.get("path").is_some_and(|p| p.as_str() == Some("rotation")));
            let sampler = whole(channel.get("sampler")).and_then(|index| samplers.get(index));
            if let Some(sampler) = sampler.filter(|_| is_turn) {
                let role = Role::Rotations { is_cubic: is_cubic(sampler) };
                add(sampler.get("output"), role, &lists.item(k).key("sampler"));
            }
        }
    }
    roles
}

/// The joints of the smallest skin of each mesh with a skin.
fn joints_of_meshes(json: &Value) -> HashMap<usize, usize> {
    let skins = list(json, "skins");
    let mut joints = HashMap::new();
    for node in list(json, "nodes") {
        let skin = whole(node.get("skin")).and_then(|skin| skins.get(skin));
        if let Some((mesh, skin)) = whole(node.get("mesh")).zip(skin) {
            let count = list(skin, "joints").len();
            joints.entry(mesh).and_modify(|least: &mut usize| *least = count.min(*least)).or_insert(count);
        }
    }
    joints
}

impl Role {
    /// What is wrong with the numbers of an accessor: the first element that breaks a rule.
    fn wrong(self, values: &[f64], format: &Format) -> Option<String> {
        let width = format.width();
        let unit = format.most();
        let length = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>().sqrt() / unit;
        match (self, width) {
            (Role::Indices(count), 1) => {
                let restart = unit;
                let (i, v) = find(values, width, |v| v[0] >= count as f64 || v[0] == restart)?;
                if v[0] == restart {
                    return Some(format!("index {i} is {restart}, which would start a new primitive"));
                }
                Some(format!("index {i} is vertex {}, but there are {count}, counted from 0", v[0]))
            }
            (Role::Normals, 3) => {
                let (i, v) = find(values, width, |v| (length(v) - 1.0).abs() > UNIT_TOLERANCE)?;
                Some(format!("normal {i} has length {}; it must be 1", short(length(v))))
            }
            (Role::Tangents, 4) => {
                if let Some((i, v)) = find(values, width, |v| v[3].abs() != unit) {
                    return Some(format!("the last number of tangent {i} is {}; it must be 1 or -1", v[3] / unit));
                }
                let (i, v) = find(values, width, |v| (length(&v[..3]) - 1.0).abs() > UNIT_TOLERANCE)?;
                Some(format!("tangent {i} has length {}; it must be 1", short(length(&v[..3]))))
            }
            (Role::Colors, _) if format.has_component("FLOAT") => {
                let (i, v) = find(values, width, |v| v.iter().any(|v| !(0.0..=1.0).contains(v)))?;
                Some(format!("colour {i} is {}; its numbers must be between 0 and 1", words(v)))
            }
            (Role::Joints(count), _) => {
                let (i, v) = find(values, width, |v| v.iter().any(|v| *v >= count as f64))?;
                let joint = v.iter().copied().fold(0.0, f64::max);
                Some(format!("vertex {i} names joint {joint}, but the skin has {count}"))
            }
            (Role::Matrices, 16) => {
                let (i, _) = find(values, width, |m| [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0])?;
                Some(format!("the last row of matrix {i} isn't 0 0 0 1"))
            }
            (Role::Times, 1) => {
                if let Some((i, v)) = find(values, width, |v| v[0] < 0.0) {
                    return Some(format!("key {i} is at {} seconds; times are 0 or more", v[0]));
                }
                let i = values.windows(2).position(|pair| pair[1] <= pair[0])? + 1;
                Some(format!("key {i} is at {} seconds, not later than the key before it", values[i]))
            }
            (Role::Rotations { is_cubic }, 4) => {
                // The keys of cubic splines lie between two tangents.
                let [step, first] = if is_cubic { [3, 1] } else { [1, 0] };
                let mut keys = values.chunks_exact(4).skip(first).step_by(step).enumerate();
                let (i, q) = keys.find(|(_, q)| (length(q) - 1.0).abs() > ROTATION_TOLERANCE)?;
                Some(format!("the rotation of key {i} has length {}; it must be 1", short(length(q))))
            }
            _ => None,
        }
    }
}

/// The first element that is wrong, and its number.
fn find(values: &[f64], width: usize, is_wrong: impl Fn(&[f64]) -> bool) -> Option<(usize, &[f64])> {
    values.chunks_exact(width.max(1)).enumerate().find(|(_, element)| is_wrong(element))
}

/// A number with few digits.
fn short(v: f64) -> f64 {
    (v * 1e4).round() / 1e4
}

/// Checks the weights of vertices against their joints.
fn weights(json: &Value, reader: &mut Reader, broken: &mut Broken) {
    let mut known = HashSet::new();
    let meshes = Place::Root.key("meshes");
    for (i, mesh) in list(json, "meshes").iter().enumerate() {
        let place = meshes.item(i);
        let lists = place.key("primitives");
        for (k, primitive) in list(mesh, "primitives").iter().enumerate() {
            let Some(attributes) = primitive.get("attributes") else { continue };
            let of = |word: &str| -> Vec<usize> {
                (0..).map_while(|set| whole(attributes.get(&format!("{word}_{set}")))).collect()
            };
            let sets: Vec<(usize, usize)> = of("JOINTS").into_iter().zip(of("WEIGHTS")).collect();
            if sets.is_empty() || !known.insert(sets.clone()) {
                continue;
            }
            let mut read = |index: usize| reader.read(json, index, broken);
            let joints: Option<Vec<_>> = sets.iter().map(|(joints, _)| read(*joints)).collect();
            let weights: Option<Vec<_>> = sets.iter().map(|(_, weights)| read(*weights)).collect();
            let Some((joints, weights)) = joints.zip(weights) else { continue };
            let units = sets.iter().map(|(_, weights)| Format::of(&list(json, "accessors")[*weights]).most());
            let own = lists.item(k);
            let place = own.key("attributes");
            for (name, wrong) in wrong_weights(&joints, &weights, &units.collect::<Vec<_>>()) {
                broken.tell(&place.key(name), wrong);
            }
        }
    }
}

/// The first vertices whose weights or joints are wrong.
fn wrong_weights(joints: &[Vec<f64>], weights: &[Vec<f64>], units: &[f64]) -> Vec<(&'static str, String)> {
    let count = joints.iter().chain(weights).map(Vec::len).min().unwrap_or(0) / 4;
    let mut found: BTreeMap<&str, (&'static str, String)> = BTreeMap::new();
    for vertex in 0..count {
        let (mut sum, mut used) = (0.0, 0);
        let mut met: Vec<f64> = Vec::new();
        for (set, all) in weights.iter().enumerate() {
            for at in 4 * vertex..4 * vertex + 4 {
                let weight = all[at] / units[set];
                if weight < 0.0 {
                    let message = format!("a weight of vertex {vertex} is {weight}; weights are 0 or more");
                    found.entry("sign").or_insert(("WEIGHTS_0", message));
                }
                if weight == 0.0 {
                    continue;
                }
                (sum, used) = (sum + weight, used + 1);
                if met.contains(&joints[set][at]) {
                    let message = format!("vertex {vertex} has joint {} twice", joints[set][at]);
                    found.entry("joint").or_insert(("JOINTS_0", message));
                }
                met.push(joints[set][at]);
            }
        }
        if (sum - 1.0).abs() > WEIGHT_TOLERANCE * f64::from(used) {
            let message = format!("the weights of vertex {vertex} have the sum {}; it must be 1", sum as f32);
            found.entry("sum").or_insert(("WEIGHTS_0", message));
        }
    }
    found.into_values().collect()
}
