//! The files that a scene reads or references. Every write is checked against this list.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::formats::has_model_extension;
use super::identity::path_relative_to_scene;
use super::prepare::SceneAssets;
use super::stages::meshes::MeshesByFileIndex;
use super::stages::parse::ParsedScene;
use super::watch::content::FilePathAndContentId;
use crate::assets::gltf::has_gltf_extension;
use crate::output::{ApproximateFileIdentity, FileIdentity};
use crate::scene::LoadedScene;
use crate::scene::description::Camera;

/// A file that must not be written.
#[derive(Clone, Debug)]
pub(super) struct ProtectedInput {
    pub(super) path: PathBuf,
    /// Role of the file in the scene, for messages.
    pub(super) role: String,
    /// The scene, and the span in the scene file that references this file.
    pub(super) place: Option<(Arc<LoadedScene>, Range<usize>)>,
}

/// All files that must not be written.
#[derive(Clone, Debug, Default)]
pub(super) struct ProtectedInputs(Vec<ProtectedInput>);

impl ProtectedInputs {
    /// Collects the scene file and all files it references, used or not.
    pub(super) fn from_scene(parsed: &ParsedScene) -> Self {
        let loaded = &parsed.loaded;
        let scene = &loaded.scene;
        let path = loaded.path.clone();
        let role =
            if loaded.is_foreign() && has_model_extension(&path) { "the model" } else { "the scene file" };
        let mut inputs = Self(vec![ProtectedInput { path, role: role.to_owned(), place: None }]);
        let mut add = |path: &Path, span: &Range<usize>, role: String| {
            let place = Some((Arc::clone(loaded), span.clone()));
            inputs.0.push(ProtectedInput { path: path.to_owned(), role, place });
        };
        match &scene.camera {
            Camera::Orbiter { file, .. } => {
                add(&file.value, &file.span, "the camera's orbiter file".to_owned());
            }
            Camera::LookAt { .. } => {}
        }
        for texture in &scene.textures {
            if let Some(image) = texture.as_image() {
                let role = format!("the file for texture `{}`", texture.name);
                add(&image.file.value, &image.file.span, role);
            }
        }
        if let Some(file) = scene.environment.as_ref().and_then(|environment| environment.file.as_ref()) {
            add(&file.value, &file.span, "the environment map".to_owned());
        }
        for mesh in &scene.mesh_files {
            add(&mesh.value, &mesh.span, "one of the scene's mesh files".to_owned());
        }
        for path in &parsed.named {
            let role = "a file that the scene references without the current overrides".to_owned();
            inputs.0.push(ProtectedInput { path: path.clone(), role, place: None });
        }
        inputs
    }

    /// Collects the files that a loaded scene references and all other files that were read.
    pub(super) fn from_assets(assets: &SceneAssets) -> Self {
        let mut inputs = Self::from_scene(&assets.parsed);
        inputs.add_mesh_dependencies(&assets.parsed.loaded, &assets.meshes);
        inputs.add_other_read_files(&assets.files);
        inputs
    }

    /// Adds the material libraries and images used by mesh files, and the files referenced by glTF files.
    fn add_mesh_dependencies(&mut self, loaded: &Arc<LoadedScene>, meshes: &MeshesByFileIndex) {
        for (file, kept) in loaded.scene.mesh_files.iter().zip(meshes) {
            let name = file.value.file_name().unwrap_or_default().to_string_lossy();
            let mut add = |path: &PathBuf, role: String| {
                let place = Some((Arc::clone(loaded), file.span.clone()));
                self.0.push(ProtectedInput { path: path.clone(), role, place });
            };
            let kind = if has_gltf_extension(&file.value) { "buffer" } else { "material file" };
            for companion in &kept.mesh.companions {
                add(&companion.path, format!("a {kind} used by {name}"));
            }
            for picture in &kept.mesh.pictures {
                add(picture, format!("an image referenced by {name} or its materials"));
            }
        }
    }

    /// Adds all other files that were read.
    pub(super) fn add_other_read_files(&mut self, files: &[FilePathAndContentId]) {
        let known: HashSet<PathBuf> = self.0.iter().map(|input| input.path.clone()).collect();
        for file in files.iter().filter(|file| !known.contains(&file.path)) {
            let role = "a file read by the scene".to_owned();
            self.0.push(ProtectedInput { path: file.path.clone(), role, place: None });
        }
    }

    /// Adds the inputs of another scene.
    pub(super) fn merge(&mut self, others: Self) {
        let known: HashSet<PathBuf> = self.0.iter().map(|input| input.path.clone()).collect();
        self.0.extend(others.0.into_iter().filter(|other| !known.contains(&other.path)));
    }

    /// Returns the sorted paths of all files except the scene, relative to the scene's folder.
    pub(super) fn paths_relative_to_scene(&self, scene: &Path) -> Vec<String> {
        let others = self.0.iter().filter(|input| input.path != scene);
        let paths: BTreeSet<_> = others.map(|input| path_relative_to_scene(&input.path, scene)).collect();
        paths.into_iter().collect()
    }

    /// Indexes the files according to their current state on disk.
    pub(super) fn build_identity_index(&self) -> InputsByIdentity<'_> {
        let mut on_disk = InputsByIdentity { by_identity: HashMap::new(), alike: Vec::new() };
        for input in &self.0 {
            if let Some(identity) = FileIdentity::from_existing_or_new_path(&input.path) {
                on_disk.by_identity.entry(identity).or_insert(input);
            }
            on_disk
                .alike
                .extend(ApproximateFileIdentity::from_path(&input.path).map(|likeness| (likeness, input)));
        }
        on_disk
    }

    /// Whether a path currently refers to one of the files.
    pub(super) fn contains_path(&self, path: &Path) -> bool {
        FileIdentity::from_existing_or_new_path(path)
            .is_some_and(|_| self.build_identity_index().find(path).is_some())
    }
}

/// Inputs indexed by file identity, with fingerprints for finding similar files.
pub(super) struct InputsByIdentity<'a> {
    by_identity: HashMap<FileIdentity, &'a ProtectedInput>,
    alike: Vec<(ApproximateFileIdentity, &'a ProtectedInput)>,
}

impl<'a> InputsByIdentity<'a> {
    /// Returns the input that a path refers to, or probably refers to.
    pub(super) fn find(&self, path: &Path) -> Option<&'a ProtectedInput> {
        if let Some(input) = self.by_identity.get(&FileIdentity::from_existing_or_new_path(path)?) {
            return Some(input);
        }
        let own = ApproximateFileIdentity::from_path(path)?;
        self.alike.iter().find(|(likeness, _)| own.may_equal(likeness)).map(|(_, input)| *input)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn input_is_recognized_despite_different_case() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        for (name, text) in [("t.png", "one"), ("T.PNG", "longer"), ("other.png", "two")] {
            fs::write(at(name), text).expect("written");
        }
        let inputs = ProtectedInputs(vec![ProtectedInput {
            path: at("t.png"),
            role: "a texture".to_owned(),
            place: None,
        }]);
        for (name, is_input) in [("t.png", true), ("T.PNG", true), ("other.png", false), ("none.png", false)]
        {
            assert_eq!(inputs.contains_path(&at(name)), is_input, "{name}");
        }
    }
}
