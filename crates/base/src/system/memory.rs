//! System limits on this process's memory, and allocations that may fail.

use std::cell::Cell;
use std::collections::TryReserveError;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use nix::sys::resource::{RLIM_INFINITY, Resource, getrlimit, setrlimit};

thread_local! {
    static MAY_FAIL: Cell<bool> = const { Cell::new(false) };
}

/// Whether the caller of the current allocation handles its failure.
pub(super) fn caller_handles_alloc_failure() -> bool {
    MAY_FAIL.get()
}

/// Reserves memory for exactly `additional` more elements. If any other allocation fails,
/// [`AbortingAllocator`](super::abort::AbortingAllocator) ends the process.
///
/// # Errors
/// Returns an error if there is not enough memory.
pub fn try_reserve_exact<T>(vec: &mut Vec<T>, additional: usize) -> Result<(), TryReserveError> {
    MAY_FAIL.set(true);
    let reserved = vec.try_reserve_exact(additional);
    MAY_FAIL.set(false);
    reserved
}

/// The control group's limit, once [`set_rlimit_from_cgroup`] has applied it.
static APPLIED_LIMIT: OnceLock<MemoryLimit> = OnceLock::new();

/// Makes allocations that exceed the control group's memory limit fail. Otherwise, the kernel would kill the
/// process without a message. `stacks` is the total size of the thread stacks, which count in full although
/// they are hardly used. They are therefore added to the limit, up to an eighth of it.
pub fn set_rlimit_from_cgroup(stacks: u64) {
    let Some(limit) = current_cgroup_limit() else { return };
    let Ok((soft, hard)) = getrlimit(Resource::RLIMIT_DATA) else { return };
    let bytes = limit.bytes.saturating_add(stacks.min(limit.bytes / 8));
    if bytes < soft && setrlimit(Resource::RLIMIT_DATA, bytes, hard).is_ok() {
        // Setting the limit fails only if an earlier call has set it.
        let _ = APPLIED_LIMIT.set(limit);
    }
}

/// Returns the setting that prevents this process from mapping `bytes` more bytes of memory, or `None` if
/// there is enough room.
pub fn limit_preventing_mapping(bytes: u64) -> Option<&'static str> {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let limits = [
        (Resource::RLIMIT_AS, proc_status_bytes(&status, "VmSize"), "`ulimit -v`"),
        (
            Resource::RLIMIT_DATA,
            proc_status_bytes(&status, "VmData") + proc_status_bytes(&status, "VmStk"),
            APPLIED_LIMIT.get().map_or("`ulimit -d`", |limit| &limit.setting),
        ),
    ];
    let is_exhausted =
        |resource, used: u64| getrlimit(resource).is_ok_and(|(limit, _)| used.saturating_add(bytes) > limit);
    limits.into_iter().find(|(resource, used, _)| is_exhausted(*resource, *used)).map(|(.., setting)| setting)
}

/// Returns a size listed in `/proc/self/status`, such as `VmSize:  1024 kB`. Returns 0 if it is not listed.
fn proc_status_bytes(status: &str, name: &str) -> u64 {
    let line = status.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'));
    let kilobytes = line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok());
    kilobytes.unwrap_or(0).saturating_mul(1024)
}

/// Maximum amount of memory available to this process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MemoryLimit {
    /// Limit in bytes.
    pub bytes: u64,
    /// Name of the setting that imposes the limit, such as `` `ulimit -v` ``.
    pub setting: String,
}

/// Lowest memory limit set by `ulimit -v` or a control group, or `None` if memory is unlimited.
pub fn ulimit_or_cgroup_limit() -> Option<MemoryLimit> {
    let of_space =
        getrlimit(Resource::RLIMIT_AS).ok().map(|(bytes, _)| bytes).filter(|bytes| *bytes < RLIM_INFINITY);
    let of_space = of_space.map(|bytes| MemoryLimit { bytes, setting: "`ulimit -v`".to_owned() });
    of_space.into_iter().chain(current_cgroup_limit()).min_by_key(|limit| limit.bytes)
}

/// Lowest limit among this process's control groups, or `None` if memory is unlimited.
#[cold]
fn current_cgroup_limit() -> Option<MemoryLimit> {
    let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    lowest_limit_of_cgroups(Path::new("/sys/fs/cgroup"), &groups)
}

/// Lowest limit among the control groups (version 1 or 2) listed in `/proc/self/cgroup` and their ancestors.
fn lowest_limit_of_cgroups(root: &Path, groups: &str) -> Option<MemoryLimit> {
    let of_line = |line: &str| {
        let [_, controllers, path] = <[&str; 3]>::try_from(line.splitn(3, ':').collect::<Vec<_>>()).ok()?;
        let (root, file) = match controllers {
            "" => (root.to_owned(), "memory.max"),
            _ if controllers.split(',').any(|one| one == "memory") => {
                (root.join("memory"), "memory.limit_in_bytes")
            }
            _ => return None,
        };
        lowest_ancestor_limit(&root, path, file)
    };
    groups.lines().filter_map(of_line).min_by_key(|limit| limit.bytes)
}

/// Returns the lowest limit among a group and its ancestors. In a container, the path may be the host's path
/// even though the root is the container's own group.
fn lowest_ancestor_limit(root: &Path, path: &str, file: &str) -> Option<MemoryLimit> {
    /// Version 1 represents "no limit" as the largest possible number of pages.
    const NONE: u64 = 1 << 60;
    let group = root.join(path.trim_start_matches('/'));
    let folders = group.ancestors().take_while(|folder| folder.starts_with(root));
    let read = |folder: &Path| -> Option<(u64, PathBuf)> {
        let file = folder.join(file);
        let bytes = fs::read_to_string(&file).ok()?.trim().parse().ok()?;
        (bytes < NONE).then_some((bytes, file))
    };
    let (bytes, file) = folders.filter_map(read).min_by_key(|(bytes, _)| *bytes)?;
    Some(MemoryLimit { bytes, setting: format!("the control group ({})", file.display()) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(root: &Path, file: &str, text: &str) {
        let path = root.join(file);
        fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        fs::write(path, text).expect("written");
    }

    #[test]
    fn process_status_sizes_are_converted_to_bytes() {
        let status = "Name:\tglimt\nVmPeak:\t   9000 kB\nVmSize:\t   8192 kB\nThreads:\t1\n";
        assert_eq!(proc_status_bytes(status, "VmSize"), 8192 * 1024);
        assert_eq!(proc_status_bytes(status, "VmData"), 0);
    }

    #[test]
    fn only_fallible_reservations_may_fail() {
        let mut bytes = Vec::<u8>::new();
        assert!(try_reserve_exact(&mut bytes, isize::MAX as usize).is_err());
        assert!(!caller_handles_alloc_failure());
        assert!(try_reserve_exact(&mut bytes, 100).is_ok() && bytes.capacity() >= 100);
    }

    #[test]
    fn lowest_limit_among_ancestors_applies() {
        let root = tempfile::tempdir().expect("a folder");
        let root = root.path();
        let bytes = |groups: &str| lowest_limit_of_cgroups(root, groups).map(|limit| limit.bytes);
        assert_eq!(bytes("0::/a/b\n"), None);
        write(root, "a/b/memory.max", "max\n");
        assert_eq!(bytes("0::/a/b\n"), None);
        write(root, "a/memory.max", "4096000\n");
        assert_eq!(bytes("0::/a/b\n"), Some(4_096_000));
        write(root, "a/b/memory.max", "8192000\n");
        assert_eq!(bytes("0::/a/b\n"), Some(4_096_000), "the parent group's limit is lower");
        write(root, "a/b/memory.max", "1024000\n");
        assert_eq!(bytes("0::/a/b\n"), Some(1_024_000));
        let said = lowest_limit_of_cgroups(root, "0::/a/b\n").expect("a limit").setting;
        assert!(said.ends_with("/a/b/memory.max)"), "{said}");
        // In a container, the root is the container's own group, but the listed path may be the host's.
        write(root, "memory.max", "512000\n");
        for groups in ["0::/\n", "0::/kubepods/pod1\n", "1:cpu:/x\n0::/\n"] {
            assert_eq!(bytes(groups), Some(512_000), "{groups}");
        }
    }

    #[test]
    fn cgroup_version_1_uses_a_separate_folder() {
        let root = tempfile::tempdir().expect("a folder");
        let root = root.path();
        let groups = "12:cpu,cpuacct:/job\n7:memory:/job\n0::/job\n";
        write(root, "memory/memory.limit_in_bytes", "9223372036854771712\n");
        assert_eq!(lowest_limit_of_cgroups(root, groups), None);
        write(root, "memory/job/memory.limit_in_bytes", "2048000\n");
        assert_eq!(lowest_limit_of_cgroups(root, groups).map(|limit| limit.bytes), Some(2_048_000));
    }
}
