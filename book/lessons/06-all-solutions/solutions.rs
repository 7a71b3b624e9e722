use semismooth::complementarity::Lcp;
use semismooth::continuation::{SearchOptions, search_solutions};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};
use semismooth::sparse::Matrix;

/// |x| + x = 0, which all x ≤ 0 solve.
struct HalfLine;

impl NonsmoothFunction for HalfLine {
    fn num_vars(&self) -> usize {
        1
    }

    fn num_residuals(&self) -> usize {
        1
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = kinks.abs(x[0]) + x[0];
    }
}

/// x² − max(x, 0) = α.
struct Curved;

impl NonsmoothFunction for Curved {
    fn num_vars(&self) -> usize {
        2
    }

    fn num_residuals(&self) -> usize {
        1
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = x[0] * x[0] - kinks.positive_part(x[0]) - x[1];
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let options = EnumerationOptions::default();
    println!("1.");
    let problem = Lcp::new(
        Matrix::from_rows(&[[1.0, 2.0], [2.0, 1.0]])?,
        vec![-1.0, -1.0],
    )?;
    let list = all_solutions(problem.mcp(), 0.0, &options)?;
    for s in &list.solutions {
        println!(
            "  z = ({:.4}, {:.4}), index {:+}",
            s.x[0],
            s.x[1],
            s.index.unwrap_or(0)
        );
    }
    println!(
        "  {}, sum of indices {:+}",
        list.completeness,
        list.index_sum.unwrap_or(0)
    );

    println!("2.");
    let list = all_solutions(&Traced::new(HalfLine), 0.0, &options)?;
    println!(
        "  {} continuum of dimension {} with the end {:?}, {}",
        list.continua.len(),
        list.continua[0].dimension,
        list.continua[0].ends[0],
        list.completeness
    );

    println!("3.");
    let curved = Traced::new(Curved);
    if let Err(e) = all_solutions(&curved, 0.0, &options) {
        println!("  {e}");
    }
    let list = search_solutions(
        &curved,
        -0.125,
        &[[0.0, -0.125]],
        &SearchOptions::default(),
    )?;
    for s in &list.solutions {
        println!("  x = {:.4}, index {:+}", s.x[0], s.index.unwrap_or(0));
    }
    Ok(())
}
