//! Replaces a text that a user edits only if it is the expected one. Between any two steps, each text that somebody has saved has
//! the file's name or a held name, which no cleanup removes and the next start reports.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use super::move_new::move_new;
use super::place;
use super::temporary::Temporary;

/// Ending of the held name.
const ENDING: &str = ".glimt-saved";
/// Saves by other programs that a replacement survives while it is under way.
const ATTEMPTS: usize = 16;

/// State of a held text when a file is opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Held {
    /// There is none, or it was that of the file.
    None,
    /// It has the file's name again: nothing else had.
    Restored,
    /// It differs from the file. Somebody has to compare them.
    Differs(PathBuf),
}

/// Looks for a text that an interrupted replacement of a file has left, and puts it back if the file is gone.
pub fn recover(path: &Path) -> Held {
    let Ok((target, existing)) = place::follow(path) else { return Held::None };
    let held = name(&target);
    let Ok(text) = fs::read(&held) else { return Held::None };
    if existing.is_none() && move_new(&held, &target).is_ok() {
        return Held::Restored;
    }
    if fs::read(&target).is_ok_and(|own| own == text) {
        // What cannot be removed is reported.
        return fs::remove_file(&held).map_or(Held::Differs(held), |()| Held::None);
    }
    Held::Differs(held)
}

fn name(target: &Path) -> PathBuf {
    let mut name = target.as_os_str().to_owned();
    name.push(ENDING);
    name.into()
}

/// A replacement under way. Its steps are [`Self::begin`], [`Self::swap`] and [`Self::settle`].
pub(super) struct Replacement<'a> {
    target: &'a Path,
    held: PathBuf,
    expected: &'a [u8],
    new: Temporary,
}

impl<'a> Replacement<'a> {
    /// Gives the new text the held name.
    ///
    /// # Errors
    /// A file has that name already, or the system's.
    pub(super) fn begin(mut new: Temporary, target: &'a Path, expected: &'a [u8]) -> io::Result<Self> {
        let held = name(target);
        new.move_to_new(&held).map_err(|error| taken(&held, error))?;
        Ok(Self { target, held, expected, new })
    }

    /// Exchanges both names; the old text is held then.
    ///
    /// # Errors
    /// The system's, with the new text under its temporary name.
    pub(super) fn swap(mut self) -> Result<Self, (io::Error, Option<Temporary>)> {
        match exchange(&self.held, self.target) {
            Ok(()) => Ok(self),
            Err(error) => {
                let is_back = self.new.take_back(&self.held).is_ok();
                Err((error, is_back.then_some(self.new)))
            }
        }
    }

    /// Decides by the old text. If it is not the expected one, puts it back. Returns the new file, or `None` if it was put back.
    ///
    /// # Errors
    /// The system's: a text may still be held.
    pub(super) fn settle(self) -> io::Result<Option<File>> {
        let text = fs::read(&self.held)?;
        if text == self.expected {
            // What cannot be removed is removed or reported at the next start.
            let _ = fs::remove_file(&self.held);
            return self.new.file.try_clone().map(Some);
        }
        self.put_back(text)?;
        Ok(None)
    }

    /// Puts the old text back; a text that somebody saves meanwhile is newer and takes its place.
    fn put_back(&self, mut older: Vec<u8>) -> io::Result<()> {
        for _ in 0..ATTEMPTS {
            exchange(&self.held, self.target)?;
            if self.is_new_held() {
                return fs::remove_file(&self.held);
            }
            // The held text was saved after the first exchange: it goes back, and the older one comes out.
            let newer = fs::read(&self.held)?;
            exchange(&self.held, self.target)?;
            if fs::read(&self.held)? == older {
                return fs::remove_file(&self.held);
            }
            older = newer;
        }
        Err(io::Error::new(ErrorKind::AlreadyExists, in_the_way(&self.held)))
    }

    /// Whether the held file is the new one.
    fn is_new_held(&self) -> bool {
        super::FileIdentity::of(&self.held).is_some_and(|held| held.is_of(&self.new.file))
    }
}

/// The same where two names cannot be exchanged: the old text is taken out, looked at, and the new one gets its name if that is
/// still free.
pub(super) struct Steps<'a> {
    target: &'a Path,
    held: PathBuf,
    expected: &'a [u8],
}

impl<'a> Steps<'a> {
    /// Takes the old text out.
    ///
    /// # Errors
    /// A file has the held name already, or the system's.
    pub(super) fn begin(target: &'a Path, expected: &'a [u8]) -> io::Result<Self> {
        let held = name(target);
        move_new(target, &held).map_err(|error| taken(&held, error))?;
        Ok(Self { target, held, expected })
    }

    /// Gives the new text its name, or puts the old one back.
    ///
    /// # Errors
    /// The system's: a text may still be held.
    pub(super) fn settle(self, mut new: Temporary) -> io::Result<Option<File>> {
        if fs::read(&self.held)? != self.expected {
            return move_new(&self.held, self.target).map(|()| None);
        }
        let file = new.file.try_clone()?;
        match new.move_to_new(self.target) {
            // Somebody has saved meanwhile: that text stays, and the expected one is older.
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                fs::remove_file(&self.held)?;
                Ok(None)
            }
            Err(error) => move_new(&self.held, self.target).and(Err(error)),
            Ok(()) => {
                // What cannot be removed is removed or reported at the next start.
                let _ = fs::remove_file(&self.held);
                Ok(Some(file))
            }
        }
    }
}

/// Replaces a file of this content. Returns the new file, or `None` if the file has another content, which stays.
///
/// # Errors
/// The system's.
pub(super) fn replace(new: Temporary, target: &Path, expected: &[u8]) -> io::Result<Option<File>> {
    match Replacement::begin(new, target, expected)?.swap() {
        Ok(replacement) => replacement.settle(),
        // The file system cannot exchange two names, or the file is gone.
        Err((error, Some(new))) if error.kind() != ErrorKind::PermissionDenied => {
            Steps::begin(target, expected)?.settle(new)
        }
        Err((error, _)) => Err(error),
    }
}

/// An error of moving a file to the held name.
fn taken(held: &Path, error: io::Error) -> io::Error {
    match error.kind() {
        ErrorKind::AlreadyExists => io::Error::new(ErrorKind::AlreadyExists, in_the_way(held)),
        _ => error,
    }
}

fn in_the_way(held: &Path) -> String {
    format!(
        "{} has a text from an interrupted replacement: compare it with the file, then remove it",
        held.display()
    )
}

#[cfg(target_os = "linux")]
fn exchange(one: &Path, other: &Path) -> io::Result<()> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    Ok(renameat_with(CWD, one, CWD, other, RenameFlags::EXCHANGE)?)
}

#[cfg(not(target_os = "linux"))]
fn exchange(_: &Path, _: &Path) -> io::Result<()> {
    Err(ErrorKind::Unsupported.into())
}

/// A warning about a held text that differs from a file.
pub fn words(held: &Path) -> String {
    format!("{} has another text of this scene: glimt was ended while it wrote the scene", held.display())
}

#[cfg(test)]
mod tests {
    use std::ffi::OsStr;
    use std::io::Write;

    use super::super::temporary::remove_stale;
    use super::*;

    const OLD: &str = "as glimt read it";
    const NEWER: &str = "saved by an editor meanwhile";
    const NEW: &str = "written by glimt";

    struct Desk {
        folder: tempfile::TempDir,
    }

    impl Desk {
        fn new() -> Self {
            let desk = Self { folder: tempfile::tempdir().expect("a folder") };
            fs::write(desk.scene(), OLD).expect("written");
            desk
        }

        fn scene(&self) -> PathBuf {
            self.folder.path().join("a.toml")
        }

        /// A new text under a temporary name.
        fn new_text(&self) -> Temporary {
            let new = Temporary::create(self.folder.path(), OsStr::new("a.toml"), 0o644).expect("a file");
            (&new.file).write_all(NEW.as_bytes()).expect("written");
            new
        }

        /// Another program saves the scene under a temporary name and renames it.
        fn save(&self, text: &str) {
            let other = self.folder.path().join("of the editor");
            fs::write(&other, text).expect("written");
            fs::rename(other, self.scene()).expect("renamed");
        }

        /// All texts that a user finds after a kill, a cleanup and the next start.
        fn after_a_kill(&self) -> Vec<String> {
            remove_stale(self.folder.path(), &|_| false);
            recover(&self.scene());
            let entries = fs::read_dir(self.folder.path()).expect("a folder");
            let names = entries.map(|entry| entry.expect("an entry").path());
            let texts = names.filter(|path| path.extension().is_none_or(|ending| ending != "tmp"));
            texts.map(|path| fs::read_to_string(path).expect("a text")).collect()
        }

        fn has(&self, text: &str) -> bool {
            fs::read_to_string(self.scene()).is_ok_and(|now| now == text)
        }
    }

    #[test]
    fn the_expected_text_is_replaced_and_another_one_stays() {
        let desk = Desk::new();
        assert!(replace(desk.new_text(), &desk.scene(), OLD.as_bytes()).expect("replaced").is_some());
        assert!(desk.has(NEW));
        desk.save(NEWER);
        assert!(replace(desk.new_text(), &desk.scene(), OLD.as_bytes()).expect("no error").is_none());
        assert!(desk.has(NEWER));
        assert_eq!(fs::read_dir(desk.folder.path()).expect("a folder").count(), 1, "nothing is left");
        // The same by steps.
        let scene = desk.scene();
        let steps = Steps::begin(&scene, OLD.as_bytes()).expect("taken");
        assert!(steps.settle(desk.new_text()).expect("no error").is_none() && desk.has(NEWER));
        let steps = Steps::begin(&scene, NEWER.as_bytes()).expect("taken");
        assert!(steps.settle(desk.new_text()).expect("no error").is_some() && desk.has(NEW));
        assert_eq!(fs::read_dir(desk.folder.path()).expect("a folder").count(), 1, "nothing is left");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_kill_between_two_steps_loses_no_saved_text() {
        // Steps done before the kill, and whether an editor has saved before them, or between exchange and look.
        for steps in 0..=2 {
            for saves in [vec![], vec![0], vec![1], vec![0, 1], vec![2], vec![0, 2]] {
                let desk = Desk::new();
                let scene = desk.scene();
                let mut newest = OLD.to_owned();
                let mut save = |at: usize| {
                    if saves.contains(&at) {
                        newest = format!("{NEWER} {at}");
                        desk.save(&newest);
                    }
                };
                save(0);
                let new = desk.new_text();
                if steps == 0 {
                    std::mem::forget(new);
                } else {
                    let mut replacement = Replacement::begin(new, &scene, OLD.as_bytes()).expect("begun");
                    save(1);
                    if steps == 2 {
                        replacement = replacement.swap().map_err(|(error, _)| error).expect("swapped");
                        save(2);
                    }
                    std::mem::forget(replacement);
                }
                let found = desk.after_a_kill();
                let is_lost = newest != OLD && !found.contains(&newest);
                assert!(!is_lost, "{steps} {saves:?}: {newest:?} is not in {found:?}");
                assert!(scene.exists() && found.len() <= 2, "{steps} {saves:?}: {found:?}");
                // The next start reports two texts until somebody removes one.
                let held = recover(&scene);
                assert_eq!(matches!(held, Held::Differs(_)), found.len() == 2, "{steps} {saves:?}: {held:?}");
                let again = replace(desk.new_text(), &scene, newest.as_bytes());
                assert_eq!(again.is_err(), found.len() == 2, "it is not written over: {again:?}");
            }
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_text_saved_during_the_exchange_back_stays_the_newest() {
        let desk = Desk::new();
        let scene = desk.scene();
        desk.save("first");
        let replacement = Replacement::begin(desk.new_text(), &scene, OLD.as_bytes()).expect("begun");
        let replacement = replacement.swap().map_err(|(error, _)| error).expect("swapped");
        desk.save("second");
        assert!(replacement.settle().expect("no error").is_none());
        assert!(desk.has("second"));
        assert_eq!(fs::read_dir(desk.folder.path()).expect("a folder").count(), 1);
    }

    #[test]
    fn a_text_without_its_file_is_restored() {
        let desk = Desk::new();
        let scene = desk.scene();
        std::mem::forget(Steps::begin(&scene, OLD.as_bytes()).expect("taken"));
        assert!(!scene.exists());
        assert_eq!(recover(&scene), Held::Restored);
        assert!(desk.has(OLD));
        // Through a link as well.
        let link = desk.folder.path().join("link.toml");
        std::os::unix::fs::symlink(&scene, &link).expect("a link");
        std::mem::forget(Steps::begin(&scene, OLD.as_bytes()).expect("taken"));
        assert_eq!(recover(&link), Held::Restored);
        assert_eq!(recover(&link), Held::None);
        // An editor saves while the old text is taken out.
        let steps = Steps::begin(&scene, OLD.as_bytes()).expect("taken");
        desk.save(NEWER);
        assert!(steps.settle(desk.new_text()).expect("no error").is_none() && desk.has(NEWER));
    }
}
