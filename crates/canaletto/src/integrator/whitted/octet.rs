//! What light needs to know of stops, eight side by side: lengths, directions and cosines are computed for all of them at once.

use super::way::Stop;
use canaletto_bvh::{InstructionSet, Kernel};
use glam::{DVec3, Vec3};

/// How many stops are side by side.
pub(super) const STOPS: usize = 8;

/// Eight points or directions: rows of x, y and z.
type Rows = [[f64; STOPS]; 3];

/// Eight stops.
#[derive(Clone, Copy)]
pub(super) struct Octet {
    exact: Rows,
    normal: Rows,
    mirrored: Rows,
}

/// The ways from eight stops to a light.
#[derive(Clone, Copy)]
pub(super) struct Towards {
    /// L̂.
    direction: Rows,
    distance: [f32; STOPS],
    n_dot_l: [f32; STOPS],
    r_dot_l: [f32; STOPS],
}

/// The way from one stop to a light.
#[derive(Clone, Copy)]
pub(super) struct ToLight {
    /// L̂, the unit direction; NaN for a light exactly at the stop.
    pub(super) direction: DVec3,
    /// How far it is.
    pub(super) distance: f32,
    /// n · L.
    pub(super) n_dot_l: f32,
    /// r · L.
    pub(super) r_dot_l: f32,
}

const ZERO: Rows = [[0.0; STOPS]; 3];

impl Octet {
    /// Stops side by side, the last octet filled up with nothing.
    pub(super) fn fill(octets: &mut Vec<Octet>, stops: &[Stop]) {
        octets.clear();
        octets.extend(stops.chunks(STOPS).map(|stops| {
            let mut octet = Octet { exact: ZERO, normal: ZERO, mirrored: ZERO };
            for (i, stop) in stops.iter().enumerate() {
                let normal = stop.normal();
                for axis in 0..3 {
                    octet.exact[axis][i] = stop.surface.exact[axis];
                    octet.normal[axis][i] = normal[axis];
                    octet.mirrored[axis][i] = stop.mirrored[axis];
                }
            }
            octet
        }));
    }
}

impl Towards {
    const NOTHING: Towards =
        Towards { direction: ZERO, distance: [0.0; STOPS], n_dot_l: [0.0; STOPS], r_dot_l: [0.0; STOPS] };

    /// The ways to one point.
    pub(super) fn point(ways: &mut Vec<Towards>, octets: &[Octet], position: Vec3) {
        ways.resize(octets.len(), Towards::NOTHING);
        InstructionSet::run(ToPoint { ways, octets, position: position.as_dvec3().to_array() });
    }

    /// Ways that are known: the direction and the distance for each stop.
    pub(super) fn known(ways: &mut Vec<Towards>, octets: &[Octet], known: impl Iterator<Item = (DVec3, f32)>) {
        ways.clear();
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

    /// r · L at the stop of this number.
    #[inline]
    pub(super) fn r_dot_l(ways: &[Towards], stop: usize) -> f32 {
        ways[stop / STOPS].r_dot_l[stop % STOPS]
    }

    /// The way from the stop of this number.
    #[inline]
    pub(super) fn of(ways: &[Towards], stop: usize) -> ToLight {
        let (way, i) = (&ways[stop / STOPS], stop % STOPS);
        let [x, y, z] = &way.direction;
        ToLight {
            direction: DVec3::new(x[i], y[i], z[i]),
            distance: way.distance[i],
            n_dot_l: way.n_dot_l[i],
            r_dot_l: way.r_dot_l[i],
        }
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
