use super::*;

#[test]
fn the_starter_parses_without_a_word() {
    let outcome = parse(starter().into(), Path::new("starter.toml"));
    assert_eq!(outcome.diagnostics, []);
    assert_eq!(outcome.scene.expect("a scene").objects.len(), 5);
}
