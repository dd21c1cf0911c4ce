//! The light of radiosity and its patches as text.

use super::patch::{
    CornerNode, LightSum, LinkNode, OthersNode, PatchNode, PlaceNode, RadiosityNode, RadiosityTerms, SourceKind,
    SourceNode,
};
use super::patch_terms::BlendedPlace;
use super::term::{Line, Term, line};
use super::text_writer::{TextWriter, counted};
use super::tree::{Side, has_primitives};
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

impl RadiosityNode {
    /// The parts of light that are shown.
    pub(super) fn shown_parts(&self) -> String {
        PARTS[first_part(self.shown)..].join(" + ")
    }
}

/// The most sources of light that are written if the text is folded.
const MOST_SOURCES: usize = 6;

/// Writes how the light at a hit is made of that of a patch, or of its centre and vertices.
pub(super) fn write_radiosity(w: &mut TextWriter, node: &RadiosityNode, indent: &str) {
    let first = first_part(node.shown);
    let what = node.shown_parts();
    let how = if node.is_interpolated {
        "interpolated between the patch's centre and two vertices"
    } else {
        "of the whole patch"
    };
    w.line(indent, &line!("{}: {}, {}", node.light, what, how));
    for corner in &node.corners {
        let place = match corner.vertex {
            Some(vertex) => format!("vertex {vertex}"),
            None if node.is_interpolated => format!("centre of patch {}", node.patch),
            None => format!("patch {}", node.patch),
        };
        let start = line!("    {} at {}", place, corner.point);
        let start = if node.is_interpolated { start.and(line!(", weight {}", corner.weight)) } else { start };
        if !w.is_full {
            let parts = [corner.direct, corner.from_emitters, corner.indirect];
            let light = parts[first..].iter().fold(DVec3::ZERO, |sum, &part| sum + DVec3::from(part));
            w.line(indent, &start.and(line!(": {}", light.to_array())));
            continue;
        }
        w.line(indent, &start);
        let deeper = format!("{indent}    ");
        match untold_place(w, node, corner) {
            Some(place) => {
                for (name, sum) in PARTS.iter().zip(place.sums()).skip(first) {
                    w.lines(&deeper, sum.lines(name));
                }
            }
            None => w.lines(&deeper, corner.lines().into_iter().skip(first)),
        }
    }
    if w.is_full {
        return write_patch_once(w, node.patch, indent);
    }
    write_largest_sources(w, node, first, indent);
}

/// The terms of a place that aren't written yet.
fn untold_place<'t>(w: &mut TextWriter<'t>, node: &RadiosityNode, corner: &CornerNode) -> Option<&'t PlaceNode> {
    let (index, place) = w.terms.place(node, corner)?;
    w.told_places.insert(index).then_some(place)
}

impl RadiosityTerms {
    /// The patch of this number.
    pub(super) fn patch(&self, number: u32) -> Option<&PatchNode> {
        self.patches.iter().find(|patch| patch.number == number)
    }

    /// The place of a corner in a patch's light, with its index.
    pub(super) fn place(&self, node: &RadiosityNode, corner: &CornerNode) -> Option<(usize, &PlaceNode)> {
        let wanted = BlendedPlace::of(node, corner)?;
        self.places.iter().enumerate().find(|(_, place)| match wanted {
            BlendedPlace::Center(patch) => place.patch == Some(patch),
            BlendedPlace::Vertex(vertex) => place.vertex == Some(vertex),
        })
    }
}

impl PlaceNode {
    /// The parts of light.
    pub(super) fn sums(&self) -> [&LightSum; 3] {
        [&self.direct, &self.from_emitters, &self.indirect]
    }
}

impl CornerNode {
    /// The parts of light.
    pub(super) fn lines<'t>(&self) -> Vec<Line<'t>> {
        let parts = PARTS.into_iter().zip([self.direct, self.from_emitters, self.indirect]);
        parts.map(|(name, light)| line!("    {} {}", name, Term::from(light).named(name))).collect()
    }
}

/// Writes what gives most of the light at a hit, as weighted means over its places.
fn write_largest_sources(w: &mut TextWriter, node: &RadiosityNode, first: usize, indent: &str) {
    let weights: f64 = node.corners.iter().map(|corner| corner.weight).sum();
    let mut sources: Vec<(String, DVec3)> = Vec::new();
    let mut others = DVec3::ZERO;
    for corner in &node.corners {
        let terms = w.terms;
        let place = terms.place(node, corner).map(|(_, place)| place.sums());
        let patch = || terms.patch(node.patch).filter(|_| !node.is_interpolated).map(PatchNode::sums);
        let Some(sums) = place.or_else(patch) else {
            return writeln!(w, "{indent}    {}", unknown(w, node.patch));
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
        w.line(indent, &line!("    from {}: {}", name, light.to_array()));
    }
    let more = sources.len().saturating_sub(MOST_SOURCES);
    others += sources.iter().skip(MOST_SOURCES).fold(DVec3::ZERO, |sum, (_, light)| sum + *light);
    if more > 0 || others != DVec3::ZERO {
        w.line(indent, &line!("    from other surfaces: {}", others.to_array()));
    }
}

fn unknown(w: &TextWriter, patch: u32) -> String {
    if w.terms.patches.is_empty() {
        format!("patch {patch}: what lights it isn't known, since a solution that was saved has no links")
    } else {
        format!("patch {patch}: not explained, since many patches lie under the pixel")
    }
}

/// Writes a patch and what lights it, unless that was written before.
fn write_patch_once(w: &mut TextWriter, number: u32, indent: &str) {
    match w.terms.patch(number) {
        Some(_) if !w.told.insert(number) => writeln!(w, "{indent}patch {number}: as above"),
        Some(patch) => w.lines(indent, patch.lines()),
        None => writeln!(w, "{indent}{}", unknown(w, number)),
    }
}

impl PatchNode {
    fn lines(&self) -> Vec<Line<'_>> {
        let PatchNode { number, object, kind, primitive, material, side, corners, center, .. } = self;
        let side = if *side == Side::Outside { "outer" } else { "inner" };
        let which = has_primitives(kind).then(|| format!(", primitive {primitive}"));
        let start = line!("patch {}: {}{} ({})", *number, object, which, *kind);
        let mut lines = vec![
            start.and(line!(", {} side, material \"{}\"", side, material)),
            line!("    corners ").list(corners.iter().map(|corner| line!("{}", *corner))),
            line!("    centre {}, area {}", *center, self.area as f32),
        ];
        lines.extend(PARTS.iter().zip(self.sums()).flat_map(|(name, sum)| sum.lines(name)));
        let is_equal = self.sum().to_array() == self.radiance;
        let equal = if is_equal { "equal, bit for bit" } else { "NOT equal: this is a bug" };
        lines.extend([self.balance_line(), line!("              = {}  ({})", self.radiance, equal)]);
        lines
    }

    /// The parts of light.
    pub(super) fn sums(&self) -> [&LightSum; 3] {
        [&self.direct, &self.from_emitters, &self.indirect]
    }

    /// What the radiosity is made of, besides the light.
    pub(super) fn balance_line<'t>(&self) -> Line<'t> {
        let emission = line!("    radiosity = emission {emission}", self.emission);
        emission.and(line!(" + reflectance {reflectance} * (direct + emitters + indirect)", self.reflectance))
    }
}

impl LightSum {
    /// The sources of a part of light, and their sum.
    pub(super) fn lines(&self, part: &'static str) -> Vec<Line<'_>> {
        let mut lines = vec![line!("    {}", part)];
        lines.extend(self.sources.iter().flat_map(SourceNode::lines));
        lines.extend(self.others.map(|others| line!("        ").and(others.line("source"))));
        let rounding = line!("        + {}: {}", rounding_of(self), self.rounding);
        lines.push(rounding.written_if(self.rounding != [0.0; 3]));
        lines.push(line!("        = {sum}", self.light));
        lines
    }
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

impl SourceNode {
    fn lines(&self) -> Vec<Line<'_>> {
        let by = match (self.kind, self.link_count) {
            (SourceKind::Light | SourceKind::Environment, _) => String::new(),
            (SourceKind::Itself, _) => ", what its form factors lack to 1".to_owned(),
            (_, links) => format!(", {}", counted(links, "link")),
        };
        let light = Term::from(self.light).named(format!("from {}", self.name));
        let mut lines = vec![line!("        + {}{}{}: {}", &self.name, material_of(self), by, light)];
        for LinkNode { center, area, receiver_area, form_factor, radiance, light } in self.links.iter().copied() {
            lines.push(line!("            {} * {} = {}", form_factor, radiance, light));
            let (from, to) = (area as f32, receiver_area as f32);
            let areas = line!("                from area {} around {} to area {}", from, center, to);
            lines.push(areas.written_if(self.kind != SourceKind::Itself));
        }
        lines.extend(self.others.map(|others| line!("            ").and(others.line("link"))));
        lines
    }
}

impl OthersNode {
    fn line<'t>(&self, what: &str) -> Line<'t> {
        line!("+ {}: {}", counted(self.count, &format!("other {what}")), self.light)
    }
}
