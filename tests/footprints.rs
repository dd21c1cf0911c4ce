//! Footprints of textures compared with the hits of neighbouring rays, on every shape, in mirrors and through glass.

use canaletto::Ray;
use canaletto::camera::Camera;
use canaletto::integrator::{Probe, RayKind, Whitted};
use canaletto::material::{Mapping, Material, MaterialPoint, Parameter, Phong, Projection, Space, Target, TextureUse};
use canaletto::math::{Rgb, Transform};
use canaletto::scene::{Content, Extrinsics, Intrinsics, Node, Scene, WhittedSettings};
use canaletto::shape::{
    Cone, Cuboid, Cylinder, Disk, Mesh, Parallelogram, Plane, Shape, Sphere, Surface, Torus, Triangle,
};
use canaletto::texture::{ColorSpace, Image, ImageTexture, Samples, Texture, TextureKind};
use canaletto::world::{GeometryProbe, Hit, TextureRead, World};
use canaletto_tests::gallery::icosphere;
use glam::{DVec3, Vec3};

/// The hits from the eye on: kind of ray, instance, primitive, and part with side.
type Way = Vec<(RayKind, u32, u32, u32)>;

/// The points where a ray and its children read textures, with the paths to them.
#[derive(Default)]
struct Reads {
    way: Way,
    open: Vec<RayKind>,
    /// The reads, each with the hits before it.
    reads: Vec<(Way, DVec3, [DVec3; 2])>,
    pending: Vec<(DVec3, [DVec3; 2])>,
}

impl GeometryProbe for Reads {
    fn texture(&mut self, read: &TextureRead) {
        let lookup = read.readings[0].lookup;
        self.pending.push((lookup.at, [lookup.dx, lookup.dy]));
    }
}

impl Probe for Reads {
    fn ray(&mut self, kind: RayKind, _: &Ray, _: u32, _: Rgb) {
        self.open.push(kind);
    }

    fn hit(&mut self, hit: &Hit, _: &Surface, _: &MaterialPoint, outside: bool) {
        let kind = *self.open.last().unwrap();
        // A smooth mesh is continuous across its triangles, but not in the second order. The path therefore includes
        // the triangle.
        self.way.push((kind, hit.instance, hit.primitive, 2 * hit.part + u32::from(outside)));
        for (at, change) in self.pending.drain(..) {
            self.reads.push((self.way.clone(), at, change));
        }
    }

    fn end(&mut self, _: Rgb) {
        self.open.pop();
    }
}

fn material(phong: Phong, mapping: Option<Mapping>) -> Material {
    let material = Material::new("m", phong);
    match mapping {
        Some(mapping) => {
            material.with_texture(TextureUse { mapping, ..TextureUse::new(0, Target::Parameter(Parameter::Diffuse)) })
        }
        None => material,
    }
}

/// A shape over a textured floor, with its own material.
fn world(node: Node, material: Material) -> World {
    let solid = Mapping::new(Projection::Solid, Space::World);
    let floor = Node::from(Shape::Plane(Plane { point: Vec3::new(0.0, -2.0, 0.0), normal: Vec3::Y })).with_material(1);
    let wall = Node::from(Shape::Plane(Plane { point: Vec3::new(0.0, 0.0, -9.0), normal: Vec3::Z })).with_material(1);
    let ceiling = Node::from(Shape::Plane(Plane { point: Vec3::Y * 12.0, normal: Vec3::NEG_Y })).with_material(1);
    let image = Image {
        name: "gray".into(),
        width: 2,
        height: 2,
        channels: 1,
        samples: Samples::U8(vec![0, 255, 255, 0]),
        space: ColorSpace::Linear,
        premultiplied: false,
    };
    World::build(Scene {
        materials: vec![material, self::material(Phong::default(), Some(solid))],
        images: vec![image],
        textures: vec![Texture { name: "t".into(), kind: TextureKind::Image(ImageTexture::new(0)) }],
        meshes: vec![smooth_ball()],
        nodes: vec![node.with_material(0), floor, wall, ceiling],
        ..Scene::default()
    })
    .unwrap()
}

fn smooth_ball() -> Mesh {
    icosphere(2, 1.0, true)
}

fn shapes() -> Vec<(&'static str, Node)> {
    let turn = Transform::rotate(DVec3::new(0.4, 1.0, 0.3), 35.0)
        .unwrap()
        .after(&Transform::scale(DVec3::new(1.2, 0.7, 0.9)).unwrap());
    let ball = Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 });
    let axis = Vec3::new(0.2, 1.0, 0.3);
    vec![
        ("sphere", Node::from(ball)),
        ("ellipsoid", Node::from(ball).with_transform(&turn)),
        ("box", Node::from(Shape::Box(Cuboid { min: Vec3::splat(-0.8), max: Vec3::splat(0.7) }))),
        (
            "triangle",
            Node::from(Shape::Triangle(Triangle {
                a: Vec3::new(-1.5, -1.0, 0.4),
                b: Vec3::new(1.5, -1.0, 0.0),
                c: Vec3::new(0.0, 1.4, -0.3),
                one_sided: false,
            })),
        ),
        (
            "plane",
            Node::from(Shape::Plane(Plane { point: Vec3::new(0.0, -1.0, 0.0), normal: Vec3::new(0.1, 1.0, 0.2) })),
        ),
        ("disk", Node::from(Shape::Disk(Disk { center: Vec3::ZERO, normal: Vec3::new(0.2, 0.6, 1.0), radius: 1.3 }))),
        (
            "rectangle",
            Node::from(Shape::Rectangle(Parallelogram {
                corner: Vec3::new(-1.5, -1.0, 0.4),
                u: Vec3::new(2.6, 0.3, -0.5),
                v: Vec3::new(0.4, 2.2, -0.3),
            })),
        ),
        ("cylinder", Node::from(Shape::Cylinder(Cylinder { base: -axis, top: axis, radius: 0.7, caps: true }))),
        ("cone", Node::from(Shape::Cone(Cone { base: -axis, top: axis, radius: 0.9, top_radius: 0.2, caps: true }))),
        ("torus", Node::from(Shape::Torus(Torus { center: Vec3::ZERO, axis, radius: 0.9, tube: 0.4 }))),
        ("mesh", Node::new(Content::Mesh(0)).with_transform(&turn)),
    ]
}

fn camera() -> Camera {
    let intrinsics =
        Intrinsics { fovy: 35.0, width: 60, height: 45, near: Some(1.0), far: Some(100.0), ..Intrinsics::default() };
    let extrinsics = Extrinsics { eye: DVec3::new(0.5, 1.3, 5.0), center: DVec3::ZERO, up: DVec3::Y };
    Camera::new(&intrinsics, &extrinsics).unwrap()
}

/// Compares the footprints of every read with the next samples' reads. Returns the number of comparisons at each depth.
fn compare(name: &str, world: &World) -> [u32; 4] {
    let camera = camera();
    let settings = WhittedSettings { max_depth: 4, ..WhittedSettings::default() };
    const SPACING: f64 = 1e-3;
    let reads = |x: f64, y: f64| {
        let mut reads = Reads::default();
        Whitted::new(world, settings).eye(camera.line(x, y), Some(&camera.differential(x, y, SPACING)), &mut reads);
        reads.reads
    };
    let mut counts = [0; 4];
    let mut off = 0;
    for i in 0..60 * 45 {
        let (x, y) = (f64::from(i % 60) + 0.37, f64::from(i / 60) + 0.61);
        let here = reads(x, y);
        for (axis, next) in [reads(x + SPACING, y), reads(x, y + SPACING)].into_iter().enumerate() {
            // The paths differ: an edge lies between the two.
            if here.iter().map(|r| &r.0).ne(next.iter().map(|r| &r.0)) {
                continue;
            }
            for ((way, at, change), (_, beside, _)) in here.iter().zip(&next) {
                let (found, expected) = (change[axis], *beside - *at);
                // The accuracy of coordinates is that of `f32`.
                let tolerance = 0.02 * expected.length() + 4e-7 * at.length().max(1.0);
                let depth = way.len().min(4) - 1;
                if expected.length() > 0.05 {
                    continue;
                }
                counts[depth] += 1;
                if (found - expected).length() > tolerance {
                    off += 1;
                    assert!(
                        (found - expected).length() < 0.3 * expected.length() + tolerance,
                        "{name} at {x}, {y} after {way:?}: {found} instead of {expected}"
                    );
                }
            }
        }
    }
    // Near the critical angle and at grazing incidence, the second order matters.
    assert!(f64::from(off) < 0.01 * f64::from(counts.iter().sum::<u32>()), "{name}: {off} of {counts:?}");
    counts
}

#[test]
fn on_every_shape() {
    for (name, node) in shapes() {
        for mapping in [Mapping::default(), Mapping::new(Projection::Solid, Space::World)] {
            let counts = compare(name, &world(node.clone(), material(Phong::default(), Some(mapping))));
            assert!(counts[0] > 2000, "{name}: {counts:?}");
        }
    }
}

#[test]
fn in_mirrors_of_every_shape() {
    for (name, node) in shapes() {
        let mirror = material(Phong { k: Rgb::gray(0.9), ..Phong::default() }, None);
        let counts = compare(name, &world(node, mirror));
        assert!(counts[1] > 100, "{name}: {counts:?}");
    }
}

#[test]
fn through_glass_of_every_closed_shape() {
    for (name, node) in shapes() {
        let glass = material(Phong { eta: 1.4, opacity: 0.1, ..Phong::default() }, None);
        let counts = compare(name, &world(node, glass));
        assert!(counts[1..].iter().sum::<u32>() > 100, "{name}: {counts:?}");
    }
}
