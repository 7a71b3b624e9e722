//! The equations that are solved in place of the problem, at one point: Φ(x, F(x)) = 0 with the penalised Fischer–Burmeister function or a
//! smoothed one, in equilibrated variables.

/// F, Φ and the derivatives of Φ, a component each.
#[derive(Debug, Clone)]
pub(super) struct Equations {
    /// Scaled values of F, proximal term included.
    pub(super) scaled: Vec<f64>,
    pub(super) phi: Vec<f64>,
    /// ∂Φ/∂x and ∂Φ/∂F.
    pub(super) by_x: Vec<f64>,
    pub(super) by_f: Vec<f64>,
    /// HᵀΦ with H = diag(∂Φ/∂x) + diag(∂Φ/∂F) J.
    pub(super) gradient: Vec<f64>,
    /// Centre of the proximal term.
    pub(super) centre: Vec<f64>,
    /// 1 for components at kinks of Φ, and J times that: the direction in which the derivative is taken there.
    pub(super) kinks: Vec<f64>,
    pub(super) rate: Vec<f64>,
}

impl Equations {
    pub(super) fn new(n: usize) -> Self {
        let zeros = || vec![0.0; n];
        Self {
            scaled: zeros(),
            phi: zeros(),
            by_x: zeros(),
            by_f: zeros(),
            gradient: zeros(),
            centre: zeros(),
            kinks: zeros(),
            rate: zeros(),
        }
    }
}
