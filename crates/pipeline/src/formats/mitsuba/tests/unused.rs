//! Misspelled and misplaced parts of scenes are reported.

use super::{Bench, SENSOR, scene};

/// Asserts that a scene has exactly one note that ends with a text.
#[track_caller]
fn has_note(bench: &Bench, note: &str) {
    let notes = bench.notes();
    assert_eq!(notes.iter().filter(|found| found.ends_with(note)).count(), 1, "no `{note}` in {notes:?}");
}

#[test]
fn unused_settings_are_noted() {
    let bench = Bench::new();
    let integer = |name: &str| format!("<integer name=\"{name}\" value=\"3\"/>");
    let text = format!(
        "<scene version=\"3.0.0\"><integrator type=\"aov\">{}<integrator type=\"path\">{}</integrator></integrator>
        <sensor type=\"thinlens\">{}<sampler type=\"independent\">{}</sampler>
        <film type=\"hdrfilm\"><rfilter type=\"tent\">{}</rfilter></film></sensor></scene>",
        integer("aov"),
        integer("maxdepth"),
        integer("aperture"),
        integer("samplecount"),
        integer("width"),
    );
    bench.write("scene.xml", text);
    for note in [
        "`aov` of `aov`: ignored",
        "`maxdepth` of `path`: ignored",
        "`aperture` of `thinlens`: ignored",
        "`samplecount` of `independent`: ignored",
        "`width` of `tent`: ignored",
    ] {
        has_note(&bench, note);
    }
}

#[test]
fn used_settings_are_not_noted() {
    let bench = Bench::new();
    let text = r#"<scene version="3.0.0"><integrator type="aov"><string name="aovs" value="d:depth"/>
        <integrator type="path"><integer name="max_depth" value="5"/><integer name="rr_depth" value="5"/></integrator>
        </integrator><sensor type="thinlens" id="s"><float name="fov" value="40"/><string name="fov_axis" value="x"/>
        <float name="aperture_radius" value="0"/><float name="focus_distance" value="2"/><float name="near_clip" value="1"/>
        <float name="far_clip" value="9"/><sampler type="independent"><integer name="sample_count" value="3"/>
        <integer name="seed" value="3"/></sampler><film type="hdrfilm"><integer name="width" value="9"/><rfilter type="box"/>
        </film></sensor><bsdf type="diffuse" id="unused"/>
        <shape type="sphere"><bsdf type="blendbsdf"><texture name="weight" type="checkerboard"/><bsdf type="diffuse"/>
        <bsdf type="twosided"><bsdf type="roughconductor"><texture name="alpha" type="checkerboard"/></bsdf></bsdf></bsdf>
        </shape><shape type="sphere"><emitter type="area"><rgb name="radiance" value="1"/></emitter></shape></scene>"#;
    bench.write("scene.xml", text);
    let notes = bench.notes();
    assert!(!notes.iter().any(|note| note.ends_with(": ignored")), "{notes:?}");
}

#[test]
fn unused_properties_of_area_lights_are_noted() {
    let bench = scene(
        r#"<shape type="sphere"><emitter type="area"><rgb name="radience" value="1"/></emitter></shape>"#,
    );
    has_note(&bench, "`radience` of `area`: ignored");
}

#[test]
fn unused_objects_are_noted() {
    for (content, note) in [
        (
            r#"<texture type="checkerboard" id="t"/><shape type="sphere"><bsdf type="diffuse">
            <ref name="reflectence" id="t"/></bsdf></shape>"#,
            "`reflectence` of `diffuse`: ignored",
        ),
        (
            r#"<shape type="sphere"><bsdf type="diffuse"><shape type="cube"/></bsdf></shape>"#,
            "`cube` in `diffuse`: ignored",
        ),
        (
            r#"<shape type="sphere"><emitter type="area"/><emitter type="area" name="more"/></shape>"#,
            "`more` of `sphere`: ignored",
        ),
        (
            r#"<shape type="shapegroup" id="g"><shape type="cube"/><shape type="shapegroup"/></shape>
            <shape type="instance"><ref id="g"/></shape>"#,
            "a `shapegroup` in another shape: ignored here; use an instance of the group instead",
        ),
        (r#"<scene><shape type="cube"/></scene>"#, "`scene` in `scene`: ignored"),
        (r#"<bsdf type="diffuse"/>"#, "`diffuse` in `scene`: ignored"),
        (r#"<integrator type="path"/><integrator type="direct" id="i"/>"#, "`direct` in `scene`: ignored"),
        (
            r#"<emitter type="constant"><texture name="tint" type="checkerboard"/></emitter>"#,
            "`tint` of `constant`: ignored",
        ),
    ] {
        has_note(&scene(content), note);
    }
}

#[test]
fn unknown_attributes_and_text_are_errors() {
    let transform =
        |step: &str| format!("<shape type=\"cube\"><transform name=\"to_world\">{step}</transform></shape>");
    for (content, message, help) in [
        (transform("<translate xx=\"7\"/>"), "<translate> has no attribute `xx`", "expected x, y, z, value"),
        (
            transform("<rotate y=\"1\" angel=\"9\"/>"),
            "<rotate> has no attribute `angel`",
            "did you mean `angle`?",
        ),
        (
            transform("<lookat origin=\"0,0,1\" targett=\"0,0,0\"/>"),
            "<lookat> has no attribute `targett`",
            "did you mean `target`?",
        ),
        (
            "<shape type=\"sphere\"><point name=\"center\" x=\"0\" y=\"0\" z=\"0\" w=\"1\"/></shape>"
                .to_owned(),
            "<point> has no attribute `w`",
            "expected x, y, z, value, name, id",
        ),
        (
            "<shape type=\"sphere\">\n  radius = 2\n</shape>".to_owned(),
            "unexpected text `radius = 2`",
            "remove it, or make it a comment: <!-- … -->",
        ),
    ] {
        let error = scene(&content).read().expect_err(&content).remove(0);
        assert_eq!((error.message.as_str(), error.help.as_deref()), (message, Some(help)));
        let place = error.place.expect("a place");
        assert!(place.span.start > place.source.find(SENSOR).expect("a sensor"), "{content}");
    }
}

#[test]
fn limited_values_are_reported() {
    let rgb = "<rgb name=\"reflectance\" value=\"-1, 0.5, 0.5\"/>";
    let float = |name: &str, value: &str| format!("<float name=\"{name}\" value=\"{value}\"/>");
    let bsdfs = "<bsdf type=\"diffuse\"/><bsdf type=\"plastic\"/>";
    for (bsdf, note) in [
        (format!("<bsdf type=\"diffuse\">{rgb}</bsdf>"), "a negative `reflectance`: replaced by 0"),
        (
            format!("<bsdf type=\"blendbsdf\">{}{bsdfs}</bsdf>", float("weight", "3")),
            "`weight` of `blendbsdf` outside of 0 to 1: replaced by 1",
        ),
        (
            format!("<bsdf type=\"mask\">{}<bsdf type=\"diffuse\"/></bsdf>", float("opacity", "7")),
            "`opacity` of `mask` outside of 0 to 1: replaced by 1",
        ),
        (
            format!("<bsdf type=\"mask\">{}<bsdf type=\"diffuse\"/></bsdf>", float("opacity", "-1")),
            "`opacity` of `mask` outside of 0 to 1: replaced by 0",
        ),
    ] {
        has_note(&scene(&format!("<shape type=\"sphere\">{bsdf}</shape>")), note);
    }
    let bench = Bench::new();
    let sampler = "<sampler type=\"independent\"><integer name=\"sample_count\" value=\"0\"/></sampler>";
    let text = format!("<scene version=\"3.0.0\"><sensor type=\"perspective\">{sampler}</sensor></scene>");
    bench.write("scene.xml", text);
    has_note(&bench, "`sample_count` below 1: replaced by 1");
}
