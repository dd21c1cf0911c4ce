//! What is said of coordinates whose steps in `f32` can be seen.

use super::lines::ImportError;
use super::positions::Bounds;
use canaletto::shape::Mesh;
use glam::{DVec3, Vec3};

/// The steps of coordinates can be seen in what is smaller than so many of them.
const VISIBLE: f32 = 16.0;
/// Single precision is told if the largest coordinate is so many times the size of the whole: its steps are 2⁻¹³ of that.
const FAR: f64 = 1024.0;
/// At most so many parts are looked at.
const LOOKED_AT: usize = 4096;
/// Steps are told if one in so many parts is too small for them.
const FEW: usize = 16;

/// How coordinates came to be `f32`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Precision {
    /// The file holds `f32`.
    Single,
    /// The file holds more digits, which are counted from an origin.
    Double,
}

/// The distance of `f32` numbers as large as the largest coordinate.
fn step(p: Vec3) -> f32 {
    let most = p.abs().max_element();
    most.next_up() - most
}

/// What is said of a mesh.
pub(super) fn mesh(mesh: &Mesh, precision: Precision) -> Option<ImportError> {
    let parts = mesh.triangles.iter().step_by(mesh.len() / LOOKED_AT + 1).filter_map(|corners| {
        let [a, b, c] = corners.map(|v| mesh.positions[v as usize]);
        let longest = (b - a).abs().max((c - b).abs()).max((a - c).abs()).max_element();
        // What has no size has none at any precision.
        (longest > 0.0).then(|| (a.abs().max(b.abs()).max(c.abs()), longest))
    });
    complaint("triangles", parts, &mesh.positions, mesh.origin, precision)
}

/// What is said of a cloud of these points, whose radii are one for all or one for each `points_of_one` of them.
pub(super) fn cloud(
    points: &[Vec3],
    points_of_one: usize,
    radii: &[f32],
    origin: DVec3,
    precision: Precision,
) -> Option<ImportError> {
    let radius = |i: usize| if radii.len() == 1 { radii.first() } else { radii.get(i) };
    let count = points.len() / points_of_one;
    let parts = (0..count)
        .step_by(count / LOOKED_AT + 1)
        .filter_map(|i| radius(i).map(|radius| (points[points_of_one * i].abs(), *radius)));
    complaint("radii", parts, points, origin, precision)
}

/// What is said of a cloud whose numbers stand in the scene, and how that is helped.
pub(crate) fn inline_cloud(points: &[Vec3], points_of_one: usize, radii: &[f32], origin: DVec3) -> Option<[String; 2]> {
    let said = cloud(points, points_of_one, radii, origin, Precision::Double)?;
    Some([said.message, said.help.unwrap_or_default()])
}

/// What is said of parts, each with a place and a size.
fn complaint(
    what: &str,
    parts: impl Iterator<Item = (Vec3, f32)>,
    points: &[Vec3],
    origin: DVec3,
    precision: Precision,
) -> Option<ImportError> {
    let (mut all, mut small) = (0, 0);
    for (place, size) in parts {
        all += 1;
        small += usize::from(size < VISIBLE * step(place));
    }
    let many = small > all / FEW;
    // Where much lies at one place there is nothing to see.
    let far = |bounds: &Bounds| precision == Precision::Single && bounds.size() > 0.0 && bounds.is_far(FAR);
    let bounds = Bounds::of(points);
    if !many && !far(&bounds) {
        return None;
    }
    let most = bounds.largest() as f32;
    let step = most.next_up() - most;
    let small = if many {
        format!("; {small} of {all} {what} looked at are smaller than {VISIBLE} steps")
    } else {
        String::new()
    };
    Some(match precision {
        Precision::Single => {
            let message = format!("its coordinates are single precision, which at {most} has steps of {step}{small}");
            let help = "the program that wrote it can write more digits (`double`), or move it near the origin";
            ImportError::file(message).help(help)
        }
        Precision::Double => {
            let from = if origin == DVec3::ZERO { String::new() } else { format!(" from {origin}") };
            let message = format!(
                "its coordinates are rounded to single precision, which at a distance of {most}{from} has steps of {step}{small}"
            );
            ImportError::file(message)
                .help("leave out what lies far from the rest, or put parts that lie far apart into files of their own")
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of squares of this size from a place on.
    fn strip(from: Vec3, size: f32, count: u32) -> Mesh {
        let at = |i: u32| from + Vec3::new((i / 2) as f32, (i % 2) as f32, 0.0) * size;
        let triangles = (0..2 * count).map(|i| [i, i + 1, i + 2]).collect();
        Mesh { positions: (0..2 * count + 2).map(at).collect(), triangles, ..Mesh::default() }
    }

    #[test]
    fn small_triangles_far_away_are_told() {
        let told = |mesh_: &Mesh, precision| mesh(mesh_, precision).map(|c| c.message);
        let far = Vec3::new(3e6, 0.0, 0.0);
        // As long as it is far away, so that its size as a whole is no reason.
        let message = told(&strip(far, 2.0, 100_000), Precision::Single).expect("steps of a quarter");
        assert!(message.contains("steps of 0.25") && message.contains("smaller than 16 steps"), "{message}");
        assert!(told(&strip(far, 2.0, 100_000), Precision::Double).is_some_and(|m| m.contains("rounded")));
        assert_eq!(told(&strip(far, 20.0, 10_000), Precision::Single), None);
        assert_eq!(told(&strip(Vec3::ZERO, 1e-3, 100_000), Precision::Single), None);
        assert_eq!(told(&strip(Vec3::splat(1e-30), 1e-34, 100_000), Precision::Single), None);
    }

    #[test]
    fn small_radii_far_away_are_told() {
        let points: Vec<Vec3> = (0..10_000).map(|i| Vec3::new(3e6 + 10.0 * i as f32, 0.0, 0.0)).collect();
        let told = |radii: &[f32]| cloud(&points, 1, radii, DVec3::ZERO, Precision::Single).map(|c| c.message);
        assert!(told(&[1.0]).is_some_and(|m| m.contains("steps of 0.25") && m.contains("radii")), "{:?}", told(&[1.0]));
        assert_eq!(told(&[10.0]), None);
        let mut radii = vec![10.0; 10_000];
        assert_eq!(told(&radii), None);
        radii[5000..].fill(0.1);
        assert!(told(&radii).is_some());
        assert!(cloud(&points, 2, &radii[..5000], DVec3::ZERO, Precision::Single).is_none());
    }
}
