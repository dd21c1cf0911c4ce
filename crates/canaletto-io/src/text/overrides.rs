//! Overrides from the command line: `--set material.glass.eta=1.4`.
//!
//! They change the nodes before decoding, so that the checks and messages of the decoder apply.

use super::arithmetic::{LET, REPEAT};
use super::closest_word::closest_word;
use super::files::Files;
use super::nodes::{
    self, ALIASES, ALTERNATIVES, ANIMATION, CAMERA, DEFAULT_CAMERA, ENVIRONMENT, GROUP, INCLUDE, INTEGRATOR, LIGHT,
    MATERIAL_NODE, PATH, PROTOTYPE, TEXTURE,
};
use super::report::{Message, Report};
use super::syntax::{Node, Span, parse_entries};
use crate::assets::AssetPath;
use crate::diagnostic::word_list;

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
/// nodes of that word change. `integrator=NAME` acts before the others, wherever it stands, so that they can set what
/// that integrator has.
pub(crate) fn apply_set(
    nodes: &mut Vec<Node>,
    assignments: &[String],
    settable: Settable,
    files: &mut Files,
    report: &mut Report,
) {
    if assignments.is_empty() {
        return;
    }
    let lines: Vec<String> = assignments.iter().map(|a| a.replace(['\n', '\r'], " ")).collect();
    let text = lines.join("\n");
    let file = files.add("--set".into(), AssetPath::new("", "--set", "--set"), text.as_str().into());
    for choices in [true, false] {
        let mut start = 0;
        for line in &lines {
            if chooses_integrator(line) == choices {
                Setter { nodes, line, start, file, settable, report }.apply();
            }
            start += line.len() + 1;
        }
    }
}

/// Whether assignments leave objects and materials as they are, so that those may be packed.
pub(crate) fn changes_settings_only(assignments: &[String]) -> bool {
    assignments.iter().all(|line| nodes::is_single(line.split(['.', '=']).next().unwrap_or_default().trim()))
}

/// Whether an assignment is `integrator=NAME`.
fn chooses_integrator(line: &str) -> bool {
    line.split_once('=').is_some_and(|(path, _)| path.trim() == INTEGRATOR.name)
}

struct Setter<'a> {
    nodes: &'a mut Vec<Node>,
    line: &'a str,
    start: usize,
    file: u16,
    settable: Settable,
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
        let words = self.settable.words();
        if !words.contains(&word.as_str()) {
            self.report.push(match nodes::top().contains(&word.as_str()) && self.settable == Settable::Model {
                true => Message::error(span, format!("a model has no {word} to set")).help(format!(
                    "a model has {}; a scene with `mesh file=…` in it has everything",
                    word_list(&words, "and")
                )),
                false => {
                    let nearest = closest_word(word, words).map(|right| format!("did you mean {right}?"));
                    let example = || "for example: integrator.max-depth=3, material.glass.eta=1.4".into();
                    let message = Message::error(span, format!("there is nothing called {word} to set"));
                    message.help(nearest.unwrap_or_else(example))
                }
            });
            return;
        }
        let (single, plain) = (nodes::is_single(word), nodes::is_plain(word));
        match &path[1..] {
            [] if plain => self.replace(value),
            [(name, from, to)] if word == LET.name => {
                let span = self.span(*from, *to);
                self.define(name, span, value);
            }
            [] if word == INTEGRATOR.name => self.choose(value),
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
                    _ if word == LET.name => "let.NAME=…".into(),
                    true if word == INTEGRATOR.name => format!("{word}=NAME or {word}.WORD=…"),
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

    /// Changes a named number of the scene.
    fn define(&mut self, name: &str, span: Span, value: Node) {
        let lets = || self.nodes.iter().filter(|node| *node.name == *LET.name).flat_map(|node| &node.properties);
        if !lets().any(|property| *property.key == *name) {
            let names: Vec<&str> = lets().map(|property| &*property.key).collect();
            let message = Message::error(span, format!("no number of the scene is called \"{name}\""));
            self.report.push(match closest_word(name, names.iter().copied()) {
                Some(right) => message.help(format!("did you mean \"{right}\"?")),
                None if names.is_empty() => message,
                None => message.help(format!("there are: {}", names.join(", "))),
            });
            return;
        }
        let [number] = value.values.as_slice() else {
            if !value.broken {
                self.report.error(value.span, format!("let.{name} takes one number"));
            }
            return;
        };
        let lets = self.nodes.iter_mut().filter(|node| *node.name == *LET.name).flat_map(|node| &mut node.properties);
        lets.filter(|property| *property.key == *name).for_each(|property| property.value = number.clone());
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
            nodes::name_of(node).map(|(name, _)| name)
        };
        if name.is_none_or(|name| own == Some(name)) {
            put(node, value.clone());
            *changed += 1;
        } else {
            names.extend(own.map(str::to_owned));
        }
    }
    if [GROUP.schema.name, PROTOTYPE.schema.name, REPEAT.name].contains(&&*node.name) {
        for child in &mut node.children {
            change(child, word, name, value, names, changed);
        }
    }
}

/// Replaces the node's child or property of that name, and removes those that it excludes. Where the node says the same
/// in a block, it is replaced there.
fn put(node: &mut Node, mut value: Node) {
    let says = |block: &Node, field: &str| {
        let has_property = block.properties.iter().any(|property| *property.key == *field);
        has_property || block.children.iter().any(|child| *child.name == *field)
    };
    for [field, block, inner] in ALIASES {
        if *value.name == *field {
            let mut blocks = node.children.iter_mut();
            if let Some(block) = blocks.find(|child| *child.name == *block && says(child, inner)) {
                value.name = inner.into();
                return put(block, value);
            }
        } else if *value.name == *block && says(&value, inner) {
            node.properties.retain(|property| *property.key != *field);
            node.children.retain(|child| *child.name != *field);
        }
    }
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

#[cfg(test)]
mod tests {
    use crate::assets::MemoryAssets;
    use crate::text::read_scene_text;
    use canaletto::scene::{Integrator, ShadowMethod, WhittedSettings, ZbufferSettings};

    const SCENE: &str = "camera { eye 0 0 9; size 8 8 }\nintegrator \"whitted\" { max-depth 3; shadows #false }\n\
        sphere { center 0 0 0; radius 1 }\nlight \"omni\" { position 1 2 3 }\n";

    fn set(set: &[&str]) -> Result<Integrator, String> {
        let set: Vec<String> = set.iter().map(|set| (*set).to_owned()).collect();
        let read = read_scene_text(SCENE, "s", &MemoryAssets::new(), &set);
        read.map(|(scene, _)| scene.integrator).map_err(|mistakes| mistakes.to_string())
    }

    #[test]
    fn another_integrator_starts_with_its_defaults() {
        let flat = ZbufferSettings { shadows: ShadowMethod::None, ..ZbufferSettings::DEFAULT };
        assert_eq!(set(&["integrator=zbuffer"]), Ok(ZbufferSettings::DEFAULT.into()));
        // The choice of the integrator acts first, wherever it stands.
        assert_eq!(set(&["integrator=zbuffer", "integrator.shadows=none"]), Ok(flat.into()));
        assert_eq!(set(&["integrator.shadows=none", "integrator=\"zbuffer\""]), Ok(flat.into()));
        // The last choice decides.
        assert_eq!(set(&["integrator=radiosity", "integrator=zbuffer"]), Ok(ZbufferSettings::DEFAULT.into()));
        // The scene's own settings stay where its integrator is named again.
        let own = WhittedSettings { max_depth: 3, shadows: false, ..WhittedSettings::DEFAULT };
        assert_eq!(set(&["integrator=whitted"]), Ok(own.into()));
        assert_eq!(set(&["integrator.max-depth=4"]), Ok(WhittedSettings { max_depth: 4, ..own }.into()));
    }

    /// The coverage of a material and the absorption of its medium.
    fn surface(material: &str, set: &str) -> Result<(f32, f32), String> {
        let text = format!("{SCENE}material \"m\" {{ {material} }}\nbox material=\"m\" {{ min 0 0 0; max 1 1 1 }}\n");
        let read = read_scene_text(&text, "s", &MemoryAssets::new(), &[set.to_owned()]);
        let (scene, _) = read.map_err(|mistakes| mistakes.to_string())?;
        let material = scene.materials.iter().find(|material| material.name == "m").unwrap();
        Ok((material.coverage, material.medium.absorption.to_array()[0]))
    }

    #[test]
    fn what_a_block_says_too_is_replaced_there() {
        for scene in ["standard { opacity 0.5 }", "standard opacity=0.5", "coverage 0.5; standard", "standard"] {
            assert_eq!(surface(scene, "material.m.coverage=0.25"), Ok((0.25, 0.0)), "{scene}");
        }
        for scene in ["coverage 0.5; standard", "standard { opacity 0.5 }", "coverage 0.5", ""] {
            assert_eq!(surface(scene, "material.m.standard=opacity=0.25"), Ok((0.25, 0.0)), "{scene}");
        }
        // What the new block doesn't say stays beside it.
        assert_eq!(surface("coverage 0.5", "material.m.standard=thin-walled=#true"), Ok((0.5, 0.0)));
        for scene in ["medium { absorption 0.5 }", "medium { absorption 0.5; scattering 1 }", "medium { scattering 1 }"]
        {
            assert_eq!(surface(scene, "material.m.absorption=0.25"), Ok((1.0, 0.25)), "{scene}");
        }
        assert_eq!(surface("dielectric 1.5; absorption 1", "material.m.medium=absorption=0.25"), Ok((1.0, 0.25)));
        let told = surface("standard { opacity 0.5 }", "material.m.coverage=3").unwrap_err();
        assert!(told.contains("--set:1") && told.contains("must be between 0"), "{told}");
        let told = surface("coverage 0.5; standard { opacity 0.5 }", "material.m.kd=1").unwrap_err();
        assert!(told.contains("given twice"), "{told}");
    }

    #[test]
    fn wrong_integrators_are_told() {
        for (assignments, words) in [
            (&["integrator=zbufer"][..], "did you mean \"zbuffer\"?"),
            (&["integrator=zbuffer", "integrator.max-depth=3"], "the integrator \"zbuffer\" has no max-depth"),
            (&["integrator.shadows=map"], "the integrator \"whitted\" takes #true or #false"),
            (&["integrator=zbuffer extra"], "integrator"),
        ] {
            let told = set(assignments).unwrap_err();
            assert!(told.contains(words) && told.contains("--set"), "{assignments:?}: {told}");
        }
    }
}
