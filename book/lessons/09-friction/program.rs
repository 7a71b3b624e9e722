use semismooth::contact::{
    CondensedContact, FrictionCoefficient, LoadPath, PlanarCoulomb,
};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, PointKind};
use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A block of 2 × 1 is pressed down by its top, which then moves to the right
    // by 0.05 α.
    let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [16, 8])?;
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?)
        .prescribe("top", 0, |_| 0.0)
        .prescribe("top", 1, |_| -0.02)
        .assemble()?;
    let load =
        LoadPath::affine(system.supports(), system.motion("top", 0, |_| 0.05)?);
    let ground =
        system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))?;
    let nodes = ground.nodes.clone();
    let body = semismooth::contact_body(&system, &ground, load)?;
    let map = CondensedContact::new(
        body,
        PlanarCoulomb::new(FrictionCoefficient::constant(0.4)?),
    )?;
    println!(
        "{} displacements, {} contact nodes",
        system.num_free(),
        map.num_contacts()
    );

    let options = ContinuationOptions::default()
        .with_parameter_range((0.0, 1.0))
        .with_targets(vec![0.25, 0.5, 0.75]);
    let start = map.solve(0.0, None)?;
    let branch = Branch::follow(&map, &start, Direction::Increasing, options)?;
    println!(
        "{} changes of state up to α = 1, {} folds",
        branch.transitions.len(),
        branch.folds().len()
    );
    for point in &branch.points {
        if point.kind == PointKind::Target
            || [0.0, 1.0].contains(&point.parameter())
        {
            let found = map.solution(&point.x)?;
            let force = found.resultant();
            println!(
                "  α = {:.2}: {:2} open, {:2} stick, {:2} slip, pressure {:.5}, friction {:.5}",
                point.parameter(),
                found.open(),
                found.stick(),
                found.slip(),
                force[0],
                force[1].abs()
            );
        }
    }

    // The deformed mesh at α = 1, displacements as they are, and the forces of
    // the ground on the block.
    let end = branch.points.last().ok_or("a branch has points")?;
    let u = system.displacements(
        &map.displacements(&end.x)?,
        &map.support_displacements(&end.x)?,
    )?;
    let place = |node: usize| {
        let p = system.mesh().points()[node];
        (p[0] + u[2 * node], p[1] + u[2 * node + 1])
    };
    let mut panel = Panel::new("x", "y");
    for cell in 0..system.mesh().num_cells() {
        let mut corners: Vec<(f64, f64)> =
            system.mesh().cell(cell).iter().map(|&n| place(n)).collect();
        corners.push(corners[0]);
        panel = panel.with_curve(Curve::line(
            corners,
            SegmentStyle::new("deformed mesh", Colour::GREY),
        ));
    }
    let found = map.solution(&end.x)?;
    for (node, values) in nodes.iter().zip(&found.nodes) {
        let (x, y) = place(*node);
        let force = SegmentStyle::new("force of the ground", Colour::ORANGE);
        let tip = (x - 60.0 * values.traction[0], y + 60.0 * values.pressure);
        panel = panel.with_curve(Curve::line(vec![(x, y), tip], force));
    }
    BranchDiagram::new(panel)
        .with_size(760, 400)
        .write("block.svg")?;
    Ok(())
}
