//! The reasons why a world can't be built.

use super::World;
use canaletto_bvh::NoThreads;

/// The reason why a scene can't be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A number is out of range.
    #[error("{object}: {problem}")]
    Invalid {
        /// The name of the object, light or material.
        object: String,
        /// The problem and the expected value.
        problem: String,
    },
    /// An index refers to nothing.
    #[error("{object} refers to {what} number {index}, but the scene has only {count}")]
    Missing {
        /// The node with the reference.
        object: String,
        /// The kind of the reference: "material", "mesh", …
        what: &'static str,
        /// The index.
        index: u32,
        /// The number of such items in the scene.
        count: usize,
    },
    /// A prototype contains itself.
    #[error("{0} contains an instance of itself")]
    Cycle(String),
    /// There are more instances that are kept one by one than [`World::MAX_INSTANCES`].
    #[error("the scene expands to more than {max} instances", max = World::MAX_INSTANCES)]
    TooManyInstances,
    /// There are more nested copies than [`World::MAX_COPIES`].
    #[error("{0} expands to more than {max} copies", max = World::MAX_COPIES)]
    TooManyCopies(String),
    /// There are more light points and shining triangles than [`World::MAX_LIGHT_POINTS`], counted once for each copy
    /// of a light.
    #[error(
        "the scene expands to more than {max} points of light and triangles that shine",
        max = World::MAX_LIGHT_POINTS
    )]
    TooManyLights,
    /// There are more moving instances than [`World::MAX_MOVING`].
    #[error(
        "the scene expands to more than {max} objects that move while the shutter is open",
        max = World::MAX_MOVING
    )]
    TooManyMoving,
    /// There are more shapes without bounds than [`World::MAX_UNBOUNDED`]. Every ray is tested with each of them.
    #[error("the scene expands to more than {max} planes", max = World::MAX_UNBOUNDED)]
    TooManyPlanes,
    /// Groups and instances are nested deeper than [`World::MAX_NESTING`].
    #[error("groups and instances are nested more than {max} deep", max = World::MAX_NESTING)]
    TooDeep,
    /// A hierarchy can't be built.
    #[error("{object}: {problem}")]
    Hierarchy {
        /// The name of the geometry.
        object: String,
        /// The builder's error.
        problem: String,
    },
    /// Building needs threads that can't be started.
    #[error(transparent)]
    NoThreads(#[from] NoThreads),
}

/// The error of a hierarchy that can't be built over an object.
pub(in crate::world) fn hierarchy_error(object: &str, error: &canaletto_bvh::BuildError) -> BuildError {
    BuildError::Hierarchy { object: object.into(), problem: error.to_string() }
}
