//! The help with unknown words and names: what was probably meant, and what is possible.

use super::arithmetic::LET;
use super::nodes::{self, INCLUDE, KEY};
use super::report::Message;
use super::schema::NodeSchema;
use super::syntax::{Node, Span, Value, ValueKind};
use super::validate::Validator;
use crate::diagnostic::closest_word;

/// The largest number of unknown names for which suggestions are computed.
const MAX_GUESSES: usize = 50;

impl Validator<'_> {
    /// Reports a word that is unknown here; returns the one that is probably meant.
    pub(super) fn unknown(
        &mut self,
        name: &str,
        span: Span,
        words: &'static NodeSchema,
        title: &str,
    ) -> Option<&'static str> {
        let allowed = nodes::allowed(words);
        let message = Message::error(span, format!("{title} has no \"{}\"", shortened(name)));
        let elsewhere = nodes::top().into_iter().any(|word| word == name);
        let (meant, mut help) = suggestion(name, &allowed);
        if name == KEY {
            help = "keys stand in the braces of what moves: translate { key 1  0 0 0; key 50  10 0 0 }".into();
        } else if name == LET.name {
            help = "let stands at the top of a file, or at the start of a repeat".into();
        } else if name == INCLUDE.name {
            help = "include stands at the top of a file, outside of everything".into();
        } else if elsewhere && !words.objects {
            help = format!("{name} is a node of its own, outside of {title}");
        }
        self.report.push(message.help(help));
        meant
    }

    /// Reports an unknown node at the top level of a file.
    pub(crate) fn unknown_node(&mut self, node: &Node) {
        if node.name.is_empty() {
            return;
        }
        let allowed = nodes::top();
        let message = Message::error(node.name_span, format!("there is no node \"{}\"", shortened(&node.name)));
        let home = nodes::home(&node.name);
        self.report.push(message.help(match home {
            Some(home) if closest_word(&node.name, allowed.iter().copied()).is_none() => {
                format!("{} belongs into the braces of {home}", node.name)
            }
            _ => suggestion(&node.name, &allowed).1,
        }));
    }

    /// Reports a name that isn't defined.
    pub(crate) fn unknown_name<'n>(
        &mut self,
        what: &str,
        name: &str,
        span: Span,
        known: impl Iterator<Item = &'n str> + Clone,
    ) {
        if self.files.incomplete {
            // The name may be defined in the part that couldn't be read.
            return;
        }
        let message = Message::error(span, format!("there is no {what} \"{}\"", shortened(name)));
        self.guesses += 1;
        if self.guesses > MAX_GUESSES {
            self.report.push(message);
            return;
        }
        let help = match closest_word(name, known.clone()) {
            Some(right) => format!("did you mean \"{right}\"?"),
            None => {
                // In order, since names come from tables that have none.
                let mut names: Vec<&str> = known.collect();
                names.sort_unstable();
                let more = if names.len() > 20 { ", …" } else { "" };
                names.truncate(20);
                match names.as_slice() {
                    [] => format!("the scene names no {what}"),
                    _ => format!("the scene has: {}{more}", names.join(", ")),
                }
            }
        };
        self.report.push(message.help(help));
    }
}

/// The nearest allowed word, and a list of all.
fn suggestion(wrong: &str, allowed: &[&'static str]) -> (Option<&'static str>, String) {
    let lower = wrong.to_lowercase().replace('_', "-");
    let right = allowed
        .iter()
        .find(|word| ***word == lower)
        .or_else(|| allowed.iter().find(|word| SYNONYMS.contains(&(lower.as_str(), **word))))
        .copied()
        .or_else(|| closest_word(&lower, allowed.iter().copied()));
    let list = match allowed {
        [] => "nothing can stand here".to_owned(),
        _ => format!("possible here: {}", allowed.join(", ")),
    };
    let help = match right {
        Some(right) => format!("did you mean {right}? {}{}", list[..1].to_uppercase(), &list[1..]),
        None => list,
    };
    (right, help)
}

pub(super) fn described(value: &Value) -> String {
    match &value.kind {
        ValueKind::Number(number) => format!("the number {number}"),
        ValueKind::Text(text) => format!("the text \"{}\"", shortened(text)),
        ValueKind::Flag(flag) => format!("#{flag}"),
        ValueKind::Null => "#null".into(),
    }
}

pub(super) fn shortened(text: &str) -> String {
    if text.chars().count() <= 40 { text.into() } else { text.chars().take(39).chain(['…']).collect() }
}

/// Common words of other formats, and the words of the scene text for them.
pub(super) const SYNONYMS: &[(&str, &str)] = &[
    ("albedo", "kd"),
    ("aperture", "lens"),
    ("aperture", "radius"),
    ("alpha", "coverage"),
    ("alpha", "opacity"),
    ("area", "disk"),
    ("cap", "caps"),
    ("color", "kd"),
    ("color", "intensity"),
    ("color", "material"),
    ("colour", "kd"),
    ("colour", "intensity"),
    ("colour", "material"),
    ("count", "points"),
    ("cube", "box"),
    ("cuboid", "box"),
    ("depth", "max-depth"),
    ("dielectric-priority", "priority"),
    ("diffuse", "kd"),
    ("dissolve", "coverage"),
    ("double-sided", "two-sided"),
    ("emission-color", "emission"),
    ("emissive", "emission"),
    ("emit", "emission"),
    ("fov", "fovy"),
    ("f-stop", "f-number"),
    ("focal-distance", "focus"),
    ("focus-distance", "focus"),
    ("from", "eye"),
    ("frosted", "roughness"),
    ("glossiness", "roughness"),
    ("glossy", "roughness"),
    ("image", "film"),
    ("index", "eta"),
    ("ior", "eta"),
    ("ke", "emission"),
    ("look-at", "center"),
    ("lookat", "center"),
    ("mirror", "k"),
    ("obj", "mesh"),
    ("object", "group"),
    ("origin", "eye"),
    ("origin", "point"),
    ("ortho", "orthographic"),
    ("parallel", "directional"),
    ("parallel", "orthographic"),
    ("path", "file"),
    ("point", "omni"),
    ("point-light", "light"),
    ("pos", "position"),
    ("position", "center"),
    ("position", "eye"),
    ("position", "point"),
    ("radiance", "emission"),
    ("reflection", "k"),
    ("refraction", "eta"),
    ("render", "film"),
    ("resolution", "size"),
    ("rotation", "rotate"),
    ("shininess", "n"),
    ("specular", "ks"),
    ("spp", "samples"),
    ("spotlight", "spot"),
    ("src", "file"),
    ("sun", "directional"),
    ("target", "center"),
    ("to", "target"),
    ("towards", "direction"),
    ("transparency", "opacity"),
    ("width", "size"),
];
