//! A hit's material and textures: their terms, and their text.

use super::term::{Line, Term, Value, line};
use super::text_writer::{TextWriter, counted};
use super::tree::{HitNode, ReadingNode, TextureNode};
use crate::material::{Parameter, ParameterInfo, Shown};

impl HitNode {
    /// The material's parameters: in one line those that texts always have, and a line for each other one.
    pub(super) fn material_lines(&self) -> Vec<Line<'_>> {
        let (always, others): (Vec<_>, Vec<_>) = Parameter::ALL.iter().partition(|row| row.shown != Shown::IfSet);
        let parameter = |row: &ParameterInfo| {
            let term = Term::from(Value::Singles(row.get(&self.phong).to_vec())).named(row.symbol);
            line!("{} {}", row.symbol, term.because(|| Some(line!("material \"{}\"", &self.material))))
        };
        let first = line!("    material \"{}\": ", &self.material).list(always.into_iter().map(parameter));
        let is_set = |row: &ParameterInfo| row.get(&self.phong) != row.default_value();
        let other = |row| line!("        ").and(parameter(row)).written_if(is_set(row));
        [first].into_iter().chain(others.into_iter().map(other)).collect()
    }

    /// The texture that bends the normal.
    pub(super) fn bending_texture(&self) -> Option<&TextureNode> {
        self.textures.iter().find(|texture| matches!(texture.used, "bump" | "normal"))
    }
}

impl TextureNode {
    /// The value, and what it replaces.
    pub(super) fn value_lines(&self) -> [Line<'_>; 2] {
        let place = || {
            let [x, y] = self.readings.first()?.image?.texel;
            Some(line!("{}", format!("texel ({x:.3}, {y:.3})")))
        };
        let [before, after] = self.replaced.each_ref().map(|values| &values[..]);
        let what = if matches!(self.used, "bump" | "normal") { "n" } else { self.used };
        let value = Term::from(self.value).because(place);
        [line!("        value {value}", value), line!("        {}: {} instead of {}", what, after, before)]
    }
}

/// Writes what was read from a texture.
pub(super) fn write_texture(w: &mut TextWriter, texture: &TextureNode, indent: &str) {
    writeln!(w, "{indent}    texture \"{}\" for {}", texture.texture, texture.used);
    let mut readings: Vec<&ReadingNode> = texture.readings.iter().collect();
    if !w.is_full {
        readings.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        readings.truncate(1);
    }
    for r in &readings {
        let share = if texture.readings.len() > 1 { format!("{:.6} of ", r.weight) } else { String::new() };
        writeln!(w, "{indent}        {share}t{}", fixed(r.at));
        match &r.image {
            Some(image) => {
                let ([x, y], [width, height], [long, short]) = (image.texel, image.size, image.radii);
                let sample = if long > 0.0 {
                    format!(", footprint radii {long:.4} and {short:.4} texels, pyramid level {:.3}", image.level)
                } else {
                    String::new()
                };
                writeln!(w, "{indent}        texel ({x:.3}, {y:.3}) of {width} x {height}{sample}");
            }
            None => {
                let [dx, dy] = r.footprint.map(fixed);
                writeln!(w, "{indent}        footprint dx = {dx}, dy = {dy}");
            }
        }
    }
    if texture.readings.len() > readings.len() {
        let more = texture.readings.len() - readings.len();
        writeln!(w, "{indent}        and {} with less weight", counted(more, "other place"));
    }
    w.lines(indent, texture.value_lines());
}

/// Texture coordinates with six decimals.
fn fixed(v: [f64; 3]) -> String {
    // −0 becomes 0, and so does what rounds to it.
    let [x, y, z] = v.map(|v| (v * 1e6).round() / 1e6 + 0.0);
    format!("({x:.6}, {y:.6}, {z:.6})")
}
