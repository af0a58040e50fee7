//! Lights that contribute nothing: occluded, behind the surface, facing away or black.

use super::lights::phong_f;
use super::{LitScene, PHONG, ReferenceLight, Technique, emitter_shapes, reference_lights};
use crate::integrators::direct::mis::CompetingTechnique;
use crate::math::lanes::PACKET_SIZE;

#[test]
fn occluded_samples_contribute_nothing() {
    // A black shell around the vertices, closer than any light.
    let shell = "\n[[sphere]]\ncenter = [0, 0, 0]\nradius = 0.1\nmaterial = 'black'\n";
    for mut light in reference_lights().into_iter().chain(emitter_shapes()) {
        let open = LitScene::new("integrator = 'path'", PHONG, &light, 4);
        light.text.push_str(shell);
        let closed = LitScene::new("integrator = 'path'", PHONG, &light, 4);
        for competing in [CompetingTechnique::Nothing, CompetingTechnique::Paths] {
            let sums = [&open, &closed].map(|scene| scene.sample_lights(&scene.vertices(), competing));
            assert_eq!(sums[1].light[0], [0.0; PACKET_SIZE], "{}", light.name);
            // The samples and their shadow rays are the same, whether or not anything occludes them.
            let [open, closed] = sums.map(|sums| (sums.total, sums.rays.shadow));
            assert_eq!(open, closed, "{}", light.name);
        }
        assert!(open.estimate(Technique::Lights).mean > 0.0, "{}", light.name);
        assert_eq!(closed.estimate(Technique::LightsAndPaths).mean, 0.0, "{}", light.name);
    }
}

#[test]
fn partly_occluded_light_matches_the_quadrature() {
    // A screen at height ½ that ends at x = 0.1 hides the part of the light, at height 1, where x < 0.2.
    let screen = "[[quad]]\ncorner = [-5, 0.5, -5]\nu = [5.1, 0, 0]\nv = [0, 0, 10]\nmaterial = 'black'\n";
    let light = ReferenceLight::rectangle_above(-0.5, 1.0);
    let exact = ReferenceLight::rectangle_above(0.2, 1.0).reflected(phong_f);
    let cut = ReferenceLight::from_text("cut", &format!("{}\n{screen}", light.text));
    for technique in [Technique::Lights, Technique::Bsdf, Technique::LightsAndPaths] {
        let scene = LitScene::new("integrator = 'path'", PHONG, &cut, 1024);
        scene.estimate(technique).assert_equals(&format!("{technique:?}"), exact, 2e-2);
    }
    assert!(light.reflected(phong_f) > 1.05 * exact);
}

#[test]
fn unlit_sides_are_never_sampled() {
    let sphere = |y: f64| format!("[[sphere]]\ncenter = [0, {y}, 0]\nradius = 0.5\nmaterial = 'lamp'\n");
    let behind = |count: u32| (0..count).map(|i| sphere(-2.0 - f64::from(i))).collect::<String>();
    let facing_up = "[[quad]]\ncorner = [-1, 1, -1]\nu = [0, 0, 2]\nv = [2, 0, 0]\nmaterial = 'lamp'\n";
    let spot = "[[light]]\ntype = 'spot'\nposition = [0, 2, 0]\nlook_at = [0, 3, 0]\nangle = 60\n";
    let black = "[[light]]\nposition = [0, 1, 0]\nintensity = 0\n\
                 [[sphere]]\ncenter = [0, 1, 0]\nradius = 0.2\nmaterial = 'black'\n";
    for (name, text) in [
        ("behind the surface", "[[light]]\nposition = [0.5, -1, 0]\n".to_owned() + &behind(2)),
        ("many behind the surface", behind(50)),
        ("facing away", facing_up.to_owned()),
        ("spotlight pointing away", spot.to_owned()),
        ("black", black.to_owned()),
    ] {
        for integrator in ["path", "whitted"] {
            let settings = format!("integrator = '{integrator}'");
            let scene = LitScene::new(&settings, PHONG, &ReferenceLight::from_text(name, &text), 1);
            for competing in [CompetingTechnique::Nothing, CompetingTechnique::Paths] {
                let sums = scene.sample_lights(&scene.vertices(), competing);
                assert_eq!((sums.light[0], sums.total), ([0.0; PACKET_SIZE], [0.0; PACKET_SIZE]), "{name}");
                assert_eq!(sums.rays.shadow, 0, "{name}");
            }
        }
    }
}
