//! The value after an object's word is its name; the older forms `name=` and `of=` read alike.

use crate::assets::MemoryAssets;
use crate::text::read_scene_text;
use canaletto::scene::Scene;

fn scene(text: &str, set: &[&str]) -> Scene {
    let set: Vec<String> = set.iter().map(ToString::to_string).collect();
    let assets = MemoryAssets::new().with("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    read_scene_text(text, "s", &assets, &set).unwrap_or_else(|e| panic!("{text}\n{e}")).0
}

fn mistakes(text: &str) -> String {
    read_scene_text(text, "s", &MemoryAssets::new(), &[]).unwrap_err().to_string()
}

#[test]
fn old_forms_of_names_read_as_the_new_ones() {
    let new = "
        sphere \"ball\" { center 0 0 0; radius 1 }
        mesh \"leaf\" file=\"a.obj\" { rotate-y 3 }
        spheres \"dots\" radius=1 { points 0 0 0 }
        group \"lamp\" { sphere \"bulb\" { center 0 5 0; radius 1 }; light \"omni\" name=\"glow\" { position 0 5 0 } }
        prototype \"post\" { box { min 0 0 0; max 1 1 1 } }
        instance \"post\" { translate 3 0 0 }
        instance \"lamp\" name=\"second\" { translate 9 0 0 }
        group { instance \"ball\" { translate 1 2 3 } }";
    let mut old = new.to_owned();
    for word in ["sphere", "mesh", "spheres", "group", "prototype"] {
        old = old.replace(&format!("{word} \""), &format!("{word} name=\""));
    }
    old = old.replace("instance \"", "instance of=\"");
    let inner = old
        .replace("sphere name=\"ball\" {", "sphere { name \"ball\"; ")
        .replace("instance of=\"post\" {", "instance { of \"post\"; ");
    assert_ne!(old, inner);
    assert_eq!(scene(new, &[]), scene(&old, &[]));
    assert_eq!(scene(new, &[]), scene(&inner, &[]));
    let names: Vec<_> = scene(new, &[]).nodes.iter().filter_map(|node| node.name.clone()).collect();
    assert_eq!(names, ["ball", "leaf", "dots", "lamp", "second"].map(Box::from));
}

#[test]
fn values_are_set_by_names_of_both_forms() {
    for text in ["sphere \"ball\" { center 0 0 0; radius 1 }", "sphere name=\"ball\" { center 0 0 0; radius 1 }"] {
        let set = scene(text, &["sphere.ball.radius=3"]);
        assert_eq!(set.nodes, scene(&text.replace("radius 1", "radius 3"), &[]).nodes);
    }
}

/// Long lists of nodes are packed while they wait to be read.
#[test]
fn names_in_long_lists_are_read_too() {
    let other = "sphere { center 0 0 0; radius 1 }\n".repeat(1200);
    let some = |form: &str| {
        let instances = |i: u32| {
            format!(
                "instance {form}\"a\" {{ translate {i} 0 0 }}\ninstance {form}\"b\"\nsphere \"s{i}\" {{ center 1 1 1; radius 1 }}\n"
            )
        };
        let all: String = (0..400).map(instances).collect();
        let balls = "sphere \"a\" { center 0 0 0; radius 1 }\nsphere \"b\" { center 5 0 0; radius 1 }\n";
        scene(&format!("{other}{all}{balls}"), &[])
    };
    assert_eq!(some(""), some("of="));
    assert_eq!((some("").prototypes.len(), some("").nodes.len()), (2, 1200 + 1200 + 2));
}

#[test]
fn wrong_names_are_told_at_their_place() {
    assert!(mistakes("sphere \"a\" name=\"b\" { center 0 0 0; radius 1 }").contains("sphere has two names"));
    assert!(mistakes("instance \"a\" of=\"a\"\ngroup \"a\"").contains("instance has two"));
    let twice = mistakes("group \"a\"\nsphere \"a\" { center 0 0 0; radius 1 }");
    assert!(twice.contains("2:8: error: two objects are called \"a\""), "{twice}");
    let unknown = mistakes("instance \"lam\"\ngroup \"lamp\"");
    assert!(unknown.contains("1:10: error: there is no object \"lam\"") && unknown.contains("did you mean \"lamp\"?"));
    assert!(mistakes("sphere 3 { center 0 0 0; radius 1 }").contains("takes only a name right after its word"));
    assert!(mistakes("prototype { sphere { center 0 0 0; radius 1 } }").contains("prototype needs its name\n"));
}
