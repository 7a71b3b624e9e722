use std::fmt;

use super::memory::{PatternMemory, check_finite};
use super::{LinearError, Preconditioner};
use crate::InputError;
use crate::input::check_length;
use crate::sparse::{Matrix, MatrixRef, Pattern};

/// A preconditioner for the diagonal blocks of a matrix: each block of consecutive unknowns has one of its own.
///
/// ```
/// use semismooth::linear::{BlockDiagonal, IncompleteLu, Multigrid, Preconditioner};
/// use semismooth::sparse::Matrix;
/// let a = Matrix::from_rows(&[[2.0, -1.0, 0.1], [-1.0, 2.0, 0.2], [0.1, 0.2, 4.0]])?;
/// let mut p = BlockDiagonal::new()
///     .with_block(2, IncompleteLu::default())
///     .with_block(1, Multigrid::algebraic());
/// p.prepare(a.as_ref())?;
/// let mut b = [1.0, 1.0, 4.0];
/// p.apply(&mut b)?;
/// assert!(b.iter().all(|x| (x - 1.0).abs() < 1e-14));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Default)]
pub struct BlockDiagonal {
    blocks: Vec<Block>,
    pattern: PatternMemory,
}

struct Block {
    order: usize,
    preconditioner: Box<dyn Preconditioner + Send + Sync>,
    matrix: Option<Matrix>,
    /// Where the values of the block are in the whole matrix.
    slots: Vec<usize>,
}

impl BlockDiagonal {
    /// No blocks yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a block of so many unknowns after the existing ones.
    #[must_use]
    pub fn with_block(
        mut self,
        order: usize,
        preconditioner: impl Preconditioner + Send + Sync + 'static,
    ) -> Self {
        self.blocks.push(Block {
            order,
            preconditioner: Box::new(preconditioner),
            matrix: None,
            slots: Vec::new(),
        });
        self
    }

    /// Number of unknowns of all blocks.
    #[must_use]
    pub fn order(&self) -> usize {
        self.blocks.iter().map(|b| b.order).sum()
    }
}

impl fmt::Debug for BlockDiagonal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let orders: Vec<_> = self.blocks.iter().map(|b| b.order).collect();
        f.debug_struct("BlockDiagonal")
            .field("orders", &orders)
            .finish_non_exhaustive()
    }
}

impl Block {
    /// The part of a pattern in rows and columns from `first` on.
    fn cut(&mut self, a: MatrixRef<'_>, first: usize) -> Result<(), InputError> {
        let last = first + self.order;
        let (mut start, mut rows) = (vec![0], Vec::new());
        self.slots.clear();
        for j in first..last {
            for e in a.pattern.col_ptr[j]..a.pattern.col_ptr[j + 1] {
                let i = a.pattern.row_idx[e];
                if (first..last).contains(&i) {
                    rows.push(i - first);
                    self.slots.push(e);
                }
            }
            start.push(rows.len());
        }
        self.matrix = Some(Matrix::zeros(Pattern::from_csc(
            self.order, self.order, start, rows,
        )?));
        Ok(())
    }
}

impl Preconditioner for BlockDiagonal {
    fn prepare(&mut self, a: MatrixRef<'_>) -> Result<(), LinearError> {
        let anew = self.pattern.learn(a.pattern)?;
        self.pattern.check(&a)?;
        check_finite(a.values, "the matrix")?;
        let order = self.order();
        check_length("the sum of the blocks", order, a.pattern.nrows)?;
        let mut first = 0;
        for block in &mut self.blocks {
            if anew || block.matrix.is_none() {
                block.cut(a, first)?;
            }
            first += block.order;
            if let Some(matrix) = &mut block.matrix {
                for (v, &e) in matrix.values_mut().iter_mut().zip(&block.slots) {
                    *v = a.values[e];
                }
                block.preconditioner.prepare(matrix.as_ref())?;
            }
        }
        Ok(())
    }

    fn apply(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        let order = self.order();
        check_length("the right-hand side", b.len(), order)?;
        let mut rest = b;
        for block in &mut self.blocks {
            let (head, tail) = rest.split_at_mut(block.order);
            block.preconditioner.apply(head)?;
            rest = tail;
        }
        Ok(())
    }
}
