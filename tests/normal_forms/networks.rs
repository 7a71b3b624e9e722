//! Random networks y = W₂ act(W₁ y + w α + b), smooth, with kinks, and mixed: their curves have the same folds at default steps and at a
//! twentieth of them, and an even number of folds between different bounds of the parameter, an odd one between a bound and itself.

use semismooth::newton::Newton;
use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};

use crate::answer::{options, run};
use crate::members;
use crate::random::Random;

#[derive(Clone, Debug)]
struct Network {
    /// The parameter, where it is fixed.
    fixed: Option<f64>,
    inner: Vec<Vec<f64>>,
    outer: Vec<Vec<f64>>,
    load: Vec<f64>,
    shift: Vec<f64>,
    smooth: Vec<bool>,
}

impl Network {
    fn new(random: &mut Random) -> Self {
        let (n, hidden) = (1 + random.below(6), 2 + random.below(7));
        let size = random.between(1.0, 3.0) / (n as f64).sqrt();
        let kind = random.below(3);
        Self {
            fixed: None,
            inner: (0..hidden).map(|_| random.vector(n, size)).collect(),
            outer: (0..n).map(|_| random.vector(hidden, 1.2)).collect(),
            load: random.vector(hidden, 1.5),
            shift: random.vector(hidden, 1.5),
            smooth: (0..hidden)
                .map(|_| kind == 0 || (kind == 2 && random.below(2) == 0))
                .collect(),
        }
    }
}

impl NonsmoothFunction for Network {
    fn num_vars(&self) -> usize {
        self.outer.len() + usize::from(self.fixed.is_none())
    }

    fn num_residuals(&self) -> usize {
        self.outer.len()
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let n = self.outer.len();
        let alpha = self.fixed.map_or_else(|| x[n], T::from);
        let mut active = Vec::with_capacity(self.smooth.len());
        for (k, row) in self.inner.iter().enumerate() {
            let sum = row
                .iter()
                .zip(x)
                .fold(alpha * self.load[k], |sum, (w, y)| sum + *y * *w);
            let sum = sum + self.shift[k];
            active.push(if self.smooth[k] {
                sum.tanh()
            } else {
                kinks.positive_part(sum)
            });
        }
        for (i, row) in self.outer.iter().enumerate() {
            out[i] = row.iter().zip(&active).fold(x[i], |sum, (w, h)| sum - *h * *w);
        }
    }
}

#[test]
fn networks_have_the_same_folds_in_small_steps() {
    const BOUND: f64 = 3.0;
    let (mut curves, mut folds) = (0, 0);
    let mut faults = Vec::new();
    for seed in 0..5 * members() {
        let network = Network::new(&mut Random::new(seed));
        let mut x = vec![0.0; network.outer.len()];
        let at_bound = Network {
            fixed: Some(-BOUND),
            ..network.clone()
        };
        if Newton::default().solve(&Traced::new(at_bound), &mut x).is_err() {
            continue;
        }
        x.push(-BOUND);
        let map = Traced::new(network);
        let [default, small] = [1.0, 0.05].map(|share| {
            let options = options(1.0, (-BOUND, BOUND), share).with_max_points((1000.0 / share) as usize);
            run(&map, &x, true, options.with_max_growth(30.0))
        });
        // Curves that leave through the bound at once, or to infinity, have nothing to compare.
        let (Ok(default), Ok(small)) = (default, small) else {
            continue;
        };
        let (Some(end), Some(_)) = (&default.end, &small.end) else {
            continue;
        };
        curves += 1;
        folds += small.folds.len();
        let back = end[end.len() - 1] < 0.0;
        let same = default.folds.len() == small.folds.len()
            && default.folds.iter().zip(&small.folds).all(|(p, q)| {
                p.iter()
                    .zip(q)
                    .map(|(p, q)| (p - q) * (p - q))
                    .sum::<f64>()
                    .sqrt()
                    < 1e-5
            });
        if !same || (default.folds.len() % 2 == 1) != back {
            faults.push((seed, default.folds.len(), small.folds.len(), back));
        }
    }
    println!("networks: {curves} curves with {folds} folds; (seed, default, small, back): {faults:?}");
    assert!(faults.is_empty(), "folds differ: {faults:?}");
    assert!(curves as u64 > members() && folds > 0);
}
