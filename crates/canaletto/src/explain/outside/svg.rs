//! The view as SVG.

use super::{Mark, OutsideView, SIZE, Sign, Stroke, StrokeKind};
use crate::explain::tree_svg::{escaped, hex};
use crate::integrator::RayKind;
use glam::DVec2;
use std::fmt::Write;

/// The height of the legend's lines below the view.
const LEGEND: f64 = 22.0;

/// The kinds of lines in the order of the legend, with the class and the name of each.
const KINDS: [(StrokeKind, &str, &str); 8] = [
    (StrokeKind::Ray(RayKind::Eye), "eye", "camera"),
    (StrokeKind::Ray(RayKind::Reflected), "reflected", "reflected"),
    (StrokeKind::Ray(RayKind::Refracted), "refracted", "refracted"),
    (StrokeKind::Ray(RayKind::TotallyReflected), "total", "totally reflected"),
    (StrokeKind::Ray(RayKind::Scattered), "scattered", "scattered"),
    (StrokeKind::Ray(RayKind::Passed), "passed", "straight on"),
    (StrokeKind::Light, "shadow", "to light"),
    (StrokeKind::Blocked, "blocked", "blocked"),
];

/// The styles of the view, light and dark.
pub(in crate::explain) const OUTSIDE_STYLE: &str = "\
    .o{fill:none;stroke-width:1.8}.o.eye{stroke:#b86e00}.o.reflected{stroke:#c2185b}.o.refracted{stroke:#0a6fc2}\
    .o.total{stroke:#7b3fe4}.o.scattered{stroke:#2e7d32}.o.passed{stroke:#666}.o.shadow{stroke:#8a7a00;stroke-width:1.1;stroke-dasharray:6 3}\
    .o.blocked{stroke:#555;stroke-width:1.1;stroke-dasharray:2 3}.frame{fill:none;stroke:#aaa}.halo{stroke:#fff;\
    stroke-width:3;paint-order:stroke}.lamp{fill:#ffd740;stroke:#8a7a00}\
    @media(prefers-color-scheme:dark){.o.eye{stroke:#ffb74d}.o.reflected{stroke:#ff6090}.o.refracted{stroke:#64b5f6}\
    .o.total{stroke:#b39ddb}.o.scattered{stroke:#81c784}.o.passed{stroke:#aaa}.o.shadow{stroke:#e6d24a}.o.blocked{stroke:#bbb}.frame{stroke:#555}\
    .halo{stroke:#16181c}}";

impl OutsideView {
    /// The size of the drawing with its legend.
    pub(in crate::explain) fn size(&self) -> [f64; 2] {
        [SIZE[0], SIZE[1] + LEGEND * self.legend_rows()]
    }

    fn legend(&self) -> Vec<&'static (StrokeKind, &'static str, &'static str)> {
        let occurs = |kind: StrokeKind| self.strokes.iter().any(|stroke| stroke.kind == kind);
        KINDS.iter().filter(|(kind, ..)| occurs(*kind)).collect()
    }

    fn legend_rows(&self) -> f64 {
        self.legend().len().div_ceil(4) as f64
    }

    /// Writes the view with its upper left corner at `at`. `image` is the address of [`OutsideView::picture`], such as
    /// a data URL.
    pub(in crate::explain) fn write_svg(&self, svg: &mut String, at: [f64; 2], image: &str) {
        let ([x, y], [width, height]) = (at, SIZE);
        // A string takes all that is written.
        let _ = write!(
            svg,
            "<g transform=\"translate({x:.1} {y:.1})\"><clipPath id=\"outside\"><rect width=\"{width}\" \
             height=\"{height}\"/></clipPath><g clip-path=\"url(#outside)\"><image width=\"{width}\" \
             height=\"{height}\" href=\"{}\"/>",
            escaped(image)
        );
        // Shadow rays lie below the others.
        let is_shadow = |stroke: &&Stroke| !matches!(stroke.kind, StrokeKind::Ray(_));
        self.strokes.iter().filter(is_shadow).for_each(|stroke| write_stroke(svg, stroke));
        self.strokes.iter().filter(|stroke| !is_shadow(stroke)).for_each(|stroke| write_stroke(svg, stroke));
        self.marks.iter().for_each(|mark| write_mark(svg, mark));
        let _ = write!(svg, "</g><rect class=\"frame\" width=\"{width}\" height=\"{height}\"/>");
        for (index, (_, class, name)) in self.legend().into_iter().enumerate() {
            let x = 6.0 + (index % 4) as f64 * 118.0;
            let y = height + 16.0 + (index / 4) as f64 * LEGEND;
            let _ = write!(
                svg,
                "<path class=\"o {class}\" d=\"M{x} {:.1}h24\"/><text x=\"{}\" y=\"{y}\" font-size=\"11\">{name}</text>",
                y - 4.0,
                x + 30.0
            );
        }
        let _ = writeln!(svg, "</g>");
    }
}

fn class_of(kind: StrokeKind) -> &'static str {
    KINDS.iter().find(|(other, ..)| *other == kind).map_or("passed", |(_, class, _)| class)
}

/// Writes the part of a line within the view, with an arrow in the middle of a ray.
fn write_stroke(svg: &mut String, Stroke { kind, from, to, number }: &Stroke) {
    let Some([from, to]) = clipped(*from, *to) else { return };
    let class = class_of(*kind);
    let _ = write!(svg, "<path class=\"o {class}\" d=\"M{:.1} {:.1}L{:.1} {:.1}", from.x, from.y, to.x, to.y);
    let (along, middle) = ((to - from).normalize_or_zero(), (from + to) / 2.0);
    if matches!(kind, StrokeKind::Ray(_)) && from.distance(to) > 24.0 {
        let side = DVec2::new(-along.y, along.x) * 3.5;
        let [a, b] = [side, -side].map(|side| middle - along * 8.0 + side);
        let _ = write!(svg, "M{:.1} {:.1}L{:.1} {:.1}L{:.1} {:.1}", a.x, a.y, middle.x, middle.y, b.x, b.y);
    }
    let _ = write!(svg, "\"/>");
    if let Some(number) = number {
        let place = to - along * 14.0 + DVec2::new(along.y.abs(), -along.x.abs()) * 8.0;
        write_number(svg, *number, place);
    }
}

/// The part of a line within the view (Liang, Barsky 1984).
fn clipped(from: DVec2, to: DVec2) -> Option<[DVec2; 2]> {
    let along = to - from;
    let (mut first, mut last) = (0.0f64, 1.0f64);
    for axis in 0..2 {
        if along[axis] == 0.0 {
            if !(0.0..=SIZE[axis]).contains(&from[axis]) {
                return None;
            }
            continue;
        }
        let [a, b] = [-from[axis] / along[axis], (SIZE[axis] - from[axis]) / along[axis]];
        (first, last) = (first.max(a.min(b)), last.min(a.max(b)));
    }
    (first < last).then(|| [from + along * first, from + along * last])
}

fn write_number(svg: &mut String, number: usize, DVec2 { x, y }: DVec2) {
    let _ = write!(
        svg,
        "<text class=\"halo\" x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"12\" font-weight=\"bold\">{number}</text>"
    );
}

fn write_mark(svg: &mut String, Mark { at, sign }: &Mark) {
    let DVec2 { x, y } = *at;
    let _ = match sign {
        Sign::Origin => write!(
            svg,
            "<circle class=\"mark\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"#b86e00\"/><text class=\"halo\" \
             x=\"{:.1}\" y=\"{:.1}\" font-size=\"11\">o</text>",
            x + 7.0,
            y - 5.0
        ),
        Sign::Light(name) => write!(
            svg,
            "<g><title>{}</title><path class=\"lamp\" d=\"M{x:.1} {:.1}l2 5 5 2 -5 2 -2 5 -2 -5 -5 -2 5 -2z\"/></g>",
            escaped(name),
            y - 7.0
        ),
        Sign::Hit(number, color) => {
            write_number(svg, *number, DVec2::new(x + 7.0, y - 5.0));
            write!(svg, "<circle class=\"mark\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4.5\" fill=\"{}\"/>", hex(*color))
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_at_the_edge() {
        let [width, height] = SIZE;
        let whole = clipped(DVec2::new(-100.0, height / 2.0), DVec2::new(width + 300.0, height / 2.0)).unwrap();
        assert_eq!(whole, [DVec2::new(0.0, height / 2.0), DVec2::new(width, height / 2.0)]);
        let inside = [DVec2::new(10.0, 20.0), DVec2::new(30.0, 5.0)];
        assert_eq!(clipped(inside[0], inside[1]), Some(inside));
        assert_eq!(clipped(DVec2::new(-5.0, -5.0), DVec2::new(-5.0, 900.0)), None);
        assert_eq!(clipped(DVec2::new(-50.0, 10.0), DVec2::new(10.0, -50.0)), None);
    }
}
