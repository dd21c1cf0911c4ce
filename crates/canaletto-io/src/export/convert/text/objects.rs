//! Objects: shapes, meshes, clouds, groups, prototypes and instances.

use super::Writer;
use super::line::{Line, flag, quoted};
use super::number::{place, single, vector};
use super::transform;
use crate::export::convert::array;
use canaletto::math::Rgb;
use canaletto::scene::{Content, Node};
use canaletto::shape::{
    Cone, Cuboid, Cylinder, CylinderCloud, Disk, Parallelogram, Partial, Plane, Round, Shape, Sphere, SphereCloud,
    Torus, Triangle,
};
use glam::{DVec3, Vec3};

/// The most elements of a cloud that stand in the text.
const MOST_INLINE: usize = 64;

impl Writer<'_> {
    /// The prototypes that aren't drawn where an object of their name stands, in their order.
    pub(super) fn prototypes(&mut self) -> Vec<Line> {
        let mut lines = Vec::new();
        for index in 0..self.scene.prototypes.len() {
            if self.in_place[index] {
                continue;
            }
            let scene = self.scene;
            let prototype = &scene.prototypes[index];
            let line = Line::named("prototype", &self.prototype_names[index]);
            lines.push(match &prototype.content {
                Content::Group(children) => {
                    let line = self.placed(line, prototype, None);
                    let children = self.nodes(children, None, false);
                    line.children(children)
                }
                _ => {
                    let unnamed = Node { name: None, ..prototype.clone() };
                    let child = self.node(&unnamed, None, false);
                    line.children(child)
                }
            });
        }
        lines
    }

    /// The lines of nodes. `inherited` is the material around them; at the root it is the default one.
    pub(super) fn nodes(&mut self, nodes: &[Node], inherited: Option<u32>, is_root: bool) -> Vec<Line> {
        nodes.iter().filter_map(|node| self.node(node, inherited, is_root)).collect()
    }

    fn node(&mut self, node: &Node, inherited: Option<u32>, is_root: bool) -> Option<Line> {
        let shown = node.name.as_deref().unwrap_or("unnamed").to_owned();
        let material = node.material.or(inherited);
        match &node.content {
            Content::Light(light) => {
                let line = self.light(node, light, &shown)?;
                let name = light.name.as_deref().or(node.name.as_deref()).and_then(|name| self.names.take(name));
                let line = line.property_if("name", name.as_deref().map(quoted));
                Some(self.moved(line, node, &shown, DVec3::ZERO))
            }
            Content::Instance(index) => {
                let scene = self.scene;
                if is_original(node, &scene.prototypes, *index) && self.first_place(*index) {
                    return self.node(&scene.prototypes[*index as usize], inherited, is_root);
                }
                let line = Line::named("instance", self.prototype_names.get(*index as usize)?);
                let name = node.name.as_deref().and_then(|name| self.names.take(name));
                let line = line.property_if("name", name.as_deref().map(quoted));
                let line = self.with_material(line, node.material);
                let line = line.property_if("casts-shadow", (!node.casts_shadow).then(|| flag(false)));
                Some(self.moved(line, node, &shown, DVec3::ZERO))
            }
            Content::Group(children) => {
                let line = self.named_line("group", node);
                let line = self.placed(line, node, None);
                let children = self.nodes(children, material, is_root);
                Some(line.children(children))
            }
            Content::Shape(shape) => {
                let line = self.named_line(shape.kind(), node).children(shape_lines(shape, &node.rest));
                Some(self.placed(line, node, None))
            }
            Content::Mesh(index) => self.mesh(node, *index, inherited, is_root),
            Content::Spheres(index) => {
                let scene = self.scene;
                let line = self.named_line("spheres", node);
                let name = node.name.as_deref().unwrap_or_default();
                let line = self.spheres(line, scene.spheres.get(*index as usize)?, name);
                Some(self.placed(line, node, None))
            }
            Content::Cylinders(index) => {
                let scene = self.scene;
                let line = self.named_line("cylinders", node);
                let name = node.name.as_deref().unwrap_or_default();
                let line = self.cylinders(line, scene.cylinders.get(*index as usize)?, name);
                Some(self.placed(line, node, None))
            }
        }
    }

    /// A line with the node's name, if it is free.
    fn named_line(&mut self, word: &str, node: &Node) -> Line {
        let line = Line::new(word);
        let Some(name) = node.name.as_deref().filter(|name| !name.is_empty()) else { return line };
        // Prototypes that stand in place have their names already.
        let own = position_in(&self.scene.prototypes, node);
        let name = match own.and_then(|index| self.prototype_names.get(index)) {
            Some(name) => name.clone(),
            None => self.names.unique(name, word),
        };
        line.value(quoted(&name))
    }

    fn with_material(&mut self, line: Line, material: Option<u32>) -> Line {
        let name = material.map(|material| quoted(&self.material_name(material)));
        line.property_if("material", name)
    }

    /// The line with the node's material, shadow, transforms and motion. `origin` is added before the transforms.
    fn placed(&mut self, line: Line, node: &Node, origin: Option<DVec3>) -> Line {
        let line = self.with_material(line, node.material);
        let line = line.property_if("casts-shadow", (!node.casts_shadow).then(|| flag(false)));
        let shown = node.name.as_deref().unwrap_or("unnamed").to_owned();
        self.moved(line, node, &shown, origin.unwrap_or_default())
    }

    fn moved(&mut self, line: Line, node: &Node, name: &str, origin: DVec3) -> Line {
        let first = (origin != DVec3::ZERO).then(|| transform::Step::Translate(origin).line());
        let line = line.children(first).children(transform::lines(&node.transform));
        match node.motion.as_slice() {
            [] => line,
            poses => {
                let motion = transform::motion(poses);
                let motion = motion.map(|steps| Line::new("motion").children(steps.iter().map(transform::Step::line)));
                if motion.is_none() {
                    self.lost.add("motion while the shutter is open", name);
                }
                line.children(motion)
            }
        }
    }

    fn mesh(&mut self, node: &Node, index: u32, inherited: Option<u32>, is_root: bool) -> Option<Line> {
        let scene = self.scene;
        let mesh = scene.meshes.get(index as usize)?;
        let (file, slots) = self.mesh_file(index)?;
        let line = self.named_line("mesh", node).property("file", quoted(&file));
        let own = |slot: u32| node.material.or(mesh.materials.get(slot as usize).copied());
        let mut materials: Vec<Option<u32>> = slots.iter().map(|slot| own(*slot)).collect();
        // The file's own material would take the place of the one around.
        if !mesh.colors.is_empty() && materials == [None] {
            materials = match inherited {
                Some(material) => vec![Some(material)],
                None if is_root => vec![Some(self.default_material())],
                None => {
                    self.lost.add("materials of what is repeated on meshes with colours", &mesh.name);
                    materials
                }
            };
        }
        let all: Option<Vec<u32>> = materials.iter().copied().collect();
        let (line, parts) = match (&materials[..], all) {
            ([material], _) if mesh.colors.is_empty() => (self.with_material(line, *material), Vec::new()),
            (_, Some(all)) => {
                let parts = all.iter().map(|material| Line::named("part", &self.material_name(*material))).collect();
                (line, parts)
            }
            _ => (line, Vec::new()),
        };
        let line = line.property_if("one-sided", mesh.one_sided.then(|| flag(true))).children(parts);
        let unnamed = Node { material: None, ..node.clone() };
        Some(self.placed(line, &unnamed, Some(mesh.origin)))
    }

    fn spheres(&mut self, line: Line, cloud: &SphereCloud, name: &str) -> Line {
        let SphereCloud { name: _, origin, centers, radii, colors, rows } = cloud;
        if !rows.is_empty() {
            self.lost.add("numbers of rows", name);
        }
        let points = || centers.iter().map(|p| *origin + p.as_dvec3());
        if centers.len() <= MOST_INLINE && radii.len() == 1 && colors.is_empty() {
            let all: Vec<String> = points().map(|p| fine(p, *origin)).collect();
            return line.property("radius", single(radii[0])).child(Line::of("points", all.join("  ")));
        }
        let bytes = array::table(points().map(|p| [p]).collect(), *origin, radii, colors);
        self.table(line, name, bytes, radii, colors)
    }

    fn cylinders(&mut self, line: Line, cloud: &CylinderCloud, name: &str) -> Line {
        let CylinderCloud { name: _, origin, axes, radii, colors, rows, caps } = cloud;
        if !rows.is_empty() {
            self.lost.add("numbers of rows", name);
        }
        let line = line.property_if("caps", (!caps).then(|| flag(false)));
        let ends = || axes.iter().map(|ends| ends.map(|p| *origin + p.as_dvec3()));
        if axes.len() <= MOST_INLINE && radii.len() == 1 && colors.is_empty() {
            let all: Vec<String> = ends().map(|[a, b]| format!("{} {}", fine(a, *origin), fine(b, *origin))).collect();
            return line.property("radius", single(radii[0])).child(Line::of("axes", all.join("  ")));
        }
        let bytes = array::table(ends().collect(), *origin, radii, colors);
        self.table(line, name, bytes, radii, colors)
    }

    fn table(&mut self, line: Line, name: &str, bytes: Vec<u8>, radii: &[f32], colors: &[Rgb]) -> Line {
        let file = self.assets.add(name, "cloud", "npy", bytes);
        let line = line.property_if("radius", if let [one] = radii { Some(single(*one)) } else { None });
        let line = line.property("file", quoted(&file));
        line.property_if("colors", (!colors.is_empty()).then(|| quoted("linear")))
    }
}

/// The number of an item that is one of a list's.
fn position_in<T>(list: &[T], item: &T) -> Option<usize> {
    let bytes = (std::ptr::from_ref(item) as usize).checked_sub(list.as_ptr() as usize)?;
    let index = bytes / size_of::<T>();
    list.get(index).filter(|found| std::ptr::eq(*found, item)).map(|_| index)
}

/// A point of a cloud. Near zero it is an `f32`.
fn fine(p: DVec3, origin: DVec3) -> String {
    if origin == DVec3::ZERO { vector(p.as_vec3()) } else { super::number::fine_vector(p) }
}

/// Whether a node stands for the object of its name, which is also repeated.
pub(super) fn is_original(node: &Node, prototypes: &[Node], index: u32) -> bool {
    let Some(prototype) = prototypes.get(index as usize) else { return false };
    prototype.name.is_some()
        && node.name == prototype.name
        && node.material.is_none()
        && node.casts_shadow
        && node.transform.is_identity()
        && node.motion.is_empty()
}

fn shape_lines(shape: &Shape, rest: &[Vec3; 3]) -> Vec<Line> {
    let at = |word: &str, p: Vec3, i: usize| Line::of(word, place(p, rest[i]));
    let direction = |word: &str, v: Vec3| Line::of(word, vector(v));
    let number = |word: &str, v: f32| Line::of(word, single(v));
    let open = |caps: bool| (!caps).then(|| Line::of("caps", flag(false)));
    match *shape {
        Shape::Sphere(Sphere { center, radius }) => vec![at("center", center, 0), number("radius", radius)],
        Shape::Box(Cuboid { min, max }) => vec![at("min", min, 0), at("max", max, 1)],
        Shape::Triangle(Triangle { a, b, c, one_sided }) => {
            let mut lines = vec![at("a", a, 0), at("b", b, 1), at("c", c, 2)];
            lines.extend(one_sided.then(|| Line::of("one-sided", flag(true))));
            lines
        }
        Shape::Plane(Plane { point, normal }) => vec![at("point", point, 0), direction("normal", normal)],
        Shape::Disk(disk) => disk_lines(&disk, rest),
        Shape::Rectangle(Parallelogram { corner, u, v }) => {
            vec![at("corner", corner, 0), direction("u", u), direction("v", v)]
        }
        Shape::Cylinder(cylinder) => cylinder_lines(&cylinder, rest).into_iter().chain(open(cylinder.caps)).collect(),
        Shape::Cone(cone) => cone_lines(&cone, rest).into_iter().chain(open(cone.caps)).collect(),
        Shape::Torus(Torus { center, axis, radius, tube }) => {
            vec![at("center", center, 0), direction("axis", axis), number("radius", radius), number("tube", tube)]
        }
        Shape::Partial(Partial { whole, start, angle }) => {
            let mut lines = match whole {
                Round::Cylinder(cylinder) => cylinder_lines(&cylinder, rest),
                Round::Cone(cone) => cone_lines(&cone, rest),
                Round::Disk(disk) => disk_lines(&disk, rest),
                _ => Vec::new(),
            };
            lines.push(number("angle", angle));
            lines.extend((start != 0.0).then(|| number("start-angle", start)));
            lines
        }
        _ => Vec::new(),
    }
}

fn disk_lines(disk: &Disk, rest: &[Vec3; 3]) -> Vec<Line> {
    vec![
        Line::of("center", place(disk.center, rest[0])),
        Line::of("normal", vector(disk.normal)),
        Line::of("radius", single(disk.radius)),
    ]
}

fn cylinder_lines(cylinder: &Cylinder, rest: &[Vec3; 3]) -> Vec<Line> {
    vec![
        Line::of("base", place(cylinder.base, rest[0])),
        Line::of("top", place(cylinder.top, rest[1])),
        Line::of("radius", single(cylinder.radius)),
    ]
}

fn cone_lines(cone: &Cone, rest: &[Vec3; 3]) -> Vec<Line> {
    let mut lines = vec![
        Line::of("base", place(cone.base, rest[0])),
        Line::of("top", place(cone.top, rest[1])),
        Line::of("radius", single(cone.radius)),
    ];
    lines.extend((cone.top_radius != 0.0).then(|| Line::of("top-radius", single(cone.top_radius))));
    lines
}
