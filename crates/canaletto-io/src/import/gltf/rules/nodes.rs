//! Nodes and scenes (glTF 2.0, 3.5).

use super::broken::Broken;
use super::json::{Value, list, named, numbers, whole};
use super::place::Place;
use super::tree::Tree;

/// How far the length of a rotation may be from 1, as in Khronos' validator.
const UNIT_TOLERANCE: f64 = 0.00769;
/// How far the cosine between columns of a matrix may be from 0.
const SKEW_TOLERANCE: f64 = 0.005;

pub(super) fn check(json: &Value, tree: &Tree, broken: &mut Broken) {
    let nodes = Place::Root.key("nodes");
    for (i, node) in list(json, "nodes").iter().enumerate() {
        let place = nodes.item(i);
        transform(node, &place, broken);
        for (name, needed) in [("skin", "mesh"), ("weights", "mesh")] {
            if node.get(name).is_some() && node.get(needed).is_none() {
                broken.tell(&place.key(name), format!("its node has no {needed}, which it needs"));
            }
        }
        if let Some((_, mesh)) = named(json, "meshes", node, "mesh") {
            mesh_of(node, mesh, &place, broken);
        }
        let children = place.key("children");
        for (k, child) in list(node, "children").iter().enumerate() {
            let Some(child) = whole(Some(child)).filter(|child| *child < tree.parents.len()) else { continue };
            if let Some(parent) = tree.parents[child].filter(|parent| *parent != i) {
                broken.tell(&children.item(k), format!("node {child} is a child of node {parent} already"));
            }
        }
    }
    for node in tree.circles() {
        broken.tell(&nodes.item(node), "it is below itself: its parents form a circle");
    }
    let scenes = Place::Root.key("scenes");
    for (i, scene) in list(json, "scenes").iter().enumerate() {
        let scene_place = scenes.item(i);
        let place = scene_place.key("nodes");
        for (k, node) in list(scene, "nodes").iter().enumerate() {
            let Some(node) = whole(Some(node)) else { continue };
            if let Some(parent) = tree.parents.get(node).copied().flatten() {
                let message = format!("node {node} is a child of node {parent}; a scene lists nodes without a parent");
                broken.tell(&place.item(k), message);
            }
        }
    }
}

fn transform(node: &Value, place: &Place, broken: &mut Broken) {
    if let Some(matrix) = node.get("matrix") {
        let place = place.key("matrix");
        if let Some(other) = ["translation", "rotation", "scale"].into_iter().find(|name| node.get(name).is_some()) {
            broken.tell(&place, format!("its node has a {other}, too; a node has either a matrix or these"));
        }
        if numbers(Some(matrix)).is_some_and(|m| m.len() == 16 && !has_parts(&m)) {
            broken.tell(&place, "it can't be taken apart into a translation, a rotation and a scale");
        }
    }
    let rotation = numbers(node.get("rotation")).filter(|rotation| rotation.len() == 4);
    let length = rotation.map_or(1.0, |q| q.iter().map(|v| v * v).sum::<f64>().sqrt());
    if (length - 1.0).abs() > UNIT_TOLERANCE {
        broken.tell(&place.key("rotation"), format!("its length is {length}; a rotation has length 1"));
    }
}

/// Whether a matrix in columns is a translation, a rotation and a scale.
fn has_parts(m: &[f64]) -> bool {
    let column = |i: usize| glam::DVec3::new(m[4 * i], m[4 * i + 1], m[4 * i + 2]);
    let [x, y, z] = [0, 1, 2].map(column);
    let is_square = |a: glam::DVec3, b: glam::DVec3| a.dot(b).abs() <= SKEW_TOLERANCE * a.length() * b.length();
    let last = [m[3], m[7], m[11], m[15]];
    last == [0.0, 0.0, 0.0, 1.0] && x.cross(y).dot(z) != 0.0 && is_square(x, y) && is_square(y, z) && is_square(z, x)
}

/// What a node and its mesh say of each other.
fn mesh_of(node: &Value, mesh: &Value, place: &Place, broken: &mut Broken) {
    let primitives = list(mesh, "primitives");
    if let Some(weights) = node.get("weights").and_then(Value::as_list) {
        let targets = primitives.first().map_or(0, |primitive| list(primitive, "targets").len());
        if weights.len() != targets {
            let message = format!("it has {} weights, but its mesh has {targets} morph targets", weights.len());
            broken.tell(&place.key("weights"), message);
        }
    }
    let has_joints = |primitive: &Value| primitive.get("attributes").is_some_and(|all| all.get("JOINTS_0").is_some());
    if node.get("skin").is_some() && !primitives.is_empty() && !primitives.iter().any(has_joints) {
        broken.tell(place, "it has a skin, but its mesh has no joints");
    }
}
