//! The documented library example renders the same image as the program.

#[allow(dead_code)]
#[path = "../../docs/examples/picture.rs"]
mod picture;

use crate::test_dir::{TestDir, assert_mentions};

#[test]
fn library_example_matches_the_program() {
    let dir = TestDir::new();
    let at = |name: &str| dir.path(name).to_string_lossy().into_owned();
    picture::render_to_png(&at("ball.toml"), &at("library.png")).expect("a picture");
    dir.expect("ball.toml --once --samples 4 -o program.png", 0);
    let pixels = |name: &str| image::open(dir.path(name)).expect("a PNG").into_rgb8().into_raw();
    assert_eq!(pixels("library.png"), pixels("program.png"));
}

#[test]
fn library_errors_have_a_position() {
    let dir = TestDir::new();
    dir.write("wrong.toml", "[render]\nwidht = 3\n");
    let error = picture::render_to_png(&dir.path("wrong.toml").to_string_lossy(), "").expect_err("a mistake");
    let said = error.to_string();
    assert_mentions(&said, &["`widht`", "wrong.toml:2:1"]);
}
