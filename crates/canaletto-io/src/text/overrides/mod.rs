//! Overrides from the command line: `--set material.glass.eta=1.4`.
//!
//! They change the nodes before decoding, so that the checks and messages of the decoder apply. The path of an
//! assignment leads from a node through its blocks to a field: see [`place`].

mod place;
#[cfg(test)]
mod tests;

use super::arithmetic::{DEFAULT_INDEX, LET, REPEAT};
use super::files::Files;
use super::nodes::{
    self, ANIMATION, CAMERA, DEFAULT_CAMERA, ENVIRONMENT, GROUP, INCLUDE, INTEGRATOR, LIGHT, MATERIAL_NODE, PATH,
    PROTOTYPE, TEXTURE,
};
use super::report::{Message, Report};
use super::syntax::{Node, Span, Value, parse_entries};
use crate::assets::AssetPath;
use crate::diagnostic::{closest_word, word_list};
use place::{Part, leads_into, place};

/// What assignments may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Settable {
    /// Any node of a scene text.
    Scene,
    /// What [`super::model_settings`] describes of a model.
    Model,
}

impl Settable {
    /// The words of the nodes that may be set.
    fn words(self) -> Vec<&'static str> {
        let is_settable = |word: &&str| match self {
            Settable::Scene => *word != INCLUDE.name,
            Settable::Model => {
                let in_model = [CAMERA.name, MATERIAL_NODE.name, LIGHT].contains(word);
                in_model || nodes::is_single(word) && ![ENVIRONMENT, ANIMATION.name].contains(word)
            }
        };
        nodes::top().into_iter().filter(is_settable).collect()
    }
}

/// Applies assignments `word.name.word=values` to the nodes. The words are those of the scene text. Without a name, all
/// nodes of that word change. `integrator=NAME` and `environment=KIND` act before the others, wherever they stand, so
/// that those can set what that integrator has.
///
/// Returns the number of the file of the assignments. Nodes that they make are of that file.
pub(crate) fn apply_set(
    nodes: &mut Vec<Node>,
    assignments: &[String],
    settable: Settable,
    files: &mut Files,
    report: &mut Report,
) -> Option<u16> {
    if assignments.is_empty() {
        return None;
    }
    let lines: Vec<String> = assignments.iter().map(|a| a.replace(['\n', '\r'], " ")).collect();
    let text = lines.join("\n");
    let file = files.add("--set".into(), AssetPath::new("", "--set", "--set"), text.as_str().into());
    for choices in [true, false] {
        let mut start = 0;
        for line in &lines {
            if chooses_kind(line) == choices {
                Setter { nodes, line, start, file, settable, report }.apply();
            }
            start += line.len() + 1;
        }
    }
    Some(file)
}

/// Whether assignments leave objects and materials as they are, so that those may be packed.
pub(crate) fn changes_settings_only(assignments: &[String]) -> bool {
    assignments.iter().all(|line| nodes::is_single(line.split(['.', '=']).next().unwrap_or_default().trim()))
}

/// Whether an assignment is `integrator=NAME` or `environment=KIND`.
fn chooses_kind(line: &str) -> bool {
    line.split_once('=').is_some_and(|(path, _)| has_kind(path.trim()))
}

/// Whether a scene has one node of this word, whose kind stands after the word.
fn has_kind(word: &str) -> bool {
    [INTEGRATOR.name, ENVIRONMENT].contains(&word)
}

struct Setter<'a> {
    nodes: &'a mut Vec<Node>,
    line: &'a str,
    start: usize,
    file: u16,
    settable: Settable,
    report: &'a mut Report,
}

impl Setter<'_> {
    fn span(&self, from: usize, to: usize) -> Span {
        Span { file: self.file, start: (self.start + from) as u32, end: (self.start + to) as u32 }
    }

    fn apply(&mut self) {
        let Some((path, equals)) = self.path() else { return };
        // The values, in a node named after the last part of the path.
        let Some(last) = path.last() else { return };
        let mut value = Node::new(&last.text, last.span);
        parse_entries(&self.line[equals + 1..], self.start + equals + 1, &mut value, self.report);
        value.span.end = (self.start + self.line.len()) as u32;
        if value.values.is_empty() && value.properties.is_empty() && !value.broken {
            let span = self.span(equals, equals + 1);
            self.report.error(span, format!("a value is missing after {}=", last.text));
            return;
        }
        let [Part { text: word, span }, inner @ ..] = path.as_slice() else { return };
        let words = self.settable.words();
        if !words.contains(&word.as_str()) {
            self.no_such_node(word, *span, &words);
            return;
        }
        match inner {
            [] if nodes::is_plain(word) => self.replace(value),
            [] if has_kind(word) => self.choose(value),
            [name] if [LET.name, REPEAT.name].contains(&word.as_str()) => self.define(word, name, &value),
            [_, ..] if nodes::is_plain(word) || word == LET.name => self.leads_to_nothing(&path),
            [] => self.leads_to_nothing(&path),
            _ if nodes::is_single(word) => self.single(word, *span, inner, &value),
            _ => self.each(word, *span, inner, &value),
        }
    }

    fn no_such_node(&mut self, word: &str, span: Span, words: &[&'static str]) {
        if nodes::top().contains(&word) && self.settable == Settable::Model {
            let message = Message::error(span, format!("a model has no {word} to set"));
            self.report.push(message.help(format!(
                "a model has {}; a scene with `mesh file=…` in it has everything",
                word_list(words, "and")
            )));
            return;
        }
        let message = Message::error(span, format!("there is nothing called {word} to set"));
        self.report.push(message.help(match closest_word(word, words.iter().copied()) {
            Some(right) => format!("did you mean {right}?"),
            None => "for example: integrator.max-depth=3, material.glass.eta=1.4".into(),
        }));
    }

    fn leads_to_nothing(&mut self, path: &[Part]) {
        let (first, last) = (&path[0], &path[path.len() - 1]);
        let (word, span) = (&first.text, Span { end: last.span.end, ..first.span });
        let form = match nodes::is_single(word) {
            _ if nodes::is_plain(word) => format!("{word}=…"),
            _ if word == LET.name || word == REPEAT.name => format!("{word}.NAME=…"),
            true if has_kind(word) => format!("{word}=NAME or {word}.WORD=…"),
            true => format!("{word}.WORD=…"),
            false => format!("{word}.WORD=… for all, {word}.NAME.WORD=… for one"),
        };
        self.report.push(Message::error(span, "this path leads to nothing that can be set").help(form));
    }

    /// The path before `=`, and the offset of `=`. Names with dots are quoted.
    fn path(&mut self) -> Option<(Vec<Part>, usize)> {
        // The text of each part, with its start and end in the line.
        let mut parts = vec![(String::new(), 0, 0)];
        let mut quoted = false;
        for (at, c) in self.line.char_indices() {
            match c {
                '"' => quoted = !quoted,
                '.' if !quoted => parts.push((String::new(), at + 1, at + 1)),
                '=' if !quoted => {
                    for part in &mut parts {
                        part.0 = part.0.trim().to_owned();
                    }
                    if let Some((_, from, to)) = parts.iter().find(|part| part.0.is_empty()) {
                        let span = self.span(*from, *to);
                        self.report.error(span, "a word is missing here");
                        return None;
                    }
                    let part = |(text, from, to)| Part { text, span: self.span(from, to) };
                    return Some((parts.into_iter().map(part).collect(), at));
                }
                _ => {}
            }
            if let Some(part) = parts.last_mut().filter(|_| c != '.' || quoted) {
                if c != '"' {
                    part.0.push(c);
                }
                part.2 = at + c.len_utf8();
            }
        }
        let span = self.span(0, self.line.len());
        let message = Message::error(span, "this sets nothing: an = is missing");
        self.report.push(message.help("for example: integrator.max-depth=3"));
        None
    }

    /// Adds a node as one of a later file. It keeps the settings of an integrator of the same name; another one starts
    /// with its defaults.
    fn choose(&mut self, value: Node) {
        self.nodes.retain(|node| *node.name != *INTEGRATOR.name || node.name_span.file != self.file);
        self.nodes.push(value);
    }

    /// Replaces a node that consists of values only, in the last file that has one.
    fn replace(&mut self, value: Node) {
        match self.nodes.iter_mut().rev().find(|node| node.name == value.name) {
            Some(node) => *node = value,
            None => self.nodes.push(value),
        }
    }

    /// Changes a named number: one of the scene or of a repeat (`let`), or the number of copies (`repeat`).
    fn define(&mut self, word: &str, name: &Part, value: &Node) {
        let numbers = {
            let mut numbers = Vec::new();
            self.nodes.iter_mut().for_each(|node| numbers_of(node, word, &mut numbers));
            numbers
        };
        if !numbers.iter().any(|(known, _)| *known == name.text) {
            let names: Vec<String> = numbers.into_iter().map(|(name, _)| name).collect();
            let what = if word == LET.name { "number of the scene" } else { "index of a repeat" };
            let message = Message::error(name.span, format!("no {what} is called \"{}\"", name.text));
            self.report.push(match closest_word(&name.text, names.iter().map(String::as_str)) {
                Some(right) => message.help(format!("did you mean \"{right}\"?")),
                None if names.is_empty() => message,
                None => message.help(format!("there are: {}", names.join(", "))),
            });
            return;
        }
        let [number] = value.values.as_slice() else {
            if !value.broken {
                self.report.error(value.span, format!("{word}.{} takes one number", name.text));
            }
            return;
        };
        for (_, place) in numbers.into_iter().filter(|(known, _)| *known == name.text) {
            *place = number.clone();
        }
    }

    /// Changes the last node of a word that a scene has once. It is made if it isn't there.
    fn single(&mut self, word: &str, span: Span, path: &[Part], value: &Node) {
        let at = self.nodes.iter().rposition(|node| *node.name == *word).unwrap_or_else(|| {
            self.nodes.push(Node::new(word, span));
            self.nodes.len() - 1
        });
        let node = &mut self.nodes[at];
        let schema = nodes::schema(node);
        if let Err(message) = place(node, schema, path, value) {
            self.report.push(message);
        }
    }

    /// Changes every node of a word, or those of the name that comes first in the path.
    fn each(&mut self, word: &str, span: Span, path: &[Part], value: &Node) {
        // The names of the nodes, their number, and whether the path leads into one of them without a name.
        let (mut names, mut count, mut leads) = (Vec::new(), 0, false);
        each_node(self.nodes, word, &mut |node| {
            count += 1;
            names.extend(own_name(node).map(str::to_owned));
            leads |= nodes::schema(node).is_some_and(|schema| leads_into(schema, path));
        });
        if count == 0 && word == CAMERA.name && self.settable == Settable::Scene {
            let mut camera = Node::new(word, span);
            if let Err(message) = place(&mut camera, Some(&CAMERA), path, value) {
                self.report.push(message);
            }
            self.nodes.push(camera);
            return;
        }
        let [first, rest @ ..] = path else { return };
        let is_named = !rest.is_empty() && names.contains(&first.text);
        if !is_named && !rest.is_empty() && !leads {
            let message = Message::error(first.span, format!("there is no {word} called \"{}\"", first.text));
            self.report.push(match closest_word(&first.text, names.iter().map(String::as_str)) {
                Some(right) => message.help(format!("did you mean \"{right}\"?")),
                None if names.is_empty() => message,
                None => message.help(format!("there are: {}", names[..names.len().min(20)].join(", "))),
            });
            return;
        }
        if count == 0 {
            self.report.error(span, format!("the scene has no {word}"));
            return;
        }
        // Nodes of one word differ in their kinds, and one of them may have the words of the path.
        let (mut changed, mut wrong) = (false, None);
        each_node(self.nodes, word, &mut |node| {
            let path = match is_named {
                true if own_name(node) == Some(&first.text) => rest,
                true => return,
                false => path,
            };
            let schema = nodes::schema(node);
            match place(node, schema, path, value) {
                Ok(()) => changed = true,
                Err(message) => wrong = wrong.take().or(Some(message)),
            }
        });
        if let Some(message) = wrong.filter(|_| !changed) {
            self.report.push(message);
        }
    }
}

/// Visits the nodes of a word, also those in groups, prototypes and repeats.
fn each_node(nodes: &mut [Node], word: &str, visit: &mut dyn FnMut(&mut Node)) {
    for node in nodes {
        if *node.name == *word {
            visit(node);
        }
        if holds_objects(&node.name) {
            each_node(&mut node.children, word, visit);
        }
    }
}

fn holds_objects(word: &str) -> bool {
    [GROUP.schema.name, PROTOTYPE.schema.name, REPEAT.name].contains(&word)
}

/// The numbers that `let` or `repeat` names, also in groups, prototypes and repeats.
fn numbers_of<'n>(node: &'n mut Node, word: &str, all: &mut Vec<(String, &'n mut Value)>) {
    let Node { name, values, properties, children, .. } = node;
    if **name == *word {
        all.extend(properties.iter_mut().map(|property| (property.key.to_string(), &mut property.value)));
        all.extend(values.iter_mut().map(|value| (DEFAULT_INDEX.to_owned(), value)));
    }
    if holds_objects(name) {
        children.iter_mut().for_each(|child| numbers_of(child, word, all));
    }
}

/// The name by which a path chooses a node among those of its word.
fn own_name(node: &Node) -> Option<&str> {
    let argument = node.values.first().and_then(Value::as_text);
    if *node.name == *CAMERA.name {
        Some(argument.unwrap_or(DEFAULT_CAMERA))
    } else if [MATERIAL_NODE.name, TEXTURE, PATH.name].contains(&&*node.name) {
        argument
    } else {
        nodes::name_of(node).map(|(name, _)| name)
    }
}
