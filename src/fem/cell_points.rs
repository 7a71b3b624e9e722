//! Quadrature points of a cell with the strains of its nodal displacements.

use std::f64::consts::TAU;

use super::element::{CellKind, MAX_NODES, map_cell};
use super::material::VOIGT;

/// A quadrature point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    /// Its volume (weight times Jacobian determinant; of the whole ring in a body of revolution).
    pub(super) volume: f64,
    /// Gradients of the shape functions.
    pub(super) gradient: [[f64; 3]; MAX_NODES],
    /// In bodies of revolution the shape functions over the radius, ∂ε₃₃/∂u₁; elsewhere 0.
    pub(super) hoop: [f64; MAX_NODES],
    /// A third of the correction of each gradient by the mean over the cell.
    pub(super) mean: [[f64; 3]; MAX_NODES],
}

impl Point {
    /// The volumetric strain under a unit displacement of a node of the cell.
    pub(super) fn dilatation(&self, node: usize, component: usize) -> f64 {
        let hoop = if component == 0 { self.hoop[node] } else { 0.0 };
        self.gradient[node][component] + hoop
    }

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
        if component == 0 {
            column[2] += self.hoop[node];
        }
        column
    }
}

/// The quadrature points of a cell, one of a simplex unless strains vary with the radius; with `mean`, gradients of dilatation are means
/// over the cell; `revolved`: a cell of a body of revolution, whose corners are at their radii.
pub(super) fn points_of(
    kind: CellKind,
    corners: &[[f64; 3]; MAX_NODES],
    mean: bool,
    revolved: bool,
) -> Vec<Point> {
    let nodes = kind.num_nodes();
    let mut quadrature = kind.quadrature();
    if kind.is_simplex() && !revolved {
        quadrature[0].1 = quadrature.iter().map(|p| p.1).sum();
        quadrature.truncate(1);
    }
    let mut points: Vec<Point> = quadrature
        .into_iter()
        .map(|(at, weight)| {
            let (shape, gradient, det) = map_cell(kind, &corners[..nodes], at);
            // Points of integration lie inside the cell, and off the axis.
            let radius: f64 = corners.iter().zip(shape).map(|(c, s)| s * c[0]).sum();
            let (round, hoop) = match revolved {
                true => (TAU * radius, shape.map(|s| s / radius)),
                false => (1.0, [0.0; MAX_NODES]),
            };
            Point {
                volume: weight * det * round,
                gradient,
                hoop,
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
        for (a, mean) in mean.iter_mut().enumerate() {
            (0..3).for_each(|d| mean[d] += point.volume / volume * point.dilatation(a, d));
        }
    }
    for point in &mut points {
        for (a, mean) in mean.iter().enumerate() {
            point.mean[a] = std::array::from_fn(|d| (mean[d] - point.dilatation(a, d)) / 3.0);
        }
    }
    points
}
