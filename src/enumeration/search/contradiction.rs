//! Contradictions at the root.

use super::SelectionSearch;
use crate::enumeration::table::{Table, VAGUE};

/// How often error bounds are set back. Where a contradiction is proven from the forms themselves, they only say
/// when a coefficient counts as zero; after some hundred exchanges of full tables they are far too large.
const RESETS: usize = 20;

impl SelectionSearch<'_> {
    /// The proof that the conditions that hold for all selections contradict each other, those of sites with one
    /// piece among them, from the table and the variable whose row shows it.
    pub(in crate::enumeration) fn contradiction<R>(
        &self,
        prove: impl Fn(&Table, usize) -> Option<R>,
    ) -> Option<R> {
        let mut root = self.root(&[]).ok()?;
        for site in (0..self.system.sites.len()).filter(|&s| self.system.sites[s].pieces.len() == 1) {
            self.decide(&mut root, site, 0).ok()?;
        }
        for _ in 0..RESETS {
            let var = root.repair(self.deadline).err()?.var;
            let proof = prove(&root, var);
            if proof.is_some() || root.error(var) <= VAGUE {
                return proof;
            }
            root.forget_errors();
        }
        None
    }
}
