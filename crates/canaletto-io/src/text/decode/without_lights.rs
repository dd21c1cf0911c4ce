//! What the classic integrator shows of a scene without lights and without ambient light.

use super::surfaces::each_surface;
use canaletto::material::{Material, Parameter, Target};
use canaletto::math::Rgb;
use canaletto::scene::{Scene, Stage};

/// The surfaces that are black without lights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Black {
    /// Whether any surface is black.
    pub(super) some: bool,
    /// Whether any surface is not, as it emits, is unlit, or shows a bright background.
    pub(super) not_all: bool,
    /// Whether any surface emits.
    pub(super) emits: bool,
}

impl Black {
    /// The surfaces of a scene that are black at this stage.
    pub(super) fn of(scene: &Scene, stage: Stage) -> Black {
        let is_bright_around = scene.environment.is_some() || scene.background != Rgb::BLACK;
        let shows = |material: &Material| {
            let targets = |wanted: &[Target]| material.textures.iter().any(|texture| wanted.contains(&texture.target));
            let is_mirror = material.classic().k != Rgb::BLACK || targets(&[Target::Parameter(Parameter::Mirror)]);
            let is_seen = targets(&[Target::Replace, Target::Decal])
                || material.may_emit()
                || is_bright_around
                    && (stage >= Stage::Reflection && is_mirror
                        || stage >= Stage::Full && !material.is_opaque()
                        || material.has_holes());
            [is_seen, material.may_emit()]
        };
        let shows: Vec<[bool; 2]> = scene.materials.iter().map(shows).collect();
        let mut black = Black::default();
        each_surface(scene, &mut |_, material| {
            let [is_seen, emits] = material.and_then(|index| shows.get(index as usize)).copied().unwrap_or_default();
            black.not_all |= is_seen;
            black.some |= !is_seen;
            black.emits |= emits;
        });
        black
    }
}
