//! Trees of nodes of any depth. Groups may be nested deeper than any stack, so nodes are dropped, copied and compared
//! without recursion. Nodes are written, read and formatted only down to [`Node::MAX_NESTING`].

use super::{Content, Node};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de, ser};
use std::cell::Cell;
use std::fmt;

impl Drop for Content {
    fn drop(&mut self) {
        let Content::Group(children) = self else { return };
        let mut left = std::mem::take(children);
        while let Some(mut node) = left.pop() {
            if let Content::Group(children) = &mut node.content {
                left.append(children);
            }
        }
    }
}

/// A copy of a node; the copy of a group has no children.
fn without_children(node: &Node) -> Node {
    Node {
        name: node.name.clone(),
        material: node.material,
        casts_shadow: node.casts_shadow,
        transform: node.transform.clone(),
        motion: node.motion.clone(),
        rest: node.rest.clone(),
        content: match &node.content {
            Content::Group(children) => Content::Group(Vec::with_capacity(children.len())),
            content => content.clone(),
        },
    }
}

impl Clone for Node {
    fn clone(&self) -> Node {
        let mut copy = without_children(self);
        let Content::Group(children) = &self.content else { return copy };
        // The groups that enclose the next copy, and the children of each that remain to be copied.
        let mut around = Vec::new();
        let mut left = children.iter();
        loop {
            let done = match left.next() {
                Some(child) => {
                    let mut next = without_children(child);
                    if let Content::Group(children) = &child.content {
                        std::mem::swap(&mut copy, &mut next);
                        around.push((next, std::mem::replace(&mut left, children.iter())));
                        continue;
                    }
                    next
                }
                None => {
                    let Some((parent, others)) = around.pop() else { return copy };
                    left = others;
                    std::mem::replace(&mut copy, parent)
                }
            };
            if let Content::Group(children) = &mut copy.content {
                children.push(done);
            }
        }
    }
}

impl PartialEq for Node {
    fn eq(&self, other: &Node) -> bool {
        let mut left = vec![(self, other)];
        while let Some((a, b)) = left.pop() {
            let same = match (&a.content, &b.content) {
                (Content::Group(a), Content::Group(b)) => {
                    left.extend(a.iter().zip(b));
                    a.len() == b.len()
                }
                (a, b) => a == b,
            };
            let placed = a.transform == b.transform && a.motion == b.motion && a.rest == b.rest;
            let shown = a.material == b.material && a.casts_shadow == b.casts_shadow;
            if !(same && placed && shown && a.name == b.name) {
                return false;
            }
        }
        true
    }
}

thread_local! {
    /// The number of groups that enclose the node being written, read or formatted on this thread.
    static LEVEL: Cell<usize> = const { Cell::new(0) };
}

/// One level of nesting on this thread. Dropping it leaves the level.
struct Level;

impl Level {
    /// Enters one more level; none beyond the deepest nesting.
    fn enter() -> Option<Level> {
        let level = LEVEL.get();
        (level < Node::MAX_NESTING).then(|| {
            LEVEL.set(level + 1);
            Level
        })
    }
}

impl Drop for Level {
    fn drop(&mut self) {
        LEVEL.set(LEVEL.get() - 1);
    }
}

fn too_deep() -> String {
    format!("groups are nested more than {} deep", Node::MAX_NESTING)
}

pub(super) fn write<S: Serializer>(children: &Vec<Node>, serializer: S) -> Result<S::Ok, S::Error> {
    let _level = Level::enter().ok_or_else(|| ser::Error::custom(too_deep()))?;
    children.serialize(serializer)
}

pub(super) fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Node>, D::Error> {
    let _level = Level::enter().ok_or_else(|| de::Error::custom(too_deep()))?;
    Vec::deserialize(deserializer)
}

impl fmt::Debug for Node {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Node { name, material, casts_shadow, transform, motion, rest, content } = self;
        let mut shown = f.debug_struct("Node");
        shown
            .field("name", name)
            .field("material", material)
            .field("casts_shadow", casts_shadow)
            .field("transform", transform)
            .field("motion", motion)
            .field("rest", rest);
        match Level::enter() {
            Some(_level) => shown.field("content", content),
            None => shown.field("content", &format_args!("nested too deep to be shown")),
        };
        shown.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Transform;
    use crate::scene::Scene;
    use crate::world::{BuildError, World};
    use glam::DVec3;

    fn nested(depth: usize) -> Node {
        let leaf = Node::new(Content::Instance(7)).named("leaf").with_motion(vec![Transform::IDENTITY; 2]);
        (0..depth).fold(leaf, |node, level| {
            let beside = Node::new(Content::Mesh(level as u32));
            Node::new(Content::Group(vec![beside.clone(), node, beside])).with_material(level as u32)
        })
    }

    #[test]
    fn deep_descriptions_overflow_no_stack() {
        let small = std::thread::Builder::new().stack_size(128 << 10);
        let work = || {
            let scene = Scene { nodes: vec![nested(300_000)], prototypes: vec![nested(1000)], ..Scene::default() };
            let copy = scene.clone();
            assert!(copy == scene);
            assert!(copy.nodes[0] != nested(299_999));
            let empty = Node::new(Content::Group(Vec::new()));
            let chain = (0..300_000).fold(empty, |node, _| Node::new(Content::Group(vec![node])));
            let deep = Scene { nodes: vec![chain], ..Scene::default() };
            assert_eq!(World::build(deep).unwrap_err(), BuildError::TooDeep);
            drop(copy.nodes.into_iter().next());
        };
        small.spawn(work).unwrap().join().unwrap();
    }

    #[test]
    fn copies_are_the_same_in_order() {
        let move_by = |x: f64| Transform::translate(DVec3::new(x, 0.0, 0.0));
        let node = Node::new(Content::Group(vec![
            nested(2).with_transform(&move_by(1.0)),
            Node::new(Content::Group(Vec::new())).named("empty"),
            nested(0),
            nested(1).with_material(9),
        ]));
        let copy = node.clone();
        assert_eq!(format!("{copy:?}"), format!("{node:?}"));
        assert!(copy == node);
        let mut other = node.clone();
        let Content::Group(children) = &mut other.content else { panic!("a group") };
        children[3].name = Some("else".into());
        assert!(other != node);
        let Content::Group(children) = &mut other.content else { panic!("a group") };
        children[3].name = None;
        assert!(other == node);
        children_of(&mut other).pop();
        assert!(other != node);
    }

    fn children_of(node: &mut Node) -> &mut Vec<Node> {
        let Content::Group(children) = &mut node.content else { panic!("a group") };
        children
    }

    #[test]
    fn nothing_is_shown_deeper_than_a_world_may_be() {
        let shown = format!("{:?}", nested(100_000));
        assert!(shown.contains("nested too deep to be shown") && shown.matches("Group").count() == Node::MAX_NESTING);
        assert!(
            format!("{:?}", nested(Node::MAX_NESTING - 1)).contains("leaf"),
            "all is shown, and the level is as before"
        );
    }
}
