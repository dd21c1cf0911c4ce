//! What a world holds: geometries, instances and groups, their motion, and the closed parts of meshes.

pub(in crate::world) mod folds;
pub(in crate::world) mod geometry;
pub(in crate::world) mod group;
pub(in crate::world) mod instance;
pub(in crate::world) mod light_meshes;
pub(in crate::world) mod mesh_tree;
pub(in crate::world) mod motion;
pub(in crate::world) mod object_numbers;
pub(in crate::world) mod packet_bounds;
pub(in crate::world) mod shells;
