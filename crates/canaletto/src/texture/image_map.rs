//! Image textures: from coordinates and a footprint to a filtered colour.
//!
//! EWA follows Heckbert (1989) in taking the mean over an ellipse, on the level of the pyramid where the shorter radius
//! is 2 to 4 texels. Deviations:
//!
//! - The weight is (1 − r²)² instead of a truncated Gaussian: nearly equal, without a table and zero at the rim.
//! - The width that the level's texels have themselves is subtracted.
//! - Adjacent levels are blended over the last quarter of a level.

use super::codec::Tap;
use super::ellipse::Ellipse;
use super::kernel::{variance, weights};
use super::pyramid::Pyramid;
use super::wrap::{Axis, Wrap};
use super::{Filter, Footprint, ImageTexture, Lookup, Prefilter};
use std::sync::Arc;

/// The largest ratio of an ellipse's radii. Thinner ellipses are made wider, so that the cost of a lookup is bounded.
const MAX_ECCENTRICITY: f64 = 16.0;
/// The least shorter radius, in texels of the level, of an ellipse that is summed on a coarser level.
const FINEST: f64 = 2.0;
/// The radius in texels above which a footprint on the coarsest level is not summed but approximated.
const WIDEST: f64 = 32.0;
/// The ratio of the squared radius of the weight (1 − r²)² to its variance in each direction.
const SPREAD: f64 = 8.0;

/// An image with its filters.
#[derive(Debug)]
pub(super) struct ImageMap {
    pyramid: Arc<Pyramid>,
    filter: Filter,
    prefilter: Prefilter,
    axes: [Axis; 2],
    /// Whether the outside is transparent along an axis.
    ends: bool,
}

/// A lookup in texels of the finest level.
struct Place {
    at: [f64; 2],
    dx: [f64; 2],
    dy: [f64; 2],
}

/// A weighted sum of texels under construction.
struct Sum<'a> {
    pyramid: &'a Pyramid,
    level: usize,
    taps: [Tap; 32],
    count: usize,
    color: [f32; 4],
    weight: f32,
}

impl Sum<'_> {
    fn new(pyramid: &Pyramid, level: usize) -> Sum<'_> {
        Sum { pyramid, level, taps: [(0, 0.0); 32], count: 0, color: [0.0; 4], weight: 0.0 }
    }

    #[inline]
    fn add(&mut self, index: u32, weight: f32) {
        if self.count == self.taps.len() {
            self.flush();
        }
        self.taps[self.count] = (index, weight);
        self.count += 1;
    }

    fn flush(&mut self) {
        let samples = &self.pyramid.level(self.level).samples;
        let part = self.pyramid.codec.sum(samples, &self.taps[..self.count]);
        self.color = std::array::from_fn(|i| self.color[i] + part[i]);
        self.count = 0;
    }

    /// Adds a texel outside the image.
    #[inline]
    fn add_outside(&mut self, black: bool, weight: f32) {
        if black {
            self.color[3] += weight;
        }
    }

    /// The weighted mean, if there is any weight.
    fn mean(mut self) -> [f32; 4] {
        self.flush();
        self.color.map(|v| v / self.weight)
    }

    fn total(mut self) -> [f32; 4] {
        self.flush();
        self.color
    }
}

impl ImageMap {
    pub(super) fn new(pyramid: Arc<Pyramid>, texture: &ImageTexture) -> ImageMap {
        let base = pyramid.level(0);
        let axis = |i: usize, size| Axis { wrap: texture.wrap[i], placement: texture.placement, size };
        let axes = [axis(0, base.width), axis(1, base.height)];
        let ends = texture.wrap.contains(&Wrap::Transparent);
        ImageMap { pyramid, filter: texture.filter, prefilter: texture.prefilter, axes, ends }
    }

    pub(super) fn eval(&self, lookup: &Lookup) -> [f32; 4] {
        let place = self.place(lookup);
        let still = lookup.dx.x == 0.0 && lookup.dx.y == 0.0 && lookup.dy.x == 0.0 && lookup.dy.y == 0.0;
        let sum = match self.prefilter {
            _ if still => self.reconstruct(0, self.filter, &place),
            Prefilter::None => self.reconstruct(0, self.filter, &place),
            Prefilter::Trilinear => self.trilinear(&place),
            Prefilter::Ewa => self.ewa(&place),
        };
        self.pyramid.codec.finish(sum, &self.pyramid.level(0).samples, self.ends)
    }

    pub(super) fn color(&self, lookup: &Lookup) -> [f32; 4] {
        let value = self.eval(lookup);
        if self.ends { self.pyramid.codec.uncovered(value) } else { value }
    }

    pub(super) fn spacing(&self) -> [f64; 2] {
        [0, 1].map(|i| 1.0 / self.axes[i].scale().max(1.0))
    }

    /// The place and the footprint of a lookup on the image.
    pub(super) fn footprint(&self, lookup: &Lookup) -> Footprint {
        let place = self.place(lookup);
        let ellipse = Ellipse::of(place.dx, place.dy);
        let radii = ellipse.radii();
        let level = match self.prefilter {
            Prefilter::None => 0.0,
            Prefilter::Trilinear => self.trilinear_level(&place),
            Prefilter::Ewa => self.ewa_level(radii),
        };
        Footprint { texel: place.at, size: [self.axes[0].size, self.axes[1].size], radii, level }
    }

    fn place(&self, lookup: &Lookup) -> Place {
        let [u, v] = &self.axes;
        let ((x, flip_x), (y, flip_y)) = (u.position(lookup.at.x), v.position(lookup.at.y));
        let (sx, sy) = (u.scale() * flip_x, v.scale() * flip_y);
        Place { at: [x, y], dx: [lookup.dx.x * sx, lookup.dx.y * sy], dy: [lookup.dy.x * sx, lookup.dy.y * sy] }
    }

    /// The value of a kernel over the texels of one level.
    fn reconstruct(&self, level: usize, filter: Filter, place: &Place) -> [f32; 4] {
        let ([x, y], [width, height]) = (self.on_level(level, place.at), self.size(level));
        let columns = weights(filter, x);
        let rows = weights(filter, y);
        let column = |i: usize| self.axes[0].texel(columns.first + i as i64, width);
        let columns_at: [Option<u32>; 4] = std::array::from_fn(|i| if i < columns.count { column(i) } else { None });
        let base = self.pyramid.level(level);
        let (mut taps, mut count, mut black) = ([(0, 0.0); 16], 0, 0.0);
        for (j, row_weight) in rows.weights.iter().enumerate().take(rows.count) {
            let row = self.axes[1].texel(rows.first + j as i64, height);
            for (i, at) in columns_at.iter().enumerate().take(columns.count) {
                let weight = columns.weights[i] * row_weight;
                match (at, row) {
                    (Some(x), Some(y)) => {
                        taps[count] = (base.index(*x, y), weight);
                        count += 1;
                    }
                    (x, y) if self.is_black(x.is_none(), y.is_none()) => black += weight,
                    _ => {}
                }
            }
        }
        let [r, g, b, a] = self.pyramid.codec.sum(&base.samples, &taps[..count]);
        [r, g, b, a + black]
    }

    /// Whether the outside, to the side or above and below, is black and not transparent.
    fn is_black(&self, beside: bool, beyond: bool) -> bool {
        (beside && self.axes[0].wrap == Wrap::Black) || (beyond && self.axes[1].wrap == Wrap::Black)
    }

    fn size(&self, level: usize) -> [u32; 2] {
        let level = self.pyramid.level(level);
        [level.width, level.height]
    }

    /// The texels of a level per texel of the finest one.
    fn ratio(&self, level: usize) -> [f64; 2] {
        let [width, height] = self.size(level);
        [f64::from(width) / f64::from(self.axes[0].size), f64::from(height) / f64::from(self.axes[1].size)]
    }

    fn on_level(&self, level: usize, at: [f64; 2]) -> [f64; 2] {
        if level == 0 {
            return at;
        }
        let [x, y] = self.ratio(level);
        [at[0] * x, at[1] * y]
    }

    /// The level of a trilinear lookup. It is below 0 where the image is magnified.
    fn trilinear_level(&self, place: &Place) -> f64 {
        let square = |d: [f64; 2]| d[0] * d[0] + d[1] * d[1];
        0.5 * libm::log2(square(place.dx).max(square(place.dy)))
    }

    /// Williams' trilinear filter: its width in all directions is the longer of the two derivatives.
    fn trilinear(&self, place: &Place) -> [f32; 4] {
        let level = self.trilinear_level(place);
        let top = self.pyramid.len() - 1;
        if level.is_nan() || level >= top as f64 + 1.0 {
            return self.wide(place);
        }
        if level <= 0.0 {
            return self.reconstruct(0, self.filter, place);
        }
        let below = (level.floor() as usize).min(top);
        let at = |level: usize| self.reconstruct(level, if level == 0 { self.filter } else { Filter::Bilinear }, place);
        if below == top { at(top) } else { mix(at(below), at(below + 1), (level - below as f64) as f32) }
    }

    /// The level on which an ellipse with these radii on the finest level is wide enough to be summed. It is below 0
    /// where even the finest level is too coarse.
    fn ewa_level(&self, [major, minor]: [f64; 2]) -> f64 {
        libm::log2(minor.max(major / MAX_ECCENTRICITY) / FINEST)
    }

    fn ewa(&self, place: &Place) -> [f32; 4] {
        let ellipse = Ellipse::of(place.dx, place.dy);
        let radii = ellipse.radii();
        let major = radii[0];
        if !major.is_finite() || !ellipse.xy.is_finite() {
            return self.wide(place);
        }
        // Magnified: the kernel of the texture, and a blend to the ellipse that is no wider than the kernel.
        if major <= 0.5 {
            return self.reconstruct(0, self.filter, place);
        }
        let ellipse = ellipse.at_least(major / MAX_ECCENTRICITY);
        let level = self.ewa_level(radii).max(0.0);
        let top = self.pyramid.len() - 1;
        let below = (level.floor().min(top as f64)) as usize;
        let mean = self.ellipse_mean(below, &ellipse, place);
        let further = (level - below as f64 - 0.75) * 4.0;
        if major < 1.0 {
            mix(self.reconstruct(0, self.filter, place), mean, (2.0 * major - 1.0) as f32)
        } else if further > 0.0 && below < top {
            mix(mean, self.ellipse_mean(below + 1, &ellipse, place), further.min(1.0) as f32)
        } else {
            mean
        }
    }

    /// The weighted mean of one level's texels in an ellipse, given on the finest level.
    fn ellipse_mean(&self, level: usize, ellipse: &Ellipse, place: &Place) -> [f32; 4] {
        let [scale_x, scale_y] = self.ratio(level);
        let ellipse = ellipse.scaled(scale_x, scale_y);
        let widen = if level == 0 {
            // Texels are points, and the kernel widens them. The minimum width ensures that every ellipse contains a
            // texel.
            (SPREAD * variance(self.filter)).max(2.0 / 3.0)
        } else {
            // Texels are means over squares, whose width is subtracted.
            let [_, minor] = ellipse.radii();
            (-SPREAD / 12.0).max(1.0 - minor * minor)
        };
        let Ellipse { xx, xy, yy } = ellipse.widened(widen);
        if level == self.pyramid.len() - 1 && xx.max(yy) > WIDEST * WIDEST {
            return self.wide(place);
        }
        let ([x, y], [width, height]) = (self.on_level(level, place.at), self.size(level));
        let base = self.pyramid.level(level);
        // r² = a dx² + b dx dy + c dy²
        let determinant = xx * yy - xy * xy;
        let (a, b, c) = ((yy / determinant) as f32, (-2.0 * xy / determinant) as f32, (xx / determinant) as f32);
        let tall = yy.sqrt();
        let mut sum = Sum::new(&self.pyramid, level);
        for j in (y - tall - 0.5).ceil() as i64..=(y + tall - 0.5).floor() as i64 {
            let dy = j as f64 + 0.5 - y;
            let row = self.axes[1].texel(j, height);
            let half = (determinant / yy * (1.0 - dy * dy / yy)).max(0.0).sqrt();
            let middle = x + xy / yy * dy - 0.5;
            let dy = dy as f32;
            for i in (middle - half).ceil() as i64..=(middle + half).floor() as i64 {
                let dx = (i as f64 + 0.5 - x) as f32;
                let rest = (1.0 - (a * dx * dx + (b * dx + c * dy) * dy)).max(0.0);
                let weight = rest * rest;
                sum.weight += weight;
                match (self.axes[0].texel(i, width), row) {
                    (Some(x), Some(y)) => sum.add(base.index(x, y), weight),
                    (x, y) => sum.add_outside(self.is_black(x.is_none(), y.is_none()), weight),
                }
            }
        }
        if sum.weight > 0.0 { sum.mean() } else { self.reconstruct(level, Filter::Bilinear, place) }
    }

    /// The mean of a footprint much larger than the image: the image's mean, and the outside.
    fn wide(&self, place: &Place) -> [f32; 4] {
        let radius = |i: usize| place.dx[i].abs().max(place.dy[i].abs()).max(0.5);
        let [u, v] = [0, 1].map(|i: usize| self.axes[i].coverage(place.at[i], radius(i)));
        let mut sum = Sum::new(&self.pyramid, self.pyramid.len() - 1);
        sum.add(0, (u * v) as f32);
        sum.add_outside(self.is_black(u < 1.0, v < 1.0), (1.0 - u * v) as f32);
        sum.total()
    }
}

fn mix(a: [f32; 4], b: [f32; 4], t: f32) -> [f32; 4] {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t)
}
