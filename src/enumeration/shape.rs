//! Polyhedra of solutions by points and directions, in exact arithmetic.

use num_bigint::BigInt;
use num_traits::{One, Signed, Zero};

use super::exhaustive::{ExactPoint, Tableau};
use super::generators::generators;
use super::lists::Extent;
use crate::exact::{Exact, Halt, quotient};
use crate::piecewise::ExactConditions;

/// A polyhedron of solutions.
#[derive(Debug, Clone)]
pub(super) struct Shape {
    /// Inside, if the polyhedron is described.
    pub(super) point: ExactPoint,
    pub(super) ends: Vec<ExactPoint>,
    /// Vectors; of a line both.
    pub(super) directions: Vec<ExactPoint>,
    /// Whether ends and directions are all there are.
    pub(super) described: bool,
}

impl Shape {
    /// Of a segment, a ray or a line: its middle, or a point beyond the end.
    pub(super) fn of_segment(extent: &Extent<ExactPoint>, directions: Vec<ExactPoint>) -> Option<Self> {
        let point = match (extent.ends.as_slice(), extent.beyond.as_slice()) {
            ([a, b], _) => a.plus(b).halved(),
            (_, [beyond, ..]) => beyond.clone(),
            _ => return None,
        };
        Some(Self {
            point,
            ends: extent.ends.clone(),
            directions,
            described: true,
        })
    }

    /// The polyhedron in the remaining columns of a table on which the given variables have their signs; none
    /// of them vanishes everywhere.
    pub(super) fn of_cell(table: &mut Tableau<'_>, facets: &[(usize, i8)]) -> Result<Self, Halt> {
        let dimension = table.dictionary.columns().len();
        let row = |&(var, sign): &(usize, i8)| -> Vec<BigInt> {
            let entries = table.dictionary.entries(var);
            entries.into_iter().map(|e| e * BigInt::from(sign)).collect()
        };
        let rows: Vec<Vec<BigInt>> = facets.iter().map(row).collect();
        let mut work = 0;
        let found = generators(dimension, &rows, &mut work);
        table.dictionary.charge(work);
        let Some(found) = found else {
            return Self::of_vertex(table, facets);
        };
        let (ends, rays): (Vec<_>, Vec<_>) = found.rays.into_iter().partition(|r| r[0].is_positive());
        let opposite = |l: &Vec<BigInt>| l.iter().map(|v| -v).collect::<Vec<BigInt>>();
        let back: Vec<_> = found.lines.iter().map(opposite).collect();
        let inside = middle(&ends, &rays, &rows);
        let at = |r: &Vec<BigInt>| table.at(&r[0], &r[1..]);
        Ok(Self {
            point: at(&inside),
            ends: ends.iter().map(at).collect(),
            directions: rays.iter().chain(&found.lines).chain(&back).map(at).collect(),
            described: true,
        })
    }

    /// One vertex.
    fn of_vertex(table: &Tableau<'_>, facets: &[(usize, i8)]) -> Result<Self, Halt> {
        let mut corner = table.clone();
        for &(var, sign) in facets {
            corner.dictionary.constrain(var, sign)?;
        }
        corner.dictionary.repair()?;
        let zero = vec![BigInt::zero(); corner.dictionary.columns().len()];
        Ok(Self {
            point: corner.at(&BigInt::one(), &zero),
            ends: Vec::new(),
            directions: Vec::new(),
            described: false,
        })
    }

    /// Whether the polyhedron lies in that of a selection whose cell contains its point.
    pub(super) fn lies_in(&self, conditions: &ExactConditions, pieces: &[usize]) -> bool {
        let at = |p: &ExactPoint| super::exhaustive::contains(conditions, pieces, p);
        let along = |d: &ExactPoint| super::exhaustive::recedes(conditions, pieces, d);
        self.described && self.ends.iter().all(at) && self.directions.iter().all(along)
    }

    /// The directions in floating-point numbers, of the first `known` unknowns.
    pub(super) fn directions_to_f64(&self, known: usize) -> Vec<Vec<f64>> {
        let each = self.directions.iter().map(|d| {
            let own = &d.numerators[..known.min(d.numerators.len())];
            let largest = own.iter().map(BigInt::abs).max().filter(|m| !m.is_zero());
            let largest = largest.unwrap_or_else(BigInt::one);
            own.iter().map(|n| quotient(n, &largest, 0)).collect()
        });
        each.collect()
    }
}

/// A point inside, in homogeneous coordinates: the mean of the vertices and a step along all directions, in
/// short numbers; where rounding takes it out, the exact one.
fn middle(ends: &[Vec<BigInt>], rays: &[Vec<BigInt>], rows: &[Vec<BigInt>]) -> Vec<BigInt> {
    let width = rows.first().or(ends.first()).map_or(1, Vec::len);
    let sum = |k: usize| -> f64 {
        let mean = ends.iter().map(|e| quotient(&e[k], &e[0], 0) / ends.len() as f64);
        let step = rays.iter().map(|r| {
            let largest = r.iter().map(BigInt::abs).max().unwrap_or_else(BigInt::one);
            quotient(&r[k], &largest, 0)
        });
        mean.sum::<f64>() + step.sum::<f64>()
    };
    let short: Option<Vec<Exact>> = (1..width).map(|k| Exact::new(sum(k))).collect();
    if let Some(short) = short {
        let unit = short
            .iter()
            .filter_map(Exact::granularity)
            .min()
            .unwrap_or(0)
            .min(0);
        let at: Vec<BigInt> = std::iter::once(Exact::one())
            .chain(short)
            .map(|v| v.integer(-unit))
            .collect();
        let value = |row: &Vec<BigInt>| -> BigInt { row.iter().zip(&at).map(|(a, x)| a * x).sum() };
        if rows.iter().all(|row| value(row).is_positive()) {
            return at;
        }
    }
    // In homogeneous coordinates the sum of all generators is inside.
    let mut at = vec![BigInt::zero(); width];
    for generator in ends.iter().chain(rays) {
        at.iter_mut().zip(generator).for_each(|(a, g)| *a += g);
    }
    if at[0].is_zero() {
        at[0] = BigInt::one();
    }
    at
}

impl Tableau<'_> {
    /// The unknowns where the remaining columns are y/t; for t = 0 how they change along y.
    fn at(&self, t: &BigInt, y: &[BigInt]) -> ExactPoint {
        let numerator = |k: usize| -> BigInt {
            let entries = self.dictionary.entries(self.unknowns + k);
            let rates = entries[1..].iter().zip(y).map(|(a, y)| a * y);
            rates.fold(&entries[0] * t, |sum, term| sum + term)
        };
        let denominator = self.dictionary.denominator();
        ExactPoint {
            numerators: (0..self.conditions.unknowns).map(numerator).collect(),
            denominator: if t.is_zero() {
                denominator.clone()
            } else {
                denominator * t
            },
        }
    }
}
