//! A format whose codec was left out is refused by name. Without codecs this is run by hand, since it compiles the
//! library anew: `cargo test --profile tests -p canaletto-io --no-default-features --test features`.

use canaletto::film::Picture;
use canaletto::scene::{Developing, Transfer};
use canaletto_io::assets::{Asset, AssetPath, MemoryAssets};
use canaletto_io::image::read_image;
use canaletto_io::movie::{Movie, MovieFormat, MovieSettings, Rate};
use canaletto_io::picture::{
    Compression, EncodeSettings, Image, PictureFormat, Rendered, WriteOptions, announced_size, decode,
};
use canaletto_io::text::read_scene_text;

/// The features with the first bytes of their files.
const CODECS: [(&str, bool, &[u8]); 4] = [
    ("exr", cfg!(feature = "exr"), b"\x76\x2f\x31\x01"),
    ("jpeg", cfg!(feature = "jpeg"), b"\xff\xd8"),
    ("png", cfg!(feature = "png"), b"\x89PNG\r\n\x1a\n"),
    ("webp", cfg!(feature = "webp"), b"RIFF\0\0\0\0WEBP"),
];

fn names_feature(told: &str, feature: &str) -> bool {
    told.contains(&format!("without canaletto-io's feature \"{feature}\""))
}

#[test]
fn files_are_refused_by_name() {
    for (feature, is_on, start) in CODECS {
        let asset = Asset { path: AssetPath::base(), bytes: start.to_vec() };
        for told in [decode(start).unwrap_err().to_string(), read_image(&asset).unwrap_err().to_string()] {
            assert_eq!(names_feature(&told, feature), !is_on, "{told}");
        }
        assert_eq!(announced_size(start), None);
    }
    let told = decode(b"no picture").unwrap_err().to_string();
    for (name, is_on) in [("PNG", cfg!(feature = "png")), ("OpenEXR", cfg!(feature = "exr")), ("Radiance HDR", true)] {
        assert_eq!(told.contains(name), is_on, "{told}");
    }
}

#[test]
fn textures_in_ktx2_are_refused_by_name() {
    let asset = Asset { path: AssetPath::base(), bytes: b"\xabKTX 20\xbb\r\n\x1a\n".to_vec() };
    let told = read_image(&asset).unwrap_err().to_string();
    assert_eq!(names_feature(&told, "ktx2"), !cfg!(feature = "ktx2"), "{told}");
}

#[test]
fn pictures_and_films_are_refused_by_name() {
    let (picture, image) = (Picture::new(2, 2), Image::from_rgb(2, 2, [[0.5; 3]; 4].into_iter()));
    let (settings, developing) = (EncodeSettings::default(), Developing::default());
    for (format, feature, is_on) in
        [(PictureFormat::Png, "png", cfg!(feature = "png")), (PictureFormat::Exr, "exr", cfg!(feature = "exr"))]
    {
        let rendered = Rendered { picture: &picture, developing };
        assert_eq!(PictureFormat::written().any(|written| written == format), is_on);
        for made in [
            format.encode(&rendered, &settings, &[], &|| true),
            format.encode_image(&image, Transfer::Srgb, &settings, &[]),
        ] {
            let told =
                made.map_or_else(|error| error.to_string(), |bytes| decode(&bytes).map(|_| String::new()).unwrap());
            assert_eq!(names_feature(&told, feature), !is_on, "{told}");
        }
    }
    let folder = tempfile::tempdir().unwrap();
    for (format, feature, is_on) in
        [(MovieFormat::Apng, "png", cfg!(feature = "png")), (MovieFormat::Gif, "gif", cfg!(feature = "gif"))]
    {
        let settings = MovieSettings {
            width: 2,
            height: 2,
            rate: Rate::new(10.0),
            frames: 1,
            transfer: Transfer::Srgb,
            alpha: false,
            compression: Compression::Default,
            metadata: Vec::new(),
        };
        let begun = Movie::begin(format, &folder.path().join("film"), WriteOptions::default(), settings);
        let told = begun.map_or_else(|error| error.to_string(), |_| String::new());
        assert_eq!(names_feature(&told, feature), !is_on, "{told}");
    }
}

/// The scene text needs no codec, and a texture is refused at its place.
#[test]
fn scene_texts_need_no_codec() {
    let text = "texture \"t\" kind=\"image\" file=\"a.png\"\nsphere { center 0 0 0; radius 1 }\n";
    let assets = MemoryAssets::new().with("a.png", b"\x89PNG\r\n\x1a\n".to_vec());
    let told = read_scene_text(text, "a.kdl", &assets, &[]).unwrap_err().to_string();
    assert_eq!(names_feature(&told, "png"), !cfg!(feature = "png"), "{told}");
    let (scene, _) = read_scene_text("sphere { center 0 0 0; radius 1 }", "a.kdl", &assets, &[]).unwrap();
    assert_eq!(scene.nodes.len(), 1);
}
