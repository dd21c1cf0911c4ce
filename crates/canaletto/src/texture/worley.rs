//! Worley's cellular texture (*A Cellular Texture Basis Function*, SIGGRAPH 1996). Each cell of the lattice has one
//! point instead of a random number of them, as is usual today.

use super::noise::scatter;
use glam::DVec3;

/// The distances to the nearest and the second nearest point.
pub(super) fn distances(p: DVec3, jitter: f64, seed: u32) -> [f64; 2] {
    let p = if p.is_finite() { p.clamp(DVec3::splat(-1e15), DVec3::splat(1e15)) } else { DVec3::ZERO };
    let cell = p.floor();
    let inside = p - cell;
    let mut best = [f64::INFINITY; 2];
    let mut visit = |x: i64, y: i64, z: i64| {
        let offset = DVec3::new(x as f64, y as f64, z as f64);
        // The least distance to any point of this cell.
        let gap = (offset - inside).max(inside - offset - DVec3::ONE).max(DVec3::ZERO);
        if gap.length_squared() >= best[1] {
            return;
        }
        let point = offset + feature(cell + offset, jitter, seed);
        let d = (point - inside).length_squared();
        if d < best[0] {
            best = [d, best[0]];
        } else if d < best[1] {
            best[1] = d;
        }
    };
    for distance in [1, 2i64] {
        for z in -distance..=distance {
            for y in -distance..=distance {
                for x in -distance..=distance {
                    // The adjacent cells are visited first; those beyond seldom contain a nearer point.
                    if distance == 1 || x.abs().max(y.abs()).max(z.abs()) == 2 {
                        visit(x, y, z);
                    }
                }
            }
        }
    }
    best.map(f64::sqrt)
}

/// The position of a cell's point in the cell.
fn feature(cell: DVec3, jitter: f64, seed: u32) -> DVec3 {
    let [x, y, z] = cell.to_array().map(|v| v as i64 as u64);
    let mut hash = scatter(scatter(scatter(u64::from(seed) ^ x) ^ y) ^ z);
    let mut next = || {
        hash = scatter(hash);
        (hash >> 11) as f64 * (1.0 / (1u64 << 53) as f64) - 0.5
    };
    DVec3::new(next(), next(), next()) * jitter + DVec3::splat(0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_are_found() {
        for i in 0..400u64 {
            let r = |k: u64| (scatter(17 + 3 * i + k) >> 11) as f64 / (1u64 << 53) as f64 * 40.0 - 20.0;
            let p = DVec3::new(r(0), r(1), r(2));
            let mut all = Vec::new();
            let cell = p.floor();
            for z in -4..=4 {
                for y in -4..=4 {
                    for x in -4..=4 {
                        let at = cell + DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                        all.push((at + feature(at, 1.0, 5) - p).length());
                    }
                }
            }
            all.sort_by(f64::total_cmp);
            let got = distances(p, 1.0, 5);
            assert!((got[0] - all[0]).abs() < 1e-9 && (got[1] - all[1]).abs() < 1e-9, "{p}: {got:?} {:?}", &all[..2]);
        }
    }

    #[test]
    fn without_jitter_points_stand_in_the_cells_middles() {
        let [near, second] = distances(DVec3::new(7.5, -2.5, 0.75), 0.0, 9);
        assert!((near - 0.25).abs() < 1e-12 && (second - 0.75).abs() < 1e-12);
        assert!(distances(DVec3::splat(f64::NAN), 1.0, 0)[0].is_finite());
        assert!(distances(DVec3::splat(1e300), 1.0, 0)[0].is_finite());
    }
}
