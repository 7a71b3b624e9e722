use std::borrow::Cow;

use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
use semismooth::piecewise::{
    Kinks, NonsmoothFunction, PiecewiseSmooth, Real, Traced, active_set,
    b_derivative, select,
};

/// A spring of stiffness 1 between two stops of stiffness 9, at y = ±1, under a
/// load.
struct Spring;

impl NonsmoothFunction for Spring {
    fn num_vars(&self) -> usize {
        2 // x = (y, load)
    }

    fn num_residuals(&self) -> usize {
        1
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let (y, load) = (x[0], x[1]);
        let right = kinks.positive_part(y - 1.0);
        let left = kinks.positive_part(-y - 1.0);
        out[0] = y + right * 9.0 - left * 9.0 - load;
    }

    fn piece_name(&self, _site: usize, piece: usize) -> Option<Cow<'_, str>> {
        Some(["touches", "free"][piece].into()) // of max(z, 0), first z and then 0
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let spring = Traced::new(Spring);
    println!(
        "{} sites, {} pieces each",
        spring.num_sites(),
        spring.num_pieces(0)
    );
    for y in [0.5, 1.0, 1.5] {
        let x = [y, 0.0];
        println!("y = {y}");
        for selection in active_set(&spring, &x, 1e-12).selections() {
            println!("  active: {}", selection.display(&spring));
        }
        for d in [-1.0, 1.0] {
            let mut derivative = [0.0];
            b_derivative(&spring, &x, &[d, 0.0], 1e-12, &mut derivative)?;
            println!("  H'(x; {d:+}) = {:+}", derivative[0]);
        }
    }

    // The load that holds the spring at y, one colour a piece.
    let load = |y: f64| y + 9.0 * (y - 1.0).max(0.0) - 9.0 * (-1.0 - y).max(0.0);
    let ys = [-1.4, -1.0, 1.0, 1.4];
    let styles = ys.windows(2).map(|w| {
        let selection = select(&spring, &[0.5 * (w[0] + w[1]), 0.0]);
        match (selection.piece(0), selection.piece(1)) {
            (0, _) => SegmentStyle::new("against the right stop", Colour::ORANGE),
            (_, 0) => SegmentStyle::new("against the left stop", Colour::PURPLE),
            _ => SegmentStyle::new("free", Colour::BLUE),
        }
    });
    let graph = Curve::segments(
        ys.iter().map(|&y| (y, load(y))).collect(),
        styles.collect(),
    );
    BranchDiagram::new(Panel::new("y", "load").with_curve(graph))
        .with_size(560, 360)
        .write("spring.svg")?;
    Ok(())
}
