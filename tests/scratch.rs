use semismooth::contact::*;
use semismooth::continuation::*;
#[test]
fn scratch() {
    for name in ["vee_r0", "block_linear_10x20_F0.5"] {
        let path = format!("/work/shared/discrete/{name}");
        let folder = read_folder(&path).unwrap();
        let json: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(format!("{path}/breakpoints_exact.json")).unwrap())
                .unwrap();
        for pass in 0..2 {
            let t0 = std::time::Instant::now();
            let b;
            let map;
            if pass == 0 {
                map = CondensedFriction::new(folder.problem.clone()).unwrap();
                let t1 = t0.elapsed();
                let x = first_point(&map, 0.0, &FrictionStart::Zero).unwrap();
                b = Branch::follow(
                    &map,
                    &x,
                    Direction::Increasing,
                    ContinuationOptions::default().with_parameter_range((0.0, 1.0)),
                )
                .unwrap();
                println!(
                    "{name} condensed setup {t1:?} total {:?} transitions {} points {} fact {} end {}",
                    t0.elapsed(),
                    b.transitions.len(),
                    b.points.len(),
                    b.factorisations,
                    b.termination
                );
            } else {
                let x = first_point(&folder.problem, 0.0, &FrictionStart::Zero).unwrap();
                b = Branch::follow(
                    &folder.problem,
                    &x,
                    Direction::Increasing,
                    ContinuationOptions::default().with_parameter_range((0.0, 1.0)),
                )
                .unwrap();
                println!(
                    "{name} full total {:?} transitions {} points {} fact {} end {}",
                    t0.elapsed(),
                    b.transitions.len(),
                    b.points.len(),
                    b.factorisations,
                    b.termination
                );
            }
            let events = json["events"].as_array().unwrap();
            println!("expected {}", events.len());
            for (k, (t, e)) in b.transitions.iter().zip(events).enumerate() {
                let g = e["gamma"].as_f64().unwrap();
                let d = t.parameter() - g;
                let ok = d.abs() < 1e-10
                    && t.sites[0].site as u64 == e["node"].as_u64().unwrap()
                    && t.sites[0].from as u64 == e["old"].as_u64().unwrap()
                    && t.sites[0].to as u64 == e["new"].as_u64().unwrap()
                    && t.is_fold() == e["fold"].as_bool().unwrap();
                if !ok {
                    println!("{k} {} {:?} {} vs {e}", t.parameter(), t.sites, t.kind);
                    break;
                }
            }
        }
    }
}
