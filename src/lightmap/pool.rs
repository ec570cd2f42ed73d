//! Ranges of slots: taken, and given back to be taken again.

use std::ops::Range;

/// Which slots of a buffer are free. Slots from `end` on were never taken.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pool {
    /// In order, apart from each other, all below `end`.
    free: Vec<Range<u32>>,
    end: u32,
}

impl Pool {
    /// The first free range that fits, or new slots at the end. No slots are an empty range.
    pub(crate) fn take(&mut self, count: u32) -> Range<u32> {
        if count == 0 {
            return 0..0;
        }
        let Some(at) = self.free.iter().position(|f| f.len() as u32 >= count) else {
            let first = self.end;
            self.end += count;
            return first..self.end;
        };
        let first = self.free[at].start;
        self.free[at].start += count;
        if self.free[at].is_empty() {
            self.free.remove(at);
        }
        first..first + count
    }

    /// Gives a range back that was taken as a whole.
    pub(crate) fn give(&mut self, range: Range<u32>) {
        if range.is_empty() {
            return;
        }
        let at = self.free.partition_point(|f| f.start < range.start);
        self.free.insert(at, range);
        for left in [at, at.wrapping_sub(1)] {
            if left < self.free.len()
                && left + 1 < self.free.len()
                && self.free[left].end == self.free[left + 1].start
            {
                self.free[left].end = self.free.remove(left + 1).end;
            }
        }
        if let Some(last) = self.free.pop_if(|last| last.end == self.end) {
            self.end = last.start;
        }
    }

    /// All slots ever taken and not given back lie below.
    pub(crate) fn end(&self) -> u32 {
        self.end
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn ranges_never_overlap_and_everything_comes_back(sizes in proptest::collection::vec((0u32..9, any::<bool>()), 1..60)) {
            let mut pool = Pool::default();
            let mut taken: Vec<Range<u32>> = Vec::new();
            for (size, give) in sizes {
                if give && !taken.is_empty() {
                    pool.give(taken.swap_remove(size as usize % taken.len()));
                }
                let new = pool.take(size);
                prop_assert_eq!(new.len() as u32, size);
                prop_assert!(new.end <= pool.end());
                prop_assert!(taken.iter().all(|t| t.end <= new.start || new.end <= t.start || t.is_empty() || new.is_empty()));
                taken.push(new);
            }
            for range in taken {
                pool.give(range);
            }
            prop_assert_eq!(pool.end(), 0);
            prop_assert!(pool.free.is_empty());
        }
    }
}
