//! Pictures without a background: their alpha in PNG, EXR and animated PNG, against composites with the background.

mod support;

use canaletto::film::srgb_encode;
use canaletto::texture::srgb_decode;
use canaletto_io::picture::Decoded;
use std::fs;
use support::Folder;

/// Renders the scene with flags.
#[track_caller]
fn render(folder: &Folder, flags: &str, name: &str) -> Decoded {
    folder.says(&format!("render s.kdl -q -o {name} {flags}"), 0, &[]);
    folder.picture(name)
}

/// Red, green, blue and alpha of each pixel.
#[track_caller]
fn rgba(picture: &Decoded) -> Vec<[f32; 4]> {
    let ([r, g, b], a) = (picture.image.rgb().unwrap(), picture.image.channel("A").expect("an alpha"));
    (0..a.len()).map(|i| [r[i], g[i], b[i], a[i]]).collect()
}

fn rgb(picture: &Decoded) -> Vec<[f32; 3]> {
    let [r, g, b] = picture.image.rgb().unwrap();
    (0..r.len()).map(|i| [r[i], g[i], b[i]]).collect()
}

/// Surfaces whose light doesn't depend on the background: a dark ball before a bright one, one of half coverage, and
/// one of half opacity that bends nothing. By paths they must not scatter: they emit.
const SCENE: &str = r#"
camera { eye 0 0 10; center 0 0 0; fovy 30; size 40 24 }
material "bright" { kd 0.8 0.5 0.2; emission 0.3 0.2 0.1 }
material "black"  { kd 0 }
material "half"   { kd 0.2 0.4 0.6; emission 0.1 0.3 0.2; coverage 0.5 }
material "film"   { kd 0 0.06 0.06; emission 0 0.05 0.1; opacity 0.25; eta 1 }
sphere material="bright" { center -2.5 0.5 0; radius 1.3 }
sphere material="black" { center -1.3 -0.4 2; radius 0.8 }
sphere material="half" { center 1 0.3 0; radius 1.2 }
triangle material="film" { a 0.4 -2 1; b 4 -2 1; c 2.5 2 1 }
light "omni" { position 5 8 9; intensity 0.7 }
"#;

/// Over any background the picture is the one with that background, in linear light: C + (1 − a) B, for all integrators
/// and ways of sampling. Over black it has the same bits.
#[test]
fn composites_are_pictures_with_that_background() {
    let emitting =
        SCENE.replace("kd 0.8 0.5 0.2", "kd 0").replace("kd 0.2 0.4 0.6", "kd 0").replace("kd 0 0.06 0.06", "kd 0");
    let matte = SCENE.replace("emission 0.3 0.2 0.1 ", "").replace("emission 0.1 0.3 0.2; ", "");
    let matte = matte.replace("emission 0 0.05 0.1; ", "");
    for (scene, flags) in [
        (SCENE, ""),
        (SCENE, "--pattern regular --samples 9"),
        (SCENE, "--pattern jittered --samples 4 --set film.filter=gaussian"),
        (SCENE, "--samples 5 --set film.filter=mitchell"),
        (SCENE, "--integrator zbuffer --samples 4"),
        (&matte, "--integrator radiosity --samples 4 --set integrator.error=0.5"),
        (&emitting, "--integrator path --samples 6"),
        (&emitting, "--integrator path --samples 4 --pattern jittered"),
    ] {
        let folder = Folder::new("s.kdl", scene);
        let seen = rgba(&render(&folder, &format!("{flags} --background none"), "a.exr"));
        let over = |color: [f32; 3]| {
            let [r, g, b] = color;
            let text = format!("{scene}background {r} {g} {b}\n");
            fs::write(folder.path("s.kdl"), text).unwrap();
            let picture = render(&folder, flags, "b.exr");
            assert!(picture.image.channel("A").is_none());
            rgb(&picture)
        };
        let (black, colored) = (over([0.0; 3]), over([1.0, 2.0, 0.5]));
        let (mut covered, mut edges) = (0, 0);
        for (i, &[r, g, b, a]) in seen.iter().enumerate() {
            // A z-buffer's and a path's half coverage is chance.
            let exact = !flags.contains("path");
            assert!(!exact || [r, g, b] == black[i], "{flags} {i}: {:?} over black {:?}", seen[i], black[i]);
            for (c, (own, back)) in [r, g, b].into_iter().zip([1.0, 2.0, 0.5]).enumerate() {
                let error = (own + (1.0 - a) * back - colored[i][c]).abs();
                let most = if exact { 2e-6 } else { 0.5 * back };
                assert!(error <= most, "{flags} pixel {i}: {:?} for {:?}", seen[i], colored[i]);
            }
            covered += u32::from(a == 1.0);
            edges += u32::from(a > 0.0 && a < 1.0);
        }
        assert!(covered > 60 && seen[0] == [0.0; 4], "{flags}: {covered} {:?}", seen[0]);
        assert!(edges > 30 || flags.contains("zbuffer"), "{flags}: {edges}");
        // Chance evens out.
        if flags.contains("path") {
            let sum = |of: &dyn Fn(usize) -> f32| (0..seen.len()).map(of).sum::<f32>() / seen.len() as f32;
            let (own, whole) = (sum(&|i| seen[i][0] + 1.0 - seen[i][3]), sum(&|i| colored[i][0]));
            assert!((own - whole).abs() < 0.01, "{flags}: {own} {whole}");
        }
    }
}

/// A backdrop has its own colours wherever nothing is, whatever exposure and tone are. In linear light the picture is
/// C + (1 − a) B. Formats without alpha take it, too, and a film.
#[test]
fn backdrops_keep_their_colors() {
    let folder = Folder::new("s.kdl", SCENE);
    fs::write(folder.path("page.kdl"), "camera { eye 0 0 9; size 10 10 }\nbackground 1 0.5 0.25\n").unwrap();
    folder.says("render page.kdl -q -o page.png", 0, &[]);
    let seen = rgba(&render(&folder, "--background none", "a.exr"));
    let [r, g, b] = [255.0, 0.0, 51.0].map(|v: f32| srgb_decode(v / 255.0));
    let exr = rgb(&render(&folder, "--background #ff0033", "b.exr"));
    for (i, &[own_r, own_g, own_b, a]) in seen.iter().enumerate() {
        let expected = [own_r + (1.0 - a) * r, own_g + (1.0 - a) * g, own_b + (1.0 - a) * b];
        assert!((0..3).all(|c| (exr[i][c] - expected[c]).abs() < 1e-6), "{i}: {:?} for {expected:?}", exr[i]);
    }
    let corner = |name: &str| {
        let picture = folder.picture(name);
        assert!(picture.image.channel("A").is_none(), "{name}");
        let all = rgb(&picture);
        [all[0], all[40 * 23]].map(|color| color.map(|v| (v * 255.0).round() as i32))
    };
    for flags in ["", "--exposure 3 --tone agx", "--integrator path --samples 4", "--integrator zbuffer"] {
        render(&folder, &format!("{flags} --background #ff0033"), "b.png");
        assert_eq!(corner("b.png"), [[255, 0, 51]; 2], "{flags}");
    }
    render(&folder, "--background #fff,#000", "b.webp");
    let [top, bottom] = corner("b.webp").map(|color| color[0]);
    assert!((245..=255).contains(&top) && (0..=10).contains(&bottom), "{top} {bottom}");
    render(&folder, "--background #fff --jpeg-quality 100", "b.jpg");
    assert!(corner("b.jpg").as_flattened().iter().all(|v| *v >= 253), "{:?}", corner("b.jpg"));
    folder.says("render s.kdl -q -o b.gif --frames 1-2 --background #fff", 0, &[]);
    // A picture covers all. This one is nothing but its background.
    render(&folder, "--background page.png", "b.png");
    assert_eq!(corner("b.png"), [[255, 188, 137]; 2]);
    folder.says("info b.png", 0, &["--background page.png"]);
}

/// What can't be a backdrop is refused before rendering, and no output replaces one.
#[test]
fn wrong_backdrops_are_named() {
    let folder = Folder::new("s.kdl", SCENE);
    folder.says("render s.kdl -o a.png --background nothing", 2, &["a colour such as #ffffff"]);
    folder.says("render s.kdl -o a.png --background no.jpg", 3, &["--background no.jpg", "no such file"]);
    fs::write(folder.path("text.png"), "text").unwrap();
    folder.says("render s.kdl -o a.png --background text.png", 3, &["--background text.png"]);
    folder.says("render s.kdl -q -o a.png", 0, &[]);
    folder.says("render s.kdl -o a.png --background a.png", 2, &["a.png"]);
    folder.says("render s.kdl -o a.jpg --background none", 2, &["JPEG has no alpha", "WebP"]);
    folder.says("render s.kdl -o a.png --jpeg-quality 80", 2, &["--jpeg-quality is for JPEG"]);
}

/// Adaptive sampling refines edges that only alpha has: a black ball before nothing.
#[test]
fn adaptive_sampling_sees_alpha() {
    let ball = r#"
camera { eye 0 0 10; center 0 0 0; fovy 20; size 24 24 }
film { sample "adaptive" n=4 threshold=0.1 }
material "black" { kd 0 }
sphere material="black" { center 0 0 0; radius 1.2 }
light "omni" { position 5 8 9 }
"#;
    let folder = Folder::new("s.kdl", ball);
    let seen = rgba(&render(&folder, "--background none", "a.exr"));
    let edges: Vec<f32> = seen.iter().map(|p| p[3]).filter(|a| *a > 0.0 && *a < 1.0).collect();
    assert!(edges.iter().any(|a| (a * 16.0).fract() == 0.0 && (a * 8.0).fract() != 0.0), "{edges:?}");
    // The area of the disk: 2.4 of the picture's 10 tan 10° · 2 across.
    let side = 2.0 * 10.0 * 10f64.to_radians().tan() / 24.0;
    let radius = 10.0 * (1.2f64 / 10.0).asin().tan();
    let area: f64 = seen.iter().map(|p| f64::from(p[3])).sum();
    let expected = std::f64::consts::PI * (radius / side).powi(2);
    assert!((area / expected - 1.0).abs() < 0.01, "{area} for {expected}");
}

/// What is seen straight on lets the background through by closed forms; what bends light or mirrors it is opaque, and
/// still shows the background.
#[test]
fn alpha_is_what_a_ray_meets() {
    let scene = |integrator: &str, body: &str| {
        format!(
            "camera {{ eye 0 0 8; center 0 0 0; fovy 4; size 1 1 }}\nintegrator \"{integrator}\"\nbackground 0.5 0.6 0.7\n\
             film {{ samples 64 }}\n{body}\nlight \"omni\" {{ position 5 5 5 }}\n"
        )
    };
    let cube = "box material=\"m\" { min -1 -1 -1; max 1 1 1 }";
    let pane = "triangle material=\"m\" { a -9 -9 0; b 9 -9 0; c 0 9 0 }";
    let f = (0.5f32 / 2.5).powi(2);
    for (integrator, material, body, alpha) in [
        ("whitted", "kd 0.5", cube, 1.0),
        ("whitted", "kd 0.1; coverage 0.5", pane, 0.5),
        ("whitted", "kd 0.1; opacity 0.3; eta 1", pane, 0.3),
        ("whitted", "kd 0.1; opacity 0.3; eta 1.5", cube, 1.0),
        ("whitted", "kd 0; k 0.9", cube, 1.0),
        ("path", "kd 0.5", cube, 1.0),
        ("path", "kd 0.1; coverage 0.5", pane, 0.5),
        ("path", "kd 0.1; coverage 0.5", cube, 0.75),
        ("path", "standard { opacity 0.25 }", pane, 0.25),
        ("path", "dielectric 1.5", cube, 1.0),
        ("path", "conductor \"gold\"", cube, 1.0),
        // Fog takes 1 − e^(−σ d) away: d = 2. A pane without an inside reflects 2F / (1 + F) at right angles.
        ("path", "kd 0; opacity 0; eta 1; medium { absorption 0.4 }", cube, 1.0 - (-0.8f32).exp()),
        ("path", "kd 0; opacity 0; eta 1; medium { scattering 0.3 }", cube, 1.0 - (-0.6f32).exp()),
        (
            "path",
            "standard { specular { roughness 0 }; transmission { weight 1 }; thin-walled #true }",
            pane,
            2.0 * f / (1.0 + f),
        ),
        ("zbuffer", "kd 0.5", cube, 1.0),
        ("radiosity", "kd 0.5", cube, 1.0),
    ] {
        let folder = Folder::new("s.kdl", &scene(integrator, &format!("material \"m\" {{ {material} }}\n{body}")));
        let [.., a] = rgba(&render(&folder, "--background none", "a.exr"))[0];
        assert!((a - alpha).abs() < 2e-3, "{integrator}, {material}: {a} for {alpha}");
        // A body without holes shows and reflects the background as it does in the whole picture.
        if alpha == 1.0 {
            let [hidden, shown] =
                ["none", "scene"].map(|which| rgb(&render(&folder, &format!("--background {which}"), "b.exr"))[0]);
            assert_eq!(hidden, shown, "{integrator}, {material}");
        }
    }
}

/// A PNG has straight alpha: colours are divided by it before the tone curve. Over white and black in linear light it
/// is the picture with that background, to the rounding of its levels, so that edges have no fringes.
#[test]
fn a_png_has_straight_alpha() {
    let folder = Folder::new("s.kdl", SCENE);
    let flags = "--samples 16 --background none";
    let linear = rgba(&render(&folder, flags, "a.exr"));
    for (bits, most) in [(8, 255.0), (16, 65535.0f32)] {
        let shown = render(&folder, &format!("{flags} --bits {bits}"), "a.png");
        for (i, (shown, [r, g, b, a])) in rgba(&shown).into_iter().zip(&linear).enumerate() {
            let expected = [r, g, b].map(|v| if *a > 0.0 { srgb_encode((v / a).clamp(0.0, 1.0)) } else { 0.0 });
            for (own, expected) in shown.into_iter().zip(expected.into_iter().chain([*a])) {
                assert!((own * most - expected * most).abs() <= 0.502, "{bits} {i}: {shown:?} for {expected}");
            }
            for (own, light) in shown.into_iter().zip([r, g, b]).take(3) {
                let error = (srgb_decode(own) * shown[3] - light.min(*a)).abs();
                assert!(error <= 1.7 / most, "{bits} {i}: {error}");
            }
        }
    }
    // A curve develops the colour of the covered part.
    let flags = "--samples 16 --tone agx --exposure 1";
    let shown = rgba(&render(&folder, &format!("{flags} --background none"), "a.png"));
    let whole = rgb(&render(&folder, flags, "b.png"));
    let covered = shown.iter().zip(&whole).filter(|(own, _)| own[3] == 1.0);
    assert!(covered.clone().count() > 60);
    covered.for_each(|(own, whole)| assert_eq!(own[..3], whole[..]));
}

/// The scene, `--set` and the command line say the same. Files tell of it, and are read with their alpha.
#[test]
fn files_with_alpha_are_read_rightly() {
    let folder = Folder::new("s.kdl", SCENE);
    let flag = render(&folder, "--samples 4 --background none", "flag.png").image;
    assert!(render(&folder, "--samples 4 --set film.alpha=#true", "set.png").image == flag);
    folder.says("info flag.png", 0, &["R, G, B, A", "alpha           true", "--background none"]);
    fs::write(folder.path("s.kdl"), format!("film {{ alpha #true }}\n{SCENE}")).unwrap();
    assert!(render(&folder, "--samples 4", "text.png").image == flag);
    let shown = render(&folder, "--samples 4 --background scene", "scene.png").image;
    assert!(shown.channel("A").is_none());
    // An EXR is multiplied by alpha, a PNG isn't. Both are one picture.
    render(&folder, "--samples 4", "a.exr");
    folder.says("compare a.exr text.png", 0, &["the pictures are equal"]);
    folder.says("compare text.png a.exr --linear --threshold max=0.005", 0, &[]);
    folder.says("compare text.png scene.png", 0, &["alpha differs"]);
    let half = render(&folder, "--samples 4 --bits 16", "half.exr");
    assert_eq!(half.bits, 16);
    for ([.., a], [.., b]) in rgba(&half).into_iter().zip(rgba(&folder.picture("a.exr"))) {
        assert!((a - b).abs() < 5e-4, "{a} {b}");
    }
    // Films, layers, previews, parts.
    let part = rgba(&render(&folder, "--samples 4 --crop 10,4,20,12", "part.png"));
    let whole = rgba(&folder.picture("text.png"));
    assert!((0..240).all(|i| part[i] == whole[(i / 20 + 4) * 40 + i % 20 + 10]));
    folder.says("render s.kdl --samples 4 --frames 1-2 -o film.apng", 0, &[]);
    folder.says("render s.kdl --samples 4 --frames 1-1 -o kept.#.png", 0, &[]);
    assert!(folder.picture("film.apng").image == folder.picture("kept.1.png").image);
    folder.says("render s.kdl --frames 1-2 -o film.gif", 2, &["GIF has no alpha", "--background scene"]);
    folder.says("render s.kdl --samples 4 --aov alpha,depth -o layers.exr", 0, &[]);
    let layers = folder.picture("layers.exr").image;
    assert_eq!(layers.channel("alpha.A"), layers.channel("A"));
    folder.says("render s.kdl --samples 4 --frames 1-1 -o kept.#.png", 0, &["complete before"]);
}

/// Pictures by paths that grow have the alpha of all their samples; denoising keeps it.
#[test]
fn alpha_goes_on_and_is_denoised() {
    let folder = Folder::new(
        "s.kdl",
        &format!("film {{ alpha #true }}\nintegrator \"path\" {{ max-depth 3 }}\n{SCENE}background 0.4\n"),
    );
    render(&folder, "--samples 6 --threads 1", "begun.exr");
    let whole = render(&folder, "--samples 11 --tile 7", "whole.exr").image;
    assert!(render(&folder, "--samples 11 --continue begun.exr", "on.exr").image == whole);
    let png = render(&folder, "--samples 11", "a.png").image;
    assert!(render(&folder, "--samples 11 --continue begun.exr", "b.png").image == png);
    folder.says("render s.kdl -o no.exr --continue begun.exr --background scene", 3, &["its alpha is true, not none"]);
    let alpha = rgba(&folder.picture("whole.exr")).iter().map(|p| p[3]).collect::<Vec<f32>>();
    let denoised = rgba(&render(&folder, "--samples 8 --denoise", "clean.exr"));
    let plain = rgba(&render(&folder, "--samples 8", "noisy.exr"));
    for (own, plain) in denoised.iter().zip(&plain) {
        assert_eq!(own[3], plain[3]);
        assert!(plain[3] > 0.0 || own[..3] == [0.0; 3], "{own:?}");
    }
    folder.says("denoise noisy.exr -o clean.png", 0, &[]);
    for (own, plain) in rgba(&folder.picture("clean.png")).iter().zip(&plain) {
        assert!((own[3] - plain[3]).abs() < 0.003);
    }
    assert!(alpha.contains(&1.0) && alpha.contains(&0.0));
}

/// The last step of an explanation is what the file holds.
#[test]
fn explanations_tell_alpha() {
    for (integrator, pixels) in [
        ("whitted", [[6, 8], [0, 0], [27, 10]]),
        ("path", [[6, 8], [0, 0], [27, 10]]),
        ("zbuffer", [[6, 8], [0, 0], [27, 10]]),
    ] {
        let folder = Folder::new("s.kdl", SCENE);
        let flags =
            format!("--integrator {integrator} --samples 4 --background none --tone pbr-neutral --exposure 0.5");
        let shown = rgba(&render(&folder, &flags, "a.png"));
        for [x, y] in pixels {
            let [r, g, b, a] = shown[y * 40 + x].map(|v| (v * 255.0).round());
            let said = folder.says(
                &format!("explain s.kdl -p {x},{y} {flags}"),
                0,
                &["alpha, the share", "equal, bit for bit"],
            );
            let bytes = format!("bytes in the file {r} {g} {b}  ");
            assert!(
                said.contains(&bytes) && said.contains(&format!(", alpha {a}\n")),
                "{integrator}: {bytes} {a} in {said}"
            );
        }
    }
}
