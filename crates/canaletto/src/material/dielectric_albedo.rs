//! The light that one scattering by a rough boundary of clear media keeps, and how the rest is given back.
//!
//! A table holds the albedos by index η, roughness and angle, for both sides of a boundary. Its rows, of one η and
//! roughness, are computed when they are first used. Microfacets lose most light near grazing and near the critical
//! angle, within about α. Many columns lie there, the closer the smaller α is.
//!
//! What is lost is given back by a lobe as in Kulla & Conty, *Revisiting Physically Based Shading at Imageworks*
//! (2017): a share x of it on the viewer's side, and 1 − x on the other side,
//!
//! x (1 − E(µo)) (1 − E(µi)) / (π L)   and   (1 − x) (1 − E(µo)) (1 − E'(µi)) / (π L'),
//!
//! where E and L are the albedo and the mean loss on the viewer's side, and E' and L' those on the other side. The
//! boundary then loses nothing, and it is reciprocal if (1 − x) L = η² (1 − x') L'. Smooth boundaries have such a
//! relation for the mean F of Fresnel's share, 1 − F = η² (1 − F'). So 1 − x is 1 − F times min(L, L') / L.

use super::fresnel_dielectric;
use super::ggx::{Ggx, on_circle};
use canaletto_bvh::lanes::{LANES, Mask, Real64};
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;
use std::sync::OnceLock;

/// The rows of an index, by roughness √α.
const ROWS: usize = 55;
/// The columns on each side of the critical angle.
const COLUMNS: usize = 28;
/// The facets that a value is the mean of.
const POINTS: usize = 1597;
/// The steps between indices. They are equally spaced by (η − 1) / (η + 1), of which η = 1.5 has 32 steps.
const INDICES: usize = 160;
const _: () = assert!(INDICES.is_multiple_of(5), "η = 1.5 has its own rows");

/// The share of light that one scattering keeps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Kept {
    /// What is mirrored.
    pub(super) mirrored: f64,
    /// What is refracted, without the squeezing of radiance.
    pub(super) refracted: f64,
}

impl Kept {
    pub(super) fn total(&self) -> f64 {
        self.mirrored + self.refracted
    }
}

/// One side of a boundary of one roughness.
struct Side {
    /// Kept light, mirrored and refracted, by column from π/2 over the critical angle to 0. Without a critical angle,
    /// the first half is not used.
    kept: [[f32; 2]; 2 * COLUMNS],
    /// The mean loss over the cosine-weighted hemisphere.
    loss: f64,
    /// The parts of it from each column to the next one, and their sum.
    parts: [f32; 2 * COLUMNS],
    sum: f64,
}

/// The albedos of both sides of a boundary of one roughness.
struct Row {
    /// The side of the thinner medium, then that of the denser one.
    sides: [Side; 2],
    /// The mean Fresnel share on the thinner side.
    mean_fresnel: f64,
    alpha: f64,
}

/// The cosine of the critical angle on a side of a boundary: 0 on the thinner one.
fn critical(eta: f64, is_denser: bool) -> f64 {
    criticals(eta, is_denser)
}

/// The half of the columns, and the place within it from 0 at the critical angle to 1. It is the mean of places that
/// change most near the critical angle, near grazing, and evenly or as Fresnel's share does.
fn column_place(cos: f64, critical: f64, alpha: f64) -> (usize, f64) {
    (usize::from(cos >= critical), column_places(cos, critical, alpha))
}

/// The place in the half of the columns in each lane. That is the second half unless the cosine is below the critical
/// angle's.
#[inline(always)]
fn column_places<F: Real64>(cos: F, critical: F, alpha: F) -> F {
    let one = F::splat(1.0);
    let (from, most) = (cos - critical, one - critical);
    let upper = (near(from, most, alpha) + (from / most).sqrt()) * 0.5;
    let is_lower = cos.less(critical);
    if !is_lower.any() {
        return upper;
    }
    let towards_critical = near(critical - cos, critical, alpha) + one;
    F::select(is_lower, (towards_critical - near(cos, critical, alpha) + one - cos / critical) / 3.0, upper)
}

/// The width within which [`near`] changes most.
#[inline(always)]
fn width<F: Real64>(alpha: F) -> F {
    alpha / (alpha * 8.0 + F::splat(1.0))
}

/// A function from 0 to 1 over 0 to `most` that changes most within about α of 0.
#[inline(always)]
fn near<F: Real64>(from: F, most: F, alpha: F) -> F {
    let width = width(alpha);
    from / (from + width) * (most + width) / most
}

/// The change of [`near`] with `from`.
#[inline(always)]
fn slope_near<F: Real64>(from: F, most: F, alpha: F) -> F {
    let width = width(alpha);
    width / ((from + width) * (from + width)) * (most + width) / most
}

/// The change of [`column_place`] with the cosine.
fn place_slope(cos: f64, critical: f64, alpha: f64) -> f64 {
    place_slopes(cos, critical, alpha)
}

/// [`place_slope`] in each lane.
#[inline(always)]
fn place_slopes<F: Real64>(cos: F, critical: F, alpha: F) -> F {
    let one = F::splat(1.0);
    let (from, most) = ((cos - critical).max(F::splat(1e-12)), one - critical);
    let upper = (slope_near(from, most, alpha) + F::splat(0.5) / (from * most).sqrt()) * 0.5;
    let is_lower = cos.less(critical);
    if !is_lower.any() {
        return upper;
    }
    let near_critical = slope_near(critical - cos, critical, alpha);
    F::select(is_lower, (near_critical + slope_near(cos, critical, alpha) + one / critical) / 3.0, upper)
}

/// The cosine of the critical angle in each lane, 0 on the thinner side.
#[inline(always)]
fn criticals<F: Real64>(eta: F, is_denser: F::Mask) -> F {
    let (zero, one) = (F::splat(0.0), F::splat(1.0));
    F::select(is_denser, (one - one / (eta * eta)).max(zero).sqrt(), zero)
}

/// The cosine at a place in a half of the columns, the inverse of [`column_place`]: by Newton's steps, and by halves
/// where a step would leave the interval.
fn cosine_at(half: usize, place: f64, critical: f64, alpha: f64) -> f64 {
    let is_lower = half == 0;
    let (mut start, mut end) = (critical, if is_lower { 0.0 } else { 1.0 });
    let mut found = start + (end - start) * place;
    for _ in 0..64 {
        let cos = if is_lower { found.min(critical * (1.0 - f64::EPSILON)) } else { found };
        let off = column_place(cos, critical, alpha).1 - place;
        if off < 0.0 {
            start = found
        } else {
            end = found
        }
        let slope = place_slope(cos, critical, alpha);
        let newton = found - off / if is_lower { -slope } else { slope };
        let is_inside = newton > start.min(end) && newton < start.max(end);
        let next = if is_inside { newton } else { 0.5 * (start + end) };
        if (next - found).abs() < 1e-15 {
            return next;
        }
        found = next;
    }
    found
}

fn row_alpha(row: usize) -> f64 {
    let roughness = (row as f64 / (ROWS - 1) as f64).max(1e-3);
    roughness * roughness
}

/// The facets of a quadrature: directions within this part of a turn around the axis, and parts of the cap's area. They
/// form a Fibonacci lattice.
pub(super) fn facets(points: usize, turn: f64) -> Vec<(DVec2, f64)> {
    let at = |i: usize| turn * (i as f64 * 0.618_033_988_749_894_9).fract();
    (0..points).map(|i| (on_circle(at(i)), (i as f64 + 0.5) / points as f64)).collect()
}

/// The kept light at an angle, by a quadrature over the visible facets.
pub(super) fn kept(wo: DVec3, eta_ratio: f64, ggx: &Ggx, facets: &[(DVec2, f64)]) -> Kept {
    let squeezed = ggx.squeezed(wo);
    let mut sum = Kept::default();
    for (circle, u) in facets {
        let m = DVec3::from(ggx.on_cap(squeezed, squeezed.z, (*circle).into(), *u));
        let cos_m = wo.dot(m);
        let share = fresnel_dielectric(cos_m, eta_ratio);
        let mirrored = m * (2.0 * cos_m) - wo;
        if mirrored.z > 0.0 {
            sum.mirrored += share * ggx.shadowing(wo, mirrored);
        }
        let sin2 = eta_ratio * eta_ratio * (1.0 - cos_m * cos_m);
        if sin2 < 1.0 {
            let refracted = m * (eta_ratio * cos_m - (1.0 - sin2).sqrt()) - wo * eta_ratio;
            if refracted.z < 0.0 {
                sum.refracted += (1.0 - share) * ggx.shadowing(wo, refracted);
            }
        }
    }
    Kept { mirrored: sum.mirrored / facets.len() as f64, refracted: sum.refracted / facets.len() as f64 }
}

impl Side {
    fn new(eta: f64, is_denser: bool, ggx: &Ggx) -> Side {
        let (critical, eta_ratio) = (critical(eta, is_denser), if is_denser { eta } else { 1.0 / eta });
        let alpha = ggx.alpha[0];
        // Both halves of the facets are mirror images.
        let facets = facets(POINTS, 0.5);
        let mut side = Side { kept: [[0.0; 2]; 2 * COLUMNS], loss: 0.0, parts: [0.0; 2 * COLUMNS], sum: 0.0 };
        for half in usize::from(!is_denser)..2 {
            let mut before = (0.0, 0.0);
            for column in 0..COLUMNS {
                let place = column as f64 / (COLUMNS - 1) as f64;
                let cos = cosine_at(half, place, critical, alpha).clamp(1e-6, 1.0);
                let wo = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
                let kept = kept(wo, eta_ratio, ggx, &facets);
                side.kept[half * COLUMNS + column] = [kept.mirrored as f32, kept.refracted as f32];
                let lost = (1.0 - kept.total()).max(1e-4);
                if column > 0 {
                    let part = 0.5 * (lost + before.0) * (cos * cos - before.1).abs();
                    side.parts[half * COLUMNS + column - 1] = part as f32;
                    side.sum += f64::from(part as f32);
                }
                before = (lost, cos * cos);
            }
        }
        // ∫ (1 − E(µ)) 2µ dµ, with finer steps at small µ.
        const STEPS: u32 = 512;
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(STEPS);
        let lost = |t: f64| (1.0 - side.kept(column_place(t * t, critical, alpha)).total()) * 4.0 * t * t * t;
        side.loss = (0..STEPS).map(|i| lost(at(i))).sum::<f64>() / f64::from(STEPS);
        side
    }

    /// The kept light at a place of a half of the columns.
    fn kept(&self, (half, place): (usize, f64)) -> Kept {
        let at = place * (COLUMNS - 1) as f64;
        let column = (at as usize).min(COLUMNS - 2);
        let (share, columns) = (at - column as f64, &self.kept[half * COLUMNS + column..]);
        let between = |k: usize| f64::from(columns[0][k]) * (1.0 - share) + f64::from(columns[1][k]) * share;
        Kept { mirrored: between(0), refracted: between(1) }
    }
}

impl Row {
    fn new(index: usize, row: usize) -> Row {
        // The first and last one have no finite η of their own. The last one mirrors nearly all light.
        let s = (index as f64).clamp(0.02, INDICES as f64 - 1e-3) / INDICES as f64;
        let eta = (1.0 + s) / (1.0 - s);
        const STEPS: u32 = 1024;
        let mean_fresnel = (0..STEPS)
            .map(|i| fresnel_dielectric(((f64::from(i) + 0.5) / f64::from(STEPS)).sqrt(), 1.0 / eta))
            .sum::<f64>()
            / f64::from(STEPS);
        let ggx = Ggx::isotropic(row_alpha(row));
        Row {
            sides: [false, true].map(|is_denser| Side::new(eta, is_denser, &ggx)),
            mean_fresnel,
            alpha: row_alpha(row),
        }
    }

    fn get(index: usize, row: usize) -> &'static Row {
        type Rows = [OnceLock<Box<Row>>; ROWS];
        static ALL: [Rows; INDICES + 1] = [const { [const { OnceLock::new() }; ROWS] }; INDICES + 1];
        ALL[index][row].get_or_init(|| Box::new(Row::new(index, row)))
    }
}

/// The two numbers around a place, and their shares.
pub(super) fn split(at: f64, last: usize) -> [(usize, f64); 2] {
    let at = at.clamp(0.0, last as f64);
    let first = (at as usize).min(last - 1);
    // The rounding of an index from a file should not need more rows.
    let share = match at - first as f64 {
        share if share < 1e-6 => 0.0,
        share if share > 1.0 - 1e-6 => 1.0,
        share => share,
    };
    [(first, 1.0 - share), (first + 1, share)]
}

/// What a rough boundary of clear media keeps and loses.
#[derive(Clone, Copy)]
pub(super) struct DielectricAlbedo {
    /// The η of the denser medium over that of the thinner one.
    eta: f64,
    alpha: f64,
    /// Whether the viewer is in the denser medium.
    is_denser: bool,
    /// The rows around this boundary and their shares.
    rows: [Option<(&'static Row, f64)>; 4],
}

impl DielectricAlbedo {
    /// The albedos of a boundary with `eta_ratio` = ηᵢ/ηₜ, of the viewer's side over the other one.
    pub(super) fn new(eta_ratio: f64, alpha: f64) -> DielectricAlbedo {
        let eta = eta_ratio.max(1.0 / eta_ratio);
        let indices = split((eta - 1.0) / (eta + 1.0) * INDICES as f64, INDICES);
        let roughnesses = split(alpha.sqrt() * (ROWS - 1) as f64, ROWS - 1);
        let rows = [0, 1, 2, 3].map(|i: usize| {
            let ((index, by_index), (row, by_row)) = (indices[i / 2], roughnesses[i % 2]);
            let share = by_index * by_row;
            (share > 0.0).then(|| (Row::get(index, row), share))
        });
        DielectricAlbedo { eta, alpha, is_denser: eta_ratio > 1.0, rows }
    }

    /// The mean over the rows around this boundary.
    fn interpolate(&self, value: impl Fn(&Row) -> f64) -> f64 {
        self.rows.iter().flatten().map(|(row, share)| value(row) * share).sum()
    }

    /// What one scattering keeps at the cosine of an angle, on the viewer's side or on the other one.
    pub(super) fn kept(&self, cos: f64, viewers_side: bool) -> Kept {
        let is_denser = self.is_denser == viewers_side;
        self.kept_at(is_denser, column_place(cos, critical(self.eta, is_denser), self.alpha))
    }

    /// What one scattering keeps on a side, at a place of a half of the columns.
    fn kept_at(&self, is_denser: bool, place: (usize, f64)) -> Kept {
        let mut sum = Kept::default();
        for (row, share) in self.rows.iter().flatten() {
            let kept = row.sides[usize::from(is_denser)].kept(place);
            sum.mirrored += kept.mirrored * share;
            sum.refracted += kept.refracted * share;
        }
        sum
    }

    /// How the lost light is given back.
    pub(super) fn given_back(&self) -> GivenBack {
        // The losses over √α are most nearly the means of what is interpolated between rows.
        let loss = |is_denser: bool| {
            let mean = self.interpolate(|row| row.sides[usize::from(is_denser)].loss / row.alpha.sqrt());
            (mean * self.alpha.sqrt()).max(1e-12)
        };
        let (own, other) = (loss(self.is_denser), loss(!self.is_denser));
        let passed = 1.0 - self.interpolate(|row| row.mean_fresnel);
        let passed = if self.is_denser { passed / (self.eta * self.eta) } else { passed };
        GivenBack { mirrored: 1.0 - passed * own.min(other) / own, losses: [own, other] }
    }
}

impl DielectricAlbedo {
    /// The part of the loss on a side that lies between a column and the next one, and the whole.
    fn part(&self, is_denser: bool, column: usize) -> [f64; 2] {
        let side = |row: &'static Row| &row.sides[usize::from(is_denser)];
        let parts = self
            .rows
            .iter()
            .flatten()
            .map(|(row, share)| [side(row).parts[column].into(), side(row).sum].map(|v: f64| v * share));
        parts.fold([0.0; 2], |[a, b], [part, sum]| [a + part, b + sum])
    }

    /// The cosine at `u` of [0, 1) by which lost light is given back on a side, nearly in proportion to the loss.
    pub(super) fn sample_lost(&self, u: f64, viewers_side: bool) -> f64 {
        let is_denser = self.is_denser == viewers_side;
        let mut rest = u * self.part(is_denser, 0)[1];
        let mut last = (COLUMNS, 0.0);
        for column in (0..2 * COLUMNS - 1).filter(|column| is_denser || *column >= COLUMNS) {
            let [part, _] = self.part(is_denser, column);
            if part > 0.0 {
                last = (column, (rest / part).min(1.0));
            }
            if rest < part {
                break;
            }
            rest -= part;
        }
        let (half, place) = (last.0 / COLUMNS, ((last.0 % COLUMNS) as f64 + last.1) / (COLUMNS - 1) as f64);
        cosine_at(half, place, critical(self.eta, is_denser), self.alpha)
    }
}

/// The places of cosines among the columns of boundaries.
struct Places<F> {
    critical: F,
    alpha: F,
    place: F,
    /// A bit for each lane on the denser side, and for each in the second half of the columns.
    denser: u32,
    upper: u32,
}

impl<F: Real64> Places<F> {
    /// The places on the viewers' sides in the lanes of a mask, and on the other sides elsewhere.
    #[inline(always)]
    fn new(of: &[DielectricAlbedo; LANES], cos: F, viewers_side: F::Mask) -> Places<F> {
        let viewer_is_denser = F::Mask::gather(|lane| of[lane].is_denser);
        let is_denser = (viewer_is_denser & viewers_side) | (!viewer_is_denser & !viewers_side);
        let critical = criticals(F::gather(|lane| of[lane].eta), is_denser);
        let alpha = F::gather(|lane| of[lane].alpha);
        let (denser, upper) = (is_denser.bits(), (!cos.less(critical)).bits());
        Places { critical, alpha, place: column_places(cos, critical, alpha), denser, upper }
    }
}

/// What one scattering mirrors, and all that it keeps, at the cosines of angles on the viewers' sides of boundaries
/// with these ηᵢ/ηₜ and α. It is 0 and 1 in lanes without a bit.
#[inline(always)]
pub(super) fn kept_in_lanes<F: Real64>(eta_ratio: F, alpha: F, cos: F, lanes: u32) -> [F; 2] {
    let one = F::splat(1.0);
    let is_denser = one.less(eta_ratio);
    let critical = criticals(eta_ratio.max(one / eta_ratio), is_denser);
    let places = column_places(cos, critical, alpha).to_array();
    let (denser, upper) = (is_denser.bits(), (!cos.less(critical)).bits());
    let (ratios, alphas) = (eta_ratio.to_array(), alpha.to_array());
    let [mut mirrored, mut total] = [[0.0; LANES], [1.0; LANES]];
    // Neighbouring lanes often are of one material.
    let mut last: Option<(usize, DielectricAlbedo)> = None;
    for lane in (0..F::COUNT).filter(|lane| lanes >> lane & 1 == 1) {
        let albedo = match last {
            Some((other, albedo)) if ratios[other] == ratios[lane] && alphas[other] == alphas[lane] => albedo,
            _ => DielectricAlbedo::new(ratios[lane], alphas[lane]),
        };
        last = Some((lane, albedo));
        let kept = albedo.kept_at(denser >> lane & 1 == 1, ((upper >> lane & 1) as usize, places[lane]));
        (mirrored[lane], total[lane]) = (kept.mirrored, kept.total());
    }
    [F::load(&mirrored), F::load(&total)]
}

/// What one scattering loses at the cosines of angles, on the viewers' sides in the lanes of a mask. It is 0 in lanes
/// without a bit.
#[inline(always)]
pub(super) fn losses_at<F: Real64>(of: &[DielectricAlbedo; LANES], cos: F, viewers_side: F::Mask, lanes: u32) -> F {
    let Places { place, denser, upper, .. } = Places::new(of, cos, viewers_side);
    let (places, mut lost) = (place.to_array(), [0.0; LANES]);
    for lane in (0..F::COUNT).filter(|lane| lanes >> lane & 1 == 1) {
        let place = ((upper >> lane & 1) as usize, places[lane]);
        lost[lane] = (1.0 - of[lane].kept_at(denser >> lane & 1 == 1, place).total()).max(0.0);
    }
    F::load(&lost)
}

/// The density of [`DielectricAlbedo::sample_lost`]'s directions per unit of solid angle in the same lanes.
#[inline(always)]
pub(super) fn loss_pdfs<F: Real64>(of: &[DielectricAlbedo; LANES], cos: F, viewers_side: F::Mask, lanes: u32) -> F {
    let Places { critical, alpha, place, denser, upper } = Places::new(of, cos, viewers_side);
    let (places, mut share) = (place.to_array(), [0.0; LANES]);
    for lane in (0..F::COUNT).filter(|lane| lanes >> lane & 1 == 1) {
        let column = ((places[lane] * (COLUMNS - 1) as f64) as usize).min(COLUMNS - 2);
        let half = (upper >> lane & 1) as usize;
        let [part, sum] = of[lane].part(denser >> lane & 1 == 1, half * COLUMNS + column);
        share[lane] = part / sum;
    }
    F::load(&share) * (COLUMNS - 1) as f64 * place_slopes(cos, critical, alpha) / TAU
}

/// How lost light is given back.
#[derive(Clone, Copy)]
pub(super) struct GivenBack {
    /// x, the share that is mirrored.
    pub(super) mirrored: f64,
    /// The mean losses on the viewer's side and on the other one.
    pub(super) losses: [f64; 2],
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the table says is the mean over many facets, also between its rows and columns. The mirrored part counts on
    /// the thinner side, where it is taken from what lies below.
    #[test]
    fn tables_hold_the_means_over_facets() {
        let facets = facets(10_946, 0.5);
        for eta in [1.1, 1.33, 1.5, 2.4] {
            for roughness in [0.05f64, 0.1, 0.21, 0.35, 0.5, 0.72, 1.0] {
                let ggx = Ggx::isotropic(roughness * roughness);
                for ratio in [1.0 / eta, eta] {
                    let table = DielectricAlbedo::new(ratio, ggx.alpha[0]);
                    for degrees in [0.0f64, 20.0, 41.0, 45.0, 50.0, 65.0, 75.0, 80.0, 85.0, 88.0] {
                        let (sin, cos) = libm::sincos(degrees.to_radians());
                        let [ours, exact] =
                            [table.kept(cos, true), kept(DVec3::new(sin, 0.0, cos), ratio, &ggx, &facets)];
                        let off = [ours.total() - exact.total(), ours.mirrored - exact.mirrored];
                        assert!(
                            off[0].abs() < 2e-3,
                            "η {ratio}, roughness {roughness}, {degrees}°: {ours:?} {exact:?}"
                        );
                        assert!(
                            ratio > 1.0 || off[1].abs() < 3e-3,
                            "η {ratio}, {roughness}, {degrees}°: {ours:?} {exact:?}"
                        );
                    }
                }
            }
        }
    }
}
