//! Scenes with arithmetic against the same scenes with plain numbers.

use super::{MAX_COPIES, MAX_KEPT_COPIES};
use crate::assets::MemoryAssets;
use crate::source::SceneSource;
use crate::text::{SceneDocument, read_scene_text};
use canaletto::scene::{Content, Scene};
use std::fmt::Write;

fn read(text: &str, set: &[&str]) -> Result<Scene, String> {
    let set: Vec<String> = set.iter().map(ToString::to_string).collect();
    let assets = MemoryAssets::new().with("leaf.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let (scene, _) = read_scene_text(text, "s", &assets, &set).map_err(|mistakes| mistakes.to_string())?;
    Ok(scene)
}

fn scene(text: &str) -> Scene {
    read(text, &[]).unwrap_or_else(|mistakes| panic!("{text}\n{mistakes}"))
}

fn mistake(text: &str) -> String {
    read(text, &[]).expect_err(text)
}

const CAMERA: &str = "camera { eye 0 0 9; center 0 0 0; fovy 40; size 8 8 }\n";

#[test]
fn every_place_of_a_number_takes_an_expression() {
    let with = "let r=2 n=3
        let h=\"r / 4\" wide=\"8 × n\"
        background h
        ambient \"h\" \"h / 2\" \"1 - h\"
        camera { eye 0 \"-r\" \"3 * n\"; center 0 0 0; fovy \"180 / 4\"; size wide \"wide / 2\" }
        film { samples \"n + 1\" }
        integrator \"whitted\" { max-depth n }
        texture \"t\" kind=\"ramp\" { stops 0 h h h  1 \"r / 2\" 0 0 }
        material \"m\" n=\"n * 10\" { kd h; opacity h; eta \"1 + h\"; texture \"t\" use=\"decal\" repeat=n }
        path \"p\" { points 0 0 0  r 0 0  r n 0 }
        group \"g\" { translate r \"r + 1\" 0; sphere \"b\" radius=r { center 0 n 0 } }
        light \"disk\" { position 0 n 0; normal 0 -1 0; radius h; points \"n * 5\" }
        spheres radius=h { points r 0 0  0 r 0 }
        box { min 0 0 0; max r r r; translate { key 1 0 0 0; key n r 0 0 }; rotate-y { key 1 h } }";
    let mut plain = with.to_owned();
    for (expression, number) in [
        ("let r=2 n=3\n", "\n"),
        ("let h=\"r / 4\" wide=\"8 × n\"\n", "\n"),
        ("\"h / 2\"", "0.25"),
        ("\"1 - h\"", "0.5"),
        ("\"h\"", "0.5"),
        ("\"-r\"", "-2"),
        ("\"3 * n\"", "9"),
        ("\"180 / 4\"", "45"),
        ("\"wide / 2\"", "12"),
        ("size wide", "size 24"),
        ("\"n + 1\"", "4"),
        ("\"r / 2\"", "1"),
        ("\"n * 10\"", "30"),
        ("\"1 + h\"", "1.5"),
        ("\"r + 1\"", "3"),
        ("\"n * 5\"", "15"),
        ("max-depth n", "max-depth 3"),
        ("repeat=n", "repeat=3"),
        ("radius=r", "radius=2"),
        ("radius=h", "radius=0.5"),
        ("key n", "key 3"),
    ] {
        assert!(plain.contains(expression), "{expression}");
        plain = plain.replace(expression, number);
    }
    // A bare name is a value of its own.
    for (name, number) in [("r", "2"), ("n", "3"), ("h", "0.5")] {
        for end in [" ", ";", "\n"] {
            while let Some(at) = plain.find(&format!(" {name}{end}")) {
                plain.replace_range(at + 1..at + 2, number);
            }
        }
    }
    assert_eq!(scene(with), scene(&plain));
}

#[test]
fn a_later_file_and_the_command_line_change_named_numbers() {
    let assets =
        MemoryAssets::new().with("base.kdl", "let r=2 d=\"2 * r\"\nsphere \"ball\" { center d 0 0; radius r }\n");
    let of = |text: &str, set: &[&str]| {
        let set: Vec<String> = set.iter().map(ToString::to_string).collect();
        let (scene, _) = read_scene_text(text, "s", &assets, &set).unwrap_or_else(|mistakes| panic!("{mistakes}"));
        let Content::Shape(canaletto::shape::Shape::Sphere(ball)) = scene.nodes[0].content else { panic!("a sphere") };
        (ball.center.x, ball.radius)
    };
    let base = format!("{CAMERA}include \"base.kdl\"\n");
    assert_eq!(of(&base, &[]), (4.0, 2.0));
    assert_eq!(of(&format!("{base}let r=5"), &[]), (10.0, 5.0));
    assert_eq!(of(&base, &["let.r=3"]), (6.0, 3.0));
    assert_eq!(of(&base, &["let.d=\"r / 2\""]), (1.0, 2.0));
    assert_eq!(of(&base, &["sphere.ball.radius=\"d + 1\""]), (4.0, 5.0));
    assert!(read("let r=1", &["let.s=3"]).unwrap_err().contains("no number of the scene is called \"s\""));
}

/// The scene with each repeat written out.
fn written_out(count: u32, copy: impl Fn(u32) -> String) -> Scene {
    scene(&(0..count).fold(CAMERA.to_owned(), |text, i| text + &copy(i) + "\n"))
}

#[test]
fn copies_equal_nodes_written_out() {
    let repeated = |text: &str| scene(&format!("{CAMERA}{text}"));
    let row = repeated("let gap=1.5\nrepeat 12 { sphere { center \"gap * i\" 0 \"i^2\"; radius \"0.1 + i / 10\" } }");
    let sphere = |x: f64, z: f64, r: f64| format!("sphere {{ center {x} 0 {z}; radius {r} }}");
    assert_eq!(row, written_out(12, |i| sphere(1.5 * f64::from(i), f64::from(i * i), 0.1 + f64::from(i) / 10.0)));
    // Several indices, of which the last one runs fastest, and named numbers of the copy.
    let grid =
        repeated("repeat x=4 z=3 { let r=\"(x + 1) / 10\" s=\"2 * r\"; box { min x 0 z; max \"x + s\" s \"z + s\" } }");
    assert_eq!(
        grid,
        written_out(12, |i| {
            let (x, z) = (f64::from(i / 3), f64::from(i % 3));
            let s = 2.0 * ((x + 1.0) / 10.0);
            format!("box {{ min {x} 0 {z}; max {} {s} {} }}", x + s, z + s)
        })
    );
    // Repeats in each other, in groups and with lights, instances and transforms.
    let nested = repeated(
        "group \"post\" { cylinder { base 0 0 0; top 0 1 0; radius 0.1 } }
        group { rotate-y 45; repeat 3 { let a=\"120 * i\"
            instance \"post\" { translate \"cos(a)\" 0 \"sin(a)\" }
            repeat j=\"i + 1\" { group { translate 0 j 0; repeat k=2 { light \"omni\" { position i j k; intensity \"0.1 * k\" } } } }
        } }",
    );
    let mut text = format!(
        "{CAMERA}group \"post\" {{ cylinder {{ base 0 0 0; top 0 1 0; radius 0.1 }} }}\ngroup {{ rotate-y 45\n"
    );
    for (i, (cos, sin)) in [(1.0, 0.0), (-0.5, 0.75f64.sqrt()), (-0.5, -0.75f64.sqrt())].into_iter().enumerate() {
        let _ = writeln!(text, "instance \"post\" {{ translate {cos} 0 {sin} }}");
        for j in 0..=i {
            let lights =
                (0..2).map(|k| format!("light \"omni\" {{ position {i} {j} {k}; intensity {} }}", 0.1 * f64::from(k)));
            let _ = writeln!(text, "group {{ translate 0 {j} 0; {} }}", lights.collect::<Vec<_>>().join("; "));
        }
    }
    let (nested, expected) =
        (serde_json::to_value(nested).unwrap(), serde_json::to_value(scene(&(text + "}"))).unwrap());
    assert_near(&nested, &expected);
}

/// Equal but for the last digits of numbers.
fn assert_near(a: &serde_json::Value, b: &serde_json::Value) {
    use serde_json::Value::{Array, Number, Object};
    match (a, b) {
        (Number(a), Number(b)) => assert!((a.as_f64().unwrap() - b.as_f64().unwrap()).abs() < 1e-14, "{a} {b}"),
        (Array(a), Array(b)) => {
            assert_eq!(a.len(), b.len());
            a.iter().zip(b).for_each(|(a, b)| assert_near(a, b));
        }
        (Object(a), Object(b)) => {
            assert_eq!(a.len(), b.len());
            a.iter().for_each(|(key, a)| assert_near(a, &b[key]));
        }
        _ => assert_eq!(a, b),
    }
}

#[test]
fn copies_with_names_materials_and_keys_are_kept() {
    let repeated = scene(&format!(
        "{CAMERA}repeat 3 {{
            material \"m{{i}}\" {{ kd \"i / 2\" 0.5 0; texture \"t{{i + 1}}\" }}
            texture \"t{{i + 1}}\" kind=\"ramp\" {{ stops 0 0 0 0  1 \"i / 3\" 1 1 }}
            sphere \"ball {{2 * i}}\" material=\"m{{i}}\" {{ center i 0 0; radius 1; translate {{ key 1 0 i 0; key 9 0 \"-i\" 0 }} }}
            mesh file=\"leaf.obj\" material=\"m{{i}}\"
            prototype \"p{{i}}\" {{ repeat j=2 {{ sphere {{ center j i 0; radius 0.5 }} }} }}
            instance \"p{{i}}\"
        }}"
    ));
    let expected = written_out(3, |i| {
        format!(
            "material \"m{i}\" {{ kd {0} 0.5 0; texture \"t{1}\" }}
            texture \"t{1}\" kind=\"ramp\" {{ stops 0 0 0 0  1 {2} 1 1 }}
            sphere \"ball {3}\" material=\"m{i}\" {{ center {i} 0 0; radius 1; translate {{ key 1 0 {i} 0; key 9 0 -{i} 0 }} }}
            mesh file=\"leaf.obj\" material=\"m{i}\"
            prototype \"p{i}\" {{ sphere {{ center 0 {i} 0; radius 0.5 }}; sphere {{ center 1 {i} 0; radius 0.5 }} }}
            instance \"p{i}\"",
            f64::from(i) / 2.0,
            i + 1,
            f64::from(i) / 3.0,
            2 * i
        )
    });
    assert_eq!(repeated, expected);
}

#[test]
fn many_copies_take_little_memory_and_few_steps() {
    let text =
        format!("{CAMERA}repeat x=1000 y=200 {{ sphere {{ center x y \"random(x + 1000 * y)\"; radius 0.4 }} }}");
    let assets = MemoryAssets::new();
    let mut document = SceneDocument::of_text(&text, "s", &assets, &[]).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    assert_eq!(document.nodes.len(), 2, "the copies aren't kept as text");
    let (scene, _) = document.scene(&assets, 0.0).unwrap();
    assert_eq!(scene.nodes.len(), 200_000);
}

#[test]
fn colors_have_names() {
    let of = |color: &str| scene(&format!("{CAMERA}material \"m\" {{ kd {color} }}\nbackground {color}"));
    let [r, g, b] = of("\"#ff8800\"").background.to_array();
    // IEC 61966-2-1 by its formula.
    assert!(r == 1.0 && (g - 0.246_201_3).abs() < 1e-6 && b == 0.0, "{r} {g} {b}");
    for same in ["\"#f80\"", "srgb \"#ff8800\"", "srgb \"#F80\"", "srgb 1 \"136 / 255\" 0"] {
        assert_eq!(of(same), of("\"#ff8800\""), "{same}");
    }
    assert_eq!(of("srgb 1 0.5 0").background.to_array()[1], canaletto::texture::srgb_decode(0.5));
    assert_eq!(of("orange"), of("\"#ffa500\""));
    assert_eq!(of("white"), of("1 1 1"));
    let property = scene(&format!("{CAMERA}material \"m\" kd=\"orange\" ks=\"#333\""));
    assert_eq!(property, scene(&format!("{CAMERA}material \"m\" {{ kd orange; ks \"#333\" }}")));
    let ramp = |stops: &str| scene(&format!("{CAMERA}texture \"t\" kind=\"ramp\" {{ {stops} }}"));
    assert_eq!(ramp("stops 0 black 0.5 0.25 0.25 0.25 1 \"#fff\""), ramp("stops 0 0 0 0 0.5 0.25 0.25 0.25 1 1 1 1"));
    assert_eq!(ramp("stops-alpha 0 red 1  1 srgb 0 0 1 0.5"), ramp("stops-alpha 0 1 0 0 1  1 0 0 1 0.5"));
    let keys = |a: &str, b: &str| scene(&format!("{CAMERA}background {{ key 1 {a}; key 5 {b} }}"));
    assert_eq!(keys("red", "srgb \"#00f\""), keys("1 0 0", "0 0 1"));
    // A named number is nearer than a colour.
    assert_eq!(scene(&format!("{CAMERA}let gold=0.5\nbackground gold")), scene(&format!("{CAMERA}background 0.5")));
    let repeated = scene(&format!("{CAMERA}repeat 2 {{ material \"m{{i}}\" {{ kd red; ks \"i / 2\" }} }}"));
    assert_eq!(repeated.materials[1].classic().ks.r, 0.5);
    for (wrong, message) in [
        ("background oragne", "did you mean \"orange\"?"),
        ("background \"#ff88\"", "background takes a colour, got the text \"#ff88\""),
        ("background srgb \"#xyz\"", "srgb takes a colour, or red, green and blue from 0 to 1"),
        ("background srgb 255 0 0", "srgb takes a colour, or red, green and blue from 0 to 1"),
        ("background red green", "background takes a colour: 1 or 3 numbers, or a name; got 6 values"),
    ] {
        assert!(mistake(&format!("{CAMERA}{wrong}")).contains(message), "{}", mistake(wrong));
    }
}

#[test]
fn media_have_names() {
    let of = |eta: &str| scene(&format!("{CAMERA}material \"m\" {{ kd 0; opacity 0; eta {eta} }}"));
    assert_eq!(of("glass"), of("1.5"));
    assert_eq!(of("\"crown-glass\""), of("1.52"));
    assert_eq!(of("diamond").materials[0].classic().eta, 2.42);
    assert_eq!(scene(&format!("{CAMERA}material \"m\" eta=\"water\" opacity=0")).materials[0].classic().eta, 1.33);
    assert!(mistake("material \"m\" { opacity 0; eta glas }").contains("did you mean \"glass\"?"));
}

#[test]
fn mistakes_are_told_once_at_their_column() {
    for (text, expected) in [
        ("sphere { center 0 0 0; radius \"2 * (3 + \" }", "1:39: error: a number is missing after this"),
        ("sphere { center 0 0 0; radius \"2 * rad\" }", "1:36: error: no number is called rad"),
        ("sphere { center 0 0 0; radius big }", "radius takes a number, got the text \"big\""),
        ("let big=2\nsphere { center 0 0 0; radius bg }", "2:31: error: no number is called bg"),
        ("let a=b b=1", "no number is called b"),
        ("let a=1\nlet a=2", "2:5: error: two numbers are called a"),
        ("let sin=1", "sin has a meaning in all expressions"),
        ("let ball-r=1", "\"ball-r\" can't be the name of a number"),
        ("let a=#true", "a takes a finite number or an expression in quotes"),
        ("let a 1", "let takes names with their numbers"),
        ("group { let a=1 }", "let stands at the top of a file"),
        ("let a=\"1 / 0\"", "1:10: error: this divides by 0"),
        ("repeat { }", "repeat takes how many copies there are"),
        ("repeat 2.5 { sphere { center i 0 0; radius 1 } }", "i counts to 2.5, which is no whole number"),
        ("repeat \"-1\" { sphere { center i 0 0; radius 1 } }", "i counts to -1"),
        ("repeat #true { }", "repeat takes a number or an expression in quotes"),
        ("repeat 2 { repeat 3 { sphere { center i 0 0; radius 1 } } }", "another number is called i"),
        ("repeat pi=2 { }", "pi has a meaning in all expressions"),
        ("repeat 9 { sphere { center \"1 / (i - 5)\" 0 0; radius 1 } }", "1:31: error: this divides by 0"),
        ("repeat 9 { sphere { center i 0 0; radius \"1 - i\" } }", "radius is 0; it must be more than 0"),
        ("repeat 9 { sphere \"a\" { center i 0 0; radius 1 } }", "two objects are called \"a\""),
        ("repeat 9 { sphere \"a{i\" { center i 0 0; radius 1 } }", "a { or } of this text has no other one"),
        ("repeat 9 { sphere \"a{j}\" { center i 0 0; radius 1 } }", "1:22: error: no number is called j"),
        ("repeat 9 { sphere { centre i 0 0; radius 1 } }", "did you mean center?"),
        ("repeat 9 { speer { center i 0 0 } }", "there is no node \"speer\""),
        ("repeat 100000000 { sphere { center i 0 0; radius 1 } }", "more than 4194304 copies"),
        ("repeat 1000000 { repeat j=1000000 { } }", "more than 4194304 copies"),
        ("repeat a=1e300 b=1e300 { }", "more than 4194304 copies"),
        ("repeat 1000000 { sphere \"s{i}\" { center i 0 0; radius 1 } }", "more than 65536 objects"),
    ] {
        let found = mistake(text);
        assert!(found.contains(expected), "{text}\n{found}");
        assert_eq!(found.matches("error: ").count(), 1, "{text}\n{found}");
    }
    assert_eq!((MAX_COPIES, MAX_KEPT_COPIES), (4_194_304, 65_536));
}
