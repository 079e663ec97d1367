//! Files that users sent, as the database knows them. The bytes lie beside it, by
//! their hash; whoever writes them there has checked them first.

use super::{Store, now_ms, read::utc};
use crate::error::{Error, ErrorKind, Result};
use serde::Serialize;
use sqlx::FromRow;

/// A file that is there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Upload {
    /// Hash of the content.
    pub id: String,
    /// `scene` or `path`.
    pub kind: String,
    pub name: String,
    pub bytes: u64,
    pub uploaded: String,
    /// How a manifest names it.
    pub reference: String,
    pub triangles: Option<u64>,
    pub frames: Option<u64>,
    /// What reading it left out or doubts.
    pub notes: Vec<String>,
}

#[derive(FromRow)]
struct Row {
    id: String,
    kind: String,
    name: String,
    bytes: i64,
    triangles: Option<i64>,
    frames: Option<i64>,
    notes_json: String,
    uploaded_ms: i64,
}

/// How manifests name uploads.
pub const PREFIX: &str = "upload:";

impl From<Row> for Upload {
    fn from(r: Row) -> Upload {
        Upload {
            reference: format!("{PREFIX}{}", r.name),
            id: r.id,
            kind: r.kind,
            name: r.name,
            bytes: r.bytes as u64,
            uploaded: utc(r.uploaded_ms),
            triangles: r.triangles.map(|n| n as u64),
            frames: r.frames.map(|n| n as u64),
            notes: serde_json::from_str(&r.notes_json).unwrap_or_default(),
        }
    }
}

const SELECT: &str = "SELECT id, kind, name, bytes, triangles, frames, notes_json, uploaded_ms FROM uploads";

impl Store {
    /// Notes a file. The same content again changes its name and time.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn add_upload(&self, u: &Upload) -> Result<Upload> {
        sqlx::query(
            "INSERT INTO uploads (id, kind, name, bytes, triangles, frames, notes_json, uploaded_ms) \
             VALUES ($1, $2, $3, $4, $5, $6, $7, $8) ON CONFLICT (id) DO UPDATE SET name = excluded.name, \
             kind = excluded.kind, triangles = excluded.triangles, frames = excluded.frames, \
             notes_json = excluded.notes_json, uploaded_ms = excluded.uploaded_ms",
        )
        .bind(&u.id)
        .bind(&u.kind)
        .bind(&u.name)
        .bind(u.bytes as i64)
        .bind(u.triangles.map(|n| n as i64))
        .bind(u.frames.map(|n| n as i64))
        .bind(serde_json::to_string(&u.notes).expect("notes are text"))
        .bind(now_ms())
        .execute(&self.writer)
        .await
        .map_err(|e| self.explain("an upload", &e))?;
        self.upload(&u.id).await
    }

    /// All of them, the latest first.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn uploads(&self) -> Result<Vec<Upload>> {
        let sql = format!("{SELECT} ORDER BY uploaded_ms DESC, id");
        let rows: Vec<Row> = sqlx::query_as(sqlx::AssertSqlSafe(sql))
            .fetch_all(&self.readers)
            .await
            .map_err(|e| self.explain("reading uploads", &e))?;
        Ok(rows.into_iter().map(Upload::from).collect())
    }

    /// One by its id.
    ///
    /// # Errors
    /// When there is none or the database fails.
    pub async fn upload(&self, id: &str) -> Result<Upload> {
        let sql = format!("{SELECT} WHERE id = $1");
        let row: Option<Row> = sqlx::query_as(sqlx::AssertSqlSafe(sql))
            .bind(id)
            .fetch_optional(&self.readers)
            .await
            .map_err(|e| self.explain("reading uploads", &e))?;
        row.map(Upload::from).ok_or_else(|| {
            Error::new(format!("there is no upload `{id}`")).kind(ErrorKind::Missing).help("list them at /uploads")
        })
    }

    /// # Errors
    /// When there is none or the database fails.
    pub async fn remove_upload(&self, id: &str) -> Result<Upload> {
        let upload = self.upload(id).await?;
        sqlx::query("DELETE FROM uploads WHERE id = $1")
            .bind(id)
            .execute(&self.writer)
            .await
            .map_err(|e| self.explain("an upload", &e))?;
        Ok(upload)
    }
}
