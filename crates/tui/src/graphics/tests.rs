use super::*;

fn noise(level: u8, i: u32) -> [u8; 3] {
    let hash = (i + 1).wrapping_mul(0x9E37_79B1) ^ (i * i).wrapping_mul(0x85EB_CA77);
    [level, (hash >> 13) as u8, (hash >> 22) as u8]
}

fn placement(level: u8, x: u16) -> PlacedImage {
    let pixels = (0..64 * 48).map(|i| noise(level, i)).collect();
    let picture = Arc::new(Srgb8Image { width: 64, height: 48, pixels });
    PlacedImage { picture, cells: Rect::new(x, 1, 8, 3), cell: (8, 16) }
}

fn all(images: &mut TerminalImages) -> String {
    let slices = std::iter::from_fn(|| images.next_slice(5000, None)).flatten().collect();
    String::from_utf8(slices).expect("ASCII")
}

#[test]
fn newest_image_replaces_pending_ones() {
    let mut images = TerminalImages::new(ImageProtocol::Kitty, false);
    assert!(images.is_complete() && images.next_slice(5000, None).is_none());
    let (first, second, third) = (placement(1, 2), placement(2, 2), placement(3, 2));
    images.set_target(Some(first), false);
    let begin = String::from_utf8(images.next_slice(100, None).expect("a piece")).expect("ASCII");
    assert!(begin.starts_with("\x1b_Ga=T,f=100,i=6777961,p=1,c=8,r=3,C=1,q=2,m=1;"), "{begin}");
    // If several images arrive while one is being sent, only the last of them is sent.
    images.set_target(Some(second), false);
    images.set_target(Some(third.clone()), true);
    let rest = all(&mut images);
    assert_eq!(rest.matches("a=T").count(), 1);
    assert_eq!(rest.matches("\x1b7\x1b[2;3H").count(), 2, "each image should appear with its last chunk");
    assert!(images.is_complete());
    images.set_target(Some(third), true);
    assert_eq!(all(&mut images), "");
}

#[test]
fn kitty_chunks_are_short_and_images_alternate() {
    let mut images = TerminalImages::new(ImageProtocol::Kitty, false);
    images.set_target(Some(placement(1, 2)), true);
    let first = all(&mut images);
    for command in first.split("\x1b\\").filter(|command| command.contains(';') && command.contains("_G")) {
        let data = command.rsplit(';').next().expect("data");
        assert!(data.len() <= 4096);
    }
    assert!(first.contains("a=d,d=I,i=7173121,q=2"));
    images.set_target(Some(placement(2, 2)), true);
    let second = all(&mut images);
    assert!(second.contains("a=T,f=100,i=7173121") && second.contains("a=d,d=I,i=6777961,q=2"));
}

#[test]
fn moving_an_image_uncovers_its_old_cells() {
    for protocol in [ImageProtocol::Kitty, ImageProtocol::Sixel, ImageProtocol::Iterm] {
        let mut images = TerminalImages::new(protocol, false);
        assert_eq!(images.set_target(Some(placement(1, 2)), true), None);
        all(&mut images);
        assert_eq!(images.set_target(Some(placement(2, 2)), true), None, "no cells should be uncovered");
        all(&mut images);
        assert_eq!(images.set_target(Some(placement(2, 3)), true), Some(Rect::new(2, 1, 8, 3)));
        all(&mut images);
        assert_eq!(images.set_target(None, true), Some(Rect::new(3, 1, 8, 3)));
        assert_eq!(all(&mut images).contains("a=d"), protocol == ImageProtocol::Kitty);
        assert!(images.is_complete());
    }
}

#[test]
fn slow_connections_get_coarser_images() {
    let mut images = TerminalImages::new(ImageProtocol::Iterm, false);
    let picture = placement(1, 2);
    images.set_target(Some(picture.clone()), false);
    let coarse = images.next_slice(5000, Some(1000.0)).expect("a picture").len();
    assert!(images.is_complete());
    images.set_target(Some(picture), true);
    assert!(!images.is_complete(), "a final image should keep more detail");
    let fine = images.next_slice(5000, Some(10_000.0)).expect("a picture").len();
    assert!(coarse * 4 < fine, "{coarse} {fine}");
    assert!(images.is_complete());
}

#[test]
fn sequences_are_wrapped_inside_tmux() {
    assert_eq!(tmux_passthrough(b"\x1b_Gx\x1b\\"), b"\x1bPtmux;\x1b\x1b_Gx\x1b\x1b\\\x1b\\");
    let mut images = TerminalImages::new(ImageProtocol::Iterm, true);
    images.set_target(Some(placement(1, 2)), true);
    let bytes = all(&mut images);
    assert!(
        bytes.starts_with("\x1b7\x1b[2;3H\x1b[0m \x1bPtmux;\x1b\x1b[D\x1b\x1b]1337;File=inline=1;size="),
        "{bytes}"
    );
    assert!(bytes.ends_with("\x07\x1b\\\x1b8"));
}

#[test]
fn sixel_size_and_colors_match_the_image() {
    let mut placed = placement(0, 0);
    let pixels = (0..64 * 48).map(|i| if i % 64 < 32 { [255, 0, 0] } else { [0, 0, 255] }).collect();
    placed.picture = Arc::new(Srgb8Image { width: 64, height: 48, pixels });
    let mut images = TerminalImages::new(ImageProtocol::Sixel, true);
    images.set_target(Some(placed), true);
    let bytes = all(&mut images);
    assert!(bytes.contains("\x1bP0;1;0q\"1;1;64;48#16;2;100;0;0#17;2;0;0;100"), "{bytes}");
    assert!(bytes.contains("#16!32~$#17!32?!32~$-"), "{bytes}");
    assert!(bytes.ends_with("-\x1b\\\x1b8"));
    assert_eq!(bytes.matches('-').count(), 8, "48 rows should form 8 bands");
}

#[test]
fn sixel_images_are_resized_to_their_cells() {
    // Six bits represent these channel values exactly, so no dithering is needed.
    let color = |x: u32, y: u32| [(85 * x) as u8, (85 * y) as u8, 255 * ((x + y) % 2) as u8];
    // The window is 64 × 48 pixels, so the images are scaled by 16 and by 1/10.
    for (width, height) in [(4, 3), (640, 480)] {
        let pixels = (0..width * height).map(|i| color(i % width * 4 / width, i / width * 3 / height));
        let mut placed = placement(0, 0);
        placed.picture = Arc::new(Srgb8Image { width, height, pixels: pixels.collect() });
        let mut images = TerminalImages::new(ImageProtocol::Sixel, false);
        images.set_target(Some(placed), true);
        let mut screen = TestImageTerminal::default();
        screen.process_output(all(&mut images).as_bytes());
        let shown = screen.displayed_image().expect("a picture");
        assert_eq!((shown.width, shown.height), (64, 48));
        for (i, pixel) in (0..).zip(&shown.pixels) {
            let expected = color(i % 64 / 16, i / 64 / 16);
            // Sixel levels are percentages.
            let off = pixel.iter().zip(expected).map(|(a, b)| a.abs_diff(b)).max();
            assert!(off <= Some(2), "{width}×{height}, pixel {i}: {pixel:?} {expected:?}");
        }
    }
}
