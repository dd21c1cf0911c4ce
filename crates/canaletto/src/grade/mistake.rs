//! The mistakes that ray tracers of beginners make, each with what is wrong and the equation that says what is right.

use crate::named;
use crate::scene::Stage;

/// A mistake in a ray tracer of the chapter's kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Mistake {
    /// Rows are stored from the bottom.
    UpsideDown,
    /// x̂ points to the left.
    Mirrored,
    /// The ray goes through another place of the pixel than the scene says.
    RayPlace,
    /// The tangent of the whole angle of view.
    WholeAngle,
    /// The angle of view is taken for the horizontal one.
    HorizontalAngle,
    /// The window is square whatever the picture's size.
    SquareWindow,
    /// The hit isn't the nearest one.
    NotNearest,
    /// The curve of the display is missing, or there is one too many.
    Gamma,
    /// Red and blue are exchanged.
    SwappedChannels,
    /// Values over 1 wrap around.
    Overflow,
    /// Rays without a hit are black.
    BlackBackground,
    /// The ambient term is missing.
    NoAmbient,
    /// The ambient term isn't multiplied by kd.
    AmbientWithoutKd,
    /// The ambient term is added for each light.
    AmbientPerLight,
    /// The diffuse term is missing.
    NoDiffuse,
    /// n·L isn't cut off at 0.
    MissingMax,
    /// |n·L| in place of max(0, n·L).
    AbsoluteCosine,
    /// L isn't divided by its length.
    LightNotNormalised,
    /// L points from the light to the surface.
    LightReversed,
    /// The light's intensity isn't used.
    NoIntensity,
    /// Attenuation, cone and region aren't used.
    NoAttenuation,
    /// Only the first light is used.
    FirstLightOnly,
    /// The normal isn't turned to the viewer inside of bodies.
    NormalNotFlipped,
    /// The specular term is missing.
    NoSpecular,
    /// The exponent is another number.
    Exponent,
    /// n·h in place of r·L.
    HalfVector,
    /// r has the wrong sign.
    SpecularSign,
    /// (r·L)ⁿ isn't cut off at 0.
    SpecularMissingMax,
    /// Highlights appear on sides that the light doesn't reach.
    SpecularUnguarded,
    /// Highlights are multiplied by kd.
    SpecularTimesKd,
    /// There are no shadows.
    NoShadows,
    /// Surfaces block their own light.
    ShadowAcne,
    /// Objects beyond the light block it.
    ShadowBeyondLight,
    /// Clear bodies block all light.
    OpaqueShadows,
    /// Shadows take the ambient light, too.
    ShadowedAmbient,
    /// There are no reflected rays.
    NoReflection,
    /// The reflected colour isn't multiplied by k.
    ReflectionWithoutK,
    /// The reflected ray has a wrong direction.
    ReflectedVector,
    /// The own colour is multiplied by 1 − k.
    BlendedReflection,
    /// Rays end too early.
    ShallowRecursion,
    /// There are no refracted rays.
    NoRefraction,
    /// ηₜ/ηᵢ in place of ηᵢ/ηₜ.
    EtaInverted,
    /// ηᵢ/ηₜ of entering is used when leaving, too.
    EtaNotSwapped,
    /// Rays go straight through.
    Unbent,
    /// Beyond the critical angle nothing is added.
    NoTotalReflection,
    /// The refracted colour isn't multiplied by 1 − o.
    RefractionWithoutFactor,
    /// The refracted colour is multiplied by o.
    OpacityReversed,
    /// The own colour is multiplied by o.
    BlendedRefraction,
    /// Textures are missing.
    NoTextures,
}

named!(Mistake {
    UpsideDown => "upside-down": "the rows are stored from the bottom: y grows upwards in (5.10), downwards in files",
    Mirrored => "mirrored": "left and right are exchanged: the camera's x axis is up x z, not z x up (5.3)",
    RayPlace => "ray-place": "rays go through another place of the pixel: its corner (x, y) or its centre (x + 1/2, y + 1/2)",
    WholeAngle => "whole-angle": "the window's height is 2 df tan(fovy / 2), with half of the angle (5.2b)",
    HorizontalAngle => "horizontal-angle": "fovy is the vertical angle of view, not the horizontal one (5.2b)",
    SquareWindow => "square-window": "the window's base is its height times width / height of the picture (5.2c)",
    NotNearest => "not-nearest": "of all hits the nearest with t > 0 counts (box 5.1)",
    Gamma => "gamma": "the values are stored with another curve than the scene's transfer: one too many, or one too few",
    SwappedChannels => "swapped-channels": "red and blue are exchanged",
    Overflow => "overflow": "values over 1 wrap around to dark ones: cut them at 1 before they become bytes (5.36)",
    BlackBackground => "black-background": "rays that hit nothing have the background's colour (box 5.8)",
    NoAmbient => "no-ambient": "the ambient term Ia kd is missing (5.33)",
    AmbientWithoutKd => "ambient-without-kd": "the ambient light Ia is multiplied by kd (5.33)",
    AmbientPerLight => "ambient-per-light": "the ambient term is added once, not for each light (5.39a)",
    NoDiffuse => "no-diffuse": "the diffuse term l kd (n.L) is missing (5.32)",
    MissingMax => "missing-max": "where n.L < 0 the light adds 0 and takes nothing away: max(0, n.L) (5.32)",
    AbsoluteCosine => "absolute-cosine": "light behind the surface adds nothing: max(0, n.L), not |n.L| (5.32)",
    LightNotNormalised => "light-not-normalised": "L is a unit vector: divide it by its length (5.32)",
    LightReversed => "light-reversed": "L points from the surface to the light: light minus p, not p minus light (5.32)",
    NoIntensity => "no-intensity": "the light's intensity l multiplies its terms (5.32)",
    NoAttenuation => "no-attenuation": "light is weakened by distance, and by a spot's cone (5.25)",
    FirstLightOnly => "first-light-only": "the terms of all lights are summed (5.39a)",
    NormalNotFlipped => "normal-not-flipped": "inside a body the normal is turned towards the viewer: n = -n where n.v < 0 (box 5.8)",
    NoSpecular => "no-specular": "the specular term l ks (r.L)^n is missing (5.38)",
    Exponent => "exponent": "highlights have the size of another exponent n (5.38)",
    HalfVector => "half-vector": "the cosine of highlights is r.L, not n.h of the vector half-way (5.38)",
    SpecularSign => "specular-sign": "r = 2 (v.n) n - v with v towards the viewer: here it has the opposite sign (5.37)",
    SpecularMissingMax => "specular-missing-max": "where r.L < 0 there is no highlight: max(0, r.L)^n (5.38)",
    SpecularUnguarded => "specular-unguarded": "where n.L <= 0 there is no highlight either (5.38)",
    SpecularTimesKd => "specular-times-kd": "highlights are multiplied by ks alone, not by kd (5.38)",
    NoShadows => "no-shadows": "the factor f_s of shadows is missing (5.39a)",
    ShadowAcne => "shadow-acne": "surfaces block their own light: start shadow rays a little off the surface",
    ShadowBeyondLight => "shadow-beyond-light": "only what lies between p and the light blocks it: 0 < t < distance (5.39a)",
    OpaqueShadows => "opaque-shadows": "clear bodies let the share 1 - o of the light through (5.39a)",
    ShadowedAmbient => "shadowed-ambient": "shadows don't take the ambient light (5.39a)",
    NoReflection => "no-reflection": "the reflected term k I(r) is missing (5.39b)",
    ReflectionWithoutK => "reflection-without-k": "the reflected colour is multiplied by k (5.39b)",
    ReflectedVector => "reflected-vector": "the reflected ray has a wrong direction: it is r = 2 (v.n) n - v (5.37)",
    BlendedReflection => "blended-reflection": "the own colour is added whole, not times 1 - k (5.39b)",
    ShallowRecursion => "shallow-recursion": "rays end before the scene's max-depth (box 5.8)",
    NoRefraction => "no-refraction": "the refracted term (1 - o) I(t) is missing (5.39b)",
    EtaInverted => "eta-inverted": "the ratio of refraction is upside down: sin(t) = (ni / nt) sin(i) (5.43)",
    EtaNotSwapped => "eta-not-swapped": "a ray that leaves the body has ni = eta and nt = 1 (5.43)",
    Unbent => "unbent": "refracted rays are bent by Snell's law (5.43), not straight on",
    NoTotalReflection => "no-total-reflection": "beyond the critical angle the mirrored ray takes the refracted one's place",
    RefractionWithoutFactor => "refraction-without-factor": "the refracted colour is multiplied by 1 - o (5.39b)",
    OpacityReversed => "opacity-reversed": "the factor of the refracted colour is 1 - o, not o (5.39b)",
    BlendedRefraction => "blended-refraction": "the own colour is added whole, not times o (5.39b)",
    NoTextures => "no-textures": "the textures are missing (5.5)",
});

/// Forms of mistakes that are made in several ways. The first form of all others is 0.
pub(super) mod form {
    /// The hit is the farthest one.
    pub(in super::super) const FARTHEST_HIT: f64 = 0.0;
    /// The hit is the first one of the object that comes last in the scene.
    pub(in super::super) const LAST_OBJECT: f64 = 1.0;
    /// The sRGB curve is applied once more.
    pub(in super::super) const EXTRA_CURVE: f64 = 0.0;
    /// The sRGB curve is undone.
    pub(in super::super) const UNDONE_CURVE: f64 = 1.0;
    /// The power 1 / 2.2 is applied once more.
    pub(in super::super) const EXTRA_POWER: f64 = 2.0;
    /// The power 1 / 2.2 is undone.
    pub(in super::super) const UNDONE_POWER: f64 = 3.0;
    /// The long light vector stands in both terms.
    pub(in super::super) const LONG_IN_BOTH_TERMS: f64 = 0.0;
    /// The long light vector stands in the diffuse term only.
    pub(in super::super) const LONG_IN_DIFFUSE: f64 = 1.0;
    /// Light from behind is blocked by the body itself.
    pub(in super::super) const BLOCKED_BEHIND: f64 = 0.0;
    /// Light from behind arrives, since shadow rays are traced only where n·L > 0.
    pub(in super::super) const UNBLOCKED_BEHIND: f64 = 1.0;
    /// v has the wrong sign in r.
    pub(in super::super) const SIGN_OF_V: f64 = 0.0;
    /// The whole vector has the wrong sign.
    pub(in super::super) const SIGN_OF_R: f64 = 1.0;
    /// The reflected ray is that of [`SIGN_OF_R`].
    pub(in super::super) const REFLECTS_INWARDS: f64 = 0.0;
    /// The first light's direction is mirrored in place of v.
    pub(in super::super) const REFLECTS_LIGHT: f64 = 1.0;
    /// The reflected ray is that of [`SIGN_OF_V`].
    pub(in super::super) const REFLECTS_ON: f64 = 2.0;
    /// The exponent is 1 in place of n.
    pub(in super::super) const NO_EXPONENT: f64 = 0.0;
}

impl Mistake {
    /// The amounts that are tried: factors, or forms of the mistake.
    pub(super) fn amounts(self) -> &'static [f64] {
        match self {
            // Factors of n.
            Mistake::Exponent => &[form::NO_EXPONENT, 0.25, 0.5, 2.0, 4.0],
            // The largest depth.
            Mistake::ShallowRecursion => &[2.0, 3.0],
            Mistake::ReflectedVector => &[form::REFLECTS_INWARDS, form::REFLECTS_LIGHT, form::REFLECTS_ON],
            Mistake::Gamma => &[form::EXTRA_CURVE, form::UNDONE_CURVE, form::EXTRA_POWER, form::UNDONE_POWER],
            Mistake::NotNearest => &[form::FARTHEST_HIT, form::LAST_OBJECT],
            Mistake::SpecularSign => &[form::SIGN_OF_V, form::SIGN_OF_R],
            Mistake::LightNotNormalised => &[form::LONG_IN_BOTH_TERMS, form::LONG_IN_DIFFUSE],
            Mistake::MissingMax
            | Mistake::AbsoluteCosine
            | Mistake::SpecularUnguarded
            | Mistake::SpecularMissingMax => &[form::BLOCKED_BEHIND, form::UNBLOCKED_BEHIND],
            _ => &[0.0],
        }
    }

    /// The first stage whose picture the mistake can change.
    pub(super) fn first_stage(self) -> Stage {
        use Mistake::*;
        match self {
            UpsideDown | Mirrored | RayPlace | WholeAngle | HorizontalAngle | SquareWindow | NotNearest | Gamma
            | SwappedChannels | BlackBackground | NoTextures => Stage::Unlit,
            NoDiffuse | MissingMax | AbsoluteCosine | LightNotNormalised | LightReversed | NoIntensity
            | NoAttenuation | FirstLightOnly | Overflow => Stage::Diffuse,
            AmbientWithoutKd | AmbientPerLight => Stage::Ambient,
            // At earlier stages their pictures are those of the stages themselves.
            NoAmbient | Exponent | HalfVector | SpecularSign | SpecularMissingMax | SpecularUnguarded
            | SpecularTimesKd => Stage::Specular,
            NoSpecular | ShadowAcne | ShadowBeyondLight | OpaqueShadows | ShadowedAmbient => Stage::Shadow,
            NoShadows | ReflectionWithoutK | ReflectedVector | BlendedReflection | ShallowRecursion => {
                Stage::Reflection
            }
            NormalNotFlipped
            | NoReflection
            | NoRefraction
            | EtaInverted
            | EtaNotSwapped
            | Unbent
            | NoTotalReflection
            | RefractionWithoutFactor
            | OpacityReversed
            | BlendedRefraction => Stage::Full,
        }
    }
}
