//! Coordinates and sizes that `f32` holds badly: huge triangles, far places, far tori.
