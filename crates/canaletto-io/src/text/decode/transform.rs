//! Decoding of transforms, applied in the order in which they are written, and of motion while the shutter is open.

use super::Decoder;
use super::fields::{Entry, Fields};
use crate::text::animate::POSES;
use crate::text::report::Message;
use crate::text::schema::{self, MOTION_WORD};
use canaletto::math::{AnimatedTransform, Transform};
use glam::{DAffine3, DMat3, DVec3};

impl Decoder<'_> {
    /// The composition of the node's transforms; the first line is applied first.
    pub(super) fn transform(&mut self, fields: &Fields) -> Transform {
        let mut all = Transform::IDENTITY;
        for got in fields.transforms.iter().filter(|got| got.is_good()) {
            match single(got) {
                Ok(transform) => all = transform.after(&all),
                Err(message) => {
                    self.valid = false;
                    self.validator.report.push(Message::error(got.span, message));
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
    pub(super) fn placed_in_time(&mut self, fields: &Fields) -> (Transform, Vec<Transform>) {
        let Some(first) = fields.transforms.iter().position(Entry::moves) else {
            return (self.transform(fields), self.motion(fields));
        };
        let span = fields.transforms[first].span;
        // Transforms before the first moving one are constant. The whole is validated at the frame's own time.
        self.transform(fields);
        let mut wrong = |message: String, at| {
            self.valid = false;
            self.validator.report.push(Message::error(at, message));
            (Transform::IDENTITY, Vec::new())
        };
        if fields.has(MOTION_WORD.name) {
            let message = "both keys and motion say how it moves while the shutter is open";
            return wrong(message.into(), fields.span(MOTION_WORD.name));
        }
        let all = |gots: &[Entry], moment: usize| {
            let mut pose = Transform::IDENTITY;
            for got in gots.iter().filter(|got| got.is_good()) {
                pose = single(&got.at(moment)).ok()?.after(&pose);
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
    pub(super) fn motion(&mut self, fields: &Fields) -> Vec<Transform> {
        if !fields.has(MOTION_WORD.name) {
            return Vec::new();
        }
        let Some(inner) = self.block(fields, &schema::MOTION) else { return Vec::new() };
        let span = inner.node.name_span;
        let mut wrong = |message: String, at| {
            self.valid = false;
            self.validator.report.push(Message::error(at, message));
            Vec::new()
        };
        if inner.transforms.is_empty() {
            return wrong("motion has no transforms, so nothing moves".into(), span);
        }
        let angles = inner.transforms.iter().map(|got| match got.word.name {
            "rotate" => got.numbers::<4>().map_or(0.0, |[.., degrees]| degrees.abs()),
            "rotate-x" | "rotate-y" | "rotate-z" => got.numbers().map_or(0.0, |[degrees]| degrees.abs()),
            _ => 0.0,
        });
        let angle: f64 = angles.sum();
        if angle > MOST_TURN {
            return wrong(format!("motion turns by {angle} degrees; it can be up to {MOST_TURN}"), span);
        }
        let steps = ((angle / TURN_STEP).ceil() as u32).max(1);
        let mut poses = Vec::new();
        for step in 0..=steps {
            let mut pose = Transform::IDENTITY;
            for got in &inner.transforms {
                match partly(got, f64::from(step) / f64::from(steps)) {
                    Ok(transform) => pose = transform.after(&pose),
                    Err(message) => return wrong(message, got.span),
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

/// The part `f`, from 0 to 1, of a transform.
fn partly(got: &Entry, f: f64) -> Result<Transform, String> {
    let whole = single(got)?;
    if f == 1.0 {
        return Ok(whole);
    }
    let around = |axis: DVec3, degrees: f64| Transform::rotate(axis, degrees * f).map_err(|e| e.to_string());
    let degrees = || got.numbers().map_or(0.0, |[degrees]| degrees);
    match got.word.name {
        "rotate-x" => around(DVec3::X, degrees()),
        "rotate-y" => around(DVec3::Y, degrees()),
        "rotate-z" => around(DVec3::Z, degrees()),
        "rotate" => {
            let [x, y, z, degrees] = got.numbers().unwrap_or_default();
            around(DVec3::new(x, y, z), degrees)
        }
        _ => AnimatedTransform::new(&[Transform::IDENTITY, whole]).map(|path| path.at(f)).map_err(|e| e.to_string()),
    }
}

fn single(got: &Entry) -> Result<Transform, String> {
    let around = |axis: DVec3| {
        let [degrees] = got.numbers().unwrap_or_default();
        Transform::rotate(axis, degrees).map_err(|e| e.to_string())
    };
    match got.word.name {
        "translate" => Ok(Transform::translate(got.numbers().map(DVec3::from_array).unwrap_or_default())),
        "rotate-x" => around(DVec3::X),
        "rotate-y" => around(DVec3::Y),
        "rotate-z" => around(DVec3::Z),
        "rotate" => {
            let [x, y, z, degrees] = got.numbers().unwrap_or_default();
            Transform::rotate(DVec3::new(x, y, z), degrees)
                .map_err(|_| format!("rotate needs an axis with a direction, got {x} {y} {z}"))
        }
        "scale" => {
            let factors = match got.numbers() {
                Some([factor]) => DVec3::splat(factor),
                None => got.numbers().map(DVec3::from_array).unwrap_or(DVec3::ONE),
            };
            Transform::scale(factors)
                .map_err(|_| "scale would make the object flat: no factor may be 0 or next to it".into())
        }
        _ => matrix(got),
    }
}

/// Parses the rows of a 3 × 4 or 4 × 4 matrix.
fn matrix(got: &Entry) -> Result<Transform, String> {
    let mut rows = [0.0; 12];
    if let Some(all) = got.numbers::<16>() {
        if all[12..] != [0.0, 0.0, 0.0, 1.0] {
            return Err("the last row of the matrix must be 0 0 0 1; perspective is the camera's".into());
        }
        rows.copy_from_slice(&all[..12]);
    } else if let Some(all) = got.numbers() {
        rows = all;
    }
    let m = rows;
    let linear = DMat3::from_cols_array(&[m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]]);
    let forward = DAffine3 { matrix3: linear, translation: DVec3::new(m[3], m[7], m[11]) };
    Transform::new(forward).map_err(|_| "the matrix would make the object flat".into())
}
