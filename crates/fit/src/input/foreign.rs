//! Files that stand for a mesh without being one.

/// First lines of Git LFS pointers, of today and of the versions before.
const LFS: [&[u8]; 2] = [b"version https://git-lfs.github.com/spec/", b"version https://hawser.github.com/spec/"];

/// Longest pointer that Git LFS makes, bytes.
const LONGEST_POINTER: usize = 1024;

/// Whether a file is a Git LFS pointer, which repositories store in place of large files.
pub(super) fn is_lfs_pointer(bytes: &[u8]) -> bool {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    bytes.len() <= LONGEST_POINTER && LFS.iter().any(|line| bytes.starts_with(line))
}
