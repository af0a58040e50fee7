//! Small glTF files like those written by modeling programs.

use serde_json::{Value, json};

/// A GLB file under construction, with buffer views and accessors for a single buffer.
#[derive(Default)]
pub(crate) struct Glb {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Glb {
    /// Adds bytes. Returns the index of the buffer view.
    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()}));
        self.bytes.extend(bytes);
        self.views.len() - 1
    }

    /// Adds vectors. Returns the index of the accessor.
    pub(crate) fn vectors<const N: usize>(&mut self, vectors: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = vectors.as_flattened().iter().flat_map(|number| number.to_le_bytes()).collect();
        let view = self.view(&bytes);
        let kind = format!("VEC{N}");
        self.accessors
            .push(json!({"bufferView": view, "componentType": 5126, "count": vectors.len(), "type": kind}));
        self.accessors.len() - 1
    }

    /// Adds indices. Returns the index of the accessor.
    pub(crate) fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|number| number.to_le_bytes()).collect();
        let view = self.view(&bytes);
        self.accessors.push(
            json!({"bufferView": view, "componentType": 5123, "count": indices.len(), "type": "SCALAR"}),
        );
        self.accessors.len() - 1
    }

    /// The glTF file as JSON, with a zeroed buffer of the same length in a data URI.
    pub(crate) fn finish_text(self, mut json: Value) -> String {
        let Self { bytes, views, accessors } = self;
        json["asset"] = json!({"version": "2.0"});
        let zeros = format!("data:;base64,{}", "AAAA".repeat(bytes.len().div_ceil(3)));
        json["buffers"] = json!([{"byteLength": bytes.len(), "uri": zeros}]);
        json["bufferViews"] = json!(views);
        json["accessors"] = json!(accessors);
        json.to_string()
    }

    /// The GLB file with the given JSON and the buffer.
    pub(crate) fn finish(self, mut json: Value) -> Vec<u8> {
        let Self { mut bytes, views, accessors } = self;
        json["asset"] = json!({"version": "2.0"});
        json["buffers"] = json!([{"byteLength": bytes.len()}]);
        json["bufferViews"] = json!(views);
        json["accessors"] = json!(accessors);
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        let mut file = b"glTF\x02\0\0\0".to_vec();
        file.extend((28 + text.len() + bytes.len()).to_le_bytes().first_chunk::<4>().expect("eight bytes"));
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &bytes)] {
            file.extend((chunk.len() as u32).to_le_bytes());
            file.extend(kind);
            file.extend(chunk);
        }
        file
    }
}

/// A cube primitive with side length 2, normals and texture coordinates.
pub(crate) fn cube(glb: &mut Glb) -> Value {
    let (mut positions, mut normals, mut uvs, mut indices) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for axis in 0..3 {
        for sign in [1.0_f32, -1.0] {
            let first = positions.len() as u16;
            for (across, upwards) in [(-1.0_f32, -1.0_f32), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                let mut at = [0.0; 3];
                (at[axis], at[(axis + 1) % 3], at[(axis + 2) % 3]) = (sign, across * sign, upwards);
                let mut normal = [0.0; 3];
                normal[axis] = sign;
                positions.push(at);
                normals.push(normal);
                uvs.push([across * 0.5 + 0.5, 0.5 - upwards * 0.5]);
            }
            indices.extend([0, 1, 2, 0, 2, 3].map(|corner| first + corner));
        }
    }
    let [position, normal, uv] = [glb.vectors(&positions), glb.vectors(&normals), glb.vectors(&uvs)];
    json!({"attributes": {"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv}, "indices": glb.indices(&indices)})
}

/// Two instances of a textured cube mesh, one of them rotated.
pub(crate) fn cubes(image: &[u8]) -> Vec<u8> {
    let mut glb = Glb::default();
    let mut painted = cube(&mut glb);
    painted["material"] = json!(0);
    let view = glb.view(image);
    glb.finish(json!({
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [
            {"name": "straight", "mesh": 0, "translation": [-1.5, 1, 0]},
            {"name": "turned", "mesh": 0, "translation": [1.5, 1, 0], "rotation": [0, 0.382_683_43, 0, 0.923_879_53]}
        ],
        "meshes": [{"name": "cube", "primitives": [painted]}],
        "materials": [{"name": "paint \"1\"", "pbrMetallicRoughness":
            {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 0.5, 0.5, 1], "metallicFactor": 0}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": view, "mimeType": "image/png", "name": "checks"}]
    }))
}

/// A sparse accessor with four vertices, as JSON.
pub(crate) fn sparse() -> String {
    let mut glb = Glb::default();
    let position = glb.vectors(&[[0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3]]);
    let (indices, values) = (glb.view(&[0; 4]), glb.view(&[0; 12]));
    glb.accessors[position]["sparse"] = json!({
        "count": 1, "indices": {"bufferView": indices, "componentType": 5125}, "values": {"bufferView": values}
    });
    glb.finish_text(json!({
        "nodes": [{"mesh": 0, "skin": 0, "children": [1]}, {"matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1], "mesh": 0}],
        "skins": [{"joints": [1]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": position}, "mode": 5}]}]
    }))
}
