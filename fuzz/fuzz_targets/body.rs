#![no_main]

use sublevel::scene::Geometry;

// A body file: refused with a reason, or proven, and then the same after it was written.
libfuzzer_sys::fuzz_target!(|text: &str| match Geometry::from_json(text) {
    Ok(body) => {
        let again = Geometry::from_json(&body.to_json()).expect("a file that was written");
        assert_eq!(again.id(), body.id());
    }
    Err(error) => {
        let why = error.to_string();
        assert!(!why.is_empty() && why.len() < 4096, "{why}");
    }
});
