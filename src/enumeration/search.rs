//! Depth-first search over the pieces of the sites, pruned by infeasibility of what has been decided.

use super::hull;
use super::system::System;
use super::table::{Contradiction, Place, Sign, Table};

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
    pub(super) nodes: u64,
    pub(super) pivots: u64,
    /// Selections examined or ruled out, and all there are.
    pub(super) examined: f64,
    pub(super) total: f64,
    pub(super) stopped: bool,
    /// Numbers held by levels and tables.
    held: usize,
    kept: usize,
    limit: usize,
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
            held: 0,
            kept: KEPT,
            limit: HELD,
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
        mut root: Table,
        leaf: &mut impl FnMut(&[usize]) -> Result<(), E>,
    ) -> Result<(), E> {
        if root.repair().is_err() {
            self.examined += self.total;
            return Ok(());
        }
        let mut undecided: Vec<usize> = (0..self.system.sites.len()).collect();
        let mut chosen = vec![0; undecided.len()];
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
                    leaf(&chosen)?;
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
                chosen[level.site] = self.system.sites[level.site].pieces[k].piece;
                node = match (table, &level.parent) {
                    (None, Some(parent)) => self
                        .child(parent, level.site, k)
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
    fn child(&mut self, table: &Table, site: usize, k: usize) -> Option<Table> {
        let mut child = table.compact();
        let decided = self.decide(&mut child, site, k).and_then(|()| child.repair());
        self.pivots += child.pivots;
        decided.is_ok().then_some(child)
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
                if self.nodes >= self.max_nodes {
                    return None;
                }
                self.nodes += 1;
                if let Some(child) = self.child(table, site, k) {
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

#[cfg(test)]
mod tests {
    use super::super::system;
    use super::*;
    use crate::piecewise::MinMap;

    /// All leaves of a search with the given limits, its nodes, and whether it was stopped.
    fn search(kept: usize, limit: usize) -> (Vec<Vec<usize>>, u64, bool) {
        // xᵢ = 0 or 1 for each i: min(x, 1 − x) = 0, coupled weakly.
        let map = MinMap::new(6, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            for i in 0..6 {
                a[i] = x[i];
                b[i] = 1.0 - x[i] + 0.1 * x[(i + 1) % 6];
            }
        });
        let owner = system::owners(&map, 0..6).unwrap();
        let system = system::at_parameter(&map, &owner, &[0.0; 6]).unwrap();
        let mut search = Search::new(&system, 1000);
        (search.kept, search.limit) = (kept, limit);
        let mut leaves = Vec::new();
        let root = search.root(&[]).unwrap();
        let all = search.run(root, &mut |pieces: &[usize]| {
            leaves.push(pieces.to_vec());
            Ok::<(), ()>(())
        });
        assert_eq!(all, Ok(()));
        assert!(
            search.stopped || search.held == 0,
            "{} numbers are left",
            search.held
        );
        (leaves, search.nodes, search.stopped)
    }

    #[test]
    fn tables_made_anew_give_the_same_leaves() {
        let kept = search(KEPT, HELD);
        assert_eq!((kept.0.len(), kept.2), (64, false));
        assert_eq!(search(0, HELD), kept);
        assert_eq!(search(400, HELD), kept);
    }

    #[test]
    fn memory_stops_the_search() {
        let (leaves, _, stopped) = search(KEPT, 300);
        assert!(stopped && leaves.len() < 64, "{} leaves", leaves.len());
    }
}
