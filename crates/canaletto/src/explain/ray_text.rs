//! Rays and their hits as text.

use super::environment_text::write_sighting;
use super::light_text::write_lights;
use super::material_text::{write_material, write_texture};
use super::patch_text::write_radiosity;
use super::steps_text::{write_hit_steps, write_ray_steps};
use super::text_writer::{TextWriter, counted};
use super::tree::{EmittersNode, HitNode, Outcome, RayNode, Side, has_primitives};
use crate::integrator::RayKind;

/// Writes a ray at this level and, up to the last level, the rays below it.
pub(super) fn write_ray(w: &mut TextWriter, ray: &RayNode, level: u32, indent: &str) {
    let kind = match ray.kind {
        RayKind::Eye => "camera ray",
        RayKind::Reflected => "reflected ray (5.37)",
        RayKind::Refracted => "refracted ray (5.40-5.44)",
        RayKind::TotallyReflected => "totally reflected ray",
        RayKind::Scattered => "scattered ray",
        RayKind::Passed => "straight ray (partial coverage)",
    };
    writeln!(w, "{indent}{kind}, depth {}: o = {}, d = {}", ray.depth, w.vector(ray.origin), w.vector(ray.direction));
    if let Some([from, into]) = ray.media {
        writeln!(w, "{indent}  from eta {} into eta {}  (5.43)", w.number(from), w.number(into));
    }
    if let Some(steps) = &ray.steps {
        write_ray_steps(w, steps, indent);
    }
    for body in &ray.hidden {
        writeln!(w, "{indent}  crosses the surface of {body} unchanged: an overlapping body has priority");
    }
    for hole in &ray.holes {
        writeln!(w, "{indent}  passes through a hole (coverage 0) in {hole}");
    }
    if let Some(lobe) = &ray.lobe {
        writeln!(
            w,
            "{indent}  from a random microfacet with n = {}, roughness {}",
            w.vector(lobe.facet),
            w.number(lobe.roughness)
        );
    }
    match &ray.outcome {
        Outcome::Miss { background, environment: None } => {
            writeln!(w, "{indent}  meets nothing: background {}", w.rgb(*background));
        }
        Outcome::Miss { environment: Some(environment_lookup), .. } => write_sighting(w, environment_lookup, indent),
        Outcome::Hit(hit) => write_hit(w, ray, hit, level, indent),
    }
}

fn write_hit(w: &mut TextWriter, ray: &RayNode, hit: &HitNode, level: u32, indent: &str) {
    let which = if has_primitives(hit.kind) {
        format!("{}, primitive {}", hit.object, hit.primitive)
    } else {
        hit.object.clone()
    };
    let side = match hit.side {
        Side::Outside => "outside",
        Side::Inside => "inside",
    };
    writeln!(w, "{indent}  meets {which} ({}) from {side} at t = {}", hit.kind, w.number(hit.t));
    writeln!(w, "{indent}    p = {}", w.vector(hit.point));
    writeln!(w, "{indent}    n = {}, uv = ({})", w.vector(hit.shading_normal), w.list(&hit.uv));
    if let Some(steps) = &hit.steps {
        write_hit_steps(w, steps, indent);
    }
    write_material(w, hit, indent);
    for texture in &hit.textures {
        write_texture(w, texture, indent);
    }
    if hit.textures.iter().any(|texture| matches!(texture.used, "bump" | "normal")) {
        writeln!(w, "{indent}    geometric n = {}", w.vector(hit.normal));
    }
    if let Some(kd) = hit.unlit {
        writeln!(w, "{indent}    + unlit colour kd              {}", w.rgb(kd));
    }
    match (hit.ambient, &hit.radiosity) {
        (Some(ambient), Some(light)) => {
            writeln!(w, "{indent}    + radiosity's light * kd       {}", w.rgb(ambient));
            let deeper = format!("{indent}        ");
            write_radiosity(w, light, &deeper);
        }
        (Some(ambient), None) => writeln!(w, "{indent}    + ambient Ia*kd                {}  (5.33)", w.rgb(ambient)),
        (None, _) => {}
    }
    if let Some(emitters) = &hit.emitters {
        let EmittersNode { unoccluded, arriving, rays, passed, contribution } = emitters;
        writeln!(w, "{indent}    + emitting surfaces E*kd       {}", w.rgb(*contribution));
        writeln!(
            w,
            "{indent}        E = {}; in full view {}; {} of {rays} shadow rays pass",
            w.rgb(*arriving),
            w.rgb(*unoccluded),
            w.number(*passed)
        );
    }
    if let Some(emission) = hit.emission {
        writeln!(w, "{indent}    + emission                    {}", w.rgb(emission));
    }
    write_lights(w, &hit.lights, level, indent);
    for child in &hit.children {
        let (name, factor) = match child.kind {
            RayKind::Reflected => ("k", w.rgb(child.factor)),
            _ => ("(1 - o)", w.number(child.factor.r).to_string()),
        };
        writeln!(
            w,
            "{indent}    + {name} * ray = {factor} * {} = {}  (5.39b)",
            w.rgb(child.color),
            w.rgb(child.color * child.factor)
        );
        write_child(w, child, level, indent);
    }
    for cut in &hit.cut {
        let kind = match cut.kind {
            RayKind::Reflected => "reflected",
            RayKind::Passed => "straight",
            _ => "refracted",
        };
        writeln!(
            w,
            "{indent}    + 0: the {kind} ray with factor {} isn't traced (max-depth or min-weight)",
            w.rgb(cut.factor)
        );
    }
    if let Some((overlay, share)) = hit.overlay {
        let rest = if share < 1.0 { format!(" + {} * the sum above", w.number(1.0 - share)) } else { String::new() };
        writeln!(w, "{indent}    overlay by a texture: {} * {}{rest}", w.number(share), w.rgb(overlay));
    }
    if let Some(coverage) = hit.coverage {
        writeln!(w, "{indent}    * coverage {}, the share of the surface that exists", w.number(coverage));
    }
    if let Some(child) = &hit.behind {
        let (share, color) = (w.number(child.factor.r), w.rgb(child.color * child.factor));
        writeln!(w, "{indent}    + {share} * ray = {share} * {} = {color}", w.rgb(child.color));
        write_child(w, child, level, indent);
    }
    writeln!(w, "{indent}    = {}", w.rgb(ray.color));
}

/// Writes a ray below a hit of a ray at this level, or the number of those that are left out.
fn write_child(w: &mut TextWriter, child: &RayNode, level: u32, indent: &str) {
    let deeper = format!("{indent}    | ");
    if level < w.levels {
        write_ray(w, child, level + 1, &deeper);
    } else {
        let rays = counted(rays_of(child), "ray");
        writeln!(w, "{deeper}{rays} on level {} and below it", level + 1);
    }
}

/// The number of rays of a tree.
fn rays_of(ray: &RayNode) -> usize {
    1 + ray.below().map(rays_of).sum::<usize>()
}

/// The number of levels of a tree.
pub(super) fn levels_of(ray: &RayNode) -> u32 {
    1 + ray.below().map(levels_of).max().unwrap_or(0)
}
