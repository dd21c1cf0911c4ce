//! Scene files: a scene text or a model, told apart by the extension of the file's name.

use crate::assets::{AssetPath, Assets};
use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::import::{self, ModelFormat, Moment, Staging};
use crate::source::{SceneSource, Timeline};
use crate::text::{SceneDocument, set_in_model};
use canaletto::Named;
use canaletto::math::Transform;
use canaletto::scene::{Extrinsics, Integrator, PathSettings, Scene};
use canaletto::shape::{Mesh, MeshPose};
use glam::DVec3;

/// The reasons why a source can't be opened.
#[derive(Debug)]
pub enum OpenError {
    /// The extension is that of neither a scene text nor a model.
    UnknownFormat,
    /// The text can't be parsed.
    Mistakes(Diagnostics),
}

/// The extension of scene texts.
const TEXT_EXTENSION: &str = "kdl";

/// Opens a scene file. `set` holds overrides, as [`crate::text::read_scene_with`] takes them. `staging` is for models.
///
/// ```
/// use canaletto_io::assets::MemoryAssets;
/// use canaletto_io::import::Staging;
/// use canaletto_io::scene_file::open;
///
/// let assets = MemoryAssets::new().with("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n");
/// let mut source = open("a.obj", &assets, &["camera.fovy=20".to_owned()], &Staging::default())
///     .expect("OBJ is a known format");
/// let (scene, warnings) = source.scene(&assets, 0.0)?;
/// assert_eq!(scene.views[0].intrinsics.fovy, 20.0);
/// # Ok::<(), canaletto_io::diagnostic::Diagnostics>(())
/// ```
///
/// # Errors
/// [`OpenError`]. Mistakes that leave a part of the text are returned by [`SceneSource::scene`], as are those of
/// models.
pub fn open(
    file: &str,
    assets: &dyn Assets,
    set: &[String],
    staging: &Staging,
) -> Result<Box<dyn SceneSource>, OpenError> {
    let extension = AssetPath::new(file, file, file).extension();
    if extension == TEXT_EXTENSION {
        return match SceneDocument::read(file, assets, set) {
            Ok(document) => Ok(Box::new(document)),
            Err(mistakes) => Err(OpenError::Mistakes(mistakes)),
        };
    }
    match ModelFormat::of_extension(&extension) {
        None => Err(OpenError::UnknownFormat),
        Some(_) => Model::new(file, assets, set, staging)
            .map(|model| Box::new(model) as Box<dyn SceneSource>)
            .map_err(OpenError::Mistakes),
    }
}

/// A model file. Its scene changes with the frame if it plays a clip or turns, else it is one for all frames.
#[derive(Clone, Debug)]
struct Model {
    file: String,
    /// The overrides of its scene.
    set: Vec<String>,
    staging: Staging,
    /// The length of its clip in seconds from the moment of frame 0 on.
    length: Option<f64>,
    timeline: Timeline,
    /// The camera whose shutter counts; none for the first.
    camera: Option<String>,
}

impl Model {
    /// The model of this file, which is read by [`SceneSource::scene`]. The overrides can change the camera, the film,
    /// the integrator, the background, the ambient light, materials and lights.
    fn new(file: &str, assets: &dyn Assets, set: &[String], staging: &Staging) -> Result<Model, Diagnostics> {
        // The last of several assignments counts.
        let named = set.iter().rev().find_map(|set| set.split_once('=').filter(|(key, _)| key.trim() == "integrator"));
        let is_classic = named
            .is_some_and(|(_, word)| word.trim().trim_matches('"') != Integrator::Path(PathSettings::DEFAULT).name());
        let mut staging = Staging { classic: staging.classic || is_classic, ..staging.clone() };
        let mut timeline = Timeline { seconds: true, ..Timeline::default() };
        let mut length = None;
        if let Some(moment) = staging.moment.clone().or_else(|| staging.plays.then(Moment::default)) {
            length = import::duration(file, assets, moment.clip.as_deref())?.map(|length| length - moment.seconds);
            timeline.moves = length.is_some_and(|length| length > 0.0);
            // Without clips a model that plays keeps its file's own pose.
            if length.is_some() {
                staging.moment = Some(moment);
            }
        }
        timeline.moves |= staging.turntable.is_some();
        let mut model = Model { file: file.to_owned(), set: set.to_vec(), staging, length, timeline, camera: None };
        model.set_fps(Timeline::DEFAULT_FPS);
        Ok(model)
    }
}

impl SceneSource for Model {
    fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    fn set_fps(&mut self, fps: f64) {
        self.timeline.fps = fps;
        let last = |length: f64| (length * fps).round().clamp(0.0, f64::from(u32::MAX)) as u32;
        self.timeline.frames = match self.staging.turntable {
            Some(frames) => Some([0, frames.max(1) - 1]),
            None => self.length.map(|length| [0, last(length)]),
        };
    }

    fn use_shutter_of(&mut self, camera: &str) {
        self.camera = Some(camera.to_owned());
    }

    /// A model without a camera is never a reason for a warning.
    fn use_no_camera(&mut self) {}

    fn key_frames(&self) -> Vec<f64> {
        Vec::new()
    }

    /// The files that a model names are all read with it.
    fn texts(&self) -> Vec<(&str, &AssetPath)> {
        Vec::new()
    }

    fn scene(&mut self, assets: &dyn Assets, frame: f64) -> Result<(Scene, Diagnostics), Diagnostics> {
        if self.timeline.moves && self.staging.around.is_none() {
            self.staging.around = self.extent(assets)?;
        }
        let (mut scene, mut warnings) = import::load(&self.file, assets, &self.at(frame))?;
        if !self.set.is_empty() {
            let more;
            (scene, more) = set_in_model(scene, &self.file, assets, &self.set)?;
            warnings.append(more);
        }
        let view = scene.views.iter().find(|view| Some(&view.name) == self.camera.as_ref()).or(scene.views.first());
        let [open, close] = view.map_or([0.0; 2], |view| view.intrinsics.shutter);
        if self.timeline.moves && open < close {
            let times = (0..POSES).map(|i| frame + open + (close - open) * i as f64 / (POSES - 1) as f64);
            let poses = times.map(|time| import::load(&self.file, assets, &self.at(time)).map(|(scene, _)| scene));
            warnings.append(self.blur(&mut scene, &poses.collect::<Result<Vec<Scene>, _>>()?));
        }
        Ok((scene, warnings))
    }
}

/// The number of poses while the shutter is open. A model is read for each of them.
const POSES: usize = 5;

/// The number of moments of a clip at which its extent is measured.
const MOMENTS: usize = 9;

impl Model {
    /// The staging of a frame.
    fn at(&self, frame: f64) -> Staging {
        let mut staging = self.staging.clone();
        if let Some(moment) = &mut staging.moment {
            moment.seconds += frame / self.timeline.fps;
        }
        if let Some(frames) = staging.turntable {
            staging.turn += 360.0 * frame / f64::from(frames.max(1));
        }
        staging
    }

    /// The box that the model fills in all frames.
    fn extent(&self, assets: &dyn Assets) -> Result<Option<[DVec3; 2]>, Diagnostics> {
        let last = f64::from(self.timeline.frames.map_or(0, |[_, last]| last));
        let moments = if self.length.is_some() { MOMENTS } else { 1 };
        let mut around: Option<[DVec3; 2]> = None;
        for i in 0..moments {
            let frame = last * i as f64 / (moments - 1).max(1) as f64;
            if let Some([low, high]) = import::extent(&self.file, assets, &self.at(frame))? {
                around = Some(around.map_or([low, high], |[a, b]| [a.min(low), b.max(high)]));
            }
        }
        Ok(around)
    }

    /// Gives objects, cameras and vertices that move between poses their motion. Objects and cameras go through all
    /// poses, vertices on a line from the first to the last.
    fn blur(&self, scene: &mut Scene, poses: &[Scene]) -> Diagnostics {
        let mut warnings = Diagnostics::new();
        if poses.iter().any(|pose| pose.nodes.len() != scene.nodes.len() || pose.views.len() != scene.views.len()) {
            let message = "objects come and go while the shutter is open; they have no motion blur";
            warnings.push(Diagnostic::warning(&self.file, message));
            return warnings;
        }
        for (i, node) in scene.nodes.iter_mut().enumerate() {
            let still = node.transform.clone();
            let motion: Vec<Transform> =
                poses.iter().map(|pose| pose.nodes[i].transform.after(&still.inverse())).collect();
            if poses.iter().any(|pose| pose.nodes[i].transform != still) {
                node.motion = motion.into();
            }
        }
        for (i, view) in scene.views.iter_mut().enumerate() {
            let motion: Vec<Extrinsics> = poses.iter().map(|pose| pose.views[i].extrinsics).collect();
            if motion.iter().any(|pose| *pose != view.extrinsics) {
                view.motion = motion;
            }
        }
        let [Some(first), Some(last)] = [poses.first(), poses.last()] else { return warnings };
        // Nodes share a mesh while they have one pose.
        if [first, last].iter().any(|pose| pose.meshes.len() != scene.meshes.len()) {
            let message = "nodes of one mesh have equal poses only at times; vertices have no motion blur";
            warnings.push(Diagnostic::warning(&self.file, message));
            return warnings;
        }
        for (i, mesh) in scene.meshes.iter_mut().enumerate() {
            let [Some(open), Some(close)] = [first, last].map(|pose| pose.meshes.get(i)) else { continue };
            if open.positions == close.positions && open.normals == close.normals {
                continue;
            }
            if [open, close].iter().any(|pose| pose.len() != mesh.len()) {
                let message =
                    format!("mesh \"{}\" has other triangles later; its vertices have no motion blur", mesh.name);
                warnings.push(Diagnostic::warning(&self.file, message));
                continue;
            }
            let pose = pose_of(mesh, open);
            (mesh.positions, mesh.normals, mesh.tangents) = (pose.positions, pose.normals, pose.tangents);
            mesh.end_pose = Some(Box::new(pose_of(mesh, close)));
        }
        warnings
    }
}

/// The vertices of a mesh in the pose of another mesh with the same triangles. The other's vertices may have other
/// numbers, since tangents split them.
fn pose_of(mesh: &Mesh, posed: &Mesh) -> MeshPose {
    let mut pose =
        MeshPose { positions: mesh.positions.clone(), normals: mesh.normals.clone(), tangents: mesh.tangents.clone() };
    let shift = posed.origin - mesh.origin;
    for (to, from) in mesh.triangles.as_flattened().iter().zip(posed.triangles.as_flattened()) {
        let (to, from) = (*to as usize, *from as usize);
        pose.positions[to] = (posed.positions[from].as_dvec3() + shift).as_vec3();
        if let (Some(to), Some(from)) = (pose.normals.get_mut(to), posed.normals.get(from)) {
            *to = *from;
        }
        if let (Some(to), Some(from)) = (pose.tangents.get_mut(to), posed.tangents.get(from)) {
            *to = from.truncate().extend(to.w);
        }
    }
    pose
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::MemoryAssets;

    /// A turning model is seen by one camera, from the same floor, and leaves its floor's place.
    #[test]
    fn the_camera_of_a_turntable_stays() {
        let assets = MemoryAssets::new().with("a.obj", "v 3 0 0\nv 5 0 0\nv 5 1 0\nv 3 1 2\nf 1 2 3\nf 1 3 4\n");
        let staging = Staging { turntable: Some(8), ..Staging::default() };
        let open = |set: &[String]| open("a.obj", &assets, set, &staging).unwrap();
        let mut source = open(&[]);
        let frames: Vec<Scene> = [0.0, 2.0, 5.0].map(|frame| source.scene(&assets, frame).unwrap().0).into();
        assert!(frames.iter().all(|scene| scene.views == frames[0].views));
        assert!(frames[1].nodes[0].transform != frames[0].nodes[0].transform);
        assert!(frames.iter().all(|scene| scene.nodes[0].motion.is_usual()));
        // The middle of the box is at its place in all frames.
        let middle = |scene: &Scene| scene.nodes[0].transform.point(DVec3::new(4.0, 0.5, 1.0));
        assert!(frames.iter().all(|scene| (middle(scene) - middle(&frames[0])).length() < 1e-9));
        let mut blurred = open(&["camera.shutter=0 0.5".to_owned()]);
        let (scene, warnings) = blurred.scene(&assets, 2.0).unwrap();
        assert_eq!((scene.nodes[0].motion.len(), warnings.to_string()), (POSES, String::new()));
        // The first pose is that of the frame, and the last one is an eighth of an eighth of a turn further.
        let [first, last] = [0, POSES - 1].map(|pose| scene.nodes[0].motion[pose].vector(DVec3::Z));
        assert!((first - DVec3::Z).length() < 1e-12, "{first}");
        assert!((first.angle_between(last).to_degrees() - 22.5).abs() < 1e-9, "{last}");
        assert!(scene.nodes.last().unwrap().motion.is_usual(), "the floor is at rest");
    }
}
