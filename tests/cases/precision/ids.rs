//! Ids of objects are whole numbers, for any number of objects.

use super::*;
use canaletto::scene::Transfer;
use canaletto_io::picture::{EncodeSettings, PictureFormat, decode};

/// Two copies of two balls, with 2²⁴ and more other objects between their ids.
fn doubled_over_and_over() -> String {
    let mut text = String::from(
        "camera { eye 0.5 0.5 10; center 0.5 0.5 0; fovy 14; size 4 4 }
         film { sample \"center\" }
         prototype name=\"0\" { sphere { center 0 0 0; radius 0.4 } }\n",
    );
    for n in 1..=25 {
        let apart = [1, 25].iter().position(|near| *near == n).map_or("0 1000 0", |axis| ["1 0 0", "0 1 0"][axis]);
        let below = n - 1;
        text += &format!(
            "prototype name=\"{n}\" {{ instance of=\"{below}\"; instance of=\"{below}\" {{ translate {apart} }} }}\n"
        );
    }
    text + "instance of=\"25\""
}

#[test]
fn numbers_above_16_777_216_are_told_apart() {
    let scene = scene(&doubled_over_and_over(), &[]);
    let job = Job { aovs: vec![Aov::ObjectId, Aov::MaterialId], ..job(&scene, &scene.views[0]) };
    let picture = render(&World::build(scene).expect("a world"), &job, &()).expect("a picture").picture;
    let layer = picture.layer("object-id").expect("a layer");
    let mut numbers: Vec<u32> = (0..16).map(|i| layer.id(i)).filter(|id| *id > 0).collect();
    numbers.sort_unstable();
    numbers.dedup();
    assert_eq!(numbers, [1, 2, (1 << 24) + 1, (1 << 24) + 2]);
    // The ids are whole numbers in a file, too.
    let mut image = canaletto_io::picture::Image::from_rgb(4, 4, picture.pixels.iter().map(|c| c.to_array()));
    image.channels.push(canaletto_io::picture::Channel {
        name: "object_id.X".into(),
        data: layer.data.clone(),
        ids: layer.ids.clone(),
    });
    let bytes =
        PictureFormat::Exr.encode_image(&image, Transfer::None, &EncodeSettings::default(), &[]).expect("a file");
    let read = decode(&bytes).expect("a picture").image;
    let channel = read.channels.iter().find(|channel| channel.name == "object_id.X").expect("the channel");
    assert_eq!(channel.ids, layer.ids);
}
