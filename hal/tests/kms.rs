//! The display back-end against the kernel's virtual display; runs in the machine of `tests/vm` only.

/// Whether this runs in the machine of `tests/vm`.
fn in_the_machine() -> bool {
    let there = std::env::var_os("VM_HAL").is_some_and(|set| set == "1");
    if !there {
        println!("skipped: needs the virtual machine of tests/vm/run");
    }
    there
}

#[test]
fn the_machine_has_one_card() {
    if !in_the_machine() {
        return;
    }
    assert!(std::fs::exists("/dev/dri/card0").unwrap());
}
