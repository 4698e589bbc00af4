pub fn table() -> String {
    String::new()
}
pub fn nearest_table() -> String {
    String::new()
}
