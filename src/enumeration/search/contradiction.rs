//! Contradictions at the root.

use super::SelectionSearch;
use crate::enumeration::table::Table;

impl SelectionSearch<'_> {
    /// The proof that the conditions that hold for all selections contradict each other, those of sites with
    /// one piece among them, from the table and the variable whose row shows it.
    pub(in crate::enumeration) fn contradiction<R>(
        &self,
        prove: impl Fn(&Table, usize) -> Option<R>,
    ) -> Option<R> {
        let mut root = self.root(&[]).ok()?;
        for site in (0..self.system.sites.len()).filter(|&s| self.system.sites[s].pieces.len() == 1) {
            self.decide(&mut root, site, 0).ok()?;
        }
        let var = root.repair_uncertain(self.deadline).err()?.var;
        prove(&root, var)
    }
}
