//! The result of a closest-hit query.

/// The nearest primitive that a ray hits: Embree's `RTCHit` together with the distance `tfar`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimitiveHit {
    /// The ray parameter of the hit.
    pub t: f32,
    /// The id of the primitive, or [`PrimitiveHit::NONE`].
    pub id: u32,
    /// The part of a user primitive that is hit, numbered by the primitive's own kernel. 0 for all other primitives.
    pub part: u32,
    /// The weights of a triangle's second and third corner, or two numbers from the kernel of a user primitive. 0
    /// otherwise.
    pub uv: [f32; 2],
}

impl PrimitiveHit {
    /// The id that stands for no primitive. It is larger than every real id, so that a tie goes to the real one.
    pub const NONE: u32 = u32::MAX;

    /// A result without a hit up to `t_max`.
    #[inline]
    pub fn none(t_max: f32) -> Self {
        Self { t: t_max, id: Self::NONE, part: 0, uv: [0.0; 2] }
    }
}
