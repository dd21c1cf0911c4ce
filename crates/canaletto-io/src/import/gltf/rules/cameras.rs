//! Cameras (glTF 2.0, 3.10.3).

use super::broken::Broken;
use super::json::{Value, list};
use super::place::Place;

pub(super) fn check(json: &Value, broken: &mut Broken) {
    let cameras = Place::Root.key("cameras");
    for (i, camera) in list(json, "cameras").iter().enumerate().filter(|(_, camera)| camera.is_object()) {
        let place = cameras.item(i);
        let [perspective, orthographic] = ["perspective", "orthographic"].map(|name| camera.get(name));
        if perspective.is_some() && orthographic.is_some() {
            broken.tell(&place, "it has both perspective and orthographic; one of them is expected");
        }
        let own = match camera.get("type").and_then(Value::as_str) {
            Some(kind @ "perspective") => perspective.is_none().then_some(kind),
            Some(kind @ "orthographic") => orthographic.is_none().then_some(kind),
            _ => None,
        };
        if let Some(kind) = own {
            broken.tell(&place, format!("its {kind} is missing"));
        }
        for (name, lens) in [("perspective", perspective), ("orthographic", orthographic)] {
            let number = |name: &str| lens?.get(name)?.as_f64();
            let place = place.key(name);
            if let Some((near, far)) = number("znear").zip(number("zfar")).filter(|(near, far)| far <= near) {
                broken.tell(&place, format!("zfar is {far} and znear {near}; zfar must be more than znear"));
            }
            for side in ["xmag", "ymag"] {
                if number(side) == Some(0.0) {
                    broken.tell(&place.key(side), "is 0; no side may be 0");
                }
            }
        }
    }
}
