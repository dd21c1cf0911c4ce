//! Warnings about parts of a scene that its integrator leaves out, and about pictures that take it very long.

use crate::format::count;
use canaletto::diagnose::{Omission, large_ray_trees, omissions};
use canaletto::render::Job;
use canaletto::world::World;
use canaletto_io::diagnostic::{Diagnostic, Diagnostics};

/// The warnings about what a picture or a solution falls short of. `name` is the name of the scene.
pub(crate) fn shortfalls(name: &str, warnings: &[String]) -> Diagnostics {
    let mut all = Diagnostics::new();
    warnings.iter().for_each(|warning| all.push(Diagnostic::warning(name, format!("{name}: {warning}"))));
    all
}

/// The warnings about the picture of this job. `name` is the name of the scene.
pub(crate) fn doubt_omissions(name: &str, world: &World, job: &Job) -> Diagnostics {
    let mut all = Diagnostics::new();
    for omission in omissions(world, job) {
        let warning = Diagnostic::warning(name, omission.to_string());
        all.push(match omission {
            Omission::EmissionAsLight { .. } => warning.help(
                "the surfaces shine, but light nothing: take integrator \"path\" or \"radiosity\", or put a light in \
                 their place",
            ),
            Omission::OpenBody { .. } => warning.help(
                "an open edge has no face on its other side, one that is turned round, or one of another material; a \
                 modeller fills holes and turns faces outwards",
            ),
            Omission::Ambient { .. } => warning.help("leave ambient out, or write ambient 0"),
            _ => warning,
        });
    }
    all
}

/// The warning about camera rays that branch into thousands of rays. `name` is the name of the scene.
pub(crate) fn doubt_ray_trees(name: &str, world: &World, job: &Job) -> Diagnostics {
    let Some(trees) = large_ray_trees(world, job) else { return Diagnostics::new() };
    let more = if trees.is_more { "more than " } else { "" };
    let [rays, shadow_rays] = [trees.rays, trees.shadow_rays].map(|rays| count(rays as u64));
    let message = format!(
        "this picture takes long: a camera ray branches into {more}{rays} rays on average, {shadow_rays} of them to \
         lights"
    );
    let help = "--max-depth 3 ends trees of mirrored and refracted rays earlier, integrator { min-weight 0.01 } leaves \
                out rays that hardly count, and fewer points in a light take fewer rays";
    Diagnostic::warning(name, message).help(help).into()
}
