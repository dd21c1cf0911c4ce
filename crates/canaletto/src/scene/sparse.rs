//! Values that equal a usual value almost everywhere.

use crate::math::Transform;
use glam::Vec3;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::ops::{Deref, DerefMut};

/// A type with a usual value.
pub trait Usual: PartialEq + Clone + 'static {
    /// The value that takes no memory of its own.
    const USUAL: &'static Self;
}

impl Usual for Transform {
    const USUAL: &'static Transform = &Transform::IDENTITY;
}

impl Usual for Vec<Transform> {
    const USUAL: &'static Vec<Transform> = &Vec::new();
}

impl Usual for [Vec3; 3] {
    const USUAL: &'static [Vec3; 3] = &[Vec3::ZERO; 3];
}

/// A value that takes memory only where it differs from the usual one, so that a million nodes without it stay small.
/// It dereferences to the value.
#[derive(Clone)]
pub struct Sparse<T: Usual>(Option<Box<T>>);

impl<T: Usual> Sparse<T> {
    /// Whether this is the usual value.
    pub fn is_usual(&self) -> bool {
        **self == *T::USUAL
    }
}

impl<T: Usual> Default for Sparse<T> {
    fn default() -> Sparse<T> {
        Sparse(None)
    }
}

impl<T: Usual> From<T> for Sparse<T> {
    fn from(value: T) -> Sparse<T> {
        Sparse((value != *T::USUAL).then(|| Box::new(value)))
    }
}

impl<T: Usual> Deref for Sparse<T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.0.as_deref().unwrap_or(T::USUAL)
    }
}

impl<T: Usual> DerefMut for Sparse<T> {
    fn deref_mut(&mut self) -> &mut T {
        self.0.get_or_insert_with(|| Box::new(T::USUAL.clone()))
    }
}

impl<T: Usual> PartialEq for Sparse<T> {
    fn eq(&self, other: &Sparse<T>) -> bool {
        **self == **other
    }
}

impl<T: Usual + fmt::Debug> fmt::Debug for Sparse<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(f)
    }
}

impl<T: Usual + Serialize> Serialize for Sparse<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (**self).serialize(serializer)
    }
}

impl<'de, T: Usual + Deserialize<'de>> Deserialize<'de> for Sparse<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Sparse<T>, D::Error> {
        T::deserialize(deserializer).map(Sparse::from)
    }
}
