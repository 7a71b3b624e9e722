use semismooth::contact::HildRenard;
use semismooth::continuation::{
    Branch, ContinuationOptions, Diagram, DiagramOptions, Direction, TransitionSet,
    VertexKind,
};
use semismooth::enumeration::EnumerationOptions;
use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
use semismooth::piecewise::{Kinks, NonsmoothFunction, Real, Traced, select};

/// min(|y − 2| + |a| − 1, y + 0.8 − 0.2 a) = 0: a closed curve above a line.
struct Island;

impl NonsmoothFunction for Island {
    fn num_vars(&self) -> usize {
        2
    }

    fn num_residuals(&self) -> usize {
        1
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let (y, a) = (x[0], x[1]);
        let round = kinks.abs(y - 2.0) + kinks.abs(a) - 1.0;
        out[0] = kinks.min(round, y + 0.8 - a * 0.2);
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // All curves that pass through a section a = ½, found from the complete list
    // of solutions there.
    let map = Traced::new(Island);
    let options = DiagramOptions::default().with_parameter_range((-2.0, 2.0));
    let diagram = Diagram::explore_sections(
        &map,
        &[0.5],
        &options,
        &EnumerationOptions::default(),
    )?;
    println!(
        "{} connected parts, {} of them closed; {} at a = 0",
        diagram.components().len(),
        diagram.isolas().len(),
        diagram.solutions_at(&map, 0.0)?.count().unwrap_or(0)
    );
    for vertex in diagram
        .vertices()
        .iter()
        .filter(|v| v.kind == VertexKind::Fold)
    {
        println!(
            "  fold at a = {:.4}, y = {:.4}",
            vertex.parameter(),
            vertex.x[0]
        );
    }
    let style = |_: &_, _: &[usize]| SegmentStyle::new("solutions", Colour::BLUE);
    BranchDiagram::new(Panel::new("a", "y").with_diagram(
        &diagram,
        |x| x[0],
        style,
    ))
    .with_size(560, 360)
    .write("island.svg")?;

    // The node of lesson 5 with f_ν = 1.5: where sticking is lost, in the plane
    // of F and f_t. x = (u_ν, u_t, λ_ν, λ_t, F, f_t).
    let problem = HildRenard::new(1.5, 0.0, 1.0, 1.0)?.problem()?;
    let family = problem
        .with_second_parameter(vec![0.0, 1.0], problem.node_law().clone())?;
    let slip_backwards = TransitionSet::new(&family, 0, 2)?;
    let options = ContinuationOptions::default()
        .with_parameter_range((-6.0, 0.0))
        .with_max_step(0.1);
    let line = Branch::follow(
        &slip_backwards,
        &[0.0, 0.0, 1.5, -6.0, 4.0, -6.0],
        Direction::Increasing,
        options,
    )?;
    for change in slip_backwards.character_changes(&line)? {
        let folds = ["passes before and folds", "folds before and passes"]
            [usize::from(change.folds_before)];
        println!(
            "at F = {:.4}, f_t = {:.4} the solution {folds} behind",
            change.x[4], change.x[5]
        );
    }
    let walk = line.polyline();
    let styles = walk.windows(2).map(|pair| {
        let middle: Vec<f64> = pair[0]
            .1
            .iter()
            .zip(pair[1].1)
            .map(|(a, b)| 0.5 * (a + b))
            .collect();
        let selection = select(&slip_backwards, &middle);
        match slip_backwards.is_fold(&selection, &middle) {
            Ok(Some(true)) => SegmentStyle::new("fold", Colour::ORANGE),
            _ => SegmentStyle::new("passed through", Colour::GREEN),
        }
    });
    let styles = styles.collect();
    let place = |x: &[f64]| (x[4], x[5]);
    let curve =
        Curve::segments(walk.iter().map(|(_, x)| place(x)).collect(), styles)
            .with_tangents(&line, place);
    BranchDiagram::new(
        Panel::new("F", "f_t")
            .with_curve(curve)
            .with_x_range(0.0, 4.0),
    )
    .with_size(560, 360)
    .write("plane.svg")?;
    Ok(())
}
