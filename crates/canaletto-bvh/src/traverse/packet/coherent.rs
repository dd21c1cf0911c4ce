//! Traces many rays in packets, one after the other, and then the diverged rays.

use super::{Packet, RAYS};
use crate::Ray;
use crate::memory::prefetch_all;
use std::cell::RefCell;

/// A query for many rays. A `T` belongs to each ray: it holds the ray's end and takes the result.
pub(crate) trait PacketQuery<T> {
    /// Whether diverged rays are worth a packet of their own before they are traced as a stream.
    const RETRY: bool;

    /// Traces up to [`RAYS`] rays in a packet. Returns the diverged rays, one bit for each.
    fn trace_packet(&self, packet: &mut Packet, rays: &[Ray], results: &mut [T]) -> u64;

    /// Traces the diverged rays, without packets.
    fn trace_diverged(&self, rays: &[Ray], results: &mut [T]);
}

/// Traces rays whose neighbours in the list are coherent.
///
/// # Panics
/// If `rays` and `results` differ in length.
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
        // A few diverged rays among many usually lie along lines where the axis order changes, as where another
        // component of the direction becomes the longest. Along such a line they are coherent again.
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

/// A packet and the diverged rays. The memory is kept for the next rays of the thread, since clearing it takes as long
/// as tracing several rays.
struct Memory {
    packet: Packet,
    left: Diverged,
}

thread_local! {
    /// Spare memory. There may be several entries, since a leaf's callback may itself trace rays.
    static SPARE: RefCell<Vec<Box<Memory>>> = const { RefCell::new(Vec::new()) };
}

impl Memory {
    fn take() -> Box<Self> {
        let spare = SPARE.with_borrow_mut(Vec::pop);
        spare.unwrap_or_else(|| Box::new(Self { packet: Packet::new(), left: Diverged::default() }))
    }

    fn give_back(mut self: Box<Self>) {
        self.left.shrink();
        SPARE.with_borrow_mut(|spare| spare.push(self));
    }
}

/// The number of rays for which memory is always kept.
const KEPT_RAYS: usize = 1024;

/// The diverged rays, with their indices in the list.
#[derive(Default)]
struct Diverged {
    places: Vec<usize>,
    rays: Vec<Ray>,
}

impl Diverged {
    fn clear(&mut self) {
        self.places.clear();
        self.rays.clear();
    }

    /// Keeps the memory for the rays of bundles, but not that for whole pictures.
    fn shrink(&mut self) {
        self.clear();
        self.places.shrink_to(KEPT_RAYS);
        self.rays.shrink_to(KEPT_RAYS);
    }

    /// Adds the rays of a packet whose bit is set.
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
