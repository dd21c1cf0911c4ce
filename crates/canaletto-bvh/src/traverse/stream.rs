//! The traversal of many incoherent rays, several of them in flight at once.
#![allow(unsafe_code)] // Uninitialised memory, and kernels.

use std::cell::RefCell;
use std::hint::select_unpredictable;
use std::mem::MaybeUninit;

use super::single::closest;
use super::stack::Stack;
use crate::PreparedRay;
use crate::node::{Leaf, Node, NodeRef, PrefetchTable};
use crate::simd::dispatch::{self, Traversal};
use crate::simd::{Baseline, NodeTest};
use crate::slab::cull_limit;

/// A ray with its index in the list of rays.
#[derive(Clone, Copy)]
pub(crate) struct NumberedRay<'a> {
    pub(crate) number: usize,
    pub(crate) ray: &'a PreparedRay,
}

/// The leaf test of a stream. It runs in stages; each stage takes the rays that survived the last.
pub(crate) trait StreamVisitor {
    /// The result of the first stage.
    type CoarseResult: Copy;
    /// Whether the query wants the nearest hit. Otherwise it wants any hit: a hit then sets `t_max` to −∞ and ends the
    /// ray.
    const NEAREST: bool = true;
    /// The first stage: returns whether any primitive of a leaf may be hit before `t_max`, and the result for the next
    /// stages.
    fn test(&self, ray: NumberedRay<'_>, leaf: Leaf, t_max: f32) -> (bool, Self::CoarseResult);
    /// The second stage: returns the primitives that may be hit, one bit for each. In an any-hit query it may end the
    /// ray by lowering `t_max` to −∞.
    #[inline(always)]
    fn refine(&self, _ray: NumberedRay<'_>, _leaf: Leaf, _finding: &Self::CoarseResult, _t_max: &mut f32) -> u32 {
        u32::MAX
    }
    /// The last stage: tests these primitives exactly and lowers `t_max` to the nearest hit.
    ///
    /// # Safety
    /// The machine must have the instructions of `N`.
    unsafe fn leaf<N: NodeTest>(
        &mut self,
        ray: NumberedRay<'_>,
        leaf: Leaf,
        finding: &Self::CoarseResult,
        which: u32,
        t_max: &mut f32,
    );
    /// The addresses of the nodes and of the leaves' data, for prefetching.
    fn prefetch_table(&self, nodes: &[Node]) -> PrefetchTable {
        PrefetchTable::of_nodes(nodes)
    }
}

impl<F: FnMut(usize, Leaf, &mut f32)> StreamVisitor for F {
    type CoarseResult = ();

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

/// The number of rays in flight at once.
const STREAM_RAYS: usize = 32;

/// A ray in flight. The lowest entry of its stack is [`NodeRef::END`].
struct StreamRay<'a> {
    ray: NumberedRay<'a>,
    limit: f32,
    /// The node or leaf to visit next.
    node_ref: NodeRef,
    stack: Stack,
}

impl<'a> StreamRay<'a> {
    /// Starts a ray at the root.
    ///
    /// # Safety
    /// `stream_ray` must point to memory for a `StreamRay`.
    #[inline(always)]
    unsafe fn start(stream_ray: *mut Self, ray: NumberedRay<'a>, t_max: f32) {
        // SAFETY: the caller's promise. A stack needs nothing but its length and its lowest entry.
        unsafe {
            (*stream_ray).ray = ray;
            (*stream_ray).limit = cull_limit(t_max);
            (*stream_ray).node_ref = NodeRef::node(0);
            (*stream_ray).stack.clear();
        }
    }
}

/// Uninitialised memory for the rays in flight. It is not on the stack, which may be small on some threads, and it is
/// kept for the next stream of the thread.
struct StreamRays(Box<[MaybeUninit<StreamRay<'static>>; STREAM_RAYS]>);

thread_local! {
    /// Spare memory. There may be several entries, since a leaf's callback may itself trace a stream.
    static SPARE: RefCell<Vec<StreamRays>> = const { RefCell::new(Vec::new()) };
}

impl StreamRays {
    #[inline(never)]
    fn take() -> Self {
        let new = || {
            let memory: Box<MaybeUninit<[MaybeUninit<StreamRay<'static>>; STREAM_RAYS]>> = Box::new_uninit();
            // SAFETY: `MaybeUninit` needs no initialisation.
            Self(unsafe { memory.assume_init() })
        };
        SPARE.with_borrow_mut(Vec::pop).unwrap_or_else(new)
    }

    fn give_back(self) {
        SPARE.with_borrow_mut(|spare| spare.push(self));
    }

    /// The memory, for rays of this lifetime.
    #[inline(always)]
    fn for_rays<'a>(&mut self) -> &mut [MaybeUninit<StreamRay<'a>>; STREAM_RAYS] {
        // SAFETY: the lifetime of rays doesn't change the memory layout, and no entry written under another lifetime is
        // read.
        unsafe { &mut *(&raw mut *self.0).cast() }
    }
}

/// What the rays in flight do next: one bit for each ray. The queues are bit masks in registers and not lists in
/// memory. The address of a list's next entry would be known late, and all later reads from memory would have to wait
/// for it.
#[derive(Clone, Copy)]
struct Queues {
    nodes: u32,
    leaves: u32,
    ended: u32,
}

/// Removes the lowest ray from a queue and returns its number.
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
    /// Queues a ray for its next node or leaf, and prefetches that. A ray that has ended is put into `leaves`, too:
    /// [`Queues::separate`] removes it.
    #[inline(always)]
    fn enqueue(&mut self, number: usize, stream_ray: &mut StreamRay<'_>, node_ref: NodeRef, prefetch: PrefetchTable) {
        stream_ray.node_ref = node_ref;
        // Without branches, since they would be unpredictable.
        self.leaves |= u32::from(node_ref.is_leaf()) << number;
        self.ended |= u32::from(node_ref == NodeRef::END) << number;
        prefetch.fetch(node_ref);
    }

    /// Completes the queues after the rays in `sent` were sent: the rays that are not at leaves are at nodes, and the
    /// ended rays leave `leaves`.
    #[inline(always)]
    fn separate(&mut self, sent: u32) {
        self.nodes |= sent & !self.leaves;
        self.leaves &= !self.ended;
    }
}

/// [`closest`] for many incoherent rays, several of them in flight at once. In each round all rays at nodes visit
/// these, then all rays at leaves test these. No branch depends on the path of a single ray. The processor therefore
/// overlaps several visits, and waits neither for memory nor for mispredicted branches.
#[inline]
pub(crate) fn trace_stream<F: StreamVisitor>(nodes: &[Node], rays: &[PreparedRay], t_max: &mut [f32], mut leaf: F) {
    assert_eq!(rays.len(), t_max.len());
    for (index, ray) in rays.iter().enumerate().filter(|(_, ray)| !ray.regular) {
        let numbered = NumberedRay { number: index, ray };
        t_max[index] = closest(nodes, ray, t_max[index], |slots: Leaf, limit: &mut f32| {
            if let (true, finding) = leaf.test(numbered, slots, *limit) {
                let which = leaf.refine(numbered, slots, &finding, limit);
                if which != 0 {
                    // SAFETY: every machine has the baseline instructions.
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
        let mut findings: [MaybeUninit<F::CoarseResult>; STREAM_RAYS] = [const { MaybeUninit::uninit() }; STREAM_RAYS];
        let mut which: [MaybeUninit<u32>; STREAM_RAYS] = [const { MaybeUninit::uninit() }; STREAM_RAYS];
        let prefetch = leaf.prefetch_table(nodes);
        let mut queues = Queues { nodes: 0, leaves: 0, ended: u32::MAX >> (32 - STREAM_RAYS) };
        // SAFETY: the caller's promise. Links lead to nodes of the tree, to leaves, or are END (see `Node::children`),
        // whatever lanes are entered. Rays in the queues of nodes and leaves were started. There is a limit for each
        // ray.
        unsafe {
            macro_rules! stream_ray {
                ($number:expr) => {
                    &mut *in_flight.get_unchecked_mut($number).as_mut_ptr()
                };
            }
            loop {
                // Start rays in the places of those that have ended.
                let mut free = std::mem::take(&mut queues.ended);
                while started < rays.len()
                    && let Some(number) = next(&mut free)
                {
                    let ray = NumberedRay { number: started, ray: rays.get_unchecked(started) };
                    let stream_ray = in_flight.get_unchecked_mut(number).as_mut_ptr();
                    StreamRay::start(stream_ray, ray, *t_max.get_unchecked(started));
                    // Rays that are not regular end at once: they were traced above.
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
                // Nodes: test each, push the entered children, take the next node or leaf.
                let visited = std::mem::take(&mut queues.nodes);
                let mut visiting = visited;
                while let Some(number) = next(&mut visiting) {
                    let stream_ray = stream_ray!(number);
                    let (node, ray) = (nodes.get_unchecked(stream_ray.node_ref.node_index()), stream_ray.ray.ray);
                    let node_ref = if F::NEAREST {
                        stream_ray.stack.visit_without_branch::<_, N, true>(node, ray, stream_ray.limit)
                    } else {
                        stream_ray.stack.visit_without_branch::<_, N, false>(node, ray, stream_ray.limit)
                    };
                    queues.enqueue(number, stream_ray, node_ref, prefetch);
                }
                queues.separate(visited);
                // Leaves, first stage: the coarse test.
                let tested = std::mem::take(&mut queues.leaves);
                let (mut may_hit_rays, mut left) = (0, 0);
                let mut testing = tested;
                while let Some(number) = next(&mut testing) {
                    let stream_ray = stream_ray!(number);
                    let (may_hit, finding) = leaf.test(
                        stream_ray.ray,
                        stream_ray.node_ref.leaf(),
                        *t_max.get_unchecked(stream_ray.ray.number),
                    );
                    findings.get_unchecked_mut(number).write(finding);
                    may_hit_rays |= u32::from(may_hit) << number;
                }
                // Leaves, second stage: refine for the rays that are left.
                while let Some(number) = next(&mut may_hit_rays) {
                    let (stream_ray, finding) = (stream_ray!(number), findings.get_unchecked(number).assume_init_ref());
                    let found = leaf.refine(
                        stream_ray.ray,
                        stream_ray.node_ref.leaf(),
                        finding,
                        t_max.get_unchecked_mut(stream_ray.ray.number),
                    );
                    which.get_unchecked_mut(number).write(found);
                    left |= u32::from(found != 0) << number;
                }
                // Leaves, last stage: the exact test for the rays that are left. A nearer hit culls the stack.
                while let Some(number) = next(&mut left) {
                    let (stream_ray, finding) = (stream_ray!(number), findings.get_unchecked(number).assume_init_ref());
                    let (t_max, which) =
                        (t_max.get_unchecked_mut(stream_ray.ray.number), which.get_unchecked(number).assume_init());
                    let before = *t_max;
                    leaf.leaf::<N>(stream_ray.ray, stream_ray.node_ref.leaf(), finding, which, t_max);
                    if F::NEAREST && *t_max < before {
                        stream_ray.limit = cull_limit(*t_max);
                        stream_ray.stack.cull(stream_ray.limit);
                    }
                }
                // Pop the next node or leaf of each ray that was at a leaf.
                testing = tested;
                while let Some(number) = next(&mut testing) {
                    let stream_ray = stream_ray!(number);
                    let mut node_ref = stream_ray.stack.pop();
                    if !F::NEAREST {
                        let ended = *t_max.get_unchecked(stream_ray.ray.number) == f32::NEG_INFINITY;
                        node_ref = select_unpredictable(ended, NodeRef::END, node_ref);
                    }
                    queues.enqueue(number, stream_ray, node_ref, prefetch);
                }
                queues.separate(tested);
            }
        }
        memory.give_back();
    }
}
