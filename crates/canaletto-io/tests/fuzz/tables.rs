//! Tables of numbers and scene text: PLY, NFF, point clouds in text, binary, XYZ and NPY, and KDL with keys.

use crate::mutate::{Outcome, run};
use canaletto_io::assets::{Asset, AssetPath, MemoryAssets};
use canaletto_io::import::{CloudFormat, Staging, load, read_cylinders, read_spheres};
use canaletto_io::source::SceneSource;
use canaletto_io::text::SceneDocument;

fn seeds<const N: usize>(texts: [&str; N]) -> Vec<Vec<u8>> {
    texts.iter().map(|text| text.as_bytes().to_vec()).collect()
}

/// Reads a model as a scene; its meshes must be valid.
fn model(name: &str, bytes: &[u8]) -> Outcome {
    if let Ok((scene, _)) = load(name, &MemoryAssets::new().with(name, bytes.to_vec()), &Staging::default()) {
        scene.meshes.iter().for_each(|mesh| mesh.check().expect("a mesh that can be used"));
    }
    Outcome::Ordinary
}

fn cloud(bytes: &[u8], format: CloudFormat) -> Outcome {
    let asset = Asset { path: AssetPath::new("a", "a", "a"), bytes: bytes.to_vec() };
    for radius in [None, Some(0.5)] {
        if let Ok((cloud, _)) = read_spheres(&asset, format, radius) {
            cloud.check().expect("spheres that can be used");
        }
        if let Ok((cloud, _)) = read_cylinders(&asset, format, radius) {
            cloud.check().expect("cylinders that can be used");
        }
    }
    Outcome::Ordinary
}

const CUBE: &str = "element vertex 8\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n\
    property float ny\nproperty float nz\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
    element face 6\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int texnumber\n\
    element edge 1\nproperty int vertex1\nproperty int vertex2\nproperty float radius\nend_header\n";

/// A PLY file with all features.
fn ply(encoding: &str) -> Vec<u8> {
    let mut out = format!("ply\nformat {encoding} 1.0\ncomment TextureFile a.png\n{CUBE}").into_bytes();
    let mut put = |text: String, little: &[u8]| match encoding {
        "ascii" => out.extend(format!("{text} ").into_bytes()),
        "binary_big_endian" => out.extend(little.iter().rev()),
        _ => out.extend(little),
    };
    for i in 0..8u8 {
        for bit in 0..3 {
            let p = f32::from(i >> bit & 1) * 2.0 - 1.0;
            put(p.to_string(), &p.to_le_bytes());
        }
        (0..3).for_each(|k| put("0.5".into(), &(0.5f32 + k as f32).to_le_bytes()));
        (0..3).for_each(|k| put((i * 30 + k).to_string(), &[i * 30 + k]));
        put("\n".into(), &[]);
    }
    for face in [[0i32, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        put("4".into(), &[4]);
        face.iter().for_each(|v| put(v.to_string(), &v.to_le_bytes()));
        put("8".into(), &[8]);
        (0..8u8).for_each(|k| put(k.to_string(), &f32::from(k).to_le_bytes()));
        put("0".into(), &[0; 4]);
        put("\n".into(), &[]);
    }
    put("0".into(), &[0; 4]);
    put("1".into(), &1i32.to_le_bytes());
    put("0.5".into(), &0.5f32.to_le_bytes());
    out
}

#[test]
fn ply_files() {
    let seeds = ["ascii", "binary_little_endian", "binary_big_endian"].map(ply);
    run(
        "ply",
        &seeds,
        400,
        |_| (),
        |bytes| {
            cloud(bytes, CloudFormat::Ply);
            model("a.ply", bytes)
        },
    );
}

#[test]
fn stl_files() {
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 .5\nendloop\nendfacet\n";
    let mut binary = [b"COLOR=\x10\x20\x30\xff".as_slice(), &[0; 70], &2u32.to_le_bytes()].concat();
    for attribute in [0u16, 0x83ff] {
        let numbers = [0.0f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.5];
        binary.extend(numbers.into_iter().flat_map(f32::to_le_bytes));
        binary.extend(attribute.to_le_bytes());
    }
    let text = format!("solid a b\n{facet}{facet}endsolid a b\nsolid\n{facet}endsolid\n");
    run("stl", &[text.into_bytes(), binary], 400, |_| (), |bytes| model("a.stl", bytes));
}

#[test]
fn nff_files() {
    let seeds = seeds([
        "b 0.2 0.3 0.5\nv\nfrom 3 3 5\nat 0 0 0\nup 0 1 0\nangle 40\nhither 1\nresolution 16 12\nl 5 8 6\nl 1 2 3 .5 .5 .5\n\
         f 0.8 0.2 0.2 1 0 0 0 0\np 6\n0 0 1\n2 0 1\n2 .5 1\n.5 .5 1\n.5 2 1\n0 2 1\n",
        "# patches\nf 1 1 1 .5 .5 10 .5 1.5\npp 3\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\ns 0 0 0 1\nc\n0 0 0 1\n0 0 2 .5\n\
         c\n0 0 0 1 0 0 2 1\n",
    ]);
    run("nff", &seeds, 400, |_| (), |bytes| model("a.nff", bytes));
}

#[test]
fn clouds_of_text() {
    let seeds = seeds([
        "x,y,z,radius\n0,0,0,0.5\nnan,0,0,0.5\n0,1,0,0.5\n",
        "\"X [m]\";\"Y\";\"Z\";\"Radius\";\"a;b\"\r\n\"0,5\";\"0\";\"0\";\"0,5\";\"x \"\"y\"\"\"\r\n1;2;3;4;5\r\n",
        "# remark\n0 0 0 255 0 0 # red\n1e3 -2.5 .5 0 128 255\n% more\n\n// and more\n",
        "0\t0\t0\t1\t0\t0\t0.5\t1\t0\t0.5\n1\t2\t3\t4\t5\t6\t0.25\t0\t1\t0\n",
        "2\n0 0 0 0.5\n1 0 0 0.25\n",
    ]);
    run("csv", &seeds, 400, |_| (), |bytes| cloud(bytes, CloudFormat::Text));
}

#[test]
fn atoms() {
    let seeds = seeds([
        "5\nmethane\nC 0.0 0.0 0.0\nH 0.63 0.63 0.63\nH -0.63 -0.63 0.63\nH -0.63 0.63 -0.63\nH 0.63 -0.63 -0.63\n",
        "2\nLattice=\"1 0 0 0 1 0 0 0 1\" Properties=id:I:1:species:S:1:pos:R:3:color:R:3:radius:R:1\n\
         1 C 0 0 0 1 0 0 0.5\n2 O 1 2 3 0 0.5 0 0.25\n2\n\n1 Xx 0 0 0 1 0 0 0.5\n2 8 1 2 3 0 0.5 0 nan\n",
    ]);
    run("xyz", &seeds, 400, |_| (), |bytes| cloud(bytes, CloudFormat::Text));
}

#[test]
fn records() {
    let numbers = |count: usize| -> Vec<u8> { (0..count).flat_map(|i| (0.5 + i as f32).to_le_bytes()).collect() };
    run("bin", &[numbers(28), numbers(8), numbers(14)], 400, |_| (), |bytes| cloud(bytes, CloudFormat::Binary));
}

#[test]
fn arrays() {
    let array = |descr: &str, shape: &str, data: usize| -> Vec<u8> {
        let header = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n");
        let numbers = (0..data).flat_map(|i| (0.5 + i as f32).to_le_bytes());
        let length = (header.len() as u16).to_le_bytes();
        b"\x93NUMPY\x01\x00".iter().copied().chain(length).chain(header.bytes()).chain(numbers).collect()
    };
    let fields = "[('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('radius', '<f4'), ('label', '|S4')]";
    let seeds = [array("'<f4'", "(2, 4)", 8), array("'<f4'", "(2, 7)", 14), array(fields, "(2,)", 10)];
    run("npy", &seeds, 400, |_| (), |bytes| cloud(bytes, CloudFormat::Numpy));
}

#[test]
fn scene_text() {
    let seeds = seeds([
        "camera { eye 100 40 40; center 0 0 0; up 0 1 0; fovy 90; near 30; far 230; size 23 23 }\nambient 0.2\n\
         material \"a\" { kd 0 0 1; ks 1 1 1; n 50 }\nsphere material=\"a\" { center 0 20 0; radius 25 }\n\
         group name=\"g\" { translate 0 5 0; box { min -80 -50 -50; max 50 -45 50 }; cone { base 0 0 0; top 0 5 0; radius 2 } }\n\
         instance of=\"g\" { rotate-y 30; scale 2 }\nlight \"spot\" { position 0 50 0; target 0 0 0; inner 20; outer 30 }\n",
        "animation { frames 1 9; fps 25 }\ncamera { follow path=\"p\" along=#true { at { key 1 0; key 9 1 } }; shutter 0 0.5 }\n\
         path \"p\" { points 0 0 9  3 0 9  3 3 9; closed #true }\n\
         sphere { center { key 1 0 0 0; key 5 0 2 0 ease=\"in\"; key 9 0 0 0; ease \"spline\" }; radius 1; \
         rotate { key 1 0 1 0 0; key 9 1 0 0 90; turn \"shortest\" } }\nlight \"omni\" { position 0 9 9 }\n",
        "film { sample \"jittered\" n=4 }\ntexture \"t\" kind=\"marble\" { stops 0 0 0 0  1 1 1 1 }\n\
         material \"m\" { kd 1; texture \"t\" { scale 3 } }\nspheres radius=0.5 { data #\"\"\"\n0 0 0 # remark\n1,2;3\n\"\"\"# }\n\
         cylinders radius=0.2 { axes 0 0 0 1 1 1 }\nplane material=\"m\" { point 0 0 0; normal 0 1 0 }\n/- torus { axis 0 1 0 }\n",
    ]);
    run(
        "kdl",
        &seeds,
        400,
        |_| (),
        |bytes| {
            let Ok(text) = std::str::from_utf8(bytes) else { return Outcome::Ordinary };
            let assets = MemoryAssets::new();
            if let Ok(mut script) = SceneDocument::of_text(text, "a.kdl", &assets, &[]) {
                for frame in [0.0, 5.5] {
                    let _ = script.scene(&assets, frame).map_err(|errors| errors.to_string());
                }
            }
            Outcome::Ordinary
        },
    );
}
