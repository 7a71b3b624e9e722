//! Variables by name.

use std::ops::Range;

use super::ComplementarityError;
use crate::InputError;
use crate::words::LISTED;

/// The variables of a problem in named blocks, each with its bounds, so that models need no arithmetic with indices.
///
/// The order is that in which blocks are added. Functions read and write their blocks by the [`Block`]s that [`add`](Self::add) returns;
/// results are read by name. Where F has as many values as variables, the values have the same blocks. A parameter comes after all blocks
/// and belongs to none.
///
/// ```
/// use semismooth::complementarity::{Mcp, McpSolver, Variables, WithJacobian};
/// use semismooth::sparse::Matrix;
/// // 4 drivers choose between two routes that take 10 f and 15 + f minutes with f drivers: a route is used only where it takes the
/// // least time.
/// let mut variables = Variables::new();
/// let flow = variables.add("flow", 2, 0.0, f64::INFINITY)?;
/// let least = variables.add("least time", 1, f64::NEG_INFINITY, f64::INFINITY)?;
/// let traffic = WithJacobian::new(
///     variables.len(),
///     |x: &[f64], out: &mut [f64]| {
///         let (f, time) = (flow.of(x), least.of(x)[0]);
///         flow.of_mut(out).copy_from_slice(&[10.0 * f[0] - time, 15.0 + f[1] - time]);
///         least.of_mut(out)[0] = f[0] + f[1] - 4.0;
///     },
///     |_: &[f64], jac: &mut Matrix| {
///         for (k, slope) in [10.0, 1.0].into_iter().enumerate() {
///             jac.add(flow.index(k), flow.index(k), slope);
///             jac.add(flow.index(k), least.index(0), -1.0);
///             jac.add(least.index(0), flow.index(k), 1.0);
///         }
///     },
/// );
/// let problem = Mcp::of_variables(traffic, &variables)?;
/// let mut x = vec![1.0; variables.len()];
/// assert!(McpSolver::default().solve(&problem, &mut x)?.is_solved());
/// let x = variables.view(&x)?;
/// let (flow, time) = (x.block("flow")?, x.block("least time")?[0]);
/// assert!((flow[0] - 19.0 / 11.0).abs() < 1e-9 && (time - 190.0 / 11.0).abs() < 1e-9);
/// assert_eq!(variables.name(1).as_deref(), Some("flow[1]"));
/// # Ok::<(), semismooth::complementarity::ComplementarityError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
#[must_use]
pub struct Variables {
    blocks: Vec<(String, Block)>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

/// A block of [`Variables`]: consecutive components, stored as a position and a length and therefore `Copy`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Block {
    first: usize,
    len: usize,
}

impl Block {
    /// Number of components.
    #[must_use]
    pub const fn len(self) -> usize {
        self.len
    }

    /// Always false: a block has at least one component.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.len == 0
    }

    /// The positions of the block among all variables.
    #[must_use]
    pub const fn range(self) -> Range<usize> {
        self.first..self.first + self.len
    }

    /// The position of its component k, counted from 0, among all variables.
    #[must_use]
    pub const fn index(self, k: usize) -> usize {
        self.first + k
    }

    /// The components of the block in a vector of all variables (or values).
    ///
    /// # Panics
    /// Where the vector ends before the block does.
    #[must_use]
    pub fn of<T>(self, x: &[T]) -> &[T] {
        &x[self.range()]
    }

    /// The same, mutably.
    ///
    /// # Panics
    /// Where the vector ends before the block does.
    #[must_use]
    pub fn of_mut<T>(self, x: &mut [T]) -> &mut [T] {
        &mut x[self.range()]
    }
}

impl Variables {
    /// No variables yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a block of `len` variables with the same bounds, −∞ and +∞ where there is none. [`set_bounds`](Self::set_bounds) gives each its
    /// own.
    ///
    /// # Errors
    /// A name that exists already, no variables, bounds that are NaN or leave no value.
    pub fn add(
        &mut self,
        name: impl Into<String>,
        len: usize,
        lower: f64,
        upper: f64,
    ) -> Result<Block, ComplementarityError> {
        let name = name.into();
        if len == 0 {
            return Err(ComplementarityError::Empty);
        }
        if self.find(&name).is_some() {
            return Err(ComplementarityError::BlockTwice { name });
        }
        super::problem::check_bounds(&[lower], &[upper], 1)?;
        let first = self.len();
        let block = Block { first, len };
        self.blocks.push((name, block));
        self.lower.resize(first + len, lower);
        self.upper.resize(first + len, upper);
        Ok(block)
    }

    /// Replaces the bounds of a block, one a variable.
    ///
    /// # Errors
    /// A name that does not exist, wrong lengths, bounds that are NaN or leave no value; the bounds are then unchanged.
    pub fn set_bounds(
        &mut self,
        name: &str,
        lower: &[f64],
        upper: &[f64],
    ) -> Result<(), ComplementarityError> {
        let block = self.block(name)?;
        super::problem::check_bounds(lower, upper, block.len)?;
        block.of_mut(&mut self.lower).copy_from_slice(lower);
        block.of_mut(&mut self.upper).copy_from_slice(upper);
        Ok(())
    }

    /// Number of variables.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lower.len()
    }

    /// Whether there are none yet.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// The lower bounds of all variables.
    #[must_use]
    pub fn lower(&self) -> &[f64] {
        &self.lower
    }

    /// The upper bounds of all variables.
    #[must_use]
    pub fn upper(&self) -> &[f64] {
        &self.upper
    }

    /// The blocks by name, in their order.
    pub fn blocks(&self) -> impl Iterator<Item = (&str, Block)> {
        self.blocks.iter().map(|(name, block)| (name.as_str(), *block))
    }

    /// The block of a name.
    ///
    /// # Errors
    /// A name that does not exist.
    pub fn block(&self, name: &str) -> Result<Block, ComplementarityError> {
        self.find(name).ok_or_else(|| {
            let names = self.blocks().take(LISTED).map(|(name, _)| format!("\"{name}\""));
            let mut known = names.collect::<Vec<_>>().join(", ");
            match self.blocks.len().saturating_sub(LISTED) {
                0 if known.is_empty() => "none".clone_into(&mut known),
                0 => {}
                more => known += &format!(" and {more} more"),
            }
            ComplementarityError::NoSuchBlock {
                name: name.to_owned(),
                known,
            }
        })
    }

    fn find(&self, name: &str) -> Option<Block> {
        self.blocks()
            .find(|(own, _)| *own == name)
            .map(|(_, block)| block)
    }

    /// The name of the variable at a position: that of its block, followed by its number in the block, from 0, unless it is the only one;
    /// `None` beyond the last.
    #[must_use]
    pub fn name(&self, index: usize) -> Option<String> {
        let behind = self.blocks.partition_point(|(_, b)| b.range().end <= index);
        let (name, block) = self.blocks.get(behind)?;
        Some(match block.len {
            1 => name.clone(),
            _ => format!("{name}[{}]", index - block.first),
        })
    }

    /// A view of a vector of all variables, with or without a parameter after them, by the names of blocks.
    ///
    /// # Errors
    /// Another length.
    pub fn view<'a, T>(&'a self, x: &'a [T]) -> Result<VariablesView<'a, T>, ComplementarityError> {
        let n = self.len();
        if x.len() != n && x.len() != n + 1 {
            return Err(ComplementarityError::Input(InputError::Length {
                what: "the vector of all variables",
                expected: n,
                found: x.len(),
            }));
        }
        Ok(VariablesView { variables: self, x })
    }
}

/// A vector read by the names of its blocks, made by [`Variables::view`].
#[derive(Debug, Clone, Copy)]
pub struct VariablesView<'a, T> {
    variables: &'a Variables,
    x: &'a [T],
}

impl<'a, T> VariablesView<'a, T> {
    /// The components of a block.
    ///
    /// # Errors
    /// A name that does not exist.
    pub fn block(&self, name: &str) -> Result<&'a [T], ComplementarityError> {
        Ok(self.variables.block(name)?.of(self.x))
    }
}
