//! Open Image Denoise, if there is one in the folder `OIDN_DIR`, and the errors if there is none.

use canaletto_oidn::{Oidn, OidnError, OidnPicture};
use std::path::Path;

/// A picture of two halves, dark and bright, with noise.
fn noisy(width: usize, height: usize) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let mut state = 1u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1u32 << 24) as f32
    };
    let clean: Vec<[f32; 3]> =
        (0..width * height).map(|i| if i % width < width / 2 { [0.1, 0.2, 0.3] } else { [2.0, 1.0, 0.5] }).collect();
    let noisy = clean.iter().map(|c| c.map(|v| v * 2.0 * noise())).collect();
    (clean, noisy)
}

fn error(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let squares = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| f64::from(a - b).powi(2));
    squares.sum::<f64>() / a.as_flattened().len() as f64
}

#[test]
fn noise_goes_away() {
    let Some(folder) = std::env::var_os("OIDN_DIR") else {
        eprintln!("skipped: OIDN_DIR names no folder of Open Image Denoise");
        return;
    };
    let oidn = Oidn::load(Path::new(&folder)).unwrap();
    let (width, height) = (64, 48);
    let (clean, color) = noisy(width, height);
    let normal = vec![[0.0, 0.0, 1.0]; color.len()];
    let plain = OidnPicture { width, height, color: &color, albedo: None, normal: None };
    let guided = OidnPicture { albedo: Some(&clean), normal: Some(&normal), ..plain };
    for picture in [plain, guided] {
        let denoised = oidn.denoise(&picture, 2).unwrap();
        assert!(error(&denoised, &clean) < 0.1 * error(&color, &clean));
    }
    // Normals without albedos are an error of the library, which is passed on.
    let wrong = OidnPicture { normal: Some(&normal), ..plain };
    assert!(matches!(oidn.denoise(&wrong, 1), Err(OidnError::Library(_))));
    let short = OidnPicture { albedo: Some(&clean[1..]), ..plain };
    assert!(matches!(oidn.denoise(&short, 1), Err(OidnError::Size { layer: "albedo", .. })));
}

#[test]
fn what_is_no_library_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let missing = Oidn::load(folder.path()).unwrap_err();
    assert!(matches!(&missing, OidnError::NotFound { .. }), "{missing}");
    let file = folder.path().join("libOpenImageDenoise.so.2");
    std::fs::write(&file, b"no library").unwrap();
    if cfg!(target_os = "linux") {
        let text = Oidn::load(folder.path()).unwrap_err().to_string();
        assert!(text.starts_with("can't load ") && text.contains("libOpenImageDenoise.so.2"), "{text}");
    }
}

/// A library without the functions, such as the system's own.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[test]
fn a_library_of_another_kind_is_told() {
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    let libc = maps.lines().filter_map(|line| line.split_whitespace().last()).find(|file| file.contains("libc.so"));
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("lib")).unwrap();
    std::fs::copy(libc.unwrap(), folder.path().join("lib/libOpenImageDenoise.so.2")).unwrap();
    let error = Oidn::load(folder.path()).unwrap_err();
    assert!(matches!(error, OidnError::Function { function: "oidnNewDevice", .. }), "{error}");
}
