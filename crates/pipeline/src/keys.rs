//! Keys for the scene data used by later stages. They exclude names and positions in the file, so that
//! changes to comments, key order and unused tables do not affect them.

use crate::film::Rect;
use crate::integrators::{PhotonSettings, RenderSettings};
use crate::math::DVec3;
use crate::plan::RenderPlan;
use crate::scene::description::{Accel, Camera, Material, Object, RenderOptions, Scene, Shape};
use crate::scene::fingerprint::{Fingerprint, FingerprintContext, FingerprintHasher};

/// Returns the context for fingerprinting scene descriptions: the textures, meshes and orbiter that they
/// refer to.
pub(crate) fn scene_fingerprint_references<'a>(
    scene: &'a Scene,
    meshes: &'a [Fingerprint],
    orbiter: Option<&'a str>,
) -> FingerprintContext<'a> {
    FingerprintContext { textures: &scene.textures, meshes, orbiter }
}

/// Returns the key for a mesh whose coincident emitters have been separated. `is_emissive` states whether an
/// object's material makes the entire mesh emissive.
pub(crate) fn separated_emitters_mesh_key(mesh: &Fingerprint, is_emissive: bool) -> Fingerprint {
    FingerprintHasher::new("distinct lights").add_fingerprint(mesh).add_bool(is_emissive).finish()
}

/// Returns the key for a mesh's tree. `distinct` is the key of the mesh with separated emitters if that mesh
/// differs from the mesh in the file.
pub(crate) fn mesh_accel_key(mesh: &Fingerprint, accel: Accel, distinct: Option<Fingerprint>) -> Fingerprint {
    FingerprintHasher::new("tree").add_fingerprint(&distinct.unwrap_or(*mesh)).add_choice_name(accel).finish()
}

/// Returns the key for all trees and the offset of each object. `lifts` is empty if no object is offset.
/// `distinct` contains the keys of the meshes with separated emitters (see [`mesh_accel_key`]).
pub(crate) fn geometry_key(
    scene: &Scene,
    of: &FingerprintContext<'_>,
    origin: DVec3,
    lifts: &[DVec3],
    distinct: impl Iterator<Item = Option<Fingerprint>>,
) -> Fingerprint {
    let mut key = FingerprintHasher::new("lifted");
    key.add_fingerprint(&key_with_coordinate_origin(&all_object_shapes_key(scene, of), origin));
    for lift in lifts {
        key.add_dvec3(*lift);
    }
    for distinct in distinct {
        key.add_bool(distinct.is_some());
        if let Some(distinct) = distinct {
            key.add_fingerprint(&distinct);
        }
    }
    key_with_tree_kind(&key.finish(), scene.render.accel)
}

/// Returns the key for the shapes and their emitting sides, which determine the lights to be moved off
/// coplanar surfaces.
pub(crate) fn coplanar_lights_key(scene: &Scene, of: &FingerprintContext<'_>) -> Fingerprint {
    let mut key = FingerprintHasher::new("coplanar");
    key.add_fingerprint(&all_object_shapes_key(scene, of));
    let is_round = |object: &&Object| matches!(object.shape, Shape::Sphere { .. } | Shape::Torus { .. });
    for object in scene.objects.iter().filter(|object| !is_round(object)) {
        let material = object.material.map(|index| &scene.materials[index]);
        let emission = material.filter(|material| material.emits()).map(Material::emission_sides);
        let is_glass = material.is_some_and(|material| material.kind.is_solid_glass());
        key.add_bool(object.material.is_some()).add_bool(is_glass).add_bool(emission.is_some());
        if let Some(sides) = emission {
            key.add_choice_name(sides);
        }
    }
    key.finish()
}

/// Combines a key with a coordinate origin.
pub(crate) fn key_with_coordinate_origin(of: &Fingerprint, origin: DVec3) -> Fingerprint {
    FingerprintHasher::new("from").add_fingerprint(of).add_dvec3(origin).finish()
}

/// Combines a geometry key with the tree type.
pub(crate) fn key_with_tree_kind(of: &Fingerprint, accel: Accel) -> Fingerprint {
    FingerprintHasher::new("in trees").add_fingerprint(of).add_choice_name(accel).finish()
}

fn all_object_shapes_key(scene: &Scene, of: &FingerprintContext<'_>) -> Fingerprint {
    let mut key = FingerprintHasher::new("shapes");
    for object in &scene.objects {
        key.add_with_references(&object.shape, of);
    }
    key.finish()
}

/// Returns the key for the shapes and their glass materials.
pub(crate) fn glass_key(scene: &Scene, of: &FingerprintContext<'_>) -> Fingerprint {
    let mut key = FingerprintHasher::new("glass");
    key.add_fingerprint(&all_object_shapes_key(scene, of));
    for object in &scene.objects {
        let substance = object.material.and_then(|index| scene.materials[index].kind.glass_medium_identity());
        key.add_bool(object.material.is_some()).add_bool(substance.is_some());
        for part in substance.into_iter().flatten() {
            key.add_u64(part);
        }
    }
    key.finish()
}

/// Returns the key for all lights: emission, position and object. `sky` is the environment map's key.
/// `patterns` are the keys of emission textures.
pub(crate) fn lights_key(
    scene: &Scene,
    of: &FingerprintContext<'_>,
    origin: DVec3,
    lifts: &[DVec3],
    sky: Option<&Fingerprint>,
    patterns: &[&Fingerprint],
) -> Fingerprint {
    let mut key = FingerprintHasher::new("lights");
    key.add_fingerprint(&key_with_coordinate_origin(&light_descriptions_key(scene, of), origin))
        .add_bool(sky.is_some());
    for lift in lifts {
        key.add_dvec3(*lift);
    }
    if let Some(sky) = sky {
        key.add_fingerprint(sky);
    }
    for pattern in patterns {
        key.add_fingerprint(pattern);
    }
    key.finish()
}

fn light_descriptions_key(scene: &Scene, of: &FingerprintContext<'_>) -> Fingerprint {
    let mut key = FingerprintHasher::new("described lights");
    key.add_with_references(&scene.environment, of);
    for light in &scene.lights {
        key.add_with_references(light, of);
    }
    for (number, object) in scene.objects.iter().enumerate() {
        match object.material.map(|index| &scene.materials[index]) {
            Some(material) if !material.emits() => {}
            Some(material) => {
                key.add_usize(number)
                    .add_with_references(&object.shape, of)
                    .add_with_references(&material.emission, of)
                    .add_with_references(&material.opacity, of);
                key.add_with_references(&material.emitter_coat().cloned(), of)
                    .add_with_references(&object.placement.as_deref().copied(), of);
                // Blends emit through their parts, so add the whole material.
                if !material.kind.blended_materials().is_empty() {
                    key.add_with_references(material, of);
                }
            }
            // Materials from the mesh file may emit.
            None => {
                key.add_usize(number).add_with_references(&object.shape, of).add_str("own");
            }
        }
    }
    key.finish()
}

/// Returns the key for a world. It excludes the tree type, because all types produce the same hits. Views
/// that visualize trees include the type in their own keys.
pub(crate) fn world_key(surfaces: &Fingerprint, camera: &Camera, of: &FingerprintContext<'_>) -> Fingerprint {
    FingerprintHasher::new("world").add_fingerprint(surfaces).add_with_references(camera, of).finish()
}

/// Returns the key for photons: surfaces relative to `origin`, emission and maximum depth.
pub(crate) fn photons_key(
    surfaces: &Fingerprint,
    origin: DVec3,
    render: &RenderOptions,
    photons: PhotonSettings,
) -> Fingerprint {
    let PhotonSettings { count, radius, bounces } = photons;
    let mut key = FingerprintHasher::new("photons");
    key.add_fingerprint(&key_with_coordinate_origin(surfaces, origin))
        .add_u64(count.into())
        .add_f32(radius)
        .add_u64(bounces.into());
    key.add_u64(render.max_depth.into()).add_u64(render.seed.into()).finish()
}

/// Returns the key for all surfaces, lights and textures.
pub(crate) fn surfaces_and_lights_key(
    scene: &Scene,
    of: &FingerprintContext<'_>,
    textures: &[Fingerprint],
) -> Fingerprint {
    // A new field of the scene must be added to one of the keys. This key includes the keys of the lights and
    // of the objects' shapes. The settings, the camera and the photons have separate keys. Textures and
    // their files are in `textures`. Instances only locate objects in the scene file.
    let Scene {
        objects,
        materials,
        lights: _,
        environment: _,
        textures: _,
        mesh_files: _,
        instances: _,
        render: _,
        camera: _,
        photons: _,
        output: _,
    } = scene;
    let mut key = FingerprintHasher::new("surfaces");
    key.add_fingerprint(&all_object_shapes_key(scene, of))
        .add_fingerprint(&light_descriptions_key(scene, of));
    for object in objects {
        match object.material {
            Some(index) => key.add_usize(1).add_with_references(&materials[index], of),
            None => key.add_usize(0),
        };
        key.add_bool(object.shape.as_mesh().is_some_and(|mesh| mesh.vertex_colors));
        key.add_with_references(&object.placement.as_deref().copied(), of);
    }
    for texture in textures {
        key.add_fingerprint(texture);
    }
    key.finish()
}

/// Returns the key for everything that affects a film's sums, except the sample count.
pub(crate) fn film_sums_key(
    world: Fingerprint,
    settings: &RenderSettings,
    crop: Option<Rect>,
) -> Fingerprint {
    let mut key = FingerprintHasher::new("render");
    key.add_fingerprint(&world).add_with_references(settings, &FingerprintContext::default());
    if let Some(rect) = crop {
        key.add_u64(rect.x.into())
            .add_u64(rect.y.into())
            .add_u64(rect.width.into())
            .add_u64(rect.height.into());
    }
    key.finish()
}

/// Returns the key for the image developed from a film. With a time limit, noise varies between films, so the
/// key includes `film_number`.
pub(crate) fn developed_image_key(film: Fingerprint, plan: &RenderPlan, film_number: u64) -> Fingerprint {
    let RenderOptions { samples, error, .. } = plan.settings.render;
    let tone = plan.tone_mapping();
    let mut key = FingerprintHasher::new("image");
    key.add_fingerprint(&film).add_u64(samples.into()).add_f32(error);
    key.add_choice_name(plan.settings.view).add_f32(tone.exposure_stops).add_choice_name(tone.curve);
    if let Some(seconds) = plan.limits.seconds {
        key.add_f64(seconds).add_u64(film_number);
    }
    key.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrators::{LayerSet, SampleLayer, ViewMode};
    use crate::math::Vec3;
    use crate::scene::description::{Integrator, PixelFilter, ShadowMode, Tonemap};
    use crate::tests::loaded_of;

    const BALL: &str = "[materials.m]\ntype = \"phong\"\ndiffuse = [1, 0, 0]\n[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"m\"\n";

    fn keys(text: &str) -> (Fingerprint, Fingerprint, Fingerprint) {
        let scene = loaded_of(text).scene;
        let of = scene_fingerprint_references(&scene, &[], None);
        (
            geometry_key(&scene, &of, DVec3::ZERO, &[], std::iter::empty()),
            lights_key(&scene, &of, DVec3::ZERO, &[], None, &[]),
            world_key(&surfaces_and_lights_key(&scene, &of, &[]), &scene.camera, &of),
        )
    }

    #[test]
    fn comments_and_unused_tables_do_not_change_keys() {
        assert_eq!(keys(BALL), keys(&format!("# hello\n[materials.a]\ntype = \"phong\"\n{BALL}")));
    }

    #[test]
    fn color_change_affects_world_but_not_trees() {
        let (before, after) = (keys(BALL), keys(&BALL.replace("[1, 0, 0]", "[0, 1, 0]")));
        assert_eq!((before.0, before.1), (after.0, after.1));
        assert_ne!(before.2, after.2);
    }

    #[test]
    fn tree_kind_affects_trees_but_not_images() {
        let (before, after) = (keys(BALL), keys(&format!("[render]\naccel = \"kdtree\"\n{BALL}")));
        assert_ne!(before.0, after.0);
        assert_eq!((before.1, before.2), (after.1, after.2));
    }

    #[test]
    fn trees_depend_on_position_but_not_emission() {
        let lit = keys(&BALL.replace("diffuse", "emission"));
        assert_eq!(lit.0, keys(BALL).0);
        assert_ne!(lit.1, keys(BALL).1);
        assert_ne!(keys(&BALL.replace("center = [0", "center = [1")).0, keys(BALL).0);
        let lifted = |lift: DVec3| {
            let scene = loaded_of(BALL).scene;
            geometry_key(
                &scene,
                &scene_fingerprint_references(&scene, &[], None),
                DVec3::ZERO,
                &[lift],
                std::iter::empty(),
            )
        };
        assert_ne!(lifted(DVec3::X), lifted(DVec3::Y));
    }

    #[test]
    fn emitter_object_index_affects_lights() {
        let ball = "[[sphere]]\ncenter = [3, 0, 0]\nradius = 1\nmaterial = \"dark\"\n";
        let (dark, light) = ("[materials.dark]\n".to_owned(), BALL.replace("diffuse", "emission"));
        let [behind, before] = [dark.clone() + &light + ball, dark + ball + &light].map(|text| keys(&text).1);
        assert_ne!(behind, before);
    }

    #[test]
    fn environment_affects_lights_but_not_trees() {
        let around = |color: &str| keys(&format!("[environment]\ncolor = {color}\n{BALL}"));
        let (none, gray, red) = (keys(BALL), around("0.5"), around("\"red\""));
        assert_eq!((none.0, none.0), (gray.0, red.0));
        assert!(none.1 != gray.1 && gray.1 != red.1 && none.2 != gray.2 && gray.2 != red.2);
    }

    #[test]
    fn camera_settings_do_not_change_lights() {
        let light = BALL.replace("diffuse", "emission");
        let of = |text: &str| keys(&format!("{text}{light}")).1;
        for other in
            ["[camera]\nfov = 20\n", "[render]\nbackground = [1, 0, 0]\nambient = [1, 1, 1]\nseed = 4\n"]
        {
            assert_eq!(of(""), of(other), "{other}");
        }
    }

    #[test]
    fn render_key_covers_every_setting() {
        let scene = loaded_of(BALL).scene;
        let plan = crate::plan::resolve_plan(&scene, std::path::Path::new("a.toml"), &Default::default());
        let settings = plan.expect("a plan").settings;
        let of =
            |settings: &RenderSettings| film_sums_key(FingerprintHasher::new("w").finish(), settings, None);
        let render_settings = settings.render;
        // No `..` here: adding a field must cause a compile error until it is tested below.
        let RenderSettings { render: _, dof, view, photons, layers } = settings;
        let RenderOptions {
            width,
            height,
            samples,
            error,
            shadow_samples,
            max_depth,
            integrator,
            shadows,
            clamp,
            ambient,
            background,
            filter,
            gain,
            exposure,
            tonemap,
            accel,
            seed,
        } = render_settings;
        assert_eq!((integrator, shadows, clamp), (Integrator::Whitted, ShadowMode::Soft, 0.0));
        let path = RenderOptions { integrator: Integrator::Path, ..render_settings };
        assert_eq!(
            (filter, view, tonemap, accel),
            (PixelFilter::Box, ViewMode::Beauty, Tonemap::None, Accel::Bvh)
        );
        let with = |render: RenderOptions| RenderSettings { render, ..settings };
        assert_eq!((photons, layers), (None, LayerSet::NONE));
        let with_layer = |layer| RenderSettings { layers: [layer].into_iter().collect(), ..settings };
        let some = PhotonSettings { count: 7, radius: 0.0, bounces: 2 };
        let with_photons = |photons| RenderSettings { photons: Some(photons), ..settings };
        let gathering = with_photons(some);
        let others = [
            with(RenderOptions { width: width + 1, ..render_settings }),
            with(RenderOptions { height: height + 1, ..render_settings }),
            with(RenderOptions { error: error + 0.5, ..render_settings }),
            with(RenderOptions { shadow_samples: shadow_samples + 1, ..render_settings }),
            with(RenderOptions { max_depth: max_depth + 1, ..render_settings }),
            with(RenderOptions { shadows: ShadowMode::Hard, ..render_settings }),
            with(RenderOptions { shadows: ShadowMode::Off, ..render_settings }),
            with(path),
            with(RenderOptions { clamp: 1.0, ..path }),
            with(RenderOptions { ambient: ambient + Vec3::ONE, ..render_settings }),
            with(RenderOptions { background: background + Vec3::ONE, ..render_settings }),
            with(RenderOptions { filter: PixelFilter::Tent, ..render_settings }),
            with(RenderOptions { gain: gain + 1.0, ..render_settings }),
            with(RenderOptions { seed: seed + 1, ..render_settings }),
            RenderSettings { dof: !dof, ..settings },
            RenderSettings { view: ViewMode::Uv, ..settings },
            with_layer(SampleLayer::Albedo),
            with_layer(SampleLayer::Depth),
            gathering,
            with_photons(PhotonSettings { count: 8, ..some }),
            with_photons(PhotonSettings { radius: 0.5, ..some }),
            with_photons(PhotonSettings { bounces: 3, ..some }),
        ];
        let lit = RenderOptions { ambient: ambient + Vec3::ONE, ..render_settings };
        assert_eq!(of(&RenderSettings { render: lit, ..gathering }), of(&gathering));
        assert_eq!(of(&RenderSettings { render: path, ..gathering }), of(&with(path)));
        // Sample count, display settings and tree type do not change the samples taken.
        for same in [
            RenderOptions { samples: samples + 1, ..render_settings },
            RenderOptions { exposure: exposure + 1.0, ..render_settings },
            RenderOptions { tonemap: Tonemap::Aces, ..render_settings },
            RenderOptions { accel: Accel::KdTree, ..render_settings },
        ] {
            assert_eq!(of(&with(same)), of(&settings), "{same:?}");
        }
        // Views that visualize trees depend on the tree type.
        for view in [ViewMode::Bounds, ViewMode::Cost] {
            let by = |accel| RenderSettings { view, ..with(RenderOptions { accel, ..render_settings }) };
            assert_ne!(of(&by(Accel::Bvh)), of(&by(Accel::KdTree)), "{view:?}");
        }
        // Settings ignored by the `path` or `whitted` integrator.
        for same in [
            RenderOptions { shadows: ShadowMode::Hard, ..path },
            RenderOptions { ambient: ambient + Vec3::ONE, ..path },
        ] {
            assert_eq!(of(&with(same)), of(&with(path)), "{same:?}");
        }
        assert_eq!(of(&with(RenderOptions { clamp: 1.0, ..render_settings })), of(&settings));
        let mut keys: Vec<Fingerprint> = others.iter().chain([&settings]).map(of).collect();
        let crop = Rect { x: 0, y: 0, width: 1, height: 1 };
        keys.push(film_sums_key(FingerprintHasher::new("w").finish(), &settings, Some(crop)));
        for (i, key) in keys.iter().enumerate() {
            assert!(!keys[..i].contains(key), "key {i} is not unique");
        }
    }

    #[test]
    fn trees_of_meshes_with_distinct_lights_differ() {
        let mesh = FingerprintHasher::new("mesh").finish();
        let distinct = [false, true].map(|is_emissive| Some(separated_emitters_mesh_key(&mesh, is_emissive)));
        let trees =
            [None, distinct[0], distinct[1]].map(|distinct| mesh_accel_key(&mesh, Accel::Bvh, distinct));
        assert!(trees[0] != trees[1] && trees[1] != trees[2] && trees[0] != trees[2]);
    }

    #[test]
    fn glass_affects_the_search_for_coplanar_lights() {
        let quad = "[[quad]]\ncorner = [0, 0, 0]\nu = [1, 0, 0]\nv = [0, 1, 0]\nmaterial = \"m\"\n";
        let key = |kind: &str| {
            let scene = loaded_of(&format!("{quad}[materials.m]\ntype = \"{kind}\"\n")).scene;
            coplanar_lights_key(&scene, &scene_fingerprint_references(&scene, &[], None))
        };
        assert_ne!(key("phong"), key("glass"));
    }
}
