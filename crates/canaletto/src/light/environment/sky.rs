//! A clear or hazy sky with its sun: Preetham, Shirley and Smits, *A Practical Analytic Model for Daylight*
//! (SIGGRAPH 1999).
//!
//! The dome is their fit of Perez's formula to skies that they computed. The sun is a black body of 5778 K behind the
//! air of their appendix. Its colour uses Wyman, Sloan and Shirley's formulas for the CIE 1931 observer (JCGT 2(2),
//! 2013) in place of tables.
//!
//! This model was chosen since it is complete in a few numbers. Hosek and Wilkie's model (2012) fits better where the
//! sun is low or the air thick, but needs tables of thousands of numbers.
//!
//! Deviations: ozone, water vapour and mixed gases are omitted; they absorb less than a twentieth of the visible light.
//! The horizon is sharp, and the ground below it is a matte plane lit by sun and sky.
//!
//! The model ends with the sun at the horizon. While the sun is lower, that sky is darker by the illuminance of
//! twilight ([`twilight`]), and its colours stay.

use crate::OutOfRange;
use crate::math::Rgb;
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A sky; y is upwards.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sky {
    /// The direction to the sun, of any length. Below the horizon it makes twilight, and from 18 degrees on night.
    pub sun: Vec3,
    /// The haze, in [`Sky::TURBIDITY`]: 2 is very clear, 3 clear, 6 hazy, 10 thick.
    pub turbidity: f32,
    /// The reflectance of the ground, each component in 0..=1.
    pub ground: Rgb,
    /// The exposure in stops, each of which doubles the light. At 0 a luminance of 32 kcd/m² is 1, so that a white
    /// surface that faces the midday sun is near 1.
    pub exposure: f32,
    /// Whether the sun's disk is visible.
    pub disk: bool,
    /// Whether the sun lights the scene, as a parallel light of the sun's colour.
    pub light: bool,
}

impl Default for Sky {
    fn default() -> Sky {
        Sky {
            sun: Vec3::new(-0.5, 0.7, 0.4),
            turbidity: 3.0,
            ground: Rgb::gray(0.2),
            exposure: 0.0,
            disk: true,
            light: true,
        }
    }
}

/// The decimal logarithm of the illuminance from the sky, relative to that with the sun at the horizon, at each 2
/// degrees below it (Janiczek and DeYoung, *Computer Programs for Sun and Moon Illuminance*, US Naval Observatory
/// Circular 171, 1987): 759 lux at sunset, 3.4 lux where civil twilight ends at 6 degrees, 0.00065 lux at night.
const TWILIGHT: [f64; 10] = [0.0, -0.603, -1.404, -2.347, -3.338, -4.256, -4.974, -5.415, -5.721, -6.071];
/// The depth below the horizon in degrees at which the sun has set: its radius, and the refraction of the air.
const SUNSET: f64 = (16.0 + 34.0) / 60.0;

/// The brightness of the sky for a height of the sun in degrees, relative to that with the sun at the horizon: 1 by
/// day, falling until 18 degrees below the horizon, then that of the night. It is linear in its logarithm between the
/// table's places.
fn twilight(height: f64) -> f64 {
    let place = (-0.5 * height).clamp(0.0, (TWILIGHT.len() - 1) as f64);
    let row = (place as usize).min(TWILIGHT.len() - 2);
    let share = place - row as f64;
    libm::pow(10.0, TWILIGHT[row] + (TWILIGHT[row + 1] - TWILIGHT[row]) * share)
}

/// The sun's direction, but at the horizon if it is lower, and its height in degrees.
fn sun_by_day(direction: Vec3) -> (DVec3, f64) {
    let sun = direction.as_dvec3().normalize();
    if sun.y >= 0.0 {
        return (sun, 0.0);
    }
    // Straight down the bearing doesn't matter: it is night.
    let across = DVec3::new(sun.x, 0.0, sun.z).normalize_or(DVec3::NEG_Z);
    (across, libm::asin(sun.y.max(-1.0)).to_degrees())
}

/// The angular radius of the sun's disk in radians: 16 minutes of arc.
const SUN_RADIUS: f64 = 16.0 / 60.0 * PI / 180.0;
/// The luminance in kcd/m² that is 1 at exposure 0.
const UNIT: f64 = 32.0;

impl Sky {
    /// The turbidities to which the model was fitted.
    pub const TURBIDITY: std::ops::RangeInclusive<f32> = 2.0..=10.0;
    /// The largest magnitude of the exposure.
    pub const MAX_EXPOSURE: f32 = 32.0;

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        if !Sky::TURBIDITY.contains(&self.turbidity) {
            return Err(OutOfRange::new(
                "turbidity",
                format!("is {}; it must be between 2 (very clear) and 10 (thick haze)", self.turbidity),
            ));
        }
        if self.sun.as_dvec3().try_normalize().is_none() {
            return Err(OutOfRange::new("sun", "has no direction"));
        }
        if self.ground.to_array().iter().any(|v| !(0.0..=1.0).contains(v)) {
            let g = self.ground;
            return Err(OutOfRange::new(
                "ground",
                format!("is {} {} {}; each component must be between 0 and 1", g.r, g.g, g.b),
            ));
        }
        if self.exposure.is_nan() || self.exposure.abs() > Sky::MAX_EXPOSURE {
            return Err(OutOfRange::new(
                "exposure",
                format!("is {}; it must be between -32 and 32 stops", self.exposure),
            ));
        }
        Ok(())
    }
}

/// Perez's formula with its five coefficients.
#[derive(Clone, Copy, Debug)]
struct Perez([f64; 5]);

impl Perez {
    /// The coefficients A to E, each a linear function of the turbidity.
    fn new(turbidity: f64, fit: [[f64; 2]; 5]) -> Perez {
        Perez(fit.map(|[slope, constant]| slope * turbidity + constant))
    }

    /// F(θ, γ) for the cosine of the angle to the zenith and the angle to the sun with its cosine.
    fn at(&self, cos_theta: f64, gamma: f64, cos_gamma: f64) -> f64 {
        let [a, b, c, d, e] = self.0;
        (1.0 + a * libm::exp(b / cos_theta)) * (1.0 + c * libm::exp(d * gamma) + e * cos_gamma * cos_gamma)
    }
}

/// The runtime form of a sky.
#[derive(Clone, Debug)]
pub(super) struct PreparedSky {
    sun: DVec3,
    /// The formulas of Y, x and y.
    perez: [Perez; 3],
    /// Y in kcd/m², x and y at the zenith, each divided by its F there.
    zenith: [f64; 3],
    /// The factor from kcd/m² to the picture's numbers.
    scale: f64,
    ground: Rgb,
    /// The radiance of the sun's disk, if it is visible.
    disk: Option<Rgb>,
    /// E / π of a surface that faces the sun: the intensity of its light.
    sunlight: Rgb,
    /// Whether the sun lights the scene. Below the horizon it doesn't.
    pub(super) sun_is_light: bool,
}

/// The part of the sky at which a lookup arrives.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// The air.
    Air,
    /// The sun's disk, with the air before it.
    Sun,
    /// The ground below the horizon.
    Ground,
}

impl PreparedSky {
    /// The dome of a sky whose numbers are in range.
    pub(super) fn new(sky: &Sky) -> PreparedSky {
        let turbidity = f64::from(sky.turbidity);
        let (sun, depth) = sun_by_day(sky.sun);
        let theta = libm::acos(sun.y.clamp(0.0, 1.0));
        let perez = [
            // Table 2 of the paper's appendix.
            [[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]],
            [[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]],
            [[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]],
        ]
        .map(|fit| Perez::new(turbidity, fit));
        let zenith = zenith(turbidity, theta);
        let at_zenith = [0, 1, 2].map(|i| zenith[i] / perez[i].at(1.0, theta, sun.y));
        let exposed = libm::exp2(f64::from(sky.exposure)) / UNIT;
        let scale = exposed * twilight(depth);
        // The disk sinks below the horizon.
        let above = (1.0 + depth / SUNSET).max(0.0);
        let direct = direct_sunlight(turbidity, theta).map(|e| e * above);
        // Every point of the disk has the radiance L, and ∫ over the disk of L cos is L π sin².
        let sin = libm::sin(SUN_RADIUS);
        let disk = direct.map(|e| e / (PI * sin * sin));
        let mut dome = PreparedSky {
            sun,
            perez,
            zenith: at_zenith,
            scale,
            ground: Rgb::BLACK,
            disk: (sky.disk && above > 0.0).then(|| color(disk, exposed)),
            sunlight: color(direct.map(|e| e / PI), exposed),
            sun_is_light: sky.light && above > 0.0,
        };
        let lit = dome.irradiance_over_pi() + dome.sunlight * sun.y as f32;
        dome.ground = (lit * sky.ground).saturated();
        dome
    }

    /// The unit direction to the sun, which isn't below the horizon.
    pub(super) fn sun(&self) -> DVec3 {
        self.sun
    }

    /// E/π of a surface that faces the sun.
    pub(super) fn sunlight(&self) -> Rgb {
        self.sunlight
    }

    /// The part and the radiance in a unit direction.
    pub(super) fn lookup(&self, direction: DVec3) -> (Part, Rgb) {
        if direction.y < 0.0 {
            return (Part::Ground, self.ground);
        }
        let air = self.air(direction.y, direction.dot(self.sun).clamp(-1.0, 1.0));
        match self.disk {
            Some(disk) if self.is_sun(direction) => (Part::Sun, (air + disk).saturated()),
            _ => (Part::Air, air),
        }
    }

    /// Whether a unit direction leads to the visible disk.
    pub(super) fn is_sun(&self, direction: DVec3) -> bool {
        self.disk.is_some() && direction.y >= 0.0 && direction.dot(self.sun) >= libm::cos(SUN_RADIUS)
    }

    /// The radiance without the sun's disk, whose light comes from its light source.
    pub(super) fn radiance_without_sun(&self, direction: DVec3) -> Rgb {
        if direction.y < 0.0 { self.ground } else { self.air(direction.y, direction.dot(self.sun).clamp(-1.0, 1.0)) }
    }

    fn air(&self, cos_theta: f64, cos_gamma: f64) -> Rgb {
        let gamma = libm::acos(cos_gamma);
        let [luminance, x, y] =
            [0, 1, 2].map(|i| self.zenith[i] * self.perez[i].at(cos_theta.max(1e-9), gamma, cos_gamma));
        let luminance = luminance.max(0.0);
        color([x / y * luminance, luminance, (1.0 - x - y) / y * luminance], self.scale)
    }

    /// 1/π of the light that the dome without the sun sends to the ground. The sum uses the midpoints of 32 × 64 equal
    /// parts of the disk that the hemisphere projects to, so that all have equal weight.
    fn irradiance_over_pi(&self) -> Rgb {
        const RINGS: u32 = 32;
        const SPOKES: u32 = 64;
        let mut sum = [0.0; 3];
        for ring in 0..RINGS {
            let sin2 = (f64::from(ring) + 0.5) / f64::from(RINGS);
            let (sin, cos) = (sin2.sqrt(), (1.0 - sin2).sqrt());
            for spoke in 0..SPOKES {
                let (s, c) = libm::sincos((f64::from(spoke) + 0.5) / f64::from(SPOKES) * 2.0 * PI);
                let direction = DVec3::new(sin * c, cos, sin * s);
                let air = self.air(cos, direction.dot(self.sun).clamp(-1.0, 1.0)).to_array();
                sum.iter_mut().zip(air).for_each(|(sum, v)| *sum += f64::from(v));
            }
        }
        Rgb::from(sum.map(|v| (v / f64::from(RINGS * SPOKES)) as f32))
    }
}

/// Y in kcd/m², x and y at the zenith for the sun's angle to it.
fn zenith(turbidity: f64, theta: f64) -> [f64; 3] {
    let chi = (4.0 / 9.0 - turbidity / 120.0) * (PI - 2.0 * theta);
    let luminance = (4.0453 * turbidity - 4.9710) * libm::tan(chi) - 0.2155 * turbidity + 2.4192;
    let cubic = |c: [f64; 4]| ((c[0] * theta + c[1]) * theta + c[2]) * theta + c[3];
    let chroma = |rows: [[f64; 4]; 3]| (cubic(rows[0]) * turbidity + cubic(rows[1])) * turbidity + cubic(rows[2]);
    let x = chroma([
        [0.00166, -0.00375, 0.00209, 0.0],
        [-0.02903, 0.06377, -0.03202, 0.00394],
        [0.11693, -0.21196, 0.06052, 0.25886],
    ]);
    let y = chroma([
        [0.00275, -0.00610, 0.00317, 0.0],
        [-0.04214, 0.08970, -0.04153, 0.00516],
        [0.15346, -0.26756, 0.06670, 0.26688],
    ]);
    [luminance.max(0.0), x, y]
}

/// X, Y, Z of the light on a surface that faces the sun, behind the air; Y in klx.
fn direct_sunlight(turbidity: f64, theta: f64) -> [f64; 3] {
    // The relative optical mass (Kasten), with the angle in degrees.
    let mass = 1.0 / (libm::cos(theta) + 0.15 * libm::pow(93.885 - theta.to_degrees(), -1.253));
    let beta = 0.04608 * turbidity - 0.04586;
    solar(|micrometres| {
        let molecules = 0.008735 * libm::pow(micrometres, -4.08);
        let haze = beta * libm::pow(micrometres, -1.3);
        libm::exp(-(molecules + haze) * mass)
    })
}

/// X, Y, Z of sunlight, Y in klx. The share `passed` of each wavelength arrives.
fn solar(passed: impl Fn(f64) -> f64) -> [f64; 3] {
    const STEP: f64 = 0.005;
    /// h c² and h c / k, in units of W, m², and of µm K.
    const HC2: f64 = 5.955_215e-17;
    const HC_K: f64 = 14_387.77;
    /// The temperature of the sun's surface in K, and its solid angle.
    const TEMPERATURE: f64 = 5778.0;
    const SOLID_ANGLE: f64 = 6.807e-5;
    /// The luminous efficacy in thousands of lumens per watt.
    const EFFICACY: f64 = 0.683;
    let mut sum = [0.0; 3];
    for i in 0..=90 {
        let micrometres = 0.38 + STEP * f64::from(i);
        let metres = micrometres * 1e-6;
        let planck =
            2.0 * HC2 / (metres * metres * metres * metres * metres) / libm::expm1(HC_K / (micrometres * TEMPERATURE));
        let arriving = planck * SOLID_ANGLE * passed(micrometres) * STEP * 1e-6 * EFFICACY;
        sum.iter_mut().zip(observer(micrometres * 1000.0)).for_each(|(sum, response)| *sum += arriving * response);
    }
    sum
}

/// The CIE 1931 observer at a wavelength in nanometres, by lobes of two half Gaussians.
fn observer(wavelength: f64) -> [f64; 3] {
    let lobe = |height: f64, centre: f64, below: f64, above: f64| {
        let t = (wavelength - centre) / if wavelength < centre { below } else { above };
        height * libm::exp(-0.5 * t * t)
    };
    [
        lobe(1.056, 599.8, 37.9, 31.0) + lobe(0.362, 442.0, 16.0, 26.7) + lobe(-0.065, 501.1, 20.4, 26.2),
        lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1),
        lobe(1.217, 437.0, 11.8, 36.0) + lobe(0.681, 459.0, 26.0, 13.8),
    ]
}

/// Linear sRGB of X, Y, Z. Colours outside its gamut are clamped to it.
fn color(xyz: [f64; 3], scale: f64) -> Rgb {
    let [x, y, z] = xyz.map(|v| v * scale);
    let rgb = [
        3.240_454_2 * x - 1.537_138_5 * y - 0.498_531_4 * z,
        -0.969_266_0 * x + 1.876_010_8 * y + 0.041_556_0 * z,
        0.055_643_4 * x - 0.204_025_9 * y + 1.057_225_2 * z,
    ];
    Rgb::from(rgb.map(|v| v.max(0.0) as f32)).saturated()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sky(elevation: f64, turbidity: f32) -> PreparedSky {
        let (sin, cos) = elevation.to_radians().sin_cos();
        let sun = Vec3::new(cos as f32, sin as f32, 0.0);
        PreparedSky::new(&Sky { sun, turbidity, ..Sky::default() })
    }

    fn luminance(c: Rgb) -> f64 {
        UNIT * (0.2126 * f64::from(c.r) + 0.7152 * f64::from(c.g) + 0.0722 * f64::from(c.b))
    }

    /// Literature: the sun above the air gives 128 to 134 klx; through clear air from the zenith about 100. White light
    /// of the sun has a chromaticity near (0.32, 0.33).
    #[test]
    fn sunlight_is_as_bright_as_measured() {
        let [x, y, z] = solar(|_| 1.0);
        assert!((120.0..135.0).contains(&y), "{y} klx");
        let chroma = [x, y].map(|v| v / (x + y + z));
        assert!((chroma[0] - 0.326).abs() < 0.006 && (chroma[1] - 0.336).abs() < 0.006, "{chroma:?}");
        let [_, overhead, _] = direct_sunlight(2.5, 0.0);
        assert!((90.0..112.0).contains(&overhead), "{overhead} klx");
        let mut last = f64::INFINITY;
        for theta in [0.0, 30.0, 60.0, 75.0, 85.0, 90.0f64] {
            let [_, y, _] = direct_sunlight(3.0, theta.to_radians());
            assert!(y < last && y > 0.0);
            last = y;
        }
        let [x, _, z] = direct_sunlight(3.0, 88f64.to_radians());
        assert!(x > 5.0 * z, "a low sun is red: {x} {z}");
    }

    /// Compares our observer with entries of the CIE 1931 table.
    #[test]
    fn the_observer_is_the_cies() {
        for (wavelength, table) in [
            (440.0, [0.3483, 0.0230, 1.7471]),
            (500.0, [0.0049, 0.3230, 0.2720]),
            (550.0, [0.4334, 0.9950, 0.0087]),
            (600.0, [1.0622, 0.6310, 0.0008]),
            (650.0, [0.2835, 0.1070, 0.0000]),
        ] {
            for (ours, theirs) in observer(wavelength).into_iter().zip(table) {
                assert!((ours - theirs).abs() < 0.045, "{wavelength} nm: {ours} instead of {theirs}");
            }
        }
    }

    /// The paper's formulas as vectors and matrices, evaluated independently of this program: T = 3, the sun 45° high.
    #[test]
    fn the_zenith_is_the_papers() {
        let [luminance, x, y] = zenith(3.0, PI / 4.0);
        assert!((luminance - 7.320358).abs() < 1e-6, "{luminance}");
        assert!((x - 0.245678).abs() < 1e-6 && (y - 0.251476).abs() < 1e-6, "{x} {y}");
    }

    #[test]
    fn the_sky_is_blue_above_bright_at_the_sun_and_never_negative() {
        for turbidity in [2.0, 3.0, 6.0, 10.0] {
            for elevation in [0.0, 5.0, 30.0, 60.0, 90.0] {
                let dome = sky(elevation, turbidity);
                for i in 0..500 {
                    let t = f64::from(i) / 500.0;
                    let (s, c) = (t * 61.0).sin_cos();
                    let r = (1.0 - t * t).sqrt();
                    let (_, value) = dome.lookup(DVec3::new(r * c, t, r * s));
                    assert!(value.is_finite() && value.to_array().iter().all(|v| *v >= 0.0), "{value:?}");
                }
            }
        }
        let dome = sky(40.0, 2.5);
        let (part, up) = dome.lookup(DVec3::Y);
        assert!(part == Part::Air && up.b > 1.5 * up.r, "{up:?}");
        let (part, sun) = dome.lookup(dome.sun);
        assert!(part == Part::Sun && luminance(sun) > 1e5, "{sun:?}");
        let beside = (dome.sun + DVec3::Z * 0.01).normalize();
        let (part, beside) = dome.lookup(beside);
        assert!(part == Part::Air && luminance(beside) > luminance(up));
        assert_eq!(dome.lookup(DVec3::NEG_Y).0, Part::Ground);
        // The light at the ground is at most the sunlight outside the air and at least the part that clear air lets
        // through.
        let all = luminance(dome.ground) / 0.2 * PI;
        assert!((40.0..120.0).contains(&all), "{all} klx");
    }

    /// From noon to midnight the light falls without a jump, from the model's to a night's, and is never NaN.
    #[test]
    fn the_sky_goes_on_below_the_horizon() {
        let lux = |height: f64| {
            let dome = sky(height, 3.0);
            for direction in [DVec3::Y, DVec3::NEG_Y, DVec3::X, dome.sun(), -dome.sun(), DVec3::new(0.6, 0.0, 0.8)] {
                let (_, value) = dome.lookup(direction);
                assert!(value.is_finite() && value.to_array().iter().all(|v| *v >= 0.0), "{height}: {value:?}");
            }
            assert!(dome.sunlight().is_finite() && dome.sun().y >= 0.0);
            1000.0 * PI * luminance(dome.irradiance_over_pi())
        };
        let sunset = lux(0.0);
        // The table of twilight: civil, nautical and astronomical.
        for (height, measured) in [(-6.0, 3.4), (-12.0, 0.0081), (-18.0, 0.00065)] {
            let found = lux(height) / sunset * 758.6;
            assert!((found / measured - 1.0).abs() < 0.05, "{height}: {found} lux, not {measured}");
        }
        let step = 0.05;
        let mut last = sunset;
        for i in 1..=400 {
            let height = -step * f64::from(i);
            let here = lux(height);
            assert!(here <= last && here > last * 0.92, "{height}: {here} after {last}");
            last = here;
        }
        assert_eq!([lux(-18.0), lux(-50.0)].map(|v| v as f32), [lux(-90.0) as f32; 2]);
        lux(90.0);
        // The sun's own light falls to 0 while the disk sinks.
        let suns = [0.0, -0.1, -0.5, -0.9].map(|height| luminance(sky(height, 3.0).sunlight()));
        assert!(suns[0] > suns[1] && suns[1] > 0.85 * suns[0] && suns[2] > 0.0 && suns[3] == 0.0, "{suns:?}");
        assert!(sky(-0.9, 3.0).disk.is_none());
    }

    /// The light of the disk equals that of the light source that replaces it.
    #[test]
    fn disk_and_light_agree() {
        let dome = sky(35.0, 3.0);
        let n = 400;
        let (mut sum, side) = (0.0, dome.sun.any_orthonormal_vector());
        for i in 0..n {
            let angle = (f64::from(i) + 0.5) / f64::from(n) * SUN_RADIUS * 1.5;
            let d = dome.sun * angle.cos() + side * angle.sin();
            let (_, with) = dome.lookup(d);
            let without = dome.air(d.y, d.dot(dome.sun));
            sum += (f64::from(with.g) - f64::from(without.g)) * angle.cos() * angle.sin() * 2.0 * PI * SUN_RADIUS * 1.5
                / f64::from(n);
        }
        let light = f64::from(dome.sunlight().g) * PI;
        assert!((sum / light - 1.0).abs() < 0.01, "{sum} {light}");
    }
}
