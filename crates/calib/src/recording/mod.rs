//! Checks of recordings before the fits.

pub(crate) mod arranged;
pub(crate) mod drift;
pub(crate) mod holds;
pub(crate) mod lag;
pub(crate) mod repeats;
pub(crate) mod resolution;
pub(crate) mod rest;
pub(crate) mod screen;
pub(crate) mod sessions;
pub(crate) mod turns;
