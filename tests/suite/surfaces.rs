//! Images of surfaces that are hard to hit or to filter: cut-outs at a distance, lights in the plane of a
//! ceiling, and huge triangles.

use super::test_dir::TestDir;

/// Renders a scene to sRGB bytes.
#[track_caller]
fn render(dir: &TestDir, scene: &str) -> Vec<u8> {
    dir.write("scene.toml", scene);
    dir.expect("scene.toml --once --progress none -o image.ppm --force", 0);
    let image = dir.bytes("image.ppm");
    let header = image.windows(5).position(|bytes| bytes == b"\n255\n").expect("a header") + 5;
    image[header..].to_vec()
}

/// sRGB byte of a linear value.
fn srgb(value: f64) -> f64 {
    255.0 * (1.055 * value.powf(1.0 / 2.4) - 0.055)
}

fn mean(bytes: &[u8]) -> f64 {
    bytes.iter().map(|byte| f64::from(*byte)).sum::<f64>() / bytes.len() as f64
}

/// A white cut-out under ambient light of 1, in front of black. `opacity` is the value at a texel.
fn cutout(dir: &TestDir, settings: &str, opacity: impl Fn(usize, usize) -> u8) -> f64 {
    let mut image = b"P5\n60 60\n255\n".to_vec();
    image.extend((0..60 * 60).map(|texel| opacity(texel % 60, texel / 60)));
    dir.write("dots.pgm", image);
    let scene = format!(
        "[render]\nwidth = 1\nheight = 1\nsamples = 4096\nambient = 1\n\
         [camera]\nposition = [0, 0, 1]\nlook_at = [0, 0, 0]\nfov = 80\n\
         [textures.t]\nfile = \"dots.pgm\"\nfilter = \"mipmap\"\nrepeat = [4, 4]\n\
         [materials.m]\ndiffuse = 1\nopacity = {{ texture = \"t\" }}\n{settings}\n\
         [materials.k]\ndiffuse = 0\nambient = 0\n\
         [[quad]]\ncorner = [-1, -1, 0]\nu = [2, 0, 0]\nv = [0, 2, 0]\nmaterial = \"m\"\n\
         [[quad]]\ncorner = [-9, -9, -1]\nu = [18, 0, 0]\nv = [0, 18, 0]\nmaterial = \"k\"\n"
    );
    mean(&render(dir, &scene))
}

#[test]
fn cutouts_keep_their_coverage_under_mipmaps() {
    let dir = TestDir::new();
    for fifths in [1, 2, 3, 4] {
        let dots = |x: usize, y: usize| if (7 * x + 13 * y) % 5 < fifths { 255 } else { 0 };
        let expected = srgb(fifths as f64 / 5.0);
        for settings in ["", "opacity_cutoff = 0.5"] {
            let value = cutout(&dir, settings, dots);
            assert!((value - expected).abs() < 4.0, "{fifths} of 5, {settings:?}: {value}, not {expected}");
        }
    }
}

/// A floor under a ceiling at y = 2, with a light at the given height. `reversed` lists the light first.
fn lit_from_ceiling(height: f64, reversed: bool, camera: &str) -> String {
    let ceiling = "[[quad]]\ncorner = [-1, 2, -1]\nu = [2, 0, 0]\nv = [0, 0, 2]\nmaterial = \"w\"\n";
    let light = format!(
        "[[quad]]\ncorner = [-0.5, {height}, -0.5]\nu = [1, 0, 0]\nv = [0, 0, 1]\nmaterial = \"light\"\n"
    );
    let objects = if reversed { light + ceiling } else { ceiling.to_owned() + &light };
    format!(
        "[render]\nwidth = 24\nheight = 24\nsamples = 64\nmax_depth = 2\nintegrator = \"path\"\n{camera}\
         [materials.w]\ndiffuse = 0.5\n[materials.light]\ndiffuse = 0\nemission = 0.6\n{objects}\
         [[quad]]\ncorner = [-1, 0, 1]\nu = [2, 0, 0]\nv = [0, 0, -2]\nmaterial = \"w\"\n"
    )
}

#[test]
fn lights_flush_with_a_ceiling_still_shine() {
    let dir = TestDir::new();
    let up = "[camera]\nposition = [0, 1, 0]\nlook_at = [0, 2, 0]\nup = [0, 0, 1]\nfov = 20\n";
    let down = "[camera]\nposition = [0, 1, 0]\nlook_at = [0, 0, 0]\nup = [0, 0, 1]\nfov = 60\n";
    let floor = mean(&render(&dir, &lit_from_ceiling(1.999, false, down)));
    for reversed in [false, true] {
        let seen = render(&dir, &lit_from_ceiling(2.0, reversed, up));
        let expected = srgb(0.6).round();
        assert!(seen.iter().all(|byte| f64::from(*byte) == expected), "{reversed}: {seen:?}");
        let value = mean(&render(&dir, &lit_from_ceiling(2.0, reversed, down)));
        assert!((value - floor).abs() < 1.0, "{reversed}: {value}, not {floor}");
    }
}

#[test]
fn huge_triangles_shade_like_planes() {
    let dir = TestDir::new();
    let scene = |floor: &str| {
        format!(
            "[render]\nwidth = 32\nheight = 24\nsamples = 16\n[camera]\nposition = [0, 2, 6]\n\
             look_at = [0, 0.5, 0]\nfov = 40\n[materials.w]\ndiffuse = 0.7\n\
             [[light]]\ntype = \"point\"\nposition = [2, 5, 3]\nintensity = 60\n\
             [[sphere]]\ncenter = [0, 1, 0]\nradius = 1\nmaterial = \"w\"\n{floor}material = \"w\"\n"
        )
    };
    let plane = render(&dir, &scene("[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\n"));
    assert!(mean(&plane) > 20.0, "the image must not be black");
    for size in [1e4, 1e7] {
        let triangle =
            format!("[[triangle]]\na = [-{size}, 0, {size}]\nb = [{size}, 0, {size}]\nc = [0, 0, -{size}]\n");
        let image = render(&dir, &scene(&triangle));
        // Silhouettes against the horizon may differ, because the triangle ends.
        let differ = image.iter().zip(&plane).filter(|(a, b)| a.abs_diff(**b) > 2).count();
        assert!(differ <= 3, "{size}: {differ} values differ");
    }
}

#[test]
fn noise_moves_with_instances() {
    let dir = TestDir::new();
    let scene = |shape: &str, x: i32| {
        format!(
            "[render]\nwidth = 24\nheight = 24\nsamples = 4\nambient = 1\n\
             [camera]\nposition = [{x}, 0, 3]\nlook_at = [{x}, 0, 0]\n\
             [textures.grain]\ntype = \"noise\"\nsize = 0.3\n\
             [textures.tiles]\ntype = \"checker\"\n\
             [materials.rock]\ndiffuse = {{ texture = \"grain\" }}\nspecular = {{ texture = \"tiles\" }}\n{shape}"
        )
    };
    let ball = "sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"rock\"\n";
    let here = render(&dir, &scene(&format!("[[{ball}"), 0));
    // The camera moves along, so that the world has another origin.
    let instance = "[[instance]]\ngroup = \"g\"\ntranslate = [100, 0, 0]\n";
    let there = render(&dir, &scene(&format!("[[groups.g.{ball}{instance}"), 100));
    let most = here.iter().zip(&there).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(most.is_some_and(|most| most <= 3), "{most:?}");
    let (least, most) = (here.iter().filter(|byte| **byte > 0).min(), here.iter().max());
    assert!(least < Some(&150) && most > Some(&200), "{least:?} {most:?}");
    let checked = dir.run("check scene.toml");
    let said =
        String::from_utf8_lossy(&checked.stdout).into_owned() + &String::from_utf8_lossy(&checked.stderr);
    assert!(said.contains("1 object, 0 triangles, 2 textures"), "{said}");
}
