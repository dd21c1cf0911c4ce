//! Textures ready to be looked up.

use super::grid::{GridMap, GridTexture};
use super::image_map::ImageMap;
use super::level::Level;
use super::procedural::Computed;
use super::pyramid::{Header, Pyramid, Weighing};
use super::{ColorSpace, Image, ImageTexture, Prefilter, Texture, TextureKind};
use glam::DVec3;
use std::collections::{HashMap, HashSet};
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

/// Where a lookup lies on an image, for explanations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// The place on the image in texels, (0, 0) the upper left corner of the first one.
    pub texel: [f64; 2],
    /// The image's width and height in texels.
    pub size: [u32; 2],
    /// The longer and the shorter radius, in texels, of the ellipse that the pixel sample stands for.
    pub radii: [f64; 2],
    /// The level of the pyramid that it is taken from: 0 is the image itself, each level has half the texels of the one
    /// before. Below 0 texels are larger than pixels.
    pub level: f64,
}

/// A texture ready to be looked up.
#[derive(Debug)]
pub struct PreparedTexture {
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Constant([f32; 4]),
    Image(ImageMap),
    Grid(GridMap),
    Computed(Box<Computed>),
}

impl PreparedTexture {
    /// The texture's linear red, green, blue and alpha. Colours are not multiplied by alpha; where alpha is 0, they are
    /// 0.
    pub fn eval(&self, lookup: &Lookup) -> [f32; 4] {
        match &self.kind {
            Kind::Constant(value) => *value,
            Kind::Image(map) => map.eval(lookup),
            Kind::Grid(map) => map.eval(lookup),
            Kind::Computed(computed) => computed.eval(lookup),
        }
    }

    /// The same for a use that takes a colour: numbers as they stand ([`ColorSpace::Raw`]) fade to 0 where their image ends in
    /// nothing, but a colour has an alpha for that.
    pub fn color(&self, lookup: &Lookup) -> [f32; 4] {
        match &self.kind {
            Kind::Image(map) => map.color(lookup),
            Kind::Grid(map) => map.color(lookup),
            _ => self.eval(lookup),
        }
    }

    /// How far apart its texels are along u and v; nothing if it has none.
    pub fn spacing(&self) -> Option<[f64; 2]> {
        match &self.kind {
            Kind::Image(map) => Some(map.spacing()),
            Kind::Grid(map) => Some(map.spacing()),
            Kind::Constant(_) | Kind::Computed(_) => None,
        }
    }

    /// Where a lookup lies on the texture's image; nothing for a texture without one.
    pub fn footprint(&self, lookup: &Lookup) -> Option<Footprint> {
        match &self.kind {
            Kind::Image(map) => Some(map.footprint(lookup)),
            _ => None,
        }
    }

    /// Makes the patterns of textures. Images are moved into them, and shared where several textures have the same one.
    ///
    /// # Errors
    /// The first thing that can't be.
    pub fn resolve(images: Vec<Image>, textures: &[Texture]) -> Result<Vec<PreparedTexture>, Unresolved> {
        for image in &images {
            image
                .check()
                .map_err(|problem| Unresolved::Invalid { object: format!("image \"{}\"", image.name), problem })?;
        }
        let mut store = Store::new(images, textures);
        textures.iter().map(|texture| store.pattern(texture)).collect()
    }
}

/// Why a texture can't be made.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
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
    images: Vec<(Header, Arc<Level>)>,
    pyramids: HashMap<(u32, ColorSpace), Arc<Pyramid>>,
    /// Which pyramids need coarser levels.
    prefiltered: HashSet<(u32, ColorSpace)>,
}

impl Store {
    fn new(images: Vec<Image>, textures: &[Texture]) -> Store {
        let images: Vec<(Header, Arc<Level>)> =
            images.into_iter().map(Header::split).map(|(header, level)| (header, Arc::new(level))).collect();
        let needed = textures.iter().filter_map(|texture| match &texture.kind {
            TextureKind::Image(image) if image.prefilter != Prefilter::None => {
                let space = image.space.or(images.get(image.image as usize).map(|(header, _)| header.space))?;
                Some((image.image, space))
            }
            _ => None,
        });
        let prefiltered = needed.collect();
        Store { images, pyramids: HashMap::new(), prefiltered }
    }

    fn pattern(&mut self, texture: &Texture) -> Result<PreparedTexture, Unresolved> {
        let kind = match &texture.kind {
            TextureKind::Constant(value) => {
                if let Some(bad) = value.iter().find(|v| !v.is_finite()) {
                    let object = format!("texture \"{}\"", texture.name);
                    return Err(Unresolved::Invalid { object, problem: format!("its colour has the component {bad}") });
                }
                Kind::Constant(*value)
            }
            TextureKind::Procedural(function) => {
                let invalid =
                    |problem| Unresolved::Invalid { object: format!("texture \"{}\"", texture.name), problem };
                function.check().map_err(invalid)?;
                Kind::Computed(Box::new(Computed::new(function)))
            }
            TextureKind::Grid(grid) => Kind::Grid(self.grid(texture, grid)?),
            TextureKind::Image(image) => Kind::Image(ImageMap::new(self.pyramid(texture, image)?, image)),
        };
        Ok(PreparedTexture { kind })
    }

    /// The image that a texture names.
    fn image(&self, texture: &Texture, index: u32) -> Result<&(Header, Arc<Level>), Unresolved> {
        self.images.get(index as usize).ok_or_else(|| Unresolved::Missing {
            object: format!("texture \"{}\"", texture.name),
            what: "image",
            index,
            count: self.images.len(),
        })
    }

    fn grid(&self, texture: &Texture, grid: &GridTexture) -> Result<GridMap, Unresolved> {
        let (header, base) = self.image(texture, grid.image)?;
        if grid.slices == 0 || !base.height.is_multiple_of(grid.slices) {
            let problem = format!("its {} rows can't be cut into {} slices of one height", base.height, grid.slices);
            return Err(Unresolved::Invalid { object: format!("texture \"{}\"", texture.name), problem });
        }
        Ok(GridMap::new(base, header, grid))
    }

    fn pyramid(&mut self, texture: &Texture, image: &ImageTexture) -> Result<Arc<Pyramid>, Unresolved> {
        let index = image.image;
        let (header, base) = self.image(texture, index)?;
        let key = (index, image.space.unwrap_or(header.space));
        if let Some(pyramid) = self.pyramids.get(&key) {
            return Ok(Arc::clone(pyramid));
        }
        let pyramid = Pyramid::new(Arc::clone(base), header, key.1);
        let pyramid =
            Arc::new(if self.prefiltered.contains(&key) { pyramid.with_levels(Weighing::Even) } else { pyramid });
        self.pyramids.insert(key, Arc::clone(&pyramid));
        Ok(pyramid)
    }
}
