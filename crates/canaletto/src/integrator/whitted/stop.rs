//! Where rays stop.

use super::media;
use super::octet::{Octet, STOPS};
use crate::material::MaterialPoint;
use crate::math::{Line, Rgb, Spread, offset_origin};
use crate::shape::{Encounters, Surface};
use crate::world::Hit;
use canaletto_bvh::Ray;
use glam::{DMat3, DVec3};

/// Where a way meets the nearest surface, and the light that leaves towards it. What its surface is like from there is in its octet: [`Stops::at`].
pub(super) struct Stop {
    way: u32,
    pub(super) hit: Hit,
    pub(super) material: MaterialPoint,
    /// The sum so far.
    pub(super) color: Rgb,
    /// The bodies that the ray is in.
    pub(super) inside: u32,
    /// Where a ray into what is clear goes on, and what else is in the same place.
    pub(super) crossing: u32,
}

impl Stop {
    /// Memory for one.
    fn nowhere() -> Stop {
        let (inside, crossing) = (media::NONE, media::NONE);
        Stop {
            way: 0,
            hit: Hit::before(0.0, 0.0),
            material: MaterialPoint::default(),
            color: Rgb::BLACK,
            inside,
            crossing,
        }
    }

    /// Which way of the generation stops here.
    #[inline]
    pub(super) fn way(&self) -> usize {
        self.way as usize
    }

    /// Whether anything but a print is seen of it.
    #[inline]
    pub(super) fn is_seen(&self) -> bool {
        self.material.is_seen()
    }
}

/// The stops of a generation in the order of their ways, and what they are like in octets.
#[derive(Default)]
pub(super) struct Stops {
    /// As many as there were most; the first `len` are in use.
    stops: Vec<Stop>,
    octets: Vec<Octet>,
    len: usize,
}

impl Stops {
    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// The octet of the next stop, and its place there.
    #[inline]
    pub(super) fn next(&mut self) -> (&mut Octet, usize) {
        let (number, lane) = (self.len / STOPS, self.len % STOPS);
        if number == self.octets.len() {
            self.octets.push(Octet::NOTHING);
            self.stops.resize_with(self.octets.len() * STOPS, Stop::nowhere);
        }
        let octet = &mut self.octets[number];
        if lane == 0 {
            octet.clear();
        }
        (octet, lane)
    }

    /// Adds a stop whose surface [`Stops::next`] took or `encounters` will tell, and whose material is to be `set`.
    #[inline]
    pub(super) fn push(
        &mut self,
        way: usize,
        hit: &Hit,
        encounters: &mut Encounters,
        set: impl FnOnce(&mut MaterialPoint),
    ) {
        let lane = self.len % STOPS;
        let stop = &mut self.stops[self.len];
        (stop.way, stop.hit, stop.color) = (way as u32, *hit, Rgb::BLACK);
        (stop.inside, stop.crossing) = (media::NONE, media::NONE);
        set(&mut stop.material);
        self.octets[self.len / STOPS].set_material(lane, &stop.material);
        self.len += 1;
        if lane == STOPS - 1 {
            self.octets[self.len / STOPS - 1].settle(encounters);
        }
    }

    /// The stop that was added last.
    #[inline]
    pub(super) fn last_mut(&mut self) -> &mut Stop {
        &mut self.stops[self.len - 1]
    }

    /// Finds what the stops of the last octet are like, if it isn't full: else that is known.
    pub(super) fn settle(&mut self, encounters: &mut Encounters) {
        if !self.len.is_multiple_of(STOPS) {
            self.octets[self.len / STOPS].settle(encounters);
        }
    }

    #[inline]
    pub(super) fn each(&self) -> &[Stop] {
        &self.stops[..self.len]
    }

    #[inline]
    pub(super) fn each_mut(&mut self) -> &mut [Stop] {
        &mut self.stops[..self.len]
    }

    /// The octets of all stops.
    #[inline]
    pub(super) fn octets(&self) -> &[Octet] {
        &self.octets[..self.len.div_ceil(STOPS)]
    }

    /// Stops and their octets.
    #[inline]
    pub(super) fn both(&mut self) -> (&mut [Stop], &mut [Octet]) {
        (&mut self.stops[..self.len], &mut self.octets[..self.len.div_ceil(STOPS)])
    }

    /// A stop.
    #[inline]
    pub(super) fn at(&self, index: usize) -> At<'_> {
        At { stop: &self.each()[index], octet: &self.octets[index / STOPS], lane: index % STOPS }
    }
}

/// A stop, and what its surface is like for the ray that made it.
pub(super) struct At<'a> {
    pub(super) stop: &'a Stop,
    pub(super) octet: &'a Octet,
    lane: usize,
}

impl At<'_> {
    /// Whether the ray came from the outer side.
    #[inline]
    pub(super) fn outside(&self) -> bool {
        self.octet.outside(self.lane)
    }

    /// v̂, towards where the ray came from.
    #[inline]
    pub(super) fn wo(&self) -> DVec3 {
        self.octet.wo(self.lane)
    }

    /// r, the mirrored direction (5.37).
    #[inline]
    pub(super) fn mirrored(&self) -> DVec3 {
        self.octet.mirrored(self.lane)
    }

    /// The unit geometric normal on the viewer's side.
    #[inline]
    pub(super) fn facing(&self) -> DVec3 {
        self.octet.facing(self.lane)
    }

    /// The unit shading normal on the viewer's side.
    #[inline]
    pub(super) fn normal(&self) -> DVec3 {
        self.octet.normal(self.lane)
    }

    /// The unit geometric normal on the outer side.
    #[inline]
    fn outer(&self) -> DVec3 {
        self.octet.outer(self.lane)
    }

    /// The line of a ray that leaves the surface.
    pub(super) fn leave(&self, direction: DVec3) -> Line {
        Line { origin: self.octet.exact(self.lane), direction }
    }

    /// Its ray, the origin moved off the surface by the error bound.
    pub(super) fn start(&self, line: &Line) -> Ray {
        let [point, error] = self.octet.point(self.lane);
        line.from_origin(offset_origin(point, error, self.outer(), line.direction))
    }
}

/// The nearest thing on a way that is cut out, clear or within something clear.
pub(super) struct Met {
    pub(super) hit: Hit,
    pub(super) surface: Surface,
    pub(super) material: MaterialPoint,
    /// The way's line, which starts anew behind holes.
    pub(super) line: Line,
    pub(super) footprint: Option<Footprint>,
    /// The bodies that the way is in there.
    pub(super) inside: u32,
    pub(super) crossing: u32,
}

/// How far from here neighbouring samples are.
#[derive(Clone, Copy)]
pub(super) struct Footprint {
    /// The spread of the ray that arrived.
    pub(super) spread: Spread,
    /// The ways along the surface to where the neighbours meet it.
    pub(super) step: [DVec3; 2],
    /// How the shading normal changes along the surface; zero where nothing asks.
    pub(super) bend: DMat3,
}

impl Footprint {
    pub(super) fn new(spread: Option<&Spread>, line: &Line, surface: &Surface) -> Option<Footprint> {
        spread.map(|spread| Footprint {
            spread: *spread,
            step: spread.along(line, surface.exact, surface.normal),
            bend: DMat3::ZERO,
        })
    }
}
