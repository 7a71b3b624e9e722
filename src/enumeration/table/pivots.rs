//! Exchanges of a row and a column: which, and how.

use super::{CLEAR, Place, RADIUS, SAFETY, Sign, Table};

impl Table {
    pub(super) fn threshold(&self, r: usize) -> f64 {
        // Contradictions that are proven afterwards from the forms need less evidence here.
        let doubt = if self.keep { 0.0 } else { RADIUS * self.error[r] };
        CLEAR + SAFETY * doubt
    }

    /// The column with the largest coefficient in a row, free ones first.
    pub(super) fn largest(&self, r: usize) -> Option<usize> {
        let tiny = SAFETY * self.error[r];
        let mut best: Option<(bool, f64, usize)> = None;
        for (c, (a, &column)) in self.row(r)[1..].iter().zip(self.active_columns()).enumerate() {
            let candidate = (self.sign[column] == Sign::Free, a.abs(), c);
            let better = best.is_none_or(|b| (candidate.0, candidate.1) > (b.0, b.1));
            if candidate.1 > tiny && better {
                best = Some(candidate);
            }
        }
        best.map(|b| b.2)
    }

    /// The most violated row, or by Bland's rule the violated row of the first variable.
    pub(super) fn violated(&self, bland: bool) -> Option<usize> {
        let mut best: Option<(f64, usize)> = None;
        for (r, &var) in self.rows.iter().enumerate() {
            let value = self.sign[var].factor() * self.data[r * self.stride];
            if value >= -self.threshold(r) {
                continue;
            }
            let key = if bland { var as f64 } else { value };
            if best.is_none_or(|b| key < b.0) {
                best = Some((key, r));
            }
        }
        best.map(|b| b.1)
    }

    /// A column whose growth into its admissible side improves a violated row.
    pub(super) fn entering(&self, r: usize, bland: bool) -> Option<usize> {
        let tiny = SAFETY * self.error[r];
        let wanted = self.sign[self.rows[r]].factor();
        let mut best: Option<(f64, usize)> = None;
        for (c, (a, &column)) in self.row(r)[1..].iter().zip(self.active_columns()).enumerate() {
            let key = match self.sign[column] {
                _ if a.abs() <= tiny => continue,
                // A free column that leaves never has to re-enter.
                Sign::Free => 1e30 * a.abs(),
                sign if wanted * a * sign.factor() > 0.0 => {
                    if bland {
                        -(column as f64)
                    } else {
                        a.abs()
                    }
                }
                _ => continue,
            };
            if best.is_none_or(|b| key > b.0) {
                best = Some((key, c));
            }
        }
        best.map(|b| b.1)
    }

    /// Exchanges the variable of a row with that of a column.
    pub(super) fn exchange(&mut self, r: usize, c: usize) {
        self.pivots += 1;
        let (width, stride) = (self.width(), self.stride);
        let pivot_row = &mut self.data[r * stride..r * stride + width];
        let inverse = 1.0 / pivot_row[1 + c];
        pivot_row.iter_mut().for_each(|v| *v *= -inverse);
        pivot_row[1 + c] = inverse;
        let size = pivot_row[..=self.active]
            .iter()
            .fold(0.0f64, |m, v| m.max(v.abs()));
        let error = self.error[r] * inverse.abs() + f64::EPSILON * size;
        self.error[r] = error;
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.clear();
        scratch.extend_from_slice(pivot_row);
        for i in 0..self.rows.len() {
            if i == r {
                continue;
            }
            let row = &mut self.data[i * stride..i * stride + width];
            let m = row[1 + c];
            if m == 0.0 {
                continue;
            }
            row[1 + c] = 0.0;
            for (a, b) in row.iter_mut().zip(&scratch) {
                *a += m * b;
            }
            self.error[i] = self.error[i].max(m.abs() * error) + f64::EPSILON * m.abs() * size;
        }
        self.scratch = scratch;
        let (leaving, entering) = (self.rows[r], self.columns[c]);
        self.rows[r] = entering;
        self.columns[c] = leaving;
        self.place[entering] = Place::Row(r);
        self.place[leaving] = Place::Column(c);
        // The unknowns themselves are free and not needed again.
        if entering >= self.forms && self.sign[entering] == Sign::Free {
            self.drop_row(r);
        }
    }

    pub(super) fn drop_column(&mut self, c: usize) {
        let last = self.active - 1;
        self.place[self.columns[c]] = Place::Gone;
        if c != last {
            for r in 0..self.rows.len() {
                let start = r * self.stride + 1;
                self.data.swap(start + c, start + last);
            }
            self.place[self.columns[last]] = Place::Column(c);
            self.columns.swap(c, last);
        }
        self.active = last;
        if !self.keep {
            self.columns.truncate(last);
        }
    }

    pub(super) fn drop_row(&mut self, r: usize) {
        let last = self.rows.len() - 1;
        self.place[self.rows[r]] = Place::Gone;
        if r != last {
            let (from, to) = (last * self.stride, r * self.stride);
            self.data.copy_within(from..from + self.stride, to);
            self.error[r] = self.error[last];
            self.place[self.rows[last]] = Place::Row(r);
        }
        self.rows.swap_remove(r);
        self.error.truncate(last);
        self.data.truncate(last * self.stride);
    }
}
