//! Tests for MTL statements and their conversion to materials.

use super::ignored::{
    AMBIENT_MAP, BLACK_EMISSION, BRIGHT_MIRROR, DIFFUSE_UNDER_MIRROR, FILTER_IGNORED, GAINS_ENERGY,
    INVISIBLE_GLASS, SHADOW_CATCHER, UNKNOWN_MODEL, UNSHADED, ignored_statement_warning,
    unsupported_map_warning,
};
use super::map::ignored_option_warning;
use super::statements::{
    INTEGER, ONE_NUMBER, THREE_NUMBERS, expected_arguments_message, unknown_statement_warning,
    unsupported_spectrum_warning,
};
use super::*;
use crate::assets::{FileLine, FileMaterial, FileTexture, PhysicalMaterial, expect_rejection};
use crate::control::{CancelToken, ignore_progress};
use crate::materials::{Channel, ChannelSelector};
use crate::math::{DVec2, Vec2, Vec3};

/// Path of the MTL file whose materials are converted.
const LIBRARY: &str = "models/a.mtl";

/// A texture without options, defined on a line in [`LIBRARY`].
fn texture_of(name: &str, line: usize) -> FileTexture {
    let statement = FileLine { path: PathBuf::from(LIBRARY), line };
    FileTexture::new(Path::new("models").join(name), statement)
}

fn path(texture: &Option<FileTexture>) -> Option<&Path> {
    texture.as_ref().map(|texture| texture.path.as_path())
}

/// Returns the warnings about all materials in an MTL text.
fn warnings_of(text: &[u8]) -> Vec<String> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mtl");
    std::fs::write(&path, text).expect("written");
    let token = CancelToken::new();
    let MtlLibrary { materials, ignored, .. } =
        load(&path, Monitor { progress: &ignore_progress, token: &token }).expect("whole");
    collect_warnings(Path::new("a.mtl"), ignored, materials.iter())
}

fn read(text: &str) -> Result<Vec<FileMaterial>, AssetError> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mtl");
    std::fs::write(&path, text).expect("written");
    let token = CancelToken::new();
    let found = load(&path, Monitor { progress: &ignore_progress, token: &token })?.materials;
    Ok(found.iter().map(|found| to_file_material(found, Path::new(LIBRARY))).collect())
}

/// Asserts that `text` is rejected on `line` because `expected` is missing after `keyword`.
#[track_caller]
fn assert_rejected(text: &str, line: usize, keyword: &str, expected: &str) {
    assert_eq!(
        expect_rejection(read(text)),
        (Some(line), expected_arguments_message(keyword, expected)),
        "{text}"
    );
}

#[test]
fn every_statement_is_converted() {
    let text = "newmtl red brick\nKa 0.1 0.2 0.3\nKd 0.5 0.4 -0.3\nKs 0.2 0.2 0.2\nKe 4 5 6\nNs 25\nNi 1.5\n\
                illum 2\nmap_Kd -s 2 2 2 -o 0.5 wall one.png\nmap_Ks sub\\shine.png\nmap_Bump -bm 0.5 old.png\n\
                norm bumps.png\nmap_Ke glow.png\nnewmtl plain\nnewmtl bulb\nmap_Ke glow.png\n";
    let materials = read(text).expect("whole");
    assert_eq!(materials.len(), 3);
    let file = |name: &str, line: usize| Some(texture_of(name, line));
    let wall = FileTexture {
        repeat: Vec2::splat(2.0),
        offset: DVec2::new(0.5, 0.0),
        ..texture_of("wall one.png", 9)
    };
    let expected = FileMaterial {
        name: "red brick".to_owned(),
        diffuse: Vec3::new(0.5, 0.4, 0.0),
        specular: Vec3::splat(0.2),
        shininess: 25.0,
        emission: Vec3::new(4.0, 5.0, 6.0),
        ior: 1.5,
        illumination_model: Some(2),
        opacity: 1.0,
        opacity_texture: None,
        diffuse_texture: Some(wall),
        specular_texture: file("sub/shine.png", 10),
        emission_texture: file("glow.png", 13),
        normal_texture: file("bumps.png", 12),
        normal_strength: 1.0,
        physical: None,
    };
    assert_eq!(materials[0], expected);
    assert_eq!((materials[1].diffuse, materials[1].emission), (Vec3::splat(0.6), Vec3::ZERO));
    assert_eq!(materials[2].emission, Vec3::ONE);
}

#[test]
fn all_color_notations_are_read() {
    let diffuse = |statement: &str| read(&format!("newmtl a\n{statement}\n")).expect("whole")[0].diffuse;
    assert_eq!(diffuse("Kd 0.25 # gray"), Vec3::splat(0.25));
    // D65 white and the Rec. 709 red primary.
    assert!((diffuse("Kd xyz 0.95046 1 1.08906") - Vec3::ONE).length() < 1e-3);
    assert!((diffuse("Kd xyz 0.41239 0.21264 0.01933") - Vec3::X).length() < 1e-3);
    assert_eq!(diffuse("Kd spectral brass.rfl 0.5"), Vec3::splat(0.6));
    assert_eq!(read("newmtl a\nd -halo 0.5\n").expect("whole")[0].opacity, 0.5);
    let quoted = read("newmtl a\nmap_Kd -s 1 1 1 \"wall one.png\"\n").expect("whole");
    assert_eq!(path(&quoted[0].diffuse_texture), Some(Path::new("models/wall one.png")));
    for broken in ["Kd", "Kd 1 2", "Kd xyz 1 2", "Kd xyz x", "Kd x"] {
        assert_rejected(&format!("newmtl a\n{broken}\n"), 2, "Kd", THREE_NUMBERS);
    }
}

#[test]
fn bump_multipliers_scale_the_normal_map() {
    for (statement, strength) in [
        ("map_Bump -bm 0.5 n.png", 0.5),
        ("bump -clamp on -bm 2 -s 1 1 1 n.png", 2.0),
        ("norm -bm 0 n.png", 0.0),
        ("norm n.png", 1.0),
        ("norm -bm -3 n.png", 1.0),
        ("norm -bm nan n.png", 1.0),
    ] {
        let found = read(&format!("newmtl a\n{statement}\n")).expect("whole");
        assert_eq!(found[0].normal_strength, strength, "{statement}");
        assert_eq!(path(&found[0].normal_texture), Some(Path::new("models/n.png")), "{statement}");
    }
}

#[test]
fn opacity_prefers_d_to_tr() {
    for (statements, opacity) in [
        ("d 0.25 # of glass\n", 0.25),
        ("Tr 0.25\n", 0.75),
        ("Tr 1\nd 1\n", 1.0),
        ("d -1\n", 0.0),
        ("Tr -0.5\n", 1.0),
        ("Kd 1 1 1\n", 1.0),
    ] {
        let found = read(&format!("newmtl a\n{statements}")).expect("whole");
        assert_eq!((found[0].opacity, &found[0].opacity_texture), (opacity, &None), "{statements}");
    }
    let found = read("newmtl a\nd 1\nmap_d -mm 0 1 mask.png\n").expect("whole");
    assert_eq!(path(&found[0].opacity_texture), Some(Path::new("models/mask.png")));
    assert_rejected("newmtl a\nTr x\n", 2, "Tr", ONE_NUMBER);
}

#[test]
fn pbr_statements_are_converted() {
    let physical = |text: &str| read(&format!("newmtl a\n{text}")).expect("whole")[0].physical.clone();
    assert_eq!(physical("Kd 1 0 0\n"), None);
    let plain = PhysicalMaterial::default();
    assert_eq!(plain.roughness, 0.5);
    assert_eq!(physical("Ps 0.25\n"), Some(plain.clone()));
    assert_eq!(physical("aniso 0.5\n"), Some(plain.clone()));
    // Only metals are anisotropic.
    let brushed = PhysicalMaterial { metallic: 1.0, anisotropy: -0.5, ..plain.clone() };
    assert_eq!(physical("Pm 1\naniso -0.5\n"), Some(brushed));
    assert_eq!(physical("Pm 1\naniso 2\n").map(|own| own.anisotropy), Some(1.0));
    assert_eq!(physical("Pm 1\naniso 1\nmap_Pm metal.png\n").map(|own| own.anisotropy), Some(0.0));
    let all = "Pr 0.3 # dull\nPm 1.5\nPc -1\nPcr 0.1\nmap_Pr -s 1 1 1 dull.png\nmap_Pm metal.png\n\
               map_Pc coat.png\nMAP_PCR rough.png\n";
    let file = |name: &str, line: usize| Some(texture_of(name, line));
    let expected = PhysicalMaterial {
        roughness: 0.3,
        metallic: 1.0,
        clearcoat_roughness: 0.1,
        roughness_texture: file("dull.png", 6),
        metallic_texture: file("metal.png", 7),
        clearcoat_texture: file("coat.png", 8),
        clearcoat_roughness_texture: file("rough.png", 9),
        ..PhysicalMaterial::default()
    };
    assert_eq!(physical(all), Some(expected));
    assert_eq!(
        physical("map_Pm metal.png\n"),
        Some(PhysicalMaterial { metallic_texture: file("metal.png", 2), ..plain })
    );
    assert_rejected("newmtl a\nPr rough\n", 2, "Pr", ONE_NUMBER);
}

#[test]
fn all_map_images_are_listed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mtl");
    let maps =
        ["map_Ka", "map_Kd", "map_Ks", "map_Ns", "map_d", "map_Bump", "norm", "map_Ke", "disp", "decal"];
    let statements = maps.map(|map| format!("{map} {map}.png\n")).concat();
    std::fs::write(&path, format!("newmtl a\n{statements}refl -type sphere map_Kd.png\n")).expect("written");
    let token = CancelToken::new();
    let found = load(&path, Monitor { progress: &ignore_progress, token: &token }).expect("whole").materials;
    let mut expected = maps.map(|map| PathBuf::from(format!("models/{map}.png")));
    expected.sort();
    let mut image_paths: Vec<_> = found[0].candidate_image_paths(Path::new("models")).collect();
    image_paths.sort();
    image_paths.dedup();
    assert_eq!(image_paths, expected);
}

#[test]
fn options_accept_fewer_than_three_numbers() {
    for options in
        ["-o 0", "-o 0 0", "-s 1 1", "-t 0.5", "-blendu on -o 0 0", "-mm 0", "-clamp on -s 2 -o 1 1"]
    {
        let found = read(&format!("newmtl a\nmap_Kd {options} u.png\n")).expect("whole");
        assert_eq!(path(&found[0].diffuse_texture), Some(Path::new("models/u.png")), "{options}");
    }
}

#[test]
fn comments_may_follow_a_file_name() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("wall.png"), "").expect("written");
    std::fs::write(folder.path().join("Map #1.png"), "").expect("written");
    let text =
        "newmtl a\nNs 9\nmap_Kd -bm 2 wall.png # of brick\nmap_Ks Map #1.png # as it came\nnorm no #2.png\n";
    let path = folder.path().join("a.mtl");
    std::fs::write(&path, text).expect("written");
    let token = CancelToken::new();
    let found = load(&path, Monitor { progress: &ignore_progress, token: &token }).expect("whole").materials;
    let found = to_file_material(&found[0], &path);
    let file = |name: &str| folder.path().join(name);
    assert_eq!(super::tests::path(&found.diffuse_texture), Some(file("wall.png").as_path()));
    assert_eq!(super::tests::path(&found.specular_texture), Some(file("Map #1.png").as_path()));
    let whole = file("no #2.png");
    let normals = super::tests::path(&found.normal_texture);
    assert_eq!(normals, Some(whole.as_path()), "expected the whole name if no candidate exists");
}

#[test]
fn errors_include_line_and_reason() {
    for (text, line, keyword, expected) in [
        ("newmtl a\nKd 0.5 1\n", 2, "Kd", THREE_NUMBERS),
        ("newmtl a\n\nNs nan\n", 3, "Ns", ONE_NUMBER),
        ("newmtl\n", 1, "newmtl", "a name"),
        ("newmtl a # b\nKd 1 0 # 0\n", 2, "Kd", THREE_NUMBERS),
        ("illum x\n", 1, "illum", INTEGER),
        ("map_Kd\n", 1, "map_Kd", "a file name"),
    ] {
        assert_rejected(text, line, keyword, expected);
    }
    assert!(read("newmtl a\nKd 1 0 0# red\nillum 2#x\nNs 3#\n").is_ok());
}

#[test]
fn keywords_ignore_case() {
    let text = "NEWMTL a\nKD 1 0 0\nks .1 .2 .3\nKE 1 1 1\nns 5\nNI 2\nILLUM 7\nD 0.5\nMAP_kd t.png\nMap_d m.png\nBUMP b.png\nPR .25\n";
    let found = read(text).expect("whole").remove(0);
    assert_eq!((found.name.as_str(), found.diffuse, found.emission), ("a", Vec3::X, Vec3::ONE));
    assert_eq!((found.shininess, found.ior, found.illumination_model), (5.0, 2.0, Some(7)));
    assert_eq!((found.opacity, path(&found.diffuse_texture)), (0.5, Some(Path::new("models/t.png"))));
    assert_eq!(path(&found.opacity_texture), Some(Path::new("models/m.png")));
    assert_eq!(path(&found.normal_texture), Some(Path::new("models/b.png")));
    assert_eq!(found.physical.map(|physical| physical.roughness), Some(0.25));
}

#[test]
fn map_options_are_converted() {
    let texture = |statement: &str| {
        let found = read(&format!("newmtl a\n{statement}\n")).expect(statement).remove(0);
        found.opacity_texture.expect(statement)
    };
    let plain = || texture_of("t.png", 2);
    let channel = |channel| Some(ChannelSelector::Channel(channel));
    for (options, expected) in [
        ("-s 2 3 4", FileTexture { repeat: Vec2::new(2.0, 3.0), ..plain() }),
        ("-s 2", FileTexture { repeat: Vec2::new(2.0, 1.0), ..plain() }),
        ("-S -1 1", FileTexture { repeat: Vec2::new(-1.0, 1.0), ..plain() }),
        ("-o .25 -0.5 1", FileTexture { offset: DVec2::new(0.25, -0.5), ..plain() }),
        ("-clamp on", FileTexture { is_clamped: true, ..plain() }),
        ("-clamp off", plain()),
        ("-mm 0.25 0.5", FileTexture { range: (0.25, 0.5), ..plain() }),
        ("-mm 0.25", FileTexture { range: (0.25, 1.0), ..plain() }),
        ("-imfchan r", FileTexture { number: channel(Channel::Red), ..plain() }),
        ("-imfchan G", FileTexture { number: channel(Channel::Green), ..plain() }),
        ("-imfchan b", FileTexture { number: channel(Channel::Blue), ..plain() }),
        ("-imfchan m", FileTexture { number: channel(Channel::Alpha), ..plain() }),
        ("-imfchan l", FileTexture { number: Some(ChannelSelector::Luminance), ..plain() }),
        (
            "-blendu on -s 2 2 1 -clamp on -o 1",
            FileTexture {
                repeat: Vec2::splat(2.0),
                offset: DVec2::new(1.0, 0.0),
                is_clamped: true,
                ..plain()
            },
        ),
    ] {
        assert_eq!(texture(&format!("map_d {options} t.png")), expected, "{options}");
    }
    for (name, file) in [
        ("-dash.png", "-dash.png"),
        ("-s.png", "-s.png"),
        ("-s 2 -my wall.png", "-my wall.png"),
        ("-clamp on a - b.png", "a - b.png"),
        ("-o 1 2 3 4", "4"),
        ("-clamp.png", "-clamp.png"),
        ("-o", "-o"),
        ("-cc t.png", "t.png"),
        ("-bm t.png", "t.png"),
    ] {
        assert_eq!(texture(&format!("map_d {name}")).path, Path::new("models").join(file), "{name}");
    }
}

#[test]
fn ignored_statements_are_reported_with_line() {
    let of = |statements: &str| warnings_of(format!("newmtl a\n{statements}").as_bytes());
    for (statements, line, words) in [
        ("map_Kd -t 1 1 1 t.png\n", 2, ignored_option_warning("-t 1 1 1")),
        ("\nmap_Kd -cc on t.png\n", 3, ignored_option_warning("-cc on")),
        ("map_Kd -blendu off t.png\n", 2, ignored_option_warning("-blendu off")),
        ("map_Kd -boost 2 t.png\n", 2, ignored_option_warning("-boost 2")),
        ("map_Kd -texres 128 t.png\n", 2, ignored_option_warning("-texres 128")),
        ("map_Kd -imfchan r t.png\n", 2, ignored_option_warning("-imfchan")),
        ("map_d -imfchan z t.png\n", 2, ignored_option_warning("-imfchan z")),
        ("norm -mm 0 2 t.png\n", 2, ignored_option_warning("-mm")),
        ("norm -bm -3 t.png\n", 2, ignored_option_warning("-bm -3")),
        ("map_Kd -bm 3 t.png\n", 2, ignored_option_warning("-bm")),
        ("map_Ns t.png\n", 2, unsupported_map_warning("map_Ns")),
        ("refl -type sphere t.png\n", 2, unsupported_map_warning("refl")),
        ("map_Ka t.png\n", 2, AMBIENT_MAP.to_owned()),
        ("Kd spectral brass.rfl\n", 2, unsupported_spectrum_warning("Kd")),
        ("illum 0\n", 2, UNSHADED.to_owned()),
        ("illum 10\n", 2, SHADOW_CATCHER.to_owned()),
        ("illum 99\n", 2, UNKNOWN_MODEL.to_owned()),
        ("illum 4\n", 2, INVISIBLE_GLASS.to_owned()),
        ("d .5\nTf 1 0 0\n", 3, FILTER_IGNORED.to_owned()),
        ("Ke 0 0 0\nmap_Ke a.png\n", 3, BLACK_EMISSION.to_owned()),
        ("Kd 1 1 1\nillum 2\nd 1\nTf 0 1 0\n", 5, FILTER_IGNORED.to_owned()),
        ("Kd 255 0 0\n", 2, GAINS_ENERGY.to_owned()),
        ("Kd .5 .5 .5\nKs .9 .9 .9\nNs 0.5\nillum 2\n", 2, GAINS_ENERGY.to_owned()),
        ("Ks 2 2 2\nillum 3\n", 2, BRIGHT_MIRROR.to_owned()),
        ("Kd .1 .1 .1\nKs .9 .9 .9\nillum 3\n", 2, DIFFUSE_UNDER_MIRROR.to_owned()),
        ("Ps 0.5\n", 2, ignored_statement_warning("Ps")),
        ("Foo 1\n", 2, unknown_statement_warning("Foo")),
    ] {
        assert_eq!(of(statements), [format!("a.mtl:{line}: {words}")], "{statements}");
    }
    for quiet in [
        "Kd 1 1 1\nillum 2\nd 1\nTf 1 1 1\n",
        "Ka -1 0 0\nd 1\nTr 1\nillum 4\nNi 1.5\nTf 1\n",
        "map_Kd -s 2 2 2 -o 1 1 1 -clamp on -mm 0 1 -t 0 0 0 -blendu on t.png\nmap_Ka t.png\n",
        "Kd 1 1 1\nKs 1 1 1\nNs 10\nillum 1\n",
        "illum 7\nNi 1.5\nTf 1 1 1\n",
        "Ks 1 1 1\nillum 3\n",
        "Kd .8 .1 .1\nKs .2 .2 .2\nillum 3\nsharpness 60\n",
    ] {
        assert_eq!(of(quiet), [""; 0], "{quiet}");
    }
    // Warnings shared by several materials are merged.
    assert_eq!(
        warnings_of(b"Kd 1 1 1\nnewmtl a\nmap_Ns t.png\nnewmtl b\nmap_Ns t.png\nnewmtl a\n"),
        [
            format!("a.mtl:1: {NO_MATERIAL_YET}"),
            format!("a.mtl:6: {}", duplicate_material_warning("a", 2)),
            format!("a.mtl:3: {} (1 more)", unsupported_map_warning("map_Ns")),
        ]
    );
}

#[test]
fn unusable_values_are_reported_with_line() {
    let of = |statements: &str| warnings_of(format!("newmtl a\n\n{statements}\n").as_bytes());
    for (statement, words) in [
        ("Kd .5 -0.3 .5", "-0.3 in `Kd` is clamped to 0"),
        ("Kd -1", "-1 in `Kd` is clamped to 0"),
        ("ke -1", "-1 in `ke` is clamped to 0"),
        ("Ks 0 0 -2", "-2 in `Ks` is clamped to 0"),
        ("Ke 2e18", "2e18 in `Ke` is clamped to 1e18"),
        ("Kd xyz .2 0 0", "`Kd` is outside the RGB gamut; its negative components are clamped to 0"),
        ("Ns -5", "-5 in `Ns` is clamped to 0"),
        ("Ns 1e30", "1e30 in `Ns` is clamped to 1e18"),
        ("d 7", "7 in `d` is clamped to 1"),
        ("d -0.5", "-0.5 in `d` is clamped to 0"),
        ("Tr -0.5", "-0.5 in `Tr` is clamped to 0"),
        ("Pr 7", "7 in `Pr` is clamped to 1"),
        ("Pm -3", "-3 in `Pm` is clamped to 0"),
        ("Pc 1.5", "1.5 in `Pc` is clamped to 1"),
        ("Pcr -1", "-1 in `Pcr` is clamped to 0"),
        ("d -halo 0.5", "option `-halo` is ignored"),
        ("Kd 1 0 0 1", "extra words in `Kd` are ignored"),
        ("Ns 5 6", "extra words in `Ns` are ignored"),
        ("illum 2 3", "extra words in `illum` are ignored"),
        ("illum -1", UNKNOWN_MODEL),
        ("illum 300", UNKNOWN_MODEL),
        ("d 1\nTr 0.5", "`Tr` is ignored because `d` takes precedence"),
        ("Pr .5\nNi 0.9", "`Ni` is ignored because it is not above 1; 1.5 is used"),
        ("illum 7\nNi 20", "`Ni` is clamped to 10"),
        ("Pr .5\nKd 255 0 0", "`Kd` is clamped to 1"),
        ("illum 3\nKd .95 .95 .95\nKs .9 .9 .9", "`Ks` is clamped to 0.66 for a mirror over a diffuse color"),
        ("illum 7\nNi 1.5\nKe 1 1 1", "`Ke` has no effect on glass"),
        ("illum 7\nNi 1.5\nPr 0\nPm 1", "`Pm` has no effect on glass"),
        ("illum 3\nKs 1 1 1\nKe 1 1 1", "`Ke` has no effect on mirrors"),
    ] {
        let line = 3 + statement.matches('\n').count();
        assert_eq!(of(statement), [format!("a.mtl:{line}: {words}")], "{statement}");
    }
    assert_eq!(of("Kd xyz 0.41239 0.21264 0.01933"), [""; 0], "the red primary has tiny negative components");
}

#[test]
fn unusable_map_options_are_reported_with_line() {
    let of = |statement: &str| warnings_of(format!("newmtl a\n{statement}\n").as_bytes());
    for (options, ignored) in [
        ("-s 0 0 0", "-s 0 0 0"),
        ("-s 2 0", "-s 2 0"),
        ("-s inf", "-s inf"),
        ("-s 1e30 1", "-s 1e30 1"),
        ("-s", "-s"),
        ("-o nan", "-o nan"),
        ("-o 1 1 -inf", "-o 1 1 -inf"),
        ("-o", "-o"),
        ("-t nan", "-t nan"),
        ("-mm 0 nan", "-mm 0 nan"),
        ("-mm", "-mm"),
        ("-boost nan", "-boost nan"),
        ("-texres", "-texres"),
        ("-clamp", "-clamp"),
        ("-blendu", "-blendu"),
        ("-cc", "-cc"),
        ("-imfchan", "-imfchan"),
        ("-unknown 3", "-unknown 3"),
        ("-unknown on 1 2", "-unknown on 1 2"),
        ("-colorspace linear", "-colorspace linear"),
        ("-type cube_top", "-type cube_top"),
    ] {
        let statement = format!("map_d {options} h.png");
        assert_eq!(of(&statement), [format!("a.mtl:2: option `{ignored}` is ignored")], "{statement}");
        let found = read(&format!("newmtl a\n{statement}\n")).expect("whole").remove(0);
        let expected = texture_of("h.png", 2);
        assert_eq!(found.opacity_texture, Some(expected), "{statement}");
    }
    for (option, ignored) in [("-bm nan", "-bm nan"), ("-bm", "-bm"), ("-bm -3", "-bm -3")] {
        let words = format!("a.mtl:2: option `{ignored}` is ignored");
        assert_eq!(of(&format!("norm {option} h.png")), [words], "{option}");
    }
    // Without a number, the word may be part of the name.
    let words = "`-dash` is not a map option; it is read as part of the file name";
    assert_eq!(of("map_Kd -dash wall.png"), [format!("a.mtl:2: {words}")]);
    assert_eq!(of("map_Kd -dash.png"), [""; 0]);
}

#[test]
fn ineffective_maps_are_reported_with_line() {
    let of = |statements: &str| warnings_of(format!("newmtl a\n{statements}\n").as_bytes());
    for (statements, line, words) in [
        ("illum 7\nNi 1.5\nmap_Kd t.png", 4, "`map_Kd` has no effect on glass"),
        ("illum 7\nNi 1.5\nbump t.png", 4, "`bump` has no effect on glass"),
        ("illum 7\nNi 1.5\nmap_Pr t.png", 4, "`map_Pr` has no effect on glass"),
        ("illum 3\nKs 1 1 1\nmap_Ks t.png", 4, "`map_Ks` has no effect on mirrors"),
        ("illum 3\nKs .1 .1 .1\nKd 1 1 1\nnorm t.png", 5, "`norm` has no effect on mirrors"),
        ("Pr 0.5\nmap_Ks t.png", 3, "`map_Ks` has no effect on materials with PBR statements"),
        ("bump h.png\nnorm n.png", 2, "`bump` has no effect because the material has a normal map"),
        ("d 0.5\nmap_d t.png", 2, "the opacity map replaces `d`"),
        ("illum 5\nmap_Ks t.png", 3, "`Ks` has no effect unless `Ns` is above 0"),
    ] {
        assert_eq!(of(statements), [format!("a.mtl:{line}: {words}")], "{statements}");
    }
    let glass = read("newmtl a\nillum 7\nNi 1.5\nmap_Kd t.png\n").expect("whole").remove(0);
    assert_eq!(glass.diffuse_texture, None);
}

#[test]
fn illumination_models_select_the_reflection() {
    let of =
        |model: u8| read(&format!("newmtl a\nKd .8 0 0\nKs .5 .5 .5\nNs 9\nillum {model}\n")).expect("whole");
    assert_eq!(
        [0, 1, 2, 10].map(|model| of(model)[0].allows_specular_highlight()),
        [false, false, true, true]
    );
    assert!(of(3)[0].has_specular_coat());
    let black = read("newmtl a\nKs .5 .5 .5\nillum 3\n").expect("whole");
    assert_eq!((black[0].diffuse, black[0].has_specular_coat()), (Vec3::ZERO, false));
}

#[test]
fn latin_1_file_names_are_found() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().expect("a folder");
    let latin1 = |bytes: &[u8]| folder.path().join(std::ffi::OsStr::from_bytes(bytes));
    std::fs::write(latin1(b"caf\xe9.png"), "").expect("written");
    std::fs::write(folder.path().join("\u{e4}.png"), "").expect("written");
    let mtl =
        b"newmtl gr\xfcn\nNs 9\nmap_Kd caf\xe9.png\nmap_Ks \xe4.png\nnewmtl b\nmap_Kd caf\xc3\xa9.png\n";
    let path = folder.path().join("a.mtl");
    std::fs::write(&path, mtl).expect("written");
    let token = CancelToken::new();
    let found = load(&path, Monitor { progress: &ignore_progress, token: &token }).expect("whole").materials;
    let [a, b] = [0, 1].map(|index| to_file_material(&found[index], &path));
    assert_eq!(a.name, "gr\u{fc}n");
    assert_eq!(super::tests::path(&a.diffuse_texture), Some(latin1(b"caf\xe9.png").as_path()));
    assert_eq!(super::tests::path(&a.specular_texture), Some(folder.path().join("\u{e4}.png").as_path()));
    assert_eq!(super::tests::path(&b.diffuse_texture), Some(latin1(b"caf\xe9.png").as_path()));
}
