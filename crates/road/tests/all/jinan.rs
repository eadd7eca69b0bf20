//! The measured profile of the paper's site, where the working copy has it beside it.
#![expect(clippy::disallowed_macros, reason = "a skipped test says so")]

use std::path::PathBuf;

use road::Road;

#[test]
fn the_jinan_profile_becomes_a_road_that_keeps_its_heights_and_its_place() {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let file = "shared/data/jinan_road/jinan_altimap_10m.csv";
    let found = ["../../..", "../../../.."].iter().map(|up| root.join(up).join(file));
    let Some(path) = found.into_iter().find(|p| p.exists()) else {
        println!("skipped: no ../shared/data/jinan_road beside the workspace");
        return;
    };
    let road = Road::load(&path.to_string_lossy()).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let (mut height, mut place, mut grade, mut steepest) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let rows = text.lines().filter(|l| l.starts_with(|c: char| c.is_ascii_digit()));
    let (mut count, mut before_faults) = (0, 0.0_f64);
    for row in rows {
        let v: Vec<f64> = row.split(',').map(|c| c.parse().unwrap()).collect();
        let p = road.at(v[0], 0.0);
        height = height.max((p.z_m - v[3]).abs());
        let off = (p.x_m - v[1]).hypot(p.y_m - v[2]);
        place = place.max(off);
        if v[0] < 15_000.0 {
            before_faults = before_faults.max(off);
        }
        grade = grade.max((p.grade_rad.tan() - v[4]).abs());
        steepest = steepest.max(p.grade_rad.tan().abs());
        count += 1;
    }
    let tightest =
        (0..23_000).map(|s| road.at(f64::from(s), 0.0).curvature_1_m.abs()).fold(0.0, f64::max);
    println!(
        "{count} rows, {:.0} m: height {height:.3} m, place {before_faults:.1} m to 15 km, {place:.1} m to the end, grade {grade:.5}, \
         steepest {steepest:.4}, tightest R {:.0} m",
        road.length_m(),
        1.0 / tightest
    );
    assert!(count > 2_000 && (road.length_m() - 23_120.0).abs() < 20.0);
    // Some of the file's points do not move with its stations (doubled, or 19 m apart over 10 m), so
    // that stations and heights are kept and the place is only followed by its headings.
    assert!(height < 0.1, "{height}");
    assert!(before_faults < 60.0, "{before_faults} m off where the file is in order");
    assert!(steepest > 0.05 && steepest < 0.056);
}
