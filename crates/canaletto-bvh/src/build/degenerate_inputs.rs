//! Build times over inputs that are hard for builders: `cargo test --release -p canaletto-bvh hostile -- --ignored
//! --nocapture`. No input may take more than twice the time of clean geometry.

use std::time::Instant;

use glam::Vec3;

use crate::testing::Random;
use crate::{Quality, TriangleBvh};

const COUNT: u32 = 400_000;

/// A bumpy surface of `COUNT` triangles, like a scan.
fn clean(id: u32) -> [Vec3; 3] {
    let columns = 632;
    let (x, y) = ((id / 2) % columns, id / 2 / columns);
    let at = |x: u32, y: u32| {
        let [x, y] = [x as f32, y as f32];
        Vec3::new(x, y, 8.0 * wave(x * 0.02) + 5.0 * wave(y * 0.03))
    };
    if id.is_multiple_of(2) {
        [at(x, y), at(x + 1, y), at(x + 1, y + 1)]
    } else {
        [at(x, y), at(x + 1, y + 1), at(x, y + 1)]
    }
}

/// A periodic function similar to a sine.
fn wave(x: f32) -> f32 {
    let part = x - x.floor();
    part * (1.0 - part)
}

fn random(id: u32) -> Random {
    Random(u64::from(id) * 7919 + 1)
}

#[test]
#[ignore = "measures time"]
fn hostile_geometry_takes_little_more_time() {
    type Corners = fn(u32) -> [Vec3; 3];
    let kinds: [(&str, Corners); 8] = [
        ("clean", clean),
        ("soup", |id| {
            let r = &mut random(id);
            let p = r.vector();
            [0; 3].map(|_| p + 0.01 * r.vector())
        }),
        ("coincident", |_| [Vec3::X, Vec3::Y, Vec3::Z]),
        ("same center", |id| {
            let s = 1.0 + id as f32;
            [-Vec3::ONE * s, Vec3::ONE * s, Vec3::new(s, -s, 0.0)]
        }),
        ("giant among tiny", |id| {
            let r = &mut random(id);
            let p = r.vector();
            if id == 77 { [0; 3].map(|_| 1e6 * r.vector()) } else { [0; 3].map(|_| p + 1e-3 * r.vector()) }
        }),
        ("needles", |id| {
            let r = &mut random(id);
            let [p, way] = [r.vector(), r.vector()];
            [p, p + way, p + way + 1e-4 * r.vector()]
        }),
        ("1e-30 to 1e30", |id| {
            let r = &mut random(id);
            let s = f32::from_bits((27 + id % 200) << 23);
            let p = s * r.vector();
            [0; 3].map(|_| p + 0.01 * s * r.vector())
        }),
        ("powers of two in a line", |id| {
            let s = f32::from_bits((27 + id % 200) << 23);
            [Vec3::X * s, Vec3::X * 1.1 * s, Vec3::new(s, 0.1 * s, 0.1 * s)]
        }),
    ];
    let mut slow = Vec::new();
    for quality in [Quality::Medium, Quality::High] {
        let mut fastest = Vec::new();
        for (name, corners) in kinds {
            let time = (0..5)
                .map(|_| {
                    let all: Vec<[Vec3; 3]> = (0..COUNT).map(corners).collect();
                    let start = Instant::now();
                    let triangles = TriangleBvh::build_with(quality, all.len(), |id| all[id as usize]).unwrap();
                    assert_eq!(triangles.len(), all.len());
                    start.elapsed().as_secs_f64()
                })
                .fold(f64::INFINITY, f64::min);
            fastest.push((name, time));
            println!("{quality:?} {name:24} {time:.4} s, {:.2} of clean", time / fastest[0].1);
        }
        let clean = fastest[0].1;
        slow.extend(fastest.into_iter().filter(|(_, time)| *time > 2.0 * clean).map(|(name, _)| (quality, name)));
    }
    assert!(slow.is_empty(), "{slow:?}");
}
