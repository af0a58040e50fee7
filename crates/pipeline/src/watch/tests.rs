use std::fs;
use std::io::Write;
use std::path::Path;
use std::sync::mpsc::{Receiver, channel};

use super::*;

/// Long after the last change that counts.
const SETTLE: Duration = Duration::from_millis(900);

/// Longer than any test.
const NEVER: Duration = Duration::from_secs(3600);

struct Scratch {
    folder: tempfile::TempDir,
    news: Receiver<News>,
    watcher: Watcher,
}

impl Scratch {
    /// `a.toml` with the content `0`, watched.
    fn new(poll: bool) -> Self {
        Self::with(poll, Waits::default())
    }

    fn with(poll: bool, waits: Waits) -> Self {
        let folder = tempfile::tempdir().expect("a scratch folder");
        fs::write(folder.path().join("a.toml"), "0").expect("written");
        let (sender, news) = channel();
        let watcher = Watcher::start_with(poll, Arc::default(), waits, move |news| {
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
        let contents = Contents::default();
        let read = |path: &&Path| FileRead {
            path: path.to_path_buf(),
            content: contents.read(path, &CancelToken::new()).expect("not cancelled"),
        };
        let since = Instant::now();
        self.watcher.set_files(paths.iter().map(read).collect(), Vec::new(), since);
        // Folders are watched by the watcher's thread.
        std::thread::sleep(Duration::from_millis(150));
    }

    #[track_caller]
    fn next(&self) -> News {
        self.news.recv_timeout(Duration::from_secs(60)).expect("something is said")
    }

    /// Waits for one change and that nothing follows but that the files are quiet.
    #[track_caller]
    fn expect_one(&self) {
        assert!(matches!(self.next(), News::Changed(_)), "it is the first that is said");
        assert!(matches!(self.next(), News::Settled), "a change too many");
        self.expect_none();
    }

    #[track_caller]
    fn expect_none(&self) {
        assert!(self.news.recv_timeout(SETTLE).is_err(), "news too many");
    }

    /// Three saves with distinct contents, each noticed once.
    #[track_caller]
    fn three_saves(&self, save: impl Fn(&str)) {
        for content in ["one", "two", "three"] {
            save(content);
            self.expect_one();
        }
    }
}

fn another_kind_of_what_is_no_file_is_a_change() {
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

/// A way to save `a.toml` in a folder with a content.
type Save = fn(folder: &Path, content: &str);

/// Ways in which editors save.
const WAYS: [(&str, Save); 6] = [
    ("truncate and write", |folder, content| {
        fs::write(folder.join("a.toml"), content).expect("written");
    }),
    ("a slow truncate and write", |folder, content| {
        fs::write(folder.join("a.toml"), "").expect("written");
        std::thread::sleep(Duration::from_millis(100));
        fs::write(folder.join("a.toml"), content).expect("written");
    }),
    ("rename over it", |folder, content| {
        fs::write(folder.join("a.toml.tmp"), content).expect("written");
        fs::rename(folder.join("a.toml.tmp"), folder.join("a.toml")).expect("renamed");
    }),
    ("backup by rename, new file and delete, as vim does", |folder, content| {
        fs::write(folder.join("4913"), "").expect("written");
        fs::remove_file(folder.join("4913")).expect("removed");
        fs::rename(folder.join("a.toml"), folder.join("a.toml~")).expect("renamed");
        fs::write(folder.join("a.toml"), content).expect("written");
        fs::remove_file(folder.join("a.toml~")).expect("removed");
    }),
    ("move away and write, as emacs does", |folder, content| {
        fs::rename(folder.join("a.toml"), folder.join("a.toml~")).expect("renamed");
        fs::write(folder.join("a.toml"), content).expect("written");
    }),
    ("unlink and write", |folder, content| {
        fs::remove_file(folder.join("a.toml")).expect("removed");
        fs::write(folder.join("a.toml"), content).expect("written");
    }),
];

/// Does things at once, as most of their time is waiting; a thread that fails tells its name.
fn side_by_side<T: FnOnce() + Send>(all: impl IntoIterator<Item = (&'static str, T)>) {
    std::thread::scope(|scope| {
        for (name, one) in all {
            let thread = std::thread::Builder::new().name(name.to_owned());
            thread.spawn_scoped(scope, one).expect("a thread");
        }
    });
}

#[test]
fn each_way_to_save_is_one_change() {
    side_by_side(WAYS.map(|(name, save)| {
        let three_saves = move || {
            let scratch = Scratch::new(false);
            scratch.three_saves(|content| save(scratch.folder.path(), content));
        };
        (name, three_saves)
    }));
}

/// Functions with their names.
macro_rules! named {
    ($($own:ident),+ $(,)?) => { [$((stringify!($own), $own as fn())),+] };
}

#[test]
fn what_happens_to_watched_files_is_said() {
    side_by_side(named![
        another_kind_of_what_is_no_file_is_a_change,
        polling_sees_three_saves_of_one_length,
        a_link_whose_target_is_replaced,
        a_link_that_is_turned_elsewhere,
        the_same_content_again_and_other_files_are_no_change,
        a_missing_file_is_watched_until_it_comes_and_said_when_it_goes,
        a_folder_that_is_removed_and_made_again_is_watched_as_before,
        another_folder_of_the_same_name_is_watched_by_its_hints,
        a_change_between_reading_and_watching_is_seen,
        a_file_that_is_again_what_was_said_of_it_counts_as_changed_where_it_was_read_between,
        saves_without_a_pause_are_said_now_and_then,
        a_file_that_is_closed_after_writing_is_whole,
        a_file_that_is_renamed_into_its_place_is_whole,
        a_save_by_way_of_a_backup_is_whole_at_its_last_step,
        a_file_that_is_still_open_is_looked_at_when_it_is_closed,
        a_file_that_stays_open_is_looked_at_when_it_is_quiet_and_is_not_settled_until_it_is_closed,
        a_file_that_comes_in_two_pieces_settles_after_the_second,
        a_file_that_never_ends_settles_at_last,
    ]);
}

fn polling_sees_three_saves_of_one_length() {
    let scratch = Scratch::new(true);
    for content in ["1", "2", "3"] {
        fs::write(scratch.path("a.toml"), content).expect("written");
        scratch.expect_one();
    }
}

fn a_link_whose_target_is_replaced() {
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

fn a_link_that_is_turned_elsewhere() {
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

fn the_same_content_again_and_other_files_are_no_change() {
    let scratch = Scratch::new(false);
    fs::write(scratch.path("a.toml"), "0").expect("written");
    fs::write(scratch.path("b.png"), "1").expect("written");
    fs::read(scratch.path("a.toml")).expect("read");
    scratch.expect_none();
}

fn a_missing_file_is_watched_until_it_comes_and_said_when_it_goes() {
    let scratch = Scratch::new(false);
    let path = scratch.path("mesh.obj");
    scratch.watch(&[&path]);
    scratch.expect_none();
    fs::write(&path, "v").expect("written");
    scratch.expect_one();
    fs::remove_file(&path).expect("removed");
    scratch.expect_one();
}

fn a_folder_that_is_removed_and_made_again_is_watched_as_before() {
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
    // While it is gone nobody says so again.
    scratch.expect_none();
    make("1");
    scratch.expect_one();
    scratch.three_saves(|content| fs::write(&path, content).expect("written"));
}

fn another_folder_of_the_same_name_is_watched_by_its_hints() {
    let scratch = impatient();
    let (folder, path) = (scratch.path("sub"), scratch.path("sub/a.toml"));
    fs::create_dir(&folder).expect("a folder");
    fs::write(&path, "0").expect("written");
    scratch.watch(&[&path]);
    // The same file in it: nothing has changed.
    fs::create_dir(scratch.path("new")).expect("a folder");
    fs::write(scratch.path("new/a.toml"), "0").expect("written");
    fs::rename(&folder, scratch.path("old")).expect("renamed");
    fs::rename(scratch.path("new"), &folder).expect("renamed");
    std::thread::sleep(HEARTBEAT + SETTLE);
    scratch.expect_none();
    scratch.three_saves(|content| fs::write(&path, content).expect("written"));
}

fn a_change_between_reading_and_watching_is_seen() {
    let scratch = Scratch::new(false);
    let path = scratch.path("b.toml");
    fs::write(&path, "new").expect("written");
    let content = Content::Hash(*blake3::hash(b"old").as_bytes());
    scratch.watcher.set_files(vec![FileRead { path, content }], Vec::new(), Instant::now());
    scratch.expect_one();
}

fn a_file_that_is_again_what_was_said_of_it_counts_as_changed_where_it_was_read_between() {
    let scratch = Scratch::new(false);
    let path = scratch.path("a.toml");
    fs::write(&path, "said").expect("written");
    scratch.expect_one();
    // Something else was there for a moment: a request read it, the watcher did not.
    let content = Content::Hash(*blake3::hash(b"between").as_bytes());
    let between = vec![FileRead { path: path.clone(), content }];
    scratch.watcher.set_files(between.clone(), Vec::new(), Instant::now());
    scratch.expect_one();
    // What is known from before a save says nothing.
    scratch.watcher.set_files(Vec::new(), between, Instant::now());
    scratch.expect_none();
    // A report after a request began is newer than what the request read.
    let begun = Instant::now();
    fs::write(&path, "said later").expect("written");
    scratch.expect_one();
    scratch.watcher.set_files(vec![FileRead { path, content }], Vec::new(), begun);
    scratch.expect_none();
}

fn saves_without_a_pause_are_said_now_and_then() {
    let scratch = Scratch::new(false);
    let begin = Instant::now();
    for i in 0..150 {
        fs::write(scratch.path("a.toml"), format!("{i}")).expect("written");
        std::thread::sleep(Duration::from_millis(10));
    }
    let most = begin.elapsed().div_duration_f64(BETWEEN_CHANGES) as usize + 1;
    let during = scratch.news.try_iter().filter(|news| matches!(news, News::Changed(_))).count();
    assert!((1..=most).contains(&during), "{during} changes said, {most} may be");
    let last = fs::read(scratch.path("a.toml")).expect("read");
    std::thread::sleep(SETTLE);
    scratch.news.try_iter().count();
    fs::write(scratch.path("a.toml"), last).expect("written");
    scratch.expect_none();
}

/// Whatever needs a quiet time is never said.
fn impatient() -> Scratch {
    Scratch::with(false, Waits { quiet: NEVER, longest: NEVER, ..Waits::default() })
}

fn a_file_that_is_closed_after_writing_is_whole() {
    let scratch = impatient();
    scratch.three_saves(|content| fs::write(scratch.path("a.toml"), content).expect("written"));
}

fn a_file_that_is_renamed_into_its_place_is_whole() {
    let scratch = impatient();
    scratch.three_saves(|content| {
        fs::write(scratch.path("a.toml.tmp"), content).expect("written");
        fs::rename(scratch.path("a.toml.tmp"), scratch.path("a.toml")).expect("renamed");
    });
}

fn a_save_by_way_of_a_backup_is_whole_at_its_last_step() {
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

/// The watched file opened for writing, empty now.
fn open(scratch: &Scratch) -> fs::File {
    fs::File::create(scratch.path("a.toml")).expect("opened")
}

fn a_file_that_is_still_open_is_looked_at_when_it_is_closed() {
    let scratch = impatient();
    let mut file = open(&scratch);
    file.write_all(b"half").expect("written");
    assert!(scratch.news.recv_timeout(SETTLE).is_err(), "it is still growing");
    file.write_all(b" and half").expect("written");
    drop(file);
    scratch.expect_one();
}

fn a_file_that_stays_open_is_looked_at_when_it_is_quiet_and_is_not_settled_until_it_is_closed() {
    let scratch = Scratch::with(false, Waits { settle_open: NEVER, ..Waits::default() });
    let mut file = open(&scratch);
    file.write_all(b"half").expect("written");
    assert!(matches!(scratch.next(), News::Changed(_)));
    scratch.expect_none();
    file.write_all(b" and half").expect("written");
    assert!(matches!(scratch.next(), News::Changed(_)));
    scratch.expect_none();
    drop(file);
    assert!(matches!(scratch.next(), News::Settled));
}

fn a_file_that_comes_in_two_pieces_settles_after_the_second() {
    let scratch = Scratch::with(false, Waits { settle: 5 * Waits::default().settle, ..Waits::default() });
    fs::write(scratch.path("a.toml"), "half").expect("written");
    assert!(matches!(scratch.next(), News::Changed(_)));
    std::thread::sleep(Duration::from_millis(200));
    fs::write(scratch.path("a.toml"), "half and half").expect("written");
    scratch.expect_one();
}

fn a_file_that_never_ends_settles_at_last() {
    let waits = Waits { settle_open: NEVER, settle_longest: Duration::from_millis(300), ..Waits::default() };
    let scratch = Scratch::with(false, waits);
    let mut file = open(&scratch);
    file.write_all(b"half").expect("written");
    assert!(matches!(scratch.next(), News::Changed(_)));
    assert!(matches!(scratch.next(), News::Settled));
}
