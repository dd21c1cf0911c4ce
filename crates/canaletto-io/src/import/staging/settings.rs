//! What a user may say of a model's staging.

use canaletto::material::StandardSurface;
use canaletto::math::Rgb;
use canaletto::named;
use glam::DVec3;

/// The staging of a model: the light, the view and the surroundings that its file lacks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Staging {
    /// The light, in place of the file's. Without it, the file's own light, or else [`StageLight::Studio`].
    pub light: Option<StageLight>,
    /// The side that is seen, in place of the file's cameras. Without it, the file's first camera, or else
    /// [`StandardView::ThreeQuarter`].
    pub view: Option<StandardView>,
    /// The axis of the file that points upwards. Without it, that of the format.
    pub up: Option<UpAxis>,
    /// The turn of the model about the vertical in degrees, counter-clockwise seen from above.
    pub turn: f64,
    /// The number of frames in which the model turns about the vertical once; none for a model that doesn't turn.
    pub turntable: Option<u32>,
    /// The box that the model fills in all frames before its turn, so that the camera stays; none for its own pose.
    pub around: Option<[DVec3; 2]>,
    /// The material of objects without one. Without it, one like clay.
    pub material: Option<StandardSurface>,
    /// The background's colour, linear.
    pub background: Option<Rgb>,
    /// What the model stands on.
    pub ground: Ground,
    /// The moment of the model's animation; none for the file's own pose.
    pub moment: Option<Moment>,
    /// Whether frames play the model's first clip, if it has one and no moment is given.
    pub plays: bool,
    /// The name of a variant of the model's materials.
    pub variant: Option<String>,
    /// The number of samples of a picture by paths.
    pub quality: PictureQuality,
    /// Whether the light suits the classic integrators, which need lights: paths find the light of an environment.
    pub classic: bool,
    /// Whether the model gets nothing that it lacks: no camera, no light, no ground and no material.
    pub bare: bool,
}

/// A moment of an animation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moment {
    /// The name of the clip; none for the first.
    pub clip: Option<String>,
    /// The time in seconds from the clip's start. Before its first key and after its last one nothing moves.
    pub seconds: f64,
}

impl Staging {
    /// The default staging with lights for the classic integrators.
    pub fn classic() -> Staging {
        Staging { classic: true, ..Staging::default() }
    }
}

/// The care with which a staged model is rendered by paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum PictureQuality {
    /// 8 samples in a pixel.
    Draft,
    /// 32 samples in a pixel.
    #[default]
    Good,
    /// 256 samples in a pixel.
    Final,
}

named!(PictureQuality {
    Draft => "draft": "8 samples in a pixel, without noise by the fast denoiser",
    Good => "good": "32 samples in a pixel, without noise by the good denoiser",
    Final => "final": "256 samples in a pixel, without noise by the good denoiser",
});

impl PictureQuality {
    /// The number of samples in a pixel.
    pub fn samples(self) -> u32 {
        match self {
            PictureQuality::Draft => 8,
            PictureQuality::Good => 32,
            PictureQuality::Final => 256,
        }
    }
}

/// The light of a staged model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum StageLight {
    /// Softboxes around the model, as a photographer places them. They stay at their places beside the camera.
    #[default]
    Studio,
    /// White light, equal from all sides.
    Neutral,
    /// A clear sky with its sun.
    Sky,
}

named!(StageLight {
    Studio => "studio": "softboxes around the model, at their places beside the camera",
    Neutral => "neutral": "white light, equal from all sides",
    Sky => "sky": "a clear sky with its sun",
});

/// The side of a model that is seen. The front faces +z, up is +y.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum StandardView {
    /// The front.
    Front,
    /// The back.
    Back,
    /// The model's left side, which is the viewer's right of the front.
    Left,
    /// The model's right side.
    Right,
    /// From above, with the front below.
    Top,
    /// Equal angles with all three axes.
    Iso,
    /// The front, a little from the right and above.
    #[default]
    ThreeQuarter,
}

named!(StandardView {
    Front => "front": "the front, which faces +z",
    Back => "back": "the back",
    Left => "left": "the model's left side, towards +x",
    Right => "right": "the model's right side, towards -x",
    Top => "top": "from above, with the front below",
    Iso => "iso": "the front from the right and above, with equal angles to all axes",
    ThreeQuarter => "three-quarter": "the front, a little from the right and above",
});

impl StandardView {
    /// The unit direction from the model to the eye, and what is upwards in the picture.
    pub(super) fn directions(self) -> [DVec3; 2] {
        let (right, above) = match self {
            StandardView::Front => (0.0, 0.0),
            StandardView::Back => (180.0, 0.0),
            StandardView::Left => (90.0, 0.0),
            StandardView::Right => (-90.0, 0.0),
            StandardView::Top => return [DVec3::Y, DVec3::NEG_Z],
            StandardView::Iso => (45.0, libm::atan(std::f64::consts::FRAC_1_SQRT_2).to_degrees()),
            StandardView::ThreeQuarter => (30.0, 20.0),
        };
        [super::direction_at(right, above), DVec3::Y]
    }
}

/// The axis of a file that points upwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum UpAxis {
    /// +y, as in glTF and most models.
    Y,
    /// +z, as in scans, plans and files for 3-D printers.
    Z,
}

named!(UpAxis {
    Y => "y": "+y, as in glTF and most models",
    Z => "z": "+z, as in scans, plans and files for 3-D printers",
});

/// What a staged model stands on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Ground {
    /// A floor that looks like the background but for the shadows on it.
    #[default]
    Shadow,
    /// Nothing.
    None,
    /// A floor of this colour, linear.
    Color(Rgb),
}
