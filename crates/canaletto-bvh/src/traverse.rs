//! Ways of rays through the tree.
//!
//! Nothing branches on how many children a ray meets: what it meets goes on its stack at once, the nearest on top. That
//! order is approximate (see `node`); where each child is entered is kept, and what a hit has cut off is skipped.
#![allow(unsafe_code)] // Kernels compiled for instructions that are asked for at run time, and stacks that are not cleared.

use crate::PreparedRay;
use crate::build::MAX_DEPTH;
use crate::lanes::{Careful, InstructionSet, Lanes, Portable};
use crate::node::{Leaf, Link, Node};
use crate::slab::{Slabs, WIDTH};
use std::mem::MaybeUninit;

/// Each level takes one entry and leaves at most eight; a visit may write eight more beyond the last.
pub(crate) const STACK: usize = (MAX_DEPTH as usize + 1) * (WIDTH - 1) + 1 + WIDTH;

/// What waits to be visited, and where the ray enters it.
struct Stack {
    near: [MaybeUninit<f32>; STACK],
    links: [MaybeUninit<Link>; STACK],
    len: usize,
}

impl Stack {
    #[inline(always)]
    fn at_root() -> Stack {
        // Not `[MaybeUninit::uninit(); STACK]`, which the compiler fills with zeros.
        let mut stack = Stack {
            near: [const { MaybeUninit::uninit() }; STACK],
            links: [const { MaybeUninit::uninit() }; STACK],
            len: 0,
        };
        stack.restart();
        stack
    }

    #[inline(always)]
    fn restart(&mut self) {
        self.near[0].write(0.0);
        self.links[0].write(Link::node(0));
        self.len = 1;
    }

    /// What to visit next, among what is entered before `limit`.
    #[inline(always)]
    fn pop(&mut self, limit: f32) -> Option<Link> {
        while self.len > 0 {
            self.len -= 1;
            // SAFETY: entries below `len` were written.
            unsafe {
                if self.near.get_unchecked(self.len).assume_init() <= limit {
                    return Some(self.links.get_unchecked(self.len).assume_init());
                }
            }
        }
        None
    }

    /// Puts what the ray meets in a node on top.
    ///
    /// # Safety
    /// As for [`Lanes`]; the node must be one of the tree that the stack was made for.
    #[inline(always)]
    unsafe fn push<L: Lanes>(&mut self, node: &Node, slabs: &Slabs, limit: f32) {
        debug_assert!(self.len + WIDTH <= STACK);
        // SAFETY: no tree is deeper than MAX_DEPTH, so that there is always room for eight.
        unsafe {
            let near = self.near.as_mut_ptr().add(self.len).cast();
            let links = self.links.as_mut_ptr().add(self.len).cast();
            self.len += L::visit(node, slabs, limit, near, links);
        }
    }

    /// Tells the caches what comes next.
    #[inline(always)]
    fn prefetch(&self, nodes: &[Node], leaves: Option<(*const u8, usize)>) {
        if self.len == 0 {
            return;
        }
        // SAFETY: entries below `len` were written; prefetching reads nothing.
        let link = unsafe { self.links.get_unchecked(self.len - 1).assume_init() };
        let (start, lines) = match (link.follow(), leaves) {
            (Err(node), _) => (nodes.as_ptr().wrapping_add(node).cast::<u8>(), 4),
            (Ok(leaf), Some((first, size))) => {
                (first.wrapping_add(leaf.first() as usize * size), size.div_ceil(64) + usize::from(size % 64 != 0))
            }
            _ => return,
        };
        #[cfg(target_arch = "x86_64")]
        for line in 0..lines {
            // SAFETY: every x86-64 has SSE; a prefetch of any address is harmless.
            unsafe {
                std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(
                    start.wrapping_add(64 * line).cast(),
                );
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        let _ = (start, lines);
    }
}

/// The kernel for the machine's instructions; `Careful` for rays that need it.
macro_rules! dispatch {
    ($regular:expr, $kernel:ident ( $($arg:expr),* ), $avx2:ident, $avx512:ident) => {
        // SAFETY: `current` never tells more than the machine has; `Portable` and `Careful` need nothing.
        unsafe {
            if !$regular {
                return $kernel::<Careful, _>($($arg),*);
            }
            match InstructionSet::current() {
                #[cfg(target_arch = "x86_64")]
                InstructionSet::Avx512 => $avx512($($arg),*),
                #[cfg(target_arch = "x86_64")]
                InstructionSet::Avx2 => $avx2($($arg),*),
                _ => $kernel::<Portable, _>($($arg),*),
            }
        }
    };
}

/// What is done at leaves. Unlike a closure it can be told to be inlined, so that it, too, is compiled for the instructions of its
/// caller.
pub(crate) trait Closest {
    /// Tests a leaf, and lowers `t_max` to the nearest hit.
    fn leaf(&mut self, leaf: Leaf, t_max: &mut f32);
}

impl<F: FnMut(Leaf, &mut f32)> Closest for F {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf, t_max: &mut f32) {
        self(leaf, t_max);
    }
}

/// The same for any hit.
pub(crate) trait Any {
    /// Whether something is hit in a leaf.
    fn leaf(&mut self, leaf: Leaf) -> bool;
}

impl<F: FnMut(Leaf) -> bool> Any for F {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf) -> bool {
        self(leaf)
    }
}

/// The same for many rays.
pub(crate) trait ClosestOfMany {
    /// Tests a leaf with the ray of this number, and lowers `t_max` to the nearest hit; to −∞ if the ray's way ends here.
    fn leaf(&mut self, ray: usize, leaf: Leaf, t_max: &mut f32);
    /// Where the leaves' data lie, to be fetched in advance: the first's start, and how many bytes each has.
    fn places(&self) -> Option<(*const u8, usize)> {
        None
    }
}

impl<F: FnMut(usize, Leaf, &mut f32)> ClosestOfMany for F {
    #[inline(always)]
    fn leaf(&mut self, ray: usize, leaf: Leaf, t_max: &mut f32) {
        self(ray, leaf, t_max);
    }
}

/// [`crate::Bvh::intersect`].
#[inline]
pub(crate) fn closest(nodes: &[Node], slabs: &Slabs, t_max: f32, leaf: impl Closest) {
    dispatch!(slabs.regular, closest_with(nodes, slabs, t_max, leaf), closest_avx2, closest_avx512)
}

#[inline(always)]
unsafe fn closest_with<L: Lanes, F: Closest>(nodes: &[Node], slabs: &Slabs, mut t_max: f32, mut leaf: F) {
    if nodes.is_empty() {
        return;
    }
    let mut stack = Stack::at_root();
    let mut limit = Slabs::limit(t_max);
    // SAFETY: the caller's promise; links lead to nodes.
    unsafe {
        while let Some(link) = stack.pop(limit) {
            match link.follow() {
                Err(node) => stack.push::<L>(nodes.get_unchecked(node), slabs, limit),
                Ok(slots) => {
                    leaf.leaf(slots, &mut t_max);
                    limit = Slabs::limit(t_max);
                }
            }
        }
    }
}

/// [`crate::Bvh::occluded`].
#[inline]
pub(crate) fn any(nodes: &[Node], slabs: &Slabs, t_max: f32, leaf: impl Any) -> bool {
    dispatch!(slabs.regular, any_with(nodes, slabs, t_max, leaf), any_avx2, any_avx512)
}

#[inline(always)]
unsafe fn any_with<L: Lanes, F: Any>(nodes: &[Node], slabs: &Slabs, t_max: f32, mut leaf: F) -> bool {
    if nodes.is_empty() {
        return false;
    }
    let mut stack = Stack::at_root();
    let limit = Slabs::limit(t_max);
    // SAFETY: the caller's promise; links lead to nodes.
    unsafe {
        while let Some(link) = stack.pop(f32::INFINITY) {
            match link.follow() {
                Err(node) => stack.push::<L>(nodes.get_unchecked(node), slabs, limit),
                Ok(slots) => {
                    if leaf.leaf(slots) {
                        return true;
                    }
                }
            }
        }
    }
    false
}

/// How many rays of a stream are on their way at once.
const FLIGHTS: usize = 8;

/// The rays that have not started; those that are not regular never do.
struct Waiting<'a> {
    rays: &'a [PreparedRay],
    next: usize,
}

impl Waiting<'_> {
    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        while let Some(ray) = self.rays.get(self.next) {
            self.next += 1;
            if ray.slabs.regular {
                return Some(self.next - 1);
            }
        }
        None
    }
}

/// A ray on its way.
struct Flight {
    ray: usize,
    limit: f32,
    stack: Stack,
}

impl Flight {
    #[inline(always)]
    fn start(&mut self, ray: usize, t_max: f32) {
        self.ray = ray;
        self.limit = Slabs::limit(t_max);
        self.stack.restart();
    }
}

/// [`closest`] for many rays that need not go the same way. Several are on their way at once, so that none waits for memory alone.
#[inline]
pub(crate) fn closest_of_many<F: ClosestOfMany>(nodes: &[Node], rays: &[PreparedRay], t_max: &mut [f32], mut leaf: F) {
    assert_eq!(rays.len(), t_max.len());
    for (index, ray) in rays.iter().enumerate().filter(|(_, ray)| !ray.slabs.regular) {
        let mut nearest = t_max[index];
        closest(nodes, &ray.slabs, nearest, |slots: Leaf, limit: &mut f32| {
            leaf.leaf(index, slots, limit);
            nearest = *limit;
        });
        t_max[index] = nearest;
    }
    dispatch!(true, stream_with(nodes, rays, t_max, leaf), stream_avx2, stream_avx512)
}

#[inline(always)]
unsafe fn stream_with<L: Lanes, F: ClosestOfMany>(
    nodes: &[Node],
    rays: &[PreparedRay],
    t_max: &mut [f32],
    mut leaf: F,
) {
    if nodes.is_empty() {
        return;
    }
    let mut waiting = Waiting { rays, next: 0 };
    let mut flights: [MaybeUninit<Flight>; FLIGHTS] = [const { MaybeUninit::uninit() }; FLIGHTS];
    let mut order: [usize; FLIGHTS] = std::array::from_fn(|i| i);
    let mut active = 0;
    // SAFETY: the caller's promise; links lead to nodes; flights below `active` in `order` were started.
    unsafe {
        while active < FLIGHTS {
            let Some(ray) = waiting.next() else { break };
            (*flights[active].as_mut_ptr()).start(ray, t_max[ray]);
            active += 1;
        }
        while active > 0 {
            let mut i = 0;
            while i < active {
                let flight = &mut *flights[order[i]].as_mut_ptr();
                let Some(link) = flight.stack.pop(flight.limit) else {
                    match waiting.next() {
                        Some(ray) => flight.start(ray, t_max[ray]),
                        None => {
                            active -= 1;
                            order.swap(i, active);
                        }
                    }
                    continue;
                };
                match link.follow() {
                    Err(node) => {
                        let slabs = &rays.get_unchecked(flight.ray).slabs;
                        flight.stack.push::<L>(nodes.get_unchecked(node), slabs, flight.limit);
                    }
                    Ok(slots) => {
                        let t_max = t_max.get_unchecked_mut(flight.ray);
                        leaf.leaf(flight.ray, slots, t_max);
                        flight.limit = Slabs::limit(*t_max);
                    }
                }
                flight.stack.prefetch(nodes, leaf.places());
                i += 1;
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::*;
    use crate::lanes::{Avx2, Avx512};

    macro_rules! kernels {
        ($features:literal, $lanes:ident, $closest:ident, $any:ident, $stream:ident) => {
            #[target_feature(enable = $features)]
            pub(super) unsafe fn $closest<F: Closest>(nodes: &[Node], slabs: &Slabs, t_max: f32, leaf: F) {
                // SAFETY: the caller's promise.
                unsafe { closest_with::<$lanes, F>(nodes, slabs, t_max, leaf) }
            }

            #[target_feature(enable = $features)]
            pub(super) unsafe fn $any<F: Any>(nodes: &[Node], slabs: &Slabs, t_max: f32, leaf: F) -> bool {
                // SAFETY: the caller's promise.
                unsafe { any_with::<$lanes, F>(nodes, slabs, t_max, leaf) }
            }

            #[target_feature(enable = $features)]
            pub(super) unsafe fn $stream<F: ClosestOfMany>(
                nodes: &[Node],
                rays: &[PreparedRay],
                t_max: &mut [f32],
                leaf: F,
            ) {
                // SAFETY: the caller's promise.
                unsafe { stream_with::<$lanes, F>(nodes, rays, t_max, leaf) }
            }
        };
    }

    kernels!("avx2,bmi1,bmi2,lzcnt,popcnt", Avx2, closest_avx2, any_avx2, stream_avx2);
    kernels!(
        "avx2,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq",
        Avx512,
        closest_avx512,
        any_avx512,
        stream_avx512
    );
}
#[cfg(target_arch = "x86_64")]
use x86::{any_avx2, any_avx512, closest_avx2, closest_avx512, stream_avx2, stream_avx512};
