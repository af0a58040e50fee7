//! Validates a scene and all files it references, without rendering.

use std::path::Path;
use std::sync::Arc;

use super::formats::foreign::ForeignOptions;
use super::formats::model::ModelViewOptions;
use super::inputs::ProtectedInputs;
use super::memory::MemoryEstimate;
use super::plan::{OutputNameSource, resolve_plan};
use super::prepare::{FileReader, SceneAssets, SceneCache};
use super::protocol::Failure;
use super::settings::Overrides;
use super::sink::EventSink;
use super::stages::parse::SceneParseRequest;
use super::stages::textures::TextureSelection;
use super::stages::{AbortReason, Findings};
use super::table::StageRecorder;
use super::targets::output_conflicts;
use super::threads::RenderThreads;
use super::warnings::settings_warnings;
use super::watch::content::FileHashCache;
use crate::assets::FileMaterial;
use crate::control::CancelToken;
use crate::math::{DVec3, Vec3};
use crate::scene::description::{LoweredShape, Object, Shape};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::system::threads::logical_cpu_count;

/// Object counts and warnings for a valid scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneSummary {
    /// Shapes of all kinds. A mesh instance counts as one.
    pub objects: u64,
    /// Triangles in all mesh instances, plus standalone triangles.
    pub triangles: u64,
    /// Image files, counted once per encoding, and procedural textures.
    pub textures: u64,
    /// Non-black point lights, directional lights, environments and emissive objects.
    pub lights: u64,
    /// Warnings about likely mistakes.
    pub warnings: Vec<Diagnostic>,
}

/// Checks a scene and all files it references, used or not.
///
/// # Errors
/// Returns all errors and warnings for the scene and its files.
pub fn check_scene(path: &Path, sets: &[String]) -> Result<SceneSummary, Failure> {
    check_scene_with_options(path, sets, &ForeignOptions::default(), &CancelToken::new())
}

/// Like [`check_scene`], with options for scenes from other renderers.
///
/// # Errors
/// Returns all errors and warnings for the scene and its files.
pub fn check_scene_with_options(
    path: &Path,
    sets: &[String],
    foreign: &ForeignOptions,
    token: &CancelToken,
) -> Result<SceneSummary, Failure> {
    let mut checker = IncrementalSceneChecker { foreign: foreign.clone(), ..Default::default() };
    checker.check(path, sets, token)
}

/// Checks scenes repeatedly, rereading only files that have changed.
#[derive(Default)]
pub struct IncrementalSceneChecker {
    contents: Arc<FileHashCache>,
    threads: RenderThreads,
    scenes: SceneCache,
    /// Options for scenes from other renderers.
    foreign: ForeignOptions,
}

/// Returns a conservative estimate of a render's memory use in bytes. Reads all of the scene's files.
///
/// # Errors
/// Returns all errors in the scene and its files.
pub fn estimate_memory(path: &Path, overrides: &Overrides) -> Result<u64, Failure> {
    let mut checker = IncrementalSceneChecker { foreign: overrides.foreign.clone(), ..Default::default() };
    let (assets, _) = checker.load_all(path, &overrides.sets, &CancelToken::new())?;
    let plan = resolve_plan(&assets.parsed.loaded.scene, path, overrides)
        .map_err(|error| Failure::Scene(vec![*error]))?;
    Ok(MemoryEstimate::for_image_and_scene(&plan, &assets).bytes())
}

impl IncrementalSceneChecker {
    /// Checks a scene and all files it references, used or not.
    ///
    /// # Errors
    /// Returns all errors and warnings for the scene and its files, or [`Failure::Work`] if the token is
    /// canceled.
    pub fn check(
        &mut self,
        path: &Path,
        sets: &[String],
        token: &CancelToken,
    ) -> Result<SceneSummary, Failure> {
        let (assets, warnings) = self.load_all(path, sets, token)?;
        Ok(summarize(&assets, warnings))
    }

    /// Loads a scene and all files it references. Returns the warnings about them.
    fn load_all(
        &mut self,
        path: &Path,
        sets: &[String],
        token: &CancelToken,
    ) -> Result<(SceneAssets, Vec<Diagnostic>), Failure> {
        let mut findings = Findings::default();
        let assets = self.load_consistently(path, sets, token, &mut findings);
        self.scenes.end_request(assets.is_ok());
        match assets {
            Ok(assets) if findings.errors.is_empty() => Ok((assets, findings.warnings)),
            Ok(_) => Err(findings.take_diagnostics_as_failure()),
            Err(AbortReason::Failed(failure)) => Err(failure),
            Err(AbortReason::Canceled) => Err(Failure::Work("canceled".to_owned())),
        }
    }

    /// Loads one consistent version of a scene and its files. Adds all errors and warnings to the findings.
    fn load_consistently(
        &mut self,
        path: &Path,
        sets: &[String],
        token: &CancelToken,
        findings: &mut Findings,
    ) -> Result<SceneAssets, AbortReason> {
        let sink = EventSink::silent(0);
        let pool = self.threads.get_or_create_pool(logical_cpu_count(), false)?;
        let reader = FileReader { contents: &self.contents, pool: &pool, sink: &sink, token };
        let (scenes, foreign) = (&mut self.scenes, &self.foreign);
        let mut table = StageRecorder::new(None, token);
        reader.read_until_files_unchanged(&mut table, findings, |reading| {
            let scene = SceneParseRequest { path, sets, show: ModelViewOptions::default(), foreign };
            let parsed = scenes.parse_scene(scene, reading)?;
            let assets = scenes.load_assets(&parsed, TextureSelection::ForCheck, reading)?;
            reading.verify_files_unchanged()?;
            check_settings(path, &assets, reading.findings)?;
            Ok(assets)
        })
    }
}

/// Warns about the scene's settings, and checks that its output file is not one of its inputs.
fn check_settings(path: &Path, assets: &SceneAssets, findings: &mut Findings) -> Result<(), AbortReason> {
    let (loaded, overrides) = (&assets.parsed.loaded, Overrides::default());
    let plan = resolve_plan(&loaded.scene, path, &overrides)?;
    findings.warnings.extend(settings_warnings(loaded, &plan.scene, &plan.settings, &overrides));
    if plan.outputs.named_by == OutputNameSource::Scene {
        findings.errors.extend(output_conflicts(&plan, &ProtectedInputs::from_assets(assets)));
    }
    Ok(())
}

fn summarize(assets: &SceneAssets, mut warnings: Vec<Diagnostic>) -> SceneSummary {
    let SceneAssets { parsed, meshes, textures, .. } = assets;
    let scene = &parsed.loaded.scene;
    let triangles = |shape: &Shape| match shape.to_traced_shape_relative_to(DVec3::ZERO) {
        LoweredShape::Shape(shape) => shape.triangle_count(),
        LoweredShape::Mesh(mesh) => meshes[mesh.file].mesh.mesh.triangles.len() as u64,
    };
    let emits = |object: &&Object| match (object.material, object.shape.as_mesh()) {
        (Some(index), _) => scene.materials[index].emits(),
        (None, Some(mesh)) => meshes[mesh.file].mesh.materials.iter().any(FileMaterial::emits),
        (None, None) => false,
    };
    let lights = scene.lights.iter().filter(|light| light.has_emission()).count();
    let environment = scene.environment.iter().filter(|environment| environment.has_emission()).count();
    let count = lights + environment + scene.objects.iter().filter(emits).count();
    // Lights in mesh files are not known until the files are loaded.
    let has_own = scene.objects.iter().any(|object| object.material.is_none());
    if count == 0 && has_own && scene.render.ambient == Vec3::ZERO {
        let (severity, message) = (Severity::Warning, "nothing lights this scene".to_owned());
        let help = "the mesh's own materials emit no light; add a [[light]] or an [environment]".to_owned();
        warnings.push(parsed.loaded.create_diagnostic_at(0..0, severity, message, Some(help)));
    }
    let patterns = scene.textures.iter().filter(|texture| texture.as_image().is_none());
    SceneSummary {
        objects: scene.objects.len() as u64,
        triangles: scene.objects.iter().map(|object| triangles(&object.shape)).sum(),
        textures: (textures.images.len() + patterns.count()) as u64,
        lights: count as u64,
        warnings,
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::tests::{OBJ, SCENE};

    #[test]
    fn check_never_mixes_file_versions() {
        for (renamed, is_moved) in [
            (SCENE.replace("radius = 0.5", "radius = 0.6"), false),
            (SCENE.replace("skin.ppm", "new.ppm"), true),
        ] {
            let folder = tempfile::tempdir().expect("a scratch folder");
            let at = |name: &str| folder.path().join(name);
            let scene = at("scene.toml");
            fs::write(&scene, SCENE).expect("written");
            fs::write(at("one.obj"), OBJ).expect("written");
            fs::write(at("skin.ppm"), "P6\n1 1\n255\nabc").expect("written");
            // The scene is replaced while its mesh is being read. In the second case, the texture has been
            // renamed and the file with the old name is invalid.
            if is_moved {
                fs::rename(at("skin.ppm"), at("new.ppm")).expect("renamed");
                fs::write(at("skin.ppm"), "P6\n").expect("written");
            }
            let mut checker = IncrementalSceneChecker::default();
            let replacement = (scene.clone(), renamed.clone().into_bytes());
            checker.contents.replacements.lock().expect("not poisoned").insert(at("one.obj"), replacement);
            let read = checker.load_all(&scene, &[], &CancelToken::new());
            let (assets, _) = read.expect("a valid scene");
            assert_eq!(assets.parsed.loaded.source.text_without_set_args(), renamed);
        }
    }
}
