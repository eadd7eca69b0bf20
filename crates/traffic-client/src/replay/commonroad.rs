//! Trajectories of the dynamic obstacles of a CommonRoad scenario (XML, versions 2017a to 2020a).

use super::ReplayError;
use super::csv::class;
use super::recording::Row;

/// Reads the dynamic obstacles.
///
/// # Errors
/// [`ReplayError::Format`] names the line of what is missing or not a number.
pub fn read_commonroad(name: &str, text: &str) -> Result<Vec<Row>, ReplayError> {
    let bad = |why: String| ReplayError::Format { name: name.to_owned(), why };
    let document = road::xml::parse(text).map_err(|e| bad(e.to_string()))?;
    let root = document.root_element();
    if !root.has_tag_name("commonRoad") {
        return Err(bad(format!("root element is <{}>, not <commonRoad>", root.tag_name().name())));
    }
    let step_s = root
        .attribute("timeStepSize")
        .and_then(|x| x.parse::<f64>().ok())
        .filter(|x| *x > 0.0)
        .ok_or_else(|| bad("no timeStepSize".to_owned()))?;
    let mut rows = Vec::new();
    for obstacle in root.children().filter(|n| {
        n.has_tag_name("dynamicObstacle")
            || (n.has_tag_name("obstacle") && text_at(*n, &["role"]) == Some("dynamic"))
    }) {
        // Counting lines takes as long as the text before them.
        let line = |node: roxmltree::Node<'_, '_>| document.text_pos_at(node.range().start).row;
        let id = obstacle
            .attribute("id")
            .and_then(|x| x.parse().ok())
            .ok_or_else(|| bad(format!("line {}: obstacle without a number", line(obstacle))))?;
        let number = |path: &[&str]| text_at(obstacle, path).and_then(|x| x.parse::<f64>().ok());
        let head = Row {
            id,
            length_m: number(&["shape", "rectangle", "length"]),
            width_m: number(&["shape", "rectangle", "width"]),
            class: text_at(obstacle, &["type"]).and_then(class),
            ..Row::default()
        };
        let first = obstacle.children().filter(|n| n.has_tag_name("initialState"));
        let later = obstacle
            .children()
            .filter(|n| n.has_tag_name("trajectory"))
            .flat_map(|n| n.children().filter(|n| n.has_tag_name("state")));
        for state in first.chain(later) {
            let value = |path: &[&str]| {
                text_at(state, path).and_then(|x| x.parse::<f64>().ok()).filter(|x| x.is_finite())
            };
            let need = |path: &[&str]| {
                let missing =
                    || bad(format!("line {}: no number in {}", line(state), path.join("/")));
                value(path).ok_or_else(missing)
            };
            rows.push(Row {
                time_s: step_s * need(&["time", "exact"])?,
                x_m: need(&["position", "point", "x"])?,
                y_m: need(&["position", "point", "y"])?,
                yaw_rad: value(&["orientation", "exact"]),
                speed_m_s: value(&["velocity", "exact"]),
                ..head
            });
        }
    }
    Ok(rows)
}

/// Text of the element at the end of a path of names.
fn text_at<'a>(node: roxmltree::Node<'a, '_>, path: &[&str]) -> Option<&'a str> {
    let mut at = node;
    for name in path {
        at = at.children().find(|n| n.has_tag_name(*name))?;
    }
    at.text().map(str::trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENARIO: &str = r#"<commonRoad timeStepSize="0.1"><obstacle id="3"><role>static</role></obstacle>
<obstacle id="363"><role>dynamic</role><type>truck</type>
<shape><rectangle><length>14.1</length><width>2.4</width></rectangle></shape>
<initialState><position><point><x>20.5</x><y>-18</y></point></position><orientation><exact>-0.7</exact></orientation>
<time><exact>0</exact></time><velocity><exact>10</exact></velocity></initialState>
<trajectory><state><position><point><x>21.2</x><y>-19</y></point></position><time><exact>1</exact></time></state></trajectory>
</obstacle></commonRoad>"#;

    #[test]
    fn dynamic_obstacles_are_read_with_shape_and_states() {
        let rows = read_commonroad("s.xml", SCENARIO).unwrap();
        assert_eq!(rows.len(), 2);
        assert_eq!((rows[0].id, rows[0].x_m, rows[0].speed_m_s), (363, 20.5, Some(10.0)));
        assert_eq!((rows[1].time_s, rows[1].length_m, rows[1].yaw_rad), (0.1, Some(14.1), None));
    }

    #[test]
    fn a_state_without_a_position_is_named_by_its_line() {
        let e = read_commonroad("s.xml", &SCENARIO.replace("<x>21.2</x>", "")).unwrap_err();
        assert!(e.to_string().contains("line 6: no number in position/point/x"), "{e}");
        assert!(read_commonroad("s.xml", "<a/>").is_err());
    }
}
