use super::*;
use crate::shape::{Cuboid, Cylinder, Shape, Sphere};
use canaletto_bvh::Ray;
use glam::Vec3;

/// Calls `test` with the place at which a ray through `target` from outside hits the shape.
fn at<T>(shape: &Shape, target: DVec3, to_world: Option<&Transform>, test: impl FnOnce(&Place) -> T) -> T {
    let from = target * 3.0;
    let ray = Ray::new(from.as_vec3(), (target - from).as_vec3());
    let hit = shape.intersect(&ray, f32::INFINITY).expect("the ray meets the shape");
    let surface = shape.surface(&ray, &hit);
    let surface_differential = shape.surface_differential(&surface, &hit);
    test(&Place {
        point: surface.exact,
        normal: surface.normal,
        uv: surface.uv.as_dvec2(),
        surface_differential: &surface_differential,
        to_world,
        bounds: shape.bounds(),
        origins: [DVec3::ZERO; 2],
    })
}

fn ball(radius: f32) -> Shape {
    Shape::Sphere(Sphere { center: Vec3::ZERO, radius })
}

fn cube() -> Shape {
    Shape::Box(Cuboid { min: Vec3::splat(-0.5), max: Vec3::splat(0.5) })
}

const ALL: [Projection; 7] = [
    Projection::Uv,
    Projection::Planar,
    Projection::Box,
    Projection::Spherical,
    Projection::Cylindrical,
    Projection::Triplanar,
    Projection::Solid,
];

fn targets() -> impl Iterator<Item = DVec3> {
    (0..40).map(|i| {
        let (a, b) = (f64::from(i) * 0.77, f64::from(i) * 1.31 + 0.2);
        DVec3::new(libm::sin(a) * libm::cos(b), libm::sin(b), libm::cos(a) * libm::cos(b)).normalize()
    })
}

#[test]
fn a_boxs_own_coordinates_are_those_of_its_bounds_faces() {
    for target in targets() {
        let shape = Shape::Box(Cuboid { min: Vec3::new(-0.3, -0.4, -0.9), max: Vec3::new(0.5, 0.6, 0.7) });
        at(&shape, target, None, |place| {
            let own = Mapping::default().coords(place)[0].at;
            let faces = Mapping::new(Projection::Box, Space::Bounds).coords(place)[0].at;
            assert!((own - faces).length() < 1e-6, "{target}: {own} and {faces}");
        });
    }
}

#[test]
fn a_spheres_own_coordinates_are_the_spherical_ones() {
    for target in targets() {
        at(&ball(2.0), target * 2.0, None, |place| {
            for space in [Space::Object, Space::Bounds, Space::World] {
                let own = Mapping::default().coords(place)[0].at;
                let spherical = Mapping::new(Projection::Spherical, space).coords(place)[0].at;
                assert!((own - spherical).length() < 1e-6, "{target}: {own} and {spherical}");
            }
        });
    }
}

#[test]
fn changes_are_the_differences_of_neighbouring_points() {
    let to_world = Transform::translate(DVec3::new(0.3, 0.2, -0.4))
        .after(&Transform::rotate(DVec3::new(1.0, 2.0, 0.5), 40.0).unwrap())
        .after(&Transform::scale(DVec3::new(1.5, 0.7, 2.0)).unwrap());
    let transform = Transform::rotate(DVec3::new(0.2, 1.0, 0.1), 25.0)
        .unwrap()
        .after(&Transform::scale(DVec3::new(0.8, 1.2, 1.1)).unwrap())
        .after(&Transform::translate(DVec3::new(0.05, 0.1, 0.0)));
    let mut compared = 0;
    for (projection, space) in
        ALL.into_iter().flat_map(|p| [Space::Object, Space::World, Space::Bounds].map(|s| (p, s)))
    {
        let mapping = Mapping { projection, space, transform, repeat: Repeat([2.0, 3.0]), uv_set: 0 };
        for (shape, size) in [(ball(1.5), 1.5), (cube(), 0.5)] {
            for target in targets() {
                let near = target + DVec3::new(1e-4, -2e-4, 1.5e-4);
                let place = |target: DVec3| {
                    at(&shape, target * size, Some(&to_world), |place| (place.point, mapping.coords(place)))
                };
                let ((p, from), (q, to)) = (place(target), place(near));
                for (from, to) in from.iter().zip(to.iter()) {
                    let (expected, found) = (to.at - from.at, from.change(q - p));
                    // The point is at the seam, or on another face.
                    if expected.length() < 0.05 {
                        assert!(
                            (found - expected).length() < 0.02 * expected.length() + 3e-6,
                            "{mapping:?} {target}: {found} instead of {expected}"
                        );
                        compared += 1;
                    }
                }
            }
        }
    }
    assert!(compared > 1400, "{compared}");
}

#[test]
fn a_footprint_on_the_seam_is_as_small_as_beside_it() {
    // The seam of a sphere is at −z.
    let step = DVec3::X * 0.01;
    let beside = at(&ball(1.0), DVec3::new(0.3, 0.2, -1.0).normalize(), None, |place| {
        Mapping::default().coords(place)[0].change(step)
    });
    let on = at(&ball(1.0), DVec3::new(1e-9, 0.2, -1.0).normalize(), None, |place| {
        Mapping::default().coords(place)[0].change(step)
    });
    assert!(on.length() < 1.2 * beside.length() + 1e-3, "{on} and {beside}");
}

#[test]
fn at_the_pole_a_footprint_goes_round_once() {
    for mapping in [Mapping::default(), Mapping::new(Projection::Spherical, Space::Object)] {
        for target in [DVec3::Y, DVec3::new(1e-7, 1.0, 0.0), DVec3::new(0.0, -1.0, 1e-9)] {
            at(&ball(1.0), target, None, |place| {
                let spot = mapping.coords(place)[0];
                for step in [DVec3::X * 0.01, DVec3::Z * 0.01] {
                    let change = spot.change(step);
                    assert!(change.is_finite() && change.x.abs() <= 1.0, "{target}: {change}");
                    assert!(change.y.abs() <= 0.01, "{target}: {change}");
                }
            });
        }
    }
}

#[test]
fn transforms_move_the_picture_like_an_object() {
    // The image, half as large, with its middle a quarter to the right and upwards.
    let transform =
        Transform::translate(DVec3::new(0.25, 0.25, 0.0)).after(&Transform::scale(DVec3::splat(0.5)).unwrap());
    for (projection, space) in
        [(Projection::Uv, Space::Object), (Projection::Planar, Space::Object), (Projection::Box, Space::Bounds)]
    {
        let mapping = Mapping { transform, ..Mapping::new(projection, space) };
        at(&cube(), DVec3::new(0.25, 0.25, 0.5), None, |place| {
            let uv = mapping.coords(place)[0].at;
            assert!((uv - DVec3::new(0.5, 0.5, 0.0)).length() < 1e-6, "{projection:?}: {uv}");
        });
        // The image's upper right corner is the face's.
        at(&cube(), DVec3::new(0.4999999, 0.4999999, 0.5), None, |place| {
            let uv = mapping.coords(place)[0].at;
            assert!((uv - DVec3::new(1.0, 0.0, 0.0)).length() < 1e-5, "{projection:?}: {uv}");
        });
    }
}

#[test]
fn three_planes_weigh_one_together() {
    for target in targets() {
        at(&ball(1.0), target, None, |place| {
            let spots = Mapping::new(Projection::Triplanar, Space::Object).coords(place);
            let sum: f64 = spots.iter().map(|spot| spot.weight).sum();
            assert!((sum - 1.0).abs() < 1e-8, "{sum}");
        });
    }
    at(&cube(), DVec3::X * 0.5, None, |place| {
        assert_eq!(Mapping::new(Projection::Triplanar, Space::Object).coords(place).len(), 1);
    });
}

#[test]
fn a_cylinders_caps_are_flat() {
    let can = Shape::Cylinder(Cylinder {
        base: Vec3::new(0.0, -0.5, 0.0),
        top: Vec3::new(0.0, 0.5, 0.0),
        radius: 0.5,
        caps: true,
    });
    for target in [DVec3::new(0.2, 0.5, 0.1), DVec3::new(-0.1, -0.5, 0.3), DVec3::new(0.4, 0.1, 0.3)] {
        at(&can, target, None, |place| {
            let own = Mapping::default().coords(place)[0].at;
            let mapped = Mapping::new(Projection::Cylindrical, Space::Bounds).coords(place)[0].at;
            assert!((own - mapped).length() < 1e-6, "{target}: {own} and {mapped}");
        });
    }
}
