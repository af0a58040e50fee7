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

#[cfg(test)]
mod tests {
    use super::*;

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
