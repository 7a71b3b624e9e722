use semismooth::complementarity::{Lcp, strong_regularity};
use semismooth::piecewise::{
    Kinks, LocalUniqueness, NonsmoothFunction, Real, Traced, active_set,
    coherent_orientation, local_uniqueness,
};
use semismooth::sparse::Matrix;

/// a y for y ≤ 0 and b y for y ≥ 0.
struct Bent {
    left: f64,
    right: f64,
}

impl NonsmoothFunction for Bent {
    fn num_vars(&self) -> usize {
        1
    }

    fn num_residuals(&self) -> usize {
        1
    }

    fn eval<T: Real>(&self, y: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = kinks.positive_part(y[0]) * self.right
            - kinks.positive_part(-y[0]) * self.left;
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("1.");
    for (left, right) in [(1.0, 4.0), (-3.0, 1.0)] {
        let map = Traced::new(Bent { left, right });
        let active = active_set(&map, &[0.0], 1e-12);
        match local_uniqueness(&map, &[0.0], &active, &Matrix::identity(1), 100)? {
            LocalUniqueness::Lipschitz { constant, .. } => {
                println!("  {left}, {right}: unique, constant {constant:.4}")
            }
            other => println!("  {left}, {right}: {other}"),
        }
    }

    println!("2.");
    for m in [[[1.0, 5.0], [0.0, 1.0]], [[1.0, 2.0], [2.0, 1.0]]] {
        let problem = Lcp::new(Matrix::from_rows(&m)?, vec![0.0, 0.0])?;
        let regular = strong_regularity(problem.mcp(), &[0.0, 0.0], 1e-12, 1000)?;
        let coherent =
            coherent_orientation(problem.mcp(), &[0.0, 0.0], 1e-12, 1000)?;
        let word = |yes: bool| if yes { "yes" } else { "no" };
        println!(
            "  M = {m:?}: strongly regular {}, coherently oriented {}",
            word(regular.is_regular()),
            word(matches!(
                coherent,
                semismooth::piecewise::CoherentOrientation::Coherent { .. }
            ))
        );
    }
    Ok(())
}
