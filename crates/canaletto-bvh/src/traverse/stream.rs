//! Many rays through the tree at once, which need not go the same way.
#![allow(unsafe_code)] // Memory that is not cleared, and kernels.

use std::cell::RefCell;
use std::hint::select_unpredictable;
use std::mem::MaybeUninit;

use super::single::closest;
use super::stack::Stack;
use crate::PreparedRay;
use crate::node::{Leaf, Node, NodeRef, PrefetchTable};
use crate::simd::dispatch::{self, Traversal};
use crate::simd::{Baseline, NodeTest};
use crate::slab::limit as limit_of;

/// A ray of a list.
#[derive(Clone, Copy)]
pub(crate) struct NumberedRay<'a> {
    pub(crate) number: usize,
    pub(crate) ray: &'a PreparedRay,
}

/// What is done at leaves for many rays. A leaf is tested in steps, each of which is done for all rays for which the one before has left something
/// to do.
pub(crate) trait StreamVisitor {
    /// What the first step finds.
    type Finding: Copy;
    /// Whether it counts what is nearest, or only that something is hit, after which `t_max` is −∞ and the ray's way ends.
    const NEAREST: bool = true;
    /// Tells whether anything in a leaf may be hit by a ray before `t_max`.
    fn test(&self, ray: NumberedRay<'_>, leaf: Leaf, t_max: f32) -> (bool, Self::Finding);
    /// Looks closer: which primitives may be hit, a bit for each. May lower `t_max` to −∞ where it counts only that something is hit.
    #[inline(always)]
    fn refine(&self, _ray: NumberedRay<'_>, _leaf: Leaf, _finding: &Self::Finding, _t_max: &mut f32) -> u32 {
        u32::MAX
    }
    /// Completes the test of these, and lowers `t_max` to the nearest hit.
    ///
    /// # Safety
    /// The machine must have the instructions of `E`.
    unsafe fn leaf<N: NodeTest>(
        &mut self,
        ray: NumberedRay<'_>,
        leaf: Leaf,
        finding: &Self::Finding,
        which: u32,
        t_max: &mut f32,
    );
    /// Where nodes and the leaves' data lie, to be fetched in advance.
    fn prefetch_table(&self, nodes: &[Node]) -> PrefetchTable {
        PrefetchTable::of_nodes(nodes)
    }
}

impl<F: FnMut(usize, Leaf, &mut f32)> StreamVisitor for F {
    type Finding = ();

    #[inline(always)]
    fn test(&self, _ray: NumberedRay<'_>, _leaf: Leaf, _t_max: f32) -> (bool, ()) {
        (true, ())
    }

    #[inline(always)]
    unsafe fn leaf<N: NodeTest>(
        &mut self,
        ray: NumberedRay<'_>,
        leaf: Leaf,
        _finding: &(),
        _which: u32,
        t_max: &mut f32,
    ) {
        self(ray.number, leaf, t_max);
    }
}

/// How many rays of a stream are on their way at once.
const STREAM_RAYS: usize = 32;

/// A ray on its way. Its stack's lowest entry is [`NodeRef::END`].
struct StreamRay<'a> {
    ray: NumberedRay<'a>,
    limit: f32,
    /// Where it is.
    link: NodeRef,
    stack: Stack,
}

impl<'a> StreamRay<'a> {
    /// # Safety
    /// `stream_ray` must point to memory for a stream_ray.
    #[inline(always)]
    unsafe fn start(stream_ray: *mut Self, ray: NumberedRay<'a>, t_max: f32) {
        // SAFETY: the caller's promise; a stack needs nothing but its length and lowest entry.
        unsafe {
            (*stream_ray).ray = ray;
            (*stream_ray).limit = limit_of(t_max);
            (*stream_ray).link = NodeRef::node(0);
            (*stream_ray).stack.clear();
        }
    }
}

/// Memory for in_flight, which nothing is known to be written in. Not on the stack, of which threads may have less, and kept for the next
/// rays of the thread.
struct StreamRays(Box<[MaybeUninit<StreamRay<'static>>; STREAM_RAYS]>);

thread_local! {
    /// Some, as a leaf may hold what asks about rays itself.
    static SPARE: RefCell<Vec<StreamRays>> = const { RefCell::new(Vec::new()) };
}

impl StreamRays {
    #[inline(never)]
    fn take() -> Self {
        let new = || {
            let memory: Box<MaybeUninit<[MaybeUninit<StreamRay<'static>>; STREAM_RAYS]>> = Box::new_uninit();
            // SAFETY: what may be unwritten needs nothing written.
            Self(unsafe { memory.assume_init() })
        };
        SPARE.with_borrow_mut(Vec::pop).unwrap_or_else(new)
    }

    fn give_back(self) {
        SPARE.with_borrow_mut(|spare| spare.push(self));
    }

    /// For in_flight of rays that live as long as that.
    #[inline(always)]
    fn for_rays<'a>(&mut self) -> &mut [MaybeUninit<StreamRay<'a>>; STREAM_RAYS] {
        // SAFETY: how long rays live changes nothing about memory, and nothing is taken for written that others wrote.
        unsafe { &mut *(&raw mut *self.0).cast() }
    }
}

/// What in_flight do next: a bit for each. In registers, not in lists in memory: where a list's next entry goes is known late, and all that is
/// read from memory later would have to wait until then.
#[derive(Clone, Copy)]
struct Queues {
    nodes: u32,
    leaves: u32,
    ended: u32,
}

/// Takes the lowest stream_ray from a queue.
#[inline(always)]
fn next(queue: &mut u32) -> Option<usize> {
    if *queue == 0 {
        return None;
    }
    let number = queue.trailing_zeros() as usize;
    *queue &= *queue - 1;
    Some(number)
}

impl Queues {
    /// Sends a stream_ray to its next place, and tells the caches. It goes to `leaves` also where it has ended: see [`Queues::part`].
    #[inline(always)]
    fn send(&mut self, number: usize, stream_ray: &mut StreamRay<'_>, link: NodeRef, places: PrefetchTable) {
        stream_ray.link = link;
        // Without branches, since nobody could foretell them.
        self.leaves |= u32::from(link.is_leaf()) << number;
        self.ended |= u32::from(link == NodeRef::END) << number;
        places.fetch(link);
    }

    /// Tells in_flight at nodes, leaves and ends apart, when these were sent.
    #[inline(always)]
    fn part(&mut self, sent: u32) {
        self.nodes |= sent & !self.leaves;
        self.leaves &= !self.ended;
    }
}

/// [`closest`] for many rays that need not go the same way. Several are on their way at once. In each round all that are at nodes visit
/// these, then all that are at leaves test these: nothing branches on where a single ray goes, so that the processor works on
/// several visits at once and waits neither for memory nor for branches that it guessed wrong.
#[inline]
pub(crate) fn trace_stream<F: StreamVisitor>(nodes: &[Node], rays: &[PreparedRay], t_max: &mut [f32], mut leaf: F) {
    assert_eq!(rays.len(), t_max.len());
    for (index, ray) in rays.iter().enumerate().filter(|(_, ray)| !ray.regular) {
        let numbered = NumberedRay { number: index, ray };
        t_max[index] = closest(nodes, ray, t_max[index], |slots: Leaf, limit: &mut f32| {
            if let (true, finding) = leaf.test(numbered, slots, *limit) {
                let which = leaf.refine(numbered, slots, &finding, limit);
                if which != 0 {
                    // SAFETY: every machine has those instructions.
                    unsafe { leaf.leaf::<Baseline>(numbered, slots, &finding, which, limit) };
                }
            }
        });
    }
    dispatch::traverse(true, Stream { nodes, rays, t_max, leaf });
}

struct Stream<'a, F> {
    nodes: &'a [Node],
    rays: &'a [PreparedRay],
    t_max: &'a mut [f32],
    leaf: F,
}

impl<F: StreamVisitor> Traversal for Stream<'_, F> {
    type Answer = ();

    #[inline(always)]
    unsafe fn run<N: NodeTest>(self) {
        let Self { nodes, rays, t_max, mut leaf } = self;
        if nodes.is_empty() {
            return;
        }
        let mut started = 0;
        let mut memory = StreamRays::take();
        let in_flight = memory.for_rays();
        let mut findings: [MaybeUninit<F::Finding>; STREAM_RAYS] = [const { MaybeUninit::uninit() }; STREAM_RAYS];
        let mut which: [MaybeUninit<u32>; STREAM_RAYS] = [const { MaybeUninit::uninit() }; STREAM_RAYS];
        let places = leaf.prefetch_table(nodes);
        let mut queues = Queues { nodes: 0, leaves: 0, ended: u32::MAX >> (32 - STREAM_RAYS) };
        // SAFETY: the caller's promise; links lead to nodes of the tree, leaves or nowhere (see `Node::children`), whatever lanes are met;
        // in_flight in queues of nodes and leaves were started; there is a limit for each ray.
        unsafe {
            macro_rules! stream_ray {
                ($number:expr) => {
                    &mut *in_flight.get_unchecked_mut($number).as_mut_ptr()
                };
            }
            loop {
                let mut free = std::mem::take(&mut queues.ended);
                while started < rays.len()
                    && let Some(number) = next(&mut free)
                {
                    let ray = NumberedRay { number: started, ray: rays.get_unchecked(started) };
                    let stream_ray = in_flight.get_unchecked_mut(number).as_mut_ptr();
                    StreamRay::start(stream_ray, ray, *t_max.get_unchecked(started));
                    // Those that are not regular end at once.
                    queues.nodes |= u32::from(ray.ray.regular) << number;
                    queues.ended |= u32::from(!ray.ray.regular) << number;
                    started += 1;
                }
                if queues.nodes | queues.leaves == 0 {
                    if started == rays.len() {
                        break;
                    }
                    continue;
                }
                let visited = std::mem::take(&mut queues.nodes);
                let mut visiting = visited;
                while let Some(number) = next(&mut visiting) {
                    let stream_ray = stream_ray!(number);
                    let (node, ray) = (nodes.get_unchecked(stream_ray.link.node_index()), stream_ray.ray.ray);
                    let link = if F::NEAREST {
                        stream_ray.stack.visit_without_branch::<_, N, true>(node, ray, stream_ray.limit)
                    } else {
                        stream_ray.stack.visit_without_branch::<_, N, false>(node, ray, stream_ray.limit)
                    };
                    queues.send(number, stream_ray, link, places);
                }
                queues.part(visited);
                let tested = std::mem::take(&mut queues.leaves);
                let (mut may_hit_rays, mut left) = (0, 0);
                let mut testing = tested;
                while let Some(number) = next(&mut testing) {
                    let stream_ray = stream_ray!(number);
                    let (may_hit, finding) =
                        leaf.test(stream_ray.ray, stream_ray.link.leaf(), *t_max.get_unchecked(stream_ray.ray.number));
                    findings.get_unchecked_mut(number).write(finding);
                    may_hit_rays |= u32::from(may_hit) << number;
                }
                while let Some(number) = next(&mut may_hit_rays) {
                    let (stream_ray, finding) = (stream_ray!(number), findings.get_unchecked(number).assume_init_ref());
                    let found = leaf.refine(
                        stream_ray.ray,
                        stream_ray.link.leaf(),
                        finding,
                        t_max.get_unchecked_mut(stream_ray.ray.number),
                    );
                    which.get_unchecked_mut(number).write(found);
                    left |= u32::from(found != 0) << number;
                }
                while let Some(number) = next(&mut left) {
                    let (stream_ray, finding) = (stream_ray!(number), findings.get_unchecked(number).assume_init_ref());
                    let (t_max, which) =
                        (t_max.get_unchecked_mut(stream_ray.ray.number), which.get_unchecked(number).assume_init());
                    let before = *t_max;
                    leaf.leaf::<N>(stream_ray.ray, stream_ray.link.leaf(), finding, which, t_max);
                    if F::NEAREST && *t_max < before {
                        stream_ray.limit = limit_of(*t_max);
                        stream_ray.stack.cull(stream_ray.limit);
                    }
                }
                testing = tested;
                while let Some(number) = next(&mut testing) {
                    let stream_ray = stream_ray!(number);
                    let mut link = stream_ray.stack.pop();
                    if !F::NEAREST {
                        let ended = *t_max.get_unchecked(stream_ray.ray.number) == f32::NEG_INFINITY;
                        link = select_unpredictable(ended, NodeRef::END, link);
                    }
                    queues.send(number, stream_ray, link, places);
                }
                queues.part(tested);
            }
        }
        memory.give_back();
    }
}
