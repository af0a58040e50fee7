//! Methods that a scene is rendered by.

use crate::choice::Choice;
use crate::pipeline::settings::Overrides;
use crate::scene::description::{Accel, Integrator, Scene, Shadows};

/// The values of each toggle that are to be measured, all with all; empty: the scene's own.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Toggles {
    /// Rendering algorithms.
    pub integrators: Vec<Integrator>,
    /// Photon maps, in whitted.
    pub photons: Vec<bool>,
    /// Shadows, in whitted.
    pub shadows: Vec<Shadows>,
    /// Most that one vertex of a path brings.
    pub clamps: Vec<f32>,
    /// Acceleration structures.
    pub accels: Vec<Accel>,
}

/// One way to render a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    /// Name in tables.
    pub name: String,
    /// Overrides that make the method.
    pub overrides: Overrides,
}

/// Settings that a picture depends on, by the scene or the toggles.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Way {
    integrator: Integrator,
    /// Photons and shadows; a path heeds neither.
    of_whitted: Option<(bool, Shadows)>,
    clamp: f32,
    accel: Accel,
}

/// The methods of a scene. Without toggles: paths, whitted with photons, and the scene as it is if that is another method.
pub fn methods(scene: &Scene, toggles: &Toggles) -> Vec<Method> {
    let ways = if *toggles == Toggles::default() { usual(scene) } else { asked(scene, toggles) };
    let mut distinct: Vec<Way> = Vec::new();
    for way in ways {
        if !distinct.contains(&way) {
            distinct.push(way);
        }
    }
    distinct.into_iter().map(|way| method(way, toggles)).collect()
}

fn usual(scene: &Scene) -> Vec<Way> {
    let own = (scene.render.integrator, scene.photons.enabled);
    let ways = [(Integrator::Path, false), (Integrator::Whitted, true), own];
    let of = |(integrator, photons)| {
        way(integrator, photons, scene.render.shadows, scene.render.clamp, scene.render.accel)
    };
    ways.into_iter().map(of).collect()
}

fn asked(scene: &Scene, toggles: &Toggles) -> Vec<Way> {
    let mut ways = Vec::new();
    for integrator in or_own(&toggles.integrators, scene.render.integrator) {
        for photons in or_own(&toggles.photons, scene.photons.enabled) {
            for shadows in or_own(&toggles.shadows, scene.render.shadows) {
                for clamp in or_own(&toggles.clamps, scene.render.clamp) {
                    for accel in or_own(&toggles.accels, scene.render.accel) {
                        ways.push(way(integrator, photons, shadows, clamp, accel));
                    }
                }
            }
        }
    }
    ways
}

fn or_own<T: Copy>(asked: &[T], own: T) -> Vec<T> {
    if asked.is_empty() { vec![own] } else { asked.to_vec() }
}

fn way(integrator: Integrator, photons: bool, shadows: Shadows, clamp: f32, accel: Accel) -> Way {
    let method = integrator.method();
    let of_whitted = (method.gathers && method.honors_shadows).then_some((photons, shadows));
    Way { integrator, of_whitted, clamp, accel }
}

/// A method; its name tells the toggles that have several values.
fn method(way: Way, toggles: &Toggles) -> Method {
    let mut words = vec![way.integrator.name().to_owned()];
    if let Some((photons, shadows)) = way.of_whitted {
        if photons {
            words.push("photons".to_owned());
        }
        if !toggles.shadows.is_empty() {
            words.push(format!("shadows {}", shadows.name()));
        }
    }
    if !toggles.clamps.is_empty() {
        words.push(format!("clamp {}", way.clamp));
    }
    if !toggles.accels.is_empty() {
        words.push(way.accel.name().to_owned());
    }
    let overrides = Overrides {
        integrator: Some(way.integrator),
        photons: Some(way.of_whitted.is_some_and(|(photons, _)| photons)),
        shadows: way.of_whitted.map(|(_, shadows)| shadows),
        clamp: Some(way.clamp),
        accel: Some(way.accel),
        ..Overrides::default()
    };
    Method { name: words.join(" "), overrides }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(text: &str) -> std::sync::Arc<Scene> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.toml");
        let text = format!("[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n{text}");
        std::fs::write(&path, text).expect("written");
        crate::scene::load(&path, &[]).expect("a scene").scene
    }

    fn names(text: &str, toggles: &Toggles) -> Vec<String> {
        methods(&scene(text), toggles).into_iter().map(|method| method.name).collect()
    }

    #[test]
    fn without_toggles_there_are_paths_photons_and_the_scene_as_it_is() {
        let none = Toggles::default();
        assert_eq!(names("", &none), ["path", "whitted photons", "whitted"]);
        assert_eq!(names("[photons]\nenabled = true\n", &none), ["path", "whitted photons"]);
        assert_eq!(names("[render]\nintegrator = \"path\"\n", &none), ["path", "whitted photons"]);
    }

    #[test]
    fn toggles_are_multiplied_and_what_is_the_same_is_rendered_once() {
        let toggles = Toggles {
            integrators: vec![Integrator::Path, Integrator::Whitted],
            photons: vec![true, false],
            shadows: vec![Shadows::Soft, Shadows::Hard],
            ..Toggles::default()
        };
        let names = names("", &toggles);
        assert_eq!(
            names,
            [
                "path",
                "whitted photons shadows soft",
                "whitted photons shadows hard",
                "whitted shadows soft",
                "whitted shadows hard"
            ]
        );
        let accels =
            Toggles { accels: vec![Accel::Bvh, Accel::KdTree], clamps: vec![2.5], ..Toggles::default() };
        assert_eq!(self::names("", &accels), ["whitted clamp 2.5 bvh", "whitted clamp 2.5 kdtree"]);
    }

    #[test]
    fn a_method_says_all_that_makes_it() {
        let toggles = Toggles { integrators: vec![Integrator::Whitted], ..Toggles::default() };
        let method = methods(&scene("[render]\nclamp = 3\n[photons]\nenabled = true\n"), &toggles).remove(0);
        let overrides = &method.overrides;
        assert_eq!(
            (overrides.photons, overrides.shadows, overrides.clamp),
            (Some(true), Some(Shadows::Soft), Some(3.0))
        );
    }
}
