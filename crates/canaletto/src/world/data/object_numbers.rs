//! The numbers of objects. All objects of a scene are numbered in the order of the file, depth first, copies included.
//!
//! A prototype is walked once. Its objects have numbers from 0 on within it, and so have the objects of the root. A
//! copy adds the number of objects before it. A number is therefore a sum along the path to an object, whether
//! prototypes are dissolved or kept as groups. [`ObjectNumbers`] is the way back, from a number to the described
//! object.

/// The objects of the root or of a prototype, by their numbers within it.
#[derive(Clone, Debug, Default)]
pub(in crate::world) struct ObjectNumbers {
    /// Runs of numbers, in their order. Equal copies side by side are one run.
    runs: Vec<NumberRun>,
    count: u64,
}

/// Successive numbers.
#[derive(Clone, Copy, Debug)]
struct NumberRun {
    first: u64,
    content: RunContent,
}

/// The content of a run of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
enum RunContent {
    /// Described objects in their order, from this index on.
    Objects(u32),
    /// Copies of the prototype of this index.
    Copies(u32),
}

impl ObjectNumbers {
    /// The number of objects so far, copies included.
    pub(in crate::world) fn count(&self) -> u64 {
        self.count
    }

    /// The number of the last object.
    pub(in crate::world) fn last(&self) -> u64 {
        self.count.saturating_sub(1)
    }

    /// Numbers a described object.
    pub(in crate::world) fn push_object(&mut self, object: u32) {
        let follows = self.runs.last().is_some_and(|run| match run.content {
            RunContent::Objects(first) => u64::from(first) + (self.count - run.first) == u64::from(object),
            RunContent::Copies(_) => false,
        });
        self.push(RunContent::Objects(object), 1, follows);
    }

    /// Numbers a copy of a prototype that has so many objects.
    pub(in crate::world) fn push_copy(&mut self, prototype: u32, objects: u64) {
        let content = RunContent::Copies(prototype);
        let follows = self.runs.last().is_some_and(|run| run.content == content);
        self.push(content, objects, follows);
    }

    fn push(&mut self, content: RunContent, objects: u64, follows: bool) {
        if objects > 0 && !follows {
            self.runs.push(NumberRun { first: self.count, content });
        }
        self.count = self.count.saturating_add(objects);
    }

    /// The index of the described object with this number, or `None` if there are fewer objects.
    pub(in crate::world) fn object(&self, number: u64, prototypes: &[ObjectNumbers]) -> Option<u32> {
        let (mut numbers, mut number) = (self, number);
        while number < numbers.count {
            let run = numbers.runs[numbers.runs.partition_point(|run| run.first <= number) - 1];
            number -= run.first;
            match run.content {
                RunContent::Objects(first) => return Some(first + number as u32),
                RunContent::Copies(prototype) => {
                    numbers = &prototypes[prototype as usize];
                    number %= numbers.count;
                }
            }
        }
        None
    }

    pub(in crate::world) fn bytes(&self) -> usize {
        self.runs.len() * size_of::<NumberRun>()
    }
}
