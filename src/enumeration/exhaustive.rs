//! The search in exact arithmetic, for decisions that rounding leaves open.

use num_bigint::BigInt;
use num_traits::{One, Zero};

use super::EnumerationOptions;
use crate::clock::Deadline;
use crate::exact::{Dictionary, Exact, Halt, LOOKED_AT, quotient};
use crate::piecewise::{ExactConditions, ExactForm, ExactPiece, ExactSite};

/// Numbers that exact arithmetic may write at most: some seconds.
pub(super) const MAX_WORK: u64 = 20_000_000;

/// Numbers that exact arithmetic may write for each node that the search may have: some seconds at most.
const WORK_PER_NODE: u64 = 20;

/// The budget of exact arithmetic: numbers written, and time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget<'a> {
    left: u64,
    pub(super) deadline: Deadline<'a>,
}

impl<'a> Budget<'a> {
    pub(super) fn new(options: &EnumerationOptions, deadline: Deadline<'a>) -> Self {
        Self {
            left: MAX_WORK.min(options.max_nodes.saturating_mul(WORK_PER_NODE)),
            deadline,
        }
    }

    pub(super) fn is_spent(&self) -> bool {
        self.left == 0 || self.deadline.is_over()
    }

    pub(super) fn spend(&mut self, work: u64) {
        self.left = self.left.saturating_sub(work);
    }
}

/// A point as exact fractions over one denominator.
#[derive(Debug, Clone)]
pub(super) struct ExactPoint {
    pub(super) numerators: Vec<BigInt>,
    /// Positive.
    pub(super) denominator: BigInt,
}

impl PartialEq for ExactPoint {
    fn eq(&self, other: &Self) -> bool {
        let mut both = self.numerators.iter().zip(&other.numerators);
        both.all(|(a, b)| a * &other.denominator == b * &self.denominator)
    }
}

impl ExactPoint {
    pub(super) fn sign_of(&self, form: &ExactForm) -> i8 {
        let mut sum = &form.constant * &Exact::of(self.denominator.clone(), 0);
        for (a, n) in form.coefficients.iter().zip(&self.numerators) {
            if !a.is_zero() && !n.is_zero() {
                sum = &sum + &(a * &Exact::of(n.clone(), 0));
            }
        }
        sum.sign()
    }

    pub(super) fn coordinate(&self, k: usize) -> (Exact, Exact) {
        let exact = |v: &BigInt| Exact::of(v.clone(), 0);
        (exact(&self.numerators[k]), exact(&self.denominator))
    }

    /// The point half as far from 0.
    pub(super) fn halved(mut self) -> Self {
        self.denominator <<= 1;
        self
    }

    /// The sign of the change of a form along this vector.
    fn rate_of(&self, form: &ExactForm) -> i8 {
        let terms = form.coefficients.iter().zip(&self.numerators);
        let terms = terms.filter(|(a, n)| !a.is_zero() && !n.is_zero());
        let sum = terms.fold(Exact::default(), |sum, (a, n)| {
            &sum + &(a * &Exact::of(n.clone(), 0))
        });
        sum.sign()
    }

    /// The opposite point.
    pub(super) fn opposite(mut self) -> Self {
        self.numerators.iter_mut().for_each(|n| *n = -std::mem::take(n));
        self
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        let sum = |(a, b)| a * &other.denominator + b * &self.denominator;
        Self {
            numerators: self.numerators.iter().zip(&other.numerators).map(sum).collect(),
            denominator: &self.denominator * &other.denominator,
        }
    }

    pub(super) fn to_f64(&self) -> Vec<f64> {
        let value = |n| quotient(n, &self.denominator, 0);
        self.numerators.iter().map(value).collect()
    }
}

/// The forms of some sites in a dictionary.
pub(super) struct Tableau<'a> {
    pub(super) conditions: &'a ExactConditions,
    pub(super) dictionary: Dictionary<'a>,
    /// Variable of the first form of each site.
    pub(super) offsets: Vec<usize>,
    /// Variable of the first unknown.
    pub(super) unknowns: usize,
}

impl Clone for Tableau<'_> {
    fn clone(&self) -> Self {
        Self {
            conditions: self.conditions,
            dictionary: self.dictionary.clone(),
            offsets: self.offsets.clone(),
            unknowns: self.unknowns,
        }
    }
}

fn parts(form: &ExactForm) -> (&Exact, &[Exact]) {
    (&form.constant, &form.coefficients)
}

impl<'a> Tableau<'a> {
    /// With the work of at most one elimination, until it is taken.
    pub(super) fn new(conditions: &'a ExactConditions, deadline: Deadline<'a>) -> Self {
        let mut offsets = Vec::with_capacity(conditions.sites.len());
        let mut next = conditions.common.len();
        for site in &conditions.sites {
            offsets.push(next);
            next += site.forms.len();
        }
        let sites = conditions.sites.iter().flat_map(|s| &s.forms);
        let forms = conditions.common.iter().chain(sites).map(parts);
        Self {
            conditions,
            dictionary: Dictionary::new(conditions.unknowns, forms)
                .until(deadline)
                .within(MAX_WORK),
            offsets,
            unknowns: next,
        }
    }

    /// With the common rows eliminated and the conditions common to all pieces imposed.
    fn root(conditions: &'a ExactConditions, deadline: Deadline<'a>) -> Result<Self, Halt> {
        let mut root = Self::new(conditions, deadline);
        for var in 0..conditions.common.len() {
            root.dictionary.fix(var)?;
        }
        for (site, &offset) in conditions.sites.iter().zip(&root.offsets) {
            for &(form, sign) in &site.implied {
                root.dictionary.constrain(offset + form, sign)?;
            }
        }
        Ok(root)
    }

    /// Imposes the conditions of a piece; the signs of rows are restored by a repair.
    fn decide(&mut self, site: usize, piece: &ExactPiece) -> Result<(), Halt> {
        let offset = self.offsets[site];
        for &(form, sign) in &piece.facets {
            self.dictionary.constrain(offset + form, sign)?;
        }
        for &(_, form) in &piece.equalities {
            self.dictionary.fix(offset + form)?;
        }
        for form in 0..self.conditions.sites[site].forms.len() {
            if piece.facets.iter().all(|f| f.0 != form) {
                self.dictionary.forget(offset + form);
            }
        }
        Ok(())
    }

    /// The unknowns where the remaining columns have the given values.
    pub(super) fn point(&self, values: &[(BigInt, BigInt)]) -> ExactPoint {
        let scale: BigInt = values.iter().map(|v| &v.1).product();
        let numerator = |k: usize| {
            let entries = self.dictionary.entries(self.unknowns + k);
            let mut sum = &entries[0] * &scale;
            for (a, (n, d)) in entries[1..].iter().zip(values) {
                sum += a * n * (&scale / d);
            }
            sum
        };
        ExactPoint {
            numerators: (0..self.conditions.unknowns).map(numerator).collect(),
            denominator: self.dictionary.denominator() * scale,
        }
    }
}

/// Estimate of the work of eliminating the unknowns, as [`Dictionary::take_work`] counts it, without fill-in.
pub(super) fn elimination(conditions: &ExactConditions) -> u64 {
    let (n, mut forms, mut entries) = (conditions.unknowns as u64, 0u64, 0u64);
    for form in super::stated::forms(conditions) {
        forms += 1;
        entries += form.coefficients.iter().filter(|a| !a.is_zero()).count() as u64;
    }
    let looked_at = n.saturating_mul(forms) / LOOKED_AT;
    // Matrices that are half full fill in completely.
    let written = entries.saturating_mul(2 + n / 10);
    n.saturating_mul(looked_at.saturating_add(written)) / 2
}

/// All selections (by piece numbers of the map) that extend one of some partial ones and are not infeasible; and how many of the latter
/// were not searched completely, because of the cap on work.
pub(super) fn search(
    conditions: &ExactConditions,
    partial: &[Vec<Option<usize>>],
    budget: &mut Budget,
    leaf: &mut impl FnMut(Vec<usize>),
) -> u64 {
    if partial.is_empty() {
        return 0;
    }
    if budget.is_spent() || elimination(conditions) > MAX_WORK {
        return partial.len() as u64;
    }
    let mut root = match Tableau::root(conditions, budget.deadline) {
        Ok(root) => root,
        Err(Halt::Late) => return partial.len() as u64,
        Err(Halt::Infeasible) => {
            // The work of a contradiction is known only in its order of magnitude.
            budget.spend(elimination(conditions));
            return 0;
        }
    };
    budget.spend(root.dictionary.take_work());
    let open = partial
        .iter()
        .filter(|partial| !search_from(&root, partial, budget, leaf));
    open.count() as u64
}

/// `false` at the cap on work.
fn search_from(
    root: &Tableau<'_>,
    partial: &[Option<usize>],
    budget: &mut Budget,
    leaf: &mut impl FnMut(Vec<usize>),
) -> bool {
    if budget.is_spent() {
        return false;
    }
    let (conditions, mut root) = (root.conditions, root.clone());
    let mut start = || -> Result<(), Halt> {
        for (site, piece) in partial.iter().enumerate() {
            if let Some(piece) = piece {
                root.decide(site, piece_of(conditions, site, *piece).ok_or(Halt::Infeasible)?)?;
            }
        }
        root.dictionary.repair()
    };
    let started = start();
    budget.spend(root.dictionary.take_work());
    if let Err(halt) = started {
        return halt == Halt::Infeasible;
    }
    let order: Vec<usize> = (0..partial.len()).filter(|&s| partial[s].is_none()).collect();
    let mut open = vec![(Vec::new(), root)];
    while let Some((chosen, table)) = open.pop() {
        let Some(&site) = order.get(chosen.len()) else {
            let mut pieces: Vec<usize> = partial.iter().map(|p| p.unwrap_or(0)).collect();
            for (&site, &piece) in order.iter().zip(&chosen) {
                pieces[site] = piece;
            }
            leaf(pieces);
            continue;
        };
        for piece in &conditions.sites[site].pieces {
            if budget.is_spent() {
                return false;
            }
            let mut child = table.clone();
            let decided = child.decide(site, piece);
            let feasible = decided.and_then(|()| child.dictionary.repair());
            budget.spend(child.dictionary.take_work());
            match feasible {
                Ok(()) => {
                    let mut longer = chosen.clone();
                    longer.push(piece.piece);
                    open.push((longer, child));
                }
                Err(Halt::Infeasible) => {}
                Err(Halt::Late) => return false,
            }
        }
    }
    true
}

/// The piece of a site by its number in the map.
pub(super) fn piece_of(conditions: &ExactConditions, site: usize, piece: usize) -> Option<&ExactPiece> {
    conditions
        .sites
        .get(site)?
        .pieces
        .iter()
        .find(|p| p.piece == piece)
}

/// The point at which all common forms vanish, with the unknowns that they leave free set to 0, the last unknown among them if possible.
pub(super) fn common_point(conditions: &ExactConditions, deadline: Deadline<'_>) -> Result<ExactPoint, Halt> {
    if elimination(conditions) > MAX_WORK {
        return Err(Halt::Late);
    }
    let mut table = Tableau::new(conditions, deadline);
    let last = (table.unknowns + conditions.unknowns)
        .checked_sub(1)
        .ok_or(Halt::Infeasible)?;
    for var in 0..conditions.common.len() {
        // The last unknown is exchanged only where no other can be.
        table.dictionary.fix_among(var, |column| column != last)?;
        table.dictionary.fix(var)?;
    }
    let free = vec![(BigInt::zero(), BigInt::one()); table.dictionary.columns().len()];
    Ok(table.point(&free))
}

/// Whether a point meets all conditions of a selection.
pub(super) fn contains(conditions: &ExactConditions, pieces: &[usize], point: &ExactPoint) -> bool {
    meets(conditions, pieces, |form| point.sign_of(form))
}

/// Whether points that meet all conditions of a selection do so however far they are moved along a vector.
pub(super) fn recedes(conditions: &ExactConditions, pieces: &[usize], direction: &ExactPoint) -> bool {
    meets(conditions, pieces, |form| direction.rate_of(form))
}

fn meets(conditions: &ExactConditions, pieces: &[usize], sign_of: impl Fn(&ExactForm) -> i8) -> bool {
    let common = conditions.common.iter().map(|f| (f, 0));
    let sites = pieces.iter().enumerate().flat_map(|(site, &piece)| {
        let forms = &conditions.sites[site].forms;
        let piece = piece_of(conditions, site, piece).into_iter();
        piece.flat_map(move |p| {
            let zero = p.equalities.iter().map(|e| (&forms[e.1], 0));
            zero.chain(p.facets.iter().map(|f| (&forms[f.0], f.1)))
        })
    });
    common.chain(sites).all(|(form, wanted)| {
        let sign = sign_of(form);
        sign == 0 || sign == wanted
    })
}

/// The pieces of each site whose conditions a point meets.
pub(super) fn active(conditions: &ExactConditions, point: &ExactPoint) -> Vec<Vec<usize>> {
    let site = |site: &ExactSite| {
        let signs: Vec<i8> = site.forms.iter().map(|f| point.sign_of(f)).collect();
        let holds = |p: &&ExactPiece| {
            let mut facets = p.facets.iter();
            p.equalities.iter().all(|e| signs[e.1] == 0) && facets.all(|f| signs[f.0] * f.1 >= 0)
        };
        site.pieces.iter().filter(holds).map(|p| p.piece).collect()
    };
    conditions.sites.iter().map(site).collect()
}

/// Whether pieces of a site agree on each facet between them.
///
/// Where the facet is a form that vanishes in the other piece, they agree, as with complementarity. Elsewhere the rows of the map must be
/// continuous: J_σ − J_σ′ = a bᵀ with the normal b of the facet, constants included, for a piece σ′ beyond it.
pub(super) fn is_continuous(conditions: &ExactConditions, site: usize) -> bool {
    let ExactSite { forms, pieces, .. } = &conditions.sites[site];
    let across = |piece: &ExactPiece, (facet, sign): (usize, i8)| {
        let vanishes = |other: &ExactPiece| other.equalities.iter().any(|e| e.1 == facet);
        pieces.iter().any(|other| {
            let meets = other.facets.contains(&(facet, -sign)) && {
                let mut own = piece.equalities.iter();
                own.all(|&(row, form)| {
                    let there = other.equalities.iter().find(|e| e.0 == row);
                    there.is_some_and(|e| {
                        let difference = forms[form].plus(&-&Exact::one(), &forms[e.1]);
                        is_multiple(&difference, &forms[facet])
                    })
                })
            };
            other.piece != piece.piece && (vanishes(other) || meets)
        })
    };
    pieces.len() == 1 || pieces.iter().all(|p| p.facets.iter().all(|f| across(p, *f)))
}

/// Whether a form is a multiple of another one.
fn is_multiple(form: &ExactForm, other: &ExactForm) -> bool {
    let numbers = |f: &'_ ExactForm| -> Vec<Exact> {
        std::iter::once(&f.constant)
            .chain(&f.coefficients)
            .cloned()
            .collect()
    };
    let (a, b) = (numbers(form), numbers(other));
    let Some(k) = b.iter().position(|v| !v.is_zero()) else {
        return a.iter().all(Exact::is_zero);
    };
    a.iter().zip(&b).all(|(a_j, b_j)| a_j * &b[k] == b_j * &a[k])
}
