//! The name of a colour profile. Profiles themselves are not read.
//!
//! # References
//! \[ICC\] the tag `profileDescriptionTag`.

/// How an ICC profile describes itself, in English where it has a choice.
#[must_use]
pub fn description(profile: &[u8]) -> Option<String> {
    let count = be_u32(profile, 128)? as usize;
    let tag = profile.get(132..)?.chunks_exact(12).take(count).find(|tag| tag.starts_with(b"desc"))?;
    let (offset, size) = (be_u32(tag, 4)? as usize, be_u32(tag, 8)? as usize);
    let data = profile.get(offset..offset.checked_add(size)?)?;
    let text = match data.get(..4)? {
        // [ICC] textDescriptionType of version 2
        b"desc" => {
            let length = be_u32(data, 8)? as usize;
            String::from_utf8_lossy(data.get(12..12_usize.checked_add(length)?)?).into_owned()
        }
        // [ICC] multiLocalizedUnicodeType of version 4
        b"mluc" => {
            let count = be_u32(data, 8)? as usize;
            let records = || data.get(16..).unwrap_or_default().chunks_exact(12).take(count);
            let record = records().find(|r| r.starts_with(b"en")).or_else(|| records().next())?;
            let (length, offset) = (be_u32(record, 4)? as usize, be_u32(record, 8)? as usize);
            let units = data.get(offset..offset.checked_add(length)?)?.as_chunks().0;
            let units: Vec<u16> = units.iter().map(|&unit| u16::from_be_bytes(unit)).collect();
            String::from_utf16_lossy(&units)
        }
        _ => return None,
    };
    let shown: String = text.trim_matches('\0').chars().filter(|c| !c.is_control()).take(80).collect();
    (!shown.is_empty()).then_some(shown)
}

fn be_u32(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|&b| u32::from_be_bytes(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(desc: &[u8]) -> Vec<u8> {
        let mut profile = vec![0; 128];
        profile.extend(1_u32.to_be_bytes());
        profile.extend(b"desc");
        profile.extend(144_u32.to_be_bytes());
        profile.extend((desc.len() as u32).to_be_bytes());
        profile.extend(desc);
        profile
    }

    #[test]
    fn both_versions_of_profiles_tell_their_name() {
        let two = profile(b"desc\0\0\0\0\0\0\0\x08eciRGB\n\0");
        assert_eq!(description(&two).as_deref(), Some("eciRGB"));
        let mut text =
            b"mluc\0\0\0\0\0\0\0\x02\0\0\0\x0cdeDE\0\0\0\x02\0\0\0\x28enUS\0\0\0\x04\0\0\0\x2a".to_vec();
        text.extend("xP3".encode_utf16().flat_map(u16::to_be_bytes));
        assert_eq!(description(&profile(&text)).as_deref(), Some("P3"));
    }

    #[test]
    fn broken_profiles_have_no_name() {
        let whole = profile(b"desc\0\0\0\0\0\0\0\x03abc");
        for n in 0..whole.len() {
            assert_eq!(description(&whole[..n]), None, "{n}");
        }
        assert_eq!(description(&profile(b"desc\0\0\0\0\xff\xff\xff\xffabc")), None);
    }
}
