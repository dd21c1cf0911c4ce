//! Ten thousand copies of a mesh, as a list and nested, beside the mesh alone: the rays are the same, seen from the copy that they are for, so that
//! the ratio is what finding the copy costs.

use canaletto::math::Transform;
use canaletto::scene::{Content, Node, Scene};
use canaletto::shape;
use canaletto::world::World;
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::mesh::Mesh;
use super::noise::uniform;
use super::rays::{self, RaySet, Segment, View};
use super::statistics::{Clock, Times};
use super::trace::{Options, pool};

/// Copies along each side of the square.
const SIDE: u32 = 100;

/// Where a copy stands in its row, and the row in the square; each is turned in its own way.
fn place(i: u32, pitch: f64) -> Transform {
    let turn = Transform::rotate(DVec3::Z, 360.0 * f64::from(uniform(31, i.into()))).unwrap_or_default();
    Transform::translate(DVec3::X * (f64::from(i) - 0.5 * f64::from(SIDE - 1)) * pitch).after(&turn)
}

fn row(j: u32, pitch: f64) -> Transform {
    Transform::translate(DVec3::Y * (f64::from(j) - 0.5 * f64::from(SIDE - 1)) * pitch)
}

/// The mesh in these places; with `nested`, as rows of copies.
fn world(mesh: &Mesh, pitch: f64, copies: u32, nested: bool) -> Result<World, String> {
    let mesh =
        shape::Mesh { positions: mesh.positions.clone(), triangles: mesh.triangles.clone(), ..shape::Mesh::default() };
    let at = |transform, content| Node { transform, ..Node::new(content) };
    let (mut nodes, mut prototypes) = (Vec::new(), Vec::new());
    if copies == 1 {
        nodes.push(Node::new(Content::Mesh(0)));
    } else if nested {
        let copies = (0..SIDE).map(|i| at(place(i, pitch), Content::Mesh(0))).collect();
        prototypes.push(Node::new(Content::Group(copies)));
        nodes.extend((0..SIDE).map(|j| at(row(j, pitch), Content::Instance(0))));
    } else {
        let copy = |n: u32| at(row(n / SIDE, pitch).after(&place(n % SIDE, pitch)), Content::Mesh(0));
        nodes.extend((0..SIDE * SIDE).map(copy));
    }
    let scene = Scene { meshes: vec![mesh], prototypes, nodes, ..Scene::default() };
    World::build(scene).map_err(|e| e.to_string())
}

/// Seconds for all rays, and how many hit something.
fn trace(world: &World, set: &RaySet, clock: Clock) -> (f64, usize) {
    let mut hits = 0;
    let meets = |s: &&Segment| world.intersect(&Ray::new(s.origin, s.direction), s.t_max).is_some();
    let seconds = clock.time(|| hits = set.rays.par_chunks(4096).map(|rays| rays.iter().filter(meets).count()).sum());
    (seconds, hits)
}

/// Compares and prints, and tells all in JSON.
pub fn run(options: &Options) -> Result<Value, String> {
    println!("closest hits one by one; copies beside the mesh alone on the same rays; {} rounds", options.rounds);
    let mut rows = Vec::new();
    for recipe in &options.meshes {
        let mesh = recipe.make();
        rows.extend(compare(&mesh, options)?);
    }
    Ok(json!({ "what": "instances", "size": options.size, "rounds": options.rounds, "rows": rows }))
}

fn compare(mesh: &Mesh, options: &Options) -> Result<Vec<Value>, String> {
    let extent = mesh.extent();
    let pitch = 2.2 * f64::from(extent);
    let [alone, list, nested] = [
        world(mesh, pitch, 1, false)?,
        world(mesh, pitch, SIDE * SIDE, false)?,
        world(mesh, pitch, SIDE * SIDE, true)?,
    ];
    for (name, world) in [("alone", &alone), ("list", &list), ("nested", &nested)] {
        let census = world.census();
        println!("{name:7} {} instances, {} MiB", census.instances, census.bytes >> 20);
    }
    let count = mesh.triangles.len() as u32;
    let placed = |n: u32| row(n / SIDE, pitch).after(&place(n % SIDE, pitch));
    // Copies are numbered row by row, as the world does.
    let normal = |id: u32, _| placed(id / count).vector(mesh.normal(id % count).as_dvec3()).as_vec3();
    let hits = |rays: &[Segment]| -> Vec<Option<(u32, f32)>> {
        let hit = |s: &Segment| list.intersect(&Ray::new(s.origin, s.direction), s.t_max);
        rays.par_iter().map(hit).map(|hit| hit.map(|hit| (hit.instance * count + hit.primitive, hit.t))).collect()
    };
    let view = View {
        eye: Vec3::new(0.0, -150.0, 80.0) * extent,
        target: Vec3::ZERO,
        fovy: 40.0,
        light: Vec3::new(-100.0, -50.0, 200.0) * extent,
        extent,
    };
    let wanted = |name: &str| ["primary", "diffuse"].contains(&name);
    let sets = rays::make(&view, options.size, wanted, normal, hits);
    let mut rows = Vec::new();
    for set in &sets {
        // Those that hit, and the same as the copy sees them.
        let found = hits(&set.rays);
        let hitting = |(ray, hit): (&Segment, &Option<(u32, f32)>)| hit.map(|(id, _)| (*ray, id / count));
        let (rays, copies): (Vec<Segment>, Vec<u32>) = set.rays.iter().zip(&found).filter_map(hitting).unzip();
        let local = |(ray, &copy): (&Segment, &u32)| {
            let back = placed(copy).inverse();
            let origin = back.point(ray.origin.as_dvec3()).as_vec3();
            Segment { origin, direction: back.vector(ray.direction.as_dvec3()).as_vec3(), ..*ray }
        };
        let seen = rays.iter().zip(&copies).map(local).collect();
        let [rays, seen] = [rays, seen].map(|rays| RaySet::new(set.name, false, set.coherent, rays));
        for &threads in &options.threads {
            rows.push(pool(threads)?.install(|| turns(&rays, &seen, [&alone, &list, &nested], threads, options)));
        }
    }
    Ok(rows)
}

fn turns(rays: &RaySet, seen: &RaySet, worlds: [&World; 3], threads: usize, options: &Options) -> Value {
    let mut times = [const { Times(Vec::new()) }; 3];
    let mut hits = [0; 3];
    for round in 0..=options.rounds {
        for (i, world) in worlds.into_iter().enumerate() {
            let (seconds, met) = trace(world, if i == 0 { seen } else { rays }, options.clock);
            hits[i] = met;
            if round > 0 {
                times[i].0.push(seconds);
            }
        }
    }
    let count = rays.rays.len();
    let rate = times.each_ref().map(|times| count as f64 / times.median() / 1e6);
    let cost = [1, 2].map(|i| times[0].faster_than(&times[i]));
    println!(
        "{:8} {threads} threads, {:.2} M rays: alone {:.2}, list {:.2}, nested {:.2} Mrays/s; cost of list {}, nested {}; hits {hits:?}",
        rays.name,
        count as f64 / 1e6,
        rate[0],
        rate[1],
        rate[2],
        cost[0],
        cost[1]
    );
    json!({ "rays": rays.name, "threads": threads, "count": count, "hits": hits, "mrays": rate,
        "cost": cost.map(|c| c.median) })
}
