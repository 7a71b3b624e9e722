//! Quadrature points of cells with the strains of nodal displacements.

use std::f64::consts::TAU;

use super::element::{CellKind, Jacobian};

/// What a node of a cell contributes to the strain at a quadrature point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Share {
    /// The gradient of its shape function.
    pub(super) gradient: [f64; 3],
    /// In bodies of revolution its shape function over the radius, ∂ε₃₃/∂u₁; elsewhere 0.
    pub(super) hoop: f64,
    /// A third of the correction of the gradient by the mean over the cell.
    pub(super) mean: [f64; 3],
}

impl Share {
    /// The volumetric strain under a unit displacement.
    pub(super) fn dilatation(&self, component: usize) -> f64 {
        self.gradient[component] + if component == 0 { self.hoop } else { 0.0 }
    }

    /// The strain (11, 22, 33, 12, 23, 13) under a unit displacement.
    pub(super) fn column(&self, component: usize) -> [f64; 6] {
        let ([x, y, z], mean) = (self.gradient, self.mean[component]);
        match component {
            0 => [x + mean, mean, mean + self.hoop, y, 0.0, z],
            1 => [mean, y + mean, mean, x, z, 0.0],
            _ => [mean, mean, z + mean, 0.0, y, x],
        }
    }
}

/// A quadrature point: its volume (weight times Jacobian determinant; of the whole ring in a body of revolution) and the nodes of its cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point<'a> {
    pub(super) volume: f64,
    pub(super) shares: &'a [Share],
}

impl Point<'_> {
    /// The volumetric strain under a unit displacement of a node of the cell.
    pub(super) fn dilatation(&self, node: usize, component: usize) -> f64 {
        self.shares[node].dilatation(component)
    }

    /// The strain under a unit displacement of a node of the cell.
    pub(super) fn column(&self, node: usize, component: usize) -> [f64; 6] {
        self.shares[node].column(component)
    }
}

/// Quadrature points of one cell or of many.
#[derive(Debug, Clone, Default)]
pub(super) struct Points {
    volumes: Vec<f64>,
    /// Shares of point k: up to `ends[k]`.
    ends: Vec<usize>,
    shares: Vec<Share>,
}

impl Points {
    /// Those of one cell; see [`add`](Self::add).
    pub(super) fn of(
        kind: CellKind,
        nodes: impl Iterator<Item = [f64; 3]> + Clone,
        mean: bool,
        revolved: bool,
    ) -> Self {
        let mut points = Self::default();
        points.add(kind, nodes, mean, revolved);
        points
    }

    pub(super) fn len(&self) -> usize {
        self.volumes.len()
    }

    pub(super) fn clear(&mut self) {
        self.volumes.clear();
        self.ends.clear();
        self.shares.clear();
    }

    pub(super) fn get(&self, k: usize) -> Point<'_> {
        let begin = if k == 0 { 0 } else { self.ends[k - 1] };
        Point {
            volume: self.volumes[k],
            shares: &self.shares[begin..self.ends[k]],
        }
    }

    /// The volume of a point and the shares of its nodes.
    pub(super) fn get_mut(&mut self, k: usize) -> (&mut f64, &mut [Share]) {
        let begin = if k == 0 { 0 } else { self.ends[k - 1] };
        (&mut self.volumes[k], &mut self.shares[begin..self.ends[k]])
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = Point<'_>> {
        (0..self.len()).map(|k| self.get(k))
    }

    /// Appends the quadrature points of a cell, one where its strains are constant; with `mean`, gradients of dilatation are means over the
    /// cell; `revolved`: a cell of a body of revolution, whose nodes are at their radii.
    pub(super) fn add(
        &mut self,
        kind: CellKind,
        nodes: impl Iterator<Item = [f64; 3]> + Clone,
        mean: bool,
        revolved: bool,
    ) {
        let (first, table) = (self.len(), kind.reference().table());
        let samples = if kind.has_constant_strain() && !revolved {
            std::slice::from_ref(&table.centre)
        } else {
            &table.quadrature
        };
        for sample in samples {
            let map = Jacobian::of(kind.dim(), nodes.clone(), &sample.gradient);
            let shares = sample.value.iter().zip(&sample.gradient);
            let share = |gradient: [f64; 3], hoop: f64| Share {
                gradient: map.gradient(gradient),
                hoop,
                mean: [0.0; 3],
            };
            let volume = sample.weight * map.det;
            if revolved {
                // Points of integration lie inside the cell, and off the axis.
                let radius: f64 = nodes.clone().zip(&sample.value).map(|(x, s)| s * x[0]).sum();
                self.volumes.push(volume * (TAU * radius));
                self.shares.extend(shares.map(|(s, g)| share(*g, s / radius)));
            } else {
                self.volumes.push(volume);
                self.shares.extend(shares.map(|(_, g)| share(*g, 0.0)));
            }
            self.ends.push(self.shares.len());
        }
        if mean {
            self.average(first, kind.num_nodes());
        }
    }

    /// Takes means of the dilatation over the points of the last cell, from `first` on.
    fn average(&mut self, first: usize, nodes: usize) {
        let volumes = &self.volumes[first..];
        let volume: f64 = volumes.iter().sum();
        let begin = self.shares.len() - nodes * volumes.len();
        let shares = &mut self.shares[begin..];
        for a in 0..nodes {
            for d in 0..3 {
                let own = volumes.iter().zip(shares.chunks_exact(nodes));
                let mean: f64 = own.map(|(v, shares)| v / volume * shares[a].dilatation(d)).sum();
                for shares in shares.chunks_exact_mut(nodes) {
                    shares[a].mean[d] = (mean - shares[a].dilatation(d)) / 3.0;
                }
            }
        }
    }
}
