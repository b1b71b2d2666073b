//! Comma-separated tables.

/// Rows as comma-separated lines, the first usually the header. A field is quoted where
/// it must be: RFC 4180 with `\n` for the end of a line.
///
/// # Errors
/// When a row has more or fewer fields than the first.
pub fn encode<R, F>(rows: impl IntoIterator<Item = R>) -> Result<Vec<u8>, csv::Error>
where
    R: IntoIterator<Item = F>,
    F: AsRef<[u8]>,
{
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.write_record(row)?;
    }
    writer.into_inner().map_err(|e| e.into_error().into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_quoted_where_they_must_be_and_read_back() {
        let rows = [["plain", "a,b"], ["say \"x\"", "two\nlines"], ["", "0.5"]];
        let text = encode(rows).unwrap();
        let want = "plain,\"a,b\"\n\"say \"\"x\"\"\",\"two\nlines\"\n,0.5\n";
        assert_eq!(String::from_utf8(text.clone()).unwrap(), want);
        let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(text.as_slice());
        let read: Vec<Vec<String>> = reader.deserialize().map(Result::unwrap).collect();
        assert_eq!(read, rows);
        assert!(encode([vec!["a", "b"], vec!["c"]]).is_err());
    }
}
