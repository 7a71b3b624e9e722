//! Exact coefficients of interface problems, from those of the operator and the law.

use super::operator::Operator;
use super::view::View;
use super::{Interface, LoadPath};
use crate::exact::{Dictionary, Exact, Place, passive_bounds};
use crate::piecewise::{
    ExactConditions, ExactForm, ExactPieces, ExactSite, PiecewiseSmooth, PiecewiseSmoothExt,
};

/// Largest number of displacements for which the compliance is computed exactly from the stiffness; beyond it, the stored compliance is
/// taken as exact.
const MAX_EXACT: usize = 16;

/// The traces v and all displacements as exact affine forms of the multipliers λ, all multiplied by one positive factor.
#[derive(Debug, Clone)]
struct ExactTraces {
    /// The constant, the coefficient of α, and those of λ.
    traces: Vec<Vec<Exact>>,
    all: Vec<Vec<Exact>>,
    factor: Exact,
}

impl ExactTraces {
    /// From A u + Bᵀ λ = f₀ + α f₁, where that is small.
    fn of_stiffness(operator: &Operator, load: [&[f64]; 2]) -> Option<Self> {
        let (a, b_t) = (&operator.a, &operator.b_t);
        let (n, q) = (a.nrows(), b_t.ncols());
        if n > MAX_EXACT {
            return None;
        }
        let unknowns = n + 1 + q;
        let mut constants = Vec::new();
        let mut rows = vec![vec![Exact::default(); unknowns]; n];
        for k in 0..n {
            constants.push(-&Exact::new(load[0][k])?);
            rows[k][n] = -&Exact::new(load[1][k])?;
        }
        for (i, j, v) in a.triplets() {
            rows[i][j] = &rows[i][j] + &Exact::new(v)?;
        }
        for (j, k, v) in b_t.triplets() {
            let column = n + 1 + k;
            rows[j][column] = &rows[j][column] + &Exact::new(v)?;
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
        let mut traces = vec![vec![Exact::default(); q + 2]; q];
        for (j, k, v) in b_t.triplets() {
            let v = Exact::new(v)?;
            for (sum, u) in traces[k].iter_mut().zip(&all[j]) {
                *sum = &*sum + &(&v * u);
            }
        }
        let factor = Exact::of(table.denominator().clone(), 0);
        for (k, trace) in traces.iter_mut().enumerate() {
            let own = &factor * &Exact::new(operator.yielding(k))?;
            trace[2 + k] = &trace[2 + k] + &-&own;
        }
        Some(Self { traces, all, factor })
    }

    /// From the stored compliance and free motion: `row(k)` is row k of C.
    fn stored<'c>(row: impl Fn(usize) -> &'c [f64], free: &[f64], rate: &[f64]) -> Option<Self> {
        let trace = |k: usize| -> Option<Vec<Exact>> {
            let head = [free[k], rate[k]].into_iter();
            head.chain(row(k).iter().map(|c| -c)).map(Exact::new).collect()
        };
        Some(Self {
            traces: (0..free.len()).map(trace).collect::<Option<_>>()?,
            all: Vec::new(),
            factor: Exact::one(),
        })
    }

    /// A trace (or displacement) at a parameter.
    fn at(trace: &[Exact], alpha: &Exact) -> ExactForm {
        ExactForm {
            constant: &trace[0] + &(alpha * &trace[1]),
            coefficients: trace[2..].to_vec(),
        }
    }

    /// A form in (v, λ) as one in λ, times a positive factor. Auxiliary unknowns follow λ.
    fn substituted(&self, form: &ExactForm, alpha: &Exact) -> ExactForm {
        let (of_traces, own) = form.coefficients.split_at(self.traces.len());
        let mut sum = ExactForm {
            constant: form.constant.clone(),
            coefficients: own.to_vec(),
        };
        // Forms with auxiliary unknowns are compared with one another: all of them are multiplied by the factor.
        let auxiliary = own.len() > self.traces.len();
        if auxiliary || of_traces.iter().any(|c| !c.is_zero()) {
            sum = ExactForm::zero(own.len()).plus(&self.factor, &sum);
            for (c, trace) in of_traces.iter().zip(&self.traces).filter(|t| !t.0.is_zero()) {
                let mut trace = Self::at(trace, alpha);
                trace.coefficients.resize(own.len(), Exact::default());
                sum = sum.plus(c, &trace);
            }
        }
        sum
    }

    /// Bounds of all displacements from bounds of the contact forces.
    fn displacement_bounds(&self, alpha: f64, forces: &[Option<Exact>]) -> Option<Vec<Option<Exact>>> {
        let alpha = Exact::new(alpha)?;
        if forces.is_empty() {
            return None;
        }
        let factor = self.factor.magnitude()?;
        let bound = |u: &Vec<Exact>| -> Option<Exact> {
            let form = Self::at(u, &alpha);
            let mut sum = form.constant.abs();
            for (c, b) in form.coefficients.iter().zip(forces) {
                sum = &sum + &(&c.abs() * b.as_ref()?);
            }
            Some(sum.shifted(1 - factor))
        };
        Some(self.all.iter().map(bound).collect())
    }
}

impl LoadPath {
    /// f₀ and f₁ of a load f₀ + α f₁.
    fn line(&self, n: usize) -> Option<[Vec<f64>; 2]> {
        if !self.is_affine() || self.num_parts() > 1 {
            return None;
        }
        let slope = self
            .parts()
            .next()
            .map_or_else(|| vec![0.0; n], |case| case.forces().to_vec());
        Some([self.base()?.to_vec(), slope])
    }
}

impl<V: View, G: PiecewiseSmooth> Interface<V, G> {
    /// Whether law and load state their coefficients.
    pub(super) fn states_coefficients(&self) -> bool {
        let load = &self.operator.load;
        let affine = load.is_affine() && load.num_parts() <= 1 && load.base().is_some();
        self.num_parameters() == 1 && affine && self.law.exact().is_some()
    }
}

/// The law with v given by `traces`. Compiled once for all laws, like the function below.
fn condensed_conditions(
    law: &dyn ExactPieces,
    alpha: f64,
    own: &ExactConditions,
    q: usize,
    traces: &ExactTraces,
) -> Option<ExactConditions> {
    let at = Exact::new(alpha)?;
    let opposite = law.passive(alpha).unwrap_or_default();
    let opposite: Vec<ExactForm> = opposite.iter().map(|f| traces.substituted(f, &at)).collect();
    let bounds = if opposite.is_empty() {
        None
    } else {
        let rows: Vec<_> = opposite
            .iter()
            .map(|f| (&f.constant, f.coefficients.as_slice()))
            .collect();
        passive_bounds(&rows)
    };
    Some(ExactConditions {
        unknowns: own.unknowns.checked_sub(q)?,
        common: own.common.iter().map(|f| traces.substituted(f, &at)).collect(),
        sites: changed(&own.sites, 0, |f| traces.substituted(f, &at)),
        bounds: bounds.map_or_else(Vec::new, |b| b.into_iter().map(Some).collect()),
    })
}

/// Equilibrium, and the law with v = B u.
fn full_conditions(
    operator: &Operator,
    law: &dyn ExactPieces,
    alpha: f64,
    own: &ExactConditions,
    load: [&[f64]; 2],
) -> Option<ExactConditions> {
    let (n, q) = (operator.num_displacements(), operator.num_traces());
    let unknowns = n + own.unknowns.checked_sub(q)?;
    let at = Exact::new(alpha)?;
    let mut common = vec![ExactForm::zero(unknowns); n];
    for (k, row) in common.iter_mut().enumerate() {
        row.constant = -&(&Exact::new(load[0][k])? + &(&at * &Exact::new(load[1][k])?));
    }
    let add = |sum: &mut Exact, v: f64| -> Option<()> {
        *sum = &*sum + &Exact::new(v)?;
        Some(())
    };
    for (i, j, v) in operator.a.triplets() {
        add(&mut common[i].coefficients[j], v)?;
    }
    let mut traces = vec![ExactForm::zero(unknowns); q];
    for (j, k, v) in operator.b_t.triplets() {
        add(&mut common[j].coefficients[n + k], v)?;
        add(&mut traces[k].coefficients[j], v)?;
    }
    for (k, trace) in traces.iter_mut().enumerate() {
        add(&mut trace.coefficients[n + k], -operator.yielding(k))?;
    }
    let expanded = |form: &ExactForm| {
        let (of_traces, multipliers) = form.coefficients.split_at(q);
        let mut sum = ExactForm::zero(unknowns);
        sum.constant = form.constant.clone();
        sum.coefficients[n..].clone_from_slice(multipliers);
        let used = of_traces.iter().zip(&traces).filter(|t| !t.0.is_zero());
        used.fold(sum, |sum, (c, trace)| sum.plus(c, trace))
    };
    let sites = changed(&own.sites, n, expanded);
    common.extend(own.common.iter().map(expanded));
    let bounds = || {
        let traces = ExactTraces::of_stiffness(operator, load)?;
        let forces = condensed_conditions(law, alpha, own, q, &traces)?.bounds;
        let mut bounds = traces.displacement_bounds(alpha, &forces)?;
        bounds.extend(forces);
        Some(bounds)
    };
    Some(ExactConditions {
        unknowns,
        sites,
        common,
        bounds: bounds().unwrap_or_default(),
    })
}

/// The sites with transformed forms; the row numbers of equalities are shifted by `first`.
fn changed(sites: &[ExactSite], first: usize, form: impl Fn(&ExactForm) -> ExactForm) -> Vec<ExactSite> {
    let mut sites = sites.to_vec();
    for site in &mut sites {
        site.forms = site.forms.iter().map(&form).collect();
        for piece in &mut site.pieces {
            piece.equalities.iter_mut().for_each(|(row, _)| *row += first);
        }
    }
    sites
}

impl<V: View, G: PiecewiseSmooth> ExactPieces for Interface<V, G> {
    fn is_affine_in_parameter(&self) -> bool {
        self.law.exact().is_some_and(ExactPieces::is_affine_in_parameter)
    }

    fn conditions(&self, alpha: f64) -> Option<ExactConditions> {
        let law = self.law.exact()?;
        let own = law.conditions(alpha)?;
        let load = self.operator.load.line(self.num_displacements())?;
        let load = [load[0].as_slice(), load[1].as_slice()];
        let Some(reduced) = self.view.reduced() else {
            return full_conditions(&self.operator, law, alpha, &own, load);
        };
        let of_body = ExactTraces::of_stiffness(&self.operator, load);
        let stored = || {
            let (free, rate) = reduced.line()?;
            ExactTraces::stored(|k| reduced.row(k), free, &rate)
        };
        condensed_conditions(law, alpha, &own, self.num_traces(), &of_body.or_else(stored)?)
    }
}
