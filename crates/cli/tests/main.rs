//! The program as a whole: its output, files and exit codes. A single test program, which is linked once and shares
//! calibrations; one module per subject.

mod common;

mod bad_input;
mod batch;
mod browser;
mod calibration_input;
mod channels;
mod closing;
mod estimates;
mod estimators;
mod evaluate_split;
mod explain;
mod export;
mod export_budget;
mod export_parts;
mod export_pauses;
mod export_protections;
mod figures;
mod fit_law;
mod fleet;
mod foreign_text;
mod guide;
mod hand;
mod hostile_readings;
mod import_property;
mod interrupted;
mod lab_files;
mod live;
mod manners;
mod marks;
mod outputs;
mod own_files;
mod pipeline;
mod record;
mod refine;
mod resumed;
mod rows_out;
mod sensor_numbers;
mod serial_check;
mod serve;
mod streaming;
mod suits;
mod temperature;
mod validity;
