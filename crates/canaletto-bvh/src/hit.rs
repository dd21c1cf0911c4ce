//! What a ray finds.

/// The nearest primitive that a ray meets: Embree's `RTCHit` with its distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimitiveHit {
    /// The ray's parameter.
    pub t: f32,
    /// The primitive, or [`PrimitiveHit::NONE`].
    pub id: u32,
    /// Which part of a user primitive, as its own kernel counts; else 0.
    pub part: u32,
    /// On a triangle the weights of the second and the third corner; on a user primitive what its kernel gives; else 0.
    pub uv: [f32; 2],
}

impl PrimitiveHit {
    /// No primitive. It is larger than every id, so that ties go to a real one.
    pub const NONE: u32 = u32::MAX;

    /// No hit up to `t_max`.
    #[inline]
    pub fn none(t_max: f32) -> Self {
        Self { t: t_max, id: Self::NONE, part: 0, uv: [0.0; 2] }
    }
}
