//! The environment: light from infinitely far around the scene (5.5, fig. 5.35). Rays that hit nothing see it, in
//! mirrors and through glass too.
//!
//! An [`Environment`] is a description; [`PreparedEnvironment`] is its runtime form. Its radiance depends on the
//! direction alone, not on the position.

mod cross;
mod distribution;
mod face;
mod gradient;
mod map;
mod panorama;
mod sky;
mod sun;
#[cfg(test)]
mod tests;

pub use face::Face;
pub use gradient::Gradient;
pub use sky::{Part, Sky};
pub use sun::{Moment, bearing};

use super::{Directional, Light, LightKind};
use crate::math::{Affine, Rgb, Transform, Vector, saturated};
use crate::texture::{Image, Samples};
use crate::{Named, OutOfRange, named};
use canaletto_bvh::lanes::{LANES, Real32, Real64};
pub(crate) use distribution::{BlockWeights, EnvironmentDistribution, EnvironmentSample};
use glam::DVec3;
use map::{EnvironmentMap, Layout};
use serde::{Deserialize, Serialize};
use sky::PreparedSky;

/// The description of an environment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Environment {
    /// The kind of the environment.
    pub kind: EnvironmentKind,
    /// The rotation from the environment's own directions to the scene's.
    pub rotation: Transform,
    /// The factor of the environment's radiance; each component ≥ 0.
    pub intensity: Rgb,
    /// Whether the environment's mean over all directions is added to the scene's ambient light.
    pub ambient: bool,
    /// Whether camera rays see the environment straight on. Otherwise they see the scene's background colour, also
    /// through what doesn't bend them. Reflections, refractions and light are those of the environment all the same.
    #[serde(default = "is_seen", skip_serializing_if = "is_true")]
    pub visible: bool,
}

fn is_seen() -> bool {
    true
}

fn is_true(visible: &bool) -> bool {
    *visible
}

/// The kinds of environments. Numbers of images are indices into [`crate::scene::Scene::images`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum EnvironmentKind {
    /// Six square images of one size, in the order of [`Face::ALL`].
    Cube {
        /// The six images.
        faces: [u32; 6],
        /// The interpolation between texels.
        smoothing: Smoothing,
    },
    /// The six faces in one image of 4 × 3 or 3 × 4 squares.
    ///
    /// - 4 × 3: left, front, right, back in the middle row; top and bottom above and below the front.
    /// - 3 × 4: left, front, right in the second row; top, front, bottom and the back, upside down, in the middle
    ///   column.
    Cross {
        /// The index of the image.
        image: u32,
        /// The interpolation between texels.
        smoothing: Smoothing,
    },
    /// One image of all directions: −z is in its middle, +x at three quarters of its width, and +y along its upper
    /// edge.
    LatLong {
        /// The index of the image.
        image: u32,
        /// The interpolation between texels.
        smoothing: Smoothing,
    },
    /// Colours by height above the horizon.
    Gradient(Gradient),
    /// A physical sky by day.
    Sky(Sky),
}

/// The interpolation between texels, as a function of the direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Smoothing {
    /// The nearest texel, without prefilter.
    Nearest,
    /// Linear interpolation between the four nearest texels, across all edges. A prefilter averages texels smaller than
    /// a pixel.
    #[default]
    Bilinear,
}

named!(Smoothing {
    Nearest => "nearest",
    Bilinear => "bilinear",
});

impl Environment {
    /// The environment of this kind, not turned, with an intensity of 1.
    pub fn new(kind: EnvironmentKind) -> Environment {
        Environment { kind, rotation: Transform::IDENTITY, intensity: Rgb::WHITE, ambient: false, visible: true }
    }

    /// The name of this kind in scene text and explanations.
    pub fn kind_name(&self) -> &'static str {
        match &self.kind {
            EnvironmentKind::Cube { .. } => "cube",
            EnvironmentKind::Cross { .. } => "cross",
            EnvironmentKind::LatLong { .. } => "lat-long",
            EnvironmentKind::Gradient(_) => "gradient",
            EnvironmentKind::Sky(_) => "sky",
        }
    }

    /// Whether the environment's sun lights the scene.
    pub fn has_sun(&self) -> bool {
        matches!(&self.kind, EnvironmentKind::Sky(sky) if sky.light)
    }

    /// The images that the environment uses.
    fn images(&self) -> &[u32] {
        match &self.kind {
            EnvironmentKind::Cube { faces, .. } => faces,
            EnvironmentKind::Cross { image, .. } | EnvironmentKind::LatLong { image, .. } => {
                std::slice::from_ref(image)
            }
            EnvironmentKind::Gradient(_) | EnvironmentKind::Sky(_) => &[],
        }
    }

    /// Checks every number's range and the images' sizes. Missing images are not checked here.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the faulty part: a number or an image.
    pub fn check(&self, images: &[Image]) -> Result<(), OutOfRange> {
        let c = self.intensity;
        if c.to_array().iter().any(|v| !v.is_finite() || *v < 0.0) {
            return Err(OutOfRange::new(
                "intensity",
                format!("is {} {} {}; each component must be 0 or more", c.r, c.g, c.b),
            ));
        }
        let turn = self.rotation.matrix();
        let rigid = self.rotation.uniform_scale().is_some_and(|scale| (scale - 1.0).abs() < 1e-6);
        if !rigid || turn.matrix3.determinant() < 0.0 || turn.translation != DVec3::ZERO {
            return Err(OutOfRange::whole(
                "an environment is infinitely far: it can be turned, but not moved, scaled or mirrored",
            ));
        }
        let size = |index: u32| images.get(index as usize).map(|image| [image.width, image.height]);
        match &self.kind {
            EnvironmentKind::Cube { faces, .. } => {
                let mut first = None;
                for (word, index) in Face::NAMES.iter().zip(faces) {
                    let Some([w, h]) = size(*index) else { continue };
                    if w != h {
                        return Err(OutOfRange::new(
                            word,
                            format!("is {w} × {h} pixels; the faces of a cube must be square"),
                        ));
                    }
                    let (n, of) = *first.get_or_insert((w, word));
                    if w != n {
                        let problem =
                            format!("is {w} × {h} pixels, but {of} is {n} × {n}; all faces must be of one size");
                        return Err(OutOfRange::new(word, problem));
                    }
                }
                Ok(())
            }
            EnvironmentKind::Cross { image, .. } => match size(*image) {
                Some(size) if cross::side(size).is_none() => Err(OutOfRange::new(
                    "file",
                    format!(
                        "is {} × {} pixels; a cross has 4 × 3 or 3 × 4 squares, such as 1024 × 768",
                        size[0], size[1]
                    ),
                )),
                _ => Ok(()),
            },
            EnvironmentKind::LatLong { .. } => Ok(()),
            EnvironmentKind::Gradient(gradient) => gradient.check(),
            EnvironmentKind::Sky(sky) => sky.check(),
        }
    }
}

/// The runtime form of an environment.
#[derive(Debug)]
pub struct PreparedEnvironment {
    kind_name: &'static str,
    to_local: Transform,
    intensity: Rgb,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    EnvironmentMap(EnvironmentMap),
    Gradient(Gradient),
    Sky(PreparedSky),
}

/// The place of an environment at which a lookup arrives.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Place {
    /// A face of the cube, and (u, v) from the upper left corner of its image (fig. 5.35).
    Face {
        /// The face.
        face: Face,
        /// The place (u, v) on the face.
        uv: [f64; 2],
    },
    /// (u, v) from the upper left corner of a latitude-longitude image.
    Panorama {
        /// The place (u, v) in the image.
        uv: [f64; 2],
    },
    /// The degrees above the horizon of a gradient.
    Height(f64),
    /// A part of the sky.
    Sky(Part),
}

/// The footprint of a lookup in an image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Footprint {
    /// The level of the mip pyramid, whose texels are as wide as 2^level texels of the image.
    pub level: f32,
    /// The number of trilinear lookups along the longer axis of the footprint.
    pub looks: u32,
}

/// The result of a lookup in an environment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EnvironmentLookup {
    /// The name of the kind of environment.
    pub kind: &'static str,
    /// The unit direction in the scene.
    pub direction: DVec3,
    /// The unit direction in the environment's own space, before its rotation.
    pub local: DVec3,
    /// The place of that direction.
    pub place: Place,
    /// The averaged footprint; none for environments without images.
    pub footprint: Option<Footprint>,
    /// The environment's value at the place, before its intensity.
    pub value: Rgb,
    /// The radiance: value ⊗ intensity.
    pub radiance: Rgb,
}

impl PreparedEnvironment {
    /// The runtime form of an environment. Its images are moved out of the list, unless another part of the scene
    /// `keeps` them.
    ///
    /// # Errors
    /// A sentence that names the missing image, or the fault ([`Environment::check`]).
    pub fn new(
        environment: &Environment,
        images: &mut [Image],
        keeps: impl Fn(u32) -> bool,
    ) -> Result<PreparedEnvironment, String> {
        let count = images.len();
        if let Some(index) = environment.images().iter().find(|&&index| index as usize >= count) {
            return Err(format!("it refers to image number {index}, but the scene has only {count}"));
        }
        environment.check(images).map_err(|problem| problem.to_string())?;
        // An image that another face or a texture uses later is copied.
        let used = environment.images();
        let mut take = |place: usize| {
            let image = &mut images[used[place] as usize];
            image.check().map_err(|problem| format!("image \"{}\": {problem}", image.name))?;
            let shared = keeps(used[place]) || used[place + 1..].contains(&used[place]);
            let mut own = if shared { image.clone() } else { std::mem::replace(image, nothing()) };
            own.samples.make_positive();
            Ok::<Image, String>(own)
        };
        let kind = match &environment.kind {
            EnvironmentKind::Cube { smoothing, .. } => {
                let pages: Result<Vec<Image>, String> = (0..6).map(&mut take).collect();
                Kind::EnvironmentMap(EnvironmentMap::new(Layout::Cube, *smoothing, pages?))
            }
            EnvironmentKind::Cross { smoothing, .. } => {
                Kind::EnvironmentMap(EnvironmentMap::new(Layout::Cube, *smoothing, cross::faces(&take(0)?)))
            }
            EnvironmentKind::LatLong { smoothing, .. } => {
                Kind::EnvironmentMap(EnvironmentMap::new(Layout::Panorama, *smoothing, vec![take(0)?]))
            }
            EnvironmentKind::Gradient(gradient) => Kind::Gradient(gradient.clone()),
            EnvironmentKind::Sky(sky) => Kind::Sky(PreparedSky::new(sky)),
        };
        Ok(PreparedEnvironment {
            kind_name: environment.kind_name(),
            to_local: environment.rotation.inverse(),
            intensity: environment.intensity,
            kind,
        })
    }

    /// Whether lookups use a footprint: those in images with a prefilter.
    pub fn wants_footprint(&self) -> bool {
        matches!(&self.kind, Kind::EnvironmentMap(chart) if chart.is_smooth())
    }

    /// The radiance in a direction of any length but zero. `footprint` holds the differences of the unit direction to
    /// the next pixels to the right and above. With zeros the lookup isn't prefiltered.
    pub fn lookup(&self, direction: DVec3, footprint: [DVec3; 2]) -> EnvironmentLookup {
        let direction = direction.normalize();
        let local = self.to_local.vector(direction).normalize();
        let (place, footprint, value) = match &self.kind {
            Kind::EnvironmentMap(chart) => {
                let (place, footprint, value) =
                    chart.lookup(local, footprint.map(|change| self.to_local.vector(change)));
                (place, Some(footprint), value)
            }
            Kind::Gradient(gradient) => {
                let height = Gradient::height(local);
                (Place::Height(height), None, gradient.at(height))
            }
            Kind::Sky(dome) => {
                let (part, value) = dome.lookup(local);
                (Place::Sky(part), None, value)
            }
        };
        let radiance = (value * self.intensity).saturated();
        EnvironmentLookup { kind: self.kind_name, direction, local, place, footprint, value, radiance }
    }

    /// The columns and rows of texels of a latitude-longitude image.
    fn panorama_size(&self) -> Option<[usize; 2]> {
        match &self.kind {
            Kind::EnvironmentMap(map) => map.panorama_size(),
            Kind::Gradient(_) | Kind::Sky(_) => None,
        }
    }

    /// The columns and rows of a latitude-longitude grid that tells what the environment tells, within limits.
    fn resolution(&self) -> [usize; 2] {
        let [mut columns, mut rows] = match &self.kind {
            Kind::EnvironmentMap(map) => map.panorama_size().unwrap_or([4 * map.side(), 2 * map.side()]),
            // It depends on the height alone, so these are the columns of blocks.
            Kind::Gradient(_) => [8, 1024],
            Kind::Sky(_) => [512, 256],
        };
        (columns, rows) = (columns.max(8), rows.max(8));
        while columns > 2048 || rows > 1024 {
            (columns, rows) = (columns.div_ceil(2), rows.div_ceil(2));
        }
        [columns, rows]
    }

    /// The radiance in a direction of any length but zero, as [`PreparedEnvironment::lookup`] finds it, without the
    /// sun's disk. The sun's light comes from its light source.
    pub(crate) fn radiance_without_sun(&self, direction: DVec3, footprint: [DVec3; 2]) -> Rgb {
        match &self.kind {
            Kind::Sky(dome) => {
                let local = self.to_local.vector(direction.normalize()).normalize();
                (dome.radiance_without_sun(local) * self.intensity).saturated()
            }
            _ => self.lookup(direction, footprint).radiance,
        }
    }

    /// Whether a direction of any length but zero leads to the sun's visible disk.
    pub(crate) fn is_sun(&self, direction: DVec3) -> bool {
        match &self.kind {
            Kind::Sky(dome) => dome.is_sun(self.to_local.vector(direction.normalize()).normalize()),
            Kind::EnvironmentMap(_) | Kind::Gradient(_) => false,
        }
    }

    /// Whether the sun lights the scene, by a light of its own.
    pub(crate) fn sun_is_light(&self) -> bool {
        matches!(&self.kind, Kind::Sky(dome) if dome.sun_is_light)
    }

    /// [`PreparedEnvironment::radiance_without_sun`] of a sampled direction without a footprint.
    pub(crate) fn radiance_of_sample(&self, sample: &EnvironmentSample) -> Rgb {
        let EnvironmentSample { wi, place, .. } = *sample;
        Rgb::from(self.radiances_of_samples::<f64>(wi.into(), place))
    }

    /// [`PreparedEnvironment::radiance_of_sample`] in each lane, of samples with these directions and places.
    #[inline(always)]
    pub(crate) fn radiances_of_samples<F: Real64>(&self, wi: Vector<F>, place: [F; 2]) -> Vector<F::Narrow> {
        match &self.kind {
            Kind::EnvironmentMap(map) if map.is_smooth_panorama() => self.lit(map.panorama_radiance(place)),
            _ => self.each(wi, |direction| self.radiance_without_sun(direction, [DVec3::ZERO; 2])),
        }
    }

    /// The radiance of what an image shows in each lane.
    #[inline(always)]
    fn lit<F: Real32>(&self, value: Vector<F>) -> Vector<F> {
        let Rgb { r, g, b } = self.intensity;
        Vector { x: value.x * r, y: value.y * g, z: value.z * b }.map(saturated)
    }

    /// The radiance that a function gives for the direction of each lane.
    #[inline(always)]
    fn each<F: Real64>(&self, direction: Vector<F>, radiance: impl Fn(DVec3) -> Rgb) -> Vector<F::Narrow> {
        let mut directions = [[0.0; LANES]; 3];
        direction.store(&mut directions);
        let mut all = [[0.0; LANES]; 3];
        for lane in 0..F::COUNT {
            let [x, y, z] = directions.each_ref().map(|row| row[lane]);
            for (row, value) in all.iter_mut().zip(radiance(DVec3::new(x, y, z)).to_array()) {
                row[lane] = value;
            }
        }
        Vector::load(&all)
    }

    /// [`PreparedEnvironment::radiance_without_sun`] of a unit direction, and (u, v) of the direction in a
    /// latitude-longitude image of the environment.
    pub(crate) fn radiance_and_place(&self, direction: DVec3, footprint: [DVec3; 2]) -> (Rgb, [f64; 2]) {
        if footprint == [DVec3::ZERO; 2] {
            let (radiance, place) = self.radiances_and_places::<f64>(direction.into());
            return (radiance.into(), place);
        }
        let local = self.to_local.vector(direction).normalize();
        (self.radiance_without_sun(direction, footprint), panorama::uv(local))
    }

    /// [`PreparedEnvironment::radiance_and_place`] in each lane, without a footprint.
    #[inline(always)]
    pub(crate) fn radiances_and_places<F: Real64>(&self, direction: Vector<F>) -> (Vector<F::Narrow>, [F; 2]) {
        let local = Affine::splat(self.to_local.matrix()).vector(direction).normalized();
        let place = panorama::uvs(local);
        (self.radiances_of_samples(direction, place), place)
    }

    /// The light of the sun, if the environment has one that lights the scene.
    pub fn sun(&self, environment: &Environment) -> Option<Light> {
        let Kind::Sky(dome) = &self.kind else { return None };
        let towards = environment.rotation.vector(-dome.sun()).as_vec3();
        let kind = LightKind::Directional(Directional { towards, beam: None });
        let intensity = (dome.sunlight() * self.intensity).saturated();
        dome.sun_is_light.then(|| Light { name: Some("sun".into()), ..Light::new(kind, intensity) })
    }

    /// The mean over all directions. It is the mean radiance that a ball of white matte clay reflects.
    pub fn mean(&self) -> Rgb {
        let mean = match &self.kind {
            Kind::EnvironmentMap(chart) => chart.mean(),
            _ => {
                // Fibonacci's sphere: each direction stands for an equal solid angle.
                const COUNT: u32 = 4096;
                let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
                let mut sum = [0.0; 3];
                for i in 0..COUNT {
                    let y = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(COUNT);
                    let (sin, cos) = libm::sincos(f64::from(i) * golden);
                    let across = (1.0 - y * y).sqrt();
                    let local = DVec3::new(across * cos, y, across * sin);
                    let value = match &self.kind {
                        Kind::Gradient(gradient) => gradient.at(Gradient::height(local)),
                        Kind::Sky(dome) => dome.radiance_without_sun(local),
                        Kind::EnvironmentMap(_) => Rgb::BLACK,
                    };
                    sum.iter_mut().zip(value.to_array()).for_each(|(sum, v)| *sum += f64::from(v));
                }
                Rgb::from(sum.map(|v| (v / f64::from(COUNT)) as f32))
            }
        };
        (mean * self.intensity).saturated()
    }
}

/// The empty image that replaces a moved one.
fn nothing() -> Image {
    Image {
        name: String::new(),
        width: 1,
        height: 1,
        channels: 1,
        samples: Samples::U8(vec![0]),
        space: crate::texture::ColorSpace::Linear,
        premultiplied: false,
    }
}
