use super::{CheckOptions, CheckReport, Finding, FindingKind};
use crate::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt, Selection, Selections, TestLayout};
use crate::tolerances::CENTRAL;

/// Steps of difference quotients. The size of a variable is that of its samples, so that steps suit its units.
pub(super) fn steps(samples: &[Vec<f64>], vars: usize) -> Vec<f64> {
    (0..vars)
        .map(|j| {
            let size = samples.iter().fold(0.0, |s: f64, x| s.max(x[j].abs()));
            CENTRAL * if size > 0.0 { size } else { 1.0 }
        })
        .collect()
}

/// A running check.
pub(super) struct Session<'a> {
    pub(super) map: &'a dyn PiecewiseSmooth,
    pub(super) samples: &'a [Vec<f64>],
    pub(super) options: &'a CheckOptions,
    pub(super) layout: TestLayout,
    /// Step of difference quotients in each variable.
    pub(super) steps: Vec<f64>,
    pub(super) report: CheckReport,
    pub(super) findings: Vec<Finding>,
}

/// Where a finding belongs.
#[derive(Default, Clone, Copy)]
pub(super) struct Place {
    pub(super) point: Option<usize>,
    pub(super) site: Option<usize>,
    pub(super) piece: Option<usize>,
    pub(super) entry: Option<(usize, usize)>,
}

impl Place {
    pub(super) fn at(point: usize) -> Self {
        Self {
            point: Some(point),
            ..Self::default()
        }
    }

    pub(super) fn site(self, site: usize) -> Self {
        Self {
            site: Some(site),
            ..self
        }
    }

    pub(super) fn piece(self, piece: usize) -> Self {
        Self {
            piece: Some(piece),
            ..self
        }
    }

    pub(super) fn entry(self, row: usize, col: usize) -> Self {
        Self {
            entry: Some((row, col)),
            ..self
        }
    }
}

impl<'a> Session<'a> {
    pub(super) fn new(
        map: &'a dyn PiecewiseSmooth,
        samples: &'a [Vec<f64>],
        options: &'a CheckOptions,
    ) -> Self {
        Self {
            map,
            samples,
            options,
            layout: TestLayout::new(map),
            steps: steps(samples, map.num_vars()),
            report: CheckReport::default(),
            findings: Vec::new(),
        }
    }

    pub(super) fn full(&self) -> bool {
        self.findings.len() >= self.options.max_findings
    }

    /// Records a finding unless the same one was found at another point already.
    pub(super) fn find(&mut self, kind: FindingKind, place: Place, expected: f64, found: f64, what: &str) {
        let Place {
            point,
            site,
            piece,
            entry,
        } = place;
        let known = self.findings.iter().any(|f| {
            f.kind == kind
                && f.entry == entry
                && f.site.as_ref().map(|s| s.0) == site
                && f.piece.as_ref().map(|p| p.0) == piece
        });
        if known || self.full() {
            return;
        }
        let name = |s: usize| (s, self.map.site_name(s).into_owned());
        let piece_name = |(s, p): (usize, usize)| (p, self.map.piece_name(s, p).into_owned());
        self.findings.push(Finding {
            kind,
            point,
            site: site.map(name),
            piece: site.zip(piece).map(piece_name),
            entry,
            expected,
            found,
            what: what.to_owned(),
        });
    }

    pub(super) fn structure(&mut self) {
        let map = self.map;
        let (n, m) = (map.num_residuals(), map.num_vars());
        let wrong = FindingKind::Structure;
        let pattern = map.pattern();
        for (what, expected, found) in [
            ("rows of the pattern", n, pattern.nrows()),
            ("columns of the pattern", m, pattern.ncols()),
        ] {
            if expected != found {
                self.find(wrong, Place::default(), expected as f64, found as f64, what);
            }
        }
        let mut rows = Vec::new();
        for site in 0..map.num_sites() {
            let place = Place::default().site(site);
            let pieces = map.num_pieces(site);
            if pieces == 0 {
                self.find(wrong, place, 1.0, 0.0, "number of pieces, at least");
            }
            let tests = map.num_tests(site);
            for piece in 0..pieces {
                for facet in map.cell(site, piece) {
                    if facet.test() >= tests {
                        let (last, found) = (tests as f64 - 1.0, facet.test() as f64);
                        self.find(
                            wrong,
                            place.piece(piece),
                            last,
                            found,
                            "a facet's test function, at most",
                        );
                    }
                }
            }
            map.site_rows(site, &mut rows);
            if let Some(&row) = rows.iter().find(|&&r| r >= n) {
                self.find(
                    wrong,
                    place,
                    n as f64 - 1.0,
                    row as f64,
                    "a row of site_rows, at most",
                );
            }
        }
    }

    pub(super) fn run(&mut self) {
        let mut inside = Vec::new();
        for point in 0..self.samples.len() {
            if let Some(selection) = self.cells(point) {
                self.derivatives(point, &selection);
                self.test_derivatives(point);
                self.selection_tests(point, &selection);
                self.site_rows(point, &selection);
                inside.push((point, selection));
            }
            if self.full() {
                return;
            }
        }
        self.affine(&inside);
        self.continuity(&inside);
    }

    /// The selections to examine at a point: all, or all that differ from the one there in one site.
    pub(super) fn selections(&self, here: &Selection) -> Box<dyn Iterator<Item = Selection> + 'a> {
        let map = self.map;
        if !self.options.beyond_cells {
            return Box::new(std::iter::once(here.clone()));
        }
        let all = Selections::all(map);
        if all
            .total()
            .is_some_and(|t| t <= self.options.max_selections as u128)
        {
            return Box::new(all);
        }
        let here = here.clone();
        let base = here.clone();
        let others = (0..map.num_sites()).flat_map(move |site| {
            let mut there = base.clone();
            (0..map.num_pieces(site))
                .filter(|&p| p != base.piece(site))
                .map(|piece| {
                    there.set(site, piece);
                    there.clone()
                })
                .collect::<Vec<_>>()
        });
        Box::new(std::iter::once(here).chain(others))
    }

    pub(super) fn theta(&self, x: &[f64]) -> Vec<f64> {
        let mut theta = vec![0.0; self.layout.total()];
        self.map.test_functions(x, &mut theta);
        theta
    }

    pub(super) fn residual(&self, selection: &Selection, x: &[f64]) -> Vec<f64> {
        let mut r = vec![0.0; self.map.num_residuals()];
        self.map.residual(selection, x, &mut r);
        r
    }
}
