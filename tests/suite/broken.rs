#[test]
fn show() {
    use glimt::scene::report::*;
    let mut names: Vec<_> = std::fs::read_dir("tests/broken").unwrap().map(|e| e.unwrap().path()).filter(|p| p.is_file()).collect();
    names.sort();
    for path in names {
        println!("=== {}", path.display());
        match glimt::scene::load(&path) {
            Ok(l) => println!("{}", render(&l.warnings, 110, Style::Plain)),
            Err(d) => println!("{}", render(&d, 110, Style::Plain)),
        }
    }
}
