//! Parts of a scene that an integrator leaves out of the picture.

use super::description::preparable;
use crate::Named;
use crate::job::{Job, PlacedJob};
use crate::material::PreparedMaterial;
use crate::math::Rgb;
use crate::world::World;
use std::fmt;

/// A part of a scene that an integrator leaves out.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Omission {
    /// The light that materials emit is seen, but reaches no other surface.
    EmissionAsLight {
        /// The name of the integrator.
        integrator: &'static str,
        /// The names of the materials, in the scene's order.
        materials: Vec<String>,
    },
    /// Media in bodies absorb and scatter nothing.
    Media {
        /// The name of the integrator.
        integrator: &'static str,
        /// The names of the materials, in the scene's order.
        materials: Vec<String>,
    },
    /// Media fill closed bodies only, and a mesh isn't closed.
    OpenBody {
        /// The name of the object.
        object: String,
        /// The name of its material.
        material: String,
        /// The number of its edges that aren't passed as often in one direction as in the other.
        edges: u32,
    },
    /// Ambient light isn't added, since the integrator finds the light that it stands for.
    Ambient {
        /// The name of the integrator.
        integrator: &'static str,
        /// The ambient light of the scene, with that of an environment.
        ambient: Rgb,
    },
    /// A rasteriser draws something else.
    Substitute {
        /// What it draws in place of it.
        sentence: String,
        /// The names of the objects or lights that it concerns; empty if it concerns the whole picture.
        names: Vec<String>,
    },
}

impl Omission {
    /// What an integrator draws for these objects or lights in place of what was asked for.
    pub(crate) fn substitute(sentence: impl Into<String>, names: Vec<String>) -> Omission {
        Omission::Substitute { sentence: sentence.into(), names }
    }
}

impl fmt::Display for Omission {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Omission::EmissionAsLight { integrator, materials } => {
                let emit = if materials.len() == 1 { "emits" } else { "emit" };
                write_names(f, "material", materials)?;
                write!(f, " {emit}, but the {integrator} integrator takes light from lights only")
            }
            Omission::Media { integrator, materials } => {
                let fill = if materials.len() == 1 { "fills its" } else { "fill their" };
                write_names(f, "material", materials)?;
                write!(f, " {fill} bodies with a medium, which the {integrator} integrator leaves out")
            }
            Omission::OpenBody { object, material, edges } => {
                let edges = if *edges == 1 { "1 open edge".to_owned() } else { format!("{edges} open edges") };
                write!(f, "absorption and media fill closed bodies only, and \"{object}\" has {edges}: ")?;
                write!(f, "the medium of material \"{material}\" is missing there")
            }
            Omission::Ambient { integrator, ambient } => {
                let [r, g, b] = ambient.to_array();
                let method = if *integrator == "path" { "path tracing" } else { integrator };
                write!(f, "ambient {r} {g} {b} is not added: {method} computes what ambient stands for")
            }
            Omission::Substitute { sentence, names } => {
                write!(f, "{sentence}")?;
                if names.is_empty() {
                    return Ok(());
                }
                write!(f, ": ")?;
                write_list(f, names)
            }
        }
    }
}

/// The most names in a message.
const MAX_NAMED: usize = 4;

fn write_names(f: &mut fmt::Formatter<'_>, kind: &str, names: &[String]) -> fmt::Result {
    write!(f, "{kind}{} ", if names.len() == 1 { "" } else { "s" })?;
    write_list(f, names)
}

fn write_list(f: &mut fmt::Formatter<'_>, names: &[String]) -> fmt::Result {
    for (i, name) in names.iter().take(MAX_NAMED).enumerate() {
        let before = match i {
            0 => "",
            _ if i + 1 == names.len() => " and ",
            _ => ", ",
        };
        write!(f, "{before}\"{name}\"")?;
    }
    match names.len().saturating_sub(MAX_NAMED) {
        0 => Ok(()),
        more => write!(f, " and {more} more"),
    }
}

/// The parts of a world that the job's integrator leaves out. Only the planes of a z-buffer need rays, a few thousand.
pub fn omissions(world: &World, job: &Job) -> Vec<Omission> {
    let integrator = preparable(&job.integrator);
    if !integrator.shades() {
        return Vec::new();
    }
    let (mut all, name) = (integrator.omissions(&PlacedJob::new(world, job)), job.integrator.name());
    let used = world.materials_in_use();
    let names_of = |is_left_out: &dyn Fn(u32, &PreparedMaterial) -> bool| -> Vec<String> {
        let all = (0..).zip(world.materials()).zip(&used);
        let left_out = all.filter(|((number, material), used)| **used && is_left_out(*number, material));
        left_out.map(|((_, material), _)| material.name.clone()).collect()
    };
    if !integrator.finds_indirect_light() {
        let materials = names_of(&|number, material| !world.is_of_light(number) && material.may_emit());
        if !materials.is_empty() {
            all.push(Omission::EmissionAsLight { integrator: name, materials });
        }
    } else if world.ambient != Rgb::BLACK {
        all.push(Omission::Ambient { integrator: name, ambient: world.ambient });
    }
    if !integrator.traces_paths() {
        let materials = names_of(&|_, material| !material.medium.is_vacuum());
        if !materials.is_empty() {
            all.push(Omission::Media { integrator: name, materials });
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::material::{Dielectric, Material, Medium, Phong};
    use crate::scene::{
        Content, Extrinsics, FilmSettings, Integrator, Intrinsics, Node, PathSettings, RadiositySettings, Scene, Stage,
        WhittedSettings,
    };
    use crate::shape::{Mesh, Plane, Shape, Sphere};
    use glam::Vec3;

    fn told(nodes: Vec<Node>, stage: Stage) -> Vec<String> {
        let lamp = Phong { emission: Rgb::WHITE, ..Phong::default() };
        let materials = ["a", "b", "c", "d", "e", "f"].map(|name| Material::new(name, lamp));
        let mut materials = materials.to_vec();
        materials.push(Material::new("dull", Phong::default()));
        let ball = Node::from(Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 }));
        let pair = vec![ball.clone(), ball.with_material(1)];
        let prototypes = vec![Node::new(Content::Group(pair))];
        let world = World::build(Scene { materials, prototypes, nodes, ..Scene::default() }).unwrap();
        let settings = WhittedSettings { stage, ..WhittedSettings::default() };
        let camera = Camera::new(&Intrinsics::default(), &Extrinsics::default()).unwrap();
        omissions(&world, &Job::new(camera, FilmSettings::default(), settings))
            .iter()
            .map(Omission::to_string)
            .collect()
    }

    #[test]
    fn materials_that_emit_are_named_if_they_are_used() {
        let end = "but the whitted integrator takes light from lights only";
        let plane = |material: u32| {
            let plane = Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y });
            Node::from(plane).with_material(material)
        };
        let both = |stage| told(vec![plane(0), Node::new(Content::Instance(0)).with_material(6)], stage);
        assert_eq!(both(Stage::Full), [format!("material \"a\" emits, {end}")]);
        assert!(both(Stage::Unlit).is_empty() && told(vec![plane(6)], Stage::Full).is_empty());
        // The copy's own material replaces none; one of its members has a material.
        let copy = told(vec![Node::new(Content::Group(vec![Node::new(Content::Instance(0))]))], Stage::Full);
        assert_eq!(copy, [format!("material \"b\" emits, {end}")]);
        let all = told((0..6).map(plane).collect(), Stage::Diffuse);
        assert_eq!(all, [format!("materials \"a\", \"b\", \"c\", \"d\" and 2 more emit, {end}")]);
        assert_eq!(told(vec![plane(4), plane(2)], Stage::Full), [format!("materials \"c\" and \"e\" emit, {end}")]);
    }

    /// A pyramid whose faces share no vertex, without its last `missing` faces.
    fn pyramid(missing: usize) -> Mesh {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
        let mut mesh = Mesh::default();
        for face in &faces[..4 - missing] {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(face.map(|corner: usize| corners[corner]));
            mesh.triangles.push([first, first + 1, first + 2]);
        }
        mesh
    }

    #[test]
    fn meshes_with_a_medium_that_are_not_closed_are_named_once() {
        let fog = Medium { absorption: Rgb::WHITE, ..Medium::VACUUM };
        let materials = vec![
            Material::new("fog", Dielectric::new(1.0)).with_medium(fog),
            Material::new("glass", Dielectric::new(1.5)),
            Material::new("paint", Phong::default()).with_medium(fog),
        ];
        let camera = Camera::new(&Intrinsics::default(), &Extrinsics::default()).unwrap();
        let told = |nodes: Vec<Node>, integrator: Integrator| {
            let (materials, meshes) = (materials.clone(), vec![pyramid(0), pyramid(1), pyramid(2)]);
            let world = World::build(Scene { materials, meshes, nodes, ..Scene::default() }).unwrap();
            let job = Job::new(camera.clone(), FilmSettings::default(), integrator);
            omissions(&world, &job).iter().map(Omission::to_string).collect::<Vec<_>>()
        };
        let mesh = |mesh: u32, material: u32| Node::new(Content::Mesh(mesh)).with_material(material);
        let nodes = vec![
            mesh(0, 0),
            mesh(1, 1),
            mesh(1, 2),
            mesh(1, 0).named("tent"),
            mesh(1, 0).named("copy"),
            mesh(2, 0).named("wedge"),
        ];
        let sentence = |object: &str, edges: u32| {
            format!(
                "absorption and media fill closed bodies only, and \"{object}\" has {edges} open edges: the medium of \
                 material \"fog\" is missing there"
            )
        };
        let path = Integrator::Path(PathSettings::default());
        assert_eq!(told(nodes.clone(), path), [sentence("tent", 3), sentence("wedge", 4)]);
        assert!(told(nodes[..3].to_vec(), path).is_empty());
        let classic = told(nodes, WhittedSettings::default().into());
        assert!(classic.len() == 1 && classic[0].starts_with("materials \"fog\" and \"paint\" fill"), "{classic:?}");
    }

    #[test]
    fn ambient_light_is_told_of_where_radiosity_takes_its_place() {
        let told = |ambient: Rgb, integrator: Integrator| {
            let world = World::build(Scene { ambient, ..Scene::default() }).unwrap();
            let camera = Camera::new(&Intrinsics::default(), &Extrinsics::default()).unwrap();
            let all = omissions(&world, &Job::new(camera, FilmSettings::default(), integrator));
            all.iter().map(Omission::to_string).collect::<Vec<_>>()
        };
        let radiosity = Integrator::Radiosity(RadiositySettings::DEFAULT);
        let sentence = "ambient 0.2 0.1 0 is not added: radiosity computes what ambient stands for";
        assert_eq!(told(Rgb::from([0.2, 0.1, 0.0]), radiosity), [sentence]);
        assert!(told(Rgb::BLACK, radiosity).is_empty());
        assert!(told(Rgb::WHITE, WhittedSettings::DEFAULT.into()).is_empty());
    }
}
