//! `subdivide` in `[[mesh]]`, through the whole program.

use serde_json::json;

use super::gltf::Glb;
use super::test_dir::{TestDir, assert_mentions, mentions};

const CAMERA: &str = "[render]\nwidth = 24\nheight = 18\nsamples = 4\nintegrator = \"path\"\n[camera]\n\
                      position = [0.5, 0.6, 3]\nlook_at = [0.3, 0.3, 0]\nfov = 30\n[environment]\n\
                      color = [0.3, 0.4, 0.5]\n[[light]]\nposition = [1, 2, 3]\nintensity = [9, 9, 9]\n\
                      [materials.m]\n";

const CORNERS: [[i32; 3]; 4] = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]];
const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

fn words([a, b, c]: [i32; 3]) -> String {
    format!("{a} {b} {c}\n")
}

/// Writes a tetrahedron in several formats, which split its vertices differently. Returns the file names.
fn write_tetrahedra(dir: &TestDir) -> [&'static str; 6] {
    let vertices = CORNERS.map(words).concat();
    let numbered = FACES.map(|face| format!("3 {}", words(face.map(|corner| corner as i32)))).concat();
    dir.write("a.off", format!("OFF\n4 4 0\n{vertices}{numbered}"));
    let properties = ["x", "y", "z"].map(|name| format!("property float {name}\n")).concat();
    let list = "property list uchar int vertex_indices";
    dir.write(
        "a.ply",
        format!(
            "ply\nformat ascii 1.0\nelement vertex 4\n{properties}element face 4\n{list}\nend_header\n{vertices}{numbered}"
        ),
    );
    let points = CORNERS.map(|corner| format!("v {}", words(corner))).concat();
    // Each corner of a face has its own texture coordinates and the normal of the face.
    let uvs = (0..12).map(|i| format!("vt {} {}\n", i % 3, i / 3)).collect::<String>();
    let normals = "vn 0 0 -1\nvn 0 -1 0\nvn -1 0 0\nvn 1 1 1\n";
    let corner = |face: usize, corner: usize| {
        format!(" {}/{}/{}", FACES[face][corner] + 1, 3 * face + corner + 1, face + 1)
    };
    let face = |face: usize| format!("f{}\n", [0, 1, 2].map(|index| corner(face, index)).concat());
    dir.write("a.obj", format!("{points}{uvs}{normals}{}", [0, 1, 2, 3].map(face).concat()));
    // The same position is repeated, and each face is an object.
    let place = |corner: usize| format!("v {}", words(CORNERS[corner]));
    let object = |face: usize| {
        let first = 3 * face as i32 + 1;
        format!("o {face}\n{}f {}", FACES[face].map(place).concat(), words([first, first + 1, first + 2]))
    };
    dir.write("b.obj", [0, 1, 2, 3].map(object).concat());
    let facet = |face: [usize; 3]| {
        let vertices = face.map(|corner| format!("vertex {}", words(CORNERS[corner]))).concat();
        format!("facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet\n")
    };
    dir.write("a.stl", format!("solid a\n{}endsolid a\n", FACES.map(facet).concat()));
    let mut glb = Glb::default();
    let split = FACES.as_flattened().iter().map(|corner| CORNERS[*corner].map(|number| number as f32));
    let position = glb.vectors(&split.collect::<Vec<_>>());
    let file = glb.finish(json!({
        "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": position}}]}]
    }));
    dir.write("a.glb", file);
    ["a.off", "a.ply", "a.obj", "b.obj", "a.stl", "a.glb"]
}

/// Linear pixel values of a mesh's image.
fn picture(dir: &TestDir, mesh: &str) -> Vec<f32> {
    dir.write("scene.toml", format!("{CAMERA}[[mesh]]\nmaterial = \"m\"\n{mesh}"));
    dir.expect("scene.toml --once --force -o scene.exr --progress none", 0);
    image::open(dir.path("scene.exr")).expect("an image").to_rgb32f().into_raw()
}

#[test]
fn every_format_gives_the_same_surface() {
    let dir = TestDir::new();
    let files = write_tetrahedra(&dir);
    let [plain, level] =
        [0, 3].map(|level| picture(&dir, &format!("file = \"a.off\"\nsubdivide = {level}\n")));
    assert!(plain != level && level.iter().any(|value| (value - level[0]).abs() > 0.05));
    assert_eq!(picture(&dir, "file = \"a.off\"\n"), plain);
    for file in files {
        assert!(picture(&dir, &format!("file = \"{file}\"\nsubdivide = 3\n")) == level, "{file}");
    }
    // A part of a glTF file, and an option.
    assert!(picture(&dir, "file = \"a.glb\"\npart = 0\nsubdivide = 3\n") == level);
    dir.expect("scene.toml --once --force -o set.exr --progress none --set mesh.1.subdivide=0", 0);
    assert!(image::open(dir.path("set.exr")).expect("an image").to_rgb32f().into_raw() != level);
}

#[test]
fn levels_of_one_file_are_different_meshes() {
    let dir = TestDir::new();
    write_tetrahedra(&dir);
    let mesh = |level: u32| format!("[[mesh]]\nmaterial = \"m\"\nfile = \"a.off\"\nsubdivide = {level}\n");
    dir.write("scene.toml", format!("{CAMERA}{}{}{}", mesh(0), mesh(2), mesh(2)));
    let report = dir.report("scene.toml --force -o a.exr --progress none");
    // The two meshes of level 2 share their triangles.
    assert_eq!(report["counters"]["triangles"], 4 + 2 * 64);
    let said = String::from_utf8(dir.run("check scene.toml").stdout).expect("UTF-8");
    assert!(mentions(&said, "132"), "{said}");
}

#[test]
fn large_subdivisions_are_refused_with_a_remedy() {
    let dir = TestDir::new();
    write_tetrahedra(&dir);
    let line = "scene.toml --once --force -o a.exr --progress none";
    let of = |body: &str| dir.write("scene.toml", format!("{CAMERA}[[mesh]]\nmaterial = \"m\"\n{body}"));
    // Sixteen thousand triangles at level 6 need more than is left of 25 MiB.
    of("file = \"a.off\"\nsubdivide = 6\n");
    let said = dir.expect(&format!("{line} --memory 25MiB --threads 1"), 1);
    assert_mentions(&said, &["a.off", "`subdivide = 6`", "memory", "lower level"]);
    dir.expect(&format!("{line} --memory 200MiB"), 0);
    // 40,000 triangles at level 6 are more than 2²⁷.
    let rows = |x: u32| (0..=200).map(move |y| format!("v {x} {y} 0\n"));
    let points: String = (0..=100).flat_map(rows).collect();
    let faces = (0..100 * 200).map(|i| i / 200 * 201 + i % 200 + 1);
    let faces: String = faces.map(|a| format!("f {a} {} {} {}\n", a + 201, a + 202, a + 1)).collect();
    dir.write("grid.obj", format!("{points}{faces}"));
    of("file = \"grid.obj\"\nsubdivide = 6\n");
    let said = dir.expect(line, 2);
    assert_mentions(&said, &["grid.obj", "163840000", "use `subdivide = 5`"]);
}
