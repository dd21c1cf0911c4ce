use super::*;
use crate::form_factor::literature;
use crate::sampler::Sampler;
use std::f64::consts::PI;

/// A rectangle from a corner along two edges, whose front is on the side of u × v.
fn rectangle(corner: DVec3, u: DVec3, v: DVec3) -> [DVec3; 4] {
    [corner, corner + u, corner + u + v, corner + v]
}

fn check(what: &str, a: &[DVec3], b: &[DVec3], exact: f64) {
    let AnalyticFormFactor { value, error } = polygon_to_polygon(a, b).unwrap();
    println!("{what}: {value:.15} ± {error:.1e}, exactly {exact:.15}");
    // The closed forms round, too.
    assert!((value - exact).abs() <= error + 1e-12 * exact, "{what}: {value} ± {error} instead of {exact}");
    assert!(error < 1e-10, "{what}: an error of {error}");
}

/// Checks F(a→b), and F(b→a) by reciprocity.
fn check_both(what: &str, a: &[DVec3], b: &[DVec3], exact: f64) {
    check(what, a, b, exact);
    check(what, b, a, exact * area_vector(a).length() / area_vector(b).length());
}

#[test]
fn unit_squares() {
    let floor = rectangle(DVec3::ZERO, DVec3::X, DVec3::Y);
    let ceiling = rectangle(DVec3::Z, DVec3::Y, DVec3::X);
    let wall = rectangle(DVec3::ZERO, DVec3::Y, DVec3::Z);
    let value = |b: &[DVec3]| polygon_to_polygon(&floor, b).unwrap().value;
    assert!((value(&ceiling) - 0.199_824_895_698).abs() < 1e-12);
    assert!((value(&wall) - 0.200_043_776_075).abs() < 1e-12);
    // Nothing from behind, in the same plane, or to no area.
    assert_eq!(value(&rectangle(DVec3::Z, DVec3::X, DVec3::Y)), 0.0);
    assert_eq!(value(&rectangle(-DVec3::Z, DVec3::Y, DVec3::X)), 0.0);
    assert_eq!(value(&rectangle(DVec3::X, DVec3::X, DVec3::Y)), 0.0);
    assert_eq!(value(&[DVec3::Z, DVec3::Z + DVec3::X]), 0.0);
    assert_eq!(polygon_to_polygon(&[DVec3::Z; 4], &floor), None);
    assert_eq!(polygon_to_polygon(&[], &floor), None);
}

#[test]
fn parallel_rectangles() {
    for (a, b, c) in [(1.0, 2.0, 0.5), (3.0, 0.01, 1.0), (1.0, 1.0, 1e-3), (100.0, 0.5, 0.1)] {
        let floor = rectangle(DVec3::ZERO, DVec3::X * a, DVec3::Y * b);
        let ceiling = rectangle(DVec3::Z * c, DVec3::Y * b, DVec3::X * a);
        check_both("C-11", &floor, &ceiling, literature::parallel_rectangles(a, b, c));
    }
    let intervals = [
        ([0.0, 1.0], [0.0, 2.0], [3.0, 4.5], [-1.0, 0.5], 0.7),
        ([0.0, 1.0], [0.0, 1.0], [1.0, 2.0], [1.0, 2.0], 0.01),
        ([0.0, 0.01], [0.0, 0.01], [-5.0, 5.0], [-3.0, 4.0], 0.02),
    ];
    for (x, y, xi, eta, z) in intervals {
        let floor = rectangle(DVec3::new(x[0], y[0], 0.0), DVec3::X * (x[1] - x[0]), DVec3::Y * (y[1] - y[0]));
        let corner = DVec3::new(xi[0], eta[0], z);
        let ceiling = rectangle(corner, DVec3::Y * (eta[1] - eta[0]), DVec3::X * (xi[1] - xi[0]));
        check_both("C-13", &floor, &ceiling, literature::rectangles_in_parallel_planes(x, y, xi, eta, z));
    }
}

#[test]
fn perpendicular_rectangles() {
    for (w, h, l) in [(1.0, 2.0, 1.5), (0.01, 1.0, 1.0), (1.0, 1e-4, 1.0), (30.0, 50.0, 0.1)] {
        let floor = rectangle(DVec3::ZERO, DVec3::X * w, DVec3::Y * l);
        let wall = rectangle(DVec3::ZERO, DVec3::Y * l, DVec3::Z * h);
        let exact = literature::perpendicular_rectangles(w, h, l);
        assert!(
            (exact / literature::rectangles_in_perpendicular_planes([0.0, w], [0.0, l], [0.0, h], [0.0, l]) - 1.0)
                .abs()
                < 1e-9
        );
        check_both("C-14", &floor, &wall, exact);
    }
    let intervals = [
        // Apart, with a common corner, with edges that overlap, and very unequal.
        ([1.0, 2.0], [0.0, 1.0], [0.5, 3.0], [2.0, 5.0]),
        ([0.0, 1.0], [0.0, 1.0], [0.0, 1.0], [1.0, 3.0]),
        ([0.0, 1.0], [0.0, 1.0], [0.0, 2.0], [0.25, 3.0]),
        ([0.0, 0.125], [0.5, 0.625], [0.0, 2.0], [-1.0, 1.5]),
    ];
    for (x, y, xi, eta) in intervals {
        let floor = rectangle(DVec3::new(x[0], y[0], 0.0), DVec3::X * (x[1] - x[0]), DVec3::Y * (y[1] - y[0]));
        let corner = DVec3::new(0.0, eta[0], xi[0]);
        let wall = rectangle(corner, DVec3::Y * (eta[1] - eta[0]), DVec3::Z * (xi[1] - xi[0]));
        check_both("C-15", &floor, &wall, literature::rectangles_in_perpendicular_planes(x, y, xi, eta));
        // The parts of a wall below the floor and of a floor behind the wall add nothing.
        let corner = DVec3::new(0.0, eta[0], -1.0);
        let deeper = rectangle(corner, DVec3::Y * (eta[1] - eta[0]), DVec3::Z * (xi[1] + 1.0));
        let exact = literature::rectangles_in_perpendicular_planes(x, y, [0.0, xi[1]], eta);
        check("C-15, clipped", &floor, &deeper, exact);
        let wider = rectangle(DVec3::new(-2.0, y[0], 0.0), DVec3::X * (x[1] + 2.0), DVec3::Y * (y[1] - y[0]));
        let exact = literature::rectangles_in_perpendicular_planes([0.0, x[1]], y, [0.0, xi[1]], eta);
        check("C-15, both clipped", &wider, &deeper, exact * x[1] / (x[1] + 2.0));
    }
}

/// Far apart, distances are nearly equal and their logarithms cancel.
#[test]
fn far_rectangles() {
    for distance in [10.0, 1e3, 1e6] {
        let floor = rectangle(DVec3::ZERO, DVec3::X, DVec3::Y);
        let ceiling = rectangle(DVec3::Z * distance, DVec3::Y, DVec3::X);
        let AnalyticFormFactor { value, error } = polygon_to_polygon(&floor, &ceiling).unwrap();
        // The first terms of C-11's series in 1/c²: the mean of 1 / (π c² (1 + r²/c²)²).
        let c2 = distance * distance;
        let exact = (1.0 - 2.0 / (3.0 * c2) + 17.0 / (30.0 * c2 * c2)) / (PI * c2);
        let remainder = 0.6 / (PI * c2 * c2 * c2 * c2);
        println!("{distance}: {value:e} ± {error:e}, {exact:e}");
        assert!((value - exact).abs() <= error + remainder && (value - exact).abs() < 1e-9 * exact + remainder);
    }
}

/// Each face of a tetrahedron sends all its light to the three others.
#[test]
fn tetrahedra_sum_to_one() {
    let [a, b, c, d] = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]].map(|p| DVec3::from(p.map(f64::from)));
    let third = polygon_to_polygon(&[b, a, c], &[a, b, d]).unwrap();
    assert!((third.value - 1.0 / 3.0).abs() < 1e-12, "{third:?}");
    for i in 0..60 {
        let random = |k: u32| Sampler::new(7, 0, [i, 0]).uniform(0, k) * 2.0 - 1.0;
        // Flatter and flatter.
        let flat = 0.5f64.powi(i as i32 / 4);
        let mut p: [DVec3; 4] = std::array::from_fn(|k| {
            DVec3::new(random(3 * k as u32), random(3 * k as u32 + 1), flat * random(3 * k as u32 + 2))
        });
        if (p[1] - p[0]).cross(p[2] - p[0]).dot(p[3] - p[0]) > 0.0 {
            p.swap(0, 1);
        }
        // With the fronts inside.
        let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].map(|face| face.map(|k: usize| p[k]));
        for (k, face) in faces.iter().enumerate() {
            let others = faces.iter().enumerate().filter(|(other, _)| *other != k);
            let factors: Vec<_> = others.map(|(_, other)| polygon_to_polygon(face, other).unwrap()).collect();
            let (sum, error) = factors.iter().fold((0.0, 0.0), |(sum, error), f| (sum + f.value, error + f.error));
            assert!((sum - 1.0).abs() <= error && error < 1e-8, "{i}: {sum} ± {error:e} of {factors:?}");
        }
    }
}

/// Two triangles askew and apart, against cubature of the factor from points.
#[test]
fn askew_triangles_agree_with_cubature() {
    for i in 0..30 {
        let random = |k: u32| Sampler::new(11, 0, [i, 0]).uniform(0, k) * 2.0 - 1.0;
        let v = |k: u32| DVec3::new(random(3 * k), random(3 * k + 1), random(3 * k + 2));
        let (a, b) = ([v(0), v(1), v(2)], [v(3), v(4), v(5)].map(|p| p + DVec3::X * 2.5));
        let normal = area_vector(&a).normalize();
        let n = 64;
        let mut sum = 0.0;
        for row in 0..n {
            for column in 0..2 * row + 1 {
                let third = if column % 2 == 0 { 1.0 / 3.0 } else { 2.0 / 3.0 };
                let s = (f64::from(row) + 1.0 - third) / f64::from(n);
                let t = (f64::from(column / 2) + third) / f64::from(n);
                let point = a[0] + (a[1] - a[0]) * s + (a[2] - a[1]) * t;
                sum += point_to_polygon(point, normal, &b).max(0.0);
            }
        }
        let cubature = sum / f64::from(n * n);
        let AnalyticFormFactor { value, error } = polygon_to_polygon(&a, &b).unwrap();
        assert!((value - cubature).abs() < 1e-4 && error < 1e-10, "{i}: {value} ± {error}, {cubature}");
    }
}

#[test]
fn scale_by_a_power_of_two_keeps_all_bits() {
    let a = rectangle(DVec3::new(0.1, 0.3, 0.7), DVec3::X * 0.9, DVec3::Y * 0.7);
    for b in [
        [DVec3::new(0.2, 0.4, 0.9), DVec3::new(-0.7, 0.1, 3.0), DVec3::new(0.4, 0.9, 2.0)].map(|p| p * 7.0),
        [DVec3::new(0.1, 0.3, 0.7), DVec3::new(0.1, 2.0, 0.7), DVec3::new(0.1, 0.0, 2.0)],
    ] {
        let factor = polygon_to_polygon(&a, &b).unwrap();
        assert!(factor.value > 0.0, "{factor:?}");
        for scale in [2f64.powi(-40), 2f64.powi(50)] {
            assert_eq!(polygon_to_polygon(&a.map(|p| p * scale), &b.map(|p| p * scale)), Some(factor));
        }
    }
}
