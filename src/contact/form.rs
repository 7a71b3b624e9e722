//! What the full and the condensed form have in common.

use std::ops::ControlFlow;

use super::error::check_length;
use super::node_law::{LocalValues, NodeLaw};
use super::{CondensedContact, ContactBody, ContactError, ContactOptions, ContactReport, FullContact};
use crate::piecewise::PiecewiseSmooth;

/// A contact problem in one of its forms: x ends with the multipliers, all normal ones first, and α.
pub(super) trait Form: PiecewiseSmooth {
    type Law: NodeLaw;
    type Under<M: NodeLaw>: Form<Law = M>;

    fn law(&self) -> &Self::Law;

    /// The augmentation parameter.
    fn augmentation(&self) -> f64;

    /// Stiffness of single contact nodes.
    fn stiffness(&self) -> f64;

    fn values(&self, node: usize, x: &[f64]) -> LocalValues;

    /// The same body under another law, with another augmentation parameter.
    fn under<M: NodeLaw>(&self, law: M, r: f64) -> Self::Under<M>;

    /// The same body under another law, with the load that it has at α.
    fn at_load<M: NodeLaw>(&self, alpha: f64, law: M) -> Result<Self::Under<M>, ContactError>;

    /// Forces of the problem with all nodes stuck, as a start.
    fn stick(&self, alpha: f64) -> Result<Option<Vec<f64>>, ContactError>;

    /// Improves a start by a quick method of the form, if there is one; whether that converged.
    fn improve(&self, _x: &mut [f64], _max_iterations: usize) -> bool {
        false
    }
}

/// What both forms have of [`PiecewiseSmooth`] from their law: sites are the contact nodes.
macro_rules! sites_of_the_law {
    () => {
        fn num_sites(&self) -> usize {
            self.body.num_contacts()
        }

        fn num_pieces(&self, _site: usize) -> usize {
            self.law.num_pieces()
        }

        fn num_tests(&self, _site: usize) -> usize {
            self.law.num_tests()
        }

        fn cell(&self, _site: usize, piece: usize) -> &[Facet] {
            self.law.cell(piece)
        }

        fn piece_name(&self, _site: usize, piece: usize) -> Cow<'_, str> {
            Cow::Borrowed(self.law.piece_name(piece))
        }

        fn site_name(&self, site: usize) -> Cow<'_, str> {
            Cow::Owned(format!("contact node {site}"))
        }

        fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
            let (p, blocks) = (self.body.num_contacts(), self.body.traces.len());
            let first = self.num_residuals() - blocks * p;
            rows.clear();
            rows.extend((0..blocks).map(|block| first + block * p + site));
        }

        fn pattern(&self) -> Pattern {
            self.pattern.clone()
        }

        fn test_functions(&self, x: &[f64], out: &mut [f64]) {
            for (i, chunk) in out.chunks_exact_mut(self.law.num_tests()).enumerate() {
                self.law.tests(&self.values(i, x), chunk);
            }
        }

        fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
            let mut rows = [LocalRow::default(); MAX_TESTS];
            for (i, chunk) in out.chunks_exact_mut(self.law.num_tests()).enumerate() {
                self.law.test_rows(&self.values(i, x), &mut rows);
                for (o, row) in chunk.iter_mut().zip(&rows) {
                    *o = 0.0;
                    self.scatter(i, row, |j, value| *o += value * d[j]);
                }
            }
        }

        fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
            let mut rows = [LocalRow::default(); MAX_TESTS];
            self.law.test_rows(&self.values(site, x), &mut rows);
            gradient.fill(0.0);
            self.scatter(site, &rows[test.min(MAX_TESTS - 1)], |j, value| {
                gradient[j] += value
            });
        }
    };
}

/// Methods that both forms have, documented alike.
macro_rules! methods_of_forms {
    ($form:ident) => {
        impl<L: NodeLaw> $form<L> {
            /// Sets the augmentation parameter r > 0 (force per length). Solutions do not depend on it.
            ///
            /// # Errors
            /// r ≤ 0 or not finite.
            pub fn with_r(mut self, r: f64) -> Result<Self, ContactError> {
                if !(r > 0.0 && r.is_finite()) {
                    return Err(ContactError::Augmentation { r });
                }
                self.r = r;
                Ok(self)
            }

            /// Sets the tangential displacements from which slips are measured (all along t₁, then all along t₂): those of the step before,
            /// in a history of loading. Zero at first.
            ///
            /// # Errors
            /// Wrong length, values that are not finite.
            pub fn set_reference_slip(&mut self, reference: &[f64]) -> Result<(), ContactError> {
                check_length("the reference of the slip", reference, self.reference.len())?;
                self.reference.copy_from_slice(reference);
                Ok(())
            }

            /// The augmentation parameter.
            #[must_use]
            pub fn r(&self) -> f64 {
                self.r
            }

            /// The body.
            #[must_use]
            pub fn body(&self) -> &ContactBody {
                &self.body
            }

            /// The law.
            #[must_use]
            pub fn law(&self) -> &L {
                &self.law
            }

            /// A solution at fixed α: by PS-Newton from `start` (α is set; zero if there is none) and, where that fails, by the other
            /// strategies of [`ContactStrategy`](super::ContactStrategy).
            ///
            /// A body that stands without contact has a solution under every law of this crate whose coefficients are continuous and
            /// bounded; it need not be unique.
            ///
            /// # Errors
            /// Coefficients of friction that are negative or not finite; [`ContactError::NoStart`], with the best iterate and its
            /// history, when no strategy finds a solution.
            pub fn solve(&self, alpha: f64, start: Option<&[f64]>) -> Result<Vec<f64>, ContactError> {
                Ok(self.solve_reported(alpha, start)?.x)
            }

            /// [`solve`](Self::solve) with an account of all attempts.
            ///
            /// # Errors
            /// As [`solve`](Self::solve).
            pub fn solve_reported(
                &self,
                alpha: f64,
                start: Option<&[f64]>,
            ) -> Result<ContactReport, ContactError> {
                self.solve_observed(alpha, start, &ContactOptions::default(), |_| {
                    ControlFlow::Continue(())
                })
            }
        }
    };
}

methods_of_forms!(FullContact);
methods_of_forms!(CondensedContact);

pub(super) use sites_of_the_law;
