//! Queries about the current image and edits to the scene file's camera, which can run during and between
//! requests.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::formats::has_model_extension;
use super::inputs::ProtectedInputs;
use super::prepare::{ReadyScene, RequestCamera};
use super::protocol::{
    CameraSaveResult, Event, NormalizedPosition, PickedInstance, PickedObject, PickedPixel, ResolvedCamera,
    SavedCameraEdit, UserMovedCamera,
};
use super::render::film_state::FilmState;
use super::sink::EventSink;
use super::stages::parse::ParsedScene;
use crate::control::CancelToken;
use crate::film::FilmQuantity;
use crate::integrators::RenderSettings;
use crate::messages::{
    ALREADY_EXISTS, CAMERA_CHANGED, FOREIGN_SCENE_NOT_WRITTEN, MODEL_MISSING, NOT_UNDONE, SCENE_FILE_CHANGED,
    SCENE_FILE_MISSING,
};
use crate::output::{AttributeLossPolicy, OutputError, write};
use crate::scene::description::CameraOverrides;
use crate::scene::{LoadedScene, read_scene_file_text};
use crate::system::{describe_io_error, file};
use crate::world::World;

/// A query or edit requested by the user.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum QueryOrEdit {
    KeepCamera(Box<UserMovedCamera>),
    UndoCamera(SavedCameraEdit),
    Pick(NormalizedPosition),
}

impl QueryOrEdit {
    /// Reports why the query cannot be answered.
    pub(super) fn report_failure(&self, why: &str, sink: &EventSink) {
        let generation = sink.generation;
        match self {
            Self::KeepCamera(_) => {
                sink.send(Event::CameraKept { generation, outcome: Err(why.to_owned()) });
            }
            Self::UndoCamera(_) => {
                sink.send(Event::CameraUndone { generation, outcome: Err(why.to_owned()) });
            }
            Self::Pick(_) => {}
        }
    }
}

/// Scene, world and settings of the current image, used to answer queries.
pub(super) struct QueryContext {
    parsed: Arc<ParsedScene>,
    /// Scene key overrides from the command line.
    sets: Vec<String>,
    world: Arc<World>,
    settings: RenderSettings,
    /// The scene's camera.
    own: ResolvedCamera,
}

impl QueryContext {
    /// Creates the context for a scene's image. `sets` contains scene key overrides from the command line.
    pub(super) fn new(scene: &ReadyScene, sets: &[String]) -> Self {
        let (parsed, plan) = (&scene.assets.parsed, &scene.plan);
        let own = RequestCamera::new(&plan.scene, parsed.orbiter, &CameraOverrides::default());
        Self {
            parsed: Arc::clone(parsed),
            sets: sets.to_vec(),
            world: Arc::clone(&scene.world),
            settings: plan.settings,
            own: own.resolved_camera(),
        }
    }

    pub(super) fn run(
        &self,
        query: &QueryOrEdit,
        state: Option<&FilmState>,
        inputs: &ProtectedInputs,
        sink: &EventSink,
    ) {
        let generation = sink.generation;
        sink.send(match query {
            QueryOrEdit::Pick(spot) => {
                Event::Picked { generation, picked: Box::new(self.pick(*spot, state)) }
            }
            QueryOrEdit::KeepCamera(camera) => {
                Event::CameraKept { generation, outcome: self.save_camera(camera, inputs) }
            }
            QueryOrEdit::UndoCamera(edit) => {
                Event::CameraUndone { generation, outcome: undo_saved_camera_edit(edit, inputs) }
            }
        });
    }

    /// Finds the first object hit by the ray through a pixel's center.
    fn pick(&self, spot: NormalizedPosition, state: Option<&FilmState>) -> PickedPixel {
        let (width, height) = (self.settings.render.width, self.settings.render.height);
        let pixel = |at: f64, side: u32| ((at * f64::from(side)).max(0.0) as u32).min(side - 1);
        let (x, y) = (pixel(spot.x, width), pixel(spot.y, height));
        let color = state.and_then(|state| state.film.pixel(FilmQuantity::Radiance, x, y));
        let object = self.object_at([x, y]);
        PickedPixel { pixel: [x, y], object, color: color.map(|color| color.to_array()) }
    }

    fn object_at(&self, pixel: [u32; 2]) -> Option<PickedObject> {
        let (world, loaded) = (&self.world, &self.parsed.loaded);
        let ray = self.settings.ray_through_pixel(&world.camera, pixel)?;
        let hit = world.geometry.closest_hit(&ray)?;
        let surface = world.geometry.surface(&ray, &hit);
        let object = loaded.scene.objects.get(hit.object as usize)?;
        let material = match object.material.map(|index| &loaded.scene.materials[index]) {
            Some(material) => format!("{} {}", material.kind.name(), material.name),
            None => match world.file_material_name(&hit) {
                Some(name) => format!("{name} (in the file)"),
                None => "no material in the file".to_owned(),
            },
        };
        let instance = loaded.scene.instance_containing(hit.object as usize).map(|instance| PickedInstance {
            name: instance.name.as_deref().map(str::to_owned),
            line: loaded.line_number(&instance.span),
        });
        let is_front = surface.shading_normal.dot(ray.direction) <= 0.0;
        Some(PickedObject {
            shape: object.shape.kind(),
            name: object.name.as_deref().map(str::to_owned),
            path: loaded.path.clone(),
            line: loaded.line_number(&object.span),
            instance,
            material,
            position: (surface.point.as_dvec3() + world.geometry.coordinate_origin()).to_array(),
            normal: surface.shading_normal.to_array(),
            is_front,
            distance: f64::from(hit.shape.t),
            depth: world.camera.depth_of(surface.point.as_dvec3()),
        })
    }

    /// Writes a camera to the scene file. Fails if the file or the scene's camera has changed since it was
    /// read.
    fn save_camera(
        &self,
        UserMovedCamera { camera, own }: &UserMovedCamera,
        inputs: &ProtectedInputs,
    ) -> Result<CameraSaveResult, String> {
        let loaded = &self.parsed.loaded;
        let path = loaded.path.clone();
        if loaded.is_foreign() && !has_model_extension(&path) {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            return Err(format!("{} {name}", FOREIGN_SCENE_NOT_WRITTEN));
        }
        if loaded.is_foreign() {
            return match is_file_missing(&path) {
                true => Err(format!("{} {MODEL_MISSING}", path.display())),
                false => save_model_scene_with_camera(loaded, camera),
            };
        }
        let read = loaded.source.text_without_set_args();
        let changed = SCENE_FILE_CHANGED;
        if is_file_missing(&path) {
            return Err(SCENE_FILE_MISSING.to_owned());
        }
        if !file_text_equals(&path, read) {
            return Err(changed.to_owned());
        }
        // Values that were not changed with keys come from the old camera, so writing them would overwrite
        // newer values.
        if *own != self.own {
            return Err(CAMERA_CHANGED.to_owned());
        }
        let text = loaded.text_with_camera(camera)?;
        let edit = if text == read {
            None
        } else {
            replace_scene_text_if_unchanged(&path, read, &text, inputs, changed, "camera not saved")?;
            Some(SavedCameraEdit { path: path.clone(), before: read.into(), after: text.as_str().into() })
        };
        let is_own = LoadedScene::parse_camera_from_text(&text, &self.sets)
            .is_some_and(|own| own.is_nearly_equal_to_view(camera));
        Ok(CameraSaveResult { path, is_new: edit.is_some(), is_own, of_model: false, edit })
    }
}

/// Undoes a camera edit by restoring the previous text. Fails if the file has changed since the edit.
fn undo_saved_camera_edit(edit: &SavedCameraEdit, inputs: &ProtectedInputs) -> Result<PathBuf, String> {
    let SavedCameraEdit { path, before, after } = edit;
    let changed = format!("{} {NOT_UNDONE}", path.display());
    if is_file_missing(path) {
        return Err(format!("{} does not exist: nothing to undo", path.display()));
    }
    if !file_text_equals(path, after) {
        return Err(changed);
    }
    replace_scene_text_if_unchanged(path, after, before, inputs, &changed, "not undone")?;
    Ok(path.clone())
}

/// Whether a file does not exist.
fn is_file_missing(path: &Path) -> bool {
    path.metadata().is_err_and(|error| error.kind() == std::io::ErrorKind::NotFound)
}

/// Whether a file's text is exactly `text`.
fn file_text_equals(path: &Path, text: &str) -> bool {
    read_scene_file_text(path).is_ok_and(|now| *now == *text)
}

/// Replaces the text of a scene file. If the file's text is not `old`, fails with the message `changed`. If
/// file metadata would be lost, fails with a message that ends with `outcome`.
fn replace_scene_text_if_unchanged(
    path: &Path,
    old: &str,
    new: &str,
    inputs: &ProtectedInputs,
    changed: &str,
    outcome: &str,
) -> Result<(), String> {
    let metadata = file::file_kind_and_metadata(path)
        .map(|(_, metadata)| metadata)
        .map_err(|error| describe_io_error(&error))?;
    if let Some(why) = file::hard_linked_or_readonly_reason(&metadata) {
        return Err(format!("{} {why}: {outcome}", path.display()));
    }
    let refused = || OutputError::Refused { reason: changed.to_owned() };
    let may_replace = |_: &Path| file_text_equals(path, old).then_some(()).ok_or_else(refused);
    let guard = write::ExistingFilePolicy {
        is_kept: &|path| inputs.contains_path(path),
        may_replace: &may_replace,
        sweep: None,
        losses: AttributeLossPolicy::Refuse,
    };
    write::write_atomically_if_unchanged(path, old.as_bytes(), new.as_bytes(), &guard, &CancelToken::new())
        .map_err(|error| error.to_string())
}

/// Writes the scene generated for a model, but with this camera, to a file next to the model. Never replaces
/// an existing file.
fn save_model_scene_with_camera(
    loaded: &LoadedScene,
    camera: &ResolvedCamera,
) -> Result<CameraSaveResult, String> {
    let path = loaded.path.with_extension("toml");
    let shown = path.display();
    if path.symlink_metadata().is_ok() {
        return Err(format!("{shown} {ALREADY_EXISTS}: move it away and press c again"));
    }
    let text = loaded.text_with_camera(camera)?;
    write::write_new_file(&path, text.as_bytes())
        .map_err(|error| format!("cannot write {shown}: {}", describe_io_error(&error)))?;
    Ok(CameraSaveResult { path, is_new: true, is_own: false, of_model: true, edit: None })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;
    use crate::scene::description::{ImageShiftAndMirror, Pose, Projection};
    use crate::tests::loaded_of;

    #[test]
    fn unwritable_model_scene_is_reported() {
        let loaded = LoadedScene { path: "gone/a.obj".into(), ..loaded_of("[environment]\ncolor = 1\n") };
        let pose = Pose { position: DVec3::Z, look_at: DVec3::ZERO, up: DVec3::Y };
        let camera = ResolvedCamera {
            pose,
            projection: Projection::Perspective { fov: 40.0 },
            window: ImageShiftAndMirror::default(),
            aperture: 0.0,
            focus: 1.0,
        };
        let said = save_model_scene_with_camera(&loaded, &camera).expect_err("no folder");
        assert_eq!(said, "cannot write gone/a.toml: no such file or directory");
    }
}
