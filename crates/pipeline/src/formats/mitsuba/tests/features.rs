//! Tests of shapes, textures and lights that are converted to generated meshes and images.

use std::path::Path;

use super::{Bench, close, has_line, lacks, material, numbers, png, scene};
use crate::assets::LoadedMesh;
use crate::assets::mesh::load_from_bytes;
use crate::control::{CancelToken, ignore_progress};
use crate::math::DVec3;

/// The generated meshes of a scene.
fn generated_meshes(bench: &Bench) -> Vec<LoadedMesh> {
    let scene = bench.read().expect("a valid scene");
    let files = scene.document.added_in_memory_files().iter().filter(|(name, _)| name.ends_with(".ply"));
    let load = |(name, file): (&String, &crate::scene::InMemoryFile)| {
        load_from_bytes(Path::new(name), &file.bytes, &ignore_progress, &CancelToken::new()).expect("a mesh")
    };
    files.map(load).collect()
}

/// Asserts that a scene has no substitutions.
#[track_caller]
fn has_no_substitution(bench: &Bench) {
    let substitutions = bench.read().expect("a valid scene").substitutions;
    assert!(substitutions.is_empty(), "{substitutions:?}");
}

/// Two triangles with colors of vertices, and colors and weights of faces.
pub(super) const ATTRIBUTES: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    property float color_0\nproperty float color_1\nproperty float color_2\nelement face 2\n\
    property list uchar int vertex_indices\nproperty float color_0\nproperty float color_1\nproperty float color_2\n\
    property float weight_0\nend_header\n0 0 0 1 0 0\n1 0 0 0 1 0\n1 1 0 0 0 1\n0 1 0 0.25 0.25 0.25\n\
    3 0 1 2 0.5 0 0 0.25\n3 0 2 3 0 0.125 0 0.75\n";

fn attributed(bsdf: &str) -> Bench {
    let bench = scene(&format!(r#"<shape type="ply"><string name="filename" value="a.ply"/>{bsdf}</shape>"#));
    bench.write("a.ply", ATTRIBUTES);
    bench
}

fn attribute(slot: &str, name: &str) -> String {
    format!(r#"<texture type="mesh_attribute" name="{slot}"><string name="name" value="{name}"/></texture>"#)
}

#[test]
fn attributes_of_faces_are_images() {
    let bench =
        attributed(&format!(r#"<bsdf type="diffuse">{}</bsdf>"#, attribute("reflectance", "face_color")));
    has_no_substitution(&bench);
    let text = bench.toml();
    has_line(&text, "filter = \"nearest\"");
    let mesh = generated_meshes(&bench).remove(0).mesh;
    let scene = bench.read().expect("a valid scene");
    let files = scene.document.added_in_memory_files();
    let image = &files.iter().find(|(name, _)| name.ends_with(".pfm")).expect("an image").1.bytes;
    let header = b"PF\n2 1\n-1.0\n";
    assert!(image.starts_with(header));
    let texel = |column: usize| -> Vec<f32> {
        let bytes = &image[header.len() + 12 * column..][..12];
        bytes.chunks(4).map(|bytes| f32::from_le_bytes(bytes.try_into().expect("four bytes"))).collect()
    };
    for (face, color) in [[0.5, 0.0, 0.0], [0.0, 0.125, 0.0]].into_iter().enumerate() {
        for vertex in mesh.triangles[face] {
            let column = (mesh.uvs[vertex as usize].x * 2.0) as usize;
            assert_eq!(texel(column), color, "{face}");
        }
    }
}

#[test]
fn attributes_of_faces_can_be_weights() {
    let bench = attributed(&format!(
        r#"<bsdf type="blendbsdf">{}<bsdf type="diffuse"/><bsdf type="diffuse"/></bsdf>"#,
        attribute("weight", "face_weight")
    ));
    has_no_substitution(&bench);
    has_line(&bench.toml(), "weight = { texture = \"face_weight\" }");
}

#[test]
fn attributes_of_vertices_are_vertex_colors() {
    let bench = attributed(&format!(
        r#"<bsdf type="twosided"><bsdf type="diffuse">{}</bsdf></bsdf>"#,
        attribute("reflectance", "vertex_color")
    ));
    has_no_substitution(&bench);
    let text = bench.toml();
    has_line(&text, "diffuse = 1");
    has_line(&text, "vertex_colors = true");
    let mesh = generated_meshes(&bench).remove(0).mesh;
    // The smooth normals of Mitsuba, and linear colors.
    assert!(mesh.normals.iter().all(|normal| (normal.as_dvec3() - DVec3::Z).length() < 1e-6));
    assert_eq!(mesh.colors.len(), 4);
    // Bytes in sRGB: 0.25 is 137.
    assert!(format!("{:?}", mesh.colors[3]).contains("137"), "{:?}", mesh.colors[3]);
}

#[test]
fn attributes_next_to_textures_are_substituted() {
    let bench = attributed(&format!(
        r#"<bsdf type="blendbsdf">{}<bsdf type="diffuse"><texture name="reflectance" type="checkerboard"/></bsdf>
        <bsdf type="diffuse"/></bsdf>"#,
        attribute("weight", "face_weight")
    ));
    assert!(bench.notes().iter().any(|note| note.contains("`mesh_attribute`")), "{:?}", bench.notes());
    assert!(generated_meshes(&bench).is_empty());
}

#[test]
fn imports_write_generated_meshes() {
    let bench =
        attributed(&format!(r#"<bsdf type="diffuse">{}</bsdf>"#, attribute("reflectance", "face_color")));
    let imported = bench.import();
    let names: Vec<_> = imported.files.iter().map(|(name, _)| name.to_string_lossy().into_owned()).collect();
    assert_eq!(names.len(), 2, "{names:?}");
    let text = imported.document.to_toml();
    assert!(names.iter().all(|name| text.contains(&format!("file = \"{name}\""))), "{names:?}\n{text}");
}

#[test]
fn textured_disks_are_polar() {
    let bench = scene(
        r#"<shape type="disk"><bsdf type="diffuse"><texture name="reflectance" type="checkerboard"/></bsdf></shape>"#,
    );
    has_no_substitution(&bench);
    let mesh = generated_meshes(&bench).remove(0).mesh;
    for (at, uv) in mesh.positions.iter().zip(&mesh.uvs) {
        assert!((uv.x - at.length()).abs() < 1e-6, "{at} {uv}");
    }
    has_line(&scene(r#"<shape type="disk"/>"#).toml(), "[[disk]]");
}

#[test]
fn curves_are_tubes() {
    let curve = |kind: &str| {
        let bench = scene(&format!(
            r#"<shape type="{kind}"><string name="filename" value="a.txt"/>
            <transform name="to_world"><scale x="2"/></transform></shape>"#
        ));
        bench.write("a.txt", "0 0 0 0.25\n1 0 0 0.25\n2 0 0 0.25\n3 0 0 0.25\n");
        has_no_substitution(&bench);
        let mesh = generated_meshes(&bench).remove(0).mesh;
        let [low, high] = mesh.bounds_in_file_coordinates().expect("bounds");
        // The sides have the mean width of a circle.
        close(&[low.z, high.z], &[-0.25, 0.25], 1e-3);
        let uvs =
            mesh.uvs.iter().fold((f32::MAX, f32::MIN), |(low, high), uv| (low.min(uv.y), high.max(uv.y)));
        assert_eq!(uvs, (0.0, 1.0));
        [low.x, high.x]
    };
    // Splines start near their second point. Linear curves have spherical ends.
    close(&curve("bsplinecurve"), &[2.0, 4.0], 1e-6);
    close(&curve("linearcurve"), &[-0.25, 6.25], 1e-6);
}

#[test]
fn broken_curves_are_errors() {
    for (text, message) in [("0 0 0\n", "cannot be read"), ("0 0 0 1\n1 0 0 1\n2 0 0 1\n", "too few points")]
    {
        let bench = scene(r#"<shape type="bsplinecurve"><string name="filename" value="a.txt"/></shape>"#);
        bench.write("a.txt", text);
        let errors = bench.read().expect_err("a broken curve");
        assert!(errors[0].message.contains(message), "{}", errors[0].message);
    }
}

#[test]
fn absorbing_media_in_glass_are_tints() {
    let of = |bsdf: &str, medium: &str| {
        scene(&format!(
            r#"<shape type="sphere"><bsdf type="{bsdf}"/><medium name="interior" type="homogeneous">{medium}
            <rgb name="sigma_t" value="0.5, 0.25, 1"/><float name="scale" value="2"/></medium></shape>"#
        ))
    };
    let clear = of("dielectric", r#"<rgb name="albedo" value="0"/>"#);
    has_no_substitution(&clear);
    let expected = [1.0, 0.5, 2.0].map(|absorption: f64| (-absorption).exp());
    close(&numbers(&clear.toml(), "tint"), &expected, 1e-6);
    for other in [of("dielectric", ""), of("null", r#"<rgb name="albedo" value="0"/>"#)] {
        let found = other.read().expect("a valid scene").substitutions;
        assert!(found[0].message.contains("medium `homogeneous`: light passes it unchanged"), "{found:?}");
        lacks(&other.toml(), "tint");
    }
}

#[test]
fn checkered_roughness_is_a_blend() {
    let checker = |name: &str, colors: [f64; 2]| {
        format!(
            r#"<texture name="{name}" type="checkerboard"><float name="color0" value="{}"/>
            <float name="color1" value="{}"/></texture>"#,
            colors[0], colors[1]
        )
    };
    let text = material(&format!(
        r#"<bsdf type="roughconductor"><string name="material" value="Au"/>{}{}</bsdf>"#,
        checker("alpha_u", [0.05, 0.3]),
        checker("alpha_v", [0.3, 0.05]),
    ));
    // The first cell has color1, because the checkerboard is a number.
    let lines: Vec<&str> = text.lines().filter(|line| line.starts_with("anisotropy")).collect();
    assert!(lines.len() == 2 && !lines[0].contains('-') && lines[1].contains("= -"), "{lines:?}");
    has_line(&text, "colors = [0, 1]");
    has_line(&text, "materials = [\"roughconductor\", \"roughconductor_2\"]");
}

/// A scene with a camera at (0, 0, 8) and a light.
fn lit(emitter: &str) -> Bench {
    let bench = Bench::new();
    let camera = r#"<sensor type="perspective"><transform name="to_world">
        <lookat origin="0, 0, 8" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>"#;
    bench.write("scene.xml", format!("<scene version=\"3.0.0\">{camera}{emitter}</scene>"));
    bench.write("a.png", png(false));
    bench
}

const LOOK: &str =
    r#"<transform name="to_world"><lookat origin="0, 0, 2" target="0, 0, 0" up="0, 1, 0"/></transform>"#;

#[test]
fn textured_spots_have_a_pane() {
    let bitmap = r#"<texture name="texture" type="bitmap"><string name="filename" value="a.png"/></texture>"#;
    let spot = |look: &str| {
        lit(&format!(
            r#"<emitter type="spot"><float name="cutoff_angle" value="45"/>{bitmap}{look}</emitter>"#
        ))
    };
    let bench = spot(LOOK);
    has_no_substitution(&bench);
    let text = bench.toml();
    has_line(&text, "thin = true");
    has_line(&text, "tint = { texture = \"a\" }");
    // The pane is 0.0002 in front of the light, and x points to the left of its view along −z, which is −x.
    close(&numbers(&text, "corner"), &[0.0002, -0.0002, 1.9998], 1e-9);
    close(&numbers(&text, "u"), &[-0.0004, 0.0, 0.0], 1e-9);
    close(&numbers(&text, "v"), &[0.0, 0.0004, 0.0], 1e-9);
    // A camera at the light moves in front of the pane, which is at 8 − 0.0008.
    let same = spot(&LOOK.replace("0, 0, 2", "0, 0, 8"));
    has_no_substitution(&same);
    close(&numbers(&same.toml(), "position"), &[0.0, 0.0, 7.9984], 1e-9);
    // A camera that looks in another direction would see the pane.
    let near = spot(&LOOK.replace("0, 0, 2", "0, 0, 8").replace("0, 0, 0", "8, 0, 8"));
    assert!(near.notes().iter().any(|note| note.contains("texture is left out")), "{:?}", near.notes());
}

#[test]
fn projectors_have_a_constant_irradiance() {
    let text = lit(&format!(
        r#"<emitter type="projector"><float name="fov" value="90"/><float name="scale" value="2"/>
        <rgb name="irradiance" value="1, 2, 4"/>{LOOK}</emitter>"#
    ));
    has_no_substitution(&text);
    let text = text.toml();
    // π · 2 · (1, 2, 4) / cos³ at the corner, whose tangent is √2.
    let peak = std::f64::consts::PI * 2.0 * 3_f64.powf(1.5);
    close(&numbers(&text, "intensity"), &[peak, 2.0 * peak, 4.0 * peak], 1e-3 * peak);
    close(&numbers(&text, "angle"), &[2.0 * 2_f64.sqrt().atan().to_degrees()], 1e-6);
    assert_eq!(text.matches("[[quad]]").count(), 5, "a pane in a frame");
    // u grows to Mitsuba's −x.
    close(&numbers(&text, "u"), &[0.0004, 0.0, 0.0], 1e-9);
}

#[test]
fn distance_grids_are_meshes() {
    let bench = scene(r#"<shape type="sdfgrid"><string name="filename" value="a.vol"/></shape>"#);
    let mut bytes = b"VOL\x03".to_vec();
    [1_u32, 2, 2, 2, 1].iter().for_each(|word| bytes.extend(word.to_le_bytes()));
    bytes.extend([0; 24]);
    for index in 0..8 {
        bytes.extend((if index & 1 == 1 { 0.75_f32 } else { -0.25 }).to_le_bytes());
    }
    bench.write("a.vol", &bytes);
    has_no_substitution(&bench);
    let mesh = generated_meshes(&bench).remove(0).mesh;
    let [low, high] = mesh.bounds_in_file_coordinates().expect("bounds");
    close(&[low.x, high.x, low.y, high.y, low.z, high.z], &[0.25, 0.25, 0.0, 1.0, 0.0, 1.0], 1e-6);
    bench.write("a.vol", &bytes[..60]);
    assert!(bench.read().expect_err("a broken grid")[0].message.contains("cannot be read"));
}

#[test]
fn rotations_by_nothing_need_no_axis() {
    let turned = r#"<transform name="to_world"><rotate x="0" y="0" z="0" angle="0"/></transform>"#;
    lacks(&scene(&format!(r#"<shape type="cube">{turned}</shape>"#)).toml(), "matrix");
}

#[test]
fn differentiable_integrators_have_limits() {
    for (plugin, depth) in [("path", 1000.0), ("prb", 5.0), ("direct_projective", 1.0)] {
        let text = scene(&format!("<integrator type=\"{plugin}\"/>")).toml();
        assert_eq!(numbers(&text, "max_depth"), [depth], "{plugin}");
    }
}
