use std::io::Cursor;

use ::png::{BitDepth, ColorType, Encoder, SourceChromaticities, SrgbRenderingIntent};
use ::tiff::encoder::{TiffEncoder, colortype};

use super::*;
use crate::math::display::eotf_srgb;

fn read(bytes: &[u8]) -> Picture {
    Picture::decode(bytes, &Reading::of(Purpose::Light)).unwrap()
}

fn refusal(bytes: &[u8]) -> String {
    Picture::decode(bytes, &Reading::of(Purpose::Light)).unwrap_err().to_string()
}

/// What a test PNG says of its colours.
#[derive(Clone, Copy, Default)]
struct Chunks {
    gamma: Option<u32>,
    is_srgb: bool,
    primaries: Option<[f32; 8]>,
    cicp: Option<[u8; 4]>,
    has_icc: bool,
}

/// One pixel of code (200, 100, 0).
fn png(chunks: Chunks) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, 1, 1);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    let mut writer = encoder.write_header().unwrap();
    let mut write =
        |name: &[u8; 4], data: &[u8]| writer.write_chunk(::png::chunk::ChunkType(*name), data).unwrap();
    if let Some(cicp) = chunks.cicp {
        write(b"cICP", &cicp);
    }
    if chunks.has_icc {
        // A name, the compression method, and an empty zlib stream.
        write(b"iCCP", b"icc\0\0\x78\x9c\x03\0\0\0\0\x01");
    }
    if chunks.is_srgb {
        write(b"sRGB", &[SrgbRenderingIntent::Perceptual as u8]);
    }
    if let Some(gamma) = chunks.gamma {
        write(b"gAMA", &gamma.to_be_bytes());
    }
    if let Some([rx, ry, gx, gy, bx, by, wx, wy]) = chunks.primaries {
        let c = SourceChromaticities::new((wx, wy), (rx, ry), (gx, gy), (bx, by));
        write(b"cHRM", &c.to_be_bytes());
    }
    writer.write_image_data(&[200, 100, 0]).unwrap();
    writer.finish().unwrap();
    bytes
}

/// Display P3.
const P3: [f32; 8] = [0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290];

#[test]
fn the_chunks_of_a_png_count_in_their_order_of_precedence() {
    let code = [200.0 / 255.0, 100.0 / 255.0, 0.0];
    let srgb = code.map(eotf_srgb);
    let p3 = primaries::P3_D65.to_rec709().unwrap();
    let in_p3 = |c: [f64; 3]| (p3 * glam::DVec3::from_array(c)).to_array();
    let none = Chunks::default();
    for (chunks, want) in [
        (none, srgb),
        (Chunks { gamma: Some(100_000), ..none }, code),
        (Chunks { gamma: Some(50_000), ..none }, code.map(|v| v * v)),
        // What stands for sRGB.
        (Chunks { gamma: Some(45_455), ..none }, srgb),
        (Chunks { gamma: Some(100_000), is_srgb: true, primaries: Some(P3), ..none }, srgb),
        (Chunks { primaries: Some(P3), ..none }, in_p3(srgb)),
        (Chunks { gamma: Some(100_000), primaries: Some(P3), ..none }, in_p3(code)),
        (Chunks { cicp: Some([12, 13, 0, 1]), ..none }, in_p3(srgb)),
        (Chunks { cicp: Some([12, 8, 0, 1]), gamma: Some(50_000), is_srgb: true, ..none }, in_p3(code)),
        (Chunks { cicp: Some([1, 13, 0, 1]), gamma: Some(100_000), has_icc: true, ..none }, srgb),
        (Chunks { gamma: Some(100_000), has_icc: true, ..none }, code),
    ] {
        let got = read(&png(chunks)).over_black(0);
        let is_close = got.iter().zip(want).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-4);
        assert!(is_close, "{got:?} {want:?}");
    }
}

#[test]
fn colours_that_are_not_known_are_refused_and_nonsense_is_said() {
    let none = Chunks::default();
    for (cicp, want) in [
        ([9, 16, 0, 1], "HDR displays (PQ)"),
        ([9, 18, 0, 1], "HDR displays (HLG)"),
        ([77, 13, 0, 1], "primaries 77"),
        ([1, 13, 0, 0], "coded as video"),
    ] {
        let text = refusal(&png(Chunks { cicp: Some(cicp), ..none }));
        assert!(text.contains(want) && text.contains("save it as sRGB"), "{text}");
    }
    let line = Chunks { primaries: Some([0.3; 8]), ..none };
    assert_eq!(read(&png(line)).notes, [Note::ChromaticitiesIgnored]);
    // glTF wants all of that ignored.
    let raw = Reading::of(Purpose::RawTexture);
    let linear = Chunks { gamma: Some(100_000), cicp: Some([9, 16, 0, 1]), ..none };
    let picture = Picture::decode(&png(linear), &raw).unwrap();
    assert_eq!((picture.colour, picture.notes.len()), (Colour::rec709(Transfer::Srgb), 0));
}

fn hdr(lines: &str) -> Vec<u8> {
    let mut bytes = format!("{lines}\n-Y 1 +X 2\n").into_bytes();
    // [Radiance] 128 · 2^(129 - 136) = 1, and half of that.
    bytes.extend([128, 64, 0, 129, 128, 128, 128, 128]);
    bytes
}

#[test]
fn the_factors_of_a_radiance_header_multiply() {
    let format = "FORMAT=32-bit_rle_rgbe\n";
    for (lines, want) in [
        (format!("#?RADIANCE\n{format}"), [1.0, 0.5, 0.0]),
        (format!("#?RADIANCE\nEXPOSURE=2\nview -vp 0 0 0\n{format}EXPOSURE=  4.0 \n"), [0.125, 0.0625, 0.0]),
        (format!("#?RGBE\n{format}COLORCORR= 2 1 1\nEXPOSURE=.5\nCOLORCORR=1 .5 1\n"), [1.0, 2.0, 0.0]),
        (format!("#?RADIANCE\n{format}PRIMARIES=.64 .33 .3 .6 .15 .06 .3127 .329\n"), [1.0, 0.5, 0.0]),
    ] {
        assert_eq!(read(&hdr(&lines)).over_black(0), want, "{lines}");
    }
    // The white of Radiance's own primaries becomes white.
    let own = format!("#?RADIANCE\n{format}PRIMARIES=.640 .330 .290 .600 .150 .060 .333 .333\n");
    let grey = read(&hdr(&own)).over_black(1);
    assert!(grey.iter().all(|v| (v - 0.5).abs() < 1e-4), "{grey:?}");
    for wrong in
        ["EXPOSURE=0", "EXPOSURE=-1", "EXPOSURE=nan", "EXPOSURE=1e400", "EXPOSURE=x", "COLORCORR=1 1"]
    {
        let text =
            Picture::decode(&hdr(&format!("#?RADIANCE\n{format}{wrong}\n")), &Reading::of(Purpose::Light));
        let source = std::error::Error::source(&text.unwrap_err()).unwrap().to_string();
        assert!(source.contains(wrong) && source.contains("makes no sense"), "{source}");
    }
    // 1, 1/2, 0 as X, Y, Z: the luminance is Y, but for its weights of four digits.
    let xyz = read(&hdr("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n"));
    assert!((xyz.luminance(0) - 0.5).abs() < 5e-4, "{}", xyz.luminance(0));
    assert!(matches!(
        Picture::decode(&hdr("#?RADIANCE\nFORMAT=other\n"), &Reading::of(Purpose::Light)),
        Err(Fault::Decode { .. })
    ));
}

#[test]
fn radiance_rows_may_run_in_every_order() {
    // What the picture looks like: 0 1 2 in the upper row, 3 4 5 in the lower.
    for (size, order) in [
        ("-Y 2 +X 3", [0, 1, 2, 3, 4, 5]),
        ("+Y 2 +X 3", [3, 4, 5, 0, 1, 2]),
        ("-Y 2 -X 3", [2, 1, 0, 5, 4, 3]),
        ("+Y 2 -X 3", [5, 4, 3, 2, 1, 0]),
        ("+X 3 -Y 2", [0, 3, 1, 4, 2, 5]),
        ("+X 3 +Y 2", [3, 0, 4, 1, 5, 2]),
        ("-X 3 -Y 2", [2, 5, 1, 4, 0, 3]),
        ("-X 3 +Y 2", [5, 2, 4, 1, 3, 0]),
    ] {
        let mut bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nPIXASPECT=1\n\n{size}\n").into_bytes();
        bytes.extend(order.iter().flat_map(|&v: &u8| [16 * v, 16 * v, 16 * v, 136]));
        let picture = read(&bytes);
        assert_eq!((picture.width, picture.height, picture.notes.len()), (3, 2, 0), "{size}");
        let values: Vec<f32> = (0..6).map(|i| picture.over_black(i)[0] / 16.0).collect();
        assert_eq!(values, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], "{size}");
    }
    let odd = read(&hdr("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nPIXASPECT=2\n"));
    assert_eq!(odd.notes, [Note::PixelAspect(2.0)]);
}

#[test]
fn tiff_samples_of_every_kind_are_read_as_they_are_meant() {
    type Encoder<'a> = TiffEncoder<&'a mut Cursor<Vec<u8>>>;
    let write = |write: &dyn Fn(&mut Encoder)| {
        let mut bytes = Cursor::new(Vec::new());
        write(&mut TiffEncoder::new(&mut bytes).unwrap());
        read(bytes.get_ref()).over_black(0)
    };
    let half = eotf_srgb(0.5) as f32;
    let close = |got: [f32; 3], want: [f32; 3]| got.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-4);
    let sixteen = write(&|t| t.write_image::<colortype::RGB16>(1, 1, &[32_768, 0, 65_535]).unwrap());
    assert!(close(sixteen, [half, 0.0, 1.0]), "{sixteen:?}");
    let integers = [
        write(&|t| t.write_image::<colortype::RGB32>(1, 1, &[1 << 31, 0, u32::MAX]).unwrap()),
        write(&|t| t.write_image::<colortype::RGB64>(1, 1, &[1 << 63, 0, u64::MAX]).unwrap()),
    ];
    assert!(integers.iter().all(|&got| close(got, [half, 0.0, 1.0])), "{integers:?}");
    let greys = [
        write(&|t| t.write_image::<colortype::Gray8>(1, 1, &[128]).unwrap()),
        write(&|t| t.write_image::<colortype::Gray16>(1, 1, &[32_768]).unwrap()),
        write(&|t| t.write_image::<colortype::Gray32>(1, 1, &[1 << 31]).unwrap()),
    ];
    assert!(greys.iter().all(|got| got.iter().all(|v| (v - half).abs() < 2e-3)), "{greys:?}");
    let floats = [
        write(&|t| t.write_image::<colortype::Gray32Float>(1, 1, &[1.5]).unwrap()),
        write(&|t| t.write_image::<colortype::Gray64Float>(1, 1, &[1.5]).unwrap()),
        write(&|t| t.write_image::<colortype::RGB32Float>(1, 1, &[1.5; 3]).unwrap()),
        write(&|t| t.write_image::<colortype::RGB64Float>(1, 1, &[1.5; 3]).unwrap()),
    ];
    assert!(floats.iter().all(|&got| got == [1.5; 3]), "{floats:?}");
    // No ink is white, full black is black.
    let mut paper = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut paper).unwrap();
    encoder.write_image::<colortype::CMYK8>(1, 1, &[0, 255, 0, 0]).unwrap();
    let texture = Picture::decode(paper.get_ref(), &Reading::of(Purpose::Texture)).unwrap();
    assert_eq!((texture.over_black(0), texture.notes), ([1.0, 0.0, 1.0], vec![Note::Cmyk]));
    assert!(refusal(paper.get_ref()).contains("its colours are CMYK, for print"));
    let mut signed = Cursor::new(Vec::new());
    TiffEncoder::new(&mut signed).unwrap().write_image::<colortype::GrayI8>(1, 1, &[5]).unwrap();
    assert!(refusal(signed.get_ref()).contains("signed integers"));
}

/// One pixel of Targa, 32 bits, with the given attribute bits and, with a footer of version 2, the
/// attributes type.
fn tga(bits: u8, kind: Option<u8>) -> Vec<u8> {
    let mut bytes = vec![0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 32, 0x20 | bits];
    bytes.extend([100, 100, 100, 51]);
    if let Some(kind) = kind {
        let extension = bytes.len() as u32;
        bytes.extend([0; 494]);
        bytes.push(kind);
        bytes.extend(extension.to_le_bytes());
        bytes.extend([0; 4]);
        bytes.extend(format::TGA_FOOTER);
    }
    bytes
}

#[test]
fn the_alpha_of_a_targa_is_what_its_attributes_say() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.tga");
    let light = eotf_srgb(100.0 / 255.0);
    for (bits, kind, share) in [
        (8, None, 0.2),
        (8, Some(3), 0.2),
        (8, Some(4), 1.0), // premultiplied
        (8, Some(2), 1.0), // no transparency
        (0, None, 1.0),
    ] {
        std::fs::write(&path, tga(bits, kind)).unwrap();
        let got = Picture::read(&path, &Reading::of(Purpose::Light)).unwrap().over_black(0)[0];
        assert!((f64::from(got) - share * light).abs() < 1e-6, "{bits} {kind:?}: {got}");
    }
    // The footer of version 2 tells the format, whatever the name.
    assert!((read(&tga(8, Some(4))).over_black(0)[0] - light as f32).abs() < 1e-6);
    assert!(matches!(
        Picture::decode(&tga(8, None), &Reading::of(Purpose::Light)),
        Err(Fault::UnknownFormat)
    ));
}

#[test]
fn premultiplied_colours_of_a_texture_are_divided_by_their_alpha() {
    let whole = include_bytes!("../../tests/data/pictures/premultiplied.tif");
    let twin = include_bytes!("../../tests/data/pictures/rgb16.tif");
    let reading = Reading::of(Purpose::Texture);
    let picture = Picture::decode(whole, &reading).unwrap();
    let opaque = Picture::decode(twin, &reading).unwrap();
    assert_eq!((picture.alpha, picture.has_alpha(), opaque.has_alpha()), (Alpha::Premultiplied, true, false));
    for i in [0, 31] {
        let ([r, g, b, a], light) = (picture.straight(i), picture.over_black(i));
        assert!((a - 0.5).abs() < 1e-4 && ((r - light[0] / a).abs() + (g - light[1] / a).abs()) < 1e-5);
        assert!(b >= light[2]);
    }
}

/// 8-bit samples of a row, their number to a pixel, and further entries (tag, value) of a directory.
type Page<'a> = (&'a [u8], u32, &'a [(u16, u32)]);

/// A TIFF of uncompressed pages, each of one row.
fn tiff_pages(pages: &[Page]) -> Vec<u8> {
    let mut bytes = b"II*\0".to_vec();
    for (samples, n_samples, more) in pages {
        let data = bytes.len() as u32 + 4;
        let directory = data + samples.len().next_multiple_of(2) as u32;
        bytes.extend(directory.to_le_bytes());
        bytes.extend(*samples);
        bytes.resize(directory as usize, 0);
        let width = samples.len() as u32 / n_samples;
        let mut entries = vec![
            (256, width),
            (257, 1),
            (258, 8),
            (259, 1),
            (262, if *n_samples == 1 { 1 } else { 2 }),
            (273, data),
            (277, *n_samples),
            (278, 1),
            (279, samples.len() as u32),
        ];
        entries.retain(|(tag, _)| more.iter().all(|(other, _)| other != tag));
        entries.extend(*more);
        entries.sort_unstable();
        bytes.extend((entries.len() as u16).to_le_bytes());
        for (tag, value) in entries {
            bytes.extend([tag.to_le_bytes(), 3_u16.to_le_bytes()].concat());
            bytes.extend([1, value].map(u32::to_le_bytes).concat());
        }
    }
    bytes.extend([0; 4]);
    bytes
}

#[test]
fn a_preview_is_not_taken_for_the_picture_of_a_tiff() {
    let preview: &[(u16, u32)] = &[(254, 1)];
    let mask: &[(u16, u32)] = &[(254, 4)];
    let first = |pages: &[Page]| {
        let picture = read(&tiff_pages(pages));
        (picture.width, (picture.stored(0)[0] * 255.0).round(), picture.notes)
    };
    assert_eq!(first(&[(&[7], 1, preview), (&[0], 1, mask), (&[9, 9], 1, &[])]), (2, 9.0, vec![]));
    assert_eq!(first(&[(&[9, 9], 1, &[]), (&[7], 1, preview)]), (2, 9.0, vec![Note::FurtherPages]));
    // Nothing else is there.
    assert_eq!(first(&[(&[7], 1, preview)]), (1, 7.0, vec![]));
    for (raw, want) in [(330, "sub-directory"), (50_706, "DNG")] {
        let text = refusal(&tiff_pages(&[(&[7], 1, &[(254, 1), (raw, 8)])]));
        assert!(text.contains(want) && text.contains("save it again"), "{text}");
    }
}

#[test]
fn further_channels_of_a_tiff_are_left_out_or_refused_where_they_would_mislead() {
    let extra: &[(u16, u32)] = &[(338, 0)];
    let picture = read(&tiff_pages(&[(&[1, 2, 3, 99, 4, 5, 6, 99], 4, extra)]));
    let codes = |i: usize| picture.stored(i).map(|v| (v * 255.0).round());
    assert_eq!([codes(0), codes(1)], [[1.0, 2.0, 3.0, 255.0], [4.0, 5.0, 6.0, 255.0]]);
    let predicted = tiff_pages(&[(&[1, 2, 3, 99, 3, 3, 3, 0], 4, &[(317, 2), (338, 0)])]);
    assert!(refusal(&predicted).contains("further channels"), "{}", refusal(&predicted));
    let backwards = tiff_pages(&[(&[1], 1, &[(266, 2)])]);
    assert!(refusal(&backwards).contains("FillOrder 2"));
}

#[test]
fn a_table_of_brightness_in_a_tiff_is_said_to_be_ignored() {
    assert_eq!(read(&tiff_pages(&[(&[7], 1, &[(301, 0)])])).notes, [Note::TransferIgnored]);
}

#[test]
fn white_is_zero_is_turned_around() {
    for (zero, want) in [(1, 200.0), (0, 55.0)] {
        let picture = read(&tiff_pages(&[(&[200], 1, &[(262, zero)])]));
        assert_eq!((picture.stored(0)[0] * 255.0).round(), want);
    }
}
