//! The sums of a tile, in `f64`.

use super::{Layer, Picture};
use crate::math::{Rgb, saturate};

/// A sum of weighted colours.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WeightedSum {
    color: [f64; 3],
    weight: f64,
}

impl WeightedSum {
    /// Adds a colour.
    #[inline]
    pub(crate) fn add(&mut self, color: Rgb, weight: f64) {
        for (sum, c) in self.color.iter_mut().zip(color.to_array()) {
            *sum += weight * f64::from(c);
        }
        self.weight += weight;
    }

    /// The sum of the weights.
    pub(crate) fn weight(&self) -> f64 {
        self.weight
    }

    /// The weighted mean of the colours.
    #[inline]
    pub(crate) fn mean(&self) -> Rgb {
        Rgb::from(self.color.map(|c| (c / self.weight) as f32)).saturated()
    }
}

/// The rule by which the values of a layer accumulate where a pixel has several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Accumulation {
    /// The first values remain. Nothing else is added.
    First,
    /// Weighted values are added; the layer holds their mean, with the weights of the picture's samples.
    Mean,
    /// Values are added.
    Sum,
    /// The largest value remains.
    Largest,
}

/// The sums of one layer.
#[derive(Clone, Debug)]
struct LayerSums {
    accumulation: Accumulation,
    channels: usize,
    values: Vec<f64>,
}

/// The sums of a tile's pixels and layers.
#[derive(Clone, Debug)]
pub(crate) struct TileBuffer {
    /// x and y from the picture's upper left corner, width and height, in pixels.
    area: [u32; 4],
    pixels: Vec<WeightedSum>,
    layers: Vec<LayerSums>,
}

impl TileBuffer {
    /// An empty buffer, with the number of channels and the rule of each layer.
    pub(crate) fn new(area: [u32; 4], layers: impl IntoIterator<Item = (usize, Accumulation)>) -> TileBuffer {
        let layers = layers.into_iter();
        let layers =
            layers.map(|(channels, accumulation)| LayerSums { accumulation, channels, values: Vec::new() }).collect();
        let mut buffer = TileBuffer { area, pixels: Vec::new(), layers };
        buffer.reset(area);
        buffer
    }

    /// Removes all sums; the buffer is then one of this area.
    pub(crate) fn reset(&mut self, area: [u32; 4]) {
        let pixels = area[2] as usize * area[3] as usize;
        self.area = area;
        self.pixels.clear();
        self.pixels.resize(pixels, WeightedSum::default());
        for layer in &mut self.layers {
            layer.values.clear();
            layer.values.resize(pixels * layer.channels, 0.0);
        }
    }

    /// x and y from the picture's upper left corner, width and height, in pixels.
    pub(crate) fn area(&self) -> [u32; 4] {
        self.area
    }

    /// Adds the colour of a sample to pixel number `pixel`, in rows from the upper left.
    #[inline]
    pub(crate) fn add(&mut self, pixel: usize, color: Rgb, weight: f64) {
        self.pixels[pixel].add(color, weight);
    }

    /// Adds values of a layer at a pixel.
    pub(crate) fn add_to_layer(&mut self, layer: usize, pixel: usize, values: &[f64]) {
        let LayerSums { accumulation, channels, values: sums } = &mut self.layers[layer];
        let sums = &mut sums[pixel * *channels..][..*channels];
        for (sum, value) in sums.iter_mut().zip(values) {
            match accumulation {
                Accumulation::First => *sum = *value,
                Accumulation::Mean | Accumulation::Sum => *sum += value,
                Accumulation::Largest => *sum = sum.max(*value),
            }
        }
    }

    /// Writes the tile into a picture whose upper left corner is the picture's pixel `corner`.
    pub(crate) fn write(&self, picture: &mut Picture, corner: [u32; 2]) {
        let [x, y, width, height] = self.area;
        let (width, stride) = (width as usize, picture.width as usize);
        let start = (y - corner[1]) as usize * stride + (x - corner[0]) as usize;
        for row in 0..height as usize {
            let (from, to) = (row * width, start + row * stride);
            for (pixel, sum) in picture.pixels[to..to + width].iter_mut().zip(&self.pixels[from..]) {
                *pixel = sum.mean();
            }
            for (layer, sums) in picture.layers.iter_mut().zip(&self.layers) {
                sums.write_row(layer, &self.pixels[from..from + width], from, to);
            }
        }
    }

    /// Writes layer number `layer` into the layer of a picture of this width, whose upper left corner is the picture's
    /// pixel `corner`.
    pub(crate) fn write_layer(&self, layer: usize, to: &mut Layer, stride: u32, corner: [u32; 2]) {
        let [x, y, width, height] = self.area;
        for row in 0..height {
            let from = (row * width) as usize;
            let start = (y - corner[1] + row) as usize * stride as usize + (x - corner[0]) as usize;
            self.layers[layer].write_row(to, &self.pixels[from..from + width as usize], from, start);
        }
    }

    /// The number of pixels.
    pub(crate) fn len(&self) -> usize {
        self.pixels.len()
    }
}

impl LayerSums {
    /// Writes the pixels from number `from` on to a layer, from its pixel `to` on.
    fn write_row(&self, layer: &mut Layer, pixels: &[WeightedSum], from: usize, to: usize) {
        let n = self.channels;
        let values = self.values[from * n..].chunks_exact(n);
        for (i, (values, pixel)) in values.zip(pixels).enumerate() {
            for (to, &value) in layer.data[(to + i) * n..][..n].iter_mut().zip(values) {
                *to = match self.accumulation {
                    Accumulation::Mean => saturate((value / pixel.weight) as f32),
                    _ => value as f32,
                };
            }
            if let Some(id) = layer.ids.get_mut(to + i) {
                *id = values[0] as u32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(name: &'static str, channels: &'static [&'static str], ids: bool) -> Layer {
        Layer { name, channels, data: vec![0.0; 6 * channels.len()], ids: vec![0; if ids { 6 } else { 0 }] }
    }

    #[test]
    fn values_accumulate_by_each_rule() {
        let rules = [
            (2, Accumulation::First),
            (1, Accumulation::Mean),
            (1, Accumulation::Sum),
            (1, Accumulation::Largest),
            (1, Accumulation::First),
        ];
        let mut buffer = TileBuffer::new([11, 21, 2, 1], rules);
        for (color, weight, value) in [(0.5, 1.0, 3.0), (0.25, 3.0, 1.0)] {
            for pixel in 0..2 {
                let scale = if pixel == 0 { 1.0 } else { 2.0 };
                buffer.add(pixel, Rgb::gray(color * scale as f32), weight);
                if weight == 1.0 {
                    buffer.add_to_layer(0, pixel, &[value * scale, -value]);
                    buffer.add_to_layer(4, pixel, &[16_777_217.0]);
                }
                buffer.add_to_layer(1, pixel, &[weight * value * scale]);
                buffer.add_to_layer(2, pixel, &[value * scale]);
                buffer.add_to_layer(3, pixel, &[value * scale]);
            }
        }
        let mut picture = Picture::new(3, 2);
        picture.layers = vec![
            layer("first", &["X", "Y"], false),
            layer("mean", &["X"], false),
            layer("sum", &["X"], false),
            layer("largest", &["X"], false),
            layer("id", &["X"], true),
        ];
        buffer.write(&mut picture, [10, 20]);
        // (0.5 + 3 · 0.25) / 4, at column 1 and 2 of row 1.
        let black = Rgb::BLACK;
        assert_eq!(picture.pixels, [black, black, black, black, Rgb::gray(0.3125), Rgb::gray(0.625)]);
        let of = |name: &str| picture.layer(name).unwrap().data[..].to_vec();
        assert_eq!(of("first")[8..], [3.0, -3.0, 6.0, -3.0]);
        assert_eq!(of("mean")[4..], [1.5, 3.0]);
        assert_eq!(of("sum")[4..], [4.0, 8.0]);
        assert_eq!(of("largest")[4..], [3.0, 6.0]);
        assert_eq!(picture.layer("id").unwrap().ids, [0, 0, 0, 0, 16_777_217, 16_777_217]);
        assert!(of("first")[..8].iter().all(|v| *v == 0.0));
    }
}
