//! Displayable pictures of extra layers. An EXR holds the numbers themselves; a PNG needs a mapping to colours.

use canaletto::film::{Developer, Layer, Picture, develop, develop_with_alpha};
use canaletto::math::Rgb;
use canaletto::render::Aov;
use canaletto::scene::{Developing, Transfer};
use canaletto::{Aabb, Named};
use canaletto_io::picture::{Channel, Image};

/// The mappings, for the help.
pub(crate) const MAPPINGS: &str = "\
A PNG layer of --aov is a separate file, name.LAYER.png. Its numbers become colours:
  depth                  white (nearest) to dark grey (farthest in the picture); black without a hit
  normal                 n * 0.5 + 0.5
  position               0 to 1 across the scene's bounds along each axis
  uv                     the fractions of u and v as red and green
  object-id, material-id, element-id
                         a different colour for each number; black is the background
  tree-depth, cost, samples  grey, white is the picture's largest
  alpha                  grey, white is covered
  denoising-albedo       the albedo, with the --transfer of the picture
  denoising-normal, denoising-depth
                         as normal and depth
  the others             light, with --exposure, --tone and --transfer of the picture
An EXR holds all layers as channels of one file, with unchanged numbers: normal.X, depth.Z, object_id.X, ...";

/// A layer as a displayable picture, with the transfer curve of its values.
pub(crate) fn to_image(layer: &Layer, picture: &Picture, developing: &Developing, bounds: &Aabb) -> (Image, Transfer) {
    let aov = Aov::from_name(layer.name).unwrap_or(Aov::Cost);
    let pixels: Vec<Rgb> = match aov {
        Aov::Depth | Aov::DenoisingDepth => depth(&layer.data),
        Aov::Normal | Aov::DenoisingNormal => {
            triples(layer).map(|n| if n.is_black() { n } else { n.map(|v| v * 0.5 + 0.5) }).collect()
        }
        Aov::Position => position(layer, bounds),
        Aov::Uv => layer.data.chunks_exact(2).map(|uv| Rgb::new(fraction(uv[0]), fraction(uv[1]), 0.0)).collect(),
        Aov::ObjectId | Aov::MaterialId | Aov::ElementId => {
            (0..layer.data.len()).map(|i| id_color(layer.id(i))).collect()
        }
        Aov::DenoisingAlbedo => {
            let pixels = triples(layer).collect();
            let albedo = Picture { pixels, ..Picture::new(picture.width, picture.height) };
            let plain = Developing { transfer: developing.transfer, ..Developing::default() };
            return (rgb_image(picture, &develop(&albedo, &plain)), plain.transfer);
        }
        _ if aov.is_light() => {
            let light: Vec<Rgb> = triples(layer).collect();
            let shown = Developer::new(picture, developing).developed(&light);
            return (rgb_image(picture, &shown), developing.transfer);
        }
        _ => {
            let largest = layer.data.iter().copied().fold(0.0, f32::max).max(1.0);
            layer.data.chunks_exact(layer.channels.len()).map(|v| Rgb::gray(v[0] / largest)).collect()
        }
    };
    (rgb_image(picture, &pixels), Transfer::None)
}

/// The picture as display values, the top row first, with its alpha.
pub(crate) fn developed(picture: &Picture, developing: &Developing) -> Image {
    if picture.alpha.is_empty() {
        return rgb_image(picture, &develop(picture, developing));
    }
    let (colors, alpha): (Vec<Rgb>, Vec<f32>) = develop_with_alpha(picture, developing).into_iter().unzip();
    let mut image = rgb_image(picture, &colors);
    image.channels.push(Channel::new("A", alpha));
    image
}

fn rgb_image(picture: &Picture, pixels: &[Rgb]) -> Image {
    Image::from_rgb(picture.width, picture.height, pixels.iter().map(|c| c.to_array()))
}

fn triples(layer: &Layer) -> impl Iterator<Item = Rgb> {
    layer.data.chunks_exact(3).map(|v| Rgb::new(v[0], v[1], v[2]))
}

fn depth(data: &[f32]) -> Vec<Rgb> {
    let finite = || data.iter().copied().filter(|d| d.is_finite());
    let (near, far) = (finite().fold(f32::INFINITY, f32::min), finite().fold(f32::NEG_INFINITY, f32::max));
    let range = if far > near { far - near } else { 1.0 };
    let gray = |d: f32| if d.is_finite() { 1.0 - 0.9 * ((d - near) / range) } else { 0.0 };
    data.iter().map(|&d| Rgb::gray(gray(d))).collect()
}

fn position(layer: &Layer, bounds: &Aabb) -> Vec<Rgb> {
    let (low, high) = if bounds.is_empty() || !bounds.is_finite() {
        let lowest = triples(layer).fold(Rgb::BLACK, |a, b| Rgb::new(a.r.min(b.r), a.g.min(b.g), a.b.min(b.b)));
        let highest = triples(layer).fold(Rgb::BLACK, |a, b| Rgb::new(a.r.max(b.r), a.g.max(b.g), a.b.max(b.b)));
        (lowest.to_array(), highest.to_array())
    } else {
        (bounds.min.to_array(), bounds.max.to_array())
    };
    let map = |v: f32, axis: usize| {
        let size = high[axis] - low[axis];
        if size > 0.0 { ((v - low[axis]) / size).clamp(0.0, 1.0) } else { 0.5 }
    };
    let color = |p: Rgb| if p.is_black() { p } else { Rgb::new(map(p.r, 0), map(p.g, 1), map(p.b, 2)) };
    triples(layer).map(color).collect()
}

fn fraction(v: f32) -> f32 {
    if v.is_finite() && v != 1.0 { v - v.floor() } else { 1.0 }
}

/// A bright colour for an id, unlike those of adjacent ids; black for 0.
fn id_color(id: u32) -> Rgb {
    if id == 0 {
        return Rgb::BLACK;
    }
    // The finaliser of MurmurHash3.
    let mut hash = id;
    for factor in [0x85eb_ca6b, 0xc2b2_ae35] {
        hash = (hash ^ (hash >> 16)).wrapping_mul(factor);
    }
    hash ^= hash >> 13;
    let channel = |shift: u32| 0.25 + 0.75 * ((hash >> shift) & 0xff) as f32 / 255.0;
    let mut color = [channel(0), channel(8), channel(16)];
    // One component is lowered, which gives saturated colours instead of greys.
    color[(hash >> 24) as usize % 3] *= 0.3;
    Rgb::from(color)
}

#[cfg(test)]
mod tests {
    use super::*;
    use canaletto::camera::Camera;
    use canaletto::scene::{Extrinsics, FilmSettings, Intrinsics, Scene};
    use canaletto::world::World;
    use canaletto_io::picture::channel_names;

    #[test]
    fn depth_is_white_near_and_black_where_nothing_is() {
        let gray: Vec<f32> = depth(&[2.0, f32::INFINITY, 4.0]).iter().map(|c| c.r).collect();
        assert!(gray[0] == 1.0 && gray[1] == 0.0 && (gray[2] - 0.1).abs() < 1e-6);
        assert!(depth(&[f32::INFINITY]) == [Rgb::BLACK] && depth(&[3.0]) == [Rgb::gray(1.0)]);
    }

    #[test]
    fn ids_have_colours_of_their_own() {
        let mut seen = Vec::new();
        for id in 1..500 {
            let color = id_color(id).map(|v| (v * 255.0).round());
            assert!(!seen.contains(&color), "{id}");
            seen.push(color);
        }
    }

    /// Tests every layer of an empty world: no mapping divides by zero.
    #[test]
    fn nothing_maps_to_finite_values() {
        let world = World::build(Scene::default()).unwrap();
        let intrinsics = Intrinsics { width: 3, height: 2, ..Intrinsics::default() };
        let camera = Camera::new(&intrinsics, &Extrinsics::default()).unwrap();
        let mut job =
            canaletto::render::Job::new(camera, FilmSettings::default(), canaletto::scene::Integrator::default());
        job.aovs = canaletto::integrator::layers_of(&job.integrator, false);
        let picture = canaletto::render::render(&world, &job, &()).unwrap().picture;
        let names: Vec<String> =
            Image::from_picture(&picture).channels.into_iter().map(|channel| channel.name).collect();
        assert_eq!(names.len(), 3 + 1 + 3 + 3 + 2 + 1 + 1 + 1 + 7 * 3 + 1 + 1 + 1 + 3 + 3 + 3 + 1);
        assert_eq!(names, channel_names(false, &job.aovs));
        for layer in &picture.layers {
            let (image, _) = to_image(layer, &picture, &job.developing(), &world.bounds());
            assert!(image.channels.iter().all(|c| c.data.iter().all(|v| (0.0..=1.0).contains(v))), "{}", layer.name);
        }
    }
}
