//! `glimt bench`: measures error over time. Writes a table, CSV, JSON and a plot.

mod chart;
mod outputs;
mod progress;

use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::Duration;

use self::outputs::BenchOutputs;
use self::progress::BenchProgress;
use crate::args::BenchArgs;
use crate::bench::baseline::{compare_runs, format_changes};
use crate::bench::table::format_results;
use crate::bench::{
    self, BenchError, BenchEvent, BenchRequest, PartialResultsError, ReferenceSource, Results, StepSchedule,
    SweptSettingValues, cache,
};
use crate::console::Console;
use crate::control::CancelToken;
use crate::exit::Exit;
use crate::pipeline::protocol::Failure;
use crate::pipeline::settings::Overrides;
use crate::scene::diagnostic::Diagnostic;
use crate::signals::{self, ReceivedSignal};
use crate::system::priority;
use crate::system::threads::{describe_thread_start_failure, spawn};

/// Interval for checking signals.
const TICK: Duration = Duration::from_millis(50);

pub(crate) fn run(args: &BenchArgs, console: &Console) -> Exit {
    run_and_print_errors(args, console).unwrap_or_else(|exit| exit)
}

/// Runs the benchmark and reports errors. `Err` contains the exit code.
fn run_and_print_errors(args: &BenchArgs, console: &Console) -> Result<Exit, Exit> {
    priority::lower_priority_including_spawned_threads(args.nice);
    let request = bench_request(args, console)?;
    let scenes = request.scenes.len();
    let outputs = BenchOutputs::try_from_args(args, &request.scenes, console)?;
    let baseline = outputs.read_baseline(console)?;
    // The first signal stops measuring. The second stops writing results.
    let (token, writing) = (CancelToken::new(), CancelToken::new());
    let stop = [token.clone(), writing.clone()];
    let ended = signals::install_signal_handlers(move || stop[usize::from(stop[0].is_canceled())].cancel())
        .map_err(|message| console.print_error(Exit::FAILED, &message))?;
    let mut progress = BenchProgress::new(args.progress, console);
    let (news, work) = spawn_benchmark(request, token.clone()).map_err(|error| {
        console.print_error(Exit::FAILED, &describe_thread_start_failure(1, false, &error))
    })?;
    report_events(&news, &mut progress);
    let results = work.join().unwrap_or_else(|_| Err(Box::new(unfinished_after_panic())));
    progress.clear();
    match results {
        Ok(results) => {
            print_results(&results, baseline.as_ref(), console);
            outputs.write_all(
                &results,
                &progress,
                console,
                if token.is_canceled() { &writing } else { &token },
            )?;
            progress.report_done(&results);
            Ok(ended.signal_number().map_or(Exit::DONE, Exit::from_signal))
        }
        Err(unfinished) => {
            let PartialResultsError { error, done } = *unfinished;
            // Nothing was measured if the arguments are invalid.
            if !done.scenes.is_empty() {
                print_results(&done, baseline.as_ref(), console);
                // Report files that cannot be written, but keep the exit code of the first error.
                let _ = outputs.write_all(&done, &progress, console, &writing);
            }
            Err(report_early_end(&error, &ended, (done.scenes.len(), scenes), &progress, console))
        }
    }
}

/// Prints the tables, the plots and the comparison with the baseline.
fn print_results(results: &Results, baseline: Option<&(String, Results)>, console: &Console) {
    format_results(results).iter().for_each(|line| console.print_line(line));
    chart::print_charts(results, console);
    if let Some((name, then)) = baseline {
        format_changes(&compare_runs(then, results), name).iter().for_each(|line| console.print_line(line));
    }
}

/// The measurement thread.
type BenchThread = JoinHandle<Result<Results, Box<PartialResultsError>>>;

/// Starts the benchmark on a thread. Returns the thread and a receiver for its events.
fn spawn_benchmark(
    request: BenchRequest,
    token: CancelToken,
) -> std::io::Result<(Receiver<BenchEvent>, BenchThread)> {
    let (sender, news) = mpsc::channel();
    let emit = move |one: BenchEvent| {
        // Ignore a front end that has exited.
        let _ = sender.send(one);
    };
    let work = move || bench::run(&request, &token, &emit);
    Ok((news, spawn("glimt-bench", work)?))
}

/// Reports events until the thread ends.
fn report_events(news: &Receiver<BenchEvent>, progress: &mut BenchProgress) {
    loop {
        match news.recv_timeout(TICK) {
            Ok(one) => progress.handle_event(one),
            Err(RecvTimeoutError::Timeout) => progress.tick(),
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// Returns the result for a benchmark that panicked. The panic handler has already printed a message.
fn unfinished_after_panic() -> PartialResultsError {
    let what = "internal error: the renderer panicked".to_owned();
    PartialResultsError { error: BenchError::Failed(Failure::Work(what)), done: Results::default() }
}

/// Reports why the benchmark did not finish. `scenes` contains the number of measured scenes and the total
/// number of scenes.
fn report_early_end(
    error: &BenchError,
    ended: &ReceivedSignal,
    scenes: (usize, usize),
    progress: &BenchProgress,
    console: &Console,
) -> Exit {
    if let Some(number) = ended.signal_number() {
        if let Some(signal) = signals::signal_name(number) {
            let (done, all) = scenes;
            progress.report_canceled(&format!(
                "terminated by {signal} after {done} of {all} scenes; finished references are cached"
            ));
        }
        return Exit::from_signal(number);
    }
    match error {
        BenchError::Failed(Failure::Scene(diagnostics)) => {
            if progress.is_text() {
                console.print_diagnostics(diagnostics);
            } else {
                let message = |one: &Diagnostic| format!("{}: {}", one.path.display(), one.message);
                let messages: Vec<_> = diagnostics.iter().map(message).collect();
                progress.report_failure("scene", &messages.join("; "));
            }
            Exit::WRONG
        }
        BenchError::Failed(Failure::Work(message)) => {
            progress.report_failure("work", &format!("error: {message}"));
            Exit::FAILED
        }
        BenchError::Call(message) => {
            progress.report_failure("call", &format!("error: {message}"));
            Exit::WRONG
        }
        BenchError::Canceled => Exit::FAILED,
    }
}

/// Converts the arguments to a benchmark request.
fn bench_request(args: &BenchArgs, console: &Console) -> Result<BenchRequest, Exit> {
    let folder = if args.no_cache { None } else { args.cache.clone().or_else(cache::cache_folder) };
    let scenes = if args.scenes.is_empty() {
        vec![write_starter_scene_to_cache(folder.as_deref(), console)?]
    } else {
        args.scenes.clone()
    };
    if let Some((_, twice)) = (0..).zip(&scenes).find(|(index, scene)| scenes[..*index].contains(scene)) {
        return Err(console.print_error(Exit::WRONG, &format!("{} is specified twice", twice.display())));
    }
    let outputs = [&args.csv, &args.json, &args.plot];
    Ok(BenchRequest {
        reference: reference_source(args, scenes.len(), console)?,
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
        swept: SweptSettingValues {
            integrators: args.integrator.clone(),
            photons: args.photons.iter().copied().map(bool::from).collect(),
            shadows: args.shadows.clone(),
            clamps: args.clamp.clone(),
            accels: args.accel.clone(),
        },
        steps: requested_steps(args),
        seeds: args.seeds,
        seed: args.seed,
        within: args.within,
        cache: folder,
        targets: outputs.into_iter().flatten().cloned().collect(),
    })
}

/// Returns the requested steps, sorted and without duplicates.
fn requested_steps(args: &BenchArgs) -> StepSchedule {
    let (mut samples, mut seconds) = (args.samples.clone(), args.time.clone());
    samples.sort_unstable();
    samples.dedup();
    seconds.sort_by(f64::total_cmp);
    seconds.dedup();
    match (samples.is_empty(), seconds.is_empty()) {
        (false, _) => StepSchedule::Samples(samples),
        (true, false) => StepSchedule::Seconds(seconds),
        (true, true) => StepSchedule::Climb,
    }
}

fn reference_source(args: &BenchArgs, scenes: usize, console: &Console) -> Result<ReferenceSource, Exit> {
    match (args.reference.as_slice(), args.reference_samples) {
        ([], Some(samples)) => Ok(ReferenceSource::Samples(samples)),
        ([], None) => Ok(ReferenceSource::InTime),
        (_, _) if scenes != 1 => {
            Err(console.print_error(Exit::WRONG, "--reference works with a single scene"))
        }
        ([one], _) => Ok(ReferenceSource::Files([one.clone(), one.clone()])),
        ([one, two], _) => Ok(ReferenceSource::Files([one.clone(), two.clone()])),
        (_, _) => Err(console.print_error(Exit::WRONG, "--reference is given more than twice")),
    }
}

/// Writes the `glimt new` starter scene to the reference cache and returns its path.
fn write_starter_scene_to_cache(folder: Option<&Path>, console: &Console) -> Result<PathBuf, Exit> {
    match folder.map(cache::write_starter_scene) {
        Some(made) => made.map_err(|error| console.print_error(Exit::FAILED, &error.to_string())),
        None => Err(console.print_error(Exit::WRONG, "no scene given; see glimt bench --help")),
    }
}
