//! Light maps against the solution that they show, and against a furnace.

use super::*;
use crate::material::{Material, Phong};
use crate::math::{DRay, Rgb};
use crate::scene::{Node, RadiositySettings, Scene};
use crate::shape::{Cuboid, Cylinder, Shape, Sphere, Triangle};
use canaletto_bvh::Ray;
use glam::{DVec2, DVec3, Vec3};
use std::collections::HashMap;

fn material(name: &str, kd: f32, emission: f32) -> Material {
    Material::new(name, Phong { kd: Rgb::gray(kd), emission: Rgb::gray(emission), ..Phong::default() })
}

fn cuboid(min: [f32; 3], max: [f32; 3]) -> Shape {
    Shape::Box(Cuboid { min: min.into(), max: max.into() })
}

/// A rectangle of two triangles, which share the edge from the first corner to the third.
fn sheet([a, b, c, d]: [[f32; 3]; 4]) -> [Shape; 2] {
    [[a, b, c], [a, c, d]].map(|corners| {
        let [a, b, c] = corners.map(Vec3::from);
        Shape::Triangle(Triangle { a, b, c, one_sided: false })
    })
}

/// Shapes of the materials "wall" and "lamp", scaled by a factor.
fn world_of(shapes: impl IntoIterator<Item = (Shape, u32)>, scale: f32) -> World {
    let nodes = shapes.into_iter().map(|(shape, material)| Node::from(scaled(shape, scale)).with_material(material));
    let materials = vec![material("wall", 0.6, 0.0), material("lamp", 0.0, 8.0)];
    World::build(Scene { materials, nodes: nodes.collect(), ..Scene::default() }).unwrap()
}

fn scaled(shape: Shape, s: f32) -> Shape {
    match shape {
        Shape::Box(b) => Shape::Box(Cuboid { min: b.min * s, max: b.max * s }),
        Shape::Sphere(b) => Shape::Sphere(Sphere { center: b.center * s, radius: b.radius * s }),
        Shape::Cylinder(c) => Shape::Cylinder(Cylinder { base: c.base * s, top: c.top * s, radius: c.radius * s, ..c }),
        Shape::Triangle(t) => Shape::Triangle(Triangle { a: t.a * s, b: t.b * s, c: t.c * s, ..t }),
        other => other,
    }
}

/// A room with a lamp at its ceiling, a box and a cylinder on the floor, a ball, and a sheet on the floor.
fn room(scale: f32) -> World {
    let mut shapes = vec![
        (cuboid([-2.0, -1.5, -2.0], [2.0, 1.5, 2.0]), 0),
        (cuboid([-0.5, 1.4, -0.5], [0.5, 1.5, 0.5]), 1),
        (cuboid([-1.5, -1.5, -1.25], [-0.75, -0.5, -0.25]), 0),
        (Shape::Sphere(Sphere { center: Vec3::new(1.0, -0.5, -1.0), radius: 0.5 }), 0),
        (
            Shape::Cylinder(Cylinder {
                base: Vec3::new(-1.0, -1.5, 1.0),
                top: Vec3::new(-1.0, -0.75, 1.0),
                radius: 0.5,
                caps: true,
            }),
            0,
        ),
    ];
    let wall = [[0.5, -1.5, 0.25], [1.5, -1.5, 0.25], [1.5, -0.5, 0.25], [0.5, -0.5, 0.25]];
    shapes.extend(sheet(wall).map(|shape| (shape, 0)));
    world_of(shapes, scale)
}

/// A solution with the settings that it was found with.
type Solved = (RadiositySolution, RadiositySettings);

fn solved(world: &World, error: f32) -> Solved {
    let settings = RadiositySettings { error, ..RadiositySettings::DEFAULT };
    (RadiositySolution::solve(world, &settings, &()).unwrap(), settings)
}

fn try_bake(world: &World, (solution, radiosity): &Solved, settings: &BakeSettings) -> Result<BakedScene, BakeError> {
    BakedScene::bake(world, (solution, radiosity), settings, &())
}

fn bake(world: &World, solution: &Solved, density: TexelDensity) -> BakedScene {
    try_bake(world, solution, &all_sides(density)).unwrap()
}

fn all_sides(density: TexelDensity) -> BakeSettings {
    BakeSettings { density, dark_sides: true }
}

/// The corners of all triangles.
fn triangles(baked: &BakedScene) -> Vec<[BakedVertex; 3]> {
    let parts = baked.meshes.iter().flat_map(|mesh| &mesh.parts);
    parts.flat_map(|part| part.triangles.iter().map(|t| t.map(|vertex| part.vertices[vertex as usize]))).collect()
}

/// The corners of a triangle in the atlas, in texels from the centre of the first texel.
fn in_texels(baked: &BakedScene, triangle: &[BakedVertex; 3]) -> [DVec2; 3] {
    let size = DVec2::new(baked.atlas.width.into(), baked.atlas.height.into());
    triangle.map(|vertex| vertex.light_uv.as_dvec2() * size - 0.5)
}

/// The texels whose centres lie in a triangle grown by a distance, with the barycentric coordinates of their centres.
fn texels_in(baked: &BakedScene, corners: [DVec2; 3], grown: f64) -> Vec<(usize, [f64; 3])> {
    let [a, b, c] = corners;
    let (min, max) = (a.min(b).min(c) - grown, a.max(b).max(c) + grown);
    let area = (b - a).perp_dot(c - a);
    let mut found = Vec::new();
    for y in min.y.ceil().max(0.0) as usize..=(max.y.floor() as usize).min(baked.atlas.height as usize - 1) {
        for x in min.x.ceil().max(0.0) as usize..=(max.x.floor() as usize).min(baked.atlas.width as usize - 1) {
            let p = DVec2::new(x as f64, y as f64);
            let weights = [(c - b).perp_dot(p - b), (a - c).perp_dot(p - c), (b - a).perp_dot(p - a)].map(|w| w / area);
            let depth = [(b, c), (c, a), (a, b)].map(|(from, to)| area.abs() / from.distance(to));
            if (0..3).all(|i| weights[i] * depth[i] >= -grown) {
                found.push((y * baked.atlas.width as usize + x, weights));
            }
        }
    }
    found
}

/// A number for each triangle, equal for triangles of one chart: those that are connected in the atlas.
fn charts_of(baked: &BakedScene, triangles: &[[BakedVertex; 3]]) -> Vec<usize> {
    let mut first_at: HashMap<[u32; 2], usize> = HashMap::new();
    let mut parent: Vec<usize> = (0..triangles.len()).collect();
    fn root(parent: &mut [usize], mut i: usize) -> usize {
        while parent[i] != i {
            i = parent[i];
        }
        i
    }
    for (number, triangle) in triangles.iter().enumerate() {
        for corner in in_texels(baked, triangle) {
            let key = (corner * 256.0).round().to_array().map(|v| v as u32);
            let other = *first_at.entry(key).or_insert(number);
            let (a, b) = (root(&mut parent, number), root(&mut parent, other));
            parent[a.max(b)] = a.min(b);
        }
    }
    (0..triangles.len()).map(|i| root(&mut parent, i)).collect()
}

#[test]
fn triangles_do_not_overlap_and_charts_keep_their_distance() {
    let world = room(1.0);
    let solution = solved(&world, 0.05);
    for density in [TexelDensity::ByPatches, TexelDensity::PerUnit(13.7), TexelDensity::ForSide(256)] {
        let baked = bake(&world, &solution, density);
        let triangles = triangles(&baked);
        let charts = charts_of(&baked, &triangles);
        let mut inside = vec![usize::MAX; baked.atlas.known.len()];
        let mut near = vec![usize::MAX; baked.atlas.known.len()];
        for (number, triangle) in triangles.iter().enumerate() {
            let corners = in_texels(&baked, triangle);
            for (texel, _) in texels_in(&baked, corners, -0.01) {
                assert_eq!(inside[texel], usize::MAX, "{density:?}: triangles {number} and {}", inside[texel]);
                inside[texel] = number;
            }
            // Bilinear filtering reads texels whose distance on each axis is less than 1.
            for (texel, _) in texels_in(&baked, corners, 0.9) {
                assert!([usize::MAX, charts[number]].contains(&near[texel]), "{density:?}: charts are too near");
                near[texel] = charts[number];
                assert!(baked.atlas.known[texel] || is_of_floor(triangle), "{density:?}: a texel has no light");
            }
        }
        let used = inside.iter().filter(|number| **number != usize::MAX).count();
        println!("{density:?}: {} charts, {used} of {} texels inside", baked.charts, inside.len());
        assert!(used > 1000);
    }
}

/// Whether a triangle is a part of the floor, which the cylinder covers in part.
fn is_of_floor(triangle: &[BakedVertex; 3]) -> bool {
    triangle.iter().all(|vertex| vertex.position.y < -1.49) && triangle[0].normal.y > 0.0
}

/// The light that the solution has on the side of a triangle at a point of it.
fn light_there(world: &World, solution: &RadiositySolution, point: DVec3, normal: Vec3) -> Option<DVec3> {
    let normal = normal.as_dvec3();
    let line = DRay { origin: point + normal * 0.05, direction: -normal };
    let hit = world.intersect(&Ray { origin: line.origin.as_vec3(), direction: line.direction.as_vec3() }, 0.1)?;
    let is_outer = world.surface(line, &hit).normal.dot(normal) > 0.0;
    let light = solution.light_at(hit.instance, hit.primitive, hit.part, is_outer, point)?;
    Some(light.sum())
}

#[test]
fn texels_have_the_light_of_the_solution() {
    let world = room(1.0);
    let solution = solved(&world, 0.05);
    let baked = bake(&world, &solution, TexelDensity::PerUnit(16.0));
    let (mut compared, mut lit, mut of_ball) = (0, 0, 0);
    for triangle in triangles(&baked) {
        for (texel, weights) in texels_in(&baked, in_texels(&baked, &triangle), -0.05) {
            // Under the cylinder the floor is covered.
            if !baked.atlas.known[texel] {
                continue;
            }
            let point: DVec3 = (0..3).map(|i| triangle[i].position.as_dvec3() * weights[i]).sum();
            let normal = triangle[0].normal;
            // The facets of curved surfaces and what stands on the floor leave gaps in which rays meet others first.
            let Some(light) = light_there(&world, &solution.0, point, normal) else { continue };
            let found = DVec3::from_array(baked.atlas.light[texel].map(f64::from));
            // Where two pieces meet, either may be asked.
            let near = [[1e-4, 0.0], [-1e-4, 0.0], [0.0, 1e-4], [0.0, -1e-4]].map(|[x, y]| {
                let (along, across) = normal.as_dvec3().any_orthonormal_pair();
                light_there(&world, &solution.0, point + along * x + across * y, normal).unwrap_or(light)
            });
            let error_of = |light: DVec3| (found - light).abs().max_element();
            let error = near.into_iter().chain([light]).map(error_of).fold(f64::INFINITY, f64::min);
            compared += 1;
            lit += i32::from(light.x > 0.01);
            let is_of_ball = point.distance(DVec3::new(1.0, -0.5, -1.0)) < 0.51;
            of_ball += i32::from(is_of_ball && light.x > 0.01);
            assert!(error < 2e-3 * (1.0 + light.max_element()), "{point}: {found} instead of {light}");
            let radiance = baked.atlas.radiance[texel][0];
            let is_lamp = radiance == 8.0;
            assert!(is_lamp || (radiance - 0.6 * baked.atlas.light[texel][0]).abs() < 1e-5, "{point}: {radiance}");
        }
    }
    println!("{compared} texels, {lit} of them lit");
    assert!(lit > 5000 && of_ball > 100, "{compared} {lit}, {of_ball} of the ball");
}

/// In a closed room whose surfaces emit E and reflect ρ, light is E / (1 − ρ) everywhere.
#[test]
fn a_furnace_has_a_constant_atlas() {
    let mut wall = material("wall", 0.5, 1.0);
    wall.two_sided = true;
    let nodes = vec![
        Node::from(cuboid([-1.0; 3], [1.0; 3])).with_material(0),
        Node::from(Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 0.4 })).with_material(0),
    ];
    let world = World::build(Scene { materials: vec![wall], nodes, ..Scene::default() }).unwrap();
    let baked = bake(&world, &solved(&world, 0.05), TexelDensity::PerUnit(20.0));
    let mut compared = [0; 2];
    for triangle in triangles(&baked) {
        // The outer sides of the room and the inner ones of the ball see other rooms.
        let middle = triangle.iter().map(|vertex| vertex.position).sum::<Vec3>() / 3.0;
        let is_wall = middle.abs().max_element() > 0.9;
        if is_wall != (triangle[0].normal.dot(middle) < 0.0) {
            continue;
        }
        for (texel, _) in texels_in(&baked, in_texels(&baked, &triangle), 0.0) {
            compared[usize::from(is_wall)] += 1;
            assert!((baked.atlas.light[texel][0] - 2.0).abs() < 1e-3, "{:?}", baked.atlas.light[texel]);
            assert!((baked.atlas.radiance[texel][0] - 2.0).abs() < 1e-3);
        }
    }
    assert!(compared[0] > 500 && compared[1] > 5000, "{compared:?}");
}

/// Without a roof, a wall of no thickness has light on one side and almost none on the other. Bilinear filtering along
/// its foot mixes neither.
#[test]
fn light_does_not_leak_through_a_thin_wall() {
    let floor = sheet([[-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0], [-2.0, 0.0, -2.0]]);
    let wall = sheet([[0.03, 0.0, 1.5], [0.03, 0.0, -1.5], [0.03, 3.0, -1.5], [0.03, 3.0, 1.5]]);
    let lamp = cuboid([-1.6, 0.6, -0.25], [-1.2, 0.9, 0.25]);
    let shapes = floor.into_iter().chain(wall).map(|shape| (shape, 0)).chain([(lamp, 1)]);
    let world = world_of(shapes, 1.0);
    let solution = solved(&world, 0.01);
    let baked = bake(&world, &solution, TexelDensity::PerUnit(8.0));
    let at = |x: f32| {
        let p = DVec3::new(f64::from(x), 0.0, 0.1);
        let mut found = Vec::new();
        for triangle in triangles(&baked).iter().filter(|triangle| triangle[0].normal.y > 0.9) {
            let [a, b, c] = triangle.map(|vertex| vertex.position.as_dvec3());
            if [a, b, c].iter().any(|corner| corner.y.abs() > 1e-6) {
                continue;
            }
            let flat = |v: DVec3| DVec2::new(v.x, v.z);
            let area = flat(b - a).perp_dot(flat(c - a));
            let weights = [(b, c), (c, a), (a, b)].map(|(from, to)| flat(to - from).perp_dot(flat(p - from)) / area);
            if weights.iter().all(|weight| *weight >= 0.0) {
                let texels = in_texels(&baked, triangle);
                found.push(bilinear(&baked, (0..3).map(|i| texels[i] * weights[i]).sum()));
            }
        }
        found[0]
    };
    let [lit, dark] = [at(0.03 - 0.004), at(0.03 + 0.004)];
    println!("{lit} before the wall, {dark} behind it");
    assert!(lit > 0.05 && dark < 0.02 * lit, "{lit} {dark}");
}

fn bilinear(baked: &BakedScene, p: DVec2) -> f64 {
    let base = p.floor();
    let part = p - base;
    let light = |x: usize, y: usize| {
        let index = (base.y as usize + y) * baked.atlas.width as usize + base.x as usize + x;
        f64::from(baked.atlas.light[index][0])
    };
    let row = |y: usize| light(0, y) * (1.0 - part.x) + light(1, y) * part.x;
    row(0) * (1.0 - part.y) + row(1) * part.y
}

#[test]
fn both_sides_of_a_sheet_have_their_own_light() {
    let shapes = sheet([[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]]);
    let lamp = cuboid([-0.25, 1.0, -0.25], [0.25, 1.1, 0.25]);
    let world = world_of(shapes.into_iter().map(|shape| (shape, 0)).chain([(lamp, 1)]), 1.0);
    let solution = solved(&world, 0.05);
    let lit = try_bake(&world, &solution, &BakeSettings::default()).unwrap();
    let is_of_sheet = |triangle: &&[BakedVertex; 3]| triangle.iter().all(|vertex| vertex.position.y == 0.0);
    let of_sheet = triangles(&lit).iter().filter(is_of_sheet).copied().collect::<Vec<_>>();
    assert!(!of_sheet.is_empty() && of_sheet.iter().flatten().all(|vertex| vertex.normal == Vec3::Y));
    let baked = bake(&world, &solution, TexelDensity::ByPatches);
    let mut found = [0, 0];
    for triangle in triangles(&baked).iter().filter(is_of_sheet) {
        let [a, b, c] = triangle.map(|vertex| vertex.position);
        let is_above = triangle[0].normal.y > 0.0;
        assert_eq!((b - a).cross(c - a).y > 0.0, is_above, "triangles run around their normal");
        for (texel, _) in texels_in(&baked, in_texels(&baked, triangle), 0.0) {
            found[usize::from(is_above)] += 1;
            assert_eq!(baked.atlas.light[texel][0] > 0.0, is_above);
        }
    }
    // The dark side needs few texels.
    assert!(found[1] > 100 && (3..100).contains(&found[0]), "{found:?}");
}

/// No corner of a triangle lies inside the edge of another: a rasteriser then leaves no pixels between them.
#[test]
fn triangles_meet_at_whole_edges() {
    let world = room(1.0);
    let baked = bake(&world, &solved(&world, 0.1), TexelDensity::ByPatches);
    // The box and the sheet cut the floor.
    let triangles: Vec<_> = triangles(&baked).into_iter().filter(is_of_floor).collect();
    let corners: Vec<DVec3> = triangles.iter().flatten().map(|vertex| vertex.position.as_dvec3()).collect();
    assert!(triangles.len() > 20, "{}", triangles.len());
    for triangle in &triangles {
        let around = triangle.map(|vertex| vertex.position.as_dvec3());
        for i in 0..3 {
            let (a, b) = (around[i], around[(i + 1) % 3]);
            for &p in &corners {
                let along = (p - a).dot(b - a) / (b - a).length_squared();
                let off = (a + (b - a) * along).distance(p);
                let inside = along > 1e-4 && along < 1.0 - 1e-4 && off < 1e-6;
                assert!(!inside, "{p} lies between {a} and {b}");
            }
        }
    }
}

#[test]
fn threads_and_powers_of_two_change_no_bit() {
    let bake_on = |threads: usize, scale: f32| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let world = room(scale);
            bake(&world, &solved(&world, 0.1), TexelDensity::ByPatches)
        })
    };
    let first = bake_on(1, 1.0);
    assert!(bake_on(3, 1.0) == first);
    let larger = bake_on(2, 8.0);
    assert!(larger.atlas == first.atlas);
    let at = |baked: &BakedScene| -> Vec<_> {
        triangles(baked).iter().flatten().map(|v| (v.light_uv, v.normal, v.position)).collect()
    };
    let scaled: Vec<_> = at(&first).into_iter().map(|(uv, normal, position)| (uv, normal, position * 8.0)).collect();
    assert_eq!(at(&larger), scaled);
}

#[test]
fn errors_name_what_fits() {
    let world = room(1.0);
    let solution = solved(&world, 0.1);
    let error = |density| match try_bake(&world, &solution, &all_sides(density)) {
        Err(error) => error,
        Ok(_) => panic!("it doesn't fit"),
    };
    let BakeError::TooManyTexels { most, .. } = error(TexelDensity::PerUnit(1e6)) else { panic!() };
    assert!((100.0..8192.0).contains(&most), "{most}");
    let rows = (0..400).map(|i| [(i % 20) as f32 * 2.0, 0.0, (i / 20) as f32 * 2.0]);
    let boxes = rows.map(|min| (cuboid(min, min.map(|v| v + 1.0)), 0)).chain([(cuboid([0.0, 9.0, 0.0], [40.0; 3]), 1)]);
    let boxes = world_of(boxes, 1.0);
    let small = try_bake(&boxes, &solved(&boxes, 0.5), &all_sides(TexelDensity::ForSide(64)));
    assert!(matches!(small.err(), Some(BakeError::TooManyCharts { side: 64, .. })));
    for density in [TexelDensity::PerUnit(0.0), TexelDensity::PerUnit(f64::NAN), TexelDensity::ForSide(7)] {
        assert!(matches!(error(density), BakeError::Range(_)), "{density:?}");
    }
    let other = RadiositySettings { error: 0.3, ..solution.1 };
    let mixed = BakedScene::bake(&world, (&solution.0, &other), &BakeSettings::default(), &());
    assert_eq!(mixed.err(), Some(BakeError::OtherSolution));
    struct Cancelled;
    impl Observer for Cancelled {
        fn cancelled(&self) -> bool {
            true
        }
    }
    let cancelled = BakedScene::bake(&world, (&solution.0, &solution.1), &BakeSettings::default(), &Cancelled);
    assert_eq!(cancelled.err(), Some(BakeError::Cancelled));
}
