//! MTL by `tobj`, with the checks that it leaves to its caller.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use super::text::{with_line_feeds, without_mark};
use crate::assets::read::{self, Watch};
use crate::assets::{AssetError, FileHash, FileMaterial, PhysicalMaterial};
use crate::math::{DVec3, Vec3};

/// Most bytes of a material file.
const FILE_LIMIT: u64 = 64 << 20;

/// The materials of an MTL file.
pub(super) struct Library {
    pub(super) materials: Vec<tobj::Material>,
    /// Warnings of statements that were left out.
    pub(super) warnings: Vec<String>,
    /// Hash of the file.
    pub(super) hash: FileHash,
}

/// Reads an MTL file.
///
/// # Errors
/// The errors of reading, and [`AssetError::Malformed`] with the line.
pub(super) fn load(path: &Path, watch: Watch<'_>) -> Result<Library, AssetError> {
    let quiet = Watch { progress: &crate::control::ignore_progress, ..watch };
    let bytes = read::text(path, FILE_LIMIT, quiet)?;
    let hash = read::hash(&bytes);
    let mut text = String::with_capacity(bytes.len());
    let mut warnings = Vec::new();
    let bytes = with_line_feeds(without_mark(&bytes));
    for (index, line) in String::from_utf8_lossy(&bytes).lines().enumerate() {
        let line = plain(without_comment(line));
        check(&line).map_err(|reason| AssetError::malformed(path, Some(index + 1), reason))?;
        if is_spectral(&line) {
            let (file, number) = (path.display(), index + 1);
            warnings.push(format!("{file}:{number}: spectra are not read; the usual colour stands in"));
            text.push('\n');
            continue;
        }
        text.push_str(&line);
        text.push('\n');
    }
    let (materials, _) = tobj::load_mtl_buf(&mut text.as_bytes())
        .map_err(|error| AssetError::malformed(path, None, error.to_string()))?;
    Ok(Library { materials, warnings, hash })
}

/// Statements of colours.
const COLORS: [&str; 4] = ["Ka", "Kd", "Ks", "Ke"];

/// The line in the words that `tobj` knows: a colour of one number is grey, one of CIE's XYZ becomes RGB, and a halo is forgotten.
fn plain(line: &str) -> Cow<'_, str> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let numbers = |words: &[&str]| words.iter().map(|word| word.parse().ok()).collect::<Option<Vec<f64>>>();
    match words.as_slice() {
        [color, grey] if COLORS.contains(color) => format!("{color} {grey} {grey} {grey}").into(),
        [color, "xyz", values @ ..] if COLORS.contains(color) => match numbers(values).as_deref() {
            Some([grey]) => rgb_line(color, [*grey; 3]).into(),
            Some([x, y, z]) => rgb_line(color, [*x, *y, *z]).into(),
            Some(_) | None => line.into(),
        },
        ["d", "-halo", number] => format!("d {number}").into(),
        _ => line.into(),
    }
}

/// A colour's statement by CIE's XYZ: linear Rec. 709 (ITU-R BT.709, its primaries and its white D65).
fn rgb_line(statement: &str, [x, y, z]: [f64; 3]) -> String {
    let red = 3.240_97 * x - 1.537_38 * y - 0.498_61 * z;
    let green = -0.969_24 * x + 1.875_97 * y + 0.041_56 * z;
    let blue = 0.055_63 * x - 0.203_98 * y + 1.056_97 * z;
    format!("{statement} {red} {green} {blue}")
}

/// Whether the line gives a colour by a file of a spectrum.
fn is_spectral(line: &str) -> bool {
    let mut words = line.split_whitespace();
    words.next().is_some_and(|word| COLORS.contains(&word)) && words.next() == Some("spectral")
}

/// The line without a comment, which may follow numbers. In names, `#` may be a letter like others; the look-up of a
/// name decides what is a comment there.
fn without_comment(line: &str) -> &str {
    let is_numeric = matches!(
        line.split_whitespace().next(),
        Some(
            "Ka" | "Kd"
                | "Ks"
                | "Ke"
                | "Ns"
                | "Ni"
                | "d"
                | "Tr"
                | "illum"
                | "Pr"
                | "Pm"
                | "Pc"
                | "Pcr"
                | "Ps"
        )
    );
    if is_numeric { line.split('#').next().unwrap_or(line) } else { line }
}

/// The text whole, then without its last comment, and so on.
pub(super) fn cut_at_comments(text: &str) -> impl Iterator<Item = &str> {
    let is_comment = |(at, _): &(usize, &str)| text[..*at].ends_with([' ', '\t']);
    let cuts = text.rmatch_indices('#').filter(is_comment).map(|(at, _)| text[..at].trim_end());
    std::iter::once(text).chain(cuts).filter(|text| !text.is_empty())
}

/// Checks a line: `tobj` panics on a colour of one number and accepts `nan`.
fn check(line: &str) -> Result<(), String> {
    let mut words = line.split_whitespace();
    let Some(keyword) = words.next() else { return Ok(()) };
    if is_spectral(line) {
        return Ok(());
    }
    let wanted = match keyword {
        "Ka" | "Kd" | "Ks" | "Ke" => 3,
        "Ns" | "Ni" | "d" | "Tr" | "Pr" | "Pm" | "Pc" | "Pcr" | "Ps" => 1,
        _ => return check_words(keyword, words.next()),
    };
    let numbers = words.take(wanted).filter(|word| word.parse().is_ok_and(f32::is_finite)).count();
    let expected = if wanted == 1 { "a finite number" } else { "three finite numbers" };
    if numbers == wanted { Ok(()) } else { Err(format!("`{keyword}` is followed by {expected}")) }
}

fn check_words(keyword: &str, argument: Option<&str>) -> Result<(), String> {
    match (keyword, argument) {
        ("newmtl", None) => Err("`newmtl` is followed by a name".to_owned()),
        ("illum", argument) if argument.is_none_or(|word| word.parse::<u8>().is_err()) => {
            Err("`illum` is followed by a whole number".to_owned())
        }
        (map, None) if map == "bump" || map.starts_with("map_") => {
            Err(format!("`{map}` is followed by a file"))
        }
        _ => Ok(()),
    }
}

/// A material for the renderer; files are relative to `folder`, the MTL's. Missing values are those of other readers of
/// the format: diffuse 0.6 grey without a texture, white with one.
pub(super) fn material(found: &tobj::Material, folder: &Path) -> FileMaterial {
    let file = |statement: Option<&str>| {
        let files =
            cut_at_comments(statement?).filter_map(|statement| Some(folder.join(file_name(statement)?)));
        let files: Vec<_> = files.collect();
        files.iter().find(|file| file.exists()).or(files.first()).cloned()
    };
    let extra = |key: &str| found.unknown_param.get(key).map(String::as_str);
    let diffuse_texture = file(found.diffuse_texture.as_deref());
    let plain = if diffuse_texture.is_some() { 1.0 } else { 0.6 };
    let emission_texture = file(extra("map_Ke"));
    let shining = if emission_texture.is_some() { 1.0 } else { 0.0 };
    let normals = extra("norm").or(extra("map_Kn")).or(found.normal_texture.as_deref());
    FileMaterial {
        name: found.name.clone(),
        diffuse: color(found.diffuse, plain),
        specular: color(found.specular, 0.0),
        shininess: (found.shininess.unwrap_or(0.0) as f32).max(0.0),
        emission: color(found.emissive, shining),
        ior: found.optical_density.unwrap_or(1.0) as f32,
        illumination_model: found.illumination_model,
        opacity: opacity(found),
        opacity_texture: file(found.dissolve_texture.as_deref()),
        diffuse_texture,
        specular_texture: file(found.specular_texture.as_deref()),
        emission_texture,
        normal_texture: file(normals),
        normal_strength: normals.map_or(1.0, multiplier),
        physical: physical(found, file),
    }
}

/// The opacity: `d`, or else 1 − `Tr`, unless that alone would hide the material.
fn opacity(found: &tobj::Material) -> f32 {
    let opacity = found.dissolve.or_else(|| transparency(found).map(|part| 1.0 - part));
    if is_hidden_by_tr(found) { 1.0 } else { opacity.unwrap_or(1.0).clamp(0.0, 1.0) as f32 }
}

fn transparency(found: &tobj::Material) -> Option<f64> {
    found.unknown_param.get("Tr")?.split_whitespace().next()?.parse().ok()
}

/// Whether `Tr` says without `d` that there is nothing to see: MeshLab and others write so what is opaque.
fn is_hidden_by_tr(found: &tobj::Material) -> bool {
    found.dissolve.is_none() && transparency(found).is_some_and(|part| part >= 1.0)
}

/// Warnings of materials of a file that are not shown by the letter.
pub(super) fn warnings<'a>(path: &Path, materials: impl Iterator<Item = &'a tobj::Material>) -> Vec<String> {
    let (mut hidden, mut dull) = (Vec::new(), Vec::new());
    for found in materials {
        let own = material(found, Path::new(""));
        // Glass has no opacity, and the other models no highlight.
        let (is_glass, is_shiny) = match own.illumination_model {
            Some(4 | 6 | 7 | 9) => (true, false),
            Some(0 | 1 | 3 | 5 | 8) => (false, false),
            Some(_) | None => (false, own.physical.is_none()),
        };
        if is_hidden_by_tr(found) && own.opacity_texture.is_none() && !is_glass {
            hidden.push(own.name.clone());
        }
        let has_strength = own.specular != Vec3::ZERO || own.specular_texture.is_some();
        if is_shiny && has_strength && !own.has_highlight() {
            dull.push(own.name);
        }
    }
    let said = |names: &[String], what: &str| {
        let more = if names.len() > 1 { format!(" and {} more", names.len() - 1) } else { String::new() };
        names.first().map(|first| format!("{}: {first:?}{more}: {what}", path.display()))
    };
    let hidden = said(&hidden, "`Tr 1` without `d` counts as opaque; write `d 0` for what is not to be seen");
    let dull = said(&dull, "`Ks` without `Ns` above 0 makes no highlight");
    hidden.into_iter().chain(dull).collect()
}

/// Statements of the extension for physically based rendering that make a material physical; `Ps` and `aniso` have no other effect.
const PHYSICAL: [&str; 8] = ["Pr", "Pm", "Pc", "Pcr", "Ps", "aniso", "map_Pr", "map_Pm"];

/// The extension for physically based rendering; `file` finds the file of a statement.
fn physical(
    found: &tobj::Material,
    file: impl Fn(Option<&str>) -> Option<PathBuf>,
) -> Option<PhysicalMaterial> {
    let extra = |key: &str| found.unknown_param.get(key).map(String::as_str);
    PHYSICAL.iter().any(|key| extra(key).is_some()).then(|| {
        let number = |key, otherwise: f32| {
            let word = extra(key).and_then(|text| text.split_whitespace().next());
            word.and_then(|word| word.parse().ok()).map_or(otherwise, |number: f32| number.clamp(0.0, 1.0))
        };
        let [roughness_texture, metallic_texture] = ["map_Pr", "map_Pm"].map(|key| file(extra(key)));
        PhysicalMaterial {
            roughness: number("Pr", 0.5),
            metallic: number("Pm", 0.0),
            clearcoat: number("Pc", 0.0),
            clearcoat_roughness: number("Pcr", 0.0),
            roughness_texture,
            metallic_texture,
        }
    })
}

/// Files of all maps of a material, also of unused maps.
pub(super) fn pictures(found: &tobj::Material, folder: &Path) -> Vec<PathBuf> {
    let known = [
        &found.ambient_texture,
        &found.diffuse_texture,
        &found.specular_texture,
        &found.normal_texture,
        &found.shininess_texture,
        &found.dissolve_texture,
    ];
    let is_map = |key: &str| {
        let key = key.to_ascii_lowercase();
        key.starts_with("map_") || ["norm", "bump", "disp", "decal", "refl"].contains(&key.as_str())
    };
    let others = found.unknown_param.iter().filter(|(key, _)| is_map(key)).map(|(_, value)| value);
    let mut names: Vec<String> = known
        .into_iter()
        .flatten()
        .chain(others)
        .flat_map(|text| cut_at_comments(text))
        .filter_map(file_name)
        .collect();
    names.sort();
    names.dedup();
    names.into_iter().map(|name| folder.join(name)).collect()
}

/// The colour, with 0 for negative components.
fn color(found: Option<[f64; 3]>, otherwise: f32) -> Vec3 {
    found.map_or(Vec3::splat(otherwise), |numbers| DVec3::from_array(numbers).as_vec3().max(Vec3::ZERO))
}

/// The number of the option `-bm` of a map; 1 without it, or if it is below 0 or no number.
fn multiplier(statement: &str) -> f32 {
    let mut words = statement.split_whitespace().skip_while(|word| *word != "-bm").skip(1);
    let number = words.next().and_then(|word| word.parse().ok());
    number.filter(|number: &f32| number.is_finite() && *number >= 0.0).unwrap_or(1.0)
}

/// The file of a map, behind its options (`-bm 1.0 -s 2 2 2 a name.png`), with either slash.
fn file_name(statement: &str) -> Option<String> {
    let mut rest = statement.trim();
    while let Some(option) = rest.strip_prefix('-') {
        let (name, behind) = option.split_once(char::is_whitespace)?;
        let most = match name {
            "o" | "s" | "t" => 3,
            "mm" => 2,
            "blendu" | "blendv" | "cc" | "clamp" | "texres" | "bm" | "boost" | "imfchan" | "type" => 1,
            _ => 0,
        };
        rest = behind.trim_start();
        let numeric = ["o", "s", "t", "mm"].contains(&name);
        for _ in 0..most {
            // The last word is the file.
            let Some((argument, behind)) = rest.split_once(char::is_whitespace) else { break };
            if numeric && argument.parse::<f32>().is_err() {
                break;
            }
            rest = behind.trim_start();
        }
    }
    // Some exporters quote names that have spaces.
    let rest = rest.strip_prefix('"').and_then(|name| name.strip_suffix('"')).unwrap_or(rest);
    (!rest.is_empty()).then(|| rest.replace('\\', "/"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::{CancelToken, ignore_progress};

    fn read(text: &str) -> Result<Vec<FileMaterial>, AssetError> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.mtl");
        std::fs::write(&path, text).expect("written");
        let token = CancelToken::new();
        let found = load(&path, Watch { progress: &ignore_progress, token: &token })?.materials;
        Ok(found.iter().map(|found| material(found, Path::new("models"))).collect())
    }

    #[test]
    fn every_statement_finds_its_field() {
        let text = "newmtl red brick\nKa 0.1 0.2 0.3\nKd 0.5 0.4 -0.3\nKs 0.2 0.2 0.2\nKe 4 5 6\nNs 25\nNi 1.5\n\
                    illum 7\nmap_Kd -s 2 2 2 -o 0.5 wall one.png\nmap_Ks sub\\shine.png\nmap_Bump -bm 0.5 old.png\n\
                    norm bumps.png\nmap_Ke glow.png\nnewmtl plain\nnewmtl bulb\nmap_Ke glow.png\n";
        let materials = read(text).expect("whole");
        assert_eq!(materials.len(), 3);
        let file = |name: &str| Some(PathBuf::from("models").join(name));
        let expected = FileMaterial {
            name: "red brick".to_owned(),
            diffuse: Vec3::new(0.5, 0.4, 0.0),
            specular: Vec3::splat(0.2),
            shininess: 25.0,
            emission: Vec3::new(4.0, 5.0, 6.0),
            ior: 1.5,
            illumination_model: Some(7),
            opacity: 1.0,
            opacity_texture: None,
            diffuse_texture: file("wall one.png"),
            specular_texture: file("sub/shine.png"),
            emission_texture: file("glow.png"),
            normal_texture: file("bumps.png"),
            normal_strength: 1.0,
            physical: None,
        };
        assert_eq!(materials[0], expected);
        assert_eq!((materials[1].diffuse, materials[1].emission), (Vec3::splat(0.6), Vec3::ZERO));
        assert_eq!(materials[2].emission, Vec3::ONE);
    }

    #[test]
    fn colours_are_read_as_the_format_has_them() {
        let diffuse = |statement: &str| read(&format!("newmtl a\n{statement}\n")).expect("whole")[0].diffuse;
        assert_eq!(diffuse("Kd 0.25 # grey"), Vec3::splat(0.25));
        // The white of D65 and the primary red of Rec. 709.
        assert!((diffuse("Kd xyz 0.95046 1 1.08906") - Vec3::ONE).length() < 1e-3);
        assert!((diffuse("Kd xyz 0.41239 0.21264 0.01933") - Vec3::X).length() < 1e-3);
        assert_eq!(diffuse("Kd spectral brass.rfl 0.5"), Vec3::splat(0.6));
        assert_eq!(read("newmtl a\nd -halo 0.5\n").expect("whole")[0].opacity, 0.5);
        let quoted = read("newmtl a\nmap_Kd -s 1 1 1 \"wall one.png\"\n").expect("whole");
        assert_eq!(quoted[0].diffuse_texture, Some(PathBuf::from("models/wall one.png")));
        for broken in ["Kd", "Kd 1 2", "Kd xyz 1 2", "Kd xyz x", "Kd x"] {
            let error = read(&format!("newmtl a\n{broken}\n")).expect_err(broken).to_string();
            assert!(error.ends_with("a.mtl:2: `Kd` is followed by three finite numbers"), "{error}");
        }
    }

    #[test]
    fn a_bump_multiplier_is_the_strength_of_the_normal_map() {
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
            assert_eq!(found[0].normal_texture, Some(PathBuf::from("models/n.png")), "{statement}");
        }
    }

    #[test]
    fn opacity_is_what_is_said_first_of_all_by_d() {
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
        assert_eq!(found[0].opacity_texture, Some(PathBuf::from("models/mask.png")));
        let error = read("newmtl a\nTr x\n").expect_err("refused").to_string();
        assert!(error.ends_with("a.mtl:2: `Tr` is followed by a finite number"), "{error}");
    }

    #[test]
    fn the_statements_of_the_extension_find_their_fields() {
        let physical = |text: &str| read(&format!("newmtl a\n{text}")).expect("whole")[0].physical.clone();
        assert_eq!(physical("Kd 1 0 0\n"), None);
        let plain = PhysicalMaterial {
            roughness: 0.5,
            metallic: 0.0,
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
            roughness_texture: None,
            metallic_texture: None,
        };
        assert_eq!(physical("Ps 0.25\n"), Some(plain.clone()));
        assert_eq!(physical("aniso 0.5\n"), Some(plain.clone()));
        let all = "Pr 0.3 # dull\nPm 1.5\nPc -1\nPcr 0.1\nmap_Pr -s 1 1 1 dull.png\nmap_Pm metal.png\n";
        let file = |name: &str| Some(Path::new("models").join(name));
        let expected = PhysicalMaterial {
            roughness: 0.3,
            metallic: 1.0,
            clearcoat: 0.0,
            clearcoat_roughness: 0.1,
            roughness_texture: file("dull.png"),
            metallic_texture: file("metal.png"),
        };
        assert_eq!(physical(all), Some(expected));
        assert_eq!(
            physical("map_Pm metal.png\n"),
            Some(PhysicalMaterial { metallic_texture: file("metal.png"), ..plain })
        );
        let error = read("newmtl a\nPr rough\n").expect_err("refused").to_string();
        assert!(error.ends_with("a.mtl:2: `Pr` is followed by a finite number"), "{error}");
    }

    #[test]
    fn the_pictures_of_all_maps_are_known() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.mtl");
        let maps =
            ["map_Ka", "map_Kd", "map_Ks", "map_Ns", "map_d", "map_Bump", "norm", "map_Ke", "disp", "decal"];
        let statements = maps.map(|map| format!("{map} {map}.png\n")).concat();
        std::fs::write(&path, format!("newmtl a\n{statements}refl -type sphere map_Kd.png\n"))
            .expect("written");
        let token = CancelToken::new();
        let found =
            load(&path, Watch { progress: &ignore_progress, token: &token }).expect("whole").materials;
        let mut expected = maps.map(|map| PathBuf::from(format!("models/{map}.png")));
        expected.sort();
        assert_eq!(pictures(&found[0], Path::new("models")), expected);
    }

    #[test]
    fn options_may_have_fewer_numbers_than_three() {
        for options in
            ["-o 0", "-o 0 0", "-s 1 1", "-t 0.5", "-blendu on -o 0 0", "-mm 0", "-clamp on -s 2 -o 1 1"]
        {
            let found = read(&format!("newmtl a\nmap_Kd {options} u.png\n")).expect("whole");
            assert_eq!(found[0].diffuse_texture, Some(PathBuf::from("models/u.png")), "{options}");
        }
    }

    #[test]
    fn a_comment_may_follow_a_file() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("wall.png"), "").expect("written");
        std::fs::write(folder.path().join("Map #1.png"), "").expect("written");
        let file = |name: &str| Some(folder.path().join(name));
        let text =
            "newmtl a\nmap_Kd -s 2 2 2 wall.png # of brick\nmap_Ks Map #1.png # as it came\nnorm no #2.png\n";
        let path = folder.path().join("a.mtl");
        std::fs::write(&path, text).expect("written");
        let token = CancelToken::new();
        let found =
            load(&path, Watch { progress: &ignore_progress, token: &token }).expect("whole").materials;
        let found = material(&found[0], folder.path());
        assert_eq!(found.diffuse_texture, file("wall.png"));
        assert_eq!(found.specular_texture, file("Map #1.png"));
        assert_eq!(found.normal_texture, file("no #2.png"), "as the file has it, where there is none");
    }

    #[test]
    fn errors_name_the_line() {
        let says = |text: &str| read(text).expect_err("refused").to_string();
        assert!(says("newmtl a\nKd 0.5 1\n").ends_with("a.mtl:2: `Kd` is followed by three finite numbers"));
        assert!(says("newmtl a\n\nNs nan\n").ends_with("a.mtl:3: `Ns` is followed by a finite number"));
        assert!(says("newmtl\n").ends_with("a.mtl:1: `newmtl` is followed by a name"));
        assert!(
            says("newmtl a # b\nKd 1 0 # 0\n").ends_with("a.mtl:2: `Kd` is followed by three finite numbers")
        );
        assert!(read("newmtl a\nKd 1 0 0# red\nillum 2#x\nNs 3#\n").is_ok());
        assert!(says("illum x\n").contains("whole number"));
        assert!(says("map_Kd\n").contains("followed by a file"));
    }
}
