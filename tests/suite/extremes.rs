//! Extreme scenes: every sample is finite, and time and memory are bounded. Also renders the bundled scenes.

use std::fs;
use std::path::{Path, PathBuf};

use super::test_dir::TestDir;

const PHONG: &str = "type = \"phong\"\ndiffuse = [0.8, 0.2, 0.1]";
const MIRROR: &str = "type = \"mirror\"\nreflectance = [1, 1, 1]";
const GLASS: &str = "type = \"glass\"\nior = 1.5";
const CAMERA: &str = "position = [0, 1, 4]\nlook_at = [0, 1, 0]";
const LAMP: &str = "[[light]]\ntype = \"point\"\nposition = [1, 3, 2]\nintensity = [10, 10, 10]\n";
/// Limit on peak memory, far above what these scenes need.
const MEMORY_BYTES: u64 = 400 << 20;

fn sphere(center: &str, radius: &str) -> String {
    format!("[[sphere]]\ncenter = [{center}]\nradius = {radius}\nmaterial = \"m\"\n")
}

fn quad(corner: &str, u: &str, v: &str) -> String {
    format!("[[quad]]\ncorner = [{corner}]\nu = [{u}]\nv = [{v}]\nmaterial = \"m\"\n")
}

fn round(kind: &str, rest: &str) -> String {
    format!("[[{kind}]]\n{rest}\nmaterial = \"m\"\n")
}

fn mesh(rest: &str) -> String {
    format!("[[mesh]]\nfile = \"a.obj\"\nmaterial = \"m\"\n{rest}\n")
}

fn lamp(position: &str, intensity: &str) -> String {
    format!("[[light]]\ntype = \"point\"\nposition = [{position}]\nintensity = [{intensity}]\n")
}

/// Renders a scene to an 8-bit and a float image, and checks that every sample is finite.
#[track_caller]
fn renders(name: &str, render: &str, camera: &str, material: &str, rest: &str) -> serde_json::Value {
    let dir = TestDir::new();
    dir.write(
        "a.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 2 0 0\nv 0 1e-30 0\nf 1 2 3\nf 1 2 4\nf 1 2 6\n",
    );
    dir.write("a.toml", format!("[render]\n{render}\n[camera]\n{camera}\n[materials.m]\n{material}\n{rest}"));
    let report = dir.report("a.toml -o a.png -o a.exr");
    assert_eq!(report["counters"]["non_finite_samples"], 0, "{name}");
    assert_eq!(report["image"]["complete"], true, "{name}");
    let bytes = report["peak_memory_bytes"].as_u64().expect("bytes");
    assert!(bytes < MEMORY_BYTES, "{name}: {bytes}");
    report
}

const SMALL: &str = "width = 16\nheight = 12\nsamples = 2";

#[test]
fn extreme_image_sizes_render() {
    let rest = sphere("0, 1, 0", "0.5") + LAMP;
    for size in ["width = 1\nheight = 1", "width = 65536\nheight = 1", "width = 1\nheight = 65536"] {
        renders(size, &format!("{size}\nsamples = 1"), CAMERA, PHONG, &rest);
    }
    let report = renders("samples", "width = 1\nheight = 1\nsamples = 100000", CAMERA, PHONG, &rest);
    assert_eq!(report["image"]["samples"]["min"], 100_000);
}

#[test]
fn extreme_shapes_render() {
    for rest in [
        sphere("0, 1, 0", "1e-18"),
        sphere("0, 1, 0", "1e17"),
        sphere("0, -1e17, 0", "1e17"),
        sphere("1e17, 1e17, 1e17", "1e17"),
        sphere("0, 1, 0", "0.5").repeat(5) + &quad("-1, 0, 0", "2, 0, 0", "0, 2, 0").repeat(3),
        quad("-1e17, 0, -1e17", "0, 0, 2e17", "2e17, 0, 0"),
        mesh("scale = 1e-12"),
        mesh("scale = 1e17"),
        mesh("scale = [1e-17, 1e17, -1]"),
        mesh("scale = 1e-12\ntranslate = [1e6, 1e6, 1e6]"),
        "[[triangle]]\na = [0, 0, 0]\nb = [1, 0, 0]\nc = [0.5, 1e-9, 0]\nmaterial = \"m\"\n".to_owned(),
        "[[box]]\ncenter = [0, 1, 0]\nsize = [1e-17, 1, 1e17]\nmaterial = \"m\"\n".to_owned(),
        "[[box]]\ncenter = [0, 1, 4]\nsize = [1, 1, 1]\nmaterial = \"m\"\n".to_owned(),
        round("disk", "center = [0, 1, 0]\nnormal = [1e-17, 0, 1e-17]\nradius = 1e17"),
        round("disk", "center = [0, 1, 0]\nnormal = [0, 0, 1e17]\nradius = 1e-17"),
        round("cylinder", "a = [-1e17, 1, 0]\nb = [1e17, 1, 0]\nradius = 1e-3"),
        round("cylinder", "a = [0, 1, 0]\nb = [1e-17, 1, 0]\nradius = 1e17"),
        round("cylinder", "a = [0, 0.9, 0]\nb = [0, 1.1, 0]\nradius = 4\ncaps = false"),
        round("cone", "base = [0, 0, 0]\ntip = [0, 1e17, 0]\nradius = 1"),
        round("cone", "base = [0, 0, 0]\ntip = [0, 1e-17, 0]\nradius = 1e17\ncap = false"),
        round("cone", "base = [0, 1, -9]\ntip = [0, 1, 4]\nradius = 3"),
        round("torus", "center = [0, 1, 0]\nradius = 1e17\ntube = 1e-17"),
        round("torus", "center = [0, 1, 0]\naxis = [0, 1e-17, 1e-17]\nradius = 1\ntube = 0.9999999999999999"),
        round("torus", "center = [0, 1, 0]\nradius = 4\ntube = 0.5"),
        "[[plane]]\npoint = [0, 1e17, 0]\nnormal = [1e-17, 1e-17, 0]\nmaterial = \"m\"\n".to_owned(),
        "[[plane]]\npoint = [0, 1, 4]\nnormal = [0, 1, 0]\nmaterial = \"m\"\n".to_owned(),
    ] {
        for material in [PHONG, MIRROR, GLASS] {
            renders(&rest, SMALL, CAMERA, material, &format!("{rest}{LAMP}"));
        }
    }
}

#[test]
fn extreme_cameras_render() {
    let rest = sphere("0, 1, 0", "0.5") + LAMP;
    for camera in [
        "position = [0, 1, 4]\nlook_at = [0, 1, 0]\nfov = 179.9",
        "position = [0, 1, 4]\nlook_at = [0, 1, 0]\nfov = 1e-9",
        "position = [1e18, 0, 0]\nlook_at = [0, 0, 0]",
        "position = [0, 1, 4]\nlook_at = [0, 1, 3.99999999999999]",
        "position = [0, 1, 4]\nlook_at = [0, 1, 0]\naperture = 1e17\nfocus = 1e-17",
        "position = [0, 1, 4]\nlook_at = [0, 1, 0]\naperture = 1e-17\nfocus = 1e18",
        "position = [0, 1, 0]\nlook_at = [0, 1, 1]",
    ] {
        for material in [PHONG, GLASS] {
            renders(camera, SMALL, camera, material, &rest);
        }
    }
}

#[test]
fn extreme_lights_render() {
    let ball = sphere("0, 1, 0", "0.5");
    for lamp in [
        lamp("1, 3, 2", "1e18, 1e18, 1e18"),
        lamp("1, 3, 2", "1e-18, 1e-300, 0"),
        lamp("0, 1, 0.5", "10, 10, 10"),
        lamp("0, 1, 0", "10, 10, 10"),
        lamp("0, 1, 0.5000001", "1e18, 1e18, 1e18"),
        lamp("1e18, 1e18, 1e18", "1e18, 1e18, 1e18"),
        (0..10_000).map(|i| lamp(&format!("{}, 3, {}", i % 100, i / 100), "0.01, 0.01, 0.01")).collect(),
    ] {
        renders(&lamp[..lamp.len().min(99)], SMALL, CAMERA, PHONG, &format!("{ball}{lamp}"));
    }
    let glowing =
        |radiance: &str| format!("type = \"phong\"\ndiffuse = [0.5, 0.5, 0.5]\nemission = [{radiance}]");
    for rest in [
        quad("-1e17, 5, -1e17", "2e17, 0, 0", "0, 0, 2e17"),
        quad("0, 1, 0", "1e-17, 0, 0", "0, 1e-17, 0"),
        mesh("scale = 1e-12"),
        round("disk", "center = [0, 5, 0]\nnormal = [0, -1, 0]\nradius = 1e17"),
        round("cylinder", "a = [0, 1, 0]\nb = [0, 3, 0]\nradius = 1e-17"),
        round("cone", "base = [0, 3, 0]\ntip = [0, 1.5, 0]\nradius = 1e17"),
        round("torus", "center = [0, 1, 0]\nradius = 1\ntube = 1e-17"),
        (0..10_000).map(|i| sphere(&format!("{}, 3, {}", i % 100 - 50, -(i / 100)), "0.1")).collect(),
    ] {
        for radiance in ["1, 1, 1", "1e18, 1e18, 1e18", "1e-18, 1e-18, 1e-18"] {
            renders(&rest[..rest.len().min(99)], SMALL, CAMERA, &glowing(radiance), &format!("{ball}{rest}"));
        }
    }
}

#[test]
fn extreme_materials_render() {
    let rest = sphere("0, 1, 0", "0.5") + LAMP;
    for material in [
        "type = \"phong\"\nspecular = [0.3, 0.3, 0.3]\nshininess = 0",
        "type = \"phong\"\nspecular = [0.3, 0.3, 0.3]\nshininess = 1e6",
        "type = \"glass\"\nior = 1",
        "type = \"glass\"\nior = 10\ntint = [0, 1, 0.5]",
    ] {
        renders(material, SMALL, CAMERA, material, &rest);
        renders(material, SMALL, "position = [0, 1, 0]\nlook_at = [0, 1, 1]", material, &rest);
    }
    for limit in ["background = [1e18, 1e18, 1e18]", "ambient = [1e18, 1e18, 1e18]", "exposure = 100"] {
        renders(limit, &format!("{SMALL}\n{limit}"), CAMERA, PHONG, &rest);
    }
}

#[test]
fn lossless_closed_room_terminates() {
    let walls = quad("-9, -9, -1", "18, 0, 0", "0, 18, 0") + &quad("-9, -9, 9", "18, 0, 0", "0, 18, 0");
    let closed = "[[box]]\ncenter = [0, 1, 0]\nsize = [20, 20, 20]\nmaterial = \"m\"\n";
    for depth in [0, 10_000] {
        for material in [MIRROR, GLASS, "type = \"glass\"\nior = 10"] {
            for rest in [&walls, closed, &(closed.to_owned() + &sphere("0, 1, 0", "1").repeat(3))] {
                let render = format!("width = 4\nheight = 3\nsamples = 2\nmax_depth = {depth}");
                renders(&render, &render, CAMERA, material, &format!("{rest}{LAMP}"));
            }
        }
    }
}

#[test]
fn hundred_thousand_spheres_render() {
    let mut rest = LAMP.to_owned();
    for i in 0..100_000_u32 {
        let coordinate = |shift: u32| f64::from(i.wrapping_mul(2_654_435_761) >> shift & 1023) / 100.0 - 5.0;
        rest += &sphere(&format!("{}, {}, {}", coordinate(22), coordinate(11), coordinate(0)), "0.01");
    }
    let report = renders("spheres", SMALL, CAMERA, PHONG, &rest);
    assert_eq!(report["counters"]["objects"], 100_000);
}

fn bundled() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut scenes: Vec<PathBuf> =
        fs::read_dir(folder).expect("the folder").map(|entry| entry.expect("an entry").path()).collect();
    scenes.retain(|path| path.extension().is_some_and(|ending| ending == "toml"));
    scenes.sort();
    assert!(scenes.len() >= 10, "{scenes:?}");
    scenes
}

/// Whether the scene refers to a file that is generated only on demand.
fn needs_generated_files(scene: &Path) -> bool {
    scene.file_stem().is_some_and(|stem| stem == "million" || stem == "figure")
}

#[test]
fn bundled_scenes_do_not_depend_on_threads() {
    for scene in bundled().iter().filter(|scene| !needs_generated_files(scene)) {
        let dir = TestDir::new();
        let path = scene.display();
        for integrator in ["whitted", "path"] {
            for threads in [1, 5] {
                let size = format!("--width 40 --height 30 --samples 3 --integrator {integrator}");
                let outputs = format!("-o {threads}.png -o {threads}.exr");
                let report = dir.report(&format!("{path} {size} {outputs} --threads {threads}"));
                assert_eq!(report["counters"]["non_finite_samples"], 0, "{path} with {integrator}");
                assert_eq!(report["settings"]["threads"], threads, "{path}");
            }
            for ending in ["png", "exr"] {
                let picture = |threads: u32| dir.bytes(&format!("{threads}.{ending}"));
                assert!(picture(1) == picture(5), "{path} .{ending} with {integrator}");
            }
        }
        let check = dir.run(&format!("check {path}"));
        let (answer, said) = (String::from_utf8_lossy(&check.stdout), String::from_utf8_lossy(&check.stderr));
        assert!(answer.starts_with("ok: ") && said.is_empty(), "{answer}{said}");
    }
}
