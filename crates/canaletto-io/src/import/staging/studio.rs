//! The light of staged models as an environment, whose exposure is known: the radiance of a white ball in it.

use super::direction_at;
use super::settings::StageLight;
use canaletto::light::environment::{Environment, EnvironmentKind, PreparedEnvironment, Sky, Smoothing};
use canaletto::math::{Rgb, Transform};
use canaletto::texture::{ColorSpace, Image, Samples};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// An environment with the image that it uses, and the irradiance of a horizontal surface from above.
pub(super) struct StageEnvironment {
    pub(super) environment: Environment,
    pub(super) image: Option<Image>,
    /// The radiance of a white matte floor.
    pub(super) floor: [f64; 3],
}

/// The mean radiance of a white matte ball as the camera sees it: 0.7 is 0.84 on screen after the tone curve.
const WHITE: f64 = 0.7;

/// The width and the height of the studio's image in texels.
const SIZE: [u32; 2] = [128, 64];

/// A softbox: a round source of light with a soft edge.
struct Softbox {
    /// The direction to it, in degrees to the right of the camera and above the horizon.
    at: [f64; 2],
    /// Its radius in degrees, and the width of its edge.
    radius: f64,
    edge: f64,
    /// Its radiance relative to the others.
    radiance: f64,
}

/// The key light at the left, a wide fill light at the right, light from behind for the edges, and one above.
const SOFTBOXES: [Softbox; 4] = [
    Softbox { at: [-42.0, 42.0], radius: 22.0, edge: 10.0, radiance: 7.0 },
    Softbox { at: [75.0, 18.0], radius: 34.0, edge: 16.0, radiance: 1.3 },
    Softbox { at: [155.0, 40.0], radius: 20.0, edge: 10.0, radiance: 5.0 },
    Softbox { at: [0.0, 90.0], radius: 32.0, edge: 18.0, radiance: 2.0 },
];

/// The radiance of the studio's walls at the horizon and straight above, relative to the softboxes.
const WALLS: [f64; 2] = [0.35, 0.6];

/// The studio's relative radiance above the horizon; +z is towards the camera.
fn studio(direction: DVec3) -> f64 {
    let [horizon, zenith] = WALLS;
    let walls = horizon + (zenith - horizon) * direction.y.max(0.0);
    SOFTBOXES.iter().fold(walls, |sum, softbox| {
        let angle = libm::acos(direction.dot(direction_at(softbox.at[0], softbox.at[1])).clamp(-1.0, 1.0)).to_degrees();
        let inside = ((softbox.radius + 0.5 * softbox.edge - angle) / softbox.edge).clamp(0.0, 1.0);
        sum + softbox.radiance * inside * inside * (3.0 - 2.0 * inside)
    })
}

/// The light for a model that is seen from the direction `towards`. `below` is the radiance of what is under it.
pub(super) fn stage_environment(light: StageLight, towards: DVec3, below: f64) -> StageEnvironment {
    match light {
        StageLight::Studio => lat_long(studio, towards, below),
        StageLight::Neutral => lat_long(|_| 1.0, towards, below),
        StageLight::Sky => {
            let sky = Sky { sun: beside(towards, DVec3::new(-0.6, 0.75, 0.45)).as_vec3(), ..Sky::default() };
            let environment = Environment::new(EnvironmentKind::Sky(sky));
            // The ground below the horizon is lit like a floor.
            let below = PreparedEnvironment::new(&environment, &mut [], |_| false)
                .map_or(sky.ground, |prepared| prepared.lookup(DVec3::NEG_Y, [DVec3::ZERO; 2]).radiance);
            let floor = [0, 1, 2].map(|c| f64::from(below.to_array()[c]) / f64::from(sky.ground.to_array()[c]));
            StageEnvironment { environment, image: None, floor }
        }
    }
}

/// A direction beside the camera, which +z leads to, in the scene.
fn beside(towards: DVec3, local: DVec3) -> DVec3 {
    let turn = libm::atan2(towards.x, towards.z);
    let (sin, cos) = libm::sincos(turn);
    DVec3::new(local.x * cos + local.z * sin, local.y, local.z * cos - local.x * sin)
}

/// The image of a relative radiance above the horizon, scaled so that a white ball is [`WHITE`].
fn lat_long(above: impl Fn(DVec3) -> f64, towards: DVec3, below: f64) -> StageEnvironment {
    let [width, height] = SIZE;
    let mut radiances = Vec::with_capacity((width * height) as usize);
    // The radiance of a white matte surface in each of these directions is the sum over texels of L cos θ dω / π.
    let normals: Vec<(DVec3, f64)> = seen_normals().collect();
    let (mut lit_above, mut lit_below, mut floor) = (0.0, 0.0, 0.0);
    for row in 0..height {
        let polar = PI * (f64::from(row) + 0.5) / f64::from(height);
        let (sin, cos) = libm::sincos(polar);
        let solid_angle = TAU / f64::from(width) * PI / f64::from(height) * sin;
        for column in 0..width {
            let azimuth = TAU * ((f64::from(column) + 0.5) / f64::from(width) - 0.5);
            let (sin_azimuth, cos_azimuth) = libm::sincos(azimuth);
            let direction = DVec3::new(sin_azimuth * sin, cos, -cos_azimuth * sin);
            let seen: f64 = normals.iter().map(|(n, weight)| n.dot(direction).max(0.0) * weight).sum();
            let share = seen * solid_angle / PI;
            let is_above = direction.y > 0.0;
            let radiance = if is_above { above(direction) } else { 0.0 };
            radiances.push(radiance);
            if is_above {
                lit_above += radiance * share;
                floor += radiance * direction.y * solid_angle / PI;
            } else {
                lit_below += share;
            }
        }
    }
    let scale = ((WHITE - below * lit_below) / lit_above).max(0.0);
    let half = (width * height / 2) as usize;
    let radiance = |(i, radiance): (usize, &f64)| if i < half { radiance * scale } else { below } as f32;
    let samples = radiances.iter().enumerate().map(radiance).collect();
    let image = Image {
        name: "studio".into(),
        width,
        height,
        channels: 1,
        samples: Samples::F32(samples),
        space: ColorSpace::Linear,
        premultiplied: false,
    };
    let kind = EnvironmentKind::LatLong { image: 0, smoothing: Smoothing::Bilinear };
    let turn = libm::atan2(towards.x, towards.z).to_degrees();
    let rotation = Transform::rotate(DVec3::Y, turn).unwrap_or(Transform::IDENTITY);
    let environment = Environment { rotation, visible: false, ..Environment::new(kind) };
    StageEnvironment { environment, image: Some(image), floor: [floor * scale; 3] }
}

/// The normals of a ball that a camera in front sees, with the share of the ball's picture that each has.
fn seen_normals() -> impl Iterator<Item = (DVec3, f64)> {
    const RINGS: u32 = 6;
    const SECTORS: u32 = 12;
    (0..RINGS * SECTORS).map(|i| {
        let radius = ((f64::from(i / SECTORS) + 0.5) / f64::from(RINGS)).sqrt();
        let (sin, cos) = libm::sincos(TAU * (f64::from(i % SECTORS) + 0.5) / f64::from(SECTORS));
        let normal = DVec3::new(radius * cos, radius * sin, (1.0 - radius * radius).sqrt());
        (normal, 1.0 / f64::from(RINGS * SECTORS))
    })
}

/// A grey as a colour.
pub(super) fn gray(radiance: f64) -> Rgb {
    Rgb::gray(radiance as f32)
}
