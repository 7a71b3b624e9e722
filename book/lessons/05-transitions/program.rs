use semismooth::contact::{ContactState, HildRenard};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::output::{BranchDiagram, Curve, Panel, SegmentStyle};

/// Without a negative zero.
fn plain(value: f64) -> f64 {
    if value.abs() < 1e-9 { 0.0 } else { value }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let options = ContinuationOptions::default().with_parameter_range((-0.5, 8.0));
    let mut panels = Vec::new();
    for (f_nu, f_t) in [(1.5, 7.0), (1.5, -4.0), (1.0, -2.0)] {
        println!("f = ({f_nu}, {f_t})");
        // x = (u_ν, u_t, λ_ν, λ_t, α), with the coefficient of friction F = α;
        // the node sticks at α = 8.
        let map = HildRenard::new(f_nu, f_t, 1.0, 1.0)?
            .problem()?
            .with_r(1.0)?;
        let start = map.solve_from_states(8.0, &[ContactState::Stick])?;
        let branch =
            Branch::follow(&map, &start, Direction::Decreasing, options.clone())?;
        for t in &branch.transitions {
            let theta = map.theta(&t.x)[0].map(plain);
            println!(
                "  α = {:.4}, {} → {}: {}",
                plain(t.parameter()),
                map.states(&t.before)[0],
                map.states(&t.after)[0],
                t.kind
            );
            println!(
                "    θ = ({:.4}, {:.4}, {:.4}), arms that go on: {}",
                theta[0],
                theta[1],
                theta[2],
                t.arms.len()
            );
        }
        println!("  end: {}", branch.termination);
        let style = |s: &_, grazing: &[usize]| {
            SegmentStyle::contact(map.states(s)[0], !grazing.is_empty())
        };
        let panel =
            Panel::new("α", "u_t").with_caption(format!("f = ({f_nu}, {f_t})"));
        panels.push(panel.with_curve(Curve::of_branch(&branch, |x| x[1], style)));
    }
    let diagram = panels.into_iter().map(BranchDiagram::new);
    for (picture, name) in diagram.zip(["passes.svg", "fold.svg", "vertical.svg"]) {
        picture.with_size(560, 330).write(name)?;
    }
    Ok(())
}
