//! KDL 2 parsed to a tree in which every value has its span.
//!
//! The parser follows the specification (<https://kdl.dev/spec/>). The `kdl` crate (6.7) isn't fit for hostile files:
//!
//! - Nesting overflows its stack.
//! - Nested commented-out blocks (`a /- {a /- {…`) take time exponential in their number: 44 s for 20 of them in 140
//!   bytes.
//! - 100,000 spheres take seconds.
//! - Its messages use the terms of its grammar.
//!
//! This parser doesn't recurse, takes time linear in the file's size, and continues after a mistake. A test compares it
//! with the crate. It reads all valid documents of the specification's test suite alike, except that type annotations
//! are errors, since scene text has no use for them. It accepts two placements of `/-` that the specification forbids.

mod lexer;
mod number;
mod parser;
mod string;
mod tree;

pub(crate) use parser::{MAX_DEPTH, MAX_ITEMS, parse, parse_entries, unpack};
pub(crate) use tree::{Node, Property, Span, Value, ValueKind};

#[cfg(test)]
mod tests;
