//! Many rays, in packets one after the other, and those that don't go with their neighbours.

use super::{Packet, RAYS};
use crate::Ray;
use crate::memory::prefetch_all;
use std::cell::RefCell;

/// What is asked about rays: what is told of each is a `T`, which says up to where the ray counts and takes the answer.
pub(crate) trait PacketQuery<T> {
    /// Whether rays that are left are worth a packet of their own before they go their own ways.
    const RETRY: bool;

    /// Traces up to [`RAYS`] rays in a packet. Returns a bit for each that it leaves.
    fn trace_packet(&self, packet: &mut Packet, rays: &[Ray], results: &mut [T]) -> u64;

    /// Traces rays that go their own ways.
    fn trace_diverged(&self, rays: &[Ray], results: &mut [T]);
}

/// Traces rays of which neighbours in the list go nearly the same way.
///
/// # Panics
/// If there is not as much `results` as rays.
pub(crate) fn coherent<T: Copy, Q: PacketQuery<T>>(query: &Q, rays: &[Ray], results: &mut [T]) {
    trace(query, rays, results, Q::RETRY);
}

fn trace<T: Copy, Q: PacketQuery<T>>(query: &Q, rays: &[Ray], results: &mut [T], retry: bool) {
    assert_eq!(rays.len(), results.len());
    let mut memory = Memory::take();
    let Memory { packet, left } = &mut *memory;
    left.clear();
    let mut next = rays.chunks(RAYS).skip(1);
    for (number, (rays, results)) in rays.chunks(RAYS).zip(results.chunks_mut(RAYS)).enumerate() {
        prefetch_all(next.next().unwrap_or_default());
        let diverged = query.trace_packet(packet, rays, results);
        left.add(number, diverged, rays);
    }
    if !left.rays.is_empty() {
        let mut of_these: Vec<T> = left.places.iter().map(|&place| results[place]).collect();
        // Few among so many lie along lines at which the way of all changes, as where another component of the direction becomes the
        // largest, and once more go with their neighbours.
        if retry && left.rays.len() < rays.len() / 4 {
            trace(query, &left.rays, &mut of_these, false);
        } else {
            query.trace_diverged(&left.rays, &mut of_these);
        }
        for (&place, of_one) in left.places.iter().zip(of_these) {
            results[place] = of_one;
        }
    }
    memory.give_back();
}

/// A packet and the rays that packets leave: kept for the next rays of the thread, since to clear it takes as long as to trace several.
struct Memory {
    packet: Packet,
    left: Left,
}

thread_local! {
    /// Some, as a leaf may hold what asks about rays itself.
    static SPARE: RefCell<Vec<Box<Memory>>> = const { RefCell::new(Vec::new()) };
}

impl Memory {
    fn take() -> Box<Self> {
        let spare = SPARE.with_borrow_mut(Vec::pop);
        spare.unwrap_or_else(|| Box::new(Self { packet: Packet::new(), left: Left::default() }))
    }

    fn give_back(mut self: Box<Self>) {
        self.left.forget_much();
        SPARE.with_borrow_mut(|spare| spare.push(self));
    }
}

/// How many rays there is always room for.
const MUCH: usize = 1024;

/// Rays that packets leave.
#[derive(Default)]
struct Left {
    places: Vec<usize>,
    rays: Vec<Ray>,
}

impl Left {
    fn clear(&mut self) {
        self.places.clear();
        self.rays.clear();
    }

    /// Keeps memory for the rays of bundles, not for those of whole pictures.
    fn forget_much(&mut self) {
        self.clear();
        self.places.shrink_to(MUCH);
        self.rays.shrink_to(MUCH);
    }

    /// Adds those rays of a packet that have a bit.
    #[inline]
    fn add(&mut self, packet: usize, mut which: u64, rays: &[Ray]) {
        while which != 0 {
            let i = which.trailing_zeros() as usize;
            which &= which - 1;
            self.places.push(packet * RAYS + i);
            self.rays.push(rays[i]);
        }
    }
}
