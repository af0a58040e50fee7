//! Scenes of models: the text of a scene that shows a mesh or a glTF file. `glimt MODEL` reads this text as it reads that of a
//! scene file, `glimt import` writes it; so both show the same.

mod frame;
mod gltf;
pub(super) mod import;
mod materials;
mod plain;
mod toml;

use std::collections::HashSet;
use std::path::Path;

use self::frame::{Eye, FOV, KEY, SKY, ground_reflectance, key_direction};
use self::gltf::{Asset, Naming};
use self::toml::{Toml, exact_vector, number, rounded, vector};
use super::settings::{Overrides, Side, UpAxis};
use super::stages::containers::Containers;
use crate::assets::gltf::is_gltf;
use crate::assets::{AssetError, Companion, FileHash};
use crate::control::CancelToken;
use crate::math::DVec3;
use crate::scene::diagnostic::Diagnostic;
use crate::scene::fingerprint::Fingerprint;

/// Way of showing a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Show {
    /// The side from which it is seen. `None` for the file's own camera, else [`Side::Iso`].
    pub(crate) from: Option<Side>,
    /// Width over height of the picture. `None` if the call leaves one of them open.
    pub(crate) aspect: Option<f64>,
    /// The axis of a mesh file that points upwards. `None` for the usual one of its format.
    pub(crate) up: Option<UpAxis>,
    /// Pictures of a turntable, in all of which the model is to be seen. 1 for a single picture.
    pub(crate) turns: u32,
}

/// Width and height of a picture where nobody says another.
const SIZE: [f64; 2] = [640.0, 480.0];

impl Default for Show {
    fn default() -> Self {
        Self { from: None, aspect: None, up: None, turns: 1 }
    }
}

impl Show {
    /// The way that a call asks for.
    pub(crate) fn of(overrides: &Overrides) -> Self {
        let aspect = match (overrides.width, overrides.height) {
            (None, None) => None,
            (width, height) => {
                let or = |given: Option<u32>, usual: f64| given.map_or(usual, f64::from);
                Some(or(width, SIZE[0]) / or(height, SIZE[1]))
            }
        };
        Self {
            from: overrides.from,
            aspect,
            up: overrides.up,
            turns: overrides.turn.map_or(1, |turn| turn.of),
        }
    }

    /// Adds what the scene of a model depends on.
    pub(crate) fn add_to(self, key: &mut Fingerprint) {
        key.flag(self.from.is_some());
        if let Some(from) = self.from {
            key.choice(from);
        }
        key.flag(self.up.is_some());
        if let Some(up) = self.up {
            key.choice(up);
        }
        key.f64(self.aspect.unwrap_or_default()).u64(self.turns.into());
    }
}

/// The scene of a model.
#[derive(Debug)]
pub(crate) struct ModelText {
    /// The text of the scene.
    pub(crate) text: String,
    /// Hash of the model's file.
    pub(crate) hash: FileHash,
    /// Other files that it was made of.
    pub(crate) companions: Vec<Companion>,
    /// Approximations, a line each.
    pub(crate) notes: Vec<String>,
    /// Files that the text names beside itself and that are not there yet.
    pub(crate) assets: Vec<Asset>,
}

/// The scene that shows a model, with paths relative to the model's folder.
///
/// # Errors
/// What is wrong with the file.
pub(crate) fn text(
    path: &Path,
    show: Show,
    containers: &Containers,
    token: &CancelToken,
) -> Result<ModelText, AssetError> {
    if is_gltf(path) {
        if show.up.is_some_and(|up| up != UpAxis::Y) {
            let reason = "y is up in glTF files: --up is for obj, off, ply, stl".to_owned();
            return Err(AssetError::Malformed { path: path.to_owned(), line: None, reason });
        }
        return gltf::text(path, (show, &Naming::Inside), containers, token);
    }
    plain::text(path, show, containers, token)
}

/// The note about a model that leaves no trace in its picture.
const UNSEEN: &str = "nothing of it is seen: its faces have an opacity of 0";

/// A mistake in the scene of a model, which is in no file.
pub(crate) fn in_its_scene(one: Diagnostic) -> Diagnostic {
    Diagnostic { message: format!("in the scene of this model, {}", one.message), ..one }
}

/// Name of a file in its folder.
fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Most radiance that a path brings by one vertex after its first reflection, in scenes of polished surfaces: few samples would show
/// the key light by way of these as bright dots. Four times the radiance of the sky.
const CLAMP: &str = "2";
/// Roughness from which on surfaces throw no bright dots on others: at 0.4, the clamp changes the error at 64 samples by a quarter,
/// at 0.2 tenfold.
const ROUGH: f64 = 0.3;
/// The exponent of a Phong highlight as narrow as one of that roughness: 2/α² − 2 with α = roughness².
const NARROW: f32 = 245.0;

/// The light of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Lighting {
    /// A sky and a key light.
    Ours {
        /// Whether any surface is polished.
        is_polished: bool,
    },
    /// The lights of the file, with a sky that is as bright to them as ours to the key light.
    Own {
        /// Stops by which the picture is darker than the lights make it, at most 0.
        exposure: f64,
    },
}

impl Lighting {
    /// Lights that bring so much irradiance to the model.
    fn own(irradiance: f64) -> Self {
        // A white surface is then as bright as under our lights.
        const USUAL: f64 = 3.0;
        let over = (irradiance / USUAL).max(1.0);
        // The sky stays within what a scene may have, however near a light is.
        const MOST: f64 = 40.0;
        Self::Own { exposure: -(libm::log2(over).min(MOST) * 10.0).round() / 10.0 }
    }

    /// Radiance of the sky.
    fn sky(self) -> f64 {
        match self {
            Self::Ours { .. } => SKY,
            Self::Own { exposure } => rounded(SKY * libm::exp2(-exposure), 3),
        }
    }
}

/// Tables that are the same for every model: the picture, then what is around it.
fn render(toml: &mut Toml, size: Option<[u32; 2]>, light: Lighting) {
    toml.table("[render]");
    if let Some([width, height]) = size {
        toml.key("width", width.to_string());
        toml.key("height", height.to_string());
    }
    toml.key("samples", "256");
    toml.key("error", "0.05");
    toml.key("integrator", "\"path\"");
    match light {
        Lighting::Ours { is_polished: true } => toml.key("clamp", CLAMP),
        Lighting::Ours { is_polished: false } => {}
        Lighting::Own { exposure } if exposure != 0.0 => toml.key("exposure", number(exposure)),
        Lighting::Own { .. } => {}
    }
}

/// The camera that frames the model.
fn camera(toml: &mut Toml, eye: &Eye, fov: f64) {
    toml.table("[camera]");
    toml.key("position", exact_vector(eye.position));
    toml.key("look_at", exact_vector(eye.look_at));
    if eye.up != DVec3::Y {
        toml.key("up", vector(eye.up));
    }
    if fov != 40.0 {
        toml.key("fov", number(fov));
    }
}

/// A sky, and a key light where the model has no lights of its own.
fn light(toml: &mut Toml, eye: &Eye, light: Lighting) {
    toml.table("[environment]");
    toml.key("color", number(light.sky()));
    if matches!(light, Lighting::Ours { .. }) {
        toml.table("[[light]]");
        toml.key("type", "\"directional\"");
        toml.key("direction", vector(key_direction(eye)));
        toml.key("irradiance", number(KEY));
        toml.key("angle", "6");
    }
}

/// A ground below the model, unless the eye is below it.
fn ground(toml: &mut Toml, names: &mut Unique, [least, greatest]: [DVec3; 2], eye: &Eye) {
    let size = (greatest - least).length();
    let height = least.y - size * 1e-4;
    if eye.position.y <= height {
        return;
    }
    let name = names.name("ground", "ground");
    toml.table(&format!("[materials.{name}]"));
    toml.key("diffuse", number(ground_reflectance()));
    toml.table("[[plane]]");
    toml.key("point", exact_vector(DVec3::new(0.0, frame::tidied(height, size * 1e-5), 0.0)));
    toml.key("material", format!("\"{name}\""));
}

/// Names in use.
#[derive(Debug, Default)]
struct Unique(HashSet<String>);

impl Unique {
    /// A name that is not in use yet: this one, or with a number. One without letters becomes `usual` with a number.
    fn name(&mut self, wanted: &str, usual: &str) -> String {
        let plain: String = wanted.chars().filter(|c| !c.is_control()).take(100).collect();
        let plain = plain.trim();
        let is_name = plain.parse::<f64>().is_err() && !plain.is_empty();
        let plain = if is_name { plain } else { usual };
        let mut name = plain.to_owned();
        let mut next = 2;
        while !self.0.insert(name.clone()) {
            name = format!("{plain}_{next}");
            next += 1;
        }
        name
    }
}
