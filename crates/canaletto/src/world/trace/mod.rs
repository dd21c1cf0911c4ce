//! What is asked of a world: hits, shadows, surfaces, textures, and the objects behind them.

pub(in crate::world) mod batch_query;
pub(in crate::world) mod box_filter;
pub(in crate::world) mod bundle;
pub(in crate::world) mod bundle_tree;
pub(in crate::world) mod contact;
pub(in crate::world) mod edges;
pub(in crate::world) mod emitting;
pub(in crate::world) mod facets;
pub(in crate::world) mod flat_objects;
pub(in crate::world) mod geometry_probe;
pub(in crate::world) mod object_surface;
pub(in crate::world) mod occlusion;
pub(in crate::world) mod placed;
pub(in crate::world) mod query;
pub(in crate::world) mod rays;
pub(in crate::world) mod shadow;
pub(in crate::world) mod shape_list;
pub(in crate::world) mod textured;
pub(in crate::world) mod visible_lights;
