//! The list of broken rules.

use super::place::Place;
use crate::import::gltf::fault::Fault;
use std::collections::HashSet;

/// The most broken rules that are kept. Further ones are counted.
const MOST_KEPT: usize = 1000;

/// The broken rules so far.
#[derive(Default)]
pub(super) struct Broken {
    pub(super) faults: Vec<Fault>,
    /// The places of the faults.
    places: HashSet<String>,
    /// The number of faults that aren't kept.
    pub(super) more: usize,
}

impl Broken {
    /// Tells what is wrong at a place.
    pub(super) fn tell(&mut self, place: &Place, message: impl Into<String>) {
        self.fault(Fault::new(message).at(place.to_string()));
    }

    /// Tells a fault, which has its place.
    pub(super) fn fault(&mut self, fault: Fault) {
        if self.faults.len() >= MOST_KEPT {
            self.more += 1;
            return;
        }
        self.places.insert(fault.pointer().to_owned());
        self.faults.push(fault);
    }

    /// Tells a fault unless there is one of its place.
    pub(super) fn fault_if_first(&mut self, fault: Fault) {
        if !self.places.contains(fault.pointer()) {
            self.fault(fault);
        }
    }
}
