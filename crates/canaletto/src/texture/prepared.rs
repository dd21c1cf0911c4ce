//! The runtime form of textures.

use super::grid::{GridMap, GridTexture};
use super::image_map::ImageMap;
use super::level::Level;
use super::procedural::Computed;
use super::pyramid::{Header, Pyramid, Weighing};
use super::{ColorSpace, Image, ImageTexture, Prefilter, Texture, TextureKind};
use glam::DVec3;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// A place of a texture, and its differences to the neighbouring pixel samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lookup {
    /// (u, v, any number) for textures of a rectangle, u for those of a line, a point for those of space.
    pub at: DVec3,
    /// The difference of `at` to the sample of the next pixel to the right. If `dx` and `dy` are zero, the texture is
    /// evaluated at a point, without a prefilter.
    pub dx: DVec3,
    /// The difference of `at` to the sample of the next pixel above.
    pub dy: DVec3,
}

impl Lookup {
    /// A point without a footprint.
    pub fn point(at: DVec3) -> Lookup {
        Lookup { at, ..Lookup::default() }
    }
}

/// The place and the footprint of a lookup on an image, for explanations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// The place on the image in texels, (0, 0) the upper left corner of the first one.
    pub texel: [f64; 2],
    /// The image's width and height in texels.
    pub size: [u32; 2],
    /// The longer and the shorter radius, in texels, of the ellipse that the pixel sample covers.
    pub radii: [f64; 2],
    /// The level of the pyramid that is used: 0 is the image itself, and each level has half the texels per side of the
    /// one before. Below 0 texels are larger than pixels.
    pub level: f64,
}

/// The runtime form of a texture.
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
    VertexColor,
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
            Kind::VertexColor => [1.0; 4],
        }
    }

    /// Whether the texture's values are those of the surface's vertices. A lookup doesn't tell them.
    #[inline]
    pub fn is_vertex_color(&self) -> bool {
        matches!(self.kind, Kind::VertexColor)
    }

    /// [`PreparedTexture::eval`] for a target that is a colour. Raw numbers ([`ColorSpace::Raw`]) fade to 0 where their
    /// image ends in a transparent outside. For a colour, alpha expresses this instead.
    pub fn color(&self, lookup: &Lookup) -> [f32; 4] {
        match &self.kind {
            Kind::Image(map) => map.color(lookup),
            Kind::Grid(map) => map.color(lookup),
            _ => self.eval(lookup),
        }
    }

    /// The distance between texels along u and v; none for a texture without texels.
    pub fn spacing(&self) -> Option<[f64; 2]> {
        match &self.kind {
            Kind::Image(map) => Some(map.spacing()),
            Kind::Grid(map) => Some(map.spacing()),
            Kind::Constant(_) | Kind::Computed(_) | Kind::VertexColor => None,
        }
    }

    /// The footprint of a lookup on the texture's image; none for a texture without an image.
    pub fn footprint(&self, lookup: &Lookup) -> Option<Footprint> {
        match &self.kind {
            Kind::Image(map) => Some(map.footprint(lookup)),
            _ => None,
        }
    }

    /// The runtime form of textures. Images are moved into them, and shared between textures of one image.
    ///
    /// # Errors
    /// The first fault found.
    pub fn resolve(images: Vec<Image>, textures: &[Texture]) -> Result<Vec<PreparedTexture>, Unresolved> {
        for image in &images {
            image.check().map_err(|problem| Unresolved::Invalid {
                object: format!("image \"{}\"", image.name),
                problem: problem.to_string(),
            })?;
        }
        let mut store = Store::new(images, textures);
        textures.iter().map(|texture| store.pattern(texture)).collect()
    }
}

/// The reason why a texture can't be made.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unresolved {
    /// A number is out of range.
    Invalid {
        /// The texture's or image's name.
        object: String,
        /// The fault and the expected value.
        problem: String,
    },
    /// An index refers to nothing.
    Missing {
        /// The texture's name.
        object: String,
        /// "image" or "texture".
        what: &'static str,
        /// The index.
        index: u32,
        /// The number of existing objects.
        count: usize,
    },
}

/// The images of a scene while its textures are made.
struct Store {
    images: Vec<(Header, Arc<Level>)>,
    pyramids: HashMap<(u32, ColorSpace), Arc<Pyramid>>,
    /// The pyramids that need coarser levels.
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
                function.check().map_err(|problem| Unresolved::Invalid {
                    object: format!("texture \"{}\"", texture.name),
                    problem: problem.to_string(),
                })?;
                Kind::Computed(Box::new(Computed::new(function)))
            }
            TextureKind::Grid(grid) => Kind::Grid(self.grid(texture, grid)?),
            TextureKind::VertexColor => Kind::VertexColor,
            TextureKind::Image(image) => Kind::Image(ImageMap::new(self.pyramid(texture, image)?, image)),
        };
        Ok(PreparedTexture { kind })
    }

    /// The image that a texture refers to.
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
