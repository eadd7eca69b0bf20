//! Trajectories as Parquet: one row per vehicle and step, units in the column names.
//!
//! Columns `id, time_s, x_m, y_m, yaw_rad, speed_m_s, length_m, width_m, class`; `class` is text.
//! Other files are read as long as they have the first four, under these names.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use ::parquet::basic::{Compression, CompressionCodec as Codec};
use ::parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::reader::{FileReader, SerializedFileReader};
use ::parquet::file::writer::SerializedFileWriter;
use ::parquet::record::Field;
use ::parquet::schema::parser::parse_message_type;
use tractrix_core::VehicleClass;

use super::ReplayError;
use super::csv::class;
use super::recording::{Recording, Row};

const SCHEMA: &str = "message trajectories {
    required int64 id; required double time_s; required double x_m; required double y_m;
    required double yaw_rad; required double speed_m_s; required double length_m;
    required double width_m; required binary class (UTF8);
}";

/// Reads rows.
///
/// # Errors
/// [`ReplayError::File`] and [`ReplayError::Format`] with the missing column or the bad row.
pub fn read_parquet(path: &Path) -> Result<Vec<Row>, ReplayError> {
    let name = path.display().to_string();
    let bad = |why: String| ReplayError::Format { name: name.clone(), why };
    let file = File::open(path).map_err(|e| super::file_error(path, &e))?;
    let reader = SerializedFileReader::new(file).map_err(|e| bad(e.to_string()))?;
    let groups = reader.metadata().row_groups();
    if let Some(column) =
        groups.iter().flat_map(|g| g.columns()).find(|c| !is_read(c.compression_codec()))
    {
        let (name, codec) = (column.column_path(), column.compression_codec());
        let why =
            format!("column {name} is compressed with {codec:?}; snappy, zstd and none are read");
        return Err(bad(why));
    }
    let mut rows = Vec::new();
    for (k, record) in reader.get_row_iter(None).map_err(|e| bad(e.to_string()))?.enumerate() {
        let record = record.map_err(|e| bad(format!("row {}: {e}", k + 1)))?;
        let mut row = Row::default();
        let mut needed = [false; 4];
        for (column, field) in record.get_column_iter() {
            if let Field::Str(text) = field
                && matches!(column.as_str(), "class" | "type")
            {
                row.class = class(text);
                continue;
            }
            let Some(x) = number(field) else { continue };
            match column.as_str() {
                "id" => (row.id, needed[0]) = (x as u64, true),
                "time_s" | "t_s" => (row.time_s, needed[1]) = (x, true),
                "x_m" => (row.x_m, needed[2]) = (x, true),
                "y_m" => (row.y_m, needed[3]) = (x, true),
                "yaw_rad" => row.yaw_rad = Some(x),
                "speed_m_s" => row.speed_m_s = Some(x),
                "length_m" => row.length_m = Some(x),
                "width_m" => row.width_m = Some(x),
                _ => {}
            }
        }
        if let Some(k_missing) = needed.iter().position(|there| !there) {
            let column = ["id", "time_s", "x_m", "y_m"].get(k_missing).copied().unwrap_or_default();
            return Err(bad(format!("row {}: no number in column {column}", k + 1)));
        }
        rows.push(row);
    }
    Ok(rows)
}

fn is_read(codec: Codec) -> bool {
    matches!(codec, Codec::UNCOMPRESSED | Codec::SNAPPY | Codec::ZSTD)
}

fn number(field: &Field) -> Option<f64> {
    Some(match field {
        Field::Double(x) => *x,
        Field::Float(x) => f64::from(*x),
        Field::Int(x) => f64::from(*x),
        Field::Long(x) => *x as f64,
        Field::UInt(x) => f64::from(*x),
        Field::ULong(x) => *x as f64,
        Field::Short(x) => f64::from(*x),
        Field::UShort(x) => f64::from(*x),
        _ => return None,
    })
    .filter(|x| x.is_finite())
}

/// A recording as the bytes of a Parquet file.
///
/// # Errors
/// [`ReplayError::Format`] if it cannot be encoded.
pub fn to_parquet(recording: &Recording) -> Result<Vec<u8>, ReplayError> {
    let fail = |why: String| ReplayError::Format { name: recording.name.clone(), why };
    let mut file = Vec::new();
    let schema = Arc::new(parse_message_type(SCHEMA).map_err(|e| fail(e.to_string()))?);
    let properties =
        Arc::new(WriterProperties::builder().set_compression(Compression::SNAPPY).build());
    let mut writer = SerializedFileWriter::new(&mut file, schema, properties)
        .map_err(|e| fail(e.to_string()))?;
    let all =
        || recording.tracks.iter().flat_map(|t| t.samples.iter().enumerate().map(move |s| (t, s)));
    let ids: Vec<i64> = all().map(|(t, _)| t.id as i64).collect();
    let numbers: [Vec<f64>; 7] = [
        all().map(|(t, (k, _))| (t.first + k) as f64 * recording.step_s).collect(),
        all().map(|(_, (_, s))| s.x_m).collect(),
        all().map(|(_, (_, s))| s.y_m).collect(),
        all().map(|(_, (_, s))| s.yaw_rad).collect(),
        all().map(|(_, (_, s))| s.speed_m_s).collect(),
        all().map(|(t, _)| t.length_m).collect(),
        all().map(|(t, _)| t.width_m).collect(),
    ];
    let classes: Vec<ByteArray> =
        all().map(|(t, _)| ByteArray::from(class_name(t.class))).collect();
    let write = || -> ::parquet::errors::Result<()> {
        let mut group = writer.next_row_group()?;
        let mut column = 0;
        while let Some(mut out) = group.next_column()? {
            match column {
                0 => out.typed::<Int64Type>().write_batch(&ids, None, None)?,
                8 => out.typed::<ByteArrayType>().write_batch(&classes, None, None)?,
                k => match numbers.get(k - 1) {
                    Some(list) => out.typed::<DoubleType>().write_batch(list, None, None)?,
                    None => 0,
                },
            };
            out.close()?;
            column += 1;
        }
        group.close()?;
        writer.close()?;
        Ok(())
    };
    write().map_err(|e| fail(e.to_string()))?;
    Ok(file)
}

fn class_name(class: VehicleClass) -> &'static str {
    match class {
        VehicleClass::Car => "car",
        VehicleClass::Van => "van",
        VehicleClass::Truck => "truck",
        VehicleClass::Emergency => "emergency",
        VehicleClass::Barrier => "barrier",
    }
}
