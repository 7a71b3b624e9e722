//! Conditions common to all pieces of a site: signs of its forms that hold for every piece. They prune the search from its
//! root on (for Coulomb friction: uν ≤ 0, λν ≥ 0, |λt| ≤ F λν).

use super::system::{Piece, Site};
use super::table::{Form, Sign, Table};
use crate::clock::Deadline;

/// The forms of a site over the columns of a table in which all of them are rows.
pub(super) fn forms(site: &Site, offset: usize, table: &Table) -> Option<Vec<Form>> {
    (0..site.forms.len()).map(|f| table.form(offset + f)).collect()
}

/// The forms of a site (by number in the site) that have one sign in all of the pieces given, or both: then they vanish.
pub(super) fn implied<'p>(
    forms: &[Form],
    pieces: impl Iterator<Item = &'p Piece> + Clone,
) -> Vec<(usize, Sign)> {
    let mut found = Vec::new();
    for f in 0..forms.len() {
        for sign in [Sign::Positive, Sign::Negative] {
            if pieces.clone().all(|piece| holds(forms, piece, f, sign)) {
                found.push((f, sign));
            }
        }
    }
    found
}

/// Whether a form has the given sign in the whole cell of a piece: the homogenised cell (the constant times t ≥ 0) contains no point
/// where the form is −1 times that sign.
fn holds(forms: &[Form], piece: &Piece, form: usize, sign: Sign) -> bool {
    let same = |f: &(usize, f64)| f.0 == form && f.1 == sign.factor();
    if piece.equalities.contains(&form) || piece.facets.iter().any(same) {
        return true;
    }
    let homogeneous = |f: &Form, constant: f64| {
        let mut coefficients = f.coefficients.clone();
        coefficients.push(f.constant);
        Form {
            coefficients,
            constant,
            error: f.error,
        }
    };
    let mut all: Vec<Form> = forms.iter().map(|f| homogeneous(f, 0.0)).collect();
    all.push(homogeneous(&forms[form], sign.factor()));
    let unknowns = all[0].coefficients.len();
    let mut table = Table::new(unknowns, all.iter());
    let t = all.len() + unknowns - 1;
    let mut require = || {
        table.constrain(t, Sign::Positive)?;
        for &(f, sign) in &piece.facets {
            table.constrain(f, Sign::of(sign))?;
        }
        for &f in &piece.equalities {
            table.fix(f)?;
        }
        table.fix(forms.len())?;
        table.repair(Deadline::after(None))
    };
    require().is_err()
}
