//! Where rays stop.

use super::interactions8::{Interactions8, LANES};
use super::media;
use crate::material::MaterialPoint;
use crate::math::{DRay, RayDifferential, Rgb, offset_origin};
use crate::shape::{Surface, SurfaceInputs8};
use crate::world::Hit;
use canaletto_bvh::Ray;
use glam::{DMat3, DVec3};

/// Where a way meets the nearest surface, and the light that leaves towards it. What its surface is like from there is in its octet: [`Interactions::at`].
pub(super) struct Interaction {
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

impl Interaction {
    /// Memory for one.
    fn nowhere() -> Interaction {
        let (inside, crossing) = (media::NONE, media::NONE);
        Interaction {
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
pub(super) struct Interactions {
    /// As many as there were most; the first `len` are in use.
    interactions: Vec<Interaction>,
    interactions8: Vec<Interactions8>,
    len: usize,
}

impl Interactions {
    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// The octet of the next stop, and its place there.
    #[inline]
    pub(super) fn next(&mut self) -> (&mut Interactions8, usize) {
        let (number, lane) = (self.len / LANES, self.len % LANES);
        if number == self.interactions8.len() {
            self.interactions8.push(Interactions8::NOTHING);
            self.interactions.resize_with(self.interactions8.len() * LANES, Interaction::nowhere);
        }
        let interactions8 = &mut self.interactions8[number];
        if lane == 0 {
            interactions8.clear();
        }
        (interactions8, lane)
    }

    /// Adds a stop whose surface [`Interactions::next`] took or `surface_inputs` will tell, and whose material is to be `set`.
    #[inline]
    pub(super) fn push(
        &mut self,
        way: usize,
        hit: &Hit,
        surface_inputs: &mut SurfaceInputs8,
        set: impl FnOnce(&mut MaterialPoint),
    ) {
        let lane = self.len % LANES;
        let interaction = &mut self.interactions[self.len];
        (interaction.way, interaction.hit, interaction.color) = (way as u32, *hit, Rgb::BLACK);
        (interaction.inside, interaction.crossing) = (media::NONE, media::NONE);
        set(&mut interaction.material);
        self.interactions8[self.len / LANES].set_material(lane, &interaction.material);
        self.len += 1;
        if lane == LANES - 1 {
            self.interactions8[self.len / LANES - 1].evaluate(surface_inputs);
        }
    }

    /// The stop that was added last.
    #[inline]
    pub(super) fn last_mut(&mut self) -> &mut Interaction {
        &mut self.interactions[self.len - 1]
    }

    /// Finds what the stops of the last octet are like, if it isn't full: else that is known.
    pub(super) fn evaluate(&mut self, surface_inputs: &mut SurfaceInputs8) {
        if !self.len.is_multiple_of(LANES) {
            self.interactions8[self.len / LANES].evaluate(surface_inputs);
        }
    }

    #[inline]
    pub(super) fn each(&self) -> &[Interaction] {
        &self.interactions[..self.len]
    }

    #[inline]
    pub(super) fn all_mut(&mut self) -> &mut [Interaction] {
        &mut self.interactions[..self.len]
    }

    /// The octets of all stops.
    #[inline]
    pub(super) fn interactions8(&self) -> &[Interactions8] {
        &self.interactions8[..self.len.div_ceil(LANES)]
    }

    /// Stops and their octets.
    #[inline]
    pub(super) fn both(&mut self) -> (&mut [Interaction], &mut [Interactions8]) {
        (&mut self.interactions[..self.len], &mut self.interactions8[..self.len.div_ceil(LANES)])
    }

    /// A stop.
    #[inline]
    pub(super) fn at(&self, index: usize) -> InteractionRef<'_> {
        InteractionRef {
            interaction: &self.each()[index],
            interactions8: &self.interactions8[index / LANES],
            lane: index % LANES,
        }
    }
}

/// A stop, and what its surface is like for the ray that made it.
pub(super) struct InteractionRef<'a> {
    pub(super) interaction: &'a Interaction,
    pub(super) interactions8: &'a Interactions8,
    lane: usize,
}

impl InteractionRef<'_> {
    /// Whether the ray came from the outer side.
    #[inline]
    pub(super) fn outside(&self) -> bool {
        self.interactions8.outside(self.lane)
    }

    /// v̂, towards where the ray came from.
    #[inline]
    pub(super) fn wo(&self) -> DVec3 {
        self.interactions8.wo(self.lane)
    }

    /// r, the mirrored direction (5.37).
    #[inline]
    pub(super) fn mirrored(&self) -> DVec3 {
        self.interactions8.mirrored(self.lane)
    }

    /// The unit geometric normal on the viewer's side.
    #[inline]
    pub(super) fn facing(&self) -> DVec3 {
        self.interactions8.facing(self.lane)
    }

    /// The unit shading normal on the viewer's side.
    #[inline]
    pub(super) fn normal(&self) -> DVec3 {
        self.interactions8.normal(self.lane)
    }

    /// The unit geometric normal on the outer side.
    #[inline]
    fn outer(&self) -> DVec3 {
        self.interactions8.outer(self.lane)
    }

    /// The line of a ray that leaves the surface.
    pub(super) fn leave(&self, direction: DVec3) -> DRay {
        DRay { origin: self.interactions8.exact(self.lane), direction }
    }

    /// Its ray, the origin moved off the surface by the error bound.
    pub(super) fn start(&self, line: &DRay) -> Ray {
        let [point, error] = self.interactions8.point(self.lane);
        line.from_origin(offset_origin(point, error, self.outer(), line.direction))
    }
}

/// The nearest thing on a way that is cut out, clear or within something clear.
pub(super) struct Encounter {
    pub(super) hit: Hit,
    pub(super) surface: Surface,
    pub(super) material: MaterialPoint,
    /// The way's line, which starts anew behind holes.
    pub(super) line: DRay,
    pub(super) footprint: Option<Footprint>,
    /// The bodies that the way is in there.
    pub(super) inside: u32,
    pub(super) crossing: u32,
}

/// How far from here neighbouring samples are.
#[derive(Clone, Copy)]
pub(super) struct Footprint {
    /// The spread of the ray that arrived.
    pub(super) differential: RayDifferential,
    /// The ways along the surface to where the neighbours meet it.
    pub(super) step: [DVec3; 2],
    /// How the shading normal changes along the surface; zero where nothing asks.
    pub(super) shape_operator: DMat3,
}

impl Footprint {
    pub(super) fn new(differential: Option<&RayDifferential>, line: &DRay, surface: &Surface) -> Option<Footprint> {
        differential.map(|differential| Footprint {
            differential: *differential,
            step: differential.along(line, surface.exact, surface.normal),
            shape_operator: DMat3::ZERO,
        })
    }
}
