//! A dictionary of affine forms: every form as a constant plus a combination of the columns, with sign constraints on both.

mod pivots;

use crate::clock::Deadline;
use crate::tolerances::HALF_DIGITS;

/// Coefficients below this multiple of their error bound count as zero.
const SAFETY: f64 = 64.0;
/// Size (in scaled units, summed over the columns) of the unknowns up to which a neglected coefficient is taken into account.
const RADIUS: f64 = 1e4;
/// Constants up to this size, in scaled units, are no evidence of a contradiction.
const CLEAR: f64 = 1e-9;

/// Error bound of a coefficient, in scaled units, beyond which a table is recomputed from its root.
pub(super) const VAGUE: f64 = 1e-11;

/// What is known of the sign of a form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sign {
    Free,
    Positive,
    Negative,
}

impl Sign {
    /// +1 for ≥ 0, −1 for ≤ 0, 0 for any.
    pub(super) fn factor(self) -> f64 {
        match self {
            Self::Free => 0.0,
            Self::Positive => 1.0,
            Self::Negative => -1.0,
        }
    }

    pub(super) fn of(factor: f64) -> Self {
        if factor >= 0.0 {
            Self::Positive
        } else {
            Self::Negative
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    Row(usize),
    Column(usize),
    /// Fixed at zero, or of no further interest.
    Gone,
}

/// An affine form of the unknowns, and a bound of the rounding error in its coefficients.
#[derive(Debug, Clone)]
pub(super) struct Form {
    pub(super) coefficients: Vec<f64>,
    pub(super) constant: f64,
    pub(super) error: f64,
}

/// The system is infeasible, beyond rounding: a variable whose row contradicts its sign constraint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Contradiction {
    pub(super) var: usize,
}

/// The dictionary. Variables are the forms, numbered as given, followed by the unknowns, which are free.
///
/// Elimination of an equality exchanges its form with a column and drops the column; feasibility of the sign constraints is
/// restored by exchanges of the same kind (the dual simplex method without costs, finally with Bland's rule), so that a child of a
/// search node starts from the basis of its parent.
#[derive(Debug, Clone)]
pub(super) struct Table {
    forms: usize,
    stride: usize,
    /// Variable of each row and of each column.
    rows: Vec<usize>,
    /// The active columns, followed by those fixed at zero where these are kept.
    columns: Vec<usize>,
    active: usize,
    keep: bool,
    /// Variables fixed at zero while they were columns.
    fixed: Vec<usize>,
    /// Rows of `stride` numbers: the constant, then the coefficients.
    data: Vec<f64>,
    error: Vec<f64>,
    place: Vec<Place>,
    sign: Vec<Sign>,
    scratch: Vec<f64>,
    pub(super) pivots: u64,
}

impl Table {
    pub(super) fn new<'f>(unknowns: usize, forms: impl Iterator<Item = &'f Form>) -> Self {
        let stride = unknowns + 1;
        let (mut data, mut error) = (Vec::new(), Vec::new());
        for form in forms {
            data.push(form.constant);
            data.extend_from_slice(&form.coefficients);
            error.push(form.error);
        }
        let count = error.len();
        let mut place: Vec<Place> = (0..count).map(Place::Row).collect();
        place.extend((0..unknowns).map(Place::Column));
        Self {
            forms: count,
            stride,
            rows: (0..count).collect(),
            columns: (count..count + unknowns).collect(),
            active: unknowns,
            keep: false,
            fixed: Vec::new(),
            data,
            error,
            sign: vec![Sign::Free; place.len()],
            place,
            scratch: Vec::new(),
            pivots: 0,
        }
    }

    /// Keeps the coefficients of columns that are fixed at zero, so that each row remains an identity between forms of the unknowns.
    pub(super) fn keep_fixed(&mut self) {
        self.keep = true;
    }

    /// The row of a variable: its constant, and its columns, fixed ones last, with their coefficients.
    pub(super) fn identity(&self, var: usize) -> Option<(f64, &[usize], usize, &[f64])> {
        let Place::Row(r) = self.place[var] else {
            return None;
        };
        let row = self.row(r);
        Some((row[0], &self.columns, self.active, &row[1..]))
    }

    /// Whether a variable is a column that is fixed at zero.
    pub(super) fn is_fixed(&self, var: usize) -> bool {
        self.columns[self.active..].contains(&var)
    }

    /// A copy without storage for dropped rows and columns.
    pub(super) fn compact(&self) -> Self {
        let width = self.width();
        let mut data = Vec::with_capacity(self.rows.len() * width);
        for r in 0..self.rows.len() {
            data.extend_from_slice(self.row(r));
        }
        Self {
            forms: self.forms,
            stride: width,
            rows: self.rows.clone(),
            columns: self.columns.clone(),
            active: self.active,
            keep: self.keep,
            fixed: self.fixed.clone(),
            data,
            error: self.error.clone(),
            place: self.place.clone(),
            sign: self.sign.clone(),
            scratch: Vec::new(),
            pivots: 0,
        }
    }

    /// The bound of rounding errors in the row of a variable; 0 for others.
    pub(super) fn error(&self, var: usize) -> f64 {
        match self.place[var] {
            Place::Row(r) => self.error[r],
            _ => 0.0,
        }
    }

    /// The largest bound of rounding errors in a row.
    pub(super) fn largest_error(&self) -> f64 {
        self.error.iter().fold(0.0, |m, e| m.max(*e))
    }

    /// The same dictionary, recomputed from its root: its error bounds, which grow with every exchange, are those of this basis and not
    /// those of the exchanges before it. `None` where the basis is singular to rounding.
    pub(super) fn reinverted(&self, root: &Self) -> Option<Self> {
        let mut nonbasic = vec![false; self.place.len()];
        for &var in self.active_columns().iter().chain(&self.fixed) {
            nonbasic[var] = true;
        }
        let mut table = root.with_columns(&nonbasic)?;
        for &var in &self.fixed[root.fixed.len()..] {
            let Place::Column(c) = table.place[var] else {
                return None;
            };
            table.drop_column(c);
        }
        for var in 0..self.place.len() {
            if self.place[var] == Place::Gone {
                table.forget(var);
            }
        }
        table.fixed.clone_from(&self.fixed);
        table.sign.clone_from(&self.sign);
        table.pivots += self.pivots;
        Some(table)
    }

    /// The dictionary whose columns are the given variables, as many as there are columns. `None` where that basis is singular to rounding.
    pub(super) fn with_columns(&self, wanted: &[bool]) -> Option<Self> {
        let mut table = self.compact();
        for c in 0..table.active {
            if wanted[table.columns[c]] {
                continue;
            }
            let entering = (0..table.rows.len()).filter(|&r| wanted[table.rows[r]]);
            let size = |r: &usize| table.row(*r)[1 + c].abs();
            let r = entering.max_by(|a, b| size(a).total_cmp(&size(b)))?;
            if size(&r) <= SAFETY * table.error[r] {
                return None;
            }
            table.exchange(r, c);
        }
        Some(table)
    }

    fn width(&self) -> usize {
        self.columns.len() + 1
    }

    fn row(&self, r: usize) -> &[f64] {
        &self.data[r * self.stride..r * self.stride + self.width()]
    }

    /// Numbers stored.
    pub(super) fn size(&self) -> usize {
        self.data.capacity() + self.error.len() + 2 * self.place.len() + self.sign.len()
    }

    /// Number of variables.
    pub(super) fn variables(&self) -> usize {
        self.place.len()
    }

    /// Number of columns: the remaining dimension.
    pub(super) fn dimension(&self) -> usize {
        self.active
    }

    fn active_columns(&self) -> &[usize] {
        &self.columns[..self.active]
    }

    pub(super) fn place(&self, var: usize) -> Place {
        self.place[var]
    }

    pub(super) fn sign(&self, var: usize) -> Sign {
        self.sign[var]
    }

    /// The form of a variable over the present columns, and whether it is one (a column is its own form).
    pub(super) fn form(&self, var: usize) -> Option<Form> {
        let Place::Row(r) = self.place[var] else {
            return None;
        };
        let row = self.row(r);
        Some(Form {
            constant: row[0],
            coefficients: row[1..=self.active].to_vec(),
            error: self.error[r],
        })
    }

    /// Adds the weighted sum of variables as a new row; returns its variable. Only before any search, since numbers of forms shift.
    pub(super) fn combination(&self, terms: &[(usize, f64)], constant: f64) -> Form {
        let mut sum = Form {
            coefficients: vec![0.0; self.active],
            constant,
            error: 0.0,
        };
        for &(var, factor) in terms {
            match self.place[var] {
                Place::Row(r) => {
                    sum.constant += factor * self.row(r)[0];
                    for (s, a) in sum.coefficients.iter_mut().zip(&self.row(r)[1..]) {
                        *s += factor * a;
                    }
                    sum.error = sum.error.max(factor.abs() * self.error[r]);
                }
                Place::Column(c) => sum.coefficients[c] += factor,
                Place::Gone => {}
            }
        }
        sum
    }

    /// Eliminates one more equality, given over the present columns.
    pub(super) fn fix_form(&mut self, form: &Form) -> Result<(), Contradiction> {
        let var = self.place.len();
        let r = self.rows.len();
        self.place.push(Place::Row(r));
        self.sign.push(Sign::Free);
        self.rows.push(var);
        self.error.push(form.error);
        self.data.resize(r * self.stride, 0.0);
        self.data.push(form.constant);
        self.data.extend_from_slice(&form.coefficients);
        self.data.resize((r + 1) * self.stride, 0.0);
        self.fix(var)
    }

    /// Sets a variable to zero.
    pub(super) fn fix(&mut self, var: usize) -> Result<(), Contradiction> {
        match self.place[var] {
            Place::Gone => {}
            Place::Column(c) => {
                self.fixed.push(var);
                self.drop_column(c);
            }
            Place::Row(r) => match self.largest(r) {
                Some(c) => {
                    self.exchange(r, c);
                    self.fixed.push(var);
                    self.drop_column(c);
                }
                None if self.row(r)[0].abs() > self.threshold(r) => return Err(Contradiction { var }),
                None => self.drop_row(r),
            },
        }
        self.place[var] = Place::Gone;
        Ok(())
    }

    /// Gives the column at a position a value.
    pub(super) fn set_column(&mut self, c: usize, value: f64) {
        for r in 0..self.rows.len() {
            let a = self.data[r * self.stride + 1 + c];
            self.data[r * self.stride] += value * a;
        }
        self.drop_column(c);
    }

    /// Constrains the sign of a variable; opposite constraints make it zero.
    pub(super) fn constrain(&mut self, var: usize, sign: Sign) -> Result<(), Contradiction> {
        if self.place[var] == Place::Gone {
            return Ok(());
        }
        match (self.sign[var], sign) {
            (_, Sign::Free) => Ok(()),
            (Sign::Free, _) => {
                self.sign[var] = sign;
                Ok(())
            }
            (old, new) if old == new => Ok(()),
            _ => self.fix(var),
        }
    }

    /// Drops a row that is not needed any more; a column has to stay.
    pub(super) fn forget(&mut self, var: usize) {
        if let Place::Row(r) = self.place[var] {
            self.drop_row(r);
        }
    }

    /// Restores the sign constraints of all rows; without a verdict after the time limit.
    pub(super) fn repair(&mut self, deadline: Deadline<'_>) -> Result<(), Contradiction> {
        self.repair_within(f64::INFINITY, deadline)
    }

    /// [`repair`](Self::repair) where a contradiction is proven from the forms themselves: error bounds only
    /// say which coefficients count as zero. In full tables they double with each exchange, and soon every
    /// coefficient would; they are kept below [`VAGUE`].
    pub(super) fn repair_uncertain(&mut self, deadline: Deadline<'_>) -> Result<(), Contradiction> {
        self.repair_within(VAGUE, deadline)
    }

    fn repair_within(&mut self, largest: f64, deadline: Deadline<'_>) -> Result<(), Contradiction> {
        let quick = 4 * (self.rows.len() + self.columns.len()) + 20;
        // Bland's rule terminates in exact arithmetic; with rounding a limit does, without a verdict.
        for step in 0..20 * quick {
            if deadline.is_over() {
                break;
            }
            let bland = step > quick;
            let Some(r) = self.violated(bland) else {
                return Ok(());
            };
            match self.entering(r, bland) {
                Some(c) => self.exchange(r, c),
                None => return Err(Contradiction { var: self.rows[r] }),
            }
            self.error.iter_mut().for_each(|e| *e = e.min(largest));
        }
        Ok(())
    }

    /// Whether a variable can be ≥ 0 and whether it can be ≤ 0, by the signs of its row alone.
    pub(super) fn reach(&self, var: usize) -> (bool, bool) {
        let Place::Row(r) = self.place[var] else {
            return (true, true);
        };
        let (threshold, tiny) = (self.threshold(r), SAFETY * self.error[r]);
        let row = self.row(r);
        let (mut up, mut down) = (row[0] >= -threshold, row[0] <= threshold);
        for (a, &column) in row[1..].iter().zip(self.active_columns()) {
            if a.abs() <= tiny {
                continue;
            }
            let way = a * self.sign[column].factor();
            up |= way >= 0.0;
            down |= way <= 0.0;
        }
        (up, down)
    }

    /// Whether a variable has the given sign wherever all constraints hold: the simplex method from the present vertex, which must
    /// satisfy them, towards the other sign, by Bland's rule.
    pub(super) fn is_bounded(&mut self, var: usize, sign: Sign) -> bool {
        // The variable must not grow beyond zero on this side.
        let side = -sign.factor();
        for _ in 0..4 * (self.rows.len() + self.columns.len()) + 20 {
            let r = match self.place[var] {
                Place::Gone => return true,
                // A free column, or one with the opposite sign, takes any value on that side unless a row bounds it.
                Place::Column(c) => {
                    if self.sign[var].factor() == sign.factor() {
                        return true;
                    }
                    match self.leaving(c, side, usize::MAX) {
                        Some(r) => {
                            self.exchange(r, c);
                            continue;
                        }
                        None => return false,
                    }
                }
                Place::Row(r) => r,
            };
            if side * self.row(r)[0] > self.threshold(r) {
                return false;
            }
            let Some((c, way)) = self.ascending(r, side) else {
                return self.error[r] <= HALF_DIGITS;
            };
            match self.leaving(c, way, r) {
                Some(leaving) => self.exchange(leaving, c),
                None => return false,
            }
        }
        false
    }

    /// The first column by which `side` times a row can grow, and the direction in which it has to change.
    fn ascending(&self, r: usize, side: f64) -> Option<(usize, f64)> {
        let tiny = SAFETY * self.error[r];
        let entries = self.row(r)[1..].iter().zip(&self.columns).enumerate();
        let up = entries.filter_map(|(c, (a, &column))| {
            let way = (side * a).signum();
            let free = self.sign[column] == Sign::Free || self.sign[column].factor() == way;
            (a.abs() > tiny && free).then_some((column, c, way))
        });
        up.min_by_key(|u| u.0).map(|u| (u.1, u.2))
    }

    /// The row that bounds a column changing in one direction, the first variable in case of ties; `except` is ignored.
    fn leaving(&self, c: usize, way: f64, except: usize) -> Option<usize> {
        let mut best: Option<(f64, usize, usize)> = None;
        for (r, &var) in self.rows.iter().enumerate() {
            let rate = self.sign[var].factor() * way * self.row(r)[1 + c];
            if r == except || rate >= -SAFETY * self.error[r] {
                continue;
            }
            let room = (self.sign[var].factor() * self.row(r)[0]).max(0.0) / -rate;
            if best.is_none_or(|b| (room, var) < (b.0, b.1)) {
                best = Some((room, var, r));
            }
        }
        best.map(|b| b.2)
    }

    /// The value of a variable at the present vertex (all columns zero).
    pub(super) fn value(&self, var: usize) -> f64 {
        match self.place[var] {
            Place::Row(r) => self.row(r)[0],
            _ => 0.0,
        }
    }

    /// Size of the values of a variable up to which its sign is uncertain.
    pub(super) fn doubt(&self, var: usize) -> f64 {
        match self.place[var] {
            Place::Row(r) => self.threshold(r),
            _ => 0.0,
        }
    }

    /// Exchanges a row and a column, given by their variables in either order, where the coefficient is one.
    pub(super) fn exchange_variables(&mut self, a: usize, b: usize) -> bool {
        let (r, c) = match (self.place[a], self.place[b]) {
            (Place::Row(r), Place::Column(c)) | (Place::Column(c), Place::Row(r)) => (r, c),
            _ => return false,
        };
        let exists = self.row(r)[1 + c].abs() > SAFETY * self.error[r];
        if exists {
            self.exchange(r, c);
        }
        exists
    }
}

#[cfg(test)]
mod tests;
