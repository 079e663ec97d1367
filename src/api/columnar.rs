//! Numbers of frames as an Arrow IPC stream: a column a series, read by pandas, Polars,
//! DuckDB and R without a line of parsing.

use super::run::heading;
use crate::store::run_page::FrameSeries;
use arrow_array::{ArrayRef, Float64Array, RecordBatch, UInt32Array};
use arrow_ipc::writer::StreamWriter;
use arrow_schema::{DataType, Field, Schema};
use std::collections::HashMap;
use std::sync::Arc;

/// The stream's bytes. Shorter series end in nulls.
pub fn stream(series: &[FrameSeries], frames: usize) -> Result<Vec<u8>, String> {
    let mut fields = vec![Field::new("frame", DataType::UInt32, false)];
    let mut columns: Vec<ArrayRef> = vec![Arc::new(UInt32Array::from_iter_values(0..frames as u32))];
    for s in series {
        let unit = HashMap::from([("unit".to_string(), s.unit.clone())]);
        fields.push(Field::new(heading(s), DataType::Float64, true).with_metadata(unit));
        columns.push(Arc::new((0..frames).map(|f| s.values.get(f).copied()).collect::<Float64Array>()));
    }
    let schema = Arc::new(Schema::new(fields));
    let write = || -> Result<Vec<u8>, arrow_schema::ArrowError> {
        let batch = RecordBatch::try_new(schema.clone(), columns)?;
        let mut writer = StreamWriter::try_new(Vec::new(), &schema)?;
        writer.write(&batch)?;
        writer.finish()?;
        writer.into_inner()
    };
    write().map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_is_read_back() {
        let s = |name: &str, trial, values: &[f64]| FrameSeries {
            name: name.into(),
            unit: "ns".into(),
            trial,
            values: values.to_vec(),
        };
        let bytes = stream(&[s("cull_ns", Some(1), &[1.5, 2.5]), s("triangles", None, &[7.0])], 2).unwrap();
        let mut reader = arrow_ipc::reader::StreamReader::try_new(&bytes[..], None).unwrap();
        let batch = reader.next().unwrap().unwrap();
        assert_eq!(batch.schema().field(1).name(), "cull_ns trial 1");
        let column = |i: usize| batch.column(i).as_any().downcast_ref::<Float64Array>().unwrap().clone();
        assert_eq!(column(1), Float64Array::from(vec![1.5, 2.5]));
        assert_eq!(column(2), Float64Array::from(vec![Some(7.0), None]));
        assert!(reader.next().is_none());
    }
}
