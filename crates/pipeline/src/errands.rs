//! Errands: a question about a place of the current picture, and the orders to write the camera into the scene file and to take
//! that back. They are carried out whatever else is going on.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::inputs::Inputs;
use super::protocol::{CameraEdit, Event, Kept, MovedCamera, Picked, Spot, Thing, Viewpoint};
use super::render::film_state::FilmState;
use super::sink::Sink;
use super::stages::parse::Parsed;
use crate::control::CancelToken;
use crate::film::Quantity;
use crate::integrators::RenderSettings;
use crate::math::DVec2;
use crate::output::{Losses, OutputError, write};
use crate::scene::{Loaded, is_mesh, is_model, text_now};
use crate::system::{describe_error, file};
use crate::world::World;

/// An order that a person gives.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Errand {
    KeepCamera(MovedCamera),
    UndoCamera(CameraEdit),
    Pick(Spot),
}

impl Errand {
    /// There is nothing to ask.
    pub(super) fn fail(&self, why: &str, sink: &Sink) {
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

/// The picture that somebody looks at.
#[derive(Clone)]
pub(super) struct AtHand {
    pub(super) parsed: Arc<Parsed>,
    /// Values that the call sets in the scene.
    pub(super) sets: Vec<String>,
    pub(super) world: Arc<World>,
    pub(super) settings: RenderSettings,
    /// The scene's own camera.
    pub(super) own: Viewpoint,
}

impl AtHand {
    pub(super) fn run(&self, errand: &Errand, canvas: Option<&FilmState>, inputs: &Inputs, sink: &Sink) {
        let generation = sink.generation;
        sink.send(match errand {
            Errand::Pick(spot) => Event::Picked { generation, picked: Box::new(self.pick(*spot, canvas)) },
            Errand::KeepCamera(camera) => {
                Event::CameraKept { generation, outcome: self.keep_camera(camera, inputs) }
            }
            Errand::UndoCamera(edit) => Event::CameraUndone { generation, outcome: undo(edit, inputs) },
        });
    }

    /// The first object on the ray through the middle of a pixel.
    fn pick(&self, spot: Spot, canvas: Option<&FilmState>) -> Picked {
        let (width, height) = (self.settings.render.width, self.settings.render.height);
        let pixel = |at: f64, side: u32| ((at * f64::from(side)).max(0.0) as u32).min(side - 1);
        let (x, y) = (pixel(spot.x, width), pixel(spot.y, height));
        let color = canvas.and_then(|canvas| canvas.film.pixel(Quantity::Radiance, x, y));
        let middle = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let thing = self.thing(self.settings.pixel_to_camera(middle));
        Picked { pixel: [x, y], thing, color: color.map(|color| color.to_array()) }
    }

    fn thing(&self, place: DVec2) -> Option<Thing> {
        let (world, loaded) = (&self.world, &self.parsed.loaded);
        let ray = world.camera.pinhole_ray(place);
        let hit = world.geometry.closest(&ray)?;
        let surface = world.geometry.surface(&ray, &hit);
        let object = loaded.scene.objects.get(hit.object as usize)?;
        let material = match object.material.map(|index| &loaded.scene.materials[index]) {
            Some(material) => format!("{} {}", material.kind.name(), material.name),
            None => match world.file_material_name(&hit) {
                Some(name) => format!("{name}, of the file"),
                None => "none of the file".to_owned(),
            },
        };
        let is_front = surface.shading_normal.dot(ray.direction) <= 0.0;
        Some(Thing {
            shape: object.shape.kind(),
            name: object.name.as_deref().map(str::to_owned),
            path: loaded.path.clone(),
            line: loaded.line(&object.span),
            material,
            position: (surface.point.as_dvec3() + world.geometry.origin()).to_array(),
            normal: surface.shading_normal.to_array(),
            is_front,
            distance: f64::from(hit.shape.t),
            depth: world.camera.depth_of(surface.point.as_dvec3()),
        })
    }

    /// Writes the scene file with this camera, unless the file, or the camera that it was moved from, is another one than was
    /// read.
    fn keep_camera(
        &self,
        MovedCamera { camera, own }: &MovedCamera,
        inputs: &Inputs,
    ) -> Result<Kept, String> {
        let loaded = &self.parsed.loaded;
        let path = loaded.path.clone();
        if is_model(&path) {
            return write_scene_of_model(loaded, camera);
        }
        if is_mesh(&path) && path.symlink_metadata().is_err() {
            return Err(format!("{} is gone: its scene is not written", path.display()));
        }
        let read = loaded.source.text();
        let changed = "the scene file has changed since it was read: the camera is not written into it";
        if is_gone(&path) {
            return Err("the scene file is gone: the camera is not written".to_owned());
        }
        if !has_text(&path, read) {
            return Err(changed.to_owned());
        }
        // Numbers that keys did not move are those of the camera from before: they would go over newer ones.
        if *own != self.own {
            return Err(
                "the scene's camera has changed since it was moved: press c again to write it".to_owned()
            );
        }
        let text = loaded.text_with_camera(camera)?;
        let edit = if text == read {
            None
        } else {
            replace(&path, (read, &text), inputs, (changed, "the camera is not written into it"))?;
            Some(CameraEdit { path: path.clone(), before: read.into(), after: text.as_str().into() })
        };
        let is_own = Loaded::camera_of(&text, &self.sets).is_some_and(|own| own.is_nearly(camera));
        Ok(Kept { path, is_new: edit.is_some(), is_own, of_model: false, edit })
    }
}

/// Puts back the text from before a camera was written, if the file is still as that left it.
fn undo(edit: &CameraEdit, inputs: &Inputs) -> Result<PathBuf, String> {
    let CameraEdit { path, before, after } = edit;
    let changed = format!("{} has changed since c wrote it: it is left as it is", path.display());
    if is_gone(path) {
        return Err(format!("{} is gone: there is nothing to undo in it", path.display()));
    }
    if !has_text(path, after) {
        return Err(changed);
    }
    replace(path, (after, before), inputs, (&changed, "it is left as it is"))?;
    Ok(path.clone())
}

/// Whether a file has vanished.
fn is_gone(path: &Path) -> bool {
    path.metadata().is_err_and(|error| error.kind() == std::io::ErrorKind::NotFound)
}

/// Whether this is what the file holds.
fn has_text(path: &Path, text: &str) -> bool {
    text_now(path).is_ok_and(|now| *now == *text)
}

/// Writes another text in place of the one that a scene file has. `changed`: the words for a file with any other text.
/// `outcome`: what does not happen if the file would lose something.
fn replace(
    path: &Path,
    (old, new): (&str, &str),
    inputs: &Inputs,
    (changed, outcome): (&str, &str),
) -> Result<(), String> {
    let metadata = file::kind(path).map(|(_, metadata)| metadata).map_err(|error| describe_error(&error))?;
    if let Some(why) = file::reason_to_keep(&metadata) {
        return Err(format!("{} {why}: {outcome}", path.display()));
    }
    let refused = || OutputError::Refused { reason: changed.to_owned() };
    let may_replace = |_: &Path| has_text(path, old).then_some(()).ok_or_else(refused);
    let guard = write::Guard {
        is_kept: &|path| inputs.contain(path),
        may_replace: &may_replace,
        sweep: None,
        losses: Losses::Refused,
    };
    write::atomic_in_place_of(path, (old.as_bytes(), new.as_bytes()), &guard, &CancelToken::new())
        .map_err(|error| error.to_string())
}

/// Writes the scene of a model, with this camera, beside the model; never over a file.
fn write_scene_of_model(loaded: &Loaded, camera: &Viewpoint) -> Result<Kept, String> {
    let path = loaded.path.with_extension("toml");
    let shown = path.display();
    if path.symlink_metadata().is_ok() {
        return Err(format!(
            "{shown} exists already, and is left as it is: move it away, then press c again"
        ));
    }
    let text = loaded.text_with_camera(camera)?;
    write::new_file(&path, text.as_bytes())
        .map_err(|error| format!("{shown} is not written: {}", describe_error(&error)))?;
    Ok(Kept { path, is_new: true, is_own: false, of_model: true, edit: None })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;
    use crate::scene::description::Pose;
    use crate::tests::loaded_of;

    #[test]
    fn the_scene_of_a_model_that_cannot_be_written_is_said_to_be_unwritten() {
        let loaded = Loaded { path: "gone/a.obj".into(), ..loaded_of("[environment]\ncolor = 1\n") };
        let pose = Pose { position: DVec3::Z, look_at: DVec3::ZERO, up: DVec3::Y };
        let camera = Viewpoint { pose, fov: 40.0, aperture: 0.0, focus: 1.0 };
        let said = write_scene_of_model(&loaded, &camera).expect_err("no folder");
        assert_eq!(said, "gone/a.toml is not written: no such file or directory");
    }
}
