//! Depth-first search over the pieces of the sites, pruned by infeasibility of what has been decided.

use super::hull;
use super::system::System;
use super::table::{Contradiction, Place, Sign, Table};

/// Sites compared before branching. Comparing all gives the smallest trees and, by measurement, not the shortest times.
const PROBES: usize = 3;

/// What the search may do and what it has done.
#[derive(Debug, Clone)]
pub(super) struct Search<'a> {
    system: &'a System,
    /// Variable of the first form of each site.
    offsets: Vec<usize>,
    max_nodes: u64,
    pub(super) nodes: u64,
    pub(super) pivots: u64,
    /// Selections examined or ruled out, and all there are.
    pub(super) examined: f64,
    pub(super) total: f64,
    pub(super) stopped: bool,
}

impl<'a> Search<'a> {
    pub(super) fn new(system: &'a System, max_nodes: u64) -> Self {
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
            nodes: 0,
            pivots: 0,
            examined: 0.0,
            total: system.sites.iter().map(|s| s.pieces.len() as f64).product(),
            stopped: false,
        }
    }

    /// The table of all forms with the common equalities eliminated and what all pieces of a site imply required.
    pub(super) fn root(&self, extra: &[super::table::Form]) -> Result<Table, Contradiction> {
        let sites = self.system.sites.iter().flat_map(|s| &s.forms);
        let mut table = Table::new(self.system.unknowns, self.system.common.iter().chain(sites));
        for form in extra {
            table.fix_form(form)?;
        }
        for var in 0..self.system.common.len() {
            table.fix(var)?;
        }
        let mut table = table.compact();
        let mut implied = Vec::new();
        for (site, &offset) in self.system.sites.iter().zip(&self.offsets) {
            for (form, sign) in hull::implied(site, offset, &table) {
                implied.push((offset + form, sign));
            }
        }
        for (var, sign) in implied {
            table.constrain(var, sign)?;
        }
        Ok(table)
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

    /// Searches from a root; `leaf` receives each choice of pieces (by number in the map) that was not ruled out.
    pub(super) fn run<E>(
        &mut self,
        mut table: Table,
        leaf: &mut impl FnMut(&[usize]) -> Result<(), E>,
    ) -> Result<(), E> {
        let total = self.total;
        if table.repair().is_err() {
            self.examined += total;
            return Ok(());
        }
        let mut undecided: Vec<usize> = (0..self.system.sites.len()).collect();
        let mut chosen = vec![0; undecided.len()];
        let alive: Vec<Vec<usize>> = (self.system.sites.iter())
            .map(|s| (0..s.pieces.len()).collect())
            .collect();
        self.descend(&table, &mut undecided, &alive, &mut chosen, total, leaf)
    }

    fn descend<E>(
        &mut self,
        table: &Table,
        undecided: &mut Vec<usize>,
        alive: &[Vec<usize>],
        chosen: &mut [usize],
        weight: f64,
        leaf: &mut impl FnMut(&[usize]) -> Result<(), E>,
    ) -> Result<(), E> {
        if undecided.is_empty() {
            self.examined += 1.0;
            return leaf(chosen);
        }
        // What is ruled out here is ruled out in the whole subtree.
        let mut alive = alive.to_vec();
        let candidates = self.branching_sites(table, undecided, &mut alive);
        let Some((position, children)) = self.probe(table, undecided, candidates, &mut alive) else {
            self.stopped = true;
            return Ok(());
        };
        let site = undecided.swap_remove(position);
        let pieces = &self.system.sites[site].pieces;
        let share = weight / pieces.len() as f64;
        self.examined += share * (pieces.len() - children.len()) as f64;
        for (k, child) in children {
            chosen[site] = pieces[k].piece;
            self.descend(&child, undecided, &alive, chosen, share, leaf)?;
            if self.stopped {
                break;
            }
        }
        undecided.push(site);
        let end = undecided.len() - 1;
        undecided.swap(position, end);
        Ok(())
    }

    /// Of some candidate sites the one with the fewest pieces that are feasible, and the tables behind them; `None` at the cap.
    fn probe(
        &mut self,
        table: &Table,
        undecided: &[usize],
        candidates: Vec<usize>,
        alive: &mut [Vec<usize>],
    ) -> Option<(usize, Vec<(usize, Table)>)> {
        let mut best: Option<(usize, Vec<(usize, Table)>)> = None;
        for position in candidates {
            let site = undecided[position];
            let mut children = Vec::with_capacity(alive[site].len());
            for &k in &alive[site] {
                if self.nodes >= self.max_nodes {
                    return None;
                }
                self.nodes += 1;
                let mut child = table.compact();
                let decided = self.decide(&mut child, site, k).and_then(|()| child.repair());
                self.pivots += child.pivots;
                if decided.is_ok() {
                    children.push((k, child));
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
        best
    }

    /// The undecided sites worth branching on, by position: those with the fewest pieces that are not ruled out at sight first,
    /// among them those that the present vertex of the relaxed problem violates most.
    fn branching_sites(&self, table: &Table, undecided: &[usize], alive: &mut [Vec<usize>]) -> Vec<usize> {
        let mut all: Vec<(usize, f64, usize)> = Vec::with_capacity(undecided.len());
        let mut reach = Vec::new();
        for (position, &s) in undecided.iter().enumerate() {
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
                zero && inside
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
        all.into_iter().take(count).map(|a| a.2).collect()
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
        for form in 0..description.forms.len() {
            if !piece.facets.iter().any(|f| f.0 == form) {
                table.forget(offset + form);
            }
        }
        Ok(())
    }
}
