#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| canaletto_fuzz::model("a.glb", data));
