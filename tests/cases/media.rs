//! Clear bodies that touch, lie in one another or hold the eye; what a shadow ray crosses.

use canaletto::camera::Camera;
use canaletto::explain::explain;
use canaletto::math::Rgb;
use canaletto::render::{Job, render};
use canaletto::world::World;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::text::read_scene;
use std::time::Instant;

/// A scene text, ready to be traced.
struct Case {
    world: World,
    job: Job,
}

impl Case {
    fn new(text: &str) -> Case {
        Case::with(text, MemoryAssets::new())
    }

    /// A scene text that opens files.
    fn with(text: &str, assets: MemoryAssets) -> Case {
        let scene = match read_scene("case.kdl", &assets.with("case.kdl", text)) {
            Ok((scene, _)) => scene,
            Err(errors) => panic!("{errors}\n{text}"),
        };
        let job = Job::new(Camera::of(&scene.views[0]).unwrap(), scene.film, scene.integrator);
        Case { world: World::build(scene).unwrap(), job }
    }

    /// The picture, row by row, each pixel of which is the sum of its explanation's terms.
    fn pixels(&self) -> Vec<Rgb> {
        let picture = render(&self.world, &self.job, &()).unwrap().picture;
        for (x, y) in (0..picture.height).step_by(7).flat_map(|y| (0..picture.width).step_by(5).map(move |x| (x, y))) {
            let tree = explain(&self.world, &self.job, x, y).unwrap();
            let bits = |c: Rgb| c.to_array().map(f32::to_bits);
            assert_eq!(bits(tree.sum()), bits(picture.pixel(x, y)), "pixel {x}, {y}\n{tree}");
        }
        picture.pixels
    }
}

fn pixels(text: &str) -> Vec<Rgb> {
    Case::new(text).pixels()
}

/// The largest difference of two colours.
fn apart(a: Rgb, b: Rgb) -> f32 {
    a.to_array().into_iter().zip(b.to_array()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// How many pixels of two pictures are further apart than that.
fn differing(a: &[Rgb], b: &[Rgb], by: f32) -> usize {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).filter(|(a, b)| apart(**a, **b) > by).count()
}

mod dissolved {
    use super::*;

    const STAGE: &str = "background 0
        ambient 0
        film { transfer \"none\" }
        camera { eye 0 0 6; center 0 0 0; fovy 40; size 3 3 }
        triangle { a -9 -9 -3; b 9 -9 -3; c 0 18 -3 }
        light \"directional\" { direction 0 0 -1; intensity 0.5 }\n";

    fn with_box(material: &str) -> Rgb {
        pixels(&format!("{STAGE} material \"m\" {{ {material} }}\n box material=\"m\" {{ min -1 -1 -1; max 1 1 1 }}"))
            [4]
    }

    /// d of its own light and 1 − d of what is behind, at each of the two sides; light that crosses both is as much less.
    #[test]
    fn a_dissolved_surface_adds_d_of_its_own_light() {
        let behind = 0.8 * 0.5;
        assert_eq!(pixels(STAGE)[4], Rgb::gray(behind));
        for d in [0.0, 0.25, 0.5, 0.9, 1.0f32] {
            let open = 1.0 - d;
            let front = Rgb::new(0.8, 0.2, 0.2) * 0.5;
            let (far, behind) = (front * (d * open), Rgb::gray(behind) * (open * open));
            let expected = front * d + (far + behind * open) * open;
            let found = with_box(&format!("kd 0.8 0.2 0.2; coverage {d}"));
            assert!(apart(found, expected) < 1e-6, "{d}: {found:?} instead of {expected:?}");
        }
    }

    /// The mirrored ray is part of what the surface shows; nothing is bent, whatever eta says.
    #[test]
    fn a_dissolved_mirror_mirrors_d() {
        let all = pixels(
            "background 1\n ambient 0\n film { transfer \"none\" }
            camera { eye 0 0 6; center 0 0 0; fovy 40; size 3 3 }
            material \"m\" { kd 0; k 0.5; eta 1.7; coverage 0.25 }
            disk material=\"m\" { center 0 0 0; normal 0 0 1; radius 3 }",
        );
        assert!(apart(all[4], Rgb::gray(0.25 * 0.5 + 0.75)) < 1e-6, "{:?}", all[4]);
    }

    /// The chapter's clear body keeps its whole local colour.
    #[test]
    fn opacity_is_that_of_glass() {
        let found = with_box("kd 0.8 0.2 0.2; opacity 0");
        assert!(apart(found, Rgb::new(0.4, 0.1, 0.1) * 2.0 + Rgb::gray(0.4)) < 1e-6, "{found:?}");
    }
}

mod shadows {
    use super::*;

    /// A surface flatter than roundings is met from the same place again and again.
    #[test]
    fn a_shadow_ray_through_a_flat_body_ends() {
        for (opacity, flat) in [("0.486", "1e-11"), ("0", "1e-11"), ("0.001", "1e-14"), ("0", "1e-7")] {
            let case = Case::new(&format!(
                "camera {{ eye -8e-30 3.6e-30 -6.3e-30; center 0 0 0; fovy 1; size 8 8 }}
                material \"m\" {{ opacity {opacity} }}
                light \"rectangle\" {{ corner -7.9e-30 7.7e-30 -4.5e-30; u -5.8e-30 -7e-30 -5.2e-30
                    v 3e-30 -9e-30 2.7e-30; samples 1 }}
                cylinder material=\"m\" {{ base 2.2e-30 -3.6e-30 2.4e-30; top -4.3e-30 9.5e-30 -1.1e-30
                    radius 3e-30; caps #false; scale 1e19 {flat} 1e19 }}"
            ));
            let start = Instant::now();
            let pixels = render(&case.world, &case.job, &()).unwrap().picture.pixels;
            assert!(pixels.iter().all(|c| c.to_array().iter().all(|v| v.is_finite())));
            // A step takes a microsecond, 65,536 steps of each ray seconds.
            assert!(start.elapsed().as_secs_f64() < 1.0, "{opacity} {flat}: {:?}", start.elapsed());
        }
    }

    /// Light through a stack of sheets is what all of them let pass, as long as anything can show it.
    #[test]
    fn a_stack_of_sheets_dims_by_each() {
        for count in [1, 10, 100, 1000] {
            let sheets: String = (0..count)
                .map(|i| {
                    format!(
                        "disk material=\"m\" {{ center 0 {} 0; normal 0 1 0; radius 2 }}\n",
                        1.0 + f64::from(i) * 1e-3
                    )
                })
                .collect();
            let found = pixels(&format!(
                "ambient 0\n film {{ transfer \"none\" }}\n material \"m\" {{ opacity 0.01; kd 0 }}
                camera {{ eye 0 0.5 5; center 0 0 0; fovy 1; size 1 1 }}
                light \"directional\" {{ direction 0 -1 0; intensity 1 }}
                plane {{ point 0 0 0; normal 0 1 0 }}\n{sheets}"
            ))[0];
            let expected = 0.8 * 0.99f32.powi(count);
            assert!((found.r - expected).abs() < 1e-5, "{count}: {found:?} instead of {expected}");
        }
    }
}

mod weight {
    use super::*;

    /// Each level between two clear mirrors doubles the rays; by default those that nobody sees are left out.
    #[test]
    fn clear_mirrors_do_not_take_for_ever() {
        let text = |weight: &str| {
            format!(
                "film {{ transfer \"none\" }}\n background 0.5\n integrator {{ max-depth 60{weight} }}
                material \"m\" {{ kd 0.1; k 0.5; opacity 0.5 }}
                camera {{ eye 0 0 0.5; center 0.1 0.2 0; fovy 40; size 4 4 }}
                disk material=\"m\" {{ center 0 0 0; normal 0 0 1; radius 9 }}
                disk material=\"m\" {{ center 0 0 1; normal 0 0 -1; radius 9 }}
                light \"omni\" {{ position 0 0 0.7 }}"
            )
        };
        let start = Instant::now();
        let by_default = pixels(&text(""));
        assert!(start.elapsed().as_secs_f64() < 20.0, "{:?}", start.elapsed());
        // All of the tree to a depth where a ray still weighs more than the default.
        let deeper = pixels(&text("; min-weight 0.0004"));
        assert_eq!(differing(&by_default, &deeper, 0.02), 0);
    }
}
