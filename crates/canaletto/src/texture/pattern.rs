//! Textures ready to be looked up.

use super::image_map::ImageMap;
use super::raster::Raster;
use super::{ColorSpace, Image, ImageTexture, Texture, TextureKind};
use glam::DVec3;
use std::collections::HashMap;
use std::sync::Arc;

/// A place of a texture and how far apart the neighbouring pixel samples are there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lookup {
    /// (u, v, anything) for textures of a rectangle, u for those of a line, a point for those of space.
    pub at: DVec3,
    /// How `at` changes from this sample to the next pixel's to the right. Zero together with `dy`: the texture is
    /// taken at a point, without a prefilter.
    pub dx: DVec3,
    /// How `at` changes from this sample to the next pixel's above.
    pub dy: DVec3,
}

impl Lookup {
    /// A point without a footprint.
    pub fn point(at: DVec3) -> Lookup {
        Lookup { at, ..Lookup::default() }
    }
}

/// A texture ready to be looked up.
#[derive(Debug)]
pub struct Pattern {
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Constant([f32; 4]),
    Image(ImageMap),
}

impl Pattern {
    /// The texture's linear red, green, blue and alpha. Colours are not multiplied by alpha; where alpha is 0, they are
    /// 0.
    pub fn eval(&self, lookup: &Lookup) -> [f32; 4] {
        match &self.kind {
            Kind::Constant(value) => *value,
            Kind::Image(map) => map.eval(lookup),
        }
    }

    /// How far apart its texels are along u and v; nothing if it has none.
    pub fn spacing(&self) -> Option<[f64; 2]> {
        match &self.kind {
            Kind::Constant(_) => None,
            Kind::Image(map) => Some(map.spacing()),
        }
    }

    /// Makes the patterns of textures. Images are moved into them, and shared where several textures have the same one.
    ///
    /// # Errors
    /// The first thing that can't be.
    pub fn resolve(images: Vec<Image>, textures: &[Texture]) -> Result<Vec<Pattern>, Unresolved> {
        for image in &images {
            image
                .check()
                .map_err(|problem| Unresolved::Invalid { object: format!("image \"{}\"", image.name), problem })?;
        }
        let mut store = Store { images: images.into_iter().map(Arc::new).collect(), rasters: HashMap::new() };
        textures.iter().map(|texture| store.pattern(texture)).collect()
    }
}

/// Why a texture can't be made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unresolved {
    /// A number is out of range.
    Invalid {
        /// The texture's or image's name.
        object: String,
        /// What is wrong and what was expected.
        problem: String,
    },
    /// An index points at nothing.
    Missing {
        /// The texture's name.
        object: String,
        /// "image" or "texture".
        what: &'static str,
        /// The index.
        index: u32,
        /// How many there are.
        count: usize,
    },
}

/// The images of a scene while its textures are made.
struct Store {
    images: Vec<Arc<Image>>,
    rasters: HashMap<(u32, ColorSpace), Arc<Raster>>,
}

impl Store {
    fn pattern(&mut self, texture: &Texture) -> Result<Pattern, Unresolved> {
        let kind = match &texture.kind {
            TextureKind::Constant(value) => {
                if let Some(bad) = value.iter().find(|v| !v.is_finite()) {
                    let object = format!("texture \"{}\"", texture.name);
                    return Err(Unresolved::Invalid { object, problem: format!("its colour has the component {bad}") });
                }
                Kind::Constant(*value)
            }
            TextureKind::Image(image) => Kind::Image(ImageMap::new(self.raster(texture, image)?, image)),
        };
        Ok(Pattern { kind })
    }

    fn raster(&mut self, texture: &Texture, image: &ImageTexture) -> Result<Arc<Raster>, Unresolved> {
        let index = image.image;
        let found = self.images.get(index as usize).ok_or_else(|| Unresolved::Missing {
            object: format!("texture \"{}\"", texture.name),
            what: "image",
            index,
            count: self.images.len(),
        })?;
        let space = image.space.unwrap_or(found.space);
        let make = || Arc::new(Raster::new(Arc::clone(found), space));
        Ok(Arc::clone(self.rasters.entry((index, space)).or_insert_with(make)))
    }
}
