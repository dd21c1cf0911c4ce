//! Stack space for recursive work, on threads whose stack may be small.

use std::cell::Cell;
use std::error::Error;
use std::sync::atomic::{AtomicBool, Ordering};

/// Runs `work` with at least `bytes` of stack. It runs on the current thread if this thread, and the pool that it
/// shares work with, have as much left. Otherwise it runs in a new pool of as many threads with larger stacks. All
/// threads of a pool are assumed to have stacks of one size. Where the size of stacks is unknown (on systems other than
/// Linux), `work` runs on the current thread.
///
/// # Panics
/// If `work` panics.
///
/// # Errors
/// [`NoThreads`] if threads are needed and can't be started. Then `work` hasn't begun.
pub fn with_stack<T: Send>(bytes: usize, work: impl FnOnce() -> T + Send) -> Result<T, NoThreads> {
    let Some(pool) = pool_with_stack(bytes)? else { return Ok(work()) };
    let (mut work, mut result) = (Some(work), None);
    let run: &mut (dyn FnMut() + Send) = &mut || result = work.take().map(|work| work());
    pool.install(run);
    result.ok_or(NoThreads { stack: bytes })
}

/// A pool whose threads have this much stack; none if this thread and its pool have it.
fn pool_with_stack(bytes: usize) -> Result<Option<rayon::ThreadPool>, NoThreads> {
    let refused = NoThreads { stack: bytes };
    let outside = rayon::current_thread_index().is_none();
    if outside && !has_global_pool() {
        return Err(refused);
    }
    if bytes_left() >= bytes && (!outside || rayon::join(bytes_left, || ()).0 >= bytes) {
        return Ok(None);
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(rayon::current_num_threads())
        .stack_size(bytes.saturating_add(OVERHEAD));
    pool.build().map(Some).map_err(|_| refused)
}

/// The system gives no threads with so much stack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("can't start threads with {stack} bytes of stack: the system gives no more threads or memory")]
pub struct NoThreads {
    /// The stack that each was to have, in bytes.
    pub stack: usize,
}

/// Whether there is a pool of threads for callers outside of all pools. Rayon itself panics where it can't start one.
fn has_global_pool() -> bool {
    static REFUSED: AtomicBool = AtomicBool::new(false);
    if REFUSED.load(Ordering::Relaxed) {
        return false;
    }
    // Of two mistakes only one has a cause: that the system refused. The other is that there is a pool already.
    let refused = rayon::ThreadPoolBuilder::new().build_global().is_err_and(|e| e.source().is_some());
    REFUSED.fetch_or(refused, Ordering::Relaxed);
    !refused
}

/// The stack that a thread uses before it comes to its work.
const OVERHEAD: usize = 64 << 10;

thread_local! {
    /// The end of this thread's stack, once it has been computed.
    static END: Cell<Option<usize>> = const { Cell::new(None) };
}

/// The number of bytes left on this thread's stack.
fn bytes_left() -> usize {
    let here = 0u8;
    let end = END.get().unwrap_or_else(|| {
        let end = stack_end();
        END.set(Some(end));
        end
    });
    (&raw const here).addr().saturating_sub(end)
}

/// The lowest address of this thread's stack, towards which it grows. 0 where it is unknown.
#[cfg(target_os = "linux")]
#[allow(unsafe_code)] // Calls of the system.
fn stack_end() -> usize {
    let mut attributes = std::mem::MaybeUninit::<libc::pthread_attr_t>::uninit();
    let (mut lowest, mut size) = (std::ptr::null_mut(), 0);
    // SAFETY: the first call writes the attributes unless it fails. Then they are read, and then destroyed.
    unsafe {
        if libc::pthread_getattr_np(libc::pthread_self(), attributes.as_mut_ptr()) != 0 {
            return 0;
        }
        let told = libc::pthread_attr_getstack(attributes.as_ptr(), &raw mut lowest, &raw mut size);
        libc::pthread_attr_destroy(attributes.as_mut_ptr());
        if told == 0 { lowest.addr() } else { 0 }
    }
}

#[cfg(not(target_os = "linux"))]
fn stack_end() -> usize {
    0
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use crate::testing::{Random, TestPrimitive, awkward_ray, zoo};
    use crate::{Bvh, PreparedRay, Primitive, PrimitiveBvh, PrimitiveHit, Quality, Ray, TriangleBvh};
    use glam::Vec3;

    /// The smallest stack of threads in practice.
    const SMALL: usize = 64 << 10;

    /// Runs the work on a thread with a small stack outside of all pools, and in pools of such threads.
    fn on_small_stacks(work: impl Fn() + Send + Sync) {
        std::thread::scope(|scope| {
            let thread = std::thread::Builder::new().stack_size(SMALL);
            thread.spawn_scoped(scope, &work).unwrap().join().unwrap();
        });
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).stack_size(SMALL).build().unwrap();
            pool.install(&work);
        }
    }

    #[test]
    fn what_is_left_is_told() {
        on_small_stacks(|| assert!((1 << 13..=SMALL).contains(&bytes_left()), "{}", bytes_left()));
        on_small_stacks(|| {
            with_stack(1 << 20, || {
                assert!(bytes_left() >= 1 << 20);
                rayon::join(|| assert!(bytes_left() >= 1 << 20), || assert!(bytes_left() >= 1 << 20));
                // There is enough stack, so that no new thread is started.
                let here = std::thread::current().id();
                with_stack(1 << 19, || assert_eq!(std::thread::current().id(), here)).unwrap();
            })
            .unwrap();
        });
    }

    #[test]
    fn threads_that_cannot_be_started_are_an_error() {
        for stack in [usize::MAX, 1 << 60] {
            let began = with_stack(stack, || unreachable!("there is no such stack"));
            assert_eq!(began, Err::<(), _>(NoThreads { stack }));
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        assert!(pool.install(|| with_stack(1 << 60, || ())).is_err());
        assert_eq!(with_stack(1 << 10, || 7), Ok(7));
    }

    #[test]
    fn trees_are_built_and_walked_on_small_stacks() {
        let random = &mut Random(91);
        let many: Vec<[Vec3; 3]> = (0..40_000)
            .map(|_| {
                let p = random.vector();
                [0; 3].map(|_| p + 0.01 * random.vector())
            })
            .collect();
        // Each triangle is far larger than all triangles before it together: the deepest tree.
        let chain: Vec<[Vec3; 3]> = (0..250)
            .map(|i| f32::from_bits((i + 2) << 23))
            .flat_map(|s| [[Vec3::splat(s), Vec3::new(1.1 * s, s, s), Vec3::new(s, 1.1 * s, s)]; 40])
            .collect();
        let spheres: Vec<TestPrimitive> = (0..9000).map(|_| TestPrimitive::Sphere(random.vector(), 0.02)).collect();
        let rays: Vec<Ray> = (0..500).map(|_| awkward_ray(&zoo()[6].1, random)).collect();
        on_small_stacks(|| {
            for corners in [&many, &chain] {
                for quality in [Quality::Medium, Quality::High] {
                    let mut tree = TriangleBvh::build_with(quality, corners.len(), |id| corners[id as usize]).unwrap();
                    for _ in 0..2 {
                        let (mut stream, mut packets) =
                            (vec![PrimitiveHit::none(9.0); rays.len()], vec![PrimitiveHit::none(9.0); rays.len()]);
                        tree.intersect_stream(&rays, &mut stream, false);
                        tree.intersect_coherent(&rays, &mut packets, false);
                        for (i, ray) in rays.iter().enumerate() {
                            let mut single = PrimitiveHit::none(9.0);
                            tree.intersect(&ray.prepare(), &mut single, false);
                            assert!(stream[i] == single && packets[i] == single);
                        }
                        tree.refit_within(1.1, |id| corners[corners.len() - 1 - id as usize]).unwrap();
                    }
                }
            }
            let bounds: Vec<_> = spheres.iter().map(TestPrimitive::bounds).collect();
            let tree = PrimitiveBvh::build(&bounds, |id| match spheres[id as usize] {
                TestPrimitive::Sphere(center, radius) => Primitive::Sphere { center, radius },
                TestPrimitive::Triangle(_) => Primitive::User,
            });
            let (tree, ask) = (tree.unwrap(), |_: crate::UserPrimitive, _: &PreparedRay, _: f32| None);
            let mut packets = vec![PrimitiveHit::none(9.0); rays.len()];
            tree.intersect_coherent(&rays, &mut packets, &ask);
            assert!(packets.iter().any(|met| met.id != PrimitiveHit::NONE));
            assert_eq!(Bvh::build(&bounds).unwrap().order().len(), spheres.len());
        });
    }
}
