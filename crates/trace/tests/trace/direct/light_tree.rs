//! Tests of picking lights from a tree.

use super::{Estimate, LitScene, ReferenceLight};
use crate::integrators::PathAov;
use crate::integrators::direct::all_lights::SampleAllLights;
use crate::integrators::direct::light_tree::LightPicks;
use crate::integrators::direct::mis::CompetingTechnique;
use crate::integrators::transport::batch::VertexBatch;
use crate::lights::LightCenter;
use crate::math::Vec3;
use crate::math::lanes::{PACKET_SIZE, PortableSimd, lane};

const GLOSSY: &str = "diffuse = 0.2\nspecular = 0.6\nshininess = 80";

/// Lights of different sizes and powers on a spiral around the vertices, half of them below the surface.
fn spiral(count: u32) -> ReferenceLight {
    let light = |i: u32| {
        let height = 1.9 * (f64::from(i) + 0.5) / f64::from(count) - 0.95;
        let (across, (sin, cos)) = ((1.0 - height * height).sqrt(), (2.4 * f64::from(i)).sin_cos());
        let [x, y, z] = [across * cos, height, across * sin].map(|x| x * f64::from(2 + i % 3));
        let size = f64::from(1 + i % 4);
        match i % 2 {
            0 => {
                format!("[[sphere]]\ncenter = [{x}, {y}, {z}]\nradius = {}\nmaterial = 'lamp'\n", 0.05 * size)
            }
            _ => format!("[[light]]\nposition = [{x}, {y}, {z}]\nintensity = {size}\n"),
        }
    };
    ReferenceLight::from_text("spiral", &(0..count).map(light).collect::<String>())
}

/// Lighting at `row`, for picking lights with light sampling and MIS.
fn picks_of(scene: &LitScene, row: &VertexBatch, samples: u32) -> (Vec<LightPicks>, u32) {
    let tile = scene.tile();
    let lighting = SampleAllLights::<true> {
        tile: &tile,
        row,
        used: row.used,
        aov: PathAov::ALL,
        competing: CompetingTechnique::Paths,
        interior_lists: None,
        only_infinite: false,
        splits_lobes: false,
    };
    let sampler = scene.world.lights.sampler_for_purpose(tile.behavior.receivers).expect("a tree");
    let picks = lighting.pick_lights(sampler, &row.sampler_packet(&tile), 0..samples, PortableSimd);
    (picks, sampler.picks.count)
}

/// Every kind of tree: a single node, a tree that is cut at all its leaves, and a larger tree.
fn trees() -> Vec<(&'static str, u32)> {
    vec![("path", 12), ("path", 60), ("path", 400), ("whitted", 40), ("whitted", 400)]
}

#[test]
fn pick_weights_match_the_pdfs_of_paths() {
    for (integrator, count) in trees() {
        for material in ["diffuse = 0.7", GLOSSY] {
            for samples in [1, 3] {
                let settings = format!("integrator = '{integrator}'\nshadow_samples = {samples}");
                let scene = LitScene::new(&settings, material, &spiral(count), 64);
                let (tile, row) = (scene.tile(), scene.vertices());
                let expected = scene.world.lights.expected_sample_counts(
                    tile.behavior.receivers,
                    Vec3::ZERO,
                    lane(&row.normal, 0),
                );
                let (picks, _) = picks_of(&scene, &row, samples);
                let mut compared = 0;
                for pick in &picks {
                    for i in (0..PACKET_SIZE).filter(|i| pick.shares[*i] > 0.0) {
                        let own = 1.0 / pick.weighed[i];
                        let of_paths = expected.for_light(pick.lights[i]) * samples as f32;
                        let what = format!("{integrator}, {count} lights, {material}: {own}, {of_paths}");
                        assert!((own / of_paths - 1.0).abs() < 1e-4, "{what}");
                        compared += 1;
                    }
                }
                assert!(compared >= 8, "{compared}");
            }
        }
    }
}

#[test]
fn pick_probabilities_sum_to_one() {
    for (integrator, count) in trees() {
        let settings = format!("integrator = '{integrator}'");
        let scene = LitScene::new(&settings, GLOSSY, &spiral(count), 1);
        let receivers = scene.tile().behavior.receivers;
        let picks = scene.world.lights.sampler_for_purpose(receivers).expect("a tree").picks.count;
        let expected = scene.world.lights.expected_sample_counts(receivers, Vec3::ZERO, Vec3::Y);
        let sum: f32 = (0..count).map(|light| expected.for_light(light) / picks as f32).sum();
        // Nodes whose bounds are above the horizon may have no child above it.
        assert!(sum < 1.0 + 1e-4 && sum > 0.9, "{integrator}, {count} lights: {sum}");
    }
}

#[test]
fn each_light_is_picked_once_on_average() {
    // A pick's share is the reciprocal of the expected number of samples, so the shares of a light's picks
    // have mean 1.
    for (integrator, count, samples) in [("path", 12, 512), ("path", 60, 2048), ("whitted", 60, 128)] {
        for material in ["diffuse = 0.7", GLOSSY] {
            let settings = format!("integrator = '{integrator}'");
            let scene = LitScene::new(&settings, material, &spiral(count), samples);
            let mut row = scene.vertices();
            let mut sums = vec![[0.0; PACKET_SIZE]; count as usize];
            let mut probabilities = vec![0.0_f32; count as usize];
            for sample in 0..samples {
                scene.select_sample(&mut row, sample);
                let (picks, of) = picks_of(&scene, &row, 1);
                for (pick, i) in picks.iter().flat_map(|pick| (0..PACKET_SIZE).map(move |i| (pick, i))) {
                    if pick.shares[i] > 0.0 {
                        let light = pick.lights[i] as usize;
                        sums[light][i] += f64::from(pick.shares[i]) / f64::from(samples);
                        probabilities[light] = 1.0 / (pick.shares[i] * of as f32);
                    }
                }
            }
            let likely = |light: &usize| probabilities[*light] > 0.01;
            assert!((0..count as usize).filter(likely).map(|light| probabilities[light]).sum::<f32>() > 0.5);
            for light in (0..count as usize).filter(likely) {
                // Stratification leaves an error of about one sample.
                let expected = Estimate { mean: 1.0, error: 0.01 };
                let what = format!("{integrator}, {material}, light {light} of {count}");
                Estimate::over_lanes(&sums[light]).assert_same(&what, expected, 0.1);
            }
            for (number, light) in scene.world.lights.iter() {
                let Some((LightCenter::At(center), _)) = light.center_and_geometry() else { continue };
                let is_picked = probabilities[number as usize] > 0.0;
                assert!(center.y > -0.25 || !is_picked, "light {number} is below the surface");
            }
        }
    }
}
