//! The lights stage: collects the scene's lights again if any of them has changed.

use std::sync::Arc;

use super::super::cache::Memo;
use super::super::keys;
use super::super::protocol::reasons;
use super::StageResult;
use super::textures::LoadedTextures;
use crate::control::{CancelToken, Canceled};
use crate::lights::infinite::EnvironmentMap;
use crate::lights::infinite::sky::Sky;
use crate::lights::{LightSamplingPurpose, Lights};
use crate::scene::description::{MapRowPlacement, Material, Scene, TextureRole};
use crate::scene::fingerprint::{Fingerprint, FingerprintContext, FingerprintHasher};
use crate::world::{self, EnvironmentSource, Geometry, TextureImageKey};

/// Cache of the lights stage.
#[derive(Default)]
pub(crate) struct LightCache {
    lights: Memo<Arc<Lights>>,
    /// The environment map's importance distribution, which does not depend on the map's rotation.
    environment: Memo<Option<Arc<EnvironmentMap>>>,
    /// The evaluated sky. It does not depend on the rotation, which affects only the sky's frame.
    sky: Memo<Sky>,
}

/// Collects the lights, or reuses them if they are unchanged.
pub(crate) fn collect_lights(
    scene: &Scene,
    of: &FingerprintContext<'_>,
    geometry: &Geometry,
    textures: &LoadedTextures,
    cache: &mut LightCache,
    token: &CancelToken,
) -> Result<StageResult<Arc<Lights>>, Canceled> {
    let map = textures.environment.as_ref().map(|(key, _)| key);
    let declared = textures_affecting_emission(scene).filter_map(|source| textures.key_of.get(&source));
    let patterns: Vec<&Fingerprint> = declared.chain(&textures.of_files).collect();
    let key = keys::lights_key(
        scene,
        of,
        geometry.coordinate_origin(),
        geometry.light_lifts_by_object(),
        map,
        &patterns,
    );
    if let Some(lights) = cache.lights.get(key).filter(|lights| !lights.is_empty()) {
        return Ok(StageResult::reused(lights.clone(), reasons::UNCHANGED));
    }
    let environment = sky_or_environment_map(scene, of, textures, cache);
    let lights = world::build_lights(scene, geometry, &textures.images, environment, token)?;
    cache.lights.set(key, lights.clone());
    Ok(match lights.len() {
        0 => StageResult::skipped(lights, reasons::NO_LIGHTS),
        1 => StageResult::done(lights, "1 light"),
        count => {
            let are_picked = |receivers| lights.sampler_for_purpose(receivers).is_some();
            let picked =
                match (are_picked(LightSamplingPurpose::Eye), are_picked(LightSamplingPurpose::Paths)) {
                    (true, _) => describe_light_tree("a subset is sampled", &lights),
                    (false, true) => describe_light_tree("a subset is sampled after bounces", &lights),
                    (false, false) => String::new(),
                };
            StageResult::done(lights, format!("{count} lights{picked}"))
        }
    })
}

/// Describes the light tree for a scene that has too many lights to sample all of them.
fn describe_light_tree(which: &str, lights: &Lights) -> String {
    format!(", {which}; light tree {} kB", lights.light_trees_memory_bytes().div_ceil(1000))
}

/// Returns the textures used by the scene file's emissive materials.
fn textures_affecting_emission(scene: &Scene) -> impl Iterator<Item = TextureImageKey> {
    let shining = scene.materials.iter().filter(|material| material.emits());
    shining.flat_map(Material::self_and_blend_parts).flat_map(move |material| {
        let textures = material.own_textures_with_roles().into_iter().filter(|(_, role)| match role {
            TextureRole::Emission
            | TextureRole::EmissionCoat(_)
            | TextureRole::Opacity(_)
            | TextureRole::BlendWeight(_) => true,
            TextureRole::Diffuse
            | TextureRole::Specular
            | TextureRole::Ambient
            | TextureRole::Facets
            | TextureRole::Roughness(_)
            | TextureRole::NormalMap
            | TextureRole::Bump(_) => false,
        });
        textures.filter_map(|texture| {
            let image = scene.textures[texture.0].as_image()?;
            Some(world::scene_material_image_key(scene, material, texture, image))
        })
    })
}

/// Returns the environment's sky or map. Reuses it if it is unchanged.
fn sky_or_environment_map(
    scene: &Scene,
    of: &FingerprintContext<'_>,
    textures: &LoadedTextures,
    cache: &mut LightCache,
) -> Option<EnvironmentSource> {
    let rows = scene.environment.as_ref().map_or(MapRowPlacement::Centers, |environment| environment.rows);
    let map = environment_map(textures, rows, &mut cache.environment);
    let Some(sky) = scene.environment.as_ref().and_then(|environment| environment.sky.as_ref()) else {
        cache.sky = Memo::default();
        return map.map(EnvironmentSource::Map);
    };
    let key = FingerprintHasher::new("sky").add_with_references(sky, of).finish();
    if cache.sky.get(key).is_none() {
        cache.sky.set(key, world::build_sky(sky));
    }
    cache.sky.get(key).cloned().map(EnvironmentSource::Sky)
}

fn environment_map(
    textures: &LoadedTextures,
    rows: MapRowPlacement,
    memo: &mut Memo<Option<Arc<EnvironmentMap>>>,
) -> Option<Arc<EnvironmentMap>> {
    let Some((key, texels)) = &textures.environment else {
        *memo = Memo::default();
        return None;
    };
    let key = FingerprintHasher::new("environment map").add_fingerprint(key).add_choice_name(rows).finish();
    if let Some(environment) = memo.get(key) {
        return environment.clone();
    }
    let environment = world::build_environment_map(texels, rows);
    memo.set(key, environment.clone());
    environment
}
