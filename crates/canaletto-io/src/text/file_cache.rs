//! A cache of decoded files between frames: a file is read and decoded once as long as each frame uses it.

use std::any::Any;
use std::collections::HashMap;
use std::sync::Arc;

/// Cached values by key. The cache is off for scenes of a single frame. Otherwise it holds what the last frame used, so
/// that its memory doesn't grow with the number of frames.
pub(crate) struct FrameCache {
    /// Whether values are kept: there will be another frame.
    pub(crate) on: bool,
    things: HashMap<String, Cached>,
}

struct Cached {
    thing: Arc<dyn Any + Send + Sync>,
    /// Whether this frame used the value.
    used: bool,
}

impl FrameCache {
    pub(crate) fn new(on: bool) -> FrameCache {
        FrameCache { on, things: HashMap::new() }
    }

    /// The cached value of `key`, or else the result of `make`, which is cached. A key begins with the kind of the
    /// value and contains everything that it depends on.
    pub(crate) fn get<T: Clone + Send + Sync + 'static, E>(
        &mut self,
        key: String,
        make: impl FnOnce() -> Result<T, E>,
    ) -> Result<T, E> {
        if !self.on {
            return make();
        }
        if let Some(Cached { thing, used }) = self.things.get_mut(&key)
            && let Some(thing) = thing.downcast_ref::<T>()
        {
            *used = true;
            return Ok(thing.clone());
        }
        let made = make()?;
        self.things.insert(key, Cached { thing: Arc::new(made.clone()), used: true });
        Ok(made)
    }

    /// Ends a frame: drops the values that it didn't use.
    pub(crate) fn turn(&mut self) {
        self.things.retain(|_, thing| std::mem::take(&mut thing.used));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn made_once_if_on() {
        for (on, expected) in [(true, 1), (false, 2)] {
            let mut keep = FrameCache::new(on);
            let mut count = 0;
            for _ in 0..2 {
                let made: Result<u32, ()> = keep.get("number 7".into(), || {
                    count += 1;
                    Ok(7)
                });
                assert_eq!(made, Ok(7));
            }
            assert_eq!(count, expected);
            assert_eq!(keep.get("number 7".into(), || Err::<String, _>("made anew")), Err("made anew"));
        }
    }

    #[test]
    fn what_a_frame_leaves_out_is_dropped() {
        let mut keep = FrameCache::new(true);
        let mut count = 0;
        for frame in 0..6 {
            let mut use_of = |name: &str| {
                keep.get::<u32, ()>(name.into(), || {
                    count += 1;
                    Ok(count)
                })
            };
            use_of("always").unwrap();
            if frame % 2 == 0 {
                use_of("now and then").unwrap();
            }
            keep.turn();
        }
        assert_eq!(count, 1 + 3);
        keep.turn();
        assert!(keep.things.is_empty());
    }
}
