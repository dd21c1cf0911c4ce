//! Animations (glTF 2.0, 3.11).

use super::accessors::{Format, has_stride};
use super::broken::Broken;
use super::json::{Value, list, named, whole};
use super::place::Place;
use super::views::{Use, Uses};
use crate::import::gltf::fault::Fault;
use std::collections::HashMap;

pub(super) fn check(json: &Value, uses: &mut Uses, broken: &mut Broken) {
    let animations = Place::Root.key("animations");
    for (i, animation) in list(json, "animations").iter().enumerate() {
        let place = animations.item(i);
        let lists = place.key("samplers");
        for (k, sampler) in list(animation, "samplers").iter().enumerate() {
            input(json, sampler, &lists.item(k), uses, broken);
        }
        let mut targets = HashMap::new();
        let lists = place.key("channels");
        let samplers = list(animation, "samplers");
        for (k, channel) in list(animation, "channels").iter().enumerate() {
            let place = lists.item(k);
            if let Some(index) = whole(channel.get("sampler")).filter(|index| *index >= samplers.len()) {
                let index = u32::try_from(index).unwrap_or(u32::MAX);
                let fault = Fault::missing("sampler", index, samplers.len());
                broken.fault(fault.at(place.key("sampler").to_string()));
            }
            let Some(target) = channel.get("target") else { continue };
            let Some((node, path)) = whole(target.get("node")).zip(target.get("path").and_then(Value::as_str)) else {
                continue;
            };
            if let Some(first) = targets.insert((node, path), k) {
                broken.tell(&place.key("target"), format!("it has the same target as channel {first}"));
            }
            let sampler = whole(channel.get("sampler")).and_then(|index| samplers.get(index));
            self::target(json, node, path, sampler, &place, broken);
        }
    }
}

fn input(json: &Value, sampler: &Value, place: &Place, uses: &mut Uses, broken: &mut Broken) {
    for name in ["input", "output"] {
        let Some((_, accessor)) = named(json, "accessors", sampler, name) else { continue };
        let place = place.key(name);
        uses.note(json, accessor, Use::Other, &place, broken);
        if has_stride(json, accessor) {
            broken.tell(&place, "its buffer view has a byteStride; only vertices may have one");
        }
    }
    let Some((_, accessor)) = named(json, "accessors", sampler, "input") else { return };
    let place = place.key("input");
    let format = Format::of(accessor);
    if !format.is_unknown() && !format.is(&["SCALAR"], &["FLOAT"]) {
        broken.tell(&place, format!("its elements are {format}; times must be SCALAR of FLOAT"));
    }
    if accessor.get("min").is_none() || accessor.get("max").is_none() {
        broken.tell(&place, "its accessor has no min and max, which times need");
    }
    if is_cubic(sampler) && whole(accessor.get("count")).is_some_and(|count| count < 2) {
        broken.tell(&place, "it has one key; CUBICSPLINE needs two");
    }
}

/// Whether the keys of a sampler have tangents.
pub(super) fn is_cubic(sampler: &Value) -> bool {
    sampler.get("interpolation").is_some_and(|word| word.as_str() == Some("CUBICSPLINE"))
}

/// Checks a channel's target, and that its sampler's numbers are those of the target.
fn target(json: &Value, node: usize, path: &str, sampler: Option<&Value>, place: &Place, broken: &mut Broken) {
    const NORMALIZED: &[&str] =
        &["FLOAT", "BYTE_NORMALIZED", "UNSIGNED_BYTE_NORMALIZED", "SHORT_NORMALIZED", "UNSIGNED_SHORT_NORMALIZED"];
    let node = list(json, "nodes").get(node);
    let (kind, components): (&str, &[&str]) = match path {
        "translation" | "scale" => ("VEC3", &["FLOAT"]),
        "rotation" => ("VEC4", NORMALIZED),
        "weights" => ("SCALAR", NORMALIZED),
        _ => return,
    };
    let mesh = node.and_then(|node| named(json, "meshes", node, "mesh"));
    let first = mesh.and_then(|(_, mesh)| list(mesh, "primitives").first());
    let targets = first.map_or(0, |primitive| list(primitive, "targets").len());
    let own = place.key("target");
    if path == "weights" && node.is_some() && targets == 0 {
        broken.tell(&own, "its node has no mesh with morph targets, which weights need");
    } else if path != "weights" && node.is_some_and(|node| node.get("matrix").is_some()) {
        broken.tell(&own, format!("its node has a matrix, so that it has no {path}"));
    }
    let Some(sampler) = sampler else { return };
    let Some((_, output)) = named(json, "accessors", sampler, "output") else { return };
    let place = place.key("sampler");
    let format = Format::of(output);
    if !format.is_unknown() && !format.is(&[kind], components) {
        let wanted = components.join(", ").replace("_NORMALIZED", " normalized");
        broken.tell(&place, format!("its output is {format}; {path} must be {kind} of {wanted}"));
    }
    let input = named(json, "accessors", sampler, "input").and_then(|(_, input)| whole(input.get("count")));
    let values = if path == "weights" { targets } else { 1 };
    let per_key = values.saturating_mul(if is_cubic(sampler) { 3 } else { 1 });
    let Some((keys, count)) = input.zip(whole(output.get("count"))) else { return };
    if per_key > 0 && keys.saturating_mul(per_key) != count {
        let message = format!("its output has {count} elements, but its {keys} keys need {per_key} each");
        broken.tell(&place, message);
    }
}
