//! What the service costs, beside its targets: `cargo bench --bench service`, or with
//! names of figures after `--` (`pages`, `submit`, `load`, `watch`, `claims`, `overhead`).
//!
//! The server is the program itself, over TCP on this machine, with durable commits on the
//! disk as in use. Finished studies are made through the store, leases and all, of records
//! made by hand; the large one on a RAM disk where there is one, and kept in
//! `target/tmp` for the next time.

#[path = "service/claims.rs"]
mod claims;
#[path = "service/http.rs"]
mod http;
#[path = "service/load.rs"]
mod load;
#[path = "service/made.rs"]
mod made;
#[path = "service/overhead.rs"]
mod overhead;
#[path = "service/pages.rs"]
mod pages;
#[path = "service/server.rs"]
mod server;
#[path = "service/show.rs"]
mod show;
#[path = "service/submit.rs"]
mod submit;
#[path = "service/watch.rs"]
mod watch;

const FIGURES: &[(&str, fn())] = &[
    ("pages", pages::figure),
    ("submit", submit::figure),
    ("load", load::figure),
    ("watch", watch::figure),
    ("claims", claims::figure),
    ("overhead", overhead::figure),
];

fn main() {
    // Counted before any thread leaves the measuring lane.
    cullmark::machine::cores();
    let asked: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let is_asked = |name: &str| asked.is_empty() || asked.iter().any(|a| name.starts_with(a.as_str()));
    let machine = cullmark::machine::environment(None);
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    println!("{}, {} build; load {}", machine.machine_class, machine.build_profile, load.trim());
    show::fsync();
    for (name, figure) in FIGURES.iter().filter(|(name, _)| is_asked(name)) {
        println!("\n{name}");
        show::heading();
        figure();
    }
}
