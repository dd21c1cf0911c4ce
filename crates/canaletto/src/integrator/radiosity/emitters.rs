//! Emitting surfaces as lights of the second pass.
//!
//! The light of a polygon of constant radiance, with nothing between, is its form factor from the point times its
//! radiance. Rays to points of the polygon find the share that arrives (Heitz, Hill, McGuire 2018: the exact light
//! times a ratio of two sampled integrals). Only penumbrae are thus noisy.

#[cfg(test)]
mod tests;

use super::exchange::BEFORE_END;
use super::mesh::{Element, PatchMesh};
use super::outline::Outline;
use super::root::Root;
use crate::form_factor::point_to_polygon;
use crate::integrator::EmittersTerm;
use crate::integrator::shading::EmitterReceiver;
use crate::math::Rgb;
use crate::world::OccluderCache;
use canaletto_bvh::Ray;
use glam::DVec3;

/// The most polygons. The light of more comes from their patches.
const MOST_POLYGONS: usize = 1024;

/// The emitting sides of surfaces, as polygons of constant radiance.
#[derive(Clone, Debug, Default)]
pub(super) struct Emitters {
    pub(super) polygons: Vec<Emitter>,
    /// The number of polygons, if they are too many to be lights.
    pub(super) excess: usize,
}

/// A polygon of constant radiance.
#[derive(Clone, Debug)]
pub(super) struct Emitter {
    /// The surface, with the outline of the polygon.
    pub(super) root: Root,
    pub(super) radiance: DVec3,
}

impl Emitters {
    /// The emitters of a mesh. Parts of equal radiance are one polygon.
    pub(super) fn new(mesh: &PatchMesh) -> Emitters {
        let mut polygons = Vec::new();
        let is_root = |element: &&Element| mesh.element_of(element.parent).is_none();
        for element in mesh.elements.iter().filter(is_root) {
            collect(mesh, element, &mut polygons);
        }
        let emitter = |(root, outline, radiance): (u32, Outline, DVec3)| Emitter {
            root: mesh.roots[root as usize].part(outline),
            radiance,
        };
        match polygons.len() {
            count if count > MOST_POLYGONS => Emitters { polygons: Vec::new(), excess: count },
            _ => Emitters { polygons: polygons.into_iter().map(emitter).collect(), excess: 0 },
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.polygons.is_empty()
    }

    /// The light that arrives straight from all emitters. Rays are given to emitters by the light that they send.
    pub(super) fn light_at(&self, receiver: &EmitterReceiver, rays: u32) -> EmittersTerm {
        let mut term = EmittersTerm::default();
        let mut lights: Vec<(&Emitter, f64)> = Vec::new();
        let mut unoccluded = DVec3::ZERO;
        for emitter in &self.polygons {
            let outline = &emitter.root.outline;
            if (receiver.point - outline.center()).dot(emitter.root.normal) <= 0.0 {
                continue;
            }
            let factor = point_to_polygon(receiver.point, receiver.normal, outline.corners());
            if factor > 0.0 {
                unoccluded += emitter.radiance * factor;
                lights.push((emitter, factor));
            }
        }
        let all = unoccluded.element_sum();
        if !(all > 0.0 && all.is_finite()) {
            return term;
        }
        term.unoccluded = color(unoccluded);
        let (mut arriving, mut last) = (DVec3::ZERO, OccluderCache::NONE);
        let offset = receiver.sample.one(receiver.dimension);
        let (mut before, mut sum) = (offset.floor(), 0.0);
        for (number, &(emitter, factor)) in lights.iter().enumerate() {
            let light = emitter.radiance * factor;
            sum += light.element_sum();
            // Systematic resampling: the number of rays is right on average, and differs by less than 1 from that.
            let wanted = f64::from(rays) * (sum / all).min(1.0);
            let up_to = if number + 1 == lights.len() { f64::from(rays) } else { (wanted + offset).floor() };
            let count = (up_to - before) as u32;
            before = up_to;
            if count == 0 {
                continue;
            }
            let dimension = receiver.dimension.of(number as u32 + 1);
            let numbers = |ray: u32| match lights.len() {
                1 => receiver.sample.two_of(dimension, ray, count),
                // The number of rays differs from sample to sample.
                _ => receiver.sample.two_within(dimension, ray, count),
            };
            let (passed, share) = emitter.passed(receiver, count, numbers, &mut last);
            term.rays += count;
            term.passed += passed;
            arriving += light * (share * f64::from(count) * all / (f64::from(rays) * light.element_sum()));
        }
        term.arriving = color(arriving);
        term
    }
}

fn color(light: DVec3) -> Rgb {
    Rgb::from(light.to_array().map(|v| v as f32)).saturated()
}

/// The polygons of an element and their radiances.
fn collect(mesh: &PatchMesh, element: &Element, found: &mut Vec<(u32, Outline, DVec3)>) {
    match common_emission(mesh, element) {
        Some(emission) if emission.max_element() <= 0.0 || element.bare == 0 => {}
        Some(emission) => found.push((element.root, element.outline, emission)),
        None => parts(mesh, element).iter().for_each(|part| collect(mesh, part, found)),
    }
}

fn parts<'m>(mesh: &'m PatchMesh, element: &Element) -> &'m [Element] {
    if element.is_leaf() { &[] } else { &mesh.elements[element.first_part as usize..][..element.parts as usize] }
}

/// The emission of all bare leaves below an element, if it is equal.
fn common_emission(mesh: &PatchMesh, element: &Element) -> Option<DVec3> {
    if element.is_leaf() {
        return Some(element.emission);
    }
    let mut common = None;
    for part in parts(mesh, element).iter().filter(|part| part.bare != 0) {
        let emission = common_emission(mesh, part)?;
        if *common.get_or_insert(emission) != emission {
            return None;
        }
    }
    Some(common.unwrap_or_default())
}

impl Emitter {
    /// The number of rays to the polygon that pass, and the share of its light.
    fn passed(
        &self,
        receiver: &EmitterReceiver,
        rays: u32,
        numbers: impl Fn(u32) -> [f64; 2],
        last: &mut OccluderCache,
    ) -> (f32, f64) {
        let (mut passed, mut seen, mut all) = (0.0, 0.0, 0.0);
        for ray in 0..rays {
            let [u, v] = numbers(ray);
            let outline = &self.root.outline;
            let at = if outline.corners().len() == 4 {
                outline.point(u, v)
            } else {
                let root = u.sqrt();
                outline.point(1.0 - root, v * root)
            };
            let way = at - receiver.point;
            let cosines = [receiver.normal.dot(way).max(0.0), (-self.root.normal.dot(way)).max(0.0)];
            let square = way.length_squared();
            let weight = cosines[0] * cosines[1] / (square * square);
            // A point in the polygon itself gives NaN.
            let counts = weight > 0.0 && weight.is_finite();
            if !counts {
                continue;
            }
            all += weight;
            if receiver.facing.dot(way) <= 0.0 {
                continue;
            }
            let end = self.root.ray_origin(receiver.world, at);
            let ray = Ray::new(receiver.start, end - receiver.start);
            let share = receiver.world.transmittance(&ray, BEFORE_END, receiver.time, None, last, &mut ());
            passed += share;
            seen += weight * f64::from(share);
        }
        (passed, if all > 0.0 { seen / all } else { 0.0 })
    }
}
