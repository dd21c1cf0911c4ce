//! Light that arrives without a patch: from the scene's lights, and from the environment.
//!
//! A light of intensity l gives a diffuse surface the colour l ⊗ kd (n·L) (5.32). Light is therefore counted as the
//! radiance of a white surface, so that π cancels everywhere. Lights with an area are their points, as in the classic
//! integrator. The scene's background colour is no light, since nothing is said about where it comes from.

use super::exchange::BEFORE_END;
use super::mesh::{Element, PatchMesh, vector};
use super::outline::CELLS;
use crate::light::PreparedLight;
use crate::math::warp;
use crate::world::{OccluderCache, World};
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};

/// The number of directions in which each cell looks for the environment, on each axis. Together the cells look in
/// each direction of a grid of this square.
const DIRECTIONS: usize = 4;

/// Light that arrives at an element: the mean over its cells, and the largest difference between cells.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Arriving {
    pub(super) mean: DVec3,
    pub(super) spread: DVec3,
}

/// The points of all lights that have a place.
pub(super) fn light_points(world: &World) -> Vec<Vec3> {
    let of = |light: &PreparedLight| -> Vec<Vec3> {
        (0..light.points()).filter_map(|i| light.illuminate_evenly(i, DVec3::ZERO).position).collect()
    };
    world.lights.iter().flat_map(of).collect()
}

/// The mean and the range of the values at the bare cells.
fn over_cells(element: &Element, mut at: impl FnMut(usize) -> DVec3) -> Arriving {
    let (mut sum, mut low, mut high) = (DVec3::ZERO, DVec3::INFINITY, DVec3::ZERO);
    for cell in (0..CELLS).filter(|&cell| element.is_bare(cell)) {
        let value = at(cell);
        sum += value;
        low = low.min(value);
        high = high.max(value);
    }
    match element.bare.count_ones() {
        0 => Arriving::default(),
        count => Arriving { mean: sum / f64::from(count), spread: high - low },
    }
}

/// A place that light arrives at.
pub(super) struct LitPlace {
    pub(super) point: DVec3,
    /// The origin of shadow rays.
    pub(super) origin: Vec3,
    /// The unit normal.
    pub(super) normal: DVec3,
}

impl LitPlace {
    /// The light of all lights that arrives, as the radiance of a white surface. `last` holds each light's last
    /// occluder.
    pub(super) fn lit(&self, world: &World, last: &mut [OccluderCache]) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for (light, last) in world.lights.iter().zip(last) {
            self.add(world, light, last, &mut sum);
        }
        sum
    }

    /// Adds the light of one light to a sum.
    fn add(&self, world: &World, light: &PreparedLight, last: &mut OccluderCache, sum: &mut DVec3) {
        let LitPlace { point, origin, normal } = *self;
        for index in 0..light.points() {
            let arriving = light.illuminate_evenly(index, point);
            let cosine = normal.dot(arriving.direction);
            // A light exactly at the point gives NaN, which is no positive cosine.
            let is_before = cosine > 0.0;
            if !is_before || arriving.intensity.is_black() {
                continue;
            }
            let passed = if light.light.shadows {
                let (ray, t_max) = match arriving.position {
                    Some(position) => (Ray::new(origin, position - origin), BEFORE_END),
                    None => (Ray::new(origin, arriving.direction.as_vec3()), f32::INFINITY),
                };
                f64::from(world.transmittance(&ray, t_max, 0.0, None, last, &mut ()))
            } else {
                1.0
            };
            *sum += vector(arriving.intensity) * (cosine * passed);
        }
    }
}

impl PatchMesh<'_> {
    /// The light of all lights that arrives at an element.
    pub(super) fn lit(&self, element: u32) -> Arriving {
        let mut last = vec![OccluderCache::NONE; self.world.lights.len()];
        over_cells(&self.elements[element as usize], |cell| self.lit_place(element, cell).lit(self.world, &mut last))
    }

    /// The light of one of the world's lights that arrives at an element.
    pub(super) fn lit_by(&self, light: u32, element: u32) -> DVec3 {
        let (light, mut last) = (&self.world.lights[light as usize], OccluderCache::NONE);
        let at_cell = |cell| {
            let mut sum = DVec3::ZERO;
            self.lit_place(element, cell).add(self.world, light, &mut last, &mut sum);
            sum
        };
        over_cells(&self.elements[element as usize], at_cell).mean
    }

    fn lit_place(&self, number: u32, cell: usize) -> LitPlace {
        let element = &self.elements[number as usize];
        LitPlace { point: element.outline.cell(cell), origin: element.origins[cell], normal: self.normal_of(number) }
    }

    /// The light of all lights and that of the environment that arrive at an element.
    pub(super) fn without_patches(&self, element: u32) -> [Arriving; 2] {
        let has_sky = self.world.environment.is_some();
        [self.lit(element), if has_sky { self.sky(element).0 } else { Arriving::default() }]
    }

    /// The light of the environment that arrives at an element, without its sun, and the share of directions in which
    /// nothing is hit.
    pub(super) fn sky(&self, element: u32) -> (Arriving, f64) {
        let (world, normal) = (self.world, self.normal_of(element));
        let element = &self.elements[element as usize];
        let (x, y) = normal.any_orthonormal_pair();
        let (mut open, mut last) = (0.0, OccluderCache::NONE);
        let arriving = over_cells(element, |cell| {
            let mut sum = DVec3::ZERO;
            for k in 0..DIRECTIONS * DIRECTIONS {
                // Each cell has one direction in each square of the coarse grid, at its own place in the square.
                let at = |coarse: usize, fine: usize| {
                    (coarse as f64 + (fine as f64 + 0.5) / DIRECTIONS as f64) / DIRECTIONS as f64
                };
                let u = [
                    at(k % DIRECTIONS, (cell + k / DIRECTIONS) % DIRECTIONS),
                    at(k / DIRECTIONS, (cell / DIRECTIONS + k) % DIRECTIONS),
                ];
                let p = warp::cosine_hemisphere(u);
                let direction = x * p.x + y * p.y + normal * p.z;
                let ray = Ray::new(element.origins[cell], direction.as_vec3());
                let passed = f64::from(world.transmittance(&ray, f32::INFINITY, 0.0, None, &mut last, &mut ()));
                if passed > 0.0 {
                    open += passed;
                    sum += environment(world, direction, x, y) * passed;
                }
            }
            sum / (DIRECTIONS * DIRECTIONS) as f64
        });
        let directions = f64::from(element.bare.count_ones().max(1)) * (DIRECTIONS * DIRECTIONS) as f64;
        (arriving, open / directions)
    }
}

/// The environment's radiance around a direction, without its sun, which is a light.
pub(super) fn environment(world: &World, direction: DVec3, x: DVec3, y: DVec3) -> DVec3 {
    environment_and_place(world, direction, [x, y]).0
}

/// [`environment`], and (u, v) of the direction in a latitude-longitude image of the environment.
pub(super) fn environment_and_place(world: &World, direction: DVec3, across: [DVec3; 2]) -> (DVec3, [f64; 2]) {
    let Some(environment) = &world.environment else { return (DVec3::ZERO, [0.0; 2]) };
    // The square root of the solid angle that a direction stands for, about π over their number.
    let width = std::f64::consts::PI.sqrt() / (DIRECTIONS * DIRECTIONS) as f64;
    let (radiance, place) = environment.radiance_and_place(direction, across.map(|across| across * width));
    (vector(radiance), place)
}
