//! The program in the README is the example, which is compiled with the tests.

#[test]
fn the_readme_prints_the_example() {
    let readme = include_str!("../../README.md");
    let example = include_str!("../../examples/minimal.rs");
    let start = "```rust,no_run\n";
    let printed = readme.split_once(start).expect("a program").1;
    let printed = printed.split_once("```\n").expect("its end").0;
    let code = example.split_once("\n\n").expect("a headline").1;
    assert_eq!(printed, code);
    // Promised in the README.
    assert!(code.lines().count() <= 36, "{}", code.lines().count());
}
