//! The same scene by Canaletto and by POV-Ray (Debian package `povray`), in turn, in one run: the ratio of whole-process
//! times and how far the pictures differ.
//!
//! `cargo run --release -p canaletto-bench --bin povray [SCENE.nff] [--size 1920x1080] [--threads 2] [--runs 5]`
//!
//! The scene is written for POV-Ray with the same numbers: Phong's model without ambient, brilliance 1, no falloff, no
//! adaptive cut-off, linear light, one ray in the centre of each pixel.

use canaletto::camera::Camera;
use canaletto::light::LightKind;
use canaletto::math::Rgb;
use canaletto::scene::{Content, Node, Scene};
use canaletto::shape::Shape;
use canaletto_io::assets::FolderAssets;
use glam::{DVec3, Vec3};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::Instant;

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

/// What the command line asks for.
struct Options {
    scene: PathBuf,
    size: [u32; 2],
    threads: u32,
    runs: usize,
}

fn options() -> Result<Options, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut options = Options { scene: root.join("scenes/spd/balls.nff"), size: [1920, 1080], threads: 2, runs: 5 };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut value = || words.next().ok_or(format!("{word} needs a value"));
        match word.as_str() {
            "--size" => {
                let value = value()?;
                let (w, h) = value.split_once('x').ok_or("--size takes WxH")?;
                options.size = [w.parse().map_err(|_| "--size takes WxH")?, h.parse().map_err(|_| "--size takes WxH")?];
            }
            "--threads" => options.threads = value()?.parse().map_err(|_| "--threads takes a number")?,
            "--runs" => options.runs = value()?.parse().map_err(|_| "--runs takes a number")?,
            path => options.scene = PathBuf::from(path),
        }
    }
    Ok(options)
}

fn run() -> Result<(), String> {
    let Options { scene, size: [width, height], threads, runs } = options()?;
    let canaletto = std::env::current_exe().map_err(|e| e.to_string())?.with_file_name("canaletto");
    if !canaletto.is_file() {
        return Err("build the canaletto binary first: cargo build --release".into());
    }
    if Command::new("povray").arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_err() {
        return Err("POV-Ray isn't installed; on Debian: apt-get install povray".into());
    }
    let (assets, name) = FolderAssets::beside(&scene).map_err(|e| e.to_string())?;
    let (description, _) = canaletto_io::import::load(&name, &assets).map_err(|diagnostics| diagnostics.to_string())?;
    let folder = std::env::temp_dir().join(format!("canaletto-povray-{}", std::process::id()));
    std::fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    std::fs::write(folder.join("scene.pov"), pov_scene(&description, width, height)?).map_err(|e| e.to_string())?;

    let ours = |command: &mut Command| {
        command.arg("render").arg(&scene).arg("--quiet").arg("--progress").arg("none");
        command.arg("--size").arg(format!("{width}x{height}")).arg("--threads").arg(threads.to_string());
        command.arg("-o").arg(folder.join("ours.png"));
    };
    let theirs = |command: &mut Command| {
        command.arg("+Iscene.pov").arg("+Otheirs.png").arg(format!("+W{width}")).arg(format!("+H{height}"));
        command.arg(format!("+WT{threads}")).args(["-D", "-A", "+Q9", "File_Gamma=srgb"]).current_dir(&folder);
    };
    let (mut our_times, mut their_times) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        our_times.push(timed(&canaletto, ours)?);
        their_times.push(timed(Path::new("povray"), theirs)?);
    }
    let (a, b) = (median(&mut our_times), median(&mut their_times));
    println!(
        "{} at {width} x {height}, {threads} threads, {runs} interleaved runs, whole process, medians",
        scene.display()
    );
    println!("canaletto {:.3} s ({})", a, spread(&our_times));
    println!("povray    {:.3} s ({})", b, spread(&their_times));
    println!("ratio     canaletto takes 1/{:.2} of POV-Ray's time", b / a);
    let compare =
        Command::new(&canaletto).arg("compare").arg(folder.join("ours.png")).arg(folder.join("theirs.png")).output();
    let compare = compare.map_err(|e| e.to_string())?;
    println!("{}", String::from_utf8_lossy(&compare.stdout));
    println!("pictures and POV-Ray scene: {}", folder.display());
    Ok(())
}

fn timed(program: &Path, arguments: impl Fn(&mut Command)) -> Result<f64, String> {
    let mut command = Command::new(program);
    arguments(&mut command);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let start = Instant::now();
    let status = command.status().map_err(|e| format!("{}: {e}", program.display()))?;
    let seconds = start.elapsed().as_secs_f64();
    if status.success() { Ok(seconds) } else { Err(format!("{} failed: {status}", program.display())) }
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn spread(sorted: &[f64]) -> String {
    format!("{:.3} to {:.3}", sorted[0], sorted[sorted.len() - 1])
}

/// The scene in POV-Ray's language, vectors of the camera spelled out so that its handedness doesn't matter.
fn pov_scene(scene: &Scene, width: u32, height: u32) -> Result<String, String> {
    let view = &scene.views[0];
    let camera = Camera::new(&view.intrinsics, &view.extrinsics).map_err(|e| e.to_string())?;
    let [x, y, z] = camera.axes();
    let distance = 0.5 / (view.intrinsics.fovy.to_radians() / 2.0).tan();
    let aspect = f64::from(width) / f64::from(height);
    let mut out = String::new();
    let depth = scene.integrator.max_depth;
    let _ = writeln!(out, "#version 3.7;");
    let _ = writeln!(out, "global_settings {{ assumed_gamma 1.0 max_trace_level {depth} adc_bailout 0 }}");
    let _ = writeln!(out, "background {{ {} }}", color(scene.background));
    let _ = writeln!(
        out,
        "camera {{ perspective location {} direction {} up {} right {} }}",
        point(camera.eye()),
        point(-z * distance),
        point(y),
        point(x * aspect)
    );
    for (index, material) in scene.materials.iter().enumerate() {
        let p = &material.phong;
        let _ = writeln!(
            out,
            "#declare M{index} = texture {{ pigment {{ {} transmit {} }} finish {{ ambient 0 diffuse 1 phong {} phong_size {} reflection {{ {} }} }} }}",
            color(p.kd),
            1.0 - p.opacity,
            p.ks.max_component(),
            p.n,
            color(p.k)
        );
    }
    for node in &scene.nodes {
        write_node(&mut out, scene, node)?;
    }
    Ok(out)
}

fn write_node(out: &mut String, scene: &Scene, node: &Node) -> Result<(), String> {
    match &node.content {
        Content::Light(light) => {
            let LightKind::Omni(omni) = &light.kind else {
                return Err("only omni lights are written for POV-Ray".into());
            };
            let _ = writeln!(out, "light_source {{ {} {} }}", vector(omni.position.truncate()), color(light.intensity));
        }
        Content::Shape(Shape::Sphere(s)) => {
            let m = node.material.unwrap_or_default();
            let _ = writeln!(out, "sphere {{ {}, {} texture {{ M{m} }} }}", vector(s.center), s.radius);
        }
        Content::Mesh(index) => {
            let mesh = &scene.meshes[*index as usize];
            let m = node.material.or(mesh.materials.first().copied()).unwrap_or_default();
            let _ = writeln!(out, "mesh {{");
            for i in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(i).map(vector);
                let _ = writeln!(out, "triangle {{ {a}, {b}, {c} }}");
            }
            let _ = writeln!(out, "texture {{ M{m} }} }}");
        }
        _ => return Err("only spheres, meshes and omni lights are written for POV-Ray".into()),
    }
    Ok(())
}

fn color(c: Rgb) -> String {
    format!("rgb <{}, {}, {}>", c.r, c.g, c.b)
}

fn vector(v: Vec3) -> String {
    format!("<{}, {}, {}>", v.x, v.y, v.z)
}

fn point(v: DVec3) -> String {
    format!("<{}, {}, {}>", v.x, v.y, v.z)
}
