//! Laws of friction at contact nodes.

use std::sync::Arc;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyTuple};
use semismooth::contact::{
    self, FrictionCoefficient, FrictionCurve, Frictionless, NodeLaw, OrthotropicCoulomb, PlanarCoulomb,
};

use crate::arrays::{counted, vector};
use crate::errors::raised;
use crate::map::smooth;
use crate::names::number;
use crate::saving::Made;

pub(crate) type Law = Arc<dyn NodeLaw + Send + Sync>;

/// A coefficient of friction F = ``value`` + parameter · ``rate``: each a number, or an array of shape (p,) for p contact nodes.
///
/// See :meth:`table`, :meth:`exponential` and :meth:`function` for coefficients that depend on the slip ‖u_t‖, and :meth:`scaled`.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Friction {
    pub(crate) made: Made,
    coefficient: FrictionCoefficient,
    /// F as a function of the slip, where it depends on nothing else.
    curve: Option<FrictionCurve>,
}

impl Friction {
    fn of(curve: FrictionCurve, made: Made) -> Self {
        Self {
            made,
            coefficient: FrictionCoefficient::uniform(curve.clone()),
            curve: Some(curve),
        }
    }

    /// From an object of this class, a number or an array.
    fn coefficient(object: &Bound<'_, PyAny>) -> PyResult<FrictionCoefficient> {
        match object.cast::<Self>() {
            Ok(friction) => Ok(friction.get().coefficient.clone()),
            Err(_) => Ok(Self::new(object, None)?.coefficient),
        }
    }
}

#[pymethods]
impl Friction {
    #[new]
    #[pyo3(signature = (value, rate=None))]
    fn new(value: &Bound<'_, PyAny>, rate: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let made = Made::by(value.py(), "new", &[value], &[("rate", rate)])?;
        let (constant, slope) = (value.extract::<f64>(), rate.map(|r| r.extract::<f64>()));
        let affine = match (constant, slope) {
            (Ok(constant), None) => {
                return Ok(Self::of(FrictionCurve::constant(constant).map_err(raised)?, made));
            }
            (Ok(constant), Some(Ok(slope))) => {
                let coefficient =
                    FrictionCoefficient::of_parameter(move |_, a| [constant + a * slope, slope]);
                return match constant.is_finite() && slope.is_finite() {
                    true => Ok(Self {
                        made,
                        coefficient,
                        curve: None,
                    }),
                    false => Err(PyValueError::new_err(
                        "the coefficient of friction must be finite",
                    )),
                };
            }
            (Ok(constant), Some(Err(_))) => {
                let rate = vector(rate.unwrap_or(value), "rate")?;
                FrictionCoefficient::affine(vec![constant; rate.len()], rate)
            }
            (Err(_), None) => FrictionCoefficient::nodal(vector(value, "the coefficient of friction")?),
            (Err(_), Some(slope)) => {
                let constant = vector(value, "the coefficient of friction")?;
                let slope = match (slope, rate) {
                    (Err(_), Some(rate)) => vector(rate, "rate")?,
                    (slope, _) => vec![slope.unwrap_or(0.0); constant.len()],
                };
                FrictionCoefficient::affine(constant, slope)
            }
        };
        Ok(Self {
            made,
            coefficient: affine.map_err(raised)?,
            curve: None,
        })
    }

    /// Monotone cubic interpolation of the coefficients ``values`` at the slips ``slips`` ≥ 0, increasing, both of shape (k,); constant
    /// outside (Fritsch and Carlson 1980).
    #[staticmethod]
    fn table(slips: &Bound<'_, PyAny>, values: &Bound<'_, PyAny>) -> PyResult<Self> {
        let made = Made::by(slips.py(), "table", &[slips, values], &[])?;
        let (slips, values) = (vector(slips, "slips")?, vector(values, "values")?);
        if slips.len() != values.len() {
            return Err(PyValueError::new_err(format!(
                "{} slips with {} values",
                slips.len(),
                values.len()
            )));
        }
        let points: Vec<_> = slips.into_iter().zip(values).collect();
        Ok(Self::of(FrictionCurve::table(&points).map_err(raised)?, made))
    }

    /// last + (first − last) exp(−slip / length).
    #[staticmethod]
    fn exponential(py: Python<'_>, first: f64, last: f64, length: f64) -> PyResult<Self> {
        let [a, b, c] = [first, last, length].map(|v| PyFloat::new(py, v).into_any());
        let made = Made::by(py, "exponential", &[&a, &b, &c], &[])?;
        let curve = FrictionCurve::exponential(first, last, length).map_err(raised)?;
        Ok(Self::of(curve, made))
    }

    /// Any smooth coefficient: ``function(slip, parameter)``, traced (see :func:`trace`), without kinks, for slips ≥ 0.
    #[staticmethod]
    fn function(function: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = function.py();
        let wrapped = py
            .import("semismooth._functions")?
            .call_method1("of_two", (function,))?;
        let map = smooth(&wrapped, 2, "the coefficient of friction")?;
        // The formula, which can be saved where the function cannot.
        let made = Made::by(py, "function", &[map.bind(py)], &[])?;
        let coefficient = FrictionCoefficient::function(move |_, slip, alpha| {
            let (value, gradient) = map.get().value_and_gradient(&[slip, alpha]);
            [value, gradient[0], gradient[1]]
        });
        Ok(Self {
            made,
            coefficient,
            curve: None,
        })
    }

    /// The coefficient times the parameter, for one that depends on the slip alone or is constant: α F(‖u_t‖).
    fn scaled(slf: &Bound<'_, Self>) -> PyResult<Self> {
        let curve = slf.get().curve.clone().ok_or_else(|| {
            PyValueError::new_err(
                "only a coefficient that depends on the slip alone can be scaled by the parameter",
            )
        })?;
        Ok(Self {
            made: Made::from(slf, "scaled", &[])?,
            coefficient: FrictionCoefficient::scaled(curve),
            curve: None,
        })
    }

    fn __repr__(&self) -> String {
        let value = number(self.coefficient.value(0, 0.0, 0.0)[0], &[]);
        let law = if self.curve.is_some() {
            ""
        } else {
            " of the first node, at parameter 0.0"
        };
        format!("<Friction: {value} without slip{law}>")
    }

    /// F at a slip and a parameter, of a contact node.
    #[pyo3(signature = (slip=0.0, parameter=0.0, node=0))]
    fn __call__(&self, slip: f64, parameter: f64, node: usize) -> f64 {
        self.coefficient.value(node, slip, parameter)[0]
    }
}

/// Friction with a given bound (Tresca), whatever the pressure: ‖λt‖ ≤ ``bound`` at each contact node, a nodal force, and λt = bound · u_t/‖u_t‖
/// where it slips. The problem is then that of a convex energy.
///
/// Parameters
/// ----------
/// bound : number or array of shape (p,)
///     At least 0.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct GivenBound {
    pub(crate) made: Made,
    bounds: Vec<f64>,
    /// Whether there is one number for all nodes.
    uniform: bool,
}

#[pymethods]
impl GivenBound {
    fn __repr__(&self) -> String {
        match self.bounds[..] {
            [bound] if self.uniform => format!("<GivenBound: {bound:?}>"),
            _ => format!("<GivenBound of {}>", counted(self.bounds.len(), "node")),
        }
    }

    #[new]
    fn new(bound: &Bound<'_, PyAny>) -> PyResult<Self> {
        let made = Made::by(bound.py(), "new", &[bound], &[])?;
        Ok(match bound.extract::<f64>() {
            Ok(bound) => Self {
                made,
                bounds: vec![bound],
                uniform: true,
            },
            Err(_) => Self {
                made,
                bounds: vector(bound, "the bound of friction")?,
                uniform: false,
            },
        })
    }
}

impl GivenBound {
    fn law(&self, dim: usize, nodes: usize) -> PyResult<contact::GivenBound> {
        if !self.uniform && self.bounds.len() != nodes {
            return Err(PyValueError::new_err(format!(
                "{} bounds of friction for {nodes} contact nodes",
                self.bounds.len()
            )));
        }
        let bounds = match self.uniform {
            true => vec![self.bounds[0]; nodes],
            false => self.bounds.clone(),
        };
        let coefficients = vec![[1.0; 2]; bounds.len()];
        contact::GivenBound::new(dim - 1, bounds, coefficients).map_err(raised)
    }
}

/// Coulomb friction up to a limit of the shear stress: ‖λt‖ ≤ min(F λν, ``limit``), isotropic.
///
/// Parameters
/// ----------
/// friction : number or array of shape (p,)
///     The coefficient F ≥ 0.
/// limit : number or array of shape (p,)
///     A force per area (in the plane per length), at least 0; a nodal force where the problem is given by matrices.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct LimitedShear {
    pub(crate) made: Made,
    friction: PerNode,
    limit: PerNode,
}

#[pymethods]
impl LimitedShear {
    #[new]
    fn new(friction: &Bound<'_, PyAny>, limit: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self {
            made: Made::by(friction.py(), "new", &[friction, limit], &[])?,
            friction: PerNode::of(friction, "the coefficient of friction")?,
            limit: PerNode::of(limit, "the limit of shear")?,
        })
    }

    fn __repr__(&self) -> String {
        format!("<LimitedShear: friction {}, limit {}>", self.friction, self.limit)
    }
}

/// Cohesion: the law of ``friction`` with λν + T in place of λν, so that the bound is F (λν + T) = c + F λν with c = F T, down to the apex
/// λν = −T. A node that opens bears the tension T at any distance.
///
/// Parameters
/// ----------
/// friction : number, array of shape (p,), Friction, a pair of them, LimitedShear, or None
/// tension : number or array of shape (p,)
///     T ≥ 0, a force per area (in the plane per length); a nodal force where the problem is given by matrices.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Cohesion {
    pub(crate) made: Made,
    friction: Option<Py<PyAny>>,
    tension: PerNode,
}

#[pymethods]
impl Cohesion {
    #[new]
    fn new(friction: Option<&Bound<'_, PyAny>>, tension: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = tension.py();
        let none = py.None().into_bound(py);
        Ok(Self {
            made: Made::by(py, "new", &[friction.unwrap_or(&none), tension], &[])?,
            friction: friction.map(|f| f.clone().unbind()),
            tension: PerNode::of(tension, "the tension")?,
        })
    }

    fn __repr__(&self) -> String {
        format!("<Cohesion: tension {}>", self.tension)
    }
}

/// Wear (Archard 1953): the law of ``friction`` at a gap that grows at the end of each level of :func:`evolve`, by ``coefficient`` times
/// pressure times slip, k p s. The depth is the last column of :attr:`EvolutionStep.history`.
///
/// Parameters
/// ----------
/// friction : number, array of shape (p,), Friction, a pair of them, GivenBound, LimitedShear, Cohesion, Bonded, or None
/// coefficient : number or array of shape (p,)
///     k ≥ 0, an area per force; where the problem is given by matrices 1 per nodal force.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Wear {
    pub(crate) made: Made,
    friction: Option<Py<PyAny>>,
    coefficient: PerNode,
}

#[pymethods]
impl Wear {
    #[new]
    fn new(friction: Option<&Bound<'_, PyAny>>, coefficient: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = coefficient.py();
        let none = py.None().into_bound(py);
        Ok(Self {
            made: Made::by(py, "new", &[friction.unwrap_or(&none), coefficient], &[])?,
            friction: friction.map(|f| f.clone().unbind()),
            coefficient: PerNode::of(coefficient, "the coefficient of wear")?,
        })
    }

    fn __repr__(&self) -> String {
        format!("<Wear: coefficient {}>", self.coefficient)
    }
}

/// Nodes glued to what they touch, whatever the forces. With ``stiffness`` of :class:`ContactProblem` an elastic bond.
#[pyclass(frozen, module = "semismooth")]
pub(crate) struct Bonded {
    pub(crate) made: Made,
}

#[pymethods]
impl Bonded {
    #[new]
    fn new(py: Python<'_>) -> PyResult<Self> {
        let made = Made::by(py, "new", &[], &[])?;
        Ok(Self { made })
    }

    fn __repr__(&self) -> &'static str {
        "<Bonded>"
    }
}

/// One number for all contact nodes, or one each.
pub(crate) enum PerNode {
    Uniform(f64),
    Each(Vec<f64>),
}

impl PerNode {
    pub(crate) fn of(object: &Bound<'_, PyAny>, what: &str) -> PyResult<Self> {
        Ok(match object.extract::<f64>() {
            Ok(value) => Self::Uniform(value),
            Err(_) => Self::Each(vector(object, what)?),
        })
    }

    /// The values at p nodes.
    pub(crate) fn at(&self, nodes: usize, what: &str) -> PyResult<Vec<f64>> {
        match self {
            Self::Uniform(value) => Ok(vec![*value; nodes]),
            Self::Each(values) if values.len() == nodes => Ok(values.clone()),
            Self::Each(values) => Err(PyValueError::new_err(format!(
                "{what} has {} values for {nodes} contact nodes",
                values.len()
            ))),
        }
    }

    /// Times the areas of the nodes.
    fn over(&self, areas: &[f64], what: &str) -> PyResult<Vec<f64>> {
        let values = self.at(areas.len(), what)?;
        Ok(values.iter().zip(areas).map(|(v, a)| v * a).collect())
    }
}

impl std::fmt::Display for PerNode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Uniform(value) => write!(f, "{value:?}"),
            Self::Each(values) => write!(f, "of {}", counted(values.len(), "node")),
        }
    }
}

/// The law of a problem from its argument `friction`: `None`, a number, an array, a pair of coefficients in space, or an object. `areas` are
/// those of the contact nodes.
pub(crate) fn law(friction: Option<&Bound<'_, PyAny>>, dim: usize, areas: &[f64]) -> PyResult<Law> {
    let nodes = areas.len();
    let Some(friction) = friction else {
        return Ok(match dim {
            2 => Arc::new(Frictionless::plane()),
            _ => Arc::new(Frictionless::space()),
        });
    };
    if let (3, Ok(pair)) = (dim, friction.cast::<PyTuple>()) {
        let (first, second): (Bound<'_, PyAny>, Bound<'_, PyAny>) = pair.extract()?;
        let [first, second] = [Friction::coefficient(&first)?, Friction::coefficient(&second)?];
        return Ok(Arc::new(OrthotropicCoulomb::new(first, second)));
    }
    if let Ok(bound) = friction.cast::<GivenBound>() {
        return Ok(Arc::new(bound.get().law(dim, nodes)?));
    }
    if let Ok(limited) = friction.cast::<LimitedShear>() {
        let own = limited.get();
        let coefficients = own.friction.at(nodes, "the coefficient of friction")?;
        let limits = own.limit.over(areas, "the limit of shear")?;
        let law = contact::LimitedShear::new(dim - 1, coefficients, limits);
        return Ok(Arc::new(law.map_err(raised)?));
    }
    if let Ok(cohesion) = friction.cast::<Cohesion>() {
        let own = cohesion.get();
        let inner = own.friction.as_ref().map(|f| f.bind(friction.py()));
        let tension = own.tension.over(areas, "the tension")?;
        let law = contact::Cohesive::new(law(inner, dim, areas)?, tension);
        return Ok(Arc::new(law.map_err(raised)?));
    }
    if let Ok(wear) = friction.cast::<Wear>() {
        let own = wear.get();
        let inner = own.friction.as_ref().map(|f| f.bind(friction.py()));
        let coefficients = own.coefficient.at(nodes, "the coefficient of wear")?;
        let rates = coefficients.iter().zip(areas).map(|(k, a)| k / a).collect();
        let law = contact::Worn::new(law(inner, dim, areas)?, rates);
        return Ok(Arc::new(law.map_err(raised)?));
    }
    if friction.cast::<Bonded>().is_ok() {
        return Ok(match dim {
            2 => Arc::new(contact::Bonded::plane()),
            _ => Arc::new(contact::Bonded::space()),
        });
    }
    let coefficient = Friction::coefficient(friction)?;
    Ok(match dim {
        2 => Arc::new(PlanarCoulomb::new(coefficient)),
        _ => Arc::new(OrthotropicCoulomb::isotropic(coefficient)),
    })
}

/// The same law with a second parameter that is added to the coefficient of friction; none where the law is not Coulomb's with one
/// coefficient at each node.
pub(crate) fn shifted(
    friction: Option<&Bound<'_, PyAny>>,
    dim: usize,
    nodes: usize,
) -> PyResult<Option<Law>> {
    let Some(friction) = friction else {
        return Ok(None);
    };
    let other = friction.cast::<PyTuple>().is_ok()
        || friction.cast::<GivenBound>().is_ok()
        || friction.cast::<LimitedShear>().is_ok()
        || friction.cast::<Cohesion>().is_ok()
        || friction.cast::<Wear>().is_ok()
        || friction.cast::<Bonded>().is_ok();
    if other {
        return Ok(None);
    }
    let coefficient = Friction::coefficient(friction)?.with_second(vec![1.0; nodes]);
    let coefficient = coefficient.map_err(raised)?;
    Ok(Some(match dim {
        2 => Arc::new(PlanarCoulomb::new(coefficient)),
        _ => Arc::new(OrthotropicCoulomb::isotropic(coefficient)),
    }))
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Friction>()?;
    module.add_class::<GivenBound>()?;
    module.add_class::<LimitedShear>()?;
    module.add_class::<Cohesion>()?;
    module.add_class::<Wear>()?;
    module.add_class::<Bonded>()
}
