/// A selection σ: one piece for every site.
///
/// ```
/// use semismooth::piecewise::Selection;
/// let mut s = Selection::from_pieces([0, 2, 1]);
/// s.set(1, 0);
/// assert_eq!(s.pieces().collect::<Vec<_>>(), [0, 0, 1]);
/// assert_eq!(s.differing_sites(&Selection::uniform(3, 0)).collect::<Vec<_>>(), [2]);
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Selection {
    pieces: Vec<u16>,
}

impl Selection {
    /// The selection with the same piece at each of `sites` sites. Pieces are numbers up to 65535; larger ones are reduced to 65535.
    #[must_use]
    pub fn uniform(sites: usize, piece: usize) -> Self {
        Self {
            pieces: vec![to_u16(piece); sites],
        }
    }

    /// The selection with the given pieces, site by site.
    #[must_use]
    pub fn from_pieces(pieces: impl IntoIterator<Item = usize>) -> Self {
        Self {
            pieces: pieces.into_iter().map(to_u16).collect(),
        }
    }

    /// Number of sites.
    #[must_use]
    pub fn len(&self) -> usize {
        self.pieces.len()
    }

    /// Whether there is no site at all (a smooth map).
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// The piece used at `site`.
    ///
    /// A site out of range gives piece 0, so that reading never fails; [`len`](Self::len) tells the range.
    #[must_use]
    #[inline]
    pub fn piece(&self, site: usize) -> usize {
        self.pieces.get(site).map_or(0, |&p| p as usize)
    }

    /// Uses `piece` at `site`; a site out of range is ignored.
    #[inline]
    pub fn set(&mut self, site: usize, piece: usize) {
        if let Some(p) = self.pieces.get_mut(site) {
            *p = to_u16(piece);
        }
    }

    /// The pieces, site by site.
    pub fn pieces(&self) -> impl Iterator<Item = usize> + '_ {
        self.pieces.iter().map(|&p| p as usize)
    }

    /// The sites at which two selections differ.
    pub fn differing_sites<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = usize> + 'a {
        (0..self.len().max(other.len())).filter(|&s| self.pieces.get(s) != other.pieces.get(s))
    }

    /// Overwrites this selection without allocating when the lengths agree.
    pub fn copy_from(&mut self, other: &Self) {
        self.pieces.clone_from(&other.pieces);
    }
}

fn to_u16(piece: usize) -> u16 {
    piece.min(u16::MAX as usize) as u16
}
