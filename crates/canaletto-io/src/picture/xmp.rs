//! Texts of a file as an XMP packet (ISO 16684-1), which JPEG and WebP hold. Programs for photos show it.

use super::format::Texts;

/// The namespace of this program's texts.
const NAMESPACE: &str = "https://canaletto.invalid/ns/1.0/";

/// What begins and ends a text.
const ITEM: [&str; 3] = ["<rdf:li canaletto:key=\"", "\">", "</rdf:li>"];

/// The characters that XML writes as entities.
const ENTITIES: [(char, &str); 4] = [('&', "&amp;"), ('<', "&lt;"), ('>', "&gt;"), ('"', "&quot;")];

/// A packet with these texts.
pub(super) fn packet(texts: &Texts) -> String {
    let [begin, middle, end] = ITEM;
    let items: Vec<String> = texts
        .iter()
        .map(|(key, text)| format!("    {begin}{}{middle}{}{end}\n", escaped(key), escaped(text)))
        .collect();
    format!(
        "<?xpacket begin=\"\u{feff}\" id=\"W5M0MpCehiHzreSzNTczkc9d\"?>\n\
         <x:xmpmeta xmlns:x=\"adobe:ns:meta/\">\n \
         <rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">\n  \
         <rdf:Description rdf:about=\"\" xmlns:canaletto=\"{NAMESPACE}\">\n   \
         <canaletto:texts><rdf:Bag>\n{}   </rdf:Bag></canaletto:texts>\n  \
         </rdf:Description>\n </rdf:RDF>\n</x:xmpmeta>\n<?xpacket end=\"r\"?>",
        items.concat()
    )
}

/// The texts of a packet that this program wrote; none of others.
pub(super) fn texts(packet: &[u8]) -> Vec<(String, String)> {
    let [begin, middle, end] = ITEM;
    let Some(packet) = std::str::from_utf8(packet).ok().filter(|packet| packet.contains(NAMESPACE)) else {
        return Vec::new();
    };
    let items = packet.split(begin).skip(1);
    let text = |item: &str| {
        let (key, rest) = item.split_once(middle)?;
        Some((unescaped(key), unescaped(rest.split_once(end)?.0)))
    };
    items.filter_map(text).collect()
}

fn escaped(text: &str) -> String {
    let mut all = String::with_capacity(text.len());
    for c in text.chars() {
        match ENTITIES.iter().find(|(plain, _)| *plain == c) {
            Some((_, entity)) => all.push_str(entity),
            // XML can't hold these.
            None if c < ' ' && !matches!(c, '\n' | '\t' | '\r') => all.push(' '),
            None => all.push(c),
        }
    }
    all
}

fn unescaped(text: &str) -> String {
    // The ampersand comes last, so that what it makes isn't taken for an entity.
    ENTITIES.iter().rev().fold(text.to_owned(), |text, (plain, entity)| text.replace(entity, &plain.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_come_back() {
        let given: Vec<(String, String)> =
            [("scene", "a <b> & \"c\" &lt;.kdl"), ("Title", "Veneza à noite\n→ água"), ("", "")]
                .map(|(key, text)| (key.to_owned(), text.to_owned()))
                .to_vec();
        assert_eq!(texts(packet(&given).as_bytes()), given);
        assert!(texts(packet(&given).replace("canaletto.invalid", "example.org").as_bytes()).is_empty());
        assert!(texts(&[0xff, 0xfe]).is_empty());
        let whole = packet(&given);
        for cut in (0..whole.len()).filter(|cut| whole.is_char_boundary(*cut)) {
            assert!(texts(&whole.as_bytes()[..cut]).len() <= given.len());
        }
    }
}
