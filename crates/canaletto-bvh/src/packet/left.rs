//! Rays that don't go with their neighbours.

use super::RAYS;
use crate::Ray;

/// Rays that packets leave, of a list of which each packet takes [`RAYS`].
#[derive(Default)]
pub(crate) struct Left {
    places: Vec<usize>,
    rays: Vec<Ray>,
}

impl Left {
    /// Adds those rays of a packet that have a bit.
    #[inline]
    pub(crate) fn add(&mut self, packet: usize, mut which: u64, rays: &[Ray]) {
        while which != 0 {
            let i = which.trailing_zeros() as usize;
            which &= which - 1;
            self.places.push(packet * RAYS + i);
            self.rays.push(rays[i]);
        }
    }

    /// Whether they are few among so many: then they lie along lines at which the way of all changes, as where another component of the direction becomes
    /// the largest, and once more go with their neighbours.
    pub(crate) fn are_few_of(&self, rays: usize) -> bool {
        self.rays.len() < rays / 4
    }

    /// Has them asked about.
    pub(crate) fn serve<T: Copy>(self, told: &mut [T], ask: impl FnOnce(&[Ray], &mut [T])) {
        if self.places.is_empty() {
            return;
        }
        let mut of_these: Vec<T> = self.places.iter().map(|&place| told[place]).collect();
        ask(&self.rays, &mut of_these);
        for (place, of_one) in self.places.into_iter().zip(of_these) {
            told[place] = of_one;
        }
    }
}
