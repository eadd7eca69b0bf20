//! Pictures: strips over a shared abscissa as one self-contained HTML file (Plotly.js inside).

use serde_json::{Value, json};

/// Plotly.js as the crate `plotly` ships it: the first of its script elements.
pub(crate) fn plotly_js() -> String {
    let sources = plotly::Plot::offline_js_sources();
    let script = sources.split_once('>').map_or("", |(_, rest)| rest);
    script.split("</script>\n").next().unwrap_or_default().to_owned()
}

/// One line of a strip.
pub(crate) struct Line {
    pub(crate) name: String,
    pub(crate) x: Vec<f64>,
    pub(crate) y: Vec<f64>,
    pub(crate) color: &'static str,
    pub(crate) style: Style,
}

/// How a line is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Style {
    /// A solid line.
    Solid,
    /// A dashed line.
    Dashed,
    /// A line of steps.
    Steps,
    /// A line with the area down to zero.
    Area,
}

/// One strip.
pub(crate) struct Strip {
    /// Quantity with unit.
    pub(crate) title: &'static str,
    pub(crate) lines: Vec<Line>,
}

/// Space between two strips, of the whole height.
const GAP_FRAC: f64 = 0.025;

/// The page: a title, a line of text, and the strips one below the other.
pub(crate) fn page(title: &str, text: &str, abscissa: &str, strips: &[Strip]) -> String {
    let mut named: Vec<&str> = Vec::new();
    let mut traces = Vec::new();
    for (row, strip) in strips.iter().enumerate() {
        for line in &strip.lines {
            let first = !named.contains(&line.name.as_str());
            named.push(&line.name);
            traces.push(trace(line, row, first));
        }
    }
    format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <title>{title}</title><style>{STYLE}</style>\n<script>{plotly}</script></head>\
         <body><h1>{title}</h1><p>{text}</p><div id=\"picture\"></div>\
         <script>Plotly.newPlot(\"picture\", {traces}, {layout}, {{responsive: true}});</script>\
         </body></html>\n",
        title = escaped(title),
        text = escaped(text),
        plotly = plotly_js(),
        traces = Value::from(traces).to_string().replace("</", "<\\/"),
        layout = layout(abscissa, strips).to_string().replace("</", "<\\/"),
    )
}

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;margin:24px auto;max-width:1180px;\
    padding:0 16px;color:#17202a}h1{font-size:21px;margin:0 0 4px}p{margin:0 0 12px;color:#51606f}\
    #picture{height:880px}";

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

/// `y`, `y2`, … of a row.
fn axis(row: usize) -> String {
    if row == 0 { "y".to_owned() } else { format!("y{}", row + 1) }
}

fn trace(line: &Line, row: usize, in_legend: bool) -> Value {
    let mut trace = json!({
        "type": "scatter", "mode": "lines", "name": line.name, "x": line.x, "y": line.y,
        "yaxis": axis(row), "legendgroup": line.name, "showlegend": in_legend,
        "line": {
            "color": line.color,
            "width": 1.8,
            "dash": if line.style == Style::Dashed { "dash" } else { "solid" },
            "shape": if line.style == Style::Steps { "hv" } else { "linear" },
        },
    });
    if line.style == Style::Area {
        trace["fill"] = "tozeroy".into();
    }
    trace
}

fn layout(abscissa: &str, strips: &[Strip]) -> Value {
    let count = strips.len().max(1) as f64;
    let share = (1.0 - GAP_FRAC * (count - 1.0)) / count;
    let mut layout = json!({
        "margin": { "l": 70, "r": 20, "t": 10, "b": 45 },
        "hovermode": "x unified",
        "legend": { "orientation": "h", "y": 1.04 },
        "plot_bgcolor": "#ffffff",
        "xaxis": { "title": { "text": abscissa }, "gridcolor": "#e6eaee", "position": 0, "anchor": "free" },
    });
    for (row, strip) in strips.iter().enumerate() {
        let top = 1.0 - row as f64 * (share + GAP_FRAC);
        let key = format!("yaxis{}", axis(row).trim_start_matches('y'));
        layout[key] = json!({
            "domain": [(top - share).max(0.0), top],
            "title": { "text": strip.title },
            "gridcolor": "#e6eaee",
            "zerolinecolor": "#aab4be",
        });
    }
    layout
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plotly_is_the_whole_library_and_nothing_else() {
        let script = plotly_js();
        assert!(script.len() > 1_000_000);
        assert!(!script.contains("<script"), "no second script element");
        assert!(script.contains("plotly.js v"));
    }

    #[test]
    fn a_name_appears_once_in_the_legend_and_cannot_end_the_script() {
        let line = |style| Line {
            name: "</script>".to_owned(),
            x: vec![0.0, 1.0],
            y: vec![2.0, 3.0],
            color: "#000",
            style,
        };
        let strips = [
            Strip { title: "v", lines: vec![line(Style::Solid)] },
            Strip { title: "w", lines: vec![line(Style::Area)] },
        ];
        let page = page("t", "<b>", "s", &strips);
        let body = &page[page.find("<body>").unwrap()..];
        assert_eq!(body.matches("\"showlegend\":true").count(), 1);
        assert_eq!(body.matches("</script>").count(), 1);
        assert!(body.contains("&lt;b>") && body.contains("\"yaxis2\""));
    }
}
