//! Guiding fields as files: magic number, version, texts, lists, checksum. A change of the format, or of what its
//! numbers mean, raises [`FORMAT`]'s version.

use super::mixture::{LOBES, LocalMixture, Mixture};
use super::{Benefit, GuidingField, GuidingLeaf, Node};
use crate::integrator::state_file::{Reader, Record, StateFileError, StateFormat, Writer, record};
use glam::DVec3;
use std::io::{self, Read, Write};

/// The format of guiding fields.
const FORMAT: StateFormat =
    StateFormat { magic: *b"\x89PGF\r\n\x1a\n", version: 1, content: "a field of path guiding" };

/// The most bytes of texts, which no file of this program reaches.
const MOST_TEXT: u64 = 1 << 26;

impl GuidingField {
    /// Writes the field, with texts that say what it was learnt for. All numbers keep their bits.
    ///
    /// # Errors
    /// Those of the output.
    pub fn write(&self, texts: &[(String, String)], mut out: impl Write) -> io::Result<()> {
        let mut writer = Writer::begin(&mut out, FORMAT)?;
        (texts.len() as u64).put(&mut writer)?;
        for text in texts.iter().flat_map(|(key, text)| [key, text]) {
            (text.len() as u64).put(&mut writer)?;
            writer.bytes(text.as_bytes())?;
        }
        writer.list(&self.nodes)?;
        writer.list(&self.leaves)?;
        writer.finish()
    }

    /// Reads a file of `length` bytes: its texts and the field. The memory is a small multiple of this length. Any
    /// bytes give a field or an error.
    ///
    /// # Errors
    /// [`StateFileError`] names the reason.
    pub fn read(mut input: impl Read, length: u64) -> Result<(Vec<(String, String)>, GuidingField), StateFileError> {
        let mut reader = Reader::begin(&mut input, length, FORMAT)?;
        let (mut texts, mut left) = (Vec::new(), length.min(MOST_TEXT));
        for _ in 0..u64::take(&mut reader)? {
            texts.push((text(&mut reader, &mut left)?, text(&mut reader, &mut left)?));
        }
        let (nodes, leaves) = (reader.list()?, reader.list()?);
        reader.finish()?;
        let field = GuidingField { nodes, leaves, benefit: Benefit::default() };
        if field.has_valid_numbers() { Ok((texts, field)) } else { Err(StateFileError::Damaged) }
    }

    /// Whether all numbers of nodes and leaves are those of existing ones, so that each search ends at a cell.
    fn has_valid_numbers(&self) -> bool {
        let has_node = |number: usize| number < self.nodes.len();
        self.nodes.iter().enumerate().all(|(number, node)| match *node {
            Node::Division { axis, above, .. } => {
                axis < 3 && has_node(number + 1) && above as usize > number && has_node(above as usize)
            }
            Node::Cell(leaf) => leaf.is_none_or(|leaf| (leaf as usize) < self.leaves.len()),
        }) && (self.leaves.is_empty() || has_node(0))
    }
}

/// A text: its length and its bytes, of `left` that may come.
fn text(reader: &mut Reader, left: &mut u64) -> Result<String, StateFileError> {
    let length = u64::take(reader)?;
    *left = left.checked_sub(length).ok_or(StateFileError::CutOff)?;
    let bytes = (0..length).map(|_| u8::take(reader)).collect::<Result<Vec<u8>, StateFileError>>()?;
    String::from_utf8(bytes).map_err(|_| StateFileError::Damaged)
}

/// The number of the record of a cell that guides, and of one that doesn't. Less are axes.
const CELL: u8 = 3;
const NO_CELL: u8 = 4;

/// The axis or kind, the place, and the number of the node above or of the leaf.
impl Record for Node {
    const BYTES: u64 = u8::BYTES + f32::BYTES + u32::BYTES;

    fn put(&self, writer: &mut Writer) -> io::Result<()> {
        let (kind, at, number) = match *self {
            Node::Division { axis, at, above } => (axis, at, above),
            Node::Cell(Some(leaf)) => (CELL, 0.0, leaf),
            Node::Cell(None) => (NO_CELL, 0.0, 0),
        };
        kind.put(writer)?;
        at.put(writer)?;
        number.put(writer)
    }

    fn take(reader: &mut Reader) -> Result<Node, StateFileError> {
        let (kind, at, number) = (u8::take(reader)?, f32::take(reader)?, u32::take(reader)?);
        match kind {
            0..CELL => Ok(Node::Division { axis: kind, at, above: number }),
            CELL => Ok(Node::Cell(Some(number))),
            NO_CELL => Ok(Node::Cell(None)),
            _ => Err(StateFileError::Damaged),
        }
    }
}

record!(GuidingLeaf, GuidingLeaf { probability, mixture }, [probability: f64, mixture: Mixture]);

record!(
    Mixture,
    Mixture { pivot, at_pivot, inverse_distances },
    [pivot: DVec3, at_pivot: LocalMixture, inverse_distances: [f32; LOBES]]
);

record!(
    LocalMixture,
    LocalMixture { shares, means, kappas, peaks },
    [shares: [f32; LOBES], means: [[f32; LOBES]; 3], kappas: [f32; LOBES], peaks: [f32; LOBES]]
);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::material::{Material, Phong};
    use crate::math::Rgb;
    use crate::render::{Job, Preparation, learn_guiding, render, render_from};
    use crate::scene::{
        Extrinsics, FilmSettings, Guiding, Intrinsics, Node as SceneNode, PathSettings, Sampling, Scene,
    };
    use crate::shape::{Cuboid, Shape, Sphere};
    use crate::world::World;
    use glam::Vec3;
    use std::ops::ControlFlow;
    use std::sync::{Arc, Mutex};

    /// A lamp above a block, which hides it, over a floor.
    fn world_and_job() -> (World, Job) {
        let mut scene = Scene::default();
        let lamp = Phong { kd: Rgb::BLACK, emission: Rgb::gray(50.0), ..Phong::default() };
        let grey = Phong { kd: Rgb::gray(0.6), ks: Rgb::BLACK, ..Phong::default() };
        scene.materials = vec![Material::new("grey", grey), Material::new("lamp", lamp)];
        let block = |min: [f32; 3], max: [f32; 3]| Shape::Box(Cuboid { min: min.into(), max: max.into() });
        let mut objects = vec![
            SceneNode::from(block([-2.0, -1.1, -2.0], [2.0, -1.0, 2.0])),
            SceneNode::from(block([-2.0, -1.0, -2.1], [2.0, 3.0, -2.0])),
            SceneNode::from(block([-0.6, 0.8, -0.6], [0.6, 0.9, 0.6])),
            SceneNode::from(Shape::Sphere(Sphere { center: Vec3::new(0.0, 1.3, 0.0), radius: 0.2 })),
        ];
        for (number, object) in objects.iter_mut().enumerate() {
            object.material = Some(u32::from(number == 3));
        }
        scene.nodes = objects;
        let intrinsics = Intrinsics { width: 24, height: 18, ..Intrinsics::default() };
        let extrinsics = Extrinsics { eye: Vec3::new(0.0, 0.5, 5.0).as_dvec3(), ..Extrinsics::default() };
        let film = FilmSettings { sampling: Sampling::Sampled(4), ..FilmSettings::default() };
        let settings = PathSettings { guiding: Guiding::On, ..PathSettings::DEFAULT };
        let job = Job::new(Camera::new(&intrinsics, &extrinsics).unwrap(), film, settings);
        (World::build(scene).unwrap(), job)
    }

    fn learnt_field() -> GuidingField {
        let (world, job) = world_and_job();
        let ControlFlow::Continue(field) = learn_guiding(&world, &job, &()).unwrap() else { unreachable!() };
        field
    }

    /// A picture of a field that was learnt before has the bytes of one that learns it.
    #[test]
    fn pictures_of_a_field_are_those_that_learn_it() {
        let (world, job) = world_and_job();
        let field = Arc::new(read(&bytes(&learnt_field())).unwrap().1);
        let heard = Mutex::new(Vec::new());
        let hear = |field: &Arc<GuidingField>| heard.lock().unwrap().push(bytes(field));
        let preparation = Preparation { guiding: Some(&field), learnt: Some(&hear), ..Preparation::default() };
        let given = render_from(&world, &job, preparation, None, &()).unwrap().picture;
        assert_eq!(given, render(&world, &job, &()).unwrap().picture);
        assert!(heard.lock().unwrap().is_empty(), "nothing is learnt");
        let preparation = Preparation { guiding: None, ..preparation };
        assert_eq!(given, render_from(&world, &job, preparation, None, &()).unwrap().picture);
        assert_eq!(*heard.lock().unwrap(), [bytes(&field)]);
        let empty = Arc::new(GuidingField::default());
        let preparation = Preparation { guiding: Some(&empty), ..Preparation::default() };
        assert_ne!(given, render_from(&world, &job, preparation, None, &()).unwrap().picture);
    }

    fn bytes(field: &GuidingField) -> Vec<u8> {
        let mut file = Vec::new();
        field.write(&[("size".into(), "64 48".into()), ("empty".into(), String::new())], &mut file).unwrap();
        file
    }

    fn read(file: &[u8]) -> Result<(Vec<(String, String)>, GuidingField), StateFileError> {
        GuidingField::read(file, file.len() as u64)
    }

    /// A field that is read gives the same directions, and writes the same file.
    #[test]
    fn fields_keep_their_bits() {
        let field = learnt_field();
        assert!(field.cell_count() > 1, "the field has cells");
        let file = bytes(&field);
        let (texts, read) = read(&file).unwrap();
        assert_eq!(texts, [("size".to_owned(), "64 48".to_owned()), ("empty".to_owned(), String::new())]);
        assert_eq!(bytes(&read), file);
        for point in [Vec3::ZERO, Vec3::ONE, Vec3::new(-0.7, 0.2, 0.4)] {
            let directions = [&field, &read]
                .map(|field| field.at(point.as_dvec3(), None).map(|vertex| vertex.sample([0.3, 0.7]).to_array()));
            assert_eq!(directions[0], directions[1]);
        }
    }

    /// A field that guides nowhere is one, too.
    #[test]
    fn an_empty_field_is_a_field() {
        let file = bytes(&GuidingField::default());
        assert_eq!(read(&file).unwrap().1.cell_count(), 0);
    }

    /// Every cut and every flipped byte is an error, and so is another format.
    #[test]
    fn damaged_files_are_refused() {
        let file = bytes(&learnt_field());
        for length in (0..file.len()).step_by(7) {
            assert!(read(&file[..length]).is_err(), "{length}");
        }
        for at in (0..file.len()).step_by(11) {
            let mut changed = file.clone();
            changed[at] ^= 0x40;
            assert!(read(&changed).is_err(), "{at}");
        }
        assert!(matches!(read(b"\x89RAD\r\n\x1a\n\x01\0\0\0"), Err(StateFileError::Foreign { .. })));
        let mut newer = file;
        newer[8] = 2;
        assert!(matches!(read(&newer), Err(StateFileError::Version { found: 2, known: 1 })));
    }
}
