//! Transparent bodies that touch, contain one another or contain the eye, and the transmittance of shadow rays.

use canaletto::camera::Camera;
use canaletto::explain::{Outcome, explain};
use canaletto::integrator::RayKind;
use canaletto::math::Rgb;
use canaletto::render::{Job, render};
use canaletto::scene::Sampling;
use canaletto::world::World;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::text::read_scene;
use glam::DVec3;
use std::time::Instant;

/// A scene text, ready for tracing.
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
        let mut film = scene.film;
        // Texts that say nothing of samples mean one ray through the pixel's centre.
        if let Sampling::Adaptive { .. } = film.sampling {
            film.sampling = Sampling::Center;
        }
        let job = Job::new(Camera::of(&scene.views[0]).unwrap(), film, scene.integrator);
        Case { world: World::build(scene).unwrap(), job }
    }

    /// The picture, row by row. Pixels at regular steps equal the sum of their explanation's terms.
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

/// The number of pixels of two pictures that differ by more than `by`.
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

    /// Each of the two sides shows d of its own light and 1 − d of the light behind. Light that crosses both is
    /// attenuated by both.
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

    /// The reflected ray is part of the surface's own light. No ray is refracted, whatever eta is.
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

    /// A transparent body by the chapter keeps its whole local colour.
    #[test]
    fn opacity_is_that_of_glass() {
        let found = with_box("kd 0.8 0.2 0.2; opacity 0");
        assert!(apart(found, Rgb::new(0.4, 0.1, 0.1) * 2.0 + Rgb::gray(0.4)) < 1e-6, "{found:?}");
    }
}

mod shadows {
    use super::*;

    /// A ray may intersect a body thinner than rounding errors many times from one place.
    #[test]
    fn a_ray_through_a_flat_body_ends() {
        for (material, flat) in [
            ("opacity 0.486", "1e-11"),
            ("opacity 0", "1e-11"),
            ("opacity 0.001", "1e-14"),
            ("opacity 0", "1e-7"),
            // Rays from the eye pass it, too.
            ("coverage 0", "1e-11"),
            ("coverage 0.01", "1e-11"),
        ] {
            let case = Case::new(&format!(
                "camera {{ eye -8e-30 3.6e-30 -6.3e-30; center 0 0 0; fovy 1; size 8 8 }}
                material \"m\" {{ {material} }}
                light \"rectangle\" {{ corner -7.9e-30 7.7e-30 -4.5e-30; u -5.8e-30 -7e-30 -5.2e-30
                    v 3e-30 -9e-30 2.7e-30; samples 1 }}
                cylinder material=\"m\" {{ base 2.2e-30 -3.6e-30 2.4e-30; top -4.3e-30 9.5e-30 -1.1e-30
                    radius 3e-30; caps #false; scale 1e19 {flat} 1e19 }}"
            ));
            let start = Instant::now();
            let pixels = render(&case.world, &case.job, &()).unwrap().picture.pixels;
            assert!(pixels.iter().all(|c| c.to_array().iter().all(|v| v.is_finite())));
            // One step takes a microsecond, so 65,536 steps per ray would take seconds.
            assert!(start.elapsed().as_secs_f64() < 1.0, "{material} {flat}: {:?}", start.elapsed());
        }
    }

    /// The transmittance of a stack of sheets is the product over all of them, down to the smallest visible value.
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

    /// Between three transparent mirrors two levels double the rays. By default, rays with invisible contributions are
    /// left out.
    #[test]
    fn clear_mirrors_do_not_take_for_ever() {
        let text = |weight: &str| {
            format!(
                "film {{ transfer \"none\" }}\n background 0.5\n integrator {{ max-depth 48{weight} }}
                material \"m\" {{ kd 0.1; k 0.5; opacity 0.5 }}
                camera {{ eye 0 0 0.5; center 0.1 0.2 0; fovy 40; size 4 4 }}
                disk material=\"m\" {{ center 0 0 0; normal 0 0 1; radius 9 }}
                disk material=\"m\" {{ center 0 0 1; normal 0 0 -1; radius 9 }}
                disk material=\"m\" {{ center 0 0 2; normal 0 0 -1; radius 9 }}
                light \"omni\" {{ position 0 0 0.7 }}"
            )
        };
        let start = Instant::now();
        let by_default = pixels(&text(""));
        assert!(start.elapsed().as_secs_f64() < 20.0, "{:?}", start.elapsed());
        // This is the whole tree to a depth where a ray still has more throughput than the default.
        let deeper = pixels(&text("; min-weight 0.0004"));
        assert_eq!(differing(&by_default, &deeper, 0.02), 0);
    }
}

mod nested {
    use super::*;

    /// Traces one ray through the scene along −z, at a distance from the axis. Returns its final direction, and the
    /// media at each refraction.
    fn way(impact: f64, bodies: &str) -> (DVec3, Vec<[f32; 2]>) {
        let case = Case::new(&format!(
            "integrator {{ max-depth 20 }}
            camera {{ eye {impact} 0 10; center {impact} 0 0; fovy 1; size 1 1 }}\n{bodies}"
        ));
        let tree = explain(&case.world, &case.job, 0, 0).unwrap();
        let (mut ray, mut media) = (&tree.samples[0].ray, Vec::new());
        while let Outcome::Hit(hit) = &ray.outcome {
            ray = hit.children.last().unwrap_or_else(|| panic!("a ray goes on\n{tree}"));
            media.extend(ray.media);
        }
        (DVec3::from(ray.direction.map(f64::from)), media)
    }

    fn glass(name: &str, eta: f64) -> String {
        format!("material \"{name}\" {{ kd 0; eta {eta}; opacity 0 }}\n")
    }

    /// Around one centre n r sin θ is constant (Bouguer), so the deviation is a sum of arcsines.
    #[test]
    fn spheres_in_spheres_bend_by_the_ratio_of_both() {
        for (outer, inner) in [(1.5, 1.0), (1.33, 1.5), (1.5, 1.33), (1.5, 1.5), (1.2, 2.4)] {
            for (impact, swapped) in [(0.1, false), (0.3, true), (0.45, false), (0.55, true)] {
                let (big, small) = (1.0, 0.6);
                let spheres = [
                    format!("sphere material=\"a\" {{ center 0 0 0; radius {big} }}\n"),
                    format!("sphere material=\"b\" {{ center 0 0 0; radius {small} }}\n"),
                ];
                let [first, second] = if swapped { [1, 0] } else { [0, 1] };
                let text = glass("a", outer) + &glass("b", inner) + &spheres[first] + &spheres[second];
                let (direction, media) = way(impact, &text);
                let sines = [impact / big, impact / (outer * big), impact / (outer * small), impact / (inner * small)];
                let [a, b, c, d] = sines.map(f64::asin);
                let turned = 2.0 * (a - b + c - d);
                let expected = DVec3::new(-turned.sin(), 0.0, -turned.cos());
                assert!(
                    (direction - expected).length() < 1e-5,
                    "{outer} {inner} {impact}: {direction} instead of {expected}"
                );
                let (outer, inner) = (outer as f32, inner as f32);
                assert_eq!(media, [[1.0, outer], [outer, inner], [inner, outer], [outer, 1.0]]);
            }
        }
    }

    /// The direction in parallel slabs depends on the angle outside alone. The ray leaves in its original direction.
    #[test]
    fn slabs_of_glass_in_water_bend_by_the_angle_outside() {
        let case = Case::new(
            &(glass("water", 1.33)
                + &glass("glass", 1.5)
                + "integrator { max-depth 20 }
            camera { eye 0 8 6; center 0 0 0; fovy 1; size 1 1 }
            box material=\"glass\" { min -90 -3 -90; max 90 -1 90 }
            box material=\"water\" { min -99 -4 -99; max 99 0 99 }"),
        );
        let tree = explain(&case.world, &case.job, 0, 0).unwrap();
        let sine = |direction: [f32; 3]| f64::from(direction[0]).hypot(f64::from(direction[2]));
        let outside = 0.6;
        let mut ray = &tree.samples[0].ray;
        for eta in [1.0, 1.33, 1.5, 1.33, 1.0] {
            assert!((sine(ray.direction) - outside / eta).abs() < 1e-6, "in {eta}\n{tree}");
            if let Outcome::Hit(hit) = &ray.outcome {
                ray = &hit.children[0];
            }
        }
    }

    const STAGE: &str = "ambient 0.3
        background 0.5 0.6 0.8
        texture \"t\" kind=\"checker\" { even 0.1; odd 0.9 }
        material \"f\" { kd 0.8; texture \"t\" mapping=\"solid\" space=\"world\" { scale 0.5 } }
        camera { eye 0 1.2 6; center 0 1 0; fovy 35; size 60 45 }
        plane material=\"f\" { point 0 0 0; normal 0 1 0 }
        light \"directional\" { direction -0.5 -1 -0.3 }
        integrator { max-depth 16 }
        material \"g\" { kd 0; eta 1.5; opacity 0 }
        material \"air\" { kd 0; eta 1; opacity 0 }
        material \"water\" { kd 0; eta 1.33; opacity 0 }\n";

    #[test]
    fn glass_in_the_same_glass_bends_nothing() {
        let sphere = "sphere material=\"g\" { center 0 1 0; radius 1 }\n";
        let solid = pixels(&format!("{STAGE}{sphere}"));
        for inner in [
            "sphere material=\"g\" { center 0.1 1 0; radius 0.8 }",
            "box material=\"g\" { min -0.5 0.5 -0.5; max 0.5 1.5 0.5 }",
            "cylinder material=\"g\" { base 0 0.5 0; top 0.2 1.5 0; radius 0.4 }",
            "cone material=\"g\" { base 0 0.5 0; top 0 1.5 0; radius 0.4; top-radius 0.1 }",
            "torus material=\"g\" { center 0 1 0; axis 1 1 0; radius 0.5; tube 0.2 }",
            "group material=\"g\" { translate 0 1 0; rotate-x 30; box { min -0.4 -0.4 -0.4; max 0.4 0.4 0.4 } }",
            // The boxes of the group overlap, too.
            "group name=\"two\" material=\"g\" { box { min 0 0 0; max 0.4 0.4 0.4 }; box { min 0.2 0.2 0.2; max 0.5 0.5 0.5 } }
            instance of=\"two\" { translate 0 1 0 }
            instance of=\"two\" { rotate-y 50; translate -0.2 0.6 0.2 }",
        ] {
            for text in [format!("{STAGE}{sphere}{inner}"), format!("{STAGE}{inner}\n{sphere}")] {
                assert!(differing(&pixels(&text), &solid, 1e-3) <= 14, "{inner}");
            }
        }
    }

    /// A bubble shows only as a shell, since its middle hardly bends rays.
    #[test]
    fn a_bubble_leaves_a_shell() {
        let sphere = "sphere material=\"g\" { center 0 1 0; radius 1 }\n";
        let without = pixels(STAGE);
        let bubble = pixels(&format!("{STAGE}{sphere}sphere material=\"air\" {{ center 0 1 0; radius 0.995 }}"));
        let solid = pixels(&format!("{STAGE}{sphere}"));
        let (by_bubble, by_solid) = (differing(&bubble, &without, 0.1), differing(&solid, &without, 0.1));
        assert!(by_bubble * 5 < by_solid, "{by_bubble} and {by_solid} pixels change");
    }

    /// A cube from −1 to 1 with separate corners for each face.
    const CUBE: &str = "v -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\nv -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1
        f 1 2 3 4\nf 6 5 8 7\nf 2 6 7 3\nf 5 1 4 8\nf 4 3 7 8\nf 5 6 2 1\n";

    #[test]
    fn meshes_are_bodies_as_boxes_are() {
        let files = || MemoryAssets::new().with("cube.obj", CUBE);
        let cube =
            |place: &str, material: &str| format!("mesh file=\"cube.obj\" material=\"{material}\" {{ {place} }}\n");
        let boxes = format!(
            "{STAGE}box material=\"water\" {{ min -1 0.1 -1; max 1 2.1 1 }}
            box material=\"g\" {{ min -0.5 0.6 -0.5; max 0.5 1.6 0.5 }}"
        );
        let meshes =
            STAGE.to_owned() + &cube("scale 0.5; translate 0 1.1 0", "g") + &cube("translate 0 1.1 0", "water");
        let differ = differing(&pixels(&boxes), &Case::with(&meshes, files()).pixels(), 1e-3);
        assert!(differ <= 14, "{differ}");
    }

    /// The eye may be in water in glass, in a mesh, or between both.
    #[test]
    fn the_eye_may_be_inside() {
        let shapes = [
            "sphere material=\"M\" { center 0 0 0; radius 1; scale S }",
            "box material=\"M\" { min -1 -1 -1; max 1 1 1; scale S }",
            "mesh file=\"cube.obj\" material=\"M\" { scale S }",
            "group material=\"M\" { rotate-x 40; scale S; mesh file=\"cube.obj\" }",
        ];
        for (outer, inner) in shapes.iter().flat_map(|a| shapes.iter().map(move |b| (a, b))) {
            let named = |shape: &str, name: &str, size: &str| shape.replace('M', name).replace('S', size) + "\n";
            let text = glass("water", 1.33)
                + &glass("glass", 1.5)
                + "integrator { max-depth 9 }\n camera { eye 0.1 0.2 0.3; center 1 1.2 9; fovy 40; size 2 2 }\n"
                + &named(outer, "glass", "6")
                + &named(inner, "water", "2");
            let case = Case::with(&text, MemoryAssets::new().with("cube.obj", CUBE));
            let tree = explain(&case.world, &case.job, 1, 1).unwrap();
            let Outcome::Hit(hit) = &tree.samples[0].ray.outcome else { panic!("{tree}") };
            assert_eq!(hit.children[0].media, Some([1.33, 1.5]), "{text}\n{tree}");
            let Outcome::Hit(hit) = &hit.children[0].outcome else { panic!("{tree}") };
            let told = hit.children[0]
                .media
                .or_else(|| (hit.children[0].kind == RayKind::TotallyReflected).then_some([1.5, 1.0]));
            assert_eq!(told, Some([1.5, 1.0]), "{text}\n{tree}");
        }
    }

    /// Only one of two bodies fills their overlap. The picture is that of bodies that end where the other begins.
    #[test]
    fn liquid_in_a_glass_may_overlap_its_wall() {
        let with = |words: &str, wall: &str, liquid: &str| {
            pixels(&format!(
                "{STAGE} material \"wall\" {{ kd 0; eta 2.4; opacity 0{words} }}
                box material=\"wall\" {{ min -1 0.2 {wall} }}
                box material=\"water\" {{ min -1 0.2 {liquid} }}"
            ))
        };
        let (wall, liquid) = ("-1; max 1 1.8 -0.5", "-0.5; max 1 1.8 1");
        let glass_first = with("", wall, liquid);
        let overlapping = "-0.7; max 1 1.8 1";
        // The wall has the smaller volume.
        for (words, expected) in [("", &glass_first), ("; priority 1", &glass_first)] {
            let differ = differing(&with(words, wall, overlapping), expected, 1e-3);
            assert!(differ <= 20, "{words}: {differ}");
        }
        let water_first = with("", "-1; max 1 1.8 -0.7", overlapping);
        let differ = differing(&with("; priority -1", wall, overlapping), &water_first, 1e-3);
        assert!(differ <= 20, "{differ}");
        assert!(differing(&glass_first, &water_first, 1e-3) > 100, "it matters");
    }

    /// An open surface encloses no medium.
    #[test]
    fn an_open_surface_fills_nothing() {
        for sheet in [
            "triangle material=\"s\" { a -9 -9 3; b 9 -9 3; c 0 18 3 }",
            "disk material=\"s\" { center 0 0 3; normal 0 0 1; radius 9 }",
            "plane material=\"s\" { point 0 0 3; normal 0 0 1 }",
            "plane material=\"s\" { point 0 0 3; normal 0 0 -1 }",
            "cylinder material=\"s\" { base 0 -9 0; top 0 9 0; radius 4; caps #false }",
        ] {
            let text = |eta: f64| {
                glass("g", 1.5) + &glass("s", eta) + "sphere material=\"g\" { center 0 0 0; radius 1 }\n" + sheet
            };
            let (without, media) = way(0.4, &(glass("g", 1.5) + "sphere material=\"g\" { center 0 0 0; radius 1 }"));
            assert_eq!(media, [[1.0, 1.5], [1.5, 1.0]]);
            let (with, _) = way(0.4, &text(1.0));
            assert!((with - without).length() < 1e-5, "{sheet}: {with} instead of {without}");
            let (_, media) = way(0.4, &text(1.7));
            assert!(media.contains(&[1.0, 1.5]) && media.contains(&[1.5, 1.0]), "{sheet}: {media:?}");
        }
    }

    /// A body with holes encloses no medium.
    #[test]
    fn a_dissolved_body_fills_nothing() {
        let (_, media) = way(
            0.4,
            &(glass("g", 1.5)
                + "material \"s\" { kd 0; eta 1.7; opacity 0; coverage 0.5 }
                sphere material=\"g\" { center 0 0 0; radius 1 }
                box material=\"s\" { min -3 -3 -3; max 3 3 3 }"),
        );
        assert!(media.contains(&[1.0, 1.5]) && media.contains(&[1.5, 1.0]), "{media:?}");
    }

    /// An open surface in a body is surrounded by the body's medium.
    #[test]
    fn a_sheet_in_glass_is_bounded_by_glass() {
        let (_, media) = way(
            0.1,
            &(glass("g", 1.5)
                + &glass("s", 1.2)
                + "sphere material=\"g\" { center 0 0 0; radius 1 }
                disk material=\"s\" { center 0 0 0.2; normal 0 0 1; radius 0.5 }"),
        );
        assert_eq!(media, [[1.0, 1.5], [1.5, 1.2], [1.5, 1.0]]);
    }

    /// A reflected ray inside a body stays in it.
    #[test]
    fn total_reflection_stays_in_the_glass() {
        let (_, media) = way(
            0.55,
            &(glass("g", 1.5)
                + &glass("air", 1.0)
                + "sphere material=\"g\" { center 0 0 0; radius 1 }\n sphere material=\"air\" { center 0 0 0; radius 0.5 }"),
        );
        // At the bubble sin θ is 0.55 / 0.5 > 1, so the ray misses it. At 0.45 the ray hits it beyond the critical
        // angle.
        assert_eq!(media, [[1.0, 1.5], [1.5, 1.0]]);
        let (_, media) = way(
            0.505,
            &(glass("g", 1.5)
                + &glass("air", 1.0)
                + "sphere material=\"g\" { center 0 0 0; radius 1 }\n sphere material=\"air\" { center 0 0 0; radius 0.4 }"),
        );
        assert_eq!(media, [[1.0, 1.5], [1.5, 1.0]]);
    }
}

mod moving {
    use super::*;

    const STAGE: &str = "ambient 0.3
        background 0.5 0.6 0.8
        light \"directional\" { direction -0.5 -1 -0.3 }
        integrator { max-depth 16 }
        material \"g\" { kd 0; eta 1.5; opacity 0 }
        material \"air\" { kd 0; eta 1; opacity 0 }
        material \"water\" { kd 0; eta 1.33; opacity 0 }
        material \"f\" { kd 0.2 0.7 0.3 }\n";

    const CUBE: &str = "v -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\nv -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1
        f 1 2 3 4\nf 6 5 8 7\nf 2 6 7 3\nf 5 1 4 8\nf 4 3 7 8\nf 5 6 2 1\n";

    fn with_cube(text: &str) -> Vec<Rgb> {
        Case::with(&format!("{STAGE}{text}"), MemoryAssets::new().with("cube.obj", CUBE)).pixels()
    }

    /// If everything moves with the camera, the picture shows no motion. The eye leaves the place where the bodies were
    /// when the shutter opened.
    #[test]
    fn bodies_that_move_with_the_eye_look_as_if_they_stood() {
        let bodies = "sphere material=\"g\" { center 0 1 0; radius 1 }
            sphere material=\"air\" { center 0.1 1 0; radius 0.5 }
            mesh file=\"cube.obj\" material=\"water\" { scale 3 1.5 9; translate 0 1 0 }
            box material=\"f\" { min -9 -2 -9; max 9 -0.6 9 }";
        for eye in ["0 1.2 6", "0 1.3 14", "0.2 1 0.3"] {
            let moved: Vec<f64> = eye.split(' ').map(|n| n.parse().unwrap()).collect();
            let view = |motion: &str| {
                format!("camera {{ eye {eye}; center 0 1 -1; fovy 35; size 40 30 {motion} }}\n film {{ samples 4 }}\n")
            };
            let still = with_cube(&format!("{}group {{ {bodies} }}", view("")));
            let motion =
                format!("; motion {{ eye {} {} {}; center 5 2 -1 }}", moved[0] + 5.0, moved[1] + 1.0, moved[2]);
            let found = with_cube(&format!("{}group {{ {bodies}\n motion {{ translate 5 1 0 }} }}", view(&motion)));
            let differ = differing(&found, &still, 0.01);
            assert!(differ <= 12, "{eye}: {differ}");
        }
    }

    /// A lens may be in water. The kind of the water's shape and its transform change nothing.
    #[test]
    fn a_lens_may_be_inside_of_anything() {
        let with = |water: &str| {
            with_cube(&format!(
                "camera {{ eye 0 1.2 6; center 0 1 0; fovy 35; size 40 30; lens {{ radius 0.2; focus 6 }} }}
                film {{ samples 8 }}
                sphere material=\"g\" {{ center 0 1 0; radius 1 }}
                box material=\"f\" {{ min -3 -0.5 -3; max 3 -0.2 3 }}\n{water}"
            ))
        };
        let expected = with("box material=\"water\" { min -8 -8 -8; max 8 8 8 }");
        for water in [
            "mesh file=\"cube.obj\" material=\"water\" { scale 8 }",
            "mesh file=\"cube.obj\" material=\"water\" { scale -8 8 8 }",
            "group material=\"water\" { rotate-y 90; scale 8 -8 8; box { min -1 -1 -1; max 1 1 1 } }",
            "prototype name=\"w\" { mesh file=\"cube.obj\" material=\"water\" }\n instance of=\"w\" { scale -8 -8 -8 }",
        ] {
            let differ = differing(&with(water), &expected, 0.01);
            assert!(differ <= 12, "{water}: {differ}");
        }
    }

    /// Part of a lens may be in water, part of it beside the water.
    #[test]
    fn a_lens_may_be_inside_in_part() {
        let with = |water: &str| {
            with_cube(&format!(
                "camera {{ eye 0.02 0 6; center 0.02 0 0; fovy 35; size 40 30; lens {{ radius 0.2; focus 6 }} }}
                film {{ samples 8 }}
                sphere material=\"g\" {{ center 0.5 0 0; radius 1 }}
                box material=\"f\" {{ min -3 -1.6 -3; max 3 -1.3 3 }}\n{water}"
            ))
        };
        let expected = with("box material=\"water\" { min -8 -8 -8; max 0 8 8 }");
        let found = with("mesh file=\"cube.obj\" material=\"water\" { scale 4 8 8; translate -4 0 0 }");
        let differ = differing(&found, &expected, 0.01);
        assert!(differ <= 12, "{differ}");
    }

    /// Two instances of one body fill the union of both.
    #[test]
    fn instances_that_overlap_are_one_body() {
        let view = "camera { eye 3 4 5; center 0 0 0; fovy 40; size 60 45 }
            box material=\"f\" { min -9 -3 -9; max 9 -2 9 }\n";
        let expected = with_cube(&format!("{view} box material=\"g\" {{ min -1 -1 -1; max 1.5 1 1 }}"));
        for body in ["box material=\"g\" { min -1 -1 -1; max 1 1 1 }", "mesh file=\"cube.obj\" material=\"g\""] {
            for [first, second] in [["", "translate 0.5 0 0"], ["scale -1 1 1; translate 0.5 0 0", "scale 1 1 -1"]] {
                let text = format!(
                    "{view} prototype name=\"b\" {{ {body} }}
                    instance of=\"b\" {{ {first} }}\n instance of=\"b\" {{ {second} }}"
                );
                let differ = differing(&with_cube(&text), &expected, 0.02);
                assert!(differ <= 40, "{body} {first}: {differ}");
            }
        }
    }

    /// So do two cubes of one mesh. No surface is seen inside.
    #[test]
    fn a_mesh_that_overlaps_itself_is_one_body() {
        let with = |body: &str| {
            let text = format!(
                "{STAGE}camera {{ eye 3 4 5; center 0 0 0; fovy 40; size 60 45 }}
                box material=\"f\" {{ min -9 -3 -9; max 9 -2 9 }}\n{body}"
            );
            let second = "v -0.5 -0.8 0.8\nv 1.5 -0.8 0.8\nv 1.5 0.8 0.8\nv -0.5 0.8 0.8\nv -0.5 -0.8 -0.8\n\
                v 1.5 -0.8 -0.8\nv 1.5 0.8 -0.8\nv -0.5 0.8 -0.8\nf 9 10 11 12\nf 14 13 16 15\nf 10 14 15 11\n\
                f 13 9 12 16\nf 12 11 15 16\nf 13 14 10 9\n";
            Case::with(&text, MemoryAssets::new().with("pair.obj", format!("{CUBE}\n{second}"))).pixels()
        };
        let expected = with(
            "box material=\"g\" { min -1 -1 -1; max 1 1 1 }\n\
            box material=\"g\" { min -0.5 -0.8 -0.8; max 1.5 0.8 0.8 }",
        );
        let differ = differing(&with("mesh file=\"pair.obj\" material=\"g\""), &expected, 0.02);
        assert!(differ <= 40, "{differ}");
    }

    /// If two bodies are equal in everything else, the later one fills their overlap.
    #[test]
    fn of_equal_bodies_the_later_one_fills() {
        let view = "camera { eye 3 4 5; center 0 0 0; fovy 40; size 60 45 }
            material \"a\" { kd 0; eta 1.2; opacity 0; priority 2 }
            material \"b\" { kd 0; eta 1.8; opacity 0; priority 2 }
            box material=\"f\" { min -9 -3 -9; max 9 -2 9 }\n";
        let a = |to: f64| format!("box material=\"a\" {{ min -1 -1 -1; max {to} 1 1 }}\n");
        let b = |from: f64| format!("box material=\"b\" {{ min {from} -1 -1; max 1.5 1 1 }}\n");
        for (overlapping, expected) in [(a(1.0) + &b(-0.5), a(-0.5) + &b(-0.5)), (b(-0.5) + &a(1.0), b(1.0) + &a(1.0))]
        {
            let [found, expected] = [overlapping, expected].map(|bodies| with_cube(&format!("{view}{bodies}")));
            let differ = differing(&found, &expected, 0.02);
            assert!(differ <= 40, "{differ}");
        }
    }
}

mod edges {
    use super::*;
    use canaletto::explain::RayNode;

    const OCTAHEDRON: &str = "v 1 0 0\nv -1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv 0 0 -1
        f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";

    /// The refractive index at a point; `None` near a surface.
    fn eta_at(p: DVec3) -> Option<f32> {
        let (inside, sphere) = (p.abs().element_sum() - 1.0, (p - DVec3::new(0.0, 0.0, -4.0)).length() - 2.0);
        match (inside, sphere) {
            _ if inside.abs() < 1e-3 || sphere.abs() < 1e-3 => None,
            (..0.0, _) => Some(1.3),
            (_, ..0.0) => Some(1.5),
            _ => Some(1.0),
        }
    }

    /// At edges and vertices, each refraction starts from the medium around the middle of the incident ray.
    #[test]
    fn no_ray_takes_a_body_along() {
        let text = "integrator { max-depth 8; min-weight 0 }
            material \"m\" { kd 0; k 0.2; eta 1.3; opacity 0.1 }
            material \"g\" { kd 0; k 0.2; eta 1.5; opacity 0.1 }
            mesh file=\"o.obj\" material=\"m\" { SCALE }
            sphere material=\"g\" { center 0 0 -4; radius 2 }\n";
        let mut told = 0;
        for round in 0..240 {
            let h =
                |k: u32| f64::from((round * 2_654_435_761u32).wrapping_add(k * 40_503_007) >> 8) / 8_388_608.0 - 1.0;
            let corner = |k: u32| DVec3::AXES[(h(k).abs() * 2.99) as usize] * if h(k + 9) < 0.0 { -1.0 } else { 1.0 };
            // The target is a vertex, a point on an edge, or a point a few roundings beside it.
            let [a, mut b] = [corner(1), corner(2)];
            if a.dot(b) < -0.5 {
                b = DVec3::Z;
            }
            let along = [0.0, 0.5, 0.3, h(5).abs()][round as usize % 4];
            let beside = DVec3::new(h(6), h(7), h(8)) * [0.0, 1e-7, 1e-6, 1e-5][round as usize / 4 % 4];
            let at = a * (1.0 - along) + b * along + beside;
            let eye = at + DVec3::new(h(10), h(11), 1.5 + h(12).abs()) * 2.0;
            let [x, y, z] = at.to_array();
            let text = text.replace("SCALE", ["scale 1", "scale -1 1 1", "rotate-y 90", "scale 1"][round as usize % 4]);
            let case = Case::with(
                &format!(
                    "{text}camera {{ eye {} {} {}; center {x} {y} {z}; fovy 1e-4; size 1 1 }}",
                    eye.x, eye.y, eye.z
                ),
                MemoryAssets::new().with("o.obj", OCTAHEDRON),
            );
            let tree = explain(&case.world, &case.job, 0, 0).unwrap();
            let mut open: Vec<&RayNode> = vec![&tree.samples[0].ray];
            while let Some(ray) = open.pop() {
                let Outcome::Hit(hit) = &ray.outcome else { continue };
                let middle = (DVec3::from(ray.origin) + DVec3::from(hit.point)) * 0.5;
                for child in &hit.children {
                    if let (Some([from, _]), Some(eta)) = (child.media, eta_at(middle)) {
                        assert_eq!(from, eta, "round {round}, at {middle}\n{tree}");
                        told += 1;
                    }
                    open.push(child);
                }
            }
        }
        assert!(told > 500, "{told}");
    }
}

mod touching {
    use super::*;

    const STAGE: &str = "ambient 0.4
        background 0.9 0.1 0.1
        material \"p\" { kd 0.2 0.7 0.3 }
        material \"m\" { kd 0.2 0.3 0.3; k 0.4; ks 0.5; n 20 }
        camera { eye 3 4 5; center 0 -0.5 0; fovy 40; size 60 45 }
        light \"omni\" { position 5 8 6 }
        integrator { max-depth 9 }\n";

    const CUBE: &str = "v -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\nv -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1
        f 1 2 3 4\nf 6 5 8 7\nf 2 6 7 3\nf 5 1 4 8\nf 4 3 7 8\nf 5 6 2 1\n";

    fn picture(material: &str, parts: [&str; 2]) -> Vec<Rgb> {
        let text = format!("{STAGE} material \"g\" {{ {material} }}\n{}\n{}\n", parts[0], parts[1]);
        Case::with(&text, MemoryAssets::new().with("cube.obj", CUBE)).pixels()
    }

    /// Glass in contact with a surface gives the picture of glass slightly above it.
    #[test]
    fn glass_on_anything_shows_what_it_stands_on() {
        let lifted = |shape: &str, by: &str| shape.replace("BASE", by);
        for glass in [
            "box material=\"g\" { min -1 BASE -1; max 1 1 1 }",
            "cylinder material=\"g\" { base 0 BASE 0; top 0 1 0; radius 1 }",
            "cone material=\"g\" { base 0 BASE 0; top 0 1 0; radius 1; top-radius 0.5 }",
            "mesh file=\"cube.obj\" material=\"g\" { translate 0 1 0; translate 0 BASE 0 }",
            "group material=\"g\" { rotate-y 30; translate 0 BASE 0; box { min -1 0 -1; max 1 2 1 } }",
        ] {
            for floor in [
                "plane material=\"p\" { point 0 -1 0; normal 0 1 0 }",
                "plane material=\"m\" { point 0 -1 0; normal 0 -1 0 }",
                "triangle material=\"p\" { a -9 -1 9; b 9 -1 9; c 0 -1 -9 }",
                "triangle material=\"m\" { a -9 -1 9; b 0 -1 -9; c 9 -1 9 }",
                "box material=\"m\" { min -3 -2 -3; max 3 -1 3 }",
                "disk material=\"p\" { center 0 -1 0; normal 0 1 0; radius 4 }",
                "cylinder material=\"m\" { base 0 -2 0; top 0 -1 0; radius 3 }",
                "mesh file=\"cube.obj\" material=\"p\" { scale 3 1 3; translate 0 -2 0 }",
            ] {
                for material in ["kd 0; eta 1; opacity 0.1", "kd 0.1 0 0; ks 0.5; n 30; k 0.1; eta 1.5; opacity 0.2"] {
                    let raised = picture(material, [&lifted(glass, "-0.9999"), floor]);
                    let on = lifted(glass, "-1");
                    for order in [[&on, floor], [floor, &on]] {
                        let differ = differing(&picture(material, order), &raised, 0.03);
                        assert!(differ <= 27, "{order:?} {material}: {differ} of {} pixels", raised.len());
                    }
                }
            }
        }
    }

    /// Two halves of one glass give the picture of a single body.
    #[test]
    fn glass_on_the_same_glass_is_one() {
        let material = "kd 0; eta 1.5; opacity 0";
        let whole = "box material=\"g\" { min -1 -1 -1; max 1 1 1 }";
        let floor = "plane material=\"p\" { point 0 -1.3 0; normal 0 1 0 }";
        let expected = picture(material, [whole, floor]);
        for halves in [
            ["box material=\"g\" { min -1 -1 -1; max 1 0 1 }", "box material=\"g\" { min -1 0 -1; max 1 1 1 }"],
            ["box material=\"g\" { min -1 -1 -1; max 0.2 1 1 }", "box material=\"g\" { min 0.2 -1 -1; max 1 1 1 }"],
            [
                "box material=\"g\" { min -1 -1 -1; max 1 0 1 }",
                "mesh file=\"cube.obj\" material=\"g\" { scale 1 0.5 1; translate 0 0.5 0 }",
            ],
        ] {
            for [first, second] in [halves, [halves[1], halves[0]]] {
                let found = picture(material, [&format!("{first}\n{second}"), floor]);
                let differ = differing(&found, &expected, 0.01);
                assert!(differ <= 20, "{first} {second}: {differ}");
            }
        }
    }

    /// Each face attenuates light and view, as for bodies with a small gap.
    #[test]
    fn each_of_two_faces_takes_its_share() {
        let material = "kd 0.05; eta 1; opacity 0.2";
        let floor = "plane material=\"p\" { point 0 -1.3 0; normal 0 1 0 }";
        let upper = |at: &str| format!("box material=\"g\" {{ min -1 {at} -1; max 1 1 1 }}\n{floor}");
        let lower = "box material=\"g\" { min -1 -1 -1; max 1 0 1 }";
        let apart = picture(material, [&upper("0.0001"), lower]);
        for order in [[&upper("0"), lower], [lower, &upper("0")]] {
            let differ = differing(&picture(material, order), &apart, 0.01);
            assert!(differ <= 20, "{differ}");
        }
    }

    /// An opaque surface in contact with glass hides the glass.
    #[test]
    fn a_sticker_on_glass_is_seen() {
        let glass = "box material=\"g\" { min -1 -1 -1; max 1 1 1 }";
        let sticker =
            |at: &str| format!("triangle material=\"p\" {{ a -0.9 -0.9 {at}; b 0.9 -0.9 {at}; c 0 0.9 {at} }}");
        let material = "kd 0.1; eta 1.5; opacity 0.3; ks 0.4; n 10";
        let before = picture(material, [&sticker("1.0001"), glass]);
        for order in [[&sticker("1"), glass], [glass, &sticker("1")]] {
            let differ = differing(&picture(material, order), &before, 0.03);
            assert!(differ <= 20, "{differ}");
        }
    }
}
