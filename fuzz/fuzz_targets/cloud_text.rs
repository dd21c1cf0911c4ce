#![no_main]

use canaletto_io::import::CloudFormat;

libfuzzer_sys::fuzz_target!(|data: &[u8]| canaletto_fuzz::cloud(CloudFormat::Text, data));
