//! The example of the library gives the picture of the program.

#[allow(dead_code)]
#[path = "../../docs/examples/picture.rs"]
mod picture;

use crate::desk::Desk;

#[test]
fn the_example_renders_what_the_program_renders() {
    let desk = Desk::new();
    let at = |name: &str| desk.path(name).to_string_lossy().into_owned();
    picture::picture(&at("ball.toml"), &at("library.png")).expect("a picture");
    desk.expect("ball.toml --once --samples 4 -o program.png", 0);
    let pixels = |name: &str| image::open(desk.path(name)).expect("a PNG").into_rgb8().into_raw();
    assert_eq!(pixels("library.png"), pixels("program.png"));
}

#[test]
fn a_mistake_in_the_scene_is_an_error_with_its_place() {
    let desk = Desk::new();
    desk.write("wrong.toml", "[render]\nwidht = 3\n");
    let error = picture::picture(&desk.path("wrong.toml").to_string_lossy(), "").expect_err("a mistake");
    let said = error.to_string();
    assert!(said.contains("unknown key `widht`") && said.contains("wrong.toml:2:1"), "{said}");
}
