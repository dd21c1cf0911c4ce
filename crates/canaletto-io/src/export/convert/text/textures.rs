//! Textures.

use super::Writer;
use super::line::{Line, quoted};
use super::number::{color, single, singles, vector};
use canaletto::Named;
use canaletto::math::Rgb;
use canaletto::texture::{
    Filter, Function, Gradient, GridTexture, ImageTexture, Interpolation, Placement, Prefilter, Procedural, Ramp,
    Samples, Spectrum, TextureKind, Wrap,
};

/// The default shifts of marble's waves and wood's rings.
const SHIFTS: [f32; 2] = [2.0, 0.3];

fn word<T: Named + PartialEq>(line: Line, name: &str, value: T, usual: T) -> Line {
    line.child_if(name, (value != usual).then(|| quoted(value.name())))
}

fn number(line: Line, name: &str, value: f32, usual: f32) -> Line {
    line.child_if(name, (value != usual).then(|| single(value)))
}

impl Writer<'_> {
    /// The line of a texture. None if its picture can't be written.
    pub(super) fn texture(&mut self, index: u32) -> Option<Line> {
        let texture = self.scene.textures.get(index as usize)?;
        let name = self.texture_name(index)?;
        let line = Line::named("texture", &name);
        match &texture.kind {
            TextureKind::Image(image) => self.image_texture(line, image),
            TextureKind::Grid(grid) => self.grid(line, grid, &name),
            TextureKind::Constant([r, g, b, alpha]) => Some(
                kind(line, "constant")
                    .child(Line::of("color", color(Rgb::new(*r, *g, *b))))
                    .child_if("alpha", (*alpha != 1.0).then(|| single(*alpha))),
            ),
            TextureKind::VertexColor => Some(kind(line, "vertex-color")),
            TextureKind::Procedural(procedural) => Some(computed(line, procedural)),
            _ => {
                self.lost.add("textures", &name);
                None
            }
        }
    }

    fn image_texture(&mut self, line: Line, texture: &ImageTexture) -> Option<Line> {
        let ImageTexture { image, filter, prefilter, wrap: [u, v], placement, space } = *texture;
        let line = line.property("file", quoted(&self.picture(image)?));
        let line = word(line, "filter", filter, Filter::default());
        let line = word(line, "prefilter", prefilter, Prefilter::default());
        let line = match u == v {
            true => word(line, "wrap", u, Wrap::default()),
            false => word(word(line, "wrap-u", u, Wrap::default()), "wrap-v", v, Wrap::default()),
        };
        let line = word(line, "texels", placement, Placement::default());
        let known = self.scene.images.get(image as usize).map(|image| image.space);
        let space = space.filter(|space| Some(*space) != known).or(self.lost_space(image));
        Some(line.child_if("space", space.map(|space| quoted(space.name()))))
    }

    fn grid(&mut self, line: Line, grid: &GridTexture, name: &str) -> Option<Line> {
        let GridTexture { image, slices, filter, prefilter, wrap, placement, space } = *grid;
        let stack = self.scene.images.get(image as usize)?;
        let (format, bytes): (&str, Vec<u8>) = match &stack.samples {
            Samples::U8(data) => ("u8", data.clone()),
            Samples::U16(data) => ("u16", data.iter().flat_map(|v| v.to_le_bytes()).collect()),
            Samples::F32(data) => ("f32", data.iter().flat_map(|v| v.to_le_bytes()).collect()),
            Samples::F16(_) => {
                self.lost.add("grids of half floats", name);
                return None;
            }
        };
        let file = self.assets.add(name, "grid", "raw", bytes);
        let rows = stack.height / slices.max(1);
        let line = kind(line, "grid")
            .property("file", quoted(&file))
            .child(Line::of("size", format!("{} {rows} {slices}", stack.width)))
            .child_if("format", (format != "u8").then(|| quoted(format)))
            .child_if("channels", (stack.channels != 1).then(|| stack.channels.to_string()));
        let line = word(line, "filter", filter, Filter::default());
        let line = word(line, "prefilter", prefilter, Prefilter::Trilinear);
        let line = word(word(line, "wrap", wrap, Wrap::default()), "texels", placement, Placement::default());
        // Numbers without a header are linear, if nothing else is said.
        let space = space.unwrap_or(stack.space);
        Some(line.child(Line::named("space", space.name())))
    }
}

fn kind(line: Line, kind: &str) -> Line {
    line.property("kind", quoted(kind))
}

fn computed(line: Line, procedural: &Procedural) -> Line {
    let Procedural { function, ramp, seed } = procedural;
    let seeded = |line: Line| line.child_if("seed", (*seed != 0).then(|| seed.to_string()));
    let line = match *function {
        Function::Checker => {
            let line = kind(line, "checker");
            let [even, odd] = [0, 1].map(|i: usize| ramp.stops.get(i).map_or([i as f32; 4], |stop| stop.color));
            let line = differing(line, "even", even, 0.0);
            return differing(line, "odd", odd, 1.0);
        }
        Function::Gradient { shape: Gradient::Linear, wrap, axis: None } => {
            word(kind(line, "ramp"), "wrap", wrap, Wrap::Clamp)
        }
        Function::Gradient { shape, wrap, axis } => {
            let line = word(kind(line, "gradient"), "shape", shape, Gradient::default());
            word(line.child_if("axis", axis.map(vector)), "wrap", wrap, Wrap::Clamp)
        }
        Function::Noise => seeded(kind(line, "noise")),
        Function::Fbm(own) => seeded(spectrum(kind(line, "fbm"), own)),
        Function::Turbulence(own) => seeded(spectrum(kind(line, "turbulence"), own)),
        Function::Marble { spectrum: own, strength } => {
            seeded(spectrum(number(kind(line, "marble"), "strength", strength, SHIFTS[0]), own))
        }
        Function::Wood { spectrum: own, strength } => {
            seeded(spectrum(number(kind(line, "wood"), "strength", strength, SHIFTS[1]), own))
        }
        Function::Worley { feature, jitter } => {
            let line = word(kind(line, "worley"), "feature", feature, Default::default());
            seeded(number(line, "jitter", jitter, 1.0))
        }
        _ => line,
    };
    ramp_lines(line, ramp)
}

fn differing(line: Line, name: &str, [r, g, b, _]: [f32; 4], usual: f32) -> Line {
    let own = Rgb::new(r, g, b);
    line.child_if(name, (own != Rgb::gray(usual)).then(|| color(own)))
}

fn spectrum(line: Line, spectrum: Spectrum) -> Line {
    let Spectrum { octaves, lacunarity, gain } = spectrum;
    let d = Spectrum::default();
    let line = line.child_if("octaves", (octaves != d.octaves).then(|| octaves.to_string()));
    number(number(line, "lacunarity", lacunarity, d.lacunarity), "gain", gain, d.gain)
}

fn ramp_lines(line: Line, ramp: &Ramp) -> Line {
    let line = word(line, "interpolation", ramp.interpolation, Interpolation::default());
    if ramp.stops == Ramp::default().stops {
        return line;
    }
    let has_alpha = ramp.stops.iter().any(|stop| stop.color[3] != 1.0);
    let numbers = ramp.stops.iter().map(|stop| {
        let [r, g, b, alpha] = stop.color;
        if has_alpha { singles(&[stop.at, r, g, b, alpha]) } else { singles(&[stop.at, r, g, b]) }
    });
    let numbers: Vec<String> = numbers.collect();
    line.child(Line::of(if has_alpha { "stops-alpha" } else { "stops" }, numbers.join("  ")))
}
