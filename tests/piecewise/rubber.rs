//! A friction-like map with optional errors.

use std::borrow::Cow;

use semismooth::piecewise::{Derivatives, Description, Facet, PiecewiseSmooth, Selection, Structure};
use semismooth::sparse::{Matrix, Pattern};

/// A deliberate error in [`Rubber`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Fault {
    None,
    JacobianSign,
    Jump,
    Overlap,
    Gap,
    Pattern,
    Gradient,
    Rates,
    Rows,
    Affine,
    Nan,
    Facet,
    PatternShape,
    SiteJacobian,
    SiteExtra,
}

/// Two rubber blocks on a table, λᵢ = P_[−g, g](λᵢ + r uᵢ) with the bound g = α: sliding left, sticking, sliding right; undefined for α <
/// 0. Unknowns u₁, u₂, λ₁, λ₂, α.
pub(crate) struct Rubber(pub(crate) Fault);

pub(crate) const R: f64 = 1.5;

impl PiecewiseSmooth for Rubber {
    fn num_vars(&self) -> usize {
        5
    }
    fn num_residuals(&self) -> usize {
        4
    }
    fn num_sites(&self) -> usize {
        2
    }
    fn num_pieces(&self, _: usize) -> usize {
        3
    }
    fn num_tests(&self, _: usize) -> usize {
        3
    }
    fn cell(&self, _: usize, piece: usize) -> &[Facet] {
        const WALL: Facet = Facet::positive(2).wall();
        const CELLS: [&[Facet]; 3] = [
            &[Facet::negative(1), WALL],
            &[Facet::negative(0), Facet::positive(1), WALL],
            &[Facet::positive(0), WALL],
        ];
        const OVERLAP: &[Facet] = &[WALL];
        const GAP: &[Facet] = &[Facet::positive(0), Facet::positive(1), WALL];
        const FACET: &[Facet] = &[Facet::positive(7)];
        match (self.0, piece) {
            (Fault::Overlap, 2) => OVERLAP,
            (Fault::Gap, 1) => GAP,
            (Fault::Facet, 2) => FACET,
            _ => CELLS[piece],
        }
    }
    fn is_piecewise_affine(&self) -> bool {
        self.0 == Fault::Affine
    }
    fn pattern(&self) -> Pattern {
        if self.0 == Fault::PatternShape {
            return Pattern::full(4, 4);
        }
        let mut entries = vec![(0, 0), (0, 1), (0, 2), (0, 4), (1, 0), (1, 1), (1, 3)];
        for i in 0..2 {
            entries.extend([(2 + i, i), (2 + i, 2 + i)]);
            if self.0 != Fault::Pattern || i == 0 {
                entries.push((2 + i, 4));
            }
        }
        Pattern::from_entries(4, 5, entries).unwrap()
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for i in 0..2 {
            let z = x[2 + i] + R * x[i];
            out[3 * i] = z - x[4];
            out[3 * i + 1] = z + x[4];
            out[3 * i + 2] = x[4];
        }
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        out[0] = 2.0 * x[0] - x[1] + x[2] - x[4].sin() + 0.3 * x[0].powi(3);
        out[1] = 2.0 * x[1] - x[0] + x[3];
        for i in 0..2 {
            let jump = if self.0 == Fault::Jump && i == 1 { 0.1 } else { 0.0 };
            let nan = if self.0 == Fault::Nan && i == 1 {
                f64::NAN
            } else {
                0.0
            };
            out[2 + i] = match s.piece(i) {
                0 => x[2 + i] + x[4],
                1 => -R * x[i] + nan,
                _ => x[2 + i] - x[4] + jump,
            };
        }
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        jac.add(0, 0, 2.0 + 0.9 * x[0] * x[0]);
        jac.add(0, 1, -1.0);
        jac.add(0, 2, 1.0);
        jac.add(0, 4, -x[4].cos());
        jac.add(1, 0, -1.0);
        jac.add(1, 1, 2.0);
        jac.add(1, 3, 1.0);
        for i in 0..2 {
            match s.piece(i) {
                0 => {
                    jac.add(2 + i, 2 + i, 1.0);
                    let sign = if self.0 == Fault::JacobianSign && i == 1 {
                        -1.0
                    } else {
                        1.0
                    };
                    jac.add(2 + i, 4, sign);
                }
                1 => jac.add(2 + i, i, -R),
                _ => {
                    jac.add(2 + i, 2 + i, 1.0);
                    jac.add(2 + i, 4, -1.0);
                }
            }
        }
    }
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
    fn structure(&self) -> Option<&dyn Structure> {
        Some(self)
    }
    fn description(&self) -> Option<&dyn Description> {
        Some(self)
    }
}

impl Derivatives for Rubber {
    fn test_gradient(&self, site: usize, test: usize, _: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        if test < 2 {
            gradient[site] = if self.0 == Fault::Gradient { 1.0 } else { R };
            gradient[2 + site] = 1.0;
        }
        gradient[4] = [-1.0, 1.0, 1.0][test];
    }
    fn test_derivatives(&self, _: &[f64], d: &[f64], out: &mut [f64]) {
        for i in 0..2 {
            let z = d[2 + i] + R * d[i];
            out[3 * i] = z - d[4];
            out[3 * i + 1] = z + if self.0 == Fault::Rates { -d[4] } else { d[4] };
            out[3 * i + 2] = d[4];
        }
    }
}

impl Structure for Rubber {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        rows.clear();
        rows.push(if self.0 == Fault::Rows { site } else { 2 + site });
    }
    fn site_jacobian(&self, site: usize, s: &Selection, x: &[f64], jac: &mut Matrix) -> bool {
        if !matches!(self.0, Fault::None | Fault::SiteJacobian | Fault::SiteExtra) {
            return false;
        }
        let row = 2 + site;
        match s.piece(site) {
            0 => {
                jac.add(row, row, 1.0);
                jac.add(row, 4, if self.0 == Fault::SiteJacobian { -1.0 } else { 1.0 });
            }
            1 => jac.add(row, site, -R),
            _ => {
                jac.add(row, row, 1.0);
                jac.add(row, 4, -1.0);
            }
        }
        if self.0 == Fault::SiteExtra {
            jac.add(0, 0, 2.0 + 0.9 * x[0] * x[0]);
        }
        true
    }
}

impl Description for Rubber {
    fn piece_name(&self, _: usize, piece: usize) -> Cow<'_, str> {
        ["left", "stick", "right"][piece].into()
    }
    fn site_name(&self, site: usize) -> Cow<'_, str> {
        format!("block {site}").into()
    }
}

pub(crate) fn samples() -> Vec<Vec<f64>> {
    let mut samples: Vec<Vec<f64>> = (0..12)
        .map(|k| {
            let v = |j: usize| 2.0 * ((k * 7 + j * 5) as f64 * 1.3).sin();
            vec![v(0), v(1), v(2), v(3), 0.3 + v(4).abs()]
        })
        .collect();
    samples.push(vec![0.2, 0.1, 0.3, 0.4, -0.5]);
    samples
}
