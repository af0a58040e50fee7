//! All stress-test cases.

mod cameras;
mod frames;
mod geometry;
mod lights;
mod materials;

use super::row::{CaseSet, SceneFiles, StressRow};

/// All rows of the table.
pub(crate) fn rows(extent: CaseSet) -> Vec<StressRow> {
    let groups = [frames::rows, geometry::rows, lights::rows, materials::rows, cameras::rows];
    groups.into_iter().flat_map(|group| group(extent)).collect()
}

/// The `[render]` table of a small scene with additional keys.
fn head(samples: u32, more: &str) -> String {
    format!("[render]\nwidth = 64\nheight = 48\nsamples = {samples}\n{more}\n")
}

/// A camera at the origin looking along −z.
const CAMERA: &str = "[camera]\nposition = [0, 0, 0]\nlook_at = [0, 0, -5]\n";

/// Emissive objects on all sides, visible without light samples.
const SIGNS: &str = r#"
[materials]
red = { diffuse = 0, emission = [0.9, 0.2, 0.1] }
green = { diffuse = 0, emission = [0.1, 0.8, 0.2] }
blue = { diffuse = 0, emission = [0.2, 0.3, 1.0] }
[[sphere]]
center = [-1.5, 0.5, -7]
radius = 0.8
material = "red"
[[box]]
center = [1.5, -0.5, -7]
size = [1.2, 1.4, 0.8]
rotate = [10, 30, 0]
material = "green"
[[quad]]
corner = [-20, -2, 5]
u = [40, 0, 0]
v = [0, 0, -40]
material = "blue"
"#;

/// A path-traced scene that contains [`SIGNS`], with additional `[render]` keys and elements.
fn signs(more: &str, camera: &str, rest: &str) -> SceneFiles {
    let render = head(16, &format!("integrator = \"path\"\nbackground = [0.3, 0.4, 0.5]\n{more}"));
    SceneFiles::new(format!("{render}{camera}{SIGNS}{rest}"))
}

/// A path-traced white furnace. Every pixel has radiance 1 unless energy is lost.
fn furnace(samples: u32, camera: &str, rest: &str) -> SceneFiles {
    let render = head(samples, "integrator = \"path\"\nmax_depth = 64");
    SceneFiles::new(format!("{render}{camera}[environment]\ncolor = [1, 1, 1]\n{rest}"))
}
