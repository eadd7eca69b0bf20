//! `statistics.html`: the distributions, simulated over measured, one panel per quantity.

use serde_json::{Value, json};
use traffic_client::stats::{QUANTITIES, Samples};

use super::measured::Measured;
use crate::picture::plotly_js;

/// Bins of a histogram.
const BINS: usize = 48;
/// Panels side by side.
const COLUMNS: usize = 2;
const SIMULATED: &str = "#0a7cc4";
const MEASURED: &str = "#d1495b";

/// One panel: lines over an abscissa of its own.
pub(super) struct Panel {
    pub(super) abscissa: &'static str,
    pub(super) ordinate: &'static str,
    pub(super) curves: Vec<Curve>,
}

/// A line, or dots.
pub(super) struct Curve {
    pub(super) name: &'static str,
    pub(super) color: &'static str,
    pub(super) dots: bool,
    pub(super) x: Vec<f64>,
    pub(super) y: Vec<f64>,
}

/// The page of the distributions.
pub(super) fn page(text: &str, simulated: &Samples, measured: &Measured) -> String {
    let panels: Vec<Panel> = QUANTITIES
        .iter()
        .filter_map(|&(quantity, _, title)| {
            let (a, b) = (simulated.of(quantity), measured.samples.of(quantity));
            let (low, high) = range(&[a, b])?;
            let mut curves = Vec::new();
            for (name, color, values) in [("measured", MEASURED, b), ("simulated", SIMULATED, a)] {
                if !values.is_empty() {
                    let (x, y) = density(values, low, high);
                    curves.push(Curve { name, color, dots: false, x, y });
                }
            }
            Some(Panel { abscissa: title, ordinate: "density", curves })
        })
        .collect();
    html("Traffic", text, &panels)
}

/// Range of all but the outermost half percent of the samples.
fn range(sets: &[&[f64]]) -> Option<(f64, f64)> {
    let mut all: Vec<f64> = sets.iter().flat_map(|set| set.iter().copied()).collect();
    all.sort_by(f64::total_cmp);
    let at = |q: f64| all.get((q * (all.len().max(1) - 1) as f64) as usize).copied();
    let (low, high) = (at(0.005)?, at(0.995)?);
    (high > low).then_some((low, high))
}

/// A histogram as a density over the middles of its bins.
fn density(values: &[f64], low: f64, high: f64) -> (Vec<f64>, Vec<f64>) {
    let width = (high - low) / BINS as f64;
    let mut counts = vec![0.0; BINS];
    for &value in values {
        let bin = ((value - low) / width).floor();
        if bin >= 0.0
            && let Some(count) = counts.get_mut(bin as usize)
        {
            *count += 1.0;
        }
    }
    let x = (0..BINS).map(|k| low + (k as f64 + 0.5) * width).collect();
    let y = counts.iter().map(|count| count / (values.len() as f64 * width)).collect();
    (x, y)
}

/// A page of panels, self-contained.
pub(super) fn html(title: &str, text: &str, panels: &[Panel]) -> String {
    let rows = panels.len().div_ceil(COLUMNS).max(1);
    let mut traces: Vec<Value> = Vec::new();
    let mut layout = json!({
        "margin": { "l": 60, "r": 20, "t": 30, "b": 45 },
        "height": 300 * rows,
        "plot_bgcolor": "#ffffff",
        "legend": { "orientation": "h", "y": 1.08 },
    });
    let mut named: Vec<&str> = Vec::new();
    for (k, panel) in panels.iter().enumerate() {
        let number = if k == 0 { String::new() } else { (k + 1).to_string() };
        let (column, row) = ((k % COLUMNS) as f64, (k / COLUMNS) as f64);
        let (w, h) = (1.0 / COLUMNS as f64, 1.0 / rows as f64);
        layout[format!("xaxis{number}")] = json!({
            "domain": [column * w + 0.02, (column + 1.0) * w - 0.02], "anchor": format!("y{number}"),
            "title": { "text": panel.abscissa }, "gridcolor": "#e6eaee",
        });
        layout[format!("yaxis{number}")] = json!({
            "domain": [1.0 - (row + 1.0) * h + 0.2 * h, 1.0 - row * h - 0.02],
            "anchor": format!("x{number}"), "rangemode": "tozero",
            "title": { "text": panel.ordinate }, "gridcolor": "#e6eaee",
        });
        for Curve { name, color, dots, x, y } in &panel.curves {
            traces.push(json!({
                "type": "scatter", "mode": if *dots { "markers" } else { "lines" }, "name": name,
                "x": x, "y": y, "xaxis": format!("x{number}"), "yaxis": format!("y{number}"),
                "legendgroup": name, "showlegend": !named.contains(name),
                "line": { "color": color, "width": 2 }, "marker": { "color": color, "size": 8 },
            }));
            named.push(name);
        }
    }
    let escaped = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;");
    let script = |value: &Value| value.to_string().replace("</", "<\\/");
    format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\
         <style>body{{font:15px/1.5 system-ui,sans-serif;margin:24px auto;max-width:1180px}}</style>\n\
         <script>{plotly}</script></head><body><h1>{title}</h1><p>{text}</p><div id=\"picture\"></div>\
         <script>Plotly.newPlot(\"picture\", {traces}, {layout}, {{responsive: true}});</script>\
         </body></html>\n",
        title = escaped(title),
        text = escaped(text),
        plotly = plotly_js(),
        traces = script(&Value::from(traces)),
        layout = script(&layout),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_density_has_the_area_of_one() {
        let values: Vec<f64> = (0..1000).map(|k| f64::from(k) / 1000.0).collect();
        let (x, y) = density(&values, 0.0, 1.0);
        assert_eq!((x.len(), y.len()), (BINS, BINS));
        let area = y.iter().sum::<f64>() / BINS as f64;
        assert!((area - 1.0).abs() < 1e-9 && (y[10] - 1.0).abs() < 0.05, "{area} {}", y[10]);
    }
}
