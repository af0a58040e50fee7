use super::*;
use crate::scene::description::Projection::{Fisheye, Orthographic, Perspective, Spherical};

fn look_at(projection: description::Projection, aperture: f64) -> Camera {
    let camera = description::Camera::LookAt {
        position: DVec3::new(0.0, 1.0, 4.0),
        look_at: DVec3::new(0.0, 1.0, 0.0),
        up: DVec3::Y,
        projection,
        window: ImageShiftAndMirror::default(),
        aperture,
        focus: 4.0,
    };
    Camera::from_description(&camera, None)
}

fn ray_at(camera: &Camera, x: f64, y: f64, lens: Vec2) -> Ray {
    let film = FilmPosition { offset: DVec2::new(x, y), half_width: 2.0 };
    camera.ray(film, lens).expect("the position should be inside the circle")
}

#[test]
fn rays_pass_through_image_points() {
    let camera = look_at(Perspective { fov: 90.0 }, 0.0);
    let direction = |x, y| ray_at(&camera, x, y, Vec2::ZERO).direction;
    assert!((direction(0.0, 0.0) - Vec3::NEG_Z).length() < 1e-6);
    assert!((direction(0.0, 1.0) - Vec3::new(0.0, 1.0, -1.0).normalize()).length() < 1e-6);
    assert!((direction(2.0, 0.0) - Vec3::new(2.0, 0.0, -1.0).normalize()).length() < 1e-6);
}

#[test]
fn focal_plane_is_sharp_for_all_lens_points() {
    for projection in [Perspective { fov: 90.0 }, Orthographic { view_height: 3.0 }] {
        let camera = look_at(projection, 0.5);
        let on_plane = |lens| {
            let ray = ray_at(&camera, 0.6, 0.6, lens);
            ray.at((0.0 - ray.origin.z) / ray.direction.z)
        };
        let sharp = on_plane(Vec2::ZERO);
        for lens in [Vec2::X, Vec2::new(-0.3, 0.8)] {
            assert!((on_plane(lens) - sharp).length() < 1e-5);
            let origin =
                ray_at(&camera, 0.6, 0.6, lens).origin - ray_at(&camera, 0.6, 0.6, Vec2::ZERO).origin;
            assert!((origin - 0.5 * lens.extend(0.0)).length() < 1e-6, "{projection:?}");
        }
    }
}

#[test]
fn boxes_contain_ray_origins_where_rays_start() {
    let cube = |x, y, z| {
        let center = Vec3::new(x, y, z);
        Aabb { min: center - Vec3::splat(0.5), max: center + Vec3::splat(0.5) }
    };
    let (narrow, wide) = (look_at(Spherical, 0.0), look_at(Orthographic { view_height: 1.0 }, 0.0));
    for (z, is_near) in [(4.4, true), (3.4, false), (4.6, false)] {
        assert_eq!(narrow.may_start_rays_in(&cube(0.0, 1.0, z)), is_near, "{z}");
        assert!(!narrow.may_start_rays_in(&cube(70.0, 1.0, z)));
        assert_eq!(wide.may_start_rays_in(&cube(70.0, 1.0, z)), is_near, "{z}");
    }
}

#[test]
fn footprints_equal_ray_spacing() {
    for projection in
        [Perspective { fov: 90.0 }, Orthographic { view_height: 3.0 }, Spherical, Fisheye { fov: 200.0 }]
    {
        let camera = look_at(projection, 0.0);
        let (below, above) = [-1e-3, 1e-3].map(|y| ray_at(&camera, 0.0, y, Vec2::ZERO)).into();
        for distance in [0.0, 5.0] {
            let apart = (above.at(distance) - below.at(distance)).length();
            let PixelFootprint { width, spread } = camera.pixel_footprint(1000);
            let expected = width + spread * distance;
            assert!((apart - expected).abs() <= 1e-3 * expected, "{projection:?}: {apart} {expected}");
        }
    }
}

#[test]
fn orbiter_looks_at_its_center() {
    let orbiter =
        GkitOrbiterCamera { center: [1.0, 2.0, 3.0], rotation: [30.0, 90.0], size: 5.0, ..DEFAULT_ORBITER };
    let file = description::Spanned { value: "camera.txt".into(), span: 0..0 };
    let window = ImageShiftAndMirror::default();
    let scene = description::Camera::Orbiter { file, projection: None, window, aperture: 0.0, focus: None };
    let camera = Camera::from_description(&scene, Some(&orbiter));
    let to_center = DVec3::new(1.0, 2.0, 3.0) - camera.position;
    assert!((to_center - camera.forward * 5.0).length() < 1e-12);
    // A rotation by 90° about y moves the camera to the −x axis, and a rotation by 30° about x raises it.
    let expected = DVec3::new(-30.0_f64.to_radians().cos(), 30.0_f64.to_radians().sin(), 0.0) * 5.0;
    assert!((-to_center - expected).length() < 1e-12, "{to_center}");
    assert!(camera.up.y > 0.8);
}

#[test]
fn orbiter_viewpoint_matches_the_camera() {
    let file = description::Spanned { value: "camera.txt".into(), span: 0..0 };
    for rotation in [[30.0, 90.0], [18.0, 16.0], [90.0, 20.0], [120.0, -7.0], [-90.0, 0.0]] {
        let orbiter = GkitOrbiterCamera {
            center: [1.0, 2.0, 3.0],
            position: [0.5, -0.25],
            rotation,
            size: 5.0,
            ..DEFAULT_ORBITER
        };
        let scene = description::Camera::Orbiter {
            file: file.clone(),
            projection: None,
            window: ImageShiftAndMirror::default(),
            aperture: 0.1,
            focus: None,
        };
        let of_file = Camera::from_description(&scene, Some(&orbiter));
        let view = Camera::resolve_to_look_at(&scene, Some(&orbiter));
        let by_vectors = Camera::from_description(&view.into(), None);
        for (a, b) in [
            (of_file.position, by_vectors.position),
            (of_file.right, by_vectors.right),
            (of_file.up, by_vectors.up),
            (of_file.forward, by_vectors.forward),
        ] {
            assert!((a - b).length() < 1e-4 * 5.0, "{rotation:?}: {a} {b}");
        }
        assert_eq!(of_file.pixel_footprint(9), by_vectors.pixel_footprint(9));
        assert!((by_vectors.focus - 5.0).abs() < 1e-4 * 5.0 && by_vectors.aperture == 0.1);
        assert!(view.is_focused_on_look_at());
    }
}
