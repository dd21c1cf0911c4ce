//! The rules of the specification that a picture doesn't need: a file that breaks them is read, and each is warned of.
//!
//! They are those that Khronos' glTF Validator calls errors, also in parts of a file that aren't drawn. [`form`] checks
//! what must be there, of which type and in which range, by the table [`properties`]. The other files check what parts
//! must be to each other, and [`data`] what the numbers of accessors must be.

mod accessors;
mod animations;
mod broken;
mod buffers;
mod cameras;
mod data;
mod extensions;
mod form;
mod images;
mod json;
mod meshes;
mod nodes;
mod place;
mod properties;
mod skins;
#[cfg(test)]
mod tests;
mod tree;
mod views;

use super::accessor::Accessors;
use super::fault::Fault;
use broken::Broken;
pub(super) use json::Value;
use json::list;
use std::collections::HashSet;
use tree::Tree;
use views::Uses;

/// The rules that a document breaks.
pub(super) struct Rules<'a> {
    json: &'a Value<'a>,
    broken: Broken,
}

impl<'a> Rules<'a> {
    /// Checks a document's JSON.
    pub(super) fn of_json(json: &'a Value<'a>) -> Rules<'a> {
        let mut broken = Broken::default();
        form::check(json, &mut broken);
        let tree = Tree::new(list(json, "nodes"));
        let mut uses = Uses::new(json);
        extensions::check(json, &mut broken);
        views::check(json, &mut broken);
        accessors::check(json, &mut uses, &mut broken);
        meshes::check(json, &mut uses, &mut broken);
        nodes::check(json, &tree, &mut broken);
        skins::check(json, &tree, &mut uses, &mut broken);
        animations::check(json, &mut uses, &mut broken);
        images::check(json, &mut uses, &mut broken);
        cameras::check(json, &mut broken);
        Rules { json, broken }
    }

    /// Checks what the document's buffers and images hold.
    pub(super) fn check_data(&mut self, accessors: &Accessors, is_binary: bool) {
        buffers::check(self.json, accessors.buffers, is_binary, &mut self.broken);
        images::check_data(self.json, accessors.buffers, &mut self.broken);
        data::check(self.json, accessors, &mut self.broken);
    }

    /// Adds the broken rules to what was said before. What was said of the same place isn't told again. Returns the
    /// number of broken rules that weren't kept.
    pub(super) fn append_to(self, said: &mut Vec<Fault>, error: Option<&Fault>) -> usize {
        // That an extension isn't read breaks no rule.
        let is_rule = |place: &&str| !place.starts_with("/extensionsUsed/");
        let known: HashSet<String> = said.iter().map(Fault::pointer).filter(is_rule).map(str::to_owned).collect();
        let is_known = |place: &str| {
            let list = place.rsplit_once('/').filter(|(_, last)| last.bytes().all(|b| b.is_ascii_digit()));
            !place.is_empty() && (known.contains(place) || list.is_some_and(|(list, _)| known.contains(list)))
        };
        // The error of JSON that lacks something is also the first broken rule of its place.
        let mut error = error.map(Fault::pointer).filter(|place| !place.is_empty());
        for fault in self.broken.faults {
            if error == Some(fault.pointer()) {
                error = None;
            } else if !is_known(fault.pointer()) {
                said.push(fault);
            }
        }
        self.broken.more
    }
}
