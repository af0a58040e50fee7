//! Memory that a render will need, foretold before the work: what does not fit is refused with the numbers.
//!
//! Film and picture are known to the byte. Meshes and images count as they were loaded. Trees and photons are estimates, on the safe
//! side: what builders of trees took at their peak for each triangle, and what maps take for each photon that is emitted.

use super::plan::Plan;
use super::render::share::Share;
use super::stages::Stop;
use super::stages::meshes::Meshes;
use crate::film::{Film, Rect, SumOrder};
use crate::integrators::PhotonSettings;
use crate::scene::description::{Accel, Scene};
use crate::system::memory::{Limit, limit};

/// Bytes of the program itself.
const PROGRAM: u64 = 24 << 20;
/// Bytes of a thread that renders: its stack and buffers. Rough glass takes the most.
const THREAD: u64 = 640 << 10;
/// Bytes of an object of any kind, in its tree.
const OBJECT: u64 = 250;
/// Bytes that the photons of a pass take while their maps are built, for each that is emitted.
const PHOTON: u64 = 220;
/// Bytes of maps that are kept from pass to pass.
const KEPT_MAPS: u64 = 128 << 20;

/// Most bytes of the frames of a moving picture, if the call says nothing about memory.
const MOST_FRAMES: u64 = 4 << 30;
/// Name of the frames among the parts.
const FRAMES: &str = "the frames";
/// Name of the own image's film among the parts.
const OWN_FILM: &str = "the unfinished film of the scene's own image";

/// A part of the memory, by its name.
type Item = (&'static str, u64);

/// Memory of a render, as far as it is known.
#[derive(Clone)]
pub(super) struct Foretold(Vec<Item>);

impl Foretold {
    /// Memory of the picture, before any file is read.
    pub(super) fn of_picture(plan: &Plan) -> Self {
        let render = &plan.settings.render;
        let whole = Rect { x: 0, y: 0, width: render.width, height: render.height };
        let (film, picture) =
            Film::memory_for((render.width, render.height), plan.crop.unwrap_or(whole), blocks(plan));
        let threads = plan.threads as u64 * THREAD;
        let mut items = vec![
            ("the program", PROGRAM),
            ("the film", film),
            ("the picture", picture),
            ("the threads", threads),
        ];
        if !plan.layers.is_empty() {
            // One film at a time, and a picture of each.
            items.push(("the layers", film + picture * plan.layers.len() as u64));
        }
        if let Some(turn) = plan.turn.filter(|_| !plan.moving.is_empty()) {
            let frame = u64::from(render.width) * u64::from(render.height) * 3;
            items.push((FRAMES, frame * u64::from(turn.of)));
        }
        Self(items)
    }

    /// The same with all that the scene names.
    pub(super) fn of_scene(plan: &Plan, scene: &Scene, meshes: &Meshes, texture_bytes: u64) -> Self {
        let Self(mut items) = Self::of_picture(plan);
        let triangle = match scene.render.accel {
            Accel::Bvh => 110,
            Accel::BvhHigh => 170,
            Accel::KdTree => 190,
        };
        let of_meshes: u64 = meshes.iter().map(|kept| kept.mesh.mesh.memory_bytes() as u64).sum();
        let triangles: u64 = meshes.iter().map(|kept| kept.mesh.mesh.triangles.len() as u64).sum();
        items.push(("meshes", of_meshes));
        items.push(("trees", triangles * triangle + scene.objects.len() as u64 * OBJECT));
        items.push(("textures", texture_bytes));
        if let Some(PhotonSettings { count, .. }) = plan.settings.effective().photons {
            let kept =
                (u64::from(count) * u64::from(plan.settings.render.samples)).saturating_mul(PHOTON / 4);
            items.push(("photons", u64::from(count) * PHOTON + kept.min(KEPT_MAPS)));
        }
        Self(items)
    }

    /// The same with the film of the scene's own image, which is kept while keys show something else.
    pub(super) fn with_own_film(mut self, bytes: u64) -> Self {
        self.0.push((OWN_FILM, bytes));
        self
    }

    /// Bytes of all parts.
    pub(super) fn bytes(&self) -> u64 {
        self.0.iter().fold(0, |sum: u64, (_, bytes)| sum.saturating_add(*bytes))
    }

    fn own_film(&self) -> u64 {
        self.0.iter().filter(|(name, _)| *name == OWN_FILM).map(|(_, bytes)| bytes).sum()
    }

    /// Refuses what takes more than the call, or else the system, allows. Returns the bytes that are left.
    ///
    /// # Errors
    /// The work would need more, with the numbers and a way out.
    pub(super) fn check(&self, plan: &Plan) -> Result<u64, Stop> {
        self.check_within(plan, limit)
    }

    /// [`Self::check`] where the system has this limit.
    fn check_within(&self, plan: &Plan, limit: impl FnOnce() -> Option<Limit>) -> Result<u64, Stop> {
        let all = self.bytes();
        let frames = self.0.iter().find(|(name, bytes)| *name == FRAMES && *bytes > MOST_FRAMES);
        if let (Some((_, bytes)), None) = (frames, plan.memory) {
            return Err(Stop::work(format!(
                "the frames of the moving picture would take {} of memory until it is written; render fewer or smaller \
                 frames, or a file each, as in a_####.png; --memory {} allows it",
                words(*bytes),
                allowance(all)
            )));
        }
        // A size that the call names counts in place of the system's: the estimate is on the safe side.
        let limit = plan.memory.map(|bytes| Limit { bytes, setting: "--memory".to_owned() }).or_else(limit);
        let Some(Limit { bytes: most, setting }) = limit else { return Ok(u64::MAX) };
        if all <= most {
            return Ok(most - all);
        }
        let mut largest = self.0.clone();
        largest.sort_by_key(|(_, bytes)| std::cmp::Reverse(*bytes));
        let items = largest.iter().filter(|(_, bytes)| *bytes * 100 > all);
        let items: Vec<String> = items.map(|(name, bytes)| format!("{name} {}", words(*bytes))).collect();
        let way_out = match largest.first() {
            _ if all - self.own_film() <= most => {
                "go back to the scene's own settings, or let its image be finished first"
            }
            Some(("the film" | "the picture", _)) => "render a smaller picture, or parts of it by --crop",
            Some(("the layers", _)) => "ask for fewer layers or a smaller picture",
            Some((FRAMES, _)) => "render fewer or smaller frames, or a file each, as in a_####.png",
            Some(("meshes" | "trees", _)) => "use --accel bvh or smaller meshes",
            Some(("textures", _)) => "use smaller textures",
            Some(("photons", _)) => "give [photons] a smaller `count`",
            Some(_) | None => "allow more",
        };
        let way_out = match most < 1 << 20 {
            true => "a size without a unit is in bytes: give one, as in 8GiB",
            false => way_out,
        };
        let try_anyway = format!(", raise the limit, or try anyway with --memory {}", allowance(all));
        Err(Stop::work(format!(
            "the render needs about {} of memory ({}), more than the {} of {setting}; {way_out}{}",
            words(all),
            items.join(", "),
            words(most),
            if plan.memory.is_some() { "" } else { &try_anyway }
        )))
    }
}

/// Order in which the samples of a plan are added up. Whether photons are emitted at all is known later.
fn blocks(plan: &Plan) -> SumOrder {
    let gathers = plan.settings.gathers();
    match plan.shard {
        Some(shard) => Share::new(shard, gathers, plan.settings.render.samples).sums(),
        None if gathers => SumOrder::Blocked,
        None => SumOrder::Sequential,
    }
}

/// A size for `--memory` that is enough for so many bytes.
fn allowance(bytes: u64) -> String {
    format!("{}GiB", bytes.div_ceil(1 << 30))
}

/// `1.25 GiB`, `300 MiB`; below that `12 KiB`, `1 byte`
fn words(bytes: u64) -> String {
    match bytes {
        1 => return "1 byte".to_owned(),
        0..1024 => return format!("{bytes} bytes"),
        1024..0x10_0000 => return format!("{} KiB", bytes / 1024),
        0x10_0000.. => {}
    }
    let mib = bytes as f64 / f64::from(1 << 20);
    if mib < 1024.0 { format!("{:.0} MiB", mib.ceil()) } else { format!("{:.2} GiB", mib / 1024.0) }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::plan::plan;
    use crate::protocol::Failure;
    use crate::settings::Overrides;
    use crate::tests::loaded_of;

    fn planned(overrides: &Overrides) -> Plan {
        let overrides = Overrides { threads: overrides.threads.or(Some(1)), ..overrides.clone() };
        plan(&loaded_of("").scene, Path::new("a.toml"), &overrides).expect("a plan")
    }

    #[test]
    fn every_thread_counts() {
        let bytes = |threads| {
            let overrides = Overrides { threads: Some(threads), ..Overrides::default() };
            Foretold::of_picture(&planned(&overrides)).bytes()
        };
        assert_eq!(bytes(65) - bytes(1), 64 * THREAD);
    }

    #[test]
    fn what_does_not_fit_is_refused_with_the_numbers() {
        let large = Overrides {
            width: Some(8000),
            height: Some(8000),
            memory: Some(1 << 30),
            ..Overrides::default()
        };
        let said = match Foretold::of_picture(&planned(&large)).check(&planned(&large)) {
            Err(Stop::Failed(Failure::Work(said))) => said,
            other => panic!("{other:?}"),
        };
        // 64 million pixels of 40 and 15 bytes.
        assert!(said.contains("needs about 3.30 GiB of memory (the film 2.38 GiB"), "{said}");
        assert!(said.contains("more than the 1.00 GiB of --memory; render a smaller picture"), "{said}");
        let said = |memory: u64| {
            let small = Overrides { memory: Some(memory), ..Overrides::default() };
            match Foretold::of_picture(&planned(&small)).check(&planned(&small)) {
                Err(Stop::Failed(Failure::Work(said))) => said,
                other => panic!("{other:?}"),
            }
        };
        assert!(said(1).contains("more than the 1 byte of --memory; a size without a unit is in bytes"));
        assert!(said(8 << 10).contains("more than the 8 KiB of --memory"));
        let said = said(8 << 20);
        assert!(said.contains("more than the 8 MiB of --memory; allow more"), "{said}");
        let crop = Some(Rect { x: 10, y: 10, width: 500, height: 500 });
        let part = Overrides { crop, memory: Some(1 << 30), ..large };
        assert!(Foretold::of_picture(&planned(&part)).check(&planned(&part)).is_ok());
    }

    #[test]
    fn a_limit_of_the_system_counts_unless_the_call_names_one() {
        let limit = || Some(Limit { bytes: 8 << 20, setting: "the control group (x)".to_owned() });
        let check = |overrides: &Overrides| {
            let plan = planned(overrides);
            Foretold::of_picture(&plan).check_within(&plan, limit)
        };
        let said = match check(&Overrides::default()) {
            Err(Stop::Failed(Failure::Work(said))) => said,
            other => panic!("{other:?}"),
        };
        assert!(said.contains("needs about 42 MiB of memory"), "{said}");
        assert!(said.contains("more than the 8 MiB of the control group (x); "), "{said}");
        assert!(said.ends_with("raise the limit, or try anyway with --memory 1GiB"), "{said}");
        assert!(check(&Overrides { memory: Some(1 << 30), ..Overrides::default() }).is_ok());
    }

    #[test]
    fn blocks_that_are_kept_apart_count() {
        let photons = Overrides { photons: Some(true), samples: Some(64), ..Overrides::default() };
        let film = |overrides: &Overrides| Foretold::of_picture(&planned(overrides)).0[1].1;
        let pixels = 640 * 480;
        let plain = film(&Overrides::default());
        assert_eq!(film(&photons) - plain, pixels * 24);
        let shard = Some((1, 2));
        let outputs = vec!["a.part".into()];
        assert_eq!(film(&Overrides { shard, outputs, ..photons }) - plain, 2 * pixels * 24);
    }
}
