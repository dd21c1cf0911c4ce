//! The light that one scattering by a rough boundary of clear media keeps, and how the rest is given back.
//!
//! A table holds the albedos by roughness and angle, for both sides of one boundary. Tables of some indices η are
//! computed when they are first used; those of other indices are interpolated. Microfacets lose most light near grazing
//! and near the critical angle, within about α. Many columns lie there, the closer the smaller α is.
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
use super::ggx::{Ggx, Masking, on_circle};
use glam::{DVec2, DVec3};
use std::sync::OnceLock;

/// The rows of a table, by roughness √α.
const ROWS: usize = 28;
/// The columns on each side of the critical angle.
const COLUMNS: usize = 28;
/// The facets that a value is the mean of.
const POINTS: usize = 377;
/// The number of tables. They are equally spaced by (η − 1) / (η + 1), of which η = 1.5 has 16 steps.
const TABLES: usize = 80;
const _: () = assert!(TABLES.is_multiple_of(5), "η = 1.5 has its own table");

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

/// One side of a boundary.
struct SideTable {
    /// Kept light, mirrored and refracted: by row, and by column from π/2 over the critical angle to 0. Without a
    /// critical angle, the first half is not used.
    kept: [[[f32; 2]; 2 * COLUMNS]; ROWS],
    /// The mean loss over the cosine-weighted hemisphere, by row.
    loss: [f32; ROWS],
}

/// The albedos of both sides of a boundary.
struct AlbedoTable {
    /// The side of the thinner medium, then that of the denser one.
    sides: [SideTable; 2],
    /// The mean Fresnel share on the thinner side.
    mean_fresnel: f64,
}

/// The cosine of the critical angle on a side of a boundary: 0 on the thinner one.
fn critical(eta: f64, is_denser: bool) -> f64 {
    if is_denser { (1.0 - 1.0 / (eta * eta)).max(0.0).sqrt() } else { 0.0 }
}

/// The half of the columns, and the place within it from 0 at the critical angle to 1. It is the mean of places that
/// change most near the critical angle, near grazing, and evenly or as Fresnel's share does.
fn column_place(cos: f64, critical: f64, alpha: f64) -> (usize, f64) {
    if cos < critical {
        (0, (near(critical - cos, critical, alpha) + 1.0 - near(cos, critical, alpha) + 1.0 - cos / critical) / 3.0)
    } else {
        let (from, most) = (cos - critical, 1.0 - critical);
        (1, 0.5 * (near(from, most, alpha) + (from / most).sqrt()))
    }
}

/// A function from 0 to 1 over 0 to `most` that changes most within about α of 0.
fn near(from: f64, most: f64, alpha: f64) -> f64 {
    let width = alpha / (1.0 + 8.0 * alpha);
    from / (from + width) * (most + width) / most
}

/// The cosine at a column, the inverse of [`column_place`].
fn column_cosine(half: usize, column: usize, critical: f64, alpha: f64) -> f64 {
    let (place, end) = (column as f64 / (COLUMNS - 1) as f64, if half == 0 { 0.0 } else { 1.0 });
    let (mut start, mut end) = (critical, end);
    for _ in 0..48 {
        let middle = 0.5 * (start + end);
        let cos = if half == 0 { middle.min(critical * (1.0 - f64::EPSILON)) } else { middle };
        if column_place(cos, critical, alpha).1 < place { start = middle } else { end = middle }
    }
    0.5 * (start + end)
}

fn row_alpha(row: usize) -> f64 {
    let roughness = (row as f64 / (ROWS - 1) as f64).max(1e-3);
    roughness * roughness
}

/// The facets of a quadrature: directions around the axis, and parts of the cap's area. They form a Fibonacci lattice.
pub(super) fn facets(points: usize) -> Vec<(DVec2, f64)> {
    let at = |i: usize| (i as f64 * 0.618_033_988_749_894_9).fract();
    (0..points).map(|i| (on_circle(at(i)), (i as f64 + 0.5) / points as f64)).collect()
}

/// The kept light at an angle, by a quadrature over the visible facets.
pub(super) fn kept(wo: DVec3, eta_ratio: f64, ggx: &Ggx, facets: &[(DVec2, f64)]) -> Kept {
    let squeezed = ggx.squeezed(wo);
    let mut sum = Kept::default();
    for (circle, u) in facets {
        let m = ggx.on_cap(squeezed, squeezed.z, *circle, *u);
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

impl SideTable {
    fn new(eta: f64, is_denser: bool, masking: Masking) -> SideTable {
        let (critical, eta_ratio) = (critical(eta, is_denser), if is_denser { eta } else { 1.0 / eta });
        let facets = facets(POINTS);
        let mut table = SideTable { kept: [[[0.0; 2]; 2 * COLUMNS]; ROWS], loss: [0.0; ROWS] };
        for row in 0..ROWS {
            let alpha = row_alpha(row);
            let ggx = Ggx::isotropic(alpha, masking);
            for half in usize::from(!is_denser)..2 {
                for column in 0..COLUMNS {
                    let cos = column_cosine(half, column, critical, alpha).clamp(1e-6, 1.0);
                    let wo = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
                    let kept = kept(wo, eta_ratio, &ggx, &facets);
                    table.kept[row][half * COLUMNS + column] = [kept.mirrored as f32, kept.refracted as f32];
                }
            }
            // ∫ (1 − E(µ)) 2µ dµ, with finer steps at small µ.
            const STEPS: u32 = 512;
            let at = |i: u32| (f64::from(i) + 0.5) / f64::from(STEPS);
            let lost = |t: f64| (1.0 - table.row(row, t * t, critical, alpha).total()) * 4.0 * t * t * t;
            table.loss[row] = ((0..STEPS).map(|i| lost(at(i))).sum::<f64>() / f64::from(STEPS)) as f32;
        }
        table
    }

    /// The kept light of a row at the places of the columns for this α.
    fn row(&self, row: usize, cos: f64, critical: f64, alpha: f64) -> Kept {
        let (half, place) = column_place(cos, critical, alpha);
        let at = place * (COLUMNS - 1) as f64;
        let column = (at as usize).min(COLUMNS - 2);
        let (share, columns) = (at - column as f64, &self.kept[row][half * COLUMNS + column..]);
        let between = |k: usize| f64::from(columns[0][k]) * (1.0 - share) + f64::from(columns[1][k]) * share;
        Kept { mirrored: between(0), refracted: between(1) }
    }
}

impl AlbedoTable {
    fn new(number: usize, masking: Masking) -> AlbedoTable {
        // The first and last one have no finite η of their own.
        let s = (number as f64).clamp(0.02, TABLES as f64 - 0.5) / TABLES as f64;
        let eta = (1.0 + s) / (1.0 - s);
        const STEPS: u32 = 1024;
        let mean_fresnel = (0..STEPS)
            .map(|i| fresnel_dielectric(((f64::from(i) + 0.5) / f64::from(STEPS)).sqrt(), 1.0 / eta))
            .sum::<f64>()
            / f64::from(STEPS);
        AlbedoTable { sides: [false, true].map(|is_denser| SideTable::new(eta, is_denser, masking)), mean_fresnel }
    }

    fn get(number: usize, masking: Masking) -> &'static AlbedoTable {
        static ALL: [[OnceLock<Box<AlbedoTable>>; TABLES + 1]; 2] =
            [const { [const { OnceLock::new() }; TABLES + 1] }; 2];
        ALL[usize::from(masking == Masking::Separable)][number]
            .get_or_init(|| Box::new(AlbedoTable::new(number, masking)))
    }
}

/// What a rough boundary of clear media keeps and loses.
#[derive(Clone, Copy)]
pub(super) struct DielectricAlbedo {
    /// The η of the denser medium over that of the thinner one.
    eta: f64,
    alpha: f64,
    /// Whether the viewer is in the denser medium.
    is_denser: bool,
    tables: [(&'static AlbedoTable, f64); 2],
    rows: [(usize, f64); 2],
}

impl DielectricAlbedo {
    /// The albedos of a boundary with `eta_ratio` = ηᵢ/ηₜ, of the viewer's side over the other one.
    pub(super) fn new(eta_ratio: f64, alpha: f64, masking: Masking) -> DielectricAlbedo {
        let eta = eta_ratio.max(1.0 / eta_ratio);
        let at = ((eta - 1.0) / (eta + 1.0) * TABLES as f64).clamp(0.0, TABLES as f64);
        let row = alpha.sqrt().clamp(0.0, 1.0) * (ROWS - 1) as f64;
        let split = |at: f64, last: usize| {
            let first = (at as usize).min(last - 1);
            let share = at - first as f64;
            // The rounding of an index from a file should not need a second table.
            let share = if share < 1e-6 {
                0.0
            } else if share > 1.0 - 1e-6 {
                1.0
            } else {
                share
            };
            [(first, 1.0 - share), (first + 1, share)]
        };
        let tables = split(at, TABLES);
        let kept = tables.iter().find(|(_, share)| *share > 0.0).map_or(0, |(number, _)| *number);
        let tables =
            tables.map(|(number, share)| (AlbedoTable::get(if share > 0.0 { number } else { kept }, masking), share));
        DielectricAlbedo { eta, alpha, is_denser: eta_ratio > 1.0, tables, rows: split(row, ROWS - 1) }
    }

    /// The sum over the tables and rows around this boundary.
    fn interpolate(&self, value: impl Fn(&AlbedoTable, usize) -> f64) -> f64 {
        let mut sum = 0.0;
        for (table, by_table) in self.tables.iter().filter(|(_, share)| *share > 0.0) {
            for (row, by_row) in self.rows.iter().filter(|(_, share)| *share > 0.0) {
                sum += value(table, *row) * by_table * by_row;
            }
        }
        sum
    }

    /// What one scattering keeps at the cosine of an angle, on the viewer's side or on the other one.
    pub(super) fn kept(&self, cos: f64, viewers_side: bool) -> Kept {
        let is_denser = self.is_denser == viewers_side;
        let critical = critical(self.eta, is_denser);
        let mut sum = Kept::default();
        for (table, by_table) in self.tables.iter().filter(|(_, share)| *share > 0.0) {
            for (row, by_row) in self.rows.iter().filter(|(_, share)| *share > 0.0) {
                let kept = table.sides[usize::from(is_denser)].row(*row, cos, critical, self.alpha);
                sum.mirrored += kept.mirrored * by_table * by_row;
                sum.refracted += kept.refracted * by_table * by_row;
            }
        }
        sum
    }

    /// What one scattering loses.
    pub(super) fn lost(&self, cos: f64, viewers_side: bool) -> f64 {
        (1.0 - self.kept(cos, viewers_side).total()).max(0.0)
    }

    /// How the lost light is given back.
    pub(super) fn given_back(&self) -> GivenBack {
        let loss = |is_denser: bool| {
            self.interpolate(|table, row| table.sides[usize::from(is_denser)].loss[row].into()).max(1e-12)
        };
        let (own, other) = (loss(self.is_denser), loss(!self.is_denser));
        let passed = 1.0 - self.interpolate(|table, _| table.mean_fresnel);
        let passed = if self.is_denser { passed / (self.eta * self.eta) } else { passed };
        GivenBack { mirrored: 1.0 - passed * own.min(other) / own, losses: [own, other] }
    }
}

/// How lost light is given back.
#[derive(Clone, Copy)]
pub(super) struct GivenBack {
    /// x, the share that is mirrored.
    pub(super) mirrored: f64,
    /// The mean losses on the viewer's side and on the other one.
    pub(super) losses: [f64; 2],
}
