//! Many rays through the tree at once, which need not go the same way.

use std::cell::RefCell;
use std::hint::select_unpredictable;
use std::mem::MaybeUninit;

use super::stack::Stack;
use super::{Passage, closest, run};
use crate::PreparedRay;
use crate::lanes::{Exact, Lanes, Portable};
use crate::node::{Leaf, Link, Node, Places};
use crate::slab::limit as limit_of;

/// A ray of a list.
#[derive(Clone, Copy)]
pub(crate) struct Numbered<'a> {
    pub(crate) number: usize,
    pub(crate) ray: &'a PreparedRay,
}

/// What is done at leaves for many rays. A leaf is tested in steps, each of which is done for all rays for which the one before has left something
/// to do.
pub(crate) trait ClosestOfMany {
    /// What the first step finds.
    type Finding: Copy;
    /// Whether it counts what is nearest, or only that something is hit, after which `t_max` is −∞ and the ray's way ends.
    const NEAREST: bool = true;
    /// Tells whether anything in a leaf may be hit by a ray before `t_max`.
    fn test(&self, ray: Numbered<'_>, leaf: Leaf, t_max: f32) -> (bool, Self::Finding);
    /// Looks closer: which primitives may be hit, a bit for each. May lower `t_max` to −∞ where it counts only that something is hit.
    #[inline(always)]
    fn look(&self, _ray: Numbered<'_>, _leaf: Leaf, _finding: &Self::Finding, _t_max: &mut f32) -> u32 {
        u32::MAX
    }
    /// Completes the test of these, and lowers `t_max` to the nearest hit.
    ///
    /// # Safety
    /// The machine must have the instructions of `E`.
    unsafe fn leaf<E: Exact>(
        &mut self,
        ray: Numbered<'_>,
        leaf: Leaf,
        finding: &Self::Finding,
        which: u32,
        t_max: &mut f32,
    );
    /// Where nodes and the leaves' data lie, to be fetched in advance.
    fn places(&self, nodes: &[Node]) -> Places {
        Places::of_nodes(nodes)
    }
}

impl<F: FnMut(usize, Leaf, &mut f32)> ClosestOfMany for F {
    type Finding = ();

    #[inline(always)]
    fn test(&self, _ray: Numbered<'_>, _leaf: Leaf, _t_max: f32) -> (bool, ()) {
        (true, ())
    }

    #[inline(always)]
    unsafe fn leaf<E: Exact>(&mut self, ray: Numbered<'_>, leaf: Leaf, _finding: &(), _which: u32, t_max: &mut f32) {
        self(ray.number, leaf, t_max);
    }
}

/// How many rays of a stream are on their way at once.
const FLIGHTS: usize = 32;

/// A ray on its way. Its stack's lowest entry is [`Link::END`].
struct Flight<'a> {
    ray: Numbered<'a>,
    limit: f32,
    /// Where it is.
    link: Link,
    stack: Stack,
}

impl<'a> Flight<'a> {
    /// # Safety
    /// `flight` must point to memory for a flight.
    #[inline(always)]
    unsafe fn start(flight: *mut Self, ray: Numbered<'a>, t_max: f32) {
        // SAFETY: the caller's promise; a stack needs nothing but its length and lowest entry.
        unsafe {
            (*flight).ray = ray;
            (*flight).limit = limit_of(t_max);
            (*flight).link = Link::node(0);
            (*flight).stack.clear();
        }
    }
}

/// Memory for flights, which nothing is known to be written in. Not on the stack, of which threads may have less, and kept for the next
/// rays of the thread.
struct Flights(Box<[MaybeUninit<Flight<'static>>; FLIGHTS]>);

thread_local! {
    /// Some, as a leaf may hold what asks about rays itself.
    static SPARE: RefCell<Vec<Flights>> = const { RefCell::new(Vec::new()) };
}

impl Flights {
    #[inline(never)]
    fn take() -> Self {
        let new = || {
            let memory: Box<MaybeUninit<[MaybeUninit<Flight<'static>>; FLIGHTS]>> = Box::new_uninit();
            // SAFETY: what may be unwritten needs nothing written.
            Self(unsafe { memory.assume_init() })
        };
        SPARE.with_borrow_mut(Vec::pop).unwrap_or_else(new)
    }

    fn give_back(self) {
        SPARE.with_borrow_mut(|spare| spare.push(self));
    }

    /// For flights of rays that live as long as that.
    #[inline(always)]
    fn of_these_rays<'a>(&mut self) -> &mut [MaybeUninit<Flight<'a>>; FLIGHTS] {
        // SAFETY: how long rays live changes nothing about memory, and nothing is taken for written that others wrote.
        unsafe { &mut *(&raw mut *self.0).cast() }
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

impl Queues {
    /// Sends a flight to its next place, and tells the caches. It goes to `leaves` also where it has ended: see [`Queues::part`].
    #[inline(always)]
    fn send(&mut self, number: usize, flight: &mut Flight<'_>, link: Link, places: Places) {
        flight.link = link;
        // Without branches, since nobody could foretell them.
        self.leaves |= u32::from(link.is_leaf()) << number;
        self.ended |= u32::from(link == Link::END) << number;
        places.fetch(link);
    }

    /// Tells flights at nodes, leaves and ends apart, when these were sent.
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
pub(crate) fn closest_of_many<F: ClosestOfMany>(nodes: &[Node], rays: &[PreparedRay], t_max: &mut [f32], mut leaf: F) {
    assert_eq!(rays.len(), t_max.len());
    for (index, ray) in rays.iter().enumerate().filter(|(_, ray)| !ray.regular) {
        let numbered = Numbered { number: index, ray };
        t_max[index] = closest(nodes, ray, t_max[index], |slots: Leaf, limit: &mut f32| {
            if let (true, finding) = leaf.test(numbered, slots, *limit) {
                let which = leaf.look(numbered, slots, &finding, limit);
                if which != 0 {
                    // SAFETY: every machine has those instructions.
                    unsafe { leaf.leaf::<Portable>(numbered, slots, &finding, which, limit) };
                }
            }
        });
    }
    run(true, Stream { nodes, rays, t_max, leaf });
}

struct Stream<'a, F> {
    nodes: &'a [Node],
    rays: &'a [PreparedRay],
    t_max: &'a mut [f32],
    leaf: F,
}

impl<F: ClosestOfMany> Passage for Stream<'_, F> {
    type Ray = PreparedRay;
    type Answer = ();

    #[inline(always)]
    unsafe fn run<L: Lanes>(self) {
        let Self { nodes, rays, t_max, mut leaf } = self;
        if nodes.is_empty() {
            return;
        }
        let mut started = 0;
        let mut memory = Flights::take();
        let flights = memory.of_these_rays();
        let mut findings: [MaybeUninit<F::Finding>; FLIGHTS] = [const { MaybeUninit::uninit() }; FLIGHTS];
        let mut which: [MaybeUninit<u32>; FLIGHTS] = [const { MaybeUninit::uninit() }; FLIGHTS];
        let places = leaf.places(nodes);
        let mut queues = Queues { nodes: 0, leaves: 0, ended: u32::MAX >> (32 - FLIGHTS) };
        // SAFETY: the caller's promise; links lead to nodes of the tree, leaves or nowhere (see `Node::children`), whatever lanes are met;
        // flights in queues of nodes and leaves were started; there is a limit for each ray.
        unsafe {
            macro_rules! flight {
                ($number:expr) => {
                    &mut *flights.get_unchecked_mut($number).as_mut_ptr()
                };
            }
            loop {
                let mut free = std::mem::take(&mut queues.ended);
                while started < rays.len()
                    && let Some(number) = next(&mut free)
                {
                    let ray = Numbered { number: started, ray: rays.get_unchecked(started) };
                    let flight = flights.get_unchecked_mut(number).as_mut_ptr();
                    Flight::start(flight, ray, *t_max.get_unchecked(started));
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
                    let flight = flight!(number);
                    let (node, ray) = (nodes.get_unchecked(flight.link.node_index()), flight.ray.ray);
                    let link = if F::NEAREST {
                        flight.stack.visit_without_branch::<_, L, true>(node, ray, flight.limit)
                    } else {
                        flight.stack.visit_without_branch::<_, L, false>(node, ray, flight.limit)
                    };
                    queues.send(number, flight, link, places);
                }
                queues.part(visited);
                let tested = std::mem::take(&mut queues.leaves);
                let (mut hopeful, mut left) = (0, 0);
                let mut testing = tested;
                while let Some(number) = next(&mut testing) {
                    let flight = flight!(number);
                    let (hope, finding) =
                        leaf.test(flight.ray, flight.link.leaf(), *t_max.get_unchecked(flight.ray.number));
                    findings.get_unchecked_mut(number).write(finding);
                    hopeful |= u32::from(hope) << number;
                }
                while let Some(number) = next(&mut hopeful) {
                    let (flight, finding) = (flight!(number), findings.get_unchecked(number).assume_init_ref());
                    let found =
                        leaf.look(flight.ray, flight.link.leaf(), finding, t_max.get_unchecked_mut(flight.ray.number));
                    which.get_unchecked_mut(number).write(found);
                    left |= u32::from(found != 0) << number;
                }
                while let Some(number) = next(&mut left) {
                    let (flight, finding) = (flight!(number), findings.get_unchecked(number).assume_init_ref());
                    let (t_max, which) =
                        (t_max.get_unchecked_mut(flight.ray.number), which.get_unchecked(number).assume_init());
                    let before = *t_max;
                    leaf.leaf::<L>(flight.ray, flight.link.leaf(), finding, which, t_max);
                    if F::NEAREST && *t_max < before {
                        flight.limit = limit_of(*t_max);
                        flight.stack.cull(flight.limit);
                    }
                }
                testing = tested;
                while let Some(number) = next(&mut testing) {
                    let flight = flight!(number);
                    let mut link = flight.stack.pop();
                    if !F::NEAREST {
                        let ended = *t_max.get_unchecked(flight.ray.number) == f32::NEG_INFINITY;
                        link = select_unpredictable(ended, Link::END, link);
                    }
                    queues.send(number, flight, link, places);
                }
                queues.part(tested);
            }
        }
        memory.give_back();
    }
}
