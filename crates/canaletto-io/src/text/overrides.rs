//! Overrides from the command line: `--set material.glass.eta=1.4`.
//!
//! They change the nodes before decoding, so that the checks and messages of the decoder apply.

use super::closest_word::closest_word;
use super::files::Files;
use super::nodes::{
    self, ALTERNATIVES, CAMERA, DEFAULT_CAMERA, GROUP, INCLUDE, MATERIAL_NODE, NAME, PATH, PROTOTYPE, TEXTURE,
};
use super::report::{Message, Report};
use super::syntax::{Node, Span, parse_entries};
use crate::assets::AssetPath;

/// Applies assignments `word.name.word=values` to the nodes. The words are those of the scene text. Without a name, all
/// nodes of that word change.
pub(crate) fn apply_set(nodes: &mut Vec<Node>, assignments: &[String], files: &mut Files, report: &mut Report) {
    if assignments.is_empty() {
        return;
    }
    let lines: Vec<String> = assignments.iter().map(|a| a.replace(['\n', '\r'], " ")).collect();
    let text = lines.join("\n");
    let file = files.add("--set".into(), AssetPath::new("", "--set", "--set"), text.as_str().into());
    let mut start = 0;
    for line in &lines {
        let mut setter = Setter { nodes, line, start, file, report };
        setter.apply();
        start += line.len() + 1;
    }
}

struct Setter<'a> {
    nodes: &'a mut Vec<Node>,
    line: &'a str,
    start: usize,
    file: u16,
    report: &'a mut Report,
}

/// A part of the path with its start and end in the line.
type Part = (String, usize, usize);

impl Setter<'_> {
    fn span(&self, from: usize, to: usize) -> Span {
        Span { file: self.file, start: (self.start + from) as u32, end: (self.start + to) as u32 }
    }

    fn apply(&mut self) {
        let Some((path, equals)) = self.path() else { return };
        // The values, in a node named after the last part of the path.
        let Some((last, from, to)) = path.last().cloned() else { return };
        let mut value = Node::new(&last, self.span(from, to));
        parse_entries(&self.line[equals + 1..], self.start + equals + 1, &mut value, self.report);
        value.span.end = (self.start + self.line.len()) as u32;
        if value.values.is_empty() && value.properties.is_empty() && !value.broken {
            let span = self.span(equals, equals + 1);
            self.report.error(span, format!("a value is missing after {last}="));
            return;
        }
        let (word, from, to) = &path[0];
        let span = self.span(*from, *to);
        if !nodes::top().contains(&word.as_str()) || word == INCLUDE.name {
            let message = Message::error(span, format!("there is nothing called {word} to set"));
            let words: Vec<&str> = nodes::top().into_iter().filter(|w| *w != INCLUDE.name).collect();
            let nearest = closest_word(word, words.iter().copied()).map(|right| format!("did you mean {right}?"));
            let help = nearest.unwrap_or_else(|| "for example: integrator.max-depth=3, material.glass.eta=1.4".into());
            self.report.push(message.help(help));
            return;
        }
        let (single, plain) = (nodes::is_single(word), nodes::is_plain(word));
        match &path[1..] {
            [] if plain => self.replace(value),
            [_] if single => {
                let found = self.nodes.iter_mut().rev().find(|node| *node.name == **word);
                match found {
                    Some(node) => put(node, value),
                    None => {
                        let mut node = Node::new(word, span);
                        node.children.push(value);
                        self.nodes.push(node);
                    }
                }
            }
            [_] if !single => self.each(word, None, span, value),
            [(name, from, to), _] if !single => {
                let span = self.span(*from, *to);
                self.each(word, Some(name), span, value);
            }
            _ => {
                let whole = self.span(path[0].1, path[path.len() - 1].2);
                let form = match single {
                    _ if plain => format!("{word}=…"),
                    true => format!("{word}.WORD=…"),
                    false => format!("{word}.WORD=… for all, {word}.NAME.WORD=… for one"),
                };
                self.report.push(Message::error(whole, "this path leads to nothing that can be set").help(form));
            }
        }
    }

    /// The path before `=`, and the offset of `=`. Names with dots are quoted.
    fn path(&mut self) -> Option<(Vec<Part>, usize)> {
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
                    return Some((parts, at));
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

    /// Replaces a node that consists of values only, in the last file that has one.
    fn replace(&mut self, value: Node) {
        match self.nodes.iter_mut().rev().find(|node| node.name == value.name) {
            Some(node) => *node = value,
            None => self.nodes.push(value),
        }
    }

    /// Changes every node of a word, or those of a name.
    fn each(&mut self, word: &str, name: Option<&str>, span: Span, value: Node) {
        let mut names = Vec::new();
        let mut changed = 0;
        for node in self.nodes.iter_mut() {
            change(node, word, name, &value, &mut names, &mut changed);
        }
        // Several files may define a camera. All of its nodes were set, and the last one decides.
        if changed > 0 {
            return;
        }
        let message = match name {
            Some(name) => Message::error(span, format!("there is no {word} called \"{name}\"")),
            None => Message::error(span, format!("the scene has no {word}")),
        };
        let near = name.and_then(|name| closest_word(name, names.iter().map(String::as_str)));
        self.report.push(match near {
            Some(right) => message.help(format!("did you mean \"{right}\"?")),
            None if name.is_some() && !names.is_empty() => {
                names.truncate(20);
                message.help(format!("there are: {}", names.join(", ")))
            }
            None => message,
        });
    }
}

fn change(node: &mut Node, word: &str, name: Option<&str>, value: &Node, names: &mut Vec<String>, changed: &mut usize) {
    if &*node.name == word {
        let argument = || node.values.first().and_then(|v| v.as_text());
        let own = if word == CAMERA.name {
            Some(argument().unwrap_or(DEFAULT_CAMERA))
        } else if [MATERIAL_NODE.name, TEXTURE, PATH.name].contains(&word) {
            argument()
        } else {
            node.text(NAME.name()).map(|(name, _)| name)
        };
        if name.is_none_or(|name| own == Some(name)) {
            put(node, value.clone());
            *changed += 1;
        } else {
            names.extend(own.map(str::to_owned));
        }
    }
    if [GROUP.schema.name, PROTOTYPE.schema.name].contains(&&*node.name) {
        for child in &mut node.children {
            change(child, word, name, value, names, changed);
        }
    }
}

/// Replaces the node's child or property of that name, and removes those that it excludes.
fn put(node: &mut Node, value: Node) {
    for pair in ALTERNATIVES.iter().filter(|pair| pair.contains(&&*value.name)) {
        let excluded = |name: &str| pair.contains(&name) && name != &*value.name;
        node.properties.retain(|property| !excluded(&property.key));
        node.children.retain(|child| !excluded(&child.name));
    }
    node.properties.retain(|property| property.key != value.name);
    let place = node.children.iter().position(|child| child.name == value.name);
    match place {
        Some(place) => {
            node.children[place] = value;
            let mut index = 0;
            let name = node.children[place].name.clone();
            node.children.retain(|child| {
                index += 1;
                child.name != name || index - 1 == place
            });
        }
        None => node.children.push(value),
    }
}
