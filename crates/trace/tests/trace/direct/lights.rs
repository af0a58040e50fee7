//! Lights of every kind, with quadrature rules in double precision for the light that arrives at the origin.
//! The rules are derived from the scene file's definitions and share no code with light sampling.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use super::{NORMAL, WO};
use crate::geometry::mesh::TriangleMesh;
use crate::materials::texels::{TexelData, Texels};
use crate::math::{DVec3, Vec3};

/// A light source, and a quadrature rule for its irradiance at the origin.
pub struct ReferenceLight {
    pub name: &'static str,
    /// Tables of the scene file.
    pub text: String,
    /// A mesh that emits.
    pub mesh: Option<TriangleMesh>,
    /// An environment map.
    pub sky: Option<Arc<Texels>>,
    /// Directions, each with radiance times solid angle or, for a single direction, the irradiance at normal
    /// incidence. Empty for lights without a rule.
    pub rule: Vec<(DVec3, f64)>,
}

impl ReferenceLight {
    pub fn from_text(name: &'static str, text: &str) -> Self {
        Self { name, text: text.to_owned(), mesh: None, sky: None, rule: Vec::new() }
    }

    fn with_rule(self, rule: Vec<(DVec3, f64)>) -> Self {
        Self { rule, ..self }
    }

    /// A horizontal rectangle at height 1, facing down, from x = `from` to x = `to`.
    pub fn rectangle_above(from: f64, to: f64) -> Self {
        let width = to - from;
        let text = format!(
            "[[quad]]\ncorner = [{from}, 1, -0.5]\nu = [{width}, 0, 0]\nv = [0, 0, 1]\nmaterial = 'lamp'"
        );
        let rule = parallelogram_rule(v(from, 1.0, -0.5), v(width, 0.0, 0.0), DVec3::Z);
        Self::from_text("rectangle", &text).with_rule(rule)
    }

    /// Whether BSDF samples can find the light.
    pub fn has_extent(&self) -> bool {
        self.rule.len() != 1
    }

    /// Light that a surface with BSDF `f` reflects to the viewer.
    pub fn reflected(&self, f: impl Fn(DVec3) -> f64) -> f64 {
        assert!(!self.rule.is_empty(), "{} has no rule", self.name);
        let normal = NORMAL.as_dvec3();
        self.rule.iter().map(|&(wi, light)| f(wi) * wi.dot(normal).max(0.0) * light).sum()
    }
}

/// The BSDF of [`super::PHONG`]: kd/π + ks·(n + 2)/2π·cosⁿα, where α is the angle to the mirror direction.
pub fn phong_f(wi: DVec3) -> f64 {
    let (normal, wo) = (NORMAL.as_dvec3(), WO.as_dvec3());
    let mirrored = normal * (2.0 * normal.dot(wo)) - wo;
    0.3 / PI + 0.5 * 22.0 / TAU * mirrored.dot(wi).max(0.0).powi(20)
}

/// Radiance of the material `lamp`.
const RADIANCE: f64 = 2.0;
/// Points along each axis of a rule.
const STEPS: u32 = 160;

/// The midpoints of a grid over the unit square.
fn grid() -> impl Iterator<Item = (f64, f64)> {
    let at = |k: u32| (f64::from(k) + 0.5) / f64::from(STEPS);
    (0..STEPS).flat_map(move |i| (0..STEPS).map(move |j| (at(i), at(j))))
}

/// Cell area of [`grid`].
const CELL: f64 = 1.0 / (STEPS as f64 * STEPS as f64);

/// A point of an emitting surface, with its normal and area.
fn surface_term(point: DVec3, normal: DVec3, area: f64) -> (DVec3, f64) {
    let wi = point.normalize();
    let cosine = (-normal.normalize().dot(wi)).max(0.0);
    (wi, RADIANCE * cosine * area / point.length_squared())
}

fn parallelogram_rule(corner: DVec3, u: DVec3, v: DVec3) -> Vec<(DVec3, f64)> {
    let normal = u.cross(v);
    grid().map(|(s, t)| surface_term(corner + u * s + v * t, normal, normal.length() * CELL)).collect()
}

/// Uses a + s·(b − a) + (1 − s)·t·(c − a), which has the area element (1 − s)·|(b − a) × (c − a)|.
fn triangle_rule([a, b, c]: [DVec3; 3]) -> Vec<(DVec3, f64)> {
    let normal = (b - a).cross(c - a);
    grid()
        .map(|(s, t)| {
            let point = a + (b - a) * s + (c - a) * ((1.0 - s) * t);
            surface_term(point, normal, (1.0 - s) * normal.length() * CELL)
        })
        .collect()
}

/// Uses rings of equal area.
fn disk_rule(center: DVec3, normal: DVec3, radius: f64) -> Vec<(DVec3, f64)> {
    let (x, y) = normal.normalize().any_orthonormal_pair();
    grid()
        .map(|(s, t)| {
            let (sin, cos) = (TAU * t).sin_cos();
            let point = center + (x * cos + y * sin) * (radius * s.sqrt());
            surface_term(point, normal, PI * radius * radius * CELL)
        })
        .collect()
}

/// Directions within `half_angle` of an axis, from which the radiance is constant.
fn cone_rule(axis: DVec3, half_angle: f64, radiance: impl Fn(DVec3) -> f64) -> Vec<(DVec3, f64)> {
    let axis = axis.normalize();
    let (x, y) = axis.any_orthonormal_pair();
    let one_minus_cos = 2.0 * (half_angle / 2.0).sin().powi(2);
    grid()
        .map(|(s, t)| {
            let (z, (sin, cos)) = (1.0 - s * one_minus_cos, (TAU * t).sin_cos());
            let wi = axis * z + (x * cos + y * sin) * (1.0 - z * z).max(0.0).sqrt();
            (wi, radiance(wi) * TAU * one_minus_cos * CELL)
        })
        .collect()
}

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// Columns and rows of the environment map.
const MAP: [u32; 2] = [8, 4];

/// Texels of the environment map, top row first.
fn map_texel(column: u32, row: u32) -> f32 {
    if row > 1 { 0.0 } else { 0.2 + ((3 * column + 5 * row) % 8) as f32 / 4.0 }
}

/// The environment map's radiance, interpolated between texel centers. Column 0 begins at azimuth −180° from
/// −z, and azimuths increase toward +x.
fn map_radiance(wi: DVec3) -> f64 {
    let [width, height] = MAP;
    let x = (0.5 + wi.x.atan2(-wi.z) / TAU) * f64::from(width) - 0.5;
    let y = wi.y.acos() / PI * f64::from(height) - 0.5;
    let texel = |i: f64, j: f64| {
        let column = (i as i64).rem_euclid(width.into()) as u32;
        f64::from(map_texel(column, (j as i64).clamp(0, i64::from(height) - 1) as u32))
    };
    let (i, j) = (x.floor(), y.floor());
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let row = |j: f64| mix(texel(i, j), texel(i + 1.0, j), x - i);
    mix(row(j), row(j + 1.0), y - j)
}

/// Red radiance of a clear sky with turbidity 4.5, ground albedo 0.3 and a sun at `to_sun`, 49.64° above the
/// horizon: the model's formula in double precision, with coefficients interpolated with another program.
fn sky_radiance(wi: DVec3, to_sun: DVec3) -> f64 {
    let [a, b, c, d] = [-1.068_645_616, -0.174_808_747_3, 1.224_898_61, 0.849_509_240_3];
    let [e, f, g] = [-1.565_644_306, 0.680_961_037_5, 0.303_281_047_9];
    let [i, h, mean] = [0.568_273_250_3, 0.702_861_429_9, 0.094_736_215_04];
    let cos_gamma = wi.dot(to_sun.normalize());
    let chi = (1.0 + cos_gamma.powi(2)) / (1.0 + h * h - 2.0 * h * cos_gamma).powf(1.5);
    let glow =
        c + d * (e * cos_gamma.acos()).exp() + f * cos_gamma.powi(2) + g * chi + i * wi.y.max(0.0).sqrt();
    (1.0 + a * (b / (wi.y + 0.01)).exp()) * glow * mean
}

/// Radiance in the red channel of the sun that belongs to [`sky_radiance`], with an angular diameter of 40°. It
/// is the mean of the model's radiances at the lowest and highest points of the disk, with limb darkening.
fn sun_radiance(wi: DVec3, to_sun: DVec3) -> f64 {
    let half = |degrees: f64| (degrees / 2.0).to_radians();
    let [from, to] = [19_452.294_1, 19_478.470_2];
    let elevation = to_sun.normalize().y.asin();
    let [bottom, top] = [elevation - half(40.0), elevation + half(40.0)].map(f64::sin);
    let widened = ((half(0.5338) / 2.0).sin() / (half(40.0) / 2.0).sin()).powi(2);
    // Distance from the center of the disk, in radii, as a ratio of chords.
    let distance = (wi.angle_between(to_sun) / 2.0).sin() / (half(40.0) / 2.0).sin();
    let mu = (1.0 - distance * distance).max(0.0).sqrt();
    let limb = [0.670_615, -2.242_908, 3.041_141, -2.291_01, 1.627_701, 0.399_946];
    let limb = limb.iter().fold(0.0, |sum, coefficient| sum * mu + coefficient);
    (from + (to - from) * (wi.y - bottom) / (top - bottom)) * widened * limb
}

/// Every kind of light, with a quadrature rule.
pub fn reference_lights() -> Vec<ReferenceLight> {
    let light = ReferenceLight::from_text;
    let (corner, u, w) = (v(0.2, 1.2, -0.5), v(0.9, -0.5, 0.0), v(0.0, 0.0, 1.0));
    let skew = v(0.3, 0.2, 1.0);
    let (center, radius) = (v(0.8, 0.9, 0.1), 0.5_f64);
    let facing = v(-0.7, -1.0, 0.1);
    let [a, b, c, d] = [v(0.2, 1.2, -0.8), v(1.3, 0.4, -0.2), v(0.6, 0.9, 1.0), v(-0.5, 1.1, 0.3)];
    let mesh = TriangleMesh {
        positions: [a, b, c, d].map(|point| point.as_vec3()).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    };
    let to_sun = v(1.0, 1.2, -0.2);
    let half_sun = 20_f64.to_radians();
    let sky = Texels {
        width: MAP[0],
        height: MAP[1],
        data: TexelData::Float(
            (0..MAP[1])
                .flat_map(|row| (0..MAP[0]).map(move |column| Vec3::splat(map_texel(column, row))))
                .collect(),
        ),
        unusable: 0,
    };
    vec![
        light("point", "[[light]]\nposition = [0.5, 1.5, -0.3]\nintensity = 3")
            .with_rule(vec![delta_term(v(0.5, 1.5, -0.3), 3.0)]),
        light(
            "point without falloff",
            "[[light]]\nposition = [0.5, 1.5, -0.3]\nintensity = 3\nfalloff = 'none'",
        )
        .with_rule(vec![(v(0.5, 1.5, -0.3).normalize(), 3.0)]),
        light(
            "spot",
            "[[light]]\ntype = 'spot'\nposition = [0.4, 1.8, 0.2]\nlook_at = [0.8, 0, 0.2]\nintensity = 3\n\
             angle = 60\nblend = 0.8",
        )
        .with_rule(vec![spot_term(v(0.4, 1.8, 0.2), v(0.4, -1.8, 0.0), 30.0, 0.8)]),
        light(
            "sun without extent",
            "[[light]]\ntype = 'directional'\ndirection = [-1, -1.2, 0.2]\nirradiance = 3\nangle = 0",
        )
        .with_rule(vec![(to_sun.normalize(), 3.0)]),
        light(
            "sun",
            "[[light]]\ntype = 'directional'\ndirection = [-1, -1.2, 0.2]\nirradiance = 3\nangle = 40",
        )
        .with_rule(cone_rule(to_sun, half_sun, |_| 3.0 / (PI * half_sun.sin().powi(2)))),
        light(
            "rectangle",
            "[[quad]]\ncorner = [0.2, 1.2, -0.5]\nu = [0.9, -0.5, 0]\nv = [0, 0, 1]\nmaterial = 'lamp'",
        )
        .with_rule(parallelogram_rule(corner, u, w)),
        light(
            "parallelogram",
            "[[quad]]\ncorner = [0.2, 1.2, -0.5]\nu = [0.9, -0.5, 0]\nv = [0.3, 0.2, 1]\nmaterial = 'lamp'",
        )
        .with_rule(parallelogram_rule(corner, u, skew)),
        light("sphere", "[[sphere]]\ncenter = [0.8, 0.9, 0.1]\nradius = 0.5\nmaterial = 'lamp'")
            .with_rule(cone_rule(center, (radius / center.length()).asin(), |_| RADIANCE)),
        light(
            "disk",
            "[[disk]]\ncenter = [0.8, 0.9, 0.1]\nnormal = [-0.7, -1, 0.1]\nradius = 0.5\nmaterial = 'lamp'",
        )
        .with_rule(disk_rule(center, facing, radius)),
        light(
            "triangle",
            "[[triangle]]\na = [0.2, 1.2, -0.8]\nb = [1.3, 0.4, -0.2]\nc = [0.6, 0.9, 1]\nmaterial = 'lamp'",
        )
        .with_rule(triangle_rule([a, b, c])),
        ReferenceLight { mesh: Some(mesh), ..light("mesh", "") }
            .with_rule([triangle_rule([a, b, c]), triangle_rule([a, c, d])].concat()),
        light("environment", "[environment]\ncolor = 0.8").with_rule(cone_rule(DVec3::Y, FRAC_PI_2, |_| 0.8)),
        ReferenceLight { sky: Some(Arc::new(sky)), ..light("environment map", "") }.with_rule(cone_rule(
            DVec3::Y,
            FRAC_PI_2,
            map_radiance,
        )),
        light(
            "sky",
            "[environment]\nsky = { sun = [1, 1.2, -0.2], turbidity = 4.5, ground = 0.3, sun_scale = 0 }",
        )
        .with_rule(cone_rule(DVec3::Y, FRAC_PI_2, |wi| sky_radiance(wi, to_sun))),
        light(
            "sky's sun",
            "[environment]\n\
             sky = { sun = [1, 1.2, -0.2], turbidity = 4.5, ground = 0, sky_scale = 0, sun_angle = 40 }",
        )
        .with_rule(cone_rule(to_sun, half_sun, |wi| sun_radiance(wi, to_sun))),
    ]
}

/// An isotropic point light with this radiant intensity.
fn delta_term(position: DVec3, intensity: f64) -> (DVec3, f64) {
    (position.normalize(), intensity / position.length_squared())
}

/// A spotlight of intensity 3, which fades linearly with the angle in the outer fraction `blend` of its cone.
fn spot_term(position: DVec3, axis: DVec3, half_angle: f64, blend: f64) -> (DVec3, f64) {
    let angle = axis.angle_between(-position).to_degrees();
    let share = ((half_angle - angle) / (half_angle * blend)).clamp(0.0, 1.0);
    assert!(share > 0.1 && share < 0.9, "the origin must be in the fading part: {share}");
    delta_term(position, 3.0 * share)
}

/// Emitting shapes without a quadrature rule.
pub fn emitter_shapes() -> Vec<ReferenceLight> {
    let light = ReferenceLight::from_text;
    vec![
        light(
            "box",
            "[[box]]\ncenter = [0.8, 0.9, 0.1]\nsize = [0.7, 0.5, 0.8]\nrotate = [10, 30, 5]\nmaterial = 'lamp'",
        ),
        light(
            "cylinder",
            "[[cylinder]]\na = [0.5, 0.8, -0.5]\nb = [0.9, 0.9, 0.6]\nradius = 0.3\nmaterial = 'lamp'",
        ),
        light("cone", "[[cone]]\nbase = [1, 1.2, 0]\ntip = [0.5, 0.4, 0.1]\nradius = 0.5\nmaterial = 'lamp'"),
        light(
            "torus",
            "[[torus]]\ncenter = [0.8, 0.9, 0.1]\naxis = [0.5, 1, 0.2]\nradius = 0.5\ntube = 0.2\nmaterial = 'lamp'",
        ),
        light(
            "ellipsoid",
            "[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = 'lamp'\n\
             matrix = [0.5, 0.1, 0, 0.8,  0, 0.3, 0, 0.9,  0.1, 0, 0.6, 0.1,  0, 0, 0, 1]",
        ),
        light("six spheres", &spheres(6, 0.6)),
        light("forty spheres under a sky", &format!("{}\n[environment]\ncolor = 0.3\n", spheres(40, 0.2))),
    ]
}

/// Spheres on a spiral above the floor, all of which are visible from the origin.
fn spheres(count: u32, radius: f64) -> String {
    let sphere = |i: u32| {
        let (height, (sin, cos)) =
            (0.35 + 0.5 * (f64::from(i) + 0.5) / f64::from(count), (2.4 * f64::from(i)).sin_cos());
        let across = (1.0 - height * height).sqrt();
        let far = 2.0;
        format!(
            "[[sphere]]\ncenter = [{}, {}, {}]\nradius = {}\nmaterial = 'lamp'\n",
            far * across * cos,
            far * height,
            far * across * sin,
            radius * if i.is_multiple_of(3) { 0.5 } else { 1.0 },
        )
    };
    (0..count).map(sphere).collect()
}
