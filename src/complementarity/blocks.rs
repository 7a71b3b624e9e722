use crate::judge::Columns;

/// The unknowns that entries of a matrix connect with each other, block by block.
#[derive(Debug, Clone, Default)]
pub(super) struct Blocks {
    /// The first member of the block of each unknown; empty where there is one block.
    block: Vec<usize>,
}

impl Blocks {
    /// Finds the blocks of a square matrix of order n.
    pub(super) fn find(&mut self, matrix: Columns<'_>, n: usize) {
        self.block.clear();
        self.block.extend(0..n);
        let mut left = n;
        for j in 0..n {
            if left <= 1 {
                // Large problems are usually one block, and need the memory elsewhere; small ones are solved repeatedly and keep it.
                self.block.clear();
                self.block.shrink_to(1 << 10);
                return;
            }
            matrix.each(j, |i, v| {
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

    /// The first member of the block of an unknown.
    pub(super) fn of(&self, i: usize) -> usize {
        self.block.get(i).copied().unwrap_or(0)
    }

    /// The largest |value| of each block, at its first member.
    pub(super) fn largest(&self, values: impl Iterator<Item = f64>, largest: &mut Vec<f64>) {
        largest.clear();
        largest.resize(self.block.len().max(1), 0.0);
        for (i, value) in values.enumerate() {
            let b = self.of(i);
            largest[b] = largest[b].max(value.abs());
        }
    }
}
