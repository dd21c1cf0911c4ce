//! The tree of rays as a drawing (fig. 5.29): surfaces with swatches of their colours, rays with their factors, and a
//! mark for each light.

use super::drawing::{DrawnLight, DrawnRay};
use super::outside::{OUTSIDE_STYLE, OutsideView};
use super::ray_tree::RayTree;
use super::tree::PixelTree;
use crate::film::srgb_encode;
use crate::integrator::RayKind;
use crate::math::Rgb;
use std::fmt::Write;

/// The size of a node, the gap beside it and the distance of rows, in pixels.
const NODE: [f64; 2] = [148.0, 62.0];
const GAP: f64 = 16.0;
const ROW: f64 = 128.0;

/// The space on both sides, for labels beside the outermost rays.
const LABEL: f64 = 72.0;

/// The space above the first row, for the first ray.
const TOP: f64 = 56.0;

/// The largest width of a tree beside which the view from outside stands.
const WIDE: f64 = 900.0;

/// The most lights with a mark of their own.
const MOST_LIGHTS: usize = 8;

/// The most letters of a name.
const MOST_LETTERS: usize = 17;

impl PixelTree {
    /// The tree of the sample that [`PixelTree::text`] chooses as SVG. `levels` is the number of rows; none stands for
    /// as many as are easy to look at. Beside it stands the scene from outside, if a view of [`PixelTree::outside`] is
    /// given with the address of its picture, such as a data URL.
    pub fn svg(&self, levels: Option<u32>, outside: Option<(&OutsideView, &str)>) -> String {
        let [x, y] = self.pixel;
        let (index, count) = (self.nearest_to_mean(), self.samples.len());
        let sample = if count > 1 { format!(", sample {} of {count}", index + 1) } else { String::new() };
        match self.samples.get(index) {
            Some(sampled) => {
                drawing(&DrawnRay::of_tree(&sampled.ray, levels), &format!("pixel ({x}, {y}){sample}"), outside)
            }
            None => drawing_of(&[], 0.0, 0, "no sample", None),
        }
    }
}

impl RayTree {
    /// The tree as SVG, as [`PixelTree::svg`].
    pub fn svg(&self, levels: Option<u32>, outside: Option<(&OutsideView, &str)>) -> String {
        drawing(&DrawnRay::of_tree(&self.ray, levels), "a ray", outside)
    }
}

/// A node with its place.
struct Placed<'t> {
    ray: &'t DrawnRay,
    /// The middle of its upper edge.
    at: [f64; 2],
    /// The index of its parent.
    parent: Option<usize>,
}

/// The drawing of a ray and those below it.
pub(super) fn drawing(ray: &DrawnRay, title: &str, outside: Option<(&OutsideView, &str)>) -> String {
    let (mut placed, mut next) = (Vec::new(), LABEL);
    place(ray, None, TOP, &mut placed, &mut next);
    let rows = placed.iter().map(|node| node.at[1]).fold(0.0, f64::max);
    drawing_of(&placed, next, ((rows - TOP) / ROW) as u32 + 1, title, outside)
}

/// Places a node above the middle of its children, and returns the middle of its upper edge.
fn place<'t>(ray: &'t DrawnRay, parent: Option<usize>, y: f64, placed: &mut Vec<Placed<'t>>, next: &mut f64) -> f64 {
    let index = placed.len();
    placed.push(Placed { ray, at: [0.0, y], parent });
    let middles: Vec<f64> = ray.below.iter().map(|child| place(child, Some(index), y + ROW, placed, next)).collect();
    let x = match (middles.first(), middles.last()) {
        (Some(first), Some(last)) => (first + last) / 2.0,
        _ => {
            let x = *next + NODE[0] / 2.0;
            *next += NODE[0] + GAP;
            x
        }
    };
    placed[index].at[0] = x;
    x
}

fn drawing_of(placed: &[Placed], width: f64, rows: u32, title: &str, outside: Option<(&OutsideView, &str)>) -> String {
    let mut height = TOP + f64::from(rows) * ROW;
    // The last label may be wider than its node.
    let mut width = (width + LABEL).max(320.0);
    // The view stands beside a narrow tree, and below a wide one.
    let place_of_view = if width <= WIDE { [width, 32.0] } else { [GAP, height + GAP] };
    if let Some((view, _)) = outside {
        let [own_width, own_height] = view.size();
        width = width.max(place_of_view[0] + own_width + GAP);
        height = height.max(place_of_view[1] + own_height + GAP);
    }
    let mut svg = String::new();
    // A string takes all that is written.
    let _ = write!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" font-family=\"sans-serif\" font-size=\"12\">\n<style>{STYLE}{}</style>\n<rect class=\"paper\" \
         width=\"{width}\" height=\"{height}\"/>\n<text x=\"{GAP}\" y=\"20\">{}: the tree of rays</text>\n",
        if outside.is_some() { OUTSIDE_STYLE } else { "" },
        escaped(title)
    );
    for node in placed {
        write_edge(&mut svg, node, node.parent.map(|parent| placed[parent].at));
    }
    (1..).zip(placed).for_each(|(number, node)| write_node(&mut svg, number, node));
    if let Some((view, image)) = outside {
        view.write_svg(&mut svg, place_of_view, image);
    }
    svg + "</svg>\n"
}

/// Light and dark, as the reader's page is.
const STYLE: &str = ".paper{fill:#fff}text{fill:#222}.ray{stroke:#555;fill:none}.node{fill:#f4f4f4;stroke:#888}\
                     .mark{stroke:#888}@media(prefers-color-scheme:dark){.paper{fill:#16181c}text{fill:#ddd}\
                     .ray{stroke:#aaa}.node{fill:#24272d;stroke:#777}}";

fn write_edge(svg: &mut String, node: &Placed, parent: Option<[f64; 2]>) {
    let [x, y] = node.at;
    let [from_x, from_y] = parent.map_or([x, 30.0], |[x, y]| [x, y + NODE[1]]);
    let name = match node.ray.kind {
        RayKind::Eye => String::new(),
        RayKind::Reflected => format!("R, k = {}", factor(node.ray.factor)),
        RayKind::Refracted => format!("T, 1 − o = {}", factor(node.ray.factor)),
        RayKind::TotallyReflected => format!("total R, 1 − o = {}", factor(node.ray.factor)),
        RayKind::Scattered => format!("× {}", factor(node.ray.factor)),
        RayKind::Passed => format!("on, {}", factor(node.ray.factor)),
    };
    let _ = writeln!(svg, "<path class=\"ray\" d=\"M{from_x:.1} {from_y:.1}L{x:.1} {y:.1}\"/>");
    let (label_x, label_y) = ((from_x + 2.0 * x) / 3.0, (from_y + 2.0 * y) / 3.0);
    if !name.is_empty() {
        // The label stands on the outer side of the line.
        let (side, anchor) = if x < from_x { (-5.0, "end") } else { (5.0, "start") };
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{label_y:.1}\" font-size=\"11\" text-anchor=\"{anchor}\">{name}</text>",
            label_x + side
        );
    }
}

fn write_node(svg: &mut String, number: usize, node: &Placed) {
    let [x, y] = node.at;
    let left = x - NODE[0] / 2.0;
    let name = &node.ray.end;
    let mut short: String = name.chars().take(MOST_LETTERS).collect();
    if short.len() < name.len() {
        short.push('…');
    }
    let color = node.ray.color;
    let [r, g, b] = color.to_array().map(|v| format!("{v:.3}"));
    let [width, height] = NODE;
    let _ = write!(
        svg,
        "<g><title>{}</title><rect class=\"node\" x=\"{left:.1}\" y=\"{y:.1}\" width=\"{width}\" height=\"{height}\" \
         rx=\"5\"/><rect class=\"mark\" x=\"{:.1}\" y=\"{:.1}\" width=\"22\" height=\"50\" fill=\"{}\"/>\
         <text x=\"{:.1}\" y=\"{:.1}\">{}</text><text x=\"{:.1}\" y=\"{:.1}\" font-size=\"10\">{r} {g} {b}</text>",
        escaped(name),
        left + 6.0,
        y + 6.0,
        hex(color),
        left + 34.0,
        y + 18.0,
        escaped(&short),
        left + 34.0,
        y + 34.0
    );
    let _ = write!(
        svg,
        "<circle class=\"node\" cx=\"{left:.1}\" cy=\"{y:.1}\" r=\"8.5\"/><text x=\"{left:.1}\" y=\"{:.1}\" \
         font-size=\"10\" text-anchor=\"middle\">{number}</text>",
        y + 3.5
    );
    write_lights(svg, &node.ray.lights, left + 34.0, y + 48.0);
    if node.ray.hidden > 0 {
        let rays = super::text_writer::counted(node.ray.hidden, "more ray");
        let _ = write!(svg, "<text x=\"{left:.1}\" y=\"{:.1}\" font-size=\"10\">{rays}</text>", y + height + 14.0);
    }
    let _ = writeln!(svg, "</g>");
}

/// Writes a round mark for each light: its part of the colour, or a cross if nothing of it arrives.
fn write_lights(svg: &mut String, lights: &[DrawnLight], x: f64, y: f64) {
    for (index, light) in lights.iter().take(MOST_LIGHTS).enumerate() {
        let (cx, cross) = (x + 5.0 + 13.0 * index as f64, light.color.is_black());
        let [r, g, b] = light.color.to_array().map(|v| format!("{v:.3}"));
        let title = format!("{}: {r} {g} {b}", light.name);
        let fill = if cross { "none".to_owned() } else { hex(light.color) };
        let _ = write!(
            svg,
            "<g><title>{}</title><circle class=\"mark\" cx=\"{cx:.1}\" cy=\"{y:.1}\" r=\"5\" fill=\"{fill}\"/>",
            escaped(&title)
        );
        if cross {
            let _ = write!(svg, "<path class=\"ray\" d=\"M{:.1} {:.1}l8 -8\"/>", cx - 4.0, y + 4.0);
        }
        let _ = write!(svg, "</g>");
    }
}

/// A factor as one number if it is gray.
fn factor(Rgb { r, g, b }: Rgb) -> String {
    if r == g && g == b { format!("{r:.2}") } else { format!("({r:.2}, {g:.2}, {b:.2})") }
}

/// A colour as it is shown on a screen.
pub(super) fn hex(color: Rgb) -> String {
    let [r, g, b] = color.to_array().map(|v| {
        let displayed = srgb_encode(if v > 0.0 { v.min(1.0) } else { 0.0 });
        (displayed * 255.0 + 0.5) as u8
    });
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Text for XML. Characters that XML has no place for become spaces.
pub(super) fn escaped(text: &str) -> String {
    text.chars()
        .map(|c| match c {
            '&' => "&amp;".to_owned(),
            '<' => "&lt;".to_owned(),
            '>' => "&gt;".to_owned(),
            '"' => "&quot;".to_owned(),
            c if c.is_control() => " ".to_owned(),
            c => c.to_string(),
        })
        .collect()
}
