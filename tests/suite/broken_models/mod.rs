//! About twenty malformed and hostile models per format. Each is either read or rejected with an error that
//! names the file and position. Memory use must stay proportional to the file size.

mod cases;

use std::fs;
use std::path::Path;

use glimt::assets::gltf::GltfFile;
use glimt::assets::mesh::load;
use glimt::control::{CancelToken, ignore_progress};
use serde_json::{Value, json};

use self::cases::{every_byte, mtl, obj, off, ply, stl};

/// A JSON pointer, the value to set, and part of the expected message.
const EDITS: &[(&str, &str, &str)] = &[
    ("/asset/version", r#""1.0""#, r#"glTF 1.0 is not supported; version 2 is required"#),
    ("/nodes/0/mesh", r#"7"#, r#"nodes[0]: meshes[7] does not exist; meshes has length 1"#),
    ("/nodes/0/mesh", r#"-1"#, r#"invalid value: integer `-1`"#),
    ("/nodes/0/children", r#"[0]"#, r#"nodes: there is no root because every node is a child"#),
    ("/nodes/0/children", r#"[9]"#, r#"nodes[9] does not exist; nodes has length 1"#),
    (
        "/meshes/0/primitives/0/attributes/POSITION",
        r#"9"#,
        r#"meshes[0].primitives[0]: POSITION: accessors[9] does not exist; accessors has length 2"#,
    ),
    (
        "/meshes/0/primitives/0/indices",
        r#"9"#,
        r#"meshes[0].primitives[0]: indices: accessors[9] does not exist; accessors has length 2"#,
    ),
    (
        "/meshes/0/primitives/0/indices",
        r#"0"#,
        r#"meshes[0].primitives[0]: indices: indices must be integers"#,
    ),
    (
        "/meshes/0/primitives/0/attributes",
        r#"{"NORMAL": 0}"#,
        r#"meshes[0].primitives[0]: it has no positions"#,
    ),
    ("/accessors/0/componentType", r#"5124"#, r#"accessors[0]: unknown component type 5124"#),
    ("/accessors/0/type", r#""VEC9""#, r#"accessors[0]: unknown type "VEC9""#),
    ("/accessors/0/count", r#"4000000000"#, r#"accessors[0]: 4000000000 elements at byte 0 need"#),
    (
        "/accessors/0/bufferView",
        r#"9"#,
        r#"accessors[0]: bufferViews[9] does not exist; bufferViews has length 2"#,
    ),
    (
        "/accessors/0/byteOffset",
        r#"1000000000000"#,
        r#"accessors[0]: 3 elements at byte 1000000000000 need 36 bytes, but bufferViews[0] has 36"#,
    ),
    ("/bufferViews/0/buffer", r#"9"#, r#"bufferViews[0]: buffers[9] does not exist; buffers has length 1"#),
    (
        "/bufferViews/0/byteLength",
        r#"4000000000"#,
        r#"bufferViews[0]: bytes 0 + 4000000000 exceed buffers[0], which has 44 bytes"#,
    ),
    (
        "/bufferViews/0/byteStride",
        r#"4"#,
        r#"bufferViews[0]: invalid stride of 4 bytes for 12-byte elements"#,
    ),
    ("/buffers/0/byteLength", r#"4000000000"#, r#"buffers[0]: it claims 4000000000 bytes but has 44"#),
    ("/buffers/0/uri", r#""/etc/passwd""#, r#"buffers[0]: "/etc/passwd" is not a relative URI"#),
    ("/buffers/0/uri", r#""data:;base64,%%%%""#, r#"invalid base64 byte"#),
    ("/scene", r#"3"#, r#""#),
    (
        "/meshes/0/primitives/0/material",
        r#"4"#,
        r#"nodes[0]: materials[4] does not exist; materials has length 0"#,
    ),
    (
        "/extensionsRequired",
        r#"["KHR_draco_mesh_compression"]"#,
        r#"KHR_draco_mesh_compression is not supported; export it without Draco compression"#,
    ),
];

/// A glTF file with one triangle.
fn triangle() -> Value {
    let numbers = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIAAAA=";
    json!({
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"}
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
        "buffers": [{"byteLength": 44, "uri": format!("data:;base64,{numbers}")}]
    })
}

/// The error from reading a file, with the folder stripped from its path. Empty if the file can be read.
fn read_error(folder: &Path, name: &str, content: &[u8]) -> String {
    let (path, token) = (folder.join(name), CancelToken::new());
    fs::write(&path, content).expect("written");
    let read = match name.ends_with("gltf") || name.ends_with("glb") {
        true => GltfFile::open(&path, &ignore_progress, &token)
            .and_then(|file| file.convert_scene(&token))
            .map(drop),
        false => load(&path, &ignore_progress, &token).map(drop),
    };
    let message = read.map_or_else(|error| error.to_string(), |()| String::new());
    message.replace(&format!("{}/", folder.display()), "")
}

#[test]
fn malformed_meshes_have_expected_errors() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, cases) in [("a.obj", obj()), ("a.off", off()), ("a.ply", ply()), ("a.stl", stl())] {
        assert!(cases.len() >= 20, "{name}");
        for (what, content, expected) in cases {
            assert_eq!(read_error(folder.path(), name, &content), expected, "{name}: {what}");
        }
    }
}

#[test]
fn malformed_mtl_files_have_expected_errors() {
    let folder = tempfile::tempdir().expect("a folder");
    let obj = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n";
    let cases = mtl();
    assert!(cases.len() >= 16);
    for (what, content, expected) in cases {
        fs::write(folder.path().join("a.mtl"), content).expect("written");
        assert_eq!(read_error(folder.path(), "a.obj", obj), expected, "{what}");
    }
}

#[test]
fn malformed_gltf_has_expected_errors() {
    let folder = tempfile::tempdir().expect("a folder");
    assert_eq!(read_error(folder.path(), "a.gltf", triangle().to_string().as_bytes()), "");
    for &(place, value, expected) in EDITS {
        let mut json = triangle();
        let value: Value = serde_json::from_str(value).expect("JSON");
        match json.pointer_mut(place) {
            Some(there) => *there = value,
            None => {
                let (list, key) = place.rsplit_once('/').expect("a place");
                json.pointer_mut(list).expect("a list")[key] = value;
            }
        }
        let message = read_error(folder.path(), "a.gltf", json.to_string().as_bytes());
        let names_both = message.starts_with("a.gltf:") && message.contains(expected);
        assert!(
            names_both || expected.is_empty() && message.is_empty(),
            "{place} = {value:?}: {message}",
            value = json.pointer(place)
        );
    }
    for (text, expected) in [
        ("{", "a.gltf:1: column 1: EOF while parsing an object"),
        ("{\"a\": 1}", "a.gltf: not a glTF file: asset.version is missing"),
        ("[]", "a.gltf: not a glTF file: neither GLB nor a JSON object"),
        (" ", "a.gltf: not a glTF file: neither GLB nor a JSON object"),
        ("", "a.gltf: the file is empty"),
        ("{\"asset\": {\"version\": \"2.0\"}} x", "a.gltf:1: column 31: trailing characters"),
    ] {
        assert_eq!(read_error(folder.path(), "a.gltf", text.as_bytes()), expected);
    }
}

/// GLB files with invalid headers and chunks.
#[test]
fn malformed_glb_has_expected_errors() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut json = triangle();
    json["buffers"][0] = json!({"byteLength": 44});
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let numbers = [0, 0, 0, 0x3f80_0000, 0, 0, 0, 0x3f80_0000, 0, 0x0001_0000, 2_u32];
    let binary: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    let chunk = |kind: &[u8; 4], claimed: usize, bytes: &[u8]| {
        [&(claimed as u32).to_le_bytes()[..], kind, bytes].concat()
    };
    let file = |head: &[u8], chunks: &[Vec<u8>]| [head, &chunks.concat()].concat();
    let head = b"glTF\x02\0\0\0\0\0\0\0";
    let (own, rest) = (chunk(b"JSON", text.len(), &text), chunk(b"BIN\0", 44, &binary));
    let short = chunk(b"BIN\0", 44, &binary[..40]);
    let (long_text, long_rest) = (chunk(b"JSON", 1 << 31, &text), chunk(b"BIN\0", 1 << 31, &binary));
    let broken = chunk(b"JSON", 8, b"{\"a\": 1]");
    let empty = chunk(b"JSON", 0, b"");
    let all = file(head, &[own.clone(), rest.clone()]);
    let has = text.len() + 44 + 8;
    let claims = |at: usize, has: usize| {
        format!("a.glb: the chunk at byte {at} claims 2147483648 bytes, but only {has} remain")
    };
    let place = 12 + own.len();
    let cases: Vec<(&str, Vec<u8>, String)> = vec![
        ("whole", all.clone(), String::new()),
        (
            "an unknown chunk first",
            file(head, &[own.clone(), chunk(b"MINE", 4, b"abcd"), rest.clone()]),
            String::new(),
        ),
        ("two of each", file(head, &[own.clone(), rest.clone(), own.clone(), rest.clone()]), String::new()),
        ("only the magic number", b"glTF".to_vec(), "a.glb: the file ends inside the header".to_owned()),
        ("truncated version", b"glTF\x02\0".to_vec(), "a.glb: the file ends inside the header".to_owned()),
        (
            "version 1",
            file(b"glTF\x01\0\0\0\0\0\0\0", std::slice::from_ref(&own)),
            "a.glb: GLB version 1 is not supported; version 2 is required".to_owned(),
        ),
        (
            "version 4294967295",
            file(b"glTF\xff\xff\xff\xff\0\0\0\0", &[]),
            "a.glb: GLB version 4294967295 is not supported; version 2 is required".to_owned(),
        ),
        ("no chunk", head.to_vec(), "a.glb: the JSON chunk is missing".to_owned()),
        (
            "truncated chunk header",
            file(head, &[own[..6].to_vec()]),
            "a.glb: the JSON chunk is missing".to_owned(),
        ),
        ("no JSON", file(head, std::slice::from_ref(&rest)), "a.glb: the JSON chunk is missing".to_owned()),
        (
            "only an unknown chunk",
            file(head, &[chunk(b"MINE", 4, b"abcd")]),
            "a.glb: the JSON chunk is missing".to_owned(),
        ),
        ("2 GiB of JSON claimed", file(head, &[long_text, rest.clone()]), claims(12, has)),
        ("2 GiB of binary data claimed", file(head, &[own.clone(), long_rest]), claims(place, 44)),
        (
            "truncated binary data",
            file(head, &[own.clone(), short]),
            format!("a.glb: the chunk at byte {place} claims 44 bytes, but only 40 remain"),
        ),
        (
            "truncated JSON",
            all[..200].to_vec(),
            format!("a.glb: the chunk at byte 12 claims {} bytes, but only 180 remain", text.len()),
        ),
        (
            "no numbers",
            file(head, std::slice::from_ref(&own)),
            "a.glb: buffers[0]: it has neither a URI nor a binary chunk".to_owned(),
        ),
        (
            "fewer numbers",
            file(head, &[own, chunk(b"BIN\0", 40, &binary[..40])]),
            "a.glb: buffers[0]: it claims 44 bytes but has 40".to_owned(),
        ),
        (
            "broken JSON",
            file(head, &[broken, rest.clone()]),
            "a.glb:1: column 8: expected `,` or `}`".to_owned(),
        ),
        (
            "an empty JSON chunk",
            file(head, &[empty, rest]),
            "a.glb: not a glTF file: the JSON is not an object".to_owned(),
        ),
        ("every byte", every_byte(), "a.glb: not a glTF file: neither GLB nor a JSON object".to_owned()),
        ("nothing", Vec::new(), "a.glb: the file is empty".to_owned()),
    ];
    assert!(cases.len() >= 20);
    for (what, content, expected) in cases {
        assert_eq!(read_error(folder.path(), "a.glb", &content), expected, "{what}");
    }
}
