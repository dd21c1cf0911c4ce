//! Fuzz tests: nonsense through every kind of tree, query and instruction set. The nonsense is NaN, infinities, zeros
//! of either sign, denormals and the largest numbers, as origins, directions, margins and ends. No memory is accessed
//! out of bounds (`Stack::push` asserts it in tests, and AddressSanitizer checks it), all kinds of query agree, and NaN
//! hits nothing.
//!
//! With AddressSanitizer: `RUSTFLAGS=-Zsanitizer=address cargo +nightly test -p canaletto-bvh --target
//! x86_64-unknown-linux-gnu nonsense`.

use glam::Vec3;

use crate::primitive::primitive4::UserPrimitive;
use crate::testing::{Random, TestPrimitive, zoo};
use crate::{
    Aabb, Bvh, InflatedRay, InstructionSet, Leaf, PreparedRay, Primitive, PrimitiveBvh, PrimitiveHit, Quality, Ray,
    TriangleBvh, sphere,
};

const STRANGE: [f32; 20] = [
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    0.0,
    -0.0,
    1e-45,
    -1e-45,
    1e-40,
    f32::MIN_POSITIVE,
    -f32::MIN_POSITIVE,
    f32::MAX,
    f32::MIN,
    1.8e38,
    -1.8e38,
    3e38,
    1e-30,
    1.0,
    -1.0,
    0.5,
    -3.0,
];

fn strange(random: &mut Random) -> f32 {
    STRANGE[random.below(STRANGE.len())]
}

/// A vector with up to three strange components.
fn strange_vector(random: &mut Random) -> Vec3 {
    let mut vector = random.vector() * [1.0, 4.0, 1e30][random.below(3)];
    match random.below(4) {
        0 => vector = Vec3::splat(strange(random)),
        1 => vector = Vec3::new(strange(random), strange(random), strange(random)),
        2 => vector[random.below(3)] = strange(random),
        _ => {}
    }
    vector
}

fn rays(random: &mut Random, count: usize) -> Vec<Ray> {
    (0..count).map(|_| Ray::new(strange_vector(random), strange_vector(random))).collect()
}

/// Ends of rays: infinity, 1, or strange numbers.
fn ends(random: &mut Random, count: usize) -> Vec<f32> {
    (0..count).map(|_| [f32::INFINITY, 1.0, strange(random)][random.below(3)]).collect()
}

/// Some scenes of the zoo, and scenes as large as floats reach.
fn scenes(random: &mut Random) -> Vec<Vec<TestPrimitive>> {
    let huge = |r: &mut Random| {
        TestPrimitive::Triangle([0; 3].map(|_| (r.vector() * 1.5).clamp(-Vec3::ONE, Vec3::ONE) * f32::MAX))
    };
    let corner = |i: usize| Vec3::from([0, 1, 2].map(|axis| if i >> axis & 1 == 1 { f32::MAX } else { f32::MIN }));
    let mut scenes: Vec<Vec<TestPrimitive>> =
        zoo().into_iter().map(|(_, scene)| scene).filter(|scene| scene.len() < 250).collect();
    scenes.push((0..60).map(|_| huge(random)).collect());
    scenes.push((0..64).map(|i| TestPrimitive::Triangle([corner(i), corner(i / 2), corner(i / 3)])).collect());
    scenes.push((0..40).map(|_| TestPrimitive::Triangle([0; 3].map(|_| random.vector() * 1e-44))).collect());
    scenes
}

fn triangles(scene: &[TestPrimitive]) -> Vec<[Vec3; 3]> {
    let corners = |primitive: &TestPrimitive| match *primitive {
        TestPrimitive::Triangle(corners) => corners,
        TestPrimitive::Sphere(center, radius) => [center, center + radius, center - Vec3::X * radius],
    };
    scene.iter().map(corners).collect()
}

/// Whether a hit is possible for a ray: no number is NaN, and t is within the ray.
fn sensible(ray: &Ray, t: f32, t_max: f32) -> bool {
    !(ray.origin.is_nan() || ray.direction.is_nan() || t_max.is_nan()) && t > 0.0 && t <= t_max
}

#[test]
fn triangles_and_nonsense() {
    let random = &mut Random(71);
    let mut hits = 0;
    for scene in scenes(random) {
        let corners = triangles(&scene);
        for quality in [Quality::Medium, Quality::High] {
            let tree = TriangleBvh::build_with(quality, corners.len(), |id| corners[id as usize]).unwrap();
            let rays = rays(random, 700);
            let ends = ends(random, rays.len());
            let mut expected: Option<Vec<PrimitiveHit>> = None;
            for set in InstructionSet::available() {
                set.limit();
                let before: Vec<PrimitiveHit> = ends.iter().map(|&t_max| PrimitiveHit::none(t_max)).collect();
                let mut single = before.clone();
                for (ray, nearest) in rays.iter().zip(&mut single) {
                    tree.intersect(&ray.prepare(), nearest, false);
                }
                let (mut stream, mut packets, mut all) = (before.clone(), before.clone(), before);
                tree.intersect_stream(&rays, &mut stream, false);
                tree.intersect_coherent(&rays, &mut packets, false);
                for (ray, nearest) in rays.iter().zip(&mut all) {
                    tree.intersect_brute_force(&ray.prepare(), nearest, false);
                }
                let (mut any_stream, mut any_packets) = (ends.clone(), ends.clone());
                tree.occluded_stream(&rays, &mut any_stream, false);
                tree.occluded_coherent(&rays, &mut any_packets, false);
                for (i, ray) in rays.iter().enumerate() {
                    let what = format!("{set:?} {ray:?} up to {}", ends[i]);
                    let hit = all[i].id != PrimitiveHit::NONE;
                    assert!(!hit || sensible(ray, all[i].t, ends[i]), "{what}: {:?}", all[i]);
                    let bits = |nearest: &PrimitiveHit| format!("{nearest:?}");
                    for found in [&single[i], &stream[i], &packets[i]] {
                        assert_eq!(bits(found), bits(&all[i]), "{what}");
                    }
                    assert_eq!(tree.occluded(&ray.prepare(), ends[i], false, &mut |_| true).is_some(), hit, "{what}");
                    for ended in [any_stream[i], any_packets[i]] {
                        assert_eq!(ended == f32::NEG_INFINITY, hit || ends[i] == f32::NEG_INFINITY, "{what}");
                    }
                    hits += usize::from(hit);
                }
                let expected = expected.get_or_insert_with(|| single.clone());
                assert_eq!(format!("{single:?}"), format!("{expected:?}"), "{set:?}");
            }
        }
    }
    assert!(hits > 2000, "{hits}");
}

/// Sixteen rays straight at a triangle and a sphere, some of them with a NaN end.
#[test]
fn a_ray_without_an_end_hides_no_hit_of_its_neighbours() {
    let corners = [Vec3::new(-9.0, -9.0, 0.0), Vec3::new(9.0, -9.0, 0.0), Vec3::new(0.0, 9.0, 0.0)];
    let triangles = TriangleBvh::build(1, |_| corners).unwrap();
    let (center, radius) = (Vec3::ZERO, 2.0);
    let round = |id| if id == 0 { Primitive::Sphere { center, radius } } else { Primitive::User };
    let primitives = PrimitiveBvh::build(&[sphere::bounds(center, radius); 6], round).unwrap();
    let none = |_: UserPrimitive, _: &PreparedRay, _: f32| None;
    let rays: Vec<Ray> = (0..64)
        .map(|i| Ray::new(Vec3::new((i % 8) as f32 * 0.1, (i / 8) as f32 * 0.1, 5.0), Vec3::new(0.01, 0.02, -1.0)))
        .collect();
    for set in InstructionSet::available() {
        set.limit();
        for place in 0..64 {
            let mut ends = vec![f32::INFINITY; 64];
            ends[place] = f32::NAN;
            ends[(place * 7 + 3) % 64] = f32::NAN;
            let mut nearest: Vec<PrimitiveHit> = ends.iter().map(|&end| PrimitiveHit::none(end)).collect();
            triangles.intersect_coherent(&rays, &mut nearest, false);
            let mut any = ends.clone();
            triangles.occluded_coherent(&rays, &mut any, false);
            let mut met: Vec<PrimitiveHit> = ends.iter().map(|&end| PrimitiveHit::none(end)).collect();
            primitives.intersect_coherent(&rays, &mut met, &none);
            let mut any_round = ends.clone();
            primitives.occluded_coherent(&rays, &mut any_round, &none);
            for i in 0..64 {
                let told = (
                    nearest[i].id == 0,
                    any[i] == f32::NEG_INFINITY,
                    met[i].id == 0,
                    any_round[i] == f32::NEG_INFINITY,
                );
                let expected = !ends[i].is_nan();
                assert_eq!(told, (expected, expected, expected, expected), "{set:?} {place} {i}");
            }
        }
    }
}

/// The spheres of the scene, some with strange radii, and user primitives.
fn primitives(scene: &[TestPrimitive]) -> (Vec<Aabb>, Vec<Primitive>) {
    let round = |(i, primitive): (usize, &TestPrimitive)| match *primitive {
        TestPrimitive::Sphere(center, radius) => (sphere::bounds(center, radius), Primitive::Sphere { center, radius }),
        TestPrimitive::Triangle(corners) => {
            let bounds = Aabb::from_points(corners);
            let (center, radius) = (bounds.center(), STRANGE[i / 2 % STRANGE.len()]);
            let around = sphere::bounds(center, radius);
            if i % 2 == 1 || radius > 0.0 && !around.is_finite() {
                return (bounds, Primitive::User);
            }
            // A sphere without a valid radius is never hit, wherever it is.
            (if radius > 0.0 { around } else { bounds }, Primitive::Sphere { center, radius })
        }
    };
    scene.iter().enumerate().map(round).unzip()
}

#[test]
fn rounds_and_nonsense() {
    let random = &mut Random(72);
    let mut hits = 0;
    for scene in scenes(random) {
        let (bounds, kinds) = primitives(&scene);
        let tree = PrimitiveBvh::build(&bounds, |id| kinds[id as usize]).unwrap();
        let exact = |asked: UserPrimitive, ray: &PreparedRay, t_max: f32| {
            // A hit in the box, at the distance of its center.
            let bounds = &bounds[asked.id as usize];
            let t = (bounds.center() - ray.ray().origin).dot(ray.ray().direction);
            ray.clamp_to_box(bounds, t.into(), t_max).map(PrimitiveHit::none)
        };
        let rays = rays(random, 700);
        let ends = ends(random, rays.len());
        for set in InstructionSet::available() {
            set.limit();
            let prepared: Vec<PreparedRay> = rays.iter().map(Ray::prepare).collect();
            let before: Vec<PrimitiveHit> = ends.iter().map(|&t_max| PrimitiveHit::none(t_max)).collect();
            let (mut stream, mut packets) = (before.clone(), before.clone());
            tree.intersect_stream(&prepared, &mut stream, &exact);
            tree.intersect_coherent(&rays, &mut packets, &exact);
            let (mut any_stream, mut any_packets) = (ends.clone(), ends.clone());
            tree.occluded_stream(&prepared, &mut any_stream, &exact);
            tree.occluded_coherent(&rays, &mut any_packets, &exact);
            for (i, (ray, prepared)) in rays.iter().zip(&prepared).enumerate() {
                let what = format!("{set:?} {ray:?} up to {}", ends[i]);
                let (mut single, mut few, mut all) = (before[i], before[i], before[i]);
                tree.intersect(prepared, &mut single, &exact);
                tree.intersect_brute_force(prepared, &mut all, &exact);
                let hit = all.id != PrimitiveHit::NONE;
                assert!(!hit || sensible(ray, all.t, ends[i]), "{what}: {all:?}");
                if tree.is_few() {
                    tree.intersect_few(ray, &mut few, &exact);
                    assert_eq!(format!("{few:?}"), format!("{all:?}"), "{what}");
                    assert_eq!(tree.occluded_few(ray, ends[i], &exact, &mut |_| true).is_some(), hit, "{what}");
                }
                for found in [&single, &stream[i], &packets[i]] {
                    assert_eq!(format!("{found:?}"), format!("{all:?}"), "{what}");
                }
                assert_eq!(tree.occluded(prepared, ends[i], &exact, &mut |_| true).is_some(), hit, "{what}");
                for ended in [any_stream[i], any_packets[i]] {
                    assert_eq!(ended == f32::NEG_INFINITY, hit || ends[i] == f32::NEG_INFINITY, "{what}");
                }
                hits += usize::from(hit);
            }
        }
    }
    assert!(hits > 1000, "{hits}");
}

/// A callback may return nonsense: only the results that depend on it are spoiled.
#[test]
fn kernels_that_tell_nonsense() {
    let random = &mut Random(73);
    for scene in scenes(random) {
        let bounds: Vec<Aabb> = scene.iter().map(TestPrimitive::bounds).collect();
        let kind = |id: u32| {
            let Aabb { min, max } = bounds[id as usize];
            let radius = STRANGE[id as usize / 2 % STRANGE.len()];
            [Primitive::User, Primitive::Cylinder { ends: [min, max], radius }][id as usize % 2]
        };
        let tree = PrimitiveBvh::build(&bounds, kind).unwrap();
        let mut count = 0;
        let answers: Vec<f32> = (0..997).map(|_| strange(random)).collect();
        let told = std::sync::atomic::AtomicUsize::new(0);
        let exact = |_: UserPrimitive, _: &PreparedRay, _: f32| {
            Some(PrimitiveHit::none(answers[told.fetch_add(1, std::sync::atomic::Ordering::Relaxed) % answers.len()]))
        };
        let rays = rays(random, 300);
        for set in InstructionSet::available() {
            set.limit();
            let before: Vec<PrimitiveHit> = ends(random, rays.len()).into_iter().map(PrimitiveHit::none).collect();
            let (mut stream, mut packets) = (before.clone(), before.clone());
            tree.intersect_stream(&rays.iter().map(Ray::prepare).collect::<Vec<_>>(), &mut stream, &exact);
            tree.intersect_coherent(&rays, &mut packets, &exact);
            for (i, ray) in rays.iter().enumerate() {
                let mut single = before[i];
                tree.intersect(&ray.prepare(), &mut single, &exact);
                for met in [single, stream[i], packets[i]] {
                    assert!(met.id == PrimitiveHit::NONE || met.t <= before[i].t, "{ray:?} {met:?} {:?}", before[i]);
                    count += usize::from(met.id != PrimitiveHit::NONE);
                }
            }
        }
        assert!(count > 0);
    }
}

#[test]
fn boxes_margins_and_nonsense() {
    let random = &mut Random(74);
    let mut counts = [0; 2];
    for scene in scenes(random) {
        let bounds: Vec<Aabb> = scene.iter().map(TestPrimitive::bounds).collect();
        let tree = Bvh::build(&bounds).unwrap();
        let ids = |leaf: Leaf| leaf.slots().map(|slot| tree.order()[slot as usize]);
        for n in 0..400 {
            let ray = Ray::new(strange_vector(random), strange_vector(random));
            let margin = [strange(random), 0.1][random.below(2)];
            let (wide, prepared) = (InflatedRay::new(&ray, margin), ray.prepare());
            let t_max = [f32::INFINITY, strange(random)][n % 2];
            let mut expected: Option<[Vec<u32>; 2]> = None;
            for set in InstructionSet::available() {
                set.limit();
                let mut met = [const { Vec::new() }; 4];
                tree.intersect(&prepared, t_max, |leaf, t_max| {
                    // A nonsensical `t_max` from the caller does no harm either.
                    *t_max = if n % 5 == 0 { STRANGE[leaf.first() as usize % STRANGE.len()] } else { *t_max };
                    met[0].extend(ids(leaf));
                });
                tree.intersect_inflated(&wide, t_max, |leaf, _| met[1].extend(ids(leaf)));
                tree.occluded(&prepared, t_max, |leaf| {
                    met[2].extend(ids(leaf));
                    false
                });
                tree.occluded_inflated(&wide, t_max, |leaf| {
                    met[3].extend(ids(leaf));
                    false
                });
                met.iter_mut().for_each(|met| met.sort_unstable());
                let [closest, wide_closest, any, wide_any] = met;
                let what = format!("{set:?} {ray:?} {margin} {t_max}");
                assert!(n % 5 == 0 || closest == any, "{what}");
                assert_eq!(wide_closest, wide_any, "{what}");
                for (id, bounds) in (0..).zip(&bounds) {
                    assert!(any.contains(&id) || !prepared.enters(bounds, t_max), "{what} {bounds:?}");
                    // Boxes that are certainly near. For margins close to the last place of a sum, or to its overflow,
                    // either result is valid.
                    let half = InflatedRay::new(&ray, margin * 0.5);
                    let sums = [ray.origin.abs(), bounds.min.abs(), bounds.max.abs()].map(|v| v + margin.abs());
                    let told =
                        margin == 0.0 || sums.iter().all(|sum| (sum * f32::EPSILON).max_element() < margin * 0.1);
                    assert!(wide_any.contains(&id) || !(told && half.enters(bounds, t_max)), "{what} {bounds:?}");
                }
                let nothing = ray.origin.is_nan() || ray.direction.is_nan() || t_max.is_nan();
                assert!(!nothing || any.is_empty() && wide_any.is_empty(), "{what}");
                assert!(!margin.is_nan() || wide_any.is_empty(), "{what}");
                if margin == f32::INFINITY
                    && !nothing
                    && ray.origin.is_finite()
                    && ray.direction.is_finite()
                    && t_max > 0.0
                {
                    assert_eq!(wide_any.len(), bounds.len(), "all is near: {what}");
                }
                counts[0] += any.len();
                counts[1] += wide_any.len();
                let expected = expected.get_or_insert_with(|| [any.clone(), wide_any.clone()]);
                assert_eq!(*expected, [any, wide_any], "{what}");
            }
        }
    }
    assert!(counts[0] > 1000 && counts[1] > counts[0], "{counts:?}");
}

#[test]
fn strange_boxes_are_met_by_nothing() {
    let random = &mut Random(75);
    for _ in 0..20_000 {
        let ray = Ray::new(random.vector(), [random.vector(), strange_vector(random)][random.below(2)]);
        let (mut min, mut max) = (random.vector() - 9.0, random.vector() + 9.0);
        [&mut min, &mut max][random.below(2)][random.below(3)] = f32::NAN;
        for bounds in [Aabb { min, max }, Aabb::EMPTY, Aabb { min: Vec3::NAN, max: Vec3::NAN }] {
            let prepared = ray.prepare();
            assert!(bounds.is_empty() && !prepared.enters(&bounds, f32::INFINITY), "{ray:?} {bounds:?}");
            assert!(!InflatedRay::new(&ray, f32::INFINITY).enters(&bounds, f32::INFINITY), "{ray:?} {bounds:?}");
            assert_eq!(prepared.clamp_to_box(&bounds, 1.0, f32::INFINITY), None);
        }
        let all = Aabb { min: Vec3::splat(-9.0), max: Vec3::splat(9.0) };
        assert_eq!(ray.prepare().clamp_to_box(&all, f64::NAN, f32::INFINITY), None, "{ray:?}");
        assert_eq!(ray.prepare().clamp_to_box(&all, 1.0, f32::NAN), None, "{ray:?}");
    }
}
