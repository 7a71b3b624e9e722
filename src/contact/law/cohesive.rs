use super::ContactState;
use super::node_law::{LocalRow, LocalValues, NodeLaw};
use crate::contact::ContactError;
use crate::piecewise::Facet;

/// Cohesion: another law with λν + T in place of λν. With Coulomb friction the bound is F (λν + T) = c + F λν, with the cohesion c = F T,
/// and vanishes at the apex of the cone, λν = −T = −c/F.
///
/// A node opens under the tension T, and bears it at any distance: a joint that yields perfectly. Its forces are then continuous, which
/// those of a bond that breaks are not. Pieces, states and names are those of the other law.
#[derive(Debug, Clone, PartialEq)]
pub struct Cohesive<L> {
    law: L,
    tension: Vec<f64>,
}

impl<L: NodeLaw> Cohesive<L> {
    /// The law with the tension T ≥ 0, a nodal force, of each contact node.
    ///
    /// # Errors
    /// Values that are negative or not finite.
    pub fn new(law: L, tension: Vec<f64>) -> Result<Self, ContactError> {
        super::check_bounds("the tension", &tension)?;
        Ok(Self { law, tension })
    }

    fn inner(&self, v: &LocalValues) -> LocalValues {
        LocalValues {
            pressure: v.pressure + self.tension(v.node),
            ..*v
        }
    }
}

impl<L: NodeLaw> NodeLaw for Cohesive<L> {
    fn num_tangents(&self) -> usize {
        self.law.num_tangents()
    }

    fn num_nodes(&self) -> Option<usize> {
        Some(self.tension.len())
    }

    fn num_pieces(&self) -> usize {
        self.law.num_pieces()
    }

    fn num_tests(&self) -> usize {
        self.law.num_tests()
    }

    fn cell(&self, piece: usize) -> &'static [Facet] {
        self.law.cell(piece)
    }

    fn piece_name(&self, piece: usize) -> &'static str {
        self.law.piece_name(piece)
    }

    fn state(&self, piece: usize, v: &LocalValues) -> ContactState {
        self.law.state(piece, &self.inner(v))
    }

    fn tests(&self, v: &LocalValues, out: &mut [f64]) {
        self.law.tests(&self.inner(v), out);
    }

    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]) {
        self.law.test_rows(&self.inner(v), rows);
    }

    fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3] {
        self.law.residual(piece, &self.inner(v))
    }

    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3] {
        self.law.rows(piece, &self.inner(v))
    }

    fn is_affine(&self) -> bool {
        self.law.is_affine()
    }

    fn friction(&self, v: &LocalValues) -> [f64; 2] {
        self.law.friction(&self.inner(v))
    }

    fn num_history(&self) -> usize {
        self.law.num_history()
    }

    fn update(&self, v: &LocalValues, history: &mut [f64]) {
        self.law.update(&self.inner(v), history);
    }

    fn depends_on_slip(&self) -> bool {
        self.law.depends_on_slip()
    }

    fn affine_friction(&self, node: usize, history: &[f64]) -> Option<[f64; 2]> {
        self.law.affine_friction(node, history)
    }

    fn tension(&self, node: usize) -> f64 {
        self.tension.get(node).copied().unwrap_or(0.0) + self.law.tension(node)
    }

    fn check(&self, v: &LocalValues) -> Result<(), ContactError> {
        self.law.check(&self.inner(v))
    }
}
