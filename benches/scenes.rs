//! CPU time that `check` needs for large scene files: a million spheres, and files that repeat a valid or
//! invalid element N and 4N times. A ratio well above 4 reveals a quadratic algorithm.
//!
//! `cargo bench --bench scenes [NAME…]`

#![allow(clippy::print_stdout)]

use std::path::Path;
use std::process::{Command, Stdio};

use nix::sys::resource::{UsageWho, getrusage};
use nix::sys::time::TimeValLike;

const HEAD: &str = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n[[light]]\n";

/// Generates a scene file with the requested number of elements.
type SceneGenerator = fn(usize) -> String;

const FAMILIES: [(&str, SceneGenerator); 14] = [
    ("wrong materials", |n| {
        repeated(n, |i| format!("[materials.mat{i}]\n")) + &repeated(n, |i| sphere(i, "mot"))
    }),
    ("right materials", |n| {
        repeated(n, |i| format!("[materials.mat{i}]\n")) + &repeated(n, |i| sphere(i, "mat"))
    }),
    ("wrong textures", |n| {
        repeated(n, |i| format!("[textures.tex{i}]\nfile = \"t.png\"\n"))
            + &repeated(n, |i| format!("[materials.m{i}]\ndiffuse = {{ texture = \"tox{i}\" }}\n"))
    }),
    ("missing files", |n| repeated(n, |i| format!("[[mesh]]\nfile = \"file{i}.obj\"\n"))),
    ("mesh files", |n| {
        repeated(n, |i| format!("[[mesh]]\nfile = \"m{i}.obj\"\nmaterial = \"a\"\n")) + "[materials.a]\n"
    }),
    ("picture files", |n| repeated(n, |i| format!("[textures.t{i}]\nfile = \"t{i}.png\"\n"))),
    ("duplicate tables", |n| repeated(n, |i| format!("[materials.m{i}]\n")).repeat(2)),
    ("nested tables", |n| {
        repeated(n, |i| format!("[materials.m{i}.sub]\n")) + &repeated(n, |i| format!("[materials.m{i}]\n"))
    }),
    ("duplicate keys", |n| format!("[render]\n{}", repeated(n, |i| format!("k{i} = 1\n")).repeat(2))),
    ("unknown keys", |n| format!("[render]\n{}", repeated(n, |i| format!("width{i} = 1\n")))),
    ("dotted keys", |n| format!("[materials]\n{}", repeated(n, |i| format!("m{i}.diffuse = 0.5\n")))),
    ("broken lines", |n| format!("[render]\n{}", repeated(n, |i| format!("k{i} = = 3 4\n")))),
    ("one long broken line", |n| format!("sphere = [{}]\nx = tru\n", "{ a = 1, b = tru },".repeat(n))),
    ("lights", |n| {
        repeated(n, |i| format!("[[light]]\nposition = [0, {i}, 0]\n")) + &sphere(0, "m") + "[materials.m0]\n"
    }),
];

fn repeated(count: usize, one: impl Fn(usize) -> String) -> String {
    (0..count).map(one).collect()
}

fn sphere(number: usize, material: &str) -> String {
    format!("[[sphere]]\ncenter = [{number}, 0, 0]\nradius = 0.5\nmaterial = \"{material}{number}\"\n")
}

/// A million spheres with eight materials at pseudo-random positions.
fn million() -> String {
    let place = |number: usize| (number.wrapping_mul(2_654_435_761) % 2_000_003) as f64 / 1e4 - 100.0;
    let sphere = |i: usize| {
        let [x, y, z] = [1, 2, 3].map(|axis| place(i * 3 + axis));
        format!(
            "\n[[sphere]]\ncenter = [{x:.4}, {y:.4}, {z:.4}]\nradius = 0.2345\nmaterial = \"m{}\"\n",
            i % 8
        )
    };
    repeated(8, |i| format!("[materials.m{i}]\ndiffuse = [0.5, 0.5, 0.3]\n")) + &repeated(1_000_000, sphere)
}

/// Returns the CPU seconds that `check` takes for a file.
fn seconds(folder: &Path, text: &str) -> f64 {
    let scene = folder.join("scene.toml");
    std::fs::write(&scene, format!("{HEAD}{text}")).expect("written");
    let spent = || {
        let usage = getrusage(UsageWho::RUSAGE_CHILDREN).expect("usage");
        (usage.user_time().num_microseconds() + usage.system_time().num_microseconds()) as f64 * 1e-6
    };
    let before = spent();
    let mut check = Command::new(env!("CARGO_BIN_EXE_glimt"));
    check.arg("check").arg(scene).stdout(Stdio::null()).stderr(Stdio::null());
    check.status().expect("it runs");
    spent() - before
}

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|name| !name.starts_with("--")).collect();
    let is_wanted = |name: &str| wanted.is_empty() || wanted.iter().any(|one| name.contains(one.as_str()));
    let folder = tempfile::tempdir().expect("a folder");
    if is_wanted("million spheres") {
        let text = million();
        let mut all: Vec<f64> = (0..3).map(|_| seconds(folder.path(), &text)).collect();
        all.sort_by(f64::total_cmp);
        let peak = getrusage(UsageWho::RUSAGE_CHILDREN).expect("usage").max_rss() / 1024;
        println!("{:24}{:8.2} s {peak:6} MiB, {} MiB of text", "million spheres", all[1], text.len() >> 20);
    }
    const COUNT: usize = 4_000;
    for number in 0..4 * COUNT {
        std::fs::write(folder.path().join(format!("m{number}.obj")), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
            .expect("written");
        std::fs::write(folder.path().join(format!("t{number}.png")), "no picture").expect("written");
    }
    println!("{:24}{:>10}{:>10}{:>8}", "", COUNT, 4 * COUNT, "growth");
    for (name, family) in FAMILIES.iter().filter(|(name, _)| is_wanted(name)) {
        let [few, many] = [COUNT, 4 * COUNT].map(|count| seconds(folder.path(), &family(count)));
        println!("{name:24}{few:8.3} s{many:8.3} s{:8.1}", many / few);
    }
}
