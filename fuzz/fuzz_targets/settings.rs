#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| sublevel::service::fuzzing::settings(text));
