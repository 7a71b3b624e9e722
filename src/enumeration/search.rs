//! Depth-first search over the pieces of the sites, pruned by infeasibility of partial selections. With certificates every subtree that is
//! dropped is proven to contain no solution, or listed as unproven.
//!
//! Without certificates, once a search takes many nodes, each node is tightened first: all pieces of all undecided sites are tried, and a
//! sign that a form has in every remaining piece is imposed.

mod contradiction;

use super::certificate::{Basis, Certificates};
use super::hull;
use super::system::System;
use super::table::{Contradiction, Form, Place, Sign, Table, VAGUE};
use crate::clock::Deadline;
use crate::tolerances::{GIGABYTE, HALF_DIGITS};

/// Sites compared before branching. Comparing all gives the smallest trees and, by measurement, not the shortest times.
const PROBES: usize = 3;

/// Nodes after which every node is tightened before branching, which does not pay in small trees.
const HARD: u64 = 1000;
/// Rounds of tightening at one node, and of recomputing a table.
const ROUNDS: usize = 3;

/// A piece of a site and the table after that decision, if it was kept.
type Child = (usize, Option<Table>);

/// For each site whether its pieces are among those of a box of selections.
type Within = Vec<Vec<bool>>;

/// A site branched on, on the path from the root.
#[derive(Debug)]
struct Level {
    site: usize,
    /// Where the site stood in the list of undecided ones.
    position: usize,
    /// Selections below each child.
    share: f64,
    /// Pieces excluded here, and so in the whole subtree.
    alive: Vec<Vec<usize>>,
    /// The node's own table, where not all children have theirs.
    parent: Option<Table>,
    children: std::vec::IntoIter<Child>,
    /// Numbers stored for the lists and the parent.
    stored: usize,
}

/// Why a node has no children.
enum Leave {
    /// Its subtree contains no solution that is not known.
    Done,
    /// A limit was reached.
    Stop,
}

impl From<Contradiction> for Leave {
    fn from(_: Contradiction) -> Self {
        Self::Done
    }
}

/// The limits of the search and its progress.
#[derive(Debug, Clone)]
pub(super) struct SelectionSearch<'a> {
    system: &'a System,
    /// Variable of the first form of each site.
    offsets: Vec<usize>,
    max_nodes: u64,
    deadline: Deadline<'a>,
    pub(super) nodes: u64,
    pub(super) pivots: u64,
    /// Selections examined or excluded, and their total number.
    pub(super) examined: f64,
    pub(super) total: f64,
    pub(super) stopped: bool,
    /// The pieces chosen on the path from the root.
    decided: Vec<Option<usize>>,
    /// Boxes of selections whose solutions are all known.
    settled: Vec<Within>,
    /// The certificates of contradictions, where these are to be proven.
    certificates: Option<&'a Certificates>,
    /// Partial choices (the piece of each site that is decided) that were dropped without a proof.
    pub(super) unproven: Vec<Vec<Option<usize>>>,
    /// The table at the root of the present search.
    root: Option<Table>,
    /// The table in which the conditions that hold for all selections contradict each other, and the variable
    /// whose row shows it.
    pub(super) contradicted: Option<(Table, usize)>,
    /// Numbers stored by levels and tables.
    stored: usize,
    kept: usize,
    limit: usize,
}

impl<'a> SelectionSearch<'a> {
    pub(super) fn new(
        system: &'a System,
        certificates: Option<&'a Certificates>,
        max_nodes: u64,
        deadline: Deadline<'a>,
    ) -> Self {
        let mut offsets = Vec::with_capacity(system.sites.len());
        let mut next = system.common.len();
        for site in &system.sites {
            offsets.push(next);
            next += site.forms.len();
        }
        Self {
            system,
            offsets,
            max_nodes,
            deadline,
            nodes: 0,
            pivots: 0,
            examined: 0.0,
            total: system.sites.iter().map(|s| s.pieces.len() as f64).product(),
            stopped: false,
            decided: vec![None; system.sites.len()],
            settled: Vec::new(),
            certificates,
            unproven: Vec::new(),
            root: None,
            contradicted: None,
            stored: 0,
            kept: GIGABYTE / 2,
            limit: 2 * GIGABYTE,
        }
    }

    /// Whether a contradiction in a table is proven, or need not be.
    fn proven(&self, table: &Table, var: usize) -> bool {
        self.proven_by(&Basis::until(self.deadline), table, var)
    }

    fn proven_by(&self, basis: &Basis<'_>, table: &Table, var: usize) -> bool {
        self.certificates.is_none_or(|c| c.proves(table, var, basis))
    }

    /// Records a partial selection that was dropped without a proof: the decided pieces, and piece k of a site.
    fn doubt(&mut self, last: Option<(usize, usize)>) {
        let mut decided = self.decided.clone();
        if let Some((site, k)) = last {
            decided[site] = Some(k);
        }
        let pieces = decided.iter().zip(&self.system.sites);
        let partial = pieces.map(|(k, site)| k.map(|k| site.pieces[k].pieces[0]));
        self.unproven.push(partial.collect());
    }

    /// The table of all forms with the common equalities eliminated and the signs implied by all pieces of a site imposed.
    pub(super) fn root(&self, extra: &[Form]) -> Result<Table, Contradiction> {
        let mut table = Table::new(self.system.unknowns, self.system.forms());
        if self.certificates.is_some() {
            table.keep_fixed();
        }
        for form in extra {
            table.fix_form(form)?;
        }
        for var in 0..self.system.common.len() {
            table.fix(var)?;
        }
        let mut table = table.compact();
        let mut implied = Vec::new();
        for (site, &offset) in self.system.sites.iter().zip(&self.offsets) {
            if let Some(known) = &site.implied {
                implied.extend(known.iter().map(|&(form, s)| (offset + form, Sign::of(s))));
                continue;
            }
            let forms = hull::forms(site, offset, &table).unwrap_or_default();
            let found = hull::implied(&forms, site.pieces.iter());
            implied.extend(found.into_iter().map(|(form, sign)| (offset + form, sign)));
        }
        for (var, sign) in implied {
            table.constrain(var, sign)?;
        }
        Ok(table)
    }

    /// The variable of a form of a site.
    pub(super) fn variable(&self, site: usize, form: usize) -> usize {
        self.offsets[site] + form
    }

    /// The forms that have one sign in all pieces of their site, with that sign.
    pub(super) fn implied(&self, table: &Table) -> Vec<(usize, f64)> {
        let first = self.system.common.len();
        let last = first + self.system.sites.iter().map(|s| s.forms.len()).sum::<usize>();
        (first..last)
            .filter(|&var| table.sign(var) != Sign::Free && table.place(var) != Place::Gone)
            .map(|var| (var, table.sign(var).factor()))
            .collect()
    }

    /// Searches from a root; `leaf` receives each selection (by piece numbers of the map) that was not excluded. It may return a box, a set
    /// of pieces for each site that has a choice, whose solutions are all known: the search skips it.
    pub(super) fn run<E>(
        &mut self,
        mut root: Table,
        leaf: &mut impl FnMut(&[usize]) -> Result<Option<Vec<Vec<usize>>>, E>,
    ) -> Result<(), E> {
        self.decided.fill(None);
        self.root = Some(root.clone());
        if let Err(contradiction) = self.clearly(&mut root, |root| root.repair(self.deadline)) {
            self.examined += self.total;
            if !self.proven(&root, contradiction.var) {
                self.doubt(None);
            }
            self.contradicted = Some((root, contradiction.var));
            return Ok(());
        }
        let mut undecided: Vec<usize> = (0..self.system.sites.len()).collect();
        let mut chosen = vec![0; self.system.sites.iter().map(|s| s.slots.len()).sum()];
        let all: Vec<Vec<usize>> = (self.system.sites.iter())
            .map(|s| (0..s.pieces.len()).collect())
            .collect();
        self.stored = root.size();
        let mut path: Vec<Level> = Vec::new();
        let mut node = Some(root);
        loop {
            if let Some(table) = node.take() {
                let (alive, weight) = path.last().map_or((&all, self.total), |l| (&l.alive, l.share));
                if undecided.is_empty() {
                    self.stored -= table.size();
                    self.examined += 1.0;
                    if self.outside(&undecided, alive).is_none_or(|o| !o.is_empty()) {
                        let settled = leaf(&chosen)?;
                        self.settled.extend(settled.map(|pieces| self.within(&pieces)));
                    }
                } else {
                    let own = table.size();
                    match self.branch(table, &mut undecided, alive.clone(), weight) {
                        Ok(level) => path.push(level),
                        Err(Leave::Done) => self.examined += weight,
                        Err(Leave::Stop) => {
                            self.stopped = true;
                            return Ok(());
                        }
                    }
                    self.stored -= own;
                }
            }
            let Some(level) = path.last_mut() else {
                return Ok(());
            };
            let site = &self.system.sites[level.site];
            if let Some((k, table)) = level.children.next() {
                self.decided[level.site] = Some(k);
                for (slot, piece) in site.slots.iter().zip(&site.pieces[k].pieces) {
                    chosen[*slot] = *piece;
                }
                node = match (table, &level.parent) {
                    (None, Some(parent)) => self
                        .child(parent, level.site, k)
                        .inspect(|t| self.stored += t.size()),
                    (table, _) => table,
                };
            } else {
                self.stored -= level.stored;
                self.decided[level.site] = None;
                undecided.push(level.site);
                let end = undecided.len() - 1;
                undecided.swap(level.position, end);
                path.pop();
            }
        }
    }

    /// Whether a limit is reached.
    fn is_over(&self) -> bool {
        self.nodes >= self.max_nodes || self.deadline.is_over()
    }

    fn within(&self, pieces: &[Vec<usize>]) -> Within {
        let sites = self.system.sites.iter();
        sites
            .map(|site| {
                let inside = |own: &[usize]| {
                    let mut slots = site.slots.iter().zip(own);
                    slots.all(|(slot, piece)| pieces[*slot].contains(piece))
                };
                site.pieces.iter().map(|p| inside(&p.pieces)).collect()
            })
            .collect()
    }

    /// If the decided pieces of the node lie in a settled box: the undecided sites, by position, at which a selection may leave the box,
    /// with the pieces that do.
    fn outside(&self, undecided: &[usize], alive: &[Vec<usize>]) -> Option<Vec<(usize, Vec<usize>)>> {
        let decided = |within: &&Within| {
            let mut sites = self.decided.iter().zip(*within);
            sites.all(|(k, within)| k.is_none_or(|k| within[k]))
        };
        let within = self.settled.iter().find(decided)?;
        let leaving = |(position, &s): (usize, &usize)| {
            let pieces: Vec<usize> = alive[s].iter().copied().filter(|&k| !within[s][k]).collect();
            (!pieces.is_empty()).then_some((position, pieces))
        };
        Some(undecided.iter().enumerate().filter_map(leaving).collect())
    }

    /// Chooses the site to branch on at a node.
    fn branch(
        &mut self,
        mut table: Table,
        undecided: &mut Vec<usize>,
        mut alive: Vec<Vec<usize>>,
        weight: f64,
    ) -> Result<Level, Leave> {
        let mut candidates = self.branching_sites(&table, undecided, &mut alive)?;
        let mut leaves = None;
        if let Some(leaving) = self.outside(undecided, &alive) {
            for (position, pieces) in leaving {
                let s = undecided[position];
                for k in pieces {
                    match self.tried(&table, s, k)? {
                        Some(_) => leaves = leaves.or(Some(position)),
                        None => alive[s].retain(|&p| p != k),
                    }
                }
            }
            candidates = vec![leaves.ok_or(Leave::Done)?];
        }
        if self.certificates.is_none() && self.nodes >= HARD {
            self.tighten(&mut table, undecided, &mut alive)?;
            let ranked = self.branching_sites(&table, undecided, &mut alive)?;
            candidates = leaves.map_or(ranked, |position| vec![position]);
        }
        let (position, children) = self.probe(&table, undecided, candidates, &mut alive)?;
        let site = undecided[position];
        let share = weight / self.system.sites[site].pieces.len() as f64;
        let lists = alive.iter().map(|pieces| 3 + pieces.len()).sum::<usize>();
        let parent = children.iter().any(|c| c.1.is_none()).then_some(table);
        let stored = lists + parent.as_ref().map_or(0, Table::size);
        self.stored += children.iter().flat_map(|c| &c.1).map(Table::size).sum::<usize>() + stored;
        if self.stored > self.limit {
            return Err(Leave::Stop);
        }
        self.examined += share * (self.system.sites[site].pieces.len() - children.len()) as f64;
        undecided.swap_remove(position);
        Ok(Level {
            site,
            position,
            share,
            alive,
            parent,
            children: children.into_iter(),
            stored,
        })
    }

    /// Excludes pieces of all undecided sites, and imposes on the table the signs that forms have in all remaining pieces.
    fn tighten(
        &mut self,
        table: &mut Table,
        undecided: &[usize],
        alive: &mut [Vec<usize>],
    ) -> Result<(), Leave> {
        for _ in 0..ROUNDS {
            let mut changed = false;
            for &s in undecided {
                let mut signs = self.open_signs(table, s);
                let mut left = Vec::with_capacity(alive[s].len());
                for &k in &alive[s] {
                    let Some(mut child) = self.tried(table, s, k)? else {
                        continue;
                    };
                    let vanishing = &self.system.sites[s].pieces[k].equalities;
                    let offset = self.offsets[s];
                    signs.retain(|&(form, sign)| {
                        vanishing.contains(&form) || child.is_bounded(offset + form, sign)
                    });
                    self.pivots += std::mem::take(&mut child.pivots);
                    left.push(k);
                }
                if left.is_empty() {
                    return Err(Leave::Done);
                }
                changed |= left.len() < alive[s].len() || !signs.is_empty();
                alive[s] = left;
                for (form, sign) in signs {
                    table.constrain(self.offsets[s] + form, sign)?;
                }
            }
            table.repair(self.deadline)?;
            if !changed {
                break;
            }
        }
        Ok(())
    }

    /// Signs of the forms of a site that are not imposed yet.
    fn open_signs(&self, table: &Table, site: usize) -> Vec<(usize, Sign)> {
        let forms = 0..self.system.sites[site].forms.len();
        let both = forms.flat_map(|f| [(f, Sign::Positive), (f, Sign::Negative)]);
        both.filter(|&(f, sign)| {
            let var = self.offsets[site] + f;
            table.place(var) != Place::Gone && table.sign(var) != sign
        })
        .collect()
    }

    /// The table of a piece that is tried, with all forms of its site; `None` where it is infeasible, with a proof if proofs are required.
    fn tried(&mut self, table: &Table, site: usize, k: usize) -> Result<Option<Table>, Leave> {
        if self.is_over() {
            return Err(Leave::Stop);
        }
        self.nodes += 1;
        let mut child = table.compact();
        let decided = self.clearly(&mut child, |child| {
            self.decide(child, site, k)?;
            child.repair(self.deadline)
        });
        self.pivots += child.pivots;
        let possible = decided.map_or_else(|c| !self.proven(&child, c.var), |()| true);
        Ok(possible.then_some(child))
    }

    /// The table with a site decided; `None` where that is infeasible.
    fn child(&mut self, table: &Table, site: usize, k: usize) -> Option<Table> {
        let mut child = table.compact();
        let decided = self.clearly(&mut child, |child| {
            self.decide(child, site, k)?;
            self.forget(child, site, k);
            child.repair(self.deadline)
        });
        self.pivots += child.pivots;
        if let Err(contradiction) = decided {
            if !self.proven(&child, contradiction.var) {
                self.doubt(Some((site, k)));
            }
            return None;
        }
        Some(child)
    }

    /// The result of some steps on a table. They are repeated on the recomputed table where rounding errors are large; what is then still
    /// within rounding is no contradiction.
    fn clearly(
        &self,
        table: &mut Table,
        steps: impl Fn(&mut Table) -> Result<(), Contradiction>,
    ) -> Result<(), Contradiction> {
        let mut verdict = steps(table);
        for _ in 0..ROUNDS {
            let error = verdict.map_or_else(|c| table.error(c.var), |()| table.largest_error());
            if self.certificates.is_some() || error <= VAGUE {
                return verdict;
            }
            let Some(anew) = self.root.as_ref().and_then(|root| table.reinverted(root)) else {
                break;
            };
            *table = anew;
            verdict = steps(table);
        }
        verdict.or_else(|c| {
            if table.error(c.var) <= HALF_DIGITS {
                Err(c)
            } else {
                Ok(())
            }
        })
    }

    /// The candidate site with the fewest feasible pieces, and the tables of these pieces.
    fn probe(
        &mut self,
        table: &Table,
        undecided: &[usize],
        candidates: Vec<usize>,
        alive: &mut [Vec<usize>],
    ) -> Result<(usize, Vec<Child>), Leave> {
        let mut best: Option<(usize, Vec<Child>)> = None;
        for position in candidates {
            let site = undecided[position];
            let mut children = Vec::with_capacity(alive[site].len());
            for &k in &alive[site] {
                if self.is_over() {
                    return Err(Leave::Stop);
                }
                self.nodes += 1;
                if let Some(child) = self.child(table, site, k) {
                    let size = child.size();
                    let keep = self.stored + size * (children.len() + 1) <= self.kept;
                    children.push((k, keep.then_some(child)));
                }
            }
            alive[site].retain(|k| children.iter().any(|c| c.0 == *k));
            if best.as_ref().is_none_or(|b| children.len() < b.1.len()) {
                best = Some((position, children));
            }
            if best.as_ref().is_some_and(|b| b.1.len() <= 1) {
                break;
            }
        }
        best.ok_or(Leave::Done)
    }

    /// The undecided sites worth branching on, by position: first those with the fewest pieces that are not excluded by signs alone,
    /// among them those whose conditions the present vertex of the relaxed problem violates most.
    fn branching_sites(
        &self,
        table: &Table,
        undecided: &[usize],
        alive: &mut [Vec<usize>],
    ) -> Result<Vec<usize>, Leave> {
        let basis = Basis::until(self.deadline);
        let mut all: Vec<(usize, f64, usize)> = Vec::with_capacity(undecided.len());
        let mut reach = Vec::new();
        for (position, &s) in undecided.iter().enumerate() {
            if self.deadline.is_over() {
                return Err(Leave::Stop);
            }
            let (site, offset) = (&self.system.sites[s], self.offsets[s]);
            reach.clear();
            reach.extend((0..site.forms.len()).map(|f| table.reach(offset + f)));
            let mut distance = f64::INFINITY;
            alive[s].retain(|&k| {
                let piece = &site.pieces[k];
                let zero = piece.equalities.iter().all(|&f| reach[f] == (true, true));
                let inside = piece.facets.iter().all(|&(f, sign)| {
                    let (up, down) = reach[f];
                    if sign > 0.0 { up } else { down }
                });
                let off = piece.equalities.iter().map(|&f| table.value(offset + f).abs());
                let wrong = piece
                    .facets
                    .iter()
                    .map(|&(f, sign)| -sign * table.value(offset + f));
                if zero && inside {
                    distance = distance.min(off.chain(wrong).fold(0.0, f64::max));
                }
                zero && inside || !self.excluded(&basis, table, s, k, &reach)
            });
            all.push((alive[s].len(), distance, position));
        }
        all.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)).then(a.2.cmp(&b.2)));
        // A site without choice needs no comparison.
        let count = if all.first().is_some_and(|a| a.0 <= 1) {
            1
        } else {
            PROBES
        };
        Ok(all.into_iter().take(count).map(|a| a.2).collect())
    }

    /// Whether a form proves, where proofs are required, that a piece excluded by its sign cannot be chosen.
    fn excluded(&self, basis: &Basis<'_>, table: &Table, s: usize, k: usize, reach: &[(bool, bool)]) -> bool {
        let (piece, offset) = (&self.system.sites[s].pieces[k], self.offsets[s]);
        let wrong =
            |f: usize, (up, down): (bool, bool)| !(up && down) && self.proven_by(basis, table, offset + f);
        let facets = piece.facets.iter();
        piece.equalities.iter().any(|&f| wrong(f, reach[f]))
            || facets.into_iter().any(|&(f, sign)| {
                let (up, down) = reach[f];
                wrong(f, if sign > 0.0 { (up, true) } else { (true, down) })
            })
    }

    fn decide(&self, table: &mut Table, site: usize, k: usize) -> Result<(), Contradiction> {
        let (description, offset) = (&self.system.sites[site], self.offsets[site]);
        let piece = &description.pieces[k];
        for &(form, sign) in &piece.facets {
            table.constrain(offset + form, Sign::of(sign))?;
        }
        for &form in &piece.equalities {
            table.fix(offset + form)?;
        }
        Ok(())
    }

    /// Drops the forms of a decided site that are redundant.
    fn forget(&self, table: &mut Table, site: usize, k: usize) {
        let description = &self.system.sites[site];
        for form in 0..description.forms.len() {
            if !description.pieces[k].facets.iter().any(|f| f.0 == form) {
                table.forget(self.offsets[site] + form);
            }
        }
    }
}

#[cfg(test)]
mod tests;
