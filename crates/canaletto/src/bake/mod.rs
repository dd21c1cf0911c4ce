//! Light maps: a radiosity solution as a texture over all surfaces, for programs that draw triangles.
//!
//! - `boundary` gives neighbouring roots common vertices, and `chart` lays roots side by side in planes.
//! - `layout` places the charts in one atlas. `pack` finds the places.
//! - `texels` evaluates light and materials, and `fill` colours texels without a surface.
//! - `mesh` makes the triangles with their texture coordinates, and `left_out` names objects that have none.
//!
//! Each side of a surface has its own triangles, which show it from that side only. What other bodies cover has none.
//! Sides that no light reaches have none either, unless the settings ask for them.

mod boundary;
mod chart;
mod fill;
mod layout;
mod left_out;
mod mesh;
mod pack;
#[cfg(test)]
mod tests;
mod texels;

pub use layout::TexelDensity;
pub use left_out::{LeftOut, LeftOutReason};
pub use mesh::{BakedMesh, BakedPart, BakedVertex};

use crate::OutOfRange;
use crate::integrator::radiosity::{RadiosityError, RadiositySolution, SolvedRoot};
use crate::job::Observer;
use crate::material::MaterialPoint;
use crate::scene::RadiositySettings;
use crate::world::{Hit, World};
use boundary::Boundaries;
use canaletto_bvh::{NoThreads, with_stack};
use canaletto_parallel::prelude::*;

/// Settings of a light map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BakeSettings {
    /// How many texels stand for a length.
    pub density: TexelDensity,
    /// Whether sides of surfaces that no light reaches have triangles. Without them, programs that draw no back faces
    /// look through the walls of a room from outside.
    pub dark_sides: bool,
}

/// The charts of all surfaces in one picture. The top row of texels comes first.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Atlas {
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// The light that arrives, as the radiance of a white surface. Irradiance is π times this.
    pub light: Vec<[f32; 3]>,
    /// The radiance that leaves the surface: what it emits, and the light times its diffuse colour.
    pub radiance: Vec<[f32; 3]>,
    /// The diffuse colour, and the share of crossing light that the surface blocks.
    pub reflectance: Vec<[f32; 4]>,
    /// Whether a surface is at the texel. Others have colours of texels around them.
    pub known: Vec<bool>,
}

impl Atlas {
    /// The smallest side.
    pub const MIN_SIDE: u32 = 64;
    /// The largest side, which WebGL promises on most devices.
    pub const MAX_SIDE: u32 = 8192;
    /// The most bytes of memory that a texel takes while an atlas is made.
    pub const TEXEL_BYTES: u64 = 160;
}

/// A scene with its light in textures.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct BakedScene {
    /// The triangles, by object.
    pub meshes: Vec<BakedMesh>,
    /// The light map.
    pub atlas: Atlas,
    /// The number of charts.
    pub charts: usize,
    /// The number of texels for each unit of length.
    pub texels_per_unit: f64,
    /// Whether patches are smaller than [`TexelDensity::ByPatches`] expects, since more texels don't fit.
    pub is_coarse: bool,
    /// Whether there are infinite planes, of which only the part near other surfaces is baked.
    pub has_clipped_planes: bool,
    /// The objects that have no triangles, by the reason.
    pub left_out: Vec<LeftOut>,
}

/// The reason why a light map can't be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BakeError {
    /// A setting is out of range.
    #[error(transparent)]
    Range(#[from] OutOfRange),
    /// The texels don't fit.
    #[error(
        "{texels_per_unit} texels per unit don't fit into a light map of {side} x {side}; at most {most:.4} do",
        side = Atlas::MAX_SIDE
    )]
    TooManyTexels {
        /// The wanted number of texels for each unit of length.
        texels_per_unit: f64,
        /// The number that fits.
        most: f64,
    },
    /// The charts don't fit, however few texels each has.
    #[error("the surfaces need {charts} charts, which don't fit into a light map of {side} x {side}")]
    TooManyCharts {
        /// The number of charts.
        charts: usize,
        /// The side of the atlas.
        side: u32,
    },
    /// The solution isn't one of the world with the settings.
    #[error("the solution is that of another scene, or of other settings of radiosity")]
    OtherSolution,
    /// The surfaces can't be divided into patches.
    #[error(transparent)]
    Radiosity(#[from] RadiosityError),
    /// No light arrives at any surface.
    #[error("no light arrives at any surface")]
    Dark,
    /// The hierarchy over vertices can't be built.
    #[error("the scene is too large for a light map: {0}")]
    Hierarchy(String),
    /// The observer cancelled.
    #[error("baking was cancelled")]
    Cancelled,
    /// Threads with enough stack can't be started.
    #[error(transparent)]
    NoThreads(#[from] NoThreads),
}

/// The stack in bytes that looking up a surface needs, and for each group around it.
const STACK: usize = 256 << 10;
const STACK_OF_GROUP: usize = 16 << 10;

impl BakedScene {
    /// Makes the light map of a world's solution, which was found with the settings `radiosity`. The result depends on
    /// its arguments only: any number of threads gives equal bits.
    ///
    /// # Errors
    /// [`BakeError`] names the reason.
    pub fn bake(
        world: &World,
        (solution, radiosity): (&RadiositySolution, &RadiositySettings),
        settings: &BakeSettings,
        observer: &dyn Observer,
    ) -> Result<BakedScene, BakeError> {
        with_stack(STACK + STACK_OF_GROUP * world.most_groups(), || {
            let roots = SolvedRoot::all(world, radiosity, solution)?.ok_or(BakeError::OtherSolution)?;
            baked(world, solution, &roots, settings, observer)
        })?
    }
}

fn baked(
    world: &World,
    solution: &RadiositySolution,
    roots: &[SolvedRoot],
    settings: &BakeSettings,
    observer: &dyn Observer,
) -> Result<BakedScene, BakeError> {
    let boundaries = Boundaries::new(roots).map_err(|problem| BakeError::Hierarchy(problem.to_string()))?;
    let constant: Vec<Option<MaterialPoint>> =
        roots.par_iter().map(|root| texels::constant_material(world, root)).collect();
    let mut charts = chart::charts(roots, &boundaries);
    for chart in &mut charts {
        let is_dark = |&number: &u32| {
            let root = &roots[number as usize];
            constant[number as usize].is_some_and(|at| at.emitted(root.is_outer()).is_black()) && solution.is_dark(root)
        };
        chart.is_dark = chart.roots.iter().all(is_dark);
    }
    charts.retain(|chart| settings.dark_sides || !chart.is_dark);
    if charts.is_empty() {
        return Err(BakeError::Dark);
    }
    if observer.cancelled() {
        return Err(BakeError::Cancelled);
    }
    let layout = layout::layout(&charts, solution, settings.density)?;
    let texel = if layout.texels_per_unit > 0.0 { 1.0 / layout.texels_per_unit } else { 0.0 };
    let shading = texels::Shading { world, solution, roots, constant, texel };
    let atlas = texels::atlas(&shading, &charts, &layout, observer)?;
    let baked_roots = || charts.iter().flat_map(|chart| chart.roots.iter().copied());
    let meshes = mesh::meshes(world, roots, &boundaries, &charts, &layout, &shading.constant);
    Ok(BakedScene {
        meshes,
        atlas,
        charts: charts.len(),
        texels_per_unit: layout.texels_per_unit,
        is_coarse: layout.is_coarse,
        has_clipped_planes: baked_roots().any(|number| roots[number as usize].instance() == Hit::UNBOUNDED),
        left_out: left_out::left_out(world, roots, baked_roots()),
    })
}
