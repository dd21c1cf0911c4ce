//! Where a growing picture is, so that a render that ended at any moment can be taken up.

use super::SampleBlocks;

/// The samples of a growing picture at a moment, and the pass in which they were made. A render that goes on from it
/// makes the bytes of one that was never ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// The samples so far. Pixels may have different numbers of them.
    pub samples: SampleBlocks,
    /// The pass in work; none before the first.
    pub pass: Option<Pass>,
}

/// A pass of samples over the pixels of a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pass {
    /// The number of samples of the pixels that need more, before the pass.
    pub begin: u32,
    /// Their number after it.
    pub end: u32,
    /// Whether each cell of 8 × 8 pixels needs more samples, in rows from the upper left; empty if all do.
    pub needed: Vec<bool>,
}

impl From<SampleBlocks> for Checkpoint {
    fn from(samples: SampleBlocks) -> Checkpoint {
        Checkpoint { samples, pass: None }
    }
}
