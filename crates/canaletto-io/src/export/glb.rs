//! What all writers of glTF share: the binary container (Khronos, *glTF 2.0 Specification*, chapter 4), views of bytes,
//! and cameras.

use canaletto::scene::{CameraProjection, Intrinsics, View};
use glam::{DMat3, DQuat, DVec3};
use serde_json::{Value, json};

/// Numbers of the specification.
pub(super) const FLOAT: u32 = 5126;
pub(super) const UNSIGNED_INT: u32 = 5125;
pub(super) const ARRAY_BUFFER: u32 = 34962;
pub(super) const ELEMENT_ARRAY_BUFFER: u32 = 34963;
pub(super) const LINEAR: u32 = 9729;
pub(super) const LINEAR_MIPMAP_LINEAR: u32 = 9987;
pub(super) const CLAMP_TO_EDGE: u32 = 33071;

/// What to say of a file that would be too large.
pub(super) const TOO_LARGE: &str = "a GLB file holds at most 4 GiB, and this one would hold more";

/// The binary chunk, in views with one kind of content each.
#[derive(Default)]
pub(super) struct Binary {
    pub(super) bytes: Vec<u8>,
    pub(super) views: Vec<Value>,
}

impl Binary {
    /// Adds a view; returns its number. Data begins at a multiple of four bytes.
    pub(super) fn push(&mut self, bytes: &[u8], properties: Value) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        if let (Value::Object(view), Value::Object(properties)) = (&mut view, properties) {
            view.extend(properties);
        }
        self.bytes.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }
}

/// The file of a JSON chunk and a binary chunk.
///
/// None if it would be larger than a container can be.
pub(super) fn container(root: &Value, mut binary: Vec<u8>) -> Option<Vec<u8>> {
    let mut text = root.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let total = 12 + 8 + text.len() + 8 + binary.len();
    let number = |n: usize| u32::try_from(n).ok().map(u32::to_le_bytes);
    let mut bytes = Vec::with_capacity(total);
    bytes.extend_from_slice(b"glTF");
    bytes.extend_from_slice(&2_u32.to_le_bytes());
    bytes.extend_from_slice(&number(total)?);
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &binary)] {
        bytes.extend_from_slice(&number(chunk.len())?);
        bytes.extend_from_slice(kind);
        bytes.extend_from_slice(chunk);
    }
    Some(bytes)
}

/// A camera. `depth` is a distance beyond all that is seen, for cameras that need a far plane.
pub(super) fn camera(view: &View, depth: impl FnOnce() -> f64) -> Value {
    let lens = &view.intrinsics;
    if let CameraProjection::Orthographic { height } = lens.projection {
        let (znear, ymag) = (lens.near.unwrap_or(0.0), height / 2.0);
        let orthographic = json!({
            "xmag": ymag * f64::from(lens.width) / f64::from(lens.height),
            "ymag": ymag,
            "znear": znear,
            "zfar": lens.far.unwrap_or_else(|| depth().max(2.0 * znear)),
        });
        return json!({ "name": view.name, "type": "orthographic", "orthographic": orthographic });
    }
    let mut perspective = json!({
        "yfov": lens.fovy.to_radians(),
        "aspectRatio": f64::from(lens.width) / f64::from(lens.height),
        "znear": lens.near.unwrap_or(Intrinsics::DEFAULT_NEAR),
    });
    if let Some(far) = lens.far {
        perspective["zfar"] = json!(far);
    }
    json!({ "name": view.name, "type": "perspective", "perspective": perspective })
}

/// A distance along the view direction beyond all of these points.
pub(super) fn depth_behind(view: &View, points: impl Iterator<Item = DVec3>) -> f64 {
    let (eye, center) = (view.extrinsics.eye, view.extrinsics.center);
    let forward = (center - eye).normalize_or_zero();
    2.0 * points.map(|p| (p - eye).dot(forward)).fold((center - eye).length(), f64::max)
}

/// A camera's node: it looks along −z with y upwards. `turn` leads to glTF's axes.
pub(super) fn camera_node(view: &View, camera: usize, turn: impl Fn(DVec3) -> DVec3) -> Value {
    let from = &view.extrinsics;
    let [eye, back, up] = [from.eye, from.eye - from.center, from.up].map(turn);
    let z = back.normalize();
    let x = up.cross(z).normalize();
    let rotation = DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize();
    json!({
        "name": view.name, "camera": camera, "translation": eye.to_array(), "rotation": rotation.to_array(),
    })
}
