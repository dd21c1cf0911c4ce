//! Transforms as words that come back to the last bit: the shortest ones that do.

use super::line::Line;
use super::number::{double, doubles, fine_vector};
use canaletto::math::{AnimatedTransform, Transform};
use glam::{DAffine3, DMat3, DVec3};

/// A word of a transform with its numbers.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Step {
    Translate(DVec3),
    /// The axis by its number, and degrees.
    Rotate(usize, f64),
    Scale(DVec3),
    Matrix(DAffine3),
    /// A matrix and its inverse.
    Both(DAffine3, DAffine3),
}

const AXES: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];

impl Step {
    /// What the scene text makes of the word.
    fn transform(&self) -> Option<Transform> {
        match self {
            Step::Translate(offset) => Some(Transform::translate(*offset)),
            Step::Rotate(axis, degrees) => Transform::rotate(AXES[*axis], *degrees).ok(),
            Step::Scale(factors) => Transform::scale(*factors).ok(),
            Step::Matrix(forward) => Transform::new(*forward).ok(),
            Step::Both(forward, inverse) => Transform::with_inverse(*forward, *inverse).ok(),
        }
    }

    pub(super) fn line(&self) -> Line {
        match self {
            Step::Translate(offset) => Line::of("translate", fine_vector(*offset)),
            Step::Rotate(axis, degrees) => Line::of(["rotate-x", "rotate-y", "rotate-z"][*axis], double(*degrees)),
            Step::Scale(factors) if *factors == DVec3::splat(factors.x) => Line::of("scale", double(factors.x)),
            Step::Scale(factors) => Line::of("scale", fine_vector(*factors)),
            Step::Matrix(forward) => Line::of("matrix", doubles(&rows(forward))),
            Step::Both(forward, inverse) => {
                Line::of("matrix", [doubles(&rows(forward)), doubles(&rows(inverse))].join(" "))
            }
        }
    }
}

fn rows(m: &DAffine3) -> [f64; 12] {
    let [x, y, z, t] = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis, m.translation];
    let row = |i: usize| [x[i], y[i], z[i], t[i]];
    let all = [row(0), row(1), row(2)];
    std::array::from_fn(|i| all[i / 4][i % 4])
}

/// The composition of words, the first one first, as the scene text makes it.
fn composed(steps: &[Step]) -> Option<Transform> {
    steps.iter().try_fold(Transform::IDENTITY, |all, step| Some(step.transform()?.after(&all)))
}

/// The words of a transform, the first one to be applied first. They give its bits.
pub(super) fn steps(transform: &Transform) -> Vec<Step> {
    if transform.is_identity() && transform.inverse().is_identity() {
        return Vec::new();
    }
    let gives = |steps: &Vec<Step>| composed(steps).is_some_and(|found| found == *transform);
    let forward = *transform.matrix();
    let matrix = vec![Step::Matrix(forward)];
    let turned = |matrix: &Vec<Step>| gives(matrix).then(|| matrix.clone());
    parts(&forward)
        .into_iter()
        .find(gives)
        .or_else(|| turned(&matrix))
        .or_else(|| quarter_turned(transform).filter(gives))
        .unwrap_or_else(|| vec![Step::Both(forward, *transform.back())])
}

/// The lines of a transform.
pub(super) fn lines(transform: &Transform) -> Vec<Line> {
    steps(transform).iter().map(Step::line).collect()
}

/// The degrees between two poses of a motion at most, as the scene text makes them.
const POSE_STEP: f64 = 45.0;
/// The most whole turns of a motion.
const MOST_TURNS: i32 = 8;

/// The words of a motion through these poses. None if no words give all of them.
pub(super) fn motion(poses: &[Transform]) -> Option<Vec<Step>> {
    let last = steps(poses.last()?);
    let turns = (1..=MOST_TURNS).flat_map(|turns| [turns, -turns]).map(|turns| 360.0 * f64::from(turns));
    let mut all = vec![last.clone()];
    for more in turns {
        let turned = |step: &Step| match step {
            Step::Rotate(axis, degrees) => Step::Rotate(*axis, degrees + more),
            other => other.clone(),
        };
        match last.iter().any(|step| matches!(step, Step::Rotate(..))) {
            true => all.push(last.iter().map(turned).collect()),
            // A whole turn ends where it starts.
            false => all.extend((0..3).map(|axis| last.iter().cloned().chain([Step::Rotate(axis, more)]).collect())),
        }
    }
    all.into_iter().filter(|steps| !steps.is_empty()).find(|steps| poses_of(steps).as_deref() == Some(poses))
}

/// The poses that the scene text makes of a motion.
fn poses_of(steps: &[Step]) -> Option<Vec<Transform>> {
    let degrees = |step: &Step| if let Step::Rotate(_, degrees) = step { degrees.abs() } else { 0.0 };
    let count = (steps.iter().map(degrees).sum::<f64>() / POSE_STEP).ceil().max(1.0) as u32;
    let part = |step: &Step, share: f64| match step {
        _ if share == 1.0 => step.transform(),
        Step::Rotate(axis, degrees) => Transform::rotate(AXES[*axis], degrees * share).ok(),
        _ => Some(AnimatedTransform::new(&[Transform::IDENTITY, step.transform()?]).ok()?.at(share)),
    };
    let pose = |i: u32| {
        let share = f64::from(i) / f64::from(count);
        steps.iter().try_fold(Transform::IDENTITY, |pose, step| Some(part(step, share)?.after(&pose)))
    };
    (0..=count).map(pose).collect()
}

/// A number with the digits that were probably written: without the noise of the last ones.
fn tidy(v: f64) -> f64 {
    format!("{v:.11e}").parse().unwrap_or(v)
}

/// Attempts to say a matrix by a scale, a turn around an axis and a translation, in this order or with the translation
/// before the turn.
fn parts(m: &DAffine3) -> Vec<Vec<Step>> {
    let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis];
    let mirrors = m.matrix3.determinant() < 0.0;
    let mut lengths = DVec3::from_array(columns.map(|column| column.length()));
    if mirrors {
        lengths.x = -lengths.x;
    }
    let factors = DVec3::from_array(lengths.to_array().map(tidy));
    let turn = DMat3::from_cols(columns[0] / lengths.x, columns[1] / lengths.y, columns[2] / lengths.z);
    let mut before = Vec::new();
    if factors != DVec3::ONE {
        before.push(Step::Scale(factors));
    }
    let mut all = Vec::new();
    let moved = |steps: &[Step], at: usize, offset: DVec3| {
        let mut steps = steps.to_vec();
        if offset != DVec3::ZERO {
            steps.insert(at, Step::Translate(offset));
        }
        steps
    };
    all.push(moved(&before, before.len(), m.translation));
    for (axis, direction) in AXES.into_iter().enumerate() {
        let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
        if (turn.col(axis) - direction).length() > 1e-9 {
            continue;
        }
        let exact = libm::atan2(turn.col(next)[last], turn.col(next)[next]).to_degrees();
        let degrees: f64 = format!("{exact:.9}").parse().unwrap_or(exact);
        // An angle that was computed is one of the numbers next to it.
        let near =
            [exact, exact.next_up(), exact.next_down(), exact.next_up().next_up(), exact.next_down().next_down()];
        for degrees in [degrees, degrees + 360.0].into_iter().chain(near) {
            let mut steps = before.clone();
            steps.push(Step::Rotate(axis, degrees));
            all.push(moved(&steps, steps.len(), m.translation));
            let back = Transform::rotate(direction, -degrees).map(|back| back.point(m.translation));
            let offset = back.map_or(DVec3::ZERO, |offset| DVec3::from_array(offset.to_array().map(tidy)));
            all.push(moved(&steps, steps.len() - 1, offset));
        }
    }
    all
}

/// A transform with a turn by a right angle at its end, as an upright model has it.
fn quarter_turned(transform: &Transform) -> Option<Vec<Step>> {
    let turns =
        [(0, -90.0), (0, 90.0), (1, 90.0), (1, -90.0), (1, 180.0), (2, 90.0), (2, -90.0), (2, 180.0), (0, 180.0)];
    turns.into_iter().find_map(|(axis, degrees)| {
        // Turns by right angles only exchange numbers.
        let rest = Transform::rotate(AXES[axis], -degrees).ok()?.after(transform);
        let mut steps = parts(rest.matrix());
        steps.push(vec![Step::Matrix(*rest.matrix())]);
        let mut found = steps.into_iter().find(|steps| composed(steps).as_ref() == Some(&rest))?;
        found.push(Step::Rotate(axis, degrees));
        (composed(&found).as_ref() == Some(transform)).then_some(found)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(transform: &Transform) -> Vec<Step> {
        let steps = steps(transform);
        assert_eq!(composed(&steps).as_ref(), Some(transform), "{steps:?}");
        steps
    }

    #[test]
    fn words_come_back_as_they_were_written() {
        let lists = [
            vec![],
            vec![Step::Translate(DVec3::new(0.1, -2.0, 1e6))],
            vec![Step::Scale(DVec3::splat(0.3)), Step::Rotate(1, 30.0), Step::Translate(DVec3::new(1.0, 0.7, 0.0))],
            vec![Step::Scale(DVec3::new(1.0, 2.5, 3.0)), Step::Rotate(2, -71.25)],
            vec![Step::Translate(DVec3::new(0.0, 5.0, 0.3)), Step::Rotate(0, 12.0)],
            vec![Step::Scale(DVec3::new(-1.0, 1.0, 1.0))],
            vec![Step::Rotate(0, -90.0)],
        ];
        for list in lists {
            assert_eq!(written(&composed(&list).unwrap()), list);
        }
    }

    #[test]
    fn all_transforms_keep_their_bits() {
        let turn = Transform::rotate(DVec3::new(1.0, 2.0, 3.0), 33.0).unwrap();
        let scale = Transform::scale(DVec3::new(0.1, 7.0, 3.0)).unwrap();
        let both = turn.after(&scale).after(&turn);
        assert!(matches!(written(&both)[..], [Step::Both(..)]));
        let placed = Transform::new(*both.matrix()).unwrap();
        assert!(matches!(written(&placed)[..], [Step::Matrix(_)]));
        assert!(matches!(written(&placed.inverse())[..], [Step::Both(..)]));
        let upright = Transform::rotate(DVec3::X, -90.0).unwrap().after(&placed);
        assert!(matches!(written(&upright)[..], [Step::Matrix(_), Step::Rotate(0, -90.0)]));
    }
}
