use super::super::testing::Random;
use super::super::{Disk, Parallelogram, Shape, Sphere};
use super::*;
use glam::Vec3;

/// A surface, and whether a direction from the origin meets it.
type Seen<'a> = (&'a str, SurfaceSampler, Box<dyn Fn(DVec3) -> bool>);

fn uniform(random: &mut Random) -> [f64; 2] {
    [random.unit().into(), random.unit().into()]
}

/// Whether the triangle of these corners is met by a direction from the origin.
fn meets([a, b, c]: [DVec3; 3], w: DVec3) -> bool {
    let sides = [a.cross(b).dot(w), b.cross(c).dot(w), c.cross(a).dot(w)];
    let normal = (b - a).cross(c - a);
    (sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0)) && normal.dot(a) * normal.dot(w) > 0.0
}

fn triangle(corners: [Vec3; 3]) -> (SurfaceSampler, [DVec3; 3]) {
    (SurfaceSampler::triangles(vec![corners]), corners.map(|p| p.as_dvec3()))
}

fn sheet(corner: Vec3, u: Vec3, v: Vec3) -> (SurfaceSampler, [DVec3; 4]) {
    let corners = [corner, corner + u, corner + u + v, corner + v].map(|p| p.as_dvec3());
    (Parallelogram { corner, u, v }.sampler(), corners)
}

/// The solid angle of a triangle, by L'Huilier's theorem from the angles between its corners. Thin triangles lose
/// digits.
fn solid_angle_by_sides(corners: [DVec3; 3]) -> f64 {
    let [a, b, c] = corners.map(|p| p.normalize());
    let angle = |p: DVec3, q: DVec3| 2.0 * (p - q).length().atan2((p + q).length());
    let sides = [angle(a, b), angle(b, c), angle(c, a)];
    let half = 0.5 * sides.iter().sum::<f64>();
    let tans = sides.iter().map(|side| (0.5 * (half - side)).tan().max(0.0)).product::<f64>();
    4.0 * ((0.5 * half).tan().abs() * tans).sqrt().atan()
}

/// The solid angle of a triangle (Van Oosterom & Strackee 1983).
fn solid_angle(corners: [DVec3; 3]) -> f64 {
    let [a, b, c] = corners.map(|p| p.normalize());
    let volume = a.dot((b - a).cross(c - a)).abs();
    2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

fn gallery() -> Vec<Seen<'static>> {
    let mut all: Vec<Seen> = Vec::new();
    for (name, corners) in [
        ("triangle", [Vec3::new(-0.3, 0.2, 1.0), Vec3::new(0.8, 0.1, 1.4), Vec3::new(0.1, 0.9, 0.8)]),
        ("wide triangle", [Vec3::new(-4.0, -3.0, 0.3), Vec3::new(5.0, -2.0, 0.4), Vec3::new(0.5, 6.0, 0.2)]),
        ("long triangle", [Vec3::new(-3.0, 0.3, 0.5), Vec3::new(9.0, 0.4, 0.6), Vec3::new(0.1, 0.45, 0.55)]),
        ("triangle behind", [Vec3::new(-1.0, -1.2, -0.7), Vec3::new(1.0, -0.3, -0.9), Vec3::new(0.0, 1.4, -1.1)]),
    ] {
        let (sampler, corners) = triangle(corners);
        all.push((name, sampler, Box::new(move |w| meets(corners, w))));
    }
    for (name, corner, u, v) in [
        ("rectangle", Vec3::new(-0.5, -0.6, 1.0), Vec3::X * 1.7, Vec3::Y * 0.9),
        ("rectangle aside", Vec3::new(2.0, 1.0, 0.5), Vec3::Y * 1.5, Vec3::new(2.0, 0.0, 1.0)),
        ("large rectangle", Vec3::new(-30.0, -20.0, 0.2), Vec3::X * 50.0, Vec3::Y * 45.0),
        ("rectangle behind", Vec3::new(-1.0, -0.2, -1.0), Vec3::Z * 1.5, Vec3::Y * 0.9),
        ("parallelogram", Vec3::new(-0.5, -0.6, 1.0), Vec3::new(1.5, 0.2, 0.3), Vec3::new(0.9, 0.8, 0.0)),
    ] {
        let (sampler, [a, b, c, d]) = sheet(corner, u, v);
        all.push((name, sampler, Box::new(move |w| meets([a, b, c], w) || meets([a, c, d], w))));
    }
    for (name, center, normal, radius) in [
        ("disk", Vec3::new(0.3, -0.2, 1.0), Vec3::new(0.2, 0.5, 1.0), 2.2),
        ("disk on its axis", Vec3::new(0.4, 0.8, 0.8), Vec3::new(0.4, 0.8, 0.8), 4.0),
        ("grazing disk", Vec3::new(1.5, 0.4, -0.2), Vec3::new(0.1, 0.1, 1.0), 1.2),
        ("disk under its rim", Vec3::new(0.7, 0.7, 0.05), Vec3::NEG_Z, 0.98),
        ("large disk", Vec3::new(5.0, 20.0, 0.3), Vec3::Z, 40.0),
    ] {
        let disk = Disk { center, normal, radius };
        let met = move |w: DVec3| {
            let (center, normal) = (center.as_dvec3(), normal.as_dvec3());
            let t = normal.dot(center) / normal.dot(w);
            t > 0.0 && (w * t - center).length() < f64::from(radius)
        };
        all.push((name, Shape::Disk(disk).sampler().unwrap(), Box::new(met)));
    }
    for (name, min, max) in [
        ("box", Vec3::new(0.5, 0.3, 0.4), Vec3::new(1.0, 1.5, 0.9)),
        ("box ahead", Vec3::new(0.5, -0.3, -0.4), Vec3::new(1.0, 0.5, 0.2)),
        ("box around", Vec3::new(-0.5, -0.3, -0.4), Vec3::new(1.0, 0.5, 2.0)),
    ] {
        let slabs = move |w: DVec3| {
            let (a, b) = (min.as_dvec3() / w, max.as_dvec3() / w);
            let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
            far > 0.0 && near < far
        };
        all.push((name, Shape::Box(Cuboid { min, max }).sampler().unwrap(), Box::new(slabs)));
    }
    for (name, center, radius) in [
        ("sphere", Vec3::new(0.5, 1.0, -0.3), 0.6f32),
        ("near sphere", Vec3::new(0.5, 0.0, 0.4), 0.6),
        ("sphere around", Vec3::new(0.2, 0.3, 0.1), 0.6),
    ] {
        let (c, r) = (center.as_dvec3(), f64::from(radius));
        let met = move |w: DVec3| c.length() < r || c.dot(w) > 0.0 && c.reject_from(w).length() < r;
        all.push((name, Shape::Sphere(Sphere { center, radius }).sampler().unwrap(), Box::new(met)));
    }
    all
}

const ROWS: u32 = 12;
const COLUMNS: u32 = 24;

/// The cell of a grid of equal solid angles. Its axis is aslant to all surfaces.
fn cell(w: DVec3) -> usize {
    let (x, y, z) = axes();
    let row = ((1.0 - w.dot(z)) * 0.5 * f64::from(ROWS)) as u32;
    let turn = w.dot(y).atan2(w.dot(x)).rem_euclid(TAU) / TAU;
    (row.min(ROWS - 1) * COLUMNS + ((turn * f64::from(COLUMNS)) as u32).min(COLUMNS - 1)) as usize
}

fn axes() -> (DVec3, DVec3, DVec3) {
    let z = DVec3::new(0.3, 0.5, 0.8).normalize();
    let (x, y) = z.any_orthonormal_pair();
    (x, y, z)
}

/// Directions to random points fall into cells of directions as often as the surface covers them (χ²), and the density
/// is 1 over the solid angle that the surface covers.
#[test]
fn directions_are_uniform_over_the_solid_angle() {
    let mut random = Random(21);
    let fine = 140;
    let mut near = gallery();
    near.retain(|(_, sampler, _)| sampler.flat().is_none_or(|flat| !flat.is_far(DVec3::ZERO)));
    assert!(near.len() >= 15, "{}", near.len());
    for (name, sampler, met) in near {
        let mut covered = vec![0.0; (ROWS * COLUMNS) as usize];
        let (x, y, z) = axes();
        let part = 4.0 * PI / f64::from(ROWS * COLUMNS * fine * fine);
        for (i, j) in (0..ROWS * fine).flat_map(|i| (0..COLUMNS * fine).map(move |j| (i, j))) {
            let cos = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(ROWS * fine);
            let (s, c) = (TAU * (f64::from(j) + 0.5) / f64::from(COLUMNS * fine)).sin_cos();
            let w = z * cos + (x * c + y * s) * (1.0 - cos * cos).sqrt();
            covered[(i / fine * COLUMNS + j / fine) as usize] += if met(w) { part } else { 0.0 };
        }
        let total: f64 = covered.iter().sum();
        let n = 200_000;
        let mut counts = vec![0.0; covered.len()];
        for _ in 0..n {
            let SurfaceSample { point, normal, pdf } = sampler.sample_from(DVec3::ZERO, uniform(&mut random)).unwrap();
            assert!((pdf * total - 1.0).abs() < 4e-3, "{name}: density {pdf}, solid angle {total}");
            let again = sampler.pdf_from(DVec3::ZERO, point, normal);
            assert!((again / pdf - 1.0).abs() < 1e-9, "{name}: {again} is not {pdf}");
            counts[cell(point.normalize())] += 1.0;
        }
        let (mut chi2, mut cells) = (0.0f64, 0.0f64);
        for (count, covered) in counts.iter().zip(&covered) {
            let expected = covered / total * f64::from(n);
            if expected > 50.0 {
                (chi2, cells) = (chi2 + (count - expected) * (count - expected) / expected, cells + 1.0);
            }
        }
        println!("{name}: χ² {chi2:.1} of {cells} cells");
        assert!(chi2 < cells + 5.0 * (2.0 * cells).sqrt(), "{name}: χ² {chi2} of {cells} cells");
    }
}

/// Parts of the square map to parts of equal solid angle, also for needles and for points that nearly touch.
#[test]
fn parts_of_the_square_are_parts_of_the_solid_angle() {
    let mut random = Random(22);
    let (mut by_solid_angle, mut worst) = (0, 0.0f64);
    for i in 0..20_000 {
        let far = 10f64.powf(f64::from(random.within(-4.0, 3.0)));
        let thin = 10f64.powf(f64::from(random.within(-4.0, 0.0)));
        let p = |random: &mut Random| random.cube().as_dvec3();
        let (mut a, along) = (p(&mut random), p(&mut random));
        a.z = far;
        let [u, v] = uniform(&mut random);
        let (parts, exact) = if i % 2 == 0 {
            let corners = [a, a + along, a + along * f64::from(random.unit()) + p(&mut random) * thin];
            let Some(seen) = SphericalTriangle::new(corners) else { continue };
            let exact = solid_angle(corners);
            if thin > 0.1 && exact > 1e-6 {
                let other = solid_angle_by_sides(corners);
                assert!((seen.solid_angle() / other - 1.0).abs() < 1e-3, "{corners:?}: {other}");
            }
            let third = seen.sample([u, 1.0]);
            let part = solid_angle([corners[0], corners[1], third]) / exact;
            // From the second corner on, equal parts are equal parts of the versine.
            let b = corners[1].normalize();
            let versine = |w: DVec3| 0.5 * (w - b).length_squared();
            ([part - u, versine(seen.sample([u, v])) / versine(third) - v], [seen.solid_angle(), exact])
        } else {
            let x = [a.x, a.x + f64::from(random.within(0.01, 1.0))];
            let y = [a.y, a.y + f64::from(random.within(0.01, 1.0)) * thin];
            let Some(seen) = SphericalRectangle::new(x, y, far) else { continue };
            let at = |x: f64, y: f64| DVec3::new(x, y, far);
            let of = |x: [f64; 2], y: [f64; 2]| {
                solid_angle([at(x[0], y[0]), at(x[1], y[0]), at(x[1], y[1])])
                    + solid_angle([at(x[0], y[0]), at(x[1], y[1]), at(x[0], y[1])])
            };
            let exact = of(x, y);
            let [share, up] = seen.sample([u, v]);
            let across = x[0] + share * (x[1] - x[0]);
            let part = of([x[0], across], y) / exact;
            // On a thin strip at x, equal parts are equal parts of the sine of the elevation.
            let sine = |y: f64| y / at(across, y).length();
            let strip = (sine(y[0] + up * (y[1] - y[0])) - sine(y[0])) / (sine(y[1]) - sine(y[0]));
            ([part - u, strip - v], [seen.solid_angle(), exact])
        };
        let error = parts.iter().fold((exact[0] / exact[1] - 1.0).abs(), |error, part| error.max(part.abs()));
        assert!(error < 1e-6, "{parts:?} of {exact:?}");
        (by_solid_angle, worst) = (by_solid_angle + 1, worst.max(error));
    }
    println!("{by_solid_angle} by solid angle, worst {worst:e}");
    assert!(by_solid_angle > 15_000);
}

/// The solid angle of a disk of radius 1 in the plane at distance h. Its centre is at distance y from the foot of the
/// perpendicular. The sum runs over azimuths around the foot, for which the cosine's integral has a closed form.
fn solid_angle_of_disk(h: f64, y: f64) -> f64 {
    let n = 20_000;
    let mean =
        |f: &dyn Fn(f64) -> f64| (0..n).map(|i| f((f64::from(i) + 0.5) / f64::from(n))).sum::<f64>() / f64::from(n);
    if y < 1.0 {
        TAU * mean(&|x| {
            let (sin, cos) = (TAU * x).sin_cos();
            let rim = y * cos + (1.0 - y * y * sin * sin).sqrt();
            let length = (h * h + rim * rim).sqrt();
            rim * rim / (length * (length + h))
        })
    } else {
        // The sine of the azimuth is sin s / y.
        PI * mean(&|x| {
            let half_chord = (PI * (x - 0.5)).cos();
            let cos = ((y - 1.0) * (y + 1.0) + half_chord * half_chord).sqrt() / y;
            let [near, far] = [y * cos - half_chord, y * cos + half_chord].map(|rim| (h * h + rim * rim).sqrt());
            let difference = 4.0 * y * cos * half_chord / (near * far * (near + far));
            h * difference * half_chord / (y * cos)
        })
    }
}

/// Places from which a disk of radius 1 is seen: the distance of its plane, and that of its centre along it.
const VIEWS: [[f64; 2]; 18] = [
    [1.0, 0.0],
    [0.01, 0.0],
    [100.0, 0.0],
    [1.0, 0.4],
    [0.3, 0.9],
    [0.01, 0.5],
    [0.01, 0.99],
    [0.01, 1.01],
    [0.001, 1.0],
    [1e-4, 1.001],
    [0.1, 1.5],
    [0.5, 3.0],
    [1e-3, 1.7],
    [1e-4, 2.0],
    [10.0, 7.0],
    [1.0, 30.0],
    [60.0, 80.0],
    [90.0, 1e-9],
];

/// The solid angle of a disk is right wherever it is seen from.
#[test]
fn solid_angles_of_disks_are_exact() {
    for d in [0.01, 0.1, 1.0, 7.0, 100.0f64] {
        // 1 - d / √(d² + r²) without cancellation, of the disk of radius 2.
        let slant = (d * d + 4.0).sqrt();
        let exact = TAU * 4.0 / (slant * (slant + d));
        let own = SphericalEllipse::new(d, 0.0, 2.0).unwrap().solid_angle();
        assert!((own / exact - 1.0).abs() < 1e-12, "on the axis at {d}: {own} instead of {exact}");
    }
    let mut worst = 0.0f64;
    for [h, y] in VIEWS {
        let own = SphericalEllipse::new(3.0 * h, 3.0 * y, 3.0).unwrap().solid_angle();
        let exact = solid_angle_of_disk(h, y);
        worst = worst.max((own / exact - 1.0).abs());
        assert!((own / exact - 1.0).abs() < 1e-11, "{h}, {y}: {own} instead of {exact}");
    }
    println!("worst {worst:e}");
    for [h, y] in [[0.0, 0.0], [0.0, 2.0], [1e-9, 0.3], [1e-7, 5.0], [1e4, 0.0], [f64::INFINITY, 1.0], [f64::NAN, 1.0]]
    {
        assert!(SphericalEllipse::new(h, y, 1.0).is_none(), "{h}, {y}");
    }
}

/// Equal squares of the unit square become equal solid angles of a disk: the areas within their images on the sphere of
/// directions.
#[test]
fn squares_become_equal_parts_of_a_disk() {
    let (cells, sides) = (6, 100);
    for [h, y] in VIEWS {
        let seen = SphericalEllipse::new(h, y, 1.0).unwrap();
        let direction = |u: [f64; 2]| {
            let [across, away] = seen.sample(u);
            assert!(across * across + away * away < 1.0 + 1e-9, "{h}, {y}: {across}, {away}");
            DVec3::new(across, y + away, h).normalize()
        };
        let mut worst = 0.0f64;
        for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
            let at = |x: f64, y: f64| {
                direction([(f64::from(i) + x) / f64::from(cells), (f64::from(j) + y) / f64::from(cells)])
            };
            let rim: Vec<DVec3> = (0..4 * sides)
                .map(|k| {
                    let along = f64::from(k % sides) / f64::from(sides);
                    match k / sides {
                        0 => at(along, 0.0),
                        1 => at(1.0, along),
                        2 => at(1.0 - along, 1.0),
                        _ => at(0.0, 1.0 - along),
                    }
                })
                .collect();
            // Signed triangles around the middle.
            let a = at(0.5, 0.5);
            let part =
                |b: DVec3, c: DVec3| 2.0 * a.dot((b - a).cross(c - a)).atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
            let area: f64 = (0..rim.len()).map(|k| part(rim[k], rim[(k + 1) % rim.len()])).sum();
            let share = area.abs() * f64::from(cells * cells) / seen.solid_angle();
            worst = worst.max((share - 1.0).abs());
        }
        println!("{h}, {y}: {worst:e}");
        // Chords instead of curves cost 1e-5.
        assert!(worst < 3e-5, "{h}, {y}: off by {worst}");
    }
}

/// A disk that is far away, nearly edge-on or about touched is sampled by area. The density knows that.
#[test]
fn disks_of_no_usable_solid_angle_are_sampled_by_area() {
    let mut random = Random(25);
    let disk = Disk { center: Vec3::new(0.3, 0.7, -0.2), normal: Vec3::new(0.2, 0.9, 0.4), radius: 0.5 };
    let sampler = Shape::Disk(disk).sampler().unwrap();
    let normal = disk.normal.as_dvec3().normalize();
    let (x, _) = normal.any_orthonormal_pair();
    let mut by_area = 0;
    for _ in 0..20_000 {
        let [height, offset] = [-10.0, -4.0].map(|least| 0.5 * 10f64.powf(f64::from(random.within(least, 4.0))));
        let p = disk.center.as_dvec3() + x * offset + normal * height;
        let Some(sample) = sampler.sample_from(p, uniform(&mut random)) else { continue };
        let again = sampler.pdf_from(p, sample.point, sample.normal);
        assert!((again / sample.pdf - 1.0).abs() < 1e-12, "{height}, {offset}: {again} is not {sample:?}");
        let cos_over_distance2 = sample.normal.dot(p - sample.point) / p.distance(sample.point).powi(3);
        by_area += u32::from((sample.pdf * cos_over_distance2 * sampler.area() - 1.0).abs() < 1e-12);
    }
    println!("{by_area} by area");
    assert!((5_000..15_000).contains(&by_area), "{by_area} by area");
}

/// A point never sees the averted faces of a box, and a surface without a solid angle isn't sampled.
#[test]
fn averted_faces_are_never_chosen() {
    let cuboid = Shape::Box(Cuboid { min: Vec3::ZERO, max: Vec3::new(1.0, 2.0, 3.0) }).sampler().unwrap();
    let mut random = Random(23);
    for p in [DVec3::new(2.0, 1.0, 1.0), DVec3::new(-1.0, 3.0, 4.0), DVec3::new(1e6, 1.0, -1e6), DVec3::splat(1e9)] {
        for _ in 0..500 {
            let sample = cuboid.sample_from(p, uniform(&mut random)).unwrap();
            assert!(sample.normal.dot(p - sample.point) > 0.0, "{p}: {sample:?}");
            let again = cuboid.pdf_from(p, sample.point, sample.normal);
            assert!((again / sample.pdf - 1.0).abs() < 1e-9, "{p}: {again} is not {sample:?}");
        }
    }
    assert_eq!(cuboid.pdf_from(DVec3::new(2.0, 1.0, 1.0), DVec3::new(0.0, 1.0, 1.0), DVec3::NEG_X), 0.0);
    let (sheet, _) = sheet(Vec3::ZERO, Vec3::X, Vec3::Y);
    assert!(sheet.sample_from(DVec3::new(3.0, 0.5, 0.0), [0.3, 0.6]).is_none(), "edge-on");
    let (needle, _) = triangle([Vec3::ZERO, Vec3::X, Vec3::new(0.5, 1e-12, 0.0)]);
    let sample = needle.sample_from(DVec3::Z, [0.3, 0.6]).unwrap();
    assert_eq!(sample.pdf, needle.pdf_from(DVec3::Z, sample.point, sample.normal), "{sample:?}");
}

/// A scene scaled by a power of two has the same samples.
#[test]
fn the_unit_of_length_changes_no_bit() {
    let mut random = Random(24);
    let disk = |form: &DiskForm, scale: f32| {
        let [center, normal] = [form.center, form.normal].map(|v| v.as_vec3());
        let disk = Disk { center: center * scale, normal, radius: form.radius as f32 * scale };
        Shape::Disk(disk).sampler().unwrap()
    };
    for (name, mut sampler, _) in gallery() {
        let scale = 1024.0;
        if let Form::Flat(_, Near::Disk(form)) = &sampler.form {
            // With the same normal, rounded once more.
            sampler = disk(form, 1.0);
        }
        let larger = match &sampler.form {
            Form::Flat(_, Near::Triangle(corners)) => SurfaceSampler::triangles(vec![corners.map(|p| p * scale)]),
            Form::Flat(flat, Near::Parallelogram) => {
                let [u, v] = flat.edges;
                let [corner, u, v] = [flat.origin, u, v].map(|v| v.as_vec3() * scale);
                Parallelogram { corner, u, v }.sampler()
            }
            Form::Box(Cuboid { min, max }, _) => {
                Shape::Box(Cuboid { min: *min * scale, max: *max * scale }).sampler().unwrap()
            }
            Form::Flat(_, Near::Disk(form)) => disk(form, scale),
            Form::Sphere(center, radius) => {
                let (center, radius) = (center.as_vec3() * scale, *radius as f32 * scale);
                Shape::Sphere(Sphere { center, radius }).sampler().unwrap()
            }
            other => panic!("{other:?}"),
        };
        for _ in 0..50 {
            let (p, u) = (random.cube().as_dvec3() * 0.1, uniform(&mut random));
            let [a, b] = [sampler.sample_from(p, u), larger.sample_from(p * f64::from(scale), u)];
            let a = a.map(|a| (a.point * f64::from(scale), a.normal, a.pdf));
            assert_eq!(a, b.map(|b| (b.point, b.normal, b.pdf)), "{name}");
        }
    }
}
