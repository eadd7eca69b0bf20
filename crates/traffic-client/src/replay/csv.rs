//! Trajectories in CSV: the format is told from the header.
//!
//! | format | recognised by | coordinates |
//! |---|---|---|
//! | own, and CommonRoad exports | `id` with `t_s`/`time_s`, `x_m`, `y_m` | map |
//! | mapped frames | `frame`, `vehicle`, `x`, `y` (10 Hz) | map |
//! | NGSIM | `Vehicle_ID`, `Frame_ID`, `Local_X`, `Local_Y` (feet, front, 10 Hz) | road |
//! | highD | `frame`, `id`, `xVelocity` (bounding box, image axes, 25 Hz) | road |
//!
//! The yaw of mapped frames points against the motion and is not used: headings come from the
//! motion. For highD, y points down in the image and a vehicle that drives to the left runs along falling
//! x; both carriageways are turned so that s grows in the direction of travel. Only one is kept.

use tractrix_core::VehicleClass;

use super::ReplayError;
use super::recording::{Frame, Row};

/// One foot, m.
const FOOT_M: f64 = 0.3048;
/// Frame rate of the formats that count frames, 1/s.
const NGSIM_HZ: f64 = 10.0;
const HIGHD_HZ: f64 = 25.0;

/// Which carriageway of a recording with two is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Carriageway {
    /// Vehicles that drive towards growing x.
    #[default]
    Forward,
    /// Vehicles that drive towards falling x.
    Backward,
}

enum Format {
    Own,
    Mapped,
    Ngsim,
    HighD,
}

struct Columns<'a> {
    header: &'a ::csv::StringRecord,
}

impl Columns<'_> {
    fn find(&self, names: &[&str]) -> Option<usize> {
        self.header.iter().position(|column| {
            let column = column.trim().trim_start_matches('\u{feff}');
            names.iter().any(|name| column.eq_ignore_ascii_case(name))
        })
    }
}

/// Reads rows from CSV text; lines that start with `#` are comments.
///
/// # Errors
/// [`ReplayError::Format`] names the missing column, or the line and column of a bad value.
pub fn read_csv(
    name: &str,
    text: &[u8],
    carriageway: Carriageway,
) -> Result<(Frame, Vec<Row>), ReplayError> {
    let bad = |why: String| ReplayError::Format { name: name.to_owned(), why };
    let mut reader = ::csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .flexible(false)
        .trim(::csv::Trim::All)
        .from_reader(text);
    let header = reader.headers().map_err(|e| bad(e.to_string()))?.clone();
    let columns = Columns { header: &header };
    let has = |column: &str| columns.find(&[column]).is_some();
    let format = if has("Local_X") && has("Frame_ID") {
        Format::Ngsim
    } else if has("xVelocity") && has("frame") {
        Format::HighD
    } else if has("frame") && has("vehicle") {
        Format::Mapped
    } else {
        Format::Own
    };
    // Names of: vehicle, time, x, y, yaw, speed, length, width, class.
    let (names, frame): ([&[&str]; 9], Frame) = match format {
        Format::Own => (
            [
                &["id", "vehicle_id"],
                &["time_s", "t_s", "t"],
                &["x_m", "x"],
                &["y_m", "y"],
                &["yaw_rad", "heading_rad", "heading"],
                &["speed_m_s", "v_mps", "v"],
                &["length_m", "length"],
                &["width_m", "width"],
                &["class", "type"],
            ],
            Frame::Map,
        ),
        Format::Mapped => {
            ([&["vehicle"], &["frame"], &["x"], &["y"], &[], &[], &[], &[], &[]], Frame::Map)
        }
        Format::Ngsim => (
            [
                &["Vehicle_ID"],
                &["Frame_ID"],
                &["Local_Y"],
                &["Local_X"],
                &[],
                &["v_Vel"],
                &["v_Length"],
                &["v_Width"],
                &["v_Class"],
            ],
            Frame::Road,
        ),
        Format::HighD => (
            [
                &["id"],
                &["frame"],
                &["x"],
                &["y"],
                &[],
                &["xVelocity"],
                &["width"],
                &["height"],
                &["class"],
            ],
            Frame::Road,
        ),
    };
    let at = names.map(|list| columns.find(list));
    for (k, list) in names.iter().enumerate().take(4) {
        if at[k].is_none() {
            return Err(bad(format!("no column {}", list.join(" or "))));
        }
    }
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| bad(e.to_string()))?;
        let line = record.position().map_or(0, ::csv::Position::line);
        let field = |k: usize| at[k].and_then(|c| record.get(c)).filter(|text| !text.is_empty());
        let number = |k: usize| -> Result<Option<f64>, ReplayError> {
            let Some(text) = field(k) else { return Ok(None) };
            match text.parse::<f64>() {
                Ok(x) if x.is_finite() => Ok(Some(x)),
                _ => Err(bad(format!("line {line}, column {}: `{text}`", names[k].join("/")))),
            }
        };
        let need = |k: usize| {
            number(k)?.ok_or_else(|| bad(format!("line {line}: no {}", names[k].join("/"))))
        };
        let id = need(0)? as u64;
        let (time, x, y) = (need(1)?, need(2)?, need(3)?);
        let (length, width) = (number(6)?, number(7)?);
        let mut row = Row {
            id,
            time_s: time,
            x_m: x,
            y_m: y,
            yaw_rad: number(4)?,
            speed_m_s: number(5)?,
            length_m: length,
            width_m: width,
            class: field(8).and_then(class),
        };
        match format {
            Format::Own => {}
            Format::Mapped => {
                row.time_s = time / NGSIM_HZ;
            }
            Format::Ngsim => {
                row.length_m = length.map(|l| l * FOOT_M);
                row.width_m = width.map(|w| w * FOOT_M);
                row.time_s = time / NGSIM_HZ;
                // Local_Y is the front's way along the road, Local_X the way to the right.
                row.x_m = x * FOOT_M - 0.5 * row.length_m.unwrap_or(0.0);
                row.y_m = -y * FOOT_M;
                row.speed_m_s = row.speed_m_s.map(|v| v * FOOT_M);
                row.yaw_rad = Some(0.0);
            }
            Format::HighD => {
                let forward = row.speed_m_s.unwrap_or(0.0) >= 0.0;
                if forward != (carriageway == Carriageway::Forward) {
                    continue;
                }
                row.time_s = time / HIGHD_HZ;
                let (cx, cy) = (x + 0.5 * length.unwrap_or(0.0), y + 0.5 * width.unwrap_or(0.0));
                (row.x_m, row.y_m) = if forward { (cx, -cy) } else { (-cx, cy) };
                row.speed_m_s = row.speed_m_s.map(f64::abs);
                row.yaw_rad = Some(0.0);
            }
        }
        rows.push(row);
    }
    if let Format::HighD = format {
        shift_to_zero(&mut rows);
    }
    Ok((frame, rows))
}

/// Moves stations so that the first is zero.
fn shift_to_zero(rows: &mut [Row]) {
    let least = rows.iter().map(|row| row.x_m).fold(f64::INFINITY, f64::min);
    for row in rows {
        row.x_m -= least;
    }
}

/// A class by its name or NGSIM number.
pub(crate) fn class(text: &str) -> Option<VehicleClass> {
    let text = text.to_ascii_lowercase();
    match text.as_str() {
        "car" | "passenger" | "2" | "1" | "motorcycle" => Some(VehicleClass::Car),
        "van" | "delivery" => Some(VehicleClass::Van),
        "truck" | "bus" | "trailer" | "3" => Some(VehicleClass::Truck),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> (Frame, Vec<Row>) {
        read_csv("t.csv", text.as_bytes(), Carriageway::Forward).unwrap()
    }

    #[test]
    fn ngsim_feet_and_right_hand_axes_become_metres_and_left_hand_offsets() {
        let (frame, rows) = read(
            "Vehicle_ID,Frame_ID,Local_X,Local_Y,v_Length,v_Width,v_Class,v_Vel\n515,2330,30,100,20,6,2,50\n",
        );
        let r = rows[0];
        assert_eq!(frame, Frame::Road);
        assert!((r.x_m - (30.48 - 3.048)).abs() < 1e-12 && (r.y_m + 9.144).abs() < 1e-12);
        assert!((r.speed_m_s.unwrap() - 15.24).abs() < 1e-12);
        assert_eq!((r.time_s, r.class), (233.0, Some(VehicleClass::Car)));
    }

    #[test]
    fn highd_boxes_are_centred_and_one_carriageway_is_kept() {
        let text = "frame,id,x,y,width,height,xVelocity,class\n25,1,100,20,5,2,30,Car\n25,2,100,8,16,2.5,-25,Truck\n";
        let (_, forward) = read(text);
        assert_eq!(
            (forward.len(), forward[0].id, forward[0].y_m, forward[0].time_s),
            (1, 1, -21.0, 1.0)
        );
        let (_, back) = read_csv("t", text.as_bytes(), Carriageway::Backward).unwrap();
        assert_eq!((back[0].id, back[0].y_m, back[0].speed_m_s), (2, 9.25, Some(25.0)));
        assert_eq!((back[0].length_m, back[0].class), (Some(16.0), Some(VehicleClass::Truck)));
    }

    #[test]
    fn mapped_frames_and_commonroad_exports_are_read() {
        let (_, rows) = read(
            "# origin x\nframe,vehicle,x,y,z_or_lane,lane_id,yaw_deg\n3,5,-828.0,-5949.1,299.5,30148,90\n",
        );
        assert_eq!(rows[0].yaw_rad, None);
        assert!((rows[0].time_s - 0.3).abs() < 1e-12);
        let (_, rows) = read(
            "id,type,length_m,width_m,t_s,x_m,y_m,heading_rad,v_mps,a_mps2\n363,car,4.1,2.4,0.1,21,-19,-0.7,10.7,\n",
        );
        assert_eq!((rows[0].speed_m_s, rows[0].class), (Some(10.7), Some(VehicleClass::Car)));
    }

    #[test]
    fn bad_files_are_named_by_column_and_line() {
        let e = |text: &str| {
            read_csv("t.csv", text.as_bytes(), Carriageway::Forward).unwrap_err().to_string()
        };
        assert!(e("id,x_m,y_m\n").contains("time_s"));
        assert!(e("id,t_s,x_m,y_m\n1,0,abc,2\n").contains("line 2, column x_m/x: `abc`"));
        assert!(e("id,t_s,x_m,y_m\n1,0\n").contains("t.csv"));
    }
}
