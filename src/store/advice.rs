//! What an adviser chose for the places of a study.

use super::Store;
use crate::error::Result;
use crate::results::Advised;

impl Store {
    /// Keeps `advice` as that of the study, in place of what was there for the same places
    /// and metrics.
    ///
    /// # Errors
    /// When there is no such study or the database fails.
    pub async fn record_advice(&self, study: &str, advice: &[Advised]) -> Result<()> {
        let study = self.find(study).await?;
        let explain = |e: sqlx::Error| self.explain("the advice", &e);
        let mut tx = self.begin("the advice").await?;
        let old: String = sqlx::query_scalar("SELECT advice_json FROM studies WHERE id = $1")
            .bind(study.id)
            .fetch_one(&mut *tx)
            .await
            .map_err(explain)?;
        let place = |a: &Advised| (a.scene.clone(), a.path.clone(), a.metric.clone());
        let mut all: Vec<Advised> = self.parse(&old, "the advice")?;
        all.retain(|a| advice.iter().all(|new| place(new) != place(a)));
        all.extend_from_slice(advice);
        sqlx::query("UPDATE studies SET advice_json = $2 WHERE id = $1")
            .bind(study.id)
            .bind(serde_json::to_string(&all).expect("advice is plain data"))
            .execute(&mut *tx)
            .await
            .map_err(explain)?;
        tx.commit().await.map_err(explain)
    }
}
