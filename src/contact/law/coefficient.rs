//! Coefficients of friction as functions of the slip.

use std::fmt;
use std::sync::Arc;

use super::LocalValues;
use crate::InputError;
use crate::contact::ContactError;
use crate::input::{check_finite, check_vector};

type CurveFunction = Arc<dyn Fn(f64) -> (f64, f64) + Send + Sync>;
type ParameterFunction = Arc<dyn Fn(usize, f64) -> [f64; 2] + Send + Sync>;
type NodeFunction = Arc<dyn Fn(usize, f64, f64) -> [f64; 3] + Send + Sync>;

/// A coefficient of friction F(ξ) against the slip ξ = ‖u_t‖ ≥ 0.
///
/// In the static problem u_t is the whole tangential displacement. In a history of loading ([`evolve`](crate::contact::evolve)) slips are
/// measured anew in each level, and ξ is the slip accumulated over this level and all before it: Σ ‖Δu_t‖.
///
/// ```
/// use semismooth::contact::FrictionCurve;
/// let f = FrictionCurve::exponential(0.4, 0.1, 0.005)?; // 0.1 + 0.3 exp(−ξ/0.005)
/// assert!((f.value(0.0).0 - 0.4).abs() < 1e-15 && f.value(0.0).1 < 0.0);
/// let table = FrictionCurve::table(&[(0.0, 0.4), (0.01, 0.2), (0.02, 0.2)])?;
/// assert_eq!(table.value(1.0), (0.2, 0.0)); // constant beyond the last point
/// # Ok::<(), semismooth::contact::ContactError>(())
/// ```
#[derive(Clone)]
pub struct FrictionCurve(Curve);

#[derive(Clone)]
enum Curve {
    Constant(f64),
    Exponential { first: f64, last: f64, length: f64 },
    Table(Arc<[[f64; 3]]>),
    Function(CurveFunction),
}

impl fmt::Debug for FrictionCurve {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Curve::Constant(c) => f.debug_tuple("Constant").field(c).finish(),
            Curve::Exponential { first, last, length } => f
                .debug_struct("Exponential")
                .field("first", first)
                .field("last", last)
                .field("length", length)
                .finish(),
            Curve::Table(points) => f.debug_tuple("Table").field(points).finish(),
            Curve::Function(_) => f.write_str("Function"),
        }
    }
}

impl FrictionCurve {
    /// F(ξ) = value.
    ///
    /// # Errors
    /// Values below 0 or not finite.
    pub fn constant(value: f64) -> Result<Self, ContactError> {
        check(value, 0.0)?;
        Ok(Self(Curve::Constant(value)))
    }

    /// F(ξ) = last + (first − last) exp(−ξ/length).
    ///
    /// # Errors
    /// Values below 0 or not finite, a length that is not positive.
    pub fn exponential(first: f64, last: f64, length: f64) -> Result<Self, ContactError> {
        check(first, 0.0)?;
        check(last, f64::INFINITY)?;
        if !(length > 0.0 && length.is_finite()) {
            return Err(ContactError::Invalid {
                what: format!("the length of decay is {length}; it must be positive and finite"),
            });
        }
        Ok(Self(Curve::Exponential { first, last, length }))
    }

    /// Monotone cubic interpolation of (ξ, F) pairs (F. Fritsch, R. Carlson, 1980) with the harmonic means of the secants as slopes
    /// (J. Butland, 1980), constant outside the table: no overshoot, so F ≥ 0 everywhere if it is at the points.
    ///
    /// # Errors
    /// No points, ξ that do not increase or are negative, F below 0 or not finite.
    pub fn table(points: &[(f64, f64)]) -> Result<Self, ContactError> {
        if points.is_empty() {
            return Err(ContactError::Empty {
                what: "a table of the coefficient of friction needs at least one point",
            });
        }
        for (k, &(slip, value)) in points.iter().enumerate() {
            check(value, slip)?;
            if !(slip >= 0.0 && slip.is_finite() && (k == 0 || slip > points[k - 1].0)) {
                return Err(ContactError::Invalid {
                    what: format!("slips of a table must increase from 0: point {k} is at {slip}"),
                });
            }
        }
        let secants: Vec<f64> = points
            .windows(2)
            .map(|w| (w[1].1 - w[0].1) / (w[1].0 - w[0].0))
            .collect();
        let n = points.len();
        let rows: Vec<[f64; 3]> = (0..n)
            .map(|k| {
                // Flat ends join the constants outside; the harmonic mean of the secants inside keeps each piece monotone.
                let slope = if k == 0 || k + 1 == n || secants[k - 1] * secants[k] <= 0.0 {
                    0.0
                } else {
                    2.0 / (1.0 / secants[k - 1] + 1.0 / secants[k])
                };
                [points[k].0, points[k].1, slope]
            })
            .collect();
        Ok(Self(Curve::Table(rows.into())))
    }

    /// Any curve: `function(ξ)` gives F and F' for ξ ≥ 0. It must be finite, continuously differentiable and ≥ 0.
    #[must_use]
    pub fn function(function: impl Fn(f64) -> (f64, f64) + Send + Sync + 'static) -> Self {
        Self(Curve::Function(Arc::new(function)))
    }

    /// F(ξ) and F'(ξ). For ξ < 0, where selections are evaluated beyond their cells, a smooth continuation that stays positive:
    /// F(−ξ) + 2 F'(0) ξ where F'(0) ≤ 0, which has the curvature of F, too; a hyperbola otherwise.
    #[must_use]
    pub fn value(&self, slip: f64) -> (f64, f64) {
        if let Curve::Constant(c) = self.0 {
            return (c, 0.0);
        }
        if slip < 0.0 {
            let [f, by_slip, _] = continued(of_slip(self, 0.0), of_slip(self, -slip), slip);
            return (f, by_slip);
        }
        match &self.0 {
            Curve::Constant(c) => (*c, 0.0),
            Curve::Exponential { first, last, length } => {
                let decay = (first - last) * (-slip / length).exp();
                (last + decay, -decay / length)
            }
            Curve::Table(points) => {
                let (begin, end) = (points[0], points[points.len() - 1]);
                if slip <= begin[0] {
                    return (begin[1], 0.0);
                }
                if slip >= end[0] {
                    return (end[1], 0.0);
                }
                if slip.is_nan() {
                    return (f64::NAN, f64::NAN);
                }
                let k = points.partition_point(|p| p[0] <= slip);
                let ([x0, y0, s0], [x1, y1, s1]) = (points[k - 1], points[k]);
                let h = x1 - x0;
                let t = (slip - x0) / h;
                let (t2, t3) = (t * t, t * t * t);
                let value = (2.0 * t3 - 3.0 * t2 + 1.0) * y0
                    + (t3 - 2.0 * t2 + t) * h * s0
                    + (3.0 * t2 - 2.0 * t3) * y1
                    + (t3 - t2) * h * s1;
                let slope = (6.0 * t2 - 6.0 * t) * (y0 - y1) / h
                    + (3.0 * t2 - 4.0 * t + 1.0) * s0
                    + (3.0 * t2 - 2.0 * t) * s1;
                (value, slope)
            }
            Curve::Function(f) => f(slip),
        }
    }

    /// The curve multiplied by a factor ≥ 0.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        let own = self.clone();
        Self::function(move |slip| {
            let (value, slope) = own.value(slip);
            (factor * value, factor * slope)
        })
    }

    fn is_constant(&self) -> bool {
        matches!(self.0, Curve::Constant(_))
    }
}

/// F and its derivatives with respect to slip and α at a slip ξ < 0, from those at 0 and at |ξ|.
///
/// Were F negative there, a node could lie in the cells of both slip directions. Curves of folds end at slip 0 and use second derivatives.
/// As ∂F'/∂α is not known, the derivative with respect to α is exact only to first order in the slip.
fn continued(zero: [f64; 3], mirrored: [f64; 3], slip: f64) -> [f64; 3] {
    let [value, slope, rate] = zero;
    if slope <= 0.0 {
        return [
            mirrored[0] + 2.0 * slope * slip,
            2.0 * slope - mirrored[1],
            2.0 * rate - mirrored[2],
        ];
    }
    if value <= 0.0 {
        return [0.0; 3];
    }
    let shrink = 1.0 / (1.0 - slope * slip / value);
    [
        value * shrink,
        slope * shrink * shrink,
        rate * shrink * (2.0 - shrink),
    ]
}

fn check(value: f64, slip: f64) -> Result<(), ContactError> {
    if value >= 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(ContactError::Invalid {
            what: format!(
                "the coefficient of friction at slip {slip} is {value}; it must be finite and not negative"
            ),
        })
    }
}

/// A coefficient of friction F(xᵢ, ‖u_t‖, α) for all contact nodes.
#[derive(Clone)]
pub struct FrictionCoefficient {
    shape: Shape,
    factor: f64,
    /// F₂ at each node: with a second parameter β the coefficient is F + β F₂.
    second: Option<Arc<[f64]>>,
    /// Number of nodes; `None`: any.
    nodes: Option<usize>,
}

#[derive(Clone)]
enum Shape {
    Uniform(FrictionCurve),
    /// The last one for nodes beyond the list.
    PerNode {
        curves: Arc<[FrictionCurve]>,
        constant: bool,
    },
    /// Constants and slopes of F = c + α s, an entry a node.
    Affine(Arc<[[f64; 2]]>),
    OfParameter(ParameterFunction),
    Scaled(FrictionCurve),
    Function(NodeFunction),
}

impl fmt::Debug for FrictionCoefficient {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FrictionCoefficient")
            .field("depends_on_parameter", &self.depends_on_parameter())
            .finish_non_exhaustive()
    }
}

impl FrictionCoefficient {
    fn new(shape: Shape) -> Self {
        Self {
            shape,
            factor: 1.0,
            second: None,
            nodes: None,
        }
    }

    /// One curve at all nodes.
    #[must_use]
    pub fn uniform(curve: FrictionCurve) -> Self {
        Self::new(Shape::Uniform(curve))
    }

    /// The same constant F at all nodes.
    ///
    /// # Errors
    /// Values below 0 or not finite.
    pub fn constant(value: f64) -> Result<Self, ContactError> {
        Ok(Self::uniform(FrictionCurve::constant(value)?))
    }

    /// A constant for each node.
    ///
    /// # Errors
    /// No values, values below 0 or not finite.
    pub fn nodal(values: Vec<f64>) -> Result<Self, ContactError> {
        check_finite("the list of coefficients of friction", &values)?;
        if let Some(node) = values.iter().position(|v| *v < 0.0) {
            return Err(ContactError::NegativeFriction {
                node,
                parameter: 0.0,
                value: values[node],
            });
        }
        let nodes = Some(values.len());
        let curves = values.into_iter().map(FrictionCurve::constant);
        Ok(Self {
            nodes,
            ..Self::per_node(curves.collect::<Result<_, _>>()?)?
        })
    }

    /// `constant` + α `slope`, an entry a node. Where all slopes are 0 this is [`nodal`](Self::nodal); where F falls below 0, nodes have
    /// no solution in contact.
    ///
    /// # Errors
    /// No values, lists of different lengths, values that are not finite; constants below 0 where all slopes are 0.
    pub fn affine(constant: Vec<f64>, slope: Vec<f64>) -> Result<Self, ContactError> {
        check_vector(
            "the slopes of the coefficient of friction",
            &slope,
            constant.len(),
        )?;
        check_finite("the coefficient of friction", &constant)?;
        if constant.is_empty() || slope.iter().all(|s| *s == 0.0) {
            return Self::nodal(constant);
        }
        let line = constant.iter().zip(&slope).map(|(c, s)| [*c, *s]).collect();
        Ok(Self {
            nodes: Some(constant.len()),
            ..Self::new(Shape::Affine(line))
        })
    }

    /// Any coefficient that depends on node and parameter alone: `function(node, α)` gives F and ∂F/∂α, finite and continuous.
    #[must_use]
    pub fn of_parameter(function: impl Fn(usize, f64) -> [f64; 2] + Send + Sync + 'static) -> Self {
        Self::new(Shape::OfParameter(Arc::new(function)))
    }

    /// Adds β F₂, with a second parameter β and an entry of F₂ for each node.
    ///
    /// # Errors
    /// No values, values that are not finite.
    pub fn with_second(mut self, slope: Vec<f64>) -> Result<Self, ContactError> {
        check_finite("the friction of the second parameter", &slope)?;
        if slope.is_empty() {
            return Err(ContactError::Empty {
                what: "there is no friction of the second parameter",
            });
        }
        self.nodes = self.nodes.or(Some(slope.len()));
        if slope.iter().any(|s| *s != 0.0) {
            self.second = Some(slope.into());
        }
        Ok(self)
    }

    /// α F(ξ): the scale of friction as the parameter (ζ of Haslinger, Kučera, Vlach 2008).
    #[must_use]
    pub fn scaled(curve: FrictionCurve) -> Self {
        Self::new(Shape::Scaled(curve))
    }

    /// A curve for each node; the last one for nodes beyond the list.
    ///
    /// # Errors
    /// No curves.
    pub fn per_node(curves: Vec<FrictionCurve>) -> Result<Self, ContactError> {
        if curves.is_empty() {
            return Err(ContactError::Empty {
                what: "there are no curves of the coefficient of friction",
            });
        }
        Ok(Self::new(Shape::PerNode {
            constant: curves.iter().all(FrictionCurve::is_constant),
            curves: curves.into(),
        }))
    }

    /// Any coefficient: `function(node, ξ, α)` gives F, ∂F/∂ξ, ∂F/∂α. It must be continuously differentiable for ξ ≥ 0 and is
    /// continued to ξ < 0 as a [`FrictionCurve`] is. It counts as one that depends on ξ.
    #[must_use]
    pub fn function(function: impl Fn(usize, f64, f64) -> [f64; 3] + Send + Sync + 'static) -> Self {
        Self::new(Shape::Function(Arc::new(function)))
    }

    /// The same coefficient times a factor ≥ 0.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        let second = self.second.as_ref();
        Self {
            factor: factor * self.factor,
            second: second.map(|s| s.iter().map(|v| factor * v).collect()),
            ..self.clone()
        }
    }

    /// F, ∂F/∂ξ and ∂F/∂α of a node (at β = 0).
    #[must_use]
    pub fn value(&self, node: usize, slip: f64, alpha: f64) -> [f64; 3] {
        let own = match &self.shape {
            Shape::Uniform(curve) => of_slip(curve, slip),
            Shape::PerNode { curves, .. } => of_slip(&curves[node.min(curves.len() - 1)], slip),
            Shape::Affine(line) => {
                let [constant, slope] = line[node.min(line.len() - 1)];
                [constant + alpha * slope, 0.0, slope]
            }
            Shape::OfParameter(function) => {
                let [value, rate] = function(node, alpha);
                [value, 0.0, rate]
            }
            Shape::Scaled(curve) => {
                let (value, slope) = curve.value(slip);
                [alpha * value, alpha * slope, value]
            }
            Shape::Function(function) if slip < 0.0 => {
                continued(function(node, 0.0, alpha), function(node, -slip, alpha), slip)
            }
            Shape::Function(function) => function(node, slip, alpha),
        };
        let [value, slope, rate] = own;
        [self.factor * value, self.factor * slope, self.factor * rate]
    }

    /// F, ∂F/∂ξ, ∂F/∂α and ∂F/∂β at the slip of a level, to which that of the levels before is added.
    pub(super) fn at(&self, v: &LocalValues, slip: f64) -> [f64; 4] {
        let [value, slope, rate] = self.value(v.node, v.history[0] + slip, v.parameter);
        match &self.second {
            Some(second) => {
                let change = second[v.node.min(second.len() - 1)];
                [value + v.second * change, slope, rate, change]
            }
            None => [value, slope, rate, 0.0],
        }
    }

    /// Whether F depends on α, and may become negative.
    pub(super) fn depends_on_parameter(&self) -> bool {
        self.second.is_some() || !matches!(self.shape, Shape::Uniform(_) | Shape::PerNode { .. })
    }

    /// Number of nodes; `None`: any.
    pub(super) fn num_nodes(&self) -> Option<usize> {
        self.nodes
    }

    /// [c, s] where F = c + α s exactly at a node; `None` otherwise.
    pub(super) fn affine_at(&self, node: usize) -> Option<[f64; 2]> {
        match &self.shape {
            _ if self.is_constant() => Some([self.value(node, 0.0, 0.0)[0], 0.0]),
            // Factors would round coefficients.
            Shape::Affine(line) if self.second.is_none() && self.factor == 1.0 => line.get(node).copied(),
            _ => None,
        }
    }

    /// Whether F may depend on the slip.
    pub(super) fn depends_on_slip(&self) -> bool {
        match &self.shape {
            Shape::Uniform(curve) | Shape::Scaled(curve) => !curve.is_constant(),
            Shape::PerNode { constant, .. } => !constant,
            Shape::Affine(_) | Shape::OfParameter(_) => false,
            Shape::Function(_) => true,
        }
    }

    /// Whether F depends on the node alone.
    pub(super) fn is_constant(&self) -> bool {
        !self.depends_on_parameter() && !self.depends_on_slip()
    }
}

fn of_slip(curve: &FrictionCurve, slip: f64) -> [f64; 3] {
    let (value, slope) = curve.value(slip);
    [value, slope, 0.0]
}

/// Checks a coefficient at a point; where the law divides by it, it must be positive.
pub(super) fn check_coefficient(
    coefficient: &FrictionCoefficient,
    v: &LocalValues,
    positive: bool,
) -> Result<(), ContactError> {
    let values = coefficient.at(v, v.slip_norm());
    if values.iter().any(|f| !f.is_finite()) {
        return Err(ContactError::Input(InputError::NotFinite {
            what: "the coefficient of friction or a derivative of it, at node",
            index: v.node,
            value: values.into_iter().find(|f| !f.is_finite()).unwrap_or(f64::NAN),
        }));
    }
    let (node, parameter) = (v.node, v.parameter);
    match values[0] {
        value if value < 0.0 => Err(ContactError::NegativeFriction {
            node,
            parameter,
            value,
        }),
        0.0 if positive => Err(ContactError::NoFriction { node, parameter }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// c F has c times the values and derivatives of F, in each of its representations.
    #[test]
    fn multiples_are_multiples_in_every_form() {
        let line = FrictionCoefficient::affine(vec![0.2], vec![0.1]).unwrap();
        assert_eq!(line.affine_at(0), Some([0.2, 0.1]));
        let twice = line.times(2.0);
        let [value, slope, rate] = twice.value(0, 0.0, 3.0);
        assert!((value - 1.0).abs() < 1e-15 && slope == 0.0 && rate == 0.2);
        assert!(twice.affine_at(0).is_none_or(|l| l == [0.4, 0.2]));
        let v = LocalValues {
            second: 3.0,
            ..LocalValues::default()
        };
        let second = FrictionCoefficient::constant(0.25)
            .and_then(|c| c.with_second(vec![0.5]))
            .unwrap();
        assert_eq!(second.at(&v, 0.0), [1.75, 0.0, 0.0, 0.5]);
        assert_eq!(second.times(2.0).at(&v, 0.0), [3.5, 0.0, 0.0, 1.0]);
    }

    /// F = α + s for s ≥ 0, continued to s < 0 as α² / (α − s): positive there, with one slope at 0.
    #[test]
    fn continued_coefficients_have_their_derivatives() {
        let f = FrictionCoefficient::function(|_, s, alpha| [alpha + s, 1.0, 1.0]);
        for (alpha, s) in [(0.5_f64, -0.25_f64), (1.5, -4.0), (0.3, -1e-3)] {
            let [value, slope, rate] = f.value(0, s, alpha);
            let exact = [
                alpha * alpha / (alpha - s),
                (alpha / (alpha - s)).powi(2),
                alpha * (alpha - 2.0 * s) / (alpha - s).powi(2),
            ];
            for (found, exact) in [value, slope, rate].into_iter().zip(exact) {
                assert!((found - exact).abs() < 1e-15 * (1.0 + exact), "{found} {exact}");
            }
        }
    }

    /// Where F falls its continuation has the same curvature at 0, stays positive and has its derivatives.
    #[test]
    fn falling_coefficients_are_continued_with_their_curvature() {
        let exponential = FrictionCurve::exponential(0.8, 0.2, 0.1).unwrap();
        let table = FrictionCurve::table(&[(0.0, 0.9), (0.5, 0.3), (1.0, 0.1), (2.0, 0.05)]).unwrap();
        let function = FrictionCurve::function(|s| (1.0 / (1.0 + s), -(1.0 + s).powi(-2)));
        for curve in [exponential, table, function] {
            let curvature = |a: f64, b: f64| (curve.value(b).1 - curve.value(a).1) / (b - a);
            let (before, after) = (curvature(-1e-6, 0.0), curvature(0.0, 1e-6));
            assert!(
                (before - after).abs() < 1e-3 * after.abs(),
                "{curve:?} {before} {after}"
            );
            for s in [-1e-3, -0.1, -0.7, -5.0, -1e9] {
                let h = 1e-6 * f64::max(1.0, -s);
                let difference = (curve.value(s + h).0 - curve.value(s - h).0) / (2.0 * h);
                let (value, slope) = curve.value(s);
                assert!(value > 0.0 && (difference - slope).abs() < 1e-6, "{curve:?} {s}");
            }
        }
    }

    /// Between two points of a table values lie between theirs, also where it falls and rises again.
    #[test]
    fn tables_have_no_new_extrema() {
        let points = [(0.0, 1.0), (1.0, 0.5), (2.0, 0.7), (2.5, 0.7), (4.0, 0.1)];
        let curve = FrictionCurve::table(&points).unwrap();
        for pair in points.windows(2) {
            let [(a, f), (b, g)] = [pair[0], pair[1]];
            for k in 0..=20 {
                let value = curve.value(a + (b - a) * f64::from(k) / 20.0).0;
                assert!(
                    value >= f.min(g) - 1e-15 && value <= f.max(g) + 1e-15,
                    "{a} {k} {value}"
                );
            }
        }
    }
}
