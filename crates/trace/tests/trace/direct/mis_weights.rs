//! MIS weights of light samples and BSDF samples for the same directions.

use super::{LitScene, MATERIALS, ReferenceLight, emitter_shapes, reference_lights};
use crate::geometry::Ray;
use crate::integrators::direct::mis::CompetingTechnique;
use crate::integrators::transport::cone::RayCone;
use crate::integrators::transport::interiors::InteriorList;
use crate::integrators::transport::ray::{PathHistory, PathRay};
use crate::lights::Light;
use crate::materials::bsdf::LobesToSample;
use crate::math::Vec3;
use crate::math::lanes::{PACKET_SIZE, PortableSimd, lane};
use crate::math::random::TestRandom;

#[test]
fn weights_of_both_techniques_sum_to_one() {
    let lights = || reference_lights().into_iter().filter(ReferenceLight::has_extent).chain(emitter_shapes());
    for light in lights() {
        for ((material, text), shadow_samples) in MATERIALS.into_iter().zip([1, 4].into_iter().cycle()) {
            let settings = format!("integrator = 'path'\nshadow_samples = {shadow_samples}");
            let scene = LitScene::new(&settings, text, &light, 1);
            let what = format!("{material}, {}, {shadow_samples} shadow samples", light.name);
            assert_complementary_weights(&what, &scene, shadow_samples);
        }
    }
}

/// Compares the weights of light samples with the weights of BSDF samples in the same directions.
fn assert_complementary_weights(what: &str, scene: &LitScene, shadow_samples: u32) {
    let mut random = TestRandom::new(1);
    let (tile, row) = (scene.tile(), scene.vertices());
    let (mut compared, mut apart) = (0, 0);
    for (number, light) in scene.world.lights.iter().take(8) {
        // In this case, only BSDF samples account for the environment.
        let is_skipped = tile.paths_find_sky && light.is_environment();
        let u: [[f32; PACKET_SIZE]; 2] = [(); 2].map(|()| [(); PACKET_SIZE].map(|()| random.unit_f32()));
        let samples = light.sample_unmodulated_packet(&row.from, &row.normal, row.used, &u);
        let response = row.evaluate_bsdf_and_cosines(&samples.directions, PortableSimd);
        let pdfs =
            row.bsdf.pdf(LobesToSample::All, &row.normal, &samples.directions, &response.bsdf, PortableSimd);
        // A light's expected sample count scales its pdf.
        let expected = scene
            .world
            .lights
            .expected_sample_counts(tile.behavior.receivers, Vec3::ZERO, super::NORMAL)
            .for_light(number);
        let inverse = light.inverse_pdfs_of_samples(&samples).map(|inverse| inverse / expected);
        let competing = CompetingTechnique::Paths;
        let weights = competing.apply_mis_weights(
            &row,
            (&samples, &response),
            [[1.0; PACKET_SIZE]; 3],
            (&inverse, competing.bsdf_rays_per_light_sample(shadow_samples)),
            PortableSimd,
        );
        for i in 0..PACKET_SIZE {
            let is_lit = samples.weights[0][i] > 0.0 && response.cosines[i] > 0.0 && pdfs[i] > 0.0;
            let Some(of_bsdf) = bsdf_weight(scene, lane(&samples.directions, i), pdfs[i], light) else {
                continue;
            };
            if is_lit {
                let of_light = if is_skipped { 0.0 } else { weights[0][i] };
                compared += 1;
                apart += u32::from((of_light + of_bsdf - 1.0).abs() > 2e-3);
            }
        }
    }
    // Rounding may move a direction past the edge of its light.
    assert!(compared >= 12 && apart <= compared / 50, "{what}: {apart} of {compared} differ");
}

/// Weight of a BSDF sample in this direction, or `None` if its ray misses the light.
fn bsdf_weight(scene: &LitScene, direction: Vec3, pdf: f32, light: &Light) -> Option<f32> {
    let path = |pdf: f32| PathRay {
        ray: Ray::new(Vec3::ZERO, direction),
        throughput: Vec3::ONE,
        slot: 0,
        path: 1,
        interiors: InteriorList::default(),
        state: PathHistory { pdf, normal: super::NORMAL, ..PathHistory::CAMERA },
        cone: RayCone::default(),
    };
    let hit = scene.world.geometry.closest_hit(&path(pdf).ray);
    match (light.as_area(), hit) {
        (Some(area), Some(hit)) if area.object == hit.object => {}
        (None, None) => {}
        (Some(_) | None, Some(_) | None) => return None,
    }
    let radiance = |pdf: f32| scene.weighted_radiance(&path(pdf)).x;
    let unweighted = radiance(0.0);
    (unweighted > 0.0).then(|| radiance(pdf) / unweighted)
}
