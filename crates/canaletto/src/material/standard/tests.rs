//! The standard surface: densities, albedos, what is lossless, and each layer against a formula.

use super::super::testing::{albedo, bsdf_of, check_sampling, direction, unsqueezed_albedo};
use super::super::{Bsdf, Lobe, Material, MaterialPoint, ScatteringFrame};
use super::*;
use crate::material::METALS;
use crate::shape::testing::Random;
use glam::DVec3;

fn bsdf_in(surface: StandardSurface, frame: ScatteringFrame) -> Bsdf {
    surface.check().unwrap();
    bsdf_of(surface, frame)
}

fn bsdf(surface: StandardSurface) -> Bsdf {
    let eta_ratio = if surface.transmission.weight > 0.0 { 1.0 / f64::from(surface.ior()) } else { 1.0 };
    bsdf_in(
        surface,
        ScatteringFrame { tangent: DVec3::new(0.3, 1.0, 0.0), ..ScatteringFrame::flat(DVec3::Z, eta_ratio) },
    )
}

fn from_inside(surface: StandardSurface) -> Bsdf {
    let eta_ratio = f64::from(surface.ior());
    bsdf_in(surface, ScatteringFrame { outside: false, ..ScatteringFrame::flat(DVec3::Z, eta_ratio) })
}

fn white() -> StandardSurface {
    StandardSurface {
        base: StandardBase { color: Rgb::WHITE, ..StandardBase::default() },
        ..StandardSurface::default()
    }
}

fn rough(surface: StandardSurface, roughness: f32) -> StandardSurface {
    StandardSurface { specular: StandardSpecular { roughness, ..surface.specular }, ..surface }
}

fn clear() -> StandardSurface {
    let transmission = StandardTransmission { weight: 1.0, ..StandardTransmission::default() };
    StandardSurface { transmission, ..StandardSurface::default() }
}

fn coated(surface: StandardSurface, roughness: f32) -> StandardSurface {
    StandardSurface { coat: StandardCoat { weight: 1.0, roughness, ..StandardCoat::default() }, ..surface }
}

fn metal(surface: StandardSurface) -> StandardSurface {
    StandardSurface { base: StandardBase { metalness: 1.0, ..surface.base }, ..surface }
}

fn fuzzy(surface: StandardSurface, roughness: f32) -> StandardSurface {
    StandardSurface { fuzz: StandardFuzz { weight: 1.0, color: Rgb::WHITE, roughness }, ..surface }
}

fn filmed(surface: StandardSurface, thickness: f32) -> StandardSurface {
    StandardSurface { thin_film: StandardThinFilm { weight: 1.0, thickness, ior: 1.4 }, ..surface }
}

fn thin(surface: StandardSurface) -> StandardSurface {
    StandardSurface { thin_walled: true, ..surface }
}

fn brushed(surface: StandardSurface, anisotropy: f32) -> StandardSurface {
    StandardSurface { specular: StandardSpecular { anisotropy, ..surface.specular }, ..surface }
}

fn flat(surface: StandardSurface) -> StandardSurface {
    StandardSurface { base: StandardBase { diffuse_roughness: 1.0, ..surface.base }, ..surface }
}

fn leaf() -> StandardSurface {
    let subsurface = StandardSubsurface { weight: 0.7, color: Rgb::WHITE, scatter_anisotropy: 0.0 };
    thin(StandardSurface { subsurface, ..white() })
}

/// A leaf that sends most of the light through.
fn sheer_leaf() -> StandardSurface {
    let subsurface = StandardSubsurface { scatter_anisotropy: 0.8, ..leaf().subsurface };
    StandardSurface { subsurface, ..leaf() }
}

/// A dielectric by Schlick's curve with a tinted reflection.
fn schlick(surface: StandardSurface) -> StandardSurface {
    let specular = StandardSpecular { color: Rgb::new(1.0, 0.6, 0.2), ior: 3.0, ..surface.specular };
    StandardSurface { schlick: true, specular, ..surface }
}

const ANGLES: [f64; 4] = [0.0, 45.0, 75.0, 88.0];

#[test]
fn directions_have_their_density() {
    let mixed = StandardSurface {
        base: StandardBase { metalness: 0.4, diffuse_roughness: 0.5, ..StandardBase::default() },
        transmission: StandardTransmission { weight: 0.5, ..StandardTransmission::default() },
        ..fuzzy(coated(rough(StandardSurface::default(), 0.6), 0.5), 0.4)
    };
    let all = [
        rough(white(), 0.4),
        metal(rough(white(), 0.7)),
        coated(rough(white(), 0.6), 0.35),
        fuzzy(flat(rough(white(), 0.8)), 0.3),
        filmed(rough(white(), 0.5), 0.4),
        brushed(metal(rough(white(), 0.6)), 0.8),
        rough(clear(), 0.5),
        thin(rough(clear(), 0.5)),
        rough(leaf(), 0.5),
        rough(sheer_leaf(), 0.5),
        schlick(rough(white(), 0.5)),
        filmed(schlick(rough(white(), 0.5)), 0.4),
        mixed,
    ];
    for (surface, degrees) in all.into_iter().zip([10.0, 65.0, 40.0].into_iter().cycle()) {
        check_sampling(&bsdf(surface), direction(degrees), 0.0);
    }
    check_sampling(&from_inside(rough(clear(), 0.5)), direction(40.0), 0.0);
    check_sampling(&from_inside(rough(mixed, 0.5)), direction(30.0), 0.0);
}

/// A coat with a normal of its own over a base whose normal leans by these degrees.
fn over_leaning_base(surface: StandardSurface, coat_normal: DVec3, degrees: f64) -> Bsdf {
    let material = Material::new_standard("m", surface);
    let (sin, cos) = degrees.to_radians().sin_cos();
    let frame = ScatteringFrame { normal: DVec3::new(sin, 0.0, cos), ..ScatteringFrame::flat(DVec3::Z, 1.0) };
    let point = MaterialPoint {
        classic: material.classic(),
        standard: Some(surface),
        coat_normal: coat_normal.as_vec3(),
        normal_bent: true,
        ..MaterialPoint::default()
    };
    material.bsdf(&point, frame)
}

/// A coat doesn't follow the bumps of its base.
#[test]
fn coats_have_normals_of_their_own() {
    let smooth = coated(rough(white(), 0.5), 0.0);
    let wo = direction(30.0);
    for coat_normal in [DVec3::Z, DVec3::new(-0.2, 0.1, 1.0).normalize()] {
        let seen = over_leaning_base(smooth, coat_normal, 20.0);
        let seen = seen.seen_from(wo);
        let mirrored = (0..64).filter_map(|i| seen.sample((f64::from(i) + 0.5) / 64.0, [0.3, 0.6]));
        let mirrored: Vec<_> = mirrored.filter(|sample| sample.is_delta).collect();
        assert!(!mirrored.is_empty());
        let expected = coat_normal * (2.0 * wo.dot(coat_normal)) - wo;
        assert!(mirrored.iter().all(|sample| (sample.wi - expected).length() < 1e-6), "{:?}", mirrored[0]);
        let rough_coat = coated(rough(white(), 0.6), 0.35);
        check_sampling(&over_leaning_base(rough_coat, coat_normal, 20.0), wo, 0.0);
        for degrees in ANGLES {
            let albedo = albedo(&over_leaning_base(rough_coat, coat_normal, 20.0), degrees);
            assert!(albedo.is_at_most(1.0 + 0.02), "{coat_normal}, {degrees}°: {albedo:?}");
        }
    }
    // The normal of the base itself changes nothing.
    let own = |normal: DVec3| over_leaning_base(coated(rough(white(), 0.6), 0.35), normal, 20.0);
    let base_normal = DVec3::new(20f64.to_radians().sin(), 0.0, 20f64.to_radians().cos());
    let [a, b] = [own(DVec3::ZERO), own(base_normal)].map(|bsdf| bsdf.eval(wo, direction(-50.0)));
    assert!((a - b).to_array().iter().all(|v| v.abs() < 1e-4), "{a:?} {b:?}");
}

/// What the tables and quadratures of albedos may err by.
const TABLES: f64 = 2e-3;

/// A surface of some roughness.
type Make = fn(f32) -> StandardSurface;

/// No more light leaves than arrives, on a grid of roughness and angles, whatever the layers are.
#[test]
fn no_surface_gains_light() {
    let make: [(&str, Make); 15] = [
        ("plastic", |r| rough(white(), r)),
        ("metal", |r| metal(rough(white(), r))),
        ("coat", |r| coated(rough(white(), 0.3), r)),
        ("coated metal", |r| coated(metal(rough(white(), r)), 0.2)),
        ("fuzz", |r| fuzzy(rough(white(), 0.5), r)),
        ("film", |r| filmed(rough(white(), r), 0.35)),
        ("film on metal", |r| filmed(metal(rough(white(), r)), 0.35)),
        ("brushed", |r| brushed(metal(rough(white(), r)), 0.9)),
        ("brushed plastic", |r| brushed(rough(white(), r), 0.6)),
        ("flat", |r| flat(rough(white(), r))),
        ("leaf", |r| rough(leaf(), r)),
        ("sheer leaf", |r| rough(sheer_leaf(), r)),
        ("schlick", |r| schlick(rough(white(), r))),
        ("film on schlick", |r| filmed(schlick(rough(white(), r)), 0.35)),
        ("all", |r| fuzzy(coated(filmed(flat(rough(white(), r)), 0.5), r), r)),
    ];
    for (name, make) in make {
        for roughness in [0.0, 0.3, 1.0] {
            for degrees in ANGLES {
                let albedo = albedo(&bsdf(make(roughness)), degrees);
                assert!(albedo.is_at_most(1.0 + TABLES), "{name}, roughness {roughness}, {degrees}°: {albedo:?}");
            }
        }
    }
}

/// White plastic, a white metal, a white coat over both and clear bodies return all light.
#[test]
fn what_absorbs_nothing_loses_nothing() {
    for roughness in [0.0, 0.1, 0.4, 1.0] {
        for degrees in ANGLES {
            for (name, surface) in [
                ("plastic", rough(white(), roughness)),
                ("flat plastic", flat(rough(white(), roughness))),
                ("metal", metal(rough(white(), roughness))),
                ("coat", coated(rough(white(), 0.3), roughness)),
                ("coated metal", coated(metal(rough(white(), roughness)), 0.4)),
                ("fuzz", fuzzy(rough(white(), roughness), 0.4)),
                ("leaf", rough(leaf(), roughness)),
                ("sheer leaf", rough(sheer_leaf(), roughness)),
                ("schlick", schlick(rough(white(), roughness))),
                ("film", filmed(rough(white(), roughness), 0.35)),
                ("brushed", brushed(metal(rough(white(), roughness)), 0.8)),
            ] {
                let albedo = albedo(&bsdf(surface), degrees);
                assert!(albedo.is_one_within(5e-3), "{name}, roughness {roughness}, {degrees}°: {albedo:?}");
            }
            let glass = rough(clear(), roughness);
            for (bsdf, ratio) in [(bsdf(glass), 1.0 / 1.5), (from_inside(glass), 1.5), (bsdf(thin(glass)), 1.0)] {
                let albedo = unsqueezed_albedo(&bsdf, ratio, degrees);
                assert!(albedo.is_one_within(5e-3), "glass {ratio}, roughness {roughness}, {degrees}°: {albedo:?}");
            }
        }
    }
}

/// A smooth surface's lobes are those of the formulas: F of the coat, 1 − F darkened below it, and (1 − F) / (1 + F)
/// through a pane.
#[test]
fn smooth_layers_have_their_factors() {
    let fresnel = |ior: f64| ((ior - 1.0) / (ior + 1.0)) * ((ior - 1.0) / (ior + 1.0));
    let factor = |surface: StandardSurface, wanted: Lobe| {
        let bsdf = bsdf(surface);
        let mut shares: Vec<(f64, f64)> = Vec::new();
        for i in 0..4000 {
            let s = bsdf.sample(DVec3::Z, (f64::from(i) + 0.5) / 4000.0, [0.5; 2]).unwrap();
            if s.lobe == wanted && !shares.iter().any(|(f, _)| *f == f64::from(s.f.g)) {
                shares.push((f64::from(s.f.g), s.pdf));
            }
        }
        shares.iter().map(|(f, _)| f).sum::<f64>()
    };
    let pane = thin(rough(clear(), 0.0));
    let f = fresnel(1.5);
    assert!((factor(pane, Lobe::Refraction) - (1.0 - f) / (1.0 + f)).abs() < 1e-6);
    assert!((factor(pane, Lobe::Mirror) - 2.0 * f / (1.0 + f)).abs() < 1e-6);
    // The base under the coat is reached by 1 − F and darkened by (1 − K) / (1 − E K) with K = F for a smooth metal.
    let gray = StandardBase { color: Rgb::gray(0.5), metalness: 1.0, ..StandardBase::default() };
    let lacquered = coated(rough(StandardSurface { base: gray, ..StandardSurface::default() }, 0.0), 0.0);
    let c = fresnel(1.6);
    let expected = c + (1.0 - c) * 0.5 * (1.0 - c) / (1.0 - 0.5 * c);
    assert!(
        (factor(lacquered, Lobe::Mirror) - expected).abs() < 1e-5,
        "{} {expected}",
        factor(lacquered, Lobe::Mirror)
    );
}

/// A metal has its colour at right angles, and its tint at 82°. What rough facets lose comes back with the colour, as
/// 1 + F₀ (1 − E) / E, where E is 1 − ln 2 at right angles for α = 1.
#[test]
fn metals_have_their_colours() {
    let gray = |roughness: f32| {
        let base = StandardBase { color: Rgb::gray(0.5), metalness: 1.0, ..StandardBase::default() };
        let specular = StandardSpecular { roughness, color: Rgb::gray(0.25), ..StandardSpecular::default() };
        bsdf(StandardSurface { base, specular, ..StandardSurface::default() })
    };
    let rim = gray(0.0).sample(DVec3::new((48.0f64 / 49.0).sqrt(), 0.0, 1.0 / 7.0), 0.5, [0.5; 2]).unwrap();
    let schlick = 0.5 + 0.5 * libm::powf(6.0 / 7.0, 5.0);
    assert!(rim.is_delta && (rim.f.g - 0.25 * schlick).abs() < 1e-5, "{rim:?}");
    let [ours, white] = [gray(1.0), bsdf(metal(rough(white(), 1.0)))].map(|bsdf| bsdf.eval(DVec3::Z, DVec3::Z).g);
    let kept = 1.0 - std::f32::consts::LN_2;
    let expected = 0.5 * (kept + 0.5 * (1.0 - kept));
    assert!((ours / white - expected).abs() < 2e-3, "{ours} of {white}, not {expected}");
}

/// Brushed facets lean along the tangent by αx and across it by αy, with αx² + αy² = 2 r⁴ and αy = (1 − anisotropy) αx.
#[test]
fn brushed_facets_lean_along_the_tangent() {
    let tangent = DVec3::new(0.0, 2.0, 0.0);
    let frame = ScatteringFrame { tangent, ..ScatteringFrame::flat(DVec3::Z, 1.0) };
    let bsdf = bsdf_in(brushed(metal(rough(white(), 0.7)), 0.6), frame);
    let along = 0.49 * (2.0f64 / 1.16).sqrt();
    let f = |slope: DVec3, alpha: f64| {
        let wi = (DVec3::Z + slope).normalize();
        // D (11 of Walter et al. 2007, with one width along each axis) times G₂ of Smith, but for what both share.
        let (m, tan2) = ((DVec3::Z + wi).normalize(), slope.length_squared());
        let lean = (1.0 - m.z * m.z) / (alpha * alpha) + m.z * m.z;
        let ours = f64::from(bsdf.eval(DVec3::Z, wi).g);
        ours * lean * lean * (1.0 + 0.5 * ((1.0 + alpha * alpha * tan2).sqrt() - 1.0))
    };
    let [a, b] = [f(DVec3::Y, along), f(DVec3::X, 0.4 * along)];
    assert!((a / b - 1.0).abs() < 1e-4, "{a}, {b}");
}

/// A coat has its colour after two passages at right angles, and more of it along longer ways. Below it, light goes
/// back and forth: 1 − K of it leaves at a time, where K is the mean of Fresnel's share from inside, .5963 for η = 1.5.
#[test]
fn coats_colour_and_darken() {
    let base =
        |color: f32, metalness: f32| StandardBase { color: Rgb::gray(color), metalness, ..StandardBase::default() };
    let coat = StandardCoat { weight: 1.0, ior: 1.5, ..StandardCoat::default() };
    let mirror = |color: f32, degrees: f64| {
        let coat = StandardCoat { color: Rgb::gray(color), ..coat };
        let bsdf = bsdf(StandardSurface { base: base(1.0, 1.0), coat, ..rough(white(), 0.0) });
        let samples =
            (0..1000).map(|i| bsdf.sample(direction(degrees), (f64::from(i) + 0.5) / 1000.0, [0.5; 2]).unwrap());
        // Of the two mirrors, the metal is the brighter one.
        samples.map(|s| s.f.g).fold(0.0, f32::max)
    };
    for (degrees, inside) in [(0.0, 1.0), (60.0, (2.0f32 / 3.0).sqrt())] {
        let ours = mirror(0.4, degrees) / mirror(1.0, degrees);
        assert!((ours - libm::powf(0.4, 1.0 / inside)).abs() < 1e-5, "{degrees}°: {ours}");
    }
    let diffuse = |darkening: f32| {
        let coat = StandardCoat { darkening, ..coat };
        let surface = StandardSurface { base: base(0.5, 0.0), coat, ..rough(white(), 1.0) };
        f64::from(bsdf(surface).eval(direction(20.0), direction(50.0)).g)
    };
    let (ours, expected) = (diffuse(1.0) / diffuse(0.0), (1.0 - 0.5963) / (1.0 - 0.5 * 0.5963));
    assert!((ours - expected).abs() < 2e-3, "{ours}, {expected}");
}

/// A clear body has its colour after its depth.
#[test]
fn absorption_gives_the_colour_after_the_depth() {
    let mut surface = clear();
    (surface.transmission.color, surface.transmission.depth) = (Rgb::new(0.9, 0.5, 0.1), 2.5);
    let medium = Material::new_standard("test", surface).medium;
    let off = (medium.transmittance(2.5) - surface.transmission.color).to_array();
    assert!(off.into_iter().all(|off| off.abs() < 1e-6), "{off:?}");
}

/// Fresnel's equations give the reflection of a thin film for each wavelength (Airy). Its means over the eye's response
/// are near those of the closed form.
#[test]
fn films_have_the_colours_of_airys_formula() {
    // The colour-matching functions (Wyman, Sloan & Shirley, *Simple Analytic Approximations to the CIE XYZ Color
    // Matching Functions*, 2013).
    let lobe = |x: f64, mean: f64, left: f64, right: f64| {
        let t = (x - mean) * if x < mean { left } else { right };
        libm::exp(-0.5 * t * t)
    };
    let cmf = |w: f64| {
        [
            1.056 * lobe(w, 599.8, 0.026_4, 0.032_3) + 0.362 * lobe(w, 442.0, 0.062_4, 0.037_4)
                - 0.065 * lobe(w, 501.1, 0.049_0, 0.038_2),
            0.821 * lobe(w, 568.8, 0.021_3, 0.024_7) + 0.286 * lobe(w, 530.9, 0.061_3, 0.032_2),
            1.217 * lobe(w, 437.0, 0.084_5, 0.027_8) + 0.681 * lobe(w, 459.0, 0.038_5, 0.072_5),
        ]
    };
    let to_rgb = [[3.2405, -1.5371, -0.4985], [-0.9693, 1.8760, 0.0416], [0.0556, -0.2040, 1.0572]];
    let rgb = |xyz: [f64; 3]| to_rgb.map(|row| row.iter().zip(xyz).map(|(m, v)| m * v).sum::<f64>());
    for (film, under) in [(1.4, 1.9), (1.6, 1.0)] {
        for thickness in [0.15, 0.3, 0.45, 0.7] {
            for cos in [1.0, 0.7, 0.4] {
                let (mut sum, mut norm) = ([0.0; 3], [0.0; 3]);
                for i in 0..400 {
                    let w = 380.0 + f64::from(i);
                    let bend = |cos: f64, ratio: f64| (1.0 - ratio * ratio * (1.0 - cos * cos)).sqrt();
                    let inside = bend(cos, 1.0 / film);
                    let below = bend(inside, film / under);
                    let delta = 4.0 * std::f64::consts::PI * film * thickness * 1e3 * inside / w;
                    let share = |r12: f64, r23: f64| {
                        let c = libm::cos(delta);
                        (r12 * r12 + r23 * r23 + 2.0 * r12 * r23 * c)
                            / (1.0 + r12 * r12 * r23 * r23 + 2.0 * r12 * r23 * c)
                    };
                    let s = |a: f64, ca: f64, b: f64, cb: f64| (a * ca - b * cb) / (a * ca + b * cb);
                    let p = |a: f64, ca: f64, b: f64, cb: f64| (b * ca - a * cb) / (b * ca + a * cb);
                    let r = 0.5 * share(s(1.0, cos, film, inside), s(film, inside, under, below))
                        + 0.5 * share(p(1.0, cos, film, inside), p(film, inside, under, below));
                    for (c, v) in cmf(w).into_iter().enumerate() {
                        sum[c] += r * v;
                        norm[c] += v;
                    }
                }
                let [exact, white] = [rgb([0, 1, 2].map(|c| sum[c] / norm[c])), rgb([1.0; 3])];
                let ours = thin_film::reflectance(cos, film, thickness, |_| thin_film::UnderFilm::Dielectric(under));
                for (c, ours) in ours.to_array().into_iter().enumerate() {
                    let exact = (exact[c] / white[c]).clamp(0.0, 1.0);
                    assert!((f64::from(ours) - exact).abs() < 0.021, "{film}, {thickness}, {cos}: {ours}, {exact}");
                }
            }
        }
    }
}

/// Cauchy's formula has the Abbe number that it was made from.
#[test]
fn dispersion_has_its_abbe_number() {
    let mut surface = clear();
    (surface.transmission.dispersion_scale, surface.transmission.dispersion_abbe_number) = (0.5, 20.0);
    assert!(surface.is_dispersive());
    let [r, g, b] = surface.dispersed_ior().map(f64::from);
    assert!(r < g && g < b && (surface.ior() - 1.5).abs() < 1e-6, "{r} {g} {b}");
    // n = A + B/λ² through red and blue, at the lines F, d and C.
    let square = |wavelength: f64| 1.0 / (wavelength * wavelength);
    let slope = (b - r) / (square(WAVELENGTHS[2]) - square(WAVELENGTHS[0]));
    let n = |wavelength: f64| r + slope * (square(wavelength) - square(WAVELENGTHS[0]));
    let [f, d, c] = FRAUNHOFER.map(n);
    assert!(((d - 1.0) / (f - c) - 40.0).abs() < 0.1 && (d - 1.5).abs() < 1e-4, "{f} {d} {c}");
    surface.thin_walled = true;
    assert!(!surface.is_dispersive());
}

#[test]
fn presets_are_possible_surfaces() {
    for preset in &PRESETS {
        preset.surface().check().unwrap();
        assert!(METALS.len() < PRESETS.len() && preset.name.is_ascii());
    }
    let names: Vec<&str> = PRESETS.iter().map(|preset| preset.name).collect();
    assert!(names.is_sorted() && names.contains(&"velvet") && names.contains(&"soapbubble"));
    let glass = PRESETS.iter().find(|preset| preset.name == "glass").unwrap().surface();
    assert_eq!((glass.transmission.weight, glass.specular.roughness), (1.0, 0.0));
}

/// What other integrators take: a white plastic is matte, a metal mirrors, glass is clear.
#[test]
fn other_integrators_take_the_nearest_meaning() {
    let phong = |surface: StandardSurface| surface.classic();
    let plastic = phong(rough(white(), 0.5));
    assert!(plastic.kd.g > 0.9 && plastic.k.is_black() && plastic.opacity == 1.0 && plastic.ks.g > 0.0);
    let gold = phong(metal(rough(white(), 0.2)));
    assert!(gold.kd.is_black() && gold.k.g == 1.0 && gold.roughness == 0.2);
    let glass = phong(rough(clear(), 0.0));
    assert!((glass.opacity - 0.04).abs() < 1e-6 && (glass.k.g - 0.04).abs() < 1e-6 && (glass.eta - 1.5).abs() < 1e-5);
}

/// A smooth dielectric by Schlick's curve mirrors F0 + (F90 − F0) (1 − cos)⁵ with F0 = color × F0(ior) × weight and
/// F90 = weight (KHR_materials_specular). The weight and the colour don't touch metals.
#[test]
fn schlicks_curve_has_its_ends() {
    let specular = StandardSpecular {
        weight: 0.6,
        color: Rgb::new(1.0, 0.5, 0.25),
        roughness: 0.0,
        ..StandardSpecular::default()
    };
    let black = StandardBase { color: Rgb::BLACK, ..StandardBase::default() };
    let surface = StandardSurface { base: black, specular, schlick: true, ..StandardSurface::default() };
    for degrees in [0.0f64, 40.0, 70.0, 85.0] {
        let wo = direction(degrees);
        let sample = bsdf(surface).sample(wo, 0.5, [0.5; 2]).unwrap();
        let x = 1.0 - degrees.to_radians().cos();
        let curve = |tint: f64| {
            let f0 = 0.04 * tint * 0.6;
            f0 + (0.6 - f0) * x * x * x * x * x
        };
        let found = sample.f.to_array().map(|f| f64::from(f) / sample.pdf);
        for (found, tint) in found.into_iter().zip([1.0, 0.5, 0.25]) {
            assert!((found - curve(tint)).abs() < 1e-5, "{degrees}°: {found} {}", curve(tint));
        }
    }
    let gold = StandardBase { color: Rgb::new(1.0, 0.8, 0.3), metalness: 1.0, ..StandardBase::default() };
    let sample = bsdf(StandardSurface { base: gold, ..surface }).sample(DVec3::Z, 0.5, [0.5; 2]).unwrap();
    assert!((sample.f * (1.0 / sample.pdf) as f32 - gold.color).max_component().abs() < 1e-5, "{:?}", sample.f);
}

/// A thin wall sends the share (1 + g) / 2 of its translucent light through (OpenPBR's scatter anisotropy).
#[test]
fn scatter_anisotropy_splits_translucent_light() {
    let specular = StandardSpecular { weight: 0.0, ..StandardSpecular::default() };
    for g in [-1.0f32, -0.5, 0.0, 0.8, 1.0] {
        let subsurface = StandardSubsurface { weight: 1.0, color: Rgb::gray(0.5), scatter_anisotropy: g };
        let surface = StandardSurface { subsurface, specular, ..thin(StandardSurface::default()) };
        let at = |z: f64| f64::from(bsdf(surface).eval(DVec3::Z, DVec3::new(0.0, 0.0, z)).g) * std::f64::consts::PI;
        let [back, through] = [at(1.0), at(-1.0)];
        let expected = [-1.0, 1.0].map(|side| 0.25 * (1.0 + side * f64::from(g)));
        assert!((back - expected[0]).abs() < 1e-6 && (through - expected[1]).abs() < 1e-6, "{g}: {back} {through}");
    }
}

/// A base alone is what the lobes of all layers are if nothing lies over it. Fuzz of a vanishing weight has the latter.
#[test]
fn an_opaque_base_is_the_surface_without_layers() {
    let hidden =
        |surface| StandardSurface { fuzz: StandardFuzz { weight: 1e-30, ..StandardFuzz::default() }, ..surface };
    let gold = StandardBase { color: Rgb::new(0.9, 0.6, 0.2), metalness: 1.0, ..StandardBase::default() };
    let mixed = StandardBase { metalness: 0.4, weight: 0.8, ..gold };
    let tinted = StandardSpecular { weight: 0.6, color: Rgb::new(0.9, 0.5, 0.7), ior: 1.8, ..Default::default() };
    let dense = StandardSpecular { ior: 0.7, ..Default::default() };
    let milky = StandardSubsurface { weight: 0.3, color: Rgb::new(0.1, 0.9, 0.4), ..Default::default() };
    let plain = StandardSurface::default();
    let surfaces = [
        plain,
        StandardSurface { base: gold, specular: tinted, ..plain },
        StandardSurface { base: mixed, specular: tinted, ..plain },
        StandardSurface { specular: dense, subsurface: milky, ..plain },
        schlick(plain),
        schlick(StandardSurface { base: mixed, specular: tinted, ..plain }),
    ];
    let bent = DVec3::new(0.5, -0.3, 0.8).normalize();
    let (mut random, mut lit) = (Random(7), 0);
    for surface in surfaces {
        for (roughness, normal) in [(0.15, DVec3::Z), (0.6, bent), (1.0, DVec3::Z)] {
            let frame = ScatteringFrame { normal, ..ScatteringFrame::flat(DVec3::Z, 1.0) };
            let [alone, layered] =
                [rough(surface, roughness), hidden(rough(surface, roughness))].map(|surface| bsdf_in(surface, frame));
            for _ in 0..200 {
                let wo = random.cube().as_dvec3().normalize();
                let wo = DVec3 { z: wo.z.abs().max(1e-3), ..wo }.normalize();
                let wi = random.cube().as_dvec3().normalize();
                let close = |a: f64, b: f64| (a - b).abs() <= 2e-6 * b.abs().max(1e-6);
                let near = |a: Rgb, b: Rgb| {
                    let pairs = a.to_array().into_iter().zip(b.to_array());
                    pairs.into_iter().all(|(a, b)| close(a.into(), b.into()))
                };
                let (a, b) = (alone.eval(wo, wi), layered.eval(wo, wi));
                assert!(near(a, b), "{surface:?}, {roughness}, {wo}, {wi}: {a:?}, {b:?}");
                let (pdf_a, pdf_b) = (alone.pdf(wo, wi), layered.pdf(wo, wi));
                assert!(close(pdf_a, pdf_b), "{surface:?}, {roughness}, {wo}, {wi}: {pdf_a}, {pdf_b}");
                lit += u32::from(!a.is_black());
                let [u_lobe, u, v] = [(); 3].map(|()| f64::from(random.unit()));
                let [a, b] = [&alone, &layered].map(|bsdf| bsdf.sample(wo, u_lobe, [u, v]));
                assert_eq!(a.is_some(), b.is_some(), "{surface:?}, {roughness}, {wo}");
                if let (Some(a), Some(b)) = (a, b) {
                    assert!(a.wi.distance(b.wi) < 1e-9 && near(a.f, b.f) && close(a.pdf, b.pdf), "{a:?}, {b:?}");
                    assert_eq!(a.lobe, b.lobe);
                }
            }
        }
    }
    assert!(lit > 1000, "{lit}");
}
