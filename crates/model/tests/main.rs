//! Tests of the sensor's model through the public interface. One test program; a module for each subject.

mod parts;
mod response;
mod switched;
mod validation;
