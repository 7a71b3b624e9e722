use crate::piecewise::{PiecewiseSmooth, Selection, Semismooth, TestLayout, select_pieces};
use crate::sparse::Matrix;

/// What the Newton loop needs of a problem: piecewise-smooth maps with selections, or semismooth maps without.
pub(super) trait System {
    /// The residual at a point that may be stepped to; the iterate stays where it is until [`accept`](Self::accept).
    fn evaluate(&mut self, x: &[f64], out: &mut [f64]) -> Evaluation;
    /// The point evaluated last becomes the iterate.
    fn accept(&mut self);
    /// H(x) with each site using the piece in whose cell x lies, whatever the rule for the iterates. Call
    /// [`accept`](Self::accept) to continue with these pieces.
    fn natural(&mut self, x: &[f64], out: &mut [f64]);
    fn linearize(&mut self, x: &[f64], jac: &mut Matrix);
    /// From now on at most one site changes its piece at a time. False where there are no pieces.
    fn use_least_index(&mut self) -> bool;
    /// A fingerprint of the selection at the iterate.
    fn fingerprint(&self) -> Option<u64>;
}

#[derive(Clone, Copy)]
pub(super) struct Evaluation {
    /// Sites whose piece differs from that at the iterate.
    pub(super) changed: usize,
    /// Whether all sites use the piece in whose cell x lies.
    pub(super) settled: bool,
}

/// Buffers of [`PsSystem`], kept between solves.
#[derive(Debug, Clone, Default)]
pub(super) struct PsBuffers {
    pub(super) layout: Option<TestLayout>,
    pub(super) theta: Vec<f64>,
    pub(super) selection: Selection,
    pub(super) trial: Selection,
    /// Whether the map is taken as it is, whatever scale users prescribed.
    pub(super) own_scale: bool,
}

pub(super) struct PsSystem<'a> {
    pub(super) map: &'a dyn PiecewiseSmooth,
    pub(super) layout: &'a TestLayout,
    pub(super) theta: &'a mut [f64],
    /// Of the iterate.
    pub(super) selection: &'a mut Selection,
    /// Of the point evaluated last.
    pub(super) trial: &'a mut Selection,
    pub(super) least_index: bool,
    pub(super) fresh: bool,
}

impl PsSystem<'_> {
    fn choose(&mut self, x: &[f64]) -> usize {
        self.map.test_functions(x, self.theta);
        self.trial.copy_from(self.selection);
        let changed = select_pieces(self.map, self.layout, self.theta, !self.fresh, 0.0, self.trial);
        // The start has no previous selection: that of an earlier run does not count.
        if self.fresh { 0 } else { changed }
    }
}

impl System for PsSystem<'_> {
    fn evaluate(&mut self, x: &[f64], out: &mut [f64]) -> Evaluation {
        let mut changed = self.choose(x);
        let settled = !self.least_index || changed <= 1;
        if !settled {
            let first = self.selection.differing_sites(self.trial).next();
            let site = first.unwrap_or(0);
            let piece = self.trial.piece(site);
            self.trial.copy_from(self.selection);
            self.trial.set(site, piece);
            changed = 1;
        }
        self.map.residual(self.trial, x, out);
        Evaluation { changed, settled }
    }

    fn accept(&mut self) {
        self.selection.copy_from(self.trial);
        self.fresh = false;
    }

    fn natural(&mut self, x: &[f64], out: &mut [f64]) {
        self.choose(x);
        self.map.residual(self.trial, x, out);
    }

    fn linearize(&mut self, x: &[f64], jac: &mut Matrix) {
        self.map.jacobian(self.selection, x, jac);
    }

    fn use_least_index(&mut self) -> bool {
        self.least_index = self.layout.num_sites() > 0;
        self.least_index
    }

    fn fingerprint(&self) -> Option<u64> {
        // FNV-1a: the same on every run and machine, unlike the standard hasher's seeds.
        let fnv = |h: u64, p: usize| (h ^ p as u64).wrapping_mul(0x0100_0000_01b3);
        Some(self.selection.pieces().fold(0xcbf2_9ce4_8422_2325, fnv))
    }
}

pub(super) struct SemismoothSystem<'a, S: ?Sized>(pub(super) &'a S);

impl<S: Semismooth + ?Sized> System for SemismoothSystem<'_, S> {
    fn evaluate(&mut self, x: &[f64], out: &mut [f64]) -> Evaluation {
        self.0.residual(x, out);
        Evaluation {
            changed: 0,
            settled: true,
        }
    }

    fn accept(&mut self) {}

    fn natural(&mut self, x: &[f64], out: &mut [f64]) {
        self.0.residual(x, out);
    }

    fn linearize(&mut self, x: &[f64], jac: &mut Matrix) {
        self.0.jacobian(x, jac);
    }

    fn use_least_index(&mut self) -> bool {
        false
    }

    fn fingerprint(&self) -> Option<u64> {
        // A single selection: a residual that does not fall counts as cycling.
        Some(0)
    }
}
