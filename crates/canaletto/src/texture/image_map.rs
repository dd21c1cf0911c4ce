//! Image textures: from coordinates to a filtered colour.

use super::raster::Raster;
use super::wrap::{Axis, Wrap};
use super::{Filter, ImageTexture, Lookup};
use std::sync::Arc;

/// An image with its filter.
#[derive(Debug)]
pub(super) struct ImageMap {
    raster: Arc<Raster>,
    filter: Filter,
    axes: [Axis; 2],
}

impl ImageMap {
    pub(super) fn new(raster: Arc<Raster>, texture: &ImageTexture) -> ImageMap {
        let axis = |i: usize, size| Axis { wrap: texture.wrap[i], placement: texture.placement, size };
        let axes = [axis(0, raster.width), axis(1, raster.height)];
        ImageMap { raster, filter: texture.filter, axes }
    }

    pub(super) fn eval(&self, lookup: &Lookup) -> [f32; 4] {
        let (x, y) = (self.axes[0].position(lookup.at.x), self.axes[1].position(lookup.at.y));
        let sum = match self.filter {
            Filter::Nearest => self.texel(x.floor() as i64, y.floor() as i64),
            Filter::Bilinear => {
                let (x0, y0) = ((x - 0.5).floor(), (y - 0.5).floor());
                let (fx, fy) = ((x - 0.5 - x0) as f32, (y - 0.5 - y0) as f32);
                let (i, j) = (x0 as i64, y0 as i64);
                let mix = |a: [f32; 4], b: [f32; 4], t: f32| -> [f32; 4] {
                    std::array::from_fn(|c| a[c] + (b[c] - a[c]) * t)
                };
                let top = mix(self.texel(i, j), self.texel(i + 1, j), fx);
                let bottom = mix(self.texel(i, j + 1), self.texel(i + 1, j + 1), fx);
                mix(top, bottom, fy)
            }
        };
        self.raster.finish(sum)
    }

    pub(super) fn spacing(&self) -> [f64; 2] {
        [0, 1].map(|i| 1.0 / self.axes[i].scale().max(1.0))
    }

    fn texel(&self, x: i64, y: i64) -> [f32; 4] {
        let [u, v] = &self.axes;
        match (u.texel(x, self.raster.width), v.texel(y, self.raster.height)) {
            (Some(x), Some(y)) => self.raster.texel(x, y),
            (None, _) if u.wrap == Wrap::Black => [0.0, 0.0, 0.0, 1.0],
            (_, None) if v.wrap == Wrap::Black => [0.0, 0.0, 0.0, 1.0],
            _ => [0.0; 4],
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::texture::*;
    use glam::DVec3;

    fn pattern(image: Image, texture: ImageTexture) -> Pattern {
        let texture = Texture { name: "t".into(), kind: TextureKind::Image(texture) };
        Pattern::resolve(vec![image], &[texture]).unwrap().remove(0)
    }

    #[test]
    fn corners_are_the_corner_texels_as_in_the_chapter() {
        let samples = Samples::F32(vec![1.0, 2.0, 3.0, 4.0]);
        let space = ColorSpace::Linear;
        let image =
            Image { name: "four".into(), width: 2, height: 2, channels: 1, samples, space, premultiplied: false };
        let pattern = pattern(image, ImageTexture::new(0));
        let at = |u, v| pattern.eval(&Lookup::point(DVec3::new(u, v, 0.0)));
        assert_eq!(at(0.0, 0.0), [1.0, 1.0, 1.0, 1.0]);
        assert_eq!(at(1.0, 0.0)[0], 2.0);
        assert_eq!(at(1.0, 1.0)[0], 4.0);
        assert_eq!(at(0.25, 0.5)[0], 2.25);
    }
}
