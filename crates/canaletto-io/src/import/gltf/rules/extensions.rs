//! The extensions that a document names and uses.

use super::broken::Broken;
use super::form::short;
use super::json::{Value, list};
use super::place::Place;
use std::collections::HashSet;

pub(super) fn check(json: &Value, broken: &mut Broken) {
    let used: HashSet<&str> = list(json, "extensionsUsed").iter().filter_map(Value::as_str).collect();
    let required = Place::Root.key("extensionsRequired");
    for (i, name) in list(json, "extensionsRequired").iter().enumerate() {
        if let Some(name) = name.as_str().filter(|name| !used.contains(name)) {
            broken.tell(&required.item(i), format!("{:?} isn't in extensionsUsed; it must be there, too", short(name)));
        }
    }
    let mut walk = Walk { used: &used, told: HashSet::new() };
    walk.value(json, &Place::Root, broken);
}

/// A walk through all of a document.
struct Walk<'a> {
    used: &'a HashSet<&'a str>,
    /// The names that were told: each is told once.
    told: HashSet<&'a str>,
}

impl<'a> Walk<'a> {
    fn value(&mut self, value: &'a Value<'a>, place: &Place, broken: &mut Broken) {
        match value {
            Value::List(list) => {
                for (i, item) in
                    list.iter().enumerate().filter(|(_, item)| item.is_object() || item.as_list().is_some())
                {
                    self.value(item, &place.item(i), broken);
                }
            }
            Value::Object(object) => {
                for (name, value) in object.iter() {
                    match name {
                        "extras" => {}
                        "extensions" => self.extensions(value, &place.key(name), broken),
                        _ => self.value(value, &place.key(name), broken),
                    }
                }
            }
            _ => {}
        }
    }

    fn extensions(&mut self, value: &'a Value<'a>, place: &Place, broken: &mut Broken) {
        let Some(object) = value.as_object() else {
            return broken.tell(place, "it must be an object of extensions");
        };
        for (name, extension) in object.iter() {
            let place = place.key(name);
            if !extension.is_object() {
                broken.tell(&place, "it must be an object");
            }
            if !self.used.contains(name) && self.told.insert(name) {
                broken.tell(&place, "it isn't in extensionsUsed; it must be there, too");
            }
            self.value(extension, &place, broken);
        }
    }
}
