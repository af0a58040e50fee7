mod container;

use std::fs;
use std::path::PathBuf;

use proptest::prelude::*;
use serde_json::{Value, json};

use super::accessor::{too_many_viewless_elements_message, view_too_short_message};
use super::container::*;
use super::model::UNKNOWN_CAMERA;
use super::*;
use crate::assets::{LoadedMesh, expect_rejection};
use crate::math::{DVec3, Vec2, Vec3};
use crate::system::file::FileStamp;

/// A temporary folder with glTF files.
struct GltfDir(tempfile::TempDir);

impl GltfDir {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, bytes).expect("written");
        path
    }

    fn open(&self, name: &str, bytes: &[u8]) -> Result<GltfFile, AssetError> {
        GltfFile::open(&self.write(name, bytes), &ignore_progress, &CancelToken::new())
    }
}

fn open_json(json: &Value) -> Result<GltfFile, AssetError> {
    GltfDir::new().open("a.gltf", json.to_string().as_bytes())
}

fn part(container: &GltfFile, number: usize) -> Result<LoadedMesh, AssetError> {
    container.build_part_mesh(number, &ignore_progress, &CancelToken::new())
}

fn scene(container: &GltfFile) -> Result<ModelScene, AssetError> {
    container.convert_scene(&CancelToken::new())
}

/// Returns the error from opening a file, converting its scene or building its first part.
fn error(json: &Value) -> String {
    let all = || {
        let container = open_json(json)?;
        scene(&container)?;
        part(&container, 0).map(drop)
    };
    expect_rejection(all()).1
}

/// Buffer for a square: four positions, six indices and four texture coordinates.
fn bytes() -> Vec<u8> {
    let mut bytes = Vec::new();
    for number in [0.0_f32, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 1.0, 0.0] {
        bytes.extend(number.to_le_bytes());
    }
    for index in [0_u16, 1, 2, 0, 2, 3] {
        bytes.extend(index.to_le_bytes());
    }
    for number in [0.0_f32, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0] {
        bytes.extend(number.to_le_bytes());
    }
    bytes
}

fn coded(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = "data:application/octet-stream;base64,".to_owned();
    for group in bytes.chunks(3) {
        let number =
            group.iter().fold(0_u32, |all, byte| all << 8 | u32::from(*byte)) << (8 * (3 - group.len()));
        (0..=group.len())
            .for_each(|digit| text.push(DIGITS[(number >> (18 - 6 * digit) & 63) as usize] as char));
    }
    text
}

/// A glTF file that contains the square.
fn square() -> Value {
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "square", "mesh": 0, "translation": [1, 2, 3]}],
        "meshes": [{"name": "plate", "primitives": [
            {"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1}
        ]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2"}
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 12},
            {"buffer": 0, "byteOffset": 60, "byteLength": 32}
        ],
        "buffers": [{"byteLength": 92, "uri": coded(&bytes())}]
    })
}

/// A GLB file with a JSON chunk and a binary chunk.
fn glb(json: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut file = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
    for (kind, chunk) in [(b"JSON", &text[..]), (b"BIN\0", binary)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    file
}

#[test]
fn parts_do_not_depend_on_buffer_storage() {
    let folder = GltfDir::new();
    let embedded =
        part(&folder.open("a.gltf", square().to_string().as_bytes()).expect("read"), 0).expect("a mesh");
    assert_eq!(
        embedded.mesh.positions,
        [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]].map(|[x, y]| Vec3::new(x, y, 0.0))
    );
    assert_eq!(embedded.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    // glTF measures v from the top.
    assert_eq!(embedded.mesh.uvs, [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
    let mut binary = square();
    binary["buffers"][0].as_object_mut().expect("an object").remove("uri");
    let container = folder.open("b.glb", &glb(&binary, &bytes())).expect("read");
    assert_eq!(part(&container, 0).expect("a mesh").mesh, embedded.mesh);
    let mut external = square();
    external["buffers"][0]["uri"] = json!("a%20b.bin");
    let file = folder.write("a b.bin", &bytes());
    let container = folder.open("c.gltf", external.to_string().as_bytes()).expect("read");
    let loaded = part(&container, 0).expect("a mesh");
    let hash = Some(*blake3::hash(&bytes()).as_bytes());
    let stamp = FileStamp::from_path(&file);
    assert_eq!(
        (loaded.mesh, loaded.companions),
        (embedded.mesh, vec![Companion { path: file, hash, stamp }])
    );
}

#[test]
fn strips_and_fans_keep_their_orientation() {
    for (mode, expected) in [(5, [[0, 1, 2], [2, 1, 3]]), (6, [[0, 1, 2], [0, 2, 3]])] {
        let mut json = square();
        json["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        json["meshes"][0]["primitives"][0].as_object_mut().expect("an object").remove("indices");
        let mesh = part(&open_json(&json).expect("read"), 0).expect("a mesh").mesh;
        let rotations = |[a, b, c]: [u32; 3]| [[a, b, c], [b, c, a], [c, a, b]];
        assert!(
            mesh.triangles.iter().zip(expected).all(|(found, wanted)| rotations(wanted).contains(found)),
            "{mode}"
        );
    }
}

#[test]
fn normalized_and_sparse_accessors_are_read() {
    let mut json = square();
    // Normalized bytes as positions (KHR_mesh_quantization), with one sparse replacement.
    let quantized: Vec<u8> = vec![0, 0, 0, 0, 255, 0, 0, 0, 255, 255, 0, 0, 0, 255, 0, 0];
    let sparse = [&2_u32.to_le_bytes()[..], &[128, 255, 0, 0]].concat();
    let all = [quantized, sparse, bytes()].concat();
    json["buffers"][0] = json!({"byteLength": all.len(), "uri": coded(&all)});
    json["bufferViews"] = json!([
        {"buffer": 0, "byteLength": 16, "byteStride": 4},
        {"buffer": 0, "byteOffset": 72, "byteLength": 12},
        {"buffer": 0, "byteOffset": 84, "byteLength": 32},
        {"buffer": 0, "byteOffset": 16, "byteLength": 4},
        {"buffer": 0, "byteOffset": 20, "byteLength": 4}
    ]);
    json["accessors"][0] = json!({"bufferView": 0, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC3",
        "sparse": {"count": 1, "indices": {"bufferView": 3, "componentType": 5125}, "values": {"bufferView": 4}}});
    let mesh = part(&open_json(&json).expect("read"), 0).expect("a mesh").mesh;
    let third = Vec3::new(128.0 / 255.0, 1.0, 0.0);
    assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::X, third, Vec3::Y]);
}

#[test]
fn hidden_nodes_hide_their_descendants() {
    let visible = |visible: bool| json!({"KHR_node_visibility": {"visible": visible}});
    let mut json = square();
    json["extensionsRequired"] = json!(["KHR_node_visibility"]);
    json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}});
    json["cameras"] = json!([{"perspective": {"yfov": 0.5}}]);
    let mut lit = visible(true);
    lit["KHR_lights_punctual"] = json!({"light": 0});
    json["nodes"] = json!([
        {"name": "shown", "mesh": 0, "children": [1, 4], "extensions": visible(true)},
        {"name": "hidden", "mesh": 0, "children": [2, 3], "extensions": visible(false)},
        {"name": "below", "mesh": 0, "camera": 0, "extensions": lit, "children": [5]},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}},
        {"name": "last", "mesh": 0, "extensions": {"KHR_node_visibility": {}}},
        {"name": "far", "mesh": 0, "scale": [1e20, 1, 1]}
    ]);
    let scene = scene(&open_json(&json).expect("read")).expect("a scene");
    let names: Vec<&str> = scene.instances.iter().map(|instance| instance.name.as_str()).collect();
    assert_eq!(names, ["shown", "last"]);
    assert_eq!((scene.lights.len(), scene.cameras.len()), (0, 1), "cameras are not hidden");
}

#[test]
fn buffers_may_look_like_utf16() {
    let folder = GltfDir::new();
    // Two 16-bit numbers that look like letters in UTF-16.
    let mut json = square();
    json["bufferViews"][0]["byteOffset"] = json!(4);
    json["bufferViews"][1]["byteOffset"] = json!(52);
    json["bufferViews"][2]["byteOffset"] = json!(64);
    json["buffers"][0] = json!({"byteLength": 96, "uri": "a.bin"});
    folder.write("a.bin", &[&[b'a', 0, b'b', 0], &bytes()[..]].concat());
    let container = folder.open("a.gltf", json.to_string().as_bytes()).expect("read");
    assert_eq!(part(&container, 0).expect("a mesh").mesh.positions.len(), 4);
}

#[test]
fn nodes_transform_parts_cameras_and_lights() {
    let mut json = square();
    json["nodes"] = json!([
        {"children": [1, 2, 3], "rotation": [0, 0.707_106_781_186_547_5, 0, 0.707_106_781_186_547_5], "scale": [2, 2, 2]},
        {"name": "plate", "mesh": 0, "translation": [1, 0, 0]},
        {"camera": 0, "translation": [0, 0, 5]},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}}
    ]);
    json["cameras"] = json!([{"perspective": {"yfov": 0.5, "aspectRatio": 1.5}}]);
    json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "spot", "intensity": 7, "color": [1, 0.5, 0], "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.4}}
    ]}});
    let scene = scene(&open_json(&json).expect("read")).expect("a scene");
    // A quarter turn about y maps x to −z and z to x.
    let near = |a: DVec3, b: DVec3| (a - b).length() < 1e-12;
    let plate = &scene.instances[0];
    assert!(near(plate.placed.transform_point(DVec3::ZERO), DVec3::new(0.0, 0.0, -2.0)));
    assert!(near(plate.placed.transform_point(DVec3::new(2.0, 1.0, 0.0)), DVec3::new(0.0, 2.0, -6.0)));
    assert_eq!((plate.name.as_str(), plate.has_normals, plate.has_colors), ("plate", false, false));
    let camera = &scene.cameras[0];
    assert!(near(camera.position, DVec3::new(10.0, 0.0, 0.0)) && near(camera.direction, DVec3::NEG_X));
    let fov = 0.5_f64.to_degrees();
    assert_eq!((camera.projection, camera.aspect), (ModelProjection::Perspective { fov }, Some(1.5)));
    let light = &scene.lights[0];
    assert_eq!(light.intensity, DVec3::new(7.0, 3.5, 0.0));
    assert_eq!(light.kind, ModelLightKind::Spot { angle: 0.8_f64.to_degrees(), blend: 0.5 });
    let [min, max] = scene.bounds.expect("bounds");
    assert!(near(min, DVec3::new(0.0, 0.0, -6.0)) && near(max, DVec3::new(0.0, 2.0, -2.0)));
}

#[test]
fn material_extensions_are_converted() {
    let mut json = square();
    json["meshes"][0]["primitives"][0]["material"] = json!(0);
    json["textures"] = json!([{"source": 0, "sampler": 0}]);
    json["samplers"] = json!([{"magFilter": 9728, "wrapS": 33071, "wrapT": 33071}]);
    json["images"] = json!([{"uri": "a.png", "name": "paint"}]);
    json["materials"] = json!([{
        "name": "all", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25,
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 0.5], "baseColorTexture": {"index": 0},
            "metallicFactor": 0.5, "roughnessFactor": 0.25, "metallicRoughnessTexture": {"index": 0}},
        "normalTexture": {"index": 0, "scale": 2}, "emissiveFactor": [1, 0.5, 0],
        "extensions": {
            "KHR_materials_ior": {"ior": 1.33}, "KHR_materials_emissive_strength": {"emissiveStrength": 4},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.75, "clearcoatRoughnessFactor": 0.125},
            "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 0, 0]},
            "KHR_materials_transmission": {"transmissionFactor": 0.25}, "KHR_materials_sheen": {}, "MY_own": {"a": [1]}
        }
    }]);
    let scene = scene(&open_json(&json).expect("read")).expect("a scene");
    let material = &scene.materials[0];
    let texture = material.color.texture.as_ref().expect("a texture");
    assert_eq!((texture.image, texture.is_nearest, texture.wrap), (0, true, TextureWrap::Clamp));
    assert_eq!(material.color.factor, DVec3::new(0.5, 0.25, 1.0));
    assert_eq!((material.metallic.factor.x, material.roughness.factor.x), (0.5, 0.25));
    assert_eq!((material.ior, material.emission.factor), (1.33, DVec3::new(4.0, 2.0, 0.0)));
    assert_eq!((material.clearcoat.factor.x, material.clearcoat_roughness.factor.x), (0.75, 0.125));
    assert_eq!((material.specular.factor.x, material.specular_color.factor), (0.5, DVec3::X));
    assert_eq!(
        (material.transmission.factor.x, material.normal_strength, material.is_two_sided),
        (0.25, 2.0, true)
    );
    let AlphaMode::Mask { value, cutoff } = &material.alpha else { panic!("a mask") };
    assert_eq!((value.factor.x, *cutoff, value.texture.is_some()), (0.5, 0.25, true));
    let notes = ["sheen is ignored".to_owned(), materials::extension_ignored_note("MY_own")];
    assert_eq!(scene.notes, notes.map(|note| format!("materials[0]: {note}")));
    assert_eq!(scene.images, ["paint"]);
}

/// A mesh keeps the two texture coordinate sets used by its material, in ascending order.
#[test]
fn two_used_texture_coordinate_sets_are_kept() {
    let mut json = square();
    json["textures"] = json!([{"source": 0}]);
    json["images"] = json!([{"uri": "a.png"}]);
    // Sets 0, 1 and 2 contain the same numbers in different orders.
    let primitive = json!({"attributes": {"POSITION": 0, "TEXCOORD_0": 2, "TEXCOORD_1": 3, "TEXCOORD_2": 4}, "indices": 1, "material": 0});
    json["meshes"][0]["primitives"][0] = primitive;
    for turned in [8, 16] {
        let accessor =
            json!({"bufferView": 2, "byteOffset": turned, "componentType": 5126, "count": 4, "type": "VEC2"});
        json["accessors"].as_array_mut().expect("a list").push(accessor);
    }
    json["bufferViews"][2]["byteLength"] = json!(48);
    json["buffers"][0]["byteLength"] = json!(108);
    let more: Vec<u8> = [0.5_f32, 0.5, 0.25, 0.5].iter().flat_map(|number| number.to_le_bytes()).collect();
    json["buffers"][0]["uri"] = json!(coded(&[bytes(), more].concat()));
    let mut read = |sets: [u32; 3]| {
        let texture = |set: u32| json!({"index": 0, "texCoord": set});
        json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": texture(sets[0]), "metallicRoughnessTexture": texture(sets[1])},
            "normalTexture": texture(sets[2])}]);
        let container = open_json(&json).expect("read");
        let mesh = part(&container, 0).expect("a mesh").mesh;
        let scene = scene(&container).expect("a scene");
        let material = &scene.materials[0];
        let textures = [&material.color.texture, &material.roughness.texture, &material.normal];
        let second = textures.map(|texture| texture.as_ref().expect("a texture").is_second);
        (mesh.uvs, mesh.second_uvs, second, scene.notes.len())
    };
    let (zero, one, second, notes) = read([0, 0, 0]);
    assert_eq!((zero.len(), one.len(), second, notes), (4, 4, [false; 3], 0));
    assert_ne!(zero, one);
    assert_eq!(read([0, 1, 1]), (zero.clone(), one.clone(), [false, true, true], 0));
    assert_eq!(read([1, 0, 1]), (zero.clone(), one.clone(), [true, false, true], 0));
    assert_eq!(
        read([1, 1, 1]),
        (one.clone(), zero.clone(), [false; 3], 0),
        "the only used set should be first"
    );
    let (first, two, second, notes) = read([2, 0, 2]);
    assert_eq!((&first, second, notes), (&zero, [true, false, true], 0));
    assert!(two != zero && two != one);
    assert_eq!(read([0, 1, 2]), (zero, one, [false, true, false], 1), "a third set should add a note");
}

#[test]
fn scenes_merge_into_one_mesh() {
    let mut json = square();
    json["nodes"] = json!([{"children": [1, 2]}, {"mesh": 0}, {"mesh": 0, "scale": [-1, 1, 1], "translation": [0, 5, 0]}]);
    let merged = open_json(&json).expect("read").merge_scene_into_mesh(&CancelToken::new()).expect("a mesh");
    assert_eq!((merged.mesh.triangles.len(), merged.mesh.materials.as_slice()), (4, &[0; 4][..]));
    assert_eq!(
        merged.mesh.bounds_in_file_coordinates(),
        Some([DVec3::new(-2.0, 0.0, 0.0), DVec3::new(2.0, 6.0, 0.0)])
    );
    // The mirrored instance keeps its orientation.
    let front = |triangle: u32| {
        let [a, b, c] = merged.mesh.corners(triangle);
        (b - a).cross(c - a).z
    };
    assert!((0..4).all(|triangle| front(triangle) > 0.0));
}

#[test]
fn errors_include_their_location() {
    let with = |edit: &dyn Fn(&mut Value)| {
        let mut json = square();
        edit(&mut json);
        error(&json)
    };
    let vertex_view = |count, needed| {
        let view = view_too_short_message(count, 0, needed, "bufferViews[0]", 48);
        format!("meshes[0].primitives[0]: POSITION: accessors[0]: {view}")
    };
    for (pointer, value, reason) in [
        ("/asset/version", json!("1.0"), unsupported_version_message("1.0")),
        ("/scenes/0/nodes/0", json!(7), GltfError::index_out_of_range("nodes", 7, 1).0),
        ("/nodes/0/mesh", json!(3), GltfError::index_out_of_range("meshes", 3, 1).add_location("nodes[0]").0),
        (
            "/meshes/0/primitives/0/indices",
            json!(9),
            GltfError::index_out_of_range("accessors", 9, 3)
                .add_location("indices")
                .add_location("meshes[0].primitives[0]")
                .0,
        ),
        ("/accessors/0/count", json!(5), vertex_view(5, 60)),
        ("/accessors/0/count", json!(4_000_000_000_u32), vertex_view(4_000_000_000, 48_000_000_000)),
        ("/buffers/0/byteLength", json!(93), format!("buffers[0]: {}", short_buffer_message(93, 92))),
        (
            "/buffers/0/uri",
            json!("https://a/b.bin"),
            format!("buffers[0]: {}", not_relative_uri_message("https://a/b.bin")),
        ),
    ] {
        let found = with(&|json| *json.pointer_mut(pointer).expect("a place") = value.clone());
        assert_eq!(found, reason, "{pointer}");
    }
    for (pointer, value, part) in [
        ("/accessors/0/componentType", json!(1), "accessors[0]"),
        ("/accessors/0/type", json!("VEC9"), "\"VEC9\""),
        ("/accessors/0/bufferView", json!(8), "bufferViews[8]"),
        ("/bufferViews/0/byteLength", json!(u64::MAX), "18446744073709551615"),
        ("/bufferViews/1/byteOffset", json!(90), "90 + 12"),
        ("/buffers/0/uri", json!("data:;base64,Z?=="), &json::invalid_base64_message(b'?', 1)),
        ("/accessors/1/count", json!(-1), "-1"),
    ] {
        let found = with(&|json| *json.pointer_mut(pointer).expect("a place") = value.clone());
        assert!(found.contains(part), "{pointer}: {found}");
    }
    let nodes = |nodes: Value| with(&|json| json["nodes"] = nodes.clone());
    assert_eq!(nodes(json!([{"children": [0]}])), model::node_visited_twice_message(0));
    assert_eq!(nodes(json!([{"children": [1, 1]}, {"mesh": 0}])), model::node_visited_twice_message(1));
    for (name, help) in &UNSUPPORTED_EXTENSIONS[..4] {
        let found = with(&|json| json["extensionsRequired"] = json!([name]));
        assert_eq!(found, unsupported_extension_message(name, help));
    }
    let mut external = square();
    external["buffers"][0]["uri"] = json!("none.bin");
    let missing = crate::system::describe_io_error(&std::io::Error::from_raw_os_error(nix::libc::ENOENT));
    assert_eq!(
        expect_rejection(open_json(&external)).1,
        unreadable_buffer_file_message(&missing, 0, "a.gltf")
    );
    let zeros = json!({"componentType": 5126, "count": 4_000_000_000_u32, "type": "VEC3"});
    let found = with(&|json| json["accessors"][0] = zeros.clone());
    assert!(found.ends_with(&too_many_viewless_elements_message(4_000_000_000)), "{found}");
}

/// Primitives that reuse the same buffer bytes could need far more memory than the file size suggests.
#[test]
fn buffer_byte_reuse_is_limited() {
    let mut json = square();
    // 400 accessors without buffer views: many elements, but no buffer bytes.
    let accessors: Vec<Value> =
        (0..400).map(|_| json!({"componentType": 5126, "count": 1 << 20, "type": "VEC3"})).collect();
    json["accessors"] = json!(accessors);
    let primitives: Vec<Value> = (0..400).map(|number| json!({"attributes": {"POSITION": number}})).collect();
    json["meshes"][0]["primitives"] = json!(primitives);
    assert_eq!(error(&json), too_many_corners_for_buffers_message(400 << 20, 92, 92 + (1 << 20)));
}

/// Primitives with the same mesh share one part, with the texture coordinates used by their materials.
#[test]
fn equal_primitives_share_one_part() {
    let mut json = square();
    let primitive = json["meshes"][0]["primitives"][0].clone();
    let mut primitives = vec![primitive.clone(); 100_000];
    let mut strip = primitive;
    strip["mode"] = json!(5);
    primitives.push(strip);
    json["meshes"] = json!([{"primitives": primitives}, {"primitives": primitives[..1]}]);
    json["nodes"] = json!([{"mesh": 0}, {"mesh": 1}]);
    json["scenes"] = json!([{"nodes": [0, 1]}]);
    let container = open_json(&json).expect("read");
    let scene = scene(&container).expect("a scene");
    let mut parts: Vec<usize> = scene.instances.iter().map(|instance| instance.part).collect();
    assert_eq!(parts.len(), 100_002);
    parts.sort_unstable();
    parts.dedup();
    assert_eq!(parts, [0, 100_000]);
}

/// Primitives that differ only in ignored attributes are built separately, so all of their triangles count
/// toward the limit.
#[test]
fn corner_limit_counts_all_built_primitives() {
    let mut json = square();
    json["accessors"][1] = json!({"componentType": 5121, "count": 10_000, "type": "SCALAR"});
    let primitives = |mode: u32| -> Vec<Value> {
        let primitive =
            |unread: u32| json!({"attributes": {"POSITION": 0, "_A": unread}, "indices": 1, "mode": mode});
        (0..40).map(primitive).collect()
    };
    json["meshes"][0]["primitives"] = json!(primitives(4));
    assert!(open_json(&json).is_ok());
    json["meshes"][0]["primitives"] = json!(primitives(5));
    assert_eq!(error(&json), too_many_corners_for_buffers_message(40 * 3 * 9_998, 92, 92 + (1 << 20)));
}
