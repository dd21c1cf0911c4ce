//! A plain tracer of box 5.8 that can make each [`Mistake`]. It supports one body at a time, no lenses and no
//! roughness. It is apart from the classic integrator, which thus pays nothing for the mistakes.

use super::fit::FITTED;
use super::mistake::{Mistake, form};
use crate::camera::Camera;
use crate::light::{Illumination, PreparedLight};
use crate::material::{MaterialPoint, reflect, refract};
use crate::math::{DRay, Rgb, offset_origin};
use crate::scene::Stage;
use crate::shape::Surface;
use crate::world::{Hit, OccluderCache, World};
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};
use std::cell::Cell;

/// What a tracer computes: how much of the equation, with which mistake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TracerSettings {
    pub(super) stage: Stage,
    pub(super) max_depth: u32,
    pub(super) min_weight: f64,
    pub(super) shadows: bool,
    /// The mistake with its amount.
    pub(super) mistake: Option<(Mistake, f64)>,
}

impl TracerSettings {
    fn has(&self, mistake: Mistake) -> bool {
        self.amount(mistake).is_some()
    }

    /// The amount of a mistake, if the tracer makes it.
    pub(super) fn amount(&self, mistake: Mistake) -> Option<f64> {
        self.mistake.filter(|(own, amount)| *own == mistake && *amount != FITTED).map(|(_, amount)| amount)
    }
}

/// A tracer on one world.
pub(super) struct Tracer<'w> {
    pub(super) world: &'w World,
    pub(super) camera: &'w Camera,
    /// The radii of spheres by the numbers of their objects; 1 for all else.
    pub(super) radii: &'w [f64],
    pub(super) settings: TracerSettings,
    /// Whether every light is taken for blocked.
    pub(super) all_blocked: bool,
    /// A number of what the rays of a pixel meet, if it is wanted: the objects with their flat sides, and the shares of
    /// lights. Colours are smooth among pixels with one number.
    pub(super) met: Option<&'w Cell<u64>>,
}

/// The most hits of one line among which [`Mistake::NotNearest`] chooses.
const MOST_HITS: usize = 256;

/// The most surfaces of partial coverage that a ray passes.
const MOST_PASSED: u32 = 64;

/// A ray of the tree.
#[derive(Clone, Copy)]
struct TracedRay {
    line: DRay,
    ray: Ray,
    depth: u32,
    passed: u32,
    /// The product of all factors from the eye.
    weight: f64,
}

/// A hit with its vectors.
struct Place {
    surface: Surface,
    outside: bool,
    /// v, towards the viewer.
    wo: DVec3,
    /// n as the tracer takes it, with unit length.
    n: DVec3,
    /// The length of n as the tracer takes it.
    length: f64,
    /// The geometric normal on the viewer's side.
    facing: DVec3,
    /// r of (5.37).
    r: DVec3,
}

impl Tracer<'_> {
    /// The colour at a place of the picture in pixels, y upwards.
    pub(super) fn pixel(&self, x: f64, y: f64) -> DVec3 {
        let line = self.camera_line(x, y);
        self.trace(TracedRay { line, ray: line.rounded(), depth: 1, passed: 0, weight: 1.0 })
    }

    fn meets(&self, what: u64) {
        if let Some(met) = self.met {
            met.set((met.get() ^ what).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(23));
        }
    }

    fn camera_line(&self, x: f64, y: f64) -> DRay {
        let (camera, settings) = (self.camera, &self.settings);
        let [w, h] = camera.size().map(f64::from);
        let x = if settings.has(Mistake::Mirrored) { w - x } else { x };
        let (origin, d) = camera.chapter_ray(x, y);
        let [x_e, y_e, z_e] = camera.axes();
        if camera.is_orthographic() {
            let base = (origin - camera.eye()).dot(x_e);
            let across = x_e * (self.in_square_window(base) - base);
            return DRay { origin: origin + across, direction: d.normalize() };
        }
        let (mut base, mut height) = (d.dot(x_e), d.dot(y_e));
        let (near, window) = (camera.focal_distance(), camera.window());
        let half = libm::atan(window.y / (2.0 * near));
        if let Some(amount) = settings.amount(Mistake::WholeAngle) {
            let tangent = match amount {
                form::HALF_OF_HALF => libm::tan(half / 2.0),
                form::DEGREES => libm::tan(half.to_degrees()),
                _ => libm::tan(2.0 * half),
            };
            let factor = tangent / libm::tan(half);
            (base, height) = (base * factor, height * factor);
        }
        if settings.has(Mistake::HorizontalAngle) {
            (base, height) = (base * h / w, height * h / w);
        }
        base = self.in_square_window(base);
        DRay { origin, direction: (z_e * d.dot(z_e) + y_e * height + x_e * base).normalize() }
    }

    /// The place along the window's width, after a mistake about its aspect.
    fn in_square_window(&self, base: f64) -> f64 {
        let [w, h] = self.camera.size().map(f64::from);
        match self.settings.amount(Mistake::SquareWindow) {
            Some(form::INVERTED_ASPECT) => base * ((h / w) * (h / w)),
            Some(_) => base * (h / w),
            None => base,
        }
    }

    fn trace(&self, ray: TracedRay) -> DVec3 {
        let Some((line, hit)) = self.visible(&ray) else { return self.background(ray.line.direction) };
        let material = self.world.material(&hit);
        let mut surface = self.world.surface(line, &hit);
        let material = if material.is_plain() || self.settings.has(Mistake::NoTextures) {
            material.at(&surface)
        } else {
            self.world.textured(line, &hit, &mut surface, Some([DVec3::ZERO; 2]), &mut ())
        };
        let place = self.place(line.direction, surface, &hit);
        self.meets(u64::from(self.world.object_id(&hit)));
        if self.met.is_some() && self.world.object(&hit).kind != "sphere" {
            let side = (place.surface.shading_normal * 8.0).round();
            self.meets((side.x * 289.0 + side.y * 17.0 + side.z + 4096.0) as u64);
        }
        let mut color = self.shade(&ray, &place, &material);
        let (overlay, share) = material.overlay;
        let share = f64::from(share);
        color = rgb(overlay) * share + color * (1.0 - share);
        let coverage = f64::from(material.coverage);
        if coverage < 1.0 {
            color *= coverage;
            if ray.passed < MOST_PASSED {
                let on = self.child(&ray, &place, -place.wo, 1.0 - coverage);
                color += self.trace(TracedRay { depth: ray.depth, passed: ray.passed + 1, ..on }) * (1.0 - coverage);
            }
        }
        color
    }

    /// The hit that the tracer takes for the visible one, with the line from which it is seen.
    fn visible(&self, ray: &TracedRay) -> Option<(DRay, Hit)> {
        let nearest = (ray.line, self.world.intersect(&ray.ray, f32::INFINITY)?);
        let Some(amount) = self.settings.amount(Mistake::NotNearest) else { return Some(nearest) };
        let number = |(_, hit): &(DRay, Hit)| self.world.object_id(hit);
        if amount == form::FAR_ROOT || amount == form::FAR_ROOT_OF_SPHERES {
            return self.far_root(nearest, amount == form::FAR_ROOT_OF_SPHERES);
        }
        let (mut best, mut last) = (nearest, nearest);
        for _ in 0..MOST_HITS {
            let Some(next) = self.next_hit(&last, ray.line.direction) else { break };
            last = next;
            if amount == form::FARTHEST_HIT || number(&last) > number(&best) {
                best = last;
            }
        }
        Some(best)
    }

    /// The nearest among the last hits of each object along the line; of objects that aren't spheres their first ones,
    /// if only spheres have the mistake.
    fn far_root(&self, first: (DRay, Hit), spheres_only: bool) -> Option<(DRay, Hit)> {
        let mut found: Vec<(u32, (DRay, Hit))> = Vec::new();
        let mut last = first;
        for _ in 0..MOST_HITS {
            let object = self.world.object_id(&last.1);
            match found.iter_mut().find(|(own, _)| *own == object) {
                Some(_) if spheres_only && self.world.object(&last.1).kind != "sphere" => {}
                Some((_, hit)) => *hit = last,
                None => found.push((object, last)),
            }
            match self.next_hit(&last, first.0.direction) {
                Some(next) => last = next,
                None => break,
            }
        }
        let distance = |(line, hit): &(DRay, Hit)| (self.world.surface(*line, hit).exact - first.0.origin).length();
        found.into_iter().map(|(_, hit)| hit).min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// The hit behind a hit.
    fn next_hit(&self, (line, hit): &(DRay, Hit), direction: DVec3) -> Option<(DRay, Hit)> {
        let surface = self.world.surface(*line, hit);
        let line = DRay { origin: surface.exact, direction };
        let origin = offset_origin(surface.point, surface.error, surface.normal, line.direction);
        Some((line, self.world.intersect(&line.from_origin(origin), f32::INFINITY)?))
    }

    fn background(&self, direction: DVec3) -> DVec3 {
        if self.settings.has(Mistake::BlackBackground) {
            return DVec3::ZERO;
        }
        match &self.world.environment {
            Some(environment) => rgb(environment.lookup(direction, [DVec3::ZERO; 2]).radiance),
            None => rgb(self.world.background),
        }
    }

    fn place(&self, direction: DVec3, surface: Surface, hit: &Hit) -> Place {
        let outside = direction.dot(surface.normal) < 0.0;
        let side = if outside { 1.0 } else { -1.0 };
        let kept = if self.settings.has(Mistake::NormalNotFlipped) { 1.0 } else { side };
        let (wo, n) = (-direction.normalize(), surface.shading_normal * kept);
        let mut length = 1.0;
        if self.settings.has(Mistake::NormalNotNormalised) {
            length = self.radii.get(self.world.object_id(hit) as usize).copied().unwrap_or(1.0);
        }
        Place { outside, wo, n, length, facing: surface.normal * side, r: reflect(wo, n), surface }
    }

    /// (5.39b).
    fn shade(&self, ray: &TracedRay, place: &Place, material: &MaterialPoint) -> DVec3 {
        let (settings, phong) = (&self.settings, &material.classic);
        let stage = settings.stage;
        if stage == Stage::Unlit {
            return rgb(phong.kd);
        }
        let mut ambient = DVec3::ZERO;
        if stage >= Stage::Ambient && !settings.has(Mistake::NoAmbient) {
            ambient = rgb(self.world.ambient);
            if !settings.has(Mistake::AmbientWithoutKd) {
                ambient *= rgb(phong.kd);
            }
            if settings.has(Mistake::AmbientPerLight) {
                ambient *= self.world.lights.len() as f64;
            }
        }
        let (mut lit, mut shares, mut points) = (rgb(material.emitted(place.outside)), 0.0, 0u32);
        let count = self.world.lights.len();
        let lights = match settings.amount(Mistake::FirstLightOnly) {
            Some(form::LAST_LIGHT) => count.saturating_sub(1)..count,
            Some(_) => 0..count.min(1),
            None => 0..count,
        };
        for light in &self.world.lights[lights] {
            for point in 0..light.points() {
                let (term, f_s) = self.light(place, material, light, point);
                lit += term;
                shares += f_s;
                points += 1;
            }
        }
        if settings.has(Mistake::ShadowedAmbient) && points > 0 {
            ambient *= shares / f64::from(points);
        }
        let mut color = ambient + lit;
        let deepest = match settings.mistake {
            Some((Mistake::ShallowRecursion, form::ONE_LESS)) => settings.max_depth.saturating_sub(1),
            Some((Mistake::ShallowRecursion, depth)) => settings.max_depth.min(depth as u32),
            Some((Mistake::DeepRecursion, more)) => settings.max_depth.saturating_add(more as u32),
            _ => settings.max_depth,
        };
        let ends = ray.depth >= deepest;
        if stage >= Stage::Reflection && material.is_mirror() && !settings.has(Mistake::NoReflection) {
            let k = if settings.has(Mistake::ReflectionWithoutK) { DVec3::ONE } else { rgb(phong.k) };
            if settings.has(Mistake::BlendedReflection) {
                color *= DVec3::ONE - k;
            }
            if !ends && ray.weight * k.max_element() >= settings.min_weight {
                let direction = self.reflected_direction(place);
                color += k * self.trace(self.child(ray, place, direction, k.max_element()));
            }
        }
        if stage >= Stage::Full && material.is_clear() && !settings.has(Mistake::NoRefraction) {
            let opacity = f64::from(phong.opacity);
            let factor = match settings.mistake {
                Some((Mistake::RefractionWithoutFactor, _)) => 1.0,
                Some((Mistake::OpacityReversed, _)) => opacity,
                _ => 1.0 - opacity,
            };
            if settings.has(Mistake::BlendedRefraction) {
                color *= opacity;
            }
            if !ends && ray.weight * factor >= settings.min_weight {
                color += factor * self.refracted(ray, place, f64::from(phong.eta), factor);
            }
        }
        color
    }

    /// The direction of a reflected ray.
    fn reflected_direction(&self, place: &Place) -> DVec3 {
        let Place { wo, n, r, surface, .. } = *place;
        match self.settings.amount(Mistake::ReflectedVector) {
            Some(form::REFLECTS_INWARDS) => -r,
            Some(form::REFLECTS_LIGHT) => match self.world.lights.first() {
                Some(light) => reflect(light.illuminate_evenly(0, surface.exact).direction, n),
                None => r,
            },
            Some(_) => (n * (2.0 * wo.dot(n)) + wo).normalize_or(r),
            None => r,
        }
    }

    /// The colour along the refracted ray.
    fn refracted(&self, ray: &TracedRay, place: &Place, eta: f64, factor: f64) -> DVec3 {
        let settings = &self.settings;
        let mut ratio = if place.outside { 1.0 / eta } else { eta };
        if settings.has(Mistake::EtaInverted) {
            ratio = 1.0 / ratio;
        }
        if settings.has(Mistake::EtaNotSwapped) {
            ratio = 1.0 / eta;
        }
        if settings.has(Mistake::Unbent) {
            ratio = 1.0;
        }
        match refract(place.wo, place.n, ratio) {
            Some(direction) => self.trace(self.child(ray, place, direction, factor)),
            None if settings.has(Mistake::NoTotalReflection) => DVec3::ZERO,
            None => self.trace(self.child(ray, place, place.r, factor)),
        }
    }

    /// A ray that leaves the surface.
    fn child(&self, parent: &TracedRay, place: &Place, direction: DVec3, factor: f64) -> TracedRay {
        let Surface { point, error, normal, exact, .. } = place.surface;
        let line = DRay { origin: exact, direction };
        let ray = line.from_origin(offset_origin(point, error, normal, direction));
        TracedRay { line, ray, depth: parent.depth + 1, passed: parent.passed, weight: parent.weight * factor }
    }

    /// The contribution of one point of a light (5.39a), and its f_s.
    fn light(&self, place: &Place, material: &MaterialPoint, light: &PreparedLight, point: u32) -> (DVec3, f64) {
        let (settings, phong) = (&self.settings, &material.classic);
        let arriving = light.illuminate_evenly(point, place.surface.exact);
        let mut intensity = rgb(arriving.intensity);
        if settings.amount(Mistake::NoIntensity) == Some(form::EVERYWHERE) {
            let own = rgb(light.light.intensity);
            intensity /= DVec3::select(own.cmpgt(DVec3::ZERO), own, DVec3::ONE);
        }
        if settings.has(Mistake::NoAttenuation) {
            intensity = rgb(light.point_intensity());
        }
        if let Some(amount) = settings.amount(Mistake::Falloff)
            && let Some(other) = form::falloff(light.light.attenuation, amount)
            && arriving.distance.is_finite()
        {
            let d = f64::from(arriving.distance);
            let divisor = |[c, l, q]: [f64; 3]| (c + l * d + q * d * d).max(f64::MIN_POSITIVE);
            intensity *= divisor(light.light.attenuation.map(f64::from)) / divisor(other);
        }
        let towards = match settings.amount(Mistake::ConstantLightVector) {
            Some(_) if arriving.distance.is_finite() => light.illuminate_evenly(point, self.zero()).direction,
            _ => arriving.direction,
        };
        let distance = f64::from(arriving.distance);
        let mut diffuse_l = if settings.has(Mistake::LightReversed) { -towards } else { towards };
        let mut specular_l = diffuse_l;
        if let Some(amount) = settings.amount(Mistake::LightNotNormalised)
            && distance.is_finite()
        {
            diffuse_l *= distance;
            specular_l *= if amount == form::LONG_IN_BOTH_TERMS { distance } else { 1.0 };
        }
        let n = place.n * place.length;
        let cosine = n.dot(diffuse_l);
        let before = cosine > 0.0;
        let behind = before && material.normal_bent && place.facing.dot(towards) <= 0.0;
        let diffuse = match settings.mistake {
            Some((Mistake::NoDiffuse, _)) => 0.0,
            Some((Mistake::MissingMax, _)) => cosine,
            Some((Mistake::AbsoluteCosine, _)) => cosine.abs(),
            _ if behind => 0.0,
            Some((Mistake::AngleForCosine, form::HALF_OF_COSINE)) => (0.5 + 0.5 * cosine).max(0.0),
            Some((Mistake::AngleForCosine, form::FALLING_ANGLE)) => angle_share(cosine),
            Some((Mistake::AngleForCosine, form::SINE)) if before => libm::sqrt((1.0 - cosine * cosine).max(0.0)),
            Some((Mistake::AngleForCosine, form::COSINE_OF_COSINE)) => libm::cos(cosine.max(0.0)),
            Some((Mistake::AngleForCosine, _)) if before => libm::acos(cosine.clamp(-1.0, 1.0)),
            _ => cosine.max(0.0),
        };
        let mut specular = 0.0;
        if settings.stage >= Stage::Specular && !settings.has(Mistake::NoSpecular) {
            let guarded = before
                || settings.has(Mistake::SpecularUnguarded)
                || settings.amount(Mistake::SpecularMissingMax) == Some(form::UNBLOCKED_BEHIND);
            let mirrored = match settings.mistake {
                Some((Mistake::SpecularSign, form::SIGN_OF_R)) => -place.r,
                Some((Mistake::SpecularSign, _)) => place.n * (2.0 * place.wo.dot(place.n)) + place.wo,
                Some((Mistake::ConstantView, form::FROM_THE_ORIGIN)) => {
                    reflect((self.camera.eye() - self.zero()).normalize_or(place.wo), place.n)
                }
                Some((Mistake::ConstantView, form::ALONG_Z)) => reflect(DVec3::Z, place.n),
                Some((Mistake::ConstantView, _)) => reflect(self.camera.axes()[2], place.n),
                Some((Mistake::ViewNotNormalised, _)) => place.r * (self.camera.eye() - place.surface.exact).length(),
                Some((Mistake::ViewReversed, _)) => reflect(-place.wo, place.n),
                Some((Mistake::NormalNotNormalised, _)) => n * (2.0 * place.wo.dot(n)) - place.wo,
                _ => place.r,
            };
            let mut cosine = match settings.mistake {
                Some((Mistake::HalfVector, form::HALF_OF_SUM)) => (place.wo + specular_l).dot(place.n) / 2.0,
                Some((Mistake::HalfVector, form::WHOLE_SUM)) => (place.wo + specular_l).dot(place.n),
                Some((Mistake::HalfVector, _)) => (place.wo + specular_l).normalize_or_zero().dot(place.n),
                Some((Mistake::SpecularOfNormal, _)) => place.n.dot(specular_l),
                Some((Mistake::AngleForCosine, form::ANGLE_IN_BOTH)) => {
                    libm::acos(mirrored.dot(specular_l).clamp(-1.0, 1.0))
                }
                _ => mirrored.dot(specular_l),
            };
            let mut n = f64::from(phong.n);
            if let Some(factor) = settings.amount(Mistake::Exponent) {
                n = if factor == form::NO_EXPONENT { 1.0 } else { n * factor };
            }
            if !settings.has(Mistake::SpecularMissingMax) {
                cosine = cosine.max(0.0);
            }
            specular = if guarded && !behind { power(cosine, n) } else { 0.0 };
            if settings.has(Mistake::SpecularTimesCosine) {
                specular *= diffuse;
            }
        }
        let mut ks = rgb(phong.ks);
        if settings.has(Mistake::SpecularTimesKd) {
            ks *= rgb(phong.kd);
        }
        let mut highlight = ks * specular * intensity;
        if settings.amount(Mistake::NoIntensity) == Some(form::IN_HIGHLIGHTS) {
            highlight = ks * specular;
        }
        let term = rgb(phong.kd) * diffuse * intensity;
        let behind_counts = [Mistake::MissingMax, Mistake::AbsoluteCosine, Mistake::SpecularUnguarded];
        let unblocked = behind_counts.iter().any(|mistake| settings.amount(*mistake) == Some(form::UNBLOCKED_BEHIND));
        let f_s = if before || !unblocked { self.shadow(place, light, &arriving) } else { 1.0 };
        // Where the light is behind, its shadow doesn't show.
        self.meets(if before { (f_s * 64.0) as u64 } else { 0 });
        let f_s = if settings.has(Mistake::PaleShadows) { 0.5 + 0.5 * f_s } else { f_s };
        let of_highlight = if settings.has(Mistake::HighlightsInShadow) { 1.0 } else { f_s };
        (term * f_s + highlight * of_highlight, f_s)
    }

    /// The zero of the scene's coordinates in those of the world.
    fn zero(&self) -> DVec3 {
        -self.world.origin()
    }

    fn shadow(&self, place: &Place, light: &PreparedLight, arriving: &Illumination) -> f64 {
        let settings = &self.settings;
        let casts = settings.stage >= Stage::Shadow && settings.shadows && light.light.shadows;
        if !casts || settings.has(Mistake::NoShadows) {
            return 1.0;
        }
        if self.all_blocked {
            return 0.0;
        }
        let Surface { point, error, shadow_origin, .. } = place.surface;
        let from = if place.outside { shadow_origin } else { point };
        let start = offset_origin(from, error, place.facing, place.facing);
        let (to, mut t_max) = match arriving.position {
            Some(position) => (position - start, 1.0 - f32::EPSILON),
            None => (arriving.direction.as_vec3(), f32::INFINITY),
        };
        if settings.has(Mistake::ShadowBeyondLight) {
            t_max = f32::INFINITY;
        }
        let ray = Ray::new(start, to);
        let mut last = OccluderCache::NONE;
        let f_s = f64::from(self.world.transmittance(&ray, t_max, 0.0, None, &mut last, &mut ()));
        if settings.has(Mistake::OpaqueShadows) && f_s < 1.0 { 0.0 } else { f_s }
    }
}

/// 1 for light from straight above and 0 for light along the surface, in even steps of the angle.
fn angle_share(cosine: f64) -> f64 {
    (1.0 - libm::acos(cosine.clamp(-1.0, 1.0)) / std::f64::consts::FRAC_PI_2).max(0.0)
}

/// x to the power n, with the sign of whole odd exponents.
fn power(x: f64, n: f64) -> f64 {
    if x >= 0.0 {
        return libm::pow(x, n);
    }
    let sign = if (n.round() as i64) % 2 == 0 { 1.0 } else { -1.0 };
    sign * libm::pow(-x, n)
}

pub(super) fn rgb(c: Rgb) -> DVec3 {
    let Rgb { r, g, b } = c;
    Vec3::new(r, g, b).as_dvec3()
}
