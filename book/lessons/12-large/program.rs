use semismooth::contact::{
    ContactState, FrictionCoefficient, LoadPath, OrthotropicCoulomb,
    ReducedContact, ReducedOptions,
};
use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
use semismooth::output::{BranchDiagram, Colour, Panel, SegmentStyle};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut picture = Panel::new("x", "y");
    for n in [4, 8, 16] {
        // A block of 2 × 2 × 1, pressed on its top and pushed on its right side,
        // held at its left.
        let mesh = Mesh::block([0.0; 3], [2.0, 2.0, 1.0], [n, n, n / 2])?;
        let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?)
            .fix("left")
            .discretize()?;
        let press = system.traction("top", |_| [0.0, 0.0, -0.02])?;
        let push = system.traction("right", |_| [0.02, 0.01, 0.0])?;
        let load: Vec<f64> = press.iter().zip(&push).map(|(a, b)| a + b).collect();
        let ground = system
            .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 0.0, 1.0]))?;
        let points = ground.points.clone();
        let body =
            semismooth::reduced_body(&system, &ground, LoadPath::constant(load))?;
        let law =
            OrthotropicCoulomb::isotropic(FrictionCoefficient::constant(0.5)?);
        let mut problem =
            ReducedContact::new(body, law, ReducedOptions::default())?;
        let found = problem.solve(0.0, None)?;
        let residual = found.residuals.largest();
        if residual > 1e-10 {
            return Err(format!("a residual of {residual:e}").into());
        }
        println!(
            "{:5} displacements, {:3} contact nodes: {:2} open, {:3} stick, {:3} slip",
            system.num_free(),
            points.len(),
            found.states[0],
            found.states[1],
            found.states[2]
        );
        if n == 16 {
            let states = problem.solution(0.0, &found.displacements)?.states;
            let half = 1.0 / n as f64;
            for (p, state) in points.iter().zip(states) {
                let (low, high) =
                    ([p[0] - half, p[1] - half], [p[0] + half, p[1] + half]);
                let corners = vec![
                    (low[0], low[1]),
                    (high[0], low[1]),
                    (high[0], high[1]),
                    (low[0], high[1]),
                ];
                let colour = match state {
                    ContactState::Open => OPEN,
                    ContactState::Stick => STICK,
                    _ => SLIP,
                };
                picture = picture.with_region(corners, colour);
            }
        }
    }
    for (name, colour) in [("open", OPEN), ("stick", STICK), ("slip", SLIP)] {
        picture = picture.with_class(SegmentStyle::new(name, colour));
    }
    BranchDiagram::new(picture)
        .with_size(560, 480)
        .write("states.svg")?;
    Ok(())
}

const OPEN: Colour = Colour::GREY;
const STICK: Colour = Colour::BLUE;
const SLIP: Colour = Colour::ORANGE;
