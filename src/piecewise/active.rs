use super::{Facet, PiecewiseSmooth, Selection, Selections, TestLayout, cell_margin};

/// The active index set I_H(x): all selections active at a point, as the product of the active pieces of each site.
///
/// A piece is active when each of its facets either holds or belongs to a *vanishing* test function.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ActiveSet {
    base: Selection,
    multiple: Vec<(usize, Vec<usize>)>,
    vanishing: Vec<usize>,
    outside: Vec<usize>,
}

impl ActiveSet {
    /// The active index set for given values of all test functions, those in `vanishing` (positions in the
    /// [layout](TestLayout), increasing) counting as zero.
    #[must_use]
    pub fn from_tests<P: PiecewiseSmooth + ?Sized>(
        map: &P,
        layout: &TestLayout,
        theta: &[f64],
        vanishing: Vec<usize>,
    ) -> Self {
        let base = Selection::uniform(layout.num_sites(), 0);
        Self::of_sites(0..layout.num_sites(), base, (map, layout, theta), vanishing)
    }

    /// [`from_tests`](Self::from_tests) on the boundary of the cell of a selection all of whose facets hold but those that vanish: at
    /// the other sites the active piece is known.
    pub(crate) fn beside<P: PiecewiseSmooth + ?Sized>(
        map: &P,
        layout: &TestLayout,
        theta: &[f64],
        vanishing: Vec<usize>,
        selection: &Selection,
    ) -> Self {
        let mut sites: Vec<usize> = vanishing.iter().map(|&k| layout.locate(k).0).collect();
        sites.dedup();
        Self::of_sites(sites, selection.clone(), (map, layout, theta), vanishing)
    }

    fn of_sites<P: PiecewiseSmooth + ?Sized>(
        sites: impl IntoIterator<Item = usize>,
        mut base: Selection,
        (map, layout, theta): (&P, &TestLayout, &[f64]),
        vanishing: Vec<usize>,
    ) -> Self {
        let mut multiple = Vec::new();
        let mut outside = Vec::new();
        for site in sites {
            let range = layout.range(site);
            let vanishes = |f: &Facet| vanishing.binary_search(&(range.start + f.test())).is_ok();
            let tests = theta.get(range.clone()).unwrap_or_default();
            let is_active = |piece: &usize| {
                let cell = map.cell(site, *piece);
                cell.iter().all(|f| vanishes(f) || f.margin(tests) > 0.0)
            };
            let mut active = (0..map.num_pieces(site)).filter(is_active);
            match (active.next(), active.next()) {
                (None, _) => {
                    outside.push(site);
                    base.set(site, best_piece(map, site, tests, None));
                }
                (Some(one), None) => base.set(site, one),
                (Some(first), Some(second)) => {
                    base.set(site, first);
                    multiple.push((site, [first, second].into_iter().chain(active).collect()));
                }
            }
        }
        Self {
            base,
            multiple,
            vanishing,
            outside,
        }
    }

    /// The sites with more than one active piece, and those pieces.
    #[must_use]
    pub fn degenerate_sites(&self) -> &[(usize, Vec<usize>)] {
        &self.multiple
    }

    /// Positions of the vanishing test functions.
    #[must_use]
    pub fn vanishing(&self) -> &[usize] {
        &self.vanishing
    }

    /// Sites at which x lies in the cell of no piece: outside the domain of the map.
    #[must_use]
    pub fn outside(&self) -> &[usize] {
        &self.outside
    }

    /// The first active selection.
    #[must_use]
    pub fn first(&self) -> &Selection {
        &self.base
    }

    /// Whether a single selection is active, so that H is smooth here.
    #[must_use]
    pub fn is_singleton(&self) -> bool {
        self.multiple.is_empty()
    }

    /// Whether `selection` is active.
    #[must_use]
    pub fn contains(&self, selection: &Selection) -> bool {
        selection.len() == self.base.len()
            && self.base.differing_sites(selection).all(|s| {
                self.multiple
                    .iter()
                    .any(|(site, pieces)| *site == s && pieces.contains(&selection.piece(s)))
            })
    }

    /// All active selections, lazily.
    #[must_use]
    pub fn selections(&self) -> Selections {
        Selections::new(self.base.clone(), self.multiple.clone())
    }

    /// Number of active selections, unless it overflows.
    #[must_use]
    pub fn total(&self) -> Option<u128> {
        self.selections().total()
    }
}

/// The active index set of a map at x; test functions with |θ| ≤ `tolerance` count as vanishing.
///
/// ```
/// use semismooth::piecewise::{active_set, MinMap};
/// // min(x, 1 − x) has both pieces active at x = ½.
/// let h = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| { a[0] = x[0]; b[0] = 1.0 - x[0]; });
/// assert_eq!(active_set(&h, &[0.5], 1e-12).total(), Some(2));
/// assert!(active_set(&h, &[0.4], 1e-12).is_singleton());
/// ```
#[must_use]
pub fn active_set<P: PiecewiseSmooth + ?Sized>(map: &P, x: &[f64], tolerance: f64) -> ActiveSet {
    let layout = TestLayout::new(map);
    let mut theta = vec![0.0; layout.total()];
    map.test_functions(x, &mut theta);
    let vanishing = (0..theta.len())
        .filter(|&k| theta[k].abs() <= tolerance)
        .collect();
    ActiveSet::from_tests(map, &layout, &theta, vanishing)
}

/// Chooses for each site the piece in whose cell x lies: the largest margin wins, `previous` is kept while its margin is at
/// least `−tolerance`, remaining ties go to the lowest number. Returns how many sites changed against `selection` as given.
pub fn select_pieces<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    layout: &TestLayout,
    theta: &[f64],
    keep: bool,
    tolerance: f64,
    selection: &mut Selection,
) -> usize {
    let mut changes = 0;
    for site in 0..layout.num_sites() {
        let tests = theta.get(layout.range(site)).unwrap_or_default();
        let old = selection.piece(site);
        let kept = keep.then_some((old, tolerance));
        let new = best_piece(map, site, tests, kept);
        if new != old {
            selection.set(site, new);
            changes += 1;
        }
    }
    changes
}

fn best_piece<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    site: usize,
    tests: &[f64],
    keep: Option<(usize, f64)>,
) -> usize {
    if let Some((old, tolerance)) = keep
        && old < map.num_pieces(site)
        && cell_margin(map.cell(site, old), tests) >= -tolerance
    {
        return old;
    }
    let mut best = 0;
    let mut best_margin = f64::NEG_INFINITY;
    for piece in 0..map.num_pieces(site) {
        let margin = cell_margin(map.cell(site, piece), tests);
        if margin > best_margin {
            best = piece;
            best_margin = margin;
        }
    }
    best
}

/// The selection at x by the rule of [`select_pieces`], without a previous one.
#[must_use]
pub fn select<P: PiecewiseSmooth + ?Sized>(map: &P, x: &[f64]) -> Selection {
    let layout = TestLayout::new(map);
    let mut theta = vec![0.0; layout.total()];
    map.test_functions(x, &mut theta);
    let mut selection = Selection::uniform(layout.num_sites(), 0);
    select_pieces(map, &layout, &theta, false, 0.0, &mut selection);
    selection
}

/// The value H(x), by the selection at x.
pub fn value<P: PiecewiseSmooth + ?Sized>(map: &P, x: &[f64], out: &mut [f64]) {
    map.residual(&select(map, x), x, out);
}
