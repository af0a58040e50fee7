//! Generates the assets for the bundled scenes. `glimt-assets` writes the `assets/` files that are stored in
//! the repository, with identical bytes on every machine. `glimt-assets million` writes `assets/million.ply`
//! and `glimt-assets figure` writes `assets/figure.ply`, which are too large to store.

mod figure;
mod foliage;
mod furniture;
mod noise;
mod parts;
mod pictures;
mod racer;
mod room;
mod shapes;
mod sky;
mod stairs;
mod surface;
mod vector;

use std::fs;
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;

const USAGE: &str =
    "usage: glimt-assets [million | figure]   (run in the repository root; writes to assets/)";

/// A file's path relative to `assets/`, and its contents.
type AssetPathAndBytes = (&'static str, Vec<u8>);

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let files = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => stored_assets(),
        ["million"] => vec![("million.ply", shapes::mountainous_globe(shapes::GLOBE_SUBDIVISIONS).to_ply())],
        ["figure"] => vec![("figure.ply", figure::bear().to_ply())],
        _ => {
            let _ = writeln!(io::stderr(), "{USAGE}");
            return ExitCode::from(2);
        }
    };
    for (name, bytes) in files {
        let path = Path::new("assets").join(name);
        if let Err(error) = write_asset_file(&path, &bytes) {
            let _ = writeln!(io::stderr(), "cannot write {}: {error}", path.display());
            return ExitCode::FAILURE;
        }
        let _ = writeln!(io::stdout(), "{} ({} bytes)", path.display(), bytes.len());
    }
    ExitCode::SUCCESS
}

fn write_asset_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    fs::create_dir_all(path.parent().unwrap_or(Path::new("")))?;
    fs::write(path, bytes)
}

/// All files stored in the repository.
fn stored_assets() -> Vec<AssetPathAndBytes> {
    let single = vec![
        ("coral.ply", shapes::coral().to_ply()),
        ("rope.ply", shapes::trefoil_knot_rope().to_ply()),
        (
            "knot.obj",
            shapes::trefoil_knot_tube().to_obj("A trefoil knot with texture coordinates and normals"),
        ),
        ("vase.obj", shapes::vase().to_obj("A vase, turned about y, with texture coordinates and normals")),
        ("gem.off", shapes::dodecahedron().to_off("A dodecahedron: twelve pentagons")),
        ("racer.off", racer::car_body().to_off("The body of a toy racing car, to be subdivided")),
        ("room.obj", room::room_obj()),
        ("room.mtl", room::room_mtl()),
        ("room_orbiter.txt", room::camera_in_orbiter_format()),
        (
            "shrub.obj",
            foliage::shrub().to_obj("A shrub of leaves, squares with texture coordinates and normals"),
        ),
        ("textures/leaf.png", foliage::leaf_png()),
        ("textures/bricks.png", pictures::bricks()),
        ("textures/bumps.png", pictures::brick_normal_map()),
        ("textures/checker.png", pictures::checker()),
        ("textures/planks.png", pictures::planks()),
        ("textures/marble.png", pictures::marble()),
        ("textures/tiles.ppm", pictures::tiles_ppm()),
        ("textures/evening.hdr", sky::evening_sky_hdr()),
    ];
    let parts = stairs::stair_meshes().into_iter().chain(furniture::furniture_meshes());
    single.into_iter().chain(parts.map(|(name, surface)| (name, surface.to_ply()))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glimt::assets::mesh;
    use glimt::control::{CancelToken, ignore_progress};
    use std::collections::HashMap;
    use std::hash::Hash;
    use std::sync::LazyLock;
    use surface::PolygonMesh;

    fn folder() -> &'static Path {
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/assets"))
    }

    #[test]
    fn stored_files_match_the_generator() {
        let mut total = 0;
        for (name, bytes) in stored_assets() {
            let found = fs::read(folder().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert!(found == bytes, "{name} differs from the output of glimt-assets; run glimt-assets");
            total += bytes.len();
        }
        assert!(total < 5_000_000, "{total} bytes are too many to store");
    }

    /// In a closed surface, every edge occurs once in each direction.
    #[test]
    fn meshes_load_and_solids_are_watertight() {
        let mut together = 0;
        for (name, closed) in [
            ("coral.ply", true),
            ("rope.ply", true),
            ("knot.obj", true),
            ("vase.obj", true),
            ("gem.off", true),
            ("room.obj", false),
        ] {
            let loaded = mesh::load(&folder().join(name), &ignore_progress, &CancelToken::new()).expect(name);
            assert_eq!(
                (loaded.dropped, loaded.warnings, loaded.material_warnings),
                Default::default(),
                "{name}"
            );
            let mesh = loaded.mesh;
            together += if name.ends_with("ply") { mesh.triangles.len() } else { 0 };
            let places = mesh.positions.iter().map(|at| (*at + 0.0).to_array().map(f32::to_bits));
            let open = count_open_edges(places, mesh.triangles.iter().map(|triangle| &triangle[..]));
            assert_eq!(open == 0, closed, "{name}: {open} open edges");
            let volume: f32 = (0..mesh.triangles.len() as u32)
                .map(|triangle| mesh.corners(triangle))
                .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
                .sum();
            assert!(!closed || volume > 0.1, "{name} is inside out: {volume}");
        }
        assert!(together >= 100_000, "{together}");
    }

    /// In a closed surface, every edge occurs equally often in both directions. Cloth and leaves are open.
    #[test]
    fn furniture_is_closed_and_faces_outward() {
        let parts =
            stairs::stair_meshes().into_iter().chain(furniture::furniture_meshes()).collect::<Vec<_>>();
        for (name, surface) in
            parts.iter().map(|(name, surface)| (*name, surface)).chain([("figure.ply", &*FIGURE)])
        {
            let mut volume = 0.0;
            for face in &surface.faces {
                for pair in face[1..].windows(2) {
                    let [a, b, c] =
                        [face[0], pair[0], pair[1]].map(|corner| surface.positions[corner as usize]);
                    volume += vector::dot(a, vector::cross(b, c)) / 6.0;
                }
            }
            let places = surface.positions.iter().map(|at| at.map(|coordinate| (coordinate + 0.0).to_bits()));
            let open = count_open_edges(places, surface.faces.iter().map(|face| &face[..]));
            let is_cloth = name.ends_with("leaf.ply") || name.ends_with("curtain.ply");
            assert_eq!(open > 0, is_cloth, "{name}: {open} open edges");
            assert!(is_cloth || volume > 0.0, "{name} is inside out: {volume}");
        }
    }

    /// The mesh in `figure.ply`, built once for all tests.
    static FIGURE: LazyLock<PolygonMesh> = LazyLock::new(figure::bear);

    /// Number of edges that do not occur equally often in both directions. Vertices at the same place count
    /// as one because texture seams and sharp edges have several.
    fn count_open_edges<'a, P: Eq + Hash>(
        places: impl Iterator<Item = P>,
        faces: impl Iterator<Item = &'a [u32]>,
    ) -> usize {
        let mut numbers = HashMap::new();
        let vertices: Vec<usize> = places
            .map(|place| {
                let next = numbers.len();
                *numbers.entry(place).or_insert(next)
            })
            .collect();
        let mut balances: HashMap<(usize, usize), i32> = HashMap::new();
        for face in faces {
            let mut from = vertices[face[face.len() - 1] as usize];
            for corner in face {
                let to = vertices[*corner as usize];
                if from != to {
                    *balances.entry((from.min(to), from.max(to))).or_insert(0) +=
                        if from < to { 1 } else { -1 };
                }
                from = to;
            }
        }
        balances.values().filter(|balance| **balance != 0).count()
    }

    #[test]
    fn figure_has_many_triangles() {
        let count = FIGURE.triangle_count();
        assert!((20_000..=80_000).contains(&count), "{count}");
    }

    #[test]
    fn stored_normals_point_to_the_front() {
        for name in ["knot.obj", "vase.obj", "room.obj"] {
            let mesh =
                mesh::load(&folder().join(name), &ignore_progress, &CancelToken::new()).expect(name).mesh;
            let against = (0..mesh.triangles.len() as u32)
                .filter(|&triangle| {
                    let [a, b, c] = mesh.corners(triangle);
                    let face = (b - a).cross(c - a);
                    mesh.triangles[triangle as usize]
                        .iter()
                        .any(|&v| mesh.normals[v as usize].dot(face) < 0.0)
                })
                .count();
            assert_eq!(against, 0, "{name}");
        }
    }

    /// Files used by scenes but not stored in the repository.
    const MADE_ON_DEMAND: [&str; 2] = ["../assets/million.ply", "../assets/figure.ply"];

    #[test]
    fn scenes_only_use_generated_files() {
        let scenes = folder().with_file_name("scenes");
        let mut named = 0;
        for entry in fs::read_dir(&scenes).expect("the scenes") {
            let text = fs::read_to_string(entry.expect("an entry").path()).expect("a scene");
            let files = text
                .lines()
                .filter_map(|line| line.strip_prefix("file = ").or(line.strip_prefix("orbiter = ")));
            for file in files.filter_map(|file| file.split('"').nth(1)) {
                assert!(MADE_ON_DEMAND.contains(&file) || scenes.join(file).is_file(), "{file}");
                named += 1;
            }
        }
        assert!(named >= 10, "{named}");
    }

    #[test]
    fn million_has_over_a_million_triangles() {
        // Each subdivision splits every triangle into four, so coarse globes are enough.
        let [coarse, finer] = [2, 3].map(|times| shapes::mountainous_globe(times).triangle_count());
        assert_eq!(finer, 4 * coarse);
        assert!(coarse << (2 * (shapes::GLOBE_SUBDIVISIONS - 2)) >= 1_000_000);
    }
}
