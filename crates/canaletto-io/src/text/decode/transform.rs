//! Decoding of transforms, applied in the order in which they are written, and of motion while the shutter is open.

use super::Decoder;

use crate::text::animate::POSES;
use crate::text::nodes::MOTION_FIELD;
use crate::text::reader::{Entry, Fields, TransformEntry};
use crate::text::report::Message;
use canaletto::math::{AnimatedTransform, Transform};
use glam::{DAffine3, DMat3, DVec3};

impl Decoder<'_> {
    /// The composition of the node's transforms; the first line is applied first.
    pub(crate) fn transform(&mut self, fields: &Fields) -> Transform {
        let mut all = Transform::IDENTITY;
        for TransformEntry { transform, entry } in fields.transforms.iter().filter(|got| got.entry.is_good()) {
            match transform.read.read(entry) {
                Ok(transform) => all = transform.after(&all),
                Err(message) => {
                    self.valid = false;
                    self.validator.report.push(Message::error(entry.span, message));
                }
            }
        }
        if !fields.transforms.is_empty() && Transform::new(*all.matrix()).is_err() {
            self.valid = false;
            let span = fields.node.name_span;
            self.validator.report.error(span, "its transforms together go beyond what can be computed with");
        }
        all
    }

    /// The placement of a node, and its motion while the shutter is open: by keys in its transforms, or by `motion`.
    pub(crate) fn placed_in_time(&mut self, fields: &Fields) -> (Transform, Vec<Transform>) {
        let Some(first) = fields.transforms.iter().position(|got| got.entry.moves()) else {
            return (self.transform(fields), self.motion(fields));
        };
        let span = fields.transforms[first].entry.span;
        // Transforms before the first moving one are constant. The whole is validated at the frame's own time.
        self.transform(fields);
        let mut wrong = |message: String, at| {
            self.valid = false;
            self.validator.report.push(Message::error(at, message));
            (Transform::IDENTITY, Vec::new())
        };
        if fields.has(&MOTION_FIELD) {
            let message = "both keys and motion say how it moves while the shutter is open";
            return wrong(message.into(), fields.span(&MOTION_FIELD));
        }
        let all = |gots: &[TransformEntry], moment: usize| {
            let mut pose = Transform::IDENTITY;
            for got in gots.iter().filter(|got| got.entry.is_good()) {
                pose = got.transform.read.read(&got.entry.at(moment)).ok()?.after(&pose);
            }
            Transform::new(*pose.matrix()).ok()
        };
        let (still, moving) = fields.transforms.split_at(first);
        let poses: Option<Vec<Transform>> = (0..POSES).map(|moment| all(moving, moment)).collect();
        match (all(still, 0), poses) {
            (Some(still), Some(poses)) => match AnimatedTransform::new(&poses) {
                Ok(_) => (still, poses),
                Err(problem) => wrong(problem.to_string(), span),
            },
            _ => wrong(
                "while the shutter is open its transforms make the object flat, or go beyond all numbers".into(),
                span,
            ),
        }
    }

    /// The poses of `motion` while the shutter is open: increasing parts of its transforms. Rotations between poses
    /// take the shorter direction, so large rotations need several poses.
    pub(crate) fn motion(&mut self, fields: &Fields) -> Vec<Transform> {
        if !fields.has(&MOTION_FIELD) {
            return Vec::new();
        }
        let Some(inner) = self.block(fields, &MOTION_FIELD) else { return Vec::new() };
        let span = inner.node.name_span;
        let mut wrong = |message: String, at| {
            self.valid = false;
            self.validator.report.push(Message::error(at, message));
            Vec::new()
        };
        if inner.transforms.is_empty() {
            return wrong("motion has no transforms, so nothing moves".into(), span);
        }
        let angles = inner.transforms.iter().map(|got| got.transform.read.degrees(&got.entry).abs());
        let angle: f64 = angles.sum();
        if angle > MOST_TURN {
            return wrong(format!("motion turns by {angle} degrees; it can be up to {MOST_TURN}"), span);
        }
        let steps = ((angle / TURN_STEP).ceil() as u32).max(1);
        let mut poses = Vec::new();
        for step in 0..=steps {
            let mut pose = Transform::IDENTITY;
            for got in &inner.transforms {
                match got.transform.read.part(&got.entry, f64::from(step) / f64::from(steps)) {
                    Ok(transform) => pose = transform.after(&pose),
                    Err(message) => return wrong(message, got.entry.span),
                }
            }
            poses.push(pose);
        }
        match AnimatedTransform::new(&poses) {
            Ok(_) => poses,
            Err(problem) => wrong(problem.to_string(), span),
        }
    }
}

/// The largest rotation of `motion` in degrees.
const MOST_TURN: f64 = 2880.0;
/// The rotation between two poses in degrees, well below the half turn at which its direction is ambiguous.
const TURN_STEP: f64 = 45.0;

/// The readers of transforms.
#[derive(Clone, Copy)]
pub(crate) enum TransformReader {
    /// A vector.
    Translation,
    /// Degrees around an axis.
    Rotation(DVec3),
    /// An axis and degrees around it.
    AxisAngle,
    /// One factor, or one for each axis.
    Scale,
    /// The rows of a matrix.
    Matrix,
}

impl TransformReader {
    fn read(self, entry: &Entry) -> Result<Transform, String> {
        match self {
            TransformReader::Translation => {
                Ok(Transform::translate(entry.numbers().map(DVec3::from_array).unwrap_or_default()))
            }
            TransformReader::Rotation(axis) => Transform::rotate(axis, self.degrees(entry)).map_err(|e| e.to_string()),
            TransformReader::AxisAngle => {
                let [x, y, z, degrees] = entry.numbers().unwrap_or_default();
                Transform::rotate(DVec3::new(x, y, z), degrees)
                    .map_err(|_| format!("rotate needs an axis with a direction, got {x} {y} {z}"))
            }
            TransformReader::Scale => {
                let factors = match entry.numbers() {
                    Some([factor]) => DVec3::splat(factor),
                    None => entry.numbers().map(DVec3::from_array).unwrap_or(DVec3::ONE),
                };
                Transform::scale(factors)
                    .map_err(|_| "scale would make the object flat: no factor may be 0 or next to it".into())
            }
            TransformReader::Matrix => matrix(entry),
        }
    }

    /// The degrees of a rotation; 0 for other transforms.
    fn degrees(self, entry: &Entry) -> f64 {
        match self {
            TransformReader::Rotation(_) => entry.numbers().map_or(0.0, |[degrees]| degrees),
            TransformReader::AxisAngle => entry.numbers::<4>().map_or(0.0, |[.., degrees]| degrees),
            TransformReader::Translation | TransformReader::Scale | TransformReader::Matrix => 0.0,
        }
    }

    /// The part `f`, from 0 to 1, of the transform.
    fn part(self, entry: &Entry, f: f64) -> Result<Transform, String> {
        let whole = self.read(entry)?;
        if f == 1.0 {
            return Ok(whole);
        }
        let around = |axis: DVec3| Transform::rotate(axis, self.degrees(entry) * f).map_err(|e| e.to_string());
        match self {
            TransformReader::Rotation(axis) => around(axis),
            TransformReader::AxisAngle => {
                let [x, y, z, _] = entry.numbers().unwrap_or_default();
                around(DVec3::new(x, y, z))
            }
            TransformReader::Translation | TransformReader::Scale | TransformReader::Matrix => {
                AnimatedTransform::new(&[Transform::IDENTITY, whole]).map(|path| path.at(f)).map_err(|e| e.to_string())
            }
        }
    }
}

/// Parses the rows of a 3 × 4 or 4 × 4 matrix, or those of two that are inverse to each other.
fn matrix(got: &Entry) -> Result<Transform, String> {
    let mut rows = [0.0; 12];
    if let Some(both) = got.numbers::<24>() {
        let [forward, inverse] = [&both[..12], &both[12..]].map(affine);
        return Transform::with_inverse(forward, inverse)
            .map_err(|_| "the last 12 numbers of the matrix aren't the inverse of the first 12".into());
    }
    if let Some(all) = got.numbers::<16>() {
        if all[12..] != [0.0, 0.0, 0.0, 1.0] {
            return Err("the last row of the matrix must be 0 0 0 1; perspective is the camera's".into());
        }
        rows.copy_from_slice(&all[..12]);
    } else if let Some(all) = got.numbers() {
        rows = all;
    }
    Transform::new(affine(&rows)).map_err(|_| "the matrix would make the object flat".into())
}

/// The map of three rows of four numbers.
fn affine(m: &[f64]) -> DAffine3 {
    let linear = DMat3::from_cols_array(&[m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]]);
    DAffine3 { matrix3: linear, translation: DVec3::new(m[3], m[7], m[11]) }
}
