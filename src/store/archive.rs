//! A study in one file.
