//! The block of the standard surface in a material.

use super::material::{CONDUCTOR, COVERAGE};
use crate::text::arithmetic::DIELECTRIC;
use crate::text::decode::Decoder;
use crate::text::reader::Fields;
use crate::text::report::Message;
use crate::text::schema::{Block, Field, FieldSchema, NodeSchema, Text, flag, rgb};
use canaletto::material::{Material, PRESETS, StandardBlock, StandardParameter, StandardSurface};
use canaletto::math::Rgb;
use canaletto::{Named, OutOfRange};

/// The number of parameters in a block.
const fn count(block: StandardBlock) -> usize {
    let (mut n, mut i) = (0, 0);
    while i < StandardParameter::ALL.len() {
        n += (StandardParameter::ALL[i].block as usize == block as usize) as usize;
        i += 1;
    }
    n
}

/// The fields of a block.
const fn fields<const N: usize>(block: StandardBlock) -> [FieldSchema; N] {
    let mut fields = [number(&StandardParameter::ALL[0]).schema; N];
    let (mut n, mut i) = (0, 0);
    while i < StandardParameter::ALL.len() {
        let row = &StandardParameter::ALL[i];
        if row.block as usize == block as usize {
            fields[n] = if row.is_color() { color(row).schema } else { number(row).schema };
            fields[n].default = DEFAULTS[i];
            n += 1;
        }
        i += 1;
    }
    fields
}

const fn color(row: &StandardParameter) -> Field<Rgb> {
    Field::new(row.name, row.doc)
}

const fn number(row: &StandardParameter) -> Field<f32> {
    Field::new(row.name, row.doc)
}

fn default_of(row: usize) -> String {
    match StandardParameter::ALL[row].get(&StandardSurface::default())[..] {
        [r, g, b] => rgb(Rgb::new(r, g, b)),
        ref numbers => numbers[0].to_string(),
    }
}

/// The defaults of the parameters, in the order of their table.
const DEFAULTS: [fn() -> String; StandardParameter::ALL.len()] = {
    macro_rules! defaults {
        ($($row:literal)*) => { [$(|| default_of($row)),*] };
    }
    defaults!(0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32)
};

/// The schema of a block.
macro_rules! block {
    ($name:ident, $block:ident, $example:literal) => {
        pub(crate) static $name: NodeSchema = NodeSchema::new(
            <StandardBlock as Named>::NAMES[StandardBlock::$block as usize],
            StandardBlock::$block.doc(),
            &[&{
                const FIELDS: [FieldSchema; count(StandardBlock::$block)] = fields(StandardBlock::$block);
                FIELDS
            }],
        )
        .example($example);
    };
}

block!(BASE, Base, "material \"m\" { standard { base { color 0.8 0.1 0.05; metalness 0 } } }");
block!(SPECULAR, Specular, "material \"m\" { standard { specular { roughness 0.3; ior 1.5 } } }");
block!(
    TRANSMISSION,
    Transmission,
    "material \"m\" { standard { transmission { weight 1; color 0.9 1 0.9; depth 2 } } }"
);
block!(SUBSURFACE, Subsurface, "material \"m\" { standard { subsurface { weight 1; color 0.9 0.6 0.5 } } }");
block!(COAT, Coat, "material \"m\" { standard { coat { weight 1; roughness 0.05 } } }");
block!(FUZZ, Fuzz, "material \"m\" { standard { fuzz { weight 1; color 0.6 0.5 0.9 } } }");
block!(THIN_FILM, ThinFilm, "material \"m\" { standard { thin-film { weight 1; thickness 0.4 } } }");
block!(EMISSION, Emission, "material \"m\" { standard { emission { radiance 5; color 1 0.8 0.6 } } }");

/// The schemas of all blocks, in the order of [`StandardBlock::ALL`].
pub(crate) static STANDARD_BLOCKS: [&NodeSchema; StandardBlock::ALL.len()] =
    [&BASE, &SPECULAR, &TRANSMISSION, &SUBSURFACE, &COAT, &FUZZ, &THIN_FILM, &EMISSION];

const BLOCKS: [Field<Block>; StandardBlock::ALL.len()] = [
    Field::block(&BASE, StandardBlock::Base.doc()),
    Field::block(&SPECULAR, StandardBlock::Specular.doc()),
    Field::block(&TRANSMISSION, StandardBlock::Transmission.doc()),
    Field::block(&SUBSURFACE, StandardBlock::Subsurface.doc()),
    Field::block(&COAT, StandardBlock::Coat.doc()),
    Field::block(&FUZZ, StandardBlock::Fuzz.doc()),
    Field::block(&THIN_FILM, StandardBlock::ThinFilm.doc()),
    Field::block(&EMISSION, StandardBlock::Emission.doc()),
];

/// The names of presets.
const PRESET_NAMES: [&str; PRESETS.len()] = {
    let mut names = [""; PRESETS.len()];
    let mut i = 0;
    while i < PRESETS.len() {
        names[i] = PRESETS[i].name;
        i += 1;
    }
    names
};
const PRESET: Field<Text> =
    Field::keyword("preset", &PRESET_NAMES, "an example of OpenPBR to start from; the other fields change it");
const OPACITY: Field<f32> = Field::new("opacity", "the share of the surface that is there, 0 to 1; as `coverage`")
    .or(|| Material::default().coverage.to_string());
const THIN_WALLED: Field<bool> =
    Field::new("thin-walled", "#true for a sheet with no inside, such as a window pane, a leaf or a soap bubble")
        .or(|| flag(StandardSurface::default().thin_walled));

const SCHLICK: Field<bool> = Field::new(
    "schlick",
    "#true lets a dielectric reflect by Schlick's curve, from specular color × weight × F0 of the ior to specular weight \
     at the rim, as in glTF; both then don't touch metals",
)
.or(|| flag(StandardSurface::default().schlick));

/// `standard` in a material.
pub(crate) static STANDARD: NodeSchema = NodeSchema::new(
    "standard",
    "The standard surface, OpenPBR Surface 1.1: a metal or dielectric base, a film, a coat and fuzz. Textures drive its \
     base colour (`diffuse`), `roughness`, `emission`, `opacity`, normal, and most other numbers by the name of their \
     block and their own, as in `coat-roughness`.",
    &[
        &[
            PRESET.schema,
            BLOCKS[0].schema,
            BLOCKS[1].schema,
            BLOCKS[2].schema,
            BLOCKS[3].schema,
            BLOCKS[4].schema,
            BLOCKS[5].schema,
            BLOCKS[6].schema,
            BLOCKS[7].schema,
        ],
        &[OPACITY.schema, THIN_WALLED.schema, SCHLICK.schema],
    ],
)
.example("material \"car\" { standard { base { color 0.8 0.1 0.05 }; coat { weight 1; roughness 0.05 } } }");

/// Two ways to say how much of a standard surface is there.
pub(super) const COVERAGE_OR_OPACITY: [&str; 3] = [COVERAGE.name(), STANDARD_FIELD.name(), OPACITY.name()];

pub(super) const STANDARD_FIELD: Field<Block> =
    Field::block(&STANDARD, "the standard surface, instead of all numbers above; see below");

impl Decoder<'_> {
    /// Sets a material to its standard surface, if its node has one or it has been one before. Returns whether it is.
    pub(super) fn change_standard(&mut self, fields: &Fields, material: &mut Material) -> bool {
        if !fields.has(&STANDARD_FIELD) {
            let others = [CONDUCTOR.name, DIELECTRIC];
            return material.standard().is_some() && !others.iter().any(|name| fields.has_named(name));
        }
        for other in [CONDUCTOR.name, DIELECTRIC].iter().filter(|name| fields.has_named(name)) {
            let problem = format!("and {} are two models; a material has one", STANDARD.name);
            self.out_of_range(fields, &OutOfRange::new(other, problem));
        }
        let Some(inner) = self.block(fields, &STANDARD_FIELD) else { return true };
        let mut surface = material.standard().copied().unwrap_or_default();
        if let Some(preset) = inner.text(&PRESET) {
            surface = PRESETS.iter().find(|row| row.name == preset).map_or(surface, |row| row.surface());
        }
        for (block, kind) in BLOCKS.iter().zip(StandardBlock::ALL) {
            if inner.has(block)
                && let Some(own) = self.block(&inner, block)
            {
                self.change_block(&own, *kind, &mut surface);
            }
        }
        if let Some(thin_walled) = inner.get(&THIN_WALLED) {
            surface.thin_walled = thin_walled;
        }
        if let Some(schlick) = inner.get(&SCHLICK) {
            surface.schlick = schlick;
        }
        let opacity = inner.get(&OPACITY);
        if let Some(opacity) = opacity.filter(|opacity| !(0.0..=1.0).contains(opacity)) {
            let message = format!("opacity is {opacity}; it must be between 0 (nothing is there) and 1 (all of it)");
            self.validator.report.error(inner.span(&OPACITY), message);
            self.valid = false;
        }
        if opacity.is_some() && fields.has(&COVERAGE) {
            let problem = "is given twice, as opacity in standard and beside it; leave one out";
            self.out_of_range(fields, &OutOfRange::new(COVERAGE.name(), problem));
        }
        if surface.subsurface.weight > 0.0 && !surface.thin_walled {
            let message = "subsurface light leaves where it enters: the surface is matte in the subsurface's colour";
            self.validator.report.push(Message::warning(Some(inner.span(&BLOCKS[3])), message));
        }
        material.set_standard(surface);
        super::change(&mut material.coverage, opacity.map(|opacity| opacity.clamp(0.0, 1.0)));
        true
    }

    /// Changes the surface by the fields of a block.
    fn change_block(&mut self, fields: &Fields, block: StandardBlock, surface: &mut StandardSurface) {
        for row in StandardParameter::ALL.iter().filter(|row| row.block == block) {
            let value = match row.is_color() {
                true => fields.get(&color(row)),
                false => fields.get(&number(row)).map(Rgb::gray),
            };
            let Some(value) = value else { continue };
            row.set(surface, value);
            if let Err(problem) = row.check(surface) {
                self.out_of_range(fields, &problem);
                row.set(surface, Rgb::gray(1.0));
            }
        }
    }
}
