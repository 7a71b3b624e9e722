/// One inequality of a cell: a test function of the site must have the given sign.
///
/// * `positive(k)`: θ_k > 0 inside the cell,
/// * `negative(k)`: θ_k < 0 inside the cell.
///
/// A *wall* is a facet without a piece beyond it: where it is violated the map is not defined, and a solution curve that reaches it
/// ends (a coefficient of friction that becomes negative, the argument of a logarithm).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Facet {
    test: u16,
    positive: bool,
    wall: bool,
}

impl Facet {
    /// θ_test > 0 inside the cell; `test` counts the test functions of the site from 0.
    #[must_use]
    pub const fn positive(test: u16) -> Self {
        Self {
            test,
            positive: true,
            wall: false,
        }
    }

    /// θ_test < 0 inside the cell.
    #[must_use]
    pub const fn negative(test: u16) -> Self {
        Self {
            test,
            positive: false,
            wall: false,
        }
    }

    /// The same facet as a wall.
    #[must_use]
    pub const fn wall(self) -> Self {
        Self { wall: true, ..self }
    }

    /// Which test function of the site, from 0.
    #[must_use]
    pub const fn test(self) -> usize {
        self.test as usize
    }

    /// Whether there is no piece beyond this facet.
    #[must_use]
    pub const fn is_wall(self) -> bool {
        self.wall
    }

    /// +1 if the test function is positive inside the cell, −1 if negative.
    #[must_use]
    pub const fn sign(self) -> f64 {
        if self.positive { 1.0 } else { -1.0 }
    }

    /// The signed test function: > 0 inside the cell, 0 on the facet, < 0 beyond it.
    #[must_use]
    pub fn margin(self, tests_of_site: &[f64]) -> f64 {
        match tests_of_site.get(self.test()) {
            Some(theta) => self.sign() * theta,
            None => f64::NAN,
        }
    }
}

/// The margin of a cell: the smallest signed test function over its facets; > 0 inside, 0 on the boundary, < 0 outside,
/// +∞ for a cell without facets.
#[must_use]
pub fn cell_margin(cell: &[Facet], tests_of_site: &[f64]) -> f64 {
    cell.iter()
        .map(|f| f.margin(tests_of_site))
        .fold(f64::INFINITY, |a, b| if b < a || b.is_nan() { b } else { a })
}
