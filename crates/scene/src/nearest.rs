//! The nearest of the names that exist.

use strsim::osa_distance;

/// The candidate that differs least from what was written, if it is near enough to be meant: at most one
/// change in three characters, letter case and `-` for `_` not counted.
pub fn nearest<'a>(written: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    const LONGEST: usize = 64;
    if written.len() > LONGEST {
        return None;
    }
    let plain = |name: &str| name.to_lowercase().replace('-', "_");
    let written = plain(written);
    candidates
        .into_iter()
        .filter(|candidate| candidate.len() <= LONGEST)
        .map(|candidate| (osa_distance(&written, &plain(candidate)), candidate))
        .filter(|(distance, candidate)| distance * 3 <= candidate.len().max(written.len()))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Names that other programs have for what scenes of glimt call otherwise, each with what may be meant.
const ELSEWHERE: [(&[&str], &[&str]); 17] = [
    (
        &["color", "colour", "albedo", "base_color", "kd"],
        &["diffuse", "reflectance", "tint", "intensity", "irradiance"],
    ),
    (&["roughness", "glossiness", "exponent", "ns"], &["shininess"]),
    (&["ks"], &["specular"]),
    (&["emissive", "emit", "radiance"], &["emission"]),
    (
        &["strength", "power", "energy", "brightness"],
        &["intensity", "irradiance", "color", "scale", "emission"],
    ),
    (&["refraction", "eta", "index"], &["ior"]),
    (&["pos", "location", "eye", "from", "origin"], &["position", "center", "corner", "point", "base"]),
    (&["target", "to", "at", "aim"], &["look_at"]),
    (&["cube", "cuboid"], &["box"]),
    (&["ball"], &["sphere"]),
    (&["rectangle", "rect", "square", "parallelogram"], &["quad"]),
    (&["circle", "disc"], &["disk"]),
    (&["donut", "ring"], &["torus"]),
    (&["model", "object"], &["mesh"]),
    (&["lamp"], &["light"]),
    (&["sky", "world", "envmap"], &["environment"]),
    (&["sun", "distant", "infinite", "parallel"], &["directional"]),
];

/// The candidate that is meant by a name that another program has for it, else the nearest.
pub fn meant<'a>(written: &str, candidates: &[&'a str]) -> Option<&'a str> {
    let plain = written.to_lowercase().replace('-', "_");
    let named = ELSEWHERE.iter().find(|(names, _)| names.contains(&plain.as_str()));
    let known = |name: &&str| candidates.iter().find(|candidate| *candidate == name).copied();
    let meant = named.and_then(|(_, meant)| meant.iter().find_map(known));
    meant.or_else(|| nearest(written, candidates.iter().copied()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_other_programs_are_known() {
        let phong = ["type", "diffuse", "specular", "shininess", "emission", "normal_strength"];
        assert_eq!(meant("color", &phong), Some("diffuse"));
        assert_eq!(meant("Roughness", &phong), Some("shininess"));
        assert_eq!(meant("color", &["reflectance"]), Some("reflectance"));
        assert_eq!(meant("strength", &["position", "intensity"]), Some("intensity"));
        assert_eq!(meant("strength", &["direction", "irradiance"]), Some("irradiance"));
        assert_eq!(meant("cube", &["box", "sphere"]), Some("box"));
        assert_eq!(meant("sun", &["point", "spot", "directional"]), Some("directional"));
        assert_eq!(meant("raduis", &["radius"]), Some("radius"));
        assert_eq!(meant("sun", &["point"]), None);
    }

    #[test]
    fn finds_slips_and_refuses_strangers() {
        let keys = ["center", "radius", "material", "u", "v"];
        assert_eq!(nearest("raduis", keys), Some("radius"));
        assert_eq!(nearest("centre", keys), Some("center"));
        assert_eq!(nearest("Material", keys), Some("material"));
        assert_eq!(nearest("w", keys), None);
        assert_eq!(nearest("colour", keys), None);
        assert_eq!(nearest("max-depth", ["max_depth"]), Some("max_depth"));
    }
}
