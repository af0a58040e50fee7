//! Broken scenes: every error points to the line and column of the mistake.

use super::{Bench, SENSOR};
use crate::scene::diagnostic::{Diagnostic, Severity};

/// Line and column of a diagnostic, both starting at 1.
fn place(diagnostic: &Diagnostic) -> (usize, usize) {
    let place = diagnostic.place.as_ref().unwrap_or_else(|| panic!("no place: {}", diagnostic.message));
    let before = &place.source[..place.span.start];
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
}

/// Scenes whose line 3 has a mistake at `^`, and a part of the message.
const MISTAKES: [(&str, &str); 43] = [
    (r#"<^shap type="sphere"/>"#, "unknown element <shap>"),
    (r#"<shape type="^spher"/>"#, "unknown shape `spher`"),
    (r#"<^shape/>"#, "`type` is missing"),
    (r#"<shape type="sphere"><float name="radius" value="^big"/></shape>"#, "expected a number, found `big`"),
    (r#"<shape type="sphere"><^float name="radius"/></shape>"#, "needs the attribute `value`"),
    (r#"<shape type="sphere"><^float value="1"/></shape>"#, "needs the attribute `name`"),
    (
        r#"<shape type="sphere"><string name="radius" value="^1"/></shape>"#,
        "`radius` must be a float, found a string",
    ),
    (r#"<shape type="sphere"><float name="radius" value="^nan"/></shape>"#, "must be finite"),
    (r#"<shape type="sphere"><float name="radius" value="^1e99"/></shape>"#, "must be finite"),
    (
        r#"<shape type="sphere"><float name="radius" value="1"/><float name="radius" value="^2"/></shape>"#,
        "specified twice",
    ),
    (r#"<shape type="sphere"><ref id="^wall"/></shape>"#, "no object has the id `wall`"),
    (r#"<bsdf type="diffuse" id="a"/><bsdf type="diffuse" id="^a"/>"#, "used twice"),
    (r#"<shape type="sphere"><bsdf type="^difuse"/></shape>"#, "unknown BSDF `difuse`"),
    (r#"<shape type="sphere"><bsdf type="^hair"/></shape>"#, "glimt does not render hair"),
    (
        r#"<shape type="sphere"><bsdf type="dielectric"><string name="int_ior" value="^glas"/></bsdf></shape>"#,
        "unknown substance",
    ),
    (
        r#"<shape type="sphere"><bsdf type="conductor"><string name="material" value="^Xx"/></bsdf></shape>"#,
        "unknown conductor",
    ),
    (
        r#"<shape type="sphere"><bsdf type="roughconductor"><string name="distribution" value="^gxx"/></bsdf></shape>"#,
        "unknown distribution",
    ),
    (r#"<shape type="sphere"><bsdf type="^twosided"/></shape>"#, "needs a nested BSDF"),
    (
        r#"<shape type="sphere"><bsdf type="^blendbsdf"><bsdf type="diffuse"/></bsdf></shape>"#,
        "two nested BSDFs, found 1",
    ),
    (
        r#"<shape type="sphere"><bsdf type="diffuse"><rgb name="reflectance" value="^1, 2"/></bsdf></shape>"#,
        "one or three numbers",
    ),
    (
        r#"<shape type="sphere"><bsdf type="diffuse"><spectrum name="reflectance" value="^400:1, 300:2"/></bsdf></shape>"#,
        "wavelengths must increase",
    ),
    (
        r#"<shape type="sphere"><transform name="to_world"><^turn angle="3"/></transform></shape>"#,
        "not a step",
    ),
    (
        r#"<shape type="sphere"><transform name="to_world"><^rotate angle="3"/></transform></shape>"#,
        "axis of the rotation is zero",
    ),
    (
        r#"<shape type="sphere"><transform name="to_world"><^rotate x="1"/></transform></shape>"#,
        "needs `angle`",
    ),
    (
        r#"<shape type="sphere"><transform name="to_world"><matrix value="^1 2 3"/></transform></shape>"#,
        "9 or 16 numbers, found 3",
    ),
    (
        r#"<shape type="sphere"><transform name="to_world"><^lookat origin="0 0 0" target="0 0 0"/></transform></shape>"#,
        "same point",
    ),
    (r#"<shape type="^obj"/>"#, "needs `filename`"),
    (r#"<shape type="obj"><string name="filename" value="^no.obj"/></shape>"#, "mesh not found: no.obj"),
    (
        r#"<shape type="sphere"><bsdf type="diffuse"><texture name="reflectance" type="^bitmp"/></bsdf></shape>"#,
        "unknown texture",
    ),
    (r#"<shape type="^instance"/>"#, "no shape group"),
    (r#"<shape type="sphere"><emitter type="^point"/></shape>"#, "only contain an `area` emitter"),
    (r#"<emitter type="^poit"/>"#, "unknown emitter"),
    (r#"<emitter type="^envmap"/>"#, "needs `filename`"),
    (r#"<emitter type="constant"/><emitter type="^constant"/>"#, "two environments"),
    (r#"<emitter type="spot"><float name="cutoff_angle" value="^200"/></emitter>"#, "cutoff_angle"),
    (r#"<integrator type="^patt"/>"#, "unknown integrator"),
    (
        r#"<integrator type="path"><integer name="max_depth" value="^2.5"/></integrator>"#,
        "expected an integer",
    ),
    (r#"<shape type="sphere"><float name="radius" value="^$r"/></shape>"#, "undefined parameter `$r`"),
    (r#"<include filename="^no.xml"/>"#, "included file not found"),
    (r#"<include filename="^scene.xml"/>"#, "includes itself"),
    (r#"<path value="^nowhere"/>"#, "folder not found"),
    (r#"<bsdf type="twosided" id="a"><ref id="^a"/></bsdf>"#, "contains itself"),
    (r#"<shape type="sphere">^</shap>"#, "expected 'shape' tag, not 'shap'"),
];

#[test]
fn errors_have_line_and_column() {
    for (marked, message) in MISTAKES {
        let (bench, line) = (Bench::new(), marked.replace('^', ""));
        let column = marked.chars().position(|c| c == '^').expect("a mark") + 1;
        bench
            .write("scene.xml", format!("<scene version=\"3.0.0\">{SENSOR}\n<!-- ä -->\n{line}\n</scene>\n"));
        let errors = bench.read().expect_err(marked);
        let first = errors.iter().find(|one| one.severity == Severity::Error).expect("an error");
        assert!(first.message.contains(message), "{marked}: {}", first.message);
        assert_eq!(place(first), (3, column), "{marked}: {}", first.message);
    }
}

#[test]
fn errors_in_included_files_have_their_own_lines() {
    let bench = super::scene(r#"<include filename="parts/a.xml"/>"#);
    bench.write("parts/a.xml", "<scene version=\"3.0.0\">\n<shape type=\"spher\"/></scene>");
    let errors = bench.read().expect_err("a mistake");
    assert_eq!((errors[0].path.clone(), place(&errors[0])), (bench.path("parts/a.xml"), (2, 14)));
}

#[test]
fn all_errors_are_reported() {
    let errors = super::scene(r#"<shape type="a"/><shape type="b"/><emitter type="c"/>"#)
        .read()
        .expect_err("mistakes");
    assert_eq!(errors.len(), 3);
}

#[test]
fn malformed_files_are_rejected() {
    for (text, message) in [
        ("", "root node"),
        ("hello", "unknown token"),
        ("<scene version=\"3.0.0\">", "root"),
        ("<scene/>", "the version is missing"),
        ("<bsdf type=\"diffuse\" version=\"3.0.0\"/>", "the root element is <bsdf>, not <scene>"),
        ("<scene version=\"3.0.0\"/>", "no sensor"),
        ("<!DOCTYPE scene [<!ENTITY a \"b\">]><scene version=\"3.0.0\"/>", "document type declaration"),
    ] {
        let bench = Bench::new();
        bench.write("scene.xml", text);
        let errors = bench.read().expect_err(text);
        assert!(errors[0].message.contains(message), "{text}: {}", errors[0].message);
    }
}

#[test]
fn hostile_files_are_rejected_quickly() {
    let nested = format!("{}{}", "<bsdf type=\"twosided\">".repeat(100_000), "</bsdf>".repeat(100_000));
    let long = format!("<shape type=\"{}\"/>", "a".repeat(5 << 20));
    let doubling: String = (0..40)
        .map(|index| format!("<default name=\"p{}\" value=\"$p{index}$p{index}\"/>", index + 1))
        .collect();
    let doubling =
        format!("<default name=\"p0\" value=\"xxxxxxxx\"/>{doubling}<string name=\"a\" value=\"$p40\"/>");
    for (content, message) in
        [(&nested, "nested more than"), (&long, "attribute is longer"), (&doubling, "too long")]
    {
        let started = std::time::Instant::now();
        let errors = super::scene(content).read().expect_err(message);
        assert!(errors[0].message.contains(message), "{}", errors[0].message);
        assert!(started.elapsed().as_secs() < 20, "{message}");
    }
}

#[test]
fn include_bombs_are_rejected() {
    let bench = super::scene(r#"<include filename="0.xml"/>"#);
    for index in 0..14 {
        let include = format!("<include filename=\"{}.xml\"/>", index + 1);
        bench.write(
            &format!("{index}.xml"),
            format!("<scene version=\"3.0.0\">{}</scene>", include.repeat(20)),
        );
    }
    bench.write("14.xml", "<scene version=\"3.0.0\"/>");
    let errors = bench.read().expect_err("too many files");
    assert!(errors.iter().any(|one| one.message.contains("files are included")), "{}", errors[0].message);
}
