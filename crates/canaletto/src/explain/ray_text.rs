//! Rays and their hits: their terms, and their text.

use super::light_text::write_lights;
use super::material_text::write_texture;
use super::patch_text::write_radiosity;
use super::term::{Line, Term, line, of_ray, summand, wide};
use super::text_writer::{TextWriter, counted};
use super::tree::{HitNode, Outcome, RayNode, Side, has_primitives};
use crate::integrator::RayKind;
use crate::math::Rgb;

impl RayNode {
    /// The terms of a ray before its hit.
    pub(super) fn lines(&self) -> Vec<Line<'_>> {
        let kind = kind_name(self.kind);
        let equation = match self.kind {
            RayKind::Reflected => " (5.37)",
            RayKind::Refracted => " (5.40-5.44)",
            RayKind::Passed => " (partial coverage)",
            RayKind::Eye | RayKind::TotallyReflected | RayKind::Scattered => "",
        };
        let (origin, direction) = (self.origin, self.direction);
        let start = line!("{}{}, depth {}: o = {o}, d = {d}", kind, equation, self.depth, origin, direction);
        let mut lines = vec![start.of_ray()];
        lines.extend(
            self.media.map(|[from, into]| line!("  from eta {eta_i:5.43} into eta {eta_t:5.43}  (5.43)", from, into)),
        );
        lines.extend(self.steps.iter().flat_map(|steps| steps.lines()));
        lines.extend(self.hidden.iter().map(|body| {
            line!("  crosses the surface of {hidden body} unchanged: an overlapping body has priority", body)
        }));
        lines.extend(self.holes.iter().map(|hole| line!("  passes through a hole (coverage 0) in {hole}", hole)));
        lines.extend(self.lobe.map(|lobe| {
            let (facet, roughness) = (lobe.facet, lobe.roughness);
            line!("  from a random microfacet with n = {n of the microfacet}, roughness {}", facet, roughness).of_ray()
        }));
        lines
    }
}

impl HitNode {
    /// The terms of the surface.
    pub(super) fn surface_lines(&self) -> Vec<Line<'_>> {
        let side = if self.side == Side::Outside { "outside" } else { "inside" };
        let primitive = has_primitives(self.kind).then_some(self.primitive);
        let which = primitive.map(|number| format!(", primitive {number}"));
        let n = Term::from(self.shading_normal)
            .because(|| Some(line!("bent by the texture \"{}\"", &self.bending_texture()?.texture)));
        let (object, t) = (&self.object, of_ray(self.t));
        let mut lines = vec![
            line!("  meets {}{} ({}) from {side of the surface} at t = {t}", object, which, self.kind, side, t),
            line!("    p = {p}", self.point).of_ray(),
            line!("{primitive}{geometric n}", primitive, self.normal).of_ray().written_if(false),
            line!("    n = {n}, uv = {uv}", n, self.uv).of_ray(),
        ];
        lines.extend(self.steps.iter().map(|steps| steps.line()));
        lines
    }

    /// The colour without light, or the ambient light, which may be that of a solution.
    pub(super) fn ambient_line(&self) -> Option<Line<'_>> {
        if let Some(kd) = self.unlit {
            return Some(line!("    + unlit colour kd              {unlit colour kd}", summand(kd)));
        }
        let ambient = summand(self.ambient?);
        let Some(light) = &self.radiosity else {
            return Some(line!("    + ambient Ia*kd                {ambient Ia*kd:5.33}  (5.33)", ambient));
        };
        let light = Rgb::from(light.light.map(|v| v as f32));
        let ambient = ambient.because(move || Some(line!("the light of the solution, {}", light)));
        Some(line!("    + radiosity's light * kd       {ambient Ia*kd:5.33}", ambient))
    }

    /// The light of emitting surfaces, and of the surface itself.
    pub(super) fn emission_lines(&self) -> Vec<Line<'_>> {
        let mut lines = Vec::new();
        if let Some(light) = &self.emitters {
            let (rays, passed) = (light.rays, light.passed);
            let sum =
                summand(light.contribution).because(move || Some(line!("{} of {} shadow rays pass", passed, rays)));
            lines.push(line!("    + emitting surfaces E*kd       {emitting surfaces E*kd}", sum));
            let view = line!("        E = {}; in full view {}", light.arriving, light.unoccluded);
            lines.push(view.and(line!("; {} of {} shadow rays pass", passed, rays)));
        }
        lines.extend(self.emission.map(|color| line!("    + emission                    {emission}", summand(color))));
        lines
    }

    /// What covers the surface, and how much of it exists.
    pub(super) fn covering_lines(&self) -> Vec<Line<'_>> {
        let mut lines = Vec::new();
        if let Some((color, share)) = self.overlay {
            let overlay = Term { amount: Some(wide(color) * f64::from(share)), ..color.into() };
            let line =
                line!("    overlay by a texture: {share of the overlay} * {overlay by a texture}", share, overlay);
            let rest = line!(" + {} * the sum above", 1.0 - share);
            lines.push(if share < 1.0 { line.and(rest) } else { line });
        }
        lines.extend(
            self.coverage
                .map(|coverage| line!("    * coverage {coverage}, the share of the surface that exists", coverage)),
        );
        lines
    }
}

/// Writes a ray at this level and, up to the last level, the rays below it.
pub(super) fn write_ray(w: &mut TextWriter, ray: &RayNode, level: u32, indent: &str) {
    w.lines(indent, ray.lines());
    match &ray.outcome {
        Outcome::Miss { background, environment: None } => {
            w.line(indent, &line!("  meets nothing: background {}", *background));
        }
        Outcome::Miss { environment: Some(lookup), .. } => w.lines(indent, lookup.lines()),
        Outcome::Hit(hit) => write_hit(w, ray, hit, level, indent),
    }
}

fn write_hit(w: &mut TextWriter, ray: &RayNode, hit: &HitNode, level: u32, indent: &str) {
    w.lines(indent, hit.surface_lines());
    w.lines(indent, hit.material_lines());
    for texture in &hit.textures {
        write_texture(w, texture, indent);
    }
    if hit.bending_texture().is_some() {
        w.line(indent, &line!("    geometric n = {}", hit.normal));
    }
    w.lines(indent, hit.ambient_line());
    if let (Some(_), Some(light)) = (hit.ambient, &hit.radiosity) {
        write_radiosity(w, light, &format!("{indent}        "));
    }
    w.lines(indent, hit.emission_lines());
    write_lights(w, hit, level, indent);
    for child in &hit.children {
        let (color, product) = (child.color, child.color * child.factor);
        w.line(
            indent,
            &match child.kind {
                RayKind::Reflected => line!("    + k * ray = {} * {} = {}  (5.39b)", child.factor, color, product),
                _ => line!("    + (1 - o) * ray = {} * {} = {}  (5.39b)", child.factor.r, color, product),
            },
        );
        write_child(w, child, level, indent);
    }
    for cut in &hit.cut {
        let kind = match cut.kind {
            RayKind::Reflected => "reflected",
            RayKind::Passed => "straight",
            _ => "refracted",
        };
        let words =
            line!("    + 0: the {} ray with factor {} isn't traced (max-depth or min-weight)", kind, cut.factor);
        w.line(indent, &words);
    }
    w.lines(indent, hit.covering_lines());
    if let Some(child) = &hit.behind {
        let (share, product) = (child.factor.r, child.color * child.factor);
        w.line(indent, &line!("    + {} * ray = {} * {} = {}", share, share, child.color, product));
        write_child(w, child, level, indent);
    }
    w.line(indent, &line!("    = {}", ray.color));
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

pub(super) fn kind_name(kind: RayKind) -> &'static str {
    match kind {
        RayKind::Eye => "camera ray",
        RayKind::Reflected => "reflected ray",
        RayKind::Refracted => "refracted ray",
        RayKind::TotallyReflected => "totally reflected ray",
        RayKind::Scattered => "scattered ray",
        RayKind::Passed => "straight ray",
    }
}
