use std::path::Path;
use std::sync::Arc;

use super::*;
use crate::accel::InstructionSet;
use crate::control::CancelToken;
use crate::geometry::Ray;
use crate::geometry::mesh::TriangleMesh;
use crate::lights::GeometryOfLight;
use crate::math::Vec3;
use crate::math::origin::local_coordinate_origin;
use crate::math::random::signed_number_generator as random;
use crate::scene::description::Accel;
use crate::world::packet::tests::assert_packets_match_rays;
use crate::world::{Geometry, MeshTree, separate_coincident_emitters};

/// A square mesh, centered at the origin and facing up.
fn square_mesh() -> TriangleMesh {
    let at = |x: f32, z: f32| Vec3::new(x, 0.0, z);
    TriangleMesh {
        positions: vec![at(-0.5, 0.5), at(0.5, 0.5), at(0.5, -0.5), at(-0.5, -0.5)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    }
}

fn scene_from_toml(tables: &str) -> Scene {
    let text = format!(
        "[camera]\nposition = [0, 5, 1]\nlook_at = [0, 0, 0]\n[materials.w]\ndiffuse = 0.5\n\
         [materials.l]\nemission = 1\n[materials.both]\nemission = 1\nemission_sides = \"both\"\n{tables}"
    );
    // The mesh file only needs to exist. Its content is replaced by `square`.
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scene.toml");
    let outcome = crate::scene::parse(Arc::from(text.as_str()), &path);
    outcome.scene.unwrap_or_else(|| panic!("{:?}: {text}", outcome.diagnostics))
}

fn loaded_square_mesh() -> LoadedMesh {
    LoadedMesh { mesh: square_mesh(), ..LoadedMesh::default() }
}

/// Each light that is lifted off a surface, paired with the surface.
fn lifted_light_pairs(scene: &Scene) -> Vec<(usize, usize)> {
    coplanar_light_pairs(scene, true)
}

/// Each light that overlaps another light, paired with the other light.
fn overlapping_light_pairs(scene: &Scene) -> Vec<(usize, usize)> {
    coplanar_light_pairs(scene, false)
}

fn coplanar_light_pairs(scene: &Scene, are_lifted: bool) -> Vec<(usize, usize)> {
    let mesh = loaded_square_mesh();
    let meshes = vec![&mesh; scene.mesh_files.len()];
    let found = find_coplanar_lights(scene, &meshes, DVec3::ZERO).into_iter();
    found.filter(|pair| pair.lift.is_some() == are_lifted).map(|pair| (pair.light, pair.surface)).collect()
}

/// Lights in the plane y = 0, at the origin and facing up.
const LIGHTS: [&str; 5] = [
    "[[quad]]\ncorner = [-0.5, 0, 0.5]\nu = [1, 0, 0]\nv = [0, 0, -1]\nmaterial = 'l'\n",
    "[[triangle]]\na = [-0.5, 0, 0.5]\nb = [0.5, 0, 0.5]\nc = [0, 0, -0.5]\nmaterial = 'l'\n",
    "[[disk]]\ncenter = [0, 0, 0]\nnormal = [0, 1, 0]\nradius = 0.5\nmaterial = 'l'\n",
    "[[box]]\ncenter = [0, -0.25, 0]\nsize = [1, 0.5, 1]\nmaterial = 'l'\n",
    "[[mesh]]\nfile = '../../assets/gem.off'\nmaterial = 'l'\n",
];

/// Larger surfaces in the same plane.
const SURFACES: [&str; 6] = [
    "[[quad]]\ncorner = [-2, 0, 2]\nu = [4, 0, 0]\nv = [0, 0, -4]\nmaterial = 'w'\n",
    "[[quad]]\ncorner = [-2, 0, 2]\nu = [0, 0, -4]\nv = [4, 0, 0]\nmaterial = 'w'\n",
    "[[triangle]]\na = [-9, 0, 9]\nb = [9, 0, 9]\nc = [0, 0, -9]\nmaterial = 'w'\n",
    "[[plane]]\npoint = [3, 0, 1]\nnormal = [0, 1, 0]\nmaterial = 'w'\n",
    "[[cylinder]]\na = [0, -1, 0]\nb = [0, 0, 0]\nradius = 3\nmaterial = 'w'\n",
    "[[mesh]]\nfile = '../../assets/gem.off'\nscale = 4\nmaterial = 'w'\n",
];

fn mesh_with_separated_emitters(loaded: &LoadedMesh, all_emit: bool) -> Option<LoadedMesh> {
    separate_coincident_emitters(loaded, all_emit, &CancelToken::new()).expect("never canceled")
}

#[test]
fn coplanar_lights_are_found_in_any_order() {
    for light in LIGHTS {
        for surface in SURFACES {
            assert_eq!(
                lifted_light_pairs(&scene_from_toml(&format!("{light}{surface}"))),
                [(0, 1)],
                "{light}{surface}"
            );
            assert_eq!(
                lifted_light_pairs(&scene_from_toml(&format!("{surface}{light}"))),
                [(1, 0)],
                "{surface}{light}"
            );
        }
    }
}

#[test]
fn non_coplanar_lights_are_not_lifted() {
    let surface = SURFACES[0];
    for light in [
        // Lights slightly above the surface, next to it, touching its edge and perpendicular to it, and a
        // non-emissive object.
        LIGHTS[0].replace("-0.5, 0, 0.5", "-0.5, 1e-4, 0.5"),
        LIGHTS[0].replace("-0.5, 0, 0.5", "2.5, 0, 0.5"),
        LIGHTS[0].replace("-0.5, 0, 0.5", "2, 0, 0.5"),
        LIGHTS[0].replace("[0, 0, -1]", "[0, 1, 0]"),
        LIGHTS[0].replace("'l'", "'w'"),
    ] {
        assert!(lifted_light_pairs(&scene_from_toml(&format!("{surface}{light}"))).is_empty(), "{light}");
    }
    // Two lights that face the same direction.
    assert!(lifted_light_pairs(&scene_from_toml(&format!("{}{}", LIGHTS[0], LIGHTS[2]))).is_empty());
    assert!(
        lifted_light_pairs(&scene_from_toml(&format!("{}{}", LIGHTS[0], LIGHTS[2].replace("'l'", "'both'"))))
            .is_empty()
    );
}

#[test]
fn lights_are_compared_only_with_nearby_faces() {
    let light = |x: usize| {
        let corners = [(0.0, 0.0), (0.5, 0.0), (0.5, -0.5), (0.0, -0.5)];
        let corners = corners.map(|(dx, z)| DVec3::new(x as f64 + dx, 0.0, z));
        FlatFace { emits: Some(EmissionSides::Front), ..FlatFace::new(corners.to_vec()).expect("a face") }
    };
    let all: Vec<FlatFace> = (0..2000).rev().map(light).collect();
    let lights = EmissiveFacesByMinX::new(all.clone()).expect("lights");
    let mut pairs = 0;
    for face in &all {
        let near: Vec<f64> =
            lights.lights_with_touching_bounds(face, &mut pairs).map(|light| light.point.x).collect();
        assert_eq!(near, [face.point.x]);
    }
    assert!(pairs < 3 * all.len(), "{pairs} pairs");
}

#[test]
fn overlapping_lights_are_reported_once() {
    let both = LIGHTS.map(|light| light.replace("'l'", "'both'"));
    for first in LIGHTS {
        assert!(overlapping_light_pairs(&scene_from_toml(first)).is_empty(), "{first}");
        for second in LIGHTS.map(str::to_owned).iter().chain(&both) {
            assert_eq!(
                overlapping_light_pairs(&scene_from_toml(&format!("{first}{second}"))),
                [(1, 0)],
                "{first}{second}"
            );
        }
        assert!(
            overlapping_light_pairs(&scene_from_toml(&format!("{first}{}", SURFACES[0]))).is_empty(),
            "{first}"
        );
    }
    // Lights that touch, and lights that face away from each other.
    for second in [
        "corner = [0.5, 0, 0.5]\nu = [1, 0, 0]\nv = [0, 0, -1]",
        "corner = [0, 0, 0]\nu = [0, 0, -1]\nv = [1, 0, 0]",
    ] {
        let scene = scene_from_toml(&format!("{}[[quad]]\n{second}\nmaterial = 'l'\n", LIGHTS[0]));
        assert!(overlapping_light_pairs(&scene).is_empty(), "{second}");
    }
}

#[test]
fn overlapping_faces_of_one_light_are_reported() {
    let light = scene_from_toml(LIGHTS[4]);
    let reported = |triangles: &[[u32; 3]]| {
        let mesh = TriangleMesh { triangles: triangles.to_vec(), ..square_mesh() };
        let loaded = LoadedMesh { mesh, ..LoadedMesh::default() };
        let found = find_coplanar_lights(&light, &[&loaded], DVec3::ZERO);
        found
            .iter()
            .filter(|pair| pair.lift.is_none())
            .map(|pair| (pair.light, pair.surface))
            .collect::<Vec<_>>()
    };
    assert_eq!(reported(&[[0, 1, 2], [0, 2, 3]]), []);
    // Add both triangles of a split along the other diagonal, and then only one of them.
    assert_eq!(reported(&[[0, 1, 2], [0, 2, 3], [1, 2, 3], [1, 3, 0]]), [(0, 0)]);
    assert_eq!(reported(&[[0, 1, 2], [0, 2, 3], [1, 2, 3]]), [(0, 0)]);
    // Duplicate faces emit only once, and reversed faces are moved apart.
    assert_eq!(reported(&[[0, 1, 2], [0, 2, 3], [1, 2, 0], [3, 0, 2]]), []);
    assert_eq!(reported(&[[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]]), []);
}

#[test]
fn rays_hit_the_first_of_repeated_faces() {
    let mut next = random(13);
    for triangles in
        [vec![[0, 1, 2], [0, 2, 3], [1, 2, 0], [3, 0, 2]], vec![[0, 1, 2], [0, 2, 3], [6, 4, 5], [6, 7, 4]]]
    {
        let mut vertex = || Vec3::new(next(), next(), next());
        let mut positions: Vec<Vec3> = (0..4).map(|_| vertex()).collect();
        positions.extend(positions.clone());
        let mesh = TriangleMesh { positions, triangles, ..TriangleMesh::default() };
        let loaded = LoadedMesh { mesh, ..LoadedMesh::default() };
        assert!(mesh_with_separated_emitters(&loaded, false).is_none());
        let distinct = mesh_with_separated_emitters(&loaded, true).expect("repeated faces");
        let geometry = build_geometry_with_mesh(&scene_from_toml(LIGHTS[4]), Accel::Bvh, distinct.clone());
        let mut hits = 0;
        for _ in 0..4000 {
            let from = vertex() * 9.0;
            let Some(hit) = geometry.closest_hit(&Ray::new(from, vertex() * 0.5 - from)) else { continue };
            assert!(hit.shape.primitive < 2, "{hit:?} {distinct:?}");
            hits += 1;
        }
        assert!(hits > 100, "{hits}");
    }
}

#[test]
fn opposite_faces_are_hit_from_their_fronts() {
    let mut next = random(14);
    // Reversed triangles with the same diagonal, and reversed triangles with the other diagonal.
    for reversed in [[[2, 1, 0], [3, 2, 0]], [[3, 2, 1], [3, 1, 0]]] {
        for _ in 0..100 {
            let mut vector = || DVec3::new(next().into(), next().into(), next().into());
            let (x, y) = (vector().normalize(), vector());
            let (center, y) = (vector() * 5.0, (y - x * x.dot(y)).normalize());
            let corner = |[u, v]: [f64; 2]| (center + x * u + y * v).as_vec3();
            let positions = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(corner).to_vec();
            let triangles = [[[0, 1, 2], [0, 2, 3]], reversed].concat();
            let mesh = TriangleMesh { positions, triangles, ..TriangleMesh::default() };
            let loaded = LoadedMesh { mesh, ..LoadedMesh::default() };
            let distinct = mesh_with_separated_emitters(&loaded, true).expect("reversed faces");
            let geometry = build_geometry_with_mesh(&scene_from_toml(LIGHTS[4]), Accel::Bvh, distinct);
            for round in 0..100 {
                let target = corner([0.5, 0.5]).as_dvec3() + (x * vector().x + y * vector().x) * 0.45;
                let from = target + vector().normalize() * f64::from(1 + round);
                if (from - target).normalize().dot(x.cross(y)).abs() < 0.05 {
                    continue;
                }
                let ray = Ray::new(from.as_vec3(), (target - from).as_vec3());
                let hit = geometry.closest_hit(&ray).expect("a hit");
                let is_front = hit.shape.primitive < 2;
                assert_eq!(is_front, (from - target).dot(x.cross(y)) > 0.0, "{hit:?} {from} {target}");
            }
        }
    }
}

#[test]
fn lights_far_from_the_origin_are_lifted() {
    let mut next = random(15);
    for round in 0..400 {
        let mut vector = || DVec3::new(next().into(), next().into(), next().into());
        let at = vector() * [1e2, 1e3, 1e4, 1e6][round % 4];
        let (x, y) = (vector().normalize(), vector());
        let y = (y - x * x.dot(y)).normalize();
        let (x, y) = if round % 3 == 0 { (DVec3::X, DVec3::NEG_Z) } else { (x, y) };
        // A grid of `cells` × `cells` quads.
        let grid = |half: f64, shift: [f64; 2], cells: u32| {
            let corner = |i: u32| {
                let [u, v] =
                    [i % (cells + 1), i / (cells + 1)].map(|i| f64::from(i) / f64::from(cells) * 2.0 - 1.0);
                let place = at + x * (shift[0] + u * half) + y * (shift[1] + v * half);
                // Coordinates in files usually have few decimals.
                (place * 1e6).round() * 1e-6
            };
            let corners: Vec<DVec3> = (0..(cells + 1) * (cells + 1)).map(corner).collect();
            let quads = (0..cells * cells).map(|i| i / cells * (cells + 1) + i % cells);
            let triangles =
                quads.flat_map(|a| [[a, a + 1, a + cells + 2], [a, a + cells + 2, a + cells + 1]]);
            let mesh = TriangleMesh { triangles: triangles.collect(), ..TriangleMesh::default() };
            let origin = local_coordinate_origin(at + x * shift[0] + y * shift[1], half);
            let positions = corners.iter().map(|corner| (*corner - origin).as_vec3()).collect();
            Arc::new(LoadedMesh { mesh: TriangleMesh { origin, positions, ..mesh }, ..LoadedMesh::default() })
        };
        let cells = [1, 7][round / 4 % 2];
        let [ceiling, light] = [grid(3.0, [0.4, 0.7], cells), grid(0.5, [0.0, 0.0], 1)];
        let scene = scene_from_toml(
            "[[mesh]]\nfile = '../../assets/gem.off'\nmaterial = 'w'\n[[mesh]]\nfile = '../../assets/vase.obj'\nmaterial = 'l'\n",
        );
        let token = CancelToken::new();
        let tree = |mesh| Arc::new(MeshTree::build(mesh, Accel::Bvh, &token).expect("never canceled"));
        let (meshes, origin) = ([ceiling, light].map(tree), local_coordinate_origin(at, 5.0));
        let geometry = Geometry::from_scene(&scene, &meshes, origin, &token).expect("never canceled");
        for _ in 0..50 {
            let target = at + (x * vector().x + y * vector().x) * 0.45;
            let from = target + x.cross(y) * 2.0 + vector();
            let ray = Ray::new((from - origin).as_vec3(), (target - from).as_vec3());
            assert_eq!(geometry.closest_hit(&ray).expect("a hit").object, 1, "{round} {at} {from}");
        }
    }
}

/// Geometry of a scene whose mesh files are all [`square`].
fn build_geometry(scene: &Scene, accel: Accel) -> Geometry {
    build_geometry_with_mesh(scene, accel, loaded_square_mesh())
}

/// Geometry of a scene whose mesh files all have this content.
fn build_geometry_with_mesh(scene: &Scene, accel: Accel, loaded: LoadedMesh) -> Geometry {
    let (token, loaded) = (CancelToken::new(), Arc::new(loaded));
    let tree = || Arc::new(MeshTree::build(Arc::clone(&loaded), accel, &token).expect("never canceled"));
    let meshes: Vec<_> = scene.mesh_files.iter().map(|_| tree()).collect();
    Geometry::from_scene(scene, &meshes, DVec3::ZERO, &token).expect("never canceled")
}

#[test]
fn lifted_lights_are_hit_only_from_the_front() {
    let mut next = random(11);
    let two_sided = LIGHTS.map(|light| light.replace("'l'", "'both'"));
    let lights = LIGHTS.map(str::to_owned).into_iter().chain(two_sided);
    for (light, surface) in lights.flat_map(|light| SURFACES.map(|surface| (light.clone(), surface))) {
        for (tables, number) in [(format!("{light}{surface}"), 0), (format!("{surface}{light}"), 1)] {
            let scene = scene_from_toml(&tables);
            for accel in [Accel::Bvh, Accel::KdTree] {
                let geometry = build_geometry(&scene, accel);
                assert_eq!(geometry.light_lifts_by_object().len(), 2);
                for _ in 0..50 {
                    let target = Vec3::new(next() * 0.1, 0.0, next() * 0.1);
                    let from = Vec3::new(next() * 8.0, 0.5 + next().abs() * 9.0, next() * 8.0);
                    let hit = geometry.closest_hit(&Ray::new(from, target - from)).expect("a hit");
                    assert_eq!(hit.object, number, "{tables} {from}");
                    // Shadow rays that ignore the light reach it because the surface below does not occlude
                    // it.
                    let shadow = Ray::segment_ending_before_point(from, target);
                    assert!(
                        !geometry.is_occluded_except_by_light(&shadow, GeometryOfLight::Object(number)),
                        "{tables} {from}"
                    );
                    let is_closed = tables.contains("box") || tables.contains("cylinder");
                    let below = Vec3::new(from.x, -from.y, from.z);
                    let hit = geometry.closest_hit(&Ray::new(below, target - below)).expect("a hit");
                    assert!(is_closed || hit.object != number, "{tables} {below}");
                    // Light samples are occluded from the same positions as hits.
                    let lift = geometry.light_lifts_by_object()[number as usize].as_vec3();
                    let hidden = Ray::segment_ending_before_point(below, target + lift);
                    assert!(
                        geometry.is_occluded_except_by_light(&hidden, GeometryOfLight::Object(number)),
                        "{tables} {below}"
                    );
                }
            }
        }
    }
}

#[test]
fn packets_match_single_rays_at_lifted_lights() {
    // Every light on every surface, another copy of every light, and a mesh with duplicate faces.
    let tables = [LIGHTS.concat(), SURFACES.concat(), LIGHTS.concat().replace("'l'", "'both'")].concat();
    let mut mesh = square_mesh();
    mesh.triangles = mesh.triangles.repeat(2);
    for accel in [Accel::Bvh, Accel::BvhHigh, Accel::KdTree] {
        for instructions in InstructionSet::ALL {
            let loaded = LoadedMesh { mesh: mesh.clone(), ..LoadedMesh::default() };
            let geometry = build_geometry_with_mesh(&scene_from_toml(&tables), accel, loaded)
                .with_instruction_set(instructions);
            assert!(!geometry.light_lifts_by_object().is_empty());
            assert_packets_match_rays(&geometry);
        }
    }
}

#[test]
fn lights_in_tilted_and_distant_planes_are_lifted() {
    let mut next = random(12);
    for round in 0..40_u32 {
        let mut vector = || DVec3::new(next().into(), next().into(), next().into());
        let (x, y) = (vector().normalize(), vector());
        let y = (y - x * x.dot(y)).normalize() * 1.7;
        let center = vector() * 30.0;
        let quad = |half: f64, material: &str| {
            let corner = center - (x + y) * half;
            let show = |v: DVec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
            let [corner, u, v] = [corner, x * (2.0 * half), y * (2.0 * half)].map(show);
            format!("[[quad]]\ncorner = {corner}\nu = {u}\nv = {v}\nmaterial = '{material}'\n")
        };
        let tables = format!("{}{}", quad(3.0, "w"), quad(1.0, "l"));
        let geometry = build_geometry(&scene_from_toml(&tables), Accel::Bvh);
        assert_eq!(geometry.light_lifts_by_object().len(), 2, "{tables}");
        for _ in 0..50 {
            let target = center + (x * vector().x + y * vector().x) * 0.9;
            let from = target + x.cross(y) * (2.0 + f64::from(round)) + vector() * 2.0;
            let ray = Ray::new(from.as_vec3(), (target - from).as_vec3());
            assert_eq!(geometry.closest_hit(&ray).expect("a hit").object, 1, "{tables} {from}");
        }
    }
}

#[test]
fn mesh_file_lights_are_lifted_off_other_faces() {
    let at = |x: f32, z: f32| Vec3::new(x, 2.0, z);
    let ring = |half: f32| [at(-half, -half), at(half, -half), at(half, half), at(-half, half)];
    let quad = |first: u32| [[first, first + 1, first + 2], [first, first + 2, first + 3]];
    let mesh = TriangleMesh {
        positions: [ring(2.0), ring(0.5)].concat(),
        normals: vec![Vec3::NEG_Y; 8],
        uvs: (0..8).map(|i| Vec2::splat(i as f32)).collect(),
        triangles: [quad(0), quad(4)].concat(),
        materials: vec![0, 0, 1, 1],
        ..TriangleMesh::default()
    };
    let material = |emission: f32| crate::assets::FileMaterial {
        name: String::new(),
        diffuse: Vec3::ONE,
        specular: Vec3::ZERO,
        shininess: 0.0,
        emission: Vec3::splat(emission),
        ior: 1.0,
        illumination_model: None,
        opacity: 1.0,
        opacity_texture: None,
        diffuse_texture: None,
        specular_texture: None,
        emission_texture: None,
        normal_texture: None,
        normal_strength: 1.0,
        physical: None,
    };
    let loaded = LoadedMesh { mesh, materials: vec![material(0.0), material(1.0)], ..LoadedMesh::default() };
    let lifted = mesh_with_separated_emitters(&loaded, false).expect("a coplanar light").mesh;
    // Another instance, whose material makes all faces emit, does not change this.
    let emissive = mesh_with_separated_emitters(&loaded, true).expect("a coplanar light").mesh;
    assert_eq!(emissive.triangles, lifted.triangles);
    assert_eq!(lifted.triangles[..2], loaded.mesh.triangles[..2]);
    assert_eq!((lifted.positions.len(), lifted.normals.len(), lifted.uvs.len()), (12, 12, 12));
    let down = (lifted.positions[1] - lifted.positions[0]).cross(lifted.positions[2] - lifted.positions[0]).y;
    for triangle in 2..4 {
        for (before, after) in loaded.mesh.corners(triangle).into_iter().zip(lifted.corners(triangle)) {
            let moved = after - before;
            assert!(
                moved.y * down > 0.0 && moved.y.abs() < 1e-4 && moved.x == 0.0 && moved.z == 0.0,
                "{moved}"
            );
        }
    }
    // Meshes without coplanar lights are unchanged.
    let dark = LoadedMesh { materials: vec![material(0.0), material(0.0)], ..loaded.clone() };
    assert!(mesh_with_separated_emitters(&dark, false).is_none());
    let mut below = loaded;
    below.mesh.positions[4..].iter_mut().for_each(|position| position.y = 1.9);
    assert!(mesh_with_separated_emitters(&below, false).is_none());
}
