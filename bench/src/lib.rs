//! Benchmarks and comparisons.

pub mod peers;
pub mod say;
