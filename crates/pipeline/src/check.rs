//! Validates a scene and all files it references, without rendering.

use std::path::Path;
use std::sync::Arc;

use super::engine::{Engine, EngineConfig};
use super::memory::MemoryEstimate;
use super::plan::resolve_plan;
use super::protocol::Failure;
use super::settings::Overrides;
use super::sink::EventSink;
use super::stages::meshes::MeshesByFileIndex;
use super::stages::parse::ParsedScene;
use super::stages::textures::Textures;
use crate::assets::FileMaterial;
use crate::control::CancelToken;
use crate::math::{DVec3, Vec3};
use crate::scene::description::{LoweredShape, Object, Shape};
use crate::scene::diagnostic::{Diagnostic, Severity};

/// Object counts and warnings for a valid scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneSummary {
    /// Shapes of all kinds. A mesh instance counts as one.
    pub objects: u64,
    /// Triangles in all mesh instances, plus standalone triangles.
    pub triangles: u64,
    /// Image files, counted once per encoding.
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
    IncrementalSceneChecker::default().check(path, sets, &CancelToken::new())
}

/// Checks scenes repeatedly, rereading only files that have changed.
pub struct IncrementalSceneChecker(Engine);

impl Default for IncrementalSceneChecker {
    fn default() -> Self {
        Self(Engine::new(EngineConfig::default(), Arc::default()))
    }
}

/// Returns a conservative estimate of a render's memory use in bytes. Reads all of the scene's files.
///
/// # Errors
/// Returns all errors in the scene and its files.
pub fn estimate_memory(path: &Path, overrides: &Overrides) -> Result<u64, Failure> {
    let IncrementalSceneChecker(mut engine) = IncrementalSceneChecker::default();
    let token = CancelToken::new();
    let (parsed, meshes, textures, _) =
        engine.load_scene_and_all_assets(path, &overrides.sets, &EventSink::silent(0), &token)?;
    let plan =
        resolve_plan(&parsed.loaded.scene, path, overrides).map_err(|error| Failure::Scene(vec![*error]))?;
    Ok(MemoryEstimate::for_image_and_scene(&plan, &plan.scene, &meshes, textures.memory_bytes).bytes())
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
        let (parsed, meshes, textures, warnings) =
            self.0.load_scene_and_all_assets(path, sets, &EventSink::silent(0), token)?;
        Ok(summarize(&parsed, &meshes, &textures, warnings))
    }
}

fn summarize(
    parsed: &ParsedScene,
    meshes: &MeshesByFileIndex,
    textures: &Textures,
    mut warnings: Vec<Diagnostic>,
) -> SceneSummary {
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
        warnings.push(parsed.loaded.diagnostic_at(0..0, severity, message, Some(help)));
    }
    SceneSummary {
        objects: scene.objects.len() as u64,
        triangles: scene.objects.iter().map(|object| triangles(&object.shape)).sum(),
        textures: textures.images.len() as u64,
        lights: count as u64,
        warnings,
    }
}
