use crate::complementarity::columns::BoxLcp;

/// The unknowns that entries of a matrix connect with each other, block by block.
#[derive(Debug, Clone, Default)]
pub(super) struct Blocks {
    /// The first member of the block of each unknown.
    block: Vec<usize>,
}

impl Blocks {
    /// Finds the blocks of a problem.
    pub(super) fn find(&mut self, lcp: BoxLcp<'_>) {
        let n = lcp.len();
        self.block.clear();
        self.block.extend(0..n);
        let mut left = n;
        for j in 0..n {
            if left <= 1 {
                break;
            }
            lcp.matrix.each(j, |i, v| {
                if i != j && v != 0.0 {
                    let (a, b) = (self.root(i), self.root(j));
                    if a != b {
                        self.block[a.max(b)] = a.min(b);
                        left -= 1;
                    }
                }
            });
        }
        for i in 0..n {
            self.block[i] = self.root(i);
        }
    }

    fn root(&mut self, mut i: usize) -> usize {
        while self.block[i] != i {
            // Path halving.
            self.block[i] = self.block[self.block[i]];
            i = self.block[i];
        }
        i
    }

    /// The largest |z| in the block of each unknown.
    pub(super) fn sizes(&self, z: &[f64], sizes: &mut [f64]) {
        sizes.fill(0.0);
        for (z, &b) in z.iter().zip(&self.block) {
            sizes[b] = sizes[b].max(z.abs());
        }
        for (i, &b) in self.block.iter().enumerate() {
            sizes[i] = sizes[b];
        }
    }
}
