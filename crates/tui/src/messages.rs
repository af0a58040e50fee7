//! Messages and labels of the front end. Tests refer to them by name, so that rewording one breaks no test.

use std::fmt::Display;

/// Shown when a key needs a valid scene.
pub const NO_SCENE: &str = "no scene loaded";

/// Shown when the camera was moved with keys.
pub const CAMERA_MOVED: &str = "camera moved (preview only). w: save image · c: keep in scene · 0: reset";
/// Shown when the camera is back at the scene's own position.
pub const CAMERA_RESET: &str = "camera reset";
/// Shown when the camera cannot be moved closer.
pub const CLOSEST: &str = "closest zoom reached";
/// Shown when the camera cannot be moved farther away.
pub const FARTHEST: &str = "farthest zoom reached";
/// Shown when `c` was pressed, but the camera is the scene's own.
pub const NOTHING_TO_KEEP: &str = "camera unchanged: nothing to keep";
/// Why `c` has to be pressed again; follows the keys that were saved.
pub const CAMERA_CONFLICT: &str = "was saved since you moved the camera: press c again to overwrite it";
/// Shown when `u` was pressed without a kept camera.
pub const NOTHING_TO_UNDO: &str = "nothing to undo";
/// Shown when `u` was pressed, but `c` only wrote a new scene.
pub const NEW_SCENE_STAYS: &str = "nothing to undo: c wrote a new scene for the model";
/// Shown when `0` was pressed, but keys have changed nothing.
pub const NOTHING_TO_RESET: &str = "nothing to reset";
/// Shown when `0` was pressed.
pub const RESET: &str = "reset to the scene's settings";

/// Shown when the field of view is at its limit.
pub fn field_limit(degrees: f64) -> String {
    format!("field of view limit: {degrees}°")
}

/// Shown when the exposure is at its limit.
pub fn exposure_limit(stops: &str) -> String {
    format!("exposure limit: {stops}")
}

/// Shown when the exposure was changed with keys.
pub fn exposure(stops: &str) -> String {
    format!("exposure {stops}")
}

/// Shown when the focus was set with a click.
pub fn focus_moved(distance: f64) -> String {
    format!("focus at {distance} (preview only). w: save image · c: keep in scene · 0: reset")
}

/// Shown when `c` wrote the camera into the scene file.
pub fn camera_saved(file: &str) -> String {
    format!("camera saved to {file} · u: undo")
}

/// Shown when `c` wrote the camera into the scene file, but the command line sets another one.
pub fn camera_overridden(file: &str) -> String {
    format!("camera saved to {file}, but --set overrides it in this run")
}

/// Shown when `c` found the same camera in the scene file.
pub fn camera_known(file: &str) -> String {
    format!("{file} already has this camera")
}

/// Shown when `c` wrote a scene for a model.
pub fn model_scene(file: &str) -> String {
    format!("wrote {file}, a scene of this model with this camera")
}

/// Shown when `u` undid the last `c`.
pub fn undone(file: &str) -> String {
    format!("undone: {file} restored")
}

/// Shown when the camera of the newest render was kept while an older one was shown.
pub const OF_NEWEST_RENDER: &str = " (camera of the newest render, not the one shown)";

/// Shown when there is no image in the history.
pub const NO_IMAGE: &str = "no image yet";
/// Shown when `N` was pressed at the newest render.
pub const NEWEST_RENDER: &str = "this is the newest render";
/// Shown when `n` was pressed at the oldest render.
pub const OLDEST_RENDER: &str = "this is the oldest render";
/// Shown when `b` returned to the newest render.
pub const AFTER_EDIT: &str = "after the last edit (newest render)";
/// Shown when `b` returned to the render before the last edit; the edits follow.
pub const BEFORE_EDIT: &str = "before the last edit";
/// Shown when `b` was pressed before the first edit.
pub const NO_EARLIER_RENDER: &str = "no earlier render to compare with";
/// Shown when a key or click inspects an older render.
pub const OLDER_RENDER: &str = "can't inspect an older render. b: back to the newest";
/// Keys that leave an older render; the first is left out at the oldest one.
pub const HISTORY_KEYS: [&str; 2] = ["n older", "N newer"];
/// Title of the history.
pub const HISTORY: &str = "History";
/// Describes a render that has no number.
pub fn unnumbered_render(state: &str) -> String {
    format!("{state} render")
}

/// State of a render that was finished before the newest one.
pub const OLDER: &str = "older";

/// Which of the finished renders is shown.
pub fn render_of(number: u64, count: u64) -> String {
    format!("render {number} of {count}")
}

/// Marks the number of stages that were not run again.
pub const CACHED: &str = "cached";
/// Number of stages that were not run again.
pub fn cached(stages: &str) -> String {
    format!("{stages} {CACHED}")
}

/// Time from a save to its first changed cell.
pub fn on_screen(time: &str) -> String {
    format!("on screen after {time}")
}

/// Number of the finished render that is shown.
pub fn render(number: impl Display) -> String {
    format!("render {number}")
}

/// Mark of a render that was stopped.
pub const STOPPED: &str = "stopped";
/// Change of the first render.
pub const OPENED: &str = "opened";
/// Change of a render that differs from the previous one only in its noise.
pub const AGAIN: &str = "rendered again";

/// Shown when depth of field needs a lens.
pub const PINHOLE: &str = "no depth of field: aperture is 0";
/// Shown when `f` waits for a click.
pub const CLICK_TO_FOCUS: &str = "click to focus there · f: at the crosshair";
/// Shown when the background cannot be in focus.
pub const NOTHING_TO_FOCUS: &str = "nothing to focus on there";
/// Shown when `y` was pressed before any click.
pub const NOTHING_TO_COPY: &str = "nothing to copy: click or press Enter first";
/// Shown when mouse reports were turned on.
pub const MOUSE_ON: &str = "mouse on: drag to orbit, wheel to zoom, click to inspect";
/// Shown when mouse reports were turned off.
pub const MOUSE_OFF: &str = "mouse off: drag to select text · m: on";
/// Precedes inspected values that were copied.
pub const COPIED: &str = "copied:";
/// Precedes inspected values if the terminal has no clipboard.
pub const SELECT_TO_COPY: &str = "shift-drag to select and copy:";

/// Shown when `z` waits for a drag.
pub const DRAG_REGION: &str = "drag a region to render first (z: around the crosshair)";
/// Shown when a region of the running render was marked.
pub const REGION_FIRST: &str = "region renders first · z: clear";
/// Shown when a region was marked without a running render.
pub const REGION_NEXT: &str = "region renders first from the next render · z: clear";
/// Shown when `z` cleared the region.
pub const REGION_CLEARED: &str = "region cleared";

/// Shown when a digit was pressed while the list of views is closed.
pub const VIEWS_FIRST: &str = "press v first: digits choose from the list of views";
/// Shown when `o` was pressed for a model.
pub const NO_EDITOR_FOR_MODELS: &str = "models cannot be edited; c writes a scene of this one";
/// Shown when a key needs a preview.
pub const NO_PREVIEW: &str = "no preview is shown (see --preview)";
/// Shown when `x` shows actual pixels.
pub const ACTUAL_PIXELS: &str = "actual pixels (1:1) · x: fit";
/// Shown when space was pressed without a running render.
pub const NOT_RENDERING: &str = "nothing is rendering";
/// Shown when a request ended the pause.
pub const RESUMED: &str = "resumed";
/// Shown when `w` was pressed.
pub const WRITING: &str = "writing the current image";
/// Shown when `w` was pressed while an older render is shown.
pub const WRITING_NEWEST: &str = "writing the newest image, not the one shown";
/// Shown when `w` has written these files.
pub fn wrote(files: &str) -> String {
    format!("wrote {files}")
}

/// Follows the written files if an older render is shown.
pub const WROTE_NEWEST: &str = " (the newest image, not the one shown)";
/// Shown when `e` was pressed without diagnostics.
pub const NO_DIAGNOSTICS: &str = "no errors or warnings";
/// Shown when `e` was pressed before the scene was read.
pub const STILL_READING: &str = "still reading the files";
/// Shown when Ctrl-z was pressed without a shell.
pub const NO_SHELL: &str = "no shell to return to";
/// Shown when the file watcher has ended.
pub const NOT_WATCHING: &str = "file watching stopped; press r to re-render";
/// Shown when the image could not be written.
pub const NOT_WRITTEN: &str = "not written (e: why)";
/// Shown when the image will be written later.
pub const WRITE_POSTPONED: &str = "the image will be written when every pixel has a sample";
/// Shown when a render continues from a checkpoint.
pub const RESUMING: &str = "resuming from";

/// Shown when the integrator always renders soft shadows.
pub fn soft_shadows(integrator: &str, other: &str) -> String {
    format!("{integrator} always has soft shadows (i: {other})")
}

/// Shown when the integrator does not use photons.
pub fn no_photons(other: &str) -> String {
    format!("photons work with {other} only (i switches)")
}

/// Shown when a view was chosen.
pub fn view(name: &str) -> String {
    format!("view {name} (preview only). w: save image · 0: reset")
}

/// Shown when the photon view was chosen while photons are off.
pub const VIEW_WITHOUT_PHOTONS: &str = "view photons: photons are off (p: on)";

/// Shown when the checkpoint of another render was renamed.
pub fn checkpoint_kept(file: &str) -> String {
    format!("kept the checkpoint of another render as {file}")
}

/// Shown when a checkpoint cannot be continued.
pub fn checkpoint_ignored(file: &str, why: &str) -> String {
    format!("ignoring {file}: {why}")
}

/// Shown when another program changed a written file.
pub fn output_changed(file: &str, how: &str) -> String {
    format!("{file} {how} · w writes it again")
}

/// Shown when the image shown is not in a file.
pub const NOT_SAVED: &str = "not saved · w saves it";
/// Shown when the scene is invalid, so the last valid render is shown.
pub const LAST_GOOD_RENDER: &str = "showing the last good render";
/// Shown when the preview lacks the light of photons.
pub const WITHOUT_PHOTONS: &str = "preview without photons";
/// Shown when the scene file may be incomplete.
pub const INCOMPLETE_FILE: &str = "for a complete file";
/// Shown when the scene file does not exist.
pub const WAITING_FOR_FILE: &str = "waiting for it to appear";

/// Shown when the scene's own image was interrupted.
pub fn own_unfinished(file: &str, percent: u32) -> String {
    format!("{file} at {percent} %: 0 continues it")
}

/// Shown when the scene's own image does not show the last edit.
pub fn own_outdated(file: &str) -> String {
    format!("{file} is older than your last edit: 0 renders it")
}

/// Shown when the last valid scene is rendering while the file is broken; its progress follows.
pub const LAST_GOOD_SCENE: &str = "rendering the last good scene";

/// A hint to edit the scene.
pub fn save_to_render(file: &str, is_again: bool) -> String {
    format!("save {file} to render{}", if is_again { " again" } else { "" })
}

/// A hint for models.
pub fn renders_on_changes(file: &str) -> String {
    format!("re-renders when {file} changes")
}

/// Cost of sending the last preview.
pub fn preview_cost(kilobytes: usize, round_trip_ms: Option<u128>) -> String {
    let round_trip = round_trip_ms.map_or(String::new(), |time| format!(" · {time} ms round trip"));
    format!("{kilobytes} kB sent{round_trip}")
}

/// Title of the noise curve.
pub const NOISE_OVER_TIME: &str = "Noise over time";

/// The line in the noise curve.
pub fn noise_target(share: &str) -> String {
    format!("── target: {share} per tile")
}

/// Help for `?`.
pub const HELP_TOGGLE: &str = "show or hide this help";
/// Help for the time of a stage.
pub const HELP_STAGE_TIME: &str = "stage time (difference to the last render)";
/// Help for the cost of sending a preview.
pub const HELP_BYTES: &str = "bytes of this render; round trip to the terminal";
