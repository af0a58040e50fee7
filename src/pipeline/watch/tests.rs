use std::fs;
use std::path::Path;
use std::sync::mpsc::{Receiver, channel};

use super::*;

/// Long after the last change that counts.
const SETTLE: Duration = Duration::from_millis(900);

struct Scratch {
    folder: tempfile::TempDir,
    changes: Receiver<Changed>,
    watcher: Watcher,
}

impl Scratch {
    /// `a.toml` with the content `0`, watched.
    fn new(poll: bool) -> Self {
        let folder = tempfile::tempdir().expect("a scratch folder");
        fs::write(folder.path().join("a.toml"), "0").expect("written");
        let (sender, changes) = channel();
        let watcher = Watcher::start(poll, Arc::default(), move |changed| {
            let _ = sender.send(changed);
        });
        let watcher = watcher.expect("a thread");
        let scratch = Self { folder, changes, watcher };
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
        self.watcher.set_files(paths.iter().map(read).collect());
        // Folders are watched by the watcher's thread.
        std::thread::sleep(Duration::from_millis(150));
    }

    /// Waits for one change and that no second one follows.
    #[track_caller]
    fn expect_one(&self) {
        self.changes.recv_timeout(Duration::from_secs(10)).expect("the change was noticed");
        self.expect_none();
    }

    #[track_caller]
    fn expect_none(&self) {
        assert!(self.changes.recv_timeout(SETTLE).is_err(), "a change too many");
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

#[test]
fn truncate_and_write() {
    let scratch = Scratch::new(false);
    scratch.three_saves(|content| fs::write(scratch.path("a.toml"), content).expect("written"));
}

#[test]
fn a_slow_truncate_and_write_counts_once() {
    let scratch = Scratch::new(false);
    scratch.three_saves(|content| {
        fs::write(scratch.path("a.toml"), "").expect("written");
        std::thread::sleep(Duration::from_millis(100));
        fs::write(scratch.path("a.toml"), content).expect("written");
    });
}

#[test]
fn rename_over() {
    let scratch = Scratch::new(false);
    scratch.three_saves(|content| {
        fs::write(scratch.path("a.toml.tmp"), content).expect("written");
        fs::rename(scratch.path("a.toml.tmp"), scratch.path("a.toml")).expect("renamed");
    });
}

#[test]
fn backup_by_rename_new_file_and_delete_as_vim_does() {
    let scratch = Scratch::new(false);
    scratch.three_saves(|content| {
        fs::write(scratch.path("4913"), "").expect("written");
        fs::remove_file(scratch.path("4913")).expect("removed");
        fs::rename(scratch.path("a.toml"), scratch.path("a.toml~")).expect("renamed");
        fs::write(scratch.path("a.toml"), content).expect("written");
        fs::remove_file(scratch.path("a.toml~")).expect("removed");
    });
}

#[test]
fn move_away_and_write_as_emacs_does() {
    let scratch = Scratch::new(false);
    scratch.three_saves(|content| {
        fs::rename(scratch.path("a.toml"), scratch.path("a.toml~")).expect("renamed");
        fs::write(scratch.path("a.toml"), content).expect("written");
    });
}

#[test]
fn unlink_and_write() {
    let scratch = Scratch::new(false);
    scratch.three_saves(|content| {
        fs::remove_file(scratch.path("a.toml")).expect("removed");
        fs::write(scratch.path("a.toml"), content).expect("written");
    });
}

#[test]
fn polling_sees_three_saves_of_one_length() {
    let scratch = Scratch::new(true);
    for content in ["1", "2", "3"] {
        fs::write(scratch.path("a.toml"), content).expect("written");
        scratch.expect_one();
    }
}

#[test]
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

#[test]
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

#[test]
fn the_same_content_again_and_other_files_are_no_change() {
    let scratch = Scratch::new(false);
    fs::write(scratch.path("a.toml"), "0").expect("written");
    fs::write(scratch.path("b.png"), "1").expect("written");
    fs::read(scratch.path("a.toml")).expect("read");
    scratch.expect_none();
}

#[test]
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

#[test]
fn a_change_between_reading_and_watching_is_seen() {
    let scratch = Scratch::new(false);
    let path = scratch.path("b.toml");
    fs::write(&path, "new").expect("written");
    let content = Content::Hash(*blake3::hash(b"old").as_bytes());
    scratch.watcher.set_files(vec![FileRead { path, content }]);
    scratch.expect_one();
}

#[test]
fn saves_without_a_pause_are_said_now_and_then() {
    let scratch = Scratch::new(false);
    for i in 0..150 {
        fs::write(scratch.path("a.toml"), format!("{i}")).expect("written");
        std::thread::sleep(Duration::from_millis(10));
    }
    let during = scratch.changes.try_iter().count();
    assert!((1..=5).contains(&during), "{during} changes said in 1.5 s of saves");
    std::thread::sleep(SETTLE);
    scratch.changes.try_iter().count();
    scratch.expect_none();
}
