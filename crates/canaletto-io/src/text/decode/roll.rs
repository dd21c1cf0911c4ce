//! The roll of moving cameras that pass overhead. A camera that is aimed along its own `up` keeps its previous roll.

use super::Decoder;
use canaletto::camera::{continue_roll, flips_roll, has_roll};
use canaletto::scene::{Extrinsics, View};

/// The cameras of the scene at another frame, given by its offset from this one.
pub(crate) type Neighbours<'a> = dyn Fn(f64) -> Vec<View> + 'a;

/// The largest number of frames before and after this one that are searched for a camera's roll.
const MAX_FRAMES: u32 = 1000;

impl Decoder<'_> {
    /// Gives each moving camera that is aimed along its `up` the roll of the frame before, or of the frame after where
    /// none before has one. While the shutter is open the roll does not flip.
    pub(super) fn keep_rolls(&mut self) {
        for index in 0..self.scene.views.len() {
            let view = &self.scene.views[index];
            let places = || view.motion.iter().chain([&view.extrinsics]);
            if view.motion.is_empty() && has_roll(&view.extrinsics) {
                continue;
            }
            // A camera without a direction, or with an `up` of length zero, is a mistake at every frame.
            let open = places().any(|place| !has_roll(place) && (place.eye - place.center).try_normalize().is_some());
            let before = if open { self.neighbour_with_roll(index) } else { None };
            let view = &mut self.scene.views[index];
            if let (false, Some(before)) = (has_roll(&view.extrinsics), before) {
                view.extrinsics = continue_roll(&view.extrinsics, &before).unwrap_or(view.extrinsics);
            }
            let mut last = before;
            for place in &mut view.motion {
                if let Some(last) = last
                    && (!has_roll(place) || flips_roll(place, &last))
                {
                    *place = continue_roll(place, &last).unwrap_or(*place);
                }
                last = has_roll(place).then_some(*place).or(last);
            }
        }
    }

    /// The placement of a camera at the nearest frame at which its roll is defined. Frames before this one come first.
    fn neighbour_with_roll(&self, index: usize) -> Option<Extrinsics> {
        let offsets = (1..=MAX_FRAMES).map(|n| -f64::from(n)).chain((1..=MAX_FRAMES).map(f64::from));
        offsets.map_while(|offset| (self.neighbours)(offset).get(index).map(|view| view.extrinsics)).find(has_roll)
    }
}
