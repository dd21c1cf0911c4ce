use super::super::{Cuboid, Sphere};
use super::*;
use std::collections::HashMap;

const LIMIT: usize = 1 << 20;

fn ball() -> Shape {
    Shape::Sphere(Sphere { center: Vec3::new(0.3, -0.2, 0.1), radius: 1.0 })
}

fn cube() -> Shape {
    Shape::Box(Cuboid { min: Vec3::splat(-0.5), max: Vec3::new(0.5, 0.7, 0.9) })
}

fn can(top_radius: f32) -> Shape {
    Shape::Cone(Cone {
        base: Vec3::new(0.1, -1.0, 0.0),
        top: Vec3::new(0.3, 1.0, 0.2),
        radius: 0.6,
        top_radius,
        caps: true,
    })
}

fn closed() -> [Shape; 4] {
    [ball(), cube(), can(0.4), can(0.0)]
}

/// A height with abrupt peaks, different on the two sides of every seam of uv.
fn rough(v: &Vertex) -> f64 {
    0.1 * v.uv.x + 0.05 * libm::sin(20.0 * v.uv.y) * libm::cos(17.0 * v.uv.x)
}

/// Whether every edge, by the places of its ends, occurs once in each direction.
fn is_closed(mesh: &Mesh) -> bool {
    let mut edges: HashMap<([u32; 3], [u32; 3]), i32> = HashMap::new();
    let bits = |v: u32| (mesh.positions[v as usize] + 0.0).to_array().map(f32::to_bits);
    for &[a, b, c] in &mesh.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let (from, to) = (bits(from), bits(to));
            if from != to {
                *edges.entry((from.min(to), from.max(to))).or_default() += if from < to { 1 } else { -1 };
            }
        }
    }
    edges.values().all(|n| *n == 0)
}

fn volume(mesh: &Mesh) -> f64 {
    let corner = |v: u32| mesh.positions[v as usize].as_dvec3();
    mesh.triangles.iter().map(|&[a, b, c]| corner(a).dot(corner(b).cross(corner(c))) / 6.0).sum()
}

#[test]
fn nothing_cracks() {
    for shape in closed() {
        for height in [&|_: &Vertex| 0.0_f64, &rough as &(dyn Fn(&Vertex) -> f64 + Sync)] {
            let mesh = BaseMesh::of_shape(&shape).unwrap().raised(60.0, LIMIT, height).unwrap();
            mesh.check().unwrap();
            assert!(is_closed(&mesh), "{}: {} triangles", shape.kind(), mesh.len());
            assert!(volume(&mesh) > 0.0, "{} is inside out", shape.kind());
        }
    }
}

#[test]
fn without_height_it_is_the_shape() {
    for shape in closed() {
        let mesh = BaseMesh::of_shape(&shape).unwrap().raised(100.0, LIMIT, &|_| 0.0).unwrap();
        for (p, uv) in mesh.positions.iter().zip(&mesh.uvs) {
            let d = crate::shape::testing::distance(&shape, p.as_dvec3());
            assert!(d.abs() < 1e-6, "{}: {p} is {d} away", shape.kind());
            assert!(uv.is_finite());
        }
        if let Shape::Sphere(s) = shape {
            let exact = 4.0 / 3.0 * PI * f64::from(s.radius).powi(3);
            assert!((volume(&mesh) / exact - 1.0).abs() < 0.01, "{}", volume(&mesh));
            for (p, uv) in mesh.positions.iter().zip(&mesh.uvs) {
                let d = (p.as_dvec3() - s.center.as_dvec3()).normalize();
                assert!((f64::from(uv.y) - libm::acos(d.y.clamp(-1.0, 1.0)) / PI).abs() < 1e-3, "{p} {uv}");
            }
        }
    }
}

#[test]
fn a_height_moves_the_surface_by_it() {
    let mesh = BaseMesh::of_shape(&ball()).unwrap().raised(50.0, LIMIT, &|_| 0.25).unwrap();
    let Shape::Sphere(s) = ball() else { panic!() };
    for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
        let out = p.as_dvec3() - s.center.as_dvec3();
        assert!((out.length() - 1.25).abs() < 1e-6);
        assert!(n.as_dvec3().dot(out.normalize()) > 0.99);
    }
}

#[test]
fn it_is_fine_only_where_it_must_be() {
    let flat = BaseMesh::of_shape(&cube()).unwrap().raised(200.0, LIMIT, &|_| 0.0).unwrap();
    // A bump on one face.
    let bump = |v: &Vertex| {
        if v.normal == DVec3::X { 0.1 * libm::exp(-60.0 * v.uv.distance_squared(DVec2::splat(0.5))) } else { 0.0 }
    };
    let bumped = BaseMesh::of_shape(&cube()).unwrap().raised(200.0, LIMIT, &bump).unwrap();
    let even = BaseMesh::of_shape(&cube())
        .unwrap()
        .raised(200.0, LIMIT, &|v| 0.1 * libm::sin(400.0 * (v.uv.x + v.uv.y)))
        .unwrap();
    assert!(
        flat.len() < bumped.len() && bumped.len() * 4 < even.len(),
        "{} {} {}",
        flat.len(),
        bumped.len(),
        even.len()
    );
}

#[test]
fn explosions_are_told() {
    let wild = |v: &Vertex| libm::sin(1e7 * v.uv.x) * libm::cos(1e7 * v.uv.y);
    assert_eq!(BaseMesh::of_shape(&ball()).unwrap().raised(4096.0, 10_000, &wild).unwrap_err(), DisplaceError::TooMany);
    assert_eq!(BaseMesh::of_shape(&cube()).unwrap().raised(20.0, LIMIT, &|_| 1e39).unwrap_err(), DisplaceError::TooFar);
    assert_eq!(
        BaseMesh::of_shape(&cube()).unwrap().raised(20.0, LIMIT, &|_| f64::NAN).unwrap_err(),
        DisplaceError::TooFar
    );
}

/// A height that is wild everywhere.
fn wild(v: &Vertex) -> f64 {
    0.2 * libm::sin(3000.0 * (v.point.x + 2.0 * v.point.y))
}

fn wild_at_a_pole(v: &Vertex) -> f64 {
    if v.point.y > 0.9 { wild(v) } else { 0.0 }
}

#[test]
fn what_fits_is_never_refused_and_one_triangle_less_is() {
    for height in [wild, wild_at_a_pole, rough] {
        for shape in [ball(), cube()] {
            let raised = |limit: usize| BaseMesh::of_shape(&shape).unwrap().raised(150.0, limit, &height);
            let count = raised(usize::MAX).unwrap().len();
            assert_eq!(raised(count).unwrap().len(), count);
            assert_eq!(raised(count - 1).unwrap_err(), DisplaceError::TooMany);
        }
    }
}

#[test]
fn far_too_many_are_refused_before_they_are_made() {
    use std::sync::atomic::{AtomicUsize, Ordering};
    for detail in [4096.0, 65_536.0, 1e9] {
        let asked = AtomicUsize::new(0);
        let counted = |v: &Vertex| {
            asked.fetch_add(1, Ordering::Relaxed);
            wild(v)
        };
        let limit = 1 << 21;
        assert_eq!(
            BaseMesh::of_shape(&ball()).unwrap().raised(detail, limit, &counted).unwrap_err(),
            DisplaceError::TooMany
        );
        // The height is evaluated once for each vertex, and at most three times for each edge.
        let asked = asked.into_inner();
        assert!(asked < limit, "{asked}");
    }
}

#[test]
fn a_seam_of_a_mesh_stays_closed() {
    // Two triangles that share an edge, with different texture coordinates on its sides.
    let mesh = Mesh {
        positions: [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
            .map(|[x, y]| Vec3::new(x, y, 0.0))
            .to_vec(),
        uvs: [[0.0, 0.0], [0.4, 0.0], [0.0, 0.4], [0.9, 0.5], [0.9, 0.9], [0.5, 0.9]].map(Vec2::from).to_vec(),
        triangles: vec![[0, 1, 2], [3, 4, 5]],
        ..Mesh::default()
    };
    let raised = BaseMesh::of_mesh(mesh).raised(64.0, LIMIT, &rough).unwrap();
    let mut border = HashMap::new();
    let bits = |v: u32| raised.positions[v as usize].to_array().map(f32::to_bits);
    for &[a, b, c] in &raised.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let (from, to) = (bits(from), bits(to));
            *border.entry((from.min(to), from.max(to))).or_insert(0) += 1;
        }
    }
    // Open edges lie on the square's border, none on the diagonal.
    let open = border.iter().filter(|(_, n)| **n == 1).map(|((a, b), _)| [a, b].map(|p| p.map(f32::from_bits)));
    for [a, b] in open {
        let side = |axis: usize, at: f32| (a[axis] - at).abs() < 1e-6 && (b[axis] - at).abs() < 1e-6;
        assert!(side(0, 0.0) || side(0, 1.0) || side(1, 0.0) || side(1, 1.0), "a crack from {a:?} to {b:?}");
    }
}
