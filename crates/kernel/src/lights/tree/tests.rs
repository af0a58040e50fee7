use proptest::prelude::*;

use super::bounds::{ConeFalloff, DistanceFalloff};
use super::*;
use crate::control::{CancelToken, Canceled};
use crate::geometry::Shape;
use crate::geometry::cuboid::OrientedBox;
use crate::geometry::cylinder::Cylinder;
use crate::geometry::disk::Disk;
use crate::geometry::parallelogram::Parallelogram;
use crate::geometry::sphere::Sphere;
use crate::geometry::triangle::Triangle;
use crate::lights::delta::{Falloff, PointLight, SpotLight};
use crate::lights::infinite::{DirectionalLight, Environment};
use crate::lights::{
    AreaLight, Emitter, EmittingPart, Light, Lights, MeshEmitter, Side, new_front_area_light,
};
use crate::math::lanes::PortableSimd;
use crate::math::{DVec3, Vec3, random};

/// A light with a random kind, size, and position.
fn any_light(object: u32, next: &mut impl FnMut() -> f32) -> Light {
    let mut vector =
        |scale: f32| Vec3::from_array(std::array::from_fn(|_| (next() * 2.0 - 1.0) * scale)).as_dvec3();
    let (place, direction, across) = (vector(4.0), vector(1.0), vector(1.0));
    let (color, size) = (vector(1.0).as_vec3().abs(), 10_f64.powf(f64::from(next()) * 3.0 - 2.0));
    let falloff = if next() < 0.5 { Falloff::Square } else { Falloff::None };
    let point = PointLight { position: place, intensity: color, falloff };
    let shape = match (next() * 10.0) as u32 {
        0 => return Light::Point(point),
        1 => {
            let (half_angle, axis) = (next() * 3.1 + 0.01, direction.normalize().as_vec3());
            return Light::Spot(SpotLight { point, axis, half_angle, blend: next() });
        }
        2 => {
            let angle = f64::from(next() * 2.0 - 0.5).max(0.0);
            return Light::Directional(DirectionalLight::new(direction.normalize().as_vec3(), color, angle));
        }
        3 => return Light::Environment(Environment::Constant(color)),
        4 => Shape::Sphere(Sphere { center: place, radius: size }),
        5 => Shape::Quad(Parallelogram::new(place, direction * size, across * size)),
        6 => Shape::Triangle(Triangle { a: place, b: place + direction * size, c: place + across * size }),
        7 => Shape::Disk(Disk::new(place, direction, size)),
        8 => Shape::Box(OrientedBox::new(place, across.abs() * size + 0.001, direction * 90.0)),
        _ => Shape::Cylinder(Cylinder::new(place, place + direction * size, size * 0.3, true)),
    };
    Light::Area(new_front_area_light(&shape, color, object).expect("expected a finite shape"))
}

fn lights_of(count: u32, next: &mut impl FnMut() -> f32) -> Vec<Light> {
    (0..count).map(|object| any_light(object, next)).collect()
}

fn tree_of(lights: &[Light]) -> LightTree {
    LightTree::new(&lights.iter().map(Light::bounds_if_emissive).collect::<Vec<_>>(), &CancelToken::new())
        .expect("never canceled")
        .expect("some light")
}

/// A random surface point and normal.
fn place(next: &mut impl FnMut() -> f32) -> (Vec3, Vec3) {
    let mut vector = |scale: f32| Vec3::from_array(std::array::from_fn(|_| (next() * 2.0 - 1.0) * scale));
    (vector(5.0), vector(1.0).normalize())
}

/// Size of the cuts, which is large enough for some of the trees and too small for others.
const NODES: usize = 12;

/// A cut for a point.
fn cut_for(tree: &LightTree, point: Vec3, normal: Vec3, nodes: usize) -> AdaptiveLightTreeCut<'_> {
    let mut cut = AdaptiveLightTreeCut::new(tree, nodes);
    // Visit another point first, which should not affect the result.
    cut.adapt_to_receiver(&Receiver::with_unknown_lobe(normal, point));
    cut.adapt_to_receiver(&Receiver::with_unknown_lobe(point, normal));
    cut
}

/// The light that [`AdaptiveLightTreeCut::pick_sorted_batch`] picks for each number, and its probability.
fn picks_of<const N: usize>(cut: &AdaptiveLightTreeCut<'_>, u: &[f64; N]) -> [Option<(u32, f32)>; N] {
    let mut picks = [None; N];
    cut.pick_sorted_batch(u.iter().copied(), |place, light, probability| {
        picks[place] = Some((light, probability));
    });
    picks
}

/// Evenly spaced numbers.
fn evenly_spaced<const N: usize>() -> [f64; N] {
    std::array::from_fn(|k| (k as f64 + 0.5) / N as f64)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn pick_probabilities_are_exact_and_sum_to_one(seed in any::<u64>(), count in 1_u32..600) {
        let mut next = random::unit_generator(seed);
        let lights = lights_of(count, &mut next);
        let tree = tree_of(&lights);
        for _ in 0..4 {
            let (point, normal) = place(&mut next);
            let cut = cut_for(&tree, point, normal, NODES);
            let mut dark = [0.0; 2];
            for (k, u) in evenly_spaced::<512>().into_iter().enumerate() {
                let alone = tree.pick(&Receiver::with_unknown_lobe(point, normal), u);
                if let Some(pick) = alone {
                    prop_assert_eq!(pick.probability, tree.probability(&Receiver::with_unknown_lobe(point, normal), pick.light));
                    prop_assert!(pick.probability > 0.0 && (0.0..1.0).contains(&pick.rest));
                } else {
                    dark[0] += 1.0 / 512.0;
                }
                if k == 0 {
                    for pick in picks_of(&cut, &evenly_spaced::<512>()) {
                        if let Some((light, probability)) = pick {
                            prop_assert_eq!(probability, cut.probability(light));
                            prop_assert!(probability > 0.0);
                        } else {
                            dark[1] += 1.0 / 512.0;
                        }
                    }
                }
            }
            // The missing probability belongs to nodes whose bounds predict light although their children
            // contribute none.
            let alone: f32 = (0..count).map(|light| tree.probability(&Receiver::with_unknown_lobe(point, normal), light)).sum();
            let cut: f32 = (0..count).map(|light| cut.probability(light)).sum();
            prop_assert!((alone + dark[0] - 1.0).abs() < 0.02, "{} {}", alone, dark[0]);
            prop_assert!((cut + dark[1] - 1.0).abs() < 0.02, "{} {}", cut, dark[1]);
        }
    }

    #[test]
    fn every_contributing_light_can_be_picked(seed in any::<u64>(), count in 1_u32..200) {
        let mut next = random::unit_generator(seed);
        let lights = lights_of(count, &mut next);
        let tree = tree_of(&lights);
        for _ in 0..4 {
            let (mut point, normal) = place(&mut next);
            // Also test points close to a light.
            if let (true, Some((crate::lights::LightCenter::At(middle), _))) = (next() < 0.5, lights[0].center_and_geometry()) {
                point = middle + point * 0.01;
            }
            let cut = cut_for(&tree, point, normal, NODES);
            for (number, light) in (0..).zip(&lights) {
                let arrives = (0..8).any(|_| {
                    let sample = light.sample(point, normal, [next(), next()]);
                    sample.is_some_and(|sample| sample.direction.dot(normal) > 0.0 && sample.weight.element_sum() > 0.0)
                });
                if arrives {
                    prop_assert!(tree.probability(&Receiver::with_unknown_lobe(point, normal), number) > 0.0, "{:?} from {}, {}", light, point, normal);
                    prop_assert!(cut.probability(number) > 0.0, "{:?} from {}, {}", light, point, normal);
                }
            }
        }
    }
}

#[test]
fn spotlights_in_a_column_can_always_be_picked() {
    // The lights form columns, and all of them point down. Each column is one node. Points below some lights
    // in a column may be above the center of the node.
    let mut next = random::unit_generator(8);
    let spot = |i: u32| {
        let position = DVec3::new(f64::from(i % 16), 0.5 + f64::from(i / 16), 0.0);
        let point = PointLight { position, intensity: Vec3::ONE, falloff: Falloff::Square };
        Light::Spot(SpotLight { point, axis: Vec3::NEG_Y, half_angle: 20.0_f32.to_radians(), blend: 0.2 })
    };
    let lights: Vec<Light> = (0..48).map(spot).collect();
    let tree = tree_of(&lights);
    let mut arrived = 0;
    for _ in 0..2000 {
        let point = Vec3::new(16.0 * next(), 3.0 * next(), 0.2 * next() - 0.1);
        let receiver = Receiver::with_unknown_lobe(point, Vec3::Y);
        let cut = cut_for(&tree, point, Vec3::Y, 8);
        for (number, light) in (0..).zip(&lights) {
            let sample = light.sample(point, Vec3::Y, [0.5; 2]);
            if sample.is_some_and(|sample| sample.direction.y > 0.0 && sample.weight.x > 0.0) {
                arrived += 1;
                assert!(tree.probability(&receiver, number) > 0.0, "{light:?} from {point}");
                assert!(cut.probability(number) > 0.0, "{light:?} from {point}");
            }
        }
    }
    assert!(arrived > 500, "{arrived}");
}

#[test]
fn pick_frequencies_match_probabilities() {
    let mut next = random::unit_generator(3);
    let lights = lights_of(300, &mut next);
    let tree = tree_of(&lights);
    for round in 0..4 {
        let (point, normal) = place(&mut next);
        let cut = cut_for(&tree, point, normal, NODES);
        const N: usize = 100_000;
        let mut counts = vec![[0.0_f64; 2]; lights.len()];
        for _ in 0..N / 20 {
            let mut u: [f64; 20] =
                std::array::from_fn(|_| f64::from(next()) + f64::from(next()) / f64::from(1 << 24));
            for pick in u.iter().filter_map(|&u| tree.pick(&Receiver::with_unknown_lobe(point, normal), u)) {
                counts[pick.light as usize][0] += 1.0;
            }
            u.sort_by(f64::total_cmp);
            for (light, _) in picks_of(&cut, &u).into_iter().flatten() {
                counts[light as usize][1] += 1.0;
            }
        }
        for way in 0..2 {
            let (mut chi, mut cells, mut few) = (0.0_f64, 0.0_f64, (0.0, 0.0));
            let mut add = |found: f64, expected: f64| {
                if expected > 0.0 {
                    (chi, cells) = (chi + (found - expected).powi(2) / expected, cells + 1.0);
                }
            };
            for (number, counts) in (0..).zip(&counts) {
                let probability = if way == 0 {
                    tree.probability(&Receiver::with_unknown_lobe(point, normal), number)
                } else {
                    cut.probability(number)
                };
                let expected = f64::from(probability) * N as f64;
                if expected < 5.0 {
                    few = (few.0 + counts[way], few.1 + expected);
                } else {
                    add(counts[way], expected);
                }
            }
            if few.1 >= 5.0 {
                add(few.0, few.1);
            } else {
                assert!(few.0 < 20.0, "{few:?}");
            }
            // χ² has mean n and variance 2n for n + 1 cells.
            assert!(
                cells > 10.0 && chi < cells + 4.5 * (2.0 * cells).sqrt(),
                "{round} {way}: {chi} for {cells} cells"
            );
        }
    }
}

#[test]
fn noncontributing_lights_are_not_picked() {
    // Use lights below the floor, lights that face away, and spotlights that point away.
    let (point, normal) = (Vec3::ZERO, Vec3::Y);
    let at = |x: f64, y: f64| DVec3::new(x, y, 0.5);
    let point_at = |position| PointLight { position, intensity: Vec3::ONE, falloff: Falloff::Square };
    let disk = |place, normal| {
        let disk = Shape::Disk(Disk::new(place, normal, 0.05));
        Light::Area(new_front_area_light(&disk, Vec3::ONE, 0).expect("expected a finite shape"))
    };
    let spot =
        |place, axis| Light::Spot(SpotLight { point: point_at(place), axis, half_angle: 0.3, blend: 0.2 });
    let mut lights = Vec::new();
    for i in 0..100 {
        let x = f64::from(i) * 0.01 - 0.5;
        lights.push(Light::Point(point_at(at(x, -1.0))));
        lights.push(disk(at(x, 1.0), DVec3::Y));
        lights.push(spot(at(x, 2.0), Vec3::Y));
        lights.push(Light::Point(point_at(at(x, 1.5))));
        lights.push(disk(at(x, 1.2), DVec3::NEG_Y));
    }
    let tree = tree_of(&lights);
    let cut = cut_for(&tree, point, normal, NODES);
    let mut sum = 0.0;
    for (number, _) in (0..).zip(&lights) {
        let probability = cut.probability(number);
        assert!((probability > 0.0) == (number % 5 > 2), "{number}: {probability}");
        assert!(
            number % 5 > 2 || tree.probability(&Receiver::with_unknown_lobe(point, normal), number) == 0.0
        );
        sum += probability;
    }
    // Nodes without contributing lights should be picked with almost no probability.
    assert!(sum > 0.7, "{sum}");
}

#[test]
fn picks_are_proportional_to_irradiance() {
    // For point lights directly above a floor, E = I/h².
    let at = |height: f64, intensity: f32| {
        let position = DVec3::new(0.0, height, 0.0);
        Light::Point(PointLight { position, intensity: Vec3::splat(intensity), falloff: Falloff::Square })
    };
    let lights: Vec<Light> =
        (0..200_u16).map(|i| at(1.0 + f64::from(i) * 0.05, f32::from(i % 3) + 1.0)).collect();
    let tree = tree_of(&lights);
    let cut = cut_for(&tree, Vec3::ZERO, Vec3::Y, NODES);
    let irradiance = |i: u32| (f64::from(i % 3) + 1.0) / (1.0 + f64::from(i) * 0.05).powi(2);
    let total: f64 = (0..200).map(irradiance).sum();
    for i in 0..200 {
        let ratio = f64::from(cut.probability(i)) / (irradiance(i) / total);
        assert!((0.8..1.25).contains(&ratio), "{i}: {ratio}");
    }
}

#[test]
fn picks_are_invariant_to_power_of_two_scaling() {
    let probabilities = |k: i32| {
        let mut next = random::unit_generator(5);
        let (unit, power) = (2_f64.powi(k), 4_f32.powi(k));
        let mut lights: Vec<Light> = (0..100)
            .map(|_| {
                let position = DVec3::new(next().into(), next().into(), next().into()) * unit;
                let intensity = Vec3::splat(next()) * power;
                Light::Point(PointLight { position, intensity, falloff: Falloff::Square })
            })
            .collect();
        // A light at infinity does not have a position or size.
        let sun = DirectionalLight::new(Vec3::new(0.6, 0.8, 0.0), Vec3::splat(3.0), 0.0);
        lights.push(Light::Directional(sun));
        let tree = tree_of(&lights);
        let point = (DVec3::new(0.3, -0.7, 0.2) * unit).as_vec3();
        let cut = cut_for(&tree, point, Vec3::Y, NODES);
        (0..101).map(|light| cut.probability(light).to_bits()).collect::<Vec<_>>()
    };
    for k in [-21, 3, 17] {
        assert_eq!(probabilities(k), probabilities(0), "{k}");
    }
}

#[test]
fn joint_bounds_contain_all_lights() {
    let mut next = random::unit_generator(11);
    for _ in 0..200 {
        let bounds: Vec<LightBounds> =
            lights_of(20, &mut next).iter().filter_map(Light::bounds_if_emissive).collect();
        for space in [DistanceFalloff::InverseSquare, DistanceFalloff::Constant, DistanceFalloff::Beyond] {
            let own: Vec<_> = bounds.iter().filter(|one| one.space == space).copied().collect();
            let Some(all) = LightBounds::union_of_all(own.iter()) else { continue };
            for one in &own {
                let reach = (one.center - all.center).length() + one.radius;
                assert!(reach <= all.radius * (1.0 + 1e-12), "{one:?} {all:?}");
                // The joint cone must contain every direction in the light's cone.
                let turned = one.cone.axis.dot(all.cone.axis).clamp(-1.0, 1.0).acos() + one.cone.cos.acos();
                assert!(turned.min(std::f64::consts::PI).cos() >= all.cone.cos - 1e-9, "{one:?} {all:?}");
                assert!(all.cone.edge >= one.cone.edge);
            }
        }
    }
    assert_eq!(LightBounds::union_of_all([].iter()), None);
    assert!(ConeFalloff::Cosine > ConeFalloff::Sharp);
}

#[test]
fn coincident_and_distant_lights_build_valid_trees() {
    let point = |position| PointLight { position, intensity: Vec3::ONE, falloff: Falloff::Square };
    let same: Vec<Light> = (0..5000).map(|_| Light::Point(point(DVec3::ONE))).collect();
    // Each light is twice as far away as the previous one.
    let apart: Vec<Light> =
        (0..120).map(|i| Light::Point(point(DVec3::splat(1e-18 * 2_f64.powi(i))))).collect();
    for lights in [same, apart] {
        let tree = tree_of(&lights);
        let sum: f32 = (0..lights.len() as u32)
            .map(|i| tree.probability(&Receiver::with_unknown_lobe(Vec3::NEG_ONE, Vec3::ONE), i))
            .sum();
        assert!((sum - 1.0).abs() < 1e-3, "{sum}");
    }
    assert_eq!(LightTree::new(&[None, None], &CancelToken::new()), Ok(None));
}

#[test]
fn canceled_builds_return_an_error() {
    let mut next = random::unit_generator(2);
    let bounds: Vec<_> = lights_of(100, &mut next).iter().map(Light::bounds_if_emissive).collect();
    let token = CancelToken::new();
    assert!(LightTree::new(&bounds, &token).is_ok_and(|tree| tree.is_some()));
    token.cancel();
    assert_eq!(LightTree::new(&bounds, &token), Err(Canceled));
    assert_eq!(Lights::new(lights_of(100, &mut next), &token), Err(Canceled));
}

#[test]
fn packet_picks_match_single_picks() {
    use crate::lights::ReceiverPacket;
    let mut next = random::unit_generator(21);
    let mut picked = 0;
    for count in [1, 2, 9, 13, 16] {
        let lights = lights_of(count, &mut next);
        let tree = tree_of(&lights);
        assert!(tree.is_single_node());
        for round in 0..60 {
            let receivers: [Receiver; PACKET_SIZE] = std::array::from_fn(|i| {
                let (point, normal) = place(&mut next);
                let (_, axis) = place(&mut next);
                let lobe = ReceiverLobe { axis, shininess: 20.0 * next(), peak: 3.0 * next(), diffuse: 1.0 };
                Receiver { point, normal, lobe: (round % 2 == 0 && i % 3 != 0).then_some(lobe) }
            });
            let column = |of: &dyn Fn(&Receiver) -> Vec3| {
                let vectors = receivers.each_ref().map(|receiver| of(receiver).to_array());
                [0, 1, 2].map(|axis| vectors.map(|vector| vector[axis]))
            };
            let mut row =
                ReceiverPacket::with_unknown_lobe(&column(&|one| one.point), &column(&|one| one.normal));
            for (i, receiver) in receivers.iter().enumerate() {
                receiver.lobe.iter().for_each(|lobe| row.set_lobe(i, lobe));
            }
            let shares =
                tree.importance_if_single_node(&row, round % 2 == 0, PortableSimd).expect("one node");
            let numbers: [f64; PACKET_SIZE] = std::array::from_fn(|_| f64::from(next()));
            let picks = shares.pick_packet(&numbers);
            assert_eq!(shares.probabilities_of_picks(&picks), picks.probabilities);
            for (i, receiver) in receivers.iter().enumerate() {
                let alone = tree.pick(receiver, numbers[i]);
                let Some(alone) = alone else {
                    assert_eq!(picks.probabilities[i], 0.0);
                    continue;
                };
                let own = tree.probability(receiver, picks.lights[i]);
                assert!(
                    (picks.probabilities[i] / own - 1.0).abs() < 1e-5,
                    "{} {own}",
                    picks.probabilities[i]
                );
                // Summing in a different order may shift a number to the next light.
                picked += u32::from(alone.light == picks.lights[i]);
            }
            let greatest = shares.pick_packet(&[1.0_f64.next_down(); PACKET_SIZE]);
            for (i, receiver) in receivers.iter().enumerate() {
                let own = tree.probability(receiver, greatest.lights[i]);
                assert_eq!(greatest.probabilities[i] > 0.0, own > 0.0, "last contributing light");
            }
        }
    }
    assert!(picked > 3000, "only {picked} picks match");
    assert!(!tree_of(&lights_of(17, &mut next)).is_single_node());
}

/// A mesh of triangles with very different sizes, some near and some far.
fn uneven_mesh(count: u32) -> MeshEmitter {
    let mut next = random::signed_number_generator(8);
    let mut corner = |scale: f64| DVec3::new(f64::from(next()), f64::from(next()), f64::from(next())) * scale;
    let triangles = (0..count).map(|i| {
        let (place, size) = (corner(2.0), 0.02 * 1.5_f64.powi((i % 12) as i32));
        ([place, place + corner(size), place + corner(size)], 2 * i)
    });
    MeshEmitter::new(triangles.collect(), &CancelToken::new()).expect("never canceled").expect("an area")
}

#[test]
fn mesh_pdf_matches_its_samples() {
    for count in [20, 500] {
        let mesh = uneven_mesh(count);
        assert_eq!(mesh.light_tree().is_some(), count > 32);
        let bounds = mesh.light_bounds();
        let light = AreaLight {
            side: Side::Front,
            shape: Emitter::Mesh(mesh),
            radiance: Vec3::ONE,
            object: 4,
            part: EmittingPart::Listed,
            bounds,
            modulation: None,
        };
        let (mut next, mut compared) = (random::unit_generator(5), 0);
        for _ in 0..2000 {
            let (point, normal) = place(&mut next);
            let Some(sample) = light.sample(point, normal, [next(), next()]) else { continue };
            let crate::lights::ShadowRayEnd::At(target) = sample.end else { panic!("a finite light") };
            let crate::lights::GeometryOfLight::Primitive(4, primitive) = sample.source else {
                panic!("expected a triangle")
            };
            let Emitter::Mesh(mesh) = &light.shape else { panic!("a mesh") };
            let front = mesh.normal_of(primitive).expect("expected one of the light's triangles").as_vec3();
            let hit = crate::lights::LightHitPoint {
                direction: sample.direction,
                distance: (target - point).length(),
                normal: front,
                primitive,
            };
            if front.dot(sample.direction) > -0.01 {
                continue;
            }
            let product = light.pdf(point, normal, &hit) * sample.weight.x;
            assert!((product - 1.0).abs() < 5e-3, "{count}: {product}");
            compared += 1;
        }
        assert!(compared > 500, "{count}: {compared}");
    }
}
