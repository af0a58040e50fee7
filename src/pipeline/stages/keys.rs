//! What the later stages read of a scene. Places in the file and names are not among it, so that comments, order of
//! keys and unused tables change nothing.

use super::super::fingerprint::{Fingerprint, Key};
use crate::film::Rect;
use crate::integrators::RenderSettings;
use crate::math::{DVec3, Vec3};
use crate::scene::description::{Accel, Camera, ColorSource, MaterialKind, Render, Scene, Shape};

/// What a mesh's tree is built of.
pub(in crate::pipeline) fn tree(mesh: &Key, accel: Accel) -> Key {
    Fingerprint::new("tree").key(mesh).index(accel as usize).finish()
}

/// What trees are built over, and which.
pub(in crate::pipeline) fn geometry(scene: &Scene, meshes: &[Key]) -> Key {
    in_trees(&shapes(scene, meshes), scene.render.accel)
}

/// What is made of these things with trees of a kind.
pub(in crate::pipeline) fn in_trees(of: &Key, accel: Accel) -> Key {
    Fingerprint::new("in trees").key(of).index(accel as usize).finish()
}

fn shapes(scene: &Scene, meshes: &[Key]) -> Key {
    let mut key = Fingerprint::new("shapes");
    for object in &scene.objects {
        shape(&mut key, &object.shape, meshes);
    }
    key.finish()
}

/// What gives light, and where it is.
pub(in crate::pipeline) fn lights(scene: &Scene, meshes: &[Key]) -> Key {
    let mut key = Fingerprint::new("lights");
    for light in &scene.lights {
        key.dvec3(light.position).vec3(light.intensity).index(light.falloff as usize);
    }
    for object in &scene.objects {
        let emission = object.material.map(|index| scene.materials[index].kind.emission());
        // None: the file's own materials may emit.
        if emission != Some(Vec3::ZERO) {
            shape(&mut key, &object.shape, meshes);
            key.vec3(emission.unwrap_or(Vec3::ZERO));
        }
    }
    key.finish()
}

/// Everything that a world is made of but the kind of its trees: all kinds give the same picture bit for bit.
pub(in crate::pipeline) fn world(
    scene: &Scene,
    meshes: &[Key],
    textures: &[Key],
    orbiter: Option<&str>,
) -> Key {
    let mut key = Fingerprint::new("world");
    key.key(&shapes(scene, meshes)).key(&lights(scene, meshes));
    for object in &scene.objects {
        match object.material {
            Some(index) => material(&mut key, &scene.materials[index].kind, scene),
            None => {
                key.text("own");
            }
        }
    }
    for texture in textures {
        key.key(texture);
    }
    camera(&mut key, &scene.camera, orbiter);
    key.finish()
}

/// Everything that a film's sums depend on, apart from the number of samples.
pub(in crate::pipeline) fn render(world: Key, settings: &RenderSettings, crop: Option<Rect>) -> Key {
    // Every field by name: a new one must be thought of here.
    let RenderSettings { render, dof, view } = *settings;
    let Render {
        width,
        height,
        // The film knows how many it has.
        samples: _,
        shadow_samples,
        max_depth,
        integrator,
        shadows,
        ambient,
        background,
        filter,
        // For files and screens only.
        exposure: _,
        tonemap: _,
        // All trees give the same hits.
        accel: _,
        seed,
    } = render;
    let mut key = Fingerprint::new("render");
    key.key(&world).u64(width.into()).u64(height.into()).u64(max_depth.into());
    key.index(integrator as usize).vec3(ambient).vec3(background);
    key.index(shadows as usize).u64(shadow_samples.into()).index(filter as usize);
    key.index(dof.into()).u64(seed.into()).index(view as usize);
    if let Some(rect) = crop {
        key.u64(rect.x.into()).u64(rect.y.into()).u64(rect.width.into()).u64(rect.height.into());
    }
    key.finish()
}

fn shape(key: &mut Fingerprint, shape: &Shape, meshes: &[Key]) {
    let mut numbers = |number: usize, vectors: &[DVec3], scalar: f64| {
        key.index(number).f64(scalar);
        for vector in vectors {
            key.dvec3(*vector);
        }
    };
    match shape {
        Shape::Sphere { center, radius } => numbers(0, &[*center], *radius),
        Shape::Quad { corner, u, v } => numbers(1, &[*corner, *u, *v], 0.0),
        Shape::Plane { point, normal } => numbers(2, &[*point, *normal], 0.0),
        Shape::Box { center, size, rotate } => numbers(3, &[*center, *size, *rotate], 0.0),
        Shape::Triangle { a, b, c } => numbers(4, &[*a, *b, *c], 0.0),
        Shape::Disk { center, normal, radius } => numbers(6, &[*center, *normal], *radius),
        Shape::Cylinder { a, b, radius, caps } => numbers(7 + usize::from(*caps), &[*a, *b], *radius),
        Shape::Cone { base, tip, radius, cap } => numbers(9 + usize::from(*cap), &[*base, *tip], *radius),
        Shape::Torus { center, axis, radius, tube } => {
            numbers(11, &[*center, *axis, DVec3::splat(*tube)], *radius);
        }
        Shape::Mesh { file, scale, rotate, translate, smooth } => {
            numbers(5, &[*scale, *rotate, *translate], f64::from(u8::from(*smooth)));
            key.key(&meshes[*file]);
        }
    }
}

fn material(key: &mut Fingerprint, kind: &MaterialKind, scene: &Scene) {
    match kind {
        MaterialKind::Phong { diffuse, specular, shininess, ambient, emission, normal_map } => {
            key.index(0).f32(*shininess).vec3(*emission);
            color(key, diffuse, scene);
            color(key, specular, scene);
            key.index(ambient.is_some().into());
            if let Some(source) = ambient {
                color(key, source, scene);
            }
            key.index(normal_map.is_some().into());
            if let Some((index, strength)) = normal_map {
                key.f32(*strength);
                texture(key, *index, scene);
            }
        }
        MaterialKind::Mirror { reflectance } => {
            key.index(1).vec3(*reflectance);
        }
        MaterialKind::Glass { ior, tint } => {
            key.index(2).f32(*ior).vec3(*tint);
        }
    }
}

fn color(key: &mut Fingerprint, source: &ColorSource, scene: &Scene) {
    match source {
        ColorSource::Constant(value) => {
            key.index(0).vec3(*value);
        }
        ColorSource::Texture(index) => {
            key.index(1);
            texture(key, *index, scene);
        }
    }
}

/// How a texture is looked up; its texels have keys of their own.
fn texture(key: &mut Fingerprint, index: usize, scene: &Scene) {
    let texture = &scene.textures[index];
    key.path(&texture.file.value).index(texture.filter as usize).index(texture.wrap as usize);
    key.f32(texture.repeat.x).f32(texture.repeat.y).index(texture.encoding as usize);
}

fn camera(key: &mut Fingerprint, camera: &Camera, orbiter: Option<&str>) {
    match camera {
        Camera::LookAt { position, look_at, up, fov, aperture, focus } => {
            key.index(0).dvec3(*position).dvec3(*look_at).dvec3(*up).f64(*fov).f64(*aperture).f64(*focus);
        }
        Camera::Orbiter { file: _, fov, aperture, focus } => {
            // 0 is no valid angle and no valid distance.
            key.index(1).f64(*aperture).f64(fov.unwrap_or(0.0)).f64(focus.unwrap_or(0.0));
            key.text(orbiter.unwrap_or(""));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrators::View;
    use crate::pipeline::tests::loaded_of;
    use crate::scene::description::{Integrator, PixelFilter, Shadows, Tonemap};

    const BALL: &str = "[materials.m]\ntype = \"phong\"\ndiffuse = [1, 0, 0]\n[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"m\"\n";

    fn keys(text: &str) -> (Key, Key, Key) {
        let scene = loaded_of(text).scene;
        (geometry(&scene, &[]), lights(&scene, &[]), world(&scene, &[], &[], None))
    }

    #[test]
    fn comments_and_unused_tables_change_no_key() {
        assert_eq!(keys(BALL), keys(&format!("# hello\n[materials.a]\ntype = \"phong\"\n{BALL}")));
    }

    #[test]
    fn a_colour_changes_the_world_but_no_tree() {
        let (before, after) = (keys(BALL), keys(&BALL.replace("[1, 0, 0]", "[0, 1, 0]")));
        assert_eq!((before.0, before.1), (after.0, after.1));
        assert_ne!(before.2, after.2);
    }

    #[test]
    fn another_kind_of_tree_changes_the_trees_but_no_picture() {
        let (before, after) = (keys(BALL), keys(&format!("[render]\naccel = \"kdtree\"\n{BALL}")));
        assert_ne!(before.0, after.0);
        assert_eq!((before.1, before.2), (after.1, after.2));
    }

    #[test]
    fn an_emission_changes_the_lights_and_a_place_the_trees() {
        let lit = keys(&BALL.replace("diffuse", "emission"));
        assert_eq!(lit.0, keys(BALL).0);
        assert_ne!(lit.1, keys(BALL).1);
        assert_ne!(keys(&BALL.replace("center = [0", "center = [1")).0, keys(BALL).0);
    }

    #[test]
    fn every_setting_of_a_render_is_part_of_its_key() {
        let scene = loaded_of(BALL).scene;
        let plan = crate::pipeline::plan::plan(&scene, std::path::Path::new("a.toml"), &Default::default());
        let settings = plan.expect("a plan").settings;
        let of = |settings: &RenderSettings| render(Fingerprint::new("w").finish(), settings, None);
        let render_settings = settings.render;
        // Without `..`: a field that is added does not compile until it has a line below.
        let RenderSettings { render: _, dof, view } = settings;
        let Render {
            width,
            height,
            samples,
            shadow_samples,
            max_depth,
            integrator,
            shadows,
            ambient,
            background,
            filter,
            exposure,
            tonemap,
            accel,
            seed,
        } = render_settings;
        assert_eq!((integrator, shadows), (Integrator::Whitted, Shadows::Soft));
        assert_eq!(
            (filter, view, tonemap, accel),
            (PixelFilter::Box, View::Beauty, Tonemap::None, Accel::Bvh)
        );
        let with = |render: Render| RenderSettings { render, ..settings };
        let others = [
            with(Render { width: width + 1, ..render_settings }),
            with(Render { height: height + 1, ..render_settings }),
            with(Render { shadow_samples: shadow_samples + 1, ..render_settings }),
            with(Render { max_depth: max_depth + 1, ..render_settings }),
            with(Render { shadows: Shadows::Hard, ..render_settings }),
            with(Render { shadows: Shadows::Off, ..render_settings }),
            with(Render { ambient: ambient + Vec3::ONE, ..render_settings }),
            with(Render { background: background + Vec3::ONE, ..render_settings }),
            with(Render { filter: PixelFilter::Tent, ..render_settings }),
            with(Render { seed: seed + 1, ..render_settings }),
            RenderSettings { dof: !dof, ..settings },
            RenderSettings { view: View::Uv, ..settings },
        ];
        // The same samples: more of them, shown in another way, or found by another tree.
        for same in [
            Render { samples: samples + 1, ..render_settings },
            Render { exposure: exposure + 1.0, ..render_settings },
            Render { tonemap: Tonemap::Aces, ..render_settings },
            Render { accel: Accel::KdTree, ..render_settings },
        ] {
            assert_eq!(of(&with(same)), of(&settings), "{same:?}");
        }
        let mut keys: Vec<Key> = others.iter().chain([&settings]).map(of).collect();
        let crop = Rect { x: 0, y: 0, width: 1, height: 1 };
        keys.push(render(Fingerprint::new("w").finish(), &settings, Some(crop)));
        for (i, key) in keys.iter().enumerate() {
            assert!(!keys[..i].contains(key), "{i} is told apart");
        }
    }
}
