//! Films decoded frame by frame with third-party decoders.

use super::*;
use std::fs;
use std::io::Cursor;

/// A small square that moves over a ramp.
fn frame(index: u32) -> Image {
    let (width, height) = (20, 12);
    let pixel = |i: u32| {
        let (x, y) = (i % width, i / width);
        let square = (x as i32 - 3 - 2 * index as i32).abs() <= 2 && y.abs_diff(6) <= 2;
        if square { [1.0, 0.2, 0.0] } else { [x as f32 / 19.0, y as f32 / 11.0, 0.4] }
    };
    Image::from_rgb(width, height, (0..width * height).map(pixel))
}

fn settings(fps: f64, frames: u32) -> MovieSettings {
    let metadata = vec![("scene".to_owned(), "ball.kdl".to_owned())];
    MovieSettings {
        width: 20,
        height: 12,
        rate: Rate::new(fps),
        frames,
        transfer: Transfer::Srgb,
        alpha: false,
        compression: Compression::Default,
        metadata,
    }
}

fn bytes_of(image: &Image) -> Vec<u8> {
    let [r, g, b] = image.rgb().unwrap();
    let level = |v: f32| (v * 255.0).round() as u8;
    (0..r.len()).flat_map(|i| [level(r[i]), level(g[i]), level(b[i])]).collect()
}

fn film(format: MovieFormat, fps: f64, images: &[Image]) -> Result<Vec<u8>, MovieError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film");
    let mut movie = Movie::begin(format, &path, WriteOptions::default(), settings(fps, images.len() as u32))?;
    for image in images {
        movie.add(image)?;
        assert!(!path.exists(), "nothing has the film's name before it is whole");
    }
    movie.finish()?;
    let names: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names, ["film"]);
    Ok(fs::read(&path).unwrap())
}

#[test]
fn an_apng_gives_its_frames_back() {
    let images: Vec<Image> = [0, 1, 1, 2, 5].into_iter().map(frame).collect();
    let bytes = film(MovieFormat::Apng, 12.5, &images).unwrap();
    let mut reader = ::png::Decoder::new(Cursor::new(&bytes)).read_info().unwrap();
    let control = reader.info().animation_control.unwrap();
    assert_eq!((control.num_frames, control.num_plays), (5, 0));
    assert!(reader.info().srgb.is_some());
    assert!(reader.info().uncompressed_latin1_text.iter().any(|t| t.keyword == "scene" && t.text == "ball.kdl"));
    let mut canvas = vec![0; 20 * 12 * 3];
    let mut data = vec![0; reader.output_buffer_size().unwrap()];
    for image in &images {
        let info = reader.next_frame(&mut data).unwrap();
        let control = *reader.info().frame_control().unwrap();
        assert_eq!((control.delay_num, control.delay_den), (2, 25));
        for y in 0..info.height as usize {
            let to = ((control.y_offset as usize + y) * 20 + control.x_offset as usize) * 3;
            let length = info.width as usize * 3;
            canvas[to..to + length].copy_from_slice(&data[y * info.line_size..y * info.line_size + length]);
        }
        assert_eq!(canvas, bytes_of(image));
    }
    assert!(reader.next_frame(&mut data).is_err());
    // Viewers without support for animation, and [`crate::picture::decode`], see the first frame.
    assert_eq!(bytes_of(&crate::picture::decode(&bytes).unwrap().image), bytes_of(&images[0]));
}

#[test]
fn a_gif_gives_its_frames_back() {
    let images: Vec<Image> = [0, 1, 1, 2, 5].into_iter().map(frame).collect();
    let bytes = film(MovieFormat::Gif, 30.0, &images).unwrap();
    let mut options = ::gif::DecodeOptions::new();
    options.set_color_output(::gif::ColorOutput::RGBA);
    let mut reader = options.read_info(Cursor::new(&bytes)).unwrap();
    assert_eq!((reader.width(), reader.height(), reader.repeat()), (20, 12, ::gif::Repeat::Infinite));
    let mut canvas = vec![0; 20 * 12 * 3];
    let mut delays = Vec::new();
    for image in &images {
        let frame = reader.read_next_frame().unwrap().unwrap();
        delays.push(frame.delay);
        for (i, pixel) in frame.buffer.chunks_exact(4).enumerate() {
            let (x, y) = (i % frame.width as usize, i / frame.width as usize);
            let to = ((frame.top as usize + y) * 20 + frame.left as usize + x) * 3;
            canvas[to..to + 3].copy_from_slice(&pixel[..3]);
        }
        // The picture has 217 colours, so none is changed.
        assert_eq!(canvas, bytes_of(image));
    }
    assert!(reader.read_next_frame().unwrap().is_none());
    // 30 frames per second in hundredths; the sum is exact.
    assert_eq!(delays, [3, 4, 3, 3, 4]);
}

#[test]
fn many_colours_become_256_near_ones() {
    let (w, h) = (64, 64);
    let image = Image::from_rgb(w, h, (0..w * h).map(|i| [(i % w) as f32 / 63.0, (i / w) as f32 / 63.0, 0.5]));
    let settings = || MovieSettings { width: w, height: h, ..settings(10.0, 1) };
    let write = || {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gif");
        let mut movie = Movie::begin(MovieFormat::Gif, &path, WriteOptions::default(), settings()).unwrap();
        movie.add(&image).unwrap();
        movie.finish().unwrap();
        fs::read(path).unwrap()
    };
    let bytes = write();
    assert_eq!(bytes, write(), "the same film twice");
    let mut options = ::gif::DecodeOptions::new();
    options.set_color_output(::gif::ColorOutput::RGBA);
    let mut reader = options.read_info(Cursor::new(&bytes)).unwrap();
    let frame = reader.read_next_frame().unwrap().unwrap();
    let right = bytes_of(&image);
    let errors = frame
        .buffer
        .chunks_exact(4)
        .zip(right.chunks_exact(3))
        .map(|(a, b)| (0..3).map(|c| f64::from(a[c].abs_diff(b[c])).powi(2)).sum::<f64>());
    let rms = (errors.sum::<f64>() / f64::from(3 * w * h)).sqrt();
    // 4096 colours in a square are reduced to 256. A regular choice of 16 × 16 has an error of 16/√12 · √(2/3) = 3.8
    // levels.
    assert!(rms < 5.0, "{rms}");
}

#[test]
fn the_part_that_changed() {
    let (a, b) = (bytes_of(&frame(0)), bytes_of(&frame(1)));
    assert_eq!(changed(&[], &a, [20, 12], 3), Area { left: 0, top: 0, width: 20, height: 12 });
    assert_eq!(changed(&a, &a, [20, 12], 3), Area { left: 0, top: 0, width: 1, height: 1 });
    assert_eq!(changed(&a, &b, [20, 12], 3), Area { left: 1, top: 4, width: 7, height: 5 });
}

#[test]
fn what_does_not_fit_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gif");
    let begin = |format, settings| Movie::begin(format, &path, WriteOptions::default(), settings);
    let wrong = |e: MovieError| e.to_string();
    let fast = begin(MovieFormat::Gif, settings(60.0, 2)).err().map(wrong).unwrap();
    assert!(fast.contains("at most 50 frames a second"), "{fast}");
    let wide = MovieSettings { width: 70_000, ..settings(25.0, 2) };
    assert!(begin(MovieFormat::Gif, wide).err().map(wrong).unwrap().contains("70000"));
    let mut movie = begin(MovieFormat::Gif, settings(25.0, 2)).unwrap();
    movie.add(&frame(0)).unwrap();
    let small = Image::from_rgb(1, 1, [[0.0; 3]].into_iter());
    assert!(wrong(movie.add(&small).unwrap_err()).contains("doesn't fit"));
    assert_eq!(wrong(movie.finish().unwrap_err()), "the film has 1 of its 2 frames");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left");
}
