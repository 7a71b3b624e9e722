use crate::piecewise::{PiecewiseSmooth, Selection, Semismooth, TestLayout, select_pieces};
use crate::sparse::Matrix;

/// What the Newton loop needs of a problem: piecewise-smooth maps with selections, or semismooth maps without.
pub(super) trait System {
    fn evaluate(&mut self, x: &[f64], out: &mut [f64]) -> Evaluation;
    fn linearize(&mut self, x: &[f64], jac: &mut Matrix);
    /// From now on at most one site changes its piece at a time. False where there are no pieces.
    fn use_least_index(&mut self) -> bool;
    /// A fingerprint of the current selection.
    fn fingerprint(&self) -> Option<u64>;
}

pub(super) struct Evaluation {
    /// Sites whose piece changed against the last evaluation.
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
    pub(super) wanted: Selection,
}

pub(super) struct PsSystem<'a, P: ?Sized> {
    pub(super) map: &'a P,
    pub(super) layout: &'a TestLayout,
    pub(super) theta: &'a mut [f64],
    pub(super) selection: &'a mut Selection,
    pub(super) wanted: &'a mut Selection,
    pub(super) least_index: bool,
    pub(super) fresh: bool,
}

impl<P: PiecewiseSmooth + ?Sized> System for PsSystem<'_, P> {
    fn evaluate(&mut self, x: &[f64], out: &mut [f64]) -> Evaluation {
        self.map.test_functions(x, self.theta);
        self.wanted.copy_from(self.selection);
        let keep = !self.fresh;
        let mut changed = select_pieces(self.map, self.layout, self.theta, keep, 0.0, self.wanted);
        let mut settled = true;
        if self.least_index && !self.fresh && changed > 1 {
            let first = self.selection.differing_sites(self.wanted).next();
            if let Some(site) = first {
                self.selection.set(site, self.wanted.piece(site));
            }
            settled = false;
            changed = 1;
        } else {
            self.selection.copy_from(self.wanted);
        }
        self.fresh = false;
        self.map.residual(self.selection, x, out);
        Evaluation { changed, settled }
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

    fn linearize(&mut self, x: &[f64], jac: &mut Matrix) {
        self.0.jacobian(x, jac);
    }

    fn use_least_index(&mut self) -> bool {
        false
    }

    fn fingerprint(&self) -> Option<u64> {
        None
    }
}
