//! The layout of charts in an atlas.

use super::chart::Chart;
use super::pack::pack;
use super::{Atlas, BakeError};
use crate::OutOfRange;
use crate::integrator::radiosity::RadiositySolution;
use glam::DVec2;

/// Charts begin at multiples of this number of texels. Each has a margin of one texel. Bilinear filtering of the two
/// finest mip levels thus reads no other chart.
const BLOCK: u32 = 4;

/// The texels on each side of a chart.
pub(super) const MARGIN: u32 = 1;

/// The sides of atlases that are tried for a density.
const SIDES: [u32; 7] = [128, 256, 512, 1024, 2048, 4096, Atlas::MAX_SIDE];

/// The largest side that is chosen without a wish.
const USUAL_SIDE: u32 = 4096;

/// The halvings of the range of densities, of which the largest that fits is searched.
const STEPS: u32 = 14;

/// The texels in each patch of the usual size, on each axis.
const TEXELS_PER_PATCH: f64 = 2.0;

/// How many texels stand for a length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum TexelDensity {
    /// Two texels for the side of a patch of median area, or as many as fit into 4096 × 4096.
    #[default]
    ByPatches,
    /// A number of texels for each unit of length.
    PerUnit(f64),
    /// As many as fit into a square atlas of this side.
    ForSide(u32),
}

/// A chart's place in the atlas.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlacedChart {
    /// The first texel of the chart, without its margin.
    pub(super) first: [u32; 2],
    /// The number of steps between texels, on each axis. The chart has one more texel, so that the first and the last
    /// texel of a row lie on its edges.
    pub(super) steps: [u32; 2],
    /// Texels for each unit of length, on each axis.
    scale: DVec2,
}

impl PlacedChart {
    /// The place of a point in texels from the centre of the chart's first texel.
    pub(super) fn texel(&self, chart: &Chart, point: glam::DVec3) -> DVec2 {
        chart.project(point) * self.scale
    }
}

/// All charts in an atlas.
pub(super) struct Layout {
    pub(super) size: [u32; 2],
    pub(super) charts: Vec<PlacedChart>,
    pub(super) texels_per_unit: f64,
    /// Whether there are fewer texels than [`TexelDensity::ByPatches`] asks for.
    pub(super) is_coarse: bool,
}

fn steps(chart: &Chart, density: f64) -> [u32; 2] {
    if chart.is_dark {
        return [1, 1];
    }
    // A number of steps that exceeds an integer by rounding alone isn't the next one.
    chart.extent.map(|extent| ((extent * density * (1.0 - 1e-9)).ceil().max(1.0)).min(f64::from(u32::MAX / 2)) as u32)
}

fn blocks(steps: [u32; 2]) -> [u32; 2] {
    steps.map(|steps| (steps + 1 + 2 * MARGIN).div_ceil(BLOCK))
}

fn fit(charts: &[Chart], density: f64, size: [u32; 2]) -> Option<Layout> {
    let steps: Vec<[u32; 2]> = charts.iter().map(|chart| steps(chart, density)).collect();
    let rectangles: Vec<[u32; 2]> = steps.iter().map(|&steps| blocks(steps)).collect();
    let places = pack(&rectangles, size.map(|side| side / BLOCK))?;
    let placed = |((place, steps), chart): (([u32; 2], [u32; 2]), &Chart)| PlacedChart {
        first: place.map(|block| block * BLOCK + MARGIN),
        steps,
        scale: DVec2::from_array([0, 1].map(|axis| match chart.extent[axis] {
            0.0 => 0.0,
            extent => f64::from(steps[axis]) / extent,
        })),
    };
    let charts = places.into_iter().zip(steps).zip(charts).map(placed).collect();
    Some(Layout { size, charts, texels_per_unit: density, is_coarse: false })
}

/// The smallest atlas for a density, up to a side.
fn smallest(charts: &[Chart], density: f64, most: u32) -> Option<Layout> {
    let sides = SIDES.into_iter().take_while(|&side| side <= most);
    sides.flat_map(|side| [[side, side / 2], [side, side]]).find_map(|size| fit(charts, density, size))
}

/// The layout with the most texels in a square atlas.
fn densest(charts: &[Chart], side: u32) -> Option<Layout> {
    let area: f64 = charts.iter().map(|chart| chart.extent[0] * chart.extent[1]).sum();
    let (mut low, mut high) = (0.0, f64::from(side) / area.sqrt());
    let mut best = fit(charts, low, [side; 2])?;
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        match fit(charts, middle, [side; 2]) {
            Some(layout) => (best, low) = (layout, middle),
            None => high = middle,
        }
    }
    Some(best)
}

/// The side of the patches of median area.
fn patch_side(solution: &RadiositySolution) -> f64 {
    let mut areas: Vec<f64> = solution.patches().iter().map(|patch| patch.area).filter(|&area| area > 0.0).collect();
    areas.sort_by(f64::total_cmp);
    areas.get(areas.len() / 2).map_or(1.0, |area| area.sqrt())
}

/// Places all charts in an atlas.
pub(super) fn layout(
    charts: &[Chart],
    solution: &RadiositySolution,
    density: TexelDensity,
) -> Result<Layout, BakeError> {
    let too_small = |side: u32| BakeError::TooManyCharts { charts: charts.len(), side };
    match density {
        TexelDensity::ByPatches => {
            let wanted = TEXELS_PER_PATCH / patch_side(solution);
            match smallest(charts, wanted, USUAL_SIDE) {
                Some(layout) => Ok(layout),
                None => {
                    let layout = densest(charts, USUAL_SIDE).ok_or(too_small(USUAL_SIDE))?;
                    Ok(Layout { is_coarse: true, ..layout })
                }
            }
        }
        TexelDensity::PerUnit(density) => {
            if !(density > 0.0 && density.is_finite()) {
                let problem = format!("is {density}; it must be more than 0");
                return Err(OutOfRange::new("the number of texels per unit", problem).into());
            }
            smallest(charts, density, Atlas::MAX_SIDE).ok_or_else(|| match densest(charts, Atlas::MAX_SIDE) {
                Some(most) => BakeError::TooManyTexels { texels_per_unit: density, most: most.texels_per_unit },
                None => too_small(Atlas::MAX_SIDE),
            })
        }
        TexelDensity::ForSide(side) => {
            if !(Atlas::MIN_SIDE..=Atlas::MAX_SIDE).contains(&side) {
                let [least, most] = [Atlas::MIN_SIDE, Atlas::MAX_SIDE];
                let problem = format!("is {side}; it must be between {least} and {most} texels");
                return Err(OutOfRange::new("the side of the light map", problem).into());
            }
            let layout = densest(charts, side / BLOCK * BLOCK).ok_or(too_small(side))?;
            Ok(Layout { size: [side; 2], ..layout })
        }
    }
}
