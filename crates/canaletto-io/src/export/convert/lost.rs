//! What a format can't say of a scene.

use serde::Serialize;
use std::collections::HashSet;

/// Things of one kind that a conversion leaves out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Loss {
    /// What they are, in plural.
    pub what: String,
    /// The names of what lost them: objects, materials or others. Empty if the whole scene did.
    pub names: Vec<String>,
}

/// All that a conversion leaves out so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Lost {
    pub(super) all: Vec<Loss>,
    /// The names of each kind of thing.
    known: Vec<HashSet<String>>,
}

impl Lost {
    /// Notes that something is left out of what has this name. It is told once for each name.
    pub(super) fn add(&mut self, what: &str, name: &str) {
        let kind = self.kind(what);
        if self.known[kind].insert(name.to_owned()) {
            self.all[kind].names.push(name.to_owned());
        }
    }

    /// Notes that something is left out of the whole scene.
    pub(super) fn of_scene(&mut self, what: &str) {
        self.kind(what);
    }

    /// The number of a kind of thing.
    fn kind(&mut self, what: &str) -> usize {
        self.all.iter().position(|loss| loss.what == what).unwrap_or_else(|| {
            self.all.push(Loss { what: what.to_owned(), names: Vec::new() });
            self.known.push(HashSet::new());
            self.all.len() - 1
        })
    }
}

/// One line: what, how many, and the first names.
impl std::fmt::Display for Loss {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        /// The most names that are told.
        const MOST: usize = 5;
        f.write_str(&self.what)?;
        if self.names.is_empty() {
            return Ok(());
        }
        let mut shown: Vec<String> = self.names.iter().take(MOST).map(|name| format!("\"{name}\"")).collect();
        if self.names.len() > MOST {
            shown.push(format!("{} more", self.names.len() - MOST));
        }
        write!(f, " ({}): {}", self.names.len(), shown.join(", "))
    }
}
