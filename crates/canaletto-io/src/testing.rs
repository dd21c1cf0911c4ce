//! Helpers of unit tests.

use proptest::prelude::ProptestConfig;
use proptest::test_runner::RngSeed;

/// The settings of a property test with an explicit seed, so that every run tries the same values.
pub(crate) fn seeded() -> ProptestConfig {
    ProptestConfig { rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() }
}
