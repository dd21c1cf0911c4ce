//! Lights (5.4): the origin of light, and the share of it that reaches a point. The light around the scene is in
//! [`environment`].

mod area;
mod directional;
mod disk;
pub mod environment;
mod ies_profile;
mod omni;
mod prepared;
mod sample;
mod spot;
mod surface_light;

pub use directional::Directional;
pub use disk::DiskLight;
pub use ies_profile::{IesProfile, MountedProfile, Photometry};
pub use omni::Omni;
pub(crate) use prepared::attenuation_divisor;
pub use prepared::{Illumination, PreparedLight};
pub use sample::{LightBounds, LightSample};
pub use spot::{Falloff, Spot};
pub use surface_light::{Emission, MeshLight, RectangleLight, SphereLight};

use crate::OutOfRange;
use crate::math::{Rgb, Transform};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A light source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Light {
    /// The name given in the file, for explanations.
    pub name: Option<Box<str>>,
    /// The intensity l ≥ 0. A light of intensity l gives l kd cos θ (5.32).
    pub intensity: Rgb,
    /// Whether the light casts shadows.
    pub shadows: bool,
    /// The attenuation coefficients c, l, q: light from distance d is divided by c + l d + q d². Light from infinity is
    /// not attenuated.
    pub attenuation: [f32; 3],
    /// The number of random points of the light's surface that illuminate each hit, each with a shadow ray; 0 selects
    /// the light's fixed points. Only for lights with a surface.
    #[serde(default)]
    pub samples: u32,
    /// The emission of the light's surface, if it has one.
    #[serde(default)]
    pub emission: Emission,
    /// Whether the camera, mirrors and glass show the light's surface, with the radiance [`Light::intensity`] and
    /// without attenuation. A surface of [matte](Emission::Matte) emission is black from behind. What is seen casts no
    /// shadow. Only for lights with a surface.
    #[serde(default)]
    pub visible: bool,
    /// The distribution of the light over directions, times that of the light itself. Only for omni lights that aren't
    /// infinitely far, and for spotlights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<Box<MountedProfile>>,
    /// The form of the light.
    pub kind: LightKind,
}

/// The forms of lights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum LightKind {
    /// A point that emits in all directions.
    Omni(Omni),
    /// Parallel rays from infinity.
    Directional(Directional),
    /// A point that emits a cone of light.
    Spot(Box<Spot>),
    /// Several points distributed over a disk, for soft shadows.
    Disk(DiskLight),
    /// A rectangle or parallelogram.
    Rectangle(Box<RectangleLight>),
    /// A sphere.
    Sphere(SphereLight),
    /// The triangles of meshes.
    Mesh(Box<MeshLight>),
}

impl Light {
    /// The largest number of points of a light. Each point costs a shadow ray for every lit hit.
    pub const MAX_POINTS: u32 = 4096;

    /// A light of this kind with shadows and no attenuation.
    pub fn new(kind: LightKind, intensity: Rgb) -> Light {
        Light {
            name: None,
            intensity,
            shadows: true,
            attenuation: [1.0, 0.0, 0.0],
            samples: 0,
            emission: Emission::Even,
            visible: false,
            profile: None,
            kind,
        }
    }

    /// Returns the light moved by a transform.
    pub fn transformed(&self, t: &Transform) -> Light {
        let kind = match &self.kind {
            LightKind::Omni(light) => LightKind::Omni(light.transformed(t)),
            LightKind::Directional(light) => LightKind::Directional(light.transformed(t)),
            LightKind::Spot(light) => LightKind::Spot(Box::new(light.transformed(t))),
            LightKind::Disk(light) => LightKind::Disk(light.transformed(t)),
            LightKind::Rectangle(light) => LightKind::Rectangle(Box::new(light.transformed(t))),
            LightKind::Sphere(light) => LightKind::Sphere(light.transformed(t)),
            LightKind::Mesh(light) => LightKind::Mesh(Box::new(light.transformed(t))),
        };
        let profile = self.profile.as_ref().map(|profile| Box::new(profile.transformed(t)));
        Light { kind, profile, ..self.clone() }
    }

    /// Returns the light with each point replaced by `f` of its index and itself.
    pub(crate) fn map_points(&self, mut f: impl FnMut(usize, Vec3) -> Vec3) -> Light {
        let mut light = self.clone();
        match &mut light.kind {
            LightKind::Omni(Omni { position: [x, y, z, 1.0], .. }) => {
                [*x, *y, *z] = f(0, Vec3::new(*x, *y, *z)).to_array()
            }
            LightKind::Omni(_) | LightKind::Mesh(_) | LightKind::Directional(Directional { beam: None, .. }) => {}
            LightKind::Directional(Directional { beam: Some((axis, _)), .. }) => *axis = f(0, *axis),
            LightKind::Spot(spot) => (spot.position, spot.target) = (f(0, spot.position), f(1, spot.target)),
            LightKind::Disk(light) => light.disk.center = f(0, light.disk.center),
            LightKind::Rectangle(light) => light.parallelogram.corner = f(0, light.parallelogram.corner),
            LightKind::Sphere(light) => light.sphere.center = f(0, light.sphere.center),
        }
        light
    }

    /// The distance at which the light has ended; 0 if it has no end.
    #[inline]
    pub fn range(&self) -> f32 {
        match &self.kind {
            LightKind::Omni(omni) => omni.range,
            LightKind::Spot(spot) => spot.range,
            _ => 0.0,
        }
    }

    /// Whether the light has a surface, of which random points can be sampled.
    pub fn has_area(&self) -> bool {
        self.fixed_points().is_some()
    }

    /// The number of fixed points of a light with a surface.
    fn fixed_points(&self) -> Option<u32> {
        match &self.kind {
            LightKind::Disk(light) => Some(light.points),
            LightKind::Rectangle(light) => Some(light.points),
            LightKind::Sphere(light) => Some(light.points),
            LightKind::Mesh(light) => Some(light.points),
            LightKind::Omni(_) | LightKind::Directional(_) | LightKind::Spot(_) => None,
        }
    }

    /// The number of points that illuminate each hit, each with a shadow ray of its own.
    pub fn points(&self) -> u32 {
        if self.samples > 0 { self.samples } else { self.fixed_points().unwrap_or(1) }
    }

    /// The name of this kind of light in scene text and explanations.
    pub fn kind_name(&self) -> &'static str {
        match &self.kind {
            LightKind::Omni(_) => "omni",
            LightKind::Directional(_) => "directional",
            LightKind::Spot(_) => "spot",
            LightKind::Disk(_) => "disk",
            LightKind::Rectangle(_) => "rectangle",
            LightKind::Sphere(_) => "sphere",
            LightKind::Mesh(_) => "mesh",
        }
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        if self.intensity.to_array().iter().any(|v| !v.is_finite() || *v < 0.0) {
            let c = self.intensity;
            return Err(OutOfRange::new(
                "intensity",
                format!("is {} {} {}; each component must be 0 or more", c.r, c.g, c.b),
            ));
        }
        let [c, l, q] = self.attenuation;
        let sum = c + l + q;
        if [c, l, q].iter().any(|v| !v.is_finite() || *v < 0.0) || sum == 0.0 {
            return Err(OutOfRange::new(
                "attenuation",
                format!("is {c} {l} {q}; each must be 0 or more, and not all 0"),
            ));
        }
        let range = self.range();
        if !(range.is_finite() && range >= 0.0) {
            return Err(OutOfRange::new("range", format!("is {range}; it must be more than 0, or 0 for no end")));
        }
        if range > 0.0 && matches!(&self.kind, LightKind::Omni(omni) if omni.towards_infinity().is_some()) {
            return Err(OutOfRange::new("range", format!("is {range}, but light from infinity has no end")));
        }
        if self.samples > Light::MAX_POINTS {
            return Err(OutOfRange::new(
                "samples",
                format!("is {}; it must be at most {}", self.samples, Light::MAX_POINTS),
            ));
        }
        if self.samples > 0 && !self.has_area() {
            return Err(OutOfRange::new(
                "samples",
                format!("is {}, but a light \"{}\" has no area to sample", self.samples, self.kind_name()),
            ));
        }
        if self.emission == Emission::Matte && !self.has_area() {
            return Err(OutOfRange::new(
                "emission",
                format!("is \"matte\", but a light \"{}\" has no surface", self.kind_name()),
            ));
        }
        if self.visible && !self.has_area() {
            let problem = format!("is set, but a light \"{}\" has no surface to be seen", self.kind_name());
            return Err(OutOfRange::new("visible", problem));
        }
        if let Some(profile) = &self.profile {
            let is_point = match &self.kind {
                LightKind::Omni(omni) => omni.towards_infinity().is_none(),
                LightKind::Spot(_) => true,
                _ => false,
            };
            if !is_point {
                let problem = format!("is for lights at a point; a light \"{}\" here isn't one", self.kind_name());
                return Err(OutOfRange::new("ies", problem));
            }
            profile.check()?;
        }
        match &self.kind {
            LightKind::Omni(light) => light.check(),
            LightKind::Directional(light) => light.check(),
            LightKind::Spot(light) => light.check(),
            LightKind::Disk(light) => light.check(),
            LightKind::Rectangle(light) => light.check(),
            LightKind::Sphere(light) => light.check(),
            LightKind::Mesh(light) => light.check(),
        }
    }
}
