//! Laws of contact at one node, in the plane and in space.

use std::sync::Arc;

use super::ContactState;
use crate::InputError;
use crate::contact::ContactError;
use crate::piecewise::Facet;

/// Quantities at one contact node, and the augmentation parameter.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LocalValues {
    /// The contact node, from 0.
    pub node: usize,
    /// u_ν − gap, ≤ 0 where admissible.
    pub penetration: f64,
    /// u_t less the reference: in a [history](crate::contact::evolve), the slip since the end of the level before. The second component is 0
    /// in the plane.
    pub slip: [f64; 2],
    /// λν ≥ 0.
    pub pressure: f64,
    /// λt; the second component is 0 in the plane.
    pub traction: [f64; 2],
    /// α.
    pub parameter: f64,
    /// β, the second parameter of a family; 0 where there is none.
    pub second: f64,
    /// History variables; 0 beyond [`NodeLaw::num_history`].
    pub history: [f64; MAX_HISTORY],
    /// r > 0.
    pub r: f64,
}

impl LocalValues {
    /// θ¹ = λν + r (u_ν − gap).
    #[must_use]
    pub fn theta1(&self) -> f64 {
        self.pressure + self.r * self.penetration
    }

    /// The derivatives of [`theta1`](Self::theta1).
    #[must_use]
    pub fn theta1_row(&self) -> LocalRow {
        LocalRow {
            penetration: self.r,
            pressure: 1.0,
            ..LocalRow::default()
        }
    }

    /// ‖u_t‖.
    #[must_use]
    pub fn slip_norm(&self) -> f64 {
        self.slip[0].hypot(self.slip[1])
    }

    /// The trial traction z_d = λt_d + r u_t,d, d = 0 or 1, and its derivatives; all 0 for another d.
    #[inline]
    #[must_use]
    pub fn trial_traction(&self, d: usize) -> (f64, LocalRow) {
        let at = |values: &[f64; 2]| values.get(d).copied().unwrap_or(0.0);
        let mut row = LocalRow::of_traction(d);
        row.add(self.r, &LocalRow::of_slip(d));
        (at(&self.traction) + self.r * at(&self.slip), row)
    }

    /// The normal residual H_ν = λν − (θ¹)₊ of a closed (−r (u_ν − gap)) or an open node (λν), and its derivatives.
    #[must_use]
    pub fn normal(&self, closed: bool) -> (f64, LocalRow) {
        let mut row = LocalRow::default();
        if closed {
            row.penetration = -self.r;
            (-self.r * self.penetration, row)
        } else {
            row.pressure = 1.0;
            (self.pressure, row)
        }
    }
}

/// Derivatives of a function of [`LocalValues`]; all 0 by default.
///
/// ```
/// use semismooth::contact::LocalRow;
/// // λt₁ + 5 u_t₁
/// let mut row = LocalRow::of_traction(0);
/// row.add(5.0, &LocalRow::of_slip(0));
/// assert_eq!((row.traction, row.slip), ([1.0, 0.0], [5.0, 0.0]));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct LocalRow {
    /// With respect to the penetration.
    pub penetration: f64,
    /// With respect to u_t.
    pub slip: [f64; 2],
    /// With respect to λν.
    pub pressure: f64,
    /// With respect to λt.
    pub traction: [f64; 2],
    /// With respect to α.
    pub parameter: f64,
    /// With respect to β.
    pub second: f64,
}

impl LocalRow {
    /// The derivatives of λt_d, d = 0 or 1; all 0 for another d.
    #[must_use]
    pub fn of_traction(d: usize) -> Self {
        Self {
            traction: [0, 1].map(|k| f64::from(u8::from(k == d))),
            ..Self::default()
        }
    }

    /// The derivatives of u_t,d, d = 0 or 1; all 0 for another d.
    #[must_use]
    pub fn of_slip(d: usize) -> Self {
        Self {
            slip: [0, 1].map(|k| f64::from(u8::from(k == d))),
            ..Self::default()
        }
    }

    /// The derivative in a direction of the values.
    pub(in crate::contact) fn along(&self, d: &Self) -> f64 {
        self.penetration * d.penetration
            + self.pressure * d.pressure
            + self.slip[0] * d.slip[0]
            + self.traction[0] * d.traction[0]
            + self.slip[1] * d.slip[1]
            + self.traction[1] * d.traction[1]
            + self.parameter * d.parameter
            + self.second * d.second
    }

    /// Adds `scale` times another row.
    pub fn add(&mut self, scale: f64, other: &Self) {
        self.penetration += scale * other.penetration;
        self.pressure += scale * other.pressure;
        self.parameter += scale * other.parameter;
        self.second += scale * other.second;
        for d in 0..2 {
            self.slip[d] += scale * other.slip[d];
            self.traction[d] += scale * other.traction[d];
        }
    }
}

/// Largest number of test functions of a law.
pub const MAX_TESTS: usize = 6;

/// Largest number of history variables of a law at a node.
pub const MAX_HISTORY: usize = 4;

/// Checks that a law fits a body; the constructors of all contact problems do so.
///
/// # Errors
/// [`ContactError::Tangents`] and [`InputError::Length`] where the law is for another number of tangential directions or contact nodes,
/// [`ContactError::Law`] where it has more than [`MAX_TESTS`] test functions or [`MAX_HISTORY`] history variables, no piece, or a piece
/// whose cell names a test function that does not exist.
///
/// ```
/// use semismooth::contact::{ContactError, Frictionless, check_law};
/// assert!(check_law(&Frictionless::space(), 2, 100).is_ok());
/// assert_eq!(check_law(&Frictionless::space(), 1, 100), Err(ContactError::Tangents { law: 2, body: 1 }));
/// ```
pub fn check_law<L: NodeLaw + ?Sized>(law: &L, tangents: usize, nodes: usize) -> Result<(), ContactError> {
    if law.num_tangents() != tangents {
        return Err(ContactError::Tangents {
            law: law.num_tangents(),
            body: tangents,
        });
    }
    if let Some(found) = law.num_nodes().filter(|found| *found != nodes) {
        return Err(ContactError::Input(InputError::Length {
            what: "the list of coefficients of friction",
            expected: nodes,
            found,
        }));
    }
    let within = |what, found, least, most| match found {
        found if found < least || found > most => Err(ContactError::Law {
            what,
            found,
            least,
            most,
        }),
        _ => Ok(()),
    };
    let (pieces, tests) = (law.num_pieces(), law.num_tests());
    within("pieces", pieces, 1, usize::from(u16::MAX))?;
    within("history variables", law.num_history(), 0, MAX_HISTORY)?;
    let facets = (0..pieces).flat_map(|piece| law.cell(piece));
    let named = facets.map(|facet| facet.test() + 1).max().unwrap_or(0);
    within("test functions", tests, named, MAX_TESTS)
}

/// A law of contact at one node: a finite list of smooth pieces, each with its cell.
///
/// Residuals come in the order normal, t₁, t₂ (in the plane the last is not used). Pieces and test functions obey the contract of
/// [`PiecewiseSmooth`](crate::piecewise::PiecewiseSmooth): pieces that share a facet agree on it. Normal residuals are those of
/// [`LocalValues::normal`], with the test function θ¹; tangential ones have to equal λt where θ¹ = 0. With z = λt + r u_t, a law λt = P(z)
/// with a projection P gives H_t = λt − P(z), which is −r u_t where P(z) = z (stick). All functions are pure, and rows hold the derivatives
/// with respect to all fields of [`LocalRow`]. [`check`](crate::piecewise::check) on a small problem finds wrong rows.
///
/// Laws whose pieces are affine ([`is_affine`](Self::is_affine)) have curves that are polygons and lists of all solutions
/// ([`all_solutions`](crate::enumeration::all_solutions)); in space slip may change its direction and is not affine: there
/// [`search_solutions`](crate::continuation::search_solutions) lists the solutions that it finds, without proof.
///
/// Planar friction that wears off with the slip accumulated over all levels before:
///
/// ```
/// use std::ops::ControlFlow;
/// use semismooth::contact::{
///     CondensedContact, ContactBody, EvolutionOptions, LoadPath, LocalRow, LocalValues, NodeLaw, evolve,
/// };
/// use semismooth::enumeration::{EnumerationOptions, all_solutions};
/// use semismooth::sparse::Matrix;
///
/// /// |λt| ≤ F λν, F = 0.2 + 0.4 exp(−s) with the slip s accumulated until the end of the level before.
/// struct Worn;
///
/// fn friction(history: &[f64]) -> f64 { 0.2 + 0.4 * (-history[0]).exp() }
///
/// impl NodeLaw for Worn {
///     fn num_tangents(&self) -> usize { 1 }
///     fn tests(&self, v: &LocalValues, out: &mut [f64]) {
///         let (z, bound) = (v.trial_traction(0).0, friction(&v.history) * v.theta1());
///         out[..3].copy_from_slice(&[v.theta1(), z - bound, z + bound]);
///     }
///     fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]) {
///         rows[0] = v.theta1_row();
///         for (row, sign) in rows[1..3].iter_mut().zip([-1.0, 1.0]) {
///             *row = v.trial_traction(0).1;
///             row.add(sign * friction(&v.history), &v.theta1_row());
///         }
///     }
///     fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3] {
///         let bound = friction(&v.history) * v.theta1();
///         let t = v.traction[0];
///         [v.normal(piece != 0).0, [t, -v.r * v.slip[0], t - bound, t + bound][piece], 0.0]
///     }
///     fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3] {
///         let mut tangential = LocalRow::of_traction(0);
///         match piece {
///             0 => {}
///             1 => { tangential = LocalRow::default(); tangential.add(-v.r, &LocalRow::of_slip(0)) }
///             _ => tangential.add([-1.0, 1.0][piece - 2] * friction(&v.history), &v.theta1_row()),
///         }
///         [v.normal(piece != 0).1, tangential, LocalRow::default()]
///     }
///     fn is_affine(&self) -> bool { true }
///     fn friction(&self, v: &LocalValues) -> [f64; 2] { [friction(&v.history); 2] }
///     fn affine_friction(&self, _node: usize, history: &[f64]) -> Option<[f64; 2]> { Some([friction(history), 0.0]) }
///     fn num_history(&self) -> usize { 1 }
///     fn update(&self, v: &LocalValues, history: &mut [f64]) { history[0] += v.slip_norm(); }
/// }
///
/// // One node of stiffness 1, pressed by 1 and pushed by α.
/// let trace = |row: [f64; 2]| Matrix::from_rows(&[row]);
/// let load = LoadPath::affine(vec![1.0, 0.0], vec![0.0, 1.0]);
/// let body = ContactBody::new(Matrix::identity(2), trace([1.0, 0.0])?, vec![trace([0.0, 1.0])?], load)?;
/// let mut problem = CondensedContact::new(body, Worn)?;
/// let start = problem.solve(0.0, None)?;
/// let steps = evolve(&mut problem, &start, &[1.0, 2.0], &EvolutionOptions::default(), |_| ControlFlow::Continue(()))?;
/// // It slips by 1 − F(0) = 0.4; then friction is F(0.4), and the whole slip 2 − F(0.4).
/// assert!((steps[0].history[0] - 0.4).abs() < 1e-12);
/// assert!((steps[1].history[0] - (2.0 - friction(&[0.4]))).abs() < 1e-12);
/// // The elastic energy changes from ½ 0.4² to half the square of that slip, including the jump where F drops.
/// assert!((steps[1].stored - (0.5 * steps[1].history[0].powi(2) - 0.08)).abs() < 1e-12);
/// // All solutions under the load at the end, and the proof that there are no others.
/// let set = all_solutions(&problem, 2.0, &EnumerationOptions::default())?;
/// assert!(set.solutions.len() == 1 && set.completeness.is_complete());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait NodeLaw {
    /// 1 in the plane, 2 in space.
    fn num_tangents(&self) -> usize;

    /// How many contact nodes the law is for; `None`: any.
    fn num_nodes(&self) -> Option<usize> {
        None
    }

    /// Number of pieces; piece 0 is the open node. By default those of Coulomb friction: open, stick, slip+ and slip− in the plane, open,
    /// stick and slip in space.
    fn num_pieces(&self) -> usize {
        if self.num_tangents() == 1 { 4 } else { 3 }
    }

    /// Number of test functions, at most [`MAX_TESTS`]. By default those of Coulomb friction with z = λt + r u_t and the bound g: θ¹, z − g
    /// and z + g in the plane, θ¹ and ‖z‖ − g in space.
    fn num_tests(&self) -> usize {
        if self.num_tangents() == 1 { 3 } else { 2 }
    }

    /// The cell of a piece. By default those of Coulomb friction with the test functions given at [`num_tests`](Self::num_tests).
    fn cell(&self, piece: usize) -> &'static [Facet] {
        const CELLS: [&[Facet]; 4] = [
            &[OPEN],
            &[CLOSED, Facet::negative(1), Facet::positive(2)],
            &[CLOSED, Facet::positive(1)],
            &[CLOSED, Facet::negative(2)],
        ];
        match (self.num_tangents(), piece) {
            (2, 1) => &CELLS[1][..2],
            _ => CELLS[piece.min(3)],
        }
    }

    /// Name of a piece; by default that of its state, without a side in space.
    fn piece_name(&self, piece: usize) -> &'static str {
        match (self.num_tangents(), piece) {
            (2, 2) => "slip",
            _ => ContactState::ALL[piece.min(3)].name(),
        }
    }

    /// The state of a node in a piece; by default that of Coulomb friction. Where slip in both directions is one piece,
    /// [`ContactState::slipping`] gives the side.
    fn state(&self, piece: usize, v: &LocalValues) -> ContactState {
        match (self.num_tangents(), piece) {
            (2, 2) => ContactState::slipping(v.traction[0]),
            _ => ContactState::ALL[piece.min(3)],
        }
    }

    /// Test functions.
    fn tests(&self, v: &LocalValues, out: &mut [f64]);

    /// Derivatives of the test functions.
    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]);

    /// Residuals H_ν, H_t of a piece.
    fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3];

    /// Derivatives of the residuals.
    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3];

    /// Whether all pieces and test functions are affine in the local values and α.
    fn is_affine(&self) -> bool {
        false
    }

    /// The coefficients of friction F₁, F₂ at a point (equal where the law is isotropic); 0 without friction.
    fn friction(&self, _v: &LocalValues) -> [f64; 2] {
        [0.0; 2]
    }

    /// Number of history variables at each node, at most [`MAX_HISTORY`]; all begin with 0.
    fn num_history(&self) -> usize {
        0
    }

    /// Updates the history variables of a node at the end of a load level, from the values there: slips are those of the level. The law
    /// must be rate-independent: levels are not times.
    fn update(&self, _v: &LocalValues, _history: &mut [f64]) {}

    /// Whether the coefficients of friction depend on the slip u_t of a level alone, without history variables;
    /// [`evolve`](crate::contact::evolve) measures slips level by level.
    fn depends_on_slip(&self) -> bool {
        false
    }

    /// Whether the law is Coulomb's with coefficients of friction that do not depend on the slip: only such a law has a Delassus form.
    fn is_coulomb(&self) -> bool {
        false
    }

    /// [c, s] of the coefficient of friction F = c + α s of a node, where the law is planar Coulomb friction
    /// with the pieces open, stick, slip+ and slip− and F depends on nothing else but the `history` of the
    /// node: contact is then [stated exactly](crate::piecewise::Structure::exact), and lists of solutions are
    /// proven. It must be the F of the residual: proofs are those of these numbers. Lists with points that do
    /// not solve the map are doubted ([`Doubt::Contradiction`](crate::enumeration::Doubt::Contradiction)),
    /// but nothing finds a solution that wrong numbers exclude.
    fn affine_friction(&self, _node: usize, _history: &[f64]) -> Option<[f64; 2]> {
        None
    }

    /// The tension T that a node bears where the law of [`affine_friction`](Self::affine_friction) is one for λν + T.
    fn tension(&self, _node: usize) -> f64 {
        0.0
    }

    /// The depth by which a node with these history variables is worn: its gap is wider by as much where the law of
    /// [`affine_friction`](Self::affine_friction) is stated exactly.
    fn wear(&self, _history: &[f64]) -> f64 {
        0.0
    }

    /// Checks coefficients at a point.
    ///
    /// # Errors
    /// Coefficients of friction that are negative (or zero, where the law divides by them) or not finite.
    fn check(&self, _v: &LocalValues) -> Result<(), ContactError> {
        Ok(())
    }
}

macro_rules! pointed_to {
    ($(fn $name:ident(&self $(, $arg:ident: $ty:ty)*) $(-> $out:ty)?;)*) => {
        /// A law behind a reference.
        impl<L: NodeLaw + ?Sized> NodeLaw for &L {
            $(fn $name(&self $(, $arg: $ty)*) $(-> $out)? { (**self).$name($($arg),*) })*
        }

        /// A law behind a shared pointer: one of several types, chosen at run time.
        impl<L: NodeLaw + ?Sized> NodeLaw for Arc<L> {
            $(fn $name(&self $(, $arg: $ty)*) $(-> $out)? { (**self).$name($($arg),*) })*
        }
    };
}

pointed_to! {
    fn num_tangents(&self) -> usize;
    fn num_nodes(&self) -> Option<usize>;
    fn num_pieces(&self) -> usize;
    fn num_tests(&self) -> usize;
    fn cell(&self, piece: usize) -> &'static [Facet];
    fn piece_name(&self, piece: usize) -> &'static str;
    fn tests(&self, v: &LocalValues, out: &mut [f64]);
    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]);
    fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3];
    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3];
    fn is_affine(&self) -> bool;
    fn friction(&self, v: &LocalValues) -> [f64; 2];
    fn num_history(&self) -> usize;
    fn update(&self, v: &LocalValues, history: &mut [f64]);
    fn depends_on_slip(&self) -> bool;
    fn is_coulomb(&self) -> bool;
    fn affine_friction(&self, node: usize, history: &[f64]) -> Option<[f64; 2]>;
    fn tension(&self, node: usize) -> f64;
    fn wear(&self, history: &[f64]) -> f64;
    fn check(&self, v: &LocalValues) -> Result<(), ContactError>;
    fn state(&self, piece: usize, v: &LocalValues) -> ContactState;
}

/// Methods of a law made of another one, `law`, at values that it changes, those of `inner`: those on pieces and residuals alone, or all that
/// do not depend on how it changes them.
macro_rules! of_inner_law {
    (pieces) => {
        fn num_tangents(&self) -> usize {
            self.law.num_tangents()
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

        fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3] {
            self.law.residual(piece, &self.inner(v))
        }

        fn is_affine(&self) -> bool {
            self.law.is_affine()
        }
    };
    () => {
        of_inner_law!(pieces);

        fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]) {
            self.law.test_rows(&self.inner(v), rows);
        }

        fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3] {
            self.law.rows(piece, &self.inner(v))
        }

        fn friction(&self, v: &LocalValues) -> [f64; 2] {
            self.law.friction(&self.inner(v))
        }

        fn depends_on_slip(&self) -> bool {
            self.law.depends_on_slip()
        }

        fn affine_friction(&self, node: usize, history: &[f64]) -> Option<[f64; 2]> {
            self.law.affine_friction(node, history)
        }

        fn check(&self, v: &LocalValues) -> Result<(), ContactError> {
            self.law.check(&self.inner(v))
        }
    };
}

pub(in crate::contact) use of_inner_law;

pub(super) const CLOSED: Facet = Facet::positive(0);
pub(super) const OPEN: Facet = Facet::negative(0);
