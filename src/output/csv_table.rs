//! Tables as CSV.

/// The head of a column, and what it has for a row.
pub(crate) type Column<Row> = (&'static str, fn(&Row) -> String);

pub(crate) fn csv_table<'a, Row: 'a>(columns: &[Column<Row>], rows: impl IntoIterator<Item = &'a Row>) -> Vec<u8> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut write = |cells: Vec<String>| writer.write_record(cells).expect("rows of one length can be written to memory");
    write(columns.iter().map(|(name, _)| (*name).to_owned()).collect());
    for row in rows {
        write(columns.iter().map(|(_, cell)| cell(row)).collect());
    }
    writer.into_inner().expect("memory can be flushed")
}
