//! Means of the light estimators.

use super::lights::phong_f;
use super::{LitScene, MATERIALS, PHONG, ReferenceLight, Technique, emitter_shapes, reference_lights};

#[test]
fn light_samples_match_the_quadrature() {
    for light in reference_lights() {
        let exact = light.reflected(phong_f);
        for shadow_samples in [1, 4] {
            let settings = format!("integrator = 'path'\nshadow_samples = {shadow_samples}");
            let scene = LitScene::new(&settings, PHONG, &light, 256 / shadow_samples);
            let what = format!("{}, {shadow_samples} shadow samples", light.name);
            scene.estimate(Technique::Lights).assert_equals(&what, exact, 6e-3);
        }
    }
}

#[test]
fn bsdf_samples_match_the_quadrature() {
    for light in reference_lights().into_iter().filter(ReferenceLight::has_extent) {
        let scene = LitScene::new("integrator = 'path'", PHONG, &light, 512);
        scene.estimate(Technique::Bsdf).assert_equals(light.name, light.reflected(phong_f), 1.2e-2);
    }
}

#[test]
fn mis_matches_the_quadrature() {
    for light in reference_lights() {
        let exact = light.reflected(phong_f);
        for shadow_samples in [1, 3] {
            let settings = format!("integrator = 'path'\nshadow_samples = {shadow_samples}");
            let scene = LitScene::new(&settings, PHONG, &light, 256);
            let what = format!("{}, {shadow_samples} shadow samples", light.name);
            scene.estimate(Technique::LightsAndPaths).assert_equals(&what, exact, 7e-3);
        }
    }
}

/// Lights of all kinds that BSDF samples can find, without kinds that are sampled like another one.
fn lights_with_extent() -> impl Iterator<Item = ReferenceLight> {
    let lights = reference_lights().into_iter().filter(ReferenceLight::has_extent).chain(emitter_shapes());
    lights.filter(|light| !["parallelogram", "triangle", "sphere", "disk"].contains(&light.name))
}

#[test]
fn all_techniques_have_equal_means() {
    for light in lights_with_extent() {
        for (material, text) in MATERIALS {
            let scene = LitScene::new("integrator = 'path'", text, &light, 256);
            let mis = scene.estimate(Technique::LightsAndPaths);
            let what = format!("{material}, {}", light.name);
            let lights = scene.estimate(Technique::Lights);
            lights.assert_same(&format!("{what}, light samples"), mis, 4e-2);
            // Most BSDF samples of glass are transmitted, so few of them find a light.
            if material != "rough glass" {
                let bsdf = scene.estimate(Technique::Bsdf);
                bsdf.assert_same(&format!("{what}, BSDF samples"), mis, 6e-2);
            }
        }
    }
}

#[test]
fn narrow_lobe_techniques_have_equal_means() {
    let sharp = "diffuse = 0.2\nspecular = 0.6\nshininess = 300";
    let skipped = ["box", "cylinder", "cone", "six spheres"];
    for light in lights_with_extent().filter(|light| !skipped.contains(&light.name)) {
        for (material, text, technique) in [
            ("sharp phong", sharp, Technique::LightsAndLobeRays),
            ("metal", "type = 'metal'\ncolor = 0.8\nroughness = 0.3", Technique::LightsAndNarrowPaths),
            ("plastic", "type = 'plastic'\ndiffuse = 0.5\nroughness = 0.3", Technique::LightsAndNarrowPaths),
        ] {
            let estimate = |settings: &str, technique| {
                LitScene::new(&format!("{settings}\nshadow_samples = 2"), text, &light, 128)
                    .estimate(technique)
            };
            let narrow = estimate("integrator = 'whitted'", technique);
            let paths = estimate("integrator = 'path'\nseed = 1", Technique::LightsAndPaths);
            narrow.assert_same(&format!("{material}, {}", light.name), paths, 3e-2);
        }
    }
}
