//! Reasons in [`StageReport::why`](super::StageReport::why).

/// The stage's inputs are unchanged.
pub const UNCHANGED: &str = "unchanged";
/// The result comes from an earlier request.
pub const CACHED: &str = "cached";
/// The scene has no shapes.
pub const NO_SHAPES: &str = "no shapes";
/// The scene has no mesh files.
pub const NO_MESHES: &str = "no meshes";
/// No visible material uses a texture.
pub const NO_TEXTURES: &str = "no textures used";
/// The scene has no lights.
pub const NO_LIGHTS: &str = "no lights";
/// The current view does not need the result.
pub const NOT_NEEDED_FOR_VIEW: &str = "not needed for this view";
/// The scene does not enable photons.
pub const PHOTONS_OFF: &str = "off in the scene";
/// The scene enables photons, but the command line or a key disables them.
pub const PHOTONS_OVERRIDDEN: &str = "off for this run";
/// The path integrator does not use photons.
pub const NOT_USED_BY_PATH: &str = "not used by path";
/// Photons need more than one bounce.
pub const TOO_FEW_BOUNCES: &str = "no photons at max_depth 1";
/// No surface causes caustics.
pub const NO_SPECULAR_SURFACES: &str = "no surface causes caustics";
/// The part has already been finished.
pub const PART_COMPLETE: &str = "the part is already finished";
/// The checkpoint contains all samples.
pub const CHECKPOINT_COMPLETE: &str = "the checkpoint is complete";
/// The time limit ended the render.
pub const TIME_LIMIT_REACHED: &str = "time limit reached";
/// Some tiles reached the noise target early.
pub const NOISE_TARGET_REACHED: &str = "noise target reached in some tiles";
/// The output files already contain the image.
pub const ALREADY_WRITTEN: &str = "already written";
/// The request's image will not be written.
pub const PREVIEW_ONLY: &str = "preview only";
/// The output files contain an image with keyboard changes. The user pressed `w` to write it.
pub const OTHER_IMAGE_WRITTEN: &str = "w wrote another image";

/// Start of the reason for a render that continued from existing samples.
pub const RESUMED: &str = "resumed after ";

/// Returns the reason for a render that continued from `samples` samples per pixel.
pub fn continued_from_samples_reason(samples: u32) -> String {
    format!("{RESUMED}{samples} samples")
}
