//! The solution set of a single selection in its cell, in exact arithmetic: empty, a point, or a polyhedron with its ends.

use num_bigint::BigInt;
use num_traits::{Signed, Zero};

use super::exhaustive::{Budget, ExactPoint, MAX_WORK, Tableau, elimination, piece_of};
use super::lists::Extent;
use super::shape::Shape;
use crate::exact::{Dictionary, Exact, Halt, parity};
use crate::piecewise::ExactConditions;

/// The solution set of a selection in its cell.
#[derive(Debug, Clone)]
pub(super) enum SelectionSolutions {
    None,
    /// A point, the sign of the determinant, and the sites at which a facet vanishes.
    Point {
        point: ExactPoint,
        sign: i8,
        touched: Vec<usize>,
    },
    /// A polyhedron of this dimension; its extent where that is one.
    Continuum {
        dimension: usize,
        extent: Option<Extent<ExactPoint>>,
        shape: Option<Shape>,
    },
}

/// The solution set of a selection (by piece numbers of the map); `None` at the cap on work.
pub(super) fn decide(
    conditions: &ExactConditions,
    pieces: &[usize],
    budget: &mut Budget,
) -> Option<SelectionSolutions> {
    if budget.is_spent() || elimination(conditions) > MAX_WORK {
        return None;
    }
    let mut table = Tableau::new(conditions, budget.deadline);
    let found = examine(&mut table, conditions, pieces);
    budget.spend(table.dictionary.take_work());
    match found {
        Ok(found) => Some(found),
        Err(Halt::Infeasible) => Some(SelectionSolutions::None),
        Err(Halt::Late) => None,
    }
}

fn examine(
    table: &mut Tableau<'_>,
    conditions: &ExactConditions,
    pieces: &[usize],
) -> Result<SelectionSolutions, Halt> {
    let (sign, facets) = eliminate(table, conditions, pieces)?;
    let dictionary = &mut table.dictionary;
    if dictionary.columns().is_empty() {
        let mut touched = Vec::new();
        for &(site, var, wanted) in &facets {
            let value = &dictionary.entries(var)[0];
            if value.is_zero() {
                touched.push(site);
            } else if value.is_positive() != (wanted > 0) {
                return Err(Halt::Infeasible);
            }
        }
        touched.dedup();
        let point = table.point(&[]);
        return Ok(SelectionSolutions::Point { point, sign, touched });
    }
    let mut flat = Vec::new();
    if dictionary.columns().len() > 1 {
        flat = flat_facets(dictionary, &facets)?;
        for &var in &flat {
            dictionary.fix(var)?;
        }
    }
    match dictionary.columns().len() {
        0 | 1 => segment(table, &facets),
        dimension => {
            let open = facets.iter().filter(|f| !flat.contains(&f.1));
            let open: Vec<(usize, i8)> = open.map(|f| (f.1, f.2)).collect();
            Ok(SelectionSolutions::Continuum {
                dimension,
                extent: None,
                shape: Some(Shape::of_cell(table, &open)?),
            })
        }
    }
}

/// A facet as (site, variable, sign).
type SignedFacet = (usize, usize, i8);

/// A fraction as numerator and positive denominator.
type Fraction = (BigInt, BigInt);

/// Imposes all equalities of a selection. Returns the sign of the determinant of their rows and the facets as (site, variable, sign).
fn eliminate(
    table: &mut Tableau<'_>,
    conditions: &ExactConditions,
    pieces: &[usize],
) -> Result<(i8, Vec<SignedFacet>), Halt> {
    let mut equalities = Vec::new();
    let mut facets = Vec::new();
    for (site, &piece) in pieces.iter().enumerate() {
        let piece = piece_of(conditions, site, piece).ok_or(Halt::Infeasible)?;
        let offset = table.offsets[site];
        for form in 0..conditions.sites[site].forms.len() {
            let used = |e: &(usize, usize)| e.1 == form;
            if !piece.equalities.iter().any(used) && piece.facets.iter().all(|f| f.0 != form) {
                table.dictionary.forget(offset + form);
            }
        }
        equalities.extend(piece.equalities.iter().map(|&(row, form)| (row, offset + form)));
        facets.extend(
            piece
                .facets
                .iter()
                .map(|&(form, sign)| (site, offset + form, sign)),
        );
    }
    let square = equalities.len() + conditions.common.len() == conditions.unknowns;
    let mut rows = vec![None; conditions.unknowns];
    for &(row, var) in equalities.iter().filter(|_| square) {
        if let Some(place) = rows.get_mut(row) {
            *place = Some(var);
        }
    }
    let mut common = 0..conditions.common.len();
    rows.iter_mut()
        .filter(|r| r.is_none())
        .for_each(|r| *r = common.next());
    let all = (0..conditions.common.len()).chain(equalities.iter().map(|e| e.1));
    let (mut sign, mut columns) = (1, Vec::new());
    for var in all {
        if let Some((column, pivot)) = table.dictionary.fix(var)? {
            sign *= pivot;
            columns.push((var, column - table.unknowns));
        }
    }
    let placed = |var: &Option<usize>| columns.iter().find(|c| Some(c.0) == *var).map(|c| c.1);
    let order: Option<Vec<usize>> = rows.iter().map(placed).collect();
    let sign = match order {
        Some(order) if columns.len() == conditions.unknowns => sign * parity(order),
        _ => 0,
    };
    Ok((sign, facets))
}

/// The facets that vanish at all points of the polyhedron that they bound.
fn flat_facets(dictionary: &mut Dictionary, facets: &[SignedFacet]) -> Result<Vec<usize>, Halt> {
    let mut feasible = dictionary.clone();
    for &(_, var, sign) in facets {
        feasible.constrain(var, sign)?;
    }
    feasible.repair()?;
    // Homogeneous: t is the last unknown. A facet is positive somewhere if it can be 1 (at t > 0, or along a ray).
    let rows: Vec<Vec<BigInt>> = facets.iter().map(|f| dictionary.entries(f.1)).collect();
    let exact = |v: &BigInt| Exact::of(v.clone(), 0);
    let forms: Vec<Vec<Exact>> = rows
        .iter()
        .map(|r| r[1..].iter().chain(&r[..1]).map(exact).collect())
        .collect();
    let unknowns = dictionary.columns().len() + 1;
    let (zero, one) = (Exact::default(), Exact::one());
    let mut flat = Vec::new();
    for (k, &(_, var, sign)) in facets.iter().enumerate() {
        let target = -&Exact::of(dictionary.denominator() * BigInt::from(sign), 0);
        let mut time = vec![zero.clone(); unknowns];
        time[unknowns - 1] = one.clone();
        let all = forms.iter().map(|f| (&zero, f.as_slice()));
        let extra = [(&zero, time.as_slice()), (&target, forms[k].as_slice())];
        let mut rays = Dictionary::new(unknowns, all.chain(extra))
            .until(dictionary.deadline())
            .within(dictionary.left());
        let mut reached = || -> Result<(), Halt> {
            for (other, facet) in facets.iter().enumerate() {
                rays.constrain(other, facet.2)?;
            }
            rays.constrain(facets.len(), 1)?;
            rays.fix(facets.len() + 1)?;
            rays.repair()
        };
        let reached = reached();
        dictionary.charge(rays.take_work());
        match reached {
            Ok(()) => {}
            Err(Halt::Infeasible) => flat.push(var),
            Err(Halt::Late) => return Err(Halt::Late),
        }
    }
    Ok(flat)
}

/// The part of a line that lies in the cell: a fraction as numerator and positive denominator at either end.
fn segment(table: &Tableau<'_>, facets: &[SignedFacet]) -> Result<SelectionSolutions, Halt> {
    let (mut low, mut high): (Option<Fraction>, Option<Fraction>) = (None, None);
    for &(_, var, sign) in facets {
        let mut entries = table.dictionary.entries(var);
        if sign < 0 {
            entries.iter_mut().for_each(|e| *e = -std::mem::take(e));
        }
        let rate = entries.get(1).cloned().unwrap_or_default();
        let (value, positive) = (std::mem::take(&mut entries[0]), rate.is_positive());
        if rate.is_zero() {
            if value.is_negative() {
                return Err(Halt::Infeasible);
            }
            continue;
        }
        // t = −value/rate.
        let at = if positive { (-value, rate) } else { (value, -rate) };
        let later = |a: &Fraction, b: &Fraction| &a.0 * &b.1 > &b.0 * &a.1;
        if positive {
            if low.as_ref().is_none_or(|l| later(&at, l)) {
                low = Some(at);
            }
        } else if high.as_ref().is_none_or(|h| later(h, &at)) {
            high = Some(at);
        }
    }
    if table.dictionary.columns().is_empty() {
        return Ok(single(table.point(&[])));
    }
    if let (Some(l), Some(h)) = (&low, &high) {
        let (a, b) = (&l.0 * &h.1, &h.0 * &l.1);
        if a > b {
            return Err(Halt::Infeasible);
        }
        if a == b {
            return Ok(single(table.point(std::slice::from_ref(l))));
        }
    }
    let [low, high] = [low, high].map(|t| t.map(|t| table.point(&[t])));
    let (mut extent, mut shape) = (None, None);
    if let Some((foot, forth)) = table.line() {
        let back = forth.clone().opposite();
        let directions = match (&low, &high) {
            (Some(_), Some(_)) => Vec::new(),
            (Some(_), None) => vec![forth.clone()],
            (None, Some(_)) => vec![back.clone()],
            (None, None) => vec![forth.clone(), back.clone()],
        };
        let beyond = match (&low, &high) {
            (Some(_), Some(_)) => Vec::new(),
            (Some(end), None) => vec![end.plus(&forth)],
            (None, Some(end)) => vec![end.plus(&back)],
            (None, None) => vec![foot.plus(&forth), foot.plus(&back)],
        };
        let ends = [low, high].into_iter().flatten().collect();
        let own = Extent { ends, beyond };
        shape = Shape::of_segment(&own, directions);
        extent = Some(own);
    }
    Ok(SelectionSolutions::Continuum {
        dimension: 1,
        extent,
        shape,
    })
}

/// The point that is the whole solution set of a singular selection.
fn single(point: ExactPoint) -> SelectionSolutions {
    SelectionSolutions::Point {
        point,
        sign: 0,
        touched: Vec::new(),
    }
}

impl Tableau<'_> {
    /// The point at which the first varying component is 0 on the line of the remaining column, and its direction of growing values of the
    /// column, in which that component changes by 1.
    fn line(&self) -> Option<(ExactPoint, ExactPoint)> {
        let entries = |k: usize| self.dictionary.entries(self.unknowns + k);
        let numerators: Vec<BigInt> = (0..self.conditions.unknowns)
            .map(|k| entries(k).swap_remove(1))
            .collect();
        let first = numerators.iter().position(|n| !n.is_zero())?;
        let (value, denominator) = (entries(first).swap_remove(0), numerators[first].abs());
        let value = if numerators[first].is_positive() {
            -value
        } else {
            value
        };
        let foot = self.point(&[(value, denominator.clone())]);
        Some((
            foot,
            ExactPoint {
                numerators,
                denominator,
            },
        ))
    }
}
