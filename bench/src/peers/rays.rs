//! Ray sets: rays from the eye, and rays from their hits, in the order in which a renderer traces them.

use canaletto_bvh::Ray;
use glam::Vec3;
use rayon::prelude::*;

use super::noise::{around, uniform};

/// One ray in the layout for single-ray interfaces: the points `origin + t * direction`, 0 < t ≤ `t_max`.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
pub struct Segment {
    /// The point at t = 0.
    pub origin: Vec3,
    /// The direction of growing t.
    pub direction: Vec3,
    /// The end of the ray.
    pub t_max: f32,
}

/// Sixteen rays in the layout for packet interfaces: rows of origin x y z, direction x y z and `t_max`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Packet(pub [[f32; 16]; 7]);

/// Rays to be traced, in the layouts of all interfaces.
pub struct RaySet {
    /// The name on the command line.
    pub name: &'static str,
    /// Whether an any-hit query suffices.
    pub any: bool,
    /// Whether neighbouring rays are coherent, which a peer may use.
    pub coherent: bool,
    /// The rays one by one.
    pub rays: Vec<Segment>,
    /// The rays by sixteens. The last packet is filled up with its last ray.
    pub packets: Vec<Packet>,
    /// The rays in Canaletto's layout.
    pub own: Vec<Ray>,
    /// The ends of the rays in `own`.
    pub t_max: Vec<f32>,
}

/// Consecutive rays of a set, in all layouts.
#[derive(Clone, Copy)]
pub struct Run<'a> {
    /// The rays one by one.
    pub rays: &'a [Segment],
    /// The rays by sixteens, from the first of `rays` on.
    pub packets: &'a [Packet],
    /// The rays in Canaletto's layout.
    pub own: &'a [Ray],
    /// The ends of the rays in `own`.
    pub t_max: &'a [f32],
    /// Whether neighbouring rays are coherent.
    pub coherent: bool,
}

/// The names of all sets, with their descriptions.
pub const SETS: [(&str, &str); 7] = [
    ("primary", "from the eye through each pixel, closest hit"),
    ("shadow", "from their hits to a light at a point, any hit"),
    ("diffuse", "from their hits, spread by the cosine, closest hit"),
    ("diffuse-any", "the same, any hit"),
    ("second", "from the hits of diffuse, spread by the cosine, closest hit"),
    ("second-any", "the same, any hit"),
    ("ao", "from the hits of primary, spread by the cosine, short, any hit"),
];

/// The view of a scene.
#[derive(Clone, Copy)]
pub struct View {
    /// The eye.
    pub eye: Vec3,
    /// The point in the centre of the view.
    pub target: Vec3,
    /// The vertical field of view in degrees.
    pub fovy: f32,
    /// The position of a point light.
    pub light: Vec3,
    /// The largest absolute coordinate.
    pub extent: f32,
}

/// The origin of further rays at a hit.
#[derive(Clone, Copy)]
pub struct Start {
    /// The point, moved off the surface.
    pub point: Vec3,
    /// The normal on the side that was hit.
    pub normal: Vec3,
}

impl RaySet {
    /// A set with its rays in all layouts.
    pub fn new(name: &'static str, any: bool, coherent: bool, rays: Vec<Segment>) -> Self {
        let packets = rays
            .par_chunks(16)
            .map(|chunk| {
                let mut packet = Packet([[0.0; 16]; 7]);
                for lane in 0..16 {
                    let ray = chunk[lane.min(chunk.len() - 1)];
                    let [o, d] = [ray.origin, ray.direction];
                    for (row, value) in [o.x, o.y, o.z, d.x, d.y, d.z, ray.t_max].into_iter().enumerate() {
                        packet.0[row][lane] = value;
                    }
                }
                packet
            })
            .collect();
        let own = rays.iter().map(|segment| Ray::new(segment.origin, segment.direction)).collect();
        let t_max = rays.iter().map(|segment| segment.t_max).collect();
        Self { name, any, coherent, rays, packets, own, t_max }
    }

    /// All rays, in runs of `len`, which is a multiple of sixteen.
    pub fn runs(&self, len: usize) -> impl IndexedParallelIterator<Item = Run<'_>> {
        let embree = self.rays.par_chunks(len).zip(self.packets.par_chunks(len / 16));
        let own = self.own.par_chunks(len).zip(self.t_max.par_chunks(len));
        let coherent = self.coherent;
        embree.zip(own).map(move |((rays, packets), (own, t_max))| Run { rays, packets, own, t_max, coherent })
    }
}

/// Rays from the eye, in tiles of 8 × 8 pixels.
fn primary(view: &View, [width, height]: [u32; 2]) -> Vec<Segment> {
    let forward = (view.target - view.eye).normalize();
    let right = forward.cross(Vec3::Z).normalize();
    let up = right.cross(forward);
    let half = libm::tanf(view.fovy.to_radians() / 2.0);
    let tiles = [width.div_ceil(8), height.div_ceil(8)];
    let pixels = (0..tiles[0] * tiles[1]).flat_map(|tile| {
        let corner = [tile % tiles[0] * 8, tile / tiles[0] * 8];
        (0..64).map(move |i| [corner[0] + i % 8, corner[1] + i / 8])
    });
    pixels
        .filter(|&[x, y]| x < width && y < height)
        .map(|[x, y]| {
            let x = (x as f32 + 0.5 - width as f32 / 2.0) / height as f32 * 2.0 * half;
            let y = (height as f32 / 2.0 - y as f32 - 0.5) / height as f32 * 2.0 * half;
            Segment { origin: view.eye, t_max: f32::INFINITY, direction: (forward + right * x + up * y).normalize() }
        })
        .collect()
}

fn spread(starts: &[Start], seed: u64, t_max: f32) -> Vec<Segment> {
    starts
        .par_iter()
        .enumerate()
        .map(|(i, start)| {
            let i = 2 * i as u64;
            let direction = around(start.normal, uniform(seed, i), uniform(seed, i + 1));
            Segment { origin: start.point, t_max, direction }
        })
        .collect()
}

/// Makes the named sets, for pictures of this size. `hits` returns the closest hits of rays, each with its primitive
/// and t. `normal` returns the primitive's normal at a point, of any length.
pub fn make(
    view: &View,
    size: [u32; 2],
    wanted: impl Fn(&str) -> bool,
    normal: impl Fn(u32, Vec3) -> Vec3,
    hits: impl Fn(&[Segment]) -> Vec<Option<(u32, f32)>>,
) -> Vec<RaySet> {
    let extent = view.extent;
    let starts = |rays: &[Segment]| -> Vec<Start> {
        let start = |(ray, hit): (&Segment, Option<(u32, f32)>)| {
            let (primitive, t) = hit?;
            let point = ray.origin + t * ray.direction;
            let normal = normal(primitive, point).normalize_or_zero();
            let normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
            // The distance is large enough that no peer hits the primitive again.
            Some(Start { point: point + normal * (extent * 1e-5), normal })
        };
        rays.iter().zip(hits(rays)).filter_map(start).filter(|start| start.normal.is_normalized()).collect()
    };
    let mut sets = Vec::new();
    let mut add = |name, any, coherent, rays: &[Segment]| {
        if wanted(name) {
            sets.push(RaySet::new(name, any, coherent, rays.to_vec()));
        }
    };
    let eye = primary(view, size);
    add("primary", false, true, &eye);
    let first = starts(&eye);
    let to_light = |start: &Start| Segment { origin: start.point, t_max: 1.0, direction: view.light - start.point };
    add("shadow", true, true, &first.iter().map(to_light).collect::<Vec<_>>());
    let diffuse = spread(&first, 1, f32::INFINITY);
    add("diffuse", false, false, &diffuse);
    add("diffuse-any", true, false, &diffuse);
    if wanted("second") || wanted("second-any") {
        let second = spread(&starts(&diffuse), 2, f32::INFINITY);
        add("second", false, false, &second);
        add("second-any", true, false, &second);
    }
    add("ao", true, false, &spread(&first, 3, extent * 0.1));
    sets
}
