//! Checkpoints of a render: when they are written, what they hold beside the film, and how a render goes on from one.

use std::cell::{Cell, OnceCell};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::film_state::{Before, FilmState};
use super::share::Share;
use crate::control::CancelToken;
use crate::film::Film;
use crate::integrators::RayCounters;
use crate::output::part::{
    self, Head, Kind, PartError, PartFile, PictureHead, ShareHead, Trait, differences,
};
use crate::output::write::{Durability, Guard};
use crate::output::{Finish, Losses, OutputError};
use crate::pipeline::inputs::Inputs;
use crate::pipeline::protocol::CheckpointNews;
use crate::pipeline::settings::{Checkpoints, Resume};
use crate::pipeline::sink::Sink;
use crate::pipeline::stages::Stop;

/// A checkpoint takes at most one part in so many of the time.
const TIME_SHARE: u32 = 100;

/// Ending of a checkpoint's name, behind that of the output.
const ENDING: &str = ".checkpoint";

/// State of a render beside its film.
#[derive(Debug, Serialize, Deserialize)]
struct State {
    /// Samples that the halves of each cell are to have, as far as that is decided.
    goals: Vec<[u32; 2]>,
    /// Samples at which each tile was judged last.
    judged: Vec<u32>,
    /// Brightness that noise is held against.
    brightness: Option<f64>,
    /// Rays of each cell.
    cell_rays: Vec<u64>,
    /// Camera, shadow, reflected, refracted, scattered rays; texture look-ups.
    rays: [u64; 6],
    /// Seconds of rendering.
    seconds: f64,
    /// Seconds of a processor.
    processor_seconds: f64,
}

impl State {
    fn of(state: &FilmState, rays: RayCounters, seconds: f64) -> Self {
        let RayCounters {
            camera_rays,
            shadow_rays,
            reflected_rays,
            refracted_rays,
            scattered_rays,
            texture_lookups,
        } = rays;
        Self {
            goals: state.goals.decided.clone(),
            judged: state.goals.judged.clone(),
            brightness: state.goals.brightness,
            cell_rays: state.rays.clone(),
            rays: [camera_rays, shadow_rays, reflected_rays, refracted_rays, scattered_rays, texture_lookups],
            seconds,
            processor_seconds: state.seconds,
        }
    }

    /// Puts it into a film's state. `None`, and nothing is changed, if it is of another film.
    fn put(self, state: &mut FilmState) -> Option<()> {
        let fits = self.goals.len() == state.done.len()
            && self.cell_rays.len() == state.done.len()
            && self.judged.len() == state.film.tile_count();
        if !fits {
            return None;
        }
        let [camera_rays, shadow_rays, reflected_rays, refracted_rays, scattered_rays, texture_lookups] =
            self.rays;
        let rays = RayCounters {
            camera_rays,
            shadow_rays,
            reflected_rays,
            refracted_rays,
            scattered_rays,
            texture_lookups,
        };
        state.goals.decided = self.goals;
        state.goals.judged = self.judged;
        state.goals.brightness = self.brightness;
        state.rays = self.cell_rays;
        state.before = Before { rays, seconds: self.seconds };
        state.render_seconds = self.seconds;
        state.seconds = self.processor_seconds;
        Some(())
    }
}

/// The head of a film's file.
pub(in crate::pipeline) fn head(
    kind: Kind,
    state: &FilmState,
    identity: Vec<Trait>,
    finish: &Finish,
) -> Head {
    let share = share_head(state.share.as_ref());
    Head { kind, identity, share, picture: PictureHead::new(&state.film, finish) }
}

fn share_head(share: Option<&Share>) -> ShareHead {
    match share {
        Some(share) => ShareHead {
            index: share.index,
            count: share.count,
            block_count: share.block_count(),
            blocks: share.blocks().to_vec(),
        },
        None => ShareHead { index: 1, count: 1, block_count: 0, blocks: Vec::new() },
    }
}

/// Ending of a checkpoint that made way for that of another render.
const ASIDE: &str = ".before";

/// The file of an output's checkpoint.
pub(in crate::pipeline) fn path_of(output: &Path) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(ENDING);
    name.into()
}

/// Checkpoints of one render.
pub(in crate::pipeline) struct Keeping<'a> {
    path: PathBuf,
    settings: Checkpoints,
    finish: &'a Finish,
    inputs: &'a Inputs,
    sink: &'a Sink,
    /// Names of all that the picture depends on; takes a while to find out.
    name: &'a dyn Fn() -> Vec<Trait>,
    /// Whether a cancelled render is to be gone on with later.
    is_suspended: &'a dyn Fn() -> bool,
    identity: OnceCell<Vec<Trait>>,
    due: Cell<Instant>,
    /// Whether glimt has reported a failure: each further one has the same cause.
    is_failure_told: Cell<bool>,
    /// Whether the checkpoint that is there is of this render.
    is_own: Cell<bool>,
}

impl<'a> Keeping<'a> {
    /// Checkpoints beside an output.
    pub(in crate::pipeline) fn new(
        output: &Path,
        settings: Checkpoints,
        finish: &'a Finish,
        (inputs, sink): (&'a Inputs, &'a Sink),
        name: &'a dyn Fn() -> Vec<Trait>,
        is_suspended: &'a dyn Fn() -> bool,
    ) -> Self {
        Self {
            path: path_of(output),
            settings,
            finish,
            inputs,
            sink,
            name,
            is_suspended,
            identity: OnceCell::new(),
            due: Cell::new(Instant::now() + Duration::from_secs_f64(settings.seconds.min(1e9))),
            is_failure_told: Cell::new(false),
            is_own: Cell::new(false),
        }
    }

    fn identity(&self) -> &[Trait] {
        self.identity.get_or_init(self.name)
    }

    /// Brings an empty film to where the checkpoint was, if the call asks for that.
    ///
    /// # Errors
    /// The checkpoint is of another picture, damaged, or has more samples than asked for.
    pub(in crate::pipeline) fn resume(&self, state: &mut FilmState, samples: u32) -> Result<(), Stop> {
        let resume = self.settings.resume;
        let is_there = self.path.symlink_metadata().is_ok();
        match resume {
            Resume::No | Resume::IfSame if !is_there => return Ok(()),
            Resume::Asked if !is_there => {
                self.tell(CheckpointNews::Absent { path: self.path.clone() });
                return Ok(());
            }
            Resume::No | Resume::Asked | Resume::IfSame => {}
        }
        if resume != Resume::Asked && !part::is_part(&self.path) {
            self.tell_failure(&format!("{}: the file of this name is no checkpoint", self.path.display()));
        }
        let unlike = PartFile::head(&self.path).map(|head| self.unlike(&head, state));
        match (resume, &unlike) {
            (Resume::No, Ok(unlike)) if unlike.is_empty() => {
                self.tell(CheckpointNews::Ignored { path: self.path.clone() });
                return Ok(());
            }
            (Resume::No, _) => return Ok(()),
            (Resume::IfSame, Ok(unlike)) if !unlike.is_empty() => return Ok(()),
            (Resume::IfSame, Err(_)) => return Ok(()),
            (Resume::Asked | Resume::IfSame, _) => {}
        }
        match self.restore(unlike, state, samples) {
            Ok(()) => {
                self.is_own.set(true);
                let (path, samples) = (self.path.clone(), state.samples(samples));
                self.tell(CheckpointNews::Resumed { path, samples });
                Ok(())
            }
            Err(error) => Err(Stop::wrong_call(
                format!("--resume: {error}"),
                "leave --resume out to start from the beginning, or name another file with -o",
            )),
        }
    }

    /// Moves the checkpoint of another render out of the way, unless this one has all that it has. Of several, the one that took
    /// longest stays aside.
    ///
    /// # Errors
    /// It cannot be moved: the reason.
    fn set_aside(&self, state: &FilmState, rays: RayCounters) -> Result<(), String> {
        let Some((head, there)) = kept_in(&self.path) else { return Ok(()) };
        if self.has_all_of(&head, &there, state, rays) {
            return Ok(());
        }
        let mut aside = self.path.as_os_str().to_owned();
        aside.push(ASIDE);
        let aside = PathBuf::from(aside);
        if kept_in(&aside).is_some_and(|(_, before)| before.seconds >= there.seconds) {
            return Ok(());
        }
        if aside.symlink_metadata().is_ok() && !part::is_part(&aside) {
            return Err(format!("{} is in the way of the one that was there", aside.display()));
        }
        std::fs::rename(&self.path, &aside).map_err(|error| format!("{}: {error}", self.path.display()))?;
        self.tell(CheckpointNews::SetAside { path: aside });
        Ok(())
    }

    /// Whether a checkpoint is of this picture, and this render has traced as much as it has.
    fn has_all_of(&self, head: &Head, there: &State, state: &FilmState, rays: RayCounters) -> bool {
        let [camera_rays, ..] = there.rays;
        self.unlike(head, state).is_empty() && camera_rays <= rays.camera_rays
    }

    fn restore(
        &self,
        unlike: Result<Vec<String>, PartError>,
        state: &mut FilmState,
        samples: u32,
    ) -> Result<(), PartError> {
        let unlike = unlike?;
        let path = self.path.clone();
        if !unlike.is_empty() {
            return Err(PartError::Other { path, other: "this call".to_owned(), differences: unlike });
        }
        let file = PartFile::open(&self.path, &CancelToken::new())?;
        file.check_kind(Kind::Checkpoint)?;
        let damaged = |why: &str| PartError::Damaged { path: path.clone(), why: why.to_owned() };
        let read: State =
            serde_json::from_value(file.state.clone()).map_err(|_| damaged("its state makes no sense"))?;
        file.restore(&state.film)?;
        read.put(state).ok_or_else(|| damaged("its state is that of another film"))?;
        state.count_again();
        if !state.has_at_most(samples) {
            let differences = vec![format!("it has more samples than the {samples} that are asked for")];
            return Err(PartError::Other { path, other: "this call".to_owned(), differences });
        }
        Ok(())
    }

    /// Differences between a head and this render.
    fn unlike(&self, head: &Head, state: &FilmState) -> Vec<String> {
        let mut unlike = differences(&head.identity, self.identity(), ("there", "here"));
        let share = share_head(state.share.as_ref());
        let name = |share: &ShareHead| match share.count {
            1 => "the whole picture".to_owned(),
            count => format!("part {}/{count}", share.index),
        };
        if unlike.is_empty() && head.share != share {
            unlike.push(format!("it is of {} and this call of {}", name(&head.share), name(&share)));
        }
        unlike
    }

    /// Writes a checkpoint if it is time for one.
    pub(in crate::pipeline) fn tick(&self, state: &FilmState, rays: RayCounters, seconds: f64) {
        if Instant::now() < self.due.get() {
            return;
        }
        let begin = Instant::now();
        self.write(state, rays, seconds, Durability::Power);
        let pause = Duration::from_secs_f64(self.settings.seconds.min(1e9)).max(begin.elapsed() * TIME_SHARE);
        self.due.set(Instant::now() + pause);
    }

    /// Writes the checkpoint of a render that is cancelled, if it is to be gone on with.
    pub(in crate::pipeline) fn at_the_end(&self, state: &FilmState, rays: RayCounters, seconds: f64) {
        if (self.is_suspended)() && state.is_begun() {
            // Whoever sent the signal waits: the disk may take longer than that.
            self.write(state, rays, seconds, Durability::Process);
        }
    }

    /// Removes the checkpoint of a picture that is written, or writes a last one if checkpoints are kept. If a long render's picture
    /// could not be written, its samples are kept all the same.
    pub(in crate::pipeline) fn finish(&self, state: &FilmState, rays: RayCounters, is_written: bool) {
        let was_long = state.render_seconds >= self.settings.seconds;
        match (is_written, self.settings.are_kept) {
            (false, false) if !was_long => return,
            (false, _) | (true, true) => {
                return self.write(state, rays, state.render_seconds, Durability::Power);
            }
            (true, false) => {}
        }
        // One of another picture, or of more samples, is somebody else's.
        let is_done = |(head, there)| self.has_all_of(&head, &there, state, rays);
        if self.is_own.get() || kept_in(&self.path).is_some_and(is_done) {
            // What cannot be removed is in nobody's way.
            let _ = std::fs::remove_file(&self.path);
        }
    }

    fn write(&self, state: &FilmState, rays: RayCounters, seconds: f64, durability: Durability) {
        if !self.is_own.get()
            && let Err(why) = self.set_aside(state, rays)
        {
            return self.tell_failure(&why);
        }
        let head = head(Kind::Checkpoint, state, self.identity().to_vec(), self.finish);
        let written = serde_json::to_value(State::of(state, rays, seconds))
            .map_err(|error| OutputError::File { path: self.path.clone(), source: error.into() })
            .and_then(|value| save(&self.path, &head, &state.film, &value, (self.inputs, durability)));
        match written {
            Ok(()) => {
                self.is_own.set(true);
                self.tell(CheckpointNews::Written { path: self.path.clone() });
            }
            Err(error) => self.tell_failure(&error.to_string()),
        }
    }

    fn tell_failure(&self, why: &str) {
        if !self.is_failure_told.replace(true) {
            self.tell(CheckpointNews::Failed { message: format!("no checkpoint: {why}") });
        }
    }

    fn tell(&self, news: CheckpointNews) {
        self.sink.checkpoint(news);
    }
}

/// The head and the state of a whole checkpoint.
fn kept_in(path: &Path) -> Option<(Head, State)> {
    let file = PartFile::open(path, &CancelToken::new()).ok()?;
    file.check_kind(Kind::Checkpoint).ok()?;
    Some((file.head, serde_json::from_value(file.state).ok()?))
}

/// Writes a checkpoint; never over something else.
fn save(
    path: &Path,
    head: &Head,
    film: &Film,
    state: &serde_json::Value,
    (inputs, durability): (&Inputs, Durability),
) -> Result<(), OutputError> {
    let may_replace = |at: &Path| match at.symlink_metadata() {
        Ok(_) if !part::is_part(at) || inputs.contain(at) => {
            let reason = format!("cannot write {}: the file of this name is no checkpoint", path.display());
            Err(OutputError::Refused { reason })
        }
        Ok(_) | Err(_) => Ok(()),
    };
    let guard = Guard {
        is_kept: &|path| inputs.contain(path),
        may_replace: &may_replace,
        losses: Losses::Told(&|_| ()),
    };
    // Nobody cancels this: it is short, and a signal may be its reason.
    part::save(path, head, film, state, &guard, (&CancelToken::new(), durability))
}
