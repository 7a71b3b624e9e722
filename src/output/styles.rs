//! Styles of segments by what is active on them.

use std::borrow::Cow;
use std::cell::RefCell;

use super::{Colour, SegmentStyle};
use crate::contact::ContactState;
use crate::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt, Selection};

impl SegmentStyle {
    /// The state of all contact nodes together: none in contact, all in contact sticking, all slipping, or some of both.
    #[must_use]
    pub fn contacts(states: &[ContactState]) -> Self {
        let stick = states.contains(&ContactState::Stick);
        let slip = states.iter().any(|s| s.is_slip());
        match (stick, slip) {
            (false, false) => Self::new("no contact", Colour::RED),
            (true, false) => Self::new("all in contact stick", Colour::GREEN),
            (false, true) => Self::new("all in contact slip", Colour::BLUE),
            (true, true) => Self::new("stick and slip", Colour::PURPLE),
        }
    }

    /// A function from selections to styles: a colour for each combination of pieces, in the order in which they are met, with the names of
    /// the pieces; one style for all in maps of more than two sites, or of none.
    pub fn by_pieces<P: PiecewiseSmooth + ?Sized>(map: &P) -> impl Fn(&Selection, &[usize]) -> Self {
        Self::by_names(map.num_sites(), |site, piece| map.piece_name(site, piece))
    }

    /// The same with other names.
    pub(super) fn by_names<'a>(
        sites: usize,
        name: impl Fn(usize, usize) -> Cow<'a, str>,
    ) -> impl Fn(&Selection, &[usize]) -> Self {
        const COLOURS: [Colour; 5] = [
            Colour::BLUE,
            Colour::RED,
            Colour::GREEN,
            Colour::PURPLE,
            Colour::GREY,
        ];
        let met = RefCell::new(Vec::<Selection>::new());
        move |selection, _| {
            if sites == 0 || sites > 2 {
                return Self::new("solutions", Colour::BLUE);
            }
            let mut met = met.borrow_mut();
            let known = met.iter().position(|s| s == selection);
            let k = known.unwrap_or_else(|| {
                met.push(selection.clone());
                met.len() - 1
            });
            let pieces = selection.pieces().enumerate();
            let names: Vec<_> = pieces.map(|(site, k)| name(site, k)).collect();
            Self::new(names.join(", "), COLOURS[k % COLOURS.len()])
        }
    }
}
