//! Opening files.

use super::*;

#[test]
fn unknown_required_extensions_are_rejected() {
    let mut json = square();
    json["extensionsRequired"] =
        json!(["KHR_texture_transform", "KHR_materials_sheen", "KHR_mesh_quantization"]);
    assert!(open_json(&json).is_ok());
    json["extensionsRequired"] = json!(["KHR_texture_transform", "FOO_bar"]);
    assert_eq!(error(&json), unknown_extension_message("FOO_bar"));
}

#[test]
fn old_versions_and_wrong_types_are_rejected() {
    let old = json!({"asset": {"version": "1.0"}, "nodes": {"a": {}}, "meshes": {}});
    assert_eq!(error(&old), unsupported_version_message("1.0"));
    for (pointer, value, rust, json_terms) in [
        (
            "/nodes/0/mesh",
            json!("a"),
            "string \"a\", expected usize",
            "string \"a\", expected a nonnegative integer",
        ),
        (
            "/nodes/0/translation/0",
            json!("a"),
            "string \"a\", expected f64",
            "string \"a\", expected a number",
        ),
        ("/nodes", json!({}), "map, expected a sequence", "object, expected an array"),
        ("/nodes/0", json!(7), "integer `7`, expected struct JsonNode", "integer `7`, expected an object"),
    ] {
        assert_eq!(
            replace_rust_terms(&format!("invalid type: {rust}")),
            format!("invalid type: {json_terms}")
        );
        let mut json = square();
        *json.pointer_mut(pointer).expect("a place") = value;
        assert!(error(&json).ends_with(json_terms), "{pointer}: {}", error(&json));
    }
    let mut flat = square();
    flat["accessors"][0]["type"] = json!("VEC2");
    assert!(error(&flat).ends_with(&part::expected_vec3_message(2)), "{}", error(&flat));
}

/// Some programs write unpadded chunks, or extra bytes past the length declared in the header.
#[test]
fn unpadded_chunks_and_trailers_are_accepted() {
    let folder = GltfDir::new();
    let mut json = square();
    json["buffers"][0].as_object_mut().expect("an object").remove("uri");
    let expected = part(&folder.open("a.glb", &glb(&json, &bytes())).expect("read"), 0).expect("a mesh").mesh;
    let text = json.to_string();
    for blanks in 0..4 {
        let text = format!("{text}{}", " ".repeat(blanks));
        let mut file = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
        for (kind, chunk) in [(b"JSON", text.as_bytes()), (b"BIN\0", &bytes())] {
            file.extend((chunk.len() as u32).to_le_bytes());
            file.extend(kind);
            file.extend(chunk);
        }
        let length = (file.len() as u32).to_le_bytes();
        file[8..12].copy_from_slice(&length);
        let mesh = |file: &[u8]| part(&folder.open("a.glb", file)?, 0).map(|loaded| loaded.mesh);
        assert_eq!(mesh(&file).expect("read"), expected, "{blanks}");
        file.extend(b"trailing");
        assert_eq!(mesh(&file).expect("read"), expected, "{blanks}");
    }
}

/// Errors include the image index if the image is missing, or damaged after its header.
#[test]
fn image_errors_include_the_image_index() {
    let folder = GltfDir::new();
    let mut json = square();
    let mut png = Vec::new();
    let pixels = ::image::RgbImage::from_fn(8, 8, |x, y| ::image::Rgb([x as u8 * 9, y as u8 * 7, 3]));
    pixels.write_to(&mut std::io::Cursor::new(&mut png), ::image::ImageFormat::Png).expect("written");
    folder.write("whole", &png);
    let end = png.len() - 20;
    png[end] ^= 255;
    folder.write("damaged.png", &png);
    json["images"] = json!([
        {"uri": "none.png"}, {"uri": "damaged.png"}, {"uri": coded(&png)}, {"uri": "whole"}, {"bufferView": 0}
    ]);
    let container = folder.open("a.gltf", json.to_string().as_bytes()).expect("read");
    let token = CancelToken::new();
    let check = |number, part: &str| {
        let (_, reason) = expect_rejection(container.check_image_decodes(number, &token));
        assert!(reason.starts_with(&format!("images[{number}]: ")) && reason.contains(part), "{reason}");
        assert!(!reason.contains("ChunkType"), "{reason}");
    };
    check(0, "none.png");
    check(1, "damaged.png");
    check(2, "8 × 8");
    check(4, &image::messages::unknown_format_message());
    assert!(container.check_image_decodes(3, &token).is_ok());
    assert!(
        container.check_image_header(1, &token).is_ok() && container.check_image_header(0, &token).is_err()
    );
}

#[test]
fn truncated_and_invalid_glbs_are_rejected() {
    let folder = GltfDir::new();
    let mut json = square();
    json["buffers"][0].as_object_mut().expect("an object").remove("uri");
    let complete = glb(&json, &bytes());
    for length in (4..complete.len()).step_by(7) {
        let opened = folder.open("a.glb", &complete[..length]);
        assert!(opened.is_err(), "{length}");
    }
    let mut old = complete;
    old[4] = 1;
    assert_eq!(expect_rejection(folder.open("a.glb", &old)).1, unsupported_glb_message(1));
    assert_eq!(expect_rejection(folder.open("a.glb", b"PK\x03\x04")).1, NEITHER_GLB_NOR_JSON);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    /// Fuzzes a file, which is then either read or rejected but never causes a panic.
    #[test]
    fn fuzzed_files_never_panic(changes in proptest::collection::vec((any::<u16>(), any::<u8>()), 1..8), cut in any::<u16>()) {
        let mut json = square();
        json["buffers"][0].as_object_mut().expect("an object").remove("uri");
        let mut file = glb(&json, &bytes());
        for (place, byte) in changes {
            let place = usize::from(place) % file.len();
            // Mutations that replace digits with digits often keep the JSON valid.
            file[place] = if file[place].is_ascii_digit() { b'0' + byte % 10 } else { byte };
        }
        if cut % 4 == 0 {
            file.truncate(usize::from(cut) % file.len());
        }
        if let Ok(container) = GltfDir::new().open("a.glb", &file) {
            let _ = scene(&container);
            let _ = container.merge_scene_into_mesh(&CancelToken::new());
            for number in 0..container.part_count() {
                let _ = part(&container, number);
            }
        }
    }
}

#[test]
fn listing_references_reads_only_the_json() {
    let folder = GltfDir::new();
    let mut json = square();
    json["buffers"] = serde_json::json!([{"uri": "deep/a.bin", "byteLength": 9}, {"byteLength": 1, "uri": "data:;base64,AA=="}]);
    json["images"] = serde_json::json!([{"uri": "a%20b.png"}, {"bufferView": 0}, {"uri": "/etc/passwd"}]);
    let text = json.to_string();
    let files = |name: &str, bytes: &[u8]| {
        // The buffers are missing.
        assert!(folder.open(name, bytes).is_err());
        let path = folder.0.path().join(name);
        let folder = path.parent().expect("a folder").to_owned();
        let files = super::referenced_files(&path, &CancelToken::new()).expect("not canceled").into_iter();
        files.map(|file| file.strip_prefix(&folder).expect("in the folder").to_owned()).collect::<Vec<_>>()
    };
    let expected = [std::path::PathBuf::from("deep/a.bin"), "a b.png".into()];
    assert_eq!(files("a.gltf", text.as_bytes()), expected);
    assert_eq!(files("b.gltf", format!("\u{feff}{text}").as_bytes()), expected);
    // A truncated binary chunk is not read.
    let complete = glb(&json, &bytes());
    assert_eq!(files("a.glb", &complete[..complete.len() - 3]), expected);
    // Errors outside the URIs do not matter.
    json["nodes"] = serde_json::json!([{"matrix": "none"}]);
    json["buffers"][0]["byteLength"] = serde_json::json!(-1);
    json["images"][1]["uri"] = serde_json::Value::Null;
    assert_eq!(files("c.gltf", json.to_string().as_bytes()), expected);
    assert_eq!(files("d.gltf", b"{"), Vec::<PathBuf>::new());
    let none = folder.0.path().join("none.glb");
    assert_eq!(
        super::referenced_files(&none, &CancelToken::new()).expect("not canceled"),
        Vec::<PathBuf>::new()
    );
    let token = CancelToken::new();
    token.cancel();
    assert!(super::referenced_files(&folder.0.path().join("a.gltf"), &token).is_err());
}

#[test]
fn newer_versions_are_rejected() {
    let mut json = square();
    for (asset, is_read) in [
        (json!({"version": "2.0", "minVersion": "2.0"}), true),
        (json!({"version": "2.3"}), true),
        (json!({"version": "2.0", "minVersion": "2"}), true),
        (json!({"version": "2.0", "minVersion": "1.0"}), true),
        (json!({"version": "2.1", "minVersion": "2.1"}), false),
        (json!({"version": "2.10", "minVersion": "3.0"}), false),
    ] {
        json["asset"] = asset.clone();
        match open_json(&json) {
            Ok(_) => assert!(is_read, "{asset}"),
            Err(error) => {
                assert!(!is_read, "{asset}: {error}");
                let required = asset["minVersion"].as_str().expect("text");
                assert_eq!(expect_rejection(Err::<(), _>(error)).1, newer_version_required_message(required));
            }
        }
    }
    json["asset"] = json!({"version": "2.0", "minVersion": "x"});
    assert_eq!(error(&json), invalid_min_version_message("x"));
}

#[test]
fn unknown_camera_types_produce_a_note() {
    let mut json = square();
    json["nodes"][0]["camera"] = json!(0);
    for camera in [json!({"type": "panorama"}), json!({"type": "perspective"}), json!({})] {
        json["cameras"] = json!([camera]);
        let scene = scene(&open_json(&json).expect("read")).expect("a scene");
        assert!(scene.cameras.is_empty());
        assert!(scene.notes.iter().any(|note| note.ends_with(UNKNOWN_CAMERA)), "{:?}", scene.notes);
    }
}
