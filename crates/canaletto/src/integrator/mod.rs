//! Integrators: from a world to the colours of tiles.

pub(crate) mod camera_rays;
mod counts;
mod description;
mod first_hit;
mod job_check;
mod measurement;
mod media;
mod omission;
mod path;
mod prepared;
mod probe;
pub mod radiosity;
pub(crate) mod shading;
mod state_file;
mod task_queue;
mod visible_hit;
pub(crate) mod whitted;
mod zbuffer;

pub use counts::{Counts, RayCount, RayCounts};
pub(crate) use description::preparable;
pub use description::{ChangedSettings, Description, describe, layers_of};
pub(crate) use first_hit::FirstHit;
pub(crate) use job_check::BLUE_NOISE;
pub use measurement::Measurement;
pub use omission::{Omission, omissions};
pub use path::{
    GuidedSample, GuidingField, Passage, PathChannel, PathDensities, PathEmitter, PathEnd, PathEvent, PathMeter,
    SampledSource, SourceSample,
};
pub(crate) use path::{PathTracer, PreparedPath, learn_field};
pub(crate) use prepared::{
    Cancelled, IntegratorWorker, PreparedIntegrator, PreparedRayIntegrator, RayIntegrator, TileBlock,
};
pub use prepared::{HearsGuiding, Preparation};
pub use probe::{EmittersTerm, LightTerm, Probe, RayKind};
pub use radiosity::ShownLight;
pub(crate) use radiosity::{BlendedLight, LightSource, PatchLight, PreparedRadiosity, Transport, blended};
pub use state_file::StateFileError;
pub(crate) use task_queue::TaskQueue;
pub use whitted::Whitted;
pub use zbuffer::{RasterNode, RasterRival, RasterTriangle, RivalFate};

/// What the preparation of an integrator takes besides the world, and gives back before the picture is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PreparationMemory {
    /// The bytes.
    pub bytes: u64,
    /// Whether it may take less, as radiosity does: its patches aren't known before they are found.
    pub at_most: bool,
}
