//! Suggests corrections for misspelled names and for names from other renderers.

use strsim::osa_distance;

/// Returns the candidate with the smallest edit distance (optimal string alignment) to `written`, or `None`
/// if more than one third of the characters differ. Ignores case and treats `-` as `_`.
pub fn nearest_name<'a>(written: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    const MAX_LENGTH: usize = 64;
    if written.len() > MAX_LENGTH {
        return None;
    }
    let plain = |name: &str| name.to_lowercase().replace('-', "_");
    let written = plain(written);
    candidates
        .into_iter()
        .filter(|candidate| candidate.len() <= MAX_LENGTH)
        .map(|candidate| (osa_distance(&written, &plain(candidate)), candidate))
        .filter(|(distance, candidate)| distance * 3 <= candidate.len().max(written.len()))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Names used by other renderers and the corresponding names in glimt.
const FOREIGN_NAMES: [(&[&str], &[&str]); 20] = [
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
    (&["ortho_scale", "orthographic_size", "ymag"], &["view_height"]),
    (&["pinhole", "thinlens"], &["perspective"]),
    (&["spherical", "equirectangular", "latlong"], &["panorama"]),
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

/// If `written` is another renderer's name for a candidate, returns this candidate. Otherwise, returns the
/// nearest candidate.
pub fn translated_or_nearest_name<'a>(written: &str, candidates: &[&'a str]) -> Option<&'a str> {
    let plain = written.to_lowercase().replace('-', "_");
    let named = FOREIGN_NAMES.iter().find(|(names, _)| names.contains(&plain.as_str()));
    let known = |name: &&str| candidates.iter().find(|candidate| *candidate == name).copied();
    let meant = named.and_then(|(_, meant)| meant.iter().find_map(known));
    meant.or_else(|| nearest_name(written, candidates.iter().copied()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_from_other_renderers_are_known() {
        let phong = ["type", "diffuse", "specular", "shininess", "emission", "normal_strength"];
        assert_eq!(translated_or_nearest_name("color", &phong), Some("diffuse"));
        assert_eq!(translated_or_nearest_name("Roughness", &phong), Some("shininess"));
        assert_eq!(translated_or_nearest_name("color", &["reflectance"]), Some("reflectance"));
        assert_eq!(translated_or_nearest_name("strength", &["position", "intensity"]), Some("intensity"));
        assert_eq!(translated_or_nearest_name("strength", &["direction", "irradiance"]), Some("irradiance"));
        assert_eq!(translated_or_nearest_name("cube", &["box", "sphere"]), Some("box"));
        assert_eq!(translated_or_nearest_name("sun", &["point", "spot", "directional"]), Some("directional"));
        assert_eq!(translated_or_nearest_name("raduis", &["radius"]), Some("radius"));
        assert_eq!(translated_or_nearest_name("sun", &["point"]), None);
    }

    #[test]
    fn only_typos_match() {
        let keys = ["center", "radius", "material", "u", "v"];
        assert_eq!(nearest_name("raduis", keys), Some("radius"));
        assert_eq!(nearest_name("centre", keys), Some("center"));
        assert_eq!(nearest_name("Material", keys), Some("material"));
        assert_eq!(nearest_name("w", keys), None);
        assert_eq!(nearest_name("colour", keys), None);
        assert_eq!(nearest_name("max-depth", ["max_depth"]), Some("max_depth"));
    }
}
