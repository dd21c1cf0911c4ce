//! A part of a scene, as a model file holds it, and how a scene takes it in.

use super::{Content, Node, Scene, View};
use crate::light::environment::{Environment, EnvironmentKind};
use crate::light::{Light, LightKind};
use crate::material::Material;
use crate::math::Rgb;
use crate::shape::{CylinderCloud, Mesh, SphereCloud};
use crate::texture::{Image, Texture, TextureKind};

/// A part of a scene with lists of its own. Its indices are positions in these lists, until [`Scene::append`] makes
/// them positions in the scene's lists.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fragment {
    /// The colour of rays that hit nothing, if the fragment has one.
    pub background: Option<Rgb>,
    /// The environment, if the fragment has one.
    pub environment: Option<Environment>,
    /// The cameras.
    pub views: Vec<View>,
    /// The materials, each with its name.
    pub materials: Vec<Material>,
    /// The textures, each with its name.
    pub textures: Vec<Texture>,
    /// The images that textures and the environment use.
    pub images: Vec<Image>,
    /// Triangle meshes.
    pub meshes: Vec<Mesh>,
    /// Clouds of spheres.
    pub spheres: Vec<SphereCloud>,
    /// Clouds of cylinders.
    pub cylinders: Vec<CylinderCloud>,
    /// The nodes that instances repeat. They are not drawn by themselves.
    pub prototypes: Vec<Node>,
    /// The objects to draw, and the lights.
    pub nodes: Vec<Node>,
}

/// The lengths of a scene's lists before a fragment was appended: what the fragment's indices grew by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Offsets {
    /// The number of materials.
    pub materials: u32,
    /// The number of textures.
    pub textures: u32,
    /// The number of images.
    pub images: u32,
    /// The number of meshes.
    pub meshes: u32,
    /// The number of clouds of spheres.
    pub spheres: u32,
    /// The number of clouds of cylinders.
    pub cylinders: u32,
    /// The number of prototypes.
    pub prototypes: u32,
}

impl Scene {
    /// Appends the lists of a fragment to those of the scene. A background or an environment of the fragment replaces
    /// that of the scene. Returns the offsets that were added to the fragment's indices.
    pub fn append(&mut self, fragment: Fragment) -> Offsets {
        let offsets = Offsets {
            materials: self.materials.len() as u32,
            textures: self.textures.len() as u32,
            images: self.images.len() as u32,
            meshes: self.meshes.len() as u32,
            spheres: self.spheres.len() as u32,
            cylinders: self.cylinders.len() as u32,
            prototypes: self.prototypes.len() as u32,
        };
        let Fragment { background, environment, views, .. } = fragment;
        let Fragment { mut materials, mut textures, images, .. } = fragment;
        let Fragment { mut meshes, spheres, cylinders, mut prototypes, mut nodes, .. } = fragment;
        materials.iter_mut().for_each(|material| offsets.shift_material(material));
        textures.iter_mut().for_each(|texture| offsets.shift_texture(texture));
        meshes.iter_mut().for_each(|mesh| shift_all(&mut mesh.materials, offsets.materials));
        offsets.shift_nodes(&mut prototypes);
        offsets.shift_nodes(&mut nodes);
        self.background = background.unwrap_or(self.background);
        if let Some(mut environment) = environment {
            offsets.shift_environment(&mut environment.kind);
            self.environment = Some(environment);
        }
        extend(&mut self.views, views);
        extend(&mut self.materials, materials);
        extend(&mut self.textures, textures);
        extend(&mut self.images, images);
        extend(&mut self.meshes, meshes);
        extend(&mut self.spheres, spheres);
        extend(&mut self.cylinders, cylinders);
        extend(&mut self.prototypes, prototypes);
        extend(&mut self.nodes, nodes);
        offsets
    }
}

impl Offsets {
    /// Adds the offsets to all indices in these nodes and in the groups among them. Nodes of a fragment that the scene
    /// takes in elsewhere than in [`Scene::nodes`] need this.
    pub fn shift_nodes(&self, nodes: &mut [Node]) {
        // Groups may be nested deeper than a stack has room for.
        let mut left = vec![nodes.iter_mut()];
        while let Some(siblings) = left.last_mut() {
            let Some(node) = siblings.next() else {
                left.pop();
                continue;
            };
            if let Some(material) = &mut node.material {
                shift(material, self.materials);
            }
            match &mut node.content {
                Content::Shape(_) => {}
                Content::Mesh(index) => shift(index, self.meshes),
                Content::Spheres(index) => shift(index, self.spheres),
                Content::Cylinders(index) => shift(index, self.cylinders),
                Content::Light(light) => self.shift_light(light),
                Content::Group(children) => left.push(children.iter_mut()),
                Content::Instance(index) => shift(index, self.prototypes),
            }
        }
    }

    fn shift_light(&self, light: &mut Light) {
        match &mut light.kind {
            LightKind::Mesh(light) => shift_all(&mut light.meshes, self.meshes),
            LightKind::Omni(_)
            | LightKind::Directional(_)
            | LightKind::Spot(_)
            | LightKind::Disk(_)
            | LightKind::Rectangle(_)
            | LightKind::Sphere(_) => {}
        }
    }

    fn shift_material(&self, material: &mut Material) {
        material.textures.iter_mut().for_each(|texture| shift(&mut texture.texture, self.textures));
    }

    fn shift_texture(&self, texture: &mut Texture) {
        match &mut texture.kind {
            TextureKind::Image(texture) => shift(&mut texture.image, self.images),
            TextureKind::Grid(texture) => shift(&mut texture.image, self.images),
            TextureKind::Constant(_) | TextureKind::Procedural(_) | TextureKind::VertexColor => {}
        }
    }

    fn shift_environment(&self, kind: &mut EnvironmentKind) {
        match kind {
            EnvironmentKind::Cube { faces, .. } => shift_all(faces, self.images),
            EnvironmentKind::Cross { image, .. } | EnvironmentKind::LatLong { image, .. } => shift(image, self.images),
            EnvironmentKind::Gradient(_) | EnvironmentKind::Sky(_) => {}
        }
    }
}

/// Adds an offset to an index. An index that names nothing may be of any size.
fn shift(index: &mut u32, by: u32) {
    *index = index.saturating_add(by);
}

fn shift_all(indices: &mut [u32], by: u32) {
    indices.iter_mut().for_each(|index| shift(index, by));
}

/// Appends a list without a copy if it is the first.
fn extend<T>(list: &mut Vec<T>, more: Vec<T>) {
    if list.is_empty() {
        *list = more;
    } else {
        list.extend(more);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::environment::Smoothing;
    use crate::light::{MeshLight, Omni};
    use crate::material::{Channel, Mapping, Parameter, Phong, Target, TextureUse};
    use crate::math::Transform;
    use crate::scene::{Extrinsics, Intrinsics};
    use crate::shape::{Shape, Sphere};
    use crate::texture::{ColorSpace, Filter, GridTexture, ImageTexture, Placement, Prefilter, Samples, Wrap};
    use glam::{DVec3, Vec3};

    fn material(name: &str, textures: &[u32]) -> Material {
        let on = |texture: &u32| TextureUse {
            texture: *texture,
            target: Target::Parameter(Parameter::Diffuse),
            channel: Channel::Red,
            range: [0.0, 1.0],
            multiply: false,
            mapping: Mapping::default(),
        };
        Material { textures: textures.iter().map(on).collect(), ..Material::new(name, Phong::default()) }
    }

    fn texture(name: &str, kind: TextureKind) -> Texture {
        Texture { name: name.into(), kind }
    }

    fn grid(image: u32) -> TextureKind {
        TextureKind::Grid(GridTexture {
            image,
            slices: 1,
            filter: Filter::Nearest,
            prefilter: Prefilter::None,
            wrap: Wrap::Clamp,
            placement: Placement::default(),
            space: None,
        })
    }

    fn image(name: &str) -> Image {
        Image {
            name: name.into(),
            width: 1,
            height: 1,
            channels: 1,
            samples: Samples::U8(vec![0]),
            space: ColorSpace::Srgb,
            premultiplied: false,
        }
    }

    fn mesh(name: &str, materials: &[u32]) -> Mesh {
        Mesh { name: name.into(), materials: materials.into(), ..Mesh::default() }
    }

    fn mesh_light(meshes: &[u32]) -> Node {
        let light = MeshLight { meshes: meshes.into(), transform: Transform::IDENTITY, points: 1 };
        Light::new(LightKind::Mesh(Box::new(light)), Rgb::WHITE).into()
    }

    fn omni() -> Node {
        Light::new(LightKind::Omni(Omni::at(Vec3::Y)), Rgb::WHITE).into()
    }

    fn view(name: &str) -> View {
        View {
            name: name.into(),
            intrinsics: Intrinsics::default(),
            extrinsics: Extrinsics::default(),
            motion: Vec::new(),
        }
    }

    /// The objects of the fragment, with the index of each list grown by these numbers.
    fn objects([material, mesh, spheres, cylinders, prototype]: [u32; 5]) -> Vec<Node> {
        let ball = Node::from(Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 }));
        let inner = vec![
            Node::new(Content::Mesh(mesh)).with_material(1 + material),
            Node::new(Content::Group(vec![Node::new(Content::Spheres(1 + spheres))])),
            ball.with_material(material).with_transform(&Transform::translate(DVec3::X)),
        ];
        vec![
            Node::new(Content::Mesh(1 + mesh)).named("second"),
            Node::new(Content::Group(inner)).with_material(1 + material),
            Node::new(Content::Cylinders(cylinders)),
            Node::new(Content::Instance(1 + prototype)).with_material(material),
            mesh_light(&[mesh, 1 + mesh]),
            omni(),
        ]
    }

    fn prototypes(material: u32, cylinders: u32, prototype: u32) -> Vec<Node> {
        let group = Node::new(Content::Group(vec![Node::new(Content::Instance(prototype))]));
        vec![Node::new(Content::Cylinders(1 + cylinders)).with_material(material), group]
    }

    fn fragment() -> Fragment {
        Fragment {
            background: None,
            environment: Some(Environment::new(EnvironmentKind::Cube {
                faces: [0, 1, 0, 1, 0, 1],
                smoothing: Smoothing::Nearest,
            })),
            views: vec![view("theirs")],
            materials: vec![material("red", &[1, 0]), material("blue", &[2])],
            textures: vec![
                texture("a", TextureKind::Image(ImageTexture::new(1))),
                texture("b", grid(0)),
                texture("c", TextureKind::Constant([1.0; 4])),
            ],
            images: vec![image("one"), image("two")],
            meshes: vec![mesh("first", &[1, 0]), mesh("second", &[])],
            spheres: vec![SphereCloud::default(), SphereCloud { radii: vec![2.0], ..SphereCloud::default() }],
            cylinders: vec![CylinderCloud::default(), CylinderCloud { caps: true, ..CylinderCloud::default() }],
            prototypes: prototypes(0, 0, 0),
            nodes: objects([0; 5]),
        }
    }

    /// A scene whose lists have 1 mesh, 2 clouds of spheres, 3 of cylinders, 4 materials, 5 textures, 6 images and 7
    /// prototypes.
    fn scene() -> Scene {
        let name = |i: usize| format!("own {i}");
        Scene {
            background: Rgb::gray(0.5),
            ambient: Rgb::gray(0.25),
            views: vec![view("own")],
            meshes: vec![mesh("own", &[3])],
            spheres: vec![SphereCloud::default(); 2],
            cylinders: vec![CylinderCloud::default(); 3],
            materials: (0..4).map(|i| material(&name(i), &[4])).collect(),
            textures: (0..5).map(|i| texture(&name(i), TextureKind::Image(ImageTexture::new(5)))).collect(),
            images: (0..6).map(|i| image(&name(i))).collect(),
            prototypes: vec![Node::new(Content::Mesh(0)).with_material(2); 7],
            nodes: vec![Node::new(Content::Instance(6)).with_material(3)],
            ..Scene::default()
        }
    }

    #[test]
    fn an_appended_fragment_is_the_scene_written_by_hand() {
        let mut found = scene();
        let offsets = found.append(fragment());
        let expected =
            Offsets { meshes: 1, spheres: 2, cylinders: 3, materials: 4, textures: 5, images: 6, prototypes: 7 };
        assert_eq!(offsets, expected);

        let mut by_hand = scene();
        by_hand.environment =
            Some(Environment::new(EnvironmentKind::Cube { faces: [6, 7, 6, 7, 6, 7], smoothing: Smoothing::Nearest }));
        by_hand.views.push(view("theirs"));
        by_hand.materials.extend([material("red", &[6, 5]), material("blue", &[7])]);
        by_hand.textures.extend([
            texture("a", TextureKind::Image(ImageTexture::new(7))),
            texture("b", grid(6)),
            texture("c", TextureKind::Constant([1.0; 4])),
        ]);
        by_hand.images.extend([image("one"), image("two")]);
        by_hand.meshes.extend([mesh("first", &[5, 4]), mesh("second", &[])]);
        by_hand.spheres.extend([SphereCloud::default(), SphereCloud { radii: vec![2.0], ..SphereCloud::default() }]);
        by_hand.cylinders.extend([CylinderCloud::default(), CylinderCloud { caps: true, ..CylinderCloud::default() }]);
        by_hand.prototypes.extend(prototypes(4, 3, 7));
        by_hand.nodes.extend(objects([4, 1, 2, 3, 7]));
        assert_eq!(found, by_hand);
    }

    #[test]
    fn an_empty_scene_takes_the_indices_as_they_are() {
        let (mut found, Fragment { nodes, prototypes, materials, textures, meshes, environment, .. }) =
            (Scene::default(), fragment());
        assert_eq!(found.append(fragment()), Offsets::default());
        assert_eq!((found.nodes, found.prototypes, found.materials), (nodes, prototypes, materials));
        assert_eq!((found.textures, found.meshes, found.environment), (textures, meshes, environment));
    }

    #[test]
    fn surroundings_are_replaced_if_the_fragment_has_them() {
        let image_of = |kind| Some(Environment::new(kind));
        let cross = |image| EnvironmentKind::Cross { image, smoothing: Smoothing::Bilinear };
        let lat_long = |image| EnvironmentKind::LatLong { image, smoothing: Smoothing::Bilinear };
        let mut found = scene();
        found.append(Fragment { background: Some(Rgb::WHITE), environment: image_of(cross(1)), ..Fragment::default() });
        assert_eq!((found.background, found.environment.clone()), (Rgb::WHITE, image_of(cross(7))));
        found.append(Fragment::default());
        assert_eq!((found.background, found.environment.clone()), (Rgb::WHITE, image_of(cross(7))));
        found.append(Fragment { environment: image_of(lat_long(0)), ..Fragment::default() });
        assert_eq!(found.environment, image_of(lat_long(6)));
        // An index that names nothing stays one, whatever its size.
        found.append(Fragment { nodes: vec![Node::new(Content::Mesh(u32::MAX))], ..Fragment::default() });
        assert_eq!(found.nodes[1], Node::new(Content::Mesh(u32::MAX)));
    }

    #[test]
    fn deep_groups_overflow_no_stack() {
        let leaf = Node::new(Content::Mesh(0));
        let chain = (0..300_000).fold(leaf, |node, _| Node::new(Content::Group(vec![node])));
        let work = || {
            let mut scene = scene();
            scene.append(Fragment { nodes: vec![chain], ..Fragment::default() });
            let mut node = &scene.nodes[1];
            while let Content::Group(children) = &node.content {
                node = &children[0];
            }
            assert_eq!(node.content, Content::Mesh(1));
        };
        std::thread::Builder::new().stack_size(128 << 10).spawn(work).unwrap().join().unwrap();
    }
}
