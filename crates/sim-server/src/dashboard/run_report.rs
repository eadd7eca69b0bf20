//! The report of a run: what its summary says and its course, in one file.

use serde_json::Value;

use super::playback::Playback;
use crate::picture::{Line, Strip, Style, page};
use crate::run_folder::FoundRun;

/// What is said of a run in words.
const FIGURES: [(&str, &str, f64, &str); 10] = [
    ("distance_m", "driven", 1e-3, "km"),
    ("duration_s", "in", 1.0, "s"),
    ("mean_speed_m_s", "at", 3.6, "km/h"),
    ("fuel_g", "with", 1e-3, "kg of fuel"),
    ("saving_frac", "saved against cruise control", 100.0, "%"),
    ("lane_changes", "lane changes", 1.0, ""),
    ("collisions", "collisions", 1.0, ""),
    ("guard_activations", "ticks under the guard", 1.0, ""),
    ("max_lateral_error_m", "lateral error at most", 1.0, "m"),
    ("missed_deadlines", "missed deadlines", 1.0, ""),
];

/// The page.
pub(super) fn page_of(run: &FoundRun, playback: &Playback) -> String {
    let title = format!("Run {}", run.name);
    page(&title, &sentence(run, playback), "distance, km", &strips(playback))
}

fn sentence(run: &FoundRun, playback: &Playback) -> String {
    let Some(summary) = &run.summary else {
        return "The run has no summary: it broke off.".to_owned();
    };
    let word = |key: &str| summary[key].as_str().unwrap_or("unknown").to_owned();
    let figures = FIGURES.iter().filter_map(|(key, words, factor, unit)| {
        let value = summary[key].as_f64()? * factor;
        let digits = if value.fract() == 0.0 { 0 } else { 2 };
        Some(format!("{words}: {value:.digits$} {unit}").trim_end().to_owned())
    });
    let figures = figures.collect::<Vec<_>>().join(", ");
    let seed = match &summary["seed"] {
        Value::Number(seed) => seed.to_string(),
        _ => "unknown".to_owned(),
    };
    let differs = match playback.ticks_different {
        0 => String::new(),
        ticks => format!(
            " {ticks} commands do not come out as recorded: another revision drove, or it goes on from a snapshot."
        ),
    };
    format!(
        "Scenario {}, seed {seed}, revision {}, state hash {}, end: {}. {figures}.{differs}",
        word("scenario"),
        word("git_revision"),
        word("state_hash"),
        word("end_reason"),
    )
}

fn strips(playback: &Playback) -> Vec<Strip> {
    let strip = &playback.strip;
    let line = |name: &str, y: Vec<f64>, color: &'static str, style: Style| {
        let x = strip.s_m.iter().map(|s| s * 1e-3).collect();
        Line { name: name.to_owned(), x, y, color, style }
    };
    let scaled = |values: &[f64], factor: f64| values.iter().map(|v| v * factor).collect();
    let (height, grade) = playback.profile_at(&strip.s_m);
    vec![
        Strip {
            title: "km/h",
            lines: vec![
                line(
                    "reference",
                    scaled(&strip.reference_speed_m_s, 3.6),
                    "#E69F00",
                    Style::Dashed,
                ),
                line("speed", scaled(&strip.speed_m_s, 3.6), "#0072B2", Style::Solid),
            ],
        },
        Strip { title: "height, m", lines: vec![line("height", height, "#009E73", Style::Area)] },
        Strip { title: "grade, %", lines: vec![line("grade", grade, "#56B4E9", Style::Area)] },
        Strip {
            title: "engine, kW",
            lines: vec![line(
                "engine",
                scaled(&strip.engine_power_w, 1e-3),
                "#D55E00",
                Style::Solid,
            )],
        },
        Strip {
            title: "gear",
            lines: vec![line(
                "gear",
                strip.gear.iter().map(|&gear| gear.into()).collect(),
                "#CC79A7",
                Style::Steps,
            )],
        },
        Strip {
            title: "fuel, kg",
            lines: vec![line("fuel", scaled(&strip.fuel_used_g, 1e-3), "#000000", Style::Solid)],
        },
        Strip {
            title: "lane error, cm",
            lines: vec![line(
                "lane error",
                scaled(&strip.lateral_error_m, 100.0),
                "#0072B2",
                Style::Solid,
            )],
        },
    ]
}
