//! The objects that a name stands for, as numbers.

use super::{Content, Node, Scene};
use crate::light::Light;
use std::collections::HashMap;
use std::ops::Range;

/// The numbers of some objects of a scene; see [`crate::world::World::object_id`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ObjectIds {
    /// Ranges in their order, with gaps between them.
    ranges: Vec<Range<u32>>,
}

/// The error of a name whose objects are more than can be told apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the name stands for objects in more than {most} places", most = ObjectIds::MAX_RANGES)]
pub struct TooManyObjects;

impl ObjectIds {
    /// The most runs of successive numbers.
    pub const MAX_RANGES: usize = 1 << 20;

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.ranges.is_empty()
    }

    /// Whether this number is one of them.
    #[inline]
    pub fn contains(&self, id: u32) -> bool {
        let after = self.ranges.partition_point(|range| range.start <= id);
        after > 0 && self.ranges[after - 1].contains(&id)
    }

    /// Whether any of these numbers lies in a range.
    pub fn overlaps(&self, range: Range<u32>) -> bool {
        let after = self.ranges.partition_point(|own| own.end <= range.start);
        self.ranges.get(after).is_some_and(|own| own.start < range.end)
    }
}

/// The objects of a node or prototype.
#[derive(Clone, Default)]
struct NodeObjects {
    count: u64,
    /// The selected ones, counted from the node's first object. In order, with gaps between them.
    selected: Vec<Range<u64>>,
}

impl NodeObjects {
    /// Appends the objects of a node that follows.
    fn append(&mut self, next: &NodeObjects) -> Result<(), TooManyObjects> {
        for range in &next.selected {
            let range = self.count + range.start..self.count + range.end;
            if let Some(last) = self.selected.last_mut().filter(|last| last.end == range.start) {
                last.end = range.end;
            } else if self.selected.len() < ObjectIds::MAX_RANGES {
                self.selected.push(range);
            } else {
                return Err(TooManyObjects);
            }
        }
        self.count = self.count.saturating_add(next.count);
        Ok(())
    }
}

/// The name of an object that has none of its own: its kind and number, with the innermost named group around it.
pub(crate) fn name_of_unnamed(kind: &str, number: u32, group: Option<&str>) -> String {
    match group {
        Some(group) => format!("group \"{group}\", {kind} #{number}"),
        None => format!("{kind} #{number}"),
    }
}

/// The name of an object, group or instance.
struct Name<'a> {
    /// The name that a world gives an object.
    name: &'a str,
    /// Kind and number of an object without a name of its own in a named group.
    without_group: Option<&'a str>,
}

impl<'a> Name<'a> {
    fn own(name: &'a str) -> Name<'a> {
        Name { name, without_group: None }
    }
}

/// A walk in the order in which a world numbers objects.
struct Walk<'a> {
    scene: &'a Scene,
    /// Called with each name once it is known; returns whether the name is selected.
    selects: &'a mut dyn FnMut(Name) -> bool,
    /// The name of the innermost named group around the current node.
    group_name: Option<&'a str>,
    kinds: HashMap<&'static str, u32>,
    /// The objects of prototypes that were walked.
    finished: HashMap<u32, NodeObjects>,
    open: Vec<u32>,
}

impl<'a> Walk<'a> {
    fn new(scene: &'a Scene, selects: &'a mut dyn FnMut(Name) -> bool) -> Walk<'a> {
        let (kinds, finished) = (HashMap::new(), HashMap::new());
        Walk { scene, selects, group_name: None, kinds, finished, open: Vec::new() }
    }

    fn node(&mut self, node: &'a Node, depth: usize) -> Result<NodeObjects, TooManyObjects> {
        let mut objects = NodeObjects::default();
        // No world can be built of a scene that is nested deeper.
        if depth > Node::MAX_NESTING {
            return Ok(objects);
        }
        let kind = match &node.content {
            Content::Shape(shape) => shape.kind(),
            Content::Mesh(_) => "mesh",
            Content::Spheres(_) => "spheres",
            Content::Cylinders(_) => "cylinders",
            Content::Light(light) => return Ok(self.visible_light(node, light)),
            Content::Group(children) => {
                let outer = self.group_name;
                self.group_name = node.name.as_deref().or(outer);
                for child in children {
                    objects.append(&self.node(child, depth + 1)?)?;
                }
                self.group_name = outer;
                return Ok(self.named(node, objects));
            }
            Content::Instance(index) => {
                objects = self.prototype(*index, depth)?;
                return Ok(self.named(node, objects));
            }
        };
        let number = self.kinds.entry(kind).or_default();
        *number += 1;
        let selected = match &node.name {
            Some(name) => (self.selects)(Name::own(name)),
            None => {
                let name = name_of_unnamed(kind, *number, self.group_name);
                let own = self.group_name.map(|_| name_of_unnamed(kind, *number, None));
                (self.selects)(Name { name: &name, without_group: own.as_deref() })
            }
        };
        objects.count = 1;
        objects.selected.extend(selected.then_some(0..1));
        Ok(objects)
    }

    /// The objects that show a light.
    fn visible_light(&mut self, node: &Node, light: &Light) -> NodeObjects {
        let mut objects = NodeObjects::default();
        let Some((kind, count)) = light.visible_objects() else { return objects };
        *self.kinds.entry(kind).or_default() += count as u32;
        objects.count = count as u64;
        let name = node.name.as_ref().or(light.name.as_ref());
        let selected = match name {
            Some(name) => (self.selects)(Name::own(name)),
            None => (self.selects)(Name::own(&light.visible_name())),
        };
        objects.selected.extend((selected && count > 0).then_some(0..count as u64));
        objects
    }

    fn prototype(&mut self, index: u32, depth: usize) -> Result<NodeObjects, TooManyObjects> {
        if let Some(objects) = self.finished.get(&index) {
            return Ok(objects.clone());
        }
        let scene = self.scene;
        // No world can be built of a scene with a prototype inside itself or with one that is missing.
        let Some(prototype) = scene.prototypes.get(index as usize).filter(|_| !self.open.contains(&index)) else {
            return Ok(NodeObjects::default());
        };
        self.open.push(index);
        // Objects of a prototype have only the names of groups within it.
        let outer = self.group_name.take();
        let objects = self.node(prototype, depth + 1)?;
        self.group_name = outer;
        self.open.pop();
        self.finished.insert(index, objects.clone());
        Ok(objects)
    }

    /// All objects of a group or an instance if its name is selected.
    fn named(&mut self, node: &Node, mut objects: NodeObjects) -> NodeObjects {
        let selected = node.name.as_ref().is_some_and(|name| (self.selects)(Name::own(name)));
        if selected && objects.count > 0 {
            objects.selected = std::iter::once(0..objects.count).collect();
        }
        objects
    }
}

impl Scene {
    /// The objects with this name. The name of a group or an instance stands for all objects inside, and the name of an
    /// object in a prototype stands for all its copies. Objects without a name are called by kind and number, such as
    /// "sphere #3", with or without the group around them: [`crate::world::Object::name`]. Lights and cameras are no
    /// objects.
    ///
    /// # Errors
    /// [`TooManyObjects`] if the objects have more than [`ObjectIds::MAX_RANGES`] runs of numbers, or numbers beyond
    /// `u32`.
    pub fn objects_named(&self, name: &str) -> Result<ObjectIds, TooManyObjects> {
        let NodeObjects { selected, .. } =
            self.walk_objects(&mut |other| other.name == name || other.without_group == Some(name))?;
        let id = |number: u64| u32::try_from(number + 1).ok().filter(|id| *id < u32::MAX).ok_or(TooManyObjects);
        let ranges =
            selected.into_iter().map(|range| Ok(id(range.start)?..id(range.end)?)).collect::<Result<_, _>>()?;
        Ok(ObjectIds { ranges })
    }

    /// Calls `f` with the name of each object, group and instance, in the order of the file.
    pub fn for_each_object_name(&self, mut f: impl FnMut(&str)) {
        // Nothing is selected, so that there can't be too many.
        let _ = self.walk_objects(&mut |name| {
            f(name.name);
            false
        });
    }

    /// The named groups and instances that lie in no other one, with the numbers of the objects inside, in the order of
    /// the file.
    pub fn outermost_groups(&self) -> Vec<(&str, Range<u32>)> {
        let mut selects = |_: Name| false;
        let mut walk = Walk::new(self, &mut selects);
        let (mut groups, mut first) = (Vec::new(), 1u64);
        for node in &self.nodes {
            let count = walk.node(node, 0).map_or(0, |objects| objects.count);
            let id = |number: u64| u32::try_from(number).unwrap_or(u32::MAX);
            if let (Content::Group(_) | Content::Instance(_), Some(name)) = (&node.content, &node.name) {
                groups.push((&**name, id(first)..id(first.saturating_add(count))));
            }
            first = first.saturating_add(count);
        }
        groups
    }

    fn walk_objects(&self, selects: &mut dyn FnMut(Name) -> bool) -> Result<NodeObjects, TooManyObjects> {
        let mut walk = Walk::new(self, selects);
        let mut all = NodeObjects::default();
        for node in &self.nodes {
            all.append(&walk.node(node, 0)?)?;
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Transform;
    use crate::shape::{Shape, Sphere};
    use crate::world::World;
    use glam::{DVec3, Vec3};

    fn ball() -> Node {
        Node::from(Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 }))
    }

    fn copy(name: &str, place: f64) -> Node {
        let node = Node::new(Content::Instance(0)).with_transform(&Transform::translate(DVec3::X * place));
        if name.is_empty() { node } else { node.named(name) }
    }

    /// A named ball, a pair of balls three times, and a group of a ball, an unnamed group and a copy of the pair.
    fn scene() -> Scene {
        let pair = Node::new(Content::Group(vec![ball().named("left"), ball()])).named("pair");
        let inner = Node::new(Content::Group(vec![ball()]));
        let group = Node::new(Content::Group(vec![ball(), inner, copy("inside", 30.0)])).named("group");
        let nodes = vec![ball().named("first"), copy("", 10.0), copy("second copy", 20.0), group, ball()];
        Scene { prototypes: vec![pair], nodes, ..Scene::default() }
    }

    fn ids(scene: &Scene, name: &str) -> Vec<u32> {
        let ids = scene.objects_named(name).unwrap();
        (0..20).filter(|id| ids.contains(*id)).collect()
    }

    #[test]
    fn names_stand_for_numbers() {
        let scene = scene();
        assert_eq!(ids(&scene, "first"), [1]);
        assert_eq!(ids(&scene, "left"), [2, 4, 8]);
        assert_eq!(ids(&scene, "pair"), [2, 3, 4, 5, 8, 9]);
        assert_eq!(ids(&scene, "second copy"), [4, 5]);
        assert_eq!(ids(&scene, "group"), [6, 7, 8, 9]);
        assert_eq!(ids(&scene, "inside"), [8, 9]);
        // Named objects count as the others do.
        assert_eq!(ids(&scene, "sphere #3"), [3, 5, 9]);
        assert_eq!(ids(&scene, "sphere #4"), [6]);
        assert_eq!(ids(&scene, "sphere #6"), [10]);
        assert_eq!(ids(&scene, "sphere #1"), []);
        assert!(scene.objects_named("nothing").unwrap().is_empty());
        assert!(
            scene.objects_named("group").unwrap().overlaps(3..7)
                && !scene.objects_named("group").unwrap().overlaps(1..6)
        );
        let mut names = Vec::new();
        scene.for_each_object_name(|name| names.push(name.to_owned()));
        let expected = [
            "first",
            "left",
            "group \"pair\", sphere #3",
            "pair",
            "second copy",
            "group \"group\", sphere #4",
            "group \"group\", sphere #5",
            "inside",
            "group",
            "sphere #6",
        ];
        assert_eq!(names, expected);
        assert_eq!(scene.outermost_groups(), [("second copy", 4..6), ("group", 6..10)]);
    }

    /// A world gives the same names to the same numbers.
    #[test]
    fn worlds_agree() {
        let world = World::build(scene()).unwrap();
        for id in 1..=10 {
            let name = &world.object_with_id(id).unwrap().name;
            assert!(ids(&scene(), name).contains(&id), "{id}: {name}");
        }
        assert!(world.object_with_id(11).is_none());
    }

    #[test]
    fn scenes_that_can_not_be_built_are_harmless() {
        let mut scene = scene();
        scene.prototypes[0] = Node::new(Content::Group(vec![copy("", 0.0), Node::new(Content::Instance(7))]));
        assert!(scene.objects_named("left").unwrap().is_empty());
        let mut deep = ball();
        for _ in 0..1000 {
            deep = Node::new(Content::Group(vec![deep]));
        }
        let deep = Scene { nodes: vec![deep], ..Scene::default() };
        assert!(deep.objects_named("sphere #1").unwrap().is_empty());
    }
}
