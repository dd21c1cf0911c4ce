//! The parser from text to [`Node`]s.

use super::lexer::{Lexer, is_newline, is_word};
use super::number::{number, starts_number};
use super::string::Reported;
use super::tree::{Node, Property, Span, Value, ValueKind};
use crate::text::nodes::{self, MATERIAL_NODE, NAME, OF};
use crate::text::report::Report;

/// The largest nesting depth of nodes.
pub(crate) const MAX_DEPTH: usize = 128;
/// The largest number of nodes and values in a file; each takes about 100 bytes of memory.
pub(crate) const MAX_ITEMS: usize = 1 << 24;

/// Parses a whole file; mistakes go into the report. Returns `None` if the block structure itself is unclear.
///
/// With `packs`, long sequences of unnamed objects or of materials are packed, several objects into one node: see
/// [`unpack`].
pub(crate) fn parse(text: &str, file: u16, packs: bool, report: &mut Report) -> Option<Vec<Node>> {
    let mut parser = Parser::new(Lexer::new(text, 0, file, report));
    parser.packs = packs;
    parser.lexer.check_characters();
    parser.document()
}

/// Parses the text of a packed node again and returns all nodes that it represents.
pub(crate) fn unpack(node: &Node, text: &str) -> Vec<Node> {
    let mut report = Report::default();
    let lexer = Lexer::new(text, node.span.start as usize, node.span.file, &mut report);
    Parser::new(lexer).document().unwrap_or_default()
}

/// The number of top-level nodes of a file from which on they are packed.
const MANY: usize = 1024;

/// Whether a node may be packed: a material, or an object without name and keys that only the decoder uses.
fn is_plain(node: &Node) -> bool {
    let known = nodes::is_small(&node.name)
        || *node.name == *MATERIAL_NODE.name && matches!(node.values.as_slice(), [name] if name.as_text().is_some());
    let named = node.properties.iter().any(|property| *property.key == *NAME.name())
        || !node.values.is_empty() && nodes::object(&node.name).is_some_and(|o| nodes::has_name_first(&o.schema));
    let said = |child: &Node| {
        let apart = [NAME.name(), OF.name()].contains(&&*child.name) || nodes::is_of_time(&child.name);
        !(apart || child.broken) && child.children.is_empty()
    };
    !(node.broken || named) && known && node.children.iter().all(said) && !nodes::has_text_for_number(node)
}

/// Parses the values and properties in `text`, at `base` of its file, into a node. `true` may stand for `#true`.
pub(crate) fn parse_entries(text: &str, base: usize, node: &mut Node, report: &mut Report) {
    let mut lexer = Lexer::new(text, base, node.span.file, report);
    lexer.bare_keywords = true;
    let mut parser = Parser::new(lexer);
    parser.lexer.check_characters();
    loop {
        parser.lexer.skip_node_space();
        if parser.lexer.rest().is_empty() {
            break;
        }
        if parser.lexer.peek().is_some_and(|c| matches!(c, ';' | '{' | '}') || is_newline(c)) {
            let span = parser.lexer.span_here();
            parser.lexer.error(span, "only values can be set", "");
            node.broken = true;
            break;
        }
        parser.entry(node, false);
    }
}

/// A node whose block is being parsed.
struct Open {
    node: Node,
    /// The nodes before this one in its own block.
    siblings: Vec<Node>,
    /// The span of its `{`.
    brace: Span,
    /// The part that is commented out: the node, or only this block.
    dropped: Dropped,
}

#[derive(Clone, Copy, PartialEq)]
enum Dropped {
    Nothing,
    Node,
    Block,
    Both,
}

/// The parts that may still come in a node.
#[derive(Clone, Copy, PartialEq)]
enum Stage {
    Entries,
    Blocks,
    Done,
}

struct Parser<'a> {
    lexer: Lexer<'a>,
    /// The nodes of the innermost block so far.
    nodes: Vec<Node>,
    open: Vec<Open>,
    /// The number of nodes and values so far.
    items: usize,
    /// Whether nodes are packed.
    packs: bool,
}

impl<'a> Parser<'a> {
    fn new(lexer: Lexer<'a>) -> Parser<'a> {
        Parser { lexer, nodes: Vec::new(), open: Vec::new(), items: 0, packs: false }
    }

    fn document(mut self) -> Option<Vec<Node>> {
        loop {
            self.lexer.skip_line_space();
            let start = self.lexer.at;
            match self.lexer.peek() {
                None => break,
                Some(';') => self.lexer.bump(),
                Some('}') => self.close()?,
                Some('{') => {
                    let span = self.lexer.span_here();
                    let help = "it must start on the same line as its node; only values and comments may stand between";
                    self.lexer.error(span, "this { belongs to no node", help);
                    // The block most probably belongs to the node before.
                    let mut node = match self.nodes.pop() {
                        Some(node) if node.children.is_empty() && node.packed.is_none() => node,
                        other => {
                            self.nodes.extend(other);
                            Node::new("", span)
                        }
                    };
                    node.broken |= node.name.is_empty();
                    let dropped = if node.name.is_empty() { Dropped::Node } else { Dropped::Nothing };
                    self.enter(node, dropped)?;
                }
                Some(_) => {
                    let dropped = self.lexer.take("/-");
                    if dropped {
                        self.lexer.skip_line_space();
                        if self.lexer.peek().is_none_or(|c| matches!(c, '}' | ';')) {
                            let span = self.lexer.span(start, start + 2);
                            self.lexer.error(span, "this /- has nothing to comment out", "");
                            continue;
                        }
                        if self.lexer.looking_at("{") {
                            continue;
                        }
                    }
                    self.annotation();
                    if let Some(node) = self.name() {
                        self.count()?;
                        self.node(node, Stage::Entries, if dropped { Dropped::Node } else { Dropped::Nothing })?;
                    }
                }
            }
        }
        if let Some(open) = self.open.last() {
            let span = open.brace;
            self.lexer.error(span, "this { is never closed", "its } is missing");
            return None;
        }
        Some(self.nodes)
    }

    /// Parses a node's name; `None` if it is missing, which is reported.
    fn name(&mut self) -> Option<Node> {
        let start = self.lexer.at;
        if self.starts_string() {
            if let Ok(name) = self.lexer.string() {
                let mut node = Node::new(&name, self.lexer.span_from(start));
                if self.lexer.text[start..].starts_with(is_word) {
                    self.check_bare(&name, node.name_span, &mut node.broken);
                }
                return Some(node);
            }
        } else {
            self.skip_token();
            let span = self.lexer.span_from(start);
            let found: String = self.lexer.text[start..self.lexer.at].chars().take(40).collect();
            let help = "each line starts with a word; end a line with \\ to continue it on the next";
            self.lexer.error(span, format!("\"{found}\" can't start a node"), help);
        }
        // The rest of the line has no meaning without the name.
        while self.lexer.peek().is_some_and(|c| !is_newline(c) && !matches!(c, ';' | '{' | '}')) {
            self.lexer.bump();
        }
        None
    }

    /// Parses the rest of a node after its name, up to its end or into its block.
    fn node(&mut self, mut node: Node, mut stage: Stage, dropped: Dropped) -> Option<()> {
        loop {
            let end = self.lexer.at;
            let spaced = self.lexer.skip_node_space();
            let start = self.lexer.at;
            match self.lexer.peek() {
                None | Some(';' | '}') => {}
                Some(c) if is_newline(c) => {}
                Some('/') if self.lexer.looking_at("//") => {}
                Some('{') => {
                    if stage == Stage::Done {
                        let span = self.lexer.span_here();
                        self.lexer.error(span, format!("{} has a second block", node.name), "put everything into one");
                    }
                    return self.enter(node, dropped);
                }
                Some('/') if self.lexer.take("/-") => {
                    self.lexer.skip_line_space();
                    match self.lexer.peek() {
                        Some('{') => {
                            let both = if dropped == Dropped::Node { Dropped::Both } else { Dropped::Block };
                            return self.enter(node, both);
                        }
                        None | Some(';' | '}') => {
                            let span = self.lexer.span(start, start + 2);
                            self.lexer.error(span, "this /- has nothing to comment out", "");
                        }
                        Some(_) => {
                            let kept = (node.values.len(), node.properties.len());
                            self.entry(&mut node, false);
                            node.values.truncate(kept.0);
                            node.properties.truncate(kept.1);
                        }
                    }
                    continue;
                }
                Some(_) => {
                    if stage != Stage::Entries {
                        while self.lexer.peek().is_some_and(|c| !is_newline(c) && !matches!(c, ';' | '{' | '}')) {
                            self.skip_token();
                            self.lexer.skip_node_space();
                        }
                        let span = self.lexer.span_from(start);
                        let help = "values stand before the {; a new node needs a new line or a ;";
                        self.lexer.error(span, format!("nothing may follow the block of {}", node.name), help);
                        stage = Stage::Done;
                    } else {
                        self.entry(&mut node, !spaced);
                        self.count()?;
                    }
                    continue;
                }
            }
            node.span.end = self.lexer.span(end, end).end;
            if dropped == Dropped::Nothing {
                let many = self.packs && self.nodes.len() >= MANY && self.open.is_empty();
                if many && self.lexer.report.count() == 0 && is_plain(&node) {
                    node.pack();
                }
                let alone = match self.nodes.last_mut() {
                    Some(last) if node.packed.is_some() => last.join(node),
                    _ => Some(node),
                };
                self.nodes.extend(alone);
            }
            return Some(());
        }
    }

    /// Counts a node or value; `None` beyond the limit.
    fn count(&mut self) -> Option<()> {
        self.items += 1;
        if self.items > MAX_ITEMS {
            let message = format!("the file has more than {MAX_ITEMS} nodes and values");
            let span = self.lexer.span_here();
            self.lexer.error(span, message, "large data belongs into files of its own, as meshes and clouds");
            return None;
        }
        Some(())
    }

    /// Enters a node's block, at its `{`.
    fn enter(&mut self, node: Node, dropped: Dropped) -> Option<()> {
        let brace = self.lexer.span_here();
        if self.open.len() == MAX_DEPTH {
            let message = format!("nested too deep: blocks may stand {MAX_DEPTH} deep in each other");
            self.lexer.error(brace, message, "instances and include repeat things without nesting them");
            return None;
        }
        self.lexer.bump();
        let siblings = std::mem::take(&mut self.nodes);
        self.open.push(Open { node, siblings, brace, dropped });
        Some(())
    }

    /// Leaves a block, at its `}`.
    fn close(&mut self) -> Option<()> {
        let span = self.lexer.span_here();
        self.lexer.bump();
        let Some(Open { mut node, siblings, dropped, .. }) = self.open.pop() else {
            self.lexer.error(span, "this } closes nothing", "");
            return Some(());
        };
        let children = std::mem::replace(&mut self.nodes, siblings);
        let (stage, dropped) = match dropped {
            Dropped::Block => (Stage::Blocks, Dropped::Nothing),
            Dropped::Both => (Stage::Blocks, Dropped::Node),
            Dropped::Nothing | Dropped::Node => {
                node.children.extend(children);
                (Stage::Done, dropped)
            }
        };
        self.node(node, stage, dropped)
    }

    /// Parses a value or property; `glued` if no blank precedes it.
    fn entry(&mut self, node: &mut Node, glued: bool) {
        let start = self.lexer.at;
        if self.annotation() {
            self.skip_token();
            node.broken = true;
            return;
        }
        if glued && !self.lexer.looking_at("=") {
            self.skip_token();
            let span = self.lexer.span_from(start);
            self.lexer.error(span, "a blank is missing before this", "");
            node.broken = true;
            return;
        }
        if self.lexer.take("=") {
            let span = self.lexer.span_from(start);
            let help = format!("write its values after {} with blanks between them", node.name);
            self.lexer.error(span, format!("no = stands between {} and its values", node.name), &help);
            node.broken = true;
            return;
        }
        match self.value(false) {
            Ok(value) => {
                let end = self.lexer.at;
                self.lexer.skip_node_space();
                if !self.lexer.looking_at("=") {
                    self.lexer.at = end;
                    node.values.push(value);
                    return;
                }
                self.lexer.bump();
                let equals = self.lexer.span_from(self.lexer.at - 1);
                self.lexer.skip_node_space();
                self.property(node, value, equals);
            }
            Err(Reported) => node.broken = true,
        }
    }

    fn property(&mut self, node: &mut Node, key: Value, equals: Span) {
        let ValueKind::Text(name) = key.kind else {
            self.lexer.error(key.span, "only a word can have a value after =", "");
            node.broken = true;
            return;
        };
        let ends = self.lexer.peek().is_none_or(|c| matches!(c, ';' | '{' | '}') || is_newline(c));
        if ends {
            self.lexer.error(equals, format!("a value is missing after {name}="), "");
            node.broken = true;
        } else if self.annotation() {
            self.skip_token();
            node.broken = true;
        } else {
            match self.value(true) {
                Ok(value) => node.properties.push(Property { key: name, key_span: key.span, value }),
                Err(Reported) => node.broken = true,
            }
        }
    }

    /// Parses a single value; `property` if it follows `=`.
    fn value(&mut self, property: bool) -> Result<Value, Reported> {
        let start = self.lexer.at;
        let rest = self.lexer.rest();
        let kind = if starts_number(rest) {
            let length = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
            self.lexer.at += length;
            match number(&rest[..length]) {
                Ok(number) => ValueKind::Number(number),
                Err((message, help)) => {
                    let span = self.lexer.span_from(start);
                    self.lexer.error(span, message, &help);
                    return Err(Reported);
                }
            }
        } else if rest.starts_with('#') && !rest.trim_start_matches('#').starts_with('"') {
            self.keyword()?
        } else if self.starts_string() {
            let text = self.lexer.string()?;
            let bare = rest.starts_with(is_word);
            // A word before `=` is a property name and is checked as one.
            let mut broken = false;
            let span = self.lexer.span_from(start);
            if bare {
                if self.lexer.bare_keywords && !self.lexer.rest().trim_start().starts_with('=') {
                    match text.as_str() {
                        "true" => return Ok(Value { kind: ValueKind::Flag(true), span }),
                        "false" => return Ok(Value { kind: ValueKind::Flag(false), span }),
                        _ => {}
                    }
                }
                self.check_bare(&text, span, &mut broken);
                if broken {
                    return Err(Reported);
                }
            }
            ValueKind::Text(text.into())
        } else {
            self.lexer.bump();
            let span = self.lexer.span_from(start);
            let found = &self.lexer.text[start..self.lexer.at];
            self.lexer.error(
                span,
                format!("\"{found}\" can't stand here"),
                "texts with other characters than letters, digits, - and _ stand in quotes",
            );
            self.skip_token();
            return Err(Reported);
        };
        let end = self.lexer.at;
        let ended = match self.lexer.peek() {
            None | Some('{' | '}' | ';' | '\\') => true,
            Some('=') => !property,
            Some('/') => ["//", "/*", "/-"].iter().any(|c| self.lexer.looking_at(c)),
            Some(c) => super::lexer::is_blank(c) || is_newline(c),
        };
        if !ended {
            self.skip_token();
            let span = self.lexer.span_from(start);
            let help = match kind {
                ValueKind::Text(_) if self.lexer.text[end..].starts_with('/') => "a path stands in quotes",
                ValueKind::Text(_) => "texts with other characters than letters, digits, - and _ stand in quotes",
                _ => "a blank is missing after the value",
            };
            let found: String = self.lexer.text[start..self.lexer.at].chars().take(60).collect();
            self.lexer.error(span, format!("{found} can't be read as one value"), help);
            return Err(Reported);
        }
        Ok(Value { kind, span: self.lexer.span(start, end) })
    }

    /// Parses `#true` and the other keywords.
    fn keyword(&mut self) -> Result<ValueKind, Reported> {
        let start = self.lexer.at;
        self.lexer.bump();
        let rest = self.lexer.rest();
        let word = &rest[..rest.find(|c| !is_word(c)).unwrap_or(rest.len())];
        self.lexer.at += word.len();
        Ok(match word {
            "true" => ValueKind::Flag(true),
            "false" => ValueKind::Flag(false),
            "null" => ValueKind::Null,
            "inf" => ValueKind::Number(f64::INFINITY),
            "-inf" => ValueKind::Number(f64::NEG_INFINITY),
            "nan" => ValueKind::Number(f64::NAN),
            _ => {
                self.skip_token();
                let span = self.lexer.span_from(start);
                let found: String = self.lexer.text[start..self.lexer.at].chars().take(40).collect();
                self.lexer.error(
                    span,
                    format!("{found} means nothing"),
                    "there are #true and #false; texts that start with # stand in quotes",
                );
                return Err(Reported);
            }
        })
    }

    /// Reports keywords without their `#`.
    fn check_bare(&mut self, word: &str, span: Span, broken: &mut bool) {
        if matches!(word, "true" | "false" | "null" | "inf" | "-inf" | "nan") {
            self.lexer.error(
                span,
                format!("{word} needs a # before it"),
                &format!("write #{word}, or \"{word}\" for the text"),
            );
            *broken = true;
        }
    }

    fn starts_string(&self) -> bool {
        let rest = self.lexer.rest();
        match self.lexer.peek() {
            Some('"') => true,
            Some('#') => rest.trim_start_matches('#').starts_with('"'),
            Some(c) => is_word(c) && !starts_number(rest),
            None => false,
        }
    }

    /// Reports and skips KDL's `(type)`, which scene text has no use for, and the brackets of other formats.
    fn annotation(&mut self) -> bool {
        let start = self.lexer.at;
        let close = match self.lexer.peek() {
            Some('(') => ')',
            Some('[') => ']',
            _ => return false,
        };
        // Skips to the closing bracket, or to the end of the line or node.
        let rest = self.lexer.rest();
        match rest.find(|c| c == close || is_newline(c) || matches!(c, ';' | '{' | '}')) {
            Some(end) => self.lexer.at += end + if rest[end..].starts_with(close) { 1 } else { 0 },
            None => self.lexer.at += rest.len(),
        }
        let span = self.lexer.span_from(start);
        let open = if close == ')' { "( )" } else { "[ ]" };
        self.lexer.error(
            span,
            format!("scene text has no {open}"),
            "numbers stand with blanks between them: center 1 2 3",
        );
        true
    }

    /// Skips characters up to the next blank, line end, brace or semicolon.
    fn skip_token(&mut self) {
        let stop = |c: char| super::lexer::is_blank(c) || is_newline(c) || matches!(c, '{' | '}' | ';');
        if self.lexer.peek().is_some_and(|c| !stop(c)) {
            self.lexer.bump();
        }
        while self.lexer.peek().is_some_and(|c| !stop(c) && c != '"') && !self.lexer.looking_at("//") {
            self.lexer.bump();
        }
    }
}
