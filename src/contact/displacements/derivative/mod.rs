//! Derivatives of solutions of the form in displacements: one solve with the system of a Newton step, or its transpose.

mod solves;

use std::fmt;

use super::kink::{RateMap, RateNode};
use super::node::{ChangedRows, Node};
use super::system::{ReducedSystem, SerialSystem};
use super::{NodeLaw, ReducedContact, ReducedNodes};
use crate::contact::law::{LocalRow, LocalValues};
use crate::contact::parameters::ContactParameters;
use crate::contact::rounding::size_of_forces;
use crate::contact::solution::piece_of;
use crate::contact::{ContactChange, ContactError};
use crate::input::{check_finite, check_vector};
use crate::linear::LinearError;
use crate::sensitivity::{
    DerivativeDoubt, Differentiability, Directional, Element, Known, Sensitivity, SensitivityError, differ,
    directions, too_many,
};
use crate::sparse::{Matrix, max_abs};
use crate::spread::Random;

/// Multiples of a further Newton step, and of the rounding of the largest force of a node, that a test function must exceed to have a sign.
const ALLOWANCE: f64 = 64.0;
/// Largest relative residual of the linear systems; results are refused above ten times of it.
const TOLERANCE: f64 = 1e-11;
/// Random errors of that size from which those of rates at kinks are found.
const PROBES: usize = 4;

/// A solution of the form in displacements as a function of [parameters](ContactParameters): made by [`ReducedContact::sensitivity`]. It
/// borrows the problem, whose multigrid it uses: a product with the derivative is one linear solve, a gradient one with the transposed
/// system, both to a relative residual of 1e-11.
///
/// At a kink the nodes that it is at are freed, and their forces obey the law's rates: a problem in these forces alone, whose compliance
/// takes one linear solve for each of them, once. What [`Sensitivity`] says of that problem is what is said of this one; products then
/// take two solves each. Where nodes slip the linear system may be singular: one solve with a random right-hand side, before anything is
/// said of a solution, tells. [`jvp`](Self::jvp) and [`vjp`](Self::vjp) away from kinks do without it. Linear solves are known to a
/// relative 1e-11: a kink far smaller than 1e-7 of the rates is not seen, and *differentiable* then undecided, and where a rate problem
/// is singular but for that accuracy nothing is said.
pub struct ReducedSensitivity<'a> {
    system: &'a mut SerialSystem,
    components: &'a [usize],
    nodes: Vec<Local>,
    changed: ChangedRows,
    /// ∂_θ(A u + Bᵀ λ − f), ∂_θ(B u − gap) and ∂_θβ; the load's rate, where α is a parameter.
    columns: [Matrix; 3],
    rate: Option<Vec<f64>>,
    margin: f64,
    /// The nodes at kinks, in ascending order, and their rate problem: before its first use without the compliance.
    weak: Vec<usize>,
    rates: Option<Rates>,
    /// Whether the linear system is known to be regular.
    is_regular: bool,
    iterations: usize,
}

/// A displacement of a linear solve, or 0 where it is no more than the error of one whose largest displacement is given: at ties of a rate
/// problem such a remainder would choose a side.
fn known(displacement: f64, largest: f64) -> f64 {
    if displacement.abs() <= TOLERANCE * largest {
        0.0
    } else {
        displacement
    }
}

enum Rates {
    Unprepared(RateMap),
    Ready {
        found: Box<Sensitivity<RateMap>>,
        /// The element along the unit vectors, once it was asked for.
        element: Option<Element>,
    },
}

/// The rates of the data along a change of the parameters.
struct Change {
    /// Of A u + Bᵀ λ − f, in all components.
    forces: Vec<f64>,
    /// Of B u − gap at fixed u, all normal ones first.
    traces: Vec<f64>,
    second: Vec<f64>,
    alpha: f64,
}

impl fmt::Debug for ReducedSensitivity<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ReducedSensitivity")
            .field("contacts", &self.nodes.len())
            .field("parameters", &self.num_parameters())
            .field("margin", &self.margin)
            .finish_non_exhaustive()
    }
}

/// The linearised law of a node.
struct Local {
    node: Node,
    /// Prescribed changes and constants for a unit of each residual.
    unit: [[[f64; 3]; 2]; 3],
    /// Derivatives of the residuals in the values of the node.
    rows: [LocalRow; 3],
}

impl Local {
    fn new(law: &dyn NodeLaw, v: &LocalValues) -> Result<Self, String> {
        let piece = piece_of(law, v);
        let mut unit = [[[0.0; 3]; 2]; 3];
        for (k, of) in unit.iter_mut().enumerate().take(1 + law.num_tangents()) {
            let mut h = [0.0; 3];
            h[k] = 1.0;
            let node = Node::with_residual(law, v, piece, h)?;
            *of = [node.prescribed.map(Option::unwrap_or_default), node.constant];
        }
        Ok(Self {
            node: Node::with_residual(law, v, piece, [0.0; 3])?,
            unit,
            rows: law.rows(piece, v),
        })
    }

    /// A node whose forces are given: the residuals are their rates.
    fn freed() -> Self {
        let mut unit = [[[0.0; 3]; 2]; 3];
        (0..3).for_each(|k| unit[k][1][k] = 1.0);
        Self {
            node: Node::default(),
            unit,
            rows: [LocalRow::default(); 3],
        }
    }

    fn is_held(&self, d: usize) -> bool {
        self.node.prescribed[d].is_some()
    }

    /// What residuals h prescribe, and their constants.
    fn response(&self, h: [f64; 3]) -> [[f64; 3]; 2] {
        let of = |which: usize, d: usize| (0..3).map(|k| h[k] * self.unit[k][which][d]).sum();
        [0, 1].map(|which| std::array::from_fn(|d| of(which, d)))
    }

    /// The residuals' rate with changes of the traces and of the parameters of the law.
    fn residuals(&self, traces: [f64; 3], alpha: f64, second: f64) -> [f64; 3] {
        self.rows.map(|row| {
            let slip = row.slip[0] * traces[1] + row.slip[1] * traces[2];
            row.penetration * traces[0] + slip + row.parameter * alpha + row.second * second
        })
    }
}

impl<L: NodeLaw> ReducedContact<L> {
    /// The solution with these free displacements at α as a function of parameters of the data. One linear solve tells how accurate the
    /// solution is, and with that how near to a kink.
    ///
    /// # Errors
    /// Parameters of a problem of another size, or none; wrong lengths, values that are not finite; displacements that are no solution; a law with another number of history
    /// variables than that of the problem; laws that cannot be eliminated; linear solves that do not converge.
    pub fn sensitivity(
        &mut self,
        alpha: f64,
        displacements: &[f64],
        parameters: &ContactParameters,
    ) -> Result<ReducedSensitivity<'_>, ContactError> {
        let (n, dim, p) = (
            self.body.num_displacements(),
            self.body.dim(),
            self.components.len(),
        );
        parameters.check_sizes([n, p, dim])?;
        check_finite("the parameter", &[alpha])?;
        check_vector("the displacements", displacements, n)?;
        check_finite("the displacements", displacements)?;
        let law: &dyn NodeLaw = match parameters.shared_law() {
            Some(law) => law.as_ref(),
            None => &self.law,
        };
        parameters.check_law(&self.law)?;
        let nodes = ReducedNodes {
            components: &self.components,
            first: 0,
            gap: &self.body.gap,
            reference: &self.reference,
            history: &self.history,
            r: self.r,
            parameter: alpha,
        };
        let u = self.body.turned(displacements);
        // λ = f − A u at the contact nodes, the residual of equilibrium elsewhere.
        let mut rest = vec![0.0; u.len()];
        self.system.mul(&u, &mut rest)?;
        let load = self.body.turned_forces(&self.load_at(alpha));
        rest.iter_mut().zip(&load).for_each(|(r, f)| *r = f - *r);
        let values: Vec<LocalValues> = (0..p).map(|i| nodes.values(law, i, &u, |k| rest[k])).collect();
        let refused = |node: usize, piece: String| ContactError::Invalid {
            what: format!(
                "piece \"{piece}\" of node {node} does not determine its forces; use the full form"
            ),
        };
        let locals = values.iter().enumerate();
        let locals = locals.map(|(i, v)| Local::new(law, v).map_err(|piece| refused(i, piece)));
        let locals = locals.collect::<Result<Vec<_>, _>>()?;
        let sizes: Vec<f64> = (values.iter().enumerate())
            .map(|(i, v)| size_of_forces(v, nodes.offsets(i)))
            .collect();
        let rate = (parameters.has_alpha()).then(|| self.body.load.rate(alpha, n));
        let mut made = ReducedSensitivity {
            system: &mut self.system,
            components: &self.components,
            nodes: locals,
            changed: ChangedRows::default(),
            columns: [
                parameters.equilibrium()?,
                parameters.traces(self.body.dim() * self.components.len())?,
                parameters.second()?,
            ],
            rate,
            margin: f64::INFINITY,
            weak: Vec::new(),
            rates: None,
            is_regular: false,
            iterations: 0,
        };
        made.select(law.num_tangents())?;
        for &at in &self.components {
            rest[at..at + dim].fill(0.0);
        }
        rest.iter_mut().for_each(|r| *r = -*r);
        let errors = made.find_margin(law, &values, &sizes, (&u, &rest))?;
        if !made.weak.is_empty() {
            let rate_node = |&i: &usize| RateNode::new(law, &values[i], &errors[i]);
            let nodes = made.weak.iter().map(rate_node).collect();
            made.rates = Some(Rates::Unprepared(RateMap::new(law, nodes)));
            made.weak.iter().for_each(|&i| made.nodes[i] = Local::freed());
            made.select(law.num_tangents())?;
        }
        Ok(made)
    }
}

impl ReducedSensitivity<'_> {
    /// Number of parameters.
    #[must_use]
    pub fn num_parameters(&self) -> usize {
        self.columns[0].ncols() + usize::from(self.rate.is_some())
    }

    /// Whether the free displacements and the forces are a differentiable function of the parameters here; in *no*, the derivatives are
    /// those of the free displacements.
    ///
    /// # Errors
    /// A solve that does not converge.
    pub fn differentiable(&mut self) -> Result<Differentiability, SensitivityError> {
        if self.weak.is_empty() {
            self.check_regular()?;
            return Ok(Differentiability::Yes { margin: self.margin });
        }
        if let Some(doubt) = self.too_many() {
            return Ok(Differentiability::Undecided(doubt));
        }
        match self.prepared()?.differentiable()? {
            Differentiability::No { .. } => {}
            // Of all changes of these nodes' data, and so of those that the parameters make.
            said => return Ok(said),
        }
        for direction in directions(self.num_parameters()) {
            if !self.has_kink_along(&direction)? {
                continue;
            }
            let opposite: Vec<f64> = direction.iter().map(|d| -d).collect();
            let [forward, backward] = [self.jvp(&direction)?, self.jvp(&opposite)?].map(|c| c.displacements);
            return Ok(Differentiability::No {
                direction,
                forward,
                backward,
            });
        }
        Ok(Differentiability::Undecided(DerivativeDoubt::Selections))
    }

    /// The least test function in multiples of its possible error; at most 1 at a kink.
    #[must_use]
    pub fn margin(&self) -> f64 {
        self.margin
    }

    /// Iterations of GMRES in the last solve.
    #[must_use]
    pub fn iterations(&self) -> usize {
        self.iterations
    }

    /// The directional derivative along a change δ of the parameters.
    ///
    /// # Errors
    /// A wrong length, values that are not finite; at kinks as [`Sensitivity::jvp`]; a solve that does not converge.
    pub fn jvp(&mut self, delta: &[f64]) -> Result<ContactChange, SensitivityError> {
        let change = self.change(delta)?;
        if self.weak.is_empty() {
            return self.moved(&change, &[]);
        }
        if let Some(DerivativeDoubt::NotUnique(verdict)) = self.too_many() {
            return Err(SensitivityError::NotUnique { verdict });
        }
        let (data, _) = self.data_of_weak(&change)?;
        let forces = self.prepared()?.jvp(&data)?;
        self.moved(&change, &forces)
    }

    /// How the free displacements move along δ: the directional derivative, or where the solutions are not known to be one function the
    /// one-sided branches. At a kink one solve for each component of the forces of the nodes there, however many these are.
    ///
    /// # Errors
    /// As [`Sensitivity::directional`]; a solve that does not converge.
    pub fn directional(&mut self, delta: &[f64]) -> Result<Directional, SensitivityError> {
        let change = self.change(delta)?;
        if self.weak.is_empty() {
            self.check_regular()?;
            return Ok(Directional::Derivative(self.moved(&change, &[])?.displacements));
        }
        let (data, _) = self.data_of_weak(&change)?;
        match self.prepared()?.directional(&data)? {
            Directional::Derivative(forces) => Ok(Directional::Derivative(
                self.moved(&change, &forces)?.displacements,
            )),
            Directional::Branches { branches, complete } => {
                let branches = branches
                    .into_iter()
                    .map(|f| Ok(self.moved(&change, &f)?.displacements));
                let branches = branches.collect::<Result<_, SensitivityError>>()?;
                Ok(Directional::Branches { branches, complete })
            }
        }
    }

    /// The gradient in the parameters of a function of the solution, from its gradients in the free displacements and in the contact
    /// forces: one solve with the transposed system. At kinks the derivative is the lexicographic one along the unit vectors, which takes
    /// two such solves, and before the first gradient up to one for each parameter.
    ///
    /// # Errors
    /// As [`jvp`](Self::jvp).
    pub fn vjp(&mut self, displacements: &[f64], forces: &[f64]) -> Result<Vec<f64>, SensitivityError> {
        let (n, dim, p) = (
            self.columns[0].nrows(),
            self.system.body().dim(),
            self.nodes.len(),
        );
        check_vector("the gradient in the displacements", displacements, n)?;
        check_vector("the gradient in the forces", forces, dim * p)?;
        let mut of_u = self.system.body().turned_forces(displacements);
        let of_force = |i: usize, d: usize| forces[d * p + i];
        let mut of_data = Vec::new();
        if !self.weak.is_empty() {
            self.prepare_element()?;
            let (_, of_h) = self.transposed(of_u.clone(), of_force)?;
            let of_weak = self.weak.iter().flat_map(|&i| of_h[i][..dim].iter().copied());
            let of_weak: Vec<f64> = of_weak.collect();
            if let Some(Rates::Ready {
                element: Some(element),
                ..
            }) = &mut self.rates
            {
                of_data = element.vjp(&of_weak)?;
            }
            let places = self.weak.iter().flat_map(|&i| (0..dim).map(move |d| (i, d)));
            for ((i, d), w) in places.zip(&of_data) {
                of_u[self.components[i] + d] += w;
            }
        }
        let (adjoint, of_h) = self.transposed(of_u, of_force)?;
        let mut gradient = vec![0.0; self.columns[0].ncols()];
        let adjoint = self.system.body().free(&adjoint);
        (self.columns[0].as_ref()).mul_transpose_add(-1.0, &adjoint, &mut gradient);
        let (mut traces, mut second, mut of_alpha) = (vec![0.0; dim * p], vec![0.0; p], 0.0);
        for (i, (local, weight)) in self.nodes.iter().zip(&of_h).enumerate() {
            for (row, w) in local.rows.iter().zip(weight) {
                let by = [row.penetration, row.slip[0], row.slip[1]];
                (0..dim).for_each(|d| traces[d * p + i] += w * by[d]);
                second[i] += w * row.second;
                of_alpha += w * row.parameter;
            }
        }
        if let Some((of_offsets, [of_load, of_second @ ..])) = of_data.split_at_checked(dim * self.weak.len())
        {
            for (k, &i) in self.weak.iter().enumerate() {
                (0..dim).for_each(|d| traces[d * p + i] += of_offsets[dim * k + d]);
                second[i] += of_second[k];
            }
            of_alpha += of_load;
        }
        (self.columns[1].as_ref()).mul_transpose_add(1.0, &traces, &mut gradient);
        if self.columns[2].nrows() > 0 {
            (self.columns[2].as_ref()).mul_transpose_add(1.0, &second, &mut gradient);
        }
        if let Some(rate) = &self.rate {
            of_alpha += rate.iter().zip(&adjoint).map(|(f, y)| f * y).sum::<f64>();
            gradient.insert(0, of_alpha);
        }
        check_vector("the gradient", &gradient, gradient.len())?;
        Ok(gradient)
    }

    /// The rates of the data along δ.
    fn change(&self, delta: &[f64]) -> Result<Change, SensitivityError> {
        check_vector("the change of the parameters", delta, self.num_parameters())?;
        let (alpha, own) = match self.rate {
            Some(_) => (delta[0], &delta[1..]),
            None => (0.0, delta),
        };
        let mut forces = vec![0.0; self.columns[0].nrows()];
        (self.columns[0].as_ref()).mul_add(1.0, own, &mut forces);
        if let Some(rate) = &self.rate {
            forces.iter_mut().zip(rate).for_each(|(e, f)| *e -= alpha * f);
        }
        let [mut traces, mut second] = [1, 2].map(|k| vec![0.0; self.columns[k].nrows()]);
        (self.columns[1].as_ref()).mul_add(1.0, own, &mut traces);
        (self.columns[2].as_ref()).mul_add(1.0, own, &mut second);
        second.resize(self.nodes.len(), 0.0);
        Ok(Change {
            forces: self.system.body().turned_forces(&forces),
            traces,
            second,
            alpha,
        })
    }

    /// The rates of the displacements and of f − A u with forces of the weak nodes, none if there are none.
    fn rates_at(&mut self, change: &Change, of_weak: &[f64]) -> Result<(Vec<f64>, Vec<f64>), LinearError> {
        let (dim, p) = (self.system.body().dim(), self.nodes.len());
        let mut h: Vec<[f64; 3]> = (self.nodes.iter().enumerate())
            .map(|(i, local)| {
                let moved = std::array::from_fn(|d| change.traces.get(d * p + i).copied().unwrap_or(0.0));
                local.residuals(moved, change.alpha, change.second[i])
            })
            .collect();
        for (&i, forces) in self.weak.iter().zip(of_weak.chunks_exact(dim)) {
            h[i][..dim].copy_from_slice(forces);
        }
        self.forward(&change.forces, &h)
    }

    fn moved(&mut self, change: &Change, of_weak: &[f64]) -> Result<ContactChange, SensitivityError> {
        let (u, rest) = self.rates_at(change, of_weak)?;
        let dim = self.system.body().dim();
        let nodal = (0..dim).flat_map(|d| self.components.iter().map(move |at| at + d));
        let change = ContactChange {
            forces: nodal.map(|k| rest[k]).collect(),
            displacements: self.system.body().free(&u),
        };
        check_vector(
            "the derivative of the solution",
            &change.displacements,
            change.displacements.len(),
        )?;
        Ok(change)
    }

    /// What a change means to the rate problem of the weak nodes: their rates without forces, and those of α and β.
    /// Also the largest rate of a displacement.
    fn data_of_weak(&mut self, change: &Change) -> Result<(Vec<f64>, f64), SensitivityError> {
        let (dim, p) = (self.system.body().dim(), self.nodes.len());
        let (u, _) = self.rates_at(change, &[])?;
        let offsets = self.weak.iter().flat_map(|&i| {
            let at = self.components[i];
            (0..dim).map(move |d| (at + d, d * p + i))
        });
        let mut data: Vec<f64> = offsets.map(|(k, t)| u[k] + change.traces[t]).collect();
        let largest = max_abs(&u);
        data.iter_mut().for_each(|d| *d = known(*d, largest));
        data.push(change.alpha);
        data.extend(self.weak.iter().map(|&i| change.second[i]));
        Ok((data, largest))
    }

    /// Why nothing is said where more selections are active at the weak nodes than are examined.
    fn too_many(&self) -> Option<DerivativeDoubt> {
        match &self.rates {
            Some(Rates::Unprepared(map)) => too_many(map),
            Some(Rates::Ready { found, .. }) => too_many(found.map()),
            None => None,
        }
    }

    /// The rate problem of the weak nodes, with its compliance.
    fn prepared(&mut self) -> Result<&mut Sensitivity<RateMap>, SensitivityError> {
        self.check_regular()?;
        if let Some(Rates::Unprepared(map)) = &self.rates {
            let (mut map, dim) = (map.clone(), self.system.body().dim());
            let none = vec![0.0; self.system.body().len()];
            for (column, k) in (self.weak.clone().iter())
                .flat_map(|&i| (0..dim).map(move |d| (i, d)))
                .zip(0..)
            {
                let mut h = vec![[0.0; 3]; self.nodes.len()];
                h[column.0][column.1] = 1.0;
                let (u, _) = self.forward(&none, &h)?;
                let rows = self.weak.iter().map(|&i| self.components[i]);
                let largest = max_abs(&u);
                let column = rows.flat_map(|at| &u[at..at + dim]);
                map.set_column(k, column.map(|u| known(*u, largest)));
            }
            let (n, k) = map.sizes();
            let mut found = Sensitivity::with_idle_parameters(map, &vec![0.0; n], &vec![0.0; k])?;
            found.doubt_below(ALLOWANCE * TOLERANCE)?;
            self.rates = Some(Rates::Ready {
                found: Box::new(found),
                element: None,
            });
        }
        match &mut self.rates {
            Some(Rates::Ready { found, .. }) => Ok(found),
            _ => Err(SensitivityError::NotDifferentiable),
        }
    }

    /// Differentiates the rate problem along the unit vectors of the parameters, one after the other.
    fn prepare_element(&mut self) -> Result<(), SensitivityError> {
        if let Some(DerivativeDoubt::NotUnique(verdict)) = self.too_many() {
            return Err(SensitivityError::NotUnique { verdict });
        }
        self.prepared()?;
        let Some(Rates::Ready { found, element: None }) = self
            .rates
            .take_if(|r| matches!(r, Rates::Ready { element: None, .. }))
        else {
            return Ok(());
        };
        let k = self.num_parameters();
        let mut failed = None;
        let frame = (0..k).map_while(|j| {
            let unit: Vec<f64> = (0..k).map(|i| f64::from(u8::from(i == j))).collect();
            let data = self.change(&unit).and_then(|change| self.data_of_weak(&change));
            data.map(|d| d.0).map_err(|e| failed = Some(e)).ok()
        });
        let element = found.element_along(frame);
        let element = match failed {
            Some(e) => Err(e),
            None => element,
        };
        self.rates = Some(Rates::Ready {
            found,
            element: element.as_ref().ok().cloned(),
        });
        element.map(drop)
    }

    /// Whether the forces of the weak nodes have rates along ±δ that differ by more than the accuracy of the linear solves explains.
    fn has_kink_along(&mut self, delta: &[f64]) -> Result<bool, SensitivityError> {
        let change = self.change(delta)?;
        let (data, largest) = self.data_of_weak(&change)?;
        let count = self.weak.len() * self.system.body().dim();
        let rates = self.prepared()?;
        let mut spread = Random::new(1);
        let mut sides = Vec::new();
        for sign in [1.0, -1.0] {
            let data: Vec<f64> = data.iter().map(|d| sign * d).collect();
            let Ok(forces) = rates.jvp(&data) else {
                return Ok(false);
            };
            let noise = TOLERANCE * (largest + rates.map().largest_response(&forces));
            let mut widths = vec![0.0_f64; count];
            for _ in 0..PROBES {
                let moved = data.iter().enumerate();
                let moved = moved.map(|(k, d)| {
                    if k < count {
                        d + noise * spread.symmetric()
                    } else {
                        *d
                    }
                });
                let Ok(other) = rates.jvp(&moved.collect::<Vec<_>>()) else {
                    return Ok(false);
                };
                for ((w, a), b) in widths.iter_mut().zip(&other).zip(&forces) {
                    *w = w.max((a - b).abs());
                }
            }
            sides.push(Known {
                value: forces.iter().map(|f| sign * f).collect(),
                floors: widths.clone(),
                widths,
            });
        }
        Ok(differ(&sides[0], &sides[1]))
    }
}
