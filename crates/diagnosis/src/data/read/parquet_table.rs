//! Parquet tables with flat numeric columns.

use std::io::Read;
use std::path::Path;

use parquet::basic::{CompressionCodec as Codec, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::file::reader::{FileReader, SerializedFileReader};

use super::RawTable;
use crate::DiagnosisError;

/// First bytes of a gzip file (RFC 1952).
const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

pub(super) fn read(path: &Path) -> Result<RawTable, DiagnosisError> {
    let io = |e: std::io::Error| DiagnosisError::Io { path: path.to_owned(), why: e.to_string() };
    let bad = |e: parquet::errors::ParquetError| DiagnosisError::Table {
        path: path.to_owned(),
        why: e.to_string(),
    };
    let mut file = std::fs::File::open(path).map_err(io)?;
    let mut head = [0; 2];
    if file.read_exact(&mut head).is_ok() && head == GZIP_MAGIC {
        let why = "the file is compressed with gzip; unpack it first".to_owned();
        return Err(DiagnosisError::Table { path: path.to_owned(), why });
    }
    let reader = SerializedFileReader::new(file).map_err(bad)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let mut columns = Vec::new();
    for c in 0..schema.num_columns() {
        let descr = schema.column(c);
        let numeric = matches!(
            descr.physical_type(),
            Type::DOUBLE | Type::FLOAT | Type::INT32 | Type::INT64 | Type::BOOLEAN
        );
        if !numeric || descr.max_rep_level() > 0 {
            continue;
        }
        let mut out = Vec::new();
        for g in 0..reader.num_row_groups() {
            let group = reader.get_row_group(g).map_err(bad)?;
            let codec = group.metadata().column(c).compression_codec();
            if !matches!(codec, Codec::UNCOMPRESSED | Codec::SNAPPY | Codec::ZSTD) {
                let why = format!(
                    "column {} is compressed with {codec:?}; snappy, zstd and none are read",
                    descr.name()
                );
                return Err(DiagnosisError::Table { path: path.to_owned(), why });
            }
            let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
            let optional = descr.max_def_level();
            let r = match group.get_column_reader(c).map_err(bad)? {
                ColumnReader::DoubleColumnReader(r) => values(r, rows, optional, |v| v, &mut out),
                ColumnReader::FloatColumnReader(r) => {
                    values(r, rows, optional, f64::from, &mut out)
                }
                ColumnReader::Int32ColumnReader(r) => {
                    values(r, rows, optional, f64::from, &mut out)
                }
                ColumnReader::Int64ColumnReader(r) => {
                    values(r, rows, optional, |v| v as f64, &mut out)
                }
                ColumnReader::BoolColumnReader(r) => {
                    values(r, rows, optional, |v| f64::from(u8::from(v)), &mut out)
                }
                _ => Ok(()),
            };
            r.map_err(bad)?;
        }
        columns.push((descr.name().to_owned(), out));
    }
    Ok(RawTable { columns })
}

fn values<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    rows: usize,
    max_def: i16,
    f: impl Fn(T::T) -> f64,
    out: &mut Vec<f64>,
) -> Result<(), parquet::errors::ParquetError>
where
    T::T: Copy,
{
    let (mut raw, mut defs) = (Vec::new(), Vec::new());
    let mut read = 0;
    while read < rows {
        let (records, _, _) = reader.read_records(rows - read, Some(&mut defs), None, &mut raw)?;
        if records == 0 {
            break;
        }
        read += records;
    }
    if max_def == 0 {
        out.extend(raw.into_iter().map(f));
    } else {
        let mut present = raw.into_iter();
        out.extend(
            defs.iter().map(|&d| {
                if d == max_def { present.next().map_or(f64::NAN, &f) } else { f64::NAN }
            }),
        );
    }
    Ok(())
}
