//! Attributes of a file beside its bytes, carried over to the file that replaces it: owner, group, access list,
//! extended attributes, permissions.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
use std::path::Path;

use xattr::FileExt;

#[cfg(target_os = "linux")]
use super::flags::Flags;

/// The access list of POSIX.1e, as Linux keeps it (acl(5)).
const ACCESS_LIST: &str = "system.posix_acl_access";
/// Attributes that belong to the old bytes, or that the system writes by itself.
const NOT_CARRIED: [&str; 4] =
    ["security.capability", "security.evm", "security.ima", "com.apple.provenance"];

/// Rights of the owner alone.
const OWNER: u32 = 0o700;
/// Rights of the owner and of all others, but for the group's.
const NOT_GROUP: u32 = 0o707;

/// Policy for a file that would lose some of its attributes when it is replaced.
#[derive(Clone, Copy)]
pub enum Losses<'a> {
    /// It is replaced, and a sentence reports the losses; the new file never gives anybody more rights.
    Told(&'a dyn Fn(String)),
    /// It is not replaced.
    Refused,
}

/// Attributes of the replaced file.
#[derive(Debug)]
pub(super) struct Attributes {
    uid: u32,
    gid: u32,
    mode: u32,
    #[cfg(target_os = "linux")]
    flags: Flags,
    /// Names and values; the access list comes last, as it may take rights away.
    named: Vec<(OsString, io::Result<Vec<u8>>)>,
}

/// Attributes that the new file lacks, and the permissions that are safe without them.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Carried {
    /// The lost attributes in words, such as `its owner`.
    pub(super) lost: Vec<String>,
    mode: u32,
}

impl Attributes {
    /// Reads the attributes of the file.
    pub(super) fn of(path: &Path, metadata: &fs::Metadata) -> Self {
        let mut named = named(path);
        named.sort_by_key(|(name, _)| name == ACCESS_LIST);
        Self {
            uid: metadata.uid(),
            gid: metadata.gid(),
            mode: metadata.mode() & 0o7777,
            #[cfg(target_os = "linux")]
            flags: Flags::of(path),
            named,
        }
    }

    /// Gives all attributes but the permissions to a new file that only its owner can read so far.
    pub(super) fn carry_over(&self, new: &File) -> Carried {
        let mut carried = Carried { lost: Vec::new(), mode: self.mode };
        // Start while the new file is this user's own.
        #[cfg(target_os = "linux")]
        if !self.flags.carry_over(new) {
            carried.lost.push("its flags (chattr)".to_owned());
        }
        self.carry_owner(new, &mut carried);
        self.carry_named(new, &mut carried);
        carried
    }

    fn carry_owner(&self, new: &File, carried: &mut Carried) {
        let ids = || new.metadata().map(|found| (found.uid(), found.gid()));
        let is_same = |found: io::Result<(u32, u32)>| found.is_ok_and(|found| found == (self.uid, self.gid));
        if is_same(ids()) || fchown(new, Some(self.uid), Some(self.gid)).is_ok() {
            return;
        }
        // Every member of the group can at least keep the group.
        let _ = fchown(new, None, Some(self.gid));
        let (uid, gid) = ids().unwrap_or((u32::MAX, u32::MAX));
        // Set-user-ID and set-group-ID would belong to another user.
        carried.mode &= 0o777;
        if uid != self.uid {
            carried.lost.push("its owner".to_owned());
        }
        if gid != self.gid {
            carried.lost.push("its group".to_owned());
            // Members of the new group had the rights of all others before.
            let of_others = (carried.mode & 0o007) << 3;
            carried.mode &= NOT_GROUP | of_others;
        }
    }

    fn carry_named(&self, new: &File, carried: &mut Carried) {
        for (name, value) in &self.named {
            let is_kept = value.as_ref().is_ok_and(|value| set(new, name, value).is_ok());
            if !is_kept {
                carried.lose(name);
            }
        }
        // A folder gives new files a list of its own: replace or remove it.
        let has_list = self.named.iter().any(|(name, _)| name == ACCESS_LIST);
        let is_inherited = || matches!(new.get_xattr(ACCESS_LIST), Ok(Some(_)));
        if !has_list && is_inherited() && new.remove_xattr(ACCESS_LIST).is_err() {
            carried.lose(OsStr::new(ACCESS_LIST));
        }
    }
}

impl Carried {
    /// Gives the new file its permissions: last, as writing takes some of them away.
    pub(super) fn permit(&self, new: &File) -> io::Result<()> {
        new.set_permissions(fs::Permissions::from_mode(self.mode))
    }

    fn lose(&mut self, name: &OsStr) {
        if name == ACCESS_LIST {
            // The file's group rights were the mask of its list.
            self.mode &= OWNER;
            self.lost.push("its access list".to_owned());
        } else {
            self.lost.push(format!("its attribute {}", name.to_string_lossy()));
        }
    }
}

/// Extended attributes of a file; empty on file systems without them.
fn named(path: &Path) -> Vec<(OsString, io::Result<Vec<u8>>)> {
    let is_carried = |name: &OsString| !NOT_CARRIED.iter().any(|known| name == known);
    let value = |name: OsString| match xattr::get_deref(path, &name) {
        Ok(None) => None,
        Ok(Some(value)) => Some((name, Ok(value))),
        Err(error) => Some((name, Err(error))),
    };
    match xattr::list_deref(path) {
        Ok(names) => names.filter(is_carried).filter_map(value).collect(),
        Err(error) if error.kind() == ErrorKind::Unsupported => Vec::new(),
        Err(error) => vec![(OsString::from("list"), Err(error))],
    }
}

/// Sets an attribute. One that is already there needs no right to be set.
fn set(new: &File, name: &OsStr, value: &[u8]) -> io::Result<()> {
    if new.get_xattr(name).is_ok_and(|now| now.as_deref() == Some(value)) {
        return Ok(());
    }
    new.set_xattr(name, value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attributes(mode: u32, name: &str) -> (Attributes, File) {
        let new = tempfile::tempfile().expect("a file");
        let found = new.metadata().expect("a file");
        let named = vec![(OsString::from(name), Ok(b"value".to_vec()))];
        #[cfg(target_os = "linux")]
        let flags = Flags::of(Path::new("/nowhere"));
        let (uid, gid) = (found.uid(), found.gid());
        let attributes = Attributes {
            uid,
            gid,
            mode,
            #[cfg(target_os = "linux")]
            flags,
            named,
        };
        (attributes, new)
    }

    #[test]
    fn what_cannot_be_kept_is_named() {
        let (attributes, new) = attributes(0o664, "nonsense.of.no.space");
        let carried = attributes.carry_over(&new);
        assert_eq!(
            carried,
            Carried { lost: vec!["its attribute nonsense.of.no.space".to_owned()], mode: 0o664 }
        );
    }

    #[test]
    fn an_access_list_that_is_lost_leaves_rights_to_the_owner_alone() {
        // These bytes are not a valid list.
        let (attributes, new) = attributes(0o664, ACCESS_LIST);
        let carried = attributes.carry_over(&new);
        assert_eq!(carried, Carried { lost: vec!["its access list".to_owned()], mode: 0o600 });
        carried.permit(&new).expect("permitted");
        assert_eq!(new.metadata().expect("a file").mode() & 0o777, 0o600);
    }
}
