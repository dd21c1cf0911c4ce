//! The files of a scene: reading them, and replacing `include` nodes by the nodes of the included file.

use super::nodes::INCLUDE;
use super::report::{Message, Report};
use super::syntax::{self, Node, Span};
use crate::assets::{Asset, AssetPath, Assets};
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

/// The largest size of a scene's text in bytes, all included files together.
pub const MAX_TEXT: usize = 256 << 20;
/// The largest number of files in a scene's text.
const MAX_FILES: usize = 10_000;
/// The largest depth of nested includes.
const MAX_INCLUDES: usize = 64;

/// A file of scene text.
pub(crate) struct File {
    /// The display name.
    pub(crate) name: String,
    /// The start of the relative paths in this file.
    pub(crate) path: AssetPath,
    pub(crate) text: Arc<str>,
    /// The byte offset at which each line ends.
    ends: OnceLock<Vec<u32>>,
}

/// The files of a scene, by number.
#[derive(Default)]
pub(crate) struct Files {
    list: Vec<File>,
    /// Whether some of the text couldn't be read, so that names that it defines may be missing.
    pub(crate) incomplete: bool,
}

impl Files {
    pub(crate) fn iter(&self) -> impl Iterator<Item = &File> {
        self.list.iter()
    }

    pub(crate) fn get(&self, file: u16) -> Option<&File> {
        self.list.get(usize::from(file))
    }

    /// The text of a span.
    pub(crate) fn slice(&self, span: Span) -> &str {
        self.get(span.file).and_then(|f| f.text.get(span.start as usize..span.end as usize)).unwrap_or_default()
    }

    /// A phrase that locates `first`, for a message at `second`, where the two exclude each other.
    pub(crate) fn first(&self, first: Span, second: Span) -> String {
        let line = self.line(first);
        if first.file != second.file {
            let name = self.get(first.file).map_or("another file", |file| &file.name);
            return format!("the first is on line {line} of {name}");
        }
        if line == self.line(second) {
            return "the first is on this line, too".into();
        }
        format!("the first is on line {line}")
    }

    /// The line of a span's start, from 1.
    fn line(&self, span: Span) -> usize {
        let Some(file) = self.get(span.file) else { return 1 };
        let ends = file.ends.get_or_init(|| file.text.match_indices('\n').map(|(at, _)| at as u32).collect());
        ends.partition_point(|end| *end < span.start) + 1
    }

    pub(crate) fn add(&mut self, name: String, path: AssetPath, text: Arc<str>) -> u16 {
        self.list.push(File { name, path, text, ends: OnceLock::new() });
        (self.list.len() - 1) as u16
    }
}

/// Reads a scene's files.
pub(crate) struct Loader<'a> {
    pub(crate) assets: &'a dyn Assets,
    pub(crate) files: Files,
    pub(crate) report: Report,
    /// The number of each file that was loaded, by its identity.
    seen: HashMap<PathBuf, u16>,
    /// The files being read, the outermost first.
    chain: Vec<u16>,
    size: usize,
    /// Whether nodes may be packed: no override changes their values.
    packs: bool,
}

impl<'a> Loader<'a> {
    pub(crate) fn new(assets: &'a dyn Assets, packs: bool) -> Loader<'a> {
        Loader {
            assets,
            packs,
            files: Files::default(),
            report: Report::default(),
            seen: HashMap::new(),
            chain: Vec::new(),
            size: 0,
        }
    }

    /// The nodes of a file, with the nodes of its included files in place. `includer` is the span of its name in the
    /// including file.
    pub(crate) fn load(&mut self, asset: Asset, includer: Option<Span>) -> Vec<Node> {
        let name = asset.path.name().to_owned();
        let incomplete = std::mem::replace(&mut self.files.incomplete, true);
        self.size = self.size.saturating_add(asset.bytes.len());
        if self.size > MAX_TEXT {
            let message = format!("the scene's text is more than {} MiB", MAX_TEXT >> 20);
            let file = self.files.add(name, asset.path, "".into());
            let span = includer.unwrap_or(Span { file, start: 0, end: 0 });
            self.report.push(Message::error(span, message).help(
                "large data belongs into files of its own: meshes (mesh file=…) and clouds (spheres file=…, cylinders \
                 file=…)",
            ));
            return Vec::new();
        }
        // UTF-16 has a byte-order mark, or zeros beside ASCII letters.
        if matches!(asset.bytes[..], [0xff, 0xfe, ..] | [0xfe, 0xff, ..] | [0, _, ..] | [_, 0, ..]) {
            let file = self.files.add(name, asset.path, "".into());
            let message = "the file is UTF-16 text, but scene text is UTF-8";
            self.report.push(Message::error(Span { file, start: 0, end: 0 }, message).help("save it as UTF-8"));
            return Vec::new();
        }
        let text = match String::from_utf8(asset.bytes) {
            Ok(text) => text,
            Err(error) => {
                let at = error.utf8_error().valid_up_to();
                let byte = error.as_bytes()[at];
                let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
                let file = self.files.add(name, asset.path, text.into());
                let span = Span { file, start: at as u32, end: at as u32 + 1 };
                self.report.push(
                    Message::error(span, format!("the file isn't UTF-8 text: byte {at} is 0x{byte:02x}"))
                        .help("save it as UTF-8"),
                );
                return Vec::new();
            }
        };
        // The text is in memory once, shared.
        let text: Arc<str> = text.into();
        let file = self.files.add(name, asset.path.clone(), Arc::clone(&text));
        self.files.incomplete = incomplete;
        self.seen.insert(asset.path.identity().to_owned(), file);
        self.load_text(&text, file)
    }

    /// The nodes of a text whose file is in the list already.
    pub(crate) fn load_text(&mut self, text: &str, file: u16) -> Vec<Node> {
        let Some(nodes) = syntax::parse(text, file, self.packs, &mut self.report) else {
            self.files.incomplete = true;
            return Vec::new();
        };
        if !nodes.iter().any(|node| *node.name == *INCLUDE.name) {
            return nodes;
        }
        self.chain.push(file);
        let mut out = Vec::with_capacity(nodes.len());
        for node in nodes {
            if *node.name == *INCLUDE.name { self.include(&node, &mut out) } else { out.push(node) }
        }
        self.chain.pop();
        out
    }

    fn include(&mut self, node: &Node, out: &mut Vec<Node>) {
        if node.broken {
            return;
        }
        let [value] = node.values.as_slice() else {
            let message = format!("include takes the name of a file, got {} values", node.values.len());
            self.report.push(Message::error(node.name_span, message).help("write include \"file.kdl\""));
            return;
        };
        if let Some(extra) = node.properties.first().map(|p| p.key_span).or(node.children.first().map(|c| c.name_span))
        {
            self.report.error(extra, "include takes nothing but the name of a file");
        }
        let Some(path) = value.as_text() else {
            self.report.push(
                Message::error(value.span, "include takes the name of a file").help("write include \"file.kdl\""),
            );
            return;
        };
        let from = self.files.get(value.span.file).map(|f| f.path.clone()).unwrap_or_default();
        match self.assets.read(path, &from) {
            Err(error) => {
                self.files.incomplete = true;
                let message = Message::error(value.span, error.to_string());
                self.report.push(match error.help() {
                    Some(help) => message.help(help),
                    None => message,
                });
            }
            Ok(asset) => match self.seen.get(asset.path.identity()) {
                Some(file) if self.chain.contains(file) => {
                    let start = self.chain.iter().position(|f| f == file).unwrap_or(0);
                    let names: Vec<&str> = self.chain[start..]
                        .iter()
                        .chain([file])
                        .filter_map(|f| self.files.get(*f))
                        .map(|f| f.name.as_str())
                        .collect();
                    let chain = names.join(" includes ");
                    self.files.incomplete = true;
                    self.report
                        .push(Message::error(value.span, "the files include each other in a circle").label(chain));
                }
                // The file was included already, so its names exist.
                Some(_) => {}
                None if self.chain.len() >= MAX_INCLUDES || self.files.list.len() >= MAX_FILES => {
                    let message = format!("files may include each other {MAX_INCLUDES} deep, {MAX_FILES} in all");
                    self.report.error(value.span, message);
                }
                None => {
                    let nodes = self.load(asset, Some(value.span));
                    out.extend(nodes);
                }
            },
        }
    }
}
