use super::descent::Descent;
use super::equations::Equations;
use super::linearisation::Linearisation;
use super::system::System;
use super::units::Units;
use crate::complementarity::ComplementarityError;
use crate::complementarity::affine::with_diagonal;
use crate::judge::Judge;
use crate::sparse::{Matrix, Pattern};

/// Everything a solve needs, made once for problems of one shape.
#[derive(Debug, Clone)]
pub(super) struct Work {
    pub(super) n: usize,
    /// Start of a solve, as given and projected.
    pub(super) start: Vec<f64>,
    /// Where an attempt is, and where its next step may lead.
    pub(super) here: Iterate,
    pub(super) trial: Iterate,
    pub(super) lin: Linearisation,
    pub(super) equations: Equations,
    pub(super) system: System,
    pub(super) judge: Judge,
    /// F(0) of an affine F; else empty.
    pub(super) constants: Vec<f64>,
    pub(super) units: Units,
    pub(super) seen: Seen,
    pub(super) descent: Descent,
    /// Active sets that the first strategy has met so far.
    pub(super) visited: Vec<u64>,
}

/// A point and F there.
#[derive(Debug, Clone)]
pub(super) struct Iterate {
    pub(super) x: Vec<f64>,
    pub(super) f: Vec<f64>,
}

impl Iterate {
    fn new(n: usize) -> Self {
        Self {
            x: vec![0.0; n],
            f: vec![0.0; n],
        }
    }
}

/// Points of a solve that its report needs.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    /// The one with the smallest natural residual.
    pub(super) best: Vec<f64>,
    /// The one with the smallest error relative to the terms of rows.
    pub(super) nearest: Vec<f64>,
    /// −1, 0, +1: piece of the natural map at the iterate recorded last.
    pub(super) pieces: Vec<i8>,
}

impl Work {
    pub(super) fn new(pattern: &Pattern) -> Result<Self, ComplementarityError> {
        let n = pattern.nrows();
        let pattern = with_diagonal(pattern)?;
        Ok(Self {
            n,
            start: vec![0.0; n],
            here: Iterate::new(n),
            trial: Iterate::new(n),
            lin: Linearisation::new(pattern.clone()),
            equations: Equations::new(n),
            system: System::new(pattern),
            judge: Judge::default(),
            constants: Vec::new(),
            units: Units::default(),
            seen: Seen {
                best: vec![0.0; n],
                nearest: vec![0.0; n],
                pieces: vec![0; n],
            },
            descent: Descent::new(n),
            visited: Vec::new(),
        })
    }

    /// Room for ∇F and F(0) before a run.
    pub(super) fn scratch(&mut self) -> (&mut Matrix, &mut Vec<f64>) {
        (self.lin.room(), &mut self.constants)
    }

    pub(super) fn fits(&self, pattern: &Pattern) -> bool {
        self.lin.jac().pattern() == pattern
    }

    /// H = diag(∂Φ/∂x) + diag(∂Φ/∂F) (J + `shift` I), as the current system.
    pub(super) fn build_fischer(&mut self, shift: f64) {
        self.system.build(self.lin.scaled(), &self.equations, shift);
    }

    /// The step d = −(HᵀH + μ I)⁻¹ HᵀΦ of the current system.
    pub(super) fn solve_regularised(&mut self, mu: f64) -> bool {
        self.system.solve_regularised(mu, &self.equations.gradient)
    }
}
