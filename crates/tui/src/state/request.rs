//! The newest request and its inputs.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use super::{KeyboardOverrides, format_exposure_stops};
use crate::math::DVec3;
use crate::pipeline::FilePathAndContentId;
use crate::pipeline::has_model_extension;
use crate::pipeline::protocol::{NormalizedRect, PreviewBounds, ResolvedCamera};
use crate::pipeline::settings::{
    AdjustableSceneSettings, CameraOverrides, EffectiveSettingsSummary, Overrides, ViewMode,
};
use crate::scene::description::{Integrator, Pose, ShadowMode};
use crate::scene::list_changes;
use crate::scene::sanitize::escape_invisible_chars;

/// The scene and settings from which an image was rendered.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ImageProvenance {
    /// Settings changed with keys.
    pub toggles: KeyboardOverrides,
    /// Text of the scene file, or `None` for a model.
    pub text: Option<Arc<str>>,
    /// Other files used by the scene.
    pub files: Arc<[FilePathAndContentId]>,
    /// Whether the render is unfinished.
    pub is_unfinished: bool,
}

impl ImageProvenance {
    /// The origin without the exposure, which does not affect rendering.
    pub(crate) fn without_exposure(self) -> Self {
        Self { toggles: KeyboardOverrides { exposure: None, ..self.toggles }, ..self }
    }

    /// Determines the origin of an image that a later request reproduced. Usually keeps `self`, because the
    /// later changes had no effect, but returns `later` if a camera moved with keys has since been written to
    /// the scene.
    pub(crate) fn after_rerender_of_same_image(&self, later: Self) -> Self {
        if self.toggles.camera.has_changes() && !later.toggles.camera.has_changes() {
            return later;
        }
        Self { is_unfinished: later.is_unfinished, ..self.clone() }
    }

    /// Describes changes in files since `before`.
    pub(crate) fn describe_file_changes(&self, before: &Self) -> Vec<String> {
        let texts = before.text.as_deref().zip(self.text.as_deref());
        let of_text = texts.map(|(old, new)| list_changes(old, new)).unwrap_or_default();
        let is_changed = |file: &&FilePathAndContentId| {
            before.files.iter().any(|old| old.path == file.path && old.content != file.content)
        };
        let name = |file: &FilePathAndContentId| {
            file.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
        };
        let of_files = self
            .files
            .iter()
            .filter(is_changed)
            .map(|file| format!("{} changed", escape_invisible_chars(&name(file))));
        of_text.into_iter().chain(of_files).collect()
    }
}

/// A camera step. Steps can arrive faster than previews, so the newest step waits until the previous one has
/// a preview.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct CameraStepStatus {
    /// Generation of the step's request.
    pub generation: Option<u64>,
    /// Whether a newer step is waiting.
    pub is_waiting: bool,
}

/// The newest request: the scene, its settings, and the worker's reports about them.
pub(crate) struct RequestState {
    pub scene: PathBuf,
    /// Overrides from the command line.
    pub command_line: Overrides,
    pub toggles: KeyboardOverrides,

    /// Generation of the newest request.
    pub generation: u64,
    /// Overrides sent with the newest request.
    pub sent_toggles: KeyboardOverrides,
    /// Whether the newest request differs from the previous one only in exposure.
    pub is_exposure_only: bool,
    /// Preview size in the newest request.
    pub preview_size: Option<PreviewBounds>,
    /// Time when a new preview size will be requested.
    pub resize_due: Option<Instant>,
    /// Section of the image to render first.
    pub first_section: Option<NormalizedRect>,
    pub camera_step: CameraStepStatus,
    /// The first request whose camera was moved with keys.
    pub moved_since: Option<u64>,
    /// Values that the moved camera parts had in the scene before the first move.
    pub moved_from: CameraOverrides,

    /// Text of the scene file for the newest valid request.
    pub text: Option<Arc<str>>,
    /// Other files used by the scene.
    pub files: Arc<[FilePathAndContentId]>,
    /// Effective settings, as reported by the worker.
    pub effective: Option<EffectiveSettingsSummary>,
    /// The scene's own settings for the newest valid request.
    pub own: Option<AdjustableSceneSettings>,
}

impl RequestState {
    pub(super) fn new(scene: PathBuf, command_line: Overrides) -> Self {
        Self {
            scene,
            command_line,
            toggles: KeyboardOverrides::default(),
            generation: 0,
            sent_toggles: KeyboardOverrides::default(),
            is_exposure_only: false,
            preview_size: None,
            resize_due: None,
            first_section: None,
            camera_step: CameraStepStatus::default(),
            moved_since: None,
            moved_from: CameraOverrides::default(),
            text: None,
            files: Arc::default(),
            effective: None,
            own: None,
        }
    }

    /// Records the newest request's input files. Includes a model but not a scene file, whose text is
    /// compared separately.
    pub(crate) fn record_input_files(&mut self, files: Vec<FilePathAndContentId>) {
        let is_model = self.is_model();
        self.files = files.into_iter().filter(|file| is_model || file.path != self.scene).collect();
    }

    /// Whether the scene is a model, which has no text that the user could edit.
    pub(crate) fn is_model(&self) -> bool {
        has_model_extension(&self.scene)
    }

    /// Returns the origin of the newest request's image.
    pub(crate) fn image_provenance(&self, is_unfinished: bool) -> ImageProvenance {
        ImageProvenance {
            toggles: self.sent_toggles,
            text: self.text.clone(),
            files: self.files.clone(),
            is_unfinished,
        }
    }

    /// Overrides from the command line combined with changes made with keys.
    pub(crate) fn combined_overrides(&self) -> Overrides {
        self.toggles.merged_with_command_line(&self.command_line)
    }

    /// Overrides for the scene's own image, or `None` unless keys have changed the displayed image.
    pub(crate) fn command_line_overrides_if_keys_changed(&self) -> Option<Box<Overrides>> {
        (!self.has_no_keyboard_overrides()).then(|| Box::new(self.command_line.clone()))
    }

    /// Drops key changes that have been saved to the scene.
    pub(crate) fn drop_overrides_saved_to_scene(&mut self) {
        let (shadows, integrator, photons) = (
            self.shadows_without_toggles(),
            self.integrator_without_toggles(),
            self.photons_without_toggles(),
        );
        let own = self.scene_camera();
        let exposure = self.command_line.exposure.or(self.own.map(|own| own.exposure));
        let KeyboardOverrides { camera, .. } = &mut self.toggles;
        camera.pose.take_if(|pose| own.is_some_and(|own| own.pose == *pose));
        camera.fov.take_if(|fov| own.is_some_and(|own| own.projection.fov() == Some(*fov)));
        camera
            .view_height
            .take_if(|height| own.is_some_and(|own| own.projection.view_height() == Some(*height)));
        self.toggles.shadows.take_if(|now| Some(*now) == shadows);
        self.toggles.integrator.take_if(|now| Some(*now) == integrator);
        self.toggles.photons.take_if(|now| Some(*now) == photons);
        self.toggles.exposure.take_if(|now| Some(*now) == exposure);
    }

    /// The camera, including changes made with keys, or `None` until a valid scene has been read.
    pub(crate) fn current_camera(&self) -> Option<ResolvedCamera> {
        self.scene_camera().map(|camera| camera.with_change(&self.toggles.camera))
    }

    /// The scene's own camera, or `None` until a valid scene has been read.
    pub(crate) fn scene_camera(&self) -> Option<ResolvedCamera> {
        self.own.map(|own| own.camera)
    }

    /// Records the original values of camera parts that were moved with keys. Does not overwrite values
    /// recorded earlier.
    pub(crate) fn record_original_camera(&mut self) {
        let Some(own) = self.scene_camera() else { return };
        let (moved, from) = (&self.toggles.camera, self.moved_from);
        self.moved_from = CameraOverrides {
            pose: moved.pose.and(from.pose.or(Some(own.pose))),
            fov: moved.fov.and(from.fov.or(own.projection.fov())),
            view_height: moved.view_height.and(from.view_height.or(own.projection.view_height())),
            focus: moved.focus.and(from.focus.or(Some(own.focus))),
        };
    }

    /// Makes the scene's current camera the starting point for camera movement.
    pub(crate) fn reset_move_origin_to_scene_camera(&mut self) {
        self.moved_from = CameraOverrides::default();
        self.record_original_camera();
    }

    /// Lists camera settings that changed in the scene file after the camera was moved with keys, with their
    /// current values.
    pub(crate) fn file_camera_changes_since_move(&self) -> Vec<String> {
        let Some((own, moved)) = self.scene_camera().zip(self.current_camera()) else { return Vec::new() };
        let from = &self.moved_from;
        let of_pose = |key: &str, of: fn(&Pose) -> DVec3| {
            let (before, now) = (of(&from.pose?), of(&own.pose));
            let DVec3 { x, y, z } = now;
            (before != now && now != of(&moved.pose)).then(|| format!("camera.{key} = [{x}, {y}, {z}]"))
        };
        let of_number = |key: &str, before: Option<f64>, now: Option<f64>, moved: Option<f64>| {
            let now = now.filter(|_| before.is_some() && before != now && now != moved)?;
            Some(format!("camera.{key} = {now}"))
        };
        // A focal plane that passes through `look_at` follows the camera.
        let focus = from.focus.filter(|_| !own.is_focused_on_look_at());
        let all = [
            of_pose("position", |pose| pose.position),
            of_pose("look_at", |pose| pose.look_at),
            of_pose("up", |pose| pose.up),
            of_number("fov", from.fov, own.projection.fov(), moved.projection.fov()),
            of_number(
                "view_height",
                from.view_height,
                own.projection.view_height(),
                moved.projection.view_height(),
            ),
            of_number("focus", focus, Some(own.focus), Some(moved.focus)),
        ];
        all.into_iter().flatten().collect()
    }

    /// Describes camera, focus and exposure changes made with keys, which may not be obvious from the image.
    pub(crate) fn describe_camera_and_exposure_changes(&self) -> Vec<String> {
        let CameraOverrides { pose, fov, view_height, focus } = self.toggles.camera;
        let is_moved = pose.is_some() || fov.is_some() || view_height.is_some();
        let moved = is_moved.then(|| "camera".to_owned());
        let focused = (focus.is_some() && !is_moved).then(|| "focus".to_owned());
        let exposed = self.toggles.exposure.map(|it| format!("exposure ({})", format_exposure_stops(it)));
        moved.into_iter().chain(focused).chain(exposed).collect()
    }

    /// Whether no setting has been changed with keys, so the render is the scene's own image. Only that image
    /// is written automatically.
    pub(crate) fn has_no_keyboard_overrides(&self) -> bool {
        self.toggles == KeyboardOverrides::default()
    }

    /// The initial view, before any key changes it.
    pub(crate) fn base_view_mode(&self) -> ViewMode {
        self.command_line.view.unwrap_or(ViewMode::Beauty)
    }

    pub(crate) fn view_mode(&self) -> ViewMode {
        self.toggles.view.unwrap_or_else(|| self.base_view_mode())
    }

    /// Shadows set by the scene or the command line, or `None` until a valid scene has been read.
    pub(crate) fn shadows_without_toggles(&self) -> Option<ShadowMode> {
        self.command_line.shadows.or(self.own.map(|own| own.shadows))
    }

    /// The current shadow type.
    pub(crate) fn shadow_mode(&self) -> ShadowMode {
        self.toggles.shadows.or(self.shadows_without_toggles()).unwrap_or(ShadowMode::Soft)
    }

    /// Whether photons are enabled by the scene or the command line, or `None` until a valid scene has been
    /// read.
    pub(crate) fn photons_without_toggles(&self) -> Option<bool> {
        self.command_line.photons.or(self.own.map(|own| own.photons))
    }

    /// Whether photons are currently enabled.
    pub(crate) fn are_photons_enabled(&self) -> bool {
        self.toggles.photons.or(self.photons_without_toggles()).unwrap_or(false)
    }

    /// Integrator set by the scene or the command line, or `None` until a valid scene has been read.
    pub(crate) fn integrator_without_toggles(&self) -> Option<Integrator> {
        self.command_line.integrator.or(self.own.map(|own| own.integrator))
    }

    /// The current integrator.
    pub(crate) fn integrator(&self) -> Integrator {
        self.toggles.integrator.or(self.integrator_without_toggles()).unwrap_or(Integrator::Whitted)
    }

    /// The image's aspect ratio, or a typical value until it is known.
    pub(crate) fn aspect(&self) -> f32 {
        const TYPICAL: f32 = 4.0 / 3.0;
        self.effective
            .as_ref()
            .map_or(TYPICAL, |it| it.width as f32 / it.height.max(1) as f32)
            .clamp(0.02, 50.0)
    }
}
