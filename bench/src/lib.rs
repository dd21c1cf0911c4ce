//! Benchmarks and comparisons.

pub mod peers;
