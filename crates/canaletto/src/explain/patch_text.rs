//! The light of radiosity and its patches as text for a terminal.

use super::number::Number;
use super::patch::{LightSum, LinkNode, OthersNode, PatchNode, PlaceNode, RadiosityNode, SourceKind, SourceNode};
use super::text::vector;
use super::tree::Side;
use crate::integrator::ShownLight;
use glam::DVec3;
use std::fmt::{self, Formatter};

/// Writes how the light at a hit is made of that of patches and vertices.
///
/// `places` are those whose terms are known. Each is removed when it is written.
pub(super) fn write_radiosity(
    f: &mut Formatter,
    node: &RadiosityNode,
    places: &mut Vec<&PlaceNode>,
    indent: &str,
) -> fmt::Result {
    let what = match node.shown {
        ShownLight::Indirect => "indirect light",
        ShownLight::FromSurfaces => "light from emitting surfaces + indirect light",
        _ => "direct light + light from emitting surfaces + indirect light",
    };
    let how = match node.corners.len() {
        1 => "of the whole patch",
        _ => "interpolated between the patch's centre and two vertices",
    };
    writeln!(f, "{indent}{}: {what}, {how}", vector(node.light))?;
    for corner in &node.corners {
        let place = match corner.vertex {
            Some(vertex) => format!("vertex {vertex}"),
            None if node.is_interpolated => format!("centre of patch {}", node.patch),
            None => format!("patch {}", node.patch),
        };
        let share = if node.corners.len() > 1 { format!(", weight {}", Number(corner.weight)) } else { String::new() };
        writeln!(f, "{indent}    {place} at {}{share}", vector(corner.point))?;
        let deeper = format!("{indent}    ");
        let parts = [("direct", corner.direct), ("emitters", corner.from_emitters), ("indirect", corner.indirect)];
        let hidden = match node.shown {
            ShownLight::Indirect => 2,
            ShownLight::FromSurfaces => 1,
            _ => 0,
        };
        let terms = places.iter().position(|place| match corner.vertex {
            Some(_) => place.vertex == corner.vertex,
            None => node.is_interpolated && place.patch == Some(node.patch),
        });
        if let Some(PlaceNode { direct, from_emitters, indirect, .. }) = terms.map(|index| places.swap_remove(index)) {
            for (name, sum) in SUMS.iter().zip([direct, from_emitters, indirect]).skip(hidden) {
                write_sum(f, name, sum, &deeper)?;
            }
            continue;
        }
        for (part, light) in parts.iter().skip(hidden) {
            writeln!(f, "{indent}        {part} {}", vector(*light))?;
        }
    }
    Ok(())
}

/// The names of the parts of light.
const SUMS: [&str; 3] = ["direct light", "light from emitting surfaces", "indirect light"];

/// Writes a patch and what lights it.
pub(super) fn write_patch(f: &mut Formatter, patch: &PatchNode, indent: &str) -> fmt::Result {
    let PatchNode { number, object, kind, primitive, material, side, corners, center, area, .. } = patch;
    let side = match side {
        Side::Outside => "outer",
        Side::Inside => "inner",
    };
    let which = if super::tree::has_primitives(kind) { format!(", primitive {primitive}") } else { String::new() };
    writeln!(f, "{indent}patch {number}: {object}{which} ({kind}), {side} side, material \"{material}\"")?;
    let corners: Vec<String> = corners.iter().map(|corner| vector(*corner)).collect();
    writeln!(f, "{indent}    corners {}", corners.join(", "))?;
    writeln!(f, "{indent}    centre {}, area {}", vector(*center), size(*area))?;
    for (name, sum) in SUMS.iter().zip([&patch.direct, &patch.from_emitters, &patch.indirect]) {
        write_sum(f, name, sum, indent)?;
    }
    let equal =
        if patch.sum().to_array() == patch.radiance { "equal, bit for bit" } else { "NOT equal: this is a bug" };
    writeln!(
        f,
        "{indent}    radiosity = emission {} + reflectance {} * (direct + emitters + indirect)",
        vector(patch.emission),
        vector(patch.reflectance)
    )?;
    writeln!(f, "{indent}              = {}  ({equal})", vector(patch.radiance))
}

fn write_sum(f: &mut Formatter, name: &str, sum: &LightSum, indent: &str) -> fmt::Result {
    writeln!(f, "{indent}    {name}")?;
    for source in &sum.sources {
        write_source(f, source, indent)?;
    }
    write_others(f, sum.others.as_ref(), "sources", &format!("{indent}        "))?;
    if sum.rounding != [0.0; 3] {
        writeln!(f, "{indent}        + {}: {}", rounding_of(sum), vector(sum.rounding))?;
    }
    writeln!(f, "{indent}        = {}", vector(sum.light))
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

fn write_source(f: &mut Formatter, source: &SourceNode, indent: &str) -> fmt::Result {
    let by = match (source.kind, source.link_count) {
        (SourceKind::Light | SourceKind::Environment, _) => "",
        (SourceKind::Itself, _) => ", what its form factors lack to 1",
        (_, 1) => ", 1 link",
        (_, links) => &format!(", {links} links"),
    };
    let material = source.material.as_ref().map_or(String::new(), |material| format!(", material \"{material}\""));
    writeln!(f, "{indent}        + {}{material}{by}: {}", source.name, vector(source.light))?;
    for LinkNode { center, area, receiver_area, form_factor, radiance, light } in &source.links {
        writeln!(f, "{indent}            {} * {} = {}", Number(*form_factor), vector(*radiance), vector(*light))?;
        if source.kind != SourceKind::Itself {
            writeln!(
                f,
                "{indent}                from area {} around {} to area {}",
                size(*area),
                vector(*center),
                size(*receiver_area)
            )?;
        }
    }
    write_others(f, source.others.as_ref(), "links", &format!("{indent}            "))
}

fn write_others(f: &mut Formatter, others: Option<&OthersNode>, what: &str, indent: &str) -> fmt::Result {
    match others {
        Some(OthersNode { count, light }) => writeln!(f, "{indent}+ {count} other {what}: {}", vector(*light)),
        None => Ok(()),
    }
}

/// An area with the digits of `f32`, since no sum depends on it.
fn size(area: f64) -> Number<f32> {
    Number(area as f32)
}
