//! `glimt bench`: error against time, as a table, as CSV, as JSON, as a plot.

mod chart;
mod outputs;
mod progress;

use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::Duration;

use self::outputs::Outputs;
use self::progress::Said;
use crate::args::BenchArgs;
use crate::bench::baseline::{changes, lines};
use crate::bench::table::table;
use crate::bench::{self, News, Order, ReferenceOrder, Results, Steps, Toggles, Trouble, Unfinished, cache};
use crate::console::Console;
use crate::control::CancelToken;
use crate::exit::Exit;
use crate::pipeline::protocol::Failure;
use crate::pipeline::settings::Overrides;
use crate::scene::diagnostic::Diagnostic;
use crate::signals::{self, Ended};
use crate::system::priority;
use crate::system::threads::start_failure;

/// Between two looks for a signal.
const TICK: Duration = Duration::from_millis(50);

pub(crate) fn run(args: &BenchArgs, console: &Console) -> Exit {
    measured(args, console).unwrap_or_else(|exit| exit)
}

/// Reports errors; `Err` has their exit code.
fn measured(args: &BenchArgs, console: &Console) -> Result<Exit, Exit> {
    priority::lower_priority(args.nice);
    let order = order(args, console)?;
    let scenes = order.scenes.len();
    let outputs = Outputs::of(args, &order.scenes, console)?;
    let baseline = outputs.baseline(console)?;
    // The first signal ends the work under way, another one the writing of the results so far.
    let (token, writing) = (CancelToken::new(), CancelToken::new());
    let stop = [token.clone(), writing.clone()];
    let ended = signals::catch(move || stop[usize::from(stop[0].is_cancelled())].cancel())
        .map_err(|error| console.fail(Exit::FAILED, &format!("cannot listen to signals: {error}")))?;
    let mut said = Said::new(args.progress, console);
    let (news, work) = begin(order, token.clone())
        .map_err(|error| console.fail(Exit::FAILED, &start_failure("a thread", false, &error)))?;
    follow(&news, &mut said);
    let results = work.join().unwrap_or_else(|_| Err(Box::new(broken())));
    said.end();
    match results {
        Ok(results) => {
            say(&results, baseline.as_ref(), console);
            outputs.write(&results, &said, console, if token.is_cancelled() { &writing } else { &token })?;
            said.done(&results);
            Ok(ended.by().map_or(Exit::DONE, Exit::signal))
        }
        Err(unfinished) => {
            let Unfinished { trouble, done } = *unfinished;
            // Nothing is measured where the call is wrong.
            if !done.scenes.is_empty() {
                say(&done, baseline.as_ref(), console);
                // Files that cannot be written are reported; the exit code is that of the first trouble.
                let _ = outputs.write(&done, &said, console, &writing);
            }
            Err(troubled(&trouble, &ended, (done.scenes.len(), scenes), &said, console))
        }
    }
}

/// The tables, the plots, and what changed since an older run.
fn say(results: &Results, baseline: Option<&(String, Results)>, console: &Console) {
    table(results).iter().for_each(|line| console.answer(line));
    chart::show(results, console);
    if let Some((name, then)) = baseline {
        lines(&changes(then, results), name).iter().for_each(|line| console.answer(line));
    }
}

/// The thread that measures.
type Work = JoinHandle<Result<Results, Box<Unfinished>>>;

/// The work on a thread of its own, and what it says.
fn begin(order: Order, token: CancelToken) -> std::io::Result<(Receiver<News>, Work)> {
    let (sender, news) = mpsc::channel();
    let tell = move |one: News| {
        // A front end that is gone needs no news.
        let _ = sender.send(one);
    };
    let work = move || bench::run(&order, &token, &tell);
    let thread = std::thread::Builder::new().name("glimt-bench".to_owned()).spawn(work)?;
    Ok((news, thread))
}

/// Reports news until the work is over.
fn follow(news: &Receiver<News>, said: &mut Said) {
    loop {
        match news.recv_timeout(TICK) {
            Ok(one) => said.hear(one),
            Err(RecvTimeoutError::Timeout) => said.tick(),
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// A panic has said what it was.
fn broken() -> Unfinished {
    let what = "internal error: a part of the renderer gave up".to_owned();
    Unfinished { trouble: Trouble::Failed(Failure::Work(what)), done: Results::default() }
}

/// `scenes` are how many were measured, and of how many.
fn troubled(
    trouble: &Trouble,
    ended: &Ended,
    scenes: (usize, usize),
    said: &Said,
    console: &Console,
) -> Exit {
    if let Some(number) = ended.by() {
        if let Some(signal) = signals::name(number) {
            let (done, all) = scenes;
            said.cancelled(&format!(
                "ended by {signal} after {done} of {all} scenes; finished references are kept"
            ));
        }
        return Exit::signal(number);
    }
    match trouble {
        Trouble::Failed(Failure::Scene(diagnostics)) => {
            if said.is_for_people() {
                console.diagnostics(diagnostics);
            } else {
                let messages: Vec<_> = diagnostics.iter().map(in_a_line).collect();
                said.failed("scene", &messages.join("; "));
            }
            Exit::WRONG
        }
        Trouble::Failed(Failure::Work(message)) => {
            said.failed("work", &format!("error: {message}"));
            Exit::FAILED
        }
        Trouble::Call(message) => {
            said.failed("call", &format!("error: {message}"));
            Exit::WRONG
        }
        Trouble::Cancelled => Exit::FAILED,
    }
}

fn in_a_line(diagnostic: &Diagnostic) -> String {
    format!("{}: {}", diagnostic.path.display(), diagnostic.message)
}

/// The order that the arguments mean.
fn order(args: &BenchArgs, console: &Console) -> Result<Order, Exit> {
    let folder = if args.no_cache { None } else { args.cache.clone().or_else(cache::folder) };
    let scenes = if args.scenes.is_empty() {
        vec![own_scene(folder.as_deref(), console)?]
    } else {
        args.scenes.clone()
    };
    if let Some((_, twice)) = (0..).zip(&scenes).find(|(index, scene)| scenes[..*index].contains(scene)) {
        return Err(console.fail(Exit::WRONG, &format!("{} is given twice", twice.display())));
    }
    let outputs = [&args.csv, &args.json, &args.plot];
    Ok(Order {
        reference: reference(args, scenes.len(), console)?,
        scenes,
        common: Overrides {
            sets: args.sets.clone(),
            max_depth: args.max_depth,
            dof: args.dof.map(bool::from),
            threads: args.threads,
            ..Overrides::default()
        },
        width: args.width,
        height: args.height,
        toggles: Toggles {
            integrators: args.integrator.clone(),
            photons: args.photons.iter().copied().map(bool::from).collect(),
            shadows: args.shadows.clone(),
            clamps: args.clamp.clone(),
            accels: args.accel.clone(),
        },
        steps: steps(args),
        seeds: args.seeds,
        seed: args.seed,
        within: args.within,
        cache: folder,
        targets: outputs.into_iter().flatten().cloned().collect(),
    })
}

/// In rising order, each once.
fn steps(args: &BenchArgs) -> Steps {
    let (mut samples, mut seconds) = (args.samples.clone(), args.time.clone());
    samples.sort_unstable();
    samples.dedup();
    seconds.sort_by(f64::total_cmp);
    seconds.dedup();
    match (samples.is_empty(), seconds.is_empty()) {
        (false, _) => Steps::Samples(samples),
        (true, false) => Steps::Seconds(seconds),
        (true, true) => Steps::Climb,
    }
}

fn reference(args: &BenchArgs, scenes: usize, console: &Console) -> Result<ReferenceOrder, Exit> {
    match (args.reference.as_slice(), args.reference_samples) {
        ([], Some(samples)) => Ok(ReferenceOrder::Samples(samples)),
        ([], None) => Ok(ReferenceOrder::InTime),
        (_, _) if scenes != 1 => {
            Err(console.fail(Exit::WRONG, "--reference belongs to one scene: measure one at a time"))
        }
        ([one], _) => Ok(ReferenceOrder::Files([one.clone(), one.clone()])),
        ([one, two], _) => Ok(ReferenceOrder::Files([one.clone(), two.clone()])),
        (_, _) => Err(console.fail(Exit::WRONG, "--reference is given more than twice")),
    }
}

/// The scene that `glimt new` writes, beside the references.
fn own_scene(folder: Option<&Path>, console: &Console) -> Result<PathBuf, Exit> {
    match folder.map(cache::starter) {
        Some(made) => made.map_err(|error| console.fail(Exit::FAILED, &error.to_string())),
        None => Err(console.fail(Exit::WRONG, "no scene is given; see glimt bench --help")),
    }
}
