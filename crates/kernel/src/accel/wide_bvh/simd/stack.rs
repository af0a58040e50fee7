//! Traversal stack that is not cleared for every ray.

use std::mem::MaybeUninit;

/// Stack size. The binary tree has fewer than 96 levels, each with at most seven pending children.
const STACK_SIZE: usize = 96 * 7;

/// A stack that is large enough for the deepest tree.
pub struct Stack<T> {
    entries: [MaybeUninit<T>; STACK_SIZE],
    size: usize,
}

impl<T: Copy> Stack<T> {
    /// Creates an empty stack.
    #[inline(always)]
    pub fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; STACK_SIZE], size: 0 }
    }

    /// Pushes an entry.
    #[inline(always)]
    pub fn push(&mut self, entry: T) {
        self.entries[self.size].write(entry);
        self.size += 1;
    }

    /// Branchlessly pushes an entry if `is_wanted`.
    #[inline(always)]
    pub fn push_if(&mut self, entry: T, is_wanted: bool) {
        self.entries[self.size].write(entry);
        self.size += usize::from(is_wanted);
    }

    /// Pops the top entry.
    #[inline(always)]
    pub fn pop(&mut self) -> Option<T> {
        self.size = self.size.checked_sub(1)?;
        // SAFETY: entries below `size` before the decrement were written by `push`.
        Some(unsafe { self.entries[self.size].assume_init() })
    }

    /// The entry that is `back` positions below the top.
    #[inline(always)]
    fn nth_from_top(&mut self, back: usize) -> &mut T {
        debug_assert!(back < self.size);
        // SAFETY: as in `pop`.
        unsafe { self.entries[self.size - 1 - back].assume_init_mut() }
    }
}

/// Sort key of a child: the bits of its entry distance, followed by the encoded child. Bits of nonnegative
/// floats sort like their values.
#[inline(always)]
pub fn sort_key(entry: f32, code: u32) -> u64 {
    u64::from(entry.to_bits()) << 32 | u64::from(code)
}

/// Entry distance stored in a key.
#[inline(always)]
pub fn entry_distance_from_key(key: u64) -> f32 {
    f32::from_bits((key >> 32) as u32)
}

impl Stack<u64> {
    /// Inserts a key into the topmost `count` keys, which are sorted with the nearest on top.
    #[inline(always)]
    pub fn insert_key_into_sorted_top(&mut self, key: u64, count: usize) {
        self.push(key);
        let mut back = 0;
        while back < count && *self.nth_from_top(back + 1) < *self.nth_from_top(back) {
            let lower = *self.nth_from_top(back + 1);
            *self.nth_from_top(back + 1) = std::mem::replace(self.nth_from_top(back), lower);
            back += 1;
        }
    }
}
