//! The distribution of a lamp's light over directions, as its maker measured it (ANSI/IES LM-63).

use crate::OutOfRange;
use crate::math::Transform;
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// What the angles of a profile are (ANSI/IES LM-63-2002, section 3). Directions are given in a right-handed frame: z
/// along the lamp's axis, in general straight down, and x to its front.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Photometry {
    /// The planes share the axis. Vertical angles count from the axis, horizontal ones from the front by the right
    /// hand.
    #[default]
    C,
    /// The planes share the horizontal line across axis and front. A vertical angle is that of a plane to the axis; the
    /// front is at 90 degrees. A horizontal angle is that of a direction in its plane, positive on the side of −y.
    B,
    /// The planes share the axis, from which vertical angles count, too, but from −90 degrees on. The beam, where both
    /// angles are 0, looks to the front. Horizontal angles are positive on the side of −y.
    A,
}

/// Luminous intensities for directions of a grid. Between the angles of the grid they are linear in both angles. No
/// light leaves outside of the range of vertical angles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct IesProfile {
    /// What the angles are.
    #[serde(default)]
    pub photometry: Photometry,
    /// Vertical angles in degrees, rising. Type C: from 0 (along the lamp's axis, in general straight down) to 180.
    /// Types A and B: from −90 to 90. If the first one is 0, angles below are mirrored.
    pub vertical: Vec<f32>,
    /// Horizontal angles in degrees, rising. A single one stands for all. From 0 to 90 and from 0 to 180 the rest is
    /// mirrored, from 90 to 270 too; from 0 to 360 it is complete. Types A and B: as the vertical ones.
    pub horizontal: Vec<f32>,
    /// The intensities, at least 0: for each horizontal angle those of all vertical ones. Their unit cancels, since a
    /// light's own intensity is that of the brightest direction.
    pub candela: Vec<f32>,
}

/// A profile on a light of a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MountedProfile {
    /// The profile.
    pub profile: IesProfile,
    /// The direction of the vertical angle 0; any length but zero.
    pub axis: Vec3,
    /// The direction of the horizontal angle 0. It is made perpendicular to the axis, and must not be along it.
    pub front: Vec3,
}

/// The runtime form of a mounted profile.
#[derive(Clone, Debug)]
pub(super) struct PreparedProfile {
    profile: IesProfile,
    /// The directions of the horizontal angles 0 and 90, and the axis.
    frame: [DVec3; 3],
    /// One over the largest intensity.
    scale: f64,
}

impl IesProfile {
    /// The most angles of either kind.
    pub const MAX_ANGLES: usize = 4096;

    /// Checks the grid.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names what is wrong.
    pub fn check(&self) -> Result<(), OutOfRange> {
        let wrong = |problem: String| Err(OutOfRange::new("ies", problem));
        let ranges = match self.photometry {
            Photometry::C => [[0.0, 180.0], [0.0, 360.0]],
            Photometry::A | Photometry::B => [[-90.0, 90.0]; 2],
        };
        let named = [("vertical", &self.vertical), ("horizontal", &self.horizontal)];
        for ((name, angles), [start, end]) in named.into_iter().zip(ranges) {
            if angles.is_empty() || angles.len() > Self::MAX_ANGLES {
                return wrong(format!("has {} {name} angles; it must have 1 to {}", angles.len(), Self::MAX_ANGLES));
            }
            if angles.iter().any(|angle| !(start..=end).contains(angle)) {
                return wrong(format!("has a {name} angle that isn't between {start} and {end} degrees"));
            }
            if !angles.is_sorted_by(|a, b| a < b) {
                return wrong(format!("has {name} angles that don't rise"));
            }
        }
        if self.vertical.len() < 2 {
            return wrong("has a single vertical angle; it must have at least 2".into());
        }
        let ends = [self.horizontal[0], self.horizontal[self.horizontal.len() - 1]];
        let is_known = self.photometry != Photometry::C
            || self.horizontal.len() == 1
            || matches!(ends, [0.0, 90.0 | 180.0 | 360.0] | [90.0, 270.0]);
        if !is_known {
            let [from, to] = ends;
            return wrong(format!(
                "has horizontal angles from {from} to {to}; they must go from 0 to 0, 90, 180 or 360, or from 90 to 270"
            ));
        }
        if self.candela.len() != self.vertical.len() * self.horizontal.len() {
            return wrong(format!(
                "has {} intensities for {} × {} angles",
                self.candela.len(),
                self.horizontal.len(),
                self.vertical.len()
            ));
        }
        if self.candela.iter().any(|v| !v.is_finite() || *v < 0.0) {
            return wrong("has an intensity that isn't 0 or more".into());
        }
        if self.candela.iter().all(|v| *v == 0.0) {
            return wrong("is dark in all directions".into());
        }
        Ok(())
    }

    /// The horizontal angle within the measured ones, by their symmetry. All angles are in degrees.
    fn fold(&self, angle: f64) -> f64 {
        if self.photometry != Photometry::C {
            return if self.horizontal.len() == 1 {
                self.horizontal[0].into()
            } else {
                mirrored(&self.horizontal, angle)
            };
        }
        match [self.horizontal[0], self.horizontal[self.horizontal.len() - 1]] {
            [0.0, 360.0] => angle,
            [0.0, 180.0] => angle.min(360.0 - angle),
            [0.0, 90.0] => {
                let half = angle.min(360.0 - angle);
                half.min(180.0 - half)
            }
            [90.0, 270.0] if angle < 90.0 => 180.0 - angle,
            [90.0, 270.0] if angle > 270.0 => 540.0 - angle,
            [first, _] if self.horizontal.len() == 1 => first.into(),
            _ => angle,
        }
    }

    /// The intensity at angles in degrees: of type C of 0 to 180 and of 0 to 360, else of −90 to 90.
    pub fn intensity(&self, vertical: f64, horizontal: f64) -> f64 {
        let vertical = if self.photometry == Photometry::C { vertical } else { mirrored(&self.vertical, vertical) };
        let Some((row, along)) = place(&self.vertical, vertical) else { return 0.0 };
        let Some((column, across)) = place(&self.horizontal, self.fold(horizontal)) else { return 0.0 };
        let at = |column: usize| {
            let angles = &self.candela[column.min(self.horizontal.len() - 1) * self.vertical.len()..];
            let next = angles[(row + 1).min(self.vertical.len() - 1)];
            f64::from(angles[row]) * (1.0 - along) + f64::from(next) * along
        };
        at(column) * (1.0 - across) + if across > 0.0 { at(column + 1) * across } else { 0.0 }
    }

    /// The vertical and the horizontal angle in degrees of a direction in the profile's frame.
    fn angles(&self, [x, y, z]: [f64; 3]) -> [f64; 2] {
        let radians = match self.photometry {
            Photometry::C => {
                let vertical = libm::acos(z.clamp(-1.0, 1.0)).to_degrees();
                let around = libm::atan2(y, x).to_degrees();
                return [vertical, if around < 0.0 { around + 360.0 } else { around }];
            }
            Photometry::B => [libm::atan2(x, z), libm::asin((-y).clamp(-1.0, 1.0))],
            Photometry::A => [libm::asin((-z).clamp(-1.0, 1.0)), libm::atan2(-y, x)],
        };
        radians.map(f64::to_degrees)
    }

    /// The integral of the intensity over all directions. In the profile's unit it is the lamp's luminous flux.
    pub fn flux(&self) -> f64 {
        if self.photometry != Photometry::C {
            return self.flux_by_latitude();
        }
        // The mean over the horizontal angles, of which those between two grid angles are linear.
        let n = self.vertical.len();
        let column = |i: usize| &self.candela[i * n..(i + 1) * n];
        let mean: Vec<f64> = (0..n)
            .map(|row| {
                let (mut sum, mut width) = (0.0, 0.0);
                for (i, pair) in self.horizontal.windows(2).enumerate() {
                    let step = f64::from(pair[1] - pair[0]);
                    sum += 0.5 * step * (f64::from(column(i)[row]) + f64::from(column(i + 1)[row]));
                    width += step;
                }
                if width > 0.0 { sum / width } else { column(0)[row].into() }
            })
            .collect();
        // ∫ (a + b θ) sin θ dθ = b sin θ − (a + b θ) cos θ
        let rows = self.vertical.windows(2).enumerate().map(|(row, pair)| {
            let [from, to] = [pair[0], pair[1]].map(|v| f64::from(v).to_radians());
            let b = (mean[row + 1] - mean[row]) / (to - from);
            let end = |angle: f64, value: f64| b * libm::sin(angle) - value * libm::cos(angle);
            end(to, mean[row + 1]) - end(from, mean[row])
        });
        TAU * rows.sum::<f64>()
    }

    /// The flux of types A and B. One of the angles is a latitude β, and dω = cos β dβ dλ.
    fn flux_by_latitude(&self) -> f64 {
        let n = self.vertical.len();
        let is_a = self.photometry == Photometry::A;
        let [latitudes, longitudes] =
            if is_a { [&self.vertical, &self.horizontal] } else { [&self.horizontal, &self.vertical] };
        let at = |latitude: usize, longitude: usize| {
            let index = if is_a { longitude * n + latitude } else { latitude * n + longitude };
            f64::from(self.candela[index])
        };
        // The integral over the longitudes at each latitude. A single angle stands for all, from −90 to 90 degrees.
        let half = |angles: &[f32]| if angles.len() > 1 && angles[0] == 0.0 { 2.0 } else { 1.0 };
        let across = |latitude: usize| {
            let parts = longitudes.windows(2).enumerate().map(|(i, pair)| {
                0.5 * f64::from(pair[1] - pair[0]).to_radians() * (at(latitude, i) + at(latitude, i + 1))
            });
            if longitudes.len() == 1 { PI * at(latitude, 0) } else { parts.sum::<f64>() * half(longitudes) }
        };
        if latitudes.len() == 1 {
            return 2.0 * across(0);
        }
        // ∫ (a + b β) cos β dβ = b cos β + (a + b β) sin β
        let bands = latitudes.windows(2).enumerate().map(|(i, pair)| {
            let [from, to] = [pair[0], pair[1]].map(|v| f64::from(v).to_radians());
            let values = [across(i), across(i + 1)];
            let b = (values[1] - values[0]) / (to - from);
            let end = |angle: f64, value: f64| b * libm::cos(angle) + value * libm::sin(angle);
            end(to, values[1]) - end(from, values[0])
        });
        bands.sum::<f64>() * half(latitudes)
    }

    fn largest(&self) -> f64 {
        self.candela.iter().fold(0.0, |most: f32, v| most.max(*v)).into()
    }
}

/// An angle on the measured side, if the other side mirrors it.
fn mirrored(angles: &[f32], angle: f64) -> f64 {
    if angles[0] == 0.0 { angle.abs() } else { angle }
}

/// The place of an angle among rising ones: the index of the last that isn't larger, and the share of the way to the
/// next. None outside of them.
fn place(angles: &[f32], angle: f64) -> Option<(usize, f64)> {
    let [first, last] = [angles[0], angles[angles.len() - 1]].map(f64::from);
    if angle < first || angle > last {
        return None;
    }
    let index = angles.partition_point(|a| f64::from(*a) <= angle) - 1;
    let Some(next) = angles.get(index + 1) else { return Some((index, 0.0)) };
    let from = f64::from(angles[index]);
    Some((index, (angle - from) / (f64::from(*next) - from)))
}

impl MountedProfile {
    pub(super) fn transformed(&self, t: &Transform) -> MountedProfile {
        let go = |v: Vec3| t.vector(v.as_dvec3()).as_vec3();
        MountedProfile { axis: go(self.axis), front: go(self.front), ..self.clone() }
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        self.profile.check()?;
        let Some(axis) = self.axis.as_dvec3().try_normalize() else {
            return Err(OutOfRange::new("axis", "has no direction"));
        };
        let front = self.front.as_dvec3().normalize_or_zero();
        if front.reject_from_normalized(axis).length() < 1e-6 {
            return Err(OutOfRange::new("front", "is along the axis; it must be aside"));
        }
        Ok(())
    }

    pub(super) fn prepared(&self) -> PreparedProfile {
        let z = self.axis.as_dvec3().normalize();
        let x = self.front.as_dvec3().reject_from_normalized(z).normalize();
        let profile = self.profile.clone();
        let scale = 1.0 / profile.largest();
        PreparedProfile { profile, frame: [x, z.cross(x), z], scale }
    }
}

impl PreparedProfile {
    /// The share of the largest intensity that leaves in a unit direction.
    pub(super) fn factor(&self, direction: DVec3) -> f32 {
        let [vertical, horizontal] = self.profile.angles(self.frame.map(|axis| axis.dot(direction)));
        (self.profile.intensity(vertical, horizontal) * self.scale) as f32
    }

    /// The integral of [`PreparedProfile::factor`] over all directions.
    pub(super) fn solid_angle(&self) -> f64 {
        self.profile.flux() * self.scale
    }

    pub(super) fn axis(&self) -> DVec3 {
        self.frame[2]
    }

    /// The largest angle to the axis in radians at which light leaves.
    pub(super) fn emission_angle(&self) -> f64 {
        match self.profile.photometry {
            Photometry::C => {}
            Photometry::B => return FRAC_PI_2,
            Photometry::A => return PI,
        }
        let n = self.profile.vertical.len();
        let is_lit = |row: &usize| self.profile.candela.iter().skip(*row).step_by(n).any(|v| *v > 0.0);
        let last = (0..n).rev().find(is_lit).unwrap_or(0);
        self.profile.vertical.get(last + 1).map_or(PI, |angle| f64::from(*angle).to_radians())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(vertical: &[f32], horizontal: &[f32], candela: &[f32]) -> IesProfile {
        let photometry = Photometry::C;
        IesProfile { photometry, vertical: vertical.into(), horizontal: horizontal.into(), candela: candela.into() }
    }

    #[test]
    fn intensities_are_linear_between_the_angles() {
        let p = profile(&[0.0, 40.0, 90.0], &[0.0, 90.0], &[100.0, 60.0, 10.0, 100.0, 20.0, 30.0]);
        assert_eq!(p.check(), Ok(()));
        for (vertical, horizontal, expected) in [
            (0.0, 17.0, 100.0),
            (40.0, 0.0, 60.0),
            (20.0, 0.0, 80.0),
            (40.0, 45.0, 40.0),
            (65.0, 90.0, 25.0),
            (20.0, 45.0, 70.0),
            (90.0, 0.0, 10.0),
            (90.1, 0.0, 0.0),
            (180.0, 10.0, 0.0),
        ] {
            // The other quadrants mirror the first.
            for around in [horizontal, 180.0 - horizontal, 180.0 + horizontal, 360.0 - horizontal] {
                let found = p.intensity(vertical, around);
                assert!((found - expected).abs() < 1e-9, "{vertical} {around}: {found}, not {expected}");
            }
        }
    }

    #[test]
    fn symmetries_are_those_of_the_standard() {
        let halves = profile(&[0.0, 180.0], &[0.0, 60.0, 180.0], &[1.0, 1.0, 4.0, 4.0, 2.0, 2.0]);
        assert_eq!([30.0, 330.0, 60.0, 300.0, 180.0].map(|a| halves.intensity(5.0, a)), [2.5, 2.5, 4.0, 4.0, 2.0]);
        let sides = profile(&[0.0, 180.0], &[90.0, 180.0, 270.0], &[1.0, 1.0, 4.0, 4.0, 2.0, 2.0]);
        assert_eq!(
            [90.0, 0.0, 180.0, 360.0, 45.0, 315.0].map(|a| sides.intensity(5.0, a)),
            [1.0, 4.0, 4.0, 4.0, 2.5, 3.0]
        );
        let whole = profile(&[0.0, 180.0], &[0.0, 180.0, 360.0], &[1.0, 1.0, 3.0, 3.0, 1.0, 1.0]);
        assert_eq!([0.0, 90.0, 270.0, 360.0].map(|a| whole.intensity(5.0, a)), [1.0, 2.0, 2.0, 1.0]);
        let round = profile(&[0.0, 180.0], &[0.0], &[1.0, 3.0]);
        assert_eq!([0.0, 123.0].map(|a| round.intensity(90.0, a)), [2.0; 2]);
    }

    /// The flux is the integral of the intensity.
    #[test]
    fn flux_is_the_integral_of_the_intensity() {
        for p in [
            profile(&[0.0, 180.0], &[0.0], &[1.0, 1.0]),
            profile(&[0.0, 30.0, 50.0, 90.0], &[0.0, 90.0], &[9.0, 5.0, 3.0, 0.0, 9.0, 7.0, 1.0, 2.0]),
            profile(&[90.0, 120.0, 180.0], &[90.0, 170.0, 270.0], &[1.0, 5.0, 3.0, 2.0, 9.0, 7.0, 1.0, 2.0, 3.0]),
        ] {
            let (rows, columns) = (1800, 720);
            let mut sum = 0.0;
            for (i, j) in (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))) {
                let [vertical, horizontal] = [(i, rows, 180.0), (j, columns, 360.0)]
                    .map(|(i, n, end)| (f64::from(i) + 0.5) / f64::from(n) * end);
                sum += p.intensity(vertical, horizontal) * vertical.to_radians().sin();
            }
            sum *= PI / f64::from(rows) * TAU / f64::from(columns);
            assert!((p.flux() / sum - 1.0).abs() < 1e-4, "{} and {sum}", p.flux());
        }
    }

    #[test]
    fn directions_are_those_of_the_frame() {
        let p = profile(
            &[0.0, 90.0, 180.0],
            &[0.0, 90.0, 180.0, 360.0],
            &[8.0, 1.0, 0.0, 8.0, 4.0, 0.0, 8.0, 3.0, 0.0, 8.0, 1.0, 0.0],
        );
        let mounted = MountedProfile { profile: p, axis: Vec3::NEG_Y * 3.0, front: Vec3::new(1.0, 5.0, 0.0) };
        assert_eq!(mounted.check(), Ok(()));
        let prepared = mounted.prepared();
        let share = |d: DVec3| prepared.factor(d) * 8.0;
        assert!((share(DVec3::NEG_Y) - 8.0).abs() < 1e-6);
        assert!((share(DVec3::X) - 1.0).abs() < 1e-6 && (share(DVec3::NEG_X) - 3.0).abs() < 1e-6);
        // The horizontal angles turn by the right hand around the axis: from x over −y × x = z.
        assert!((share(DVec3::Z) - 4.0).abs() < 1e-6 && (share(DVec3::NEG_Z) - 2.0).abs() < 1e-6);
        assert!((prepared.emission_angle() - PI).abs() < 1e-9);
    }

    /// Lamps of closed forms, as types A and B tabulate them: one that shines evenly to the half space of its beam, a
    /// Lambertian one, and one that has no symmetry. Their fluxes are 2π, π and 2√2/3.
    #[test]
    fn types_a_and_b_are_those_of_the_standard() {
        let [even, lambertian, skew]: [fn(DVec3) -> f64; 3] =
            [|_| 1.0, |d| d.x.max(0.0), |d| d.x.max(0.0) * (d.y + d.z).max(0.0)];
        // The lamp's beam is x, its upper side z and its right side y.
        for (lamp, flux) in [(even, TAU), (lambertian, PI), (skew, 2.0 * 2f64.sqrt() / 3.0)] {
            for photometry in [Photometry::A, Photometry::B] {
                let angles: Vec<f32> = (-90..=90).map(|a| a as f32).collect();
                let mut candela = Vec::new();
                for h in &angles {
                    for v in &angles {
                        let [(sin_h, cos_h), (sin_v, cos_v)] = [h, v].map(|a| f64::from(*a).to_radians().sin_cos());
                        candela.push(lamp(match photometry {
                            Photometry::A => DVec3::new(cos_v * cos_h, cos_v * sin_h, sin_v),
                            _ => DVec3::new(cos_h * cos_v, sin_h, cos_h * sin_v),
                        }) as f32);
                    }
                }
                let (vertical, horizontal) = (angles.clone(), angles);
                let profile = IesProfile { photometry, vertical, horizontal, candela };
                assert_eq!(profile.check(), Ok(()));
                assert!((profile.flux() / flux - 1.0).abs() < 2e-4, "{photometry:?}: {} and {flux}", profile.flux());
                // A looks to the front and has the axis below; B looks along the axis and has the front above.
                let (axis, front) = match photometry {
                    Photometry::A => (Vec3::NEG_Z, Vec3::X),
                    _ => (Vec3::X, Vec3::Z),
                };
                let largest = profile.largest();
                let prepared = MountedProfile { profile, axis, front }.prepared();
                for i in 0..500 {
                    let at = |k: f64| f64::from(i) * k % 2.0 - 1.0;
                    let Some(d) = DVec3::new(at(0.317), at(0.771), at(1.137)).try_normalize() else { continue };
                    // Angles are 1 degree apart; at the rim of the half space the table ends.
                    if d.x.abs() < 0.02 {
                        continue;
                    }
                    let expected = if d.x > 0.0 { lamp(d) } else { 0.0 };
                    let found = f64::from(prepared.factor(d)) * largest;
                    assert!((found - expected).abs() < 0.01, "{photometry:?} {d}: {found}, not {expected}");
                }
            }
        }
    }

    #[test]
    fn angles_of_types_a_and_b_that_begin_at_0_are_mirrored() {
        for photometry in [Photometry::A, Photometry::B] {
            let values = [8.0, 4.0, 0.0, 6.0, 3.0, 1.0, 2.0, 2.0, 0.0];
            let angles = [0.0, 45.0, 90.0];
            let half = IesProfile { photometry, ..profile(&angles, &angles, &values) };
            let both = [-90.0, -45.0, 0.0, 45.0, 90.0];
            let index = |a: f32| (a.abs() / 45.0) as usize;
            let all = both.iter().flat_map(|h| both.map(|v| values[index(*h) * 3 + index(v)])).collect::<Vec<_>>();
            let whole = IesProfile { photometry, ..profile(&both, &both, &all) };
            assert!((half.flux() / whole.flux() - 1.0).abs() < 1e-12);
            for (v, h) in [(10.0, -70.0), (-10.0, 70.0), (-33.0, -20.0), (90.0, -90.0)] {
                // The weights between mirrored angles are rounded otherwise.
                let [half, whole] = [&half, &whole].map(|profile| profile.intensity(v, h));
                assert!((half - whole).abs() < 1e-12, "{v} {h}: {half}, not {whole}");
            }
        }
    }

    #[test]
    fn wrong_grids_are_named() {
        let good = profile(&[0.0, 90.0], &[0.0], &[1.0, 1.0]);
        let says = |change: &dyn Fn(&mut IesProfile)| {
            let mut p = good.clone();
            change(&mut p);
            p.check().unwrap_err().to_string()
        };
        assert!(says(&|p| p.vertical = vec![0.0, 181.0]).contains("between 0 and 180"));
        assert!(says(&|p| p.vertical = vec![90.0, 0.0]).contains("don't rise"));
        assert!(says(&|p| p.horizontal = vec![0.0, 45.0]).contains("from 0 to 45"));
        assert!(says(&|p| p.candela = vec![1.0]).contains("1 intensities for 1 × 2"));
        assert!(says(&|p| p.candela = vec![1.0, f32::NAN]).contains("isn't 0 or more"));
        assert!(says(&|p| p.candela = vec![0.0; 2]).contains("dark"));
        assert!(says(&|p| p.vertical = vec![0.0]).contains("single vertical"));
    }
}
