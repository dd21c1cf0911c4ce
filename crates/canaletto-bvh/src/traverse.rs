//! Ways of rays through the tree.
//!
//! Nothing branches on how many children a ray meets: what it meets goes on its stack at once, the nearest on top. That
//! order is approximate (see `node`); where each child is entered is kept, and what a hit has cut off is forgotten.
#![allow(unsafe_code)] // Kernels compiled for instructions that are asked for at run time, and stacks that are not cleared.

use crate::build::MAX_DEPTH;
use crate::lanes::{Careful, InstructionSet, Lanes, Portable, Wide};
use crate::node::{Leaf, Link, Node};
use crate::slab::{WIDTH, limit as limit_of};
use crate::{PreparedRay, WideRay};
use std::hint::select_unpredictable;
use std::mem::MaybeUninit;

/// Each level takes one entry and leaves at most eight; a visit may write eight more beyond the last.
pub(crate) const STACK: usize = (MAX_DEPTH as usize + 1) * (WIDTH - 1) + 1 + WIDTH;

/// `a` unless `count` is 0, then `b`: without a branch, which the compiler would make of anything else that says so.
#[inline(always)]
fn choose(count: usize, a: Link, b: Link) -> Link {
    #[cfg(target_arch = "x86_64")]
    {
        let (mut chosen, other) = (a.bits(), b.bits());
        // SAFETY: numbers in, a number out.
        unsafe {
            std::arch::asm!("test {0}, {0}", "cmovz {1:e}, {2:e}", in(reg) count, inout(reg) chosen, in(reg) other,
                options(pure, nomem, nostack));
        }
        Link::from_bits(chosen)
    }
    #[cfg(not(target_arch = "x86_64"))]
    select_unpredictable(count == 0, b, a)
}

/// What waits to be visited, and where the ray enters it.
struct Stack {
    near: [MaybeUninit<f32>; STACK],
    links: [MaybeUninit<Link>; STACK],
    len: usize,
}

impl Stack {
    #[inline(always)]
    fn new() -> Stack {
        // Not `[MaybeUninit::uninit(); STACK]`, which the compiler fills with zeros.
        let mut stack = Stack {
            near: [const { MaybeUninit::uninit() }; STACK],
            links: [const { MaybeUninit::uninit() }; STACK],
            len: 0,
        };
        stack.clear();
        stack
    }

    /// Leaves nothing but [`Link::END`].
    #[inline(always)]
    fn clear(&mut self) {
        self.near[0].write(f32::NEG_INFINITY);
        self.links[0].write(Link::END);
        self.len = 1;
    }

    #[inline(always)]
    fn pop(&mut self) -> Link {
        self.len -= 1;
        // SAFETY: entries below `len` were written, and END, the lowest, is popped once.
        unsafe { self.links.get_unchecked(self.len).assume_init() }
    }

    /// Puts what the ray meets in a node on top. Returns how much it is, and the topmost, if there is one.
    ///
    /// # Safety
    /// As for [`Lanes`]; the node must be one of the tree that the stack was made for.
    #[inline(always)]
    unsafe fn push<L: Lanes, const ORDERED: bool>(&mut self, node: &Node, ray: &L::Ray, limit: f32) -> (usize, Link) {
        debug_assert!(self.len > 0 && self.len + WIDTH <= STACK);
        // SAFETY: no tree is deeper than MAX_DEPTH, so that there is always room for eight.
        unsafe {
            let near = self.near.as_mut_ptr().add(self.len).cast();
            let links = self.links.as_mut_ptr().add(self.len).cast();
            let (count, nearest) = L::visit::<ORDERED>(node, ray, limit, near, links);
            self.len += count;
            (count, nearest)
        }
    }

    /// Visits a node. Returns what to visit next, chosen by a branch: the next visit then starts before this one has ended, if the processor guesses
    /// well.
    ///
    /// # Safety
    /// As for [`Stack::push`].
    #[inline(always)]
    unsafe fn visit<L: Lanes, const ORDERED: bool>(&mut self, node: &Node, ray: &L::Ray, limit: f32) -> Link {
        // SAFETY: the caller's promise.
        match unsafe { self.push::<L, ORDERED>(node, ray, limit) } {
            (0, _) => self.pop(),
            (_, nearest) => {
                self.len -= 1;
                nearest
            }
        }
    }

    /// The same without a branch: a wrong guess would undo visits of other rays.
    ///
    /// # Safety
    /// As for [`Stack::push`].
    #[inline(always)]
    unsafe fn visit_without_branch<L: Lanes, const ORDERED: bool>(
        &mut self,
        node: &Node,
        ray: &L::Ray,
        limit: f32,
    ) -> Link {
        // SAFETY: the caller's promise; entries below `len` were written.
        unsafe {
            let before = self.links.get_unchecked(self.len - 1).assume_init();
            let (count, nearest) = self.push::<L, ORDERED>(node, ray, limit);
            self.len -= 1;
            choose(count, nearest, before)
        }
    }

    /// Forgets what is entered beyond `limit`, but for the lowest entry.
    #[inline(always)]
    fn cull(&mut self, limit: f32) {
        let mut kept = 1;
        for i in 1..self.len {
            // SAFETY: entries below `len` were written, and `kept` ≤ i.
            unsafe {
                let near = self.near.get_unchecked(i).assume_init();
                *self.near.get_unchecked_mut(kept) = MaybeUninit::new(near);
                *self.links.get_unchecked_mut(kept) = *self.links.get_unchecked(i);
                kept += usize::from(near <= limit);
            }
        }
        self.len = kept;
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

/// The same for many rays. A leaf is tested in two steps, so that what depends on a rough test's outcome is done apart, for all rays for which
/// something is left to do.
pub(crate) trait ClosestOfMany {
    /// What the first step finds.
    type Finding: Copy;
    /// Whether it counts what is nearest.
    const NEAREST: bool = true;
    /// Tells whether anything in a leaf may be hit by the ray of this number before `t_max`.
    fn test(&self, ray: usize, leaf: Leaf, t_max: f32) -> (bool, Self::Finding);
    /// Completes the test, and lowers `t_max` to the nearest hit; to −∞ if the ray's way ends here.
    fn leaf(&mut self, ray: usize, leaf: Leaf, finding: &Self::Finding, t_max: &mut f32);
    /// Where the leaves' data lie, to be fetched in advance: the first's start, and how many bytes each has.
    fn places(&self) -> Option<(*const u8, usize)> {
        None
    }
}

impl<F: FnMut(usize, Leaf, &mut f32)> ClosestOfMany for F {
    type Finding = ();

    #[inline(always)]
    fn test(&self, _ray: usize, _leaf: Leaf, _t_max: f32) -> (bool, ()) {
        (true, ())
    }

    #[inline(always)]
    fn leaf(&mut self, ray: usize, leaf: Leaf, _finding: &(), t_max: &mut f32) {
        self(ray, leaf, t_max);
    }
}

/// [`crate::Bvh::intersect`]. Returns what `t_max` is in the end.
#[inline]
pub(crate) fn closest(nodes: &[Node], ray: &PreparedRay, t_max: f32, leaf: impl Closest) -> f32 {
    dispatch!(ray.regular, closest_with(nodes, ray, t_max, leaf), closest_avx2, closest_avx512)
}

#[inline(always)]
unsafe fn closest_with<L: Lanes, F: Closest>(nodes: &[Node], ray: &L::Ray, mut t_max: f32, mut leaf: F) -> f32 {
    if nodes.is_empty() {
        return t_max;
    }
    let mut stack = Stack::new();
    let mut limit = limit_of(t_max);
    let mut link = Link::node(0);
    // SAFETY: the caller's promise; links lead to nodes.
    unsafe {
        loop {
            while !link.is_leaf() {
                link = stack.visit::<L, true>(nodes.get_unchecked(link.index()), ray, limit);
            }
            if link == Link::END {
                return t_max;
            }
            let before = t_max;
            leaf.leaf(link.leaf(), &mut t_max);
            if t_max < before {
                limit = limit_of(t_max);
                stack.cull(limit);
            }
            link = stack.pop();
        }
    }
}

/// [`crate::Bvh::occluded`].
#[inline]
pub(crate) fn any(nodes: &[Node], ray: &PreparedRay, t_max: f32, leaf: impl Any) -> bool {
    dispatch!(ray.regular, any_with(nodes, ray, t_max, leaf), any_avx2, any_avx512)
}

#[inline(always)]
unsafe fn any_with<L: Lanes, F: Any>(nodes: &[Node], ray: &L::Ray, t_max: f32, mut leaf: F) -> bool {
    if nodes.is_empty() {
        return false;
    }
    let mut stack = Stack::new();
    let limit = limit_of(t_max);
    let mut link = Link::node(0);
    // SAFETY: the caller's promise; links lead to nodes.
    unsafe {
        loop {
            while !link.is_leaf() {
                link = stack.visit::<L, false>(nodes.get_unchecked(link.index()), ray, limit);
            }
            if link == Link::END {
                return false;
            }
            if leaf.leaf(link.leaf()) {
                return true;
            }
            link = stack.pop();
        }
    }
}

/// [`closest`] for a ray with a margin. Not inlined, for callers that call themselves: the stack is large.
#[inline(never)]
pub(crate) fn closest_wide(nodes: &[Node], ray: &WideRay, t_max: f32, leaf: impl Closest) -> f32 {
    dispatch!(ray.ray.regular, closest_with_margin(nodes, ray, t_max, leaf), closest_wide_avx2, closest_wide_avx512)
}

#[inline(always)]
unsafe fn closest_with_margin<L: Lanes, F: Closest>(nodes: &[Node], ray: &WideRay, t_max: f32, leaf: F) -> f32
where
    Wide<L>: Lanes<Ray = WideRay>,
{
    // SAFETY: the caller's promise.
    unsafe { closest_with::<Wide<L>, F>(nodes, ray, t_max, leaf) }
}

/// [`any`] for a ray with a margin.
#[inline(never)]
pub(crate) fn any_wide(nodes: &[Node], ray: &WideRay, t_max: f32, leaf: impl Any) -> bool {
    dispatch!(ray.ray.regular, any_with_margin(nodes, ray, t_max, leaf), any_wide_avx2, any_wide_avx512)
}

#[inline(always)]
unsafe fn any_with_margin<L: Lanes, F: Any>(nodes: &[Node], ray: &WideRay, t_max: f32, leaf: F) -> bool
where
    Wide<L>: Lanes<Ray = WideRay>,
{
    // SAFETY: the caller's promise.
    unsafe { any_with::<Wide<L>, F>(nodes, ray, t_max, leaf) }
}

/// How many rays of a stream are on their way at once.
const FLIGHTS: usize = 32;

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
            if ray.regular {
                return Some(self.next - 1);
            }
        }
        None
    }
}

/// A ray on its way. Its stack's lowest entry is [`Link::END`].
struct Flight {
    ray: usize,
    limit: f32,
    /// Where it is.
    link: Link,
    stack: Stack,
}

impl Flight {
    /// # Safety
    /// `flight` must point to memory for a flight.
    #[inline(always)]
    unsafe fn start(flight: *mut Flight, ray: usize, t_max: f32) {
        // SAFETY: the caller's promise; a stack needs nothing but its length and lowest entry.
        unsafe {
            (*flight).ray = ray;
            (*flight).limit = limit_of(t_max);
            (*flight).link = Link::node(0);
            (*flight).stack.clear();
        }
    }
}

/// What flights do next: a bit for each. In registers, not in lists in memory: where a list's next entry goes is known late, and all that is
/// read from memory later would have to wait until then.
#[derive(Clone, Copy)]
struct Queues {
    nodes: u32,
    leaves: u32,
    ended: u32,
}

/// Takes the lowest flight from a queue.
#[inline(always)]
fn next(queue: &mut u32) -> Option<usize> {
    if *queue == 0 {
        return None;
    }
    let number = queue.trailing_zeros() as usize;
    *queue &= *queue - 1;
    Some(number)
}

/// Where nodes and the data of leaves lie, to be fetched in advance.
#[derive(Clone, Copy)]
struct Places {
    node: *const u8,
    leaf: *const u8,
    /// Of a leaf's data.
    bytes: usize,
}

impl Places {
    #[inline(always)]
    fn fetch(self, link: Link) {
        #[cfg(target_arch = "x86_64")]
        {
            let node = self.node.wrapping_add(link.index() * size_of::<Node>());
            let leaf = self.leaf.wrapping_add(link.index() * self.bytes);
            let start = select_unpredictable(link.is_leaf(), leaf, node);
            let start = select_unpredictable(link == Link::END, self.node, start);
            for line in 0..4 {
                // SAFETY: every x86-64 has SSE; a prefetch of any address is harmless.
                unsafe {
                    std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(
                        start.wrapping_add(64 * line).cast(),
                    );
                }
            }
        }
    }
}

impl Queues {
    /// Sends a flight to its next place, and tells the caches.
    #[inline(always)]
    fn send(&mut self, number: usize, flight: &mut Flight, link: Link, places: Places) {
        flight.link = link;
        let (bit, leaf, end) = (1 << number, u32::from(link.is_leaf()), u32::from(link == Link::END));
        // Without branches, since nobody could foretell them.
        self.nodes |= bit & leaf.wrapping_sub(1);
        self.leaves |= bit & (leaf ^ end).wrapping_neg();
        self.ended |= bit & end.wrapping_neg();
        places.fetch(link);
    }
}

/// [`closest`] for many rays that need not go the same way. Several are on their way at once. In each round all that are at nodes visit
/// these, then all that are at leaves test these: nothing branches on where a single ray goes, so that the processor works on
/// several visits at once and waits neither for memory nor for branches that it guessed wrong.
#[inline]
pub(crate) fn closest_of_many<F: ClosestOfMany>(nodes: &[Node], rays: &[PreparedRay], t_max: &mut [f32], mut leaf: F) {
    assert_eq!(rays.len(), t_max.len());
    for (index, ray) in rays.iter().enumerate().filter(|(_, ray)| !ray.regular) {
        t_max[index] = closest(nodes, ray, t_max[index], |slots: Leaf, limit: &mut f32| {
            if let (true, finding) = leaf.test(index, slots, *limit) {
                leaf.leaf(index, slots, &finding, limit);
            }
        });
    }
    dispatch!(true, stream_with(nodes, rays, t_max, leaf), stream_avx2, stream_avx512)
}

#[inline(always)]
unsafe fn stream_with<L: Lanes<Ray = PreparedRay>, F: ClosestOfMany>(
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
    let mut findings: [MaybeUninit<F::Finding>; FLIGHTS] = [const { MaybeUninit::uninit() }; FLIGHTS];
    let (leaf_start, bytes) = leaf.places().unwrap_or((nodes.as_ptr().cast(), 0));
    let places = Places { node: nodes.as_ptr().cast(), leaf: leaf_start, bytes };
    let mut queues = Queues { nodes: 0, leaves: 0, ended: u32::MAX >> (32 - FLIGHTS) };
    // SAFETY: the caller's promise; links lead to nodes; flights in queues of nodes and leaves were started, and their rays exist.
    unsafe {
        macro_rules! flight {
            ($number:expr) => {
                &mut *flights.get_unchecked_mut($number).as_mut_ptr()
            };
        }
        loop {
            let mut free = std::mem::take(&mut queues.ended);
            while let Some(number) = next(&mut free) {
                let Some(ray) = waiting.next() else { break };
                Flight::start(flights.get_unchecked_mut(number).as_mut_ptr(), ray, t_max[ray]);
                queues.nodes |= 1 << number;
            }
            if queues.nodes | queues.leaves == 0 {
                break;
            }
            let mut visiting = std::mem::take(&mut queues.nodes);
            while let Some(number) = next(&mut visiting) {
                let flight = flight!(number);
                let (node, ray) = (nodes.get_unchecked(flight.link.index()), rays.get_unchecked(flight.ray));
                let link = if F::NEAREST {
                    flight.stack.visit_without_branch::<L, true>(node, ray, flight.limit)
                } else {
                    flight.stack.visit_without_branch::<L, false>(node, ray, flight.limit)
                };
                queues.send(number, flight, link, places);
            }
            let tested = std::mem::take(&mut queues.leaves);
            let mut hopeful = 0;
            let mut testing = tested;
            while let Some(number) = next(&mut testing) {
                let flight = flight!(number);
                let (hope, finding) = leaf.test(flight.ray, flight.link.leaf(), *t_max.get_unchecked(flight.ray));
                findings.get_unchecked_mut(number).write(finding);
                hopeful |= u32::from(hope) << number;
            }
            while let Some(number) = next(&mut hopeful) {
                let flight = flight!(number);
                let t_max = t_max.get_unchecked_mut(flight.ray);
                let before = *t_max;
                leaf.leaf(flight.ray, flight.link.leaf(), findings.get_unchecked(number).assume_init_ref(), t_max);
                if *t_max < before {
                    flight.limit = limit_of(*t_max);
                    flight.stack.cull(flight.limit);
                }
            }
            testing = tested;
            while let Some(number) = next(&mut testing) {
                let flight = flight!(number);
                let link = flight.stack.pop();
                queues.send(number, flight, link, places);
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::*;
    use crate::lanes::{Avx2, Avx512};

    macro_rules! kernels {
        ($features:literal, $lanes:ident, $closest:ident, $any:ident, $stream:ident, $closest_wide:ident, $any_wide:ident) => {
            #[target_feature(enable = $features)]
            pub(super) unsafe fn $closest<F: Closest>(nodes: &[Node], ray: &PreparedRay, t_max: f32, leaf: F) -> f32 {
                // SAFETY: the caller's promise.
                unsafe { closest_with::<$lanes, F>(nodes, ray, t_max, leaf) }
            }

            #[target_feature(enable = $features)]
            pub(super) unsafe fn $any<F: Any>(nodes: &[Node], ray: &PreparedRay, t_max: f32, leaf: F) -> bool {
                // SAFETY: the caller's promise.
                unsafe { any_with::<$lanes, F>(nodes, ray, t_max, leaf) }
            }

            #[target_feature(enable = $features)]
            pub(super) unsafe fn $closest_wide<F: Closest>(nodes: &[Node], ray: &WideRay, t_max: f32, leaf: F) -> f32 {
                // SAFETY: the caller's promise.
                unsafe { closest_with::<Wide<$lanes>, F>(nodes, ray, t_max, leaf) }
            }

            #[target_feature(enable = $features)]
            pub(super) unsafe fn $any_wide<F: Any>(nodes: &[Node], ray: &WideRay, t_max: f32, leaf: F) -> bool {
                // SAFETY: the caller's promise.
                unsafe { any_with::<Wide<$lanes>, F>(nodes, ray, t_max, leaf) }
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

    kernels!(
        "avx2,bmi1,bmi2,lzcnt,popcnt",
        Avx2,
        closest_avx2,
        any_avx2,
        stream_avx2,
        closest_wide_avx2,
        any_wide_avx2
    );
    kernels!(
        "avx2,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq",
        Avx512,
        closest_avx512,
        any_avx512,
        stream_avx512,
        closest_wide_avx512,
        any_wide_avx512
    );
}
#[cfg(target_arch = "x86_64")]
use x86::{
    any_avx2, any_avx512, any_wide_avx2, any_wide_avx512, closest_avx2, closest_avx512, closest_wide_avx2,
    closest_wide_avx512, stream_avx2, stream_avx512,
};
