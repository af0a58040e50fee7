//! Messages that tests look for.

/// No image is written because some pixels lack samples.
pub const INCOMPLETE_IMAGE: &str = "the render stopped before every pixel had a sample";
/// An older image is on disk.
pub const NEWEST_IMAGE_NOT_WRITTEN: &str = "the newest image was not written";
/// There is no image in memory.
pub const NO_IMAGE: &str = "no image has been rendered yet";
/// No image is written because the invalid scene may reference the output file.
pub const SCENE_HAS_ERRORS: &str = "the scene has errors";
/// The scene file was edited after it was read.
pub const SCENE_FILE_CHANGED: &str = "the scene file has changed since it was read: camera not saved";
/// The scene file was removed.
pub const SCENE_FILE_MISSING: &str = "the scene file does not exist: camera not saved";
/// The scene's camera was edited after the user moved it with the keyboard.
pub const CAMERA_CHANGED: &str =
    "the scene's camera has changed since it was moved: press c again to save it";
/// The scene of another renderer is not written. Followed by the file's name.
pub const FOREIGN_SCENE_NOT_WRITTEN: &str =
    "glimt does not write scenes from other renderers; convert this one first with `glimt import`:";
/// All faces of a model are fully transparent.
pub const INVISIBLE_MODEL: &str = "the model is invisible: its faces have an opacity of 0";
/// Effect of `clamp`.
pub const CLAMP_EFFECT: &str =
    "limits indirect light: fewer fireflies, but a biased image that is slightly too dark";
/// Effect of the default `clamp` value for models.
pub const CLAMP_EFFECT_ON_MODELS: &str = "limits light from shiny surfaces (fewer fireflies, slightly dark)";

/// The file at a checkpoint's path is not in the checkpoint format.
pub const NOT_A_CHECKPOINT: &str = "is not a checkpoint";
/// A file is damaged.
pub const DAMAGED: &str = "damaged";
/// The scene file's camera was not restored.
pub const NOT_UNDONE: &str = "has changed since you pressed c: not undone";
/// A model was removed.
pub const MODEL_MISSING: &str = "does not exist: its scene was not written";
/// A new file would replace an existing one.
pub const ALREADY_EXISTS: &str = "already exists";

/// Explains why a checkpoint with more than `samples` samples per pixel is not used.
pub fn oversampled_checkpoint_message(samples: u32) -> String {
    format!("it already has more than {samples} samples")
}
