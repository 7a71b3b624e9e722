use std::cell::{Cell, RefCell};
use std::collections::HashMap;

use crate::ffi::Int;
use crate::handles::{Matrix, Vector};
use crate::world::{PetscError, World};

/// The stiffness matrix A, distributed over all processes. It takes most of the memory of a process and is therefore stored once: Newton
/// steps change it in place, in the rows and columns of contact nodes, whose original entries are kept.
#[derive(Debug)]
pub(crate) struct Stiffness<'w> {
    world: &'w World,
    matrix: Matrix<'w>,
    first: Int,
    near: Near<'w>,
    /// Whether the matrix differs from A.
    changed: Cell<bool>,
    /// For each row of `near`, whether its component is constrained.
    constrained: RefCell<Vec<bool>>,
}

/// The submatrix of A on the components of contact nodes and their neighbours.
#[derive(Debug)]
struct Near<'w> {
    matrix: Matrix<'w>,
    /// The rows of this process as rows of A, and which belong to contact nodes.
    rows: Vec<Int>,
    is_contact: Vec<bool>,
    first: Int,
    /// Where the entries of each row begin, and their columns in A.
    start: Vec<usize>,
    columns: Vec<Int>,
}

impl<'w> Stiffness<'w> {
    /// `rows` are the components of this process at contact nodes (`true`) and at their neighbours (`false`), in increasing order; `first`
    /// is the first component of this process.
    pub(crate) fn new(
        world: &'w World,
        matrix: Matrix<'w>,
        first: usize,
        rows: Vec<(Int, bool)>,
    ) -> Result<Self, PetscError> {
        let (rows, is_contact): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        let near = Near::new(world, &matrix, rows, is_contact)?;
        Ok(Self {
            world,
            matrix,
            first: first as Int,
            changed: Cell::new(false),
            constrained: RefCell::new(vec![false; near.rows.len()]),
            near,
        })
    }

    /// The matrix with the current changes.
    pub(crate) fn now(&self) -> &Matrix<'w> {
        &self.matrix
    }

    /// Undoes the changes and returns A. Collective.
    pub(crate) fn original(&self) -> Result<&Matrix<'w>, PetscError> {
        if self.changed.get() {
            let (mut cols, mut values) = (Vec::new(), Vec::new());
            for (k, row) in self.near.rows.iter().enumerate() {
                self.near.row(k, &mut cols, &mut values)?;
                let columns = &self.near.columns[self.near.start[k]..self.near.start[k + 1]];
                self.matrix.replace_row(*row, columns, &values)?;
            }
            self.matrix.assemble()?;
            self.constrained.borrow_mut().fill(false);
            self.changed.set(false);
        }
        Ok(&self.matrix)
    }

    /// Replaces the rows and columns of `constrained` components of contact nodes by those of a diagonal matrix and adds entries (row,
    /// column, value) at contact nodes. Collective.
    pub(crate) fn change(
        &mut self,
        constrained: &[usize],
        diagonal: f64,
        added: &[(usize, usize, f64)],
    ) -> Result<(), PetscError> {
        self.original()?;
        self.changed.set(true);
        let constrained: Vec<Int> = constrained.iter().map(|k| self.first + *k as Int).collect();
        self.matrix.hold(&constrained, diagonal)?;
        for &(i, j, v) in added {
            let (i, j) = (self.first + i as Int, self.first + j as Int);
            self.matrix.add_row(i, &[j], &[v])?;
        }
        self.matrix.assemble()?;
        let flags = self.constrained.get_mut();
        for row in constrained {
            if let Ok(k) = self.near.rows.binary_search(&row) {
                flags[k] = true;
            }
        }
        Ok(())
    }

    /// `out` ← A u with the original A, whatever changes are in place; x and y are work vectors. Collective.
    pub(crate) fn mul(
        &self,
        u: &[f64],
        x: &mut Vector<'_>,
        y: &mut Vector<'_>,
        out: &mut [f64],
    ) -> Result<(), PetscError> {
        x.set(u)?;
        self.matrix.mul(x, y)?;
        y.get(out)?;
        let (near, constrained) = (&self.near, self.constrained.borrow());
        let at: Vec<usize> = near.rows.iter().map(|row| (row - self.first) as usize).collect();
        let mut all: Vec<f64> = at.iter().map(|k| u[*k]).collect();
        let mut of_held: Vec<f64> = all
            .iter()
            .zip(&*constrained)
            .map(|(u, h)| if *h { *u } else { 0.0 })
            .collect();
        for v in [&mut all, &mut of_held] {
            let mut x = Vector::new(self.world, v.len(), 1)?;
            let mut y = Vector::new(self.world, v.len(), 1)?;
            x.set(v)?;
            near.matrix.mul(&x, &mut y)?;
            y.get(v)?;
        }
        // Rows of contact nodes come from A itself; other rows lack only the columns of constrained components, which are added. (To
        // subtract the terms of the laws instead would lose digits.)
        for (k, at) in at.into_iter().enumerate() {
            match near.is_contact[k] {
                true => out[at] = all[k],
                false => out[at] += of_held[k],
            }
        }
        Ok(())
    }

    /// Appends the row of A of a component of a contact node of this process to lists. Not collective.
    pub(crate) fn row(
        &self,
        component: usize,
        cols: &mut Vec<Int>,
        values: &mut Vec<f64>,
    ) -> Result<(), PetscError> {
        let Ok(k) = self.near.rows.binary_search(&(self.first + component as Int)) else {
            return self.matrix.row(self.first + component as Int, cols, values);
        };
        let (mut numbers, mut own) = (Vec::new(), Vec::new());
        self.near.row(k, &mut numbers, &mut own)?;
        cols.extend_from_slice(&self.near.columns[self.near.start[k]..self.near.start[k + 1]]);
        values.extend_from_slice(&own);
        Ok(())
    }

    /// The current matrix on the components near contact nodes, written into an earlier result if there is one. Collective.
    pub(crate) fn now_near(&self, before: Option<Matrix<'w>>) -> Result<Matrix<'w>, PetscError> {
        match before {
            Some(mut now) => {
                self.matrix.among_again(&self.near.rows, &mut now)?;
                Ok(now)
            }
            None => self.matrix.among(&self.near.rows),
        }
    }

    /// The rows of this process in which the matrix changes.
    pub(crate) fn near(&self) -> &[Int] {
        &self.near.rows
    }
}

impl<'w> Near<'w> {
    fn new(
        world: &'w World,
        a: &Matrix<'w>,
        rows: Vec<Int>,
        is_contact: Vec<bool>,
    ) -> Result<Self, PetscError> {
        let (first, _) = world.offset(rows.len())?;
        let mut near = Self {
            matrix: a.among(&rows)?,
            first: first as Int,
            start: vec![0],
            columns: Vec::new(),
            rows,
            is_contact,
        };
        let mut values = Vec::new();
        for k in 0..near.rows.len() {
            values.clear();
            near.matrix
                .row(near.first + k as Int, &mut near.columns, &mut values)?;
            near.start.push(near.columns.len());
        }
        // From numbers among the rows near contact nodes to rows of A; those of other processes are fetched.
        let own = near.first..near.first + near.rows.len() as Int;
        let mut strangers: Vec<Int> = near
            .columns
            .iter()
            .copied()
            .filter(|c| !own.contains(c))
            .collect();
        strangers.sort_unstable();
        strangers.dedup();
        let numbers: Vec<f64> = near.rows.iter().map(|r| *r as f64).collect();
        let theirs = world.fetch(1, &numbers, &strangers)?;
        let theirs: HashMap<Int, Int> = strangers
            .into_iter()
            .zip(theirs.into_iter().map(|v| v as Int))
            .collect();
        for c in &mut near.columns {
            *c = match own.contains(c) {
                true => near.rows[(*c - near.first) as usize],
                false => theirs[c],
            };
        }
        Ok(near)
    }

    /// The entries of row k of this process, in the order of `columns`; the lists are emptied first. Not collective.
    fn row(&self, k: usize, cols: &mut Vec<Int>, values: &mut Vec<f64>) -> Result<(), PetscError> {
        cols.clear();
        values.clear();
        self.matrix.row(self.first + k as Int, cols, values)
    }
}
