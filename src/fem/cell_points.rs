//! Quadrature points of a cell with the strains of its nodal displacements.

use super::element::{CellKind, MAX_NODES, map_cell};
use super::material::VOIGT;

/// A quadrature point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    /// Its volume (weight times Jacobian determinant).
    pub(super) volume: f64,
    /// Gradients of the shape functions.
    pub(super) gradient: [[f64; 3]; MAX_NODES],
    /// A third of the correction of each gradient by the mean over the cell.
    pub(super) mean: [[f64; 3]; MAX_NODES],
}

impl Point {
    /// The strain under a unit displacement of a node of the cell.
    pub(super) fn column(&self, node: usize, component: usize) -> [f64; 6] {
        let mut column = [0.0; 6];
        for (s, [i, j]) in VOIGT.into_iter().enumerate() {
            if i == component {
                column[s] = self.gradient[node][j];
            } else if j == component {
                column[s] = self.gradient[node][i];
            }
            if i == j {
                column[s] += self.mean[node][component];
            }
        }
        column
    }
}

/// The quadrature points of a cell, one of a simplex; with `mean`, gradients of dilatation are means over the cell.
pub(super) fn points_of(kind: CellKind, corners: &[[f64; 3]; MAX_NODES], mean: bool) -> Vec<Point> {
    let nodes = kind.num_nodes();
    let mut quadrature = kind.quadrature();
    if kind.is_simplex() {
        quadrature[0].1 = quadrature.iter().map(|p| p.1).sum();
        quadrature.truncate(1);
    }
    let mut points: Vec<Point> = quadrature
        .into_iter()
        .map(|(at, weight)| {
            let (_, gradient, det) = map_cell(kind, &corners[..nodes], at);
            Point {
                volume: weight * det,
                gradient,
                mean: [[0.0; 3]; MAX_NODES],
            }
        })
        .collect();
    if !mean {
        return points;
    }
    let volume: f64 = points.iter().map(|p| p.volume).sum();
    let mut mean = [[0.0; 3]; MAX_NODES];
    for point in &points {
        for (mean, gradient) in mean.iter_mut().zip(&point.gradient) {
            (0..3).for_each(|d| mean[d] += point.volume / volume * gradient[d]);
        }
    }
    for point in &mut points {
        for (a, mean) in mean.iter().enumerate() {
            point.mean[a] = std::array::from_fn(|d| (mean[d] - point.gradient[a][d]) / 3.0);
        }
    }
    points
}
