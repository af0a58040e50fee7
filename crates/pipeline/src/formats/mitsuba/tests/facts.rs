//! One test per fact about Mitsuba's format that is easy to get wrong.

use super::{OBJ, PLY, close, has_line, lacks, material, numbers, png, scene};

#[test]
fn parameters_may_precede_their_defaults() {
    let bench = super::Bench::new();
    let sensor = r#"<sensor type="perspective"><sampler type="independent"><integer name="sample_count" value="$spp"/></sampler></sensor>"#;
    bench.write(
        "scene.xml",
        format!("<scene version=\"3.0.0\">{sensor}<include filename=\"a.xml\"/></scene>"),
    );
    bench.write(
        "a.xml",
        "<scene version=\"3.0.0\"><default name=\"spp\" value=\"7\"/><default name=\"spp\" value=\"9\"/></scene>",
    );
    has_line(&bench.toml(), "samples = 7");
}

#[test]
fn defines_override_defaults_and_may_be_unused() {
    let mut bench = super::Bench::new();
    let text = r#"<scene version="3.0.0"><default name="w" value="5"/><default name="wide" value="64"/>
        <sensor type="perspective"><film type="hdrfilm"><integer name="width" value="$wide"/>
        <integer name="height" value="$w"/></film></sensor></scene>"#;
    bench.write("scene.xml", text);
    let toml = bench.toml();
    has_line(&toml, "width = 64");
    has_line(&toml, "height = 5");
    bench.options.defines = vec![("w".into(), "3".into()), ("unused".into(), "1".into())];
    has_line(&bench.toml(), "height = 3");
}

#[test]
fn references_may_precede_definitions() {
    let text = r#"<shape type="sphere"><ref id="late"/></shape><bsdf type="diffuse" id="late"/>"#;
    has_line(&scene(text).toml(), "material = \"late\"");
}

#[test]
fn files_are_found_next_to_includes_and_in_paths() {
    let bench = scene(
        r#"<path value="parts"/><include filename="a.xml"/>
        <shape type="ply"><string name="filename" value="a.ply"/></shape>"#,
    );
    bench.write("parts/a.xml", "<scene version=\"3.0.0\"><include filename=\"b.xml\"/></scene>");
    bench.write("parts/b.xml", "<scene version=\"3.0.0\"><shape type=\"sphere\"/></scene>");
    bench.write("parts/a.ply", PLY);
    let toml = bench.toml();
    has_line(&toml, "[[sphere]]");
    has_line(&toml, "file = \"parts/a.ply\"");
}

#[test]
fn plugin_names_ignore_case() {
    has_line(&scene(r#"<shape type="Sphere"/>"#).toml(), "[[sphere]]");
}

#[test]
fn transforms_apply_in_order() {
    let text = scene(
        r#"<shape type="sphere"><transform name="to_world"><scale value="2"/><translate x="1"/></transform></shape>"#,
    )
    .toml();
    has_line(&text, "center = [1, 0, 0]");
    has_line(&text, "radius = 2");
}

#[test]
fn rotation_axes_are_not_normalized() {
    let text = scene(
        r#"<shape type="cube"><transform name="to_world"><rotate x="0" y="1" z="1" angle="90"/></transform></shape>"#,
    )
    .toml();
    // cos 90° · I + [a]× + a aᵀ with a = (0, 1, 1).
    has_line(&text, "matrix = [0, -1, 1, 0,  1, 1, 1, 0,  -1, 1, 1, 0,  0, 0, 0, 1]");
}

fn camera(sensor: &str) -> String {
    let bench = super::Bench::new();
    bench.write("scene.xml", format!("<scene version=\"3.0.0\">{sensor}</scene>"));
    bench.toml()
}

#[test]
fn odd_reflections_mirror_the_image() {
    let look = r#"<lookat origin="0, 0, 4" target="0, 0, 0" up="0, 1, 0"/>"#;
    let with = |scales: &str| {
        camera(&format!(
            r#"<sensor type="perspective"><transform name="to_world">{scales}{look}</transform></sensor>"#
        ))
    };
    let plain = with("");
    has_line(&plain, "position = [0, 0, 4]");
    has_line(&plain, "look_at = [0, 0, 0]");
    lacks(&plain, "mirror");
    has_line(&with(r#"<scale x="-1"/>"#), "mirror = true");
    lacks(&with(r#"<scale x="-1"/><scale x="-1"/>"#), "mirror");
}

#[test]
fn field_of_view_is_along_x() {
    let of = |content: &str| {
        let film = r#"<film type="hdrfilm"><integer name="width" value="200"/><integer name="height" value="100"/></film>"#;
        numbers(&camera(&format!("<sensor type=\"perspective\">{content}{film}</sensor>")), "fov")[0]
    };
    let along_x = 2.0 * (45_f64.to_radians().tan() / 2.0).atan().to_degrees();
    close(&[of(r#"<float name="fov" value="90"/>"#)], &[along_x], 1e-9);
    for axis in ["y", "smaller"] {
        let fov = format!(r#"<float name="fov" value="90"/><string name="fov_axis" value="{axis}"/>"#);
        close(&[of(&fov)], &[90.0], 1e-9);
    }
    // A focal length of 50 mm refers to the diagonal of 36 × 24 mm.
    let half_diagonal = (36_f64 * 36.0 + 24.0 * 24.0).sqrt() / 100.0;
    let half_height = half_diagonal / 5_f64.sqrt();
    close(&[of("")], &[2.0 * half_height.atan().to_degrees()], 1e-9);
}

#[test]
fn film_defaults_match_mitsuba() {
    let text = camera(r#"<sensor type="perspective"/>"#);
    for line in ["width = 768", "height = 576", "filter = \"gaussian\"", "samples = 4"] {
        has_line(&text, line);
    }
}

#[test]
fn crop_windows_shift_the_view() {
    let film = r#"<film type="hdrfilm"><integer name="width" value="100"/><integer name="height" value="100"/>
        <integer name="crop_offset_x" value="50"/><integer name="crop_offset_y" value="0"/>
        <integer name="crop_width" value="50"/><integer name="crop_height" value="25"/></film>"#;
    let text =
        camera(&format!("<sensor type=\"perspective\"><float name=\"fov\" value=\"90\"/>{film}</sensor>"));
    has_line(&text, "width = 50");
    close(&numbers(&text, "shift"), &[1.0, 1.5], 1e-12);
    close(&numbers(&text, "fov"), &[2.0 * 0.25_f64.atan().to_degrees()], 1e-9);
}

#[test]
fn scale_sets_the_width_of_orthographic_views() {
    let text = camera(
        r#"<sensor type="orthographic"><transform name="to_world"><scale value="10"/></transform>
        <film type="hdrfilm"><integer name="width" value="200"/><integer name="height" value="100"/></film></sensor>"#,
    );
    has_line(&text, "projection = \"orthographic\"");
    close(&numbers(&text, "view_height"), &[10.0], 1e-12);
}

#[test]
fn depth_limits_count_vertices() {
    let of = |depth: &str| {
        numbers(&scene(&format!("<integrator type=\"path\">{depth}</integrator>")).toml(), "max_depth")[0]
    };
    assert_eq!(of(r#"<integer name="max_depth" value="3"/>"#), 2.0);
    assert_eq!(of(r#"<integer name="max_depth" value="-1"/>"#), 1000.0);
    assert_eq!(of(""), 1000.0);
    let direct =
        scene(r#"<integrator type="direct"><integer name="emitter_samples" value="4"/></integrator>"#);
    assert_eq!(numbers(&direct.toml(), "max_depth"), [1.0]);
    assert!(
        direct.notes().iter().any(|note| note.contains("once per emitter sample")),
        "{:?}",
        direct.notes()
    );
}

/// The tables of a scene with one textured shape.
fn texture_of(shape: &str, texture: &str) -> String {
    let bench = scene(&format!(
        "<shape {shape}<bsdf type=\"diffuse\"><texture name=\"reflectance\" {texture}</bsdf></shape>"
    ));
    bench.write("a.obj", OBJ).write("a.ply", PLY).write("a.png", png(false));
    bench.toml()
}

#[test]
fn images_start_at_the_top_row() {
    let bitmap = r#"type="bitmap"><string name="filename" value="a.png"/></texture>"#;
    let obj = texture_of(r#"type="obj"><string name="filename" value="a.obj"/>"#, bitmap);
    lacks(&obj, "repeat");
    has_line(&obj, "encoding = \"srgb\"");
    let ply = texture_of(r#"type="ply"><string name="filename" value="a.ply"/>"#, bitmap);
    has_line(&ply, "repeat = [1, -1]");
    has_line(&ply, "offset = [0, 1]");
    let rectangle = texture_of(r#"type="rectangle">"#, bitmap);
    has_line(&rectangle, "repeat = [1, -1]");
    let unflipped = texture_of(
        r#"type="obj"><string name="filename" value="a.obj"/><boolean name="flip_tex_coords" value="false"/>"#,
        bitmap,
    );
    has_line(&unflipped, "repeat = [1, -1]");
}

#[test]
fn to_uv_applies_before_the_flip() {
    let text = texture_of(
        r#"type="obj"><string name="filename" value="a.obj"/>"#,
        r#"type="bitmap"><string name="filename" value="a.png"/>
        <transform name="to_uv"><scale x="2" y="4"/><translate y="0.25"/></transform></texture>"#,
    );
    has_line(&text, "repeat = [2, 4]");
    has_line(&text, "offset = [0, -3.25]");
}

#[test]
fn checkerboards_swap_colors_as_numbers() {
    let checker = r#"type="checkerboard"><float name="color0" value="0.25"/><float name="color1" value="0.75"/></texture>"#;
    has_line(&texture_of(r#"type="rectangle">"#, checker), "colors = [0.25, 0.75]");
    let weight = material(&format!(
        r#"<bsdf type="blendbsdf"><texture name="weight" {checker}<bsdf type="diffuse"/><bsdf type="diffuse"/></bsdf>"#
    ));
    has_line(&weight, "colors = [0.75, 0.25]");
}

#[test]
fn masks_do_not_read_alpha() {
    for (has_alpha, line) in
        [(true, "opacity = { texture = \"a\", channel = \"r\" }"), (false, "opacity = { texture = \"a\" }")]
    {
        let bench = scene(
            r#"<shape type="rectangle"><bsdf type="mask"><bsdf type="diffuse"/>
            <texture name="opacity" type="bitmap"><string name="filename" value="a.png"/></texture></bsdf></shape>"#,
        );
        bench.write("a.png", png(has_alpha));
        let text = bench.toml();
        has_line(&text, line);
        has_line(&text, "encoding = \"srgb\"");
        assert!(bench.notes().iter().any(|note| note.contains("Mitsuba blocks")));
    }
}

#[test]
fn flat_emission_spectra_are_purple() {
    let of = |value: &str| {
        let text = scene(&format!("<emitter type=\"constant\">{value}</emitter>")).toml();
        numbers(&text, "color")
    };
    close(&of(r#"<spectrum name="radiance" value="2"/>"#), &[2.4096, 1.8966, 1.8178], 2e-3);
    close(&of(r#"<float name="radiance" value="2"/>"#), &[2.0], 0.0);
    close(&of(r#"<rgb name="radiance" value="2, 1, 0"/>"#), &[2.0, 1.0, 0.0], 0.0);
    // A reflectance is gray.
    has_line(
        &material(r#"<bsdf type="diffuse"><spectrum name="reflectance" value="0.25"/></bsdf>"#),
        "diffuse = 0.25",
    );
}

#[test]
fn named_metals_are_integrated_like_emission() {
    let text = material(r#"<bsdf type="conductor"><string name="material" value="Au"/></bsdf>"#);
    // Mitsuba 3.9 in RGB mode: eta = (0.1635, 0.3775, 1.2953), k = (3.8195, 2.3234, 1.7696). glimt's values
    // differ slightly, because its color matching functions do.
    let eta = numbers(&text, "eta");
    assert!(eta[0] < eta[1] && eta[1] < eta[2], "{eta:?}");
    has_line(&text, "roughness = 0");
}

#[test]
fn glass_is_relative_to_air() {
    let text = material(r#"<bsdf type="dielectric"><string name="int_ior" value="bk7"/></bsdf>"#);
    close(&numbers(&text, "ior"), &[1.5046 / 1.000277], 1e-6);
    lacks(&text, "sides");
}

#[test]
fn shapes_without_a_bsdf_are_gray_and_one_sided() {
    let text = material("");
    has_line(&text, "diffuse = 0.5");
    has_line(&text, "sides = \"front\"");
    let both = material(r#"<bsdf type="twosided"><bsdf type="diffuse"/></bsdf>"#);
    lacks(&both, "sides");
}

#[test]
fn roughness_is_the_root_of_alpha() {
    let text = material(r#"<bsdf type="roughconductor"><float name="alpha" value="0.25"/></bsdf>"#);
    has_line(&text, "roughness = 0.5");
    has_line(&text, "distribution = \"beckmann\"");
    let ggx = material(r#"<bsdf type="roughconductor"><string name="distribution" value="ggx"/></bsdf>"#);
    lacks(&ggx, "distribution");
    let pair = |u: f64, v: f64| {
        let text = material(&format!(
            r#"<bsdf type="roughconductor"><float name="alpha_u" value="{u}"/><float name="alpha_v" value="{v}"/></bsdf>"#
        ));
        (numbers(&text, "roughness")[0], numbers(&text, "anisotropy")[0])
    };
    let (roughness, anisotropy) = pair(0.2, 0.05);
    close(&[roughness.powi(4), anisotropy], &[0.01, 0.75 / 0.9], 1e-6);
    close(&[pair(0.05, 0.2).1], &[-0.75 / 0.9], 1e-6);
}

#[test]
fn conductors_without_material_reflect_all_light() {
    has_line(&material(r#"<bsdf type="conductor"/>"#), "reflectance = 1");
    has_line(&material(r#"<bsdf type="roughconductor"/>"#), "color = 1");
    let bench = super::Bench::new();
    let shape = r#"<shape type="sphere"><bsdf type="conductor"/></shape>"#;
    bench.write("scene.xml", format!("<scene version=\"0.6.0\">{}{shape}</scene>", super::SENSOR));
    has_line(&bench.toml(), "type = \"metal\"");
}

#[test]
fn gray_scales_of_metals_are_blends_with_black() {
    let text = material(
        r#"<bsdf type="roughconductor"><string name="material" value="Au"/><float name="specular_reflectance" value="0.25"/></bsdf>"#,
    );
    has_line(&text, "materials = [\"black\", \"roughconductor\"]");
    has_line(&text, "weight = 0.25");
}

#[test]
fn coats_of_scaled_metals_cover_both_materials() {
    let text = material(
        r#"<bsdf type="coating"><float name="thickness" value="0.5"/><float name="sigma_a" value="2"/>
        <bsdf type="conductor"><string name="material" value="Au"/><float name="specular_reflectance" value="0.5"/></bsdf></bsdf>"#,
    );
    assert_eq!(text.matches("coat_ior = ").count(), 2, "{text}");
    close(&numbers(&text, "coat_tint"), &[(-2.0_f64).exp()], 1e-6);
}

#[test]
fn meshes_without_area_are_skipped() {
    let bench =
        scene(r#"<shape type="obj"><string name="filename" value="a.obj"/></shape><shape type="sphere"/>"#);
    bench.write("a.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    lacks(&bench.toml(), "file");
    assert!(bench.notes().iter().any(|note| note.contains("without area")));
}

#[test]
fn identity_normal_maps_are_ignored() {
    let text = material(
        r#"<bsdf type="normalmap"><texture name="normalmap" type="rawconstant"><vector name="value" value="0.5 0.5 1"/></texture>
        <bsdf type="diffuse"/></bsdf>"#,
    );
    lacks(&text, "normal_map");
}

#[test]
fn plastic_is_linear_by_default() {
    let linear = numbers(&material(r#"<bsdf type="plastic"/>"#), "diffuse")[0];
    let nonlinear = material(r#"<bsdf type="plastic"><boolean name="nonlinear" value="true"/></bsdf>"#);
    close(&numbers(&nonlinear, "diffuse"), &[0.5], 1e-6);
    close(&numbers(&nonlinear, "ior"), &[1.49 / 1.000277], 1e-6);
    // kd / (1 − F + kd F) with F = 1 − (1 − 0.0908)/η² for η = 1.4896.
    close(&[linear], &[0.5 / (1.0 - 0.5 * 0.5903)], 2e-3);
    let rough = numbers(
        &material(
            r#"<bsdf type="roughplastic"><boolean name="nonlinear" value="true"/><float name="alpha" value="0.4"/></bsdf>"#,
        ),
        "diffuse",
    )[0];
    assert!((0.42..0.49).contains(&rough), "{rough}");
}

#[test]
fn face_normals_disable_smoothing() {
    let of = |content: &str| {
        let bench =
            scene(&format!(r#"<shape type="ply"><string name="filename" value="a.ply"/>{content}</shape>"#));
        bench.write("a.ply", PLY);
        bench.toml()
    };
    lacks(&of(""), "smooth");
    has_line(&of(r#"<boolean name="face_normals" value="true"/>"#), "smooth = false");
}

#[test]
fn environment_maps_start_at_minus_z() {
    let of = |transform: &str| {
        let bench = scene(&format!(
            r#"<emitter type="envmap"><string name="filename" value="a.png"/>{transform}</emitter>"#
        ));
        bench.write("a.png", png(false));
        bench.toml()
    };
    let text = of("");
    has_line(&text, "rows = \"poles\"");
    has_line(&text, "matrix = [-1, 0, 0, 0, 1, 0, 0, 0, -1]");
    // Rotate the map to z up.
    let turned = of(r#"<transform name="to_world"><rotate x="1" angle="90"/></transform>"#);
    has_line(&turned, "matrix = [-1, 0, 0, 0, 0, 1, 0, 1, 0]");
}

#[test]
fn sun_directions_are_in_world_space() {
    let of = |version: &str| {
        let bench = super::Bench::new();
        let turn = r#"<transform name="to_world"><rotate x="1" angle="-90"/></transform>"#;
        let turn = if version.starts_with('3') { turn } else { "" };
        bench.write(
            "scene.xml",
            format!(
                r#"<scene version="{version}"><sensor type="perspective"/><emitter type="sunsky">{turn}
                <vector name="sun_direction" x="0.6" y="0.8" z="0"/></emitter></scene>"#
            ),
        );
        bench.toml()
    };
    // In version 3, the rotation maps the local up axis z to the world's y axis.
    for version in ["3.0.0", "0.6.0"] {
        let text = of(version);
        assert!(text.contains("sky = { sun = [0.6, 0.8, 0]"), "{version}:\n{text}");
        lacks(&text, "matrix");
    }
}

#[test]
fn sun_position_follows_the_time() {
    // Mitsuba 3.9.1's values for Tokyo on July 10, 2010, in its local space (z up).
    for (hour, x, y, z) in [(9, 0.095_695_2, -0.614_786, 0.782_867), (15, 0.051_385_1, 0.691_748, 0.720_308)]
    {
        let text =
            scene(&format!(r#"<emitter type="sunsky"><float name="hour" value="{hour}"/></emitter>"#)).toml();
        let sky = text.lines().find_map(|line| line.strip_prefix("sky = { sun = [")).expect("a sky");
        let sun: Vec<f64> = sky
            .split(']')
            .next()
            .expect("numbers")
            .split(',')
            .map(|word| word.trim().parse().expect("a number"))
            .collect();
        close(&sun, &[x, z, -y], 1e-4);
    }
}

#[test]
fn mirrored_rectangles_keep_their_front() {
    let of = |transform: &str| {
        let text = scene(&format!(
            r#"<shape type="rectangle"><transform name="to_world">{transform}</transform></shape>"#
        ))
        .toml();
        let edge = |key: &str| glam_vector(&numbers(&text, key));
        edge("u").cross(edge("v")).z
    };
    assert!(of("") > 0.0);
    // Mitsuba transforms the normal (0, 0, 1) instead of the cross product of the edges.
    assert!(of(r#"<scale x="-1"/>"#) > 0.0);
    assert!(of(r#"<scale z="-1"/>"#) < 0.0);
}

fn glam_vector(numbers: &[f64]) -> crate::math::DVec3 {
    crate::math::DVec3::from_slice(numbers)
}

#[test]
fn spots_fade_between_beam_and_cutoff() {
    let text = scene(r#"<emitter type="spot"><float name="cutoff_angle" value="40"/></emitter>"#).toml();
    has_line(&text, "angle = 80");
    has_line(&text, "blend = 0.25");
    has_line(&text, "look_at = [0, 0, 1]");
}

#[test]
fn old_versions_use_camel_case() {
    let bench = super::Bench::new();
    bench.write(
        "scene.xml",
        r#"<scene version="0.6.0"><sensor type="perspective"><transform name="toWorld">
        <lookAt origin="0 0 4" target="0 0 0" up="0 1 0"/></transform></sensor>
        <shape type="sphere"><bsdf type="diffuse"><rgb name="diffuseReflectance" value="0.25"/></bsdf></shape></scene>"#,
    );
    let text = bench.toml();
    has_line(&text, "position = [0, 0, 4]");
    has_line(&text, "diffuse = 0.25");
}

#[test]
fn missing_assets_are_errors_unless_allowed() {
    let mut bench = scene(
        r#"<shape type="obj"><string name="filename" value="no.obj"/></shape>
        <shape type="sphere"><bsdf type="diffuse"><texture name="reflectance" type="bitmap">
        <string name="filename" value="no.png"/></texture></bsdf></shape>"#,
    );
    let errors = bench.read().expect_err("missing files");
    assert_eq!(errors.len(), 2);
    assert!(errors[0].message.contains("mesh not found: no.obj"), "{}", errors[0].message);
    bench.options.missing = crate::formats::foreign::MissingAssetMode::Note;
    has_line(&bench.toml(), "diffuse = 0.5");
    assert_eq!(bench.notes().len(), 2);
}

#[test]
fn sensors_are_chosen_by_number_or_name() {
    let mut bench = super::Bench::new();
    bench.write(
        "scene.xml",
        r#"<scene version="3.0.0"><sensor type="perspective"/><sensor type="orthographic" id="plan"/></scene>"#,
    );
    lacks(&bench.toml(), "projection");
    for sensor in ["2", "plan"] {
        bench.options.sensor = Some(sensor.to_owned());
        has_line(&bench.toml(), "projection = \"orthographic\"");
    }
    bench.options.sensor = Some("3".to_owned());
    assert!(bench.read().expect_err("no such sensor")[0].message.contains("no sensor `3`"));
}
