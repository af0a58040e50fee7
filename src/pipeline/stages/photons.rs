//! Photon maps, which no integrator of this version gathers.

use super::Staged;

/// Why there are none. `wanted` is what the command line says, `enabled` what the scene says.
pub(in crate::pipeline) fn photons(enabled: bool, wanted: Option<bool>) -> Staged<()> {
    match wanted.unwrap_or(enabled) {
        true => Staged::skipped((), "this version renders no photons"),
        false if enabled => Staged::skipped((), "switched off for this run"),
        false => Staged::skipped((), "the scene does not enable photons"),
    }
}
