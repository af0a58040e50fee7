//! Copies attributes to a replacement file: owner, group, access list, extended attributes and permissions.

use std::ffi::{OsStr, OsString};
use std::fmt::{self, Display, Formatter};
use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};

use xattr::FileExt;

#[cfg(target_os = "linux")]
use super::flags::InodeFlags;

/// POSIX.1e access control list, as stored by Linux (acl(5)).
const ACCESS_LIST: &str = "system.posix_acl_access";
/// Attributes that describe the old content or are managed by the system.
const EXCLUDED_ATTRIBUTES: [&str; 4] =
    ["security.capability", "security.evm", "security.ima", "com.apple.provenance"];

/// Permission bits for the owner.
const OWNER_BITS: u32 = 0o700;
/// Permission bits for everyone except the group.
const NON_GROUP_BITS: u32 = 0o707;

/// Policy for attributes that would be lost by replacing a file.
#[derive(Clone, Copy)]
pub enum AttributeLossPolicy<'a> {
    /// Replace the file and report the losses. The new file never grants additional permissions.
    Report(&'a dyn Fn(WriteWarning)),
    /// Do not replace the file.
    Refuse,
}

/// A problem with a file that has been written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WriteWarning {
    /// Attributes of the replaced file could not be kept.
    AttributesLost {
        /// Path of the file.
        path: PathBuf,
        /// The attributes.
        lost: Vec<String>,
    },
    /// The folder could not be synchronized.
    NotSynchronized {
        /// Path of the file.
        path: PathBuf,
        /// Description of the system error.
        why: String,
    },
}

impl Display for WriteWarning {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::AttributesLost { path, lost } => {
                write!(f, "{}: {} could not be kept", path.display(), lost.join(" and "))
            }
            Self::NotSynchronized { path, why } => {
                let path = path.display();
                write!(
                    f,
                    "{path}: written, but a power failure may undo this: cannot synchronize its folder: {why}"
                )
            }
        }
    }
}

/// Attributes of the file to replace.
#[derive(Debug)]
pub(super) struct FileAttributes {
    uid: u32,
    gid: u32,
    mode: u32,
    #[cfg(target_os = "linux")]
    flags: InodeFlags,
    /// Names and values of extended attributes. The access list is last because setting it may remove
    /// permissions.
    named: Vec<(OsString, io::Result<Vec<u8>>)>,
}

/// Attributes that could not be copied, and the permissions that are safe without them.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct AttributeCopyOutcome {
    /// Descriptions of the lost attributes, such as `its owner`.
    pub(super) lost: Vec<String>,
    mode: u32,
}

impl FileAttributes {
    /// Reads the attributes of a file.
    pub(super) fn read(path: &Path, metadata: &fs::Metadata) -> Self {
        let mut named = extended_attributes(path);
        named.sort_by_key(|(name, _)| name == ACCESS_LIST);
        Self {
            uid: metadata.uid(),
            gid: metadata.gid(),
            mode: metadata.mode() & 0o7777,
            #[cfg(target_os = "linux")]
            flags: InodeFlags::read(path),
            named,
        }
    }

    /// Applies all attributes except the permissions to a new file. Until the permissions are applied, the
    /// file must be accessible only to its owner.
    pub(super) fn apply_except_permissions(&self, new: &File) -> AttributeCopyOutcome {
        let mut carried = AttributeCopyOutcome { lost: Vec::new(), mode: self.mode };
        // Set the flags before changing the owner, because only the owner may set them.
        #[cfg(target_os = "linux")]
        if !self.flags.try_apply_to_file(new) {
            carried.lost.push("its flags (chattr)".to_owned());
        }
        self.copy_owner(new, &mut carried);
        self.copy_extended_attributes(new, &mut carried);
        carried
    }

    fn copy_owner(&self, new: &File, carried: &mut AttributeCopyOutcome) {
        let ids = || new.metadata().map(|found| (found.uid(), found.gid()));
        let is_same = |found: io::Result<(u32, u32)>| found.is_ok_and(|found| found == (self.uid, self.gid));
        if is_same(ids()) || fchown(new, Some(self.uid), Some(self.gid)).is_ok() {
            return;
        }
        // Users may change a file's group to any group they belong to.
        let _ = fchown(new, None, Some(self.gid));
        let (uid, gid) = ids().unwrap_or((u32::MAX, u32::MAX));
        // Drop the set-user-ID and set-group-ID bits, which would apply to a different user or group.
        carried.mode &= 0o777;
        if uid != self.uid {
            carried.lost.push("its owner".to_owned());
        }
        if gid != self.gid {
            carried.lost.push("its group".to_owned());
            // So far, members of the new group had only the permissions for others. Do not grant them more.
            let others_bits = (carried.mode & 0o007) << 3;
            carried.mode &= NON_GROUP_BITS | others_bits;
        }
    }

    fn copy_extended_attributes(&self, new: &File, carried: &mut AttributeCopyOutcome) {
        for (name, value) in &self.named {
            let is_kept = value.as_ref().is_ok_and(|value| set_attribute(new, name, value).is_ok());
            if !is_kept {
                carried.mark_lost(name);
            }
        }
        // New files may inherit an access list from their folder. Remove it if the old file had none.
        let has_list = self.named.iter().any(|(name, _)| name == ACCESS_LIST);
        let is_inherited = || matches!(new.get_xattr(ACCESS_LIST), Ok(Some(_)));
        if !has_list && is_inherited() && new.remove_xattr(ACCESS_LIST).is_err() {
            carried.mark_lost(OsStr::new(ACCESS_LIST));
        }
    }
}

impl AttributeCopyOutcome {
    /// Applies the permissions. Must be called last, because writing clears some of them.
    pub(super) fn apply_permissions(&self, new: &File) -> io::Result<()> {
        new.set_permissions(fs::Permissions::from_mode(self.mode))
    }

    fn mark_lost(&mut self, name: &OsStr) {
        if name == ACCESS_LIST {
            // The group bits are the mask of the access list. Without the list, they would grant permissions
            // to the group.
            self.mode &= OWNER_BITS;
            self.lost.push("its access list".to_owned());
        } else {
            self.lost.push(format!("its attribute {}", name.to_string_lossy()));
        }
    }
}

/// Reads a file's extended attributes. Returns an empty list if the file system does not support them.
fn extended_attributes(path: &Path) -> Vec<(OsString, io::Result<Vec<u8>>)> {
    let is_carried = |name: &OsString| !EXCLUDED_ATTRIBUTES.iter().any(|known| name == known);
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

/// Sets an attribute unless it already has this value, because setting it may require special permissions.
fn set_attribute(new: &File, name: &OsStr, value: &[u8]) -> io::Result<()> {
    if new.get_xattr(name).is_ok_and(|now| now.as_deref() == Some(value)) {
        return Ok(());
    }
    new.set_xattr(name, value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attributes(mode: u32, name: &str) -> (FileAttributes, File) {
        let new = tempfile::tempfile().expect("a file");
        let found = new.metadata().expect("a file");
        let named = vec![(OsString::from(name), Ok(b"value".to_vec()))];
        #[cfg(target_os = "linux")]
        let flags = InodeFlags::read(Path::new("/nowhere"));
        let (uid, gid) = (found.uid(), found.gid());
        let attributes = FileAttributes {
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
    fn lost_attributes_are_reported() {
        let (attributes, new) = attributes(0o664, "nonsense.of.no.space");
        let carried = attributes.apply_except_permissions(&new);
        assert_eq!(
            carried,
            AttributeCopyOutcome { lost: vec!["its attribute nonsense.of.no.space".to_owned()], mode: 0o664 }
        );
    }

    #[test]
    fn losing_the_access_list_revokes_group_access() {
        // The value is not a valid list.
        let (attributes, new) = attributes(0o664, ACCESS_LIST);
        let carried = attributes.apply_except_permissions(&new);
        assert_eq!(carried, AttributeCopyOutcome { lost: vec!["its access list".to_owned()], mode: 0o600 });
        carried.apply_permissions(&new).expect("permitted");
        assert_eq!(new.metadata().expect("a file").mode() & 0o777, 0o600);
    }
}
