//! The ray tracer of a student, with mistakes that can be planted. It is written after the chapter's boxes and shares
//! only the description of a scene with the library, so that the grader's own hypotheses are not its measure. It
//! supports spheres, boxes, planes, triangles, omni and directional lights.

use canaletto::integrator::describe;
use canaletto::light::LightKind;
use canaletto::material::Phong;
use canaletto::scene::{Content, Node, Sampling, Scene, Stage, Transfer};
use canaletto::shape::Shape;
use glam::DVec3;

/// A mistake in the student's program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Planted {
    UpsideDown,
    ColumnsReversed,
    OtherPlace,
    TangentOfFovy,
    SquareWindow,
    LastObjectWins,
    FarthestWins,
    ExtraGamma,
    BlueGreenRed,
    ByteOverflow,
    NoBackground,
    NoAmbient,
    AmbientWithoutKd,
    AmbientForEachLight,
    NoDiffuse,
    NoMax,
    AbsoluteValue,
    LongLightVector,
    LightVectorReversed,
    NoIntensity,
    OneLight,
    NoSpecular,
    ExponentDoubled,
    ExponentHalved,
    NoExponent,
    Blinn,
    MirrorSign,
    EvenPower,
    HighlightTimesKd,
    NoShadows,
    Acne,
    BeyondLight,
    GlassBlocks,
    ShadowTakesAll,
    NoReflection,
    NoK,
    ReflectsOn,
    ReflectsInwards,
    ReflectsLight,
    OneMinusK,
    DepthTwo,
    NoRefraction,
    EtaUpsideDown,
    EtaOneWay,
    StraightOn,
    NormalOutwards,
    TotalIsBlack,
    NoTransparency,
    OpacityAsTransparency,
    OpacityBlend,
    Transposed,
    ColumnByColumn,
    GreenRedBlue,
    QuarterAngle,
    DegreesAsRadians,
    InvertedAspect,
    FarRootOfSpheres,
    AngleAsCosine,
    SineAsCosine,
    NormalTooLong,
    ConstantView,
    ViewTooLong,
    HalfOfSum,
    HighlightTimesCosine,
    HighlightsWithoutIntensity,
    HighlightsInShadow,
    ConstantLightVector,
    LastLight,
    NoFalloff,
    FalloffOfSquare,
    DepthOneLess,
}

/// A reconstruction filter of rays that are splatted.
pub struct SplatFilter {
    /// Its name.
    pub name: &'static str,
    /// The radius along each axis in pixels.
    pub radius: f64,
    /// The factor for the offset along an axis, not normalised.
    pub value: fn(f64) -> f64,
}

impl SplatFilter {
    /// Filters of renderers, with the radii and the constants that they have there.
    pub const ALL: [SplatFilter; 6] = [
        SplatFilter { name: "box", radius: 0.5, value: |_| 1.0 },
        SplatFilter { name: "tent", radius: 1.0, value: |x| 1.0 - x.abs() },
        SplatFilter { name: "tent of 1.5", radius: 1.5, value: |x| 1.5 - x.abs() },
        // σ = 0.5 and 4 σ, less the value there (Mitsuba 3's gaussian).
        SplatFilter { name: "gaussian", radius: 2.0, value: |x| (-2.0 * x * x).exp() - (-8.0f64).exp() },
        SplatFilter { name: "mitchell", radius: 2.0, value: |x| mitchell(x.abs()) },
        // Mitsuba 3's Catmull-Rom spline.
        SplatFilter { name: "catmull-rom", radius: 2.0, value: |x| catmull_rom(x.abs()) },
    ];
}

/// B = C = 1/3 (Mitchell & Netravali, *Reconstruction Filters in Computer Graphics*, 1988).
fn mitchell(x: f64) -> f64 {
    if x < 1.0 {
        7.0 * x * x * x - 12.0 * x * x + 16.0 / 3.0
    } else {
        -7.0 / 3.0 * x * x * x + 12.0 * x * x - 20.0 * x + 32.0 / 3.0
    }
}

/// B = 0, C = 1/2.
fn catmull_rom(x: f64) -> f64 {
    if x < 1.0 { 1.5 * x * x * x - 2.5 * x * x + 1.0 } else { -0.5 * x * x * x + 2.5 * x * x - 4.0 * x + 2.0 }
}

/// The program for one scene.
pub struct StudentTracer<'a> {
    scene: &'a Scene,
    planted: Option<Planted>,
    stage: Stage,
    objects: Vec<(Shape, Phong)>,
    lights: Vec<Lamp>,
}

/// A light with its homogeneous position.
struct Lamp {
    position: DVec3,
    w: f64,
    intensity: DVec3,
    attenuation: [f64; 3],
}

impl Lamp {
    /// The vector from a point to the light, and what its light is divided by.
    fn from(&self, p: DVec3, falloff: [f64; 3]) -> (DVec3, f64) {
        if self.w == 0.0 {
            return (self.position.normalize(), 1.0);
        }
        let l = self.position - p;
        let d = l.length();
        (l, falloff[0] + falloff[1] * d + falloff[2] * d * d)
    }
}

struct Found {
    t: f64,
    p: DVec3,
    n: DVec3,
    radius: f64,
    material: Phong,
}

impl<'a> StudentTracer<'a> {
    /// The program with a mistake, finished up to a stage.
    pub fn new(scene: &'a Scene, stage: Stage, planted: Option<Planted>) -> StudentTracer<'a> {
        let mut tracer = StudentTracer { scene, planted, stage, objects: Vec::new(), lights: Vec::new() };
        scene.nodes.iter().for_each(|node| tracer.add(node));
        if tracer.does(Planted::OneLight) {
            tracer.lights.truncate(1);
        }
        if tracer.does(Planted::LastLight) {
            tracer.lights.drain(..tracer.lights.len() - 1);
        }
        tracer
    }

    fn add(&mut self, node: &Node) {
        match &node.content {
            Content::Shape(shape) => {
                let material = node.material.expect("objects have materials") as usize;
                self.objects.push((*shape, self.scene.materials[material].classic()));
            }
            Content::Light(light) => {
                let (position, w) = match &light.kind {
                    LightKind::Omni(omni) => {
                        let [x, y, z, w] = omni.position.map(f64::from);
                        (DVec3::new(x, y, z), w)
                    }
                    LightKind::Directional(sun) => (-sun.towards.as_dvec3(), 0.0),
                    other => panic!("the student doesn't know {other:?}"),
                };
                let attenuation = light.attenuation.map(f64::from);
                self.lights.push(Lamp { position, w, intensity: color(light.intensity), attenuation });
            }
            Content::Instance(index) => self.add(&self.scene.prototypes[*index as usize]),
            other => panic!("the student doesn't know {other:?}"),
        }
    }

    fn does(&self, planted: Planted) -> bool {
        self.planted == Some(planted)
    }

    /// The picture's bytes, the top row first. `rays` is the side of a grid of rays in each pixel; 1 is one ray at the
    /// scene's own place.
    pub fn picture(&self, [w, h]: [u32; 2], rays: u32) -> Vec<[u8; 3]> {
        let mut picture = Vec::new();
        for row in 0..h {
            for column in 0..w {
                let mut sum = DVec3::ZERO;
                for i in 0..rays * rays {
                    let corner = self.scene.film.sampling == Sampling::Corner;
                    let place = if corner != self.does(Planted::OtherPlace) { 0.0 } else { 0.5 };
                    let spread = |k: u32| if rays == 1 { place } else { (f64::from(k) + 0.5) / f64::from(rays) };
                    let (mut x, mut y) = (column, h - 1 - row);
                    match self.planted {
                        Some(Planted::UpsideDown) => y = row,
                        Some(Planted::ColumnsReversed) => x = w - 1 - column,
                        Some(Planted::Transposed) => (x, y) = (row, h - 1 - column),
                        Some(Planted::ColumnByColumn) => {
                            let number = row * w + column;
                            (x, y) = (number / h, h - 1 - number % h);
                        }
                        _ => {}
                    }
                    sum += self.ray([f64::from(x) + spread(i % rays), f64::from(y) + spread(i / rays)], [w, h]);
                }
                let mean = sum / f64::from(rays * rays);
                picture.push(self.stored(mean));
            }
        }
        picture
    }

    /// The picture's bytes by random rays that are splatted: each counts in all pixels within the filter's radius, by
    /// the filter's product of both offsets over the sum of all weights.
    pub fn splatted(&self, [w, h]: [u32; 2], filter: &SplatFilter, rays: u32, seed: u64) -> Vec<[u8; 3]> {
        let mut sums = vec![(DVec3::ZERO, 0.0); (w * h) as usize];
        let mut state = seed;
        let mut random = || {
            // Steele, Lea & Flood, Fast Splittable Pseudorandom Number Generators, 2014.
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
        };
        for i in 0..w * h * rays {
            let pixel = i / rays;
            let at = [f64::from(pixel % w) + random(), f64::from(pixel / w) + random()];
            let color = self.ray([at[0], f64::from(h) - at[1]], [w, h]);
            // The pixels whose centres are near.
            let near = |at: f64, side: u32| {
                let first = (at - 0.5 - filter.radius).ceil().max(0.0) as u32;
                first..((at - 0.5 + filter.radius).floor() as u32 + 1).min(side)
            };
            for y in near(at[1], h) {
                for x in near(at[0], w) {
                    let along = |at: f64, pixel: u32| (filter.value)(at - 0.5 - f64::from(pixel));
                    let weight = along(at[0], x) * along(at[1], y);
                    let (sum, weights) = &mut sums[(y * w + x) as usize];
                    (*sum, *weights) = (*sum + color * weight, *weights + weight);
                }
            }
        }
        sums.into_iter().map(|(sum, weights)| self.stored(sum / weights)).collect()
    }

    fn stored(&self, c: DVec3) -> [u8; 3] {
        let [r, g, b] = c.to_array().map(|v| {
            let v = if self.does(Planted::ByteOverflow) { v } else { v.clamp(0.0, 1.0) };
            let v = if self.scene.film.transfer == Transfer::Srgb { srgb(v) } else { v };
            let v = if self.does(Planted::ExtraGamma) { v.powf(1.0 / 2.2) } else { v };
            // Some programs round, some cut off; a byte keeps the lowest 8 bits.
            ((v * 255.0) as i64 & 255) as u8
        });
        match self.planted {
            Some(Planted::BlueGreenRed) => [b, g, r],
            Some(Planted::GreenRedBlue) => [g, r, b],
            _ => [r, g, b],
        }
    }

    fn ray(&self, [x, y]: [f64; 2], [w, h]: [u32; 2]) -> DVec3 {
        let (i, e) = (&self.scene.views[0].intrinsics, &self.scene.views[0].extrinsics);
        let (w, h) = (f64::from(w), f64::from(h));
        let angle = match self.planted {
            Some(Planted::TangentOfFovy) => i.fovy.to_radians(),
            Some(Planted::QuarterAngle) => i.fovy.to_radians() / 4.0,
            Some(Planted::DegreesAsRadians) => i.fovy / 2.0,
            _ => i.fovy.to_radians() / 2.0,
        };
        let near = i.near.unwrap_or(canaletto::scene::Intrinsics::DEFAULT_NEAR);
        let height = 2.0 * near * angle.tan();
        let base = match self.planted {
            Some(Planted::SquareWindow) => height,
            Some(Planted::InvertedAspect) => height * h / w,
            _ => height * w / h,
        };
        let z = (e.eye - e.center).normalize();
        let x_e = e.up.cross(z).normalize();
        let y_e = z.cross(x_e);
        let d = -near * z + height * (y / h - 0.5) * y_e + base * (x / w - 0.5) * x_e;
        self.trace(e.eye, d.normalize(), 1)
    }

    fn trace(&self, o: DVec3, d: DVec3, depth: u32) -> DVec3 {
        let Some(found) = self.nearest(o, d) else {
            return if self.does(Planted::NoBackground) { DVec3::ZERO } else { color(self.scene.background) };
        };
        self.shade(&found, d, depth)
    }

    fn shade(&self, found: &Found, d: DVec3, depth: u32) -> DVec3 {
        let (m, p, v) = (&found.material, found.p, -d);
        let entering = found.n.dot(v) > 0.0;
        let n = if entering || self.does(Planted::NormalOutwards) { found.n } else { -found.n };
        let kd = color(m.kd);
        if self.stage == Stage::Unlit {
            return kd;
        }
        let mut ambient = DVec3::ZERO;
        if self.stage >= Stage::Ambient && !self.does(Planted::NoAmbient) {
            let each = if self.does(Planted::AmbientForEachLight) { self.lights.len() as f64 } else { 1.0 };
            let ia = color(self.scene.ambient) * each;
            ambient = if self.does(Planted::AmbientWithoutKd) { ia } else { ia * kd };
        }
        let mut lit = DVec3::ZERO;
        let mirrored = 2.0 * n.dot(v) * n - v;
        let e = &self.scene.views[0].extrinsics;
        let long = if self.does(Planted::NormalTooLong) { n * found.radius } else { n };
        let mut r = match self.planted {
            Some(Planted::ConstantView) => {
                let view = (e.eye - e.center).normalize();
                2.0 * n.dot(view) * n - view
            }
            Some(Planted::ViewTooLong) => mirrored * (e.eye - p).length(),
            _ => 2.0 * long.dot(v) * long - v,
        };
        if self.does(Planted::MirrorSign) {
            r = v - 2.0 * n.dot(v) * n;
        }
        for lamp in &self.lights {
            let falloff = match self.planted {
                Some(Planted::NoFalloff) => [1.0, 0.0, 0.0],
                Some(Planted::FalloffOfSquare) => [0.0, 0.0, 1.0],
                _ => lamp.attenuation,
            };
            let (mut l, divisor) = lamp.from(p, falloff);
            if self.does(Planted::ConstantLightVector) {
                l = lamp.position;
            }
            if !self.does(Planted::LongLightVector) {
                l = l.normalize();
            }
            if self.does(Planted::LightVectorReversed) {
                l = -l;
            }
            let intensity = if self.does(Planted::NoIntensity) { DVec3::ONE } else { lamp.intensity / divisor };
            let n_dot_l = long.dot(l);
            let cosine = match self.planted {
                Some(Planted::AngleAsCosine) if n_dot_l > 0.0 => n_dot_l.acos(),
                Some(Planted::SineAsCosine) if n_dot_l > 0.0 => (1.0 - n_dot_l * n_dot_l).max(0.0).sqrt(),
                Some(Planted::NoMax) => n_dot_l,
                Some(Planted::AbsoluteValue) => n_dot_l.abs(),
                _ => n_dot_l.max(0.0),
            };
            let term = if self.does(Planted::NoDiffuse) { DVec3::ZERO } else { intensity * kd * cosine };
            let mut highlight = DVec3::ZERO;
            let may_shine = n_dot_l > 0.0 || self.does(Planted::EvenPower);
            if self.stage >= Stage::Specular && may_shine && !self.does(Planted::NoSpecular) {
                let cosine = match self.planted {
                    Some(Planted::Blinn) => n.dot((l + v).normalize()),
                    Some(Planted::HalfOfSum) => n.dot((l + v) / 2.0),
                    _ => r.dot(l),
                };
                let exponent = f64::from(m.n)
                    * match self.planted {
                        Some(Planted::ExponentDoubled) => 2.0,
                        Some(Planted::ExponentHalved) => 0.5,
                        Some(Planted::NoExponent) => 1.0 / f64::from(m.n),
                        _ => 1.0,
                    };
                let cosine = if self.does(Planted::EvenPower) { cosine } else { cosine.max(0.0) };
                let ks = if self.does(Planted::HighlightTimesKd) { color(m.ks) * kd } else { color(m.ks) };
                highlight = match self.planted {
                    Some(Planted::HighlightsWithoutIntensity) => DVec3::ONE,
                    Some(Planted::HighlightTimesCosine) => intensity * n_dot_l,
                    _ => intensity,
                };
                highlight *= ks * cosine.powf(exponent);
            }
            let looked_for = n_dot_l > 0.0 || !matches!(self.planted, Some(Planted::NoMax | Planted::AbsoluteValue));
            let mut f_s = 1.0;
            if self.stage >= Stage::Shadow && !self.does(Planted::NoShadows) && looked_for {
                f_s = self.passed(p, n, lamp);
            }
            lit += term * f_s + highlight * if self.does(Planted::HighlightsInShadow) { 1.0 } else { f_s };
            if self.does(Planted::ShadowTakesAll) {
                ambient *= f_s;
            }
        }
        let own = ambient + lit;
        let mut sum = own;
        let deepest = match self.planted {
            Some(Planted::DepthTwo) => 2,
            Some(Planted::DepthOneLess) => describe(&self.scene.integrator).max_depth() - 1,
            _ => describe(&self.scene.integrator).max_depth(),
        };
        if depth >= deepest {
            return sum;
        }
        let off = 1e-6;
        if self.stage >= Stage::Reflection && !m.k.is_black() && !self.does(Planted::NoReflection) {
            let direction = match self.planted {
                Some(Planted::ReflectsOn) => (2.0 * n.dot(v) * n + v).normalize(),
                Some(Planted::ReflectsInwards) => v - 2.0 * n.dot(v) * n,
                Some(Planted::ReflectsLight) => {
                    let l = self.lights[0].from(p, [1.0, 0.0, 0.0]).0.normalize();
                    2.0 * n.dot(l) * n - l
                }
                _ => mirrored,
            };
            let k = if self.does(Planted::NoK) { DVec3::ONE } else { color(m.k) };
            let seen = self.trace(p + direction * off, direction, depth + 1);
            sum = if self.does(Planted::OneMinusK) { own * (1.0 - k) } else { sum } + k * seen;
        }
        if self.stage >= Stage::Full && m.opacity < 1.0 && !self.does(Planted::NoRefraction) {
            let (eta, o) = (f64::from(m.eta), f64::from(m.opacity));
            let (from, into) = if entering || self.does(Planted::EtaOneWay) { (1.0, eta) } else { (eta, 1.0) };
            let ratio = match self.planted {
                Some(Planted::EtaUpsideDown) => into / from,
                Some(Planted::StraightOn) => 1.0,
                _ => from / into,
            };
            let sine = ratio * (1.0 - n.dot(v).powi(2)).max(0.0).sqrt();
            let direction = if sine < 1.0 {
                let tangent = (n.dot(v) * n - v).normalize_or_zero();
                sine * tangent - (1.0 - sine * sine).sqrt() * n
            } else {
                mirrored
            };
            let seen = match self.planted {
                Some(Planted::TotalIsBlack) if sine >= 1.0 => DVec3::ZERO,
                _ => self.trace(p + direction * off, direction, depth + 1),
            };
            let share = match self.planted {
                Some(Planted::NoTransparency) => 1.0,
                Some(Planted::OpacityAsTransparency) => o,
                _ => 1.0 - o,
            };
            sum = if self.does(Planted::OpacityBlend) { sum * o } else { sum } + share * seen;
        }
        sum
    }

    /// f_s of the light at a position.
    fn passed(&self, p: DVec3, n: DVec3, lamp: &Lamp) -> f64 {
        let mut start = p + n * 1e-6;
        if self.does(Planted::Acne) {
            // Programs with floats start at the rounded point.
            start = p.as_vec3().as_dvec3();
        }
        let way = if lamp.w == 0.0 { lamp.position.normalize() } else { lamp.position - start };
        let mut passed = 1.0;
        for (shape, material) in &self.objects {
            for (t, _) in crossings(shape, start, way) {
                if t > 0.0 && (t < 1.0 || lamp.w == 0.0 || self.does(Planted::BeyondLight)) {
                    let opacity = if self.does(Planted::GlassBlocks) { 1.0 } else { f64::from(material.opacity) };
                    passed *= 1.0 - opacity;
                }
            }
        }
        passed
    }

    fn nearest(&self, o: DVec3, d: DVec3) -> Option<Found> {
        let mut best: Option<Found> = None;
        for (shape, material) in &self.objects {
            let mut own: Option<(f64, DVec3)> = None;
            for (t, n) in crossings(shape, o, d).into_iter().filter(|(t, _)| *t > 0.0) {
                let is_sphere = matches!(shape, Shape::Sphere(_));
                let farther = self.does(Planted::FarthestWins) || is_sphere && self.does(Planted::FarRootOfSpheres);
                if own.is_none_or(|(other, _)| if farther { t > other } else { t < other }) {
                    own = Some((t, n));
                }
            }
            let Some((t, n)) = own else { continue };
            let wins = match (&best, self.planted) {
                (None, _) | (_, Some(Planted::LastObjectWins)) => true,
                (Some(best), Some(Planted::FarthestWins)) => t > best.t,
                (Some(best), _) => t < best.t,
            };
            if wins {
                let radius = if let Shape::Sphere(sphere) = shape { f64::from(sphere.radius) } else { 1.0 };
                best = Some(Found { t, p: o + d * t, n, radius, material: *material });
            }
        }
        best
    }
}

fn color(c: canaletto::math::Rgb) -> DVec3 {
    DVec3::from(c.to_array().map(f64::from))
}

fn srgb(v: f64) -> f64 {
    if v <= 0.0031308 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// The parameters at which a line crosses a shape, with the outward normals there.
fn crossings(shape: &Shape, o: DVec3, d: DVec3) -> Vec<(f64, DVec3)> {
    match shape {
        Shape::Sphere(sphere) => {
            let (center, radius) = (sphere.center.as_dvec3(), f64::from(sphere.radius));
            let from = o - center;
            let half_b = d.dot(from);
            let root = half_b * half_b - d.dot(d) * (from.dot(from) - radius * radius);
            if root < 0.0 {
                return Vec::new();
            }
            let at = |t: f64| (t, (from + d * t) / radius);
            vec![at((-half_b - root.sqrt()) / d.dot(d)), at((-half_b + root.sqrt()) / d.dot(d))]
        }
        Shape::Box(b) => {
            let (mut near, mut far) = ((f64::NEG_INFINITY, DVec3::ZERO), (f64::INFINITY, DVec3::ZERO));
            for axis in 0..3 {
                let normal = |side: f64| DVec3::AXES[axis] * side;
                let at = |bound: f32| (f64::from(bound) - o[axis]) / d[axis];
                let (mut low, mut high) = ((at(b.min[axis]), normal(-1.0)), (at(b.max[axis]), normal(1.0)));
                if low.0 > high.0 {
                    std::mem::swap(&mut low, &mut high);
                }
                if low.0 > near.0 {
                    near = low;
                }
                if high.0 < far.0 {
                    far = high;
                }
            }
            if near.0 <= far.0 { vec![near, far] } else { Vec::new() }
        }
        Shape::Plane(plane) => {
            let n = plane.normal.as_dvec3().normalize();
            let t = (plane.point.as_dvec3() - o).dot(n) / d.dot(n);
            if t.is_finite() { vec![(t, n)] } else { Vec::new() }
        }
        Shape::Triangle(triangle) => {
            let [a, b, c] = [triangle.a, triangle.b, triangle.c].map(|p| p.as_dvec3());
            let n = (b - a).cross(c - a).normalize();
            let t = (a - o).dot(n) / d.dot(n);
            let p = o + d * t;
            let is_inside =
                [[a, b], [b, c], [c, a]].iter().all(|[from, to]| (*to - *from).cross(p - *from).dot(n) >= 0.0);
            if t.is_finite() && is_inside { vec![(t, n)] } else { Vec::new() }
        }
        other => panic!("the student doesn't know {other:?}"),
    }
}
