//! Runs the short cases from `cargo bench --bench stress` and the pairs from `cargo bench --bench skips`.
//! Checks that images differ from their references by at most a bound, that samples are finite, and that
//! unused features change no bits or rays. Only the benchmarks measure times.

#[path = "../../benches/stress/cases/mod.rs"]
mod cases;
#[path = "../../benches/stress/frame.rs"]
mod frame;
#[path = "../../benches/skips/pairs.rs"]
mod pairs;
#[path = "../../benches/stress/row.rs"]
#[allow(dead_code, reason = "only the benchmark uses times")]
mod row;
#[path = "../../benches/stress/run.rs"]
#[allow(dead_code, reason = "only the benchmark uses times")]
mod run;

use row::CaseSet;

#[test]
fn extreme_scenes_match_their_references() {
    let rows = cases::rows(CaseSet::Short);
    assert!(rows.len() > 60, "{} rows", rows.len());
    let mut wrong = Vec::new();
    for row in rows {
        match run::measure(&row, 1) {
            Ok(measured) if measured.is_within_bounds(&row) => {}
            Ok(run::RowResult { figure, non_finite, .. }) => {
                wrong.push(format!(
                    "{}: {figure:e}, bound {:e}, non-finite: {non_finite}",
                    row.name, row.bound
                ));
            }
            Err(error) => wrong.push(format!("{}: {error}", row.name)),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn unused_features_do_not_change_bits() {
    let mut wrong = Vec::new();
    for pair in pairs::pairs([32, 24, 4]) {
        let [off, on] = [&pair.off, &pair.on].map(|picture| run::render(picture).expect(pair.name));
        assert!(off.pixels.iter().any(|&x| x > 0.0), "{}: the image is black", pair.name);
        if !off.pixels.iter().map(|x| x.to_bits()).eq(on.pixels.iter().map(|x| x.to_bits())) {
            wrong.push(format!("{}: bits differ", pair.name));
        }
        let done = |report: &serde_json::Value| [report["counters"].clone(), report["lights"].clone()];
        assert!(done(&off.report).iter().all(serde_json::Value::is_object), "{:?}", done(&off.report));
        if done(&off.report) != done(&on.report) {
            wrong.push(format!("{}: {:?} {:?}", pair.name, done(&off.report), done(&on.report)));
        }
        if let Some((name, part)) = pair.skipped {
            let stages = on.report["stages"].as_array().expect("stages");
            let stage = stages.iter().find(|stage| stage["name"] == name).expect("the stage");
            if stage["status"] != "skipped" || !stage["why"].as_str().is_some_and(|why| why.contains(part)) {
                wrong.push(format!("{}: {stage}", pair.name));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
