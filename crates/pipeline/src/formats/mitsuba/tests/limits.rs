//! Scenes whose references multiply: they are converted in linear time or rejected.

use super::{Bench, SENSOR, has_line, scene};
use crate::control::CancelToken;
use crate::formats::ForeignReadContext;
use crate::formats::mitsuba::graph::GraphBuilder;
use crate::formats::mitsuba::reader::SceneReader;
use crate::formats::mitsuba::shapes::ShapeTarget;
use crate::formats::mitsuba::xml::XmlLoader;

/// Blends of which each contains the previous one twice.
fn blend_chain(levels: usize, first: &str) -> String {
    let blend = |level: usize| {
        let part = format!("<ref id=\"b{level}\"/>");
        format!("<bsdf type=\"blendbsdf\" id=\"b{}\">{part}{part}</bsdf>\n", level + 1)
    };
    format!("{first}{}", (0..levels).map(blend).collect::<String>())
}

#[test]
fn blend_chains_share_their_materials() {
    let chain = blend_chain(30, "<bsdf type=\"diffuse\" id=\"b0\"/>");
    let text = scene(&format!("{chain}<shape type=\"sphere\"><ref id=\"b30\"/></shape>")).toml();
    assert_eq!(text.lines().filter(|line| line.starts_with("[materials.")).count(), 31);
    has_line(&text, "materials = [\"b29\", \"b29\"]");
}

#[test]
fn blend_parts_depend_on_their_context() {
    let text = scene(
        r#"<bsdf type="diffuse" id="a"/><bsdf type="blendbsdf" id="b"><ref id="a"/><ref id="a"/></bsdf>
        <bsdf type="mask" id="m"><float name="opacity" value="0.25"/><ref id="b"/></bsdf>
        <shape type="sphere"><bsdf type="blendbsdf"><ref id="b"/><ref id="m"/></bsdf></shape>"#,
    )
    .toml();
    assert_eq!(text.lines().filter(|line| *line == "opacity = 0.25").count(), 1);
    has_line(&text, "materials = [\"a\", \"a\"]");
    has_line(&text, "materials = [\"a_2\", \"a_2\"]");
}

#[test]
fn too_many_materials_are_rejected() {
    let shapes = "<shape type=\"sphere\"><bsdf type=\"diffuse\"/></shape>\n".repeat(2_500);
    let errors = scene(&shapes).read().expect_err("too many materials");
    assert_eq!(errors.len(), 1);
    assert!(errors[0].message.contains("more than 2000 materials"), "{}", errors[0].message);
    let place = errors[0].place.as_ref().expect("a place");
    assert_eq!(place.source[..place.span.start].matches('\n').count(), 2_000);
    assert_eq!(&place.source[place.span.clone()], "bsdf");
}

/// Merged shapes of which each contains the previous one eight times.
fn merge_chain(first: &str) -> String {
    let merge = |level: usize| {
        let parts = format!("<ref id=\"m{level}\"/>").repeat(8);
        format!("<shape type=\"merge\" id=\"m{}\">{parts}</shape>", level + 1)
    };
    format!("{first}{}", (0..12).map(merge).collect::<String>())
}

#[test]
fn merge_chains_are_rejected() {
    for first in ["<shape type=\"sphere\" id=\"m0\"/>", "<shape type=\"merge\" id=\"m0\"/>"] {
        let errors = scene(&merge_chain(first)).read().expect_err("too many shapes");
        assert_eq!(errors.len(), 1);
        assert!(errors[0].message.contains("shapes and instances"), "{}", errors[0].message);
    }
}

#[test]
fn canceled_readers_add_nothing() {
    let bench = Bench::new();
    bench.write("scene.xml", format!("<scene version=\"3.0.0\">{SENSOR}<shape type=\"sphere\"/></scene>"));
    bench.with_context(|path, context| {
        let canceled = CancelToken::new();
        canceled.cancel();
        let mut loader = XmlLoader::new(path, &[], context.token);
        let root = loader.load_scene_elements(path).expect("readable").expect("valid");
        let files = &loader.reader.files;
        let partial = GraphBuilder::new(files, &canceled).build(&root).expect("no errors");
        assert_eq!(partial.objects.len(), 1);
        let graph = GraphBuilder::new(files, context.token).build(&root).expect("no errors");
        let context = ForeignReadContext { token: &canceled, ..*context };
        let mut reader = SceneReader::new(&graph, files, path, &[], None, &context);
        let sphere = graph.objects.iter().position(|one| one.plugin == "sphere").expect("a sphere");
        assert!(!reader.add_shape(sphere, ShapeTarget::SCENE));
        assert!(reader.document.to_toml().is_empty(), "{}", reader.document.to_toml());
    });
}

#[test]
fn elements_have_limited_attributes_and_properties() {
    let attributes: String = (0..100_000).map(|index| format!(" a{index}=\"\"")).collect();
    let properties: String =
        (0..100_000).map(|index| format!("<float name=\"p{index}\" value=\"1\"/>")).collect();
    for (content, message) in [
        (format!("<shape type=\"sphere\"{attributes}/>"), "the element has more than 200 attributes"),
        (format!("<shape type=\"sphere\">{properties}</shape>"), "more than 1000 properties"),
    ] {
        let errors = scene(&content).read().expect_err(message);
        assert_eq!((errors.len(), errors[0].message.as_str()), (1, message));
    }
}
