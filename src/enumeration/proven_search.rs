//! The search over the pieces that are stated exactly: what it drops it proves, or lists as unproven.

use super::certificate::Certificates;
use super::stated::System;
use super::table::{Contradiction, Sign, Table};
use crate::clock::Deadline;

/// Sites compared before branching. Comparing all gives the smallest trees and, by measurement, not the shortest times.
const PROBES: usize = 3;
/// Numbers in the tables of nodes not yet entered, beyond which such tables are made anew when their turn comes: 512 MB.
const KEPT: usize = 1 << 26;
/// Numbers in all tables and lists of the path from the root, beyond which the search stops: 2 GB.
const HELD: usize = 1 << 28;

/// A piece of a site and the table behind that decision, if it was kept.
type Child = (usize, Option<Table>);

/// A site branched on, on the path from the root.
#[derive(Debug)]
struct Level {
    site: usize,
    /// Where the site stood in the list of undecided ones.
    position: usize,
    /// Selections below each child.
    share: f64,
    /// What is ruled out here is ruled out in the whole subtree.
    alive: Vec<Vec<usize>>,
    /// The node's own table, where not all children have theirs.
    parent: Option<Table>,
    children: std::vec::IntoIter<Child>,
    /// Numbers held for the lists and the parent.
    held: usize,
}

/// What the search may do and what it has done.
#[derive(Debug, Clone)]
pub(super) struct Search<'a> {
    system: &'a System,
    /// Variable of the first form of each site.
    offsets: Vec<usize>,
    max_nodes: u64,
    deadline: Deadline,
    pub(super) nodes: u64,
    pub(super) pivots: u64,
    /// Selections examined or ruled out, and all there are.
    pub(super) examined: f64,
    pub(super) total: f64,
    pub(super) stopped: bool,
    /// What proves contradictions, where they are to be proven.
    certificates: Option<&'a Certificates>,
    /// Partial choices (the piece of each site that is decided) that were dropped without a proof.
    pub(super) unproven: Vec<Vec<Option<usize>>>,
    chosen: Vec<usize>,
    /// Numbers held by levels and tables.
    held: usize,
    kept: usize,
    limit: usize,
}

impl<'a> Search<'a> {
    pub(super) fn new(system: &'a System, max_nodes: u64, deadline: Deadline) -> Self {
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
            certificates: None,
            unproven: Vec::new(),
            chosen: vec![0; system.sites.len()],
            held: 0,
            kept: KEPT,
            limit: HELD,
        }
    }

    /// Proves what it drops, or lists it in [`unproven`](Self::unproven).
    pub(super) fn certified(mut self, certificates: &'a Certificates) -> Self {
        self.certificates = Some(certificates);
        self
    }

    /// Whether a contradiction in a table is proven, or need not be.
    fn proven(&self, table: &Table, var: usize) -> bool {
        self.certificates.is_none_or(|c| c.proves(table, var))
    }

    /// Keeps account of a choice that was dropped without a proof: what is decided, and piece k of a site.
    fn doubt(&mut self, undecided: &[usize], last: Option<(usize, usize)>) {
        let mut partial: Vec<Option<usize>> = self.chosen.iter().map(|piece| Some(*piece)).collect();
        undecided.iter().for_each(|&site| partial[site] = None);
        if let Some((site, k)) = last {
            partial[site] = Some(self.system.sites[site].pieces[k].piece);
        }
        self.unproven.push(partial);
    }

    /// The table of all forms with the common equalities eliminated and what all pieces of a site imply required.
    pub(super) fn root(&self) -> Result<Table, Contradiction> {
        let sites = self.system.sites.iter().flat_map(|s| &s.forms);
        let mut table = Table::new(self.system.unknowns, self.system.common.iter().chain(sites));
        if self.certificates.is_some() {
            table.keep_fixed();
        }
        for var in 0..self.system.common.len() {
            table.fix(var)?;
        }
        let mut table = table.compact();
        let mut implied = Vec::new();
        for (site, &offset) in self.system.sites.iter().zip(&self.offsets) {
            implied.extend(site.implied.iter().map(|&(f, s)| (offset + f, Sign::of(s))));
        }
        for (var, sign) in implied {
            table.constrain(var, sign)?;
        }
        Ok(table)
    }

    /// Searches from a root; `leaf` receives each choice of pieces (by number in the map) that was not ruled out.
    pub(super) fn run<E>(
        &mut self,
        mut root: Table,
        leaf: &mut impl FnMut(&[usize]) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut undecided: Vec<usize> = (0..self.system.sites.len()).collect();
        if let Err(contradiction) = root.repair() {
            self.examined += self.total;
            if !self.proven(&root, contradiction.var) {
                self.doubt(&undecided, None);
            }
            return Ok(());
        }
        let all: Vec<Vec<usize>> = (self.system.sites.iter())
            .map(|s| (0..s.pieces.len()).collect())
            .collect();
        self.held = root.size();
        let mut path: Vec<Level> = Vec::new();
        let mut node = Some(root);
        loop {
            if let Some(table) = node.take() {
                if undecided.is_empty() {
                    self.held -= table.size();
                    self.examined += 1.0;
                    leaf(&self.chosen)?;
                } else {
                    let (alive, weight) = path.last().map_or((&all, self.total), |l| (&l.alive, l.share));
                    let Some(level) = self.branch(table, &mut undecided, alive.clone(), weight) else {
                        self.stopped = true;
                        return Ok(());
                    };
                    path.push(level);
                }
            }
            let Some(level) = path.last_mut() else {
                return Ok(());
            };
            if let Some((k, table)) = level.children.next() {
                self.chosen[level.site] = self.system.sites[level.site].pieces[k].piece;
                node = match (table, &level.parent) {
                    (None, Some(parent)) => self
                        .child(parent, &undecided, level.site, k)
                        .inspect(|t| self.held += t.size()),
                    (table, _) => table,
                };
            } else {
                self.held -= level.held;
                undecided.push(level.site);
                let end = undecided.len() - 1;
                undecided.swap(level.position, end);
                path.pop();
            }
        }
    }

    /// Chooses the site to branch on at a node; `None` at the cap on nodes or on memory.
    fn branch(
        &mut self,
        table: Table,
        undecided: &mut Vec<usize>,
        mut alive: Vec<Vec<usize>>,
        weight: f64,
    ) -> Option<Level> {
        let candidates = self.branching_sites(&table, undecided, &mut alive);
        let (position, children) = self.probe(&table, undecided, candidates, &mut alive)?;
        let site = undecided.swap_remove(position);
        let share = weight / self.system.sites[site].pieces.len() as f64;
        self.examined += share * (self.system.sites[site].pieces.len() - children.len()) as f64;
        let lists = alive.iter().map(|pieces| 3 + pieces.len()).sum::<usize>();
        let own = table.size();
        let parent = children.iter().any(|c| c.1.is_none()).then_some(table);
        let held = lists + if parent.is_some() { own } else { 0 };
        self.held += children.iter().flat_map(|c| &c.1).map(Table::size).sum::<usize>() + held;
        self.held -= own;
        (self.held <= self.limit).then(|| Level {
            site,
            position,
            share,
            alive,
            parent,
            children: children.into_iter(),
            held,
        })
    }

    /// The table with a site decided; `None` where that is infeasible.
    fn child(&mut self, table: &Table, undecided: &[usize], site: usize, k: usize) -> Option<Table> {
        let mut child = table.compact();
        let decided = self.decide(&mut child, site, k).and_then(|()| child.repair());
        self.pivots += child.pivots;
        if let Err(contradiction) = decided {
            if !self.proven(&child, contradiction.var) {
                self.doubt(undecided, Some((site, k)));
            }
            return None;
        }
        Some(child)
    }

    /// Of some candidate sites the one with the fewest pieces that are feasible, and the tables behind them; `None` at the cap.
    fn probe(
        &mut self,
        table: &Table,
        undecided: &[usize],
        candidates: Vec<usize>,
        alive: &mut [Vec<usize>],
    ) -> Option<(usize, Vec<Child>)> {
        let mut best: Option<(usize, Vec<Child>)> = None;
        for position in candidates {
            let site = undecided[position];
            let mut children = Vec::with_capacity(alive[site].len());
            for &k in &alive[site] {
                if self.nodes >= self.max_nodes || self.deadline.is_over() {
                    return None;
                }
                self.nodes += 1;
                if let Some(child) = self.child(table, undecided, site, k) {
                    let size = child.size();
                    let keep = self.held + size * (children.len() + 1) <= self.kept;
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
                zero && inside || !self.excluded(table, s, k, &reach)
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

    /// Whether a form proves that a piece, which it excludes at sight, cannot be chosen.
    fn excluded(&self, table: &Table, s: usize, k: usize, reach: &[(bool, bool)]) -> bool {
        let (piece, offset) = (&self.system.sites[s].pieces[k], self.offsets[s]);
        let wrong = |f: usize, (up, down): (bool, bool)| !(up && down) && self.proven(table, offset + f);
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
        for form in 0..description.forms.len() {
            if !piece.facets.iter().any(|f| f.0 == form) {
                table.forget(offset + form);
            }
        }
        Ok(())
    }
}
