//! The error of values that are out of their range.

use std::fmt;

/// A value that is out of its range. Its sentence names the field, its value and the range.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutOfRange {
    /// The field with the value, by its name in scene text. None if no single field is at fault.
    pub field: Option<&'static str>,
    /// The rest of the sentence after the field's name; the whole sentence without a field.
    pub problem: String,
}

impl OutOfRange {
    /// The error of a field. `problem` continues the sentence that starts with the field's name.
    pub fn new(field: &'static str, problem: impl Into<String>) -> OutOfRange {
        OutOfRange { field: Some(field), problem: problem.into() }
    }

    /// The error of a whole, in a sentence of its own.
    pub fn whole(sentence: impl Into<String>) -> OutOfRange {
        OutOfRange { field: None, problem: sentence.into() }
    }
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.field {
            Some(field) => write!(f, "{field} {}", self.problem),
            None => f.write_str(&self.problem),
        }
    }
}

impl std::error::Error for OutOfRange {}
