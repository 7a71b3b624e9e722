use semismooth::contact::{ContactState, HildRenard};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, certify};
use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
use semismooth::piecewise::{LocalUniqueness, active_set, local_index};
use semismooth::sparse::Matrix;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The node of lesson 5 sticks, F = α; is its solution a Lipschitz function of
    // the load?
    let every_tenth = (10..=60).map(|k| 0.1 * f64::from(k)).collect();
    let options = ContinuationOptions::default()
        .with_parameter_range((1.0, 6.0))
        .with_targets(every_tenth);
    let load = Matrix::identity(4); // of any change of the four residuals
    let mut panel = Panel::new("α", "Lipschitz constant");
    for (f_t, colour) in [(-2.5, Colour::BLUE), (-4.0, Colour::ORANGE)] {
        let map = HildRenard::new(1.5, f_t, 1.0, 1.0)?.problem()?;
        let start = map.solve_from_states(6.0, &[ContactState::Stick])?;
        println!("f = (1.5, {f_t})");
        let branch =
            Branch::follow(&map, &start, Direction::Decreasing, options.clone())?;
        for t in &branch.transitions {
            println!("  α = {:.4}, {}", t.parameter(), t.kind);
            match t.certify(&map, &load, &options)? {
                LocalUniqueness::Lipschitz {
                    constant,
                    selections,
                    ..
                } => {
                    println!(
                        "    unique nearby, Lipschitz constant {constant:.3}, from {selections} selections"
                    );
                }
                LocalUniqueness::Fails { first, second } => {
                    let name = |s: &(_, i8)| {
                        format!("{} ({:+})", map.states(&s.0)[0], s.1)
                    };
                    println!(
                        "    not unique nearby: determinants of {} and {}",
                        name(&first),
                        name(&second)
                    );
                }
                other => println!("    {other}"),
            }
            let index = local_index(&map, &t.x, 1e-9, 100)?;
            let active = active_set(&map, &t.x, 1e-9).selections().count();
            println!(
                "    index {}, {active} active selections",
                index.map_or("unknown".into(), |i| i.to_string())
            );
        }
        // A curve for each piece: the constant jumps between them.
        let mut certified = 0;
        for state in [ContactState::Stick, ContactState::SlipMinus] {
            let mut constants = Vec::new();
            for p in branch
                .points
                .iter()
                .filter(|p| map.states(&p.selection) == [state])
            {
                if let Some(constant) =
                    certify(&map, &p.x, &load, &options)?.constant()
                {
                    constants.push((p.parameter(), constant));
                }
            }
            certified += constants.len();
            let style = SegmentStyle::new(format!("f_t = {f_t}"), colour);
            panel = panel.with_curve(Curve::line(constants, style));
        }
        println!(
            "  certified at {certified} of {} other points",
            branch.points.len()
        );
    }
    BranchDiagram::new(panel)
        .with_size(560, 340)
        .write("constants.svg")?;
    Ok(())
}
