//! A dictionary of affine forms with integer coefficients over one denominator: elimination without fractions (Edmonds, Bareiss).

use num_bigint::BigInt;
use num_traits::{One, Signed, Zero};

use super::Exact;
use crate::clock::Deadline;

/// Why an operation on a dictionary ended early.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Halt {
    /// The conditions contradict each other.
    Infeasible,
    /// The limit on time or work is reached.
    Late,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Place {
    Row(usize),
    Column(usize),
    /// Identically zero.
    Gone,
}

/// Numbers that can be read in the time that it takes to write one.
pub(crate) const LOOKED_AT: u64 = 16;

#[derive(Debug, Clone)]
struct Row {
    var: usize,
    /// The constant, then the coefficients, as numerators.
    entries: Vec<BigInt>,
}

/// Every form as a constant plus a combination of the columns. Variables are the forms, numbered as given, followed by the unknowns.
#[derive(Debug, Clone)]
pub(crate) struct Dictionary<'d> {
    rows: Vec<Row>,
    columns: Vec<usize>,
    /// Positive.
    denominator: BigInt,
    place: Vec<Place>,
    sign: Vec<i8>,
    /// Numbers written, large ones counted as many.
    work: u64,
    limit: u64,
    deadline: Deadline<'d>,
}

impl<'d> Dictionary<'d> {
    /// Forms as rows of a constant and one coefficient for each unknown; each is multiplied by a power of two that makes it integer.
    pub(crate) fn new<'f>(unknowns: usize, forms: impl Iterator<Item = (&'f Exact, &'f [Exact])>) -> Self {
        let mut rows = Vec::new();
        for (var, (constant, coefficients)) in forms.enumerate() {
            let all = || std::iter::once(constant).chain(coefficients);
            let shift = -all().filter_map(Exact::granularity).min().unwrap_or(0);
            rows.push(Row {
                var,
                entries: all().map(|e| e.integer(shift)).collect(),
            });
        }
        let count = rows.len();
        let mut place: Vec<Place> = (0..count).map(Place::Row).collect();
        place.extend((0..unknowns).map(Place::Column));
        Self {
            columns: (count..count + unknowns).collect(),
            sign: vec![0; place.len()],
            place,
            rows,
            denominator: BigInt::one(),
            work: 0,
            limit: u64::MAX,
            deadline: Deadline::after(None),
        }
    }

    /// Sets a deadline, checked in each exchange; once it has passed the dictionary is unusable.
    pub(crate) fn until(mut self, deadline: Deadline<'d>) -> Self {
        self.deadline = deadline;
        self
    }

    /// Limits the [work](Self::take_work) between two calls of that method.
    pub(crate) fn within(mut self, limit: u64) -> Self {
        self.limit = limit;
        self
    }

    /// What is left of the limit.
    pub(crate) fn left(&self) -> u64 {
        self.limit.saturating_sub(self.work)
    }

    /// Counts work that was done elsewhere.
    pub(crate) fn charge(&mut self, work: u64) {
        self.work = self.work.saturating_add(work);
    }

    pub(crate) fn deadline(&self) -> Deadline<'d> {
        self.deadline
    }

    /// The work done since the last call, in numbers of some hundred bits.
    pub(crate) fn take_work(&mut self) -> u64 {
        std::mem::take(&mut self.work)
    }

    pub(crate) fn place(&self, var: usize) -> Place {
        self.place[var]
    }

    /// The variables of the columns: the dimension left.
    pub(crate) fn columns(&self) -> &[usize] {
        &self.columns
    }

    pub(crate) fn denominator(&self) -> &BigInt {
        &self.denominator
    }

    /// Numerators of the constant and of the coefficients of a variable over the present columns.
    pub(crate) fn entries(&self, var: usize) -> Vec<BigInt> {
        match self.place[var] {
            Place::Row(r) => self.rows[r].entries.clone(),
            place => {
                let mut entries = vec![BigInt::zero(); self.columns.len() + 1];
                if let Place::Column(c) = place {
                    entries[1 + c].clone_from(&self.denominator);
                }
                entries
            }
        }
    }

    /// Sets a variable to zero; gives the column it was exchanged with and the sign of the pivot, if there was one.
    pub(crate) fn fix(&mut self, var: usize) -> Result<Option<(usize, i8)>, Halt> {
        self.fix_among(var, |_| true)
    }

    /// As [`fix`](Self::fix), exchanging with columns of the given variables only; where there is none the form stays.
    pub(crate) fn fix_among(
        &mut self,
        var: usize,
        allowed: impl Fn(usize) -> bool,
    ) -> Result<Option<(usize, i8)>, Halt> {
        match self.place[var] {
            Place::Gone => Ok(None),
            Place::Column(c) => {
                self.drop_column(c);
                Ok(None)
            }
            Place::Row(r) => {
                let entries = &self.rows[r].entries;
                let candidates = self.columns.iter().enumerate();
                let best = candidates
                    .filter(|(c, v)| !entries[1 + c].is_zero() && allowed(**v))
                    // Free columns first: a constrained one would have to be kept nonnegative as a row.
                    .min_by_key(|(c, v)| (self.sign[**v] != 0, entries[1 + c].bits()));
                let Some((c, &column)) = best else {
                    if entries[1..].iter().any(|e| !e.is_zero()) {
                        return Ok(None);
                    }
                    if !entries[0].is_zero() {
                        return Err(Halt::Infeasible);
                    }
                    self.drop_row(r);
                    return Ok(None);
                };
                let sign = if entries[1 + c].is_negative() { -1 } else { 1 };
                self.exchange(r, c)?;
                self.drop_column(c);
                Ok(Some((column, sign)))
            }
        }
    }

    /// Exchanges a row with one of the given columns, if that is possible.
    pub(crate) fn enter(&mut self, var: usize, allowed: impl Fn(usize) -> bool) -> Result<(), Halt> {
        let Place::Row(r) = self.place[var] else {
            return Ok(());
        };
        let entries = &self.rows[r].entries;
        let columns = self.columns.iter().enumerate();
        let possible = columns.filter(|(c, v)| !entries[1 + c].is_zero() && allowed(**v));
        match possible.min_by_key(|(c, _)| entries[1 + c].bits()) {
            Some((c, _)) => self.exchange(r, c),
            None => Ok(()),
        }
    }

    /// Constrains the sign of a variable; opposite constraints make it zero.
    pub(crate) fn constrain(&mut self, var: usize, sign: i8) -> Result<(), Halt> {
        match self.sign[var] {
            _ if self.place[var] == Place::Gone => Ok(()),
            0 => {
                self.sign[var] = sign;
                Ok(())
            }
            old if old == sign => Ok(()),
            _ => self.fix(var).map(|_| ()),
        }
    }

    /// Forgets a row that is of no further interest.
    pub(crate) fn forget(&mut self, var: usize) {
        if let Place::Row(r) = self.place[var] {
            self.drop_row(r);
        }
    }

    /// Restores the sign constraints of all rows by Bland's rule.
    pub(crate) fn repair(&mut self) -> Result<(), Halt> {
        loop {
            let violated = |row: &&Row| {
                let s = self.sign[row.var];
                (s > 0 && row.entries[0].is_negative()) || (s < 0 && row.entries[0].is_positive())
            };
            let Some(row) = self.rows.iter().filter(violated).min_by_key(|row| row.var) else {
                return Ok(());
            };
            let wanted = self.sign[row.var];
            let helps = |c: usize, v: usize| {
                let a = &row.entries[1 + c];
                let way = if a.is_negative() { -wanted } else { wanted };
                !a.is_zero() && (self.sign[v] == 0 || self.sign[v] == way)
            };
            let columns = self.columns.iter().enumerate();
            let entering = columns
                .filter(|(c, v)| helps(*c, **v))
                .min_by_key(|(_, v)| (self.sign[**v] != 0, **v));
            let (Some((c, _)), Place::Row(r)) = (entering, self.place[row.var]) else {
                return Err(Halt::Infeasible);
            };
            self.exchange(r, c)?;
        }
    }

    fn exchange(&mut self, r: usize, c: usize) -> Result<(), Halt> {
        if self.work > self.limit || self.deadline.is_over() {
            return Err(Halt::Late);
        }
        let large = 1 + (self.denominator.bits() / 512).pow(2);
        self.work += (self.rows.len() * (self.columns.len() + 1)) as u64 / LOOKED_AT;
        let pivot = std::mem::take(&mut self.rows[r].entries);
        let a = pivot[1 + c].clone();
        let old = std::mem::replace(&mut self.denominator, a.clone());
        for (i, row) in self.rows.iter_mut().enumerate() {
            if i == r {
                continue;
            }
            if self.deadline.is_over() {
                return Err(Halt::Late);
            }
            let m = std::mem::take(&mut row.entries[1 + c]);
            let mut written = 0;
            for (j, (e, p)) in row.entries.iter_mut().zip(&pivot).enumerate() {
                if j == 1 + c || (e.is_zero() && (m.is_zero() || p.is_zero())) {
                    continue;
                }
                written += 1;
                *e *= &a;
                if !m.is_zero() && !p.is_zero() {
                    *e -= &m * p;
                }
                *e /= &old;
            }
            row.entries[1 + c] = m;
            self.work += written * large;
        }
        let mut entries: Vec<BigInt> = pivot.into_iter().map(|p| -p).collect();
        entries[1 + c] = old;
        let (leaving, entering) = (self.rows[r].var, self.columns[c]);
        self.rows[r] = Row {
            var: entering,
            entries,
        };
        self.columns[c] = leaving;
        self.place[entering] = Place::Row(r);
        self.place[leaving] = Place::Column(c);
        if self.denominator.is_negative() {
            self.denominator = -std::mem::take(&mut self.denominator);
            for e in self.rows.iter_mut().flat_map(|row| &mut row.entries) {
                *e = -std::mem::take(e);
            }
        }
        Ok(())
    }

    fn drop_column(&mut self, c: usize) {
        self.place[self.columns[c]] = Place::Gone;
        self.columns.swap_remove(c);
        for row in &mut self.rows {
            row.entries.swap_remove(1 + c);
        }
        if let Some(&moved) = self.columns.get(c) {
            self.place[moved] = Place::Column(c);
        }
    }

    fn drop_row(&mut self, r: usize) {
        self.place[self.rows[r].var] = Place::Gone;
        self.rows.swap_remove(r);
        if let Some(row) = self.rows.get(r) {
            self.place[row.var] = Place::Row(r);
        }
    }
}

/// numerator / denominator as a floating-point number within one unit in the last place, times 2^shift.
pub(crate) fn quotient(numerator: &BigInt, denominator: &BigInt, shift: i64) -> f64 {
    if numerator.is_zero() {
        return 0.0;
    }
    let up = (denominator.bits() as i64 - numerator.bits() as i64 + 66).max(0);
    let q = (numerator << up as u64) / denominator;
    Exact::of(q, 0).scaled(shift - up)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::{Deadline, Dictionary, quotient};
    use crate::exact::{Exact, Halt};

    fn dictionary(unknowns: usize, forms: &[&[f64]]) -> Dictionary<'static> {
        let exact: Vec<Vec<Exact>> = forms
            .iter()
            .map(|f| f.iter().map(|v| Exact::new(*v).unwrap()).collect())
            .collect();
        Dictionary::new(unknowns, exact.iter().map(|f| (&f[0], &f[1..])))
    }

    /// 2x + y = 3.5, x − 3y = 0.7 has the solution (1.6, 0.3), up to what 0.7 is as a floating-point number.
    #[test]
    fn solves_and_finds_contradictions() {
        let mut d = dictionary(2, &[&[-3.5, 2.0, 1.0], &[-0.7, 1.0, -3.0], &[1.0, -4.0, -2.0]]);
        assert!(d.fix(0).is_ok() && d.fix(1).is_ok() && d.columns().is_empty());
        let at = |var: usize| quotient(&d.entries(var)[0], d.denominator(), 0);
        assert!((at(3) - 1.6).abs() < 1e-15 && (at(4) - 0.3).abs() < 1e-15);
        assert_eq!(at(2), -6.0);
        let mut d = dictionary(2, &[&[1.0, 1.0, 1.0], &[2.0, 2.0, 2.0], &[0.1, 0.3, 0.3]]);
        assert!(d.fix(0).is_ok() && d.fix(1).is_ok() && d.columns().len() == 1);
        // 0.1 + 0.3 (x + y) at x + y = −1 is not 0.
        assert!(d.fix(2).is_err());
    }

    /// x ≥ 0, y ≥ 0, x + y ≤ 1, x + y ≥ s is feasible up to s = 1.
    #[test]
    fn feasibility_is_decided_by_the_last_bit() {
        for (s, feasible) in [
            (0.5, true),
            (1.0, true),
            (1.0 + f64::EPSILON, false),
            (2.0, false),
        ] {
            let mut d = dictionary(
                2,
                &[
                    &[0.0, 1.0, 0.0],
                    &[0.0, 0.0, 1.0],
                    &[1.0, -1.0, -1.0],
                    &[-s, 1.0, 1.0],
                ],
            );
            for var in 0..4 {
                d.constrain(var, 1).unwrap();
            }
            assert_eq!(d.repair().is_ok(), feasible, "{s}");
        }
    }

    /// Four rows of three numbers each: an exchange writes those of the other rows that are not zero or become so, and begins while less
    /// than the limit has been done.
    #[test]
    fn work_is_counted_and_limited() {
        let rows: [&[f64]; 4] = [
            &[1.0, 1.0, 1.0],
            &[1.0, 0.0, 1.0],
            &[0.0, 1.0, 0.0],
            &[1.0, 2.0, 3.0],
        ];
        // Rows without x keep their numbers over the new denominator.
        let mut d = dictionary(2, &rows);
        assert!(d.fix(0).is_ok());
        let all = d.take_work();
        assert_eq!(all, 2 + 2 + 2);
        let mut d = dictionary(2, &rows).within(all - 1);
        assert!(d.fix(0).is_ok() && d.left() == 0);
        assert_eq!(d.fix(1), Err(Halt::Late));
        assert_eq!(d.take_work(), all);
        assert!(d.fix(1).is_ok());
        let mut d = dictionary(2, &rows).within(all);
        d.charge(all);
        assert!(d.fix(0).is_ok());
        let mut d = dictionary(2, &rows).within(all);
        d.charge(all + 1);
        assert_eq!(d.fix(0), Err(Halt::Late));
    }

    /// The clock is read for each row.
    #[test]
    fn long_exchanges_end_in_time() {
        let rows: [&[f64]; 4] = [&[1.0, 1.0], &[1.0, 2.0], &[0.0, 3.0], &[1.0, 4.0]];
        let (looks, limit) = (Cell::new(0), Cell::new(0));
        let stop = || {
            looks.set(looks.get() + 1);
            looks.get() > limit.get()
        };
        for most in 0..=4 {
            looks.set(0);
            limit.set(most);
            let mut d = dictionary(1, &rows).until(Deadline::after(None).or(&stop));
            assert_eq!(d.fix(1).is_ok(), most == 4);
            assert_eq!(looks.get(), 4.min(most + 1));
        }
    }

    /// No exchange begins once time is over; operations that need none still succeed.
    #[test]
    fn exchanges_stop_in_time() {
        let over = Deadline::after(Some(std::time::Duration::ZERO));
        // x ≥ 1 and y = x.
        let rows: [&[f64]; 2] = [&[-1.0, 1.0, 0.0], &[0.0, 1.0, -1.0]];
        let mut d = dictionary(2, &rows).until(over);
        assert_eq!(d.repair(), Ok(()));
        assert_eq!(d.fix(1), Err(Halt::Late));
        d.constrain(0, 1).unwrap();
        assert_eq!(d.repair(), Err(Halt::Late));
        // A contradiction that needs no exchange is still found.
        let mut d = dictionary(1, &[&[-1.0, 0.0]]).until(over);
        d.constrain(0, 1).unwrap();
        assert_eq!(d.repair(), Err(Halt::Infeasible));
    }
}
