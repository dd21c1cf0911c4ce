//! Meshes, their primitives and morph targets (glTF 2.0, 3.7.2).

use super::accessors::{Format, has_stride};
use super::broken::Broken;
use super::json::{Object, Value, list, named, whole};
use super::place::Place;
use super::views::{Use, Uses};
use std::collections::{BTreeSet, HashMap};

pub(super) fn check(json: &Value, uses: &mut Uses, broken: &mut Broken) {
    let used = list(json, "extensionsUsed");
    let is_quantized = used.iter().any(|name| name.as_str() == Some("KHR_mesh_quantization"));
    let mut reader = Reader { json, is_quantized, vertices: HashMap::new() };
    let meshes = Place::Root.key("meshes");
    for (i, mesh) in list(json, "meshes").iter().enumerate() {
        let place = meshes.item(i);
        let primitives = list(mesh, "primitives");
        let targets = |primitive: &Value| list(primitive, "targets").len();
        let first = primitives.first().map_or(0, targets);
        let lists = place.key("primitives");
        for (k, primitive) in primitives.iter().enumerate() {
            let place = lists.item(k);
            reader.primitive(primitive, &place, uses, broken);
            if targets(primitive) != first {
                let message = format!("it has {} targets, but the first primitive {first}", targets(primitive));
                broken.tell(&place.key("targets"), message);
            }
        }
        if let Some(weights) = mesh.get("weights").and_then(Value::as_list).filter(|weights| weights.len() != first) {
            let message = format!("it has {} weights for {first} morph targets", weights.len());
            broken.tell(&place.key("weights"), message);
        }
    }
    let views = Place::Root.key("bufferViews");
    let mut shared: Vec<usize> =
        reader.vertices.iter().filter(|(_, all)| all.len() > 1).map(|(view, _)| *view).collect();
    shared.sort_unstable();
    for view in shared {
        broken.tell(&views.item(view), "several accessors of vertices use it; it must have a byteStride");
    }
}

struct Reader<'a> {
    json: &'a Value<'a>,
    is_quantized: bool,
    /// The accessors of vertices in each buffer view without a stride.
    vertices: HashMap<usize, BTreeSet<usize>>,
}

/// The number of vertices of a primitive: that of its positions.
fn vertex_count(json: &Value, attributes: &Object) -> Option<usize> {
    let index = whole(attributes.get("POSITION"))?;
    whole(list(json, "accessors").get(index)?.get("count"))
}

impl Reader<'_> {
    fn primitive(&mut self, primitive: &Value, place: &Place, uses: &mut Uses, broken: &mut Broken) {
        let Some(attributes) = primitive.get("attributes").and_then(Value::as_object) else { return };
        let count = vertex_count(self.json, attributes);
        let own = place.key("attributes");
        for (name, index) in attributes.iter() {
            let place = own.key(name);
            if !is_attribute(name) {
                broken.tell(&place, "it's no attribute of the specification; names of others start with _");
            }
            let accessor = whole(Some(index)).and_then(|index| list(self.json, "accessors").get(index));
            if let Some(accessor) = accessor {
                self.attribute(name, accessor, whole(Some(index)), count, &place, uses, broken);
            }
        }
        sets(attributes, &own, broken);
        if let Some((_, indices)) = named(self.json, "accessors", primitive, "indices") {
            self.indices(indices, &place.key("indices"), uses, broken);
        }
        let targets = place.key("targets");
        for (k, target) in list(primitive, "targets").iter().enumerate() {
            let place = targets.item(k);
            for (name, index) in target.properties() {
                let place = place.key(name);
                if !is_attribute(name) {
                    broken.tell(&place, "it's no attribute of the specification; names of others start with _");
                }
                if !attributes.contains_key(name) {
                    broken.tell(&place, format!("the primitive itself has no {name}"));
                }
                if let Some(accessor) = whole(Some(index)).and_then(|index| list(self.json, "accessors").get(index)) {
                    self.target(name, accessor, count, &place, uses, broken);
                }
            }
        }
        self.texture_coordinates(primitive, attributes, place, broken);
    }

    #[expect(clippy::too_many_arguments, reason = "it is called once")]
    fn attribute(
        &mut self,
        name: &str,
        accessor: &Value,
        index: Option<usize>,
        count: Option<usize>,
        place: &Place,
        uses: &mut Uses,
        broken: &mut Broken,
    ) {
        uses.note(self.json, accessor, Use::Vertices, place, broken);
        counts(accessor, count, place, broken);
        let format = Format::of(accessor);
        if format.is_unknown() {
            return;
        }
        if format.has_component("UNSIGNED_INT") {
            broken.tell(place, "its numbers are UNSIGNED_INT, which vertices can't have");
        } else if let Some(wrong) = wrong_format(name, &format, self.is_quantized, false) {
            broken.tell(place, wrong);
        }
        self.bounds(name, accessor, place, broken);
        let Some((view, fields)) = named(self.json, "bufferViews", accessor, "bufferView") else { return };
        let is_unaligned = |size: usize| !size.is_multiple_of(4);
        let has_stride = fields.get("byteStride").is_some();
        if whole(accessor.get("byteOffset")).is_some_and(is_unaligned)
            || !has_stride && is_unaligned(format.size_and_stride()[1])
        {
            broken.tell(place, "its elements don't start at multiples of 4 bytes");
        }
        if !has_stride {
            self.vertices.entry(view).or_default().extend(index);
        }
    }

    fn bounds(&self, name: &str, accessor: &Value, place: &Place, broken: &mut Broken) {
        if name == "POSITION" && (accessor.get("min").is_none() || accessor.get("max").is_none()) {
            broken.tell(place, "its accessor has no min and max, which positions need");
        }
    }

    fn target(
        &self,
        name: &str,
        accessor: &Value,
        count: Option<usize>,
        place: &Place,
        uses: &mut Uses,
        broken: &mut Broken,
    ) {
        uses.note(self.json, accessor, Use::Vertices, place, broken);
        counts(accessor, count, place, broken);
        let format = Format::of(accessor);
        if let Some(wrong) = wrong_format(name, &format, self.is_quantized, true).filter(|_| !format.is_unknown()) {
            broken.tell(place, wrong);
        }
        self.bounds(name, accessor, place, broken);
    }

    fn indices(&self, accessor: &Value, place: &Place, uses: &mut Uses, broken: &mut Broken) {
        uses.note(self.json, accessor, Use::Indices, place, broken);
        if has_stride(self.json, accessor) {
            broken.tell(place, "its buffer view has a byteStride; only vertices may have one");
        }
        let format = Format::of(accessor);
        if !format.is_unknown() && !format.is(&["SCALAR"], &["UNSIGNED_BYTE", "UNSIGNED_SHORT", "UNSIGNED_INT"]) {
            let message = format!("its elements are {format}; they must be SCALAR of integers without a sign");
            broken.tell(place, message);
        }
    }

    /// Checks that the vertices have the texture coordinates that the material asks for.
    fn texture_coordinates(&self, primitive: &Value, attributes: &Object, place: &Place, broken: &mut Broken) {
        let Some((number, material)) = named(self.json, "materials", primitive, "material") else { return };
        let mut most = None;
        texture_sets(material, &mut most);
        if let Some(set) = most.filter(|set| !attributes.contains_key(&format!("TEXCOORD_{set}"))) {
            let message = format!("material {number} needs TEXCOORD_{set}, which the primitive doesn't have");
            broken.tell(&place.key("material"), message);
        }
    }
}

/// The highest set of texture coordinates that a material's textures use.
fn texture_sets(value: &Value, most: &mut Option<usize>) {
    for (name, value) in value.properties() {
        if name.ends_with("Texture") && value.get("index").is_some() {
            let moved = value.get("extensions").and_then(|all| all.get("KHR_texture_transform"));
            let moved = moved.and_then(|transform| whole(transform.get("texCoord")));
            *most = (*most).max(Some(moved.or(whole(value.get("texCoord"))).unwrap_or(0)));
        } else if name != "extras" {
            texture_sets(value, most);
        }
    }
}

/// The set of an attribute with a number, such as `TEXCOORD_1`.
fn set(name: &str) -> Option<(&str, usize)> {
    let (word, digits) = name.split_once('_')?;
    let is_number = digits.bytes().all(|b| b.is_ascii_digit()) && (digits == "0" || !digits.starts_with('0'));
    let is_known = ["COLOR", "JOINTS", "TEXCOORD", "WEIGHTS"].contains(&word);
    if is_known && is_number { Some((word, digits.parse().ok()?)) } else { None }
}

fn is_attribute(name: &str) -> bool {
    name.starts_with('_') || ["POSITION", "NORMAL", "TANGENT"].contains(&name) || set(name).is_some()
}

/// Checks that the sets of an attribute are counted from 0 on, and that joints have weights.
fn sets(attributes: &Object, place: &Place, broken: &mut Broken) {
    let mut all: HashMap<&str, BTreeSet<usize>> = HashMap::new();
    for (word, number) in attributes.iter().filter_map(|(name, _)| set(name)) {
        all.entry(word).or_default().insert(number);
    }
    let of = |word: &str| all.get(word).map_or(0, BTreeSet::len);
    for word in ["COLOR", "JOINTS", "TEXCOORD", "WEIGHTS"] {
        let last = all.get(word).and_then(BTreeSet::last);
        if let Some(last) = last.filter(|last| **last != of(word) - 1) {
            broken.tell(place, format!("it has {word}_{last}, but not all sets from {word}_0 on"));
        }
    }
    if of("JOINTS") != of("WEIGHTS") {
        broken.tell(place, format!("it has {} sets of JOINTS and {} of WEIGHTS", of("JOINTS"), of("WEIGHTS")));
    }
}

fn counts(accessor: &Value, count: Option<usize>, place: &Place, broken: &mut Broken) {
    if let Some((own, count)) = whole(accessor.get("count")).zip(count).filter(|(own, count)| own != count) {
        broken.tell(place, format!("it has {own} elements, but POSITION has {count}"));
    }
}

/// What is wrong with the format of an attribute of the specification.
fn wrong_format(name: &str, format: &Format, is_quantized: bool, is_target: bool) -> Option<String> {
    const UNIT: &[&str] = &["FLOAT", "UNSIGNED_BYTE_NORMALIZED", "UNSIGNED_SHORT_NORMALIZED"];
    const SIGNED: &[&str] = &["FLOAT", "BYTE_NORMALIZED", "SHORT_NORMALIZED"];
    const SIGNED_ANY: &[&str] = &["FLOAT", "BYTE", "SHORT", "BYTE_NORMALIZED", "SHORT_NORMALIZED"];
    const ANY: &[&str] = &[
        "FLOAT",
        "BYTE",
        "SHORT",
        "BYTE_NORMALIZED",
        "SHORT_NORMALIZED",
        "UNSIGNED_BYTE",
        "UNSIGNED_SHORT",
        "UNSIGNED_BYTE_NORMALIZED",
        "UNSIGNED_SHORT_NORMALIZED",
    ];
    const FLOAT: &[&str] = &["FLOAT"];
    let quantized = |components| if is_quantized { components } else { FLOAT };
    let (kinds, components): (&[&str], &[&str]) = match (set(name).map_or(name, |(word, _)| word), is_target) {
        ("POSITION", false) => (&["VEC3"], quantized(ANY)),
        ("POSITION", true) => (&["VEC3"], quantized(SIGNED_ANY)),
        ("NORMAL", _) | ("TANGENT", true) => (&["VEC3"], quantized(SIGNED)),
        ("TANGENT", false) => (&["VEC4"], quantized(SIGNED)),
        ("TEXCOORD", _) if is_quantized => (&["VEC2"], ANY),
        ("TEXCOORD", false) => (&["VEC2"], UNIT),
        ("COLOR", false) => (&["VEC3", "VEC4"], UNIT),
        // Differences have a sign, too.
        ("TEXCOORD", true) => (&["VEC2"], &[UNIT[0], UNIT[1], UNIT[2], SIGNED[1], SIGNED[2]]),
        ("COLOR", true) => (&["VEC3", "VEC4"], &[UNIT[0], UNIT[1], UNIT[2], SIGNED[1], SIGNED[2]]),
        ("JOINTS", _) => (&["VEC4"], &["UNSIGNED_BYTE", "UNSIGNED_SHORT"]),
        ("WEIGHTS", _) => (&["VEC4"], UNIT),
        _ => return None,
    };
    let wanted = components.join(", ").replace("_NORMALIZED", " normalized");
    let message = || format!("its elements are {format}; they must be {} of {wanted}", kinds.join(" or "));
    (!format.is(kinds, components)).then(message)
}
