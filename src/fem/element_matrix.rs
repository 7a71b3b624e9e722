//! The stiffness of one cell.

use super::cell_points::Points;
use super::element::CellKind;
use super::material::Tensor;

/// Room for the points of a cell, and strains and stresses of unit displacements at one of them.
#[derive(Default)]
pub(super) struct Work {
    pub(super) points: Points,
    strains: Vec<[f64; 6]>,
    stresses: Vec<[f64; 6]>,
}

/// Stiffness of one cell, column-major.
#[derive(Debug, Clone, Default)]
pub(super) struct ElementMatrix {
    order: usize,
    values: Vec<f64>,
}

impl ElementMatrix {
    pub(super) fn zeros(order: usize) -> Self {
        Self {
            order,
            values: vec![0.0; order * order],
        }
    }

    pub(super) fn add(&mut self, row: usize, col: usize, value: f64) {
        self.values[col * self.order + row] += value;
    }

    pub(super) fn get(&self, row: usize, col: usize) -> f64 {
        self.values[col * self.order + row]
    }

    /// From the points of `work`.
    pub(super) fn compute(&mut self, kind: CellKind, tensor: &Tensor, work: &mut Work) {
        let dim = kind.dim();
        self.order = dim * kind.num_nodes();
        self.values.clear();
        self.values.resize(self.order * self.order, 0.0);
        for point in work.points.iter() {
            work.strains.clear();
            for share in point.shares {
                work.strains.extend((0..dim).map(|d| share.column(d)));
            }
            let stress = |strain: &[f64; 6]| {
                let mut stress = [0.0; 6];
                for (stress, row) in stress.iter_mut().zip(tensor) {
                    *stress = point.volume * sum_of_products(row, strain);
                }
                stress
            };
            work.stresses.clear();
            work.stresses.extend(work.strains.iter().map(stress));
            for (col, stress) in work.stresses.iter().enumerate() {
                let values = &mut self.values[col * self.order..][..=col];
                for (value, strain) in values.iter_mut().zip(&work.strains) {
                    *value += sum_of_products(strain, stress);
                }
            }
        }
        self.mirror();
    }

    /// Copies one triangle to the other, so that the sum is symmetric to the last bit.
    fn mirror(&mut self) {
        for col in 0..self.order {
            for row in 0..col {
                self.values[row * self.order + col] = self.values[col * self.order + row];
            }
        }
    }
}

/// Written out, as iterators are calls where the optimiser does little.
fn sum_of_products(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]
}
