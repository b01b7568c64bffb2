//! Types that other threads may own.

use ohmstrain::{Error, Estimate, Filter, LaggedFilter, Recording, Sensor};

const fn can_be_sent<T: Send + 'static>() {}
const fn can_be_shared<T: Sync>() {}

/// Test for the compiler: it does not compile otherwise.
#[test]
fn filters_and_rows_can_be_sent() {
    can_be_sent::<Filter>();
    can_be_sent::<LaggedFilter>();
    can_be_sent::<Sensor>();
    can_be_sent::<Estimate>();
    can_be_sent::<Error>();
    can_be_sent::<Recording<'static>>();
    can_be_shared::<Sensor>();
    can_be_shared::<Error>();
}
