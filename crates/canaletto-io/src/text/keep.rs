//! What is read once for all frames: files that didn't change are neither read nor understood again.

use std::any::Any;
use std::collections::HashMap;
use std::sync::Arc;

/// Things by what they were made of. Keeps nothing for scenes of a single frame.
pub(crate) struct Keep {
    /// Whether there will be a next time.
    pub(crate) on: bool,
    things: HashMap<String, Arc<dyn Any + Send + Sync>>,
}

impl Keep {
    pub(crate) fn new(on: bool) -> Keep {
        Keep { on, things: HashMap::new() }
    }

    /// The thing of this key, or what `make` makes. A key says all that the thing depends on, and first what it is.
    pub(crate) fn get<T: Clone + Send + Sync + 'static, E>(
        &mut self,
        key: String,
        make: impl FnOnce() -> Result<T, E>,
    ) -> Result<T, E> {
        if !self.on {
            return make();
        }
        if let Some(thing) = self.things.get(&key).and_then(|thing| thing.downcast_ref::<T>()) {
            return Ok(thing.clone());
        }
        let made = make()?;
        self.things.insert(key, Arc::new(made.clone()));
        Ok(made)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn made_once_if_on() {
        for (on, expected) in [(true, 1), (false, 2)] {
            let mut keep = Keep::new(on);
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
}
