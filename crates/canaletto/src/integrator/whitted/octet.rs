//! Stops and the light that comes to them, eight side by side: lengths, directions, cosines and colours are computed for all of them at once.

use super::way::Stop;
use crate::math::{Rgb, offset_origin, saturate};
use canaletto_bvh::{InstructionSet, Kernel};
use glam::{DVec3, Vec3};

/// How many stops are side by side.
pub(super) const STOPS: usize = 8;

/// Eight points or directions: rows of x, y and z.
type Rows = [[f64; STOPS]; 3];

/// Eight points or colours.
type Thin = [[f32; STOPS]; 3];

/// Eight stops.
#[derive(Clone, Copy)]
pub(super) struct Octet {
    exact: Rows,
    normal: Rows,
    mirrored: Rows,
    /// Where shadow rays start.
    start: Thin,
    kd: Thin,
    ks: Thin,
    /// n, the exponents of highlights.
    pub(super) n: [f32; STOPS],
    /// The light so far.
    color: Thin,
    /// A bit for each stop of which anything but a print is seen.
    pub(super) seen: u32,
    /// A bit for each stop that has highlights.
    pub(super) shiny: u32,
    /// A bit for each stop whose shading normal a texture bent.
    pub(super) bent: u32,
}

/// The ways from eight stops to a point of light, and what comes along them.
#[derive(Clone, Copy)]
pub(super) struct Towards {
    /// L̂, the unit directions; NaN for a light exactly at the stop.
    direction: Rows,
    /// How far it is.
    pub(super) distance: [f32; STOPS],
    /// n · L.
    pub(super) n_dot_l: [f32; STOPS],
    /// r · L.
    pub(super) r_dot_l: [f32; STOPS],
    /// Before shadows.
    intensity: Thin,
    /// A bit for each stop to which any light comes, before shadows.
    pub(super) comes: u32,
    /// f_s, the share that passes; 0 where none comes.
    pub(super) f_s: [f32; STOPS],
    /// cosⁿα, where there is a highlight.
    pub(super) highlight: [f32; STOPS],
}

const ZERO: Rows = [[0.0; STOPS]; 3];
const BLACK: Thin = [[0.0; STOPS]; 3];

/// The numbers of the bits that are set.
pub(super) fn lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = (bits != 0).then_some(bits.trailing_zeros() as usize);
        bits &= bits.wrapping_sub(1);
        lane
    })
}

fn put(into: &mut Thin, lane: usize, value: [f32; 3]) {
    for (row, v) in into.iter_mut().zip(value) {
        row[lane] = v;
    }
}

fn take(from: &Thin, lane: usize) -> [f32; 3] {
    [from[0][lane], from[1][lane], from[2][lane]]
}

impl Octet {
    const NOTHING: Octet = Octet {
        exact: ZERO,
        normal: ZERO,
        mirrored: ZERO,
        start: BLACK,
        kd: BLACK,
        ks: BLACK,
        n: [0.0; STOPS],
        color: BLACK,
        seen: 0,
        shiny: 0,
        bent: 0,
    };

    /// Stops side by side, the last octet filled up with nothing.
    pub(super) fn fill(octets: &mut Vec<Octet>, stops: &[Stop]) {
        octets.clear();
        for stops in stops.chunks(STOPS) {
            octets.push(Octet::NOTHING);
            let [.., octet] = &mut octets[..] else { return };
            for (i, stop) in stops.iter().enumerate() {
                octet.put(i, stop);
            }
        }
    }

    #[inline]
    fn put(&mut self, i: usize, stop: &Stop) {
        let (surface, phong, normal, facing) = (&stop.surface, &stop.material.phong, stop.normal(), stop.facing());
        for axis in 0..3 {
            self.exact[axis][i] = surface.exact[axis];
            self.normal[axis][i] = normal[axis];
            self.mirrored[axis][i] = stop.mirrored[axis];
        }
        let start = if stop.outside { surface.lifted } else { surface.point };
        put(&mut self.start, i, offset_origin(start, surface.error, facing, facing).to_array());
        put(&mut self.kd, i, phong.kd.to_array());
        put(&mut self.ks, i, phong.ks.to_array());
        put(&mut self.color, i, stop.color.to_array());
        self.n[i] = phong.n;
        self.seen |= u32::from(stop.is_seen()) << i;
        self.shiny |= u32::from(!phong.ks.is_black()) << i;
        self.bent |= u32::from(stop.material.bent) << i;
    }

    /// Where a stop's shadow rays start.
    #[inline]
    pub(super) fn start(&self, lane: usize) -> Vec3 {
        Vec3::from(take(&self.start, lane))
    }

    /// The light so far at a stop.
    #[inline]
    pub(super) fn color(&self, lane: usize) -> Rgb {
        Rgb::from(take(&self.color, lane))
    }
}

/// The diffuse and the specular light of one component: (5.32b) and (5.38).
#[inline(always)]
fn lit(intensity: f32, [kd, n_dot_l]: [f32; 2], [ks, highlight]: [f32; 2]) -> [f32; 2] {
    [saturate(intensity * kd) * n_dot_l, saturate(intensity * ks) * highlight]
}

/// What arrives of it, added to the light so far (5.39a).
#[inline(always)]
fn contribution([diffuse, specular]: [f32; 2], f_s: f32) -> f32 {
    if f_s > 0.0 { saturate(diffuse + specular) * f_s } else { 0.0 }
}

impl Towards {
    const NOTHING: Towards = Towards {
        direction: ZERO,
        distance: [0.0; STOPS],
        n_dot_l: [0.0; STOPS],
        r_dot_l: [0.0; STOPS],
        intensity: BLACK,
        comes: 0,
        f_s: [0.0; STOPS],
        highlight: [0.0; STOPS],
    };

    /// The ways to one point.
    pub(super) fn point(ways: &mut Vec<Towards>, octets: &[Octet], position: Vec3) {
        ways.resize(octets.len(), Towards::NOTHING);
        InstructionSet::run(ToPoint { ways, octets, position: position.as_dvec3().to_array() });
    }

    /// Ways that are known: the direction and the distance for each stop.
    pub(super) fn known(ways: &mut Vec<Towards>, octets: &[Octet], known: impl Iterator<Item = (DVec3, f32)>) {
        ways.resize(octets.len(), Towards::NOTHING);
        for (index, (direction, distance)) in known.enumerate() {
            let (way, i) = (&mut ways[index / STOPS], index % STOPS);
            for axis in 0..3 {
                way.direction[axis][i] = direction[axis];
            }
            way.distance[i] = distance;
        }
        InstructionSet::run(Cosines { ways, octets });
    }

    /// The direction from a stop.
    #[inline]
    pub(super) fn direction(&self, lane: usize) -> DVec3 {
        let [x, y, z] = &self.direction;
        DVec3::new(x[lane], y[lane], z[lane])
    }

    /// The intensity at a stop, before shadows.
    pub(super) fn intensity(&self, lane: usize) -> Rgb {
        Rgb::from(take(&self.intensity, lane))
    }

    /// Sets the intensity at a stop.
    #[inline]
    pub(super) fn set_intensity(&mut self, lane: usize, intensity: Rgb) {
        put(&mut self.intensity, lane, intensity.to_array());
    }

    /// Sets the intensity at all stops.
    pub(super) fn set_intensities(&mut self, intensity: Rgb) {
        self.intensity = intensity.to_array().map(|v| [v; STOPS]);
    }

    /// Finds out to which stops light comes; without highlights, and nothing in between.
    #[inline]
    pub(super) fn come(&mut self, octet: &Octet) {
        let [r, g, b] = &self.intensity;
        self.comes = 0;
        for i in 0..STOPS {
            // NaN, which isn't: a light exactly at the point, which adds nothing.
            let lit = self.n_dot_l[i] > 0.0 && !(r[i] == 0.0 && g[i] == 0.0 && b[i] == 0.0);
            self.comes |= u32::from(lit) << i;
        }
        self.comes &= octet.seen;
        for i in 0..STOPS {
            self.f_s[i] = if self.comes >> i & 1 == 1 { 1.0 } else { 0.0 };
        }
        self.highlight = [0.0; STOPS];
    }

    /// Lets none come to a stop.
    pub(super) fn keep_off(&mut self, lane: usize) {
        self.comes &= !(1 << lane);
        self.f_s[lane] = 0.0;
    }

    /// Adds what arrives at all stops.
    pub(super) fn add(ways: &[Towards], octets: &mut [Octet]) {
        InstructionSet::run(Add { ways, octets });
    }

    /// The diffuse, the specular and the whole light that arrives at a stop.
    pub(super) fn terms(&self, octet: &Octet, lane: usize) -> [Rgb; 3] {
        if self.comes >> lane & 1 == 0 {
            return [Rgb::BLACK; 3];
        }
        let both: [[f32; 2]; 3] = std::array::from_fn(|c| {
            let diffuse = [octet.kd[c][lane], self.n_dot_l[lane]];
            lit(self.intensity[c][lane], diffuse, [octet.ks[c][lane], self.highlight[lane]])
        });
        let whole = both.map(|both| contribution(both, self.f_s[lane]));
        [both.map(|[diffuse, _]| diffuse), both.map(|[_, specular]| specular), whole].map(Rgb::from)
    }

    #[inline(always)]
    fn cosines(&mut self, octet: &Octet) {
        let dot = |a: &Rows, b: &Rows, i: usize| (a[0][i] * b[0][i] + a[1][i] * b[1][i] + a[2][i] * b[2][i]) as f32;
        for i in 0..STOPS {
            self.n_dot_l[i] = dot(&octet.normal, &self.direction, i);
            self.r_dot_l[i] = dot(&octet.mirrored, &self.direction, i);
        }
    }
}

struct ToPoint<'a> {
    ways: &'a mut [Towards],
    octets: &'a [Octet],
    position: [f64; 3],
}

impl Kernel for ToPoint<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        let [px, py, pz] = self.position;
        for (way, octet) in self.ways.iter_mut().zip(self.octets) {
            for i in 0..STOPS {
                let (x, y, z) = (px - octet.exact[0][i], py - octet.exact[1][i], pz - octet.exact[2][i]);
                let length = (x * x + y * y + z * z).sqrt();
                way.direction[0][i] = x / length;
                way.direction[1][i] = y / length;
                way.direction[2][i] = z / length;
                way.distance[i] = length as f32;
            }
            way.cosines(octet);
        }
    }
}

struct Cosines<'a> {
    ways: &'a mut [Towards],
    octets: &'a [Octet],
}

impl Kernel for Cosines<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        for (way, octet) in self.ways.iter_mut().zip(self.octets) {
            way.cosines(octet);
        }
    }
}

struct Add<'a> {
    ways: &'a [Towards],
    octets: &'a mut [Octet],
}

impl Kernel for Add<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        for (way, octet) in self.ways.iter().zip(self.octets) {
            for c in 0..3 {
                for i in 0..STOPS {
                    let (diffuse, specular) = ([octet.kd[c][i], way.n_dot_l[i]], [octet.ks[c][i], way.highlight[i]]);
                    let arrives = contribution(lit(way.intensity[c][i], diffuse, specular), way.f_s[i]);
                    octet.color[c][i] = saturate(octet.color[c][i] + arrives);
                }
            }
        }
    }
}
