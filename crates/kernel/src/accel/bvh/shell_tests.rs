use super::*;
use crate::control::CancelToken;
use crate::geometry::sphere::Sphere;
use crate::math::Vec3;
use crate::math::random::signed_number_generator as random;

/// `count` nested spheres in shuffled order, surrounded by the same number of small spheres. The centers of
/// the nested spheres are up to `spread` apart.
fn spheres(count: u32, spread: f32) -> Vec<Sphere> {
    let mut next = random(5);
    let mut vector = |size: f32| (Vec3::new(next(), next(), next()) * size).as_dvec3();
    let nested = (0..count).map(|i| {
        let radius = 1.0 + f64::from(i * 7 % count) / f64::from(count);
        Sphere { center: vector(spread) + DVec3::X, radius }
    });
    let nested: Vec<_> = nested.collect();
    nested.into_iter().chain((0..count).map(|_| Sphere { center: vector(4.0), radius: 0.01 })).collect()
}

fn tree(spheres: &[Sphere]) -> Bvh {
    let boxes: Vec<_> = spheres.iter().map(Sphere::bounds).collect();
    let tree = Bvh::build(&boxes, &CancelToken::new()).expect("never canceled");
    tree.validate(&boxes).expect("a valid tree");
    tree.with_shells_if_nested(|id| {
        SphericalShell::from_sphere(spheres[id as usize].center, spheres[id as usize].radius)
    })
}

/// Rays that start inside, between, and outside the spheres. Some are tangential.
fn rays(count: usize) -> Vec<Ray> {
    let mut next = random(9);
    let mut vector = |size: f32| Vec3::new(next(), next(), next()) * size;
    let ray = |i: usize| {
        let origin = Vec3::X + vector([0.1, 1.5, 6.0][i % 3]);
        let target = if i.is_multiple_of(2) { Vec3::X + vector(1.4) } else { origin + vector(1.0) };
        let ray = Ray::new(origin, target - origin);
        if i.is_multiple_of(5) { Ray { t_max: 0.7, ..ray } } else { ray }
    };
    (0..count).map(ray).collect()
}

/// The nearest hit and the number of spheres tested.
fn closest_hit_and_test_count(tree: &Bvh, spheres: &[Sphere], ray: &Ray) -> (Option<(f32, u32)>, usize) {
    let (mut best, mut tests) = (None, 0);
    tree.visit_primitives_front_to_back(ray, |id, t_max| {
        tests += 1;
        let t = spheres[id as usize].intersect(&Ray { t_max, ..*ray }.to_f64())?.t;
        best = best.filter(|best| *best < (t, id)).or(Some((t, id)));
        best.map(|(t, _)| t)
    });
    (best, tests)
}

fn brute(spheres: &[Sphere], ray: &Ray) -> Option<(f32, u32)> {
    let hits = spheres.iter().zip(0..).filter_map(|(own, id)| Some((own.intersect(&ray.to_f64())?.t, id)));
    hits.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
}

#[test]
fn nested_hits_match_brute_force() {
    for spread in [0.0, 1e-4, 0.02] {
        let spheres = spheres(200, spread);
        let tree = tree(&spheres);
        assert!(tree.shells.is_some(), "{spread}");
        for ray in &rays(800) {
            let expected = brute(&spheres, ray);
            assert_eq!(closest_hit_and_test_count(&tree, &spheres, ray).0, expected, "{ray:?}");
            let is_hit = |id: u32| spheres[id as usize].intersect(&ray.to_f64()).is_some();
            assert_eq!(tree.any_hit(ray, is_hit), expected.is_some(), "{ray:?}");
        }
    }
}

#[test]
fn nested_box_queries_match_brute_force() {
    for spread in [0.0, 1e-4, 0.02] {
        let spheres = spheres(200, spread);
        let tree = tree(&spheres);
        let last = tree.n_highest_ids_by_subtree::<3>(|id| id.is_multiple_of(2));
        let mut next = random(3);
        for i in 0..500 {
            let at = Vec3::X + Vec3::new(next(), next(), next()) * 2.0;
            let near = Aabb { min: at, max: at }.expanded(Vec3::splat([1e-5, 0.1][i % 2]));
            let (mut visited, mut enclosing) = (Vec::new(), Vec::new());
            tree.visit_surfaces_overlapping_box(&near, |surface| {
                match surface {
                    PrimitiveOrSubtreeAroundBox::Primitive(id) => visited.push(id),
                    PrimitiveOrSubtreeAroundBox::Enclosing(subtree) => enclosing.extend(&last[subtree]),
                }
                true
            });
            let corners = [near.min, near.max].map(|corner| corner.as_dvec3());
            for (sphere, id) in spheres.iter().zip(0..) {
                let nearest = sphere.center.clamp(corners[0], corners[1]).distance(sphere.center);
                let farthest = corners.map(|corner| (sphere.center - corner).abs());
                let farthest = farthest[0].max(farthest[1]).length();
                if nearest <= sphere.radius && sphere.radius <= farthest {
                    assert!(visited.contains(&id), "{id} at {at}");
                }
            }
            // The last three enclosing primitives must have been visited.
            let encloses =
                |id: &u32| spheres[*id as usize].volume_contains(at.as_dvec3()) && id.is_multiple_of(2);
            let all = (0..spheres.len() as u32).rev().filter(encloses);
            let found: Vec<_> = visited.iter().chain(&enclosing).copied().filter(encloses).collect();
            assert!(all.take(3).all(|id| found.contains(&id)), "{at}: {found:?}");
            assert!(enclosing.iter().all(encloses), "{at}");
        }
    }
}

#[test]
fn nested_sphere_traversal_is_logarithmic() {
    let work = |count: u32| {
        let spheres = spheres(count, 0.0);
        let tree = tree(&spheres[..count as usize]);
        let most =
            rays(600).iter().map(|ray| closest_hit_and_test_count(&tree, &spheres, ray).1).max().unwrap_or(0);
        let mut max_visited = 0;
        for ray in rays(600) {
            let near = Aabb { min: ray.origin, max: ray.origin };
            let mut visited = 0;
            tree.visit_surfaces_overlapping_box(&near, |_| {
                visited += 1;
                true
            });
            max_visited = max_visited.max(visited);
        }
        (most, max_visited)
    };
    for count in [500, 1000, 2000, 4000, 8000] {
        let (tests, visited) = work(count);
        let bound = 3 * count.ilog2() as usize;
        assert!(tests <= bound && visited <= bound, "{tests} tests, {visited} overlaps for {count} spheres");
    }
}
