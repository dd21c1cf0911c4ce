//! Rays.

use glam::Vec3;

/// The points `origin + t * direction`, t > 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where t = 0.
    pub origin: Vec3,
    /// The way of growing t; of any length.
    pub direction: Vec3,
}

impl Ray {
    /// The ray from `origin` along `direction`.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction }
    }

    /// The point at `t`.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + t * self.direction
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_lies_t_directions_from_the_origin() {
        let ray = Ray::new(Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, -2.0, 4.0));
        assert_eq!(ray.at(0.5), Vec3::new(1.0, 1.0, 5.0));
    }
}
