//! Wishes about lights: which stay as they are, which are off, and which follow another.
//!
//! A follower's radiance is that of its leader times a factor: a linear map from fewer variables to the
//! radiances, whose transpose carries gradients back.

use serde::{Deserialize, Serialize};

use super::{Constraints, FreeKinds, VariableKind, radiance::Radiance};
use crate::{files::nearest, lighting::Lighting, transport::Brought};

/// Wishes in the words of the command line and of the sidecar.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Wishes {
    /// Lights that stay as they are, or a variable of one, `LIGHT.size`; or `background`.
    pub lock: Vec<String>,
    /// Lights that are off.
    pub off: Vec<String>,
    /// The only lights that are on, if there are any.
    pub solo: Vec<String>,
    /// `fill=key*0.5`: radiance as a multiple of another light's.
    pub tie: Vec<String>,
    /// `fill=key/4` or `fill=key-2stops`: the mean luminance that a light brings to the main object as a
    /// multiple of what another brings.
    pub ratio: Vec<String>,
    /// `warm=key,fill`: lights whose radiances keep the ratio that they have, with one variable.
    pub group: Vec<String>,
}

/// Wishes that contradict each other or the scene.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct WishError(String);

/// What of a light is a multiple of its leader's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Followed {
    /// The radiance.
    Radiance,
    /// The mean luminance that the light brings to the main object.
    Brought,
}

/// A light that follows another.
#[derive(Clone, Debug, PartialEq)]
pub struct Bond {
    /// Index of the light that follows.
    pub light: usize,
    /// Index of the light that it follows.
    pub leader: usize,
    /// Multiple of the leader's.
    pub factor: f64,
    /// Of what.
    pub of: Followed,
    /// Words that ask for it.
    words: String,
}

/// A radiance that is a multiple of another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tie {
    /// Index of the light that follows.
    pub light: usize,
    /// Index of the light that it follows.
    pub leader: usize,
    /// Radiance of the follower over that of the leader, or with `brought` what the follower brings to the main object
    /// over what the leader brings.
    pub factor: f64,
    /// What leader and follower bring to the main object, where that depends on free sizes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brought: Option<Box<[Brought; 2]>>,
}

impl Tie {
    /// Radiance of the follower over that of the leader in the lighting `x`, with its derivatives by the sizes of
    /// leader and follower.
    #[must_use]
    pub fn ratio(&self, x: &Lighting) -> (f64, [f64; 2]) {
        let Some(brought) = &self.brought else { return (self.factor, [0.0; 2]) };
        let [(leader, by_leader), (follower, by_follower)] =
            [(&brought[0], self.leader), (&brought[1], self.light)].map(|(of, light)| of.at(x.size[light]));
        if follower <= 0.0 {
            // A light that brings nothing at a size has no ratio there.
            return (0.0, [0.0; 2]);
        }
        let ratio = self.factor * leader / follower;
        (ratio, [self.factor * by_leader / follower, -ratio * by_follower / follower])
    }
}

impl Wishes {
    /// These wishes and others.
    #[must_use]
    pub fn and(mut self, others: &Self) -> Self {
        let Self { lock, off, solo, tie, ratio, group } = others;
        for (mine, theirs) in [
            (&mut self.lock, lock),
            (&mut self.off, off),
            (&mut self.solo, solo),
            (&mut self.tie, tie),
            (&mut self.ratio, ratio),
            (&mut self.group, group),
        ] {
            mine.extend(theirs.iter().cloned());
        }
        self
    }

    /// Applies the wishes to the `radiance` of the lights of these names and to the constraints on their
    /// variables.
    ///
    /// # Errors
    /// When a wish names no light, cannot be read, or contradicts another: the error names both.
    pub fn apply(
        &self,
        names: &[&str],
        radiance: &mut [f64],
        constraints: &mut Constraints,
    ) -> Result<(), WishError> {
        let off = self.switched_off(names)?;
        let locked = self.lock(names, constraints)?;
        let bonds = self.bonds(names, radiance)?;
        for bond in &bonds {
            let (name, words) = (names[bond.light], &bond.words);
            if locked.contains(&bond.light) {
                return fail(format!("{words}: `{name}` is locked (lock {name})"));
            }
            if let Some(&light) = [bond.light, bond.leader].iter().find(|light| off.contains(light)) {
                return fail(format!("{words}: `{}` is off", names[light]));
            }
            drop_kind(&mut constraints.lights[bond.light].free, Radiance::KEYWORD);
        }
        if let Some(&light) = off.iter().find(|light| locked.contains(light)) {
            return fail(format!("`{0}` is off, and locked (lock {0})", names[light]));
        }
        for light in off {
            radiance[light] = 0.0;
            constraints.lights[light].keep();
        }
        constraints.bonds = bonds;
        constraints.groups = self.groups(names)?;
        Ok(())
    }

    /// Lights that are off.
    fn switched_off(&self, names: &[&str]) -> Result<Vec<usize>, WishError> {
        let of = |words: &[String], what: &str| -> Result<Vec<usize>, WishError> {
            words.iter().map(|word| light(names, word, what)).collect()
        };
        let (off, solo) = (of(&self.off, "off")?, of(&self.solo, "solo")?);
        if let Some(&both) = off.iter().find(|light| solo.contains(light)) {
            return fail(format!("`{0}` is asked for alone (solo {0}), and off (off {0})", names[both]));
        }
        Ok(if solo.is_empty() {
            off
        } else {
            (0..names.len()).filter(|light| !solo.contains(light)).collect()
        })
    }

    /// Locks variables, and returns the lights whose radiance is.
    fn lock(&self, names: &[&str], constraints: &mut Constraints) -> Result<Vec<usize>, WishError> {
        let mut locked = Vec::new();
        for word in &self.lock {
            if word == "background" && !names.contains(&"background") {
                drop_kind(&mut constraints.free, word);
                continue;
            }
            let (owner, kind) = match word.rsplit_once('.') {
                Some((owner, kind)) if !names.contains(&word.as_str()) => match variable(kind) {
                    Some(kind) => (owner, Some(kind)),
                    None => (word.as_str(), None),
                },
                _ => (word.as_str(), None),
            };
            let light = light(names, owner, "lock")?;
            let of_light = &mut constraints.lights[light];
            match kind {
                Some(kind) => drop_kind(&mut of_light.free, kind),
                None => of_light.keep(),
            }
            if kind.is_none_or(|kind| kind == Radiance::KEYWORD) {
                locked.push(light);
            }
        }
        Ok(locked)
    }

    /// Names of the groups with their leaders.
    fn groups(&self, names: &[&str]) -> Result<Vec<(String, usize)>, WishError> {
        let mut groups: Vec<(String, usize)> = Vec::new();
        for wish in &self.group {
            let Some((name, list)) = wish.split_once('=') else { continue };
            let name = name.trim();
            if names.contains(&name) || groups.iter().any(|(other, _)| other == name) {
                return fail(format!("group {wish}: a light or another group is called `{name}`"));
            }
            let leader = list.split(',').next().unwrap_or_default();
            groups.push((name.to_owned(), light(names, leader.trim(), "group")?));
        }
        Ok(groups)
    }

    /// Bonds of all lights, those of leaders before those of their followers.
    fn bonds(&self, names: &[&str], radiance: &[f64]) -> Result<Vec<Bond>, WishError> {
        let mut bonds = Vec::new();
        for (of, what, wishes) in
            [(Followed::Radiance, "tie", &self.tie), (Followed::Brought, "ratio", &self.ratio)]
        {
            for wish in wishes {
                let (light, leader, factor) = equation(names, wish, what)?;
                bonds.push(Bond { light, leader, factor, of, words: format!("{what} {wish}") });
            }
        }
        for wish in &self.group {
            bonds.extend(grouped(names, wish, radiance)?);
        }
        for (i, bond) in bonds.iter().enumerate() {
            let name = names[bond.light];
            if bond.light == bond.leader {
                return fail(format!("{}: `{name}` cannot follow itself", bond.words));
            }
            if let Some(other) = bonds[..i].iter().find(|other| other.light == bond.light) {
                return fail(format!(
                    "`{name}` cannot follow two lights: {} and {}",
                    other.words, bond.words
                ));
            }
        }
        let mut sorted: Vec<Bond> = Vec::new();
        while !bonds.is_empty() {
            let is_next = |bond: &&Bond| !bonds.iter().any(|other| other.light == bond.leader);
            let Some(i) = bonds.iter().position(|bond| is_next(&bond)) else {
                let words: Vec<&str> = bonds.iter().map(|bond| bond.words.as_str()).collect();
                return fail(format!("lights follow each other in a circle: {}", words.join(" and ")));
            };
            sorted.push(bonds.remove(i));
        }
        Ok(sorted)
    }
}

fn fail<T>(message: String) -> Result<T, WishError> {
    Err(WishError(message))
}

fn drop_kind(free: &mut FreeKinds, keyword: &str) {
    free.0.retain(|kind| kind.keyword() != keyword);
}

/// Keyword of a kind of variable that lights have, from it or from the last part of a variable's name.
fn variable(word: &str) -> Option<&'static str> {
    let of_light = VariableKind::all().filter(|kind| kind.is_of_light());
    let mut named = of_light.filter(|kind| kind.keyword() == word || kind.suffix() == word);
    named.next().map(|kind| kind.keyword())
}

/// Index of the light of a name.
fn light(names: &[&str], name: &str, what: &str) -> Result<usize, WishError> {
    names.iter().position(|known| *known == name).ok_or_else(|| {
        let hint = nearest(name, names.iter().copied())
            .map_or_else(|| format!("it has {}", names.join(", ")), |near| format!("did you mean `{near}`?"));
        WishError(format!("{what} {name}: the scene has no light `{name}`; {hint}"))
    })
}

/// Reads `fill=key`, with `*0.5`, `/4`, `-2stops` or `+1stop` behind it.
fn equation(names: &[&str], wish: &str, what: &str) -> Result<(usize, usize, f64), WishError> {
    let how = "write FOLLOWER=LEADER with *0.5, /4, -2stops or +1stop behind it";
    let (follower, rest) = wish.split_once('=').ok_or_else(|| WishError(format!("{what} {wish}: {how}")))?;
    let rest = rest.trim();
    // Names may hold the signs that follow them.
    let leader = (0..names.len())
        .filter(|&light| rest.starts_with(names[light]))
        .max_by_key(|&light| names[light].len());
    let end = |text: &str| text.find(['*', '/', '+', '-']).unwrap_or(text.len());
    let Some(leader) = leader else {
        return light(names, rest[..end(rest)].trim(), what).map(|l| (l, l, 1.0));
    };
    let factor = factor(rest[names[leader].len()..].trim());
    let factor = factor.filter(|factor| factor.is_finite() && *factor > 0.0);
    let factor = factor.ok_or_else(|| WishError(format!("{what} {wish}: {how}; the factor is above 0")))?;
    Ok((light(names, follower.trim(), what)?, leader, factor))
}

/// The factor that stands behind a leader.
fn factor(text: &str) -> Option<f64> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    if text.is_empty() {
        return Some(1.0);
    }
    if let Some(rest) = text.strip_prefix('*') {
        return number(rest);
    }
    if let Some(rest) = text.strip_prefix('/') {
        return number(rest).map(|v| 1.0 / v);
    }
    let stops = text.strip_suffix("stops").or_else(|| text.strip_suffix("stop"))?;
    text.starts_with(['+', '-']).then_some(())?;
    number(stops.trim_start_matches('+')).map(f64::exp2)
}

/// Bonds of the lights of a group `NAME=LIGHT,LIGHT…` to its first one.
fn grouped(names: &[&str], wish: &str, radiance: &[f64]) -> Result<Vec<Bond>, WishError> {
    let words = format!("group {wish}");
    let Some((_, list)) = wish.split_once('=').filter(|(name, list)| !name.is_empty() && list.contains(','))
    else {
        return fail(format!("{words}: write NAME=LIGHT,LIGHT with two lights or more"));
    };
    let lights: Vec<usize> =
        list.split(',').map(|name| light(names, name.trim(), "group")).collect::<Result<_, _>>()?;
    let leader = lights[0];
    if radiance[leader] <= 0.0 {
        return fail(format!("{words}: `{}` is dark, so that the others have no ratio to it", names[leader]));
    }
    let bond = |&light: &usize| Bond {
        light,
        leader,
        factor: radiance[light] / radiance[leader],
        of: Followed::Radiance,
        words: words.clone(),
    };
    Ok(lights[1..].iter().map(bond).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::variables::LightConstraints;

    const NAMES: [&str; 4] = ["key", "fill", "rim-1", "rim"];

    fn wishes(fill: impl Fn(&mut Wishes)) -> Result<(Constraints, Vec<f64>), WishError> {
        let mut wishes = Wishes::default();
        fill(&mut wishes);
        let mut constraints =
            Constraints { lights: vec![LightConstraints::default(); NAMES.len()], ..Constraints::default() };
        let mut radiance = vec![8.0, 2.0, 3.0, 1.0];
        wishes.apply(&NAMES, &mut radiance, &mut constraints)?;
        Ok((constraints, radiance))
    }

    fn strings(words: &[&str]) -> Vec<String> {
        words.iter().map(|&word| word.to_owned()).collect()
    }

    #[test]
    fn ties_ratios_and_groups_bind_lights() {
        let (constraints, _) = wishes(|w| {
            w.tie = strings(&["fill=rim-1*0.5"]);
            w.ratio = strings(&["rim-1 = key-2stops"]);
            w.group = strings(&["all=key,rim"]);
        })
        .unwrap();
        let found: Vec<(usize, usize, f64)> =
            constraints.bonds.iter().map(|b| (b.light, b.leader, b.factor)).collect();
        // Leaders come before their followers.
        assert_eq!(found, [(2, 0, 0.25), (1, 2, 0.5), (3, 0, 0.125)]);
        assert_eq!(constraints.groups, [("all".to_owned(), 0)]);
        let is_free = |light: usize, kind: &str| constraints.lights[light].free.contains(kind);
        assert!(!is_free(1, "radiance") && is_free(1, "size") && is_free(0, "radiance"));
        assert!(is_free(0, "size") && is_free(2, "size"), "sizes under a ratio");
        let (constraints, radiance) = wishes(|w| {
            w.lock = strings(&["key.size", "fill", "background"]);
            w.off = strings(&["rim"]);
        })
        .unwrap();
        assert_eq!(radiance, [8.0, 2.0, 3.0, 0.0]);
        assert!(
            constraints.lights[0].free.contains("radiance") && !constraints.lights[0].free.contains("size")
        );
        assert!(constraints.lights[1].free.0.is_empty() && !constraints.free.contains("background"));
        assert_eq!(wishes(|w| w.solo = strings(&["key"])).unwrap().1, [8.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn contradictions_name_both_sides() {
        let error = |fill: &dyn Fn(&mut Wishes)| wishes(fill).unwrap_err().to_string();
        type Case<'c> = (&'c dyn Fn(&mut Wishes), &'c [&'c str]);
        let cases: [Case; 10] = [
            (&|w| w.group = strings(&["rim=key,fill"]), &["group rim=key,fill", "called `rim`"]),
            (&|w| w.tie = strings(&["fill=key", "fill=rim/2"]), &["tie fill=key", "tie fill=rim/2"]),
            (&|w| w.tie = strings(&["fill=key", "key=fill"]), &["circle", "fill=key", "key=fill"]),
            (
                &|w| (w.lock, w.tie) = (strings(&["fill"]), strings(&["fill=key"])),
                &["tie fill=key", "lock fill"],
            ),
            (
                &|w| (w.off, w.tie) = (strings(&["key"]), strings(&["fill=key"])),
                &["fill=key", "`key` is off"],
            ),
            (&|w| (w.off, w.solo) = (strings(&["key"]), strings(&["key"])), &["solo key", "off key"]),
            (&|w| w.lock = strings(&["kee"]), &["lock kee", "did you mean `key`"]),
            (&|w| w.tie = strings(&["fill=key*-1"]), &["fill=key*-1", "above 0"]),
            (&|w| w.ratio = strings(&["fill"]), &["ratio fill", "FOLLOWER=LEADER"]),
            (&|w| w.group = strings(&["a=key"]), &["group a=key", "two lights"]),
        ];
        for (fill, parts) in cases {
            let said = error(fill);
            assert!(parts.iter().all(|part| said.contains(part)), "{said}");
        }
    }
}
