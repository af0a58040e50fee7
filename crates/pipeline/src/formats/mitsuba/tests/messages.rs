//! Messages of broken scenes: their text and their place.

use super::{Bench, png, scene};
use crate::scene::diagnostic::Diagnostic;

/// The first error of a scene file.
fn first_error(text: &str) -> Diagnostic {
    let bench = Bench::new();
    bench.write("scene.xml", text);
    bench.read().expect_err(text).remove(0)
}

#[test]
fn cut_files_are_reported_at_their_end() {
    for text in [
        "<scene version=\"3.0.0\">\n<shape type=\"sph",
        "<scene version=\"3.0.0\">\n<shape type",
        "<scene version=\"3.0.0\">\n<shape ",
        "<scene version=\"3.0.0\">\n<!-- a",
    ] {
        let error = first_error(text);
        let place = error.place.expect("a place");
        let line = place.source[..place.span.start].matches('\n').count() + 1;
        assert_eq!(line, 2, "{text}: {}", error.message);
    }
}

#[test]
fn repeated_attributes_have_whole_messages() {
    let error = first_error("<scene version=\"3.0.0\">\n<shape type=\"cube\" type=\"disk\"/></scene>");
    assert_eq!(error.message, "attribute 'type' is already defined");
}

#[test]
fn images_are_reported_at_their_names() {
    let bitmap = "<shape type=\"sphere\"><bsdf type=\"diffuse\"><texture type=\"bitmap\" name=\"reflectance\">\
        <string name=\"filename\" value=\"a.png\"/></texture></bsdf></shape>";
    let map = "<emitter type=\"envmap\"><string name=\"filename\" value=\"a.png\"/></emitter>";
    for content in [bitmap, map] {
        let bench = scene(content);
        bench.write("a.png", png(false));
        let text = std::fs::read_to_string(bench.path("scene.xml")).expect("readable");
        let start = text.find("a.png").expect("a name");
        let found = format!("{:?}", bench.loaded().scene);
        let expected = format!("a.png\", span: {start}..{}", start + "a.png".len());
        assert!(found.contains(&expected), "{content}: {found}");
    }
}

#[test]
fn mesh_plugins_read_only_their_format() {
    for (plugin, file) in [("obj", "a.gltf"), ("ply", "a.obj"), ("serialized", "a.ply"), ("stl", "a")] {
        let bench =
            scene(&format!("<shape type=\"{plugin}\"><string name=\"filename\" value=\"{file}\"/></shape>"));
        bench.write(file, "");
        let error = bench.read().expect_err(file).remove(0);
        assert_eq!(error.message, format!("`{plugin}` reads only .{plugin} files"));
        let place = error.place.expect("a place");
        assert_eq!(&place.source[place.span.clone()], file);
    }
}
