//! Shared helpers of the test crates.
