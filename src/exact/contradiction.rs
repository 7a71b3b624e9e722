use super::{Dictionary, Exact};

/// Most numbers of the conditions, zeros among them: below, integers stay short enough for a fraction of a second.
const MAX_ENTRIES: usize = 5_000;

/// Whether no point makes the first `equations` of the given forms zero and the others, and the unknowns `signed`, not negative; `None`
/// where there are too many numbers to tell. Forms are a constant and the coefficient of each unknown.
pub(crate) fn contradict(
    unknowns: usize,
    signed: &[usize],
    equations: usize,
    forms: impl Iterator<Item = (Exact, Vec<Exact>)>,
) -> Option<bool> {
    let most = MAX_ENTRIES / (unknowns + 1);
    let forms: Vec<_> = forms.take(most + 1).collect();
    let count = forms.len();
    if count > most {
        return None;
    }
    let mut table = Dictionary::new(unknowns, forms.iter().map(|(c, row)| (c, row.as_slice())));
    let signed = signed.iter().map(|j| count + j).chain(equations..count);
    let consistent = { signed }.all(|var| table.constrain(var, 1).is_ok())
        && (0..equations).all(|var| table.fix(var).is_ok());
    Some(!(consistent && table.repair().is_ok()))
}
