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
    /// Rows and columns are exchanged.
    Transposed,
    /// The tangent of the whole angle of view.
    WholeAngle,
    /// The angle of view is taken for the horizontal one.
    HorizontalAngle,
    /// The window is square whatever the picture's size.
    SquareWindow,
    /// The eye is another point.
    Eye,
    /// The camera looks at another point.
    Center,
    /// The camera is turned about its axis.
    Up,
    /// The angle of view is another number.
    Fovy,
    /// An object is elsewhere.
    ObjectPosition,
    /// An object has another size.
    ObjectSize,
    /// An object is missing.
    MissingObject,
    /// The hit isn't the nearest one.
    NotNearest,
    /// The curve of the display is missing, or there is one too many.
    Gamma,
    /// All colours are multiplied by a factor.
    Brightness,
    /// Red and blue are exchanged.
    SwappedChannels,
    /// Values over 1 wrap around.
    Overflow,
    /// Rays without a hit are black.
    BlackBackground,
    /// The background has another colour.
    Background,
    /// The ambient term is missing.
    NoAmbient,
    /// The ambient term isn't multiplied by kd.
    AmbientWithoutKd,
    /// The ambient term is added for each light.
    AmbientPerLight,
    /// The ambient light is another number.
    AmbientFactor,
    /// The diffuse term is missing.
    NoDiffuse,
    /// n·L isn't cut off at 0.
    MissingMax,
    /// |n·L| in place of max(0, n·L).
    AbsoluteCosine,
    /// An angle or its sine stands where the cosine belongs.
    AngleForCosine,
    /// The diffuse colour is another one.
    DiffuseFactor,
    /// Two materials are exchanged.
    MaterialsExchanged,
    /// n isn't divided by its length.
    NormalNotNormalised,
    /// L isn't divided by its length.
    LightNotNormalised,
    /// L points from the light to the surface.
    LightReversed,
    /// L is the same at all points.
    ConstantLightVector,
    /// A light is elsewhere.
    LightPosition,
    /// The light's intensity isn't used.
    NoIntensity,
    /// A light has another intensity.
    LightIntensity,
    /// Two lights have each other's intensities.
    LightsExchanged,
    /// Attenuation, cone and region aren't used.
    NoAttenuation,
    /// The attenuation is another function of the distance.
    Falloff,
    /// Only the first light is used.
    FirstLightOnly,
    /// A light is missing.
    MissingLight,
    /// The normal isn't turned to the viewer inside of bodies.
    NormalNotFlipped,
    /// The specular term is missing.
    NoSpecular,
    /// Highlights have another strength.
    SpecularFactor,
    /// The exponent is another number.
    Exponent,
    /// n·h in place of r·L.
    HalfVector,
    /// r has the wrong sign.
    SpecularSign,
    /// v is the same at all points.
    ConstantView,
    /// v isn't divided by its length.
    ViewNotNormalised,
    /// v points from the eye to the surface.
    ViewReversed,
    /// n·L in place of r·L.
    SpecularOfNormal,
    /// (r·L)ⁿ isn't cut off at 0.
    SpecularMissingMax,
    /// Highlights appear on sides that the light doesn't reach.
    SpecularUnguarded,
    /// Highlights are multiplied by kd.
    SpecularTimesKd,
    /// Highlights are multiplied by n·L.
    SpecularTimesCosine,
    /// There are no shadows.
    NoShadows,
    /// Highlights shine in shadows.
    HighlightsInShadow,
    /// Shadows take half of the light.
    PaleShadows,
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
    /// Mirrors have another factor.
    ReflectionFactor,
    /// The reflected ray has a wrong direction.
    ReflectedVector,
    /// The own colour is multiplied by 1 − k.
    BlendedReflection,
    /// Rays end too early.
    ShallowRecursion,
    /// Rays end too late.
    DeepRecursion,
    /// There are no refracted rays.
    NoRefraction,
    /// ηₜ/ηᵢ in place of ηᵢ/ηₜ.
    EtaInverted,
    /// ηᵢ/ηₜ of entering is used when leaving, too.
    EtaNotSwapped,
    /// Rays go straight through.
    Unbent,
    /// η is another number.
    Eta,
    /// Beyond the critical angle nothing is added.
    NoTotalReflection,
    /// The refracted colour isn't multiplied by 1 − o.
    RefractionWithoutFactor,
    /// The refracted colour is multiplied by o.
    OpacityReversed,
    /// The opacity is another number.
    Opacity,
    /// The own colour is multiplied by o.
    BlendedRefraction,
    /// Textures are missing.
    NoTextures,
}

named!(Mistake {
    UpsideDown => "upside-down": "the rows are stored from the bottom: y grows upwards in (5.10), downwards in files",
    Mirrored => "mirrored": "left and right are exchanged: the camera's x axis is up x z, not z x up (5.3)",
    Transposed => "transposed": "rows and columns are exchanged: pixel (x, y) is number y w + x of the file (5.10)",
    WholeAngle => "whole-angle": "the window's height is 2 df tan(fovy / 2), with half of the angle (5.2b)",
    HorizontalAngle => "horizontal-angle": "fovy is the vertical angle of view, not the horizontal one (5.2b)",
    SquareWindow => "square-window": "the window's base is its height times width / height of the picture (5.2c)",
    Eye => "eye": "the eye is another point than the scene says (5.2)",
    Center => "center": "the camera looks at another point than the scene says (5.3)",
    Up => "up": "the picture's upward direction isn't that of the scene (5.3)",
    Fovy => "fovy": "the angle of view isn't the scene's fovy (5.2b)",
    ObjectPosition => "object-position": "an object is at another place than the scene says",
    ObjectSize => "object-size": "an object has another size than the scene says",
    MissingObject => "missing-object": "an object of the scene is missing",
    NotNearest => "not-nearest": "of all hits the nearest with t > 0 counts (box 5.1)",
    Gamma => "gamma": "the values are stored with another curve than the scene's transfer: one too many, or one too few",
    Brightness => "brightness": "all colours are multiplied by a factor",
    SwappedChannels => "swapped-channels": "red and blue are exchanged",
    Overflow => "overflow": "values over 1 wrap around to dark ones: cut them at 1 before they become bytes (5.36)",
    BlackBackground => "black-background": "rays that hit nothing have the background's colour (box 5.8)",
    Background => "background": "the background has another colour than the scene says (box 5.8)",
    NoAmbient => "no-ambient": "the ambient term Ia kd is missing (5.33)",
    AmbientWithoutKd => "ambient-without-kd": "the ambient light Ia is multiplied by kd (5.33)",
    AmbientPerLight => "ambient-per-light": "the ambient term is added once, not for each light (5.39a)",
    AmbientFactor => "ambient-factor": "the ambient light isn't the scene's Ia (5.33)",
    NoDiffuse => "no-diffuse": "the diffuse term l kd (n.L) is missing (5.32)",
    MissingMax => "missing-max": "where n.L < 0 the light adds 0 and takes nothing away: max(0, n.L) (5.32)",
    AbsoluteCosine => "absolute-cosine": "light behind the surface adds nothing: max(0, n.L), not |n.L| (5.32)",
    AngleForCosine => "angle-for-cosine": "the diffuse term has the cosine n.L, not the angle or another function of it (5.32)",
    DiffuseFactor => "diffuse-colour": "the diffuse colour isn't the scene's kd (5.32)",
    MaterialsExchanged => "materials-exchanged": "two objects have each other's materials, or one has another's",
    NormalNotNormalised => "normal-not-normalised": "n is a unit vector: divide p - c by the radius (5.31)",
    LightNotNormalised => "light-not-normalised": "L is a unit vector: divide it by its length (5.32)",
    LightReversed => "light-reversed": "L points from the surface to the light: light minus p, not p minus light (5.32)",
    ConstantLightVector => "constant-light-vector": "L leads from p to the light: it differs from point to point (5.32)",
    LightPosition => "light-position": "a light is at another place, or comes from another direction, than the scene says",
    NoIntensity => "no-intensity": "the light's intensity l multiplies its terms (5.32)",
    LightIntensity => "light-intensity": "a light has another intensity or colour than the scene says",
    LightsExchanged => "lights-exchanged": "two lights have each other's intensities",
    NoAttenuation => "no-attenuation": "light is weakened by distance, and by a spot's cone (5.25)",
    Falloff => "falloff": "light is divided by c + l d + q d^2 with the scene's numbers (5.25)",
    FirstLightOnly => "first-light-only": "the terms of all lights are summed (5.39a)",
    MissingLight => "missing-light": "a light of the scene is missing (5.39a)",
    NormalNotFlipped => "normal-not-flipped": "inside a body the normal is turned towards the viewer: n = -n where n.v < 0 (box 5.8)",
    NoSpecular => "no-specular": "the specular term l ks (r.L)^n is missing (5.38)",
    SpecularFactor => "highlight-factor": "highlights have another strength or colour than the scene's ks says (5.38)",
    Exponent => "exponent": "highlights have the size of another exponent n (5.38)",
    HalfVector => "half-vector": "the cosine of highlights is r.L, not n.h of the vector half-way (5.38)",
    SpecularSign => "specular-sign": "r = 2 (v.n) n - v with v towards the viewer: here it has the opposite sign (5.37)",
    ConstantView => "constant-view": "v leads from p to the eye: it differs from point to point (5.37)",
    ViewNotNormalised => "view-not-normalised": "v is a unit vector: divide eye - p by its length (5.37)",
    ViewReversed => "view-reversed": "v points from the surface to the eye: eye - p, not p - eye (5.37)",
    SpecularOfNormal => "highlight-of-normal": "the cosine of highlights is r.L, not n.L (5.38)",
    SpecularMissingMax => "specular-missing-max": "where r.L < 0 there is no highlight: max(0, r.L)^n (5.38)",
    SpecularUnguarded => "specular-unguarded": "where n.L <= 0 there is no highlight either (5.38)",
    SpecularTimesKd => "specular-times-kd": "highlights are multiplied by ks alone, not by kd (5.38)",
    SpecularTimesCosine => "highlight-times-cosine": "highlights aren't multiplied by n.L (5.38)",
    NoShadows => "no-shadows": "the factor f_s of shadows is missing (5.39a)",
    HighlightsInShadow => "highlights-in-shadow": "shadows take the highlight as well as the diffuse term (5.39a)",
    PaleShadows => "pale-shadows": "an opaque body blocks all of the light: f_s is 0 (5.39a)",
    ShadowAcne => "shadow-acne": "surfaces block their own light: start shadow rays a little off the surface",
    ShadowBeyondLight => "shadow-beyond-light": "only what lies between p and the light blocks it: 0 < t < distance (5.39a)",
    OpaqueShadows => "opaque-shadows": "clear bodies let the share 1 - o of the light through (5.39a)",
    ShadowedAmbient => "shadowed-ambient": "shadows don't take the ambient light (5.39a)",
    NoReflection => "no-reflection": "the reflected term k I(r) is missing (5.39b)",
    ReflectionWithoutK => "reflection-without-k": "the reflected colour is multiplied by k (5.39b)",
    ReflectionFactor => "reflection-factor": "the reflected colour isn't multiplied by the scene's k (5.39b)",
    ReflectedVector => "reflected-vector": "the reflected ray has a wrong direction: it is r = 2 (v.n) n - v (5.37)",
    BlendedReflection => "blended-reflection": "the own colour is added whole, not times 1 - k (5.39b)",
    ShallowRecursion => "shallow-recursion": "rays end before the scene's max-depth (box 5.8)",
    DeepRecursion => "deep-recursion": "rays go on beyond the scene's max-depth (box 5.8)",
    NoRefraction => "no-refraction": "the refracted term (1 - o) I(t) is missing (5.39b)",
    EtaInverted => "eta-inverted": "the ratio of refraction is upside down: sin(t) = (ni / nt) sin(i) (5.43)",
    EtaNotSwapped => "eta-not-swapped": "a ray that leaves the body has ni = eta and nt = 1 (5.43)",
    Unbent => "unbent": "refracted rays are bent by Snell's law (5.43), not straight on",
    Eta => "eta": "the coefficient of refraction isn't the scene's eta (5.43)",
    NoTotalReflection => "no-total-reflection": "beyond the critical angle the mirrored ray takes the refracted one's place",
    RefractionWithoutFactor => "refraction-without-factor": "the refracted colour is multiplied by 1 - o (5.39b)",
    OpacityReversed => "opacity-reversed": "the factor of the refracted colour is 1 - o, not o (5.39b)",
    Opacity => "opacity": "the opacity isn't the scene's (5.39b)",
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
    /// The tangent of a quarter of the angle.
    pub(in super::super) const HALF_OF_HALF: f64 = 1.0;
    /// The tangent of degrees that are taken for radians.
    pub(in super::super) const DEGREES: f64 = 2.0;
    /// The window's base is its height times height / width.
    pub(in super::super) const INVERTED_ASPECT: f64 = 1.0;
    /// The far one of each object's hits counts.
    pub(in super::super) const FAR_ROOT: f64 = 2.0;
    /// The far one of each sphere's hits counts.
    pub(in super::super) const FAR_ROOT_OF_SPHERES: f64 = 3.0;
    /// The largest depth is one less.
    pub(in super::super) const ONE_LESS: f64 = 0.0;
    /// The angle in radians.
    pub(in super::super) const ANGLE: f64 = 0.0;
    /// 1 less the angle in quarter turns.
    pub(in super::super) const FALLING_ANGLE: f64 = 1.0;
    /// The sine.
    pub(in super::super) const SINE: f64 = 2.0;
    /// The angles in radians in the diffuse term and in the highlight.
    pub(in super::super) const ANGLE_IN_BOTH: f64 = 3.0;
    /// The cosine of n·L.
    pub(in super::super) const COSINE_OF_COSINE: f64 = 4.0;
    /// v leads along the optical axis.
    pub(in super::super) const ALONG_THE_AXIS: f64 = 0.0;
    /// v leads from the origin to the eye.
    pub(in super::super) const FROM_THE_ORIGIN: f64 = 1.0;
    /// v is the z axis.
    pub(in super::super) const ALONG_Z: f64 = 2.0;
    /// Half of 1 + n·L.
    pub(in super::super) const HALF_OF_COSINE: f64 = 5.0;
    /// The vector half-way is divided by its length.
    pub(in super::super) const UNIT_HALF: f64 = 0.0;
    /// Half of L + v.
    pub(in super::super) const HALF_OF_SUM: f64 = 1.0;
    /// L + v.
    pub(in super::super) const WHOLE_SUM: f64 = 2.0;
    /// In all terms.
    pub(in super::super) const EVERYWHERE: f64 = 0.0;
    /// In highlights only.
    pub(in super::super) const IN_HIGHLIGHTS: f64 = 1.0;
    /// Only the first light counts.
    pub(in super::super) const FIRST_LIGHT: f64 = 0.0;
    /// Only the last light counts.
    pub(in super::super) const LAST_LIGHT: f64 = 1.0;
    /// Rows and columns are exchanged in the picture.
    pub(in super::super) const EXCHANGED: f64 = 0.0;
    /// The numbers are stored column by column, and read row by row.
    pub(in super::super) const COLUMN_BY_COLUMN: f64 = 1.0;
    /// The picture is turned by a quarter to the left.
    pub(in super::super) const TURNED_LEFT: f64 = 2.0;
    /// The picture is turned by a quarter to the right.
    pub(in super::super) const TURNED_RIGHT: f64 = 3.0;
    /// The picture is turned by half a turn.
    pub(in super::super) const TURNED_AROUND: f64 = 4.0;

    /// The coefficients that stand in place of a light's attenuation c, l, q; none if they are equal.
    pub(in super::super) fn falloff([c, l, q]: [f32; 3], amount: f64) -> Option<[f64; 3]> {
        let [own_c, own_l, own_q] = [c, l, q].map(f64::from);
        let own = [own_c, own_l, own_q];
        let other = match amount as u32 {
            0 => [own_c, own_q, own_l],
            1 => [own_c, own_l, 0.0],
            2 => [own_c, 0.0, own_q],
            3 => [0.0, own_l, own_q],
            4 => [own_q, own_l, own_c],
            5 => [0.0, 1.0, 0.0],
            6 => [0.0, 0.0, 1.0],
            7 => [1.0, 1.0, 0.0],
            8 => [1.0, 0.0, 1.0],
            9 => [1.0, 1.0, 1.0],
            10 => [own_c, own_l + own_q, 0.0],
            _ => [own_c, 0.0, own_l + own_q],
        };
        (other != own && other.iter().sum::<f64>() > 0.0).then_some(other)
    }
}

impl Mistake {
    /// The amounts that are tried: factors, or forms of the mistake.
    pub(super) fn amounts(self) -> &'static [f64] {
        match self {
            // Factors of n.
            Mistake::Exponent => &[form::NO_EXPONENT, 0.25, 0.5, 2.0, 4.0],
            // The largest depth.
            Mistake::ShallowRecursion => &[form::ONE_LESS, 2.0, 3.0],
            Mistake::DeepRecursion => &[1.0, 8.0],
            Mistake::ReflectedVector => &[form::REFLECTS_INWARDS, form::REFLECTS_LIGHT, form::REFLECTS_ON],
            Mistake::Gamma => &[form::EXTRA_CURVE, form::UNDONE_CURVE, form::EXTRA_POWER, form::UNDONE_POWER],
            Mistake::NotNearest => &[form::FARTHEST_HIT, form::LAST_OBJECT, form::FAR_ROOT, form::FAR_ROOT_OF_SPHERES],
            Mistake::WholeAngle => &[0.0, form::HALF_OF_HALF, form::DEGREES],
            Mistake::SquareWindow => &[0.0, form::INVERTED_ASPECT],
            Mistake::Transposed => {
                &[form::EXCHANGED, form::COLUMN_BY_COLUMN, form::TURNED_LEFT, form::TURNED_RIGHT, form::TURNED_AROUND]
            }
            Mistake::AngleForCosine => &[
                form::ANGLE,
                form::FALLING_ANGLE,
                form::SINE,
                form::ANGLE_IN_BOTH,
                form::COSINE_OF_COSINE,
                form::HALF_OF_COSINE,
            ],
            Mistake::ConstantView => &[form::ALONG_THE_AXIS, form::FROM_THE_ORIGIN, form::ALONG_Z],
            Mistake::HalfVector => &[form::UNIT_HALF, form::HALF_OF_SUM, form::WHOLE_SUM],
            Mistake::NoIntensity => &[form::EVERYWHERE, form::IN_HIGHLIGHTS],
            Mistake::FirstLightOnly => &[form::FIRST_LIGHT, form::LAST_LIGHT],
            Mistake::Falloff => &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0],
            Mistake::SwappedChannels => &[0.0, 1.0, 2.0, 3.0, 4.0],
            Mistake::SpecularSign => &[form::SIGN_OF_V, form::SIGN_OF_R],
            Mistake::LightNotNormalised => &[form::LONG_IN_BOTH_TERMS, form::LONG_IN_DIFFUSE],
            Mistake::MissingMax
            | Mistake::AbsoluteCosine
            | Mistake::SpecularUnguarded
            | Mistake::SpecularMissingMax => &[form::BLOCKED_BEHIND, form::UNBLOCKED_BEHIND],
            // Found by fits, or by other means.
            Mistake::Eye
            | Mistake::Center
            | Mistake::Up
            | Mistake::Fovy
            | Mistake::ObjectPosition
            | Mistake::ObjectSize
            | Mistake::MissingObject
            | Mistake::Brightness
            | Mistake::Background
            | Mistake::AmbientFactor
            | Mistake::DiffuseFactor
            | Mistake::MaterialsExchanged
            | Mistake::LightPosition
            | Mistake::LightIntensity
            | Mistake::LightsExchanged
            | Mistake::MissingLight
            | Mistake::SpecularFactor
            | Mistake::ReflectionFactor
            | Mistake::Eta
            | Mistake::Opacity
            | Mistake::ShadowAcne => &[],
            _ => &[0.0],
        }
    }

    /// The first stage whose picture the mistake can change.
    pub(super) fn first_stage(self) -> Stage {
        use Mistake::*;
        match self {
            UpsideDown | Mirrored | Transposed | Eye | Center | Up | Fovy | ObjectPosition | ObjectSize
            | MissingObject | Brightness | Background | MaterialsExchanged | WholeAngle | HorizontalAngle
            | SquareWindow | NotNearest | Gamma | SwappedChannels | BlackBackground | NoTextures => Stage::Unlit,
            AngleForCosine | DiffuseFactor | NormalNotNormalised | ConstantLightVector | LightPosition
            | LightIntensity | LightsExchanged | Falloff | MissingLight | NoDiffuse | MissingMax | AbsoluteCosine
            | LightNotNormalised | LightReversed | NoIntensity | NoAttenuation | FirstLightOnly | Overflow => {
                Stage::Diffuse
            }
            AmbientWithoutKd | AmbientPerLight | AmbientFactor => Stage::Ambient,
            // At earlier stages their pictures are those of the stages themselves.
            SpecularFactor | ConstantView | ViewNotNormalised | ViewReversed | SpecularOfNormal
            | SpecularTimesCosine | NoAmbient | Exponent | HalfVector | SpecularSign | SpecularMissingMax
            | SpecularUnguarded | SpecularTimesKd => Stage::Specular,
            HighlightsInShadow | PaleShadows | NoSpecular | ShadowAcne | ShadowBeyondLight | OpaqueShadows
            | ShadowedAmbient => Stage::Shadow,
            DeepRecursion | ReflectionFactor | NoShadows | ReflectionWithoutK | ReflectedVector | BlendedReflection
            | ShallowRecursion => Stage::Reflection,
            Eta
            | Opacity
            | NormalNotFlipped
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
