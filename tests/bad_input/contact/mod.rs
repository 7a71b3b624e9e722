mod bodies;
mod delassus;
mod derivatives;
mod displacements;
mod forms;
mod laws;
mod planar;
mod searches;

use semismooth::contact::{
    CondensedContact, ContactBody, FrictionCoefficient, FrictionCurve, FullContact, LoadPath, PlanarCoulomb,
};
use semismooth::sparse::Matrix;

use crate::table::{Table, rows};

fn stiffness() -> Matrix {
    rows(&[&[2.0, -1.0], &[-1.0, 2.0]])
}

fn normal() -> Matrix {
    rows(&[&[1.0, 0.0]])
}

fn tangential() -> Matrix {
    rows(&[&[0.0, 1.0]])
}

fn load() -> LoadPath {
    LoadPath::affine(vec![1.5, 7.0], vec![1.0, 0.0])
}

fn problem() -> FullContact<PlanarCoulomb> {
    FullContact::planar(
        stiffness(),
        normal(),
        tangential(),
        load(),
        FrictionCoefficient::nodal(vec![0.3]).unwrap(),
    )
    .unwrap()
}

fn body() -> ContactBody {
    ContactBody::new(stiffness(), normal(), vec![tangential()], load()).unwrap()
}

fn law(f: f64) -> PlanarCoulomb {
    PlanarCoulomb::new(FrictionCoefficient::uniform(FrictionCurve::constant(f).unwrap()))
}

fn condensed() -> CondensedContact<PlanarCoulomb> {
    CondensedContact::new(body(), law(0.3)).unwrap()
}

fn full() -> FullContact<PlanarCoulomb> {
    FullContact::new(body(), law(0.3)).unwrap()
}

#[test]
fn friction() {
    let mut t = Table::new("contact");
    bodies::bodies(&mut t);
    laws::laws(&mut t);
    planar::planar_problems(&mut t);
    forms::contacts(&mut t);
    bodies::measures(&mut t);
    searches::searches(&mut t);
    delassus::delassus(&mut t);
    displacements::displacements(&mut t);
    derivatives::derivatives(&mut t);
    t.exempt(&["contact::NodeLaw::check"], "asked by `solution` and `solve`");
    t.exempt(&["contact::Contact::solve_reported"], "called by `solve`");
    t.finish();
}
