//! The values of an atlas's texels.

use super::chart::Chart;
use super::layout::{Layout, MARGIN, PlacedChart};
use super::{Atlas, BakeError, fill};
use crate::integrator::radiosity::{RadiositySolution, SolvedRoot};
use crate::job::Observer;
use crate::material::MaterialPoint;
use crate::math::Rgb;
use crate::world::World;
use canaletto_parallel::prelude::*;
use glam::{DVec2, DVec3};

/// The distance from a chart, in texels, up to which texels have a value of it. Bilinear filtering reads texels up to
/// √2 away.
const REACH: f64 = 1.5;

/// How far a point on an edge is moved towards the centre of its root to find the surface there.
pub(super) const INWARDS: f64 = 1.0 / 1024.0;

/// A texel with the point of a root that it shows.
struct ChartTexel {
    /// Its number in the atlas.
    index: u32,
    root: u32,
    point: DVec3,
}

/// A polygon of a root in the texels of its chart.
struct TexelPolygon {
    corners: Vec<DVec2>,
    /// The coordinates of a place along the edges at the first corner.
    inverse: glam::DMat2,
}

impl TexelPolygon {
    fn new(chart: &Chart, placed: &PlacedChart, root: &SolvedRoot) -> TexelPolygon {
        let corners: Vec<DVec2> = root.corners().iter().map(|&p| placed.texel(chart, p)).collect();
        let edges = glam::DMat2::from_cols(corners[1] - corners[0], corners[corners.len() - 1] - corners[0]);
        TexelPolygon { corners, inverse: edges.inverse() }
    }

    /// The nearest place of the polygon, with the squared distance from it.
    fn nearest(&self, p: DVec2) -> (f64, DVec2) {
        let edges = || (0..self.corners.len()).map(|i| [self.corners[i], self.corners[(i + 1) % self.corners.len()]]);
        if edges().all(|[a, b]| (b - a).perp_dot(p - a) >= 0.0) {
            return (0.0, p);
        }
        let on_edge = |[a, b]: [DVec2; 2]| {
            let way = b - a;
            let along = ((p - a).dot(way) / way.length_squared()).clamp(0.0, 1.0);
            let near = a + way * along;
            (near.distance_squared(p), near)
        };
        edges().map(on_edge).fold((f64::INFINITY, p), |best, other| if other.0 < best.0 { other } else { best })
    }

    /// The point of the root at a place of the polygon.
    fn point(&self, root: &SolvedRoot, place: DVec2) -> DVec3 {
        let corners = root.corners();
        let uv = self.inverse * (place - self.corners[0]);
        corners[0] + (corners[1] - corners[0]) * uv.x + (corners[corners.len() - 1] - corners[0]) * uv.y
    }
}

/// The texels that show a chart, in order.
fn texels_of(roots: &[SolvedRoot], chart: &Chart, placed: &PlacedChart, width: u32) -> Vec<ChartTexel> {
    let margin = f64::from(MARGIN);
    let [columns, rows] = placed.steps.map(|steps| steps as usize + 1 + 2 * MARGIN as usize);
    let mut nearest: Vec<(f64, u32, DVec3)> = vec![(REACH * REACH, u32::MAX, DVec3::ZERO); columns * rows];
    for &number in &chart.roots {
        let root = &roots[number as usize];
        let polygon = TexelPolygon::new(chart, placed, root);
        let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for &corner in &polygon.corners {
            (min, max) = (min.min(corner), max.max(corner));
        }
        let range = |low: f64, high: f64, count: usize| {
            let first = (low - REACH + margin).ceil().max(0.0) as usize;
            first..((high + REACH + margin).floor().max(0.0) as usize + 1).min(count)
        };
        for row in range(min.y, max.y, rows) {
            for column in range(min.x, max.x, columns) {
                let (square, place) = polygon.nearest(DVec2::new(column as f64, row as f64) - margin);
                let texel = &mut nearest[row * columns + column];
                if square < texel.0 || square == 0.0 && texel.1 == u32::MAX {
                    *texel = (square, number, polygon.point(root, place));
                }
            }
        }
    }
    let [x, y] = placed.first.map(|first| first - MARGIN);
    let at = |index: usize| (y + (index / columns) as u32) * width + x + (index % columns) as u32;
    let known = nearest.into_iter().enumerate().filter(|(_, (_, root, _))| *root != u32::MAX);
    known.map(|(index, (_, root, point))| ChartTexel { index: at(index), root, point }).collect()
}

/// The surface's values at a texel.
struct Shaded {
    light: DVec3,
    radiance: Rgb,
    reflectance: Rgb,
    coverage: f32,
}

/// What the values of texels depend on.
pub(super) struct Shading<'a> {
    pub(super) world: &'a World,
    pub(super) solution: &'a RadiositySolution,
    pub(super) roots: &'a [SolvedRoot],
    /// For each root, its material if it is the same everywhere.
    pub(super) constant: Vec<Option<MaterialPoint>>,
    /// The length of a texel.
    pub(super) texel: f64,
}

impl Shading<'_> {
    fn at(&self, number: u32, point: DVec3) -> Option<Shaded> {
        let root = &self.roots[number as usize];
        let (_, light) = self.solution.light_on(root, point)?;
        let light = light.sum();
        let at = match &self.constant[number as usize] {
            Some(at) => *at,
            None => self.material(root, point),
        };
        let kd = at.classic.kd;
        let arriving = Rgb::from(light.to_array().map(|v| v as f32)).saturated();
        let radiance = at.under_overlay((at.emitted(root.is_outer()) + kd * arriving).saturated());
        let reflectance = at.under_overlay(kd);
        Some(Shaded { light, radiance, reflectance, coverage: at.opacity_with_coverage() })
    }

    /// The material at a point of a root, with textures filtered over a texel.
    fn material(&self, root: &SolvedRoot, point: DVec3) -> MaterialPoint {
        let inside = point + (root.center() - point) * INWARDS;
        let met = [point, inside].into_iter().find_map(|point| {
            let line = root.line_through(point);
            Some((line, self.world.surface_of(root.instance(), root.primitive_at(point), line)?))
        });
        let material = &self.world.materials()[root.material() as usize];
        match met {
            Some((line, (hit, mut surface))) => {
                let (x, y) = surface.normal.any_orthonormal_pair();
                let step = self.world.needs_differentials().then_some([x * self.texel, y * self.texel]);
                self.world.textured(line, &hit, &mut surface, step, &mut ())
            }
            None => *material.plain(),
        }
    }
}

/// The material of a root, if it is the same everywhere.
pub(super) fn constant_material(world: &World, root: &SolvedRoot) -> Option<MaterialPoint> {
    let material = &world.materials()[root.material() as usize];
    // The middle of the first three corners lies in the first of two joined triangles, not between them.
    let middle = root.corners()[..3].iter().sum::<DVec3>() / 3.0;
    let (_, surface) = world.surface_of(root.instance(), root.primitive_at(middle), root.line_through(middle))?;
    (material.is_plain() && surface.color.is_none()).then(|| material.at(&surface))
}

/// The atlas of all charts.
pub(super) fn atlas(
    shading: &Shading,
    charts: &[Chart],
    layout: &Layout,
    observer: &dyn Observer,
) -> Result<Atlas, BakeError> {
    let [width, height] = layout.size;
    let count = width as usize * height as usize;
    let mut light = vec![[0.0; 3]; count];
    let mut radiance = vec![[0.0; 3]; count];
    let mut reflectance = vec![[0.0; 4]; count];
    let mut known = vec![false; count];
    let roots = shading.roots;
    for (charts, places) in charts.chunks(CHUNK).zip(layout.charts.chunks(CHUNK)) {
        if observer.cancelled() {
            return Err(BakeError::Cancelled);
        }
        let texels: Vec<Vec<ChartTexel>> =
            charts.par_iter().zip(places).map(|(chart, placed)| texels_of(roots, chart, placed, width)).collect();
        let texels: Vec<ChartTexel> = texels.into_iter().flatten().collect();
        let shaded: Vec<Option<Shaded>> = texels.par_iter().map(|texel| shading.at(texel.root, texel.point)).collect();
        for (texel, shaded) in texels.iter().zip(shaded) {
            let Some(shaded) = shaded else { continue };
            let index = texel.index as usize;
            known[index] = true;
            light[index] = shaded.light.to_array().map(|v| v as f32);
            radiance[index] = shaded.radiance.to_array();
            let [r, g, b] = shaded.reflectance.to_array();
            reflectance[index] = [r, g, b, shaded.coverage];
        }
    }
    let size = [width as usize, height as usize];
    rayon::join(
        || fill::fill(&mut light, &known, size),
        || rayon::join(|| fill::fill(&mut radiance, &known, size), || fill::fill(&mut reflectance, &known, size)),
    );
    Ok(Atlas { width, height, light, radiance, reflectance, known })
}

/// The number of charts between two looks at whether to stop.
const CHUNK: usize = 256;
