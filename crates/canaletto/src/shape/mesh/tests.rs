use super::*;
use canaletto_bvh::Ray;

/// A tent of two triangles over the x axis, with a ridge normal straight up.
fn tent() -> Mesh {
    Mesh {
        positions: vec![
            Vec3::new(0.0, 1.0, 0.0),
            Vec3::new(1.0, 1.0, 0.0),
            Vec3::new(0.0, 0.0, 1.0),
            Vec3::new(0.0, 0.0, -1.0),
        ],
        triangles: vec![[0, 2, 1], [0, 1, 3]],
        ..Mesh::default()
    }
}

fn down() -> Ray {
    Ray::new(Vec3::new(0.25, 5.0, 0.25), Vec3::NEG_Y)
}

#[test]
fn the_geometric_normal_is_the_windings() {
    let s = tent().surface(0, 0.25, 0.25);
    assert!(s.normal.as_vec3().distance(Vec3::new(0.0, 1.0, 1.0).normalize()) < 1e-7, "{s:?}");
    assert_eq!(s.shading_normal, s.normal);
    assert_eq!(s.shadow_origin, s.point);
    assert_eq!(s.uv, Vec2::splat(0.25));
}

#[test]
fn smooth_normals_shade_between_the_faces() {
    let mut mesh = tent();
    mesh.smooth_normals();
    assert!(mesh.normals[0].distance(Vec3::Y) < 1e-6, "{:?}", mesh.normals);
    let s = mesh.surface(0, 0.25, 0.25);
    let between = s.shading_normal.y;
    assert!(between > s.normal.y && between < 1.0, "{s:?}");
}

#[test]
fn smooth_normals_do_not_depend_on_the_cut() {
    // A cube's corner where one face is cut into one triangle and another into two: each counts by its angle.
    let corner = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(1.0, 1.0, 0.0)];
    let mut mesh =
        Mesh { positions: corner, triangles: vec![[0, 1, 4], [0, 4, 2], [0, 2, 3], [0, 3, 1]], ..Mesh::default() };
    mesh.smooth_normals();
    assert!(mesh.normals[0].distance(Vec3::ONE.normalize()) < 1e-6, "{:?}", mesh.normals[0]);
}

#[test]
fn inward_normals_are_turned_to_the_windings_side() {
    let mut mesh = tent();
    mesh.smooth_normals();
    let right = mesh.surface(0, 0.25, 0.25);
    mesh.normals.iter_mut().for_each(|n| *n = -*n);
    assert_eq!(mesh.surface(0, 0.25, 0.25), right);
}

#[test]
fn a_shading_normal_never_looks_backwards() {
    let mut mesh = tent();
    // One corner's normal is far on the other side.
    mesh.normals = vec![Vec3::Y, Vec3::Y, Vec3::new(0.0, -1.0, -0.5), Vec3::Y];
    for (u, v) in [(0.0, 0.0), (0.5, 0.25), (0.9, 0.05), (1.0, 0.0)] {
        let s = mesh.surface(0, u, v);
        assert!(s.shading_normal.dot(s.normal) > 0.0, "{u} {v}: {s:?}");
        assert!((s.shading_normal.length() - 1.0).abs() < 1e-6, "{s:?}");
    }
}

#[test]
fn lifted_points_lie_outside_and_vertices_stay() {
    let mut mesh = tent();
    mesh.smooth_normals();
    // The mesh is convex: normals at the corners diverge outwards.
    mesh.normals[2] = Vec3::Z;
    let s = mesh.surface(0, 0.4, 0.2);
    assert!((s.shadow_origin - s.point).dot(s.normal.as_vec3()) > 0.05, "{s:?}");
    assert_eq!(mesh.surface(0, 1.0, 0.0).shadow_origin, mesh.positions[2]);
}

#[test]
fn a_backward_normal_never_lifts_inwards() {
    let mut mesh = tent();
    mesh.normals = vec![Vec3::new(-1.0, -1.0, -0.1), Vec3::new(0.0, 1.0, 1.0), Vec3::new(0.0, 1.0, 1.0), Vec3::Y];
    for (u, v) in [(0.4, 0.2), (0.1, 0.8), (0.2, 0.2)] {
        let s = mesh.surface(0, u, v);
        assert!((s.shadow_origin - s.point).dot(s.normal.as_vec3()) >= 0.0, "{s:?}");
    }
}

#[test]
fn concave_normals_lift_nothing() {
    let mut mesh = tent();
    mesh.normals = vec![Vec3::new(0.0, 0.1, 1.0), Vec3::new(0.0, 0.1, 1.0), Vec3::new(0.0, 1.0, 0.1), Vec3::Y];
    let s = mesh.surface(0, 0.4, 0.2);
    assert_eq!(s.shadow_origin, s.point);
}

#[test]
fn uvs_and_colours_are_interpolated() {
    let mut mesh = tent();
    mesh.uvs = vec![Vec2::ZERO, Vec2::new(0.0, 8.0), Vec2::new(4.0, 0.0), Vec2::ZERO];
    mesh.colors = vec![Rgb::BLACK, Rgb::new(0.0, 8.0, 0.0), Rgb::new(4.0, 0.0, 0.0), Rgb::BLACK];
    let s = mesh.surface(0, 0.25, 0.5);
    assert_eq!(s.uv, Vec2::new(1.0, 4.0));
    assert_eq!(s.color, Some(Rgb::new(1.0, 4.0, 0.0)));
}

#[test]
fn one_sided_meshes_are_not_met_from_behind() {
    let mut mesh = tent();
    let up = Ray::new(Vec3::new(0.25, -5.0, 0.25), Vec3::Y).prepare();
    assert!(mesh.intersect_triangle(0, &up, f32::INFINITY, 0.0).is_some());
    mesh.one_sided = true;
    assert!(mesh.intersect_triangle(0, &up, f32::INFINITY, 0.0).is_none());
    assert!(mesh.intersect_triangle(0, &down().prepare(), f32::INFINITY, 0.0).is_some());
}

#[test]
fn reordering_takes_the_slots_along() {
    let mut mesh = Mesh { slots: vec![4, 7], ..tent() };
    mesh.reorder(&[1, 0]);
    assert_eq!((mesh.triangles, mesh.slots), (vec![[0, 1, 3], [0, 2, 1]], vec![7, 4]));
}

#[test]
fn broken_meshes_are_named() {
    let error = |change: fn(&mut Mesh)| {
        let mut mesh = tent();
        change(&mut mesh);
        mesh.check().unwrap_err().to_string()
    };
    assert!(tent().check().is_ok());
    assert_eq!(error(|m| m.triangles[1][2] = 4), "triangle 1 has vertex 4; there are 4, counted from 0");
    assert_eq!(error(|m| m.positions[3].y = f32::NAN), "vertex 3 is 0 NaN -1; each component must be finite");
    assert_eq!(
        error(|m| m.normals = vec![Vec3::Y; 3]),
        "there are 3 normals for 4 vertices; there must be none or one for each"
    );
    assert_eq!(error(|m| m.slots = vec![0, 1]), "triangle 1 has material slot 1; there are 1, counted from 0");
    assert_eq!(error(|m| m.normals = vec![Vec3::ZERO; 4]), "the normal of vertex 0 is 0 0 0; it must have a length");
}
