use std::ops::Range;

use super::PiecewiseSmooth;

/// Positions of each site's test functions in the vector of all test functions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TestLayout {
    offsets: Vec<usize>,
}

impl TestLayout {
    /// The layout of a map's test functions.
    #[must_use]
    pub fn new<P: PiecewiseSmooth + ?Sized>(map: &P) -> Self {
        let mut offsets = Vec::with_capacity(map.num_sites() + 1);
        offsets.push(0);
        let mut sum = 0;
        for site in 0..map.num_sites() {
            sum += map.num_tests(site);
            offsets.push(sum);
        }
        Self { offsets }
    }

    /// Whether this is the layout of `map`.
    #[must_use]
    pub fn describes<P: PiecewiseSmooth + ?Sized>(&self, map: &P) -> bool {
        self.num_sites() == map.num_sites()
            && (0..self.num_sites()).all(|s| self.range(s).len() == map.num_tests(s))
    }

    /// Number of sites.
    #[must_use]
    pub fn num_sites(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Number of test functions in all.
    #[must_use]
    pub fn total(&self) -> usize {
        self.offsets[self.offsets.len() - 1]
    }

    /// Positions of the test functions of a site.
    ///
    /// # Panics
    /// For a site beyond [`num_sites`](Self::num_sites).
    #[must_use]
    #[inline]
    pub fn range(&self, site: usize) -> Range<usize> {
        self.offsets[site]..self.offsets[site + 1]
    }

    /// Site and number within the site of the test function at a position.
    #[must_use]
    pub fn locate(&self, index: usize) -> (usize, usize) {
        let site = self.offsets.partition_point(|&o| o <= index) - 1;
        (site, index - self.offsets[site])
    }
}
