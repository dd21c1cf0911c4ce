//! Rays against spheres: Haines, Günther and Akenine-Möller, "Precision improvements for ray/sphere intersection",
//! Ray Tracing Gems (2019), chapter 7, in f64.

use glam::{DVec3, Vec3};

use crate::exact::{two_product, two_sum};
use crate::slab::Slabs;
use crate::{Aabb, Ray};

/// A box around the sphere, rounded outwards so that it holds all of it.
pub fn bounds(center: Vec3, radius: f32) -> Aabb {
    let outwards = |c: f32, r: f32| {
        let exact = f64::from(c) + f64::from(r);
        let near = exact as f32;
        match r > 0.0 {
            true if f64::from(near) < exact => near.next_up(),
            false if f64::from(near) > exact => near.next_down(),
            _ => near,
        }
    };
    Aabb {
        min: Vec3::from_array(center.to_array().map(|c| outwards(c, -radius))),
        max: Vec3::from_array(center.to_array().map(|c| outwards(c, radius))),
    }
}

/// The nearest t in (0, t_max] at which `ray` meets the sphere, from outside or from inside. A radius that is not
/// above 0 is never hit.
pub fn intersect(ray: &Ray, center: Vec3, radius: f32, t_max: f32) -> Option<f32> {
    let d = ray.direction.as_dvec3();
    let f = ray.origin.as_dvec3() - center.as_dvec3();
    let r = f64::from(radius);
    // a t² − 2 b t + c = 0
    let a = d.dot(d);
    let b = -f.dot(d);
    // r² minus the squared distance of center and ray: b² − a c without its cancellation (eq. 5).
    let l = f + (b / a) * d;
    let discriminant = r * r - l.dot(l);
    // NaN, for a zero direction, must fail as well.
    if !(discriminant >= 0.0 && r > 0.0) {
        return None;
    }
    let root = (a * discriminant).sqrt();
    // The root of larger size first, then the other from their product c / a (eq. 9 and 10).
    let q = if b < 0.0 { b - root } else { b + root };
    let [t0, t1] = [power(f, r) / q, q / a];
    let (first, second) = if t0 < t1 { (t0, t1) } else { (t1, t0) };
    // NaN, 0 / 0, is the origin on the surface of a sphere seen tangentially: no hit ahead.
    let t = if first > 0.0 { first } else { second };
    if !(t > 0.0 && t <= 2.0 * f64::from(t_max)) {
        return None;
    }
    Slabs::new(ray).confine(&bounds(center, radius), t, t_max)
}

/// c = f·f − r², twice as precise as f64: near the surface its terms cancel.
fn power(f: DVec3, r: f64) -> f64 {
    let mut sum = 0.0;
    let mut rest = 0.0;
    for (x, y) in [(f.x, f.x), (r, -r), (f.y, f.y), (f.z, f.z)] {
        let (p, p_rest) = two_product(x, y);
        let (s, s_rest) = two_sum(sum, p);
        sum = s;
        rest += p_rest + s_rest;
    }
    sum + rest
}
