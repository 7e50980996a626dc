#![no_main]

use std::cell::LazyCell;

use sublevel::service::fuzzing::Served;

thread_local! {
    static SERVED: LazyCell<Served> = LazyCell::new(Served::start);
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| SERVED.with(|served| served.call(bytes)));
