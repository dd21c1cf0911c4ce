//! Radii and colours of the chemical elements.

use canaletto::math::Rgb;
use canaletto::texture::srgb_decode;

/// The appearance of an atom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Element {
    /// The van der Waals radius in ångström.
    pub(super) radius: f32,
    /// The colour, linear.
    pub(super) color: Rgb,
}

impl Element {
    /// The appearance of an atom of an unknown element.
    pub(super) const UNKNOWN: Element = Element { radius: 2.0, color: Rgb::gray(0.5) };
}

/// The element of a symbol or an atomic number, such as `C`, `cl` or `6`. A number or a mark after a symbol
/// distinguishes atoms of one element: `C1`, `Fe2+`, `O_w`. `D` and `T` are hydrogen.
pub(super) fn element(name: &[u8]) -> Option<Element> {
    let letters = name.iter().take_while(|byte| byte.is_ascii_alphabetic()).count();
    let index = if letters == 0 {
        let number: usize = std::str::from_utf8(name).ok()?.parse().ok()?;
        number.checked_sub(1)?
    } else {
        let symbol = match &name[..letters] {
            b"D" | b"T" => b"H",
            symbol => symbol,
        };
        ELEMENTS.iter().position(|(known, ..)| known.as_bytes().eq_ignore_ascii_case(symbol))?
    };
    let (_, hundredths, color) = *ELEMENTS.get(index)?;
    let channel = |shift: u32| srgb_decode((color >> shift & 0xff) as f32 / 255.0);
    Some(Element { radius: f32::from(hundredths) / 100.0, color: Rgb::new(channel(16), channel(8), channel(0)) })
}

/// The symbol, van der Waals radius in hundredths of an ångström (Alvarez 2013; 200 where it has none) and sRGB colour
/// (Jmol) of each element, from hydrogen on.
const ELEMENTS: [(&str, u16, u32); 109] = [
    ("H", 120, 0xff_ffff),
    ("He", 143, 0xd9_ffff),
    ("Li", 212, 0xcc_80ff),
    ("Be", 198, 0xc2_ff00),
    ("B", 191, 0xff_b5b5),
    ("C", 177, 0x90_9090),
    ("N", 166, 0x30_50f8),
    ("O", 150, 0xff_0d0d),
    ("F", 146, 0x90_e050),
    ("Ne", 158, 0xb3_e3f5),
    ("Na", 250, 0xab_5cf2),
    ("Mg", 251, 0x8a_ff00),
    ("Al", 225, 0xbf_a6a6),
    ("Si", 219, 0xf0_c8a0),
    ("P", 190, 0xff_8000),
    ("S", 189, 0xff_ff30),
    ("Cl", 182, 0x1f_f01f),
    ("Ar", 183, 0x80_d1e3),
    ("K", 273, 0x8f_40d4),
    ("Ca", 262, 0x3d_ff00),
    ("Sc", 258, 0xe6_e6e6),
    ("Ti", 246, 0xbf_c2c7),
    ("V", 242, 0xa6_a6ab),
    ("Cr", 245, 0x8a_99c7),
    ("Mn", 245, 0x9c_7ac7),
    ("Fe", 244, 0xe0_6633),
    ("Co", 240, 0xf0_90a0),
    ("Ni", 240, 0x50_d050),
    ("Cu", 238, 0xc8_8033),
    ("Zn", 239, 0x7d_80b0),
    ("Ga", 232, 0xc2_8f8f),
    ("Ge", 229, 0x66_8f8f),
    ("As", 188, 0xbd_80e3),
    ("Se", 182, 0xff_a100),
    ("Br", 186, 0xa6_2929),
    ("Kr", 225, 0x5c_b8d1),
    ("Rb", 321, 0x70_2eb0),
    ("Sr", 284, 0x00_ff00),
    ("Y", 275, 0x94_ffff),
    ("Zr", 252, 0x94_e0e0),
    ("Nb", 256, 0x73_c2c9),
    ("Mo", 245, 0x54_b5b5),
    ("Tc", 244, 0x3b_9e9e),
    ("Ru", 246, 0x24_8f8f),
    ("Rh", 244, 0x0a_7d8c),
    ("Pd", 215, 0x00_6985),
    ("Ag", 253, 0xc0_c0c0),
    ("Cd", 249, 0xff_d98f),
    ("In", 243, 0xa6_7573),
    ("Sn", 242, 0x66_8080),
    ("Sb", 247, 0x9e_63b5),
    ("Te", 199, 0xd4_7a00),
    ("I", 204, 0x94_0094),
    ("Xe", 206, 0x42_9eb0),
    ("Cs", 348, 0x57_178f),
    ("Ba", 303, 0x00_c900),
    ("La", 298, 0x70_d4ff),
    ("Ce", 288, 0xff_ffc7),
    ("Pr", 292, 0xd9_ffc7),
    ("Nd", 295, 0xc7_ffc7),
    ("Pm", 200, 0xa3_ffc7),
    ("Sm", 290, 0x8f_ffc7),
    ("Eu", 287, 0x61_ffc7),
    ("Gd", 283, 0x45_ffc7),
    ("Tb", 279, 0x30_ffc7),
    ("Dy", 287, 0x1f_ffc7),
    ("Ho", 281, 0x00_ff9c),
    ("Er", 283, 0x00_e675),
    ("Tm", 279, 0x00_d452),
    ("Yb", 280, 0x00_bf38),
    ("Lu", 274, 0x00_ab24),
    ("Hf", 263, 0x4d_c2ff),
    ("Ta", 253, 0x4d_a6ff),
    ("W", 257, 0x21_94d6),
    ("Re", 249, 0x26_7dab),
    ("Os", 248, 0x26_6696),
    ("Ir", 241, 0x17_5487),
    ("Pt", 229, 0xd0_d0e0),
    ("Au", 232, 0xff_d123),
    ("Hg", 245, 0xb8_b8d0),
    ("Tl", 247, 0xa6_544d),
    ("Pb", 260, 0x57_5961),
    ("Bi", 254, 0x9e_4fb5),
    ("Po", 200, 0xab_5c00),
    ("At", 200, 0x75_4f45),
    ("Rn", 200, 0x42_8296),
    ("Fr", 200, 0x42_0066),
    ("Ra", 200, 0x00_7d00),
    ("Ac", 280, 0x70_abfa),
    ("Th", 293, 0x00_baff),
    ("Pa", 288, 0x00_a1ff),
    ("U", 271, 0x00_8fff),
    ("Np", 282, 0x00_80ff),
    ("Pu", 281, 0x00_6bff),
    ("Am", 283, 0x54_5cf2),
    ("Cm", 305, 0x78_5ce3),
    ("Bk", 340, 0x8a_4fe3),
    ("Cf", 305, 0xa1_36d4),
    ("Es", 270, 0xb3_1fd4),
    ("Fm", 200, 0xb3_1fba),
    ("Md", 200, 0xb3_0da6),
    ("No", 200, 0xbd_0d87),
    ("Lr", 200, 0xc7_0066),
    ("Rf", 200, 0xcc_0059),
    ("Db", 200, 0xd1_004f),
    ("Sg", 200, 0xd9_0045),
    ("Bh", 200, 0xe0_0038),
    ("Hs", 200, 0xe6_002e),
    ("Mt", 200, 0xeb_0026),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symbols_and_numbers_name_elements() {
        let carbon = element(b"C").unwrap();
        assert_eq!(carbon.radius, 1.77);
        for name in ["c", "6", "C1", "C_alpha", "C-"] {
            assert_eq!(element(name.as_bytes()), Some(carbon), "{name}");
        }
        assert_eq!(element(b"D"), element(b"H"));
        assert_eq!(element(b"CL").unwrap().radius, 1.82);
        for name in ["", "Xx", "0", "-1", "200", "Carbon"] {
            assert_eq!(element(name.as_bytes()), None, "{name}");
        }
        // The atomic number is the position in the list.
        for (symbol, number) in [("Ne", 10), ("Fe", 26), ("Xe", 54), ("Au", 79), ("U", 92), ("Mt", 109)] {
            assert_eq!(ELEMENTS[number - 1].0, symbol);
        }
    }
}
