//! Reference problems from exact rational arithmetic (`tests/data/seed_examples.json`).
#![allow(dead_code)]

use semismooth::contact::{ContactState, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
use semismooth::sparse::Matrix;
use serde_json::Value;

pub struct Case {
    pub name: String,
    pub problem: FullContact<PlanarCoulomb>,
    pub json: Value,
}

pub struct Vertex {
    pub alpha: f64,
    pub theta: Vec<[f64; 3]>,
    pub fold: bool,
    pub kind: String,
    pub u: Vec<f64>,
    pub lambda_nu: Vec<f64>,
    pub lambda_t: Vec<f64>,
}

/// One piece of a branch in path order, with the vertex at which it is left.
pub struct Link {
    pub states: Vec<ContactState>,
    pub det_sign: i64,
    pub vertical: bool,
    pub interval: (f64, f64),
    pub leave: Option<usize>,
    pub enter: Option<usize>,
}

pub fn cases() -> Vec<Case> {
    let text = include_str!("../data/seed_examples.json");
    let json: Value = serde_json::from_str(text).unwrap();
    json["cases"].as_array().unwrap().iter().map(case).collect()
}

pub fn numbers(v: &Value) -> Vec<f64> {
    v.as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}

fn matrix(v: &Value) -> Matrix {
    let rows: Vec<Vec<f64>> = v.as_array().unwrap().iter().map(numbers).collect();
    Matrix::from_rows(&rows).unwrap()
}

fn case(json: &Value) -> Case {
    let problem = FullContact::planar(
        matrix(&json["A"]),
        matrix(&json["Bnu"]),
        matrix(&json["Bt"]),
        LoadPath::affine(numbers(&json["f0"]), numbers(&json["f1"])),
        FrictionCoefficient::affine(numbers(&json["F0"]), numbers(&json["F1"])).unwrap(),
    )
    .unwrap()
    .with_r(json["r"].as_f64().unwrap())
    .unwrap();
    Case {
        name: json["name"].as_str().unwrap().to_owned(),
        problem,
        json: json.clone(),
    }
}

pub fn states(text: &str) -> Vec<ContactState> {
    text.chars()
        .map(|c| match c {
            'O' => ContactState::Open,
            'K' => ContactState::Stick,
            '+' => ContactState::SlipPlus,
            '-' => ContactState::SlipMinus,
            other => panic!("unknown state {other}"),
        })
        .collect()
}

impl Case {
    pub fn vertices(&self) -> Vec<Vertex> {
        let list = self.json["graph"]["vertices"].as_array().unwrap();
        list.iter()
            .map(|v| {
                let t: Vec<Vec<f64>> = ["theta1", "theta2", "theta3"]
                    .iter()
                    .map(|k| numbers(&v[*k]))
                    .collect();
                Vertex {
                    alpha: v["alpha"].as_f64().unwrap(),
                    theta: (0..t[0].len()).map(|i| [t[0][i], t[1][i], t[2][i]]).collect(),
                    fold: v["fold"].as_bool().unwrap(),
                    kind: v["kind"].as_str().unwrap().to_owned(),
                    u: numbers(&v["u"]),
                    lambda_nu: numbers(&v["lam_nu"]),
                    lambda_t: numbers(&v["lam_t"]),
                }
            })
            .collect()
    }

    /// The branches, each as its chain of pieces; `reverse` walks the chain from its other end.
    pub fn chains(&self, reverse: bool) -> Vec<Vec<Link>> {
        let graph = &self.json["graph"];
        let pieces = graph["pieces"].as_array().unwrap();
        let chain = |branch: &Value| -> Vec<Link> {
            let mut links: Vec<Link> = branch["chain"]
                .as_array()
                .unwrap()
                .iter()
                .map(|link| {
                    let id = link["piece"].as_u64().unwrap();
                    let piece = pieces.iter().find(|p| p["id"].as_u64() == Some(id)).unwrap();
                    let end = |side: &str, what: &str| match (side, what) {
                        ("lo", "vertex") => piece["vertex_lo"].as_u64().map(|v| v as usize),
                        _ => piece["vertex_hi"].as_u64().map(|v| v as usize),
                    };
                    let bound = |key: &str, infinite: f64| piece[key]["value"].as_f64().unwrap_or(infinite);
                    let (enter, leave) = (link["enter"].as_str().unwrap(), link["leave"].as_str().unwrap());
                    let (enter, leave) = if reverse { (leave, enter) } else { (enter, leave) };
                    Link {
                        states: states(link["states"].as_str().unwrap()),
                        det_sign: piece["det_sign"].as_i64().unwrap(),
                        vertical: piece["vertical"].as_bool().unwrap(),
                        interval: (
                            bound("alpha_lo", f64::NEG_INFINITY),
                            bound("alpha_hi", f64::INFINITY),
                        ),
                        leave: end(leave, "vertex"),
                        enter: end(enter, "vertex"),
                    }
                })
                .collect();
            if reverse {
                links.reverse();
            }
            links
        };
        graph["branches"].as_array().unwrap().iter().map(chain).collect()
    }
}
