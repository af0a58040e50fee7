//! Named dielectrics, and the Fresnel reflectance of dielectrics.

/// Mitsuba's named dielectrics and their indices of refraction at 589 nm.
const DIELECTRICS: [(&str, f64); 23] = [
    ("vacuum", 1.0),
    ("helium", 1.000_036),
    ("hydrogen", 1.000_132),
    ("air", 1.000_277),
    ("carbon dioxide", 1.000_45),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.520_45),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("diamond", 2.419),
];

/// Looks up the index of refraction of a named dielectric. Case does not matter.
pub(crate) fn dielectric_ior(name: &str) -> Option<f64> {
    DIELECTRICS.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, ior)| *ior)
}

/// The names of all dielectrics.
pub(crate) fn dielectric_names() -> impl Iterator<Item = &'static str> {
    DIELECTRICS.iter().map(|(name, _)| *name)
}

/// Average of the Fresnel reflectance of a smooth dielectric over a cosine-weighted hemisphere, ∫ 2 F(μ) μ
/// dμ. `eta` is the index of refraction on the transmitted side, relative to the incident side.
pub(crate) fn mean_fresnel_reflectance(eta: f64) -> f64 {
    const STEPS: u32 = 4096;
    let cosine = |index: u32| (f64::from(index) + 0.5) / f64::from(STEPS);
    let sum: f64 = (0..STEPS).map(cosine).map(|mu| 2.0 * dielectric_reflectance(mu, eta) * mu).sum();
    sum / f64::from(STEPS)
}

/// Fresnel reflectance of a dielectric for unpolarized light. `cosine` ≥ 0 is the cosine of the angle of
/// incidence.
pub(crate) fn dielectric_reflectance(cosine: f64, eta: f64) -> f64 {
    let sine_squared = (1.0 - cosine * cosine) / (eta * eta);
    if sine_squared >= 1.0 {
        return 1.0;
    }
    let refracted = (1.0 - sine_squared).sqrt();
    let parallel = (eta * cosine - refracted) / (eta * cosine + refracted);
    let perpendicular = (cosine - eta * refracted) / (cosine + eta * refracted);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_fresnel_matches_known_values() {
        assert!((dielectric_reflectance(1.0, 1.5) - 0.04).abs() < 1e-12);
        // d'Eon and Irving (2011): 0.0918 from outside, and 1 − (1 − outside)/η² from inside.
        let (outside, inside) = (mean_fresnel_reflectance(1.5), mean_fresnel_reflectance(1.0 / 1.5));
        assert!((outside - 0.0918).abs() < 2e-4, "{outside}");
        assert!((inside - (1.0 - (1.0 - outside) / 2.25)).abs() < 1e-4, "{inside}");
    }

    #[test]
    fn dielectric_names_ignore_case() {
        assert_eq!(dielectric_ior("BK7"), Some(1.5046));
        assert_eq!(dielectric_ior("glass"), None);
        assert!(dielectric_names().all(|name| dielectric_ior(name).is_some()));
    }
}
