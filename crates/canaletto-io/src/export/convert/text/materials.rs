//! Materials with their uses of textures.

use super::Writer;
use super::line::{Line, flag, quoted};
use super::number::{color, double, single, singles};
use super::transform;
use canaletto::Named;
use canaletto::material::{
    Conductor, Dielectric, METALS, Mapping, Material, MaterialModel, Medium, PRESETS, Parameter, ParameterValue, Phong,
    Projection, Space, StandardBlock, StandardParameter, StandardSurface, Target, TextureUse,
};
use canaletto::math::{Rgb, Transform};

impl Writer<'_> {
    /// The line of a material.
    pub(super) fn material(&mut self, index: u32) -> Option<Line> {
        let material = self.scene.materials.get(index as usize)?;
        let Material { name: _, model, coverage, alpha_cutoff, priority, two_sided, shadow_catcher, medium, textures } =
            material;
        let name = self.material_name(index);
        let mut line = Line::named("material", &name);
        line = match model {
            MaterialModel::Phong(phong) => line.children(phong_lines(phong, &Phong::default())),
            MaterialModel::Conductor(metal) => line.child(conductor_line(metal)).children(beside(material)),
            MaterialModel::Dielectric(Dielectric { eta, .. }) => {
                line.child(Line::of("dielectric", single(*eta))).children(beside(material))
            }
            MaterialModel::Standard(surface) => line.child(standard_line(surface, material)),
            _ => {
                self.lost.add("models of materials", &name);
                line
            }
        };
        let own = material.standard().map_or(Rgb::BLACK, StandardSurface::absorption);
        line = line
            .children((*medium != Medium { absorption: own, ..Medium::VACUUM }).then(|| medium_line(medium)))
            .child_if("coverage", (*coverage != 1.0).then(|| single(*coverage)))
            .child_if("alpha-cutoff", alpha_cutoff.map(single))
            .child_if("priority", (*priority != 0.0).then(|| single(*priority)))
            .child_if("shadow-catcher", shadow_catcher.then(|| flag(true)))
            .child_if("two-sided", (*two_sided && material.may_emit()).then(|| flag(true)));
        for used in textures {
            let use_line = self.texture_use(used, &name);
            line = line.children(use_line);
        }
        Some(line)
    }

    fn texture_use(&mut self, used: &TextureUse, material: &str) -> Option<Line> {
        let TextureUse { texture, target, channel, range, multiply, mapping } = used;
        let name = self.texture_name(*texture)?;
        let kind = &self.scene.textures.get(*texture as usize)?.kind;
        let plain = TextureUse::new(*texture, *target);
        let mut line = Line::named("texture", &name);
        if *target != Target::Parameter(Parameter::Diffuse) {
            line = line.property("use", quoted(target.name()));
        }
        let takes_number = !target.takes_color() && !target.takes_normals() && *target != Target::AnisotropyDirection;
        if *channel != plain.channel && takes_number {
            line = line.property("channel", quoted(channel.name()));
        }
        if *multiply && target.takes_products() {
            line = line.property("multiply", flag(true));
        }
        let mut block = Vec::new();
        match target {
            Target::Bump | Target::Displace { .. } if range[0] == 0.0 => {
                line = line.property("height", single(range[1]));
            }
            Target::Normal { strength, down } | Target::CoatNormal { strength, down } => {
                line = line.property_if("strength", (*strength != 1.0).then(|| single(*strength)));
                line = line.property_if("y", down.then(|| quoted("down")));
            }
            Target::AnisotropyDirection => {}
            _ if *range != [0.0, 1.0] => block.push(Line::of("range", singles(range))),
            _ => {}
        }
        if let Target::Displace { detail } = target {
            line = line.property_if("detail", (*detail != Target::DEFAULT_DETAIL).then(|| single(*detail)));
        }
        let usual = Mapping::usual(kind);
        let Mapping { projection, space, transform, repeat, uv_set } = mapping;
        if *projection != usual.projection {
            line = line.property("mapping", quoted(projection.name()));
        }
        let usual_space = match projection {
            Projection::Solid if usual.projection == Projection::Solid => usual.space,
            Projection::Triplanar | Projection::Solid => Space::Object,
            _ => Space::Bounds,
        };
        if *space != usual_space && *projection != Projection::Uv {
            line = line.property("space", quoted(space.name()));
        }
        if *uv_set != 0 && *projection == Projection::Uv {
            line = line.property("uv-set", uv_set.to_string());
        }
        let [u, v] = repeat.0;
        if [u, v] != [1.0; 2] && *projection != Projection::Solid {
            let text = if u == v { double(u) } else { format!("{} {}", double(u), double(v)) };
            block.push(Line::of("repeat", text));
        }
        let before = if *projection == usual.projection { usual.transform } else { Transform::IDENTITY };
        if *transform != before {
            let own = transform.after(&before.inverse());
            if own.after(&before) != *transform {
                self.lost.add("the last bits of places of textures", material);
            }
            block.extend(transform::lines(&own));
        }
        Some(line.children(block))
    }
}

/// The numbers of Phong's model that differ from others.
fn phong_lines(phong: &Phong, usual: &Phong) -> Vec<Line> {
    let differing = Parameter::ALL.iter().filter(|row| row.get(phong) != row.get(usual));
    differing.map(|row| Line::of(row.name, parameter(row.get(phong)))).collect()
}

fn parameter(value: ParameterValue) -> String {
    match value {
        ParameterValue::Color(value) => color(value),
        ParameterValue::Number(value) => single(value),
    }
}

/// Roughness and emission beside a metal or a clear body.
fn beside(material: &Material) -> Vec<Line> {
    let Phong { roughness, emission, .. } = material.classic();
    phong_lines(&Phong { roughness, emission, ..Phong::default() }, &Phong::default())
}

fn conductor_line(metal: &Conductor) -> Line {
    let named = METALS.iter().find(|(_, eta, k)| Rgb::from(*eta) == metal.eta && Rgb::from(*k) == metal.k);
    match named {
        Some((name, ..)) => Line::named("conductor", name),
        None => Line::new("conductor").child(Line::of("eta", color(metal.eta))).child(Line::of("k", color(metal.k))),
    }
}

fn medium_line(medium: &Medium) -> Line {
    let Medium { absorption, scattering, anisotropy } = *medium;
    if scattering == Rgb::BLACK && anisotropy == 0.0 {
        return Line::of("absorption", color(absorption));
    }
    Line::new("medium")
        .child_if("absorption", (absorption != Rgb::BLACK).then(|| color(absorption)))
        .child(Line::of("scattering", color(scattering)))
        .child_if("anisotropy", (anisotropy != 0.0).then(|| single(anisotropy)))
}

fn standard_line(surface: &StandardSurface, material: &Material) -> Line {
    let preset = PRESETS.iter().map(|preset| (preset.name, preset.surface())).find(|(_, usual)| usual == surface);
    if let Some((name, _)) = preset {
        return Line::new("standard").child(Line::named("preset", name));
    }
    let usual = StandardSurface::default();
    let mut line = Line::new("standard");
    for block in StandardBlock::ALL {
        // Light of no strength needs no colour.
        if *block == StandardBlock::Emission && !material.may_emit() {
            continue;
        }
        let rows = StandardParameter::ALL.iter().filter(|row| row.block == *block);
        let differing = rows.filter(|row| row.get(surface) != row.get(&usual));
        let numbers = differing.map(|row| {
            Line::of(
                row.name,
                match row.get(surface)[..] {
                    [r, g, b] => color(Rgb::new(r, g, b)),
                    ref list => singles(list),
                },
            )
        });
        let inner = Line::new(block.name()).children(numbers);
        line = line.children((!inner.has_no_block()).then_some(inner));
    }
    line.child_if("thin-walled", surface.thin_walled.then(|| flag(true)))
        .child_if("schlick", surface.schlick.then(|| flag(true)))
}
