//! Estimates a render's memory use in advance. A render that would not fit in memory is rejected with a
//! breakdown.
//!
//! Film and image sizes are exact, and mesh and texture sizes are known once they are loaded. Tree and photon
//! sizes are conservative estimates based on measured peak memory per triangle and per emitted photon.

use super::plan::RenderPlan;
use super::prepare::SceneAssets;
use super::render::share::Shard;
use super::stages::AbortReason;
use super::words::format_bytes;
use crate::film::{Film, Rect, SumOrder};
use crate::integrators::PhotonSettings;
use crate::scene::description::Accel;
use crate::system::memory::{MemoryLimit, ulimit_or_cgroup_limit};

/// Bytes used by the program itself.
const PROGRAM_BYTES: u64 = 24 << 20;
/// Stack and buffer size per render thread, in bytes. Rough glass needs the most.
const THREAD_BYTES: u64 = 640 << 10;
/// Bytes per object in the acceleration structures.
const OBJECT_BYTES: u64 = 250;
/// Bytes per emitted photon while the maps for a pass are being built.
const PHOTON_BYTES: u64 = 220;
/// Maximum size of the cached photon maps in bytes.
const KEPT_MAPS: u64 = 128 << 20;

/// Maximum total size of an animation's frames in bytes, unless `--memory` is set.
const MAX_FRAMES: u64 = 4 << 30;
/// Name of the memory item for animation frames.
const FRAMES: &str = "the frames";
/// Name of the memory item for the film of the scene's own image.
const OWN_FILM: &str = "the unfinished film of the scene's own image";

/// Suggested fix if the film or the image needs the most memory.
const SMALLER_IMAGE: &str = "render a smaller image, or parts of it with --crop";
/// Suggested fix if the limit is below 1 MiB.
const MISSING_UNIT: &str = "sizes without a unit are in bytes; add a unit, for example 8GiB";
/// Suggested fix if nothing can be reduced.
const ALLOW_MORE: &str = "allow more";

/// Name of a memory item and its size in bytes.
type MemoryItem = (&'static str, u64);

/// Estimated memory use of a render.
#[derive(Clone)]
pub(super) struct MemoryEstimate(Vec<MemoryItem>);

impl MemoryEstimate {
    /// Estimates the memory for the image before any files are read.
    pub(super) fn for_image(plan: &RenderPlan) -> Self {
        let render = &plan.settings.render;
        let whole = Rect { x: 0, y: 0, width: render.width, height: render.height };
        let (film, picture) = Film::crop_sum_and_image_bytes(
            (render.width, render.height),
            plan.crop.unwrap_or(whole),
            sample_summation_order(plan),
        );
        let threads = plan.limits.threads as u64 * THREAD_BYTES;
        let mut items = vec![
            ("the program", PROGRAM_BYTES),
            ("the film", film),
            ("the image", picture),
            ("the threads", threads),
        ];
        if !plan.layers.is_empty() {
            let recorded = plan.settings.layers.len();
            let sums = Film::layer_bytes_for_crop(plan.crop.unwrap_or(whole), recorded);
            items.push(("the layers", sums + picture * plan.layers.len() as u64));
        }
        if let Some(turn) = plan.turn.filter(|_| !plan.outputs.animations.is_empty()) {
            let frame = u64::from(render.width) * u64::from(render.height) * 3;
            items.push((FRAMES, frame * u64::from(turn.of)));
        }
        Self(items)
    }

    /// Estimates the memory for the image and everything the scene references.
    pub(super) fn for_image_and_scene(plan: &RenderPlan, assets: &SceneAssets) -> Self {
        let Self(mut items) = Self::for_image(plan);
        let (scene, meshes) = (&plan.scene, &assets.meshes);
        let triangle = match scene.render.accel {
            Accel::Bvh => 110,
            Accel::BvhHigh => 170,
            Accel::KdTree => 190,
        };
        let of_meshes: u64 = meshes.iter().map(|kept| kept.mesh.mesh.memory_bytes() as u64).sum();
        let triangles: u64 = meshes.iter().map(|kept| kept.mesh.mesh.triangles.len() as u64).sum();
        items.push(("meshes", of_meshes));
        items.push(("trees", triangles * triangle + scene.objects.len() as u64 * OBJECT_BYTES));
        items.push(("textures", assets.textures.memory_bytes));
        if let Some(PhotonSettings { count, .. }) = plan.settings.without_ineffective_settings().photons {
            let kept =
                (u64::from(count) * u64::from(plan.settings.render.samples)).saturating_mul(PHOTON_BYTES / 4);
            items.push(("photons", u64::from(count) * PHOTON_BYTES + kept.min(KEPT_MAPS)));
        }
        Self(items)
    }

    /// Adds the film for the scene's own image, which is kept while another image is shown.
    pub(super) fn with_saved_scene_film(mut self, bytes: u64) -> Self {
        self.0.push((OWN_FILM, bytes));
        self
    }

    /// Total in bytes.
    pub(super) fn bytes(&self) -> u64 {
        self.0.iter().fold(0, |sum: u64, (_, bytes)| sum.saturating_add(*bytes))
    }

    fn saved_scene_film_bytes(&self) -> u64 {
        self.0.iter().filter(|(name, _)| *name == OWN_FILM).map(|(_, bytes)| bytes).sum()
    }

    /// Rejects a render that would exceed the memory limit set on the command line or by the system. Returns
    /// the number of bytes left.
    ///
    /// # Errors
    /// Returns a breakdown and a suggested fix if the render needs more memory than the limit.
    pub(super) fn check(&self, plan: &RenderPlan) -> Result<u64, AbortReason> {
        self.check_with_limit_provider(plan, ulimit_or_cgroup_limit)
    }

    /// Like [`Self::check`], but takes the system's limit as a parameter.
    fn check_with_limit_provider(
        &self,
        plan: &RenderPlan,
        limit: impl FnOnce() -> Option<MemoryLimit>,
    ) -> Result<u64, AbortReason> {
        let all = self.bytes();
        let frames = self.0.iter().find(|(name, bytes)| *name == FRAMES && *bytes > MAX_FRAMES);
        if let (Some((_, bytes)), None) = (frames, plan.limits.memory) {
            return Err(AbortReason::from_work_error(format!(
                "the frames need {} of memory until the animation is written; render fewer or smaller frames, or \
                 numbered files such as a_####.png; --memory {} allows it",
                format_bytes(*bytes),
                format_memory_arg(all)
            )));
        }
        // A command-line limit replaces the system limit, because the estimate is conservative.
        let limit = plan
            .limits
            .memory
            .map(|bytes| MemoryLimit { bytes, setting: "--memory".to_owned() })
            .or_else(limit);
        let Some(MemoryLimit { bytes: most, setting }) = limit else { return Ok(u64::MAX) };
        if all <= most {
            return Ok(most - all);
        }
        let mut largest = self.0.clone();
        largest.sort_by_key(|(_, bytes)| std::cmp::Reverse(*bytes));
        let items = largest.iter().filter(|(_, bytes)| *bytes * 100 > all);
        let items: Vec<String> =
            items.map(|(name, bytes)| format!("{name} {}", format_bytes(*bytes))).collect();
        let remedy = match largest.first() {
            _ if all - self.saved_scene_film_bytes() <= most => {
                "return to the scene's own settings, or let its image finish first"
            }
            Some(("the film" | "the image", _)) => SMALLER_IMAGE,
            Some(("the layers", _)) => "request fewer layers or a smaller image",
            Some((FRAMES, _)) => "render fewer or smaller frames, or numbered files such as a_####.png",
            Some(("meshes" | "trees", _)) => match plan.scene.render.accel {
                Accel::Bvh => "use smaller meshes or a lower `subdivide`",
                Accel::BvhHigh | Accel::KdTree => "use --accel bvh, smaller meshes or a lower `subdivide`",
            },
            Some(("textures", _)) => "use smaller textures",
            Some(("photons", _)) => "reduce `count` in [photons]",
            Some(_) | None => ALLOW_MORE,
        };
        let remedy = match most < 1 << 20 {
            true => MISSING_UNIT,
            false => remedy,
        };
        let try_anyway = format!(", raise the limit, or try anyway with --memory {}", format_memory_arg(all));
        Err(AbortReason::from_work_error(format!(
            "the render needs about {} of memory ({}), more than the {} allowed by {setting}; {remedy}{}",
            format_bytes(all),
            items.join(", "),
            format_bytes(most),
            if plan.limits.memory.is_some() { "" } else { &try_anyway }
        )))
    }
}

/// Returns the order in which samples are summed. If photons are enabled, assumes that photons are emitted,
/// because it is not known yet whether they are.
fn sample_summation_order(plan: &RenderPlan) -> SumOrder {
    let gathers = plan.settings.gathers_photons();
    match plan.shard {
        Some((index, count)) => {
            Shard::new(index, count, gathers, plan.settings.render.samples).summation_order()
        }
        None if gathers => SumOrder::Blocked,
        None => SumOrder::Sequential,
    }
}

/// Formats a byte count as a `--memory` value, rounded up.
fn format_memory_arg(bytes: u64) -> String {
    format!("{}GiB", bytes.div_ceil(1 << 30))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::plan::resolve_plan;
    use crate::protocol::Failure;
    use crate::settings::Overrides;
    use crate::tests::loaded_of;

    fn planned(overrides: &Overrides) -> RenderPlan {
        let overrides = Overrides { threads: overrides.threads.or(Some(1)), ..overrides.clone() };
        resolve_plan(&loaded_of("").scene, Path::new("a.toml"), &overrides).expect("a plan")
    }

    #[test]
    fn each_thread_adds_its_memory() {
        let bytes = |threads| {
            let overrides = Overrides { threads: Some(threads), ..Overrides::default() };
            MemoryEstimate::for_image(&planned(&overrides)).bytes()
        };
        assert_eq!(bytes(65) - bytes(1), 64 * THREAD_BYTES);
    }

    #[test]
    fn oversized_render_is_rejected_with_breakdown() {
        let large = Overrides {
            width: Some(8000),
            height: Some(8000),
            memory: Some(1 << 30),
            ..Overrides::default()
        };
        let said = match MemoryEstimate::for_image(&planned(&large)).check(&planned(&large)) {
            Err(AbortReason::Failed(Failure::Work(said))) => said,
            other => panic!("{other:?}"),
        };
        // 64 million pixels at 40 bytes (film) and 15 bytes (image).
        for fact in [" 3.30 GiB ", " 2.38 GiB", " 1.00 GiB allowed by --memory", SMALLER_IMAGE] {
            assert!(said.contains(fact), "{fact}: {said}");
        }
        let said = |memory: u64| {
            let small = Overrides { memory: Some(memory), ..Overrides::default() };
            match MemoryEstimate::for_image(&planned(&small)).check(&planned(&small)) {
                Err(AbortReason::Failed(Failure::Work(said))) => said,
                other => panic!("{other:?}"),
            }
        };
        assert!(said(1).contains(" 1 byte ") && said(1).contains(MISSING_UNIT));
        assert!(said(8 << 10).contains(" 8 KiB "));
        let said = said(8 << 20);
        assert!(said.contains(" 8 MiB ") && said.contains(ALLOW_MORE), "{said}");
        let crop = Some(Rect { x: 10, y: 10, width: 500, height: 500 });
        let part = Overrides { crop, memory: Some(1 << 30), ..large };
        assert!(MemoryEstimate::for_image(&planned(&part)).check(&planned(&part)).is_ok());
    }

    #[test]
    fn system_limit_applies_without_memory_option() {
        let limit = || Some(MemoryLimit { bytes: 8 << 20, setting: "the control group (x)".to_owned() });
        let check = |overrides: &Overrides| {
            let plan = planned(overrides);
            MemoryEstimate::for_image(&plan).check_with_limit_provider(&plan, limit)
        };
        let said = match check(&Overrides::default()) {
            Err(AbortReason::Failed(Failure::Work(said))) => said,
            other => panic!("{other:?}"),
        };
        for fact in [" 41 MiB ", " 8 MiB allowed by the control group (x); ", "--memory 1GiB"] {
            assert!(said.contains(fact), "{fact}: {said}");
        }
        assert!(check(&Overrides { memory: Some(1 << 30), ..Overrides::default() }).is_ok());
    }

    #[test]
    fn film_estimate_includes_block_sums() {
        let photons = Overrides { photons: Some(true), samples: Some(64), ..Overrides::default() };
        let film = |overrides: &Overrides| MemoryEstimate::for_image(&planned(overrides)).0[1].1;
        let pixels = 640 * 480;
        let plain = film(&Overrides::default());
        assert_eq!(film(&photons) - plain, pixels * 24);
        let shard = Some((1, 2));
        let outputs = vec!["a.part".into()];
        assert_eq!(film(&Overrides { shard, outputs, ..photons }) - plain, 2 * pixels * 24);
    }
}
