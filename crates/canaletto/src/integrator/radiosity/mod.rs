//! Radiosity: diffuse light by the balance of energies (chapter 5.7; Goral et al. 1984).
//!
//! The radiance B of each patch is what it emits, and the share ρ that it reflects of the light that arrives from
//! lights, D, and from all other patches: B = E + ρ (D + Σ F B). The form factor F is the share of a patch's view that
//! another patch fills. All light is counted as radiance, so that a white surface in light of radiance 1 has 1.
//!
//! - `root` and `mesh` make patches of all shapes. Patches that touching bodies cover in part are split first.
//! - `exchange` finds form factors: exact contours times the visibility of rays. `sources` finds D.
//! - `hierarchical` refines `link`s between nodes of the mesh, and `balance` solves the equations over them.
//! - `emitters` are the lights of the second pass. Their straight light is kept apart from other light of patches.
//! - `local_pass` finds the light at the vertices of patches, which `interpolation` spreads over them.
//! - `shooting` and `full` solve them on a mesh of equal patches.
//! - `file` writes and reads solutions, and `fingerprint` tells whether one still belongs to a scene.
//!
//! Deviations: moving objects stay where they are when the shutter opens. Materials count by their diffuse colour
//! alone. Clear surfaces let light pass straight through, as shadow rays do.

mod balance;
mod cluster;
mod cuts;
mod description;
mod emitters;
mod exchange;
mod file;
mod fingerprint;
mod full;
mod gathering;
mod hierarchical;
mod interpolation;
mod link;
mod local_pass;
mod mesh;
mod meter;
mod outline;
mod root;
mod second_pass;
mod shooting;
mod solution;
mod solved_root;
mod sources;
#[cfg(test)]
mod tests;
mod transport;

pub use fingerprint::{ChangedInputs, SolutionFingerprint, SolutionInput};
pub(crate) use interpolation::{BlendedLight, blended};
pub use meter::RadiosityMeter;
pub(crate) use second_pass::PreparedRadiosity;
pub use second_pass::ShownLight;
pub use shooting::{ShootingStep, ShootingWatcher};
pub use solution::{ArrivingLight, Patch, RadiositySolution};
pub(crate) use solved_root::SolvedRoot;
pub(crate) use transport::{LightSource, PatchLight, Transport};

use crate::OutOfRange;
use crate::job::{JobError, Observer, SolvingPhase, SolvingProgress};
use crate::scene::{RadiosityMethod, RadiositySettings};
use crate::world::World;
use balance::Light;
use canaletto_bvh::{NoThreads, with_stack};
use gathering::Gathering;
use hierarchical::Given;
use mesh::PatchMesh;

/// The reason why there is no solution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RadiosityError {
    /// A setting is out of range.
    #[error(transparent)]
    Range(#[from] OutOfRange),
    /// A material reflects more light than arrives.
    #[error("material \"{material}\" reflects {} of the light; radiosity needs a kd of at most 1", *.reflectance as f32)]
    Reflectance {
        /// The material's name.
        material: String,
        /// Its largest diffuse reflectance.
        reflectance: f64,
    },
    /// Light grows from bounce to bounce without end.
    #[error(
        "the light has no end: material \"{material}\" reflects {} of it in a closed room; a smaller kd helps",
        *.reflectance as f32
    )]
    Endless {
        /// The material that absorbs least.
        material: String,
        /// Its largest diffuse reflectance.
        reflectance: f64,
    },
    /// Nothing gives light.
    #[error(
        "nothing gives light: radiosity needs a light, a material with an emission or an environment; ambient light and \
         the background are none"
    )]
    Dark,
    /// No surface has patches.
    #[error("no surface has an area that can be cut into patches; an infinite plane needs other shapes beside it")]
    NoPatches,
    /// The surfaces need more patches than the limit before any is subdivided.
    #[error(
        "the scene's surfaces need more than {limit} patches before any is divided; a larger max-patches helps, or a \
         larger error if there are many curved surfaces"
    )]
    TooManyPatches {
        /// The limit.
        limit: usize,
    },
    /// The hierarchy of bodies can't be built.
    #[error("the scene is too large for radiosity: {0}")]
    Hierarchy(String),
    /// The observer cancelled.
    #[error("radiosity was cancelled")]
    Cancelled,
    /// Threads with enough stack can't be started.
    #[error(transparent)]
    NoThreads(#[from] NoThreads),
}

impl From<RadiosityError> for JobError {
    fn from(problem: RadiosityError) -> JobError {
        match problem {
            RadiosityError::NoThreads(problem) => problem.into(),
            problem => JobError::Radiosity(problem.to_string()),
        }
    }
}

/// What a method found.
struct Balanced {
    given: Given,
    light: Light,
    residual: f64,
    /// The number of links, or of pairs of patches.
    exchanges: usize,
    /// The form factors of links; none of shooting, which finds them as it needs them.
    gathering: Option<Gathering>,
}

impl RadiositySolution {
    /// Solves a world's balance of light. The result depends on world and settings only: any number of threads gives
    /// equal bits.
    ///
    /// # Errors
    /// [`RadiosityError`] names the reason.
    pub fn solve(
        world: &World,
        settings: &RadiositySettings,
        observer: &dyn Observer,
    ) -> Result<RadiositySolution, RadiosityError> {
        RadiositySolution::solve_watched(world, settings, observer, &mut ())
    }

    /// [`RadiositySolution::solve`] with a watcher of each step of the method "shooting".
    ///
    /// # Errors
    /// [`RadiosityError`] names the reason.
    pub fn solve_watched(
        world: &World,
        settings: &RadiositySettings,
        observer: &dyn Observer,
        watcher: &mut dyn ShootingWatcher,
    ) -> Result<RadiositySolution, RadiosityError> {
        settings.check()?;
        with_stack(stack_of(world), || {
            let (mesh, balanced) = balance_of(world, settings, observer, watcher)?;
            Ok(RadiositySolution::new(&mesh, &balanced).0)
        })?
    }

    /// Checks a world without solving its balance. Only where a material absorbs almost nothing, a coarse balance tells
    /// whether light has an end.
    ///
    /// # Errors
    /// [`RadiosityError`] names the reason why [`RadiositySolution::solve`] would fail.
    pub fn check_world(world: &World, settings: &RadiositySettings) -> Result<(), RadiosityError> {
        /// Materials that reflect more may keep light for ever.
        const ABSORBS_LITTLE: f64 = 0.999;
        /// The largest error that a coarse balance has.
        const COARSE: f32 = 0.5;
        settings.check()?;
        with_stack(stack_of(world), || {
            let mut mesh = checked_mesh(world, settings)?;
            if mesh.elements.iter().all(|element| element.reflectance.max_element() < ABSORBS_LITTLE) {
                return Ok(());
            }
            let coarse = RadiositySettings { error: settings.error.max(COARSE), ..*settings };
            hierarchical::hierarchical(&mut mesh, &coarse, &()).map(|_| ())
        })?
    }

    /// [`RadiositySolution::solve`] that keeps how light goes from patch to patch.
    ///
    /// # Errors
    /// [`RadiosityError`] names the reason.
    pub(crate) fn solve_with_transport<'w>(
        world: &'w World,
        settings: &RadiositySettings,
        observer: &dyn Observer,
    ) -> Result<(RadiositySolution, Transport<'w>), RadiosityError> {
        settings.check()?;
        with_stack(stack_of(world), || {
            let (mesh, balanced) = balance_of(world, settings, observer, &mut ())?;
            let (solution, local_radiance) = RadiositySolution::new(&mesh, &balanced);
            Ok((solution, Transport::new(mesh, balanced, local_radiance)))
        })?
    }
}

/// The stack in bytes that a ray needs, and for each group around the primitive that it hits.
const STACK: usize = 512 << 10;
const STACK_OF_GROUP: usize = 16 << 10;

fn stack_of(world: &World) -> usize {
    STACK + STACK_OF_GROUP * world.most_groups()
}

fn balance_of<'w>(
    world: &'w World,
    settings: &RadiositySettings,
    observer: &dyn Observer,
    watcher: &mut dyn ShootingWatcher,
) -> Result<(PatchMesh<'w>, Balanced), RadiosityError> {
    observer.solving(&SolvingProgress { phase: SolvingPhase::Patches, patches: 0, links: 0 });
    let mut mesh = checked_mesh(world, settings)?;
    let balanced = match settings.method {
        RadiosityMethod::Hierarchical => hierarchical::hierarchical(&mut mesh, settings, observer)?,
        RadiosityMethod::Shooting => shooting::shooting(&mut mesh, settings, observer, watcher)?,
        RadiosityMethod::Full => full::full(&mut mesh, settings, observer)?,
    };
    Ok((mesh, balanced))
}

/// The patches of a world whose light can be balanced, as far as is known before.
fn checked_mesh<'w>(world: &'w World, settings: &RadiositySettings) -> Result<PatchMesh<'w>, RadiosityError> {
    let mesh = PatchMesh::new(world, settings)?;
    if mesh.elements.is_empty() {
        return Err(RadiosityError::NoPatches);
    }
    for element in &mesh.elements {
        let reflectance = element.reflectance.max_element();
        if reflectance > 1.0 {
            let material = &world.materials()[mesh.roots[element.root as usize].material as usize].name;
            return Err(RadiosityError::Reflectance { material: material.clone(), reflectance });
        }
    }
    let emits = mesh.elements.iter().any(|element| element.emission.max_element() > 0.0);
    if !emits && world.lights.is_empty() && world.environment.is_none() {
        return Err(RadiosityError::Dark);
    }
    Ok(mesh)
}
