//! Warnings about coordinates whose `f32` rounding is visible.

use super::lines::ImportError;
use super::positions::Bounds;
use canaletto::shape::Mesh;
use glam::{DVec3, Vec3};

/// Rounding is visible in parts that are smaller than this many steps of their coordinates.
const VISIBLE: f32 = 16.0;
/// Single precision is reported if the largest coordinate is more than this multiple of the total size: a step is then
/// 2⁻¹³ of the size.
const FAR: f64 = 1024.0;
/// The approximate largest number of parts that are tested.
const LOOKED_AT: usize = 4096;
/// Rounding is reported if one in this many parts is too small for it.
const FEW: usize = 16;

/// The source of `f32` coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Precision {
    /// The file stores `f32`.
    Single,
    /// The file has more digits; the coordinates are offsets from an origin.
    Double,
}

/// The distance between adjacent `f32` numbers at the largest coordinate of `p`.
fn step(p: Vec3) -> f32 {
    let most = p.abs().max_element();
    most.next_up() - most
}

/// The warning about a mesh.
pub(super) fn mesh(mesh: &Mesh, precision: Precision) -> Option<ImportError> {
    let parts = mesh.triangles.iter().step_by(mesh.len() / LOOKED_AT + 1).filter_map(|corners| {
        let [a, b, c] = corners.map(|v| mesh.positions[v as usize]);
        let longest = (b - a).abs().max((c - b).abs()).max((a - c).abs()).max_element();
        // A part of size zero has none at any precision.
        (longest > 0.0).then(|| (a.abs().max(b.abs()).max(c.abs()), longest))
    });
    complaint("triangles", parts, &mesh.positions, mesh.origin, precision)
}

/// The warning about a cloud. It has one radius for all elements, or one for each element of `points_of_one` points.
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

/// The warning about a cloud whose numbers are in the scene, as message and hint.
pub(crate) fn inline_cloud(points: &[Vec3], points_of_one: usize, radii: &[f32], origin: DVec3) -> Option<[String; 2]> {
    let said = cloud(points, points_of_one, radii, origin, Precision::Double)?;
    Some([said.message, said.help.unwrap_or_default()])
}

/// The warning about parts, each with a position and a size.
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
    // Coincident points have no size to compare with.
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
                "its coordinates are rounded to single precision, which at a distance of {most}{from} has steps of \
                 {step}{small}"
            );
            ImportError::file(message)
                .help("leave out what lies far from the rest, or put parts that lie far apart into files of their own")
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of `count` triangles from squares of side `size`, starting at `from`.
    fn strip(from: Vec3, size: f32, count: u32) -> Mesh {
        let at = |i: u32| from + Vec3::new((i / 2) as f32, (i % 2) as f32, 0.0) * size;
        let triangles = (0..2 * count).map(|i| [i, i + 1, i + 2]).collect();
        Mesh { positions: (0..2 * count + 2).map(at).collect(), triangles, ..Mesh::default() }
    }

    #[test]
    fn small_triangles_far_away_are_told() {
        let told = |mesh_: &Mesh, precision| mesh(mesh_, precision).map(|c| c.message);
        let far = Vec3::new(3e6, 0.0, 0.0);
        // The strip is as long as it is far away, so its total size is no reason for the warning.
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
