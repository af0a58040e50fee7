//! The `[photons]` table.

use super::super::description::PhotonOptions;
use super::super::keys::key::DefaultValue::Is;
use super::super::keys::key::ValueKind::{Flag, Number, Whole};
use super::super::keys::key::{MAX_INTEGER, TableInfo, TableSyntax, keys};
use super::limits::Limits::LengthOrZero;
use super::table::TableReader;

pub(crate) static PHOTONS: TableInfo = TableInfo::new(
    "photons",
    TableSyntax::Single,
    "Photon mapping in `whitted`: caustics and all other indirect light",
    keys! {
        /// Enables photon mapping; the key `p` toggles it.
        enabled: Flag, Is("false");
        /// Photons emitted per sample of the image. 0 means one per pixel, clamped to between 8,192 and
        /// 200,000. Values above 4 million are reduced to 4 million, with a warning.
        count: Whole(0, 1_000_000_000_000), Is("0"), "per pass";
        /// Kernel radius of the first pass; 0 chooses a radius based on the photon density.
        radius: Number(LengthOrZero), Is("0.0"), "length";
        /// Maximum number of bounces per photon.
        bounces: Whole(0, MAX_INTEGER), Is("16"), "bounces";
    },
);

pub(super) fn read_photons(root: &TableReader<'_>) -> Option<PhotonOptions> {
    let table = root.table_or_empty(&PHOTONS)?;
    let enabled = table.key("enabled").boolean();
    let (count, radius) = (table.key("count").integer(), table.key("radius").number());
    let bounces = table.key("bounces").integer();
    table.report_unknown_and_missing_keys();
    Some(PhotonOptions { enabled: enabled?, count: count?, radius: radius?, bounces: bounces? })
}
