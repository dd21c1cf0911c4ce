//! Tests of `canaletto explain --svg` and `--html`: the scene from outside, and the page.

mod support;

use canaletto_io::picture::{Image, decode};
use std::path::Path;
use std::process::Output;
use support::{canaletto, printed, root};

fn run(folder: &Path, arguments: &str) -> Output {
    canaletto(folder).arg("explain").args(arguments.split(' ')).output().unwrap()
}

#[track_caller]
fn explained(folder: &Path, arguments: &str) -> String {
    printed(canaletto(folder).arg("explain").args(arguments.split(' ')))
}

const GLASS: &str = "scenes/chapter/fig-5.27b-glass.kdl -p 110,75";

/// The parts of a text between two others, in order.
fn all_between<'a>(text: &'a str, start: &str, end: &str) -> Vec<&'a str> {
    text.split(start).skip(1).map(|rest| rest.split(end).next().unwrap()).collect()
}

/// Bytes of base 64.
fn unpacked(text: &str) -> Vec<u8> {
    let digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let bits: Vec<u32> = text.trim_end_matches('=').chars().map(|c| digits.find(c).unwrap() as u32).collect();
    let group = |four: &[u32]| {
        let all = four.iter().fold(0, |all, bits| all << 6 | bits) << (6 * (4 - four.len()));
        [all >> 16, all >> 8, all].into_iter().take(four.len() - 1).map(|v| v as u8).collect::<Vec<_>>()
    };
    bits.chunks(4).flat_map(group).collect()
}

/// The picture of the scene from outside in a drawing.
fn outside_picture(svg: &str) -> Image {
    let [url] = all_between(svg, "href=\"data:image/png;base64,", "\"")[..] else { panic!("one picture") };
    decode(&unpacked(url)).unwrap().image
}

/// The points of the first line of a class in the view, after the legend's lines are left out.
fn lines(svg: &str, class: &str) -> Vec<Vec<[f64; 2]>> {
    let point = |text: &str| {
        let (x, y) = text.split_once(' ').unwrap();
        [x.parse().unwrap(), y.parse().unwrap()]
    };
    let paths = all_between(svg, &format!("class=\"o {class}\" d=\"M"), "\"");
    let paths = paths.into_iter().filter(|path| !path.contains('h'));
    paths.map(|path| path.split(['M', 'L']).take(2).map(point).collect()).collect()
}

#[test]
fn rays_meet_at_their_hits() {
    let svg = explained(&root(), &format!("{GLASS} --svg -"));
    let hits = all_between(&svg, "<circle class=\"mark\" cx=\"", "\" fill");
    let hits: Vec<[f64; 2]> = hits
        .into_iter()
        .filter(|hit| hit.ends_with("r=\"4.5"))
        .map(|hit| {
            let numbers: Vec<f64> = hit
                .split("\" c")
                .flat_map(|part| part.trim_start_matches("y=\"").split('"'))
                .filter_map(|v| v.parse().ok())
                .collect();
            [numbers[0], numbers[1]]
        })
        .collect();
    let near = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).abs() < 0.5 && (a[1] - b[1]).abs() < 0.5;
    let (camera, refracted) = (lines(&svg, "eye"), lines(&svg, "refracted"));
    assert_eq!((hits.len(), camera.len(), refracted.len()), (2, 1, 2), "{svg}");
    assert!(near(camera[0][1], hits[0]) && near(refracted[0][0], hits[0]), "{camera:?} {refracted:?} {hits:?}");
    assert!(near(refracted[0][1], hits[1]) && near(refracted[1][0], hits[1]), "{refracted:?} {hits:?}");
    let to_light = lines(&svg, "shadow");
    assert!(to_light.len() == 2 && near(to_light[0][1], to_light[1][1]), "both go to one light: {to_light:?}");
    // The numbers of the tree are in the view, those of rays without a hit too.
    let numbers = all_between(&svg, "font-weight=\"bold\">", "<");
    assert!(["1", "2", "3"].iter().all(|number| numbers.contains(number)), "{numbers:?}");
    let picture = outside_picture(&svg);
    let alpha = &picture.channel("A").unwrap();
    assert!(alpha.contains(&0.0) && alpha.iter().any(|a| *a > 0.4), "the scene and the paper are seen");
}

/// The walls of a closed room don't hide what is inside of it.
#[test]
fn closed_rooms_are_cut_open() {
    let folder = tempfile::tempdir().unwrap();
    let room = "camera { eye 0 0 0.9; center 0 0 0; fovy 60; size 24 24 }\nfilm { sample \"center\" }\n\
                material \"wall\" { kd 0.6 0.5 0.4 }\nmaterial \"green\" { kd 0 0.7 0 }\n\
                box name=\"room\" material=\"wall\" { min -1 -1 -1; max 1 1 1 }\n\
                box name=\"block\" material=\"green\" { min -0.3 -0.3 -0.3; max 0.3 0.3 0.3 }\n\
                light \"omni\" { position 0.2 0.8 0.5; intensity 0.5 0.5 0.5 }\n";
    std::fs::write(folder.path().join("room.kdl"), room).unwrap();
    let picture = outside_picture(&explained(folder.path(), "room.kdl -p 12,12 --svg -"));
    let [r, g, _] = picture.rgb().unwrap();
    let green = (0..r.len()).filter(|&i| g[i] > 0.2 && r[i] < 0.5 * g[i]).count();
    assert!(green > 500, "{green} pixels of the block");
}

#[test]
fn views_of_all_kinds_of_trees() {
    let folder = tempfile::tempdir().unwrap();
    let plane = "camera { eye 0 1 3; center 0 1 0; size 24 24 }\nplane { point 0 0 0; normal 0 1 0 }\n\
                 light \"directional\" { direction 0 -1 0; intensity 1 1 1 }\n";
    std::fs::write(folder.path().join("plane.kdl"), plane).unwrap();
    std::fs::write(folder.path().join("empty.kdl"), "camera { eye 0 1 3; center 0 1 0; size 24 24 }\n").unwrap();
    for arguments in ["plane.kdl -p 12,20", "plane.kdl -p 12,1", "empty.kdl -p 3,3", "plane.kdl --ray 0,2,0,0,-1,0"] {
        let svg = explained(folder.path(), &format!("{arguments} --svg -"));
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{arguments}: {svg}");
        assert_eq!(lines(&svg, "eye").len(), 1, "{arguments}");
    }
}

/// A page has all in itself: no address, no script.
#[test]
fn pages_need_no_other_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("tree.html");
    let text = explained(&root(), &format!("{GLASS} --html {}", file.display()));
    let page = std::fs::read_to_string(&file).unwrap();
    for word in ["<script", "<link", "@import", "url(http", "src=\""] {
        assert!(!page.contains(word), "{word}");
    }
    assert_eq!(page.matches("http").count(), 1, "the namespace of SVG only");
    assert_eq!(page.matches("<details").count(), page.matches("</details>").count());
    assert_eq!(page.matches("<table>").count(), page.matches("</table>").count());
    assert!(page.contains("bytes in the file") && page.contains("#2525ff") && page.contains("equal, bit for bit"));
    // Each ray of the drawing has its table, and the text is that of the terminal.
    let rays = all_between(&page, "<details class=\"node\"", "</b>");
    let numbers: Vec<&str> = rays.iter().map(|ray| ray.rsplit("<b>").next().unwrap()).collect();
    assert_eq!(numbers, ["1", "2", "3"]);
    assert!(page.contains(text.lines().nth(3).unwrap()), "{text}");
    // Nothing else is left in the folder.
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    let printed = explained(&root(), &format!("{GLASS} --html -"));
    assert!(printed.starts_with("<!DOCTYPE html>") && printed.trim_end().ends_with("</html>"));
}

#[test]
fn names_are_escaped_and_wrong_outputs_named() {
    let folder = tempfile::tempdir().unwrap();
    let scene = "camera { eye 0 0 3; center 0 0 0; size 9 9 }\nmaterial \"<i>\" { kd 1 0 0 }\n\
                 sphere \"<b>&\" material=\"<i>\" { center 0 0 0; radius 1 }\n";
    std::fs::write(folder.path().join("s.kdl"), scene).unwrap();
    let page = explained(folder.path(), "s.kdl -p 4,4 --html -");
    assert!(page.contains("&lt;b&gt;&amp;") && !page.contains("<b>&") && page.contains("kd of &lt;i&gt;"), "{page}");
    let both = run(folder.path(), "s.kdl -p 4,4 --html - --svg -");
    assert_eq!(both.status.code(), Some(2));
    let nowhere = run(folder.path(), "s.kdl -p 4,4 --html none/page.html");
    assert_eq!(nowhere.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&nowhere.stderr).contains("none"));
}

#[test]
fn no_drawing_replaces_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("a.kdl");
    let text = "camera { eye 0 0 5; center 0 0 0; size 8 8 }\nsphere { center 0 0 0; radius 1 }\n";
    std::fs::write(&scene, text).unwrap();
    for flag in ["--svg", "--html"] {
        let output = run(folder.path(), &format!("a.kdl -p 4,4 {flag} a.kdl"));
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && errors.contains(flag), "{errors}");
        assert_eq!(std::fs::read_to_string(&scene).unwrap(), text);
    }
}
