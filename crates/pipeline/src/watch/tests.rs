use std::fs;
use std::io::Write;
use std::path::Path;
use std::sync::mpsc::{Receiver, channel};

use super::*;

/// Delay longer than any change takes to settle.
const SETTLE: Duration = Duration::from_millis(900);

/// Delay longer than any test.
const NEVER: Duration = Duration::from_secs(3600);

struct Scratch {
    folder: tempfile::TempDir,
    news: Receiver<WatchEvent>,
    watcher: Watcher,
}

impl Scratch {
    /// Creates `a.toml` containing `0` and watches the file.
    fn new(poll: bool) -> Self {
        Self::with(poll, WatchDelays::default())
    }

    fn with(poll: bool, delays: WatchDelays) -> Self {
        let folder = tempfile::tempdir().expect("a scratch folder");
        fs::write(folder.path().join("a.toml"), "0").expect("written");
        let (sender, news) = channel();
        let watcher = Watcher::start_with_delays(poll, Arc::default(), delays, move |news| {
            let _ = sender.send(news);
        });
        let watcher = watcher.expect("a thread");
        let scratch = Self { folder, news, watcher };
        scratch.watch(&[&scratch.path("a.toml")]);
        scratch
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn watch(&self, paths: &[&Path]) {
        let contents = FileHashCache::default();
        let read = |path: &&Path| FilePathAndContentId {
            path: path.to_path_buf(),
            content: contents.read_content_id(path, &CancelToken::new()).expect("not canceled"),
        };
        let since = Instant::now();
        self.watcher.set_files(paths.iter().map(read).collect(), Vec::new(), since);
        // Give the watcher thread time to start watching the folders.
        std::thread::sleep(Duration::from_millis(150));
    }

    #[track_caller]
    fn next(&self) -> WatchEvent {
        self.news.recv_timeout(Duration::from_secs(60)).expect("an event within a minute")
    }

    /// Expects exactly one change, after which the files settle.
    #[track_caller]
    fn expect_one(&self) {
        assert!(matches!(self.next(), WatchEvent::Changed(_)), "expected a change first");
        assert!(matches!(self.next(), WatchEvent::Settled), "expected only one change");
        self.expect_none();
    }

    #[track_caller]
    fn expect_none(&self) {
        assert!(self.news.recv_timeout(SETTLE).is_err(), "unexpected event");
    }

    /// Saves three different contents and expects one change for each.
    #[track_caller]
    fn three_saves(&self, save: impl Fn(&str)) {
        for content in ["one", "two", "three"] {
            save(content);
            self.expect_one();
        }
    }
}

fn replacement_by_special_file_is_reported() {
    use nix::sys::stat::Mode;
    let scratch = Scratch::new(false);
    let path = scratch.path("a.toml");
    fs::remove_file(&path).expect("removed");
    fs::create_dir(&path).expect("a folder");
    scratch.expect_one();
    fs::remove_dir(&path).expect("removed");
    nix::unistd::mkfifo(&path, Mode::S_IRWXU).expect("a pipe");
    scratch.expect_one();
    fs::remove_file(&path).expect("removed");
    std::os::unix::fs::symlink("a.toml", &path).expect("a link to itself");
    scratch.expect_one();
}

/// Saves `content` as `a.toml` in a folder.
type Save = fn(folder: &Path, content: &str);

/// Ways in which editors save files.
const SAVE_METHODS: [(&str, Save); 6] = [
    ("truncate and write", |folder, content| {
        fs::write(folder.join("a.toml"), content).expect("written");
    }),
    ("truncate and write slowly", |folder, content| {
        fs::write(folder.join("a.toml"), "").expect("written");
        std::thread::sleep(Duration::from_millis(100));
        fs::write(folder.join("a.toml"), content).expect("written");
    }),
    ("rename over the file", |folder, content| {
        fs::write(folder.join("a.toml.tmp"), content).expect("written");
        fs::rename(folder.join("a.toml.tmp"), folder.join("a.toml")).expect("renamed");
    }),
    ("rename to backup, write and delete backup, like vim", |folder, content| {
        fs::write(folder.join("4913"), "").expect("written");
        fs::remove_file(folder.join("4913")).expect("removed");
        fs::rename(folder.join("a.toml"), folder.join("a.toml~")).expect("renamed");
        fs::write(folder.join("a.toml"), content).expect("written");
        fs::remove_file(folder.join("a.toml~")).expect("removed");
    }),
    ("rename to backup and write, like emacs", |folder, content| {
        fs::rename(folder.join("a.toml"), folder.join("a.toml~")).expect("renamed");
        fs::write(folder.join("a.toml"), content).expect("written");
    }),
    ("unlink and write", |folder, content| {
        fs::remove_file(folder.join("a.toml")).expect("removed");
        fs::write(folder.join("a.toml"), content).expect("written");
    }),
];

/// Runs tests concurrently, because they mostly wait. The thread name identifies a failing test.
fn run_concurrently<T: FnOnce() + Send>(all: impl IntoIterator<Item = (&'static str, T)>) {
    std::thread::scope(|scope| {
        for (name, one) in all {
            let thread = std::thread::Builder::new().name(name.to_owned());
            thread.spawn_scoped(scope, one).expect("a thread");
        }
    });
}

#[test]
fn each_save_is_reported_as_one_change() {
    run_concurrently(SAVE_METHODS.map(|(name, save)| {
        let three_saves = move || {
            let scratch = Scratch::new(false);
            scratch.three_saves(|content| save(scratch.folder.path(), content));
        };
        (name, three_saves)
    }));
}

/// Pairs each function with its name.
macro_rules! named {
    ($($own:ident),+ $(,)?) => { [$((stringify!($own), $own as fn())),+] };
}

#[test]
fn changes_to_watched_files_are_reported() {
    run_concurrently(named![
        replacement_by_special_file_is_reported,
        polling_detects_saves_of_equal_length,
        replaced_link_target_is_reported,
        retargeted_link_is_reported,
        same_content_and_other_files_are_ignored,
        missing_file_is_watched,
        recreated_folder_is_watched,
        replaced_folder_is_watched,
        change_before_watching_is_detected,
        restored_file_is_reported_if_change_was_read,
        continuous_saves_are_rate_limited,
        closed_file_is_complete,
        renamed_file_is_complete,
        backup_save_is_complete_after_last_step,
        open_file_is_checked_when_closed,
        open_file_settles_only_when_closed,
        two_part_write_settles_after_second_part,
        endless_write_settles_eventually,
    ]);
}

fn polling_detects_saves_of_equal_length() {
    let scratch = Scratch::new(true);
    for content in ["1", "2", "3"] {
        fs::write(scratch.path("a.toml"), content).expect("written");
        scratch.expect_one();
    }
}

fn replaced_link_target_is_reported() {
    let scratch = Scratch::new(false);
    fs::create_dir(scratch.path("elsewhere")).expect("a folder");
    let target = scratch.path("elsewhere/real.toml");
    fs::write(&target, "0").expect("written");
    let link = scratch.path("link.toml");
    std::os::unix::fs::symlink(&target, &link).expect("a link");
    scratch.watch(&[&link]);
    scratch.three_saves(|content| {
        let temporary = scratch.path("elsewhere/real.tmp");
        fs::write(&temporary, content).expect("written");
        fs::rename(&temporary, &target).expect("renamed");
    });
}

fn retargeted_link_is_reported() {
    let scratch = Scratch::new(false);
    fs::write(scratch.path("one"), "1").expect("written");
    fs::write(scratch.path("two"), "2").expect("written");
    let link = scratch.path("link.toml");
    std::os::unix::fs::symlink(scratch.path("one"), &link).expect("a link");
    scratch.watch(&[&link]);
    std::os::unix::fs::symlink(scratch.path("two"), scratch.path("new")).expect("a link");
    fs::rename(scratch.path("new"), &link).expect("renamed");
    scratch.expect_one();
}

fn same_content_and_other_files_are_ignored() {
    let scratch = Scratch::new(false);
    fs::write(scratch.path("a.toml"), "0").expect("written");
    fs::write(scratch.path("b.png"), "1").expect("written");
    fs::read(scratch.path("a.toml")).expect("read");
    scratch.expect_none();
}

fn missing_file_is_watched() {
    let scratch = Scratch::new(false);
    let path = scratch.path("mesh.obj");
    scratch.watch(&[&path]);
    scratch.expect_none();
    fs::write(&path, "v").expect("written");
    scratch.expect_one();
    fs::remove_file(&path).expect("removed");
    scratch.expect_one();
}

fn recreated_folder_is_watched() {
    let scratch = Scratch::new(false);
    let (folder, path) = (scratch.path("sub"), scratch.path("sub/a.toml"));
    let make = |content: &str| {
        fs::create_dir(&folder).expect("a folder");
        fs::write(&path, content).expect("written");
    };
    make("0");
    scratch.watch(&[&path]);
    fs::remove_dir_all(&folder).expect("removed");
    scratch.expect_one();
    // Nothing more is reported while the folder is missing.
    scratch.expect_none();
    make("1");
    scratch.expect_one();
    scratch.three_saves(|content| fs::write(&path, content).expect("written"));
}

fn replaced_folder_is_watched() {
    let scratch = impatient();
    let (folder, path) = (scratch.path("sub"), scratch.path("sub/a.toml"));
    fs::create_dir(&folder).expect("a folder");
    fs::write(&path, "0").expect("written");
    scratch.watch(&[&path]);
    // Swap in a folder that contains the same file, which is not a change.
    fs::create_dir(scratch.path("new")).expect("a folder");
    fs::write(scratch.path("new/a.toml"), "0").expect("written");
    fs::rename(&folder, scratch.path("old")).expect("renamed");
    fs::rename(scratch.path("new"), &folder).expect("renamed");
    std::thread::sleep(HEARTBEAT + SETTLE);
    scratch.expect_none();
    scratch.three_saves(|content| fs::write(&path, content).expect("written"));
}

fn change_before_watching_is_detected() {
    let scratch = Scratch::new(false);
    let path = scratch.path("b.toml");
    fs::write(&path, "new").expect("written");
    let content = FileContentId::Hash(*blake3::hash(b"old").as_bytes());
    scratch.watcher.set_files(vec![FilePathAndContentId { path, content }], Vec::new(), Instant::now());
    scratch.expect_one();
}

fn restored_file_is_reported_if_change_was_read() {
    let scratch = Scratch::new(false);
    let path = scratch.path("a.toml");
    fs::write(&path, "said").expect("written");
    scratch.expect_one();
    // The file temporarily had different content, which a request read but the watcher did not see.
    let content = FileContentId::Hash(*blake3::hash(b"between").as_bytes());
    let between = vec![FilePathAndContentId { path: path.clone(), content }];
    scratch.watcher.set_files(between.clone(), Vec::new(), Instant::now());
    scratch.expect_one();
    // Contents read before a save are ignored.
    scratch.watcher.set_files(Vec::new(), between, Instant::now());
    scratch.expect_none();
    // A change reported after the start of a request is newer than the content read by the request.
    let begun = Instant::now();
    fs::write(&path, "said later").expect("written");
    scratch.expect_one();
    scratch.watcher.set_files(vec![FilePathAndContentId { path, content }], Vec::new(), begun);
    scratch.expect_none();
}

fn continuous_saves_are_rate_limited() {
    let scratch = Scratch::new(false);
    let begin = Instant::now();
    for i in 0..150 {
        fs::write(scratch.path("a.toml"), format!("{i}")).expect("written");
        std::thread::sleep(Duration::from_millis(10));
    }
    let most = begin.elapsed().div_duration_f64(BETWEEN_CHANGES) as usize + 1;
    let during = scratch.news.try_iter().filter(|news| matches!(news, WatchEvent::Changed(_))).count();
    assert!((1..=most).contains(&during), "{during} changes were reported, but at most {most} are allowed");
    let last = fs::read(scratch.path("a.toml")).expect("read");
    std::thread::sleep(SETTLE);
    scratch.news.try_iter().count();
    fs::write(scratch.path("a.toml"), last).expect("written");
    scratch.expect_none();
}

/// Starts a watcher with infinite delays, so that only complete saves are reported.
fn impatient() -> Scratch {
    Scratch::with(false, WatchDelays { quiet: NEVER, longest: NEVER, ..WatchDelays::default() })
}

fn closed_file_is_complete() {
    let scratch = impatient();
    scratch.three_saves(|content| fs::write(scratch.path("a.toml"), content).expect("written"));
}

fn renamed_file_is_complete() {
    let scratch = impatient();
    scratch.three_saves(|content| {
        fs::write(scratch.path("a.toml.tmp"), content).expect("written");
        fs::rename(scratch.path("a.toml.tmp"), scratch.path("a.toml")).expect("renamed");
    });
}

fn backup_save_is_complete_after_last_step() {
    let scratch = impatient();
    scratch.three_saves(|content| {
        fs::rename(scratch.path("a.toml"), scratch.path("a.toml~")).expect("renamed");
        fs::write(scratch.path("a.toml"), content).expect("written");
        fs::remove_file(scratch.path("a.toml~")).expect("removed");
    });
    scratch.three_saves(|content| {
        fs::remove_file(scratch.path("a.toml")).expect("removed");
        fs::write(scratch.path("a.toml"), format!("{content} more")).expect("written");
    });
}

/// Truncates the watched file and opens it for writing.
fn open(scratch: &Scratch) -> fs::File {
    fs::File::create(scratch.path("a.toml")).expect("opened")
}

fn open_file_is_checked_when_closed() {
    let scratch = impatient();
    let mut file = open(&scratch);
    file.write_all(b"half").expect("written");
    assert!(scratch.news.recv_timeout(SETTLE).is_err(), "an open file should not be reported");
    file.write_all(b" and half").expect("written");
    drop(file);
    scratch.expect_one();
}

fn open_file_settles_only_when_closed() {
    let scratch = Scratch::with(false, WatchDelays { settle_open: NEVER, ..WatchDelays::default() });
    let mut file = open(&scratch);
    file.write_all(b"half").expect("written");
    assert!(matches!(scratch.next(), WatchEvent::Changed(_)));
    scratch.expect_none();
    file.write_all(b" and half").expect("written");
    assert!(matches!(scratch.next(), WatchEvent::Changed(_)));
    scratch.expect_none();
    drop(file);
    assert!(matches!(scratch.next(), WatchEvent::Settled));
}

fn two_part_write_settles_after_second_part() {
    let scratch = Scratch::with(
        false,
        WatchDelays { settle: 5 * WatchDelays::default().settle, ..WatchDelays::default() },
    );
    fs::write(scratch.path("a.toml"), "half").expect("written");
    assert!(matches!(scratch.next(), WatchEvent::Changed(_)));
    std::thread::sleep(Duration::from_millis(200));
    fs::write(scratch.path("a.toml"), "half and half").expect("written");
    scratch.expect_one();
}

fn endless_write_settles_eventually() {
    let delays = WatchDelays {
        settle_open: NEVER,
        settle_longest: Duration::from_millis(300),
        ..WatchDelays::default()
    };
    let scratch = Scratch::with(false, delays);
    let mut file = open(&scratch);
    file.write_all(b"half").expect("written");
    assert!(matches!(scratch.next(), WatchEvent::Changed(_)));
    assert!(matches!(scratch.next(), WatchEvent::Settled));
}
