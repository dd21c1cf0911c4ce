#![no_main]

use canaletto_io::picture::PictureFormat;

libfuzzer_sys::fuzz_target!(|data: &[u8]| canaletto_fuzz::picture(PictureFormat::Png, data));
