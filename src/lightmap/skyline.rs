//! Packs rectangles into a page, bottom-left along a skyline (Jylänki 2010, "A Thousand Ways to Pack the Bin").

use glam::UVec2;

/// A page that fills up.
pub(crate) struct Skyline {
    width: u32,
    height: u32,
    /// Steps from left to right: where each begins, and how high it is filled.
    steps: Vec<(u32, u32)>,
}

impl Skyline {
    /// An empty page.
    pub fn new(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            steps: vec![(0, 0)],
        }
    }

    /// Finds the place with the lowest top edge (then the leftmost) and fills it; none if `size` fits nowhere.
    pub fn insert(&mut self, size: UVec2) -> Option<UVec2> {
        let best = (0..self.steps.len())
            .filter_map(|i| Some((self.rest(i, size)? + size.y, self.steps[i].0, i)))
            .min()?;
        let (top, x, first) = best;
        let end = x + size.x;
        let mut last = first;
        while last + 1 < self.steps.len() && self.steps[last + 1].0 <= end {
            last += 1;
        }
        let mut replaced = vec![(x, top)];
        if end < self.width && self.steps[last].0 < end {
            replaced.push((end, self.steps[last].1));
        } else if end < self.width {
            replaced.push(self.steps[last]);
        }
        self.steps.splice(first..=last, replaced);
        self.steps.dedup_by(|b, a| a.1 == b.1);
        Some(UVec2::new(x, top - size.y))
    }

    /// How high a rectangle comes to rest whose left edge is that of step `first`.
    fn rest(&self, first: usize, size: UVec2) -> Option<u32> {
        let x = self.steps[first].0;
        if size.x > self.width - x {
            return None;
        }
        let under = self.steps[first..].iter().take_while(|s| s.0 < x + size.x);
        let y = under.map(|s| s.1).max()?;
        (size.y <= self.height - y).then_some(y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn fills_a_page_to_the_brim_and_no_further() {
        let mut page = Skyline::new(8, 8);
        let places: Vec<_> = (0..4).map(|_| page.insert(UVec2::splat(4))).collect();
        assert_eq!(
            places,
            [(0, 0), (4, 0), (0, 4), (4, 4)].map(|(x, y)| Some(UVec2::new(x, y)))
        );
        assert_eq!(page.insert(UVec2::ONE), None);
    }

    proptest! {
        #[test]
        fn never_overlaps(sizes in prop::collection::vec((1u32..20, 1u32..20), 1..60)) {
            let mut page = Skyline::new(64, 64);
            let mut filled = vec![false; 64 * 64];
            for (w, h) in sizes {
                let Some(place) = page.insert(UVec2::new(w, h)) else { continue };
                prop_assert!(place.x + w <= 64 && place.y + h <= 64);
                for y in place.y..place.y + h {
                    for x in place.x..place.x + w {
                        prop_assert!(!std::mem::replace(&mut filled[(y * 64 + x) as usize], true));
                    }
                }
            }
        }
    }
}
