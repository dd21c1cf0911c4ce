//! Objects, cameras and points that follow a path.

use super::Animator;
use crate::animation::Path;
use crate::text::nodes::{
    ALONG, AT, CAMERA_FOLLOW, CENTER, EYE, FACE, FOLLOW, FOLLOWED, MATRIX, POINT_FOLLOW, TRANSLATE, UP,
};
use crate::text::reader::Fields;
use crate::text::report::Message;
use crate::text::schema::{FieldSchema, NodeSchema};
use crate::text::syntax::{Node, Span, Value, ValueKind};
use canaletto::camera::{continue_roll, has_roll};
use canaletto::scene::Extrinsics;
use glam::{DMat3, DVec3};

/// The values of a `follow` node: those of the frame, and those while the shutter is open.
struct Moments {
    now: Vec<f64>,
    moving: Vec<Vec<f64>>,
}

impl Animator<'_> {
    /// Replaces `follow` among transforms by `matrix`.
    pub(super) fn follow_with_object(&mut self, node: &mut Node) {
        let moments = self.follow(node, &FOLLOW, |path, fields, share| {
            let (point, ahead) = path.at(share);
            let turn = match fields.get(&FACE) {
                None => DMat3::IDENTITY,
                Some(face) => {
                    let up = fields.get(&UP).unwrap_or(DVec3::Y);
                    let there = roll_along(path, share, up).unwrap_or(up);
                    facing(face, ahead, up, there).map_err(|problem| (fields.span(&FACE), problem))?
                }
            };
            // `matrix` takes its numbers row by row.
            let row = |i: usize| [turn.row(i).x, turn.row(i).y, turn.row(i).z, point[i]];
            Ok((0..3).flat_map(row).collect())
        });
        // After a mistake the object keeps its place.
        *node = match moments {
            Some(moments) => replaced(MATRIX.name(), node, moments),
            None => Node { broken: true, ..Node::new(TRANSLATE.name(), node.name_span) },
        };
    }

    /// Replaces `follow` in a camera by `eye`, and by `center` too if the camera faces along the path.
    pub(super) fn follow_with_camera(&mut self, camera: &mut Node, at: usize) {
        let mut node = camera.children[at].clone();
        let mut along = false;
        let eye = self.follow(&mut node, &CAMERA_FOLLOW, |path, fields, share| {
            along = fields.get(&ALONG).unwrap_or(false);
            Ok(path.at(share).0.to_array().into())
        });
        let words = [EYE.name(), CENTER.name()];
        for word in if along { &words[..] } else { &words[..1] } {
            let property = camera.properties.iter().find(|p| &*p.key == *word).map(|p| p.key_span);
            let child = camera.children.iter().find(|c| &*c.name == *word).map(|c| c.name_span);
            if let Some(span) = child.or(property) {
                let message = Message::error(span, format!("the camera has both {word} and follow"));
                self.validator.report.push(message.help(if *word == CENTER.name() {
                    "leave out center, or along: then it looks at the center"
                } else {
                    "leave out one of them: the path says where the eye is"
                }));
                camera.children.remove(at);
                camera.broken = true;
                return;
            }
        }
        let Some(eye) = eye else {
            camera.children.remove(at);
            camera.broken = true;
            return;
        };
        if along {
            let center = self.follow(&mut node, &CAMERA_FOLLOW, |path, _, share| {
                let (point, ahead) = path.at(share);
                // The centre lies as far ahead as the path is long, so that the camera scales with the scene.
                Ok((point + ahead * path.length()).to_array().into())
            });
            camera.children.extend(center.map(|center| replaced(CENTER.name(), &node, center)));
        }
        camera.children[at] = replaced(EYE.name(), &node, eye);
    }

    /// Replaces `follow` in place of a point by the point's numbers.
    pub(super) fn follow_with_point(&mut self, node: &mut Node, word: &'static FieldSchema) {
        let Some(at) = node.children.iter().position(|child| *child.name == *FOLLOW.name) else { return };
        let mut inner = node.children.remove(at);
        if let Some(value) = node.values.first() {
            let message = format!("{} has both numbers and a path", word.name);
            self.validator.report.error(value.span, message);
            node.broken = true;
            return;
        }
        let point = self.follow(&mut inner, &POINT_FOLLOW, |path, _, share| Ok(path.at(share).0.to_array().into()));
        match point {
            Some(point) => {
                let new = replaced(&node.name, &inner, point);
                (node.values, node.moving) = (new.values, new.moving);
            }
            None => node.broken = true,
        }
    }

    /// The values that `make` computes from the path, the fields and the arc-length share that a node names.
    fn follow(
        &mut self,
        node: &mut Node,
        words: &'static NodeSchema,
        mut make: impl FnMut(&Path, &Fields, f64) -> Result<Vec<f64>, (Span, String)>,
    ) -> Option<Moments> {
        self.node(node, words);
        let fields = self.validator.fields(node, words, words.name);
        if !fields.valid {
            return None;
        }
        let name = fields.text(&FOLLOWED)?;
        let Some((path, _)) = self.paths.get(name) else {
            let known: Vec<&str> = self.paths.keys().map(String::as_str).collect();
            self.validator.unknown_name("path", name, fields.span(&FOLLOWED), known.iter().copied());
            return None;
        };
        let path = path.as_ref()?;
        let share = fields.get(&AT).unwrap_or(0.0);
        let shares: Vec<f64> = fields.raw(&AT).map_or(Vec::new(), |got| got.moving());
        let all: Result<Vec<Vec<f64>>, _> =
            std::iter::once(share).chain(shares).map(|share| make(path, &fields, share)).collect();
        match all {
            Ok(mut all) => {
                let now = all.remove(0);
                Some(Moments { now, moving: all })
            }
            Err((span, problem)) => {
                self.validator.report.error(span, problem);
                None
            }
        }
    }
}

/// A node of values that replaces `old`.
fn replaced(name: &str, old: &Node, moments: Moments) -> Node {
    let values = |numbers: Vec<f64>| -> Vec<Value> {
        numbers.into_iter().map(|n| Value { kind: ValueKind::Number(n), span: old.span }).collect()
    };
    let moving = moments.moving.into_iter().map(values).collect();
    Node { span: old.span, values: values(moments.now), moving, ..Node::new(name, old.name_span) }
}

/// The up direction of an object on a path where the tangent is parallel to `up`. It is that of the nearest place
/// before it that has one, or else after it. Returns `None` where `up` itself is usable, and where the whole path is
/// straight.
fn roll_along(path: &Path, share: f64, up: DVec3) -> Option<DVec3> {
    let place = |share: f64| Extrinsics { eye: DVec3::ZERO, center: path.at(share).1, up };
    let here = place(share);
    if has_roll(&here) {
        return None;
    }
    let steps = || (0..=20).rev().map(|k| libm::exp2(-f64::from(k)));
    let before = steps().map(|step| share - step).filter(|share| *share >= 0.0);
    let after = steps().map(|step| share + step).filter(|share| *share <= 1.0);
    before.chain(after).find_map(|share| continue_roll(&here, &place(share))).map(|kept| kept.up)
}

/// The rotation that takes `face` to `ahead`. The image of `up` is as near to `up_there` as possible.
fn facing(face: DVec3, ahead: DVec3, up: DVec3, up_there: DVec3) -> Result<DMat3, String> {
    let frame = |forward: DVec3, up: DVec3| {
        let forward = forward.try_normalize()?;
        let side = up.try_normalize()?.cross(forward);
        // Below this the sine holds no digits of `up`, as for cameras.
        (side.length() > 1e-9).then(|| {
            let side = side.normalize();
            DMat3::from_cols(forward, side, forward.cross(side))
        })
    };
    let own = frame(face, up).ok_or("face is parallel to up, or one of them is zero: what is up then?")?;
    let there = frame(ahead, up_there).ok_or("the whole path leads straight along up: choose another up")?;
    Ok(there * own.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::animation::PathCurve;

    #[test]
    fn an_object_faces_ahead_and_stays_upright() {
        let turn = facing(DVec3::Z, DVec3::X, DVec3::Y, DVec3::Y).unwrap();
        assert_eq!((turn * DVec3::Z, turn * DVec3::Y), (DVec3::X, DVec3::Y));
        let climbing = facing(DVec3::NEG_Z, DVec3::new(1.0, 1.0, 0.0), DVec3::Y, DVec3::Y).unwrap();
        assert!((climbing * DVec3::NEG_Z - DVec3::new(1.0, 1.0, 0.0).normalize()).length() < 1e-15);
        assert!((climbing * DVec3::Y).y > 0.7 && (climbing.determinant() - 1.0).abs() < 1e-15);
        assert!(facing(DVec3::Y, DVec3::X, DVec3::Y, DVec3::Y).is_err());
        assert!(facing(DVec3::X, DVec3::Y, DVec3::Y, DVec3::Y).is_err());
    }

    #[test]
    fn an_object_that_goes_straight_up_keeps_its_roll() {
        let points = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::new(0.0, 1.0, 0.0)];
        let path = Path::new(&points, PathCurve::Line, false).unwrap();
        assert_eq!(roll_along(&path, 0.1, DVec3::Y), None);
        // The object came along +x with its up direction +y, so this direction here is -x.
        let up = roll_along(&path, 0.5, DVec3::Y).unwrap();
        assert!((up - DVec3::NEG_X).length() < 1e-12, "{up}");
        let turn = facing(DVec3::Z, path.at(0.5).1, DVec3::Y, up).unwrap();
        assert!((turn * DVec3::Z - DVec3::Y).length() < 1e-12 && (turn * DVec3::Y - DVec3::NEG_X).length() < 1e-12);
        let straight = Path::new(&[DVec3::ZERO, DVec3::Y], PathCurve::Line, false).unwrap();
        assert_eq!(roll_along(&straight, 0.5, DVec3::Y), None);
        assert!(facing(DVec3::Z, DVec3::Y, DVec3::Y, DVec3::Y).unwrap_err().contains("the whole path"));
    }
}
