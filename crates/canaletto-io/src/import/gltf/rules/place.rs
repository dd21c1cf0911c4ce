//! Places in a document, which cost nothing until one is told.

use std::fmt;

/// A place as the way to it.
#[derive(Clone, Copy, Debug)]
pub(super) enum Place<'p> {
    Root,
    Key(&'p Place<'p>, &'p str),
    Item(&'p Place<'p>, usize),
}

impl<'p> Place<'p> {
    /// The place of a property.
    pub(super) fn key(&'p self, name: &'p str) -> Place<'p> {
        Place::Key(self, name)
    }

    /// The place of an element of a list.
    pub(super) fn item(&'p self, index: usize) -> Place<'p> {
        Place::Item(self, index)
    }
}

/// A JSON pointer (RFC 6901).
impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Root => Ok(()),
            Place::Key(above, name) => write!(f, "{above}/{}", name.replace('~', "~0").replace('/', "~1")),
            Place::Item(above, index) => write!(f, "{above}/{index}"),
        }
    }
}
