//! All integration tests, one binary. Each file is one area; test names are sentences.

mod common;

mod culling;
mod end_to_end;
mod faults;
mod generators;
mod manifest;
mod oracle;
mod preflight;
mod readers;
mod report;
mod scenes;
mod service;
mod service_faults;
mod store;
mod structures;
mod tidy;
mod viewing;
