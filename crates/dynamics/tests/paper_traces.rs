//! The paper's released longitudinal model, met by configuration alone (`trucks/iits.toml`).

#[path = "support/trace.rs"]
mod trace;

use std::path::Path;

#[test]
fn the_released_models_traces_are_met_to_95_percent_in_speed() {
    let folder =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/reference_traces");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        eprintln!(
            "skipped: the released model's traces are not here (they may not be redistributed)"
        );
        return;
    };
    let mut seen = 0;
    for path in entries.filter_map(|e| Some(e.ok()?.path())) {
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default().to_owned();
        if !(name.starts_with("accel_") || name.starts_with("brake_")) {
            continue;
        }
        let mass_kg = trace::mass_in_name_kg(&path).unwrap();
        let a = trace::replay("iits", &path, mass_kg).unwrap();
        assert!(a.speed_accuracy_frac >= 0.95, "{name}: {a:?}");
        assert!(a.gear_frac >= 0.9, "{name}: {a:?}");
        let (end, trace_end) = a.final_speed_m_s;
        assert!((end - trace_end).abs() < 1.5, "{name}: {a:?}");
        seen += 1;
    }
    assert!(seen > 0, "no traces in {}", folder.display());
}
