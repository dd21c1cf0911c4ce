//! What a job asks for and a z-buffer doesn't do.

use super::cut_away::cut_away;
use super::{draws_sample_by_sample, grid_side};
use crate::Named;
use crate::integrator::Omission;
use crate::job::PlacedJob;
use crate::material::{Parameter, PreparedMaterial, Target};
use crate::scene::{Filter, Sampling, ShadowMethod, ZbufferSettings};
use crate::world::{Hit, Primitives, World};
use std::collections::BTreeSet;

/// A kind of material that a z-buffer draws as if it were another.
struct Kind {
    /// What it draws in place of it.
    sentence: &'static str,
    is_of: fn(&PreparedMaterial) -> bool,
}

fn has_texture(material: &PreparedMaterial, parameter: Parameter) -> bool {
    material.textures.iter().any(|texture| texture.target == Target::Parameter(parameter))
}

const KINDS: [Kind; 3] = [
    Kind {
        sentence: "a z-buffer draws no reflections, so these mirrors reflect nothing",
        is_of: |m| !m.plain().classic.k.is_black() || has_texture(m, Parameter::Mirror),
    },
    Kind {
        sentence: "a z-buffer refracts no light, so these clear objects are opaque",
        is_of: |m| {
            // A medium without a surface isn't drawn.
            !m.model.is_index_matched_to_air()
                && (m.plain().classic.opacity < 1.0 || has_texture(m, Parameter::Opacity))
        },
    },
    Kind {
        sentence: "a z-buffer draws a surface or leaves it out, so these half-covered surfaces are drawn where their \
                   coverage is at least 0.5",
        is_of: |m| m.coverage > 0.0 && m.coverage < 1.0,
    },
];

/// What the z-buffer leaves out of a job's picture.
pub(super) fn omissions(job: &PlacedJob, settings: &ZbufferSettings) -> Vec<Omission> {
    let world = job.world();
    let mut all = Vec::new();
    for Kind { sentence, is_of } in KINDS {
        let of_kind: Vec<bool> = world.materials().iter().map(is_of).collect();
        let subjects = if of_kind.contains(&true) { objects_of(world, &of_kind) } else { Vec::new() };
        if !subjects.is_empty() {
            all.push(Omission::substitute(sentence, subjects));
        }
    }
    if settings.shadows == ShadowMethod::Map {
        let areas = (1..).zip(&world.lights).filter(|(_, light)| light.light.shadows && light.light.has_area());
        let subjects: Vec<String> = areas
            .map(|(number, light)| match &light.light.name {
                Some(name) => name.to_string(),
                None => format!("{} light #{number}", light.light.kind_name()),
            })
            .collect();
        if !subjects.is_empty() {
            let problem = "shadow maps have no penumbrae, so lights with an area cast the shadows of their centres";
            all.push(Omission::substitute(problem, subjects));
        }
    }
    all.extend(cut_away(job));
    let mut add = |problem: String| all.push(Omission::substitute(problem, Vec::new()));
    if !job.camera.is_plain() {
        add("a z-buffer has no lens and no shutter, so all is sharp and drawn at the shutter's opening".into());
    } else if world.moves() {
        add("a z-buffer has no shutter, so what moves is drawn at the shutter's opening".into());
    }
    if draws_sample_by_sample(job) {
        add("the samples of a z-buffer have equal places in all pixels".into());
    } else if let Some(side) =
        grid_side(job.film.sampling).filter(|_| !matches!(job.film.sampling, Sampling::Regular(_)))
    {
        add(format!("the samples of a z-buffer have equal places in all pixels: here a grid of {side} x {side}"));
    }
    if job.film.filter != Filter::Box {
        add(format!("a z-buffer has the box filter, not \"{}\"", job.film.filter.name()));
    }
    all
}

/// The names of the objects with one of these materials, sorted.
fn objects_of(world: &World, materials: &[bool]) -> Vec<String> {
    let mut objects = BTreeSet::new();
    let mut visit = |instance: u32, primitive: u32| {
        let hit = Hit { t: 0.0, instance, primitive, part: 0, uv: [0.0; 2], time: 0.0 };
        if materials[world.material_index(&hit) as usize] {
            objects.insert(world.object(&hit).name.clone());
        }
    };
    for instance in 0..world.placed_geometry_count() {
        let primitives = world.placed_geometry(instance, 0.0).primitives;
        // A cloud has one material, and so has a mesh without slots.
        let has_one = match primitives {
            Primitives::Spheres(_) | Primitives::Cylinders(_) => true,
            Primitives::Mesh(mesh) => mesh.slots.is_empty(),
            Primitives::Shapes(_) => false,
        };
        let visited = if has_one { primitives.len().min(1) } else { primitives.len() };
        for primitive in 0..visited as u32 {
            visit(instance, primitive);
        }
    }
    for primitive in 0..world.unbounded_shapes().count() as u32 {
        visit(Hit::UNBOUNDED, primitive);
    }
    objects.into_iter().collect()
}
