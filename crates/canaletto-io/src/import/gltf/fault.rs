//! What is wrong with a document, and the place in it.

use crate::diagnostic::Diagnostic;
use serde_path_to_error::{Path, Segment};
use std::fmt::Display;

/// A sentence about a place in a document.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    /// The place as a JSON pointer (RFC 6901): `/meshes/2/primitives/0`. Empty for the whole file.
    pointer: String,
    message: String,
    help: Option<String>,
}

impl Fault {
    /// A fault of what [`Fault::at`] names.
    pub(super) fn new(message: impl Into<String>) -> Fault {
        Fault { pointer: String::new(), message: message.into(), help: None }
    }

    /// An error that has a hint or none.
    pub(super) fn of(error: &impl Display, help: Option<impl Into<String>>) -> Fault {
        Fault { help: help.map(Into::into), ..Fault::new(error.to_string()) }
    }

    /// Sets the hint.
    pub(super) fn help(mut self, help: impl Into<String>) -> Fault {
        self.help = Some(help.into());
        self
    }

    /// Sets the hint, unless there is one.
    pub(super) fn help_or(self, help: &str) -> Fault {
        if self.help.is_some() { self } else { self.help(help) }
    }

    /// Puts the fault below a place, which begins with `/`.
    pub(super) fn at(mut self, place: impl AsRef<str>) -> Fault {
        self.pointer.insert_str(0, place.as_ref());
        self
    }

    /// Puts the fault at a place, unless it has one.
    pub(super) fn at_if_bare(self, place: &str) -> Fault {
        if self.pointer.is_empty() { self.at(place) } else { self }
    }

    /// Puts the fault below a place, unless its own is that of another list of the document.
    pub(super) fn at_if_relative(self, place: &str) -> Fault {
        const LISTS: [&str; 10] = [
            "/accessors/",
            "/bufferViews/",
            "/buffers/",
            "/cameras/",
            "/extensions/KHR_lights_punctual/lights/",
            "/images/",
            "/materials/",
            "/meshes/",
            "/skins/",
            "/textures/",
        ];
        if LISTS.iter().any(|list| self.pointer.starts_with(list)) { self } else { self.at(place) }
    }

    /// The fault that an index names nothing.
    pub(super) fn missing(what: &str, index: u32, count: usize) -> Fault {
        Fault::new(format!("{what} {index} doesn't exist; there are {count}, counted from 0"))
    }

    /// The fault of JSON that doesn't follow the schema.
    pub(super) fn of_json(error: &serde_path_to_error::Error<serde_json::Error>) -> Fault {
        let inner = error.inner();
        let message = match inner.classify() {
            serde_json::error::Category::Eof => "the JSON ends too early".to_owned(),
            _ => inner.to_string(),
        };
        Fault::new(message).at(pointer(error.path()))
    }

    /// The place as a JSON pointer; empty for the whole file.
    pub(super) fn pointer(&self) -> &str {
        &self.pointer
    }

    fn text(&self) -> String {
        match self.pointer.is_empty() {
            true => self.message.clone(),
            false => format!("{}: {}", self.pointer, self.message),
        }
    }

    /// The fault as an error of a file.
    pub(super) fn error(self, file: &str) -> Diagnostic {
        let mut diagnostic = Diagnostic::error(file, self.text());
        diagnostic.help = self.help;
        diagnostic
    }

    /// The fault as a warning about a file.
    pub(super) fn warning(self, file: &str) -> Diagnostic {
        let mut diagnostic = Diagnostic::warning(file, self.text());
        diagnostic.help = self.help;
        diagnostic
    }
}

fn pointer(path: &Path) -> String {
    let step = |segment: &Segment| match segment {
        Segment::Seq { index } => format!("/{index}"),
        Segment::Map { key } => format!("/{}", key.replace('~', "~0").replace('/', "~1")),
        Segment::Enum { .. } | Segment::Unknown => String::new(),
    };
    path.iter().map(step).collect()
}

/// The element of a list that an index names.
pub(super) fn named<'a, T>(list: &'a [T], index: u32, what: &str) -> Result<&'a T, Fault> {
    list.get(index as usize).ok_or_else(|| Fault::missing(what, index, list.len()))
}
