//! A scene that grows from step to step, as a reader of the tutorial writes it.

/// Lines of a scene text, from a node's first line (or the comment before it) to its last one.
struct NodeLines<'a> {
    /// The node's word and its name, or its first value if it has no name.
    key: (&'a str, &'a str),
    /// Whether `/-` stands before the node.
    taken_out: bool,
    lines: Vec<&'a str>,
}

/// A node's word and name. `name="lamp"` counts before the value after the word.
fn key(line: &str) -> (&str, &str) {
    let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
    let named = rest.split_once("name=\"").map(|(_, name)| name);
    let name = named.or_else(|| rest.strip_prefix('"')).and_then(|name| name.split('"').next());
    (word, name.unwrap_or(""))
}

/// The nodes at the top of a scene. A node begins with its word at the start of a line.
fn top_nodes(text: &str) -> Vec<NodeLines<'_>> {
    let mut nodes: Vec<NodeLines> = Vec::new();
    let mut before = Vec::new();
    for line in text.lines() {
        if line.is_empty() || line.starts_with("//") {
            before.push(line);
        } else if line.starts_with([' ', '}']) {
            nodes.last_mut().expect("a node begins before its inner lines").lines.push(line);
        } else {
            let active = line.strip_prefix("/- ");
            let mut lines = std::mem::take(&mut before);
            lines.push(line);
            nodes.push(NodeLines { key: key(active.unwrap_or(line)), taken_out: active.is_some(), lines });
        }
    }
    assert!(before.is_empty(), "a comment comes before its node: {before:?}");
    nodes
}

/// A scene with more nodes. A node of the same word and name as an earlier one takes its place, others come at the end.
/// The scene's first line is a comment with its name.
pub(crate) fn with_nodes(scene: &str, more: &str) -> String {
    let (name, scene) = scene.split_once('\n').expect("the scene begins with its name");
    let mut nodes = top_nodes(scene);
    for new in top_nodes(more) {
        match nodes.iter_mut().find(|old| old.key == new.key) {
            Some(old) => *old = new,
            None => {
                assert!(!new.taken_out, "{:?} isn't in the scene", new.key);
                nodes.push(new);
            }
        }
    }
    let lines = nodes.iter().flat_map(|node| &node.lines).copied();
    std::iter::once(name).chain(lines).flat_map(|line| [line, "\n"]).collect()
}

#[test]
fn nodes_replace_their_namesakes() {
    let scene = "// a.kdl\ncamera { fovy 30 }\nlight \"omni\" name=\"lamp\" { position 0 1 0 }\nsphere \"ball\" {\n    radius 1\n}\n";
    let more = "sphere \"drop\" { radius 2 }\nlight \"disk\" name=\"lamp\" {\n    radius 1\n}\n/- camera { fovy 30 }\n";
    let all = "// a.kdl\n/- camera { fovy 30 }\nlight \"disk\" name=\"lamp\" {\n    radius 1\n}\nsphere \"ball\" {\n    radius 1\n}\nsphere \"drop\" { radius 2 }\n";
    assert_eq!(with_nodes(scene, more), all);
    assert_eq!(with_nodes(scene, ""), scene);
}
