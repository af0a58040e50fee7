//! The bias that `glimt compare` reports for EXR images, and its standard error.

use serde_json::Value;

use super::test_dir::TestDir;

/// A box with an area light, open toward the camera. Most light on the walls is indirect.
const SCENE: &str = r#"[render]
width = 24
height = 16
samples = 16
integrator = "path"
[camera]
position = [0, 1, 4]
look_at = [0, 0.7, 0]
[materials]
wall = { diffuse = [0.7, 0.7, 0.7] }
lamp = { emission = [8, 8, 8] }
[[sphere]]
center = [0, 0.5, 0]
radius = 0.5
material = "wall"
[[quad]]
material = "wall"
[[quad]]
corner = [-2, -1, -1]
u = [4, 0, 0]
v = [0, 4, 0]
material = "wall"
[[quad]]
corner = [-0.5, 2, -0.5]
u = [1, 0, 0]
v = [0, 0, 1]
material = "lamp"
"#;

fn box_dir() -> TestDir {
    let dir = TestDir::new();
    dir.write("box.toml", SCENE);
    dir
}

fn render(dir: &TestDir, name: &str, options: &str) {
    let output = dir.run(&format!("box.toml --once --progress none -o {name} {options}"));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

fn compared(dir: &TestDir, a: &str, b: &str) -> Value {
    serde_json::from_slice(&dir.run(&format!("compare --json {a} {b}")).stdout).expect("JSON")
}

/// Checks that the reported standard error is 0.7 to 1.5 times the true standard error. The spread of 24
/// z-scores is accurate to about 20 %.
#[test]
fn different_seeds_have_no_significant_bias() {
    const PAIRS: u32 = 24;
    let dir = box_dir();
    let z: Vec<f64> = (0..PAIRS)
        .map(|pair| {
            render(&dir, "a.exr", &format!("--seed {}", 2 * pair + 1));
            render(&dir, "b.exr", &format!("--seed {}", 2 * pair + 2));
            compared(&dir, "a.exr", "b.exr")["bias_z"].as_f64().expect("z")
        })
        .collect();
    let deviation = (z.iter().map(|z| z * z).sum::<f64>() / f64::from(PAIRS)).sqrt();
    assert!((0.5..1.8).contains(&deviation), "{deviation}: {z:?}");
}

#[test]
fn missing_light_is_significant_bias() {
    let dir = box_dir();
    render(&dir, "path.exr", "--seed 1 --samples 1024");
    render(&dir, "whitted.exr", "--seed 2 --samples 1024 --integrator whitted");
    let told = compared(&dir, "whitted.exr", "path.exr");
    let get = |key: &str| told[key].as_f64().expect(key);
    assert!(get("bias") < -0.05 && get("bias_z") < -10.0, "{told}");
    assert!((get("bias") / get("bias_standard_error") / get("bias_z") - 1.0).abs() < 1e-9, "{told}");
    let table = dir.run("compare whitted.exr path.exr").stdout;
    assert!(String::from_utf8_lossy(&table).contains("\nbias, z "), "{}", String::from_utf8_lossy(&table));
}

#[test]
fn no_z_score_without_a_standard_error() {
    let dir = box_dir();
    render(&dir, "path.exr", "--seed 1");
    for options in ["--samples 1", "--crop 0,0,12,16", "--view normal", "--view samples"] {
        render(&dir, "other.exr", &format!("--seed 2 {options}"));
        let told = compared(&dir, "other.exr", "path.exr");
        assert_eq!(
            (&told["bias_standard_error"], &told["bias_z"]),
            (&Value::Null, &Value::Null),
            "{options}"
        );
        assert!(told["bias"].is_number(), "{options}");
    }
}
