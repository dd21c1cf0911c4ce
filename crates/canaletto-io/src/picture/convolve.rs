//! Separable convolution of one channel. Values outside the picture are those of its nearest edge pixel.

use canaletto_parallel::prelude::*;

/// A kernel of odd length centred on its middle, for rows and for columns.
pub(super) struct Kernel {
    pub(super) x: Vec<f64>,
    pub(super) y: Vec<f64>,
}

/// The Gaussian with standard deviation `sigma` in pixels, cut off at `radius` and normalised to the sum 1.
pub(super) fn gaussian(sigma: f64, radius: usize) -> Vec<f64> {
    let weights: Vec<f64> = offsets(radius).map(|x| libm::exp(-x * x / (2.0 * sigma * sigma))).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| w / sum).collect()
}

/// The integers from −`radius` to `radius`.
pub(super) fn offsets(radius: usize) -> impl Iterator<Item = f64> {
    (0..=2 * radius).map(move |i| i as f64 - radius as f64)
}

/// The channel convolved with the kernel along both axes.
pub(super) fn convolve(data: &[f64], width: usize, kernel: &Kernel) -> Vec<f64> {
    let height = data.len() / width;
    let mut rows = vec![0.0; data.len()];
    rows.par_chunks_mut(width).zip(data.par_chunks(width)).for_each(|(out, row)| {
        let radius = kernel.x.len() / 2;
        for (x, out) in out.iter_mut().enumerate() {
            let at = |i: usize| row[(x + i).saturating_sub(radius).min(width - 1)];
            *out = kernel.x.iter().enumerate().map(|(i, weight)| weight * at(i)).sum();
        }
    });
    let mut columns = vec![0.0; data.len()];
    columns.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        let radius = kernel.y.len() / 2;
        for (i, weight) in kernel.y.iter().enumerate() {
            let from = (y + i).saturating_sub(radius).min(height - 1) * width;
            out.iter_mut().zip(&rows[from..from + width]).for_each(|(out, v)| *out += weight * v);
        }
    });
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_becomes_the_kernel_and_edges_go_on() {
        let mut data = vec![0.0; 49];
        data[24] = 1.0;
        let kernel = Kernel { x: vec![1.0, 2.0, 3.0], y: vec![10.0, 0.0, -10.0] };
        let out = convolve(&data, 7, &kernel);
        assert_eq!((out[16], out[17], out[18]), (-30.0, -20.0, -10.0));
        assert_eq!((out[30], out[32]), (30.0, 10.0));
        let flat = Kernel { x: gaussian(1.5, 5), y: gaussian(1.5, 5) };
        assert!(convolve(&[0.7; 12], 4, &flat).iter().all(|v| (v - 0.7).abs() < 1e-12));
    }
}
