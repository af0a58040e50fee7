use std::fs;
use std::path::PathBuf;

use proptest::prelude::*;
use serde_json::{Value, json};

use super::*;
use crate::assets::LoadedMesh;
use crate::math::{DVec3, Vec2, Vec3};

/// A folder with glTF files.
struct Desk(tempfile::TempDir);

impl Desk {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, bytes).expect("written");
        path
    }

    fn open(&self, name: &str, bytes: &[u8]) -> Result<Container, AssetError> {
        Container::open(&self.write(name, bytes), &ignore_progress, &CancelToken::new())
    }
}

fn open_json(json: &Value) -> Result<Container, AssetError> {
    Desk::new().open("a.gltf", json.to_string().as_bytes())
}

fn part(container: &Container, number: usize) -> Result<LoadedMesh, AssetError> {
    container.part(number, &ignore_progress, &CancelToken::new())
}

fn scene(container: &Container) -> Result<ModelScene, AssetError> {
    container.scene(&CancelToken::new())
}

/// Message of the error of opening a file, or of reading its scene or its first part.
fn says(json: &Value) -> String {
    let all = || {
        let container = open_json(json)?;
        scene(&container)?;
        part(&container, 0).map(drop)
    };
    all()
        .expect_err("refused")
        .to_string()
        .split_once(".gltf")
        .map(|(_, rest)| rest.to_owned())
        .expect("the file")
}

/// A square of two triangles over four positions, six indices and four pairs of coordinates.
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

/// A file with that square.
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

/// A GLB file of JSON and bytes.
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
fn a_part_is_the_same_from_every_kind_of_buffer() {
    let desk = Desk::new();
    let inside =
        part(&desk.open("a.gltf", square().to_string().as_bytes()).expect("read"), 0).expect("a mesh");
    assert_eq!(
        inside.mesh.positions,
        [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]].map(|[x, y]| Vec3::new(x, y, 0.0))
    );
    assert_eq!(inside.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    // The file counts v from the top.
    assert_eq!(inside.mesh.uvs, [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
    let mut binary = square();
    binary["buffers"][0].as_object_mut().expect("an object").remove("uri");
    let container = desk.open("b.glb", &glb(&binary, &bytes())).expect("read");
    assert_eq!(part(&container, 0).expect("a mesh").mesh, inside.mesh);
    let mut beside = square();
    beside["buffers"][0]["uri"] = json!("a%20b.bin");
    let file = desk.write("a b.bin", &bytes());
    let container = desk.open("c.gltf", beside.to_string().as_bytes()).expect("read");
    let loaded = part(&container, 0).expect("a mesh");
    let hash = Some(*blake3::hash(&bytes()).as_bytes());
    assert_eq!((loaded.mesh, loaded.companions), (inside.mesh, vec![Companion { path: file, hash }]));
}

#[test]
fn strips_and_fans_have_the_fronts_of_triangles() {
    for (mode, expected) in [(5, [[0, 1, 2], [2, 1, 3]]), (6, [[0, 1, 2], [0, 2, 3]])] {
        let mut json = square();
        json["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        json["meshes"][0]["primitives"][0].as_object_mut().expect("an object").remove("indices");
        let mesh = part(&open_json(&json).expect("read"), 0).expect("a mesh").mesh;
        let turned = |[a, b, c]: [u32; 3]| [[a, b, c], [b, c, a], [c, a, b]];
        assert!(
            mesh.triangles.iter().zip(expected).all(|(found, wanted)| turned(wanted).contains(found)),
            "{mode}"
        );
    }
}

#[test]
fn normalised_integers_and_sparse_elements_are_numbers() {
    let mut json = square();
    // Bytes 0 … 255 for positions, as KHR_mesh_quantization has them; one of them is replaced.
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
fn hidden_nodes_show_neither_meshes_nor_lights_below_them() {
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
    assert_eq!((scene.lights.len(), scene.cameras.len()), (0, 1), "a camera shows nothing of its own");
}

#[test]
fn a_buffer_is_no_text() {
    let desk = Desk::new();
    // Two numbers of 16 bits that are letters in UTF-16.
    let mut json = square();
    json["bufferViews"][0]["byteOffset"] = json!(4);
    json["bufferViews"][1]["byteOffset"] = json!(52);
    json["bufferViews"][2]["byteOffset"] = json!(64);
    json["buffers"][0] = json!({"byteLength": 96, "uri": "a.bin"});
    desk.write("a.bin", &[&[b'a', 0, b'b', 0], &bytes()[..]].concat());
    let container = desk.open("a.gltf", json.to_string().as_bytes()).expect("read");
    assert_eq!(part(&container, 0).expect("a mesh").mesh.positions.len(), 4);
}

#[test]
fn nodes_place_parts_and_cameras_and_lights() {
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
    // A quarter turn about y takes x to −z and z to x.
    let near = |a: DVec3, b: DVec3| (a - b).length() < 1e-12;
    let plate = &scene.instances[0];
    assert!(near(plate.placed.point(DVec3::ZERO), DVec3::new(0.0, 0.0, -2.0)));
    assert!(near(plate.placed.point(DVec3::new(2.0, 1.0, 0.0)), DVec3::new(0.0, 2.0, -6.0)));
    assert_eq!((plate.name.as_str(), plate.has_normals, plate.has_colors), ("plate", false, false));
    let camera = &scene.cameras[0];
    assert!(near(camera.position, DVec3::new(10.0, 0.0, 0.0)) && near(camera.direction, DVec3::NEG_X));
    assert_eq!((camera.fov, camera.aspect), (0.5_f64.to_degrees(), Some(1.5)));
    let light = &scene.lights[0];
    assert_eq!(light.intensity, DVec3::new(7.0, 3.5, 0.0));
    assert_eq!(light.kind, ModelLightKind::Spot { angle: 0.8_f64.to_degrees(), blend: 0.5 });
    let [least, greatest] = scene.bounds.expect("bounds");
    assert!(near(least, DVec3::new(0.0, 0.0, -6.0)) && near(greatest, DVec3::new(0.0, 2.0, -2.0)));
}

#[test]
fn materials_are_those_of_the_extensions() {
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
    let Alpha::Mask { value, cutoff } = &material.alpha else { panic!("a mask") };
    assert_eq!((value.factor.x, *cutoff, value.texture.is_some()), (0.5, 0.25, true));
    assert_eq!(
        scene.notes,
        ["materials[0]: its sheen is left out", "materials[0]: the extension MY_own is left out"]
    );
    assert_eq!(scene.images, ["paint"]);
}

/// A mesh has two sets of coordinates: those that its material uses, the lower one first.
#[test]
fn the_sets_that_textures_use_count() {
    let mut json = square();
    json["textures"] = json!([{"source": 0}]);
    json["images"] = json!([{"uri": "a.png"}]);
    // Sets 0, 1 and 2 are the same numbers in another order.
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
        let of = |set: u32| json!({"index": 0, "texCoord": set});
        json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": of(sets[0]), "metallicRoughnessTexture": of(sets[1])},
            "normalTexture": of(sets[2])}]);
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
    assert_eq!(read([1, 1, 1]), (one.clone(), zero.clone(), [false; 3], 0), "the only one is the first");
    let (first, two, second, notes) = read([2, 0, 2]);
    assert_eq!((&first, second, notes), (&zero, [true, false, true], 0));
    assert!(two != zero && two != one);
    assert_eq!(read([0, 1, 2]), (zero, one, [false, true, false], 1), "three are too many");
}

#[test]
fn the_whole_file_is_its_scene_in_one_mesh() {
    let mut json = square();
    json["nodes"] = json!([{"children": [1, 2]}, {"mesh": 0}, {"mesh": 0, "scale": [-1, 1, 1], "translation": [0, 5, 0]}]);
    let whole = open_json(&json).expect("read").whole(&CancelToken::new()).expect("a mesh");
    assert_eq!((whole.mesh.triangles.len(), whole.mesh.materials.as_slice()), (4, &[0; 4][..]));
    assert_eq!(whole.mesh.bounds(), Some([DVec3::new(-2.0, 0.0, 0.0), DVec3::new(2.0, 6.0, 0.0)]));
    // The mirrored instance has its front where the other one has it.
    let front = |triangle: u32| {
        let [a, b, c] = whole.mesh.corners(triangle);
        (b - a).cross(c - a).z
    };
    assert!((0..4).all(|triangle| front(triangle) > 0.0));
}

#[test]
fn mistakes_have_their_place() {
    let with = |edit: &dyn Fn(&mut Value)| {
        let mut json = square();
        edit(&mut json);
        says(&json)
    };
    for (pointer, value, words) in [
        ("/asset/version", json!("1.0"), ": it is glTF 1.0; version 2 is read"),
        ("/scenes/0/nodes/0", json!(7), ": nodes[7] does not exist: there are 1"),
        ("/nodes/0/mesh", json!(3), ": nodes[0]: meshes[3] does not exist: there are 1"),
        (
            "/meshes/0/primitives/0/indices",
            json!(9),
            ": meshes[0].primitives[0]: indices: accessors[9] does not exist",
        ),
        (
            "/accessors/0/count",
            json!(5),
            "accessors[0]: 5 elements from byte 0 need 60 bytes of bufferViews[0], which has 48",
        ),
        ("/accessors/0/count", json!(4_000_000_000_u32), "which has 48"),
        ("/accessors/0/componentType", json!(1), "there is no component type 1"),
        ("/accessors/0/type", json!("VEC9"), "there is no type \"VEC9\""),
        ("/accessors/0/bufferView", json!(8), "bufferViews[8] does not exist: there are 3"),
        (
            "/bufferViews/0/byteLength",
            json!(u64::MAX),
            "bytes 0 + 18446744073709551615 of buffers[0], which has 92",
        ),
        ("/bufferViews/1/byteOffset", json!(90), "bytes 90 + 12 of buffers[0], which has 92"),
        ("/buffers/0/byteLength", json!(93), ": buffers[0]: it claims 93 bytes, and there are 92"),
        ("/buffers/0/uri", json!("https://a/b.bin"), "is no file beside it"),
        ("/buffers/0/uri", json!("data:;base64,Z?=="), "byte 0x3f at 1 is no digit of base64"),
        ("/accessors/1/count", json!(-1), ":1: column "),
    ] {
        let said = with(&|json| *json.pointer_mut(pointer).expect("a place") = value.clone());
        assert!(said.contains(words), "{pointer}: {said}");
    }
    assert!(
        with(&|json| json["nodes"] = json!([{"children": [0]}])).contains("nodes[0] is its own ancestor")
    );
    let twice = json!([{"children": [1, 1]}, {"mesh": 0}]);
    assert!(
        with(&|json| json["nodes"] = twice.clone())
            .contains("nodes[1] is its own ancestor, or has two parents")
    );
    for name in ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu"] {
        let said = with(&|json| json["extensionsRequired"] = json!([name]));
        assert!(
            said.contains(&format!("it needs {name}, which this version does not read; export it")),
            "{said}"
        );
    }
    let mut beside = square();
    beside["buffers"][0]["uri"] = json!("none.bin");
    let said = open_json(&beside).expect_err("refused").to_string();
    assert!(said.contains("none.bin: no such file or directory; buffers[0] of a.gltf is in it"), "{said}");
    let zeros = json!({"componentType": 5126, "count": 4_000_000_000_u32, "type": "VEC3"});
    let said = with(&|json| json["accessors"][0] = zeros.clone());
    assert!(said.contains("4000000000 elements without a buffer view"), "{said}");
}

/// Primitives that share an accessor many times over would take many times the file's memory.
#[test]
fn shared_bytes_are_bounded() {
    let mut json = square();
    // 400 accessors over the same bytes, read as more and more zeros and as lists of indices.
    let accessors: Vec<Value> =
        (0..400).map(|_| json!({"componentType": 5126, "count": 1 << 20, "type": "VEC3"})).collect();
    json["accessors"] = json!(accessors);
    let primitives: Vec<Value> = (0..400).map(|number| json!({"attributes": {"POSITION": number}})).collect();
    json["meshes"][0]["primitives"] = json!(primitives);
    assert!(says(&json).contains("its primitives claim 419430400 corners"), "{}", says(&json));
}

/// A mesh that many primitives have is built once, with the coordinates that their materials ask for.
#[test]
fn primitives_with_the_same_mesh_are_one_part() {
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

/// Primitives that differ in what nobody reads are built each, and count each, as the triangles that their modes make of them.
#[test]
fn every_primitive_that_is_built_is_counted() {
    let mut json = square();
    json["accessors"][1] = json!({"componentType": 5121, "count": 10_000, "type": "SCALAR"});
    let primitives = |mode: u32| -> Vec<Value> {
        let one =
            |unread: u32| json!({"attributes": {"POSITION": 0, "_A": unread}, "indices": 1, "mode": mode});
        (0..40).map(one).collect()
    };
    json["meshes"][0]["primitives"] = json!(primitives(4));
    assert!(open_json(&json).is_ok());
    json["meshes"][0]["primitives"] = json!(primitives(5));
    let said = says(&json);
    let words = "its primitives claim 1199760 corners of triangles, and its 92 bytes of buffers may have 1048668: one a byte, \
                 and 1048576 more";
    assert!(said.contains(words), "{said}");
}

#[test]
fn a_required_extension_that_is_unknown_is_refused_by_its_name() {
    let mut json = square();
    json["extensionsRequired"] =
        json!(["KHR_texture_transform", "KHR_materials_sheen", "KHR_mesh_quantization"]);
    assert!(open_json(&json).is_ok());
    json["extensionsRequired"] = json!(["KHR_texture_transform", "FOO_bar"]);
    assert!(says(&json).contains("it requires the extension FOO_bar, which this version does not read"));
}

#[test]
fn old_versions_and_wrong_types_are_named_in_words_of_json() {
    let old = json!({"asset": {"version": "1.0"}, "nodes": {"a": {}}, "meshes": {}});
    assert!(says(&old).contains(": it is glTF 1.0; version 2 is read"), "{}", says(&old));
    for (pointer, value, words) in [
        ("/nodes/0/mesh", json!("a"), "invalid type: string \"a\", expected a whole number from 0"),
        ("/nodes/0/mesh", json!(-1), "invalid value: integer `-1`, expected a whole number from 0"),
        ("/nodes/0/translation/0", json!("a"), "invalid type: string \"a\", expected a number"),
        ("/nodes", json!({}), "invalid type: object, expected an array"),
        ("/nodes/0", json!(7), "invalid type: integer `7`, expected an object"),
    ] {
        let mut json = square();
        *json.pointer_mut(pointer).expect("a place") = value;
        assert!(says(&json).contains(words), "{pointer}: {}", says(&json));
    }
    let mut flat = square();
    flat["accessors"][0]["type"] = json!("VEC2");
    assert!(
        says(&flat).contains("POSITION: a position has three numbers (VEC3), and here 2"),
        "{}",
        says(&flat)
    );
}

/// Chunks as some programs write them: without the bytes up to a multiple of four; and bytes behind the file's own end.
#[test]
fn a_glb_may_have_chunks_of_any_length_and_bytes_behind_its_end() {
    let desk = Desk::new();
    let mut json = square();
    json["buffers"][0].as_object_mut().expect("an object").remove("uri");
    let expected = part(&desk.open("a.glb", &glb(&json, &bytes())).expect("read"), 0).expect("a mesh").mesh;
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
        let mesh = |file: &[u8]| part(&desk.open("a.glb", file)?, 0).map(|loaded| loaded.mesh);
        assert_eq!(mesh(&file).expect("read"), expected, "{blanks}");
        file.extend(b"trailing");
        assert_eq!(mesh(&file).expect("read"), expected, "{blanks}");
    }
}

/// An image that is not there, or damaged behind its header, is named by its index in this file.
#[test]
fn an_image_that_is_wrong_is_named_by_its_index() {
    let desk = Desk::new();
    let mut json = square();
    let mut png = Vec::new();
    let pixels = ::image::RgbImage::from_fn(8, 8, |x, y| ::image::Rgb([x as u8 * 9, y as u8 * 7, 3]));
    pixels.write_to(&mut std::io::Cursor::new(&mut png), ::image::ImageFormat::Png).expect("written");
    desk.write("whole", &png);
    let end = png.len() - 20;
    png[end] ^= 255;
    desk.write("damaged.png", &png);
    json["images"] = json!([
        {"uri": "none.png"}, {"uri": "damaged.png"}, {"uri": coded(&png)}, {"uri": "whole"}, {"bufferView": 0}
    ]);
    let container = desk.open("a.gltf", json.to_string().as_bytes()).expect("read");
    let token = CancelToken::new();
    let says = |number, words: &str| {
        let said = container.check_image(number, &token).expect_err("refused").to_string();
        assert!(said.contains(&format!("a.gltf: images[{number}]: ")) && said.contains(words), "{said}");
        assert!(!said.contains("ChunkType"), "{said}");
    };
    says(0, "none.png: no such file or directory");
    says(1, "damaged.png: it claims 8 × 8 pixels");
    says(2, "images[2]: it claims 8 × 8 pixels");
    says(4, "its content is no image that can be read");
    assert!(container.check_image(3, &token).is_ok());
    assert!(
        container.check_image_header(1, &token).is_ok() && container.check_image_header(0, &token).is_err()
    );
}

#[test]
fn a_glb_that_is_cut_or_foreign_is_an_error() {
    let desk = Desk::new();
    let mut json = square();
    json["buffers"][0].as_object_mut().expect("an object").remove("uri");
    let whole = glb(&json, &bytes());
    for length in (4..whole.len()).step_by(7) {
        let opened = desk.open("a.glb", &whole[..length]);
        assert!(opened.is_err(), "{length}");
    }
    let mut old = whole;
    old[4] = 1;
    assert!(desk.open("a.glb", &old).expect_err("refused").to_string().contains("GLB of version 1"));
    assert!(desk.open("a.glb", b"PK\x03\x04").expect_err("refused").to_string().contains("neither GLB"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    /// Changed files are read or refused.
    #[test]
    fn changed_files_never_panic(changes in proptest::collection::vec((any::<u16>(), any::<u8>()), 1..8), cut in any::<u16>()) {
        let mut json = square();
        json["buffers"][0].as_object_mut().expect("an object").remove("uri");
        let mut file = glb(&json, &bytes());
        for (place, byte) in changes {
            let place = usize::from(place) % file.len();
            // Digits for digits get further than other bytes.
            file[place] = if file[place].is_ascii_digit() { b'0' + byte % 10 } else { byte };
        }
        if cut % 4 == 0 {
            file.truncate(usize::from(cut) % file.len());
        }
        if let Ok(container) = Desk::new().open("a.glb", &file) {
            let _ = scene(&container);
            let _ = container.whole(&CancelToken::new());
            for number in 0..container.parts() {
                let _ = part(&container, number);
            }
        }
    }
}

#[test]
fn the_files_that_it_names_are_known_by_its_json_alone() {
    let desk = Desk::new();
    let mut json = square();
    json["buffers"] = serde_json::json!([{"uri": "deep/a.bin", "byteLength": 9}, {"byteLength": 1, "uri": "data:;base64,AA=="}]);
    json["images"] = serde_json::json!([{"uri": "a%20b.png"}, {"bufferView": 0}, {"uri": "/etc/passwd"}]);
    let text = json.to_string();
    let files = |name: &str, bytes: &[u8]| {
        // Its buffers are not there.
        assert!(desk.open(name, bytes).is_err());
        let path = desk.0.path().join(name);
        let folder = path.parent().expect("a folder").to_owned();
        let files = super::files_named(&path).expect("glTF").into_iter();
        files.map(|file| file.strip_prefix(&folder).expect("beside it").to_owned()).collect::<Vec<_>>()
    };
    let named = [std::path::PathBuf::from("deep/a.bin"), "a b.png".into()];
    assert_eq!(files("a.gltf", text.as_bytes()), named);
    assert_eq!(files("b.gltf", format!("\u{feff}{text}").as_bytes()), named);
    // A chunk of numbers that is cut short is not looked at.
    let whole = glb(&json, &bytes());
    assert_eq!(files("a.glb", &whole[..whole.len() - 3]), named);
    assert!(super::files_named(&desk.0.path().join("none.glb")).is_err());
}

#[test]
fn a_file_that_needs_a_newer_version_is_refused_by_its_number() {
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
                let least = asset["minVersion"].as_str().expect("text");
                let words = format!("it needs a reader of glTF {least}, and 2.0 is read");
                assert!(!is_read && error.to_string().contains(&words), "{asset}: {error}");
            }
        }
    }
    json["asset"] = json!({"version": "2.0", "minVersion": "x"});
    let error = open_json(&json).expect_err("no version").to_string();
    assert!(error.contains("asset.minVersion is no version: \"x\""), "{error}");
}

#[test]
fn a_camera_of_no_known_kind_is_named() {
    let mut json = square();
    json["nodes"][0]["camera"] = json!(0);
    for camera in [json!({"type": "panorama"}), json!({"type": "perspective"}), json!({})] {
        json["cameras"] = json!([camera]);
        let scene = scene(&open_json(&json).expect("read")).expect("a scene");
        let words = "its camera is left out: it is neither perspective nor orthographic";
        assert!(
            scene.cameras.is_empty() && scene.notes.iter().any(|note| note.contains(words)),
            "{:?}",
            scene.notes
        );
    }
}
