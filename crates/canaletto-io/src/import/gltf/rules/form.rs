//! The form of the JSON: what must be there, of which type, in which range, and what indices name.

use super::broken::Broken;
use super::json::{Value, list, whole};
use super::place::Place;
use super::properties::{Kind, Property, ROOT, TEXTURE_INFO};
use crate::import::gltf::fault::Fault;
use std::collections::HashSet;

/// Checks the whole document.
pub(super) fn check(json: &Value, broken: &mut Broken) {
    let form = Form { json };
    form.object(json, ROOT, &Place::Root, broken);
    for (i, material) in list(json, "materials").iter().enumerate() {
        let lists = Place::Root.key("materials");
        form.extension_textures(material, &lists.item(i), broken);
    }
}

/// The document that indices refer to.
struct Form<'a> {
    json: &'a Value<'a>,
}

impl Form<'_> {
    fn object(&self, value: &Value, properties: &[Property], place: &Place, broken: &mut Broken) {
        let Some(object) = value.as_object() else { return wrong_type(value, "an object", place, broken) };
        for Property(name, is_required, kind) in properties {
            match object.get(name) {
                Some(value) => self.property(value, kind, &place.key(name), broken),
                None if *is_required => broken.tell(place, format!("its {name} is missing")),
                None => {}
            }
        }
    }

    fn property(&self, value: &Value, kind: &Kind, place: &Place, broken: &mut Broken) {
        match kind {
            Kind::Text => {
                if value.as_str().is_none() {
                    wrong_type(value, "a text", place, broken);
                }
            }
            Kind::Word(words) => match value.as_str() {
                Some(word) if words.contains(&word) => {}
                Some(word) => broken.tell(place, format!("is {:?}; it must be {}", short(word), words.join(", "))),
                None => wrong_type(value, "a text", place, broken),
            },
            Kind::Number { low, high, open } => number(value, [*low, *high], *open, place, broken),
            Kind::Whole { low, high } => match whole(Some(value)).map(|v| v as u64) {
                Some(v) if (*low..=*high).contains(&v) => {}
                Some(v) if *high == u64::MAX => broken.tell(place, format!("is {v}; it must be {low} or more")),
                Some(v) => broken.tell(place, format!("is {v}; it must be {low} to {high}")),
                None => wrong_type(value, "a whole number from 0 on", place, broken),
            },
            Kind::Code(codes) => match whole(Some(value)).map(|v| v as u64) {
                Some(code) if codes.contains(&code) => {}
                Some(code) => {
                    let codes: Vec<String> = codes.iter().map(u64::to_string).collect();
                    broken.tell(place, format!("is {code}; it must be one of {}", codes.join(", ")));
                }
                None => wrong_type(value, "a whole number", place, broken),
            },
            Kind::Numbers { count, low, high } => {
                let Some(items) = elements(value, place, broken) else { return };
                if *count > 0 && items.len() != *count {
                    broken.tell(place, format!("it has {} numbers; it must have {count}", items.len()));
                }
                for (i, item) in items.iter().enumerate() {
                    number(item, [*low, *high], false, &place.item(i), broken);
                }
            }
            Kind::Index(of) => self.index(value, of, place, broken),
            Kind::Indices(of) => {
                let Some(items) = elements(value, place, broken) else { return };
                let mut seen = HashSet::new();
                for (i, item) in items.iter().enumerate() {
                    self.index(item, of, &place.item(i), broken);
                    if !whole(Some(item)).is_none_or(|index| seen.insert(index)) {
                        broken.tell(&place.item(i), format!("{} is listed twice", whole(Some(item)).unwrap_or(0)));
                    }
                }
            }
            Kind::Texts => {
                let Some(items) = elements(value, place, broken) else { return };
                let mut seen = HashSet::new();
                for (i, item) in items.iter().enumerate() {
                    match item.as_str() {
                        Some(text) if seen.insert(text) => {}
                        Some(text) => broken.tell(&place.item(i), format!("{:?} is listed twice", short(text))),
                        None => wrong_type(item, "a text", &place.item(i), broken),
                    }
                }
            }
            Kind::One(properties) => self.object(value, properties, place, broken),
            Kind::Many(properties) => {
                for (i, item) in elements(value, place, broken).unwrap_or_default().iter().enumerate() {
                    self.object(item, properties, &place.item(i), broken);
                }
            }
            Kind::Attributes => self.attributes(value, place, broken),
            Kind::Targets => {
                for (i, item) in elements(value, place, broken).unwrap_or_default().iter().enumerate() {
                    self.attributes(item, &place.item(i), broken);
                }
            }
        }
    }

    fn attributes(&self, value: &Value, place: &Place, broken: &mut Broken) {
        let Some(object) = value.as_object() else { return wrong_type(value, "an object", place, broken) };
        if object.is_empty() {
            broken.tell(place, "is empty; it must have an attribute");
        }
        for (name, index) in object.iter() {
            self.index(index, "accessors", &place.key(name), broken);
        }
    }

    fn index(&self, value: &Value, of: &str, place: &Place, broken: &mut Broken) {
        let count = list(self.json, of).len();
        match whole(Some(value)) {
            Some(index) if index < count => {}
            Some(index) => {
                let index = u32::try_from(index).unwrap_or(u32::MAX);
                broken.fault(Fault::missing(one_of(of), index, count).at(place.to_string()));
            }
            None => wrong_type(value, "an index, a whole number from 0 on", place, broken),
        }
    }

    /// The textures of a material's extensions, whose names end in the same word.
    fn extension_textures(&self, material: &Value, place: &Place, broken: &mut Broken) {
        let place = place.key("extensions");
        for (name, extension) in material.get("extensions").into_iter().flat_map(Value::properties) {
            let place = place.key(name);
            for (property, value) in extension.properties() {
                if property.ends_with("Texture") && value.is_object() {
                    self.object(value, TEXTURE_INFO, &place.key(property), broken);
                }
            }
        }
    }
}

/// The elements of a list, which must have some.
fn elements<'v>(value: &'v Value<'v>, place: &Place, broken: &mut Broken) -> Option<&'v [Value<'v>]> {
    match value.as_list() {
        Some(list) => {
            if list.is_empty() {
                broken.tell(place, "is empty; a list must have an element or be left out");
            }
            Some(list)
        }
        None => {
            wrong_type(value, "a list", place, broken);
            None
        }
    }
}

fn number(value: &Value, [low, high]: [f64; 2], open: bool, place: &Place, broken: &mut Broken) {
    let Some(v) = value.as_f64() else { return wrong_type(value, "a number", place, broken) };
    if (low..=high).contains(&v) && !(open && v == low) {
        return;
    }
    let range = match (open, high == f64::MAX) {
        (true, _) => format!("more than {low}"),
        (false, true) => format!("{low} or more"),
        (false, false) => format!("between {low} and {high}"),
    };
    broken.tell(place, format!("is {v}; it must be {range}"));
}

fn wrong_type(value: &Value, wanted: &str, place: &Place, broken: &mut Broken) {
    let found = match value {
        Value::Null => "null".to_owned(),
        Value::Bool(value) => value.to_string(),
        Value::Number(value) => value.to_string(),
        Value::Text(text) => format!("the text {:?}", short(text)),
        Value::List(_) => "a list".to_owned(),
        Value::Object(_) => "an object".to_owned(),
    };
    let what = if matches!(place, Place::Root) { "the JSON is" } else { "is" };
    broken.tell(place, format!("{what} {found}; it must be {wanted}"));
}

/// The start of a text.
pub(super) fn short(text: &str) -> String {
    text.chars().take(80).collect()
}

/// The word for an element of a list of the document.
fn one_of(list: &str) -> &'static str {
    match list {
        "scenes" => "scene",
        "nodes" => "node",
        "cameras" => "camera",
        "skins" => "skin",
        "meshes" => "mesh",
        "materials" => "material",
        "textures" => "texture",
        "images" => "image",
        "samplers" => "sampler",
        "accessors" => "accessor",
        "bufferViews" => "buffer view",
        _ => "buffer",
    }
}
