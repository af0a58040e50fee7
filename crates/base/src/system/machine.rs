//! Machine and process identities, for files in folders shared by several machines.

use std::ffi::OsStr;
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
use std::sync::OnceLock;

use nix::errno::Errno;
use nix::sys::signal::kill;
use nix::unistd::{Pid, gethostname};

/// A process, identified uniquely across machines and reboots.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProcessIdentity {
    /// Hash of the host name, boot ID and process ID namespace.
    pub machine: u64,
    /// Process ID, which is only meaningful on `machine`.
    pub process: u32,
}

impl ProcessIdentity {
    /// Returns the identity of this process.
    pub fn current() -> Self {
        Self { machine: machine_hash(), process: std::process::id() }
    }

    /// Whether this process has definitely ended. Always false for processes on other machines, which cannot
    /// be inspected.
    pub fn has_ended(&self) -> bool {
        let Ok(number) = i32::try_from(self.process) else { return false };
        self.machine == machine_hash() && number > 0 && kill(Pid::from_raw(number), None) == Err(Errno::ESRCH)
    }
}

/// Hash that identifies this machine. Containers on one machine differ in host name or process ID namespace.
fn machine_hash() -> u64 {
    static MACHINE: OnceLock<u64> = OnceLock::new();
    *MACHINE.get_or_init(|| {
        let host = gethostname().unwrap_or_default();
        let boot = fs::read("/proc/sys/kernel/random/boot_id").unwrap_or_default();
        let namespace = fs::read_link("/proc/self/ns/pid").unwrap_or_default();
        hash_host_boot_and_namespace(&host, &boot, &namespace)
    })
}

fn hash_host_boot_and_namespace(host: &OsStr, boot: &[u8], namespace: &Path) -> u64 {
    let mut hasher = DefaultHasher::new();
    (host, boot, namespace).hash(&mut hasher);
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;

    #[test]
    fn machines_differ_in_host_boot_or_namespace() {
        let hash = |host: &str, boot: &str, namespace: &str| {
            hash_host_boot_and_namespace(OsStr::new(host), boot.as_bytes(), Path::new(namespace))
        };
        let machine = hash("render1", "a0b1", "pid:[1]");
        assert_eq!(hash("render1", "a0b1", "pid:[1]"), machine, "it does not depend on the process");
        for (host, boot, namespace) in
            [("render2", "a0b1", "pid:[1]"), ("render1", "a0b2", "pid:[1]"), ("render1", "a0b1", "pid:[2]")]
        {
            assert_ne!(hash(host, boot, namespace), machine, "{host} {boot} {namespace}");
        }
    }

    #[test]
    fn only_local_processes_are_known_to_have_ended() {
        let current = ProcessIdentity::current();
        assert!(!current.has_ended());
        let mut child = Command::new("true").spawn().expect("`true` should start");
        let process = child.id();
        child.wait().expect("`true` should end");
        assert!(ProcessIdentity { process, ..current }.has_ended());
        assert!(!ProcessIdentity { process, machine: current.machine ^ 1 }.has_ended());
        for process in [0, u32::MAX] {
            assert!(!ProcessIdentity { process, ..current }.has_ended(), "{process} is not a process ID");
        }
    }
}
