//! The virtual machine of `tests/vm`, which has the devices that these tests need.

/// Whether the test runs in this machine; if not, a message says that it is skipped.
pub fn in_the_machine() -> bool {
    let there = std::env::var_os("VM_HAL").is_some_and(|set| set == "1");
    if !there {
        println!("skipped: needs the virtual machine of tests/vm/run");
    }
    there
}
