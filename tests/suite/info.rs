//! `glimt info`: the metadata of images.

use nix::errno::Errno;
use serde_json::Value;

use super::test_dir::{TestDir, assert_mentions, system_error};

const SMALL: &str = "--once --width 16 --height 12 --samples 2";

/// Stdout of `glimt info`.
fn info(dir: &TestDir, line: &str, code: i32) -> String {
    let output = dir.run(&format!("info {line}"));
    let stderr = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(code), "{line}: {stderr}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

#[test]
fn every_format_records_image_metadata() {
    let dir = TestDir::new();
    let outputs = ["a.png", "a.exr", "a.hdr", "a.jpg", "a.ppm"];
    let options: String = outputs.iter().map(|name| format!(" -o {name}")).collect();
    dir.expect(&format!("ball.toml {SMALL} --seed 7 --crop 2,3,9,8{options}"), 0);
    dir.expect(&format!("ball.toml {SMALL} --seed 7 --turntable 3 -o a.gif -o a.apng"), 0);
    for name in outputs.iter().chain(&["a.gif", "a.apng"]) {
        let text = info(&dir, name, 0);
        assert!(text.starts_with(&format!("{name}: ")) && text.contains(", 16×12"), "{text}");
        let json: Value = serde_json::from_str(&info(&dir, &format!("{name} --json"), 0)).expect("JSON");
        assert_eq!((&json["width"], &json["height"]), (&16.into(), &12.into()), "{name}");
        assert_eq!(json["is_by_glimt"], true);
        let settings = &json["settings"];
        assert_eq!(settings["scene"], "./ball.toml", "{name}");
        assert_eq!((&settings["seed"], &settings["integrator"]), (&"7".into(), &"whitted".into()));
        assert!(text.contains("  seed        7\n"), "{text}");
        match *name {
            "a.gif" | "a.apng" => assert_eq!(settings["turntable"], "3"),
            _ => assert_eq!((&settings["crop"], &settings["samples"]), (&"2,3,9,8".into(), &"2".into())),
        }
    }
    let json: Value = serde_json::from_str(&info(&dir, "a.apng --json", 0)).expect("JSON");
    assert_eq!(json["frames"], 3);
    for name in ["a.gif", "a.apng"] {
        let json: Value = serde_json::from_str(&info(&dir, &format!("{name} --json"), 0)).expect("JSON");
        assert_eq!((&json["frames"], &json["settings"]["samples"]), (&3.into(), &"2".into()), "{name}");
    }
}

#[test]
fn info_lists_layers_and_parts() {
    let dir = TestDir::new();
    dir.expect(&format!("ball.toml {SMALL} -o a.exr --layers depth,samples"), 0);
    let text = info(&dir, "a.exr", 0);
    assert!(text.contains("B G R depth.Z samples.X") && text.contains("depth,samples"), "{text}");
    dir.expect(&format!("ball.toml {SMALL} -o 2.part --shard 2/3"), 0);
    let text = info(&dir, "2.part", 0);
    assert_mentions(&text, &["2.part", "2 of 3", "16×12", "integrator"]);
}

#[test]
fn info_handles_unrelated_files() {
    let dir = TestDir::new();
    let text = info(&dir, "ball.toml", 2);
    assert!(text.is_empty());
    let stderr = String::from_utf8(dir.run("info none.png").stderr).expect("UTF-8");
    assert_mentions(&stderr, &["none.png", &system_error(Errno::ENOENT)]);
    dir.write("d.png", foreign());
    assert_mentions(&info(&dir, "d.png", 1), &["unknown"]);
    // Names and values may contain control characters.
    dir.write("e.ppm", b"P6\n# glimt:scene: a\x1b[31mred\n1 1\n255\nabc");
    assert!(!info(&dir, "e.ppm", 1).contains('\u{1b}'));
}

/// An image without text chunks.
fn foreign() -> Vec<u8> {
    let mut bytes = Vec::new();
    let picture = image::RgbImage::new(3, 2);
    picture.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).expect("encoded");
    bytes
}
