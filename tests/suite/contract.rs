//! The scene file contract: what keys accept beyond their definitions, which `docs::tables` checks.

use std::fs;
use std::path::PathBuf;

use glimt::math::DVec3;
use glimt::scene::description::{AffineMap, Camera, Scene, Texture};
use glimt::scene::diagnostic::{Diagnostic, Severity};
use glimt::scene::{parse, starter_scene};

/// A directory with every file that the scenes refer to, and the path of the scene in it.
fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["scenes/textures", "assets"] {
        fs::create_dir_all(folder.path().join(name)).expect("a folder");
    }
    for name in [
        "scenes/textures/bricks.png",
        "scenes/textures/bumps.png",
        "scenes/sky.hdr",
        "assets/knot.obj",
        "scenes/camera.txt",
    ] {
        fs::write(folder.path().join(name), "").expect("written");
    }
    let scene = folder.path().join("scenes/cornell.toml");
    (folder, scene)
}

/// The messages of all errors.
pub(crate) fn errors(diagnostics: &[Diagnostic]) -> Vec<&str> {
    let errors = diagnostics.iter().filter(|one| one.severity == Severity::Error);
    errors.map(|one| one.message.as_str()).collect()
}

/// Removes source positions from the scene, because they change when a key is omitted.
pub(crate) fn without_positions(mut scene: Scene) -> Scene {
    scene.objects.iter_mut().for_each(|object| object.span = 0..0);
    scene.instances.iter_mut().for_each(|instance| instance.span = 0..0);
    let images = scene.textures.iter_mut().filter_map(Texture::as_image_mut);
    images.for_each(|image| image.file.span = 0..0);
    scene.mesh_files.iter_mut().for_each(|file| file.span = 0..0);
    let maps = scene.environment.iter_mut().filter_map(|environment| environment.file.as_mut());
    maps.for_each(|file| file.span = 0..0);
    scene
}

#[test]
fn environment_without_a_map_is_black() {
    let (_folder, path) = folder();
    let camera = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n";
    let color = |text: &str| {
        let scene = parse(format!("{camera}{text}").into(), &path).scene.expect("a scene");
        scene.environment.map(|environment| environment.color.to_array())
    };
    assert_eq!([color(""), color("[environment]\n")], [None, Some([0.0; 3])]);
    assert_eq!(color("[environment]\nfile = \"sky.hdr\"\n"), Some([1.0; 3]));
}

#[test]
fn camera_accepts_an_orbiter() {
    let (_folder, path) = folder();
    let outcome = parse("[camera]\norbiter = \"camera.txt\"\n".into(), &path);
    assert_eq!(errors(&outcome.diagnostics), [""; 0]);
    assert!(matches!(outcome.scene.expect("a scene").camera, Camera::Orbiter { .. }));
}

#[test]
fn mesh_accepts_a_matrix() {
    let (_folder, path) = folder();
    let scene = |placed: &str| {
        let camera = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n[materials.a]\n";
        let text = format!("{camera}[[mesh]]\nfile = \"../assets/knot.obj\"\nmaterial = \"a\"\n{placed}\n");
        let outcome = parse(text.into(), &path);
        assert_eq!(errors(&outcome.diagnostics), [""; 0], "{placed}");
        outcome.scene.expect("a scene")
    };
    let transform =
        |placed: &str| scene(placed).objects[0].shape.as_mesh().expect("a mesh").placed.to_transform();
    let by_matrix = transform("matrix = [0, -2, 0, 5, 1, 0, 0, 6, 0, 0, -3, 7, 0, 0, 0, 1]");
    let by_steps = transform("scale = [1, 2, -3]\nrotate = [0, 0, 90]\ntranslate = [5, 6, 7]");
    assert_eq!(by_matrix, by_steps);
    assert!(by_matrix.flips_handedness());
}

#[test]
fn every_shape_accepts_a_matrix() {
    let (_folder, path) = folder();
    let matrix = "matrix = [0, -2, 0, 5, 1, 0, 0.5, 6, 0, 0, -3, 7, 0, 0, 0, 1]";
    let (x, y, z) = (DVec3::new(0.0, 1.0, 0.0), DVec3::new(-2.0, 0.0, 0.0), DVec3::new(0.0, 0.5, -3.0));
    for kind in ["sphere", "quad", "plane", "box", "triangle", "disk", "cylinder", "cone", "torus"] {
        let own = if kind == "sphere" { "center = [1, 2, 3]\nradius = 1\n" } else { "" };
        let camera = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n[materials.a]\n";
        let shape = |matrix: &str| {
            let text = format!("{camera}[[{kind}]]\n{own}material = \"a\"\n{matrix}\n");
            let outcome = parse(text.into(), &path);
            assert_eq!(errors(&outcome.diagnostics), [""; 0], "{kind}");
            outcome.scene.expect("a scene").objects[0].shape.clone()
        };
        let map = AffineMap { linear: [x, y, z], translate: DVec3::new(5.0, 6.0, 7.0) };
        assert_eq!(shape(matrix), shape("").transformed(map), "{kind}");
        assert_eq!(shape(matrix).kind(), kind);
    }
}

#[test]
fn ranges_include_their_limits() {
    let (_folder, path) = folder();
    let said = |text: &str| {
        let camera = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n";
        let outcome = parse(format!("{camera}{text}\n").into(), &path);
        errors(&outcome.diagnostics).len()
    };
    for right in [
        "fov = 179.9",
        "aperture = 0",
        "[render]\nwidth = 1",
        "[render]\nwidth = 65536\nheight = 1",
        "[render]\nheight = 65536\nwidth = 1",
        "[render]\nsamples = 1",
        "[render]\nmax_depth = 0",
        "[render]\nexposure = -3.5",
        "[render]\nbackground = \"#ffcc00\"",
        "[render]\nbackground = [0, 1, 1000.5]",
        "[photons]\nradius = 0.5\nbounces = 0",
        "[materials.a]\ntype = \"glass\"\nior = 0.75",
        "[materials.a]\ntype = \"glass\"\nthin = true\nopacity = 0.5",
        "[materials.a]\nopacity = 0\nopacity_cutoff = 1",
        "[materials.a]\nopacity = { texture = \"b\", channel = \"a\" }\n[textures.b]\nfile = \"textures/bumps.png\"",
        "[textures.b]\nfile = \"textures/bumps.png\"\noffset = [-0.5, 7]\nrotate = -720\nuv = 1",
        "[textures.b]\ntype = \"checker\"\ncolors = [0, [1, 7, 0]]\nrepeat = [-1, 0.5]\nuv = 1",
        "[textures.b]\ntype = \"noise\"\nsize = 1e-6\noctaves = 16\nseed = 4294967295",
        "[materials.a]\nbump = \"b\"\n[textures.b]\ntype = \"bands\"\nfilter = \"mipmap\"\nfactor = 2",
        "[materials.a]\ntype = \"metal\"\ncolor = { texture = \"b\" }\nroughness = { texture = \"b\", channel = \"g\" }\n[textures.b]\ntype = \"noise\"",
        "[materials.a]\ntype = \"metal\"\nelement = \"Cu2O\"",
        "[materials.a]\ntype = \"metal\"\neta = [0, 0, 0]\nk = [9, 9, 9]\nroughness = 0\nanisotropy = -1",
        "[materials.a]\ntype = \"metal\"\ncolor = 1\nroughness = { texture = \"b\" }\n[textures.b]\nfile = \"textures/bumps.png\"",
        "[materials.a]\ntype = \"plastic\"\nior = 1\nroughness = 1\ndistribution = \"beckmann\"",
        "[materials.a]\nsides = \"front\"\n[materials.b]\ntype = \"principled\"\ndiffuse_transmission = 0.2",
        "[materials.a]\ndiffuse_transmission = { texture = \"b\" }\n[textures.b]\nfile = \"textures/bumps.png\"",
        "[materials.a]\ntype = \"principled\"\nior = 10\nspecular_color = 7",
        "[materials.a]\nambient = { texture = \"b\" }\n[textures.b]\nfile = \"textures/bumps.png\"",
        "[environment]",
        "[environment]\ncolor = [1, 1, 1]",
        "[environment]\ncolor = \"skyblue\"\nrotate = -720",
        "[environment]\nfile = \"textures/bricks.png\"",
    ] {
        assert_eq!(said(right), 0, "{right}");
    }
    for wrong in [
        "[materials.a]\ntype = \"metal\"",
        "[materials.a]\ntype = \"metal\"\ncolor = 1\nelement = \"gold\"",
        "[materials.a]\ntype = \"metal\"\neta = 1",
        "[materials.a]\ntype = \"metal\"\ncolor = 1.5",
        "[materials.a]\ntype = \"metal\"\ncolor = 1\nanisotropy = 1.5",
        "[materials.a]\ntype = \"principled\"\ncolor = { texture = \"b\" }\nroughness = { texture = \"b\" }\n[textures.b]\nfile = \"textures/bumps.png\"",
        "[materials.a]\ntype = \"plastic\"\nior = 0.9",
        "[materials.a]\ntype = \"principled\"\ntransmission = 1.5",
        "[materials.a]\ntype = \"glass\"\nthin = true\nroughness = 0.5",
        "[render]\nwidth = 0",
        "[render]\nwidth = 65537",
        "[render]\nsamples = 0",
        "[render]\nerror = -1",
        "[render]\nbackground = [0, -1, 0]",
        "[environment]\ncolor = [1, -1, 1]",
        "[environment]\ncolour = [0, 0, 0]",
        "[environment]\nfile = \"textures/brick.png\"",
        "[environment]\nfile = \"sky.txt\"",
        "[environment]\nrotate = \"left\"",
        "[materials.a]\nopacity = 1.1",
        "[materials.a]\nopacity_cutoff = -0.1",
        "[materials.a]\ntype = \"glass\"\nopacity = 0.5",
        "[textures.b]\nfile = \"textures/bumps.png\"\nuv = 2",
        "[textures.b]\ntype = \"noise\"\nrepeat = [2, 2]",
        "[textures.b]\ntype = \"checker\"\ncolors = [1, 0, 0]",
        "[textures.b]\ntype = \"bands\"\ncolors = [1, -1]",
        "[materials.a]\nnormal_map = \"b\"\n[textures.b]\ntype = \"noise\"",
        "[materials.a]\ntype = \"metal\"\nelement = \"Xx\"",
    ] {
        assert_eq!(said(wrong), 1, "{wrong}");
    }
}

#[test]
fn paths_are_relative_to_the_scene() {
    let (folder, path) = folder();
    let text = "[render]\noutput = \"cornell.png\"\n[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n\
                [textures.bricks]\nfile = \"textures/bricks.png\"\n[[mesh]]\nfile = \"../assets/knot.obj\"\n";
    let scene = parse(text.into(), &path).scene.expect("a scene");
    assert_eq!(scene.output, Some(folder.path().join("scenes/cornell.png")));
    assert_eq!(scene.mesh_files[0].value, folder.path().join("scenes/../assets/knot.obj"));
    let image = scene.textures[0].as_image().expect("an image");
    assert_eq!(image.file.value, folder.path().join("scenes/textures/bricks.png"));
}

#[test]
fn starter_lines_can_be_uncommented() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["bricks.png", "knot.obj", "sky.hdr"] {
        fs::write(folder.path().join(name), "").expect("written");
    }
    let is_key = |text: &str| {
        let name = text.split(" = ").next().unwrap_or_default();
        text.starts_with('[')
            || text.contains(" = ") && name.chars().all(|c| c.is_ascii_lowercase() || c == '_')
    };
    let uncommented = |line: &str| match line.strip_prefix("# ") {
        // These keys conflict with other keys.
        Some(text)
            if is_key(text)
                && !["orbiter", "matrix", "sky", "view_height"].iter().any(|key| text.starts_with(key)) =>
        {
            format!("{text}\n")
        }
        _ => format!("{line}\n"),
    };
    let text: String = starter_scene().lines().map(uncommented).collect();
    assert!(text.lines().filter(|line| line.starts_with('#')).count() < 15, "{text}");
    let outcome = parse(text.into(), &folder.path().join("scene.toml"));
    assert_eq!(errors(&outcome.diagnostics), [""; 0]);
    assert_eq!(outcome.scene.expect("a scene").objects.len(), 12);
}
