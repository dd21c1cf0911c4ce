#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| canaletto_fuzz::scene_text(data));
