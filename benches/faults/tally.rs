//! What was done to the programs, and what was seen of them meanwhile.

use super::crew::Role;
use super::quantile;
use super::wrongs::NAMES;
use std::collections::BTreeMap;
use std::fmt::Write;

#[derive(Default)]
pub struct Tally {
    pub killed: [u64; 3],
    pub wrongs: [u64; 4],
    pub gave_up: Vec<String>,
    pub healthy_ms: Vec<f64>,
    pub troubled_ms: Vec<f64>,
    pub orphan_ms: Vec<f64>,
    pub recovered_ms: Vec<(&'static str, f64)>,
    pub requests: [u64; 2],
    pub violations: Vec<String>,
}

impl Tally {
    pub fn kills(&self) -> u64 {
        self.killed.iter().sum()
    }

    pub fn table(&mut self) -> String {
        let mut out = String::from("\n| fault | times |\n|---|---|\n");
        for role in [Role::Server, Role::Worker, Role::Child] {
            let _ = writeln!(out, "| SIGKILL to {} | {} |", role.word(), self.killed[role as usize]);
        }
        for (name, n) in NAMES.iter().zip(self.wrongs) {
            let _ = writeln!(out, "| {name} | {n} |");
        }
        out += "\n| seen | n | median ms | largest ms |\n|---|---|---|---|\n";
        let mut row = |name: &str, values: &mut [f64]| {
            if !values.is_empty() {
                let (half, most) = (quantile(values, 0.5), quantile(values, 1.0));
                let _ = writeln!(out, "| {name} | {} | {half:.0} | {most:.0} |", values.len());
            }
        };
        row("server started to healthy", &mut self.healthy_ms);
        row("the same while the disk was full or the database locked", &mut self.troubled_ms);
        row("parent killed to its child gone", &mut self.orphan_ms);
        for name in NAMES {
            let mut ms: Vec<f64> = self.recovered_ms.iter().filter(|r| r.0 == name).map(|r| r.1).collect();
            row(&format!("{name}: over to the next job done"), &mut ms);
        }
        let [answered, lost] = self.requests;
        let _ = writeln!(out, "\nlists of studies asked of a server that was healthy: {answered} answered, {lost} not");
        let mut kinds: BTreeMap<&str, u64> = BTreeMap::new();
        self.gave_up.iter().for_each(|g| *kinds.entry(g).or_default() += 1);
        for (what, n) in kinds {
            let _ = writeln!(out, "gave up by itself and was started again, {n} x: {what}");
        }
        out
    }
}
