//! What a shader type may not do does not compile, and the message says what is missing.

#[test]
fn what_is_forbidden_does_not_compile() {
    let cases = trybuild::TestCases::new();
    // Also has the others built, not only checked: some errors come with the types.
    cases.pass("tests/ui/pass/*.rs");
    cases.compile_fail("tests/ui/*.rs");
}
