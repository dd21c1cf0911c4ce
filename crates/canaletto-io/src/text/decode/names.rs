//! The names of objects, and the objects that instances repeat.

use crate::text::nodes::{INSTANCE, PROTOTYPE, is_object, name_of, target_of};
use crate::text::report::Message;
use crate::text::syntax::{Node, Span};
use crate::text::validate::Validator;
use std::collections::{HashMap, HashSet};

/// Objects by their names.
#[derive(Default)]
pub(crate) struct Names<'a> {
    by_name: HashMap<&'a str, Target>,
    slots: usize,
}

struct Target {
    span: Span,
    /// The index among the scene's prototypes, if the object is instanced or is a prototype.
    slot: Option<u32>,
}

impl<'a> Names<'a> {
    /// Collects all names. Reports duplicate names, and instances that contain themselves.
    pub(crate) fn collect(nodes: &'a [Node], validator: &mut Validator) -> Names<'a> {
        let mut names = Names { by_name: HashMap::new(), slots: 0 };
        let mut repeated = HashSet::new();
        for node in nodes {
            names.find(node, &mut repeated, validator);
        }
        let mut edges = HashMap::new();
        for node in nodes {
            names.number(node, &repeated, None, &mut edges);
        }
        report_cycles(&names, &edges, validator);
        names
    }

    /// The number of prototypes.
    pub(crate) fn slots(&self) -> usize {
        self.slots
    }

    /// The prototype of this name; `None` if nothing has the name or if its object is neither.
    pub(crate) fn slot(&self, name: &str) -> Option<u32> {
        self.by_name.get(name)?.slot
    }

    /// The index of this node itself among the prototypes.
    pub(crate) fn slot_of(&self, node: &Node) -> Option<u32> {
        let (name, span) = name_of(node)?;
        self.by_name.get(name).filter(|target| target.span == span)?.slot
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &'a str> + Clone {
        self.by_name.keys().copied()
    }

    fn find(&mut self, node: &'a Node, repeated: &mut HashSet<&'a str>, validator: &mut Validator) {
        if !is_object(&node.name) {
            return;
        }
        if let Some((name, span)) = name_of(node) {
            match self.by_name.get(name) {
                Some(first) => {
                    let place = validator.files.first(first.span, span);
                    let message = Message::error(span, format!("two objects are called \"{name}\""));
                    validator.report.push(message.label(place));
                }
                None => {
                    self.by_name.insert(name, Target { span, slot: None });
                }
            }
        }
        if node.packed.is_some() {
            // A packed node has no name. It keeps only the properties that name the target of an instance.
            repeated.extend(node.properties.iter().filter_map(|property| property.value.as_text()));
        } else if *node.name == *INSTANCE.schema.name
            && let Some((of, _)) = target_of(node)
        {
            repeated.insert(of);
        }
        for child in &node.children {
            self.find(child, repeated, validator);
        }
    }

    /// Numbers the prototypes, and records the references between them.
    fn number(
        &mut self,
        node: &'a Node,
        repeated: &HashSet<&'a str>,
        mut holder: Option<&'a str>,
        edges: &mut HashMap<&'a str, Vec<(&'a str, Span)>>,
    ) {
        if !is_object(&node.name) {
            return;
        }
        let mut note = |holder: Option<&'a str>, held: &'a str, span: Span| {
            if let Some(holder) = holder {
                edges.entry(holder).or_default().push((held, span));
            }
        };
        if let Some((name, span)) = name_of(node)
            && let Some(target) = self.by_name.get_mut(name)
            && target.span == span
            && (repeated.contains(name) || *node.name == *PROTOTYPE.schema.name)
        {
            target.slot = Some(self.slots as u32);
            self.slots += 1;
            note(holder, name, span);
            holder = Some(name);
        }
        if *node.name == *INSTANCE.schema.name
            && let Some((of, span)) = target_of(node)
        {
            note(holder, of, span);
        }
        for child in &node.children {
            self.number(child, repeated, holder, edges);
        }
    }
}

/// Reports each cycle of names that contain each other once.
fn report_cycles(names: &Names, edges: &HashMap<&str, Vec<(&str, Span)>>, validator: &mut Validator) {
    let mut starts: Vec<(&str, Span)> = names.by_name.iter().map(|(name, target)| (*name, target.span)).collect();
    starts.sort_by_key(|(_, span)| (span.file, span.start));
    let mut done: HashSet<&str> = HashSet::new();
    for (start, _) in starts {
        // The path from the start; each name has the number of its edges that were followed.
        let mut way: Vec<(&str, usize)> = vec![(start, 0)];
        let mut on_path: HashSet<&str> = HashSet::from([start]);
        if done.contains(start) {
            continue;
        }
        while let Some((name, next)) = way.last_mut() {
            let Some((held, span)) = edges.get(name).and_then(|list| list.get(*next)) else {
                done.insert(name);
                on_path.remove(name);
                way.pop();
                continue;
            };
            *next += 1;
            if on_path.contains(held) {
                let from = way.iter().position(|(name, _)| name == held).unwrap_or(0);
                let circle: Vec<&str> = way[from..].iter().map(|(name, _)| *name).chain([*held]).collect();
                let message = Message::error(*span, format!("\"{held}\" would contain itself without end"));
                validator.report.push(message.label(circle.join(" contains ")));
            } else if !done.contains(held) && names.by_name.contains_key(held) {
                way.push((held, 0));
                on_path.insert(held);
            }
        }
    }
}

#[cfg(test)]
mod tests;
