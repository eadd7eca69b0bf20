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

/// A way to write trajectories.
struct Dialect {
    /// Columns that tell it.
    told_by: &'static [&'static str],
    frame: Frame,
    names: Names,
    /// From a row as it is written to one in metres, seconds and left-hand offsets; none for a row
    /// that is not kept.
    row: fn(Row, Carriageway) -> Option<Row>,
    /// Stations are counted from the first one seen.
    from_zero: bool,
}

/// Names under which a dialect knows a field; without a name it has none.
#[derive(Clone, Copy)]
struct Names {
    id: &'static [&'static str],
    time: &'static [&'static str],
    x: &'static [&'static str],
    y: &'static [&'static str],
    yaw: &'static [&'static str],
    speed: &'static [&'static str],
    length: &'static [&'static str],
    width: &'static [&'static str],
    class: &'static [&'static str],
}

const NO_NAMES: Names = Names {
    id: &[],
    time: &[],
    x: &[],
    y: &[],
    yaw: &[],
    speed: &[],
    length: &[],
    width: &[],
    class: &[],
};

/// The first whose columns are there; the last is told by nothing.
const DIALECTS: [Dialect; 4] = [
    Dialect {
        told_by: &["Local_X", "Frame_ID"],
        frame: Frame::Road,
        names: Names {
            id: &["Vehicle_ID"],
            time: &["Frame_ID"],
            x: &["Local_Y"],
            y: &["Local_X"],
            speed: &["v_Vel"],
            length: &["v_Length"],
            width: &["v_Width"],
            class: &["v_Class"],
            ..NO_NAMES
        },
        row: ngsim,
        from_zero: false,
    },
    Dialect {
        told_by: &["xVelocity", "frame"],
        frame: Frame::Road,
        names: Names {
            id: &["id"],
            time: &["frame"],
            x: &["x"],
            y: &["y"],
            speed: &["xVelocity"],
            length: &["width"],
            width: &["height"],
            class: &["class"],
            ..NO_NAMES
        },
        row: highd,
        from_zero: true,
    },
    Dialect {
        told_by: &["frame", "vehicle"],
        frame: Frame::Map,
        names: Names { id: &["vehicle"], time: &["frame"], x: &["x"], y: &["y"], ..NO_NAMES },
        row: mapped,
        from_zero: false,
    },
    Dialect {
        told_by: &[],
        frame: Frame::Map,
        names: Names {
            id: &["id", "vehicle_id"],
            time: &["time_s", "t_s", "t"],
            x: &["x_m", "x"],
            y: &["y_m", "y"],
            yaw: &["yaw_rad", "heading_rad", "heading"],
            speed: &["speed_m_s", "v_mps", "v"],
            length: &["length_m", "length"],
            width: &["width_m", "width"],
            class: &["class", "type"],
        },
        row: |row, _| Some(row),
        from_zero: false,
    },
];

fn mapped(row: Row, _: Carriageway) -> Option<Row> {
    Some(Row { time_s: row.time_s / NGSIM_HZ, ..row })
}

/// `Local_Y` is the front's way along the road, `Local_X` the way to the right.
fn ngsim(row: Row, _: Carriageway) -> Option<Row> {
    let metres = |feet: Option<f64>| feet.map(|f| f * FOOT_M);
    let length_m = metres(row.length_m);
    Some(Row {
        time_s: row.time_s / NGSIM_HZ,
        x_m: row.x_m * FOOT_M - 0.5 * length_m.unwrap_or(0.0),
        y_m: -row.y_m * FOOT_M,
        yaw_rad: Some(0.0),
        speed_m_s: metres(row.speed_m_s),
        width_m: metres(row.width_m),
        length_m,
        ..row
    })
}

fn highd(row: Row, carriageway: Carriageway) -> Option<Row> {
    let forward = row.speed_m_s.unwrap_or(0.0) >= 0.0;
    if forward != (carriageway == Carriageway::Forward) {
        return None;
    }
    let x = row.x_m + 0.5 * row.length_m.unwrap_or(0.0);
    let y = row.y_m + 0.5 * row.width_m.unwrap_or(0.0);
    let (x_m, y_m) = if forward { (x, -y) } else { (-x, y) };
    Some(Row {
        time_s: row.time_s / HIGHD_HZ,
        x_m,
        y_m,
        yaw_rad: Some(0.0),
        speed_m_s: row.speed_m_s.map(f64::abs),
        ..row
    })
}

/// A dialect's field in a file: where it stands, and its names for messages.
struct Field {
    names: &'static [&'static str],
    at: Option<usize>,
}

impl Field {
    fn of(header: &::csv::StringRecord, names: &'static [&'static str]) -> Self {
        let at = header.iter().position(|column| {
            let column = column.trim().trim_start_matches('\u{feff}');
            names.iter().any(|name| column.eq_ignore_ascii_case(name))
        });
        Self { names, at }
    }

    fn text<'r>(&self, record: &'r ::csv::StringRecord) -> Option<&'r str> {
        self.at.and_then(|at| record.get(at)).filter(|text| !text.is_empty())
    }

    /// # Errors
    /// What is wrong with the value, without its line.
    fn number(&self, record: &::csv::StringRecord) -> Result<Option<f64>, String> {
        let Some(text) = self.text(record) else { return Ok(None) };
        match text.parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(Some(x)),
            _ => Err(format!(", column {}: `{text}`", self.names.join("/"))),
        }
    }

    fn needed(&self, record: &::csv::StringRecord) -> Result<f64, String> {
        self.number(record)?.ok_or_else(|| format!(": no {}", self.names.join("/")))
    }
}

/// A dialect's fields in a file.
struct Fields {
    id: Field,
    time: Field,
    x: Field,
    y: Field,
    yaw: Field,
    speed: Field,
    length: Field,
    width: Field,
    class: Field,
}

impl Fields {
    /// # Errors
    /// The name of the column that is missing.
    fn of(header: &::csv::StringRecord, names: &Names) -> Result<Self, String> {
        let field = |names| Field::of(header, names);
        let fields = Self {
            id: field(names.id),
            time: field(names.time),
            x: field(names.x),
            y: field(names.y),
            yaw: field(names.yaw),
            speed: field(names.speed),
            length: field(names.length),
            width: field(names.width),
            class: field(names.class),
        };
        for needed in [&fields.id, &fields.time, &fields.x, &fields.y] {
            if needed.at.is_none() {
                return Err(format!("no column {}", needed.names.join(" or ")));
            }
        }
        Ok(fields)
    }

    /// A row as it is written, in the dialect's own units.
    fn read(&self, record: &::csv::StringRecord) -> Result<Row, String> {
        Ok(Row {
            id: self.id.needed(record)? as u64,
            time_s: self.time.needed(record)?,
            x_m: self.x.needed(record)?,
            y_m: self.y.needed(record)?,
            yaw_rad: self.yaw.number(record)?,
            speed_m_s: self.speed.number(record)?,
            length_m: self.length.number(record)?,
            width_m: self.width.number(record)?,
            class: self.class.text(record).and_then(class),
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
    let told = |d: &&Dialect| {
        d.told_by.iter().all(|c| Field::of(&header, core::slice::from_ref(c)).at.is_some())
    };
    let [.., own] = &DIALECTS;
    let dialect = DIALECTS.iter().find(told).unwrap_or(own);
    let fields = Fields::of(&header, &dialect.names).map_err(bad)?;
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| bad(e.to_string()))?;
        let line = record.position().map_or(0, ::csv::Position::line);
        let written = fields.read(&record).map_err(|why| bad(format!("line {line}{why}")))?;
        rows.extend((dialect.row)(written, carriageway));
    }
    if dialect.from_zero {
        shift_to_zero(&mut rows);
    }
    Ok((dialect.frame, rows))
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
        "emergency" => Some(VehicleClass::Emergency),
        "barrier" => Some(VehicleClass::Barrier),
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
