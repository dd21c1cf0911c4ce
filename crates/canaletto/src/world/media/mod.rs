//! Clear bodies: which of them a point is in, and where they touch others.

pub(in crate::world) mod body;
pub(in crate::world) mod solids;
pub(in crate::world) mod zones;
