//! Points of emitters for any number of receivers side by side.

use super::{Emitter, Place};
use crate::light::attenuation_divisor;
use crate::math::{Affine, Vector};
use crate::shape::{Flats, cone_points};
use canaletto_bvh::lanes::{Mask, Real, Real64};
use glam::{DAffine3, DVec3};

/// An emitter in each lane, of those that [`Emitter::has_lanes`].
pub(in super::super) struct LaneEmitters<F: Real64> {
    flats: Option<Flats<F>>,
    /// The centres and the radii.
    spheres: Option<(Vector<F>, F)>,
    is_sphere: F::Mask,
    place: Option<LanePlace<F>>,
    two_sided: F::Mask,
    radiance: Vector<F::Narrow>,
    /// The coefficients of the attenuation.
    attenuation: Option<[F::Narrow; 3]>,
}

/// The space of the samplers.
struct LanePlace<F> {
    to_world: Affine<F>,
    to_local: Affine<F>,
    /// |det M| of the map to the world.
    volume: F,
}

/// What [`LaneEmitters::sample`] finds.
pub(in super::super) struct LaneEmitterSamples<F: Real64> {
    /// The points.
    pub(in super::super) point: Vector<F>,
    /// The unit directions to them.
    pub(in super::super) wi: Vector<F>,
    /// The radiance that leaves them towards the lit points.
    pub(in super::super) radiance: Vector<F::Narrow>,
    /// The densities per unit of solid angle at the lit points.
    pub(in super::super) pdf: F,
    /// Where light leaves towards the lit point.
    pub(in super::super) lit: F::Mask,
}

impl Emitter {
    /// Whether the emitter lights a point by the formulas of [`LaneEmitters`]: it is at rest, without textures, and its
    /// area or its cone is sampled. A point behind a flat emitter has no light in any case.
    #[inline]
    pub(in super::super) fn has_lanes(&self, p: DVec3) -> bool {
        let local = match &self.place {
            Place::World => p,
            Place::Still(to_world) => to_world.inverse().point(p),
            Place::Moving => return false,
        };
        self.radiance.is_some() && (self.sampler.has_lanes(local) || !self.two_sided && self.sampler.is_behind(local))
    }
}

impl<F: Real64> LaneEmitters<F> {
    /// The emitter that a function gives for each lane.
    #[inline(always)]
    pub(in super::super) fn gather<'a>(of_lane: impl Fn(usize) -> &'a Emitter) -> LaneEmitters<F> {
        let flat = |lane: usize| of_lane(lane).sampler.flat();
        let sphere = |lane: usize| of_lane(lane).sampler.as_sphere();
        // Lanes of other forms get the form of any lane.
        let any_flat = (0..F::COUNT).find_map(flat);
        let any_sphere = (0..F::COUNT).find_map(sphere);
        let to_world = |lane: usize| match &of_lane(lane).place {
            Place::Still(to_world) => Some(&**to_world),
            Place::World | Place::Moving => None,
        };
        let identity = &DAffine3::IDENTITY;
        // No closure gives vectors: one that isn't inlined would be a function without the instructions.
        let mut place = None;
        if (0..F::COUNT).any(|lane| to_world(lane).is_some()) {
            place = Some(LanePlace {
                to_world: Affine::gather(|lane| to_world(lane).map_or(identity, |t| t.matrix())),
                to_local: Affine::gather(|lane| to_world(lane).map_or(identity, |t| t.back())),
                volume: F::gather(|lane| to_world(lane).map_or(1.0, |t| t.matrix().matrix3.determinant().abs())),
            });
        }
        let mut flats = None;
        if let Some(any) = any_flat {
            flats = Some(Flats::gather(|lane| flat(lane).unwrap_or(any)));
        }
        let mut spheres = None;
        if let Some(any) = any_sphere {
            let center = Vector::gather(|lane| sphere(lane).unwrap_or(any).0);
            spheres = Some((center, F::gather(|lane| sphere(lane).unwrap_or(any).1)));
        }
        let mut attenuation = None;
        if (0..F::COUNT).any(|lane| of_lane(lane).attenuation.is_some()) {
            let coefficients = |lane: usize| of_lane(lane).attenuation.unwrap_or([1.0, 0.0, 0.0]);
            attenuation = Some([
                F::Narrow::gather(|lane| coefficients(lane)[0]),
                F::Narrow::gather(|lane| coefficients(lane)[1]),
                F::Narrow::gather(|lane| coefficients(lane)[2]),
            ]);
        }
        let radiance = |lane: usize| of_lane(lane).radiance.unwrap_or_default();
        LaneEmitters {
            flats,
            spheres,
            is_sphere: F::Mask::gather(|lane| sphere(lane).is_some()),
            place,
            two_sided: F::Mask::gather(|lane| of_lane(lane).two_sided),
            radiance: Vector {
                x: F::Narrow::gather(|lane| radiance(lane).r),
                y: F::Narrow::gather(|lane| radiance(lane).g),
                z: F::Narrow::gather(|lane| radiance(lane).b),
            },
            attenuation,
        }
    }

    /// The light of the points at `u` of the unit square, as seen from `p`, as if nothing lay between.
    #[inline(always)]
    pub(in super::super) fn sample(&self, p: Vector<F>, u: [F; 2]) -> LaneEmitterSamples<F> {
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        let mut local = p;
        if let Some(place) = &self.place {
            local = place.to_local.point(p);
        }
        let (mut point, mut normal, mut pdf) = (p, p, zero);
        if let Some(flats) = &self.flats {
            (point, normal) = (flats.points(u), flats.normal);
            pdf = flats.pdf(local, point);
        }
        if let Some((center, radius)) = &self.spheres {
            let (on_sphere, of_sphere) = cone_points(*center, *radius, local, u);
            point = Vector::select(self.is_sphere, on_sphere, point);
            normal = Vector::select(self.is_sphere, on_sphere - *center, normal);
            pdf = F::select(self.is_sphere, of_sphere, pdf);
        }
        let mut lit = zero.less(pdf);
        let outside = zero.less(normal.dot(local - point));
        if let Some(place) = &self.place {
            // A unit direction w becomes M w, and dω shrinks by |M w|³ / |det M|.
            let length = place.to_world.vector((point - local).normalized()).length();
            pdf = pdf * (length * length * length / place.volume);
            point = place.to_world.point(point);
        }
        lit = lit & (outside | self.two_sided) & pdf.less(F::splat(f64::INFINITY));
        let to = point - p;
        let distance = to.length();
        let per_distance = one / distance;
        lit = lit & zero.less(per_distance) & per_distance.less(F::splat(f64::INFINITY));
        let mut radiance = self.radiance;
        if let Some(coefficients) = self.attenuation {
            let divisor = attenuation_divisor(coefficients, distance.narrow());
            radiance = Vector { x: radiance.x / divisor, y: radiance.y / divisor, z: radiance.z / divisor };
        }
        lit = lit & !radiance.is_zero();
        LaneEmitterSamples { point, wi: to * per_distance, radiance, pdf, lit }
    }
}
