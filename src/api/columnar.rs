//! Numbers of frames, a column a series: as CSV, or as an Arrow IPC stream, which pandas,
//! Polars, DuckDB and R read without a line of parsing.

use crate::stats;
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

/// Counted series as they are, times as medians over trials at each frame.
pub fn medians(all: Vec<FrameSeries>) -> Vec<FrameSeries> {
    let mut out: Vec<FrameSeries> = Vec::new();
    let mut done: Vec<String> = Vec::new();
    for s in &all {
        if s.trial.is_none() {
            out.push(s.clone());
        } else if !done.contains(&s.name) {
            done.push(s.name.clone());
            let trials: Vec<&FrameSeries> = all.iter().filter(|o| o.name == s.name).collect();
            let frames = trials.iter().map(|t| t.values.len()).min().unwrap_or(0);
            let values =
                (0..frames).map(|f| stats::median(&trials.iter().map(|t| t.values[f]).collect::<Vec<_>>())).collect();
            out.push(FrameSeries { name: s.name.clone(), unit: s.unit.clone(), trial: None, values });
        }
    }
    out
}

/// How a series is called where it is one of many.
fn heading(s: &FrameSeries) -> String {
    let unit = if s.unit.is_empty() || s.name.ends_with(&format!("_{}", s.unit)) {
        String::new()
    } else {
        format!(" ({})", s.unit)
    };
    let trial = s.trial.map_or_else(String::new, |t| format!(" trial {t}"));
    format!("{}{unit}{trial}", s.name)
}

/// A row a frame; shorter series end in empty fields.
pub fn csv(series: &[FrameSeries], frames: usize) -> String {
    let mut out = String::from("frame");
    series.iter().for_each(|s| out += &format!(",{}", heading(s)));
    out.push('\n');
    for f in 0..frames {
        out += &f.to_string();
        for s in series {
            out.push(',');
            if let Some(v) = s.values.get(f) {
                out += &v.to_string();
            }
        }
        out.push('\n');
    }
    out
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
