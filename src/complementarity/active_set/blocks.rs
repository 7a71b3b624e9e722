use crate::sparse::Matrix;

/// The unknowns that entries of a matrix connect with each other, block by block.
#[derive(Debug, Clone, Default)]
pub(super) struct Blocks {
    /// A member of the block of each unknown, the same one for all.
    block: Vec<usize>,
    largest: Vec<f64>,
}

impl Blocks {
    /// Finds the blocks of a square matrix.
    pub(super) fn find(&mut self, matrix: &Matrix) {
        let n = matrix.nrows();
        self.block.clear();
        self.block.extend(0..n);
        self.largest.resize(n, 0.0);
        let mut left = n;
        for (i, j, v) in matrix.triplets() {
            if left <= 1 {
                break;
            }
            if i == j || v == 0.0 {
                continue;
            }
            let (a, b) = (self.root(i), self.root(j));
            if a != b {
                self.block[a.max(b)] = a.min(b);
                left -= 1;
            }
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
    pub(super) fn sizes(&mut self, z: &[f64], sizes: &mut [f64]) {
        self.largest.fill(0.0);
        for (z, &b) in z.iter().zip(&self.block) {
            self.largest[b] = self.largest[b].max(z.abs());
        }
        for (size, &b) in sizes.iter_mut().zip(&self.block) {
            *size = self.largest[b];
        }
    }
}
