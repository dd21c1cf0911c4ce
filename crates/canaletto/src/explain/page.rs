//! An explanation as a page: the drawing, the way from light to the file, and the terms as tables that fold.

use super::drawing::drawn_levels;
use super::light_text::{by_light, dark, sum_of};
use super::number::Digits;
use super::outside::OutsideView;
use super::path::PathTree;
use super::ray_tree::RayTree;
use super::term::Value;
use super::text_writer::{TextStyle, counted};
use super::tree::{HitNode, LightNode, Outcome, PixelTree, RayNode};
use super::tree_svg::{escaped, hex};
use crate::integrator::RayKind;
use crate::material::Parameter;
use crate::math::Rgb;
use std::fmt::Write;

/// What a page shows besides a tree.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct PageStyle<'a> {
    /// The scene's name, for the title.
    pub scene: &'a str,
    /// How numbers and the text at the end are written, and how many levels of rays are drawn.
    pub text: TextStyle,
    /// The scene from outside, with the address of its picture.
    pub outside: Option<(&'a OutsideView, &'a str)>,
}

impl<'a> PageStyle<'a> {
    /// A page about a pixel or ray of this scene.
    pub fn new(scene: &'a str, text: TextStyle) -> PageStyle<'a> {
        PageStyle { scene, text, outside: None }
    }
}

/// The most samples that have a row each.
const MOST_SAMPLES: usize = 64;

/// The number of levels of rays that are unfolded at first.
const OPEN_LEVELS: u32 = 2;

/// The digits of numbers, if none are given.
const USUAL_DIGITS: u8 = 6;

impl PixelTree {
    /// The tree as an HTML page that needs no other file. Rays have the numbers of the drawing.
    pub fn html(&self, style: &PageStyle) -> String {
        let ([x, y], chosen) = (self.pixel, self.nearest_to_mean());
        let mut page = Page::begin(style, &format!("pixel ({x}, {y})"), self.color);
        page.drawing(&self.svg(style.text.levels, style.outside));
        page.html += "<h2>From light to the file</h2><table>\n";
        page.colored_row("sum of the terms", "5.39b", &page.value(self.sum()), self.sum());
        let is_equal = if self.sum() == self.color { "equal, bit for bit" } else { "NOT equal: this is a bug" };
        page.colored_row(&format!("rendered pixel ({is_equal})"), "", &page.value(self.color), self.color);
        let developed = &self.developed;
        if let Some(values) = &developed.values {
            if let (Some(alpha), Some(straight)) = (developed.alpha, values.straight) {
                page.row("alpha, the share of the background that is hidden", "", &page.value(alpha));
                page.colored_row("colour divided by alpha", "", &page.value(straight), straight);
            }
            if let Some(stops) = developed.exposure.filter(|stops| *stops != 0.0) {
                let name = format!("exposure of {} stops", page.value(stops));
                page.colored_row(&name, "", &page.value(values.exposed), values.exposed);
            }
            page.colored_row(&format!("tone {}", developed.tone), "", &page.value(values.toned), values.toned);
            page.row(&format!("transfer {}", developed.transfer), "", &page.value(values.displayed));
            let [r, g, b] = values.bytes;
            let code = format!("#{r:02x}{g:02x}{b:02x}");
            let swatch = format!("<i class=\"swatch\" style=\"background:{code}\"></i>");
            page.row_with("bytes in the file", "", &format!("{r} {g} {b}  {code}"), &swatch);
        } else if let Some([what, why]) = developed.unknown() {
            page.row(what, "", why);
        }
        page.html += "</table>\n";
        if self.samples.len() > 1 {
            self.write_samples_table(&mut page, chosen);
        }
        if let Some(sample) = self.samples.get(chosen) {
            page.tree(&sample.ray);
        }
        page.end(&self.text(&style.text))
    }

    fn write_samples_table(&self, page: &mut Page, chosen: usize) {
        let total: f64 = self.samples.iter().map(|sample| sample.weight).sum();
        let _ = writeln!(
            page.html,
            "<details><summary>{}; the tree is that of sample {}, the nearest to the pixel</summary><table>",
            counted(self.samples.len(), "sample"),
            chosen + 1
        );
        for (index, sample) in self.samples.iter().take(MOST_SAMPLES).enumerate() {
            let [x, y] = sample.position.map(|v| page.value(v));
            let object = name_of(&sample.ray);
            let name = format!("sample {} at ({x}, {y}), {object}", index + 1);
            let value = format!("{} × {}", page.value(sample.weight / total), page.value(sample.ray.color));
            page.colored_row(&name, "", &value, sample.ray.color);
        }
        if self.samples.len() > MOST_SAMPLES {
            page.row(&format!("{} more", self.samples.len() - MOST_SAMPLES), "", "");
        }
        page.html += "</table></details>\n";
    }
}

impl PathTree {
    /// The paths as an HTML page that needs no other file: the drawing and the text of the path of the sample with the
    /// index `chosen`, or of the one nearest to the pixel's colour.
    pub fn html(&self, chosen: Option<usize>, style: &PageStyle) -> String {
        let [x, y] = self.pixel;
        let mut page = Page::begin(style, &format!("pixel ({x}, {y})"), self.color);
        page.drawing(&self.svg(chosen, style.text.levels, style.outside).unwrap_or_default());
        let text = self.text(&style.text, chosen);
        let _ = writeln!(page.html, "<pre>{}</pre>", text.lines().map(escaped).collect::<Vec<_>>().join("\n"));
        page.end(&self.text(&TextStyle::FULL, None))
    }
}

impl RayTree {
    /// The tree as an HTML page, as [`PixelTree::html`].
    pub fn html(&self, style: &PageStyle) -> String {
        let mut page = Page::begin(style, "a ray", self.color);
        page.drawing(&self.svg(style.text.levels, style.outside));
        page.tree(&self.ray);
        page.end(&self.text(&style.text))
    }
}

/// A page while it is written. A string takes all that is written, so that results of writing are dropped.
struct Page {
    html: String,
    digits: Digits,
    levels: Option<u32>,
    /// The number of rays that are written already.
    written: usize,
}

impl Page {
    fn begin(style: &PageStyle, what: &str, color: Rgb) -> Page {
        let mut html = String::new();
        let title = format!("{}: {what}", escaped(style.scene));
        let _ = write!(
            html,
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" \
             content=\"width=device-width\"><title>{title}</title><style>{STYLE}</style></head><body>\n\
             <h1><i class=\"swatch\" style=\"background:{}\"></i> {title}</h1>\n",
            hex(color)
        );
        let digits = Digits::Significant(style.text.digits.unwrap_or(USUAL_DIGITS));
        Page { html, digits, levels: style.text.levels, written: 0 }
    }

    fn end(mut self, text: &str) -> String {
        let _ = write!(
            self.html,
            "<details><summary>All of it as text</summary><pre>{}</pre></details>\n</body></html>\n",
            // Line breaks are kept, which `escaped` replaces.
            text.lines().map(escaped).collect::<Vec<_>>().join("\n")
        );
        self.html
    }

    /// Adds a drawing. On a narrow screen it keeps a size that can be read, and is scrolled by itself.
    fn drawing(&mut self, svg: &str) {
        let _ = writeln!(self.html, "<figure>{svg}</figure>");
    }

    fn value<'a>(&self, value: impl Into<Value<'a>>) -> String {
        value.into().text(self.digits)
    }

    fn row(&mut self, name: &str, equation: &str, value: &str) {
        self.row_with(name, equation, value, "");
    }

    fn colored_row(&mut self, name: &str, equation: &str, value: &str, color: Rgb) {
        let swatch = format!("<i class=\"swatch\" style=\"background:{}\"></i>", hex(color));
        self.row_with(name, equation, value, &swatch);
    }

    fn row_with(&mut self, name: &str, equation: &str, value: &str, swatch: &str) {
        let equation = if equation.is_empty() { String::new() } else { format!("({equation})") };
        let _ = writeln!(
            self.html,
            "<tr><th>{}</th><td>{equation}</td><td>{}</td><td>{swatch}</td></tr>",
            escaped(name),
            escaped(value)
        );
    }

    fn tree(&mut self, ray: &RayNode) {
        self.html += "<h2>The terms</h2>\n";
        let deepest = drawn_levels(ray, self.levels);
        self.ray(ray, 1, deepest);
    }

    /// Writes a ray with all that lies below it, down to the deepest level.
    fn ray(&mut self, ray: &RayNode, level: u32, deepest: u32) {
        self.written += 1;
        let open = if level <= OPEN_LEVELS { " open" } else { "" };
        let _ = writeln!(
            self.html,
            "<details class=\"node\"{open}><summary><b>{}</b> {} → {} <i class=\"swatch\" style=\"background:{}\"></i> \
             {}</summary><table>",
            self.written,
            kind_words(ray.kind),
            escaped(name_of(ray)),
            hex(ray.color),
            self.value(ray.color)
        );
        self.row("origin o", "5.4", &self.value(ray.origin));
        self.row("direction d", "5.4", &self.value(ray.direction));
        if let Some([from, into]) = ray.media {
            self.row("media", "5.43", &format!("from eta {} into eta {}", self.value(from), self.value(into)));
        }
        match &ray.outcome {
            Outcome::Miss { background, .. } => {
                self.colored_row(name_of(ray), "", &self.value(*background), *background)
            }
            Outcome::Hit(hit) => self.hit(hit, ray.color, level, deepest),
        }
        // The table of a hit ends before its child rays.
        self.html += if matches!(ray.outcome, Outcome::Hit(_)) { "</details>\n" } else { "</table></details>\n" };
    }

    fn hit(&mut self, hit: &HitNode, color: Rgb, level: u32, deepest: u32) {
        self.row("t", "", &self.value(hit.t));
        self.row("point p", "5.4", &self.value(hit.point));
        self.row("normal n", "", &self.value(hit.shading_normal));
        self.material(hit);
        if let Some(kd) = hit.unlit {
            self.colored_row("+ unlit colour kd", "", &self.value(kd), kd);
        }
        if let Some(ambient) = hit.ambient {
            let (name, equation) =
                if hit.radiosity.is_some() { ("+ radiosity's light · kd", "") } else { ("+ ambient Ia kd", "5.33") };
            self.colored_row(name, equation, &self.value(ambient), ambient);
        }
        if let Some(emitters) = &hit.emitters {
            self.colored_row("+ emitting surfaces E kd", "", &self.value(emitters.contribution), emitters.contribution);
        }
        if let Some(emission) = hit.emission {
            self.colored_row("+ emission", "", &self.value(emission), emission);
        }
        for points in by_light(&hit.lights) {
            self.light(points);
        }
        for child in &hit.children {
            let factor = if child.kind == RayKind::Reflected { "k" } else { "(1 − o)" };
            let product = child.color * child.factor;
            let value = format!("{} · {} = {}", self.value(child.factor), self.value(child.color), self.value(product));
            self.colored_row(&format!("+ {factor} · {}", kind_words(child.kind)), "5.39b", &value, product);
        }
        for cut in &hit.cut {
            let name = format!("+ 0: {} not traced", kind_words(cut.kind));
            self.row(&name, "5.39b", "because of max-depth or min-weight");
        }
        if let Some((overlay, share)) = hit.overlay {
            let value = format!("{} · {}", self.value(share), self.value(overlay));
            self.colored_row("overlay by a texture", "", &value, overlay);
        }
        if let Some(coverage) = hit.coverage {
            self.row("· coverage", "", &self.value(coverage));
        }
        self.colored_row("= colour of the ray", "5.39b", &self.value(color), color);
        self.html += "</table>\n";
        for child in hit.children.iter().chain(&hit.behind) {
            if level < deepest {
                self.ray(child, level + 1, deepest);
            } else {
                let _ = writeln!(self.html, "<p>The {} and all below it are not shown.</p>", kind_words(child.kind));
            }
        }
    }

    fn material(&mut self, hit: &HitNode) {
        let phong = &hit.phong;
        for parameter in Parameter::ALL {
            let value = parameter.get(phong);
            if value == parameter.default_value() {
                continue;
            }
            let name = format!("{} of {}", parameter.symbol, hit.material);
            match value.to_vec()[..] {
                [r, g, b] => self.colored_row(&name, "", &self.value([r, g, b]), Rgb { r, g, b }),
                ref numbers => {
                    let numbers: Vec<String> = numbers.iter().map(|v| self.value(*v)).collect();
                    self.row(&name, "", &numbers.join(" "));
                }
            }
        }
        for texture in &hit.textures {
            let value: Vec<String> = texture.value.iter().map(|v| self.value(*v)).collect();
            self.row(&format!("texture {} for {}", texture.texture, texture.used), "5.5", &value.join(" "));
        }
    }

    fn light(&mut self, points: &[LightNode]) {
        let (sum, name) = (sum_of(points), &points[0].light);
        let lit = points.iter().find(|point| dark(point).is_none());
        let how = match (points, lit) {
            ([point], Some(_)) => {
                let names: Vec<&str> = point.blockers.iter().map(|blocker| blocker.object.as_str()).collect();
                let by = if names.is_empty() { String::new() } else { format!(" by {}", names.join(", ")) };
                format!("f_s = {}{by}, n·L = {}, ", self.value(point.f_s), self.value(point.n_dot_l))
            }
            ([point], None) => format!("{}, ", dark(point).unwrap_or_default()),
            (points, _) => {
                let passed = points.iter().filter(|point| point.f_s > 0.0 && dark(point).is_none()).count();
                format!("{passed} of {} points arrive, ", points.len())
            }
        };
        self.colored_row(&format!("+ {name}"), "5.39a", &format!("{how}{}", self.value(sum)), sum);
        if let ([point], Some(_)) = (points, lit) {
            self.colored_row("  diffuse l kd (n·L)", "5.32", &self.value(point.diffuse), point.diffuse);
            self.colored_row("  specular l ks (r·L)ⁿ", "5.38", &self.value(point.specular), point.specular);
        }
    }
}

fn name_of(ray: &RayNode) -> &str {
    match &ray.outcome {
        Outcome::Hit(hit) => &hit.object,
        Outcome::Miss { environment: Some(_), .. } => "environment",
        Outcome::Miss { environment: None, .. } => "background",
    }
}

fn kind_words(kind: RayKind) -> &'static str {
    super::ray_text::kind_name(kind)
}

/// Light and dark, as the reader's browser is. On a screen as narrow as a phone's, a value stands below its name, and
/// long lines wrap.
const STYLE: &str = "\
    :root{color-scheme:light dark}body{font:15px/1.5 system-ui,sans-serif;max-width:72rem;margin:1.5rem auto;\
    padding:0 1rem;background:#fff;color:#222}h1{font-size:1.4rem;overflow-wrap:anywhere}h2{font-size:1.1rem;\
    margin-top:2rem}figure{margin:0;overflow-x:auto}svg{max-width:100%;height:auto}\
    table{border-collapse:collapse;margin:.4rem 0}th,td{text-align:left;padding:.15rem .8rem .15rem 0;border-bottom:1px solid #ddd;vertical-align:top;\
    font-variant-numeric:tabular-nums}th{font-weight:normal;white-space:pre}td:nth-child(2){color:#777}\
    .swatch{display:inline-block;width:1.1em;height:1.1em;border:1px solid #888;vertical-align:-.2em}\
    details.node{border-left:3px solid #ccc;padding-left:.8rem;margin:.5rem 0}summary{cursor:pointer}\
    pre{overflow-x:auto;font-size:12px}@media(prefers-color-scheme:dark){body{background:#16181c;color:#ddd}\
    th,td,tr{border-color:#333}td:nth-child(2){color:#999}details.node{border-color:#444}}\
    @media(max-width:40rem){body{margin:.5rem auto;padding:0 .6rem}svg{max-width:none;width:40rem}\
    table{width:100%}tr{display:grid;grid-template-columns:1fr auto;padding:.25rem 0;border-bottom:1px solid #ddd}\
    th,td{border:0;padding:0;overflow-wrap:anywhere}th{white-space:pre-wrap}pre{white-space:pre-wrap;\
    overflow-wrap:anywhere}td:nth-child(2n){text-align:right}details.node{padding-left:.4rem;border-left-width:2px}}";
