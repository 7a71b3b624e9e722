//! Performance profiles (E. D. Dolan, J. J. Moré, Benchmarking optimization software with performance profiles, Math. Program. 91 (2002)).

use crate::contenders::Run;
use semismooth::output::{Colour, Curve, Panel, SegmentStyle};

/// Costs of methods on problems: a row for each problem, an entry for each method, `None` where it failed.
pub(crate) struct Costs {
    pub(crate) methods: Vec<&'static str>,
    pub(crate) rows: Vec<Vec<Option<f64>>>,
}

impl Costs {
    /// The costs of these runs, a row for each problem.
    pub(crate) fn new(methods: &[&'static str], runs: &[Vec<Run>], cost: impl Fn(&Run) -> f64) -> Self {
        let of = |row: &Vec<Run>| row.iter().map(|r| r.solved.then(|| cost(r))).collect();
        Self {
            methods: methods.to_vec(),
            rows: runs.iter().map(of).collect(),
        }
    }

    /// Iterations, or factorisations where these are more; at least one.
    pub(crate) fn work(r: &Run) -> f64 {
        r.iterations.max(r.factorisations).max(1) as f64
    }

    /// The share of all problems that a method solves at no more than τ times the cost of the best method for each, as the corners (log₂ τ,
    /// share) of a step function.
    pub(crate) fn profile(&self, method: usize) -> Vec<(f64, f64)> {
        let best = |row: &[Option<f64>]| row.iter().flatten().fold(f64::INFINITY, |m, c| m.min(*c));
        let mut ratios: Vec<f64> = self
            .rows
            .iter()
            .filter_map(|row| Some((row[method]? / best(row)).log2()))
            .collect();
        ratios.sort_by(f64::total_cmp);
        let mut corners = vec![(0.0, 0.0)];
        for (k, ratio) in ratios.iter().enumerate() {
            let (_, share) = corners[corners.len() - 1];
            corners.push((*ratio, share));
            corners.push((*ratio, (k + 1) as f64 / self.rows.len() as f64));
        }
        corners
    }

    /// The share of problems that no method solves at less cost.
    pub(crate) fn best(&self, method: usize) -> f64 {
        let corners = self.profile(method);
        corners
            .iter()
            .take_while(|c| c.0 == 0.0)
            .fold(0.0, |m, c| c.1.max(m))
    }

    /// The share of problems that a method solves at all.
    pub(crate) fn solved(&self, method: usize) -> f64 {
        self.rows.iter().filter(|r| r[method].is_some()).count() as f64 / self.rows.len() as f64
    }

    /// The profiles of all methods up to a ratio of 2^`reach`.
    pub(crate) fn panel(&self, caption: String, cost: &str, reach: f64) -> Panel {
        const COLOURS: [Colour; 14] = [
            Colour::new(0x1f, 0x77, 0xb4),
            Colour::new(0x17, 0xbe, 0xcf),
            Colour::new(0x08, 0x30, 0x6b),
            Colour::new(0x8c, 0x56, 0x4b),
            Colour::new(0xff, 0x7f, 0x0e),
            Colour::new(0xd6, 0x27, 0x28),
            Colour::new(0x8c, 0x1d, 0x1d),
            Colour::new(0x2c, 0xa0, 0x2c),
            Colour::new(0xe3, 0x77, 0xc2),
            Colour::new(0xbc, 0xbd, 0x22),
            Colour::new(0x94, 0x67, 0xbd),
            Colour::new(0xc5, 0xb0, 0xd5),
            Colour::new(0x7f, 0x7f, 0x7f),
            Colour::new(0x00, 0x00, 0x00),
        ];
        let mut panel = Panel::new(
            format!("log₂ of {cost} over those of the best method"),
            "share of problems solved",
        )
        .with_caption(caption)
        .with_x_range(0.0, reach)
        .with_y_range(0.0, 1.0);
        for (k, name) in self.methods.iter().enumerate() {
            let mut corners = self.profile(k);
            corners.push((reach.max(corners[corners.len() - 1].0), self.solved(k)));
            let style = SegmentStyle::new(*name, COLOURS[k % COLOURS.len()]);
            panel = panel.with_curve(Curve::line(corners, style));
        }
        panel
    }
}
