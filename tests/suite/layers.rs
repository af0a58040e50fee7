//! `--layers`: extra channels in EXR files.

use std::collections::BTreeMap;

use exr::prelude::{ReadChannels, ReadLayers, read};

use super::test_dir::TestDir;

const SMALL: &str = "--once --width 32 --height 24";

/// A floor with a glossy ball, an area light and a sky.
const ROOM: &str = "[camera]\nposition = [0, 1, 5]\nlook_at = [0, 0.6, 0]\n[environment]\ncolor = [0.2, 0.3, 0.5]\n\
    [materials.floor]\n[materials.ball]\ndiffuse = [0.6, 0.1, 0.1]\nspecular = 0.3\nshininess = 40\n\
    [materials.mirror]\ntype = \"mirror\"\n[materials.lamp]\nemission = 5\n\
    [[plane]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\nmaterial = \"floor\"\n\
    [[sphere]]\ncenter = [0.5, 0.6, 0]\nradius = 0.6\nmaterial = \"ball\"\n\
    [[sphere]]\ncenter = [-0.9, 0.5, 0]\nradius = 0.5\nmaterial = \"mirror\"\n\
    [[sphere]]\ncenter = [0, 2.5, 1]\nradius = 0.3\nmaterial = \"lamp\"\n";

/// A mirror that touches a glossy floor, where photons are tested for occlusion.
const CONTACT: &str = "[camera]\nposition = [0, 1.6, 6]\nlook_at = [0, 0.9, 0]\n[photons]\nenabled = true\n\
    [materials.floor]\ndiffuse = 0.4\nspecular = 0.3\nshininess = 40\n[materials.mirror]\ntype = \"mirror\"\n\
    [materials.lamp]\ndiffuse = 0.0\nemission = 6.0\n\
    [[plane]]\nmaterial = \"floor\"\n\
    [[quad]]\ncorner = [-3, 0, 1]\nu = [2.5, 0, 0]\nv = [0, 1.2, 0.1]\nmaterial = \"mirror\"\n\
    [[quad]]\ncorner = [-1, 4, -1]\nu = [2, 0, 0]\nv = [0, 0, 2]\nmaterial = \"lamp\"\n";

/// A partially transparent and textured screen in front of frosted glass, plastic and a glass ball.
const PANES: &str = "[camera]\nposition = [0, 1, 5]\nlook_at = [0, 0.6, 0]\n[render]\nambient = 0.1\nclamp = 0\n\
    [environment]\ncolor = [0.2, 0.3, 0.5]\n\
    [materials.floor]\ntype = \"plastic\"\ndiffuse = [0.5, 0.4, 0.3]\nroughness = 0.3\n\
    [materials.screen]\ndiffuse = 0.5\nopacity = 0.4\n\
    [materials.frosted]\ntype = \"glass\"\nior = 1.5\nroughness = 0.3\n[materials.glass]\ntype = \"glass\"\nior = 1.5\n\
    [materials.gold]\ntype = \"metal\"\nelement = \"gold\"\nroughness = 0.3\n[materials.lamp]\nemission = 5\n\
    [[plane]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\nmaterial = \"floor\"\n\
    [[quad]]\ncorner = [-1.5, 0, 1.5]\nu = [1.5, 0, 0]\nv = [0, 1.5, 0]\nmaterial = \"screen\"\n\
    [[sphere]]\ncenter = [0.9, 0.5, 1]\nradius = 0.5\nmaterial = \"glass\"\n\
    [[sphere]]\ncenter = [0, 0.5, -0.5]\nradius = 0.5\nmaterial = \"frosted\"\n\
    [[torus]]\ncenter = [-1, 0.5, -0.5]\naxis = [0, 0, 1]\nradius = 0.5\ntube = 0.2\nmaterial = \"gold\"\n\
    [[sphere]]\ncenter = [0, 2.5, 1]\nradius = 0.3\nmaterial = \"lamp\"\n";

fn dir() -> TestDir {
    let dir = TestDir::new();
    dir.write("panes.toml", PANES);
    dir.write("room.toml", ROOM);
    dir.write("contact.toml", CONTACT);
    dir
}

/// All channels of an EXR file.
fn channels(dir: &TestDir, name: &str) -> BTreeMap<String, Vec<f32>> {
    let image = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
    let image = image.all_attributes().from_file(dir.path(name)).expect("EXR");
    let list = image.layer_data.channel_data.list.into_iter();
    list.map(|channel| (channel.name.to_string(), channel.sample_data.values_as_f32().collect())).collect()
}

fn picture(dir: &TestDir, options: &str) -> Vec<f32> {
    dir.expect(&format!("room.toml {SMALL} -o view.exr {options}"), 0);
    image::open(dir.path("view.exr")).expect("a picture").to_rgb32f().into_raw()
}

/// The components add up to the beauty image, even with adaptive sampling or photons.
#[test]
fn components_add_up_to_beauty_layer() {
    let dir = dir();
    for options in [
        "room.toml --integrator path --samples 64 --error 0.2",
        "room.toml --integrator whitted --photons on --samples 5",
        "room.toml --integrator whitted --samples 4 --time 0.2",
        "contact.toml --samples 4",
    ] {
        dir.expect(&format!("{options} {SMALL} -o a.exr --layers all"), 0);
        let all = channels(&dir, "a.exr");
        for channel in ["R", "G", "B"] {
            let parts =
                ["ambient", "diffuse", "specular", "emission"].map(|part| &all[&format!("{part}.{channel}")]);
            for (i, whole) in all[channel].iter().enumerate() {
                let sum: f32 = parts.iter().map(|part| part[i]).sum();
                assert!(
                    (sum - whole).abs() <= 1e-5 * whole.max(1.0),
                    "{options} {channel} {i}: {sum} {whole}"
                );
            }
        }
        let samples = &all["samples.X"];
        assert!(samples.iter().all(|count| *count >= 1.0 && count.fract() == 0.0));
    }
}

#[test]
fn layers_equal_the_views() {
    let dir = dir();
    let same = "--samples 4 --error 0 --integrator path";
    dir.expect(&format!("room.toml {SMALL} {same} -o a.exr --layers depth,albedo,normal,variance"), 0);
    let all = channels(&dir, "a.exr");
    let names: Vec<&str> = all.keys().map(String::as_str).collect();
    let expected = [
        "B",
        "G",
        "R",
        "albedo.B",
        "albedo.G",
        "albedo.R",
        "depth.Z",
        "normal.X",
        "normal.Y",
        "normal.Z",
        "variance.X",
    ];
    assert_eq!(names, expected);
    let is = |name: &str, pixels: &[f32], component: usize| {
        let expected: Vec<f32> = pixels.chunks(3).map(|pixel| pixel[component]).collect();
        assert_eq!(all[name], expected, "{name}");
    };
    let beauty = picture(&dir, same);
    ["R", "G", "B"].iter().enumerate().for_each(|(i, name)| is(name, &beauty, i));
    let error = picture(&dir, &format!("{same} --view error"));
    for (variance, error) in all["variance.X"].iter().zip(error.chunks(3)) {
        assert!((variance - error[0] * error[0]).abs() <= 1e-6 * variance, "{variance} {}", error[0]);
    }
    // Normals are signed. The floor in front faces up, and the sky has no normal.
    let at = |name: &str, x: usize, y: usize| all[name][y * 32 + x];
    assert_eq!([at("normal.X", 2, 23), at("normal.Y", 2, 23), at("normal.Z", 2, 23)], [0.0, 1.0, 0.0]);
    assert_eq!([at("normal.X", 1, 0), at("normal.Y", 1, 0), at("normal.Z", 1, 0)], [0.0; 3]);
    assert!(all["normal.X"].iter().any(|x| *x < -0.5) && all["normal.X"].iter().any(|x| *x > 0.5));
}

/// The largest difference between a layer and a view, relative to the view's values above 1.
fn difference(layer: &[f32], view: impl Iterator<Item = f32>) -> f32 {
    layer.iter().zip(view).map(|(layer, view)| (layer - view).abs() / view.abs().max(1.0)).fold(0.0, f32::max)
}

/// Layers are recorded along with the image, from the samples that the views take.
#[test]
fn every_layer_equals_its_view() {
    let dir = dir();
    for scene in ["room", "contact", "panes"] {
        for options in ["--integrator path", "--integrator whitted", "--integrator whitted --photons on"] {
            let same = format!("{scene}.toml {SMALL} {options} --samples 5 --error 0 -o a.exr");
            let view = |name: &str| {
                dir.expect(&format!("{same} --view {name}"), 0);
                image::open(dir.path("a.exr")).expect("an image").to_rgb32f().into_raw()
            };
            let views: Vec<_> = ["albedo", "normal", "depth", "ambient", "diffuse", "specular", "emission"]
                .map(|name| (name, view(name)))
                .into();
            let beauty = view("beauty");
            dir.expect(&format!("{same} --layers all"), 0);
            let all = channels(&dir, "a.exr");
            for (component, channel) in ["R", "G", "B"].into_iter().enumerate() {
                let pixels = beauty.iter().skip(component).step_by(3).copied();
                assert!(all[channel].iter().copied().eq(pixels), "{same}: the layers change the image");
                for (name, view) in &views {
                    let values = view.iter().skip(component).step_by(3).copied();
                    let (layer, off) = match *name {
                        "depth" => (&all["depth.Z"], difference(&all["depth.Z"], values)),
                        // The view shows (n + 1)/2, and 0 without a hit. Compare pixels without misses.
                        "normal" => {
                            let layer = &all[&format!("normal.{}", ["X", "Y", "Z"][component])];
                            let is_full = |at: usize| all["albedo.R"][at] > 0.0 && all["depth.Z"][at] > 0.0;
                            let covered =
                                |at: usize| is_full(at) && is_covered(&view[3 * at..3 * at + 3], &all, at);
                            let full: Vec<usize> = (0..layer.len()).filter(|at| covered(*at)).collect();
                            assert!(full.len() > 100, "{same}: {} pixels", full.len());
                            let of_layer: Vec<f32> = full.iter().map(|at| layer[*at]).collect();
                            let of_view = full.iter().map(|at| 2.0 * view[3 * at + component] - 1.0);
                            (layer, difference(&of_layer, of_view))
                        }
                        _ => {
                            let layer = &all[&format!("{name}.{channel}")];
                            (layer, difference(layer, values))
                        }
                    };
                    assert!(off <= 1e-5, "{same}: {name}.{channel} differs by {off}");
                    assert_eq!(layer.len(), 32 * 24);
                }
            }
        }
    }
}

/// Whether every sample of a pixel hits a surface. With misses, 2v − 1 for the view v is less than the layer
/// in each component, by the fraction of misses.
fn is_covered(view: &[f32], all: &BTreeMap<String, Vec<f32>>, at: usize) -> bool {
    let misses = ["X", "Y", "Z"]
        .iter()
        .zip(view)
        .map(|(axis, view)| all[&format!("normal.{axis}")][at] - (2.0 * view - 1.0));
    misses.fold(0.0, f32::max) < 0.1
}

/// A checkpoint contains the layers, and layers never change the image.
#[test]
fn layers_survive_crops_noise_targets_and_resume() {
    let dir = dir();
    for options in [
        "room.toml --crop 5,3,20,15 --samples 6",
        "room.toml --integrator path --samples 64 --error 0.2",
        "contact.toml --samples 4",
    ] {
        dir.expect(&format!("{options} {SMALL} -o plain.exr"), 0);
        dir.expect(&format!("{options} {SMALL} -o a.exr --layers all"), 0);
        let (plain, all) = (channels(&dir, "plain.exr"), channels(&dir, "a.exr"));
        for channel in ["R", "G", "B"] {
            assert_eq!(plain[channel], all[channel], "{options}");
        }
        // Continue with more samples than the kept checkpoint has.
        if !options.contains("--error") {
            let more = options.replace("--samples ", "--samples 1");
            dir.expect(&format!("{options} {SMALL} -o b.exr --layers all --keep-checkpoint"), 0);
            let refused = dir.expect(&format!("{more} {SMALL} -o b.exr --layers depth --resume"), 2);
            assert!(refused.contains("layers"), "{refused}");
            dir.expect(&format!("{more} {SMALL} -o b.exr --layers all --resume"), 0);
            dir.expect(&format!("{more} {SMALL} -o a.exr --layers all"), 0);
            assert_eq!(channels(&dir, "b.exr"), channels(&dir, "a.exr"), "{options}");
        }
    }
}

#[test]
fn layers_need_an_exr_output() {
    let dir = dir();
    for (options, words) in [
        ("--once -o a.png --layers all", "a.png"),
        ("--once -o a.exr -o b.hdr --layers all", "b.hdr"),
        ("--once --layers depth", "room.png"),
        ("--once -o a.exr --layers depth,colour", "unknown layer \"colour\"; expected all, albedo"),
        ("--once -o a.exr --layers depth --view normal", "`beauty` view"),
        ("--once -o a.part --shard 1/2 --layers depth", "--shard"),
        ("-o a.exr --layers depth", "--layers needs --once"),
    ] {
        let stderr = dir.expect(&format!("room.toml {options}"), 2);
        assert!(stderr.contains(words), "{options}: {stderr}");
    }
}
