//! Rows that depend on the pieces of many sites: where they are sums over sites, the contribution of each site becomes an unknown, and the
//! rows become common to all pieces.

use super::EnumerationError;
use super::system::{self, System};
use super::table::Form;
use crate::clock::Deadline;
use crate::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt, Selection};
use crate::sparse::Matrix;
use crate::spread::Random;
use crate::tolerances::{GIGABYTE, SAME};

/// Selections, with any pieces at any site, that are compared with the sums.
const COMPARED: usize = 32;

/// What a piece adds to a row, relative to the first piece of its site.
struct Part {
    row: usize,
    form: Form,
}

/// The rows of a map as sums over sites: those of the first pieces, and what other pieces add.
struct Sums {
    base: Vec<Form>,
    /// For each choice and each of its pieces.
    parts: Vec<Vec<Vec<Part>>>,
}

/// Where derivatives are taken, how many of the variables are unknowns, and until when there is time.
#[derive(Clone, Copy)]
pub(super) struct At<'a> {
    pub(super) points: [&'a [f64]; 2],
    pub(super) unknowns: usize,
    /// Whether directions are wanted, for which constants do not matter.
    pub(super) homogeneous: bool,
    pub(super) deadline: Deadline<'a>,
}

impl At<'_> {
    fn rows(
        self,
        map: &dyn PiecewiseSmooth,
        selection: &Selection,
        jac: &mut Matrix,
    ) -> Result<Vec<Form>, EnumerationError> {
        let mut rows = system::rows(map, selection, self.points, self.unknowns, jac)?;
        if self.homogeneous {
            rows.iter_mut().for_each(|f| f.constant = 0.0);
        }
        Ok(rows)
    }
}

/// A choice as a site of the map with the pieces that it may have.
type Choice = (usize, Vec<usize>);

/// The system of a map whose rows are sums over sites, with one unknown for each direction in which a site contributes, after those of the
/// map; `None` where rows are no such sums, this would take too long, or after the time limit. That they are sums is tested at all pairs of
/// pieces of two sites that occur in one row, as far as the limits allow, and at some generic selections.
pub(super) fn split(
    map: &dyn PiecewiseSmooth,
    base: &Selection,
    choices: &[Choice],
    at: At<'_>,
    tests: impl Fn(usize, usize) -> bool,
) -> Result<Option<System>, EnumerationError> {
    let others: usize = choices.iter().map(|c| c.1.len() - 1).sum();
    let size = map.num_residuals().saturating_mul(at.unknowns + 1);
    if size.saturating_mul(1 + others + COMPARED) > GIGABYTE {
        return Ok(None);
    }
    let mut first = base.clone();
    choices.iter().for_each(|c| first.set(c.0, c.1[0]));
    let mut jac = Matrix::zeros(map.pattern());
    let Some(sums) = Sums::new(map, &first, choices, at, &mut jac)? else {
        return Ok(None);
    };
    // Each comparison goes through all sites.
    let limit = GIGABYTE / size.max(choices.len()).max(1);
    let alike = all_compared(map, &first, choices, limit, |selection| {
        Ok(!at.deadline.is_over() && sums.hold(map, selection, choices, at, &mut jac)?)
    })?;
    if !alike {
        return Ok(None);
    }
    let mut system = System {
        unknowns: at.unknowns,
        common: Vec::new(),
        sites: Vec::new(),
    };
    let alone: Vec<Vec<usize>> = (0..choices.len()).map(|k| vec![k]).collect();
    system::add_cells(
        map,
        &mut system,
        sums.base.len(),
        &alone,
        choices,
        at.points,
        tests,
    )?;
    sums.add_to(&mut system);
    system.check()?;
    Ok(Some(system))
}

/// Whether a test holds at the selections at which sums are compared with the rows, as many as the limit
/// allows; they are made one by one, since there may be millions of pairs.
fn all_compared(
    map: &dyn PiecewiseSmooth,
    first: &Selection,
    choices: &[Choice],
    limit: usize,
    mut test: impl FnMut(&Selection) -> Result<bool, EnumerationError>,
) -> Result<bool, EnumerationError> {
    let mut random = Random::new(1);
    let mut selection = first.clone();
    for _ in 0..COMPARED {
        for (site, pieces) in choices {
            selection.set(*site, pieces[random.below(pieces.len())]);
        }
        if !test(&selection)? {
            return Ok(false);
        }
    }
    let mut rows = vec![Vec::new(); choices.len()];
    for (own, choice) in rows.iter_mut().zip(choices) {
        map.site_rows(choice.0, own);
    }
    selection.clone_from(first);
    let mut left = limit.saturating_sub(COMPARED);
    for (i, a) in choices.iter().enumerate() {
        let meets = |j: &usize| rows[i].iter().any(|r| rows[*j].contains(r));
        for b in (0..i).filter(meets).map(|j| &choices[j]) {
            for (p, q) in (a.1[1..].iter()).flat_map(|p| b.1[1..].iter().map(move |q| (*p, *q))) {
                if left == 0 {
                    return Ok(true);
                }
                left -= 1;
                selection.set(a.0, p);
                selection.set(b.0, q);
                if !test(&selection)? {
                    return Ok(false);
                }
            }
            selection.set(b.0, first.piece(b.0));
        }
        selection.set(a.0, first.piece(a.0));
    }
    Ok(true)
}

impl Sums {
    /// `None` after the time limit.
    fn new(
        map: &dyn PiecewiseSmooth,
        first: &Selection,
        choices: &[Choice],
        at: At<'_>,
        jac: &mut Matrix,
    ) -> Result<Option<Self>, EnumerationError> {
        let base = at.rows(map, first, jac)?;
        let mut parts = Vec::with_capacity(choices.len());
        for (site, pieces) in choices {
            let mut of_site = vec![Vec::new()];
            for piece in &pieces[1..] {
                if at.deadline.is_over() {
                    return Ok(None);
                }
                let mut other = first.clone();
                other.set(*site, *piece);
                let rows = at.rows(map, &other, jac)?;
                let changed = rows
                    .iter()
                    .zip(&base)
                    .enumerate()
                    .filter_map(|(row, (new, old))| {
                        let form = difference(new, old);
                        (size(&form) > 0.0).then_some(Part { row, form })
                    });
                of_site.push(changed.collect());
            }
            parts.push(of_site);
        }
        Ok(Some(Self { base, parts }))
    }

    /// Whether the rows of a selection are the sums.
    fn hold(
        &self,
        map: &dyn PiecewiseSmooth,
        selection: &Selection,
        choices: &[Choice],
        at: At<'_>,
        jac: &mut Matrix,
    ) -> Result<bool, EnumerationError> {
        let mut rest = at.rows(map, selection, jac)?;
        let mut sizes: Vec<f64> = rest.iter().map(size).collect();
        let mut take = |row: usize, form: &Form| {
            add(&mut rest[row], -1.0, form);
            sizes[row] = sizes[row].max(size(form));
        };
        self.base
            .iter()
            .enumerate()
            .for_each(|(row, form)| take(row, form));
        for ((site, pieces), parts) in choices.iter().zip(&self.parts) {
            let chosen = pieces
                .iter()
                .position(|p| *p == selection.piece(*site))
                .unwrap_or(0);
            parts[chosen].iter().for_each(|part| take(part.row, &part.form));
        }
        Ok(rest.iter().zip(&sizes).all(|(r, s)| size(r) <= SAME * s))
    }

    /// Adds the rows, and the contributions as unknowns.
    fn add_to(self, system: &mut System) {
        let mut common = self.base;
        for (site, parts) in system.sites.iter_mut().zip(&self.parts) {
            let mut rows: Vec<usize> = parts.iter().flatten().map(|p| p.row).collect();
            rows.sort_unstable();
            rows.dedup();
            // What the pieces add to rows; rows to which they add multiples of one another share an unknown.
            let mut known: Vec<(usize, Vec<Form>)> = Vec::new();
            for row in rows {
                let zero = || Form {
                    coefficients: Vec::new(),
                    constant: 0.0,
                    error: 0.0,
                };
                let added = |of_piece: &Vec<Part>| {
                    let own = of_piece.iter().find(|p| p.row == row);
                    own.map_or_else(zero, |p| p.form.clone())
                };
                let forms: Vec<Form> = parts.iter().map(added).collect();
                let found = known
                    .iter()
                    .find_map(|(unknown, k)| Some((*unknown, multiple(&forms, k)?)));
                let (unknown, factor) = found.unwrap_or_else(|| {
                    known.push((system.unknowns, forms));
                    system.unknowns += 1;
                    (system.unknowns - 1, 1.0)
                });
                let terms = &mut common[row].coefficients;
                terms.resize(terms.len().max(unknown + 1), 0.0);
                terms[unknown] += factor;
            }
            for (unknown, forms) in known {
                for (piece, form) in site.pieces.iter_mut().zip(forms) {
                    // z − form.
                    let mut given = Form {
                        coefficients: vec![0.0; unknown + 1],
                        constant: 0.0,
                        error: form.error,
                    };
                    add(&mut given, -1.0, &form);
                    given.coefficients[unknown] = 1.0;
                    let same =
                        |f: &Form| f.constant == given.constant && f.coefficients == given.coefficients;
                    let k = site.forms.iter().position(same).unwrap_or_else(|| {
                        site.forms.push(given);
                        site.forms.len() - 1
                    });
                    piece.equalities.push(k);
                }
            }
        }
        system.common = common;
        let sites = system.sites.iter_mut().flat_map(|s| &mut s.forms);
        for form in system.common.iter_mut().chain(sites) {
            form.coefficients.resize(system.unknowns, 0.0);
        }
    }
}

fn size(form: &Form) -> f64 {
    form.coefficients
        .iter()
        .fold(form.constant.abs(), |m, a| m.max(a.abs()))
}

/// sum + factor · form.
fn add(sum: &mut Form, factor: f64, form: &Form) {
    for (s, a) in sum.coefficients.iter_mut().zip(&form.coefficients) {
        *s += factor * a;
    }
    sum.constant += factor * form.constant;
    sum.error = sum.error.max(factor.abs() * form.error);
}

/// A form minus another one: 0 where the difference is rounding.
fn difference(new: &Form, old: &Form) -> Form {
    let mut rest = new.clone();
    add(&mut rest, -1.0, old);
    let noise = 1e-14 * size(new).max(size(old)) + rest.error;
    let numbers = rest.coefficients.iter_mut().chain([&mut rest.constant]);
    numbers.filter(|v| v.abs() <= noise).for_each(|v| *v = 0.0);
    rest
}

/// The factor by which forms are multiples of others, if they are.
fn multiple(forms: &[Form], others: &[Form]) -> Option<f64> {
    let numbers = |list: &[Form]| -> Vec<f64> {
        let width = list.iter().map(|f| f.coefficients.len()).max().unwrap_or(0);
        let each = list.iter().flat_map(|f| {
            let padded = (0..width).map(|j| f.coefficients.get(j).copied().unwrap_or(0.0));
            padded.chain([f.constant]).collect::<Vec<f64>>()
        });
        each.collect()
    };
    let (a, b) = (numbers(forms), numbers(others));
    let largest = (0..b.len()).max_by(|i, j| b[*i].abs().total_cmp(&b[*j].abs()))?;
    let factor = a.get(largest)? / b[largest];
    let size = a.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let same = a.len() == b.len()
        && a.iter()
            .zip(&b)
            .all(|(a, b)| (a - factor * b).abs() <= 1e-13 * size);
    (same && factor != 0.0).then_some(factor)
}

#[cfg(test)]
mod tests {
    use super::{Form, difference, multiple};

    fn forms(numbers: [[f64; 3]; 2]) -> Vec<Form> {
        let form = |[a, b, constant]: [f64; 3]| Form {
            coefficients: vec![a, b],
            constant,
            error: 0.0,
        };
        numbers.map(form).to_vec()
    }

    /// Multiples are recognised up to the rounding of their terms, in any units; a different ratio in one number, however small, is none.
    #[test]
    fn multiples_are_told_from_near_ones() {
        let base = [[0.3, -0.7, 1e-3], [0.0, 1.1, 0.9]];
        for unit in [1e-12, 1.0, 1e9] {
            for factor in [1.0 / 3.0, -1.7, 0.1] {
                // In two roundings.
                let scaled = base.map(|row| row.map(|v| v * unit * 3.0 * (factor / 3.0)));
                let found = multiple(&forms(scaled), &forms(base));
                assert!(found.is_some_and(|f| (f / (unit * factor) - 1.0).abs() < 1e-14));
                let mut other = scaled;
                other[0][2] += 1e-9 * unit;
                assert_eq!(multiple(&forms(other), &forms(base)), None);
            }
        }
        assert_eq!(multiple(&forms([[0.0; 3]; 2]), &forms(base)), None);
    }

    /// Sums in another order differ by nothing; a difference of a thousand roundings is one.
    #[test]
    fn differences_within_rounding_are_none() {
        for unit in [1e-12, 1.0, 1e9] {
            let [old, new] = [[0.3, -0.7, 0.6], [0.1 + 0.2, -0.7, 0.1 + 0.2 + 0.3]]
                .map(|row| forms([row.map(|v| v * unit), [0.0; 3]]).remove(0));
            assert_ne!(old.coefficients, new.coefficients);
            let rest = difference(&new, &old);
            assert_eq!((rest.coefficients, rest.constant), (vec![0.0; 2], 0.0));
            let mut other = new.clone();
            other.coefficients[1] += 1e-12 * unit;
            let rest = difference(&other, &old);
            assert_eq!((rest.coefficients[0], rest.constant), (0.0, 0.0));
            assert!((rest.coefficients[1] / unit - 1e-12).abs() < 1e-15);
            // A declared error permits as large a difference.
            other.error = 1e-11 * unit;
            assert_eq!(difference(&other, &old).coefficients, vec![0.0; 2]);
        }
    }
}
