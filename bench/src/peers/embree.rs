//! Intel's Embree 3 (Debian's `libembree-dev` or `libembree3-3`), loaded at run time.
//!
//! The declarations follow the documentation of its C interface and cover only what is used here. Embree's advice to
//! flush denormal numbers to zero is not followed, since a Rust program may not change that mode. No ray set has such
//! numbers in bulk.
// A foreign library can't be called otherwise. Each block states its premises.
#![allow(unsafe_code)]

use std::ffi::{CString, c_char, c_void};
use std::sync::atomic::{AtomicIsize, Ordering};

use canaletto_bvh::InstructionSet;
use glam::Vec3;
use libloading::Library;

use super::rays::{Packet, Run, Segment};
use super::trace::{Hits, Tracer};

/// The command that installs the library.
pub const INSTALL: &str = "apt-get install libembree-dev";

const NAMES: [&str; 3] = ["libembree3.so.3", "libembree3.so", "libembree3.dylib"];
const INVALID: u32 = u32::MAX;
const FORMAT_UINT3: i32 = 0x5003;
const FORMAT_FLOAT3: i32 = 0x9003;
const BUFFER_INDEX: i32 = 0;
const BUFFER_VERTEX: i32 = 1;
const FORMAT_UINT: i32 = 0x5001;
const FORMAT_FLOAT4: i32 = 0x9004;
const TRIANGLES: i32 = 0;
const CONES: i32 = 15;
const SPHERES: i32 = 50;
const COHERENT: i32 = 1;

/// How well the tree is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
#[repr(i32)]
pub enum Quality {
    /// Morton codes.
    Low = 0,
    /// Binned surface area heuristic.
    Medium = 1,
    /// With spatial splits.
    High = 2,
}

/// The settings of a scene's build.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// The build quality of the tree.
    pub quality: Quality,
    /// The watertight mode, which is slower.
    pub robust: bool,
    /// The mode with less memory, which is slower.
    pub compact: bool,
}

type Pointer = *mut c_void;

#[repr(C)]
struct Context {
    flags: i32,
    filter: Option<extern "C" fn()>,
    instance: [u32; 1],
}

#[derive(Clone, Copy)]
#[repr(C, align(16))]
struct Ray1 {
    origin: [f32; 3],
    near: f32,
    direction: [f32; 3],
    time: f32,
    far: f32,
    mask: u32,
    id: u32,
    flags: u32,
}

#[derive(Clone, Copy)]
#[repr(C, align(16))]
struct Hit1 {
    normal: [f32; 3],
    u: f32,
    v: f32,
    primitive: u32,
    geometry: u32,
    instance: u32,
}

#[derive(Clone, Copy)]
#[repr(C)]
struct RayHit1 {
    ray: Ray1,
    hit: Hit1,
}

/// `N` rays as arrays of the fields of [`Ray1`].
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct RayN<const N: usize> {
    origin: [[f32; N]; 3],
    near: [f32; N],
    direction: [[f32; N]; 3],
    time: [f32; N],
    far: [f32; N],
    mask: [u32; N],
    id: [u32; N],
    flags: [u32; N],
}

#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct RayHitN<const N: usize> {
    ray: RayN<N>,
    normal: [[f32; N]; 3],
    u: [f32; N],
    v: [f32; N],
    primitive: [u32; N],
    geometry: [u32; N],
    instance: [u32; N],
}

/// The mask of valid rays: −1 for a ray to be traced.
#[repr(C, align(64))]
struct Valid<const N: usize>([i32; N]);

type Packets<T> = unsafe extern "C" fn(*const i32, Pointer, *mut Context, *mut T);

/// The library's functions. The library is never unloaded, since its threads run until the process ends.
struct Functions {
    new_device: unsafe extern "C" fn(*const c_char) -> Pointer,
    release_device: unsafe extern "C" fn(Pointer),
    device_error: unsafe extern "C" fn(Pointer) -> i32,
    device_property: unsafe extern "C" fn(Pointer, i32) -> isize,
    set_memory_monitor: unsafe extern "C" fn(Pointer, extern "C" fn(Pointer, isize, bool) -> bool, Pointer),
    new_scene: unsafe extern "C" fn(Pointer) -> Pointer,
    release_scene: unsafe extern "C" fn(Pointer),
    set_quality: unsafe extern "C" fn(Pointer, i32),
    set_flags: unsafe extern "C" fn(Pointer, i32),
    new_geometry: unsafe extern "C" fn(Pointer, i32) -> Pointer,
    release_geometry: unsafe extern "C" fn(Pointer),
    share_buffer: unsafe extern "C" fn(Pointer, i32, u32, i32, *const c_void, usize, usize, usize),
    commit_geometry: unsafe extern "C" fn(Pointer),
    attach: unsafe extern "C" fn(Pointer, Pointer) -> u32,
    commit_scene: unsafe extern "C" fn(Pointer),
    intersect1: unsafe extern "C" fn(Pointer, *mut Context, *mut RayHit1),
    intersect8: Packets<RayHitN<8>>,
    intersect16: Packets<RayHitN<16>>,
    occluded1: unsafe extern "C" fn(Pointer, *mut Context, *mut Ray1),
    occluded8: Packets<RayN<8>>,
    occluded16: Packets<RayN<16>>,
}

impl Functions {
    fn load() -> Result<Self, String> {
        // SAFETY: Embree's initializers do nothing but register themselves.
        let library = NAMES.iter().find_map(|name| unsafe { Library::new(name) }.ok());
        let library = library.ok_or(format!("Embree 3 isn't installed; on Debian: {INSTALL}"))?;
        let library = Box::leak(Box::new(library));
        macro_rules! symbol {
            ($name:literal) => {
                // SAFETY: the field that takes the function has its type in Embree 3's documentation.
                *unsafe { library.get($name) }.map_err(|e| format!("Embree lacks a function: {e}"))?
            };
        }
        Ok(Self {
            new_device: symbol!(b"rtcNewDevice\0"),
            release_device: symbol!(b"rtcReleaseDevice\0"),
            device_error: symbol!(b"rtcGetDeviceError\0"),
            device_property: symbol!(b"rtcGetDeviceProperty\0"),
            set_memory_monitor: symbol!(b"rtcSetDeviceMemoryMonitorFunction\0"),
            new_scene: symbol!(b"rtcNewScene\0"),
            release_scene: symbol!(b"rtcReleaseScene\0"),
            set_quality: symbol!(b"rtcSetSceneBuildQuality\0"),
            set_flags: symbol!(b"rtcSetSceneFlags\0"),
            new_geometry: symbol!(b"rtcNewGeometry\0"),
            release_geometry: symbol!(b"rtcReleaseGeometry\0"),
            share_buffer: symbol!(b"rtcSetSharedGeometryBuffer\0"),
            commit_geometry: symbol!(b"rtcCommitGeometry\0"),
            attach: symbol!(b"rtcAttachGeometry\0"),
            commit_scene: symbol!(b"rtcCommitScene\0"),
            intersect1: symbol!(b"rtcIntersect1\0"),
            intersect8: symbol!(b"rtcIntersect8\0"),
            intersect16: symbol!(b"rtcIntersect16\0"),
            occluded1: symbol!(b"rtcOccluded1\0"),
            occluded8: symbol!(b"rtcOccluded8\0"),
            occluded16: symbol!(b"rtcOccluded16\0"),
        })
    }
}

/// The allocations of a device in bytes.
#[derive(Default)]
struct Memory {
    now: AtomicIsize,
    peak: AtomicIsize,
}

extern "C" fn monitor(memory: Pointer, bytes: isize, _post: bool) -> bool {
    // SAFETY: the pointer was given to Embree below and refers to a box that outlives the device.
    let memory = unsafe { &*memory.cast::<Memory>() };
    let now = memory.now.fetch_add(bytes, Ordering::Relaxed) + bytes;
    memory.peak.fetch_max(now, Ordering::Relaxed);
    true
}

/// A device of the library, with a number of threads for building.
pub struct Embree {
    functions: Functions,
    device: Pointer,
    memory: Box<Memory>,
}

// SAFETY: any number of threads may use Embree's devices.
unsafe impl Send for Embree {}
// SAFETY: as above.
unsafe impl Sync for Embree {}

impl Embree {
    /// Loads the library. If Canaletto's instructions are [limited](InstructionSet::limit), Embree's are limited
    /// likewise. If the library isn't installed, the error names the command that installs it.
    pub fn new(threads: usize) -> Result<Self, String> {
        let functions = Functions::load()?;
        let limit = match InstructionSet::current() {
            // Embree may have kernels for instruction sets between those of Canaletto.
            set if InstructionSet::available().last() == Some(&set) => "",
            InstructionSet::Baseline => ",max_isa=sse2",
            InstructionSet::Avx2 | InstructionSet::Avx512 => ",max_isa=avx2",
        };
        let config = CString::new(format!("threads={threads}{limit}")).map_err(|e| e.to_string())?;
        // SAFETY: the string ends in 0.
        let device = unsafe { (functions.new_device)(config.as_ptr()) };
        if device.is_null() {
            return Err("Embree makes no device on this machine".into());
        }
        let memory = Box::<Memory>::default();
        // SAFETY: the box lives until the device is released.
        unsafe { (functions.set_memory_monitor)(device, monitor, std::ptr::from_ref(&*memory).cast_mut().cast()) };
        Ok(Self { functions, device, memory })
    }

    /// The version of the library.
    pub fn version(&self) -> String {
        // SAFETY: the device is valid; 1 to 3 are the parts of the version.
        let part = |i| unsafe { (self.functions.device_property)(self.device, i) };
        format!("{}.{}.{}", part(1), part(2), part(3))
    }

    /// Builds a scene over parts. The ids of each part's primitives follow those of the parts before it.
    pub fn build<'a>(&'a self, parts: &'a [Part], settings: Settings) -> Result<Scene<'a>, String> {
        let f = &self.functions;
        let before = self.memory.now.load(Ordering::Relaxed);
        self.memory.peak.store(before, Ordering::Relaxed);
        let flags = i32::from(settings.compact) << 1 | i32::from(settings.robust) << 2;
        // SAFETY: the device is valid.
        let scene = unsafe {
            let scene = (f.new_scene)(self.device);
            (f.set_quality)(scene, settings.quality as i32);
            (f.set_flags)(scene, flags);
            scene
        };
        let mut bases = vec![0];
        for part in parts {
            let kind = match part {
                Part::Triangles { .. } => TRIANGLES,
                Part::Spheres(_) => SPHERES,
                Part::Cylinders { .. } => CONES,
            };
            // SAFETY: each buffer has the stated length and is borrowed for the scene's life. Where Embree reads 16
            // bytes of a last element of 12, one more element follows it.
            unsafe {
                let geometry = (f.new_geometry)(self.device, kind);
                let share = |buffer, format, pointer: *const c_void, stride, count| {
                    (f.share_buffer)(geometry, buffer, 0, format, pointer, 0, stride, count);
                };
                match part {
                    Part::Triangles { positions, triangles } => {
                        share(BUFFER_VERTEX, FORMAT_FLOAT3, positions.as_ptr().cast(), 12, positions.len() - 1);
                        share(BUFFER_INDEX, FORMAT_UINT3, triangles.as_ptr().cast(), 12, triangles.len());
                    }
                    Part::Spheres(spheres) => {
                        share(BUFFER_VERTEX, FORMAT_FLOAT4, spheres.as_ptr().cast(), 16, spheres.len());
                    }
                    Part::Cylinders { ends, firsts } => {
                        share(BUFFER_VERTEX, FORMAT_FLOAT4, ends.as_ptr().cast(), 16, ends.len());
                        share(BUFFER_INDEX, FORMAT_UINT, firsts.as_ptr().cast(), 4, firsts.len());
                    }
                }
                (f.commit_geometry)(geometry);
                (f.attach)(scene, geometry);
                (f.release_geometry)(geometry);
            }
            bases.push(bases[bases.len() - 1] + part.len() as u32);
        }
        // SAFETY: the scene is valid and all its geometries are committed.
        unsafe { (f.commit_scene)(scene) };
        let bytes = self.memory.now.load(Ordering::Relaxed) - before;
        let peak = self.memory.peak.load(Ordering::Relaxed) - before;
        let scene = Scene { embree: self, scene, bases, bytes: bytes.max(0) as usize, peak: peak.max(0) as usize };
        // SAFETY: the device is valid.
        match unsafe { (f.device_error)(self.device) } {
            0 => Ok(scene),
            code => Err(format!("Embree reports error {code}")),
        }
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        // SAFETY: scenes borrow the device, so none is left.
        unsafe { (self.functions.release_device)(self.device) }
    }
}

/// Primitives of one kind in Embree's layout.
pub enum Part {
    /// A triangle mesh.
    Triangles {
        /// The vertices, and one more for padding.
        positions: Vec<[f32; 3]>,
        /// The vertex indices of each triangle.
        triangles: Vec<[u32; 3]>,
    },
    /// Spheres: centre and radius.
    Spheres(Vec<[f32; 4]>),
    /// Cylinders with closed ends.
    Cylinders {
        /// The ends of all axes, each with its radius.
        ends: Vec<[f32; 4]>,
        /// The index of the first end of each cylinder; the other one follows.
        firsts: Vec<u32>,
    },
}

impl Part {
    /// A triangle mesh from its vertices and indices.
    pub fn triangles(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let mut copy: Vec<[f32; 3]> = Vec::with_capacity(positions.len() + 1);
        copy.extend(positions.iter().map(|p| p.to_array()));
        copy.push([0.0; 3]);
        Self::Triangles { positions: copy, triangles: triangles.to_vec() }
    }

    /// Cylinders from their axes and radii.
    pub fn cylinders(all: impl Iterator<Item = ([Vec3; 2], f32)>) -> Self {
        let ends: Vec<[f32; 4]> = all.flat_map(|(axis, r)| axis.map(|p| p.extend(r).to_array())).collect();
        let firsts = (0..ends.len() as u32).step_by(2).collect();
        Self::Cylinders { ends, firsts }
    }

    pub(super) fn len(&self) -> usize {
        match self {
            Self::Triangles { triangles, .. } => triangles.len(),
            Self::Spheres(spheres) => spheres.len(),
            Self::Cylinders { firsts, .. } => firsts.len(),
        }
    }
}

/// A scene in Embree.
pub struct Scene<'a> {
    embree: &'a Embree,
    scene: Pointer,
    /// The id of each part's first primitive, and the number of all primitives.
    bases: Vec<u32>,
    /// The bytes that Embree allocated for the scene and kept, without the shared buffers.
    pub bytes: usize,
    /// The peak of Embree's allocations during the build, in bytes.
    pub peak: usize,
}

// SAFETY: any number of threads may trace rays through a committed scene.
unsafe impl Send for Scene<'_> {}
// SAFETY: as above.
unsafe impl Sync for Scene<'_> {}

impl Drop for Scene<'_> {
    fn drop(&mut self) {
        // SAFETY: the scene is released once.
        unsafe { (self.embree.functions.release_scene)(self.scene) }
    }
}

/// The hit of a ray.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// The ray's parameter.
    pub t: f32,
    /// The primitive's id, counted over all parts.
    pub id: u32,
    /// The geometric normal, of any length.
    pub normal: Vec3,
}

impl Scene<'_> {
    /// The id of a primitive, counted over all parts; without a hit, `u32::MAX`.
    #[inline]
    fn number(&self, geometry: u32, primitive: u32) -> u32 {
        if self.bases.len() == 2 || primitive == INVALID {
            primitive
        } else {
            self.bases[geometry as usize] + primitive
        }
    }

    #[inline]
    fn intersect(&self, segment: &Segment, context: &mut Context) -> RayHit1 {
        let hit = Hit1 { normal: [0.0; 3], u: 0.0, v: 0.0, primitive: INVALID, geometry: INVALID, instance: INVALID };
        let mut both = RayHit1 { ray: single(segment), hit };
        // SAFETY: the scene is committed, and the ray has the declared layout.
        unsafe { (self.embree.functions.intersect1)(self.scene, context, &raw mut both) };
        both
    }

    #[inline]
    fn meets(&self, segment: &Segment, context: &mut Context) -> bool {
        let mut ray = single(segment);
        // SAFETY: the scene is committed, and the ray has the declared layout.
        unsafe { (self.embree.functions.occluded1)(self.scene, context, &raw mut ray) };
        ray.far < 0.0
    }

    /// The closest hit of one ray.
    pub fn nearest(&self, segment: &Segment) -> Option<Found> {
        let RayHit1 { ray, hit } = self.intersect(segment, &mut context(false));
        let id = self.number(hit.geometry, hit.primitive);
        (id != INVALID).then_some(Found { t: ray.far, id, normal: hit.normal.into() })
    }

    /// Whether one ray hits anything.
    pub fn occluded(&self, segment: &Segment) -> bool {
        self.meets(segment, &mut context(false))
    }
}

/// Traces rays one by one.
pub struct Single<'a>(pub &'a Scene<'a>);
/// Traces rays in packets of eight.
pub struct Eights<'a>(pub &'a Scene<'a>);
/// Traces rays in packets of sixteen.
pub struct Sixteens<'a>(pub &'a Scene<'a>);

fn context(coherent: bool) -> Context {
    Context { flags: if coherent { COHERENT } else { 0 }, filter: None, instance: [INVALID] }
}

fn single(segment: &Segment) -> Ray1 {
    let (origin, direction) = (segment.origin.to_array(), segment.direction.to_array());
    Ray1 { origin, near: 0.0, direction, time: 0.0, far: segment.t_max, mask: u32::MAX, id: 0, flags: 0 }
}

impl Tracer for Single<'_> {
    fn closest(&self, Run { rays, coherent, .. }: Run<'_>, out: &mut Hits<'_>) {
        let mut context = context(coherent);
        for (i, segment) in rays.iter().enumerate() {
            let RayHit1 { ray, hit } = self.0.intersect(segment, &mut context);
            (out.t[i], out.u[i], out.v[i]) = (ray.far, hit.u, hit.v);
            out.id[i] = self.0.number(hit.geometry, hit.primitive);
        }
    }

    fn any(&self, Run { rays, coherent, .. }: Run<'_>, out: &mut [u8]) {
        let mut context = context(coherent);
        for (segment, out) in rays.iter().zip(out) {
            *out = u8::from(self.0.meets(segment, &mut context));
        }
    }
}

/// `N` rays of a packet of sixteen, from lane `first`.
#[inline]
fn several<const N: usize>(packet: &Packet, first: usize) -> RayN<N> {
    let row = |i: usize| -> [f32; N] {
        let mut row = [0.0; N];
        row.copy_from_slice(&packet.0[i][first..first + N]);
        row
    };
    RayN {
        origin: [row(0), row(1), row(2)],
        near: [0.0; N],
        direction: [row(3), row(4), row(5)],
        time: [0.0; N],
        far: row(6),
        mask: [u32::MAX; N],
        id: [0; N],
        flags: [0; N],
    }
}

fn closest<const N: usize>(
    scene: &Scene<'_>,
    trace: Packets<RayHitN<N>>,
    Run { packets, coherent, .. }: Run<'_>,
    out: &mut Hits<'_>,
) {
    let (valid, mut context) = (Valid([-1; N]), context(coherent));
    let len = out.t.len();
    for first in (0..len).step_by(N) {
        let mut both = RayHitN {
            ray: several(&packets[first / 16], first % 16),
            normal: [[0.0; N]; 3],
            u: [0.0; N],
            v: [0.0; N],
            primitive: [INVALID; N],
            geometry: [INVALID; N],
            instance: [INVALID; N],
        };
        // SAFETY: the scene is committed, and the rays have the declared layout and alignment.
        unsafe { trace(valid.0.as_ptr(), scene.scene, &raw mut context, &raw mut both) };
        let n = N.min(len - first);
        out.t[first..first + n].copy_from_slice(&both.ray.far[..n]);
        out.u[first..first + n].copy_from_slice(&both.u[..n]);
        out.v[first..first + n].copy_from_slice(&both.v[..n]);
        for (lane, out) in out.id[first..first + n].iter_mut().enumerate() {
            *out = scene.number(both.geometry[lane], both.primitive[lane]);
        }
    }
}

fn any<const N: usize>(
    scene: &Scene<'_>,
    trace: Packets<RayN<N>>,
    Run { packets, coherent, .. }: Run<'_>,
    out: &mut [u8],
) {
    let (valid, mut context) = (Valid([-1; N]), context(coherent));
    for (i, out) in out.chunks_mut(N).enumerate() {
        let first = i * N;
        let mut rays = several(&packets[first / 16], first % 16);
        // SAFETY: the scene is committed, and the rays have the declared layout and alignment.
        unsafe { trace(valid.0.as_ptr(), scene.scene, &raw mut context, &raw mut rays) };
        for (out, far) in out.iter_mut().zip(rays.far) {
            *out = u8::from(far < 0.0);
        }
    }
}

impl Tracer for Eights<'_> {
    fn closest(&self, run: Run<'_>, out: &mut Hits<'_>) {
        closest::<8>(self.0, self.0.embree.functions.intersect8, run, out);
    }

    fn any(&self, run: Run<'_>, out: &mut [u8]) {
        any::<8>(self.0, self.0.embree.functions.occluded8, run, out);
    }
}

impl Tracer for Sixteens<'_> {
    fn closest(&self, run: Run<'_>, out: &mut Hits<'_>) {
        closest::<16>(self.0, self.0.embree.functions.intersect16, run, out);
    }

    fn any(&self, run: Run<'_>, out: &mut [u8]) {
        any::<16>(self.0, self.0.embree.functions.occluded16, run, out);
    }
}
