//! The reference of the scene text, `docs/scene-text.md`, generated from the schema of the decoder.

use super::arithmetic::{CONSTANTS, FUNCTIONS, MAX_COPIES, MAX_KEPT_COPIES, MEDIA};
use super::nodes::{
    self, CAMERA, CAMERA_FOLLOW, CAMERA_MOTION, COLORMAP, CONDUCTOR, CYLINDERS, ENVIRONMENTS, FILM, FILTER, FOLLOW,
    INCLUDE, LENS, LIGHTS, MATERIAL_NODE, MEDIUM, MOTION, OBJECTS, POINT_FOLLOW, SAMPLE, SETTINGS, STANDARD,
    STANDARD_BLOCKS, SURFACE_TEXTURE, TEXTURES, TRANSFORMS, kind_of,
};
use super::schema::{FieldSchema, NodeSchema, ValueType};
use super::syntax::{MAX_DEPTH, MAX_ITEMS};
use crate::animation::Ease;
use canaletto::Named;
use canaletto::world::World;
use std::fmt::Write;

/// The reference of the scene text as Markdown.
pub fn reference_markdown() -> String {
    let mut out = String::from(
        "<!-- Made from the schema of the scene text. After changing it: CANALETTO_BLESS=1 cargo test -p canaletto-io \
         -->\n\n",
    );
    out.push_str(INTRODUCTION);
    out.push_str("\n## Settings\n");
    let inner: &[(&NodeSchema, &[(&NodeSchema, &str)])] = &[
        (&FILM, &[(&SAMPLE, "film: sample"), (&FILTER, "film: filter")]),
        (&CAMERA, &[(&LENS, "camera: lens"), (&CAMERA_MOTION, "camera: motion")]),
        (
            &MATERIAL_NODE,
            &[
                (&CONDUCTOR, "material: conductor"),
                (&MEDIUM, "material: medium"),
                (&STANDARD, "material: standard"),
                (STANDARD_BLOCKS[0], "material: standard: base"),
                (STANDARD_BLOCKS[1], "material: standard: specular"),
                (STANDARD_BLOCKS[2], "material: standard: transmission"),
                (STANDARD_BLOCKS[3], "material: standard: subsurface"),
                (STANDARD_BLOCKS[4], "material: standard: coat"),
                (STANDARD_BLOCKS[5], "material: standard: fuzz"),
                (STANDARD_BLOCKS[6], "material: standard: thin-film"),
                (STANDARD_BLOCKS[7], "material: standard: emission"),
                (&SURFACE_TEXTURE, "material: texture"),
            ],
        ),
    ];
    for setting in SETTINGS {
        node(&mut out, setting.schema, setting.schema.name);
        for (words, title) in inner.iter().filter(|(of, _)| std::ptr::eq(*of, setting.schema)).flat_map(|(_, all)| *all)
        {
            node(&mut out, words, title);
        }
        if std::ptr::eq(setting.schema, &INCLUDE) {
            out.push_str(INCLUDES);
        }
    }
    arithmetic(&mut out);
    out.push_str(ENVIRONMENT_RULES);
    for environment in ENVIRONMENTS {
        let title = format!("environment \"{}\"", kind_of(&environment.schema));
        node(&mut out, &environment.schema, &title);
    }
    out.push_str(TEXTURE_RULES);
    for texture in TEXTURES {
        node(&mut out, &texture.schema, &format!("texture kind=\"{}\"", kind_of(&texture.schema)));
    }
    out.push_str("\n## Objects\n\nThe value after an object's word is its name: `sphere \"ball\" { … }`. Each object may have a `material`, and transforms\nin its braces.\n");
    for object in OBJECTS {
        node(&mut out, &object.schema, object.schema.name);
        if std::ptr::eq(*object, &CYLINDERS) {
            out.push_str(CLOUDS);
            node(&mut out, &COLORMAP, "spheres, cylinders: colormap");
        }
    }
    out.push_str("\n## Lights\n\nLights may stand in groups and move with them, by transforms of their own too.\n");
    for light in LIGHTS {
        node(&mut out, &light.schema, &format!("light \"{}\"", kind_of(&light.schema)));
    }
    out.push_str(TRANSFORM_RULES);
    out.push_str("| word | takes | meaning |\n|---|---|---|\n");
    for word in TRANSFORMS.iter().map(|transform| &transform.schema) {
        let _ = writeln!(out, "| `{}` | {} | {} |", word.name, word.value_type, word.doc);
    }
    out.push_str("\n## Motion blur\n");
    node(&mut out, &MOTION, "motion, in an object, group or light");
    motion(&mut out);
    let _ = write!(
        out,
        "\n{NAMES}\n{SET}\n## Limits\n\nBlocks may stand {MAX_DEPTH} deep in each other. A scene's text may have {} \
         MiB, and each file of it {MAX_ITEMS} nodes and values; large data belongs into files of its own, as meshes \
         and clouds. A scene expands to at most {} copies of things, of which at most {} are kept one by one (not \
         those in a prototype that is repeated as a whole), {} points of light and {} planes, and groups and \
         instances stand at most {} deep in each other.\n",
        super::files::MAX_TEXT >> 20,
        World::MAX_COPIES,
        World::MAX_INSTANCES,
        World::MAX_LIGHT_POINTS,
        World::MAX_UNBOUNDED,
        World::MAX_NESTING,
    );
    out
}

fn arithmetic(out: &mut String) {
    out.push_str(ARITHMETIC);
    out.push_str("| function | value |\n|---|---|\n");
    for function in FUNCTIONS {
        let arguments = ["x", "x, y"][function.arguments - 1];
        let _ = writeln!(out, "| `{}({arguments})` | {} |", function.name, function.doc);
    }
    for (name, value) in CONSTANTS {
        let _ = writeln!(out, "| `{name}` | {value} |");
    }
    out.push_str(REPEATS);
    let _ = writeln!(
        out,
        "All repeats of a scene make up to {MAX_COPIES} copies, and up to {MAX_KEPT_COPIES} of objects with names or \
         keys, and of settings."
    );
    out.push_str(COLORS);
    out.push_str("| medium | η | |\n|---|---|---|\n");
    for (name, eta, doc) in MEDIA {
        let _ = writeln!(out, "| `\"{name}\"` | {eta} | {doc} |");
    }
}

fn motion(out: &mut String) {
    out.push_str(MOTION_RULES);
    out.push_str("| ease | meaning |\n|---|---|\n");
    for ease in Ease::ALL {
        let _ = writeln!(out, "| `\"{}\"` | {} |", ease.name(), ease.meaning());
    }
    out.push_str(TURNS);
    for (title, words) in [
        ("follow, in an object", &FOLLOW),
        ("follow, in a camera", &CAMERA_FOLLOW),
        ("follow, in place of a point", &POINT_FOLLOW),
    ] {
        node(out, words, title);
    }
}

fn node(out: &mut String, words: &NodeSchema, title: &str) {
    let _ = write!(out, "\n### {title}\n\n{}\n\n", words.doc);
    if !words.example.is_empty() {
        let _ = write!(out, "```kdl\n{}\n```\n\n", words.example);
    }
    let rows: Vec<(String, &FieldSchema)> = words
        .argument
        .iter()
        .filter(|word| !matches!(word.value_type, ValueType::Keyword([_])) || !(word.default)().is_empty())
        .map(|word| (format!("*{}*", word.name), word))
        .chain(words.beside_argument().map(|word| (format!("`{}`", word.name), word)))
        .collect();
    if !rows.is_empty() {
        out.push_str("| word | takes | default | meaning |\n|---|---|---|---|\n");
    }
    for (name, word) in rows {
        let default = match (word.default)() {
            text if !text.is_empty() && word.needed => format!("needed; without the node {text}"),
            text if !text.is_empty() => text,
            _ if word.needed => "needed".into(),
            _ => "—".into(),
        };
        let _ = writeln!(out, "| {name} | {} | {default} | {} |", word.value_type, word.doc);
    }
    if words.objects {
        let list: Vec<String> = nodes::objects().map(|name| format!("`{name}`")).collect();
        let _ = write!(out, "\nInside may stand: {}.\n", list.join(", "));
    }
}

const INTRODUCTION: &str = r#"# The scene text

A scene is a text of [KDL 2](https://kdl.dev): nodes, one on each line or with `;` between them. A node is a word,
its values with blanks between them, and a block in braces with the words that belong to it.

```kdl
background 0.4 0.4 0.4
ambient 0.2 0.2 0.2
camera { eye 100 40 40; center 0 0 0; up 0 1 0; fovy 90; size 230 230 }
material "blue"   { kd 0 0 1;     ks 1 1 1; n 50 }
material "yellow" { kd 0.7 0.7 0; ks 1 1 1; n 40 }
sphere material="blue" { center 0 20 0; radius 25 }
box material="yellow"  { min -80 -50 -50; max 50 -45 50 }
light "omni" { position 40 120 0; intensity 0.8 }
```

A single value may also stand before the block: `sphere radius=25 { center 0 20 0 }` and
`sphere { center 0 20 0; radius 25 }` are the same. The order of words counts only for transforms and includes.

`//` starts a comment, `/* */` encloses one, and `/-` before a node, value or block comments it out. `#true` and
`#false` are written with `#`; a word such as `caps` alone means `#true`. Texts stand in quotes; a single word of
letters, digits, `-` and `_` may go without.

**Space** is right-handed with y upwards, though nothing depends on y but the camera's default `up`. **Angles** are in
degrees. **Lengths** are in any unit; a scene scaled by a power of two gives the same picture to the bit. **Colours** are
linear red, green and blue, without an upper limit; one number is a gray, and [names](#colours-and-media-by-name) stand for
colours. In the tables, *words in italics* are values
right after the node's name.

`canaletto check scene.kdl` reports every mistake of a scene at once.
"#;

const INCLUDES: &str = r#"
The included file's nodes stand where `include` stands, with the same names for all. A file that is included twice is read
once. Of `background`, `ambient`, `film`, `integrator` and cameras of the same name, one in a later place changes the words
that it has and keeps the rest: a scene from another side, or at another stage, is its base and what differs.

```kdl
include "base.kdl"
camera { eye 0 100 0; up 0 0 1 }
integrator "whitted" { stage "shadow" }
```

Files must lie below the folder of the scene, unless `--allow-outside` is given.
"#;

const ARITHMETIC: &str = r#"
## Numbers with names

`let` gives names to numbers. Wherever a number can stand, an expression can: a bare name, or anything in quotes.

```kdl
let r=2 count=12
let step="360 / count"
sphere { center 0 r 0; radius r }
torus { center 0 "r + 0.5" 0; axis 0 1 0; radius "2 × r"; tube "sqrt(r) / 10" }
```

There are `+ - * / ^` and parentheses, also written `− × · ÷`. `^` is a power and binds most. A name has letters, digits and
`_`. A number knows the names above it; all other nodes know all of them. In a later file, `let r=3` changes the number of an
earlier one, and so does `--set let.r=3`: what depends on it changes, too.

"#;

const REPEATS: &str = r#"
## Copies

`repeat` makes copies of what stands in it. The index `i` counts from 0. Named counts make rows of rows, the last one counts
fastest, and `let` names numbers of each copy:

```kdl
repeat 12 { sphere { center "3 * cos(30 * i)" 0 "3 * sin(30 * i)"; radius 0.5 } }
repeat x=20 z=20 {
    let h="0.2 + random(x + 20 * z)"
    box { min x 0 z; max "x + 0.8" h "z + 0.8" }
}
```

Repeats may stand in each other, with different names of their indices, and in groups. Objects need different names:
braces in a text hold a number. At the top of a file, materials and other nodes may be copied, too:

```kdl
repeat 5 {
    material "m{i}" { kd "i / 4" 0.2 0.5 }
    sphere "ball {i + 1}" material="m{i}" { center i 0 0; radius 0.4 }
}
```

"#;

const COLORS: &str = r##"
## Colours and media by name

A colour is three linear numbers, one for a gray, the name of a colour in CSS, or a number as in CSS. Names and such numbers
are on the sRGB curve and are converted to linear light. `srgb` before three numbers from 0 to 1 says the same of them.

```kdl
background "skyblue"
material "orange" { kd "#ff8800"; ks srgb 0.2 0.2 0.2 }
material "same" { kd srgb "#ff8800" }
texture "dawn" kind="ramp" { stops 0 "midnightblue"  0.6 "#ff8844"  1 1 1 0.9 }
```

`eta` knows media by name, the chapter's box 5.7 first: `material "lens" { kd 0; opacity 0; eta "glass" }`.

"##;

const ENVIRONMENT_RULES: &str = r#"
## Environments

What surrounds the scene, infinitely far, instead of the background. There is one at most; in a later file, another one takes
its place. It can be turned by `rotate-x`, `rotate-y`, `rotate-z` and `rotate`. See [What surrounds the scene](environment.md).
"#;

const TEXTURE_RULES: &str = r#"
## Textures

A texture is a node of its own with a name, and materials refer to it by that. Textures that name the same file share its
image. What the kinds are good for, and what their filters do, is told in [Textures](textures.md).
"#;

const CLOUDS: &str = r#"
### Numbers of clouds

A few stand in the node itself (`points`, `axes`). `data` holds lines in one text:

```kdl
spheres material="blue" { data """
    # x y z radius
    0 0 0  1
    2 0 0  0.5
    """
}
```

Every line has the same count of numbers. A colour replaces the material's kd. Files are tables in the same columns
(`.csv`, `.tsv`, `.xyz`, `.txt`), atoms of an XYZ file, PLY, arrays of NumPy (`.npy`, `.npz`), or little-endian `f32`
records (`.bin`: `x y z radius`, or `x y z x y z radius`); see [Files that come in](import.md).
"#;

const TRANSFORM_RULES: &str = r#"
## Transforms

Transforms happen in the order in which they are written, the first line first, each in the space around the object:
`scale 10; rotate-y 30; translate 0 1 0` scales, then turns what is scaled, then moves what is turned. A group's transforms
come after those of what stands in it.

"#;

const MOTION_RULES: &str = r#"
## Motion

Any word may hold keys in place of its values: a frame, and the value at it. Between keys the value moves, before the
first and after the last one it holds. Keys stand in the order of time; a frame may be a fraction, and counts in seconds
after `animation { keys "seconds" }`.

```kdl
camera { eye { key 1  100 40 40; key 100  0 40 108 }; center 0 0 0 }
material "blue" { kd { key 1  0 0 1; key 50  1 0 0 } }
sphere material="blue" {
    center 0 0 0; radius 25
    translate { key 1  0 80 0 ease="in"; key 13  0 0 0 ease="out"; key 25  0 80 0 }
    rotate-y { key 1 0; key 25 720; ease "linear" }
}
```

`ease` beside the keys says how all of them go on, `ease=` in a key how this one does:

"#;

const TURNS: &str = r#"
Whole numbers are rounded, and what isn't a number (words, names, `#true`) changes at its keys, as does `matrix`. Names, the
camera's `size` and `crop` stay.

Degrees count: `rotate-y { key 1 0; key 25 720 }` turns twice. With `turn "shortest"` beside the keys a rotation goes the
short way round. `rotate` does so by itself if its axes differ from key to key.

A path is followed by an object (`follow` is a transform, in the order of transforms), by a camera, and by any point.

```kdl
path "rail" { points -9 2 9  0 1 5  9 2 9 }
camera { follow "rail" { at { key 1 0; key 100 1; ease "in-out" } }; center 0 0 0 }
cone { base 0 0 0; top 0 0 1; radius 0.3; follow "rail" { at { key 1 0; key 100 1 }; face 0 0 1 } }
light "spot" { position 0 9 0; target { follow "rail" { at 0.5 } }; outer 20 }
```
"#;

const NAMES: &str = r#"## Names

Materials, textures, cameras and objects (groups and lights among them) have names of their own: an object may be called like a
material, but no two objects alike. Anything may be used before the place where it stands. An instance repeats any named
object, light, group or prototype; what is repeated may stand in a group and is also drawn there, except prototypes.
"#;

const SET: &str = r#"## Values from the command line

`--set` changes a value before the scene is read: `--set integrator.max-depth=3`, `--set background="0 0 0"`,
`--set material.glass.eta=1.4`, `--set light.key.intensity="1 1 1"`, `--set 'film.sample="jittered" n=4'`. The path is a
node's word, its name where it has one, the words of blocks, and a word in the last one:
`--set material.gold.standard.specular.roughness=0.4`, `--set camera.lens.radius=0.1`. Without a name all nodes of that
word change: `--set camera.fovy=60`. A block that isn't there is made. Of several blocks of one word the text after it
chooses: `--set material.wall.texture.bricks.repeat=4`. A key is chosen by its time:
`--set 'sphere.ball.center.key.50=1 2 3'`. `--set integrator=path` and `--set environment=sky` choose a kind,
`--set let.n=3` changes a number, and `--set repeat.i=12` a number of copies. Quotes keep a name with dots together:
`--set 'material."a.b".kd=1'`.
"#;
