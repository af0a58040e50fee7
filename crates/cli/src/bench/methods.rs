//! Rendering methods to measure.

use crate::choice::Choice;
use crate::pipeline::settings::Overrides;
use crate::scene::description::{Accel, Integrator, Scene, ShadowMode};

/// Values to measure for each setting, in all combinations. An empty list keeps the scene's value.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SweptSettingValues {
    /// Integrators.
    pub integrators: Vec<Integrator>,
    /// Whether to use photon mapping in whitted.
    pub photons: Vec<bool>,
    /// Shadow types in whitted.
    pub shadows: Vec<ShadowMode>,
    /// Limits on the radiance per bounce.
    pub clamps: Vec<f32>,
    /// Acceleration structures.
    pub accels: Vec<Accel>,
}

/// A rendering method to benchmark.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    /// Name shown in tables.
    pub name: String,
    /// Overrides that select the method.
    pub overrides: Overrides,
}

/// Settings of a method, used to remove duplicates.
#[derive(Clone, Copy, Debug, PartialEq)]
struct MethodSettings {
    integrator: Integrator,
    /// Photons and shadows, or `None` for path tracing, which ignores these settings.
    of_whitted: Option<(bool, ShadowMode)>,
    clamp: f32,
    accel: Accel,
}

/// The methods to measure on a scene. By default, these are path, whitted with photons, and the scene's own
/// settings if they differ from both.
pub fn methods_to_measure(scene: &Scene, swept: &SweptSettingValues) -> Vec<Method> {
    let all = if *swept == SweptSettingValues::default() {
        default_benchmark_methods(scene)
    } else {
        sweep_combinations(scene, swept)
    };
    let mut distinct: Vec<MethodSettings> = Vec::new();
    for settings in all {
        if !distinct.contains(&settings) {
            distinct.push(settings);
        }
    }
    distinct.into_iter().map(|settings| create_method_from_settings(settings, swept)).collect()
}

fn default_benchmark_methods(scene: &Scene) -> Vec<MethodSettings> {
    let own = (scene.render.integrator, scene.photons.enabled);
    let ways = [(Integrator::Path, false), (Integrator::Whitted, true), own];
    let of = |(integrator, photons)| {
        normalize_method_settings(
            integrator,
            photons,
            scene.render.shadows,
            scene.render.clamp,
            scene.render.accel,
        )
    };
    ways.into_iter().map(of).collect()
}

fn sweep_combinations(scene: &Scene, swept: &SweptSettingValues) -> Vec<MethodSettings> {
    let mut ways = Vec::new();
    for integrator in requested_or_scene_values(&swept.integrators, scene.render.integrator) {
        for photons in requested_or_scene_values(&swept.photons, scene.photons.enabled) {
            for shadows in requested_or_scene_values(&swept.shadows, scene.render.shadows) {
                for clamp in requested_or_scene_values(&swept.clamps, scene.render.clamp) {
                    for accel in requested_or_scene_values(&swept.accels, scene.render.accel) {
                        ways.push(normalize_method_settings(integrator, photons, shadows, clamp, accel));
                    }
                }
            }
        }
    }
    ways
}

fn requested_or_scene_values<T: Copy>(requested: &[T], own: T) -> Vec<T> {
    if requested.is_empty() { vec![own] } else { requested.to_vec() }
}

fn normalize_method_settings(
    integrator: Integrator,
    photons: bool,
    shadows: ShadowMode,
    clamp: f32,
    accel: Accel,
) -> MethodSettings {
    let method = integrator.properties();
    let of_whitted = (method.gathers && method.honors_shadows).then_some((photons, shadows));
    MethodSettings { integrator, of_whitted, clamp, accel }
}

/// Creates a method, named after the requested settings.
fn create_method_from_settings(settings: MethodSettings, swept: &SweptSettingValues) -> Method {
    let mut words = vec![settings.integrator.name().to_owned()];
    if let Some((photons, shadows)) = settings.of_whitted {
        if photons {
            words.push("photons".to_owned());
        }
        if !swept.shadows.is_empty() {
            words.push(format!("shadows {}", shadows.name()));
        }
    }
    if !swept.clamps.is_empty() {
        words.push(format!("clamp {}", settings.clamp));
    }
    if !swept.accels.is_empty() {
        words.push(settings.accel.name().to_owned());
    }
    let overrides = Overrides {
        integrator: Some(settings.integrator),
        photons: Some(settings.of_whitted.is_some_and(|(photons, _)| photons)),
        shadows: settings.of_whitted.map(|(_, shadows)| shadows),
        clamp: Some(settings.clamp),
        accel: Some(settings.accel),
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

    fn names(text: &str, swept: &SweptSettingValues) -> Vec<String> {
        methods_to_measure(&scene(text), swept).into_iter().map(|method| method.name).collect()
    }

    #[test]
    fn default_methods_include_the_scene_settings() {
        let none = SweptSettingValues::default();
        assert_eq!(names("", &none), ["path", "whitted photons", "whitted"]);
        assert_eq!(names("[photons]\nenabled = true\n", &none), ["path", "whitted photons"]);
        assert_eq!(names("[render]\nintegrator = \"path\"\n", &none), ["path", "whitted photons"]);
    }

    #[test]
    fn all_distinct_combinations_are_measured() {
        let swept = SweptSettingValues {
            integrators: vec![Integrator::Path, Integrator::Whitted],
            photons: vec![true, false],
            shadows: vec![ShadowMode::Soft, ShadowMode::Hard],
            ..SweptSettingValues::default()
        };
        let names = names("", &swept);
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
        let accels = SweptSettingValues {
            accels: vec![Accel::Bvh, Accel::KdTree],
            clamps: vec![2.5],
            ..SweptSettingValues::default()
        };
        assert_eq!(self::names("", &accels), ["whitted clamp 2.5 bvh", "whitted clamp 2.5 kdtree"]);
    }

    #[test]
    fn methods_override_scene_settings() {
        let swept =
            SweptSettingValues { integrators: vec![Integrator::Whitted], ..SweptSettingValues::default() };
        let method =
            methods_to_measure(&scene("[render]\nclamp = 3\n[photons]\nenabled = true\n"), &swept).remove(0);
        let overrides = &method.overrides;
        assert_eq!(
            (overrides.photons, overrides.shadows, overrides.clamp),
            (Some(true), Some(ShadowMode::Soft), Some(3.0))
        );
    }
}
