//! Ten thousand copies of a mesh, as a list and as rows of copies, compared with the mesh alone. The mesh alone is
//! traced with the rays of the hit copies in object space, so the ratio is the cost of finding the copy. The rays are
//! traced again with the square of rows as one of a hundred, and of a hundred thousand. These are a million copies and
//! a thousand million, more than any list could hold.

use canaletto::math::Transform;
use canaletto::scene::{Content, Node, Scene};
use canaletto::shape;
use canaletto::world::World;
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::time::Instant;

use super::mesh::Mesh;
use super::noise::uniform;
use super::rays::{self, RaySet, Segment, View};
use super::statistics::{Clock, Times};
use super::trace::{Options, pool};
use crate::say;

/// The number of copies along each side of the square.
const SIDE: u32 = 100;

/// The transform of a copy in its row, or of a row in the square, each with its own rotation.
fn place(i: u32, pitch: f64) -> Transform {
    let turn = Transform::rotate(DVec3::Z, 360.0 * f64::from(uniform(31, i.into()))).unwrap_or_default();
    Transform::translate(DVec3::X * (f64::from(i) - 0.5 * f64::from(SIDE - 1)) * pitch).after(&turn)
}

fn row(j: u32, pitch: f64) -> Transform {
    Transform::translate(DVec3::Y * (f64::from(j) - 0.5 * f64::from(SIDE - 1)) * pitch)
}

/// The transform of one of many adjacent squares, the first in the middle. A province has a hundred of them.
fn square(k: u32, pitch: f64) -> Transform {
    let (x, y) = (f64::from((k + 5) % 10) - 5.0, f64::from((k / 10 + 5) % 10) - 5.0);
    Transform::translate(DVec3::new(x, y, 0.0) * pitch * 4.0 * f64::from(SIDE))
}

fn province(k: u32, pitch: f64) -> Transform {
    Transform::translate(DVec3::new(f64::from(k % 32), f64::from(k / 32), 0.0) * pitch * 80.0 * f64::from(SIDE))
}

/// The arrangement of the copies.
#[derive(Clone, Copy, PartialEq)]
enum Arrangement {
    Alone,
    List,
    /// A square of rows.
    Rows,
    /// A hundred squares.
    Squares,
    /// A thousand provinces of a hundred squares.
    Provinces,
}

const ARRANGEMENTS: [(&str, Arrangement); 5] = [
    ("alone", Arrangement::Alone),
    ("list", Arrangement::List),
    ("rows", Arrangement::Rows),
    ("squares", Arrangement::Squares),
    ("provinces", Arrangement::Provinces),
];

/// A world with the mesh in this arrangement.
fn world(mesh: &Mesh, pitch: f64, arrangement: Arrangement) -> Result<World, String> {
    let mesh =
        shape::Mesh { positions: mesh.positions.clone(), triangles: mesh.triangles.clone(), ..shape::Mesh::default() };
    let at = |transform: Transform, content| Node { transform: transform.into(), ..Node::new(content) };
    let group = |nodes: Vec<Node>| Node::new(Content::Group(nodes));
    let repeat = |of: u32, count: u32, place: fn(u32, f64) -> Transform| -> Vec<Node> {
        (0..count).map(|k| at(place(k, pitch), Content::Instance(of))).collect()
    };
    let copy = |n: u32| at(row(n / SIDE, pitch).after(&place(n % SIDE, pitch)), Content::Mesh(0));
    let copies = (0..SIDE).map(|i| at(place(i, pitch), Content::Mesh(0))).collect();
    let prototypes = vec![group(copies), group(repeat(0, SIDE, row)), group(repeat(1, 100, square))];
    let nodes = match arrangement {
        Arrangement::Alone => vec![Node::new(Content::Mesh(0))],
        Arrangement::List => (0..SIDE * SIDE).map(copy).collect(),
        Arrangement::Rows => repeat(0, SIDE, row),
        Arrangement::Squares => repeat(1, 100, square),
        Arrangement::Provinces => repeat(2, 1000, province),
    };
    let scene = Scene { meshes: vec![mesh], prototypes, nodes, ..Scene::default() };
    World::build(scene).map_err(|e| e.to_string())
}

/// The seconds for all rays, and the number of hits.
fn trace(world: &World, set: &RaySet, clock: Clock) -> (f64, usize) {
    let mut hits = 0;
    let meets = |s: &&Segment| world.intersect(&Ray::new(s.origin, s.direction), s.t_max).is_some();
    let seconds = clock.time(|| hits = set.rays.par_chunks(4096).map(|rays| rays.iter().filter(meets).count()).sum());
    (seconds, hits)
}

/// Compares, prints, and returns everything as JSON.
pub fn run(options: &Options) -> Result<Value, String> {
    say!("closest hits one by one; copies beside the mesh alone on the same rays; {} rounds", options.rounds);
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
    let mut worlds = Vec::new();
    for (name, arrangement) in ARRANGEMENTS {
        let start = Instant::now();
        let world = world(mesh, pitch, arrangement)?;
        let (stats, seconds) = (world.stats(), start.elapsed().as_secs_f64());
        say!("{name:9} {:10} instances, {} KiB, built in {seconds:.3} s", stats.instances, stats.bytes >> 10);
        worlds.push(world);
    }
    let list = &worlds[1];
    let count = mesh.triangles.len() as u32;
    let placed = |n: u32| row(n / SIDE, pitch).after(&place(n % SIDE, pitch));
    // The ids of copies run row by row, as in the world.
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
        // The rays that hit, in world space and in the copy's object space.
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
            rows.push(pool(threads)?.install(|| turns(&rays, &seen, &worlds, threads, options)));
        }
    }
    Ok(rows)
}

fn turns(rays: &RaySet, seen: &RaySet, worlds: &[World], threads: usize, options: &Options) -> Value {
    let mut times = [const { Times(Vec::new()) }; ARRANGEMENTS.len()];
    let mut hits = [0; ARRANGEMENTS.len()];
    for round in 0..=options.rounds {
        for (i, world) in worlds.iter().enumerate() {
            let (seconds, met) = trace(world, if i == 0 { seen } else { rays }, options.clock);
            hits[i] = met;
            if round > 0 {
                times[i].0.push(seconds);
            }
        }
    }
    let count = rays.rays.len();
    let rate = times.each_ref().map(|times| count as f64 / times.median() / 1e6);
    let cost = times.each_ref().map(|other| times[0].faster_than(other));
    say!(
        "{:8} {threads} threads, {:.2} M rays, {:.2} Mrays/s alone; hits {hits:?}; cost of",
        rays.name,
        count as f64 / 1e6,
        rate[0]
    );
    for ((name, _), cost) in ARRANGEMENTS.iter().zip(&cost).skip(1) {
        say!("  {name:9} {cost}");
    }
    json!({ "rays": rays.name, "threads": threads, "count": count, "hits": hits, "mrays": rate,
        "cost": cost.map(|c| c.median) })
}
