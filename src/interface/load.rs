use std::fmt;
use std::sync::Arc;

use super::sizes::largest;
use crate::input::{check_length, check_size, check_vector};
use crate::piecewise::PiecewiseError;

type Amplitudes = Arc<dyn Fn(f64, &mut [f64], &mut [f64]) + Send + Sync>;

/// A load case: forces on the displacements u, and displacements of supports.
///
/// Vectors of forces become load cases by `into`; [`fem`](crate::fem) provides those of supports
/// ([`ElasticSystem::supports`](crate::fem::ElasticSystem::supports), [`ElasticSystem::motion`](crate::fem::ElasticSystem::motion)).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LoadCase {
    /// All forces on u, including those due to supports.
    total: Vec<f64>,
    supports: Option<Supports>,
}

/// Displacements g of supports, with K_fs, K_ss the blocks of the stiffness matrix of the whole body.
#[derive(Debug, Clone, PartialEq)]
struct Supports {
    /// g.
    displacements: Vec<f64>,
    /// −K_fs g, the forces on u.
    forces: Vec<f64>,
    /// K_ss g, the reactions where u = 0.
    reactions: Vec<f64>,
}

impl LoadCase {
    /// Displacements g of supports, in any order (free components may be among them, with 0), the forces −K_fs g that they exert on u and
    /// the reactions K_ss g of the supports themselves, with the blocks of the stiffness matrix of the whole body.
    ///
    /// # Errors
    /// Reactions and displacements of different lengths, values that are not finite.
    pub fn of_supports(
        displacements: Vec<f64>,
        forces: Vec<f64>,
        reactions: Vec<f64>,
    ) -> Result<Self, PiecewiseError> {
        check_vector(
            "the displacements of supports",
            &displacements,
            displacements.len(),
        )?;
        check_vector("the forces of supports", &forces, forces.len())?;
        check_vector("the reactions of supports", &reactions, displacements.len())?;
        Ok(Self {
            total: forces.clone(),
            supports: Some(Supports {
                displacements,
                forces,
                reactions,
            }),
        })
    }

    /// The sum of both cases.
    ///
    /// # Errors
    /// Different numbers of displacements or of supports.
    pub fn plus(mut self, other: impl Into<Self>) -> Result<Self, PiecewiseError> {
        let other = other.into();
        check_size("the length of a load case", self.total.len(), other.total.len())?;
        add(1.0, &other.total, &mut self.total);
        self.supports = match (self.supports, other.supports) {
            (Some(mut a), Some(b)) => {
                let (own, found) = (a.displacements.len(), b.displacements.len());
                check_size("the number of displacements of supports", own, found)?;
                a.add(1.0, &b);
                Some(a)
            }
            (a, b) => a.or(b),
        };
        Ok(self)
    }

    /// The forces on u: those applied, and those due to the supports. With them A u = f where there is no contact.
    #[must_use]
    pub fn forces(&self) -> &[f64] {
        &self.total
    }

    /// The displacements g of the supports; empty where the case has none.
    #[must_use]
    pub fn displacements(&self) -> &[f64] {
        self.supports.as_ref().map_or(&[], |s| &s.displacements)
    }

    /// The case times a factor.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        let scaled = |v: &[f64]| v.iter().map(|v| factor * v).collect();
        Self {
            total: scaled(&self.total),
            supports: self.supports.as_ref().map(|s| Supports {
                displacements: scaled(&s.displacements),
                forces: scaled(&s.forces),
                reactions: scaled(&s.reactions),
            }),
        }
    }

    fn rests(&self) -> bool {
        self.supports.is_none() && self.total.iter().all(|f| *f == 0.0)
    }
}

impl From<Vec<f64>> for LoadCase {
    fn from(forces: Vec<f64>) -> Self {
        Self {
            total: forces,
            supports: None,
        }
    }
}

impl From<&[f64]> for LoadCase {
    fn from(forces: &[f64]) -> Self {
        forces.to_vec().into()
    }
}

impl<const N: usize> From<&[f64; N]> for LoadCase {
    fn from(forces: &[f64; N]) -> Self {
        forces.to_vec().into()
    }
}

impl From<&Vec<f64>> for LoadCase {
    fn from(forces: &Vec<f64>) -> Self {
        forces.clone().into()
    }
}

impl From<&LoadCase> for LoadCase {
    fn from(case: &LoadCase) -> Self {
        case.clone()
    }
}

impl Supports {
    fn add(&mut self, c: f64, other: &Self) {
        add(c, &other.displacements, &mut self.displacements);
        add(c, &other.forces, &mut self.forces);
        add(c, &other.reactions, &mut self.reactions);
    }
}

/// A load f(α) = f₀ + Σ_k φ_k(α) f_k: load cases f_k with smooth amplitudes φ_k, or any smooth path of forces.
///
/// Each case costs one solve when the problem is condensed; a general path costs one at each α.
#[derive(Clone)]
pub struct LoadPath {
    shape: Shape,
    /// The case that is multiplied by a second parameter β.
    second: Option<LoadCase>,
}

#[derive(Clone)]
enum Shape {
    Cases {
        constant: LoadCase,
        cases: Vec<LoadCase>,
        /// `None`: all φ(α) = α.
        amplitudes: Option<Amplitudes>,
    },
    Function(Amplitudes),
}

impl LoadPath {
    /// The same load at every α.
    #[must_use]
    pub fn constant(load: impl Into<LoadCase>) -> Self {
        Self::sum(load.into(), Vec::new(), None)
    }

    /// f₀ + α f₁.
    #[must_use]
    pub fn affine(constant: impl Into<LoadCase>, slope: impl Into<LoadCase>) -> Self {
        Self::sum(constant.into(), vec![slope.into()], None)
    }

    /// The straight path from `start` at α = 0 to `end` at α = 1. Loads of different lengths are an error where the path is used.
    #[must_use]
    pub fn between(start: impl Into<LoadCase>, end: impl Into<LoadCase>) -> Self {
        let (start, end) = (start.into(), end.into());
        // Where lengths differ, the case keeps that of the end, so that the check fails.
        let slope = end.clone().plus(start.times(-1.0)).unwrap_or(end);
        Self::affine(start, slope)
    }

    /// f₀ + Σ_k φ_k(α) f_k; `amplitudes(α, φ, φ')` fills both vectors, of the length of `cases`.
    #[must_use]
    pub fn cases<C: Into<LoadCase>>(
        constant: impl Into<LoadCase>,
        cases: impl IntoIterator<Item = C>,
        amplitudes: impl Fn(f64, &mut [f64], &mut [f64]) + Send + Sync + 'static,
    ) -> Self {
        let cases = cases.into_iter().map(Into::into).collect();
        Self::sum(constant.into(), cases, Some(Arc::new(amplitudes)))
    }

    /// Any smooth path of forces: `function(α, f, f')` fills both vectors.
    #[must_use]
    pub fn function(function: impl Fn(f64, &mut [f64], &mut [f64]) + Send + Sync + 'static) -> Self {
        Self {
            shape: Shape::Function(Arc::new(function)),
            second: None,
        }
    }

    /// Adds β f₂, with a second parameter β.
    #[must_use]
    pub fn with_second(mut self, case: impl Into<LoadCase>) -> Self {
        self.second = Some(case.into());
        self
    }

    fn sum(constant: LoadCase, cases: Vec<LoadCase>, amplitudes: Option<Amplitudes>) -> Self {
        Self {
            shape: Shape::Cases {
                constant,
                cases,
                amplitudes,
            },
            second: None,
        }
    }

    /// The load at these parameters, at every α.
    pub(crate) fn frozen(&self, parameters: &[f64], n: usize) -> Self {
        let (mut total, mut rate) = (vec![0.0; n], vec![0.0; n]);
        self.general(parameters[0], &mut total, &mut rate);
        let mut factors = Factors::new(self);
        factors.set(self, parameters);
        for (case, c) in self.parts().zip(&factors.value) {
            add(*c, &case.total, &mut total);
        }
        let mut load = LoadCase::from(total);
        load.supports = self.supports(parameters);
        Self::constant(load)
    }

    /// The load without the second parameter.
    pub(crate) fn first(&self) -> Self {
        Self {
            shape: self.shape.clone(),
            second: None,
        }
    }

    /// All cases but the constant one: those of α, then that of β.
    pub(super) fn parts(&self) -> impl Iterator<Item = &LoadCase> {
        let cases: &[LoadCase] = match &self.shape {
            Shape::Cases { cases, .. } => cases,
            Shape::Function(_) => &[],
        };
        cases.iter().chain(&self.second)
    }

    pub(super) fn num_parts(&self) -> usize {
        self.parts().count()
    }

    /// The parameter that scales part k: 0 for α, 1 for β.
    pub(super) fn slot(&self, k: usize) -> usize {
        usize::from(self.second.is_some() && k + 1 == self.num_parts())
    }

    /// The constant case or the general path, and its derivative; `rate` is unchanged where that is 0.
    pub(super) fn general(&self, alpha: f64, out: &mut [f64], rate: &mut [f64]) {
        match &self.shape {
            Shape::Cases { constant, .. } => out.copy_from_slice(&constant.total),
            Shape::Function(f) => f(alpha, out, rate),
        }
    }

    /// The constant case, `None` for a general path.
    pub(super) fn base(&self) -> Option<&[f64]> {
        match &self.shape {
            Shape::Cases { constant, .. } => Some(&constant.total),
            Shape::Function(_) => None,
        }
    }

    /// Displacements of the supports with their forces and reactions.
    fn supports(&self, parameters: &[f64]) -> Option<Supports> {
        let Shape::Cases { constant, .. } = &self.shape else {
            return None;
        };
        let mut factors = Factors::new(self);
        factors.set(self, parameters);
        let all = std::iter::once((constant, 1.0)).chain(self.parts().zip(factors.value.iter().copied()));
        let mut sum: Option<Supports> = None;
        for (supports, c) in all.filter_map(|(case, c)| Some((case.supports.as_ref()?, c))) {
            let zero = || Supports {
                displacements: vec![0.0; supports.displacements.len()],
                forces: vec![0.0; supports.forces.len()],
                reactions: vec![0.0; supports.reactions.len()],
            };
            sum.get_or_insert_with(zero).add(c, supports);
        }
        sum
    }

    /// f at these parameters, on n displacements.
    pub(crate) fn at(&self, parameters: &[f64], n: usize) -> Vec<f64> {
        let (mut f, mut rate) = (vec![0.0; n], vec![0.0; n]);
        self.general(parameters[0], &mut f, &mut rate);
        let mut factors = Factors::new(self);
        factors.set(self, parameters);
        for (case, c) in self.parts().zip(&factors.value) {
            add(*c, case.forces(), &mut f);
        }
        f
    }

    /// ∂f/∂α, of length n.
    pub(crate) fn rate(&self, alpha: f64, n: usize) -> Vec<f64> {
        let (mut f, mut rate) = (vec![0.0; n], vec![0.0; n]);
        match self.base() {
            Some(_) => {}
            None => self.general(alpha, &mut f, &mut rate),
        }
        let mut factors = Factors::new(self);
        factors.set(self, &[alpha]);
        for (k, case) in self.parts().enumerate().filter(|(k, _)| self.slot(*k) == 0) {
            add(factors.rate[k], case.forces(), &mut rate);
        }
        rate
    }

    /// Σ |terms| of f at these parameters: cases may cancel.
    pub(crate) fn terms(&self, parameters: &[f64], n: usize) -> Vec<f64> {
        let (mut terms, mut rate) = (vec![0.0; n], vec![0.0; n]);
        self.general(parameters[0], &mut terms, &mut rate);
        terms.iter_mut().for_each(|f| *f = f.abs());
        let mut factors = Factors::new(self);
        factors.set(self, parameters);
        for (case, c) in self.parts().zip(&factors.value) {
            terms
                .iter_mut()
                .zip(case.forces())
                .for_each(|(t, f)| *t += (c * f).abs());
        }
        terms
    }

    /// The state of the supports at these parameters.
    pub(crate) fn support_state(&self, parameters: &[f64]) -> SupportState {
        SupportState(self.supports(parameters))
    }

    /// Sizes of the load at α = 0 and of its change, for n displacements.
    pub(super) fn sizes(&self, n: usize) -> [f64; 2] {
        match &self.shape {
            Shape::Cases { constant, cases, .. } => {
                let cases = &mut cases.iter().flat_map(|c| &c.total).copied();
                [largest(&mut constant.total.iter().copied()), largest(cases)]
            }
            Shape::Function(f) => {
                let (mut first, mut last, mut rate) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
                f(0.0, &mut first, &mut rate);
                f(1.0, &mut last, &mut rate);
                let mut change = last.iter().zip(&first).map(|(b, a)| b - a);
                [largest(&mut first.iter().copied()), largest(&mut change)]
            }
        }
    }

    pub(super) fn is_affine(&self) -> bool {
        match &self.shape {
            Shape::Cases {
                cases, amplitudes, ..
            } => amplitudes.is_none() || cases.is_empty(),
            Shape::Function(_) => false,
        }
    }

    /// Lengths and numbers; a single case that is zero is dropped.
    pub(crate) fn check(&mut self, n: usize) -> Result<(), PiecewiseError> {
        if let Shape::Cases {
            constant,
            cases,
            amplitudes,
        } = &mut self.shape
        {
            check_vector("the load", &constant.total, n)?;
            for case in cases.iter() {
                check_vector("a load case", &case.total, n)?;
            }
            if amplitudes.is_none() && cases.iter().all(LoadCase::rests) {
                cases.clear();
            }
        }
        if let Some(case) = &self.second {
            check_vector("the load of the second parameter", &case.total, n)?;
        }
        let all = self.parts().chain(match &self.shape {
            Shape::Cases { constant, .. } => Some(constant),
            Shape::Function(_) => None,
        });
        let mut count = None;
        for s in all.filter_map(|case| case.supports.as_ref()) {
            let found = s.displacements.len();
            check_length("the vector of forces of supports", s.forces.len(), n)?;
            let expected = *count.get_or_insert(found);
            check_size("the number of displacements of supports", expected, found)?;
        }
        Ok(())
    }
}

impl fmt::Debug for LoadPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LoadPath")
            .field("cases", &self.num_parts())
            .field("affine", &self.is_affine())
            .finish_non_exhaustive()
    }
}

/// Factors of the cases, and their derivatives with respect to their parameters.
#[derive(Debug, Clone)]
pub(super) struct Factors {
    pub(super) value: Vec<f64>,
    pub(super) rate: Vec<f64>,
}

impl Factors {
    pub(super) fn new(load: &LoadPath) -> Self {
        let k = load.num_parts();
        Self {
            value: vec![0.0; k],
            rate: vec![0.0; k],
        }
    }

    pub(super) fn set(&mut self, load: &LoadPath, parameters: &[f64]) {
        let mut k = self.value.len();
        if load.second.is_some() {
            k -= 1;
            self.value[k] = parameters.get(1).copied().unwrap_or(0.0);
            self.rate[k] = 1.0;
        }
        match &load.shape {
            Shape::Cases {
                amplitudes: Some(f), ..
            } => f(parameters[0], &mut self.value[..k], &mut self.rate[..k]),
            _ => {
                self.value[..k].fill(parameters[0]);
                self.rate[..k].fill(1.0);
            }
        }
    }
}

/// The state of the supports; `None` where all are at rest.
#[derive(Debug, Clone)]
pub(crate) struct SupportState(Option<Supports>);

impl SupportState {
    /// Displacements of the supports.
    pub(crate) fn displacements(&self) -> &[f64] {
        self.0.as_ref().map_or(&[], |s| &s.displacements)
    }

    /// Work of the forces that these supports put on the displacements u.
    pub(crate) fn force_work(&self, u: &[f64]) -> f64 {
        self.0.as_ref().map_or(0.0, |s| crate::sparse::dot(&s.forces, u))
    }

    /// Reactions of these supports at u = 0 times the displacements of others: symmetric.
    pub(crate) fn pairing(&self, other: &Self) -> f64 {
        match (&self.0, &other.0) {
            (Some(a), Some(b)) => crate::sparse::dot(&a.reactions, &b.displacements),
            _ => 0.0,
        }
    }
}

/// y += c x.
pub(super) fn add(c: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += c * x;
    }
}
