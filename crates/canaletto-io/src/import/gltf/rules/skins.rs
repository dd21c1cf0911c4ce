//! Skins (glTF 2.0, 3.7.3).

use super::accessors::{Format, has_stride};
use super::broken::Broken;
use super::json::{Value, list, named, whole};
use super::place::Place;
use super::tree::Tree;
use super::views::{Use, Uses};
use std::collections::{BTreeSet, HashMap};

pub(super) fn check(json: &Value, tree: &Tree, uses: &mut Uses, broken: &mut Broken) {
    let skins = Place::Root.key("skins");
    for (i, skin) in list(json, "skins").iter().enumerate() {
        let place = skins.item(i);
        let joints: Vec<usize> = joints(skin).filter(|joint| *joint < tree.parents.len()).collect();
        let roots: BTreeSet<usize> = joints.iter().filter_map(|joint| tree.root(*joint)).collect();
        if roots.len() > 1 {
            broken.tell(&place.key("joints"), "there is no node above all of its joints");
        }
        if let Some((skeleton, _)) = named(json, "nodes", skin, "skeleton")
            && let Some(joint) = joints.iter().find(|joint| !tree.is_below(**joint, skeleton))
        {
            broken.tell(&place.key("skeleton"), format!("joint {joint} isn't below node {skeleton}"));
        }
        if let Some((_, accessor)) = named(json, "accessors", skin, "inverseBindMatrices") {
            uses.note(json, accessor, Use::Matrices, &place.key("inverseBindMatrices"), broken);
            matrices(json, accessor, list(skin, "joints").len(), &place.key("inverseBindMatrices"), broken);
        }
    }
    scenes(json, tree, broken);
}

fn joints<'v>(skin: &'v Value<'v>) -> impl Iterator<Item = usize> + 'v {
    list(skin, "joints").iter().filter_map(|joint| whole(Some(joint)))
}

fn matrices(json: &Value, accessor: &Value, joints: usize, place: &Place, broken: &mut Broken) {
    let format = Format::of(accessor);
    if !format.is(&["MAT4"], &["FLOAT"]) {
        broken.tell(place, format!("its elements are {format}; they must be MAT4 of FLOAT"));
    }
    if has_stride(json, accessor) {
        broken.tell(place, "its buffer view has a byteStride; only vertices may have one");
    }
    if let Some(count) = whole(accessor.get("count")).filter(|count| *count < joints) {
        broken.tell(place, format!("it has {count} matrices for {joints} joints"));
    }
}

/// Nodes with a skin whose joints a scene of theirs lacks.
fn scenes(json: &Value, tree: &Tree, broken: &mut Broken) {
    let skins = list(json, "skins");
    if skins.is_empty() {
        return;
    }
    let mut scenes: HashMap<usize, BTreeSet<usize>> = HashMap::new();
    for (i, scene) in list(json, "scenes").iter().enumerate() {
        for root in list(scene, "nodes").iter().filter_map(|node| tree.root(whole(Some(node))?)) {
            scenes.entry(root).or_default().insert(i);
        }
    }
    let nodes = Place::Root.key("nodes");
    let none = BTreeSet::new();
    let of = |root: usize| scenes.get(&root).unwrap_or(&none);
    for (i, node) in list(json, "nodes").iter().enumerate() {
        let Some((skin, own)) = whole(node.get("skin")).zip(tree.root(i)) else { continue };
        let joint = skins.get(skin).and_then(|skin| joints(skin).next()).and_then(|joint| tree.root(joint));
        if joint.is_some_and(|joint| joint != own && !of(own).is_subset(of(joint))) {
            broken.tell(&nodes.item(i), format!("it is in a scene without the joints of skin {skin}"));
        }
    }
}
