//! Closed sets of values with names, which scene text, command line and metadata share.

/// A closed set of values, each with the word that stands for it in scene text, on the command line and in metadata.
/// The macro [`named!`](crate::named!) implements it.
pub trait Named: Sized + 'static {
    /// Every value, in the order of the reference. A value with numbers has their defaults.
    const ALL: &'static [Self];
    /// The words of the values, in the order of [`Named::ALL`].
    const NAMES: &'static [&'static str];

    /// The word for this value.
    fn name(&self) -> &'static str;

    /// A line of help about this value; empty if it has none.
    fn meaning(&self) -> &'static str;

    /// The value that this word stands for.
    fn from_name(name: &str) -> Option<Self>;
}

/// Implements [`Named`] for an enum, by one line for each of its variants: its word, and a line of help if it needs
/// one. A variant without a line does not compile.
///
/// ```
/// use canaletto::Named;
///
/// #[derive(Clone, Copy, Debug, PartialEq)]
/// enum Finish {
///     Matt,
///     Glossy { exponent: f32 },
/// }
///
/// canaletto::named!(Finish {
///     Matt => "matt",
///     Glossy { exponent: 50.0 } => "glossy": "With highlights",
/// });
///
/// assert_eq!(Finish::NAMES, ["matt", "glossy"]);
/// assert_eq!(Finish::from_name("glossy"), Some(Finish::Glossy { exponent: 50.0 }));
/// assert_eq!(Finish::Glossy { exponent: 3.0 }.name(), "glossy");
/// ```
#[macro_export]
macro_rules! named {
    ($set:ident { $(
        $variant:ident $(($($part:expr),+))? $({ $($field:ident : $value:expr),+ })? => $name:literal $(: $meaning:literal)?
    ),+ $(,)? }) => {
        impl $crate::Named for $set {
            const ALL: &'static [$set] = &[$($set::$variant $(($($part),+))? $({ $($field: $value),+ })?),+];
            const NAMES: &'static [&'static str] = &[$($name),+];

            fn name(&self) -> &'static str {
                match self {
                    $($set::$variant { .. } => $name),+
                }
            }

            fn meaning(&self) -> &'static str {
                match self {
                    $($set::$variant { .. } => concat!($($meaning)?)),+
                }
            }

            fn from_name(name: &str) -> Option<$set> {
                match name {
                    $($name => Some($set::$variant $(($($part),+))? $({ $($field: $value),+ })?),)+
                    _ => None,
                }
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::Named;
    use crate::light::Emission;
    use crate::light::environment::{Face, Smoothing};
    use crate::material::{Channel, Projection, Space, Target};
    use crate::scene::{Filter, Integrator, SamplePattern, SamplerKind, Shading, ShadowMethod, Stage, Tone, Transfer};
    use crate::texture::{self, ColorSpace, Feature, Gradient, Interpolation, Placement, Prefilter, Wrap};
    use std::fmt::Debug;

    fn names_are_unique<T: Named + PartialEq + Debug>() {
        assert_eq!(T::ALL.len(), T::NAMES.len());
        for (value, name) in T::ALL.iter().zip(T::NAMES) {
            assert_eq!(value.name(), *name);
            assert_eq!(T::from_name(name).as_ref(), Some(value));
        }
        assert_eq!(T::from_name("no such word"), None);
    }

    #[test]
    fn each_name_stands_for_one_value() {
        names_are_unique::<Emission>();
        names_are_unique::<Face>();
        names_are_unique::<Smoothing>();
        names_are_unique::<Channel>();
        names_are_unique::<Projection>();
        names_are_unique::<Space>();
        names_are_unique::<Target>();
        names_are_unique::<Filter>();
        names_are_unique::<Integrator>();
        names_are_unique::<SamplePattern>();
        names_are_unique::<SamplerKind>();
        names_are_unique::<Shading>();
        names_are_unique::<ShadowMethod>();
        names_are_unique::<Stage>();
        names_are_unique::<Tone>();
        names_are_unique::<Transfer>();
        names_are_unique::<texture::Filter>();
        names_are_unique::<ColorSpace>();
        names_are_unique::<Feature>();
        names_are_unique::<Gradient>();
        names_are_unique::<Interpolation>();
        names_are_unique::<Placement>();
        names_are_unique::<Prefilter>();
        names_are_unique::<Wrap>();
    }
}
