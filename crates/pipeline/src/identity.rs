//! Identity of an image: the names and values of everything that affects it, independent of the machine and
//! the folder. Unlike stage keys, which include paths and timestamps, the identity refers to files by
//! content.

use std::path::{Path, PathBuf};

use super::build::BUILD;
use super::keys;
use super::plan::RenderPlan;
use super::prepare::RequestCamera;
use super::stages::parse::ParsedScene;
use super::watch::content::{FileContentId, FilePathAndContentId};
use crate::choice::Choice;
use crate::integrators::{PhotonSettings, RenderSettings};
use crate::output::part::NamedRenderInput;
use crate::scene::description::{CameraOverrides, MeshFile, Scene, Texture};
use crate::scene::fingerprint::{Fingerprint, FingerprintHasher};

/// Everything that affects an image.
pub(super) struct ImageDependencies<'a> {
    pub(super) parsed: &'a ParsedScene,
    pub(super) plan: &'a RenderPlan,
    pub(super) camera: &'a CameraOverrides,
    /// Files that were read, including the scene file.
    pub(super) files: &'a [FilePathAndContentId],
    /// The whole image's sample count if the image is rendered in parts. All parts must use the same sample
    /// count and output settings.
    pub(super) divided: Option<u32>,
}

impl ImageDependencies<'_> {
    /// Returns the names and values of everything that affects the image.
    pub(super) fn names_and_values(&self) -> Vec<NamedRenderInput> {
        let mut traits = vec![NamedRenderInput::from_setting("glimt", BUILD)];
        self.add_settings(&mut traits);
        let scene_path = &self.parsed.loaded.path;
        let others = self.files.iter().filter(|file| file.path != *scene_path);
        traits.extend(others.map(|file| {
            NamedRenderInput::from_file(&path_relative_to_scene(&file.path, scene_path), hash_or_reason(file))
        }));
        traits.push(NamedRenderInput::from_combined_hash(self.fingerprint().to_string()));
        traits
    }

    fn add_settings(&self, traits: &mut Vec<NamedRenderInput>) {
        let RenderSettings { render, dof, view, photons, layers } =
            self.plan.settings.without_ineffective_settings();
        let mut add = |name: &str, value: String| traits.push(NamedRenderInput::from_setting(name, value));
        add("width", render.width.to_string());
        add("height", render.height.to_string());
        add("error", render.error.to_string());
        add("shadow_samples", render.shadow_samples.to_string());
        add("max_depth", render.max_depth.to_string());
        add("integrator", render.integrator.name().to_owned());
        add("shadows", render.shadows.name().to_owned());
        add("clamp", render.clamp.to_string());
        add("ambient", render.ambient.to_string());
        add("background", render.background.to_string());
        add("filter", render.filter.name().to_owned());
        add("gain", render.gain.to_string());
        add("seed", render.seed.to_string());
        add("depth of field", if dof { "on" } else { "off" }.to_owned());
        // All parts must have the same view. Checkpoints only need the same samples.
        let sampled = if self.divided.is_some() { view } else { view.view_to_sample() };
        add("view", sampled.name().to_owned());
        add(
            "photons",
            match photons {
                Some(PhotonSettings { count, radius, bounces }) => {
                    format!("on (count {count}, radius {radius}, bounces {bounces})")
                }
                None => "off".to_owned(),
            },
        );
        add(
            "crop",
            match self.plan.crop {
                Some(rect) => format!("{},{},{},{}", rect.x, rect.y, rect.width, rect.height),
                None => "none".to_owned(),
            },
        );
        if !layers.is_empty() {
            let names: Vec<_> = self.plan.layers.iter().map(|layer| layer.name()).collect();
            add("layers", names.join(","));
        }
        if let Some(samples) = self.divided {
            add("samples", samples.to_string());
            let tone = self.plan.tone_mapping();
            add("exposure", tone.exposure_stops.to_string());
            add("tonemap", tone.curve.name().to_owned());
            add("bits per channel", self.plan.bit_depth.to_string());
        }
    }

    /// Returns a fingerprint of shapes, materials, lights, camera and settings.
    fn fingerprint(&self) -> Fingerprint {
        let scene = self.copy_scene_with_content_hashes();
        let eye = RequestCamera::new(&scene, self.parsed.orbiter, self.camera);
        let orbiter = eye.orbiter_fingerprint_text();
        let meshes: Vec<Fingerprint> = scene
            .mesh_files
            .iter()
            .map(|file| mesh_content_key(&self.describe_file_content(&file.value), file))
            .collect();
        let of = keys::scene_fingerprint_references(&scene, &meshes, orbiter.as_deref());
        let world = keys::world_key(&keys::surfaces_and_lights_key(&scene, &of, &[]), &eye.camera, &of);
        keys::film_sums_key(world, &self.plan.settings, self.plan.crop)
    }

    /// Returns the scene with each path replaced by a description of the file's content.
    fn copy_scene_with_content_hashes(&self) -> Scene {
        let mut scene = Scene::clone(&self.plan.scene);
        for image in scene.textures.iter_mut().filter_map(Texture::as_image_mut) {
            image.file.value = self.describe_file_content(&image.file.value).into();
        }
        if let Some(file) = scene.environment.as_mut().and_then(|environment| environment.file.as_mut()) {
            file.value = self.describe_file_content(&file.value).into();
        }
        scene
    }

    /// Describes a file's content. Uses the file name if the file was not read, because unread files do not
    /// affect the image.
    fn describe_file_content(&self, path: &Path) -> String {
        match self.files.iter().find(|file| file.path == path) {
            Some(file) => hash_or_reason(file),
            None => path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        }
    }
}

/// Returns the key for a mesh file with this content.
fn mesh_content_key(content: &str, file: &MeshFile) -> Fingerprint {
    let mut key = FingerprintHasher::new("content");
    key.add_str(content);
    if let Some(part) = file.part {
        key.add_usize(part as usize);
    }
    if file.subdivide > 0 {
        key.add_str("subdivide").add_usize(file.subdivide as usize);
    }
    key.finish()
}

/// Returns the path relative to the scene's folder, or only the file name if the path is outside that folder.
pub(super) fn path_relative_to_scene(path: &Path, scene: &Path) -> String {
    let folder = scene.parent().unwrap_or(Path::new(""));
    let inside = path.strip_prefix(folder).ok().map(Path::to_owned);
    let name = || path.file_name().map(PathBuf::from).unwrap_or_default();
    inside.unwrap_or_else(name).to_string_lossy().into_owned()
}

/// Returns the file's hash in hexadecimal, or the reason why there is none.
fn hash_or_reason(file: &FilePathAndContentId) -> String {
    match file.content {
        FileContentId::Missing => "missing".to_owned(),
        FileContentId::Unusable(_) => "not readable".to_owned(),
        FileContentId::Hash(hash) => hash.iter().map(|byte| format!("{byte:02x}")).collect(),
    }
}
