//! The light of radiosity and its patches as text.

use super::patch::{
    CornerNode, LightSum, LinkNode, OthersNode, PatchNode, PlaceNode, RadiosityNode, SourceKind, SourceNode,
};
use super::patch_terms::BlendedPlace;
use super::text_writer::{TextWriter, counted};
use super::tree::Side;
use crate::integrator::ShownLight;
use glam::DVec3;

/// The names of the parts of light.
pub(super) const PARTS: [&str; 3] = ["direct light", "light from emitting surfaces", "indirect light"];

/// The index of the first part that is shown; those after it are shown, too.
fn first_part(shown: ShownLight) -> usize {
    match shown {
        ShownLight::Indirect => 2,
        ShownLight::FromSurfaces => 1,
        ShownLight::All => 0,
    }
}

/// The parts of light that are shown.
pub(super) fn shown_parts(shown: ShownLight) -> String {
    PARTS[first_part(shown)..].join(" + ")
}

/// The most sources of light that are written if the text is folded.
const MOST_SOURCES: usize = 6;

/// Writes how the light at a hit is made of that of a patch, or of its centre and vertices.
pub(super) fn write_radiosity(w: &mut TextWriter, node: &RadiosityNode, indent: &str) {
    let first = first_part(node.shown);
    let what = shown_parts(node.shown);
    let how = if node.is_interpolated {
        "interpolated between the patch's centre and two vertices"
    } else {
        "of the whole patch"
    };
    writeln!(w, "{indent}{}: {what}, {how}", w.vector(node.light));
    for corner in &node.corners {
        let place = match corner.vertex {
            Some(vertex) => format!("vertex {vertex}"),
            None if node.is_interpolated => format!("centre of patch {}", node.patch),
            None => format!("patch {}", node.patch),
        };
        let weight = if node.is_interpolated { format!(", weight {}", w.number(corner.weight)) } else { String::new() };
        let parts = [corner.direct, corner.from_emitters, corner.indirect];
        if !w.is_full {
            let light = parts[first..].iter().fold(DVec3::ZERO, |sum, &part| sum + DVec3::from(part));
            let light = w.vector(light.to_array());
            writeln!(w, "{indent}    {place} at {}{weight}: {light}", w.vector(corner.point));
            continue;
        }
        writeln!(w, "{indent}    {place} at {}{weight}", w.vector(corner.point));
        let deeper = format!("{indent}    ");
        match untold_place(w, node, corner) {
            Some(place) => {
                for (name, sum) in PARTS.iter().zip(sums_of(place)).skip(first) {
                    write_sum(w, name, sum, &deeper);
                }
            }
            None => {
                for (name, light) in PARTS.iter().zip(parts).skip(first) {
                    writeln!(w, "{deeper}    {name} {}", w.vector(light));
                }
            }
        }
    }
    if w.is_full {
        return write_patch_once(w, node.patch, indent);
    }
    write_largest_sources(w, node, first, indent);
}

/// The terms of a place that aren't written yet.
fn untold_place<'t>(w: &mut TextWriter<'t>, node: &RadiosityNode, corner: &CornerNode) -> Option<&'t PlaceNode> {
    let (index, place) = place_of(w, node, corner)?;
    w.lit.told_places.insert(index).then_some(place)
}

fn place_of<'t>(w: &TextWriter<'t>, node: &RadiosityNode, corner: &CornerNode) -> Option<(usize, &'t PlaceNode)> {
    let wanted = BlendedPlace::of(node, corner)?;
    w.lit.terms.places.iter().enumerate().find(|(_, place)| match wanted {
        BlendedPlace::Center(patch) => place.patch == Some(patch),
        BlendedPlace::Vertex(vertex) => place.vertex == Some(vertex),
    })
}

fn sums_of(place: &PlaceNode) -> [&LightSum; 3] {
    [&place.direct, &place.from_emitters, &place.indirect]
}

/// Writes what gives most of the light at a hit, as weighted means over its places.
fn write_largest_sources(w: &mut TextWriter, node: &RadiosityNode, first: usize, indent: &str) {
    let weights: f64 = node.corners.iter().map(|corner| corner.weight).sum();
    let mut sources: Vec<(String, DVec3)> = Vec::new();
    let mut others = DVec3::ZERO;
    for corner in &node.corners {
        let sums = match place_of(w, node, corner) {
            Some((_, place)) => sums_of(place),
            None => {
                match w.lit.terms.patches.iter().find(|patch| !node.is_interpolated && patch.number == node.patch) {
                    Some(patch) => [&patch.direct, &patch.from_emitters, &patch.indirect],
                    None => return writeln!(w, "{indent}    {}", unknown(w, node.patch)),
                }
            }
        };
        let share = corner.weight / weights;
        for sum in &sums[first..] {
            for source in &sum.sources {
                let light = DVec3::from(source.light) * share;
                let name = format!("{}{}", source.name, material_of(source));
                match sources.iter_mut().find(|(other, _)| *other == name) {
                    Some((_, sum)) => *sum += light,
                    None => sources.push((name, light)),
                }
            }
            others += sum.others.map_or(DVec3::ZERO, |others| others.light.into()) * share;
        }
    }
    sources.sort_by(|a, b| b.1.element_sum().total_cmp(&a.1.element_sum()));
    for (name, light) in sources.iter().take(MOST_SOURCES) {
        writeln!(w, "{indent}    from {name}: {}", w.vector(light.to_array()));
    }
    let more = sources.len().saturating_sub(MOST_SOURCES);
    others += sources.iter().skip(MOST_SOURCES).fold(DVec3::ZERO, |sum, (_, light)| sum + *light);
    if more > 0 || others != DVec3::ZERO {
        writeln!(w, "{indent}    from other surfaces: {}", w.vector(others.to_array()));
    }
}

fn unknown(w: &TextWriter, patch: u32) -> String {
    if w.lit.terms.patches.is_empty() {
        format!("patch {patch}: what lights it isn't known, since a solution that was saved has no links")
    } else {
        format!("patch {patch}: not explained, since many patches lie under the pixel")
    }
}

/// Writes a patch and what lights it, unless that was written before.
fn write_patch_once(w: &mut TextWriter, number: u32, indent: &str) {
    match w.lit.terms.patches.iter().find(|patch| patch.number == number) {
        Some(_) if !w.lit.told.insert(number) => writeln!(w, "{indent}patch {number}: as above"),
        Some(patch) => write_patch(w, patch, indent),
        None => writeln!(w, "{indent}{}", unknown(w, number)),
    }
}

fn write_patch(w: &mut TextWriter, patch: &PatchNode, indent: &str) {
    let PatchNode { number, object, kind, primitive, material, side, corners, center, area, .. } = patch;
    let side = match side {
        Side::Outside => "outer",
        Side::Inside => "inner",
    };
    let which = if super::tree::has_primitives(kind) { format!(", primitive {primitive}") } else { String::new() };
    writeln!(w, "{indent}patch {number}: {object}{which} ({kind}), {side} side, material \"{material}\"");
    let corners: Vec<String> = corners.iter().map(|corner| w.vector(*corner)).collect();
    writeln!(w, "{indent}    corners {}", corners.join(", "));
    writeln!(w, "{indent}    centre {}, area {}", w.vector(*center), w.size(*area));
    for (name, sum) in PARTS.iter().zip([&patch.direct, &patch.from_emitters, &patch.indirect]) {
        write_sum(w, name, sum, indent);
    }
    let equal =
        if patch.sum().to_array() == patch.radiance { "equal, bit for bit" } else { "NOT equal: this is a bug" };
    writeln!(
        w,
        "{indent}    radiosity = emission {} + reflectance {} * (direct + emitters + indirect)",
        w.vector(patch.emission),
        w.vector(patch.reflectance)
    );
    writeln!(w, "{indent}              = {}  ({equal})", w.vector(patch.radiance));
}

fn write_sum(w: &mut TextWriter, name: &str, sum: &LightSum, indent: &str) {
    writeln!(w, "{indent}    {name}");
    for source in &sum.sources {
        write_source(w, source, indent);
    }
    write_others(w, sum.others.as_ref(), "source", &format!("{indent}        "));
    if sum.rounding != [0.0; 3] {
        writeln!(w, "{indent}        + {}: {}", rounding_of(sum), w.vector(sum.rounding));
    }
    writeln!(w, "{indent}        = {}", w.vector(sum.light));
}

/// The reason why a sum's terms have another sum than the solver found.
fn rounding_of(sum: &LightSum) -> &'static str {
    let most = |light: DVec3| light.abs().max_element();
    if most(sum.rounding.into()) <= 1e-9 * most(sum.sum_without_rounding()) {
        "rounding, since the solver adds in another order"
    } else {
        "what is missing to 0, since light is never negative"
    }
}

fn material_of(source: &SourceNode) -> String {
    source.material.as_ref().map_or(String::new(), |material| format!(", material \"{material}\""))
}

fn write_source(w: &mut TextWriter, source: &SourceNode, indent: &str) {
    let by = match (source.kind, source.link_count) {
        (SourceKind::Light | SourceKind::Environment, _) => String::new(),
        (SourceKind::Itself, _) => ", what its form factors lack to 1".to_owned(),
        (_, links) => format!(", {}", counted(links, "link")),
    };
    writeln!(w, "{indent}        + {}{}{by}: {}", source.name, material_of(source), w.vector(source.light));
    for LinkNode { center, area, receiver_area, form_factor, radiance, light } in &source.links {
        let product = format!("{} * {}", w.number(*form_factor), w.vector(*radiance));
        writeln!(w, "{indent}            {product} = {}", w.vector(*light));
        if source.kind != SourceKind::Itself {
            let from = format!("from area {} around {}", w.size(*area), w.vector(*center));
            writeln!(w, "{indent}                {from} to area {}", w.size(*receiver_area));
        }
    }
    write_others(w, source.others.as_ref(), "link", &format!("{indent}            "));
}

fn write_others(w: &mut TextWriter, others: Option<&OthersNode>, what: &str, indent: &str) {
    if let Some(OthersNode { count, light }) = others {
        writeln!(w, "{indent}+ {}: {}", counted(*count, &format!("other {what}")), w.vector(*light));
    }
}
