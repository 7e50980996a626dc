#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| sublevel::robot::motion::fuzzing::certificate(text));
