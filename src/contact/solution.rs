//! The result type shared by all solvers of contact problems.

use std::fmt;

use super::ContactState;
use super::law::{LocalValues, MAX_TESTS, NodeLaw};
use super::residuals::{ContactResiduals, StateCounts};
use super::rounding::size_of_forces;
use super::tolerances::{BLURRED, SOLVED};
use crate::words::Count;

/// A solution of a contact problem, node by node: the same type for the full form, the condensed form, the fixed point and the Delassus
/// form.
///
/// Gaps are −penetration, tractions are the nodal forces of [`LocalValues`] (divide by the area of a node for a density).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactSolution {
    /// Open, stick or slip; nodes that touch without force count as open.
    pub states: Vec<ContactState>,
    /// Number of open nodes that touch: their forces, and r times their penetration, are below 1e-10 of the size against which the
    /// residuals are measured. A change of the load may let them open, stick or slip.
    #[cfg_attr(feature = "serde", serde(default))]
    pub touching: usize,
    /// Quantities at the nodes: penetrations, slips, nodal forces.
    pub nodes: Vec<LocalValues>,
    /// Energies.
    pub energy: ContactEnergy,
    /// How well the equations hold, block by block.
    pub residuals: ContactResiduals,
}

/// "1 open, 2 stick, 1 slips; residuals 1.0e-16 of equilibrium, …" in one line, "2 open (1 touches without force), …" where there are such.
impl fmt::Display for ContactSolution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = |wanted: fn(&ContactState) -> bool| self.states.iter().filter(|s| wanted(s)).count();
        let counts = [
            of(|s| *s == ContactState::Open),
            of(|s| *s == ContactState::Stick),
            of(|s| s.is_slip()),
        ];
        if self.touching > 0 {
            let touching = Count(self.touching, "touches", "touch");
            let rest = StateCounts(counts).closed();
            return write!(
                f,
                "{} open ({touching} without force), {rest}; {}",
                counts[0], self.residuals
            );
        }
        write!(f, "{}; {}", StateCounts(counts), self.residuals)
    }
}

/// Energies of a solution, in force times length. They balance: 2 `stored` = `load` − `normal` − `friction`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactEnergy {
    /// The elastic energy of the whole body: ½ uᵀ A u, the contribution of moving supports, and that of
    /// [springs](super::ContactBody::with_compliance) at contact nodes, by which u_ν and u_t are less below. In Delassus form, where the body
    /// is not known: ½ rᵀ M r, the energy due to the reactions.
    pub stored: f64,
    /// The load times the displacements, fᵀ u, and the reactions times the displacements of supports. In Delassus form −qᵀ r.
    pub load: f64,
    /// Σ λν u_ν; 0 where there is no initial gap.
    pub normal: f64,
    /// Σ λt · u_t.
    pub friction: f64,
    /// Σ λt · s ≥ 0 with the slips s, which are u_t less the reference of a history of loading.
    pub dissipated: f64,
}

impl ContactEnergy {
    /// 2 `stored` − `load` + `normal` + `friction`: 0 up to rounding.
    #[must_use]
    pub fn imbalance(&self) -> f64 {
        2.0 * self.stored - self.load + self.normal + self.friction
    }
}

impl ContactSolution {
    /// The solution with these values at its nodes; `law` gives the state and the residuals (normal, t₁, t₂) of a node.
    ///
    /// `stored`, `load` and `equilibrium` are computed by the caller; `offsets` of a node are u_ν − penetration and
    /// u_t − slip: its gap and reference slip. Forces below `least` are known to be rounding.
    pub(super) fn assemble(
        nodes: Vec<LocalValues>,
        mut law: impl FnMut(&LocalValues) -> (ContactState, [f64; 3]),
        offsets: impl Fn(usize) -> [f64; 3],
        (stored, load, equilibrium): (f64, f64, f64),
        least: f64,
    ) -> Self {
        let mut energy = ContactEnergy {
            stored,
            load,
            ..ContactEnergy::default()
        };
        let (mut normal, mut tangential, mut size) = (0.0f64, 0.0f64, f64::MIN_POSITIVE.max(least));
        let mut states = Vec::with_capacity(nodes.len());
        for (i, v) in nodes.iter().enumerate() {
            let (state, h) = law(v);
            states.push(state);
            normal = normal.max(h[0].abs());
            tangential = tangential.max(h[1].abs()).max(h[2].abs());
            let offsets = offsets(i);
            size = size.max(size_of_forces(v, offsets));
            energy.normal += v.pressure * (v.penetration + offsets[0]);
            for d in 0..2 {
                energy.friction += v.traction[d] * (v.slip[d] + offsets[1 + d]);
                energy.dissipated += v.traction[d] * v.slip[d];
            }
        }
        let mut touching = 0;
        for (state, v) in states.iter_mut().zip(&nodes) {
            let forces = [v.pressure, v.traction[0], v.traction[1], v.r * v.penetration];
            if forces.iter().all(|f| f.abs() <= SOLVED * size) {
                *state = ContactState::Open;
                touching += 1;
            }
        }
        Self {
            states,
            touching,
            nodes,
            energy,
            residuals: ContactResiduals {
                equilibrium,
                normal: normal / size,
                tangential: tangential / size,
            },
        }
    }

    /// Number of open nodes.
    #[must_use]
    pub fn open(&self) -> usize {
        self.count(|s| s == ContactState::Open)
    }

    /// Number of sticking nodes.
    #[must_use]
    pub fn stick(&self) -> usize {
        self.count(|s| s == ContactState::Stick)
    }

    /// Number of slipping nodes.
    #[must_use]
    pub fn slip(&self) -> usize {
        self.count(ContactState::is_slip)
    }

    fn count(&self, wanted: impl Fn(ContactState) -> bool) -> usize {
        self.states.iter().filter(|s| wanted(**s)).count()
    }

    /// The resultant of the nodal forces: normal, along t₁, along t₂ (meaningful on a flat boundary).
    #[must_use]
    pub fn resultant(&self) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for v in &self.nodes {
            sum[0] += v.pressure;
            sum[1] += v.traction[0];
            sum[2] += v.traction[1];
        }
        sum
    }
}

/// The piece in whose cell a node lies.
pub(super) fn piece_of<L: NodeLaw + ?Sized>(law: &L, v: &LocalValues) -> usize {
    let mut tests = [0.0; MAX_TESTS];
    law.tests(v, &mut tests);
    let margin = |piece: usize| crate::piecewise::cell_margin(law.cell(piece), &tests);
    (0..law.num_pieces())
        .max_by(|&a, &b| margin(a).total_cmp(&margin(b)))
        .unwrap_or(0)
}

/// State and residuals of a node under a law.
pub(super) fn judge<L: NodeLaw + ?Sized>(law: &L, v: &LocalValues) -> (ContactState, [f64; 3]) {
    let piece = piece_of(law, v);
    (law.state(piece, v), law.residual(piece, v))
}

/// Largest entry of A u + Bᵀ λ − f against the largest of the three terms; `cases` are Σ |terms| of the load cases, which may cancel.
pub(super) fn imbalance(stiff: &[f64], reaction: &[f64], load: &[f64], cases: &[f64]) -> f64 {
    let (mut worst, mut size) = (0.0f64, f64::MIN_POSITIVE);
    for (((a, b), f), terms) in stiff.iter().zip(reaction).zip(load).zip(cases) {
        worst = worst.max((a + b - f).abs());
        size = size.max(a.abs()).max(b.abs()).max(f.abs()).max(BLURRED * terms);
    }
    worst / size
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::ContactState;

    /// Two nodes with other numbers in every place: residuals are the largest against the largest term, energies are sums over nodes.
    #[test]
    fn residuals_are_the_largest_and_energies_sums() {
        let node = |node: usize, [penetration, pressure, t1, t2, s1, s2]: [f64; 6]| LocalValues {
            node,
            penetration,
            pressure,
            traction: [t1, t2],
            slip: [s1, s2],
            r: 10.0,
            ..LocalValues::default()
        };
        let nodes = [
            node(0, [-0.25, 3.0, 1.0, -2.0, 0.125, 0.5]),
            node(1, [0.5, -4.0, 0.5, 1.0, -0.75, 0.25]),
        ];
        for order in [[0, 1], [1, 0]] {
            let laws = [[0.3, -0.1, 0.2], [-0.6, 0.9, -0.4]];
            let states = [ContactState::Stick, ContactState::Open];
            let own: Vec<_> = order.iter().map(|&k| nodes[k]).collect();
            let law = |v: &LocalValues| (states[v.node], laws[v.node]);
            let offsets = |i: usize| [[1.0, 2.0, 4.0], [8.0, 16.0, 32.0]][order[i]];
            let solution = ContactSolution::assemble(own, law, offsets, (7.0, 9.0, 0.5), 0.0);
            // The largest term is r |slip| of the second node.
            let expected = (0.5, 0.6 / 7.5, 0.9 / 7.5);
            let found = &solution.residuals;
            assert_eq!((found.equilibrium, found.normal, found.tangential), expected);
            let energy = &solution.energy;
            assert_eq!((energy.stored, energy.load), (7.0, 9.0));
            assert_eq!(energy.normal, 3.0 * 0.75 - 4.0 * 8.5);
            assert_eq!(energy.friction, 2.125 - 2.0 * 4.5 + 0.5 * 15.25 + 32.25);
            assert_eq!(energy.dissipated, 0.125 - 1.0 - 0.375 + 0.25);
            assert_eq!((solution.open(), solution.stick(), solution.slip()), (1, 1, 0));
        }
    }
}
