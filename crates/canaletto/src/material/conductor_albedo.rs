//! The light that one scattering by a rough metal keeps, in a table that is computed when it is first used.

use super::ggx::Ggx;
use super::reflect;
use canaletto_bvh::lanes::Real64;
use glam::DVec3;
use std::sync::LazyLock;

/// The rows and columns of the table, by the square roots of α and of the cosine: facets lose most light near grazing.
const SIDE: usize = 32;

/// The facets that a value is the mean of.
const POINTS: u32 = 512;

type Table = [[f32; SIDE]; SIDE];

static TABLE: LazyLock<Table> = LazyLock::new(|| table(&|_| 1.0));

/// The part of [`TABLE`] that comes from (1 − µ)⁵ of Schlick's curve, with µ the cosine at the facet.
static GRAZING: LazyLock<Table> = LazyLock::new(|| table(&|cos| fifth(1.0 - cos)));

fn fifth(x: f64) -> f64 {
    x * x * x * x * x
}

fn table(weight: &dyn Fn(f64) -> f64) -> Table {
    std::array::from_fn(|row| {
        std::array::from_fn(|column| {
            let [alpha, cos] = [row, column].map(|index| place(index) * place(index));
            mean_shadowing(cos, &Ggx::isotropic(alpha), POINTS, weight) as f32
        })
    })
}

/// The value of a row or column, from nearly 0 to 1.
fn place(index: usize) -> f64 {
    (index as f64 / (SIDE - 1) as f64).max(1e-3)
}

/// The mean of G₂ / G₁ over some of the facets that are seen from a direction, with a weight of the cosine at the
/// facet.
fn mean_shadowing(cos: f64, ggx: &Ggx, points: u32, weight: &dyn Fn(f64) -> f64) -> f64 {
    let wo = DVec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let mut sum = 0.0;
    for i in 0..points {
        // Both halves of the facets are mirror images. Few facets lean far, so that number has the finer steps.
        let u = [0.5 * (f64::from(i) * 0.618_033_988_749_894_9).fract(), (f64::from(i) + 0.5) / f64::from(points)];
        let m = DVec3::from(ggx.sample_visible(wo, u));
        let wi = reflect(wo, m);
        if wi.z > 0.0 {
            sum += ggx.shadowing(wo, wi) * weight(wo.dot(m).clamp(0.0, 1.0));
        }
    }
    sum / f64::from(points)
}

/// E(cos θ, α): the albedo of one scattering by a metal that reflects all light, interpolated in the table.
pub(super) fn conductor_albedo(cos: f64, alpha: f64) -> f64 {
    conductor_albedos(cos, alpha)
}

/// [`conductor_albedo`] in each lane.
#[inline(always)]
pub(super) fn conductor_albedos<F: Real64>(cos: F, alpha: F) -> F {
    looked_up(&TABLE, cos, alpha)
}

/// The albedo of one scattering by facets that reflect (1 − µ)⁵ of the light in each lane, with µ the cosine at the
/// facet.
#[inline(always)]
pub(super) fn grazing_albedos<F: Real64>(cos: F, alpha: F) -> F {
    looked_up(&GRAZING, cos, alpha)
}

#[inline(always)]
fn looked_up<F: Real64>(table: &Table, cos: F, alpha: F) -> F {
    let ([rows, down], [columns, right]) = (on_axis(alpha), on_axis(cos));
    let (rows, columns) = (rows.to_array(), columns.to_array());
    let at = |lane: usize, below: usize, beside: usize| {
        f64::from(table[rows[lane] as usize + below][columns[lane] as usize + beside])
    };
    let (up, left) = (F::splat(1.0) - down, F::splat(1.0) - right);
    let first = F::gather(|lane| at(lane, 0, 0)) * left + F::gather(|lane| at(lane, 0, 1)) * right;
    let second = F::gather(|lane| at(lane, 1, 0)) * left + F::gather(|lane| at(lane, 1, 1)) * right;
    first * up + second * down
}

/// The row or column before a value, and the share of the next one.
#[inline(always)]
fn on_axis<F: Real64>(value: F) -> [F; 2] {
    let at = value.max(F::splat(0.0)).min(F::splat(1.0)).sqrt() * (SIDE - 1) as f64;
    let places = at.to_array();
    let index = F::gather(|lane| (places[lane] as usize).min(SIDE - 2) as f64);
    [index, at - index]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// E(1) by numerical integration over tan² θ, and 1 − ln 2 for α = 1.
    #[test]
    fn albedos_are_the_known_ones() {
        for (alpha, cos, expected) in
            [(1.0f64, 1.0, 1.0 - std::f64::consts::LN_2), (0.5, 1.0, 0.687_849), (0.2, 1.0, 0.947_658)]
        {
            let ours = mean_shadowing(cos, &Ggx::isotropic(alpha), POINTS, &|_| 1.0);
            assert!((ours - expected).abs() < 2e-3, "{alpha}: {ours}");
            let looked_up = conductor_albedo(cos, alpha);
            assert!((looked_up - ours).abs() < 5e-3, "{alpha}: {looked_up}");
        }
    }

    /// The table holds the means over many facets, also between its rows and columns.
    #[test]
    fn tables_hold_the_means_over_facets() {
        for alpha in [0.01, 0.04, 0.11, 0.3, 0.5, 0.72, 0.97] {
            let ggx = Ggx::isotropic(alpha);
            for degrees in [0.0f64, 20.0, 40.0, 60.0, 70.0, 80.0, 85.0, 88.0] {
                let cos = libm::cos(degrees.to_radians());
                let (ours, exact) = (conductor_albedo(cos, alpha), mean_shadowing(cos, &ggx, 20_000, &|_| 1.0));
                assert!((ours - exact).abs() < 1.5e-3, "{alpha}, {degrees}°: {ours} for {exact}");
            }
        }
    }
}
