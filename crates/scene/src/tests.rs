use super::description::*;
use super::document::{ENERGY_GAIN, MISSING_VALUE, MORE_LIKE_THESE, NO_AREA, UNLIT_SCENE};
use super::*;
use crate::math::color::srgb8_color_to_linear;
use crate::math::{DVec3, Vec2, Vec3};

pub const CAMERA: &str = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n";

fn outcome(text: &str) -> ParseOutcome {
    parse(text.into(), Path::new("scene.toml"))
}

/// Adds a camera to `text` and parses it. Panics on errors.
pub fn scene(text: &str) -> Scene {
    let outcome = outcome(&format!("{text}\n{CAMERA}"));
    let messages: Vec<&str> = outcome.diagnostics.iter().map(|one| one.message.as_str()).collect();
    outcome.scene.unwrap_or_else(|| panic!("{messages:?}"))
}

/// Adds a camera to `text`, parses it and returns the messages.
pub fn messages(text: &str) -> Vec<String> {
    outcome(&format!("{text}\n{CAMERA}")).diagnostics.into_iter().map(|one| one.message).collect()
}

#[test]
fn starter_has_no_diagnostics() {
    let outcome = outcome(starter_scene());
    assert_eq!(outcome.diagnostics, []);
    let scene = outcome.scene.expect("a scene");
    assert_eq!((scene.objects.len(), scene.lights.len(), scene.materials.len()), (5, 1, 5));
}

#[test]
fn empty_scene_has_the_documented_defaults() {
    let scene = scene("");
    let RenderOptions { width, height, samples, shadow_samples, max_depth, seed, .. } = scene.render;
    assert_eq!((width, height, samples, shadow_samples, max_depth, seed), (640, 480, 64, 1, 8, 0));
    assert_eq!(scene.render.shadows, ShadowMode::Soft);
    assert_eq!((scene.render.filter, scene.render.tonemap), (PixelFilter::Box, Tonemap::None));
    assert_eq!((scene.render.exposure, &scene.output), (0.0, &None));
    assert_eq!(scene.photons, PhotonOptions { enabled: false, count: 0, radius: 0.0, bounces: 16 });
    let camera = Camera::LookAt {
        position: DVec3::new(0.0, 1.0, 4.0),
        look_at: DVec3::Y,
        up: DVec3::Y,
        projection: Projection::Perspective { fov: 40.0 },
        window: ImageShiftAndMirror::default(),
        aperture: 0.0,
        focus: 4.0,
    };
    assert_eq!(scene.camera, camera);
}

#[test]
fn materials_have_the_documented_defaults() {
    let scene = scene("[materials.a]\n[materials.b]\ntype='mirror'\n[materials.c]\ntype='glass'");
    let phong = MaterialKind::Phong(PhongParameters {
        diffuse: ColorSource::Constant(Vec3::splat(0.7)),
        specular: ColorSource::Constant(Vec3::ZERO),
        shininess: 32.0,
        ambient: None,
        diffuse_transmission: ColorSource::BLACK,
    });
    assert!(scene.materials.iter().all(|material| !material.emits() && material.normal_map.is_none()));
    let kinds: Vec<_> = scene.materials.into_iter().map(|material| material.kind).collect();
    let mirror = MaterialKind::Mirror { reflectance: ColorSource::Constant(Vec3::splat(0.9)) };
    let roughness = NumberSource::Constant(0.0);
    let distribution = MicrofacetDistribution::Ggx;
    let glass = MaterialKind::Glass { ior: 1.5, tint: DVec3::ONE, roughness, distribution };
    assert_eq!(kinds, [phong, mirror, glass]);
}

#[test]
fn numbers_and_colors_accept_every_syntax() {
    let scene = scene(
        "render = { width = 1_280, height = 0x1e0, seed = 4_294_967_295, exposure = -0.0, error = 0.0, \
         ambient = '#ff8000', background = [1, 2.5, 1e1] }",
    );
    assert_eq!((scene.render.width, scene.render.height, scene.render.seed), (1280, 480, u32::MAX));
    assert_eq!(scene.render.ambient, srgb8_color_to_linear([255, 128, 0]));
    assert_eq!(scene.render.background, Vec3::new(1.0, 2.5, 10.0));
}

#[test]
fn materials_and_objects_keep_file_order() {
    let scene = scene(
        "[materials.z]\n[materials.a]\n[materials.m]\n\
         [[box]]\ncenter=[0,0,0]\nmaterial='m'\n\
         [[sphere]]\ncenter=[0,0,0]\nradius=2\nmaterial='z'\n\
         [[plane]]\nmaterial='a'\n\
         [[sphere]]\ncenter=[0,0,0]\nradius=1\nmaterial='a'\n",
    );
    assert_eq!(scene.materials.iter().map(|one| one.name.as_str()).collect::<Vec<_>>(), ["z", "a", "m"]);
    assert_eq!(
        scene.objects.iter().map(|one| one.material).collect::<Vec<_>>(),
        [Some(2), Some(0), Some(1), Some(1)]
    );
    let sphere = |radius| Shape::Sphere { center: DVec3::ZERO, radius };
    assert_eq!((&scene.objects[1].shape, &scene.objects[3].shape), (&sphere(2.0), &sphere(1.0)));
    assert_eq!(scene.objects[2].shape, Shape::Plane { point: DVec3::ZERO, normal: DVec3::Y });
    let unit = Shape::Box { center: DVec3::ZERO, size: DVec3::ONE, rotate: DVec3::ZERO };
    assert_eq!(scene.objects[0].shape, unit);
}

#[test]
fn round_shapes_have_documented_defaults() {
    let scene = scene(
        "[materials.m]\n\
         [[torus]]\nmaterial='m'\n[[torus]]\nradius=2\naxis=[1,0,0]\nmaterial='m'\n\
         [[cone]]\nmaterial='m'\n[[cone]]\nbase=[0,1,0]\ntip=[0,0,1]\ncap=false\nmaterial='m'\n\
         [[cylinder]]\nmaterial='m'\n[[cylinder]]\nb=[0,0,2]\nradius=3\ncaps=false\nmaterial='m'\n\
         [[disk]]\nmaterial='m'\n[[disk]]\ncenter=[1,2,3]\nnormal=[0,0,5]\nradius=4\nmaterial='m'\n",
    );
    let (zero, up) = (DVec3::ZERO, DVec3::Y);
    let shapes: Vec<_> = scene.objects.into_iter().map(|object| object.shape).collect();
    let expected = [
        Shape::Torus { center: zero, axis: up, radius: 0.5, tube: 0.125 },
        Shape::Torus { center: zero, axis: DVec3::X, radius: 2.0, tube: 0.5 },
        Shape::Cone { base: zero, tip: up, radius: 0.5, cap: true },
        Shape::Cone { base: up, tip: DVec3::Z, radius: 0.5, cap: false },
        Shape::Cylinder { a: zero, b: up, radius: 0.5, caps: true },
        Shape::Cylinder { a: zero, b: DVec3::Z * 2.0, radius: 3.0, caps: false },
        Shape::Disk { center: zero, normal: up, radius: 0.5 },
        Shape::Disk { center: DVec3::new(1.0, 2.0, 3.0), normal: DVec3::Z * 5.0, radius: 4.0 },
    ];
    assert_eq!(shapes, expected);
}

#[test]
fn mesh_files_are_listed_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.toml");
    std::fs::create_dir(folder.path().join("sub")).expect("a folder");
    std::fs::write(folder.path().join("a.obj"), "").expect("written");
    std::fs::write(folder.path().join("b.OFF"), "").expect("written");
    std::fs::write(folder.path().join("t.png"), "").expect("written");
    let text = format!(
        "[textures.t]\nfile='t.png'\nrepeat=[2,-1]\nwrap='mirror'\nfilter='nearest'\nencoding='linear'\n\
         [materials.m]\ndiffuse={{texture='t'}}\nnormal_map='t'\nnormal_strength=0.5\n\
         [[mesh]]\nfile='a.obj'\nmaterial='m'\nscale=2\n[[mesh]]\nfile='b.OFF'\nsmooth=false\n\
         [[mesh]]\nfile='sub/../a.obj'\nscale=[1,-2,3]\n{CAMERA}"
    );
    std::fs::write(&path, &text).expect("written");
    let loaded = load(&path, &[]).expect("a scene");
    assert_eq!(loaded.warnings, []);
    let scene = &loaded.scene;
    let files: Vec<_> = scene.mesh_files.iter().map(|file| file.value.clone()).collect();
    assert_eq!(files, [folder.path().join("a.obj"), folder.path().join("b.OFF")]);
    assert_eq!(&loaded.source.text_without_set_args()[scene.mesh_files[0].span.clone()], "'a.obj'");
    let meshes: Vec<_> = scene
        .objects
        .iter()
        .map(|object| match object.shape {
            Shape::Mesh(MeshReference {
                file, placed: ObjectTransform::Steps { scale, .. }, smooth, ..
            }) => (file, scale, smooth, object.material),
            _ => panic!("not a mesh"),
        })
        .collect();
    let flipped = DVec3::new(1.0, -2.0, 3.0);
    let expected =
        [(0, DVec3::splat(2.0), true, Some(0)), (1, DVec3::ONE, false, None), (0, flipped, true, None)];
    assert_eq!(meshes, expected);
    let texture = &scene.textures[0];
    let image = texture.as_image().expect("an image");
    assert_eq!(
        (image.repeat, image.wrap, texture.filter),
        (Vec2::new(2.0, -1.0), Wrap::Mirror, TextureFilter::Nearest)
    );
    let MaterialKind::Phong(PhongParameters { diffuse, .. }) = &scene.materials[0].kind else {
        panic!("not phong")
    };
    let map = NormalMap { texture: 0, strength: 0.5 };
    assert_eq!((diffuse, scene.materials[0].normal_map), (&ColorSource::Texture(0), Some(map)));

    let late = loaded.create_diagnostic_at(
        scene.mesh_files[1].span.clone(),
        Severity::Error,
        "no usable face",
        None,
    );
    let shown = report::render_diagnostics(&[late], 300, report::ReportStyle::Plain);
    assert!(shown.contains("scene.toml:16:6\n") && shown.contains("^^^^^^^"), "{shown}");
}

#[test]
fn orbiter_replaces_position_and_look_at() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/broken/scene.toml");
    let text = "[camera]\norbiter='files/view.txt'\naperture=0.5\nfov=30";
    let camera = parse(text.into(), &path).scene.expect("a scene").camera;
    let Camera::Orbiter { file, projection, window, aperture, focus } = camera else { panic!("no orbiter") };
    assert_eq!(file.value, path.with_file_name("files/view.txt"));
    let expected = (Some(Projection::Perspective { fov: 30.0 }), ImageShiftAndMirror::default(), 0.5, None);
    assert_eq!((projection, window, aperture, focus), expected);
}

#[test]
fn only_darkness_and_energy_gain_cause_warnings() {
    let sphere = "[[sphere]]\ncenter=[0,0,0]\nradius=1\nmaterial='m'\n";
    let dark = UNLIT_SCENE;
    assert_eq!(messages(&format!("[materials.m]\n{sphere}")), [dark]);
    for black in
        ["[[light]]\ntype='point'\nposition=[0,5,0]\nintensity=[0,0,0]", "[environment]\ncolor=[0,0,0]"]
    {
        assert_eq!(messages(&format!("[materials.m]\n{sphere}{black}\n")), [dark], "{black}");
    }
    let one_of_two = "[[light]]\nintensity=[0,0,0]\n[[light]]\n";
    assert_eq!(messages(&format!("[materials.m]\n{sphere}{one_of_two}")), [""; 0]);
    assert_eq!(messages(&format!("[materials.m]\nemission=[0,0,1]\n{sphere}")), [""; 0]);
    assert_eq!(messages(&format!("[render]\nambient=[0,0,1]\n[materials.m]\n{sphere}")), [""; 0]);
    let gain = ENERGY_GAIN;
    let lit = |material: &str| {
        messages(&format!("[render]\nambient='#111111'\n[materials.m]\n{material}\n{sphere}"))
    };
    assert_eq!(lit("diffuse=[0.7,0.7,0.7]\nspecular=[0.3,0.3,0.3]"), [""; 0]);
    assert_eq!(lit("diffuse=[0.7,0.7,0.7]\nspecular=[0.3,0.31,0.3]"), [gain]);
    assert_eq!(lit("diffuse=[1.2,0.7,0.7]"), [gain]);
    assert_eq!(lit("specular=[0.4,0,0]"), [gain]);
}

#[test]
fn finite_shapes_may_be_area_lights() {
    let shapes = "[[quad]]\ncorner=[0,0,0]\nu=[1,0,0]\nv=[0,1,0]\nmaterial='m'\n\
                  [[triangle]]\na=[0,0,0]\nb=[1,0,0]\nc=[0,1,0]\nmaterial='m'\n\
                  [[box]]\ncenter=[0,0,0]\nmaterial='m'\n";
    assert_eq!(messages(&format!("[materials.m]\nemission='#ffffff'\n{shapes}")), [""; 0]);
}

#[test]
fn degenerate_edge_errors_point_to_the_value() {
    let place = |text: &str| {
        let outcome = outcome(&format!("[materials.m]\n{text}\nmaterial='m'\n{CAMERA}"));
        let [error] = outcome.diagnostics.try_into().expect("one error");
        assert!(error.message.ends_with(NO_AREA), "{}", error.message);
        let place = error.place.expect("a place");
        place.source[place.span].to_owned()
    };
    assert_eq!(place("[[quad]]\nu = [0, 0, 5]"), "[0, 0, 5]");
    assert_eq!(place("[[quad]]\nv = [3, 0, 0]"), "[3, 0, 0]");
    assert_eq!(place("[[triangle]]\na = [0, 2, 0]\nb = [0, 3, 0]"), "[0, 3, 0]");
    assert_eq!(place("[[triangle]]\na = [2, -1, 0]"), "[2, -1, 0]");
}

#[test]
fn tiny_distant_triangles_have_area() {
    let fine = "[[light]]\n[materials.m]\n[[triangle]]\na = [1e6, 0, 0]\nb = [1000000.001, 0, 0]\n\
                c = [1e6, 0.001, 0]\nmaterial = 'm'\n";
    assert_eq!(messages(fine), [""; 0]);
}

#[test]
fn errors_are_limited_and_counted() {
    let text: String = (0..700).map(|number| format!("wrong{number} = 1\n")).collect();
    let messages = messages(&text);
    assert_eq!(messages.len(), 501);
    assert_eq!(messages[500], format!("and 200 {MORE_LIKE_THESE}"));
}

#[test]
fn warnings_never_hide_errors() {
    let table =
        |number: usize| format!("[materials.m{number}]\ndiffuse = 0.9\nspecular = 0.9\nshininess = 5\n");
    let flood = |count: usize| (0..count).map(table).collect::<String>();
    let errors = |outcome: &ParseOutcome| -> Vec<String> {
        let errors = outcome.diagnostics.iter().filter(|one| one.severity == diagnostic::Severity::Error);
        errors.map(|one| one.message.clone()).collect()
    };
    let one = outcome(&format!("{}{CAMERA}", flood(1)));
    let gains = one.diagnostics.iter().filter(|one| one.message == ENERGY_GAIN).count();
    assert_eq!(gains, 1, "{:?}", one.diagnostics);
    for count in [600, 11_000] {
        let many = outcome(&format!("{}{CAMERA}", flood(count)));
        assert_eq!(many.diagnostics.len(), 501);
        assert!(many.scene.is_some() && errors(&many).is_empty(), "{:?}", errors(&many));
        assert!(many.diagnostics[500].message.ends_with(MORE_LIKE_THESE));
        let wrong = outcome(&format!("{}bogus = 1\n{CAMERA}", flood(count)));
        assert!(wrong.scene.is_none());
        assert!(errors(&wrong).len() == 1 && errors(&wrong)[0].contains("bogus"), "{:?}", errors(&wrong));
    }
}

mod properties {
    use super::super::diagnostic::Diagnostic;
    use super::super::report::{ReportStyle, render_diagnostics, render_diagnostics_as_lines};
    use super::*;
    use proptest::prelude::*;

    /// Asserts that every span is within its text and that every report is safe to print.
    fn check(diagnostics: &[Diagnostic]) {
        for place in diagnostics.iter().filter_map(|one| one.place.as_ref()) {
            assert!(place.source.get(place.span.clone()).is_some(), "{:?}", place.span);
        }
        let text = render_diagnostics(diagnostics, 60, ReportStyle::Plain);
        assert!(text.chars().all(|c| c == '\n' || !c.is_control()), "{text:?}");
        let pieces = render_diagnostics_as_lines(diagnostics, 60);
        assert_eq!(pieces.len(), text.lines().count());
        assert!(pieces.iter().flatten().all(|piece| !piece.text.contains(char::is_control)));
    }

    /// Fragments of invalid TOML.
    fn fragment() -> impl Strategy<Value = String> {
        prop_oneof![
            "[\\[\\]{}=,.#\"'\\\\\n\t 0-9a-z_-]{0,6}",
            any::<String>(),
            prop::sample::select(vec![
                "[[sphere]]\n",
                "[camera]\n",
                "[materials.red]\n",
                "radius = ",
                "nan",
                "1e999",
                "\"\"\"",
                "'''",
                "{ texture = ",
                "\u{1b}]0;x\u{7}",
                "\u{202e}",
                "# 木\n",
                "\r\n",
                "99999999999999999999",
                "[[",
                "]]",
                "a.b.c = 1\n",
                "1979-05-27",
                "\u{feff}",
            ])
            .prop_map(str::to_owned),
        ]
    }

    proptest! {
        #[test]
        fn fuzzed_text_never_panics(parts in prop::collection::vec(fragment(), 0..40)) {
            check(&outcome(&parts.concat()).diagnostics);
        }

        #[test]
        fn fuzzed_scenes_never_panic(
            changes in prop::collection::vec((any::<prop::sample::Index>(), 0_usize..12, fragment()), 1..8),
        ) {
            let mut text: Vec<char> = starter_scene().chars().collect();
            for (at, removed, inserted) in changes {
                let at = at.index(text.len() + 1);
                let end = (at + removed).min(text.len());
                text.splice(at..end, inserted.chars());
            }
            let outcome = outcome(&text.into_iter().collect::<String>());
            let errors = outcome.diagnostics.iter().filter(|one| one.severity == Severity::Error).count();
            prop_assert_eq!(outcome.scene.is_none(), errors > 0);
            check(&outcome.diagnostics);
        }

        #[test]
        fn fuzzed_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let folder = tempfile::tempdir().expect("a folder");
            let path = folder.path().join("scene.toml");
            std::fs::write(&path, bytes).expect("written");
            check(&load(&path, &[]).err().unwrap_or_default());
        }
    }
}

#[test]
fn syntax_errors_hide_value_errors() {
    for (line, what) in [
        ("samples == 17", "extra `=`"),
        ("samples = = 17", "extra `=`"),
        ("samples =", MISSING_VALUE),
        ("output == \"a.png\"", "extra `=`"),
    ] {
        let all = outcome(&format!("{CAMERA}[render]\n{line}\n")).diagnostics;
        assert!(all.len() == 1 && all[0].message.contains(what), "{line}: {all:?}");
    }
}

#[test]
fn objects_of_all_shapes_keep_file_order() {
    let radii = |text: &str| -> Vec<i64> {
        let size = |object: &Object| match object.shape {
            Shape::Sphere { radius, .. } | Shape::Disk { radius, .. } => radius,
            Shape::Box { size, .. } => size.x,
            ref other => panic!("{other:?}"),
        };
        scene(text).objects.iter().map(|object| size(object).round() as i64).collect()
    };
    let sphere = |n| format!("[[sphere]]\ncenter = [0, 0, 0]\nradius = {n}\nmaterial = 'a'\n");
    let cube = |n| format!("[[box]]\ncenter = [0, 0, 0]\nsize = [{n}, 1, 1]\nmaterial = 'a'\n");
    let disk = |n| format!("[[disk]]\nradius = {n}\nmaterial = 'a'\n");
    let mixed = [disk(1), cube(2), sphere(3), cube(4), sphere(5), disk(6)].concat();
    assert_eq!(radii(&format!("[materials.a]\n{mixed}")), [1, 2, 3, 4, 5, 6]);
    // Inline tables are sorted by the position of their braces.
    let inline = |kind: &str, a: u32, b: u32| {
        let [a, b] = [a, b].map(|n| format!("{{ center = [0, 0, 0], radius = {n}, material = 'a' }}"));
        format!("{kind} = [{a},\n{b}]\n")
    };
    let braces = [
        inline("disk", 1, 2),
        inline("sphere", 3, 4),
        "[materials]\na.diffuse = [1, 1, 1]\n".into(),
        cube(5),
    ];
    assert_eq!(radii(&braces.concat()), [1, 2, 3, 4, 5]);
}

#[test]
fn colors_are_arrays_numbers_or_strings() {
    let diffuse = |text: &str| {
        let scene = scene(&format!("[materials.a]\ndiffuse = {text}"));
        match &scene.materials[0].kind {
            MaterialKind::Phong(PhongParameters { diffuse: ColorSource::Constant(color), .. }) => *color,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(diffuse("[0.5, 0.5, 0.5]"), diffuse("0.5"));
    assert_eq!((diffuse("1"), diffuse("\"white\"")), (Vec3::ONE, Vec3::ONE));
    assert_eq!(diffuse("\"Tomato\""), srgb8_color_to_linear([255, 99, 71]));
    assert_eq!(diffuse("\"#ff6347\""), diffuse("\"tomato\""));
    let wrong = outcome(&format!("[materials.a]\ndiffuse = \"tomatoe\"\n{CAMERA}"));
    assert_eq!(
        wrong.diagnostics[0].place.as_ref().map(|place| &*place.label),
        Some("did you mean \"tomato\"?")
    );
    assert_eq!(messages("[render]\nbackground = -1"), ["`background` must be at least 0"]);
    assert_eq!(
        messages("[materials.a]\ntype = 'mirror'\nreflectance = 2"),
        ["`reflectance` must be between 0 and 1"]
    );
    // A color name takes precedence over a texture with the same name.
    assert!(
        messages("[textures.red]\nfile = 'none.png'\n[materials.a]\ndiffuse = 'red'")
            .iter()
            .all(|one| !one.contains("diffuse"))
    );
}

#[test]
fn shapes_may_have_names() {
    let scene = scene(
        "[materials.a]\n[[sphere]]\ncenter=[0,0,0]\nradius=1\nmaterial='a'\nname='ball 2'\n[[quad]]\nmaterial='a'",
    );
    let names: Vec<_> = scene.objects.iter().map(|object| object.name.as_deref()).collect();
    assert_eq!(names, [Some("ball 2"), None]);
    assert_eq!(messages("[materials.a]\n[[quad]]\nmaterial='a'\nname='2'"), ["`name` must not be a number"]);
    assert_eq!(
        messages("[materials.a]\n[[quad]]\nmaterial='a'\nname=2"),
        ["`name` must be the name of this shape"]
    );
}

#[test]
fn clearcoat_keys_are_coat_keys() {
    let material = |keys: &str| {
        let scene = scene(&format!("[materials.a]\ntype = 'principled'\n{keys}"));
        scene.materials.into_iter().next()
    };
    assert_eq!(
        material("clearcoat = 0.5\nclearcoat_roughness = 0.2"),
        material("coat = 0.5\ncoat_roughness = 0.2")
    );
    assert_eq!(material("clearcoat = 0\nclearcoat_roughness = 0.2"), material("coat = 0\ncoat_tint = 0.5"));
}

#[test]
fn blends_may_precede_their_parts() {
    let scene = scene(
        "[materials.outer]\ntype = 'blend'\nmaterials = ['inner', 'c']\n\
         [materials.inner]\ntype = 'blend'\nmaterials = ['a', 'b']\nweight = 0.25\n\
         [materials.a]\n[materials.b]\nemission = 1\nemission_sides = 'both'\n[materials.c]",
    );
    let names: Vec<_> =
        scene.materials[0].self_and_blend_parts().iter().map(|part| part.name.clone()).collect();
    assert_eq!(names, ["outer", "inner", "a", "b", "c"]);
    let emitting: Vec<_> = scene.materials.iter().map(|material| material.emits()).collect();
    assert_eq!(emitting, [true, true, false, true, false]);
    assert_eq!(scene.materials[0].emission_sides(), EmissionSides::Both);
}

#[test]
fn blends_have_at_most_64_parts() {
    // Each blend contains the next one and one more material.
    let chain = |length: usize| {
        let link =
            |i: usize| format!("[materials.b{i}]\ntype = 'blend'\nmaterials = ['b{}', 'b{length}']\n", i + 1);
        (0..length).map(link).collect::<String>() + &format!("[materials.b{length}]\n")
    };
    assert_eq!(scene(&chain(63)).materials.len(), 64);
    let message = r#"the blend "b0" combines more than 64 materials"#;
    assert_eq!(messages(&chain(64)), [message]);
    assert!(messages(&chain(20_000))[0].contains("more than 64 materials"));
}
