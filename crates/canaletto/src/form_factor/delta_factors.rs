//! The delta form factors of a hemicube's pixels (Cohen and Greenberg, *The Hemi-Cube*, 1985).
//!
//! The paper takes cos θ cos θ' / (π r²) at a pixel's centre times the pixel's area. Here each pixel has its integral,
//! so that the factors of a hemicube sum to 1.

use std::f64::consts::TAU;

/// The delta form factors of one hemicube: a cube of edge 2 around the point, of which the upper half counts.
#[derive(Clone, Debug)]
pub(super) struct DeltaFactors {
    side: usize,
    /// The top face, in rows.
    top: Vec<f64>,
    /// One side face, in rows from the horizon upwards.
    flank: Vec<f64>,
}

impl DeltaFactors {
    /// The factors for this even number of pixels along an edge of the top face.
    pub(super) fn new(side: u32) -> DeltaFactors {
        let half = side as usize / 2;
        let slope = |i: usize| i as f64 / half as f64 - 1.0;
        let top = pixels([side as usize; 2], |i, j| top_integral(slope(i), slope(j)));
        let flank = pixels([side as usize, half], |i, j| flank_integral(slope(i), slope(half + j)));
        DeltaFactors { side: side as usize, top, flank }
    }

    pub(super) fn top(&self, column: usize, row: usize) -> f64 {
        self.top[row * self.side + column]
    }

    pub(super) fn flank(&self, column: usize, row: usize) -> f64 {
        self.flank[row * self.side + column]
    }

    /// The largest factor of all pixels, that of the pixels around the normal.
    pub(super) fn largest(&self) -> f64 {
        self.top(self.side / 2, self.side / 2)
    }
}

/// The integrals over all pixels, from the integral from a fixed corner.
fn pixels([width, height]: [usize; 2], integral: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let corners: Vec<f64> =
        (0..=height).flat_map(|j| (0..=width).map(move |i| [i, j])).map(|[i, j]| integral(i, j)).collect();
    let corner = |i: usize, j: usize| corners[j * (width + 1) + i];
    let pixel = |i: usize, j: usize| (corner(i + 1, j + 1) - corner(i, j + 1)) - (corner(i + 1, j) - corner(i, j));
    (0..height).flat_map(|j| (0..width).map(move |i| [i, j])).map(|[i, j]| pixel(i, j)).collect()
}

/// ∫ over x and y of 1 / (π (x² + y² + 1)²), the factor of a place on the top face z = 1.
fn top_integral(x: f64, y: f64) -> f64 {
    let (a, b) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    (x / a * libm::atan(y / a) + y / b * libm::atan(x / b)) / TAU
}

/// ∫ over y and z of z / (π (1 + y² + z²)²), the factor of a place on the side face x = 1.
fn flank_integral(y: f64, z: f64) -> f64 {
    let a = (1.0 + z * z).sqrt();
    -libm::atan(y / a) / (TAU * a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::form_factor::point_to_polygon;
    use glam::DVec3;
    use std::f64::consts::PI;

    #[test]
    fn they_sum_to_one() {
        for side in [2, 4, 6, 62, 256, 512, 1024] {
            let delta = DeltaFactors::new(side);
            let sum = delta.top.iter().sum::<f64>() + 4.0 * delta.flank.iter().sum::<f64>();
            assert!((sum - 1.0).abs() < 1e-12, "{side}: {sum}");
            assert!(delta.top.iter().chain(&delta.flank).all(|f| *f > 0.0 && *f < delta.largest() * (1.0 + 1e-9)));
        }
    }

    /// Each pixel is a small square before the point.
    #[test]
    fn they_are_those_of_squares() {
        let (side, half) = (16, 8.0);
        let delta = DeltaFactors::new(side);
        let slope = |i: usize| i as f64 / half - 1.0;
        for row in 0..16 {
            for column in 0..16 {
                let [x, y] = [column, row].map(|i| [slope(i), slope(i + 1)]);
                let on_top = [(0, 0), (0, 1), (1, 1), (1, 0)].map(|(i, j)| DVec3::new(x[i], y[j], 1.0));
                let exact = point_to_polygon(DVec3::ZERO, DVec3::Z, &on_top);
                let ours = delta.top(column, row);
                assert!((ours - exact).abs() < 1e-15, "top {column} {row}: {ours} {exact}");
                if row >= 8 {
                    let on_flank = [(0, 0), (0, 1), (1, 1), (1, 0)].map(|(i, j)| DVec3::new(1.0, x[i], y[j]));
                    let exact = point_to_polygon(DVec3::ZERO, DVec3::Z, &on_flank);
                    let ours = delta.flank(column, row - 8);
                    assert!((ours - exact).abs() < 1e-15, "flank {column} {row}: {ours} {exact}");
                }
            }
        }
        // The paper's approximation at the centre, for pixels that are small enough.
        let delta = DeltaFactors::new(512);
        let centre = 1.0 / (PI * 256.0 * 256.0);
        assert!((delta.largest() / centre - 1.0).abs() < 1e-4);
    }
}
