//! Huge pages for large, randomly accessed arrays, if the system supports them.

/// Minimum allocation size in bytes for using huge pages.
const MIN_HUGE_PAGE_BYTES: usize = 1 << 21;

/// Allocates an empty vector with capacity for `count` items, using huge pages if it is large.
pub fn allocate_vec_in_huge_pages<T>(count: usize) -> Vec<T> {
    let items = Vec::with_capacity(count);
    let bytes = count * size_of::<T>();
    if bytes >= MIN_HUGE_PAGE_BYTES {
        request_huge_pages(items.as_ptr() as usize, bytes);
    }
    items
}

#[cfg(target_os = "linux")]
fn request_huge_pages(start: usize, bytes: usize) {
    use nix::sys::mman::{MmapAdvise, madvise};
    const PAGE: usize = 4096;
    let first = start.next_multiple_of(PAGE);
    let length = (start + bytes).saturating_sub(first) / PAGE * PAGE;
    if let Some(address) = std::ptr::NonNull::new(first as *mut std::ffi::c_void) {
        // SAFETY: the pages are inside the allocation, and the advice does not change their contents. Failure
        // is harmless and ignored.
        let _ = unsafe { madvise(address, length, MmapAdvise::MADV_HUGEPAGE) };
    }
}

#[cfg(not(target_os = "linux"))]
fn request_huge_pages(_start: usize, _bytes: usize) {}
