//! Front-end messages and labels. Tests refer to them by name, so rewording a message breaks no test.

use std::fmt::Display;

/// Shown when a key requires a scene but none has been loaded.
pub const NO_SCENE: &str = "no scene loaded";

/// Shown when the camera is moved with keys.
pub const CAMERA_MOVED: &str = "camera moved (preview only). w: save image · c: keep in scene · 0: reset";
/// Shown when the camera has returned to its position in the scene.
pub const CAMERA_RESET: &str = "camera reset";
/// Shown when the camera cannot be moved closer.
pub const CLOSEST: &str = "closest zoom reached";
/// Shown when the camera cannot be moved farther away.
pub const FARTHEST: &str = "farthest zoom reached";
/// Shown when `c` is pressed but the camera has not been moved.
pub const NOTHING_TO_KEEP: &str = "camera unchanged: nothing to keep";
/// Explains why `c` has to be pressed again. Follows the list of saved camera settings.
pub const CAMERA_CONFLICT: &str = "was saved after you moved the camera: press c again to overwrite it";
/// Shown when `u` is pressed but no camera has been saved.
pub const NOTHING_TO_UNDO: &str = "nothing to undo";
/// Shown when `u` is pressed but `c` only created a new scene file.
pub const NEW_SCENE_STAYS: &str = "nothing to undo: c wrote a new scene for the model";
/// Shown when `0` is pressed but no keys have changed anything.
pub const NOTHING_TO_RESET: &str = "nothing to reset";
/// Shown when `0` is pressed.
pub const RESET: &str = "reset to the scene's settings";

/// Shown when the field of view is at its limit.
pub fn fov_limit(degrees: f64) -> String {
    format!("field of view limit: {degrees}°")
}

/// Shown when the height of an orthographic image is at its limit.
pub fn view_height_limit(height: f64) -> String {
    format!("view height limit: {height}")
}

/// Shown when the field of view of a panorama is changed.
pub const NO_FIELD_OF_VIEW: &str = "a panorama shows all directions";

/// Shown when the exposure is at its limit.
pub fn exposure_limit(stops: &str) -> String {
    format!("exposure limit: {stops}")
}

/// Shown when the exposure is changed with keys.
pub fn exposure_changed(stops: &str) -> String {
    format!("exposure {stops}")
}

/// Shown when the focus is set with a click.
pub fn focus_moved(distance: f64) -> String {
    format!("focus at {distance} (preview only). w: save image · c: keep in scene · 0: reset")
}

/// Shown when `c` has written the camera into the scene file.
pub fn camera_saved(file: &str) -> String {
    format!("camera saved to {file} · u: undo")
}

/// Shown when `c` has written the camera into the scene file but the command line overrides it.
pub fn camera_saved_but_overridden(file: &str) -> String {
    format!("camera saved to {file}, but --set overrides it in this run")
}

/// Shown when `c` is pressed but the scene file already contains this camera.
pub fn camera_already_in_scene(file: &str) -> String {
    format!("{file} already has this camera")
}

/// Shown when `c` has written a scene file for a model.
pub fn model_scene_written(file: &str) -> String {
    format!("wrote {file}, a scene with this model and camera")
}

/// Shown when `u` has undone the last `c`.
pub fn camera_save_undone(file: &str) -> String {
    format!("undone: {file} restored")
}

/// Shown when the newest render's camera is saved while an older render is displayed.
pub const OF_NEWEST_RENDER: &str = " (camera of the newest render, not the one shown)";

/// Shown when the history contains no image.
pub const NO_IMAGE: &str = "no image yet";
/// Shown when `N` is pressed at the newest render.
pub const NEWEST_RENDER: &str = "this is the newest render";
/// Shown when `n` is pressed at the oldest render.
pub const OLDEST_RENDER: &str = "this is the oldest render";
/// Shown when `b` has returned to the newest render.
pub const AFTER_EDIT: &str = "after the last edit (newest render)";
/// Shown when `b` has returned to the render before the last edit. Followed by the edits.
pub const BEFORE_EDIT: &str = "before the last edit";
/// Shown when `b` is pressed before any edit.
pub const NO_EARLIER_RENDER: &str = "no earlier render to compare with";
/// Shown when the user tries to inspect an older render.
pub const OLDER_RENDER: &str = "can't inspect an older render. b: back to the newest";
/// Keys for moving through the history. The first is omitted at the oldest render.
pub const HISTORY_KEYS: [&str; 2] = ["n older", "N newer"];
/// Title of the history panel.
pub const HISTORY: &str = "History";
/// Describes a render that has no number.
pub fn unnumbered_render_label(state: &str) -> String {
    format!("{state} render")
}

/// Label for a render that is older than the newest one.
pub const OLDER: &str = "older";

/// Position of the displayed render among the finished renders.
pub fn render_number_of_count(number: u64, count: u64) -> String {
    format!("render {number} of {count}")
}

/// Word for stages that were not run again.
pub const CACHED: &str = "cached";
/// Number of stages that were not run again, with a label.
pub fn cached_stage_count(stages: &str) -> String {
    format!("{stages} {CACHED}")
}

/// Time from saving the file to drawing the first changed cell.
pub fn save_to_screen_text(time: &str) -> String {
    format!("on screen after {time}")
}

/// Label for a finished render, with its number.
pub fn numbered_render(number: impl Display) -> String {
    format!("render {number}")
}

/// Label for a render that was stopped.
pub const STOPPED: &str = "stopped";
/// Shown in place of changes for the first render in the history.
pub const OPENED: &str = "opened";
/// Shown in place of changes when a render differs from the previous one only in noise.
pub const AGAIN: &str = "rendered again";

/// Shown when depth of field is requested for a camera without a lens.
pub const PINHOLE: &str = "no depth of field: aperture is 0";
/// Shown when `f` is pressed and a click is expected.
pub const CLICK_TO_FOCUS: &str = "click to focus there · f: at the crosshair";
/// Shown when the user tries to focus on the background.
pub const NOTHING_TO_FOCUS: &str = "nothing to focus on there";
/// Shown when `y` is pressed before any click.
pub const NOTHING_TO_COPY: &str = "nothing to copy: click or press Enter first";
/// Shown when mouse reporting has been turned on.
pub const MOUSE_ON: &str = "mouse on: drag to orbit, wheel to zoom, click to inspect";
/// Shown when mouse reporting has been turned off.
pub const MOUSE_OFF: &str = "mouse off: drag to select text · m: on";
/// Precedes inspected values that were copied.
pub const COPIED: &str = "copied:";
/// Precedes inspected values if the terminal does not support the clipboard.
pub const SELECT_TO_COPY: &str = "shift-drag to select and copy:";

/// Shown when `z` is pressed and a drag is expected.
pub const DRAG_REGION: &str = "drag a region to render first (z: around the crosshair)";
/// Shown when a region of the running render is selected.
pub const REGION_FIRST: &str = "region renders first · z: clear";
/// Shown when a region is selected while nothing is rendering.
pub const REGION_NEXT: &str = "region renders first from the next render · z: clear";
/// Shown when `z` has cleared the region.
pub const REGION_CLEARED: &str = "region cleared";

/// Shown when a digit is pressed while the view list is closed.
pub const VIEWS_FIRST: &str = "press v first: digits choose from the list of views";
/// Shown when `o` is pressed for a model.
pub const NO_EDITOR_FOR_MODELS: &str = "models cannot be edited; c writes a scene file for this one";
/// Shown when a key requires a preview but none is displayed.
pub const NO_PREVIEW: &str = "no preview is shown (see --preview)";
/// Shown when `x` shows actual pixels.
pub const ACTUAL_PIXELS: &str = "actual pixels (1:1) · x: fit";
/// Shown when space is pressed while nothing is rendering.
pub const NOT_RENDERING: &str = "nothing is rendering";
/// Shown when a new request has ended a pause.
pub const RESUMED: &str = "resumed";
/// Shown when `w` is pressed.
pub const WRITING: &str = "writing the current image";
/// Shown when `w` is pressed while an older render is displayed.
pub const WRITING_NEWEST: &str = "writing the newest image, not the one shown";
/// Shown when `w` has written `files`.
pub fn files_written(files: &str) -> String {
    format!("wrote {files}")
}

/// Follows the names of the written files if an older render is displayed.
pub const WROTE_NEWEST: &str = " (the newest image, not the one shown)";
/// Shown when `e` is pressed but there are no diagnostics.
pub const NO_DIAGNOSTICS: &str = "no errors or warnings";
/// Shown when `e` is pressed before the scene had been read.
pub const STILL_READING: &str = "still reading the files";
/// Shown when Ctrl-z is pressed but there is no shell to return to.
pub const NO_SHELL: &str = "no shell to return to";
/// Shown when the file watcher has stopped.
pub const NOT_WATCHING: &str = "file watching stopped; press r to re-render";
/// Shown when the image could not be written.
pub const NOT_WRITTEN: &str = "not written (e: why)";
/// Shown when writing the image is postponed.
pub const WRITE_POSTPONED: &str = "the image will be written once every pixel has a sample";
/// Shown when a render continues from a checkpoint.
pub const RESUMING: &str = "resuming from";

/// Shown when the integrator supports only soft shadows.
pub fn hard_shadows_unsupported(integrator: &str, other: &str) -> String {
    format!("{integrator} always has soft shadows (i: {other})")
}

/// Shown when the integrator does not use photons.
pub fn photons_unsupported(other: &str) -> String {
    format!("photons work only with {other} (i: switch)")
}

/// Shown when a view is chosen.
pub fn view_mode_chosen(name: &str) -> String {
    format!("view {name} (preview only). w: save image · 0: reset")
}

/// Shown when the photon view is selected while photons are off.
pub const VIEW_WITHOUT_PHOTONS: &str = "view photons: photons are off (p: on)";

/// Shown when a checkpoint from another render is renamed.
pub fn other_render_checkpoint_renamed(file: &str) -> String {
    format!("kept another render's checkpoint as {file}")
}

/// Shown when a checkpoint cannot be resumed.
pub fn checkpoint_ignored(file: &str, why: &str) -> String {
    format!("ignoring {file}: {why}")
}

/// Shown when another program has modified an output file.
pub fn output_modified_externally(file: &str, how: &str) -> String {
    format!("{file} {how} · w: write it again")
}

/// Shown when another program has modified an output file and `w` will not replace it.
pub fn output_not_overwritten(file: &str, how: &str) -> String {
    format!("{file} {how} · name another file with -o")
}

/// Shown when the displayed image has not been saved.
pub const NOT_SAVED: &str = "not saved · w: save it";
/// Shown when the displayed image has not been saved and `w` cannot save it.
pub const NOT_SAVED_WITH_CONFLICT: &str = "not saved";
/// Part of messages about changes made with keys. Omitted when `w` cannot write the image.
pub const WRITE_HINT: &str = "w: save image · ";
/// Shown when `w` has written the displayed image before its render finished.
pub fn written_image_unfinished(file: &str) -> String {
    format!("{file} is unfinished · w: write it again")
}

/// Shown when `w` has written an image with `changes` but another image is displayed.
pub fn image_written_with_changes(file: &str, changes: &str) -> String {
    format!("{file} was written with {changes}")
}

/// Shown when `w` has written an image with `changes` but the scene's own image is displayed.
pub fn written_image_differs(file: &str, changes: &str) -> String {
    format!("{} · w: write this image", image_written_with_changes(file, changes))
}

/// Shown when the scene is invalid, so the last valid render is shown.
pub const LAST_GOOD_RENDER: &str = "showing the last good render";
/// Shown when the preview lacks the light from photons.
pub const WITHOUT_PHOTONS: &str = "preview without photons";
/// Follows the word "waiting" while the scene file may be incomplete.
pub const INCOMPLETE_FILE: &str = "for a complete file";
/// Appended to the summary if the scene was edited after the image was written.
pub const OLDER_THAN_EDIT: &str = " (older than your last edit)";
/// Shown when the scene file does not exist.
pub const WAITING_FOR_FILE: &str = "waiting for it to appear";

/// Shown when the render of the scene's own image is interrupted.
pub fn scene_image_render_interrupted(file: &str, percent: u32) -> String {
    format!("{file} at {percent} %: press 0 to continue")
}

/// Shown when the scene has been edited since its own image was rendered.
pub fn scene_image_file_outdated(file: &str) -> String {
    format!("{file} is older than your last edit: press 0 to render it")
}

/// Shown when the last valid scene is rendering while the scene file is invalid. Followed by the progress.
pub const LAST_GOOD_SCENE: &str = "rendering the last good scene";

/// A hint that saving the scene file starts a render.
pub fn saving_starts_render_hint(file: &str, is_again: bool) -> String {
    format!("save {file} to render{}", if is_again { " again" } else { "" })
}

/// A hint that changing the model file starts a render.
pub fn renders_on_changes_hint(file: &str) -> String {
    format!("re-renders when {file} changes")
}

/// Amount of data sent for the last preview and, if known, the terminal's round-trip time.
pub fn preview_bytes_and_round_trip(kilobytes: usize, round_trip_ms: Option<u128>) -> String {
    let round_trip = round_trip_ms.map_or(String::new(), |time| format!(" · {time} ms round trip"));
    format!("{kilobytes} kB sent{round_trip}")
}

/// Title of the noise curve.
pub const NOISE_OVER_TIME: &str = "Noise over time";

/// Label for the target line in the noise curve.
pub fn noise_target_line_label(share: &str) -> String {
    format!("── target: {share} per tile")
}

/// Help text for the `?` key.
pub const HELP_TOGGLE: &str = "show or hide this help";
/// Help text for stage times.
pub const HELP_STAGE_TIME: &str = "stage time (difference from the last render)";
/// Help text for a preview's byte count and round-trip time.
pub const HELP_BYTES: &str = "bytes sent for this render; terminal round trip";
