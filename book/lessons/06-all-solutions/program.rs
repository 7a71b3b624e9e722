use semismooth::contact::HildRenard;
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::output::{
    BranchDiagram, Colour, Curve, Marker, Panel, SegmentStyle,
};
use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced};

/// |x| + y = a, 2 y + min(x, 1) = 0.
struct Pair;

impl NonsmoothFunction for Pair {
    fn num_vars(&self) -> usize {
        3
    }

    fn num_residuals(&self) -> usize {
        2
    }

    fn eval<T: Real>(&self, v: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let [x, y, a] = [v[0], v[1], v[2]];
        out[0] = kinks.abs(x) + y - a;
        out[1] = y * 2.0 + kinks.min(x, T::from(1.0));
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let options = EnumerationOptions::default();
    let pair = Traced::new(Pair);
    let mut found = Vec::new();
    for a in [-1.0, 0.5, 2.0] {
        let list = all_solutions(&pair, a, &options)?;
        println!(
            "a = {a}: {} solutions, {}",
            list.solutions.len(),
            list.completeness
        );
        for s in &list.solutions {
            println!(
                "  x = {:.4}, y = {:.4}, active selections: {}",
                s.x[0],
                s.x[1],
                s.selections.len()
            );
            found.push((a, s.x[0]));
        }
    }

    println!("one contact node, f = (1.5, −4)");
    let node = HildRenard::new(1.5, -4.0, 1.0, 1.0)?
        .problem()?
        .condensed()?;
    for alpha in [1.0, 4.0] {
        let list = all_solutions(&node, alpha, &options)?;
        print!("  F = {alpha}, {}:", list.completeness);
        for s in &list.solutions {
            print!(
                " {} ({:+})",
                node.states(&s.selections[0])[0],
                s.index.unwrap_or(0)
            );
        }
        println!(", sum of indices {:+}", list.index_sum.unwrap_or(0));
    }

    let curve = ContinuationOptions::default().with_parameter_range((-1.5, 3.0));
    let branch =
        Branch::follow(&pair, &[3.5, -0.5, 3.0], Direction::Decreasing, curve)?;
    let curve = Curve::of_branch(
        &branch,
        |v| v[0],
        |_, _| SegmentStyle::new("all solutions", Colour::BLUE),
    );
    let panel =
        Panel::new("a", "x").with_curve(curve.with_marks(Marker::Isolated, found));
    BranchDiagram::new(panel.with_x_range(-1.5, 3.0))
        .with_size(560, 360)
        .write("sections.svg")?;
    Ok(())
}
