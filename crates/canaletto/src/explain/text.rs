//! The tree as text for a terminal.

use super::number::Number;
use super::patch::{PatchNode, PlaceNode};
use super::patch_text::{write_patch, write_radiosity};
use super::tree::{
    EmittersNode, HitNode, LightNode, Outcome, PixelTree, RayNode, SampleNode, Side, TextureNode, has_primitives,
};
use crate::Named;
use crate::integrator::{RasterNode, RasterTriangle, RayKind, RivalFate};
use crate::light::environment::{EnvironmentLookup, Footprint, Part, Place};
use crate::material::{Parameter, ParameterInfo, ParameterValue, Shown};
use crate::math::Rgb;
use std::collections::BTreeSet;
use std::fmt::{self, Display, Formatter, LowerExp};

/// Numbers are printed with the digits that parse to the original `f32`.
impl Display for PixelTree {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let ([x, y], [cx, cy], [w, h]) = (self.pixel, self.chapter_pixel, self.size);
        writeln!(
            f,
            "pixel ({x}, {y}) of {w} x {h}, counted from the top left; ({cx}, {cy}) counted from the lower left"
        )?;
        let total: f64 = self.samples.iter().map(|s| s.weight).sum();
        let mut patches =
            UntoldPatches { all: &self.patches, told: BTreeSet::new(), places: self.places.iter().collect() };
        for (index, sample) in self.samples.iter().enumerate() {
            writeln!(f)?;
            if self.samples.len() > 1 {
                let share = sample.weight / total;
                writeln!(f, "sample {} of {}, weight {share:.6}", index + 1, self.samples.len())?;
            }
            write_sample(f, sample, &mut patches)?;
        }
        writeln!(f)?;
        if self.more_patches > 0 {
            writeln!(f, "{} more patches lie under the pixel and aren't explained", self.more_patches)?;
        }
        if self.samples.len() > 1 {
            writeln!(f, "pixel = weighted mean of {} samples", self.samples.len())?;
        }
        let sum = self.sum();
        let equal = if sum == self.color { "equal, bit for bit" } else { "NOT equal: this is a bug" };
        writeln!(f, "sum of the terms  {}", rgb(sum))?;
        writeln!(f, "rendered pixel    {}  ({equal})", rgb(self.color))
    }
}

/// The patches of a tree. Each is written once.
struct UntoldPatches<'t> {
    all: &'t [PatchNode],
    told: BTreeSet<u32>,
    /// The places that aren't written yet.
    places: Vec<&'t PlaceNode>,
}

impl UntoldPatches<'_> {
    fn write(&mut self, f: &mut Formatter, number: u32, indent: &str) -> fmt::Result {
        match self.all.iter().find(|patch| patch.number == number) {
            Some(_) if !self.told.insert(number) => writeln!(f, "{indent}patch {number}: as above"),
            Some(patch) => write_patch(f, patch, indent),
            None if self.all.is_empty() => {
                writeln!(
                    f,
                    "{indent}patch {number}: what lights it isn't known, since a solution that was saved has no links"
                )
            }
            None => Ok(()),
        }
    }
}

fn write_sample(f: &mut Formatter, sample: &SampleNode, patches: &mut UntoldPatches) -> fmt::Result {
    let ([x, y], d) = (sample.position, sample.chapter_direction);
    writeln!(f, "camera ray through x = {x}, y = {y}: d = ({:.6}, {:.6}, {:.6})  (5.10)", d[0], d[1], d[2])?;
    if let Some(time) = sample.time {
        writeln!(f, "at time {time} of 0 (shutter opens) to 1 (shutter closes)")?;
    }
    if let Some([right, up]) = sample.lens {
        writeln!(f, "from the point of the lens {right} to the right of the eye and {up} above it")?;
    }
    if let Some(raster) = &sample.raster {
        write_raster(f, raster)?;
    }
    write_ray(f, &sample.ray, "", patches)
}

fn write_raster(f: &mut Formatter, raster: &RasterNode) -> fmt::Result {
    let RasterNode { triangle, samples, rivals, more_rivals } = raster;
    if let Some(RasterTriangle { object, primitive, facet, corners, weights, depth, z }) = triangle {
        match facet {
            Some(facet) => writeln!(f, "triangle {facet} of the tessellation of {object} (primitive {primitive})")?,
            None => writeln!(f, "triangle {primitive} of {object}")?,
        }
        let corner = |[x, y]: [f64; 2]| format!("({x}, {y})");
        writeln!(f, "  on the screen {}", corners.map(corner).join(", "))?;
        writeln!(f, "  weights of the corners {} {} {}", weights[0], weights[1], weights[2])?;
        writeln!(f, "  depth 1/z = {depth}, z = {}", Number(*z))?;
    } else {
        writeln!(f, "no triangle is visible")?;
    }
    if samples[1] > 1 {
        writeln!(f, "  seen by {} of the pixel's {} samples", samples[0], samples[1])?;
    }
    for rival in rivals {
        let fate = match rival.fate {
            RivalFate::Farther => "is farther",
            RivalFate::Equal => "is as near, but comes later in the scene or in its mesh",
            RivalFate::BeyondFar => "lies beyond the far plane",
            RivalFate::BeforeNear => "lies in front of the near plane",
            RivalFate::Hole => "has a hole here",
        };
        writeln!(f, "  hidden: {}, 1/z = {}, z = {}: {fate}", rival.object, rival.depth, Number(rival.z))?;
    }
    if *more_rivals > 0 {
        writeln!(f, "  hidden: {more_rivals} more triangles, farther than these")?;
    }
    Ok(())
}

fn write_ray(f: &mut Formatter, ray: &RayNode, indent: &str, patches: &mut UntoldPatches) -> fmt::Result {
    let kind = match ray.kind {
        RayKind::Eye => "camera ray",
        RayKind::Reflected => "reflected ray (5.37)",
        RayKind::Refracted => "refracted ray (5.40-5.44)",
        RayKind::TotallyReflected => "totally reflected ray",
        RayKind::Passed => "straight ray (partial coverage)",
    };
    writeln!(f, "{indent}{kind}, depth {}: o = {}, d = {}", ray.depth, vector(ray.origin), vector(ray.direction))?;
    if let Some([from, into]) = ray.media {
        writeln!(f, "{indent}  from eta {from} into eta {into}  (5.43)")?;
    }
    for body in &ray.hidden {
        writeln!(f, "{indent}  crosses the surface of {body} unchanged: an overlapping body has priority")?;
    }
    for hole in &ray.holes {
        writeln!(f, "{indent}  passes through a hole (coverage 0) in {hole}")?;
    }
    if let Some(lobe) = &ray.lobe {
        writeln!(
            f,
            "{indent}  from a random microfacet with n = {}, roughness {}",
            vector(lobe.facet),
            lobe.roughness
        )?;
    }
    match &ray.outcome {
        Outcome::Miss { background, environment: None } => {
            writeln!(f, "{indent}  meets nothing: background {}", rgb(*background))
        }
        Outcome::Miss { environment: Some(environment_lookup), .. } => write_sighting(f, environment_lookup, indent),
        Outcome::Hit(hit) => write_hit(f, hit, ray.color, indent, patches),
    }
}

fn write_sighting(f: &mut Formatter, seen: &EnvironmentLookup, indent: &str) -> fmt::Result {
    let (d, local) = (seen.direction, seen.local);
    writeln!(f, "{indent}  meets nothing: environment \"{}\" {}", seen.kind, rgb(seen.radiance))?;
    write!(f, "{indent}    direction ({}, {}, {})", Number(d.x), Number(d.y), Number(d.z))?;
    if (local - d).length() > 1e-12 {
        write!(
            f,
            ", in the environment's own coordinates ({}, {}, {})",
            Number(local.x),
            Number(local.y),
            Number(local.z)
        )?;
    }
    writeln!(f)?;
    match seen.place {
        Place::Face { face, uv: [u, v] } => {
            writeln!(
                f,
                "{indent}    face {}, u = {}, v = {} from its upper left corner  (fig. 5.35)",
                face.name(),
                Number(u),
                Number(v)
            )?;
        }
        Place::Panorama { uv: [u, v] } => {
            writeln!(f, "{indent}    panorama u = {}, v = {} from its upper left corner", Number(u), Number(v))?;
        }
        Place::Height(height) => writeln!(f, "{indent}    {} degrees above the horizon", Number(height))?,
        Place::Sky(part) => {
            let part = match part {
                Part::Air => "the sky",
                Part::Sun => "the sun's disk",
                Part::Ground => "the ground below the horizon",
            };
            writeln!(f, "{indent}    {part}")?;
        }
    }
    match seen.footprint {
        Some(Footprint { level, looks }) if level > 0.0 || looks > 1 => {
            writeln!(f, "{indent}    mean of {looks} lookups at pyramid level {level}")?;
        }
        _ => {}
    }
    if seen.value == seen.radiance {
        return Ok(());
    }
    writeln!(f, "{indent}    = value {} * the environment's intensity", rgb(seen.value))
}

fn write_hit(f: &mut Formatter, hit: &HitNode, color: Rgb, indent: &str, patches: &mut UntoldPatches) -> fmt::Result {
    let which = if has_primitives(hit.kind) {
        format!("{}, primitive {}", hit.object, hit.primitive)
    } else {
        hit.object.clone()
    };
    let side = match hit.side {
        Side::Outside => "outside",
        Side::Inside => "inside",
    };
    writeln!(f, "{indent}  meets {which} ({}) from {side} at t = {}", hit.kind, Number(hit.t))?;
    writeln!(f, "{indent}    p = {}", vector(hit.point))?;
    writeln!(f, "{indent}    n = {}, uv = ({}, {})", vector(hit.shading_normal), Number(hit.uv[0]), Number(hit.uv[1]))?;
    write_material(f, hit, indent)?;
    for texture in &hit.textures {
        write_texture(f, texture, indent)?;
    }
    if hit.textures.iter().any(|texture| matches!(texture.used, "bump" | "normal")) {
        writeln!(f, "{indent}    geometric n = {}", vector(hit.normal))?;
    }
    if let Some(kd) = hit.unlit {
        writeln!(f, "{indent}    + unlit colour kd              {}", rgb(kd))?;
    }
    match (hit.ambient, &hit.radiosity) {
        (Some(ambient), Some(light)) => {
            writeln!(f, "{indent}    + radiosity's light * kd       {}", rgb(ambient))?;
            let deeper = format!("{indent}        ");
            write_radiosity(f, light, &mut patches.places, &deeper)?;
            patches.write(f, light.patch, &deeper)?;
        }
        (Some(ambient), None) => writeln!(f, "{indent}    + ambient Ia*kd                {}  (5.33)", rgb(ambient))?,
        (None, _) => {}
    }
    if let Some(emitters) = &hit.emitters {
        let EmittersNode { unoccluded, arriving, rays, passed, contribution } = emitters;
        writeln!(f, "{indent}    + emitting surfaces E*kd       {}", rgb(*contribution))?;
        writeln!(
            f,
            "{indent}        E = {}; in full view {}; {passed} of {rays} shadow rays pass",
            rgb(*arriving),
            rgb(*unoccluded)
        )?;
    }
    if let Some(emission) = hit.emission {
        writeln!(f, "{indent}    + emission                    {}", rgb(emission))?;
    }
    for light in &hit.lights {
        write_light(f, light, indent)?;
    }
    let deeper = format!("{indent}    | ");
    for child in &hit.children {
        let (name, factor) = match child.kind {
            RayKind::Reflected => ("k", rgb(child.factor)),
            _ => ("(1 - o)", child.factor.r.to_string()),
        };
        writeln!(
            f,
            "{indent}    + {name} * ray = {factor} * {} = {}  (5.39b)",
            rgb(child.color),
            rgb(child.color * child.factor)
        )?;
        write_ray(f, child, &deeper, patches)?;
    }
    for cut in &hit.cut {
        let kind = match cut.kind {
            RayKind::Reflected => "reflected",
            RayKind::Passed => "straight",
            _ => "refracted",
        };
        writeln!(
            f,
            "{indent}    + 0: the {kind} ray with factor {} isn't traced (max-depth or min-weight)",
            rgb(cut.factor)
        )?;
    }
    if let Some((overlay, share)) = hit.overlay {
        let rest = if share < 1.0 { format!(" + {} * the sum above", 1.0 - share) } else { String::new() };
        writeln!(f, "{indent}    overlay by a texture: {share} * {}{rest}", rgb(overlay))?;
    }
    if let Some(coverage) = hit.coverage {
        writeln!(f, "{indent}    * coverage {coverage}, the share of the surface that exists")?;
    }
    if let Some(child) = &hit.behind {
        let color = rgb(child.color * child.factor);
        writeln!(f, "{indent}    + {} * ray = {} * {} = {color}", child.factor.r, child.factor.r, rgb(child.color))?;
        write_ray(f, child, &deeper, patches)?;
    }
    writeln!(f, "{indent}    = {}", rgb(color))
}

fn write_texture(f: &mut Formatter, texture: &TextureNode, indent: &str) -> fmt::Result {
    writeln!(f, "{indent}    texture \"{}\" for {}", texture.texture, texture.used)?;
    for r in &texture.readings {
        let ([u, v, w], [dx, dy]) = (r.at, r.footprint);
        let share = if texture.readings.len() > 1 { format!("{:.6} of ", r.weight) } else { String::new() };
        writeln!(f, "{indent}        {share}t({u:.6}, {v:.6}, {w:.6})")?;
        match &r.image {
            Some(image) => {
                let ([x, y], [width, height], [long, short]) = (image.texel, image.size, image.radii);
                let sample = if long > 0.0 {
                    format!(", footprint radii {long:.4} and {short:.4} texels, pyramid level {:.3}", image.level)
                } else {
                    String::new()
                };
                writeln!(f, "{indent}        texel ({x:.3}, {y:.3}) of {width} x {height}{sample}")?;
            }
            None => {
                let side = |d: [f64; 3]| format!("({:.6}, {:.6}, {:.6})", d[0], d[1], d[2]);
                writeln!(f, "{indent}        footprint dx = {}, dy = {}", side(dx), side(dy))?;
            }
        }
    }
    let [r, g, b, a] = texture.value;
    writeln!(f, "{indent}        value ({}, {}, {}, {})", Number(r), Number(g), Number(b), Number(a))?;
    let list = |numbers: &[f32]| numbers.iter().map(|v| Number(*v).to_string()).collect::<Vec<_>>().join(", ");
    let [before, after] = &texture.replaced;
    let what = if matches!(texture.used, "bump" | "normal") { "n" } else { texture.used };
    writeln!(f, "{indent}        {what}: ({}) instead of ({})", list(after), list(before))
}

fn write_light(f: &mut Formatter, light: &LightNode, indent: &str) -> fmt::Result {
    let distance = if light.distance.is_finite() {
        format!("distance {}", Number(light.distance))
    } else {
        "from infinity".into()
    };
    writeln!(
        f,
        "{indent}    + {}{}: {}",
        light.light,
        match light.position {
            Some(p) => format!(" (random point {} at {})", light.point, vector(p)),
            None if light.point > 0 => format!(" (point {})", light.point),
            None => String::new(),
        },
        rgb(light.contribution)
    )?;
    writeln!(
        f,
        "{indent}        L = {}, {distance}, l = {}, n.L = {}",
        vector(light.direction),
        rgb(light.intensity),
        Number(light.n_dot_l)
    )?;
    if light.n_dot_l.is_nan() || light.n_dot_l <= 0.0 {
        return writeln!(f, "{indent}        the light is behind the surface: n.L <= 0");
    }
    if light.behind {
        return writeln!(f, "{indent}        the light is behind the surface; only the bent normal faces it");
    }
    if light.intensity.is_black() {
        return writeln!(f, "{indent}        no light arrives: the point is outside the cone or beam");
    }
    for blocker in &light.blockers {
        let passed = 1.0 - blocker.opacity;
        let how = if passed > 0.0 { "shadow ray passes" } else { "shadow ray is blocked by" };
        writeln!(f, "{indent}        {how} {}: 1 - o = {}", blocker.object, Number(passed))?;
    }
    writeln!(f, "{indent}        f_s = {}  (5.39a)", Number(light.f_s))?;
    writeln!(f, "{indent}        diffuse  l*kd*(n.L)    = {}  (5.32)", rgb(light.diffuse))?;
    writeln!(
        f,
        "{indent}        specular l*ks*(r.L)^n  = {}, r.L = {}  (5.38)",
        rgb(light.specular),
        Number(light.r_dot_l)
    )
}

/// The material's parameters: in one line those that are always shown, and a line for each other that is set.
fn write_material(f: &mut Formatter, hit: &HitNode, indent: &str) -> fmt::Result {
    let value = |row: &ParameterInfo| match row.get(hit.model.phong()) {
        ParameterValue::Color(color) => rgb(color),
        ParameterValue::Number(number) => number.to_string(),
    };
    let (always, others): (Vec<_>, Vec<_>) = Parameter::ALL.iter().partition(|row| row.shown != Shown::IfSet);
    let always: Vec<String> = always.iter().map(|row| format!("{} {}", row.symbol, value(row))).collect();
    writeln!(f, "{indent}    material \"{}\": {}", hit.material, always.join(", "))?;
    for row in others.iter().filter(|row| row.get(hit.model.phong()) != row.default_value()) {
        writeln!(f, "{indent}        {} {}", row.symbol, value(row))?;
    }
    Ok(())
}

fn rgb(c: Rgb) -> String {
    format!("({}, {}, {})", Number(c.r), Number(c.g), Number(c.b))
}

pub(super) fn vector<T: Copy + Display + LowerExp + Into<f64>>(v: [T; 3]) -> String {
    format!("({}, {}, {})", Number(v[0]), Number(v[1]), Number(v[2]))
}
