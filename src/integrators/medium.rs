//! Which glass a ray is in.

/// The glass objects around a ray, the innermost last. Glass nested deeper than the list is long forgets the outermost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Medium {
    objects: [u32; 4],
    count: u8,
}

impl Medium {
    /// The innermost object.
    pub fn innermost(&self) -> Option<u32> {
        self.count.checked_sub(1).map(|last| self.objects[usize::from(last)])
    }

    /// Whether the ray is inside an object, as far as it knows.
    pub fn is_in(&self, object: u32) -> bool {
        self.objects[..usize::from(self.count)].contains(&object)
    }

    /// After entering an object.
    pub fn entered(mut self, object: u32) -> Self {
        if usize::from(self.count) == self.objects.len() {
            self.objects.rotate_left(1);
            self.count -= 1;
        }
        self.objects[usize::from(self.count)] = object;
        self.count += 1;
        self
    }

    /// After leaving an object; nothing changes for one that it was not in.
    pub fn left(mut self, object: u32) -> Self {
        let count = usize::from(self.count);
        if let Some(place) = self.objects[..count].iter().rposition(|&own| own == object) {
            self.objects[place..count].rotate_left(1);
            self.count -= 1;
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nested_and_overlapping_glass() {
        let air = Medium::default();
        let in_both = air.entered(7).entered(9);
        assert_eq!(in_both.innermost(), Some(9));
        assert_eq!(in_both.left(7).innermost(), Some(9));
        assert_eq!(in_both.left(9).innermost(), Some(7));
        assert_eq!(in_both.left(9).left(7).innermost(), None);
        assert_eq!(air.left(3), air);
        let deep = (0..6).fold(air, Medium::entered);
        assert!(deep.is_in(5) && !deep.is_in(0));
        assert_eq!(deep.innermost(), Some(5));
    }
}
