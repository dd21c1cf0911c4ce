//! The material libraries of an OBJ file: `mtllib` and `usemtl`.
//!
//! The text after `mtllib` isn't always a valid path. It may be quoted, have the backslashes of Windows, or be absolute
//! on the machine where it was written. It may be several names, each of which may contain spaces. If a name leads
//! nowhere, its last component is searched for beside the OBJ file, also in upper or lower case. A library that isn't
//! read exactly as named causes a warning.

use super::super::encoding;
use super::super::ignored::Ignored;
use super::super::lines::Token;
use super::super::{attach_source, mtl, unreadable};
use super::Reader;
use crate::assets::{AssetError, OpenAsset};
use crate::diagnostic::{Diagnostic, Diagnostics};
use canaletto::material::Material;
use std::collections::HashMap;

/// The largest number of library names that are read.
const MAX_NAMES: usize = 256;

impl Reader<'_> {
    /// Reads the materials of all `mtllib` lines, given by the offset and text of their names. A missing library is a
    /// warning.
    pub(super) fn libraries(&mut self, lines: &[(usize, Vec<u8>)]) {
        let names: Vec<Token<'_>> = lines
            .iter()
            .flat_map(|(start, text)| self.names(Token { start: *start, text }))
            .take(MAX_NAMES + 1)
            .collect();
        for (index, name) in names.iter().enumerate() {
            if index == MAX_NAMES {
                let message =
                    format!("more than {MAX_NAMES} names of material files stand in it; this and others are left out");
                self.warnings.push(Diagnostic::warning(self.asset.path.name(), message).at(name.span()));
                break;
            }
            self.library(name);
        }
        self.count_pictures_left_out();
    }

    /// The names of a line, split such that most of them exist, if possible at their own path.
    fn names<'w>(&self, line: Token<'w>) -> Vec<Token<'w>> {
        if line.text.is_empty() {
            return Vec::new();
        }
        let mut ways = [vec![line], by_extension(line), by_space(line)];
        ways.iter_mut().for_each(|way| way.truncate(MAX_NAMES + 1));
        let found = |there: &dyn Fn(&str) -> bool| {
            let counts = ways.iter().map(|way| way.iter().filter(|name| there(&path(name))).count());
            let best = counts.enumerate().rev().max_by_key(|(_, count)| *count);
            best.filter(|(_, count)| *count > 0).map(|(way, _)| way)
        };
        let named = found(&|path| self.open(path).is_ok());
        let best = named.or_else(|| found(&|path| self.beside(path).is_ok())).unwrap_or(0);
        std::mem::take(&mut ways[best])
    }

    fn library(&mut self, name: &Token<'_>) {
        let path = path(name);
        match self.open(&path).map_err(|error| (error, self.beside(&path))) {
            Ok(asset) => {
                if is_quoted(&name.string()) {
                    let message = format!("mtllib: {} is read without its quotes", name.string());
                    self.warnings.push(Diagnostic::warning(self.asset.path.name(), message).at(name.span()));
                }
                self.read(&asset);
            }
            Err((error, Ok(asset))) => {
                let help = format!("\"{}\", which lies beside the model, is read instead", asset.path.name());
                self.warnings.push(self.not_as_named(name, &error).help(help));
                self.read(&asset);
            }
            Err((error, Err(_))) => {
                let mut warning = self.not_as_named(name, &error);
                warning.help = error.help();
                warning.label = "its materials are left out".into();
                self.warnings.push(warning);
            }
        }
    }

    fn open(&self, path: &str) -> Result<OpenAsset, AssetError> {
        self.assets.open(path, &self.asset.path)
    }

    /// The file of that name beside the model, regardless of letter case.
    fn beside(&self, path: &str) -> Result<OpenAsset, AssetError> {
        let last = last_part(path);
        self.open(last).or_else(|error| match &error {
            AssetError::Missing { nearest: Some(near), .. } if near.eq_ignore_ascii_case(last) => self.open(near),
            _ => Err(error),
        })
    }

    fn not_as_named(&self, name: &Token<'_>, error: &AssetError) -> Diagnostic {
        Diagnostic::warning(self.asset.path.name(), error.to_string()).at(name.span())
    }

    fn read(&mut self, library: &OpenAsset) {
        if !self.read.insert(library.path.identity().to_owned()) {
            return;
        }
        let name = library.path.name();
        let bytes = match library.content.view().whole() {
            Ok(bytes) => bytes,
            Err(error) => return self.warnings.push(unreadable(&error).warning(name)),
        };
        let text = encoding::text(&bytes);
        let mut warnings = Diagnostics::new();
        for described in mtl::read(name, &text, &mut warnings) {
            let material = self.with_pictures(described, library, &mut warnings);
            self.materials.push(material);
        }
        attach_source(&mut warnings, name, text[..].into());
        self.warnings.append(warnings);
    }
}

/// The path of a name, without quotes and with forward slashes.
fn path(name: &Token<'_>) -> String {
    path_of(&name.string())
}

/// The path of a name as written.
pub(super) fn path_of(text: &str) -> String {
    let text = unquoted(text).unwrap_or(text);
    // A backslash before a space is part of the escaped space.
    text.replace("\\ ", " ").replace('\\', "/")
}

/// The text between quotes.
fn unquoted(text: &str) -> Option<&str> {
    ['"', '\''].iter().find_map(|quote| text.strip_prefix(*quote)?.strip_suffix(*quote))
}

fn is_quoted(text: &str) -> bool {
    unquoted(text).is_some()
}

/// The text after the last folder or drive of a path.
pub(super) fn last_part(path: &str) -> &str {
    path.rsplit(['/', ':']).next().unwrap_or(path).trim()
}

/// Names that end with the extension of a library and may contain spaces.
fn by_extension(names: Token<'_>) -> Vec<Token<'_>> {
    let ends = |word: &Token<'_>| {
        let text = word.text.strip_suffix(b"\"").or_else(|| word.text.strip_suffix(b"'")).unwrap_or(word.text);
        text.len() > 4 && text[text.len() - 4..].eq_ignore_ascii_case(b".mtl")
    };
    whole(names, ends)
}

/// Names separated by spaces, except spaces after a backslash or in quotes.
fn by_space(names: Token<'_>) -> Vec<Token<'_>> {
    let mut quote = None;
    let ends = |word: &Token<'_>| {
        if quote.is_none() {
            quote = word.text.first().copied().filter(|byte| matches!(byte, b'"' | b'\''));
        }
        if quote.is_some() && word.text.last().copied() != quote {
            return false;
        }
        quote = None;
        !word.text.ends_with(b"\\")
    };
    whole(names, ends)
}

/// Names of one or more words, each of which ends with a word for which `ends` is true.
fn whole<'a>(names: Token<'a>, mut ends: impl FnMut(&Token<'a>) -> bool) -> Vec<Token<'a>> {
    let mut out: Vec<Token<'a>> = Vec::new();
    let mut open = false;
    for word in names.words().take_while(|word| !word.text.starts_with(b"#")) {
        match out.last_mut().filter(|_| open) {
            Some(name) => name.text = &names.text[name.start - names.start..word.span().end - names.start],
            None => out.push(word),
        }
        open = !ends(&word);
    }
    out
}

/// Materials by the names in the files.
pub(super) struct Names {
    exact: HashMap<String, u32>,
    /// The materials by [`loose`] name; `None` if several share it.
    loose: HashMap<String, Option<u32>>,
}

impl Names {
    /// The first of several materials with equal names is used.
    pub(super) fn new(materials: &[Material]) -> Names {
        let mut names = Names { exact: HashMap::new(), loose: HashMap::new() };
        for (index, material) in materials.iter().enumerate() {
            if names.exact.contains_key(&material.name) {
                continue;
            }
            names.exact.insert(material.name.clone(), index as u32);
            names.loose.entry(loose(&material.name)).and_modify(|one| *one = None).or_insert(Some(index as u32));
        }
        names
    }

    /// The material that a word names.
    pub(super) fn find(&self, word: &Token<'_>, unknown: &mut Ignored) -> Option<u32> {
        let name = word.string();
        if let Some(index) = self.exact.get(&name) {
            return Some(*index);
        }
        if name.is_empty() {
            return None;
        }
        let found = self.loose.get(&loose(&name)).copied().flatten();
        unknown.note(
            word,
            match found {
                Some(_) => "is the name of a material but for capitals, quotes or a comment, and is taken for it",
                None => "is no material of this file; its faces get the default",
            },
        );
        found
    }
}

/// A name without the parts that programs change: capitals, quotes, a comment after it.
fn loose(name: &str) -> String {
    let name = name.split(" #").next().unwrap_or_default();
    name.trim_matches(|c: char| c.is_whitespace() || c == '"').to_lowercase()
}
