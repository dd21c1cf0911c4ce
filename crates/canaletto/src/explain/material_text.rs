//! A hit's material and textures as text.

use super::text_writer::{TextWriter, counted};
use super::tree::{HitNode, ReadingNode, TextureNode};
use crate::material::{Parameter, ParameterInfo, ParameterValue, Shown};

/// The material's parameters: in one line those that are always shown, and a line for each other that is set.
pub(super) fn write_material(w: &mut TextWriter, hit: &HitNode, indent: &str) {
    let (always, others): (Vec<_>, Vec<_>) = Parameter::ALL.iter().partition(|row| row.shown != Shown::IfSet);
    let always: Vec<String> = always.into_iter().map(|row| parameter(w, hit, row)).collect();
    writeln!(w, "{indent}    material \"{}\": {}", hit.material, always.join(", "));
    for row in others.into_iter().filter(|row| row.get(&hit.phong) != row.default_value()) {
        let parameter = parameter(w, hit, row);
        writeln!(w, "{indent}        {parameter}");
    }
}

/// A parameter's symbol and value.
fn parameter(w: &TextWriter, hit: &HitNode, row: &ParameterInfo) -> String {
    match row.get(&hit.phong) {
        ParameterValue::Color(color) => format!("{} {}", row.symbol, w.rgb(color)),
        ParameterValue::Number(number) => format!("{} {}", row.symbol, w.number(number)),
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
    writeln!(w, "{indent}        value ({})", w.list(&texture.value));
    let [before, after] = &texture.replaced;
    let what = if matches!(texture.used, "bump" | "normal") { "n" } else { texture.used };
    writeln!(w, "{indent}        {what}: ({}) instead of ({})", w.list(after), w.list(before));
}

/// Texture coordinates with six decimals.
fn fixed(v: [f64; 3]) -> String {
    // −0 becomes 0, and so does what rounds to it.
    let [x, y, z] = v.map(|v| (v * 1e6).round() / 1e6 + 0.0);
    format!("({x:.6}, {y:.6}, {z:.6})")
}
