//! Planar Coulomb friction with exact coefficients, without the augmentation parameter: on solutions nothing depends on it.

use super::{ContactBody, NodeLaw};
use crate::exact::{Dictionary, Exact, Place, passive_bounds};
use crate::piecewise::{ExactConditions, ExactForm, ExactPiece, ExactSite};
use crate::sparse::Matrix;

/// Displacements up to which the compliance is derived from the stiffness without rounding; beyond, it counts as stored.
const MAX_EXACT: usize = 16;

/// The displacements of a body as affine forms of the contact forces λ (normal, then tangential), without rounding and all times one
/// positive factor: those of the contact nodes, and all.
#[derive(Debug, Clone)]
pub(super) struct ExactTraces {
    /// The constant, the coefficient of α, and those of λ.
    pub(super) contact: Vec<Vec<Exact>>,
    pub(super) all: Vec<Vec<Exact>>,
    factor: Exact,
}

impl ExactTraces {
    /// From A u + Bᵀ λ = f₀ + α f₁, where that is small; `transposes` are Bνᵀ and Btᵀ.
    pub(super) fn of_stiffness(a: &Matrix, transposes: [&Matrix; 2], load: [&[f64]; 2]) -> Option<Self> {
        let (n, p) = (a.nrows(), transposes[0].ncols());
        if n > MAX_EXACT {
            return None;
        }
        let unknowns = n + 1 + 2 * p;
        let mut constants = Vec::new();
        let mut rows = vec![vec![Exact::default(); unknowns]; n];
        for k in 0..n {
            constants.push(-&Exact::new(load[0][k])?);
            rows[k][n] = -&Exact::new(load[1][k])?;
        }
        for (i, j, v) in a.triplets() {
            rows[i][j] = &rows[i][j] + &Exact::new(v)?;
        }
        for (block, b) in transposes.into_iter().enumerate() {
            for (j, i, v) in b.triplets() {
                let column = n + 1 + block * p + i;
                rows[j][column] = &rows[j][column] + &Exact::new(v)?;
            }
        }
        let forms = constants.iter().zip(&rows).map(|(c, r)| (c, r.as_slice()));
        let mut table = Dictionary::new(unknowns, forms);
        for row in 0..n {
            table.fix_among(row, |var| (n..2 * n).contains(&var)).ok()??;
        }
        let expanded = |u: usize| -> Vec<Exact> {
            let entries = table.entries(n + u);
            let at = |var: usize| match table.place(var) {
                Place::Column(c) => Exact::of(entries[1 + c].clone(), 0),
                _ => Exact::default(),
            };
            let unknowns = (0..unknowns - n).map(|k| at(2 * n + k));
            std::iter::once(Exact::of(entries[0].clone(), 0))
                .chain(unknowns)
                .collect()
        };
        let all: Vec<Vec<Exact>> = (0..n).map(expanded).collect();
        let mut contact = vec![vec![Exact::default(); 2 * p + 2]; 2 * p];
        for (block, b) in transposes.into_iter().enumerate() {
            for (j, i, v) in b.triplets() {
                let v = Exact::new(v)?;
                for (sum, u) in contact[block * p + i].iter_mut().zip(&all[j]) {
                    *sum = &*sum + &(&v * u);
                }
            }
        }
        Some(Self {
            contact,
            all,
            factor: Exact::of(table.denominator().clone(), 0),
        })
    }

    /// From compliance and free motion as stored: row k of C by `row`.
    pub(super) fn stored<'c>(row: impl Fn(usize) -> &'c [f64], free: &[f64], rate: &[f64]) -> Option<Self> {
        let trace = |k: usize| -> Option<Vec<Exact>> {
            let head = [free[k], rate[k]].into_iter();
            head.chain(row(k).iter().map(|c| -c)).map(Exact::new).collect()
        };
        Some(Self {
            contact: (0..free.len()).map(trace).collect::<Option<_>>()?,
            all: Vec::new(),
            factor: Exact::one(),
        })
    }

    /// A trace (or displacement) at a parameter, less a given value.
    fn at(&self, trace: &[Exact], alpha: &Exact, held: f64) -> Option<ExactForm> {
        let constant = &trace[0] + &(alpha * &trace[1]);
        Some(ExactForm {
            constant: &constant - &(&self.factor * &Exact::new(held)?),
            coefficients: trace[2..].to_vec(),
        })
    }

    /// The conditions of contact with gaps, tangential displacements at rest and coefficients of friction, in the unknowns λ.
    pub(super) fn conditions(
        &self,
        alpha: f64,
        held: impl Fn(usize) -> f64,
        friction: &[Exact],
    ) -> Option<ExactConditions> {
        let (p, alpha) = (friction.len(), Exact::new(alpha)?);
        let displacements = (0..2 * p)
            .map(|k| self.at(&self.contact[k], &alpha, held(k)))
            .collect::<Option<Vec<_>>>()?;
        let opposite: Vec<ExactForm> = displacements
            .iter()
            .map(|form| ExactForm::zero(2 * p).plus(&-&Exact::one(), form))
            .collect();
        // λᵀ(u − held) ≥ 0 at solutions.
        let bounds = passive_bounds(opposite.iter().map(|f| (&f.constant, f.coefficients.as_slice())));
        let site = |i: usize| {
            let unknown = |k: usize| ExactForm::unknown(2 * p, k, Exact::default());
            let forces = [unknown(i), unknown(p + i)];
            let traces = [opposite[i].clone(), opposite[p + i].clone()];
            coulomb(forces, traces, &friction[i], [i, p + i])
        };
        Some(ExactConditions {
            unknowns: 2 * p,
            common: Vec::new(),
            sites: (0..p).map(site).collect(),
            bounds: bounds.map_or_else(Vec::new, |b| b.into_iter().map(Some).collect()),
        })
    }

    /// Bounds of all displacements from bounds of the contact forces.
    pub(super) fn displacement_bounds(
        &self,
        alpha: f64,
        forces: &[Option<Exact>],
    ) -> Option<Vec<Option<Exact>>> {
        let alpha = Exact::new(alpha)?;
        if forces.is_empty() {
            return None;
        }
        let factor = self.factor.magnitude()?;
        let bound = |u: &Vec<Exact>| -> Option<Exact> {
            let form = self.at(u, &alpha, 0.0)?;
            let mut sum = form.constant.abs();
            for (c, b) in form.coefficients.iter().zip(forces) {
                sum = &sum + &(&c.abs() * b.as_ref()?);
            }
            Some(sum.shifted(1 - factor))
        };
        Some(self.all.iter().map(bound).collect())
    }
}

/// Whether body and law are planar, with constant friction and a load affine in α.
pub(super) fn states_coefficients<L: NodeLaw>(body: &ContactBody, law: &L) -> bool {
    body.num_tangents() == 1 && body.load.0.is_affine() && exact_friction(body, law).is_some()
}

pub(super) fn exact_friction<L: NodeLaw>(body: &ContactBody, law: &L) -> Option<Vec<Exact>> {
    let nodes = 0..body.num_contacts();
    nodes
        .map(|node| Exact::new(law.constant_friction(node)?))
        .collect()
}

/// The gap of a normal quantity, the displacement at rest of a tangential one.
pub(super) fn held_at(body: &ContactBody, reference: &[f64], k: usize) -> f64 {
    let p = body.num_contacts();
    if k < p { body.gap[k] } else { reference[k - p] }
}

/// Contact in full form, (u, λν, λt) with the equations of equilibrium A u + Bᵀ λ = f₀ + α f₁; `transposes` are Bνᵀ and Btᵀ.
pub(super) fn full_conditions(
    a: &Matrix,
    transposes: [&Matrix; 2],
    load: [&[f64]; 2],
    alpha: f64,
    held: impl Fn(usize) -> f64,
    friction: &[Exact],
) -> Option<ExactConditions> {
    let (n, p) = (a.nrows(), friction.len());
    let (m, at) = (n + 2 * p, Exact::new(alpha)?);
    let mut common = vec![ExactForm::zero(m); n];
    for (k, row) in common.iter_mut().enumerate() {
        row.constant = -&(&Exact::new(load[0][k])? + &(&at * &Exact::new(load[1][k])?));
    }
    let add = |sum: &mut Exact, v: f64| -> Option<()> {
        *sum = &*sum + &Exact::new(v)?;
        Some(())
    };
    for (i, j, v) in a.triplets() {
        add(&mut common[i].coefficients[j], v)?;
    }
    // gap − u_ν and −u_t.
    let mut traces = vec![ExactForm::zero(m); 2 * p];
    for (block, b) in transposes.into_iter().enumerate() {
        for (j, i, v) in b.triplets() {
            let k = block * p + i;
            add(&mut common[j].coefficients[n + k], v)?;
            add(&mut traces[k].coefficients[j], -v)?;
        }
    }
    for (k, trace) in traces.iter_mut().enumerate() {
        trace.constant = Exact::new(held(k))?;
    }
    let site = |i: usize| {
        let force = |k: usize| ExactForm::unknown(m, n + k, Exact::default());
        let displacements = [traces[i].clone(), traces[p + i].clone()];
        let rows = [n + i, n + p + i];
        coulomb([force(i), force(p + i)], displacements, &friction[i], rows)
    };
    let bounds = || {
        let traces = ExactTraces::of_stiffness(a, transposes, load)?;
        let forces = traces.conditions(alpha, &held, friction)?.bounds;
        let mut bounds = traces.displacement_bounds(alpha, &forces)?;
        bounds.extend(forces);
        Some(bounds)
    };
    Some(ExactConditions {
        unknowns: m,
        sites: (0..p).map(site).collect(),
        common,
        bounds: bounds().unwrap_or_default(),
    })
}

/// The pieces open, stick, slip+, slip− of a node with the forms λν, λt; gap − u_ν, −u_t; F; and the rows of the map they stand for.
pub(super) fn coulomb(
    [pressure, traction]: [ExactForm; 2],
    [gap, slip]: [ExactForm; 2],
    friction: &Exact,
    rows: [usize; 2],
) -> ExactSite {
    const PRESSURE: usize = 0;
    const TRACTION: usize = 1;
    const GAP: usize = 2;
    const SLIP: usize = 3;
    const BELOW: usize = 4;
    const ABOVE: usize = 5;
    let below = traction.plus(&-friction, &pressure);
    let above = traction.plus(friction, &pressure);
    let piece = |piece, [normal, tangential]: [usize; 2], facets: &[(usize, i8)]| ExactPiece {
        piece,
        equalities: vec![(rows[0], normal), (rows[1], tangential)],
        facets: facets.to_vec(),
    };
    let mut pieces = vec![piece(0, [PRESSURE, TRACTION], &[(GAP, 1)])];
    let mut implied = vec![(PRESSURE, 1), (GAP, 1)];
    // Where F < 0 nothing but an open node has a solution.
    if friction.sign() >= 0 {
        let mut sticking = vec![(BELOW, -1), (ABOVE, 1)];
        if friction.is_zero() {
            sticking.push((PRESSURE, 1));
        }
        pieces.push(piece(1, [GAP, SLIP], &sticking));
        pieces.push(piece(2, [GAP, BELOW], &[(SLIP, -1), (PRESSURE, 1)]));
        pieces.push(piece(3, [GAP, ABOVE], &[(SLIP, 1), (PRESSURE, 1)]));
        implied.extend([(BELOW, -1), (ABOVE, 1)]);
    }
    ExactSite {
        forms: vec![pressure, traction, gap, slip, below, above],
        pieces,
        implied,
    }
}
