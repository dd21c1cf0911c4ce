//! What is otherwise than in a scene and no mistake.

use crate::named;

/// A difference that is no mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Remark {
    /// Rays go through the centres of pixels, and the scene asks for their corners.
    Centers,
    /// Rays go through the lower left corners of pixels, and the scene asks for their centres.
    Corners,
    /// Rays go through other corners of pixels.
    OtherCorners,
    /// Rays count in pixels by another filter than the mean over each pixel.
    OtherFilter,
    /// The file declares another transfer curve than the scene asks for.
    DeclaredCurve,
}

named!(Remark {
    Centers => "pixel-centres": "rays go through the pixels' centres (x + 1/2, y + 1/2); the scene's film has sample \"corner\"",
    Corners => "pixel-corners": "rays go through the pixels' lower left corners (x, y); the scene's film has sample \"center\"",
    OtherCorners => "other-corners": "rays go through another corner of the pixels than the scene says: half a pixel or one beside it",
    OtherFilter => "other-filter": "rays count in neighbouring pixels, too: by another filter than the scene says",
    DeclaredCurve => "declared-curve": "the file declares another transfer curve than the scene asks for; it was read by its own",
});
