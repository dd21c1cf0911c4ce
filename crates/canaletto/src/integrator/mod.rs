//! Integrators: from a world to the colours of tiles.

mod counts;
mod first_hit;
mod measurement;
mod media;
mod path;
mod probe;
pub mod radiosity;
mod tile_integrator;
mod visible_hit;
pub(crate) mod whitted;
mod zbuffer;

pub use counts::{Counts, RayCount, RayCounts};
pub(crate) use first_hit::FirstHit;
pub use measurement::Measurement;
pub use path::{
    GuidedSample, Passage, PathChannel, PathDensities, PathEmitter, PathEnd, PathEvent, PathMeter, SampledSource,
    SourceSample,
};
pub(crate) use path::{GuidingField, GuidingRecord, GuidingRecorder, PathTracer, PreparedPath};
pub use probe::{EmittersTerm, LightTerm, Probe, RayKind};
pub use radiosity::ShownLight;
pub(crate) use radiosity::{BlendedLight, LightSource, PatchLight, PreparedRadiosity, Transport, blended};
pub(crate) use tile_integrator::{Cancelled, PreparedRayIntegrator, RayIntegrator, TileIntegrator, TileWorker};
pub use whitted::Whitted;
pub(crate) use zbuffer::{
    Item, ItemView, Zbuffer, ZbufferExplainer, omissions as omitted_by_zbuffer, sample_spacing as zbuffer_spacing,
};
pub use zbuffer::{RasterNode, RasterRival, RasterTriangle, RivalFate};
