//! Tests for the removal of temporary files left by killed processes.

use std::io::{ErrorKind, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::process;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use nix::fcntl::OFlag;
use nix::sys::stat::Mode;
use nix::unistd::mkfifo;

use super::*;
use crate::system::machine::ProcessIdentity;

/// Creates a temporary file like one left behind by a killed process.
fn leave_stale_file(bench: &Bench) -> PathBuf {
    let mut child = process::Command::new("true").spawn().expect("`true` starts");
    child.wait().expect("`true` ends");
    let machine = ProcessIdentity::current().machine;
    let path = bench.path(&format!(".z.ppm.glimt-{machine:016x}-{}-0.tmp", child.id()));
    fs::write(&path, "half an image").expect("written");
    path
}

#[test]
fn folders_are_searched_once_for_all_outputs() {
    // The image does not fit into a pipe.
    let scene = SCENE.replace("width = 40", "width = 300").replace("height = 30", "height = 300");
    let mut bench = Bench::new(&scene);
    let [first, pipe, last] = ["a.ppm", "pipe.ppm", "z.ppm"].map(|name| bench.path(name));
    mkfifo(&pipe, Mode::S_IRWXU).expect("a pipe");
    let mut reader =
        fs::OpenOptions::new().read(true).custom_flags(OFlag::O_NONBLOCK.bits()).open(&pipe).expect("opened");
    bench.overrides.outputs = vec![first.clone(), pipe, last.clone()];
    let of = bench.send();
    while !matches!(bench.next(), Event::Written { path, .. } if path == first) {}
    // Until the pipe is read, the worker cannot write the last file.
    let stale = leave_stale_file(&bench);
    assert!(!last.exists());
    let is_over = Arc::new(AtomicBool::new(false));
    let has_ended = is_over.clone();
    let drain = std::thread::spawn(move || {
        let mut bytes = vec![0; 1 << 16];
        while !has_ended.load(Ordering::Relaxed) {
            match reader.read(&mut bytes) {
                Ok(1..) => {}
                Ok(0) => std::thread::yield_now(),
                Err(error) => assert_eq!(error.kind(), ErrorKind::WouldBlock),
            }
        }
    });
    assert!(matches!(bench.until_end(of).pop(), Some(Event::Done { .. })) && last.exists());
    assert!(stale.exists(), "the folder was searched again for the last output");
    bench.edit("exposure = 0.0", "exposure = 1.0");
    bench.done();
    assert!(!stale.exists(), "each request searches the folder");
    is_over.store(true, Ordering::Relaxed);
    drain.join().expect("the reader does not panic");
}
