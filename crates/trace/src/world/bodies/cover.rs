//! Open rims of glass that end at something opaque: there, light reaches the other side only through the glass.

use super::pieces::{MeshGlass, Pieces, Rim, glass_of};
use crate::assets::LoadedMesh;
use crate::control::{CancelToken, Cancelled};
use crate::geometry::{Aabb, RayF64};
use crate::math::DVec3;
use crate::math::transform::Transform;
use crate::scene::description::{Lowered, Scene};

/// Most rims that are examined.
const MOST_RIMS: usize = 64;

/// Distance beyond a rim within which a surface is searched, relative to the length of the way to the rim.
const REACH: f64 = 1e-3;

/// The part of some rims, by length, that opaque surfaces cover. A way to a rim, from its triangle or from the middle of all rims,
/// hits such a surface at the rim or a little beyond.
pub(super) fn covered(
    scene: &Scene,
    meshes: &[&LoadedMesh],
    pieces: &Pieces,
    rims: &[Rim],
    token: &CancelToken,
) -> Result<f64, Cancelled> {
    let step = rims.len().div_ceil(MOST_RIMS).max(1);
    let some: Vec<&Rim> = rims.iter().step_by(step).collect();
    let middle_of = |rim: &Rim| (rim.ends[0] + rim.ends[1]) * 0.5;
    let center = some.iter().map(|rim| middle_of(rim)).sum::<DVec3>() / some.len().max(1) as f64;
    let ways: Vec<RayF64> = some
        .iter()
        .flat_map(|rim| {
            let end = middle_of(rim);
            [rim.inner, center].map(|origin| {
                let direction = end - origin;
                let reach = 1.0 + REACH + pieces.list[rim.piece as usize].tolerance / direction.length();
                RayF64 { origin, direction, t_max: reach }
            })
        })
        .collect();
    let met = met(scene, meshes, pieces.origin, &ways, token)?;
    let length = |rim: &Rim| rim.ends[0].distance(rim.ends[1]);
    let total: f64 = some.iter().map(|rim| length(rim)).sum();
    let own = some.iter().zip(met.chunks(2)).filter(|(_, met)| met[0] || met[1]);
    Ok(own.map(|(rim, _)| length(rim)).sum::<f64>() / total)
}

/// Whether each of these ways hits anything opaque.
fn met(
    scene: &Scene,
    meshes: &[&LoadedMesh],
    origin: DVec3,
    ways: &[RayF64],
    token: &CancelToken,
) -> Result<Vec<bool>, Cancelled> {
    let mut met = vec![false; ways.len()];
    let bounds: Vec<Aabb> =
        ways.iter().map(|way| Aabb::around_f64([way.origin, way.at(way.t_max)])).collect();
    let all = bounds.iter().fold(Aabb::EMPTY, |all, own| all.union(*own));
    for object in &scene.objects {
        if glass_of(scene, meshes, object) == Some(MeshGlass::All) {
            continue;
        }
        token.check()?;
        let mesh = match object.shape.lowered(origin) {
            Lowered::Shape(shape) => {
                for (met, way) in met.iter_mut().zip(ways) {
                    *met |= shape.intersect(way).is_some();
                }
                continue;
            }
            Lowered::Mesh(mesh) => mesh,
        };
        let own = &meshes[mesh.file].mesh;
        let placed = Transform::scale_rotate_translate(mesh.scale, mesh.rotate, mesh.translate);
        let place = placed.between(own.origin, origin);
        for triangle in 0..own.triangles.len() as u32 {
            let corners = own.corners(triangle).map(|corner| place.point(corner.as_dvec3()));
            let around = Aabb::around_f64(corners);
            if !around.meets(&all) {
                continue;
            }
            for ((met, way), bounds) in met.iter_mut().zip(ways).zip(&bounds) {
                *met |= around.meets(bounds) && crosses(way, corners);
            }
        }
    }
    Ok(met)
}

/// Whether a way hits a triangle (Möller and Trumbore, *Fast, Minimum Storage Ray/Triangle Intersection*, 1997).
fn crosses(way: &RayF64, [a, b, c]: [DVec3; 3]) -> bool {
    let (ab, ac) = (b - a, c - a);
    let p = way.direction.cross(ac);
    let determinant = ab.dot(p);
    let from = way.origin - a;
    let q = from.cross(ab);
    let (u, v) = (from.dot(p) / determinant, way.direction.dot(q) / determinant);
    let t = ac.dot(q) / determinant;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t <= way.t_max
}
